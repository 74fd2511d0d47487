from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.polynomial import polynomial
from numpy.typing import ArrayLike

from gtcad.basis import BERNSTEIN
from gtcad.curve import Curve
from gtcad.differential import (
    curvature,
    curvature_rate,
    first_fundamental_form,
    frenet_frame,
    gaussian_curvature,
    mean_curvature,
    normal,
    principal_curvatures,
    second_fundamental_form,
    signed_curvature,
    signed_curvature_rate,
    tangent,
    torsion,
)
from gtcad.errors import InputError
from gtcad.restricted import Restricted
from gtcad.surface import Surface

Array = np.ndarray

parameters = st.floats(0, 1)
seeds = st.integers(0, 10**6)
design_variables = st.floats(-0.9, 1)

QUARTER = np.array([(1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
T = np.linspace(0, 1, 21)


def polynomial_curve(*coordinates: ArrayLike) -> Curve:
    """The classical Bezier curve of polynomials given by their coefficients, the constant first."""
    degree = max(len(c) for c in coordinates) - 1
    padded = np.array([np.pad(np.asarray(c, dtype=float), (0, degree + 1 - len(c))) for c in coordinates])
    points = [
        sum(padded[:, k] * math.comb(i, k) / math.comb(degree, k) for k in range(i + 1)) for i in range(degree + 1)
    ]
    return Curve(points, family=BERNSTEIN)


def polynomial_surface(*coordinates: Array) -> Surface:
    """The classical Bezier surface of polynomials given by tables of coefficients of u^i v^j."""
    table = np.array(coordinates, dtype=float)
    to_u, to_v = (
        np.array([[math.comb(i, k) / math.comb(n, k) for k in range(n + 1)] for i in range(n + 1)])
        for n in (table.shape[1] - 1, table.shape[2] - 1)
    )
    return Surface(np.einsum("ik,jl,dkl->ijd", to_u, to_v, table), family_u=BERNSTEIN, family_v=BERNSTEIN)


def rotated(meridian: ArrayLike) -> Surface:
    """A quarter turn of a meridian (distance from the axis, height) around z; v is the angle."""
    return Surface([[(r * x, r * y, z) for x, y in QUARTER] for r, z in np.asarray(meridian)])


SPHERE = rotated([(2, 0), (2, 2), (0, 2)])  # radius 2, its pole at u = 1
TORUS = rotated([(4, 0), (4, 1), (3, 1)])  # radii 3 and 1
ENNEPER = polynomial_surface(
    [[0, 0, 0, 0], [1, 0, 1, 0], [0, 0, 0, 0], [-1 / 3, 0, 0, 0]],
    [[0, -1, 0, 1 / 3], [0, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 0]],
    [[0, 0, -1, 0], [0, 0, 0, 0], [1, 0, 0, 0], [0, 0, 0, 0]],
)
SADDLE = polynomial_surface([[-1, 0], [2, 0]], [[-1, 2], [0, 0]], [[1, -2], [-2, 4]])  # z = x y on [-1, 1]^2


@dataclass(frozen=True)
class Helix:
    """Not a shape of gtcad: anything that can be differentiated will do."""

    radius: float
    slope: float
    dimension: int = 3

    def derivative(self, t: ArrayLike, order: int = 1) -> Array:
        t = np.asarray(t, dtype=np.float64)
        phase = 4 * t + order * math.pi / 2
        line = 4 * self.slope * np.array([t, np.ones_like(t), np.zeros_like(t)][min(order, 2)])
        circle = 4.0**order * self.radius
        return np.stack([circle * np.cos(phase), circle * np.sin(phase), line], axis=-1)


# Curves whose quantities are known


@pytest.mark.parametrize("slope", [0.0, 0.5, -2.0])
def test_helix(slope: float) -> None:
    helix, square = Helix(1.5, slope), 1.5**2 + slope**2
    assert abs(curvature(helix, T) - 1.5 / square).max() <= 1e-14
    assert abs(torsion(helix, T) - slope / square).max() <= 1e-14
    assert abs(curvature_rate(helix, T)).max() <= 1e-14
    frame = frenet_frame(helix, T)
    cos, sin, zero = np.cos(4 * T), np.sin(4 * T), 0 * T
    assert abs(frame.normal + np.stack([cos, sin, zero], axis=-1)).max() <= 1e-15 * 4
    wanted = np.stack([-1.5 * sin, 1.5 * cos, zero + slope], axis=-1) / math.sqrt(square)
    assert abs(frame.tangent - wanted).max() <= 1e-15 * 4
    wanted = np.stack([slope * sin, -slope * cos, zero + 1.5], axis=-1) / math.sqrt(square)
    assert abs(frame.binormal - wanted).max() <= 1e-15 * 4


def test_ellipse() -> None:
    ellipse = Curve([[3, 0], [3, 2], [0, 2]])
    angle = math.pi / 2 * T
    square = 9 * np.sin(angle) ** 2 + 4 * np.cos(angle) ** 2
    expected = 6 / square**1.5
    rate = -1.5 * 6 / square**2.5 * (9 - 4) * np.sin(2 * angle) / np.sqrt(square)
    assert abs(curvature(ellipse, T) - expected).max() <= 1e-14
    assert abs(signed_curvature(ellipse, T) - expected).max() <= 1e-14
    assert abs(signed_curvature(ellipse.reversed(), 1 - T) + expected).max() <= 1e-14
    assert abs(curvature_rate(ellipse, T) - rate).max() <= 1e-14
    assert abs(signed_curvature_rate(ellipse, T) - rate).max() <= 1e-14
    assert abs(curvature_rate(ellipse.reversed(), 1 - T) + rate).max() <= 1e-14
    assert (torsion(ellipse, T) == 0).all()


def test_twisted_cubic() -> None:
    cubic = polynomial_curve([0, 1], [0, 0, 1], [0, 0, 0, 1])
    a, b = 9 * T**4 + 9 * T**2 + 1, 9 * T**4 + 4 * T**2 + 1
    assert abs(curvature(cubic, T) - 2 * np.sqrt(a) / b**1.5).max() <= 1e-14
    assert abs(torsion(cubic, T) - 3 / a).max() <= 1e-14


def frenet_by_definition(curve: Curve, t: float) -> tuple[float, float, float]:
    """Curvature, its rate and torsion as derivatives of the tangent and the binormal by arc length, at many digits."""
    with mp.workdps(60):
        g1, g2 = map(mp.mpf, curve.gamma)
        points = [[mp.mpf(float(x)) for x in p] for p in curve.control_points]

        def coordinate(k: int) -> Callable[[object], object]:
            def value(x: object) -> object:
                s, c = mp.sin(mp.pi / 2 * x), mp.cos(mp.pi / 2 * x)
                first, last = (1 - s) * (1 - g1 * s), (1 - c) * (1 - g2 * c)
                row = [first, 1 - first - last, last]
                for _ in range(curve.degree - 2):
                    row = [(1 - x) * a + x * b for a, b in zip([*row, 0], [0, *row], strict=True)]
                return mp.fdot(row, [p[k] for p in points])

            return value

        def jet(x: object, order: int) -> object:
            return mp.matrix([mp.diff(coordinate(k), x, order) for k in range(3)])

        def speed(x: object) -> object:
            return mp.norm(jet(x, 1))

        def unit(x: object) -> object:
            return jet(x, 1) / speed(x)

        def change(x: object) -> object:
            return mp.matrix([mp.diff(lambda y, k=k: unit(y)[k], x) for k in range(3)]) / speed(x)

        kappa = mp.norm(change(t))
        rate = mp.diff(lambda x: mp.norm(change(x)), t) / speed(t)

        def binormal(x: object) -> object:
            a, b = unit(x), change(x) / mp.norm(change(x))
            return mp.matrix([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])

        turn = mp.matrix([mp.diff(lambda y, k=k: binormal(y)[k], t) for k in range(3)]) / speed(t)
        tau = -mp.fdot(turn, change(t) / kappa)
        return float(kappa), float(rate), float(tau)


@pytest.mark.parametrize(
    ("degree", "gamma", "t"), [(3, (0.3, -0.7), 0.21), (5, (1.0, -1.0), 0.5), (4, (-1.0, 0.4), 0.87)]
)
def test_curves_by_the_definitions(degree: int, gamma: tuple[float, float], t: float) -> None:
    curve = Curve(np.random.default_rng(degree).standard_normal((degree + 1, 3)), gamma)
    kappa, rate, tau = frenet_by_definition(curve, t)
    assert float(curvature(curve, t)) == pytest.approx(kappa, rel=1e-13)
    assert float(curvature_rate(curve, t)) == pytest.approx(rate, rel=1e-12)
    assert float(torsion(curve, t)) == pytest.approx(tau, rel=1e-12)


# Laws that hold for every curve


@given(seeds, design_variables, design_variables, parameters)
def test_frames_are_orthonormal_and_right_handed(seed: int, g1: float, g2: float, t: float) -> None:
    frame = np.stack(frenet_frame(Curve(np.random.default_rng(seed).standard_normal((5, 3)), (g1, g2)), t))
    assert abs(frame @ frame.T - np.eye(3)).max() <= 1e-14
    assert np.linalg.det(frame) == pytest.approx(1, abs=1e-14)


@given(seeds, design_variables, design_variables, parameters, st.sampled_from([1e-6, 1.0, 1e5]))
def test_motion_scale_and_mirror(seed: int, g1: float, g2: float, t: float, size: float) -> None:
    random = np.random.default_rng(seed)
    curve = Curve(random.standard_normal((5, 3)), (g1, g2))
    turn = np.linalg.qr(random.standard_normal((3, 3)))[0]
    hand = np.linalg.det(turn)
    moved = curve.transformed(size * turn, size * np.ones(3))
    bend = curvature(curve, t)
    loss = float(np.ptp(curvature(curve, T)) / bend) + 10
    assert float(curvature(moved, t) * size) == pytest.approx(float(bend), rel=1e-12 * loss)
    assert float(curvature_rate(moved, t) * size**2) == pytest.approx(
        float(curvature_rate(curve, t)), rel=1e-10, abs=1e-11 * loss**2 * float(bend) ** 2
    )
    assert float(hand * torsion(moved, t) * size) == pytest.approx(
        float(torsion(curve, t)), rel=1e-10, abs=1e-11 * loss**2
    )


@given(seeds, parameters)
def test_parametrisation_does_not_matter(seed: int, t: float) -> None:
    curve = Curve(np.random.default_rng(seed).standard_normal((5, 3)), (0.2, -0.3))
    start, end = 0.9, 0.3
    part, inner = Restricted(curve, (start, end)), start * (1 - t) + end * t
    assert abs(tangent(part, t) + tangent(curve, inner)).max() <= 1e-12
    assert float(curvature(part, t)) == pytest.approx(float(curvature(curve, inner)), rel=1e-10)
    assert float(torsion(part, t)) == pytest.approx(float(torsion(curve, inner)), rel=1e-8)


@given(seeds, parameters)
def test_plane_curves_have_one_curvature_in_the_plane_and_in_space(seed: int, t: float) -> None:
    curve = Curve(np.random.default_rng(seed).standard_normal((6, 2)), (0.2, -0.3))
    lifted = curve.transformed([[1, 0], [0, 1], [0, 0]])
    assert float(curvature(curve, t)) == pytest.approx(float(abs(signed_curvature(curve, t))), rel=1e-14)
    assert float(curvature(lifted, t)) == pytest.approx(float(curvature(curve, t)), rel=1e-14)
    sign = float(np.sign(signed_curvature(curve, t)))
    assert float(curvature_rate(curve, t)) == pytest.approx(sign * float(signed_curvature_rate(curve, t)), rel=1e-9)
    assert np.array_equal(frenet_frame(curve, t).binormal, [0, 0, sign])
    assert tangent(curve, t).tolist() == tangent(lifted, t)[:2].tolist()


def test_signed_curvature_adds_up_to_the_turning_of_the_tangent() -> None:
    curve = Curve(np.random.default_rng(8).standard_normal((7, 2)), (0.2, -0.3))
    z, weights = np.polynomial.legendre.leggauss(200)
    t = (z + 1) / 2
    turning = (weights / 2) @ (signed_curvature(curve, t) * np.linalg.norm(curve.derivative(t), axis=-1))
    directions = tangent(curve, np.linspace(0, 1, 20001))
    angles = np.unwrap(np.arctan2(directions[:, 1], directions[:, 0]))
    assert turning == pytest.approx(angles[-1] - angles[0], abs=1e-9)


# Singular points of curves


def in_power(power: int, *, at: float) -> Curve:
    """The twisted cubic (w, w^2, w^3) through w = 1/2 + d^power, d = t - at; for at = 1, w = 1/2 - (1 - t)^power."""
    sign = -1.0 if at == 1 else 1.0
    w = polynomial.polyadd([0.5], sign * polynomial.polypow([-at if at < 1 else 0.0, 1], power))
    curve = polynomial_curve(*(polynomial.polypow(w, k) for k in (1, 2, 3)))
    return curve.reversed() if at == 1 else curve


@pytest.mark.parametrize("power", [2, 3, 4])
@pytest.mark.parametrize("at", [0.0, 1.0, 0.5])
def test_regular_arcs_in_a_power_of_the_parameter(power: int, at: float) -> None:
    curve = in_power(power, at=at)
    arc = polynomial_curve([0, 1], [0, 0, 1], [0, 0, 0, 1])
    assert abs(curve.derivative(at)).max() <= 1e-12
    assert float(curvature(curve, at)) == pytest.approx(float(curvature(arc, 0.5)), rel=1e-10)
    assert float(torsion(curve, at)) == pytest.approx(float(torsion(arc, 0.5)), rel=1e-9)
    if at == 0.5 and power % 2 == 0:  # run to and fro
        assert np.isnan(tangent(curve, at)).all()
        assert np.isnan(curvature_rate(curve, at))
    else:
        assert abs(tangent(curve, at) - tangent(arc, 0.5)).max() <= 1e-11
        assert abs(np.stack(frenet_frame(curve, at)) - np.stack(frenet_frame(arc, 0.5))).max() <= 1e-10
        assert float(curvature_rate(curve, at)) == pytest.approx(float(curvature_rate(arc, 0.5)), rel=1e-8)


@pytest.mark.parametrize(("gamma", "end"), [((-1, 1), 0.0), ((1, -1), 1.0)])
@pytest.mark.parametrize("offset", [0.0, 1e3])
def test_degree_two_with_vanishing_end_derivative(gamma: tuple[float, float], end: float, offset: float) -> None:
    points = np.array([[0.0, 0.0], [1.0, 2.0], [3.0, -1.0]]) + offset
    curve, parabola = Curve(points, gamma), Curve(points, family=BERNSTEIN)  # the same points, 1 - c and s for w
    for function in (tangent, curvature, curvature_rate, signed_curvature, signed_curvature_rate):
        accuracy = 1e-11 if offset == 0 else 1e-7
        assert abs(function(curve, end) - function(parabola, end)).max() <= accuracy
        assert abs(function(curve, 1 - end) - function(parabola, 1 - end)).max() <= accuracy
    near = abs(end - 0.03)
    for function in (curvature, signed_curvature):
        assert abs(function(curve, near) - function(curve, end)).max() <= 0.1 * float(curvature(curve, end))


@pytest.mark.parametrize("t", [0.3, 0.1, 0.03, 0.01])
def test_digits_lost_near_a_singular_end(t: float) -> None:
    points = np.array([[0.0, 0.0], [1.0, 2.0], [3.0, -1.0]])
    curve, parabola = Curve(points, (-1, 1)), Curve(points, family=BERNSTEIN)
    w = 2 * math.sin(math.pi / 4 * t) ** 2
    ratio = max(np.linalg.norm(curve.derivative(T), axis=-1)) / np.linalg.norm(curve.derivative(t))
    assert float(curvature(curve, t)) == pytest.approx(float(curvature(parabola, w)), rel=1e-15 * ratio**2)
    assert float(curvature_rate(curve, t)) == pytest.approx(float(curvature_rate(parabola, w)), rel=1e-15 * ratio**4)


@pytest.mark.parametrize("degree", [3, 4, 7, 20])
def test_equal_first_control_points(degree: int) -> None:
    points = np.random.default_rng(degree).standard_normal((degree + 1, 3))
    points[1] = points[0]
    curve = Curve(points, (0.3, -0.5))
    direction = points[2] - points[0]
    direction /= np.linalg.norm(direction)
    assert abs(tangent(curve, 0.0) - direction).max() <= 1e-13
    assert abs(tangent(curve, 1e-7) - direction).max() <= 1e-4
    assert abs(tangent(curve.reversed(), 1.0) + direction).max() <= 1e-13
    for shape, at in ((curve, 0.0), (curve.reversed(), 1.0)):
        assert curvature(shape, at) == math.inf
        assert np.isnan(curvature_rate(shape, at))
        assert np.isnan(torsion(shape, at))
        assert np.isnan(frenet_frame(shape, at).normal).all()


def test_three_equal_control_points() -> None:
    points = np.random.default_rng(3).standard_normal((6, 3))
    points[1] = points[2] = points[0]
    direction = (points[3] - points[0]) / np.linalg.norm(points[3] - points[0])
    assert abs(tangent(Curve(points), 0.0) - direction).max() <= 1e-13
    assert curvature(Curve(points), 0.0) == math.inf


def test_cusp_inside() -> None:
    cusp = polynomial_curve([0.25, -1, 1], [-0.125, 0.75, -1.5, 1])  # (w^2, w^3), w = t - 1/2
    assert np.isnan(tangent(cusp, 0.5)).all()
    assert curvature(cusp, 0.5) == math.inf
    for function in (signed_curvature, signed_curvature_rate, curvature_rate):
        assert np.isnan(function(cusp, 0.5))
    assert np.isfinite(curvature(cusp, [0.5 - 1e-5, 0.5 + 1e-5])).all()
    assert abs(tangent(cusp, 0.5 + 1e-6) - [1, 0]).max() <= 1e-5
    assert abs(tangent(cusp, 0.5 - 1e-6) - [-1, 0]).max() <= 1e-5


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_point(dimension: int) -> None:
    point = Curve(np.full((4, dimension), 3.3))
    assert np.isnan(tangent(point, T)).all()
    assert np.isnan(curvature(point, T)).all()
    assert np.isnan(curvature_rate(point, T)).all()
    assert np.isnan(np.stack(frenet_frame(point, T))).all()


def test_straight_line() -> None:
    line = Curve(np.outer([0, 1, 2.5, 4], [1.0, 2, -2]) + np.array([5, 0, 1]), (0.3, -0.4))
    assert abs(tangent(line, T) - np.array([1, 2, -2]) / 3).max() <= 1e-15 * 4
    assert abs(curvature(line, T)).max() <= 1e-13
    assert abs(curvature_rate(line, T)).max() <= 1e-12
    assert np.isnan(torsion(line, T)).all()
    frame = frenet_frame(line, T)
    assert np.isnan(frame.normal).all()
    assert np.isnan(frame.binormal).all()
    assert np.isfinite(frame.tangent).all()


def test_inflection() -> None:
    plane = polynomial_curve([-1, 2], [-1, 6, -12, 8])  # y = x^3 from x = -1 to 1
    space = plane.transformed([[1, 0], [0, 1], [0, 0]])
    right, left = Restricted(space, (0.5, 1)), Restricted(space, (0, 0.5))
    assert abs(curvature(space, 0.5)) <= 1e-14
    assert np.isnan(curvature_rate(space, 0.5))
    assert np.isnan(frenet_frame(space, 0.5).normal).all()
    assert np.isnan(torsion(space, 0.5))
    assert float(signed_curvature_rate(plane, 0.5)) == pytest.approx(6, rel=1e-13)
    assert float(curvature_rate(right, 0.0)) == pytest.approx(6, rel=1e-13)
    assert float(curvature_rate(left, 1.0)) == pytest.approx(-6, rel=1e-13)
    assert abs(frenet_frame(right, 0.0).normal - [0, 1, 0]).max() <= 1e-14
    assert abs(frenet_frame(left, 1.0).normal - [0, -1, 0]).max() <= 1e-14


def test_flat_point_without_inflection() -> None:
    quartic = polynomial_curve([-1, 2], [1, -8, 24, -32, 16], [0])  # y = x^4
    assert abs(frenet_frame(quartic, 0.5).normal - [0, 1, 0]).max() <= 1e-13
    assert abs(curvature_rate(quartic, 0.5)) <= 1e-12


# Surfaces whose quantities are known


def grid() -> tuple[Array, Array]:
    t = np.linspace(0.01, 0.99, 9)
    return t[:, None], t[None, :]


def test_sphere() -> None:
    u, v = grid()
    u = 0.9 * u
    assert abs(normal(SPHERE, u, v) + SPHERE.evaluate(u, v) / 2).max() <= 1e-14  # inwards
    assert abs(gaussian_curvature(SPHERE, u, v) - 0.25).max() <= 1e-14
    assert abs(mean_curvature(SPHERE, u, v) - 0.5).max() <= 1e-14
    assert abs(principal_curvatures(SPHERE, u, v) - 0.5).max() <= 1e-14
    outwards = SPHERE.transposed()
    assert abs(mean_curvature(outwards, v, u) + 0.5).max() <= 1e-14
    assert abs(gaussian_curvature(outwards, v, u) - 0.25).max() <= 1e-14


@pytest.mark.parametrize("distance", [1e-2, 1e-3, 1e-4])
def test_digits_lost_near_a_pole(distance: float) -> None:
    ratio = 1 / math.sin(math.pi / 2 * distance)
    t = np.linspace(0, 1, 50)
    assert abs(normal(SPHERE, 1 - distance, t) + SPHERE.evaluate(1 - distance, t) / 2).max() <= 1e-15 * ratio
    assert abs(mean_curvature(SPHERE, 1 - distance, t) / 0.5 - 1).max() <= 1e-15 * ratio**2
    assert abs(gaussian_curvature(SPHERE, 1 - distance, t) / 0.25 - 1).max() <= 1e-15 * ratio**2


def test_torus() -> None:
    u, v = grid()
    angle = math.pi / 2 * u + 0 * v
    distance = 3 + np.cos(angle)
    assert abs(gaussian_curvature(TORUS, u, v) - np.cos(angle) / distance).max() <= 1e-14
    assert abs(mean_curvature(TORUS, u, v) - (1 + np.cos(angle) / distance) / 2).max() <= 1e-14
    k1, k2 = np.moveaxis(principal_curvatures(TORUS, u, v), -1, 0)
    assert abs(k1 - 1).max() <= 1e-14
    assert abs(k2 - np.cos(angle) / distance).max() <= 1e-14


def test_enneper() -> None:
    u, v = grid()
    metric = (1 + u**2 + v**2) ** 2
    assert abs(mean_curvature(ENNEPER, u, v)).max() <= 1e-14
    assert abs(gaussian_curvature(ENNEPER, u, v) + 4 / metric**2).max() <= 1e-14
    first = first_fundamental_form(ENNEPER, u, v)
    assert abs(first - metric[..., None, None] * np.eye(2)).max() <= 1e-14


def test_graph() -> None:
    u, v = grid()
    x, y, _ = np.moveaxis(SADDLE.evaluate(u, v), -1, 0)
    slope = 1 + x**2 + y**2
    assert abs(gaussian_curvature(SADDLE, u, v) + 1 / slope**2).max() <= 1e-14
    assert abs(mean_curvature(SADDLE, u, v) + x * y / slope**1.5).max() <= 1e-14
    wanted = np.stack([-y, -x, np.ones_like(x)], axis=-1) / np.sqrt(slope)[..., None]
    assert abs(normal(SADDLE, u, v) - wanted).max() <= 1e-14
    second = second_fundamental_form(SADDLE, u, v)
    assert abs(second - 4 / np.sqrt(slope)[..., None, None] * [[0, 1], [1, 0]]).max() <= 1e-14


def test_cylinder() -> None:
    points = [[(x, y, z) for z in (0, 3)] for x, y in 2 * QUARTER]
    cylinder = Surface(points, family_v=BERNSTEIN)
    u, v = grid()
    assert abs(gaussian_curvature(cylinder, u, v)).max() <= 1e-15
    k = principal_curvatures(cylinder, u, v)
    assert (k[..., 0] > k[..., 1]).all()
    assert abs(np.sort(abs(k), axis=-1) - [0, 0.5]).max() <= 1e-15
    outwards = (normal(cylinder, u, v) * cylinder.evaluate(u, v))[..., :2].sum(axis=-1) / 2
    assert abs(abs(outwards) - 1).max() <= 1e-14
    assert abs(mean_curvature(cylinder, u, v) + 0.25 * outwards).max() <= 1e-14


# Laws that hold for every surface


def random_surface(seed: int) -> Surface:
    return Surface(np.random.default_rng(seed).standard_normal((4, 5, 3)), (0.2, -0.3), (0.8, 0.1))


@given(seeds, parameters, parameters)
def test_principal_curvatures_give_the_others(seed: int, u: float, v: float) -> None:
    surface = random_surface(seed)
    k1, k2 = principal_curvatures(surface, u, v)
    assert k1 >= k2
    largest = max(abs(k1), abs(k2))
    assert abs((k1 + k2) / 2 - mean_curvature(surface, u, v)) <= 1e-14 * largest
    assert abs(k1 * k2 - gaussian_curvature(surface, u, v)) <= 1e-13 * largest**2


@given(seeds, parameters, parameters)
def test_curvatures_from_the_fundamental_forms(seed: int, u: float, v: float) -> None:
    surface = random_surface(seed)
    first, second = first_fundamental_form(surface, u, v), second_fundamental_form(surface, u, v)
    weingarten = np.linalg.solve(first, second)
    k1, k2 = principal_curvatures(surface, u, v)
    loss = np.linalg.cond(first)
    bound = 1e-14 * loss * abs(weingarten).max()
    assert abs(np.trace(weingarten) - (k1 + k2)) <= bound
    assert abs(np.linalg.det(weingarten) - k1 * k2) <= bound * (abs(weingarten).max() + abs(k1) + abs(k2))


@given(seeds, st.floats(0.1, 0.9), st.floats(0.1, 0.9))
def test_the_normal_turns_as_the_second_form_says(seed: int, u: float, v: float) -> None:
    surface, step = random_surface(seed), 1e-5
    turn_u = (normal(surface, u + step, v) - normal(surface, u - step, v)) / (2 * step)
    turn_v = (normal(surface, u, v + step) - normal(surface, u, v - step)) / (2 * step)
    s_u, s_v = surface.derivative(u, v), surface.derivative(u, v, (0, 1))
    found = -np.array([[turn_u @ s_u, turn_u @ s_v], [turn_v @ s_u, turn_v @ s_v]])
    wanted = second_fundamental_form(surface, u, v)
    singular = np.linalg.norm(np.cross(s_u, s_v)) / (np.linalg.norm(s_u) * np.linalg.norm(s_v))
    assert abs(found - wanted).max() <= 1e-5 / min(singular, 1) ** 3 * abs(wanted).max()


@given(seeds, parameters, parameters, st.sampled_from([1e-5, 1.0, 1e4]))
def test_motion_and_scale_of_surfaces(seed: int, u: float, v: float, size: float) -> None:
    surface = random_surface(seed)
    turn = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))[0]
    hand = np.linalg.det(turn)
    moved = surface.transformed(size * turn)
    assert abs(normal(moved, u, v) - hand * turn @ normal(surface, u, v)).max() <= 1e-11
    k = principal_curvatures(surface, u, v)
    expected = k if hand > 0 else -k[::-1]
    assert abs(principal_curvatures(moved, u, v) * size - expected).max() <= 1e-10 * abs(k).max()


def test_plane_surfaces() -> None:
    flat = Surface(np.random.default_rng(0).standard_normal((3, 3, 2)) * 0.1 + np.mgrid[:3, :3].transpose(1, 2, 0))
    u, v = grid()
    assert (normal(flat, u, v) == [0, 0, 1]).all()
    assert (normal(flat.transposed(), u, v) == [0, 0, -1]).all()
    assert (gaussian_curvature(flat, u, v) == 0).all()
    assert first_fundamental_form(flat, 0.5, 0.5).shape == (2, 2)


# Singular points of surfaces


def orientations(surface: Surface) -> list[tuple[Surface, Callable[[float, float], tuple[float, float]], float]]:
    """The surface with its parameters exchanged and reversed, the map of its parameters, and the normal's sign."""
    return [
        (surface, lambda u, v: (u, v), 1),
        (surface.reversed("u"), lambda u, v: (1 - u, v), -1),
        (surface.reversed("v"), lambda u, v: (u, 1 - v), -1),
        (surface.transposed(), lambda u, v: (v, u), -1),
        (surface.reversed("u").transposed(), lambda u, v: (v, 1 - u), 1),
        (surface.reversed("v").transposed(), lambda u, v: (1 - v, u), 1),
    ]


@pytest.mark.parametrize("v", [0.0, 0.3, 1.0])
def test_normal_at_a_pole(v: float) -> None:
    for surface, place, sign in orientations(SPHERE):
        assert abs(normal(surface, *place(1.0, v)) - [0, 0, -sign]).max() <= 1e-14
        assert np.isnan(gaussian_curvature(surface, *place(1.0, v)))
        assert np.isnan(principal_curvatures(surface, *place(1.0, v))).all()
        assert np.isfinite(first_fundamental_form(surface, *place(1.0, v))).all()


def test_normal_at_the_apex_of_a_cone_is_that_of_each_ruling() -> None:
    cone = Surface([[(x, y, 0), (0, 0, 1)] for x, y in QUARTER], family_v=BERNSTEIN)
    u = np.linspace(0, 1, 7)
    for surface, place, sign in orientations(cone):
        at_apex, below = (normal(surface, *place(u, v)) for v in (1.0, 0.5))
        assert abs(at_apex - below).max() <= 1e-14
        assert abs(at_apex[:, 2] * sign - math.sqrt(0.5)).max() <= 1e-14


@pytest.mark.parametrize("gamma", [(0.0, 0.0), (-1.0, 0.5), (-1.0, -1.0)])
def test_normal_of_plane_patches_with_singular_corners(gamma: tuple[float, float]) -> None:
    net = np.mgrid[:3, :3].transpose(1, 2, 0).astype(float)  # squares
    u, v = np.meshgrid([0.0, 0.4, 1.0], [0.0, 0.7, 1.0])
    assert (normal(Surface(net, gamma, gamma), u, v) == [0, 0, 1]).all()
    net[1, 0] = net[0, 0]  # no tangent in u at a corner
    for surface, place, sign in orientations(Surface(net)):
        assert abs(normal(surface, *place(0.0, 0.0)) - [0, 0, sign]).max() <= 1e-14


def test_one_tangent_at_a_corner() -> None:
    net = np.array([[(0, 0), (1, 0), (3, 1)], [(2, 0), (3, -1), (4, 0)], [(3, -2), (4, -2), (5, -1)]], dtype=float)
    surface = Surface(net)
    (a, b), (c, d) = surface.derivative(0, 0, (1, 0)), surface.derivative(0, 0, (0, 1))
    assert abs(a * d - b * c) <= 1e-15
    assert abs(normal(surface, 0.0, 0.0) - normal(surface, 1e-3, 1e-3)).max() <= 1e-12


def test_no_normal() -> None:
    u, v = np.meshgrid([0.0, 0.5, 1.0], [0.0, 0.3])
    point = Surface(np.ones((3, 3, 3)))
    line = Surface(np.arange(9.0).reshape(3, 3)[..., None] * np.array([1.0, 2, 3]))
    fold = polynomial_surface([[0.25, 0], [-1, 0], [1, 0]], [[0, 1], [0, 0], [0, 0]], np.zeros((3, 2)))
    assert np.isnan(normal(point, u, v)).all()
    assert np.isnan(normal(line, u, v)).all()
    assert np.isnan(normal(fold, 0.5, 0.3)).all()
    assert abs(normal(fold, 0.4, 0.3) + normal(fold, 0.6, 0.3)).max() == 0


# Arrays and refusals


CURVE = Curve(np.random.default_rng(2).standard_normal((5, 3)))
PLANE_CURVE = Curve(np.random.default_rng(2).standard_normal((5, 2)))
CURVE_FUNCTIONS = [tangent, curvature, curvature_rate, torsion]
PLANE_FUNCTIONS = [signed_curvature, signed_curvature_rate]
SURFACE_FUNCTIONS: dict[Callable[..., Array], tuple[int, ...]] = {
    normal: (3,),
    first_fundamental_form: (2, 2),
    second_fundamental_form: (2, 2),
    gaussian_curvature: (),
    mean_curvature: (),
    principal_curvatures: (2,),
}


@pytest.mark.parametrize("shape", [(), (0,), (3, 4)])
def test_shapes(shape: tuple[int, ...]) -> None:
    t = np.random.default_rng(0).uniform(size=shape)
    assert tangent(PLANE_CURVE, t).shape == (*shape, 2)
    assert all(field.shape == (*shape, 3) for field in frenet_frame(PLANE_CURVE, t))
    for function in CURVE_FUNCTIONS:
        values = function(CURVE, t)
        assert values.shape == (*shape, 3)[: values.ndim]
        for k in np.ndindex(shape):
            assert abs(values[k] - function(CURVE, t[k])).max() <= 1e-11 * abs(values[k]).max()
    for function in PLANE_FUNCTIONS:
        assert function(PLANE_CURVE, t).shape == shape
    for function, trailing in SURFACE_FUNCTIONS.items():
        assert function(TORUS, t, t).shape == (*shape, *trailing)
        assert function(TORUS, t, 0.5).shape == (*shape, *trailing)


@pytest.mark.parametrize("function", SURFACE_FUNCTIONS)
def test_grids_equal_scattered_parameters(function: Callable[..., Array]) -> None:
    t = np.linspace(0, 1, 5)  # with the pole
    on_grid = function(SPHERE, t[:, None], t[None, :])
    u, v = np.meshgrid(t, t, indexing="ij")
    np.testing.assert_allclose(on_grid, function(SPHERE, u, v), atol=1e-14)


def test_no_warnings_at_singular_points() -> None:
    shapes = [Curve(np.zeros((3, 3))), Curve(np.outer([0, 0, 1, 1], [1.0, 2, 3])), in_power(2, at=0.5)]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for curve in shapes:
            for function in (*CURVE_FUNCTIONS, frenet_frame):
                function(curve, T)
        for function in SURFACE_FUNCTIONS:
            function(SPHERE, 1.0, T)
            function(Surface(np.zeros((3, 3, 3))), T, 0.5)


def test_tiny_and_huge_shapes() -> None:
    for size in (1e-50, 1e-30, 1e30, 1e50):
        scaled = CURVE.transformed(size * np.eye(3))
        assert float(curvature(scaled, 0.3) * size) == pytest.approx(float(curvature(CURVE, 0.3)), rel=1e-12)
        surface = TORUS.transformed(size * np.eye(3))
        assert float(mean_curvature(surface, 0.3, 0.4) * size) == pytest.approx(
            float(mean_curvature(TORUS, 0.3, 0.4)), rel=1e-12
        )


def test_refuses_parameters_and_dimensions() -> None:
    for function in (*CURVE_FUNCTIONS, frenet_frame):
        with pytest.raises(InputError, match="t must lie in"):
            function(CURVE, [0.5, 1.5])
    for function in SURFACE_FUNCTIONS:
        with pytest.raises(InputError, match="v must lie in"):
            function(TORUS, 0.5, math.nan)
    for function in PLANE_FUNCTIONS:
        with pytest.raises(InputError, match="d = 3"):
            function(CURVE, 0.5)
