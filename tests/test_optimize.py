from __future__ import annotations

import importlib
import itertools
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from PIL import Image

from gtcad import BERNSTEIN, Composite, Curve, Surface, measure, objectives
from gtcad._search import Problem, Search
from gtcad._swarm import SwarmSettings, swarm
from gtcad.design_variables import design_rate, design_variables, with_design_variables
from gtcad.errors import ExtraMissing, InputError, NoFeasibleDesign
from gtcad.fronts import pareto_front
from gtcad.objectives import measured, values_of
from gtcad.optimize import METHODS, Optimum, optimize
from gtcad.patches import Coons, Lofted, Ruled
from gtcad.patches.developable import PlaneFamily, quasi_developable, spine_developable
from gtcad.patches.minimal import Plateau, dirichlet_extremal, extremal, fixed_contour

Array = NDArray[np.float64]

CURVE = Curve([(0, 0, 0), (1, 2, 0.5), (2, 2.5, 2), (3, 1, 2.5), (4, 0, 1)], (0.2, -0.3))
ARCH = Curve([(0, 0), (1, 3), (4, 2), (5, 0)])
QUARTER = Curve([[1, 0], [1, 1], [0, 1]])


def skew(degree: int) -> Array:
    """The net of the skew quadrilateral with straight edges."""
    u = np.linspace(0, 1, degree + 1)[:, None]
    v = u.T
    return np.stack(np.broadcast_arrays(u, v, u + v - 2 * u * v), axis=-1)


# --- valleys whose lowest is known ------------------------------------------------------------------------------------

PLACE = np.array([0.31, -0.42, 0.17, 0.53])


def rastrigin(x: Array) -> Array:
    y = 3 * (x - PLACE[: x.shape[-1]])
    return np.asarray((y**2 + 10 * (1 - np.cos(2 * np.pi * y))).sum(axis=-1))


def ackley(x: Array) -> Array:
    y = 5 * (x - PLACE[: x.shape[-1]])
    near = -20 * np.exp(-0.2 * np.sqrt((y**2).mean(axis=-1))) - np.exp(np.cos(2 * np.pi * y).mean(axis=-1))
    return np.asarray(near + 20 + math.e)


def schwefel(x: Array) -> Array:
    y = 500 * x
    lowest = 420.9687462275036
    return np.asarray((lowest * math.sin(math.sqrt(lowest)) - y * np.sin(np.sqrt(np.abs(y)))).sum(axis=-1))


def turned(x: Array) -> Array:
    c, s = math.cos(0.4), math.sin(0.4)
    return rastrigin(0.7 * x @ np.array([[c, s], [-s, c]]))


def of_shape(function: Callable[[Array], Array]) -> Callable[[Any], float]:
    """The function of a shape's design variables, as a user would write it."""

    def objective(shape: Any) -> float:
        gamma = shape.gamma if isinstance(shape, Curve) else shape.gamma_u + shape.gamma_v
        return float(function(np.array(gamma)))

    return objective


@pytest.mark.parametrize("function", [rastrigin, ackley, schwefel, turned])
def test_the_lowest_valley_of_curves_is_found_from_every_one_of_50_seeds(function: Callable[[Array], Array]) -> None:
    from gtcad._descent import polish, scan

    worst = 0.0
    for seed in range(50):
        search = Search(Problem(2, function))
        polish(search, swarm(search, np.zeros(2), SwarmSettings(), np.random.default_rng(seed)), 3)
        scan(search)
        worst = max(worst, search.value)
    assert worst < 1e-9


@pytest.mark.parametrize("function", [rastrigin, ackley, schwefel])
def test_the_lowest_valley_of_patches_is_found_from_every_one_of_50_seeds(function: Callable[[Array], Array]) -> None:
    from gtcad._descent import polish, scan

    for seed in range(50):
        search = Search(Problem(4, function))
        polish(search, swarm(search, np.zeros(4), SwarmSettings(), np.random.default_rng(seed)), 3)
        scan(search)
        assert search.value < 1e-9, seed


