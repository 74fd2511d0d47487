"""Bernstein-like bases with design variables: values, derivatives of every order, Gram matrices.

A basis of degree n blends Bernstein polynomials B of degree n - k with the k + 1 blending functions phi_j of its
family, which sum to 1:

    f_{i,n}(t) = sum_j B_{i-j,n-k}(t) phi_j(t),    i = 0..n

For the generalized trigonometric family ``GT`` k = 2 and, with s = sin(pi t/2), c = cos(pi t/2),

    phi_0 = (1 - s)(1 - gamma_1 s),  phi_2 = (1 - c)(1 - gamma_2 c),  phi_1 = 1 - phi_0 - phi_2,

for ``BERNSTEIN`` k = 0 and phi_0 = 1. Only the blending functions tell one family from another.

References
----------
S. Maqsood, M. Abbas, K. T. Miura, A. Majeed, A. Iqbal, Geometric modeling and applications of generalized blended
trigonometric Bezier curves with shape parameters, Adv. Difference Equ. 2020:550.
"""

from __future__ import annotations

import abc
import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.chebyshev import UNIT_ROUNDOFF, gauss_legendre
from gtcad.errors import InputError

Array = NDArray[np.float64]
Gamma = tuple[float, float]

MAX_DEGREE = 60
_HALF_PI = math.pi / 2
AT_ONCE = 8192  # parameters in one block: its intermediate arrays stay in cache
_OUTSIDE = 1e-12  # parameters may leave [0, 1] by rounding, not by more


class Family(abc.ABC):
    """What tells one basis from another: its blending functions.

    Attributes
    ----------
    name
        As written in model files.
    blending_degree
        k, one less than the number of blending functions; also the least degree of a basis, except that every
        basis has degree 1 at least.
    takes_gamma
        Whether the blending functions depend on design variables.
    """

    name: str
    blending_degree: int
    takes_gamma: bool

    @property
    def minimum_degree(self) -> int:
        """Least degree of a basis of this family."""
        return max(1, self.blending_degree)

    @abc.abstractmethod
    def blending(self, gamma: Gamma, t: Array, order: int) -> list[Array]:
        """Derivatives of the order of phi_0..phi_k at t, each of shape t.shape."""

    @abc.abstractmethod
    def derivative_bound(self, gamma: Gamma, order: int) -> float:
        """Bound of the sum of |phi_j^(order)| on [0, 1]."""

    @property
    @abc.abstractmethod
    def rounding(self) -> float:
        """Bound of the rounding errors of sum_j phi_j as ``blending`` computes them, order 0."""

    def __repr__(self) -> str:
        return f"<family {self.name}>"

    def __reduce__(self) -> str | tuple[object, ...]:
        return (family_named, (self.name,))  # one object for each family, also after pickling


class _GeneralizedTrigonometric(Family):
    name = "GT"
    blending_degree = 2
    takes_gamma = True

    def blending(self, gamma: Gamma, t: Array, order: int) -> list[Array]:
        g1, g2 = gamma
        s = np.sin(_HALF_PI * t)
        c = np.sin(_HALF_PI * (1 - t))  # exactly 0 at t = 1, and the mirror image of s
        if order == 0:
            first, last = 1 - s, 1 - c
            middle = (1 + g1) * (s * first) + (1 + g2) * (c * last)  # a sum of non-negative terms
            first *= 1 - g1 * s
            last *= 1 - g2 * c
            return [first, middle, last]
        # s^2 = (1 - cos 2Ht)/2 and c^2 = (1 + cos 2Ht)/2 turn the products into a sum of waves, whose k-th
        # derivatives are the wave a quarter further k times over
        sine, cosine = ((s, c, -s, -c)[(order + k) % 4] for k in (0, 1))
        double = (2 * s * c, (c - s) * (c + s))[(order + 1) % 2] * (1, 1, -1, -1)[(order + 1) % 4] / 2
        first = -(_HALF_PI**order) * (1 + g1) * sine - math.pi**order * g1 * double
        last = -(_HALF_PI**order) * (1 + g2) * cosine + math.pi**order * g2 * double
        return [first, -(first + last), last]

    def derivative_bound(self, gamma: Gamma, order: int) -> float:
        if order == 0:
            return 1.0  # non-negative, with the sum 1
        waves = ((1 + g) * _HALF_PI**order + abs(g) / 2 * math.pi**order for g in gamma)
        return 2 * sum(waves)  # phi_1 is 1 less the sum of the others

    @property
    def rounding(self) -> float:
        # s and c: 4 units from the function, 4 from the argument. phi_0 and phi_2 change at most twice as fast as s
        # and c do, phi_1 four times; the roundings of the products themselves: 4, 4 and 8 units
        return (2 * (2 * 8 + 4) + (4 * 8 + 8)) * UNIT_ROUNDOFF


