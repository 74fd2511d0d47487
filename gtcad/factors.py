"""Factors made of others, and the ones that turn, and the curve made of any: parts for shapes of the protocol."""

from __future__ import annotations

import math
from collections.abc import Hashable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.chebyshev import UNIT_ROUNDOFF
from gtcad.protocol import Factors, SeparableCurve, affine

Array = NDArray[np.float64]


class KeyedFactors:
    """Factors compared by their key: an argument of functions that are cached."""

    def __init__(self, factors: Factors) -> None:
        self.factors = factors

    def __hash__(self) -> int:
        return hash(self.factors.key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, KeyedFactors) and self.factors.key == other.factors.key


@dataclass(frozen=True)
class RestrictedFactors:
    """Factors on the part [start, end] of their domain, which may run backwards, stretched to [0, 1]."""

    base: Factors
    start: float
    end: float

    @property
    def count(self) -> int:
        """Number of functions."""
        return self.base.count

    @property
    def key(self) -> Hashable:
        """Equal for equal functions."""
        return ("restricted", self.base.key, self.start, self.end)

    def rows(self, t: Array, order: int = 0) -> Array:
        """Derivatives of the order at flat parameters, shape (count, t.size)."""
        inner = np.clip(self.start * (1 - t) + self.end * t, 0.0, 1.0)
        return self.base.rows(inner, order) * (self.end - self.start) ** order

    def derivative_bound(self, order: int) -> float:
        """Bound of the sum of the absolute values of the derivatives."""
        return self.base.derivative_bound(order) * abs(self.end - self.start) ** order

    @property
    def rounding(self) -> float:
        """Bound of the rounding errors, those of the inner parameter included."""
        return self.base.rounding + 3 * UNIT_ROUNDOFF * self.base.derivative_bound(1)


@dataclass(frozen=True)
class Stacked:
    """The factors of several terms side by side."""

    parts: tuple[Factors, ...]

    @property
    def count(self) -> int:
        """Number of functions."""
        return sum(part.count for part in self.parts)

    @property
    def key(self) -> Hashable:
        """Equal for equal functions."""
        return ("stacked", *(part.key for part in self.parts))

    def rows(self, t: Array, order: int = 0) -> Array:
        """Derivatives of the order at flat parameters, shape (count, t.size)."""
        return np.concatenate([part.rows(t, order) for part in self.parts])

    def derivative_bound(self, order: int) -> float:
        """Bound of the sum of the absolute values of the derivatives."""
        return sum(part.derivative_bound(order) for part in self.parts)

    @property
    def rounding(self) -> float:
        """Bound of the rounding errors."""
        return sum(part.rounding for part in self.parts)


@dataclass(frozen=True)
class Waves:
    """1, cos(angle) and sin(angle) of an angle that runs linearly from ``start`` to ``start + sweep``, in radians."""

    start: float
    sweep: float
    count: int = 3

    @property
    def key(self) -> Hashable:
        """Equal for equal functions."""
        return ("waves", self.start, self.sweep)

    def rows(self, t: Array, order: int = 0) -> Array:
        """Derivatives of the order at flat parameters, shape (3, t.size)."""
        angle = self.start + self.sweep * t
        waves = (np.cos(angle), -np.sin(angle), -np.cos(angle), np.sin(angle))  # each the derivative of the one before
        scale = self.sweep**order
        constant = np.full(t.shape, 1.0 if order == 0 else 0.0)
        return np.stack([constant, scale * waves[order % 4], scale * waves[(order + 3) % 4]])

    def derivative_bound(self, order: int) -> float:
        """Bound of the sum of the absolute values of the derivatives: |cos| + |sin| is at most the root of 2."""
        constant = 1.0 if order == 0 else 0.0
        return constant + math.sqrt(2) * abs(self.sweep) ** order

    @property
    def rounding(self) -> float:
        """Bound of the rounding errors: of the angle, and four units of each function."""
        return (2 * 2 * (abs(self.start) + 2 * abs(self.sweep)) + 8) * UNIT_ROUNDOFF


class CurveOfTerms(SeparableCurve):
    """A curve given by its factors and coefficients.

    Parameters
    ----------
    factors
        Any factors.
    coefficients
        Shape (count, d).
    """

    def __init__(self, factors: Factors, coefficients: ArrayLike) -> None:
        self._factors = factors
        self._coefficients = np.array(coefficients, dtype=np.float64)

    @property
    def factors(self) -> Factors:
        """The factors it was made of."""
        return self._factors

    @property
    def coefficients(self) -> Array:
        """Their coefficients."""
        return self._coefficients

    def transformed(self, matrix: ArrayLike, translation: ArrayLike | None = None) -> CurveOfTerms:
        """The affine image: points x become ``matrix @ x + translation``."""
        moved = affine(self.coefficients, matrix, None)
        if translation is None:
            return CurveOfTerms(self.factors, moved)
        constant = np.zeros((3, moved.shape[1]))
        constant[0] = translation
        return CurveOfTerms(Stacked((self.factors, Waves(0.0, 0.0))), np.concatenate([moved, constant]))