@pytest.mark.parametrize(
    ("shape", "function"), [(QUARTER, turned), (QUARTER, ackley), (Surface(skew(2) ** 2), rastrigin)]
)
def test_a_function_of_the_shape_finds_its_lowest_valley(shape: Any, function: Callable[[Array], Array]) -> None:
    found = optimize(shape, of_shape(function), seed=7)
    assert abs(found.value) < 1e-9
    assert math.isnan(found.value.error)
    assert found.objective == "objective"
    assert np.array_equal(np.concatenate(list(found.gamma.values())), np.ravel(list(design_of(found.shape).values())))


def design_of(shape: Any) -> dict[str, Any]:
    return {"gamma": shape.gamma} if isinstance(shape, Curve) else design_variables(shape)


def test_news_spread_slowly_on_a_ring() -> None:
    """The first iterations of both neighbourhoods are the same but for who leads."""
    runs = {}
    for kind in ("ring", "global"):
        search = Search(Problem(4, rastrigin))
        swarm(search, np.zeros(4), SwarmSettings(neighbourhood=kind), np.random.default_rng(0))  # type: ignore[arg-type]
        runs[kind] = search.history
    assert runs["ring"][0] == runs["global"][0]
    assert runs["ring"] != runs["global"]
    assert len(runs["ring"]) == 100


# --- equal seeds ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["pso", "de"])
def test_equal_seeds_give_equal_histories_bit_for_bit(method: Any) -> None:
    for shape, objective in (
        (CURVE, "curvature-variation"),
        (Surface(skew(3)), "area"),
        (QUARTER, of_shape(rastrigin)),
    ):
        first, again, other = (
            optimize(shape, objective, method=method, seed=seed, iterations=20) for seed in (5, 5, 6)
        )
        assert first.history.tobytes() == again.history.tobytes()
        assert first.gamma == again.gamma
        assert first.as_data() == again.as_data()
        assert first.history.tobytes() != other.history.tobytes()


# --- exact and independent answers ------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", METHODS)
def test_the_skew_quadrilateral_has_its_least_energy_at_the_corner_of_the_box(method: Any) -> None:
    found = optimize(dirichlet_extremal(skew(3)), method=method)
    assert math.isclose(found.value, 1.2956353421, rel_tol=1e-10)
    assert found.gamma == {"gamma_u": (1, 1), "gamma_v": (1, 1)}
    assert found.setting == "free boundary, interior solved anew as the dirichlet extremal"
    assert found.converged
    assert found.shape == dirichlet_extremal(skew(3), (1, 1), (1, 1))


@pytest.mark.parametrize("energy", ["dirichlet", "quasi-harmonic", "bending"])
def test_extremals_are_recognised_and_stay_extremals(energy: Any) -> None:
    net = skew(4) + 0.2 * np.cos(np.arange(75)).reshape(5, 5, 3)
    found = optimize(extremal(net, energy), energy, iterations=10)
    assert found.setting.endswith(f"solved anew as the {energy} extremal")
    wanted = extremal(net, energy, **dict(found.gamma))
    assert np.allclose(found.shape.control_points, wanted.control_points, atol=1e-12)
    free = optimize(extremal(net, energy), energy, iterations=10, extremal=None)
    assert free.setting == "control points fixed"
    assert free.value > found.value
    asked = optimize(Surface(net), energy, extremal=energy, iterations=10)
    assert math.isclose(asked.value, found.value, rel_tol=1e-9)


def test_a_fixed_contour_stays() -> None:
    sides = [Curve([a, (np.add(a, b) / 2 + [0, 0, 0.4]).tolist(), b]) for a, b in _edges()]
    start = fixed_contour(sides, 3)
    found = optimize(start, iterations=30)
    assert found.setting == "fixed contour, interior solved anew as the dirichlet extremal"
    assert set(found.gamma) >= {"gamma_u", "gamma_v"}
    assert found.value < found.start_value
    for side in ("u0", "u1", "v0", "v1"):
        t = np.linspace(0, 1, 9)
        assert np.allclose(found.shape.boundary(side).evaluate(t), start.boundary(side).evaluate(t), atol=1e-13)
    grid = np.array(list(itertools.product((-1.0, 0.0, 1.0), repeat=4)))
    rivals = [measure.dirichlet_energy(fixed_contour(sides, 3, gamma_u=g[:2], gamma_v=g[2:])) for g in grid]
    assert found.value <= min(rivals) + 1e-12


