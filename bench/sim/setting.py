"""Setting of a simulation. Imports stay fast for --help."""

from __future__ import annotations

import dataclasses
import math
import typing
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

from bench.sim.sensors import SENSORS
from slams.params import did_you_mean

T = TypeVar("T")

MOTION_RATE = 400.0  # Hz, minimum rate of the true motion
ARENA_CELL_SIZE = 0.02  # m, of the arenas made from a seed


@dataclass(frozen=True)
class Arena:
    """Description of an arena.

    Default, least and greatest `size` [m]; with `laps` the robot drives around it without turning.
    """

    meaning: str
    size: float
    least: float
    most: float
    laps: bool = False


ARENAS = {
    "rescue": Arena("a maze", 20.0, 7.0, 100.0),
    "office": Arena("a floor of rooms", 40.0, 20.0, 320.0),
    "hall": Arena("with racks and clutter", 30.0, 15.0, 100.0),
    "ring": Arena("a bare corridor", 30.0, 12.0, 300.0, laps=True),
}
ARENA_WORDS = ", ".join(f"{name} ({known.meaning})" for name, known in ARENAS.items())
ARENA_SIZE_WORDS = ", ".join(f"{name} {known.size:g}" for name, known in ARENAS.items())


def look_up(kind: str, name: str, known: Mapping[str, T]) -> T:
    """The entry of a name.

    Raises:
        LookupError: no such name; the message has the nearest one.
    """
    if name in known:
        return known[name]
    hint = did_you_mean(name.lower(), known)
    raise LookupError(f"unknown {kind} {name!r}{hint} (known: {', '.join(known)})")


def _option(default: Any, meaning: str, low: float = -math.inf, high: float = math.inf) -> Any:
    """A field of `Setting`: one line for `--help`, and its bounds."""
    known = {"meaning": meaning, "low": low, "high": high}
    return dataclasses.field(default=default, metadata=known)


@dataclass(frozen=True)
class Setting:
    """All inputs of a simulation; the same setting gives the same log. See the fields' meanings.

    Raises:
        ValueError: a value out of bounds.
    """

    arena: str = _option(
        "rescue",
        f"arena, made from the seed: {ARENA_WORDS}; or MAP.yaml, or a picture (dark = wall)",
    )
    resolution: float | None = _option(
        None,
        f"size of a cell of the arena or of a pixel of the picture [m] (default {ARENA_CELL_SIZE})",
        1e-3,
        1.0,
    )
    size: float | None = _option(
        None, f"longer side of an arena made from the seed [m] (default {ARENA_SIZE_WORDS})", 7, 320
    )
    seed: int = _option(0, "seed of every random draw", 0, 2**63 - 1)
    sensor: str = _option("utm30lx", f"laser, one of {', '.join(SENSORS)}")
    duration: float = _option(300.0, "length of the log [s]", 0.1, 14400.0)
    length: float | None = _option(
        None, "length of the path [m], instead of the duration", 0.1, 5000.0
    )
    v: float = _option(0.5, "greatest speed [m/s]", 0.05, 5.0)
    w: float = _option(0.8, "greatest turn rate [rad/s]", 0.1, 10.0)
    clearance: float = _option(0.3, "least distance between laser and wall [m]", 0.05, 5.0)
    noise: float | None = _option(
        None, "standard deviation of a range [m], instead of the sensor's", 0.0, 10.0
    )
    stdr: bool = _option(
        False, "ranges like those of stdr_simulator: no noise, multiples of the map's cell"
    )
    dropout: float = _option(
        0.0, "share of beams that are lost, half as nan, half as inf", 0.0, 1.0
    )
    people: int = _option(0, "number of people who walk through the arena", 0, 50)
    lasers: int = _option(
        1,
        "number of lasers; 2: front and rear half of the sensor's fan, 0.2 m before and behind the"
        " base, half a period apart",
        1,
        2,
    )
    sweep: bool = _option(
        False, "measure beam after beam while the robot moves, as a turning mirror does"
    )
    tilt: float = _option(
        0.0,
        "greatest roll and pitch of the body [deg], its laser 0.35 m above the floor; the log has"
        " the attitude, measured to 0.3 deg",
        0.0,
        40.0,
    )
    ramps: float = _option(
        0.0,
        "slope of the steepest places of a floor of crossing ramps [deg], 1.2 m from valley to"
        " ridge; laser and attitude as with a tilt",
        0.0,
        40.0,
    )

    def __post_init__(self) -> None:
        if (self.lasers > 1) + bool(self.tilt) + bool(self.ramps) > 1:
            raise ValueError("got more than one of lasers, tilt and ramps, expected one of them")
        for field in dataclasses.fields(self):
            value, known = getattr(self, field.name), field.metadata
            low, high = known["low"], known["high"]
            if isinstance(value, (int, float)) and not low <= value <= high:
                raise ValueError(f"{field.name}: got {value}, expected {low:g} to {high:g}")


def kinds() -> dict[str, type]:
    """The type of each field of `Setting`, without None."""
    hints = typing.get_type_hints(Setting)
    return {name: next(iter(typing.get_args(hint)), hint) for name, hint in hints.items()}
