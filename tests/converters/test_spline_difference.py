from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gtcad.converters.bspline import BSplineCurve
from gtcad.converters.spline_difference import certify_splines
from gtcad.errors import InputError
from tests.splines import points, random_curve, random_surface

SEEDS = st.integers(0, 10_000)


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


def test_a_curve_and_a_surface_do_not_compare():
    rng = np.random.default_rng(0)
    with pytest.raises(InputError, match="BSplineCurve in 3d and BSplineSurface in 3d"):
        certify_splines(random_curve(rng, False), random_surface(rng, False))


def test_bounds_allow_for_the_rounding_of_what_they_are_computed_from():
    """Lines whose ends differ by one unit in the last place, which values between them mostly round away."""
    for seed in range(200):
        poles = 1e6 * np.random.default_rng(seed).uniform(1, 1.9, (2, 2))
        moved = poles.copy()
        moved[1, 0] = np.nextafter(moved[1, 0], np.inf)
        found = certify_splines(*(BSplineCurve(ends, [0, 1], [2, 2], 1) for ends in (poles, moved)))
        assert found.lower <= moved[1, 0] - poles[1, 0] <= found.upper < 1e-7
