from __future__ import annotations

import math
import pickle

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gtcad import BERNSTEIN, Curve
from gtcad.basis import Basis
from gtcad.errors import InputError, SingularDevelopable
from gtcad.factors import CurveOfTerms, Stacked, Waves
from gtcad.measure import area
from gtcad.patches import (
    Enveloping,
    PlaneFamily,
    SpineDevelopable,
    developability,
    geodesic_developable,
    spine_developable,
)
from gtcad.patches._moving_frames import Unresolved
from tests import reference
from tests.patches import developables as exact
from tests.patches.developables import HIGH, LOW, at_start, random_family, regular_patches

PLANES = [(1, 0, 0.2, 0), (0.5, 1, 0.3, 0.6), (-0.5, 1, 0.8, 1), (-1, 0.2, 1, 0.5)]
KNOWN = PlaneFamily(PLANES, (0.3, -0.2))
SPINE = Curve([[0, 0, 0], [10, 20, 5], [20, 25, 20], [30, 10, 25], [40, 0, 10]], (0.2, -0.3))
T = np.linspace(0, 1, 41)
PATCHES = regular_patches(6)
TURN = 2 * math.pi
APEX = np.array([3.0, -2.0, 90.0])
CONE = np.array([[1, 0, 0.4], [1, 1.2, 0.5], [-0.3, 1, 0.4], [-1, 0.8, 0.5]])  # normals


def helix(radius=30.0, pitch=40.0, turns=0.6):
    factors = Stacked((Waves(0.0, TURN * turns), Basis(1, family=BERNSTEIN)))
    rows = [[0, 0, 0], [radius, 0, 0], [0, radius, 0], [0, 0, 0], [0, 0, pitch * turns]]
    return CurveOfTerms(factors, rows)


# Plane families


def test_known_points():
    point = [-0.127619831739, 0.648353222340, 0.286304842365]
    assert KNOWN.edge_of_regression(0.5) == pytest.approx(point, abs=1e-12)
    ruling = KNOWN.ruling(0.5)
    low = ruling.point - ruling.point[2] / ruling.direction[2] * ruling.direction
    assert low == pytest.approx([-0.254833833034, 0.863120976975, 0], abs=1e-12)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6), st.floats(0, 1))
def test_what_defines_rulings_and_edge_of_regression(seed, t):
    family = random_family(seed)
    planes = [family.derivative(t, order) for order in range(4)]
    size = np.abs(planes).max()
    ruling, point = family.ruling(t), family.edge_of_regression(t)
    for plane in planes[:2]:
        for w in (0.0, 30.0):
            assert abs(plane[:3] @ (ruling.point + w * ruling.direction) - plane[3]) <= 1e-11 * size
    assert abs(ruling.point @ ruling.direction) <= 1e-11 * size
    assert abs(family.normal(t) @ ruling.direction) <= 1e-14
    for plane in planes[:3]:
        assert abs(plane[:3] @ point - plane[3]) <= 1e-13 * np.linalg.norm(plane[:3]) * (size + np.linalg.norm(point))


def test_the_edge_of_regression_runs_along_the_rulings():
    step, t = 1e-5, np.linspace(0.05, 0.95, 19)
    slope = (KNOWN.edge_of_regression(t + step) - KNOWN.edge_of_regression(t - step)) / (2 * step)
    across = np.cross(slope / np.linalg.norm(slope, axis=1)[:, None], KNOWN.ruling(t).direction)
    assert np.linalg.norm(across, axis=1).max() <= 1e-8


def test_the_edge_of_regression_at_infinity_has_no_points():
    wall = PlaneFamily([[1, 0, 0, 1], [1, 1, 0, 1], [0, 1, 0, 1]])
    assert np.isnan(wall.edge_of_regression(T)).all()


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("weights", [[1, 1, 1], [1, 2, 0.7], [0.1, 0.3, 0.1]])
def test_planes_that_do_not_turn_have_no_rulings(weights, size):
    still = PlaneFamily(size * np.outer(weights, [1, 0.1, 0.3, 1]), (0.3, -0.2))
    parallel = PlaneFamily(size * np.array([[1, 0.1, 0.3, d] for d in (1, 2, 5)]))
    for family in (still, parallel):
        assert np.isnan(family.ruling(T).direction).all()
        assert np.isnan(family.ruling(T).point).all()
        assert np.isnan(family.edge_of_regression(T)).all()


