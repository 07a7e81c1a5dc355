"""GMapping: Rao-Blackwellized particle filter over robot paths, each with a map of its own.

[Grisetti07] G. Grisetti, C. Stachniss, W. Burgard, "Improved Techniques for Grid Mapping with
Rao-Blackwellized Particle Filters", IEEE Transactions on Robotics 23(1), 2007.

1. Motion: odometry, a gyro or the motion so far predicts the step since the last scan.
2. Tracking (ours): every scan, without what moves, is matched to the reported particle's map, a
   slow sweep twice; where the map explains less than usual, other starts are tried.
3. At a key scan every particle is matched to its own map and drawn from a Gaussian around the
   peak (the improved proposal); its weight grows by the scan's likelihood. ours: the reported one
   stays at its peak, so that what the others try costs no accuracy.
4. The number of effective particles n_eff = 1 / sum w^2 follows from the weights.
5. Below a share of the particles they are resampled (adaptive resampling): maps are shared, not
   copied.
6. The particle of greatest weight over its life is the one that is reported.
7. The scan is written into every particle's map.
8. ours: a lost robot is looked for in all of the reported map.

The preset `paper` climbs in maps of end points in steps 2 and 3, and has no step 8. The published
program, `gmapping@original`, stands in `original`.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from gmapping.choice import believed, foreseen, leaps
from gmapping.end_points import EndPointMatcher
from gmapping.key import KeyScans
from gmapping.match import Match, Matcher
from gmapping.movers import Movers
from gmapping.params import GMappingParams
from gmapping.particles import Particles
from gmapping.render import Ends, Renderer
from gmapping.scan import View
from gmapping.surfaces import SurfaceMatcher
from slams.geometry import Prior, inverse3
from slams.localize.relocator import Relocator
from slams.motion.model import Prediction
from slams.motion.track import Track
from slams.params import Params
from slams.patience import Patience
from slams.types import IDENTITY, Floats, OccupancyGrid, Pose2, Scan, State
from slams.usual import Usual

WIDEST = np.array([0.6, 0.6, 0.3])  # m, m, rad; a search goes no farther
PAUSE = 0.5  # s between two searches of a robot that is not matched
COUNTS = "posed searched recovered refused inserted rejected resampled switched collapsed closed"


class GMapping:
    """The particle filter; see the module for the steps.

    `frozen`: nothing enters the map; `particles` and `tiles` the filter's state.
    """

    Params: ClassVar[type[Params]] = GMappingParams

    def __init__(self, params: GMappingParams) -> None:
        p = self.params = params
        self.frozen = False
        self._rng = np.random.default_rng(p.seed)
        self._view = View(p)
        self._movers = Movers(idle=not p.refine)
        self._track = Track(p)
        self._relocator = Relocator(self._track, p.relocate)
        self._renderer = Renderer(p.resolution, p.occupied)
        self._keys = KeyScans(p)
        self.particles = Particles(p.n_particles, steady=p.refine)
        self._matcher: Matcher = SurfaceMatcher(p, self._keys) if p.refine else EndPointMatcher(p)
        self.tiles = self._matcher.tiles
        self._quality, self._usual = 1.0, Usual(p.usual_time)
        self._patience = Patience(PAUSE, PAUSE)
        self._counts = dict.fromkeys(COUNTS.split(), 0)

    def update(self, scan: Scan) -> Pose2:
        """Track a scan; at key scans run the filter. Returns T_map_base."""
        start = self._track.predict(scan)  # 1
        view = self._view.take(scan, start.velocity)
        match, walls = None, self._movers.drop(view, scan, start.pose, self._track.expected)
        if view.is_usable and self._keys.n > 0:
            match = self._tracked(view, start)  # 2
            if view.sweeps:
                view.take(scan, self._track.motion.velocity_to(match.pose))
                walls = self._movers.drop(view, scan, match.pose, self._track.expected)
                match = self._tracked(view, start)
        self._settle(walls, view, match, start)
        self._movers.remember(scan, self._track)
        if self._due(view):
            self._filter(view)
        if self._relocator.update(scan, self.map):  # 8
            self._place(self._track.pose)  # all particles go on there, with the map it was found in
        return view.at_stamp(self._track.pose)

    def insert_at(self, scan: Scan, pose: Pose2) -> None:
        """Take a scan whose pose is known, at rest; it enters the maps unless `frozen`."""
        self._track.placed(pose, scan)
        view = self._view.take(scan, IDENTITY)
        self._place(pose)
        if view.is_usable and not self.frozen and self.tiles.admits(pose, view.far):
            self._insert(view)

    def map(self) -> OccupancyGrid:
        """The reported particle's map, drawn from its history of key scans."""
        return self._renderer.grid(self.trajectory())

    def trajectory(self) -> Floats:
        """The reported particle's poses (k, 3) x, y [m], theta [rad] at the key scans."""
        return self.particles.history(self.particles.best)

    @property
    def pose(self) -> Pose2:
        """The base's last pose in the map."""
        return self._track.pose

    @property
    def state(self) -> State:
        """How the last pose came about."""
        return self._track.state

    @property
    def covariance(self) -> Floats:
        """Covariance (3, 3) of the last pose against the map [m^2, m rad, rad^2]."""
        return self._track.covariance

    @property
    def quality(self) -> float:
        """Share of the last scan that lies on known surfaces, 0 to 1."""
        return self._quality

    def report(self) -> dict[str, Any]:
        """Counts, and what the particles' maps take."""
        found = {"lost": self._track.lost, "found_again": self._relocator.found}
        return self._counts | found | self._track.motion.counts | self.tiles.counts

    def _tracked(self, view: View, start: Prediction) -> Match:
        """Step 2: from the prediction; from other starts if it explains less than usual."""
        matcher, best = self._matcher, self.particles.best
        known = Prior(start.pose, self._track.prior(start.pose))
        room = self._track.room if self.params.refine else math.inf
        match = foreseen(matcher, view, best, known, room)
        in_vain = self._track.state != "matched" and not self._patience.over
        if match.quality >= self.params.poor_match * self._usual.value or in_vain:
            return match
        self._patience.tried()
        self._counts["searched"] += 1
        slip = (self.params.slip * start.dt) ** 2 * np.eye(3)
        wide = Prior(start.pose, inverse3(self._track.expected + slip))
        half = np.minimum(2.0 * np.sqrt(np.diagonal(self._track.expected + slip)), WIDEST)
        before = self._track.pose
        starts = [before, before @ start.continued]
        starts += [matcher.search(view, best, at, half) for at in (start.pose, starts[1])]
        tried = [match, *(matcher.match(view, best, wide, at) for at in starts)]
        chosen = believed(tried, self._track)
        self._counts["recovered"] += chosen is not match
        return chosen

    def _settle(self, scan: Scan, view: View, match: Match | None, start: Prediction) -> None:
        """Tell the track what was found, learn what is usual."""
        track = self._track
        self._patience.wait(start.dt)
        if match is None:
            if view.is_usable:
                track.matched(start.pose, np.eye(3), scan)  # the map begins here
            else:
                track.missed(scan)
            return
        self._counts["posed"] += 1
        self._quality = match.quality
        explains = match.quality >= self.params.lost_below * self._usual.value
        if not (explains and track.reachable(match.pose)):
            self._counts["refused"] += 1
            self._keys.missed()
            track.missed(scan)
            return
        track.matched(match.pose, match.seen, scan, rough=view.is_sparse)
        self._usual.learn(match.quality, scan.t)

    def _due(self, view: View) -> bool:
        """Whether this is a key scan that the map has room for."""
        track = self._track
        known = track.state == "matched" or track.held or track.adrift
        if self.frozen or not view.is_usable or not known:
            self._counts["rejected"] += not known
            return False
        p, gaps = self.params, self._quality < self.params.poor_match * self._usual.value
        due = self._keys.due(track.pose, view.beams if p.refine else math.inf, gaps)
        return due and self.tiles.admits(track.pose, view.far)

    def _filter(self, view: View) -> None:
        """Steps 3 to 7."""
        particles, track = self.particles, self._track
        if self._keys.n == 0:
            particles.poses[:] = track.pose
        else:
            self._propose(view)
            if particles.n_eff < self.params.resample_threshold * len(particles):
                self._follow(particles.draw_ancestors(self._rng.random()))  # 5
                self._counts["resampled"] += 1
            self._elect()  # 6
        self._insert(view)  # 7

    def _propose(self, view: View) -> None:
        """Steps 3 and 4; where the map says nothing, the particles just go along."""
        particles, track = self.particles, self._track
        way = self._keys.way(track.pose)
        particles.move(np.array(way))
        if track.state != "matched":
            return
        information = self._keys.information(way, particles.poses[:, 2], track.predicted)
        found = self._matcher.propose(view, particles.poses, information, track)
        normals = self._rng.standard_normal((len(particles), 3))
        particles.draw(found, self.params.spread * normals)
        particles.weigh(found.log_w, 1.0)

    def _elect(self) -> None:
        """Step 6; where the reported particle is elsewhere all at once, a loop was closed.

        ours: a leader as near as a draw is the reported one with the noise of its draws.
        """
        particles, here = self.particles, self._track.pose
        leader = particles.leader(self.params.switch_margin)
        if self.params.refine and not leaps(here.between(particles.pose(leader))):
            leader = particles.best
        self._counts["switched"] += leader != particles.best
        particles.best, best = leader, particles.pose(leader)
        if leaps(here.between(best)):
            self._counts["closed"] += 1
            self._movers.forget()
            self._track.corrected(best)

    def _insert(self, view: View) -> None:
        self.tiles.cover(*self.particles.extent(view.far))
        if not self._matcher.insert(view, self.particles.poses):
            self._share_one_map()  # out of tiles
            self._counts["collapsed"] += 1
        self._counts["inserted"] += 1
        self._keys.done(self.particles.best_pose)
        self._renderer.keep(Ends(view.ends, view.mount).ray)
        self.particles.remember()

    def _place(self, pose: Pose2) -> None:
        """All particles go on from here with the reported one's map."""
        self._share_one_map()
        self._movers.forget()
        self._usual = Usual(self.params.usual_time)  # of the ground it comes from: no measure here
        self.particles.poses[:] = pose
        self._keys.place(pose)

    def _share_one_map(self) -> None:
        self._follow(np.full(len(self.particles), self.particles.best))

    def _follow(self, ancestors: NDArray[np.int64]) -> None:
        self.particles.follow(ancestors)
        self.tiles.inherit(ancestors)
