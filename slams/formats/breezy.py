"""BreezySLAM's example logs (.dat): a Hokuyo URG-04LX and two wheel encoders, a line per scan.

Columns: 1 stamp [us], 3 and 4 counts of the left and right wheel, from 26 on 682 ranges [mm], 0 =
nothing seen. The file tells no angles; they are the URG-04LX's, 360/1024 degrees per beam, beam 340
straight ahead. Nor does it tell the wheels; they are those of the rover of the published logs.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from slams.formats.options import DamagedError, SourceOptions
from slams.formats.packed import name_of, text_of
from slams.formats.sweep import Geometry, Sweep, common
from slams.scanlog import ScanLog, Track
from slams.types import IDENTITY, Floats, wrap_angle
from slams.validation import FAR, LATEST

N_HEAD, N_BEAMS, FORWARD_BEAM = 25, 682, 340
BEAM_STEP = 2.0 * math.pi / 1024.0
RANGE_MIN, RANGE_MAX = 0.06, 5.6  # what the sensor's protocol counts as a reading
# the example rover's wheels; laser tracks of exp1.dat fit 0.000237 m a count and 0.316 m as well
METERS_PER_COUNT = 2.0 * math.pi * 0.077 / 2000.0  # [m] a wheel rolls: its radius, counts per turn
WHEEL_BASE = 0.33  # [m] from wheel to wheel


def is_breezy(text: str) -> bool:
    """Whether the start of a file reads like columns of numbers with a scan in them."""
    words = text.partition("\n")[0].split()
    return len(words) > N_HEAD + 1 and all(_is_number(word) for word in words[: N_HEAD + 1])


def read(path: Path, options: SourceOptions) -> ScanLog:
    """The scans of a .dat file.

    Raises:
        OSError: the file cannot be opened.
        ValueError: a line has other columns; the sentence says which.
    """
    notes: list[str] = []
    rows = _rows(path, text_of(path, options.salvage, notes), options, notes)
    if not rows:
        raise ValueError(f"{path}: no whole line of {N_HEAD + N_BEAMS} numbers in it")
    t, ranges, laser = common([row.sweep for row in rows], IDENTITY, False, notes)
    odom = None if options.odom == "none" else Track(t, _rolled([row.counts for row in rows]))
    source = {"format": "BreezySLAM", "file": path.name, "odometry": odom and "wheel counts"}
    meta = {"name": name_of(path), "source": source}
    return ScanLog(t, ranges, laser, odom, meta=meta, notes=tuple(notes))


class Row(NamedTuple):
    """One line: a sweep and the counts of both wheels."""

    sweep: Sweep
    counts: tuple[float, float]


def _rows(path: Path, text: str, options: SourceOptions, notes: list[str]) -> list[Row]:
    first = (
        -FORWARD_BEAM * BEAM_STEP
        if options.first_beam is None
        else math.radians(options.first_beam)
    )
    geometry = Geometry(N_BEAMS, first, BEAM_STEP, RANGE_MIN, RANGE_MAX)
    rows, bad = [], 0
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split()
        if not words:
            continue
        try:
            rows.append(_row(words, geometry))
        except ValueError as error:
            if not options.salvage:
                hint = "--salvage leaves such lines out"
                raise DamagedError(f"{path}: line {number}: {error}; {hint}") from error
            bad += 1
    if bad:
        notes.append(f"{bad} lines are not whole and left out")
    return rows


def _row(words: list[str], geometry: Geometry) -> Row:
    if len(words) != N_HEAD + N_BEAMS:
        raise ValueError(f"got {len(words)} numbers, expected {N_HEAD} and {N_BEAMS} ranges")
    t = float(words[0]) * 1e-6
    counts = float(words[2]), float(words[3])
    if not (abs(t) < LATEST and all(abs(count) < FAR / METERS_PER_COUNT for count in counts)):
        raise ValueError(f"got {' '.join(words[:4])}, expected microseconds and wheel counts")
    millimetres = np.array(words[N_HEAD:], np.float64)
    millimetres[millimetres == 0.0] = np.inf
    with np.errstate(over="ignore"):  # beyond float32 is nothing seen
        sweep = Sweep(t, (1e-3 * millimetres).astype(np.float32), geometry)
    return Row(sweep, counts)


def _rolled(counts: list[tuple[float, float]]) -> Floats:
    """Poses (n, 3) of the middle between two wheels, from their counts: arcs put end to end."""
    left, right = METERS_PER_COUNT * np.diff(np.array(counts), axis=0, prepend=[counts[0]]).T
    turn, way = (right - left) / WHEEL_BASE, 0.5 * (left + right)
    heading = np.cumsum(turn)
    chord = way * np.sinc(turn / (2.0 * math.pi))  # np.sinc takes half turns
    x, y = np.cumsum(chord * np.exp(1j * (heading - 0.5 * turn))).view(np.float64).reshape(-1, 2).T
    poses: Floats = np.stack([x, y, wrap_angle(heading)], axis=1)
    return poses


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
