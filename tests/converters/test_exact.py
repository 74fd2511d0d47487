from __future__ import annotations

import math

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gtcad import BERNSTEIN, Curve, Restricted, Surface
from gtcad.basis import Basis
from gtcad.converters.exact import (
    IDENTITY,
    MappedFactors,
    ParameterMap,
    exact_curve,
    exact_map,
    exact_surface,
    polynomial_form,
)
from gtcad.errors import InputError
from gtcad.factors import CurveOfTerms, Waves
from tests import pieces, reference, splines

POINTS = np.array([[10.0, -20, 5], [70, 90, 10], [100, 0, 40]])
ARC = np.array([[1.0, 0], [1, 1], [0, 1]])
LINE = np.linspace(0, 1, 101)
KINDS = ("tangent", "versine", "sine", "sine squared")
RANGES = [(0.0, 1.0), (0.25, 0.8), (0.9, 0.15), (1.0, 0.0), (0.0, 0.4), (1.0, 0.5), (0.5, 0.5 + 1e-6)]
GAMMAS = [(0.0, 0.0), (0.3, -0.4), (1.0, 1.0), (-1.0, 0.5), (0.2, -1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)]


def whole_parameter(kind, w):
    """The model's parameter t of the exact form's own parameter w, at 50 digits."""
    return {
        "tangent": lambda: mp.atan(w) * 4 / mp.pi,
        "versine": lambda: mp.acos(1 - w) * 2 / mp.pi,
        "sine": lambda: mp.asin(w) * 2 / mp.pi,
        "sine squared": lambda: mp.asin(mp.sqrt(w)) * 2 / mp.pi,
    }[kind]()


def own_parameter(kind, t):
    """The exact form's own parameter w of the model's parameter t, at 50 digits."""
    return {
        "tangent": lambda: mp.tan(mp.pi * t / 4),
        "versine": lambda: 1 - mp.cos(mp.pi * t / 2),
        "sine": lambda: mp.sin(mp.pi * t / 2),
        "sine squared": lambda: mp.sin(mp.pi * t / 2) ** 2,
    }[kind]()


def barycentric(points, triangle):
    """Coordinates of plane points in a triangle."""
    matrix = np.vstack([np.asarray(triangle).T, np.ones(3)])
    return np.linalg.solve(matrix, np.vstack([np.asarray(points).T, np.ones(len(points))]))


# Conics


@pytest.mark.parametrize("radius", [1e-3, 1.0, 100.0, 1e5])
def test_the_quarter_circle(radius):
    spline, parameter_map = exact_curve(Curve(ARC * radius))
    assert np.array_equal(spline.control_points, ARC * radius)
    assert spline.weights.tolist() == [1, 1, 2]
    assert (spline.degree, spline.knots.tolist(), spline.multiplicities) == (2, [0, 1], (3, 3))
    assert abs(np.hypot(*spline.evaluate(LINE).T) - radius).max() <= 1e-15 * radius
    assert parameter_map == ParameterMap("tangent")


def test_an_ellipse_from_its_conjugate_half_diameters():
    """c + cos(theta) a + sin(theta) b with c = P0 - P1 + P2, a = P1 - P2, b = P1 - P0."""
    p = np.array([[3.0, 1], [9, 4], [7, -2]])
    spline, _ = exact_curve(Curve(p))
    center, a, b = p[0] - p[1] + p[2], p[1] - p[2], p[1] - p[0]
    coordinates = np.linalg.solve(np.array([a, b]).T, (spline.evaluate(LINE) - center).T)
    assert abs((coordinates**2).sum(axis=0) - 1).max() <= 1e-14
    assert np.array_equal(spline.control_points[[0, -1]], p[[0, -1]])


@pytest.mark.parametrize("gamma", [(-1.0, 0.5), (-1.0, -0.3), (0.5, -1.0), (-0.9, -1.0), (-1.0, 1.0), (1.0, -1.0)])
def test_parabolas(gamma):
    """The model's points satisfy l1^2 = 4 l0 l2 in the barycentric coordinates of the polynomial's polygon."""
    curve = Curve([[0, 0], [60, 90], [100, 10]], gamma)
    spline, parameter_map = exact_curve(curve)
    assert (spline.degree, spline.weights) == (2, None)
    assert parameter_map.kind == ("versine" if gamma[0] == -1 else "sine")
    l0, l1, l2 = barycentric(curve.evaluate(LINE), spline.control_points)
    assert abs(l1**2 - 4 * l0 * l2).max() <= 1e-14
    assert np.array_equal(spline.control_points[[0, -1]], curve.control_points[[0, -1]])
    on_edge = spline.control_points[1] - curve.control_points[1]
    other = curve.control_points[2 if gamma[0] == -1 else 0]
    assert abs(np.cross(*(np.append(x, 0) for x in (on_edge, other - curve.control_points[1])))).max() <= 1e-11


