"""Shapes of CadQuery made of GT shapes: genuine ones, within their tolerance, at home in its operations."""

from __future__ import annotations

import importlib
import importlib.machinery
import inspect
import math
import pickle
import subprocess
import sys
import types
import typing
from pathlib import Path

import numpy as np
import pytest

from gtcad import BERNSTEIN, Composite, Curve, Model, Surface
from gtcad.conics import circle
from gtcad.errors import GtcadError, InputError, ToleranceNotMet
from gtcad.patches import Rotation
from gtcad.quilt import Quilt
from gtcad.solid import Solid

cq = pytest.importorskip("cadquery", reason="CadQuery only goes with OCCT 7.9")
gt = importlib.import_module("gtcad.converters.cadquery")

ARCH = [(0, 0), (10, 20), (30, 20), (40, 0)]
NET = [[(20 * i, 15 * j, 6 * (i == 1) * (j != 0)) for j in range(4)] for i in range(3)]
T = np.linspace(0, 1, 41)


def distance(shape, points) -> float:
    """The largest distance of points from a shape, by the kernel."""
    return max(shape.distance(cq.Vertex.makeVertex(*point)) for point in np.pad(points, ((0, 0), (0, 3)))[:, :3])


def surface_points(patch) -> np.ndarray:
    u, v = np.meshgrid(T[::4], T[::4], indexing="ij")
    return patch.evaluate(u, v).reshape(-1, 3)


def area_under(curve: Curve) -> float:
    nodes, weights = np.polynomial.legendre.leggauss(60)
    t = (nodes + 1) / 2
    points, speeds = curve.evaluate(t), curve.derivative(t)
    return float(weights @ (points[:, 1] * speeds[:, 0])) / 2


# --- functions --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("tolerance", [1e-1, 1e-3, 1e-6])
def test_edges_keep_the_tolerance_and_say_so(tolerance: float) -> None:
    edge = gt.gtCurve(ARCH, gamma=(0.3, -0.5), tolerance=tolerance)
    assert isinstance(edge, cq.Edge)
    assert edge.isValid()
    assert edge.exact == Curve(ARCH, (0.3, -0.5))
    assert edge.proved
    assert edge.deviation == edge.fit.deviation
    assert edge.deviation[1] <= tolerance
    assert distance(edge, edge.exact.evaluate(T)) <= edge.deviation[1] + 1e-7


def test_two_points_make_a_line_and_a_circle_is_one() -> None:
    assert gt.gtCurve([(0, 0), (3, 4)]).geomType() == "LINE"
    round_edge = gt.gtCurve(circle([0, 0, 0], 5))
    assert round_edge.geomType() == "CIRCLE"
    assert math.isclose(round_edge.Length(), 10 * math.pi)


def test_points_may_be_vectors_and_arrays() -> None:
    vectors = [cq.Vector(*point, 0) for point in ARCH]
    for points in (vectors, np.array(ARCH), [*vectors[:2], *ARCH[2:]]):
        assert np.array_equal(gt.gtCurve(points).exact.evaluate(T)[:, :2], Curve(ARCH).evaluate(T))


def test_chains_become_closed_wires() -> None:
    wire = gt.gtChain([ARCH, [(40, 0), (0, 0)]], closed=True)
    assert isinstance(wire, cq.Wire)
    assert wire.IsClosed()
    assert len(wire.Edges()) == 2
    assert isinstance(wire.exact, Composite)
    face = cq.Face.makeFromWires(wire)
    assert abs(face.Area() - area_under(Curve(ARCH))) <= wire.deviation[1] * wire.Length()


