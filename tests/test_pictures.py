from __future__ import annotations

import math
import re
import struct
import subprocess
import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib import figure, image

from gtcad import BERNSTEIN, Composite, Curve
from gtcad.combs import gamma_study
from gtcad.continuity import join_curve
from gtcad.converters.bspline import BSplineCurve
from gtcad.converters.fit import fit_curve
from gtcad.differential import curvature
from gtcad.errors import ExtraMissing, FileError, InputError
from gtcad.pictures import draw_comb, draw_gamma_study

PLANE = Curve([[0, 0], [20, 80], [80, -60], [100, 20]], (0.8, -0.7))
SPACE = Curve([[0, 0, 0], [30, 70, 20], [70, -20, 60], [100, 30, 80]], (-0.6, 0.4))
REST = [[130, 30], [150, 0], [160, 10]]
CHAIN = Composite((PLANE, join_curve(PLANE, 4, order="G1", scale=(1.3, 0.0, 0.0), rest=REST)), ("G1",))
CURVES = {"plane": PLANE, "space": SPACE, "chain": CHAIN}
TEETH = 30
SVG = "{http://www.w3.org/2000/svg}"


def groups(path: Path) -> dict[str, list[Any]]:
    """The groups of an SVG by what they are called."""
    found: dict[str, list[Any]] = {}
    for group in ElementTree.parse(path).getroot().iter(f"{SVG}g"):
        found.setdefault(group.get("id", ""), []).append(group)
    return found


def strokes(group: Any) -> list[list[tuple[float, float]]]:
    """The connected lines of a group, in points of the page, y downwards."""
    lines: list[list[tuple[float, float]]] = []
    for path in group.iter(f"{SVG}path"):
        words = path.get("d").split()
        for command, x, y in zip(words[::3], words[1::3], words[2::3], strict=True):
            if command == "M":
                lines.append([])
            lines[-1].append((float(x), float(y)))
    return lines


def marks(group: Any) -> list[tuple[float, float]]:
    return [(float(use.get("x")), float(use.get("y"))) for use in group.iter(f"{SVG}use")]


def distance(place: tuple[float, float], line: list[tuple[float, float]]) -> float:
    """From the nearest point of a polyline."""
    starts, ends = np.array(line[:-1]), np.array(line[1:])
    along = ends - starts
    share = np.clip(((place - starts) * along).sum(axis=1) / np.maximum((along**2).sum(axis=1), 1e-300), 0, 1)
    return float(np.hypot(*(starts + share[:, None] * along - place).T).min())


def png_size(path: Path) -> tuple[int, int]:
    data = path.read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    return struct.unpack(">II", data[16:24])  # type: ignore[return-value]


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("drawn")
    for name, curve in CURVES.items():
        draw_comb(curve, folder / f"{name}.svg", title="Wing root", teeth=TEETH)
    return {name: folder / f"{name}.svg" for name in CURVES}


# Files


@pytest.mark.parametrize("name", ["chain", "space"])
def test_a_png_shows_something_in_colour(name: str, tmp_path: Path) -> None:
    draw_comb(CURVES[name], path := tmp_path / "comb.png", title="A title")
    width, height = png_size(path)
    assert 800 <= width <= 2000
    assert 800 <= height <= 2000
    assert 20_000 < path.stat().st_size < 600_000
    pixels = image.imread(path)[..., :3]
    white = (pixels == 1).all(axis=-1).mean()
    assert 0.5 < white < 0.98
    for colour in ((0x00, 0x72, 0xB2), (0xE6, 0x9F, 0x00)):  # the curve and its comb
        assert (np.abs(pixels * 255 - colour).max(axis=-1) < 8).sum() > 300


@pytest.mark.parametrize("suffix", [".PNG", ".svg"])
def test_equal_input_gives_equal_bytes(suffix: str, tmp_path: Path) -> None:
    first, second = tmp_path / f"a{suffix}", tmp_path / f"b{suffix}"
    draw_comb(SPACE, first)
    with mpl.rc_context({"lines.linewidth": 9, "font.size": 30, "svg.hashsalt": "other", "figure.facecolor": "red"}):
        before = dict(mpl.rcParams)
        draw_comb(SPACE, second)
        assert dict(mpl.rcParams) == before
    assert first.read_bytes() == second.read_bytes()
    assert b"date" not in first.read_bytes().lower()


def test_the_state_of_pyplot_is_left_alone(tmp_path: Path) -> None:
    code = (
        "import sys; from gtcad import Curve; from gtcad.pictures import draw_comb; "
        "print('matplotlib' in sys.modules); draw_comb(Curve([[0, 0], [1, 1], [2, 0]]), 'a.svg'); "
        "print('matplotlib.pyplot' in sys.modules)"
    )
    ran = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (ran.stdout.split(), ran.returncode) == (["False", "False"], 0), ran.stderr


