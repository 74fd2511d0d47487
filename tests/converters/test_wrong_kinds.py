"""What the main functions say to a shape or a number that they do not take."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from gtcad import Basis, Composite, Curve, Quilt, Surface, dump_model
from gtcad.combs import comb, gamma_study
from gtcad.conics import circle
from gtcad.continuity import check_join
from gtcad.converters import (
    fit_chain,
    fit_curve,
    fit_offset,
    fit_quilt,
    fit_surface,
    mesh_surface,
    nearest_gt,
    solid_of,
    thicken,
    write_mesh,
)
from gtcad.errors import InputError
from gtcad.objectives import measured
from gtcad.patches import Rotation
from gtcad.queries import nearest

POINTS = [[0, 0, 0], [1, 2, 0], [3, 0, 1]]
CURVE = Curve(POINTS)
CHAIN = circle([0, 0], 1)
PATCH = Surface([[[i, j, i * j] for j in range(3)] for i in range(3)])
QUILT = Quilt.recognised([PATCH])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: fit_curve(PATCH, tolerance=1), "curve must be one curve .*fit_surface surfaces.*, got Surface"),
        (lambda: fit_curve(CHAIN, tolerance=1), "curve must be one curve .*fit_chain takes chains.*, got Arc"),
        (lambda: fit_surface(CURVE, tolerance=1), "surface must be one surface .*, got Curve"),
        (lambda: fit_surface(QUILT, tolerance=1), "surface must be one surface .*fit_quilt.*, got Quilt"),
        (lambda: fit_chain(CURVE, tolerance=1), "chain must be a Composite .*fit_curve.*, got Curve"),
        (lambda: fit_quilt([PATCH], tolerance=1), "quilt must be a Quilt, as Quilt.recognised .*, got list"),
        (lambda: fit_offset(CURVE, tolerance=1), "offset must be an Offset, .*, got Curve"),
        (lambda: solid_of(QUILT), "fit must be a QuiltFit, .*, got Quilt"),
        (lambda: thicken(QUILT, 1, tolerance=1), "fit must be a QuiltFit, .*, got Quilt"),
        (lambda: write_mesh("a.stl", mesh_surface(PATCH, tolerance=1)), "meshes must be a mapping .*, got Mesh"),
        (lambda: dump_model(CURVE, "a.json"), "shapes must be a mapping of names to shapes, got Curve"),
        (lambda: nearest(PATCH, [0, 0, 0]), "curve must be a curve or a chain, got Surface"),
        (lambda: comb(PATCH), "curve must be a curve, a chain or a spline, got Surface"),
        (lambda: gamma_study(CHAIN), "curve must be a Curve, got Arc"),
        (lambda: check_join(CURVE, PATCH), "b must be a curve, a chain or a spline, got Surface"),
        (lambda: measured(CHAIN, "length"), "shape must be a curve, a patch or a family of planes, got Arc"),
        (lambda: Curve(POINTS, family="bernstein"), "family must be a Family, such as gtcad.GT .*, got 'bernstein'"),
        (lambda: Basis(3, family=None), "family must be a Family, .*, got None"),
    ],
)
def test_a_shape_of_another_kind_is_told_by_name(call: Callable[[], Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        call()


@pytest.mark.parametrize(
    "tolerance", [None, "1e-4", [1e-4], pytest.param(10**400, id="huge"), 0, -1.0, float("nan"), float("inf")]
)
@pytest.mark.parametrize(
    "fit",
    [
        lambda tolerance: fit_curve(CURVE, tolerance=tolerance),
        lambda tolerance: fit_surface(PATCH, tolerance=tolerance),
        lambda tolerance: fit_chain(CHAIN, tolerance=tolerance),
        lambda tolerance: fit_quilt(QUILT, tolerance=tolerance),
        lambda tolerance: mesh_surface(PATCH, tolerance=tolerance),
    ],
)
def test_a_tolerance_is_a_number_above_0(fit: Callable[[Any], Any], tolerance: Any) -> None:
    with pytest.raises(InputError, match="tolerance must be a finite number above 0, got "):
        fit(tolerance)


def test_a_design_without_a_tolerance_takes_none_and_refuses_a_text() -> None:
    assert nearest_gt(CURVE, 2).deviation[1] < 1e-9
    with pytest.raises(InputError, match="tolerance must be a finite number above 0, got 'fine'"):
        nearest_gt(CURVE, 2, tolerance="fine")


def test_a_file_is_written_of_parts(tmp_path: Path) -> None:
    pytest.importorskip("OCP")
    from gtcad.converters import write_step

    fit = fit_curve(CURVE, tolerance=1e-3)
    for parts, message in ((fit, "parts must be a sequence"), ([fit], r"parts\[0\] must be a Part: .*, got Fit")):
        with pytest.raises(InputError, match=message):
            write_step(tmp_path / "a.step", parts)
    assert not list(tmp_path.iterdir())


def test_shapes_of_the_right_kind_are_taken_whatever_their_class() -> None:
    assert isinstance(CHAIN, Composite)
    assert fit_chain(CHAIN, tolerance=1).exact
    assert fit_surface(Rotation(CURVE, [0, 0, 0], [0, 0, 1], 90), tolerance=0.1).deviation[1] <= 0.1
