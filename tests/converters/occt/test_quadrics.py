from __future__ import annotations

import math
import re
from datetime import datetime

import numpy as np
import pytest

from gtcad import Restricted
from gtcad.converters.analytic import certify_quadric, quadric_of
from gtcad.converters.occt.compat import as_edge, as_face, kernel_module
from gtcad.converters.occt.document import Item
from gtcad.converters.occt.exchange import brep_bytes, brep_items, iges_bytes, iges_items, step_bytes, step_items
from gtcad.converters.occt.faces import area
from gtcad.converters.occt.pieces import is_valid, subshapes
from gtcad.converters.occt.quadrics import make_quadric_face, quadric_of_face
from gtcad.converters.occt.topology import make_face
from gtcad.converters.quadrics import ENTITIES, Quadric, surface_of_quadric
from gtcad.errors import InputError
from tests.converters.occt import shapes
from tests.converters.test_quadrics import CASES, PARTS, TURN, motion, normal

BRep = kernel_module("BRep")
BRepAdaptor = kernel_module("BRepAdaptor")
BRepBuilderAPI = kernel_module("BRepBuilderAPI")
Geom = kernel_module("Geom")
gp = kernel_module("gp")
ShapeAnalysis = kernel_module("ShapeAnalysis")
TopAbs = kernel_module("TopAbs")
TopLoc = kernel_module("TopLoc")

NOW = datetime(2024, 5, 31, 12)
IGES = {"plane": 190, "disc": 190, "cylinder": 192, "cone": 194, "sphere": 196, "torus": 198}
FORMATS = ("STEP", "IGES", "BREP")
FRAME = ([1, 2, 3], [1, 1, 1], [1, -1, 0])


def placed(name, part=None, scale=10.0):
    patch = CASES[name][0] if part is None else Restricted(CASES[name][0], part)
    matrix, offset = motion(2)
    return patch.transformed(scale * matrix, scale * offset)


def is_reversed(face):
    return face.Orientation() == TopAbs.TopAbs_REVERSED


def counts(face):
    """Edges, seams, degenerate edges and vertices."""
    edges = [as_edge(edge) for edge in subshapes(face, "EDGE")]
    seams = sum(BRep.BRep_Tool.IsClosed_s(edge, face) for edge in edges)
    points = sum(BRep.BRep_Tool.Degenerated_s(edge) for edge in edges)
    return len(edges), seams, points, len(subshapes(face, "VERTEX"))


def written(form, face, tmp_path):
    """The file, and the one face that it holds."""
    items = [Item(face, "part", (1.0, 0.5, 0.0))]
    if form == "STEP":
        data = step_bytes(items, schema="AP242", tolerance=1e-7, timestamp=NOW)
        back = step_items(data)
    elif form == "IGES":
        data = iges_bytes(items, tolerance=1e-7, timestamp=NOW)
        (tmp_path / "part.igs").write_bytes(data)
        back = iges_items(str(tmp_path / "part.igs"))
    else:
        data = brep_bytes(items)
        back = brep_items(data)
    assert len(back) == 1
    if form != "BREP":
        assert (back[0].name, back[0].color) == ("part", (1.0, 0.5, 0.0))
    return data, back[0].shape


@pytest.mark.parametrize("part", PARTS, ids=str)
@pytest.mark.parametrize("name", CASES)
def test_faces_are_valid_and_read_back(name, part):
    patch = placed(name, part)
    q = quadric_of(patch)
    face = make_quadric_face(q)
    assert is_valid(face)
    assert area(face) == pytest.approx(_area(q), rel=1e-9)
    found = quadric_of_face(face)
    assert found.kind == q.kind
    assert certify_quadric(patch, found).upper < 1e-9
    assert is_reversed(face) == (q.reversed != found.reversed)


def _area(q):
    """In closed form."""
    turn = abs(q.u_range[1] - q.u_range[0])
    v0, v1 = sorted(q.v_range)
    if q.kind == "torus":
        return turn * q.second * (q.radius * (v1 - v0) + q.second * (math.sin(v1) - math.sin(v0)))
    if q.kind == "sphere":
        return turn * q.radius**2 * (math.sin(v1) - math.sin(v0))
    if q.kind == "plane":
        return turn * (v1 - v0)
    return turn * (v1 - v0) * float(q.meridian((v0 + v1) / 2)[0])


