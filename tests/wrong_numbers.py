"""Logs, pushes and bags whose numbers are wrong in every way, for `tests/test_fuzz.py`.

Numbers are as broken drivers, other units and flipped bits make them. Each family is a function of
an rng and a folder, tells whether its input was taken, and asserts a finite pose or one sentence,
nothing half-written, no warning.
"""

import math
import warnings

import numpy as np

import slams
from slams import LiveSlam, Pose2, convert
from slams.registry import create
from slams.test_world import drive, drive_poses, laser, scan_at
from tests import bags
from tests.rooms import fields_of, push_fields

EXTREMES = np.array(
    [
        *(0.0, -0.0, 1.0, -1.0, np.nan, np.inf, -np.inf, np.pi),
        *(5e-324, 1e-310, 1e-12, 1e3, 1e7, 1e9, 1e18, 1e39, 1e300, -1e300),
        *(np.finfo(np.float64).max, 2.0**31, 2.0**32, 2.0**63),
    ]
)
SCALES = (1e-9, 1e-6, 1e-3, 1e3, 1e6, 1e9, -1.0, 180.0 / np.pi)


def number(rng):
    """One number that is hardly ever meant."""
    if rng.random() < 0.5:
        return float(rng.choice(EXTREMES))
    return float(np.frombuffer(rng.bytes(8), np.float64)[0])


