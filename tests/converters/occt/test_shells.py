from __future__ import annotations

import io
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gtcad.converters.bspline import BSplineSurface
from gtcad.converters.occt.caps import capped, planar_caps
from gtcad.converters.occt.compat import as_edge, kernel_module
from gtcad.converters.occt.faces import area, volume
from gtcad.converters.occt.pieces import ShapeKey, edge_geometry, is_valid, subshapes
from gtcad.converters.occt.shells import EdgeUses, edge_uses, make_shell, make_solid, parts_of
from gtcad.converters.occt.topology import make_face
from gtcad.errors import InputError
from gtcad.quilt import SharedEdge, Use
from tests.converters import bodies
from tests.converters.occt import shapes

BRep = kernel_module("BRep")
BRep_Tool = BRep.BRep_Tool
TopoDS = kernel_module("TopoDS")


def shell_of(fit, turned=False):
    return make_shell(fit.splines, fit.quilt.edges, [flip != turned for flip in fit.quilt.flipped])


def shared(first, second, back=False):
    return SharedEdge(Use(*first), Use(*second), back)


def compound(*pieces):
    builder, made = BRep.BRep_Builder(), TopoDS.TopoDS_Compound()
    builder.MakeCompound(made)
    for piece in pieces:
        builder.Add(made, piece)
    return made


def moved(surface, shift):
    return surface.with_control_points(surface.control_points + np.array(shift, dtype=float))


def beside(left, number=0):
    """A patch whose u0 is the u1 of another one, run through in one of the ways."""
    points = shapes.patch(2).control_points + np.array([10.0, 0, 0])
    points[0] = left.control_points[-1]
    right = replace(left, control_points=points)
    return bodies.variant(right.control_points, number)


# --- shared edges -----------------------------------------------------------------------------------------------------


@settings(max_examples=20)
@given(st.lists(st.integers(0, 7), min_size=6, max_size=6))
def test_a_box_is_closed_however_its_patches_run(variants):
    fit = bodies.fitted(bodies.box(variants=variants))
    shell = shell_of(fit)
    assert shell.shape.Closed()
    assert shell.free == ()
    assert edge_uses(shell.shape) == EdgeUses(shared=12)
    assert len(subshapes(shell.shape, "VERTEX")) == 8
    solid = make_solid(shell)
    assert is_valid(solid)
    assert volume(solid, rtol=1e-10) == pytest.approx(6000, rel=1e-12)
    inside_out = make_solid(shell_of(fit, turned=True))
    assert volume(inside_out, rtol=1e-10) == pytest.approx(-6000, rel=1e-12)


@pytest.mark.parametrize("number", range(8))
def test_neighbours_share_one_edge_with_a_line_on_each_whichever_way_they_run(number):
    left = shapes.patch(1, (3, 4))
    points = beside(left, number)
    u = left.knots_u, left.multiplicities_u, left.degree_u
    v = left.knots_v, left.multiplicities_v, left.degree_v

    def backwards(knots, multiplicities, degree):
        return 1 - knots[::-1], multiplicities[::-1], degree

    if number & 1:
        u, v = v, u
    right = BSplineSurface(points, *(backwards(*u) if number & 2 else u), *(backwards(*v) if number & 4 else v))
    side = ("v" if number & 1 else "u") + ("1" if number & (4 if number & 1 else 2) else "0")
    back = bool(number & (2 if number & 1 else 4))
    edges = [shared((0, "u1"), (1, side), back)]
    turned = number.bit_count() % 2 == 1  # each of transposing and reversing turns the normals over
    shell = make_shell([left, right], edges, [False, turned])
    with pytest.raises(InputError, match="the faces turn against each other there: wrong flips"):
        make_shell([left, right], edges, [False, not turned])
    assert edge_uses(shell.shape) == EdgeUses(shared=1, free=6)
    assert not shell.shape.Closed()
    a, b = shell.faces
    edge = next(
        as_edge(edge)
        for edge in subshapes(a, "EDGE")
        if any(ShapeKey(edge) == ShapeKey(other) for other in subshapes(b, "EDGE"))
    )
    assert shapes.same_bits(edge_geometry(edge)[0], left.boundary("u1"))
    for t in np.linspace(0, 1, 11).tolist():
        at = left.evaluate(1.0, t)
        for face, surface in ((a, left), (b, right)):
            flat = BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 0.0)
            assert np.abs(surface.evaluate(*flat.Value(t).Coord()) - at).max() < 1e-13


