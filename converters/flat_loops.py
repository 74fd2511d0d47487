"""The loops of a flat pattern: its outline without seams that close up, its holes, and bend lines outside of these."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations, pairwise

import numpy as np
from numpy.typing import NDArray

from gtcad._flat_bends import BendLine
from gtcad._flat_places import crossing_point, first_crossing, inside_of
from gtcad.errors import InputError
from gtcad.flat_curves import FlatCurve
from gtcad.flat_pattern import polygon
from gtcad.queries import intersect_plane

Array = NDArray[np.float64]

_SAME = 1e-9  # of the size: what is as near is one
_BESIDE = 1e-6  # of the size: a point as near to a polygon may be on either side of the curve
_ALONG = 1e-4  # of the size: more than the sagitta of the polygon of a circle
_SHORT = 1e-9  # of a bend line: no part of it is as short
_QUARTERS = np.array([[0.25], [0.5], [0.75]])
_POINTS, _PER_PIECE = 256, 8  # of the polygon of a hole
_GOLDEN = (math.sqrt(5.0) - 1) / 2
_PLACES = np.linspace(0.0, 1.0, 17)


def outline_loops(contour: Sequence[FlatCurve]) -> tuple[tuple[FlatCurve, ...], ...]:
    """The outer loop of a closed contour, and the inner one of a plane ring.

    A ring that is plane, such as a washer, lies closed in its pattern: the ruling that it begins with is the one that
    it ends with. There is no seam to cut, and the parts of the contour between both are loops.
    """
    for i, j in combinations(range(len(contour)), 2):
        one, other = contour[i], contour[j]
        near = _SAME * max(one.extent, other.extent) + one.error + other.error
        if np.linalg.norm(one.evaluate(_PLACES) - other.evaluate(1 - _PLACES), axis=1).max() <= near:
            loops = tuple(contour[i + 1 : j]), (*contour[j + 1 :], *contour[:i])
            return tuple(sorted(filter(None, loops), key=_extent, reverse=True))
    return (tuple(contour),)


def _extent(loop: Sequence[FlatCurve]) -> float:
    return float(np.ptp(polygon(loop), axis=0).max())


def check_holes(holes: Sequence[FlatCurve], *, apart: bool = True) -> None:
    """See that holes are closed and do not cross themselves; and, unless ``apart`` is False, lie beside each other.

    Judged by polygons of 256 points or more: a crossing of less than the sagitta of their chords may be missed.

    Raises
    ------
    InputError
        When they are not.
    """
    for number, hole in enumerate(holes, 1):
        _check_hole(_called(number, len(holes)), hole)
    polygons = [_polygon(hole, number) for number, hole in enumerate(holes)] if apart else []
    for (i, one), (j, other) in combinations(enumerate(polygons, 1), 2):
        if (place := crossing_point(one, other)) is not None:
            raise InputError(f"holes must not cross: {i} and {j} do near {_shown(place)} of the pattern")
        for (k, inner), (m, outer) in (((i, one), (j, other)), ((j, other), (i, one))):
            if _within(inner, outer):
                raise InputError(f"holes must lie beside each other: {k} lies in {m}")


def _polygon(hole: FlatCurve, number: int) -> Array:
    """Points of a hole, its corners among them, the others of each number where those of no other one are."""
    count = max(_PER_PIECE, math.ceil(_POINTS / len(hole.pieces)))
    t = np.append(0.0, (np.arange(1, count) + number * _GOLDEN % 1) / count)
    return np.concatenate([piece.evaluate(t) for piece in hole.pieces])


def _called(number: int, count: int) -> str:
    return f"hole {number}" if count > 1 else "a hole"


def _check_hole(name: str, hole: FlatCurve) -> None:
    if not hole.closed:
        ends = hole.evaluate(np.array([0.0, 1.0]))
        apart = float(np.linalg.norm(ends[1] - ends[0]))
        raise InputError(f"{name} must be a closed curve; its ends are {apart:.3g} apart")
    if (crossing := first_crossing(polygon((hole,), max(_POINTS, _PER_PIECE * len(hole.pieces))))) is not None:
        raise InputError(f"{name} must not cross itself; it does near {_shown(crossing.point)} of the pattern")


def _shown(point: tuple[float, float]) -> str:
    return f"({point[0]:.6g}, {point[1]:.6g})"


def _within(inner: Array, outer: Array) -> bool:
    """Whether no point of a polygon is clearly outside of another one."""
    low, high = outer.min(axis=0), outer.max(axis=0)
    near = _BESIDE * float((high - low).max())
    if (inner < low - near).any() or (inner > high + near).any():
        return False
    outside = inner[~inside_of(outer, inner)]
    return all(_distance(point, outer) <= near for point in outside)


def _distance(point: Array, closed: Array) -> float:
    along = np.roll(closed, -1, axis=0) - closed
    squares = np.maximum((along**2).sum(axis=1), np.finfo(float).tiny)
    s = np.clip(((point - closed) * along).sum(axis=1) / squares, 0.0, 1.0)
    return float(np.linalg.norm(closed + s[:, None] * along - point, axis=1).min())


def cut_at_holes(lines: Sequence[BendLine], holes: Sequence[FlatCurve]) -> tuple[BendLine, ...]:
    """Bend lines that know which parts of them lie in holes, or along their borders."""
    polygons = [_polygon(hole, number) for number, hole in enumerate(holes)]
    return tuple(_cut(line, holes, polygons) for line in lines)


def _cut(line: BendLine, holes: Sequence[FlatCurve], polygons: Sequence[Array]) -> BendLine:
    start, along = np.array(line.start), np.subtract(line.end, line.start)
    low, high = np.minimum(line.start, line.end), np.maximum(line.start, line.end)
    met = []
    for hole, points in zip(holes, polygons, strict=True):
        near = _ALONG * float(np.ptp(points, axis=0).max())
        if (points.min(axis=0) <= high + near).all() and (points.max(axis=0) >= low - near).all():
            met.append((hole, points, near))
    places = [0.0]
    for cut in sorted(cut for hole, _, near in met for cut in _crossings(hole, start, along, near)):
        if places[-1] + _SHORT < cut < 1 - _SHORT:
            places.append(cut)
    lost = [
        (a, b)
        for a, b in pairwise([*places, 1.0])
        if any(_gone(start + (a + (b - a) * _QUARTERS) * along, points, near) for _, points, near in met)
    ]
    return replace(line, holes=_joined(lost))


def _gone(places: Array, points: Array, near: float) -> bool:
    """Whether places on a span between crossings are in a hole, or along its border."""
    inside = inside_of(points, places)
    return all(within or _distance(place, points) <= near for within, place in zip(inside, places, strict=True))


def _crossings(hole: FlatCurve, start: Array, along: Array, near: float) -> Array:
    """Where a hole crosses a line, or has a corner on it, as fractions of the line."""
    across = np.array([-along[1], along[0]]) / np.linalg.norm(along)
    found = [np.zeros((0, 2))]
    for piece in hole.pieces:
        points = piece.evaluate(_PLACES)
        heights = (points - start) @ across
        if abs(heights[0]) <= near:
            found.append(points[:1])
        step = np.abs(np.diff(heights)).max()
        if heights.min() <= step and heights.max() >= -step:
            with contextlib.suppress(InputError):  # it lies in the line, and its corners are among those found
                found += [crossing.point[None] for crossing in intersect_plane(piece, start, across)]
    return np.asarray((np.concatenate(found) - start) @ along / (along @ along))


def _joined(spans: Sequence[tuple[float, float]]) -> tuple[tuple[float, float], ...]:
    """Spans in their order, those that touch as one."""
    found: list[tuple[float, float]] = []
    for start, end in spans:
        if found and found[-1][1] == start:
            found[-1] = (found[-1][0], end)
        else:
            found.append((start, end))
    return tuple(found)
