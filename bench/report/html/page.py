"""A page with sections of text, tables and pictures, in one file."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Mapping
from pathlib import Path
from string import Template

from bench.report import text as report
from bench.report.html.markup import Markup, element, together
from bench.report.lines import Table

TEMPLATE_FOLDER = Path(__file__).parent
MAX_NUMBER_LENGTH = 20  # characters of a cell; longer cells are text and need the full width
COST_CAPTION = (
    "Mean error against CPU time per scan, both logarithmic; lower left is better. The line is the "
    "Pareto front; crosses are lost runs."
)


def write(
    folder: Path,
    title: str,
    heading: str,
    shown: Mapping[str, Markup | None],
    folded: Mapping[str, Markup | None],
) -> None:
    """Write report.html; the same sections give the same bytes.

    Args:
        folder: the folder of the file.
        title: of the window.
        heading: the first line.
        shown: sections by name; empty ones are omitted.
        folded: sections after these, of which only the name is visible at first.
    """
    known = {name: body for name, body in {**shown, **folded}.items() if body}
    links = [element("a", name, href=f"#{_anchor(name)}") for name in known]
    text = template("report.template.html").substitute(
        title=element("title", title),
        style=(TEMPLATE_FOLDER / "report.css").read_text(encoding="utf-8"),
        script=(TEMPLATE_FOLDER / "report.js").read_text(encoding="utf-8"),
        heading=element("h1", heading),
        contents=together(*links),
        main=together(*(_section(name, body, name in folded) for name, body in known.items())),
    )
    (folder / "report.html").write_text(text, encoding="utf-8", errors="replace")


def picture(path: Path, words: str) -> Markup | None:
    """A png file with its caption; None if the file does not exist."""
    if not path.exists():
        return None
    data = b64encode(path.read_bytes()).decode("ascii")
    drawn = element("img", src=f"data:image/png;base64,{data}", alt=words)
    return element("figure", drawn, element("figcaption", words))


def table(one: Table) -> Markup:
    """A table with its title and note, in its own scrolling box."""
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
    """A line of a table; narrow screens show the label of each value."""
    name, *values = line
    header = element("th", element("span", name), scope="row")
    cells = zip(head[1:], values, strict=True)
    return element("tr", header, *(_cell(column, value) for column, value in cells))


def _cell(column: str, value: str) -> Markup:
    known = {"class_": "words"} if len(value) > MAX_NUMBER_LENGTH else {}
    return element("td", value, data_label=column, **known)


def template(name: str) -> Template:
    """A template file of this folder."""
    return Template((TEMPLATE_FOLDER / name).read_text(encoding="utf-8"))


def _section(name: str, body: Markup, folded: bool) -> Markup:
    head = element("h2", name, id=_anchor(name))
    if folded:
        return element("section", element("details", element("summary", head), body))
    return element("section", head, body)


def _anchor(name: str) -> str:
    return name.lower().replace(" ", "-")
