"""Tables of a sweep as data frames, made from its results alone; and what the terminal shows."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import pandas as pd

from bench.judge import survival, verdicts
from bench.judge.survival import CLEAN, Group, Share
from bench.report.lines import listed
from bench.report.text import text_table
from bench.results.sweep import Sweep, Trial
from slams.params import worded

MODES = {False: "laser alone", True: "with odometry"}
TITLES = {
    "survival": "Runs that kept their way, of all under all conditions",
    "errors": "Absolute error [mm]: median of the runs that kept their way, and how many were lost",
    "reach": "Hardest level that every run survived",
    "alarms": "Whether a lost run said so, and was right again at its end",
    "cost": "CPU per second of log [ms/s]",
}
CORNERS = {"errors": "condition", "reach": "degradation", "cost": "condition"}
Key = tuple[str, bool]


class Table(NamedTuple):
    """A table with its title and what stands over the names of its lines."""

    title: str
    corner: str
    frame: pd.DataFrame


def tables(sweep: Sweep) -> dict[str, Table]:
    """All tables of a sweep that have anything to say, by a name for a file."""
    made = {"survival": survival_table(sweep)}
    for key, maker in (("errors", error_table), ("reach", reach_table), ("cost", cost_table)):
        for odometry in sorted({trial["odometry"] for trial in sweep.trials}):
            made[f"{key}, {MODES[odometry]}"] = maker(sweep, odometry)
    made["alarms"] = alarm_table(sweep)
    return {
        name.replace(", ", "-").replace(" ", "-"): _titled(name, frame)
        for name, frame in made.items()
        if len(frame) and len(frame.columns)
    }


def _titled(name: str, frame: pd.DataFrame) -> Table:
    key, _, mode = name.partition(", ")
    title = f"{mode.capitalize()}. {TITLES[key]}" if mode else TITLES[key]
    return Table(title, CORNERS.get(key, "algorithm"), frame)


def survival_table(sweep: Sweep) -> pd.DataFrame:
    """A line per algorithm and sensors: survived, worse than the wheels, cost."""
    lines: dict[str, dict[str, object]] = {}
    for key, group in survival.grouped(sweep, _runner).items():
        ratio = survival.cost_ratio(sweep, *key)
        lines[name_of(key)] = {
            "used": _used(sweep, key),
            "survived": str(group.survived),
            "at least [%]": 100.0 * group.survived.low,
            "at most [%]": 100.0 * group.survived.high,
            "worse than the wheels": _count(group.worse_than_wheels),
            "right again": _count(group.right_again),
            "posed [%]": None if group.posed is None else 100.0 * group.posed,
            "refined [%]": None if group.refined is None else 100.0 * group.refined,
            "CPU [ms/s]": None if group.cpu is None else 1e3 * group.cpu,
            "dearest x clean": ratio,
        }
    return _frame(lines)


def error_table(sweep: Sweep, odometry: bool) -> pd.DataFrame:
    """A line per condition, a column per algorithm."""
    return _by_condition(sweep, odometry, _error_cell)


def cost_table(sweep: Sweep, odometry: bool) -> pd.DataFrame:
    """CPU per second of log under each condition."""
    return _by_condition(sweep, odometry, lambda g: _digits(g.cpu))


def alarm_table(sweep: Sweep) -> pd.DataFrame:
    """What the algorithms said of themselves."""
    lines: dict[str, dict[str, object]] = {}
    for key, group in survival.grouped(sweep, _runner).items():
        lines[name_of(key)] = {
            "losses said within 1 s": _count(group.said_in_time),
            "scans called lost without reason [%]": 100.0 * group.false_share,
            "lost runs right at the end": _count(group.right_again),
        }
    return _frame(lines)


def reach_table(sweep: Sweep, odometry: bool) -> pd.DataFrame:
    """A line per degradation with its unit; a dash where already the mildest level was too much."""
    own = [trial for trial in sweep.trials if trial["odometry"] == odometry]
    lines: dict[str, dict[str, object]] = {}
    for name in dict.fromkeys(t["degradation"] for t in own if t["degradation"] != CLEAN):
        levels = dict.fromkeys(t["level"] for t in own if t["degradation"] == name)
        line: dict[str, object] = {"tried": ", ".join(f"{level:g}" for level in levels)}
        for algorithm in _algorithms(sweep):
            found = survival.reach(sweep, algorithm, odometry, name)
            line[algorithm] = None if found is None else f"{found:g}"
        lines[f"{name} [{sweep.facts['units'].get(name, '')}]"] = line
    return _frame(lines)


def trial_table(sweep: Sweep) -> pd.DataFrame:
    """Every trial with all its figures and its cost."""
    frame = pd.DataFrame(list(sweep.trials))
    frame["used"] = [" + ".join(trial.get("used") or []) for trial in sweep.trials]
    for name in ("cpu_s", "longest_ms"):
        frame[name] = [cost[name] if cost else None for cost in sweep.costs]
    return frame


def terminal(sweep: Sweep) -> str:
    """One screen: who survives, the errors, the answer; the files have the rest."""
    parts = [head(sweep)]
    for name, made in tables(sweep).items():
        if name.startswith(("survival", "errors")):
            parts += [made.title, text_table(made.frame, made.corner)]
    return "\n\n".join([*parts, "\n".join(answer(sweep))])


def head(sweep: Sweep) -> str:
    """The sweep in one line."""
    places = list(dict.fromkeys(trial["place"] for trial in sweep.trials))
    limits = sweep.facts["limits"]
    rate = f" at {sweep.facts['rate']:g} Hz" if sweep.facts["rate"] else ""
    return (
        f"{len(sweep.trials)} runs over {len(sweep.facts['logs'])} logs ({', '.join(places)}; "
        f"{sweep.facts['sensor']}{rate}); lost = off by more than {limits['limit_m']:g} m or "
        f"{limits['limit_rad']:g} rad anywhere{_settings(sweep)}"
    )


def _settings(sweep: Sweep) -> str:
    """What was set for rows whose name does not say so."""
    found = sweep.facts.get("settings", {})
    texts = {
        name: " and ".join(f"{key}={worded(value)}" for key, value in changes.items())
        for name, changes in found.items()
    }
    return "".join(f"; {name} with {text}" for name, text in texts.items())


def answer(sweep: Sweep) -> list[str]:
    """Which one? The one that survives most, the most accurate, the cheapest that survives."""
    groups = survival.grouped(sweep, _runner)
    lines: list[str] = []
    for odometry in dict.fromkeys(key[1] for key in groups):
        own = {key[0]: group for key, group in groups.items() if key[1] == odometry}
        lines.append(f"{MODES[odometry].capitalize()}: {_answer(own, sweep, odometry)}")
    return lines


def verdict_lines(sweep: Sweep) -> list[str]:
    """Which algorithm is better on the clean logs, over the drives, as far as they can tell."""
    lines: list[str] = []
    for odometry in dict.fromkeys(trial["odometry"] for trial in sweep.trials):
        found = verdicts.over_means(survival.clean_errors(sweep, odometry))
        lines += [f"{MODES[odometry]}, {entry['sentence']}" for entry in found if entry["next"]]
    return lines


def _answer(own: dict[str, Group], sweep: Sweep, odometry: bool) -> str:
    most, best, alike = survival.survivors(own)
    errors = survival.clean_errors(sweep, odometry)
    means = {name: sum(e.values()) / len(e) for name, e in errors.items() if name in own and e}
    words = [f"{listed(best)} survived most, {most}"]
    if means:
        sharpest = min(means, key=lambda name: means[name])
        words.append(f"{sharpest} is the most accurate, {1e3 * means[sharpest]:.2f} mm over 1 s")
    cheapest = survival.cheapest(own, alike)
    if cheapest is not None:
        words.append(
            f"{cheapest} is the cheapest of those that survive as much as can be distinguished "
            f"({listed(alike)}), {_digits(own[cheapest].cpu)} ms per second"
        )
    return "; ".join(words) + "."


def _by_condition(
    sweep: Sweep, odometry: bool, cell: Callable[[Group], str | None]
) -> pd.DataFrame:
    found = survival.grouped(sweep, lambda trial: (condition_of(trial), _runner(trial)))
    lines: dict[str, dict[str, object]] = {}
    for (condition, (algorithm, given)), group in found.items():
        if given == odometry:
            lines.setdefault(condition, {})[algorithm] = cell(group)
    columns = _algorithms(sweep)
    return _frame({name: {c: line.get(c) for c in columns} for name, line in lines.items()})


def _digits(seconds: float | None) -> str | None:
    return None if seconds is None else f"{1e3 * seconds:.1f}"


def _error_cell(group: Group) -> str:
    lost = group.survived.n - group.survived.k
    words = f"{lost} of {group.survived.n} lost" if lost else ""
    if group.ate_m is None:
        return words
    error = f"{1e3 * group.ate_m:.1f}" if group.ate_m < 0.1 else f"{1e3 * group.ate_m:.0f}"
    return f"{error}, {words}" if lost else error


def condition_of(trial: Trial) -> str:
    """A degradation and its level, as on the command line."""
    name, level = trial["degradation"], trial["level"]
    return name if name == CLEAN else f"{name}={level:g}"


def name_of(key: Key) -> str:
    """An algorithm and what it was given."""
    return f"{key[0]}, {MODES[key[1]]}"


def _runner(trial: Trial) -> Key:
    return trial["algorithm"], trial["odometry"]


def _algorithms(sweep: Sweep) -> list[str]:
    return list(dict.fromkeys(trial["algorithm"] for trial in sweep.trials))


def _used(sweep: Sweep, key: Key) -> str:
    """All sensors that its runs say they used."""
    own = [trial for trial in sweep.trials if _runner(trial) == key and not trial["failed"]]
    return " + ".join(dict.fromkeys(name for trial in own for name in trial["used"]))


def _count(share: Share) -> str | None:
    return str(share) if share.n else None


def _frame(lines: dict[str, dict[str, object]]) -> pd.DataFrame:
    frame = pd.DataFrame.from_dict(lines, orient="index").astype(object)
    frame = frame.where(frame.notna(), None)
    return frame.dropna(axis=1, how="all")
