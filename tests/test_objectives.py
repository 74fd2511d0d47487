from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gtcad import BERNSTEIN, Curve, Restricted, Surface, measure
from gtcad._design_space import DesignSpace
from gtcad._integrands import CURVE, PATCH, STRIP, regression_jets
from gtcad.errors import InputError
from gtcad.objectives import KNOWN, evaluator, measured, objectives_of, values_of
from gtcad.patches import Coons, Lofted, Rotation, Ruled, Swept, Swung, cone
from gtcad.patches.developable import (
    PlaneFamily,
    geodesic_developable,
    quasi_developable,
    spine_developable,
)
from gtcad.patches.minimal import dirichlet_extremal

REFERENCE = [(0, 0, 0), (1, 2, 0.5), (2, 2.5, 2), (3, 1, 2.5), (4, 0, 1)]
CURVE_3D = Curve(REFERENCE, (0.2, -0.3))
PLANES = PlaneFamily([(1, 0, 0.2, 0), (0.5, 1, 0.3, 0.6), (-0.5, 1, 0.8, 1), (-1, 0.2, 1, 0.5)], (0.3, -0.2))
BOWL = Surface(
    np.stack(
        np.broadcast_arrays(np.arange(4.0)[:, None], np.arange(5.0), 0.3 * np.cos(np.outer(np.arange(4), range(5)))), -1
    )
)
SADDLE = Ruled(Curve([[0, 0, 0], [1, 0, 0]], family=BERNSTEIN), Curve([[0, 1, 0], [1, 1, 1]], family=BERNSTEIN))
PAIRS = st.tuples(*[st.floats(-1, 1)] * 2)


# --- an independent evaluation with 30 digits -------------------------------------------------------------------------


def blended(points: Any, gamma: tuple[float, float]) -> Callable[[Any], list[Any]]:
    """The curve by de Casteljau's recursion on the functions of degree 2, in mpmath."""
    rows = [[mp.mpf(float(x)) for x in row] for row in np.asarray(points)]
    g1, g2 = map(mp.mpf, gamma)

    def functions(n: int, t: Any) -> list[Any]:
        if n == 2:
            s, c = mp.sin(mp.pi * t / 2), mp.cos(mp.pi * t / 2)
            first, last = (1 - s) * (1 - g1 * s), (1 - c) * (1 - g2 * c)
            return [first, 1 - first - last, last]
        lower = [mp.mpf(0), *functions(n - 1, t), mp.mpf(0)]
        return [(1 - t) * lower[i + 1] + t * lower[i] for i in range(n + 1)]

    def curve(t: Any) -> list[Any]:
        values = functions(len(rows) - 1, t)
        return [mp.fsum(f * row[k] for f, row in zip(values, rows, strict=True)) for k in range(len(rows[0]))]

    return curve


def taylor(curve: Callable[[Any], list[Any]], t: Any, order: int) -> list[Any]:
    """Derivatives 1..order as vectors."""
    count = len(curve(t))
    columns = [mp.taylor(lambda x, k=k: curve(x)[k], t, order) for k in range(count)]
    return [mp.matrix([column[k] * mp.factorial(k) for column in columns]) for k in range(1, order + 1)]


def dot(a: Any, b: Any) -> Any:
    return (a.T * b)[0]


def integrand(name: str, curve: Callable[[Any], list[Any]]) -> Callable[[Any], Any]:
    def value(t: Any) -> Any:
        jets = taylor(curve, t, CURVE[name].highest)
        speed = mp.sqrt(dot(jets[0], jets[0]))
        if name in ("dirichlet", "length"):
            return speed**2 / 2 if name == "dirichlet" else speed
        if name == "energy":
            return dot(jets[1], jets[1])
        if name == "variation":
            return dot(jets[2], jets[2])
        if name == "curvature-energy":
            return kappa(curve, t) ** 2 * speed
        return mp.diff(lambda x: kappa(curve, x), t) ** 2 / speed

    return value