@pytest.mark.parametrize("angle", [1e-1, 1e-5, 1e-10])
def test_planes_that_turn_little_have_rulings(angle):
    # z = angle t x + (angle t)^2 y: the planes touch at x + 2 angle t y = 0, and at the origin all
    family = PlaneFamily([[0, 0, 1, 0], [-angle / 2, 0, 1, 0], [-angle, -(angle**2), 1, 0]], family=BERNSTEIN)
    expected = np.column_stack([-2 * angle * T, np.ones(41), -((angle * T) ** 2)])
    expected /= np.linalg.norm(expected, axis=1)[:, None]
    assert np.cross(family.ruling(T).direction, expected) == pytest.approx(np.zeros((41, 3)), abs=1e-15 / angle)
    if angle > 1e-6:  # with less, the second derivative of the normals is rounding
        assert family.edge_of_regression(T) == pytest.approx(np.zeros((41, 3)), abs=1e-12)


def test_planes_without_a_normal_have_no_unit_normal():
    assert np.isnan(PlaneFamily([[1, 0, 0, 9], [-1, 0, 0, 9]], family=BERNSTEIN).normal(0.5)).all()


def test_planes_are_those_of_many_digits():
    for order in range(4):
        found = KNOWN.derivative(0.37, order)
        with mp.workdps(reference.DIGITS):
            assert exact.distance(found, exact.derivatives(KNOWN, mp.mpf(0.37), order)[order]) <= 1e-12


def test_reversed_and_moved_planes():
    assert KNOWN.reversed().evaluate(0.2) == pytest.approx(KNOWN.evaluate(0.8), abs=1e-15)
    matrix, offset = np.array([[1.0, 2, 0], [0, 1, -0.5], [0.3, 0, 2]]), np.array([4.0, 5, 6])
    moved = KNOWN.transformed(matrix, offset)
    points = KNOWN.edge_of_regression(T)
    assert moved.edge_of_regression(T) == pytest.approx(points @ matrix.T + offset, abs=1e-9)


def test_families_are_equal_by_content_and_pickled():
    same = PlaneFamily(np.array(PLANES) * 1.0, (0.3, -0.2))
    assert (same == KNOWN, hash(same) == hash(KNOWN)) == (True, True)
    assert KNOWN.with_gamma((0.3, 0)) != KNOWN
    assert KNOWN != 3
    assert pickle.loads(pickle.dumps(KNOWN)) == KNOWN
    assert not KNOWN.control_planes.flags.writeable


@pytest.mark.parametrize(
    ("planes", "gamma", "message"),
    [
        ([[1, 0, 0]] * 3, (0, 0), r"shape \(n \+ 1, 4\), got \(3, 3\)"),
        ("planes", (0, 0), "must be numbers"),
        ([[1, 0, 0, 1], [0, 0, 0, 1], [0, 1, 0, 1]], (0, 0), r"control_planes\[1\] must have a normal"),
        ([[1, 0, 0, math.nan], [0, 0, 1, 1], [0, 1, 0, 1]], (0, 0), r"control_planes\[0\] must be finite"),
        ([[1, 0, 0, 1], [0, 1, 0, 1]], (0, 0), "degree must be a whole number in"),
        (PLANES, (0, 1.5), r"gamma\[1\] must lie"),
    ],
)
def test_wrong_planes(planes, gamma, message):
    with pytest.raises(InputError, match=message):
        PlaneFamily(planes, gamma)


# Enveloping developables


def assert_enveloping(patch, places=(0.0, 0.31, 1.0)):
    for t in places:
        with mp.workdps(30):
            planes = exact.derivatives(patch.family, mp.mpf(t), 1)
            for v, bound in ((0.0, patch.bound_a), (1.0, patch.bound_b)):
                point = exact.cut(planes, bound)
                assert exact.distance(patch.evaluate(t, v), point) <= patch.definition_error
                assert exact.distance(patch.exact_boundaries(t)[int(v)], point) <= 1e-11
    report = developability(patch)
    assert math.radians(report.twist_deg) <= 1e-12
    assert report.determinant <= 1e-12
    assert report.twist_bound_deg <= 1e-6
    assert report.regular
    assert report.by_definition
    assert not report.singular_rulings
    assert report.regression_distance > 0


@pytest.mark.parametrize("patch", PATCHES, ids=range(len(PATCHES)))
def test_boundaries_are_within_the_definition_error(patch):
    assert patch.definition_error <= 1e-8
    assert_enveloping(patch)


