"""Curves through points and nearest to points, the design variables among the unknowns where wanted.

The basis depends affinely on its design variables, ``f_i(t; g1, g2) = a_i(t) + g1 b_i(t) + g2 c_i(t)``, and the curve
linearly on its control points. Least squares therefore eliminates the control points (variable projection): for each
pair of design variables they are the solution of a linear problem, and only two unknowns are left.

References
----------
G. Golub, V. Pereyra, Separable nonlinear least squares: the variable projection method and its applications, Inverse
Problems 19 (2003) R1-R26.
L. Kaufman, A variable projection method for solving separable nonlinear least squares problems, BIT 15 (1975) 49-57.
L. Piegl, W. Tiller, The NURBS Book, 2nd ed., Springer 1997, section 9.2.1 (parameters).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.basis import GT, Basis, Family, Gamma, checked_gamma
from gtcad.curve import Curve
from gtcad.errors import InputError
from gtcad.protocol import checked_points

Array = NDArray[np.float64]
Parameters = str | ArrayLike

_EXPONENTS = {"chord": 1.0, "centripetal": 0.5, "uniform": 0.0}
_EPSILON = float(np.finfo(np.float64).eps)
_RANK = 1e-14  # singular values below this part of the whole matrix carry no digit
_GRID = np.linspace(-1.0, 1.0, 17)  # of the design variables, in each direction: where the search starts
_STARTS = 4
_STEPS = 100
_STALLED = 1e-5  # relative decrease of the sum of squares
_FEET, _LAST_FEET = 4, 30  # Gauss-Newton steps to a foot point, for each step of the curve and at the end


@dataclass(frozen=True, eq=False)
class PointFit:
    """A curve fitted to points.

    Attributes
    ----------
    curve
        The curve.
    parameters
        Where each point is held against it, shape (number of points,).
    deviation
        (rms, largest): distances of the given points from the curve at these parameters, in the points' unit, the
        first with the weights. Figures of the points alone: they say nothing of what lies between.
    iterations
        Steps of the parameter correction; 0 without it.
    """

    curve: Curve
    parameters: Array
    deviation: tuple[float, float]
    iterations: int


def interpolate(
    points: ArrayLike, *, gamma: Sequence[float] = (0.0, 0.0), parameters: Parameters = "chord", family: Family = GT
) -> Curve:
    """The curve of degree n through n + 1 points, ``C(t_k) = Q_k``.

    Parameters
    ----------
    points
        Q, shape (n + 1, d), d = 2 or 3.
    gamma, family
        Of the curve; n is at least 2 for ``GT``, 1 for ``BERNSTEIN``, at most 60.
    parameters
        "chord" (in proportion to the chords), "centripetal" (to their square roots), "uniform", or the t_k, increasing
        in [0, 1].

    Raises
    ------
    InputError
        When an argument is out of its range, parameters repeat, or the collocation matrix f_i(t_k) is numerically
        singular: degree 2 with gamma = (-1, -1), high degrees.

    Notes
    -----
    The points lie on the curve to rounding of the largest control point, which grows with the condition number of the
    collocation matrix: about 3e3 at degree 10 and 1e12 at degree 30 for equally spaced parameters, beyond rounding from
    degree 39 on; 6e2 and 6e8 for Chebyshev points, which crowd towards the ends and allow degrees up to 50. Between
    equally spaced points curves of high degree swing; those of ``approximate`` need not.

    Examples
    --------
    Three points of the unit circle at even angles give its quarter:

    >>> from math import sqrt
    >>> interpolate([[1, 0], [sqrt(0.5), sqrt(0.5)], [0, 1]]).control_points.round(12).tolist()
    [[1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
    """
    given = checked_points("points", points, 2)
    basis = Basis(len(given) - 1, checked_gamma("gamma", gamma, family), family)
    t = _checked_parameters(parameters, given, strictly=True)
    matrix = basis.evaluate(t)
    condition = float(np.linalg.cond(matrix))
    if not condition * _EPSILON < 1:
        raise InputError(
            f"degree {basis.degree} with gamma = {basis.gamma} is not determined by these parameters: the collocation "
            f"matrix is numerically singular, condition number {condition:.2g}"
        )
    control = given[0] + np.linalg.solve(matrix, given - given[0])
    for end in (0, -1):
        if t[end] == -end:
            control[end] = given[end]
    return Curve(control, basis.gamma, family)


def approximate(
    points: ArrayLike,
    degree: int,
    *,
    gamma: Sequence[float] | None = None,
    parameters: Parameters = "chord",
    weights: ArrayLike | None = None,
    fixed_ends: bool = True,
    end_derivatives: tuple[ArrayLike, ArrayLike] = ((), ()),
    correct_parameters: bool = False,
    family: Family = GT,
) -> PointFit:
    """The curve of a degree nearest to points: the least ``sum_k w_k |C(t_k) - Q_k|^2``.

    Parameters
    ----------
    points
        Q, shape (m, d), d = 2 or 3, at least degree + 1 of them, one more when the design variables are unknowns.
    degree, family
        Of the curve.
    gamma
        Design variables; None makes them unknowns, within [-1, 1].
    parameters
        As for ``interpolate``; they may repeat.
    weights
        w, shape (m,), above 0; all 1 unless given.
    fixed_ends
        Whether the curve starts at the first point and ends at the last one.
    end_derivatives
        First, second, ... derivatives that the curve must have at its start and at its end, shapes (k, d); they need
        fixed ends.
    correct_parameters
        Whether the parameters are unknowns too: distances are then those to foot points.

    Raises
    ------
    InputError
        When an argument is out of its range, or fixed ends and derivatives leave no control point.

    Notes
    -----
    Where the points do not determine the control points to working precision (high degrees; degree 2 with gamma =
    (-1, -1)) the solution nearest to evenly spaced points on the chord is taken. Design variables are searched from a
    grid over the square, which is no proof of a global optimum. From exact points of a curve they come back to about
    1e-12 at degree 4 and 1e-8 at degree 20; at degree 2 with a design variable of -1 the other one changes nothing
    that a control point cannot. Corrected parameters lead to a local optimum near the given ones, along narrow valleys
    at degrees from 4 on: the search ends when a step gains less than 1e-5 of the sum of squares, and after 100 steps.
    Their order is not enforced.

    Examples
    --------
    >>> quarter = Curve([[1, 0], [1, 1], [0, 1]], gamma=(0.5, -0.25))
    >>> t = np.linspace(0, 1, 50)
    >>> fit = approximate(quarter.evaluate(t), 2, parameters=t)
    >>> np.round(fit.curve.gamma, 9).tolist(), fit.deviation[1] < 1e-12
    ([0.5, -0.25], True)
    """
    given = checked_points("points", points, 2)
    t = _checked_parameters(parameters, given, strictly=False)
    roots = np.sqrt(_checked_weights(weights, len(given)))
    searched = gamma is None and family.takes_gamma
    found = checked_gamma("gamma", (0.0, 0.0) if gamma is None else gamma, family)
    least = Basis(degree, found, family).count + searched
    if len(given) < least:
        raise InputError(f"points must be at least {least} for degree {degree}, got {len(given)}")
    if fixed_ends and (t[0], t[-1]) != (0.0, 1.0):
        raise InputError(f"fixed ends need parameters from 0 to 1, got {t[0]:g} to {t[-1]:g}")
    ends = _checked_ends(given, fixed_ends, end_derivatives)
    model = _Model(
        int(degree), family, *ends, given[0] + np.linspace(0, 1, degree + 1)[:, None] * (given[-1] - given[0])
    )
    tables, target = _weighted(model, t, given, roots)
    if searched:
        found = _nearest_gamma(model, tables, target)
    control, _, _ = model.solve(tables, target, found)
    iterations = 0
    if correct_parameters:
        correction = _Correction(model, given, roots, searched, fixed_ends)
        found, t, iterations = correction.run(found, control, t)
        control, _, _ = model.solve(*_weighted(model, t, given, roots), found)
        t = correction.feet(found, control, t, _LAST_FEET)
    curve = Curve(control, found, family)
    distances = np.linalg.norm(curve.evaluate(t) - given, axis=1)
    rms = math.sqrt(float((roots * distances) @ (roots * distances) / (roots @ roots)))
    t.flags.writeable = False
    return PointFit(curve, t, (rms, float(distances.max())), iterations)


def _checked_parameters(parameters: Parameters, points: Array, *, strictly: bool) -> Array:
    if isinstance(parameters, str):
        if parameters not in _EXPONENTS:
            raise InputError(f"parameters must be one of {', '.join(_EXPONENTS)} or numbers, got {parameters!r}")
        chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
        if len(points) < 2 or not chords.any():
            raise InputError("points must be two different ones at least")
        sums = np.concatenate([[0.0], np.cumsum((chords / chords.max()) ** _EXPONENTS[parameters])])
        t, what = sums / sums[-1], f"{parameters} parameters of the points"
    else:
        try:
            t, what = np.array(parameters, dtype=np.float64), "parameters"
        except (TypeError, ValueError) as error:
            raise InputError(f"parameters must be numbers: {error}") from None
        if t.shape != (len(points),):
            raise InputError(f"parameters must be one for each of {len(points)} points, got shape {t.shape}")
        if not ((t >= 0) & (t <= 1)).all():
            raise InputError(f"parameters must lie in [0, 1], got {t[~((t >= 0) & (t <= 1))][0]}")
    steps = np.diff(t)
    wrong = np.flatnonzero(steps <= 0 if strictly else steps < 0)
    if wrong.size:
        k = int(wrong[0])
        raise InputError(f"{what} must increase, got {t[k]:.17g} and {t[k + 1]:.17g} at points {k} and {k + 1}")
    return np.asarray(t)


def _checked_weights(weights: ArrayLike | None, count: int) -> Array:
    try:
        values = np.ones(count) if weights is None else np.array(weights, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"weights must be numbers: {error}") from None
    if values.shape != (count,):
        raise InputError(f"weights must be one for each of {count} points, got shape {values.shape}")
    if not (np.isfinite(values).all() and (values > 0).all()):
        raise InputError(f"weights must be finite and above 0, got {values[~(np.isfinite(values) & (values > 0))][0]}")
    return values


def _checked_ends(points: Array, fixed_ends: bool, derivatives: tuple[ArrayLike, ArrayLike]) -> tuple[Array, Array]:
    """Points and derivatives at the start and at the end, no rows where an end is free."""
    found = []
    for name, place, value in zip(("[0]", "[1]"), (0, -1), derivatives, strict=True):
        rows = np.asarray(value, dtype=np.float64)
        rows = rows.reshape(0, points.shape[1]) if not rows.size else rows
        if rows.ndim != 2 or rows.shape[1] != points.shape[1] or not np.isfinite(rows).all():
            raise InputError(
                f"end_derivatives{name} must be finite, shape (k, {points.shape[1]}), got shape {rows.shape}"
            )
        if len(rows) and not fixed_ends:
            raise InputError("end_derivatives need fixed ends")
        found.append(np.concatenate([points[place][None], rows]) if fixed_ends else rows)
    return found[0], found[1]


@dataclass(frozen=True, eq=False)
class _Model:
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


def _weighted(model: _Model, t: Array, points: Array, roots: Array) -> tuple[Array, Array]:
    """Tables and points times the roots of the weights, the rows replaced by fewer of equal sums of squares."""
    tables, target = model.tables(t) * roots[:, None], points * roots[:, None]
    rows = np.concatenate([*tables, target], axis=1)
    if len(rows) > rows.shape[1]:
        rows = np.asarray(np.linalg.qr(rows, mode="r"))
        count = model.degree + 1
        tables = np.array([rows[:, k * count : (k + 1) * count] for k in range(3)])
        target = rows[:, 3 * count :]
    return tables, target


def _nearest_gamma(model: _Model, tables: Array, target: Array) -> Gamma:
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


def _costs(model: _Model, tables: Array, target: Array) -> Array:
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
class _Correction:
    """Gauss-Newton on curve and parameters together, Levenberg-Marquardt damped.

    The step of a parameter follows from that of the curve: it takes up all of the change along the tangent. What is
    left are the components across it, in the control points and design variables alone.
    """

    model: _Model
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
