"""A page: findings in words and tables, figures under one legend, how it was made."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from string import Template

from bench.report.html.legend import Curve, legend, rules
from bench.report.html.markup import Markup, element, together

HERE = Path(__file__).parent

Sections = Mapping[str, Markup | None]


def page(
    title: str,
    heading: str,
    parts: tuple[Sections, Sections, Sections],
    shown: Sequence[Curve],
    folded: Collection[str] = (),
) -> str:
    """The text of a page.

    Args:
        title: of the window.
        heading: the first line.
        parts: sections before the figures, the figures, and those behind; empty ones are left out.
        shown: what the legend shows and hides, each with its color.
        folded: sections of which only the name is seen at first.
    """
    before, drawn, behind = parts
    main = together(
        _sections(before, folded), _under_legend(drawn, shown, folded), _sections(behind, folded)
    )
    named = [name for name, body in {**before, **drawn, **behind}.items() if body]
    links = [element("a", name, href=f"#{_anchor(name)}") for name in named]
    return template("report.template.html").substitute(
        title=element("title", title),
        style=(HERE / "report.css").read_text(encoding="utf-8") + rules(shown),
        script=(HERE / "report.js").read_text(encoding="utf-8"),
        heading=element("h1", heading),
        contents=together(*links),
        main=main,
    )


def template(name: str) -> Template:
    """A file of this folder with places to fill."""
    return Template((HERE / name).read_text(encoding="utf-8"))


def _under_legend(
    drawn: Sections, shown: Sequence[Curve], folded: Collection[str]
) -> Markup | None:
    if not any(drawn.values()):
        return None
    return element("div", legend(shown), _sections(drawn, folded), class_="figures")


def _sections(bodies: Sections, folded: Collection[str]) -> Markup:
    made = (_section(name, body, name in folded) for name, body in bodies.items() if body)
    return together(*made)


def _section(name: str, body: Markup, folded: bool) -> Markup:
    head = element("h2", name, id=_anchor(name))
    if folded:
        return element("section", element("details", element("summary", head), body))
    return element("section", head, body)


def _anchor(name: str) -> str:
    return name.lower().replace(" ", "-")
