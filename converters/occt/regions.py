"""Which part of its surface a trimmed face is."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gtcad.converters.bspline import Array, BSplineSurface
from gtcad.converters.occt.compat import as_edge, as_face, kernel_guard, kernel_module
from gtcad.converters.occt.pieces import fills, subshapes
from gtcad.converters.part import Region

_BRep = kernel_module("BRep")
_BRepAdaptor = kernel_module("BRepAdaptor")
_BRepBuilderAPI = kernel_module("BRepBuilderAPI")
_BRepExtrema = kernel_module("BRepExtrema")
_BRepTools = kernel_module("BRepTools").BRepTools
_IntTools = kernel_module("IntTools")
_ShapeAnalysis = kernel_module("ShapeAnalysis")
_TopAbs = kernel_module("TopAbs")
_gp = kernel_module("gp")

Bounds = tuple[float, float]

_SAME = 1e-9  # relative: parameters and points of the kernel's surface and of its spline that are the same
_LEAST = 1e-6  # of the domain: a rectangle as thin as this is none
_SPREAD = (0.13, 0.38, 0.59, 0.91)  # where both surfaces are compared


def region_of(face: Any, spline: BSplineSurface) -> Region:
    """What a trimmed face is of the spline that was read from it."""
    face = as_face(face)
    surface = _BRepAdaptor.BRepAdaptor_Surface(face)
    bounds = _BRepTools.UVBounds_s(face)
    same = _same_parameters(surface, bounds, spline)
    return Region(
        _rectangle(face, bounds, spline) if same else None,
        partial(_inside, face) if same else partial(_inside_by_points, face, spline),
        partial(_sampled, face, surface, bounds),
        partial(_feet, face),
    )


def _same_parameters(surface: Any, bounds: tuple[float, ...], spline: BSplineSurface) -> bool:
    (u0, u1), (v0, v1) = spline.domain
    size = float(np.abs(spline.control_points).max())
    for s, t in zip(_SPREAD, reversed(_SPREAD), strict=True):
        u, v = bounds[0] * (1 - s) + bounds[1] * s, bounds[2] * (1 - t) + bounds[3] * t
        if not (u0 <= u <= u1 and v0 <= v <= v1):
            return False
        if np.abs(np.array(surface.Value(u, v).Coord()) - spline.evaluate(u, v)).max() > _SAME * size:
            return False
    return True


def _rectangle(
    face: Any, bounds: tuple[float, float, float, float], spline: BSplineSurface
) -> tuple[Bounds, Bounds] | None:
    if not fills(face, bounds):
        return None
    u, v = _within(bounds[:2], spline.domain[0]), _within(bounds[2:], spline.domain[1])
    return None if u is None or v is None else (u, v)


def _within(ends: Bounds, domain: Bounds) -> Bounds | None:
    """The ends, those of the domain where they are these but for rounding; None when they leave it or nearly meet."""
    slack = _SAME * (domain[1] - domain[0])
    a, b = (own if abs(end - own) <= slack else end for end, own in zip(ends, domain, strict=True))
    fine = domain[0] <= a and b <= domain[1] and b - a > _LEAST * (domain[1] - domain[0])
    return (a, b) if fine else None


def _inside(face: Any, places: Array) -> NDArray[np.bool_]:
    classifier = _IntTools.IntTools_FClass2d(face, _SAME)
    outside = _TopAbs.TopAbs_OUT
    return np.array([classifier.Perform(_gp.gp_Pnt2d(u, v)) != outside for u, v in places.tolist()], dtype=bool)


def _inside_by_points(face: Any, spline: BSplineSurface, places: Array) -> NDArray[np.bool_]:
    """Of a surface with other parameters than its spline: points have the same ones."""
    surface = _ShapeAnalysis.ShapeAnalysis_Surface(_BRep.BRep_Tool.Surface_s(face))
    points = spline.evaluate(places[:, 0], places[:, 1]).tolist()
    found = (surface.ValueOfUV(_gp.gp_Pnt(*point), _SAME) for point in points)
    return _inside(face, np.array([(uv.X(), uv.Y()) for uv in found]).reshape(-1, 2))


def _sampled(face: Any, surface: Any, bounds: tuple[float, float, float, float], lines: int) -> Array:
    with kernel_guard("sampling a face"):
        u, v = (
            np.linspace(a, b, lines + 1)[:-1] + (b - a) / lines / 2
            for a, b in zip(bounds[::2], bounds[1::2], strict=True)
        )
        places = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1).reshape(-1, 2)
        places = np.concatenate([places[_inside(face, places)], *_boundary(face, lines)])
        return np.array([surface.Value(*place).Coord() for place in places.tolist()]).reshape(-1, 3)


def _boundary(face: Any, count: int) -> list[Array]:
    """Parameters along each edge."""
    found = []
    for edge in map(as_edge, subshapes(face, "EDGE")):
        curve = _BRep.BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 0.0)
        if curve is not None:
            first, last = _BRep.BRep_Tool.Range_s(edge, face)
            found.append(np.array([curve.Value(t).Coord() for t in np.linspace(first, last, count).tolist()]))
    return found


def _feet(face: Any, points: Array) -> Array:
    with kernel_guard("the distance of a face"):
        extrema = _BRepExtrema.BRepExtrema_DistShapeShape()
        extrema.LoadS1(face)
        found = np.full((len(points), 3), np.inf)
        for i, point in enumerate(points.tolist()):
            extrema.LoadS2(_BRepBuilderAPI.BRepBuilderAPI_MakeVertex(_gp.gp_Pnt(*point)).Vertex())
            extrema.Perform()
            if extrema.IsDone() and extrema.NbSolution():
                found[i] = extrema.PointOnShape1(1).Coord()
        return found
