"""Edges and faces of the kernel, built side by side from the spline's own boundary poles."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from gtcad.converters.bspline import Array, BSplineCurve, BSplineSurface
from gtcad.converters.occt.compat import (
    check_complaints,
    kernel_guard,
    kernel_module,
    point,
)
from gtcad.converters.occt.geometry import (
    to_geom_conic,
    to_geom_curve,
    to_geom_surface,
)
from gtcad.converters.occt.pieces import subshapes
from gtcad.converters.part import EllipseArc, Wire, ends_of
from gtcad.errors import InputError, KernelError

_gp = kernel_module("gp")
_BRep = kernel_module("BRep")
_BRepCheck = kernel_module("BRepCheck")
_Geom2d = kernel_module("Geom2d")
_TopAbs = kernel_module("TopAbs")
_TopoDS = kernel_module("TopoDS")

TOLERANCE = 1e-7
"""Tolerance of vertices, edges and faces in mm: the kernel's own Precision::Confusion."""

Side = Literal["u0", "u1", "v0", "v1"]
Corner = tuple[int, int]
AROUND: tuple[Side, ...] = ("v0", "u1", "v1", "u0")  # counter-clockwise in the parameter plane
CORNERS: tuple[Corner, ...] = ((0, 0), (1, 0), (1, 1), (0, 1))
_AGAINST: tuple[Side, ...] = ("v1", "u0")  # these two are walked against their parameter
_OPPOSITE: tuple[tuple[Side, Side], ...] = (("u0", "u1"), ("v0", "v1"))
ENDS: dict[Side, tuple[Corner, Corner]] = {
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
        start, end = _end_vertices([curve], tolerance)
        return checked(_curve_edge(curve, start, end, tolerance), "edge")


def make_wire(wire: Wire, *, tolerance: float = TOLERANCE) -> Any:
    """A TopoDS_Wire whose edges share their vertices; closed when its ends are at most `tolerance` apart.

    Raises
    ------
    InputError, KernelError
        As ``make_edge``, for any edge.
    """
    with kernel_guard("making a wire"):
        vertices = _end_vertices(wire.edges, tolerance)
        builder, made = _BRep.BRep_Builder(), _TopoDS.TopoDS_Wire()
        builder.MakeWire(made)
        for curve, start, end in zip(wire.edges, vertices[:-1], vertices[1:], strict=True):
            builder.Add(made, _curve_edge(curve, start, end, tolerance))
        made.Closed(vertices[0].IsSame(vertices[-1]))
        return checked(made, "wire")


def _end_vertices(curves: Sequence[BSplineCurve | EllipseArc], tolerance: float) -> list[Any]:
    """A vertex for each end of curves that meet; one for the first and the last when they coincide."""
    places = [ends_of(curves[0])[0], *(ends_of(curve)[1] for curve in curves)]
    vertices = [_vertex(place, tolerance) for place in places[:-1]]
    closed = np.linalg.norm(places[-1] - places[0]) <= tolerance
    return [*vertices, vertices[0] if closed else _vertex(places[-1], tolerance)]


def _curve_edge(curve: BSplineCurve | EllipseArc, start: Any, end: Any, tolerance: float) -> Any:
    if isinstance(curve, EllipseArc):
        geometry, first, last = to_geom_conic(curve)
        extent = float(np.linalg.norm([curve.axis_a, curve.axis_b], axis=-1).max()) * (last - first)
    else:
        geometry, first, last = to_geom_curve(curve), float(curve.knots[0]), float(curve.knots[-1])
        extent = _extent(curve.control_points)
    if extent <= tolerance:
        raise InputError(
            f"the curve must be longer than the tolerance of {tolerance:.3g} mm, "
            f"it reaches at most {extent:.3g} mm from its start"
        )
    return edge_between(geometry, start, end, (first, last), tolerance)


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
        When a side is shorter than the tolerance without being a point, two opposite sides or two corners nearly meet
        without being equal, or the knots are too close for the kernel.
    KernelError
        When the kernel's own check refuses the face. It does so at degrees above 17 if the control points are rough,
        because it evaluates in powers of the parameter and loses digits.
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
    surface, geometry
        The patch, as arrays and as the kernel's surface.
    curves
        The boundary curves, each running with its parameter.
    points
        The sides that are one point.
    seams
        For each side that coincides with the opposite one, the side whose edge both use.
    """

    surface: BSplineSurface
    geometry: Any
    curves: dict[Side, BSplineCurve]
    points: frozenset[Side]
    seams: dict[Side, Side]

    @property
    def needed(self) -> tuple[Side, ...]:
        """The sides that need an edge of their own."""
        return tuple(side for side in AROUND if self.seams.get(side, side) == side)


def _outline(surface: BSplineSurface, tolerance: float) -> Outline:
    outline = outline_without_seams(surface, tolerance)
    seams: dict[Side, Side] = {}
    for first, second in _OPPOSITE:
        if outline.points.isdisjoint((first, second)) and _coincide(outline.curves, first, second, tolerance):
            seams |= {first: first, second: first}
    return replace(outline, seams=seams)


def outline_without_seams(surface: BSplineSurface, tolerance: float) -> Outline:
    """The outline of a patch, all its sides taken as apart.

    Raises
    ------
    InputError
        When a side is shorter than the tolerance without being a point, or the patch is only a curve.
    """
    points = surface.control_points
    if (points == points[:1]).all() or (points == points[:, :1]).all():
        raise InputError("the surface is only a curve: all its rows or all its columns of control points are equal")
    curves = {side: surface.boundary(side) for side in AROUND}
    collapsed = frozenset(side for side in AROUND if _is_point(curves[side], side, tolerance))
    return Outline(surface, to_geom_surface(surface), curves, collapsed, {})


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
    if gap > tolerance:
        return False
    if gap > 0:
        raise InputError(
            f"sides {first} and {second} are {gap:.3g} mm apart, less than the tolerance of {tolerance:.3g} mm: "
            "give them the same control points, then the patch is closed"
        )
    if a.weights is not None and b.weights is not None and (a.weights != b.weights).any():
        raise InputError(
            f"sides {first} and {second} have the same control points but different weights: "
            "give them the same weights, then the patch is closed"
        )
    return True


def _extent(points: Array) -> float:
    """Distance from the first control point to the farthest one: the curve lies within it."""
    return float(np.linalg.norm(points - points[0], axis=-1).max())


# --- vertices, edges, wires ---------------------------------------------------------------------------------------


def _vertex(position: Array, tolerance: float) -> Any:
    vertex = _TopoDS.TopoDS_Vertex()
    _BRep.BRep_Builder().MakeVertex(vertex, point(position), tolerance)
    return vertex


def _corner_vertices(surface: BSplineSurface, tolerance: float) -> dict[Corner, Any]:
    """A vertex for each corner; corners at the same place share one."""
    return dict(zip(CORNERS, vertices_at(corner_places(surface), tolerance), strict=True))


def corner_places(surface: BSplineSurface) -> list[Array]:
    """The points of a patch at ``CORNERS``."""
    return [surface.control_points[-i, -j] for i, j in CORNERS]


def vertices_at(places: Sequence[Array], tolerance: float) -> list[Any]:
    """A vertex for each corner place; equal places share one.

    Raises
    ------
    InputError
        When two places nearly meet without being equal.
    """
    by_place: dict[tuple[float, ...], Any] = {}
    vertices = []
    for position in places:
        place = tuple((position + 0.0).tolist())  # + 0.0: minus zero is the same place
        gap = min((math.dist(place, other) for other in by_place), default=math.inf)
        if 0 < gap <= tolerance:
            raise InputError(
                f"two corners are {gap:.3g} mm apart, less than the tolerance of {tolerance:.3g} mm: make them equal"
            )
        if place not in by_place:
            by_place[place] = _vertex(position, tolerance)
        vertices.append(by_place[place])
    return vertices


def _side_edge(outline: Outline, side: Side, vertices: Mapping[Corner, Any], tolerance: float) -> Any:
    curve = outline.curves[side]
    start, end = (vertices[corner] for corner in ENDS[side])
    geometry = None if side in outline.points else to_geom_curve(curve)
    return edge_between(geometry, start, end, (float(curve.knots[0]), float(curve.knots[-1])), tolerance)


def edge_between(geometry: Any, start: Any, end: Any, parameters: tuple[float, float], tolerance: float) -> Any:
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


def _side_line(surface: BSplineSurface, side: Side, mirrored: bool) -> Any:
    """The straight parameter curve of a side, with the side's own parameter or that of an edge that runs backwards."""
    across, along = (surface.knots_u, surface.knots_v) if side[0] == "u" else (surface.knots_v, surface.knots_u)
    fixed = float(across[0 if side[1] == "0" else -1])
    origin, way = (float(along[0] + along[-1]), -1.0) if mirrored else (0.0, 1.0)
    if side[0] == "u":
        return _Geom2d.Geom2d_Line(_gp.gp_Pnt2d(fixed, origin), _gp.gp_Dir2d(0.0, way))
    return _Geom2d.Geom2d_Line(_gp.gp_Pnt2d(origin, fixed), _gp.gp_Dir2d(way, 0.0))


def face_on(outline: Outline, edges: Mapping[Side, Any], tolerance: float, *, mirrored: Collection[Side] = ()) -> Any:
    """The face of a surface whose edges exist already, so that neighbours can share them.

    Parameters
    ----------
    outline
        The surface, all of which becomes the face, and its sides.
    edges
        For each side of `outline.needed` a forward edge that runs along it with the same parameter.
    tolerance
        In mm.
    mirrored
        The sides, no seams, whose edge runs backwards: where the side, with the knots a to b, has the parameter s, the
        edge has a + b - s.
    """
    builder = _BRep.BRep_Builder()
    face = _TopoDS.TopoDS_Face()
    builder.MakeFace(face, outline.geometry, tolerance)
    wire = _TopoDS.TopoDS_Wire()
    builder.MakeWire(wire)
    for side in AROUND:
        edge = edges[outline.seams.get(side, side)]
        builder.Add(
            wire, edge.Oriented(_TopAbs.TopAbs_FORWARD if walked_ahead(side, mirrored) else _TopAbs.TopAbs_REVERSED)
        )
    for side in outline.needed:
        _lay_on_face(outline, side, edges[side], face, tolerance, mirrored)
    wire.Closed(True)
    builder.Add(face, wire)
    builder.NaturalRestriction(face, True)
    return checked(face, "face")


def walked_ahead(side: Side, mirrored: Collection[Side]) -> bool:
    """Whether the boundary, walked counter-clockwise, follows the edge of a side forwards."""
    return (side in _AGAINST) == (side in mirrored)


def _lay_on_face(
    outline: Outline, side: Side, edge: Any, face: Any, tolerance: float, mirrored: Collection[Side]
) -> None:
    uses = [other for other in AROUND if outline.seams.get(other, other) == side]
    lines = [_side_line(outline.surface, use, use in mirrored) for use in uses]
    # AROUND lists v0 before v1 and u1 before u0: the one walked forward first, as the kernel wants a seam's pair
    builder = _BRep.BRep_Builder()
    builder.UpdateEdge(edge, *lines, face, tolerance)
    curve = outline.curves[side]
    builder.Range(edge, face, float(curve.knots[0]), float(curve.knots[-1]))


# --- checks -----------------------------------------------------------------------------------------------------------


def checked(shape: Any, what: str) -> Any:
    """The shape itself.

    Raises
    ------
    KernelError
        When the kernel's own check refuses it.
    """
    analyzer = _BRepCheck.BRepCheck_Analyzer(shape)
    if analyzer.IsValid():
        return shape
    parts = [shape] + [sub for kind in ("WIRE", "EDGE", "VERTEX") for sub in subshapes(shape, kind)]
    complaints = ", ".join(check_complaints(analyzer, parts)) or "no reason given"
    raise KernelError(f"the kernel's check refuses the {what}: {complaints}")