def test_faces_are_those_of_the_patches_in_their_order():
    fit = bodies.fitted(bodies.box(variants=(0, 1, 2, 3, 4, 5)))
    shell = shell_of(fit)
    assert [round(area(face)) for face in shell.faces] == [600, 600, 300, 300, 200, 200]
    assert [ShapeKey(face) for face in subshapes(shell.shape, "FACE")] == [ShapeKey(face) for face in shell.faces]


def test_a_closed_patch_has_seams_and_points():
    whole = shell_of(bodies.fitted([bodies.torus()]))
    assert edge_uses(whole.shape) == EdgeUses(seams=2)
    assert len(subshapes(whole.shape, "VERTEX")) == 1
    ball = shell_of(bodies.fitted([bodies.sphere()]))
    assert edge_uses(ball.shape) == EdgeUses(seams=1, degenerate=2)
    assert len(subshapes(ball.shape, "VERTEX")) == 2
    for shell in (whole, ball):
        assert shell.shape.Closed()
        assert is_valid(make_solid(shell))


def test_patches_meet_in_points_that_are_degenerate_edges_of_each():
    shell = shell_of(bodies.fitted(bodies.sphere().quarters()))
    assert edge_uses(shell.shape) == EdgeUses(shared=4, degenerate=8)
    assert len(subshapes(shell.shape, "VERTEX")) == 2
    assert volume(make_solid(shell), rtol=1e-9) == pytest.approx(32 * math.pi / 3, abs=1e-5 * 16 * math.pi)


def test_neighbouring_sides_of_one_patch_cannot_be_one_edge():
    points = np.array(shapes.patch(3, (3, 3)).control_points)
    square = BSplineSurface(points[:4, :4], [0, 1], [4, 4], 3, [0, 1], [4, 4], 3)
    points = np.array(square.control_points)
    points[:, 0] = points[0]
    with pytest.raises(InputError, match="but not opposite: the kernel has no such face, divide the patch"):
        make_shell([replace(square, control_points=points)], [shared((0, "u0"), (0, "v0"))], [False])


def test_exact_rational_patches_share_edges_too():
    octant = shapes.octant()
    mirrored = octant.with_control_points(octant.control_points * [1, -1, 1])
    shell = make_shell([octant, mirrored], [shared((0, "u0"), (1, "u0"))], [False, True])
    assert edge_uses(shell.shape) == EdgeUses(shared=1, degenerate=2, free=4)
    assert area(shell.shape) == pytest.approx(4 * math.pi, rel=1e-6)


def test_free_edges_are_named_and_run_as_their_face_uses_them():
    fit = bodies.fitted([bodies.cylinder()])
    for turned in (False, True):
        shell = shell_of(fit, turned)
        assert [(edge.patch, edge.side, edge.ahead) for edge in shell.free] == [
            (0, "u0", turned),
            (0, "u1", not turned),
        ]
        with pytest.raises(InputError, match="a solid needs closed shells: side u0 of patch 0 is free"):
            make_solid(shell)


# --- what is refused --------------------------------------------------------------------------------------------------


