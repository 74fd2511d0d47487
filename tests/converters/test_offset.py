from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest

from gtcad import BERNSTEIN, Composite, Curve, Restricted
from gtcad.converters.bspline import BSplineCurve
from gtcad.converters.offset import certify_offset, fit_offset
from gtcad.errors import InputError, ToleranceBelowPrecision, ToleranceNotMet
from gtcad.offset import Offset
from tests import reference, splines
from tests.pieces import random_curve

LINE = np.linspace(0, 1, 4001)
PARABOLA = Curve([[-1, 1], [0, -1], [1, 1]], family=BERNSTEIN)
QUARTER = Curve([[10, 0], [10, 10], [0, 10]])


def exact_gap(offset, spline, t):
    """|O(t) - spline(t)| of a plane GT curve at 50 digits."""
    with mp.workdps(reference.DIGITS):
        curve = offset.curve
        rows = reference.taylor_rows(curve.family.name, curve.degree, curve.gamma, mp.mpf(t), 1)
        points = [[mp.mpf(float(x)) for x in row] for row in curve.control_points]
        (x, y), (dx, dy) = (
            [mp.fsum(row[k] * p[axis] for row, p in zip(rows, points, strict=True)) for axis in range(2)]
            for k in (0, 1)
        )
        scale = mp.mpf(offset.distance) / mp.sqrt(dx * dx + dy * dy)
        near = splines.basis(spline.flat_knots.tolist(), spline.degree, mp.mpf(t))
        held = [
            mp.fsum(v * mp.mpf(float(spline.control_points[i, axis])) for i, v in near.items()) for axis in range(2)
        ]
        return float(mp.hypot(x - scale * dy - held[0], y + scale * dx - held[1]))


def worst_gap(offset, spline):
    """The largest of many gaps in double precision, then at 50 digits where it lies."""
    gaps = np.linalg.norm(offset.evaluate(LINE) - spline.evaluate(LINE), axis=1)
    return max(exact_gap(offset, spline, float(LINE[k])) for k in np.argsort(gaps)[-3:])


def random_offset(seed, degree):
    """Of a random curve that does not nearly stop, at up to 0.7 of the distance with a cusp."""
    rng = np.random.default_rng(seed)
    curve = random_curve(rng, degree, 100.0, 2)
    curve = Curve(curve.control_points, np.clip(curve.gamma, -0.8, 1.0))
    side = rng.choice([-1.0, 1.0])
    return Offset(curve, side * rng.uniform(0.1, 0.7) * min(Offset(curve, side).limit, 30.0))


def check_random(seed, degree, tolerance):
    offset = random_offset(seed, degree)
    fit = fit_offset(offset, tolerance=tolerance)
    lower, upper = fit.deviation
    worst = worst_gap(offset, fit.spline)
    assert worst <= upper <= tolerance
    assert lower <= upper
    return upper / worst


@pytest.mark.parametrize(("seed", "degree"), list(enumerate([2, 3, 4, 5, 8, 12])))
def test_random_offsets_keep_a_proved_tolerance_that_is_tight(seed, degree):
    assert check_random(seed, degree, 1e-4) <= 1.2


@pytest.mark.stress
@pytest.mark.parametrize("seed", range(200))
def test_random_offsets_of_all_degrees_and_tolerances(seed):
    rng = np.random.default_rng(seed)
    check_random(seed, int(rng.integers(2, 25)), float(10 ** rng.uniform(-6, -1)))


@pytest.mark.parametrize("distance", [-7.0, 4.0])
@pytest.mark.parametrize("tolerance", [1e-3, 1e-7])
def test_an_offset_of_a_circle_is_a_circle(distance, tolerance):
    fit = fit_offset(Offset(QUARTER, distance), tolerance=tolerance)
    radii = np.linalg.norm(fit.spline.evaluate(LINE), axis=1)
    assert np.abs(radii - (10 - distance)).max() <= fit.deviation[1] <= tolerance


def test_an_offset_of_a_line_is_a_line():
    fit = fit_offset(Offset(Curve([[0, 0], [30, 0], [90, 0]], (0.5, 0.2)), -3.0), tolerance=1e-6)
    assert np.abs(fit.spline.control_points[:, 1] + 3).max() <= 1e-12
    assert fit.spline.control_points[[0, -1], 0] == pytest.approx([0, 90], abs=1e-12)


def test_an_offset_of_a_parabola():
    fit = fit_offset(Offset(PARABOLA, 0.4), tolerance=1e-6)
    x = 2 * LINE - 1
    root = np.sqrt(1 + 4 * x**2)
    wanted = np.stack([x - 0.8 * x / root, x**2 + 0.4 / root], axis=1)
    assert np.linalg.norm(fit.spline.evaluate(LINE) - wanted, axis=1).max() <= fit.deviation[1] <= 1e-6


@pytest.mark.parametrize("end_order", [0, 1, (2, 3)])
def test_end_derivatives_are_those_of_the_offset(end_order):
    offset = random_offset(3, 5)
    fit = fit_offset(offset, tolerance=1e-3, end_order=end_order)
    orders = end_order if isinstance(end_order, tuple) else (end_order, end_order)
    for t, order in zip((0.0, 1.0), orders, strict=True):
        for k in range(order + 1):
            wanted = offset.derivative(t, k)
            assert np.abs(fit.spline.derivative(t, k) - wanted).max() <= 1e-9 * np.abs(wanted).max()


