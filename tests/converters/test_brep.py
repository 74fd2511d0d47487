from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from gtcad.converters.brep import read_brep, write_brep
from gtcad.converters.bspline import BSplineCurve
from gtcad.converters.occt.compat import kernel_module
from gtcad.converters.occt.topology import make_edge, make_face
from gtcad.converters.part import Part
from gtcad.converters.quadrics import surface_of_quadric
from gtcad.converters.readiness import readiness_of_file
from gtcad.errors import FileError, InputError
from tests.converters.occt import shapes

ROOT = Path(__file__).parents[2]
BRep = kernel_module("BRep")
BRepTools = kernel_module("BRepTools").BRepTools
TopoDS = kernel_module("TopoDS")
gp = kernel_module("gp")


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    path = tmp_path_factory.mktemp("brep") / "all.brep"
    write_brep(path, shapes.all_parts())
    return path


def compound(*parts):
    whole, builder = TopoDS.TopoDS_Compound(), BRep.BRep_Builder()
    builder.MakeCompound(whole)
    for part in parts:
        builder.Add(whole, part)
    return whole


def test_everything_comes_back_in_order_without_names(written):
    parts, found = shapes.all_parts(), read_brep(written)
    assert len(found) == len(parts)
    for part, back in zip(parts, found, strict=True):
        assert shapes.same(part, back), part.name
        assert (back.name, back.color) == ("", None)
        assert (back.valid, back.trimmed, back.reversed) == (True, False, False)


def test_knots_that_are_no_short_numbers_come_back_bit_for_bit(tmp_path):
    spline = BSplineCurve(np.random.default_rng(0).random((5, 3)), [0.1 + 0.2, np.pi, 1e3 / 7], [4, 1, 4], 3)
    write_brep(tmp_path / "a.brep", [Part("", spline)])
    assert shapes.same_bits(read_brep(tmp_path / "a.brep")[0].geometry, spline)


def test_an_independent_look_at_the_poles(written):
    numbers = {float(word) for word in re.findall(r"(?<![\w.])-?\d[-+.\de]*", written.read_text())}
    for part in shapes.all_parts():
        if hasattr(part.geometry, "control_points"):
            assert set(part.geometry.control_points.ravel().tolist()) <= numbers, part.name


def test_equal_input_gives_equal_bytes_in_another_process(written, tmp_path):
    script = (
        "import sys\nfrom gtcad.converters.brep import write_brep\n"
        "from tests.converters.occt import shapes\nwrite_brep(sys.argv[1], shapes.all_parts())\n"
    )
    subprocess.run([sys.executable, "-c", script, str(tmp_path / "other.brep")], check=True, cwd=ROOT)
    assert (tmp_path / "other.brep").read_bytes() == written.read_bytes()


def test_nothing_is_printed(tmp_path):
    script = (
        "import sys\nfrom gtcad.converters.brep import read_brep, write_brep\n"
        "from tests.converters.occt import shapes\nfrom pathlib import Path\n"
        "path = Path(sys.argv[1])\nwrite_brep(path, shapes.all_parts())\nread_brep(path)\n"
        "text = path.read_bytes()\n"
        "for bad in (b'', b'x', text[:900], text[:-400], text.replace(b'Surfaces', b'Surfoces')):\n"
        "    path.write_bytes(bad)\n"
        "    try:\n        read_brep(path)\n        raise SystemExit('was read')\n"
        "    except OSError:\n        pass\n"
    )
    command = [sys.executable, "-c", script, str(tmp_path / "a.brep")]
    run = subprocess.run(command, capture_output=True, cwd=ROOT, check=False)
    assert (run.returncode, run.stdout, run.stderr) == (0, b"", b"")


def test_faces_and_free_edges_of_a_nested_compound_in_order(tmp_path):
    face = make_face(shapes.patch(1))
    edge, other = make_edge(shapes.curve(1)), make_edge(shapes.curve(2))
    boundary = kernel_module("TopExp").TopExp_Explorer(face, kernel_module("TopAbs").TopAbs_EDGE).Current()
    whole = compound(edge, compound(boundary, face), other.Reversed(), edge, compound())
    BRepTools.Write_s(whole, str(tmp_path / "a.brep"))
    parts = read_brep(tmp_path / "a.brep")
    assert [part.reversed for part in parts] == [False, False, True]
    for part, geometry in zip(parts, (shapes.curve(1), shapes.patch(1), shapes.curve(2)), strict=True):
        assert shapes.same_bits(part.geometry, geometry)


def test_places_are_applied(tmp_path):
    move = gp.gp_Trsf()
    move.SetRotation(gp.gp_Ax1(gp.gp_Pnt(0, 0, 0), gp.gp_Dir(0, 0, 1)), np.pi / 2)
    place = kernel_module("TopLoc").TopLoc_Location(move)
    whole = compound(make_face(shapes.patch(1)).Moved(place), make_edge(shapes.curve(1)).Moved(place))
    BRepTools.Write_s(whole, str(tmp_path / "a.brep"))
    turn = np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]])
    for part, geometry in zip(read_brep(tmp_path / "a.brep"), (shapes.patch(1), shapes.curve(1)), strict=True):
        assert np.abs(part.geometry.control_points - geometry.control_points @ turn).max() < 1e-13


