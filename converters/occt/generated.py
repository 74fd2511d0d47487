"""Faces that a curve generates: turned about an axis, or moved along a vector."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from gtcad.converters.bspline import Array, BSplineCurve
from gtcad.converters.occt.compat import as_face, kernel_module
from gtcad.converters.occt.geometry import exact_curve, exact_surface, untrimmed
from gtcad.converters.part import EllipseArc

_BRep = kernel_module("BRep")
_BRepTools = kernel_module("BRepTools").BRepTools

_MOVED = ("Geom_Plane", "Geom_SurfaceOfLinearExtrusion")
_TURNED = (
    "Geom_CylindricalSurface",
    "Geom_ConicalSurface",
    "Geom_SphericalSurface",
    "Geom_ToroidalSurface",
    "Geom_SurfaceOfRevolution",
)


@dataclass(frozen=True, eq=False)
class Generated:
    """The parameter rectangle of a face whose surface a curve generates.

    Attributes
    ----------
    curve
        In mm.
    vector
        What it is moved along, or the direction of the axis.
    point
        A point of the axis; None where the curve is moved.
    angle_deg
        By how much it is turned, counterclockwise against the axis.

    Notes
    -----
    The curve's direction and then that of the movement give the normal of the kernel's surface.
    """

    curve: BSplineCurve | EllipseArc
    vector: Array
    point: Array | None = None
    angle_deg: float = 0.0


def generated(face: Any) -> Generated | None:
    """What generates a plane, cylinder, cone, sphere, torus, or surface of extrusion or revolution; None of others.

    Raises
    ------
    KernelError
        When the curve has no exact rational form.
    """
    face = as_face(face)
    surface = untrimmed(_BRep.BRep_Tool.Surface_s(face))
    kind = type(surface).__name__
    if kind not in (*_MOVED, *_TURNED):
        return None
    u0, u1, v0, v1 = exact_surface(surface, _BRepTools.UVBounds_s(face))[2]
    if kind in _MOVED:
        curve = exact_curve(surface.VIso(v0), u0, u1)[0]
        return Generated(curve, _at(surface, u0, v1) - _at(surface, u0, v0))
    curve = exact_curve(surface.UIso(u1), v0, v1)[0]
    axis = surface.Axis()
    point, direction = (np.array([at.X(), at.Y(), at.Z()]) for at in (axis.Location(), axis.Direction()))
    turn = 360.0 if u1 - u0 >= 2 * math.pi * (1 - 1e-12) else math.degrees(u1 - u0)
    return Generated(curve, direction, point, -_sense(surface, (u0, u1, v0, v1), point, direction) * turn)


def _at(surface: Any, u: float, v: float) -> Array:
    place = surface.Value(u, v)
    return np.array([place.X(), place.Y(), place.Z()])


def _sense(surface: Any, bounds: tuple[float, float, float, float], point: Array, direction: Array) -> float:
    """1 when u turns counterclockwise against the axis, else -1."""
    u0, u1, v0, v1 = bounds
    across = []
    for v in np.linspace(v0, v1, 7).tolist():
        out, following = (_at(surface, u, v) - point for u in (u0, u0 + (u1 - u0) / 8))
        across.append(float(np.cross(out, following) @ direction))
    return math.copysign(1.0, max(across, key=abs))
