"""Writing and reading IGES files (version 5.3)."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from datetime import datetime

from gtcad._files import written_whole
from gtcad.converters.occt import exchange, guards
from gtcad.converters.part import Part
from gtcad.errors import FileError

_GEOMETRY = (range(100, 200), range(500, 600))  # types of entities
_FINITE_ELEMENT = 136  # which has texts among its numbers
_DELIMITERS = re.compile(rb"\s*(?:1H(.)\1|,)(?:\s*1H(.))?", re.DOTALL)
_NUMBER = rb"\s*+(?:[-+]?(?:\d++\.?\d*+|\.\d++)(?:[EeDd][-+]?\d++)?)?\s*+"


def write_iges(
    path: str | os.PathLike[str],
    parts: Sequence[Part],
    *,
    tolerance: float | None = None,
    timestamp: datetime | None = None,
) -> None:
    """Write curves and surfaces to an IGES file in mm, one entity for each part, in their order.

    Control points, weights and knots are written with 17 significant digits: they read back bit for bit. Weights that
    are all equal are left out, since the kernel takes such a spline for a polynomial one. A full ellipse becomes an
    exact rational B-spline, because the kernel would approximate it.

    Parameters
    ----------
    path
        Written whole or not at all; an existing file is replaced.
    parts
        At least one. Names go into name properties, without spaces at the ends. IGES knows ASCII only: other letters
        are written in UTF-8, which this package and OCCT read, while other programs may show something else.
    tolerance
        In mm; goes into the file's minimum resolution. None writes 1e-7.
    timestamp
        Date in the global section; None for now. With a given one, equal input gives equal bytes.

    Raises
    ------
    InputError
        When there is no part, a part is too small or too degenerate for the kernel, or an option is out of range.
    FileError
        When the path cannot be written to.
    KernelError
        When the kernel refuses a shape.
    """
    items = exchange.items_of(parts, halved_ellipses=True)
    least = exchange.checked_tolerance(tolerance)
    data = exchange.iges_bytes(items, tolerance=least, timestamp=timestamp or datetime.now())
    with written_whole(path) as temporary:
        temporary.write_bytes(data)


def read_iges(path: str | os.PathLike[str]) -> list[Part]:
    """Every face, and every edge that belongs to no face, of an IGES file, in mm and in the order of the file.

    Parameters
    ----------
    path
        In the format with fixed lines of 80 letters, in any unit.

    Raises
    ------
    FileError
        When there is no such file, it is damaged or no IGES file, or holds neither faces nor edges.
    KernelError
        When a face or edge has no exact B-spline form.

    Notes
    -----
    A file is refused when its lines, sections and directory do not agree with each other, or when the kernel cannot
    read or convert one of its entities. That is not all that can be wrong: the kernel does not survive every file with
    wrong parameters, and leaves out some entities without a word.
    """
    iges_data(path)
    return exchange.parts_of(str(path), "IGES", lambda: exchange.iges_items(str(path)))


def iges_data(path: str | os.PathLike[str]) -> bytes:
    """All of a file whose sections agree with each other, and whose numbers have a bound.

    Raises
    ------
    FileError
        When there is no such file, or they do not.
    """
    data = guards.file_bytes(path)
    sections = _checked_sections(str(path), data)
    for number, text in _geometry(sections["D"], sections["P"]):
        guards.refuse_huge_numbers(path, text)
        word = _no_number(text, *_delimiters(sections["G"]))
        if word is not None:
            raise FileError(str(path), f"is not a readable IGES file: entity {number} holds {word!r} for a number")
    return data


def _checked_sections(path: str, data: bytes) -> dict[str, list[bytes]]:
    """The lines of five sections, 72 letters of each; refused when they do not agree: the kernel dies of some of it."""

    def refuse(reason: str) -> None:
        raise FileError(path, f"is not a readable IGES file: {reason}")

    sections: dict[str, list[bytes]] = {letter: [] for letter in "SGDPT"}
    order = "S"
    for number, line in enumerate(data.rstrip().splitlines(), start=1):
        letter = line[72:73].decode("latin-1")
        if letter not in sections or letter == "" or "SGDPT".index(letter) < "SGDPT".index(order):
            refuse(f"line {number} belongs to none of its sections")
        order = letter
        sections[letter].append(line[:72])
        if _number(line[73:80]) != len(sections[letter]):
            refuse(f"line {number} is out of sequence")
    if not all(sections.values()):
        refuse("a section is missing")
    totals = "".join(f"{letter}{len(sections[letter]):7d}" for letter in "SGDP")
    if sections["T"][0][:32].replace(b" ", b"0") != totals.replace(" ", "0").encode():
        refuse("its last line does not count its sections")
    reason = _directory_complaint(sections["D"], sections["P"])
    if reason:
        refuse(reason)
    return sections


def _directory_complaint(directory: list[bytes], parameters: list[bytes]) -> str:
    """What is wrong between the directory, two lines for each entity, and the parameters; empty if nothing is."""
    for i in range(0, len(directory) - 1, 2):
        start, count = _number(directory[i][8:16]), _number(directory[i + 1][24:32])
        lines = parameters[start - 1 : start - 1 + count]
        if start < 1 or count < 1 or len(lines) != count or any(_number(line[64:72]) != i + 1 for line in lines):
            return f"entity {i + 1} has other parameters than its directory says"
    return "an entity has only half a directory entry" if len(directory) % 2 else ""


def _number(field: bytes) -> int:
    return int(field) if field.strip().isdigit() else -1


# --- numbers ----------------------------------------------------------------------------------------------------------


def _geometry(directory: list[bytes], parameters: list[bytes]) -> Iterator[tuple[int, bytes]]:
    """The number in the directory and the parameters of each entity that has nothing but numbers."""
    for i in range(0, len(directory), 2):
        kind, start, count = _number(directory[i][:8]), _number(directory[i][8:16]), _number(directory[i + 1][24:32])
        if kind != _FINITE_ELEMENT and any(kind in kinds for kinds in _GEOMETRY):
            yield i + 1, b"".join(line[:64] for line in parameters[start - 1 : start - 1 + count])


def _delimiters(start: list[bytes]) -> tuple[bytes, bytes]:
    """What ends a parameter, and what ends the last one, as the global section says."""
    found = _DELIMITERS.match(b"".join(start))
    return (found[1] or b",", found[2] or b";") if found else (b",", b";")


def _no_number(text: bytes, delimiter: bytes, end: bytes) -> str | None:
    """The first parameter that is neither empty nor a number, if there is one: the kernel makes something up for it."""
    delimiter, end = re.escape(delimiter), re.escape(end)
    found = re.match(b"(?:" + _NUMBER + delimiter + b")*+", text)
    place = found.end() if found else 0
    if re.compile(_NUMBER + b"(?:" + end + b"|$)").match(text, place):
        return None
    return re.split(delimiter + b"|" + end, text[place:], maxsplit=1)[0].strip().decode("latin-1")[:40]