@pytest.mark.parametrize(
    ("gamma", "w"), [((-1, 1), 1 - np.cos(np.pi / 2 * LINE)), ((1, -1), np.sin(np.pi / 2 * LINE))], ids=str
)
def test_opposite_extremes_are_the_quadratic_bezier_curve_of_the_polygon(gamma, w):
    curve = Curve(POINTS, gamma)
    spline, _ = exact_curve(curve)
    assert np.array_equal(spline.control_points, POINTS)
    assert spline.weights is None
    w = w[:, None]
    bezier = (1 - w) ** 2 * POINTS[0] + 2 * w * (1 - w) * POINTS[1] + w**2 * POINTS[2]
    assert abs(curve.evaluate(LINE) - bezier).max() <= 1e-13


def test_both_at_minus_1_is_the_chord():
    curve = Curve(POINTS, (-1, -1))
    spline, parameter_map = exact_curve(curve)
    assert spline.degree == 1
    assert np.array_equal(spline.control_points, POINTS[[0, 2]])
    assert parameter_map.kind == "sine squared"
    share = np.sin(np.pi / 2 * LINE)[:, None] ** 2
    assert abs(curve.evaluate(LINE) - (POINTS[0] + share * (POINTS[2] - POINTS[0]))).max() <= 1e-13


@pytest.mark.parametrize("gamma", [(0.3, -0.4), (1.0, 1.0), (0.0, 1e-9), (-0.999, -0.999)])
def test_any_other_piece_of_degree_2_is_rational_of_degree_4(gamma):
    spline, parameter_map = exact_curve(Curve(POINTS, gamma))
    assert spline.degree == 4
    assert spline.weights.tolist() == pytest.approx([1, 1, 4 / 3, 2, 4])
    assert parameter_map == ParameterMap("tangent")


@pytest.mark.parametrize("part", RANGES, ids=str)
@pytest.mark.parametrize("gamma", GAMMAS, ids=str)
def test_exact_forms_at_50_digits(gamma, part):
    """Whole pieces and parts, forwards and backwards: spline(x) is the model's point at the mapped parameter."""
    curve = Curve(POINTS, gamma)
    spline, parameter_map = exact_curve(Restricted(curve, part))
    assert spline.weights is None or spline.weights.min() > 0
    for x in (0.0, 0.123, 0.5, 0.77, 1.0):
        with mp.workdps(reference.DIGITS):
            start, end = (own_parameter(parameter_map.kind, mp.mpf(t)) for t in part)
            w = start * (1 - mp.mpf(x)) + end * mp.mpf(x)
            at = whole_parameter(parameter_map.kind, w)
        assert splines.curve_error(curve, spline, x, at) <= 1e-12


@given(
    st.tuples(st.floats(-1, 1), st.floats(-1, 1)),
    st.tuples(st.floats(0, 1), st.floats(0, 1)).filter(lambda part: abs(part[0] - part[1]) > 1e-3),
)
def test_exact_forms_of_any_part_with_any_design_variables(gamma, part):
    curve = Restricted(Curve(POINTS, gamma), part)
    spline, parameter_map = exact_curve(curve)
    gap = curve.evaluate(parameter_map(LINE)) - spline.evaluate(LINE)
    assert abs(gap).max() <= 1e-11
    assert abs(spline.evaluate([0.0, 1.0]) - curve.evaluate([0.0, 1.0])).max() <= 1e-12
    assert spline.weights is None or spline.weights.min() > 0


def test_parts_of_parts():
    curve = Curve(POINTS, (0.2, 0.9))
    once, _ = exact_curve(Restricted(curve, (0.7, 0.3)))
    twice, _ = exact_curve(Restricted(Restricted(curve, (0.9, 0.1)), (0.25, 0.75)))
    assert abs(once.control_points - twice.control_points).max() <= 1e-12


def test_forms_of_plane_and_space_curves_agree():
    plane, _ = exact_curve(Curve(POINTS[:, :2], (0.2, 0.9)))
    space, _ = exact_curve(Curve(POINTS, (0.2, 0.9)))
    assert np.array_equal(plane.control_points, space.control_points[:, :2])


def test_degenerate_polygons_have_forms_too():
    for points in (np.zeros((3, 3)), np.ones((3, 2)), np.outer([0, 1, 2], [1, 2, 3])):
        for gamma in GAMMAS:
            curve = Curve(points, gamma)
            spline, parameter_map = exact_curve(curve)
            assert abs(curve.evaluate(parameter_map(LINE)) - spline.evaluate(LINE)).max() <= 1e-14


# Parameter maps


