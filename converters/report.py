"""What people read of a check: one page of HTML that needs nothing else, or a PDF or PNG for print."""

from __future__ import annotations

import base64
import hashlib
import html
import importlib.resources
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import gtcad
from gtcad._files import written_whole
from gtcad.converters.report_markup import joined, script_data
from gtcad.converters.report_page import index_table, outcome_section
from gtcad.converters.report_print import write_pdf, write_png
from gtcad.converters.report_view import MAPS
from gtcad.converters.report_words import title_of
from gtcad.errors import FileError, InputError

if TYPE_CHECKING:
    from gtcad.converters.outcome import Outcome

SUFFIXES = (".html", ".pdf", ".png")
_MOST_CORNERS = 900_000  # of the faces in all views of a page: about 60 MB


def write_report(path: str | os.PathLike[str], outcomes: Sequence[Outcome]) -> None:
    """Write the report of one check, or of several with a table of them first.

    Parameters
    ----------
    path
        Ends in .html (one page without any network, for a browser), .pdf or .png (these need the extra ``plot``).
    outcomes
        At least one.

    Raises
    ------
    InputError
        When the suffix is none of these, or there is no outcome.
    FileError
        When the path cannot be written to.
    ExtraMissing
        When matplotlib is not installed.

    Notes
    -----
    Names from files are text on the page, whatever they hold, and a policy in it forbids every script but its own and
    every request. Views beyond a limit in all are left out, which the page says.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"the file of a report must end in {', '.join(SUFFIXES)}, got {os.fspath(path)!r}")
    if not outcomes:
        raise InputError("a report needs at least one outcome, got none")
    with written_whole(path) as temporary, np.errstate(all="ignore"):  # sizes beyond all use are not drawn
        try:
            if suffix == ".html":
                temporary.write_bytes(html_page(outcomes).encode("utf-8", "replace"))  # a name may hold half a letter
            else:
                (write_pdf if suffix == ".pdf" else write_png)(temporary, outcomes)
        except OSError as error:
            raise FileError(str(path), f"cannot be written: {error.strerror}") from error


def html_page(outcomes: Sequence[Outcome]) -> str:
    """The page as text."""
    title = f"Check of {title_of(outcomes[0])}" if len(outcomes) == 1 else f"Check of {len(outcomes)} files"
    sections, room = [], _MOST_CORNERS
    for k, outcome in enumerate(outcomes):
        room -= 0 if outcome.scene is None else sum(len(face.vertices) for face in outcome.scene.faces)
        sections.append(outcome_section(outcome, k + 1, with_scene=room >= 0, only=len(outcomes) == 1))
    main = joined(sections) if len(sections) == 1 else joined([index_table(outcomes), *sections])
    style = _part("_report.css")
    script = _part("_report_view.js") + _part("_report_page.js")
    texts = {
        "title": html.escape(title),
        "generator": f"gtcad {gtcad.__version__}",
        "main": main,
        "style": style,
        "style_hash": _hash(style),
        "script": script,
        "script_hash": _hash(script),
        "data": script_data({"maps": MAPS}),
    }
    return re.sub(r"\{\{(\w+)\}\}", lambda match: texts[match[1]], _part("_report.html"))


def _part(name: str) -> str:
    return (importlib.resources.files("gtcad.converters") / name).read_text(encoding="utf-8")


def _hash(text: str) -> str:
    return base64.b64encode(hashlib.sha256(text.encode()).digest()).decode("ascii")
