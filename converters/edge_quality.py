"""How faces meet along edges: gaps, angles and jumps of curvature, at samples of each edge."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from gtcad.converters.bspline import Array
from gtcad.converters.observations import Point, Seen, edge_name, face_name, place_of
from gtcad.converters.profiles import PROFILES, Profile

if TYPE_CHECKING:
    from gtcad.converters.occt.inspection import EdgeFacts, Inspection

_FLAT = 1.0  # curvature times size of all: jumps are in percent of this where both faces are flatter
_BESIDE = (0.5, 0.05)  # mm, and share of its length: how far from an edge its other side is looked for
_INNER = slice(2, -2)  # samples of an edge without its ends, where other edges meet it


@dataclass(frozen=True, eq=False)
class Across:
    """How two faces meet along an edge, at its samples.

    Attributes
    ----------
    element, faces
        The edge and its faces in words.
    order
        "G0", "G1" or "G2" within the limits of the profile; "open" when the faces are apart, "free" with one face,
        "overused" with more than two.
    length
        In mm.
    gap, angle, jump
        The largest: in mm, in degrees, and of the curvature across the edge in percent. None where unknown.
    places
        Where these are.
    """

    element: str
    faces: tuple[str, ...]
    order: str
    length: float
    gap: float | None = None
    angle: float | None = None
    jump: float | None = None
    places: tuple[Point, ...] = ()

    def as_data(self) -> dict[str, Any]:
        """Plain data, for JSON and reports."""
        return {
            "element": self.element,
            "faces": list(self.faces),
            "continuity": self.order,
            "length": self.length,
            "gap": self.gap,
            "angle_deg": self.angle,
            "curvature_jump_percent": self.jump,
            "point": list(self.places[0]) if self.places else None,
        }


def _limit(profile: Profile, name: str) -> float:
    """A limit, that of "cam" where it is switched off."""
    value = profile[name].value
    return float(PROFILES["cam"][name].value or 0.0) if value is None else value


def continuity(inspection: Inspection, profile: Profile, size: float) -> Iterator[Across]:
    """How faces meet along each edge; the size of all, in mm, says which curvatures matter."""
    for number, edge in enumerate(inspection.edges):
        if edge.alone or not len(edge.points):
            continue
        name = edge_name(inspection, number)
        faces = tuple(face_name(inspection, use.face) for use in edge.uses)
        if len(edge.uses) != 2:
            order = "free" if len(edge.uses) == 1 else "overused"
            yield Across(name, faces, order, edge.length, places=(place_of(edge.points, len(edge.points) // 2),))
            continue
        first, second = edge.uses
        gaps = np.linalg.norm(first.points - second.points, axis=1)
        angles, jumps = _jumps(edge, size)
        worst = [int(gaps.argmax()), _argmax(angles), _argmax(jumps)]
        gap, angle, jump = float(gaps[worst[0]]), float(angles[worst[1]]), float(jumps[worst[2]])
        limits = [_limit(profile, name) for name in ("face-gap", "tangent-angle", "curvature-jump")]
        order = "open" if gap > limits[0] else "G0"
        if order == "G0" and angle <= limits[1]:
            order = "G2" if jump <= limits[2] else "G1"
        places = tuple(place_of(edge.points, place) for place in worst)
        known = [None if np.isnan(value) else value for value in (angle, jump)]
        yield Across(name, faces, order, edge.length, gap, known[0], known[1], places)


def _argmax(values: Array) -> int:
    return 0 if np.isnan(values).all() else int(np.nanargmax(values))


def _jumps(edge: EdgeFacts, size: float) -> tuple[Array, Array]:
    """Angles in degrees and jumps of curvature in percent along an edge of two faces; NaN where a normal is missing.

    The percentage is of the larger curvature, but at least of 1 / size: a tenth of that turns normals by 0.1 over the
    size of all. On nearly flat faces the ratio of the curvatures alone would be one of rounding errors and tolerances.
    """
    first, second = edge.uses
    turn = 1.0 if first.forward != second.forward else -1.0
    normals = turn * second.normals
    angles = np.degrees(2 * np.arctan2(*(np.linalg.norm(first.normals + s * normals, axis=1) for s in (-1.0, 1.0))))
    bending = np.abs(first.bending - turn * second.bending)
    largest = np.maximum(np.abs(first.bending), np.abs(second.bending))
    jumps = np.where(np.isnan(bending), np.nan, 100 * bending / np.maximum(largest, _FLAT / max(size, 1e-300)))
    return np.asarray(angles), np.asarray(jumps)


def across(edges: Sequence[Across], profile: Profile) -> Iterator[Seen]:
    """The figures of edges that two faces share; those from the limit "sharp-angle" on are meant to be sharp."""
    sharp = profile["sharp-angle"].value
    for edge in edges:
        if edge.gap is None:
            continue
        yield Seen("face-gap", edge.element, edge.gap, edge.places[0])
        if edge.angle is None:
            continue
        meant = sharp is not None and edge.angle >= sharp
        yield Seen("sharp-angle", edge.element, edge.angle, edge.places[1])
        if not meant:
            yield Seen("tangent-angle", edge.element, edge.angle, edge.places[1], "at the edge's samples")
        if edge.order in ("G1", "G2") and edge.jump is not None:
            yield Seen("curvature-jump", edge.element, edge.jump, edge.places[2], "at the edge's samples")


def beside(inspection: Inspection, profile: Profile) -> Iterator[Seen]:
    """Edges of one face that run beside those of others without being shared, and how far from them."""
    from scipy.spatial import cKDTree

    from gtcad.converters.occt.measuring import distances_from_edges

    free = [
        (number, edge)
        for number, edge in enumerate(inspection.edges)
        if len(edge.uses) == 1 and len(edge.points) and not edge.alone
    ]
    if len(free) < 2 or not profile["face-gap"].active:
        return
    points = np.concatenate([edge.points for _, edge in free])
    owners = np.repeat(np.arange(len(free)), [len(edge.points) for _, edge in free])
    steps = np.concatenate([np.full(len(edge.points), edge.length / (len(edge.points) - 1)) for _, edge in free])
    tree = cKDTree(points)
    for own, (number, edge) in enumerate(free):
        inner = edge.points[_INNER][:: max(1, len(edge.points) // 8)]
        reach = min(_BESIDE[0], _BESIDE[1] * edge.length)
        near = tree.query_ball_point(inner, reach + float(steps.max()))
        candidates = {int(owners[i]) for found in near for i in found} - {own}
        if not candidates:
            continue
        gaps = distances_from_edges(inner, [free[other][1] for other in sorted(candidates)])
        if (gaps <= reach).all():
            worst = int(gaps.argmax())
            name = edge_name(inspection, number)
            yield Seen(
                "face-gap", name, float(gaps[worst]), place_of(inner, worst), "beside edges that it does not share"
            )
