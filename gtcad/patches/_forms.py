"""Quadratic energies of surfaces as sums of products of Gram matrices, and their extremals for many design variables.

With the Gram matrices ``G^ab_ik = int f_i^(a) f_k^(b)`` an energy of ``S = sum f_i(u) f_j(v) c_ij`` is

    E = sum_terms w  c : (G_u^(a a') (x) G_v^(b b')) : c.

The GT functions are affine in the design variables, ``f = a + gamma_1 b + gamma_2 c``, so Gram matrices are quadratic
polynomials of them: with nine constant matrices in hand, thousands of pairs cost one matrix product.
"""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.basis import Basis, Family, Gamma
from gtcad.chebyshev import UNIT_ROUNDOFF, gauss_legendre, interpolation_tail
from gtcad.errors import InputError
from gtcad.factors import KeyedFactors
from gtcad.protocol import Factors

Array = NDArray[np.float64]
Orders = tuple[int, int]
Form = tuple[tuple[float, Orders, Orders], ...]
Energy = Literal["dirichlet", "quasi-harmonic", "bending"]

SQUARES: dict[str, tuple[tuple[float, tuple[Orders, ...]], ...]] = {
    "dirichlet": ((0.5, ((1, 0),)), (0.5, ((0, 1),))),
    "quasi-harmonic": ((1.0, ((2, 0), (0, 2))),),
    "bending": ((1.0, ((2, 0),)), (2.0, ((1, 1),)), (1.0, ((0, 2),))),
}
"""The energies as integrals of weighted squares of sums of partial derivatives."""

FORMS: dict[str, Form] = {
    name: tuple(
        (weight, (a, c), (b, d)) for weight, orders in squares for (a, b), (c, d) in itertools.product(orders, repeat=2)
    )
    for name, squares in SQUARES.items()
}
"""Weight, orders of both factors in u, orders of both in v, of every term of an energy."""

INNER = slice(1, -1)

_MOST_NODES = 200
_AT_ONCE = 2_000_000  # floats in one block of systems: bounds the memory
_VANISHING = 1e-13  # of the size of Gram matrices: what is left of a function that vanishes
_CORNERS: tuple[Gamma, ...] = ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0))


def checked_energy(functional: str) -> Form:
    """The form of an energy.

    Raises
    ------
    InputError
        When there is none of that name.
    """
    if functional not in FORMS:
        raise InputError(f"functional must be one of {', '.join(FORMS)}, got {functional!r}")
    return FORMS[functional]


def rule(*factors: Factors) -> tuple[Array, Array]:
    """Nodes and weights on [0, 1] that integrate products of two of the factors or their derivatives to rounding.

    As many nodes as the Chebyshev interpolant needs whose distance from the factors is below rounding, by the bounds
    of their derivatives, and six more for what derivatives add.
    """
    x, weights = gauss_legendre(max(_terms(KeyedFactors(one)) for one in factors) + 6)
    return (x + 1) / 2, weights / 2


def resolved(*factors: Factors) -> bool:
    """Whether ``rule`` integrates the factors to rounding: all but waves by the dozen."""
    return all(_terms(KeyedFactors(one)) < _MOST_NODES for one in factors)


@lru_cache(maxsize=256)
def _terms(keyed: KeyedFactors) -> int:
    """Chebyshev terms after which the rest of the factors is below rounding."""
    factors = keyed.factors
    wanted = UNIT_ROUNDOFF * max(factors.derivative_bound(0), 1e-300)
    with contextlib.suppress(OverflowError):  # bounds of fast waves leave the range of floats
        for count in range(4, _MOST_NODES):
            if interpolation_tail(0.5, count, factors.derivative_bound(count)) <= wanted:
                return count
    return _MOST_NODES


