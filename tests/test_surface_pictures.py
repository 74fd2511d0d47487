from __future__ import annotations

import math
import struct
import sys
from pathlib import Path
from xml.etree import ElementTree

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib import image

from gtcad import Curve, Surface, surface_pictures
from gtcad.errors import ExtraMissing, FileError, InputError
from gtcad.factors import CurveOfTerms, Waves
from gtcad.patch_studies import patch_study
from gtcad.patches import Rotation, Swept
from gtcad.quilt import Quilt
from gtcad.surface_pictures import draw_patch_study, draw_surface

MERIDIAN = CurveOfTerms(Waves(-math.pi / 2, math.pi), [[7, 5, 0], [20, 0, 0], [0, 0, 20]])
SPHERE = Rotation(MERIDIAN, [7, 5, 0], [0, 0, 1])
ARCH = Curve([[0, 0, 0], [20, 0, 30], [40, 0, 0]])
SADDLE = Swept(ARCH, Curve([[0, 0, 0], [0, 20, -30], [0, 40, 0]]))
ROOF = Swept(ARCH, Curve([[0, 0, 0], [0, 30, 0], [0, 60, 0]]))


def pixels(path: Path) -> np.ndarray:
    """Colours in [0, 1], shape (rows, columns, 3)."""
    return image.imread(path)[..., :3]


def coloured(picture: np.ndarray, channel: str) -> np.ndarray:
    """Where a picture is clearly red or blue."""
    red, _, blue = np.moveaxis(picture, -1, 0)
    return red - blue > 0.15 if channel == "red" else blue - red > 0.15


def left_of_bar(picture: np.ndarray) -> np.ndarray:
    return picture[:, : int(0.8 * picture.shape[1])]


def texts(path: Path) -> list[str]:
    """What is written in an SVG: matplotlib says it in a comment beside each text."""
    parser = ElementTree.XMLParser(target=ElementTree.TreeBuilder(insert_comments=True))
    return [str(one.text).strip() for one in ElementTree.parse(path, parser).iter(ElementTree.Comment)]


@pytest.fixture
def coarse(monkeypatch):
    """Few faces, where files and texts are looked at."""
    monkeypatch.setattr(surface_pictures, "_FACES", {"one": 8, "study": 8})


# Files


def test_equal_input_gives_equal_bytes(tmp_path, coarse):
    first, second = tmp_path / "a.svg", tmp_path / "b.svg"
    draw_surface(SADDLE, first, colour_by="mean curvature")
    with mpl.rc_context({"font.size": 30, "svg.hashsalt": "other", "figure.facecolor": "red", "image.cmap": "gray"}):
        before = dict(mpl.rcParams)
        draw_surface(SADDLE, second, colour_by="mean curvature")
        assert dict(mpl.rcParams) == before
    assert first.read_bytes() == second.read_bytes()
    assert b"date" not in first.read_bytes().lower()


@pytest.mark.parametrize("turn", [np.eye(3), np.diag([1, 1, 0.1])[[1, 2, 0]], np.diag([0.2, 1, 1])[[2, 0, 1]]])
@pytest.mark.parametrize("shape", [SADDLE, ROOF, SPHERE])
def test_the_labels_of_axes_are_in_the_picture_and_beside_the_colours(tmp_path, coarse, monkeypatch, shape, turn):
    drawn = []
    draw = surface_pictures._draw
    monkeypatch.setattr(surface_pictures, "_draw", lambda *given: (drawn.append(given), draw(*given)))
    draw_surface(shape.transformed(turn), tmp_path / "a.png", colour_by="mean curvature")
    [(figure, [(axes, _)], *_)] = drawn
    renderer = figure.canvas.get_renderer()
    [bar] = [other.get_tightbbox(renderer) for other in figure.axes if other is not axes]
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        label = axis.label.get_window_extent(renderer)
        assert figure.bbox.x0 <= label.x0 < label.x1 <= figure.bbox.x1
        assert figure.bbox.y0 <= label.y0 < label.y1 <= figure.bbox.y1
        assert not label.overlaps(bar)


