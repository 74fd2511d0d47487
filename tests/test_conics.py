from __future__ import annotations

import copy
import math
import pickle

import mpmath as mp
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.special import ellipe, ellipeinc

from gtcad import Composite, Curve
from gtcad.chebyshev import interpolation_tail, nodes, transform
from gtcad.conics import Arc, arc, arc_through, circle, ellipse, hyperbola, parabola
from gtcad.continuity import check_join
from gtcad.converters import fit_curve
from gtcad.differential import curvature
from gtcad.errors import InputError
from gtcad.factors import Hyperbolic
from gtcad.measure import length
from gtcad.restricted import RestrictedCurve

T = np.linspace(0, 1, 41)
TURNS = [1e-6, 0.5, 45, 89.999, 90, 90 + 1e-9, 90.00009, 90.001, 91, 180, 200, 270, 359.999, 360]


def exact_point(one, degrees):
    """p(theta) at 40 digits, rounded once."""
    with mp.workdps(40):
        theta = mp.mpf(degrees) * mp.pi / 180
        waves = mp.cos(theta), mp.sin(theta)
        vectors = zip(one.center.tolist(), one.axis_a.tolist(), one.axis_b.tolist(), strict=True)
        return np.array([float(c + waves[0] * a + waves[1] * b) for c, a, b in vectors])


def size(one):
    return sum(float(np.linalg.norm(vector)) for vector in (one.center, one.axis_a, one.axis_b))


def points(one):
    """Samples of all pieces, in order."""
    return np.concatenate([piece.evaluate(T) for piece in one.pieces])


def angles(one):
    """Angles of these samples, unwrapped, by solving for cos and sin."""
    axes = np.stack([one.axis_a, one.axis_b], axis=1)
    waves = np.linalg.lstsq(axes, (points(one) - one.center).T, rcond=None)[0]
    return np.degrees(np.unwrap(np.arctan2(waves[1], waves[0]))), np.hypot(*waves)


coordinate = st.floats(-100, 100)


@st.composite
def arcs(draw, dimension=None):
    """Arcs with half diameters at any angle but a narrow one."""
    d = dimension or draw(st.sampled_from([2, 3]))
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    frame = np.linalg.qr(rng.normal(size=(d, d)))[0][:2]
    axis_a = frame[0] * draw(st.floats(0.1, 50))
    axis_b = frame[0] * draw(st.floats(-20, 20)) + frame[1] * draw(st.floats(0.1, 50))
    start = draw(st.one_of(st.sampled_from([0.0, 90.0, -270.0, 30.0, 0.1]), st.floats(-720, 720)))
    turn = draw(st.one_of(st.sampled_from(TURNS), st.floats(1e-3, 360))) * draw(st.sampled_from([-1, 1]))
    end = start + turn
    if abs(end - start) > 360:
        end = np.nextafter(end, start)
    return Arc(rng.normal(0, 30, d), axis_a, axis_b, start, end)


# Arcs


@given(arcs())
def test_all_points_are_on_the_ellipse_at_the_right_angles_in_order(one):
    angle, radius = angles(one)
    conditioning = np.linalg.cond(np.stack([one.axis_a, one.axis_b], axis=1))
    allowed = 1e-14 * size(one) / np.linalg.norm(one.axis_a) * max(1.0, conditioning)
    assert abs(radius - 1).max() <= allowed
    turn = one.end_deg - one.start_deg
    assert angle[-1] - angle[0] == pytest.approx(turn, abs=np.degrees(allowed) * 4)
    assert (np.diff(angle) * math.copysign(1, turn)).min() >= -np.degrees(allowed) * 4


@given(arcs())
def test_ends_are_exact(one):
    assert abs(one.evaluate(0) - exact_point(one, one.start_deg)).max() <= 1e-14 * size(one)
    assert abs(one.evaluate(one.domain[1]) - exact_point(one, one.end_deg)).max() <= 1e-14 * size(one)


@given(arcs(), st.floats(0, 1))
def test_each_piece_turns_evenly_and_the_whole_ones_a_quarter(one, t):
    sense = math.copysign(1.0, one.end_deg - one.start_deg)
    for k, piece in enumerate(one.pieces):
        if isinstance(piece, Curve):
            assert (piece.degree, piece.gamma) == (2, (0.0, 0.0))
            assert abs(piece.evaluate(t) - exact_point(one, one.start_deg + sense * 90 * (k + t))).max() <= (
                1e-14 * size(one) * (1 + abs(one.start_deg) / 100)  # the reference's angle is rounded
            )
        else:
            assert k >= len(one.pieces) - 2


