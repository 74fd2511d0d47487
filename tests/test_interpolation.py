from __future__ import annotations

import math

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import BarycentricInterpolator

from gtcad import BERNSTEIN, GT, Basis, Curve
from gtcad.errors import InputError
from gtcad.interpolation import approximate, interpolate
from tests import pieces, reference

LINE = np.linspace(0, 1, 201)
NO_BASIS = (-1.0, -1.0)


def zigzag(count, dimension=3, seed=0):
    points = np.random.default_rng(seed).normal(0, 0.3, (count, dimension))
    points[:, 0] = np.linspace(0, 1, count)
    return 100 * points


def noisy(degree, seed, count=80):
    rng = np.random.default_rng(seed)
    curve = pieces.random_curve(rng, degree, 1.0)
    t = np.linspace(0, 1, count)
    return curve.evaluate(t) + rng.normal(0, 0.02, (count, 3)), t, rng


def squares(curve, t, points, weights=None):
    distances = ((curve.evaluate(t) - points) ** 2).sum(axis=1)
    return float(distances.sum() if weights is None else weights @ distances)


# --- through points -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("parameters", ["chord", "centripetal", "uniform"])
@pytest.mark.parametrize("degree", [2, 3, 7, 15, 24])
def test_the_points_lie_on_the_curve_at_parameters_in_proportion_to_powers_of_the_chords(degree, parameters):
    points = zigzag(degree + 1)
    exponent = {"chord": 1, "centripetal": 0.5, "uniform": 0}[parameters]
    t = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1) ** exponent)])
    for gamma in ((0, 0), (0.7, -0.9), (1, 1), (-1, 0.5)):
        curve = interpolate(points, gamma=gamma, parameters=parameters)
        assert (curve.degree, curve.gamma) == (degree, gamma)
        assert np.abs(curve.evaluate(t / t[-1]) - points).max() <= 1e-14 * np.abs(curve.control_points).max()
        assert np.array_equal(curve.control_points[[0, -1]], points[[0, -1]])


@given(st.integers(0, 10**6), st.integers(2, 10))
def test_a_curve_is_the_one_through_its_own_points(seed, degree):
    rng = np.random.default_rng(seed)
    planted = pieces.random_curve(rng, degree, 50.0)
    if degree == 2 and planted.gamma[0] + planted.gamma[1] < -1.99:
        return
    t = np.sort((np.arange(degree + 1) + rng.uniform(0, 0.5, degree + 1)) / (degree + 1))
    found = interpolate(planted.evaluate(t), gamma=planted.gamma, parameters=t)
    condition = np.linalg.cond(planted.factors.evaluate(t))
    assert np.abs(found.control_points - planted.control_points).max() <= 1e-13 * condition


def test_three_points_of_a_circle_give_its_quarter():
    root = math.sqrt(0.5)
    curve = interpolate([[1, 0], [root, root], [0, 1]])
    assert np.abs(np.hypot(*curve.evaluate(LINE).T) - 1).max() < 1e-15
    assert np.abs(curve.control_points - [[1, 0], [1, 1], [0, 1]]).max() < 1e-15


def test_classical_curves_are_the_interpolation_polynomials():
    points, t = zigzag(9), (1 - np.cos(np.pi * np.arange(9) / 8)) / 2
    curve = interpolate(points, parameters=t, family=BERNSTEIN)
    assert np.abs(curve.evaluate(LINE) - BarycentricInterpolator(t, points)(LINE)).max() < 1e-11
    assert interpolate([[0, 1], [2, 3]], family=BERNSTEIN).degree == 1


