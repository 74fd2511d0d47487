from __future__ import annotations

import math
import pickle
import warnings

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gtcad import BERNSTEIN, Curve, Restricted
from gtcad.basis import Basis
from gtcad.chebyshev import nodes, transform
from gtcad.converters import fit_curve
from gtcad.factors import CurveOfTerms, RestrictedFactors, Stacked, Waves
from gtcad.polynomial import MAX_COUNT, Polynomials, Spanned, chopped, derivative_rounding, resolved
from tests import reference

T = np.concatenate([[0.0, 1.0, 0.5, 1e-17, 1e-9, 1 - 1e-16, 0.5 + 1e-16], np.linspace(0.001, 0.999, 23)])


def random_polynomials(seed, degree=40, decay=0.8):
    return Polynomials(np.random.default_rng(seed).normal(size=(3, degree + 1)) * decay ** np.arange(degree + 1))


def exact(polynomials, t, order):
    """Derivatives by the power series of T_j, at many digits."""
    with mp.workdps(120):
        total = [mp.mpf(0)] * polynomials.count
        before, now = [mp.mpf(1)], [mp.mpf(-1), mp.mpf(2)]  # in powers of t
        for j in range(polynomials.degree + 1):
            monomials = before if j == 0 else now
            if j > 1:
                twice = [-2 * c for c in now] + [mp.mpf(0)]
                for k, c in enumerate(now):
                    twice[k + 1] += 4 * c
                for k, c in enumerate(before):
                    twice[k] -= c
                before, now = now, twice
                monomials = now
            value = mp.fsum(
                math.perm(k, order) * c * mp.mpf(t) ** (k - order) for k, c in enumerate(monomials) if k >= order
            )
            total = [x + mp.mpf(float(a)) * value for x, a in zip(total, polynomials.coefficients[:, j], strict=True)]
        return total


@pytest.mark.parametrize("order", [0, 1, 2, 5])
def test_values_and_derivatives_within_the_rounding_that_is_said(order):
    polynomials = random_polynomials(3)
    found = polynomials.rows(T, order)
    for k, t in enumerate(T):
        error = mp.fsum(
            abs(mp.mpf(float(x)) - y) for x, y in zip(found[:, k], exact(polynomials, t, order), strict=True)
        )
        assert error <= polynomials.rounding_of(order)
    assert polynomials.rounding_of(order) <= 1e-12 * polynomials.derivative_bound(order)
    assert polynomials.rounding == polynomials.rounding_of(0)


@given(st.integers(0, 100), st.integers(0, 30), st.integers(0, 12))
def test_bounds_of_derivatives_hold(seed, degree, order):
    polynomials = random_polynomials(seed, degree)
    largest = abs(polynomials.rows(np.linspace(0, 1, 301), order)).sum(axis=0).max()
    assert largest <= polynomials.derivative_bound(order)
    if order > degree:
        assert polynomials.derivative_bound(order) == polynomials.rounding_of(order) == largest == 0
    else:
        ratio = polynomials.derivative_bound(order) / (2.0**order * math.factorial(order))
        assert polynomials.taylor[order] == pytest.approx(ratio, rel=1e-11)


def test_the_bound_of_a_single_function_is_attained():
    ends = Polynomials(np.eye(9)[8:])  # T_8, whose derivatives are largest at the ends
    for order in range(9):
        largest = abs(ends.rows(np.ones(1), order))[0, 0]
        assert largest <= ends.derivative_bound(order) <= largest * (1 + 1e-11)


def test_bounds_of_high_degrees_are_no_nonsense():
    polynomials = Polynomials(np.vstack([np.ones(MAX_COUNT), np.zeros(MAX_COUNT)]))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        bounds = [polynomials.derivative_bound(k) for k in range(MAX_COUNT + 2)]
    assert max(bounds) == math.inf
    assert not any(map(math.isnan, bounds))
    assert bounds[-1] == bounds[-2] == 0


def test_equal_polynomials():
    one, other = random_polynomials(1), random_polynomials(2)
    copy = pickle.loads(pickle.dumps(one))
    assert copy == one
    assert hash(copy) == hash(one)
    assert one != other
    assert one.key != other.key
    assert Polynomials(np.zeros((2, 3))).key != Polynomials(np.zeros((3, 2))).key
    assert Polynomials(np.array([[-0.0]])) == Polynomials(np.array([[0.0]]))
    with pytest.raises(ValueError, match="read-only"):
        one.coefficients[0] = 0


def test_a_curve_of_polynomials_is_fitted_and_proved():
    curve = CurveOfTerms(random_polynomials(4, 20, 0.5), 30 * np.eye(3))
    for part in (curve, Restricted(curve, (0.9, 0.2))):
        fit = fit_curve(part, tolerance=1e-6)
        t = np.linspace(0, 1, 2001)
        gaps = np.linalg.norm(part.evaluate(t) - fit.spline.evaluate(t), axis=1)
        assert gaps.max() <= fit.deviation[1] <= 1e-6


# Resolution


def samples(function):
    def series(count):
        return function((nodes(count) + 1) / 2)[None] @ transform(count).T

    return series


def test_functions_are_resolved_to_rounding():
    whole, kept = resolved(samples(np.exp))
    assert kept.shape[1] <= 16
    assert np.array_equal(whole[:, : kept.shape[1]], kept)
    assert abs(Polynomials(kept).rows(T) - np.exp(T)).max() <= 4e-15  # 16 units of the largest coefficient, 1.75
    runge = resolved(samples(lambda t: 1 / (1 + 25 * (t - 0.5) ** 2)))[1]  # poles at 1/2 +- i/5
    assert abs(Polynomials(runge).rows(T) - 1 / (1 + 25 * (T - 0.5) ** 2)).max() <= 1e-13


