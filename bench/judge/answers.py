"""Which algorithm a sweep recommends: paired tests over the same drives, or an honest tie.

Each drive has one vote on a pair of algorithms: for the one whose run held more levels. McNemar's
exact test of the votes, with the p-values of all pairs that answer one question corrected together
after Holm, says who is beaten. Only these are ruled out. Of the others the cheapest with the same
accuracy is the one to take.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import combinations
from typing import Any, NamedTuple

from bench.judge import survival, verdicts
from bench.judge.statistics import adjusted, mcnemar
from bench.judge.survival import Critical, Figures, Held, Share
from bench.results.sweep import CLEAN, Sweep

SIGNIFICANT = 0.05
SAME_ACCURACY = 1.25  # times the least error; ours: no user chooses by a quarter of a millimeter

QUESTIONS = {
    "": "The programs to use: defaults",
    "paper": "The ideas: the papers' mechanisms alone (@paper)",
    "original": "The published programs (@original)",
}
ALL = "The rows of this sweep"
EVERYTHING = "All of these together"
# what a reader has or meets, and the degradations that tell of it; every one stands once
SITUATIONS = {
    "A laser that sees little": (
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


class Cell(NamedTuple):
    """One answer: a degradation or several, with or without odometry, for the rows of a question.

    `curves` and `critical` are there for a single degradation. `error_m` is the median error over
    1 s of the runs at levels that every row held, by row, `cpu_s` that of their CPU per scan.
    `beaten` rows are ruled out, each by whom and with which corrected p. `equal`: every run of all
    rows held as many levels. `decidable`: so many drives can show a difference at all.
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
    beaten: dict[str, tuple[str, float]]
    unbeaten: list[str]
    take: str
    equal: bool
    decidable: bool


class Analysis(NamedTuple):
    """All that the tables, figures and sentences of a sweep are made from.

    `rows` are by algorithm and sensors, `accuracy` has sentences on the logs as they are.
    """

    rows: list[tuple[str, bool, Figures]]
    cells: list[Cell]
    situations: list[Cell]
    accuracy: list[tuple[bool, str]]


def analysis(sweep: Sweep) -> Analysis:
    """Weigh all trials of a sweep."""
    runners = list(dict.fromkeys((t["algorithm"], t["odometry"]) for t in sweep.trials))
    names = [name for name in sweep.facts["levels"] if name != CLEAN]
    single: dict[str, tuple[str, ...]] = {name: (name,) for name in names}
    present = {title: tuple(n for n in of if n in names) for title, of in SITUATIONS.items()}
    present = {f"{title} ({', '.join(of)})": of for title, of in present.items() if of}
    if len(present) > 1:
        present[EVERYTHING] = tuple(names)
    return Analysis(
        [(*key, survival.figures(sweep, *key)) for key in runners],
        _answers(sweep, single),
        _answers(sweep, present),
        _accuracy(sweep),
    )


def questions(algorithms: Iterable[str]) -> dict[str, list[str]]:
    """The rows that compete with each other, by question; all together if any would be alone."""
    found: dict[str, list[str]] = {}
    for label in algorithms:
        preset = label.partition("@")[2].partition(":")[0]
        found.setdefault(QUESTIONS.get(preset, QUESTIONS[""]), []).append(label)
    if any(len(rows) < 2 for rows in found.values()):
        return {ALL: [label for rows in found.values() for label in rows]}
    return found


def _answers(sweep: Sweep, parts: dict[str, tuple[str, ...]]) -> list[Cell]:
    """A cell for each question, part and choice of sensors; p-values together by question."""
    found: list[Cell] = []
    modes = sorted({trial["odometry"] for trial in sweep.trials})
    labels = dict.fromkeys(trial["algorithm"] for trial in sweep.trials)
    for question, rows in questions(labels).items():
        own = [trial for trial in sweep.trials if trial["algorithm"] in rows]
        drafts: list[tuple[Cell, dict[str, Held]]] = []
        for odometry in modes:
            for title, names in parts.items():
                runs = survival.held(own, odometry, names)
                if runs:
                    drafts.append((_draft(sweep, question, title, odometry, names, runs), runs))
        found += _decided(drafts)
    return found


def _draft(
    sweep: Sweep,
    question: str,
    title: str,
    odometry: bool,
    names: tuple[str, ...],
    runs: dict[str, Held],
) -> Cell:
    """A cell with everything but its answer."""
    levels = sweep.facts["levels"][names[0]] if len(names) == 1 else []
    curves = {row: survival.curve(of, len(levels)) for row, of in runs.items() if levels}
    errors, costs = _common(sweep, odometry, names, runs)
    return Cell(
        question,
        title,
        odometry,
        levels,
        max(len(of) for of in runs.values()),
        curves,
        {row: survival.critical(shares, levels) for row, shares in curves.items()},
        errors,
        costs,
        beaten={},
        unbeaten=list(runs),
        take="",
        equal=all(of == next(iter(runs.values())) for of in runs.values()),
        decidable=True,
    )


def _common(
    sweep: Sweep, odometry: bool, names: tuple[str, ...], runs: dict[str, Held]
) -> tuple[dict[str, float], dict[str, float]]:
    """Median error over 1 s and CPU per scan at the levels that all held, of rows that hold any."""
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


def _decided(drafts: Sequence[tuple[Cell, dict[str, Held]]]) -> list[Cell]:
    """The cells of one question with their answers."""
    pairs = [
        (k, a, b, survival.votes(runs[a], runs[b]))
        for k, (_, runs) in enumerate(drafts)
        for a, b in combinations(runs, 2)
    ]
    corrected = adjusted([mcnemar(*counts) for *_, counts in pairs])
    beaten: list[dict[str, tuple[str, float]]] = [{} for _ in drafts]
    for (k, a, b, (for_a, for_b)), p in zip(pairs, corrected, strict=True):
        winner, loser = (a, b) if for_a > for_b else (b, a)
        if p < SIGNIFICANT and p < beaten[k].get(loser, ("", 1.0))[1]:
            beaten[k][loser] = (winner, p)
    found = []
    for (cell, runs), lost in zip(drafts, beaten, strict=True):
        unbeaten = [row for row in runs if row not in lost] or list(
            runs
        )  # were they to go in a ring
        decidable = len(pairs) * mcnemar(cell.drives, 0) < SIGNIFICANT
        found.append(
            cell._replace(
                beaten=lost, unbeaten=unbeaten, take=_take(cell, unbeaten), decidable=decidable
            )
        )
    return found


def _take(cell: Cell, unbeaten: list[str]) -> str:
    """The cheapest of the unbeaten rows with the same accuracy; the first if none is known."""
    errors = {row: cell.error_m[row] for row in unbeaten if row in cell.error_m}
    if not errors:
        return unbeaten[0]
    same = [row for row, error in errors.items() if error <= SAME_ACCURACY * min(errors.values())]
    return min(same, key=lambda row: cell.cpu_s[row])


def _accuracy(sweep: Sweep) -> list[tuple[bool, str]]:
    """Whose error is less on the logs as they are, neighbor by neighbor within each question."""
    found = []
    for odometry in sorted({trial["odometry"] for trial in sweep.trials}):
        errors = survival.clean_errors(sweep, odometry)
        for rows in questions(errors).values():
            lines = verdicts.over_means({row: errors[row] for row in rows})
            found += [(odometry, line["sentence"]) for line in lines if line["next"]]
    return found
