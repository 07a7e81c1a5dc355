"""Movers: what moves is left out of the match, of the map and of what is told of walls."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from gmapping.mover_kernels import Earlier, moving
from gmapping.scan import View
from slams.motion.track import Track
from slams.types import Floats, Laser, Pose2, Ranges, Scan

KEPT, SECONDS = 4, 0.5  # earlier scans, and the time between two of them at least
MARGIN = 0.15  # m by which beams have to have gone on behind a thing
SOFT = 3.0  # deviations of the noise, and of the pose, beside it
MOST = 0.5  # share of the beams; where more is contradicted the pose is wrong, not the world


class Movers:
    """The last few scans, as witnesses of where nothing stood.

    `idle`: nothing is left out.
    """

    def __init__(self, idle: bool) -> None:
        self._idle = idle
        self._laser: Laser | None = None
        self.forget()

    def forget(self) -> None:
        """What is remembered has nothing to do with the map from now on."""
        self._poses: list[Pose2] = []
        self._ranges: list[Ranges] = []
        self._t = -math.inf

    def remember(self, scan: Scan, track: Track) -> None:
        """Keep a scan that was matched, if the last one that was kept is long enough ago."""
        if self._idle or track.state != "matched" or 0.0 <= scan.t - self._t < SECONDS:
            return
        self._t, laser = scan.t, scan.laser
        self._poses = [*self._poses[1 - KEPT :], track.pose @ laser.mount]
        ended = np.where(scan.ranges < laser.range_max, scan.ranges, 0.0).astype(np.float32)
        self._ranges = [*self._ranges[1 - KEPT :], ended]
        lasers = np.array([(x, y, math.cos(theta), math.sin(theta)) for x, y, theta in self._poses])
        fan = laser.angle_min, laser.angle_increment
        self._earlier = Earlier(lasers, np.array(self._ranges), *fan)

    def drop(self, view: View, scan: Scan, pose: Pose2, known: Floats) -> Scan:
        """Leave out what moves, seen from `pose` of that covariance (3, 3); the scan without it."""
        laser = scan.laser
        if laser is not self._laser and laser != self._laser:
            self.forget()
            self._laser = laser
        if not self._poses:
            return scan
        moves = np.zeros(len(view.pieces), np.bool_)
        way, turn = SOFT * math.sqrt(known[0, 0] + known[1, 1]), SOFT * math.sqrt(known[2, 2])
        doubt, earlier = (MARGIN + SOFT * view.noise + way, way, turn), tuple(self._earlier)
        beams = moving(view.pieces, tuple(pose), tuple(laser.mount), earlier, doubt, moves)
        if not 0.0 < beams <= MOST * view.beams:
            return scan
        ranges = _without(scan, view.pieces[moves])
        view.keep(~moves)
        return replace(scan, ranges=ranges)


def _without(scan: Scan, pieces: Floats) -> Ranges:
    """The ranges of a scan, 0 where they end on these pieces (n, 5)."""
    laser, step = scan.laser, scan.laser.angle_increment
    dx, dy = pieces[:, 0] - laser.mount.x, pieces[:, 1] - laser.mount.y
    turn = np.arctan2(dy, dx) - laser.mount.theta - laser.angle_min
    beams = np.rint(np.mod(turn / step + 0.5, math.tau / abs(step)) - 0.5).astype(np.int64)
    ranges, far = scan.ranges.copy(), np.hypot(dx, dy)
    halves = np.ceil(0.5 * pieces[:, 4]).astype(np.int64) + 1
    for beam, half, r in zip(beams, halves, far, strict=True):
        part = ranges[max(beam - half, 0) : beam + half + 1]
        part[np.abs(part - r) < MARGIN] = 0.0
    return ranges
