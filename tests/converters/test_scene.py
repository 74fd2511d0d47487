from __future__ import annotations

import pickle
from dataclasses import replace
from math import pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gtcad import Curve
from gtcad.combs import comb
from gtcad.converters.brep import read_brep
from gtcad.converters.deviations import signed_distances
from gtcad.converters.occt.compat import kernel_module
from gtcad.converters.part import BodyFacts, EllipseArc, Part, TrimmedFace
from gtcad.converters.quadrics import Quadric
from gtcad.converters.scene import scene_of_parts
from gtcad.converters.verdicts import Row
from gtcad.errors import KernelError
from gtcad.measure import Estimate
from gtcad.patches.rotation import Rotation
from gtcad.quilt import Quilt
from tests.converters import bodies
from tests.converters.scenes import bent_curve, edges, face, patch, strip

BODY = BodyFacts("solid", True, True, lambda: Estimate(0.0, 0.0))


def sphere(radius: float = 5.0, **about) -> Part:
    whole = Quadric("sphere", [1, 2, 3], [0, 0, 1], [1, 0, 0], radius, 0.0, (0, 2 * pi), (-pi / 2, pi / 2))
    return Part("ball", whole, source="SPHERICAL_SURFACE", **about)


def areas(held) -> np.ndarray:
    """Vectors of the triangles: half the cross products."""
    a, b, c = np.moveaxis(held.vertices[held.triangles], 1, 0)
    return np.cross(b - a, c - a) / 2


@pytest.mark.parametrize("reversed_", [False, True])
def test_a_sphere_has_its_points_normals_and_curvatures(reversed_: bool) -> None:
    (held,) = scene_of_parts([sphere(reversed=reversed_)]).faces
    sign = -1.0 if reversed_ else 1.0
    out = held.vertices - [1, 2, 3]
    np.testing.assert_allclose(np.linalg.norm(out, axis=1), 5.0, rtol=1e-12)
    inner = np.abs(out[:, 2]) < 4.999
    np.testing.assert_allclose(held.normals[inner], sign * out[inner] / 5, atol=1e-9)
    np.testing.assert_allclose(held.values["mean"][inner], -sign / 5, rtol=1e-9)
    np.testing.assert_allclose(held.values["gaussian"][inner], 1 / 25, rtol=1e-9)
    assert np.isfinite(held.normals).all()
    assert np.isnan(held.values["deviation"]).all()
    assert ((areas(held) * held.normals[held.triangles[:, 0]]).sum(axis=1) >= -1e-12).all()
    assert np.linalg.norm(areas(held), axis=1).sum() == pytest.approx(100 * pi, rel=5e-3)


def test_curvatures_of_splines_are_those_of_the_patch() -> None:
    """The middle of z = h 4 u(1-u) v(1-v) over a square of side a: S_uu = -2h, S_uv = 0 over |S_u|^2 = a^2."""
    (held,) = scene_of_parts([face("hill", patch([0, 0, 0], [10, 0, 0], [0, 10, 0], 4.0))]).faces
    top = held.vertices[:, 2].argmax()
    np.testing.assert_allclose(held.vertices[top], [5, 5, 1.0], atol=1e-12)
    np.testing.assert_allclose(held.normals[top], [0, 0, 1], atol=1e-12)
    bend = -8 * 1.0 / 10**2
    assert held.values["mean"][top] == pytest.approx(bend, rel=1e-9)
    assert held.values["gaussian"][top] == pytest.approx(bend**2, rel=1e-9)
    assert len(held.net) == 6
    assert held.facts["degree"] == (2, 2)
    assert held.facts["poles"] == (3, 3)


@given(st.floats(-0.9, 0.9), st.booleans())
@settings(max_examples=20, deadline=None)
def test_deviations_of_an_offset_cylinder_are_the_offset(offset: float, reversed_: bool) -> None:
    """Points at distance 2 + d from an axis are at d from a cylinder of radius 2."""
    model = Rotation(Curve([[2, 0, 0], [2, 0, 1.5], [2, 0, 3]]), [0, 0, 0], [0, 0, 1], angle_deg=120)
    held = Quadric("cylinder", [0, 0, 0], [0, 0, 1], [1, 0, 0], 2 + offset, 0.0, (0.2, 1.8), (0.5, 2.5))
    part = Part("tube", held, source="CYLINDRICAL_SURFACE", reversed=reversed_)
    (found,) = scene_of_parts([part], [Row("tube", "proved", face=(0,))], {"tube": model}).faces
    sign = -1.0 if reversed_ else 1.0
    np.testing.assert_allclose(found.values["deviation"], sign * offset, atol=1e-12)


