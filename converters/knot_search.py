"""Approximations with knots of their own: moved for one bundle of curves towards the free-knot minimax spline.

Knots start where they equidistribute the (p + 1)-th derivative; Gauss-Newton steps on the least-squares error with the
poles eliminated (variable projection, Kaufman's form) and Lawson's weights move them.

Nothing here is proved: errors are taken on samples and guide the search.

References
----------
L. Kaufman, A variable projection method for solving separable nonlinear least squares problems, BIT 15 (1975) 49-57.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from gtcad.chebyshev import nodes
from gtcad.converters.approximation import (
    FEW_POLES,
    HOPELESS,
    HOPELESS_STEPS,
    MOST_POLES,
    Approximation,
    Bundle,
    approximate,
    end_poles,
    end_values,
    equidistributed,
    few_poles,
    has_room,
    normalised,
)
from gtcad.converters.spline_basis import EndOrder, Knots, Sampled, both_ends, doubled, sampled, top_jumps

Array = NDArray[np.float64]
Sparse = Any  # scipy's sparse arrays carry no types

_KNOT_STEPS = 24
_SPREADS = (1.0, 1.5, 0.5)  # powers of the equidistributed spans from which searches start
_NEAR_MISS = 1.3  # of the goal: worth another start
_DENSITY = 3  # of samples where the error has to be close to the true one
_LEAST_GAP = 0.02  # of the mean span: knots that approach each other further trouble kernels


def adapted(
    bundle: Bundle, degree: int, spans: int, end_order: EndOrder = 0, *, goal: float = 0.0
) -> Approximation | None:
    """Nearly the best spline with that many spans and simple knots, its knots moved for this bundle.

    The search is local and starts from equidistributed knots; where it nearly reaches the goal, also from knots that
    are spread more evenly, and less.

    Parameters
    ----------
    bundle
        What is approximated.
    degree, spans, end_order
        As in ``approximate``.
    goal
        Stop at an error of this size.

    Returns
    -------
    Approximation or None
        None when the knots leave no room for the end conditions.
    """
    even = equidistributed(bundle, degree, spans)
    if not has_room(Knots.smooth(even, degree), end_order):
        return None
    best = None
    for power in _SPREADS if 1 < spans <= FEW_POLES - degree else _SPREADS[:1]:
        gaps = np.diff(even) ** power
        breaks = np.concatenate([[0.0], np.cumsum(gaps)[:-1] / gaps.sum(), [1.0]])
        if 1 < spans <= MOST_POLES - degree:
            breaks = _KnotSearch(bundle, degree, end_order, breaks).run(goal)
        one = approximate(bundle, Knots.smooth(breaks, degree), end_order, goal=goal, density=_DENSITY)
        if best is None or one.error < best.error:
            best = one
        if not goal < best.error <= _NEAR_MISS * goal:
            break
    return best


@dataclass(eq=False)
class _Trial:
    """One knot vector of a search: its weighted least-squares solution on the fixed samples."""

    breaks: Array
    flat: Array
    poles: Array
    residual: Array
    space: _Orthonormal | _Banded


class _Orthonormal:
    """Weighted least squares over a few functions, by an orthogonal factorisation."""

    def __init__(self, design: Array, weights: Array) -> None:
        self.scale = np.sqrt(weights)[:, None]
        self.basis, self.triangle = np.linalg.qr(design * self.scale)

    def solve(self, right: Array) -> Array:
        return np.linalg.solve(self.triangle, self.basis.T @ (right * self.scale))

    def outside(self, others: Sampled) -> Array:
        """Weighted inner products of other functions, less what these can take up of them."""
        scaled = others.dense() * self.scale
        scaled -= self.basis @ (self.basis.T @ scaled)
        return np.asarray(scaled.T @ scaled)


class _Banded:
    """The same over many functions, by normal equations: each function overlaps ``degree`` others on either side."""

    def __init__(self, design: Sparse, weights: Array, degree: int) -> None:
        self.design, self.weights = design, weights
        self.weighted = design.multiply(weights[:, None]).T.tocsr()
        gram = self.weighted @ design
        bands = np.zeros((degree + 1, gram.shape[0]))
        for k in range(degree + 1):
            bands[degree - k, k:] = gram.diagonal(k)
        self.factor = scipy.linalg.cholesky_banded(bands, check_finite=False), False

    def solve(self, right: Array) -> Array:
        solution = self._solve(self.weighted @ right)
        return solution + self._solve(self.weighted @ (right - self.design @ solution))  # the rounding of the first

    def outside(self, others: Sampled) -> Array:
        """Weighted inner products of other functions, less what these can take up of them."""
        columns = others.sparse()
        onto = self.weighted @ columns
        own = columns.T @ columns.multiply(self.weights[:, None])
        return np.asarray(own.toarray() - onto.T @ self._solve(onto.toarray()))

    def _solve(self, right: Array) -> Array:
        return np.asarray(scipy.linalg.cho_solve_banded(self.factor, right, check_finite=False))


class _KnotSearch:
    """Gauss-Newton on the breaks, Levenberg-Marquardt damped, with weights that follow the error."""

    def __init__(self, bundle: Bundle, degree: int, end_order: EndOrder, breaks: Array) -> None:
        self.bundle, self.degree, self.start = bundle, degree, breaks
        self.end_order = both_ends(end_order)
        spans = len(breaks) - 1
        self.t = (nodes(max(160, 10 * (spans + degree))) + 1) / 2
        self.columns = bundle.compressed[0]
        self.target = bundle.factors.rows(self.t).T @ self.columns
        self.wanted = end_values(bundle.factors, max(self.end_order)) @ self.columns
        self.least = _LEAST_GAP / spans

    def run(self, goal: float) -> Array:
        """The breaks of the least largest error that was seen."""
        weights = np.ones(len(self.t))
        trial = self._solve(self.start, weights)
        best, best_error, damping, idle = self.start, np.inf, 1e-2, 0
        for step in range(_KNOT_STEPS):
            errors = self.bundle.compressed_norms(trial.residual)
            error = float(errors.max())
            idle = 0 if error < 0.98 * best_error else idle + 1
            if error < best_error:
                best, best_error = trial.breaks, error
            hopeless = step >= HOPELESS_STEPS and best_error > HOPELESS * goal > 0
            if error <= 0.9 * goal or idle > 6 or error == 0 or hopeless:
                break
            weights = normalised(weights * np.sqrt(errors / error + 1e-3))
            trial = self._solve(trial.breaks, weights)
            trial, damping = self._step(trial, weights, damping)
        return best

    def _solve(self, breaks: Array, weights: Array) -> _Trial:
        knots = Knots.smooth(breaks, self.degree)
        flat = knots.flat
        few = few_poles(knots)
        functions = sampled(flat, self.degree, self.t)
        design = functions.dense() if few else functions.sparse()
        first, last = end_poles(self.wanted, knots, self.end_order)
        free = slice(len(first), knots.poles - len(last))
        poles = np.zeros((knots.poles, self.target.shape[1]))
        poles[: free.start], poles[free.stop :] = first, last
        inner = design[:, free]
        space = _Orthonormal(inner, weights) if few else _Banded(inner, weights, self.degree)
        poles[free] = space.solve(self.target - design @ poles)
        return _Trial(breaks, flat, poles, self.target - design @ poles, space)

    def _step(self, trial: _Trial, weights: Array, damping: float) -> tuple[_Trial, float]:
        """One damped step that lowers the weighted error; the trial itself when none does.

        When a knot tau moves, the spline changes by a multiple of one B-spline that has tau as a double knot, up to
        functions that the poles take up. The multiple is the ratio of jumps at tau: of the spline's p-th derivative
        and of the B-spline's (p - 1)-th, hence of rank one over the coordinates.
        """
        bumps, jumps = doubled(trial.flat, self.degree, self.end_order, self.t)
        change = -top_jumps(trial.poles, trial.flat, self.degree) / jumps[:, None]
        weighted = trial.residual * weights[:, None]
        onto = (bumps.dense() if len(change) < FEW_POLES else bumps.sparse()).T @ weighted
        gradient = np.einsum("rd,rd->r", onto, change)
        normal = trial.space.outside(bumps) * (change @ change.T)
        diagonal = np.diag(normal)
        if not diagonal.max() > 0:
            return trial, damping
        cost, diagonal = float(np.vdot(weighted, trial.residual)), np.maximum(diagonal, 1e-12 * diagonal.max())
        gaps = np.diff(trial.breaks)
        for _ in range(5):
            move = np.zeros(len(trial.breaks))
            move[1:-1] = np.linalg.solve(normal + damping * np.diag(diagonal), gradient)
            room = np.maximum(0.6 * gaps, 0) / np.maximum(-np.diff(move), 1e-300)
            breaks = trial.breaks + min(1.0, float(room.min())) * move
            if np.diff(breaks).min() >= min(self.least, gaps.min()):
                moved = self._solve(breaks, weights)
                if float(np.vdot(moved.residual * weights[:, None], moved.residual)) < cost:
                    return moved, max(damping / 5, 1e-6)
            damping *= 6
        return trial, 1e-2
