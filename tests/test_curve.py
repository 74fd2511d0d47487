from __future__ import annotations

import copy
import dataclasses
import json
import math
import pickle
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import BPoly
from scipy.spatial import ConvexHull

from gtcad.basis import BERNSTEIN, GT, Basis
from gtcad.curve import Curve
from gtcad.differential import curvature
from gtcad.errors import InputError
from gtcad.measure import curvature_energy, length

HALF_PI = math.pi / 2
REFERENCE = Curve([(0, 0, 0), (1, 2, 0.5), (2, 2.5, 2), (3, 1, 2.5), (4, 0, 1)], (0.2, -0.3))

design_variables = st.one_of(st.floats(-1, 1), st.sampled_from([-1.0, 0.0, 1.0]))
gammas = st.tuples(design_variables, design_variables)
parameters = st.floats(0, 1)


@st.composite
def curves(draw: st.DrawFn, least: int = 2, most: int = 12) -> Curve:
    degree = draw(st.integers(least, most))
    random = np.random.default_rng(draw(st.integers(0, 10**6)))
    return Curve(random.standard_normal((degree + 1, draw(st.sampled_from([2, 3])))), draw(gammas))


# Derivatives at the start, from the formulas for joins


@given(curves(most=60))
def test_first_derivative_at_the_start(curve: Curve) -> None:
    n2, g1 = curve.degree - 2, curve.gamma[0]
    first = np.diff(curve.control_points[:2], axis=0)[0]
    expected = (n2 + HALF_PI * (1 + g1)) * first
    assert abs(curve.derivative(0.0) - expected).max() <= 1e-14 * (curve.degree + 1) * abs(curve.control_points).max()


@given(curves(most=60))
def test_second_derivative_at_the_start(curve: Curve) -> None:
    n2, h = curve.degree - 2, HALF_PI
    g1, g2 = curve.gamma
    d0, d1 = np.diff(curve.control_points[:3], axis=0)
    expected = -2 * g1 * h**2 * d0 + (1 - g2) * h**2 * d1 + (2 * n2 * h * (1 + g1) + n2 * (n2 - 1)) * (d1 - d0)
    assert abs(curve.derivative(0.0, 2) - expected).max() <= 1e-14 * (curve.degree + 1) ** 2 * 10


@given(curves(least=3, most=60))
def test_third_derivative_at_the_start(curve: Curve) -> None:
    n2, h = curve.degree - 2, HALF_PI
    g1, g2 = curve.gamma
    d0, d1, d2 = np.diff(curve.control_points[:4], axis=0)
    expected = (
        -(1 + g1) * h**3 * d0
        + 3 * n2 * h**2 * (-2 * g1 * (d1 - d0) + (1 - g2) * (d2 - d1))
        + (3 * n2 * (n2 - 1) * h * (1 + g1) + n2 * (n2 - 1) * (n2 - 2)) * (d2 - 2 * d1 + d0)
    )
    assert abs(curve.derivative(0.0, 3) - expected).max() <= 1e-14 * (curve.degree + 1) ** 3 * 30


@given(gammas)
def test_third_derivative_at_the_start_of_degree_two(gamma: tuple[float, float]) -> None:
    curve = Curve([[0, 1], [2, 5], [7, -3]], gamma)
    expected = -(1 + gamma[0]) * HALF_PI**3 * np.array([2, 4])  # all that is left of the formula with N = 0
    assert abs(curve.derivative(0.0, 3) - expected).max() <= 1e-12


@given(curves(), st.integers(0, 3))
def test_derivatives_at_the_end_are_those_of_the_mirrored_curve(curve: Curve, order: int) -> None:
    mirrored = Curve(curve.control_points[::-1], curve.gamma[::-1])
    at_end, at_start = curve.derivative(1.0, order), (-1) ** order * mirrored.derivative(0.0, order)
    assert abs(at_end - at_start).max() <= 1e-14 * 20.0**order


@given(curves(most=9), st.integers(1, 4))
def test_derivatives_at_the_start_see_the_first_control_points_only(curve: Curve, order: int) -> None:
    moved = curve.control_points.copy()
    moved[order + 1 :] += 5
    other = Curve(moved, curve.gamma)
    assert abs(curve.derivative(0.0, order) - other.derivative(0.0, order)).max() <= 1e-14 * 20.0**order


def test_reference_values() -> None:
    assert float(length(REFERENCE)) == pytest.approx(6.091650780833, abs=5e-13)
    assert float(curvature(REFERENCE, 0.0)) == pytest.approx(0.2308740350620, abs=5e-14)
    assert float(curvature(REFERENCE, 1.0)) == pytest.approx(0.3418418046721, abs=5e-14)
    assert float(curvature_energy(REFERENCE)) == pytest.approx(1.468379117009, abs=5e-13)


# Shape


@given(curves())
def test_starts_and_ends_at_control_points(curve: Curve) -> None:
    assert np.array_equal(curve.evaluate([0.0, 1.0]), curve.control_points[[0, -1]])