@pytest.mark.parametrize("patch", PATCHES[:4], ids=range(4))
def test_the_patch_touches_its_planes(patch):
    planes = patch.family.evaluate(T)
    points = patch.evaluate(T[:, None], T[None, ::8])
    off = np.einsum("uvd,ud->uv", points, planes[:, :3]) - planes[:, 3:]
    assert abs(off).max() <= patch.definition_error * np.linalg.norm(planes[:, :3], axis=1).max() + 1e-12
    slopes = [patch.derivative(T[:, None], T[None, ::8], orders) for orders in ((1, 0), (0, 1))]
    normals = np.cross(*slopes)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    assert abs(normals - patch.normal(T)[:, None]).max() <= 1e-9  # on the side of S_u x S_v
    assert abs(abs(np.einsum("ud,ud->u", patch.normal(T), patch.family.normal(T))) - 1).max() <= 1e-14


def test_derivatives_by_definition_are_those_of_the_polynomials():
    patch = PATCHES[0]
    for order in range(4):
        for curve, values in zip((patch.a, patch.b), patch.exact_boundaries(T, order), strict=True):
            growth = (2 * curve.factors.degree**2) ** order  # Markov's inequality
            assert abs(curve.derivative(T, order) - values).max() <= 1e-12 * growth


def test_regression_points_are_those_of_the_family():
    for patch in PATCHES[:4]:
        expected = patch.family.edge_of_regression(T)
        near = np.linalg.norm(expected, axis=1) < 1e4
        assert near.any()
        assert patch.regression(T)[near] == pytest.approx(expected[near], rel=1e-7)


def test_planes_through_a_point_envelop_a_cone():
    family = PlaneFamily(np.column_stack([CONE, CONE @ APEX]), (0.4, -0.5))
    assert family.edge_of_regression(T) == pytest.approx(np.tile(APEX, (41, 1)), abs=1e-10)
    patch = family.enveloping([0, 0, 1, 0], [0, 0, 1, 40])
    along = patch.evaluate(T, 1.0) - patch.evaluate(T, 0.0)
    assert np.cross(along, APEX - patch.evaluate(T, 0.0)) == pytest.approx(np.zeros((41, 3)), abs=1e-8)
    nearest = developability(patch).regression_distance
    assert nearest == pytest.approx(np.linalg.norm(APEX - patch.evaluate(T, 1.0), axis=1).min(), rel=1e-4)


def test_upright_planes_envelop_a_cylinder_of_known_area():
    quarter = PlaneFamily([[1, 0, 0, 20], [1, 1, 0, 20], [0, 1, 0, 20]]).enveloping([0, 0, 1, 0], [0, 0, 1, 30])
    x, y, z = np.moveaxis(quarter.evaluate(T[:, None], T[None, :]), -1, 0)
    assert abs(np.hypot(x, y) - 20).max() <= quarter.definition_error + 1e-14 <= 1e-10
    assert abs(z - 30 * T).max() <= 1e-12
    assert float(area(quarter)) == pytest.approx(math.pi / 2 * 20 * 30, rel=1e-12)
    assert developability(quarter).regression_distance == math.inf
    assert np.isnan(quarter.regression(T)).all()


def test_a_bounding_curve_on_the_surface_is_met_exactly():
    whole = PATCHES[1]
    curve = whole.isoparametric(v=0.6)
    patch = whole.family.enveloping(LOW, curve)
    assert patch.b.evaluate(T) == pytest.approx(curve.evaluate(T), abs=1e-10)
    assert patch.bound_gaps[0] == 0
    assert patch.bound_gaps[1] <= 1e-10


def test_rulings_end_next_to_a_bounding_curve():
    family, curve = PATCHES[1].family, Curve([[40, 10, 30], [30, 40, 35], [-10, 50, 30]])
    patch = family.enveloping(LOW, curve)
    ends, along = patch.b.evaluate(T), family.ruling(T).direction
    to_curve = curve.evaluate(T) - ends
    assert abs(np.einsum("td,td->t", to_curve, along)).max() <= 1e-9
    assert patch.bound_gaps[1] == pytest.approx(np.linalg.norm(to_curve, axis=1).max(), rel=1e-3)
    assert patch.bound_gaps[1] >= np.linalg.norm(to_curve, axis=1).max() - 1e-9
    flat = family.enveloping(LOW, Curve([[40, 10], [30, 40], [-10, 50]]).transformed(np.eye(3, 2), [0, 0, 30]))
    assert flat.definition_error <= 1e-8


