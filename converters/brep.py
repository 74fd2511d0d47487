"""Writing and reading the kernel's own BREP files."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from itertools import pairwise

from gtcad._files import written_whole
from gtcad.converters.occt import exchange, guards
from gtcad.converters.part import Part
from gtcad.errors import FileError

_TABLES = (
    b"Locations",
    b"Curve2ds",
    b"Curves",
    b"Polygon3D",
    b"PolygonOnTriangulations",
    b"Surfaces",
    b"Triangulations",
    b"TShapes",
)
_HEADING = re.compile(rb"^([A-Z][A-Za-z0-9]+) (\d+)\s*$", re.MULTILINE)
_NUMBERS = re.compile(rb"[-+0-9.eE\s]*")
_LAST = re.compile(rb"[+-]\d+ \d+\s*")


def write_brep(path: str | os.PathLike[str], parts: Sequence[Part]) -> None:
    """Write curves and surfaces to a BREP file in mm: one compound, in their order.

    The format has neither names nor colours nor a date: equal input gives equal bytes. Control points, weights and
    knots read back bit for bit. Weights that are all equal are left out, since the kernel takes such a spline for a
    polynomial one.

    Parameters
    ----------
    path
        Written whole or not at all; an existing file is replaced.
    parts
        At least one.

    Raises
    ------
    InputError
        When there is no part, or a part is too small or too degenerate for the kernel.
    FileError
        When the path cannot be written to.
    KernelError
        When the kernel refuses a shape.
    """
    data = exchange.brep_bytes(exchange.items_of(parts))
    with written_whole(path) as temporary:
        temporary.write_bytes(data)


def read_brep(path: str | os.PathLike[str]) -> list[Part]:
    """Every face, and every edge that belongs to no face, of a BREP file, in the order of the file, without names.

    Parameters
    ----------
    path
        In text form; the coordinates are taken for mm.

    Raises
    ------
    FileError
        When there is no such file, it is damaged or no BREP file, or holds neither faces nor edges.
    KernelError
        When a face or edge has no exact B-spline form.

    Notes
    -----
    A file is refused when it ends too early or its tables are incomplete. The kernel hangs on some files in which
    numbers are missing or wrong inside the tables.
    """
    data = brep_data(path)
    return exchange.parts_of(str(path), "BREP", lambda: exchange.brep_items(data))


def brep_data(path: str | os.PathLike[str]) -> bytes:
    """All of a file with the frame of a BREP file.

    Raises
    ------
    FileError
        When there is no such file, or it has not.
    """
    data = guards.file_bytes(path)
    reason = _complaint(data)
    if reason:
        raise FileError(str(path), f"is not a readable BREP file: {reason}")
    guards.refuse_huge_numbers(path, data)
    return data


def _complaint(data: bytes) -> str:
    """What is wrong with the frame of a BREP file, empty if nothing is: the kernel hangs if the end is missing."""
    if b"CASCADE Topology V" not in data[:1000]:
        return "it does not begin with CASCADE Topology"
    headings = [match for match in _HEADING.finditer(data) if match[1] in _TABLES]
    if tuple(match[1] for match in headings) != _TABLES:
        return "its tables are incomplete"
    for this, following in pairwise(headings):
        if not _NUMBERS.fullmatch(data, this.end(), following.start()):
            return f"its table {this[1].decode()} holds something that is no number"
    *shapes, last = data[headings[-1].end() :].split(b"*")
    if len(shapes) != int(headings[-1][2]) or not _LAST.fullmatch(last.lstrip()):
        return "its table TShapes is incomplete"
    return ""
