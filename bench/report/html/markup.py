"""HTML elements as text; all content is escaped."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape


class Markup(str):
    """Text that is markup; other text is escaped when it is added to an element."""

    __slots__ = ()


def element(tag: str, *children: str | None, **attributes: object) -> Markup:
    """One element.

    Args:
        tag: its name.
        children: elements, or plain text, which is escaped; None is omitted.
        attributes: `aria_label` is written aria-label, `class_` class.
    """
    words = [f"<{tag}"]
    for key, value in attributes.items():
        words.append(f'{key.rstrip("_").replace("_", "-")}="{escape(str(value))}"')
    end = "" if tag == "img" else f"{together(*children)}</{tag}>"
    return Markup(" ".join(words) + f">{end}")


def together(*parts: str | None) -> Markup:
    """Concatenate elements and plain text."""
    known = [part for part in parts if part is not None]
    return Markup("".join(part if isinstance(part, Markup) else escape(part) for part in known))


def bullets(lines: Iterable[str]) -> Markup:
    """A list of sentences."""
    return element("ul", *(element("li", line) for line in lines))