@pytest.mark.parametrize(
    ("points", "how", "message"),
    [
        ([[0, 0], [1, math.nan], [2, 0]], {}, r"points\[1, 1\] must be finite, got nan"),
        ([[0, 0], [1, 1]], {}, r"degree must be a whole number in \[2, 60\]"),
        (zigzag(62), {}, r"degree must be a whole number in \[2, 60\]"),
        (zigzag(5), {"gamma": (0, 2)}, r"gamma\[1\] must lie in \[-1, 1\], got 2"),
        (zigzag(5), {"parameters": "arc"}, "parameters must be one of chord, centripetal, uniform or numbers"),
        (zigzag(3), {"parameters": [0, 0.5, 0.5]}, "parameters must increase, got 0.5 and 0.5 at points 1 and 2"),
        (zigzag(3), {"parameters": [0, 0.7, 0.5]}, "parameters must increase"),
        (zigzag(3), {"parameters": [0, 0.7, 1.5]}, r"parameters must lie in \[0, 1\], got 1.5"),
        (zigzag(3), {"parameters": [0, math.nan, 1]}, r"parameters must lie in \[0, 1\], got nan"),
        (zigzag(3), {"parameters": [0, 1]}, r"parameters must be one for each of 3 points, got shape \(2,\)"),
        (zigzag(3), {"parameters": ["a", "b", "c"]}, "parameters must be numbers"),
        ([[0, 0], [1, 1], [1, 1]], {}, "chord parameters of the points must increase, .* at points 1 and 2"),
        ([[1, 1]] * 3, {}, "points must be two different ones"),
        (zigzag(3), {"gamma": NO_BASIS}, "numerically singular"),
        (zigzag(51), {"parameters": "uniform"}, "numerically singular"),
    ],
)
def test_bad_interpolation_is_refused(points, how, message):
    with pytest.raises(InputError, match=message):
        interpolate(points, **how)


# --- nearest to points: planted curves ----------------------------------------------------------------------------


def assert_recovered(seed, degree):
    rng = np.random.default_rng(seed)
    planted = pieces.random_curve(rng, degree, 100.0)
    fit = approximate(planted.evaluate(LINE), degree, parameters=LINE)
    assert fit.deviation[0] <= fit.deviation[1] <= 1e-11
    if degree <= 6 and (degree > 2 or -1 not in planted.gamma):  # where they are well determined
        assert np.abs(np.subtract(fit.curve.gamma, planted.gamma)).max() <= 1e-8
        assert np.abs(fit.curve.control_points - planted.control_points).max() <= 1e-6


@pytest.mark.parametrize("degree", [2, 3, 4, 6, 9, 14, 30])
@pytest.mark.parametrize("seed", range(4))
def test_planted_control_points_and_design_variables_come_back(seed, degree):
    assert_recovered(seed, degree)


@pytest.mark.stress
@given(st.integers(0, 10**9), st.integers(2, 20))
def test_many_planted_curves_come_back(seed, degree):
    assert_recovered(seed, degree)


def test_design_variables_are_those_of_the_published_recursion():
    gamma, control = (0.35, -0.6), np.array([[0, 0], [1, 3], [4, 1], [5, -2.0]])
    t = np.linspace(0, 1, 25)
    rows = [[float(w) for w in reference.values("GT", 3, gamma, mp.mpf(float(x)))] for x in t]
    fit = approximate(np.array(rows) @ control, 3, parameters=t)
    assert np.abs(np.subtract(fit.curve.gamma, gamma)).max() < 1e-11
    assert np.abs(fit.curve.control_points - control).max() < 1e-10


def test_the_mirrored_points_give_the_mirrored_curve():
    points, t, _ = noisy(4, 5)
    fit, mirrored = (approximate(points[::k], 4, parameters=t) for k in (1, -1))
    assert np.abs(np.subtract(fit.curve.gamma, mirrored.curve.gamma[::-1])).max() < 1e-6
    assert abs(fit.deviation[0] - mirrored.deviation[0]) < 1e-12


# --- nearest to points: the least squares -------------------------------------------------------------------------