def _edges() -> list[tuple[list[float], list[float]]]:
    a, b, c, d = [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]
    return [(a, b), (c, d), (a, c), (b, d)]


CASES: dict[str, tuple[Any, str]] = {
    "curve": (CURVE, "curvature-variation"),
    "plane curve": (ARCH, "curvature-energy"),
    "surface": (Surface(skew(3) + 0.3 * np.cos(np.arange(48)).reshape(4, 4, 3)), "bending"),
    "ruled": (Ruled(CURVE, CURVE.transformed(np.eye(3), (0, 1, 2))), "dirichlet"),
    "strip": (quasi_developable(CURVE, Curve([(0, 1, 1), (1, 3, 1), (3, 2, 3), (4, 1, 2)])), "twist"),
    "planes": (PlaneFamily([(1, 0, 0.2, 0), (0.5, 1, 0.3, 0.6), (-0.5, 1, 0.8, 1), (-1, 0.2, 1, 0.5)]), "variation"),
}


@pytest.mark.parametrize("name", CASES)
def test_two_methods_and_a_grid_agree(name: str) -> None:
    shape, objective = CASES[name]
    by_swarm, by_evolution = (optimize(shape, objective, method=method, seed=3) for method in ("pso", "de"))
    assert math.isclose(by_swarm.value, by_evolution.value, rel_tol=1e-8, abs_tol=1e-12)
    assert by_swarm.converged
    assert by_swarm.value <= by_swarm.start_value
    count = len(by_swarm.gamma)
    grid = np.array(list(itertools.product(np.linspace(-1, 1, 21 if count == 1 else 5), repeat=2 * count)))
    assert by_swarm.value <= values_of(shape, objective, grid).min() * (1 + 1e-9)
    assert math.isclose(by_swarm.value, measured(by_swarm.shape, objective), rel_tol=1e-12)


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32), st.sampled_from(["length", "energy", "curvature-energy"]), st.sampled_from(METHODS))
def test_results_lie_in_the_box_and_are_never_worse(seed: int, objective: str, method: Any) -> None:
    points = np.random.default_rng(seed).uniform(-1, 1, (5, 3))
    start = Curve(points, np.random.default_rng(seed).uniform(-1, 1, 2))
    found = optimize(start, objective, method=method, seed=seed, particles=8, iterations=8)
    assert np.abs(found.gamma["gamma"]).max() <= 1
    assert found.value <= found.start_value * (1 + 1e-9)
    assert (np.diff(found.history) <= 0).all()
    assert np.array_equal(found.shape.control_points, points)
    assert found.seed == seed


def test_only_the_wanted_variables_move() -> None:
    shape, objective = CASES["surface"]
    found = optimize(shape, objective, variables=["gamma_u[1]"], iterations=10)
    assert found.gamma["gamma_v"] == shape.gamma_v
    assert found.gamma["gamma_u"][0] == shape.gamma_u[0]
    whole = optimize(shape, objective, variables="gamma_u", iterations=10)
    assert whole.value <= found.value < found.start_value


def test_kinds_without_closed_sums_are_optimised_too() -> None:
    loft = Lofted([Curve([(0, 0, z), (1, z, z), (2, 0, z)]) for z in (0.0, 1.0, 2.5)], gamma_v=(0.5, 0.5))
    found = optimize(loft, "bending", variables="gamma_v", particles=5, iterations=4)
    assert found.value < found.start_value
    assert found.converged
    c, d = Curve([(0, 0, 0), (1, 0, 1), (2, 0, 0)]), Curve([(0, 0, 0), (0, 1, 1), (0, 2, 0)])
    coons = Coons(c, c.transformed(np.eye(3), (0, 2, 0)), d, d.transformed(np.eye(3), (2, 0, 0)))
    assert optimize(coons, "area", iterations=5).gamma == dict.fromkeys(("c0", "c1", "d0", "d1"), (-1.0, -1.0))


