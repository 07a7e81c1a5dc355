"""What is known of the robot's pose before its scan is looked at: one model for all algorithms.

Three sources speak of the step since the scan before, each with a variance:

1. the motion so far goes on, with accelerations that last a while (`velocity`);
2. the gyro gives the turn, the wheels the whole step (`wheels`; noise as in [Thrun05] 5.4);
3. a leap that no robot can make is not heard at all (`trust.Limits`), and a source that the
   matches contradicted of late is believed less (`source_kernels.learn_doubt`), until they agree
   again; what wheels lack or have too much for being read late is made good (`reading_kernels`).

They are fused by their information (the plain Kalman update) in the three numbers of a `Chord`,
whose errors are independent. Everything is in seconds and meters: the rate of the scans does not
matter. What wheels count wrongly of every way, its scale and a veer, is learned where every match
sees for itself where it is (`scale_kernels`): a matcher that follows its prediction would confirm
them to itself.

[Thrun05] S. Thrun, W. Burgard, D. Fox. Probabilistic Robotics. MIT Press 2005.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from slams.motion.belief_kernels import carried
from slams.motion.chord import CERTAIN, NOTHING, UNKNOWN, Chord, chord_of, covariance, variances
from slams.motion.clock import Clock
from slams.motion.params import MotionParams
from slams.motion.trust import Expected, Limits
from slams.motion.velocity import Velocity
from slams.motion.wheels import Gyro, Wheels
from slams.types import IDENTITY, Floats, Pose2, Scan, wrap_angle

MATCH = 0.001  # m and rad, deviation of a match that tells none
USED = {  # whether wheels and gyro were heard
    (False, False): ("velocity",),
    (False, True): ("gyro", "velocity"),
    (True, False): ("wheels", "velocity"),
    (True, True): ("wheels", "gyro", "velocity"),
}


class Prediction(NamedTuple):
    """The step since the scan before, as known without the scan.

    `pose` is the pose before composed with `step`. `variance` are the step's variances ahead,
    aside and of the turn, seen from the heading half way, where they are independent; `dt` [s]
    the interval; `velocity` the base's motion per second in its own frame, to deskew with;
    `continued` the step if the motion so far just goes on, a second start for a matcher;
    `used` which of "wheels", "gyro", "velocity" took part.
    """

    pose: Pose2
    step: Pose2
    variance: Chord
    dt: float
    velocity: Pose2
    continued: Pose2
    used: tuple[str, ...]

    @property
    def covariance(self) -> Floats:
        """Covariance (3, 3) of the step [m^2, m rad, rad^2] in the frame of the pose before."""
        return covariance(self.step, self.variance)

    def pose_covariance(self, before: Floats) -> Floats:
        """Covariance (3, 3) of `pose` in the map frame, if the pose before had `before` there.

        This is a matcher's prior: an error of the heading before swings the step.
        """
        return carried(before, self.heading, tuple(self.step), tuple(self.variance))

    @property
    def heading(self) -> float:
        """The heading [rad] before the step."""
        return self.pose.theta - self.step.theta


class Motion:
    """Predicts each scan's pose; is told what the match found, or that there was none.

    Per scan: `predict`, then `moved` or `missed`. `counted`: what one before it has counted.
    """

    def __init__(
        self, params: MotionParams | None = None, counted: dict[str, int] | None = None
    ) -> None:
        p = params or MotionParams()
        self._counted = counted or {}
        self._motion, self._wheels, self._gyro = Velocity(p), Wheels(p), Gyro(p)
        self._limits, self._clock = Limits(p), Clock()
        self._expected = Expected()
        self._before: Scan | None = None
        self._pose = self._velocity = IDENTITY
        self._step, self._last_match = NOTHING, UNKNOWN
        self._was_elsewhere = False

    @property
    def counts(self) -> dict[str, int]:
        """Scans that used wheels and gyro; those whose wheels leapt or contradicted the match."""
        wheels = self._wheels
        now = {"odometry": wheels.used, "gyro": self._gyro.used, "odometry_faults": wheels.faults}
        return {name: n + self._counted.get(name, 0) for name, n in now.items()}

    @property
    def interval(self) -> float:
        """The usual time between two scans [s]."""
        return self._clock.usual

    def predict(self, pose: Pose2, scan: Scan) -> Prediction:
        """The pose at `scan`, from `pose` at the scan before."""
        self._pose, before = pose, self._before
        if before is None:
            return Prediction(pose, IDENTITY, CERTAIN, 0.0, IDENTITY, IDENTITY, ())
        expected = self._going_on(scan.t - before.t)
        self._gyro.add(before, scan, expected)
        self._wheels.add(before, scan, expected)
        self._step, variance, known = expected.told()
        dt, believed = expected.dt, known if self._wheels.contradicts else self._step
        self._velocity = _per_second(believed, dt)
        step = self._step.step()
        used = USED[self._wheels.heard, self._gyro.heard]
        return Prediction(pose @ step, step, variance, dt, self._velocity, known.step(), used)

    def moved(self, pose: Pose2, covariance: Floats | None, scan: Scan) -> None:
        """The match found `pose`, with a covariance (3, 3) in the map frame (inf: not known).

        A match that tells no covariance counts as good to a millimeter and a milliradian.
        """
        step = chord_of(self._pose.between(pose))
        match = variances(covariance, self._pose.theta + 0.5 * step.turn, MATCH)
        if self._before is not None:
            is_motion = self._can_be(step)
            if is_motion or self._was_elsewhere:
                self._clock.found(step)
                self._motion.learn(step, match, self._last_match, self._wheels, self._gyro)
            else:  # found again elsewhere; twice in a row it is the expectation that errs
                self._motion.believe(self._step, self._wheels, self._gyro)
            self._was_elsewhere = not is_motion
        self._before, self._last_match = scan, match

    def missed(self, scan: Scan) -> None:
        """Nothing was found: the pose is the prediction, wheels and gyro alone tell the motion."""
        dt = self._expected.dt
        if self._before is not None:
            self._wheels.fade(dt)
            self._gyro.fade(dt)
            self._motion.believe(self._step, self._wheels, self._gyro)
            self._motion.fade(dt)
        self._before = scan

    def velocity_to(self, pose: Pose2) -> Pose2:
        """Velocity of the base had it moved to `pose` since the scan before, where it can have."""
        step = chord_of(self._pose.between(pose))
        return _per_second(step, self._expected.dt) if self._can_be(step) else self._velocity

    def room(self, seconds: float) -> float:
        """How far [m] from its prediction a robot can be, `seconds` after it was seen.

        Where stamps are ragged nobody knows how long that was: inf.
        """
        reach = max(seconds, self._expected.reach)
        return math.inf if self._clock.ragged else self._limits.change(reach)

    def _going_on(self, stamped: float) -> Expected:
        """The step if the motion so far goes on."""
        expected = self._expected
        dt = expected.dt = self._clock.elapsed(stamped)
        expected.reach = max(dt, self._clock.usual) if dt > 0.0 else 0.0
        self._motion.going_on(dt, expected)
        return expected

    def _can_be(self, step: Chord) -> bool:
        """Whether a robot expected where it was can be where it was found."""
        known = self._step
        turn = wrap_angle(step.turn - known.turn)
        off = (step.ahead - known.ahead, step.aside - known.aside, turn)
        return self._limits.allow(*off, self._expected.reach)


def _per_second(step: Chord, dt: float) -> Pose2:
    """Velocity of a base that makes a step in `dt` [s], ahead being along its chord."""
    return Pose2(step.ahead / dt, step.aside / dt, step.turn / dt) if dt > 0.0 else IDENTITY