@pytest.mark.parametrize("part", PARTS[:3], ids=str)
@pytest.mark.parametrize("name", CASES)
def test_the_face_has_the_normal_of_the_patch(name, part):
    patch = placed(name, part)
    q = quadric_of(patch)
    face = make_quadric_face(q)
    surface, middle = BRep.BRep_Tool.Surface_s(as_face(face)), patch.evaluate(0.5, 0.5)
    place = ShapeAnalysis.ShapeAnalysis_Surface(surface).ValueOfUV(gp.gp_Pnt(*middle.tolist()), 1e-7)
    point, along_u, along_v = gp.gp_Pnt(), gp.gp_Vec(), gp.gp_Vec()
    surface.D1(place.X(), place.Y(), point, along_u, along_v)
    outwards = np.array(along_u.Crossed(along_v).XYZ().Coord()) * (-1 if is_reversed(face) else 1)
    assert np.linalg.norm(np.array(point.XYZ().Coord()) - middle) < 1e-9
    assert outwards @ normal(patch) > 0


@pytest.mark.parametrize("form", FORMATS)
@pytest.mark.parametrize("name", CASES)
def test_files_hold_analytic_entities(name, form, tmp_path):
    patch = placed(name)
    q = quadric_of(patch)
    face = make_quadric_face(q)
    data, back = written(form, face, tmp_path)
    if form == "STEP":
        assert re.findall(rb"= (\w*(?:SURFACE|PLANE|SPLINE\w*))\(", data) == [ENTITIES[q.kind].encode()]
    if form == "IGES":
        kinds = {int(line[:8]) for line in data.splitlines() if line[72:73] == b"D" and line[:8].strip().isdigit()}
        assert IGES[q.kind] in kinds
        assert not kinds & {114, 118, 120, 122, 126, 128, 140, 144}
    assert is_valid(back)
    found = quadric_of_face(back)
    assert found.kind == q.kind
    size = np.abs(patch.evaluate([[0.0], [0.5], [1.0]], [[0.0, 0.5, 1.0]])).max()
    assert certify_quadric(patch, found).upper < 1e-9 * size
    assert is_reversed(back) == is_reversed(face)
    assert area(back) == pytest.approx(area(face), rel=1e-9)


@pytest.mark.parametrize(
    ("kind", "sizes", "u_range", "v_range", "wanted"),
    [
        ("cylinder", (2, 0), (0.0, TURN), (0, 3), (3, 1, 0, 2)),
        ("cylinder", (2, 0), (0.5, 0.5 - TURN), (0, 3), (3, 1, 0, 2)),
        ("cylinder", (2, 0), (-1.0, 1.0), (3, -1), (4, 0, 0, 4)),
        ("cone", (0, 0.5), (1.0, 1.0 + TURN), (0, 3), (3, 1, 1, 2)),
        ("cone", (1, 0.5), (1.0, 1.0 + TURN), (0, 3), (3, 1, 0, 2)),
        ("cone", (1, 0.5), (1.0, 2.0), (-1 / math.sin(0.5), 3), (4, 0, 1, 3)),
        ("sphere", (2, 0), (1.0, 1.0 + TURN), (-math.pi / 2, math.pi / 2), (3, 1, 2, 2)),
        ("sphere", (2, 0), (1.0, 1.0 + TURN), (0, math.pi / 2), (3, 1, 1, 2)),
        ("sphere", (2, 0), (1.0, 2.0), (-math.pi / 2, math.pi / 2), (4, 0, 2, 2)),
        ("sphere", (2, 0), (1.0, 2.0), (-0.5, 0.5), (4, 0, 0, 4)),
        ("torus", (5, 2), (1.0, 1.0 + TURN), (2.0, 2.0 - TURN), (2, 2, 0, 1)),
        ("torus", (5, 2), (1.0, 1.0 + TURN), (2.0, 3.0), (3, 1, 0, 2)),
        ("torus", (5, 2), (1.0, 2.0), (-1.0, -1.0 + TURN), (3, 1, 0, 2)),
        ("plane", (0, 0), (1.0, 2.0), (2, 5), (4, 0, 0, 4)),
        ("disc", (0, 0), (1.0, 1.0 + TURN), (0, 3), (1, 0, 0, 1)),
        ("disc", (0, 0), (1.0, 1.0 + TURN), (3, 2), (2, 0, 0, 2)),
        ("disc", (0, 0), (1.0, 5.0), (0, 3), (3, 0, 0, 3)),
        ("disc", (0, 0), (1.0, 5.0), (2, 3), (4, 0, 0, 4)),
    ],
)
def test_seams_and_points(kind, sizes, u_range, v_range, wanted):
    q = Quadric(kind, *FRAME, *sizes, u_range, v_range)
    face = as_face(make_quadric_face(q))
    assert counts(face) == wanted
    assert is_reversed(face) == q.reversed
    assert area(face) == pytest.approx(_area(q), rel=1e-9)
    assert certify_quadric(surface_of_quadric(q), quadric_of_face(face)).upper < 1e-11