@dataclass(frozen=True)
class GramPolynomials:
    """Gram matrices of a GT basis, and of fixed functions beside it, as functions of the design variables.

    Parameters
    ----------
    degree, family
        Of the basis, whose family takes design variables.
    beside
        More functions, which do not depend on them; or None.
    """

    degree: int
    family: Family
    beside: KeyedFactors | None = None

    @cached_property
    def rule(self) -> tuple[Array, Array]:
        """Nodes and weights on [0, 1]."""
        more = () if self.beside is None else (self.beside.factors,)
        return rule(*(Basis(self.degree, gamma, self.family) for gamma in _CORNERS), *more)

    def components(self, t: Array, order: int) -> Array:
        """The rows a, b, c of derivatives of ``f = a + gamma_1 b + gamma_2 c``, shape (3, count, t.size)."""
        first, *others = (Basis(self.degree, gamma, self.family).rows(t, order) for gamma in _CORNERS)
        rows = np.stack([first, *(other - first for other in others)])
        if self.beside is None:
            return rows
        fixed = self.beside.factors.rows(t, order)
        return np.concatenate([rows, np.stack([fixed, 0 * fixed, 0 * fixed])], axis=1)

    @lru_cache(maxsize=64)  # noqa: B019 - instances are few, and kept by `gram_polynomials`
    def _products(self, orders: Orders) -> Array:
        """The nine matrices of all products of a, b and c, shape (9, count, count)."""
        t, weights = self.rule
        left, right = (self.components(t, order) for order in orders)
        products = np.einsum("pit,qkt->pqik", left * weights, right, optimize=True)
        return np.asarray(products.reshape(9, *products.shape[2:]))

    def size(self, orders: Orders) -> float:
        """The size of the entries of the Gram matrices."""
        return float(np.abs(self._products(orders)).max())

    def at(self, gammas: Array, orders: Orders) -> Array:
        """Gram matrices for pairs (count, 2), shape (count, n, n)."""
        m = affine_terms(gammas)
        return self._summed(m[:, :, None] * m[:, None, :], orders)

    def rate(self, gammas: Array, index: int, orders: Orders) -> Array:
        """Their derivatives by the first or second design variable."""
        m, unit = affine_terms(gammas), np.eye(3)[1 + index]
        return self._summed(m[:, :, None] * unit + unit[:, None] * m[:, None, :], orders)

    def _summed(self, products: Array, orders: Orders) -> Array:
        table = self._products(orders)
        return (products.reshape(-1, 9) @ table.reshape(9, -1)).reshape(-1, *table.shape[1:])


def affine_terms(gammas: Array) -> Array:
    """1, gamma_1 and gamma_2 for pairs (count, 2), shape (count, 3)."""
    return np.column_stack([np.ones(len(gammas)), gammas])


gram_polynomials = lru_cache(maxsize=64)(GramPolynomials)
"""Gram polynomials that are kept."""


def checked_gammas(gammas: ArrayLike, family: Family) -> Array:
    """Design variables (gamma_u1, gamma_u2, gamma_v1, gamma_v2) of many patches, shape (count, 4).

    Raises
    ------
    InputError
        When the shape is another one, a value is outside [-1, 1], or the family takes no design variables.
    """
    try:
        values = np.asarray(gammas, dtype=np.float64)
    except (TypeError, ValueError):
        values = np.empty(0)
    if values.ndim != 2 or values.shape[1] != 4:
        raise InputError(f"gammas must be numbers of shape (count, 4), got shape {np.shape(gammas)}")
    if not family.takes_gamma:
        raise InputError(f"the family {family.name} takes no design variables: there is one extremal, not many")
    wrong = np.argwhere(~(np.abs(values) <= 1))
    if len(wrong):
        row, column = wrong[0]
        raise InputError(f"gammas[{row}, {column}] must lie in [-1, 1], got {values[row, column]:g}")
    return values


