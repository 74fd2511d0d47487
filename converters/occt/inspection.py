"""What the kernel holds of faces and edges, measured for a check: lengths, gaps, normals, tolerances, faults."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from gtcad.converters.bspline import Array, BSplineCurve, BSplineSurface
from gtcad.converters.occt.compat import as_edge, as_face, check_complaints, kernel_guard, kernel_module, point
from gtcad.converters.occt.document import Item
from gtcad.converters.occt.faces import area
from gtcad.converters.occt.geometry import from_geom_curve, from_geom_surface, is_b_spline, untrimmed
from gtcad.converters.occt.pieces import ShapeKey, subshapes
from gtcad.converters.occt.shells import edge_uses
from gtcad.errors import InputError, KernelError

_BRep = kernel_module("BRep")
_BRepAdaptor = kernel_module("BRepAdaptor")
_BRepCheck = kernel_module("BRepCheck")
_GCPnts = kernel_module("GCPnts")
_gp = kernel_module("gp")
_ShapeAnalysis = kernel_module("ShapeAnalysis")
_TopAbs = kernel_module("TopAbs")
_TopExp = kernel_module("TopExp")
_TopoDS = kernel_module("TopoDS")

SAMPLES = (33, 257)  # of each edge: the least and the most, four in each span in between
_COARSE = 1e-6  # mm: a gap at equal parameters beyond which the nearest point of the surface is looked for
_COLLAPSED = 1e-6  # relative: a derivative shorter than that, for the longest along the edge, is none
_SINGULAR = 1e-9  # relative: a normal shorter than that, for the lengths of the derivatives, is none


@dataclass(frozen=True, eq=False)
class EdgeUse:
    """An edge as the boundary of a face, at the parameters at which the edge is sampled.

    Attributes
    ----------
    face
        The number of the face.
    forward
        Whether the face lies to the left of the edge, seen from outside.
    points
        Of the face's surface, shape (n, 3), in mm.
    normals
        Of the face, outwards, shape (n, 3); NaN where there is none.
    bending
        Curvature of the face across the edge, shape (n,), in 1/mm; NaN where there is none.
    gaps
        Distances of the edge's points from the surface, shape (n,), in mm.
    """

    face: int
    forward: bool
    points: Array
    normals: Array
    bending: Array
    gaps: Array


@dataclass(frozen=True, eq=False)
class EdgeFacts:
    """An edge of the file, with all faces that use it.

    Attributes
    ----------
    points
        Samples, shape (n, 3), in mm; none when the edge is only a point of a face.
    length
        In mm.
    tolerance
        That the kernel stores, in mm: the largest of the edge and its vertices.
    vertex_gap
        Distance of a vertex from the end of the curve, in mm: the larger one.
    uses
        One for each face, two for a seam.
    kind
        Of the curve, such as "B-spline curve".
    spline
        The curve, when it is a B-spline.
    alone
        Whether it belongs to no face: a curve of the file.
    name
        Of such a curve.
    shape
        The kernel's edge.
    """

    points: Array
    length: float
    tolerance: float
    vertex_gap: float
    uses: tuple[EdgeUse, ...]
    kind: str
    spline: BSplineCurve | None
    alone: bool
    name: str
    shape: Any = field(repr=False)


@dataclass(frozen=True, eq=False)
class FaceFacts:
    """A face of the file.

    Attributes
    ----------
    name
        In the file, or empty.
    area, perimeter
        In mm^2 and mm.
    middle
        A point of it, in mm.
    tolerance
        That the kernel stores, in mm.
    kind, spline
        Of its surface, as of an edge's curve.
    complaints
        What BRepCheck finds wrong, such as "edge InvalidCurveOnSurface"; of edges OCCT 8.0 says no more than "edge".
    crossing
        Points at which boundaries cross themselves, as BRepCheck finds them; NaN where it gives no place.
    body
        The number of the solid or shell that it belongs to, -1 for none.
    shape
        The kernel's face.
    """

    name: str
    area: float
    perimeter: float
    middle: tuple[float, float, float]
    tolerance: float
    kind: str
    spline: BSplineSurface | None
    complaints: tuple[str, ...]
    crossing: tuple[tuple[float, float, float], ...]
    body: int
    shape: Any = field(repr=False)


@dataclass(frozen=True, eq=False)
class BodyFacts:
    """A solid, or a shell of several faces.

    Attributes
    ----------
    kind
        "solid" or "shell".
    closed
        Whether each edge is in two faces, or a seam, or one point.
    complaints
        Of BRepCheck, those of the body and its shells; its faces have their own.
    """

    kind: str
    closed: bool
    complaints: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Inspection:
    """All that was measured of a file."""

    faces: tuple[FaceFacts, ...]
    edges: tuple[EdgeFacts, ...]
    bodies: tuple[BodyFacts, ...]


def inspect(items: Sequence[Item]) -> Inspection:
    """Measure the faces and free edges of a file.

    Raises
    ------
    KernelError
        When the kernel fails on one of them.
    """
    with kernel_guard("inspecting the file"):
        faces = [as_face(item.shape) for item in items if item.shape.ShapeType() == _TopAbs.TopAbs_FACE]
        named = [item for item in items if item.shape.ShapeType() == _TopAbs.TopAbs_FACE]
        bodies: dict[ShapeKey, Any] = {}
        for item in named:
            if item.body is not None:
                bodies.setdefault(ShapeKey(item.body), item.body)
        numbers = {key: number for number, key in enumerate(bodies)}
        places = [-1 if item.body is None else numbers[ShapeKey(item.body)] for item in named]
        edges = _edges(faces, [item for item in items if item.shape.ShapeType() == _TopAbs.TopAbs_EDGE])
        lengths = np.zeros(len(faces))
        for edge in edges:
            for use in edge.uses:
                lengths[use.face] += edge.length
        facts = [
            _face(face, item.name, body, float(length))
            for face, item, body, length in zip(faces, named, places, lengths, strict=True)
        ]
        return Inspection(tuple(facts), tuple(edges), tuple(map(_body, bodies.values())))


def _words(geometry: Any) -> str:
    """The kind of a curve or surface in words: "B-spline surface"."""
    name = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", type(geometry).__name__.removeprefix("Geom_").replace("BSpline", "Bspl"))
    return name.lower().replace("bspl", "B-spline").replace("bezier", "Bezier")


def _body(shape: Any) -> BodyFacts:
    kind = "solid" if shape.ShapeType() == _TopAbs.TopAbs_SOLID else "shell"
    analyzer = _BRepCheck.BRepCheck_Analyzer(shape)
    complaints: list[str] = []
    if not analyzer.IsValid():
        whole = [*subshapes(shape, "SOLID"), *subshapes(shape, "SHELL")]
        complaints = _spelled(check_complaints(analyzer, whole), _faults_of_shells(shape))
    return BodyFacts(kind, edge_uses(shape).closed, tuple(complaints))


def _face(face: Any, name: str, body: int, perimeter: float) -> FaceFacts:
    geometry = untrimmed(_BRep.BRep_Tool.Surface_s(face))
    spline = _plain(from_geom_surface, geometry) if is_b_spline(geometry) else None
    analyzer = _BRepCheck.BRepCheck_Analyzer(face)
    complaints: list[str] = []
    if not analyzer.IsValid():
        parts = [face, *(part for kind in ("WIRE", "EDGE", "VERTEX") for part in subshapes(face, kind))]
        complaints = _spelled(check_complaints(analyzer, parts), _faults(face))
    surface = _BRepAdaptor.BRepAdaptor_Surface(face)
    bounds = surface.FirstUParameter(), surface.LastUParameter(), surface.FirstVParameter(), surface.LastVParameter()
    middle = surface.Value((bounds[0] + bounds[1]) / 2, (bounds[2] + bounds[3]) / 2)
    return FaceFacts(
        name,
        area(face),
        perimeter,
        (middle.X(), middle.Y(), middle.Z()),
        float(_BRep.BRep_Tool.Tolerance_s(face)),
        _words(geometry),
        spline,
        tuple(complaints),
        tuple(_crossings(face)),
        body,
        face,
    )


def _spelled(complaints: Sequence[str], faults: Sequence[str]) -> list[str]:
    """Complaints and single faults, without the bare kind of a shape where a fault says more."""
    bare = {fault.partition(" ")[0] for fault in faults}
    return list(dict.fromkeys([*(text for text in complaints if text not in bare), *faults]))


def _faults(face: Any) -> list[str]:
    """What BRepCheck's single tests of a face and its wires find, which both versions of OCCT can tell."""
    check = _BRepCheck.BRepCheck_Face(face)
    found = [("face", status) for status in (check.IntersectWires(False), check.ClassifyWires(False))]
    for wire in subshapes(face, "WIRE"):
        check = _BRepCheck.BRepCheck_Wire(_TopoDS.TopoDS.Wire(wire))
        statuses = check.Closed(False), check.Closed2d(face, False), check.Orientation(face, False)
        found += [("wire", status) for status in statuses]
    return _named(found)


