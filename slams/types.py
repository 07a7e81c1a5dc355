"""The types that all algorithms share, with their frames and units.

Meters, radians, seconds. x points forward, y left, theta is counter-clockwise. The map frame is the
base frame of the first scan. `a @ b` is the pose b, given in frame a, in the parent frame of a.
Arrays of cells are indexed [iy, ix].
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar, Literal, NamedTuple, Never, Protocol, overload, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from slams.params import Params

Floats = NDArray[np.float64]
Ranges = NDArray[np.float32]
State = Literal["matched", "predicted", "lost"]


@overload
def wrap_angle(angle: float) -> float: ...
@overload
def wrap_angle(angle: Floats) -> Floats: ...
def wrap_angle(angle: Any) -> Any:
    """The same angle in (-pi, pi] [rad], of a number or an array."""
    number = isinstance(angle, float)
    if number and -math.pi < angle <= math.pi:  # the common case
        return angle
    ceil = math.ceil if number else np.ceil  # five times as fast for a number
    return angle - 2.0 * math.pi * ceil((angle - math.pi) / (2.0 * math.pi))


class Pose2(NamedTuple):
    """A pose or motion in the plane: x, y [m], theta [rad]."""

    x: float
    y: float
    theta: float

    def __matmul__(self, other: Pose2) -> Pose2:
        """Composition: `other`, given in this pose's frame, in the parent frame."""
        c, s = math.cos(self.theta), math.sin(self.theta)
        return Pose2(
            self.x + c * other.x - s * other.y,
            self.y + s * other.x + c * other.y,
            wrap_angle(self.theta + other.theta),
        )

    def inverse(self) -> Pose2:
        """The pose that composes with this one to the identity."""
        c, s = math.cos(self.theta), math.sin(self.theta)
        return Pose2(-c * self.x - s * self.y, s * self.x - c * self.y, wrap_angle(-self.theta))

    def between(self, other: Pose2) -> Pose2:
        """The pose `other` in the frame of this pose: the step from this pose to `other`."""
        c, s = math.cos(self.theta), math.sin(self.theta)
        x, y = other.x - self.x, other.y - self.y
        return Pose2(c * x + s * y, c * y - s * x, wrap_angle(other.theta - self.theta))

    def transform(self, points: Floats) -> Floats:
        """Points (n, 2) [m], given in this pose's frame, in the parent frame; a new array."""
        c, s = math.cos(self.theta), math.sin(self.theta)
        rotation: Floats = np.array([[c, s], [-s, c]])
        moved: Floats = points @ rotation + np.array([self.x, self.y])
        return moved

    def __add__(self, other: object) -> Never:
        """Refused: addition would concatenate the tuples."""
        raise TypeError("poses compose with @, they do not add")


IDENTITY = Pose2(0.0, 0.0, 0.0)


class Attitude(NamedTuple):
    """Roll and pitch [rad] of the base against gravity.

    The rotation is pitch about y, then roll about the resulting x axis. A positive roll raises the
    left side, a positive pitch lowers the front.
    """

    roll: float
    pitch: float

    def rotation(self) -> Floats:
        """The matrix (3, 3) from base axes to level axes of the same heading."""
        cr, sr = math.cos(self.roll), math.sin(self.roll)
        cp, sp = math.cos(self.pitch), math.sin(self.pitch)
        return np.array(((cp, sp * sr, sp * cr), (0.0, cr, -sr), (-sp, cp * sr, cp * cr)))


@dataclass(frozen=True)
class Laser:
    """Geometry of a scanning laser; one object is shared by all scans of a log.

    `mount` is the laser's pose in the base frame, `mount_z` [m] its height there, `height` [m] its
    height above the floor; None: `mount_z` if positive, else unknown. `time_increment` [s] is the
    time from one beam to the next, 0 for an instantaneous scan. A laser that turns clockwise has a
    negative `angle_increment`.
    """

    angle_min: float
    angle_increment: float
    n_beams: int
    range_min: float
    range_max: float
    mount: Pose2 = IDENTITY
    time_increment: float = 0.0
    mount_z: float = 0.0
    height: float | None = None

    @property
    def above_floor(self) -> float | None:
        """Height above a level floor [m], None if unknown."""
        if self.height is None and self.mount_z > 0.0:
            return self.mount_z
        return self.height

    @property
    def sweep_time(self) -> float:
        """Time from the first beam to the last [s]."""
        return self.time_increment * (self.n_beams - 1)

    @cached_property
    def angles(self) -> Floats:
        """Direction of each beam (n_beams,) [rad] in the laser frame."""
        return self.angle_min + self.angle_increment * np.arange(self.n_beams, dtype=float)

    @cached_property
    def directions(self) -> Floats:
        """Unit vector (n_beams, 2) of each beam in the laser frame."""
        return np.stack([np.cos(self.angles), np.sin(self.angles)], axis=1)


