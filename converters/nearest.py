"""Distances from points to curves and surfaces by search: estimates, never proofs.

``distances`` looks for the nearest point from a dense grid by Gauss-Newton steps; it can only err upwards. Before a
shape is said to fail, ``is_farther`` looks through the whole set by subdivision.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_STEPS = 12
_GRID = {1: 1025, 2: 97}
_MAX_CELLS = 200_000


@dataclass(frozen=True)
class PointSet:
    """A curve or surface as a function on [0, 1] or its square.

    Attributes
    ----------
    variables
        1 or 2.
    evaluate
        From parameters of shape (count, variables) to points of shape (count, d).
    derivatives
        From the same to partial derivatives of shape (count, variables, d).
    speed
        Largest norm of each partial derivative, with a margin, shape (variables,).
    """

    variables: int
    evaluate: Callable[[Array], Array]
    derivatives: Callable[[Array], Array]
    speed: Array

    @classmethod
    def measured(
        cls, variables: int, evaluate: Callable[[Array], Array], derivatives: Callable[[Array], Array]
    ) -> PointSet:
        """With speeds from dense samples and a margin of half as much again."""
        norms = np.linalg.norm(derivatives(grid(variables, _GRID[variables])), axis=2)
        return cls(variables, evaluate, derivatives, 1.5 * norms.max(axis=0))


def grid(variables: int, count: int) -> Array:
    """An equally spaced grid of parameters with both ends, shape (count ** variables, variables)."""
    line = np.linspace(0.0, 1.0, count)
    return np.array(list(itertools.product(line, repeat=variables)))


def distances(points: Array, target: PointSet) -> Array:
    """Distances to the nearest points that were found, shape (count,): at least the true ones."""
    from scipy.spatial import cKDTree

    places = grid(target.variables, _GRID[target.variables])
    tree = cKDTree(target.evaluate(places))
    best, indices = tree.query(points, k=min(4, len(places)))
    result = best[:, 0].copy()
    for start in range(indices.shape[1]):
        found = _refined(points, places[indices[:, start]], target)
        result = np.minimum(result, found)
    return np.asarray(result)


def _refined(points: Array, places: Array, target: PointSet) -> Array:
    """Gauss-Newton on the squared distance, parameters kept in [0, 1] and moved in the directions that are free."""
    best = np.linalg.norm(target.evaluate(places) - points, axis=1)
    for _ in range(_STEPS):
        offset = points - target.evaluate(places)
        tangents = target.derivatives(places)
        slope = np.einsum("nvd,nd->nv", tangents, offset)
        free = ~(((places <= 0) & (slope < 0)) | ((places >= 1) & (slope > 0)))
        tangents = tangents * free[:, :, None]
        gram = np.einsum("nvd,nwd->nvw", tangents, tangents)
        damping = 1e-14 * np.einsum("nvv->n", gram) + 1e-300
        gram += (damping[:, None] + np.where(free, 0.0, 1.0))[:, :, None] * np.eye(target.variables)
        step = np.linalg.solve(gram, (slope * free)[:, :, None])[:, :, 0]
        places = np.clip(places + step, 0.0, 1.0)
        best = np.minimum(best, np.linalg.norm(target.evaluate(places) - points, axis=1))
    return np.asarray(best)


def is_farther(point: Array, length: float, target: PointSet) -> bool | None:
    """Whether the point is farther than the length from every point of the set; None when too close to call.

    Cells of the domain are put aside when even their nearest point must be farther, the others divided.
    """
    half = 0.5 / 8
    centers = half + (1 - 2 * half) * grid(target.variables, 8)
    for _ in range(48):
        gaps = np.linalg.norm(target.evaluate(centers) - point, axis=1)
        if gaps.min(initial=np.inf) <= length:
            return False
        centers = centers[gaps - half * target.speed.sum() <= length]
        if not len(centers):
            return True
        if len(centers) > _MAX_CELLS:
            return None
        half /= 2
        shifts = half * np.array(list(itertools.product((-1.0, 1.0), repeat=target.variables)))
        centers = (centers[:, None] + shifts).reshape(-1, target.variables)
    return None
