from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.interpolate import BSpline

from gtcad import BERNSTEIN
from gtcad.basis import Basis
from gtcad.converters import approximation
from gtcad.converters.approximation import (
    Approximation,
    Bundle,
    Problem,
    approximate,
    equidistributed,
    of_kind,
)
from gtcad.converters.spline_basis import Knots, both_ends
from gtcad.factors import RestrictedFactors, Waves
from tests import pieces

FACTORS = [Basis(5, (1.0, -1.0)), Basis(8, (0.5, 0.5)), Basis(6, family=BERNSTEIN), Waves(0.2, 6.0)]
NAMES = ["basis 5", "basis 8", "bernstein", "waves"]


def curve_bundle(curve):
    return Bundle(curve.factors, curve.coefficients[:, None, :])


def spline_of(one):
    """The splines of all factors, evaluated by scipy."""
    return BSpline(one.knots.flat, one.matrix, one.knots.degree)


def dense_error(one, bundle, count=4001):
    t = np.linspace(0, 1, count)
    residual = bundle.factors.rows(t).T - spline_of(one)(t)
    return np.linalg.norm(np.einsum("ti,ijd->tjd", residual, bundle.vectors), axis=2).max()


def uneven(spans, degree, seed=0):
    breaks = np.sort(np.random.default_rng(seed).uniform(0, 1, spans - 1))
    return Knots.smooth(np.concatenate([[0.0], breaks, [1.0]]), degree)


# Bundles


def test_norms_are_the_largest_over_the_places():
    rng = np.random.default_rng(0)
    bundle = Bundle(Basis(4), rng.normal(size=(5, 7, 3)))
    rows = rng.normal(size=(11, 5))
    expected = [max(np.linalg.norm(row @ bundle.vectors[:, j]) for j in range(7)) for row in rows]
    assert bundle.norms(rows) == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize("places", [1, 2, 9])
def test_compressed_bundles_have_the_same_norms(places):
    rng = np.random.default_rng(places)
    bundle = Bundle(Basis(4), rng.normal(size=(5, places, 3)))
    columns, rows = bundle.compressed
    assert columns.shape[1] <= 5
    assert abs(columns @ rows - bundle.vectors.reshape(5, -1)).max() <= 1e-14
    assert abs(rows @ rows.T - np.eye(len(rows))).max() <= 1e-14
    values = rng.normal(size=(11, 5))
    assert bundle.compressed_norms(values @ columns) == pytest.approx(bundle.norms(values), rel=1e-13)


# Least squares


@pytest.mark.parametrize("end_order", range(4))
@pytest.mark.parametrize("factors", FACTORS, ids=NAMES)
def test_residuals_are_orthogonal_to_the_free_functions(factors, end_order):
    knots = uneven(7, 5)
    problem = Problem(factors, knots, end_order)
    weights = np.random.default_rng(1).uniform(0.1, 1, len(problem.values))
    for chosen in (None, weights):
        residual = problem.residual(problem.solve(chosen))
        design = BSpline.design_matrix(_sample_places(problem), knots.flat, 5).toarray()
        free = design[:, end_order + 1 : -end_order - 1]
        scaled = residual if chosen is None else residual * chosen[:, None]
        assert abs(free.T @ scaled).max() <= 1e-13
        assert abs(factors.rows(_sample_places(problem)).T - problem.values).max() <= 1e-14


def _sample_places(problem):
    """The parameters of a problem's samples, from the factors that are their own inverse there: t itself."""
    line = Problem(Basis(1, family=BERNSTEIN), problem.knots, 0)
    return line.values[:, 1]


