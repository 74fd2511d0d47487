"""The area functional and its derivatives, least areas beside true minimal surfaces, proved bounds."""

from __future__ import annotations

import math

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gtcad import BERNSTEIN, GT, Curve, Surface
from gtcad.basis import Basis, Family
from gtcad.errors import InputError
from gtcad.factors import SurfaceOfTerms, Waves
from gtcad.measure import area, dirichlet_energy
from gtcad.patches import Plateau, Rotation, area_bounds, dirichlet_extremal, fixed_contour, least_area
from gtcad.patches._area import AreaFunctional
from gtcad.patches._trial import Trial
from tests import reference
from tests.patches.kinds import FRAME, INTERIOR, TILTS
from tests.patches.surfaces import SURFACES
from tests.pieces import random_surface

SIDES = ("v0", "v1", "u0", "u1")


def functional_of(patch: Plateau | Surface) -> AreaFunctional:
    bases = patch.bases if isinstance(patch, Plateau) else (patch.factors_u, patch.factors_v)
    return AreaFunctional(Trial.of(patch, *bases))


# --- derivatives ------------------------------------------------------------------------------------------------------


@settings(max_examples=10)
@given(seed=st.integers(0, 10**6), n=st.integers(2, 5), k=st.integers(2, 5))
def test_derivatives_are_those_of_the_complex_step(seed: int, n: int, k: int) -> None:
    rng = np.random.default_rng(seed)
    functional = functional_of(random_surface(rng, (n, k), 3.0))
    z = 0.3 * rng.normal(size=math.prod(functional.trial.shape))
    direction, step = rng.normal(size=z.shape), 1e-40
    gradient, product = functional.gradient(z), functional.product(z, direction)
    assert functional.value_and_gradient(z)[0] == functional.value(z)
    assert np.array_equal(functional.value_and_gradient(z)[1], gradient)
    slope = np.imag(functional.value(z + 1j * step * direction)) / step
    assert gradient @ direction == pytest.approx(slope, rel=1e-11, abs=1e-12 * np.linalg.norm(gradient))
    change = np.imag(functional.gradient(z + 1j * step * direction)) / step
    assert abs(product - change).max() <= 1e-11 * np.linalg.norm(change)


def test_the_derivative_at_many_digits() -> None:
    """By the definition, with mpmath's rule and its difference of 1e-15: nothing of the module is used."""
    net = np.array([[[i, j, (i - 1) * (j - 1) + (i == 2)] for j in range(3)] for i in range(3)], dtype=float)
    gammas = (0.5, -0.25), (1.0, 0.0)
    patch = Surface(net, *gammas)
    with mp.workdps(30):
        nodes = mp.calculus.quadrature.GaussLegendre(mp.mp).get_nodes(0, 1, 4, mp.mp.prec)
        rows = [[reference.taylor_rows("GT", 2, g, t, 1) for t, _ in nodes] for g in gammas]

        def size(middle: list[mp.mpf]) -> mp.mpf:
            points = [[[mp.mpf(x) for x in p] for p in row] for row in net.tolist()]
            points[1][1] = middle
            total = mp.mpf(0)
            for (_, w_u), f in zip(nodes, rows[0], strict=True):
                for (_, w_v), g in zip(nodes, rows[1], strict=True):
                    parts = []
                    for a, b in ((1, 0), (0, 1)):
                        weights = [[f[i][a] * g[j][b] for j in range(3)] for i in range(3)]
                        parts.append(
                            [
                                mp.fsum(weights[i][j] * points[i][j][x] for i in range(3) for j in range(3))
                                for x in (0, 1, 2)
                            ]
                        )
                    p, q = parts
                    crossed = [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]]
                    total += w_u * w_v * mp.sqrt(mp.fsum(x * x for x in crossed))
            return total

        middle, step = [mp.mpf(x) for x in net[1, 1].tolist()], mp.mpf(10) ** -12
        rates = []
        for axis in range(3):
            moved = [[x + s * step * (k == axis) for k, x in enumerate(middle)] for s in (1, -1)]
            rates.append(float((size(moved[0]) - size(moved[1])) / (2 * step)))
        value = float(size(middle))
    assert area(patch) == pytest.approx(value, rel=1e-11)
    functional = AreaFunctional(Trial.of(patch, patch.factors_u, patch.factors_v, least=48))
    trial = functional.trial
    assert functional.value(np.zeros(3)) == pytest.approx(value, rel=1e-11)
    # z moves the middle control point by interior(z * scale)
    per_point = float(trial.interior(np.array([[[1.0, 0, 0]]]) * trial.scale)[0, 0, 0])
    assert functional.gradient(np.zeros(3)) / per_point == pytest.approx(rates, rel=1e-10, abs=1e-11)