@given(arcs())
def test_joints_have_their_orders(one):
    assert all(report.meets(order) for report, order in zip(one.report(), one.orders, strict=True))
    assert all(report.gap <= 1e-14 * size(one) for report in one.report())
    quarters = [isinstance(piece, Curve) for piece in one.pieces]
    for order, before, after in zip(one.orders, quarters, quarters[1:], strict=False):
        assert order == ("C3" if before == after else "G3")


@given(arcs(), st.data())
def test_affine_images(one, data):
    rng = np.random.default_rng(data.draw(st.integers(0, 10**6)))
    shape = (data.draw(st.sampled_from([2, 3])), one.dimension)
    matrix, translation = rng.normal(size=shape), rng.normal(0, 20, shape[0])
    image = one.transformed(matrix, translation)
    assert isinstance(image, Arc)
    assert (image.start_deg, image.end_deg) == (one.start_deg, one.end_deg)
    t = one.domain[1] * T
    wanted = one.evaluate(t) @ matrix.T + translation
    bound = 1e-14 * (np.linalg.norm(matrix) * size(one) + np.linalg.norm(translation)) * 4
    assert abs(image.evaluate(t) - wanted).max() <= bound


@given(arcs())
def test_reversed_arcs(one):
    back = one.reversed()
    assert isinstance(back, Arc)
    assert len(back.pieces) == len(one.pieces)
    ends = [0, one.domain[1]]
    assert abs(back.evaluate(ends) - one.evaluate(ends)[::-1]).max() <= 1e-14 * size(one)
    assert back.reversed() == one
    angle, there = angles(back)[0], angles(one)[0]
    assert (angle[-1] - angle[0]) == pytest.approx(there[0] - there[-1], abs=1e-6)


@given(arcs(), st.integers(-5, 5))
def test_full_turns_close_to_the_last_digit(one, turns):
    for end in (360.0, -360.0):
        start = 90.0 * turns + one.start_deg % 7
        whole = Arc(one.center, one.axis_a, one.axis_b, start, start + end)
        assert whole.closed
        assert whole.orders == ("C3",) * 4
        for before, after in whole.joints:
            assert before.control_points[-1].tolist() == after.control_points[0].tolist()
            assert before.evaluate(1.0).tolist() == after.evaluate(0.0).tolist()


@pytest.mark.parametrize("start", [0.1, 0.3, 33.3, -77.7, 1e5 + 0.1])
def test_turns_that_are_whole_but_for_rounding(start):
    assert Arc([0, 0], [1, 0], [0, 1], start, start + 360).closed
    assert [type(piece) for piece in Arc([0, 0], [1, 0], [0, 1], start, start - 180).pieces] == [Curve, Curve]


def test_multiples_of_right_angles_are_exact():
    one = Arc([0, 0, 7], [3, 0, 0], [0, 5, 0], -450, -90)
    assert one.evaluate([0, 1, 2, 3, 4]).tolist() == [[0, -5, 7], [3, 0, 7], [0, 5, 7], [-3, 0, 7], [0, -5, 7]]
    assert Arc([0, 0], [3, 0], [0, 5], 90, -90).evaluate([0, 1, 2]).tolist() == [[0, 5], [3, 0], [0, -5]]


@pytest.mark.parametrize(
    ("turn", "whole", "rest"),
    [(90, 1, []), (91, 1, [1 / 90]), (359.999, 3, [89.999 / 90]), (30, 0, [1 / 3]), (180 + 1e-9, 1, [0.5, 0.5])],
)
def test_the_last_quarter_is_restricted(turn, whole, rest):
    pieces = Arc([0, 0], [1, 0], [0, 1], 0, turn).pieces
    assert all(isinstance(piece, Curve) for piece in pieces[:whole])
    assert all(isinstance(piece, RestrictedCurve) for piece in pieces[whole:])
    assert [piece.range for piece in pieces[whole:]] == [(0.0, pytest.approx(part)) for part in rest]


