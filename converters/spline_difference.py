"""How far two B-splines are from each other at equal parameters, proved.

Between the knots of both, the difference of two splines is a polynomial, known exactly by its values at Chebyshev
zeros; the largest norm is bounded by ``gtcad.chebyshev.maximum``. Of rational splines the numerator of the difference
is bounded and divided by the least denominator of the span, as in ``gtcad.converters.certificate``.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gtcad.chebyshev import UNIT_ROUNDOFF, lebesgue, maximum, nodes, transform
from gtcad.converters.bspline import BSplineCurve, BSplineSurface
from gtcad.converters.certificate import Certificate
from gtcad.converters.spline_basis import Knots, dense, local_values
from gtcad.errors import InputError

Array = NDArray[np.float64]
Bounds = tuple[float, float]

_PARTS = 4  # of each span of rational splines: the less the denominator varies the better


def certify_splines(
    a: BSplineCurve | BSplineSurface,
    b: BSplineCurve | BSplineSurface,
    *,
    rtol: float = 0.01,
    limit: float = math.inf,
) -> Certificate:
    """Prove how far two spline curves, or two spline surfaces, are from each other.

    Parameters
    ----------
    a, b
        Of one dimension; the domain of each is mapped affinely to [0, 1].
    rtol, limit
        As of ``certify_curve``.

    Returns
    -------
    Certificate
        Its place in parameters on [0, 1].

    Raises
    ------
    InputError
        When one is a curve and the other a surface, or their dimensions differ.

    Examples
    --------
    >>> line = BSplineCurve([[0, 0], [2, 0]], [0, 1], [2, 2], 1)
    >>> bent = BSplineCurve([[0, 0], [1, 1], [2, 0]], [0, 1], [3, 3], 2)
    >>> found = certify_splines(line, bent)
    >>> found.lower <= 0.5 <= found.upper < 0.51
    True
    """
    if isinstance(a, BSplineCurve) != isinstance(b, BSplineCurve) or a.dimension != b.dimension:
        kinds = f"{type(a).__name__} in {a.dimension}d and {type(b).__name__} in {b.dimension}d"
        raise InputError(f"two spline curves or two spline surfaces of one dimension are needed, got {kinds}")
    rational = a.weights is not None or b.weights is not None
    pairs = [_common(*both, _PARTS if rational else 1) for both in zip(_knots(a), _knots(b), strict=True)]
    counts = [(one.degree + other.degree if rational else max(one.degree, other.degree)) + 1 for one, other in pairs]
    first = _values(a, [one for one, _ in pairs], counts, rational)
    second = _values(b, [other for _, other in pairs], counts, rational)
    most_over_least = 1.0
    if rational:
        common = first[..., -1:] * second[..., -1:]
        least, most = _range(_series(common, counts), _least_weight(a) * _least_weight(b))
        numerator = first[..., :-1] * second[..., -1:] - second[..., :-1] * first[..., -1:]
        series = _series(numerator, counts) / least.reshape(-1, *[1] * (first.ndim - 1))
        most_over_least = float((most / least).max())
    else:
        series = _series(first - second, counts)
    found = maximum(series, rtol=rtol, limit=limit)
    slack = (_rounding(a, pairs, 0) + _rounding(b, pairs, 1)) * math.prod(map(lebesgue, counts)) * most_over_least
    place = _place(found.index, found.place, [one for one, _ in pairs])
    lower = found.lower * (1 - 1e-7)
    if rational:
        lower = float(np.linalg.norm(_at(a, place) - _at(b, place)))
    # nodes are rounded by a unit or two: by Markov's inequality less than 1e-7 of the difference itself
    upper = found.upper * (1 + 1e-7) + slack
    return Certificate(min(max(0.0, lower - slack), upper), upper, place)


def _knots(spline: BSplineCurve | BSplineSurface) -> list[Knots]:
    if isinstance(spline, BSplineCurve):
        return [Knots.normalised(spline.knots, spline.multiplicities, spline.degree)]
    return [
        Knots.normalised(spline.knots_u, spline.multiplicities_u, spline.degree_u),
        Knots.normalised(spline.knots_v, spline.multiplicities_v, spline.degree_v),
    ]


def _common(a: Knots, b: Knots, parts: int) -> tuple[Knots, Knots]:
    """Both with the breaks of both: a break of the other has multiplicity 0."""
    breaks = sorted({*a.breaks, *b.breaks})
    found = []
    for one in (a, b):
        own = dict(zip(one.breaks, one.multiplicities, strict=True))
        found.append(Knots(tuple(breaks), tuple(own.get(x, 0) for x in breaks), one.degree).subdivided(parts))
    return found[0], found[1]


def _values(spline: BSplineCurve | BSplineSurface, knots: list[Knots], counts: list[int], rational: bool) -> Array:
    """Homogeneous coordinates at all nodes of all spans or rectangles, (spans, nodes, ..., d)."""
    poles = spline.homogeneous
    if rational and spline.weights is None:
        poles = np.concatenate([poles, np.ones((*poles.shape[:-1], 1))], axis=-1)
    matrices = [_matrix(one, count) for one, count in zip(knots, counts, strict=True)]
    if len(matrices) == 1:
        return (matrices[0] @ poles).reshape(knots[0].spans, counts[0], -1)
    values = np.tensordot(matrices[0], np.tensordot(matrices[1], poles, (1, 1)), (1, 1))
    shape = (knots[0].spans, counts[0], knots[1].spans, counts[1], -1)
    return values.reshape(shape).transpose(0, 2, 1, 3, 4).reshape(-1, *counts, poles.shape[-1])


def _matrix(knots: Knots, count: int) -> Array:
    columns = knots.first[:, None] + np.arange(knots.degree + 1)
    return dense(local_values(knots, nodes(count)), columns, knots.poles)


def _series(values: Array, counts: list[int]) -> Array:
    """Chebyshev coefficients of values (spans, nodes, ..., d)."""
    for axis, count in enumerate(counts, start=1):
        values = np.moveaxis(np.tensordot(transform(count), values, (1, axis)), 0, axis)
    return values


def _range(series: Array, floor: float) -> tuple[Array, Array]:
    """Bounds of scalar series above the floor: the mean less and plus all else."""
    flat = series.reshape(len(series), -1)
    spread = np.abs(flat[:, 1:]).sum(axis=1)
    return np.maximum(flat[:, 0] - spread, floor), flat[:, 0] + spread


def _least_weight(spline: BSplineCurve | BSplineSurface) -> float:
    return 1.0 if spline.weights is None else float(spline.weights.min())


def _size(spline: BSplineCurve | BSplineSurface) -> float:
    return float(np.linalg.norm(spline.homogeneous, axis=-1).max())


def _rounding(spline: BSplineCurve | BSplineSurface, pairs: list[tuple[Knots, Knots]], which: int) -> float:
    """Bound of the rounding of values: of the recursion, the sums, and the parameters, which are rounded by units."""
    units = 8.0
    for pair in pairs:
        own = pair[which]
        flat = own.flat
        narrowest = float((flat[own.degree :] - flat[: len(flat) - own.degree])[1:-1].min(initial=1.0))
        units += 6 * (own.degree + 1) + 8 * own.degree / narrowest
    return units * UNIT_ROUNDOFF * 2 * _size(spline)


def _place(index: int, local: tuple[float, ...], knots: list[Knots]) -> tuple[float, ...]:
    spans = np.unravel_index(index, [one.spans for one in knots])
    return tuple(float(one.places(np.array([z]))[span, 0]) for one, span, z in zip(knots, spans, local, strict=True))


def _at(spline: BSplineCurve | BSplineSurface, place: tuple[float, ...]) -> Array:
    if isinstance(spline, BSplineCurve):
        return spline.evaluate(_stretched(place[0], spline.domain))
    return spline.evaluate(*(_stretched(x, ends) for x, ends in zip(place, spline.domain, strict=True)))


def _stretched(x: float, ends: Bounds) -> float:
    return min(max(ends[0] * (1 - x) + ends[1] * x, ends[0]), ends[1])
