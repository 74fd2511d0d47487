"""The command ``gtcad unroll``, and the markings of model files."""

from __future__ import annotations

import json
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import ezdxf
import numpy as np
import pytest
from typer.testing import CliRunner

import gtcad
from gtcad import BERNSTEIN, Curve, Quilt, Solid, Surface, cli
from gtcad._markings import Marking
from gtcad.conics import circle
from gtcad.errors import InputError, ModelError
from gtcad.flat_pattern import develop
from gtcad.model import Model, schema
from gtcad.patches import Ruled, cone, cylinder
from tests.hopper import hopper

QUARTER = Curve([[4, 0, 0], [4, 4, 0], [0, 4, 0]])
CONE = cone(QUARTER, [0, 0, 9], (0, 0.7))
SLOT, ARROW = circle([0.5, 0.4], 0.2), Curve([[0.1, 0.1], [0.6, 0.1], [0.8, 0.4]])
BOX = Quilt.recognised(
    [
        cylinder(Curve([[0, 0, 0], [5, 0, 0]], family=BERNSTEIN), [0, 0, 3]),
        cylinder(Curve([[5, 0, 0], [7, 0, 0], [7, 3, 0]]), [0, 0, 3]),
    ],
    names=["front", "side"],
)
SADDLE = Ruled(Curve([[0, 0, 0], [9, 0, 0]], family=BERNSTEIN), Curve([[0, 9, 0], [9, 9, 9]], family=BERNSTEIN))


def model_of(**shapes: Any) -> Model:
    marked = {"slot": SLOT, "arrow": ARROW} | shapes
    markings = [Marking("box.side", "slot", hole=True)] * ("box" in shapes) + [Marking("cone", "arrow")] * (
        "cone" in shapes
    )
    return Model(marked, "cm", construction=frozenset({"slot", "arrow"}), markings=tuple(markings))


@pytest.fixture
def path(tmp_path: Path) -> Path:
    file = tmp_path / "model.toml"
    gtcad.dump_model(model_of(cone=CONE, box=BOX), file)
    return file


def run(*arguments: object) -> Any:
    result = CliRunner().invoke(cli.app, ["unroll", *map(str, arguments)])
    assert "Traceback" not in result.output
    return result


def rows(*arguments: object) -> dict[str, dict[str, Any]]:
    result = run(*arguments, "--json")
    assert result.exit_code == 0, result.output
    return {shape["name"]: shape for shape in json.loads(result.stdout)["shapes"]}


def test_every_surface_and_strip_is_laid_out(path: Path, tmp_path: Path) -> None:
    found = rows(path, "-o", tmp_path / "flat.dxf", "--bend-lines", "6")
    assert list(found) == ["cone", "box"]
    assert found["cone"]["area"] == pytest.approx(100 * develop(CONE).area, rel=1e-12)
    assert found["box"]["patches"] == 2
    assert found["box"]["area"] == pytest.approx(100 * BOX.area(), rel=1e-9)
    assert (found["box"]["holes"], found["cone"]["marks"], found["cone"]["bend_lines"]) == (1, 1, 6)
    for row in found.values():
        assert row["surface_area"] == pytest.approx(row["area"], rel=1e-9)
        assert row["deviation"] <= 0.01
        assert row["strain"] < 1e-9
    space = ezdxf.readfile(tmp_path / "flat.dxf").modelspace()  # type: ignore[attr-defined]
    boxes = [list(group) for _, group in space.doc.groups]
    assert len(boxes) == 2
    spans = []
    for entities in boxes:
        x = [p[0] for e in entities if e.dxf.layer == "CUT" and e.dxftype() == "LINE" for p in (e.dxf.start, e.dxf.end)]
        spans.append((min(x), max(x)))
    assert spans[0][1] < spans[1][0]


def bends_of(path: Path) -> list[Any]:
    """The lines on the layer BEND of a DXF file, from their lower to their upper ends."""
    lines = ezdxf.readfile(path).modelspace().query('LINE[layer=="BEND"]')  # type: ignore[attr-defined]
    return [sorted([(*line.dxf.start,)[:2], (*line.dxf.end,)[:2]], key=lambda point: point[1]) for line in lines]


def test_twelve_rulings_are_bend_lines_unless_another_number_is_asked_for(tmp_path: Path) -> None:
    model, output = tmp_path / "model.json", tmp_path / "flat.dxf"
    gtcad.dump_model({"tube": cylinder(QUARTER, [0, 0, 9])}, model)
    width = 2 * np.pi
    for options, count in (((), 12), (("--bend-lines", "0"), 0), (("--bend-lines", "5"), 5)):
        assert rows(model, "-o", output, *options)["tube"]["bend_lines"] == count
        found = sorted(bends_of(output))
        assert len(found) == count
        for k, line in enumerate(found):  # a tube turns evenly
            x = (k + 0.5) / count * width
            np.testing.assert_allclose(line, [[x, 0], [x, 9]], atol=1e-6)


