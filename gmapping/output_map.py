"""OutputMap: the map of the output particle, as the front end uses it."""

from __future__ import annotations

import bisect
from typing import cast

import numpy as np

from gmapping.end_points import EndPointMatcher
from gmapping.params import GMappingParams
from gmapping.particles import Particles
from gmapping.render import Keyframe, Renderer
from gmapping.render_kernels import BeamCounts
from gmapping.scan import View
from gmapping.surfaces import MIN_LOOP_PATH_LENGTH, SurfaceMatcher
from slams.frontend.correlative import search, window_of
from slams.frontend.degeneracy import scan_observability
from slams.scan.end_points import EndPoints
from slams.types import Pose2

REVISIT_RADIUS = 3.0  # m from an old keyframe, within which most of its walls are in view
REVISIT_SEARCH_INTERVAL = 0.5  # m of path between two searches for loop closure candidates
MAX_REVISIT_KEYFRAMES = 20  # that a search looks the scan up in
REVISIT_DRIFT_COVARIANCE = np.diag((0.33, 0.33, 0.03)) ** 2  # m, rad; at 3 deviations 1 m
REVISIT_WINDOW_SHARES = 0.25, 0.5, 1.0  # of these deviations, as a small drift is the likeliest

Matcher = SurfaceMatcher | EndPointMatcher


class OutputMap(Renderer):
    """Surfaces or hits of its tiles; its keyframes, drawn as a grid, give the free space."""

    def __init__(self, params: GMappingParams, matcher: Matcher, particles: Particles) -> None:
        super().__init__(params.resolution, params.occupied, params.max_cells)
        self._matcher, self._particles = matcher, particles
        self._path_lengths: list[float] = []  # [m] at each keyframe
        self._last_search = 0.0  # path length [m]

    @property
    def empty(self) -> bool:
        """Whether no scan has entered the map."""
        return self._matcher.tiles.used == 0

    def evaluate(self, points: EndPoints, pose: Pose2) -> tuple[float, float]:
        """Shares of the beams that are inliers at a pose, and that are in conflict with the map."""
        view, owner = cast(View, points), self._particles.output
        beams = self._matcher.evaluate(view, owner, np.array(pose), self.counts)
        return beams[0] / view.beams, beams[1] / view.beams

    def loop_candidates(
        self, view: View, pose: Pose2, path_length: float
    ) -> tuple[list[Pose2], BeamCounts]:
        """Loop closure candidates in a revisited area, nearest first, and the beams of that area.

        They are the best poses of correlative searches in growing windows around `pose`, among the
        keyframes that are `MIN_LOOP_PATH_LENGTH` before `path_length` [m]. Along a direction that
        the scan does not observe, a candidate keeps the position of `pose`.
        """
        if path_length - self._last_search < REVISIT_SEARCH_INTERVAL:
            return [], self.counts
        self._last_search = path_length
        n_old = bisect.bisect_left(self._path_lengths, path_length - MIN_LOOP_PATH_LENGTH)
        distances = np.hypot(*(self._poses[:n_old, :2] - np.array(pose[:2])).T)
        old = np.flatnonzero(distances < REVISIT_RADIUS).tolist()
        if not old:
            return [], self.counts
        field, counts = self.local_map(old[:: 1 + len(old) // MAX_REVISIT_KEYFRAMES])
        ends, candidates = view.pieces[:, :2].T, []
        observed = scan_observability(view, pose.theta)
        drift = REVISIT_DRIFT_COVARIANCE + self._particles.spread()
        for share in REVISIT_WINDOW_SHARES:
            poses, _ = search(field, ends, window_of(pose, share**2 * drift), tolerance=0.0)
            at = Pose2(*poses[0, :3].tolist())
            dx, dy = at.x - pose.x, at.y - pose.y
            along = (1.0 - observed.share) * (observed.x * dx + observed.y * dy)
            x, y = at.x - along * observed.x, at.y - along * observed.y
            candidates.append(at._replace(x=x, y=y))
        return candidates, counts

    def insert(self, keyframe: Keyframe, path_length: float) -> None:
        """Draw a keyframe, taken at a path length [m], at the output particle's pose."""
        self._path_lengths.append(path_length)
        self.add_keyframe(keyframe, self._particles.output_pose)
