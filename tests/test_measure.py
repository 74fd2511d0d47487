from __future__ import annotations

import copy
import itertools
import json
import math
import pickle
from pathlib import Path

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from gtcad.basis import BERNSTEIN
from gtcad.composite import Composite
from gtcad.conics import circle
from gtcad.converters.bspline import BSplineCurve, BSplineSurface
from gtcad.curve import Curve
from gtcad.errors import InputError
from gtcad.measure import Estimate, area, curvature_energy, dirichlet_energy, length, volume
from gtcad.offset import offset
from gtcad.restricted import Restricted
from gtcad.surface import Surface
from tests.test_differential import ENNEPER, SPHERE, Helix, polynomial_curve, polynomial_surface, rotated

seeds = st.integers(0, 10**6)
design_variables = st.floats(-1, 1)
REFERENCE = Curve([(0, 0, 0), (1, 2, 0.5), (2, 2.5, 2), (3, 1, 2.5), (4, 0, 1)], (0.2, -0.3))
SKEW = Surface([[[0, 0, 0], [0, 1, 1]], [[1, 0, 1], [1, 1, 0]]], family_u=BERNSTEIN, family_v=BERNSTEIN)


# Estimates


def test_an_estimate_is_a_float() -> None:
    estimate = Estimate(2.0, 1e-9)
    assert isinstance(estimate, float)
    assert (estimate.value, estimate.error) == (2.0, 1e-9)
    assert type(estimate.value) is float
    assert estimate == 2.0 == float(estimate)
    assert estimate + 1 == 3.0
    assert 1.5 < estimate < 2.5
    assert math.isclose(estimate, 2.0 + 1e-12)
    assert estimate == pytest.approx(2.0)
    assert pytest.approx(estimate) == 2.0
    assert np.isclose(estimate, 2.0)
    assert sum([estimate, estimate]) == 4.0
    assert hash(estimate) == hash(2.0)
    assert json.dumps([estimate]) == "[2.0]"


def test_an_estimate_shows_its_error_and_prints_its_value() -> None:
    estimate = Estimate(2.0, 1e-9)
    assert repr(estimate) == "Estimate(value=2.0, error=1e-09)"
    assert (str(estimate), f"{estimate}", f"{estimate:.3f}", f"{estimate:10.1e}") == (
        "2.0",
        "2.0",
        "2.000",
        "   2.0e+00",
    )


def test_an_estimate_cannot_be_changed_and_can_be_copied() -> None:
    estimate = Estimate(2.0, 1e-9)
    for name in ("error", "value", "other", "_error"):
        with pytest.raises(AttributeError):
            setattr(estimate, name, 1.0)
    for other in (pickle.loads(pickle.dumps(estimate)), copy.copy(estimate), copy.deepcopy(estimate)):
        assert (type(other), other.value, other.error) == (Estimate, 2.0, 1e-9)


# Length


def test_reference_curve() -> None:
    assert float(length(REFERENCE)) == pytest.approx(6.091650780833, abs=5e-13)
    assert float(curvature_energy(REFERENCE)) == pytest.approx(1.468379117009, abs=5e-13)
    assert length(REFERENCE).error <= 1e-13


@pytest.mark.parametrize("radius", [1e-3, 1.0, 1e5])
def test_circle(radius: float) -> None:
    quarter = Curve(radius * np.array([[1, 0], [1, 1], [0, 1]]))
    assert float(length(quarter)) == pytest.approx(math.pi / 2 * radius, rel=1e-15 * 3)
    assert float(curvature_energy(quarter)) == pytest.approx(math.pi / 2 / radius, rel=1e-14)


def test_ellipse() -> None:
    found = length(Curve([[3, 0], [3, 2], [0, 2]]))
    with mp.workdps(30):
        exact = 3 * mp.ellipe(1 - mp.mpf(4) / 9)
        assert abs(found.value - exact) <= min(found.error, 1e-14)


def test_helix() -> None:
    assert float(length(Helix(1.5, -2.0))) == pytest.approx(4 * 2.5, rel=1e-15 * 3)
    assert float(curvature_energy(Helix(1.5, -2.0))) == pytest.approx(10 * (1.5 / 6.25) ** 2, rel=1e-14)