def test_a_part_is_the_same_surface():
    whole, family = PATCHES[2], PATCHES[2].family
    part = family.enveloping(LOW, HIGH, (0.75, 0.25))
    assert part.evaluate(T[:, None], T) == pytest.approx(whole.evaluate(0.75 - 0.5 * T[:, None], T), abs=1e-10)
    curve = Curve([[40, 10, 30], [30, 40, 35], [-10, 50, 30]])
    bounded, piece = family.enveloping(LOW, curve), family.enveloping(LOW, curve, (0.25, 0.75))
    assert piece.evaluate(T, 1.0) == pytest.approx(bounded.evaluate(0.25 + 0.5 * T, 1.0), abs=1e-9)
    assert piece.bound_gaps[1] <= bounded.bound_gaps[1] + 1e-9


def rotation(angle):
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]]) @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


SHEAR = np.array([[1, 0.3, 0], [0, 1, 0.1], [0.2, 0, 1.5]])
CURVED = PATCHES[1].family.enveloping(LOW, Curve([[40, 10, 30], [30, 40, 35], [-10, 50, 30]]))
MOVABLE = [PATCHES[0], CURVED, spine_developable(SPINE, (5, 30)), geodesic_developable(SPINE, (-2, 5))]
MOVABLE.append(spine_developable(PlaneFamily(np.array(PLANES) * [1, 1, 1, 20], (0.3, -0.2)), (5, 30)))


@pytest.mark.parametrize("patch", MOVABLE, ids=["enveloping", "curve", "tangent", "geodesic", "edge of regression"])
@pytest.mark.parametrize("matrix", [2 * rotation(0.7), -0.5 * rotation(2.0), SHEAR])
def test_affine_images(patch, matrix):
    offset = np.array([7.0, -3.0, 100.0])
    image = patch.transformed(matrix, offset)
    points = patch.evaluate(T[:, None], T[None, ::10]) @ matrix.T + offset
    assert image.evaluate(T[:, None], T[None, ::10]) == pytest.approx(points, abs=1e-9)
    assert image.definition_error <= 1e-8
    normals = np.linalg.solve(matrix.T, patch.normal(T).T).T
    normals *= np.sign(np.linalg.det(matrix)) / np.linalg.norm(normals, axis=1, keepdims=True)
    assert image.normal(T) == pytest.approx(normals, abs=1e-9)
    back = image.transformed(np.linalg.inv(matrix), -np.linalg.solve(matrix, offset))
    assert back.evaluate(T, 0.3) == pytest.approx(patch.evaluate(T, 0.3), abs=1e-9)
    assert math.radians(developability(image).twist_deg) <= 1e-11
    edge = patch.regression(T)
    near = np.linalg.norm(edge, axis=1) < 1e3
    assert image.regression(T)[near] == pytest.approx(edge[near] @ matrix.T + offset, abs=1e-5)


@pytest.mark.parametrize("patch", MOVABLE, ids=["enveloping", "curve", "tangent", "geodesic", "edge of regression"])
@pytest.mark.parametrize("size", [1e-6, 1e3, 1e6])
def test_the_definition_error_grows_as_the_patch_does(patch, size):
    image = patch.transformed(size * np.eye(3))
    assert image.definition_error == pytest.approx(size * patch.definition_error, rel=0.5)
    assert developability(image).regular


def test_the_rounding_of_a_placement_is_within_the_definition_error():
    points = SPINE.control_points * 1e6 / 3
    rows = np.array([[1 / 3, 0.2, 0.1, 1e3 / 7], [0.1, 1 / 7, 0.9, 3], [0.3, -0.7, 1 / 9, 5]])
    patch = SpineDevelopable(Curve(points, SPINE.gamma), (1.0, 2.0), rows)
    with mp.workdps(40):
        first, second = ([mp.mpf(x) for x in row] for row in points[:2].tolist())
        along = exact.unit([b - a for a, b in zip(first, second, strict=True)])
        for w, curve in ((1, patch.a), (2, patch.b)):
            place = [a + w * b for a, b in zip(first, along, strict=True)] + [mp.mpf(1)]
            expected = [exact.dot([mp.mpf(x) for x in row], place) for row in rows.tolist()]
            apart = mp.sqrt(mp.fsum((a - b) ** 2 for a, b in zip(at_start(curve), expected, strict=True)))
            assert apart <= patch.definition_error <= 1e-14 * np.abs(points).max()