@pytest.mark.parametrize("part", RANGES[:-1], ids=str)
@pytest.mark.parametrize("kind", KINDS)
def test_parameter_maps_at_50_digits(kind, part):
    """The spline's parameter at 50 digits of the one that was found: the map has that for its inverse."""
    parameter_map = ParameterMap(kind, *part)
    x = np.linspace(0, 1, 33)
    with mp.workdps(reference.DIGITS):
        first, last = (mp.mpf(t) for t in part)
        start, end = own_parameter(kind, first), own_parameter(kind, last)
        for place, found in zip(x.tolist(), parameter_map(x).tolist(), strict=True):
            back = own_parameter(kind, first + (last - first) * mp.mpf(found))
            assert abs((back - start) / (end - start) - mp.mpf(place)) <= 1e-15 / abs(end - start)


@pytest.mark.parametrize("part", RANGES[:-1], ids=str)
@pytest.mark.parametrize("kind", [*KINDS, "identity"])
def test_inverses_of_parameter_maps(kind, part):
    parameter_map = ParameterMap(kind, *part)
    x = np.linspace(0, 1, 101)
    assert abs(parameter_map.inverse(parameter_map(x)) - x).max() <= 2e-15 / (part[1] - part[0]) ** 2
    assert (np.diff(parameter_map(x)) > 0).all()
    for end in (0.0, 1.0):
        assert parameter_map(end) == end
        assert abs(parameter_map.inverse(end) - end) <= 4e-16


def test_maps_keep_the_shape_of_the_parameters():
    for kind in (*KINDS, "identity"):
        for shape in ((), (0,), (2, 3)):
            assert ParameterMap(kind)(np.full(shape, 0.5)).shape == shape
            assert ParameterMap(kind).inverse(np.full(shape, 0.5)).shape == shape


def test_ends_of_the_tangent_are_exact():
    assert ParameterMap("tangent").ends == (0.0, 1.0)
    assert ParameterMap("tangent", 1.0, 0.0).ends == (1.0, 0.0)


# What has a form


def test_the_simplest_form_is_chosen():
    kinds = {
        (0.0, 0.0): "tangent",
        (0.5, 0.2): "tangent",
        (-1.0, 0.2): "versine",
        (0.2, -1.0): "sine",
        (-1.0, -1.0): "sine squared",
    }
    for gamma, kind in kinds.items():
        assert exact_map(Basis(2, gamma)) == ParameterMap(kind)


@pytest.mark.parametrize("degree", [3, 4, 5, 13, 60])
def test_higher_degrees_have_none(degree):
    for gamma in GAMMAS:
        assert exact_map(Basis(degree, gamma)) is None
    curve = pieces.random_curve(np.random.default_rng(degree), degree, 1.0)
    assert exact_curve(curve) is None
    assert exact_curve(Restricted(curve, (0.2, 0.4))) is None


def test_other_factors_have_none():
    assert exact_curve(CurveOfTerms(Waves(0.0, math.pi / 2), [[0, 0], [1, 0], [0, 1]])) is None


@pytest.mark.parametrize("kind", KINDS)
def test_maps_that_do_not_belong_to_the_factors_are_refused(kind):
    for factors in (Basis(3), Basis(2, family=BERNSTEIN), Waves(0.0, 1.0)):
        with pytest.raises(InputError, match=f"no exact form of kind '{kind}'"):
            MappedFactors.of(factors, ParameterMap(kind))
    if kind != "tangent":
        with pytest.raises(InputError, match="no exact form"):
            MappedFactors.of(Basis(2, (0.1, 0.2)), ParameterMap(kind))
    with pytest.raises(InputError, match="no exact form"):
        MappedFactors.of(Basis(2, (-1, -1)), ParameterMap(kind, 0.0, 0.5))


@pytest.mark.parametrize("kind", KINDS)
def test_every_map_makes_the_chord_rational(kind):
    """gamma = (-1, -1) has all four forms; the values are numerators over the denominator."""
    factors = Basis(2, (-1, -1))
    mapped = MappedFactors.of(factors, ParameterMap(kind))
    x = np.linspace(0, 1, 41)
    values = mapped.rows(x) / mapped.denominator(x)
    assert abs(values - factors.rows(ParameterMap(kind)(x))).max() <= 1e-15


# Classical Bezier pieces


@pytest.mark.parametrize("degree", [1, 2, 5, 25])
def test_classical_pieces_are_their_own_form(degree):
    points = np.random.default_rng(degree).normal(size=(degree + 1, 3))
    spline, parameter_map = exact_curve(Curve(points, family=BERNSTEIN))
    assert parameter_map == IDENTITY
    assert spline.degree == degree
    assert np.array_equal(spline.control_points, points)
    assert spline.weights is None


