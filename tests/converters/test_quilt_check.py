"""What the check of bodies finds: files that are right, and every way in which one may be wrong."""

from __future__ import annotations

import itertools
from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from gtcad import Curve, Surface
from gtcad.converters.brep import read_brep, write_brep
from gtcad.converters.bspline import BSplineSurface
from gtcad.converters.check import check_parts
from gtcad.converters.iges import read_iges, write_iges
from gtcad.converters.jobs import fit_shapes, parts_of
from gtcad.converters.occt.compat import kernel_module
from gtcad.converters.occt.pieces import subshapes
from gtcad.converters.occt.shells import make_shell
from gtcad.converters.part import Built, Part
from gtcad.converters.quilt_fit import fit_quilt
from gtcad.converters.solid import solid_of
from gtcad.converters.spline_parts import part_of_surface
from gtcad.converters.step import read_step, write_step
from gtcad.patch_joins import join_patch
from gtcad.patches import Rotation
from gtcad.quilt import Quilt
from gtcad.solid import Solid
from tests.converters import bodies

TOLERANCE = 1e-4


def sheet(order="G1"):
    """Two patches that join C1."""
    left = Surface([[[x, y, x * y / 9] for y in (0, 10, 20)] for x in (0, 10, 20)])
    right = join_patch(
        left, "u1", 3, order="C1", rest=[[[40, y, 9] for y in (0, 12, 20)], [[50, y, 3] for y in (0, 9, 22)]]
    )
    return Quilt.recognised([left, right], names=["left", "right"], order=order)


def can():
    return Solid(Quilt.recognised([bodies.barrel()], names=["side"]), "planar")


def ball():
    return Solid(Quilt.recognised(bodies.sphere().quarters(), names=["a", "b", "c", "d"]))


def box():
    return Solid(Quilt.recognised(bodies.box(variants=(0, 1, 2, 3, 6, 5)), names=list("abcdef")))


SHAPES = {"sheet": sheet(), "can": can(), "ball": ball(), "box": box()}


@cache
def built(name):
    (fit,) = fit_shapes({name: SHAPES[name]}, {"tolerance": TOLERANCE})
    return parts_of([fit], {})[0]


@cache
def read(name):
    """The faces of one shape, as a STEP file gives them back."""
    return tuple(written(built(name)))


def written(*parts, through=(write_step, read_step), suffix="step"):
    import tempfile
    from pathlib import Path

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"a.{suffix}"
        through[0](path, list(parts))
        return through[1](path)


def check(parts, *names, tolerance=TOLERANCE, **shapes):
    report = check_parts(list(parts), {name: SHAPES[name] for name in names} | shapes, tolerance)
    return report, {row.name: row for row in report.rows}


def verdicts(parts, *names, **shapes):
    return {name: row.verdict for name, row in check(parts, *names, **shapes)[1].items()}


ALL = ("sheet", "can", "ball", "box")


def test_files_that_are_right_are_proved_and_their_joints_kept():
    parts = [part for name in ALL for part in read(name)]
    report, rows = check(parts, *ALL)
    assert {row.verdict for row in rows.values()} == {"proved"}
    assert list(rows)[:7] == ["sheet", "sheet.left", "sheet.right", "can", "can.side", "ball", "ball.a"]
    assert report.extra == ()
    assert len(report.joints) == 1 + 1 + 4 + 12
    assert all(joint.kept for joint in report.joints)
    assert report.joints[0].name == "sheet.left.u1-right.u0"
    assert report.joints[0].wanted == "G1"
    assert rows["sheet"].remark == "shell"
    assert rows["box"].remark == "closed solid, 6000 mm^3 by the kernel"
    for name in ALL:
        of_patches = [row.deviation for key, row in rows.items() if key.startswith(f"{name}.")]
        assert rows[name].deviation == tuple(np.max(of_patches, axis=0))


def test_a_tolerance_that_the_file_does_not_keep_fails():
    found = verdicts(read("can"), "can", tolerance=1e-6)
    assert found["can.side"] == found["can"] == "failed"


# --- faces ------------------------------------------------------------------------------------------------------------


def moved(spline, place, by=0.01):
    points = spline.control_points.copy()
    points[place] += by
    return spline.with_control_points(points)