# --- least area -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("family", [GT, BERNSTEIN], ids=["GT", "Bernstein"])
@pytest.mark.parametrize("name", SURFACES)
def test_areas_of_true_minimal_surfaces(name: str, family: Family) -> None:
    surface = SURFACES[name]()
    start = fixed_contour(surface.contour, 8, family=family)
    found = least_area(start)
    assert abs(found.area / surface.area - 1) < 1e-9  # 1e-6 is wanted
    assert found.setting == "fixed contour"
    assert found.start == area(start)
    assert found.area <= found.start
    proved = area_bounds(found.patch)
    assert proved.lower <= surface.area * (1 + 1e-9)
    assert proved.lower <= found.area + found.area.error
    assert found.area - found.area.error <= proved.upper <= surface.area * (1 + 1e-8)


@pytest.mark.parametrize("name", ["skew quadrilateral", "Enneper, sector", "catenoid", "Scherk"])
def test_higher_degrees_are_nearer(name: str) -> None:
    surface = SURFACES[name]()
    excess = [least_area(fixed_contour(surface.contour, n)).area / surface.area - 1 for n in (2, 3, 4)]
    assert excess[0] > 30 * excess[1] > 0
    assert 1e-7 > excess[2] > 0


def test_a_least_area_is_stationary_and_keeps_the_boundary() -> None:
    rng = np.random.default_rng(3)
    net = random_surface(rng, (3, 4), 10.0).control_points
    for start in (dirichlet_extremal(net, (0.2, 0.1)), fixed_contour(FRAME, (4, 3), gamma_v=(-0.5, 0.5))):
        found = least_area(start)
        assert found.area < found.start <= dirichlet_energy(start)
        assert type(found.patch) is type(start)
        for side in SIDES:
            gap = found.patch.boundary(side).coefficients - start.boundary(side).coefficients
            assert abs(gap).max() <= 1e-13
        functional = functional_of(found.patch)
        here = np.zeros(math.prod(functional.trial.shape))
        assert np.linalg.norm(functional.gradient(here)) <= 1e-4 * math.sqrt(found.area)
        for _ in range(5):  # a local minimum: no small step has less area
            z = 0.05 * math.sqrt(found.area) * rng.normal(size=here.shape)
            assert functional.value(z) > functional.value(here) * (1 - 1e-9)
        again = least_area(found.patch)
        assert again.area == pytest.approx(found.area, rel=1e-8)
        assert again.gradient <= 1e-4


@pytest.mark.parametrize("seed", range(3))
def test_a_patch_of_least_area_stays_as_it_is(seed: int) -> None:
    found = least_area(dirichlet_extremal(np.random.default_rng(seed).normal(size=(4, 4, 3))))
    again = least_area(found.patch)
    assert again.patch == found.patch
    assert again.area == again.start == found.area


def test_straight_edges_give_the_settings_one_minimum() -> None:
    """Free boundary with straight edges: another trial space, the same film."""
    corners = np.array([[0, 0, 0], [1, 0, 1], [1, 1, 0], [0, 1, 1]], dtype=float)
    t = np.linspace(0, 1, 7)
    u, v = t[:, None, None], t[None, :, None]
    net = (1 - u) * ((1 - v) * corners[0] + v * corners[3]) + u * ((1 - v) * corners[1] + v * corners[2])
    found = least_area(dirichlet_extremal(net, (0.3, 0.3), (0.3, 0.3)))
    assert found.setting == "free boundary"
    assert found.area == pytest.approx(SURFACES["skew quadrilateral"]().area, rel=1e-7)


def test_a_patch_that_is_flat_or_has_no_interior() -> None:
    flat = Surface(np.array([[[i, j, 0.0] for j in range(4)] for i in range(4)]))
    assert least_area(flat).area == pytest.approx(9, rel=1e-12)
    bilinear = Surface([[[0, 0, 0], [0, 1, 1]], [[1, 0, 1], [1, 1, 0]]], family_u=BERNSTEIN, family_v=BERNSTEIN)
    assert least_area(bilinear).patch == bilinear
    empty = Surface(np.random.default_rng(0).normal(size=(3, 3, 3)), (-1, -1))
    assert least_area(empty).patch == empty


def test_what_has_no_least_area() -> None:
    with pytest.raises(InputError, match="patch must be a Surface or a Plateau, got Rotation"):
        least_area(Rotation(Curve([[1, 0, 0], [1, 0, 1], [2, 0, 2]]), [0, 0, 0], [0, 0, 1]))
    with pytest.raises(InputError, match="give a patch in space, d = 3"):
        least_area(Surface(np.random.default_rng(1).normal(size=(3, 3, 2))))