# What is drawn


def test_a_plane_curve_has_its_comb_polygon_and_extremes(drawn: dict[str, Path]) -> None:
    found = groups(drawn["plane"])
    assert len(strokes(found["comb"][0])) == TEETH
    assert all(len(tooth) == 2 for tooth in strokes(found["comb"][0]))
    assert len(marks(found["polygon"][0])) == 4
    for kind, count in (("maximum", 2), ("inflection", 1)):
        on_curve, on_graph = found[f"extremes-{kind}"]
        assert len(marks(on_curve)) == len(marks(on_graph)) == count
    assert {"curve", "envelope", "curvature"} <= set(found)
    assert not {"torsion", "joints", "extremes-minimum"} & set(found)


def test_marks_lie_on_the_curve_and_on_the_graph(drawn: dict[str, Path]) -> None:
    found = groups(drawn["plane"])
    for kind in ("maximum", "inflection"):
        for group, line in zip(found[f"extremes-{kind}"], (found["curve"][0], found["curvature"][0]), strict=True):
            (whole,) = strokes(line)
            assert max(distance(place, whole) for place in marks(group)) < 0.5
    (curve,), peaks = strokes(found["curvature"][0]), marks(found["extremes-maximum"][1])
    heights = sorted(y for _, y in curve)
    assert sorted(y for _, y in peaks) == pytest.approx([heights[0], heights[-1]], abs=0.1)


def test_axes_have_one_scale(tmp_path: Path) -> None:
    square = Curve([[0, 0], [10, 0], [10, 10]])  # the quarter of a circle: as wide as high
    draw_comb(square, path := tmp_path / "a.svg", extremes=False)
    width, height = np.ptp(np.array(strokes(groups(path)["curve"][0])[0]), axis=0)
    assert width == pytest.approx(height, rel=1e-4)


def test_a_joint_is_marked_and_its_jump_drawn(drawn: dict[str, Path]) -> None:
    found = groups(drawn["chain"])
    assert len(marks(found["joints"][0])) == 1
    assert len(strokes(found["comb"][0])) in (TEETH + 1, TEETH + 2)
    assert len(found["polygon"]) == 2
    (graph,) = strokes(found["curvature"][0])
    steps = [abs(b[1] - a[1]) for a, b in pairwise(graph) if a[0] == b[0]]
    assert max(steps) > 3


def test_a_space_curve_has_torsion(drawn: dict[str, Path]) -> None:
    found = groups(drawn["space"])
    assert {"curve", "envelope", "polygon", "curvature", "torsion", "extremes-maximum"} <= set(found)
    assert len(strokes(found["comb"][0])) == TEETH


def test_labels_carry_the_unit_and_what_is_not_wanted_is_not_drawn(drawn: dict[str, Path], tmp_path: Path) -> None:
    text = drawn["space"].read_text()
    for label in ("x (mm)", "z (mm)", "arc length (mm)", "curvature (1/mm)", "torsion (1/mm)", "Wing root"):
        assert f"<!-- {label} -->" in text
    assert "<dc:title>Wing root</dc:title>" in text
    draw_comb(PLANE, path := tmp_path / "a.svg", unit="in", polygon=False, extremes=False)
    assert "<!-- curvature (1/in) -->" in path.read_text()
    assert not re.findall("<!-- .*mm.* -->", path.read_text())
    assert not [name for name in groups(path) if name.startswith(("polygon", "extremes"))]


def test_teeth_are_as_long_as_the_scale_says(tmp_path: Path) -> None:
    draw_comb(PLANE, path := tmp_path / "a.svg", scale=400.0, extremes=False)
    found = groups(path)
    chord = math.dist(*(strokes(found["curve"][0])[0][k] for k in (0, -1))) / math.hypot(100, 20)
    longest = max(math.dist(tooth[0], tooth[1]) for tooth in strokes(found["comb"][0])) / chord
    assert longest == pytest.approx(400 * float(curvature(PLANE, np.linspace(0, 1, 2001)).max()), rel=1e-2)


@pytest.mark.parametrize(
    ("curve", "joints"),
    [
        (fit_curve(PLANE, tolerance=1e-3).spline, 0),
        (BSplineCurve([[0, 0], [1, 2], [3, 2], [4, -1]], [2, 3, 5], [3, 1, 3], 2), 1),
        (Curve([[0, 0], [1, 1], [3, 3]]), 0),
        (Curve([[0, 0, 0], [1, 1, 1], [3, 3, 3]]), 0),
        (Curve([[0, 0, 0], [60, 90, 0], [100, 0, 0]]), 0),
        (Curve([[0, 0], [0, 0], [1 / 3, 0], [1, 1]], family=BERNSTEIN), 0),
    ],
    ids=["fit", "rough spline", "line", "line in space", "flat in space", "cusp"],
)
def test_curves_of_every_kind(curve: Any, joints: int, tmp_path: Path) -> None:
    draw_comb(curve, path := tmp_path / "a.svg")
    found = groups(path)
    assert {"curve", "comb", "curvature"} <= set(found)
    assert len(marks(found["joints"][0]) if joints else found.get("joints", [])) == joints
    assert "nan" not in "".join(element.get("d", "") for element in ElementTree.parse(path).iter(f"{SVG}path"))


