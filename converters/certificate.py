"""Proved two-sided deviation of a B-spline from a separable shape.

On every knot span the difference of shape and spline is a polynomial, known by its values at Chebyshev zeros, plus a
tail: ``|shape - spline| <= max |polynomial| + tail + rounding``. The maximum is bounded rigorously by
``gtcad.chebyshev.maximum``, the tail by the shape's factors, the rounding by counting operations. The spline is
taken as it stands: nothing here relies on how it was made.

For rational splines, and for shapes followed through a parameter map that makes them rational, the numerator of the
difference is bounded and divided by the least denominator of the span.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from gtcad.chebyshev import UNIT_ROUNDOFF, Maximum, interpolation_tail, lebesgue, maximum, nodes, transform
from gtcad.converters.bspline import BSplineCurve, BSplineSurface
from gtcad.converters.exact import IDENTITY, MappedFactors, ParameterMap
from gtcad.converters.spline_basis import Knots, local_values
from gtcad.errors import InputError
from gtcad.factors import KeyedFactors
from gtcad.protocol import Factors, SeparableCurve, SeparableSurface

Array = NDArray[np.float64]

COARSE, FINE = 0.01, 0.001
"""Relative widths of a certificate, and of one that decides a near miss."""

_MAX_NODES = 192
_PARTS = 8
_ONES = (np.ones(1), np.ones(1))
_BLOCK = 3_000_000  # floats in one block of differences: bounds the memory
_IN_CACHE = 16_000  # floats that are made, subtracted and transformed at a time
_NEGLIGIBLE = 4 * UNIT_ROUNDOFF


@dataclass(frozen=True)
class Certificate:
    """What was proved of the deviation ``max |shape(t) - spline(t)|`` at equal (or mapped) parameters.

    Attributes
    ----------
    lower, upper
        ``lower <= deviation <= upper``, in the shape's unit; upper includes tails and rounding and also bounds the
        distance of the two point sets, either way.
    place
        The shape's parameters where the lower bound is attained: (t,) or (u, v).
    """

    lower: float
    upper: float
    place: tuple[float, ...]


def certify_curve(
    curve: SeparableCurve,
    spline: BSplineCurve,
    *,
    parameter_map: ParameterMap = IDENTITY,
    window: tuple[int, int] | None = None,
    rtol: float = 0.01,
    resolution: float = 0.0,
    limit: float = math.inf,
) -> Certificate:
    """Prove how far the spline, or a part of it, is from the curve.

    Parameters
    ----------
    curve
        Any curve of the protocol.
    spline
        Of the same dimension; its knots' interval is mapped affinely to [0, 1].
    parameter_map
        Which parameter of the curve each parameter of the spline is held against.
    window
        The part of the spline between two of its knots, by their index, is held against the whole curve; all of it
        for None.
    rtol
        Wanted ``upper / lower - 1`` beyond rounding and tails.
    resolution
        Tails up to this length are good enough: they are part of the upper bound, and shorter series are faster.
    limit
        Above it the deviation is of no interest: the bounds may then be far apart.

    Raises
    ------
    InputError
        When the dimensions differ, or the map is none of the curve's exact forms.
    """
    _check_dimension(curve.dimension, spline.dimension)
    rational = spline.weights is not None
    floor = 1.0 if spline.weights is None else float(spline.weights.min())
    knots = Knots.normalised(spline.knots, spline.multiplicities, spline.degree, window)
    size = _size(curve.coefficients, spline.control_points)
    side = _Direction.of(curve.factors, knots, parameter_map, rational, resolution / size)
    model = side.shape_rows @ curve.coefficients
    fitted = side.local @ spline.homogeneous[side.columns]
    difference, common = _over_common(model, fitted, side.denominator[..., None], rational)
    least, most = _range(transform(side.count) @ common, floor) if rational or side.mapped else _ONES
    found = maximum(transform(side.count) @ difference / least[:, None, None], rtol=rtol, limit=limit)
    slack = side.tail + lebesgue(side.count) * (side.rounding + 8 * UNIT_ROUNDOFF)
    slack *= size * float((most / least).max())
    x = side.parameter(found.index, found.place[0])
    certificate = _certificate(found, slack, (float(parameter_map(x)),))
    if rational or side.mapped:
        start, end = (spline.knots[k] for k in window or (0, -1))
        held = spline.evaluate(start * (1 - x) + end * x)
        return _with_lower(certificate, curve.evaluate(certificate.place[0]) - held, slack)
    return certificate


def certify_surface(
    surface: SeparableSurface,
    spline: BSplineSurface,
    *,
    parameter_maps: tuple[ParameterMap, ParameterMap] = (IDENTITY, IDENTITY),
    rtol: float = 0.01,
    resolution: float = 0.0,
    limit: float = math.inf,
) -> Certificate:
    """Prove how far the spline surface is from the surface; see ``certify_curve``.

    Raises
    ------
    InputError
        When the dimensions differ, or a map is none of the surface's exact forms.
    """
    _check_dimension(surface.dimension, spline.dimension)
    rational = spline.weights is not None
    floor = 1.0 if spline.weights is None else float(spline.weights.min())
    knots_u = Knots.normalised(spline.knots_u, spline.multiplicities_u, spline.degree_u)
    knots_v = Knots.normalised(spline.knots_v, spline.multiplicities_v, spline.degree_v)
    size = _size(surface.coefficients, spline.control_points)
    u = _Direction.of(surface.factors_u, knots_u, parameter_maps[0], rational, resolution / size)
    v = _Direction.of(surface.factors_v, knots_v, parameter_maps[1], rational, resolution / size)
    bound_u, bound_v = surface.factors_u.derivative_bound(0), surface.factors_v.derivative_bound(0)
    tail = u.tail * bound_v + lebesgue(u.count) * v.tail * bound_u
    rounding = u.rounding * bound_v + v.rounding * bound_u + 16 * UNIT_ROUNDOFF
    slack = size * (tail + lebesgue(u.count) * lebesgue(v.count) * rounding)
    fractional = rational or u.mapped or v.mapped
    lines = _across(v, surface, spline)
    blocks = []
    step = max(1, _BLOCK // (u.count * v.count * v.spans * (spline.dimension + 1)))
    for start in range(0, u.spans, step):
        part = slice(start, min(start + step, u.spans))
        if fractional:
            known, (series, least, most) = None, _quotients(u, v, part, lines, floor, rational)
        else:
            (series, known), (least, most) = _differences(u, v, part, lines), _ONES
        found = maximum(series, rtol=rtol, known=known, limit=limit)
        span_u, span_v = divmod(found.index, v.spans)
        x = u.parameter(start + span_u, found.place[0]), v.parameter(span_v, found.place[1])
        own = slack * float((most / least).max())
        certificate = _certificate(found, own, (float(parameter_maps[0](x[0])), float(parameter_maps[1](x[1]))))
        if fractional:
            knots = (spline.knots_u, spline.knots_v)
            held = spline.evaluate(*(one[0] + place * np.ptp(one) for one, place in zip(knots, x, strict=True)))
            certificate = _with_lower(certificate, surface.evaluate(*certificate.place) - held, own)
        blocks.append(certificate)
    worst = max(blocks, key=lambda block: block.lower)
    own = surface.definition_error
    return Certificate(max(0.0, worst.lower - own), max(block.upper for block in blocks) + own, worst.place)


def deciding(certify: Callable[..., Certificate], tolerance: float) -> Certificate:
    """What ``certify(rtol=...)`` proves, made tighter where its bounds lie on both sides of the tolerance."""
    certificate = certify(rtol=COARSE)
    return certify(rtol=FINE) if certificate.lower <= tolerance < certificate.upper else certificate


def _certificate(found: Maximum, slack: float, place: tuple[float, ...]) -> Certificate:
    # nodes are rounded by a unit or two: by Markov's inequality less than 1e-7 of the difference itself
    return Certificate(max(0.0, found.lower * (1 - 1e-7) - slack), found.upper * (1 + 1e-7) + slack, place)


def _with_lower(certificate: Certificate, difference: Array, slack: float) -> Certificate:
    """The lower bound from the difference itself, not from its numerator over the least denominator."""
    lower = max(0.0, float(np.linalg.norm(difference)) - slack)
    return Certificate(min(lower, certificate.upper), certificate.upper, certificate.place)


@dataclass(frozen=True)
class _Direction:
    """Everything that a proof needs of one parameter direction, span by span."""

    knots: Knots
    count: int  # Chebyshev zeros on each span
    shape_rows: Array  # (spans, count, factors): numerators when the map makes them rational
    denominator: Array  # (spans, count)
    mapped: bool
    local: Array  # (spans, count, degree + 1)
    tail: float
    rounding: float

    @property
    def spans(self) -> int:
        return self.knots.spans

    @property
    def columns(self) -> NDArray[np.int_]:
        """Indices of the poles that act on each span, shape (spans, degree + 1)."""
        return self.knots.first[:, None] + np.arange(self.knots.degree + 1)

    def parameter(self, span: int, z: float) -> float:
        return float(self.knots.places(np.array([z]))[span, 0])

    @staticmethod
    def of(
        factors: Factors, knots: Knots, parameter_map: ParameterMap, rational: bool, resolution: float
    ) -> _Direction:
        decades = math.floor(math.log10(max(resolution, _NEGLIGIBLE)))  # a few steps only: results are cached
        return _direction(KeyedFactors(factors), knots, parameter_map, rational, max(10.0**decades, _NEGLIGIBLE))


@lru_cache(maxsize=64)
def _direction(
    kept: KeyedFactors, knots: Knots, parameter_map: ParameterMap, rational: bool, resolution: float
) -> _Direction:
    factors = kept.factors
    mapped = None if parameter_map == IDENTITY else MappedFactors.of(factors, parameter_map)
    extra = 0
    if mapped or rational:
        extra = knots.degree  # the numerator is a product
        knots = knots.subdivided(-(-_PARTS // knots.spans))  # the less the denominator varies the better
    if mapped is not None:
        count, tail = max(mapped.degree, knots.degree) + extra + 1, 0.0
    else:
        count, tail = _node_count(factors, knots, extra, resolution)
    z = nodes(count)
    t = knots.places(z)
    rows = (mapped or factors).rows(t.reshape(-1))
    shape_rows = np.ascontiguousarray(np.moveaxis(rows.reshape(-1, *t.shape), 0, -1))
    denominator = np.ones(t.shape) if mapped is None else mapped.denominator(t)
    return _Direction(
        knots=knots,
        count=count,
        shape_rows=shape_rows,
        denominator=denominator,
        mapped=mapped is not None,
        local=local_values(knots, z),
        tail=tail,
        rounding=(mapped or factors).rounding + (factors.count + 6 * (knots.degree + 1)) * UNIT_ROUNDOFF,
    )


def _node_count(factors: Factors, knots: Knots, extra: int, resolution: float) -> tuple[int, float]:
    """Chebyshev zeros for which the shape's tail on every span is within the resolution, and that tail."""
    for count in range(knots.degree + 1, _MAX_NODES):
        tail = interpolation_tail(knots.widest, count, factors.derivative_bound(count))
        if tail <= resolution:
            return count + extra, tail * (1 + lebesgue(count + extra)) if extra else tail
    raise InputError(f"the shape's factors are not resolved by {_MAX_NODES} Chebyshev points on a span")


