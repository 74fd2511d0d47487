"""Factors made of others, and the ones that turn, and the shapes made of any: parts for shapes of the protocol."""

from __future__ import annotations

import itertools
import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.basis import Basis, checked_parameters
from gtcad.chebyshev import UNIT_ROUNDOFF
from gtcad.errors import InputError
from gtcad.protocol import Factors, SeparableCurve, SeparableSurface, affine, checked_side

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


@dataclass(frozen=True)
class Hyperbolic:
    """1, cosh(s) / w and sinh(s) / w of an s that runs linearly from ``start`` to ``end``.

    w is the least power of 2 from the largest exp(|s|) on: coefficients are as large then as the shape.
    """

    start: float
    end: float
    count: int = 3

    @property
    def weight(self) -> float:
        """The power of 2."""
        return 2.0 ** math.ceil(self._largest / math.log(2))

    @property
    def key(self) -> Hashable:
        """Equal for equal functions."""
        return ("hyperbolic", self.start, self.end)

    def rows(self, t: Array, order: int = 0) -> Array:
        """Derivatives of the order at flat parameters, shape (3, t.size)."""
        s = self.start * (1 - t) + self.end * t
        functions = (np.cosh(s), np.sinh(s))  # each the derivative of the other
        scale = (self.end - self.start) ** order / self.weight
        constant = np.full(t.shape, 1.0 if order == 0 else 0.0)
        return np.stack([constant, scale * functions[order % 2], scale * functions[(order + 1) % 2]])

    def derivative_bound(self, order: int) -> float:
        """Bound of the sum of the absolute values of the derivatives: cosh(s) + |sinh(s)| = exp(|s|)."""
        largest = math.exp(self._largest) / self.weight
        return (1.0 if order == 0 else 0.0) + abs(self.end - self.start) ** order * largest

    @property
    def rounding(self) -> float:
        """Bound of the rounding errors: of s at most 4 units of the largest, and 16 units of each function."""
        return (4 * self._largest + 16) * UNIT_ROUNDOFF

    @property
    def _largest(self) -> float:
        return max(abs(self.start), abs(self.end))


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
        one, weights = constant_term(self.factors)
        factors, (own, constant) = _side_by_side([self.factors, one])
        coefficients = np.zeros((factors.count, moved.shape[1]))
        coefficients[own] = moved
        coefficients[constant] += np.outer(weights, affine(np.zeros(self.dimension), matrix, translation))
        return CurveOfTerms(factors, coefficients)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, CurveOfTerms):
            return NotImplemented
        return self.factors.key == other.factors.key and np.array_equal(self.coefficients, other.coefficients)

    def __hash__(self) -> int:
        return hash((self.factors.key, (self.coefficients + 0.0).tobytes()))  # -0.0 equals 0.0


@dataclass(frozen=True)
class Constant:
    """The function 1."""

    count: int = 1

    @property
    def key(self) -> Hashable:
        """Equal for equal functions."""
        return ("constant",)

    def rows(self, t: Array, order: int = 0) -> Array:
        """Derivatives of the order at flat parameters, shape (1, t.size)."""
        return np.full((1, t.size), 1.0 if order == 0 else 0.0)

    def derivative_bound(self, order: int) -> float:
        """The largest absolute value of the derivative."""
        return 1.0 if order == 0 else 0.0

    @property
    def rounding(self) -> float:
        """There is none."""
        return 0.0


def constant_term(factors: Factors) -> tuple[Factors, Array]:
    """The function 1 as a sum ``sum_i w_i F_i``: these factors and w, or ``Constant`` where none is known."""
    weights = _constant_weights(factors)
    return (Constant(), np.ones(1)) if weights is None else (factors, weights)


def _constant_weights(factors: Factors) -> Array | None:
    if isinstance(factors, Basis | Constant):
        return np.ones(factors.count)
    if isinstance(factors, Waves):
        return np.array([1.0, 0.0, 0.0])
    if isinstance(factors, RestrictedFactors):
        return _constant_weights(factors.base)
    if isinstance(factors, Stacked):
        start = 0
        for part in factors.parts:
            if (weights := _constant_weights(part)) is not None:
                return np.pad(weights, (start, factors.count - start - part.count))
            start += part.count
    return None


class WithIsoparametrics(SeparableSurface):
    """A surface of the protocol that gives its curves of constant u or v, exactly."""

    def isoparametric(self, *, u: float | None = None, v: float | None = None) -> CurveOfTerms:
        """The curve of constant u (a curve in v) or of constant v (a curve in u), exactly.

        Raises
        ------
        InputError
            Unless just one of u and v is given, in [0, 1].
        """
        if (u is None) == (v is None):
            raise InputError(f"give just one of u and v, got u={u}, v={v}")
        if u is not None:
            row = self.factors_u.rows(checked_parameters("u", [u]))[:, 0]
            return _needed_terms(self.factors_v, np.tensordot(row, self.coefficients, 1))
        assert v is not None
        row = self.factors_v.rows(checked_parameters("v", [v]))[:, 0]
        return _needed_terms(self.factors_u, np.tensordot(row, self.coefficients, (0, 1)))

    def boundary(self, side: str) -> CurveOfTerms:
        """The boundary curve "u0" or "u1" (a curve in v at u = 0, 1), "v0" or "v1" (a curve in u)."""
        checked_side(side)
        return self.isoparametric(u=float(side[1])) if side[0] == "u" else self.isoparametric(v=float(side[1]))