QUARTER = [(5, 0, 0), (5, 5, 0), (0, 5, 0)]  # of a circle
FACES = {  # the face, its area, the kernel's kind
    "gtSurface": (lambda: gt.gtSurface([[(0, 0, 0), (0, 4, 0)], [(3, 0, 0), (3, 4, 0)]]), 12, "PLANE"),
    "gtRuled": (lambda: gt.gtRuled(QUARTER, [(x, y, 4) for x, y, _ in QUARTER]), 10 * math.pi, "CYLINDER"),
    "gtSwept": (lambda: gt.gtSwept(QUARTER, [(0, 0, 0), (0, 0, 4)]), 10 * math.pi, "CYLINDER"),
    "gtSwung": (lambda: gt.gtSwung([(0, -5), (5, -5), (5, 0)], [(1, 0), (1, 1), (0, 1)]), 12.5 * math.pi, "SPHERE"),
    "gtRotation": (lambda: gt.gtRotation([(5, 0, 0), (5, 0, 4)]), 40 * math.pi, "CYLINDER"),
    "gtLofted": (lambda: gt.gtLofted([QUARTER, [(x, y, 4) for x, y, _ in QUARTER]]), 10 * math.pi, "CYLINDER"),
    "gtCoons": (lambda: gt.gtCoons([[(0, 0), (3, 0)], [(3, 4), (3, 0)], [(3, 4), (0, 4)], [(0, 0), (0, 4)]]), 12, None),
    "gtEnveloping": (
        lambda: gt.gtEnveloping([(1, 0, 0, 5), (1, 1, 0, 5), (0, 1, 0, 5)], (0, 0, 1, 0), (0, 0, 1, 4), tolerance=1e-6),
        10 * math.pi,
        None,
    ),
    "gtSpineDevelopable": (lambda: gt.gtSpineDevelopable(QUARTER, (1, 3), tolerance=1e-6), 2 * math.pi, None),
    "gtGeodesicDevelopable": (lambda: gt.gtGeodesicDevelopable(QUARTER, (-1, 3), tolerance=1e-6), 10 * math.pi, None),
    "gtPlateau": (
        lambda: gt.gtPlateau([[(0, 0), (3, 0)], [(3, 4), (3, 0)], [(3, 4), (0, 4)], [(0, 0), (0, 4)]]),
        12,
        None,
    ),
    "gtDirichlet": (
        lambda: gt.gtDirichlet([[(x, y, math.nan if x == y == 2 else 0) for y in (0, 2, 4)] for x in (0, 2, 3)]),
        12,
        None,
    ),
    "gtSweep": (lambda: gt.gtSweep([(1, 0), (1, 1), (0, 1)], QUARTER), None, None),
}


@pytest.mark.parametrize("name", FACES)
def test_faces_are_those_of_their_patches(name: str) -> None:
    make, area, kind = FACES[name]
    face = make()
    assert isinstance(face, cq.Face)
    assert face.isValid()
    assert kind is None or face.geomType() == kind
    assert area is None or math.isclose(face.Area(), area, rel_tol=1e-6)
    if face.exact.dimension == 3:
        assert distance(face, surface_points(face.exact)) <= face.deviation[1] + 1e-7


def test_edges_of_the_host_serve_as_curves() -> None:
    line, arc = cq.Edge.makeLine((0, 0, 0), (0, 0, 4)), cq.Edge.makeCircle(5, angle1=0, angle2=90)
    assert math.isclose(gt.gtSwept(arc, line).Area(), 10 * math.pi, rel_tol=1e-9)
    bezier = cq.Edge.makeBezier([cq.Vector(0, 0, 0), cq.Vector(1, 3, 0), cq.Vector(4, 0, 0)])
    assert distance(bezier, gt.gtCurve(bezier).exact.evaluate(T)) < 1e-12
    with pytest.raises(InputError, match="from_edge makes a GT curve"):
        gt.gtCurve(cq.Edge.makeSpline([cq.Vector(*point) for point in [*ARCH, (50, 5)]]))


