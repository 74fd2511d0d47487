from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gtcad import Curve
from gtcad.basis import Basis
from gtcad.converters import fit_surface
from gtcad.differential import gaussian_curvature, mean_curvature, normal
from gtcad.errors import InputError
from gtcad.factors import CurveOfTerms, Waves
from gtcad.measure import area, volume
from gtcad.patches import Rotation
from tests.patches.kinds import HALF, QUARTER, RING, WAVE, line

U, V = np.meshgrid(np.linspace(0, 1, 41), np.linspace(0, 1, 61), indexing="ij")
ORIGIN, UP = [0.0, 0, 0], [0.0, 0, 1]


def test_the_sphere():
    sphere = Rotation(HALF, ORIGIN, UP)
    assert abs(np.linalg.norm(sphere.evaluate(U, V), axis=-1) - 20).max() <= 2e-14
    assert float(area(sphere)) == pytest.approx(4 * math.pi * 20**2, rel=1e-12)
    assert abs(float(volume(sphere))) == pytest.approx(4 / 3 * math.pi * 20**3, rel=1e-12)
    inner = (U[1:-1], V[1:-1])
    assert abs(gaussian_curvature(sphere, *inner) - 1 / 400).max() <= 1e-13
    assert abs(abs(mean_curvature(sphere, *inner)) - 1 / 20).max() <= 1e-13
    directions = sphere.evaluate(U, V) / 20
    assert abs(abs(np.einsum("uvd,uvd->uv", normal(sphere, U, V), directions)) - 1).max() <= 1e-9  # poles too


def test_the_torus():
    torus = Rotation(RING, ORIGIN, UP)
    x, y, z = np.moveaxis(torus.evaluate(U, V), -1, 0)
    assert abs((np.hypot(x, y) - 30) ** 2 + z**2 - 100).max() <= 1e-12
    assert float(area(torus)) == pytest.approx(4 * math.pi**2 * 30 * 10, rel=1e-12)
    assert abs(float(volume(torus))) == pytest.approx(2 * math.pi**2 * 30 * 100, rel=1e-12)


def test_the_patch_of_a_torus():
    ring = Curve([[4, 0, 0], [4, 0, 1], [3, 0, 1]])
    assert float(area(Rotation(ring, ORIGIN, UP, 90))) == pytest.approx(math.pi / 2 * (3 * math.pi / 2 + 1), rel=1e-13)


def test_a_line_askew_turns_into_a_hyperboloid():
    patch = Rotation(line([1, -3, -3], [1, 3, 3]), ORIGIN, UP)
    x, y, z = np.moveaxis(patch.evaluate(U, V), -1, 0)
    assert abs(x**2 + y**2 - z**2 - 1).max() <= 2e-14


@given(
    st.floats(-360, 360).filter(lambda a: abs(a) > 0.01),
    st.floats(-1000, 1000),
    st.lists(st.floats(-5, 5), min_size=6, max_size=6).filter(lambda x: np.linalg.norm(x[3:]) > 0.1),
)
def test_points_keep_their_distance_and_height_and_turn_evenly(angle, start, numbers):
    center, axis = np.array(numbers[:3]), np.array(numbers[3:])
    patch = Rotation(WAVE, center, axis, angle, start)
    k = axis / np.linalg.norm(axis)
    relative, before = patch.evaluate(U, V) - center, (WAVE.evaluate(U[:, 0]) - center)[:, None]
    assert abs(relative @ k - before @ k).max() <= 1e-12
    out, out_before = relative - (relative @ k)[..., None] * k, before - (before @ k)[..., None] * k
    assert abs(np.linalg.norm(out, axis=-1) - np.linalg.norm(out_before, axis=-1)).max() <= 1e-12
    turn = np.exp(1j * np.radians(start + angle * V))
    assert abs(out - out_before * turn.real[..., None] - np.cross(k, out_before) * turn.imag[..., None]).max() <= 5e-11


@pytest.mark.parametrize("profile", [HALF, RING, WAVE], ids=["half", "ring", "wave"])
def test_full_turns_close(profile):
    patch = Rotation(profile, [0.1, 0.2, 0.3] if profile is WAVE else ORIGIN, UP)
    assert abs(patch.evaluate(U[:, 0], 0.0) - patch.evaluate(U[:, 0], 1.0)).max() <= 1e-13
    fit = fit_surface(patch, tolerance=1e-4)
    assert np.array_equal(fit.spline.control_points[:, 0], fit.spline.control_points[:, -1])


