"""The committed sweep: kept small, and as the README shows it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, cast

from bench.results.sweep import Cost, Sweep, Trial


def adopt(path: Path, found: Sweep) -> None:
    """Keep a sweep with as many digits as its tables show, so that the file stays small."""
    record = found.record | {"command": found.record["command"].partition(" --out")[0]}
    columns = list(dict.fromkeys(key for trial in found.trials for key in trial))
    known = {
        "facts": found.facts | {"logs": [log["name"] for log in found.facts["logs"]]},
        "record": record,
        "columns": columns,
        "trials": [[rounded(dict(trial).get(key)) for key in columns] for trial in found.trials],
        "costs": [cost and [rounded(value) for value in cost.values()] for cost in found.costs],
    }
    path.write_text(json.dumps(known, separators=(",", ":")) + "\n", encoding="utf-8")


def rounded(value: Any) -> Any:
    """A float with five digits."""
    return float(f"{value:.5g}") if isinstance(value, float) else value


def committed(path: Path) -> Sweep:
    """What `adopt` kept."""
    known = json.loads(path.read_text(encoding="utf-8"))
    columns, names = known["columns"], Cost.__annotations__
    trials = [dict(zip(columns, values, strict=True)) for values in known["trials"]]
    costs = [cost and dict(zip(names, cost, strict=True)) for cost in known["costs"]]
    return Sweep(
        known["facts"],
        cast("list[Trial]", trials),
        cast("list[Cost | None]", costs),
        known["record"],
    )


README = ("survival",)
FIELD = ("errors", "reach", "alarms", "cost")


def part(path: Path) -> str:
    """Who survives, and the answer."""
    from bench.report import sweep_tables

    found = committed(path)
    cpu = found.record["machine"]["cpu"]
    head = f"`{found.record['command']}`, on {cpu}: {sweep_tables.head(found)}."
    return "\n\n".join([head, *_tables(found, README), _listed(sweep_tables.answer(found))]) + "\n"


def field_part(path: Path) -> str:
    """The other tables, and what the drives can tell apart."""
    from bench.report import sweep_tables

    found = committed(path)
    return "\n\n".join([*_tables(found, FIELD), _listed(sweep_tables.verdict_lines(found))]) + "\n"


def _tables(found: Sweep, kinds: tuple[str, ...]) -> list[str]:
    from bench.report import sweep_tables
    from bench.report.text import markdown_table

    made = [one for name, one in sweep_tables.tables(found).items() if name.startswith(kinds)]
    return [f"**{one.title}**\n\n{markdown_table(one.frame, one.corner)}" for one in made]


def _listed(lines: list[str]) -> str:
    return "\n".join(f"- {line}" for line in lines)
