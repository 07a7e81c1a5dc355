"""A page: sections of words, tables and pictures, all in one file."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Mapping
from pathlib import Path
from string import Template

from bench.report import text as report
from bench.report.html.markup import Markup, element, together
from bench.report.lines import Table

HERE = Path(__file__).parent
NUMBER = 20  # characters of a cell; with more it has words, which take the width of a phone
COSTS = (
    "Mean error against CPU time per scan, both logarithmic: lower left is better. The line joins "
    "those that no other beats in both; crosses were lost."
)


def write(
    folder: Path,
    title: str,
    heading: str,
    shown: Mapping[str, Markup | None],
    folded: Mapping[str, Markup | None],
) -> None:
    """Write report.html; same sections, same bytes.

    Args:
        folder: where it goes.
        title: of the window.
        heading: the first line.
        shown: sections by name; empty ones are left out.
        folded: those behind them, of which only the name is seen at first.
    """
    known = {name: body for name, body in {**shown, **folded}.items() if body}
    links = [element("a", name, href=f"#{_anchor(name)}") for name in known]
    text = template("report.template.html").substitute(
        title=element("title", title),
        style=(HERE / "report.css").read_text(encoding="utf-8"),
        script=(HERE / "report.js").read_text(encoding="utf-8"),
        heading=element("h1", heading),
        contents=together(*links),
        main=together(*(_section(name, body, name in folded) for name, body in known.items())),
    )
    (folder / "report.html").write_text(text, encoding="utf-8", errors="replace")


def picture(path: Path, words: str) -> Markup | None:
    """A png file and in words below what it shows; None where there is none."""
    if not path.exists():
        return None
    data = b64encode(path.read_bytes()).decode("ascii")
    drawn = element("img", src=f"data:image/png;base64,{data}", alt=words)
    return element("figure", drawn, element("figcaption", words))


def table(one: Table) -> Markup:
    """A table with its title that scrolls in its own box; cells as in every other format."""
    head, *body = report.cells(one.frame, one.corner)
    drawn = element(
        "table",
        element("caption", element("span", one.title)),
        element("thead", element("tr", *(element("th", text, scope="col") for text in head))),
        element("tbody", *(_line(head, line) for line in body)),
    )
    known = {"class_": "scroll", "tabindex": 0, "role": "region", "aria_label": one.title}
    return together(element("div", drawn, **known), element("p", one.note) if one.note else None)


def _line(head: list[str], line: list[str]) -> Markup:
    """A line; on a narrow screen the label of a value stands with it."""
    name, *values = line
    header = element("th", element("span", name), scope="row")
    cells = zip(head[1:], values, strict=True)
    return element("tr", header, *(_cell(column, value) for column, value in cells))


def _cell(column: str, value: str) -> Markup:
    known = {"class_": "words"} if len(value) > NUMBER else {}
    return element("td", value, data_label=column, **known)


def template(name: str) -> Template:
    """A file of this folder with places to fill."""
    return Template((HERE / name).read_text(encoding="utf-8"))


def _section(name: str, body: Markup, folded: bool) -> Markup:
    head = element("h2", name, id=_anchor(name))
    if folded:
        return element("section", element("details", element("summary", head), body))
    return element("section", head, body)


def _anchor(name: str) -> str:
    return name.lower().replace(" ", "-")
