"""python -m bench.readme: the generated parts of the READMEs, from results and parameters.

A part stands between `<!-- results -->` or `<!-- parameters: NAME -->` and `<!-- end -->`.
"""

from __future__ import annotations

import re
import shutil
import sys
from pathlib import Path

from slams import cli

PROGRAM = "bench.readme"
ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "bench" / "readme_results.json"
PICTURES = ("fig2_translation.png", "fig4_maps.png")
PART = re.compile(r"(<!-- (results|parameters: (\w+)) -->\n).*?(<!-- end -->)", re.DOTALL)


def main(argv: list[str] | None = None) -> int:
    """Run the command; returns its exit code."""
    p = cli.Parser(prog=f"python -m {PROGRAM}", description=(__doc__ or "").partition("\n")[0])
    p.add_argument("folder", nargs="?", type=Path, help="adopt this folder of bench.compare first")

    def command() -> int:
        folder = p.parse_args(argv).folder
        if folder is not None:
            cli.refusing(lambda: adopt(folder))
        for path in readmes():
            path.write_text(rendered(path.read_text(encoding="utf-8")), encoding="utf-8")
        return 0

    return cli.run_command(PROGRAM, command)


def readmes() -> list[Path]:
    """Every README with generated parts."""
    return [ROOT / "README.md", *sorted(ROOT.glob("*/README.md"))]


def adopt(folder: Path) -> None:
    """Make the results and pictures of a comparison those of the README."""
    shutil.copyfile(folder / "results.json", RESULTS)
    for name in PICTURES:
        shutil.copyfile(folder / name, ROOT / "bench" / name)


def rendered(text: str) -> str:
    """A README's text with its generated parts made anew."""

    def part(match: re.Match[str]) -> str:
        body = results() if match[2] == "results" else parameters(match[3])
        return f"{match[1]}\n{body}\n{match[4]}"

    return PART.sub(part, text)


def results() -> str:
    """The tables of the committed results, one line per algorithm."""
    from bench.cases import read_results
    from bench.report import as_markdown

    found = read_results(RESULTS)
    return as_markdown(found["logs"][0], found["rows"])


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
