"""Random joins of every order: what is joined, how closely, and what a conversion leaves of it.

Residuals are those of derivatives computed from the basis at 50 digits, over the sum of the sizes of the terms that
make them up, with points measured from the joint: what rounding the control points may change is of that order.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pytest

from gtcad import BERNSTEIN, GT, Composite, Curve
from gtcad.continuity import Thresholds, chain_rule, check_join, join_curve
from gtcad.converters import fit_curve
from gtcad.converters.chain import fit_chain
from gtcad.errors import SingularJoin, ToleranceBelowPrecision
from tests import pieces, reference

ORDERS = ("C0", "C1", "C2", "C3", "G0", "G1", "G2", "G3")
RESIDUAL = 1e-12
LIMITS = Thresholds(gap=1e-7, angle_deg=1e-6, curvature=1e-6, curvature_rate=1e-4)
CANCELLED = 1e-6  # of the sum of the sizes of its terms: a derivative of which less is left is 0 but for rounding
TOLERANCE = 1e-6


@dataclass(frozen=True)
class Join:
    first: Curve
    second: Curve
    scale: tuple[float, float, float]
    order: str

    @property
    def count(self):
        """Derivatives that are joined, the point included."""
        return int(self.order[1]) + 1

    @cached_property
    def ends(self):
        """(derivatives, sizes of their terms) at the end of the first and at the start of the second."""
        return ends(self.first, 1, self.count), ends(self.second, 0, self.count)


def random_basis(rng, least):
    """Degree up to 13, design variables and family; a quarter of them classical."""
    family = GT if rng.random() < 0.75 else BERNSTEIN
    degree = int(rng.integers(max(least, family.minimum_degree), 14))
    return degree, pieces.random_gamma(rng) if family is GT else (0.0, 0.0), family


def random_join(rng, order):
    """Of any size from 1e-2 to 1e4 mm, in the plane or in space, perhaps away from the origin."""
    count, dimension = int(order[1]) + 1, int(rng.integers(2, 4))
    size = 10 ** rng.uniform(-2, 4)
    degree, gamma, family = random_basis(rng, 1)
    points = rng.normal(0, 0.4, (degree + 1, dimension))
    points[:, 0] = np.linspace(0, 1, degree + 1) + rng.normal(0, 0.1, degree + 1)
    first = Curve(size * (points + rng.normal(0, 1, dimension)), gamma, family)
    scale = (1.0, 0.0, 0.0)
    if order[0] == "G":
        scale = (float(np.exp(rng.normal(0, 0.4))), float(rng.normal()), float(rng.normal()))
    degree, gamma, family = random_basis(rng, count - 1)
    rest = first.evaluate(1.0) + rng.normal(0, 0.5 * size, (degree - count + 1, dimension))
    second = join_curve(first, degree, order=order, gamma=gamma, scale=scale, rest=rest, family=family)
    return Join(first, second, scale, order)


def random_joins(order, count, seed):
    """Those that leave a control point undetermined, at corners of the square of gamma, are passed over."""
    rng, refused = np.random.default_rng(seed), 0
    while count > 0:
        try:
            join = random_join(rng, order)
        except SingularJoin:
            refused += 1
            assert refused <= 10 + count
            continue
        count -= 1
        yield join


def ends(curve, t, count):
    """Derivatives from 50 digits, shape (count, d), and the sums of the sizes of their terms, shape (count,)."""
    rows = reference.derivatives(curve.family.name, curve.degree, curve.gamma, t, count - 1)
    from_joint = curve.control_points - curve.control_points[0 if t == 0 else -1]
    return rows @ curve.control_points, (np.abs(rows) @ np.linalg.norm(from_joint, axis=1))


def by_length(derivatives):
    """Tangent, second and third derivative by arc length, by differentiating T = C' / |C'| as it stands."""
    first, second, third = derivatives[1:4]
    speed = np.linalg.norm(first)
    tangent = first / speed
    stretch = tangent @ second  # |C'|'
    turned = (second - stretch * tangent) / speed  # T'
    stretched = turned @ second + tangent @ third  # |C'|''
    turned_again = (third - stretched * tangent - 2 * stretch * turned) / speed  # T''
    return tangent, turned / speed, (turned_again - stretch / speed * turned) / speed**2


def assert_meets(a, b, join, *, cancelled=True):
    """The thresholds of the issue, computed here; and ``check_join`` where there are derivatives to compare.

    Jumps are relative to the derivatives, or to what is left of them when almost all cancels: the curvature of a
    straight piece is rounding alone. In splines, whose spans are short, more of it: those are not compared.
    """
    before = np.array([a.derivative(a.domain[1], k) for k in range(4)])
    after = np.array([b.derivative(b.domain[0], k) for k in range(4)])
    assert np.linalg.norm(after[0] - before[0]) <= LIMITS.gap
    if join.count == 1:
        return
    limits = (math.radians(LIMITS.angle_deg), LIMITS.curvature, LIMITS.curvature_rate)
    pairs = [(one, other, 1.0) for one, other in zip(by_length(before), by_length(after), strict=True)]
    if join.order[0] == "C":
        pairs += [(before[k], after[k], None) for k in (1, 2, 3)]
    there = True
    for place, (one, other, by_arc) in enumerate(pairs):
        k = place % 3 + 1
        if k >= join.count:
            continue
        least = max(
            CANCELLED * terms[k] / (1.0 if by_arc is None else np.linalg.norm(speeds[1]) ** k)
            for speeds, terms in join.ends
        )
        larger = max(np.linalg.norm(one), np.linalg.norm(other))
        if larger < least and not cancelled:
            there = False
            continue
        assert np.linalg.norm(other - one) <= limits[k - 1] * max(larger, least), (join.order, k, by_arc)
        there = there and larger >= least
    if there:
        assert check_join(a, b, thresholds=LIMITS).meets(join.order)


def residual(join):
    (before, terms_before), (after, terms_after) = join.ends
    rule = chain_rule(join.scale, join.count)
    missed = np.linalg.norm(after - rule @ before, axis=1)[1:]
    terms = (terms_after + np.abs(rule) @ terms_before)[1:]
    assert np.array_equal(join.second.control_points[0], join.first.control_points[-1])
    return float((missed / terms).max(initial=0.0))


def assert_joined(order, count, seed):
    worst = 0.0
    for join in random_joins(order, count, seed):
        worst = max(worst, residual(join))
        assert_meets(join.first, join.second, join)
    assert worst <= RESIDUAL, worst


def assert_joined_after_conversion(order, count, seed):
    for join in random_joins(order, count, seed):
        settings = {"tolerance": TOLERANCE, "exact": False, "adapt": False}
        try:
            before = fit_curve(join.first, end_order=(0, join.count - 1), **settings)
            after = fit_curve(join.second, end_order=(join.count - 1, 0), **settings)
        except ToleranceBelowPrecision:  # so badly determined that control points are far away
            assert np.abs(join.second.control_points).max() > 1e6
            continue
        assert max(before.deviation[1], after.deviation[1]) <= TOLERANCE
        assert_meets(before.spline, after.spline, join, cancelled=False)


@pytest.mark.parametrize("order", ORDERS)
def test_joined_derivatives_agree(order):
    assert_joined(order, 30, 1)


@pytest.mark.parametrize("order", ORDERS)
def test_splines_meet_as_the_curves_do(order):
    assert_joined_after_conversion(order, 12, 2)


@pytest.mark.stress
@pytest.mark.parametrize("order", ORDERS)
def test_joined_derivatives_agree_stress(order):
    assert_joined(order, 1000, 11)


@pytest.mark.stress
@pytest.mark.parametrize("order", ORDERS)
def test_splines_meet_as_the_curves_do_stress(order):
    assert_joined_after_conversion(order, 1000, 12)


def random_chain(rng, order, closed):
    """Two to five pieces around a loop, their ends apart as a hasty hand draws them, of any size."""
    count, dimension = int(rng.integers(2, 6)), int(rng.integers(2, 4))
    size = 10 ** rng.uniform(-2, 4)
    drawn = []
    for k in range(count):
        degree = int(rng.integers(2 * int(order[1]) + 1, 14))
        angle = 2 * math.pi * np.linspace(k, k + 1, degree + 1) / count
        points = np.stack([np.cos(angle), 0.6 * np.sin(angle), 0.1 * np.sin(2 * angle)], axis=1)[:, :dimension]
        points += rng.normal(0, 0.02, points.shape)
        family, gamma = (GT, pieces.random_gamma(rng)) if rng.random() < 0.75 else (BERNSTEIN, (0.0, 0.0))
        drawn.append(Curve(size * (points + 1), gamma, family))
    return Composite.solved(drawn, [order] * (count - (not closed)), closed=closed)


def geometric_residual(first, second, order):
    """With the scale factors that fit best, which the conditions give one after the other."""
    count = int(order[1]) + 1
    (before, terms_before), (after, terms_after) = ends(first, 1, count), ends(second, 0, count)
    scale = [1.0, 0.0, 0.0]
    if order[0] == "G":
        along = before[1] / (before[1] @ before[1])
        for k in range(1, count):
            rule = chain_rule((scale[0], scale[1], scale[2]), count)
            rest = after[k] - (rule @ before)[k] if k > 1 else after[k]
            scale[k - 1] = float(along @ rest)
    rule = chain_rule((scale[0], scale[1], scale[2]), count)
    terms = terms_after + np.abs(rule) @ terms_before
    return float((np.linalg.norm(after - rule @ before, axis=1)[1:] / terms[1:]).max(initial=0.0))


def assert_chains(order, closed, count, seed):
    rng = np.random.default_rng(seed)
    worst = 0.0
    for _ in range(count):
        chain = random_chain(rng, order, closed)
        for first, second in chain.joints:
            worst = max(worst, geometric_residual(first, second, order))
            assert_meets(first, second, Join(first, second, (1.0, 0.0, 0.0), order))
        fit = fit_chain(chain, tolerance=TOLERANCE, adapt=False)
        assert fit.deviation[1] <= TOLERANCE
        assert all(report.meets(order) for report in fit.report(thresholds=LIMITS))
    assert worst <= RESIDUAL, worst


CHAINS = [("G2", True), ("G3", True), ("G3", False), ("C2", True), ("C3", True)]


@pytest.mark.parametrize(("order", "closed"), CHAINS)
def test_chains_are_joined_before_and_after_conversion(order, closed):
    assert_chains(order, closed, 4, 5)


@pytest.mark.stress
@pytest.mark.parametrize(("order", "closed"), CHAINS)
def test_chains_are_joined_before_and_after_conversion_stress(order, closed):
    assert_chains(order, closed, 100, 15)