def test_mirrored_faces_are_exact(tmp_path):
    axes = gp.gp_Ax2(gp.gp_Pnt(1, 2, 3), gp.gp_Dir(1, 2, 2))
    sphere = kernel_module("BRepPrimAPI").BRepPrimAPI_MakeSphere(axes, 2.0, -0.3, 0.7, 2.0).Shape()
    mirror = gp.gp_Trsf()
    mirror.SetMirror(gp.gp_Ax2(gp.gp_Pnt(0, 0, 0), gp.gp_Dir(1, 0, 0)))
    moved = kernel_module("BRepBuilderAPI").BRepBuilderAPI_Transform(sphere, mirror, True).Shape()
    BRepTools.Write_s(moved, str(tmp_path / "a.brep"))
    part = read_brep(tmp_path / "a.brep")[0]
    assert (part.source, part.trimmed, part.valid) == ("SPHERICAL_SURFACE", False, True)
    along = np.linspace(0, 1, 9)
    points = surface_of_quadric(part.geometry).evaluate(along[:, None], along[None, :]) - [-1, 2, 3]
    assert np.abs(np.linalg.norm(points, axis=-1) - 2).max() < 1e-14


def test_a_face_with_a_hole_is_trimmed(tmp_path):
    build = kernel_module("BRepBuilderAPI")
    hole = gp.gp_Circ(gp.gp_Ax2(gp.gp_Pnt(0.5, 0.5, 0), gp.gp_Dir(0, 0, -1)), 0.25)
    plane = build.BRepBuilderAPI_MakeFace(gp.gp_Pln(), 0.0, 1.0, 0.0, 1.0).Face()
    ring = build.BRepBuilderAPI_MakeWire(build.BRepBuilderAPI_MakeEdge(hole).Edge()).Wire()
    BRepTools.Write_s(build.BRepBuilderAPI_MakeFace(plane, ring).Face(), str(tmp_path / "hole.brep"))
    BRepTools.Write_s(plane, str(tmp_path / "plane.brep"))
    assert read_brep(tmp_path / "hole.brep")[0].trimmed
    assert not read_brep(tmp_path / "plane.brep")[0].trimmed


def test_an_invalid_face_says_so(tmp_path):
    face = make_face(shapes.patch(1))
    BRep.BRep_Builder().NaturalRestriction(face, False)
    vertex = kernel_module("TopExp").TopExp_Explorer(face, kernel_module("TopAbs").TopAbs_VERTEX).Current()
    away = kernel_module("BRep").BRep_Builder()
    away.UpdateVertex(TopoDS.TopoDS.Vertex(vertex), gp.gp_Pnt(50, 50, 50), 1e-7)
    BRepTools.Write_s(face, str(tmp_path / "a.brep"))
    assert not read_brep(tmp_path / "a.brep")[0].valid


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (None, "no such file"),
        (b"", "is empty"),
        (b"\x00\xff\x00garbage" * 100, "is not a readable BREP file: it does not begin with CASCADE Topology"),
        (b"CASCADE Topology V3, (c) Open Cascade\n", "is not a readable BREP file: its tables are incomplete"),
    ],
)
def test_bad_files(tmp_path, content, reason):
    path = tmp_path / "bäd.brep"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(FileError, match=reason) as info:
        read_brep(path)
    assert str(info.value).startswith(f"{path}: ")


@pytest.mark.parametrize("share", [0.01, 0.3, 0.7, 0.9, 0.99, 0.999])
def test_truncated_files(written, tmp_path, share):
    data = written.read_bytes()
    (tmp_path / "cut.brep").write_bytes(data[: int(share * len(data))])
    with pytest.raises(FileError, match="is not a readable BREP file: its table"):
        read_brep(tmp_path / "cut.brep")


def test_words_among_the_numbers_are_refused(written, tmp_path):
    text = written.read_text()
    (tmp_path / "a.brep").write_text(text.replace("0 0 1 0", "0 0 one 0", 1))
    with pytest.raises(FileError, match="its table Curve2ds holds something that is no number"):
        read_brep(tmp_path / "a.brep")


def test_infinite_numbers_are_refused(written, tmp_path):
    text = written.read_text()
    place = text.index("\nSurfaces")
    (tmp_path / "a.brep").write_text(text[:place] + re.sub(r"\d\.\d{6,}", "1e+400", text[place:], count=1))
    for read in (read_brep, lambda path: readiness_of_file(str(path), "BREP")):
        with pytest.raises(FileError, match="holds a number of 1e\\+100 or more"):
            read(tmp_path / "a.brep")


def test_an_empty_compound_holds_nothing(tmp_path):
    BRepTools.Write_s(compound(), str(tmp_path / "a.brep"))
    with pytest.raises(FileError, match="holds neither faces nor edges"):
        read_brep(tmp_path / "a.brep")


def test_bad_input_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "a.brep"
    path.write_text("old")
    with pytest.raises(InputError, match="at least one part, got none"):
        write_brep(path, [])
    assert [p.name for p in tmp_path.iterdir()] == ["a.brep"]
    assert path.read_text() == "old"
