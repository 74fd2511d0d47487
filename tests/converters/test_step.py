from __future__ import annotations

import getpass
import hashlib
import math
import os
import re
import socket
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from steputils import p21

import gtcad
from gtcad import measure
from gtcad.converters.bspline import BSplineCurve, BSplineSurface
from gtcad.converters.occt import session
from gtcad.converters.occt.compat import kernel_module
from gtcad.converters.occt.geometry import to_geom_surface
from gtcad.converters.occt.topology import make_edge, make_face
from gtcad.converters.part import EllipseArc, Part
from gtcad.converters.quadrics import surface_of_quadric
from gtcad.converters.readiness import readiness_of_file
from gtcad.converters.step import read_step, write_step
from gtcad.errors import FileError, InputError, KernelError
from tests.converters.occt import shapes

ROOT = Path(__file__).parents[2]
STAMP = datetime(2024, 2, 29, 12, 34, 56)
SCHEMAS = ("AP242", "AP214", "AP203")
Static = kernel_module("Interface").Interface_Static
STEPControl = kernel_module("STEPControl")
gp = kernel_module("gp")


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """The file of all parts in each schema."""
    folder = tmp_path_factory.mktemp("step")
    for schema in SCHEMAS:
        write_step(folder / f"{schema}.step", shapes.all_parts(), schema=schema, tolerance=2e-5, timestamp=STAMP)
    return {schema: folder / f"{schema}.step" for schema in SCHEMAS}


def write_foreign(path, shape, unit="MM"):
    """A file as other programs write it, through the kernel's plain writer, with some 13 digits."""
    STEPControl.STEPControl_Controller.Init_s()
    with session.statics({"write.step.unit": unit, "write.step.schema": "AP214IS"}), session.quiet():
        writer = STEPControl.STEPControl_Writer()
        writer.Transfer(shape, STEPControl.STEPControl_AsIs)
        writer.Write(str(path))
    return path


# --- what comes back ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("schema", SCHEMAS)
def test_everything_comes_back(written, schema):
    parts, found = shapes.all_parts(), read_step(written[schema])
    assert [part.name for part in found] == [part.name for part in parts]
    for part, back in zip(parts, found, strict=True):
        assert shapes.same(part, back), part.name
        assert back.valid
        assert not back.trimmed
        assert not back.reversed
        if part.color is None:
            assert back.color is None
        else:
            assert back.color == tuple(round(value, 6) for value in part.color)
    kinds = {"BSplineCurve": "B_SPLINE_CURVE", "BSplineSurface": "B_SPLINE_SURFACE"}
    expected = [kinds.get(type(part.geometry).__name__) for part in parts]
    assert [part.source for part in found if part.source not in ("CIRCLE", "ELLIPSE")] == [k for k in expected if k]


def test_reading_keeps_circles_and_ellipses_apart(written):
    found = {part.name: part.source for part in read_step(written["AP242"])}
    assert found["arc"] == found["full circle"] == "CIRCLE"
    assert found["ellipse"] == found["upright ellipse"] == "ELLIPSE"


@pytest.mark.parametrize("seed", range(3))
def test_random_splines_come_back_bit_for_bit(tmp_path, seed):
    rng = np.random.default_rng(seed)
    parts = []
    for i in range(8):
        p, q = rng.integers(1, 8, 2).tolist()
        parts.append(Part(f"c{i}", shapes.curve(seed + 10 * i, p, bool(i % 2))))
        parts.append(Part(f"s{i}", shapes.patch(seed + 10 * i, (p, q), bool(i % 2))))
        parts.append(Part(f"o{i}", shapes.closed_curve(seed + 10 * i, bool(i % 2))))
    write_step(tmp_path / "a.step", parts)
    for part, back in zip(parts, read_step(tmp_path / "a.step"), strict=True):
        assert part.name == back.name
        assert shapes.same(part, back)


def test_extreme_coordinates_come_back_bit_for_bit(tmp_path):
    points = [[1e-300, 5e-324, 0.1 + 0.2], [12345678.9, -1 / 3, 1e7], [1e5, 2**-40, math.pi]]
    part = Part("extreme", BSplineCurve(points, [-7 / 3, 1e3 / 7], [3, 3], 2, [1e-3, 1 / 3, 777.7]))
    write_step(tmp_path / "a.step", [part])
    assert shapes.same(part, read_step(tmp_path / "a.step")[0])


