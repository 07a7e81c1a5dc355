"""python -m bench.readme: the generated parts of the READMEs, from results and parameters.

A part stands between `<!-- results -->`, `<!-- relations -->` or `<!-- parameters: NAME -->` and
`<!-- end -->`.
"""

from __future__ import annotations

import re
import shutil
import sys
from pathlib import Path
from typing import Any

from bench.cases import read_results, write_results
from slams import cli

PROGRAM = "bench.readme"
ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "bench" / "readme_results.json"
RELATIONS = ROOT / "bench" / "readme_relations.json"
PICTURES = ("fig2_translation.png", "fig4_maps.png")
PART = re.compile(r"(<!-- (results|relations|parameters: (\w+)) -->\n).*?(<!-- end -->)", re.DOTALL)


def main(argv: list[str] | None = None) -> int:
    """Run the command; returns its exit code."""
    p = cli.Parser(prog=f"python -m {PROGRAM}", description=(__doc__ or "").partition("\n")[0])
    p.add_argument("folders", nargs="*", type=Path, help="folders of bench.compare to adopt first")

    def _command() -> int:
        for folder in p.parse_args(argv).folders:
            cli.refusing(lambda folder=folder: adopt(folder))  # type: ignore[misc]
        for path in readmes():
            path.write_text(rendered(path.read_text(encoding="utf-8")), encoding="utf-8")
        return 0

    return cli.run_command(PROGRAM, _command)


def readmes() -> list[Path]:
    """Every README with generated parts."""
    packages = sorted(path.parent for path in ROOT.glob("*/slam.py"))
    return [ROOT / "README.md", *(package / "README.md" for package in packages)]


def adopt(folder: Path) -> None:
    """Make a comparison the README's: with relations for the real logs, else the main one."""
    found = read_results(folder / "results.json")
    if not any(row.get("relations") for row in found["rows"]):
        shutil.copyfile(folder / "results.json", RESULTS)
        for name in PICTURES:
            shutil.copyfile(folder / name, ROOT / "bench" / name)
        return
    known = read_results(RELATIONS) if RELATIONS.exists() else {}
    log = found["logs"][0]["name"]
    key = f"{log}, {'with' if found['odometry'] else 'without'} odometry"
    known[key] = {
        row["algorithm"]: {"relations": row["relations"], "cpu_ms_per_scan": row["cpu_ms_per_scan"]}
        for row in found["rows"]
        if not row["failed"]
    }
    write_results(RELATIONS, dict(sorted(known.items())))


def rendered(text: str) -> str:
    """A README's text with its generated parts made anew."""

    def _part(match: re.Match[str]) -> str:
        makers = {"results": results, "relations": relations}
        maker = makers.get(match[2])
        body = maker() if maker else parameters(match[3])
        return f"{match[1]}\n{body}\n{match[4]}"

    return PART.sub(_part, text)


def results() -> str:
    """The tables of the committed results, one line per algorithm."""
    from bench.report import as_markdown

    found = read_results(RESULTS)
    return as_markdown(found["logs"][0], found["rows"])


def relations() -> str:
    """Mean and deviation of the relations' errors on real logs, a column per algorithm."""
    known = read_results(RELATIONS)
    labels = list(dict.fromkeys(label for runs in known.values() for label in runs))
    lines = [f"| log | {' | '.join(labels)} |", "|---|" + "---|" * len(labels)]
    for key, runs in known.items():
        used = max(run["relations"]["used"] for run in runs.values())
        cells = [_relation_cell(runs.get(label)) for label in labels]
        lines.append(f"| {key}, {used} relations | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def _relation_cell(run: dict[str, Any] | None) -> str:
    if run is None or "translation_m" not in run["relations"]:
        return "-"
    error = run["relations"]["translation_m"]
    return f"{error['mean']:.4f} ± {error['std']:.4f}"


def parameters(name: str) -> str:
    """The parameter table of an algorithm, defaults beside the original's values."""
    from slams.registry import find

    cls = find(name).cls.Params
    original = dict(zip(cls.specs(), cls.preset("original").table(), strict=True))
    lines = [
        "| parameter | default | original | unit | meaning | source |",
        "|---|---|---|---|---|---|",
    ]
    for key, value, unit, meaning, source in cls().table():
        lines.append(f"| `{key}` | {value} | {original[key][1]} | {unit} | {meaning} | {source} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.exit(main())
