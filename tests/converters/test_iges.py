from __future__ import annotations

import hashlib
import os
import re
import socket
import subprocess
import sys
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

import gtcad
from gtcad.converters.bspline import BSplineCurve
from gtcad.converters.iges import read_iges, write_iges
from gtcad.converters.occt import session
from gtcad.converters.occt.compat import kernel_module
from gtcad.converters.occt.topology import make_face
from gtcad.converters.part import EllipseArc, Part
from gtcad.converters.readiness import readiness_of_file
from gtcad.errors import FileError, InputError
from tests.converters.occt import shapes

ROOT = Path(__file__).parents[2]
STAMP = datetime(2024, 2, 29, 12, 34, 56)
IGESControl = kernel_module("IGESControl")
gp = kernel_module("gp")


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    path = tmp_path_factory.mktemp("iges") / "all.igs"
    write_iges(path, shapes.all_parts(), tolerance=2e-5, timestamp=STAMP)
    return path


def write_foreign(path, shape, unit="MM"):
    """A file as other programs write it, through the kernel's plain writer, with some 10 digits."""
    IGESControl.IGESControl_Controller.Init_s()
    with session.quiet():
        writer = IGESControl.IGESControl_Writer(unit, 0)
        writer.AddShape(shape)
        writer.ComputeModel()
        writer.Write(str(path))
    return path


def section(path, letter):
    return [line[:72] for line in path.read_bytes().splitlines() if line[72:73] == letter.encode()]


def test_everything_comes_back(written):
    # a full ellipse is written as its halves
    parts = [part for part in shapes.all_parts() if part.name != "full ellipse"]
    found = [part for part in read_iges(written) if part.name != "full ellipse"]
    assert [part.name for part in found] == [part.name.strip() for part in parts]
    for part, back in zip(parts, found, strict=True):
        assert shapes.same(part, back), part.name
        assert (back.valid, back.trimmed, back.reversed) == (True, False, False), part.name
        assert back.color == (part.color and tuple(round(value, 6) for value in part.color)), part.name
    assert {part.source for part in found} == {"B_SPLINE_CURVE", "B_SPLINE_SURFACE", "CIRCLE", "ELLIPSE"}


@pytest.mark.parametrize("seed", range(3))
def test_random_splines_come_back_bit_for_bit(tmp_path, seed):
    rng = np.random.default_rng(seed)
    parts = []
    for i in range(8):
        p, q = rng.integers(1, 8, 2).tolist()
        parts.append(Part(f"c{i}", shapes.curve(seed + 10 * i, p, bool(i % 2))))
        parts.append(Part(f"s{i}", shapes.patch(seed + 10 * i, (p, q), bool(i % 2))))
        parts.append(Part(f"o{i}", shapes.closed_curve(seed + 10 * i, bool(i % 2))))
    write_iges(tmp_path / "a.igs", parts)
    for part, back in zip(parts, read_iges(tmp_path / "a.igs"), strict=True):
        assert part.name == back.name
        assert shapes.same(part, back)


@pytest.mark.parametrize("start", [0.0, 0.3, np.pi / 2])
def test_a_full_ellipse_comes_back_as_its_halves(tmp_path, start):
    arc = EllipseArc([0, 0, 0], [3, 0, 0], [0, 2, 0], start, start + 2 * np.pi)
    write_iges(tmp_path / "a.igs", [Part("ellipse", arc)])
    halves = read_iges(tmp_path / "a.igs")
    assert [half.source for half in halves] == ["ELLIPSE"] * 2
    for half, angles in zip(halves, ([start, start + np.pi], [start + np.pi, start + 2 * np.pi]), strict=True):
        x, y, _ = half.geometry.evaluate(np.linspace(half.geometry.start, half.geometry.end, 50)).T
        assert np.abs(x**2 / 9 + y**2 / 4 - 1).max() < 1e-14
        ends = half.geometry.evaluate(np.array([half.geometry.start, half.geometry.end]))
        assert np.abs(ends - arc.evaluate(np.array(angles))).max() < 1e-14


@pytest.mark.parametrize("start", [-7.0, 0.0, 3.0, 6.0])
@pytest.mark.parametrize("turn", [0.5, np.pi, 6.0])
def test_arcs_anywhere(tmp_path, start, turn):
    axes = (([0, 2, 0], [0, 0, 2]), ([0, 2, 0], [0, 0, 1]), ([0, 1, 1], [0, -2, 2]), ([3, 0, 1], [-1, 0, 3]))
    parts = [Part(f"{i}", EllipseArc([1, 2, 3], a, b, start, start + turn)) for i, (a, b) in enumerate(axes)]
    write_iges(tmp_path / "a.igs", parts)
    for part, back in zip(parts, read_iges(tmp_path / "a.igs"), strict=True):
        along = np.linspace(0, 1, 9) * turn
        there = back.geometry.evaluate(back.geometry.start + along * (back.geometry.end - back.geometry.start) / turn)
        assert np.abs(there - part.geometry.evaluate(start + along)).max() < 1e-13


