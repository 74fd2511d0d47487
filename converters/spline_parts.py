"""Splines put together and taken apart, by their blossoms.

The pole of a spline of degree p that belongs to the knots t_1..t_p is its blossom (polar form) there: the symmetric
function of p arguments, affine in each, that agrees with a polynomial span where all arguments are equal. Poles of the
same spline over other knots are blossoms at other arguments.

References
----------
L. Ramshaw, Blossoms are polar forms, Comput. Aided Geom. Design 6 (1989) 323-358.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gtcad.chebyshev import UNIT_ROUNDOFF
from gtcad.converters.bspline import BSplineCurve, BSplineSurface
from gtcad.errors import InputError

Array = NDArray[np.float64]
Bounds = tuple[float, float]


def merged(before: BSplineCurve, after: BSplineCurve, order: int) -> BSplineCurve:
    """Two splines that meet C^order as one, the second shifted to start at the last knot of the first.

    Parameters
    ----------
    before, after
        Of one degree p and dimension, not rational; the derivatives 0..order by the parameter agree where they meet.
    order
        0 to p - 1; the common knot gets the multiplicity p - order.

    Returns
    -------
    BSplineCurve
        All poles but the order - 1 at the joint are poles of the two, bit for bit: as many as both have, less
        order + 1.

    Raises
    ------
    InputError
        When the splines are rational, of different degrees or dimensions, or the order is out of range.
    """
    degree = before.degree
    if before.weights is not None or after.weights is not None:
        raise InputError("rational splines cannot be merged: their derivatives belong to their own parameters")
    if (after.degree, after.dimension) != (degree, before.dimension):
        raise InputError(
            f"both splines must have one degree and dimension, got degrees {degree} and {after.degree}, "
            f"dimensions {before.dimension} and {after.dimension}"
        )
    if not 0 <= order < degree:
        raise InputError(f"order must lie in [0, {degree - 1}] for degree {degree}, got {order}")
    joint = before.knots[-1]
    knots = np.concatenate([before.knots, joint + (after.knots[1:] - after.knots[0])])
    counts = (*before.multiplicities[:-1], degree - order, *after.multiplicities[1:])
    flat = np.repeat(knots, counts)
    first = len(before.control_points) - order  # the first pole that is not one of the spline before
    mixed = [_blossom(before, flat[i + 1 : i + degree + 1], -1) for i in range(first, first + order - 1)]
    kept = before.control_points[:first], after.control_points[max(order, 1) :]
    return BSplineCurve(np.vstack([kept[0], *mixed, kept[1]]), knots, counts, degree)


def elevated(spline: BSplineCurve, degree: int) -> BSplineCurve:
    """A single polynomial span as one of a higher degree.

    Raises
    ------
    InputError
        When the spline is rational, has more than one span, or a degree above the wanted one.
    """
    if spline.weights is not None or len(spline.knots) > 2 or degree < spline.degree:
        raise InputError(f"a polynomial span of degree {degree} or less is needed, got {spline}")
    points = spline.control_points
    for raised in range(spline.degree + 1, degree + 1):
        share = (np.arange(raised + 1) / raised)[:, None]
        points = share * np.vstack([points[:1], points]) + (1 - share) * np.vstack([points, points[-1:]])
    return BSplineCurve(points, spline.knots, [degree + 1] * 2, degree)


def extracted(spline: BSplineCurve, first: int, last: int) -> BSplineCurve:
    """The part of a spline between two of its knots, given by their index, on its own parameters.

    Raises
    ------
    InputError
        When there are no such knots.
    """
    if not 0 <= first < last < len(spline.knots):
        raise InputError(f"first < last must be indices of {len(spline.knots)} knots, got {first} and {last}")
    if (first, last) == (0, len(spline.knots) - 1):
        return spline
    return cut(spline, float(spline.knots[first]), float(spline.knots[last]))


def cut(spline: BSplineCurve, start: float, end: float) -> BSplineCurve:
    """The part of a spline over [start, end] of its domain: both are made knots of full multiplicity.

    All poles but those at its ends are poles of the spline, those of rational ones up to rounding; the others come
    from up to 2 p combinations of two poles with weights in [0, 1].

    References
    ----------
    W. Boehm, Inserting new knots into B-spline curves, Computer-Aided Design 12 (1980) 199-201.
    """
    kept = cut_poles(spline.flat_knots, spline.homogeneous, spline.degree, start, end)
    inside = (spline.knots > start) & (spline.knots < end)
    counts = [m for m, inner in zip(spline.multiplicities, inside, strict=True) if inner]
    points, weights = (kept, None) if spline.weights is None else (kept[:, :-1] / kept[:, -1:], kept[:, -1])
    knots = [start, *spline.knots[inside], end]
    degree = spline.degree
    return BSplineCurve(points, knots, [degree + 1, *counts, degree + 1], degree, weights)


def cut_poles(flat: Array, poles: Array, degree: int, start: float, end: float) -> Array:
    """Of poles over flat knots those that remain when both ends of [start, end] are made knots of full multiplicity.

    Parameters
    ----------
    flat, degree
        Of the spline.
    poles
        Shape (n, c), with any number of columns.
    start, end
        Inside its domain, start < end.
    """
    for u in (start, end):
        for _ in range(degree - int((flat == u).sum())):
            last = int(np.searchsorted(flat, u, "right")) - 1
            i = np.arange(last - degree + 1, last + 1)
            share = ((u - flat[i]) / (flat[i + degree] - flat[i]))[:, None]
            mixed = share * poles[i] + (1 - share) * poles[i - 1]
            poles = np.concatenate([poles[: i[0]], mixed, poles[last:]])
            flat = np.insert(flat, last + 1, u)
    first, stop = np.searchsorted(flat, start, "right") - degree - 1, np.searchsorted(flat, end, "left")
    return np.asarray(poles[first:stop])


def _blossom(spline: BSplineCurve, arguments: Array, span: int) -> Array:
    """The blossom of one span, -1 the last, by de Boor's algorithm with an argument of its own at each step."""
    degree, flat = spline.degree, spline.flat_knots
    last = int(np.cumsum(spline.multiplicities[:-1])[span]) - 1  # flat index of the span's left knot
    points = spline.homogeneous[last - degree : last + 1].copy()
    for level, argument in enumerate(arguments, start=1):
        for j in range(degree, level - 1, -1):
            low, high = flat[last - degree + j], flat[last + 1 + j - level]
            share = (argument - low) / (high - low)
            points[j] = (1 - share) * points[j - 1] + share * points[j]
    return np.asarray(points[degree])