def test_patches_are_equal_by_content_and_pickled():
    for patch in MOVABLE:
        again = pickle.loads(pickle.dumps(patch))
        assert again == patch
        assert hash(again) == hash(patch)
        assert again.coefficients.tobytes() == patch.coefficients.tobytes()
    assert PATCHES[0] != PATCHES[1]


@pytest.mark.parametrize(
    ("bound", "message"),
    [
        ([0, 0, 0, 1], "bound_b must be a plane"),
        ([0, 0, 1], "bound_b must be a plane"),
        ("top", "bound_b must be a plane"),
        ([0, math.inf, 1, 1], "bound_b must be a plane"),
        (PATCHES[0], "or a curve, got Enveloping$"),
        (None, "or a curve, got None$"),
    ],
)
def test_wrong_bounds(bound, message):
    with pytest.raises(InputError, match=message):
        PATCHES[0].family.enveloping(LOW, bound)


def test_wrong_arguments():
    family = PATCHES[0].family
    with pytest.raises(InputError, match="part must be two different numbers"):
        family.enveloping(LOW, HIGH, (0.5, 0.5))
    with pytest.raises(InputError, match="must be a PlaneFamily, got Curve"):
        Enveloping(SPINE, LOW, HIGH)
    with pytest.raises(InputError, match=r"must lie in \[0, 1\]"):
        family.ruling(1.5)
    with pytest.raises(InputError, match="must be an invertible one"):
        family.transformed(np.diag([1.0, 1, 0]))
    with pytest.raises(InputError, match="one of dimension 1"):
        family.enveloping(LOW, CurveOfTerms(Waves(0, 1), [[0.0], [1], [1]]))


# What is singular


@pytest.mark.parametrize("seed", range(12))
def test_a_patch_is_refused_just_where_its_edge_of_regression_meets_it(seed):
    assert_refused_rightly(seed)


@pytest.mark.stress
@pytest.mark.parametrize("start", range(12, 892, 20))
def test_a_patch_is_refused_just_where_its_edge_of_regression_meets_it_stress(start):
    for seed in range(start, start + 20):
        assert_refused_rightly(seed)


def assert_refused_rightly(seed):
    family = random_family(seed)
    expected = exact.first_crossing(family)
    if expected is None:
        assert_enveloping(family.enveloping(LOW, HIGH), (0.2, 0.9))
        return
    with pytest.raises(SingularDevelopable, match="edge of regression") as caught:
        family.enveloping(LOW, HIGH)
    assert caught.value.t == pytest.approx(expected, abs=1e-10)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("place", [0.0, 0.23, 0.5, 0.8712, 1.0])
def test_a_plane_that_stands_still_is_found(seed, place):
    family = random_family(seed)
    planes = np.array(family.control_planes)
    k = round(place * family.degree)
    value, slope = (family.basis.derivative(place, order) for order in (0, 1))
    n, rate = value @ planes, slope @ planes
    factor = 0.4  # n' shall be so many times n
    planes[k] += (factor * n - rate) / (slope[k] - factor * value[k])
    with pytest.raises(SingularDevelopable, match="does not turn") as caught:
        PlaneFamily(planes, family.gamma, family.family).enveloping(LOW, HIGH)
    assert caught.value.t == pytest.approx(place, abs=1e-9)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("place", [0.0, 0.31, 0.99])
def test_a_ruling_parallel_to_a_bound_is_found(seed, place):
    family = random_family(seed)
    along = family.ruling(place).direction
    normal = np.cross(along, [0.3, -0.2, 1.0])
    t = np.linspace(0, 1, 4001)
    angles = family.ruling(t).direction @ normal
    changes = np.flatnonzero(angles[:-1] * angles[1:] < 0)

    def determinant(x):
        planes = exact.derivatives(family, x, 1)
        return exact.dot(exact.cross(planes[0][:3], planes[1][:3]), [mp.mpf(y) for y in normal.tolist()])

    with mp.workdps(30):
        root = float(mp.findroot(determinant, (place - 1e-4, place + 1e-4), solver="secant"))
    first = float(t[changes[0]]) if changes.size else 1.0
    with pytest.raises(SingularDevelopable, match="parallel to the plane bound_b") as caught:
        family.enveloping(LOW, [*normal, 60.0])
    assert caught.value.t == pytest.approx(root, abs=1e-9) or caught.value.t < min(first + 3e-4, root)