def test_a_moved_pole_fails_its_patch_and_the_whole():
    left, right = read("sheet")
    found = verdicts([left, replace(right, geometry=moved(right.geometry, (3, 3)))], "sheet")
    assert found == {"sheet": "failed", "sheet.left": "proved", "sheet.right": "failed"}


def test_a_pole_moved_next_to_an_edge_loses_the_joint_even_within_the_tolerance():
    left, right = read("sheet")
    near = moved(right.geometry, (1, 2), 1e-5)
    report, rows = check([left, replace(right, geometry=near)], "sheet")
    assert rows["sheet.right"].verdict == "proved"
    assert [joint.kept for joint in report.joints] == [False]
    assert report.joints[0].report.order == "C0"


def test_an_edge_that_gapes_loses_the_joint():
    left, right = read("sheet")
    report, _ = check([left, replace(right, geometry=moved(right.geometry, (0, slice(None)), 3e-5))], "sheet")
    assert [joint.kept for joint in report.joints] == [False]
    assert report.joints[0].report.gap == pytest.approx(3e-5 * 3**0.5, rel=1e-6)


def test_a_joint_of_lower_order_than_wanted_is_lost():
    report, _ = check(read("sheet"), sheet=sheet("G3"))
    assert [(joint.wanted, joint.kept) for joint in report.joints] == [("G3", False)]


def rounded(spline, digits):
    points = [float(f"{x:.{digits - 1}e}") for x in spline.control_points.ravel().tolist()]
    return spline.with_control_points(np.reshape(points, spline.control_points.shape))


def test_coordinates_of_ten_digits_or_nine_decimals_of_a_metre_lose_no_joint_but_those_of_eight_digits_do():
    """Far from the origin and nearly flat, where rounding shows most."""
    left = Surface([[[x, y, 1e-4 * x * y] for y in (0, 10, 20)] for x in (0, 10, 20)])
    rest = [[[60, y, 0.1] for y in (0, 12, 20)], [[70, y, 0.1] for y in (0, 9, 22)]]
    patches = [left, join_patch(left, "u1", 4, order="C2", rest=rest)]
    quilt = Quilt.recognised([patch.transformed(np.eye(3), [800, 300, 70]) for patch in patches], order="G2")
    splines = fit_quilt(quilt, tolerance=TOLERANCE).splines
    for digits, kept in ((17, True), (10, True), (8, False)):
        parts = [Part(f"q.{name}", rounded(one, digits)) for name, one in zip(quilt.names, splines, strict=True)]
        (joint,) = check(parts, q=quilt)[0].joints
        within = joint.report.tangent_angle_deg <= 1e-6 and joint.report.curvature_jump <= 1e-6
        assert (joint.kept, within) == (kept, digits == 17)
    in_metres = [one.with_control_points(1e3 * np.round(1e-3 * one.control_points, 9)) for one in splines]
    parts = [Part(f"q.{name}", one) for name, one in zip(quilt.names, in_metres, strict=True)]
    (joint,) = check(parts, q=quilt)[0].joints
    assert joint.kept
    assert joint.report.tangent_angle_deg > 1e-6


def test_a_missing_face_is_missing():
    report, rows = check(read("box")[1:], "box")
    assert rows["box.a"].verdict == "missing"
    assert rows["box"].verdict == "missing"
    assert {rows[f"box.{k}"].verdict for k in "bcdef"} == {"proved"}
    assert len(report.joints) == 8
    assert verdicts([], "box") == dict.fromkeys(["box", *(f"box.{k}" for k in "abcdef")], "missing")


def test_faces_may_lie_in_any_order():
    parts = [part for name in ("box", "sheet") for part in read(name)]
    report, rows = check(parts[::-1], "sheet", "box")
    assert {row.verdict for row in rows.values()} == {"proved"}
    assert all(joint.kept for joint in report.joints)


@pytest.mark.parametrize("name", ALL)
def test_faces_without_names_in_any_order_are_known_by_where_they_lie(name):
    parts = [replace(part, name="") for part in read(name)]
    for seed in range(3):
        order = np.random.default_rng(seed).permutation(len(parts))
        report, rows = check([parts[k] for k in order], name)
        assert {row.verdict for row in rows.values()} == {"proved"}
        assert all(joint.kept for joint in report.joints)
        assert "matched by position" in rows[name].remark


