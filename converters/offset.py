"""From an offset curve to a B-spline within a tolerance, proved.

An offset O = C + distance N is no finite sum of factors, so the certificate bounds the residual of its defining
equations instead. With w = s - C for the spline s, T = C' / |C'| and N in the plane of the curve,

    alpha = w.T,    beta = w.N,    |s - O|^2 = alpha^2 + (beta - distance)^2 + (w out of the plane)^2,
    beta - distance = (|w|^2 - distance^2 - alpha^2) / (beta + distance),

with |w| taken in the plane. C is replaced by a polynomial, its interpolant, with bounds of the distance to C and to C'.
Then w.C', |w|^2 and |C'|^2 are polynomials on every part of a knot span, and bounded rigorously. That beta keeps the
sign of the distance follows at one point, because beta^2 has a lower bound above 0.
"""

from __future__ import annotations

import math
from collections.abc import Hashable
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev as series_of
from numpy.typing import NDArray

from gtcad.chebyshev import UNIT_ROUNDOFF, interpolation_tail, lebesgue, maximum, nodes, transform
from gtcad.composite import Composite
from gtcad.converters.approximation import Approximation, Bundle
from gtcad.converters.bspline import MAX_DEGREE, BSplineCurve
from gtcad.converters.certificate import Certificate
from gtcad.converters.exact import IDENTITY, ParameterMap
from gtcad.converters.fit import Fit
from gtcad.converters.search import Side, fewest
from gtcad.converters.spline_basis import EndOrder, Knots, both_ends, local_values
from gtcad.errors import InputError, ToleranceBelowPrecision, ToleranceNotMet
from gtcad.offset import Offset
from gtcad.protocol import SeparableCurve, checked_kind, checked_tolerance

Array = NDArray[np.float64]

_MOST_NODES = 160
_MOST_SPANS = 4096
_LEAST_PARTS, _MOST_PARTS = 8, 4096  # of the whole curve
_EVEN = 0.05  # by how much |C'|^2 may vary around its mean before the parts are halved


@dataclass(frozen=True, eq=False)
class _OffsetFactors:
    """The coordinates of an offset, as functions that splines can approximate; no bounds, hence no certificate."""

    offset: Offset

    @property
    def count(self) -> int:
        return self.offset.dimension

    @property
    def key(self) -> Hashable:
        curve = self.offset.curve
        assert isinstance(curve, SeparableCurve)
        frame = self.offset.normal, self.offset.distance
        return ("offset", curve.factors.key, curve.coefficients.tobytes(), *frame)

    def rows(self, t: Array, order: int = 0) -> Array:
        return np.asarray(self.offset.derivative(t, order).T)

    def derivative_bound(self, order: int) -> float:
        return math.inf

    @property
    def rounding(self) -> float:
        return math.inf


def fit_offset(
    offset: Offset, *, tolerance: float, degree: int = 5, end_order: EndOrder = 0, max_spans: int = 1024
) -> Fit[BSplineCurve, ParameterMap]:
    """The B-spline of the fewest poles that was found within the tolerance of an offset, with its proof.

    Parameters
    ----------
    offset
        Of one curve, without cusps; of a chain the ``pieces`` are fitted one by one.
    tolerance
        Largest distance allowed, in the curve's unit, above 0.
    degree
        3 to 25.
    end_order
        0 to 3: derivatives 0..end_order are exact at both ends, up to rounding; 1 keeps the tangents of a chain. A pair
        holds for the start and the end.
    max_spans
        Largest number of knot spans.

    Raises
    ------
    InputError
        When an argument is out of its range, the offset has a cusp, or the curve stops at an end.
    ToleranceBelowPrecision
        When double precision cannot prove the tolerance for this offset.
    ToleranceNotMet
        When ``max_spans`` are not enough.

    Notes
    -----
    The deviation is held at equal parameters. On a size of 100 mm tolerances from about 1e-8 mm can be proved, coarser
    where the curve is slow.

    Examples
    --------
    Twice the unit circle's quarter, run to the left, from outside:

    >>> from gtcad import Curve
    >>> fit = fit_offset(Offset(Curve([[1, 0], [1, 1], [0, 1]]), -1.0), tolerance=1e-6)
    >>> fit.deviation[1] <= 1e-6, abs(math.hypot(*fit.spline.evaluate(0.3)) - 2) <= 1e-6
    (True, True)
    """
    _check(offset, tolerance, degree, end_order, max_spans)
    bundle = Bundle(_OffsetFactors(offset), np.eye(offset.dimension)[:, None, :])
    side = Side(bundle, (degree,), None, end_order, max_spans)
    if side.most < side.least:
        raise InputError(
            f"max_spans = {max_spans} gives {side.most} poles, and end_order {end_order} takes {side.least}"
        )
    model = _Model.of(offset)
    tried: list[tuple[float, int]] = []

    def proof(one: Approximation) -> Fit[BSplineCurve, ParameterMap] | None:
        spline = BSplineCurve(one.matrix, one.knots.breaks, one.knots.multiplicities, one.knots.degree)
        found, rounding = _proved(model, spline, 0.01)
        if rounding > tolerance / 2:
            raise ToleranceBelowPrecision(tolerance, 2 * rounding)
        tried.append((found.upper, one.knots.spans))
        return Fit(spline, (found.lower, found.upper), False, IDENTITY) if found.upper <= tolerance else None

    # a spline about as far away as the offset's distance is beyond the proof
    fit = fewest(side, min(tolerance, abs(offset.distance) / 4), proof, adapt=True) or proof(side.best_of(max_spans))
    if fit is None:
        raise ToleranceNotMet(tolerance, *min(tried), f"max_spans = {max_spans}")
    return fit


