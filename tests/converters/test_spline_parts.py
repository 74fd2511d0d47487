"""Splines put together and taken apart, against evaluation, and against scipy where it can do the same."""

from __future__ import annotations

from dataclasses import replace

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from gtcad.converters.bspline import BSplineCurve, BSplineSurface
from gtcad.converters.spline_parts import (
    elevated,
    extracted,
    merged,
    part_of_curve,
    part_of_surface,
    reversed_curve,
    reversed_surface,
)
from gtcad.errors import InputError
from tests.splines import PLACES, exact_point, points, random_curve, random_surface

X = np.linspace(0, 1, 201)


def random_spline(rng, degree, spans, dimension=3, weights=False, continuity=None):
    """Over uneven knots that begin anywhere."""
    knots = rng.normal() + np.cumsum(rng.uniform(0.3, 1.0, spans + 1))
    inner = rng.integers(1, degree + 1, spans - 1) if continuity is None else [degree - continuity] * (spans - 1)
    counts = [degree + 1, *inner, degree + 1]
    count = int(sum(counts)) - degree - 1
    points = 50 * rng.normal(size=(count, dimension))
    return BSplineCurve(points, knots, counts, degree, rng.uniform(0.5, 2.0, count) if weights else None)


def split(spline, knot):
    """Both sides of an inner knot as splines of their own, by scipy's knot insertion."""
    flat, points = spline.flat_knots, spline.control_points
    curve = BSpline(flat, points, spline.degree)
    for _ in range(spline.degree + 1 - spline.multiplicities[knot]):
        curve = curve.insert_knot(spline.knots[knot])
    begin = int(np.searchsorted(curve.t, spline.knots[knot]))
    counts = spline.multiplicities
    ends = spline.degree + 1
    count = begin  # poles before the knot: its first copy has that index
    before = BSplineCurve(curve.c[:count], spline.knots[: knot + 1], [*counts[:knot], ends], spline.degree)
    after = BSplineCurve(curve.c[count:], spline.knots[knot:], [ends, *counts[knot + 1 :]], spline.degree)
    return before, after


def jumps(a, b, order):
    """Relative to the derivatives themselves."""
    found = []
    for k in range(order + 1):
        end, start = a.derivative(a.domain[1], k), b.derivative(b.domain[0], k)
        found.append(np.abs(end - start).max() / max(np.abs(end).max(), 1e-300))
    return max(found)


CASES = [(degree, order) for degree in range(1, 12) for order in range(min(4, degree))]


@pytest.mark.parametrize(("degree", "order"), CASES)
def test_what_was_one_spline_is_that_again(degree, order):
    """Its two sides, parted by scipy, put together: poles, knots and multiplicities are those of the whole."""
    rng = np.random.default_rng(100 * degree + order)
    whole = random_spline(rng, degree, 5, int(rng.integers(2, 4)), continuity=order)
    a, b = split(whole, 2)
    together = merged(a, b, order)
    assert together.multiplicities == whole.multiplicities
    assert np.abs(together.knots - whole.knots).max() < 1e-14 * np.abs(whole.knots).max()
    assert np.abs(together.control_points - whole.control_points).max() < 1e-11 * np.abs(whole.control_points).max()


@pytest.mark.parametrize(("degree", "order"), CASES)
def test_poles_away_from_the_joint_are_kept_bit_for_bit(degree, order):
    rng = np.random.default_rng(200 * degree + order)
    a, b = split(random_spline(rng, degree, 6, continuity=order), 3)
    together = merged(a, b, order)
    first, last = len(a.control_points) - order, len(b.control_points) - max(order, 1)
    assert len(together.control_points) == len(a.control_points) + len(b.control_points) - order - 1
    assert np.array_equal(together.control_points[:first], a.control_points[:first])
    assert np.array_equal(together.control_points[-last:], b.control_points[-last:])
    for part, spline in ((a, extracted(together, 0, 3)), (b, extracted(together, 3, 6))):
        x = part.knots[0] + X * np.ptp(part.knots)
        assert np.abs(spline.evaluate(x) - part.evaluate(x)).max() < 1e-11 * np.abs(part.control_points).max()


def test_the_second_spline_is_shifted_not_stretched():
    rng = np.random.default_rng(5)
    a, b = split(random_spline(rng, 4, 4, continuity=2), 2)
    moved = BSplineCurve(b.control_points, b.knots - b.knots[0] + 17.0, b.multiplicities, 4)
    together = merged(a, moved, 2)
    assert np.diff(together.knots)[2:] == pytest.approx(np.diff(b.knots), rel=1e-13)
    assert together.knots[2] == a.knots[-1]


@pytest.mark.parametrize("weights", [False, True], ids=["polynomial", "rational"])
@pytest.mark.parametrize("degree", [1, 2, 3, 5, 8, 11])
def test_every_part_is_the_spline_there(degree, weights):
    rng = np.random.default_rng(degree)
    for _ in range(4):
        spans = int(rng.integers(1, 7))
        spline = random_spline(rng, degree, spans, int(rng.integers(2, 4)), weights)
        size = np.abs(spline.control_points).max()
        for first in range(spans):
            for last in range(first + 1, spans + 1):
                part = extracted(spline, first, last)
                assert part.domain == (spline.knots[first], spline.knots[last])
                x = np.linspace(*part.domain, 101)[1:-1]
                assert np.abs(part.evaluate(x) - spline.evaluate(x)).max() < 1e-11 * size
                assert np.abs(part.derivative(x) - spline.derivative(x)).max() < 1e-9 * size * degree
                inner = slice(degree, len(part.control_points) - degree)
                poles = {tuple(pole) for pole in spline.control_points.tolist()}
                if not weights:
                    assert all(tuple(pole) in poles for pole in part.control_points[inner].tolist())