def test_wrong_arguments_are_refused():
    a, b = shapes.patch(1), moved(shapes.patch(1), [0, 0, 5])
    with pytest.raises(InputError, match="one flag for each, got 2 and 1"):
        make_shell([a, b], [], [False])
    with pytest.raises(InputError, match="a patch and one flag"):
        make_shell([], [], [])
    with pytest.raises(InputError, match="no side 'u2' of a patch 0"):
        make_shell([a], [shared((0, "u2"), (0, "u1"))], [False])
    with pytest.raises(InputError, match="no side 'u1' of a patch 1"):
        make_shell([a], [shared((0, "u0"), (1, "u1"))], [False])
    with pytest.raises(InputError, match="fall into 2 separate parts"):
        make_shell([a, b], [], [False, False])
    with pytest.raises(InputError, match="side u0 of patch 0 and side u0 of patch 1 are one edge, but 5 mm apart"):
        make_shell([a, b], [shared((0, "u0"), (1, "u0"))], [False, True])
    with pytest.raises(InputError, match="their domains differ"):
        make_shell([a, replace(a, knots_v=[0, 0.7, 2])], [shared((0, "u0"), (1, "u0"))], [False, True])
    with pytest.raises(InputError, match="side u0 of patch 0 is shared twice"):
        make_shell([a, a, a], [shared((0, "u0"), (1, "u0")), shared((0, "u0"), (2, "u0"))], [False, True, True])
    flat = np.array(a.control_points)
    flat[0] = flat[0, 0]
    flat[0, 1] += [0, 0, 1e-9]
    with pytest.raises(InputError, match="patch 1: side u0 is 1e-09 mm long"):
        make_shell([a, replace(a, control_points=flat)], [], [False, False])


def test_a_surface_with_one_side_is_refused():
    turn = np.linspace(0, 2 * math.pi, 9)
    middle = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=-1)
    across = np.cos(turn / 2)[:, None] * middle + np.sin(turn / 2)[:, None] * np.array([0, 0, 1])
    points = np.stack([3 * middle - across, 3 * middle + across], axis=1)
    points[-1] = points[0, ::-1]
    band = BSplineSurface(points, np.linspace(0, 1, 9), [2, *[1] * 7, 2], 1, [0, 1], [2, 2], 1)
    with pytest.raises(InputError, match="a surface with one side only"):
        make_shell([band], [shared((0, "u0"), (0, "u1"), True)], [False])


# --- how edges are used -----------------------------------------------------------------------------------------------


def test_uses_of_edges_are_counted():
    left = shapes.patch(1)
    right = replace(left, control_points=beside(left))
    pair = make_shell([left, right], [shared((0, "u1"), (1, "u0"))], [False, False])
    turned = compound(pair.faces[0], pair.faces[1].Reversed())
    assert edge_uses(turned) == EdgeUses(free=6, wrong=1)
    assert edge_uses(compound(*pair.faces, pair.faces[0])).wrong == 4
    apart = compound(make_face(left), make_face(right))
    assert edge_uses(apart) == EdgeUses(free=8)
    assert (parts_of(apart), parts_of(pair.shape), parts_of(compound())) == (2, 1, 0)
    assert EdgeUses(shared=3, seams=1, degenerate=2).closed
    assert not EdgeUses(shared=3, free=1).closed
    assert not EdgeUses(shared=3, wrong=1).closed


# --- planar caps ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("turned", [False, True])
def test_a_tube_gets_two_caps_on_its_own_edges(turned):
    open_one = shell_of(bodies.fitted([bodies.barrel()]), turned)
    caps = planar_caps(open_one, flatness=1e-5)
    assert len(caps) == 2
    assert max(cap.flatness for cap in caps) < 1e-12
    assert [abs(round(cap.normal[2], 12)) for cap in caps] == [1, 1]
    shell = capped(open_one, caps)
    assert edge_uses(shell.shape) == EdgeUses(shared=2, seams=1)
    assert [area(face) for face in shell.faces[1:]] == pytest.approx([16 * math.pi, 9 * math.pi], rel=1e-5)
    held = volume(make_solid(shell), rtol=1e-9)
    assert abs(held) == pytest.approx(bodies.barrel_volume(), abs=1e-5 * 300)
    outwards = [cap.normal @ [0, 0, side] > 0 for cap, side in zip(caps, (-1, 1), strict=True)]
    assert outwards == [held > 0] * 2


def test_a_cap_of_several_edges_under_any_motion():
    turn = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
    five = [patch.transformed(turn, [5, -7, 11]) for patch in bodies.box(variants=(3, 1, 4, 1, 5, 2))[:5]]
    open_one = shell_of(bodies.fitted(five))
    caps = planar_caps(open_one, flatness=1e-5)
    assert [len(cap.loop) for cap in caps] == [4]
    solid = make_solid(capped(open_one, caps))
    assert edge_uses(solid) == EdgeUses(shared=12)
    assert abs(volume(solid, rtol=1e-10)) == pytest.approx(6000, rel=1e-12)