def test_a_closed_rational_curve_with_unequal_end_weights_keeps_its_shape(tmp_path):
    """OCCT makes what is flagged as closed periodic, with the first weight for the last: 2 mm off here."""
    curve = BSplineCurve([[0, 0, 0], [5, 5, 0], [3, 9, 0], [0, 0, 0]], [0, 1], [4, 4], 3, [1, 1, 1, 3])
    write_step(tmp_path / "a.step", [Part("loop", curve)])
    assert shapes.same_bits(read_step(tmp_path / "a.step")[0].geometry, curve)
    text = (tmp_path / "a.step").read_text()
    (tmp_path / "foreign.step").write_text(re.sub(r"\.UNSPECIFIED\.,\s*\.F\.", ".UNSPECIFIED.,.T.", text))
    assert shapes.same_bits(read_step(tmp_path / "foreign.step")[0].geometry, curve)


def test_equal_weights_are_left_out(tmp_path):
    patch = shapes.patch(1)
    weighted = BSplineSurface(
        *(getattr(patch, f) for f in patch.__dataclass_fields__ if f != "weights"), np.full((5, 8), 3.0)
    )
    write_step(tmp_path / "a.step", [Part("flat weights", weighted)])
    assert shapes.same_bits(read_step(tmp_path / "a.step")[0].geometry, patch)


@pytest.mark.parametrize(
    "names",
    [["a", "a", "a"], ["", "x", ""], [" ", "\\X2\\00E4\\X0\\", "tab\tnew\nline"], ["@000000001@", "ß" * 200, "'"]],
)
def test_names_come_back_whatever_they_are(tmp_path, names):
    write_step(tmp_path / "a.step", [Part(name, shapes.curve(i)) for i, name in enumerate(names)])
    assert [part.name for part in read_step(tmp_path / "a.step")] == names


def test_names_like_huge_numbers_are_names(tmp_path):
    write_step(tmp_path / "a.step", [Part("bracket 12E500, 3d4100f", shapes.curve(1))])
    assert [part.name for part in read_step(tmp_path / "a.step")] == ["bracket 12E500, 3d4100f"]


def test_files_of_edges_only_and_of_faces_only(tmp_path):
    for make in (shapes.curve, shapes.patch):
        parts = [Part(f"{make.__name__} {i}", make(i), (i / 5, 0.5, 1.0)) for i in range(5)]
        write_step(tmp_path / "a.step", parts)
        back = read_step(tmp_path / "a.step")
        assert [(part.name, part.color) for part in back] == [(part.name, part.color) for part in parts]


def test_parts_smaller_than_the_tolerance_of_the_file_are_not_lost(tmp_path):
    small = BSplineCurve([[0, 0, 0], [1e-3, 2e-3, 0], [3e-3, 0, 0]], [0, 1], [3, 3], 2)
    parts = [Part("small", small), Part("patch", shapes.patch(1))]
    write_step(tmp_path / "a.step", parts, tolerance=0.5)
    assert all(shapes.same(a, b) for a, b in zip(parts, read_step(tmp_path / "a.step"), strict=True))


# --- what an independent reader finds -----------------------------------------------------------------------------


