"""Distances from points to curves and surfaces by search: estimates, never proofs.

``nearest`` looks for the nearest points from a grid by damped Gauss-Newton steps; it can only err upwards. Before a
shape is said to fail, ``is_farther`` looks through the whole set by subdivision.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

Array = NDArray[np.float64]

_STEPS = 30
_COUNTS = {1: (1025,), 2: (33, 33)}
SEARCHES = 4
"""From how many points of the grid a search begins."""
_STILL, _SAME = 1e-13, 1e-11  # a step so small, of the domain, or so little a gain, of the distance, ends the search
_BEYOND, _OTHER_END = 24, 0.5  # points of the grid that are looked through for another end, and how far that is
_DAMPED, _LEAST_DAMPING = 1e-3, 1e-14
_WIDER = 1.2  # what the parts of a grid may be wider than their sampled sides say
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
    counts
        Lines of the grid that searches begin from, one number for each variable.
    """

    variables: int
    evaluate: Callable[[Array], Array]
    derivatives: Callable[[Array], Array]
    counts: tuple[int, ...]

    @classmethod
    def measured(
        cls,
        variables: int,
        evaluate: Callable[[Array], Array],
        derivatives: Callable[[Array], Array],
        counts: tuple[int, ...] | None = None,
    ) -> PointSet:
        """With a grid that does for smooth shapes, unless told."""
        return cls(variables, evaluate, derivatives, _COUNTS[variables] if counts is None else counts)

    @cached_property
    def places(self) -> Array:
        """The parameters of the grid, shape (n, variables)."""
        return lattice(*(np.linspace(0.0, 1.0, count) for count in self.counts))

    @cached_property
    def points(self) -> Array:
        """The points of the grid, shape (n, d)."""
        return self.evaluate(self.places)

    @cached_property
    def tree(self) -> cKDTree:
        """The points of the grid, to be searched."""
        from scipy.spatial import cKDTree

        return cKDTree(self.points)

    @cached_property
    def reach(self) -> float:
        """How far a point of the set may be from the nearest one of the grid: half a diagonal of its widest cell."""
        lines = self.points.reshape(*self.counts, -1)
        sides = (np.linalg.norm(np.diff(lines, axis=axis), axis=-1).max() for axis in range(self.variables))
        return _WIDER * float(np.sqrt(sum(side**2 for side in sides))) / 2

    @cached_property
    def speed(self) -> Array:
        """Largest norm of each partial derivative, from samples with half as much again, shape (variables,)."""
        return 1.5 * np.asarray(np.linalg.norm(self.derivatives(self.places), axis=2).max(axis=0))


@dataclass(frozen=True)
class Nearest:
    """The nearest points that were found.

    Attributes
    ----------
    distances
        At least the true ones, shape (n,).
    points
        Shape (n, d).
    places
        Their parameters on [0, 1] or its square, shape (n, variables); NaN where they are not known.
    """

    distances: Array
    points: Array
    places: Array


def lattice(*lines: Array) -> Array:
    """All combinations of parameters, the last one running fastest, shape (n, number of lines)."""
    return np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, len(lines))


def grid(variables: int, count: int) -> Array:
    """An equally spaced grid of parameters with both ends, shape (count ** variables, variables)."""
    return lattice(*[np.linspace(0.0, 1.0, count)] * variables)


def distances(points: Array, target: PointSet) -> Array:
    """Distances to the nearest points that were found, shape (count,): at least the true ones."""
    return nearest(points, target).distances


def nearest(points: Array, target: PointSet, *, enough: float = 0.0, searches: int = SEARCHES) -> Nearest:
    """The nearest points of a set; a search that comes as near as is enough is not begun again from elsewhere."""
    starts = np.asarray(target.tree.query(points, k=range(1, searches + 1))[1])
    best = np.full(len(points), np.inf)
    places = np.zeros((len(points), target.variables))

    def search(which: NDArray[np.int_], begin: Array) -> None:
        found, at = _refined(points[which], begin, target)
        better = found < best[which]
        best[which[better]], places[which[better]] = found[better], at[better]

    for k in range(searches):
        again = np.flatnonzero(best > enough)
        if len(again):
            search(again, target.places[starts[again, k]])
    at_end = np.flatnonzero(((places <= 0) | (places >= 1)).any(axis=1) & (best > enough))
    tried = places[at_end, None]
    for _ in range(2**target.variables - 1):  # the figure may be closed, and go on at another end
        others = target.places[np.asarray(target.tree.query(points[at_end], k=_BEYOND)[1])]
        apart = np.abs(others[:, :, None] - tried[:, None]).max(axis=3).min(axis=2) > _OTHER_END
        some = apart.any(axis=1)
        at_end, tried = at_end[some], tried[some]
        if not len(at_end):
            break
        begin = others[some, apart[some].argmax(axis=1)]
        search(at_end, begin)
        tried = np.concatenate([tried, begin[:, None]], axis=1)
    return Nearest(best, target.evaluate(places), places)


def _refined(points: Array, places: Array, target: PointSet) -> tuple[Array, Array]:
    """Damped Gauss-Newton on the squared distance, parameters kept in [0, 1] and moved in directions that are free."""
    places = places.copy()
    offsets = points - target.evaluate(places)
    best = np.linalg.norm(offsets, axis=1)
    damping = np.zeros(len(points))
    active = np.arange(len(points))
    for _ in range(_STEPS):
        here = places[active]
        trial = np.clip(here + _step(here, offsets[active], damping[active], target), 0.0, 1.0)
        moved = points[active] - target.evaluate(trial)
        found = np.linalg.norm(moved, axis=1)
        good = found <= best[active]
        gains = best[active] - found
        kept = active[good]
        places[kept], offsets[kept], best[kept] = trial[good], moved[good], found[good]
        damping[active] = np.where(good, damping[active] / 10, np.maximum(10 * damping[active], _DAMPED))
        active = active[(np.abs(trial - here).max(axis=1) > _STILL) & ~(good & (gains <= _SAME * found))]
        if not len(active):
            break
    return best, places


def _step(places: Array, offsets: Array, damping: Array, target: PointSet) -> Array:
    tangents = target.derivatives(places)
    slope = np.einsum("nvd,nd->nv", tangents, offsets)
    free = ~(((places <= 0) & (slope < 0)) | ((places >= 1) & (slope > 0)))
    tangents = tangents * free[:, :, None]
    gram = np.einsum("nvd,nwd->nvw", tangents, tangents)
    damping = (damping + _LEAST_DAMPING) * np.einsum("nvv->n", gram) + 1e-300
    gram += (damping[:, None] + np.where(free, 0.0, 1.0))[:, :, None] * np.eye(target.variables)
    step = np.linalg.solve(gram, (slope * free)[:, :, None])[:, :, 0]
    if target.variables == 2:
        _stop_at_sides(places, step, gram, slope * free)
    return np.asarray(step)


def _stop_at_sides(places: Array, step: Array, gram: Array, slope: Array) -> None:
    """Where a step leaves the square through one side, it ends there, and the other parameter's is the best with it."""
    room = np.where(step > 0, 1 - places, -places)
    leaves = np.abs(step) > np.abs(room)
    for axis in (0, 1):
        other = 1 - axis
        one = leaves[:, axis] & ~leaves[:, other]
        step[one, axis] = room[one, axis]
        step[one, other] = (slope[one, other] - gram[one, other, axis] * room[one, axis]) / gram[one, other, other]


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
