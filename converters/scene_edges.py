"""The edges between the faces of a scene, and how smoothly the faces meet there: from samples, for the eye."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gtcad.converters.part import Side

Array = NDArray[np.float64]

GAP, NEAR = 0.01, 2e-4  # mm, and of the length of a side: sides as near as that are one edge
ANGLE = 0.1  # degrees between normals that still is G1
BEND = 0.01  # jump of the mean curvature over the larger one that still is G2
_FLAT = 1e-4  # over the size of all: curvatures below are none
_MOST_SIDES = 8000
_FEW = slice(6, -6, 12)  # of the points of a side: they tell which sides it does not meet, away from its ends
_COVERED = 0.9  # of the points of a side that has a neighbour
ORDERS = ("free", "G0", "G1", "G2")


@dataclass(frozen=True, eq=False)
class SceneCurve:
    """An edge of faces, or a curve of its own.

    Attributes
    ----------
    name
        As in the file, or the names of the faces that meet there.
    points
        Shape (n, 3), in mm.
    kind
        "edge" of a face, or "curve".
    continuity
        Of edges "free", "G0", "G1" or "G2": of samples, within GAP, ANGLE and BEND; else empty.
    comb
        Of curves the tips of a curvature comb, shape (n, 3), NaN where there is no curvature; else None.
    part
        Of curves their place among the parts, else -1.
    faces
        Of edges the places of the faces in the scene.
    facts
        As of faces.
    arc_lengths, curvature
        Of curves, at the points, shape (n,), in mm and 1/mm.
    net
        Of curves the control polygon.
    """

    name: str
    points: Array
    kind: str
    continuity: str
    comb: Array | None = None
    part: int = -1
    faces: tuple[int, ...] = ()
    facts: Mapping[str, Any] = field(default_factory=dict)
    arc_lengths: Array | None = None
    curvature: Array | None = None
    net: tuple[Array, ...] = ()


def shared_edges(
    sides: Sequence[tuple[int, str, Side]], names: Sequence[str], bodies: Sequence[int | None]
) -> list[SceneCurve]:
    """The edges of faces, those that two faces share once.

    Parameters
    ----------
    sides
        For each side its face, its name and its places.
    names
        Of the faces.
    bodies
        Which body each face belongs to, None for none: only within a body do the normals of faces agree.

    Notes
    -----
    A side has a neighbour where nine tenths of its points lie on another side, of its own face or another. The order
    is that of the places where they meet worst. More than 8000 sides are not looked at.

    On surfaces that share an edge and the tangent planes there all curvatures agree where the mean ones do.
    """
    if len(sides) > _MOST_SIDES:
        return []
    lengths = np.array([_length(side.points) for _, _, side in sides])
    size = float(np.ptp(np.concatenate([side.points for _, _, side in sides]), axis=0).max()) if sides else 0.0
    boxes = np.array([[side.points.min(axis=0), side.points.max(axis=0)] for _, _, side in sides]).reshape(-1, 2, 3)
    edges: list[SceneCurve] = []
    partners: dict[int, int] = {}
    for k, (face, label, side) in enumerate(sides):
        if lengths[k] <= NEAR * size * 1e-2:
            continue  # a point
        slack = GAP + NEAR * lengths[k]
        few = Side(*(values[_FEW] for values in side))
        near = np.flatnonzero(
            (boxes[:, 0] <= boxes[k, 1] + slack).all(axis=1) & (boxes[:, 1] >= boxes[k, 0] - slack).all(axis=1)
        )
        others = [j for j in near.tolist() if j != k and _meeting(few, sides[j][2], slack).met.any()]
        meetings = [(j, _meeting(side, sides[j][2], slack)) for j in others]
        partner, order = _joined(face, meetings, sides, bodies, _FLAT / max(size, GAP))
        if partner is not None and partners.get(partner) == k:
            continue  # drawn from the other side
        if partner is not None:
            partners[k] = partner
        other = None if partner is None else sides[partner][0]
        name = f"{names[face]} {label}" if other is None else f"{names[face]} - {names[other]}"
        edges.append(SceneCurve(name, side.points, "edge", order, faces=(face,) if other is None else (face, other)))
    return edges


def _length(points: Array) -> float:
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


@dataclass(frozen=True)
class _Meeting:
    """Where points of a side lie on another one, and what that one is like there."""

    met: NDArray[np.bool_]
    cosine: Array
    own: Array
    other: Array


def _meeting(side: Side, other: Side, slack: float) -> _Meeting:
    """The points of a side against the polygon of another."""
    start, way = other.points[:-1], np.diff(other.points, axis=0)
    squares = np.maximum((way**2).sum(axis=1), 1e-300)
    offset = side.points[:, None] - start
    t = np.clip((offset * way).sum(axis=2) / squares, 0.0, 1.0)
    gaps = np.linalg.norm(offset - t[..., None] * way, axis=2)
    best = gaps.argmin(axis=1)
    every = np.arange(len(best))
    t, gap = t[every, best], gaps[every, best]
    normals = other.normals[best] * (1 - t)[:, None] + other.normals[best + 1] * t[:, None]
    lengths = np.linalg.norm(normals, axis=1)
    cosine = (normals * side.normals).sum(axis=1) / np.where(lengths > 0, lengths, np.nan)
    return _Meeting(gap <= slack, cosine, side.mean, other.mean[best] * (1 - t) + other.mean[best + 1] * t)


def _joined(
    face: int,
    meetings: Sequence[tuple[int, _Meeting]],
    sides: Sequence[tuple[int, str, Side]],
    bodies: Sequence[int | None],
    flat: float,
) -> tuple[int | None, str]:
    """The side that a side meets most, and the order over all that it meets."""
    inner = slice(1, -1)  # at its ends a side meets others
    touched = [(j, meeting) for j, meeting in meetings if meeting.met[inner].sum() > 1]
    if not touched:
        return None, "free"
    covered = np.any([meeting.met[inner] for _, meeting in touched], axis=0).mean()
    if covered < _COVERED:
        return None, "free"
    partner = max(touched, key=lambda found: int(found[1].met[inner].sum()))[0]
    order = 2
    for j, meeting in touched:
        same = bodies[face] is not None and bodies[face] == bodies[sides[j][0]]
        order = min(order, _order(meeting, inner, same, flat))
    return partner, ORDERS[1 + order]


def _order(meeting: _Meeting, inner: slice, oriented: bool, flat: float) -> int:
    """0, 1 or 2: how smoothly two sides meet where they do."""
    met = meeting.met[inner]
    cosine, own, other = (values[inner][met] for values in (meeting.cosine, meeting.own, meeting.other))
    turned = np.ones_like(cosine) if oriented else np.where(cosine < 0, -1.0, 1.0)
    known = np.isfinite(cosine)
    if not known.any() or (cosine * turned)[known].min() < np.cos(np.radians(ANGLE)):
        return 0
    jump, scale = np.abs(own - turned * other), np.maximum(np.abs(own), np.abs(other))
    known &= np.isfinite(jump)
    return 2 if (jump <= BEND * scale + flat)[known].all() else 1
