"""Measurements that only the kernel can take: of trimmed faces, and of solids as it holds them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from gtcad.converters.bspline import Array
from gtcad.converters.occt.compat import kernel_guard, kernel_module
from gtcad.converters.part import Measured
from gtcad.measure import Estimate

_BRepBuilderAPI = kernel_module("BRepBuilderAPI")
_BRepExtrema = kernel_module("BRepExtrema")
_BRepGProp = kernel_module("BRepGProp").BRepGProp
_GProp = kernel_module("GProp")
_gp = kernel_module("gp")

_ACCURACY = 1e-9


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


def measured(faces: Sequence[Any], solid: Any) -> Measured:
    """Area and centre of gravity of faces, to about 1e-7, and volume and centre of the solid, if it is one."""
    with kernel_guard("measuring a shape"):
        shell = _GProp.GProp_GProps()
        for face in faces:
            own = _GProp.GProp_GProps()
            _BRepGProp.SurfaceProperties_s(face, own, _ACCURACY)
            shell.Add(own)
        body = _GProp.GProp_GProps()
        if solid is None:
            return Measured(float(shell.Mass()), _centre(shell), None, None)
        _BRepGProp.VolumeProperties_s(solid, body, _ACCURACY)
        return Measured(float(shell.Mass()), _centre(shell), float(body.Mass()), _centre(body))


def _centre(properties: Any) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in properties.CentreOfMass().Coord())
    return x, y, z


def volume(solid: Any, *, rtol: float) -> Estimate:
    """Volume of a solid in mm^3, by adaptive quadrature with a relative error of about rtol; its estimate is kept."""
    with kernel_guard("measuring a volume"):
        properties = _GProp.GProp_GProps()
        error = float(_BRepGProp.VolumeProperties_s(solid, properties, rtol))
        value = float(properties.Mass())
    return Estimate(value, (abs(error) + rtol) * abs(value))
