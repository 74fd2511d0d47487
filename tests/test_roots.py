from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import special

from gtcad.errors import InputError
from gtcad.roots import roots

PLACES = st.lists(st.integers(0, 40), min_size=1, max_size=6, unique=True).map(lambda ks: np.sort(ks) / 40)


def product(zeros, powers=1):
    return lambda x: np.prod((x[:, None] - zeros) ** powers, axis=1)


@given(PLACES)
def test_the_zeros_of_a_polynomial_are_found_ends_included(zeros):
    found = roots(product(zeros))
    assert found.shape == zeros.shape
    assert np.abs(found - zeros).max() <= 1e-9


@given(PLACES, st.lists(st.sampled_from([1, 2, 3]), min_size=6, max_size=6))
def test_zeros_of_any_multiplicity_are_found_once(zeros, powers):
    zeros = zeros[:: max(1, len(zeros) // 2)][:2]
    found = roots(product(zeros, np.array(powers[: len(zeros)])))
    assert found.shape == zeros.shape
    assert np.abs(found - zeros).max() <= 1e-3


@given(PLACES, st.integers(1, 39))
def test_breaks_change_nothing(zeros, place):
    assert np.allclose(roots(product(zeros), breaks=(0, place / 40, 1)), zeros, rtol=0, atol=1e-9)


def test_many_zeros_of_a_transcendental_function():
    assert np.abs(roots(special.j0, breaks=(0, 300)) - special.jn_zeros(0, 95)).max() <= 1e-11


def test_a_near_touch_is_told_from_a_touch():
    assert np.allclose(roots(lambda x: (x - 0.5) ** 2 - 1e-9) - 0.5, [-(1e-9**0.5), 1e-9**0.5], rtol=1e-5)
    assert roots(lambda x: (x - 0.5) ** 2 + 1e-9).size == 0
    assert np.abs(roots(lambda x: (x - 0.7) ** 2) - 0.7).max() <= 1e-7


def test_noise_says_what_counts_as_zero():
    assert roots(lambda x: (x - 0.5) ** 2 + 1e-9, noise=1e-8).size == 1
    assert roots(lambda x: np.full(x.size, 1e-9), noise=1e-8).size == 0
    assert roots(lambda x: 0 * x).size == 0


def test_a_kink_needs_a_break():
    assert np.allclose(roots(lambda x: np.abs(x - 0.3), breaks=(0, 0.3, 1)), [0.3], rtol=0, atol=1e-13)
    with pytest.raises(InputError, match=r"not resolved near 0\.3"):
        roots(lambda x: np.abs(x - 0.3))


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (lambda x: np.sign(x - 0.3), r"not resolved near 0\.3"),
        (lambda x: np.random.default_rng(0).random(x.size) - 0.5, "too noisy"),
        (lambda x: np.where(x > 0.5, np.nan, x), "must be finite"),
        (lambda x: np.stack([x, x]), "one value for each parameter"),
    ],
)
def test_what_is_no_analytic_function_is_refused(function, message):
    with pytest.raises(InputError, match=message):
        roots(function)


@pytest.mark.parametrize("breaks", [(0,), (1, 0), (0, 0), (0, np.inf), ((0, 1), (1, 2))])
def test_breaks_must_ascend(breaks):
    with pytest.raises(InputError, match="breaks must be"):
        roots(lambda x: x, breaks=breaks)
