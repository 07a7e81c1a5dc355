"""ReportedMap: the map of the particle that is reported, as the front end asks for it."""

from __future__ import annotations

import bisect
from typing import cast

import numpy as np

from gmapping.end_points import EndPointMatcher
from gmapping.params import GMappingParams
from gmapping.particles import Particles
from gmapping.render import Keyframe, Renderer, walls
from gmapping.render_kernels import Counts
from gmapping.scan import View
from gmapping.surfaces import OLD, SurfaceMatcher
from slams.frontend.correlative import search, window_of
from slams.frontend.degeneracy import scan_observability
from slams.scan.end_points import EndPoints
from slams.types import Pose2

NEAR = 3.0  # m from where the robot was then: what it saw there, it sees from here
SELDOM = 0.5  # m of way between two looks for a loop
SCANS = 20  # old scans that are looked at
DRIFT = np.diag((0.33, 0.33, 0.03)) ** 2  # m, m, rad: of the way around a loop; 3 deviations
WINDOWS = 0.25, 0.5, 1.0  # of the drift that is searched: the nearer place is the likelier one

Matcher = SurfaceMatcher | EndPointMatcher


class ReportedMap(Renderer):
    """Surfaces or hits of its tiles, and the picture of its history for what was seen free."""

    def __init__(self, params: GMappingParams, matcher: Matcher, particles: Particles) -> None:
        super().__init__(params.resolution, params.occupied, params.max_cells)
        self._matcher, self._particles = matcher, particles
        self._ways: list[float] = []  # [m] driven at each keyframe
        self._looked = 0.0  # [m] driven at the last look for a loop

    @property
    def empty(self) -> bool:
        """Whether no scan has entered the map."""
        return self._matcher.tiles.used == 0

    def evaluate(self, points: EndPoints, pose: Pose2) -> tuple[float, float]:
        """Shares of the beams that are inliers at a pose, and that are in conflict with the map."""
        view, owner = cast(View, points), self._particles.best
        found = self._matcher.evaluate(view, owner, np.array(pose), self.counts)
        return found[0] / view.beams, found[1] / view.beams

    def revisited(self, points: View, pose: Pose2, way: float) -> tuple[list[Pose2], Counts]:
        """Where the robot may be on ground that it left long ago, nearest first; mostly nowhere.

        The best poses of correlative searches in wider and wider windows among keyframes that are
        `OLD` behind, `way` [m] from the start; along a corridor that hides how far along it is,
        only across. And what those keyframes have seen.
        """
        if way - self._looked < SELDOM:
            return [], self.counts
        self._looked = way
        then = self._drawn[: bisect.bisect_left(self._ways, way - OLD), :2]
        old = np.flatnonzero(np.hypot(*(then - np.array(pose[:2])).T) < NEAR).tolist()
        if not old:
            return [], self.counts
        seen_then = self.only(old[:: 1 + len(old) // SCANS])
        lookup = walls(seen_then)
        ends, found = points.pieces[:, :2].T, []
        seen, drift = scan_observability(points, pose.theta), DRIFT + self._particles.spread()
        for share in WINDOWS:
            poses, _ = search(lookup, ends, window_of(pose, share**2 * drift), tolerance=0.0)
            at = Pose2(*poses[0, :3].tolist())
            x, y = at.x - pose.x, at.y - pose.y
            along = (1.0 - seen.share) * (seen.x * x + seen.y * y)
            found.append(at._replace(x=at.x - along * seen.x, y=at.y - along * seen.y))
        return found, seen_then

    def insert(self, scan: Keyframe, way: float) -> None:
        """Draw a keyframe where the reported particle is."""
        self._ways.append(way)
        self.keep(scan, self._particles.best_pose)
