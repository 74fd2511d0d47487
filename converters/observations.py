"""What a check sees of the elements of a file, before it is held against a limit, and what they are called."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from gtcad.converters.bspline import Array

if TYPE_CHECKING:
    from gtcad.converters.occt.inspection import Inspection

Point = tuple[float, float, float]


@dataclass(frozen=True)
class Seen:
    """A value of an element, before it is held against a limit; without a number, whether it is bad."""

    name: str
    element: str
    value: float | None = None
    point: Point | None = None
    remark: str = ""
    bad: bool = False


def face_name(inspection: Inspection, number: int) -> str:
    """A face in words: its number, from 1, and its name if it has one."""
    name = inspection.faces[number].name
    return f"face {number + 1}" + (f" {name!r}" if name else "")


def edge_name(inspection: Inspection, number: int) -> str:
    """An edge in words: its number and its faces, or the curve's name."""
    edge = inspection.edges[number]
    if edge.alone:
        return f"curve {number + 1}" + (f" {edge.name!r}" if edge.name else "")
    faces = dict.fromkeys(face_name(inspection, use.face) for use in edge.uses)
    return f"edge {number + 1}" + (f" of {', '.join(faces)}" if faces else "")


def place_of(points: Array, index: int) -> Point:
    """A row of points."""
    x, y, z = points[index].tolist()
    return x, y, z
