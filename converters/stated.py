"""Reading a file for a check: its shapes as the kernel holds them, and the accuracy that the file says it has."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from gtcad.errors import FileError, KernelError

if TYPE_CHECKING:
    from gtcad.converters.occt.document import Item

_REAL = rb"([-+]?\d+\.?\d*(?:[eE][-+]?\d+)?)"
_UNCERTAINTY = re.compile(
    rb"UNCERTAINTY_MEASURE_WITH_UNIT\s*\(\s*LENGTH_MEASURE\s*\(\s*" + _REAL + rb"\s*\)\s*,\s*#(\d+)"
)
_PREFIXES = {b"MILLI": 1.0, b"CENTI": 10.0, b"DECI": 100.0, b"KILO": 1e6, b"MICRO": 1e-3, b"NANO": 1e-6}
_CONVERSION = re.compile(rb"CONVERSION_BASED_UNIT\s*\(\s*'([^']*)'")
_NAMED = {b"INCH": 25.4, b"FOOT": 304.8, b"FEET": 304.8, b"MIL": 0.0254, b"MICROINCH": 2.54e-5}
_IGES_UNITS = {1: 25.4, 2: 1.0, 4: 304.8, 5: 1609344.0, 6: 1e3, 7: 1e6, 8: 0.0254, 9: 1e-3, 10: 10.0, 11: 2.54e-5}
_LARGEST_HEADER = 100_000  # bytes of an IGES global section that are looked at


def items_and_accuracies(path: str, form: str) -> tuple[list[Item], tuple[float, ...]]:
    """The faces and free edges of a file of the form STEP, IGES or BREP, and the accuracies that it states, in mm.

    Raises
    ------
    FileError
        When it cannot be read or holds nothing.
    """
    from gtcad.converters import brep, iges, step
    from gtcad.converters.occt import exchange, guards

    try:
        if form == "STEP":
            data = step.step_data(path)
            found, stated = exchange.step_items(data), step_accuracies(data)
        elif form == "IGES":
            data = iges.iges_data(path)
            found, stated = exchange.iges_items(path), iges_accuracies(data)
        else:
            found, stated = exchange.brep_items(brep.brep_data(path)), ()
    except (guards.Unreadable, KernelError) as error:
        raise FileError(path, f"is not a readable {form} file: {error}") from error
    if not found:
        raise FileError(path, "holds neither faces nor edges")
    return found, stated


def step_accuracies(data: bytes) -> tuple[float, ...]:
    """The different uncertainties of lengths that a STEP file states, in mm, in rising order; none if it states none.

    Examples
    --------
    >>> unit = b"#7=(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.));"
    >>> step_accuracies(unit + b"#8=UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE(1.E-05),#7,'a','b');")
    (1e-05,)
    """
    found = set()
    for match in _UNCERTAINTY.finditer(data):
        definition = re.search(rb"#" + match[2] + rb"\s*=([^;]*);", data)
        unit = _step_unit(definition[1] if definition else b"")
        if unit is not None:
            found.add(float(match[1]) * unit)
    return tuple(sorted(found))


def _step_unit(definition: bytes) -> float | None:
    """The unit of length of an entity, in mm; None when it is not known."""
    named = _CONVERSION.search(definition)
    if named:
        return _NAMED.get(named[1].strip().upper())
    prefix = re.search(rb"SI_UNIT\s*\(\s*(?:\.(\w+)\.|\$)\s*,\s*\.METRE\.", definition)
    if prefix is None:
        return None
    return 1e3 if prefix[1] is None else _PREFIXES.get(prefix[1])


def iges_accuracies(data: bytes) -> tuple[float, ...]:
    """The minimum resolution that the global section of an IGES file states, in mm; none if it states none."""
    lines = [line[:72] for line in data.splitlines() if line[72:73] == b"G"]
    fields = _fields(b"".join(line.ljust(72) for line in lines)[:_LARGEST_HEADER])
    try:
        unit = _IGES_UNITS.get(int(fields[13] or b"1"))
        value = float(fields[18].replace(b"D", b"E").replace(b"d", b"e"))
    except (IndexError, ValueError):
        return ()
    return () if unit is None or not value > 0 else (value * unit,)


def _fields(text: bytes) -> list[bytes]:
    """The parameters of a global section, texts of counted length included."""
    delimiter, end, place, fields = b",", b";", 0, []
    while place < len(text):
        counted = re.compile(rb"\s*(\d+)H").match(text, place)
        if counted:
            stop = counted.end() + int(counted[1])
            fields.append(text[counted.end() : stop])
        else:
            stop = min((i for i in (text.find(delimiter, place), text.find(end, place)) if i >= 0), default=len(text))
            fields.append(text[place:stop].strip())
        if len(fields) == 1 and counted:
            delimiter = fields[0]
        if len(fields) == 2 and counted:
            end = fields[1]
        place = stop + 1
        if text[stop : stop + 1] == end:
            break
    return fields