@pytest.mark.parametrize("turn", [1, 90, 91, 270.5, -359.999])
def test_lengths_are_those_of_ellipses(turn):
    one = Arc([1, 2], [0, 5], [3, 0], 0, turn)
    total = sum(length(piece) for piece in one.pieces)
    assert total == pytest.approx(3 * ellipeinc(math.radians(abs(turn)), 1 - 25 / 9), rel=1e-13)


def test_length_of_a_whole_ellipse():
    total = sum(length(piece) for piece in ellipse([1, 2, 3], [0, 5, 0], [0, 0, 3]).pieces)
    assert total == pytest.approx(4 * 5 * ellipe(1 - 9 / 25), rel=1e-14)


def test_area_inside_an_ellipse_with_oblique_half_diameters():
    one = ellipse([3, -2], [4, 1], [1, 3])
    x, w = np.polynomial.legendre.leggauss(30)
    t = (x + 1) / 2
    area = 0.0
    for piece in one.pieces:
        p, v = piece.evaluate(t), piece.derivative(t)
        area += float(w @ (p[:, 0] * v[:, 1] - p[:, 1] * v[:, 0])) / 4
    assert area == pytest.approx(math.pi * (4 * 3 - 1 * 1), rel=1e-14)


def test_values():
    one = Arc([1, 2, 3], [1, 0, 0], [0, 1, 0], 10, 200)
    assert one == Arc([1, 2, 3], [1, -0.0, 0], [0, 1, 0], 10, 200) != Arc([1, 2, 3], [1, 0, 0], [0, 1, 0], 10, 201)
    assert one != Composite(one.pieces, one.orders)
    assert {one, copy.deepcopy(one), pickle.loads(pickle.dumps(one))} == {one}
    assert repr(one) == "Arc(center=(1.0, 2.0, 3.0), axis_a=(1.0, 0.0, 0.0), axis_b=(0.0, 1.0, 0.0), " + (
        "start_deg=10.0, end_deg=200.0)"
    )
    assert not one.center.flags.writeable
    with pytest.raises(AttributeError):
        one.center = np.zeros(3)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([0, 0], [1, 0], [2, 0]), "axis_a and axis_b must not be zero or parallel"),
        (([0, 0], [1, 0], [0, 0]), "axis_a and axis_b must not be zero or parallel"),
        (([0, 0], [1e200, 0], [-3e200, 0]), "axis_a and axis_b must not be zero or parallel"),
        (([0, 0], [1, 0, 0], [0, 1, 0]), "axis_a must have 2 coordinates like the others"),
        (([0], [1], [0]), "center must be two or three finite numbers"),
        (("middle", [1, 0], [0, 1]), "center must be two or three numbers, got 'middle'"),
        (([0, math.nan], [1, 0], [0, 1]), "center must be two or three finite numbers"),
        (([0, 0], [1, 0], [0, 1], 0, 360.1), "must be 1e-07 to 360 degrees apart, got 0.0 and 360.1"),
        (([0, 0], [1, 0], [0, 1], 5, 5), "must be 1e-07 to 360 degrees apart, got 5.0 and 5.0"),
        (([0, 0], [1, 0], [0, 1], 5, 5 + 1e-8), "must be 1e-07 to 360 degrees apart"),
        (([0, 0], [1, 0], [0, 1], 0, math.inf), "end_deg must be finite"),
        (([0, 0], [1, 0], [0, 1], "north"), "start_deg must be a number, got 'north'"),
    ],
)
def test_wrong_arcs_are_refused(arguments, message):
    with pytest.raises(InputError, match=message):
        Arc(*arguments)


def test_an_image_that_is_a_line_is_refused():
    with pytest.raises(InputError, match="must not be zero or parallel"):
        circle([0, 0, 0], 1).transformed([[1, 0, 0], [0, 0, 1]])


# Circles


