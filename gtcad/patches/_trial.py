"""Surfaces with a fixed boundary: a base, plus all combinations of interior functions of two bases.

    S = S_0 + sum_ij phi_i(u) psi_j(v) y_ij

The phi span the interior functions f_1..f_(n-1) of the basis, which vanish at both ends. They are orthonormal, and
their derivatives are orthogonal: ``int phi_i' phi_k' = lambda_i delta_ik``. In these coordinates systems stay well
conditioned at all degrees, and that of the Dirichlet energy is diagonal.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gtcad.basis import Basis
from gtcad.chebyshev import gauss_legendre
from gtcad.patches._forms import FORMS, INNER, Orders, rule
from gtcad.protocol import SeparableSurface

Array = NDArray[np.float64]

_ORDERS = (0, 1, 2)


@dataclass(frozen=True)
class Direction:
    """The interior functions of a basis at the nodes of a quadrature, or others of its functions.

    Attributes
    ----------
    basis
        Of degree n.
    nodes, weights
        On [0, 1].
    used
        Which functions; those of all but the interior ones are not fixed at both ends.
    """

    basis: Basis
    nodes: Array
    weights: Array
    used: slice

    @cached_property
    def to_basis(self) -> Array:
        """Coefficients of the phi in the functions of the basis, shape (n - 1, count)."""
        rows = self.basis.rows(self.nodes)[self.used]
        sizes = np.sqrt((rows**2) @ self.weights)
        kept = np.flatnonzero(sizes > 0)  # degree 2 with gamma = (-1, -1) has no interior function
        _, triangle = np.linalg.qr((rows[kept] / sizes[kept, None] * np.sqrt(self.weights)).T)
        transform = np.zeros((len(rows), len(kept)))
        transform[kept] = np.linalg.inv(triangle) / sizes[kept, None]
        slopes = self.basis.rows(self.nodes, 1)[self.used].T @ transform
        return np.asarray(transform @ np.linalg.eigh((slopes.T * self.weights) @ slopes)[1])

    @property
    def count(self) -> int:
        """Number of the phi."""
        return int(self.to_basis.shape[1])

    @cached_property
    def values(self) -> tuple[Array, Array, Array]:
        """The phi and their first and second derivatives at the nodes, each of shape (nodes, count)."""
        first, second, third = (self.rows(self.nodes, order) for order in _ORDERS)
        return first, second, third

    def rows(self, t: Array, order: int) -> Array:
        """Derivatives of the phi at any parameters, shape (t.size, count)."""
        return np.asarray(self.basis.rows(t, order)[self.used].T @ self.to_basis)

    @cached_property
    def eigenvalues(self) -> Array:
        """The lambda, above 0 for interior functions."""
        return np.asarray(self.weights @ self.values[1] ** 2)

    def gram(self, orders: Orders) -> Array:
        """Products ``int phi_i^(a) phi_k^(b)``."""
        return np.asarray((self.values[orders[0]].T * self.weights) @ self.values[orders[1]])


@dataclass(frozen=True)
class Trial:
    """All surfaces with the boundary of a base.

    Attributes
    ----------
    base
        S_0.
    u, v
        The interior functions of both directions.
    """

    base: SeparableSurface
    u: Direction
    v: Direction

    @classmethod
    def of(
        cls,
        base: SeparableSurface,
        basis_u: Basis,
        basis_v: Basis,
        *,
        least: int = 0,
        used: tuple[slice, slice] = (INNER, INNER),
    ) -> Trial:
        """With a rule that integrates energies to rounding, or with more nodes."""
        directions = []
        for basis, factors, functions in ((basis_u, base.factors_u, used[0]), (basis_v, base.factors_v, used[1])):
            nodes, weights = rule(basis, factors)
            if len(nodes) < least:
                x, w = gauss_legendre(least)
                nodes, weights = (x + 1) / 2, w / 2
            directions.append(Direction(basis, nodes, weights, functions))
        return cls(base, *directions)

    @property
    def shape(self) -> tuple[int, int, int]:
        """That of y."""
        return self.u.count, self.v.count, self.base.dimension

    @cached_property
    def scale(self) -> Array:
        """``(lambda_i + mu_j)^(-1/2)``: in y over this the Dirichlet energy is half the sum of squares; (.., 1)."""
        sums = self.u.eigenvalues[:, None] + self.v.eigenvalues
        return np.asarray(1 / np.sqrt(sums))[..., None]

    def derivative_of_base(self, orders: Orders) -> Array:
        """Partial derivatives of S_0 at the nodes, shape (nodes_u, nodes_v, d)."""
        return self.base.derivative(self.u.nodes[:, None], self.v.nodes[None, :], orders)

    def combined(self, y: Array, orders: Orders) -> Array:
        """Partial derivatives of ``sum phi_i psi_j y_ij`` at the nodes."""
        return tensor(self.u.values[orders[0]], self.v.values[orders[1]], y)

    def interior(self, y: Array) -> Array:
        """The same function's coefficients in the interior functions of both bases, shape (n - 1, m - 1, d)."""
        return tensor(self.u.to_basis, self.v.to_basis, y)

    def extremal(self, functional: str) -> Array:
        """The y of least energy: one linear system."""
        unknowns = self.u.count * self.v.count
        matrix, right = np.zeros((unknowns, unknowns)), np.zeros(self.shape)
        for weight, (a, a_base), (b, b_base) in FORMS[functional]:
            matrix += weight * np.kron(self.u.gram((a, a_base)), self.v.gram((b, b_base)))
            weighted = self.u.weights[:, None, None] * self.v.weights[:, None]
            force = weighted * self.derivative_of_base((a_base, b_base))
            right -= weight * tensor(self.u.values[a].T, self.v.values[b].T, force)
        return np.asarray(np.linalg.solve(matrix, right.reshape(unknowns, -1)), dtype=np.float64).reshape(self.shape)

    def least_residual(self) -> Array:
        """The y of least ``int |S_uu + S_vv|^2`` as least squares, for functions that are free on some sides too."""
        weights = np.sqrt(np.outer(self.u.weights, self.v.weights)).reshape(-1, 1)
        laplacian = self.derivative_of_base((2, 0)) + self.derivative_of_base((0, 2))
        (u, _, u_second), (v, _, v_second) = self.u.values, self.v.values
        design = weights * (np.kron(u_second, v) + np.kron(u, v_second))
        right = -weights * laplacian.reshape(-1, self.base.dimension)
        return np.asarray(np.linalg.lstsq(design, right, rcond=None)[0], dtype=np.float64).reshape(self.shape)


def tensor(left: Array, right: Array, points: Array) -> Array:
    """The product ``sum left_ai right_bj points_ijd``, shape (a, b, d)."""
    lines = left @ points.reshape(len(points), -1)
    return np.asarray(right @ lines.reshape(len(left), *points.shape[1:]))
