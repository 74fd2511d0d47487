from __future__ import annotations

import json
import math
import pickle
import tracemalloc
from pathlib import Path

import mpmath as mp
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from mpmath.calculus.quadrature import GaussLegendre
from scipy.interpolate import BPoly

from gtcad.basis import BERNSTEIN, FAMILIES, GT, MAX_DEGREE, Basis, Family, checked_parameters, family_named
from gtcad.curve import Curve
from gtcad.errors import InputError
from tests import reference

CASES = json.loads((Path(__file__).parent / "data" / "basis.json").read_text())["cases"]

degrees = st.integers(2, MAX_DEGREE)
design_variables = st.floats(-1, 1)
gammas = st.tuples(design_variables, design_variables)
parameters = st.floats(0, 1)
dyadic = st.integers(0, 2**20).map(lambda k: k / 2**20)  # 1 - t is exact
ends = st.sampled_from([-1.0, 0.0, 1.0])
any_gamma = st.one_of(gammas, st.tuples(ends, ends), st.tuples(ends, design_variables))


# The reference file


def test_reference_has_180_cases() -> None:
    assert len(CASES) == 180


@pytest.mark.parametrize("case", CASES, ids=lambda c: f"n{c['n']}-g{c['g1']},{c['g2']}-t{c['xi']}")
def test_reference(case: dict[str, object]) -> None:
    basis = Basis(int(case["n"]), (float(case["g1"]), float(case["g2"])))
    assert len(case["values"]) == 5
    for order, row in enumerate(case["values"]):
        expected = np.array(row, dtype=np.float64)
        largest = abs(expected).max()
        scale = largest if largest > 1e-50 else 1.0  # rows that vanish are written as their rounding, 1e-60
        assert abs(basis.derivative(float(case["xi"]), order) - expected).max() <= 1e-13 * scale


# The properties of the basis


@given(degrees, any_gamma, parameters)
def test_non_negative(degree: int, gamma: tuple[float, float], t: float) -> None:
    assert Basis(degree, gamma).evaluate(t).min() >= 0


@given(degrees, any_gamma, parameters)
def test_sums_to_one(degree: int, gamma: tuple[float, float], t: float) -> None:
    basis = Basis(degree, gamma)
    assert abs(math.fsum(basis.evaluate(t)) - 1) <= basis.rounding


@given(degrees, any_gamma, parameters, st.integers(1, 6))
def test_derivatives_sum_to_zero(degree: int, gamma: tuple[float, float], t: float, order: int) -> None:
    row = Basis(degree, gamma).derivative(t, order)
    assert abs(math.fsum(row)) <= 1e-13 * abs(row).max()


@given(degrees, any_gamma, dyadic)
def test_mirror_symmetry(degree: int, gamma: tuple[float, float], t: float) -> None:
    basis, mirrored = Basis(degree, gamma), Basis(degree, gamma[::-1])
    difference = basis.evaluate(t) - mirrored.evaluate(1 - t)[::-1]
    assert abs(difference).sum() <= basis.rounding


@given(degrees, any_gamma, dyadic, st.integers(1, 4))
def test_mirror_symmetry_of_derivatives(degree: int, gamma: tuple[float, float], t: float, order: int) -> None:
    row = Basis(degree, gamma).derivative(t, order)
    mirrored = (-1) ** order * Basis(degree, gamma[::-1]).derivative(1 - t, order)[::-1]
    assert abs(row - mirrored).max() <= 1e-13 * abs(row).max()


@given(degrees, any_gamma)
def test_interpolates_at_the_ends(degree: int, gamma: tuple[float, float]) -> None:
    rows = Basis(degree, gamma).evaluate([0.0, 1.0])
    assert rows[0].tolist() == [1.0] + [0.0] * degree
    assert rows[1].tolist() == [0.0] * degree + [1.0]


@given(st.integers(3, 8), any_gamma)
def test_linearly_independent(degree: int, gamma: tuple[float, float]) -> None:
    eigenvalues = np.linalg.eigvalsh(Basis(degree, gamma).gram())
    assert eigenvalues[0] > 1e-6 * eigenvalues[-1]  # 0.002 for n = 3, 9e-6 for n = 8, both at (-1, -1)