@dataclass(frozen=True)
class ManyExtremals:
    """The extremals of an energy for many design variables at once.

    Parameters
    ----------
    u, v
        Gram polynomials of the directions.
    known
        The coefficients (count_u, count_v, d) that are given; the inner ones of both bases are added to what stands
        there.
    form
        The energy.
    """

    u: GramPolynomials
    v: GramPolynomials
    known: Array
    form: Form

    def blocks(self, gammas: Array) -> Iterator[slice]:
        """Parts of the list that fit in the memory."""
        unknowns = (self.u.degree - 1) * (self.v.degree - 1)
        step = max(1, _AT_ONCE // max(unknowns**2, 3 * self.known.size))
        for start in range(0, len(gammas), step):
            yield slice(start, start + step)

    def energies(self, gammas: Array) -> tuple[Array, Array]:
        """Energies (count,), and all coefficients of the extremals (count, count_u, count_v, d)."""
        parts = [self._solved(gammas[block]) for block in self.blocks(gammas)]
        none = np.empty(0), np.empty((0, *self.known.shape))
        energies, coefficients = (np.concatenate(arrays) for arrays in zip(none, *parts, strict=True))
        return energies, coefficients

    def _solved(self, gammas: Array) -> tuple[Array, Array]:
        rows, columns = (slice(1, one.degree) for one in (self.u, self.v))
        shape = (len(gammas), *self.known[rows, columns].shape)
        unknowns = shape[1] * shape[2]
        matrix = np.zeros((len(gammas), unknowns, unknowns))
        forces = np.zeros((len(gammas), *self.known.shape))
        for weight, orders_u, orders_v in self.form:
            gram_u, gram_v = self.u.at(gammas[:, :2], orders_u), self.v.at(gammas[:, 2:], orders_v)
            inner = np.einsum("cik,cjl->cijkl", weight * gram_u[:, rows, rows], gram_v[:, columns, columns])
            matrix += inner.reshape(matrix.shape)
            forces += weight * _applied(gram_u, gram_v, self.known)
        right = -forces[:, rows, columns].reshape(len(gammas), unknowns, -1)
        solution = _scaled_solve(matrix, right, _VANISHING * self._size()).reshape(shape)
        coefficients = np.tile(self.known, (len(gammas), 1, 1, 1))
        coefficients[:, rows, columns] += solution
        energies = np.einsum("cijd,ijd->c", forces, self.known)
        return energies + np.einsum("cijd,cijd->c", forces[:, rows, columns], solution), coefficients

    def derivatives(self, gammas: Array, t: Array, orders: Orders) -> Array:
        """Partial derivatives of the extremals on the grid of the parameters, shape (count, t.size, t.size, d)."""
        tables = [one.components(t, order) for one, order in zip((self.u, self.v), orders, strict=True)]
        result = np.empty((len(gammas), t.size, t.size, self.known.shape[2]))
        for block in self.blocks(gammas):
            coefficients = self.energies(gammas[block])[1]
            rows_u, rows_v = (
                np.einsum("cp,pit->cti", affine_terms(gammas[block, columns]), table)
                for table, columns in zip(tables, (slice(2), slice(2, 4)), strict=True)
            )
            result[block] = _applied(rows_u, rows_v, coefficients)
        return result

    def _size(self) -> float:
        """The size of the entries of the systems."""
        return max(weight * self.u.size(orders_u) * self.v.size(orders_v) for weight, orders_u, orders_v in self.form)

    def rates(self, gammas: Array, coefficients: Array) -> Array:
        """Derivatives of the extremal energies by the four design variables, shape (count, 4).

        The coefficients of an extremal do not count: the energy is stationary in them.
        """
        result = np.empty((len(gammas), 4))
        for block in self.blocks(gammas):
            for k in range(4):
                result[block, k] = self._rate(gammas[block], coefficients[block], k)
        return result

    def _rate(self, gammas: Array, coefficients: Array, k: int) -> Array:
        total = np.zeros(len(gammas))
        for weight, orders_u, orders_v in self.form:
            if k < 2:
                grams = self.u.rate(gammas[:, :2], k, orders_u), self.v.at(gammas[:, 2:], orders_v)
            else:
                grams = self.u.at(gammas[:, :2], orders_u), self.v.rate(gammas[:, 2:], k - 2, orders_v)
            total += weight * np.einsum("cijd,cijd->c", coefficients, _applied(*grams, coefficients))
        return total


def _applied(gram_u: Array, gram_v: Array, coefficients: Array) -> Array:
    """The products ``G_u c G_v^T`` of matrices (count, k, n), (count, l, m) and coefficients ([count,] n, m, d)."""
    *_, m, d = coefficients.shape
    lines = (gram_u @ coefficients.reshape(*coefficients.shape[:-2], m * d)).reshape(len(gram_u), -1, m, d)
    return np.asarray(gram_v[:, None] @ lines)


def _scaled_solve(matrix: Array, right: Array, least: float) -> Array:
    """Solutions of systems that are positive definite but for rows of zeros, whose unknowns become 0."""
    squares = np.einsum("cii->ci", matrix)
    gone = squares <= least  # degree 2 with gamma = (-1, -1) has no interior function
    scale = np.where(gone, 0.0, 1 / np.sqrt(np.where(gone, 1.0, squares)))
    scaled = matrix * scale[:, :, None] * scale[:, None, :]
    scaled[gone[:, :, None] & np.eye(matrix.shape[1], dtype=bool)] = 1.0
    return np.asarray(scale[..., None] * np.linalg.solve(scaled, scale[..., None] * right))
