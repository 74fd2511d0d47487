from __future__ import annotations

import copy
import doctest
import inspect
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

host = pytest.importorskip("build123d")

from build123d import (  # noqa: E402 - only where it is installed
    Align,
    Axis,
    BuildLine,
    BuildPart,
    BuildSketch,
    Cylinder,
    GeomType,
    Line,
    Locations,
    Mode,
    Plane,
    Pos,
    Rot,
    extrude,
    fillet,
    make_face,
    sweep,
)

import gtcad  # noqa: E402
from gtcad import BERNSTEIN, Curve, Quilt, Solid, Surface  # noqa: E402
from gtcad.composite import Composite  # noqa: E402
from gtcad.conics import Arc  # noqa: E402
from gtcad.converters import build123d as gt  # noqa: E402
from gtcad.converters import build123d_faces, build123d_lines, build123d_sheets  # noqa: E402
from gtcad.errors import ExtraMissing, InputError  # noqa: E402
from gtcad.patches import Rotation  # noqa: E402

POINTS = [(0, 0), (3, 7), (7, -2), (10, 3)]
SWING = Curve([[0, 0], [3, 7], [7, -2], [10, 3]], gamma=(0.4, -0.6))
BACK = Curve([[10, 3], [5, -8], [0, 0]])
VASE = Curve([[4, 0, 0], [7, 0, 5], [3, 0, 10]])


def vase(**options: Any) -> Any:
    return gt.GTSolid(Rotation(VASE, [0, 0, 0], [0, 0, 1]), caps="planar", **options)


@pytest.mark.parametrize("module", [gt, build123d_lines, build123d_faces, build123d_sheets])
def test_examples(module: ModuleType) -> None:
    assert doctest.testmod(module).failed == 0


# --- lines ------------------------------------------------------------------------------------------------------------


def test_a_bezier_in_a_builder_is_an_edge_of_the_sketch() -> None:
    with BuildPart() as part:
        with BuildSketch(Plane.XZ):
            with BuildLine() as line:
                curve = gt.GTBezier(*POINTS, gamma=(0.4, -0.6))
                Line(curve @ 1, (10, -6))
                Line((10, -6), (0, -6))
                Line((0, -6), curve @ 0)
            make_face()
        extrude(amount=5)
        sharp = part.part.volume
        fillet(part.edges().filter_by(GeomType.BSPLINE), 0.3)
    x, weights = np.polynomial.legendre.leggauss(40)
    t = (x + 1) / 2
    area = weights @ (SWING.evaluate(t)[:, 1] * SWING.derivative(t)[:, 0]) / 2 + 60
    assert sharp == pytest.approx(5 * area, abs=5 * 15 * 1e-3)
    assert part.part.is_valid
    assert 0 < sharp - part.part.volume < 1
    assert len(line.edges()) == 4
    np.testing.assert_allclose(curve.exact.evaluate(t), SWING.transformed(np.eye(3, 2)).evaluate(t), atol=1e-14)


def test_private_objects_stay_out_of_the_builder() -> None:
    with BuildLine() as line:
        gt.GTBezier(*POINTS)
        gt.GTBezier(*POINTS, mode=Mode.PRIVATE)
    assert len(line.edges()) == 1


def test_lines_go_where_the_locations_are() -> None:
    with BuildLine(Plane.YZ) as line, Locations((0, 0), (20, 0)):
        gt.GTBezier(*POINTS)
    box = line.line.bounding_box()
    assert len(line.edges()) == 2
    assert pytest.approx((0, 30), abs=1e-3) == (box.min.Y, box.max.Y)
    assert pytest.approx(0, abs=1e-5) == box.size.X


def test_points_of_the_host_are_points() -> None:
    mixed = gt.GTBezier(host.Vector(0, 0, 0), (3, 7), host.Vertex(7, -2, 0), (10, 3, 0))
    np.testing.assert_allclose(mixed.exact.control_points[:, :2], POINTS)
    listed = gt.GTBezier(POINTS)
    np.testing.assert_allclose(listed.exact.control_points[:, :2], POINTS)


@pytest.mark.parametrize(
    ("make", "kind"),
    [
        (lambda: gt.GTConic((1, 2), (5, 0), (0, 5)), GeomType.CIRCLE),
        (lambda: gt.GTConic((1, 2), (5, 0), (0, 3), 10, 200), GeomType.ELLIPSE),
        (lambda: gt.GTParabola((0, 0), (1, 2), (2, 0)), GeomType.BSPLINE),
        (lambda: gt.GTCurve(Curve([[0, 0], [3, 4]], family=BERNSTEIN)), GeomType.LINE),
    ],
)
def test_conics_and_lines_are_exact(make: Any, kind: Any) -> None:
    edge = make()
    assert edge.geom_type == kind
    assert edge.fit.exact
    assert edge.deviation[1] < 1e-11
    assert isinstance(edge, host.Edge)