class Plain:
    """The entities of a file, read by steputils."""

    def __init__(self, path):
        self.entities = {}
        for ref, instance in p21.readfile(str(path)).data[0].instances.items():
            listed = [instance.entity] if hasattr(instance, "entity") else instance.entities
            self.entities[ref] = {entity.name: list(entity.params) for entity in listed}

    def all(self, name):
        return [entity for entity in self.entities.values() if name in entity]

    def point(self, ref):
        return [float(x) for x in self.entities[ref]["CARTESIAN_POINT"][1]]

    def curve(self, ref):
        entity = self.entities[ref]
        if "B_SPLINE_CURVE_WITH_KNOTS" in entity and "B_SPLINE_CURVE" not in entity:
            _, degree, points, _, _, _, counts, knots, _ = entity["B_SPLINE_CURVE_WITH_KNOTS"]
            weights = None
        else:
            degree, points, _, _, _ = entity["B_SPLINE_CURVE"]
            counts, knots, _ = entity["B_SPLINE_CURVE_WITH_KNOTS"]
            weights = entity["RATIONAL_B_SPLINE_CURVE"][0]
        return BSplineCurve(
            [self.point(r) for r in points], list(knots), list(counts), degree, weights and list(weights)
        )

    def surface(self, ref):
        entity = self.entities[ref]
        if "B_SPLINE_SURFACE" not in entity:
            _, p, q, points, _, _, _, _, mu, mv, ku, kv, _ = entity["B_SPLINE_SURFACE_WITH_KNOTS"]
            weights = None
        else:
            p, q, points, *_ = entity["B_SPLINE_SURFACE"]
            mu, mv, ku, kv, _ = entity["B_SPLINE_SURFACE_WITH_KNOTS"]
            weights = [list(row) for row in entity["RATIONAL_B_SPLINE_SURFACE"][0]]
        return BSplineSurface(
            [[self.point(r) for r in row] for row in points], list(ku), list(mu), p, list(kv), list(mv), q, weights
        )


def decoded(text):
    def letters(match):
        return bytes.fromhex(match[2]).decode("utf-16-be" if match[1] == "2" else "utf-32-be")

    return re.sub(r"\\X([24])\\([0-9A-F]*)\\X0\\", letters, text)


@pytest.mark.parametrize("schema", SCHEMAS)
def test_an_independent_reader_finds_the_same_poles(written, schema):
    plain = Plain(written[schema])
    faces = {decoded(e["ADVANCED_FACE"][0]): e["ADVANCED_FACE"][2] for e in plain.all("ADVANCED_FACE")}
    edges = {decoded(e["TRIMMED_CURVE"][0]): e["TRIMMED_CURVE"][1] for e in plain.all("TRIMMED_CURVE")}
    compared = 0
    for part in shapes.all_parts():
        if part.name in ("cylinder", "plane patch") or isinstance(part.geometry, EllipseArc):
            continue
        if isinstance(part.geometry, BSplineSurface):
            assert shapes.same_bits(plain.surface(faces[part.name]), part.geometry), part.name
        else:
            assert shapes.same_bits(plain.curve(edges[part.name]), part.geometry), part.name
        compared += 1
    assert compared == 14


def test_an_independent_reader_finds_names_colours_unit_and_uncertainty(written):
    plain, parts = Plain(written["AP242"]), shapes.all_parts()
    assert [decoded(e["PRODUCT"][1]) for e in plain.all("PRODUCT")] == [part.name for part in parts]
    assert {e["UNCERTAINTY_MEASURE_WITH_UNIT"][0].param for e in plain.all("UNCERTAINTY_MEASURE_WITH_UNIT")} == {2e-5}
    assert all(str(e["SI_UNIT"][0]) == ".MILLI." for e in plain.all("LENGTH_UNIT"))
    colours = [tuple(e["COLOUR_RGB"][1:]) for e in plain.all("COLOUR_RGB")]
    assert colours == [part.color for part in parts if part.color is not None]
    data = written["AP242"].read_bytes()
    assert data.isascii()
    assert b"AP242_MANAGED_MODEL_BASED_3D_ENGINEERING" in data
    assert b"'2024-02-29T12:34:56'" in data


def test_area_and_box_of_what_an_independent_reader_finds(written):
    plain = Plain(written["AP242"])
    faces = {e["ADVANCED_FACE"][0]: e["ADVANCED_FACE"][2] for e in plain.all("ADVANCED_FACE")}
    for name, area, low, high in (
        ("cylinder", 12 * math.pi, [-2, -2, 0], [2, 2, 3]),
        ("hemisphere", 8 * math.pi, [-2, -2, 0], [2, 2, 2]),
        ("torus", 40 * math.pi**2, [-7, -7, -2], [7, 7, 2]),
    ):
        surface = plain.surface(faces[name])
        assert shapes.area(surface) == pytest.approx(area, rel=1e-8)
        assert surface.control_points.min(axis=(0, 1)).tolist() == low
        assert surface.control_points.max(axis=(0, 1)).tolist() == high


