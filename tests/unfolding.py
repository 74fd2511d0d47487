"""An unfolding that owes nothing to gtcad: a ruled strip as triangles, laid flat one after the other."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def unfolded(a: Array, b: Array) -> tuple[Array, Array]:
    """Both sides of a strip of triangles (a_i, b_i, a_i+1), (b_i, a_i+1, b_i+1) in the plane, shapes (n, 2).

    The first ruling goes from the origin along y, and the strip to its right. Only lengths of edges are used.
    """
    rungs = np.linalg.norm(b - a, axis=1).tolist()
    diagonals = np.linalg.norm(a[1:] - b[:-1], axis=1).tolist()
    steps_a = np.linalg.norm(np.diff(a, axis=0), axis=1).tolist()
    steps_b = np.linalg.norm(np.diff(b, axis=0), axis=1).tolist()
    flat_a, flat_b = [(0.0, 0.0)], [(0.0, rungs[0])]
    for i in range(len(a) - 1):
        flat_a.append(third(flat_a[-1], flat_b[-1], rungs[i], steps_a[i], diagonals[i]))
        # seen from the new point of a, b lies the other way round
        flat_b.append(third(flat_a[-1], flat_b[-1], diagonals[i], rungs[i + 1], steps_b[i]))
    return np.array(flat_a), np.array(flat_b)


def third(
    p: tuple[float, float], q: tuple[float, float], base: float, from_p: float, from_q: float
) -> tuple[float, float]:
    """The corner of a triangle to the right of p -> q, from the lengths of its sides."""
    if base == 0.0 or from_p == 0.0:
        return p
    if from_q == 0.0:
        return q
    along = (base * base + from_p * from_p - from_q * from_q) / (2 * base)
    # Heron's formula as of Kahan: the sides in descending order lose no digits
    x, y, z = sorted((base, from_p, from_q), reverse=True)
    square = (x + (y + z)) * (z - (x - y)) * (z + (x - y)) * (x + (y - z))
    aside = math.sqrt(max(square, 0.0)) / (2 * base)
    dx, dy = (q[0] - p[0]) / base, (q[1] - p[1]) / base
    return p[0] + along * dx + aside * dy, p[1] + along * dy - aside * dx