@pytest.mark.stress
@settings(max_examples=12)
@given(seed=st.integers(0, 10**6), n=st.integers(2, 5), k=st.integers(2, 5), family=st.sampled_from([GT, BERNSTEIN]))
def test_least_areas_of_random_boundaries(seed: int, n: int, k: int, family: Family) -> None:
    net = random_surface(np.random.default_rng(seed), (n, k), 10.0).control_points
    start = dirichlet_extremal(net, family=family)
    found = least_area(start)
    assert found.area <= found.start <= dirichlet_energy(start) * (1 + 1e-9)
    bounds = area_bounds(found.patch, rtol=1e-2)
    assert bounds.lower <= found.area + found.area.error
    assert found.area - found.area.error <= bounds.upper
    kept = np.ones(net.shape[:2], dtype=bool)
    kept[1:-1, 1:-1] = False
    assert np.array_equal(found.patch.control_points[kept], net[kept])


# --- proved bounds ----------------------------------------------------------------------------------------------------

EXACT = {
    "sphere octant": (
        Surface([[[0, 0, 1]] * 3, [[1, 0, 1], [1, 1, 1], [0, 1, 1]], [[1, 0, 0], [1, 1, 0], [0, 1, 0]]]),
        math.pi / 2,
        1e-3,
    ),
    "part of a torus": (
        Rotation(Curve([[4, 0, 0], [4, 0, 1], [3, 0, 1]]), [0, 0, 0], [0, 0, 1], 90),
        math.pi / 2 * (3 * math.pi / 2 + 1),
        1e-9,
    ),
    "rectangle": (Surface([[[0, 0], [0, 3]], [[2, 0], [2, 3]]], family_u=BERNSTEIN, family_v=BERNSTEIN), 6.0, 1e-9),
    "Enneper": (fixed_contour(SURFACES["Enneper, square"]().contour, 4, family=BERNSTEIN), 133 / 45, 1e-9),
}


@pytest.mark.parametrize("name", EXACT)
def test_bounds_hold_the_exact_area(name: str) -> None:
    surface, exact, width = EXACT[name]
    found = area_bounds(surface, rtol=width)
    assert found.lower <= exact <= found.upper
    assert found.upper - found.lower <= width * exact


@settings(max_examples=10)
@given(seed=st.integers(0, 10**6))
def test_bounds_hold_what_quadrature_finds(seed: int) -> None:
    surface = random_surface(np.random.default_rng(seed), (3, 2), 10.0)
    found, estimated = area_bounds(surface, rtol=1e-3), area(surface, rtol=1e-8)
    assert found.lower <= estimated + estimated.error
    assert estimated - estimated.error <= found.upper
    assert found.upper <= found.lower * (1 + 1e-3)


@pytest.mark.parametrize("turns", [20.0, 50.0, 90.0])
@pytest.mark.parametrize("rtol", [0.5, 1e-2, 1e-9])
def test_bounds_hold_where_a_surface_waves_too_fast_for_its_series(turns: float, rtol: float) -> None:
    """A strip wound round a cylinder of radius 1: as long as the angle."""
    coefficients = np.zeros((3, 2, 3))
    coefficients[1, :, 0] = coefficients[2, :, 1] = coefficients[0, 1, 2] = 1.0
    strip = SurfaceOfTerms(Waves(0.0, turns), Basis(1, family=BERNSTEIN), coefficients)
    found = area_bounds(strip, rtol=rtol)
    assert found.lower <= turns <= found.upper <= (1 + rtol) * found.lower


@pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-9, 1e-11])
def test_bounds_are_as_near_as_was_asked(rtol: float) -> None:
    patch = Plateau(*FRAME, INTERIOR, *TILTS)
    found = area_bounds(patch, rtol=rtol)
    assert 0 < found.upper - found.lower <= rtol * found.lower
    estimated = area(patch)
    assert found.lower - estimated.error <= estimated <= found.upper + estimated.error


def test_bounds_scale_with_the_surface() -> None:
    patch = Plateau(*FRAME, INTERIOR, *TILTS)
    near, far = area_bounds(patch, rtol=1e-6), area_bounds(patch.transformed(1000 * np.eye(3)), rtol=1e-6)
    assert far.cells == near.cells
    assert far.lower == pytest.approx(1e6 * near.lower, rel=1e-12)
    point = Surface(np.ones((3, 3, 3)))
    assert area_bounds(point).lower == 0
    assert area_bounds(point).upper <= 1e-12


def test_a_wrong_accuracy_is_refused() -> None:
    for rtol in (0, 1e-13, 1, math.nan):
        with pytest.raises(InputError, match=r"rtol must lie in \[1e-12, 1\)"):
            area_bounds(Surface(np.ones((3, 3, 3))), rtol=rtol)


def test_interior_functions_of_a_trial_are_orthonormal() -> None:
    trial = Trial.of(Plateau(*FRAME, INTERIOR, *TILTS), Basis(5, (0.3, -1)), Basis(7, family=BERNSTEIN))
    for side in (trial.u, trial.v):
        assert abs(side.gram((0, 0)) - np.eye(side.count)).max() <= 1e-12
        slopes = side.gram((1, 1))
        assert abs(slopes - np.diag(np.diag(slopes))).max() <= 1e-9 * slopes.max()
        assert abs(side.rows(np.array([0.0, 1.0]), 0)).max() == 0