def test_a_study_is_drawn_the_same_twice(tmp_path, coarse):
    study = patch_study(ROOF, ["profile"], values=[0, 1])
    for name in ("a.png", "b.PNG"):
        draw_patch_study(study, tmp_path / name)
    data = (tmp_path / "a.png").read_bytes()
    assert data == (tmp_path / "b.PNG").read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    width, height = struct.unpack(">II", data[16:24])
    assert 800 <= width <= 1400
    assert 400 <= height <= 1400


def test_files_that_cannot_be(tmp_path, monkeypatch):
    with pytest.raises(InputError, match=r"must end in \.png or \.svg"):
        draw_surface(ROOF, tmp_path / "a.pdf")
    with pytest.raises(FileError, match="cannot be written"):
        draw_surface(ROOF, tmp_path / "no" / "a.png")
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(ExtraMissing, match=r"matplotlib.*pip install 'gtcad\[plot\]'"):
        draw_surface(ROOF, tmp_path / "a.png")
    assert not list(tmp_path.iterdir())


# One surface


def test_a_sphere_is_a_disc_of_one_colour(tmp_path):
    """One scale on all axes, and K = 1/r^2 > 0 everywhere, up to the poles."""
    draw_surface(SPHERE, path := tmp_path / "a.png", colour_by="Gaussian curvature")
    picture = left_of_bar(pixels(path))
    red = coloured(picture, "red")
    height, width = (np.ptp(np.flatnonzero(red.any(axis=axis))) + 1 for axis in (1, 0))
    assert height == pytest.approx(width, rel=0.02)
    assert red.sum() == pytest.approx(math.pi / 4 * height * width, rel=0.1)  # but for the lines
    assert not coloured(picture, "blue").any()


def test_the_sign_of_the_curvature_has_a_colour(tmp_path):
    draw_surface(SADDLE, path := tmp_path / "a.png", colour_by="Gaussian curvature")
    picture = left_of_bar(pixels(path))
    assert coloured(picture, "blue").sum() > 10_000
    assert not coloured(picture, "red").any()


def test_a_developable_surface_is_white(tmp_path):
    draw_surface(ROOF, path := tmp_path / "a.png", colour_by="Gaussian curvature")
    picture = left_of_bar(pixels(path))
    assert not coloured(picture, "blue").any()
    assert not coloured(picture, "red").any()


def test_labels_name_units_and_quantities(tmp_path, coarse):
    draw_surface(SADDLE, path := tmp_path / "a.svg", colour_by="Gaussian curvature", title="Roof $1", unit="in")
    found = texts(path)
    for text in ("x (in)", "y (in)", "z (in)", "Gaussian curvature (1/in\N{SUPERSCRIPT TWO})", "Roof $1"):
        assert text in found
    draw_surface(SADDLE, path)
    assert not [text for text in texts(path) if "curvature" in text]


def test_the_far_side_is_hidden(tmp_path):
    """A wall of positive mean curvature before one of negative: the one behind cannot be seen, lines included."""
    usual = np.array([0.43, -0.75, 0.5])
    across, up = np.cross(usual, [0, 0, 1]), np.cross(usual, np.cross(usual, [0, 0, 1]))
    sheet = [[x * across + y * up for y in (-1, 0, 1)] for x in (-1, 0, 1)]
    front, behind = (20 * np.array(sheet) + offset * usual for offset in (4.0, -4.0))
    small = Surface(0.5 * (behind - behind.mean(axis=(0, 1))) + behind.mean(axis=(0, 1)))
    draw_surface([Surface(front)], alone := tmp_path / "a.png")
    draw_surface([Surface(front), small], both := tmp_path / "b.png")
    inks = [(pixels(path).max(axis=-1) < 0.35).sum() for path in (alone, both)]
    assert inks[1] < 1.1 * inks[0]


