"""Ruled splines whose parameters may run a little ahead of a developable's or behind, and what is proved of them.

A developable has one tangent plane along each ruling, so that both ends of the ruling may move in it, each by its own
slide along its boundary, and the ruling between them stays on the surface, but for what is small of second order. With
e = T - S on the boundaries a and b of the patch S that the spline T stands for, the slides are

    s_a = e_a.a' / |a'|^2,    s_b = e_b.b' / |b'|^2,

and there boundaries are apart by at most ``|e - s a'| + s^2 |a''| / 2 + |s|^3 max |a'''| / 6``. Between them, with
R = b - a and ``b' = beta a' + rho R + eta``, eta across the tangent plane, ``T(u, v)`` is held against
``S(u + s, v + w)``, where

    s = ((1 - v) s_a + v beta s_b) / (1 - v + v beta),    w = v rho (s_b - s).

What is linear in the slides cancels but for ``v (s_b - s) eta``. With m = max(|s_a|, |s_b|), and g the geometric mean
of 1 and beta over the arithmetic one, which come from the largest values in v, what is left is at most

    |s_a - s_b| / (1 + g) (m max(|a''|, |b''|) + (m |rho| |R'| + |eta|) / (1 + beta)).

The map from (u, v) is continuous and takes each side of the square to itself, hence the square onto itself: so the
bound holds for the point sets, either way, and on the boundaries for these alone. What slides costs nothing, and a
spline with the same number of poles comes nearer.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

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
_STILL = 1e-10  # of the speed of the other boundary: an apex, which slides with it
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
    """Poles of both boundaries that come nearer when parameters may slide, from those at equal parameters.

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
    t = knots.places(z).reshape(-1)
    columns = knots.first[:, None] + np.arange(knots.degree + 1)
    design = dense(local_values(knots, z), columns, knots.poles)
    shape = [_boundaries(bundle, t, order) for order in (0, 1, 2)]
    nearer = poles.copy()
    for side in np.flatnonzero(~_still(shape[1])):
        nearer[:, side] = _nearer(design, [one[:, side] for one in shape], poles[:, side], goal, drag)
    return nearer


def _boundaries(bundle: Bundle, t: Array, order: int) -> Array:
    """Derivatives of both, shape (t.size, 2, 3)."""
    return np.asarray(np.einsum("ft,fkd->tkd", bundle.factors.rows(t, order), bundle.vectors))


def _still(slopes: Array) -> NDArray[np.bool_]:
    """Which of both boundaries is one point but for rounding, from derivatives of shape (t.size, 2, 3)."""
    speeds = np.linalg.norm(slopes, axis=2).max(axis=0)
    return np.asarray(speeds <= _STILL * speeds.max())


def _nearer(design: Array, shape: Sequence[Array], poles: Array, goal: float, drag: float) -> Array:
    """Poles of one boundary, by Lawson's iteration for what is left across it."""
    points, slopes, bends = shape
    size = np.maximum(np.linalg.norm(slopes, axis=1), 1e-300)
    reach = float((size**2 / np.maximum(np.linalg.norm(bends, axis=1), 1e-300)).min())
    drag = min(1.0, drag * max(_LEAST_DRAG, math.sqrt(goal / (2 * _SHARE * reach))))
    along = slopes / size[:, None]
    across = np.eye(3) - (1 - drag**2) * along[:, :, None] * along[:, None, :]
    inner, rest = design[:, 1:-1], points - design @ poles
    weights, best, least = np.ones(len(rest)), poles, math.inf
    for _ in range(_STEPS):
        change = _solved(inner, across, rest, weights)
        left = rest - inner @ change
        errors = np.linalg.norm(left - np.einsum("td,td->t", left, along)[:, None] * along, axis=1)
        if errors.max() < least:
            best, least = poles + np.pad(change, ((1, 1), (0, 0))), float(errors.max())
        if least <= goal:
            break
        weights = normalised(weights * (errors / errors.max() + 1e-3))
    return best