def test_the_first_ruling_parallel_to_either_bound_is_told():
    family = PlaneFamily(np.column_stack([CONE, CONE @ APEX]), (0.4, -0.5))
    # upright planes along one ruling each
    first, last = ([*np.cross(family.ruling(t).direction, [0, 0, 1]), 60.0] for t in (0.31, 0.9))
    for bounds, name in (((first, last), "bound_a"), ((last, first), "bound_b")):
        with pytest.raises(SingularDevelopable, match=f"parallel to the plane {name}") as caught:
            family.enveloping(*bounds)
        assert caught.value.t == pytest.approx(0.31, abs=1e-9)


def test_a_plane_without_a_normal_is_found():
    family = PlaneFamily([[1, 0, 0, 9], [0, 1, 0, 9], [-1, 0, 0, 9]], family=BERNSTEIN)
    moved = PlaneFamily([[1, 0, 0, 9], [0, 1e-9, 0, 9], [-1, 0, 0, 9]], family=BERNSTEIN)
    with pytest.raises(SingularDevelopable, match=r"no normal at t = 0\.5"):
        moved.enveloping([0, 0, 1, 0], [0, 0, 1, 9])
    assert np.linalg.norm(family.normal(0.5)) == pytest.approx(1)


def test_bounds_that_meet_are_found():
    patch = PATCHES[0]
    (a, b), height = patch.exact_boundaries(0.4), 12.5
    # a plane through the point of the first ruling's bound at 0.4, tilted across
    normal = np.array([0.3, 0.1, 1.0])
    with pytest.raises(SingularDevelopable, match="the boundaries meet") as caught:
        patch.family.enveloping(LOW, [*normal, normal @ a])
    assert caught.value.t == pytest.approx(0.4, abs=1e-9)
    assert np.linalg.norm(b - a) > height


def test_bounds_that_are_one_but_for_rounding_meet_at_the_start():
    family = PATCHES[0].family
    for apart in (0.0, 1e-14, 1e-12):
        with pytest.raises(SingularDevelopable, match="the boundaries meet") as caught:
            family.enveloping(LOW, (*LOW[:3], LOW[3] + apart))
        assert caught.value.t == 0
    assert family.enveloping(LOW, (*LOW[:3], LOW[3] + 1e-6)) is not None
    with pytest.raises(SingularDevelopable, match=r"the boundaries meet at t = 0$"):
        spine_developable(SPINE, (5, 5 + 1e-14))


def test_planes_that_all_stand_still_have_no_patch():
    with pytest.raises(SingularDevelopable, match="does not turn at t = 0"):
        PlaneFamily([[0, 0.5, 1, 4]] * 3).enveloping([1, 0, 0, 0], [1, 0, 0, 9])


def test_a_cylinder_with_a_cusp_has_a_ruling_without_tangent_plane():
    family = PlaneFamily([[1, 0, 0, 20], [1, 1, 0, 24], [0, 1, 0, 20]], (1, 1))
    with pytest.raises(SingularDevelopable, match="no tangent plane at t = 0"):
        family.enveloping([0, 0, 1, 0], [0, 0, 1, 9])


@pytest.mark.parametrize("far", [0.0, 1e4, 1e6])
def test_a_bound_through_the_apex_of_a_cone_is_refused_at_its_start(far):
    family = PlaneFamily(np.column_stack([CONE, CONE @ APEX]), (0.4, -0.5)).transformed(np.eye(3), [far, far, 0])
    low, high = [0, 0, 1, 0], [0, 0, 1, 90]
    for bounds in ((low, high), (high, low), (low, Curve([APEX + [far, far, 0]] * 3))):
        with pytest.raises(SingularDevelopable, match="edge of regression meets the patch") as caught:
            family.enveloping(*bounds)
        assert caught.value.t == 0


def test_planes_through_one_line_have_no_patch():
    # all contain the line x = z = 9
    family = PlaneFamily([[1, 0, 0, 9], [0, 0, 1, 9], [-1, 0, 0, -9]])
    with pytest.raises(SingularDevelopable, match="a ruling has no tangent plane") as caught:
        family.enveloping([0, 1, 0, 0], [0, 1, 0, 9])
    assert caught.value.t == 0