def _over_common(model: Array, fitted: Array, denominator: Array, rational: bool) -> tuple[Array, Array]:
    """Numerator and denominator of shape - spline; the model's values are numerators over the given denominator.

    All are (spans, nodes, coordinates, ...), with one coordinate for a denominator.
    """
    if not rational:
        return np.asarray(model - fitted * denominator), denominator
    weight = fitted[:, :, -1:]
    return np.asarray(model * weight - fitted[:, :, :-1] * denominator), np.asarray(denominator * weight)


def _range(series: Array, floor: float) -> tuple[Array, Array]:
    """Bounds of scalar series above the floor, (spans, K, 1) or (spans, K, L, 1): the mean less and plus all else."""
    flat = series.reshape(len(series), -1)
    spread = np.abs(flat[:, 1:]).sum(axis=1)
    return np.maximum(flat[:, 0] - spread, floor), flat[:, 0] + spread


def _across(v: _Direction, surface: SeparableSurface, spline: BSplineSurface) -> tuple[Array, Array]:
    """Coefficients of the curves along u at all nodes of v, of shape and spline, (count of u, d, nodes_v, spans_v)."""
    shape = np.moveaxis(surface.coefficients, -1, 1) @ v.shape_rows.reshape(-1, v.shape_rows.shape[-1]).T
    shape = shape.reshape(*shape.shape[:2], v.spans, v.count).swapaxes(2, 3)
    poles = spline.homogeneous.swapaxes(0, 1)
    fitted = v.local @ poles.reshape(len(poles), -1)[v.columns]
    fitted = fitted.reshape(*fitted.shape[:2], *poles.shape[1:]).transpose(2, 3, 1, 0)
    return np.ascontiguousarray(shape), np.ascontiguousarray(fitted)


