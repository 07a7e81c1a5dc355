"""A step as way ahead, way aside and turn, in which its errors are independent of each other.

Seen from the heading half way, an arc goes straight ahead: an error of the turn moves the end of
the arc neither ahead nor aside. Wheels, gyro and velocity are therefore fused one number at a
time. Seen from the pose before the step, the same errors hang together (`covariance`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slams.motion import velocity_kernels
from slams.types import Floats, Pose2, wrap_angle


class Chord(NamedTuple):
    """A step (or its variances, or its velocity): ahead, aside [m], turn [rad]."""

    ahead: float
    aside: float
    turn: float

    def step(self) -> Pose2:
        """The same step seen from the pose before it."""
        c, s = math.cos(0.5 * self.turn), math.sin(0.5 * self.turn)
        ahead, aside, turn = self
        return Pose2(c * ahead - s * aside, s * ahead + c * aside, wrap_angle(turn))


FAR = 100.0  # m, deviation of a pose that is anywhere: it grows no more
FLOOR = velocity_kernels.FLOOR  # m^2, rad^2; no variance is less
NOTHING = Chord(0.0, 0.0, 0.0)
CERTAIN = Chord(FLOOR, FLOOR, FLOOR)
UNKNOWN = Chord(math.inf, math.inf, math.inf)


def chord_of(step: Pose2) -> Chord:
    """A step seen from the heading half way."""
    c, s = math.cos(0.5 * step.theta), math.sin(0.5 * step.theta)
    return Chord(c * step.x + s * step.y, c * step.y - s * step.x, step.theta)


def travelled(velocity: Pose2, seconds: float) -> Pose2:
    """The step of a base that keeps its velocity [m/s, rad/s], in its own frame; may go back."""
    return Chord(*(v * seconds for v in velocity)).step()


def covariance(step: Pose2, variance: Chord, heading: float = 0.0) -> Floats:
    """Covariance (3, 3) of a step of x, y [m], theta [rad], in the frame that x and y are told in.

    In that frame the robot's `heading` [rad] before the step is 0, unless another is given.
    """
    half = heading + 0.5 * step.theta
    c, s = math.cos(half), math.sin(half)
    ahead, aside, turn = variance
    x_turn, y_turn = -0.5 * step.y, 0.5 * step.x  # an error of the turn turns the chord by half
    xy = c * s * (ahead - aside) + x_turn * y_turn * turn
    xx = c * c * ahead + s * s * aside + x_turn * x_turn * turn
    yy = s * s * ahead + c * c * aside + y_turn * y_turn * turn
    xt, yt = x_turn * turn, y_turn * turn
    return np.array(((xx, xy, xt), (xy, yy, yt), (xt, yt, turn)))


def variances(found: Floats | None, heading: float, match: float) -> Chord:
    """Variances ahead, aside and of the turn of a pose found with covariance (3, 3) in the map.

    `heading` [rad] is the one half way. inf where the covariance is not finite. None stands for
    a match with a deviation of `match` [m, rad].
    """
    if found is None:
        return Chord(match * match, match * match, match * match)
    (xx, xy, _), (_, yy, _), (_, _, turn) = found.tolist()
    turn = max(turn, FLOOR) if math.isfinite(turn) else math.inf
    if not math.isfinite(xx + yy + xy):
        return Chord(math.inf, math.inf, turn)
    c, s = math.cos(heading), math.sin(heading)
    ahead = c * c * xx + 2.0 * c * s * xy + s * s * yy
    return Chord(max(ahead, FLOOR), max(xx + yy - ahead, FLOOR), turn)


def with_the_same_error(before: Floats, step: Floats) -> Floats:
    """`before`, so that the sum with `step` covers errors of both that are one and the same."""
    if float(np.trace(before)) > FAR**2:
        return before
    share = math.sqrt(float(np.trace(step)) / float(np.trace(before)))
    return np.asarray((1.0 + share) * before + step / share)
