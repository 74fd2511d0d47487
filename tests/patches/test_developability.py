from __future__ import annotations

import math
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gtcad import BERNSTEIN, GT, Curve, Restricted, Surface
from gtcad.errors import InputError
from gtcad.patches import (
    QuasiDevelopable,
    Rotation,
    Ruled,
    cone,
    cylinder,
    developability,
    quasi_developable,
)
from tests.patches.developables import regular_patches
from tests.patches.kinds import OTHER, QUARTER, WAVE, line

T = np.linspace(0, 1, 201)
LOW = Curve([[1, 0, 0], [1, 1, 0], [0, 1, 0]])
HIGH = Curve([[1, 0, 1], [1, 1, 1], [0, 1, 1]], (-0.3, 0.6))


def sampled_twist(patch, t=T):
    """Largest angle between surface normals of one ruling."""
    v = np.linspace(0, 1, 11)
    normals = np.cross(*(patch.derivative(t[:, None], v, orders) for orders in ((1, 0), (0, 1))))
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    first, last = normals[:, 0], normals[:, -1]
    between = np.einsum("uvd,ud->uv", normals, first)
    assert (between >= np.einsum("ud,ud->u", first, last)[:, None] - 1e-12).all()  # the ends are farthest apart
    sine = np.linalg.norm(np.cross(first, last), axis=-1)
    return np.degrees(np.arctan2(sine, np.einsum("ud,ud->u", first, last))).max()


@pytest.mark.parametrize("size", [0.01, 1.0, 300.0])
def test_a_saddle_in_closed_form(size):
    # x y = size z: along the ruling at x the normal turns from (0, -x, size) to (-size, -x, size)
    saddle = Ruled(line([0, 0, 0], [size, 0, 0]), line([0, size, 0], [size, size, size]))
    report = developability(saddle)
    assert report.twist_deg == pytest.approx(45, abs=1e-12)
    assert report.twist_t == 0
    assert 45 <= report.twist_bound_deg <= 46
    # |det(a', b', b - a)| = size^3 at every t, |b'| = size sqrt 2, |b - a| = size sqrt(1 + t^2)
    assert report.determinant == pytest.approx(1 / math.sqrt(2), rel=1e-12)
    assert report.determinant_t == 0
    # a' x R = (0, -t, 1) and b' x R = (-1, -t, 1): their sum is least at v = 0, on the boundary
    assert report.regression_distance == pytest.approx(0, abs=1e-12)
    assert report.regular
    assert not report.by_definition


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10**6))
def test_the_twist_of_strips_is_that_of_samples(seed):
    rng = np.random.default_rng(seed)
    x = np.linspace(0, 60, 4)
    a, b = (np.column_stack([x, y + rng.normal(0, 2, 4), rng.normal(0, 6, 4)]) for y in (0, 30))
    strip = Ruled(Curve(a, rng.uniform(-0.5, 1, 2)), Curve(b, rng.uniform(-0.5, 1, 2)))
    report, found = developability(strip), sampled_twist(strip)
    assert report.regular
    assert found - 1e-9 <= report.twist_deg <= found * 1.01 + 1e-6
    assert report.twist_deg <= report.twist_bound_deg <= 1.3 * report.twist_deg + 1


def test_cylinders_and_cones():
    report = developability(cylinder(QUARTER, [10, 5, 50]))
    assert report.twist_bound_deg <= 1e-9
    assert report.regression_distance == math.inf
    assert report.regular
    whole = developability(cone(WAVE, [50, 0, 80]))
    assert (whole.twist_deg, whole.twist_bound_deg, whole.regression_distance) == (0, 0, 0)
    assert not whole.regular  # its apex
    part = cone(WAVE, [50, 0, 80], (0.0, 0.75))
    rest = np.linalg.norm(WAVE.evaluate(T) - [50, 0, 80], axis=1) / 4
    report = developability(part)
    assert report.regression_distance == pytest.approx(rest.min(), rel=1e-3)
    assert report.regression_distance <= rest.min()
    assert report.twist_bound_deg <= 1e-8


def test_a_patch_beyond_its_apex_is_crossed():
    base = Curve([[10, 0, 0], [10, 10, 0], [0, 10, 0]])
    crossed = Ruled(base, base.transformed(-np.eye(3), [0, 0, 40]))  # through (0, 0, 20)
    report = developability(crossed)
    assert report.regression_distance == pytest.approx(-math.hypot(10, 20), rel=1e-12)
    assert not report.regular
    assert report.twist_bound_deg == math.inf