def test_edges_of_a_face_hold_the_rows_of_its_surface(written):
    plain = Plain(written["AP214"])
    patch = shapes.all_parts()[3].geometry
    curves = [plain.curve(e["SURFACE_CURVE"][1]) for e in plain.all("SURFACE_CURVE")]
    for side in ("u0", "u1", "v0", "v1"):
        assert any(shapes.same_bits(patch.boundary(side), curve) for curve in curves)


# --- reproducible bytes -------------------------------------------------------------------------------------------

WRITE = """
import sys
from datetime import datetime
from gtcad.converters.step import write_step
from tests.converters.occt import shapes
stamp = datetime(2024, 2, 29, 12, 34, 56)
write_step(sys.argv[1], shapes.all_parts(), schema=sys.argv[2], tolerance=2e-5, timestamp=stamp)
"""


@pytest.mark.parametrize("schema", SCHEMAS)
def test_equal_input_gives_equal_bytes_in_another_process(written, tmp_path, schema):
    path = tmp_path / "other name.stp"
    subprocess.run(
        [sys.executable, "-c", WRITE, str(path), schema],
        check=True,
        cwd=ROOT,
        env=os.environ | {"USER": "x", "TZ": "Asia/Tokyo"},
    )
    assert path.read_bytes() == written[schema].read_bytes()


def test_bytes_are_the_same_with_both_kernels(tmp_path):
    parts = [Part("edge", shapes.circle(), (0.25, 0.5, 0.75)), Part("face", shapes.torus(), (0.5, 0.5, 0.25))]
    digests = []
    for schema in SCHEMAS:
        write_step(tmp_path / "a.step", parts, schema=schema, timestamp=STAMP)
        data = (tmp_path / "a.step").read_bytes().replace(gtcad.__version__.encode(), b"")
        digests.append(hashlib.sha256(data).hexdigest()[:16])
    assert digests == ["81add5f6a3048e30", "c333c011f0bb7226", "bda59ed3aa4ca4af"]  # from OCCT 7.9.3


@pytest.mark.parametrize("schema", SCHEMAS)
def test_nothing_of_machine_user_and_clock_gets_into_a_file(written, schema):
    text = written[schema].read_text()
    for private in (socket.gethostname(), str(datetime.now().year), "127.0.0", str(written[schema].parent)):
        assert private not in text
    assert not re.search(rf"'[^']*\b{re.escape(getpass.getuser())}\b[^']*'", text)


def test_times_with_a_zone(tmp_path):
    zoned = datetime(2024, 2, 29, 23, 30, tzinfo=UTC)
    write_step(tmp_path / "a.step", [Part("a", shapes.curve(1))], schema="AP203", timestamp=zoned)
    text = (tmp_path / "a.step").read_text()
    assert "'2024-02-29T23:30:00+00:00'" in text
    assert "CALENDAR_DATE(2024,29,2)" in text
    assert "LOCAL_TIME(23,30,$," in text


def test_without_a_time_it_is_now(tmp_path):
    write_step(tmp_path / "a.step", [Part("a", shapes.curve(1))])
    stamp = re.search(r"'(\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d)'", (tmp_path / "a.step").read_text())[1]
    assert abs((datetime.now() - datetime.fromisoformat(stamp)).total_seconds()) < 60


# --- what is global in the kernel ---------------------------------------------------------------------------------

HOSTILE = {
    "write.step.unit": "INCH",
    "xstep.cascade.unit": "M",
    "write.step.schema": "AP203",
    "write.step.product.name": "somebody's",
    "write.surfacecurve.mode": 0,
    "write.precision.mode": 1,
    "write.precision.val": 3.25,
    "write.step.assembly": 1,
    "write.step.vertex.mode": 1,
    "write.step.nonmanifold": 1,
    "write.stepcaf.subshapes.name": 1,
    "read.precision.mode": 1,
    "read.precision.val": 2.5,
    "read.step.product.mode": 0,
    "read.step.codepage": "GB",
    "read.stepcaf.subshapes.name": 0,
}


