"""Where an offset of a quilt would fold, and where it would tear: curvatures and creases of the exact patches.

The offset by t of a surface along its normals has no fold as long as ``t kappa < 1`` for both principal curvatures,
positive where the surface bends towards the normal.

References
----------
R. T. Farouki, The approximation of non-degenerate offset surfaces, Comput. Aided Geom. Design 3 (1986) 15-43.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gtcad.differential import normal, principal_curvatures
from gtcad.errors import InputError
from gtcad.protocol import SIDES, SeparableSurface
from gtcad.quilt import Quilt, Use

Array = NDArray[np.float64]
Place = tuple[float, float]

MARGIN = 0.01
"""Of the least radius of curvature: a wall must stay thinner than that by this much."""

_BESIDE = 1e-3  # parameters so near a side that is one point have lost the digits of curvatures
_BEST, _ZOOMS, _CLOSER = 4, 12, 9  # places where a largest curvature is sought, rounds, samples of a round


@dataclass(frozen=True)
class Tightest:
    """Where a quilt bends most towards one of its sides.

    Attributes
    ----------
    patch
        Name of the patch.
    u, v
        The place.
    radius
        The least radius of curvature on that side in mm, infinite when the quilt bends away everywhere: estimated, by
        dense samples and a search around the best ones.
    """

    patch: str
    u: float
    v: float
    radius: float


def tightest(quilt: Quilt, thickness: float, flipped: Sequence[bool]) -> Tightest:
    """Where the quilt bends most towards the side of the thickness, which is positive along its normals.

    Parameters
    ----------
    quilt
        In space.
    thickness
        Only its sign matters.
    flipped
        For each patch whether its normals are turned over.

    Examples
    --------
    A quarter of a cylinder of radius 2, whose normals point outwards:

    >>> from gtcad import BERNSTEIN, Surface
    >>> points = [[[2, 0, 0], [2, 0, 1]], [[2, 2, 0], [2, 2, 1]], [[0, 2, 0], [0, 2, 1]]]
    >>> quilt = Quilt.recognised([Surface(points, family_v=BERNSTEIN)])
    >>> round(tightest(quilt, -1, quilt.flipped).radius, 9)
    2.0
    """
    found = [
        _tightest_of(patch, name, math.copysign(1, thickness) * (-1 if flip else 1), _clear_of_points(quilt, k))
        for k, (patch, name, flip) in enumerate(zip(quilt.patches, quilt.names, flipped, strict=True))
    ]
    return min(found, key=lambda place: place.radius)


def check_fold(quilt: Quilt, thickness: float, flipped: Sequence[bool]) -> Tightest:
    """The place where the quilt bends most towards the side of the thickness.

    Raises
    ------
    InputError
        When a wall of that thickness folds there, or nearly: with the limit.
    """
    place = tightest(quilt, thickness, flipped)
    limit = (1 - MARGIN) * place.radius
    if abs(thickness) > limit:
        raise InputError(
            f"a wall of {thickness:g} mm folds at {place.patch} (u, v) = ({place.u:.6g}, {place.v:.6g}): the least "
            f"radius of curvature on that side is {place.radius:.6g} mm (estimated), stay within {limit:.6g} mm"
        )
    return place


def _clear_of_points(quilt: Quilt, patch: int) -> tuple[Place, Place]:
    points = {use.side for use in quilt.collapsed if use.patch == patch}
    low, high = ({side: _BESIDE if side in points else 0.0 for side in SIDES} for _ in range(2))
    return (low["u0"], 1 - high["u1"]), (low["v0"], 1 - high["v1"])


def _tightest_of(patch: SeparableSurface, name: str, sign: float, domain: tuple[Place, Place]) -> Tightest:
    def bend(u: Array, v: Array) -> Array:
        values = sign * principal_curvatures(patch, u, v)[..., 0 if sign > 0 else 1]
        return np.where(np.isnan(values), -math.inf, values)

    counts = [max(33, 8 * factors.count + 1) for factors in (patch.factors_u, patch.factors_v)]
    u, v = (np.linspace(*ends, count) for ends, count in zip(domain, counts, strict=True))
    values = bend(u[:, None], v[None, :])
    best = (-math.inf, 0.5, 0.5)
    for i, j in _peaks(values):
        best = max(best, _climbed(bend, (u[i], v[j]), (u[1] - u[0], v[1] - v[0]), domain))
    return Tightest(name, best[1], best[2], 1 / best[0] if best[0] > 0 else math.inf)


def _peaks(values: Array) -> list[tuple[int, int]]:
    """The largest of the samples that no neighbour exceeds."""
    around = np.pad(values, 1, constant_values=-np.inf)
    rows, columns = values.shape
    shifted = [around[i : i + rows, j : j + columns] for i in range(3) for j in range(3)]
    places = np.argwhere(values >= np.max(shifted, axis=0))
    order = np.argsort([-values[i, j] for i, j in places], kind="stable")
    return [(int(places[k][0]), int(places[k][1])) for k in order[:_BEST]]


def _climbed(
    bend: Callable[[Array, Array], Array], place: Place, step: Place, domain: tuple[Place, Place]
) -> tuple[float, float, float]:
    """The best place around one, and its value first."""
    best = (-math.inf, *place)
    for _ in range(_ZOOMS):
        u, v = (
            np.linspace(max(x - h, ends[0]), min(x + h, ends[1]), _CLOSER)
            for x, h, ends in zip(best[1:], step, domain, strict=True)
        )
        values = bend(u[:, None], v[None, :])
        i, j = np.unravel_index(values.argmax(), values.shape)
        best = max(best, (float(values[i, j]), float(u[i]), float(v[j])))
        step = (step[0] / 3, step[1] / 3)
    return best


# --- creases ----------------------------------------------------------------------------------------------------------


def crease(quilt: Quilt, allowed: float) -> str | None:
    """Where normals of neighbours differ by more than an angle in radians, in words; None when they do nowhere.

    Neighbours are the two sides of a shared edge; of a side that is one point, all of its own normals.
    """
    t = np.linspace(0, 1, 2 * max(max(p.factors_u.count, p.factors_v.count) for p in quilt.patches) + 9)
    for edge in quilt.edges:
        first, second = (side_normals(quilt, use, t) for use in (edge.first, edge.second))
        angle = _largest_angle(first, second[::-1] if edge.reversed else second)
        if not angle <= allowed:
            return f"at {quilt.label(edge.first)} by {math.degrees(angle):.3g} degrees"
    for use in quilt.collapsed:
        normals = side_normals(quilt, use, t)
        if not _largest_angle(normals, normals[:1]) <= allowed:
            return f"at the point {quilt.label(use)}"
    return None


def side_normals(quilt: Quilt, use: Use, t: Array) -> Array:
    """The unit normals along a side, turned over as ``quilt.flipped`` says."""
    fixed = np.full_like(t, float(use.side[1]))
    u, v = (fixed, t) if use.side[0] == "u" else (t, fixed)
    return oriented_normal(quilt, use.patch, u, v)


def oriented_normal(quilt: Quilt, patch: int, u: Array, v: Array) -> Array:
    """The unit normals of a patch, turned over as ``quilt.flipped`` says."""
    values = normal(quilt.patches[patch], u, v)
    return -values if quilt.flipped[patch] else values


def _largest_angle(a: Array, b: Array) -> float:
    """NaN where a normal does not exist."""
    return float((2 * np.arcsin(np.linalg.norm(a - b, axis=-1).clip(0, 2) / 2)).max())