def test_developables_are_optimised_by_their_spine_and_dual_curve() -> None:
    spine = Curve([(0, 0, 0), (2, 0, 0), (3, 2, 1), (3, 3, 4)])
    roof = spine_developable(spine, (1.0, 2.0))
    found = optimize(roof, "spine-curvature-energy", particles=6, iterations=6)
    alone = optimize(spine, "curvature-energy")
    assert math.isclose(found.value, alone.value, rel_tol=1e-6)
    assert found.shape.spine.gamma == found.gamma["spine"]
    planes = PlaneFamily([(1, 0, 0, 1), (1, 0.5, 0.1, 1.1), (0.5, 1, 0.2, 1.2), (0, 1, 0.1, 1)])
    wall = planes.enveloping((0, 0, 1, 0), (0, 0, 1, 0.5))
    best = optimize(wall, "dual-energy", particles=6, iterations=6)
    assert math.isclose(best.value, optimize(planes, "energy").value, rel_tol=1e-6)
    assert best.shape.family.gamma == best.gamma["family"]


def test_a_line_stays_as_it_is() -> None:
    """A straight one is as long with any design variables, but for the last digits."""
    line = Curve([[0, 0, 0], [1, 0, 0], [3, 0, 0]], (0.25, -0.125))
    found = optimize(line, "length", particles=6, iterations=6)
    assert found.gamma == {"gamma": (0.25, -0.125)}
    assert found.value == found.start_value


def test_a_value_that_is_not_known_well_is_not_called_a_minimum(monkeypatch: pytest.MonkeyPatch) -> None:
    assert optimize(CURVE, "energy", particles=6, iterations=6).converged
    monkeypatch.setattr("gtcad.optimize.measured", lambda shape, name: measure.Estimate(measured(shape, name), 10.0))
    assert not optimize(CURVE, "energy", particles=6, iterations=6).converged


def test_a_rule_that_is_too_coarse_for_the_result_is_refined(monkeypatch: pytest.MonkeyPatch) -> None:
    """With six nodes alone the result is 4 % worse."""
    best = optimize(CURVE, "curvature-variation", particles=10, iterations=20)
    monkeypatch.setitem(objectives.NODES, "curve", 6)
    found = optimize(CURVE, "curvature-variation", particles=10, iterations=20)
    assert math.isclose(found.value, best.value, rel_tol=1e-9)


def test_a_strip_never_twists_more_than_it_may() -> None:
    strip = quasi_developable(CURVE, Curve([(0, 1, 1), (1, 3, 1), (3, 2, 3), (4, 1, 2)]))
    free = optimize(strip, "area", iterations=5)
    limit = 1.01 * strip.report.twist_bound_deg
    assert free.shape.report.twist_deg > limit
    limited = replace(strip, max_twist_deg=limit)
    found = optimize(limited, "area", particles=4, iterations=4, polished=False)
    assert found.shape.report.twist_bound_deg <= limit
    assert free.value < found.value <= found.start_value


def test_plane_families_and_interiors_are_design_variables_of_their_patches() -> None:
    planes = PlaneFamily([(1, 0, 0, 1), (1, 0.5, 0.1, 1.1), (0.5, 1, 0.2, 1.2), (0, 1, 0.1, 1)], (0.3, -0.2))
    wall = planes.enveloping((0, 0, 1, 0), (0, 0, 1, 0.5))
    assert design_variables(wall) == {"family": (0.3, -0.2)}
    moved = with_design_variables(wall, {"family": (0.3, 0.1)})
    assert moved == planes.with_gamma((0.3, 0.1)).enveloping((0, 0, 1, 0), (0, 0, 1, 0.5))
    step = 1e-4
    sides = [with_design_variables(wall, {"family": (0.3 + k * step, -0.2)}).evaluate(0.4, 0.7) for k in (1, -1)]
    rate = design_rate(wall, "family[0]").evaluate(0.4, 0.7)
    assert np.allclose(rate, (sides[0] - sides[1]) / (2 * step), atol=1e-7)
    film = fixed_contour([Curve([a, b], family=BERNSTEIN) for a, b in _edges()], 4)
    assert design_variables(film) == {"gamma_u": (0.0, 0.0), "gamma_v": (0.0, 0.0)}
    turned = with_design_variables(film.with_interior(film.interior + 1.0), {"gamma_v": (0.5, -1.0)})
    assert isinstance(turned, Plateau)
    assert np.array_equal(turned.interior, film.interior + 1.0)
    assert turned.gamma_v == (0.5, -1.0)