class _Bernstein(Family):
    name = "bernstein"
    blending_degree = 0
    takes_gamma = False

    def blending(self, gamma: Gamma, t: Array, order: int) -> list[Array]:
        return [np.full(t.shape, 1.0 if order == 0 else 0.0)]

    def derivative_bound(self, gamma: Gamma, order: int) -> float:
        return 1.0 if order == 0 else 0.0

    @property
    def rounding(self) -> float:
        return 0.0


GT: Family = _GeneralizedTrigonometric()
BERNSTEIN: Family = _Bernstein()
FAMILIES: dict[str, Family] = {family.name: family for family in (GT, BERNSTEIN)}


def family_named(name: str) -> Family:
    """The family of that name, as model files write it."""
    try:
        return FAMILIES[name]
    except KeyError:
        raise InputError(f"family must be one of {', '.join(FAMILIES)}, got {name!r}") from None


def checked_gamma(name: str, gamma: Sequence[float], family: Family) -> Gamma:
    """The design variables as two floats.

    Raises
    ------
    InputError
        When one is outside [-1, 1] (the basis would turn negative there), the family takes none, or it is no family.
    """
    _check_family(family)
    try:
        values = tuple(float(g) for g in gamma)
    except (TypeError, ValueError):
        raise InputError(f"{name} must be two numbers in [-1, 1], got {gamma!r}") from None
    if len(values) != 2:
        raise InputError(f"{name} must be two design variables, got {len(values)}")
    for index, value in enumerate(values):
        if not -1 <= value <= 1:
            raise InputError(f"{name}[{index}] must lie in [-1, 1], got {value:g}")
    if not family.takes_gamma and values != (0.0, 0.0):
        raise InputError(
            f"{name} must be left at (0, 0): the family {family.name} takes no design variables, got {values}"
        )
    return values[0] + 0.0, values[1] + 0.0  # -0.0 and 0.0 are one basis


def _check_family(family: object) -> None:
    if not isinstance(family, Family):
        raise InputError(f"family must be a Family, such as gtcad.GT or gtcad.BERNSTEIN, got {family!r}")


def is_whole(value: object) -> bool:
    """Whether a value is a whole number; True and False are none."""
    if isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)):
        return False
    return math.isfinite(value) and value == int(value)


def checked_order(name: str, order: int) -> int:
    """The order of a derivative.

    Raises
    ------
    InputError
        When it is not a whole number from 0.
    """
    if not is_whole(order) or order < 0:
        raise InputError(f"{name} must be a whole number from 0, got {order}")
    return int(order)


def checked_parameters(name: str, t: ArrayLike) -> Array:
    """Parameters as an array of floats.

    Raises
    ------
    InputError
        When one is not a number in [0, 1], to within rounding (1e-12).
    """
    values = np.asarray(t, dtype=np.float64)
    if values.size and not (values.min() >= -_OUTSIDE and values.max() <= 1 + _OUTSIDE):
        wrong = values[~((values >= -_OUTSIDE) & (values <= 1 + _OUTSIDE))].flat[0]
        raise InputError(f"{name} must lie in [0, 1], got {wrong}")
    return values