def certify_offset(offset: Offset, spline: BSplineCurve, *, rtol: float = 0.01) -> Certificate:
    """Prove how far a spline is from an offset curve, at equal parameters.

    Parameters
    ----------
    offset
        Of one curve; cusps do no harm here.
    spline
        Of the same dimension, without weights; its knots' interval is mapped affinely to [0, 1].
    rtol
        Wanted accuracy of the maxima.

    Returns
    -------
    Certificate
        The upper bound is infinite when the spline is so far away that nothing can be said, by about the offset's
        distance and more.

    Raises
    ------
    InputError
        When an argument is of the wrong kind, or the curve nearly stops.
    """
    if spline.dimension != offset.dimension or spline.weights is not None:
        raise InputError("the spline must have no weights and the dimension of the offset")
    return _proved(_Model.of(offset), spline, rtol)[0]


def _check(offset: Offset, tolerance: float, degree: int, end_order: EndOrder, max_spans: int) -> None:
    checked_kind("offset", offset, Offset, "an Offset, as gtcad.offset.offset makes of a curve")
    checked_tolerance(tolerance)
    for name, value, least, most in (
        ("degree", degree, 3, MAX_DEGREE),
        *(("end_order", order, 0, 3) for order in both_ends(end_order)),
        ("max_spans", max_spans, 1, _MOST_SPANS),
    ):
        if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
            raise InputError(f"{name} must be a whole number in [{least}, {most}], got {value!r}")
    if isinstance(offset.curve, Composite):
        raise InputError("the offset of a chain is fitted piece by piece: take offset.pieces")
    if not offset.regular:
        raise InputError(f"the offset has cusps at t = {', '.join(f'{t:.6g}' for t in offset.cusps)}")