@given(any_gamma)
def test_linearly_independent_at_degree_two_away_from_the_exception(gamma: tuple[float, float]) -> None:
    away = 1 + max(gamma)
    assume(away > 1e-4)
    eigenvalues = np.linalg.eigvalsh(Basis(2, gamma).gram())
    assert eigenvalues[0] > 0.005 * away**2 * eigenvalues[-1]


def test_degree_two_loses_its_middle_function_at_both_minus_one() -> None:
    basis = Basis(2, (-1, -1))
    t = np.linspace(0, 1, 101)
    assert (basis.evaluate(t)[:, 1] == 0).all()
    assert np.linalg.matrix_rank(basis.gram()) == 2
    points = Curve([[0, 0], [5, 7], [2, 1]], (-1, -1)).evaluate(t)
    assert abs(points @ [1, -2]).max() <= 1e-15


@given(any_gamma)
def test_constants_are_the_only_straight_line_that_is_kept(gamma: tuple[float, float]) -> None:
    t = np.linspace(0, 1, 200)
    deviations = []
    for degree in (2, 3, 7, 30, 60):
        rows = Basis(degree, gamma).evaluate(t)
        assert abs(rows @ np.full(degree + 1, 3.0) - 3).max() <= 3e-14
        deviations.append(degree * abs(rows @ np.linspace(0, 1, degree + 1) - t).max())
    assert min(deviations) > 4e-4  # the least over all design variables is 5e-4
    assert np.ptp(deviations) <= 1e-12  # n times the deviation is 1 - f_02 + f_22 - 2 t for every degree


@given(degrees, any_gamma, st.lists(st.floats(-10, 10), min_size=61, max_size=61), parameters)
def test_control_points_on_a_line_give_that_line(
    degree: int, gamma: tuple[float, float], places: list[float], t: float
) -> None:
    direction = np.array([2.0, -1.0, 0.5])
    point = Curve(np.outer(places[: degree + 1], direction), gamma).evaluate(t)
    assert np.linalg.norm(np.cross(point, direction)) <= 1e-13
    along = point[0] / 2
    assert min(places[: degree + 1]) - 1e-13 <= along <= max(places[: degree + 1]) + 1e-13


@given(st.integers(3, MAX_DEGREE), any_gamma, parameters)
def test_recursion(degree: int, gamma: tuple[float, float], t: float) -> None:
    s, c = math.sin(math.pi / 2 * t), math.sin(math.pi / 2 * (1 - t))
    first, last = (1 - s) * (1 - gamma[0] * s), (1 - c) * (1 - gamma[1] * c)
    row = np.array([first, 1 - first - last, last])
    for _ in range(degree - 2):
        row = (1 - t) * np.append(row, 0) + t * np.append(0, row)
    assert abs(Basis(degree, gamma).evaluate(t) - row).sum() <= 5e-14


@given(st.integers(3, MAX_DEGREE), any_gamma, parameters)
def test_each_degree_follows_from_the_one_below(degree: int, gamma: tuple[float, float], t: float) -> None:
    below = Basis(degree - 1, gamma).evaluate(t)
    row = (1 - t) * np.append(below, 0) + t * np.append(0, below)
    assert abs(Basis(degree, gamma).evaluate(t) - row).sum() <= 2 * Basis(degree, gamma).rounding


# Refusals


@pytest.mark.parametrize("gamma", [(1.25, 0), (0, -1.0000001), (math.nan, 0), (0, math.inf), (0,), (0, 0, 0)])
def test_refuses_design_variables_outside(gamma: tuple[float, ...]) -> None:
    with pytest.raises(InputError, match="gamma"):
        Basis(3, gamma)


def test_refusal_names_the_variable_and_its_range() -> None:
    with pytest.raises(InputError, match=r"gamma\[0\] must lie in \[-1, 1\], got 1\.25"):
        Basis(3, (1.25, 0))


def test_the_convex_hull_property_fails_outside() -> None:
    g = 1.25  # what is refused: f_02 = (1 - s)(1 - g s) turns negative where s > 1/g
    s = 0.9
    assert (1 - s) * (1 - g * s) < 0


