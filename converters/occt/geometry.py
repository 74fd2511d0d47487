"""Geometry between plain arrays and the kernel: nothing here knows of edges, faces or files."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from gtcad.converters.bspline import Array, BSplineCurve, BSplineSurface
from gtcad.converters.occt.compat import integer_array, kernel_module, point, point_array, real_array
from gtcad.converters.part import EllipseArc
from gtcad.errors import InputError, KernelError

_gp = kernel_module("gp")
_Geom = kernel_module("Geom")
_GeomConvert = kernel_module("GeomConvert").GeomConvert

LEAST_KNOT_GAP = 1e-9
"""Distance below which the kernel takes two parameters for one (its Precision::PConfusion)."""
_INFINITE = 1e100  # the kernel writes an infinite parameter as 2e100
_ROUNDING = 1e-14
_SAME = 1e-9  # relative difference of parameters below which a range counts as the whole curve

Bounds = tuple[float, float, float, float]


# --- from arrays to the kernel ------------------------------------------------------------------------------------


def to_geom_curve(spline: BSplineCurve) -> Any:
    """The kernel's Geom_BSplineCurve with the same poles, bit for bit; z = 0 for plane curves.

    Raises
    ------
    InputError
        When two knots are so close that the kernel would take them for one.
    """
    _check_knots("knots", spline.knots)
    weights = () if spline.weights is None else (real_array(spline.weights),)
    return _Geom.Geom_BSplineCurve(
        point_array(spline.control_points),
        *weights,
        real_array(spline.knots),
        integer_array(spline.multiplicities),
        spline.degree,
        False,
    )


def to_geom_surface(spline: BSplineSurface) -> Any:
    """The kernel's Geom_BSplineSurface with the same poles, bit for bit; z = 0 for plane patches.

    Raises
    ------
    InputError
        When two knots are so close that the kernel would take them for one.
    """
    _check_knots("knots_u", spline.knots_u)
    _check_knots("knots_v", spline.knots_v)
    weights = () if spline.weights is None else (real_array(spline.weights),)
    return _Geom.Geom_BSplineSurface(
        point_array(spline.control_points),
        *weights,
        real_array(spline.knots_u),
        real_array(spline.knots_v),
        integer_array(spline.multiplicities_u),
        integer_array(spline.multiplicities_v),
        spline.degree_u,
        spline.degree_v,
        False,
        False,
    )


def to_geom_conic(arc: EllipseArc) -> tuple[Any, float, float]:
    """The whole circle or ellipse and the first and last parameter of the arc on it.

    The kernel wants the longer axis first, so the angles of an arc whose `axis_b` is longer shift by a quarter turn.
    """
    a, b, shift = arc.axis_a, arc.axis_b, 0.0
    if not arc.is_circle and np.linalg.norm(b) > np.linalg.norm(a):
        a, b, shift = b, -a, -math.pi / 2
    major, minor = float(np.linalg.norm(a)), float(np.linalg.norm(b))
    axes = _gp.gp_Ax2(point(arc.center), _gp.gp_Dir(*np.cross(a / major, b / minor).tolist()), _gp.gp_Dir(*a.tolist()))
    conic = _Geom.Geom_Circle(axes, major) if arc.is_circle else _Geom.Geom_Ellipse(axes, major, minor)
    first = math.remainder(arc.start + shift, 2 * math.pi)
    if first < 0:
        first += 2 * math.pi
    return conic, first, first + (arc.end - arc.start)


def is_full_ellipse(arc: EllipseArc) -> bool:
    """Whether an arc is all of an ellipse, but for at most a millionth of a turn, and no circle."""
    return not arc.is_circle and arc.end - arc.start > 2 * math.pi * (1 - 1e-6)


def halves(arc: EllipseArc) -> tuple[EllipseArc, EllipseArc]:
    """The arc in two parts of equal angle."""
    middle = (arc.start + arc.end) / 2
    axes = arc.center, arc.axis_a, arc.axis_b
    return EllipseArc(*axes, arc.start, middle), EllipseArc(*axes, middle, arc.end)


def _check_knots(name: str, knots: Array) -> None:
    least = LEAST_KNOT_GAP * max(1.0, float(knots[-1] - knots[0]))
    gap = float(np.diff(knots).min())
    if gap < least:
        where = int(np.diff(knots).argmin())
        raise InputError(
            f"{name} must lie at least {least:.3g} apart for the kernel, got {knots[where]} and {knots[where + 1]}"
        )


# --- from the kernel to arrays ------------------------------------------------------------------------------------


def from_geom_curve(curve: Any) -> BSplineCurve:
    """The arrays of a Geom_BSplineCurve; a periodic or unclamped one is rewritten as a clamped one."""
    curve = _clamped_curve(curve)
    count, knots = curve.NbPoles(), range(1, curve.NbKnots() + 1)
    weights = [curve.Weight(i + 1) for i in range(count)] if curve.IsRational() else None
    return BSplineCurve(
        [_coordinates(curve.Pole(i + 1)) for i in range(count)],
        [curve.Knot(i) for i in knots],
        [curve.Multiplicity(i) for i in knots],
        curve.Degree(),
        weights,
    )


def from_geom_surface(surface: Any) -> BSplineSurface:
    """The arrays of a Geom_BSplineSurface; a periodic or unclamped one is rewritten as a clamped one."""
    surface = _clamped_surface(surface)
    rows, columns = range(1, surface.NbUPoles() + 1), range(1, surface.NbVPoles() + 1)
    knots_u, knots_v = range(1, surface.NbUKnots() + 1), range(1, surface.NbVKnots() + 1)
    rational = surface.IsURational() or surface.IsVRational()
    return BSplineSurface(
        [[_coordinates(surface.Pole(i, j)) for j in columns] for i in rows],
        [surface.UKnot(i) for i in knots_u],
        [surface.UMultiplicity(i) for i in knots_u],
        surface.UDegree(),
        [surface.VKnot(i) for i in knots_v],
        [surface.VMultiplicity(i) for i in knots_v],
        surface.VDegree(),
        [[surface.Weight(i, j) for j in columns] for i in rows] if rational else None,
    )


def _coordinates(pole: Any) -> tuple[float, float, float]:
    return pole.X(), pole.Y(), pole.Z()


def _clamped_curve(curve: Any) -> Any:
    curve = curve.Copy()
    if curve.IsPeriodic():
        curve.SetNotPeriodic()
    ends = {curve.Multiplicity(1), curve.Multiplicity(curve.NbKnots())}
    if ends != {curve.Degree() + 1}:
        curve.Segment(curve.FirstParameter(), curve.LastParameter())
    return curve


def _clamped_surface(surface: Any) -> Any:
    surface = surface.Copy()
    if surface.IsUPeriodic():
        surface.SetUNotPeriodic()
    if surface.IsVPeriodic():
        surface.SetVNotPeriodic()
    ends_u = {surface.UMultiplicity(1), surface.UMultiplicity(surface.NbUKnots())}
    ends_v = {surface.VMultiplicity(1), surface.VMultiplicity(surface.NbVKnots())}
    if ends_u != {surface.UDegree() + 1} or ends_v != {surface.VDegree() + 1}:
        surface.Segment(*surface.Bounds())
    return surface


# --- what a file may hold -----------------------------------------------------------------------------------------

_CURVES = {
    "Geom_BSplineCurve": "B_SPLINE_CURVE",
    "Geom_BezierCurve": "BEZIER_CURVE",
    "Geom_Line": "LINE",
    "Geom_Circle": "CIRCLE",
    "Geom_Ellipse": "ELLIPSE",
    "Geom_Parabola": "PARABOLA",
    "Geom_Hyperbola": "HYPERBOLA",
    "Geom_OffsetCurve": "OFFSET_CURVE_3D",
}
_SURFACES = {
    "Geom_BSplineSurface": "B_SPLINE_SURFACE",
    "Geom_BezierSurface": "BEZIER_SURFACE",
    "Geom_Plane": "PLANE",
    "Geom_CylindricalSurface": "CYLINDRICAL_SURFACE",
    "Geom_ConicalSurface": "CONICAL_SURFACE",
    "Geom_SphericalSurface": "SPHERICAL_SURFACE",
    "Geom_ToroidalSurface": "TOROIDAL_SURFACE",
    "Geom_SurfaceOfLinearExtrusion": "SURFACE_OF_LINEAR_EXTRUSION",
    "Geom_SurfaceOfRevolution": "SURFACE_OF_REVOLUTION",
    "Geom_OffsetSurface": "OFFSET_SURFACE",
}


def _kind(geometry: Any, kinds: dict[str, str]) -> str:
    name = type(geometry).__name__
    return kinds.get(name, name.removeprefix("Geom_"))


def untrimmed(geometry: Any) -> Any:
    """The curve or surface that a trimmed one is a part of."""
    while type(geometry).__name__ in ("Geom_TrimmedCurve", "Geom_RectangularTrimmedSurface"):
        geometry = geometry.BasisCurve() if hasattr(geometry, "BasisCurve") else geometry.BasisSurface()
    return geometry


def is_b_spline(geometry: Any) -> bool:
    """Whether a curve or surface of the kernel is a B-spline as it stands."""
    return type(geometry).__name__ in ("Geom_BSplineCurve", "Geom_BSplineSurface")


def _is_exact(geometry: Any) -> bool:
    """Whether the kernel turns it into a B-spline exactly: everything but offsets and what is made from them."""
    geometry = untrimmed(geometry)
    if hasattr(geometry, "BasisCurve"):
        return "Offset" not in type(geometry).__name__ and _is_exact(geometry.BasisCurve())
    return type(geometry).__name__ in _CURVES.keys() | _SURFACES.keys() - {"Geom_OffsetSurface"}


def exact_curve(curve: Any, first: float, last: float) -> tuple[BSplineCurve | EllipseArc, str]:
    """The part of a kernel curve between two parameters, and its kind in the words of Part 21.

    Raises
    ------
    KernelError
        When the range is unbounded or the curve has no exact rational form.
    """
    curve = untrimmed(curve)
    kind = _kind(curve, _CURVES)
    _check_exact(curve, kind, (first, last))
    if kind in ("CIRCLE", "ELLIPSE"):
        return _ellipse_arc(curve, first, last), kind
    if kind == "LINE":
        ends = [_coordinates(curve.Value(first)), _coordinates(curve.Value(last))]
        return BSplineCurve(ends, [first, last], [2, 2], 1), kind
    if kind not in ("B_SPLINE_CURVE", "BEZIER_CURVE"):
        return from_geom_curve(_GeomConvert.CurveToBSplineCurve_s(_Geom.Geom_TrimmedCurve(curve, first, last))), kind
    spline = _GeomConvert.CurveToBSplineCurve_s(curve)
    if not _is_whole(first, last, spline.FirstParameter(), spline.LastParameter()):
        spline.Segment(first, last)
    return from_geom_curve(spline), kind


def _is_whole(first: float, last: float, start: float, end: float) -> bool:
    return max(abs(first - start), abs(last - end)) <= _SAME * (end - start)


def _ellipse_arc(conic: Any, first: float, last: float) -> EllipseArc:
    radii = (conic.Radius(),) * 2 if hasattr(conic, "Radius") else (conic.MajorRadius(), conic.MinorRadius())
    axes = conic.Position()
    a = radii[0] * np.array(_coordinates(axes.XDirection()))
    b = radii[1] * np.array(_coordinates(axes.YDirection()))
    if last - first > 2 * math.pi and _is_whole(first, last, first, first + 2 * math.pi):
        last = first + 2 * math.pi
    return EllipseArc(_coordinates(conic.Location()), a + 0.0, b + 0.0, first, last)


def exact_surface(surface: Any, bounds: Bounds) -> tuple[BSplineSurface, str, Bounds]:
    """A kernel surface as a B-spline, its kind in the words of Part 21, and the parameter rectangle it covers.

    A B-spline or Bezier surface is taken whole, any other one over `bounds` (u0, u1, v0, v1), which a closed
    direction widens to its full turn if they fill it.

    Raises
    ------
    KernelError
        When the bounds are infinite or the surface has no exact rational form.
    """
    surface = untrimmed(surface)
    kind = _kind(surface, _SURFACES)
    if kind in ("B_SPLINE_SURFACE", "BEZIER_SURFACE"):
        if kind == "B_SPLINE_SURFACE":
            return from_geom_surface(surface), kind, surface.Bounds()
        return from_geom_surface(_GeomConvert.SurfaceToBSplineSurface_s(surface)), kind, surface.Bounds()
    _check_exact(surface, kind, bounds)
    u0, u1 = _full_turn(bounds[0], bounds[1], surface.UPeriod() if surface.IsUPeriodic() else None)
    v0, v1 = _full_turn(bounds[2], bounds[3], surface.VPeriod() if surface.IsVPeriodic() else None)
    # real floats: OCCT 8.0 takes an integer bound for the flag of another constructor
    patch = _Geom.Geom_RectangularTrimmedSurface(surface, float(u0), float(u1), float(v0), float(v1))
    return _snapped(from_geom_surface(_GeomConvert.SurfaceToBSplineSurface_s(patch))), kind, (u0, u1, v0, v1)


def _snapped(spline: BSplineSurface) -> BSplineSurface:
    """Poles that rounding alone keeps apart at the poles and seams of an analytic surface, made equal."""
    points = np.array(spline.control_points)
    slack = _ROUNDING * np.abs(points).max()
    for grid in (points, points.transpose(1, 0, 2)):
        for row in (grid[0], grid[-1]):
            if np.abs(row - row[0]).max() <= slack:
                row[:] = row[0]
        if np.abs(grid[-1] - grid[0]).max() <= slack:
            grid[-1] = grid[0]
    return replace(spline, control_points=points)


def _full_turn(first: float, last: float, period: float | None) -> tuple[float, float]:
    if period is None or abs(last - first - period) > _SAME * period:
        return first, last
    first = 0.0 if abs(first) <= _SAME * period else first
    return first, first + period


def _check_exact(geometry: Any, kind: str, parameters: tuple[float, ...]) -> None:
    if not _is_exact(geometry):
        raise KernelError(f"{kind} has no exact B-spline form")
    if not all(abs(value) < _INFINITE for value in parameters):
        raise KernelError(f"{kind} without bounds cannot become a B-spline, its parameters are {parameters}")