def test_signed_distances_are_those_of_an_exhaustive_search() -> None:
    surface = patch([0, 0, 0], [10, 0, 0], [0, 10, 0], 6.0)
    rng = np.random.default_rng(1)
    points = rng.uniform([-3, -3, -1], [13, 13, 5], (60, 3))
    normals = np.tile([0.0, 0.0, 1.0], (60, 1))
    t = np.linspace(0, 1, 401)
    dense = surface.evaluate(t[:, None], t[None, :]).reshape(-1, 3)
    apart = np.array([np.linalg.norm(dense - point, axis=1).min() for point in points])
    found = signed_distances(points, normals, [surface])
    assert (np.abs(found) <= apart + 1e-12).all()
    np.testing.assert_allclose(np.abs(found), apart, atol=1e-3)
    above = [point[2] > 1.5 + 1e-9 for point in points]
    assert (found[above] > 0).all()


def test_the_nearest_of_several_surfaces_counts() -> None:
    low, high = (patch([0, 0, z], [10, 0, 0], [0, 10, 0]) for z in (0.0, 4.0))
    points = np.array([[5.0, 5, 1], [5, 5, 3]])
    normals = np.tile([0.0, 0.0, 1.0], (2, 1))
    np.testing.assert_allclose(signed_distances(points, normals, [low, high]), [1, -1], atol=1e-12)


def test_rows_tell_which_shape_a_face_stands_for() -> None:
    shapes, parts = strip(bump=0.02)
    rows = [Row("patch 2", "proved", face=(1,)), Row("patch 1", "proved")]  # the second is known by its name
    first, second, third = scene_of_parts(parts, rows, shapes).faces
    assert np.abs(first.values["deviation"]).max() < 1e-12
    assert second.values["deviation"].max() == pytest.approx(0.005, rel=1e-6)
    assert np.isnan(third.values["deviation"]).all()


def test_patches_of_quilts_are_known_by_their_rows() -> None:
    quilt = Quilt.recognised([patch([10 * k, 0, 0], [10, 0, 0], [0, 10, 0]) for k in range(2)], names=["left", "right"])
    part = face("anything", patch([10, 0, 0.25], [10, 0, 0], [0, 10, 0]))
    (held,) = scene_of_parts([part], [Row("roof.right", "failed", face=(0,))], {"roof": quilt}).faces
    np.testing.assert_allclose(held.values["deviation"], 0.25, atol=1e-12)


def test_parts_of_another_file_can_be_what_is_compared_with() -> None:
    shapes, parts = strip(bump=-0.04)
    others = [face(name, surface) for name, surface in shapes.items()]
    rows = [Row(other.name, "proved", face=(k,)) for k, other in enumerate(others)]
    held = scene_of_parts(parts, rows, others=others).faces
    assert held[1].values["deviation"].min() == pytest.approx(-0.01, rel=1e-6)
    assert np.abs(held[2].values["deviation"]).max() < 1e-12


# --- trimmed faces ----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def drilled(tmp_path_factory) -> list[Part]:
    """A ball of radius 10 about the origin with a hole of radius 3 along z."""
    primitives, boolean = kernel_module("BRepPrimAPI"), kernel_module("BRepAlgoAPI")
    gp, tools = kernel_module("gp"), kernel_module("BRepTools")
    ball = primitives.BRepPrimAPI_MakeSphere(10.0).Solid()
    axis = gp.gp_Ax2(gp.gp_Pnt(0, 0, -20), gp.gp_Dir(0, 0, 1))
    drill = primitives.BRepPrimAPI_MakeCylinder(axis, 3.0, 40.0).Solid()
    path = tmp_path_factory.mktemp("brep") / "drilled.brep"
    with path.open("wb") as file:
        tools.BRepTools.Write_s(boolean.BRepAlgoAPI_Cut(ball, drill).Shape(), file)
    cut = read_brep(path)
    primitive = primitives.BRepPrimAPI_MakeBox(gp.gp_Pnt(-20, -20, 5), 40.0, 40.0, 40.0).Solid()
    with path.open("wb") as file:
        tools.BRepTools.Write_s(boolean.BRepAlgoAPI_Cut(primitive, drill).Shape(), file)
    return [*cut, *(part for part in read_brep(path) if part.trimmed)]


