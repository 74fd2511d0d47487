"""Measurements that only the kernel can take: of trimmed faces, and of solids as it holds them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from gtcad.converters.bspline import Array
from gtcad.converters.occt.compat import kernel_guard, kernel_module
from gtcad.measure import Estimate

_BRepBuilderAPI = kernel_module("BRepBuilderAPI")
_BRepExtrema = kernel_module("BRepExtrema")
_BRepGProp = kernel_module("BRepGProp").BRepGProp
_GProp = kernel_module("GProp")
_gp = kernel_module("gp")


def distances_to(face: Any) -> Callable[[Array], Array]:
    """A function from points, shape (n, 3), to their distances from a face, what is cut away left out: shape (n,)."""

    def distances(points: Array) -> Array:
        extrema = _BRepExtrema.BRepExtrema_DistShapeShape()
        extrema.LoadS1(face)
        found = np.empty(len(points))
        for i, point in enumerate(points.tolist()):
            extrema.LoadS2(_BRepBuilderAPI.BRepBuilderAPI_MakeVertex(_gp.gp_Pnt(*point)).Vertex())
            extrema.Perform()
            found[i] = extrema.Value() if extrema.IsDone() else np.inf
        return found

    return distances


def area(face: Any) -> float:
    """Area of a face in mm^2, to about 1e-6 of it."""
    properties = _GProp.GProp_GProps()
    _BRepGProp.SurfaceProperties_s(face, properties, 1e-7)
    return float(properties.Mass())


def volume(solid: Any, *, rtol: float) -> Estimate:
    """Volume of a solid in mm^3, by adaptive quadrature with a relative error of about rtol; its estimate is kept."""
    with kernel_guard("measuring a volume"):
        properties = _GProp.GProp_GProps()
        error = float(_BRepGProp.VolumeProperties_s(solid, properties, rtol))
        value = float(properties.Mass())
    return Estimate(value, (abs(error) + rtol) * abs(value))
