"""The values of command-line options: judged before any file is opened."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import Literal

from gtcad._documents import SUFFIXES

FORMATS = {".step": "STEP", ".stp": "STEP", ".igs": "IGES", ".iges": "IGES", ".brep": "BREP"}
MESHES = {".stl": "STL", ".glb": "GLB", ".3mf": "3MF"}
REPORTS = (".html", ".pdf", ".png")
Schema = Literal["AP242", "AP214", "AP203"]
SCHEMAS: tuple[Schema, ...] = ("AP242", "AP214", "AP203")
MILLIMETRES = {"": 1.0, "mm": 1.0, "um": 1e-3, "nm": 1e-6, "cm": 10.0, "m": 1e3, "in": 25.4, "ft": 304.8}
DURATIONS = {"": 1.0, "s": 1.0, "min": 60.0, "h": 3600.0}
SIZES = {"": 1.0, "kb": 1 << 10, "mb": 1 << 20, "gb": 1 << 30}
FOR_SPLINES = {
    "degree": "--degree",
    "max_degree": "--max-degree",
    "continuity": "--continuity",
    "end_order": "--end-order",
    "no_exact": "--no-exact",
    "schema": "--schema",
    "timestamp": "--timestamp",
    "certificate": "--certificate",
}
DRAWINGS = {".dxf": "DXF", ".svg": "SVG"}
MOST_BEND_LINES = 1000
DEGREES = (3, 25)
END_ORDERS = (0, 3)
MOST_TWIST = 45.0

_LENGTH = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?)\s*([a-z]*)", re.IGNORECASE)


class Refused(ValueError):
    """A value that an option does not take; the message says what it takes."""


def length(text: str) -> float:
    """A positive length in mm from a text such as "1e-4", "1e-4in" or "0.1 um"."""
    match = _LENGTH.fullmatch(text.strip())
    unit = match[2].lower() if match else ""
    if match is None or unit not in MILLIMETRES:
        units = ", ".join(filter(None, MILLIMETRES))
        raise Refused(f"must be a length in mm or with a unit ({units}), such as 1e-4 or 1e-5in, got {text!r}")
    value = float(match[1]) * MILLIMETRES[unit]
    if not 0 < value < math.inf:
        raise Refused(f"must be positive and finite, got {text!r}")
    return value


def whole_number(text: str, least: int, most: int) -> int:
    """A whole number from least to most."""
    if not re.fullmatch(r"[-+]?[0-9]{1,9}", text) or not least <= int(text) <= most:
        raise Refused(f"must be a whole number from {least} to {most}, got {text!r}")
    return int(text)


def degree(text: str) -> int | str:
    """A degree of a spline, or "auto"."""
    try:
        return text if text == "auto" else degree_number(text)
    except Refused as error:
        raise Refused(str(error).replace(", got", ", or auto, got")) from None


def degree_number(text: str) -> int:
    """A degree of a spline."""
    return whole_number(text, *DEGREES)


def end_order(text: str) -> int:
    """How many derivatives are exact at the ends."""
    return whole_number(text, *END_ORDERS)


def schema(text: str) -> Schema:
    """The name of a STEP schema, in upper case."""
    for name in SCHEMAS:
        if text.upper() == name:
            return name
    raise Refused(f"must be one of {', '.join(SCHEMAS)}, got {text!r}")


def timestamp(text: str) -> datetime:
    """A time in ISO 8601, such as 2024-05-31T12:00:00."""
    try:
        return datetime.fromisoformat(text)
    except ValueError:
        raise Refused(f"must be a time such as 2024-05-31T12:00:00, got {text!r}") from None


def seconds(text: str) -> float | None:
    """A positive time in seconds from a text such as "90", "90s", "10min" or "2h"; None for "off"."""
    return _measure(text, DURATIONS, "a time such as 90, 10min or 2h")


def size(text: str) -> int | None:
    """A positive size in bytes from a text such as "512MB" or "8GB"; None for "off"."""
    value = _measure(text, SIZES, "a size such as 2000MB or 8GB")
    return None if value is None else int(value)


def _measure(text: str, units: Mapping[str, float], wanted: str) -> float | None:
    if text.strip().lower() == "off":
        return None
    match = _LENGTH.fullmatch(text.strip())
    unit = units.get(match[2].lower()) if match else None
    if match is None or unit is None:
        raise Refused(f"must be {wanted}, or off, got {text!r}")
    value = float(match[1]) * unit
    if not 0 < value < math.inf:
        raise Refused(f"must be positive and finite, or off, got {text!r}")
    return value


def report_path(path: str) -> str:
    """The name of a report."""
    if Path(path).suffix.lower() not in REPORTS:
        raise Refused(f"must end in one of {', '.join(REPORTS)}, got {path!r}")
    return path


def exchange_format(path: str) -> str:
    """STEP, IGES or BREP, by the suffix of the file's name."""
    suffix = Path(path).suffix.lower()
    if suffix not in FORMATS:
        raise Refused(f"must end in one of {', '.join(FORMATS)}, got {path!r}")
    return FORMATS[suffix]


def export_format(path: str) -> str:
    """STEP, IGES, BREP, or STL, GLB and 3MF for meshes, by the suffix of the file's name."""
    suffix = Path(path).suffix.lower()
    if suffix in MESHES:
        return MESHES[suffix]
    if suffix not in FORMATS:
        raise Refused(f"must end in one of {', '.join((*FORMATS, *MESHES))}, got {path!r}")
    return FORMATS[suffix]


def drawing_format(path: str) -> str:
    """DXF or SVG, by the suffix of the file's name."""
    suffix = Path(path).suffix.lower()
    if suffix not in DRAWINGS:
        raise Refused(f"must end in one of {', '.join(DRAWINGS)}, got {path!r}")
    return DRAWINGS[suffix]


def twist(text: str) -> float:
    """An angle of twist in degrees, from 0 to 45."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0 <= value <= MOST_TWIST:
        raise Refused(f"must be an angle in degrees from 0 to {MOST_TWIST:g}, got {text!r}")
    return value


def model_path(path: str) -> str:
    """The name of a model file."""
    if Path(path).suffix.lower() not in SUFFIXES:
        raise Refused(f"must be a model, ending in {' or '.join(SUFFIXES)}, got {path!r}")
    return path


def list_path(path: str) -> str:
    """The name of a list of files."""
    if Path(path).suffix.lower() not in SUFFIXES:
        raise Refused(f"must be a list of checks, ending in {' or '.join(SUFFIXES)}, got {path!r}")
    return path


def scheduler(address: str) -> str:
    """The address of a dask scheduler: ``tcp://host:8786``, or without the protocol."""
    if not re.fullmatch(r"(?:[a-z]+://)?[^\s/]+:[0-9]{1,5}", address):
        raise Refused(f"must be the address of a scheduler, such as tcp://host:8786, got {address!r}")
    return address


def is_model(path: str) -> bool:
    """Whether a file is a model, by the suffix of its name."""
    return Path(path).suffix.lower() in SUFFIXES


def any_format(path: str) -> str:
    """MODEL, STEP, IGES or BREP, by the suffix of the file's name."""
    suffix = Path(path).suffix.lower()
    if suffix in SUFFIXES:
        return "MODEL"
    if suffix not in FORMATS:
        raise Refused(f"must end in one of {', '.join((*SUFFIXES, *FORMATS))}, got {path!r}")
    return FORMATS[suffix]