def test_one_face_without_its_name_is_found_among_those_with_names():
    first, *others = read("box")
    assert set(verdicts([*others, replace(first, name="")], "box").values()) <= {"proved", "failed", "missing"}
    report, rows = check([*others, replace(first, name="box")], "box")
    assert {row.verdict for row in rows.values()} == {"proved"}
    assert len(report.joints) == 12


def test_exchanged_names_are_told_and_not_accused():
    first, second, *others = read("box")
    report, rows = check([replace(first, name=second.name), replace(second, name=first.name), *others], "box")
    assert {row.verdict for row in rows.values()} == {"proved"}
    assert [rows[f"box.{k}"].remark for k in "abc"] == ["the file calls it 'box.b'", "the file calls it 'box.a'", ""]
    assert all(joint.kept for joint in report.joints)


def test_a_name_that_two_faces_bear_leaves_one_over():
    parts = read("box")
    _, rows = check([*parts, replace(parts[0])], "box")
    assert rows["box"].verdict == "failed"
    assert rows["box"].remark == "1 face besides those of patches"


def turned(part, number):
    """The same face with another parametrisation."""
    spline = part.geometry
    if number & 1:
        spline = spline.transposed()
    if number & 2:
        spline = BSplineSurface(
            spline.control_points[::-1],
            (spline.knots_u[0] + spline.knots_u[-1] - spline.knots_u)[::-1],
            spline.multiplicities_u[::-1],
            spline.degree_u,
            spline.knots_v,
            spline.multiplicities_v,
            spline.degree_v,
        )
    return replace(part, geometry=spline.transposed() if number & 4 else spline)


@pytest.mark.parametrize("number", range(1, 8))
def test_faces_that_run_otherwise_are_proved_and_their_joints_looked_at(number):
    left, right = read("sheet")
    report, rows = check([turned(left, number), turned(right, 7 - number)], "sheet")
    assert {row.verdict for row in rows.values()} == {"proved"}
    assert [joint.kept for joint in report.joints] == [True]
    broken = replace(right, geometry=moved(right.geometry, (1, 2), 1e-5))
    report, _ = check([turned(left, number), turned(broken, 7 - number)], "sheet")
    assert [joint.kept for joint in report.joints] == [False]


# --- patches in several faces -----------------------------------------------------------------------------------------


def parts_at(part, u, v):
    """The part in four, cut at places of its domain."""
    lines = [[ends[0], *(ends[0] * (1 - x) + ends[1] * x for x in at), ends[1]]
             for ends, at in zip(part.geometry.domain, (u, v), strict=True)]  # fmt: skip
    cells = itertools.product(*map(pairwise, lines))
    return [replace(part, geometry=part_of_surface(part.geometry, cell)[0]) for cell in cells]


CUTS = {"alike": ((0.3, 0.7), (0.3, 0.7)), "unlike": ((0.3,), (0.25, 0.6)), "one": ((0.4,), ()), "other": ((), (0.6,))}


@pytest.mark.parametrize(("name", "number"), [("alike", 1), ("unlike", 0), ("unlike", 6), ("one", 3), ("other", 4)])
def test_the_edges_of_split_patches_are_compared_whichever_way_the_parts_run(name, number):
    left, right = (
        [turned(one, number) for one in parts_at(part, (0.55,) if cuts else (), cuts)]
        for part, cuts in zip(read("sheet"), CUTS[name], strict=True)
    )
    report, rows = check([*left, *right], "sheet")
    assert [rows[f"sheet.{patch}"].verdict for patch in ("left", "right")] == ["proved"] * 2
    assert [(joint.name, joint.wanted, joint.kept) for joint in report.joints] == [
        ("sheet.left.u1-right.u0", "G1", True)
    ]
    assert "not compared" not in rows["sheet"].remark
    report, _ = check([*left, *right], sheet=sheet("G3"))
    assert [(joint.wanted, joint.kept) for joint in report.joints] == [("G3", False)]