@pytest.mark.parametrize("fixed_ends", [False, True])
@pytest.mark.parametrize("degree", [2, 5, 11])
@pytest.mark.parametrize("weighted", [False, True])
def test_given_design_variables_leave_linear_least_squares(degree, fixed_ends, weighted):
    points, t, rng = noisy(degree, degree)
    weights = rng.uniform(0.1, 9, len(t)) if weighted else np.ones(len(t))
    gamma = (0.3, -0.4)
    fit = approximate(points, degree, gamma=gamma, parameters=t, weights=weights, fixed_ends=fixed_ends)
    matrix, target = Basis(degree, gamma).evaluate(t), points
    wanted = np.zeros((degree + 1, 3))
    free = slice(1, -1) if fixed_ends else slice(None)
    if fixed_ends:
        wanted[[0, -1]] = points[[0, -1]]
        target = points - matrix @ wanted
    roots = np.sqrt(weights)[:, None]
    wanted[free] = np.linalg.lstsq(matrix[:, free] * roots, target * roots, rcond=None)[0]
    assert np.abs(fit.curve.control_points - wanted).max() < 1e-10
    distances = np.linalg.norm(Curve(wanted, gamma).evaluate(t) - points, axis=1)
    assert fit.deviation[1] == pytest.approx(distances.max(), abs=1e-11)
    assert fit.deviation[0] == pytest.approx(math.sqrt(weights @ distances**2 / weights.sum()), abs=1e-11)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("degree", [2, 3, 5])
def test_no_design_variables_of_a_fine_grid_and_no_neighbour_are_nearer(degree, seed):
    points, t, rng = noisy(degree, seed)
    fit = approximate(points, degree, parameters=t, fixed_ends=False)
    least = squares(fit.curve, t, points)
    for a in np.linspace(-1, 1, 21):
        for b in np.linspace(-1, 1, 21):
            matrix = Basis(degree, (a, b)).evaluate(t)
            control = np.linalg.lstsq(matrix, points, rcond=1e-13)[0]
            assert least <= ((matrix @ control - points) ** 2).sum() * (1 + 1e-12)
    for _ in range(50):
        gamma = np.clip(fit.curve.gamma + rng.normal(0, 1e-3, 2), -1, 1)
        control = fit.curve.control_points + rng.normal(0, 1e-3, fit.curve.control_points.shape)
        assert squares(Curve(control, gamma), t, points) >= least


@pytest.mark.parametrize(("degree", "orders"), [(3, (1, 1)), (4, (2, 1)), (6, (0, 3)), (7, (3, 3)), (5, (2, 2))])
def test_end_derivatives_are_met_and_the_rest_is_nearest(degree, orders):
    rng = np.random.default_rng(degree)
    source = pieces.random_curve(rng, 9, 1.0)
    points = source.evaluate(LINE)
    ends = tuple(
        np.array([source.derivative(x, r) for r in range(1, order + 1)])
        for x, order in zip((0.0, 1.0), orders, strict=True)
    )
    fit = approximate(points, degree, parameters=LINE, end_derivatives=ends)
    for x, order in zip((0.0, 1.0), orders, strict=True):
        for r in range(order + 1):
            wanted = source.derivative(x, r)
            assert np.abs(fit.curve.derivative(x, r) - wanted).max() <= 1e-12 * max(1, np.abs(wanted).max())
    assert np.array_equal(fit.curve.control_points[[0, -1]], points[[0, -1]])
    least = squares(fit.curve, LINE, points)
    for gamma in rng.uniform(-1, 1, (40, 2)):
        other = approximate(points, degree, gamma=gamma, parameters=LINE, end_derivatives=ends)
        assert squares(other.curve, LINE, points) >= least * (1 - 1e-12)


def test_what_no_point_determines_stays_on_the_chord():
    sweep = np.sin(np.pi / 2 * LINE) ** 2
    fit = approximate(np.outer(sweep, [4, 2]), 2, gamma=NO_BASIS, parameters=LINE)
    assert np.abs(fit.curve.control_points - [[0, 0], [2, 1], [4, 2]]).max() < 1e-15
    assert fit.deviation[1] < 1e-14


def test_a_family_without_design_variables_has_none_to_search():
    points, t, _ = noisy(4, 1)
    fit = approximate(points, 4, parameters=t, family=BERNSTEIN, fixed_ends=False)
    wanted = np.polynomial.Polynomial.fit(t, points[:, 0], 4)(LINE)
    assert fit.curve.gamma == (0.0, 0.0)
    assert np.abs(fit.curve.evaluate(LINE)[:, 0] - wanted).max() < 1e-13


# --- corrected parameters -----------------------------------------------------------------------------------------


