"""Extremals of energies in both settings: reference values, what makes them extremal, and many at once."""

from __future__ import annotations

import pickle

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gtcad import BERNSTEIN, GT, Curve, Surface
from gtcad.basis import Basis
from gtcad.design_variables import design_rate, design_variables, with_design_variables
from gtcad.errors import InputError
from gtcad.factors import CurveOfTerms, Waves
from gtcad.measure import area, dirichlet_energy
from gtcad.patches import Coons, Plateau, Ruled
from gtcad.patches import minimal as m
from tests import reference
from tests.patches.kinds import FRAME, INTERIOR, NAMES, SAMPLES, TILTS, Sample
from tests.patches.surfaces import catenoid, through
from tests.pieces import random_surface

FUNCTIONALS = ("dirichlet", "quasi-harmonic", "bending")
SIDES = ("v0", "v1", "u0", "u1")
T = np.linspace(0, 1, 13)
X, W = np.polynomial.legendre.leggauss(40)
X, W = (X + 1) / 2, W / 2

each_functional = pytest.mark.parametrize("functional", FUNCTIONALS)


def straight_net(corners: list[list[float]], n: int, k: int) -> np.ndarray:
    """Points at equal distances along the edges of a quadrilateral; the interior is left out."""
    u, v = np.linspace(0, 1, n + 1)[:, None, None], np.linspace(0, 1, k + 1)[:, None]
    a, b, c, d = map(np.array, corners)
    net = (1 - u) * ((1 - v) * a + v * d) + u * ((1 - v) * b + v * c)
    net[1:-1, 1:-1] = np.nan
    return net


SKEW = [[0, 0, 0], [1, 0, 1], [1, 1, 0], [0, 1, 1]]


def bezier_net(points: np.ndarray, t: np.ndarray) -> np.ndarray:
    """The net of the Bezier surface through points at the parameters t in both directions."""
    inverse = np.linalg.inv(Basis(len(t) - 1, family=BERNSTEIN).evaluate(t))
    return np.einsum("ai,bj,ijd->abd", inverse, inverse, points)


def enneper_net() -> np.ndarray:
    """Of Enneper's surface over the unit square."""
    t = np.linspace(0, 1, 4)
    u, v = t[:, None], t[None, :]
    points = np.stack([u - u**3 / 3 + u * v**2, -v + v**3 / 3 - v * u**2, u**2 - v**2], axis=-1)
    return bezier_net(points, t)


def integrals(surface: object, functional: str) -> float:
    """The energy by its definition, on Gauss points."""
    uu, uv, vv, u, v = (surface.derivative(X[:, None], X[None, :], k) for k in ((2, 0), (1, 1), (0, 2), (1, 0), (0, 1)))
    density = {
        "dirichlet": ((u**2 + v**2) / 2),
        "quasi-harmonic": (uu + vv) ** 2,
        "bending": uu**2 + 2 * uv**2 + vv**2,
    }[functional]
    return float(W @ density.sum(axis=-1) @ W)


# --- reference values -------------------------------------------------------------------------------------------------


def test_the_biquadratic_mask() -> None:
    corner, middle = 0.5078141632413807, -0.2578141632413807
    for place in np.ndindex(3, 3):
        if place == (1, 1):
            continue
        net = np.zeros((3, 3, 2))
        net[place] = [1, 3]
        found = m.dirichlet_extremal(net).control_points[1, 1]
        weight = corner if place[0] != 1 and place[1] != 1 else middle
        assert abs(found - [weight, 3 * weight]).max() <= 1e-15