@given(
    st.lists(coordinate, min_size=3, max_size=3),
    st.floats(0.01, 100),
    st.lists(st.floats(-1, 1), min_size=3, max_size=3).filter(lambda n: np.linalg.norm(n) > 1e-3),
    st.floats(-400, 400),
    st.floats(1, 360),
)
def test_arcs_of_circles_in_space(center, radius, normal, start, turn):
    one = arc(center, radius, start, start + turn * (1 - 1e-12), normal)
    unit = np.array(normal) / np.linalg.norm(normal)
    away = points(one) - center
    allowed = 2e-14 * (radius + np.linalg.norm(center))
    assert abs(np.linalg.norm(away, axis=1) - radius).max() <= allowed
    assert abs(away @ unit).max() <= allowed
    assert np.linalg.det([unit, one.axis_a, one.axis_b]) == pytest.approx(radius**2, rel=1e-12)  # counterclockwise
    assert curvature(one.pieces[0], 0.4) == pytest.approx(1 / radius, rel=1e-9)


def test_directions_of_circles():
    assert circle([1, 2], 3).evaluate([0, 1, 2]).tolist() == [[4, 2], [1, 5], [-2, 2]]
    for normal, quarter_on in [((0, 0, 2), (0, 1, 0)), ((0, 0, -1), (0, -1, 0)), ((0, 3, 0), (0, 0, -1))]:
        one = circle([0, 0, 0], 1, normal)
        assert (one.axis_a + 0.0).tolist() == [1, 0, 0]
        assert one.axis_b.tolist() == list(quarter_on)
    assert circle([0, 0, 0], 1, [1, 0, 0]).evaluate([0, 1]).tolist() == [[0, 1, 0], [0, 0, 1]]
    assert circle([0, 0, 0], 2).evaluate(1).tolist() == [0, 2, 0]
    one = arc([0, 0, 0], 1, 0, 90, [1e-200, 2e-200, 0])  # of any length
    assert one.axis_a == pytest.approx(arc([0, 0, 0], 1, 0, 90, [1, 2, 0]).axis_a, abs=1e-15)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([0, 0], 0), "radius must be above 0, got 0.0"),
        (([0, 0], -2), "radius must be above 0, got -2.0"),
        (([0, 0], "wide"), "radius must be a number, got 'wide'"),
        (([0, 0], 1, [0, 0, 1]), "normal is for a center in space"),
        (([0, 0, 0], 1, [0, 0, 0]), "normal must be three numbers, not all 0"),
        (([0, 0, 0], 1, [0, 1]), "normal must be three numbers, not all 0"),
    ],
)
def test_wrong_circles_are_refused(arguments, message):
    with pytest.raises(InputError, match=message):
        circle(*arguments)


# Arcs through three points


@given(st.sampled_from([2, 3]), st.data())
def test_arcs_through_three_points(dimension, data):
    vector = st.lists(coordinate, min_size=dimension, max_size=dimension).map(np.array)
    a, b, c = (data.draw(vector) for _ in range(3))
    sides = sorted(np.linalg.norm(side) for side in (b - a, c - b, a - c))
    half = sum(sides) / 2
    area2 = half * np.prod([half - side for side in sides])
    assume(sides[0] > 0.1 and area2 > (1e-3 * sides[2] ** 2) ** 2)
    one = arc_through(a, b, c)
    radius = np.prod(sides) / 4 / math.sqrt(area2)  # the circumradius, by Heron's formula
    assert np.linalg.norm(one.axis_a) == pytest.approx(radius, rel=1e-8)
    assert abs(one.axis_a @ one.axis_b) <= 1e-13 * radius**2
    assert np.linalg.norm(one.axis_a) == pytest.approx(np.linalg.norm(one.axis_b), rel=1e-14)
    allowed = 1e-13 * (radius + 200) * max(1.0, radius / sides[0])
    assert abs(one.evaluate(0) - a).max() <= allowed
    assert abs(one.evaluate(one.domain[1]) - c).max() <= allowed
    waves = (b - one.center) @ one.axis_a, (b - one.center) @ one.axis_b
    assert math.hypot(*waves) == pytest.approx(radius**2, rel=1e-7)
    assert 0 < math.degrees(math.atan2(waves[1], waves[0])) % 360 < one.end_deg  # on the way from a to c
    assert np.linalg.norm(one.center + waves[0] / radius**2 * one.axis_a + waves[1] / radius**2 * one.axis_b - b) <= (
        1e-6 * radius
    )


