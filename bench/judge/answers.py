"""Which algorithm a sweep recommends: paired tests over the same drives.

Two algorithms are compared over the drives that both ran; the seeds of one log are one drive. The
first test is survival: each drive votes for the run that held more levels, and McNemar's exact test
evaluates the votes. The second is accuracy: Wilcoxon's signed-rank test of the ratio of the errors
over 1 s at the levels that both held, one mean log ratio for each drive, if the median ratio
exceeds `SAME_ACCURACY_RATIO`. Holm's method corrects the p-values of both tests, over all pairs of
one question. An algorithm that loses a test is beaten. Among the others, the cheapest one with the
same accuracy is recommended.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from bench.judge import survival
from bench.judge.statistics import SIGNIFICANCE_LEVEL, Share, adjusted, mcnemar, wilcoxon
from bench.judge.survival import Critical, Errors, Figures, Held
from bench.results.sweep import CLEAN, Sweep

SAME_ACCURACY_RATIO = 1.25  # of two errors; ours: smaller differences do not matter to a user
LOST_LESS, MORE_ACCURATE = "lost less", "more accurate"  # reasons of a win

Beaten = dict[str, tuple[str, float, str]]  # by row: winner, corrected p-value, reason

QUESTIONS = {
    "": "The programs to use: defaults",
    "paper": "The ideas: the papers' mechanisms alone (@paper)",
    "original": "The published programs (@original)",
}
SINGLE_QUESTION = "The rows of this sweep"
ALL_DEGRADATIONS = "All degradations together"
# situations of a user, with their degradations; each degradation occurs once
SITUATIONS = {
    "The drive as it is": (CLEAN,),
    "A laser that measures little": (
        *("beams", "fov", "range", "noise", "bias", "scale", "dropout", "quantization"),
        "poor_lidar",
    ),
    "People, glass, dust": ("people", "glass", "short"),
    "Scans that are slow, late or missing, a fast robot": (
        *("rate", "sweep", "gap", "blind", "speed", "jitter", "lag"),
    ),
    "A body that rolls and pitches": ("tilt", "tilt_unmeasured"),
    "Wheels or gyro that are wrong": (
        *("slip", "stall", "jump", "wheel_scale", "wheel_rate", "heading_bias", "gyro_bias"),
    ),
}


class Test(NamedTuple):
    """One paired test of a cell (by its number): winner, loser, reason and p-value."""

    cell: int
    winner: str
    loser: str
    reason: str
    p: float


class Cell(NamedTuple):
    """One answer: a degradation or several, with or without odometry, for the rows of a question.

    `curves` and `critical` exist for a single degradation. `error_m` is the median error over 1 s
    by row, at the levels that every row held; `cpu_s` is the median CPU time per scan. `equal`: all
    rows held the same levels in every drive. `decidable`: there are enough drives for significance.
    """

    question: str
    title: str
    odometry: bool
    levels: list[float]
    drives: int
    curves: dict[str, list[Share]]
    critical: dict[str, Critical]
    error_m: dict[str, float]
    cpu_s: dict[str, float]
    beaten: Beaten
    unbeaten: list[str]
    take: str
    equal: bool
    decidable: bool


class Analysis(NamedTuple):
    """The content of a sweep's tables, figures and sentences; `rows` by algorithm and sensors."""

    rows: list[tuple[str, bool, Figures]]
    cells: list[Cell]
    situations: list[Cell]


def analysis(sweep: Sweep) -> Analysis:
    """Evaluate all trials of a sweep."""
    runners = list(dict.fromkeys((t["algorithm"], t["odometry"]) for t in sweep.trials))
    names = list(sweep.facts["levels"])
    single: dict[str, tuple[str, ...]] = {name: (name,) for name in names if name != CLEAN}
    present = {title: tuple(n for n in of if n in names) for title, of in SITUATIONS.items()}
    present = {f"{title} ({', '.join(of)})": of for title, of in present.items() if of}
    if len(set(present.values()) - {(CLEAN,)}) > 1:
        present[ALL_DEGRADATIONS] = tuple(single)
    return Analysis(
        [(*key, survival.figures(sweep, *key)) for key in runners],
        _answers(sweep, single),
        _answers(sweep, present),
    )


def questions(algorithms: Iterable[str]) -> dict[str, list[str]]:
    """The rows that are compared with each other, by question; all if any would be alone."""
    found: dict[str, list[str]] = {}
    for label in algorithms:
        preset = label.partition("@")[2].partition(":")[0]
        found.setdefault(QUESTIONS.get(preset, QUESTIONS[""]), []).append(label)
    if any(len(rows) < 2 for rows in found.values()):
        return {SINGLE_QUESTION: [label for rows in found.values() for label in rows]}
    return found


def _answers(sweep: Sweep, parts: dict[str, tuple[str, ...]]) -> list[Cell]:
    """A cell for each question, part and choice of sensors; p-values corrected by question."""
    found: list[Cell] = []
    modes = sorted({trial["odometry"] for trial in sweep.trials})
    labels = dict.fromkeys(trial["algorithm"] for trial in sweep.trials)
    for question, rows in questions(labels).items():
        own = [trial for trial in sweep.trials if trial["algorithm"] in rows]
        asked = [
            (title, odometry, names, runs)
            for odometry in modes
            for title, names in parts.items()
            if (runs := survival.held(own, odometry, names))
        ]
        tests: list[Test] = []
        for k, (_, odometry, names, runs) in enumerate(asked):
            tests += _tests(k, runs, survival.errors(own, odometry, names))
        for one, beaten in zip(asked, _beaten(len(asked), tests), strict=True):
            found.append(_cell(sweep, question, *one, beaten, len(tests)))
    return found


