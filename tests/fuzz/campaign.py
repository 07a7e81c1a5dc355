"""Many cases in a row, each from a seed of its own, so that every one can be run alone."""

import resource
import shutil
import tempfile
import warnings
from pathlib import Path

import numpy as np

from tests.fuzz.families import FAMILIES

ROOM = 300_000  # kB that a whole campaign may grow by


def run(family, cases, algorithm="odometry", first=0):
    """Run cases; returns how many were taken, and a sentence for each that broke a property."""
    taken, broken = 0, []
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for case in range(first, first + cases):
        try:
            taken += one(family, case, algorithm)
        except Exception as error:  # whatever it is, it is what the campaign is after
            broken.append(f"{family} {case}: {type(error).__name__}: {str(error)[:300]}")
        grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
        if grown > ROOM:
            broken.append(f"{family} {case}: {grown // 1000} MB more memory than at the start")
            before += grown
    return taken, broken


def one(family, case, algorithm="odometry"):
    """One case, alone; whether its input was taken."""
    rng = np.random.default_rng([list(FAMILIES).index(family), case])
    folder = Path(tempfile.mkdtemp(prefix="slams-fuzz-"))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            return FAMILIES[family](rng, folder, algorithm)
    finally:
        shutil.rmtree(folder)