@pytest.mark.parametrize("degree", [1, 61, -1, 2.5, True, math.nan, math.inf])
def test_refuses_degrees(degree: float) -> None:
    with pytest.raises(InputError, match="degree"):
        Basis(degree)


@pytest.mark.parametrize("degree", [0, 61, False])
def test_refuses_degrees_of_the_bernstein_family(degree: int) -> None:
    with pytest.raises(InputError, match="degree"):
        Basis(degree, family=BERNSTEIN)


def test_the_bernstein_family_takes_no_design_variables() -> None:
    with pytest.raises(InputError, match="takes no design variables"):
        Basis(3, (0.1, 0), BERNSTEIN)


@pytest.mark.parametrize("t", [-1e-6, 1.1, math.nan, math.inf, [0.5, 2.0]])
def test_refuses_parameters_outside(t: object) -> None:
    with pytest.raises(InputError, match="t must lie in"):
        Basis(3).evaluate(t)


def test_lets_parameters_leave_by_rounding() -> None:
    assert abs(Basis(5).evaluate(1 + 1e-15) - [0, 0, 0, 0, 0, 1]).max() <= 1e-14
    assert checked_parameters("t", -1e-13) == -1e-13


@pytest.mark.parametrize("order", [-1, 0.5, math.nan, math.inf])
def test_refuses_orders(order: float) -> None:
    with pytest.raises(InputError, match="order"):
        Basis(3).derivative(0.5, order)


# Families


def test_families_have_names() -> None:
    assert {"GT": GT, "bernstein": BERNSTEIN} == FAMILIES
    assert family_named("GT") is GT
    with pytest.raises(InputError, match="GT, bernstein"):
        family_named("NURBS")


@pytest.mark.parametrize("family", [GT, BERNSTEIN])
def test_families_are_one_object_each_after_pickling(family: Family) -> None:
    assert pickle.loads(pickle.dumps(family)) is family
    assert family.name in repr(family)


def test_equal_bases_have_equal_keys() -> None:
    assert Basis(3, (-0.0, 0.0)).key == Basis(3).key
    assert Basis(3, (0.0, 0.1)).key != Basis(3).key
    assert Basis(3, family=BERNSTEIN).key != Basis(3).key
    assert Basis(4, (0.5, 0.25)) == pickle.loads(pickle.dumps(Basis(4, (0.5, 0.25))))


@given(st.integers(1, MAX_DEGREE), parameters)
def test_bernstein_values(degree: int, t: float) -> None:
    expected = [math.comb(degree, i) * t**i * (1 - t) ** (degree - i) for i in range(degree + 1)]
    basis = Basis(degree, family=BERNSTEIN)
    assert abs(basis.evaluate(t) - expected).sum() <= 3e-14
    assert basis.evaluate(t).min() >= 0


@given(st.integers(1, 12), parameters, st.integers(0, 5))
def test_bernstein_derivatives_against_scipy(degree: int, t: float, order: int) -> None:
    unit = BPoly(np.eye(degree + 1)[:, None, :], [0, 1])
    row = Basis(degree, family=BERNSTEIN).derivative(t, order)
    largest = math.perm(degree, min(order, degree)) * 2.0**order
    assert abs(row - unit.derivative(order)(t) if order else row - unit(t)).max() <= 1e-14 * largest


def test_bernstein_degree_one() -> None:
    basis = Basis(1, family=BERNSTEIN)
    assert basis.evaluate(0.25).tolist() == [0.75, 0.25]
    assert basis.derivative(0.25).tolist() == [-1.0, 1.0]
    assert basis.derivative(0.25, 2).tolist() == [0.0, 0.0]


# Accuracy, against many digits


@pytest.mark.parametrize("degree", [2, 3, 7, 13, 31, 60])
@pytest.mark.parametrize("family", [GT, BERNSTEIN], ids=["GT", "bernstein"])
def test_derivatives_of_every_order(degree: int, family: Family) -> None:
    random = np.random.default_rng(degree)
    for t in (0.0, 1.0, *random.uniform(size=4)):
        gamma = tuple(random.uniform(-1, 1, 2)) if family.takes_gamma else (0.0, 0.0)
        expected = reference.derivatives(family.name, degree, gamma, t, 8)
        basis = Basis(degree, gamma, family)
        for order, row in enumerate(expected):
            bound = 1e-13 if order <= 4 or degree <= 13 else 4e-12
            assert abs(basis.derivative(t, order) - row).max() <= bound * abs(row).max()


