from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from gtcad import BERNSTEIN, Curve, Restricted
from gtcad.composite import Composite
from gtcad.errors import InputError
from gtcad.flat_curves import FlatCurve, inside, localised, parameter_function, polynomial_curve, resolved_curve

Array = NDArray[np.float64]

T = np.linspace(0, 1, 101)


def spiral(t: Array) -> Array:
    """A logarithmic spiral: length sqrt(2) (e - 1) for radius e^t, angle t."""
    return np.exp(t)[:, None] * np.stack([np.cos(t), np.sin(t)], axis=1)


def spike(t: Array) -> Array:
    """A Runge function, which takes several spans."""
    return np.stack([t, 1 / (1 + 1e6 * (t - 0.3) ** 2)], axis=1)


def test_a_function_is_resolved_to_rounding() -> None:
    curve = resolved_curve(spiral, (0.0, 1.0), "the spiral", 0.0)
    np.testing.assert_allclose(curve.evaluate(T), spiral(T), atol=1e-14)
    first = np.stack([np.exp(T) * (np.cos(T) - np.sin(T)), np.exp(T) * (np.cos(T) + np.sin(T))], axis=1)
    np.testing.assert_allclose(curve.derivative(T), first, atol=1e-12)
    assert curve.length == pytest.approx(math.sqrt(2) * (math.e - 1), rel=1e-14)
    assert len(curve.pieces) == 1
    assert not curve.closed
    assert curve.error < 1e-12


def test_what_needs_several_spans_gets_them() -> None:
    curve = resolved_curve(spike, (0.0, 1.0), "the spike", 0.0)
    assert len(curve.pieces) > 1
    assert (curve.breaks[0], curve.breaks[-1]) == (0.0, 1.0)
    np.testing.assert_allclose(curve.evaluate(T), spike(T), atol=1e-11)
    x = T - 0.3
    np.testing.assert_allclose(curve.derivative(T)[:, 1], -2e6 * x / (1 + 1e6 * x**2) ** 2, atol=1e-6)


@pytest.mark.parametrize("function", [spiral, spike])
def test_backwards_and_moved(function: object) -> None:
    curve = resolved_curve(function, (0.0, 0.25, 1.0), "it", 1e-12)  # type: ignore[arg-type]
    np.testing.assert_allclose(curve.reversed().evaluate(T), curve.evaluate(1 - T), atol=1e-13)
    np.testing.assert_allclose(curve.reversed().derivative(T), -curve.derivative(1 - T), atol=1e-6)
    matrix = np.array([[0.0, -2.0], [2.0, 0.0]])
    moved = curve.transformed(matrix, [1, 2])
    np.testing.assert_allclose(moved.evaluate(T), curve.evaluate(T) @ matrix.T + [1, 2], atol=1e-13)
    assert moved.error == pytest.approx(2 * curve.error)
    assert curve.extent == pytest.approx(np.ptp(curve.evaluate(np.linspace(0, 1, 65)), axis=0).max())


def test_pieces_of_all_kinds_run_backwards() -> None:
    bow = Curve([[0, 0], [1, 2], [3, 1]], (0.2, -0.4))
    curve = FlatCurve(
        (bow, Restricted(bow, (1.0, 0.25)), polynomial_curve(np.array([[1.0, 2, 3], [0, 1, 0]]))), (0, 0.3, 0.6, 1)
    )
    inner = T[(T % 0.1 > 0.01) & (T % 0.1 < 0.09)]
    np.testing.assert_allclose(curve.reversed().evaluate(inner), curve.evaluate(1 - inner), atol=1e-13)


def test_spans_are_found() -> None:
    place, local = localised(np.array([0.0, 0.1, 0.25, 0.9, 1.0]), (0.0, 0.25, 1.0))
    assert place.tolist() == [0, 0, 1, 1, 1]
    np.testing.assert_allclose(local, [0, 0.4, 0, 0.65 / 0.75, 1], atol=1e-15)


def test_curves_of_all_kinds_become_functions() -> None:
    line = Curve([[0, 0], [1, 1]], family=BERNSTEIN)
    chain = Composite((line, Curve([[1, 1], [1, 0]], family=BERNSTEIN)), ("C0",))
    function, breaks, _ = parameter_function(chain)
    assert breaks == (0.0, 0.5, 1.0)
    np.testing.assert_allclose(function(np.array([0.25, 0.75])), [[0.5, 0.5], [1, 0.5]])
    carried = resolved_curve(spike, (0.0, 1.0), "the spike", 1e-9)
    function, breaks, error = parameter_function(carried)
    assert (breaks, error) == (carried.breaks, carried.error)
    assert parameter_function(spiral)[0] is spiral


def test_parameters_outside_are_refused() -> None:
    curve = resolved_curve(spiral, (0.0, 1.0), "the spiral", 0.0)
    with pytest.raises(InputError, match="t must lie"):
        curve.evaluate(1.1)
    with pytest.raises(InputError, match="order"):
        curve.derivative(0.5, -1)
    np.testing.assert_array_equal(inside([[-1e-14, 1 + 1e-14]]), [[0, 1]])
    with pytest.raises(InputError, match="leaves the patch"):
        inside([[0.5, 1.1]])


def test_values_that_are_none_are_refused() -> None:
    with pytest.raises(InputError, match=r"the pole must be finite, it is not near t = 0\.0"):
        resolved_curve(lambda t: np.stack([t, np.where(t < 0.5, np.inf, t)], axis=1), (0.0, 1.0), "the pole", 0.0)
    with pytest.raises(InputError, match=r"the step is not resolved near t = 0\.(25|24)"):
        resolved_curve(lambda t: np.stack([t, np.sign(t - 0.25001)], axis=1), (0.0, 1.0), "the step", 0.0)