def test_solids_of_patches_faces_and_quilts_are_one() -> None:
    tube = Rotation(Curve([[5, 0, 0], [5, 0, 4]], family=BERNSTEIN), [0, 0, 0], [0, 0, 1])
    meant = [gt.gtRotation([(5, 0, 0), (5, 0, 4)]), [tube], Quilt.recognised([tube]), gt.gtShell([tube])]
    for patches in meant:
        solid = gt.gtSolid(patches, caps="planar")
        assert isinstance(solid, cq.Solid)
        assert solid.isValid()
        assert abs(solid.Volume() - 100 * math.pi) <= solid.deviation[1] * solid.Area() + 1e-3
    assert isinstance(gt.gtShell([tube]), cq.Shell)
    wall = gt.gtSolid([tube], thickness=0.5)  # this profile has its normals inwards
    assert not wall.proved
    assert math.isclose(float(wall.made.body.exact_volume), 4 * math.pi * (25 - 4.5**2), rel_tol=1e-9)


def test_every_core_shape_has_its_host_shape() -> None:
    sheet = Surface(NET)
    cases = {
        gt.GtEdge: Curve(ARCH),
        gt.GtWire: Composite((Curve(ARCH), Curve([(40, 0), (0, 0)], family=BERNSTEIN)), ("C0", "C0"), True),
        gt.GtFace: sheet,
        gt.GtShell: Quilt.recognised([sheet]),
        gt.GtSolid: Solid(Quilt.recognised([sheet]), thickness=0.5),
    }
    for kind, shape in cases.items():
        made = gt.gtShape(shape)
        assert type(made) is kind
        assert made.exact == shape


# --- what a shape carries ---------------------------------------------------------------------------------------------


def test_fit_and_exact_shape_go_along_with_moves_and_copies() -> None:
    face, place = gt.gtSurface(NET), cq.Location((5, 6, 7), (1, 2, 3), 40)
    for other in (face.moved(place), face.located(place), face.copy().moved(place), face.copy().move(place)):
        assert type(other) is gt.GtFace
        assert other.fit is face.fit
        assert distance(other, surface_points(other.exact)) <= other.deviation[1] + 1e-7
    assert np.array_equal(face.exact.control_points, Surface(NET).control_points)
    lifted = gt.gtCurve(ARCH).moved(place)
    assert distance(lifted, lifted.exact.evaluate(T)) <= lifted.deviation[1] + 1e-7


def test_what_operations_make_carries_nothing_and_says_so() -> None:
    solid = gt.gtSolid(gt.gtRotation([(5, 0, 0), (5, 0, 4)]), caps="planar")
    for other in (solid.rotate((0, 0, 0), (0, 0, 1), 30), solid.fillet(0.5, solid.faces(">Z").Edges())):
        with pytest.raises(InputError, match="came out of an operation"):
            _ = other.fit
    assert pickle.loads(pickle.dumps(solid)).isValid()


def test_errors_are_those_of_the_host_with_detail() -> None:
    with pytest.raises(ValueError, match=r"gamma\[0\] must lie in \[-1, 1\], got 1.5"):
        gt.gtCurve(ARCH, gamma=(1.5, 0))
    with pytest.raises(ValueError, match="profile must be points of numbers"):
        gt.gtRotation("round")
    with pytest.raises(ValueError, match=r"net must be rows of as many points each, got rows of \[4, 3\]"):
        gt.gtSurface([NET[0], NET[1][:3]])
    with pytest.raises(ValueError, match="includeCurrent=True needs control points"):
        cq.Workplane().gtCurve(Curve(ARCH), includeCurrent=True)
    with pytest.raises(ValueError, match=r"patches\[0\] must be a patch of gtcad"):
        gt.gtSolid([cq.Face.makePlane(1, 1)])
    with pytest.raises(ArithmeticError) as caught:
        gt.gtCurve(ARCH, gamma=(0.3, 0.1), tolerance=1e-9, degree=3, max_spans=2)
    assert isinstance(caught.value, ToleranceNotMet)
    assert isinstance(caught.value, GtcadError)