def _faults_of_shells(shape: Any) -> list[str]:
    found = []
    for shell in subshapes(shape, "SHELL"):
        check = _BRepCheck.BRepCheck_Shell(_TopoDS.TopoDS.Shell(shell))
        statuses = [check.Orientation(False)]
        if shape.ShapeType() == _TopAbs.TopAbs_SOLID:
            statuses.append(check.Closed(False))
        found += [("shell", status) for status in statuses]
    return _named(found)


def _named(found: Sequence[tuple[str, Any]]) -> list[str]:
    return [
        f"{kind} {str(status).rsplit('_', 1)[-1].partition(':')[0]}"
        for kind, status in found
        if status != _BRepCheck.BRepCheck_NoError
    ]


def _plain(convert: Any, geometry: Any) -> Any:
    """The arrays of a B-spline; None when it is damaged, which shows elsewhere."""
    try:
        return convert(geometry)
    except InputError:
        return None


def _crossings(face: Any) -> list[tuple[float, float, float]]:
    """Where the boundaries of a face cross themselves: at the middle of one of the edges that do."""
    found = []
    for wire in subshapes(face, "WIRE"):
        first, second = _TopoDS.TopoDS_Edge(), _TopoDS.TopoDS_Edge()
        status = _BRepCheck.BRepCheck_Wire(_TopoDS.TopoDS.Wire(wire)).SelfIntersect(face, first, second, False)
        if status == _BRepCheck.BRepCheck_SelfIntersectingWire:
            found.append((np.nan, np.nan, np.nan) if first.IsNull() else _middle(first))
    return found


