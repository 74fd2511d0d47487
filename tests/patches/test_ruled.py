from __future__ import annotations

import math

import numpy as np
import pytest

from gtcad import BERNSTEIN, Curve
from gtcad.converters import fit_surface
from gtcad.differential import gaussian_curvature, mean_curvature
from gtcad.errors import InputError
from gtcad.measure import area
from gtcad.patches import Ruled, cone, cylinder
from tests.patches.kinds import HALF, OTHER, QUARTER, WAVE, line

U, V = np.meshgrid(np.linspace(0, 1, 21), np.linspace(0, 1, 13), indexing="ij")
T = U[:, 0]


def developability(patch):
    """det(a', b', b - a) over the product of the largest lengths: 0 where normals are constant along the rulings."""
    vectors = [patch.derivative(T, 0.0), patch.derivative(T, 1.0), patch.derivative(T, 0.0, (0, 1))]
    sizes = [np.linalg.norm(vector, axis=1).max() for vector in (vectors[0], vectors[0], vectors[2])]
    return abs(np.linalg.det(np.stack(vectors, axis=1))).max() / np.prod(sizes)


def test_lines_that_cross_span_a_hyperbolic_paraboloid():
    patch = Ruled(line([0, 0, 0], [4, 0, 0]), line([0, 6, 0], [4, 6, 2]))
    x, y, z = np.moveaxis(patch.evaluate(U, V), -1, 0)
    assert abs(z - x * y / 12).max() <= 1e-15
    fit = fit_surface(patch, tolerance=1e-6)
    assert fit.exact
    assert fit.spline.control_points.shape == (2, 2, 3)
    assert developability(patch) > 0.01


def test_rulings_are_straight_and_boundaries_the_curves():
    patch = Ruled(WAVE, OTHER)
    assert not patch.derivative(U, V, (0, 2)).any()
    assert not patch.derivative(U, V, (1, 2)).any()
    assert np.array_equal(patch.boundary("v0").evaluate(T), WAVE.evaluate(T))
    assert np.array_equal(patch.boundary("v1").evaluate(T), OTHER.evaluate(T))
    assert patch.boundary("v0").factors == WAVE.factors
    assert patch.boundary("v1").factors == OTHER.factors


def test_curves_of_one_kind_share_their_factors():
    assert Ruled(WAVE, WAVE.transformed(np.eye(3), [0, 0, 9])).factors_u == WAVE.factors
    assert Ruled(WAVE, OTHER).factors_u.count == 4 + 3


def test_a_circular_cylinder():
    patch = cylinder(Curve([[2, 0], [2, 2], [0, 2]]), [0, 0, 5])
    x, y, z = np.moveaxis(patch.evaluate(U, V), -1, 0)
    assert abs(x**2 + y**2 - 4).max() <= 4e-15
    assert abs(z - 5 * V).max() <= 2e-15
    assert float(area(patch)) == pytest.approx(5 * math.pi, rel=1e-13)
    assert abs(gaussian_curvature(patch, U, V)).max() <= 1e-14
    assert abs(abs(mean_curvature(patch, U, V)) - 1 / 4).max() <= 1e-13
    fit = fit_surface(patch, tolerance=1e-6)
    assert fit.exact
    x, y, _ = np.moveaxis(fit.spline.evaluate(U[:, :1], V[:1]), -1, 0)
    assert abs(x**2 + y**2 - 4).max() <= 1e-14


@pytest.mark.parametrize("range_", [(0.0, 1.0), (0.0, 0.5), (1.0, 0.25), (-0.5, 0.5), (1.0, 2.0)])
def test_a_circular_cone(range_):
    patch = cone(Curve([[2, 0], [2, 2], [0, 2]]), [0, 0, 6], range_)
    x, y, z = np.moveaxis(patch.evaluate(U, V), -1, 0)
    assert abs(x**2 + y**2 - 4 * (1 - z / 6) ** 2).max() <= 2e-14
    assert z.ravel()[[0, -1]] == pytest.approx([6 * w for w in range_], abs=1e-14)
    slant = math.hypot(2, 6)
    share = abs((1 - range_[0]) ** 2 - (1 - range_[1]) ** 2)
    assert float(area(patch)) == pytest.approx(math.pi / 2 * slant * share, rel=1e-12)
    assert fit_surface(patch, tolerance=1e-6).exact


def test_the_apex_is_one_point():
    patch = cone(WAVE, [50, 0, 80])
    assert abs(patch.evaluate(T, 1.0) - [50, 0, 80]).max() <= 3e-14
    fit = fit_surface(patch, tolerance=1e-4)
    assert np.array_equal(fit.spline.control_points[:, -1], np.tile(fit.spline.control_points[0, -1], (9, 1)))


@pytest.mark.parametrize("curve", [WAVE, QUARTER, HALF], ids=["GT", "quarter", "half circle"])
def test_cylinders_and_cones_are_developable(curve):
    for patch in (cylinder(curve, [3, 5, 50]), cone(curve, [9, 30, 80]), cone(curve, [9, 30, 80], (0.2, 0.9))):
        assert developability(patch) <= 1e-14
    turned = curve.transformed([[0, 1, 0], [0, 0, 1], [1, 0, 0]], [0, 0, 60])
    assert developability(Ruled(curve, turned)) > 0.01


def test_plane_curves_stay_plane_or_are_lifted():
    a, b = Curve([[0, 0], [1, 2], [3, 0]]), Curve([[0, 4], [3, 4]], family=BERNSTEIN)
    assert Ruled(a, b).dimension == 2
    assert Ruled(a, b).transformed(np.eye(3, 2), [0, 0, 1]).evaluate(1.0, 1.0).tolist() == [3, 4, 1]
    assert cylinder(a, [0, 0, 1]).dimension == cone(a, [0, 0, 1]).dimension == 3


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Ruled(WAVE, [[0, 0], [1, 1]]), "b must be a curve, got list"),
        (lambda: Ruled(None, WAVE), "a must be a curve, got NoneType"),
        (lambda: Ruled(WAVE, line([0, 0], [1, 0])), r"a and b must have one dimension, got \[3, 2\]"),
        (lambda: cylinder(None, [0, 0, 1]), "curve must be a curve, got NoneType"),
        (lambda: cylinder(WAVE, [0, 1]), r"vector must be three finite numbers, got \[0, 1\]"),
        (lambda: cylinder(WAVE, [0, math.nan, 1]), "vector must be three finite numbers"),
        (lambda: cylinder(WAVE, "up"), "vector must be three finite numbers, got 'up'"),
        (lambda: cylinder(WAVE, [0, 0, 0]), "vector must not be zero"),
        (lambda: cone(WAVE, [[0, 0, 0]]), "apex must be three finite numbers"),
        (lambda: cone(WAVE, [0, 0, 9], (0.5, 1.5)), r"not on both sides of the apex at 1, got \(0.5, 1.5\)"),
        (lambda: cone(WAVE, [0, 0, 9], (0.5, 0.5)), "range must be two different numbers"),
        (lambda: cone(WAVE, [0, 0, 9], 0.5), "range must be two numbers, got 0.5"),
        (lambda: cone(WAVE, [0, 0, 9], (0.5, math.inf)), r"range\[1\] must be a finite number, got inf"),
        (lambda: cone(WAVE, [0, 0, 9], ("a", 1)), r"range\[0\] must be a finite number, got 'a'"),
    ],
)
def test_bad_input(make, message):
    with pytest.raises(InputError, match=message):
        make()
