"""HTML and SVG elements as text that nothing shown in them can break: all else is escaped."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

VOID = {"img", "input", "meta"}


class Markup(str):
    """Text that is markup already; any other text is escaped where it enters an element."""

    __slots__ = ()


def element(tag: str, *children: str | None, **attributes: object) -> Markup:
    """One element.

    Args:
        tag: its name.
        children: elements, or plain text, which is escaped; None is left out.
        attributes: `aria_label` is written aria-label, `class_` class; True is written without a
            value, None and False not at all.
    """
    words = [f"<{tag}", *_attributes(attributes)]
    if tag in VOID:
        return Markup(" ".join(words) + ">")
    return Markup(" ".join(words) + f">{together(*children)}</{tag}>")


def together(*parts: str | None) -> Markup:
    """Elements and plain text, one after the other."""
    known = [part for part in parts if part is not None]
    return Markup("".join(part if isinstance(part, Markup) else escape(part) for part in known))


def bullets(lines: Iterable[str]) -> Markup:
    """A list of sentences."""
    return element("ul", *(element("li", line) for line in lines))


def _attributes(values: dict[str, object]) -> list[str]:
    words = []
    for key, value in values.items():
        name = key.rstrip("_").replace("_", "-")
        if value is True:
            words.append(name)
        elif value is not None and value is not False:
            words.append(f'{name}="{escape(str(value))}"')
    return words
