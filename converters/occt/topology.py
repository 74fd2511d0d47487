"""Edges and faces of the kernel, built side by side from the spline's own boundary poles."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from gtcad.converters.bspline import Array, BSplineCurve, BSplineSurface
from gtcad.converters.occt.compat import (
    as_edge,
    as_face,
    check_complaints,
    kernel_guard,
    kernel_module,
    point,
)
from gtcad.converters.occt.geometry import (
    Bounds,
    exact_curve,
    exact_surface,
    to_geom_conic,
    to_geom_curve,
    to_geom_surface,
)
from gtcad.converters.part import EllipseArc
from gtcad.errors import InputError, KernelError

_gp = kernel_module("gp")
_BRep = kernel_module("BRep")
_BRepAdaptor = kernel_module("BRepAdaptor")
_BRepCheck = kernel_module("BRepCheck")
_BRepTools = kernel_module("BRepTools").BRepTools
_Geom2d = kernel_module("Geom2d")
_Geom2dConvert = kernel_module("Geom2dConvert").Geom2dConvert
_TopAbs = kernel_module("TopAbs")
_TopExp = kernel_module("TopExp")
_TopoDS = kernel_module("TopoDS")

TOLERANCE = 1e-7
"""Tolerance of vertices, edges and faces in mm: the kernel's own Precision::Confusion."""

Side = Literal["u0", "u1", "v0", "v1"]
_AROUND: tuple[Side, ...] = ("v0", "u1", "v1", "u0")  # counter-clockwise in the parameter plane
_AGAINST: tuple[Side, ...] = ("v1", "u0")  # these two are walked against their parameter
_OPPOSITE: tuple[tuple[Side, Side], ...] = (("u0", "u1"), ("v0", "v1"))
_ENDS: dict[Side, tuple[tuple[int, int], tuple[int, int]]] = {
    "u0": ((0, 0), (0, 1)),
    "u1": ((1, 0), (1, 1)),
    "v0": ((0, 0), (1, 0)),
    "v1": ((0, 1), (1, 1)),
}


def make_edge(curve: BSplineCurve | EllipseArc, *, tolerance: float = TOLERANCE) -> Any:
    """A TopoDS_Edge on the whole curve.

    A curve whose ends are at most `tolerance` apart becomes a closed edge with one vertex.

    Parameters
    ----------
    curve
        In mm; plane curves get z = 0.
    tolerance
        In mm.

    Raises
    ------
    InputError
        When the curve is not longer than the tolerance or its knots are too close for the kernel.
    KernelError
        When the kernel's own check refuses the edge.
    """
    with kernel_guard("making an edge"):
        if isinstance(curve, EllipseArc):
            geometry, first, last = to_geom_conic(curve)
            ends = curve.evaluate(np.array([curve.start, curve.end]))
            extent = float(np.linalg.norm(curve.axis_a) + np.linalg.norm(curve.axis_b)) * (last - first)
        else:
            geometry, first, last = to_geom_curve(curve), float(curve.knots[0]), float(curve.knots[-1])
            ends = curve.control_points[[0, -1]]
            extent = _extent(curve.control_points)
        if extent <= tolerance:
            raise InputError(f"the curve must be longer than the tolerance of {tolerance:.3g} mm, got {extent:.3g} mm")
        closed = np.linalg.norm(ends[1] - ends[0]) <= tolerance
        start = _vertex(ends[0], tolerance)
        end = start if closed else _vertex(ends[1], tolerance)
        return _checked(_edge(geometry, start, end, (first, last), tolerance), "edge")


def make_face(surface: BSplineSurface, *, tolerance: float = TOLERANCE) -> Any:
    """A TopoDS_Face on the whole surface.

    Each edge carries the surface's own boundary poles, bit for bit, and a straight parameter curve. A side whose poles
    are exactly equal becomes a degenerate edge; two opposite sides that are exactly equal become one seam edge.

    Parameters
    ----------
    surface
        In mm; plane patches get z = 0.
    tolerance
        In mm.

    Raises
    ------
    InputError
        When a side is shorter than the tolerance without being a point, two opposite sides nearly meet without
        being equal, or the knots are too close for the kernel.
    KernelError
        When the kernel's own check refuses the face.
    """
    with kernel_guard("making a face"):
        outline = _outline(surface, tolerance)
        vertices = _corner_vertices(surface, tolerance)
        edges = {side: _side_edge(outline, side, vertices, tolerance) for side in outline.needed}
        return face_on(outline, edges, tolerance)


