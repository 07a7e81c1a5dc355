"""The arenas made from a seed, by their names."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from bench.sim.hall import hall
from bench.sim.maze import rescue_arena
from bench.sim.office import office
from bench.sim.ring import ring
from bench.sim.setting import ARENAS, CELL
from bench.sim.world import World

if TYPE_CHECKING:
    from numpy.random import Generator

Builder = Callable[["Generator", float, float], World]  # rng, resolution [m], size [m]
BUILDERS: dict[str, Builder] = {
    "rescue": rescue_arena,
    "office": office,
    "hall": hall,
    "ring": ring,
}


def build_arena(
    name: str, rng: Generator, resolution: float | None = None, size: float | None = None
) -> World:
    """The arena of that name with its longer side of about `size` [m] and cells of `resolution`.

    Same generator state, same arena. Without them cells of `CELL` and the usual size.

    Raises:
        ValueError: cells too coarse for its walls, or a size it cannot have.
    """
    known = ARENAS[name]
    size = known.size if size is None else size
    if not known.least <= size <= known.most:
        raise ValueError(
            f"size: got {size:g} m, expected {known.least:g} to {known.most:g} for the {name} arena"
        )
    return BUILDERS[name](rng, resolution or CELL, size)
