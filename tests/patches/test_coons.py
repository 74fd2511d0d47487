from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gtcad import BERNSTEIN, Curve, Restricted
from gtcad.converters import fit_surface
from gtcad.errors import InputError
from gtcad.factors import CurveOfTerms, Waves
from gtcad.measure import area
from gtcad.patches import Coons, Ruled, Swept, coons_from_loop
from gtcad.restricted import RestrictedCurve
from tests.patches.kinds import FRAME, RAIL, TWISTED, WAVE, line
from tests.pieces import random_surface

U, V = np.meshgrid(np.linspace(0, 1, 21), np.linspace(0, 1, 13), indexing="ij")
T = U[:, 0]


@given(st.integers(0, 1000), st.integers(2, 6), st.integers(2, 6))
def test_boundaries_are_the_curves(seed, n, m):
    surface = random_surface(np.random.default_rng(seed), (n, m), 10)
    curves = dict(zip(("v0", "v1", "u0", "u1"), map(surface.boundary, ("v0", "v1", "u0", "u1")), strict=True))
    patch = Coons(*curves.values())
    for side, curve in curves.items():
        assert abs(patch.boundary(side).evaluate(T) - curve.evaluate(T)).max() <= 1e-14
        assert patch.boundary(side).factors == curve.factors  # nothing else is left of the sum


@given(st.integers(0, 1000))
def test_the_patch_of_a_plane_boundary_is_plane(seed):
    rng = np.random.default_rng(seed)
    surface = random_surface(rng, (3, 4), 10).transformed(rng.normal(size=(3, 2)) @ np.eye(2, 3))
    patch = Coons(*map(surface.boundary, ("v0", "v1", "u0", "u1")))
    points = patch.evaluate(U, V).reshape(-1, 3)
    assert np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[2] <= 1e-12
    flat = patch.transformed(rng.normal(size=(2, 3)))
    assert flat.dimension == 2


def test_straight_boundaries_give_the_bilinear_patch():
    a, b, c, d = [0, 0, 0], [3, 0, 1], [0, 2, 5], [4, 4, -2]
    patch = Coons(line(a, b), line(c, d), line(a, c), line(b, d))
    corners = ((1 - U) * (1 - V), U * (1 - V), (1 - U) * V, U * V)
    expected = sum(w[..., None] * np.array(p) for w, p in zip(corners, (a, b, c, d), strict=True))
    assert abs(patch.evaluate(U, V) - expected).max() <= 2e-15
    fit = fit_surface(patch, tolerance=1e-6)
    assert fit.exact
    assert fit.spline.control_points.shape == (2, 2, 3)


@pytest.mark.parametrize(
    "surface", [Ruled(WAVE, TWISTED), Swept(WAVE, RAIL), Swept(FRAME[0], FRAME[3])], ids=["ruled", "swept", "swept arc"]
)
def test_the_sum_gives_back_what_it_is_exact_for(surface):
    """Surfaces linear in one parameter, and sums of a function of u and one of v."""
    patch = Coons(*map(surface.boundary, ("v0", "v1", "u0", "u1")))
    assert abs(patch.evaluate(U, V) - surface.evaluate(U, V)).max() <= 2e-13


def test_a_disc_of_four_arcs():
    arcs = [CurveOfTerms(Waves(k * math.pi / 2, math.pi / 2), [[5, 5], [10, 0], [0, 10]]) for k in range(4)]
    patch = coons_from_loop(arcs)
    assert float(area(patch)) == pytest.approx(100 * math.pi, rel=1e-12)
    assert patch.dimension == 2


def test_three_sides():
    point = Curve([[0, 0, 9]] * 3)
    patch = Coons(line([0, 0, 0], [6, 0, 0]), point, line([0, 0, 0], [0, 0, 9]), line([6, 0, 0], [0, 0, 9]))
    assert float(area(patch)) == pytest.approx(27, rel=1e-12)
    spline = fit_surface(patch, tolerance=1e-4).spline
    assert np.array_equal(spline.control_points[:, -1], np.tile([0.0, 0, 9], (len(spline.control_points), 1)))


@pytest.mark.parametrize("turns", list(itertools.product((0, 1), repeat=4)))
def test_loops_are_turned_where_they_must_be(turns):
    c0, c1, d0, d1 = FRAME
    loop = [curve.reversed() if turn else curve for curve, turn in zip((c0, d1, c1, d0), turns, strict=True)]
    assert coons_from_loop(loop) == Coons(c0, c1, d0, d1)


def test_other_kinds_of_curves_are_turned_as_parts():
    arcs = [CurveOfTerms(Waves(k * math.pi / 2, math.pi / 2), [[0, 0], [1, 0], [0, 1]]) for k in range(4)]
    patch = coons_from_loop(arcs)
    assert (patch.c0, patch.d1) == (arcs[0], arcs[1])
    assert patch.c1 == RestrictedCurve(arcs[2], (1.0, 0.0))
    part = Restricted(arcs[0], (0.0, 1.0))
    assert coons_from_loop([arcs[2], arcs[3], part, arcs[1]]).c1 == RestrictedCurve(arcs[0], (1.0, 0.0))


@pytest.mark.parametrize("corner", range(4))
def test_corners_must_meet(corner):
    curves = list(FRAME)
    index, end = divmod(corner, 2)
    points = curves[index].control_points.copy()
    points[-end, 2] += 0.25
    curves[index] = Curve(points, curves[index].gamma)
    message = (
        rf"corner u = {end}, v = {index}: the {('start', 'end')[end]} of c{index} \[.*\] and the "
        rf"{('start', 'end')[index]} of d{end} \[.*\] are 0.25 apart, at most 1.\d+e-07 is allowed"
    )
    with pytest.raises(InputError, match=message):
        Coons(*curves)


def test_corners_may_differ_by_rounding():
    c0, c1, d0, d1 = FRAME
    points = c1.control_points.copy()
    points[0] += [1e-8, -1e-8, 1e-8]
    patch = Coons(c0, Curve(points, c1.gamma), d0, d1)
    assert abs(patch.boundary("v1").evaluate(T) - c1.evaluate(T)).max() <= 2e-8


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Coons(*FRAME[:3], None), "d1 must be a curve, got NoneType"),
        (lambda: Coons(*FRAME[:3], line([0, 0], [1, 1])), r"must have one dimension, got \[3, 3, 3, 2\]"),
        (lambda: Coons(FRAME[0], FRAME[1].reversed(), *FRAME[2:]), "corner u = 0, v = 1: the start of c1"),
        (lambda: coons_from_loop(FRAME[:3]), "curves must be four, got 3"),
        (lambda: coons_from_loop([*FRAME[:3], 7]), r"curves\[3\] must be a curve, got int"),
        (lambda: coons_from_loop([line([k, 0], [k, 1]) for k in range(4)]), "apart"),
    ],
)
def test_bad_input(make, message):
    with pytest.raises(InputError, match=message):
        make()


def test_polynomial_boundaries_are_kept_to_rounding():
    curves = [Curve(c.control_points, family=BERNSTEIN) for c in FRAME]
    fit = fit_surface(Coons(*curves), tolerance=1e-9)
    assert fit.deviation[1] <= 1e-9
    assert max(fit.spline.control_points.shape[:2]) <= 6
