"""What rounding does to coordinates and joints, against numbers that were rounded and edges that were moved."""

from __future__ import annotations

import itertools
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from gtcad.continuity import check_join
from gtcad.converters.bspline import BSplineCurve
from gtcad.converters.part import EllipseArc
from gtcad.converters.rounding import End, check_rounded_join, rounded_by
from gtcad.converters.spline_parts import cut

RNG = np.random.default_rng(4)
UNITS = {"mm": 1.0, "cm": 10.0, "in": 25.4, "ft": 304.8, "m": 1000.0}


def rounded(points, unit=1.0):
    """Ten digits, but nine decimals for numbers of the unit from 0.1 to 1."""
    texts = [f"{x:.9f}" if 0.1 <= abs(x) < 1 else f"{x:.9e}" for x in (points / unit).ravel().tolist()]
    return unit * np.reshape([float(text) for text in texts], points.shape)


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("size", [3.0, 700.0, 20000.0])
def test_the_bound_holds_for_what_was_rounded_and_is_not_much_larger(unit, size):
    points = RNG.uniform(-size, size, (12, 3))
    held = rounded(points, UNITS[unit])
    bound = rounded_by(held)
    moved = float(np.abs(held - points).max())
    assert moved <= bound * (1 + 1e-6)
    assert bound <= 60 * moved


def test_what_was_not_rounded_is_taken_for_ten_digits_of_millimetres():
    points = RNG.uniform(-700, 700, (12, 3))
    points[0, 0] = 812.3
    assert rounded_by(points) == pytest.approx(5e-8)
    assert rounded_by(1e-4 * points) == pytest.approx(5e-12, rel=20)  # 0.08 mm or, by chance, no other unit
    assert rounded_by(np.round(points)) == pytest.approx(5e-8)  # whole numbers are decimals of anything
    assert rounded_by(np.zeros((3, 3))) == 0.0


def spline(weights=None, count=9):
    knots = np.r_[0.0, np.sort(RNG.uniform(0.15, 0.85, count - 6)), 1.0]
    return BSplineCurve(RNG.uniform(-50, 50, (count, 3)), 3 * knots - 1, [6, *[1] * (count - 6), 6], 5, weights)


def moved_edges(edge, by, times=60):
    for _ in range(times):
        if isinstance(edge, EllipseArc):
            center = edge.center + by * RNG.choice([-1.0, 1.0], 3)
            longer = 1 + by * RNG.choice([-1.0, 1.0]) / np.linalg.norm(edge.axis_a)
            yield EllipseArc(center, longer * edge.axis_a, longer * edge.axis_b, edge.start, edge.end)
        else:
            points = edge.control_points + by * RNG.choice([-1.0, 1.0], edge.control_points.shape)
            yield BSplineCurve(points, edge.knots, edge.multiplicities, edge.degree, edge.weights)


EDGES = {
    "spline": spline(),
    "rational": spline(RNG.uniform(0.3, 3.0, 9)),
    "cubic": BSplineCurve(RNG.uniform(-5, 5, (4, 3)), [0, 1], [4, 4], 3),
    "line": BSplineCurve([[0, 0, 0], [3, 4, 5]], [0, 2], [2, 2], 1),
    "arc": EllipseArc([1, 2, 3], [7, 0, 0], [0, 7, 0], 0.4, 2.9),
}


@pytest.mark.parametrize("backwards", [False, True])
@pytest.mark.parametrize("name", EDGES)
def test_no_shift_within_the_rounding_moves_a_derivative_beyond_its_bound(name, backwards):
    edge, by = EDGES[name], 1e-6
    end = End(edge, by, backwards)
    for last in (False, True):
        bounds, most = end.noise(last), np.zeros(4)
        for other in moved_edges(edge, by):
            held = End(other, by, backwards)
            most = np.maximum(
                most, [np.linalg.norm(held.derivative(last, k) - end.derivative(last, k)) for k in range(4)]
            )
        assert (most <= bounds * (1 + 1e-6) + 1e-11).all()
        if name != "arc":  # nor are the bounds idle
            assert (bounds[:2] <= 4 * most[:2] + 1e-12).all()


def halves(seed):
    """A smooth curve cut in two in the middle, which stay C4 there."""
    rng = np.random.default_rng(seed)
    points = np.cumsum(rng.uniform(1, 40, (8, 3)), axis=0)
    return BSplineCurve(points, [0, 0.3, 0.5, 1], [6, 1, 1, 6], 5)


def test_rounded_halves_of_a_curve_keep_their_order_and_bent_ones_do_not():
    lost = 0
    for seed, unit in itertools.product(range(12), UNITS.values()):
        parts = [cut(halves(seed), a, b) for a, b in pairwise((0.0, 0.5, 1.0))]
        held = [replace(one, control_points=rounded(one.control_points, unit)) for one in parts]
        before, after = (End(one, rounded_by(one.control_points)) for one in held)
        lost += not check_join(before, after).meets("G3")
        report = check_rounded_join(before, after, "G3")
        assert report.meets("G3")
        assert report.tangent_angle_deg == check_join(before, after).tangent_angle_deg
        for pole, order in ((1, "G1"), (2, "G2")):
            points = held[1].control_points.copy()
            points[pole] += 200 * max(before.moved, after.moved) * np.array([1, -1, 0])
            bent = End(replace(held[1], control_points=points), after.moved)
            assert not check_rounded_join(before, bent, order).meets(order)
    assert lost >= 10  # by the usual limits


def test_a_jump_along_the_tangent_of_a_line_is_not_explained_by_its_small_curvature():
    """C2 asks for the second derivative, which rounding moves little whatever the curvature is."""
    line = BSplineCurve([[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]], [0, 1], [4, 4], 3)
    faster = BSplineCurve([[3, 0, 0], [4, 0, 0], [6, 0, 1e-9], [9, 0, 0]], [0, 1], [4, 4], 3)
    report = check_rounded_join(End(line, 5e-9), End(faster, 5e-9), "C2")
    assert not report.meets("C2")
    assert report.meets("C1")
