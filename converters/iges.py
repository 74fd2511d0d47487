"""Writing and reading IGES files (version 5.3)."""

from __future__ import annotations

import os
from collections.abc import Sequence
from datetime import datetime

from gtcad._files import written_whole
from gtcad.converters.occt import exchange
from gtcad.converters.part import Part
from gtcad.errors import FileError


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
    data = exchange.file_bytes(path)
    _check_sections(str(path), data)
    exchange.refuse_huge_numbers(path, data)
    return data


def _check_sections(path: str, data: bytes) -> None:
    """Refuse what is not five sections of numbered lines that agree with each other: the kernel dies of some of it."""

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
