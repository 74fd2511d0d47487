"""Vector functions with their derivatives: sums, products, quotients and roots, as Taylor coefficients."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from gtcad.protocol import SeparableCurve

Array = NDArray[np.float64]


class Algebra(Protocol):
    """Functions with vectors as values, or with one component numbers: what a formula is made of.

    ``Taylor`` evaluates a formula and differentiates it, ``gtcad.polynomial.Spanned`` bounds it.
    """

    def cross(self, other: Self) -> Self:
        """The vector product."""
        ...

    def dot(self, other: Self) -> Self:
        """The scalar product."""
        ...

    def times(self, other: Self) -> Self:
        """The product with numbers."""
        ...

    def __add__(self, other: Self) -> Self: ...

    def __sub__(self, other: Self) -> Self: ...


F = TypeVar("F", bound=Algebra)
At = Callable[[SeparableCurve, int], F]
"""From a curve and an order to that derivative of it, as a function of some kind."""


@dataclass(frozen=True)
class Taylor:
    """Functions at many places, each by ``f^(k) / k!``.

    Attributes
    ----------
    terms
        For k = 0, 1, ..., shape (count, places, d).
    """

    terms: Array

    @classmethod
    def at(cls, t: Array, count: int) -> At[Taylor]:
        """Derivatives of curves at flat parameters, with so many terms."""
        known: dict[tuple[int, int], tuple[SeparableCurve, Array]] = {}  # holds the curves, so that ids stay theirs

        def term(curve: SeparableCurve, order: int) -> Array:
            if (id(curve), order) not in known:
                known[id(curve), order] = curve, curve.derivative(t, order)
            return known[id(curve), order][1]

        def derivative(curve: SeparableCurve, order: int) -> Taylor:
            return cls(np.stack([term(curve, order + k) / math.factorial(k) for k in range(count)]))

        return derivative

    @property
    def values(self) -> Array:
        """The functions themselves, shape (places, d)."""
        return np.asarray(self.terms[0])

    def derivative(self, order: int = 0) -> Array:
        """Derivatives of the order, shape (places, d)."""
        return np.asarray(self.terms[order] * math.factorial(order))

    def cross(self, other: Taylor) -> Taylor:
        """The vector product."""
        return self._product(other, _cross)

    def dot(self, other: Taylor) -> Taylor:
        """The scalar product."""
        return self._product(other, lambda a, b: np.sum(a * b, axis=-1, keepdims=True))

    def times(self, other: Taylor) -> Taylor:
        """The product with numbers."""
        return self._product(other, np.multiply)

    def over(self, other: Taylor) -> Taylor:
        """The quotient by numbers."""
        found: list[Array] = []
        for k in range(len(self.terms)):
            known = [found[j] * other.terms[k - j] for j in range(k)]
            found.append((self.terms[k] - sum(known, np.zeros(1))) / other.terms[0])
        return Taylor(np.stack(found))

    def root(self) -> Taylor:
        """The square root of positive numbers."""
        found = [np.sqrt(self.terms[0])]
        for k in range(1, len(self.terms)):
            known = [found[j] * found[k - j] for j in range(1, k)]
            found.append((self.terms[k] - sum(known, np.zeros(1))) / (2 * found[0]))
        return Taylor(np.stack(found))

    def unit(self) -> Taylor:
        """The direction."""
        return self.over(self.dot(self).root())

    def __add__(self, other: Taylor) -> Taylor:
        return Taylor(self.terms + other.terms)

    def __sub__(self, other: Taylor) -> Taylor:
        return Taylor(self.terms - other.terms)

    def _product(self, other: Taylor, product: Callable[[Array, Array], Array]) -> Taylor:
        a, b = self.terms, other.terms
        return Taylor(np.stack([sum(product(a[j], b[k - j]) for j in range(k + 1)) for k in range(len(a))]))


def _cross(a: Array, b: Array) -> Array:
    """As ``np.cross``, which takes four times as long for few vectors."""
    (a0, a1, a2), (b0, b1, b2) = a.T, b.T
    product = np.empty(a.shape)
    product[:, 0], product[:, 1], product[:, 2] = a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0
    return product
