"""Faces on the kernel's analytic surfaces: from quadrics, and back."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gtcad.converters.bspline import Array
from gtcad.converters.occt.compat import as_edge, as_face, kernel_guard, kernel_module, point
from gtcad.converters.occt.geometry import untrimmed
from gtcad.converters.occt.pieces import fills, subshapes
from gtcad.converters.occt.topology import TOLERANCE, checked
from gtcad.converters.quadrics import FULL_TURN, Kind, Quadric
from gtcad.errors import InputError

_BRep = kernel_module("BRep")
_BRepBuilderAPI = kernel_module("BRepBuilderAPI")
_BRepTools = kernel_module("BRepTools").BRepTools
_Geom = kernel_module("Geom")
_gp = kernel_module("gp")
_TopAbs = kernel_module("TopAbs")

_KINDS: dict[str, Kind] = {
    "Geom_CylindricalSurface": "cylinder",
    "Geom_ConicalSurface": "cone",
    "Geom_SphericalSurface": "sphere",
    "Geom_ToroidalSurface": "torus",
}
_SAME = 1e-9  # relative: what a full turn or a right angle may be off
_POINT = 1e-14  # of the radius: the cosine of pi/2 as a double is 6e-17


# --- to the kernel ----------------------------------------------------------------------------------------------------


def make_quadric_face(q: Quadric, *, tolerance: float = TOLERANCE) -> Any:
    """A TopoDS_Face on the whole patch, with the patch's normal.

    A full turn gets one seam edge, the pole of a sphere and the apex of a cone one degenerate edge; a disc has none.

    Parameters
    ----------
    q
        In mm.
    tolerance
        In mm.

    Raises
    ------
    InputError
        When a side is shorter than the tolerance without being a point, or two opposite sides nearly meet.
    KernelError
        When the kernel's own check refuses the face.
    """
    _check_sides(q, tolerance)
    with kernel_guard("making a face"):
        q = _from_seam(q)
        face = _disc_face(q) if q.kind == "disc" else _rectangle_face(q, tolerance)
        return checked(face.Reversed() if q.reversed else face, "face")


def _check_sides(q: Quadric, tolerance: float) -> None:
    lengths = {"v": abs(q.v_range[1] - q.v_range[0]) * _speed_v(q)}
    if q.kind == "plane":
        lengths["u"] = abs(q.u_range[1] - q.u_range[0])
    else:
        turn, full_u = abs(q.u_range[1] - q.u_range[0]), q.full_turns[0]
        outs = q.meridian(q.v_range)[0].tolist()
        for end, out in zip(("v0", "v1"), outs, strict=True):
            if out > _POINT * max(q.radius, *outs):
                lengths[end] = out * turn
            if out > tolerance and not full_u:
                lengths[f"the gap of {end}"] = out * (FULL_TURN - turn)
    if q.kind == "torus" and not q.full_turns[1]:
        lengths["the gap of v"] = q.second * (FULL_TURN - abs(q.v_range[1] - q.v_range[0]))
    for name, length in lengths.items():
        if length <= tolerance:
            raise InputError(
                f"the sides of a {q.kind} must be longer than the tolerance of {tolerance:.3g} mm or a point, and must "
                f"not nearly meet: {name} is {length:.3g} mm"
            )


def _speed_v(q: Quadric) -> float:
    """Length in mm for each unit of v."""
    return {"sphere": q.radius, "torus": q.second}.get(q.kind, 1.0)


def _from_seam(q: Quadric) -> Quadric:
    """The same points with full turns from 0 to 2 pi: the kernel makes a seam there and nowhere else."""
    full_u, full_v = q.full_turns
    if full_u:
        start = min(q.u_range)
        x = math.cos(start) * q.x_direction + math.sin(start) * q.y_direction
        q = replace(q, x_direction=x, u_range=_from_zero(q.u_range))
    return replace(q, v_range=_from_zero(q.v_range)) if full_v else q


def _from_zero(ends: tuple[float, float]) -> tuple[float, float]:
    return (0.0, FULL_TURN) if ends[0] < ends[1] else (FULL_TURN, 0.0)


def _axes(q: Quadric) -> Any:
    return _gp.gp_Ax3(point(q.origin), _gp.gp_Dir(*q.axis.tolist()), _gp.gp_Dir(*q.x_direction.tolist()))


def _rectangle_face(q: Quadric, tolerance: float) -> Any:
    axes = _axes(q)
    match q.kind:
        case "plane":
            surface = _Geom.Geom_Plane(axes)
        case "cylinder":
            surface = _Geom.Geom_CylindricalSurface(axes, q.radius)
        case "cone":
            surface = _Geom.Geom_ConicalSurface(axes, q.second, q.radius)
        case "sphere":
            surface = _Geom.Geom_SphericalSurface(axes, q.radius)
        case _:
            surface = _Geom.Geom_ToroidalSurface(axes, q.radius, q.second)
    bounds = *sorted(q.u_range), *sorted(q.v_range)
    return _BRepBuilderAPI.BRepBuilderAPI_MakeFace(surface, *bounds, tolerance).Face()


def _disc_face(q: Quadric) -> Any:
    """A face of a plane between two arcs, or two circles, about one point; the inner one may be that point."""
    axes = _axes(q)
    inner, outer = sorted(q.v_range)
    start, end = sorted(q.u_range)
    full = q.full_turns[0]

    def arc(radius: float) -> Any:
        return _BRepBuilderAPI.BRepBuilderAPI_MakeEdge(_gp.gp_Circ(axes.Ax2(), radius), start, end).Edge()

    def line(u: float) -> Any:
        ends = (point(q.evaluate(u, v)) for v in (inner, outer))
        return _BRepBuilderAPI.BRepBuilderAPI_MakeEdge(*ends).Edge()

    wire = _BRepBuilderAPI.BRepBuilderAPI_MakeWire(arc(outer))
    if not full:
        wire.Add(line(end))
        if inner > 0:
            wire.Add(arc(inner))
        wire.Add(line(start))
    maker = _BRepBuilderAPI.BRepBuilderAPI_MakeFace(_Geom.Geom_Plane(axes), wire.Wire(), True)
    if full and inner > 0:
        hole = _BRepBuilderAPI.BRepBuilderAPI_MakeWire(arc(inner)).Wire()
        hole.Reverse()
        maker.Add(hole)
    return maker.Face()


# --- from the kernel --------------------------------------------------------------------------------------------------


def is_analytic(shape: Any) -> bool:
    """Whether a shape is one face, on an analytic surface."""
    if shape.ShapeType() != _TopAbs.TopAbs_FACE:
        return False
    surface = untrimmed(_BRep.BRep_Tool.Surface_s(as_face(shape)))
    return type(surface).__name__ in ("Geom_Plane", *_KINDS)


def quadric_of_face(face: Any) -> Quadric | None:
    """The quadric that a face is all of; None when its surface is of another kind, or trimmed otherwise.

    Its normal is that of the face's own surface, whichever way the face is oriented.
    """
    face = as_face(face)
    surface = untrimmed(_BRep.BRep_Tool.Surface_s(face))
    name = type(surface).__name__
    if name == "Geom_Plane":
        return _plane_of(face, surface.Position())
    bounds = _BRepTools.UVBounds_s(face)
    if name not in _KINDS or not fills(face, bounds):
        return None
    return _quadric_on(surface, _KINDS[name], bounds)


def _coordinates(of: Any) -> Array:
    return np.array([of.X(), of.Y(), of.Z()])


def _quadric_on(surface: Any, kind: Kind, bounds: tuple[float, float, float, float]) -> Quadric | None:
    u0, u1, v0, v1 = bounds
    u_range, v_range = _whole_turn(u0, u1), (v0, v1)
    radius, second = 0.0, 0.0
    if kind == "torus":
        v_range, radius, second = _whole_turn(v0, v1), surface.MajorRadius(), surface.MinorRadius()
        if radius <= second:
            return None
    elif kind == "cone":
        radius, second = surface.RefRadius(), surface.SemiAngle()
    else:
        radius = surface.Radius()
    if kind == "sphere":
        v_range = max(v0, -math.pi / 2), min(v1, math.pi / 2)
    axes = surface.Position()
    origin, axis = _coordinates(axes.Location()), _coordinates(axes.Direction())
    if not axes.Direct():
        u_range = -u_range[0], -u_range[1]
    if second < 0:  # seen from the other end: both v and the sense of u turn round
        axis, second = -axis, -second
        u_range, v_range = (-u_range[0], -u_range[1]), (-v_range[0], -v_range[1])
    return Quadric(kind, origin, axis, _coordinates(axes.XDirection()), radius, second, u_range, v_range)


def _whole_turn(first: float, last: float) -> tuple[float, float]:
    return (first, first + FULL_TURN) if abs(last - first - FULL_TURN) <= _SAME else (first, last)


def _plane_of(face: Any, axes: Any) -> Quadric | None:
    """The rectangle or the disc that a face of a plane is, by its edges."""
    normal = np.cross(_coordinates(axes.XDirection()), _coordinates(axes.YDirection()))
    sides, arcs = [], []
    for edge in subshapes(face, "EDGE"):
        curve = _BRep.BRep_Tool.Curve_s(as_edge(edge), 0.0, 0.0)
        if curve is None:
            return None
        curve, ends = untrimmed(curve), _BRep.BRep_Tool.Range_s(as_edge(edge))
        kind = type(curve).__name__
        if kind not in ("Geom_Line", "Geom_Circle"):
            return None
        if kind == "Geom_Line":
            sides.append(np.stack([_coordinates(curve.Value(t)) for t in ends]))
        else:
            arcs.append(_Arc.of(curve, ends, normal))
    return _disc(sides, arcs, normal) if arcs else _rectangle(sides, normal)


def _rectangle(sides: list[Array], normal: Array) -> Quadric | None:
    if len(sides) != 4:
        return None
    corner, next_one = sides[0]
    others = [side if _meet(side[0], corner) else side[::-1] for side in sides[1:]]
    a, b = next_one - corner, next((side[1] - corner for side in others if _meet(side[0], corner)), np.zeros(3))
    wanted = [(corner, a), (corner, b), (corner + a, b), (corner + b, a)]
    if not all(any(_is_side(side, start, way) for side in sides) for start, way in wanted):
        return None
    lengths = float(np.linalg.norm(a)), float(np.linalg.norm(b))
    if abs(a @ b) > _SAME * lengths[0] * lengths[1]:
        return None
    if np.cross(a, b) @ normal < 0:
        a, b, lengths = b, a, lengths[::-1]
    return Quadric("plane", corner, np.cross(a, b), a, 0.0, 0.0, (0.0, lengths[0]), (0.0, lengths[1]))


def _meet(a: Array, b: Array) -> bool:
    return bool(np.linalg.norm(a - b) <= TOLERANCE)


def _is_side(side: Array, start: Array, way: Array) -> bool:
    return any(_meet(ends[0], start) and _meet(ends[1], start + way) for ends in (side, side[::-1]))


@dataclass(frozen=True, eq=False)
class _Arc:
    """An arc about a center, counterclockwise seen against the normal of its plane."""

    center: Array
    radius: float
    start: Array  # unit vector from the center to the first point
    turn: float

    @staticmethod
    def of(circle: Any, ends: tuple[float, float], normal: Array) -> _Arc:
        axes = circle.Position()
        center, radius = _coordinates(axes.Location()), float(circle.Radius())
        first = ends[0] if _coordinates(axes.Direction()) @ normal > 0 else ends[1]
        start, turn = _coordinates(circle.Value(first)) - center, _whole_turn(0.0, ends[1] - ends[0])[1]
        return _Arc(center, radius, start / radius, turn)


def _disc(sides: list[Array], arcs: list[_Arc], normal: Array) -> Quadric | None:
    """A disc, a ring, or a sector of one: arcs of the same turn about one center, joined by radial sides."""
    outer = max(arcs, key=lambda arc: arc.radius)
    center, x = outer.center, outer.start
    inner = 0.0 if len(arcs) == 1 else min(arc.radius for arc in arcs)
    radii = outer.radius, inner  # in this order its normal is that of the plane
    q = Quadric("disc", center, normal, x, 0.0, 0.0, (0.0, outer.turn), radii)
    radial = [] if outer.turn == FULL_TURN else [q.evaluate(u, np.array(radii)) for u in q.u_range]
    if len(arcs) > 2 or outer.radius - inner <= TOLERANCE or len(sides) != len(radial):
        return None
    for arc in arcs:
        if not _meet(arc.center, center) or abs(arc.turn - outer.turn) * arc.radius > TOLERANCE:
            return None
        if radial and not _meet(arc.radius * arc.start, arc.radius * x):
            return None
    if not all(any(_is_side(side, one[0], one[1] - one[0]) for side in sides) for one in radial):
        return None
    return q
