"""Bounds of second derivatives over the blocks of a parameter square, and the triangulation that they ask for.

A triangle of parameters with the extents du and dv, wherever its corners lie, is as flat as the second derivatives say:

    |S - linear interpolant| <= 1/8 (du^2 max|S_uu| + 2 du dv max|S_uv| + dv^2 max|S_vv|),

for with barycentric coordinates w the difference is ``1/2 sum_i w_i H(p_i - p, p_i - p)`` with second derivatives H
between p and p_i, and the variance ``sum_i w_i (u_i - u)^2`` of numbers in an interval of length du is at most du^2/4.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gtcad.chebyshev import UNIT_ROUNDOFF, interpolation_tail, nodes, transform
from gtcad.protocol import Factors, SeparableSurface

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

BLOCKS = 16  # in each direction: on so small a part the sum of Chebyshev coefficients is close to the maximum
_MAX_NODES = 160
_TAIL = 1e-10  # of the bound of the values: what interpolation may leave open
_ROUNDING = 1e-12  # likewise for the rounding of second derivatives: far above what their closed forms lose
_SPLITS = (0.15, 0.3, 0.5, 0.7, 0.85)  # shares of the tolerance given to the direction u, to begin with
_ORDERS = ((2, 0), (1, 1), (0, 2))


@dataclass(frozen=True)
class Bounds:
    """Bounds of ``|S_uu|``, ``|S_uv|`` and ``|S_vv|`` on blocks of the square, and of the rounding of points.

    Attributes
    ----------
    blocks
        For each block, shape (3, BLOCKS, BLOCKS).
    rounding
        Bound of ``|computed S - S|``.
    """

    blocks: Array
    rounding: float

    @staticmethod
    def of(surface: SeparableSurface) -> Bounds:
        """Those of a surface.

        On each block the second derivative is interpolated at Chebyshev zeros; the norms of the coefficients add up
        to a bound of the polynomial, and the tail of either direction bounds the rest.
        """
        u, v, size = surface.factors_u, surface.factors_v, _size(surface)
        blocks = np.stack([_block_bounds(surface, order_u, order_v, size) for order_u, order_v in _ORDERS])
        sums = u.derivative_bound(0), v.derivative_bound(0)
        products = (u.count + v.count + 4) * UNIT_ROUNDOFF * sums[0] * sums[1]
        rounding = size * (u.rounding * sums[1] + v.rounding * sums[0] + products)
        return Bounds(blocks, rounding)

    def deviation(self, parameters: Array) -> Array:
        """Bound of ``|S - linear interpolant|`` on triangles of parameters, shape (m, 3, 2), without rounding."""
        least, most = parameters.min(axis=1), parameters.max(axis=1)
        first = np.minimum((least * BLOCKS).astype(np.int64), BLOCKS - 1)
        last = np.maximum(np.ceil(most * BLOCKS).astype(np.int64) - 1, first)
        second = _ranges(self.blocks)[:, first[:, 0], last[:, 0], first[:, 1], last[:, 1]]
        du, dv = (most - least).T
        return np.asarray((du**2 * second[0] + 2 * du * dv * second[1] + dv**2 * second[2]) / 8 * (1 + 1e-14))


def _size(surface: SeparableSurface) -> float:
    return float(np.linalg.norm(surface.coefficients, axis=-1).max())


def _block_bounds(surface: SeparableSurface, order_u: int, order_v: int, size: float) -> Array:
    rows_u, tail_u, bound_u = _direction(surface.factors_u, order_u)
    rows_v, tail_v, bound_v = _direction(surface.factors_v, order_v)
    series = np.tensordot(np.tensordot(rows_u, surface.coefficients, (1, 0)), rows_v, (1, 1))  # (bk, d, cl)
    norms = np.sqrt(np.einsum("pdq,pdq->pq", series, series))
    sums = norms.reshape(BLOCKS, -1, BLOCKS, norms.shape[1] // BLOCKS).sum(axis=(1, 3))
    rest = tail_u * bound_v + (bound_u + tail_u) * tail_v + _ROUNDING * bound_u * bound_v
    return np.asarray((sums + size * rest) * (1 + 1e-12))


def _direction(factors: Factors, order: int) -> tuple[Array, float, float]:
    """Chebyshev coefficients of the derivatives on the blocks, shape (BLOCKS * n, count), their tail and bound."""
    half = 0.5 / BLOCKS
    bound = factors.derivative_bound(order)
    for count in range(4, _MAX_NODES):
        tail = interpolation_tail(half, count, factors.derivative_bound(count + order))
        if tail <= _TAIL * bound:
            break
    middles = (np.arange(BLOCKS) + 0.5) / BLOCKS
    t = (middles[:, None] + half * nodes(count)).reshape(-1)
    values = factors.rows(t, order).reshape(-1, BLOCKS, count)
    return np.einsum("kn,ibn->bki", transform(count), values).reshape(BLOCKS * count, -1), tail, bound


def _ranges(blocks: Array) -> Array:
    """The largest bounds from block i0 to i1 in u and j0 to j1 in v, shape (3, i0, i1, j0, j1)."""
    rows = np.zeros((3, BLOCKS, BLOCKS, BLOCKS))
    for first in range(BLOCKS):
        rows[:, first, first:] = np.maximum.accumulate(blocks[:, first:], axis=1)
    ranges = np.zeros((3, BLOCKS, BLOCKS, BLOCKS, BLOCKS))
    for first in range(BLOCKS):
        ranges[:, :, :, first, first:] = np.maximum.accumulate(rows[..., first:], axis=3)
    return ranges


def densities(bounds: Bounds, tolerance: float) -> tuple[Array, Array]:
    """Lines for a unit of u, and of v, in each block: few cells, each within the tolerance; shape (BLOCKS,) each.

    For steps du_i and dv_j in the blocks every cell must have
    ``du_i^2 |S_uu| + 2 du_i dv_j |S_uv| + dv_j^2 |S_vv| <= 8 tolerance``. From several first guesses the steps of one
    direction, then of the other, are made as long as that allows; the guess that ends with the fewest cells wins.
    """
    room = 8 * tolerance
    along, mixed, across = bounds.blocks
    best: tuple[float, Array, Array] | None = None
    for share in _SPLITS:
        u = np.sqrt(share * room / np.maximum(along.max(axis=1), share * room))  # at most 1
        v = np.sqrt((1 - share) * room / np.maximum(across.max(axis=0), (1 - share) * room))
        needed = along * u[:, None] ** 2 + 2 * mixed * u[:, None] * v + across * v**2
        shrink = np.sqrt(room / max(needed.max(), room))
        u, v = u * shrink, v * shrink  # allowed; what cancels below must not make them shorter
        u = np.maximum(u, _longest(along, mixed * v, room - across * v**2).min(axis=1))
        v = np.maximum(v, _longest(across, mixed * u[:, None], room - along * u[:, None] ** 2).min(axis=0))
        cells = max(2.0, float((1 / u).mean())) * max(2.0, float((1 / v).mean()))
        if best is None or cells < best[0]:
            best = cells, 1 / u, 1 / v
    assert best is not None
    return best[1], best[2]


def _longest(square: Array, linear: Array, room: Array) -> Array:
    """The largest x up to 1 with ``square x^2 + 2 linear x <= room``."""
    room = np.maximum(room, 0.0)
    below = linear + np.sqrt(linear**2 + square * room)
    return np.asarray(room / np.maximum(np.maximum(below, room), np.finfo(float).tiny)).clip(1e-15)


def divided(density: Array, least: int) -> Array:
    """Parameters from 0 to 1 with equal shares of the density between them, at least that many intervals."""
    reached = np.concatenate([[0.0], np.cumsum(density)]) / BLOCKS
    count = max(least, int(np.ceil(reached[-1] * (1 - 1e-9))))
    inner = np.interp(np.arange(1, count) / count * reached[-1], reached, np.arange(BLOCKS + 1) / BLOCKS)
    return np.concatenate([[0.0], inner, [1.0]])


class Grid(NamedTuple):
    """A triangulation of the parameter square, triangles turning from u to v.

    Attributes
    ----------
    parameters
        Shape (n, 2): the points of the sides u0, u1, v0, v1, each from parameter 0 to 1, then the inner grid by rows.
    triangles
        Indices into the parameters, shape (m, 3).
    offsets
        Where each of the four sides begins, then the inner grid.
    """

    parameters: Array
    triangles: Indices
    offsets: tuple[int, ...]


def triangulated(u: Array, v: Array, sides: tuple[Array, Array, Array, Array], points: Array) -> Grid:
    """Inner grid, and strips that sew it to the divisions of the sides.

    In a strip every edge of a side is joined to the nearest point of the grid and every edge of the grid to the
    nearest point of the side: no triangle is longer than the longer edge. In the grid the shorter diagonal is taken.

    Parameters
    ----------
    u, v
        The lines of the grid without 0 and 1, at least one each.
    sides
        The divisions of the sides u0, u1, v0, v1, with 0 and 1.
    points
        Of the inner grid, shape (u.size, v.size, 3).
    """
    offsets = tuple(np.cumsum([0, *map(len, sides)]).tolist())
    inner = offsets[4] + np.arange(u.size * v.size).reshape(u.size, v.size)
    u0, u1, v0, v1 = (start + np.arange(len(side)) for start, side in zip(offsets, sides, strict=False))
    triangles = [
        _strip(sides[0], u0, v, inner[0], turned=True),
        _strip(sides[1], u1, v, inner[-1], turned=False),
        _strip(sides[2], v0, u, inner[:, 0], turned=False),
        _strip(sides[3], v1, u, inner[:, -1], turned=True),
        _cells(inner, points),
    ]
    fixed = ((0.0, None), (1.0, None), (None, 0.0), (None, 1.0))
    edges = [
        np.stack([t if a is None else np.full(t.size, a), t if b is None else np.full(t.size, b)], axis=1)
        for t, (a, b) in zip(sides, fixed, strict=True)
    ]
    grid = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1).reshape(-1, 2)
    return Grid(np.concatenate([*edges, grid]), np.concatenate(triangles), offsets)


def _strip(outer: Array, outer_index: Indices, inner: Array, inner_index: Indices, *, turned: bool) -> Indices:
    outer_middles, inner_middles = (outer[:-1] + outer[1:]) / 2, (inner[:-1] + inner[1:]) / 2
    apex = inner_index[np.searchsorted(inner_middles, outer_middles, side="left")]
    based = np.stack([outer_index[:-1], outer_index[1:], apex], axis=1)
    apex = outer_index[np.searchsorted(outer_middles, inner_middles, side="right")]
    sewn = np.stack([inner_index[1:], inner_index[:-1], apex], axis=1)
    strip = np.concatenate([based, sewn])
    return strip[:, ::-1] if turned else strip


def _cells(inner: Indices, points: Array) -> Indices:
    a, b, c, d = inner[:-1, :-1], inner[1:, :-1], inner[1:, 1:], inner[:-1, 1:]
    one = np.linalg.norm(points[1:, 1:] - points[:-1, :-1], axis=-1)
    other = np.linalg.norm(points[1:, :-1] - points[:-1, 1:], axis=-1)
    along = (one <= other)[..., None]
    first = np.where(along, np.stack([a, b, c], axis=-1), np.stack([a, b, d], axis=-1))
    second = np.where(along, np.stack([a, c, d], axis=-1), np.stack([b, c, d], axis=-1))
    return np.concatenate([first.reshape(-1, 3), second.reshape(-1, 3)])