def test_a_plane_has_no_bend_lines_and_a_fold_of_planes_has_one(tmp_path: Path) -> None:
    model, output = tmp_path / "model.json", tmp_path / "flat.dxf"
    plate = Ruled(*(Curve([[0, y, 0], [9, y, 0]], family=BERNSTEIN) for y in (0, 5)))
    flange = Ruled(*(Curve([[0, 5, z], [9, 5, z]], family=BERNSTEIN) for z in (0, 3)))
    gtcad.dump_model({"plate": plate, "angle": Quilt.recognised([plate, flange])}, model)
    found = rows(model, "-o", output)
    assert [(row["bend_lines"], row["area"]) for row in found.values()] == [(0, 45), (1, pytest.approx(72, rel=1e-12))]
    [fold] = bends_of(output)
    assert np.ptp(fold, axis=0).max() == pytest.approx(9, rel=1e-12)
    rows(model, "-o", output, "--bend-lines", "0")
    assert len(bends_of(output)) == 1  # without its crease the sheet is no angle


def test_bend_lines_are_counted_whole_and_drawn_outside_of_holes(tmp_path: Path) -> None:
    model, output = tmp_path / "model.json", tmp_path / "flat.dxf"
    shapes = {"tube": cylinder(QUARTER, [0, 0, 10]), "slot": circle([0.5, 0.5], 0.3)}
    marking = Marking("tube", "slot", hole=True)
    gtcad.dump_model(Model(shapes, construction=frozenset({"slot"}), markings=(marking,)), model)
    assert rows(model, "-o", output, "--bend-lines", "1")["tube"]["bend_lines"] == 1
    ends = [[point[1] for point in line] for line in sorted(bends_of(output), key=lambda line: line[0][1])]
    np.testing.assert_allclose(ends, [[0, 2], [8, 10]], atol=1e-6)


@pytest.mark.parametrize("suffix", [".dxf", ".svg", ".SVG"])
def test_the_table_and_the_file(path: Path, tmp_path: Path, suffix: str) -> None:
    output = tmp_path / f"flat{suffix}"
    result = run(path, "-o", output, "--tolerance", "0.1um")
    assert result.exit_code == 0
    assert "1 mark" in " ".join(result.stdout.split())
    assert output.stat().st_size > 1000
    assert sorted(file.name for file in tmp_path.iterdir()) == sorted([output.name, "model.toml"])


def test_shapes_can_be_chosen(path: Path, tmp_path: Path) -> None:
    assert list(rows(path, "-o", tmp_path / "flat.svg", "--shape", "box")) == ["box"]
    result = run(path, "-o", tmp_path / "flat.svg", "--shape", "bax")
    assert result.exit_code == 3
    assert "the model has no shape 'bax' to unroll; it has 'cone', 'box'" in result.stderr
    result = run(path, "-o", tmp_path / "flat.svg", "--shape", "slot")
    assert (result.exit_code, "the shape 'slot' is for construction" in result.stderr) == (3, True)


def test_what_is_not_developable_fails_and_writes_nothing(tmp_path: Path) -> None:
    model, output = tmp_path / "model.json", tmp_path / "flat.dxf"
    gtcad.dump_model(model_of(cone=CONE, saddle=SADDLE), model)
    result = run(model, "-o", output)
    assert result.exit_code == 1
    assert (
        "Error: shape 'saddle': the patch is not developable: its tangent plane twists by 45 degrees" in result.stderr
    )
    assert not output.exists()
    assert rows(model, "-o", output, "--shape", "cone")
    assert output.exists()


def test_a_twist_is_allowed_where_it_is_asked_for(tmp_path: Path) -> None:
    model = tmp_path / "model.json"
    gtcad.dump_model({"bent": SADDLE.transformed(np.diag([1, 1, 0.05]))}, model)
    output = tmp_path / "flat.dxf"
    assert run(model, "-o", output).exit_code == 1
    found = rows(model, "-o", output, "--twist", "5")["bent"]
    assert found["twist_deg"] == pytest.approx(np.degrees(np.arctan(0.05)), rel=1e-3)
    assert 1e-5 < found["strain"] < 1e-3
    assert "strain" in run(model, "-o", output, "--twist", "5").stdout


