"""GMapping: Rao-Blackwellized particle filter over robot paths, each with a map of its own.

[Grisetti07] G. Grisetti, C. Stachniss, W. Burgard, "Improved Techniques for Grid Mapping with
Rao-Blackwellized Particle Filters", IEEE Transactions on Robotics 23(1), 2007. The pose and the map
of one particle, the output particle, are the result. Per scan:

1. Predict the pose; ours: with a covariance, from wheels, gyro and the motion so far.
2. Compute the end points of the beams in the base frame; ours: deskewed.
3. Scan matching in the map of the output particle; ours: for every scan.
4. ours: the match is to surfaces inside the cells.
5. Take the match; ours: decide between this match, those of a search, and the prediction.
6. At a keyframe, run the particle filter:
   a. Proposal: move every particle by the tracked motion, match it to its own map, draw it from a
      Gaussian around the peak (improved proposal). ours: the output particle stays at its pose.
   b. Weights: multiply by the likelihood of the scan.
   c. Resample if n_eff = 1 / sum w^2 is below a share of the particles (adaptive resampling).
   d. Select the output particle: the best one, of greatest lifetime weight. ours: always the same.
   e. Insert the scan into every particle's map.

The parts marked ours are `slams.frontend` and the surfaces. `gmapping@paper` leaves out both; the
published program, `gmapping@original`, is in `original`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, ClassVar, cast

import numpy as np
from numpy.typing import NDArray

from gmapping.end_points import EndPointMatcher
from gmapping.output_map import Matcher, OutputMap
from gmapping.params import GMappingParams
from gmapping.particles import Particles, Proposals
from gmapping.scan import View
from gmapping.surfaces import SurfaceMatcher
from slams.frontend.confident import HasEstimator
from slams.frontend.keyframes import Keyframes
from slams.frontend.motion_filter import Prediction
from slams.frontend.plain import estimator_for
from slams.params import Params
from slams.refine.lines import Match
from slams.scan.end_points import EndPoints
from slams.types import IDENTITY, Floats, OccupancyGrid, Pose2, Scan

KEYFRAME_PATH_INCREMENT = 0.001  # m added at a keyframe: path lengths at two keyframes differ


class GMapping(HasEstimator):
    """The particle filter; `particles` and their maps, `tiles`, are its state.

    If `frozen`, no scan enters the maps.
    """

    Params: ClassVar[type[Params]] = GMappingParams

    def __init__(self, params: GMappingParams) -> None:
        p = self.params = params
        self.frozen = False
        self.particles = Particles(p.n_particles, keep_output=p.refine)
        self._matcher: Matcher = SurfaceMatcher(p) if p.refine else EndPointMatcher(p)
        self.tiles = self._matcher.tiles
        self._map = OutputMap(p, self._matcher, self.particles)
        self._view = View(p)
        self._estimator = estimator_for(p, motion_model=True)  # [Grisetti07] eq. 9
        self._other_maps_outdated = False  # of all particles but the output particle
        self._keyframes = Keyframes(p.linear_update, p.angular_update, p.settle)
        self._keyframe_pose, self._path_length = IDENTITY, 1.0  # m; an empty cell stores 0
        self._keyframe_covariance = self._estimator.local_covariance
        self._rng = np.random.default_rng(p.seed)
        names = "posed inserted resampled switched collapsed closed"
        self._counts = dict.fromkeys(names.split(), 0)

    def update(self, scan: Scan) -> Pose2:
        """Match a scan to the output map; at a keyframe run the filter. Returns T_map_base."""
        self._update_other_maps()
        prior = self._estimator.predict(scan)  # 1.
        view = self._view.read(scan, prior.twist)  # 2.
        matches = self._match(view, prior.pose, prior)
        if view.has_sweep:  # 2. again, with the twist that the match gives
            view.read(scan, self._estimator.twist_at(matches[0].pose))
            matches = self._match(view, prior.pose, prior)
        pose = self._estimator.decide(view, matches, self._map, self._match)  # 5.
        self._counts["posed"] += self._estimator.match is not None
        quality, mount = self._estimator.quality, scan.laser.mount
        if self._estimator.may_map and self._keyframes.due(pose, quality, mount):
            pose = self._filter(view, pose)  # 6.
        return view.at_stamp(pose)

    def insert_at(self, scan: Scan, pose: Pose2) -> None:
        """Insert a scan at a known pose, without matching; all particles move to the pose.

        Only the output particle's map is drawn; the next update copies it to the others.
        """
        self._estimator.set_pose(scan, pose)
        if not self._other_maps_outdated:
            self._share_output_map()  # afterwards the output particle is the first
        self._other_maps_outdated = True
        self.particles.poses[:] = pose
        self._insert(self._view.read(scan, IDENTITY), pose, 1)

    def adopt(self, other: GMapping, pose: Pose2) -> None:
        """Continue in the map of another instance, at `pose` in that map, with the same motion."""
        other._update_other_maps()
        self.particles, self._keyframes = other.particles, other._keyframes
        self._matcher, self._map, self.tiles = other._matcher, other._map, other.tiles
        self.particles.poses[:] = pose
        self._keyframe_pose = pose
        self._estimator.correct(pose)

    def map(self) -> OccupancyGrid:
        """The output particle's map, drawn from its history of keyframes."""
        return self.snapshot()()

    def snapshot(self) -> Callable[[], OccupancyGrid]:
        """A function that draws the present map, also while updates continue."""
        return self._map.snapshot(self.particles.history(self.particles.output))

    def report(self) -> dict[str, Any]:
        """Counts of scans, and the size of the particles' maps."""
        return self._counts | self._estimator.counts | self.tiles.counts | self._view.counts

    def _match(self, points: EndPoints, start: Pose2, prior: Prediction) -> list[Match]:
        """Steps 3 and 4 from a start pose."""
        view = cast(View, points)
        if self._map.empty or view.n == 0:
            return [Match(start)]
        return [self._matcher.match(view, self.particles.output, prior, start)]

    def _filter(self, view: View, pose: Pose2) -> Pose2:
        """Step 6; returns the pose of the output particle."""
        if self.frozen or view.n == 0 or not self.tiles.admits(pose, view.radius):
            return pose
        particles = self.particles
        if self._map.empty:
            particles.poses[:] = pose
        else:
            proposals = self._propose(view, pose)  # a.
            closed = proposals.closes_loop
            particles.weigh(proposals.log_w, 1.0)  # b.
            if particles.n_eff < self.params.resample_threshold * len(particles):  # c.
                ancestors = particles.draw_ancestors(self._rng.random())
                closed = closed[ancestors]
                self._inherit(ancestors)
                self._counts["resampled"] += 1
            pose = self._select_output(pose, closed)  # d.
        self._insert(view, pose)  # e.
        return pose

    def _propose(self, view: View, pose: Pose2) -> Proposals:
        """Step a; without a match the proposal is the motion model."""
        particles, motion = self.particles, self._keyframe_pose.between(pose)
        particles.move(np.array(motion))
        information, n = self._motion_information(motion), len(particles)
        if self._estimator.match is None:
            factors = np.tile(np.linalg.cholesky(information), (n, 1, 1))
            log_w, closes_loop = np.zeros(n), np.zeros(n, np.bool_)
            proposals = Proposals(particles.poses.copy(), factors, log_w, closes_loop)
        else:
            path_length = self._path_length + math.hypot(motion.x, motion.y)
            candidates = self._map.loop_candidates(view, pose, path_length)
            proposals = self._matcher.propose(view, particles.poses, information, *candidates)
        particles.draw(proposals, self.params.spread * self._rng.standard_normal((n, 3)))
        if self.params.refine and not proposals.closes_loop[particles.output]:
            particles.poses[particles.output] = pose
        return proposals

    def _motion_information(self, motion: Pose2) -> Floats:
        """Information of a tracked motion: (3, 3) [1/m^2, 1/(m rad), 1/rad^2].

        ours: noise in proportion to the motion, whatever the scan rate, and the growth of the pose
        covariance since the last keyframe: along a corridor, or where scans were not matched.
        """
        p, rotation = self.params, abs(motion.theta)
        distance = math.hypot(motion.x, motion.y)
        deviation = p.key_noise + p.way_noise * np.array((distance, distance, distance + rotation))
        covariance, now = np.diag(deviation**2), self._estimator.local_covariance
        if np.isfinite(now).all():
            growth, axes = np.linalg.eigh(now - self._keyframe_covariance)
            covariance += (axes * np.maximum(growth, 0.0)) @ axes.T
        return np.asarray(np.linalg.inv(covariance), np.float64)

    def _select_output(self, pose: Pose2, closed: NDArray[np.bool_]) -> Pose2:
        """Step d; returns the output particle's pose. `closed` (n,): the particle closed a loop.

        ours: always the same particle, which moves only if it closed a loop: the best one differs
        from the others by the noise of its draws, and would be selected by chance.
        """
        particles = self.particles
        if self.params.refine and not closed[particles.output]:
            return pose
        best = particles.output if self.params.refine else particles.best()
        self._counts["switched"] += best != particles.output
        self._counts["closed"] += bool(closed[best])
        particles.output = best
        self._estimator.correct(particles.output_pose)
        return particles.output_pose

    def _insert(self, view: View, pose: Pose2, n_particles: int | None = None) -> None:
        """Step e: into the maps of the first `n_particles` particles, or of all."""
        if self.frozen or view.n == 0 or not self.tiles.admits(pose, view.radius):
            return
        self.tiles.cover(self.particles.poses, view.radius)
        motion = self._keyframe_pose.between(pose)
        self._path_length += math.hypot(motion.x, motion.y) + KEYFRAME_PATH_INCREMENT
        if not self._matcher.insert(view, self.particles.poses[:n_particles], self._path_length):
            self._share_output_map()  # no free tile is left
            self._counts["collapsed"] += 1
        self._counts["inserted"] += 1
        self._keyframe_pose = pose
        self._keyframe_covariance = self._estimator.local_covariance
        self._record_inserted(pose)
        self.particles.append_to_history()
        self._map.insert(view.ray, self._path_length)

    def _update_other_maps(self) -> None:
        """Copy the output particle's map to the others if only that map was drawn."""
        if self._other_maps_outdated:
            self._share_output_map()

    def _share_output_map(self) -> None:
        """All particles continue with pose, history and map of the output particle."""
        self._other_maps_outdated = False
        self._inherit(np.full(len(self.particles), self.particles.output))

    def _inherit(self, ancestors: NDArray[np.int64]) -> None:
        self.particles.inherit(ancestors)
        self.tiles.inherit(ancestors)
