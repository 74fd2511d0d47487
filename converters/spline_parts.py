"""Splines put together and taken apart, by their blossoms.

The pole of a spline of degree p that belongs to the knots t_1..t_p is its blossom (polar form) there: the symmetric
function of p arguments, affine in each, that agrees with a polynomial span where all arguments are equal. Poles of the
same spline over other knots are blossoms at other arguments.

References
----------
L. Ramshaw, Blossoms are polar forms, Comput. Aided Geom. Design 6 (1989) 323-358.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gtcad.converters.bspline import BSplineCurve
from gtcad.errors import InputError

Array = NDArray[np.float64]


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

    All poles but those at its ends are poles of the spline, those of rational ones up to rounding.

    Raises
    ------
    InputError
        When there are no such knots.
    """
    if not 0 <= first < last < len(spline.knots):
        raise InputError(f"first < last must be indices of {len(spline.knots)} knots, got {first} and {last}")
    if (first, last) == (0, len(spline.knots) - 1):
        return spline
    degree = spline.degree
    knots = spline.knots[first : last + 1]
    counts = (degree + 1, *spline.multiplicities[first + 1 : last], degree + 1)
    flat = np.repeat(knots, counts)
    shift = sum(spline.multiplicities[: first + 1]) - degree - 1
    poles = spline.homogeneous[shift : shift + len(flat) - degree - 1].copy()
    known = spline.flat_knots[shift : shift + len(flat)]
    for i in range(len(poles)):
        arguments = slice(i + 1, i + degree + 1)
        if not np.array_equal(flat[arguments], known[arguments]):
            poles[i] = _blossom(spline, flat[arguments], first + _span(knots, flat, i, degree))
    if spline.weights is None:
        return BSplineCurve(poles, knots, counts, degree)
    return BSplineCurve(poles[:, :-1] / poles[:, -1:], knots, counts, degree, poles[:, -1])


def _span(knots: Array, flat: Array, index: int, degree: int) -> int:
    """The span in the support of a pole's function that is nearest to the mean of the pole's knots."""
    own = float(flat[index + 1 : index + degree + 1].mean())
    support = flat[index : index + degree + 2]
    middles = [(a + b) / 2 for a, b in pairwise(support.tolist()) if a < b]
    return int(np.searchsorted(knots, min(middles, key=lambda middle: abs(middle - own)))) - 1


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
