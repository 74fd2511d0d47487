"""Measurements of trimmed faces that only the kernel can take."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from gtcad.converters.bspline import Array
from gtcad.converters.occt.compat import kernel_module

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