# --- from shapes of the host ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("tolerance", [1e-2, 1e-4])
def test_gt_curves_are_fitted_to_edges(tolerance: float) -> None:
    edge = cq.Edge.makeSpline([cq.Vector(0, 0, 0), cq.Vector(5, 8, 1), cq.Vector(12, 3, 4), cq.Vector(20, 6, 0)])
    made = gt.from_edge(edge, tolerance=tolerance)
    assert made.design.deviation[1] + made.deviation[1] <= tolerance
    assert max(made.distance(cq.Vertex.makeVertex(*edge.positionAt(t).toTuple())) for t in T) <= tolerance
    pieces = made.exact.pieces if isinstance(made.exact, Composite) else [made.exact]
    for piece in pieces:
        assert distance(edge, piece.evaluate(T)) <= made.design.deviation[1] + 1e-7


def test_gt_patches_are_fitted_to_faces() -> None:
    face = cq.Workplane().cylinder(10, 4).faces("%CYLINDER").val()
    patch = gt.from_face(gt.gtSurface(NET, gammaU=(0.4, 0.1)), tolerance=1e-3)
    assert isinstance(patch.exact, Surface)
    assert patch.design.deviation[1] + patch.deviation[1] <= 1e-3
    assert distance(gt.gtSurface(NET, gammaU=(0.4, 0.1), tolerance=1e-5), surface_points(patch.exact)) <= 1e-3
    whole = gt.from_face(face, tolerance=1e-9)
    assert type(whole) is gt.GtFace
    assert whole.geomType() == "CYLINDER"
    round_edge = gt.from_edge(cq.Edge.makeCircle(5))
    assert type(round_edge) is gt.GtEdge
    assert round_edge.geomType() == "CIRCLE"
    rows = [[cq.Vector(10 * i, 10 * j, (i * j) % 3) for j in range(5)] for i in range(6)]
    waves = gt.from_face(cq.Face.makeSplineApprox(rows), tolerance=1e-2)
    assert type(waves) is gt.GtShell
    assert waves.isValid()
    assert waves.design.deviation[1] + waves.deviation[1] <= 1e-2


def test_curves_and_patches_go_on_from_the_host() -> None:
    edge = cq.Edge.makeThreePointArc((0, 0, 0), (5, 2, 0), (10, 0, 0))
    curve = gt.gtCurveOn(edge, [(20, 5, 3), (25, 5, 5)], order="G2")
    assert np.allclose(curve.startPoint().toTuple(), edge.endPoint().toTuple(), rtol=0, atol=1e-9)
    assert edge.tangentAt(1).getAngle(curve.tangentAt(0)) < 1e-9
    assert math.isclose(curve.curvatures([0])[0], edge.curvatures([0])[0], rel_tol=1e-9)
    face = cq.Face.makeRuledSurface(cq.Edge.makeLine((0, 0, 0), (0, 10, 0)), cq.Edge.makeLine((10, 0, 0), (10, 10, 0)))
    side = next(edge for edge in face.Edges() if np.allclose(edge.Center().toTuple(), (10, 5, 0)))
    patch = gt.gtSurfaceOn(face, side, [(18, 0, 4), (18, 5, 6), (18, 10, 4)], order="G1")
    for y in (1, 5, 9):
        assert abs(abs(patch.normalAt(cq.Vector(10, y, 0)).z) - 1) < 1e-9
    assert distance(patch, np.array([[10, y, 0] for y in (0, 5, 10)])) < 1e-3


# --- methods of Workplane ---------------------------------------------------------------------------------------------

METHODS = sorted(name for name in vars(gt.Workplane) if name.startswith("gt"))