@pytest.mark.parametrize(
    ("kind", "sizes", "u_range", "v_range"),
    [
        ("cylinder", (2, 0), (0.0, 1.0), (0, 1e-8)),
        ("cylinder", (2, 0), (0.0, 1e-8), (0, 1)),
        ("cylinder", (2, 0), (0.0, TURN - 1e-8), (0, 1)),
        ("cone", (1e-8, 0.5), (0.0, 1.0), (0, 1)),
        ("sphere", (2, 0), (0.0, 1.0), (0, math.pi / 2 - 1e-8)),
        ("torus", (2, 1), (0.0, 1.0), (0, TURN - 3e-8)),
        ("plane", (0, 0), (0.0, 1e-8), (0, 1)),
        ("disc", (0, 0), (0.0, 1.0), (1e-8, 1)),
    ],
)
def test_sides_that_nearly_vanish_or_meet_are_refused(kind, sizes, u_range, v_range):
    with pytest.raises(InputError, match=f"the sides of a {kind} must be longer than the tolerance"):
        make_quadric_face(Quadric(kind, *FRAME, *sizes, u_range, v_range))


# Faces of other makers


def rectangle(surface, *bounds):
    return BRepBuilderAPI.BRepBuilderAPI_MakeFace(surface, *(float(bound) for bound in bounds), 1e-7).Face()


def left_handed():
    axes = gp.gp_Ax3(gp.gp_Pnt(1, 2, 3), gp.gp_Dir(1, 1, 1), gp.gp_Dir(1, -1, 0))
    axes.YReverse()
    assert not axes.Direct()
    return axes


SURFACES = {
    "cylinder": lambda axes: (Geom.Geom_CylindricalSurface(axes, 2.0), (0.5, 2.0, -1.0, 3.0)),
    "cone": lambda axes: (Geom.Geom_ConicalSurface(axes, 0.5, 2.0), (0.5, 2.0, 1.0, 3.0)),
    "narrowing cone": lambda axes: (Geom.Geom_ConicalSurface(axes, -0.5, 2.0), (0.5, 2.0, 1.0, 3.0)),
    "sphere": lambda axes: (Geom.Geom_SphericalSurface(axes, 2.0), (0.5, 2.0, -0.5, 1.0)),
    "torus": lambda axes: (Geom.Geom_ToroidalSurface(axes, 5.0, 2.0), (0.5, 2.0, 1.0, 3.0)),
    "plane": lambda axes: (Geom.Geom_Plane(axes), (0.5, 2.0, 1.0, 3.0)),
}


@pytest.mark.parametrize("axes", [lambda: gp.gp_Ax3(gp.gp_Pnt(1, 2, 3), gp.gp_Dir(1, 1, 1)), left_handed])
@pytest.mark.parametrize("name", SURFACES)
def test_faces_of_any_frame_are_read(name, axes):
    """In a left-handed frame or a place of its own, as the trimmed part of another surface, either way round."""
    surface, bounds = SURFACES[name](axes())
    trimmed = Geom.Geom_RectangularTrimmedSurface(surface, *bounds)
    move = gp.gp_Trsf()
    move.SetRotation(gp.gp_Ax1(gp.gp_Pnt(3, 2, 1), gp.gp_Dir(1, 2, 0)), 1.0)
    for face in (rectangle(surface, *bounds), rectangle(trimmed, *bounds)):
        for way in (face, face.Reversed(), face.Moved(TopLoc.TopLoc_Location(move))):
            q = quadric_of_face(way)
            own = BRepAdaptor.BRepAdaptor_Surface(as_face(way))
            corners = [[own.Value(u, v).Coord() for v in bounds[2:]] for u in bounds[:2]]
            held = q.evaluate(np.array(q.u_range)[:, None], np.array(q.v_range)[None, :])
            if name == "plane":  # from any of its corners
                distances = np.linalg.norm(held.reshape(4, 1, 3) - np.reshape(corners, (1, 4, 3)), axis=-1)
                assert distances.min(axis=0).max() < 1e-13
            else:
                assert np.abs(held - corners).max() < 1e-13
            along_u, along_v = own.DN(1.0, 2.0, 1, 0), own.DN(1.0, 2.0, 0, 1)
            place = surface_of_quadric(q)
            if name != "plane":
                u, v = ((x - ends[0]) / (ends[1] - ends[0]) for x, ends in ((1.0, bounds[:2]), (2.0, bounds[2:])))
                v = min(v, 1.0)
                along = np.cross(place.derivative(u, v, (1, 0)), place.derivative(u, v, (0, 1)))
                own_v = bounds[2] + v * (bounds[3] - bounds[2])
                along_u, along_v = own.DN(1.0, own_v, 1, 0), own.DN(1.0, own_v, 0, 1)
            else:
                along = normal(place)
            assert np.array(along_u.Crossed(along_v).Coord()) @ along > 0


