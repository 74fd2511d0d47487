from __future__ import annotations

import math

import numpy as np
import pytest

from gtcad import BERNSTEIN, Curve, Surface
from gtcad.converters import fit_surface
from gtcad.errors import InputError
from gtcad.factors import CurveOfTerms
from gtcad.measure import area
from gtcad.patches import Swept
from tests.patches.kinds import HALF, RAIL, WAVE, line
from tests.test_protocol import Turn

U, V = np.meshgrid(np.linspace(0, 1, 21), np.linspace(0, 1, 13), indexing="ij")


def test_it_is_the_tensor_product_of_sums_of_control_points():
    patch = Swept(WAVE, RAIL)
    net = WAVE.control_points[:, None] + RAIL.control_points
    expected = Surface(net, WAVE.gamma, RAIL.gamma)
    assert np.array_equal(patch.coefficients, net)
    assert np.array_equal(patch.evaluate(U, V), expected.evaluate(U, V))


def test_parabolas_sweep_a_paraboloid():
    along_x = Curve([[-1, 0, 1], [0, 0, -1], [1, 0, 1]], family=BERNSTEIN)
    along_y = Curve([[0, -2, 4], [0, 0, -4], [0, 2, 4]], family=BERNSTEIN)
    patch = Swept(along_x, along_y)
    x, y, z = np.moveaxis(patch.evaluate(U, V), -1, 0)
    assert abs(z - x**2 - y**2).max() <= 4e-15
    assert fit_surface(patch, tolerance=1e-6).exact


def test_a_half_circle_along_a_line():
    patch = Swept(HALF, line([0, 0, 0], [0, 30, 0]))
    x, y, z = np.moveaxis(patch.evaluate(U, V), -1, 0)
    assert abs(x**2 + z**2 - 400).max() <= 4e-13
    assert y == pytest.approx(30 * V, abs=1e-14)
    assert float(area(patch)) == pytest.approx(math.pi * 20 * 30, rel=1e-13)


def test_the_trajectory_counts_from_the_origin():
    t = U[:, 0]
    assert abs(Swept(WAVE, RAIL).boundary("v0").evaluate(t) - WAVE.evaluate(t)).max() <= 1e-13
    away = Swept(WAVE, RAIL.transformed(np.eye(3), [0, 0, 7]))
    assert abs(away.boundary("v0").evaluate(t) - WAVE.evaluate(t) - [0, 0, 7]).max() <= 1e-13


def test_factors_that_hold_no_constant():
    helix = CurveOfTerms(Turn(5.0), [[1.0, 0, 0], [0, 2, 0], [0, 0, 3]])
    for patch, a, b in ((Swept(helix, RAIL), helix, RAIL), (Swept(RAIL, helix), RAIL, helix)):
        assert abs(patch.evaluate(U, V) - a.evaluate(U) - b.evaluate(V)).max() <= 5e-14
        assert fit_surface(patch, tolerance=1e-4).deviation[1] <= 1e-4


def test_bad_input():
    with pytest.raises(InputError, match="trajectory must be a curve, got tuple"):
        Swept(WAVE, (0, 0, 1))
    with pytest.raises(InputError, match=r"profile and trajectory must have one dimension, got \[3, 2\]"):
        Swept(WAVE, line([0, 0], [1, 0]))
