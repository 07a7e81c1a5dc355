"""Tables and sentences of a sweep, from its analysis, and the text for the terminal."""

from __future__ import annotations

import math

import pandas as pd

from bench.judge.answers import Analysis, Cell
from bench.judge.statistics import Share
from bench.judge.survival import Critical
from bench.report.lines import Table, listed, scaled
from bench.report.text import text_table
from bench.results import Line
from slams.params import setting_text

MODES = {False: "laser alone", True: "with odometry"}
ROWS_TITLE = "All runs of each row"
ALARMS_TITLE = "Whether lost runs reported the loss, and were within the limits again at the end"
ANSWER_NOTE = (
    "A winner in bold beats all others in paired tests over the same drives: it was lost less "
    "often, or its error is smaller by at least a fifth. Among equals the cheapest is recommended."
)
CRITICAL_NOTE = "critical level: half of the runs are lost, with its 95 % interval"


def tables(found: Analysis, facts: Line) -> dict[str, Table]:
    """All tables of a sweep, by the name of their file."""
    made = {"rows": Table(ROWS_TITLE, row_table(found))}
    groups = dict.fromkeys((cell.question, cell.odometry) for cell in found.cells)
    for k, (question, odometry) in enumerate(groups):
        own = [c for c in found.cells if (c.question, c.odometry) == (question, odometry)]
        shown = [cell for cell in own if not cell.equal]
        title = f"{question}, {MODES[odometry]}; {CRITICAL_NOTE}{_not_shown(own)}"
        frame = critical_table(shown, facts["units"])
        made[f"critical-{k + 1}"] = Table(title, frame, "degradation")
    made["alarms"] = Table(ALARMS_TITLE, alarm_table(found))
    return {name: one for name, one in made.items() if len(one.frame)}


def _not_shown(cells: list[Cell]) -> str:
    equal = [cell.title for cell in cells if cell.equal]
    return f"; not shown, as all rows are equal in every run: {', '.join(equal)}" if equal else ""


def critical_table(cells: list[Cell], units: dict[str, str]) -> pd.DataFrame:
    """A line per degradation: the critical level of each row, and the answer."""
    lines: dict[str, dict[str, object]] = {}
    for cell in cells:
        line: dict[str, object] = {
            row: shown_level(cell.critical[row], shares, cell.levels)
            for row, shares in cell.curves.items()
        }
        lines[f"{cell.title} [{units.get(cell.title, '')}]"] = line | {"answer": answer(cell)}
    return _frame(lines)


def shown_level(found: Critical, shares: list[Share], levels: list[float]) -> str:
    """A critical level and its interval; for a single level, the number of runs that held it."""
    if len(levels) == 1:
        return str(shares[0])
    level, low, high = (_bound(value, levels) for value in found)
    outside = (-math.inf, levels[0]), (levels[-1], math.inf)
    return level if found[1:] in outside else f"{level} ({low} to {high})"


def _bound(value: float, levels: list[float]) -> str:
    """A level with three digits; < or > and the last tested level if it lies beyond."""
    rising = levels[-1] > levels[0]
    if value == -math.inf:
        return f"{'<' if rising else '>'}{levels[0]:g}"
    if value == math.inf:
        return f"{'>' if rising else '<'}{levels[-1]:g}"
    return f"{value:.3g}"


def answer(cell: Cell) -> str:
    """The winner with its reason, or the equal rows with the recommended one."""
    if not cell.decidable:
        return f"{_drives(cell.drives)} cannot decide: take {cell.take}"
    if not cell.beaten:
        return f"equal within chance: take {cell.take}"
    others = [row for row, (winner, *_) in cell.beaten.items() if winner not in cell.unbeaten]
    if len(cell.unbeaten) == 1 and not others:
        reasons = listed(list(dict.fromkeys(reason for *_, reason in cell.beaten.values())), "or")
        return f"**{cell.take}** ({reasons}, {_chance(max(p for _, p, _ in cell.beaten.values()))})"
    return f"{listed([*cell.unbeaten, *others], 'or')} within chance: take {cell.take}"