def test_parameters_of_others_neither_matter_nor_change(written, tmp_path):
    units = kernel_module("UnitsMethods").UnitsMethods
    messenger = kernel_module("Message").Message.DefaultMessenger_s()
    printers = messenger.Printers().Length()
    with session.statics(HOSTILE):
        units.SetCasCadeLengthUnit_s(25.4)
        write_step(tmp_path / "a.step", shapes.all_parts(), schema="AP242", tolerance=2e-5, timestamp=STAMP)
        parts = read_step(tmp_path / "a.step")
        assert units.GetCasCadeLengthUnit_s() == 25.4
        units.SetCasCadeLengthUnit_s(1.0)
        for name, value in HOSTILE.items():
            assert session._get_static(name, value) == value, name
    assert (tmp_path / "a.step").read_bytes() == written["AP242"].read_bytes()
    assert all(shapes.same(a, b) for a, b in zip(parts, shapes.all_parts(), strict=True))
    assert messenger.Printers().Length() == printers


def test_parameters_are_restored_after_an_error(tmp_path):
    (tmp_path / "a.step").write_text("ISO-10303-21;\nnonsense\nEND-ISO-10303-21;\n")
    with session.statics(HOSTILE):
        with pytest.raises(FileError):
            read_step(tmp_path / "a.step")
        assert Static.CVal_s("xstep.cascade.unit") == "M"
    with pytest.raises(KernelError, match="refuses the parameter"), session.statics({"write.step.unit": "PARSEC"}):
        pass


def test_nothing_is_printed(tmp_path):
    script = (
        "import sys\nfrom gtcad.converters.step import read_step, write_step\n"
        "from tests.converters.occt import shapes\nfrom pathlib import Path\n"
        "path = Path(sys.argv[1])\nwrite_step(path, shapes.all_parts())\nread_step(path)\n"
        "text = path.read_text()\n"
        "for bad in ('', 'x', text[:9000], text.replace('#40', '#41'), text.replace('EDGE_LOOP', 'EDGE_LOOX'),\n"
        "            text.replace('B_SPLINE_CURVE_WITH_KNOTS', 'B_SPLINE_CURVE'), 'ISO-10303-21;END-ISO-10303-21;'):\n"
        "    path.write_text(bad)\n"
        "    try:\n        read_step(path)\n        raise SystemExit('was read')\n"
        "    except OSError:\n        pass\n"
    )
    run = subprocess.run(
        [sys.executable, "-c", script, str(tmp_path / "a.step")], capture_output=True, cwd=ROOT, check=False
    )
    assert (run.returncode, run.stdout, run.stderr) == (0, b"", b"")


# --- files of others ----------------------------------------------------------------------------------------------


def test_inches_come_back_in_mm(tmp_path):
    patch = shapes.patch(1)
    back = read_step(write_foreign(tmp_path / "inch.step", make_face(patch), "INCH"))
    assert "'INCH'" in (tmp_path / "inch.step").read_text()
    assert np.abs(back[0].geometry.control_points - patch.control_points).max() < 1e-10
    arc = EllipseArc([1, 2, 3], [0, 2, 0], [0, 0, 1], 0.3, 1.7)
    back = read_step(write_foreign(tmp_path / "metre.step", make_edge(arc), "M"))
    assert np.abs(back[0].geometry.evaluate(1.0) - arc.evaluate(1.0)).max() < 1e-10


def test_a_box_is_six_whole_planes_of_which_three_are_reversed(tmp_path):
    box = kernel_module("BRepPrimAPI").BRepPrimAPI_MakeBox(1.0, 2.0, 3.0).Shape()
    parts = read_step(write_foreign(tmp_path / "box.step", box))
    assert [part.source for part in parts] == ["PLANE"] * 6
    assert [part.reversed for part in parts] == [True, False] * 3
    assert not any(part.trimmed for part in parts)
    assert all(part.valid for part in parts)
    assert sorted(round(float(measure.area(surface_of_quadric(part.geometry))), 6) for part in parts) == [
        2,
        2,
        3,
        3,
        6,
        6,
    ]