def test_a_profile_on_the_axis_collapses():
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    for sphere in (Rotation(HALF, ORIGIN, UP), Rotation(HALF, ORIGIN, UP).transformed(turn, [70, 80, 90])):
        poles = fit_surface(sphere, tolerance=1e-4).spline.control_points
        for row in (poles[0], poles[-1]):
            assert np.array_equal(row, np.tile(row[0], (len(row), 1)))


def test_the_spline_of_a_sphere_is_near_the_sphere():
    spline = fit_surface(Rotation(HALF, ORIGIN, UP), tolerance=1e-4).spline
    distances = np.linalg.norm(spline.evaluate(U[:, :1], V[:1]), axis=-1)
    assert abs(distances - 20).max() <= 1e-4


@pytest.mark.parametrize("angle", [90, -90, 37.5, -1.0])
def test_up_to_a_quarter_turn_there_is_an_exact_form(angle):
    patch = Rotation(QUARTER, [50, -9, 4], [1, 2, 0], angle, 12)
    fit = fit_surface(patch, tolerance=1e-6)
    assert fit.exact
    assert fit.spline.degree_v == 2
    waves = CurveOfTerms(Waves(0.0, math.radians(angle)), np.eye(3))
    functions = np.linalg.lstsq(waves.evaluate(V[0]), patch.factors_v.rows(V[0]).T, rcond=None)[0]
    assert abs(waves.evaluate(V[0]) @ functions - patch.factors_v.rows(V[0]).T).max() <= 1e-14


@pytest.mark.parametrize(("angle", "count"), [(360, 4), (-270, 3), (90, 1), (90.5, 2), (-200, 3), (45, 1)])
def test_quarters(angle, count):
    whole = Rotation(WAVE, [1, 2, 3], [0, 1, 1], angle, 30)
    parts = whole.quarters()
    assert len(parts) == count
    assert all(abs(part.angle_deg) <= 90 for part in parts)
    t = np.linspace(0, 1, 9)
    for k, part in enumerate(parts):
        assert abs(part.evaluate(t[:, None], t) - whole.evaluate(t[:, None], (k + t) / count)).max() <= 1e-13


def test_quarters_of_a_turn_share_their_edges_to_the_last_bit():
    parts = Rotation(WAVE, [1, 2, 3], [0, 1, 1], 360, -90).quarters()
    for part, following in zip(parts, parts[1:] + parts[:1], strict=True):
        assert part.factors_v == Basis(2)
        assert np.array_equal(part.coefficients[:, 2], following.coefficients[:, 0])


def test_similar_images_are_rotations_without_a_placement():
    patch = Rotation(WAVE, [1, 2, 3], [0, 1, 2], 200, 30)
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    for matrix in (3 * turn, -0.5 * turn, 25.4 * np.eye(3)):
        moved = patch.transformed(matrix, [5, 6, 7])
        assert moved.placement is None
        expected = patch.evaluate(U, V) @ matrix.T + [5, 6, 7]
        assert abs(moved.evaluate(U, V) - expected).max() <= 1e-15 * abs(expected).max() * 4
    assert patch.transformed(np.diag([1, 2, 1])).placement is not None
    assert patch.transformed(np.zeros((3, 3))).evaluate(0.3, 0.4).tolist() == [0, 0, 0]


def test_the_length_of_the_axis_does_not_matter():
    short, long = (Rotation(WAVE, ORIGIN, [0, 0, k], 100) for k in (1e-200, 1e200))
    assert np.array_equal(short.evaluate(U, V), long.evaluate(U, V))


def test_plane_profiles_lie_at_z_0():
    patch = Rotation(Curve([[2, 0], [3, 1], [2, 4]]), ORIGIN, [0, 1, 0], 180)
    assert patch.evaluate(1.0, [0.0, 0.5, 1.0]).round(14).tolist() == [[2, 4, 0], [0, 4, -2], [-2, 4, 0]]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((None, ORIGIN, UP), "profile must be a curve, got NoneType"),
        ((WAVE, [0, 0], UP), r"axis_point must be three finite numbers, got \[0, 0\]"),
        ((WAVE, ORIGIN, [0, 0, 0]), "axis_direction must not be zero"),
        ((WAVE, ORIGIN, UP, 0), r"angle_deg must lie in \[-360, 360\] and not be 0, got 0"),
        ((WAVE, ORIGIN, UP, 361), r"angle_deg must lie in \[-360, 360\] and not be 0, got 361"),
        ((WAVE, ORIGIN, UP, math.nan), "angle_deg must be a finite number, got nan"),
        ((WAVE, ORIGIN, UP, 90, None), "start_deg must be a finite number, got None"),
        ((WAVE, ORIGIN, UP, 90, 0, [1, 2]), "placement must be rows"),
    ],
)
def test_bad_input(arguments, message):
    with pytest.raises(InputError, match=message):
        Rotation(*arguments)