@pytest.mark.parametrize(("number", "beside"), [(0, True), (1, True), (2, False)])
def test_what_is_bent_or_gapes_is_seen_in_each_part_next_to_an_edge(number, beside):
    left, right = read("sheet")
    parts = parts_at(right, (0.55,), (0.6,))  # the first two are at u0
    bent = parts.copy()
    bent[number] = replace(bent[number], geometry=moved(bent[number].geometry, (1, 2), 1e-5))
    report, rows = check([left, *bent], "sheet")
    assert rows["sheet.right"].verdict == "proved"
    assert [(joint.kept, joint.report.order[1] == "0") for joint in report.joints] == [(not beside, beside)]
    parts[number] = replace(parts[number], geometry=moved(parts[number].geometry, (0, slice(None)), 3e-5))
    (joint,) = check([left, *parts], "sheet")[0].joints
    assert joint.kept == (not beside)
    assert joint.report.gap == pytest.approx(3e-5 * 3**0.5 if beside else 0.0, rel=1e-6, abs=1e-9)


def test_a_part_that_is_missing_at_an_edge_leaves_it_uncompared():
    left, right = read("sheet")
    parts = parts_at(left, (0.55,), (0.3,))
    report, rows = check([*parts[:3], right], "sheet")
    assert report.joints == ()
    assert rows["sheet"].verdict == "failed"
    assert "1 of 1 shared edges not compared" in rows["sheet"].remark


# --- bodies -----------------------------------------------------------------------------------------------------------


def test_faces_that_stand_alone_are_no_body():
    loose = [Part(part.name, part.geometry) for part in read("box")]
    back = written(*loose)
    assert [part.body for part in back] == [None] * 6
    for parts in (back, written(*loose, through=(write_iges, read_iges), suffix="igs")):
        _, rows = check(parts, "box")
        assert rows["box"].verdict == "failed"
        assert rows["box"].remark == "its faces are not one shell or solid in the file"
        assert {rows[f"box.{k}"].verdict for k in "abcdef"} == {"proved"}


def test_one_face_is_no_solid():
    whole = Solid(Quilt.recognised([bodies.sphere()]))
    (fit,) = fit_shapes({"x": whole}, {"tolerance": TOLERANCE})
    (part,) = written(Part("x", fit.geometry.splines[0]))
    _, rows = check([part], x=whole)
    assert (rows["x"].verdict, rows["x"].remark) == ("failed", "a face, not a solid")
    assert rows["x.patch 1"].verdict == "proved"


def test_an_open_shell_is_no_solid_and_no_closed_shell():
    fit = fit_quilt(Quilt.recognised(bodies.box()[:5], names=list("abcde")), tolerance=TOLERANCE)
    shell = make_shell(fit.splines, fit.quilt.edges, fit.quilt.flipped)
    parts = written(Part("x", Built("shell", shell.shape, fit.quilt.names, fit.splines)))
    _, rows = check(parts, x=Solid(Quilt.recognised(bodies.box(), names=list("abcdef"))))
    assert rows["x"].verdict == "missing"
    assert rows["x"].remark == "a shell, not a solid; not closed: an edge is not in two faces"
    _, rows = check(parts, x=Quilt.recognised(bodies.box()[:5], names=list("abcde")))
    assert rows["x"].verdict == "proved"


def test_a_closed_shell_is_no_solid_and_a_solid_no_shell():
    quilt = SHAPES["box"].quilt
    (fit,) = fit_shapes({"box": quilt}, {"tolerance": TOLERANCE})
    shell = written(*parts_of([fit], {}))
    _, rows = check(shell, "box")
    assert (rows["box"].verdict, rows["box"].remark) == ("failed", "a shell, not a solid")
    _, rows = check(shell, box=quilt)
    assert (rows["box"].verdict, rows["box"].remark) == ("proved", "closed shell")
    _, rows = check(read("box"), box=quilt)
    assert (rows["box"].verdict, rows["box"].remark) == ("failed", "a solid, not a shell")


def test_a_reversed_face_is_not_taken_for_a_closed_body():
    item = built("box").geometry
    builder, topods = kernel_module("BRep").BRep_Builder(), kernel_module("TopoDS")
    shell, solid = topods.TopoDS_Shell(), topods.TopoDS_Solid()
    builder.MakeShell(shell)
    for k, face in enumerate(subshapes(item.shape, "FACE")):
        builder.Add(shell, face.Reversed() if k == 2 else face)
    shell.Closed(True)
    builder.MakeSolid(solid)
    builder.Add(solid, shell)
    # the kernel's reader of STEP turns such faces back, that of BREP takes them as they are
    parts = written(Part("box", replace(item, shape=solid)), through=(write_brep, read_brep), suffix="brep")
    _, rows = check(parts, "box")
    assert rows["box"].verdict == "failed"
    assert "not closed: an edge is not in two faces" in rows["box"].remark


