"""Splines over given knots that approximate all curves of one direction at once.

A spline approximates the factors F of a shape through one matrix M: poles = M @ coefficients. M is the weighted
least-squares solution with the derivatives 0..r exact at both ends; weights that grow where the error of the actual
piece is largest (Lawson's iteration) take it towards the minimax solution. Knots are placed where they equidistribute
the (p + 1)-th derivative of the piece.

Nothing here is proved: errors are taken on samples and guide the search.

References
----------
C. L. Lawson, Contributions to the theory of linear least maximum approximations, thesis, UCLA 1961.
C. de Boor, Good approximation by splines with variable knots, ISNM 21 (1973) 57-72.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from gtcad.chebyshev import nodes
from gtcad.converters.spline_basis import EndOrder, Knots, both_ends, dense, end_derivatives, local_values
from gtcad.factors import KeyedFactors
from gtcad.protocol import Factors

Array = NDArray[np.float64]

_LAWSON_STEPS = 16
_NEAR_STEPS, _NEAR = 40, 1.1  # so many steps when the error is at most so many times the goal
HOPELESS_STEPS, HOPELESS = 6, 2.0  # after so many steps an error so many times the goal has not been seen to reach it
_DENSITY_POINTS = 240
FEW_POLES = 48  # above, banded normal equations take the place of an orthogonal factorisation
_HIGH_DEGREE = 11
_LEAST_WEIGHT = 1e-6
MOST_POLES = 160  # above, knots are not moved and errors not levelled: it would take too long


@dataclass(frozen=True, eq=False)
class Bundle:
    """The curves ``sum_i F_i(t) c_ij`` of one direction, j running over places in the other one.

    Attributes
    ----------
    factors
        F.
    vectors
        c, shape (count, places, d); one place for a curve.
    """

    factors: Factors
    vectors: Array

    def norms(self, rows: Array) -> Array:
        """Largest norm over the places, for factor values given as (points, count)."""
        return self._largest(rows @ self._by_coordinate)

    def compressed_norms(self, columns: Array) -> Array:
        """The same for values in the columns of ``compressed``."""
        return self._largest(columns @ self._compressed_by_coordinate)

    def _largest(self, values: Array) -> Array:
        return np.asarray(np.sqrt(np.einsum("dtj,dtj->tj", values, values).max(axis=1)))

    @cached_property
    def _by_coordinate(self) -> Array:
        return np.ascontiguousarray(np.moveaxis(self.vectors, -1, 0))

    @cached_property
    def _compressed_by_coordinate(self) -> Array:
        rows = self.compressed[1].reshape(-1, *self.vectors.shape[1:])
        return np.ascontiguousarray(np.moveaxis(rows, -1, 0))

    @cached_property
    def compressed(self) -> tuple[Array, Array]:
        """The vectors side by side as A @ B, A of at most count columns and B of orthonormal rows."""
        flat = self.vectors.reshape(len(self.vectors), -1)
        if flat.shape[1] <= len(flat):
            return flat, np.eye(flat.shape[1])
        q, r = np.linalg.qr(flat.T)
        return r.T, q.T


@dataclass(frozen=True, eq=False)
class Approximation:
    """A matrix from coefficients to poles.

    Attributes
    ----------
    knots
        Knots of the spline.
    matrix
        Shape (poles, count).
    values, residual
        The factors, and the factors less their splines, on the samples: shape (samples, count).
    errors
        Largest error over the places of the bundle, on each sample.
    """

    knots: Knots
    matrix: Array
    values: Array
    residual: Array
    errors: Array

    @cached_property
    def error(self) -> float:
        """Largest error of the bundle on the samples."""
        return float(self.errors.max())


class Problem:
    """Least-squares approximation of factors over one knot vector, for changing weights."""

    def __init__(self, factors: Factors, knots: Knots, end_order: EndOrder, density: int = 1) -> None:
        self.knots = knots
        z = nodes(density * max(knots.degree + 7, -(-4 * knots.poles // knots.spans)))
        self.local = local_values(knots, z)
        self.columns = knots.first[:, None] + np.arange(knots.degree + 1)
        self.values = factors.rows(knots.places(z).reshape(-1)).T
        first, last = end_poles(end_values(factors, max(both_ends(end_order))), knots, end_order)
        self.inner = slice(len(first), knots.poles - len(last))
        self.ends = np.zeros((knots.poles, factors.count))
        self.ends[: self.inner.start], self.ends[self.inner.stop :] = first, last

    def _spline(self, poles: Array) -> Array:
        return np.asarray(self.local @ poles[self.columns]).reshape(len(self.values), -1)

    def solve(self, weights: Array | None = None) -> Array:
        """The weighted least-squares matrix, shape (poles, count)."""
        matrix = self.ends.copy()
        if self.inner.start >= self.inner.stop:
            return matrix
        if not few_poles(self.knots):
            scaled = self.local if weights is None else self.local * weights.reshape(*self.local.shape[:2], 1)
            equations = self._equations(scaled)
            for _ in range(2):  # the second time for the rounding of the first
                right = self._collected(scaled, self.values - self._spline(matrix))[self.inner]
                matrix[self.inner] += scipy.linalg.cho_solve_banded((equations, False), right, check_finite=False)
            return matrix
        design, rest = self._dense, self.values - self._spline(matrix)
        if weights is not None:
            scale = np.sqrt(weights)[:, None]
            design, rest = design * scale, rest * scale
        count = design.shape[1]
        # the triangle of both side by side: its last columns are Q^T times the rest, and Q is never formed
        triangle = np.asarray(np.linalg.qr(np.concatenate([design, rest], axis=1), mode="r"))[:count]
        left, right = triangle[:, :count], triangle[:, count:]
        matrix[self.inner] = scipy.linalg.solve_triangular(left, right, check_finite=False)
        return matrix

    @cached_property
    def _dense(self) -> Array:
        return dense(self.local, self.columns, self.knots.poles)[:, self.inner]

    def _equations(self, scaled: Array) -> Array:
        """Cholesky factor of the banded normal equations."""
        order = self.knots.degree + 1
        blocks = scaled.swapaxes(1, 2) @ self.local
        bands = np.zeros((order, self.knots.poles))
        for low in range(order):
            for high in range(low, order):
                np.add.at(bands[order - 1 - (high - low)], self.columns[:, high], blocks[:, low, high])
        return np.asarray(scipy.linalg.cholesky_banded(bands[:, self.inner], check_finite=False))

    def _collected(self, scaled: Array, rest: Array) -> Array:
        """Inner products of all basis functions with values on the samples."""
        sums = np.zeros((self.knots.poles, rest.shape[1]))
        np.add.at(sums, self.columns, scaled.swapaxes(1, 2) @ rest.reshape(*self.local.shape[:2], -1))
        return sums

    def residual(self, matrix: Array) -> Array:
        """The factors less their splines on the samples, shape (samples, count)."""
        return self.values - self._spline(matrix)


def end_values(factors: Factors, order: int) -> Array:
    """Derivatives 0..order at both ends, shape (2, order + 1, count)."""
    ends = np.array([0.0, 1.0])
    return np.stack([factors.rows(ends, k).T for k in range(order + 1)], axis=1)


def end_poles(wanted: Array, knots: Knots, end_order: EndOrder) -> tuple[Array, Array]:
    """The first and the last poles, one more than the order of their end, from the derivatives there."""
    if end_order in (0, (0, 0)):
        return wanted[0, :1], wanted[1, :1]
    start, end = end_derivatives(knots, end_order)
    return _substituted(start, wanted[0, : len(start)]), _substituted(end, wanted[1, : len(end)])[::-1]


def has_room(knots: Knots, end_order: EndOrder) -> bool:
    """Whether the conditions at both ends leave the knots enough poles."""
    return knots.poles >= sum(both_ends(end_order)) + 2


def _substituted(triangle: Array, right: Array) -> Array:
    """Forward substitution: the end poles of a spline are the end points of the shape to the last digit."""
    solution = np.empty_like(right)
    for k, row in enumerate(right):
        solution[k] = (row - triangle[k, :k] @ solution[:k]) / triangle[k, k]
    return solution


def approximate(
    bundle: Bundle,
    knots: Knots,
    end_order: EndOrder = 0,
    *,
    steps: int = _LAWSON_STEPS,
    goal: float = 0.0,
    density: int = 1,
) -> Approximation:
    """Nearly the minimax spline of these knots: the best of a few steps of Lawson's iteration.

    Parameters
    ----------
    bundle
        What is approximated.
    knots
        Over which knots.
    end_order
        Derivatives 0..end_order are exact at both ends; a pair holds for the start and the end.
    steps
        Steps of the iteration, more when the goal is near; 0 leaves plain least squares.
    goal
        Stop at an error of this size.
    density
        Samples are so many times as dense.
    """
    problem = Problem(bundle.factors, knots, end_order, density)
    weights = np.ones(len(problem.values))
    best = None
    most = (max(steps, _NEAR_STEPS) if goal else steps) if knots.poles <= MOST_POLES else 0
    for step in range(most + 1):
        if best is not None and step > (HOPELESS_STEPS if goal else steps) and best.error > _NEAR * goal:
            break
        matrix = problem.solve(weights)
        residual = problem.residual(matrix)
        errors = bundle.norms(residual)
        error = float(errors.max())
        if best is None or error < best.error:
            best = Approximation(knots, matrix, problem.values, residual, errors)
        if error <= goal:
            break
        weights = normalised(weights * (errors / error + 1e-3))
    assert best is not None
    return best


def normalised(weights: Array) -> Array:
    """Largest 1, and none so small that the equations become singular."""
    return np.asarray(np.maximum(weights / weights.max(), _LEAST_WEIGHT))


def few_poles(knots: Knots) -> bool:
    """Whether an orthogonal factorisation is affordable, or needed: a high degree squares to ill condition."""
    return knots.poles <= (FEW_POLES if knots.degree <= _HIGH_DEGREE else MOST_POLES)


def equidistributed(bundle: Bundle, degree: int, spans: int) -> Array:
    """Breaks that share the integral of ``|(p + 1)-th derivative|^(1 / (p + 1))`` equally, shape (spans + 1,)."""
    grid, total = _shares(bundle, degree)
    breaks = np.interp(np.linspace(0, total[-1], spans + 1), total, grid)
    breaks[0], breaks[-1] = 0.0, 1.0
    return np.asarray(breaks)


@lru_cache(maxsize=64)
def _shares(bundle: Bundle, degree: int) -> tuple[Array, Array]:
    """Places, and the integral up to each: not quite 0 anywhere, or spans would have no end."""
    t = (nodes(_DENSITY_POINTS) + 1) / 2
    norms = bundle.norms(bundle.factors.rows(t, degree + 1).T)
    density = (norms / max(norms.max(), 1e-300)) ** (1 / (degree + 1)) + 0.02
    grid = np.concatenate([[0.0], (t[1:] + t[:-1]) / 2, [1.0]])
    return grid, np.concatenate([[0.0], np.cumsum(np.diff(grid) * density)])


def of_kind(factors: Factors, degree: int, continuity: int, end_order: EndOrder, spans: int) -> Approximation | None:
    """The approximation that depends on the factors alone, kept for the next piece of the kind.

    None when the knots leave no room for the end conditions.
    """
    return _of_kind(KeyedFactors(factors), degree, continuity, both_ends(end_order), spans)


@lru_cache(maxsize=512)
def _of_kind(
    kept: KeyedFactors, degree: int, continuity: int, end_order: tuple[int, int], spans: int
) -> Approximation | None:
    bundle = _all_factors(kept)
    knots = Knots.smooth(equidistributed(bundle, degree, spans), degree, continuity)
    if not has_room(knots, end_order):
        return None
    return approximate(bundle, knots, end_order, steps=2 if knots.poles <= MOST_POLES else 0)


@lru_cache(maxsize=64)
def _all_factors(kept: KeyedFactors) -> Bundle:
    """Each factor as a curve of its own."""
    return Bundle(kept.factors, np.eye(kept.factors.count)[:, :, None])
