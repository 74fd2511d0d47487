"""Solids: what closes them, what they measure, and how they move."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from gtcad import BERNSTEIN, Curve
from gtcad.errors import InputError
from gtcad.patches import Rotation
from gtcad.quilt import Quilt, SharedEdge, Use
from gtcad.solid import Solid
from tests.converters import bodies

TURN = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]


def quilt(patches: Any, **options: Any) -> Quilt:
    return Quilt.recognised(patches, **options)


@pytest.mark.parametrize(
    ("patches", "caps", "volume", "area", "loops"),
    [
        (bodies.box(), "none", 6000, 2200, 0),
        (bodies.box()[:5], "planar", 6000, 2200, 1),
        ([bodies.box()[k] for k in (0, 1, 4, 5)], "planar", 6000, 2200, 2),
        ([bodies.sphere()], "planar", 32 * math.pi / 3, 16 * math.pi, 0),
        ([bodies.cylinder()], "planar", 12 * math.pi, 20 * math.pi, 2),
        (bodies.cylinder().quarters(), "planar", 12 * math.pi, 20 * math.pi, 2),
        ([bodies.torus()], "none", 40 * math.pi**2, 40 * math.pi**2, 0),
    ],
    ids=["box", "no lid", "sleeve", "sphere", "can", "quarters of a can", "torus"],
)
@pytest.mark.parametrize("matrix", [np.eye(3), TURN, -TURN])
def test_volume_and_area_of_what_caps_close(
    patches: Any, caps: Any, volume: float, area: float, loops: int, matrix: Any
) -> None:
    solid = Solid(quilt(patches), caps).transformed(matrix, [5, -6, 7])
    assert len(solid.loops) == loops
    assert solid.closed.closed
    assert solid.volume() == pytest.approx(volume, rel=1e-11)
    assert solid.closed.area() == pytest.approx(area, rel=1e-9)


def test_the_volume_under_a_cap_that_is_not_seen_from_its_middle() -> None:
    """An L-shaped prism: the divergence theorem does not mind, the area of the fan counts parts twice."""
    corners = np.array([[0, 0], [30, 0], [30, 1], [1, 1], [1, 30], [0, 30]])
    walls = [
        bodies.bilinear([[[*a, 0], [*a, 4]], [[*b, 0], [*b, 4]]])
        for a, b in zip(corners.tolist(), np.roll(corners, -1, axis=0).tolist(), strict=True)
    ]
    solid = Solid(quilt(walls), "planar")
    assert [len(loop) for loop in solid.loops] == [6, 6]
    assert solid.volume() == pytest.approx(4 * 59, rel=1e-12)
    assert solid.closed.area() >= 4 * 120 + 2 * 59 - 1e-9


def test_a_closed_quilt_is_its_own_boundary() -> None:
    whole = quilt([bodies.sphere()])
    assert Solid(whole).closed is whole
    assert Solid(whole, "planar").closed is whole
    assert Solid(whole).loops == ()


def test_walls_have_no_volume_of_the_full_body() -> None:
    assert Solid(quilt([bodies.sphere()]), thickness=0.5).volume() is None
    assert Solid(quilt([bodies.cylinder()]), "planar", 0.5).volume() is None


def test_loops_with_gaps_have_no_exact_volume() -> None:
    """The fans of the caps do not meet there."""
    first, second, third, fourth = bodies.cylinder().quarters()
    apart = [first, second.transformed(np.eye(3), [1e-6, 0, 0]), third, fourth]
    stated = [
        SharedEdge(Use(0, "v1"), Use(1, "v0"), False),
        SharedEdge(Use(1, "v1"), Use(2, "v0"), False),
    ]
    assert Solid(quilt(apart, stated=stated, gap=1e-5), "planar").volume() is None


def test_loops_of_turned_and_reversed_sides() -> None:
    half = Rotation(Curve([[2, 0, 0], [2, 0, 3]], family=BERNSTEIN), [0, 0, 0], [0, 0, 1], 180)
    back = half.transformed(np.diag([1.0, -1.0, 1.0]))
    solid = Solid(quilt([half, back]), "planar")
    assert solid.volume() == pytest.approx(12 * math.pi, rel=1e-12)


@pytest.mark.parametrize(("matrix", "factor"), [(2 * np.eye(3), 2), (3 * TURN, 3), (-25.4 * np.eye(3), 25.4)])
def test_walls_keep_their_side_and_scale_with_the_body(matrix: Any, factor: float) -> None:
    mirrored = np.linalg.det(matrix) < 0
    closed = Solid(quilt([bodies.sphere()]), thickness=0.25).transformed(matrix)
    assert closed.thickness == pytest.approx(0.25 * factor, rel=1e-14)  # outwards stays outwards
    sheet = Solid(quilt([bodies.cylinder()]), thickness=0.25)
    moved = sheet.transformed(matrix)
    assert moved.thickness == pytest.approx((-0.25 if mirrored else 0.25) * factor, rel=1e-14)
    # along the normal of the first patch: the point that the wall reaches is the image of the one it reached
    inner = sheet.quilt.patches[0].evaluate(0.5, 0.25)
    reached = matrix @ (inner + 0.25 * normal(sheet))
    there = moved.quilt.patches[0].evaluate(0.5, 0.25) + moved.thickness * normal(moved)
    assert there == pytest.approx(reached, abs=1e-9 * factor)


def normal(solid: Solid) -> Any:
    patch = solid.quilt.patches[0]
    across = np.cross(patch.derivative(0.5, 0.25, (1, 0)), patch.derivative(0.5, 0.25, (0, 1)))
    unit = across / np.linalg.norm(across)
    return -unit if solid.quilt.flipped[0] else unit


def test_a_wall_is_not_stretched_unevenly() -> None:
    with pytest.raises(InputError, match="a wall can only be moved by a similarity"):
        Solid(quilt([bodies.sphere()]), thickness=1.0).transformed(np.diag([1, 1, 2]))
    stretched = Solid(quilt([bodies.sphere()])).transformed(np.diag([1, 1, 2]))
    assert stretched.volume() == pytest.approx(64 * math.pi / 3, rel=1e-11)


def test_bad_arguments_are_refused() -> None:
    whole, tube = quilt([bodies.sphere()]), quilt([bodies.cylinder()])
    with pytest.raises(InputError, match='caps must be "none" or "planar", got \'round\''):
        Solid(whole, "round")  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"closed, capped or thickened; these sides are free: patch 1\.u0, "):
        Solid(tube)
    for thickness in (0.0, math.nan, math.inf):
        with pytest.raises(InputError, match="thickness must be a finite number other than 0"):
            Solid(whole, thickness=thickness)
    plane = bodies.bilinear([[[0, 0], [0, 1]], [[1, 0], [1, 1]]])
    with pytest.raises(InputError, match="patches in space, d = 3, got d = 2"):
        Solid(quilt([plane]), "planar")
