"""Least squares in the control points and design variables of a curve, and in the parameters of the points.

The basis depends affinely on its design variables, ``f_i(t; g1, g2) = a_i(t) + g1 b_i(t) + g2 c_i(t)``, and the curve
linearly on its control points. Least squares therefore eliminates the control points (variable projection): for each
pair of design variables they are the solution of a linear problem, and only two unknowns are left.

References
----------
G. Golub, V. Pereyra, Separable nonlinear least squares: the variable projection method and its applications, Inverse
Problems 19 (2003) R1-R26.
L. Kaufman, A variable projection method for solving separable nonlinear least squares problems, BIT 15 (1975) 49-57.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gtcad.basis import Basis, Family, Gamma
from gtcad.errors import InputError

Array = NDArray[np.float64]

_RANK = 1e-14  # singular values below this part of the whole matrix carry no digit
_GRID = np.linspace(-1.0, 1.0, 17)  # of the design variables, in each direction: where the search starts
_STARTS = 4
_STEPS = 100
_STALLED = 1e-5  # relative decrease of the sum of squares
_FEET = 4  # Gauss-Newton steps to a foot point, for each step of the curve


@dataclass(frozen=True, eq=False)
class Model:
    """A curve's control points: those that its ends determine, and the free ones between them.

    ``tables`` hold basis functions as (constant, factor of gamma_1, factor of gamma_2), shape (3, places, n + 1).
    """

    degree: int
    family: Family
    start: Array  # derivatives 0.. at t = 0 that must be met, shape (k, d)
    end: Array  # at t = 1
    base: Array  # where control points are drawn to that nothing determines
    free: slice = field(init=False)
    start_tables: Array = field(init=False)
    end_tables: Array = field(init=False)

    def __post_init__(self) -> None:
        a, b = len(self.start), len(self.end)
        if a + b > self.degree + 1:
            raise InputError(f"degree {self.degree} is too low for {a} and {b} end conditions: {a + b - 1} at least")
        object.__setattr__(self, "free", slice(a, self.degree + 1 - b))
        rows = [[self.tables(np.array([t]), k)[:, 0] for k in range(n)] for t, n in ((0.0, a), (1.0, b))]
        shape = (0, 3, self.degree + 1)
        starts, ends = (np.array(one).reshape(-1, *shape[1:]).swapaxes(0, 1) for one in rows)
        object.__setattr__(self, "start_tables", starts[..., :a])
        object.__setattr__(self, "end_tables", ends[..., self.degree + 1 - b :])

    def tables(self, t: Array, order: int = 0) -> Array:
        """Of the derivatives of the order at flat parameters."""
        corners = ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0)) if self.family.takes_gamma else ((0.0, 0.0),) * 3
        rows = np.array([Basis(self.degree, corner, self.family).derivative(t, order) for corner in corners])
        rows[1:] -= rows[0]
        return rows

    def held(self, gamma: Gamma) -> Array:
        """Control points, the free ones at their base."""
        control = self.base.copy()
        for part, tables, wanted in self.ends:
            control[part] = np.linalg.solve(_at(tables, gamma), wanted)
        first, last = self.start[:1], self.end[:1]
        control[: len(first)], control[len(control) - len(last) :] = first, last  # to the last digit
        return control

    @property
    def ends(self) -> tuple[tuple[slice, Array, Array], ...]:
        """For each end that is held: its control points, the tables of its derivatives, what these must be."""
        ends = (
            (slice(0, self.free.start), self.start_tables, self.start),
            (
                slice(self.free.stop, None),
                self.end_tables,
                self.end,
            ),
        )
        return tuple(end for end in ends if len(end[2]))

    def solve(self, tables: Array, target: Array, gamma: Gamma) -> tuple[Array, Array, Array]:
        """Control points of least squares, what is left of the target, and orthonormal columns of what they span."""
        control = self.held(gamma)
        matrix = _at(tables, gamma)
        left = target - matrix @ control
        columns, values, rows = np.linalg.svd(matrix[:, self.free], full_matrices=False)
        kept = values > _RANK * np.linalg.norm(matrix)
        columns = columns[:, kept]
        parts = columns.T @ left
        control[self.free] += rows[kept].T @ (parts / values[kept, None])
        return control, left - columns @ parts, columns

    def slopes(self, tables: Array, gamma: Gamma, control: Array) -> Array:
        """How the curve changes with gamma while its free control points stay, shape (2, places, d)."""
        changes = np.zeros((2, *control.shape))
        for part, ends, _ in self.ends:
            changes[:, part] = -np.linalg.solve(_at(ends, gamma), ends[1:] @ control[part])
        return np.asarray(tables[1:] @ control + _at(tables, gamma) @ changes)


def _at(tables: Array, gamma: Gamma) -> Array:
    return np.asarray(tables[0] + gamma[0] * tables[1] + gamma[1] * tables[2])


def weighted(model: Model, t: Array, points: Array, roots: Array) -> tuple[Array, Array]:
    """Tables and points times the roots of the weights, the rows replaced by fewer of equal sums of squares."""
    tables, target = model.tables(t) * roots[:, None], points * roots[:, None]
    rows = np.concatenate([*tables, target], axis=1)
    if len(rows) > rows.shape[1]:
        rows = np.asarray(np.linalg.qr(rows, mode="r"))
        count = model.degree + 1
        tables = np.array([rows[:, k * count : (k + 1) * count] for k in range(3)])
        target = rows[:, 3 * count :]
    return tables, target


def nearest_gamma(model: Model, tables: Array, target: Array) -> Gamma:
    """The design variables of the least sum of squares: from the best places of a grid, by variable projection."""
    from scipy.optimize import least_squares

    size = max(float(np.linalg.norm(target - _at(tables, (0.0, 0.0)) @ model.base)), np.finfo(float).tiny)

    def residual(gamma: Array) -> Array:
        return (model.solve(tables, target, _pair(gamma))[1] / size).reshape(-1)

    def jacobian(gamma: Array) -> Array:
        control, _, columns = model.solve(tables, target, _pair(gamma))
        slopes = model.slopes(tables, _pair(gamma), control)
        return ((columns @ (columns.T @ slopes) - slopes) / size).reshape(2, -1).T

    costs = _costs(model, tables, target)
    padded = np.pad(costs, 1, constant_values=np.inf)
    around = np.min([padded[i : i + len(_GRID), j : j + len(_GRID)] for i in range(3) for j in range(3)], axis=0)
    places = np.argwhere(costs <= around)
    places = places[np.argsort(costs[tuple(places.T)])][:_STARTS]
    found = [
        least_squares(
            residual, _GRID[place], jacobian, (-1, 1), method="dogbox", ftol=1e-12, xtol=1e-15, gtol=None, max_nfev=40
        )
        for place in places
    ]
    return _pair(min(found, key=lambda one: float(one.cost)).x)


def _costs(model: Model, tables: Array, target: Array) -> Array:
    """Roots of the least sums of squares for the design variables of the grid, shape (17, 17)."""
    mixes = np.array([(1.0, a, b) for a in _GRID for b in _GRID])
    matrices = np.tensordot(mixes, tables, 1)
    control = np.repeat(model.base[None], len(mixes), axis=0)
    for part, ends, wanted in model.ends:
        control[:, part] = np.linalg.solve(np.tensordot(mixes, ends, 1), wanted)
    left = target - matrices @ control
    columns = np.linalg.qr(matrices[..., model.free])[0]
    left -= columns @ (columns.swapaxes(1, 2) @ left)
    return np.asarray(np.linalg.norm(left, axis=(1, 2)).reshape(len(_GRID), -1))


def _pair(gamma: Array) -> Gamma:
    first, second = np.clip(gamma, -1.0, 1.0).tolist()
    return first, second


@dataclass(frozen=True, eq=False)
class Correction:
    """Gauss-Newton on curve and parameters together, Levenberg-Marquardt damped.

    The step of a parameter follows from that of the curve: it takes up all of the change along the tangent. What is
    left are the components across it, in the control points and design variables alone.
    """

    model: Model
    points: Array
    roots: Array
    searched: bool
    fixed_ends: bool

    def run(self, gamma: Gamma, control: Array, t: Array) -> tuple[Gamma, Array, int]:
        """Design variables, parameters and number of steps when the sum of squares has stalled."""
        t = self.feet(gamma, control, t)
        cost, damping = self._cost(gamma, control, t), 1e-6
        for step in range(1, _STEPS + 1):
            matrix, right = self._linear(gamma, control, t)
            while damping < 1e8:
                trial = self._moved(gamma, control, self._solved(matrix, right, damping, gamma))
                feet = self.feet(*trial, t)
                reached = self._cost(*trial, feet)
                if reached < cost:
                    break
                damping *= 10
            else:
                return gamma, t, step
            stalled = reached > (1 - _STALLED) * cost
            (gamma, control), t, cost, damping = trial, feet, reached, max(damping / 10, 1e-14)
            if stalled:
                return gamma, t, step
        return gamma, t, _STEPS

    def _cost(self, gamma: Gamma, control: Array, t: Array) -> float:
        gaps = (self.points - _at(self.model.tables(t), gamma) @ control) * self.roots[:, None]
        return float((gaps * gaps).sum())

    def feet(self, gamma: Gamma, control: Array, t: Array, steps: int = _FEET) -> Array:
        """Parameters moved towards the foot points, where that brings them nearer."""
        gaps = self.points - _at(self.model.tables(t), gamma) @ control
        for _ in range(steps):
            speeds = _at(self.model.tables(t, 1), gamma) @ control
            squares = np.maximum((speeds * speeds).sum(axis=1), np.finfo(float).tiny)
            moved = np.clip(t + (speeds * gaps).sum(axis=1) / squares, 0.0, 1.0)
            if self.fixed_ends:
                moved[[0, -1]] = 0.0, 1.0
            after = self.points - _at(self.model.tables(moved), gamma) @ control
            nearer = (after * after).sum(axis=1) < (gaps * gaps).sum(axis=1)
            t, gaps = np.where(nearer, moved, t), np.where(nearer[:, None], after, gaps)
        return t

    def _linear(self, gamma: Gamma, control: Array, t: Array) -> tuple[Array, Array]:
        """Matrix and right-hand side of a step: control points first, then design variables, across the tangents."""
        tables = self.model.tables(t)
        matrix = _at(tables, gamma)
        gaps = self.points - matrix @ control
        tangents = _at(self.model.tables(t, 1), gamma) @ control
        slope = (tangents * gaps).sum(axis=1)
        stuck = ((t <= 0) & (slope < 0)) | ((t >= 1) & (slope > 0))
        if self.fixed_ends:
            stuck[[0, -1]] = True
        lengths = np.linalg.norm(tangents, axis=1)
        tangents = np.where((stuck | (lengths == 0))[:, None], 0.0, tangents / np.maximum(lengths, 1e-300)[:, None])
        across = np.eye(tangents.shape[1]) - tangents[:, :, None] * tangents[:, None, :]  # (m, d, d)
        across *= self.roots[:, None, None]
        blocks = (matrix[:, None, self.model.free, None] * across[:, :, None, :]).reshape(gaps.size, -1)
        if self.searched:
            slopes = np.einsum("mde,gme->mdg", across, self.model.slopes(tables, gamma, control))
            blocks = np.concatenate([blocks, slopes.reshape(gaps.size, 2)], axis=1)
        return blocks, np.einsum("mde,me->md", across, gaps).reshape(-1)

    def _solved(self, matrix: Array, right: Array, damping: float, gamma: Gamma) -> Array:
        """The damped step; a design variable that would leave [-1, 1] stops at the end, and the rest is solved anew."""
        scales = np.maximum(np.linalg.norm(matrix, axis=0), np.finfo(float).tiny)
        damped = np.concatenate([matrix, np.diag(math.sqrt(damping) * scales)])
        wanted = np.concatenate([right, np.zeros(len(scales))])
        step = np.zeros(len(scales))
        free = np.ones(len(scales), dtype=bool)
        for _ in range(3 if self.searched else 1):
            rest = wanted - damped[:, ~free] @ step[~free]
            step[free] = np.linalg.lstsq(damped[:, free], rest, rcond=None)[0]
            if self.searched:
                limited = np.clip(np.array(gamma) + step[-2:], -1.0, 1.0) - gamma
                free[-2:] &= limited == step[-2:]
                step[-2:] = limited
        return step

    def _moved(self, gamma: Gamma, control: Array, step: Array) -> tuple[Gamma, Array]:
        if self.searched:
            gamma, step = _pair(gamma + step[-2:]), step[:-2]
        moved = self.model.held(gamma)
        moved[self.model.free] = control[self.model.free] + step.reshape(-1, control.shape[1])
        return gamma, moved