@given(curves(), parameters)
def test_lies_in_the_convex_hull(curve: Curve, t: float) -> None:
    if curve.degree < curve.dimension:
        curve = curve.transformed(np.eye(3)[:2, : curve.dimension])
    hull = ConvexHull(curve.control_points)
    point = curve.evaluate(t)
    assert (hull.equations[:, :-1] @ point + hull.equations[:, -1] <= 1e-12).all()


@given(st.floats(0, 1))
def test_degree_two_without_design_variables_is_an_ellipse_arc(t: float) -> None:
    points = np.array([[3.0, 1.0], [4.0, 5.0], [-2.0, 2.0]])
    centre = points[0] - points[1] + points[2]
    axes = np.stack([points[1] - points[2], points[1] - points[0]], axis=1)
    x, y = np.linalg.solve(axes, Curve(points).evaluate(t) - centre)
    assert math.hypot(x, y) == pytest.approx(1, abs=1e-14)


@pytest.mark.parametrize(
    ("gamma", "wave"), [((-1, 1), lambda t: 1 - math.cos(HALF_PI * t)), ((1, -1), lambda t: math.sin(HALF_PI * t))]
)
def test_degree_two_at_opposite_ends_is_the_parabola_of_its_polygon(gamma: tuple[float, float], wave: object) -> None:
    points = np.array([[3.0, 1.0, 0.0], [4.0, 5.0, 1.0], [-2.0, 2.0, 7.0]])
    for t in np.linspace(0, 1, 11):
        parabola = Curve(points, family=BERNSTEIN).evaluate(wave(t))
        assert abs(Curve(points, gamma).evaluate(t) - parabola).max() <= 3e-15


@given(gammas, st.floats(0.01, 0.99))
def test_design_variables_move_the_curve_between_fixed_ends(gamma: tuple[float, float], t: float) -> None:
    points = [[0, 0], [1, 3], [4, 3], [5, 0]]
    middle = Curve(points, gamma).evaluate(t)[1]
    assert Curve(points, (-1, -1)).evaluate(t)[1] - 1e-14 <= middle <= Curve(points, (1, 1)).evaluate(t)[1] + 1e-14


# Changes


@given(curves(), parameters, st.integers(0, 3))
def test_reversed(curve: Curve, t: float, order: int) -> None:
    expected = (-1) ** order * curve.derivative(1 - t, order)
    assert abs(curve.reversed().derivative(t, order) - expected).max() <= 1e-14 * 30.0**order
    assert curve.reversed().reversed() == curve


@given(curves(), parameters, st.integers(0, 2))
def test_transformed(curve: Curve, t: float, order: int) -> None:
    random = np.random.default_rng(1)
    matrix, translation = (
        random.standard_normal((curve.dimension, curve.dimension)),
        random.standard_normal(curve.dimension),
    )
    moved = curve.transformed(matrix, translation)
    expected = matrix @ curve.derivative(t, order) + (translation if order == 0 else 0)
    assert abs(moved.derivative(t, order) - expected).max() <= 1e-13 * 30.0**order
    assert moved.gamma == curve.gamma


def test_a_plane_curve_is_lifted_and_a_space_curve_projected() -> None:
    plane = Curve([[1, 0], [1, 1], [0, 1]], (0.5, 0.25))
    lifted = plane.transformed([[1, 0], [0, 1], [0, 0]], [0, 0, 5])
    assert lifted.evaluate(0.3).tolist() == pytest.approx([*plane.evaluate(0.3), 5.0], rel=1e-15)
    assert lifted.transformed([[1, 0, 0], [0, 1, 0]]) == plane
    with pytest.raises(InputError, match="matrix"):
        plane.transformed(np.eye(3))


@pytest.mark.parametrize("bad", [math.inf, math.nan])
def test_refuses_transformations_that_are_not_finite(bad: float) -> None:
    curve = Curve([[1, 0], [1, 1], [0, 1]])
    with pytest.raises(InputError, match="finite"):
        curve.transformed([[bad, 0], [0, 1]])
    with pytest.raises(InputError, match="finite"):
        curve.transformed(np.eye(2), [bad, 0])


# Identity


def test_equality_and_hash() -> None:
    points = [[0, 0], [1, 2], [3, 1]]
    curve = Curve(points, (0.5, 0.25))
    assert curve == Curve(np.array(points, dtype=float), [0.5, 0.25])
    assert hash(curve) == hash(Curve(points, (0.5, 0.25)))
    assert curve != Curve(points, (0.5, 0.2))
    assert curve != Curve(points[::-1], (0.5, 0.25))
    assert Curve(points) != Curve(points, family=BERNSTEIN)
    assert curve != "a curve"


def test_equal_curves_have_equal_hashes_whatever_the_sign_of_zero() -> None:
    curve, other = Curve([[0.0, 1], [1, 2], [3, 1]]), Curve([[-0.0, 1], [1, 2], [3, 1]])
    assert curve == other
    assert hash(curve) == hash(other)