def test_methods_draw_like_those_of_the_host() -> None:
    drawn = cq.Workplane("XZ", origin=(1, 2, 3)).gtCurve(ARCH, gamma=(0.2, 0.2)).close().extrude(5)
    volume = 5 * area_under(Curve(ARCH, (0.2, 0.2)))
    assert abs(drawn.val().Volume() - volume) <= 1e-3 * drawn.val().Area()
    box = drawn.val().BoundingBox()
    assert np.allclose([box.xmin, box.xmax, box.ymax, box.zmin], [1, 41, 2, 3], rtol=0, atol=1e-6)
    fillet = drawn.edges("|Y").fillet(1.0)
    assert fillet.val().isValid()
    assert fillet.val().Volume() < volume
    going_on = cq.Workplane().lineTo(10, 0).gtCurve(ARCH[1:], includeCurrent=True)
    assert np.array_equal(going_on.val().exact.control_points[0], [10, 0, 0])
    assert len(going_on.ctx.pendingEdges) == 2
    assert not cq.Workplane().gtCurve(ARCH, forConstruction=True).ctx.pendingEdges
    wire = cq.Workplane("YZ").gtCurve(ARCH, makeWire=True)
    assert isinstance(wire.val(), gt.GtWire)
    assert wire.val().deviation[1] <= 1e-3


def test_closed_chains_are_put_at_each_point_and_open_ones_drawn() -> None:
    lens = [[(-3, 0), (0, 4), (3, 0)], [(3, 0), (-3, 0)]]
    area = area_under(Curve(lens[0]))
    plate = cq.Workplane().rect(40, 20).extrude(2)
    cut = plate.faces(">Z").workplane().pushPoints([(-10, 0), (10, 0)]).gtChain(lens, closed=True).cutThruAll()
    assert abs(cut.val().Volume() - (1600 - 4 * area)) < 2e-3 * cut.val().Area()
    drawn = cq.Workplane().gtChain([[(0, 0), (5, 8), (10, 0)], [(10, 0), (10, -5)]]).lineTo(0, -5).close().extrude(1)
    assert math.isclose(drawn.val().Volume(), area_under(Curve([(0, 0), (5, 8), (10, 0)])) + 50, rel_tol=1e-4)


def test_faces_are_put_on_planes_with_their_fit() -> None:
    faces = cq.Workplane("YZ").pushPoints([(0, 0), (100, 0)]).gtSurface(NET).vals()
    assert [type(face) for face in faces] == [gt.GtFace] * 2
    for face, y in zip(faces, (0, 100), strict=True):
        assert np.allclose(face.exact.evaluate(0.0, 0.0), [0, y, 0], rtol=0, atol=1e-12)
        assert face.deviation[1] <= 1e-3


def test_solids_combine_like_boxes() -> None:
    tube = gt.gtRotation([(5, 0, 0), (5, 0, 4)])
    area = 40 * math.pi  # of the GT face
    alone = cq.Workplane().gtSolid(tube, caps="planar")
    assert type(alone.val()) is gt.GtSolid
    block = cq.Workplane().box(20, 20, 4, centered=(True, True, False))
    cut = block.faces("<Z").workplane(invert=True).gtSolid(tube, caps="planar", combine="cut")
    assert abs(cut.val().Volume() - (1600 - 100 * math.pi)) <= 1e-3 * area
    fused = block.faces(">Z").workplane().gtSolid(tube, caps="planar")
    assert abs(fused.val().Volume() - (1600 + 100 * math.pi)) <= 1e-3 * area
    apart = block.faces(">Z").workplane().gtSolid(tube, caps="planar", combine=False)
    assert abs(apart.val().Volume() - (100 * math.pi)) <= 1e-3 * area


def test_turned_bodies_are_hollowed_by_the_host() -> None:
    body = cq.Workplane().gtSolid(gt.gtRotation([(20, 0, 0), (35, 0, 25), (15, 0, 50)]), caps="planar")
    hollow = body.faces(">Z").shell(-1.5)
    assert hollow.val().isValid()
    skin = 1.5 * (body.val().Area() - body.faces(">Z").val().Area())
    assert math.isclose(hollow.val().Volume(), skin, rel_tol=0.06)


def test_methods_are_registered_once_with_their_signatures() -> None:
    assert {"gtCurve", "gtSurface", "gtSwung", "gtSolid"} <= set(METHODS)
    for name in METHODS:
        method = getattr(cq.Workplane, name)
        assert method is getattr(gt.Workplane, name)
        assert next(iter(inspect.signature(method).parameters)) == "self"
        assert method.__doc__
    before = {name: getattr(cq.Workplane, name) for name in METHODS}
    gt.register()
    assert {name: getattr(cq.Workplane, name) for name in METHODS} == before


