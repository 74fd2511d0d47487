"""Where functions vanish: zeros between samples, at the ends, and beside each other."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gtcad.patches._singular import first_zero, zeros

PLACES = [0.0301, 0.30027, 0.5, 0.97]


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("half", [4e-4, 1e-4, 5e-5])
def test_numbers_that_change_sign_twice_between_samples(place: float, half: float) -> None:
    def dip(t: np.ndarray) -> np.ndarray:
        return (t - place) ** 2 - half**2

    assert first_zero(dip, 1.0) == pytest.approx(place - half, abs=1e-9)
    assert zeros(dip, 1.0)[0] == pytest.approx(place - half, abs=1e-9)
    assert first_zero(lambda t: -dip(t), 1.0) == pytest.approx(place - half, abs=1e-9)


@pytest.mark.parametrize("place", [0.0, *PLACES, 1.0])
def test_numbers_and_vectors_that_touch_zero(place: float) -> None:
    assert first_zero(lambda t: (t - place) ** 2, 1.0) == pytest.approx(place, abs=4e-5)
    assert first_zero(lambda t: np.column_stack([t - place, 0 * t]), 1.0) == pytest.approx(place, abs=1e-9)
    assert first_zero(lambda t: (t - place) ** 2 + 1e-7, 1.0) is None


@settings(max_examples=200, deadline=None)
@given(st.floats(0, 1), st.floats(-3, 3))
def test_vectors_that_vanish_anywhere(place: float, slope: float) -> None:
    def vectors(t: np.ndarray) -> np.ndarray:
        return np.column_stack([t - place, slope * (t - place) + (t - place) ** 2])

    assert first_zero(vectors, 1.0) == pytest.approx(place, abs=2e-9)
    assert first_zero(lambda t: vectors(t) + [0, 1e-4], 1.0) is None


def test_all_zeros_in_order() -> None:
    found = zeros(lambda t: np.sin(12 * t - 1), 1.0)
    assert found == pytest.approx([(1 + k * np.pi) / 12 for k in range(4)], abs=1e-14)
    far = zeros(lambda t: ((t - 0.2) * (t - 0.7)) ** 2, 1.0)
    assert far == pytest.approx([0.2, 0.7], abs=1e-4)
    assert first_zero(lambda t: ((t - 0.2) * (t - 0.7)) ** 2, 1.0) == far[0]
    assert zeros(lambda t: 0 * t, 1.0) == [0.0]
    assert zeros(lambda t: 1 + t, 1.0) == []
