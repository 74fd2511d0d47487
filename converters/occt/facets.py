"""Triangles of trimmed faces, with normals and curvatures: for the eye, and to sample a face."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gtcad.converters.bspline import Array
from gtcad.converters.occt.compat import as_edge, as_face, kernel_guard, kernel_module
from gtcad.converters.occt.pieces import subshapes
from gtcad.converters.part import Facets, Side
from gtcad.errors import KernelError

_BRep = kernel_module("BRep")
_BRepAdaptor = kernel_module("BRepAdaptor")
_BRepBuilderAPI = kernel_module("BRepBuilderAPI")
_BRepLProp = kernel_module("BRepLProp")
_BRepMesh = kernel_module("BRepMesh")
_TopAbs = kernel_module("TopAbs")
_TopLoc = kernel_module("TopLoc")

Indices = NDArray[np.int64]

_DEFLECTION, _ANGLE = 2e-3, 0.15  # relative to the size of the face; radians
_LONGEST = 1 / 24  # of the diagonal: longer sides of triangles are halved
_MOST, _HALVINGS = 6000, 5
_ALONG = 97  # points along an edge
_SAME = 1e-12


def facets(face: Any) -> Facets:
    """Triangles of a face whose corners lie on its surface, inside its boundary or on chords of it.

    Raises
    ------
    KernelError
        When the kernel cannot divide the face.
    """
    with kernel_guard("dividing a face into triangles"):
        face = as_face(face)
        surface = _BRepAdaptor.BRepAdaptor_Surface(face)
        places, triangles = _triangulated(face)
        points = _measured(surface, places, _signs(face))[0]
        longest = _LONGEST * float(np.linalg.norm(np.ptp(points, axis=0)))
        for _ in range(_HALVINGS):
            sides = points[triangles] - points[np.roll(triangles, 1, axis=1)]
            if len(points) * 4 > _MOST or np.linalg.norm(sides, axis=2).max() <= longest:
                break
            places, triangles = _halved(places, triangles)
            points = _measured(surface, places, _signs(face))[0]
        points, normals, mean, gaussian = _measured(surface, places, _signs(face))
        if face.Orientation() == _TopAbs.TopAbs_REVERSED:
            triangles = triangles[:, ::-1]
        return Facets(points, triangles, normals, mean, gaussian, tuple(_sides(face, surface)))


def _signs(face: Any) -> float:
    return -1.0 if face.Orientation() == _TopAbs.TopAbs_REVERSED else 1.0


def _triangulated(face: Any) -> tuple[Array, Indices]:
    """The kernel's own mesh of a copy, which alone is changed: parameters (n, 2) and triangles."""
    copy = as_face(_BRepBuilderAPI.BRepBuilderAPI_Copy(face, True, False).Shape())
    box = np.array([vertex for edge in _sides(face, _BRepAdaptor.BRepAdaptor_Surface(face)) for vertex in edge.points])
    size = float(np.linalg.norm(np.ptp(box, axis=0))) if len(box) else 1.0
    _BRepMesh.BRepMesh_IncrementalMesh(copy, _DEFLECTION * size, False, _ANGLE, False)
    mesh = _BRep.BRep_Tool.Triangulation_s(copy, _TopLoc.TopLoc_Location())
    if mesh is None or not mesh.HasUVNodes():
        raise KernelError("the kernel does not divide a face into triangles")
    places = np.array([mesh.UVNode(i).Coord() for i in range(1, mesh.NbNodes() + 1)])
    triangles = np.array([mesh.Triangle(i).Get() for i in range(1, mesh.NbTriangles() + 1)], dtype=np.int64) - 1
    return places, triangles


def _halved(places: Array, triangles: Indices) -> tuple[Array, Indices]:
    """Each triangle as four, by the middles of its sides."""
    sides = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    known, index = np.unique(sides, axis=0, return_inverse=True)
    middles = (len(places) + index.reshape(-1)).reshape(-1, 3)
    (a, b, c), (ab, bc, ca) = triangles.T, middles.T
    corners = [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
    return (
        np.concatenate([places, places[known].mean(axis=1)]),
        np.concatenate([np.stack(corner, axis=1) for corner in corners]),
    )


def _measured(surface: Any, places: Array, sign: float) -> tuple[Array, Array, Array, Array]:
    """Points, normals of the face, mean and Gaussian curvature; NaN where there is none."""
    local = _BRepLProp.BRepLProp_SLProps(surface, 2, _SAME)
    points, normals = np.empty((len(places), 3)), np.full((len(places), 3), np.nan)
    mean, gaussian = np.full(len(places), np.nan), np.full(len(places), np.nan)
    for i, (u, v) in enumerate(places.tolist()):
        local.SetParameters(u, v)
        points[i] = local.Value().Coord()
        if local.IsNormalDefined():
            normals[i] = local.Normal().Coord()
            if local.IsCurvatureDefined():
                mean[i], gaussian[i] = local.MeanCurvature(), local.GaussianCurvature()
    return points, sign * normals, sign * mean, gaussian


def _sides(face: Any, surface: Any) -> Iterator[Side]:
    """The edges of a face, a seam from both sides, but for those that are one point."""
    for edge in map(as_edge, subshapes(face, "EDGE")):
        is_seam = _BRep.BRep_Tool.IsClosed_s(edge, face)
        for use in (edge, as_edge(edge.Reversed())) if is_seam else (edge,):
            curve = _BRep.BRep_Tool.CurveOnSurface_s(use, face, 0.0, 0.0)
            if curve is None or _BRep.BRep_Tool.Degenerated_s(use):
                continue
            first, last = _BRep.BRep_Tool.Range_s(use, face)
            places = np.array([curve.Value(t).Coord() for t in np.linspace(first, last, _ALONG).tolist()])
            yield Side(*_measured(surface, places, _signs(face))[:3])
