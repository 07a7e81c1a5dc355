"""python -m bench.readme: the generated parts of READMEs and docs, from results and parameters.

A part stands between `<!-- NAME -->` and `<!-- end -->`; NAME is one of `PARTS`, or
`parameters: ALGORITHM` or `ros-parameters: ALGORITHM`.
"""

from __future__ import annotations

import argparse
import re
import shlex
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from bench.report import pages
from bench.results import RESULTS_FORMAT, read_figures, sweep, write_figures
from bench.run.single import settings_of
from slams import cli

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "bench" / "readme_results.json"
RELATIONS = ROOT / "bench" / "readme_relations.json"
PUBLIC = ROOT / "bench" / "readme_public.json"
SWEEP = ROOT / "bench" / "readme_sweep.json"
COMPARISON_PICTURES = ("fig_errors.png", "fig4_maps.png")
SWEEP_PICTURE, COST_PICTURE = "fig_sweep.png", "fig_cost.png"
SHOWN_TABLES = ("main", "translation", "orientation", "spans", "maps", "unaided", "cost")
PART = re.compile(
    r"(<!-- (table|choice|results|sweep|field|relations|public|"
    r"(?:ros-)?parameters: (\w+)) -->\n)"
    r".*?(<!-- end -->)",
    re.DOTALL,
)


def parser() -> cli.Parser:
    """The command's arguments."""
    p = cli.Parser(
        prog="python -m bench.readme",
        description="Write the generated parts of READMEs and docs from results and parameters.",
    )
    p.add_argument(
        "folders",
        nargs="*",
        type=Path,
        metavar="DIR",
        help="results of compare or sweep to adopt first",
    )
    return p


def _command(arguments: argparse.Namespace) -> int:
    for folder in arguments.folders:
        cli.refusing(lambda folder=folder: adopt(folder))  # type: ignore[misc]
    for path in readmes():
        path.write_text(rendered(path.read_text(encoding="utf-8")), encoding="utf-8")
    return 0


def readmes() -> list[Path]:
    """All READMEs and pages with generated parts."""
    packages = sorted(path.parent for path in ROOT.glob("*/slam.py"))
    docs = (path for path in sorted(ROOT.glob("docs/*.md")) if PART.search(path.read_text("utf-8")))
    return [ROOT / "README.md", *(package / "README.md" for package in packages), *docs]


def adopt(folder: Path) -> None:
    """Keep a folder's results for the pages.

    A sweep; a comparison over several logs (the public ones), with relations, with variants (only
    its picture of costs), or the main one.
    """
    if (folder / sweep.TRIALS_FILE).exists():
        pages.adopt(SWEEP, sweep.read(folder))
        if (folder / SWEEP_PICTURE).exists():
            shutil.copyfile(folder / SWEEP_PICTURE, ROOT / "bench" / SWEEP_PICTURE)
        return
    found = read_figures(folder / "results.json", RESULTS_FORMAT)
    if len(found["logs"]) > 1:
        write_figures(PUBLIC, public_figures(found))
        return
    if any(settings_of(row["algorithm"]) for row in found["rows"]):
        shutil.copyfile(folder / COMPARISON_PICTURES[0], ROOT / "bench" / COST_PICTURE)
        return
    if not any(row.get("relations") for row in found["rows"]):
        write_figures(RESULTS, found | {"command": as_typed(found["command"])})
        for name in COMPARISON_PICTURES:
            shutil.copyfile(folder / name, ROOT / "bench" / name)
        return
    known = read_figures(RELATIONS) if RELATIONS.exists() else {}
    log = found["logs"][0]["name"]
    key = f"{log}, {'with' if found['odometry'] else 'without'} odometry"
    runs = known.setdefault(key, {})
    for row in found["rows"]:
        if not row["failed"]:
            keys = ("relations", "loss", "starts")
            runs[row["algorithm"]] = {name: row.get(name) for name in keys}
    write_figures(RELATIONS, dict(sorted(known.items())))


