from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.interpolate import BSpline, make_interp_spline
from scipy.optimize import linprog, minimize

from gtcad import Curve, Restricted
from gtcad.basis import Basis
from gtcad.converters import approximation, knot_search
from gtcad.converters.approximation import Bundle, approximate, equidistributed
from gtcad.converters.knot_search import adapted
from gtcad.converters.spline_basis import Knots
from gtcad.factors import Waves
from tests import pieces


def curve_bundle(curve):
    return Bundle(curve.factors, curve.coefficients[:, None, :])


def dense_error(one, bundle, count=4001):
    t = np.linspace(0, 1, count)
    residual = bundle.factors.rows(t).T - BSpline(one.knots.flat, one.matrix, one.knots.degree)(t)
    return np.linalg.norm(np.einsum("ti,ijd->tjd", residual, bundle.vectors), axis=2).max()


def minimax_error(function, flat, degree, t):
    """Least largest error of splines that interpolate both ends, as a linear program."""
    design = BSpline.design_matrix(t, flat, degree).toarray()
    values = function(t)
    fixed = design[:, [0, -1]] @ function(np.array([0.0, 1.0]))
    inner = design[:, 1:-1]
    ones = np.ones((len(t), 1))
    matrix = np.block([[inner, -ones], [-inner, -ones]])
    right = np.concatenate([values - fixed, fixed - values])
    cost = np.zeros(inner.shape[1] + 1)
    cost[-1] = 1
    return linprog(cost, matrix, right, bounds=[(None, None)] * inner.shape[1] + [(0, None)]).fun


@pytest.mark.parametrize(("degree", "spans"), [(3, 3), (4, 3), (5, 3), (3, 4)])
@pytest.mark.parametrize(
    "factors", [Basis(6, (0.9, -0.7)), Basis(4, (-0.5, 1.0)), Basis(3, (-0.6, 0.4)), Waves(0.3, 3.0)], ids=str
)
def test_adapted_knots_are_nearly_the_best_that_there_are(factors, degree, spans):
    """Free knots of a scalar spline: a linear program for each choice, a simplex search over the choices."""
    vector = np.random.default_rng(5).normal(size=factors.count)
    bundle = Bundle(factors, np.stack([vector, 0 * vector], axis=1)[:, None])
    t = (1 - np.cos(np.linspace(0, np.pi, 120))) / 2

    def error(inner):
        breaks = np.concatenate([[0.0], inner, [1.0]])
        if np.diff(breaks).min() < 0.01:
            return 1e3
        return 1e6 * minimax_error(lambda x: vector @ factors.rows(x), Knots.smooth(breaks, degree).flat, degree, t)

    starts = itertools.combinations(np.linspace(0, 1, 7)[1:-1], spans - 1)
    start = min(starts, key=error)
    best = minimize(error, start, method="Nelder-Mead", options={"maxfev": 80}).fun / 1e6
    found = dense_error(adapted(bundle, degree, spans), bundle)
    assert found <= 1.1 * best


@pytest.mark.parametrize("end_order", [0, (2, 1)], ids=str)
@pytest.mark.parametrize("degree", [3, 5, 8])
def test_steps_are_those_of_gauss_and_newton(degree, end_order):
    """The change of the weighted error with each knot, by differences of least-squares solutions."""
    curve = pieces.curves()["D5s"]
    start = equidistributed(curve_bundle(curve), degree, 6)
    for few in (48, 0):
        with pytest.MonkeyPatch.context() as patch:
            for module in (approximation, knot_search):
                patch.setattr(module, "FEW_POLES", few)
            search = knot_search._KnotSearch(curve_bundle(curve), degree, end_order, start)
            weights = np.random.default_rng(0).uniform(0.1, 1, len(search.t))

            def cost(breaks, search=search, weights=weights):
                trial = search._solve(breaks, weights)
                return (weights[:, None] * trial.residual**2).sum() / 2

            moved, _ = search._step(search._solve(start, weights), weights, 1e9)  # so damped: along the gradient
            move = (moved.breaks - start)[1:-1]
            steps = np.eye(7)[1:-1] * 1e-5
            slopes = np.array([(cost(start + step) - cost(start - step)) / 2e-5 for step in steps])
            assert (np.sign(move) == -np.sign(slopes)).all()
            assert cost(moved.breaks) < cost(start)


@pytest.mark.parametrize("name", ["A2p", "B3p", "C3s", "D5s", "E8p"])
@pytest.mark.parametrize("degree", [5, 7])
def test_adapted_knots_are_no_worse_than_equidistributed_ones(name, degree):
    bundle = curve_bundle(pieces.curves()[name])
    for end_order in (0, 2):
        start = equidistributed(bundle, degree, 6)
        plain = dense_error(approximate(bundle, Knots.smooth(start, degree), end_order), bundle)
        one = adapted(bundle, degree, 6, end_order)
        assert one.knots.spans == 6
        assert one.knots.multiplicities == (degree + 1, *[1] * 5, degree + 1)
        assert dense_error(one, bundle) < 1.01 * plain  # the samples that guide the search see a little less
        assert np.diff(one.knots.breaks).min() >= 0.01 / 6  # knots that nearly meet trouble kernels


def test_adaptation_stops_at_its_goal():
    bundle = curve_bundle(pieces.curves()["D5s"])
    best = adapted(bundle, 5, 8)
    relaxed = adapted(bundle, 5, 8, goal=1.5 * best.error)
    assert best.error <= relaxed.error <= 1.5 * best.error


def test_adapted_knots_keep_the_ends_exact():
    curve = pieces.curves()["E8p"]
    one = adapted(curve_bundle(curve), 5, 7, 3)
    poles = one.matrix @ curve.coefficients
    spline = BSpline(one.knots.flat, poles, 5)
    for order in range(4):
        exact = curve.derivative(np.array([0.0, 1.0]), order)
        assert abs(spline([0.0, 1.0], order) - exact).max() <= 1e-11 * abs(exact).max()


def test_an_interpolant_of_scipy_is_no_better_than_the_minimax_spline():
    curve = pieces.curves()["C3s"]
    bundle = curve_bundle(curve)
    one = adapted(bundle, 5, 5)
    t = np.linspace(0, 1, one.knots.poles)
    t[1:-1] = (1 - np.cos(np.pi * np.linspace(0, 1, one.knots.poles)[1:-1])) / 2
    line = np.linspace(0, 1, 2001)
    other = make_interp_spline(t, curve.evaluate(t), 5)
    assert dense_error(one, bundle) < 0.5 * np.linalg.norm(other(line) - curve.evaluate(line), axis=1).max()


def test_no_room_for_the_end_conditions():
    bundle = Bundle(Basis(4), np.eye(5)[:, None])
    assert adapted(bundle, 3, 2, 2) is None
    for spans in (3, 4):
        assert adapted(bundle, 3, spans, 2).knots.spans == spans


def test_parts_are_approximated_like_wholes():
    curve = Restricted(pieces.curves()["D5s"], (0.9, 0.4))
    one = adapted(curve_bundle(curve), 5, 5)
    line = np.linspace(0, 1, 501)
    gap = curve.evaluate(line) - BSpline(one.knots.flat, one.matrix @ curve.coefficients, 5)(line)
    assert np.linalg.norm(gap, axis=1).max() == pytest.approx(one.error, rel=0.1)
    assert isinstance(curve.shape, Curve)