# --- the outline of a patch ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Outline:
    """How the four sides of a patch lie in space.

    Parameters
    ----------
    surface
        The patch.
    curves
        The boundary curves, each running with its parameter.
    points
        The sides that are one point.
    seams
        For each side that coincides with the opposite one, the side whose edge both use.
    """

    surface: BSplineSurface
    curves: dict[Side, BSplineCurve]
    points: frozenset[Side]
    seams: dict[Side, Side]

    @property
    def needed(self) -> tuple[Side, ...]:
        """The sides that need an edge of their own."""
        return tuple(side for side in _AROUND if self.seams.get(side, side) == side)


def _outline(surface: BSplineSurface, tolerance: float) -> Outline:
    points = surface.control_points
    if (points == points[:1]).all() or (points == points[:, :1]).all():
        raise InputError("the surface is only a curve: all its rows or all its columns of control points are equal")
    curves = {side: surface.boundary(side) for side in _AROUND}
    collapsed = frozenset(side for side in _AROUND if _is_point(curves[side], side, tolerance))
    seams: dict[Side, Side] = {}
    for first, second in _OPPOSITE:
        if first not in collapsed and second not in collapsed and _coincide(curves, first, second, tolerance):
            seams |= {first: first, second: first}
    return Outline(surface, curves, collapsed, seams)


def _is_point(curve: BSplineCurve, side: Side, tolerance: float) -> bool:
    extent = _extent(curve.control_points)
    if 0 < extent <= tolerance:
        raise InputError(
            f"side {side} is {extent:.3g} mm long, less than the tolerance of {tolerance:.3g} mm: "
            "give all its control points the same coordinates, then it is a point"
        )
    return extent == 0


def _coincide(curves: Mapping[Side, BSplineCurve], first: Side, second: Side, tolerance: float) -> bool:
    a, b = curves[first], curves[second]
    gap = float(np.linalg.norm(a.control_points - b.control_points, axis=-1).max())
    same_weights = a.weights is None or b.weights is None or np.array_equal(a.weights, b.weights)
    if 0 < gap <= tolerance and same_weights:
        raise InputError(
            f"sides {first} and {second} are {gap:.3g} mm apart, less than the tolerance of {tolerance:.3g} mm: "
            "give them the same control points, then the patch is closed"
        )
    return gap == 0 and same_weights


def _extent(points: Array) -> float:
    """Distance from the first control point to the farthest one: the curve lies within it."""
    return float(np.linalg.norm(points - points[0], axis=-1).max())


# --- vertices, edges, wires ---------------------------------------------------------------------------------------


def _vertex(position: Array, tolerance: float) -> Any:
    vertex = _TopoDS.TopoDS_Vertex()
    _BRep.BRep_Builder().MakeVertex(vertex, point(position), tolerance)
    return vertex


def _corner_vertices(surface: BSplineSurface, tolerance: float) -> dict[tuple[int, int], Any]:
    """A vertex for each corner; corners at the same place share one."""
    by_place: dict[tuple[float, ...], Any] = {}
    vertices = {}
    for corner in ((0, 0), (1, 0), (1, 1), (0, 1)):
        position = surface.control_points[-corner[0], -corner[1]]
        place = tuple((position + 0.0).tolist())  # + 0.0: minus zero is the same place
        if place not in by_place:
            by_place[place] = _vertex(position, tolerance)
        vertices[corner] = by_place[place]
    return vertices


def _side_edge(outline: Outline, side: Side, vertices: Mapping[tuple[int, int], Any], tolerance: float) -> Any:
    curve = outline.curves[side]
    start, end = (vertices[corner] for corner in _ENDS[side])
    geometry = None if side in outline.points else to_geom_curve(curve)
    return _edge(geometry, start, end, (float(curve.knots[0]), float(curve.knots[-1])), tolerance)