def kappa(curve: Callable[[Any], list[Any]], t: Any) -> Any:
    a, b = taylor(curve, t, 2)
    return mp.sqrt(dot(a, a) * dot(b, b) - dot(a, b) ** 2) / dot(a, a) ** mp.mpf("1.5")


def integral(function: Callable[[Any], Any]) -> Any:
    """By Gauss-Legendre rules of mpmath on quarters, more digits than doubles have."""
    return mp.quad(function, [0, 0.25, 0.5, 0.75, 1], maxdegree=4, method="gauss-legendre")


@pytest.mark.parametrize("name", CURVE)
def test_objectives_of_curves_are_integrals_taken_with_many_digits(name: str) -> None:
    with mp.workdps(20):
        wanted = integral(integrand(name, blended(REFERENCE[:4], (0.2, -0.3))))
    assert math.isclose(measured(Curve(REFERENCE[:4], (0.2, -0.3)), name), wanted, rel_tol=1e-12)


@pytest.mark.parametrize("name", ["length", "energy", "variation", "curvature-energy"])
def test_objectives_of_dual_curves_are_those_of_curves_in_four_dimensions(name: str) -> None:
    with mp.workdps(20):
        wanted = integral(integrand(name, blended(PLANES.control_planes, PLANES.gamma)))
    assert math.isclose(measured(PLANES, name), wanted, rel_tol=1e-12)


def edge(t: Any) -> list[Any]:
    """The edge of regression of the planes: what three consecutive ones share."""
    curve = blended(PLANES.control_planes, PLANES.gamma)
    rows = [mp.matrix(curve(t)), *taylor(curve, t, 2)]
    return list(mp.lu_solve(mp.matrix([list(row[:3]) for row in rows]), mp.matrix([row[3] for row in rows])))


def test_derivatives_of_the_edge_of_regression_are_exact_and_run_along_the_rulings() -> None:
    t = np.array([0.0, 0.3, 0.55, 1.0])
    jets = regression_jets(np.stack([PLANES.derivative(t, order) for order in range(6)]), 3)
    assert jets.shape == (3, 4, 3)
    along = PLANES.ruling(t).direction
    across = jets[0] - (jets[0] * along).sum(axis=-1, keepdims=True) * along
    assert np.abs(across).max() < 1e-12 * np.abs(jets[0]).max()
    with mp.workdps(40):
        for place in (1, 2):
            at = mp.mpf(float(t[place]))
            assert np.allclose(np.array(edge(at), dtype=float), PLANES.edge_of_regression(t[place]), rtol=1e-12)
            for order in (1, 2, 3):
                wanted = [float(mp.diff(lambda x, k=k: edge(x)[k], at, order)) for k in range(3)]
                assert np.allclose(jets[order - 1, place], wanted, rtol=1e-10)


def test_the_length_of_the_spine_is_that_of_the_edge_of_regression() -> None:
    """``|E'|`` by its component along the ruling, which it is parallel to, from E at Chebyshev points."""
    interpolant = np.polynomial.chebyshev.Chebyshev.interpolate
    planes = [interpolant(lambda x, k=k: PLANES.edge_of_regression(x)[:, k], 48, domain=(0, 1)) for k in range(3)]
    t = (np.polynomial.legendre.leggauss(60)[0] + 1) / 2
    speed = np.linalg.norm([one.deriv()(t) for one in planes], axis=0)
    wanted = speed @ np.polynomial.legendre.leggauss(60)[1] / 2
    assert math.isclose(measured(PLANES, "spine-length"), wanted, rel_tol=1e-9)


# --- against gtcad.measure and Gram matrices --------------------------------------------------------------------------