def test_analytic_solids_are_exact_and_say_what_they_were(tmp_path):
    axes = gp.gp_Ax2(gp.gp_Pnt(1, 2, 3), gp.gp_Dir(1, 2, 2))
    prim = kernel_module("BRepPrimAPI")
    cylinder = read_step(write_foreign(tmp_path / "a.step", prim.BRepPrimAPI_MakeCylinder(axes, 2.0, 5.0).Shape()))
    assert [part.source for part in cylinder] == ["CYLINDRICAL_SURFACE", "PLANE", "PLANE"]
    assert [part.trimmed for part in cylinder] == [False, False, False]
    u = np.linspace(0, 1, 9)
    points = surface_of_quadric(cylinder[0].geometry).evaluate(u[:, None], u[None, :]) - [1, 2, 3]
    along = points @ (np.array([1, 2, 2]) / 3)
    assert np.abs(np.linalg.norm(points, axis=-1) ** 2 - along**2 - 4).max() < 1e-10
    for shape, kind in (
        (prim.BRepPrimAPI_MakeSphere(axes, 2.0), "SPHERICAL_SURFACE"),
        (prim.BRepPrimAPI_MakeTorus(axes, 5.0, 2.0), "TOROIDAL_SURFACE"),
        (prim.BRepPrimAPI_MakeCone(axes, 2.0, 1.0, 5.0), "CONICAL_SURFACE"),
    ):
        parts = read_step(write_foreign(tmp_path / "b.step", shape.Shape()))
        assert (parts[0].source, parts[0].trimmed, parts[0].valid) == (kind, False, True)
        write_step(tmp_path / "c.step", parts[:1])  # what was read can be written


def test_lines_become_splines_and_used_parts_of_curves_are_cut_out(tmp_path):
    build = kernel_module("BRepBuilderAPI")
    line = build.BRepBuilderAPI_MakeEdge(gp.gp_Pnt(0, 0, 1), gp.gp_Pnt(0, 3, 1)).Edge()
    part = read_step(write_foreign(tmp_path / "line.step", line))[0]
    assert part.source == "LINE"
    assert part.geometry.control_points.tolist() == [[0, 0, 1], [0, 3, 1]]
    spline = shapes.curve(1)
    whole = kernel_module("BRep").BRep_Tool.Curve_s(make_edge(spline), 0.0, 0.0)
    piece = read_step(write_foreign(tmp_path / "piece.step", build.BRepBuilderAPI_MakeEdge(whole, 0.25, 0.75).Edge()))[
        0
    ]
    t = np.linspace(0.25, 0.75, 9)
    assert piece.geometry.knots[[0, -1]].tolist() == [0.25, 0.75]
    assert np.abs(piece.geometry.evaluate(t) - spline.evaluate(t)).max() < 1e-10


def test_a_trimmed_spline_face_keeps_its_whole_surface(tmp_path):
    surface = to_geom_surface(shapes.patch(1))
    face = kernel_module("BRepBuilderAPI").BRepBuilderAPI_MakeFace(surface, 0.25, 0.75, 0.0, 1.0, 1e-7).Face()
    part = read_step(write_foreign(tmp_path / "a.step", face))[0]
    assert part.trimmed
    assert np.abs(part.geometry.control_points - shapes.patch(1).control_points).max() < 1e-10


def test_offset_surfaces_are_refused(tmp_path):
    offset = kernel_module("Geom").Geom_OffsetSurface(to_geom_surface(shapes.patch(1)), 0.5)
    face = kernel_module("BRepBuilderAPI").BRepBuilderAPI_MakeFace(offset, 1e-7).Face()
    with pytest.raises(KernelError, match=r"a.step: part 0 \(.*\): OFFSET_SURFACE has no exact B-spline form"):
        read_step(write_foreign(tmp_path / "a.step", face))


