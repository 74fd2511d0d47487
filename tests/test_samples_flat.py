"""The developable samples: their flat patterns against an unfolding of triangles, and the pictures of the page."""

from __future__ import annotations

import math
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import gtcad
from gtcad import measure
from gtcad.converters.unroll import unroll_model
from gtcad.flat_pattern import FlatPattern, develop
from gtcad.flat_strip import develop_strip
from gtcad.model import Model
from gtcad.patches.developable import GeodesicDevelopable
from gtcad.quilt import Quilt
from tests.unfolding import unfolded

ROOT = Path(__file__).parents[1]
SAMPLES = ("hopper", "hull-plate", "paper-lamp", "shoe-upper")
TRIANGLES = 100_000

each_sample = pytest.mark.parametrize("sample", SAMPLES)


def model_of(sample: str) -> Model:
    return gtcad.load_model(ROOT / "samples" / f"{sample}.toml")


def patterns_of(sample: str) -> list[FlatPattern]:
    """The patterns of a sample's patches, of shapes alike the first one; those of a strip where they lie."""
    model = model_of(sample)
    shape: Any = next(model[name] for name in model if name not in model.construction)
    return list(develop_strip(shape).patterns) if isinstance(shape, Quilt) else [develop(shape)]


@each_sample
def test_triangles_laid_flat_agree_with_the_pattern(sample: str) -> None:
    """Distances between the corners and points of both rims, from lengths of edges alone."""
    patterns = patterns_of(sample)
    t = np.linspace(0, 1, TRIANGLES // 2 // len(patterns) + 1)
    for pattern in patterns:
        a, b = (pattern.patch.evaluate(t, v) for v in (0.0, 1.0))
        size = float(np.ptp(np.concatenate([a, b]), axis=0).max())
        # the end with the longer ruling is unfolded first: the other one may be a point
        flat = np.stack(unfolded(a, b))[:, :: len(t) // 20].reshape(-1, 2)
        own = np.stack([pattern.point(t, v) for v in (0.0, 1.0)])[:, :: len(t) // 20].reshape(-1, 2)
        apart = [np.linalg.norm(points[:, None] - points, axis=2) for points in (flat, own)]
        np.testing.assert_allclose(apart[0], apart[1], atol=1e-6 * size)


@each_sample
def test_lengths_and_areas_are_those_of_the_surface(sample: str) -> None:
    for pattern in patterns_of(sample):
        assert pattern.area == pytest.approx(measure.area(pattern.patch), rel=1e-9)
        for flat, space in pattern.loss.lengths.values():
            assert flat == pytest.approx(space, rel=1e-9, abs=1e-11)
        assert pattern.overlap is None


@each_sample
def test_everything_unrolls_with_its_markings(sample: str) -> None:
    model = model_of(sample)
    found = list(unroll_model(model, tolerance=0.01, bend_lines=12))
    assert all(one.sheet is not None for one in found)
    rows = [one.as_data() for one in found]
    assert sum(row["holes"] + row["marks"] for row in rows) == len(model.markings) > 0
    assert max(row["deviation"] for row in rows) <= 0.01
    assert max(row["strain"] for row in rows) < 1e-9


def test_the_hopper_has_no_creases_and_one_seam() -> None:
    hopper = model_of("hopper")["hopper"]
    assert isinstance(hopper, Quilt)
    strip = develop_strip(hopper)
    assert len(strip.patterns) == 9
    assert strip.creases == ()
    seam = math.dist((0, -150, 0), (0, -100, 300))
    rims = 2 * (400 + 300) + 2 * math.pi * 100
    assert math.fsum(curve.length for curve in strip.contour) == pytest.approx(rims + 2 * seam, rel=1e-12)


def test_the_gores_of_the_lamp_share_their_edges() -> None:
    model = model_of("paper-lamp")
    gores: list[Any] = [model[f"gore {k}"] for k in range(1, 7)]
    t = np.linspace(0, 1, 33)
    for gore, following in zip(gores, gores[1:] + gores[:1], strict=True):
        np.testing.assert_allclose(gore.evaluate(t, 1.0), following.evaluate(t, 0.0), atol=1e-6)


def test_the_topline_of_the_shoe_becomes_straight() -> None:
    left, right = patterns_of("shoe-upper")
    assert isinstance(left.patch, GeodesicDevelopable)
    t = np.linspace(0, 1, 33)
    points = np.concatenate([pattern.point(t, 0.0) for pattern in (left, right)])
    spread = np.linalg.svd(points - points.mean(axis=0))[1]
    assert spread[1] < 1e-9 * spread[0]
    ends = np.linalg.norm(points[:, None] - points, axis=2).max()
    assert ends == pytest.approx(2 * measure.length(left.patch.boundary("v0")), rel=1e-10)


def test_the_side_of_the_boat_lies_in_its_bounding_planes() -> None:
    side: Any = model_of("hull-plate")["side"]
    t = np.linspace(0, 1, 33)
    for v, plane in ((0.0, side.bound_a), (1.0, side.bound_b)):
        np.testing.assert_allclose(side.evaluate(t, v) @ plane[:3], plane[3], atol=1e-12)


def script(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(ROOT / "samples" / "unroll.py"), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_pictures_are_drawn_and_are_those_of_the_page(tmp_path: Path) -> None:
    result = script("--output", tmp_path)
    assert (result.returncode, result.stderr) == (0, "")
    page = (ROOT / "docs" / "developables.md").read_text(encoding="utf-8")
    shown = {Path(name).name for name in re.findall(r"!\[[^]]+\]\((images/flat-\S+)\)", page)}
    assert shown == {path.name for path in tmp_path.iterdir()}
    for name in shown:
        kept = ROOT / "docs" / "images" / name
        assert kept.stat().st_size < 150_000
        pictures = [np.asarray(Image.open(path).convert("L"), float) for path in (kept, tmp_path / name)]
        assert pictures[0].shape == pictures[1].shape
        assert np.abs(pictures[0] - pictures[1]).mean() < 2  # other versions of matplotlib set type otherwise


def test_a_picture_that_there_is_not_is_refused(tmp_path: Path) -> None:
    result = script("--output", tmp_path / "none", "visor")
    assert result.returncode == 2
    assert "no such picture: visor" in result.stderr
    assert not (tmp_path / "none").exists()