def test_the_mask_from_integrals_at_many_digits() -> None:
    """Row by row of the stiffness matrix of degree 2 at gamma = (0, 0): independent of Gram matrices in doubles."""
    with mp.workdps(30):

        def gram(i: int, k: int, order: int) -> mp.mpf:
            def product(t: mp.mpf) -> mp.mpf:
                rows = reference.taylor_rows("GT", 2, (0, 0), t, order)
                return rows[i][order] * rows[k][order]

            return mp.quad(product, [0, 1])

        mass, stiff = [[gram(1, k, order) for k in range(3)] for order in (0, 1)]
        own = 2 * mass[1] * stiff[1]
        corner, middle = (-(2 * mass[0] * stiff[0]) / own, -(mass[0] * stiff[1] + mass[1] * stiff[0]) / own)
        assert abs(corner - mp.mpf("0.5078141632413807")) < 1e-15
        assert abs(middle - mp.mpf("-0.2578141632413807")) < 1e-15


def test_the_skew_quadrilateral_at_degree_three() -> None:
    net = straight_net(SKEW, 3, 3)
    best = m.dirichlet_extremal(net, (1, 1), (1, 1))
    assert dirichlet_energy(best) == pytest.approx(1.2956353421, abs=1e-10)
    energies = m.dirichlet_energies(net, np.random.default_rng(0).uniform(-1, 1, (2000, 4)))
    assert energies.min() > dirichlet_energy(best)
    bilinear = m.dirichlet_extremal(net, family=BERNSTEIN)
    assert dirichlet_energy(bilinear) == pytest.approx(4 / 3, rel=1e-14)
    assert area(bilinear) == pytest.approx(1.2807892752734, abs=1e-13)


def test_the_net_of_enneper_is_its_own_classical_extremal() -> None:
    net = enneper_net()
    assert area(Surface(net, family_u=BERNSTEIN, family_v=BERNSTEIN)) == pytest.approx(133 / 45, rel=1e-13)
    hollow = net.copy()
    hollow[1:-1, 1:-1] = np.nan
    for functional in FUNCTIONALS[:2]:
        found = m.extremal(hollow, functional, family=BERNSTEIN)
        assert abs(found.control_points - net).max() <= 4e-15
        assert dirichlet_energy(found) == pytest.approx(133 / 45, rel=1e-14)
        assert m.harmonic_residual(found) <= 1e-13


def test_two_sides_determine_a_harmonic_bezier_surface() -> None:
    net = enneper_net()
    for given_sides, kept in ((("u0", "u1"), np.s_[1:-1]), (("v0", "v1"), np.s_[:, 1:-1])):
        hollow = net.copy()
        hollow[kept] = np.nan
        found = m.harmonic_residual_extremal(hollow, family=BERNSTEIN, given=given_sides)
        assert abs(found.control_points - net).max() <= 1e-13
        assert m.harmonic_residual(found) <= 1e-12


# --- what makes them extremal -----------------------------------------------------------------------------------------


@each_functional
@settings(max_examples=15)
@given(seed=st.integers(0, 10**6), n=st.integers(2, 6), k=st.integers(2, 6))
def test_no_interior_has_less_energy(functional: str, seed: int, n: int, k: int) -> None:
    rng = np.random.default_rng(seed)
    net, gammas = rng.normal(size=(n + 1, k + 1, 3)), rng.uniform(-0.9, 1, (2, 2))
    found = m.extremal(net, functional, gamma_u=gammas[0], gamma_v=gammas[1])
    least = integrals(found, functional)
    assert m.energy(found, functional) == pytest.approx(least, rel=1e-11)
    for size in (1e-3, 0.1, 1.0):
        points = np.array(found.control_points)
        points[1:-1, 1:-1] += size * rng.normal(size=points[1:-1, 1:-1].shape)
        other, back = (Surface(p, *gammas) for p in (points, 2 * found.control_points - points))
        energies = [integrals(one, functional) for one in (other, back)]
        assert min(energies) > least
        # stationary: what is of first order cancels
        assert energies[0] - least == pytest.approx(energies[1] - least, rel=1e-6, abs=1e-9 * least)