def test_singular_rulings_are_found():
    bow = Ruled(line([-3, -1, 0], [2, 1, 0]), line([-3, 1, 0], [2, -1, 0]))  # no length in the middle
    assert developability(bow).singular_rulings == pytest.approx([0.5], abs=1e-12)
    power = np.array([[0.0, 0, 0], [0, 0, 0], [1, 0, 0]])  # x = t^2
    still = Curve(np.array([[1, 0, 0], [1, 0.5, 0], [1, 1, 1]]) @ power, family=BERNSTEIN)
    wall = cylinder(still, [0, 0, 5])
    assert developability(wall).singular_rulings == pytest.approx([0.0], abs=1e-9)
    assert not developability(wall).regular


def test_any_patch_that_is_linear_in_v_is_measured():
    patch = regular_patches(1)[0]
    part = Restricted(patch, ((0.2, 0.7), (0.9, 0.1)))
    report = developability(part)
    assert report.twist_bound_deg <= 1e-6
    assert report.regular
    surface = Surface([[[0, 0, 0], [0, 9, 0]], [[9, 0, 0], [9, 9, 5]]], family_u=BERNSTEIN, family_v=BERNSTEIN)
    assert developability(surface).twist_deg == pytest.approx(sampled_twist(surface), rel=1e-6)


@pytest.mark.parametrize(
    ("patch", "message"),
    [
        (Rotation(WAVE, [0, 0, 0], [0, 0, 1]), "must be linear in v, got Rotation"),
        (Surface(np.zeros((3, 3, 3)) + np.arange(3)), "must be linear in v, got Surface"),
        (WAVE, "must be linear in v, got Curve"),
        (Ruled(line([0, 0], [1, 0]), line([0, 1], [1, 1])), "must lie in space, got dimension 2"),
    ],
)
def test_what_is_not_measured(patch, message):
    with pytest.raises(InputError, match=message):
        developability(patch)


# Quasi-developable strips


def test_equal_parameters_make_a_ruled_patch():
    strip = quasi_developable(WAVE, OTHER)
    assert strip.definition_error == 0
    assert strip.evaluate(T[:, None], T[None, ::20]) == pytest.approx(
        Ruled(WAVE, OTHER).evaluate(T[:, None], T[None, ::20])
    )
    assert strip.report.twist_deg == pytest.approx(sampled_twist(strip), rel=1e-3)


@pytest.mark.parametrize("curve", [HIGH, OTHER, Restricted(OTHER, (0.9, 0.2)), line([0, 0, 5], [9, 1, 4])])
@pytest.mark.parametrize("pairing", [(0, 0.2, 1), (0, 0.1, 0.9, 1), (0, 1e-3, 0.2, 0.4, 0.8, 1)])
def test_a_pairing_joins_the_points_it_says(curve, pairing):
    strip = QuasiDevelopable(LOW, curve, pairing)
    law = sum(
        math.comb(len(pairing) - 1, k) * c * T**k * (1 - T) ** (len(pairing) - 1 - k) for k, c in enumerate(pairing)
    )
    assert strip.paired(T) == pytest.approx(law, abs=1e-15)
    off = np.linalg.norm(strip.evaluate(T, 1.0) - curve.evaluate(np.clip(law, 0, 1)), axis=1)
    assert off.max() <= strip.definition_error + 1e-13
    assert strip.definition_error <= 1e-10
    assert strip.evaluate(T, 0.0) == pytest.approx(LOW.evaluate(T), abs=1e-14)


def test_a_cylinder_is_found_again():
    # the same parabola twice, the second at another speed: gamma = (-1, 1) is a quadratic Bezier curve at 1 - cos
    start = 0.5
    low = Restricted(
        Curve([[0, 0, 0], [20, 40, 0], [60, 0, 0]], family=BERNSTEIN), (1 - math.cos(math.pi * start / 2), 1)
    )
    high = Restricted(Curve([[0, 0, 30], [20, 40, 30], [60, 0, 30]], (-1, 1)), (start, 1))
    even, better = quasi_developable(low, high), quasi_developable(low, high, pairing="least-twist")
    assert even.report.twist_deg > 1
    assert better.report.twist_deg < 0.01 * even.report.twist_deg
    t = np.linspace(0, 1, 21)
    assert better.evaluate(t, 1.0) == pytest.approx(low.evaluate(t) + [0, 0, 30], abs=0.05)