def test_an_assembly_gives_its_parts_in_their_places_with_inherited_names_and_colours(tmp_path):
    from gtcad.converters.occt.document import Document, Item

    document = Document()
    solid = kernel_module("BRepPrimAPI").BRepPrimAPI_MakeBox(1.0, 2.0, 3.0).Shape()
    box = document.add(Item(solid, "box"))
    color = kernel_module("Quantity").Quantity_Color(0.25, 0.5, 0.75, kernel_module("Quantity").Quantity_TOC_sRGB)
    document.colors.SetColor(box, color, kernel_module("XCAFDoc").XCAFDoc_ColorGen)
    faces = kernel_module("TopExp").TopExp_Explorer(solid, kernel_module("TopAbs").TopAbs_FACE)
    red = kernel_module("Quantity").Quantity_Color(1.0, 0.0, 0.0, kernel_module("Quantity").Quantity_TOC_sRGB)
    document.colors.SetColor(
        document.shapes.AddSubShape(box, faces.Current()), red, kernel_module("XCAFDoc").XCAFDoc_ColorSurf
    )
    assembly = document.shapes.NewShape()
    kernel_module("TDataStd").TDataStd_Name.Set_s(
        assembly, kernel_module("TCollection").TCollection_ExtendedString("all")
    )
    for height in (0.0, 10.0):
        move = gp.gp_Trsf()
        move.SetTranslation(gp.gp_Vec(0, 0, height))
        document.shapes.AddComponent(assembly, box, kernel_module("TopLoc").TopLoc_Location(move))
    document.shapes.UpdateAssemblies()
    with session.session("writing", session.writing_step("AP214IS", 1e-7)):
        writer = kernel_module("STEPCAFControl").STEPCAFControl_Writer()
        writer.Transfer(document.data, STEPControl.STEPControl_AsIs)
        writer.Write(str(tmp_path / "a.step"))
    parts = read_step(tmp_path / "a.step")
    assert [part.name for part in parts] == ["box"] * 12
    assert [part.color for part in parts] == ([(1.0, 0.0, 0.0)] + [(0.25, 0.5, 0.75)] * 5) * 2
    for low, high in zip(parts[:6], parts[6:], strict=True):
        shift = high.geometry.origin - low.geometry.origin
        assert np.abs(shift - [0, 0, 10]).max() < 1e-12


# --- bad input ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (None, "no such file"),
        (b"", "is empty"),
        (b"\x00\xff\x00garbage" * 100, "is not a readable STEP file: it does not begin with ISO-10303-21;"),
        (b"solid x\nendsolid x\n", "is not a readable STEP file"),
        (b"ISO-10303-21;\nHEADER;\nnonsense(((\nEND-ISO-10303-21;\n", "is not a readable STEP file: "),
        (
            b"ISO-10303-21;\nHEADER;\nENDSEC;\nDATA;\nENDSEC;\nEND-ISO-10303-21;\n",
            "readable STEP file|neither faces nor edges",
        ),
    ],
)
def test_bad_files(tmp_path, content, reason):
    path = tmp_path / "bäd.step"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(FileError, match=reason) as info:
        read_step(path)
    assert str(info.value).startswith(f"{path}: ")
    assert isinstance(info.value, OSError)


def test_a_folder_is_no_file(tmp_path):
    with pytest.raises(FileError, match="cannot be read"):
        read_step(tmp_path)


def test_a_file_without_faces_and_edges_says_so(tmp_path):
    vertex = kernel_module("BRepBuilderAPI").BRepBuilderAPI_MakeVertex(gp.gp_Pnt(1, 2, 3)).Vertex()
    with pytest.raises(FileError, match="holds neither faces nor edges"):
        read_step(write_foreign(tmp_path / "a.step", vertex))


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9, 0.999])
def test_truncated_files(written, tmp_path, share):
    data = written["AP242"].read_bytes()
    (tmp_path / "cut.step").write_bytes(data[: int(share * len(data))])
    with pytest.raises(FileError, match="is not a readable STEP file: its end is missing"):
        read_step(tmp_path / "cut.step")


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("ADVANCED_FACE(", "ADVANCED_FQX("),
        ("EDGE_LOOP(", "EDGE_LOQX("),
        ("SURFACE_SIDE_STYLE(", "SURFACE_SIDE_STYQX("),
        ("#12 = CARTESIAN_POINT", "#99912 = CARTESIAN_POINT"),
        ("(5,3,5)", "(5,2,5)"),
    ],
)
def test_damaged_files_are_refused_rather_than_read_in_part(written, tmp_path, old, new):
    text = written["AP242"].read_text()
    assert old in text
    (tmp_path / "damaged.step").write_text(text.replace(old, new, 1))
    with pytest.raises(FileError, match=r"is not a readable STEP file: entity \d+ \(\w+\): "):
        read_step(tmp_path / "damaged.step")