def test_the_frame_of_the_file(written):
    lines = written.read_bytes().splitlines()
    assert {len(line) for line in lines} == {80}
    text = b"".join(section(written, "G")).decode()
    assert "2HMM" in text
    assert ",2e-05," in text.lower() or ",2.e-05," in text.lower()
    assert text.count("15H20240229.123456") == 2
    assert f"gtcad {gtcad.__version__}" in text


def test_poles_stand_in_the_file_with_all_their_digits(written):
    parameters = b"".join(line[:64] for line in section(written, "P")).replace(b" ", b"")
    for part in shapes.all_parts()[:4]:
        x, y, z = part.geometry.control_points.reshape(-1, 3)[-1].tolist()
        assert f"{x:.16E},{y:.16E},{z:.16E}".encode() in parameters


def test_letters_beyond_ascii_are_utf_8(written):
    assert "Kurve ä;".encode() in written.read_bytes()


@pytest.mark.parametrize("names", [["a", "a"], ["", "x"], ["it's; odd, isn't it", "5Hello"], ["ß" * 100, "tab\tname"]])
def test_names_come_back(tmp_path, names):
    write_iges(tmp_path / "a.igs", [Part(name, shapes.curve(i)) for i, name in enumerate(names)])
    assert [part.name for part in read_iges(tmp_path / "a.igs")] == names


WRITE = """
import sys
from datetime import datetime
from gtcad.converters.iges import write_iges
from tests.converters.occt import shapes
write_iges(sys.argv[1], shapes.all_parts(), tolerance=2e-5, timestamp=datetime(2024, 2, 29, 12, 34, 56))
"""


def test_equal_input_gives_equal_bytes_in_another_process(written, tmp_path):
    path = tmp_path / "other name.iges"
    environment = os.environ | {"USER": "somebody", "TZ": "Asia/Tokyo"}
    subprocess.run([sys.executable, "-c", WRITE, str(path)], check=True, cwd=ROOT, env=environment)
    assert path.read_bytes() == written.read_bytes()


def test_bytes_are_the_same_with_both_kernels(tmp_path):
    parts = [Part("edge", shapes.circle(), (0.25, 0.5, 0.75)), Part("face", shapes.torus(), (0.5, 0.5, 0.25))]
    write_iges(tmp_path / "a.igs", parts, timestamp=STAMP)
    data = (tmp_path / "a.igs").read_bytes().replace(gtcad.__version__.encode(), b"")
    assert hashlib.sha256(data).hexdigest()[:16] == "abda232ef2152b71"  # from OCCT 7.9.3


def test_nothing_of_machine_user_and_clock_gets_into_the_file(written):
    text = b"".join(section(written, "G")).decode()
    for private in (socket.gethostname(), str(datetime.now().year), "root", str(written.parent)):
        assert private not in text


def test_parameters_of_others_neither_matter_nor_change(written, tmp_path):
    hostile = {
        "write.iges.unit": "INCH",
        "write.iges.header.author": "somebody",
        "xstep.cascade.unit": "M",
        "write.iges.brep.mode": 1,
        "write.convertsurface.mode": 1,
        "write.precision.mode": 1,
        "read.iges.bspline.continuity": 2,
        "read.iges.onlyvisible": 1,
        "read.precision.mode": 1,
        "read.precision.val": 2.5,
    }
    with session.statics(hostile):
        write_iges(tmp_path / "a.igs", shapes.all_parts(), tolerance=2e-5, timestamp=STAMP)
        parts = read_iges(tmp_path / "a.igs")
        for name, value in hostile.items():
            assert session._get_static(name, value) == value, name
    assert (tmp_path / "a.igs").read_bytes() == written.read_bytes()
    assert [part.name for part in parts] == [part.name for part in read_iges(written)]
    assert all(shapes.same(a, b) for a, b in zip(parts, read_iges(written), strict=True))


def test_nothing_is_printed(tmp_path):
    script = (
        "import sys\nfrom gtcad.converters.iges import read_iges, write_iges\n"
        "from tests.converters.occt import shapes\nfrom pathlib import Path\n"
        "path = Path(sys.argv[1])\nwrite_iges(path, shapes.all_parts())\nread_iges(path)\n"
        "text = path.read_bytes()\n"
        "for bad in (b'', b'x', text[:9000], text.replace(b'126,7,4', b'126,9,4'), text[:-81]):\n"
        "    path.write_bytes(bad)\n"
        "    try:\n        read_iges(path)\n        raise SystemExit('was read')\n"
        "    except OSError:\n        pass\n"
    )
    command = [sys.executable, "-c", script, str(tmp_path / "a.igs")]
    run = subprocess.run(command, capture_output=True, cwd=ROOT, check=False)
    assert (run.returncode, run.stdout, run.stderr) == (0, b"", b"")


