"""Curves through points and nearest to points, the design variables among the unknowns where wanted.

References
----------
L. Piegl, W. Tiller, The NURBS Book, 2nd ed., Springer 1997, section 9.2.1 (parameters).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad._fitting import Correction, Model, nearest_gamma, weighted
from gtcad.basis import GT, Basis, Family, checked_gamma
from gtcad.curve import Curve
from gtcad.errors import InputError
from gtcad.protocol import checked_points

Array = NDArray[np.float64]
Parameters = str | ArrayLike

_EXPONENTS = {"chord": 1.0, "centripetal": 0.5, "uniform": 0.0}
_EPSILON = float(np.finfo(np.float64).eps)
_LAST_FEET = 30  # Gauss-Newton steps to a foot point at the end


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
    model = Model(
        int(degree), family, *ends, given[0] + np.linspace(0, 1, degree + 1)[:, None] * (given[-1] - given[0])
    )
    tables, target = weighted(model, t, given, roots)
    if searched:
        found = nearest_gamma(model, tables, target)
    control, _, _ = model.solve(tables, target, found)
    iterations = 0
    if correct_parameters:
        correction = Correction(model, given, roots, searched, fixed_ends)
        found, t, iterations = correction.run(found, control, t)
        control, _, _ = model.solve(*weighted(model, t, given, roots), found)
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