# --- parts with bounds of their rounding ------------------------------------------------------------------------------


def part_of_curve(spline: BSplineCurve, ends: Bounds) -> tuple[BSplineCurve, float]:
    """The part over an interval of the domain, which may run backwards, and a bound of its rounding."""
    start, end = _clipped(ends, spline.domain)
    rounding = 0.0
    if (start, end) != spline.domain:
        rounding = _cutting(spline, spline.degree)
        spline = cut(spline, start, end)
    return (reversed_curve(spline) if ends[0] > ends[1] else spline), rounding


def part_of_surface(spline: BSplineSurface, ranges: tuple[Bounds, Bounds]) -> tuple[BSplineSurface, float]:
    """The part over a rectangle of the domain, which may run backwards, and a bound of its rounding."""
    ends = [_clipped(bounds, own) for bounds, own in zip(ranges, spline.domain, strict=True)]
    rounding = 0.0
    if ends[0] != spline.domain[0]:
        rounding += _cutting(spline, spline.degree_u)
        spline = cut_surface(spline, ends[0][0], ends[0][1])
    if ends[1] != spline.domain[1]:
        rounding += _cutting(spline, spline.degree_v)
        spline = cut_surface(spline.transposed(), ends[1][0], ends[1][1]).transposed()
    if ranges[0][0] > ranges[0][1]:
        spline = reversed_surface(spline)
    if ranges[1][0] > ranges[1][1]:
        spline = reversed_surface(spline.transposed()).transposed()
    return spline, rounding


def _clipped(ends: Bounds, domain: Bounds) -> Bounds:
    start, end = (min(max(x, domain[0]), domain[1]) for x in sorted(ends))
    return start, end


def cut_surface(spline: BSplineSurface, start: float, end: float) -> BSplineSurface:
    """The part over [start, end] of u."""
    poles = spline.homogeneous
    kept = cut_poles(spline.flat_knots_u, poles.reshape(len(poles), -1), spline.degree_u, start, end)
    kept = kept.reshape(-1, *poles.shape[1:])
    points, weights = (kept, None) if spline.weights is None else (kept[..., :-1] / kept[..., -1:], kept[..., -1])
    inside = (spline.knots_u > start) & (spline.knots_u < end)
    counts = [m for m, inner in zip(spline.multiplicities_u, inside, strict=True) if inner]
    ends = [spline.degree_u + 1]
    return replace(
        spline,
        control_points=points,
        knots_u=np.array([start, *spline.knots_u[inside], end]),
        multiplicities_u=(*ends, *counts, *ends),
        weights=weights,
    )


def reversed_curve(spline: BSplineCurve) -> BSplineCurve:
    """The same points from the other end."""
    knots = spline.knots[0] + spline.knots[-1] - spline.knots[::-1]
    knots[[0, -1]] = spline.knots[[0, -1]]
    weights = None if spline.weights is None else spline.weights[::-1]
    return BSplineCurve(spline.control_points[::-1], knots, spline.multiplicities[::-1], spline.degree, weights)


def reversed_surface(spline: BSplineSurface) -> BSplineSurface:
    """The same points with u running backwards."""
    knots = spline.knots_u[0] + spline.knots_u[-1] - spline.knots_u[::-1]
    knots[[0, -1]] = spline.knots_u[[0, -1]]
    return replace(
        spline,
        control_points=spline.control_points[::-1],
        knots_u=knots,
        multiplicities_u=spline.multiplicities_u[::-1],
        weights=None if spline.weights is None else spline.weights[::-1],
    )


def _cutting(spline: BSplineCurve | BSplineSurface, degree: int) -> float:
    """Every pole is a chain of up to 2 p combinations of two, each with an error of at most 8 units of each coordinate.

    A rational one has that of its weighted coordinates, and that of its weight times its size, over its weight.
    """
    size, growth = float(np.linalg.norm(spline.control_points, axis=-1).max()), 1.0
    if spline.weights is not None:
        growth = 2 * float(spline.weights.max() / spline.weights.min())
    return 16 * degree * UNIT_ROUNDOFF * size * growth
