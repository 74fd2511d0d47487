"""What a file states of its shapes, held against what it holds: whether it arrived as it was sent."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from gtcad.converters.estimates import nearest_of
from gtcad.converters.figures import figure_of_part
from gtcad.converters.part import Part, Properties

Quantity = Literal["area", "volume", "centre of gravity", "points"]
UNITS: dict[Quantity, str] = {"area": "mm^2", "volume": "mm^3", "centre of gravity": "mm", "points": "mm"}

_RELATIVE = 1e-5  # what the kernel's measures, and the digits of other writers, may be off
_CENTRE = 2.0  # of the tolerance: what a centre may move when every point moves by the tolerance
_BEND = 3.0  # of the tolerance by the root of the area: what an area may change


@dataclass(frozen=True)
class Statement:
    """One quantity that a file states of a shape, and what the file holds.

    Attributes
    ----------
    name
        Of the shape.
    quantity
        "area", "volume", "centre of gravity" or "points".
    stated, found
        Numbers, in mm, mm^2 or mm^3; of a centre the distance, of points the largest distance, is found, and 0 stated.
        None is found when the file holds nothing of the kind, such as a volume without a solid.
    limit
        The largest difference that is taken for the same.
    """

    name: str
    quantity: Quantity
    stated: float
    found: float | None
    limit: float

    @property
    def unit(self) -> str:
        """Of the numbers."""
        return UNITS[self.quantity]

    @property
    def kept(self) -> bool:
        """Whether the file holds what it states."""
        return self.found is not None and abs(self.found - self.stated) <= self.limit


def check_statements(parts: Sequence[Part], tolerance: float) -> tuple[Statement, ...]:
    """Hold what a file states of its shapes against the shapes.

    Parameters
    ----------
    parts
        As read.
    tolerance
        In mm, above 0: how far the shapes may be from those that the statements were made for. Areas may differ by
        three times the tolerance and the root of the area for each root of a face, volumes by the tolerance and the
        area, centres by twice the tolerance, points by the tolerance; and all by 1e-5 of their size.

    Returns
    -------
    tuple
        In the order of the file; nothing of a shape without statements.

    Notes
    -----
    Areas, volumes and centres are the kernel's, distances of points are searched for: none of it proves anything.
    """
    shapes: dict[int, list[Part]] = {}
    for part in parts:
        if part.properties is not None and part.properties.measured is not None:
            shapes.setdefault(id(part.properties), []).append(part)
    return tuple(statement for own in shapes.values() for statement in _statements(own, tolerance))


def _statements(parts: Sequence[Part], tolerance: float) -> Iterator[Statement]:
    stated = parts[0].properties
    assert stated is not None
    assert stated.measured is not None
    name, found = stated.name, stated.measured()
    size = math.sqrt(found.area)
    if stated.area is not None:
        limit = _BEND * tolerance * size * math.sqrt(len(parts)) + _RELATIVE * found.area
        yield Statement(name, "area", stated.area, found.area, limit)
    if stated.volume is not None:
        limit = tolerance * found.area + _RELATIVE * abs(stated.volume)
        yield Statement(name, "volume", stated.volume, found.volume, limit)
    if stated.centroid is not None:
        centre = found.volume_centroid if stated.volume is not None else found.centroid
        distance = None if centre is None else math.dist(centre, stated.centroid)
        yield Statement(name, "centre of gravity", 0.0, distance, _CENTRE * tolerance + _RELATIVE * size)
    if len(stated.points):
        yield Statement(name, "points", 0.0, _farthest(parts, stated, tolerance), tolerance + _RELATIVE * size * 1e-3)


def _farthest(parts: Sequence[Part], stated: Properties, tolerance: float) -> float:
    figures = [figure_of_part(part) for part in parts]
    faces = [figure for figure in figures if figure.variables == 2]
    return float(np.max(nearest_of(faces, stated.points, tolerance / 4).distances)) if faces else math.inf
