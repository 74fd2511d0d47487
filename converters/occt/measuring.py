"""What only the kernel can measure of a file that was inspected: distances from edges, and triangles of its faces."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from gtcad.converters.bspline import Array
from gtcad.converters.crossings import Integers
from gtcad.converters.occt.compat import kernel_guard, kernel_module, point
from gtcad.converters.occt.inspection import EdgeFacts, FaceFacts

_BRep = kernel_module("BRep")
_BRepBuilderAPI = kernel_module("BRepBuilderAPI")
_BRepExtrema = kernel_module("BRepExtrema")
_BRepMesh = kernel_module("BRepMesh")
_TopLoc = kernel_module("TopLoc")
_TopoDS = kernel_module("TopoDS")

_BEND = 0.5  # radians between neighbouring triangles, at most


def distances_from_edges(points: Array, edges: Sequence[EdgeFacts]) -> Array:
    """Distances of points, shape (n, 3), from the nearest of some edges: shape (n,), in mm."""
    found = np.full(len(points), np.inf)
    with kernel_guard("measuring the distance of edges"):
        for i, place in enumerate(points):
            vertex = _BRepBuilderAPI.BRepBuilderAPI_MakeVertex(point(place)).Vertex()
            for edge in edges:
                extrema = _BRepExtrema.BRepExtrema_DistShapeShape(vertex, edge.shape)
                if extrema.IsDone():
                    found[i] = min(found[i], extrema.Value())
    return found


def triangulation(faces: Sequence[FaceFacts], deflection: float) -> tuple[Array, Integers, Integers]:
    """Vertices, triangles and the number of the face of each triangle, within about a deflection in mm of the faces.

    The kernel makes it; it keeps neighbours together along the edges that they share, and misses the deflection by up
    to twice.
    """
    vertices: list[Any] = [np.empty((0, 3))]
    triangles: list[Any] = [np.empty((0, 3), dtype=np.int64)]
    owners: list[Any] = [np.empty(0, dtype=np.int64)]
    count = 0
    with kernel_guard("meshing the faces"):
        builder, compound = _BRep.BRep_Builder(), _TopoDS.TopoDS_Compound()
        builder.MakeCompound(compound)
        for face in faces:
            builder.Add(compound, face.shape)
        _BRepMesh.BRepMesh_IncrementalMesh(compound, deflection, False, _BEND, False)
        for number, face in enumerate(faces):
            location = _TopLoc.TopLoc_Location()
            mesh = _BRep.BRep_Tool.Triangulation_s(face.shape, location)
            if mesh is None:
                continue
            move = location.Transformation()
            nodes = [mesh.Node(i).Transformed(move).Coord() for i in range(1, mesh.NbNodes() + 1)]
            corners = [mesh.Triangle(i).Get() for i in range(1, mesh.NbTriangles() + 1)]
            vertices.append(np.array(nodes))
            triangles.append(np.array(corners, dtype=np.int64).reshape(-1, 3) - 1 + count)
            owners.append(np.full(len(corners), number, dtype=np.int64))
            count += len(nodes)
    return np.concatenate(vertices), np.concatenate(triangles), np.concatenate(owners)