def test_hyperbolas_are_kept_within_the_tolerance() -> None:
    edge = gt.GTHyperbola((0, 0), (1, 0), (0, 1), -1, 1, tolerance=1e-5)
    points = np.array([tuple(edge @ s) for s in np.linspace(0, 1, 101)])
    assert np.abs(np.hypot(1, points[:, 1]) - points[:, 0]).max() < 1.5e-5


@pytest.mark.parametrize("order", ["G1", "G2", "G3"])
def test_joins_to_edges_of_the_host(order: Any) -> None:
    edge = host.Edge.make_circle(5, start_angle=0, end_angle=100)
    joined = gt.GTJoin(edge, (-8, 9), (-9, 20, 4), order=order)
    assert (joined @ 0 - edge @ 1).length < 1e-9
    assert (joined % 0 - edge % 1).length < 1e-9
    if order != "G1":
        spline = joined.fit.spline
        first, second = (spline.derivative(spline.domain[0], k) for k in (1, 2))
        bend = np.linalg.norm(np.cross(first, second)) / np.linalg.norm(first) ** 3
        assert bend == pytest.approx(1 / 5, rel=1e-9)


def test_chains_are_wires_that_make_faces_and_paths() -> None:
    wire = gt.GTComposite(SWING, BACK, closed=True)
    assert wire.is_closed
    assert len(wire.edges()) == 2
    chained = gt.GTComposite(gt.GTBezier(*POINTS), Curve([[10, 3, 0], [5, -8, 0], [0, 0, 0]]), closed=True)
    assert chained.length == pytest.approx(gt.GTComposite(Curve(POINTS), BACK, closed=True).length, rel=1e-9)
    path = gt.GTCurve(Curve([[0, 0, 0], [0, 5, 20], [10, 0, 40]]))
    bar = sweep(Plane(path @ 0, z_dir=path % 0) * host.Circle(1), path=path)
    assert bar.is_valid
    assert bar.volume == pytest.approx(np.pi * path.length, rel=1e-3)


def test_chains_are_checked() -> None:
    with pytest.raises(InputError, match="at least one piece"):
        gt.GTComposite()
    with pytest.raises(InputError, match="give none"):
        gt.GTComposite(Composite((SWING, BACK), ("C0", "C0"), True), closed=True)
    with pytest.raises(InputError, match=r"pieces\[1\] must be a curve"):
        gt.GTComposite(SWING, 3)


# --- sketches, faces --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("turned", [False, True])
def test_profiles_extrude_upwards(turned: bool) -> None:
    pieces = (BACK.reversed(), SWING.reversed()) if turned else (SWING, BACK)
    profile = gt.GTProfile(*pieces)
    part = extrude(profile, 4) - Pos(5, 0, 2) * Cylinder(0.5, 10)
    assert part.is_valid
    assert pytest.approx(4, abs=1e-6) == part.bounding_box().max.Z
    assert part.volume == pytest.approx(4 * (profile.area - np.pi / 4), rel=1e-4)


def test_profiles_align_turn_and_subtract() -> None:
    with BuildSketch() as sketch:
        host.Rectangle(40, 40)
        hole = gt.GTProfile(SWING, BACK, align=Align.CENTER, rotation=90, mode=Mode.SUBTRACT)
    assert sketch.sketch.area == pytest.approx(1600 - hole.area, rel=1e-5)
    center = hole.bounding_box().center()
    assert center.length < 1e-6


def test_profiles_that_are_none_are_refused() -> None:
    with pytest.raises(InputError, match="z = 0"):
        gt.GTProfile(gt.GTConic((0, 0, 1), (3, 0, 0), (0, 3, 0)))
    net = [[[0, 0], [0, 3]], [[4, 0], [5, 5]]]
    assert gt.GTProfile(Surface(net, family_u=BERNSTEIN, family_v=BERNSTEIN)).area == pytest.approx(17.5, rel=1e-9)


def line(*ends: Any) -> Curve:
    return Curve(ends, family=BERNSTEIN)


