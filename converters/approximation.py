"""Splines that approximate all curves of one direction at once: for given knots, and for knots of their own.

A spline approximates the factors F of a shape through one matrix M: poles = M @ coefficients. M is the weighted
least-squares solution with the derivatives 0..r exact at both ends; weights that grow where the error of the actual
piece is largest (Lawson's iteration) take it towards the minimax solution. Knots start where they equidistribute the
(p + 1)-th derivative of the piece; Gauss-Newton steps on the least-squares error with the poles eliminated (variable
projection, Kaufman's form) and Lawson's weights move them towards the free-knot minimax spline.

Nothing here is proved: errors are taken on samples and guide the search.

References
----------
C. L. Lawson, Contributions to the theory of linear least maximum approximations, thesis, UCLA 1961.
C. de Boor, Good approximation by splines with variable knots, ISNM 21 (1973) 57-72.
L. Kaufman, A variable projection method for solving separable nonlinear least squares problems, BIT 15 (1975) 49-57.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import scipy.linalg
from numpy.typing import NDArray
from scipy.interpolate import BSpline

from gtcad.chebyshev import nodes
from gtcad.converters.spline_basis import EndOrder, Knots, both_ends, dense, end_derivatives, local_values
from gtcad.factors import KeyedFactors
from gtcad.protocol import Factors

Array = NDArray[np.float64]

_LAWSON_STEPS = 16
_KNOT_STEPS = 24
_DENSITY_POINTS = 240
_DENSE_POLES = 160  # above, banded normal equations take the place of an orthogonal factorisation
_LEAST_GAP = 0.02  # of the mean span: knots that approach each other further trouble kernels


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
        return self._largest(rows @ self.vectors.reshape(len(self.vectors), -1))

    def compressed_norms(self, columns: Array) -> Array:
        """The same for values in the columns of ``compressed``."""
        return self._largest(columns @ self.compressed[1])

    def _largest(self, values: Array) -> Array:
        values = values.reshape(len(values), *self.vectors.shape[1:])
        return np.asarray(np.sqrt(np.einsum("tjd,tjd->tj", values, values).max(axis=1)))

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
    error
        Largest error of the bundle on the samples.
    """

    knots: Knots
    matrix: Array
    values: Array
    residual: Array
    error: float