def test_inches_come_back_in_mm(tmp_path):
    patch = shapes.patch(1)
    back = read_iges(write_foreign(tmp_path / "inch.igs", make_face(patch), "INCH"))
    assert b"4HINCH" in (tmp_path / "inch.igs").read_bytes()
    assert np.abs(back[0].geometry.control_points - patch.control_points).max() < 1e-6


def test_analytic_faces_are_exact_and_say_what_they_were(tmp_path):
    axes = gp.gp_Ax2(gp.gp_Pnt(1, 2, 3), gp.gp_Dir(1, 2, 2))
    solid = kernel_module("BRepPrimAPI").BRepPrimAPI_MakeCylinder(axes, 2.0, 5.0).Shape()
    parts = read_iges(write_foreign(tmp_path / "a.igs", solid))
    kinds = [(part.source, part.trimmed, part.reversed) for part in parts]
    assert kinds == [("SURFACE_OF_REVOLUTION", False, False), ("PLANE", False, False), ("PLANE", False, False)]
    surface = parts[0].geometry
    u = np.linspace(*surface.knots_u[[0, -1]], 20)
    points = surface.evaluate(u[:, None], surface.knots_v) - [1, 2, 3]
    along = points @ (np.array([1, 2, 2]) / 3)
    assert np.abs((points**2).sum(axis=-1) - along**2 - 4).max() < 1e-6


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (None, "no such file"),
        (b"", "is empty"),
        (b"\x00\xff\x00garbage" * 100, "is not a readable IGES file: line 1 belongs to none of its sections"),
        (b"ISO-10303-21;\n", "is not a readable IGES file: line 1 belongs to none"),
        (b" " * 72 + b"S0000001\n", "is not a readable IGES file: a section is missing"),
        (b" " * 72 + b"S0000002\n", "is not a readable IGES file: line 1 is out of sequence"),
    ],
)
def test_bad_files(tmp_path, content, reason):
    path = tmp_path / "bäd.igs"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(FileError, match=reason) as info:
        read_iges(path)
    assert str(info.value).startswith(f"{path}: ")


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9, 0.999])
def test_truncated_files(written, tmp_path, share):
    data = written.read_bytes()
    (tmp_path / "cut.igs").write_bytes(data[: int(share * len(data))])
    with pytest.raises(FileError, match="is not a readable IGES file: "):
        read_iges(tmp_path / "cut.igs")