def test_a_quilt_has_one_orientation(tmp_path):
    """Halves of a dome with opposite normals: as a quilt of one sign, as a sequence of both."""
    halves = Rotation(MERIDIAN, [7, 5, 0], [0, 0, 1], 180), Rotation(MERIDIAN, [7, 5, 0], [0, 0, 1], -180)
    assert len(set(Quilt.recognised(halves, gap=1e-9).flipped)) == 2
    draw_surface(halves, path := tmp_path / "a.png", colour_by="mean curvature")
    picture = left_of_bar(pixels(path))
    both = [coloured(picture, channel).sum() for channel in ("red", "blue")]
    draw_surface(Quilt.recognised(halves, gap=1e-9), path, colour_by="mean curvature")
    picture = left_of_bar(pixels(path))
    one = [coloured(picture, channel).sum() for channel in ("red", "blue")]
    assert min(both) > 1000
    assert min(one) == 0
    assert max(one) == pytest.approx(sum(both), rel=0.05)


def test_plane_surfaces_are_drawn_too(tmp_path):
    draw_surface(Surface([[[x, y] for y in (0, 1, 2)] for x in (0, 1, 3)]), path := tmp_path / "a.png")
    assert coloured(pixels(path), "blue").sum() > 10_000


def test_wrong_surfaces_are_refused(tmp_path):
    with pytest.raises(InputError, match="there is no surface to draw"):
        draw_surface([], tmp_path / "a.png")
    with pytest.raises(InputError, match=r"surface\[1\] must be a surface, got Curve"):
        draw_surface([ROOF, ARCH], tmp_path / "a.png")
    with pytest.raises(InputError, match=r"surface\[0\] must be a surface, got int"):
        draw_surface(3, tmp_path / "a.png")
    with pytest.raises(InputError, match="colour_by must be one of mean curvature, Gaussian curvature or None"):
        draw_surface(ROOF, tmp_path / "a.png", colour_by="height")


# Studies


def test_the_cells_of_a_study_are_labelled(tmp_path, coarse):
    study = patch_study(ROOF, ("profile", "trajectory[1]"), values=[-0.5, 1])
    draw_patch_study(study, path := tmp_path / "a.svg", colour_by="mean curvature", title="Roofs", unit="cm")
    found = texts(path)
    for gamma in ("(-0.5, -0.5)", "(1, 1)"):
        assert found.count(f"profile = {gamma}") == 2
    for gamma in ("(0, -0.5)", "(0, 1)"):
        assert found.count(f"trajectory = {gamma}") == 2
    for variant in study.variants:
        assert f"A = {variant.area:.4g} cm\N{SUPERSCRIPT TWO}" in found
        assert f"V = {variant.volume:.4g} cm\N{SUPERSCRIPT THREE}" in found
    assert found.count("x (cm)") == 1
    assert "mean curvature (1/cm)" in found
    assert "Roofs" in found


def test_all_patches_of_a_study_have_one_scale_and_one_view(tmp_path):
    """The first variable of a profile in a row: the same foot prints, and roofs the higher the larger it is."""
    draw_patch_study(patch_study(ROOF, "profile[0]", values=[-1, 0, 1]), path := tmp_path / "a.png")
    picture = pixels(path)
    blue = coloured(picture, "blue")
    columns = np.flatnonzero(blue.any(axis=0))
    parts = np.split(columns, np.flatnonzero(np.diff(columns) > 20) + 1)
    assert len(parts) == 3
    widths = [len(part) for part in parts]
    assert max(widths) - min(widths) <= 12
    heights = [np.ptp(np.flatnonzero(blue[:, part].any(axis=1))) for part in parts]
    assert heights[0] < heights[1] < heights[2]


def test_a_study_of_a_patch_is_the_usual_one(tmp_path, coarse):
    draw_patch_study(ROOF, path := tmp_path / "a.svg")
    found = texts(path)
    assert [f"profile = ({a}, {b})" in found for a in (-1, 0, 1) for b in (-1, 0, 1)] == [True] * 9


def test_too_many_patches_are_refused(tmp_path):
    study = patch_study(ROOF, ["profile"], values=[0.0])
    crowded = type(study)(study.axes, (tuple(np.linspace(-1, 1, 50)),), study.variants * 50)
    with pytest.raises(InputError, match="a picture holds 1 to 49 patches, got 50"):
        draw_patch_study(crowded, tmp_path / "a.png")
