"""What build123d and CadQuery have in common: core shapes as shapes of the kernel, and back.

All lengths are in mm. Each shape of the kernel comes with the exact shape and the proof, in a `Made`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np

from gtcad.composite import Composite
from gtcad.converters.bspline import BSplineCurve, BSplineSurface
from gtcad.converters.chain import ChainFit, fit_chain
from gtcad.converters.face_designs import FaceDesign, design_from_face
from gtcad.converters.fit import Degree, Fit, fit_curve, fit_surface
from gtcad.converters.host_designs import (
    DEFAULT_DEGREE,
    DEFAULT_TOLERANCE,
    HostCurve,
    core_of_edge,
    core_of_face,
    design_from_edge,
)
from gtcad.converters.host_joins import FaceJoin, curve_on_edge, patch_on_face
from gtcad.converters.outlines import plane_face, straightened, wire_of, with_exact_edges
from gtcad.converters.part import EllipseArc, Wire
from gtcad.converters.quadrics import Quadric
from gtcad.converters.quilt_fit import QuiltFit, fit_quilt
from gtcad.converters.smooth_edges import closing_orders, with_smooth_edges
from gtcad.converters.solid import Body, solid_of, thicken
from gtcad.errors import InputError
from gtcad.protocol import SeparableCurve, SeparableSurface, Shape
from gtcad.quilt import Quilt
from gtcad.solid import Solid

__all__ = [
    "DEFAULT_DEGREE",
    "DEFAULT_TOLERANCE",
    "AnalyticFit",
    "AnyFit",
    "Core",
    "FaceDesign",
    "FaceJoin",
    "HostCurve",
    "Made",
    "choose_geometry",
    "core_of_edge",
    "core_of_face",
    "curve_on_edge",
    "design_from_edge",
    "design_from_face",
    "fitted_quilt",
    "made_edge",
    "made_face",
    "made_shell",
    "made_solid",
    "made_wire",
    "patch_on_face",
]

Core = Shape | Composite | Quilt | Solid
Exact = TypeVar("Exact", bound=Core)

_QUILT_SETTINGS = ("degree", "continuity", "max_spans", "max_degree", "adapt")


@dataclass(frozen=True, eq=False)
class AnalyticFit:
    """An analytic curve or surface that is the shape itself, and what was proved of it.

    Attributes
    ----------
    geometry
        In mm.
    deviation
        (lower, upper) in mm, the upper one proved: rounding.
    """

    geometry: EllipseArc | Quadric
    deviation: tuple[float, float]

    @property
    def exact(self) -> bool:
        """True: up to rounding it is the shape."""
        return True


AnyFit = Fit[Any, Any] | AnalyticFit | ChainFit | QuiltFit


@dataclass(frozen=True, eq=False)
class Made(Generic[Exact]):
    """A shape of the kernel, what it stands for, and how far it is from that.

    Attributes
    ----------
    shape
        TopoDS_Edge, _Wire, _Face, _Shell or _Solid, valid by the kernel's own check; in mm.
    exact
        The shape of gtcad.
    fit
        What was fitted; its ``deviation`` is that of the faces or edges of the shape's own patches and curves.
    deviation
        (lower, upper) in mm, of all of the shape.
    proved
        Whether the upper bound is proved: always, but for the offset faces of walls, which are estimated.
    body
        Volume, area and named faces of a solid; None of others.
    """

    shape: Any
    exact: Exact
    fit: AnyFit
    deviation: tuple[float, float]
    proved: bool = True
    body: Body | None = None

    def __deepcopy__(self, memo: dict[int, Any]) -> Made[Exact]:
        """Itself, as it never changes: hosts copy the attributes of their shapes."""
        return self


# --- which geometry ---------------------------------------------------------------------------------------------------


def choose_geometry(
    shape: Shape | Composite, *, tolerance: float = DEFAULT_TOLERANCE, **settings: Any
) -> tuple[BSplineCurve | BSplineSurface | EllipseArc | Quadric | Wire, Fit[Any, Any] | AnalyticFit | ChainFit]:
    """What a kernel or a file should hold of a curve, chain or patch, and what was proved of it.

    Arcs of ellipses, planes, cylinders, cones, spheres and tori go as such, unless ``exact`` is False; a chain with
    several edges as a `Wire`; all else as a B-spline.

    Parameters
    ----------
    shape
        In mm.
    tolerance, settings
        Of ``fit_curve``, ``fit_chain`` or ``fit_surface``.

    Raises
    ------
    InputError, ToleranceBelowPrecision, ToleranceNotMet
        As these.
    """
    if isinstance(shape, Composite):
        chain = fit_chain(shape, tolerance=tolerance, **settings)
        return (chain.edges[0] if len(chain.edges) == 1 else Wire(chain.edges)), chain
    if isinstance(shape, SeparableCurve):
        fit = fit_curve(shape, tolerance=tolerance, **settings)
        arc = _as_arc(shape) if fit.exact else None
        return (arc.geometry, arc) if arc else (fit.spline, fit)
    quadric = _as_quadric(shape, tolerance) if settings.get("exact", True) else None
    if quadric is not None:
        return quadric.geometry, quadric
    patch = fit_surface(shape, tolerance=tolerance, **settings)
    return patch.spline, patch


def _as_arc(curve: SeparableCurve) -> AnalyticFit | None:
    from gtcad.converters.arcs import certify_arc, ellipse_arc

    spatial = curve if curve.dimension == 3 else curve.transformed(np.eye(3, 2))
    arc = ellipse_arc(spatial)
    if arc is None:
        return None
    proved = certify_arc(spatial, arc)
    return AnalyticFit(arc, (proved.lower, proved.upper))


def _as_quadric(surface: SeparableSurface, tolerance: float) -> AnalyticFit | None:
    from gtcad.converters.analytic import certify_quadric, quadric_of

    quadric = quadric_of(surface)
    if quadric is None:
        return None
    proved = certify_quadric(surface, quadric)
    return AnalyticFit(quadric, (proved.lower, proved.upper)) if proved.upper <= tolerance else None


# --- shapes of the kernel ---------------------------------------------------------------------------------------------


def made_edge(
    curve: SeparableCurve | Composite,
    *,
    tolerance: float = DEFAULT_TOLERANCE,
    degree: Degree = DEFAULT_DEGREE,
    **settings: Any,
) -> Made[SeparableCurve | Composite]:
    """One edge: a line, an arc of an ellipse, or a B-spline.

    Parameters
    ----------
    curve
        In mm; a plane one lies at z = 0. A chain must be one edge: an arc, or pieces joined C1 to C3.
    tolerance, degree, settings
        As of ``choose_geometry``.

    Raises
    ------
    InputError
        When the chain has several edges, or an argument is out of its range.
    ToleranceBelowPrecision, ToleranceNotMet, KernelError
        When the fit fails or the kernel refuses the edge.
    """
    from gtcad.converters.occt.topology import make_edge

    _check_kind(curve, "curve", SeparableCurve, Composite)
    geometry, fit = choose_geometry(curve, tolerance=tolerance, degree=degree, **settings)
    if isinstance(geometry, Wire):
        raise InputError(f"this chain has {len(geometry.edges)} edges, not one: make a wire of it")
    assert isinstance(geometry, BSplineCurve | EllipseArc)
    return Made(straightened(make_edge(geometry), geometry), curve, fit, fit.deviation)


def made_wire(
    curve: SeparableCurve | Composite,
    *,
    tolerance: float = DEFAULT_TOLERANCE,
    degree: Degree = DEFAULT_DEGREE,
    **settings: Any,
) -> Made[SeparableCurve | Composite]:
    """The wire of a chain, its edges sharing their vertices; or of one curve.

    Straight pieces are lines and arcs arcs, unless ``exact`` is False or they share a spline with others, joined C1 to
    C3.

    Raises
    ------
    InputError, ToleranceBelowPrecision, ToleranceNotMet, KernelError
        As ``made_edge``.
    """
    _check_kind(curve, "curve", SeparableCurve, Composite)
    geometry, fit = choose_geometry(curve, tolerance=tolerance, degree=degree, **settings)
    if isinstance(fit, ChainFit):
        fit = with_exact_edges(fit, tolerance) if settings.get("exact", True) else fit
        return Made(wire_of(Wire(fit.edges)), curve, fit, fit.deviation)
    assert isinstance(geometry, BSplineCurve | EllipseArc)
    return Made(wire_of(Wire((geometry,))), curve, fit, fit.deviation)


def made_face(
    surface: SeparableSurface,
    *,
    tolerance: float = DEFAULT_TOLERANCE,
    degree: Degree = DEFAULT_DEGREE,
    **settings: Any,
) -> Made[SeparableSurface]:
    """One face: of a plane, cylinder, cone, sphere, torus or B-spline surface, with the patch's normal.

    Parameters
    ----------
    surface
        In mm; a patch in the plane, d = 2, becomes a face of the plane z = 0 with its normal upwards.
    tolerance, degree, settings
        As of ``choose_geometry``.

    Raises
    ------
    InputError, ToleranceBelowPrecision, ToleranceNotMet, KernelError
        As ``made_edge``.
    """
    from gtcad.converters.occt.compat import as_face
    from gtcad.converters.occt.quadrics import make_quadric_face
    from gtcad.converters.occt.topology import make_face

    _check_kind(surface, "surface", SeparableSurface)
    if closing_orders(surface) != ((0, 0), (0, 0)):
        settings.setdefault("end_order", closing_orders(surface))
    geometry, fit = choose_geometry(surface, tolerance=tolerance, degree=degree, **settings)
    if isinstance(geometry, Quadric):
        shape = as_face(make_quadric_face(geometry))
    else:
        assert isinstance(geometry, BSplineSurface)
        shape = plane_face(geometry) if geometry.dimension == 2 else make_face(geometry)
    return Made(shape, surface, fit, fit.deviation)


def made_shell(
    quilt: Quilt,
    *,
    tolerance: float = DEFAULT_TOLERANCE,
    degree: Degree = DEFAULT_DEGREE,
    **settings: Any,
) -> Made[Quilt]:
    """The shell of a quilt, its faces sharing their edges: one for each patch, in order.

    Edges that the patches cross smoothly are smooth, whatever order is stated.

    Raises
    ------
    InputError, ToleranceBelowPrecision, ToleranceNotMet, KernelError
        As ``fit_quilt`` and ``make_shell``.
    """
    from gtcad.converters.occt.shells import make_shell

    _check_kind(quilt, "quilt", Quilt)
    fit = fitted_quilt(with_smooth_edges(quilt), tolerance=tolerance, degree=degree, **settings)
    return Made(make_shell(fit.splines, quilt.edges, quilt.flipped).shape, quilt, fit, fit.deviation)


def made_solid(
    solid: Solid | Quilt,
    *,
    tolerance: float = DEFAULT_TOLERANCE,
    degree: Degree = DEFAULT_DEGREE,
    **settings: Any,
) -> Made[Solid]:
    """The solid inside a closed or capped quilt, or the wall along it; a `Quilt` is taken for what it encloses.

    Raises
    ------
    InputError, ToleranceBelowPrecision, ToleranceNotMet, KernelError
        As ``fit_quilt``, ``solid_of`` and ``thicken``.
    """
    _check_kind(solid, "solid", Solid, Quilt)
    meant = Solid(solid) if isinstance(solid, Quilt) else solid
    fit = fitted_quilt(with_smooth_edges(meant.quilt), tolerance=tolerance, degree=degree, **settings)
    if meant.thickness is None:
        body = solid_of(fit, caps=meant.caps)
    else:
        body = thicken(fit, meant.thickness, tolerance=tolerance, caps=meant.caps)
    return Made(body.shape, meant, fit, (fit.deviation[0], body.deviation), body.proved, body)


def fitted_quilt(quilt: Quilt, *, tolerance: float, **settings: Any) -> QuiltFit:
    """``fit_quilt`` with those settings of a fit that it takes."""
    return fit_quilt(quilt, tolerance=tolerance, **{key: settings[key] for key in _QUILT_SETTINGS if key in settings})


def _check_kind(shape: object, name: str, *kinds: type) -> None:
    if not isinstance(shape, kinds):
        allowed = " or ".join(kind.__name__ for kind in kinds)
        raise InputError(f"{name} must be a {allowed} of gtcad, got {type(shape).__name__}")