@settings(max_examples=15)
@given(seed=st.integers(0, 10**6), n=st.integers(1, 5), k=st.integers(1, 5))
def test_boundaries_stay_and_the_area_is_below_the_energy(seed: int, n: int, k: int) -> None:
    rng = np.random.default_rng(seed)
    net = rng.normal(size=(n + 1, k + 1, 3))
    family = GT if min(n, k) > 1 else BERNSTEIN
    found = m.dirichlet_extremal(net, family=family)
    inner = np.zeros(net.shape[:2], dtype=bool)
    inner[1:-1, 1:-1] = True
    assert np.array_equal(found.control_points[~inner], net[~inner])
    assert area(found, rtol=1e-6) < dirichlet_energy(found) * (1 + 1e-6)


@pytest.mark.parametrize("sample", SAMPLES, ids=NAMES)
def test_no_patch_of_any_kind_has_less_energy_than_area(sample: Sample) -> None:
    energy = m.energy(sample.patch)
    assert area(sample.patch, rtol=1e-6) <= energy * (1 + 1e-6)
    assert abs(energy - dirichlet_energy(sample.patch, rtol=1e-10)) <= 2e-10 * energy


def test_area_and_energy_are_equal_for_conformal_parameters() -> None:
    surface = catenoid()  # a quarter turn is pi / 2 wide, so these heights are not conformal; those are
    assert m.energy(Coons(*surface.contour)) > 1.0001 * surface.area
    square = through(lambda t: (np.cosh((t - 0.5) * np.pi / 2), 0.0, (t - 0.5) * np.pi / 2))
    arcs = [Curve([[r, 0, z], [r, r, z], [0, r, z]]) for r, _, z in square.evaluate([0.0, 1.0])]
    strip = m.fixed_contour((*arcs, square, square.transformed([[0, -1, 0], [1, 0, 0], [0, 0, 1]])), 9)
    assert m.energy(strip) == pytest.approx(float(area(strip)), rel=1e-9)
    exact = np.pi / 2 * (np.pi / 4 + np.sinh(np.pi / 2) / 2)
    assert area(strip) == pytest.approx(exact, rel=1e-9)


@settings(max_examples=10)
@given(seed=st.integers(0, 10**6))
def test_symmetries(seed: int) -> None:
    rng = np.random.default_rng(seed)
    net, (gu, gv) = rng.normal(size=(5, 4, 3)), rng.uniform(-1, 1, (2, 2))
    found = m.dirichlet_extremal(net, gu, gv)
    turned = m.dirichlet_extremal(net.swapaxes(0, 1), gv, gu)
    assert abs(turned.control_points.swapaxes(0, 1) - found.control_points).max() <= 1e-13
    back = m.dirichlet_extremal(net[::-1], gu[::-1], gv)
    assert abs(back.control_points[::-1] - found.control_points).max() <= 1e-13
    matrix, shift = rng.normal(size=(3, 3)), rng.normal(size=3)
    moved = m.dirichlet_extremal(net @ matrix.T + shift, gu, gv)
    assert abs(moved.control_points - (found.control_points @ matrix.T + shift)).max() <= 1e-12


def test_fewer_sides_leave_less_residual() -> None:
    net = np.random.default_rng(5).normal(size=(5, 5, 3))
    whole = m.harmonic_residual_extremal(net, (0.3, 0.1), (-0.2, 0.4))
    assert whole == m.quasi_harmonic_extremal(net, (0.3, 0.1), (-0.2, 0.4))
    part = m.harmonic_residual_extremal(net, (0.3, 0.1), (-0.2, 0.4), given=("u0", "u1"))
    assert np.array_equal(part.control_points[[0, -1]], net[[0, -1]])
    assert m.harmonic_residual(part) < 0.5 * m.harmonic_residual(whole)
    assert m.bending_extremal(net) == m.extremal(net, "bending")


def test_high_degrees_keep_their_digits() -> None:
    """A harmonic polynomial surface is every harmonic extremal of its own boundary."""
    t = (1 - np.cos(np.pi * np.arange(21) / 20)) / 2
    z = t[:, None] + 1j * t[None, :]
    points = np.stack([(z**5).real, (z**6).imag, (z**3).real + (z**9).imag], axis=-1)
    net = bezier_net(points, t)
    found = m.dirichlet_extremal(net, family=BERNSTEIN)
    assert abs(found.evaluate(t[:, None], t[None, :]) - points).max() <= 1e-10
    wide = m.dirichlet_extremal(np.random.default_rng(0).normal(size=(31, 31, 3)))
    assert np.isfinite(wide.control_points).all()


