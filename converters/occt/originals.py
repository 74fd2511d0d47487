"""B-splines as a file holds them, for those whose last bits the kernel's readers move.

The readers make closed curves and surfaces periodic. Rational ones come back from that with coordinates that differ in
the last bits, so their arrays are taken from the entities of the file instead.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import suppress
from typing import Any

import numpy as np

from gtcad.converters.bspline import Array, BSplineCurve, BSplineSurface
from gtcad.converters.occt.compat import kernel_module
from gtcad.converters.occt.geometry import from_geom_curve, from_geom_surface
from gtcad.errors import InputError

_StepData = kernel_module("StepData")
_StepToGeom = kernel_module("StepToGeom").StepToGeom

_RATIONAL_CURVE = "StepGeom_BSplineCurveWithKnotsAndRationalBSplineCurve"
_ROUNDING = 1e-14  # relative; what periodicity costs is a few units in the last place

Spline = BSplineCurve | BSplineSurface


def protect(entity: Any) -> None:
    """Keep OCCT from closing a rational curve of a STEP model whose end weights differ: the curve would change.

    The flag that is cleared is for information only, says the standard; OCCT makes what it marks periodic, with the
    first weight for the last one.
    """
    if type(entity).__name__ != _RATIONAL_CURVE:
        return
    if entity.WeightsDataValue(1) != entity.WeightsDataValue(entity.NbWeightsData()):
        entity.SetClosedCurve(_StepData.StepData_LFalse)


def step_originals(entities: Iterable[Any]) -> Iterator[Spline]:
    """The rational B-splines among the entities of a STEP model, in the file's own unit and place."""
    for entity in entities:
        kind = type(entity).__name__
        if kind == "StepGeom_BSplineSurfaceWithKnotsAndRationalBSplineSurface":
            yield from_geom_surface(_StepToGeom.MakeBSplineSurface_s(entity))
        elif kind == _RATIONAL_CURVE:
            entity.SetClosedCurve(_StepData.StepData_LFalse)
            yield from_geom_curve(_StepToGeom.MakeBSplineCurve_s(entity))


def iges_originals(entities: Iterable[Any]) -> Iterator[Spline]:
    """The rational B-spline surfaces among the entities of an IGES model, in the file's own unit and place."""
    for entity in entities:
        if type(entity).__name__ == "IGESGeom_BSplineSurface" and not entity.IsPolynomial():
            with suppress(InputError):  # not clamped: not one that was clamped before the kernel came
                yield _iges_surface(entity)


def _iges_surface(entity: Any) -> BSplineSurface:
    degree_u, degree_v = entity.DegreeU(), entity.DegreeV()
    rows, columns = range(entity.NbPolesU()), range(entity.NbPolesV())
    knots_u, counts_u = np.unique([entity.KnotU(i - degree_u) for i in range(entity.NbKnotsU())], return_counts=True)
    knots_v, counts_v = np.unique([entity.KnotV(i - degree_v) for i in range(entity.NbKnotsV())], return_counts=True)
    return BSplineSurface(
        [[entity.Pole(i, j).Coord() for j in columns] for i in rows],
        knots_u,
        counts_u,
        degree_u,
        knots_v,
        counts_v,
        degree_v,
        [[entity.Weight(i, j) for j in columns] for i in rows],
    )


def restored(spline: Spline, originals: Iterable[Spline]) -> Spline:
    """The one of the originals that differs from a spline by rounding alone; the spline itself if there is none."""
    return next((original for original in originals if _alike(spline, original)), spline)


def _alike(spline: Spline, other: Spline) -> bool:
    if type(spline) is not type(other) or spline.control_points.shape != other.control_points.shape:
        return False
    if (spline.weights is None) != (other.weights is None) or _structure(spline) != _structure(other):
        return False
    pairs = zip(_arrays(spline), _arrays(other), strict=True)
    return all(np.abs(a - b).max() <= _ROUNDING * np.abs(b).max() for a, b in pairs)


def _structure(spline: Spline) -> tuple[object, ...]:
    if isinstance(spline, BSplineCurve):
        return spline.degree, spline.multiplicities
    return spline.degree_u, spline.multiplicities_u, spline.degree_v, spline.multiplicities_v


def _arrays(spline: Spline) -> list[Array]:
    knots = [spline.knots] if isinstance(spline, BSplineCurve) else [spline.knots_u, spline.knots_v]
    weights = [] if spline.weights is None else [spline.weights]
    return [spline.control_points, *weights, *knots]
