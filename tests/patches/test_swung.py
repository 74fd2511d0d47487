from __future__ import annotations

import math

import numpy as np
import pytest

from gtcad import Curve, Surface
from gtcad.converters import fit_surface
from gtcad.errors import InputError
from gtcad.factors import CurveOfTerms
from gtcad.measure import area
from gtcad.patches import Rotation, Swung
from tests.patches.kinds import PROFILE, TRAJECTORY
from tests.test_protocol import Turn

U, V = np.meshgrid(np.linspace(0, 1, 21), np.linspace(0, 1, 13), indexing="ij")
QUARTER = Curve([[1, 0], [1, 1], [0, 1]])


def test_it_is_a_tensor_product():
    patch = Swung(PROFILE, TRAJECTORY, 1.5)
    (x, z), (far, along) = PROFILE.control_points.T, TRAJECTORY.control_points.T
    net = np.stack([1.5 * np.outer(x, far), 1.5 * np.outer(x, along), np.tile(z[:, None], 3)], axis=-1)
    assert abs(patch.coefficients - net).max() <= 1e-14
    expected = Surface(net, PROFILE.gamma, TRAJECTORY.gamma)
    assert abs(patch.evaluate(U, V) - expected.evaluate(U, V)).max() <= 1e-13


def test_the_octant_of_a_sphere():
    octant = Swung(QUARTER, QUARTER)
    assert abs(np.linalg.norm(octant.evaluate(U, V), axis=-1) - 1).max() <= 1e-15
    assert float(area(octant)) == pytest.approx(math.pi / 2, rel=1e-12)
    assert fit_surface(octant, tolerance=1e-6).exact


def test_the_patch_of_a_torus():
    patch = Swung(Curve([[4, 0], [4, 1], [3, 1]]), QUARTER)
    x, y, z = np.moveaxis(patch.evaluate(U, V), -1, 0)
    assert abs((np.hypot(x, y) - 3) ** 2 + z**2 - 1).max() <= 4e-15
    assert float(area(patch)) == pytest.approx(math.pi / 2 * (3 * math.pi / 2 + 1), rel=1e-13)


def test_an_ellipsoid():
    patch = Swung(Curve([[1, 0], [1, 5], [0, 5]]), Curve([[2, 0], [2, 3], [0, 3]]), 2.0)
    x, y, z = np.moveaxis(patch.evaluate(U, V), -1, 0)
    assert abs((x / 4) ** 2 + (y / 6) ** 2 + (z / 5) ** 2 - 1).max() <= 4e-15


def test_a_circle_as_trajectory_rotates():
    swung = Swung(PROFILE, QUARTER)
    lifted = PROFILE.transformed([[1, 0], [0, 0], [0, 1]])
    assert abs(swung.evaluate(U, V) - Rotation(lifted, [0, 0, 0], [0, 0, 1], 90).evaluate(U, V)).max() <= 1e-13


def test_curves_in_space_must_lie_in_their_planes():
    profile = PROFILE.transformed([[1, 0], [0, 0], [0, 1]])
    trajectory = TRAJECTORY.transformed(np.eye(3, 2))
    assert Swung(profile, trajectory) == Swung(PROFILE, TRAJECTORY)
    with pytest.raises(InputError, match="profile must lie in the xz plane, got y up to 50"):
        Swung(PROFILE.transformed([[1, 0], [0, 0.625], [0, 1]]), trajectory)
    with pytest.raises(InputError, match=r"trajectory must lie in the xy plane, got z up to 0\.5"):
        Swung(profile, trajectory.transformed(np.eye(3), [0, 0, 0.5]))


def test_factors_that_hold_no_constant():
    spiral = CurveOfTerms(Turn(3.0), [[1.0, 0], [1, 1], [0, 2]])
    patch = Swung(PROFILE, spiral)
    (x, z), (far, along) = PROFILE.evaluate(U).transpose(2, 0, 1), spiral.evaluate(V).transpose(2, 0, 1)
    assert abs(patch.evaluate(U, V) - np.stack([x * far, x * along, z], axis=-1)).max() <= 1e-12


def test_placed():
    rows = [[0, 0, 1, 5], [1, 0, 0, 0], [0, 2, 0, 1]]
    patch, moved = Swung(PROFILE, TRAJECTORY), Swung(PROFILE, TRAJECTORY, placement=rows)
    x, y, z = np.moveaxis(patch.evaluate(U, V), -1, 0)
    assert abs(moved.evaluate(U, V) - np.stack([z + 5, x, 2 * y + 1], axis=-1)).max() <= 1e-13
    rows = np.array(rows)
    assert patch.transformed(rows[:, :3], rows[:, 3]) == moved
    assert moved.placement == ((0, 0, 1, 5), (1, 0, 0, 0), (0, 2, 0, 1))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"factor": 0}, "factor must not be 0"),
        ({"factor": math.nan}, "factor must be a finite number, got nan"),
        ({"factor": "big"}, "factor must be a finite number, got 'big'"),
        ({"placement": np.eye(3)}, r"placement must be rows \[matrix \| translation\], shape \(2 or 3, 4\)"),
        ({"placement": [[1, 2], [3]]}, "placement must be rows"),
        ({"placement": np.full((3, 4), math.inf)}, "placement must be rows"),
    ],
)
def test_bad_input(options, message):
    with pytest.raises(InputError, match=message):
        Swung(PROFILE, TRAJECTORY, **options)
    with pytest.raises(InputError, match="trajectory must be a curve, got NoneType"):
        Swung(PROFILE, None)
