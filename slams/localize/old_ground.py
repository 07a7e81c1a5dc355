"""OldGround: brings a robot back onto ground that it mapped long ago, before it is mapped again.

ours. The drift of a whole loop stands between ground of old and the pose, but a matcher's prior
only knows the step since the scan before: it follows the ground just mapped, and walls of old get
doubled. So scans are kept along the way, and one that comes near a place of long ago is looked for
around its pose on what was seen from there alone. The robot goes there if that explains clearly
more, nothing else as much, and the same correction over a few looks along the way. In a corridor
it goes across only, and only where it would stand in walls else.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slams.localize.old_ground_kernels import Ground, fits, show
from slams.localize.places import ends_of
from slams.motion.track import Track
from slams.types import Floats, Pose2, Scan

SPARSE = 0.25  # m of way from scan to scan, on average: closer ones are matched before they drift
LEAP = 5.0  # m from one scan to the next that no robot drove: it was found elsewhere
SETTLED = 20  # scans after which that is known
OLD = 20.0  # m of way after which ground is old
APART, OFTEN = 0.5, 0.4  # m of way between scans that are kept, between looks
FEWEST, ENOUGH, POINTS = 40, 180, 70  # end points that a scan must have; kept; looked at
VIEW, NEAR = 15.0, 5.0  # m: ends farther off aren't looked at; a place of old is near
AROUND, MOST = 8.0, 40  # m around which scans of old are shown, and how many of them
CELL = 0.05  # m
DRIFT, LEAST, FARTHEST = 0.02, 0.3, 4.0  # of the way since; m at least and at most
TURN, TURN_DRIFT, FARTHEST_TURN = 0.02, 0.002, 0.12  # rad, rad/m, rad
STEP = np.array((0.1, 0.1, 0.02))  # m, m, rad of the search
FINER = (0.5, 0.2, 0.08)  # of that, one after the other
PRICE = 0.05  # that a place at the edge of what is looked through has to explain more
FOUND, GAIN, LEAD = 0.7, 0.2, 0.1  # fit at least; more than here; more than anywhere else
ELSEWHERE = 0.6  # m
CONTRADICTED = -0.1  # fit here at most, if not all of the way is clear: this is no new ground
LOOKS, ALONG = 4, 2.0  # looks, m of way over which a correction has to stand
SAME, FORGOTTEN = 0.25, 3.0  # m between two that are one; m of way without any


class Kept(NamedTuple):
    """A scan of the way: its end points and laser in the map, (n, 4) [m]; where it was taken."""

    beams: Floats
    x: float
    y: float
    way: float


class Found(NamedTuple):
    """Where ground of old has the robot; not `whole`: across a corridor, along it as before."""

    pose: Pose2
    whole: bool


class Correction(NamedTuple):
    """From where the robot was to where ground of old has it, since when [m], how often found."""

    before: Pose2
    pose: Pose2
    since: float
    last: float
    looks: int

    def of(self, pose: Pose2) -> Pose2:
        """The pose, corrected likewise."""
        return self.pose @ self.before.between(pose)


class OldGround:
    """Looks for a track's robot on ground of old; `found` counts.

    Only with wheels, and scans far apart: elsewhere nothing is kept and no pose changes, nor of a
    robot that is lost. A look takes some 10 ms, every 0.4 m near places of old.
    """

    def __init__(self, track: Track, on: bool) -> None:
        self.found = 0
        self._track, self._on = track, on
        self._kept: list[Kept] = []
        self._before: Pose2 | None = None
        self._scans, self._way, self._looked, self._closed = 0, 0.0, 0.0, 0.0
        self._correction: Correction | None = None

    def update(self, scan: Scan) -> None:
        """After each match, before the scan is drawn: sets the track's pose where it is found."""
        if not self._on or scan.odometry is None or self._track.state == "lost":
            return
        pose, before = self._track.pose, self._before or self._track.pose
        step = math.hypot(pose.x - before.x, pose.y - before.y)
        self._way += step if step < LEAP else 0.0
        self._scans, self._before = self._scans + 1, pose
        if self._scans > SETTLED and self._way < SPARSE * self._scans:
            return
        points = _points(scan)
        if len(points) < FEWEST:
            return
        if self._way - self._looked >= OFTEN:
            self._look(points, pose)
        if not self._kept or self._way - self._kept[-1].way >= APART:
            self._keep(points, scan)

    def _keep(self, points: Floats, scan: Scan) -> None:
        at = self._track.pose
        laser = at @ scan.laser.mount
        ends = at.transform(points)
        beams = np.column_stack([ends, np.full(len(ends), laser.x), np.full(len(ends), laser.y)])
        self._kept.append(Kept(beams, at.x, at.y, self._way))

    def _look(self, points: Floats, pose: Pose2) -> None:
        old = [kept for kept in self._kept if kept.way < self._way - OLD]
        near = [k.way for k in old if math.hypot(k.x - pose.x, k.y - pose.y) < NEAR]
        if not near:
            self._correction = None
            return
        self._looked = self._way
        far = self._way - max(float(np.median(near)), self._closed)
        half = min(max(DRIFT * far, LEAST), FARTHEST)
        turn = min(TURN + TURN_DRIFT * far, FARTHEST_TURN)
        found = search(_ground(old, pose, half), points, pose, np.array((half, half, turn)))
        if found is not None and self._stands(pose, found.pose):
            self._track.corrected(found.pose)
            self._before, self._correction = found.pose, None
            self._closed = self._way if found.whole else self._closed
            self.found += 1

    def _stands(self, pose: Pose2, found: Pose2) -> bool:
        """Whether the correction has been the same for a few looks along the way."""
        before, now = self._correction, self._way
        self._correction = Correction(pose, found, now, now, 1)
        if before is not None and now - before.last <= FORGOTTEN:
            off = before.of(pose).between(found)
            if math.hypot(off.x, off.y) <= SAME:
                self._correction = Correction(pose, found, before.since, now, before.looks + 1)
        since, looks = self._correction.since, self._correction.looks
        return looks >= LOOKS and now - since >= ALONG