def test_curves_are_left_out_with_a_warning(tmp_path: Path) -> None:
    model = tmp_path / "model.json"
    gtcad.dump_model({"rim": QUARTER, "cone": CONE}, model)
    result = run(model, "-o", tmp_path / "flat.svg")
    assert result.exit_code == 0
    assert "Warning: curves have no flat pattern: 'rim' is left out" in result.stderr
    result = run(model, "-o", tmp_path / "other.svg", "--shape", "rim")
    assert (result.exit_code, "curves have no flat pattern: --shape names 'rim'" in result.stderr) == (3, True)
    gtcad.dump_model({"rim": QUARTER}, model)
    result = run(model, "-o", tmp_path / "other.svg")
    assert (result.exit_code, "no surfaces to unroll" in result.stderr) == (3, True)


def test_a_pattern_over_itself_is_said(tmp_path: Path) -> None:
    model = tmp_path / "model.toml"
    # four triangles around a point with more than a full turn in all: heights alternate
    ring = [[40, 0, 30], [0, 40, -30], [-40, 0, 30], [0, -40, -30], [40, 0, 30]]
    triangles = [cone(Curve([a, b], family=BERNSTEIN), [0, 0, 0]) for a, b in pairwise(ring)]
    gtcad.dump_model({"saddle point": Quilt.recognised(triangles)}, model)
    result = run(model, "-o", tmp_path / "flat.svg")
    assert result.exit_code == 0
    assert "Warning: 'saddle point' lies over itself" in result.stderr


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["-o", "flat.pdf"], 2, "must end in one of .dxf, .svg"),
        (["-o", "flat.svg", "--tolerance", "-1"], 2, "must be"),
        (["-o", "flat.svg", "--bend-lines", "many"], 2, "must be a whole number from 0 to 1000"),
        (["-o", "flat.svg", "--twist", "50"], 2, "must be an angle in degrees from 0 to 45"),
        (["-o", "nowhere/flat.svg"], 3, "there is no folder"),
        (["-o", "flat.svg", "--tolerance", "1e-14"], 1, "tolerance"),
        ([], 2, "Missing option"),
    ],
)
def test_wrong_usage(
    path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], code: int, message: str
) -> None:
    monkeypatch.chdir(path.parent)
    result = run(path, *arguments)
    assert result.exit_code == code
    assert message in " ".join(result.stderr.split())
    assert [file.name for file in path.parent.iterdir()] == ["model.toml"]


def test_the_model_itself_is_not_written_over(path: Path) -> None:
    link = path.with_suffix(".svg")
    link.hardlink_to(path)
    result = run(path, "-o", link)
    assert result.exit_code == 2
    assert "is the model itself" in result.stderr


# --- markings ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", [".toml", ".json"])
def test_markings_come_back(tmp_path: Path, suffix: str) -> None:
    file, model = tmp_path / f"model{suffix}", model_of(cone=CONE, box=BOX)
    gtcad.dump_model(model, file)
    found = gtcad.load_model(file)
    assert found == model
    assert found.markings == (Marking("box.side", "slot", hole=True), Marking("cone", "arrow"))
    assert found != Model(model.shapes, "cm", construction=model.construction)
    assert "marking" in schema()["properties"]


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ('on = "cane"\ncurve = "arrow"', "marking[0].on: must name a surface, or a patch of a quilt, got 'cane'"),
        ('on = "arrow"\ncurve = "arrow"', "marking[0].on: must name a surface"),
        ('on = "cone"\ncurve = "rim"', "marking[0].curve: must name a plane curve of this file, got 'rim'"),
        ('on = "cone"\ncurve = "cone"', "marking[0].curve: must name a plane curve"),
        ('on = "cone"', "marking[0].curve: is missing"),
        ('on = "cone"\ncurve = "arrow"\nhole = 1', "marking[0].hole: must be true or false"),
        (
            'on = "cone"\ncurve = "arrow"\nholes = true',
            "marking[0].holes: is not a field of this format; did you mean hole?",
        ),
    ],
)
def test_markings_that_are_none(tmp_path: Path, fields: str, message: str) -> None:
    file = tmp_path / "model.toml"
    gtcad.dump_model({"cone": CONE, "rim": QUARTER, "arrow": ARROW}, file)
    head, shapes = file.read_text(encoding="utf-8").split("\n\n", 1)
    file.write_text(f"{head}\n\n[[marking]]\n{fields}\n\n{shapes}", encoding="utf-8")
    with pytest.raises(ModelError) as caught:
        gtcad.load_model(file)
    assert message in str(caught.value)


def test_a_model_refuses_markings_that_are_none() -> None:
    with pytest.raises(InputError, match=r"markings\[0\].on must name a surface"):
        Model({"cone": CONE, "arrow": ARROW}, markings=(Marking("none", "arrow"),))


