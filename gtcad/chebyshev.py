"""Chebyshev series on a span, their tails, and rigorous maxima of vector series in one and two variables.

On a span [m - h, m + h] with z in [-1, 1], a function is written as ``sum_k c_k T_k(z)`` plus a bounded tail. The
series used here is the interpolant at the zeros of T_K, whose distance from f is at most
``h^K / (2^(K-1) K!) max |f^(K)|``. For sin and cos that is the first term of the tail of the Jacobi-Anger expansion,
with ``|J_k(b)| <= (b/2)^k / k!``.

References
----------
H. Ehlich, K. Zeller, Schwankung von Polynomen zwischen Gitterpunkten, Math. Z. 86 (1964) 41-44.
L. N. Trefethen, Approximation Theory and Approximation Practice, SIAM 2013, chapters 15 and 16.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

UNIT_ROUNDOFF = 2.0**-53
_VALUES_AT_ONCE = 50_000  # floats in one block of samples: stays in cache, bounds the memory
_STAGES = (2.5, 5.0, 9.0)  # nodes for each degree on the way to the final number: sieve out series that cannot matter


@lru_cache(maxsize=128)
def nodes(count: int) -> Array:
    """Zeros of T_count in ascending order, shape (count,)."""
    z = -np.cos(np.pi * (np.arange(count) + 0.5) / count)
    z = np.asarray((z - z[::-1]) / 2)  # exactly symmetric
    z.flags.writeable = False
    return z


@lru_cache(maxsize=128)
def transform(count: int) -> Array:
    """Matrix from values at ``nodes(count)`` to the coefficients of the interpolant, shape (count, count)."""
    matrix = evaluation(count, count).T * (2.0 / count)
    matrix[0] /= 2
    matrix.flags.writeable = False
    return np.asarray(matrix)


@lru_cache(maxsize=512)
def evaluation(count: int, degree_count: int) -> Array:
    """Values T_k at ``nodes(count)``, shape (count, degree_count)."""
    angle = np.pi * (count - 0.5 - np.arange(count)) / count
    matrix: Array = np.cos(np.outer(angle, np.arange(degree_count)))
    matrix.flags.writeable = False
    return matrix


def interpolation_tail(half_width: float, count: int, derivative_bound: float) -> float:
    """Bound of ``|f - its interpolant|`` at ``count`` Chebyshev zeros on a span of that half width.

    Parameters
    ----------
    half_width
        h > 0.
    count
        K >= 1.
    derivative_bound
        Bound of ``|f^(K)|`` on the span; for a sum of absolute values of functions the result bounds their sum.
    """
    if derivative_bound == 0:
        return 0.0
    power = count * math.log(half_width) - (count - 1) * math.log(2) - math.lgamma(count + 1)
    return math.exp(power + math.log(derivative_bound)) * (1 + 1e-12)


def lebesgue(count: int) -> float:
    """Bound of the Lebesgue constant of interpolation at ``nodes(count)``: 1 + (2/pi) ln(count)."""
    return 1.0 + 2.0 / math.pi * math.log(count)


@lru_cache(maxsize=128)
def gauss_legendre(count: int) -> tuple[Array, Array]:
    """Nodes and weights of Gauss-Legendre quadrature on [-1, 1], in ascending order.

    Newton's method in the angle keeps the digits of the nodes near the ends, and so of their weights: up to 100 nodes
    the relative error of a weight is below 3e-13, while an eigenvalue solver loses ten times as much.
    """
    angle = np.pi * (count - 0.25 - np.arange(count)) / (count + 0.5)
    for _ in range(6):
        x = np.cos(angle)
        before, value = np.ones(count), x
        for k in range(2, count + 1):
            before, value = value, ((2 * k - 1) * x * value - (k - 1) * before) / k
        slope = -count * (before - x * value) / np.sin(angle)
        angle = angle - value / slope
    return np.cos(angle), 2 / slope**2


@dataclass(frozen=True)
class Maximum:
    """Two-sided bound of the largest norm of a family of vector series.

    Attributes
    ----------
    lower, upper
        ``lower <= max |q| <= upper``; lower is attained at the sample below.
    index
        Which series of the family the sample belongs to.
    place
        Local coordinates z in [-1, 1] of the sample, one for each variable.
    """

    lower: float
    upper: float
    index: int
    place: tuple[float, ...]


def maximum(
    coefficients: Array, *, rtol: float = 0.01, known: Maximum | None = None, limit: float = math.inf
) -> Maximum:
    """Rigorous maximum of ``|q_b(z)|`` over all series b of a family and z in [-1, 1] (or the square).

    A family of B series in one variable has shape (B, K, d), in two variables (B, K, L, d). Series whose sum of
    coefficient norms cannot reach the largest sample are put aside; the others are sampled at M zeros of T_M and
    bounded by Ehlich and Zeller: ``max |q| <= max_k |q(z_k)| / cos(pi K / 2 M)``, one factor for each variable, for
    the part of degree K that matters, plus the norms of the coefficients beyond.

    Parameters
    ----------
    coefficients
        Finite, shape (B, K, d) or (B, K, L, d); fastest where a transposed array of shape (d, K[, L], B) is passed.
    rtol
        Wanted ``upper / lower - 1``, above 0.
    known
        A sample to start from, if there is one already: its lower bound and place.
    limit
        When the maximum is seen to exceed this, the upper bound is left as coarse as it is.

    Returns
    -------
    Maximum
        With ``upper <= (1 + rtol) lower``, up to rounding, unless lower exceeds the limit.
    """
    series = np.ascontiguousarray(np.moveaxis(coefficients, (0, -1), (-1, 0)))  # (d, K[, L], B)
    degrees = series.shape[1:-1]
    norms = np.sqrt(_squares(series))
    totals = norms.reshape(-1, norms.shape[-1]).sum(axis=0)
    best = known or _largest(_sample(series, degrees), np.zeros(len(totals)))[0]
    quick = totals.copy()
    active = np.flatnonzero(quick > (1 + rtol) * best.lower)
    kept = _effective_degrees(norms.take(active, axis=-1), rtol / 4 * best.lower)
    head = tuple(slice(0, k + 1) for k in kept)
    heads = np.ascontiguousarray(series[(slice(None), *head)])
    beyond = totals - norms[head].reshape(-1, norms.shape[-1]).sum(axis=0)
    final = _node_ratio(rtol / 2, len(degrees))
    for ratio in (*(r for r in _STAGES if r < final), final):
        if not active.size or best.lower > limit:
            break
        shape = tuple(math.ceil(ratio * max(k, 1)) + 1 for k in kept)
        factor = math.prod(1 / math.cos(math.pi * k / (2 * m)) for k, m in zip(kept, shape, strict=True))
        active = active[np.argsort(-quick[active])]
        block = max(1, _VALUES_AT_ONCE // (math.prod(shape) * len(series)))
        for start in range(0, len(active), block):
            part = active[start : start + block]
            if quick[part[0]] <= (1 + rtol) * best.lower:
                break  # sorted: no later one can matter
            found, peaks = _largest(_sample(heads.take(part, axis=-1), shape), beyond[part])
            quick[part] = np.minimum(quick[part], peaks * factor + beyond[part])
            if found.lower > best.lower:
                best = replace(found, index=int(part[found.index]))
        active = active[quick[active] > (1 + rtol) * best.lower]
    upper = max(float(quick.max(initial=0.0)), best.lower)
    return Maximum(best.lower * (1 - 1e-12), upper * (1 + 1e-12), best.index, best.place)


def _node_ratio(rtol: float, variables: int) -> float:
    """M / K for which the Ehlich-Zeller factors of all variables together are at most 1 + rtol."""
    return math.pi / 2 / math.acos((1 + rtol) ** (-1 / variables))


def _effective_degrees(norms: Array, allowance: float) -> tuple[int, ...]:
    """Least degree in each variable beyond which every series' coefficient norms sum to at most the allowance."""
    variables = norms.ndim - 1
    kept = []
    for axis in range(variables):
        lines = norms.sum(axis=tuple(a for a in range(variables) if a != axis))
        tails = lines[::-1].cumsum(axis=0)[::-1].max(axis=1, initial=0.0)
        beyond = np.flatnonzero(tails > allowance / variables)
        kept.append(int(beyond[-1]) if len(beyond) else 0)
    return tuple(kept)