FACES: dict[str, Any] = {
    "surface": lambda **o: gt.GTSurface([[[x, y, x * y / 20] for y in (0, 5, 10)] for x in (0, 5, 10)], **o),
    "ruled": lambda **o: gt.GTRuled(SWING.transformed(np.eye(3, 2)), line([0, 0, 9], [10, 0, 9]), **o),
    "swept": lambda **o: gt.GTSwept(VASE, line([0, 0, 0], [0, 9, 0]), **o),
    "swung": lambda **o: gt.GTSwung(Curve([[4, 0], [7, 5], [3, 10]]), Curve([[1, 0], [1, 1], [0, 1]]), **o),
    "rotation": lambda **o: gt.GTRotation(VASE, Axis.Z, 120, **o),
    "lofted": lambda **o: gt.GTLofted([VASE.transformed(np.eye(3), [0, y, y * y / 9]) for y in (0, 4, 9)], **o),
    "coons": lambda **o: gt.GTCoons(
        line([0, 0, 0], [5, 0, 1]),
        line([0, 5, 1], [5, 5, 0]),
        line([0, 0, 0], [0, 5, 1]),
        line([5, 0, 1], [5, 5, 0]),
        **o,
    ),
    "enveloping": lambda **o: gt.GTEnveloping(
        [(1, 0, 0, 3), (1, 1, 0, 3), (0, 1, 0, 3)], (0, 0, 1, 0), Curve([[3, 0, 4], [3, 3, 5], [0, 3, 4]]), **o
    ),
    "spine": lambda **o: gt.GTSpineDevelopable(Curve([[3, 0, 0], [3, 3, 1], [0, 3, 2]]), (1, 3), **o),
    "geodesic": lambda **o: gt.GTGeodesicDevelopable(gt.GTBezier((3, 0, 0), (3, 3, 0), (0, 3, 0)), (-1, 2), **o),
    "plateau": lambda **o: gt.GTPlateau(
        Curve([[0, 0, 0], [2, 0, 2], [5, 0, 0]]),
        line([0, 5, 0], [5, 5, 0]),
        line([0, 0, 0], [0, 5, 0]),
        line([5, 0, 0], [5, 5, 0]),
        **o,
    ),
    "dirichlet": lambda **o: gt.GTDirichlet(
        [[[x, y, np.nan if (x, y) == (5, 5) else x * y / 20] for y in (0, 5, 10)] for x in (0, 5, 10)], **o
    ),
    "sweep": lambda **o: gt.GTSweep(Curve([[1, 0], [1, 1], [0, 1]]), Curve([[0, 0, 0], [0, 5, 9], [4, 0, 20]]), **o),
}


@pytest.mark.parametrize("name", FACES)
def test_faces_are_faces_with_labels_and_colours_where_they_belong(name: str) -> None:
    face = FACES[name](label=name, color="red", rotation=(0, 0, 30))
    assert isinstance(face, host.Face)
    assert face.is_valid
    assert face.label == name
    assert tuple(face.color)[:3] == (1, 0, 0)
    assert 0 <= face.deviation[0] <= face.deviation[1] <= 1e-3
    moved = Pos(1, 2, 3) * face
    point = moved.exact.evaluate(0.3, 0.6)
    assert moved.distance_to(host.Vertex(*point)) <= face.deviation[1] + 1e-6


def test_faces_wait_in_a_part_and_thicken() -> None:
    with BuildPart() as part:
        with Locations((5, 5, 5), (40, 0, 0)):
            FACES["surface"]()
        assert len(part.pending_faces) == 2
        host.thicken(amount=1)
    assert part.part.is_valid
    assert len(part.solids()) == 2


def test_line_objects_serve_as_curves_of_patches_where_they_are() -> None:
    ends = gt.GTBezier(*POINTS), Pos(0, 0, 9) * gt.GTBezier(*POINTS)
    face = gt.GTRuled(*ends)
    assert pytest.approx(9, abs=1e-6) == face.bounding_box().size.Z
    with pytest.raises(InputError, match="a must be a curve of gtcad"):
        gt.GTRuled(3, SWING)


@pytest.mark.parametrize("order", ["G1", "G2"])
def test_patches_join_faces_of_the_host(order: Any) -> None:
    box = host.Box(10, 10, 10)
    face = box.faces().sort_by(Axis.Z)[-1]
    edge = face.edges().sort_by(Axis.X)[-1]
    joined = gt.GTJoinPatch(face, edge, Curve([[12, -6, 3], [14, 0, 3], [12, 6, 3]]), order=order)
    assert joined.report.meets(order)
    for s in (0.1, 0.5, 0.9):
        assert abs(joined.normal_at(edge @ s).Z) == pytest.approx(1, abs=1e-6)


