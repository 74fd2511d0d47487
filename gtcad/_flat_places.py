"""Places in a flat pattern: where its outline crosses itself, and which point of the patch a point of it is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gtcad._development import Span
from gtcad.chebyshev import UNIT_ROUNDOFF
from gtcad.errors import InputError

Array = NDArray[np.float64]

_RULINGS = 128  # of a span to start from
_STEPS = 80
_NEAR = 1e-11  # of the size: points as near to the pattern are in it
_AT_ONCE = 2048


@dataclass(frozen=True)
class Crossing:
    """Where a closed polygon crosses itself.

    Attributes
    ----------
    point
        In the plane.
    places
        How far along the outline both crossing parts are, from 0 to 1.
    """

    point: tuple[float, float]
    places: tuple[float, float]


def first_crossing(polygon: Array) -> Crossing | None:
    """The crossing of two sides of a closed polygon, shape (n, 2), that is first along its longer extent; or None."""
    count, tail = len(polygon), np.roll(polygon, -1, axis=0)
    extent = np.ptp(polygon, axis=0)
    size, axis = float(extent.max()), int(extent.argmax())
    low, high = np.minimum(polygon, tail), np.maximum(polygon, tail)
    kept = np.flatnonzero(np.linalg.norm(tail - polygon, axis=1) > 1e-9 * size)
    kept = kept[low[kept, axis].argsort(kind="stable")]
    beyond = np.searchsorted(low[kept, axis], high[kept, axis])  # sides from there on begin behind the end of a side
    for rank, i in enumerate(kept):
        others = kept[rank + 1 : beyond[rank]]
        others = others[(low[others, 1 - axis] < high[i, 1 - axis]) & (high[others, 1 - axis] > low[i, 1 - axis])]
        found = _side_crossed((polygon[i], tail[i]), (polygon[others], tail[others]), size)
        if found is not None:
            k, along, across = found
            x, y = (polygon[i] + along * (tail[i] - polygon[i])).tolist()
            first, second = sorted([float(i + along) / count, float(others[k] + across) / count])
            return Crossing((x, y), (first, second))
    return None


def crossing_point(one: Array, other: Array) -> tuple[float, float] | None:
    """A point where two closed polygons, shapes (n, 2) and (m, 2), cross each other; None where they do nowhere."""
    size = float(np.ptp(np.concatenate([one, other]), axis=0).max())
    tail, others = np.roll(one, -1, axis=0), np.roll(other, -1, axis=0)
    for start, end in zip(one, tail, strict=True):
        found = _side_crossed((start, end), (other, others), size)
        if found is not None:
            x, y = (start + found[1] * (end - start)).tolist()
            return x, y
    return None


def inside_of(polygon: Array, points: Array) -> NDArray[np.bool_]:
    """Which points, shape (k, 2), a closed polygon, shape (n, 2), goes around; next to it rounding decides."""
    (x, y), (z, w) = polygon.T, np.roll(polygon, -1, axis=0).T
    result = np.zeros(len(points), dtype=bool)
    for k, (px, py) in enumerate(points):
        beside = (y > py) != (w > py)
        reached = x[beside] + (py - y[beside]) * (z[beside] - x[beside]) / (w[beside] - y[beside])
        result[k] = np.count_nonzero(px < reached) % 2
    return result


def _side_crossed(
    side: tuple[Array, Array], others: tuple[Array, Array], size: float
) -> tuple[int, float, float] | None:
    """Which one of other segments a segment crosses first, by more than rounding, and how far along both of them."""
    p, d = side[0], side[1] - side[0]
    q, f = others[0], others[1] - others[0]
    level, levels = (1e-9 * size * np.linalg.norm(along, axis=-1) for along in (d, f))
    a, b = _cross(d, q - p), _cross(d, q + f - p)
    g, h = _cross(f, p - q), _cross(f, p + d - q)
    crossing = (a * b < 0) & (np.minimum(abs(a), abs(b)) > level)
    crossing &= (g * h < 0) & (np.minimum(abs(g), abs(h)) > levels)
    if not crossing.any():
        return None
    k = int(np.flatnonzero(crossing)[0])
    return k, float(g[k] / (g[k] - h[k])), float(a[k] / (a[k] - b[k]))


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def located(spans: Sequence[Span], points: Array, slack: float) -> Array:
    """The parameters (t, s) of points of the pattern, shape (n, 2).

    The ruling through a point p is a zero of ``det(B - A, p - A)``, and that one of which p is no point of a
    continuation is crossed in the sense in which the pattern is oriented. Newton's method is kept by bisection between
    two of many rulings where the sign changes so, next to p.

    Raises
    ------
    InputError
        When a point is not in the pattern.
    """
    result = np.empty(points.shape)
    size = max(float(np.ptp(_ends(span, _starts()).reshape(-1, 2), axis=0).max()) for span in spans)
    for begin in range(0, len(points), _AT_ONCE):
        part = slice(begin, begin + _AT_ONCE)
        result[part] = _located(spans, points[part], _NEAR * size + slack)
    return result


def _starts() -> Array:
    return np.linspace(0.0, 1.0, _RULINGS + 1)


def _ends(span: Span, t: Array) -> Array:
    """Both ends of rulings at local parameters, shape (t.size, 2, 2)."""
    return np.stack([span.flat.a.evaluate(t), span.flat.b.evaluate(t)], axis=1)


def _located(spans: Sequence[Span], points: Array, near: float) -> Array:
    distances = np.stack([_distances(_ends(span, _starts()), points) for span in spans])  # (spans, points, rulings)
    best = np.full(len(points), np.inf)
    found = np.zeros((len(points), 2))
    order = np.argsort(distances.min(axis=2), axis=0)
    for rank in range(len(spans)):
        for k, span in enumerate(spans):
            mine = np.flatnonzero((order[rank] == k) & (best > near))
            if mine.size == 0:
                continue
            places = _on_span(span, points[mine], distances[k, mine])
            left = np.linalg.norm(span.flat.evaluate(*places) - points[mine], axis=1)
            better = left < best[mine]
            chosen = mine[better]
            best[chosen] = left[better]
            found[chosen, 0] = span.start + places[0][better] * (span.end - span.start)
            found[chosen, 1] = places[1][better]
    if (best > near).any():
        worst = int(best.argmax())
        raise InputError(
            f"the point {tuple(points[worst].tolist())} lies outside the pattern, {best[worst]:.3g} from it"
        )
    return found


def _distances(ends: Array, points: Array) -> Array:
    """Distances of points from rulings as segments, shape (points, rulings)."""
    start, along = ends[:, 0], ends[:, 1] - ends[:, 0]
    offset = points[:, None] - start
    squares = np.maximum((along**2).sum(axis=1), np.finfo(float).tiny)
    s = np.clip((offset * along).sum(axis=2) / squares, 0.0, 1.0)
    return np.asarray(np.linalg.norm(offset - s[..., None] * along, axis=2))


def _on_span(span: Span, points: Array, distances: Array) -> tuple[Array, Array]:
    """The best (t, s) of a span, t local, from the distances of the points from its rulings."""
    sign = _orientation(span)
    low, high = _brackets(sign * _on_all(span, points), distances)
    t = (low + high) / 2
    for _ in range(_STEPS):
        value, slope = _beside(span, t, points), _slope(span, t, points)
        past = sign * value > 0
        low, high = np.where(past, low, t), np.where(past, t, high)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = t - value / slope
        middle = (low + high) / 2
        following = np.where((step >= low) & (step <= high), step, middle)
        done = np.abs(following - t) <= 4 * UNIT_ROUNDOFF
        t = following
        if done.all():
            break
    ends = _ends(span, t)
    along = ends[:, 1] - ends[:, 0]
    squares = np.maximum((along**2).sum(axis=1), np.finfo(float).tiny)
    return t, np.clip(((points - ends[:, 0]) * along).sum(axis=1) / squares, 0.0, 1.0)


def _orientation(span: Span) -> float:
    """The sign in which the determinant grows: that of the area of the pattern."""
    middle = np.array([0.5])
    along, across = span.flat.derivative(middle, middle, (1, 0)), span.flat.derivative(middle, middle, (0, 1))
    return float(np.sign(_cross(along, across)[0]))


def _on_all(span: Span, points: Array) -> Array:
    """The determinant of every point at every ruling, shape (points, rulings)."""
    ends = _ends(span, _starts())
    return _cross(ends[:, 1] - ends[:, 0], points[:, None] - ends[:, 0])


def _brackets(growing: Array, distances: Array) -> tuple[Array, Array]:
    """Two neighbouring rulings on both sides of each point; around the nearest one where no two are."""
    beside = (growing[:, :-1] <= 0) & (growing[:, 1:] >= 0)
    near = np.where(beside, np.minimum(distances[:, :-1], distances[:, 1:]), np.inf)
    first, nearest = near.argmin(axis=1), distances.argmin(axis=1)
    low = np.where(beside.any(axis=1), first, nearest - 1)
    high = np.where(beside.any(axis=1), first + 1, nearest + 1)
    return np.clip(low / _RULINGS, 0.0, 1.0), np.clip(high / _RULINGS, 0.0, 1.0)


def _beside(span: Span, t: Array, points: Array) -> Array:
    ends = _ends(span, t)
    return _cross(ends[:, 1] - ends[:, 0], points - ends[:, 0])


def _slope(span: Span, t: Array, points: Array) -> Array:
    ends = _ends(span, t)
    a1, b1 = span.flat.a.derivative(t), span.flat.b.derivative(t)
    return _cross(b1 - a1, points - ends[:, 0]) - _cross(ends[:, 1] - ends[:, 0], a1)
