"""Lists of checks: which file against which model, within which tolerance."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gtcad._documents import read_document, shown
from gtcad.errors import FileError, ModelError

_FIELDS = ("file", "against", "tolerance", "profile")


@dataclass(frozen=True)
class Wanted:
    """One check of a list; texts as the command line takes them, empty where the list says nothing.

    Attributes
    ----------
    file, against
        Paths, relative ones to the folder of the list.
    tolerance, profile
        As in the options.
    place
        Where it stands, for messages.
    """

    file: str
    against: str
    tolerance: str
    profile: str
    place: str


def read_manifest(path: str | os.PathLike[str]) -> list[Wanted]:
    """The checks of a list.

    Parameters
    ----------
    path
        A .toml or .json file with a list `check` of objects with the fields file, against, tolerance and profile, all
        texts, of which only `file` is needed; `tolerance` may be a number of mm.

    Raises
    ------
    FileError
        When there is no such file.
    ModelError
        When it is no such list; the message names every wrong place.
    """
    if not os.path.exists(path):
        raise FileError(str(path), "no such file")
    document, repeated = read_document(path)
    problems = [f"{_text(location)}: {message}" for location, message in repeated]
    problems += [f"{name}: is not a field of a list of checks" for name in document if name != "check"]
    entries = document.get("check")
    if not isinstance(entries, list) or not entries:
        raise ModelError(str(path), [*problems, f"check: must be a list of checks, got {shown(entries)}"])
    folder = Path(path).parent
    found = []
    for number, entry in enumerate(entries, start=1):
        mistakes = _mistakes(entry)
        problems += [f"check no. {number}{mistake}" for mistake in mistakes]
        if not mistakes:
            texts = {name: str(entry.get(name, "")) for name in _FIELDS}
            paths = {name: str(folder / texts[name]) if texts[name] else "" for name in ("file", "against")}
            found.append(Wanted(**texts | paths, place=f"check no. {number}"))
    if problems:
        raise ModelError(str(path), problems)
    return found


def _text(location: tuple[int | str, ...]) -> str:
    return ".".join(map(str, location)) or "the list"


def _mistakes(entry: Any) -> list[str]:
    """What is wrong with an entry, each to be put behind its place."""
    if not isinstance(entry, dict):
        return [f": must be an object with the fields {', '.join(_FIELDS)}, got {shown(entry)}"]
    mistakes = [f", {shown(name)}: is not a field of a check" for name in entry if name not in _FIELDS]
    if "file" not in entry:
        mistakes.append(", file: is missing")
    for name in _FIELDS:
        value = entry.get(name, "x")
        number = name == "tolerance" and isinstance(value, int | float) and not isinstance(value, bool)
        if not number and (not isinstance(value, str) or not value or "\0" in value):
            mistakes.append(f", {name}: must be a text, got {shown(value)}")
    return mistakes
