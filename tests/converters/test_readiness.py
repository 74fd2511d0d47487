"""Readiness for CAM: every criterion finds a fault of known size, and accuses nothing that is sound."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gtcad.converters.bspline import BSplineCurve, BSplineSurface
from gtcad.converters.crossings import crossings
from gtcad.converters.occt.compat import kernel_module
from gtcad.converters.occt.topology import make_face
from gtcad.converters.part import Part
from gtcad.converters.profiles import PROFILES, limit_of, profile_of
from gtcad.converters.readiness import Finding, Readiness, readiness, readiness_of_file
from gtcad.converters.spline_quality import curve_quality, surface_quality
from gtcad.converters.stated import iges_accuracies, step_accuracies
from gtcad.converters.step import write_step
from gtcad.errors import FileError, InputError
from tests.converters import faulty

QUIET = {"free-edge"}  # shells have free edges, which is told and harmless
NEW_KERNEL = not hasattr(kernel_module("BRepCheck"), "BRepCheck_ListOfStatus")


def judged(shape: Any, profile: str = "cam", **limits: float | None) -> Readiness:
    changes = {name.replace("_", "-"): value for name, value in limits.items()}
    return readiness(faulty.items_of(shape), profile=profile_of(profile, changes))


def findings(found: Readiness, criterion: str = "") -> list[Finding]:
    return [f for f in found.findings if f.criterion == criterion or (not criterion and f.criterion not in QUIET)]


def one(found: Readiness, criterion: str) -> Finding:
    assert {finding.criterion for finding in findings(found)} >= {criterion}
    return findings(found, criterion)[0]


def test_sizes_that_nothing_has_are_refused() -> None:
    def box(size: float) -> Any:
        return kernel_module("BRepPrimAPI").BRepPrimAPI_MakeBox(size, 1e9, 1e9).Shape()

    assert judged(box(9e11), self_intersection=None).facts["size_mm"] == pytest.approx(9e11)
    with pytest.raises(InputError, match=r"the size must be at most 1e\+12 mm, got 1.1e\+12 mm"):
        judged(box(1.1e12), self_intersection=None)


def test_errors_come_first_and_what_is_only_told_comes_last() -> None:
    levels = [finding.level for finding in judged(faulty.ridge(30), tiny_edge=1e3, stored_tolerance=0).findings]
    assert set(levels) == {"error", "warning", "info"}
    assert levels == sorted(levels, key=["error", "warning", "info"].index)


def test_the_documented_limits_are_those_of_the_profiles() -> None:
    """The table of docs/checking.md: limits with units, a letter for the source, and the codes."""
    text = (Path(__file__).parents[2] / "docs" / "checking.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| ([a-z-]+) \| (.*) \| (.*) \| (.*) \| ([A-Za-z-]*-[A-Za-z-]+) \|$", text, re.MULTILINE)
    sources = {"PTC Creo": ", a", "manufacturing (": ", b", "design (": ", c", "gtcad's own": ""}
    for name, *cells, code in rows:
        for profile, cell in zip(("cam", "vda-4955", "sasig"), cells, strict=True):
            limit = PROFILES[profile][name]
            letter = next((found for part, found in sources.items() if part in limit.source), "")
            assert cell == f"{limit.value:g} {limit.unit}".strip() + letter, (profile, name)
            assert limit.code == code
    numbered = {name for name, limit in PROFILES["cam"].limits.items() if limit.sense != "none" or limit.unit}
    assert {name for name, *_ in rows} == numbered


# --- sound shapes ---------------------------------------------------------------------------------------------------


def test_a_box_is_ready_by_every_profile() -> None:
    for profile in PROFILES:
        found = judged(faulty.box(10, 20, 30), profile)
        assert (found.verdict, found.findings) == ("ready", ())
        assert found.profile == profile
    facts = found.facts
    assert (facts["faces"], facts["edges"], facts["solids"], facts["closed"]) == (6, 12, 1, 1)
    assert facts["area_mm2"] == pytest.approx(2 * (200 + 300 + 600), rel=1e-9)
    assert Counter(edge["continuity"] for edge in facts["continuity"]) == {"G0": 12}
    assert [edge["angle_deg"] for edge in facts["continuity"]] == pytest.approx([90.0] * 12)
    by_name = {criterion.name: criterion for criterion in found.criteria}
    assert list(by_name) == list(PROFILES["cam"].limits)
    assert (by_name["tiny-edge"].checked, by_name["tiny-edge"].worst) == (12, pytest.approx(10.0))
    assert by_name["narrow-face"].worst == pytest.approx(2 * 200 / 60)
    assert (by_name["closed"].checked, by_name["orientation"].checked) == (1, 12)


def test_touching_and_nested_faces_are_no_crossings() -> None:
    found = judged(faulty.compound(faulty.box(10, 10, 10), faulty.neighbours(0.0), faulty.ridge(30)))
    # the squares lie on the bottom of the box: they touch it all over, and pass through nothing
    assert not findings(found, "self-intersection")


# --- one fault of a known size --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "criterion", "value"),
    [
        (lambda: faulty.box(0.001, 10, 10), "tiny-edge", 0.001),
        (lambda: faulty.box(0.001, 10, 10), "narrow-face", 2 * 0.01 / 20.002),
        (lambda: faulty.box(0.004, 0.004, 10), "tiny-face", 0.004),
        (lambda: faulty.lifted_edge(0.03), "edge-gap", 0.03),
        (lambda: faulty.shifted_vertex(0.02), "vertex-gap", 0.02),
        (lambda: faulty.neighbours(0.05), "face-gap", 0.05),
        (lambda: faulty.ridge(3), "tangent-angle", 3.0),
        (lambda: faulty.folded_patch(2), "knot-angle", 2.0),
        (faulty.three_wings, "overused-edge", 3.0),
        (lambda: faulty.lifted_edge(0.03), "stored-tolerance", 0.06),
        (lambda: faulty.bends(10, 12), "curvature-jump", 100 / 6),
    ],
)
def test_a_fault_is_found_and_measured(make: Callable[[], Any], criterion: str, value: float) -> None:
    found = one(judged(make()), criterion)
    assert found.value == pytest.approx(value, rel=1e-6, abs=1e-12)
    assert found.limit == PROFILES["cam"][criterion].value
    assert found.code == PROFILES["cam"][criterion].code
    assert found.point is not None


@pytest.mark.parametrize(
    ("make", "criterion"),
    [
        (faulty.open_solid, "closed"),
        (faulty.open_solid, "valid"),
        (faulty.turned_over, "orientation"),
        (faulty.bow_tie, "loop-intersection"),
        (faulty.bow_tie, "valid"),
        (faulty.crossing_squares, "self-intersection"),
        (faulty.looping_surface, "self-intersection"),
    ],
)
def test_a_fault_without_a_number_is_found(make: Callable[[], Any], criterion: str) -> None:
    found = judged(make())
    assert found.verdict == "not ready"
    assert one(found, criterion).level == "error"


def test_faults_below_the_limits_are_none() -> None:
    for shape in (faulty.lifted_edge(0.001), faulty.neighbours(0.001), faulty.ridge(0.3), faulty.folded_patch(0.1)):
        assert findings(judged(shape)) == []
    assert findings(judged(faulty.bends(10, 10))) == []


def test_the_kernel_says_why_a_shape_is_invalid() -> None:
    assert "shell NotClosed" in one(judged(faulty.open_solid()), "valid").remark
    remark = one(judged(faulty.bow_tie()), "valid").remark
    assert remark == ("face, wire" if NEW_KERNEL else "face UnorientableShape, wire SelfIntersectingWire")


@pytest.mark.parametrize("angle", [90.0, 30.0, 5.0])
def test_the_place_of_a_crossing_lies_on_both_faces(angle: float) -> None:
    point = one(judged(faulty.crossing_squares(angle)), "self-intersection").point
    assert point is not None
    assert (abs(point[0]), abs(point[2])) == pytest.approx((0, 0), abs=1e-9)  # the squares meet along the y axis
    assert abs(point[1]) <= 4


def test_a_surface_is_caught_where_it_passes_through_itself() -> None:
    finding = one(judged(faulty.looping_surface()), "self-intersection")
    assert finding.point is not None
    # by symmetry the loop crosses itself on the line x = 20, where its two branches have one height
    assert finding.point[0] == pytest.approx(20, abs=0.2)
    assert finding.element == "face 1"


# --- continuity -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("angle", "order", "level"),
    [(0.05, "G2", ""), (0.4, "G2", ""), (2, "G0", "warning"), (30, "G0", ""), (170, "G0", "")],
)
def test_angles_across_edges(angle: float, order: str, level: str) -> None:
    found = judged(faulty.ridge(angle))
    (edge,) = [edge for edge in found.facts["continuity"] if edge["continuity"] != "free"]
    assert edge["angle_deg"] == pytest.approx(angle, abs=1e-9)
    assert edge["continuity"] == order
    assert [finding.level for finding in findings(found, "tangent-angle")] == ([level] if level else [])


@settings(max_examples=15)  # the kernel takes its time
@given(st.floats(5, 50), st.floats(5, 50))
def test_jumps_of_curvature_are_those_of_the_radii(first: float, second: float) -> None:
    (edge,) = [
        e
        for e in judged(faulty.bends(first, second), self_intersection=None).facts["continuity"]
        if e["continuity"] != "free"
    ]
    expected = 100 * abs(1 / first - 1 / second) / max(1 / first, 1 / second)
    assert edge["curvature_jump_percent"] == pytest.approx(expected, abs=1e-6)
    assert edge["continuity"] == ("G2" if expected <= 10 else "G1")


@pytest.mark.parametrize(("height", "flatter"), [(1.0, True), (40.0, False)])
def test_jumps_between_nearly_flat_faces_are_measured_by_the_size_of_all(height: float, flatter: bool) -> None:
    """A plane of 100 mm, and a parabola that rises by `height` over the next 100 mm: its curvature is 2 h / 100^2."""
    rise = np.array([0.0, 0.0, height])
    net = [[[50.0 * i, 100.0 * j, 0] + rise * (i == 2) for j in range(2)] for i in range(3)]
    bent = BSplineSurface(np.array(net), [0, 1], [3, 3], 2, [0, 1], [2, 2], 1)
    flat = BSplineSurface(np.array(net)[::-1] * [-1, 1, 0], [0, 1], [3, 3], 2, [0, 1], [2, 2], 1)
    found = judged(faulty.sewn(make_face(flat), make_face(bent)), self_intersection=None)
    (edge,) = (edge for edge in found.facts["continuity"] if edge["continuity"] != "free")
    curvature = 2 * height / 100**2
    expected = 100 * curvature * 200 if flatter else 100.0
    assert edge["curvature_jump_percent"] == pytest.approx(expected, rel=1e-3)
    assert edge["continuity"] == ("G2" if flatter else "G1")


def test_the_limit_of_sharp_edges_says_which_angles_are_faults() -> None:
    assert findings(judged(faulty.ridge(30)), "tangent-angle") == []
    assert one(judged(faulty.ridge(30), sharp_angle=40), "tangent-angle").value == pytest.approx(30)
    assert one(judged(faulty.ridge(30), sharp_angle=None), "tangent-angle").value == pytest.approx(30)


# --- profiles -------------------------------------------------------------------------------------------------------


def test_limits_are_overridden_and_switched_off() -> None:
    shape = faulty.neighbours(0.05)
    assert judged(shape, face_gap=0.1).verdict == "ready"
    assert judged(shape, face_gap=0.04).verdict == "not ready"
    off = judged(shape, face_gap=None)
    assert off.verdict == "ready"
    assert next(criterion for criterion in off.criteria if criterion.name == "face-gap").checked == 0
    assert profile_of("cam", {"degree": 5.0})["degree"].source == "given by the user"
    assert PROFILES["cam"]["degree"].value == 11  # the profile itself is as it was


def test_profiles_differ_in_their_limits() -> None:
    shape = faulty.neighbours(0.015)
    assert {name: judged(shape, name).verdict for name in PROFILES} == {
        "cam": "not ready",
        "vda-4955": "ready",
        "sasig": "not ready",
    }


def test_every_limit_has_a_source_and_a_code() -> None:
    for profile in PROFILES.values():
        for limit in profile.limits.values():
            assert limit.source
            assert limit.code.startswith(("G-", "gtcad-"))
            assert limit.active


@pytest.mark.parametrize(
    ("text", "name", "value"),
    [
        ("tiny-edge=0.01mm", "tiny-edge", 0.01),
        ("Tiny-Edge = 1um", "tiny-edge", 1e-3),
        ("face-gap=1e-3in", "face-gap", 0.0254),
        ("tangent-angle=0.01rad", "tangent-angle", 0.01 * 180 / math.pi),
        ("edge-gap=250nm", "edge-gap", 2.5e-4),
        ("edge-gap=2cm", "edge-gap", 20.0),
        ("edge-gap=2M", "edge-gap", 2000.0),
        ("curvature-jump=25%", "curvature-jump", 25.0),
        ("degree=7", "degree", 7.0),
        ("valid=off", "valid", None),
    ],
)
def test_limits_as_texts(text: str, name: str, value: float | None) -> None:
    found, number = limit_of(text)
    assert found == name
    assert number == (None if value is None else pytest.approx(value))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("tiny-edge", "must be like"),
        ("tiny-edges=1", "must name one of"),
        ("tiny-edge=1deg", "is measured in mm"),
        ("degree=7mm", "is measured in no unit"),
        ("valid=1", "takes no number"),
        ("tiny-edge=-1", "from 0"),
        ("tiny-edge=1e999", "from 0"),
    ],
)
def test_wrong_limits_are_refused(text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        limit_of(text)


def test_unknown_profiles_and_limits_are_refused() -> None:
    with pytest.raises(InputError, match="one of cam, vda-4955, sasig, got 'iso'"):
        profile_of("iso")
    with pytest.raises(InputError, match="no limit 'size'"):
        profile_of("cam", {"size": 1.0})
    with pytest.raises(InputError, match="finite number from 0"):
        profile_of("cam", {"degree": math.nan})


# --- splines --------------------------------------------------------------------------------------------------------


def test_degree_poles_and_weights_are_counted() -> None:
    points = [[i, i % 3, 0] for i in range(13)]
    quality = curve_quality(BSplineCurve(points, [0, 1], [13, 13], 12, [1 + i % 2 for i in range(13)]))
    assert (quality.degree, quality.poles, quality.rational, quality.knot_distance) == (12, 13, True, None)
    surface = BSplineSurface(np.zeros((4, 3, 3)), [0, 1], [4, 4], 3, [0, 1], [3, 3], 2)
    assert (surface_quality(surface).degrees, surface_quality(surface).poles) == ((3, 2), 12)


def test_knots_that_are_close_together_in_space_are_found() -> None:
    line = BSplineCurve([[0, 0, 0], [1, 0, 0], [1.0005, 0, 0], [3, 0, 0]], [0, 0.3, 0.6, 1], [2, 1, 1, 2], 1)
    quality = curve_quality(line)
    assert quality.knot_distance == pytest.approx(0.0005)
    assert quality.knot_place == pytest.approx((1.0, 0, 0))
    band = BSplineSurface(
        [[p, p + [0, 0, 5]] for p in line.control_points], line.knots, [2, 1, 1, 2], 1, [0, 1], [2, 2], 1
    )
    assert surface_quality(band).knot_distance == pytest.approx(0.0005)
    assert surface_quality(band.transposed()).knot_distance == pytest.approx(0.0005)


@given(st.floats(0, 150))
def test_kinks_at_knots_have_their_angle(degrees: float) -> None:
    end = 1 + math.cos(math.radians(degrees)), math.sin(math.radians(degrees)), 0
    quality = curve_quality(BSplineCurve([[0, 0, 0], [1, 0, 0], end], [0, 0.4, 1], [2, 1, 2], 1))
    assert quality.knot_angle == pytest.approx(degrees, abs=1e-6)
    assert quality.angle_place == pytest.approx((1, 0, 0))


def test_a_high_degree_is_a_warning(tmp_path: Path) -> None:
    curve = BSplineCurve([[i, i % 3, 0] for i in range(14)], [0, 1], [14, 14], 13)
    write_step(tmp_path / "a.step", [Part("rail", curve)])
    found = readiness_of_file(str(tmp_path / "a.step"), "STEP")
    assert found.verdict == "ready"
    assert (one(found, "degree").value, one(found, "degree").element) == (13, "curve 1 'rail'")
    assert found.facts["degrees"] == {"13": 1}


# --- what the file says of itself -----------------------------------------------------------------------------------


def test_stated_accuracies_are_read_in_millimetres(tmp_path: Path) -> None:
    from gtcad.converters.iges import write_iges

    curve = Part("rail", BSplineCurve([[0, 0, 0], [1, 2, 0], [2, 0, 0]], [0, 1], [3, 3], 2))
    write_step(tmp_path / "a.step", [curve], tolerance=2.5e-5)
    write_iges(tmp_path / "a.igs", [curve], tolerance=2.5e-5)
    for name, form in (("a.step", "STEP"), ("a.igs", "IGES")):
        assert readiness_of_file(str(tmp_path / name), form).facts["stated_accuracy_mm"] == pytest.approx([2.5e-5])


@pytest.mark.parametrize(
    ("unit", "millimetres"),
    [
        ("(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.))", 1.0),
        ("( LENGTH_UNIT ( ) NAMED_UNIT ( * ) SI_UNIT ( $ , .METRE. ) )", 1e3),
        ("(CONVERSION_BASED_UNIT('INCH',#12)LENGTH_UNIT()NAMED_UNIT(#13))", 25.4),
    ],
)
def test_units_of_a_stated_accuracy(unit: str, millimetres: float) -> None:
    entity = "#20=UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE(1.E-3),#7,'distance_accuracy_value','');"
    data = f"#7={unit};\n{entity}".encode()
    assert step_accuracies(data) == pytest.approx((1e-3 * millimetres,))
    assert step_accuracies(data.replace(b"#7=", b"#8=")) == ()


def test_a_damaged_global_section_states_nothing() -> None:
    assert iges_accuracies(b"") == ()
    assert iges_accuracies(b"1H,,1H;,99H".ljust(72) + b"G      1\n") == ()


def test_files_that_cannot_be_read_are_refused(tmp_path: Path) -> None:
    for name, form in (("a.step", "STEP"), ("a.igs", "IGES"), ("a.brep", "BREP")):
        with pytest.raises(FileError, match="no such file"):
            readiness_of_file(str(tmp_path / name), form)
        (tmp_path / name).write_bytes(b"garbage" * 50)
        with pytest.raises(FileError, match=f"is not a readable {form} file"):
            readiness_of_file(str(tmp_path / name), form)


def test_brep_files_keep_their_faults(tmp_path: Path) -> None:
    path = faulty.write(faulty.lifted_edge(0.03), str(tmp_path / "a.brep"))
    assert one(readiness_of_file(path, "BREP"), "edge-gap").value == pytest.approx(0.03)


# --- triangles that cross -------------------------------------------------------------------------------------------

COORDINATES = st.lists(st.integers(-20, 20), min_size=18, max_size=18)


def volume(a: Any, b: Any, c: Any, d: Any) -> int:
    """Six times that of a tetrahedron, in whole numbers."""
    m = [[int(p[i] - a[i]) for i in range(3)] for p in (b, c, d)]
    return (
        m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1])
        - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0])
        + m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0])
    )


def pierces(p: Any, q: Any, triangle: Any) -> bool | None:
    """Whether a segment passes through the inside of a triangle; None when it meets its border or plane."""
    a, b, c = triangle
    sides = volume(p, a, b, c), volume(q, a, b, c)
    turns = volume(p, q, a, b), volume(p, q, b, c), volume(p, q, c, a)
    if 0 in sides or 0 in turns:
        return None
    return sides[0] * sides[1] < 0 and len({turn > 0 for turn in turns}) == 1


@given(COORDINATES)
def test_two_triangles_cross_when_a_side_of_one_pierces_the_other(numbers: list[int]) -> None:
    points = np.array(numbers, dtype=float).reshape(6, 3)
    first, second = points[:3].astype(int), points[3:].astype(int)
    through = [pierces(t[i], t[i - 1], other) for t, other in ((first, second), (second, first)) for i in range(3)]
    if None in through:
        return  # they touch: no crossing that has a depth
    pairs, places = crossings(points, np.array([[0, 1, 2], [3, 4, 5]]), 0.0)
    assert bool(len(pairs)) == any(through)
    for place in places:
        for corners in (points[:3], points[3:]):
            normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
            assert abs((place - corners[0]) @ normal) <= 1e-9 * np.linalg.norm(normal) * 100


def test_all_pairs_of_many_triangles_are_found() -> None:
    rng = np.random.default_rng(7)
    corners = rng.uniform(-1, 1, (70, 1, 3)) * 2 + rng.uniform(-1, 1, (70, 3, 3))
    vertices, triangles = corners.reshape(-1, 3), np.arange(210).reshape(-1, 3)
    expected = {
        (i, j)
        for i in range(70)
        for j in range(i + 1, 70)
        if len(crossings(np.vstack([corners[i], corners[j]]), np.array([[0, 1, 2], [3, 4, 5]]), 0.0)[0])
    }
    found = {(i, j) for i, j in crossings(vertices, triangles, 0.0)[0].tolist()}
    assert len(expected) > 20
    assert found == expected


def test_shallow_crossings_are_left_out() -> None:
    points = np.array([[0, 0, 0], [4, 0, 0], [0, 4, 0], [1, 1, -0.1], [1, 1, 2], [2, 0.5, -0.1]])
    triangles = np.array([[0, 1, 2], [3, 4, 5]])
    assert len(crossings(points, triangles, 0.09)[0]) == 1
    assert len(crossings(points, triangles, 0.11)[0]) == 0
    assert len(crossings(points, np.empty((0, 3), dtype=np.int64), 0.0)[0]) == 0