@dataclass(frozen=True)
class Basis:
    """The n + 1 functions f_{i,n} of a family: non-negative, summing to 1, interpolating at the ends.

    Parameters
    ----------
    degree
        n, from the family's least degree (2 for GT, 1 for BERNSTEIN) to 60.
    gamma
        Design variables (gamma_1, gamma_2), each in [-1, 1].
    family
        ``GT`` or ``BERNSTEIN``.

    Raises
    ------
    InputError
        When an argument is out of its range.

    Notes
    -----
    Values are accurate to about 1e-15 times the largest of the row, derivatives up to order 4 to 2e-14 at degree 60.
    There is no linear precision: control points at equal distances on a line give that line, but at uneven speed. For
    n = 2 and gamma = (-1, -1) the middle function vanishes. Mirror symmetry:
    f_{i,n}(t; gamma_1, gamma_2) = f_{n-i,n}(1 - t; gamma_2, gamma_1).

    Examples
    --------
    At t = 1/2 and gamma = (0, 0): phi_0 = phi_2 = 1 - 1/sqrt(2).

    >>> Basis(2).evaluate(0.5).round(6).tolist()
    [0.292893, 0.414214, 0.292893]
    """

    degree: int
    gamma: Gamma = (0.0, 0.0)
    family: Family = field(default=GT)

    def __post_init__(self) -> None:
        _check_family(self.family)
        least = self.family.minimum_degree
        if not is_whole(self.degree) or not least <= self.degree <= MAX_DEGREE:
            allowed = f"in [{least}, {MAX_DEGREE}] for the family {self.family.name}"
            raise InputError(f"degree must be a whole number {allowed}, got {self.degree}")
        object.__setattr__(self, "degree", int(self.degree))
        object.__setattr__(self, "gamma", checked_gamma("gamma", self.gamma, self.family))

    @property
    def count(self) -> int:
        """Number of functions, n + 1."""
        return self.degree + 1

    @property
    def key(self) -> Hashable:
        """Equal for equal bases."""
        return (self.family.name, self.degree, self.gamma)

    def evaluate(self, t: ArrayLike) -> Array:
        """Values f_i(t), shape t.shape + (n + 1,).

        Raises
        ------
        InputError
            When a parameter is outside [0, 1].
        """
        return self.derivative(t, 0)

    def derivative(self, t: ArrayLike, order: int = 1) -> Array:
        """Derivatives of the order (0 or more) of f_i at t, in closed form: shape t.shape + (n + 1,).

        Leibniz' rule on the closed form:
        ``f_i^(k) = sum_r binomial(k, r) sum_j B_{i-j}^(r) phi_j^(k-r)``.

        Raises
        ------
        InputError
            When a parameter is outside [0, 1] or the order is not a whole number from 0.
        """
        order = checked_order("order", order)
        t = checked_parameters("t", t)
        flat = np.ascontiguousarray(t).reshape(-1)
        values = np.empty((self.count, flat.size))
        for start in range(0, flat.size, AT_ONCE):
            part = slice(start, start + AT_ONCE)
            values[:, part] = self.rows(flat[part], order)
        return np.moveaxis(values.reshape(self.count, *t.shape), 0, -1)

    def rows(self, t: Array, order: int = 0) -> Array:
        """The same for a flat array of parameters, function by function: shape (n + 1, t.size)."""
        k = self.family.blending_degree
        result = np.zeros((self.count, t.size))
        for r in range(min(order, self.degree - k) + 1):
            polynomials = _bernstein(self.degree - k, t, r)
            for j, phi in enumerate(self.family.blending(self.gamma, t, order - r)):
                result[j : j + len(polynomials)] += polynomials * (phi * math.comb(order, r))
        return result

    def gram(self, order_left: int = 0, order_right: int = 0) -> Array:
        """Gram matrix ``int_0^1 f_i^(a) f_k^(b) dt`` of two orders of derivatives, shape (n + 1, n + 1).

        By Gauss-Legendre quadrature with n + 14 + 2 (a + b) nodes, which is exact to rounding up to n = 60.
        """
        points, weights = gauss_legendre(self.degree + 14 + 2 * (order_left + order_right))
        t = (points + 1) / 2
        left, right = self.rows(t, order_left), self.rows(t, order_right)
        return np.asarray((left * (weights / 2)) @ right.T)

    def derivative_bound(self, order: int) -> float:
        """Bound of ``sum_i |f_i^(order)|`` on [0, 1], by Leibniz' rule: at order 0 the functions sum to 1.

        ``sum_i |B_i^(r)| <= 2^r N!/(N-r)!``, as r-th differences of Bernstein polynomials of degree N - r.
        """
        polynomial_degree = self.degree - self.family.blending_degree
        return sum(
            math.comb(order, r)
            * math.perm(polynomial_degree, r)
            * 2.0**r
            * self.family.derivative_bound(self.gamma, order - r)
            for r in range(min(order, polynomial_degree) + 1)
        )

    @property
    def rounding(self) -> float:
        """Bound of the rounding errors of ``sum_i |computed f_i - f_i|`` in ``evaluate``."""
        # powers, binomial and products: relative 2 N + 10 units; the products with phi_j and their sum: 4 more
        polynomial_degree = self.degree - self.family.blending_degree
        return (2 * polynomial_degree + 14) * UNIT_ROUNDOFF + self.family.rounding


def _bernstein(degree: int, t: Array, order: int) -> Array:
    """Derivatives of the Bernstein polynomials of the degree at flat t: shape (degree + 1, t.size).

    ``B_i^(r) = N!/(N-r)! sum_l (-1)^(r-l) binomial(r, l) B_{i-l, N-r}``, all terms of a row of one magnitude.
    """
    low = degree - order
    values = np.empty((degree + 1, t.size))
    lower = values[: low + 1]
    lower[0] = 1.0
    rest = 1 - t
    for i in range(1, low + 1):
        np.multiply(lower[i - 1], t, out=lower[i])
    power = np.ones_like(t)
    binomials = _binomials(low)
    for i in range(low, -1, -1):
        lower[i] *= power
        if binomials[i] > 1:
            lower[i] *= binomials[i]
        if i:
            power *= rest
    for row in range(low + 1, degree + 1):
        values[row] = 0.0
    for r in range(order):
        top = low + r
        values[top + 1] = values[top]
        values[1 : top + 1] = values[:top] - values[1 : top + 1]
        values[0] *= -1
        values[: top + 2] *= top + 1
    return values


@lru_cache(maxsize=MAX_DEGREE + 1)
def _binomials(degree: int) -> tuple[float, ...]:
    return tuple(float(math.comb(degree, i)) for i in range(degree + 1))
