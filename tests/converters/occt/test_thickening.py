from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import minimize

from gtcad import Surface
from gtcad.converters.folds import MARGIN, crease, tightest
from gtcad.converters.occt.pieces import is_valid
from gtcad.converters.occt.shells import EdgeUses, edge_uses
from gtcad.converters.occt.thickening import hollow_solid
from gtcad.converters.solid import solid_of, thicken
from gtcad.converters.wall import wall, wall_volume
from gtcad.differential import normal, principal_curvatures
from gtcad.errors import InputError, KernelError, ToleranceNotMet
from gtcad.quilt import Quilt
from tests.converters import bodies

TOLERANCE = 1e-5
WAVY = Surface(
    [
        [[0, 0, 0], [0, 10, 4], [0, 20, 0]],
        [[10, 0, 3], [10, 10, 0], [10, 20, 5]],
        [[20, 0, 0], [20, 10, 3], [20, 20, 1]],
    ]
)


def of(*patches):
    return Quilt.recognised(patches)


def radius(quilt, thickness):
    return tightest(quilt, thickness, quilt.flipped).radius


# --- folds ------------------------------------------------------------------------------------------------------------


def test_least_radii_of_bodies_of_rotation():
    assert radius(of(bodies.sphere(2.0)), -1) == pytest.approx(2, rel=1e-9)
    assert radius(of(bodies.sphere(2.0)), 1) == math.inf
    assert radius(of(bodies.torus(5.0, 2.0)), -1) == pytest.approx(2, rel=1e-12)
    assert radius(of(bodies.torus(5.0, 2.0)), 1) == pytest.approx(3, rel=1e-12)  # at the inner equator
    tube = of(bodies.cylinder(2.0))
    inwards = 1 if normal(tube.patches[0], 0.5, 0.0)[0] < 0 else -1
    assert radius(tube, inwards) == pytest.approx(2, rel=1e-12)
    assert radius(tube, -inwards) > 1e9


def test_the_place_is_on_the_inner_equator():
    found = tightest(of(bodies.torus(5.0, 2.0)), 1, (True,))
    assert found.patch == "patch 1"
    assert found.u == pytest.approx(0.5, abs=1e-6)


@pytest.mark.parametrize("side", [1, -1])
def test_no_place_is_tighter(side):
    quilt = of(WAVY)

    def bend(place):
        values = principal_curvatures(WAVY, *np.clip(place, 0, 1))
        return -float((side * values).max())

    starts = np.random.default_rng(1).uniform(0, 1, (4, 2))
    tightest_of_all = max(-minimize(bend, start, method="Nelder-Mead").fun for start in starts)
    assert radius(quilt, side) <= 1 / tightest_of_all * (1 + 1e-9)


def test_a_wall_that_folds_is_refused_with_the_place_and_the_limit():
    fit = bodies.fitted([bodies.torus(5.0, 2.0)])
    for thickness, limit in ((3.0, 3.0), (-2.0, 2.0), (-1.99, 2.0)):
        message = rf"folds at patch 1 \(u, v\) = .* radius .* side is {limit:g} mm \(estimated\), stay within"
        with pytest.raises(InputError, match=message + rf" {(1 - MARGIN) * limit:g} mm"):
            thicken(fit, thickness, tolerance=TOLERANCE)
    for thickness in (2.9, -1.9):
        body = thicken(fit, thickness, tolerance=1e-4)
        assert body.volume == pytest.approx(10 * math.pi**2 * abs((2 + thickness) ** 2 - 4), abs=1e-4 * body.area)


def test_wrong_arguments_are_refused():
    fit = bodies.fitted([bodies.torus()])
    for thickness in (0.0, math.nan, math.inf, "thick", None):
        with pytest.raises(InputError, match="thickness must be a finite number of mm other than 0, got"):
            thicken(fit, thickness, tolerance=TOLERANCE)
    with pytest.raises(InputError, match="tolerance must be a finite number above 0, got -1"):
        thicken(fit, 1.0, tolerance=-1)
    with pytest.raises(InputError, match='caps must be "none" or "planar"'):
        thicken(fit, 1.0, tolerance=TOLERANCE, caps="all")


# --- creases ----------------------------------------------------------------------------------------------------------


def test_creases_are_found_and_named():
    assert crease(of(bodies.sphere()), 1e-12) is None
    assert crease(of(*bodies.torus().quarters()), 1e-12) is None
    assert crease(of(*bodies.box()), 1.5) == "at patch 1.u0 by 90 degrees"
    assert crease(of(*bodies.box()), 1.6) is None
    cone = bodies.Rotation(bodies.Curve([[0, 0, 0], [1, 0, 1]], family=bodies.BERNSTEIN), [0, 0, 0], [0, 0, 1])
    assert crease(of(cone), 1e-3) == "at the point patch 1.u0"


def test_an_open_quilt_with_a_crease_is_refused():
    with pytest.raises(
        InputError, match=r"open quilt with a crease cannot be thickened: it has one at patch 1\.u. by 90"
    ):
        thicken(bodies.fitted(bodies.box()[:5]), 1.0, tolerance=TOLERANCE)


def test_free_sides_that_meet_in_a_corner_are_refused():
    x = np.linspace(0, 1, 3)
    flat = Surface(np.stack([*np.meshgrid(x, x), np.zeros((3, 3))], axis=-1))
    bow = bodies.fitted([flat, flat.transformed(np.eye(3), [1, 1, 0])])
    with pytest.raises(InputError, match=r"patch 1\.u1, patch 1\.v1, patch 2\.u0, patch 2\.v0 meet in one corner"):
        thicken(bow, 0.1, tolerance=TOLERANCE)