@given(seeds, design_variables, design_variables, st.integers(2, 12))
def test_length_against_scipy(seed: int, g1: float, g2: float, degree: int) -> None:
    curve = Curve(np.random.default_rng(seed).standard_normal((degree + 1, 3)), (g1, g2))
    expected, error = quad(lambda t: float(np.linalg.norm(curve.derivative(t))), 0, 1, epsrel=1e-12, limit=400)
    found = length(curve)
    assert abs(found - expected) <= found.error + error
    assert found.error <= 1.1e-12 * found
    assert found >= np.linalg.norm(curve.control_points[-1] - curve.control_points[0]) * (1 - 1e-14)


@given(seeds, design_variables, design_variables)
def test_length_does_not_depend_on_motion_and_direction(seed: int, g1: float, g2: float) -> None:
    random = np.random.default_rng(seed)
    curve = Curve(random.standard_normal((6, 3)), (g1, g2))
    turn = np.linalg.qr(random.standard_normal((3, 3)))[0]
    wanted = pytest.approx(float(length(curve)), rel=2e-12)
    assert float(length(curve.transformed(turn, [3, 4, 5]))) == wanted
    assert float(length(curve.reversed())) == wanted
    assert float(length(Restricted(curve, (1, 0)))) == wanted
    assert float(length(curve.transformed(7 * turn)) / 7) == wanted


@pytest.mark.parametrize("place", [0.5, 0.3, 1 / math.pi])
def test_length_through_a_cusp(place: float) -> None:
    # (w^2, w^3) with w = t - place: length of one arm from 0 to w is ((4 + 9 w^2)^(3/2) - 8) / 27
    curve = polynomial_curve([place**2, -2 * place, 1], [-(place**3), 3 * place**2, -3 * place, 1])
    exact = sum(((4 + 9 * w**2) ** 1.5 - 8) / 27 for w in (place, 1 - place))
    found = length(curve)
    assert abs(found - exact) <= found.error
    assert found.error <= 1.1e-12 * exact


def test_length_with_vanishing_end_derivatives() -> None:
    parabola = Curve([[0, 0], [1, 2], [3, -1]], family=BERNSTEIN)
    for gamma in ((-1, 1), (1, -1)):
        assert float(length(Curve(parabola.control_points, gamma))) == pytest.approx(float(length(parabola)), rel=1e-12)
    assert float(length(Curve([[0, 0], [5, 5], [3, 4]], (-1, -1)))) == pytest.approx(5, rel=1e-13)


def test_length_of_lines_that_run_to_and_fro() -> None:
    assert float(length(polynomial_curve([0, 1, -1], [0]))) == pytest.approx(0.5, rel=1e-12)
    assert float(length(Curve(np.outer([0, 1, 2, 3], [2, 1, 2])))) == pytest.approx(9, rel=1e-13)


def test_a_point_has_no_length() -> None:
    found = length(Curve(np.full((3, 3), 2.0)))
    assert abs(found) <= 1e-15
    assert found.error <= 1e-15


def test_reference_pieces_have_errors_within_the_target() -> None:
    pieces = json.loads((Path(__file__).parent / "data" / "pieces.json").read_text())
    for piece in pieces["curves"]:
        curve = Curve(piece["control_points"], piece["gamma"])
        close = length(curve, rtol=1e-14)
        assert abs(length(curve) - close) <= length(curve).error <= 1.1e-12 * close
        assert abs(length(curve, rtol=1e-6) - close) <= 1e-6 * close
    for piece in pieces["surfaces"]:
        surface = Surface(piece["control_points"], piece["gamma_u"], piece["gamma_v"])
        close = area(surface, rtol=1e-14)
        assert abs(area(surface) - close) <= area(surface).error <= 1.1e-12 * close


# Curvature energy


def test_curvature_energy_of_a_parabola() -> None:
    # y = x^2 on [0, 1]: kappa^2 ds = 4 (1 + 4 x^2)^(-5/2) dx
    found = curvature_energy(polynomial_curve([0, 1], [0, 0, 1]))
    with mp.workdps(30):
        exact = mp.quad(lambda x: 4 * (1 + 4 * x * x) ** mp.mpf("-2.5"), [0, 1])
        assert abs(found.value - exact) <= 1e-14
    for gamma in ((-1, 1), (1, -1)):  # the same parabola with C' = 0 at one end
        assert float(curvature_energy(Curve([[0, 0], [0.5, 0], [1, 1]], gamma))) == pytest.approx(
            float(exact), rel=1e-10
        )


