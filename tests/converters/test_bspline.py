from __future__ import annotations

import copy
import math
import pickle

import mpmath as mp
import numpy as np
import pytest
from scipy.interpolate import BSpline

from gtcad.converters import BSplineCurve, BSplineSurface
from gtcad.errors import InputError
from tests import reference, splines

POLYGON = [[0, 0], [1, 2], [2, 0]]
ONE_SPAN = [0, 1], [3, 3], 2


def quarter_circle(radius=1.0):
    """x = (1 - t^2) / (1 + t^2), y = 2 t / (1 + t^2)."""
    return BSplineCurve(np.array([[1, 0], [1, 1], [0, 1]]) * radius, [0, 1], [3, 3], 2, [1, 1, 2])


def random_knots(rng, degree, interval=(0.0, 1.0)):
    inner = np.sort(rng.uniform(*interval, 4))
    multiplicities = [degree + 1, *rng.integers(1, degree + 1, 4).tolist(), degree + 1]
    return np.concatenate([interval[:1], inner, interval[1:]]), multiplicities


def random_curve(rng, degree, dimension, *, rational, interval=(0.0, 1.0)):
    knots, multiplicities = random_knots(rng, degree, interval)
    count = sum(multiplicities) - degree - 1
    weights = rng.uniform(0.3, 3, count) if rational else None
    return BSplineCurve(rng.normal(size=(count, dimension)), knots, multiplicities, degree, weights)


def random_surface(rng, degrees, *, rational, dimension=3):
    (knots_u, counts_u), (knots_v, counts_v) = (random_knots(rng, degree) for degree in degrees)
    shape = sum(counts_u) - degrees[0] - 1, sum(counts_v) - degrees[1] - 1
    weights = rng.uniform(0.3, 3, shape) if rational else None
    points = rng.normal(size=(*shape, dimension))
    return BSplineSurface(points, knots_u, counts_u, degrees[0], knots_v, counts_v, degrees[1], weights)


def exact_point(spline, t):
    """By de Boor's recursion at 50 digits."""
    with mp.workdps(reference.DIGITS):
        near = splines.basis(spline.flat_knots.tolist(), spline.degree, mp.mpf(t))
        weights = np.ones(len(spline.control_points)) if spline.weights is None else spline.weights
        total = mp.fsum(value * float(weights[i]) for i, value in near.items())
        sums = (
            mp.fsum(value * float(weights[i]) * float(spline.control_points[i, k]) for i, value in near.items())
            for k in range(spline.dimension)
        )
        return np.array([float(x / total) for x in sums])


# Curves


@pytest.mark.parametrize("rational", [False, True], ids=["polynomial", "rational"])
@pytest.mark.parametrize("degree", [1, 2, 3, 5, 9, 25])
def test_points_of_curves_at_50_digits(degree, rational):
    rng = np.random.default_rng(degree)
    for dimension in (2, 3):
        curve = random_curve(rng, degree, dimension, rational=rational, interval=(-2.0, 5.0))
        assert curve.dimension == dimension
        for t in [-2.0, 5.0, *rng.uniform(-2, 5, 12).tolist(), float(curve.knots[2])]:
            assert abs(curve.evaluate(t) - exact_point(curve, t)).max() <= 1e-13


def test_points_come_in_the_shape_of_the_parameters():
    curve = quarter_circle()
    for shape in ((), (0,), (5,), (2, 3)):
        t = np.random.default_rng(0).uniform(size=shape)
        assert curve.evaluate(t).shape == curve.derivative(t).shape == (*shape, 2)
    assert curve.evaluate([0, 1]).tolist() == [[1, 0], [0, 1]]


def test_the_ends_are_the_end_poles():
    rng = np.random.default_rng(1)
    for rational in (False, True):
        curve = random_curve(rng, 4, 3, rational=rational)
        assert abs(curve.evaluate([0.0, 1.0]) - curve.control_points[[0, -1]]).max() <= 5e-16


@pytest.mark.parametrize("order", range(5))
def test_derivatives_of_polynomial_curves_are_those_of_scipy(order):
    rng = np.random.default_rng(order)
    curve = BSplineCurve(rng.normal(size=(9, 3)), [0, 0.2, 0.55, 0.7, 1], [6, 1, 1, 1, 6], 5)
    t = rng.uniform(size=20)
    expected = BSpline(curve.flat_knots, curve.control_points, 5).derivative(order)(t)
    assert abs(curve.derivative(t, order) - expected).max() <= 1e-12 * max(1, abs(expected).max())


