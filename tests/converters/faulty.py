"""Shapes with known faults, built with the kernel: each is wrong in one way by a known amount."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from gtcad.converters.bspline import BSplineSurface
from gtcad.converters.occt.compat import as_edge, as_face, kernel_module, point
from gtcad.converters.occt.document import Item
from gtcad.converters.occt.pieces import ShapeKey, bodies, pieces, subshapes
from gtcad.converters.occt.topology import make_face

_BRep = kernel_module("BRep")
_BRepBuilderAPI = kernel_module("BRepBuilderAPI")
_BRepPrimAPI = kernel_module("BRepPrimAPI")
_BRepTools = kernel_module("BRepTools").BRepTools
_Geom = kernel_module("Geom")
_gp = kernel_module("gp")
_TopAbs = kernel_module("TopAbs")
_TopoDS = kernel_module("TopoDS")


def items_of(shape: Any) -> list[Item]:
    around = bodies(shape)
    return [Item(piece, "", body=around.get(ShapeKey(piece))) for piece in pieces(shape)]


def box(*sides: float) -> Any:
    return _BRepPrimAPI.BRepPrimAPI_MakeBox(*sides).Solid()


def polygon(*corners: Sequence[float]) -> Any:
    """A plane face with straight sides."""
    wire = _BRepBuilderAPI.BRepBuilderAPI_MakePolygon()
    for corner in corners:
        wire.Add(point(corner))
    wire.Close()
    return _BRepBuilderAPI.BRepBuilderAPI_MakeFace(wire.Wire(), True).Face()


def sewn(*faces: Any, tolerance: float = 1e-6, non_manifold: bool = False) -> Any:
    """The faces with the edges shared that are within a tolerance."""
    sewing = _BRepBuilderAPI.BRepBuilderAPI_Sewing(tolerance)
    sewing.SetNonManifoldMode(non_manifold)
    for face in faces:
        sewing.Add(face)
    sewing.Perform()
    return sewing.SewedShape()


def ridge(degrees: float) -> Any:
    """Two squares that share an edge, the second turned up by an angle."""
    x, z = 10 + 10 * math.cos(math.radians(degrees)), 10 * math.sin(math.radians(degrees))
    first = polygon((0, 0, 0), (10, 0, 0), (10, 10, 0), (0, 10, 0))
    return sewn(first, polygon((10, 0, 0), (x, 0, z), (x, 10, z), (10, 10, 0)))


def bends(first: float, second: float) -> Any:
    """Two quarters of cylinders with these radii, tangent to each other along the line x = z = 0."""
    faces = []
    for radius, start in ((first, 1.5 * math.pi), (second, math.pi)):
        axes = _gp.gp_Ax3(_gp.gp_Pnt(0, 0, radius), _gp.gp_Dir(0, 1, 0), _gp.gp_Dir(1, 0, 0))
        surface = _Geom.Geom_CylindricalSurface(axes, radius)
        # z of the axes' frame is y, its y is -z: the lowest point has the angle pi / 2
        angles = (math.pi / 2, math.pi) if start > math.pi * 1.2 else (0.0, math.pi / 2)
        faces.append(_BRepBuilderAPI.BRepBuilderAPI_MakeFace(surface, angles[0], angles[1], 0.0, 20.0, 1e-7).Face())
    return sewn(*faces)


def open_solid() -> Any:
    """A solid whose shell lacks a face."""
    builder, shell, solid = _BRep.BRep_Builder(), _TopoDS.TopoDS_Shell(), _TopoDS.TopoDS_Solid()
    builder.MakeShell(shell)
    for face in subshapes(box(10, 10, 10), "FACE")[:5]:
        builder.Add(shell, face)
    builder.MakeSolid(solid)
    builder.Add(solid, shell)
    return solid


def turned_over() -> Any:
    """A shell of two faces, one of them turned over."""
    builder, shell = _BRep.BRep_Builder(), _TopoDS.TopoDS_Shell()
    first, second = subshapes(ridge(30), "FACE")
    builder.MakeShell(shell)
    builder.Add(shell, first)
    builder.Add(shell, second.Reversed())
    return shell


def three_wings() -> Any:
    """Three squares on one edge."""
    wings = [polygon((0, 0, 0), (0, 0, 10), (x, y, 10), (x, y, 0)) for x, y in ((10, 0), (-5, 8.66), (-5, -8.66))]
    return sewn(*wings, non_manifold=True)


def lifted_edge(height: float) -> Any:
    """A square with one edge that runs at a height above it, within the edge's tolerance."""
    face = polygon((0, 0, 0), (10, 0, 0), (10, 10, 0), (0, 10, 0))
    edge = as_edge(subshapes(face, "EDGE")[0])
    curve = _BRep.BRep_Tool.Curve_s(edge, 0.0, 0.0)
    raised = curve.Translated(_gp.gp_Vec(0, 0, height))
    builder = _BRep.BRep_Builder()
    builder.UpdateEdge(edge, raised, 2 * height)
    for vertex in subshapes(edge, "VERTEX"):
        builder.UpdateVertex(_TopoDS.TopoDS.Vertex(vertex), 2 * height)
    return face