def test_a_body_turned_inside_out_fails():
    item = built("ball").geometry
    inside_out = Part("ball", replace(item, shape=item.shape.Reversed()))
    _, rows = check(written(inside_out, through=(write_brep, read_brep), suffix="brep"), "ball")
    assert rows["ball"].verdict == "failed"
    assert "but the model's volume is 33.5" in rows["ball"].remark


def test_another_volume_fails():
    """Every patch is right, but one of the caps is not where it belongs."""
    quilt = Quilt.recognised([bodies.barrel()], names=["side"])
    fit = fit_quilt(quilt, tolerance=TOLERANCE)
    domed = Rotation(Curve([[0, 0, -1], [4, 0, -1], [4, 0, 0]]), bodies.ORIGIN, bodies.AXIS)
    fuller = Quilt.recognised([bodies.barrel(), domed], names=["side", "cap 1"])
    body = solid_of(fit_quilt(fuller, tolerance=TOLERANCE), caps="planar")
    parts = written(Part("can", Built("solid", body.shape, tuple(body.faces), fit.splines)))
    _, rows = check(parts, "can")
    assert rows["can.side"].verdict == "proved"
    assert rows["can"].verdict == "failed"
    assert f"but the model's volume is {bodies.barrel_volume():.9g} mm^3" in rows["can"].remark
    assert verdicts(read("can"), "can")["can"] == "proved"


def test_a_face_too_many_fails():
    quilt = SHAPES["ball"].quilt
    three = Quilt.recognised(quilt.patches[:3], names=quilt.names[:3])
    (fit,) = fit_shapes({"x": quilt}, {"tolerance": TOLERANCE})
    _, rows = check(written(*parts_of([fit], {})), x=three)
    assert (rows["x"].verdict, rows["x"].remark) == ("failed", "1 face besides those of patches")
    _, rows = check(read("can"), can=Quilt.recognised([bodies.barrel()], names=["side"]))
    assert rows["can"].verdict == "failed"
    assert rows["can"].remark == "2 faces besides those of patches; a solid, not a shell"


def test_two_bodies_with_equal_patch_names_are_kept_apart():
    twin = SHAPES["box"].transformed(np.eye(3), [100, 0, 0])
    (fit,) = fit_shapes({"twin": twin}, {"tolerance": TOLERANCE})
    parts = written(*parts_of([fit], {}), built("box"))
    _, rows = check(parts, "box", twin=twin)
    assert {row.verdict for row in rows.values()} == {"proved"}
    nameless = [replace(part, name="") for part in parts]
    _, rows = check(nameless, twin=twin, box=SHAPES["box"])
    assert {row.verdict for row in rows.values()} == {"proved"}
    _, rows = check([replace(part, name=part.name.replace("twin", "box")) for part in parts[::-1]], "box")
    assert (rows["box"].verdict, rows["box"].remark.split("; ")[-1]) == (
        "failed",
        "its faces are not one shell or solid in the file",
    )


def test_walls_are_held_against_the_exact_volume():
    quilt = Quilt.recognised([bodies.barrel()], names=["side"])
    wall = Solid(quilt, thickness=-0.5)
    (fit,) = fit_shapes({"w": wall}, {"tolerance": 1e-3})
    parts = written(*parts_of([fit], {}))
    _, rows = check(parts, w=wall, tolerance=1e-3)
    assert (rows["w"].verdict, rows["w.side"].verdict) == ("estimated", "proved")
    assert rows["w"].deviation is None
    assert rows["w"].method == "patches, and the wall's volume"
    assert "not compared" not in rows["w"].remark
    _, rows = check(parts, w=replace(wall, thickness=-0.51), tolerance=1e-3)
    assert rows["w"].verdict == "failed"
    _, rows = check(parts, w=replace(wall, thickness=0.5), tolerance=1e-3)
    assert rows["w"].verdict == "failed"


def test_a_foreign_part_in_the_file_is_left_over():
    report, rows = check([*read("box"), *read("sheet")], "box")
    assert rows["box"].verdict == "proved"
    assert report.extra == ("sheet.left", "sheet.right")
