"""HasEstimator: state and covariance of an algorithm that uses the front end."""

from __future__ import annotations

from slams.frontend.estimator import PoseEstimator
from slams.frontend.keyframes import Keyframes
from slams.frontend.plain import PlainEstimator
from slams.types import Floats, Pose2, State


class HasEstimator:
    """Implements `slams.types.Confident` by an estimator."""

    _estimator: PoseEstimator | PlainEstimator
    _keyframes: Keyframes

    @property
    def state(self) -> State:
        """Whether the last pose is matched, predicted or lost."""
        return self._estimator.state

    @property
    def quality(self) -> float:
        """Share of the last scan's beams that are inliers, less those in conflict with the map."""
        return self._estimator.quality

    @property
    def covariance(self) -> Floats:
        """Covariance (3, 3) of the last pose in the frame of the first [m^2, m rad, rad^2]."""
        return self._estimator.covariance

    @property
    def local_covariance(self) -> Floats:
        """Covariance (3, 3) relative to the map around the robot, without the drift of the map."""
        return self._estimator.local_covariance

    def _record_inserted(self, pose: Pose2) -> None:
        """Record that the last scan has entered the map at `pose`."""
        self._keyframes.add(pose, self._estimator.quality)
        self._estimator.inserted(self._keyframes.settling)
