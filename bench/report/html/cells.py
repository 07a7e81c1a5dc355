"""Tables with a title; text of the cells as everywhere else, from bench.report.text."""

from __future__ import annotations

from bench.report import text as report
from bench.report.html.markup import Markup, element
from bench.report.lines import Table


def table(one: Table) -> Markup:
    """A table that scrolls in its own box."""
    head, *body = report.cells(one.frame, one.corner)
    drawn = element(
        "table",
        element("caption", element("span", one.title)),
        element("thead", element("tr", *(element("th", text, scope="col") for text in head))),
        element("tbody", *(_line(head, line) for line in body)),
    )
    return element("div", drawn, class_="scroll", tabindex=0, role="region", aria_label=one.title)


def _line(head: list[str], line: list[str]) -> Markup:
    """A line; on a narrow screen the label of a value stands with it."""
    name, *values = line
    header = element("th", element("span", name), scope="row")
    cells = zip(head[1:], values, strict=True)
    drawn = (element("td", value, data_label=column) for column, value in cells)
    return element("tr", header, *drawn)
