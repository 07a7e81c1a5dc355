"""Runs of a log without ground truth: measures of consistency, and the answer by them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bench.report.lines import Columns, line, listed, value
from bench.results import Line, Rows

if TYPE_CHECKING:
    from bench.results import Comparison

# column of a table: its name in a sentence
MEASURE_WORDS = {
    "walls [x]": "wall area",
    "revisits [mm]": "error at revisits",
    "disagreement [mm]": "agreement with the others",
    "conflict [%]": "conflict with the map",
}
# chosen by rank correlation (docs/comparison.md); two runs always have equal disagreement
DECIDING_MEASURES, MEASURES_OF_TWO_RUNS = ("disagreement [mm]",), ("walls [x]", "revisits [mm]")
MEASURE_COLUMNS: Columns = {
    "revisits [mm]": ("consistency/revisits_m", 1e3),
    "disagreement [mm]": ("disagreement_m", 1e3),
    "conflict [%]": ("conflict", 1e2),
}
MIN_RUNS = 3  # for disagreement to single out one of them


def measures(rows: Rows) -> dict[str, Line]:
    """The measures of each run, by the algorithm's name; less is better for all."""
    whole = [row for row in rows if not row["failed"]]
    areas = [found["walls_m2"] for row in whole if (found := row.get("consistency"))]
    least = min((area for area in areas if area > 0.0), default=None)
    every: dict[str, Line] = {}
    for row in whole:
        area = value(row, "consistency/walls_m2")
        walls = area / least if area and least else None
        every[row["algorithm"]] = {"walls [x]": walls} | line(row, MEASURE_COLUMNS)
    return every


def ranks(found: dict[str, Line]) -> dict[str, float]:
    """Mean rank of each algorithm over the deciding measures; 1 is the best."""
    from scipy.stats import rankdata

    used = deciding(found)
    if not used:
        return {}
    table = np.array([[round(line[key], 3) for key in used] for line in found.values()])
    return dict(zip(found, rankdata(table, axis=0).mean(axis=1).tolist(), strict=True))


def deciding(found: dict[str, Line]) -> list[str]:
    """The measures that decide between these runs, if all runs have them."""
    wanted = DECIDING_MEASURES if len(found) >= MIN_RUNS else MEASURES_OF_TWO_RUNS
    there = [key for key in wanted if all(line[key] is not None for line in found.values())]
    two = MEASURES_OF_TWO_RUNS
    return there or [key for key in two if all(line[key] is not None for line in found.values())]


def mean_ranks(comparison: Comparison, names: set[str]) -> tuple[dict[str, float], list[str]]:
    """Mean rank of each of the algorithms over the logs, and the measures that decided."""
    places: dict[str, list[float]] = {}
    used: dict[str, None] = {}
    for log in comparison.logs:
        own = {name: line for name, line in measures(log.rows).items() if name in names}
        used |= dict.fromkeys(deciding(own) if own else [])
        for name, rank in ranks(own).items():
            places.setdefault(name, []).append(rank)
    return {name: float(np.mean(found)) for name, found in places.items()}, [*used]


def answer(comparison: Comparison, names: set[str]) -> list[str]:
    """The recommendation by the measures without ground truth, over all logs."""
    mean, used = mean_ranks(comparison, names)
    if not mean:
        return ["The log has neither ground truth nor relations: the runs cannot be compared."]
    order = sorted(mean, key=lambda name: mean[name])
    words = listed([MEASURE_WORDS[key] for key in used])
    shown = [f"{name} ({mean[name]:.1f})" for name in order[:4]]
    return [
        f"Without a truth: take {order[0]}, first by {words}.",
        f"Mean ranks: {listed(shown)}. They separate bad runs from good ones, but not two good "
        "ones, and runs with the same error agree: look at the maps.",
    ]