def tilted_rim(height):
    """A tube over a square whose upper rim leaves its plane by a quarter of the height at each corner."""
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 0]], dtype=float)
    upper = square + np.array([0, 0, 3.0])
    upper[1] += [0, 0, height]
    points = np.stack([square, upper], axis=1)
    tube = BSplineSurface(points, np.linspace(0, 1, 5), [2, 1, 1, 1, 2], 1, [0, 1], [2, 2], 1)
    return make_shell([tube], [shared((0, "u0"), (0, "u1"))], [False])


def test_a_loop_off_its_plane_is_refused_with_the_distance():
    with pytest.raises(InputError, match=r"loop at side v1 of patch 0 is not plane.*more than 1e-05 mm") as info:
        planar_caps(tilted_rim(0.01), flatness=1e-5)
    stated = float(str(info.value).partition("up to ")[2].partition(" mm")[0])
    assert 0.002 < stated < 0.01


def test_an_edge_within_the_flatness_keeps_a_valid_solid():
    shell = tilted_rim(4e-6)
    caps = planar_caps(shell, flatness=1e-5)
    solid = make_solid(capped(shell, caps))
    assert is_valid(solid)
    assert 1e-6 < max(cap.flatness for cap in caps) < 4e-6
    tolerances = {round(BRep_Tool.Tolerance_s(as_edge(edge)), 12) for edge in subshapes(caps[1].face, "EDGE")}
    assert tolerances == {round(1.01 * caps[1].flatness, 12)}
    assert abs(volume(solid, rtol=1e-9)) == pytest.approx(3, abs=4e-6)


def test_loops_that_cannot_be_capped_are_refused():
    with pytest.raises(InputError, match="the shell is closed: there is nothing to cap"):
        planar_caps(shell_of(bodies.fitted([bodies.torus()])), flatness=1e-5)
    inner, outer = (shapes.cylinder(radius) for radius in (1.0, 2.0))
    bottom = BSplineSurface(
        np.stack([inner.control_points[:, 0], outer.control_points[:, 0]], axis=1),
        *(inner.knots_u, inner.multiplicities_u, inner.degree_u),
        *([0, 1], [2, 2], 1),
        np.stack([inner.weights[:, 0]] * 2, axis=1),
    )
    seams = [shared((k, "u0"), (k, "u1")) for k in range(3)]
    cup = make_shell(
        [inner, outer, bottom],
        [*seams, shared((0, "v0"), (2, "v0")), shared((1, "v0"), (2, "v1"))],
        [True, False, False],
    )
    with pytest.raises(InputError, match="loops at side v1 of patch 0 and at side v1 of patch 1 lie in one plane"):
        planar_caps(cup, flatness=1e-5)
    fold = np.array([[[0, 0, 0], [0, 0, 1]], [[1, 0, 0], [1, 0, 1]], [[0, 0, 0], [0, 0, 1]]], dtype=float)
    crumpled = BSplineSurface(fold, [0, 0.5, 1], [2, 1, 2], 1, [0, 1], [2, 2], 1)
    with pytest.raises(InputError, match="encloses no area"):
        planar_caps(make_shell([crumpled], [shared((0, "u0"), (0, "u1"))], [False]), flatness=1e-5)


# --- exchange ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("patches", [bodies.box(), [bodies.sphere()], [bodies.torus()]], ids=["box", "sphere", "torus"])
def test_brep_keeps_the_solid(patches):
    shell = shell_of(bodies.fitted(patches))
    solid = make_solid(shell)
    stream, tools = io.BytesIO(), kernel_module("BRepTools").BRepTools
    tools.Write_s(solid, stream)
    back = TopoDS.TopoDS_Shape()
    tools.Read_s(back, io.BytesIO(stream.getvalue()), BRep.BRep_Builder())
    assert is_valid(back)
    assert edge_uses(back) == edge_uses(solid)
    assert volume(back, rtol=1e-9) == pytest.approx(float(volume(solid, rtol=1e-9)), rel=1e-12)
