"""python -m bench.readme: the generated parts of READMEs and docs, from results and parameters.

A part stands between `<!-- NAME -->` and `<!-- end -->`; NAME is one of `PARTS`, or
`parameters: ALGORITHM` or `ros-parameters: ALGORITHM`.
"""

from __future__ import annotations

import re
import shlex
import shutil
import sys
from pathlib import Path
from typing import Any

from bench.report import readme_sweep
from bench.results import FORMAT, read_figures, sweep, write_figures
from slams import cli
from slams.registry import names

PROGRAM = "bench.readme"
ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "bench" / "readme_results.json"
RELATIONS = ROOT / "bench" / "readme_relations.json"
RANKING = ROOT / "bench" / "readme_ranking.json"
PUBLIC = ROOT / "bench" / "readme_public.json"
SWEEP = ROOT / "bench" / "readme_sweep.json"
PICTURES = ("fig2_translation.png", "fig4_maps.png")
GLANCE = ("glance",)
SHOWN = ("translation", "orientation", "spans", "bound", "overview", "maps", "cost")
PART = re.compile(
    r"(<!-- (table|choice|glance|results|sweep|field|relations|ranking|public|"
    r"(?:ros-)?parameters: (\w+)) -->\n)"
    r".*?(<!-- end -->)",
    re.DOTALL,
)


def parser() -> cli.Parser:
    """The command's arguments."""
    p = cli.Parser(prog=f"python -m {PROGRAM}", description=(__doc__ or "").partition("\n")[0])
    p.add_argument(
        "folders",
        nargs="*",
        type=Path,
        metavar="DIR",
        help="results of compare, sweep or ranking to adopt first",
    )
    return p


def main(argv: list[str] | None = None) -> int:
    """Run the command; returns its exit code."""

    def _command() -> int:
        for folder in parser().parse_args(argv).folders:
            cli.refusing(lambda folder=folder: adopt(folder))  # type: ignore[misc]
        for path in readmes():
            path.write_text(rendered(path.read_text(encoding="utf-8")), encoding="utf-8")
        return 0

    return cli.run_command(PROGRAM, _command)


def readmes() -> list[Path]:
    """Every README and page of docs with generated parts."""
    packages = sorted(path.parent for path in ROOT.glob("*/slam.py"))
    docs = (path for path in sorted(ROOT.glob("docs/*.md")) if PART.search(path.read_text("utf-8")))
    return [ROOT / "README.md", *(package / "README.md" for package in packages), *docs]


def adopt(folder: Path) -> None:
    """Make a folder's results the README's.

    One of bench.ranking; one of bench.sweep; one of bench.compare over several logs, the public
    ones; one with relations for its algorithms on a real log; else the main one.
    """
    if (folder / "ranking.json").exists():
        shutil.copyfile(folder / "ranking.json", RANKING)
        return
    if (folder / sweep.TRIALS).exists():
        readme_sweep.adopt(SWEEP, sweep.read(folder))
        return
    found = read_figures(folder / "results.json", FORMAT)
    if len(found["logs"]) > 1:
        write_figures(PUBLIC, public_figures(found))
        return
    if not any(row.get("relations") for row in found["rows"]):
        write_figures(RESULTS, found | {"command": as_typed(found["command"])})
        for name in PICTURES:
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

    words = shlex.split(command)[3:]  # after python -m bench.compare
    paths = compare.parser().parse_args(words).logs
    typed = [Path(word).name if word in paths else word for word in words]
    if "--out" in typed:
        k = typed.index("--out")
        del typed[k : k + 2]
    return f"python -m {compare.PROGRAM} {shlex.join(typed)}".strip()


def public_figures(found: dict[str, Any]) -> dict[str, Any]:
    """Of results over several logs what `public` shows."""
    keys = ("name", "scans", "beams", "duration_s")
    logs = [{key: log[key] for key in keys} | {"cpu_ms": {}} for log in found["logs"]]
    by_name = {log["name"]: log for log in logs}
    for row in found["rows"]:
        if not row["failed"]:
            by_name[row["log"]]["cpu_ms"][row["algorithm"]] = row["cost"]["mean_ms"]
    return {
        "command": as_typed(found["command"]),
        "cpu": found["machine"]["cpu"],
        "logs": logs,
    }


def rendered(text: str) -> str:
    """A README's text with its generated parts made anew."""

    def _part(match: re.Match[str]) -> str:
        return f"{match[1]}\n{_body(match[2], match[3])}\n{match[4]}"

    return PART.sub(_part, text)


def _body(part: str, name: str | None) -> str:
    """What stands in a part; `name` is the algorithm's whose parameters it lists."""
    if name is None:
        return PARTS[part]()
    if part.startswith("ros-"):
        from slams.ros.ros_params import mapping_table

        return mapping_table(name)
    return parameters(name)


