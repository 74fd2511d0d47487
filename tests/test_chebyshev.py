from __future__ import annotations

import math

import mpmath as mp
import numpy as np
import pytest
from hypothesis import Phase, example, given, settings
from hypothesis import strategies as st
from numpy.polynomial import chebyshev
from scipy.special import jv

from gtcad.basis import BERNSTEIN, Basis
from gtcad.chebyshev import (
    UNIT_ROUNDOFF,
    Maximum,
    evaluation,
    gauss_legendre,
    interpolation_tail,
    lebesgue,
    maximum,
    nodes,
    transform,
)
from tests import reference

HALF_PI = math.pi / 2
EFFORT = settings.default.max_examples // 50  # 1, or 40 under stress


def jacobi_anger(frequency: float, phase: float, middle: float, half_width: float, count: int) -> np.ndarray:
    """Chebyshev coefficients of cos(w (m + h z) - phase), from Bessel functions."""
    k = np.arange(count)
    bessel = 2 * jv(k, frequency * half_width)
    bessel[0] /= 2
    even, odd = np.cos(k * HALF_PI).round(), np.sin(k * HALF_PI).round()  # cos: even terms, sin: odd terms
    angle = frequency * middle - phase
    return bessel * (even * math.cos(angle) - odd * math.sin(angle))


def exact_series(degree: int, gamma: tuple[float, float], middle: float, half_width: float, count: int) -> np.ndarray:
    """Chebyshev coefficients of f_0..f_n on a span, shape (n + 1, at least count): Bessel and polynomial products."""
    s, c = (jacobi_anger(HALF_PI, phase, middle, half_width, count) for phase in (HALF_PI, 0.0))
    double = jacobi_anger(math.pi, 0.0, middle, half_width, count)
    one = np.eye(1, count)[0]
    first = one - (1 + gamma[0]) * s + gamma[0] * (one - double) / 2
    last = one - (1 + gamma[1]) * c + gamma[1] * (one + double) / 2
    rows = [first, one - first - last, last]
    t = [middle, half_width]
    for _ in range(degree - 2):
        padded = [np.zeros(1), *rows, np.zeros(1)]
        rows = [
            chebyshev.chebadd(padded[i + 1], chebyshev.chebmul(t, chebyshev.chebsub(padded[i], padded[i + 1])))
            for i in range(len(rows) + 1)
        ]
    longest = max(len(row) for row in rows)
    return np.array([np.pad(row, (0, longest - len(row))) for row in rows])


@st.composite
def spans(draw: st.DrawFn) -> tuple[float, float]:
    """Middle and half width of a span in [0, 1], of any width from 1 to 1e-4."""
    width = 10.0 ** draw(st.floats(-4, 0))
    start = draw(st.floats(0, 1)) * (1 - width)
    return start + width / 2, width / 2


design_variables = st.one_of(st.floats(-1, 1), st.sampled_from([-1.0, 0.0, 1.0]))
gammas = st.tuples(design_variables, design_variables)


# Nodes, transform, constants


@pytest.mark.parametrize("count", [1, 2, 3, 8, 33, 100])
def test_nodes_are_the_zeros(count: int) -> None:
    z = nodes(count)
    assert (np.diff(z) > 0).all()
    assert abs(chebyshev.chebval(z, np.eye(1, count + 1, count)[0])).max() <= 1e-13 * count
    assert np.array_equal(z, -z[::-1])
    assert not z.flags.writeable


@pytest.mark.parametrize("count", [1, 2, 5, 20, 64])
def test_transform_inverts_evaluation(count: int) -> None:
    assert abs(transform(count) @ evaluation(count, count) - np.eye(count)).max() <= 1e-14
    wanted = chebyshev.chebvander(nodes(count), count + 2)
    assert abs(evaluation(count, count + 3) - wanted).max() <= 1e-13


@pytest.mark.parametrize("count", [1, 2, 3, 5, 10, 40, 100])
def test_lebesgue_constant_is_bounded(count: int) -> None:
    z = np.cos(np.linspace(0, math.pi, 4001))
    true = abs(chebyshev.chebvander(z, count - 1) @ transform(count)).sum(axis=1).max()
    assert true <= lebesgue(count) <= true + 0.1


@given(st.floats(1e-6, 6.0), st.integers(1, 40), st.floats(-10, 10))
def test_tail_bounds_the_interpolant_of_a_wave(argument: float, count: int, phase: float) -> None:
    z = np.linspace(-1, 1, 101)
    series = transform(count) @ np.cos(argument * nodes(count) - phase)
    error = abs(chebyshev.chebval(z, series) - np.cos(argument * z - phase)).max()
    assert error <= interpolation_tail(1.0, count, argument**count) + 1e-15 * count * lebesgue(count)