@settings(max_examples=20, deadline=None)
@given(PAIRS)
def test_curves_agree_with_measure(gamma: tuple[float, float]) -> None:
    curve = Curve(REFERENCE, gamma)
    assert math.isclose(measured(curve, "length"), measure.length(curve), rel_tol=1e-12)
    assert math.isclose(measured(curve, "curvature-energy"), measure.curvature_energy(curve), rel_tol=1e-8)
    for order, name in ((2, "energy"), (3, "variation")):
        gram = curve.factors.gram(order, order)
        wanted = sum(x @ gram @ x for x in curve.control_points.T)
        assert math.isclose(measured(curve, name), wanted, rel_tol=1e-9)


PATCHES = {
    "surface": BOWL,
    "part": Restricted(BOWL, ((0.2, 0.9), (1.0, 0.1))),
    "ruled": Ruled(CURVE_3D, CURVE_3D.transformed(np.eye(3), (0, 1, 3))),
    "swept": Swept(CURVE_3D, Curve([(0, 0, 0), (0, 1, 3), (0, 0, 6)])),
    "swung": Swung(Curve([(2, 0, 0), (3, 0, 1), (2, 0, 3)]), Curve([(1, 0, 0), (1, 1, 0), (0, 1, 0)]), 0.7),
    "rotation": Rotation(Curve([(2, 0, 0), (3, 0, 1), (2, 0, 3)]), (0, 0, 0), (0, 0, 1), 140),
    "lofted": Lofted([Curve([(0, 0, z), (1, z, z), (2, 0, z)]) for z in (0.0, 1.0, 2.5)]),
}


@pytest.mark.parametrize("name", PATCHES)
def test_patches_agree_with_measure(name: str) -> None:
    patch = PATCHES[name]
    assert math.isclose(measured(patch, "area"), measure.area(patch), rel_tol=1e-9)
    assert math.isclose(measured(patch, "dirichlet"), measure.dirichlet_energy(patch), rel_tol=1e-11)

    def second(weights: tuple[float, float, float]) -> float:
        orders = ((2, 0), (1, 1), (0, 2))

        def density(u: Any, v: Any) -> Any:
            return sum(w * (patch.derivative(u, v, o) ** 2).sum(-1) for w, o in zip(weights, orders, strict=True))

        return measure.over_square(density, 1e-12)

    assert math.isclose(measured(patch, "bending"), second((1, 2, 1)), rel_tol=1e-10)
    cross = measure.over_square(
        lambda u, v: 2 * (patch.derivative(u, v, (2, 0)) * patch.derivative(u, v, (0, 2))).sum(-1), 1e-12
    )
    assert math.isclose(measured(patch, "quasi-harmonic"), second((1, 0, 1)) + cross, rel_tol=1e-9)


def test_a_plane_patch_has_an_area() -> None:
    square = Surface([[[0, 0], [0, 3]], [[2, 0], [2, 3]]], family_u=BERNSTEIN, family_v=BERNSTEIN)
    assert math.isclose(measured(square, "area"), 6, rel_tol=1e-13)


# --- strips -----------------------------------------------------------------------------------------------------------


def test_the_saddle_twists_as_its_normals_do() -> None:
    """Normals (0, -x, 1) and (-1, -x, 1) at both ends; det(a', b', r) = -1, |b'|^2 = 2, |r|^2 = 1 + x^2."""
    assert math.isclose(measured(SADDLE, "developability"), math.pi / 8, rel_tol=1e-12)
    wanted = mp.quad(lambda x: mp.acos(mp.sqrt((x**2 + 1) / (x**2 + 2))) ** 2, [0, 1])
    assert math.isclose(measured(SADDLE, "twist"), wanted, rel_tol=1e-12)


def test_a_cone_to_its_apex_does_not_twist() -> None:
    base = Curve([(2, 0, 0), (2, 2, 0), (0, 2, 0)])
    for patch in (cone(base, (0, 1, 4)), cone(base, (0, 1, 4), (0, 0.5))):
        assert abs(measured(patch, "twist")) < 1e-25
        assert abs(measured(patch, "developability")) < 1e-25


