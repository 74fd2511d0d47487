from __future__ import annotations

import math
from functools import lru_cache

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gtcad import BERNSTEIN, Curve
from gtcad.basis import Basis
from gtcad.chebyshev import interpolation_tail, nodes, transform
from gtcad.converters import fit_curve
from gtcad.errors import InputError
from gtcad.factors import CurveOfTerms, KeyedFactors, RestrictedFactors, Stacked, Waves
from gtcad.measure import length
from gtcad.restricted import Restricted
from tests import reference

QUARTER = Waves(0.0, math.pi / 2)
FACTORS = [Basis(4, (0.5, -0.5)), Basis(3, family=BERNSTEIN), Waves(0.3, 5.0), Waves(-7.0, -0.2)]
NAMES = ["basis", "bernstein", "waves", "backward waves"]


def waves(factors, t, order):
    """1, cos and sin of the angle differentiated at 50 digits."""
    angle = mp.mpf(factors.start) + mp.mpf(factors.sweep) * t + order * mp.pi / 2
    scale = mp.mpf(factors.sweep) ** order
    return [mp.mpf(order == 0), scale * mp.cos(angle), scale * mp.sin(angle)]


# Waves


@given(st.floats(-20, 20), st.floats(-20, 20), st.floats(0, 1), st.integers(0, 7))
def test_waves_and_their_derivatives(start, sweep, t, order):
    factors = Waves(start, sweep)
    with mp.workdps(reference.DIGITS):
        exact = waves(factors, mp.mpf(t), order)
    found = factors.rows(np.array([t]), order)[:, 0]
    allowed = abs(sweep) ** order * factors.rounding
    assert abs(found - np.array([float(x) for x in exact])).max() <= allowed + 1e-300


@given(st.floats(-300, 300), st.floats(-300, 300), st.floats(0, 1))
def test_rounding_of_waves_is_bounded(start, sweep, t):
    factors = Waves(start, sweep)
    with mp.workdps(reference.DIGITS):
        pairs = zip(factors.rows(np.array([t]))[:, 0], waves(factors, mp.mpf(t), 0), strict=True)
        error = mp.fsum(abs(mp.mpf(float(found)) - exact) for found, exact in pairs)
    assert error <= factors.rounding


def test_waves_of_no_sweep_are_constant():
    rows = Waves(0.0, 0.0).rows(np.linspace(0, 1, 5))
    assert np.array_equal(rows, [[1.0] * 5, [1.0] * 5, [0.0] * 5])
    assert not Waves(0.0, 0.0).rows(np.linspace(0, 1, 5), 1).any()


# Bounds of every kind of factors


@pytest.mark.parametrize("order", range(6))
@pytest.mark.parametrize("factors", FACTORS, ids=NAMES)
def test_derivatives_are_within_their_bound(factors, order):
    for one in (factors, RestrictedFactors(factors, 0.8, 0.1), Stacked((factors, QUARTER))):
        largest = abs(one.rows(np.linspace(0, 1, 2001), order)).sum(axis=0).max()
        assert largest <= one.derivative_bound(order) * (1 + 1e-14)
        assert largest >= one.derivative_bound(order) / 1e3  # of use, too


@pytest.mark.parametrize("count", [6, 10, 14])
@pytest.mark.parametrize("factors", FACTORS, ids=NAMES)
def test_interpolants_are_as_near_as_the_derivative_bound_says(factors, count):
    for one in (factors, RestrictedFactors(factors, 0.8, 0.1), Stacked((factors, QUARTER))):
        series = one.rows((nodes(count) + 1) / 2) @ transform(count).T
        z = np.linspace(-1, 1, 501)
        interpolant = series @ np.cos(np.outer(np.arange(count), np.arccos(z)))
        error = abs(interpolant - one.rows((z + 1) / 2)).sum(axis=0).max()
        assert error <= interpolation_tail(0.5, count, one.derivative_bound(count)) + 3e-14


# Parts of the domain


def test_a_part_that_runs_backwards():
    part = RestrictedFactors(QUARTER, 1.0, 0.5)
    t = np.linspace(0, 1, 9)
    angle = math.pi / 2 * (1 - t / 2)
    assert abs(part.rows(t)[1:] - [np.cos(angle), np.sin(angle)]).max() <= 1e-15
    speed = -math.pi / 4
    assert abs(part.rows(t, 1)[1:] - speed * np.array([-np.sin(angle), np.cos(angle)])).max() <= 1e-15


def test_parts_of_parts():
    base = Basis(6, (0.3, -0.8))
    inner = RestrictedFactors(RestrictedFactors(base, 0.9, 0.1), 0.25, 0.75)  # from 0.7 down to 0.3
    t = np.linspace(0, 1, 17)
    for order in range(4):
        expected = (-0.4) ** order * base.rows(0.7 - 0.4 * t, order)
        assert abs(inner.rows(t, order) - expected).max() <= 1e-12 * max(1, abs(expected).max())


# Keys


def test_equal_functions_have_one_key():
    pairs = [
        (Basis(5, (0.1, 0.2)), Basis(5, (0.1, 0.2))),
        (Basis(2, (-0.0, 0.0)), Basis(2)),
        (Waves(1.0, 2.0), Waves(1, 2)),
        (RestrictedFactors(QUARTER, 0.2, 1.0), RestrictedFactors(Waves(0.0, math.pi / 2), 0.2, 1.0)),
        (Stacked((QUARTER, Basis(3))), Stacked((QUARTER, Basis(3)))),
    ]
    for a, b in pairs:
        assert KeyedFactors(a) == KeyedFactors(b)
        assert hash(KeyedFactors(a)) == hash(KeyedFactors(b))


