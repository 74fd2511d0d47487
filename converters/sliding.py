"""Ruled splines whose parameter may run a little ahead of the patch's or behind, and what is proved of them.

The points of a patch S that is linear in v can be held against those of a spline T at parameters that differ by a small
slide along u, one for each ruling: with the difference e = T - S of both boundaries, those a' and b' of the patch, and

    slide = (e_a.a' + e_b.b') / (|a'|^2 + |b'|^2),

``|T(u, v) - S(u + slide, v)|`` is at most ``|e - slide S_u - slide^2 S_uu / 2| + |slide|^3 max |S_uuu| / 6``.
That bounds the distance of the two point sets, either way, and of their boundaries. What slides costs nothing, so that
a spline with the same number of poles comes nearer.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from gtcad.chebyshev import UNIT_ROUNDOFF, nodes, transform
from gtcad.converters.approximation import Bundle, normalised
from gtcad.converters.spline_basis import Knots, dense, local_values
from gtcad.polynomial import Spanned, derivative_rounding

Array = NDArray[np.float64]

SPANNED_NODES = 32  # values on a part of a knot span
_PARTS = (4, 16, 64)  # of each knot span, for a proof
_STEPS = 30  # of Lawson's iteration
_LEAST_DRAG, _SHARE = 0.004, 0.05  # of the weight across; of the tolerance, that the square of the slide may take
_WHOLE = 0.5  # the slide may change by so much of u at most, so that it turns back nowhere


@dataclass(frozen=True)
class Slid:
    """What was proved of a spline and a patch.

    Attributes
    ----------
    lower, upper
        Bounds of the largest distance at parameters that correspond.
    slide
        Bound of how far these are apart, in u.
    """

    lower: float
    upper: float
    slide: float


def slid_poles(bundle: Bundle, knots: Knots, poles: Array, goal: float, drag: float = 1.0) -> Array:
    """Poles of both boundaries that come nearer when the parameter may slide, from those at equal parameters.

    Parameters
    ----------
    bundle
        Both boundaries of the patch.
    knots
        Of the spline.
    poles
        Shape (poles, 2, 3); the first and the last stay.
    goal
        Stop at an error of this size.
    drag
        The more of it, the less parameters slide.
    """
    z = nodes(max(12, -(-4 * knots.poles // knots.spans)))
    local = local_values(knots, z)
    t = knots.places(z).reshape(-1)
    design = dense(local, knots.first[:, None] + np.arange(knots.degree + 1), knots.poles)
    points, slopes, bends = (_boundaries(bundle, t, order) for order in (0, 1, 2))
    size = np.linalg.norm(slopes, axis=1)
    reach = float((size**2 / np.maximum(np.linalg.norm(bends, axis=1), 1e-300)).min())
    drag = min(1.0, drag * max(_LEAST_DRAG, math.sqrt(goal / (2 * _SHARE * reach))))
    along = slopes / size[:, None]
    across = np.eye(6) - (1 - drag**2) * along[:, :, None] * along[:, None, :]
    inner, start = design[:, 1:-1], poles.reshape(-1, 6)
    rest = points - design @ start
    weights, best, least = np.ones(t.size), start, math.inf
    for _ in range(_STEPS):
        change = _solved(inner, across, rest, weights)
        left = rest - inner @ change
        free = left - np.einsum("td,td->t", left, along)[:, None] * along
        errors = np.linalg.norm(free.reshape(-1, 2, 3), axis=2).max(axis=1)
        if errors.max() < least:
            best, least = start + np.pad(change, ((1, 1), (0, 0))), float(errors.max())
        if least <= goal:
            break
        weights = normalised(weights * (errors / errors.max() + 1e-3))
    return best.reshape(-1, 2, 3)


def _boundaries(bundle: Bundle, t: Array, order: int) -> Array:
    """Derivatives of both side by side, shape (t.size, 6)."""
    values = np.einsum("ft,fkd->tkd", bundle.factors.rows(t, order), bundle.vectors)
    return np.asarray(values).reshape(t.size, -1)


def _solved(inner: Array, across: Array, rest: Array, weights: Array) -> Array:
    """Weighted least squares of what is left across the direction in which points may slide."""
    count = inner.shape[1]
    blocks = np.einsum("tk,tl,tcd->kcld", inner * weights[:, None], inner, across, optimize=True)
    right = np.einsum("tk,tcd,td->kc", inner * weights[:, None], across, rest, optimize=True)
    matrix = blocks.reshape(6 * count, 6 * count)
    matrix[np.diag_indices(6 * count)] *= 1 + 1e-13
    return np.asarray(scipy.linalg.solve(matrix, right.reshape(-1), assume_a="pos")).reshape(count, 6)


def certify_slid(bundle: Bundle, knots: Knots, poles: Array, tolerance: float, definition_error: float) -> Slid:
    """Prove how far a ruled spline with poles of shape (poles, 2, 3) is from the patch between two boundaries.

    No upper bound is sought when a sample is farther off than the tolerance.
    """
    attained = max(0.0, _attained(bundle, knots, poles) - definition_error)
    best = Slid(attained, math.inf, math.inf)
    if attained > tolerance:
        return best
    for parts in _PARTS:
        upper, slide = _bounds(bundle, knots, poles, parts)
        if upper < best.upper:
            best = Slid(attained, upper, slide)
        if best.upper + definition_error <= tolerance:
            break
    return Slid(min(attained, best.upper), best.upper + definition_error, best.slide)


def _bounds(bundle: Bundle, knots: Knots, poles: Array, parts: int) -> tuple[float, float]:
    """Of the distance and of the slide, both infinite where there are none."""
    fine = knots.subdivided(parts)
    hodograph, slopes_of = hodographs(knots, np.moveaxis(poles, 1, 0))
    coarse = hodograph.subdivided(parts)
    shape = [[_shape(bundle, fine, order, side) for side in (0, 1)] for order in range(4)]
    misses = [on_spans(fine, poles[:, side], 1) - shape[0][side] for side in (0, 1)]
    steeper = [on_spans(coarse, slopes_of[side], 4) - shape[1][side] for side in (0, 1)]
    along = _sum(miss.dot(slope) for miss, slope in zip(misses, shape[1], strict=True))
    square = _sum(slope.dot(slope) for slope in shape[1])
    least = square.least()
    if not least.all():
        return math.inf, math.inf
    slide = along.largest(least)
    # the derivative of the slide = along / square, by the rule for quotients
    each = list(zip(misses, steeper, *shape[1:3], strict=True))
    turn = _sum(more.dot(slope) + miss.dot(bend) for miss, more, slope, bend in each)
    growth = _sum(slope.dot(bend) + slope.dot(bend) for _, _, slope, bend in each)
    if not (turn.times(square) - along.times(growth)).largest(least**2) <= _WHOLE:
        return math.inf, math.inf
    # at the ends the slide is 0 but for rounding: where it leaves [0, 1], it is cut off
    ends = float(max(np.abs(_slides(bundle, knots, poles, np.array([0.0, 1.0])))))
    steepest = max(one.largest() for one in shape[1])
    # T(u) - S(u + slide) but for the third order, times the square of ``square``
    linear, whole, curving = along.times(square), square.times(square), along.times(along)
    across = [miss.times(whole) - slope.times(linear) for miss, _, slope, _ in each]
    bends = [bend.times(curving) for _, _, _, bend in each]
    near = max((one + one - bend).largest(2 * least**2) for one, bend in zip(across, bends, strict=True))
    rest = slide**3 / 6 * max(one.largest() for one in shape[3])
    return (near + rest + 2 * ends * steepest) * (1 + 1e-12), slide


def _sum(pair: Iterable[Spanned]) -> Spanned:
    first, second = pair
    return first + second


def _spline(knots: Knots, poles: Array, t: Array) -> Array:
    from scipy.interpolate import BSpline

    return np.asarray(BSpline(knots.flat, poles.reshape(len(poles), -1), knots.degree)(t))


def _slides(bundle: Bundle, knots: Knots, poles: Array, t: Array) -> Array:
    slopes = _boundaries(bundle, t, 1)
    miss = _spline(knots, poles, t) - _boundaries(bundle, t, 0)
    return np.asarray(np.einsum("td,td->t", miss, slopes) / np.einsum("td,td->t", slopes, slopes))


def _attained(bundle: Bundle, knots: Knots, poles: Array) -> float:
    """The largest distance that is seen on samples, at parameters that correspond."""
    t = knots.places(nodes(12)).reshape(-1)
    moved = np.clip(t + _slides(bundle, knots, poles, t), 0, 1)
    gaps = (_spline(knots, poles, t) - _boundaries(bundle, moved, 0)).reshape(-1, 2, 3)
    size = float(np.abs(poles).max())
    return max(0.0, float(np.linalg.norm(gaps, axis=2).max()) - 1e3 * UNIT_ROUNDOFF * size)


def _shape(bundle: Bundle, knots: Knots, order: int, side: int) -> Spanned:
    """A derivative of a boundary of the patch on each span of the knots."""
    factors, vectors = bundle.factors, bundle.vectors[:, side]
    places = knots.places(nodes(SPANNED_NODES))
    size = float(np.linalg.norm(vectors, axis=1).max())
    values = (factors.rows(places.reshape(-1), order).T @ vectors).reshape(*places.shape, -1)
    bounds = np.array([factors.derivative_bound(order + k) for k in range(SPANNED_NODES + 1)])
    steps = np.cumprod([1.0] + [knots.widest / k for k in range(1, SPANNED_NODES + 1)])
    rounding = derivative_rounding(factors, order) * size
    rounding += (factors.count + 6) * UNIT_ROUNDOFF * size * float(bounds[0] + bounds[1] * knots.widest)
    return Spanned(values, bounds * steps * size * (1 + 1e-12), np.full(places.shape, rounding))


def hodographs(knots: Knots, rows: Array) -> tuple[Knots, Array]:
    """Knots and poles of the derivatives of splines with poles of shape (rows, poles, d)."""
    flat, degree = knots.flat, knots.degree
    gaps = flat[degree + 1 : -1] - flat[1 : -degree - 1]
    ends = (degree, *knots.multiplicities[1:-1], degree)
    return Knots(knots.breaks, ends, degree - 1), degree * np.diff(rows, axis=1) / gaps[:, None]


def on_spans(knots: Knots, poles: Array, units: int) -> Spanned:
    """A spline on each of its spans; its poles are so many units off, relatively."""
    columns = knots.first[:, None] + np.arange(knots.degree + 1)
    values = local_values(knots, nodes(SPANNED_NODES)) @ poles[columns]
    count = knots.degree + 1
    series = transform(count) @ (local_values(knots, nodes(count)) @ poles[columns])
    sizes = np.linalg.norm(series, axis=2).max(axis=0)
    sizes += 64 * count * UNIT_ROUNDOFF * sizes.max()
    taylor = np.zeros(SPANNED_NODES + 1)
    power = np.ones(count)  # T_j^(k)(1) / k!
    for k in range(min(count, SPANNED_NODES + 1)):
        taylor[k] = float(power @ sizes)
        power = power * (np.arange(count) ** 2 - k**2) / ((2 * k + 1) * (k + 1))
    largest = np.linalg.norm(poles[columns], axis=2).max(axis=1)
    rounding = (6 * count + units) * UNIT_ROUNDOFF * largest
    return Spanned(values, taylor * (1 + 1e-9), np.repeat(rounding[:, None], SPANNED_NODES, axis=1))