def test_a_place_far_from_the_origin_does_not_matter() -> None:
    net = random_surface(np.random.default_rng(1), (4, 4), 10).control_points
    near, far = m.dirichlet_extremal(net), m.dirichlet_extremal(net + 1e6)
    assert abs(far.control_points - near.control_points - 1e6).max() <= 1e-7
    gammas = np.random.default_rng(2).uniform(-1, 1, (5, 4))
    assert m.dirichlet_energies(net + 1e6, gammas) == pytest.approx(m.dirichlet_energies(net, gammas), rel=1e-8)


def test_degree_two_without_an_interior_function() -> None:
    net = np.random.default_rng(3).normal(size=(3, 4, 3))
    found = m.dirichlet_extremal(net, (-1, -1), (0.3, 0))
    energies = m.dirichlet_energies(net, [[-1, -1, 0.3, 0], [-1, -1 + 1e-9, 0.3, 0]])
    assert energies[0] == pytest.approx(dirichlet_energy(found), rel=1e-13)
    assert np.isfinite(energies).all()


# --- fixed contour ----------------------------------------------------------------------------------------------------


@each_functional
def test_a_fixed_contour_stays_whatever_is_inside(functional: str) -> None:
    for degree, family, gamma in ((4, GT, (0.5, -1)), ((2, 5), GT, (-0.3, 0)), (6, BERNSTEIN, (0, 0))):
        patch = m.fixed_contour(FRAME, degree, functional, gamma_u=gamma, family=family)
        for side, curve in zip(SIDES, FRAME, strict=True):
            assert abs(patch.boundary(side).evaluate(T) - curve.evaluate(T)).max() <= 1e-13
        n, k = (degree, degree) if isinstance(degree, int) else degree
        assert patch.degrees == (n, k)
        assert m.setting_of(patch) == "fixed contour"


@each_functional
def test_no_interior_has_less_energy_inside_a_contour(functional: str) -> None:
    rng = np.random.default_rng(4)
    patch = m.fixed_contour(FRAME, (3, 5), functional, gamma_u=(0.2, 0.9), gamma_v=(-0.4, 0.1))
    least = integrals(patch, functional)
    assert m.energy(patch, functional) == pytest.approx(least, rel=1e-11)
    for size in (0.1, 10.0):
        step = size * rng.normal(size=patch.interior.shape)
        energies = [integrals(patch.with_interior(patch.interior + s * step), functional) for s in (1, -1)]
        assert min(energies) > least
        assert energies[0] - least == pytest.approx(energies[1] - least, rel=1e-5, abs=1e-10 * least)


def test_both_settings_agree_where_they_are_one_problem() -> None:
    """The GT surface of a net lies in the space over its own contour when the interior functions are the same."""
    net = random_surface(np.random.default_rng(6), (4, 3), 10).control_points
    free = m.dirichlet_extremal(net, (0.2, -0.4), (0.6, 0.1))
    contour = [free.boundary(side) for side in SIDES]
    fixed = m.fixed_contour(contour, (4, 3), gamma_u=(0.2, -0.4), gamma_v=(0.6, 0.1))
    # Coons' linear blends are not in the basis: neither space holds the other, but both hold nearly the same
    assert m.energy(fixed) == pytest.approx(m.energy(free), rel=2e-2)
    finer = m.fixed_contour(contour, 9)
    assert m.energy(finer) < min(m.energy(fixed), m.energy(free))


