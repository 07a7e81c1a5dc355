"""HasEstimator: how an algorithm on the front end says how sure it is."""

from __future__ import annotations

from slams.frontend.estimator import PoseEstimator
from slams.frontend.plain import PlainEstimator
from slams.types import Floats, State


class HasEstimator:
    """A `slams.types.Confident` by its estimator."""

    _estimator: PoseEstimator | PlainEstimator

    @property
    def state(self) -> State:
        """How the last pose came about."""
        return self._estimator.state

    @property
    def quality(self) -> float:
        """Share of the last scan's beams that are inliers, less those in conflict with the map."""
        return self._estimator.quality

    @property
    def covariance(self) -> Floats:
        """Covariance (3, 3) of the last pose against the map [m^2, m rad, rad^2]."""
        return self._estimator.covariance