def test_the_extremes_of_a_spline_are_those_of_its_curve(tmp_path: Path) -> None:
    places = []
    for curve in (PLANE, fit_curve(PLANE, tolerance=1e-4).spline):
        draw_comb(curve, path := tmp_path / "a.svg", polygon=False)
        found = groups(path)
        places.append([place for kind in ("maximum", "inflection") for place in marks(found[f"extremes-{kind}"][0])])
    assert np.array(places[1]) == pytest.approx(np.array(places[0]), abs=1.0)


# Studies


def test_a_study_shows_every_curve_and_its_figures(tmp_path: Path) -> None:
    study = gamma_study(PLANE, gamma_1=[-0.5, 0.5], gamma_2=[-1, 0, 1])
    draw_gamma_study(study, path := tmp_path / "a.svg", teeth=25)
    found = groups(path)
    assert [len(found[name]) for name in ("curve", "comb", "polygon", "family")] == [6, 6, 6, 36]
    assert all(len(strokes(group)) == 25 for group in found["comb"])
    text = path.read_text()
    for variant in study.variants:
        assert f"L = {variant.length:.4g} mm,  E = {variant.curvature_energy:.3g} / mm" in text
    for curve, group in zip(study.curves, found["curve"], strict=True):
        width, height = np.ptp(curve.evaluate(np.linspace(0, 1, 4001)), axis=0)
        drawn_width, drawn_height = np.ptp(np.array(strokes(group)[0]), axis=0)
        assert drawn_height / drawn_width == pytest.approx(height / width, rel=5e-3)


def test_a_study_of_a_curve_has_nine(tmp_path: Path) -> None:
    title = "costs $5 -- or <$x_> & more\nin two lines"
    draw_gamma_study(Curve([[0, 0], [60, 90], [100, 0]]), path := tmp_path / "a.svg", extremes=False, title=title)
    assert len(groups(path)["curve"]) == 9


def test_a_study_in_space(tmp_path: Path) -> None:
    draw_gamma_study(gamma_study(SPACE, gamma_1=[0, 1], gamma_2=[0]), path := tmp_path / "a.png", title="Space")
    width, height = png_size(path)
    assert min(width, height) > 500


# Refusals leave nothing behind


@pytest.mark.parametrize("name", ["a.pdf", "a", "a.svgz", ".png"])
def test_other_formats_are_refused(name: str, tmp_path: Path) -> None:
    for draw in (draw_comb, draw_gamma_study):
        with pytest.raises(InputError, match=r"must end in \.png or \.svg, got"):
            draw(PLANE, tmp_path / name)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("text", ["a\x00b", "\x07", "\ud800"])
def test_texts_that_no_file_can_hold_are_refused(text: str, tmp_path: Path) -> None:
    for name in ("title", "unit"):
        with pytest.raises(InputError, match=f"{name} must consist of printable characters"):
            draw_comb(PLANE, tmp_path / "a.svg", **{name: text})
    assert not list(tmp_path.iterdir())


def test_a_study_too_large_is_refused(tmp_path: Path) -> None:
    study = gamma_study(Curve([[1, 0], [1, 1], [0, 1]]), gamma_1=[0], gamma_2=[0])
    with pytest.raises(InputError, match="1 to 49 curves, got 50"):
        draw_gamma_study(replace(study, variants=study.variants * 50), tmp_path / "a.png")
    assert not list(tmp_path.iterdir())


def test_paths_that_cannot_be_written_are_refused(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="cannot be written"):
        draw_comb(PLANE, tmp_path / "none" / "a.png")
    (tmp_path / "folder.svg").mkdir()
    with pytest.raises(FileError, match="is a folder"):
        draw_comb(PLANE, tmp_path / "folder.svg")
    assert [path.name for path in tmp_path.iterdir()] == ["folder.svg"]


def test_a_full_disk_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.png").write_text("before")

    def fail(self: object, path: Path, **options: object) -> None:
        Path(path).write_text("half")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(figure.Figure, "savefig", fail)
    with pytest.raises(FileError, match="No space left"):
        draw_comb(PLANE, tmp_path / "a.png")
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [("a.png", "before")]


def test_a_missing_matplotlib_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(ExtraMissing, match=r"matplotlib.*pip install 'gtcad\[plot\]'"):
        draw_comb(PLANE, tmp_path / "a.png")
    assert not list(tmp_path.iterdir())