# --- limits -----------------------------------------------------------------------------------------------------------


def test_no_value_makes_up_for_a_broken_limit() -> None:
    """The chord at (-1, -1) is the shortest by far, but gamma_1 must not be below 0.25."""
    for method in METHODS:
        found = optimize(
            QUARTER,
            lambda curve: 1e9 * measure.length(curve, rtol=1e-9),
            method=method,
            constraints=lambda curve: 1e-9 * (0.25 - curve.gamma[0]),
            particles=6,
            iterations=10,
        )
        assert found.gamma["gamma"][0] >= 0.25
        if method != "polish":
            assert abs(found.gamma["gamma"][0] - 0.25) < 1e-5
            assert abs(found.gamma["gamma"][1] + 1) < 1e-5


def test_several_limits_all_hold() -> None:
    found = optimize(
        QUARTER,
        "length",
        constraints=[lambda curve: 0.1 - curve.gamma[0], lambda curve: curve.gamma[0] + curve.gamma[1] + 0.5],
    )
    first, second = found.gamma["gamma"]
    assert first >= 0.1
    assert first + second <= -0.5
    assert found.value < 1.5


@pytest.mark.parametrize("method", METHODS)
def test_when_no_design_keeps_the_limits_none_is_returned(method: Any) -> None:
    with pytest.raises(NoFeasibleDesign, match=r"none of \d+ designs keeps the constraints while length") as caught:
        optimize(QUARTER, "length", method=method, constraints=lambda _: 3.0, particles=5, iterations=3)
    assert caught.value.excess == 3.0
    with pytest.raises(NoFeasibleDesign):
        optimize(QUARTER, "length", constraints=lambda _: math.nan, particles=5, iterations=3)


def test_a_start_beyond_the_limits_is_left() -> None:
    found = optimize(QUARTER, "length", constraints=lambda c: 0.5 - c.gamma[1], particles=5, iterations=10)
    assert found.gamma["gamma"][1] >= 0.5
    assert math.isinf(found.history[0]) or found.history[0] > 0


def test_values_that_are_no_numbers_count_as_infinitely_bad() -> None:
    def only_above(curve: Curve) -> float:
        return curve.gamma[0] if curve.gamma[0] > 0.3 else math.nan

    found = optimize(QUARTER, only_above, particles=10, iterations=20)
    assert 0.3 < found.gamma["gamma"][0] < 0.31
    with pytest.raises(InputError, match="is finite for no design that was looked at"):
        optimize(QUARTER, lambda _: math.inf, particles=5, iterations=2)


# --- the search itself ------------------------------------------------------------------------------------------------


def test_the_published_settings_are_the_defaults() -> None:
    found = SwarmSettings()
    assert (found.particles, found.iterations, found.patience) == (30, 100, None)
    assert (found.inertia, found.own_pull, found.common_pull) == (0.7298, 1.49618, 1.49618)
    run = optimize(CURVE, "length", polished=False)
    assert len(run.history) == 100
    assert run.evaluations == 3000 + 1 + 1  # the shape that was given, and the slope at the end


def test_a_swarm_may_stop_early() -> None:
    found = optimize(CURVE, "length", patience=5, polished=False)
    assert len(found.history) < 100
    assert found.history[-1] == found.history[-5]


def test_what_has_not_settled_says_so() -> None:
    found = optimize(CURVE, "curvature-variation", particles=5, iterations=2, polished=False)
    assert not found.converged
    assert not found.interrupted