@pytest.mark.parametrize("exponent", range(1, 8))
def test_flat_arcs_meet_their_points_to_rounding_of_the_radius(exponent):
    height = 10.0**-exponent
    one = arc_through([0, 0], [1, height], [2, 0])
    radius = (1 + height**2) / 2 / height
    assert np.linalg.norm(one.axis_a) == pytest.approx(radius, rel=1e-14)
    middle = one.pieces[0].evaluate(0.5)
    assert abs(middle - [1, height]).max() <= 1e-15 * radius
    assert abs(one.evaluate([0, 1]) - [[0, 0], [2, 0]]).max() <= 1e-15 * radius


@pytest.mark.parametrize("make", [arc_through, parabola])
@pytest.mark.parametrize(
    "points",
    [
        ([0, 0], [1, 1], [3, 3]),
        ([0, 0], [3, 3], [1, 1]),
        ([1, 2], [1, 2], [4, 4]),
        ([1, 2], [4, 4], [1, 2]),
        ([1, 2, 3], [1, 2, 3], [1, 2, 3]),
        ([0.1, 0.1, 0.1], [0.3, 0.3, 0.3], [0.7, 0.7, 0.7]),
    ],
)
def test_points_on_a_line_are_refused(make, points):
    with pytest.raises(InputError, match="three points that are not on one line are needed, got "):
        make(*points)


# Parabolas


@given(st.sampled_from([2, 3]), st.data())
def test_parabolas_are_the_points_of_quadratic_bezier_curves(dimension, data):
    vector = st.lists(coordinate, min_size=dimension, max_size=dimension).map(np.array)
    p = [data.draw(vector) for _ in range(3)]
    assume(np.linalg.matrix_rank([p[1] - p[0], p[2] - p[0]], tol=1e-3) == 2)
    w = (1 - np.cos(np.pi / 2 * T))[:, None]
    wanted = (1 - w) ** 2 * p[0] + 2 * w * (1 - w) * p[1] + w**2 * p[2]
    assert abs(parabola(*p).evaluate(T) - wanted).max() <= 1e-14 * np.abs(p).max()


def test_ends_of_a_parabola():
    one = parabola([0, 0], [1, 2], [4, 0])
    assert one.evaluate([0.0, 1.0]).tolist() == [[0, 0], [4, 0]]
    near = one.derivative(1e-9)
    assert near[1] / near[0] == pytest.approx(2)
    last = one.derivative(1.0)
    assert last[1] / last[0] == pytest.approx(-2 / 3)
    assert np.linalg.norm(one.derivative(0.0)) == 0  # as the docstring says
    assert math.isnan(check_join(one.reversed(), one).tangent_angle_deg)


# Hyperbolas


HYPERBOLIC = [Hyperbolic(-1.0, 2.0), Hyperbolic(3.0, -3.0), Hyperbolic(15.9, 16.0), Hyperbolic(-16.0, 16.0)]


@given(st.floats(-16, 16), st.floats(-16, 16), st.floats(0, 1), st.integers(0, 7))
def test_hyperbolic_functions_and_their_derivatives(start, end, t, order):
    assume(abs(end - start) >= 1e-9)
    factors = Hyperbolic(start, end)
    with mp.workdps(40):
        sweep = mp.mpf(end) - mp.mpf(start)
        s = mp.mpf(start) + sweep * mp.mpf(t)
        pair = (mp.cosh(s), mp.sinh(s))
        exact = [mp.mpf(order == 0), *(sweep**order * pair[(order + k) % 2] / factors.weight for k in (0, 1))]
        rows = factors.rows(np.array([t]), order)[:, 0].tolist()
        error = mp.fsum(abs(mp.mpf(found) - wanted) for found, wanted in zip(rows, exact, strict=True))
        size = mp.fsum(abs(wanted) for wanted in exact)
    assert error <= factors.rounding * abs(end - start) ** order * (1 + order) + 1e-300
    assert size <= factors.derivative_bound(order) * (1 + 1e-14)
    assert math.frexp(factors.weight)[0] == 0.5  # a power of 2 rounds nothing
    assert factors.weight / 2 < math.exp(max(abs(start), abs(end))) <= factors.weight


@pytest.mark.parametrize("factors", HYPERBOLIC, ids=str)
def test_bounds_of_hyperbolic_functions_are_near_the_truth(factors):
    for order in range(6):
        largest = np.abs(factors.rows(T, order)).sum(axis=0).max()
        assert largest <= factors.derivative_bound(order) * (1 + 1e-14)
        assert largest >= factors.derivative_bound(order) * (1 - 1e-14)  # it is taken at an end