def search(ground: Ground, points: Floats, pose: Pose2, half: Floats) -> Found | None:
    """Where around a pose points of its scan fit clearly better, and nowhere else as well.

    points (n, 2) [m] in the base frame; half (3,) [m, m, rad] to look to either side. If they fit
    as well all along a line, a corridor, only the part across it is clear; and nothing is where the
    pose may stand on new ground beside.
    """
    here, points = np.array(pose), np.ascontiguousarray(points[:: max(1, len(points) // POINTS)])
    off = _lattice(half, STEP)
    values = _fits(ground, points, here + off)
    values -= PRICE * ((off[:, :2] / half[:2]) ** 2).sum(axis=1)
    best = here + off[np.argmax(values)]
    for part in FINER:
        around = best + _lattice(2.0 * part * STEP, part * STEP)
        best = around[np.argmax(_fits(ground, points, around))]
    stay = float(_fits(ground, points, here + _lattice(STEP, 0.5 * STEP)).max())
    needed = max(FOUND, stay + GAIN)
    fit = _fit(ground, points, best)
    way = best[:2] - here[:2]
    alike = off[values > fit - LEAD, :2] - way
    alike = alike[np.hypot(alike[:, 0], alike[:, 1]) > ELSEWHERE]
    whole = len(alike) == 0
    if not whole and fit >= needed:
        side = _across(alike)
        if side is None or stay > CONTRADICTED:
            return None
        way = (side @ way) * side
        best[:2] = here[:2] + way
        fit = _fit(ground, points, best)
    inside = np.abs(way).max() < half[0] - 0.5 * STEP[0]
    return Found(Pose2(*best.tolist()), whole) if fit >= needed and inside else None


def _across(ways: Floats) -> Floats | None:
    """The direction (2,) across the line that all of these ways (n, 2) go along, if they do."""
    _, axes = np.linalg.eigh(ways.T @ ways)
    side = np.asarray(axes[:, 0], np.float64)
    return side if np.abs(ways @ side).max() < SAME else None


def _ground(old: list[Kept], pose: Pose2, half: float) -> Ground:
    """What was seen long ago around a pose."""
    near = [k for k in old if math.hypot(k.x - pose.x, k.y - pose.y) < AROUND + half]
    shown = np.linspace(0, len(near) - 1, min(len(near), MOST)).astype(int)
    size = VIEW + half
    n = int(2.0 * size / CELL)
    ground = empty_ground(pose.x - size, pose.y - size, n)
    show(ground, np.concatenate([near[k].beams for k in shown.tolist()]))
    return ground


def empty_ground(x: float, y: float, n: int) -> Ground:
    """N by n cells of which nothing is known, from the corner x, y [m]."""
    return Ground(np.zeros((n, n)), np.zeros((n, n), np.int64), x, y, CELL)


def _points(scan: Scan) -> Floats:
    """End points (n, 2) [m] in the base frame of what is near; of many beams, every so many."""
    ends = ends_of(scan)
    near = ends[np.hypot(ends[:, 0], ends[:, 1]) < VIEW]
    return scan.laser.mount.transform(near[:: max(1, len(near) // ENOUGH)])


def _fit(ground: Ground, points: Floats, pose: Floats) -> float:
    return float(_fits(ground, points, pose[None])[0])


def _fits(ground: Ground, points: Floats, poses: Floats) -> Floats:
    out = np.empty(len(poses))
    fits(ground, points, np.ascontiguousarray(poses), out)
    return out


def _lattice(half: Floats, step: Floats) -> Floats:
    """Offsets (n, 3) from -half to half."""
    counts = np.floor(half / step + 0.01).astype(int).tolist()
    axes = [np.arange(-n, n + 1) * by for n, by in zip(counts, step.tolist(), strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
