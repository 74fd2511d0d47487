"""Triangles that cross: what faces do to each other, or to themselves, seen on a mesh of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

_SAME = 1e-9  # relative to the size of all: what still is one vertex
_GRID = 1 << 10  # cells of the curve that sorts triangles, along each axis


def crossings(vertices: Array, triangles: Integers, depth: float) -> tuple[Integers, Array]:
    """Pairs of triangles without a common vertex that cross each other deeper than a depth.

    Two triangles cross when each has vertices on both sides of the other's plane, and the two segments in which they
    meet the line of the planes overlap. The depth is how far, at least, each reaches to both sides of the other.

    Parameters
    ----------
    vertices
        Shape (n, 3); vertices at one place count as one.
    triangles
        Shape (m, 3), indices of vertices.
    depth
        At least 0, in the unit of the vertices. Crossings that are less deep are left out: those of two meshes of
        surfaces that only touch are.

    Returns
    -------
    pairs
        Shape (k, 2), indices of triangles, the smaller first.
    points
        Shape (k, 3), the middle of the segment in which each pair meets.

    Notes
    -----
    Boxes around triangles that are sorted along a curve through space are compared as a tree, so the cost is that of
    the neighbours: about m log m.

    Examples
    --------
    >>> flat = [[0, 0, 0], [4, 0, 0], [0, 4, 0]]
    >>> upright = [[1, 1, -1], [1, 1, 2], [2, 0.5, -1]]
    >>> pairs, points = crossings(np.array(flat + upright, float), np.array([[0, 1, 2], [3, 4, 5]]), 0.5)
    >>> pairs.tolist()
    [[0, 1]]
    """
    if len(triangles) == 0:
        return np.empty((0, 2), dtype=np.int64), np.empty((0, 3))
    size = float(np.ptp(vertices, axis=0).max()) or 1.0
    _, merged = np.unique(np.round(vertices / (_SAME * size)).astype(np.int64), axis=0, return_inverse=True)
    names = merged.reshape(-1)[triangles]
    corners = vertices[triangles]
    pairs = _near(corners)
    apart = (names[pairs[:, 0]][:, :, None] != names[pairs[:, 1]][:, None, :]).all(axis=(1, 2))
    pairs = pairs[apart]
    found, points = _meeting(corners[pairs[:, 0]], corners[pairs[:, 1]], depth)
    return np.sort(pairs[found], axis=1), points


def _near(corners: Array) -> Integers:
    """Pairs of triangles whose boxes overlap, each once."""
    order = _sorted_along_curve(corners.mean(axis=1))
    count = 1 << max(0, int(len(order) - 1).bit_length())
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    low[: len(order)] = corners[order].min(axis=1)
    high[: len(order)] = corners[order].max(axis=1)
    levels = [(low, high)]
    while len(low) > 1:
        low = low.reshape(-1, 2, 3).min(axis=1)
        high = high.reshape(-1, 2, 3).max(axis=1)
        levels.append((low, high))
    pairs = np.zeros((1, 2), dtype=np.int64)
    for low, high in levels[-2::-1]:
        first = (2 * pairs[:, :1] + np.array([0, 0, 1, 1])).reshape(-1)
        second = (2 * pairs[:, 1:] + np.array([0, 1, 0, 1])).reshape(-1)
        keep = first <= second
        first, second = first[keep], second[keep]
        overlap = ((low[first] <= high[second]) & (low[second] <= high[first])).all(axis=1)
        pairs = np.column_stack([first[overlap], second[overlap]])
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    found: Integers = order[pairs]
    return found


def _sorted_along_curve(points: Array) -> Integers:
    """The order of points along a curve that keeps neighbours together (that of Morton)."""
    least, extent = points.min(axis=0), np.ptp(points, axis=0)
    cells = ((points - least) / np.where(extent > 0, extent, 1.0) * (_GRID - 1)).astype(np.int64)
    code = np.zeros(len(points), dtype=np.int64)
    for bit in range(_GRID.bit_length() - 1):
        for axis in range(3):
            code |= ((cells[:, axis] >> bit) & 1) << (3 * bit + axis)
    return np.argsort(code, kind="stable")


def _meeting(first: Array, second: Array, depth: float) -> tuple[NDArray[np.bool_], Array]:
    """Which pairs of triangles, shape (k, 3, 3) both, cross, and the middle of where those do."""
    normal_a, normal_b = _normals(first), _normals(second)
    heights_a = np.einsum("kij,kj->ki", first - second[:, :1], normal_b)
    heights_b = np.einsum("kij,kj->ki", second - first[:, :1], normal_a)
    reach = np.minimum(
        np.minimum(heights_a.max(axis=1), -heights_a.min(axis=1)),
        np.minimum(heights_b.max(axis=1), -heights_b.min(axis=1)),
    )
    line = np.cross(normal_a, normal_b)
    crossing = (reach > depth) & (np.linalg.norm(line, axis=1) > 0)
    kept = np.flatnonzero(crossing)
    ends_a, ends_b = _cut(first[kept], heights_a[kept]), _cut(second[kept], heights_b[kept])
    along = line[kept] / np.linalg.norm(line[kept], axis=1, keepdims=True)
    places_a = np.sort(np.einsum("kij,kj->ki", ends_a, along), axis=1)
    places_b = np.sort(np.einsum("kij,kj->ki", ends_b, along), axis=1)
    start = np.maximum(places_a[:, 0], places_b[:, 0])
    end = np.minimum(places_a[:, 1], places_b[:, 1])
    overlapping = end > start
    crossing[kept] = overlapping
    middle = (start + end) / 2 - np.einsum("kj,kj->k", ends_a[:, 0], along)
    return crossing, (ends_a[:, 0] + middle[:, None] * along)[overlapping]


def _normals(corners: Array) -> Array:
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    units: Array = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0)
    return units


def _cut(corners: Array, heights: Array) -> Array:
    """Where two sides of each triangle, with vertices on both sides of a plane, cut the plane: shape (k, 2, 3)."""
    positive = heights > 0
    alone = np.where(positive.sum(axis=1) == 1, positive.argmax(axis=1), (~positive).argmax(axis=1))
    rows = np.arange(len(corners))
    ends = []
    for step in (1, 2):
        other = (alone + step) % 3
        own, far = heights[rows, alone], heights[rows, other]
        share = own / (own - far)
        ends.append(corners[rows, alone] + share[:, None] * (corners[rows, other] - corners[rows, alone]))
    return np.stack(ends, axis=1)