def test_a_contour_of_any_curves() -> None:
    ring = CurveOfTerms(Waves(0.0, 2.0), [[0, 0, 0], [3, 0, 0], [0, 3, 0]])
    upper = ring.transformed(np.eye(3), [0, 0, 2])
    ends = ring.evaluate([0.0, 1.0]), upper.evaluate([0.0, 1.0])
    posts = [Curve([a, b], family=BERNSTEIN) for a, b in zip(*ends, strict=True)]
    patch = m.fixed_contour((ring, upper, *posts), 5)
    assert m.energy(patch) < 0.999 * m.energy(patch.contour)
    same = m.fixed_contour(Coons(ring, upper, *posts), 5)
    assert same == patch


def test_a_plateau_is_a_value() -> None:
    patch = Plateau(*FRAME, INTERIOR, *TILTS)
    copy = pickle.loads(pickle.dumps(patch))
    assert copy == patch
    assert hash(copy) == hash(patch)
    assert patch != patch.with_interior(2 * patch.interior)
    assert patch != patch.contour
    assert patch != "patch"
    assert repr(patch) == "Plateau(GT, degrees=(3, 4), gamma_u=(0.4, -0.7), gamma_v=(-1.0, 0.2))"
    with pytest.raises(ValueError, match="read-only"):
        copy.interior[0] = 0


def test_design_variables_of_a_plateau() -> None:
    patch = Plateau(*FRAME, INTERIOR, *TILTS)
    found = design_variables(patch)
    assert found["gamma_u"] == TILTS[0]
    changed = with_design_variables(patch, {"gamma_v": (0.25, 0.5), "c1": (1.0, 0.0)})
    assert isinstance(changed, Plateau)
    assert (changed.gamma_v, changed.c1.gamma) == ((0.25, 0.5), (1.0, 0.0))
    assert np.array_equal(changed.interior, patch.interior)
    step = 1e-3
    other = with_design_variables(patch, {"gamma_u": (TILTS[0][0] + step, TILTS[0][1])})
    rate = design_rate(patch, "gamma_u[0]").evaluate(T[:, None], T)
    moved = other.evaluate(T[:, None], T) - patch.evaluate(T[:, None], T)
    assert abs(moved / step - rate).max() <= 1e-9  # affine in each variable


# --- many at once -----------------------------------------------------------------------------------------------------


@each_functional
@settings(max_examples=10)
@given(seed=st.integers(0, 10**6), n=st.integers(2, 5), k=st.integers(2, 5))
def test_many_energies_are_those_of_the_extremals(functional: str, seed: int, n: int, k: int) -> None:
    rng = np.random.default_rng(seed)
    net, gammas = rng.normal(size=(n + 1, k + 1, 3)), rng.uniform(-1, 1, (7, 4))
    found = m.ExtremalEnergies(net, functional)(gammas)
    for energy, g in zip(found, gammas, strict=True):
        one = m.extremal(net, functional, gamma_u=g[:2], gamma_v=g[2:])
        assert energy == pytest.approx(float(m.energy(one, functional)), rel=1e-10)


def test_many_energies_over_a_contour() -> None:
    gammas = np.random.default_rng(8).uniform(-1, 1, (5, 4))
    found = m.ExtremalEnergies(FRAME, degree=(4, 3))
    assert found.setting == "fixed contour"
    for energy, g in zip(found(gammas), gammas, strict=True):
        one = m.fixed_contour(FRAME, (4, 3), gamma_u=g[:2], gamma_v=g[2:])
        assert energy == pytest.approx(float(dirichlet_energy(one)), rel=1e-11)


@pytest.mark.parametrize("plane", [False, True])
def test_many_areas_are_those_of_the_extremals(plane: bool) -> None:
    net = random_surface(np.random.default_rng(14), (3, 4), 10).control_points[..., : 2 if plane else 3]
    gammas = np.random.default_rng(15).uniform(-1, 1, (5, 4))
    for energies, solve in (
        (m.ExtremalEnergies(net), lambda **g: m.dirichlet_extremal(net, **g)),
        (m.ExtremalEnergies(FRAME, degree=4), lambda **g: m.fixed_contour(FRAME, 4, **g)),
    ):
        for found, g in zip(energies.areas(gammas), gammas, strict=True):
            assert found == pytest.approx(float(area(solve(gamma_u=g[:2], gamma_v=g[2:]), rtol=1e-9)), rel=1e-6)