def test_trimmed_faces_are_divided_within_their_boundaries(drilled: list[Part]) -> None:
    trimmed = [part for part in drilled if part.trimmed]
    assert {part.source for part in trimmed} >= {"PLANE"}
    for part in trimmed:
        (held,) = scene_of_parts([part]).faces
        out = np.hypot(held.vertices[:, 0], held.vertices[:, 1])
        assert out.min() > 3 - 0.05  # chords of the hole
        assert np.linalg.norm(areas(held), axis=1).sum() == pytest.approx(part.face.area, rel=5e-3)
        assert ((areas(held) * held.normals[held.triangles[:, 0]]).sum(axis=1) > -1e-9).all()
        longest = np.linalg.norm(held.vertices[held.triangles] - held.vertices[np.roll(held.triangles, 1, 1)], axis=2)
        assert longest.max() < np.linalg.norm(np.ptp(held.vertices, axis=0)) / 6


def test_a_drilled_ball_has_two_creases_and_smooth_seams(drilled: list[Part]) -> None:
    ball = [part for part in drilled if part.body is drilled[0].body]
    scene = scene_of_parts(ball)
    outer = next(held for held in scene.faces if np.linalg.norm(held.vertices, axis=1).min() > 9.99)
    np.testing.assert_allclose(outer.normals, outer.vertices / 10, atol=1e-9)
    np.testing.assert_allclose(outer.values["mean"], -0.1, rtol=1e-9)
    assert edges(scene)["G0"] == 2
    assert "free" not in edges(scene)


def test_faces_that_cannot_be_divided_are_left_out() -> None:
    def broken():
        raise KernelError("no")

    surface = patch([0, 0, 0], [10, 0, 0], [0, 10, 0])
    whole = face("whole", surface)
    unknown = face("unknown", surface, trimmed=True)
    failing = replace(unknown, name="failing", face=TrimmedFace(lambda points: points[:, 0], 1.0, broken))
    scene = scene_of_parts([failing, unknown, whole])
    assert [(held.name, held.part, held.number) for held in scene.faces] == [("whole", 2, 3)]


# --- edges ------------------------------------------------------------------------------------------------------------


def test_the_edges_of_a_box_are_creases() -> None:
    parts = [face(f"side {k}", side, body=BODY) for k, side in enumerate(bodies.box())]
    assert edges(scene_of_parts(parts)) == {"G0": 12}
    assert edges(scene_of_parts(parts[:5])) == {"G0": 8, "free": 4}


def test_patches_in_one_plane_meet_smoothly_whichever_way_they_are_turned() -> None:
    left = patch([0, 0, 0], [10, 0, 0], [0, 10, 0])
    for right in (patch([10, 0, 0], [10, 0, 0], [0, 10, 0]), patch([20, 0, 0], [-10, 0, 0], [0, 10, 0])):
        scene = scene_of_parts([face("left", left), face("right", right)])
        assert edges(scene) == {"G2": 1, "free": 6}
        (shared,) = (curve for curve in scene.curves if curve.continuity == "G2")
        assert set(shared.faces) == {0, 1}
        assert "left" in shared.name
        assert "right" in shared.name


@pytest.mark.parametrize(("gap", "found"), [(0.005, {"G2": 1, "free": 6}), (0.05, {"free": 8})])
def test_sides_apart_are_free(gap: float, found: dict[str, int]) -> None:
    parts = [
        face("left", patch([0, 0, 0], [10, 0, 0], [0, 10, 0])),
        face("right", patch([10 + gap, 0, 0], [10, 0, 0], [0, 10, 0])),
    ]
    assert edges(scene_of_parts(parts)) == found


def test_a_fillet_is_tangent_but_jumps_in_curvature() -> None:
    """A quarter of a cylinder between two planes that it touches."""
    quarter = Quadric("cylinder", [0, 0, 0], [0, 1, 0], [1, 0, 0], 4.0, 0.0, (-pi / 2, 0), (0, 10))
    ends = [quarter.evaluate(u, 0.0) for u in quarter.u_range]
    top, side = sorted(ends, key=lambda point: point[0])
    flat = patch(top, [-10, 0, 0], [0, 10, 0])
    upright = patch(side, [0, 0, -10], [0, 10, 0])
    parts = [Part("fillet", quarter, source="CYLINDRICAL_SURFACE"), face("flat", flat), face("upright", upright)]
    assert edges(scene_of_parts(parts)) == {"G1": 2, "free": 8}