@dataclass(frozen=True)
class _Model:
    """A polynomial that stands for the curve of an offset, and bounds of how far it and its derivative are wrong.

    Attributes
    ----------
    offset
        Whose curve it is.
    series, slopes
        Chebyshev coefficients on [0, 1] of C and C', shapes (k, d) and (k - 1, d): what lies beyond is rounding.
    count
        Number of values that they are made of.
    size
        The largest norm of a coefficient of the curve.
    error
        Bound of the distance from C, rounding included.
    slope_error
        The same for C', but for the next.
    slope_rounding
        To be multiplied by min(count^2, count / sqrt(1 - x^2)) at x = 2 t - 1.
    """

    offset: Offset
    series: Array
    slopes: Array
    count: int
    size: float
    error: float
    slope_error: float
    slope_rounding: float

    @classmethod
    def of(cls, offset: Offset) -> _Model:
        """The interpolant with the fewest points whose tail in C' is below its rounding.

        Its error vanishes at K nodes, the derivative of that at K - 1 points between, so on [0, 1] it is at most
        ``max |C^(K)| / (K-1)!``. Rounding of the values and of their transform makes a polynomial of degree K - 1, and
        reaches the derivative by the inequalities of Markov and Bernstein; so do the coefficients far
        below it, which are dropped.
        """
        curve = offset.curve
        assert isinstance(curve, SeparableCurve)
        size, factors = float(np.sqrt((curve.coefficients**2).sum(axis=1)).max()), curve.factors
        units = factors.rounding + (factors.count + 8 + 3 * factors.derivative_bound(1)) * UNIT_ROUNDOFF
        for count in range(4, _MOST_NODES):
            rounding = size * (lebesgue(count) * units + 6 * count * (count + 8) * UNIT_ROUNDOFF)
            bound = size * factors.derivative_bound(count)
            tail = bound / math.gamma(count)
            if tail <= count * rounding:
                break
        else:
            raise InputError(f"the curve's factors are not resolved by {_MOST_NODES} Chebyshev points")
        series = transform(count) @ curve.evaluate((nodes(count) + 1) / 2)
        left = np.sqrt((series**2).sum(axis=1))[::-1].cumsum()[::-1]  # sum of the coefficients from each on
        series = series[: max(2, int((left > rounding / 8).sum()))]
        rounding *= 9 / 8
        slopes = np.asarray(2 * series_of.chebder(series, axis=0), dtype=np.float64)
        return cls(
            offset=offset,
            series=series,
            slopes=slopes,
            count=count,
            size=size,
            error=interpolation_tail(0.5, count, bound) + rounding + _evaluation_error(series),
            slope_error=tail + 2 * _evaluation_error(slopes),
            slope_rounding=2 * rounding,
        )


def _evaluation_error(series: Array) -> float:
    """Bound of the rounding of Clenshaw's recurrence."""
    return 4 * len(series) ** 2 * UNIT_ROUNDOFF * float(np.sqrt((series**2).sum(axis=1)).sum())


@dataclass(frozen=True)
class _Parts:
    """What the proof needs on parts of the knot spans, in the coordinates of the plane, on common Chebyshev nodes.

    Attributes
    ----------
    knots
        The spline's, subdivided.
    count
        Nodes that determine the products of polynomials, too.
    gap
        w = s - C, shape (parts, count, 2).
    height
        The same across the plane, shape (parts, count, 0 or 1).
    along
        C', shape (parts, count, 2).
    gap_error, along_error
        Bounds of what w and C' are wrong by, tails and rounding together; the latter of shape (parts, 1).
    """

    knots: Knots
    count: int
    gap: Array
    height: Array
    along: Array
    gap_error: float
    along_error: Array

    @classmethod
    def of(cls, model: _Model, spline: BSplineCurve, knots: Knots) -> _Parts:
        """Of a spline over its knots or more."""
        offset = model.offset
        count = 2 * max(knots.degree, len(model.series) - 1) + 1
        z = nodes(count)
        x = 2 * knots.places(z) - 1
        columns = knots.first[:, None] + np.arange(knots.degree + 1)
        held = local_values(knots, z) @ spline.control_points[columns]
        gap = held - np.moveaxis(series_of.chebval(x, model.series), 0, -1)
        along = np.moveaxis(series_of.chebval(x, model.slopes), 0, -1)
        normal = np.zeros((0, offset.dimension)) if offset.normal is None else np.array([offset.normal])
        breaks = 2 * np.array(knots.breaks) - 1
        inside = np.sqrt(np.maximum(1 - np.maximum(abs(breaks[:-1]), abs(breaks[1:])) ** 2, 0))
        growth = model.count / np.maximum(inside, 1 / model.count)
        size = max(model.size, float(np.sqrt((spline.control_points**2).sum(axis=1)).max()))
        return cls(
            knots=knots,
            count=count,
            gap=gap @ offset.frame.T,
            height=gap @ normal.T,
            along=along @ offset.frame.T,
            gap_error=model.error + (6 * knots.degree + 24) * UNIT_ROUNDOFF * size,
            along_error=(model.slope_error + model.slope_rounding * growth)[:, None],
        )

    @property
    def wobble(self) -> float:
        """What rounded nodes may change a polynomial by, relative to its maximum: by Markov's inequality."""
        half = float(np.diff(self.knots.breaks).min()) / 2
        return 8 * lebesgue(self.count) * self.count**2 * UNIT_ROUNDOFF / half

    def series(self, values: Array) -> Array:
        """Chebyshev coefficients of scalar values on the nodes, shape (parts, count)."""
        return np.asarray(values @ transform(self.count).T)