def test_different_functions_have_different_keys():
    different = [
        Basis(5, (0.1, 0.2)),
        Basis(5, (0.2, 0.1)),
        Basis(4, (0.1, 0.2)),
        Basis(5),
        Basis(5, family=BERNSTEIN),
        QUARTER,
        Waves(math.pi / 2, 0.0),
        RestrictedFactors(QUARTER, 0.0, 0.5),
        RestrictedFactors(QUARTER, 0.5, 0.0),
        RestrictedFactors(RestrictedFactors(QUARTER, 0.0, 0.5), 0.0, 0.5),
        Stacked((QUARTER,)),
        Stacked((QUARTER, Basis(5))),
        Stacked((Basis(5), QUARTER)),
    ]
    assert len({KeyedFactors(one) for one in different}) == len(different)
    assert KeyedFactors(QUARTER) != QUARTER


def test_keyed_factors_are_looked_up_in_caches():
    calls = []

    @lru_cache
    def work(kept):
        calls.append(kept)
        return kept.factors.count

    assert work(KeyedFactors(Basis(5))) == work(KeyedFactors(Basis(5))) == 6
    assert work(KeyedFactors(Basis(5, (0.0, 0.1)))) == 6
    assert len(calls) == 2


# Curves of terms


def test_a_curve_of_waves_is_a_circle():
    center, radius = np.array([3.0, -2.0]), 7.0
    curve = CurveOfTerms(Waves(0.4, 2.5), [center, [radius, 0], [0, radius]])
    t = np.linspace(0, 1, 101)
    assert abs(np.linalg.norm(curve.evaluate(t) - center, axis=1) - radius).max() <= 1e-14 * radius
    assert float(length(curve)) == pytest.approx(2.5 * radius, rel=1e-13)
    assert curve.evaluate(0.0).tolist() == pytest.approx(center + radius * np.array([math.cos(0.4), math.sin(0.4)]))


def test_a_curve_of_terms_keeps_its_own_coefficients():
    given = np.ones((3, 2))
    curve = CurveOfTerms(QUARTER, given)
    given[0, 0] = 9
    assert curve.coefficients[0, 0] == 1


@pytest.mark.parametrize("factors", FACTORS, ids=NAMES)
def test_affine_images_of_curves_of_terms(factors):
    rng = np.random.default_rng(4)
    curve = CurveOfTerms(factors, rng.normal(size=(factors.count, 3)))
    matrix, offset = rng.normal(size=(3, 3)), rng.normal(size=3)
    t = np.linspace(0, 1, 33)
    moved = curve.transformed(matrix, offset)
    assert abs(moved.evaluate(t) - (curve.evaluate(t) @ matrix.T + offset)).max() <= 1e-13
    assert abs(moved.derivative(t, 2) - curve.derivative(t, 2) @ matrix.T).max() <= 1e-12
    assert abs(curve.transformed(matrix).evaluate(t) - curve.evaluate(t) @ matrix.T).max() <= 1e-13
    again = moved.transformed(np.eye(3), -offset)
    assert abs(again.evaluate(t) - curve.evaluate(t) @ matrix.T).max() <= 1e-13


def test_a_plane_curve_of_terms_is_lifted_into_space():
    curve = CurveOfTerms(QUARTER, [[0, 0], [2, 0], [0, 2]]).transformed(np.eye(3, 2), [0, 0, 5])
    assert curve.dimension == 3
    assert curve.evaluate(1.0).tolist() == pytest.approx([0, 2, 5])


def test_matrices_that_do_not_fit_are_refused():
    curve = CurveOfTerms(QUARTER, [[0, 0], [2, 0], [0, 2]])
    with pytest.raises(InputError, match=r"matrix must have shape \(2 or 3, 2\), got \(3, 3\)"):
        curve.transformed(np.eye(3))


def test_a_part_of_a_curve_of_terms():
    curve = CurveOfTerms(QUARTER, [[0, 0], [2, 0], [0, 2]])
    part = Restricted(curve, (1.0, 1 / 3))
    assert part.evaluate(0.0).tolist() == pytest.approx([0, 2])
    assert part.evaluate(1.0).tolist() == pytest.approx([math.sqrt(3), 1])


@pytest.mark.parametrize("sweep", [0.5, 2 * math.pi, -9.0, 40.0])
def test_turns_of_a_helix_are_fitted_within_the_tolerance(sweep):
    """Waves beside a straight line: the spline is held against the formula at 50 digits."""
    factors = Stacked((Waves(0.1, sweep), Basis(1, family=BERNSTEIN)))
    curve = CurveOfTerms(factors, [[1, 2, 3], [50, 0, 0], [0, 50, 0], [0, 0, -20], [0, 0, 30]])
    fit = fit_curve(curve, tolerance=1e-5, degree=7)
    t = np.linspace(0, 1, 301)
    with mp.workdps(reference.DIGITS):
        rows = [waves(factors.parts[0], mp.mpf(x), 0) for x in t.tolist()]
        points = [[1 + 50 * c, 2 + 50 * s, 3 - 20 * (1 - x) + 30 * x] for (_, c, s), x in zip(rows, t, strict=True)]
        points = np.array([[float(x) for x in point] for point in points])
    gap = np.linalg.norm(points - fit.spline.evaluate(t), axis=1).max()
    assert gap <= fit.deviation[1] <= 1e-5
    assert gap >= 0.5 * fit.deviation[0]


def test_the_quarter_circle_is_the_curve_of_degree_2():
    waves = CurveOfTerms(QUARTER, [[0, 0], [1, 0], [0, 1]])
    t = np.linspace(0, 1, 101)
    assert abs(waves.evaluate(t) - Curve([[1, 0], [1, 1], [0, 1]]).evaluate(t)).max() <= 1e-15