def test_derivatives_beyond_the_degree_vanish():
    curve = BSplineCurve(POLYGON, *ONE_SPAN)
    assert curve.derivative([0.0, 0.5, 1.0], 3).tolist() == [[0, 0]] * 3


@pytest.mark.parametrize("order", range(1, 5))
def test_derivatives_of_rational_curves_at_50_digits(order):
    """The quarter circle's formula, differentiated as a Taylor series."""
    curve = quarter_circle(3.0)
    for t in (0.0, 0.2, 0.5, 0.83, 1.0):
        with mp.workdps(reference.DIGITS):
            rows = [
                mp.taylor(f, mp.mpf(t), order)
                for f in (lambda x: 3 * (1 - x * x) / (1 + x * x), lambda x: 6 * x / (1 + x * x))
            ]
            exact = np.array([float(row[order] * mp.factorial(order)) for row in rows])
        assert abs(curve.derivative(t, order) - exact).max() <= 1e-13 * max(1, abs(exact).max()) * 4**order


def test_a_circle_is_perpendicular_to_its_radius():
    curve = quarter_circle(5.0)
    t = np.linspace(0, 1, 101)
    points, tangents = curve.evaluate(t), curve.derivative(t)
    assert abs(np.linalg.norm(points, axis=1) - 5).max() <= 5e-15
    assert abs((points * tangents).sum(axis=1)).max() <= 1e-13
    assert abs(np.linalg.norm(tangents, axis=1) - 10 / (1 + t * t)).max() <= 1e-13  # 2 r d(arctan t)/dt


def test_derivatives_of_a_rational_curve_with_knots():
    rng = np.random.default_rng(8)
    curve = random_curve(rng, 3, 3, rational=True, interval=(0.0, 2.0))
    for t in rng.uniform(0.05, 1.95, 8):
        h = 1e-5
        slope = (exact_point(curve, t + h) - exact_point(curve, t - h)) / (2 * h)
        assert abs(curve.derivative(t) - slope).max() <= 1e-4 * abs(slope).max()


def test_equal_weights_change_nothing():
    rng = np.random.default_rng(2)
    plain = random_curve(rng, 4, 3, rational=False)
    weights = np.full(len(plain.control_points), 0.7)
    weighted = BSplineCurve(plain.control_points, plain.knots, plain.multiplicities, 4, weights)
    t = np.linspace(0, 1, 50)
    for order in range(3):
        expected = plain.derivative(t, order)
        assert abs(weighted.derivative(t, order) - expected).max() <= 1e-12 * max(1, abs(expected).max())


def test_homogeneous_points_carry_their_weight_last():
    assert quarter_circle().homogeneous.tolist() == [[1, 0, 1], [1, 1, 1], [0, 2, 2]]
    plain = BSplineCurve(POLYGON, *ONE_SPAN)
    assert plain.homogeneous is plain.control_points


def test_flat_knots_and_domain():
    curve = BSplineCurve(np.zeros((5, 2)), [-1, 0, 3], [4, 1, 4], 3)
    assert curve.flat_knots.tolist() == [-1, -1, -1, -1, 0, 3, 3, 3, 3]
    assert curve.domain == (-1.0, 3.0)


# Surfaces


@pytest.mark.parametrize("rational", [False, True], ids=["polynomial", "rational"])
@pytest.mark.parametrize("degrees", [(1, 1), (2, 5), (7, 3)], ids=str)
def test_points_of_surfaces_at_50_digits(degrees, rational):
    rng = np.random.default_rng(sum(degrees))
    surface = random_surface(rng, degrees, rational=rational)
    weights = np.ones(surface.control_points.shape[:2]) if surface.weights is None else surface.weights
    for u, v in [(0.0, 0.0), (1.0, 1.0), (0.0, 1.0), *rng.uniform(size=(8, 2)).tolist()]:
        with mp.workdps(reference.DIGITS):
            near_u = splines.basis(surface.flat_knots_u.tolist(), degrees[0], mp.mpf(u))
            near_v = splines.basis(surface.flat_knots_v.tolist(), degrees[1], mp.mpf(v))
            both = [(i, j, a * b * float(weights[i, j])) for i, a in near_u.items() for j, b in near_v.items()]
            total = mp.fsum(weight for _, _, weight in both)
            exact = [
                float(mp.fsum(weight * float(surface.control_points[i, j, k]) for i, j, weight in both) / total)
                for k in range(3)
            ]
        assert abs(surface.evaluate(u, v) - exact).max() <= 1e-13