def test_rectangles_and_discs_at_an_angle_to_their_plane_are_read():
    axes = gp.gp_Ax3(gp.gp_Pnt(1, 2, 3), gp.gp_Dir(0, 0, 1), gp.gp_Dir(0.6, 0.8, 0))
    points = [gp.gp_Pnt(*p) for p in ((0, 0, 3), (4, 0, 3), (4, 2, 3), (0, 2, 3))]
    maker = BRepBuilderAPI.BRepBuilderAPI_MakePolygon(*points, True)
    q = quadric_of_face(BRepBuilderAPI.BRepBuilderAPI_MakeFace(Geom.Geom_Plane(axes), maker.Wire(), True).Face())
    assert (q.kind, _area(q), q.axis.tolist()) == ("plane", 8.0, [0, 0, 1])


def test_other_faces_are_none():
    cylinder, sphere = (SURFACES[name](left_handed())[0] for name in ("cylinder", "sphere"))
    cut = BRepBuilderAPI.BRepBuilderAPI_MakeFace(cylinder, *(0.0, 2.0, 0.0, 2.0), 1e-7)
    circle = gp.gp_Circ(gp.gp_Ax2(gp.gp_Pnt(0, 0, 0), gp.gp_Dir(0, 0, 1)), 5.0)
    edge = BRepBuilderAPI.BRepBuilderAPI_MakeEdge
    plane = Geom.Geom_Plane(gp.gp_Ax3())
    corners = [(0, 0, 0), (4, 0, 0), (4, 2, 0), (1, 2, 0)]
    polygon = BRepBuilderAPI.BRepBuilderAPI_MakePolygon(*(gp.gp_Pnt(*p) for p in corners), True)
    chord = BRepBuilderAPI.BRepBuilderAPI_MakeWire(
        edge(circle, 0.0, math.pi / 2).Edge(), edge(gp.gp_Pnt(0, 5, 0), gp.gp_Pnt(5, 0, 0)).Edge()
    )
    torus = Geom.Geom_ToroidalSurface(gp.gp_Ax3(), 1.0, 2.0)
    faces = {
        "spline": make_face(shapes.octant()),
        "trapezium": BRepBuilderAPI.BRepBuilderAPI_MakeFace(plane, polygon.Wire(), True).Face(),
        "segment": BRepBuilderAPI.BRepBuilderAPI_MakeFace(plane, chord.Wire(), True).Face(),
        "spindle torus": rectangle(torus, 0, 1, 0, 1),
        "cut": _with_hole(cut.Face(), cylinder, (0.5, 1.0, 0.5, 1.0)),
        "sphere with a hole": _with_hole(rectangle(sphere, 0, 2, 0, 1), sphere, (0.5, 1.0, 0.3, 0.6)),
        "eccentric ring": _eccentric(plane),
    }
    assert [name for name, face in faces.items() if quadric_of_face(face) is not None] == []


def _with_hole(face, surface, bounds):
    hole = subshapes(rectangle(surface, *bounds), "WIRE")[0]
    maker = BRepBuilderAPI.BRepBuilderAPI_MakeFace(face)
    wire = kernel_module("TopoDS").TopoDS.Wire(hole)
    wire.Reverse()
    maker.Add(wire)
    return maker.Face()


def _eccentric(plane):
    def ring(x, radius):
        circle = gp.gp_Circ(gp.gp_Ax2(gp.gp_Pnt(x, 0, 0), gp.gp_Dir(0, 0, 1)), radius)
        return BRepBuilderAPI.BRepBuilderAPI_MakeWire(BRepBuilderAPI.BRepBuilderAPI_MakeEdge(circle).Edge()).Wire()

    maker = BRepBuilderAPI.BRepBuilderAPI_MakeFace(plane, ring(0, 5.0), True)
    inner = ring(1, 2.0)
    inner.Reverse()
    maker.Add(inner)
    return maker.Face()