def test_pieces_of_a_chain_meet_with_equal_tangents():
    chain = Composite((QUARTER, Curve([[0, 10], [-30, 10], [-30, -20]])), ("G1",))
    with pytest.raises(InputError, match=r"take offset\.pieces"):
        fit_offset(Offset(chain, 3.0), tolerance=1e-4)
    first, second = (fit_offset(one, tolerance=1e-4, end_order=1).spline for one in Offset(chain, 3.0).pieces)
    assert np.abs(first.evaluate(1.0) - second.evaluate(0.0)).max() <= 1e-13
    before, after = first.derivative(1.0), second.derivative(0.0)
    assert abs(before[0] * after[1] - before[1] * after[0]) <= 1e-9 * np.linalg.norm(before) * np.linalg.norm(after)


def test_in_space_the_same_deviation_is_proved():
    flat = random_offset(2, 4)
    axes = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    normal = np.cross(axes[:, 0], axes[:, 1])
    offset = Offset(flat.curve.transformed(axes[:, :2], [5, 6, 7]), flat.distance, tuple(normal))
    fit = fit_offset(offset, tolerance=1e-4)
    wanted = flat.evaluate(LINE) @ axes[:, :2].T + [5, 6, 7]
    worst = np.linalg.norm(fit.spline.evaluate(LINE) - wanted, axis=1).max()
    assert worst <= fit.deviation[1] <= min(1e-4, 1.2 * worst)
    lifted = BSplineCurve(fit.spline.control_points + 0.5 * normal, fit.spline.knots, fit.spline.multiplicities, 5)
    assert 0.5 <= certify_offset(offset, lifted).upper <= 0.502  # across the plane


@pytest.mark.parametrize("shift", [1e-5, 1e-3, 0.1, 1.0])
def test_the_proof_holds_for_splines_that_are_no_fits(shift):
    offset = random_offset(4, 6)
    good = fit_offset(offset, tolerance=1e-6).spline
    rng = np.random.default_rng(1)
    poles = good.control_points + shift * rng.normal(size=good.control_points.shape)
    spline = BSplineCurve(poles, 3 + 2 * good.knots, good.multiplicities, good.degree)
    proved = certify_offset(offset, spline)
    normalised = BSplineCurve(poles, good.knots, good.multiplicities, good.degree)
    assert proved.lower * (1 - 1e-4) <= worst_gap(offset, normalised) <= proved.upper
    assert exact_gap(offset, normalised, proved.place[0]) >= proved.lower
    assert proved.upper <= 1.25 * worst_gap(offset, normalised) or shift == 1.0


def test_nothing_is_proved_of_a_spline_on_the_other_side():
    offset = Offset(QUARTER, 2.0)
    other = fit_offset(Offset(QUARTER, -2.0), tolerance=1e-4).spline
    proved = certify_offset(offset, other)
    assert proved.upper == np.inf
    assert proved.lower == pytest.approx(4, abs=1e-3)


def test_a_tolerance_above_the_distance_is_kept_too():
    fit = fit_offset(Offset(PARABOLA, 1e-3), tolerance=0.1)
    assert fit.deviation[1] <= 1e-3


def test_limits_are_told_with_figures():
    with pytest.raises(ToleranceNotMet, match="max_spans = 2"):
        fit_offset(random_offset(5, 8), tolerance=1e-6, max_spans=2)
    with pytest.raises(ToleranceBelowPrecision):
        fit_offset(Offset(QUARTER, 2.0), tolerance=1e-12)


@pytest.mark.parametrize(
    ("offset", "options", "message"),
    [
        (Offset(PARABOLA, 0.75), {}, r"cusps at t = 0\.360723, 0\.639277"),
        (Offset(Curve([[0, 0], [1, 0], [1, 1]], (-1.0, 0.3)), -0.5), {}, "stops, or nearly so, near t = 0"),
        (Offset(PARABOLA, 0.4), {"tolerance": 0.0}, "tolerance must be"),
        (Offset(PARABOLA, 0.4), {"tolerance": np.nan}, "tolerance must be"),
        (Offset(PARABOLA, 0.4), {"degree": 2}, r"degree must be a whole number in \[3, 25\]"),
        (Offset(PARABOLA, 0.4), {"end_order": (0, 4)}, "end_order must be"),
        (Offset(PARABOLA, 0.4), {"end_order": "C1"}, "end_order must be"),
        (Offset(PARABOLA, 0.4), {"max_spans": 0.5}, "max_spans must be"),
        (Offset(PARABOLA, 0.4), {"max_spans": 1, "end_order": 3}, "end_order 3 takes"),
    ],
)
def test_bad_arguments_are_refused(offset, options, message):
    with pytest.raises(InputError, match=message):
        fit_offset(offset, **{"tolerance": 1e-4, **options})


def test_splines_of_another_space_are_refused():
    rational = BSplineCurve([[0, 0], [1, 1]], [0, 1], [2, 2], 1, [1, 2])
    with pytest.raises(InputError, match="no weights"):
        certify_offset(Offset(PARABOLA, 0.4), rational)


def test_restricted_curves_are_fitted_like_others():
    part = Offset(Restricted(QUARTER, (0.25, 0.75)), 4.0)
    fit = fit_offset(part, tolerance=1e-6)
    assert np.abs(np.linalg.norm(fit.spline.evaluate(LINE), axis=1) - 6).max() <= fit.deviation[1] <= 1e-6