def bits(array, rng):
    """The same shape and type, some values random bits."""
    raw = bytearray(array.tobytes())
    size = max(array.dtype.itemsize, 1)
    for _ in range(int(rng.integers(1, 4))):
        if len(raw) >= size:
            at = int(rng.integers(0, len(raw) // size)) * size
            raw[at : at + size] = rng.bytes(size)
    return np.frombuffer(bytes(raw), array.dtype).reshape(array.shape)


def some(array, rng):
    """A few values extreme; what the type cannot hold is as numpy makes it."""
    changed = np.array(array)
    for _ in range(int(rng.integers(1, 4))):
        if changed.size:
            changed.flat[int(rng.integers(0, changed.size))] = number(rng)
    return changed


def scaled(array, rng):
    return np.asarray(array * rng.choice(SCALES), array.dtype)


def shifted(array, rng):
    return np.asarray(array + number(rng), array.dtype)


def shuffled(array, rng):
    """Rows in another order, some twice."""
    return array[rng.integers(0, len(array), len(array))] if array.ndim and len(array) else array


def reshaped(array, rng):
    if not array.ndim:
        return array[None]
    ways = [array[..., None], array.ravel(), array[:0], array[:1], array[..., :1], array.T]
    return ways[rng.integers(0, len(ways))]


def retyped(array, rng):
    kinds = (np.float16, np.float32, np.int64, np.uint8, np.complex128, np.bool_, "U8", "S3")
    return array.astype(kinds[rng.integers(0, len(kinds))])


WAYS = (bits, some, some, scaled, shifted, shuffled, reshaped, retyped)
SAME_SHAPE = (bits, some, scaled, shifted, shuffled)


def mutated(array, rng, ways=WAYS):
    """An array gone wrong in one way."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it is what comes of it that must not warn
        return ways[rng.integers(0, len(ways))](np.asarray(array), rng)


SCANS = 6
LOG = drive(n=SCANS, rate=10.0, lidar=laser(n_beams=41))
GOOD = 3  # pushes in a row after which the robot is found again


def sentence(work, errors=(ValueError, OSError)):
    """What the work gives, or None where it is refused in one line."""
    try:
        return work()
    except errors as error:
        said = str(error)
    assert len(said.splitlines()) == 1, "not one sentence"
    assert len(said) <= 2000, "not one sentence"
    return None


def poses_of(log, algorithm):
    slam = create(algorithm)
    for scan in log:
        pose = slam.update(scan)
        assert all(map(math.isfinite, pose)), f"{algorithm} returned {pose}"


def nothing_but(folder, names):
    left = {path.name for path in folder.iterdir()} - set(names)
    assert not left, f"left behind: {sorted(left)}"


def npz(rng, folder, algorithm):
    """An npz whose arrays have gone wrong."""
    path = folder / "log.npz"
    LOG.save(path)
    with np.load(path) as archive:
        data = dict(archive)
    del data["truth_t"], data["yaw_rate_t"]  # then those of the scans
    for key in rng.choice(sorted(data), int(rng.integers(1, 4)), replace=False):
        if rng.random() < 0.1:
            del data[key]
        elif data[key].dtype.kind in "fiu":
            data[key] = mutated(data[key], rng)
    np.savez(path, **data)
    log = sentence(lambda: slams.load(path))
    if log is not None:
        poses_of(log, algorithm)
        if rng.random() < 0.05:
            convert.main([str(path), str(folder / "out.npz"), "-q"])
            slams.load(folder / "out.npz")
    nothing_but(folder, ["log.npz", "out.npz"])
    return log is not None


def live(rng, folder, algorithm):
    """Pushes in a row, some of them wrong; good ones afterwards find the robot again."""
    robot, poses, taken = LiveSlam(algorithm, warm_up=False), drive_poses(24, 0.1), False
    t = float(rng.choice([0.0, 1.7e9]))
    for k in range(int(rng.integers(2, 10))):
        fields = _fields(t + 0.1 * k, poses[k])
        if rng.random() < 0.6:
            _damage(fields, rng)
        estimate = sentence(lambda: push_fields(robot, **fields), (ValueError, TypeError))  # noqa: B023
        if estimate is not None:
            taken = True
            _check(estimate)
    for k in range(10, 10 + 11 + GOOD):  # a clock set back is believed after ten
        estimate = push_fields(robot, **_fields(t + 0.1 * k, poses[k]))
        _check(estimate)
    assert estimate.used, "good scans are not used after bad ones"
    robot.report()
    return taken


def _fields(t, pose):
    scan = scan_at(pose, LOG.laser, t=t, odometry=Pose2(*pose.tolist()))
    return fields_of(scan) | {"yaw": 0.0}


def _damage(fields, rng):
    for key in rng.choice(sorted(fields), int(rng.integers(1, 3)), replace=False):
        if key == "ranges":
            fields[key] = mutated(fields[key], rng)
        elif key == "odometry":
            values = list(fields[key])
            values[int(rng.integers(0, 3))] = number(rng)
            fields[key] = values[: int(rng.integers(2, 4))]
        else:
            fields[key] = number(rng)


def _check(estimate):
    assert all(map(math.isfinite, estimate.pose)), f"pose {estimate.pose}"
    if estimate.map_to_odom is not None:
        assert all(map(math.isfinite, estimate.map_to_odom)), f"map to odom {estimate.map_to_odom}"


def bag(rng, folder, algorithm):
    """A bag whose messages are whole and whose numbers are not."""
    kind = str(rng.choice(["bag", "mcap"]))
    path = bags.write(folder, kind, lambda make: _messages(make, rng), "drive")
    salvage = bool(rng.random() < 0.3)
    log = sentence(lambda: slams.load(path, salvage=salvage))
    if log is not None:
        poses_of(log, algorithm)
    left = [path.name, "drive"] if kind == "mcap" else [path.name]
    nothing_but(folder, left)
    return log is not None


def _messages(make, rng):
    wrong = rng.random(6) < 0.3
    roll = float(rng.choice([0.0, math.pi]))
    mount = ("base_link", "laser", tuple(_maybe(rng, wrong[0], (0.1, 0.0, 0.2))), 0.1, roll)
    found = [("/tf_static", 1.0, make.tf(1.0, mount))] if rng.random() < 0.8 else []
    for k, (row, pose) in enumerate(zip(LOG.ranges, LOG.odom.values, strict=True)):
        t = 10.0 + 0.1 * k
        stamp = float(rng.integers(0, 2**31)) if wrong[1] and rng.random() < 0.3 else t
        ranges = np.array(mutated(row, rng, SAME_SHAPE) if wrong[2] else row, np.float32)
        angles = tuple(_maybe(rng, wrong[3], (-1.5, 0.1)))
        limits = tuple(_maybe(rng, wrong[4], (0.1, 30.0)))
        x, y, turn = _maybe(rng, wrong[5], pose.tolist())
        turn = turn if math.isfinite(turn) else 0.0  # a quaternion is made of it
        with np.errstate(all="ignore"):
            scan = make.scan(stamp, ranges, angles=angles, limits=limits)
            found.append(("/scan", t, scan))
        found.append(("/odom", t, make.odometry(stamp, x, y, turn)))
    return found


def _maybe(rng, wrong, values):
    values = list(values)
    if wrong:
        values[int(rng.integers(0, len(values)))] = _single(number(rng))
    return values


def _single(value):
    """A number that a message of float32 holds, ten times over."""
    with np.errstate(all="ignore"):
        held = float(np.float32(value))
    return held if not math.isfinite(held) else min(max(held, -1e36), 1e36)


FAMILIES = {"npz": npz, "live": live, "bag": bag}