def shifted_vertex(distance: float) -> Any:
    """A straight edge whose first vertex lies off its end, within the vertex's tolerance."""
    first = _BRepBuilderAPI.BRepBuilderAPI_MakeVertex(_gp.gp_Pnt(0, distance, 0)).Vertex()
    last = _BRepBuilderAPI.BRepBuilderAPI_MakeVertex(_gp.gp_Pnt(10, 0, 0)).Vertex()
    builder, edge = _BRep.BRep_Builder(), _TopoDS.TopoDS_Edge()
    line = _Geom.Geom_Line(_gp.gp_Pnt(0, 0, 0), _gp.gp_Dir(1, 0, 0))
    builder.MakeEdge(edge, line, 1e-7)
    builder.UpdateVertex(first, 2 * distance)
    builder.Add(edge, first.Oriented(_TopAbs.TopAbs_FORWARD))
    builder.Add(edge, last.Oriented(_TopAbs.TopAbs_REVERSED))
    builder.Range(edge, 0.0, 10.0)
    return edge


def bow_tie() -> Any:
    """A plane face whose boundary crosses itself."""
    wire = _BRepBuilderAPI.BRepBuilderAPI_MakePolygon()
    for corner in ((0, 0, 0), (10, 10, 0), (10, 0, 0), (0, 10, 0)):
        wire.Add(point(corner))
    wire.Close()
    plane = _gp.gp_Pln(_gp.gp_Pnt(0, 0, 0), _gp.gp_Dir(0, 0, 1))
    return _BRepBuilderAPI.BRepBuilderAPI_MakeFace(plane, wire.Wire(), True).Face()


def compound(*shapes: Any) -> Any:
    builder, whole = _BRep.BRep_Builder(), _TopoDS.TopoDS_Compound()
    builder.MakeCompound(whole)
    for shape in shapes:
        builder.Add(whole, shape)
    return whole


def crossing_squares(angle: float = 90.0) -> Any:
    """Two squares through each other's middle, at an angle."""
    x, z = 5 * math.cos(math.radians(angle)), 5 * math.sin(math.radians(angle))
    flat = polygon((-5, -5, 0), (5, -5, 0), (5, 5, 0), (-5, 5, 0))
    return compound(flat, polygon((-x, -4, -z), (x, -4, z), (x, 4, z), (-x, 4, -z)))


def looping_surface() -> Any:
    """A band whose cross-section is a loop: it passes through itself."""
    loop = [(0, 0), (60, 40), (20, 70), (-20, 40), (40, 0)]
    net = [[(x, y, z) for z in (0, 20)] for x, y in loop]
    return as_face(make_face(BSplineSurface(np.array(net, float), [0, 1], [5, 5], 4, [0, 1], [2, 2], 1)))


def folded_patch(degrees: float) -> Any:
    """A B-spline surface with a knot of full multiplicity, at which it is bent by an angle."""
    x, z = 10 + 10 * math.cos(math.radians(degrees)), 10 * math.sin(math.radians(degrees))
    profile = [(0, 0), (5, 0), (10, 0), ((10 + x) / 2, z / 2), (x, z)]
    net = [[(px, y, pz) for y in (0, 10)] for px, pz in profile]
    return make_face(BSplineSurface(np.array(net, float), [0, 0.5, 1], [3, 2, 3], 2, [0, 1], [2, 2], 1))


def neighbours(gap: float) -> Any:
    """Two squares beside each other, a gap apart, that share nothing."""
    first = polygon((0, 0, 0), (10, 0, 0), (10, 10, 0), (0, 10, 0))
    return compound(first, polygon((10, 0, gap), (20, 0, gap), (20, 10, gap), (10, 10, gap)))


def write(shape: Any, path: str) -> str:
    _BRepTools.Write_s(shape, path)
    return path