def _solved(inner: Array, across: Array, rest: Array, weights: Array) -> Array:
    """Weighted least squares of what is left across the direction in which points may slide."""
    count = inner.shape[1]
    blocks = np.einsum("tk,tl,tcd->kcld", inner * weights[:, None], inner, across, optimize=True)
    right = np.einsum("tk,tcd,td->kc", inner * weights[:, None], across, rest, optimize=True)
    matrix = blocks.reshape(3 * count, 3 * count)
    matrix[np.diag_indices(3 * count)] *= 1 + 1e-13
    return np.asarray(scipy.linalg.solve(matrix, right.reshape(-1), assume_a="pos")).reshape(count, 3)


def certify_slid(bundle: Bundle, knots: Knots, poles: Array, tolerance: float, definition_error: float) -> Slid:
    """Prove how far a ruled spline with poles of shape (poles, 2, 3) is from the developable between two boundaries.

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


@dataclass(frozen=True)
class _Boundary:
    """A boundary of the patch with its derivatives, and what a row of the spline misses it by."""

    shape: Sequence[Spanned]
    miss: Spanned
    steeper: Spanned  # the derivative of what is missed
    still: bool  # an apex: it slides with the other boundary

    @cached_property
    def along(self) -> Spanned:
        return self.miss.dot(self.shape[1])

    @cached_property
    def square(self) -> Spanned:
        return self.shape[1].dot(self.shape[1])

    @cached_property
    def least(self) -> Array:
        return self.square.least()

    @cached_property
    def slide(self) -> Array:
        """Bounds on each span; infinite where there are none, or where it might turn back."""
        if self.still:
            return np.zeros(len(self.miss.values))
        if not self.least.all():
            return np.full(len(self.least), math.inf)
        _, slope, bend, _ = self.shape
        # the derivative of the slide = along / square, by the rule for quotients
        turn = self.steeper.dot(slope) + self.miss.dot(bend)
        growth = slope.dot(bend) + slope.dot(bend)
        steep = (turn.times(self.square) - self.along.times(growth)).most() / self.least**2
        return np.where(steep <= _WHOLE, self.along.most() / self.least, math.inf)

    def distance(self, slide: Array) -> Array:
        """Bounds on each span, where slides are finite, from those of either boundary."""
        if self.still:
            return np.asarray(self.miss.most() + slide * self.shape[1].largest())
        _, slope, bend, twice_bent = self.shape
        # what is missed less its part along the boundary: no longer than either
        across = np.minimum(self.miss.cross(slope).most() / np.sqrt(self.least), self.miss.most())
        return np.asarray(across + self.slide**2 / 2 * bend.most() + self.slide**3 / 6 * twice_bent.largest())


def _bounds(bundle: Bundle, knots: Knots, poles: Array, parts: int) -> tuple[float, float]:
    """Of the distance and of the slide, both infinite where there are none."""
    fine = knots.subdivided(parts)
    hodograph, slopes_of = hodographs(knots, np.moveaxis(poles, 1, 0))
    coarse = hodograph.subdivided(parts)
    both, still = [], _still(_boundaries(bundle, fine.places(nodes(2)).reshape(-1), 1))
    for side in (0, 1):
        shape = [_shape(bundle, fine, order, side) for order in range(4)]
        miss, slope = on_spans(fine, poles[:, side], 1) - shape[0], on_spans(coarse, slopes_of[side], 4)
        both.append(_Boundary(shape, miss, slope - shape[1], bool(still[side])))
    a, b = both
    slides = np.maximum(a.slide, b.slide)
    if not slides.max() < math.inf:
        return math.inf, math.inf
    distance = np.maximum(a.distance(slides), b.distance(slides)) + _between(a, b)
    # at the ends the slide is 0 but for rounding: where it leaves [0, 1], it is cut off
    ends = float(np.abs(_slides(bundle, knots, poles, np.array([0.0, 1.0]))).max())
    steepest = max(one.shape[1].largest() for one in both)
    return (float(distance.max()) + 2 * ends * steepest) * (1 + 1e-12), float(slides.max())


def _between(a: _Boundary, b: _Boundary) -> Array:
    """Bounds of how far rulings whose ends slide differently leave the surface, infinite where there are none."""
    none = np.full(len(a.least), math.inf)
    if a.still or b.still:
        return np.zeros(len(a.least))
    ruling, turn = b.shape[0] - a.shape[0], b.shape[1] - a.shape[1]
    normal = a.shape[1].cross(ruling)
    square, same = normal.dot(normal), b.shape[1].cross(ruling).dot(normal)
    low, least = square.least(), same.least()
    if not (low.all() and least.all()):
        return none
    leaning = a.shape[1].cross(b.shape[1]).dot(normal).most()
    rho, eta = leaning / low, b.shape[1].dot(normal).most() / np.sqrt(low)
    slide = np.maximum(a.slide, b.slide)
    apart = (a.along.times(b.square) - b.along.times(a.square)).most() / (a.least * b.least)
    if (np.maximum(rho, leaning / least) * apart).max() > 1:  # v + w might leave [0, 1]
        return none
    beta = least / square.most(), same.most() / low
    mean = np.minimum(*(2 * np.sqrt(one) / (1 + one) for one in beta))  # geometric over arithmetic
    third = max(one.shape[3].largest() for one in (a, b))
    bent = np.maximum(a.shape[2].most(), b.shape[2].most()) + slide * third  # also a little beyond the span
    turning = turn.most() + 2 * slide * bent
    return np.asarray(apart / (1 + mean) * (slide * bent + (rho * slide * turning + eta) / (1 + beta[0])))


def _spline(knots: Knots, poles: Array, t: Array) -> Array:
    from scipy.interpolate import BSpline

    return np.asarray(BSpline(knots.flat, poles, knots.degree)(t))


def _slides(bundle: Bundle, knots: Knots, poles: Array, t: Array) -> Array:
    """Of both boundaries, shape (t.size, 2); where one is a point, it slides with the other one."""
    slopes = _boundaries(bundle, t, 1)
    miss = _spline(knots, poles, t) - _boundaries(bundle, t, 0)
    square = np.einsum("tkd,tkd->tk", slopes, slopes)
    slides = np.einsum("tkd,tkd->tk", miss, slopes) / np.where(square > 0, square, 1)
    return np.asarray(np.where(_still(slopes), slides[:, ::-1], slides))


def _attained(bundle: Bundle, knots: Knots, poles: Array) -> float:
    """The largest distance that is seen on both boundaries and amid them, at parameters that correspond."""
    t = knots.places(nodes(12)).reshape(-1)
    slides, found = _slides(bundle, knots, poles, t), _spline(knots, poles, t)
    gaps = [_points(bundle, t + slides[:, side])[:, side] - found[:, side] for side in (0, 1)]
    points, slopes = _points(bundle, t), _boundaries(bundle, t, 1)
    ruling = points[:, 1] - points[:, 0]
    normal = np.cross(slopes[:, 0], ruling)
    same = np.einsum("td,td->t", np.cross(slopes[:, 1], ruling), normal)
    leaning = np.einsum("td,td->t", np.cross(slopes[:, 0], slopes[:, 1]), normal)
    square = np.einsum("td,td->t", normal, normal)
    whole = square + same
    moved = np.einsum("tk,tk->t", np.stack([square, same], axis=1), slides) / np.where(whole > 0, whole, 1)
    shift = leaning / np.where(square > 0, square, 1) * (slides[:, 1] - moved) / 2
    share = np.clip(np.stack([0.5 - shift, 0.5 + shift], axis=1), 0, 1)
    gaps.append(np.einsum("tk,tkd->td", share, _points(bundle, t + moved)) - found.mean(axis=1))
    size = float(np.abs(poles).max())
    return max(0.0, float(np.linalg.norm(gaps, axis=2).max()) - 1e3 * UNIT_ROUNDOFF * size)


def _points(bundle: Bundle, t: Array) -> Array:
    return _boundaries(bundle, np.clip(t, 0, 1), 0)


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
