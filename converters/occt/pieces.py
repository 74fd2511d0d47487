"""Taking shapes apart: their faces and free edges, each as the kernel holds it and as plain arrays."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from gtcad.converters.bspline import Array, BSplineCurve, BSplineSurface
from gtcad.converters.occt.compat import as_edge, as_face, kernel_module
from gtcad.converters.occt.geometry import Bounds, exact_curve, exact_surface, is_b_spline
from gtcad.converters.part import EllipseArc
from gtcad.errors import KernelError

_BRep = kernel_module("BRep")
_BRepAdaptor = kernel_module("BRepAdaptor")
_BRepCheck = kernel_module("BRepCheck")
_BRepTools = kernel_module("BRepTools").BRepTools
_Geom2d = kernel_module("Geom2d")
_Geom2dConvert = kernel_module("Geom2dConvert").Geom2dConvert
_TopAbs = kernel_module("TopAbs")
_TopExp = kernel_module("TopExp")
_TopoDS = kernel_module("TopoDS")

_ON_SIDE = 1e-6  # mm


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


def bodies(shape: Any) -> dict[ShapeKey, Any]:
    """For each face of a solid, or of a shell of several faces in none, that solid or shell."""
    around = {}
    for kind, outside in (("SHELL", "SOLID"), ("SOLID", "SHAPE")):
        for body in subshapes(shape, kind, outside):
            faces = subshapes(body, "FACE")
            if kind == "SOLID" or len(faces) > 1:
                around.update({ShapeKey(face): body for face in faces})
    return around


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
    return spline, kind, not fills(face, bounds)


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


def is_periodic_spline(piece: Any) -> bool:
    """Whether the B-spline of a face or edge was made periodic."""
    if piece.ShapeType() == _TopAbs.TopAbs_FACE:
        surface = _BRep.BRep_Tool.Surface_s(as_face(piece))
        return is_b_spline(surface) and bool(surface.IsUPeriodic() or surface.IsVPeriodic())
    curve = _BRep.BRep_Tool.Curve_s(as_edge(piece), 0.0, 0.0)
    return is_b_spline(curve) and bool(curve.IsPeriodic())


def fills(face: Any, bounds: Bounds) -> bool:
    """Whether the boundary of a face runs along the sides of a parameter rectangle.

    It does within the edges' tolerances, but at most 1e-6 mm: proofs take such a face for the whole rectangle.
    """
    wires = subshapes(face, "WIRE")
    if len(wires) > 1:
        return False
    surface = _BRepAdaptor.BRepAdaptor_Surface(face)
    return all(_on_side(as_edge(edge), face, surface, bounds) for edge in subshapes(face, "EDGE"))


def _on_side(edge: Any, face: Any, surface: Any, bounds: Bounds) -> bool:
    tolerance = min(_BRep.BRep_Tool.Tolerance_s(edge), _ON_SIDE)
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
