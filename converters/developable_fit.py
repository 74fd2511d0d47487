"""Ruled B-spline faces of degree (p, 1) for developables, with their deviation and their twist proved.

A spline face through rulings of a developable is itself not quite developable: its tangent plane turns a little along
each ruling. Spline and tangents are polynomials on every knot span, so the angle can be bounded there rigorously, as
``|R| |det(a', b', R)| / (|a' x R| |b' x R|)`` with R = b - a.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gtcad.converters.approximation import Approximation, Bundle
from gtcad.converters.bspline import MAX_DEGREE, BSplineSurface
from gtcad.converters.certificate import certify_surface, deciding
from gtcad.converters.exact import IDENTITY, ParameterMap
from gtcad.converters.fit import Fit, checked_whole, precision_floor
from gtcad.converters.knot_search import adapted
from gtcad.converters.search import Side, fewest
from gtcad.converters.sliding import certify_slid, hodographs, on_spans, slid_poles
from gtcad.converters.spline_basis import Knots
from gtcad.errors import InputError, ToleranceBelowPrecision, ToleranceNotMet
from gtcad.patches._twist import twist_bound
from gtcad.polynomial import Spanned
from gtcad.protocol import SeparableSurface, checked_kind, checked_tolerance

Array = NDArray[np.float64]
Maps = tuple[ParameterMap, ParameterMap]

_PARTS = (1, 2, 4, 8, 16)  # of each knot span, for a proof of the twist
_ENOUGH = 1.1  # a proved twist so near the sampled one needs no finer parts
_ROUNDS = 12  # of tightening
_EAGER = 0.8  # each takes a little more than seems needed
_SPANS_OF_A_FAILURE = 64
_DRAGS = (1.0, 0.5, 2.5)  # tried in this order; with less drag parameters slide farther
_FEW_POLES = 40  # more take long to slide
_NEAR, _HALF, _NEARER = 0.97, 0.5, 0.85  # of the tolerance: what knots, and poles, are searched for
_POINT = 1e-13  # of the size: poles that differ by no more are one
_FAR = 1.5  # times the tolerance: another drag does not help


@dataclass(frozen=True, eq=False)
class DevelopableFit(Fit[BSplineSurface, Maps]):
    """A ruled spline face, and what was proved of it.

    Attributes
    ----------
    twist_deg
        (lower, upper): bounds of the largest angle, in degrees, between the normals of the spline face along one of its
        rulings. The upper one is proved, rounding included; the lower one is attained at a sample.
    tolerance
        The tolerance that the face was fitted with: the one asked for, or a finer one that the twist needed.
    slide
        Bound of how far apart, in u, the parameters are that ``deviation`` holds against each other (see
        ``gtcad.converters.sliding``); 0 for equal ones. Between the boundaries v may differ as well.
    """

    twist_deg: tuple[float, float]
    tolerance: float
    slide: float


def fit_developable(
    patch: SeparableSurface,
    *,
    tolerance: float,
    degree: int = 5,
    max_twist_deg: float | None = None,
    continuity: int | None = None,
    max_spans: int = 4096,
    sliding: bool = True,
) -> DevelopableFit:
    """The ruled B-spline face of degree (p, 1) of the fewest poles that was found within the tolerance, with its proof.

    Parameters
    ----------
    patch
        Linear in v: a developable, or any ruled patch.
    tolerance
        Largest distance allowed, in the patch's unit, above 0. It includes the ``definition_error`` of a developable:
        what is proved is the distance from the exact one.
    degree
        p, 3 to 25.
    max_twist_deg
        Largest angle allowed between the normals of the spline face along one ruling, in degrees; the tolerance is made
        finer until the proved angle is within it.
    continuity
        Continuity at interior knots, 0 to p - 1; p - 1 unless given.
    max_spans
        Largest number of knot spans.
    sliding
        Whether parameters may be held against slightly different ones where that saves poles: point sets and
        boundaries are within the tolerance all the same. For developables of up to 40 poles a row, without
        ``max_twist_deg``. False for a face that shares knots with others.

    Raises
    ------
    InputError
        When an argument is out of its range, or the patch is not linear in v.
    ToleranceBelowPrecision
        When double precision cannot prove the tolerance for coordinates of this size.
    ToleranceNotMet
        When ``max_spans`` are not enough, or no fit that can be proved has so little twist: ``requested`` and
        ``achieved`` are degrees then.

    Examples
    --------
    A quarter of a cylinder, as its tangent planes envelop it:

    >>> from gtcad.patches import PlaneFamily
    >>> planes = PlaneFamily([[1, 0, 0, 20], [1, 1, 0, 20], [0, 1, 0, 20]])
    >>> fit = fit_developable(planes.enveloping([0, 0, 1, 0], [0, 0, 1, 30]), tolerance=1e-4)
    >>> fit.deviation[1] <= 1e-4, fit.twist_deg[1] < 1e-9
    (True, True)
    """
    checked_kind("patch", patch, SeparableSurface, "a patch that is linear in v")
    if patch.factors_v.derivative_bound(2) != 0 or patch.dimension != 3:
        raise InputError(f"patch must be linear in v, in space, got {type(patch).__name__}")
    if max_twist_deg is not None and not (isinstance(max_twist_deg, int | float) and 0 < max_twist_deg < math.inf):
        raise InputError(f"max_twist_deg must be a finite number above 0, got {max_twist_deg!r}")
    degree = checked_whole("degree", degree, 3, MAX_DEGREE)
    if continuity is not None:
        continuity = checked_whole("continuity", continuity, 0, degree - 1)
    max_spans = checked_whole("max_spans", max_spans, 1, None)
    tolerance = checked_tolerance(tolerance)
    side = Side(_boundaries(patch), (degree,), continuity, 0, max_spans)
    sliding = sliding and max_twist_deg is None
    found = _fitted(patch, side, tolerance, sliding)
    for _ in range(_ROUNDS):
        if max_twist_deg is None or found.twist_deg[1] <= max_twist_deg:
            return found
        finer = found.tolerance * min(0.5, _EAGER * max_twist_deg / found.twist_deg[1])
        finer = max(finer, min(1.01 * _floor(patch), 0.5 * found.tolerance))
        try:
            found = _fitted(patch, side, finer, sliding)
        except (ToleranceBelowPrecision, ToleranceNotMet):
            break
    if max_twist_deg is None or found.twist_deg[1] <= max_twist_deg:
        return found
    spans = len(found.spline.knots_u) - 1
    limit = f"these are degrees between normals along a ruling, of the finest fit tried, at {found.tolerance:.3g}"
    raise ToleranceNotMet(max_twist_deg, found.twist_deg[1], spans, limit)


def _boundaries(patch: SeparableSurface) -> Bundle:
    """Both boundaries as one bundle of curves: what is linear between them needs no more."""
    rows = patch.factors_v.rows(np.array([0.0, 1.0]))
    return Bundle(patch.factors_u, np.einsum("ijd,jk->ikd", patch.coefficients, rows))


def _floor(patch: SeparableSurface) -> float:
    size = float(np.sqrt((patch.coefficients**2).sum(axis=-1)).max())
    return size * precision_floor((patch.factors_u, patch.factors_v)) + patch.definition_error


@dataclass(frozen=True, eq=False)
class _Found:
    """A face that keeps the tolerance."""

    spline: BSplineSurface
    deviation: tuple[float, float]
    slide: float = 0.0


def _fitted(patch: SeparableSurface, side: Side, tolerance: float, sliding: bool) -> DevelopableFit:
    if tolerance < (floor := _floor(patch)):
        raise ToleranceBelowPrecision(tolerance, floor)
    least = math.inf

    def proof(one: Approximation) -> _Found | None:
        nonlocal least
        spline = _face(one.knots, _poles(one, side.bundle))
        certificate = deciding(lambda **how: certify_surface(patch, spline, **how), tolerance)
        least = min(least, certificate.upper)
        return _Found(spline, (certificate.lower, certificate.upper)) if certificate.upper <= tolerance else None

    found = fewest(side, tolerance, proof, adapt=True)
    if found is None:
        proof(side.best_of(min(side.max_spans, _SPANS_OF_A_FAILURE)))
        raise ToleranceNotMet(tolerance, least, side.max_spans, f"max_spans = {side.max_spans}")
    while sliding and (better := _with_fewer(side, found, tolerance, patch.definition_error)) is not None:
        found = better
    twist = spline_twist_deg(found.spline)
    return DevelopableFit(
        found.spline, found.deviation, False, (IDENTITY, IDENTITY), twist, tolerance, slide=found.slide
    )


def _with_fewer(side: Side, found: _Found, tolerance: float, definition_error: float) -> _Found | None:
    """A face with fewer poles whose parameters slide."""
    count = len(found.spline.control_points)
    if not side.least < count <= _FEW_POLES:
        return None
    for goal in (_NEAR, _HALF):  # from knots of the one search and of the other
        one = _start(side, count - 1, goal * tolerance)
        if one is None or one.knots.poles >= count:
            continue
        start = _poles(one, side.bundle)
        for drag in _DRAGS:
            poles = slid_poles(side.bundle, one.knots, start, _NEARER * tolerance, drag)
            slid = certify_slid(side.bundle, one.knots, poles, tolerance, definition_error)
            if slid.upper <= tolerance:
                return _Found(_face(one.knots, poles), (slid.lower, slid.upper), slid.slide)
            if slid.lower > _FAR * tolerance:
                break
    return None


def _start(side: Side, poles: int, goal: float) -> Approximation | None:
    """An approximation at equal parameters: its knots are moved however far off the goal they begin."""
    (degree,) = side.degrees
    if side.continuity in (None, degree - 1):
        return adapted(side.bundle, degree, min(poles - degree, side.max_spans), goal=goal)
    return side.kind(poles)


def _poles(one: Approximation, bundle: Bundle) -> Array:
    """Poles of both boundaries; all the same for one that is a point but for rounding, the apex of a cone."""
    poles = np.einsum("pi,ikd->pkd", one.matrix, bundle.vectors)
    spread = np.abs(poles - poles[:1]).max(axis=(0, 2))
    return np.asarray(np.where((spread <= _POINT * np.abs(poles).max())[:, None], poles[:1], poles))


def _face(knots: Knots, poles: Array) -> BSplineSurface:
    return BSplineSurface(poles, knots.breaks, knots.multiplicities, knots.degree, (0.0, 1.0), (2, 2), 1)


def spline_twist_deg(spline: BSplineSurface) -> tuple[float, float]:
    """Bounds of the largest angle between the normals of a ruled spline face along one of its rulings, in degrees.

    Parameters
    ----------
    spline
        Of degree 1 with two rows of poles in v, without weights.

    Returns
    -------
    tuple
        (lower, upper): attained at a sample, and proved, rounding included; infinite when a ruling has no length or no
        tangent plane at an end, or nearly so.

    Raises
    ------
    InputError
        When the spline is of another kind.
    """
    if (
        spline.degree_v != 1
        or spline.control_points.shape[1] != 2
        or spline.weights is not None
        or spline.dimension != 3
    ):
        raise InputError("the spline must be of degree 1 with two rows of poles in v, without weights, in space")
    lower, upper = 0.0, math.inf
    for slopes, along in _spanned(spline):
        first, second = (slope.cross(along).values for slope in slopes)
        sine = np.linalg.norm(np.cross(first, second), axis=-1)
        lower = max(lower, float(np.arctan2(sine, (first * second).sum(axis=-1)).max()))
        upper = min(upper, twist_bound(*slopes, along))
        if upper <= _ENOUGH * lower:
            break
    return math.degrees(min(lower, upper)), math.degrees(upper)


def _spanned(spline: BSplineSurface) -> Iterator[tuple[tuple[Spanned, Spanned], Spanned]]:
    """The derivatives of both rows of poles and their difference, on finer and finer parts of the knot spans."""
    knots = Knots.normalised(spline.knots_u, spline.multiplicities_u, spline.degree_u)
    rows = np.moveaxis(spline.control_points, 1, 0)
    slopes, poles_of = hodographs(knots, rows)
    for parts in _PARTS:
        first, second = (on_spans(slopes.subdivided(parts), poles, 4) for poles in poles_of)
        yield (first, second), on_spans(knots.subdivided(parts), rows[1] - rows[0], 1)
