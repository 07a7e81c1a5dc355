"""Trajectory files: TUM as in evo, csv (written only), and trajectories in bags."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from slams.formats import recording
from slams.formats.kind import BAG_KINDS, is_bag_folder, kind_of
from slams.formats.options import SourceOptions
from slams.formats.packed import text_of
from slams.ros.attitude import headings
from slams.scanlog import TimeSeries
from slams.types import Floats
from slams.validation import expect

TUM_COLUMNS = "t x y z qx qy qz qw"  # columns [s, m]
MAX_DISORDER_SHARE = 0.1  # of the stamps that may be earlier than the stamp before them
MIN_QUATERNION_NORM = 1e-6  # of a quaternion that is a rotation


def write_csv(path: str | Path, t: Floats, poses: Floats) -> None:
    """Write `t,x,y,theta` lines [s, m, m, rad] with a header; poses (n, 3)."""
    table = np.column_stack([t, poses])
    digits = ["%.6f", "%.9f", "%.9f", "%.9f"]
    np.savetxt(path, table, fmt=digits, delimiter=",", header="t,x,y,theta", comments="")


def write_tum(path: str | Path, t: Floats, poses: Floats) -> None:
    """Write `t x y z qx qy qz qw` lines; poses (n, 3) lie in the plane z = 0."""
    zero, half = np.zeros(len(t)), 0.5 * poses[:, 2]
    table = np.column_stack(
        [t, poses[:, 0], poses[:, 1], zero, zero, zero, np.sin(half), np.cos(half)]
    )
    np.savetxt(path, table, fmt="%.9f", header=TUM_COLUMNS)


def read_trajectory(
    spec: str | Path, log_path: str | Path | None = None, options: SourceOptions | None = None
) -> TimeSeries:
    """The trajectory of another program: a file, or a topic or tf frame of the log's bag.

    `spec` is searched in this order ("/name" always means a topic or frame, never a file):

    1. A file: TUM, plain or compressed by gzip, or result.mcap with poses on /pose.
    2. A topic of the bag `log_path`: Odometry, PoseStamped, PoseWithCovarianceStamped, or the
       last message of a Path. Poses of a frame that is fixed to the log's base are transformed.
    3. A tf frame of that bag, such as "map": the base's poses in it, at the stamps of the most
       frequent transform between them. The others are interpolated as by tf, x and y linearly and
       the heading by the shorter rotation; only fixed transforms are extrapolated.

    Args:
        spec: name of the file, topic or frame.
        log_path: the log that the trajectory belongs to.
        options: how the log was read; its `base_frame` and `scan_topic` decide the base.

    Returns:
        Stamps (n,) [s] and poses (n, 3), n >= 2, all finite. Stamps are sorted; of equal ones the
        first recorded is kept, as in tf.

    Raises:
        OSError: there is no such file, or it cannot be opened.
        ValueError: there is no such topic or frame, or no trajectory in it: fewer than two stamps,
            poses that are not finite, stamps in disorder. The sentence names the reason.
    """
    name, options = str(spec), options or SourceOptions()
    if is_file(name):
        return _in_order(name, read_poses(Path(name), options.salvage))
    if log_path is None or kind_of(Path(log_path)) not in BAG_KINDS:
        error = "a directory without a bag" if Path(name).is_dir() else "no such file"
        log = "without a bag there are" if log_path is None else f"{log_path} is no bag, it has"
        raise FileNotFoundError(f"{name}: {error}; {log} no topics and frames")
    options = replace(options, truth=name, imu="none")
    poses = recording.read([Path(log_path)], options, recording.Recording.poses)
    return _in_order(f"{log_path}: {name}", poses)


def read_poses(path: Path, salvage: bool = False) -> TimeSeries:
    """The poses in a file, as recorded: TUM, or /pose of a result.mcap.

    Raises:
        OSError: the file cannot be opened.
        ValueError: the file is neither; the sentence names its content.
    """
    kind = kind_of(path)
    expect(kind != "npz", f"{path}", "an npz file", "a trajectory: TUM or a bag")
    if kind not in BAG_KINDS:
        return TimeSeries(*read(path))
    options = SourceOptions(odom="none", imu="none", truth="/pose", salvage=salvage)
    return recording.read([path], options, recording.Recording.poses)


def is_file(spec: str) -> bool:
    """Whether a trajectory's name is a file or the folder of a ROS 2 bag.

    Raises:
        OSError: a folder cannot be read.
    """
    path = Path(spec)
    return path.is_file() or (path.is_dir() and is_bag_folder(path))


def read(path: str | Path) -> tuple[Floats, Floats]:
    """Stamps (n,) [s] and poses (n, 3) of a TUM file, compressed by gzip or not, all finite.

    Lines that begin with # are comments.

    Raises:
        OSError: the file cannot be opened.
        ValueError: it is no TUM file; the sentence names its content.
    """
    lines = [line.strip() for line in text_of(Path(path)).split("\n")]
    rows = [line for line in lines if line and line[0] != "#"]
    expect(len(rows) > 0, f"{path}", "no poses", "a trajectory")
    try:
        table: Floats = np.loadtxt(rows, ndmin=2)
    except ValueError as error:
        raise ValueError(f"{path}: not lines of {TUM_COLUMNS} ({error})") from error
    columns = table.shape[1]
    expect(columns == len(TUM_COLUMNS.split()), f"{path}", f"{columns} columns", TUM_COLUMNS)
    with np.errstate(over="ignore", invalid="ignore"):
        is_rotation = np.linalg.norm(table[:, 4:], axis=1) > MIN_QUATERNION_NORM
        heading = np.where(is_rotation, headings(table[:, 4:]), np.nan)
    poses = np.column_stack([table[:, 1:3], heading])
    n_broken = int((~np.isfinite(np.column_stack([table[:, 0], poses]))).any(axis=1).sum())
    if n_broken:
        problem = f"{n_broken} of {len(table)} poses are not finite or no rotation"
        raise ValueError(f"{path}: {problem}, expected numbers")
    return table[:, 0], poses


def _in_order(name: str, poses: TimeSeries) -> TimeSeries:
    """The poses sorted by stamp, of equal stamps the first one; at least two poses."""
    n_earlier = int((np.diff(poses.t) < 0.0).sum())
    if n_earlier > MAX_DISORDER_SHARE * len(poses.t):
        error = f"{n_earlier} of {len(poses.t)} stamps are earlier than the stamp before them"
        raise ValueError(f"{name}: {error}; expected poses in the order of time")
    t, first = np.unique(poses.t, return_index=True)
    got = f"{len(poses.t)} poses at one stamp ({t[0]:.6g} s)"
    expect(len(t) > 1, name, got, "a trajectory")
    return TimeSeries(t, poses.values[first])