def test_an_interrupt_keeps_the_best_so_far() -> None:
    seen = []

    def stop(progress: Any) -> None:
        seen.append(progress)
        if progress.step == 7:
            raise KeyboardInterrupt

    for method in ("pso", "de"):
        seen.clear()
        found = optimize(
            CURVE,
            "curvature-variation",
            method=method,
            on_step=stop,
            keep_interrupted=True,  # type: ignore[arg-type]
        )
        assert found.interrupted
        assert not found.converged
        assert [progress.step for progress in seen] == [1, 2, 3, 4, 5, 6, 7]
        assert {progress.steps for progress in seen} == {100}
        assert np.array_equal(found.history, [progress.value for progress in seen])
        assert math.isclose(found.value, seen[-1].value, rel_tol=1e-9)
        assert tuple(seen[-1].design) == found.gamma["gamma"]
        with pytest.raises(KeyboardInterrupt):
            optimize(CURVE, "curvature-variation", method=method, on_step=stop)  # type: ignore[arg-type]


def test_rounding_is_no_reason_to_move() -> None:
    """The curvature of a circle does not vary, but for rounding."""
    for method in METHODS:
        found = optimize(QUARTER, "curvature-variation", method=method, iterations=10)
        assert found.shape == QUARTER
        assert found.gamma == {"gamma": (0.0, 0.0)}
        assert found.converged
    done = optimize(CURVE, "energy")
    assert optimize(done.shape, "energy", seed=1).gamma == done.gamma


def test_nodes_are_added_where_a_rule_is_too_coarse() -> None:
    """Nearly a cusp: the curvature is a spike between the nodes."""
    loop = Curve([(0, 0), (3, 1.002), (0, 1), (3, 0)])
    found = optimize(loop, "curvature-energy", particles=10, iterations=10)
    assert math.isclose(found.value, measure.curvature_energy(found.shape), rel_tol=1e-5)


# --- results ----------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def result() -> Optimum:
    return optimize(CURVE, "energy", iterations=15)


@pytest.mark.parametrize("suffix", [".png", ".svg"])
def test_the_convergence_is_drawn(result: Optimum, suffix: str, tmp_path: Path) -> None:
    for name in ("a", "b"):
        result.plot(tmp_path / f"{name}{suffix}", title="Energy")
    first, second = ((tmp_path / f"{name}{suffix}").read_bytes() for name in ("a", "b"))
    assert first == second
    if suffix == ".png":
        with Image.open(tmp_path / "a.png") as picture:
            assert len(set(picture.convert("L").tobytes())) > 20
    else:
        assert b"Energy" in first


def test_histories_without_a_range_are_drawn(tmp_path: Path) -> None:
    one = optimize(CURVE, "length", method="polish", particles=3)
    flat = optimize(QUARTER, lambda _: 1.0, particles=3, iterations=3)
    for found in (one, flat):
        found.plot(tmp_path / "c.png")
        assert (tmp_path / "c.png").stat().st_size > 10_000


def test_a_result_as_plain_data(result: Optimum) -> None:
    data = result.as_data()
    assert data["gamma"] == {"gamma": list(result.gamma["gamma"])}
    assert data["value"] == result.value.value
    assert data["history"] == result.history.tolist()
    assert data["setting"] == "control points fixed"


