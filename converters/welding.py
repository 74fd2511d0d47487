"""Sides and corners that patches share: which are one, in which direction they run, and which way patches turn."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gtcad.protocol import SeparableSurface

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

SAME = 1e-12  # of the largest coordinate: points nearer than that are one, up to rounding
_PARAMETERS = np.arange(9) / 8  # where sides are compared: they stay as they are when the direction is turned
_RUNS = (-1, 1, 1, -1)  # how the sides u0, u1, v0, v1 run around the patch: against or with its turn


def side_points(surface: SeparableSurface, side: int, t: Array) -> Array:
    """Points of the side 0 to 3 (u0, u1, v0, v1) at its parameters, shape (t.size, 3)."""
    fixed = np.array([float(side % 2)])
    if side < 2:
        return np.asarray(surface.evaluate(fixed[:, None], t[None, :])[0])
    return np.asarray(surface.evaluate(t[:, None], fixed[None, :])[:, 0])


@dataclass(frozen=True)
class Welds:
    """The sides of all patches, sorted into edges; side 4 s + k is the side k of patch s.

    Attributes
    ----------
    edge
        Number of the edge of each side.
    backwards
        Whether the side runs against its edge.
    leaders
        The side that each edge was taken from.
    corners
        Numbers of the first and last corner of each edge, shape (edges, 2).
    points
        The corners, shape (count, 3).
    collapsed
        Whether the edge is one point.
    """

    edge: Indices
    backwards: NDArray[np.bool_]
    leaders: Indices
    corners: Indices
    points: Array
    collapsed: NDArray[np.bool_]

    def least_divisions(self) -> Indices:
        """How many parts each edge must have at least, so that no two edges become one.

        Those between the same two corners need a point of their own, and a closed one needs two.
        """
        ends = [(min(a, b), max(a, b)) for a, b in self.corners.tolist()]
        taken = Counter(pair for pair, point in zip(ends, self.collapsed, strict=True) if not point)
        return np.array([3 if a == b else (2 if taken[a, b] > 1 else 1) for a, b in ends])

    def turned(self, volumes: Sequence[float]) -> list[bool]:
        """Which patches must be turned round for all neighbours to agree, and closed bodies to face outwards.

        Parameters
        ----------
        volumes
            Of the cones over the patches as they are turned now.
        """
        members: list[list[int]] = [[] for _ in self.leaders]
        for side, edge in enumerate(self.edge.tolist()):
            if not self.collapsed[edge]:
                members[edge].append(side)
        turned: list[bool | None] = [None] * len(volumes)
        for first in range(len(volumes)):
            if turned[first] is not None:
                continue
            turned[first] = False
            body, closed = [first], True
            for patch in body:
                for side in range(4 * patch, 4 * patch + 4):
                    beside = members[self.edge[side]]
                    closed &= bool(self.collapsed[self.edge[side]]) or len(beside) == 2
                    for other in beside if len(beside) == 2 else ():
                        if turned[other // 4] is None:
                            turned[other // 4] = bool(turned[patch]) ^ (self._run(side) == self._run(other))
                            body.append(other // 4)
            if closed and sum(-volumes[patch] if turned[patch] else volumes[patch] for patch in body) < 0:
                for patch in body:
                    turned[patch] = not turned[patch]
        return [bool(turn) for turn in turned]

    def _run(self, side: int) -> int:
        return -_RUNS[side % 4] if self.backwards[side] else _RUNS[side % 4]


def welded(surfaces: Sequence[SeparableSurface]) -> Welds:
    """The edges and corners of patches in space, those that are equal up to rounding being one."""
    samples = np.stack([side_points(surface, side, _PARAMETERS) for surface in surfaces for side in range(4)])
    near = SAME * max(float(np.abs(samples).max()), np.finfo(float).tiny)
    edge, backwards = np.full(len(samples), -1), np.zeros(len(samples), bool)
    leaders: list[int] = []
    tree = cKDTree(samples[:, 4])
    for side, own in enumerate(samples):
        if edge[side] >= 0:
            continue
        found = np.array(tree.query_ball_point(own[4], near))
        found = found[edge[found] < 0]
        along = np.linalg.norm(samples[found] - own, axis=-1).max(axis=1) <= near
        against = np.linalg.norm(samples[found][:, ::-1] - own, axis=-1).max(axis=1) <= near
        edge[found[along | against]] = len(leaders)
        backwards[found] = against & ~along
        leaders.append(side)
    leading = samples[leaders]
    collapsed = np.linalg.norm(leading - leading[:, :1], axis=-1).max(axis=1) <= near
    ends = leading[:, [0, 8]].reshape(-1, 3)
    corner = np.full(len(ends), -1)
    points: list[Array] = []
    tree = cKDTree(ends)
    for index, end in enumerate(ends):
        if corner[index] < 0:
            found = np.array(tree.query_ball_point(end, 4 * near))
            corner[found[corner[found] < 0]] = len(points)
            points.append(end)
    return Welds(edge, backwards, np.array(leaders), corner.reshape(-1, 2), np.array(points), collapsed)