def test_the_largest_angle_of_the_report_bounds_the_mean_one() -> None:
    strip = quasi_developable(CURVE_3D, Curve([(0, 1, 1), (1, 3, 1), (3, 2, 3), (4, 1, 2)]))
    mean = math.degrees(math.sqrt(measured(strip, "twist")))
    assert strip.report.twist_deg / 10 < mean < strip.report.twist_deg


# --- many designs at once ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", PATCHES)
@pytest.mark.parametrize("objective", PATCH)
def test_many_designs_have_the_values_of_each(name: str, objective: str) -> None:
    patch = PATCHES[name]
    space = DesignSpace.of(patch)
    designs = np.random.default_rng(8).uniform(-1, 1, (4, space.dimension))
    found = values_of(patch, objective, designs)
    wanted = [measured(space.shape_at(design), objective) for design in designs]
    assert np.allclose(found, wanted, rtol=1e-6 if objective == "area" else 1e-11)


@pytest.mark.parametrize(
    ("shape", "objective"),
    [
        *((CURVE_3D, name) for name in CURVE),
        *((PLANES, name) for name in CURVE),
        (PLANES, "spine-length"),
        (Restricted(CURVE_3D, (0.1, 0.8)), "curvature-variation"),
        *((BOWL, name) for name in PATCH),
        *((quasi_developable(CURVE_3D, Curve([(0, 1, 1), (1, 3, 1), (3, 2, 3), (4, 1, 2)])), name) for name in STRIP),
        (dirichlet_extremal(BOWL.control_points), "dirichlet"),
    ],
)
def test_gradients_are_exact(shape: Any, objective: str) -> None:
    found = evaluator(DesignSpace.of(shape), objective)
    assert found.gradient is not None
    design = 0.7 * np.cos(np.arange(1, DesignSpace.of(shape).dimension + 1))
    steps = 1e-3 * np.eye(len(design))
    sides = [found.values(design + k * steps) for k in (-2, -1, 1, 2)]
    wanted = (sides[0] - 8 * sides[1] + 8 * sides[2] - sides[3]) / 12e-3
    assert np.allclose(found.gradient(design), wanted, rtol=1e-6, atol=1e-8 * abs(found.values(design[None])[0]))


def test_what_is_not_affine_is_looked_at_one_by_one() -> None:
    loft = PATCHES["lofted"]
    assert evaluator(DesignSpace.of(loft, "gamma_v"), "area").gradient is None
    assert evaluator(DesignSpace.of(loft, "sections"), "area").gradient is not None
    assert np.isinf(values_of(loft, "area", [[-1.0, -1.0]], variables="gamma_v")).all()  # there is no such loft


def test_boundaries_of_a_coons_patch_are_four_pairs() -> None:
    c, d = Curve([(0, 0, 0), (1, 0, 1), (2, 0, 0)]), Curve([(0, 0, 0), (0, 1, 1), (0, 2, 0)])
    patch = Coons(c, c.transformed(np.eye(3), (0, 2, 0)), d, d.transformed(np.eye(3), (2, 0, 0)))
    designs = np.random.default_rng(1).uniform(-1, 1, (3, 8))
    space = DesignSpace.of(patch)
    wanted = [measure.area(space.shape_at(design)) for design in designs]
    assert np.allclose(values_of(patch, "area", designs), wanted, rtol=1e-9)


# --- developables -----------------------------------------------------------------------------------------------------


def test_developables_are_judged_by_the_curves_they_come_from() -> None:
    planes = PlaneFamily([(1, 0, 0, 1), (1, 0.5, 0.1, 1.1), (0.5, 1, 0.2, 1.2), (0, 1, 0.1, 1)], (0.3, -0.2))
    wall = planes.enveloping((0, 0, 1, 0), (0, 0, 1, 0.5))
    roof, road = spine_developable(CURVE_3D, (1.0, 2.0)), geodesic_developable(CURVE_3D, (-0.1, 0.2))
    for name in CURVE:
        assert measured(wall, f"dual-{name}") == measured(planes, name)
        assert measured(wall, f"spine-{name}") == measured(planes, f"spine-{name}")
        assert measured(roof, f"spine-{name}") == measured(CURVE_3D, name)
        assert measured(road, f"geodesic-{name}") == measured(CURVE_3D, name)
        designs = [[0.1, 0.2], [-0.4, 0.5]]
        assert np.array_equal(values_of(wall, f"dual-{name}", designs), values_of(planes, name, designs))
    assert "dual-length" not in objectives_of(roof)
    for patch in (wall, roof, road):
        assert abs(measured(patch, "twist")) < 1e-20