def test_all_of_a_spline_is_itself():
    spline = random_spline(np.random.default_rng(0), 3, 4)
    assert extracted(spline, 0, 4) is spline


def test_parts_side_by_side_share_a_point_and_derivatives():
    spline = random_spline(np.random.default_rng(1), 5, 6, continuity=3)
    for knot in range(1, 6):
        assert jumps(extracted(spline, 0, knot), extracted(spline, knot, 6), 3) < 1e-10


@pytest.mark.parametrize(("degree", "higher"), [(1, 2), (1, 7), (2, 3), (4, 9), (6, 6)])
def test_a_span_of_a_higher_degree_is_the_same_curve(degree, higher):
    span = random_spline(np.random.default_rng(degree), degree, 1)
    raised = elevated(span, higher)
    assert raised.degree == higher
    x = np.linspace(*span.domain, 50)
    assert np.abs(raised.evaluate(x) - span.evaluate(x)).max() < 1e-13 * np.abs(span.control_points).max()
    assert np.array_equal(raised.control_points[[0, -1]], span.control_points[[0, -1]])


def test_what_cannot_be_put_together_or_taken_apart():
    rng = np.random.default_rng(2)
    cubic, other, plane = random_spline(rng, 3, 2), random_spline(rng, 4, 2), random_spline(rng, 3, 2, dimension=2)
    rational = random_spline(rng, 3, 1, weights=True)
    for a, b in ((cubic, rational), (rational, cubic)):
        with pytest.raises(InputError, match="rational splines cannot be merged"):
            merged(a, b, 1)
    with pytest.raises(InputError, match=r"degrees 3 and 4, dimensions 3 and 3"):
        merged(cubic, other, 1)
    with pytest.raises(InputError, match="dimensions 3 and 2"):
        merged(cubic, plane, 1)
    for order in (-1, 3):
        with pytest.raises(InputError, match=rf"order must lie in \[0, 2\] for degree 3, got {order}"):
            merged(cubic, cubic, order)
    for ends in ((-1, 1), (1, 1), (2, 1), (0, 3)):
        with pytest.raises(InputError, match="must be indices of 3 knots"):
            extracted(cubic, *ends)
    for spline, degree in ((cubic, 4), (rational, 4), (random_spline(rng, 3, 1), 2)):
        with pytest.raises(InputError, match="a polynomial span of degree"):
            elevated(spline, degree)


# --- parts ---------------------------------------------------------------------------------------------------------


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000), rational=st.booleans())
def test_parts_are_where_they_are_said_to_be(seed, rational):
    rng = np.random.default_rng(seed)
    a, b, c, d = (2 + 3 * rng.uniform(0, 1, 4)).tolist()
    if min(abs(a - b), abs(c - d)) < 0.05:
        return
    curve, surface = random_curve(rng, rational, (2.0, 5.0)), random_surface(rng, rational, (2.0, 5.0))
    part, rounding = part_of_curve(curve, (a, b))
    assert np.abs(points(part) - curve.evaluate(a + (b - a) * PLACES)).max() <= rounding + 1e-12
    cut, rounding = part_of_surface(surface, ((a, b), (c, d)))
    wanted = surface.evaluate((a + (b - a) * PLACES)[:, None], (c + (d - c) * PLACES)[None, :])
    assert np.abs(points(cut) - wanted).max() <= rounding + 1e-12
    assert rounding < 1e-11


def test_reversal_twice_is_nothing():
    rng = np.random.default_rng(2)
    curve, surface = random_curve(rng, True), random_surface(rng, True)
    assert np.array_equal(reversed_curve(reversed_curve(curve)).control_points, curve.control_points)
    assert np.abs(points(reversed_surface(surface)) - points(surface)[::-1]).max() < 1e-12


def test_reversal_keeps_the_domain_to_the_last_digit():
    for knots in ([0.1, 0.2, 0.3], [0.7, 0.8, 1.9], [-1 / 3, 0.0, 0.1]):
        curve = BSplineCurve(np.eye(3), knots, [2, 1, 2], 1)
        assert reversed_curve(curve).domain == curve.domain
        surface = BSplineSurface(np.ones((3, 3, 3)), knots, [2, 1, 2], 1, knots, [2, 1, 2], 1)
        assert reversed_surface(surface).domain == surface.domain


@pytest.mark.parametrize("rational", [False, True])
def test_parts_are_as_near_as_their_rounding_says(rational):
    """At 50 digits, far from the origin."""
    for seed in range(10):
        spline = random_curve(np.random.default_rng(seed), rational)
        spline = replace(spline, control_points=spline.control_points + 1e4)
        part, rounding = part_of_curve(spline, (0.217, 0.731))
        assert part.domain == (0.217, 0.731)
        with mp.workdps(50):
            apart = [exact_gap(part, spline, x) for x in np.linspace(*part.domain, 17).tolist()]
        assert 0 < max(apart) <= rounding < 1e-8


def exact_gap(a, b, x):
    one, other = (exact_point(spline, x) for spline in (a, b))
    return mp.norm([p - q for p, q in zip(one, other, strict=True)])