# --- what is refused --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"method": "newton"}, "method must be one of pso, polish, de, got 'newton'"),
        ({"seed": -1}, "seed must be a whole number from 0, got -1"),
        ({"particles": 2}, "particles must be a whole number from 3, got 2"),
        ({"iterations": 0}, "iterations must be a whole number from 1"),
        ({"patience": 0}, "patience must be a whole number from 1"),
        ({"inertia": 1.5}, r"inertia must lie in \[0, 1\]"),
        ({"neighbourhood": "star"}, "neighbourhood must be 'ring' or 'global'"),
        ({"variables": "gamma_u"}, r"variables must be some of gamma, gamma\[0\], gamma\[1\], got 'gamma_u'"),
        ({"variables": []}, "variables must be some of"),
        ({"objective": "area"}, "does not fit the kind"),
        ({"objective": 3}, "objective must be a name or a function of the shape, got 3"),
        ({"objective": lambda _: "much"}, "objective must give a number, got 'much'"),
        ({"constraints": [3]}, r"constraints\[0\] must be a function of the shape, got 3"),
        ({"extremal": "area"}, "extremal must be one of auto, dirichlet"),
        ({"extremal": "dirichlet"}, "extremal='dirichlet' is for a Surface .* got Curve"),
    ],
)
def test_arguments_are_checked(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        optimize(CURVE, **arguments)


def test_shapes_without_design_variables_are_refused() -> None:
    with pytest.raises(InputError, match="the shape has no design variables"):
        optimize(Curve([(0, 0), (1, 1)], family=BERNSTEIN), "length")
    with pytest.raises(InputError, match="must be a curve, a patch or a family of planes, got Composite"):
        optimize(Composite((CURVE,), ()), "length")


# --- fronts -----------------------------------------------------------------------------------------------------------


def test_a_front_runs_from_one_optimum_to_the_other() -> None:
    front = pareto_front(CURVE, ["length", "curvature-variation"], generations=40)
    ends = [optimize(CURVE, name) for name in front.objectives]
    assert front.objectives == ("length", "curvature-variation")
    assert len(front) == len(front.shapes) > 10
    assert (np.diff(front.values[:, 0]) > 0).all()
    assert (np.diff(front.values[:, 1]) < 0).all()  # two objectives: what gains in one loses in the other
    assert math.isclose(front.values[0, 0], ends[0].value, rel_tol=1e-3)
    assert math.isclose(front.values[-1, 1], ends[1].value, rel_tol=1e-2)
    for gamma, shape, values in zip(front.gammas, front.shapes, front.values, strict=True):
        assert shape == Curve(CURVE.control_points, gamma["gamma"])
        assert math.isclose(measured(shape, "length"), values[0], rel_tol=1e-12)
    again = pareto_front(CURVE, ["length", "curvature-variation"], generations=40)
    assert front.values.tobytes() == again.values.tobytes()
    assert front.evaluations == 40 * 40


def test_fronts_keep_limits() -> None:
    limit = lambda curve: 0.2 - curve.gamma[0]  # noqa: E731
    front = pareto_front(
        CURVE, ["length", lambda curve: -curve.gamma[1]], constraints=[limit], population=12, generations=8
    )
    assert all(gamma["gamma"][0] >= 0.2 for gamma in front.gammas)
    with pytest.raises(NoFeasibleDesign):
        pareto_front(CURVE, ["length", "energy"], constraints=[lambda _: 1.0], population=4, generations=2)


def test_every_design_on_a_front_is_a_shape() -> None:
    planes = PlaneFamily([(1, 0, 0, 1), (1, 0.5, 0.1, 1.1), (0.5, 1, 0.2, 1.2), (0, 1, 0.1, 1)])
    wall = planes.enveloping((0, 0, 1, 0), (0, 0, 1, 0.5))
    front = pareto_front(wall, ["dual-energy", "dual-length"], population=6, generations=3)
    assert [shape.family.gamma for shape in front.shapes] == [gamma["family"] for gamma in front.gammas]


def test_what_a_front_takes() -> None:
    with pytest.raises(InputError, match="objectives must be two or more"):
        pareto_front(CURVE, ["length"])
    with pytest.raises(InputError, match="population must be a whole number from 4"):
        pareto_front(CURVE, ["length", "energy"], population=3)
    with pytest.raises(InputError, match="does not fit the kind"):
        pareto_front(CURVE, ["length", "area"])


def test_fronts_say_which_package_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> Any:
        raise ModuleNotFoundError(f"No module named {name!r}")

    monkeypatch.setattr(importlib, "import_module", missing)
    with pytest.raises(ExtraMissing, match=r"pip install 'gtcad\[optimize\]'"):
        pareto_front(CURVE, ["length", "energy"])