def _sample(series: Array, shape: tuple[int, ...]) -> Array:
    """Squared norms of series (d, K[, L], B) on the tensor grid of Chebyshev zeros, shape (M[, N], B)."""
    values = series
    for axis in range(len(shape), 0, -1):
        table = evaluation(shape[axis - 1], series.shape[axis])
        values = table @ values.reshape(*series.shape[: axis + 1], -1)
    return _squares(values).reshape(*shape, -1)


def _squares(vectors: Array) -> Array:
    """Squared norms over the first axis."""
    return np.asarray(np.einsum("d...,d...->...", vectors, vectors))


def _largest(squares: Array, beyond: Array) -> tuple[Maximum, Array]:
    """Where a sample less what is left out of its series is largest, and the largest sample of each series."""
    peaks = squares
    while peaks.ndim > 1:
        peaks = peaks.max(axis=0)  # one axis after the other: long rows are fast
    peaks = np.sqrt(peaks)
    index = int((peaks - beyond).argmax())
    shape = squares.shape[:-1]
    place = np.unravel_index(int(squares[..., index].argmax()), shape)
    z = tuple(float(nodes(m)[k]) for m, k in zip(shape, place, strict=True))
    return Maximum(float(peaks[index] - beyond[index]), 0.0, index, z), peaks