@dataclass(frozen=True, slots=True)
class Scan:
    """The input of one update of an algorithm.

    `t` [s] is the stamp of the first beam. `ranges` (n_beams,) float32 [m] is read-only: inf =
    nothing up to range_max, nan = no valid reading. `odometry` is the base's pose in an arbitrary
    odom frame; `yaw` [rad] the heading integrated from the gyro, origin arbitrary; `attitude` roll
    and pitch of the base at `t`. `mid_odometry`, `mid_yaw`: the same at the middle of the sweep, if
    that takes time. Each is None if it was not measured or is not finite. The truth is never part
    of a scan.
    """

    t: float
    ranges: Ranges
    laser: Laser
    odometry: Pose2 | None = None
    yaw: float | None = None
    attitude: Attitude | None = None
    mid_odometry: Pose2 | None = None
    mid_yaw: float | None = None

    def __post_init__(self) -> None:
        for name in ("odometry", "yaw", "attitude", "mid_odometry", "mid_yaw"):
            value = getattr(self, name)
            numbers = (value,) if name.endswith("yaw") else value
            if value is not None and not all(map(math.isfinite, numbers)):
                object.__setattr__(self, name, None)

    @property
    def at_mid_sweep(self) -> Scan:
        """The scan with stamp, odometry and yaw of the middle of its sweep, where it is matched.

        Half a sweep earlier, at the stamp, an accelerating robot has another velocity. Readings
        that were not measured at the middle are those of the stamp.
        """
        if not self.laser.time_increment:
            return self
        odometry = self.odometry and (self.mid_odometry or self.odometry)
        yaw = self.yaw if self.yaw is None or self.mid_yaw is None else self.mid_yaw
        t = self.t + 0.5 * self.laser.sweep_time
        return replace(self, t=t, odometry=odometry, yaw=yaw)


@dataclass(frozen=True)
class OccupancyGrid:
    """Probability of being occupied: p (ny, nx), nan = never observed.

    Row 0 is the lowest y. `origin` (x, y) [m] is the outer corner of cell [0, 0], in the map
    frame; `resolution` [m] the edge of a cell.
    """

    p: NDArray[np.float32]
    resolution: float
    origin: tuple[float, float]


@runtime_checkable
class Slam(Protocol):
    """The interface of an algorithm; no base class is needed.

    Contract of `update` and `map`, each clause a test over every registered algorithm:

    1. The first call returns Pose2(0, 0, 0): the map frame is the base frame of the first scan.
    2. Every call returns a finite pose; the prediction, if the scan is not used or matching fails.
       Bad data raises no exception.
    3. The scan is not written to.
    4. Same parameters and same scans give the same poses, bit for bit on one machine. Random
       numbers come only from `np.random.default_rng(params.seed)`, created in `__init__`.
    5. An algorithm runs without odometry; `report()` counts the scans whose odometry was used.
    6. Two instances in one process do not disturb each other.
    7. The odom frame is arbitrary: one constant motion before every odometry pose changes nothing.
    8. A scan may have another beam count or geometry than the scan before.
    9. `map()` has cells that scans observed, in the frame of the first scan.

    `Confident` has optional properties of the last scan; `LiveSlam` replaces missing ones.
    """

    Params: ClassVar[type[Params]]

    def __init__(self, params: Any) -> None: ...

    def update(self, scan: Scan) -> Pose2:
        """Process the next scan; return the pose of the base in the map, T_map_base."""

    def map(self) -> OccupancyGrid:
        """The present map."""

    def report(self) -> dict[str, Any]:
        """Counts so far (inserted, rejected, lost, ...)."""


class Confident(Protocol):
    """An algorithm with state, quality and covariance of its last pose."""

    @property
    def state(self) -> State:
        """How the last pose was obtained.

        "matched": the scan matches the map. "predicted": it does not, and the pose is the
        prediction. "lost": no scan matched for a second and no odometry bounds the error to 0.5 m
        and 0.3 rad (no scan is inserted into the map), or along a corridor the error may be larger
        (mapping continues). `report()["lost"]` counts such scans.
        """

    @property
    def quality(self) -> float:
        """Inlier ratio of the last scan in the map, 0..1."""

    @property
    def covariance(self) -> Floats:
        """Covariance (3, 3) [m, rad] of the last pose relative to the first; inf: unknown; > 0."""


def against_map(slam: Any) -> Any:
    """Covariance of the last pose relative to the map around it, else to the first pose."""
    local = getattr(slam, "local_covariance", None)
    return getattr(slam, "covariance", None) if local is None else local


@runtime_checkable
class Corrected(Protocol):
    """An algorithm that corrects earlier poses, as loop closure does."""

    def corrected(self) -> Floats:
        """Present estimate of the poses (n, 3) of all scans so far."""
