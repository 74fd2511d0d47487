"""Which edges and closed directions are smooth, so that a host gets them smooth.

The kernel offsets, shells and fillets a smooth seam or joint well when its splines have exactly the derivatives there
that the shape has, and mostly fails when they only have them within the tolerance of points.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gtcad.protocol import SeparableSurface
from gtcad.quilt import SAME, Quilt, SharedEdge

Array = NDArray[np.float64]
Ends = tuple[tuple[int, int], tuple[int, int]]

_PLACES = (1 - np.cos(np.linspace(0.0, np.pi, 17))) / 2
_PARALLEL = 1e-9  # of the derivatives across an edge: what they may differ by from multiples of each other


def with_smooth_edges(quilt: Quilt) -> Quilt:
    """The quilt with order "G1" at the edges of order "C0" or "G0" that its patches cross without a bend.

    That is where, at samples, the derivatives across the edge are one positive multiple of each other.
    """
    near = SAME * max(float(np.abs(patch.coefficients).max()) for patch in quilt.patches)
    edges = [
        replace(edge, order="G1") if edge.order in ("C0", "G0") and gap <= near and _is_smooth(quilt, edge) else edge
        for edge, gap in zip(quilt.edges, quilt.gaps, strict=True)
    ]
    return replace(quilt, edges=tuple(edges))


def _is_smooth(quilt: Quilt, edge: SharedEdge) -> bool:
    first = _across(quilt.patches[edge.first.patch], edge.first.side)
    second = -_across(quilt.patches[edge.second.patch], edge.second.side)
    return _continues(first, second[::-1] if edge.reversed else second)


def _across(patch: SeparableSurface, side: str) -> Array:
    """The derivative out of the patch at places along a side."""
    end = float(side[1])
    u, v, orders = (end, _PLACES, (1, 0)) if side[0] == "u" else (_PLACES, end, (0, 1))
    derived: Array = patch.derivative(u, v, orders)
    return derived if end else -derived


def _continues(first: Array, second: Array) -> bool:
    lengths = float(np.linalg.norm(first)), float(np.linalg.norm(second))
    if min(lengths) == 0:
        return False
    gap = np.linalg.norm(first / lengths[0] - second / lengths[1], axis=-1).max()
    return bool(gap <= _PARALLEL)


def closing_orders(surface: SeparableSurface) -> Ends:
    """The end orders that keep the seams of a patch smooth: 1 in directions in which it closes so, else 0."""
    near = SAME * float(np.abs(surface.coefficients).max())
    orders = []
    for start, end in (("u0", "u1"), ("v0", "v1")):
        apart = np.abs(_points(surface, start) - _points(surface, end)).max()
        closes = apart <= near and _continues(_across(surface, end), -_across(surface, start))
        orders.append((1, 1) if closes else (0, 0))
    return orders[0], orders[1]


def _points(patch: SeparableSurface, side: str) -> Array:
    end = float(side[1])
    return np.asarray(patch.evaluate(end, _PLACES) if side[0] == "u" else patch.evaluate(_PLACES, end))