@pytest.mark.parametrize("count", [2, 5, 10, 20])
def test_tail_of_a_wave_is_the_first_term_of_its_bessel_series(count: int) -> None:
    first = 2 * jv(count, HALF_PI)
    assert first <= interpolation_tail(HALF_PI, count, 1.0) <= 1.8 * first


def test_tail_at_its_limits() -> None:
    assert interpolation_tail(0.5, 3, 0.0) == 0
    assert interpolation_tail(2.0, 1, 3.0) == pytest.approx(6.0)  # one node, in the middle: h max |f'|
    assert np.finfo(float).eps / 2 == UNIT_ROUNDOFF


@pytest.mark.parametrize("count", [1, 2, 3, 16, 74, 100])
def test_gauss_legendre_against_many_digits(count: int) -> None:
    x, weights = gauss_legendre(count)
    with mp.workdps(40):
        for k in {0, count // 2, count - 1}:
            root = mp.findroot(lambda t: mp.legendre(count, t), mp.mpf(float(x[k])))
            slope = mp.diff(lambda t: mp.legendre(count, t), root)
            assert abs(x[k] - root) <= 4e-16
            assert abs(weights[k] * (1 - root**2) * slope**2 / 2 - 1) <= 3e-13
    assert weights.sum() == pytest.approx(2.0, rel=1e-14)


# The interpolant of a basis on a span


def tail_of(basis: Basis, half_width: float, count: int) -> float:
    return interpolation_tail(half_width, count, basis.derivative_bound(count))


@given(st.integers(2, 13), gammas, spans())
def test_interpolant_has_the_exact_coefficients(
    degree: int, gamma: tuple[float, float], span: tuple[float, float]
) -> None:
    middle, half_width = span
    basis = Basis(degree, gamma)
    count = degree + 18
    series = basis.rows(np.clip(middle + half_width * nodes(count), 0, 1)) @ transform(count).T
    exact = exact_series(degree, gamma, middle, half_width, 40)
    difference = np.zeros_like(exact)
    difference[:, :count] = series
    difference -= exact
    bound = tail_of(basis, half_width, count) + lebesgue(count) * (basis.rounding + 1e-15)
    assert abs(difference).max() <= bound
    z = np.linspace(-1, 1, 50)
    assert abs(chebyshev.chebval(z, difference.T)).sum(axis=0).max() <= bound + 2e-14


def interpolation_error(
    basis: Basis, middle: float, half_width: float, count: int, places: list[float], *, rounded: bool
) -> float:
    """Largest sum_i |f_i - its interpolant| at the places, at many digits; of the computed or of the true values."""
    t = np.clip(middle + half_width * nodes(count), 0, 1)
    family, degree, gamma = basis.family.name, basis.degree, basis.gamma
    with mp.workdps(reference.DIGITS):
        if rounded:
            values = [[mp.mpf(float(x)) for x in column] for column in basis.rows(t).T]
        else:
            values = [reference.values(family, degree, gamma, x) for x in t]
        x_nodes = [mp.mpf(float(x)) for x in t]
        weights = [1 / mp.fprod(a - b for b in x_nodes if b != a) for a in x_nodes]
        largest = mp.mpf(0)
        for place in places:
            x = mp.mpf(float(middle + half_width * place))
            if x in x_nodes or not 0 <= x <= 1:
                continue
            parts = [w / (x - a) for w, a in zip(weights, x_nodes, strict=True)]
            total = mp.fsum(parts)
            true = reference.values(family, degree, gamma, x)
            error = mp.fsum(
                abs(mp.fdot(parts, [row[i] for row in values]) / total - true[i]) for i in range(degree + 1)
            )
            largest = max(largest, error)
        return float(largest)


@settings(max_examples=12 * EFFORT, phases=[Phase.explicit, Phase.generate])
@example(60, (1.0, -1.0), (0.5, 0.5), 6, 0.123)
@example(60, (0.3, 1.0), (0.99, 0.01), 4, 0.5)
@given(st.integers(2, 60), gammas, spans(), st.integers(4, 20), st.floats(-1, 1))
def test_tail_and_rounding_bound_the_error(
    degree: int, gamma: tuple[float, float], span: tuple[float, float], extra: int, place: float
) -> None:
    basis = Basis(degree, gamma)
    count = degree + extra
    tail = tail_of(basis, span[1], count) + 1e-45  # fifty digits do not see less
    assert interpolation_error(basis, *span, count, [-1.0, place], rounded=False) <= tail
    assert interpolation_error(basis, *span, count, [-1.0, place], rounded=True) <= tail + basis.rounding


@settings(max_examples=10 * EFFORT, phases=[Phase.explicit, Phase.generate])
@given(st.integers(1, 60), spans(), st.integers(1, 5), st.floats(-1, 1))
def test_the_bernstein_family_has_no_tail(degree: int, span: tuple[float, float], extra: int, place: float) -> None:
    basis = Basis(degree, family=BERNSTEIN)
    count = degree + extra
    assert tail_of(basis, span[1], count) == 0
    error = interpolation_error(basis, *span, count, [-1.0, place], rounded=True)
    assert error <= lebesgue(count) * basis.rounding


@pytest.mark.parametrize("degree", [2, 5, 13])
def test_tail_asks_for_few_more_nodes_than_needed(degree: int) -> None:
    basis = Basis(degree, (0.4, -0.7))
    places = np.linspace(-0.99, 0.99, 13).tolist()
    counts = range(degree + 4, degree + 20)
    bounded = next(count for count in counts if tail_of(basis, 0.5, count) <= 1e-12)
    needed = next(
        count for count in counts if interpolation_error(basis, 0.5, 0.5, count, places, rounded=False) <= 1e-12
    )
    assert needed <= bounded <= needed + 4


@pytest.mark.parametrize("half_width", [0.5, 0.1, 0.01])
@pytest.mark.parametrize("extra", [3, 6, 9])
def test_tail_at_degree_two_is_near_the_truth(half_width: float, extra: int) -> None:
    basis = Basis(2, (0.4, -0.7))
    places = np.linspace(-0.99, 0.99, 23).tolist()
    true = interpolation_error(basis, half_width, half_width, 2 + extra, places, rounded=False)
    assert tail_of(basis, half_width, 2 + extra) <= 200 * true  # nodes of one parity may do better by half a term


def test_terms_that_the_documentation_promises() -> None:
    for degree in (2, 13, 40, 60):
        for gamma in ((0.0, 0.0), (1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)):
            assert tail_of(Basis(degree, gamma), 0.5, 19 + degree) <= 1e-14


@given(st.integers(2, 60), gammas, st.integers(0, 6), st.floats(0, 1))
def test_derivatives_of_a_basis_are_bounded(degree: int, gamma: tuple[float, float], order: int, t: float) -> None:
    basis = Basis(degree, gamma)
    largest = abs(basis.derivative(t, order)).sum()
    assert largest <= basis.derivative_bound(order) * (1 + 1e-10) + 1e-13


# Rigorous maxima


def random_series(random: np.random.Generator, variables: int) -> np.ndarray:
    """A family of vector series with coefficients that decay or not, of any size, sometimes with single terms."""
    longest = 30 if variables == 1 else 10
    shape = (random.integers(1, 4), *random.integers(1, longest, variables), random.integers(1, 4))
    coefficients = random.standard_normal(shape)
    for axis in range(1, 1 + variables):
        decay = random.choice([1.0, random.uniform(0.2, 1)]) ** np.arange(shape[axis])
        coefficients *= decay.reshape([-1 if a == axis else 1 for a in range(coefficients.ndim)])
    if random.uniform() < 0.1:
        single = np.zeros_like(coefficients)
        place = tuple(random.integers(size) for size in shape[:-1])
        single[place] = coefficients[place]
        coefficients = single
    return coefficients * 10.0 ** random.uniform(-12, 6)


def norms_at(coefficients: np.ndarray, *z: np.ndarray) -> np.ndarray:
    """|q_b| on the grid of the z, shape (B, z.size) or (B, z.size, z.size)."""
    tables = [chebyshev.chebvander(x, size - 1) for x, size in zip(z, coefficients.shape[1:-1], strict=True)]
    if len(z) == 1:
        values = np.einsum("pk,bkd->bpd", tables[0], coefficients, optimize=True)
    else:
        values = np.einsum("pk,ql,bkld->bpqd", *tables, coefficients, optimize=True)
    return np.linalg.norm(values, axis=-1)


def assert_holds(coefficients: np.ndarray, samples: np.ndarray, rtol: float) -> Maximum:
    found = maximum(coefficients, rtol=rtol)
    variables = coefficients.ndim - 2
    dense = norms_at(coefficients, *[samples] * variables).max()
    at_place = norms_at(coefficients, *(np.array([z]) for z in found.place))[found.index].item()
    assert len(found.place) == variables
    assert all(-1 <= z <= 1 for z in found.place)
    assert found.lower * (1 - 1e-12) <= at_place <= found.lower * (1 + rtol)
    assert dense * (1 - 1e-12) <= found.upper
    assert found.lower <= found.upper <= (1 + rtol) * found.lower * (1 + 1e-11)
    return found


@pytest.mark.stress
def test_maximum_of_very_many_series() -> None:
    random = np.random.default_rng(19)
    samples = np.cos(np.linspace(0, math.pi, 301))
    for _ in range(30_000):
        assert_holds(random_series(random, 1), samples, 0.01)
    for _ in range(10_000):
        assert_holds(random_series(random, 2), samples[::4], 0.01)


def test_maximum_of_series_in_one_variable() -> None:
    random = np.random.default_rng(20)
    samples = np.cos(np.linspace(0, math.pi, 1001))
    for _ in range(2000):
        assert_holds(random_series(random, 1), samples, 0.01)


def test_maximum_of_series_in_two_variables() -> None:
    random = np.random.default_rng(21)
    samples = np.cos(np.linspace(0, math.pi, 81))
    for _ in range(1000):
        assert_holds(random_series(random, 2), samples, 0.01)


@pytest.mark.parametrize("rtol", [0.3, 0.05, 0.001])
def test_maximum_to_other_accuracies(rtol: float) -> None:
    random = np.random.default_rng(22)
    samples = np.cos(np.linspace(0, math.pi, 501))
    for _ in range(60):
        assert_holds(random_series(random, 1), samples, rtol)


@pytest.mark.parametrize("degree", [0, 1, 2, 7, 30])
def test_maximum_of_a_single_polynomial(degree: int) -> None:
    coefficients = np.zeros((1, 31, 1))
    coefficients[0, degree, 0] = -2.5
    found = maximum(coefficients)
    assert found.lower <= 2.5 <= found.upper <= 1.01 * 2.5
    assert found.lower >= 2.5 / 1.01


def test_maximum_of_large_families() -> None:
    random = np.random.default_rng(23)
    coefficients = random.standard_normal((3000, 12, 3)) * 0.5 ** np.arange(12)[:, None]
    coefficients *= random.uniform(size=(3000, 1, 1))
    found = assert_holds(coefficients, np.cos(np.linspace(0, math.pi, 201)), 0.01)
    assert maximum(coefficients[[found.index]]).upper == pytest.approx(found.upper, rel=0.01)


@pytest.mark.parametrize("variables", [1, 2])
def test_maximum_from_a_known_sample(variables: int) -> None:
    """A sample that is known spares work, but neither bound may lean on it."""
    random = np.random.default_rng(25)
    samples = np.cos(np.linspace(0, math.pi, 81))
    for _ in range(100):
        coefficients = random_series(random, variables)
        start = norms_at(coefficients, *[np.array([0.3])] * variables).reshape(-1)
        index = int(start.argmax())
        known = Maximum(float(start[index]), 0.0, index, (0.3,) * variables)
        found = maximum(coefficients, known=known)
        dense = norms_at(coefficients, *[samples] * variables).max()
        assert dense * (1 - 1e-12) <= found.upper <= 1.01 * found.lower * (1 + 1e-11)
        at_place = norms_at(coefficients, *(np.array([z]) for z in found.place))[found.index].item()
        assert found.lower * (1 - 1e-12) <= at_place


@pytest.mark.parametrize("variables", [1, 2])
def test_bounds_above_the_limit_are_bounds(variables: int) -> None:
    random = np.random.default_rng(26)
    samples = np.cos(np.linspace(0, math.pi, 81))
    for _ in range(100):
        coefficients = random_series(random, variables)
        dense = norms_at(coefficients, *[samples] * variables).max()
        found = maximum(coefficients, limit=random.uniform(0, 2) * dense)
        assert dense * (1 - 1e-12) <= found.upper
        assert found.lower <= found.upper


def test_maximum_leaves_its_argument_alone() -> None:
    coefficients = np.random.default_rng(24).standard_normal((3, 9, 2))
    kept = coefficients.copy()
    assert maximum(coefficients) == maximum(coefficients)
    assert np.array_equal(coefficients, kept)


@pytest.mark.parametrize("shape", [(1, 1, 1), (2, 5, 3), (2, 3, 4, 3)])
def test_maximum_of_zero(shape: tuple[int, ...]) -> None:
    found = maximum(np.zeros(shape))
    assert (found.lower, found.upper) == (0, 0)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_maximum_never_proves_what_is_not_finite(bad: float) -> None:
    coefficients = np.ones((2, 4, 3))
    coefficients[1, 2, 0] = bad
    with np.errstate(invalid="ignore"):
        assert not maximum(coefficients).upper <= 1e300