def test_a_marking_that_leaves_its_patch_is_an_error_of_the_model(tmp_path: Path) -> None:
    file = tmp_path / "model.json"
    shapes = {"cone": CONE, "arrow": Curve([[0.5, 0.5], [1.5, 0.5]], family=BERNSTEIN)}
    gtcad.dump_model(Model(shapes, construction=frozenset({"arrow"}), markings=(Marking("cone", "arrow"),)), file)
    result = run(file, "-o", tmp_path / "flat.svg")
    assert result.exit_code == 3
    assert "shape 'cone': marking 'arrow' on 'cone': the curve leaves the patch" in result.stderr


def test_markings_of_what_is_not_unrolled_are_said(tmp_path: Path) -> None:
    """A patch for construction that a quilt is made of: the marking belongs on the quilt's patch."""
    file = tmp_path / "model.toml"
    for on, marks in (("part", 0), ("whole.part", 1)):
        file.write_text(
            f"""gtcad = 1
unit = "mm"
marking = [{{on = "{on}", curve = "seam"}}]
[[shape]]
name = "seam"
kind = "curve"
construction = true
family = "bernstein"
control_points = [[0, 0.1], [1, 0.1]]
[[shape]]
name = "part"
kind = "cylinder"
construction = true
curve = {{control_points = [[40, 0, 0], [40, 40, 0], [0, 40, 0]]}}
vector = [0, 0, 90]
[[shape]]
name = "whole"
kind = "quilt"
patches = ["part"]
""",
            encoding="utf-8",
        )
        result = run(file, "-o", tmp_path / "flat.svg")
        assert result.exit_code == 0
        assert ("Warning: 'seam' is not drawn: 'part' is for construction" in result.stderr) is (marks == 0)
        assert rows(file, "-o", tmp_path / "flat.svg")["whole"]["marks"] == marks


def test_an_open_hole_is_an_error_of_the_model(tmp_path: Path) -> None:
    file = tmp_path / "model.json"
    shapes = {"cone": CONE, "arrow": ARROW}
    markings = (Marking("cone", "arrow", hole=True),)
    gtcad.dump_model(Model(shapes, construction=frozenset({"arrow"}), markings=markings), file)
    result = run(file, "-o", tmp_path / "flat.svg")
    assert (result.exit_code, "shape 'cone': a hole must be a closed curve" in result.stderr) == (3, True)


def test_holes_that_cross_are_an_error_of_the_model(tmp_path: Path) -> None:
    file, output = tmp_path / "model.json", tmp_path / "flat.svg"
    shapes = {"cone": CONE, "slot": SLOT, "other": circle([0.6, 0.5], 0.2)}
    markings = tuple(Marking("cone", name, hole=True) for name in ("slot", "other"))
    gtcad.dump_model(Model(shapes, construction=frozenset({"slot", "other"}), markings=markings), file)
    result = run(file, "-o", output)
    assert (result.exit_code, "shape 'cone': holes must not cross: 1 and 2" in result.stderr) == (3, True)
    assert not output.exists()


def test_a_drawing_without_ezdxf_is_svg(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ezdxf", None)
    result = run(path, "-o", tmp_path / "flat.dxf")
    assert (result.exit_code, "pip install 'gtcad[flat]'" in result.stderr) == (4, True)
    assert run(path, "-o", tmp_path / "flat.svg").exit_code == 0
    assert sorted(file.name for file in tmp_path.iterdir()) == ["flat.svg", "model.toml"]


def test_a_hopper_is_one_sheet(tmp_path: Path) -> None:
    file = tmp_path / "hopper.toml"
    gtcad.dump_model({"hopper": Quilt.recognised(hopper())}, file)
    found = rows(file, "-o", tmp_path / "hopper.dxf", "--bend-lines", "24")["hopper"]
    assert (found["patches"], found["bend_lines"], found["overlap"]) == (9, 24, None)


def test_solids_and_free_surfaces_are_refused_by_name(tmp_path: Path) -> None:
    file = tmp_path / "model.json"
    dome = Surface([[[30 * i, 30 * j, 4 * (i - 1) * (j - 1) ** 2] for j in range(3)] for i in range(3)])
    gtcad.dump_model({"dome": dome, "box": Solid(BOX, thickness=0.2)}, file)
    result = run(file, "-o", tmp_path / "flat.svg")
    assert result.exit_code == 1
    assert "shape 'dome': the patch is straight in neither parameter" in result.stderr
    assert "shape 'box': it is a solid" in result.stderr