def test_what_is_nearly_singular_asks_for_parts():
    apart = 2e-5
    family = PlaneFamily([[1, 0, 0.1, 20], [apart, 1, 0.2, 20], [1 + apart, 0.02, 0.1, 20.4]])
    with pytest.raises(InputError) as caught:
        family.enveloping([0, 0, 1, 0], [0, 0, 1, 2])
    assert isinstance(caught.value, Unresolved | SingularDevelopable)


# Along curves


@pytest.mark.parametrize("distances", [(5.0, 30.0), (-1.0, -9.0)])
def test_a_tangent_surface_is_that_of_many_digits(distances):
    patch = spine_developable(SPINE, distances)
    assert patch.definition_error <= 1e-9
    for t in (0.0, 0.4, 1.0):
        with mp.workdps(30):
            rows = reference.taylor_rows("GT", 4, SPINE.gamma, mp.mpf(t), 1)
            points = [[mp.mpf(x) for x in p] for p in SPINE.control_points.tolist()]
            point, slope = (
                [mp.fsum(r[k] * p[d] for r, p in zip(rows, points, strict=True)) for d in range(3)] for k in (0, 1)
            )
            tangent = exact.unit(slope)
            for v, w in zip((0.0, 1.0), distances, strict=True):
                expected = [x + mp.mpf(w) * y for x, y in zip(point, tangent, strict=True)]
                assert exact.distance(patch.evaluate(t, v), expected) <= patch.definition_error + 1e-14
    assert patch.regression(T) == pytest.approx(SPINE.evaluate(T), abs=1e-9)
    report = developability(patch)
    assert math.radians(report.twist_deg) <= 1e-12
    assert report.regression_distance == pytest.approx(min(map(abs, distances)), rel=1e-9)
    assert report.regular


def test_the_tangents_of_a_helix():
    spine = helix()
    patch = spine_developable(spine, (10, 40))
    x, y, z = np.moveaxis(patch.evaluate(T[:, None], T), -1, 0)
    slope = 40 / (TURN * 30)
    # at the distance w from the spine, the tangent has run w cos(slope) in plan
    out = np.sqrt(x**2 + y**2 - 30**2)
    angle = np.unwrap(np.arctan2(y, x), axis=0) - np.arctan2(out, 30)
    assert abs(z - (40 / TURN * angle + slope * out)).max() <= 1e-11


def test_the_tangents_of_an_edge_of_regression_are_the_rulings():
    family = PlaneFamily(np.array(PLANES) * [1, 1, 1, 20], (0.3, -0.2))
    patch = spine_developable(family, (5, 30))
    edge, rulings = family.edge_of_regression(T), family.ruling(T)
    for v, w in ((0, 5), (1, 30)):
        assert patch.evaluate(T, v) == pytest.approx(edge + w * rulings.direction, abs=1e-9)
    assert patch.regression(T) == pytest.approx(edge, abs=1e-8)
    assert patch.definition_error <= 1e-8


def geodesic_curvature(patch, curve, t):
    normal = patch.normal(t)
    first, second = curve.derivative(t), curve.derivative(t, 2)
    speed = np.linalg.norm(first, axis=1)
    return np.einsum("td,td->t", np.cross(normal, first), second) / speed**3


def test_the_curve_is_a_geodesic_of_its_rectifying_developable():
    patch = geodesic_developable(SPINE, (-2, 6))
    assert patch.evaluate(T, 0.25) == pytest.approx(SPINE.evaluate(T), abs=1e-12)
    assert abs(geodesic_curvature(patch, SPINE, T)).max() <= 1e-13
    normals = np.cross(patch.derivative(T, 0.25, (1, 0)), patch.derivative(T, 0.25, (0, 1)))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    assert patch.normal(T) == pytest.approx(normals, abs=1e-9)
    report = developability(patch)
    assert math.radians(report.twist_deg) <= 1e-12
    assert report.regular
    assert patch.definition_error <= 1e-9
    with mp.workdps(30):  # an independent Darboux vector
        rows = reference.taylor_rows("GT", 4, SPINE.gamma, mp.mpf(0.3), 3)
        points = [[mp.mpf(x) for x in p] for p in SPINE.control_points.tolist()]
        c = [
            [mp.factorial(k) * mp.fsum(r[k] * p[d] for r, p in zip(rows, points, strict=True)) for d in range(3)]
            for k in range(4)
        ]
        w = exact.cross(c[1], c[2])
        speed, bend = mp.sqrt(exact.dot(c[1], c[1])), mp.sqrt(exact.dot(w, w))
        torsion, curvature = exact.dot(w, c[3]) / bend**2, bend / speed**3
        darboux = exact.unit([torsion * x / speed + curvature * y / bend for x, y in zip(c[1], w, strict=True)])
        expected = [x + 6 * y for x, y in zip(c[0], darboux, strict=True)]
    assert exact.distance(patch.evaluate(0.3, 1.0), expected) <= patch.definition_error + 1e-14


