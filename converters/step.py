"""Writing and reading STEP files (ISO 10303-21)."""

from __future__ import annotations

import os
from collections.abc import Sequence
from datetime import datetime

from gtcad._files import written_whole
from gtcad.converters.occt import exchange, guards
from gtcad.converters.part import Part
from gtcad.errors import FileError, InputError


def write_step(
    path: str | os.PathLike[str],
    parts: Sequence[Part],
    *,
    schema: exchange.Schema = "AP242",
    tolerance: float | None = None,
    timestamp: datetime | None = None,
) -> None:
    """Write curves and surfaces to a STEP file in mm, one product for each part, in their order.

    Control points, weights and knots are written with 17 significant digits: they read back bit for bit. Weights that
    are all equal are left out, since the kernel takes such a spline for a polynomial one.

    Parameters
    ----------
    path
        Written whole or not at all; an existing file is replaced.
    parts
        At least one. Names may hold any letters; they are written in the escape sequences of Part 21.
    schema
        "AP242", "AP214" or "AP203".
    tolerance
        In mm; goes into the file's UNCERTAINTY, for instance the deviation that was proved. None writes 1e-7.
    timestamp
        Date in the header, and the creation date in AP203; None for now. With a given one, equal input gives equal
        bytes in all three schemas.

    Raises
    ------
    InputError
        When there is no part, a part is too small or too degenerate for the kernel, or an option is out of range.
    FileError
        When the path cannot be written to.
    KernelError
        When the kernel refuses a shape.
    """
    if schema not in exchange.SCHEMAS:
        raise InputError(f"schema must be one of {', '.join(exchange.SCHEMAS)}, got {schema!r}")
    items = exchange.items_of(parts)
    least = exchange.checked_tolerance(tolerance)
    data = exchange.step_bytes(items, schema=schema, tolerance=least, timestamp=timestamp or datetime.now())
    with written_whole(path) as temporary:
        temporary.write_bytes(data)


def read_step(path: str | os.PathLike[str]) -> list[Part]:
    """Every face, and every edge that belongs to no face, of a STEP file, in mm and in the order of the file.

    A part takes the name and colour of its face or edge or, where it has none, those of the shape, product or
    assembly around it. Parts of a product that an assembly uses twice come twice, each in its place.

    Parameters
    ----------
    path
        Of any schema that the kernel reads, in any unit.

    Raises
    ------
    FileError
        When there is no such file, it is damaged or no STEP file, or holds neither faces nor edges.
    KernelError
        When a face or edge has no exact B-spline form.

    Notes
    -----
    A file is refused when it ends too early, when the kernel cannot read or convert one of its shapes, or when one of
    its faces belongs to no product. That is not all that can be wrong: the kernel does not survive every file in which
    entities refer to wrong ones of the right kind.
    """
    data = step_data(path)
    return exchange.parts_of(str(path), "STEP", lambda: exchange.step_items(data))


def step_data(path: str | os.PathLike[str]) -> bytes:
    """All of a file that begins and ends as STEP files do, and whose numbers have a bound.

    Raises
    ------
    FileError
        When there is no such file, or it does not.
    """
    data = guards.file_bytes(path)
    if b"ISO-10303-21;" not in data[:1000]:
        raise FileError(str(path), "is not a readable STEP file: it does not begin with ISO-10303-21;")
    if b"END-ISO-10303-21;" not in data:
        raise FileError(str(path), "is not a readable STEP file: its end is missing")
    guards.refuse_huge_numbers(path, data)
    return data