@pytest.mark.parametrize("narrow", [1e-2, 1e-3, 1e-4])
def test_curvature_energy_of_a_narrow_bend(narrow: float) -> None:
    # y = sqrt(x^2 + narrow^2) would be the hyperbola; (w^2, narrow w), w = t - 1/2, is a parabola with that tip
    curve = polynomial_curve([0.25, -1, 1], [-narrow / 2, narrow])
    found = curvature_energy(curve)
    with mp.workdps(30):
        exact = mp.quad(
            lambda w: (2 * narrow) ** 2 / (4 * w * w + narrow**2) ** mp.mpf("2.5"),
            [-0.5, -10 * narrow, -narrow, 0, narrow, 10 * narrow, 0.5],
        )
    assert abs(found - float(exact)) <= 1e-11 * float(exact)
    assert found.error <= 1.1e-12 * found


def test_curvature_energy_diverges_at_cusps() -> None:
    inside = polynomial_curve([0.25, -1, 1], [-0.125, 0.75, -1.5, 1])
    for curve in (inside, inside.reversed(), Curve([[0, 0], [0, 0], [1, 1], [2, 0]]), Restricted(inside, (0, 0.4))):
        found = curvature_energy(curve)
        assert math.isinf(found.error) == (not isinstance(curve, type(Restricted(inside, (0, 0.4)))))


def test_curvature_energy_of_lines_and_points() -> None:
    assert abs(curvature_energy(Curve(np.outer([0, 1, 2, 3], [2, 1, 2])))) <= 1e-25
    assert math.isnan(curvature_energy(Curve(np.ones((3, 3)))))


# Chains and splines: the whole domain counts


def test_a_chain_is_measured_from_its_start_to_its_end() -> None:
    ring = circle([1, 2, 3], 5, [1, 1, 1])
    assert float(length(ring)) == pytest.approx(2 * math.pi * 5, rel=1e-14)
    assert float(curvature_energy(ring)) == pytest.approx(2 * math.pi / 5, rel=1e-13)
    outer = offset(circle([0, 0], 5), -2)  # a negative one is to the right: outside
    assert float(length(outer)) == pytest.approx(2 * math.pi * 7, rel=1e-13)
    bent = Composite((Curve([[0, 0], [1, 0]], family=BERNSTEIN), Curve([[1, 0], [1, 1], [2, 1]])), ("G0",))
    assert float(length(bent)) == pytest.approx(1 + math.pi / 2, rel=1e-14)
    assert length(bent).error < 1e-12


def test_a_spline_is_measured_over_its_own_domain() -> None:
    # y = x^2 from 0 to 1, in two spans over [2, 6]
    poles = np.array([[0, 0], [0.25, 0], [0.75, 0.5], [1, 1]])
    parabola = BSplineCurve(poles, [2, 4, 6], [3, 1, 3], 2)
    assert float(length(parabola)) == pytest.approx(math.sqrt(5) / 2 + math.asinh(2) / 4, rel=1e-13)
    expected, _ = quad(lambda x: 4 / (1 + 4 * x * x) ** 2.5, 0, 1)
    assert float(curvature_energy(parabola)) == pytest.approx(expected, rel=1e-12)


def test_a_spline_surface_is_measured_over_its_own_domain() -> None:
    net = [[[0, 0, 6], [0, 3, 6]], [[2, 0, 6], [2, 3, 6]]]
    sheet = BSplineSurface(net, [2, 6], [2, 2], 1, [-1, 4], [2, 2], 1)
    assert float(area(sheet)) == pytest.approx(6, rel=1e-13)
    assert float(volume(sheet)) == pytest.approx(2 * 3 * 6 / 3, rel=1e-13)
    assert float(dirichlet_energy(sheet)) == pytest.approx(((2 / 4) ** 2 + (3 / 5) ** 2) / 2 * 20, rel=1e-13)


# Area


def test_area_of_the_sphere_octant_and_the_torus_patch() -> None:
    for meridian, exact in (
        ([(1, 0), (1, 1), (0, 1)], math.pi / 2),
        ([(4, 0), (4, 1), (3, 1)], math.pi / 2 * (3 * math.pi / 2 + 1)),
    ):
        found = area(rotated(meridian))
        assert float(found) == pytest.approx(exact, rel=2e-15)
        assert found.error <= 1e-13
    assert math.pi / 2 * (3 * math.pi / 2 + 1) == pytest.approx(8.9729996276, abs=5e-11)