def _edge(geometry: Any, start: Any, end: Any, parameters: tuple[float, float], tolerance: float) -> Any:
    """An edge from start to end, forward on its curve; degenerate without one."""
    builder = _BRep.BRep_Builder()
    edge = _TopoDS.TopoDS_Edge()
    if geometry is None:
        builder.MakeEdge(edge)
        builder.Degenerated(edge, True)
    else:
        builder.MakeEdge(edge, geometry, tolerance)
    builder.Add(edge, start.Oriented(_TopAbs.TopAbs_FORWARD))
    builder.Add(edge, end.Oriented(_TopAbs.TopAbs_REVERSED))
    builder.Range(edge, *parameters)
    edge.Closed(start.IsSame(end))
    return edge


def _side_line(surface: BSplineSurface, side: Side) -> Any:
    """The straight parameter curve of a side, with the side's own parameter."""
    knots = surface.knots_u if side[0] == "u" else surface.knots_v
    fixed = float(knots[0 if side[1] == "0" else -1])
    if side[0] == "u":
        return _Geom2d.Geom2d_Line(_gp.gp_Pnt2d(fixed, 0.0), _gp.gp_Dir2d(0.0, 1.0))
    return _Geom2d.Geom2d_Line(_gp.gp_Pnt2d(0.0, fixed), _gp.gp_Dir2d(1.0, 0.0))


def face_on(outline: Outline, edges: Mapping[Side, Any], tolerance: float) -> Any:
    """The face of a surface whose edges exist already, so that neighbours can share them.

    Parameters
    ----------
    outline
        The surface, all of which becomes the face, and its sides.
    edges
        For each side of `outline.needed` a forward edge that runs along it with the same parameter.
    tolerance
        In mm.
    """
    builder = _BRep.BRep_Builder()
    face = _TopoDS.TopoDS_Face()
    builder.MakeFace(face, to_geom_surface(outline.surface), tolerance)
    wire = _TopoDS.TopoDS_Wire()
    builder.MakeWire(wire)
    for side in _AROUND:
        edge = edges[outline.seams.get(side, side)]
        orientation = _TopAbs.TopAbs_REVERSED if side in _AGAINST else _TopAbs.TopAbs_FORWARD
        builder.Add(wire, edge.Oriented(orientation))
    for side in outline.needed:
        _lay_on_face(outline, side, edges[side], face, tolerance)
    wire.Closed(True)
    builder.Add(face, wire)
    builder.NaturalRestriction(face, True)
    return _checked(face, "face")


def _lay_on_face(outline: Outline, side: Side, edge: Any, face: Any, tolerance: float) -> None:
    lines = [_side_line(outline.surface, other) for other in _AROUND if outline.seams.get(other, other) == side]
    # _AROUND lists v0 before v1 and u1 before u0: the one walked forward first, as the kernel wants a seam's pair
    builder = _BRep.BRep_Builder()
    builder.UpdateEdge(edge, *lines, face, tolerance)
    curve = outline.curves[side]
    builder.Range(edge, face, float(curve.knots[0]), float(curve.knots[-1]))


# --- reading ------------------------------------------------------------------------------------------------------


def face_geometry(face: Any) -> tuple[BSplineSurface, str, bool]:
    """The surface of a face as a B-spline, its kind in the words of Part 21, and whether the face is less than it.

    Raises
    ------
    KernelError
        When the surface is unbounded or has no exact rational form.
    """
    face = as_face(face)
    surface = _BRep.BRep_Tool.Surface_s(face)
    spline, kind, bounds = exact_surface(surface, _BRepTools.UVBounds_s(face))
    return spline, kind, not _fills(face, bounds)


def edge_geometry(edge: Any) -> tuple[BSplineCurve | EllipseArc, str]:
    """The part of its curve that an edge uses, and the curve's kind in the words of Part 21.

    Raises
    ------
    KernelError
        When the edge has no curve in space, or an unbounded one, or one without an exact rational form.
    """
    edge = as_edge(edge)
    curve = _BRep.BRep_Tool.Curve_s(edge, 0.0, 0.0)
    if curve is None:
        raise KernelError("an edge has no curve in space")
    return exact_curve(curve, *_BRep.BRep_Tool.Range_s(edge))