def test_uneven_points_of_an_ellipse_find_its_arc():
    angle = np.sort(np.random.default_rng(0).uniform(0, np.pi / 2, 60))
    angle[[0, -1]] = 0, np.pi / 2
    points = np.stack([3 * np.cos(angle), 2 * np.sin(angle)], axis=1)
    plain = approximate(points, 2, gamma=(0, 0))
    fit = approximate(points, 2, gamma=(0, 0), correct_parameters=True)
    assert plain.deviation[1] > 1e-2
    assert plain.iterations == 0 < fit.iterations
    assert fit.deviation[1] < 1e-12
    assert np.abs(np.hypot(*(fit.curve.evaluate(LINE) / [3, 2]).T) - 1).max() < 1e-12
    assert np.abs(fit.parameters - angle / (np.pi / 2)).max() < 1e-10


@pytest.mark.parametrize("fixed_ends", [False, True])
@pytest.mark.parametrize("degree", [3, 5])
def test_corrected_parameters_are_foot_points_and_nearer(degree, fixed_ends):
    points, _, _ = noisy(degree, 3)
    plain, fit = (approximate(points, degree, fixed_ends=fixed_ends, correct_parameters=how) for how in (False, True))
    assert fit.deviation[0] < plain.deviation[0]
    gaps, slopes = points - fit.curve.evaluate(fit.parameters), fit.curve.derivative(fit.parameters)
    inside = (fit.parameters > 0) & (fit.parameters < 1)
    across = (gaps * slopes).sum(axis=1) / np.linalg.norm(slopes, axis=1)
    assert inside.sum() > 70
    assert np.abs(across[inside]).max() < 1e-3 * fit.deviation[1]
    if fixed_ends:
        assert fit.parameters[[0, -1]].tolist() == [0, 1]
        assert np.array_equal(fit.curve.control_points[[0, -1]], points[[0, -1]])


@pytest.mark.parametrize(
    ("count", "how", "message"),
    [
        (5, {"degree": 4}, "points must be at least 6 for degree 4, got 5"),
        (4, {"degree": 4, "gamma": (0, 0)}, "points must be at least 5 for degree 4, got 4"),
        (9, {"degree": 1}, "degree must be a whole number"),
        (9, {"degree": 2.5}, "degree must be a whole number"),
        (9, {"degree": 3, "gamma": (0, math.nan)}, r"gamma\[1\] must lie in"),
        (9, {"degree": 3, "weights": [1] * 8}, r"weights must be one for each of 9 points, got shape \(8,\)"),
        (9, {"degree": 3, "weights": [1] * 8 + [0]}, "weights must be finite and above 0, got 0"),
        (9, {"degree": 3, "weights": [1] * 8 + [math.nan]}, "weights must be finite and above 0, got nan"),
        (9, {"degree": 3, "weights": "heavy"}, "weights must be numbers"),
        (9, {"degree": 3, "parameters": np.linspace(0.1, 1, 9)}, "fixed ends need parameters from 0 to 1"),
        (9, {"degree": 3, "parameters": np.linspace(1, 0, 9)}, "parameters must increase"),
        (9, {"degree": 3, "end_derivatives": ([[1, 0]], ())}, r"end_derivatives\[0\] must be finite, shape \(k, 3\)"),
        (9, {"degree": 3, "end_derivatives": ((), [[1, 0, math.inf]])}, r"end_derivatives\[1\] must be finite"),
        (9, {"degree": 3, "end_derivatives": ([[1, 0, 0]], ()), "fixed_ends": False}, "need fixed ends"),
        (9, {"degree": 3, "end_derivatives": ([[1, 0, 0]] * 2, [[1, 0, 0]])}, "degree 3 is too low"),
    ],
)
def test_bad_fits_are_refused(count, how, message):
    with pytest.raises(InputError, match=message):
        approximate(zigzag(count), **how)


def test_points_may_be_given_twice_in_a_fit():
    points = np.repeat(zigzag(12), 2, axis=0)
    fit = approximate(points, 3, gamma=(0, 0))
    assert np.array_equal(fit.parameters[::2], fit.parameters[1::2])
    assert GT is fit.curve.family
