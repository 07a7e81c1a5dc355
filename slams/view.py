"""A run in the rerun viewer: map, scan, path and match quality, live or as a recording (.rrd).

Needs the extra `viz`; nothing else of slams does.
"""

from __future__ import annotations

import math
import os
from importlib import import_module
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from slams.formats.occupancy import UNKNOWN
from slams.types import IDENTITY

if TYPE_CHECKING:
    from slams.types import Floats, Pose2, Scan, Slam

LIVE = "live"
MAP_PERIOD = 1.0  # s of the log from one drawing of the map to the next
PATH_PERIOD = 0.5  # s of the log from one drawing of the path to the next
PATH_COLOR, SCAN_COLOR, ROBOT_COLOR = (231, 76, 60), (20, 110, 200), (39, 174, 96)
MAP_HEIGHT = -0.02  # m: the map lies under scan and path


def load_rerun() -> Any:
    """The rerun library.

    Raises:
        LookupError: the extra is not installed.
    """
    try:
        rerun = import_module("rerun")
    except ImportError:
        rerun = None
    if not hasattr(rerun, "RecordingStream"):  # a folder of that name can be imported, too
        raise LookupError(
            "--view needs the viewer rerun, which is not installed: pip install rerun-sdk, "
            "or open the result of --mcap in RViz or Foxglove"
        )
    return rerun


class View:
    """Takes every pose of a run as it comes.

    Args:
        target: "live" opens the viewer; anything else is the .rrd file to write.
        slam: the algorithm, asked for its map and, where it has one, its quality.
        title: what the viewer calls the run.

    Raises:
        LookupError: the extra `viz` is not installed.
        ValueError: the target has another ending than .rrd.
        OSError: its folder does not exist, or it is one.
    """

    def __init__(self, target: str, slam: Slam, title: str) -> None:
        self._rr = load_rerun()
        self._slam = slam
        self._poses: list[Pose2] = []  # so far
        self._path = None if target == LIVE else _checked(Path(target))
        # equal runs give equal recordings; in an open viewer they would run into each other
        name = None if self._path is None else title
        self._stream = self._rr.RecordingStream(f"slams: {title}", recording_id=name)
        if self._path is None:
            self._stream.spawn()
        else:
            self._stream.save(self._partial(self._path))
        self._start = 0.0
        self._map_at = self._path_at = -math.inf

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None
    ) -> None:
        complete = False
        try:
            if kind is None and self._poses:
                self._log_map()
                self._log_path()
            complete = kind is None
        finally:
            self._stream.disconnect()
            if self._path is not None and complete:
                self._partial(self._path).replace(self._path)
            elif self._path is not None:
                self._partial(self._path).unlink(missing_ok=True)

    def watch(self, scan: Scan, pose: Pose2) -> None:
        """See one scan and the pose that was found for it."""
        if not self._poses:
            self._start = scan.t
        if not np.isfinite(pose).all():  # the replay refuses it
            pose = self._poses[-1] if self._poses else IDENTITY
        self._poses.append(pose)
        self._stream.set_time("log", duration=scan.t - self._start)
        self._stream.set_time("scan", sequence=len(self._poses) - 1)
        self._log_scan(scan, pose)
        if abs(scan.t - self._map_at) >= MAP_PERIOD:  # also where stamps jump back
            self._map_at = scan.t
            self._log_map()
        if abs(scan.t - self._path_at) >= PATH_PERIOD:
            self._path_at = scan.t
            self._log_path()

    def _log_scan(self, scan: Scan, pose: Pose2) -> None:
        rr, points = self._rr, _flat(pose.transform(_hits(scan)))
        self._stream.log("map/scan", rr.Points3D(points, colors=[SCAN_COLOR], radii=[0.03]))
        nose = pose.transform(np.array([[0.0, 0.0], [0.4, 0.0]]))
        self._stream.log(
            "map/robot", rr.LineStrips3D([_flat(nose)], colors=[ROBOT_COLOR], radii=[0.06])
        )
        quality = getattr(self._slam, "quality", None)
        if quality is not None:
            self._stream.log("match", rr.Scalars(float(quality)))

    def _log_path(self) -> None:
        path = _flat(np.array(self._poses)[:, :2])
        strip = self._rr.LineStrips3D([path], colors=[PATH_COLOR], radii=[0.02])
        self._stream.log("map/path", strip)

    def _log_map(self) -> None:
        rr, grid = self._rr, self._slam.map()
        gray = np.where(np.isnan(grid.p), UNKNOWN, 255.0 * (1.0 - grid.p)).astype(np.uint8)[::-1]
        height, width = gray.shape
        self._stream.log(
            "map/grid",
            rr.GridMap(
                data=gray.tobytes(),
                format=rr.components.ImageFormat(
                    width=width, height=height, color_model="L", channel_datatype="U8"
                ),
                cell_size=float(grid.resolution),
                translation=[*map(float, grid.origin), MAP_HEIGHT],
            ),
        )

    @staticmethod
    def _partial(path: Path) -> Path:
        return path.with_name(f".{path.stem}.{os.getpid()}.part{path.suffix}")


def _checked(path: Path) -> Path:
    if path.suffix != ".rrd":
        raise ValueError(f"--view: got {path}, expected a file .rrd, or nothing for a live view")
    if not path.parent.is_dir():
        raise FileNotFoundError(f"--view: {path}: there is no folder {path.parent}")
    if path.is_dir():
        raise IsADirectoryError(f"--view: {path}: is a folder; expected the name of a file")
    return path


def _hits(scan: Scan) -> Floats:
    """End points (n, 2) [m] in the base frame, not deskewed."""
    beams = np.flatnonzero(np.isfinite(scan.ranges))
    return scan.laser.mount.transform(
        scan.laser.directions[beams] * np.asarray(scan.ranges[beams, None], np.float64)
    )


def _flat(points: Any) -> Any:
    """Points (n, 2) as (n, 3) in the plane."""
    return np.concatenate([points, np.zeros((len(points), 1))], axis=1)
