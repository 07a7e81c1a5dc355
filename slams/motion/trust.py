"""What no robot can do, and a step as far as it is known."""

from __future__ import annotations

from slams.jit import records
from slams.motion import source_kernels as kernels
from slams.motion.chord import CERTAIN, NOTHING, Chord
from slams.motion.params import MotionParams
from slams.motion.velocity_kernels import EXPECTED
from slams.types import Floats, Records


class Expected:
    """A step as far as it is known, to which one source after another adds its word.

    `dt` [s] is the interval, `reach` [s] the time in which to judge what is possible (longer
    where stamps are too close together). `rows` (3,) are records of `velocity_kernels.EXPECTED`.
    """

    def __init__(self) -> None:
        self.rows = records(3, EXPECTED)
        self.dt = self.reach = 0.0
        self.set(NOTHING, CERTAIN)

    def set(self, step: tuple[float, float, float], variance: Floats | Chord) -> None:
        """Expect a step with such variances, whatever was expected before."""
        self.rows["step"] = self.rows["known"] = step
        self.rows["variance"], self.rows["measured"] = variance, 0.0

    def told(self) -> tuple[Chord, Chord, Chord]:
        """The step, its variances, and the step as it is known without the wheels."""
        (a, a_var, a_known, _), (b, b_var, b_known, _), (t, t_var, t_known, _) = self.rows.tolist()
        return Chord(a, b, t), Chord(a_var, b_var, t_var), Chord(a_known, b_known, t_known)


class Limits:
    """Speeds and accelerations that no robot has."""

    def __init__(self, params: MotionParams) -> None:
        self._laws = laws(params)

    def allow(self, ahead: float, aside: float, turn: float, seconds: float) -> bool:
        """Whether a robot can go that far [m, rad] in so many seconds; if they are known."""
        return bool(kernels.allow(self._laws, ahead, aside, turn, seconds))

    def change(self, seconds: float) -> float:
        """How far [m] accelerations take a robot off its motion in so many seconds."""
        return float(kernels.change(self._laws, seconds))


def laws(params: MotionParams) -> Records:
    """The parameters for kernels: one row of `source_kernels.LAW`."""
    row = records(1, kernels.LAW)
    for name in kernels.LAW.split():
        row[name] = getattr(params, name)
    return row