def test_a_missing_line_is_noticed_in_every_section(written, tmp_path):
    lines = written.read_bytes().splitlines()
    for gone in (0, 1, 5, len(lines) // 2, len(lines) - 1):
        (tmp_path / "gap.igs").write_bytes(b"\n".join(lines[:gone] + lines[gone + 1 :]))
        with pytest.raises(FileError, match="is not a readable IGES file: "):
            read_iges(tmp_path / "gap.igs")


def test_a_curve_that_the_kernel_drops_is_noticed(written, tmp_path):
    lines = written.read_bytes().splitlines()
    first = next(i for i, line in enumerate(lines) if line[72:73] == b"P")
    lines[first] = lines[first].replace(b"0.0000000000000000E+00", b"7.0000000000000000E+00", 1)
    (tmp_path / "a.igs").write_bytes(b"\n".join(lines) + b"\n")
    with pytest.raises(FileError, match=r"entity 1 \(BSplineCurve\): Knots are not in ascending order"):
        read_iges(tmp_path / "a.igs")


@pytest.mark.parametrize(
    "word", [b"NAN", b"-nan", b"INF", b"-Infinity", b"1.#QNAN", b"3HNAN", b"*", b"$", b"7 8", b"0x1p3"]
)
def test_words_among_the_numbers_are_refused(tmp_path, word):
    """The kernel puts other numbers in their place without a word."""
    replaced_pole(tmp_path / "a.igs", word)
    message = rf"is not a readable IGES file: entity \d+ holds '{re.escape(word.decode())}' for a number"
    for read in (read_iges, lambda path: readiness_of_file(str(path), "IGES")):
        with pytest.raises(FileError, match=message):
            read(tmp_path / "a.igs")


@pytest.mark.parametrize("number", [b"1.D0000100", b"1E+100", b"-2.5D999", b"1.e+99999"])
def test_infinite_and_huge_numbers_are_refused(tmp_path, number):
    replaced_pole(tmp_path / "a.igs", number)
    for read in (read_iges, lambda path: readiness_of_file(str(path), "IGES")):
        with pytest.raises(FileError, match="holds a number of 1e\\+100 or more"):
            read(tmp_path / "a.igs")


@pytest.mark.parametrize(("number", "value"), [(b".5", 0.5), (b"-.5D+1", -5.0), (b"+7.", 7.0), (b"7", 7.0), (b"", 0.0)])
def test_numbers_may_be_written_in_many_ways(tmp_path, number, value):
    replaced_pole(tmp_path / "a.igs", number)
    (part,) = read_iges(tmp_path / "a.igs")
    assert part.geometry.control_points[1, 0] == value


def replaced_pole(path, number):
    """A line whose second pole begins with something else than 3."""
    write_iges(path, [Part("a", BSplineCurve([[0, 0, 1], [3, 0, 1], [5, 2, 1]], [0, 1], [3, 3], 2))], timestamp=STAMP)
    lines = path.read_bytes().splitlines()
    (place,) = (i for i, line in enumerate(lines) if line[72:73] == b"P" and b"3.0000000000000000E+00" in line)
    text = lines[place][:64].replace(b"3.0000000000000000E+00", number)
    lines[place] = text.rstrip().ljust(64) + lines[place][64:]
    path.write_bytes(b"\n".join(lines) + b"\n")


def test_numbers_of_lines_and_names_are_no_huge_numbers(tmp_path):
    names = [f"rev {k}E500" for k in range(120)]
    curves = [shapes.curve(k) for k in range(120)]
    write_iges(tmp_path / "a.igs", [Part(*both) for both in zip(names, curves, strict=True)])
    assert b"0D0000101" in (tmp_path / "a.igs").read_bytes()
    parts = read_iges(tmp_path / "a.igs")
    assert [part.name for part in parts] == names
    for part, curve in zip(parts, curves, strict=True):
        assert np.array_equal(part.geometry.control_points, curve.control_points)


def test_other_delimiters(tmp_path):
    replaced_pole(tmp_path / "a.igs", b"7.")
    lines = (tmp_path / "a.igs").read_bytes().splitlines()
    start = next(i for i, line in enumerate(lines) if line[72:73] == b"G")
    changed = [
        line[:64].replace(b",", b"/").replace(b";", b"!") + line[64:] if line[72:73] == b"P" else line for line in lines
    ]
    fields = b"".join(line[:72] for line in lines if line[72:73] == b"G").rstrip()
    assert fields.startswith(b",,")
    fields = b"1H//1H!/" + fields[2:].replace(b",", b"/").replace(b";", b"!")
    count = sum(line[72:73] == b"G" for line in lines)
    new = [fields[72 * k : 72 * k + 72].ljust(72) + b"G%07d" % (k + 1) for k in range(-(-len(fields) // 72))]
    changed[start : start + count] = new
    changed[-1] = (
        changed[-1].replace(b"G%7d" % count, b"G%7d" % len(new)).replace(b"G%07d" % count, b"G%07d" % len(new))
    )
    (tmp_path / "b.igs").write_bytes(b"\n".join(changed) + b"\n")
    (part,) = read_iges(tmp_path / "b.igs")
    assert part.geometry.control_points[1, 0] == 7.0


def test_directory_and_parameters_must_agree(written, tmp_path):
    lines = written.read_bytes().splitlines()
    first = next(i for i, line in enumerate(lines) if line[72:73] == b"D")
    lines[first] = lines[first][:8] + b"       9" + lines[first][16:]
    (tmp_path / "a.igs").write_bytes(b"\n".join(lines) + b"\n")
    with pytest.raises(FileError, match="entity 1 has other parameters than its directory says"):
        read_iges(tmp_path / "a.igs")


@pytest.mark.parametrize(
    ("parts", "options", "message"),
    [
        ([], {}, "at least one part, got none"),
        ([Part("a", shapes.curve(1))], {"tolerance": -1.0}, "tolerance must be a positive number of mm, got -1.0"),
        ([Part("dot", BSplineCurve([[0, 0], [0, 0]], [0, 1], [2, 2], 1))], {}, r"part 0 \('dot'\): the curve must be"),
    ],
)
def test_bad_input_leaves_the_old_file_and_nothing_else(tmp_path, parts, options, message):
    path = tmp_path / "a.igs"
    path.write_text("old")
    with pytest.raises(InputError, match=message):
        write_iges(path, parts, **options)
    assert [p.name for p in tmp_path.iterdir()] == ["a.igs"]
    assert path.read_text() == "old"