def _values(u: _Direction, part: slice, lines: tuple[Array, Array]) -> tuple[Array, Array]:
    """Values of shape and spline at all nodes of some spans of u, (spans_u, nodes_u, d, nodes_v, spans_v)."""
    shape, fitted = lines
    rows, local, near = u.shape_rows[part], u.local[part], fitted[u.columns[part]]
    model = rows @ shape.reshape(len(shape), -1)
    held = local @ near.reshape(*near.shape[:2], -1)
    return model.reshape(*rows.shape[:2], *shape.shape[1:]), held.reshape(*rows.shape[:2], *fitted.shape[1:])


def _differences(u: _Direction, v: _Direction, part: slice, lines: tuple[Array, Array]) -> tuple[Array, Maximum]:
    """Series of shape - spline, and the largest of the values that they interpolate."""
    found, best = [], None
    step = max(1, _IN_CACHE // (u.count * lines[0][0].size))
    for start in range(part.start, part.stop, step):
        values, held = _values(u, slice(start, min(start + step, part.stop)), lines)
        values -= held
        largest = _largest(u, v, values, (start - part.start) * v.spans)
        best = largest if best is None or largest.lower > best.lower else best
        found.append(_series(u, v, values))
    assert best is not None
    return _by_rectangle(np.concatenate(found, axis=-1)), best


def _quotients(
    u: _Direction, v: _Direction, part: slice, lines: tuple[Array, Array], floor: float, rational: bool
) -> tuple[Array, Array, Array]:
    """Series of the numerator of shape - spline over the least denominator of each rectangle, and that one's range."""
    model, held = _values(u, part, lines)
    numerator, common = _over_common(model, held, u.denominator[part, :, None, None, None] * v.denominator.T, rational)
    least, most = _range(_by_rectangle(_series(u, v, common)), floor)
    return _by_rectangle(_series(u, v, numerator) / least), least, most


def _series(u: _Direction, v: _Direction, values: Array) -> Array:
    """One series for each rectangle, (d, K, L, rectangles), from values (spans_u, nodes_u, d, nodes_v, spans_v)."""
    values = np.ascontiguousarray(values.transpose(2, 1, 3, 0, 4))
    series = transform(u.count) @ values.reshape(len(values), u.count, -1)
    return np.asarray(transform(v.count) @ series.reshape(len(values), u.count, v.count, -1))


def _by_rectangle(series: Array) -> Array:
    """A view as (rectangles, K, L, d)."""
    return np.moveaxis(series, (0, -1), (-1, 0))


def _largest(u: _Direction, v: _Direction, values: Array, first: int) -> Maximum:
    """The largest of the values; ``first`` is the index of the first rectangle."""
    squares = np.einsum("aidjb,aidjb->aijb", values, values)
    a, i, j, b = (int(k) for k in np.unravel_index(int(squares.argmax()), squares.shape))
    z = float(nodes(u.count)[i]), float(nodes(v.count)[j])
    return Maximum(math.sqrt(squares[a, i, j, b]), 0.0, first + a * v.spans + b, z)


def _size(coefficients: Array, poles: Array) -> float:
    """The largest norm among coefficients and poles."""
    largest = max(np.sqrt((points**2).sum(axis=-1)).max() for points in (coefficients, poles))
    return float(max(largest, np.finfo(float).tiny))


def _check_dimension(shape: int, spline: int) -> None:
    if shape != spline:
        raise InputError(f"shape and spline must have one dimension, got {shape} and {spline}")
