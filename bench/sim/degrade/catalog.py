"""A degradation by its name, and a log degraded by it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bench.sim.degrade import fan, glass, people, readings, stamps, tilt, wheels
from bench.sim.degrade.degradation import Degradation, degradation
from bench.sim.setting import look_up
from slams.scanlog import ScanLog


@degradation("1", (0,), 0, 0)
def clean(log: ScanLog, level: float) -> ScanLog:
    """The log as it is."""
    return log


KINDS = (fan, readings, people, glass, stamps, wheels, tilt)
EVERY = [clean, *(one for kind in KINDS for one in vars(kind).values())]
CATALOG = {one.name: one for one in EVERY if isinstance(one, Degradation)}


def degrade(log: ScanLog, name: str, level: float, seed: int) -> ScanLog:
    """A log as it would be under a degradation; the one given stays as it is.

    Same arguments, same log, bit for bit. With the same seed a greater level is the same mishap,
    only worse: the same beams drop out and more, the same people walk and others. Degradations go
    on top of one another; `meta["degraded"]` lists them in order, each with its name, level and
    seed, and the log's name tells them. "clean" gives the log itself.

    Raises:
        LookupError: no such degradation.
        ValueError: no such level or seed, or the log has nothing that this could degrade.
    """
    found = look_up("degradation", name, CATALOG)
    level = found.checked(level)
    if seed < 0:
        raise ValueError(f"seed: got {seed}, expected 0 or more")
    missing = found.lacks(log)
    if missing:
        raise ValueError(
            f"{name}: {log.name} has no {missing}; leave {name} out or take another log"
        )
    degraded = found(log, level, np.random.default_rng([seed, *name.encode()]))
    return degraded if found is CATALOG["clean"] else _noted(degraded, name, level, seed)


def _noted(log: ScanLog, name: str, level: float, seed: int) -> ScanLog:
    """What was done stands in the log's meta, so that nobody takes it for the one it was."""
    done = [*log.meta.get("degraded", []), {"name": name, "level": level, "seed": seed}]
    known = {"name": f"{log.name}+{name}={level:g}-{seed}", "degraded": done}
    return replace(log, meta=log.meta | known)