class Problem:
    """Least-squares approximation of factors over one knot vector, for changing weights."""

    def __init__(self, factors: Factors, knots: Knots, end_order: EndOrder) -> None:
        self.knots = knots
        z = nodes(max(knots.degree + 7, -(-4 * knots.poles // knots.spans)))
        self.local = local_values(knots, z)
        self.columns = knots.first[:, None] + np.arange(knots.degree + 1)
        self.values = factors.rows(knots.places(z).reshape(-1)).T
        first, last = _end_poles(factors, knots, end_order)
        self.inner = slice(len(first), knots.poles - len(last))
        self.ends = np.zeros((knots.poles, factors.count))
        self.ends[: self.inner.start], self.ends[self.inner.stop :] = first, last
        self.rest = self.values - self._spline(self.ends)

    def _spline(self, poles: Array) -> Array:
        return np.asarray(self.local @ poles[self.columns]).reshape(len(self.values), -1)

    def solve(self, weights: Array | None = None) -> Array:
        """The weighted least-squares matrix, shape (poles, count)."""
        matrix = self.ends.copy()
        if self.inner.start >= self.inner.stop:
            return matrix
        if self.knots.poles > _DENSE_POLES:
            matrix[self.inner] = self._solve_banded(self.rest)
            matrix[self.inner] += self._solve_banded(self.values - self._spline(matrix))  # the rounding of the first
            return matrix
        design, rest = self._dense, self.rest
        if weights is not None:
            scale = np.sqrt(weights)[:, None]
            design, rest = design * scale, rest * scale
        q, r = np.linalg.qr(design)
        matrix[self.inner] = np.linalg.solve(r, q.T @ rest)
        return matrix

    @cached_property
    def _dense(self) -> Array:
        return dense(self.local, self.columns, self.knots.poles)[:, self.inner]

    def _solve_banded(self, rest: Array) -> Array:
        order = self.knots.degree + 1
        blocks = self.local.swapaxes(1, 2) @ self.local
        bands = np.zeros((order, self.knots.poles))
        for low in range(order):
            for high in range(low, order):
                np.add.at(bands[order - 1 - (high - low)], self.columns[:, high], blocks[:, low, high])
        right = np.zeros((self.knots.poles, rest.shape[1]))
        np.add.at(right, self.columns, self.local.swapaxes(1, 2) @ rest.reshape(*self.local.shape[:2], -1))
        solved = scipy.linalg.solveh_banded(bands[:, self.inner], right[self.inner])
        return np.asarray(solved)

    def residual(self, matrix: Array) -> Array:
        """The factors less their splines on the samples, shape (samples, count)."""
        return self.values - self._spline(matrix)


def _end_poles(factors: Factors, knots: Knots, end_order: EndOrder) -> tuple[Array, Array]:
    """The first and the last rows of the matrix, one more than the order of their end, from its derivatives."""
    ends = np.array([0.0, 1.0])
    start, end = end_derivatives(knots, end_order)
    wanted = np.stack([factors.rows(ends, k) for k in range(max(len(start), len(end)))])  # (order, count, end)
    return _substituted(start, wanted[: len(start), :, 0]), _substituted(end, wanted[: len(end), :, 1])[::-1]


def _has_room(knots: Knots, end_order: EndOrder) -> bool:
    """Whether the conditions at both ends leave the knots enough poles."""
    return knots.poles >= sum(both_ends(end_order)) + 2


def _substituted(triangle: Array, right: Array) -> Array:
    """Forward substitution: the end poles of a spline are the end points of the shape to the last digit."""
    solution = np.empty_like(right)
    for k, row in enumerate(right):
        solution[k] = (row - triangle[k, :k] @ solution[:k]) / triangle[k, k]
    return solution


def approximate(
    bundle: Bundle, knots: Knots, end_order: EndOrder = 0, *, steps: int = _LAWSON_STEPS, goal: float = 0.0
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
        Steps of the iteration; 0 leaves plain least squares.
    goal
        Stop at an error of this size.
    """
    problem = Problem(bundle.factors, knots, end_order)
    weights = np.ones(len(problem.values))
    best = None
    for _ in range(steps + 1 if knots.poles <= _DENSE_POLES else 1):
        matrix = problem.solve(weights)
        residual = problem.residual(matrix)
        errors = bundle.norms(residual)
        error = float(errors.max())
        if best is None or error < best.error:
            best = Approximation(knots, matrix, problem.values, residual, error)
        if error <= goal:
            break
        weights = weights * (errors / error + 1e-3)
        weights /= weights.max()
    assert best is not None
    return best


def equidistributed(bundle: Bundle, degree: int, spans: int) -> Array:
    """Breaks that share the integral of ``|(p + 1)-th derivative|^(1 / (p + 1))`` equally, shape (spans + 1,)."""
    t = (nodes(_DENSITY_POINTS) + 1) / 2
    norms = bundle.norms(bundle.factors.rows(t, degree + 1).T)
    density = (norms / max(norms.max(), 1e-300)) ** (1 / (degree + 1)) + 0.02
    grid = np.concatenate([[0.0], (t[1:] + t[:-1]) / 2, [1.0]])
    total = np.concatenate([[0.0], np.cumsum(np.diff(grid) * density)])
    breaks = np.interp(np.linspace(0, total[-1], spans + 1), total, grid)
    breaks[0], breaks[-1] = 0.0, 1.0
    return np.asarray(breaks)


def of_kind(factors: Factors, degree: int, continuity: int, end_order: EndOrder, spans: int) -> Approximation | None:
    """The approximation that depends on the factors alone, kept for the next piece of the kind.

    None when the knots leave no room for the end conditions.
    """
    return _of_kind(KeyedFactors(factors), degree, continuity, both_ends(end_order), spans)


@lru_cache(maxsize=512)
def _of_kind(
    kept: KeyedFactors, degree: int, continuity: int, end_order: tuple[int, int], spans: int
) -> Approximation | None:
    factors = kept.factors
    bundle = Bundle(factors, np.eye(factors.count)[:, :, None])
    knots = Knots.smooth(equidistributed(bundle, degree, spans), degree, continuity)
    if not _has_room(knots, end_order):
        return None
    return approximate(bundle, knots, end_order, steps=2 if knots.poles <= _DENSE_POLES else 0)


def adapted(
    bundle: Bundle, degree: int, spans: int, end_order: EndOrder = 0, *, goal: float = 0.0, start: Array | None = None
) -> Approximation | None:
    """Nearly the best spline with that many spans and simple knots, its knots moved for this bundle.

    Parameters
    ----------
    bundle
        What is approximated.
    degree, spans, end_order
        As in ``approximate``.
    goal
        Stop at an error of this size.
    start
        Breaks to start from, equidistributed ones unless given.

    Returns
    -------
    Approximation or None
        None when the knots leave no room for the end conditions.
    """
    breaks = equidistributed(bundle, degree, spans) if start is None else start
    if not _has_room(Knots.smooth(breaks, degree), end_order):
        return None
    if spans > 1 and spans + degree <= _DENSE_POLES:
        breaks = _KnotSearch(bundle, degree, end_order, breaks).run(goal)
    return approximate(bundle, Knots.smooth(breaks, degree), end_order, goal=goal)


@dataclass(eq=False)
class _Trial:
    """One knot vector of a search: its weighted least-squares solution on the fixed samples."""

    breaks: Array
    flat: Array
    poles: Array
    residual: Array
    basis: Array  # orthonormal columns that span the free part of the weighted design matrix


class _KnotSearch:
    """Gauss-Newton on the breaks, Levenberg-Marquardt damped, with weights that follow the error."""

    def __init__(self, bundle: Bundle, degree: int, end_order: EndOrder, breaks: Array) -> None:
        self.bundle, self.degree, self.end_order, self.start = bundle, degree, end_order, breaks
        spans = len(breaks) - 1
        self.t = (nodes(max(160, 10 * (spans + degree))) + 1) / 2
        self.columns = bundle.compressed[0]
        self.target = bundle.factors.rows(self.t).T @ self.columns
        self.least = _LEAST_GAP / spans

    def run(self, goal: float) -> Array:
        """The breaks of the least largest error that was seen."""
        weights = np.ones(len(self.t))
        trial = self._solve(self.start, weights)
        best, best_error, damping, idle = self.start, np.inf, 1e-2, 0
        for _ in range(_KNOT_STEPS):
            errors = self.bundle.compressed_norms(trial.residual)
            error = float(errors.max())
            idle = 0 if error < 0.98 * best_error else idle + 1
            if error < best_error:
                best, best_error = trial.breaks, error
            if error <= 0.9 * goal or idle > 6 or error == 0:
                break
            weights = weights * np.sqrt(errors / error + 1e-3)
            weights /= weights.max()
            trial = self._solve(trial.breaks, weights)
            trial, damping = self._step(trial, weights, damping)
        return best

    def _solve(self, breaks: Array, weights: Array) -> _Trial:
        knots = Knots.smooth(breaks, self.degree)
        flat = knots.flat
        design = BSpline.design_matrix(self.t, flat, self.degree).toarray()
        first, last = _end_poles(self.bundle.factors, knots, self.end_order)
        free = slice(len(first), knots.poles - len(last))
        poles = np.zeros((knots.poles, self.target.shape[1]))
        poles[: free.start], poles[free.stop :] = first @ self.columns, last @ self.columns
        scale = np.sqrt(weights)[:, None]
        basis, triangle = np.linalg.qr(design[:, free] * scale)
        right = basis.T @ ((self.target - design @ poles) * scale)
        poles[free] = np.linalg.solve(triangle, right)
        return _Trial(breaks, flat, poles, self.target - design @ poles, basis)

    def _jacobian(self, trial: _Trial, scale: Array) -> Array:
        """Change of the weighted spline with each interior break, less what the poles can take up.

        ``dS/dtau_r = -sum_{j=r-p..r} (c_j - c_{j-1}) / (t^_{j+p+1} - t^_j) N^_j``, ^ after doubling the knot tau_r.
        """
        columns = []
        for knot in range(self.degree + 1, len(trial.flat) - self.degree - 1):
            doubled = np.insert(trial.flat, knot, trial.flat[knot])
            j = np.arange(knot - self.degree, knot + 1)
            gaps = doubled[j + self.degree + 1] - doubled[j]
            change = np.zeros((len(trial.poles) + 1, trial.poles.shape[1]))
            change[j] = -(trial.poles[j] - trial.poles[j - 1]) / gaps[:, None]
            column = BSpline(doubled, change, self.degree)(self.t) * scale
            columns.append((column - trial.basis @ (trial.basis.T @ column)).reshape(-1))
        return np.array(columns).T

    def _step(self, trial: _Trial, weights: Array, damping: float) -> tuple[_Trial, float]:
        """One damped step that lowers the weighted error; the trial itself when none does."""
        scale = np.sqrt(weights)[:, None]
        jacobian = self._jacobian(trial, scale)
        residual = (trial.residual * scale).reshape(-1)
        normal, gradient = jacobian.T @ jacobian, jacobian.T @ residual
        cost, diagonal = residual @ residual, np.diag(np.diag(normal)) + 1e-300 * np.eye(len(normal))
        for _ in range(5):
            move = np.zeros(len(trial.breaks))
            move[1:-1] = np.linalg.lstsq(normal + damping * diagonal, gradient, rcond=None)[0]
            gaps = np.diff(trial.breaks)
            room = np.maximum(0.6 * gaps, 0) / np.maximum(-np.diff(move), 1e-300)
            breaks = trial.breaks + min(1.0, float(room.min())) * move
            if np.diff(breaks).min() >= min(self.least, gaps.min()):
                moved = self._solve(breaks, weights)
                if ((moved.residual * scale) ** 2).sum() < cost:
                    return moved, max(damping / 5, 1e-6)
            damping *= 6
        return trial, 1e-2
