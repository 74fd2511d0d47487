"""Plane faces on the free edges of a shell."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gtcad.converters.bspline import Array
from gtcad.converters.occt.compat import kernel_guard, kernel_module, point
from gtcad.converters.occt.pieces import ShapeKey
from gtcad.converters.occt.shells import FreeEdge, Shell, named_side, shell_of
from gtcad.converters.occt.topology import TOLERANCE, checked
from gtcad.errors import InputError

_BRep = kernel_module("BRep")
_Geom = kernel_module("Geom")
_gp = kernel_module("gp")
_TopExp = kernel_module("TopExp").TopExp
_TopoDS = kernel_module("TopoDS")

_STEPS = 32  # points of each knot span for the sign of an area and for what lies inside
_PARALLEL = 1e-6  # sine of the angle between planes that may be one


@dataclass(frozen=True, eq=False)
class Cap:
    """A plane face that closes one loop of free edges.

    Attributes
    ----------
    face
        The kernel's, oriented as in the shell.
    loop
        The free edges, in the direction in which their own faces use them.
    centre, normal
        Of the plane; the unit normal goes out of the shell like those of its other faces. Each of shape (3,).
    flatness
        Largest distance of a control point of the loop from the plane, in mm.
    """

    face: Any
    loop: tuple[FreeEdge, ...]
    centre: Array
    normal: Array
    flatness: float


def planar_caps(shell: Shell, *, flatness: float, tolerance: float = TOLERANCE) -> tuple[Cap, ...]:
    """A plane face for each loop of free edges, on these edges themselves.

    Parameters
    ----------
    shell
        A loop must not cross itself: that is not tested.
    flatness
        How far the edges may leave their plane, in mm. The tolerance of edges that do is raised to what they do.
    tolerance
        Of the faces, in mm.

    Raises
    ------
    InputError
        When no edge is free, loops touch each other or lie within each other in one plane, or a loop is not plane or
        encloses nothing.
    KernelError
        When the kernel's own check refuses a face.
    """
    if not shell.free:
        raise InputError("the shell is closed: there is nothing to cap")
    with kernel_guard("making planar caps"):
        caps = tuple(_cap(loop, flatness, tolerance) for loop in _loops(shell.free))
        for one, other in itertools.permutations(caps, 2):
            if _within(one, other, max(flatness, tolerance)):
                raise InputError(
                    f"the loops at {_listed(one.loop)} and at {_listed(other.loop)} lie in one plane, one inside the "
                    "other: close the gap between them with patches"
                )
        return caps


def capped(shell: Shell, caps: Sequence[Cap]) -> Shell:
    """The shell with the caps among its faces.

    Raises
    ------
    KernelError
        When the kernel's own check refuses it.
    """
    with kernel_guard("capping a shell"):
        used = {(edge.patch, edge.side) for cap in caps for edge in cap.loop}
        free = [edge for edge in shell.free if (edge.patch, edge.side) not in used]
        return shell_of([*shell.faces, *(cap.face for cap in caps)], free)


def _loops(free: Sequence[FreeEdge]) -> Iterator[tuple[FreeEdge, ...]]:
    """The free edges end to end; as many begin as end at a vertex, since the faces agree in their orientation."""
    following: dict[ShapeKey, FreeEdge] = {}
    for edge in free:
        start = ShapeKey(_TopExp.FirstVertex_s(edge.edge, True))
        if start in following:
            raise InputError(f"{_listed([following[start], edge])} begin at one corner: the loops there are not clear")
        following[start] = edge
    while following:
        start = next(iter(following))
        loop = [following.pop(start)]
        while (end := ShapeKey(_TopExp.LastVertex_s(loop[-1].edge, True))) != start:
            loop.append(following.pop(end))
        yield tuple(loop)


def _listed(loop: Iterable[FreeEdge]) -> str:
    return ", ".join(named_side((edge.patch, edge.side)) for edge in loop)


def _cap(loop: tuple[FreeEdge, ...], flatness: float, tolerance: float) -> Cap:
    poles = np.concatenate([edge.curve.control_points for edge in loop])
    centre = poles.mean(axis=0)
    normal = np.linalg.svd(poles - centre)[2][-1]
    off_plane = float(np.abs((poles - centre) @ normal).max())
    if off_plane > max(flatness, tolerance):
        raise InputError(
            f"the loop at {_listed(loop)} is not plane: it lies up to {off_plane:.3g} mm off the best plane, "
            f"more than {max(flatness, tolerance):.3g} mm"
        )
    polygon = _polygon(loop)[::-1] - centre  # a cap uses its edges the other way round
    enclosed = float(np.cross(polygon, np.roll(polygon, -1, axis=0)).sum(axis=0) @ normal) / 2
    if abs(enclosed) <= tolerance * float(np.linalg.norm(polygon, axis=1).max()):
        raise InputError(f"the loop at {_listed(loop)} encloses no area")
    normal = np.copysign(1.0, enclosed) * normal
    face = _plane_face(loop, centre, normal, tolerance)
    if off_plane > tolerance:
        _loosen(loop, 1.01 * off_plane)
    return Cap(checked(face, "cap"), loop, centre, normal, off_plane)


def _plane_face(loop: Sequence[FreeEdge], centre: Array, normal: Array, tolerance: float) -> Any:
    builder, face, wire = _BRep.BRep_Builder(), _TopoDS.TopoDS_Face(), _TopoDS.TopoDS_Wire()
    plane = _Geom.Geom_Plane(point(centre), _gp.gp_Dir(*normal.tolist()))
    builder.MakeFace(face, plane, tolerance)
    builder.MakeWire(wire)
    for edge in reversed(loop):
        builder.Add(wire, edge.edge.Reversed())
    wire.Closed(True)
    builder.Add(face, wire)
    return face


def _loosen(loop: Sequence[FreeEdge], tolerance: float) -> None:
    builder = _BRep.BRep_Builder()
    for edge in loop:
        builder.UpdateEdge(edge.edge, tolerance)
        for end in (_TopExp.FirstVertex_s, _TopExp.LastVertex_s):
            builder.UpdateVertex(end(edge.edge), tolerance)


def _polygon(loop: Sequence[FreeEdge]) -> Array:
    """Points along the edges, in the direction in which their own faces use them."""
    parts = []
    for edge in loop:
        knots = edge.curve.knots
        t = np.linspace(knots[:-1], knots[1:], _STEPS, endpoint=False, axis=1).reshape(-1)
        points = edge.curve.evaluate(t if edge.ahead else knots[0] + knots[-1] - t)
        parts.append(points)
    return np.concatenate(parts)


def _within(inner: Cap, outer: Cap, flatness: float) -> bool:
    """Whether a loop lies in the plane of another one and begins inside it."""
    place = _polygon(inner.loop)[0] - outer.centre
    if abs(place @ outer.normal) > flatness or np.linalg.norm(np.cross(inner.normal, outer.normal)) > _PARALLEL:
        return False
    across = np.linalg.svd(outer.normal[None, :])[2][1:]
    x, y = across @ (_polygon(outer.loop) - outer.centre - place).T
    next_x, next_y = np.roll(x, -1), np.roll(y, -1)
    turns = np.arctan2(x * next_y - y * next_x, x * next_x + y * next_y).sum()
    return bool(abs(turns) > np.pi)
