"""Polynomials as factors, and proved bounds of vector products of curves: what is resolved but has no closed form.

A ``Polynomials`` is a few Chebyshev series on [0, 1]. A ``Spanned`` is an analytic function known by its values at
Chebyshev zeros of equal spans of [0, 1], by the rounding of these, and by bounds of its derivatives: sums and vector
products of such are known in the same way, and so their largest and least values can be bounded rigorously.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from gtcad.chebyshev import UNIT_ROUNDOFF, lebesgue, maximum, nodes, transform
from gtcad.factors import RestrictedFactors, Stacked
from gtcad.protocol import Factors, SeparableCurve

Array = NDArray[np.float64]

MAX_COUNT = 191  # coefficients of a polynomial: as many as a certificate can take on one span
_ROUNDING = 16 * UNIT_ROUNDOFF  # of the largest coefficient: coefficients as small are rounding
_PLATEAU = 1e-11  # of the largest: coefficients as small are rounding where they decrease no more
_STEPS = (17, 33, 65, 129, 193)
_OVERFLOWS = 709.0  # the exponential of more is no float
_NODES = 32  # values on a span
_NODE_ROUNDING = 1 + 1e-7  # nodes are rounded by a unit or two: by Markov's inequality less than that


@dataclass(frozen=True, eq=False)
class Polynomials:
    """The functions ``P_i(t) = sum_j a_ij T_j(2 t - 1)``, T_j the Chebyshev polynomials.

    Parameters
    ----------
    coefficients
        a, finite, shape (count, degree + 1), the degree at most 190.

    Examples
    --------
    T_2(2 t - 1) = 8 t^2 - 8 t + 1:

    >>> Polynomials(np.array([[0.0, 0.0, 1.0]])).rows(np.array([0.0, 0.25, 0.5])).round(12).tolist()
    [[1.0, -0.5, -1.0]]
    """

    coefficients: Array

    def __post_init__(self) -> None:
        kept = np.array(self.coefficients, dtype=np.float64) + 0.0  # -0.0 and 0.0 are one
        kept.flags.writeable = False
        object.__setattr__(self, "coefficients", kept)

    @property
    def count(self) -> int:
        """Number of functions."""
        return len(self.coefficients)

    @property
    def degree(self) -> int:
        """The largest degree."""
        return int(self.coefficients.shape[1]) - 1

    @property
    def key(self) -> Hashable:
        """Equal for equal functions."""
        return ("polynomials", self.coefficients.shape, self.coefficients.tobytes())

    def rows(self, t: Array, order: int = 0) -> Array:
        """Derivatives of the order at flat parameters, shape (count, t.size)."""
        if order > self.degree:
            return np.zeros((self.count, t.size))
        series: Array = self.coefficients
        for _ in range(order):
            series = series @ _derivation(series.shape[1])
        return np.asarray(series @ _values(t, series.shape[1]))

    def derivative_bound(self, order: int) -> float:
        """Bound of the sum of the absolute values of the derivatives: of their Chebyshev coefficients; maybe inf."""
        return self._unscaled(0, order)

    def rounding_of(self, order: int) -> float:
        """Bound of the rounding errors of ``rows`` of the order."""
        return self._unscaled(1, order)

    @property
    def rounding(self) -> float:
        """Bound of the rounding errors."""
        return self.rounding_of(0)

    @property
    def taylor(self) -> Array:
        """Bounds of the sums of ``|P_i^(k)| / (2^k k!)``, shape (degree + 1,)."""
        return np.asarray(self._bounds[0])

    def _unscaled(self, row: int, order: int) -> float:
        if order > self.degree or self._bounds[row, order] == 0:
            return 0.0
        power = math.log(self._bounds[row, order]) + order * math.log(2) + math.lgamma(order + 1)
        return math.exp(power) * (1 + 1e-12) if power < _OVERFLOWS else math.inf

    @cached_property
    def _bounds(self) -> Array:
        """Bounds of each order k over 2^k k!, which do not overflow, and of their roundings, shape (2, degree + 1)."""
        series, size = self.coefficients, np.abs(self.coefficients)
        found = []
        for order in range(self.degree + 1):
            count = series.shape[1]
            # a product of non-negative matrices bounds what each derivation adds: `size` is at |series| or above it
            lost = order * (self.degree / 2 + 4) * UNIT_ROUNDOFF * float(size.sum())
            units = 11.0 * np.arange(count) + count + 4  # of T_j, and of the products with it and their sum
            found.append((float(np.abs(series).sum()) + lost, UNIT_ROUNDOFF * float((size @ units).sum()) + lost))
            step = _derivation(count) / (2 * (order + 1))
            series, size = series @ step, size @ step
        return np.array(found).T * (1 + 1e-12)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Polynomials) and self.key == other.key

    def __hash__(self) -> int:
        return hash(self.key)


def _values(t: Array, count: int) -> Array:
    """T_j(2 t - 1) for j < count, shape (count, t.size), each at most 11 j units off.

    T_j is the cosine of j times an angle, taken from the nearer end, where it is small: 5 units of it, at most pi/2,
    for root and arcsine, 3 of cosine and sine, and 3 for each complex product.
    """
    near = t <= 0.5
    angle = 2 * np.arcsin(np.sqrt(np.clip(np.where(near, t, 1 - t), 0.0, 0.5)))
    turn = np.cos(angle) + 1j * np.sin(angle)
    turn[near] = -turn[near].conj()
    power, values = np.ones(t.shape, complex), np.ones((count, t.size))
    for j in range(1, count):
        power *= turn
        values[j] = power.real
    return values


def _derivation(count: int) -> Array:
    """Matrix from the coefficients of a series to those of its derivative by t, shape (count, max(count - 1, 1)).

    With z = 2 t - 1, ``T_j'(z) = 2 j sum T_k(z)`` over the k < j with j - k odd, that of k = 0 halved.
    """
    return _derivations(1 << count.bit_length())[:count, : max(count - 1, 1)]


@lru_cache(maxsize=16)
def _derivations(count: int) -> Array:
    matrix = np.zeros((count, count))
    for j in range(1, count):
        matrix[j, (j - 1) % 2 : j : 2] = 4.0 * j
    matrix[:, 0] /= 2
    matrix.flags.writeable = False
    return matrix


def resolved(series_with: Callable[[int], Array]) -> tuple[Array, Array] | None:
    """The first of ever longer series of which the last eighth is rounding: whole, and without that; None if none is.

    Parameters
    ----------
    series_with
        From a number of values to Chebyshev coefficients, shape (count, K).
    """
    for step in _STEPS:
        series = series_with(step)
        sizes = np.linalg.norm(series, axis=0)
        eighth = step // 8
        before, last = float(sizes[-2 * eighth : -eighth].max()), float(sizes[-eighth:].max())
        plateau = max(before, last) <= min(4 * last, _PLATEAU * sizes.max())
        if plateau or last <= _ROUNDING * sizes.max():
            return series, chopped(series, 2 * last)
    return None


def chopped(series: Array, level: float) -> Array:
    """Chebyshev series, shape (count, K), without the last coefficients that are at most the level."""
    kept = np.flatnonzero(np.linalg.norm(series, axis=0) > level)
    return series[:, : int(kept[-1]) + 1] if kept.size else series[:, :1]


def derivative_rounding(factors: Factors, order: int) -> float:
    """Bound of the rounding errors ``sum_i |computed F_i^(k) - F_i^(k)|`` in ``rows`` of the order k.

    Factors say it of their values only. Their derivatives are sums of products of the same functions, each as accurate
    as there up to 8 k units, and the absolute values of these products sum to ``derivative_bound(k)`` at most.
    """
    if isinstance(factors, Polynomials):
        return factors.rounding_of(order)
    if isinstance(factors, Stacked):
        return sum(derivative_rounding(part, order) for part in factors.parts)
    if isinstance(factors, RestrictedFactors):
        bound = 3 * UNIT_ROUNDOFF * factors.base.derivative_bound(order + 1)
        scale = abs(factors.end - factors.start) ** order * (1 + 2 * order * UNIT_ROUNDOFF)
        own = 2 * order * UNIT_ROUNDOFF * factors.derivative_bound(order)
        return scale * (derivative_rounding(factors.base, order) + bound) + own
    return (factors.rounding + 8 * order * UNIT_ROUNDOFF) * factors.derivative_bound(order)


@dataclass(frozen=True)
class Spanned:
    """An analytic function from [0, 1] to vectors of length d, or with d = 1 to numbers, on equal spans.

    Attributes
    ----------
    values
        At the Chebyshev zeros of every span, shape (spans, nodes, d).
    taylor
        Bounds of ``|f^(k)| h^k / k!`` on [0, 1], h half the width of a span, shape (nodes + 1,).
    rounding
        Bounds of the errors of the values, shape (spans, nodes).
    """

    values: Array
    taylor: Array
    rounding: Array

    @classmethod
    def of(cls, curve: SeparableCurve, order: int, spans: int, error: float = 0.0) -> Spanned:
        """The derivative of the order of a curve whose coefficients are off by the error at most."""
        factors, size = curve.factors, float(np.linalg.norm(curve.coefficients, axis=1).max())
        places = ((nodes(_NODES) + 1) / 2 + np.arange(spans)[:, None]) / spans
        values = (factors.rows(places.reshape(-1), order).T @ curve.coefficients).reshape(spans, _NODES, -1)
        bounds = np.array([factors.derivative_bound(order + k) for k in range(_NODES + 1)])
        steps = np.cumprod([1.0] + [0.5 / spans / k for k in range(1, _NODES + 1)])
        off = error + (factors.count + 2) * UNIT_ROUNDOFF * size
        rounding = derivative_rounding(factors, order) * size + off * float(bounds[0])
        return cls(values, bounds * steps * (size + error) * (1 + 1e-12), np.full((spans, _NODES), rounding))

    @property
    def sizes(self) -> Array:
        """Norms of the values, shape (spans, nodes)."""
        return np.asarray(np.linalg.norm(self.values, axis=2))

    def cross(self, other: Spanned) -> Spanned:
        """The vector product."""
        return self._product(other, np.cross(self.values, other.values))

    def dot(self, other: Spanned) -> Spanned:
        """The scalar product."""
        return self._product(other, np.sum(self.values * other.values, axis=2, keepdims=True))

    def times(self, other: Spanned) -> Spanned:
        """The product with numbers."""
        return self._product(other, self.values * other.values)

    def __add__(self, other: Spanned) -> Spanned:
        return self._sum(other, self.values + other.values)

    def __sub__(self, other: Spanned) -> Spanned:
        return self._sum(other, self.values - other.values)

    def _sum(self, other: Spanned, values: Array) -> Spanned:
        rounding = self.rounding + other.rounding + UNIT_ROUNDOFF * np.linalg.norm(values, axis=2)
        return Spanned(values, self.taylor + other.taylor, rounding)

    def plus(self, number: float) -> Spanned:
        """The sum with one number in every component."""
        taylor = self.taylor.copy()
        taylor[0] += abs(number) * math.sqrt(self.values.shape[-1])
        values = self.values + number
        return Spanned(values, taylor, self.rounding + UNIT_ROUNDOFF * np.linalg.norm(values, axis=2))

    def _product(self, other: Spanned, values: Array) -> Spanned:
        a, b = self.sizes, other.sizes
        rounding = self.rounding * (b + other.rounding) + other.rounding * a + 8 * UNIT_ROUNDOFF * a * b
        taylor = np.convolve(self.taylor, other.taylor)[: self.taylor.size]
        return Spanned(values, taylor * (1 + 1e-12), rounding * (1 + 1e-12))

    @property
    def tail(self) -> float:
        """Bound of the distance from the interpolant on any span."""
        return float(self.taylor[-1]) * 2.0 ** (1 - _NODES)

    @property
    def slack(self) -> Array:
        """Bounds of the distance from the computed interpolant, shape (spans,)."""
        computing = 2 * _NODES * (_NODES + 2) * UNIT_ROUNDOFF  # sums of 32 products for each of 32 coefficients
        off = lebesgue(_NODES) * self.rounding.max(axis=1) + computing * self.sizes.max(axis=1)
        return np.asarray(self.tail + off)

    def least(self) -> Array:
        """Lower bounds of numbers on each span, at least 0, shape (spans,)."""
        series = self.values[..., 0] @ transform(_NODES).T
        spread = np.abs(series[:, 1:]).sum(axis=1)
        return np.asarray(np.maximum(series[:, 0] - spread * _NODE_ROUNDING - self.slack, 0.0))

    def most(self) -> Array:
        """Upper bounds of the norm on each span, shape (spans,): nearly reached where a span is short."""
        sizes = np.linalg.norm(transform(_NODES) @ self.values, axis=2)
        return np.asarray(sizes.sum(axis=1) * _NODE_ROUNDING + self.slack)

    def largest(self, divisor: Array | float = 1.0) -> float:
        """Upper bound of the norm over the divisor, which may be another one on each span, shape (spans,)."""
        scale = np.broadcast_to(divisor, len(self.values))
        series = transform(_NODES) @ self.values / scale[:, None, None]
        return maximum(series).upper * _NODE_ROUNDING + float((self.slack / scale).max())
