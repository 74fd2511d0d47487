"""Whether an exchange file is ready for CAM: what the kernel holds of it, judged by the limits of a profile."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from gtcad.converters.edge_quality import across, beside, continuity
from gtcad.converters.observations import Point, Seen, edge_name, face_name, place_of
from gtcad.converters.profiles import PROFILES, Level, Profile
from gtcad.errors import FileError, InputError

if TYPE_CHECKING:
    from gtcad.converters.occt.document import Item
    from gtcad.converters.occt.inspection import Inspection

MESH = 1e-3  # deflection of the mesh on which crossings are looked for, relative to the size of all
DEPTH = 4.0  # deflections: crossings less deep may be the mesh's own
MOST_TRIANGLES = 200_000
LARGEST = 1e12  # mm: a million kilometres


@dataclass(frozen=True)
class Finding:
    """One place that breaks a limit.

    Attributes
    ----------
    code, criterion
        Of the limit, as in the profile.
    level
        "error" fails the file.
    element
        In words: "face 3 'roof'".
    value, limit, unit
        What was measured, and what was asked; None where there is no number.
    point
        Where, in mm, if there is such a place.
    remark
        What a reader should know besides.
    """

    code: str
    criterion: str
    level: Level
    element: str
    value: float | None
    limit: float | None
    unit: str
    point: Point | None
    remark: str


@dataclass(frozen=True)
class Criterion:
    """How one limit of the profile was met.

    Attributes
    ----------
    code, title, limit, unit, source
        As in the profile; the limit is None when it is no number or switched off.
    checked
        How many elements were looked at.
    found
        How many of them break the limit.
    name, level
        As in the profile.
    worst
        The value farthest on the bad side; None where there is no number or nothing to measure.
    active
        Whether the criterion was looked at.
    """

    code: str
    title: str
    limit: float | None
    unit: str
    source: str
    checked: int
    found: int
    name: str = ""
    level: Level = "error"
    worst: float | None = None
    active: bool = True


@dataclass(frozen=True)
class Readiness:
    """What was found of a file.

    Attributes
    ----------
    profile
        Its name.
    criteria
        All of the profile, in order.
    findings
        Errors first.
    facts
        Plain data: counts, degrees, tolerances stored, the continuity of edges, the resolution of what was sampled.
    """

    profile: str
    criteria: tuple[Criterion, ...]
    findings: tuple[Finding, ...]
    facts: dict[str, Any]

    @property
    def verdict(self) -> str:
        """The words "ready", without errors, or "not ready"."""
        return "not ready" if any(finding.level == "error" for finding in self.findings) else "ready"


def readiness(items: Sequence[Item], stored: Sequence[float] = (), *, profile: Profile = PROFILES["cam"]) -> Readiness:
    """Judge the faces and curves of a file.

    Parameters
    ----------
    items
        As the kernel's readers give them.
    stored
        Accuracies that the file itself states, in mm.
    profile
        The limits.

    Raises
    ------
    InputError
        When they are larger than anything that is made.
    KernelError
        When the kernel fails on one of them.

    Notes
    -----
    Gaps, angles and curvatures along edges are taken at 33 to 257 samples of each edge: what lies between them is not
    seen. Crossings of faces are looked for on a mesh, and found when they are deeper than 0.4 % of the size of all.
    Crossings of boundaries are those that the kernel finds within its own tolerances.
    """
    from gtcad.converters.occt.inspection import inspect

    inspection = inspect(items)
    size = _size(inspection)
    if not size <= LARGEST:
        raise InputError(f"the size must be at most {LARGEST:g} mm, got {size:g} mm")
    edges = tuple(continuity(inspection, profile, size))
    seen = [*_of_bodies(inspection), *_of_faces(inspection), *_of_edges(inspection), *across(edges, profile)]
    seen += beside(inspection, profile)
    seen += (entry for entry in _of_splines(inspection))
    crossed, resolution = _crossings(inspection, profile, size)
    seen += crossed
    facts = _facts(inspection, stored, size) | {
        "continuity": [edge.as_data() for edge in edges],
        "resolution": resolution,
    }
    return _judged(profile, seen, facts)


def readiness_of_file(path: str, form: str, profile: Profile = PROFILES["cam"]) -> Readiness:
    """Judge a file of the form STEP, IGES or BREP.

    Raises
    ------
    FileError
        When it cannot be read or holds nothing.
    KernelError
        When the kernel fails on what it holds.
    """
    from gtcad.converters.stated import items_and_accuracies

    try:
        return readiness(*items_and_accuracies(path, form), profile=profile)
    except InputError as error:
        raise FileError(path, str(error)) from error


def _judged(profile: Profile, seen: Iterable[Seen], facts: dict[str, Any]) -> Readiness:
    by_name: dict[str, list[Seen]] = {name: [] for name in profile.limits}
    for entry in seen:
        by_name[entry.name].append(entry)
    criteria: list[Criterion] = []
    findings: list[Finding] = []
    for name, entries in by_name.items():
        limit = profile[name]
        numeric = limit.sense != "none"
        bad = [
            entry
            for entry in entries
            if limit.active and (entry.bad or (numeric and entry.value is not None and limit.broken_by(entry.value)))
        ]
        values = [entry.value for entry in entries if entry.value is not None]
        worst = None if not values else min(values) if limit.sense == "least" else max(values)
        shown = limit.value if numeric or limit.unit else None
        criteria.append(
            Criterion(
                limit.code,
                limit.title,
                shown,
                limit.unit,
                limit.source,
                len(entries) if limit.active else 0,
                len(bad),
                name,
                limit.level,
                worst,
                limit.active,
            )
        )
        findings += [
            Finding(limit.code, name, limit.level, e.element, e.value, shown, limit.unit, e.point, e.remark)
            for e in bad
        ]
    order = ("error", "warning", "info")
    findings.sort(key=lambda finding: order.index(finding.level))
    return Readiness(profile.name, tuple(criteria), tuple(findings), facts)


# --- what is looked at ----------------------------------------------------------------------------------------------


def _size(inspection: Inspection) -> float:
    """The longest side of the box around all edges, in mm."""
    points = [edge.points for edge in inspection.edges if len(edge.points)]
    points += [np.array([face.middle]) for face in inspection.faces]
    return float(np.ptp(np.concatenate(points), axis=0).max()) if points else 0.0


def _of_bodies(inspection: Inspection) -> Iterator[Seen]:
    for number, body in enumerate(inspection.bodies):
        name = f"{body.kind} {number + 1}"
        yield Seen("valid", name, remark=", ".join(body.complaints), bad=bool(body.complaints))
        if body.kind == "solid":
            yield Seen("closed", name, remark="" if body.closed else "an edge has only one face", bad=not body.closed)


def _of_faces(inspection: Inspection) -> Iterator[Seen]:
    for number, face in enumerate(inspection.faces):
        name = face_name(inspection, number)
        yield Seen("valid", name, None, face.middle, ", ".join(face.complaints), bool(face.complaints))
        places = [None if np.isnan(place).any() else place for place in face.crossing]
        yield Seen("loop-intersection", name, None, places[0] if places else None, "", bool(places))
        yield Seen("tiny-face", name, float(np.sqrt(abs(face.area))), face.middle)
        if face.perimeter > 0:
            yield Seen(
                "narrow-face", name, 2 * abs(face.area) / face.perimeter, face.middle, "twice area over perimeter"
            )
        yield Seen("stored-tolerance", name, face.tolerance, face.middle)


def _of_edges(inspection: Inspection) -> Iterator[Seen]:
    for number, edge in enumerate(inspection.edges):
        if not len(edge.points):
            continue
        name, middle = edge_name(inspection, number), place_of(edge.points, len(edge.points) // 2)
        yield Seen("tiny-edge", name, edge.length, middle)
        yield Seen("vertex-gap", name, edge.vertex_gap, place_of(edge.points, 0))
        yield Seen("stored-tolerance", name, edge.tolerance, middle)
        for use in edge.uses:
            worst = int(use.gaps.argmax())
            yield Seen("edge-gap", name, float(use.gaps[worst]), place_of(edge.points, worst))
        if edge.alone:
            continue
        yield Seen("overused-edge", name, float(len(edge.uses)), middle)
        bodies = [inspection.faces[use.face].body for use in edge.uses]
        if len(edge.uses) == 1 and bodies[0] >= 0:
            free = inspection.bodies[bodies[0]].kind == "shell"
            yield Seen("free-edge", name, None, middle, "", free)
        elif len(edge.uses) == 2 and bodies[0] == bodies[1] >= 0:
            agree = edge.uses[0].forward != edge.uses[1].forward
            yield Seen("free-edge", name, None, middle)
            yield Seen("orientation", name, None, middle, "" if agree else "one of the faces is turned over", not agree)


def _of_splines(inspection: Inspection) -> Iterator[Seen]:
    from gtcad.converters.spline_quality import curve_quality, surface_quality

    for number, face in enumerate(inspection.faces):
        if face.spline is not None:
            yield from _of_spline(face_name(inspection, number), surface_quality(face.spline))
    for number, edge in enumerate(inspection.edges):
        if edge.spline is not None:
            yield from _of_spline(edge_name(inspection, number), curve_quality(edge.spline))


def _of_spline(name: str, quality: Any) -> Iterator[Seen]:
    yield Seen("degree", name, float(quality.degree))
    yield Seen("poles", name, float(quality.poles))
    if quality.knot_distance is not None:
        yield Seen("knot-distance", name, quality.knot_distance, quality.knot_place)
    if quality.knot_angle is not None:
        yield Seen("knot-angle", name, quality.knot_angle, quality.angle_place)


def _crossings(inspection: Inspection, profile: Profile, size: float) -> tuple[list[Seen], dict[str, Any]]:
    """Faces that cross on a mesh of them, and how fine that is."""
    resolution: dict[str, Any] = {"samples_of_edges": "33 to 257, in equal steps"}
    if not profile["self-intersection"].active or not inspection.faces:
        return [], resolution
    from gtcad.converters.crossings import crossings
    from gtcad.converters.occt.measuring import triangulation

    deflection = MESH * size
    vertices, triangles, owners = triangulation(inspection.faces, deflection)
    names = [face_name(inspection, number) for number in range(len(inspection.faces))]
    resolution |= {
        "mesh_deflection_mm": deflection,
        "crossing_depth_mm": DEPTH * deflection,
        "triangles": len(triangles),
    }
    if len(triangles) > MOST_TRIANGLES:
        resolution["crossings"] = f"not looked for: more than {MOST_TRIANGLES} triangles"
        return [], resolution
    pairs, points = crossings(vertices, triangles, DEPTH * deflection)
    places: dict[tuple[int, int], Point] = {}
    for pair, place in zip(np.sort(owners[pairs], axis=1).tolist(), points.tolist(), strict=True):
        places.setdefault((pair[0], pair[1]), (place[0], place[1], place[2]))
    remark = f"on triangles, deeper than {DEPTH * deflection:.2g} mm"
    found = [
        Seen("self-intersection", names[a] if a == b else f"{names[a]} and {names[b]}", None, place, remark, True)
        for (a, b), place in places.items()
    ]
    clean = set(range(len(names))) - {number for pair in places for number in pair}
    return found + [Seen("self-intersection", names[number]) for number in clean], resolution


# --- facts ----------------------------------------------------------------------------------------------------------


def _facts(inspection: Inspection, stored: Sequence[float], size: float) -> dict[str, Any]:
    from gtcad.converters.spline_quality import curve_quality, surface_quality

    faces, edges = inspection.faces, [edge for edge in inspection.edges if len(edge.points)]
    qualities = [surface_quality(face.spline) for face in faces if face.spline is not None]
    qualities += [curve_quality(edge.spline) for edge in edges if edge.alone and edge.spline is not None]
    tolerances = [face.tolerance for face in faces] + [edge.tolerance for edge in inspection.edges]
    uses: Callable[[int], int] = lambda count: sum(len(edge.uses) == count for edge in edges if not edge.alone)  # noqa: E731
    return {
        "size_mm": size,
        "faces": len(faces),
        "edges": sum(not edge.alone for edge in edges),
        "curves": sum(edge.alone for edge in edges),
        "solids": sum(body.kind == "solid" for body in inspection.bodies),
        "shells": sum(body.kind == "shell" for body in inspection.bodies),
        "closed": sum(body.closed for body in inspection.bodies),
        "free_edges": uses(1),
        "singular_points": len(inspection.edges) - len(edges),
        "area_mm2": sum(face.area for face in faces),
        "kinds": dict(Counter([face.kind for face in faces] + [edge.kind for edge in edges if edge.alone])),
        "degrees": dict(sorted(Counter("x".join(map(str, quality.degrees)) for quality in qualities).items())),
        "rational": sum(quality.rational for quality in qualities),
        "poles": sum(quality.poles for quality in qualities),
        "multiple_knots": sum(quality.multiple_knots for quality in qualities),
        "stated_accuracy_mm": list(stored),
        "stored_tolerance_mm": [min(tolerances), max(tolerances)] if tolerances else None,
    }
