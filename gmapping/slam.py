"""GMapping: Rao-Blackwellized particle filter over robot paths, each with a map of its own.

[Grisetti07] G. Grisetti, C. Stachniss, W. Burgard, "Improved Techniques for Grid Mapping with
Rao-Blackwellized Particle Filters", IEEE Transactions on Robotics 23(1), 2007. Per scan:

1. Predict the pose; ours: with a covariance, from wheels, gyro and the motion so far.
2. End points of the beams in the base frame; ours: freed from the motion of a sweep.
3. Scan matching in the map of the particle that is reported: the paper's, every scan.
4. ours: to surfaces inside the cells.
5. Take the match; ours: decide between it, those of a search, and the prediction.
6. At a keyframe, the filter:
   a. Every particle goes the way of the reported one since the last keyframe, is matched to its own
      map, and drawn from a Gaussian around the peak (improved proposal); its weight grows by the
      likelihood of the scan. ours: the reported one stays where it was decided to be.
   b. n_eff = 1 / sum w^2; below a share of the particles they are resampled (adaptive resampling).
   c. The particle of greatest weight over its life is reported; ours: the same one always.
   d. The scan is inserted into every particle's map.

What is ours is `slams.frontend` and the surfaces. `gmapping@paper` leaves out both; the published
program, `gmapping@original`, stands in `original`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, ClassVar, cast

import numpy as np
from numpy.typing import NDArray

from gmapping.end_points import EndPointMatcher
from gmapping.params import GMappingParams
from gmapping.particles import Particles, Proposals
from gmapping.reported import Matcher, ReportedMap
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

STEP = 0.001  # m by which two keyframes differ in `_way`, however near they are
COUNTS = "posed inserted resampled switched collapsed closed"


class GMapping(HasEstimator):
    """The particle filter; see the module for the steps.

    `frozen`: nothing enters the map; `particles` and their maps, `tiles`, are the filter's state.
    """

    Params: ClassVar[type[Params]] = GMappingParams

    def __init__(self, params: GMappingParams) -> None:
        p = self.params = params
        self.frozen = False
        self.particles = Particles(p.n_particles, steady=p.refine)
        self._matcher: Matcher = SurfaceMatcher(p) if p.refine else EndPointMatcher(p)
        self.tiles = self._matcher.tiles
        self._map = ReportedMap(p, self._matcher, self.particles)
        self._view = View(p)
        self._estimator = estimator_for(p, motion_model=True)  # [Grisetti07] eq. 9
        self._others_lag = False  # the maps of all particles but the first
        self._keyframes = Keyframes(p.linear_update, p.angular_update, p.settle)
        self._key, self._way = IDENTITY, 1.0  # pose at the last keyframe, [m] driven until then
        self._known = self._estimator.local_covariance  # of the pose there
        self._rng = np.random.default_rng(p.seed)
        self._counts = dict.fromkeys(COUNTS.split(), 0)

    def update(self, scan: Scan) -> Pose2:
        """Match the scan to the reported map; at a keyframe run the filter. Returns T_map_base."""
        self._catch_up()  # with what `insert_at` has drawn
        prior = self._estimator.predict(scan)  # 1.
        view = self._view.read(scan, prior.twist)  # 2.
        matches = self._match(view, prior.pose, prior)
        if view.has_sweep:  # 2. again, with the motion that was found
            view.read(scan, self._estimator.twist_at(matches[0].pose))
            matches = self._match(view, prior.pose, prior)
        pose = self._estimator.decide(view, matches, self._map, self._match)  # 5.
        self._counts["posed"] += self._estimator.match is not None
        quality, mount = self._estimator.quality, scan.laser.mount
        if self._estimator.may_map and self._keyframes.due(pose, quality, mount):
            pose = self._filter(view, pose)  # 6.
        return view.at_stamp(pose)

    def insert_at(self, scan: Scan, pose: Pose2) -> None:
        """Let a scan enter the map at a known pose, without matching; all particles are there."""
        self._estimator.set_pose(scan, pose)
        if not self._others_lag:
            self._share_one_map()  # the first is the reported one then
        self._others_lag = True
        self.particles.poses[:] = pose
        self._insert(self._view.read(scan, IDENTITY), pose, 1)

    def adopt(self, other: GMapping, pose: Pose2) -> None:
        """Go on in the map of another instance, at `pose` in it, moving as before."""
        other._catch_up()
        self.particles, self._keyframes = other.particles, other._keyframes
        self._matcher, self._map, self.tiles = other._matcher, other._map, other.tiles
        self.particles.poses[:] = pose
        self._key = pose
        self._estimator.correct(pose)

    def map(self) -> OccupancyGrid:
        """The reported particle's map, drawn from its history of keyframes."""
        return self.snapshot()()

    def snapshot(self) -> Callable[[], OccupancyGrid]:
        """A function that draws the map as it stands now, while updates go on."""
        return self._map.snapshot(self.particles.history(self.particles.best))

    def report(self) -> dict[str, Any]:
        """Counts of scans, and what the particles' maps take."""
        return self._counts | self._estimator.counts | self.tiles.counts | self._view.counts

    def _match(self, points: EndPoints, start: Pose2, prior: Prediction) -> list[Match]:
        """Steps 3 and 4 from a start."""
        view = cast(View, points)
        if self._map.empty or view.n == 0:
            return [Match(start)]
        return [self._matcher.match(view, self.particles.best, prior, start)]

    def _filter(self, view: View, pose: Pose2) -> Pose2:
        """Step 6; returns the pose of the particle that is reported then."""
        if self.frozen or view.n == 0 or not self.tiles.admits(pose, view.radius):
            return pose
        particles = self.particles
        if self._map.empty:
            particles.poses[:] = pose
        else:
            closes = self._propose(view, pose)  # a.
            if particles.n_eff < self.params.resample_threshold * len(particles):  # b.
                ancestors = particles.draw_ancestors(self._rng.random())
                closes = closes[ancestors]
                self._follow(ancestors)
                self._counts["resampled"] += 1
            pose = self._elect(pose, closes)  # c.
        self._insert(view, pose)  # d.
        return pose

    def _propose(self, view: View, pose: Pose2) -> NDArray[np.bool_]:
        """Step a: which particles have closed a loop; without a match they get the way's noise."""
        particles, way = self.particles, self._key.between(pose)
        particles.move(np.array(way))
        information, n = self._information(way), len(particles)
        if self._estimator.match is None:
            factors = np.tile(np.linalg.cholesky(information), (n, 1, 1))
            none = np.zeros(n), np.zeros(n, np.bool_)
            proposals = Proposals(particles.poses.copy(), factors, *none)
        else:
            way_so_far = self._way + math.hypot(way.x, way.y)
            revisited = self._map.revisited(view, pose, way_so_far)
            proposals = self._matcher.propose(view, particles.poses, information, *revisited)
        particles.draw(proposals, self.params.spread * self._rng.standard_normal((n, 3)))
        if self.params.refine and not proposals.closes[particles.best]:
            particles.poses[particles.best] = pose
        particles.weigh(proposals.log_w, 1.0)
        return proposals.closes

    def _information(self, way: Pose2) -> Floats:
        """Of a particle after a tracked way: (3, 3) [1/m^2, 1/(m rad), 1/rad^2].

        One noise for all of it, whatever the rate of the scans, and what the pose has become less
        certain by: along a corridor, or where scans were not matched.
        """
        p, turn = self.params, abs(way.theta)
        far = math.hypot(way.x, way.y)
        deviation = p.key_noise + p.way_noise * np.array((far, far, far + turn))
        covariance, now = np.diag(deviation**2), self._estimator.local_covariance
        if np.isfinite(now).all():
            lost, axes = np.linalg.eigh(now - self._known)
            covariance += (axes * np.maximum(lost, 0.0)) @ axes.T
        return np.asarray(np.linalg.inv(covariance), np.float64)

    def _elect(self, pose: Pose2, closes: NDArray[np.bool_]) -> Pose2:
        """Step c: the pose of the particle that is reported.

        ours: always the same one, which has moved only if it has closed a loop; the others differ
        by the noise of their draws, and a leader among them is chosen by chance.
        """
        particles = self.particles
        if self.params.refine and not closes[particles.best]:
            return pose
        leader = particles.best if self.params.refine else particles.leader()
        self._counts["switched"] += leader != particles.best
        self._counts["closed"] += bool(closes[leader])
        particles.best = leader
        self._estimator.correct(particles.best_pose)
        return particles.best_pose

    def _insert(self, view: View, pose: Pose2, particles: int | None = None) -> None:
        if self.frozen or view.n == 0 or not self.tiles.admits(pose, view.radius):
            return
        self.tiles.cover(self.particles.poses, view.radius)
        step = self._key.between(pose)
        self._way += math.hypot(step.x, step.y) + STEP
        if not self._matcher.insert(view, self.particles.poses[:particles], self._way):
            self._share_one_map()  # out of tiles
            self._counts["collapsed"] += 1
        self._counts["inserted"] += 1
        self._key, self._known = pose, self._estimator.local_covariance
        self._record_inserted(pose)
        self.particles.remember()
        self._map.insert(view.ray, self._way)

    def _catch_up(self) -> None:
        """After `insert_at`, which draws one particle's map, the others get it."""
        if self._others_lag:
            self._share_one_map()

    def _share_one_map(self) -> None:
        """All particles go on from the reported one's."""
        self._others_lag = False
        self._follow(np.full(len(self.particles), self.particles.best))

    def _follow(self, ancestors: NDArray[np.int64]) -> None:
        self.particles.follow(ancestors)
        self.tiles.inherit(ancestors)