@pytest.mark.parametrize("rational", [False, True], ids=["polynomial", "rational"])
def test_partial_derivatives_of_surfaces(rational):
    """Against scipy's tensor product of one-dimensional splines, by the quotient rule where there are weights."""
    rng = np.random.default_rng(3)
    surface = random_surface(rng, (4, 3), rational=rational)
    u, v = rng.uniform(size=(2, 15))

    def tensor(order_u, order_v):
        lines = BSpline(surface.flat_knots_u, surface.homogeneous, 4)(u, order_u)
        return np.array([BSpline(surface.flat_knots_v, line, 3)(x, order_v) for line, x in zip(lines, v, strict=True)])

    value, along_u, along_v = tensor(0, 0), tensor(1, 0), tensor(0, 1)
    if rational:
        weight = value[:, 3:]
        along_u, along_v = (
            (slope[:, :3] * weight - value[:, :3] * slope[:, 3:]) / weight**2 for slope in (along_u, along_v)
        )
    found_u, found_v = surface.derivatives(u, v)
    assert abs(found_u - along_u).max() <= 1e-12 * abs(along_u).max()
    assert abs(found_v - along_v).max() <= 1e-12 * abs(along_v).max()


def octant():
    """An eighth of the unit sphere: a quarter meridian turned by a quarter, u along the meridian from the equator."""
    arc = np.array([[1.0, 0], [1, 1], [0, 1]])
    points = np.array([[[x * c, x * s, z] for c, s in arc] for x, z in arc])
    return BSplineSurface(points, [0, 1], [3, 3], 2, [0, 1], [3, 3], 2, np.outer([1, 1, 2], [1, 1, 2]))


def test_a_sphere_is_perpendicular_to_its_radius():
    surface = octant()
    line = np.linspace(0, 1, 21)
    points = surface.evaluate(line[:, None], line[None, :])
    assert points.shape == (21, 21, 3)
    assert abs(np.linalg.norm(points, axis=2) - 1).max() <= 1e-15
    for slope in surface.derivatives(line[:, None], line[None, :]):
        assert abs((slope * points).sum(axis=2)).max() <= 1e-14
    meridian, _ = surface.derivatives(line[:, None], line[None, :])
    speed = np.broadcast_to(2 / (1 + line**2)[:, None], (21, 21))
    assert abs(np.linalg.norm(meridian, axis=2) - speed).max() <= 1e-13


def test_parameters_of_surfaces_broadcast():
    surface = octant()
    for shape_u, shape_v, shape in (((), (), ()), ((5,), (), (5,)), ((5, 1), (4,), (5, 4)), ((2, 3), (2, 3), (2, 3))):
        u, v = np.full(shape_u, 0.25), np.full(shape_v, 0.5)
        assert surface.evaluate(u, v).shape == (*shape, 3)
        assert all(slope.shape == (*shape, 3) for slope in surface.derivatives(u, v))


@pytest.mark.parametrize("rational", [False, True], ids=["polynomial", "rational"])
def test_boundaries_carry_the_poles_of_the_surface(rational):
    rng = np.random.default_rng(4)
    surface = random_surface(rng, (3, 5), rational=rational)
    x = np.linspace(0, 1, 33)
    rows = {"u0": (0, slice(None)), "u1": (-1, slice(None)), "v0": (slice(None), 0), "v1": (slice(None), -1)}
    for side, row in rows.items():
        curve = surface.boundary(side)
        assert np.array_equal(curve.control_points, surface.control_points[row])
        assert curve.degree == (5 if side[0] == "u" else 3)
        fixed = np.full_like(x, float(side[1]))
        points = surface.evaluate(fixed, x) if side[0] == "u" else surface.evaluate(x, fixed)
        assert abs(curve.evaluate(x) - points).max() <= 1e-14


@pytest.mark.parametrize("rational", [False, True], ids=["polynomial", "rational"])
def test_transposed_surfaces_exchange_u_and_v(rational):
    rng = np.random.default_rng(5)
    surface = random_surface(rng, (2, 4), rational=rational)
    other = surface.transposed()
    u, v = rng.uniform(size=(2, 30))
    assert (other.degree_u, other.degree_v) == (4, 2)
    assert abs(other.evaluate(v, u) - surface.evaluate(u, v)).max() <= 1e-14
    back = other.transposed()
    assert np.array_equal(back.control_points, surface.control_points)
    assert np.array_equal(back.flat_knots_u, surface.flat_knots_u)