# --- what is refused --------------------------------------------------------------------------------------------------


def test_objectives_that_do_not_fit_are_refused_with_those_that_do() -> None:
    with pytest.raises(
        InputError, match=r"one of dirichlet, length, .* for Curve, got 'area': .* does not fit the kind"
    ):
        measured(CURVE_3D, "area")
    with pytest.raises(
        InputError, match=r"must be one of dirichlet, area, bending, quasi-harmonic for Surface, got 'x'$"
    ):
        measured(BOWL, "x")
    assert not set(STRIP) & set(objectives_of(BOWL))
    assert set(STRIP) <= set(objectives_of(SADDLE))
    for shape in (CURVE_3D, BOWL, SADDLE, PLANES):
        assert set(objectives_of(shape)) <= set(KNOWN)


def test_rulings_that_only_have_their_middle_on_the_chord_are_not_straight() -> None:
    bent = np.array([[[x, y, z] for y, z in ((0, 0), (1, 1), (2, -1), (3, 0))] for x in (0.0, 1.0)])
    assert not set(STRIP) & set(objectives_of(Surface(bent, family_u=BERNSTEIN)))
    bent[..., 2] = 0
    assert set(STRIP) <= set(objectives_of(Surface(bent, family_u=BERNSTEIN, family_v=BERNSTEIN)))


def test_a_limit_of_the_twist_changes_no_value_and_takes_no_gradient() -> None:
    free = quasi_developable(CURVE_3D, CURVE_3D.transformed(np.eye(3), [0, 1, 5]))
    limited = replace(free, max_twist_deg=free.report.twist_bound_deg + 1e-9)
    designs = np.random.default_rng(5).uniform(-1, 1, (4, 4))
    found, wanted = (evaluator(DesignSpace.of(shape, None), "area") for shape in (limited, free))
    assert np.array_equal(found.values(designs), wanted.values(designs))
    assert found.gradient is not None
    assert wanted.gradient is not None
    assert np.array_equal(found.gradient(designs[0]), wanted.gradient(designs[0]))


@pytest.mark.parametrize("designs", [[[0, 0, 0]], [0, 0], [[0, 1.5]], [[0, math.nan]]])
def test_designs_are_checked(designs: Any) -> None:
    with pytest.raises(InputError, match=r"designs must be numbers in \[-1, 1\] of shape \(count, 2\)"):
        values_of(CURVE_3D, "length", designs)


def test_a_straight_curve_has_no_curvature_to_vary() -> None:
    line = Curve([(0, 0, 0), (1, 1, 1), (3, 3, 3)], (0.2, 0.4))
    assert measured(line, "curvature-variation") < 1e-20
    flat_s = Curve([(0, 0), (1, 1), (2, -1), (3, 0)])  # an inflection in the middle, where a node lies
    wanted = mp.quad(lambda t: _signed_rate(flat_s, float(t)), [0, 0.5, 1], maxdegree=5)
    assert math.isclose(measured(flat_s, "curvature-variation"), wanted, rel_tol=1e-9)


def _signed_rate(curve: Curve, t: float) -> float:
    (x1, y1), (x2, y2), (x3, y3) = (curve.derivative(t, order) for order in (1, 2, 3))
    speed = math.hypot(x1, y1)
    bend, change = x1 * y2 - y1 * x2, x1 * y3 - y1 * x3
    return float((change / speed**3 - 3 * bend * (x1 * x2 + y1 * y2) / speed**5) ** 2 / speed)