def _middle(edge: Any) -> tuple[float, float, float]:
    curve = _BRepAdaptor.BRepAdaptor_Curve(edge)
    place = curve.Value((curve.FirstParameter() + curve.LastParameter()) / 2)
    return place.X(), place.Y(), place.Z()


# --- edges ---------------------------------------------------------------------------------------------------------


def _edges(faces: Sequence[Any], free: Sequence[Item]) -> list[EdgeFacts]:
    uses: dict[ShapeKey, list[tuple[int, Any]]] = {}
    for number, face in enumerate(faces):
        for wire in subshapes(face, "WIRE"):
            for edge in _explored_edges(wire):
                uses.setdefault(ShapeKey(edge), []).append((number, edge))
    found = [_edge(places[0][1], [(n, faces[n], edge) for n, edge in places], "") for places in uses.values()]
    return found + [_edge(as_edge(item.shape), [], item.name) for item in free]


def _explored_edges(wire: Any) -> list[Any]:
    """All uses of edges in a wire, a seam twice, each with its orientation there."""
    explorer = _TopExp.TopExp_Explorer(wire, _TopAbs.TopAbs_EDGE)
    found = []
    while explorer.More():
        found.append(as_edge(explorer.Current()))
        explorer.Next()
    return found


def _edge(edge: Any, places: Sequence[tuple[int, Any, Any]], name: str) -> EdgeFacts:
    vertices = subshapes(edge, "VERTEX")
    tolerance = max(
        [_BRep.BRep_Tool.Tolerance_s(edge), *(_BRep.BRep_Tool.Tolerance_s(_TopoDS.TopoDS.Vertex(v)) for v in vertices)]
    )
    geometry = _BRep.BRep_Tool.Curve_s(edge, 0.0, 0.0)
    if geometry is None or _BRep.BRep_Tool.Degenerated_s(edge):
        return EdgeFacts(np.empty((0, 3)), 0.0, tolerance, 0.0, (), "point", None, not places, name, edge)
    geometry = untrimmed(geometry)
    spline = _plain(from_geom_curve, geometry) if is_b_spline(geometry) else None
    curve = _BRepAdaptor.BRepAdaptor_Curve(edge)
    first, last = _BRep.BRep_Tool.Range_s(edge)
    spans = 1 if spline is None else len(spline.knots) - 1
    parameters = np.linspace(first, last, int(np.clip(4 * spans + 1, *SAMPLES)))
    points = np.array([_coordinates(curve.Value(t)) for t in parameters.tolist()])
    tangents = np.array([_coordinates(curve.DN(t, 1)) for t in parameters.tolist()])
    share = (parameters - first) / (last - first)
    uses = tuple(_use(number, face, own, share, points, tangents) for number, face, own in places)
    length = float(_GCPnts.GCPnts_AbscissaPoint.Length_s(curve))
    gap = _vertex_gap(vertices, points)
    return EdgeFacts(points, length, tolerance, gap, uses, _words(geometry), spline, not places, name, edge)