# --- parts ------------------------------------------------------------------------------------------------------------


def test_solids_in_builder_and_algebra_mode() -> None:
    single = vase(label="vase", color="red")
    with BuildPart() as part:
        with Locations((0, 0, 0), (30, 0, 0)):
            vase(rotation=(90, 0, 0), align=(Align.CENTER, Align.CENTER, Align.MIN))
        Cylinder(1, 100, rotation=(90, 0, 0), mode=Mode.SUBTRACT)
    exact = float(single.exact.volume())
    assert single.volume == pytest.approx(exact, abs=1e-3 * single.area)
    assert part.part.volume == pytest.approx(2 * single.volume - np.pi * 10, rel=1e-5)
    assert part.part.is_valid
    rest = single - Rot(0, 90, 0) * Cylinder(1, 50)
    assert rest.is_valid
    assert rest.volume < single.volume
    rounded = fillet(single.edges().sort_by(Axis.Z)[-1], 0.4)
    assert rounded.is_valid


def test_solids_of_the_other_kinds() -> None:
    wall = gt.GTSolid(Rotation(VASE, [0, 0, 0], [0, 0, 1]), thickness=-0.5)
    assert not wall.made.proved
    assert wall.is_valid
    again = gt.GTSolid(wall.exact)
    assert again.volume == pytest.approx(wall.volume, rel=1e-12)
    with pytest.raises(InputError, match="give none"):
        gt.GTSolid(wall.exact, caps="planar")
    with pytest.raises(InputError, match="free"):
        gt.GTSolid(FACES["surface"]())


@pytest.mark.parametrize("degree", ["auto", 5])
def test_turned_bodies_are_hollowed_by_the_host(degree: Any) -> None:
    side = Rotation(Curve([[20, 0, 0], [35, 0, 25], [15, 0, 50]]), [0, 0, 0], [0, 0, 1])
    solid = gt.GTSolid(side, caps="planar", degree=degree, tolerance=1e-2)
    top, bottom = (solid.named_face(f"cap {k}") for k in (2, 1))
    top, bottom = (top, bottom) if top.center().Z > bottom.center().Z else (bottom, top)
    hollow = host.offset(solid, amount=-1.5, openings=top)
    assert hollow.is_valid
    skin = 1.5 * (solid.area - top.area)  # the wall and the floor, but for what their curvature adds
    assert hollow.volume == pytest.approx(skin, rel=0.06)
    grown = host.offset(solid, amount=1)
    assert grown.is_valid
    assert grown.volume == pytest.approx(solid.volume + solid.area, rel=0.01)


def test_faces_have_names_and_places() -> None:
    solid = Pos(5, 0, 2) * vase()
    assert solid.names == ("patch 1", "cap 1", "cap 2")
    heights = sorted(solid.named_face(name).center().Z for name in ("cap 1", "cap 2"))
    assert heights == pytest.approx([2, 12], abs=1e-6)
    np.testing.assert_allclose(solid.exact.quilt.patches[0].evaluate(0.0, 0.0), [9, 0, 2], atol=1e-9)
    with pytest.raises(InputError, match="'cap 1', 'cap 2', got 'lid'"):
        solid.named_face("lid")


def test_copies_keep_what_is_known() -> None:
    solid = vase(label="vase")
    other = copy.copy(solid)
    assert other.made is solid.made
    assert other.label == "vase"


# --- errors, functions ------------------------------------------------------------------------------------------------


def test_the_wrong_builder_is_refused_as_the_host_does() -> None:
    with pytest.raises(RuntimeError, match="GTBezier"), BuildSketch():
        gt.GTBezier(*POINTS)
    with pytest.raises(RuntimeError, match="GTSolid"), BuildLine():
        vase()


def test_bad_arguments_are_value_errors() -> None:
    with pytest.raises(ValueError, match=r"gamma\[0\] must lie in \[-1, 1\], got 1.25"):
        gt.GTBezier(*POINTS, gamma=(1.25, 0))
    with pytest.raises(ValueError, match="tolerance"):
        gt.GTBezier(*POINTS, tolerance=0)
    with pytest.raises(TypeError, match="colour"):
        gt.GTBezier(*POINTS, colour="red")  # type: ignore[call-arg]