@pytest.mark.parametrize("count", [4, 8, 12, 20])
def test_tails_of_hyperbolic_functions_are_bounded(count):
    factors = Hyperbolic(-1.0, 2.0)
    z = np.linspace(-1, 1, 200)
    series = transform(count) @ factors.rows((nodes(count) + 1) / 2).T
    error = np.abs(np.polynomial.chebyshev.chebval(z, series).T - factors.rows((z + 1) / 2).T).sum(axis=1).max()
    assert error <= interpolation_tail(0.5, count, factors.derivative_bound(count)) + 1e-14


@given(st.floats(-4, 4), st.floats(-4, 4), st.integers(0, 10**6))
def test_points_of_hyperbolas(start, end, seed):
    assume(abs(end - start) > 0.01)
    rng = np.random.default_rng(seed)
    center, frame = rng.normal(0, 10, 3), np.linalg.qr(rng.normal(size=(3, 3)))[0]
    axis_a, axis_b = 3 * frame[0], 2 * frame[1] + frame[0]
    one = hyperbola(center, axis_a, axis_b, start, end)
    axes = np.stack([axis_a, axis_b], axis=1)
    x, y = np.linalg.lstsq(axes, (one.evaluate(T) - center).T, rcond=None)[0]
    assert abs((x - y) * (x + y) - 1).max() <= 1e-11
    assert x.min() > 0
    for t, s in ((0.0, start), (1.0, end)):
        wanted = center + math.cosh(s) * axis_a + math.sinh(s) * axis_b
        assert abs(one.evaluate(t) - wanted).max() <= 1e-13 * np.abs(wanted).max()


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-9])
def test_fits_of_hyperbolas_are_proved(tolerance):
    """By the true distance from x^2/a^2 - y^2/b^2 = 1, which Newton's method finds."""
    a, b = 40.0, 25.0
    one = hyperbola([5, -3], [a, 0], [0, b], -1.2, 1.5)
    fit = fit_curve(one, tolerance=tolerance)
    assert fit.deviation[1] <= tolerance
    assert not fit.exact
    dense = np.linspace(0, 1, 997)
    x, y = (fit.spline.evaluate(dense) - [5, -3]).T
    s = np.arcsinh(y / b)
    for _ in range(8):  # the foot of the perpendicular: (p - q) . q' = 0
        q, d = np.array([a * np.cosh(s), b * np.sinh(s)]), np.array([a * np.sinh(s), b * np.cosh(s)])
        gap = np.array([x, y]) - q
        s = s + (gap * d).sum(axis=0) / ((d * d).sum(axis=0) - (gap * q).sum(axis=0))
    distance = np.hypot(*(np.array([x, y]) - [a * np.cosh(s), b * np.sinh(s)]))
    assert distance.max() <= fit.deviation[1]
    held = np.linalg.norm(fit.spline.evaluate(dense) - one.evaluate(dense), axis=1).max()
    assert held <= fit.deviation[1]
    assert fit.deviation[0] <= held * 1.01 + 1e-12
    x, y = (fit.spline.evaluate(dense) - [5, -3]).T
    assert abs((x / a) ** 2 - (y / b) ** 2 - 1).max() <= 5 * tolerance / b * np.cosh(1.5)


def test_far_ends_of_a_hyperbola_are_proved_as_well_as_double_precision_allows():
    one = hyperbola([0, 0], [10, 0], [0, 6], 0, 10)  # up to 1e5
    assert fit_curve(one, tolerance=1e-6).deviation[1] <= 1e-6


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([0, 0], [1, 0], [2, 0], 0, 1), "must not be zero or parallel"),
        (([0, 0], [1, 0], [0, 1], 1, 1), "start and end must be two different numbers in"),
        (
            ([0, 0], [1, 0], [0, 1], 0, 17),
            r"different numbers in \[-16, 16\], got 0.0 and 17.0",
        ),
        (([0, 0], [1, 0], [0, 1], 0, None), "end must be a number, got None"),
        (([0, 0], [1, 0, 0], [0, 1, 0], 0, 1), "axis_a must have 2 coordinates"),
    ],
)
def test_wrong_hyperbolas_are_refused(arguments, message):
    with pytest.raises(InputError, match=message):
        hyperbola(*arguments)
