"""Rigorous bounds of how far a patch linear in v turns its tangent planes along its rulings."""

from __future__ import annotations

import math

import numpy as np

from gtcad.polynomial import Spanned


def twist_bound(slope_a: Spanned, slope_b: Spanned, along: Spanned) -> float:
    """Bound of the angle in radians of the normals at both ends of the rulings, infinite where none is found.

    With R = b - a, the normals are along ``a' x R`` and ``b' x R``, and between them along positive sums of these;
    their vector product is ``R det(a', b', R)``, up to the sign.

    Parameters
    ----------
    slope_a, slope_b
        a' and b', on each span by any one scale.
    along
        R.
    """
    normals = [slope.cross(along) for slope in (slope_a, slope_b)]
    still = [not slope.values.any() and not slope.taylor.any() for slope in (slope_a, slope_b)]
    least = [np.sqrt(normal.dot(normal).least()) for normal in normals]
    if any(still):  # an apex: one normal for the whole ruling
        return 0.0 if any(one.all() for one in least) else math.inf
    if not (least[0].all() and least[1].all() and normals[0].dot(normals[1]).least().all()):
        return math.inf
    sine = along.times(slope_a.cross(slope_b).dot(along)).largest(least[0] * least[1])
    return math.asin(sine) if sine < 1 else math.inf
