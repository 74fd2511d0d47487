from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest

from gtcad import Curve, Restricted
from gtcad.converters import BSplineCurve, BSplineSurface, fit_curve, fit_surface
from gtcad.converters.certificate import certify_curve, certify_surface
from gtcad.converters.exact import exact_curve, exact_surface
from gtcad.errors import InputError
from tests import pieces, reference, splines

POINTS = 2000


def curve_case(seed):
    rng = np.random.default_rng(seed)
    size = 10 ** rng.uniform(-3, 5)
    curve = pieces.random_curve(rng, int(rng.integers(2, 14)), size, int(rng.integers(2, 4)))
    tolerance = size * 10 ** rng.uniform(-9, -2)
    degree = int(rng.choice([3, 4, 5, 7, 9, 11]))
    fit = fit_curve(curve, tolerance=tolerance, degree=degree, exact=False, adapt=bool(rng.integers(2)))
    return curve, fit, tolerance


def check_curve_case(seed, count):
    """upper / true maximum, the truth taken at 50 digits."""
    curve, fit, tolerance = curve_case(seed)
    line = np.linspace(0, 1, 20 * count + 1)
    gaps = np.linalg.norm(curve.evaluate(line) - fit.spline.evaluate(line), axis=1)
    places = np.concatenate([np.linspace(0, 1, count // 2), line[np.argsort(gaps)[-count // 2 :]]])
    truth = max(splines.curve_error(curve, fit.spline, float(t)) for t in places)
    lower, upper = fit.deviation
    assert truth <= upper <= tolerance
    assert lower <= upper
    return figures(curve, truth, lower, upper)


def figures(shape, truth, lower, upper):
    """(upper, lower) over the truth, less what rounding may take: some splines are the shape to the last digit."""
    rounding = 1e-12 * np.abs(shape.coefficients).max()
    return max(upper - rounding, truth) / truth, lower / truth


def surface_case(seed):
    rng = np.random.default_rng(seed)
    size = 10 ** rng.uniform(-3, 5)
    surface = pieces.random_surface(rng, tuple(rng.integers(2, 14, 2).tolist()), size)
    tolerance = size * 10 ** rng.uniform(-8, -2)
    degree = int(rng.choice([4, 5, 7, 9]))
    return surface, fit_surface(surface, tolerance=tolerance, degree=degree, exact=False, adapt=False), tolerance


def check_surface_case(seed, count):
    surface, fit, tolerance = surface_case(seed)
    lower, upper = fit.deviation
    line = np.linspace(0, 1, 401)
    u, v = line[:, None], line[None, :]
    gaps = np.linalg.norm(surface.evaluate(u, v) - fit.spline.evaluate(u, v), axis=2)
    rng = np.random.default_rng(seed)
    worst = np.argsort(gaps.reshape(-1))[-count // 2 :]  # half where double precision finds it largest
    places = [(line[k // 401], line[k % 401]) for k in worst] + rng.random((count - len(worst), 2)).tolist()
    truth = max(splines.surface_error(surface, fit.spline, float(a), float(b)) for a, b in places)
    assert truth <= upper <= tolerance
    return figures(surface, truth, lower, upper)


def assert_tight(ratios):
    uppers = np.array([upper for upper, _ in ratios])
    assert np.median(uppers) <= 1.05
    assert uppers.max() <= 1.3
    assert max(lower for _, lower in ratios) <= 1.03  # the points may miss the maximum by a little


def test_upper_bounds_of_curves_hold_at_50_digits_and_are_tight():
    assert_tight([check_curve_case(seed, POINTS) for seed in range(6)])


def test_upper_bounds_of_curves_hold_for_many_cases():
    assert_tight([check_curve_case(seed, 250) for seed in range(100, 130)])


def test_upper_bounds_of_surfaces_hold_at_50_digits_and_are_tight():
    assert_tight([check_surface_case(seed, 60) for seed in range(8)])


@pytest.mark.stress
def test_upper_bounds_of_curves_stress():
    assert_tight([check_curve_case(seed, POINTS) for seed in range(1000, 1150)])


@pytest.mark.stress
def test_upper_bounds_of_surfaces_stress():
    assert_tight([check_surface_case(seed, POINTS) for seed in range(1000, 1030)])


def test_a_moved_pole_is_found_out():
    curve = pieces.curves()["D5s"]
    spline = fit_curve(curve, tolerance=1e-4).spline
    for index in range(len(spline.control_points)):
        poles = np.array(spline.control_points)
        poles[index, 1] += 0.01
        moved = BSplineCurve(poles, spline.knots, spline.multiplicities, spline.degree)
        found = certify_curve(curve, moved)
        t = np.linspace(0, 1, 4001)
        gap = np.linalg.norm(curve.evaluate(t) - moved.evaluate(t), axis=1).max()
        assert gap > 1e-3
        assert found.lower <= gap * (1 + 1e-3)
        assert gap <= found.upper <= 1.02 * gap


def test_a_moved_pole_of_a_surface_is_found_out_at_its_place():
    surface = pieces.surfaces()["S33"]
    spline = fit_surface(surface, tolerance=1e-4).spline
    poles = np.array(spline.control_points)
    poles[4, 3, 2] += 0.01
    found = certify_surface(surface, spline.with_control_points(poles))
    assert 1e-3 < found.lower <= found.upper < 0.011
    u, v = found.place
    gap = surface.evaluate(u, v) - spline.with_control_points(poles).evaluate(u, v)
    assert np.linalg.norm(gap) == pytest.approx(found.lower, rel=1e-3)


def test_knots_of_any_interval():
    curve = pieces.curves()["C3s"]
    spline = fit_curve(curve, tolerance=1e-4).spline
    stretched = BSplineCurve(spline.control_points, 3 + 7 * spline.knots, spline.multiplicities, spline.degree)
    assert certify_curve(curve, stretched).upper == pytest.approx(certify_curve(curve, spline).upper, rel=1e-6)


def test_restricted_shapes_are_proved_like_others():
    surface = Restricted(pieces.surfaces()["S54"], ((0.2, 0.9), (1.0, 0.4)))
    fit = fit_surface(surface, tolerance=1e-5)
    line = np.linspace(0, 1, 201)
    gaps = np.linalg.norm(
        surface.evaluate(line[:, None], line) - fit.spline.evaluate(line[:, None], line[None, :]), axis=2
    )
    assert gaps.max() <= fit.deviation[1] <= 1e-5
    assert fit.deviation[1] <= 1.05 * gaps.max()


@pytest.mark.parametrize("gamma", [(0.0, 0.0), (0.3, -0.4), (-1.0, 0.5), (0.2, -1.0), (-1.0, -1.0), (1.0, 1.0)])
def test_rational_forms_are_proved_through_their_parameter_map(gamma):
    curve = Curve([[0, 0, 0], [60, 90, 10], [100, 0, 40]], gamma)
    spline, parameter_map = exact_curve(curve)
    found = certify_curve(curve, spline, parameter_map=parameter_map)
    assert found.upper < 1e-10
    whole = {"sine squared": lambda w: mp.asin(mp.sqrt(w)) * 2 / mp.pi, "sine": lambda w: mp.asin(w) * 2 / mp.pi}
    whole["versine"] = lambda w: mp.acos(1 - w) * 2 / mp.pi
    whole["tangent"] = lambda w: mp.atan(w) * 4 / mp.pi
    for w in np.linspace(0, 1, 33):
        with mp.workdps(reference.DIGITS):
            at = whole[parameter_map.kind](mp.mpf(float(w)))
        assert splines.curve_error(curve, spline, float(w), at) <= found.upper


def test_a_moved_pole_or_weight_of_a_rational_form_is_found_out():
    curve = Curve([[10, 0], [10, 10], [0, 10]])
    spline, parameter_map = exact_curve(curve)
    for poles, weights in (
        (spline.control_points + [[0, 0], [0, 1e-3], [0, 0]], spline.weights),
        (spline.control_points, spline.weights * [1, 1.001, 1]),
    ):
        moved = BSplineCurve(poles, spline.knots, spline.multiplicities, spline.degree, weights)
        x = np.linspace(0, 1, 2001)
        gap = np.linalg.norm(curve.evaluate(parameter_map(x)) - moved.evaluate(x), axis=1).max()
        found = certify_curve(curve, moved, parameter_map=parameter_map)
        assert gap > 1e-4
        assert gap <= found.upper * (1 + 1e-9)
        assert found.upper <= 1.4 * gap  # numerator over the least denominator on a quarter of the span
        assert found.lower <= gap * (1 + 1e-6)


def test_rational_splines_at_equal_parameters():
    """A circle's rational form against the model at equal parameters: the maximum is known by dense sampling."""
    curve = Curve([[10, 0], [10, 10], [0, 10]])
    spline, _ = exact_curve(curve)
    t = np.linspace(0, 1, 20001)
    gap = np.linalg.norm(curve.evaluate(t) - spline.evaluate(t), axis=1).max()
    found = certify_curve(curve, spline)
    assert gap * (1 - 1e-6) <= found.upper <= 1.4 * gap
    assert found.lower <= gap


def test_exact_surfaces_are_proved_in_both_directions():
    rng = np.random.default_rng(5)
    for _ in range(20):
        surface = pieces.random_surface(rng, (2, 2), 100.0)
        spline, maps = exact_surface(surface)
        found = certify_surface(surface, spline, parameter_maps=maps)
        x = np.linspace(0, 1, 21)
        gap = surface.evaluate(maps[0](x)[:, None], maps[1](x)[None]) - spline.evaluate(x[:, None], x[None])
        assert np.abs(gap).max() <= found.upper < 1e-8


def test_dimensions_must_agree():
    curve = Curve([[0, 0], [1, 1], [2, 0]])
    spline = BSplineCurve([[0, 0, 0], [1, 1, 1]], [0, 1], [2, 2], 1)
    with pytest.raises(InputError, match="one dimension, got 2 and 3"):
        certify_curve(curve, spline)


def test_many_spans_are_proved_in_blocks(monkeypatch):
    surface = pieces.surfaces()["S33"]
    spline = fit_surface(surface, tolerance=1e-7, adapt=False).spline
    whole = certify_surface(surface, spline)
    monkeypatch.setattr("gtcad.converters.certificate._IN_CACHE", 1)
    parts = certify_surface(surface, spline)
    assert (parts.lower, parts.upper) == pytest.approx((whole.lower, whole.upper), rel=1e-6)
    assert parts.place == whole.place
    monkeypatch.setattr("gtcad.converters.certificate._BLOCK", 10_000)
    blocks = certify_surface(surface, spline)
    assert blocks.upper == pytest.approx(whole.upper, rel=0.02)
    assert blocks.place == pytest.approx(whole.place, abs=0.05)


def test_a_spline_that_is_the_shape_is_proved_to_rounding():
    from gtcad import BERNSTEIN, Surface

    points = np.random.default_rng(1).random((4, 3, 3)) * 100
    surface = Surface(points, family_u=BERNSTEIN, family_v=BERNSTEIN)
    spline = BSplineSurface(points, [0, 1], [4, 4], 3, [0, 1], [3, 3], 2)
    found = certify_surface(surface, spline)
    assert found.lower == 0
    assert found.upper < 1e-10