def test_the_rectifying_developable_of_a_helix_is_its_cylinder():
    patch = geodesic_developable(helix(), (-20, 15))
    x, y, _ = np.moveaxis(patch.evaluate(T[:, None], T), -1, 0)
    assert abs(np.hypot(x, y) - 30).max() <= 1e-11
    assert abs(patch.ruling(T).direction - [0, 0, 1]).max() <= 1e-13


def test_distances_and_curves_that_have_no_developable():
    with pytest.raises(InputError, match="both above 0 or both below"):
        spine_developable(SPINE, (-1, 2))
    with pytest.raises(InputError, match="both above 0 or both below"):
        spine_developable(SPINE, (0, 2))
    with pytest.raises(InputError, match="two different numbers, got"):
        geodesic_developable(SPINE, (2, 2))
    with pytest.raises(InputError, match="two different numbers, got 3"):
        geodesic_developable(SPINE, 3)
    with pytest.raises(InputError, match="must be a curve, got PlaneFamily"):
        geodesic_developable(KNOWN, (1, 2))
    line = Curve([[0, 0, 0], [1, 1, 1], [3, 3, 3]])
    for make in (spine_developable, geodesic_developable):
        with pytest.raises(SingularDevelopable, match=r"curvature .* vanishes at t = 0"):
            make(line, (1, 2))
    point = Curve([[1e6 / 3, 2e5 / 7, 3]] * 3)
    for make in (spine_developable, geodesic_developable):
        with pytest.raises(SingularDevelopable, match=r"speed .* vanishes at t = 0$"):
            make(point, (1, 2))
    upright = PlaneFamily([[1, 0, 0, 9], [1, 1, 0, 9], [0, 1, 0, 9]])
    with pytest.raises(SingularDevelopable, match="edge of regression is at infinity at t = 0"):
        spine_developable(upright, (1, 2))


def test_the_edge_of_regression_may_be_one_point():
    apex = PlaneFamily([[1, 0, 0.5, 0], [1, 1, 0.5, 0], [0, 1, 0.4, 0]])
    assert np.linalg.norm(spine_developable(apex, (1, 2)).evaluate(T, 1.0), axis=1) == pytest.approx(2 * np.ones(41))


@pytest.mark.parametrize("place", [0.25, 0.5, 0.8])
def test_an_inflection_is_found(place):
    # y'' = t - place, z'' = (t - place)^2: the curvature vanishes there, and only there
    t = np.polynomial.Polynomial([-place, 1])
    y, z = t.integ(2), (t**2).integ(2)
    power = np.array([[0, *y.coef[:1], *z.coef[:1]], [1, y.coef[1], z.coef[1]], *np.zeros((3, 3))])
    power[2:, 1], power[2:, 2] = np.pad(y.coef[2:], (0, 5 - y.coef.size)), z.coef[2:]
    bernstein = np.array([[math.comb(k, i) / math.comb(4, i) if i <= k else 0 for i in range(5)] for k in range(5)])
    curve = Curve(bernstein @ power, family=BERNSTEIN)
    for make in (spine_developable, geodesic_developable):
        with pytest.raises(SingularDevelopable, match="curvature") as caught:
            make(curve, (1.0, 2.0))
        assert caught.value.t == pytest.approx(place, abs=1e-6)


def test_a_geodesic_strip_wider_than_its_edge_of_regression_is_refused():
    wide = geodesic_developable(SPINE, (-2, 6))
    edge = wide.regression(T) - SPINE.evaluate(T)
    reach = np.einsum("td,td->t", edge, wide.ruling(T).direction)
    most = reach[reach > 0].min()
    geodesic_developable(SPINE, (0.0, 0.95 * most))
    with pytest.raises(SingularDevelopable, match="edge of regression"):
        geodesic_developable(SPINE, (0.0, 1.05 * most))
