"""HTML from names and contents: what is not marked as HTML is escaped."""

from __future__ import annotations

import html
import json
from collections.abc import Iterable, Sequence
from typing import Any

SIGNS = {
    "passed": "\u2713",
    "failed": "\u2717",
    "undecided": "?",
    "error": "!",
    "proved": "\u2713",
    "fine": "\u2713",
    "kept": "\u2713",
    "verified": "\u2713",
    "estimated": "\u2248",
    "missing": "\u2205",
    "invalid": "\u2717",
    "lost": "\u2717",
    "broken": "\u2717",
    "unverified": "\u2717",
    "warning": "\u25b3",
    "info": "i",
    "extra": "+",
}
"""A sign for each verdict, for those who see no colours."""


class Markup(str):
    """A piece of HTML; any other text is escaped before it gets into one."""

    __slots__ = ()


def element(name: str, *content: object, **attributes: object) -> Markup:
    """An element with its content; in names of attributes underscores become dashes, and one at the end is left out."""
    given = ((key.rstrip("_").replace("_", "-"), value) for key, value in attributes.items() if value is not None)
    listed = "".join(f' {key}="{html.escape(str(value))}"' for key, value in given)
    return Markup(f"<{name}{listed}>{''.join(map(_piece, content))}</{name}>")


def _piece(content: object) -> str:
    return content if isinstance(content, Markup) else html.escape(str(content))


def script_data(value: Any) -> Markup:
    """JSON that no text can end early."""
    text = json.dumps(value, separators=(",", ":"), ensure_ascii=True, allow_nan=False)
    return Markup(text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026"))


def joined(pieces: Iterable[Markup]) -> Markup:
    """One after the other."""
    return Markup("".join(pieces))


def badge(verdict: str) -> Markup:
    """A verdict with a sign of its own, for those who see no colours."""
    return element(
        "span",
        element("span", SIGNS.get(verdict, "\u00b7"), aria_hidden="true"),
        f" {verdict}",
        class_=f"badge {verdict}",
    )


def table(columns: Sequence[str], rows: Sequence[Markup], kind: str, caption: str) -> Markup:
    """A table that sorts."""
    heads = (
        element("th", element("button", column, type="button"), scope="col", aria_sort="none", data_label=column)
        for column in columns
    )
    return element(
        "div",
        element(
            "table",
            element("caption", caption),
            element("thead", element("tr", joined(heads))),
            element("tbody", joined(rows)),
            class_=f"sortable {kind}",
        ),
        class_="scrolled",
    )