@pytest.mark.parametrize("part", RANGES, ids=str)
def test_parts_of_classical_pieces(part):
    points = np.random.default_rng(1).normal(size=(8, 3))
    curve = Restricted(Curve(points, family=BERNSTEIN), part)
    spline, parameter_map = exact_curve(curve)
    assert parameter_map == IDENTITY
    assert abs(spline.evaluate(LINE) - curve.evaluate(LINE)).max() <= 1e-14
    assert abs(spline.control_points[[0, -1]] - curve.evaluate([0.0, 1.0])).max() <= 1e-15


def test_classical_pieces_beyond_degree_25_have_none():
    assert exact_map(Basis(26, family=BERNSTEIN)) is None
    assert polynomial_form(Basis(26, family=BERNSTEIN)) is None
    assert polynomial_form(Basis(2)) is None
    assert np.array_equal(polynomial_form(Basis(3, family=BERNSTEIN)), np.eye(4))


# Surfaces


def octant(radius):
    """A quarter meridian turned by a quarter: P_ij = (x_i X_j, x_i Y_j, z_i)."""
    return Surface(radius * np.array([[[x * c, x * s, z] for c, s in ARC] for x, z in ARC]))


@pytest.mark.parametrize("radius", [1e-3, 1.0, 1e5])
def test_the_sphere_octant(radius):
    spline, maps = exact_surface(octant(radius))
    points = spline.evaluate(LINE[:, None], LINE[None, :])
    assert abs((points**2).sum(axis=2) - radius**2).max() <= 4e-15 * radius**2
    assert points.min() >= 0
    assert (spline.degree_u, spline.degree_v) == (2, 2)
    assert np.array_equal(spline.weights, np.outer([1, 1, 2], [1, 1, 2]))
    assert maps == (ParameterMap("tangent"),) * 2


def test_a_quarter_of_a_torus():
    """The ring arc (4, 0), (4, 1), (3, 1) turned by a quarter: (hypot(x, y) - 3)^2 + z^2 = 1."""
    profile = np.array([[4.0, 0], [4, 1], [3, 1]])
    spline, _ = exact_surface(Surface(np.array([[[x * c, x * s, z] for c, s in ARC] for x, z in profile])))
    x, y, z = np.moveaxis(spline.evaluate(LINE[:, None], LINE[None, :]), 2, 0)
    assert abs((np.hypot(x, y) - 3) ** 2 + z**2 - 1).max() <= 1e-14


def test_a_cylinder_is_rational_in_one_direction_only():
    points = np.array([[[x, y, 0.0], [x, y, 7.0]] for x, y in 5 * ARC])
    spline, maps = exact_surface(Surface(points, family_v=BERNSTEIN))
    assert (spline.degree_u, spline.degree_v) == (2, 1)
    assert maps == (ParameterMap("tangent"), IDENTITY)
    assert np.array_equal(spline.weights, [[1, 1], [1, 1], [2, 2]])
    x, y, z = np.moveaxis(spline.evaluate(LINE[:, None], LINE[None, :]), 2, 0)
    assert abs(np.hypot(x, y) - 5).max() <= 5e-15
    assert abs(z - 7 * LINE).max() <= 1e-14


def test_polynomial_patches_need_no_weights():
    points = np.random.default_rng(2).normal(size=(3, 4, 3))
    spline, _ = exact_surface(Surface(points, gamma_u=(-1, 0.4), family_v=BERNSTEIN))
    assert spline.weights is None
    assert (spline.degree_u, spline.degree_v) == (2, 3)


@pytest.mark.parametrize("part", [((0.0, 1.0), (0.0, 1.0)), ((0.8, 0.1), (0.3, 0.9)), ((1.0, 0.0), (1.0, 0.5))])
@pytest.mark.parametrize("gamma_v", GAMMAS, ids=str)
@pytest.mark.parametrize("gamma_u", [(0.0, 0.0), (0.3, -0.4), (-1.0, 0.5)], ids=str)
def test_forms_of_surfaces(gamma_u, gamma_v, part):
    points = np.random.default_rng(3).normal(size=(3, 3, 3)) * 50
    surface = Restricted(Surface(points, gamma_u, gamma_v), part)
    spline, (map_u, map_v) = exact_surface(surface)
    x = np.linspace(0, 1, 25)
    gap = surface.evaluate(map_u(x)[:, None], map_v(x)[None, :]) - spline.evaluate(x[:, None], x[None, :])
    assert abs(gap).max() <= 1e-12
    assert spline.weights is None or spline.weights.min() > 0


def test_one_direction_without_a_form_is_enough_to_have_none():
    points = np.zeros((3, 4, 3))
    assert exact_surface(Surface(points)) is None
    assert exact_surface(Surface(points.swapaxes(0, 1))) is None
    assert exact_surface(Surface(points, family_v=BERNSTEIN)) is not None
