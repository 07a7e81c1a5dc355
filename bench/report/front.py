"""The front page: one table, and which algorithm to take, from a comparison and a sweep."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd

from bench.judge import survival
from bench.judge.survival import Group
from bench.report import run_tables, sweep_tables
from bench.report.lines import listed
from bench.report.sweep_tables import MODES
from bench.report.text import head, markdown_table
from bench.results.sweep import Sweep
from slams.registry import BUILT_IN, IDEAS

# what a reader has or meets, and the degradations that tell of it; every one stands once
SITUATIONS = {
    "A good laser, nothing in the way": ("clean",),
    "A laser that sees little: few beams, a narrow or short view, noise": (
        "beams",
        "fov",
        "range",
        "noise",
        "bias",
        "scale",
        "dropout",
        "quantization",
        "poor_lidar",
    ),
    "People, glass, dust": ("people", "glass", "short"),
    "Scans that are slow, late or missing": (
        "rate",
        "sweep",
        "gap",
        "blind",
        "speed",
        "jitter",
        "lag",
    ),
    "A body that rolls and pitches": ("tilt", "tilt_unmeasured"),
    "Wheels or gyro that are wrong": (
        "slip",
        "stall",
        "jump",
        "wheel_scale",
        "wheel_rate",
        "heading_bias",
        "gyro_bias",
    ),
}
Groups = dict[str, Group]


def table(found: dict[str, Any], sweep: Sweep) -> str:
    """The algorithms of the sweep: idea, error on the clean log, survived, cost; and of what."""
    log, machine = found["logs"][0], found["machine"]["cpu"]
    main = run_tables.main_table(log, found["rows"]).to_dict("index")
    groups = {mode: _groups(sweep, mode) for mode in MODES}
    lines = {_linked(name): _line(name, main, groups) for name in _names(groups)}
    made = markdown_table(pd.DataFrame.from_dict(lines, orient="index"))
    made = made.replace(" ---: |", " --- |", 1)  # ideas are words
    return (
        f"{made}\n\nError and time: `{found['command']}`, {head(log)}, on {machine}. "
        f"Survived: `{sweep.record['command']}`, {sweep_tables.head(sweep)}.\n"
    )


def _line(name: str, main: dict[Any, Any], groups: dict[bool, Groups]) -> dict[str, object]:
    run = main.get(name, {})
    survived = {
        f"survived, {MODES[mode]}": str(own[name].survived) if name in own else None
        for mode, own in groups.items()
    }
    return {
        "idea": IDEAS.get(name),
        "error over 1 s [mm]": run.get("1 s [mm]"),
        **survived,
        "per scan [ms]": run.get("CPU [ms]"),
    }


def choice(sweep: Sweep) -> str:
    """A line for each situation of the sweep, and the answer over all of them."""
    lines = [f"- **{title}** ({_conditions(own)}): {_picks(own)}." for title, own in _parts(sweep)]
    return "\n".join([*lines, *(f"- {line}" for line in sweep_tables.answer(sweep))]) + "\n"


def _parts(sweep: Sweep) -> list[tuple[str, Sweep]]:
    """The trials of each situation that the sweep has any of."""
    parts = [(title, _only(sweep, names)) for title, names in SITUATIONS.items()]
    return [(title, part) for title, part in parts if part.trials]


def _only(sweep: Sweep, degradations: tuple[str, ...]) -> Sweep:
    both = zip(sweep.trials, sweep.costs, strict=True)
    kept = [(trial, cost) for trial, cost in both if trial["degradation"] in degradations]
    return sweep._replace(trials=[trial for trial, _ in kept], costs=[cost for _, cost in kept])


def _conditions(sweep: Sweep) -> str:
    return ", ".join(dict.fromkeys(sweep_tables.condition_of(trial) for trial in sweep.trials))


def _picks(sweep: Sweep) -> str:
    groups = {mode: _groups(sweep, mode) for mode in MODES}
    return "; ".join(f"{MODES[mode]} {_pick(own)}" for mode, own in groups.items() if own)


def _pick(own: Groups) -> str:
    """Who survived most, of equals the cheapest first; then the others, far behind or not."""
    most, best, alike = survival.survivors(own)
    first = survival.cheapest(own, best) or best[0]
    equals = [f"**{first}**", *(name for name in best if name != first)]
    order = sorted(own, key=lambda name: -own[name].survived.k)
    near = [f"{name} {own[name].survived.k}" for name in order if name in {*alike} - {*best}]
    far = [f"{name} {own[name].survived.k}" for name in order if name not in alike]
    words = [f"{listed(equals, 'or')} {most}"]
    words += [f"then {', '.join(near)}"] if near else []
    words += [f"far behind {', '.join(far)}"] if far else []
    return ", ".join(words)


def _groups(sweep: Sweep, odometry: bool) -> Groups:
    found = survival.grouped(sweep, lambda trial: (trial["algorithm"], trial["odometry"]))
    return {name: group for (name, given), group in found.items() if given == odometry}


def _names(groups: dict[bool, Groups]) -> list[str]:
    return list(dict.fromkeys(name for own in groups.values() for name in own))


def _linked(name: str) -> str:
    """A name with the way to its package's README, where the name is one of ours."""
    folder = BUILT_IN.get(name.partition("@")[0], "").partition(".")[0]
    page = Path(folder) / "README.md"
    root = Path(__file__).resolve().parents[2]
    return f"[{name}]({page.as_posix()})" if folder and (root / page).is_file() else name