def test_folded_back_sheets_of_a_body_are_no_smooth_edge() -> None:
    under, over = patch([0, 0, 0], [10, 0, 0], [0, 10, 0]), patch([10, 0, 0], [-10, 0, 0.5], [0, 10, 0])
    parts = [face("under", under, body=BODY), face("over", over, body=BODY)]
    orders = edges(scene_of_parts(parts))
    assert orders["G0"] == 1


def test_one_long_side_may_meet_two_short_ones() -> None:
    parts = [
        face("long", patch([0, 0, 0], [20, 0, 0], [0, 10, 0])),
        face("left", patch([0, 10, 0], [10, 0, 0], [0, 10, 0])),
        face("right", patch([10, 10, 0], [10, 0, 0], [0, 10, 0])),
    ]
    orders = edges(scene_of_parts(parts))
    assert orders["free"] == 7
    assert orders["G2"] >= 2


def test_a_closed_tube_has_a_seam() -> None:
    tube = Quadric("cylinder", [0, 0, 0], [0, 0, 1], [1, 0, 0], 2.0, 0.0, (0, 2 * pi), (0, 5))
    assert edges(scene_of_parts([Part("tube", tube)])) == {"G2": 1, "free": 2}


def test_the_poles_of_a_ball_are_no_edges() -> None:
    assert edges(scene_of_parts([sphere()])) == {"G2": 1}


# --- curves -----------------------------------------------------------------------------------------------------------


def test_curves_come_with_their_combs() -> None:
    circle = Part("ring", EllipseArc([0, 0, 1], [2, 0, 0], [0, 2, 0], 0.0, 3.0), source="CIRCLE")
    ring, wave = scene_of_parts([circle, bent_curve()]).curves
    np.testing.assert_allclose(np.linalg.norm(ring.points - [0, 0, 1], axis=1), 2, rtol=1e-12)
    reach = np.linalg.norm(ring.comb - [0, 0, 1], axis=1)
    np.testing.assert_allclose(reach, reach[0], rtol=1e-9)
    assert reach[0] > 2
    np.testing.assert_allclose(ring.curvature, 0.5, rtol=1e-9)
    assert ring.arc_lengths[-1] == pytest.approx(6.0, rel=1e-9)
    assert (ring.kind, ring.continuity, wave.part) == ("curve", "", 1)
    np.testing.assert_allclose(wave.comb, comb(bent_curve().geometry, teeth=120).tips)


def test_a_point_is_no_curve() -> None:
    point = Part("dot", EllipseArc([10, 0, 0], [1e-13, 0, 0], [0, 1e-13, 0], 0.0, 1.0))
    assert [curve.name for curve in scene_of_parts([point, bent_curve()]).curves] == ["wave"]


# --- the whole --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [1e-30, 1e160])
def test_sizes_beyond_all_use_are_no_errors(size: float) -> None:
    (held,) = scene_of_parts([face("odd", patch([0, 0, 0], [size, 0, 0], [0, size, 0], size / 10))]).faces
    assert held.vertices.max() == pytest.approx(size)


def test_an_empty_file_is_an_empty_scene() -> None:
    scene = scene_of_parts([])
    assert (scene.faces, scene.curves) == ((), ())


def test_scenes_travel_between_processes() -> None:
    shapes, parts = strip()
    scene = scene_of_parts([*parts, bent_curve()], [], shapes)
    again = pickle.loads(pickle.dumps(scene))
    assert [held.name for held in again.faces] == ["patch 1", "patch 2", "patch 3"]
    np.testing.assert_array_equal(again.faces[1].vertices, scene.faces[1].vertices)


def test_many_faces_share_the_corners_that_a_view_can_hold() -> None:
    parts = [face("", patch([11 * k, 0, 0], [10, 0, 0], [0, 10, 0], 8.0)) for k in range(60)]
    scene = scene_of_parts(parts)
    assert sum(len(held.vertices) for held in scene.faces) <= 60_000
    assert [held.name for held in scene.faces[:2]] == ["no. 1", "no. 2"]