def _tests(cell: int, runs: dict[str, Held], errors: dict[str, Errors]) -> list[Test]:
    """Both tests of every pair of rows."""
    found: list[Test] = []
    for a, b in combinations(runs, 2):
        for_a, for_b = survival.votes(runs[a], runs[b])
        p, held_more = mcnemar(for_a, for_b), a if for_a > for_b else b
        found.append(Test(cell, held_more, b if held_more == a else a, LOST_LESS, p))
        ratio, p_error = error_ratio(errors.get(a, {}), errors.get(b, {}))
        better, worse = (a, b) if ratio < 1.0 else (b, a)
        if p < SIGNIFICANCE_LEVEL and held_more == worse:
            p_error = 1.0  # accuracy of the surviving runs does not outweigh the lost ones
        found.append(Test(cell, better, worse, MORE_ACCURATE, p_error))
    return found


def error_ratio(a: Errors, b: Errors) -> tuple[float, float]:
    """Median over the drives of a's error over b's, and the p-value of Wilcoxon's signed ranks.

    Each drive gives the mean log ratio at the levels that both held. Within `SAME_ACCURACY_RATIO`
    the p-value is 1, which keeps Holm's correction valid.
    """
    drives: dict[Any, list[float]] = {}
    for key in a.keys() & b.keys():
        drives.setdefault(key[0], []).append(float(np.log(a[key] / b[key])))
    if not drives:
        return 1.0, 1.0
    logs = np.array([np.mean(values) for values in drives.values()])
    ratio = float(np.exp(np.median(logs)))
    if max(ratio, 1.0 / ratio) <= SAME_ACCURACY_RATIO:
        return ratio, 1.0
    return ratio, wilcoxon(logs)


def _cell(
    sweep: Sweep,
    question: str,
    title: str,
    odometry: bool,
    names: tuple[str, ...],
    runs: dict[str, Held],
    beaten: Beaten,
    tests: int,
) -> Cell:
    """An answer from the levels that each row held and from the beaten rows."""
    levels = sweep.facts["levels"][names[0]] if len(names) == 1 else []
    curves = {row: survival.curve(of, len(levels)) for row, of in runs.items() if levels}
    errors, costs = _common(sweep, odometry, names, runs)
    drives = max(len({log for log, _ in of}) for of in runs.values())
    # all rows, if they beat each other in a circle
    unbeaten = [row for row in runs if row not in beaten] or list(runs)
    return Cell(
        question,
        title,
        odometry,
        levels,
        drives,
        curves,
        {row: survival.critical(shares, levels) for row, shares in curves.items()},
        errors,
        costs,
        beaten,
        unbeaten,
        take=_take(errors, costs, unbeaten),
        equal=all(of == next(iter(runs.values())) for of in runs.values()),
        decidable=tests * mcnemar(drives, 0) < SIGNIFICANCE_LEVEL,
    )


def _common(
    sweep: Sweep, odometry: bool, names: tuple[str, ...], runs: dict[str, Held]
) -> tuple[dict[str, float], dict[str, float]]:
    """Median error over 1 s and CPU per scan at the levels that all rows held, by row."""
    rows = [row for row, of in runs.items() if any(of.values())]
    at: dict[Any, dict[str, tuple[float, float]]] = {}
    for trial, cost in zip(sweep.trials, sweep.costs, strict=True):
        if trial["odometry"] != odometry or trial["degradation"] not in names:
            continue
        if trial["algorithm"] in rows and survival.survived(trial) and cost:
            where = trial["log"], trial["seed"], trial["degradation"], trial["level"]
            figures = trial["second_m"] or 0.0, cost["cpu_s"] / max(trial["scans"], 1)
            at.setdefault(where, {})[trial["algorithm"]] = figures
    shared = [of for of in at.values() if len(of) == len(rows)]
    medians = [
        {row: survival.median([of[row][k] for of in shared]) or 0.0 for row in rows} for k in (0, 1)
    ]
    return (medians[0], medians[1]) if shared else ({}, {})


def _beaten(cells: int, tests: Sequence[Test]) -> list[Beaten]:
    """The beaten rows of each cell of a question; survival comes before accuracy.

    The winner is an unbeaten row, if one won against the row.
    """
    found: list[Beaten] = [{} for _ in range(cells)]
    both = zip(tests, adjusted([test.p for test in tests]), strict=True)
    won = [(test, p) for test, p in both if p < SIGNIFICANCE_LEVEL]
    losers = {(test.cell, test.loser) for test, _ in won}
    won.sort(key=lambda one: (one[0][:2] in losers, one[0].reason == MORE_ACCURATE, one[1]))
    for test, p in won:
        found[test.cell].setdefault(test.loser, (test.winner, p, test.reason))
    return found


def _take(error_m: dict[str, float], cpu_s: dict[str, float], unbeaten: list[str]) -> str:
    """The cheapest unbeaten row with the same accuracy; the first if no error is known."""
    errors = {row: error_m[row] for row in unbeaten if row in error_m}
    if not errors:
        return unbeaten[0]
    same = [
        row for row, error in errors.items() if error <= SAME_ACCURACY_RATIO * min(errors.values())
    ]
    return min(same, key=lambda row: cpu_s[row])