def test_importing_and_reloading_changes_nothing() -> None:
    code = (
        "import importlib, cadquery as cq, gtcad.converters.cadquery as gt\n"
        "def names(): return {n for n in dir(cq.Workplane) if n.startswith('gt')}\n"
        "before = names()\n"
        "import gtcad.converters.cadquery\n"
        "importlib.reload(gt)\n"
        "assert before == names() and before\n"
        "drawn = cq.Workplane().gtCurve([(0, 0), (1, 2), (2, 0)]).close().extrude(1)\n"
        "assert drawn.val().isValid()\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_functions_tell_editors_what_they_take_and_return() -> None:
    for name in gt.__all__:
        thing = getattr(gt, name)
        if inspect.isfunction(thing):
            assert "return" in typing.get_type_hints(thing), name
            assert len(typing.get_type_hints(thing)) == len(inspect.signature(thing).parameters) + 1, name
    for name in METHODS:
        assert "return" in getattr(gt.Workplane, name).__annotations__, name


# --- assemblies, files, viewers ---------------------------------------------------------------------------------------


def test_assemblies_keep_names_and_colours_through_step(tmp_path: Path) -> None:
    meridian = Curve([[0, 0, -3], [7, 0, -3], [7, 0, 3], [0, 0, 3]])
    ball = Solid(Quilt.recognised([Rotation(meridian, [0, 0, 0], [0, 0, 1])]))
    model = Model({"rail": Curve([[0, 0, 0], [1, 2, 0], [3, 0, 0]]), "ball": ball}, "cm", {"ball": "#ff8000"})
    assembly = gt.gtAssembly(model)
    assert [(part.name, type(part.obj)) for part in assembly.children] == [("rail", gt.GtEdge), ("ball", gt.GtSolid)]
    path = tmp_path / "two.step"
    assembly.export(str(path))
    read = {part.name: part for part in cq.Assembly.importStep(str(path)).children}
    assert list(read) == ["rail", "ball"]
    assert np.allclose(read["ball"].color.toTuple(), (1, 128 / 255, 0, 1), rtol=0, atol=1e-6)
    assert math.isclose(read["ball"].shapes[0].Volume(), assembly.children[1].obj.Volume(), rel_tol=1e-6)


def test_viewers_find_what_they_show() -> None:
    for shape in (gt.gtCurve(ARCH), gt.gtSurface(NET), gt.gtSolid([gt.gtSurface(NET)], thickness=1)):
        assert shape.toVtkPolyData(0.1, 0.3).GetNumberOfCells() > 0
        assert type(shape.wrapped).__name__.startswith("TopoDS_")
        assert cq.Shape.cast(shape.wrapped).isValid()


@pytest.mark.parametrize("installed", [True, False])
def test_show_takes_the_viewer_that_is_there(installed: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    shown = []
    viewer = types.ModuleType("viewer")
    viewer.show = lambda *shapes, **options: shown.append((shapes, options))  # type: ignore[attr-defined]
    viewer.__spec__ = importlib.machinery.ModuleSpec("ocp_vscode", None)
    monkeypatch.setitem(sys.modules, "ocp_vscode", viewer if installed else None)
    if not installed:
        monkeypatch.setattr("cadquery.vis.show", viewer.show)
    face = gt.gtSurface(NET)
    gt.show(face, Curve(ARCH), alpha=0.5)
    [(shapes, options)] = shown
    assert shapes[0] is face
    assert isinstance(shapes[1], gt.GtEdge)
    assert options == {"alpha": 0.5}


def test_without_the_host_the_error_says_what_to_install() -> None:
    code = "import sys; sys.modules['cadquery'] = None; import gtcad.converters.cadquery"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert "ExtraMissing: CadQuery is needed here: pip install 'gtcad[cadquery]'" in result.stderr