@pytest.mark.parametrize("boundary", ["net", "contour"])
def test_rates_are_derivatives(boundary: str) -> None:
    net = np.random.default_rng(9).normal(size=(4, 5, 3))
    energies = m.ExtremalEnergies(net) if boundary == "net" else m.ExtremalEnergies(FRAME, degree=3)
    gammas = np.random.default_rng(10).uniform(-0.8, 0.8, (3, 4))
    values, rates = energies.with_rates(gammas)
    assert np.array_equal(values, energies(gammas))
    nodes = 0.1 * np.cos(np.pi * (np.arange(12) + 0.5) / 12)
    for k in range(4):  # energies are analytic in each: the derivative of a polynomial of degree 11 through them
        samples = np.array([energies(gammas + x * np.eye(4)[k]) for x in nodes])
        slopes = np.polynomial.Chebyshev.fit
        for column in range(len(gammas)):
            slope = slopes(nodes, samples[:, column], 11, domain=[-0.1, 0.1]).deriv()(0.0)
            assert rates[column, k] == pytest.approx(slope, abs=1e-10 * values[column])


def test_thousands_in_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    from gtcad.patches import _forms

    net, gammas = np.random.default_rng(11).normal(size=(4, 4, 3)), np.random.default_rng(12).uniform(-1, 1, (100, 4))
    whole = m.dirichlet_energies(net, gammas)
    monkeypatch.setattr(_forms, "_AT_ONCE", 500)
    assert m.dirichlet_energies(net, gammas) == pytest.approx(whole, rel=1e-13)
    assert m.dirichlet_energies(net, np.empty((0, 4))).shape == (0,)


# --- errors -----------------------------------------------------------------------------------------------------------


def test_the_error_of_an_energy_is_honest() -> None:
    """Against the same integral at many digits."""
    surface = random_surface(np.random.default_rng(13), (3, 4), 100)
    with mp.workdps(30):
        nodes = mp.calculus.quadrature.GaussLegendre(mp.mp).get_nodes(0, 1, 4, mp.mp.prec)
        columns = []
        for degree, gamma in zip(surface.degrees, (surface.gamma_u, surface.gamma_v), strict=True):
            rows = [reference.taylor_rows("GT", degree, gamma, t, 2) for t, _ in nodes]
            columns.append({k: mp.matrix([[(k or 1) * f[k] for f in row] for row in rows]) for k in (0, 2)})
        weights = mp.diag([w for _, w in nodes])
        total = mp.mpf(0)
        for axis in range(3):
            points = mp.matrix(surface.control_points[..., axis].tolist())
            laplacian = columns[0][2] * points * columns[1][0].T + columns[0][0] * points * columns[1][2].T
            squares = mp.matrix(laplacian.rows, laplacian.cols)
            for place in np.ndindex(laplacian.rows, laplacian.cols):
                squares[place] = laplacian[place] ** 2
            ones = mp.ones(len(nodes), 1)
            total += (ones.T * weights * squares * weights * ones)[0]
        found = m.energy(surface, "quasi-harmonic")
        assert abs(mp.mpf(found.value) - total) <= found.error
        assert found.error <= 1e-10 * found.value
        root = m.harmonic_residual(surface)
        assert abs(mp.mpf(root.value) - mp.sqrt(total)) <= root.error <= 1e-10 * root.value