@pytest.mark.parametrize("end_order", [*range(4), (0, 3), (2, 1)], ids=str)
@pytest.mark.parametrize("degree", [3, 5, 9, 25])
@pytest.mark.parametrize("factors", FACTORS, ids=NAMES)
def test_derivatives_at_both_ends_are_exact(factors, degree, end_order):
    knots = uneven(6, degree, seed=degree)
    highest = both_ends(end_order)
    assert knots.poles >= sum(highest) + 2  # room for the end conditions
    ends = np.array([0.0, 1.0])
    spline = BSpline(knots.flat, Problem(factors, knots, end_order).solve(), degree)
    identity = BSpline(knots.flat, np.eye(knots.poles), degree)
    for end, order in [(0, k) for k in range(highest[0] + 1)] + [(1, k) for k in range(highest[1] + 1)]:
        exact, found = factors.rows(ends, order).T[end], spline(ends, order)[end]
        rounding = 1e-15 * abs(identity(ends, order)).sum(axis=1).max()  # what a unit in each pole makes
        assert abs(found - exact).max() <= 8 * (rounding + 1e-15 * abs(exact).max())
    assert np.array_equal(spline.c[[0, -1]], factors.rows(ends).T)


@pytest.mark.parametrize("end_order", [0, 3])
@pytest.mark.parametrize("factors", FACTORS, ids=NAMES)
def test_banded_and_dense_solutions_agree(factors, end_order, monkeypatch):
    for knots in (uneven(12, 5), uneven(30, 3), Knots.smooth(np.linspace(0, 1, 60), 7), uneven(6, 5)):
        dense = Problem(factors, knots, end_order).solve()
        with monkeypatch.context() as patch:
            patch.setattr(approximation, "FEW_POLES", 0)
            banded = Problem(factors, knots, end_order).solve()
        t = np.linspace(0, 1, 1001)
        gap = BSpline(knots.flat, dense - banded, knots.degree)(t)
        assert abs(gap).max() <= 1e-12


def test_many_poles_reach_rounding():
    """Many poles: the banded equations are refined to what double precision allows."""
    factors = Basis(5, (0.3, -0.6))
    one = of_kind(factors, 7, 6, 0, 300)
    assert one.knots.poles == 307
    t = np.linspace(0, 1, 5001)
    assert abs(spline_of(one)(t) - factors.rows(t).T).max() <= 1e-14


@pytest.mark.parametrize("degree", [3, 5, 8])
def test_splines_that_are_there_are_found(degree):
    """Factors in the spline space are reproduced to rounding, whatever the knots."""
    factors = Basis(3, family=BERNSTEIN)
    for end_order in range(4):
        one = approximate(Bundle(factors, np.eye(4)[:, None]), uneven(5, degree), end_order)
        assert dense_error(one, Bundle(factors, np.eye(4)[:, None])) <= 1e-14


# Lawson's iteration


@pytest.mark.parametrize("name", ["A2p", "B3p", "C3s", "D5s", "E8p"])
@pytest.mark.parametrize("spans", [2, 3, 8])
def test_the_iteration_lowers_the_error_of_least_squares(name, spans):
    bundle = curve_bundle(pieces.curves()[name])
    knots = Knots.smooth(equidistributed(bundle, 5, spans), 5)
    plain, refined = (dense_error(approximate(bundle, knots, steps=steps), bundle) for steps in (0, 16))
    assert refined < 0.95 * plain


@pytest.mark.parametrize("name", ["A2p", "B3p", "C3s", "D5s", "E8p"])
def test_the_iteration_never_raises_the_error_on_the_samples(name):
    bundle = curve_bundle(pieces.curves()[name])
    for degree in (3, 5, 9):
        for end_order in range(4):
            knots = uneven(5, degree, seed=degree)
            errors = [approximate(bundle, knots, end_order, steps=steps).error for steps in (0, 2, 8, 32)]
            assert errors == sorted(errors, reverse=True)


@pytest.mark.parametrize("degree", [3, 4, 5, 7])
def test_the_minimax_polynomial_with_fixed_ends(degree):
    """For t^n, n = degree + 1, it is t^n - a T_n stretched until its outer zeros are the ends: known exactly."""
    n = degree + 1
    stretch = math.cos(math.pi / (2 * n))
    best = 2.0**-n * 2 / (2 * stretch) ** n
    unit = np.zeros((n + 1, 1, 2))
    unit[n, 0, 1] = 1
    bundle = Bundle(Basis(n, family=BERNSTEIN), unit)
    one = approximate(bundle, Knots.smooth((0.0, 1.0), degree), steps=40)
    error = dense_error(one, bundle)
    assert best * (1 - 1e-6) <= error <= 1.06 * best
    assert 0.9 * error <= one.error <= error * (1 + 1e-6)


