"""From a separable shape to the B-spline with the fewest poles that keeps a tolerance, proved.

A tolerance is kept or refused: the result's deviation is a certificate's, not a sample's, and lies within the
tolerance, or ToleranceNotMet is raised.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Generic, Literal, TypeGuard, TypeVar

import numpy as np
from numpy.typing import NDArray

from gtcad.chebyshev import UNIT_ROUNDOFF, nodes
from gtcad.converters.approximation import Approximation, Bundle
from gtcad.converters.bspline import MAX_DEGREE, BSplineCurve, BSplineSurface
from gtcad.converters.certificate import Certificate, certify_curve, certify_surface
from gtcad.converters.exact import IDENTITY, ParameterMap, exact_curve, exact_surface, polynomial_form
from gtcad.converters.search import Side, fewest, fewest_pair
from gtcad.converters.spline_basis import EndOrder
from gtcad.errors import InputError, ToleranceBelowPrecision, ToleranceNotMet
from gtcad.factors import KeyedFactors
from gtcad.protocol import Factors, SeparableCurve, SeparableSurface, checked_kind, checked_tolerance

Array = NDArray[np.float64]
Degree = int | Literal["auto"]
Spline = TypeVar("Spline", BSplineCurve, BSplineSurface)
Maps = TypeVar("Maps", ParameterMap, tuple[ParameterMap, ParameterMap])

_LEAST_DEGREE = 3
_MAX_END_ORDER = 3
_SPANS_OF_A_FAILURE = 64  # a surface that fails is not tried with the full limit, only to name a figure
_COARSE, _FINE = 0.01, 0.001  # relative width of a certificate, and of one that decides a near miss
_TAIL = 1e-3  # of the tolerance may go into the tails of series, unless that widens the certificate
_LOOSE = 1.02
_SNAP = 64 * UNIT_ROUNDOFF  # of the size: poles that differ by less were meant to be equal


@dataclass(frozen=True, eq=False)
class Fit(Generic[Spline, Maps]):
    """A spline and what was proved of it.

    Attributes
    ----------
    spline
        Clamped, not periodic, on [0, 1].
    deviation
        (lower, upper): bounds of the largest distance at corresponding parameters, in the shape's unit. The upper
        one is proved, rounding included, and bounds the distance of the point sets; the lower one is attained.
    exact
        Whether the spline is the shape itself, up to rounding.
    parameter_map
        The shape's parameter that each of the spline's corresponds to; one for each direction of a surface.
    """

    spline: Spline
    deviation: tuple[float, float]
    exact: bool
    parameter_map: Maps


def fit_curve(
    curve: SeparableCurve,
    *,
    tolerance: float,
    degree: Degree = 5,
    continuity: int | None = None,
    end_order: EndOrder = 0,
    exact: Literal["auto"] | bool = "auto",
    max_spans: int = 4096,
    max_degree: int = 11,
    adapt: bool = True,
) -> Fit[BSplineCurve, ParameterMap]:
    """The B-spline of the fewest poles that was found within the tolerance of a curve, with its proof.

    Parameters
    ----------
    curve
        Any curve of the protocol.
    tolerance
        Largest distance allowed, in the curve's unit, above 0.
    degree
        3 to 25, or "auto": the degree up to ``max_degree`` that needs the fewest poles, the lower one on a tie.
    continuity
        Continuity at interior knots, 0 to degree - 1; degree - 1 unless given.
    end_order
        0 to 3: derivatives 0..end_order are exact at both ends, so that a join of the curve is one of the spline. A
        pair (start, end) has an order of its own at t = 0 and at t = 1: an end without a join needs no more than 0.
    exact
        "auto": an exact form (rational or polynomial, degree 1, 2, 4 or the curve's own) where there is one and
        end_order is 0; False: never; True: an exact form or an InputError.
    max_spans
        Largest number of knot spans.
    max_degree
        Largest degree that "auto" takes, 3 to 25.
    adapt
        Move the knots for this curve as long as that saves poles (tens of milliseconds). False keeps to operators
        that are cached for curves of one kind: more poles, below a millisecond for the next one.

    Raises
    ------
    InputError
        When an argument is out of its range.
    ToleranceBelowPrecision
        When double precision cannot prove the tolerance for coordinates of this size.
    ToleranceNotMet
        When ``max_spans`` are not enough.

    Examples
    --------
    >>> from gtcad import Curve
    >>> arc = Curve([[0, 0], [30, 70], [70, -20], [100, 30]], gamma=(0.4, -0.6))
    >>> fit = fit_curve(arc, tolerance=1e-4)
    >>> fit.deviation[1] <= 1e-4
    True
    """
    checked_kind("curve", curve, SeparableCurve, "one curve (fit_chain takes chains, fit_surface surfaces)")
    ends = (_checked_ends("end_order", end_order),)
    options = _Options.checked(tolerance, degree, continuity, ends, exact, max_spans, max_degree)
    if options.exact_allowed and (form := exact_curve(curve)) is not None:
        certificate = certify_curve(curve, form[0], parameter_map=form[1])
        if certificate.upper <= tolerance:
            return Fit(form[0], (certificate.lower, certificate.upper), True, form[1])
    options.refuse_inexact()
    options.refuse_below_floor((curve.factors,), curve.coefficients)
    side = options.side(Bundle(curve.factors, curve.coefficients[:, None, :]), ends[0])
    attempt = _Attempt(tolerance)

    def proof(one: Approximation) -> _Proved[BSplineCurve] | None:
        spline = _curve_spline(one, curve)
        return attempt.prove(spline, lambda **how: certify_curve(curve, spline, **how), one)

    proved = fewest(side, tolerance, proof, adapt=adapt)
    if proved is None:
        proof(side.best_of(options.max_spans))
        raise attempt.failure(f"max_spans = {max_spans}")
    return Fit(proved.spline, proved.deviation, False, IDENTITY)


def fit_surface(
    surface: SeparableSurface,
    *,
    tolerance: float,
    degree: Degree = 5,
    continuity: int | None = None,
    end_order: int | tuple[tuple[int, int], tuple[int, int]] = 0,
    exact: Literal["auto"] | bool = "auto",
    max_spans: int = 4096,
    max_degree: int = 11,
    adapt: bool = True,
) -> Fit[BSplineSurface, tuple[ParameterMap, ParameterMap]]:
    """The B-spline surface of the fewest poles that was found within the tolerance of a surface, with its proof.

    The arguments are those of ``fit_curve`` and hold for both directions; ``end_order`` may also be
    ``((u0, u1), (v0, v1))``, the orders at u = 0, u = 1, v = 0 and v = 1. A direction of classical Bezier factors
    keeps their own degree where that needs fewer poles, unless ``exact`` is False. Boundary rows of poles that are
    meant to coincide (collapsed or closed patches) are made equal before the proof.

    Raises
    ------
    InputError, ToleranceBelowPrecision, ToleranceNotMet
        As ``fit_curve``; ``max_spans`` counts the spans of each direction.
    """
    checked_kind("surface", surface, SeparableSurface, "one surface (fit_quilt takes quilts, fit_curve curves)")
    ends = _checked_surface_ends(end_order)
    options = _Options.checked(tolerance, degree, continuity, ends, exact, max_spans, max_degree)
    if options.exact_allowed and (form := exact_surface(surface)) is not None:
        spline = form[0].with_control_points(_snapped(form[0].control_points))
        certificate = certify_surface(surface, spline, parameter_maps=form[1])
        if certificate.upper <= tolerance:
            return Fit(spline, (certificate.lower, certificate.upper), True, form[1])
    options.refuse_inexact()
    options.refuse_below_floor((surface.factors_u, surface.factors_v), surface.coefficients)
    u, v = (options.side(bundle, pair) for bundle, pair in zip(_bundles(surface), ends, strict=True))
    attempt = _Attempt(tolerance)

    def proof(a: Approximation, b: Approximation) -> _Proved[BSplineSurface] | None:
        spline = _surface_spline(a, b, surface)
        return attempt.prove(spline, lambda **how: certify_surface(surface, spline, **how), a, b)

    proved = fewest_pair(u, v, tolerance, proof, surface.coefficients, adapt=adapt)
    if proved is None:
        proof(*(side.best_of(min(options.max_spans, _SPANS_OF_A_FAILURE)) for side in (u, v)))
        raise attempt.failure(f"max_spans = {max_spans} in each direction")
    return Fit(proved.spline, proved.deviation, False, (IDENTITY, IDENTITY))


@dataclass(frozen=True)
class _Proved(Generic[Spline]):
    spline: Spline
    deviation: tuple[float, float]


class _Attempt:
    """Proofs of one fit: what passes, and the best that did not."""

    def __init__(self, tolerance: float) -> None:
        self.tolerance = tolerance
        self.least, self.spans = math.inf, 0

    def prove(
        self, spline: Spline, certify: Callable[..., Certificate], *approximations: Approximation
    ) -> _Proved[Spline] | None:
        """The spline with its deviation when that is within the tolerance."""
        certificate = certify(rtol=_COARSE, resolution=_TAIL * self.tolerance, limit=self.tolerance)
        if certificate.lower <= self.tolerance < certificate.upper:
            certificate = certify(rtol=_FINE)
        elif (
            self.tolerance >= certificate.upper > _LOOSE * certificate.lower
        ):  # the spline is far better than asked for
            certificate = certify(rtol=_COARSE)
        if certificate.upper < self.least:
            self.least = certificate.upper
            self.spans = math.prod(one.knots.spans for one in approximations)
        if certificate.upper > self.tolerance:
            return None
        return _Proved(spline, (certificate.lower, certificate.upper))

    def failure(self, limit: str) -> ToleranceNotMet:
        return ToleranceNotMet(self.tolerance, self.least, self.spans, limit)


@dataclass(frozen=True)
class _Options:
    """The checked arguments that both fits share."""

    tolerance: float
    degrees: tuple[int, ...]
    continuity: int | None
    ends: tuple[tuple[int, int], ...]  # of each direction
    exact: Literal["auto"] | bool
    max_spans: int

    @classmethod
    def checked(
        cls,
        tolerance: float,
        degree: Degree,
        continuity: int | None,
        ends: tuple[tuple[int, int], ...],
        exact: Literal["auto"] | bool,
        max_spans: int,
        max_degree: int,
    ) -> _Options:
        tolerance = checked_tolerance(tolerance)
        if degree == "auto":
            checked_whole("max_degree", max_degree, _LEAST_DEGREE, MAX_DEGREE)
            degrees = tuple(range(_LEAST_DEGREE, max_degree + 1))
        else:
            checked_whole("degree", degree, _LEAST_DEGREE, MAX_DEGREE, also='"auto"')
            degrees = (degree,)
        if continuity is not None:
            checked_whole("continuity", continuity, 0, max(degrees) - 1)
            degrees = tuple(one for one in degrees if one > continuity)
        checked_whole("max_spans", max_spans, 1, None)
        if exact not in ("auto", True, False):
            raise InputError(f'exact must be "auto", True or False, got {exact!r}')
        return cls(tolerance, degrees, continuity, ends, exact, max_spans)

    @property
    def exact_allowed(self) -> bool:
        """Whether an exact form may stand for the piece: its parameter is its own, so no join may depend on it."""
        return self.exact is not False and not any(map(any, self.ends))

    def refuse_inexact(self) -> None:
        if self.exact is True:
            raise InputError("exact=True, but there is no exact form of this piece at end_order 0 and this tolerance")

    def refuse_below_floor(self, factors: tuple[Factors, ...], coefficients: Array) -> None:
        size = float(np.sqrt((coefficients**2).sum(axis=-1)).max())
        floor = size * precision_floor(factors)
        if self.tolerance < floor:
            raise ToleranceBelowPrecision(self.tolerance, floor)

    def side(self, bundle: Bundle, ends: tuple[int, int]) -> Side:
        polynomial = None if self.exact is False else polynomial_form(bundle.factors)
        side = Side(bundle, self.degrees, self.continuity, ends, self.max_spans, polynomial)
        if side.most < side.least:
            order = ends[0] if ends[0] == ends[1] else ends
            room = f"{side.most} poles at most, and end_order {order} takes {side.least}"
            raise InputError(f"max_spans = {self.max_spans} and degree up to {max(self.degrees)} give {room}")
        return side


def precision_floor(factors: tuple[Factors, ...]) -> float:
    """Least tolerance, relative to the largest coefficient, that a certificate can prove over its own rounding."""
    units = sum(one.rounding / UNIT_ROUNDOFF + one.count + 60 for one in factors)
    return 2 * units * UNIT_ROUNDOFF * 3.0 ** len(factors)


def _checked_ends(name: str, value: object) -> tuple[int, int]:
    """The orders at the start and at the end, from one for both or a pair."""
    if not _is_pair(value):
        order = checked_whole(name, value, 0, _MAX_END_ORDER, also="a pair of such")
        return order, order
    start, end = (checked_whole(f"{name}[{place}]", order, 0, _MAX_END_ORDER) for place, order in enumerate(value))
    return start, end


def _checked_surface_ends(value: object) -> tuple[tuple[int, int], tuple[int, int]]:
    if not (_is_pair(value) and all(map(_is_pair, value))):
        order = checked_whole("end_order", value, 0, _MAX_END_ORDER, also="((u0, u1), (v0, v1)) of such")
        return (order, order), (order, order)
    return _checked_ends("end_order[0]", value[0]), _checked_ends("end_order[1]", value[1])


def _is_pair(value: object) -> TypeGuard[Sequence[Any]]:
    return isinstance(value, Sequence) and not isinstance(value, str) and len(value) == 2


def checked_whole(name: str, value: object, least: int, most: int | None, also: str = "") -> int:
    """A whole number in [least, most], or from ``least`` on; ``also`` says in words what else is allowed."""
    whole = int(value) if isinstance(value, (int, np.integer)) and not isinstance(value, bool) else None
    if whole is not None and whole >= least and (most is None or whole <= most):
        return whole
    allowed = f"from {least}" if most is None else f"in [{least}, {most}]"
    raise InputError(f"{name} must be a whole number {allowed}{' or ' + also if also else ''}, got {value!r}")


def _bundles(surface: SeparableSurface) -> tuple[Bundle, Bundle]:
    """The curves of each direction through places of the other one."""
    places_u, places_v = (_places(KeyedFactors(factors)) for factors in (surface.factors_u, surface.factors_v))
    along_u = places_v @ surface.coefficients
    along_v = places_u @ surface.coefficients.swapaxes(0, 1)
    return Bundle(surface.factors_u, along_u), Bundle(surface.factors_v, along_v)


@lru_cache(maxsize=128)
def _places(kept: KeyedFactors) -> Array:
    """Values of the factors at places that cover their domain, shape (places, count)."""
    t = np.concatenate([[0.0], (nodes(2 * kept.factors.count + 3) + 1) / 2, [1.0]])
    return np.ascontiguousarray(kept.factors.rows(t).T)


def _curve_spline(one: Approximation, curve: SeparableCurve) -> BSplineCurve:
    poles = one.matrix @ curve.coefficients
    if _coincide(poles[0], poles[-1], poles):
        poles[-1] = poles[0]
    return BSplineCurve(poles, one.knots.breaks, one.knots.multiplicities, one.knots.degree)


def _surface_spline(a: Approximation, b: Approximation, surface: SeparableSurface) -> BSplineSurface:
    lines = b.matrix @ surface.coefficients  # (count of u, poles of v, d)
    poles = (a.matrix @ lines.reshape(len(lines), -1)).reshape(-1, *lines.shape[1:])
    return BSplineSurface(
        _snapped(poles),
        a.knots.breaks,
        a.knots.multiplicities,
        a.knots.degree,
        b.knots.breaks,
        b.knots.multiplicities,
        b.knots.degree,
    )


def _snapped(poles: Array) -> Array:
    """The same poles with boundary rows made equal that coincide, and collapsed ones made one point."""
    poles = np.array(poles)
    for rows in (poles, poles.swapaxes(0, 1)):
        for row in (rows[0], rows[-1]):
            if _coincide(row, row[:1], poles):
                row[:] = row[0]
        if _coincide(rows[0], rows[-1], poles):
            rows[-1] = rows[0]
    return poles


def _coincide(a: Array, b: Array, poles: Array) -> bool:
    return bool(np.abs(a - b).max() <= _SNAP * np.abs(poles).max())