def test_signatures_are_typed() -> None:
    for name in gt.__all__:
        thing = getattr(gt, name)
        assert inspect.getdoc(thing), name
        hints = inspect.signature(thing.__init__ if isinstance(thing, type) else thing)
        if not name.endswith(("Options", "Object")):
            assert all(one.annotation is not inspect.Parameter.empty for one in [*hints.parameters.values()][1:]), name


def test_core_shapes_become_shapes_of_the_host() -> None:
    patch = Rotation(VASE, [0, 0, 0], [0, 0, 1])
    quilt = Quilt.recognised([patch])
    shapes = [
        (gt.to_edge(SWING, label="a", color="red"), host.Edge),
        (gt.to_wire(Composite((SWING, BACK), ("C0", "C0"), True)), host.Wire),
        (gt.to_face(patch), host.Face),
        (gt.to_shell(quilt), host.Shell),
        (gt.to_solid(Solid(quilt, caps="planar")), host.Solid),
    ]
    for shape, kind in shapes:
        assert type(shape) is kind
        assert shape.is_valid
        assert shape.made.deviation[1] <= 1e-3
        assert type(gt.to_shape(shape.made.exact)) is kind
    assert shapes[0][0].label == "a"
    with BuildPart() as part:
        gt.to_solid(Solid(quilt, caps="planar"))
    assert part.part is None or not part.part.solids()


def test_models_become_compounds() -> None:
    model = gtcad.load_model(Path(__file__).parents[2] / "samples" / "handle.toml")
    compound = gt.to_compound(model)
    assert [child.label for child in compound.children] == [name for name in model if name not in model.construction]
    for child in compound.children:
        assert (child.color is None) == (model.colors.get(child.label) is None)
        assert child.made.deviation[1] <= 1e-3


def test_designs_come_from_edges_and_faces() -> None:
    design = gt.from_edge(host.Edge.make_spline([(0, 0, 0), (5, 7, 1), (9, 3, 4)]))
    assert gt.to_edge(design.curve).is_valid
    cylinder = host.Solid.make_cylinder(5, 10, angle=120).faces().filter_by(GeomType.CYLINDER)[0]
    patch = gt.from_face(cylinder)
    assert gt.GTFace(patch.surface).area == pytest.approx(cylinder.area, rel=1e-9)
    rows = [[host.Vector(10 * i, 10 * j, 5 * ((i * j) % 3)) for j in range(6)] for i in range(8)]
    waves = host.Face.make_surface_from_array_of_points(rows)
    sheet = gt.to_shape(gt.from_face(waves, tolerance=1e-4).surface)
    assert isinstance(sheet, host.Shell)
    assert sheet.is_valid
    assert sheet.area == pytest.approx(waves.area, rel=1e-3)


def test_outlines_keep_lines_and_arcs() -> None:
    bow = Arc([10, 0], [0, 3], [3, 0], 0, 180)
    pieces = (SWING, *bow.pieces, Curve([[10, -3], [0, 0]], family=BERNSTEIN))
    profile = gt.GTProfile(*pieces)
    kinds = {GeomType.BSPLINE: 1, GeomType.CIRCLE: 1, GeomType.LINE: 1}
    assert {kind: len(profile.edges().filter_by(kind)) for kind in kinds} == kinds
    sides = extrude(profile, 3).faces()
    assert len(sides.filter_by(GeomType.CYLINDER)) == 1
    assert len(gt.GTComposite(*pieces, closed=True, exact=False).edges().filter_by(GeomType.BSPLINE)) == 4


def test_joins_keep_their_derivatives_unless_told_otherwise() -> None:
    edge = host.Edge.make_circle(5, start_angle=0, end_angle=100)
    bend = [gt.GTJoin(edge, (-8, 9), (-9, 20, 4), order="G2", tolerance=1e-1, **o) for o in ({}, {"end_order": 0})]
    gaps = [np.abs(one.fit.spline.derivative(0.0, 2) - one.exact.derivative(0.0, 2)).max() for one in bend]
    assert gaps[0] < 1e-9 < gaps[1]


def test_show_uses_the_viewer_when_it_is_there(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ocp_vscode", None)
    with pytest.raises(ExtraMissing, match="ocp-vscode"):
        gt.show(SWING)
    shown: list[Any] = []
    viewer = ModuleType("ocp_vscode")
    viewer.show = lambda *objects, **options: shown.extend([*objects, options])  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "ocp_vscode", viewer)
    box = host.Box(1, 1, 1)
    gt.show(SWING, box, axes=True)
    assert isinstance(shown[0], host.Edge)
    assert shown[1:] == [box, {"axes": True}]