def test_noise_is_left_out():
    noise = np.random.default_rng(0)
    whole, kept = resolved(samples(lambda t: np.exp(t) + 1e-13 * noise.normal(size=t.size)))
    assert kept.shape[1] <= 15 < whole.shape[1]
    assert abs(Polynomials(kept).rows(T) - np.exp(T)).max() <= 1e-12


@pytest.mark.parametrize("function", [lambda t: abs(t - 0.3), lambda t: 1 / (1 + 1e6 * (t - 0.3) ** 2), np.sqrt])
def test_functions_that_are_not_resolved(function):
    assert resolved(samples(function)) is None


def test_chopped_series():
    series = np.array([[1.0, 0.1, 1e-9, 0.0]])
    assert chopped(series, 1e-12).tolist() == [[1.0, 0.1, 1e-9]]
    assert chopped(series, 1e-3).tolist() == [[1.0, 0.1]]
    assert chopped(0 * series, 1e-3).tolist() == [[0.0]]


# Bounds on spans


WAVE = Curve([[0, 0, 0], [30, 20, 10], [60, -20, 5], [100, 10, 0]], (0.4, -0.6))
CUBIC = CurveOfTerms(random_polynomials(5, 3), np.eye(3))


def fields(spans):
    return Spanned.of(WAVE, 1, spans), Spanned.of(WAVE, 2, spans), Spanned.of(CUBIC, 0, spans)


@pytest.mark.parametrize("spans", [1, 4, 16])
def test_largest_and_least_values_are_bounded_and_near(spans):
    first, second, other = fields(spans)
    t = np.linspace(0, 1, 20001)
    a, b, c = WAVE.derivative(t, 1), WAVE.derivative(t, 2), CUBIC.evaluate(t)
    pairs = [
        (first, a),
        (first.cross(second), np.cross(a, b)),
        (first.dot(other), np.sum(a * c, axis=1, keepdims=True)),
        (other.times(first.dot(first)), c * np.sum(a * a, axis=1, keepdims=True)),
        (first - second, a - b),
        (first.dot(first).plus(-900.0), np.sum(a * a, axis=1, keepdims=True) - 900.0),
    ]
    for field, dense in pairs:
        largest = float(np.linalg.norm(dense, axis=1).max())
        assert largest <= field.largest() <= 1.02 * largest
    square = first.dot(first).least()
    spread = np.sum(a * a, axis=1).reshape(-1)
    for k, bound in enumerate(square):
        inside = (t >= k / spans) & (t <= (k + 1) / spans)
        assert 0 <= bound <= spread[inside].min()
    if spans == 16:
        assert square.min() >= 0.6 * spread.min()
        assert first.largest(np.sqrt(square)) >= 1
    assert first.largest(2.0) == pytest.approx(first.largest() / 2, rel=1e-12)


def test_what_is_resolved_has_no_tail_and_what_is_not_has():
    assert fields(16)[0].tail <= 1e-16 * 100
    steep = CurveOfTerms(Waves(0.0, 200.0), np.eye(3))
    assert Spanned.of(steep, 0, 1).tail >= 1
    assert Spanned.of(steep, 0, 1).largest() >= math.sqrt(2)


def test_errors_of_coefficients_count():
    exact_field, vague = (Spanned.of(WAVE, 1, 4, error) for error in (0.0, 0.1))
    assert vague.largest() - exact_field.largest() >= 0.1
    assert (vague.dot(vague).least() <= exact_field.dot(exact_field).least()).all()


# Rounding of derivatives


def basis_rows(factors, t, order):
    return [row[order] * mp.factorial(order) for row in reference.taylor_rows(*key(factors), t, order)]


def key(factors):
    return factors.family.name, factors.degree, factors.gamma


def waves_rows(factors, t, order):
    angle = mp.mpf(factors.start) + mp.mpf(factors.sweep) * t + order * mp.pi / 2
    return [mp.mpf(order == 0), *(mp.mpf(factors.sweep) ** order * f(angle) for f in (mp.cos, mp.sin))]


def true_rows(factors, t, order):
    if isinstance(factors, RestrictedFactors):
        start, end = mp.mpf(factors.start), mp.mpf(factors.end)
        return [x * (end - start) ** order for x in true_rows(factors.base, start + (end - start) * t, order)]
    if isinstance(factors, Stacked):
        return [x for part in factors.parts for x in true_rows(part, t, order)]
    return basis_rows(factors, t, order) if isinstance(factors, Basis) else waves_rows(factors, t, order)


KINDS = [
    Basis(2, (-1.0, 0.5)),
    Basis(6, (0.9, -0.8)),
    Basis(30, (0.3, 0.4)),
    Basis(9, family=BERNSTEIN),
    Waves(0.3, 40.0),
    RestrictedFactors(Basis(7, (0.5, -0.5)), 0.9, 0.15),
    Stacked((Waves(0.0, 2.0), Basis(3))),
]


@settings(max_examples=12, deadline=None)
@given(st.floats(0, 1))
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("factors", KINDS, ids=[str(k) for k in range(len(KINDS))])
def test_rounding_of_derivatives_is_bounded(factors, order, t):
    with mp.workdps(reference.DIGITS):
        found = factors.rows(np.array([t]), order)[:, 0]
        error = mp.fsum(
            abs(mp.mpf(float(x)) - y) for x, y in zip(found, true_rows(factors, mp.mpf(t), order), strict=True)
        )
    assert error <= derivative_rounding(factors, order)