@pytest.mark.parametrize("word", ["NAN", "-INF", "1.#QNAN", "Infinity", "1.E+999", "*"])
def test_coordinates_that_are_no_finite_numbers_are_refused(tmp_path, word):
    write_step(tmp_path / "a.step", [Part("a", shapes.patch(1))])
    text = (tmp_path / "a.step").read_text()
    place = text.index("BOUNDED_SURFACE" if "BOUNDED_SURFACE" in text else "B_SPLINE_SURFACE")
    changed = re.sub(r"(CARTESIAN_POINT\('[^']*',\()[^,]*", rf"\g<1>{word}", text[place:], count=1)
    assert changed != text[place:]
    (tmp_path / "a.step").write_text(text[:place] + changed)
    for read in (read_step, lambda path: readiness_of_file(str(path), "STEP")):
        with pytest.raises(FileError):
            read(tmp_path / "a.step")


def test_lost_faces_are_noticed(tmp_path):
    write_step(tmp_path / "a.step", [Part("a", shapes.patch(1)), Part("b", shapes.patch(2))])
    text = (tmp_path / "a.step").read_text()
    (tmp_path / "a.step").write_text(
        text.replace("SHAPE_DEFINITION_REPRESENTATION(", "SHAPE_DEFINITION_REPRESENTATIOX(", 1)
    )
    with pytest.raises(FileError, match="1 of its 2 faces belong to no product"):
        read_step(tmp_path / "a.step")


@pytest.mark.parametrize(
    ("parts", "options", "message"),
    [
        ([], {}, "at least one part, got none"),
        ([Part("a", shapes.curve(1))], {"schema": "AP219"}, "schema must be one of AP242, AP214, AP203, got 'AP219'"),
        ([Part("a", shapes.curve(1))], {"tolerance": 0.0}, "tolerance must be a positive number of mm, got 0.0"),
        ([Part("a", shapes.curve(1))], {"tolerance": math.nan}, "tolerance must be a positive number of mm, got nan"),
        (
            [Part("a", shapes.curve(1)), Part("dot", BSplineCurve([[0, 0], [0, 0]], [0, 1], [2, 2], 1))],
            {},
            r"part 1 \('dot'\): the curve must be longer",
        ),
    ],
)
def test_bad_input_leaves_the_old_file_and_nothing_else(tmp_path, parts, options, message):
    path = tmp_path / "a.step"
    path.write_text("old")
    with pytest.raises(InputError, match=message):
        write_step(path, parts, **options)
    assert [p.name for p in tmp_path.iterdir()] == ["a.step"]
    assert path.read_text() == "old"


def test_a_write_that_fails_leaves_nothing(tmp_path, monkeypatch):
    def full(self, data):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(OSError, match="No space left"):
        write_step(tmp_path / "a.step", [Part("a", shapes.curve(1))])
    assert list(tmp_path.iterdir()) == []


def test_a_missing_folder_is_a_file_error(tmp_path):
    with pytest.raises(FileError, match="cannot be written"):
        write_step(tmp_path / "nowhere" / "a.step", [Part("a", shapes.curve(1))])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"name": 3, "geometry": shapes.curve(1)}, "name must be a text, got 3"),
        (
            {"name": "a", "geometry": "circle"},
            "geometry must be a BSplineCurve, BSplineSurface, EllipseArc, Quadric, Wire or Built, got str",
        ),
        (
            {"name": "a", "geometry": shapes.curve(1), "color": (0, 0.5, 1.5)},
            r"color must be three numbers in \[0, 1\]",
        ),
        ({"name": "a", "geometry": shapes.curve(1), "color": (0, 0.5)}, "color must be three numbers"),
    ],
)
def test_bad_parts(arguments, message):
    with pytest.raises(InputError, match=message):
        Part(**arguments)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"center": [0, 0]}, "center must be three finite numbers"),
        ({"axis_b": [0, math.nan, 0]}, "axis_b must be three finite numbers"),
        ({"axis_a": [0, 0, 0]}, "the axes must not be zero, got lengths 0.0 and 1.0"),
        ({"axis_a": [1, 1, 0]}, "the axes must be at right angles, got an angle with cosine 0.707"),
        ({"end": 0.0}, "start < end <= start"),
        ({"end": 6.3}, "start < end <= start"),
        ({"end": math.nan}, "start < end <= start"),
    ],
)
def test_bad_arcs(changes, message):
    arguments = {"center": [0, 0, 0], "axis_a": [2, 0, 0], "axis_b": [0, 1, 0], "start": 0.0, "end": 1.0}
    with pytest.raises(InputError, match=message):
        EllipseArc(**(arguments | changes))