def _drives(n: int) -> str:
    return "one drive" if n == 1 else f"{n} drives"


def _chance(p: float) -> str:
    return "p < 0.001" if p < 0.001 else f"p = {p:.2g}"


def choices(found: Analysis) -> list[Table]:
    """The answers: a table for each question, a line for each situation."""
    made: dict[str, dict[str, dict[str, object]]] = {}
    for cell in found.situations:
        lines = made.setdefault(cell.question, {})
        lines.setdefault(cell.title, {})[MODES[cell.odometry]] = answer(cell)
    return [Table(question, _frame(lines), "situation") for question, lines in made.items()]


def row_table(found: Analysis) -> pd.DataFrame:
    """A line per row: levels held, accuracy, cost."""
    lines: dict[str, dict[str, object]] = {}
    for algorithm, odometry, of in found.rows:
        lines[f"{algorithm}, {MODES[odometry]}"] = {
            "used": " + ".join(of.used),
            "levels held [%]": 100.0 * of.levels[0] / of.levels[1] if of.levels[1] else None,
            "not lost, as it is": _count(of.clean),
            "1 s, as it is [mm]": scaled(of.clean_m, 1e3),
            "1 s, all [mm]": scaled(of.second_m, 1e3),
            "worse than the wheels": _count(of.worse_than_wheels),
            "CPU a scan [ms]": scaled(of.cpu_scan, 1e3),
            "dearest x as it is": of.dearest,
        }
    return _frame(lines)


def alarm_table(found: Analysis) -> pd.DataFrame:
    """A line per row: how it reported losses."""
    lines: dict[str, dict[str, object]] = {}
    for algorithm, odometry, of in found.rows:
        lines[f"{algorithm}, {MODES[odometry]}"] = {
            "loss episodes reported within 1 s": _count(of.reported_in_time),
            "scans reported lost without reason [%]": 100.0 * of.false_share,
            "lost runs right at the end": _count(of.right_again),
        }
    return _frame(lines)


def curve_table(found: Analysis) -> pd.DataFrame:
    """The survival curves with their bands, a line per point."""
    lines = [
        {
            "algorithm": row,
            "sensors": MODES[cell.odometry],
            "degradation": cell.title,
            "level": level,
            "held": one.k,
            "runs": one.n,
            "share": one.k / one.n,
            "low": one.low,
            "high": one.high,
        }
        for cell in found.cells
        for row, shares in cell.curves.items()
        for level, one in zip(cell.levels, shares, strict=True)
    ]
    return pd.DataFrame(lines)


def terminal(found: Analysis, facts: Line) -> str:
    """The answer first, then the tables."""
    parts = [head(found, facts), ANSWER_NOTE]
    for one in [*choices(found), *tables(found, facts).values()]:
        parts += [one.title, text_table(one.frame, one.corner)]
    return "\n\n".join(parts)


def head(found: Analysis, facts: Line) -> str:
    """The sweep in one line of text."""
    runs = sum(of[0].n for cell in found.cells for of in cell.curves.values())
    drives = len({log["name"] for log in facts["logs"]})
    places = dict.fromkeys(log["place"] for log in facts["logs"])
    sensor = f"; {facts['sensor']}" if facts["sensor"] else ""
    rate = f" at {facts['rate']:g} Hz" if facts["rate"] else ""
    return (
        f"{runs} climbs over {_drives(drives)} ({', '.join(places)}{sensor}"
        f"{rate}); lost = {facts['lost']}{_settings(facts)}"
    )


def _settings(facts: Line) -> str:
    """The settings of rows that are not part of their names."""
    texts = {
        name: " and ".join(f"{key}={setting_text(value)}" for key, value in changes.items())
        for name, changes in facts.get("settings", {}).items()
    }
    return "".join(f"; {name} with {text}" for name, text in texts.items())


def _count(share: Share) -> str | None:
    return str(share) if share.n else None


def _frame(lines: dict[str, dict[str, object]]) -> pd.DataFrame:
    frame = pd.DataFrame.from_dict(lines, orient="index").astype(object)
    return frame.where(frame.notna(), None)