def _coordinates(value: Any) -> tuple[float, float, float]:
    return value.X(), value.Y(), value.Z()


def _vertex_gap(vertices: Sequence[Any], points: Array) -> float:
    """The larger distance of an end of the curve from the nearest vertex, or of a vertex from the nearest end."""
    places = np.array([_coordinates(_BRep.BRep_Tool.Pnt_s(_TopoDS.TopoDS.Vertex(vertex))) for vertex in vertices])
    if len(places) == 0:
        return 0.0
    distances = np.linalg.norm(places[:, None] - points[[0, -1]], axis=2)
    return float(max(distances.min(axis=0).max(), distances.min(axis=1).max()))


def _use(number: int, face: Any, edge: Any, share: Array, points: Array, tangents: Array) -> EdgeUse:
    line = _BRep.BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 0.0)
    if line is None:
        raise KernelError(f"an edge of face {number + 1} has no parameter curve on it")
    first, last = _BRep.BRep_Tool.Range_s(edge, face)
    surface = _BRepAdaptor.BRepAdaptor_Surface(face)
    place, vectors = _gp.gp_Pnt(), [_gp.gp_Vec() for _ in range(5)]
    values = np.empty((len(share), 6, 3))
    for i, t in enumerate((first + share * (last - first)).tolist()):
        uv = line.Value(t)
        surface.D2(uv.X(), uv.Y(), place, *vectors)
        values[i] = [_coordinates(place), *map(_coordinates, vectors)]
    outward = -1.0 if face.Orientation() == _TopAbs.TopAbs_REVERSED else 1.0
    normals, bending = _bending(values[:, 1:], tangents, outward)
    gaps = np.linalg.norm(values[:, 0] - points, axis=1)
    if (gaps > _COARSE).any():
        analysis = _ShapeAnalysis.ShapeAnalysis_Surface(_BRep.BRep_Tool.Surface_s(face))
        for i in np.flatnonzero(gaps > _COARSE).tolist():
            analysis.ValueOfUV(point(points[i]), _COARSE)
            gaps[i] = min(gaps[i], float(analysis.Gap()))
    forward = edge.Orientation() == _TopAbs.TopAbs_FORWARD
    return EdgeUse(number, forward, values[:, 0], normals, bending, gaps)


def _bending(derivatives: Array, tangents: Array, outward: float) -> tuple[Array, Array]:
    """Normals, and the curvature of the surface at right angles to the tangents: the quotient of its two forms."""
    du, dv, duu, dvv, duv = derivatives.transpose(1, 0, 2)
    normals = np.cross(du, dv)
    lengths = np.linalg.norm(normals, axis=1)
    sizes = np.linalg.norm(du, axis=1), np.linalg.norm(dv, axis=1)
    regular = lengths > _SINGULAR * sizes[0] * sizes[1]
    for size in sizes:
        regular &= size > _COLLAPSED * size.max()  # at a point where a row of poles meets, rounding makes the normal
    with np.errstate(invalid="ignore", divide="ignore"):
        normals = np.where(regular[:, None], normals / lengths[:, None], np.nan)
        across = np.cross(normals, tangents)
        metric = np.stack([[(du * du).sum(1), (du * dv).sum(1)], [(du * dv).sum(1), (dv * dv).sum(1)]])
        e, f, g = metric[0, 0], metric[0, 1], metric[1, 1]
        p, q = (across * du).sum(1), (across * dv).sum(1)
        determinant = e * g - f * f
        a, b = (g * p - f * q) / determinant, (e * q - f * p) / determinant
        second = [(normals * form).sum(1) for form in (duu, duv, dvv)]
        value = (a * a * second[0] + 2 * a * b * second[1] + b * b * second[2]) / (across * across).sum(1)
    return outward * normals, outward * value
