"""The Cramer-Rao bound of localization in the known map: the physical limit beside every figure.

[Censi07] A. Censi, "On achievable accuracy for range-finder localization", ICRA 2007. No unbiased
estimator that sees one scan and knows the map has a smaller covariance than the inverse of the
scan's Fisher information

    I = sum over beams of g g' / sigma^2,     g = d range / d (x, y, theta)

As the world is made of squares, g is exact: a beam meets a flat face at a known incidence. Three
things must be known to read the number:

- A range that jumps when the pose moves, at an edge, has no gradient. A beam counts when its hit
  stays on one flat face for one standard deviation of the pose. Where the edges are is knowledge
  too, but not in the Fisher information (as an inequality never is: Gorman and Hero 1990). So a
  maximum-likelihood estimate in the known map does a little better than this bound where edges
  abound: with 1081 beams and 1 cm of noise by 8 % in translation and 10 % in rotation on average
  over poses of a rescue arena (at the worst pose by 24 %), by 1 % and 3 % in RoboCup's map.
- It bounds one scan by itself. An algorithm that also uses odometry, or that the motion is
  smooth, may do better from one update to the next; one that must first build the map has no
  chance to do as well everywhere.
- Ranges rounded without noise (stdr) have no such bound: what a pose can be is a set. Rounding is
  then taken for noise of step^2 / 12, and `strict` is False.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bench.sim.rays import rays_of, true_poses
from slams.types import Floats, Laser, Ranges

if TYPE_CHECKING:
    from bench.sim.range_errors import Errors
    from bench.sim.world import World
    from slams.scanlog import ScanLog

BLOCK = 200  # poses at once
POSES = 3000  # of a log that are worked out, evenly spread
FAR = 6.0  # standard deviations from where on a measured range is not of the map


class Expected(NamedTuple):
    """Mean errors of motions between two poses, each a fix at the bound: (k,) [m], (k,) [rad]."""

    translation: Floats
    rotation: Floats


@dataclass(frozen=True, eq=False)
class Bound:
    """The least covariance (n, 3, 3) [m, rad] of an estimate of each true pose (n, 3).

    In the world's axes; rows of nan where a scan leaves the pose open (a long corridor). `beams`
    (n,) is how many counted. Not `strict`: the errors are rounding rather than noise.
    `information` (n, 3, 3) is the inverse, which tells what an open scan still says.
    """

    poses: Floats
    covariance: Floats
    beams: NDArray[np.int64]
    strict: bool
    information: Floats

    @cached_property
    def translation(self) -> Floats:
        """Root mean square distance (n,) [m] of a fix at the bound from the true position."""
        root: Floats = np.sqrt(self.covariance[:, 0, 0] + self.covariance[:, 1, 1])
        return root

    @cached_property
    def rotation(self) -> Floats:
        """Standard deviation (n,) [rad] of the heading of a fix at the bound."""
        root: Floats = np.sqrt(self.covariance[:, 2, 2])
        return root

    @property
    def open(self) -> int:
        """How many scans leave their pose open."""
        return int(np.isnan(self.translation).sum())

    def relative(self, lag: int) -> Expected:
        """What `slams.metrics.relative_errors` finds on average between fixes `lag` poses apart."""
        n = len(self.poses)
        return self.pairs(np.arange(n - lag), np.arange(lag, n))

    def pairs(self, first: NDArray[np.intp], second: NDArray[np.intp]) -> Expected:
        """Mean errors of the motion from pose first[k] to second[k], both independent fixes.

        The error of the first heading turns the whole motion, so that of a long one grows.
        """
        dx, dy, _ = (self.poses[second] - self.poses[first]).T
        lever = np.zeros((len(first), 2, 3))
        lever[:, 0, 0] = lever[:, 1, 1] = 1.0
        lever[:, 0, 2], lever[:, 1, 2] = -dy, dx
        a, b = self.covariance[first], self.covariance[second]
        both = lever @ a @ lever.transpose(0, 2, 1) + b[:, :2, :2]
        turn = np.sqrt(2.0 / math.pi * (a[:, 2, 2] + b[:, 2, 2]))
        return Expected(mean_length(both), turn)


def bound(
    world: World, errors: Errors, laser: Laser, poses: Floats, ranges: Ranges | None = None
) -> Bound:
    """The bound of localizing a scan in the known world at each true pose.

    Args:
        world: its squares are the walls.
        errors: of the ranges; `dropout` takes its share of the information.
        laser: the fan, limits and mount.
        poses: of the base (n, 3) in the world. (n, b, 3) for a laser that sweeps: the pose at
            each beam; the motion from the first to the others is taken as known.
        ranges: as measured (n, b); beams that gave none, or none of the map (people, mixed
            pixels), do not count. Without them all do that find a wall in the laser's limits.

    Raises:
        ValueError: the ranges have no error, so that there is no bound.
    """
    if not (errors.noise or errors.noise_share or errors.step):
        raise ValueError("errors: got none at all; expected noise or a step, else no bound exists")
    first = poses if poses.ndim == 2 else np.ascontiguousarray(poses[:, 0])
    information, beams = np.empty((len(poses), 3, 3)), np.zeros(len(poses), np.int64)
    for start in range(0, len(poses), BLOCK):
        part = slice(start, start + BLOCK)
        seen = None if ranges is None else ranges[part]
        information[part] = _block(world, errors, laser, poses[part], seen, beams[part])
    least = errors.noise + errors.noise_share * laser.range_min
    strict = errors.step <= 2.0 * least
    return Bound(first, _inverse(information), beams, strict, information)


def bound_of(log: ScanLog, most: int = POSES) -> Bound | None:
    """The bound at every scan of a simulated log; None when its world or error is not known.

    The beams that the log lost, or that met people, do not count. At most `most` poses are worked
    out, every k-th, and each stands for those up to the next. A scan whose stamps the truth does
    not cover is open.
    """
    from bench.sim.simulation import errors_of, world_of

    world = world_of(log)
    errors = None if world is None else errors_of(log, world)
    if world is None or errors is None or log.truth is None:
        return None
    if not (errors.noise or errors.noise_share or errors.step):
        return None
    every = max(1, math.ceil(len(log) / most))
    found = bound(world, errors, log.laser, true_poses(log, log.t[::every]), log.ranges[::every])
    stands_for = np.arange(len(log)) // every
    return Bound(
        log.truth.poses_at(log.t),
        found.covariance[stands_for],
        found.beams[stands_for],
        found.strict,
        found.information[stands_for],
    )


def _block(
    world: World,
    errors: Errors,
    laser: Laser,
    poses: Floats,
    ranges: Ranges | None,
    out_beams: NDArray[np.int64],
) -> Floats:
    """Information (n, 3, 3) about some poses; how many beams counted goes to out_beams (n,)."""
    from bench.judge.bound_kernels import Squares, fisher_information

    rays = rays_of(laser, poses)
    distances = world.cast(np.nan_to_num(rays).reshape(-1, 3)).reshape(rays.shape[:2])
    weights = _weights(errors, laser, distances, ranges)
    weights[np.isnan(rays[:, :, 0])] = 0.0
    squares = Squares(world.occupied, world.resolution, *world.origin)
    bases = np.ascontiguousarray(poses if poses.ndim == 2 else poses[:, 0])
    covariance = np.zeros((len(poses), 3, 3))
    for _ in range(2):  # the second time without the beams that would leave their face
        information = np.zeros_like(covariance)
        out_beams[:] = 0
        known = np.nan_to_num(covariance)
        fisher_information(squares, rays, distances, weights, bases, known, information, out_beams)
        covariance = _inverse(information)
    return information


def _weights(errors: Errors, laser: Laser, distances: Floats, ranges: Ranges | None) -> Floats:
    """Fisher information of each range about itself (n, b) [1/m^2], 0 where a beam tells nothing.

    Of a Gaussian whose deviation grows with the range, the deviation tells something too.
    """
    deviation = errors.noise + errors.noise_share * distances
    variance = deviation**2 + errors.step**2 / 12.0
    counts = (distances >= laser.range_min) & (distances < laser.range_max)
    share = 1.0 - errors.dropout
    if ranges is not None:
        with np.errstate(invalid="ignore"):
            counts &= np.abs(ranges - distances) <= FAR * np.sqrt(variance)
        share = 1.0
    with np.errstate(invalid="ignore"):
        known = share * (1.0 + 2.0 * (errors.noise_share * deviation) ** 2 / variance) / variance
    return np.where(counts, known, 0.0)


def _inverse(information: Floats) -> Floats:
    """Of each (n, 3, 3), rows of nan where a direction is open."""
    eigenvalues = np.linalg.eigvalsh(information)
    fixed = eigenvalues[:, 0] > 1e-9 * eigenvalues[:, 2]  # meters and radians are alike enough
    covariance = np.full(information.shape, np.nan)
    covariance[fixed] = np.linalg.inv(information[fixed])
    return covariance


def mean_length(covariance: Floats) -> Floats:
    """Mean length (k,) of Gaussian vectors with covariances (k, 2, 2), by an elliptic integral."""
    from scipy.special import ellipe

    half = 0.5 * (covariance[:, 0, 0] + covariance[:, 1, 1])
    spread = np.hypot(0.5 * (covariance[:, 0, 0] - covariance[:, 1, 1]), covariance[:, 0, 1])
    greatest = half + spread
    length: Floats = np.sqrt(2.0 / math.pi * greatest) * ellipe(2.0 * spread / greatest)
    return length