def _needed_terms(factors: Factors, coefficients: Array) -> CurveOfTerms:
    """The curve without the parts that it makes no use of: a boundary is then of the kind that it was given as."""
    if isinstance(factors, RestrictedFactors):
        whole = _needed_terms(factors.base, coefficients)
        return CurveOfTerms(RestrictedFactors(whole.factors, factors.start, factors.end), whole.coefficients)
    if not isinstance(factors, Stacked):
        return CurveOfTerms(factors, coefficients)
    ends = itertools.accumulate(part.count for part in factors.parts)
    rows = [coefficients[end - part.count : end] for part, end in zip(factors.parts, ends, strict=True)]
    used = [index for index, part in enumerate(rows) if part.any()] or [0]
    parts = tuple(factors.parts[index] for index in used)
    return CurveOfTerms(
        parts[0] if len(parts) == 1 else Stacked(parts), np.concatenate([rows[index] for index in used])
    )


Term = tuple[Factors, Factors, Array]


class SurfaceOfTerms(WithIsoparametrics):
    """A surface given by its factors and coefficients.

    Parameters
    ----------
    factors_u, factors_v
        Any factors.
    coefficients
        Shape (count_u, count_v, d).

    Raises
    ------
    InputError
        When the coefficients are not as many as the products of factors.
    """

    def __init__(self, factors_u: Factors, factors_v: Factors, coefficients: ArrayLike) -> None:
        self._factors_u, self._factors_v = factors_u, factors_v
        self._coefficients = np.array(coefficients, dtype=np.float64)
        self._coefficients.flags.writeable = False
        wanted = (factors_u.count, factors_v.count)
        if self._coefficients.ndim != 3 or self._coefficients.shape[:2] != wanted:
            raise InputError(
                f"coefficients must have shape ({wanted[0]}, {wanted[1]}, d), got {np.shape(coefficients)}"
            )

    @classmethod
    def summed(cls, terms: Sequence[Term]) -> SurfaceOfTerms:
        """The sum of surfaces ``(factors of u, factors of v, coefficients)``, equal factors being held once."""
        factors_u, places_u = _side_by_side([term[0] for term in terms])
        factors_v, places_v = _side_by_side([term[1] for term in terms])
        total = np.zeros((factors_u.count, factors_v.count, terms[0][2].shape[-1]))
        for rows, columns, (_, _, coefficients) in zip(places_u, places_v, terms, strict=True):
            total[rows, columns] += coefficients
        return cls(factors_u, factors_v, total)

    @property
    def factors_u(self) -> Factors:
        """The factors of u it was made of."""
        return self._factors_u

    @property
    def factors_v(self) -> Factors:
        """The factors of v it was made of."""
        return self._factors_v

    @property
    def coefficients(self) -> Array:
        """Their coefficients."""
        return self._coefficients

    def transformed(self, matrix: ArrayLike, translation: ArrayLike | None = None) -> SurfaceOfTerms:
        """The affine image: points x become ``matrix @ x + translation``."""
        moved = (self.factors_u, self.factors_v, affine(self.coefficients, matrix, None))
        if translation is None:
            return SurfaceOfTerms(*moved)
        (one_u, weights_u), (one_v, weights_v) = constant_term(self.factors_u), constant_term(self.factors_v)
        offset = affine(np.zeros(self.dimension), matrix, translation)
        return SurfaceOfTerms.summed([moved, (one_u, one_v, np.multiply.outer(np.outer(weights_u, weights_v), offset))])

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, SurfaceOfTerms):
            return NotImplemented
        return (self.factors_u.key, self.factors_v.key) == (other.factors_u.key, other.factors_v.key) and (
            np.array_equal(self.coefficients, other.coefficients)
        )

    def __hash__(self) -> int:
        return hash((self.factors_u.key, self.factors_v.key, (self.coefficients + 0.0).tobytes()))


def _side_by_side(parts: Sequence[Factors]) -> tuple[Factors, list[slice]]:
    """All factors as one, equal ones once, and where each of them is found."""
    different = {part.key: part for part in parts}
    ends = itertools.accumulate(part.count for part in different.values())
    places = {key: slice(end - part.count, end) for (key, part), end in zip(different.items(), ends, strict=True)}
    kept = tuple(different.values())
    return kept[0] if len(kept) == 1 else Stacked(kept), [places[part.key] for part in parts]
