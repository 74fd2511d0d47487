"""Distances of points from surfaces with the side on which they lie: for the eye, from a search and not proved."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gtcad.differential import ParametricSurface

Array = NDArray[np.float64]

_GRID = 33
_STEPS = 12
_STILL = 1e-13  # parameters that move less stay where they are
_DAMPING = 1e-14


def signed_distances(points: Array, normals: Array, surfaces: Sequence[ParametricSurface]) -> Array:
    """Distances from the nearest of the surfaces, positive where the points lie on the side of their normals.

    Parameters
    ----------
    points, normals
        Each (n, 3).
    surfaces
        In space, at least one.

    Returns
    -------
    Array
        Shape (n,). Where there is no normal, and at borders, where a distance has no side, positive.

    Examples
    --------
    >>> from gtcad import BERNSTEIN, Surface
    >>> square = Surface([[[0, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 0]]], family_u=BERNSTEIN, family_v=BERNSTEIN)
    >>> up, down = [0.2, 0.3, 0.5], [0.2, 0.3, -0.5]
    >>> signed_distances(np.array([up, down]), np.array([[0.0, 0, 1]] * 2), [square]).round(12).tolist()
    [0.5, -0.5]
    """
    offsets = np.stack([points - _feet(points, surface) for surface in surfaces])
    lengths = np.linalg.norm(offsets, axis=2)
    nearest = lengths.argmin(axis=0), np.arange(len(points))
    inside = (offsets[nearest] * normals).sum(axis=1) < 0
    return np.asarray(np.where(inside, -lengths[nearest], lengths[nearest]))


def _feet(points: Array, surface: ParametricSurface) -> Array:
    """Nearest points from those of a grid by Gauss-Newton steps within the unit square."""
    from scipy.spatial import cKDTree

    t = np.linspace(0.0, 1.0, _GRID)
    start = cKDTree(surface.derivative(t[:, None], t[None, :], (0, 0)).reshape(-1, 3)).query(points)[1]
    places = np.stack([t[start // _GRID], t[start % _GRID]], axis=1)
    feet = surface.derivative(places[:, 0], places[:, 1], (0, 0))
    moving = np.arange(len(points))
    for _ in range(_STEPS):
        before = places[moving]
        after = _step(points[moving] - feet[moving], before, surface)
        reached = surface.derivative(after[:, 0], after[:, 1], (0, 0))
        better = ((points[moving] - reached) ** 2).sum(axis=1) <= ((points[moving] - feet[moving]) ** 2).sum(axis=1)
        places[moving[better]], feet[moving[better]] = after[better], reached[better]
        moving = moving[better & (np.abs(after - before).max(axis=1) > _STILL)]
        if not len(moving):
            break
    return feet


def _step(offset: Array, places: Array, surface: ParametricSurface) -> Array:
    """The parameters after one step, in the directions that are free."""
    u, v = places.T
    tangents = np.stack([surface.derivative(u, v, orders) for orders in ((1, 0), (0, 1))], axis=1)
    slope = np.einsum("nvd,nd->nv", tangents, offset)
    free = ~(((places <= 0) & (slope < 0)) | ((places >= 1) & (slope > 0)))
    tangents = tangents * free[:, :, None]
    gram = np.einsum("nvd,nwd->nvw", tangents, tangents)
    damping = _DAMPING * np.einsum("nvv->n", gram) + 1e-300
    gram += (damping[:, None] + ~free)[:, :, None] * np.eye(2)
    return np.clip(places + np.linalg.solve(gram, (slope * free)[:, :, None])[:, :, 0], 0.0, 1.0)