def test_with_control_points_keeps_all_else():
    surface = octant()
    doubled = surface.with_control_points(2 * surface.control_points)
    assert abs(doubled.evaluate(0.3, 0.8) - 2 * surface.evaluate(0.3, 0.8)).max() <= 1e-15
    assert np.array_equal(doubled.weights, surface.weights)
    with pytest.raises(InputError, match="knots_u: multiplicities must add up to poles"):
        surface.with_control_points(np.zeros((4, 3, 3)))


def test_plane_surfaces():
    surface = random_surface(np.random.default_rng(6), (2, 2), rational=True, dimension=2)
    assert surface.dimension == 2
    assert surface.evaluate(0.5, 0.5).shape == (2,)


# Arrays that stay as they are


def test_arrays_are_read_only_copies():
    points, knots, weights = np.array(POLYGON, dtype=float), np.array([0.0, 1.0]), np.array([1.0, 2.0, 1.0])
    curve = BSplineCurve(points, knots, [3, 3], 2, weights)
    for given in (points, knots, weights):
        given[0] = 77
    assert curve.control_points[0].tolist() == [0, 0]
    assert curve.knots.tolist() == [0, 1]
    assert curve.weights.tolist() == [1, 2, 1]
    surface = octant()
    held = (curve.control_points, curve.knots, curve.weights, surface.control_points, surface.knots_u, surface.weights)
    for array in held:
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1
    with pytest.raises(AttributeError):
        curve.degree = 3


@pytest.mark.parametrize("copied", [lambda x: pickle.loads(pickle.dumps(x)), copy.deepcopy, copy.copy])
def test_copies_are_read_only_too(copied):
    for spline in (quarter_circle(), octant()):
        other = copied(spline)
        assert np.array_equal(other.control_points, spline.control_points)
        assert np.array_equal(other.weights, spline.weights)
        assert not other.control_points.flags.writeable