# --- walls without creases --------------------------------------------------------------------------------------------


def check(body, volume, uses):
    assert is_valid(body.shape)
    assert edge_uses(body.shape) == uses
    assert body.exact_volume == pytest.approx(volume, rel=1e-10)
    assert abs(body.volume - volume) <= body.deviation * body.area
    assert body.deviation <= TOLERANCE
    assert not body.proved


@pytest.mark.parametrize("thickness", [0.7, -0.7])
@pytest.mark.parametrize("quarters", [False, True])
def test_a_sphere_becomes_hollow(thickness, quarters):
    patches = bodies.sphere().quarters() if quarters else [bodies.sphere()]
    body = thicken(bodies.fitted(patches, TOLERANCE), thickness, tolerance=TOLERANCE)
    volume = 4 / 3 * math.pi * abs((2 + thickness) ** 3 - 8)
    check(body, volume, EdgeUses(shared=8, degenerate=16) if quarters else EdgeUses(seams=2, degenerate=4))
    assert {"patch 1", "patch 1 offset"} <= set(body.faces)


@pytest.mark.parametrize("thickness", [0.7, -0.7])
@pytest.mark.parametrize("quarters", [False, True])
def test_a_tube_becomes_a_wall(thickness, quarters):
    whole = bodies.cylinder(2.0, 3.0)
    quilt = of(*(whole.quarters() if quarters else [whole]))
    outwards = normal(quilt.patches[0], 0.5, 0.0)[0] > 0
    body = thicken(bodies.fitted(quilt.patches, TOLERANCE), thickness, tolerance=TOLERANCE)
    end = 2 + (thickness if outwards else -thickness)
    check(body, 3 * math.pi * abs(end**2 - 4), EdgeUses(shared=32) if quarters else EdgeUses(shared=4, seams=4))
    assert [name for name in body.faces if name.endswith("rim")][:2] == ["patch 1.u0 rim", "patch 1.u1 rim"]


@pytest.mark.parametrize("thickness", [1.5, -1.5])
def test_the_offset_is_at_the_distance_everywhere(thickness):
    fit = bodies.fitted([WAVY], TOLERANCE)
    made = wall(fit, thickness, TOLERANCE)
    offset = made.skins[0].splines[1]
    u, v = np.random.default_rng(3).uniform(0, 1, (2, 500))
    exact = WAVY.evaluate(u, v) + thickness * normal(WAVY, u, v)
    assert np.linalg.norm(offset.evaluate(u, v) - exact, axis=-1).max() <= TOLERANCE
    body = thicken(fit, thickness, tolerance=TOLERANCE)
    check(body, float(wall_volume(fit.quilt, thickness)), EdgeUses(shared=12))


def test_steiners_formula_on_a_part_of_a_torus():
    ring = of(*bodies.torus(5.0, 2.0).quarters()[:1])
    sign = -1 if radius(ring, 1) == pytest.approx(2) else 1
    grown = 2.5 * math.pi**2 * (2.5**2 - 4)
    assert wall_volume(ring, sign * 0.5) == pytest.approx(grown, rel=1e-12)


def test_an_offset_that_needs_too_many_spans_is_refused():
    with pytest.raises(ToleranceNotMet):
        thicken(bodies.fitted([WAVY]), -0.5, tolerance=1e-16)


# --- bodies with creases ----------------------------------------------------------------------------------------------


def test_an_angle_becomes_hollow_with_a_round_edge_around_its_inner_corner():
    outline = [(0, 0), (4, 0), (4, 2), (2, 2), (2, 4), (0, 4)]
    around = zip(outline, [*outline[1:], outline[0]], strict=True)
    sides = [bodies.bilinear([[[*a, 0], [*a, 5]], [[*b, 0], [*b, 5]]]) for a, b in around]
    body = thicken(bodies.fitted(sides, TOLERANCE), -0.5, tolerance=TOLERANCE, caps="planar")
    assert is_valid(body.shape)
    assert edge_uses(body.shape).closed
    assert body.volume == pytest.approx(60 - 4 * (5 + (1 - math.pi / 4) / 4), rel=1e-9)
    assert body.exact_volume is None
    assert body.deviation <= TOLERANCE
    assert list(body.faces) == [
        *(f"patch {k}" for k in range(1, 7)),
        "cap 1",
        "cap 2",
        *(f"offset {k}" for k in range(1, 10)),
    ]


def test_a_capped_tube_is_clad_with_round_edges():
    r, h, t = 2.0, 3.0, 0.5
    body = thicken(bodies.fitted([bodies.cylinder(r, h)], TOLERANCE), t, tolerance=1e-4, caps="planar")
    rims = 2 * (math.pi * t**2 / 4) * 2 * math.pi * (r + 4 * t / (3 * math.pi))  # Pappus
    assert edge_uses(body.shape).closed
    assert body.volume == pytest.approx(math.pi * (2 * r * t + t * t) * h + 2 * math.pi * r * r * t + rims, abs=5e-3)
    assert list(body.faces)[:3] == ["patch 1", "cap 1", "cap 2"]


def test_a_hollow_of_a_body_that_is_too_thin_is_refused():
    with pytest.raises(KernelError, match=r"by -6 mm: nothing is left of it"):
        thicken(bodies.fitted(bodies.box(), TOLERANCE), -6.0, tolerance=TOLERANCE)


def test_a_crash_of_the_kernel_is_an_error():
    ball = solid_of(bodies.fitted([bodies.sphere()], TOLERANCE)).shape
    with pytest.raises(KernelError, match=r"the kernel cannot offset this solid by -0\.5 mm"):
        hollow_solid(ball, -0.5)