@given(degrees, any_gamma, parameters)
def test_rounding_is_bounded(degree: int, gamma: tuple[float, float], t: float) -> None:
    basis = Basis(degree, gamma)
    with mp.workdps(reference.DIGITS):
        exact = reference.values("GT", degree, gamma, t)
        error = mp.fsum(abs(mp.mpf(float(x)) - y) for x, y in zip(basis.evaluate(t), exact, strict=True))
    assert error <= basis.rounding
    assert basis.evaluate(t).sum() <= basis.derivative_bound(0) + basis.rounding


@given(st.integers(1, MAX_DEGREE), parameters)
def test_rounding_of_the_bernstein_family_is_bounded(degree: int, t: float) -> None:
    basis = Basis(degree, family=BERNSTEIN)
    with mp.workdps(reference.DIGITS):
        exact = reference.values("bernstein", degree, (), t)
        error = mp.fsum(abs(mp.mpf(float(x)) - y) for x, y in zip(basis.evaluate(t), exact, strict=True))
    assert error <= basis.rounding


@pytest.mark.parametrize(("degree", "gamma"), [(2, (0.3, -0.7)), (3, (1.0, -1.0)), (7, (-1.0, -1.0)), (60, (0.5, 1.0))])
def test_gram_matrices(degree: int, gamma: tuple[float, float]) -> None:
    with mp.workdps(reference.DIGITS):
        nodes = GaussLegendre(mp.mp).calc_nodes(6, mp.mp.prec)  # 96 of them
        rows = [reference.derivatives("GT", degree, gamma, (x + 1) / 2, 2) for x, _ in nodes]
        weights = np.array([float(w) / 2 for _, w in nodes])
    basis = Basis(degree, gamma)
    for a, b in ((0, 0), (1, 1), (2, 0), (1, 0), (2, 2)):
        expected = np.einsum("q,qi,qk->ik", weights, np.array([r[a] for r in rows]), np.array([r[b] for r in rows]))
        assert abs(basis.gram(a, b) - expected).max() <= 1e-13 * abs(expected).max()


def test_gram_matrix_by_hand() -> None:
    # n = 2, gamma = 0: int (1 - sin)^2 = 1 - 4/pi + 1/2
    gram = Basis(2).gram()
    assert gram[0, 0] == pytest.approx(1.5 - 4 / math.pi, rel=1e-15)
    assert abs(gram - gram.T).max() == 0
    assert gram.sum() == pytest.approx(1, rel=1e-15)


# Arrays of parameters


@pytest.mark.parametrize("shape", [(), (0,), (5,), (3, 4), (2, 0, 3), (1, 2, 3)])
@pytest.mark.parametrize("family", [GT, BERNSTEIN], ids=["GT", "bernstein"])
def test_shapes(shape: tuple[int, ...], family: Family) -> None:
    t = np.random.default_rng(0).uniform(size=shape)
    basis = Basis(4, family=family)
    for order in (0, 1, 3):
        rows = basis.derivative(t, order)
        assert rows.shape == (*shape, 5)
        assert all(np.array_equal(rows[k], basis.derivative(t[k], order)) for k in np.ndindex(shape))


def test_takes_lists_and_leaves_arrays_alone() -> None:
    t = np.linspace(0, 1, 7)
    kept = t.copy()
    assert np.array_equal(Basis(3).derivative(t.tolist(), 2), Basis(3).derivative(t, 2))
    assert np.array_equal(t, kept)


@pytest.mark.parametrize(("degree", "order"), [(2, 0), (5, 0), (5, 2)])
def test_memory(degree: int, order: int) -> None:
    t = np.linspace(0, 1, 1_000_000)
    basis = Basis(degree, (0.2, -0.4))
    basis.derivative(t[:10], order)
    tracemalloc.start()
    try:
        rows = basis.derivative(t, order)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak <= 3 * rows.nbytes