def test_copies() -> None:
    curve = Curve([[0, 0], [1, 2], [3, 1]], (0.5, 0.25))
    for other in (pickle.loads(pickle.dumps(curve)), copy.copy(curve), copy.deepcopy(curve)):
        assert other == curve
        assert np.array_equal(other.evaluate(0.3), curve.evaluate(0.3))
    assert (
        dataclasses.replace(curve, gamma=(0.0, 0.0)).evaluate(0.3).tolist()
        == Curve(curve.control_points).evaluate(0.3).tolist()
    )


def test_control_points_stay_read_only_in_copies() -> None:
    curve = Curve([[0, 0], [1, 2], [3, 1]])
    for other in (curve, pickle.loads(pickle.dumps(curve)), copy.deepcopy(curve)):
        assert not other.control_points.flags.writeable


def test_cannot_be_changed() -> None:
    curve = Curve([[0, 0], [1, 2], [3, 1]])
    with pytest.raises(dataclasses.FrozenInstanceError):
        curve.gamma = (1.0, 0.0)
    with pytest.raises(ValueError, match="read-only"):
        curve.control_points[0, 0] = 1
    assert (curve.degree, curve.dimension, curve.family) == (2, 2, GT)
    assert curve.factors == Basis(2)
    assert "control_points" in repr(curve)


# The classical Bezier curve


def test_bernstein_curve_of_degree_one_is_the_segment() -> None:
    segment = Curve([[0, 0, 1], [2, 4, 3]], family=BERNSTEIN)
    assert segment.evaluate(0.25).tolist() == [0.5, 1.0, 1.5]
    assert segment.derivative(0.7).tolist() == [2.0, 4.0, 2.0]


@given(st.integers(1, 20), parameters)
def test_bernstein_curve_is_the_sum_of_its_definition(degree: int, t: float) -> None:
    points = np.random.default_rng(degree).standard_normal((degree + 1, 3))
    weights = [math.comb(degree, i) * t**i * (1 - t) ** (degree - i) for i in range(degree + 1)]
    curve = Curve(points, family=BERNSTEIN)
    assert abs(curve.evaluate(t) - weights @ points).max() <= 1e-14
    assert abs(curve.derivative(0.0) - degree * (points[1] - points[0])).max() <= 1e-14 * degree
    assert abs(curve.derivative(1.0) - degree * (points[-1] - points[-2])).max() <= 1e-14 * degree


@given(st.integers(2, 20), parameters)
def test_derivative_of_a_bernstein_curve_is_the_curve_of_its_derivative_control_points(degree: int, t: float) -> None:
    points = np.random.default_rng(degree).standard_normal((degree + 1, 2))
    hodograph = Curve(degree * np.diff(points, axis=0), family=BERNSTEIN)
    curve = Curve(points, family=BERNSTEIN)
    for order in (1, 2, 3):
        assert (
            abs(curve.derivative(t, order) - hodograph.derivative(t, order - 1)).max()
            <= 1e-14 * 2.0 * degree**order * 4
        )


@given(st.integers(1, 15), parameters, st.integers(0, 4))
def test_bernstein_curve_against_scipy(degree: int, t: float, order: int) -> None:
    points = np.random.default_rng(degree).standard_normal((degree + 1, 3))
    other = BPoly(points[:, None, :], [0, 1])
    expected = other.derivative(order)(t) if order else other(t)
    assert (
        abs(Curve(points, family=BERNSTEIN).derivative(t, order) - expected).max()
        <= 1e-14 * (2.0 * degree) ** order * 4
    )


# Refusals


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([[0, 0], [1, 1]],), "degree must be a whole number in \\[2, 60\\]"),
        (([[0, 0]],), "degree"),
        (([[0, 0]] * 62,), "degree"),
        (([[0, 0], [1, math.nan], [2, 2]],), "control_points"),
        (([0, 1, 2],), "control_points"),
        (([[0, 0], [1, 1], [2, 0]], (2, 0)), r"gamma\[0\]"),
        (([[0, 0], [1, 1], [2, 0]], (0.5,)), "gamma"),
        (([[0, 0], [1, 1], [2, 0]], 0.5), "gamma"),
        (([[0, 0], [1, 1], [2, 0]], "ab"), "gamma"),
        (([[0, 0], [1, 1], [2, 0]], None), "gamma"),
        (([[0, 0], [1, 1], [2, 0]], (0.1, 0), BERNSTEIN), "takes no design variables"),
    ],
)
def test_refuses(arguments: tuple[object, ...], message: str) -> None:
    with pytest.raises(InputError, match=message):
        Curve(*arguments)


def test_reference_pieces_can_be_made() -> None:
    pieces = json.loads((Path(__file__).parent / "data" / "pieces.json").read_text())
    for piece in pieces["curves"]:
        curve = Curve(piece["control_points"], piece["gamma"])
        assert np.array_equal(curve.evaluate([0, 1]), curve.control_points[[0, -1]])
