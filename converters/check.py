"""What an exchange file holds, held against a model."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import takewhile

import numpy as np
from numpy.typing import NDArray

from gtcad._entries import ModelShape
from gtcad.composite import Composite
from gtcad.converters.bspline import BSplineSurface
from gtcad.converters.chain_check import Joint, check_chain
from gtcad.converters.part import MEETING, Built, Part, Wire, ends_of
from gtcad.converters.quadrics import Quadric
from gtcad.converters.quilt_check import check_quilt
from gtcad.converters.verdicts import Row, compared, joined
from gtcad.errors import InputError
from gtcad.protocol import SeparableSurface, Shape
from gtcad.quilt import Quilt
from gtcad.solid import Solid

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Report:
    """What was found.

    Attributes
    ----------
    rows
        In the order of the model: one for each shape, and for each piece of a chain.
    extra
        The names of parts that no shape claims.
    joints
        Of the chains, in order.
    """

    rows: tuple[Row, ...]
    extra: tuple[str, ...]
    joints: tuple[Joint, ...] = ()


def check_parts(parts: Sequence[Part], shapes: Mapping[str, ModelShape], tolerance: float) -> Report:
    """Hold the parts of a file against the shapes of a model.

    Parameters
    ----------
    parts
        As read from the file, in mm.
    shapes
        By name, in mm.
    tolerance
        In mm, above 0.

    Returns
    -------
    Report
        Shapes are matched by name; those left over by position among the parts left over, faces and edges apart. A
        chain claims all edges of its name, or the next ones that meet.
    """
    if not tolerance > 0:
        raise InputError(f"tolerance must be above 0, got {tolerance}")
    matches = _matched(parts, shapes)
    rows: list[Row] = []
    joints: list[Joint] = []
    claimed: set[int] = set()
    for name, shape in shapes.items():
        found = matches.get(name, [])
        if isinstance(shape, Composite):
            pieces, between, left = check_chain(name, _in_space(shape), found, tolerance)
            joints += between
        elif isinstance(shape, Quilt | Solid):
            pieces, between = check_quilt(name, shape, found, tolerance)
            joints += between
            left = []
        else:
            pieces, left = [_row(name, shape, found[0] if found else None, tolerance)], []
        claimed |= {id(part) for part in found} - {id(part) for part in left}
        by_name = all(part.name == name or part.name.startswith(f"{name}.") for part in found)
        rows += (
            pieces if by_name else [replace(row, remark=joined("matched by position", row.remark)) for row in pieces]
        )
    extra = tuple(part.name or f"no. {k + 1}" for k, part in enumerate(parts) if id(part) not in claimed)
    return Report(tuple(rows), extra, tuple(joints))


def _matched(parts: Sequence[Part], shapes: Mapping[str, ModelShape]) -> dict[str, list[Part]]:
    """By name first; a name that several parts bear is all a chain's, and else the first one's."""
    matches: dict[str, list[Part]] = {}
    owners = _owners(shapes)
    for part in parts:
        name = part.name if part.name in shapes else owners(part.name)
        if name and (name not in matches or isinstance(shapes[name], Composite | Quilt | Solid)):
            matches.setdefault(name, []).append(part)
    claimed = {id(part) for found in matches.values() for part in found}
    for surfaces in (False, True):
        left = [part for part in parts if id(part) not in claimed and _is_surface(part) == surfaces]
        for name, shape in shapes.items():
            is_surface = isinstance(shape, SeparableSurface | Quilt | Solid)
            if name not in matches and left and is_surface == surfaces:
                count = _face_count(left) if isinstance(shape, Quilt | Solid) else 1
                count = _edge_count(left, shape) if isinstance(shape, Composite) else count
                matches[name], left = left[:count], left[count:]
    return matches


def _owners(shapes: Mapping[str, ModelShape]) -> Callable[[str], str]:
    """From the name of a face to the body that it belongs to: by its patches, or else the longest name before a dot."""
    bodies = {
        name: shape.quilt if isinstance(shape, Solid) else shape
        for name, shape in shapes.items()
        if isinstance(shape, Quilt | Solid)
    }
    patches = {f"{name}.{patch}": name for name, quilt in bodies.items() for patch in quilt.names}
    longest = sorted(bodies, key=len, reverse=True)

    def owner(face: str) -> str:
        return patches.get(face) or next((name for name in longest if face.startswith(f"{name}.")), "")

    return owner


def _face_count(parts: Sequence[Part]) -> int:
    """How many of the faces, from the first on, are of one body."""
    body = parts[0].body
    return 1 if body is None else sum(1 for _ in takewhile(lambda part: part.body is body, parts))


def _edge_count(parts: Sequence[Part], chain: Composite) -> int:
    """How many of the edges, from the first on, may be a chain's: those that meet, up to where the chain ends."""
    meeting = 1
    while meeting < min(len(chain.pieces), len(parts)) and _gap(parts[meeting - 1], parts[meeting]) <= MEETING:
        meeting += 1
    end = _in_space(chain).evaluate(chain.domain[1])
    gaps = [np.linalg.norm(_ends(part)[1] - end) for part in parts[:meeting]]
    return 1 + int(np.round(gaps, 6).argmin())


def _gap(a: Part, b: Part) -> float:
    return float(np.linalg.norm(_ends(a)[1] - _ends(b)[0]))


def _ends(part: Part) -> Array:
    assert not isinstance(part.geometry, BSplineSurface | Quadric | Wire | Built)
    return ends_of(part.geometry)


def _is_surface(part: Part) -> bool:
    return isinstance(part.geometry, BSplineSurface | Quadric)


def _in_space(shape: Composite) -> Composite:
    return shape if shape.dimension == 3 else shape.transformed(np.eye(3, 2))


def _row(name: str, shape: Shape, part: Part | None, tolerance: float) -> Row:
    if part is None:
        return Row(name, "missing")
    if isinstance(shape, SeparableSurface) != _is_surface(part):
        found, wanted = ("a face", "an edge") if _is_surface(part) else ("an edge", "a face")
        return Row(name, "missing", remark=f"the file holds {found} of this name, not {wanted}")
    if not part.valid:
        return Row(name, "invalid", remark="the kernel calls it invalid")
    spatial = isinstance(shape, SeparableSurface) or shape.dimension == 3
    return compared(name, shape if spatial else shape.transformed(np.eye(3, 2)), part, tolerance)
