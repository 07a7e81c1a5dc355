"""ReportedMap: the map of the particle that is reported, as the front end asks for it."""

from __future__ import annotations

from gmapping.match import Matcher
from gmapping.particles import Particles
from gmapping.render import Ends, Renderer
from gmapping.scan import View
from slams.extent import Box
from slams.frontend.correlative import Lookup
from slams.types import OccupancyGrid, Pose2

REDRAWN = 100  # key scans that are drawn anew with one, after the reported particle has changed


class ReportedMap:
    """Surfaces or hits of its tiles, and the picture of its history for what was seen free."""

    def __init__(self, matcher: Matcher, particles: Particles, picture: Renderer) -> None:
        self._matcher, self._particles, self._picture = matcher, particles, picture
        self._drawn = -1  # lineage

    @property
    def empty(self) -> bool:
        """Whether no scan has entered the map."""
        return self._matcher.tiles.used == 0

    def evaluate(self, points: View, pose: Pose2) -> tuple[float, float]:
        """Shares of the beams that are inliers at a pose, and that are in conflict with the map."""
        if points.beams == 0.0:
            return 0.0, 0.0
        return self._matcher.evaluate(points, self._particles.best, pose, self._picture.counts)

    def lookup(self) -> Lookup:
        """A coarse likelihood of walls, for correlative search."""
        return self._picture.lookup()

    def cut(self, box: Box) -> OccupancyGrid | None:
        """The part of the map in a box, None if nothing was observed there."""
        return self._picture.cut(box)

    def insert(self, ends: Ends) -> None:
        """Draw a key scan where the reported particle is; after another has been reported, more."""
        particles = self._particles
        x, y, theta = particles.poses[particles.best].tolist()
        self._picture.keep(ends.ray, Pose2(x, y, theta))
        if particles.lineage != self._drawn:
            history = particles.history(particles.best)
            if self._picture.follow(history, REDRAWN):
                self._drawn = particles.lineage