def table() -> str:
    """The front page's table, from the committed results and sweep."""
    from bench.report import front

    return front.table(read_figures(RESULTS), *readme_sweep.committed(SWEEP))


def choice() -> str:
    """Which algorithm to take, from the committed sweep."""
    return readme_sweep.choice(SWEEP)


def glance() -> str:
    """The one-screen overview of the committed results."""
    return _tables(GLANCE)


def results() -> str:
    """The paper's tables and the others of the committed results, and the verdicts."""
    from bench.report.words import neighbors

    log = read_figures(RESULTS)["logs"][0]
    words = (f"- {verdict['sentence']}" for verdict in neighbors(log["verdicts"]))
    return "\n\n".join([_tables(SHOWN), "\n".join(words)]) + "\n"


def _tables(keys: tuple[str, ...]) -> str:
    from bench.report import tables
    from bench.report import text as report

    found = read_figures(RESULTS)
    log = found["logs"][0]
    made = tables.tables(log, found["rows"])
    parts = [f"`{found['command']}`: {report.head(log)}, on {found['machine']['cpu']}."]
    for key in keys:
        if key in made:
            parts += [f"**{tables.TITLES[key]}**", report.markdown_table(made[key])]
    return "\n\n".join(parts) + "\n"


def relations() -> str:
    """Errors of the relations on real logs, a column for each log, the published ones below."""
    from bench.report.error_tables import published

    known = read_figures(RELATIONS)
    lines: dict[str, dict[str, str]] = {}
    for key, runs in known.items():
        for label, run in runs.items():
            lines.setdefault(label, {})[key] = _relation_cell(run)
        with_odometry = key.endswith("with odometry")
        for row in published("relations", key.partition(",")[0]) if with_odometry else []:
            cell = f"{row['translation_mean']:.4f} ± {row['translation_std']:.4f}"
            lines.setdefault(f"published: {row['program']}", {})[key] = cell
    used = {key: max(_used(run) for run in runs.values()) for key, runs in known.items()}
    heads = [f"{key} ({used[key]} relations)" for key in known]
    text = [f"| | {' | '.join(heads)} |", "|---|" + "---:|" * len(heads)]
    ours = {name: k for k, name in enumerate(names())}
    for label, cells in sorted(lines.items(), key=lambda line: ours.get(line[0], len(ours))):
        text.append(f"| {label} | {' | '.join(cells.get(key, '-') for key in known)} |")
    return "\n".join(text) + "\n"


def ranking() -> str:
    """The order of the published programs, counted over arenas."""
    from bench.ranking import as_markdown

    return as_markdown(read_figures(RANKING))


def public() -> str:
    """Size of the public logs, and what each algorithm costs on them."""
    found = read_figures(PUBLIC)
    labels = list(dict.fromkeys(label for log in found["logs"] for label in log["cpu_ms"]))
    heads = ["log", "scans x beams", "lasts [s]", *(f"{label} [ms]" for label in labels)]
    text = [f"| {' | '.join(heads)} |", "| --- |" + " ---: |" * (len(heads) - 1)]
    for log in found["logs"]:
        cells = [log["name"], f"{log['scans']} x {log['beams']}", f"{log['duration_s']:.0f}"]
        cells += [_milliseconds(log["cpu_ms"].get(label)) for label in labels]
        text.append(f"| {' | '.join(cells)} |")
    head = f"`{found['command']}`, CPU time of a scan on {found['cpu']}:"
    return f"{head}\n\n" + "\n".join(text) + "\n"


def _milliseconds(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}"


def _used(run: dict[str, Any]) -> int:
    return int(run["relations"]["used"])


def _relation_cell(run: dict[str, Any]) -> str:
    if "all" not in run["relations"]:
        return "-"
    error = run["relations"]["all"]["translation_m"]
    lost = " (lost)" if run["loss"]["lost"] else ""
    return f"{error['mean']:.4f} ± {error['std']:.4f}{lost}{_luck(run.get('starts'))}"


def _luck(starts: dict[str, Any] | None) -> str:
    """Over several start scans: mean, worst, how many above the limit; a lost run has no error."""
    if not starts:
        return ""
    mean, worst = (
        "-" if starts[key] is None else f"{starts[key]:.4f}" for key in ("mean", "worst")
    )
    above = f"{starts['above']} above {starts['limit_m']:g}"
    return f"; {starts['n']} starts: mean {mean}, worst {worst}, {above}"


def parameters(name: str) -> str:
    """The parameters of an algorithm beside its original's, and those only the original has."""
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


PARTS = {
    "table": table,
    "choice": choice,
    "glance": glance,
    "results": results,
    "sweep": lambda: readme_sweep.part(SWEEP),
    "field": lambda: readme_sweep.field_part(SWEEP),
    "relations": relations,
    "ranking": ranking,
    "public": public,
}


if __name__ == "__main__":
    sys.exit(main())