def test_the_mean_square_of_the_twist_is_less():
    def sines(strip):
        normals = [np.cross(strip.derivative(T, v, (1, 0)), strip.derivative(T, v, (0, 1))) for v in (0.0, 1.0)]
        first, last = (one / np.linalg.norm(one, axis=1)[:, None] for one in normals)
        return np.linalg.norm(np.cross(first, last), axis=1)

    for a, b in ((LOW, HIGH), (WAVE, OTHER)):
        even, better = quasi_developable(a, b), quasi_developable(a, b, pairing="least-twist")
        assert (better.pairing[0], better.pairing[-1]) == (0, 1)
        assert (sines(better) ** 2).mean() < 0.9 * (sines(even) ** 2).mean()


UNEVEN = Curve([[0, 0, 0], [10, 20, 5], [20, 25, 20], [30, 10, 25], [40, 0, 10]], (0.2, -0.3))
ABOVE = Curve([[0, 0, 30], [20, 30, 35], [40, 0, 30]])


@pytest.mark.parametrize("seed", [None, *range(4)])
def test_a_searched_pairing_leaves_a_regular_strip(seed):
    a, b = UNEVEN, ABOVE
    if seed is not None:
        rng = np.random.default_rng(seed)
        a, b = (
            Curve(np.column_stack([np.linspace(0, 60, 4), y + rng.normal(0, 4, 4), rng.normal(0, 6, 4)]), gamma)
            for y, gamma in ((0, (0.3, -0.8)), (30, (-0.6, 0.5)))
        )
    even, better = quasi_developable(a, b), quasi_developable(a, b, pairing="least-twist")
    assert even.report.regular
    assert better.report.regular
    slopes = np.linalg.norm(better.derivative(T, 1.0, (1, 0)), axis=1) / np.linalg.norm(b.derivative(T), axis=1).max()
    assert slopes.min() > 1e-3
    limit = better.report.twist_bound_deg
    assert quasi_developable(a, b, pairing="least-twist", max_twist_deg=limit) is not None


def test_a_limit_of_the_twist_is_kept_or_refused():
    found = quasi_developable(LOW, HIGH).report
    strip = quasi_developable(LOW, HIGH, max_twist_deg=found.twist_bound_deg)
    assert strip.max_twist_deg == found.twist_bound_deg
    with pytest.raises(InputError, match=r"may twist by 5 degrees along a ruling, but does by 12\.59 at t = 0\.397"):
        quasi_developable(LOW, HIGH, max_twist_deg=5)
    assert quasi_developable(LOW, HIGH, pairing="least-twist", max_twist_deg=5).report.twist_deg < 5
    middle = (found.twist_deg + found.twist_bound_deg) / 2
    with pytest.raises(InputError, match=r"is not proved to twist by less: it does by 12\.59 at t = 0\.397.* proved\)"):
        quasi_developable(LOW, HIGH, max_twist_deg=middle)
    with pytest.raises(InputError, match="with no bound: it is singular or nearly so"):
        quasi_developable(LOW, LOW, max_twist_deg=5)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"pairing": (0, 0.5)}, "rise from 0 to 1"),
        ({"pairing": (0, 0.7, 0.5, 1)}, "rise from 0 to 1"),
        ({"pairing": "best"}, 'must be "least-twist" or numbers'),
        ({"pairing": (0, math.nan, 1)}, "rise from 0 to 1"),
        ({"max_twist_deg": -1}, "must not be below 0"),
        ({"max_twist_deg": math.inf}, "must be a finite number"),
    ],
)
def test_wrong_options(options, message):
    with pytest.raises(InputError, match=message):
        quasi_developable(LOW, HIGH, **options)


def test_strips_move_and_are_pickled():
    strip = QuasiDevelopable(LOW, HIGH, (0, 0.3, 1), 40)
    matrix = np.array([[1, 0.3, 0], [0, 2, 0.1], [0.2, 0, 1.5]])
    moved = strip.transformed(matrix, [1, 2, 3])
    points = strip.evaluate(T[:, None], T[None, ::20]) @ matrix.T + [1, 2, 3]
    assert moved.evaluate(T[:, None], T[None, ::20]) == pytest.approx(points, abs=1e-12)
    assert moved.max_twist_deg is None
    assert pickle.loads(pickle.dumps(strip)) == strip
    flat = quasi_developable(Curve([[0, 0], [1, 1], [2, 0]]), LOW)
    assert flat.a.dimension == 3
    assert LOW.family is GT