def _fills(face: Any, bounds: Bounds) -> bool:
    """Whether the boundary of a face runs along the sides of a parameter rectangle, within the edges' tolerance."""
    wires = subshapes(face, "WIRE")
    if len(wires) > 1:
        return False
    surface = _BRepAdaptor.BRepAdaptor_Surface(face)
    return all(_on_side(as_edge(edge), face, surface, bounds) for edge in subshapes(face, "EDGE"))


def _on_side(edge: Any, face: Any, surface: Any, bounds: Bounds) -> bool:
    tolerance = _BRep.BRep_Tool.Tolerance_s(edge)
    slack_u, slack_v = surface.UResolution(tolerance), surface.VResolution(tolerance)
    u0, u1, v0, v1 = bounds
    for use in (edge, as_edge(edge.Reversed())):
        poles = _parameter_poles(use, face)
        u, v = poles[:, 0], poles[:, 1]
        along_u = any((np.abs(u - side) <= slack_u).all() for side in (u0, u1))
        along_v = any((np.abs(v - side) <= slack_v).all() for side in (v0, v1))
        if not (along_u or along_v):
            return False
    return True


def _parameter_poles(edge: Any, face: Any) -> Array:
    """The poles of an edge's parameter curve: the curve lies in their hull."""
    curve = _BRep.BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 0.0)
    if curve is None:
        raise KernelError("an edge has no parameter curve on its face")
    trimmed = _Geom2d.Geom2d_TrimmedCurve(curve, *_BRep.BRep_Tool.Range_s(edge, face))
    spline = _Geom2dConvert.CurveToBSplineCurve_s(trimmed)
    return np.array([spline.Pole(i).Coord() for i in range(1, spline.NbPoles() + 1)])


# --- checks -------------------------------------------------------------------------------------------------------


class ShapeKey:
    """A shape as a key of dictionaries: all uses of it in the same place are one, whichever way they run.

    The == of the bindings tells such uses apart, and sometimes even equal ones.
    """

    def __init__(self, shape: Any) -> None:
        self._shape = shape
        self._hash = hash(shape.Oriented(_TopAbs.TopAbs_FORWARD))

    def __hash__(self) -> int:
        return self._hash

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ShapeKey) and bool(self._shape.IsSame(other._shape))


def subshapes(shape: Any, kind: str, outside: str = "SHAPE") -> list[Any]:
    """The sub-shapes of a kind ("FACE", "EDGE", ...) that belong to none of the kind `outside`, each once, in order."""
    explorer = _TopExp.TopExp_Explorer(shape, getattr(_TopAbs, f"TopAbs_{kind}"), getattr(_TopAbs, f"TopAbs_{outside}"))
    found: dict[ShapeKey, Any] = {}
    while explorer.More():
        found.setdefault(ShapeKey(explorer.Current()), explorer.Current())
        explorer.Next()
    return list(found.values())


def pieces(shape: Any) -> list[Any]:
    """The faces of a shape and the edges that belong to none, each once, in the order of the shape."""
    on_faces = {ShapeKey(edge) for face in subshapes(shape, "FACE") for edge in subshapes(face, "EDGE")}
    ordered: dict[ShapeKey, Any] = {}
    for leaf in _leaves(shape):
        for piece in subshapes(leaf, "FACE") or subshapes(leaf, "EDGE"):
            if ShapeKey(piece) not in on_faces:
                ordered.setdefault(ShapeKey(piece), piece)
    return list(ordered.values())


def _leaves(shape: Any) -> Iterator[Any]:
    if shape.ShapeType() != _TopAbs.TopAbs_COMPOUND:
        yield shape
        return
    children = _TopoDS.TopoDS_Iterator(shape)
    while children.More():
        yield from _leaves(children.Value())
        children.Next()


def is_valid(shape: Any) -> bool:
    """The verdict of the kernel's BRepCheck."""
    return bool(_BRepCheck.BRepCheck_Analyzer(shape).IsValid())


def _checked(shape: Any, what: str) -> Any:
    analyzer = _BRepCheck.BRepCheck_Analyzer(shape)
    if analyzer.IsValid():
        return shape
    parts = [shape] + [sub for kind in ("WIRE", "EDGE", "VERTEX") for sub in subshapes(shape, kind)]
    complaints = ", ".join(check_complaints(analyzer, parts)) or "no reason given"
    raise KernelError(f"the kernel's check refuses the {what}: {complaints}")