def test_area_and_energy_of_the_skew_quadrilateral() -> None:
    with mp.workdps(30):
        exact = mp.quad(lambda u, v: mp.sqrt(1 + (1 - 2 * v) ** 2 + (1 - 2 * u) ** 2), [0, 1], [0, 1])
    assert float(area(SKEW)) == pytest.approx(float(exact), rel=1e-14)
    assert float(area(SKEW)) == pytest.approx(1.2807892752734, abs=5e-14)
    assert float(dirichlet_energy(SKEW)) == pytest.approx(4 / 3, rel=2e-15)


def test_area_and_energy_of_enneper() -> None:
    assert float(area(ENNEPER)) == pytest.approx(133 / 45, rel=3e-15)
    assert float(dirichlet_energy(ENNEPER)) == pytest.approx(133 / 45, rel=3e-15)
    assert dirichlet_energy(ENNEPER).error <= 1e-12


@settings(max_examples=settings.default.max_examples // 2)
@given(seeds, *[design_variables] * 4)
def test_area_is_at_most_the_energy(seed: int, a: float, b: float, c: float, d: float) -> None:
    net = np.mgrid[:4, :5].transpose(1, 2, 0) + 0.5 * np.random.default_rng(seed).standard_normal((4, 5, 2))
    surface = Surface(np.concatenate([net, net[..., :1] * net[..., 1:]], axis=-1), (a, b), (c, d))
    assert area(surface, rtol=1e-8) <= dirichlet_energy(surface) * (1 + 1e-8)


def test_plane_areas() -> None:
    random = np.random.default_rng(4)
    boundary = Surface(
        np.mgrid[:4, :4].transpose(1, 2, 0) + 0.1 * random.standard_normal((4, 4, 2)), (0.3, -0.2), (0.9, -1)
    )
    # Green: the area inside the four boundary curves
    z, weights = np.polynomial.legendre.leggauss(40)
    t = (z + 1) / 2
    inside = 0.0
    for side, sign in (("v0", 1), ("u1", 1), ("v1", -1), ("u0", -1)):
        (x, y), (dx, dy) = boundary.boundary(side).evaluate(t).T, boundary.boundary(side).derivative(t).T
        inside += sign * (weights / 4) @ (x * dy - y * dx)
    assert float(area(boundary)) == pytest.approx(inside, rel=1e-13)
    lifted = boundary.transformed([[1, 0], [0, 1], [2, 2]])
    assert float(area(lifted)) == pytest.approx(3 * inside, rel=1e-13)


def test_a_fold_counts_twice() -> None:
    fold = polynomial_surface([[0.25, 0], [-1, 0], [1, 0]], [[0, 1], [0, 0], [0, 0]], np.zeros((3, 2)))
    found = area(fold)  # x = (u - 1/2)^2, y = v
    assert abs(found - 0.5) <= found.error
    assert found.error <= 1e-12


def test_area_of_singular_patches() -> None:
    assert float(area(SPHERE)) == pytest.approx(2 * math.pi, rel=1e-14)
    triangle = np.mgrid[:3, :3].transpose(1, 2, 0).astype(float)
    triangle[0] = triangle[0, 0]
    rim = Surface(triangle)
    assert float(area(rim)) == pytest.approx(float(area(rim.transformed([[1, 0], [0, 1], [0, 0]]))), rel=1e-14)
    assert area(Surface(np.ones((3, 3, 3)))) == 0
    assert abs(area(Surface(np.arange(27.0).reshape(3, 3, 3)))) <= 1e-12


def test_hard_patches_say_how_far_they_got() -> None:
    wild = Surface(np.random.default_rng(0).standard_normal((31, 31, 3)))
    found = area(wild)
    assert 1e-12 * found < found.error < 1e-5 * found
    assert abs(area(wild, rtol=1e-3) - found) <= 1e-3 * found


# Energy


@given(seeds, *[design_variables] * 4)
def test_energy_by_quadrature(seed: int, a: float, b: float, c: float, d: float) -> None:
    surface = Surface(np.random.default_rng(seed).standard_normal((4, 6, 3)), (a, b), (c, d))
    exact, general = dirichlet_energy(surface), dirichlet_energy(Restricted(surface, ((0, 1), (0, 1))))
    assert abs(exact - general) <= exact.error + general.error
    assert exact.error <= 1e-13 * exact
    moved = dirichlet_energy(surface.transformed(np.eye(3), [1e3, 0, 1e3]))
    assert float(moved) == pytest.approx(float(exact), rel=1e-12)


def test_energy_of_a_restricted_surface() -> None:
    # u in [0, 1/2], v in [0, 1] of S = (u, v, u v), by hand
    surface = polynomial_surface([[0, 0], [1, 0]], [[0, 1], [0, 0]], [[0, 0], [0, 1]])
    part = Restricted(surface, ((0, 0.5), (0, 1)))
    s_u, s_v = 0.25 * (1 + 1 / 3), 1 + 0.25 / 3  # int |S_u|^2, |S_v|^2 in the part's own parameters
    assert float(dirichlet_energy(part)) == pytest.approx((s_u + s_v) / 2, rel=1e-14)


def test_energy_in_the_plane_and_of_a_point() -> None:
    square = Surface([[[0, 0], [0, 3]], [[2, 0], [2, 3]]], family_u=BERNSTEIN, family_v=BERNSTEIN)
    assert float(dirichlet_energy(square)) == pytest.approx((4 + 9) / 2, rel=2e-15)
    assert float(dirichlet_energy(Surface(np.full((3, 3, 3), 7.0)))) == 0


# Volume


def box(size: np.ndarray, corner: np.ndarray) -> list[Surface]:
    """Six faces of a box, normals outwards."""
    faces = []
    for axis, side in itertools.product(range(3), (0, 1)):
        others = [(axis + 1) % 3, (axis + 2) % 3][:: 1 if side else -1]
        net = np.zeros((2, 2, 3))
        for i, j in itertools.product((0, 1), (0, 1)):
            net[i, j, axis], net[i, j, others[0]], net[i, j, others[1]] = side, i, j
        faces.append(Surface(net * size + corner, family_u=BERNSTEIN, family_v=BERNSTEIN))
    return faces


@pytest.mark.parametrize("corner", [(0, 0, 0), (-5, 30, 2)])
def test_volume_of_a_box(corner: tuple[float, float, float]) -> None:
    found = volume(box(np.array([2, 3, 4]), np.array(corner)))
    assert float(found) == pytest.approx(24, rel=1e-12)
    assert abs(found - 24) <= found.error
    inside_out = volume(face.transposed() for face in box(np.array([2, 3, 4]), np.array(corner)))
    assert float(inside_out) == pytest.approx(-24, rel=1e-12)


def test_volume_far_away_keeps_its_digits_with_an_origin_nearby() -> None:
    corner = np.array([1e5, -1e5, 1e5])
    assert float(volume(box(np.ones(3), corner), origin=corner)) == pytest.approx(1, rel=1e-13)


def test_volume_of_a_sphere() -> None:
    # the flat sides of the octant go through the centre and add nothing
    for surface, sign in ((SPHERE, -1), (SPHERE.transposed(), 1)):
        assert float(volume(surface)) == pytest.approx(sign * 4 / 3 * math.pi, rel=2e-15)


def test_volume_of_a_ring() -> None:
    # a full turn of the circle of radius 1 around (3, 0): 2 pi^2 R r^2
    quarter = np.array([[1, 0], [1, 1], [0, 1]], dtype=float)
    turn = np.array([[0, -1], [1, 0]], dtype=float)
    arcs = [quarter @ np.linalg.matrix_power(turn, k).T for k in range(4)]
    patches = [
        Surface([[((3 + r) * x, (3 + r) * y, z) for x, y in around] for r, z in ring]).transposed()
        for ring, around in itertools.product(arcs, arcs)
    ]
    assert float(volume(patches)) == pytest.approx(2 * math.pi**2 * 3, rel=1e-14)
    assert float(sum(map(area, patches))) == pytest.approx(4 * math.pi**2 * 3, rel=1e-14)


# Refusals


@pytest.mark.parametrize("rtol", [0, 1e-15, 1.0, -1, math.nan])
@pytest.mark.parametrize("measure", [length, curvature_energy, area, volume, dirichlet_energy])
def test_refuses_accuracies(measure: object, rtol: float) -> None:
    with pytest.raises(InputError, match="rtol"):
        measure(REFERENCE if measure in (length, curvature_energy) else SKEW, rtol=rtol)


@pytest.mark.parametrize("measure", [length, curvature_energy, area, volume, dirichlet_energy])
def test_says_what_a_wrong_shape_is(measure: object) -> None:
    of_curves = measure in (length, curvature_energy)
    for strange in (SKEW if of_curves else REFERENCE, None, "arch"):
        with pytest.raises(InputError, match=f"must be a {'curve' if of_curves else 'surface'}, got "):
            measure(strange)


def test_volume_needs_space() -> None:
    with pytest.raises(InputError, match="d = 2"):
        volume(Surface(np.zeros((3, 3, 2))))