def _even_parts(model: _Model, spline: BSplineCurve) -> tuple[_Parts, Array, Array]:
    """Parts on which |C'| hardly varies, with its bounds there, each of shape (parts, 1)."""
    knots = Knots.normalised(spline.knots, spline.multiplicities, spline.degree)
    pieces = -(-_LEAST_PARTS // knots.spans)
    while True:
        parts = _Parts.of(model, spline, knots.subdivided(pieces))
        square = parts.series((parts.along**2).sum(axis=-1))
        mean, spread = square[:, :1], np.abs(square[:, 1:]).sum(axis=1, keepdims=True)
        products = 2 * parts.count * (parts.count + 8) * UNIT_ROUNDOFF
        spread = spread + (products + parts.wobble) * (mean + spread)
        if (spread <= _EVEN * mean).all() or 2 * pieces * knots.spans > _MOST_PARTS:
            break
        pieces *= 2
    slowest = np.sqrt(np.maximum(mean - spread, 0)) - parts.along_error
    if parts.wobble > 0.1:
        raise InputError(f"the knot spans must not be narrower than rounding allows, got {np.diff(knots.breaks).min()}")
    if (slowest <= 0).any():
        place = parts.knots.breaks[int(slowest.argmin())]
        raise InputError(f"the curve stops, or nearly so, near t = {place:.6g}: nothing can be proved of its offset")
    return parts, slowest, np.sqrt(mean + spread) + parts.along_error


def _proved(model: _Model, spline: BSplineCurve, rtol: float) -> tuple[Certificate, float]:
    """The certificate, and how much of its upper bound is tails and rounding."""
    parts, slowest, fastest = _even_parts(model, spline)
    offset = model.offset
    distance = abs(offset.distance)
    wider = 1 + 2 * parts.wobble
    along = wider * parts.series((parts.gap * parts.along).sum(axis=-1)) / slowest
    excess = wider * parts.series((parts.gap**2).sum(axis=-1) - distance**2)
    along_sum, excess_sum = (np.abs(one).sum(axis=1, keepdims=True) for one in (along, excess))
    reach = np.sqrt(distance**2 + excess_sum)  # bounds |w|
    products = 2 * parts.count * (parts.count + 16) * UNIT_ROUNDOFF  # rounding of products and their coefficients
    turned = reach * parts.along_error / slowest
    along_error = turned + (parts.gap_error + products * reach) * fastest / slowest
    excess_error = 2 * reach * parts.gap_error + parts.gap_error**2 + products * reach**2
    alpha = along_sum + along_error
    least = distance**2 - excess_sum - excess_error - alpha**2  # of beta^2
    differences, t = _differences(offset, spline, parts)
    worst = np.unravel_index(int(differences.argmax()), differences.shape)
    lower = max(0.0, float(differences[worst]) - parts.gap_error - float(turned.max()))
    place = (float(t[worst]),)
    first = parts.along[0, 0, 0] * parts.gap[0, 0, 1] - parts.along[0, 0, 1] * parts.gap[0, 0, 0]
    if (least <= 0).any() or first * offset.distance <= 0 or math.sqrt(least[0, 0]) <= along_error[0, 0]:
        return Certificate(lower, math.inf, place), 0.0
    over = np.sqrt(least) + distance
    heights = wider * np.moveaxis(parts.series(np.moveaxis(parts.height, -1, 1)), 1, -1)
    vectors = np.concatenate([along[..., None], (excess / over)[..., None], heights], axis=-1)
    rounding = float((along_error + excess_error / over).max()) + parts.gap_error
    upper = maximum(vectors, rtol=rtol).upper + float((alpha**2 / over).max()) + rounding
    return Certificate(min(lower, upper), upper, place), rounding


def _differences(offset: Offset, spline: BSplineCurve, parts: _Parts) -> tuple[Array, Array]:
    """|O - s| at the nodes of the parts, and the parameters there."""
    t = parts.knots.places(nodes(parts.count))
    held = spline.evaluate(spline.knots[0] + t * np.ptp(spline.knots))
    return np.sqrt(((offset.evaluate(t) - held) ** 2).sum(axis=-1)), t
