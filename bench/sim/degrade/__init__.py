"""Degradations: pure functions of a log, a level and a seed."""

from bench.sim.degrade.catalog import CATALOG, degrade
from bench.sim.degrade.degradation import Degradation

__all__ = ["CATALOG", "Degradation", "degrade"]