@pytest.mark.parametrize("turns", [3, 60])
def test_energies_of_a_disc_of_many_turns(turns: int) -> None:
    """The squares of the derivatives of r (cos w u, sin w u), r = v, are w^2 r^2, 1 and w^4 r^2."""
    w = 2 * np.pi * turns
    axis, rim = (CurveOfTerms(Waves(0.0, w), [[0, 0, 0], [r, 0, 0], [0, r, 0]]) for r in (0, 1))
    disc = Ruled(axis, rim)
    assert m.energy(disc) == pytest.approx((1 + w**2 / 3) / 2, rel=1e-11)
    assert m.harmonic_residual(disc) == pytest.approx(w**2 / np.sqrt(3), rel=1e-11)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: m.extremal(np.zeros((3, 3, 3)), "area"), "functional must be one of dirichlet, quasi-harmonic, ben"),
        (lambda: m.dirichlet_extremal(np.full((3, 3, 3), np.nan)), r"net\[0, 0, 0\] must be finite, got nan"),
        (lambda: m.dirichlet_extremal([[1, 2], [3]]), "net must be numbers of shape"),
        (lambda: m.dirichlet_extremal(np.zeros((3, 3))), r"net must have shape .* got \(3, 3\)"),
        (lambda: m.dirichlet_extremal(np.zeros((1, 3, 3))), "net must have at least two rows and columns"),
        (lambda: m.dirichlet_extremal(np.zeros((3, 3, 3)), (2, 0)), r"gamma_u\[0\] must lie in \[-1, 1\], got 2"),
        (lambda: m.dirichlet_extremal(np.zeros((3, 3, 3)), (1, 0), family=BERNSTEIN), "takes no design variables"),
        (lambda: m.harmonic_residual_extremal(np.zeros((3, 3, 3)), given=("u0",)), "given must be u0 and u1, v0"),
        (lambda: m.fixed_contour(FRAME[:3], 3), "curves must be four"),
        (lambda: m.fixed_contour(FRAME, 1), "degree must be a whole number from 2, or two of them, got 1"),
        (lambda: m.fixed_contour(FRAME, (3, 3, 3)), "degree must be a whole number from 2"),
        (lambda: m.fixed_contour(FRAME, 61), r"degree must be a whole number in \[2, 60\]"),
        (lambda: m.fixed_contour(FRAME[::-1], 3), "corner u = .* apart"),
        (lambda: Plateau(*FRAME, np.zeros((2, 2, 2))), r"interior must have shape \(n - 1, m - 1, 3\), got \(2, 2, 2"),
        (lambda: Plateau(*FRAME, np.zeros((0, 2, 3))), "interior must have shape"),
        (lambda: m.dirichlet_energies(np.zeros((3, 3, 3)), [[0, 0, 0]]), r"shape \(count, 4\), got shape \(1, 3\)"),
        (lambda: m.dirichlet_energies(np.zeros((3, 3, 3)), [[0, 0, 0, -2]]), r"gammas\[0, 3\] must lie in .* got -2"),
        (lambda: m.dirichlet_energies(np.zeros((3, 3, 3)), [[0, 0, 0, np.nan]]), r"gammas\[0, 3\] must lie"),
        (lambda: m.ExtremalEnergies(np.zeros((3, 3, 3)), family=BERNSTEIN), "bernstein takes no design variables"),
        (lambda: m.ExtremalEnergies(np.zeros((3, 3, 3)), degree=3), "degree is that of the net, got 3"),
        (lambda: m.ExtremalEnergies(FRAME), "degree is needed for a fixed contour"),
        (lambda: m.energy(Surface(np.zeros((3, 3, 3))), "area"), "functional must be one of"),
    ],
)  # fmt: skip
def test_wrong_arguments(call: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        call()


def test_sides_in_v_are_the_same_problem_turned() -> None:
    net = np.random.default_rng(21).normal(size=(4, 5, 3))
    found = m.harmonic_residual_extremal(net, (0.5, -0.2), (0.1, 0.9), given=("v0", "v1"))
    assert (found.gamma_u, found.gamma_v) == ((0.5, -0.2), (0.1, 0.9))
    turned = m.harmonic_residual_extremal(np.swapaxes(net, 0, 1), (0.1, 0.9), (0.5, -0.2), given=("u0", "u1"))
    np.testing.assert_array_equal(found.control_points, np.swapaxes(turned.control_points, 0, 1))
    np.testing.assert_array_equal(found.control_points[:, [0, -1]], net[:, [0, -1]])