# Refusals


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((np.zeros((3, 4)), *ONE_SPAN), r"control_points must have shape \(n, d\) with d = 2 or 3, got \(3, 4\)"),
        ((np.zeros((3, 1)), *ONE_SPAN), r"got \(3, 1\)"),
        ((np.zeros(3), *ONE_SPAN), r"got \(3,\)"),
        ((np.zeros((3, 3, 3)), *ONE_SPAN), r"got \(3, 3, 3\)"),
        (([], *ONE_SPAN), r"got \(0,\)"),
        ((None, *ONE_SPAN), "control_points"),
        (("abc", *ONE_SPAN), "control_points"),
        (([[0, 0], [1]], *ONE_SPAN), "control_points"),
        (([[0, 1j], [1, 1], [2, 0]], *ONE_SPAN), "control_points"),
        (([[0, 0], [1, math.nan], [2, 0]], *ONE_SPAN), "control_points must be finite, got nan"),
        (([[0, 0], [1, math.inf], [2, 0]], *ONE_SPAN), "control_points must be finite, got inf"),
        ((POLYGON, *ONE_SPAN, [1, 1]), r"weights must have shape \(3,\), got \(2,\)"),
        ((POLYGON, *ONE_SPAN, [1, 0, 1]), "weights must be positive and finite, got 0.0 to 1.0"),
        ((POLYGON, *ONE_SPAN, [1, -2, 1]), "weights must be positive and finite, got -2.0 to 1.0"),
        ((POLYGON, *ONE_SPAN, [1, math.nan, 1]), "weights must be positive and finite"),
        ((POLYGON, *ONE_SPAN, [1, math.inf, 1]), "weights must be positive and finite, got 1.0 to inf"),
        ((POLYGON, *ONE_SPAN, "abc"), "weights"),
        ((POLYGON, [0], [6], 2), r"two knots or more with one multiplicity each, got \(1,\) and 1"),
        ((POLYGON, [0, 1], [3, 3, 3], 2), r"one multiplicity each, got \(2,\) and 3"),
        ((POLYGON, [[0, 1]], [3, 3], 2), "knots must be two knots or more"),
        ((POLYGON, [1, 0], [3, 3], 2), "knots must be finite and strictly increasing"),
        ((POLYGON, [0, 0], [3, 3], 2), "knots must be finite and strictly increasing"),
        ((POLYGON, [0, math.nan], [3, 3], 2), "knots must be finite and strictly increasing"),
        ((POLYGON, [0, math.inf], [3, 3], 2), "knots must be finite and strictly increasing"),
        ((POLYGON, ["a", "b"], [3, 3], 2), "knots"),
        ((POLYGON, [0, 1], [2, 4], 2), "knots must be clamped: end multiplicities 3, got 2 and 4"),
        ((POLYGON, [0, 1], [3.5, 3], 2), "multiplicities"),
        ((POLYGON, [0, 1], [3, math.nan], 2), "multiplicities"),
        ((np.zeros((6, 2)), [0, 0.5, 1], [3, 3, 3], 2), r"interior multiplicities must lie in \[1, 2\], got \(3,\)"),
        ((POLYGON, [0, 0.5, 1], [3, 0, 3], 2), r"interior multiplicities must lie in \[1, 2\], got \(0,\)"),
        ((POLYGON, [0, 0.5, 1], [3, 1, 3], 2), r"add up to poles \+ degree \+ 1 = 6, got 7"),
        (([[0, 0]], [0, 1], [1, 1], 0), r"degree must be a whole number in \[1, 25\], got 0"),
        ((np.zeros((27, 2)), [0, 1], [27, 27], 26), r"degree must be a whole number in \[1, 25\], got 26"),
        ((POLYGON, [0, 1], [3, 3], 2.5), "degree"),
        ((POLYGON, [0, 1], [3, 3], "2"), "degree"),
    ],
)
def test_curves_refuse(arguments, message):
    with pytest.raises(InputError, match=message):
        BSplineCurve(*arguments)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"control_points": np.zeros((3, 3))}, r"control_points must have shape \(nu, nv, d\)"),
        ({"control_points": np.full((3, 3, 3), math.nan)}, "control_points must be finite, got nan"),
        ({"weights": np.ones((3, 2))}, r"weights must have shape \(3, 3\), got \(3, 2\)"),
        ({"weights": np.zeros((3, 3))}, "weights must be positive"),
        ({"knots_u": [0, 0]}, "knots_u must be finite and strictly increasing"),
        ({"knots_v": [1, 0]}, "knots_v must be finite and strictly increasing"),
        ({"multiplicities_u": [2, 4]}, "knots_u must be clamped"),
        ({"multiplicities_v": [2, 4]}, "knots_v must be clamped"),
        ({"degree_u": 1, "multiplicities_u": [2, 2]}, "knots_u: multiplicities must add up"),
        ({"degree_v": 26}, r"degree must be a whole number in \[1, 25\], got 26"),
    ],
)
def test_surfaces_refuse(change, message):
    good = {
        "control_points": np.zeros((3, 3, 3)),
        "knots_u": [0, 1],
        "multiplicities_u": [3, 3],
        "degree_u": 2,
        "knots_v": [0, 1],
        "multiplicities_v": [3, 3],
        "degree_v": 2,
        "weights": None,
    }
    BSplineSurface(**good)
    with pytest.raises(InputError, match=message):
        BSplineSurface(**(good | change))


@pytest.mark.parametrize("side", ["w0", "u2", "", "U0", None, 0])
def test_unknown_sides_are_refused(side):
    with pytest.raises(InputError, match='side must be "u0", "u1", "v0" or "v1"'):
        octant().boundary(side)


@pytest.mark.parametrize("order", [-1, 1.5])
def test_orders_that_are_no_whole_number_are_refused(order):
    with pytest.raises(InputError, match="order"):
        quarter_circle().derivative(0.5, order)


@pytest.mark.parametrize("orders", [(0, 0), (1, 0), (0, 1), (1, 1), (2, 0), (2, 1), (1, 2), (3, 0)])
def test_derivatives_of_a_rational_surface_of_any_order(orders):
    # (u, v, u v) / (1 + u + v) is bilinear over bilinear
    weights = np.array([[1.0, 2.0], [2.0, 3.0]])
    numerators = np.array([[[0, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 1]]], dtype=float)
    surface = BSplineSurface(numerators / weights[..., None], [0, 1], [2, 2], 1, [0, 1], [2, 2], 1, weights)
    assert surface.domain == ((0.0, 1.0), (0.0, 1.0))
    for u, v in ((0.0, 0.0), (0.3, 0.8), (1.0, 0.5)):
        with mp.workdps(40):
            for axis, top in enumerate((lambda a, b: a, lambda a, b: b, lambda a, b: a * b)):
                wanted = float(mp.diff(lambda a, b, top=top: top(a, b) / (1 + a + b), (u, v), orders))
                assert abs(surface.derivative(u, v, orders)[axis] - wanted) < 1e-12
