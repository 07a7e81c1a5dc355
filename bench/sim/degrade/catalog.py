"""All degradations by name, and `degrade`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bench.sim.degrade import fan, glass, people, readings, stamps, tilt, wheels
from bench.sim.degrade.degradation import Degradation, degradation
from bench.sim.setting import look_up
from slams.scanlog import ScanLog


@degradation("1", (0,), 0, 0)
def clean(log: ScanLog, level: float) -> ScanLog:
    """The log without degradation."""
    return log


DEGRADATION_MODULES = (fan, readings, people, glass, stamps, wheels, tilt)
MODULE_VALUES = [clean, *(one for kind in DEGRADATION_MODULES for one in vars(kind).values())]
CATALOG = {one.name: one for one in MODULE_VALUES if isinstance(one, Degradation)}


def degrade(log: ScanLog, name: str, level: float, seed: int) -> ScanLog:
    """A degraded copy of a log.

    The same arguments give the same log, bit for bit. With the same seed a greater level is the
    same defect, only worse: the same beams drop out and more, the same people walk and others.
    Degradations can be combined: `meta["degraded"]` lists them in order with name, level and seed,
    and the log's name contains them. "clean" returns the log itself.

    Raises:
        LookupError: no such degradation.
        ValueError: invalid level or seed, or the log lacks the data to degrade.
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
    """The log with the degradation in its name and meta."""
    done = [*log.meta.get("degraded", []), {"name": name, "level": level, "seed": seed}]
    known = {"name": f"{log.name}+{name}={level:g}-{seed}", "degraded": done}
    return replace(log, meta=log.meta | known)