def as_typed(command: str) -> str:
    """A command of bench.compare without the folders its logs are in and where it wrote."""
    from bench import compare

    words = shlex.split(command)[2:]  # after slams compare
    paths = compare.parser().parse_args(words).logs
    typed = [Path(word).name if word in paths else word for word in words]
    if "--out" in typed:
        k = typed.index("--out")
        del typed[k : k + 2]
    return f"{compare.parser().prog} {shlex.join(typed)}".strip()


def public_figures(found: dict[str, Any]) -> dict[str, Any]:
    """The figures of the part `public`, from results over several logs."""
    keys = ("name", "scans", "beams", "duration_s")
    logs = [{key: log[key] for key in keys} | {"cpu_ms": {}} for log in found["logs"]]
    by_name = {log["name"]: log for log in logs}
    for row in found["rows"]:
        if not row["failed"]:
            by_name[row["log"]]["cpu_ms"][row["algorithm"]] = row["cost"]["mean_ms"]
    return {"command": as_typed(found["command"]), "cpu": found["machine"]["cpu"], "logs": logs}


def rendered(text: str) -> str:
    """A page's text with new generated parts."""

    def _part(match: re.Match[str]) -> str:
        return f"{match[1]}\n{_body(match[2], match[3])}\n{match[4]}"

    return PART.sub(_part, text)


def _body(part: str, name: str | None) -> str:
    """The content of a part; `name` is the algorithm of a list of parameters."""
    if name is None:
        return PARTS[part]()
    if part.startswith("ros-"):
        from slams.ros.ros_params import mapping_table

        return mapping_table(name)
    return parameters(name)


def table() -> str:
    """The front page's table, from the committed results and sweep."""
    return pages.front_table(read_figures(RESULTS), read_figures(SWEEP))


def results() -> str:
    """The tables of the committed results, and the tests of neighboring algorithms."""
    from bench.report import tables
    from bench.report import text as report
    from bench.report.words import neighbors

    found = read_figures(RESULTS)
    log = found["logs"][0]
    made = tables.tables(log, found["rows"])
    parts = [f"`{found['command']}`: {report.head(log)}, on {found['machine']['cpu']}."]
    parts += [report.titled(made[key]) for key in SHOWN_TABLES if key in made]
    words = [f"- {verdict['sentence']}" for verdict in neighbors(log["verdicts"])]
    return "\n\n".join(parts) + "\n\n\n" + "\n".join(words) + "\n"


def parameters(name: str) -> str:
    """The parameters of an algorithm and its original, and those of the original only."""
    from slams.registry import find

    default, original = (find(label).params().table() for label in (name, f"{name}@original"))
    values = {key: value for key, value, *_ in original}
    lines = [
        "| parameter | default | original | unit | meaning | source |",
        "|---|---|---|---|---|---|",
    ]
    for key, value, *rest in default:
        lines.append(f"| `{key}` | {value} | {values.pop(key, '-')} | {' | '.join(rest)} |")
    lines += ["", f"Only `{name}@original` has:", ""]
    lines += ["| parameter | value | unit | meaning | source |", "|---|---|---|---|---|"]
    lines += [f"| `{key}` | {' | '.join(rest)} |" for key, *rest in original if key in values]
    return "\n".join(lines) + "\n"


PARTS: dict[str, Callable[[], str]] = {
    "table": table,
    "choice": lambda: pages.choice(read_figures(SWEEP)),
    "results": results,
    "sweep": lambda: pages.sweep_part(read_figures(SWEEP)),
    "field": lambda: pages.field(read_figures(SWEEP), "alarms"),
    "relations": lambda: pages.relations_table(read_figures(RELATIONS)),
    "public": lambda: pages.public_table(read_figures(PUBLIC)),
}


main = cli.main_of(parser, _command)

if __name__ == "__main__":
    sys.exit(main())