def test_the_error_on_the_samples_is_the_error():
    bundle = curve_bundle(pieces.curves()["E8p"])
    for spans in (1, 4, 12):
        one = approximate(bundle, Knots.smooth(equidistributed(bundle, 5, spans), 5))
        truth = dense_error(one, bundle)
        assert 0.9 * truth <= one.error <= truth * (1 + 1e-6)
        assert one.error == pytest.approx(bundle.norms(one.residual).max(), rel=1e-12)


def test_the_iteration_stops_at_its_goal():
    bundle = curve_bundle(pieces.curves()["D5s"])
    knots = Knots.smooth(equidistributed(bundle, 5, 6), 5)
    plain = approximate(bundle, knots, steps=0)
    stopped = approximate(bundle, knots, goal=plain.error)
    assert np.array_equal(stopped.matrix, plain.matrix)


# Knots


@pytest.mark.parametrize("spans", [1, 2, 5, 17])
@pytest.mark.parametrize("factors", FACTORS, ids=NAMES)
def test_breaks_share_the_derivative_equally(factors, spans):
    degree = 4
    bundle = Bundle(factors, np.eye(factors.count)[:, None])
    breaks = equidistributed(bundle, degree, spans)
    assert breaks[0] == 0
    assert breaks[-1] == 1
    assert (np.diff(breaks) > 0).all()
    line = np.linspace(0, 1, 2001)
    largest = bundle.norms(factors.rows(line, degree + 1).T).max()

    def density(t):
        norm = bundle.norms(factors.rows(np.array([t]), degree + 1).T)[0]
        return (norm / largest) ** (1 / (degree + 1)) + 0.02

    shares = [quad(density, a, b, limit=200)[0] for a, b in itertools.pairwise(breaks)]
    assert max(shares) - min(shares) <= 0.02 * sum(shares)


def test_factors_without_that_derivative_get_equal_spans():
    bundle = Bundle(Basis(2, family=BERNSTEIN), np.eye(3)[:, None])
    assert equidistributed(bundle, 5, 4) == pytest.approx([0, 0.25, 0.5, 0.75, 1])
    zero = Bundle(Basis(4), np.zeros((5, 1, 3)))
    assert equidistributed(zero, 5, 4) == pytest.approx([0, 0.25, 0.5, 0.75, 1])


def test_no_room_for_the_end_conditions():
    assert of_kind(Basis(4), 3, 2, 2, 2) is None
    for spans in (3, 4):
        assert of_kind(Basis(4), 3, 2, 2, spans).knots.spans == spans


# What is kept for the next piece of a kind


def test_approximations_are_kept_by_kind():
    first = of_kind(Basis(7, (0.123, 0.456)), 5, 4, 0, 6)
    assert of_kind(Basis(7, (0.123, 0.456)), 5, 4, 0, 6) is first
    others = [
        of_kind(Basis(7, (0.456, 0.123)), 5, 4, 0, 6),
        of_kind(Basis(7, (0.123, 0.456)), 5, 4, 1, 6),
        of_kind(Basis(7, (0.123, 0.456)), 5, 3, 0, 6),
        of_kind(Basis(7, (0.123, 0.456)), 5, 4, 0, 7),
        of_kind(RestrictedFactors(Basis(7, (0.123, 0.456)), 0.0, 0.5), 5, 4, 0, 6),
    ]
    assert all(isinstance(other, Approximation) and other is not first for other in others)


@pytest.mark.parametrize("continuity", range(5))
def test_approximations_of_a_kind_have_the_continuity(continuity):
    one = of_kind(Basis(5, (0.2, 0.1)), 5, continuity, 0, 4)
    assert one.knots.multiplicities == (6, *[5 - continuity] * 3, 6)
    assert len(one.matrix) == one.knots.poles
