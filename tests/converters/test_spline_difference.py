from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gtcad.converters.bspline import BSplineCurve, BSplineSurface
from gtcad.converters.spline_difference import (
    certify_splines,
    part_of_curve,
    part_of_surface,
    reversed_curve,
    reversed_surface,
)
from gtcad.errors import InputError

SEEDS = st.integers(0, 10_000)
X = np.linspace(0, 1, 121)


def random_knots(rng, degree, ends=(0.0, 1.0)):
    inner = np.sort(rng.choice(np.linspace(*ends, 23)[1:-1], int(rng.integers(0, 5)), replace=False))
    counts = [degree + 1, *rng.integers(1, degree + 1, len(inner)).tolist(), degree + 1]
    return [ends[0], *inner, ends[1]], counts


def random_curve(rng, rational, ends=(0.0, 1.0)):
    degree = int(rng.integers(1, 6))
    knots, counts = random_knots(rng, degree, ends)
    count = sum(counts) - degree - 1
    weights = rng.uniform(0.6, 1.6, count) if rational else None
    return BSplineCurve(rng.normal(size=(count, 3)), knots, counts, degree, weights)


def random_surface(rng, rational, ends=(0.0, 1.0)):
    degrees = [int(n) for n in rng.integers(1, 5, 2)]
    u, v = (random_knots(rng, degree, ends) for degree in degrees)
    shape = tuple(sum(counts) - degree - 1 for (_, counts), degree in zip((u, v), degrees, strict=True))
    weights = rng.uniform(0.6, 1.6, shape) if rational else None
    return BSplineSurface(rng.normal(size=(*shape, 3)), *u, degrees[0], *v, degrees[1], weights)


def points(spline, x=X):
    if isinstance(spline, BSplineCurve):
        return spline.evaluate(np.interp(x, [0, 1], spline.domain))
    (u0, u1), (v0, v1) = spline.domain
    return spline.evaluate((u0 + (u1 - u0) * x)[:, None], (v0 + (v1 - v0) * x)[None, :])


@settings(max_examples=40, deadline=None)
@given(seed=SEEDS, kinds=st.tuples(st.booleans(), st.booleans()), made=st.sampled_from([random_curve, random_surface]))
def test_bounds_hold_and_polynomial_ones_are_tight(seed, kinds, made):
    rng = np.random.default_rng(seed)
    a, b = made(rng, kinds[0]), made(rng, kinds[1], (3.0, 7.0))
    found = certify_splines(a, b)
    seen = float(np.linalg.norm(points(a) - points(b), axis=-1).max())
    assert seen <= found.upper
    assert found.lower <= found.upper
    if not any(kinds):
        assert found.lower >= 0.97 * seen
        assert found.upper <= 1.02 * found.lower
    place = [np.array([x]) for x in found.place]
    if isinstance(a, BSplineCurve):
        difference = points(a, place[0]) - points(b, place[0])
    else:
        (u, v), (s, t) = place, place
        difference = _at(a, u, v) - _at(b, s, t)
    assert np.linalg.norm(difference) >= found.lower * (1 - 1e-6)


def _at(surface, u, v):
    (u0, u1), (v0, v1) = surface.domain
    return surface.evaluate(u0 + (u1 - u0) * u, v0 + (v1 - v0) * v)


def test_a_difference_that_is_known():
    """A straight line and a parabola whose height is 1/2."""
    line = BSplineCurve([[0, 0, 0], [2, 0, 0]], [0, 1], [2, 2], 1)
    bent = BSplineCurve([[0, 0, 0], [1, 1, 0], [2, 0, 0]], [0, 5], [3, 3], 2)
    found = certify_splines(line, bent)
    assert found.lower <= 0.5 <= found.upper <= 0.506
    assert found.place[0] == pytest.approx(0.5, abs=0.1)


@settings(max_examples=25, deadline=None)
@given(seed=SEEDS, rational=st.booleans())
def test_equal_splines_differ_by_rounding(seed, rational):
    rng = np.random.default_rng(seed)
    for spline in (random_curve(rng, rational), random_surface(rng, rational)):
        assert certify_splines(spline, spline).upper < 1e-9


@settings(max_examples=25, deadline=None)
@given(seed=SEEDS, rational=st.booleans())
def test_parts_are_where_they_are_said_to_be(seed, rational):
    rng = np.random.default_rng(seed)
    a, b, c, d = (2 + 3 * rng.uniform(0, 1, 4)).tolist()
    if min(abs(a - b), abs(c - d)) < 0.05:
        return
    curve, surface = random_curve(rng, rational, (2.0, 5.0)), random_surface(rng, rational, (2.0, 5.0))
    part, rounding = part_of_curve(curve, (a, b))
    assert np.abs(points(part) - curve.evaluate(a + (b - a) * X)).max() <= rounding + 1e-12
    cut, rounding = part_of_surface(surface, ((a, b), (c, d)))
    wanted = surface.evaluate((a + (b - a) * X)[:, None], (c + (d - c) * X)[None, :])
    assert np.abs(points(cut) - wanted).max() <= rounding + 1e-12
    assert rounding < 1e-11


def test_reversal_twice_is_nothing():
    rng = np.random.default_rng(2)
    curve, surface = random_curve(rng, True), random_surface(rng, True)
    assert np.array_equal(reversed_curve(reversed_curve(curve)).control_points, curve.control_points)
    assert np.abs(points(reversed_surface(surface)) - points(surface)[::-1]).max() < 1e-12


def test_a_curve_and_a_surface_do_not_compare():
    rng = np.random.default_rng(0)
    with pytest.raises(InputError, match="BSplineCurve in 3d and BSplineSurface in 3d"):
        certify_splines(random_curve(rng, False), random_surface(rng, False))
