from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from gtcad import BERNSTEIN, GT
from gtcad.basis import Basis
from gtcad.continuity import Start
from gtcad.developable_studies import gamma_effects
from gtcad.edge_check import check_edge
from gtcad.errors import InputError, SingularDevelopable, SingularJoin
from gtcad.patches import PlaneFamily
from gtcad.plane_joins import BETA, FARIN_BOEHM, check_plane_join, farin_boehm, join_planes
from tests.patches.developables import random_family, sampled_stretch

FIRST = random_family(3)
COUNTS = {"C0": 0, "C1": 1, "C2": 2, "C3": 3, "G0": 0, "G1": 1, "G2": 2, "G3": 3, BETA: 2, FARIN_BOEHM: 2}
SCALE, WEIGHTS = (1.7, 0.4, -0.2), (-0.6, 0.2, 0.1, 0.3)


def options(order):
    if order[0] == "C":
        return {}
    if order == FARIN_BOEHM:
        return {"ratios": (1.3, 0.8)}
    return {"scale": SCALE} | ({"weights": WEIGHTS} if order != BETA else {})


def random_join(rng, order, first=None):
    """A family, one joined to it, and the basis of that; None where it is not well determined."""
    first = first or random_family(int(rng.integers(10**6)))
    count = COUNTS[order]
    if rng.random() < 0.2:
        basis = Basis(int(rng.integers(max(count, 2), 7)), family=BERNSTEIN)
    else:
        basis = Basis(int(rng.integers(max(count, 2), 7)), tuple(rng.uniform(-0.9, 0.9, 2).tolist()))
    try:
        good = min(Start.of(basis, count).conditioning) > 0.05
    except SingularJoin:
        return None
    if not good:
        return None
    rest = random_family(int(rng.integers(10**6))).control_planes
    rest = np.resize(rest, (basis.degree - count, 4))
    kind = {"gamma": basis.gamma, "family": basis.family}
    return first, join_planes(first, basis.degree, order=order, rest=rest, **kind, **options(order))


@settings(max_examples=12, deadline=None)
@given(st.integers(0, 10**6))
@pytest.mark.parametrize("order", COUNTS)
def test_joins_are_of_their_order(order, seed):
    found = random_join(np.random.default_rng(seed), order)
    assume(found is not None)
    report = check_plane_join(*found, reach=40)
    count = COUNTS[order]
    assert report.meets(order)
    assert report.plane_angle_deg <= 1e-12
    assert report.plane_gap <= 1e-11
    if count >= 1:
        assert report.ruling_angle_deg <= 1e-8
        assert report.ruling_gap <= 1e-8
    if count >= 2:
        assert report.curvature_jump <= 1e-9
    if count >= 3:
        assert report.third_jump <= 1e-6
    if order[0] == "C":
        assert report.parametric_order >= count
    elif count >= 2:
        scale, weights = (report.scale, report.weights) if order != FARIN_BOEHM else (SCALE, report.weights)
        assert scale[:count] == pytest.approx(SCALE[:count], rel=1e-6)
        expected = WEIGHTS if order in ("G2", "G3") else (1, 0, 0, 0)
        assert weights[: count + 1] == pytest.approx(expected[: count + 1], abs=1e-6)
    assert report.beta == (order in (BETA, FARIN_BOEHM) or report.parametric_order >= 2)


def halves(points, place):
    """Bezier control points of both parts, by de Casteljau's algorithm."""
    rows, first, last = [np.array(row, float) for row in points], [], []
    while rows:
        first.append(rows[0])
        last.append(rows[-1])
        rows = [(1 - place) * a + place * b for a, b in pairwise(rows)]
    return first, last[::-1]


@pytest.mark.parametrize("degree", [2, 3, 4, 5])
@pytest.mark.parametrize("place", [0.5, 1 / 3])
@pytest.mark.parametrize("reach", [1.0, 40.0])
def test_a_family_that_is_cut_in_two_goes_on(degree, place, reach):
    rng = np.random.default_rng(degree)
    turn = np.linspace(0, 1.2, degree + 1)
    tilt, far = 0.2 + 0.1 * rng.normal(size=degree + 1), 50 + rng.normal(size=degree + 1)
    parts = halves(np.column_stack([np.cos(turn), np.sin(turn), tilt, far]), place)
    report = check_plane_join(*(PlaneFamily(part, family=BERNSTEIN) for part in parts), reach=reach)
    assert report.geometric_order == 3
    assert report.order == ("C3" if place == 0.5 else "G3")
    assert report.third_jump <= 1e-9
    assert report.scale == pytest.approx(((1 - place) / place, 0, 0), abs=1e-9)


@pytest.mark.parametrize("order", ["C3", "G3"])
@pytest.mark.parametrize("family", [GT, BERNSTEIN])
def test_third_derivatives_that_vanish_are_equal(order, family):
    first = PlaneFamily([[1, 0, 0.2, 50], [0.8, 0.6, 0.3, 51], [0.4, 0.9, 0.1, 49]], family=BERNSTEIN)
    assert not first.derivative(1.0, 3).any()
    second = join_planes(first, 4, order=order, family=family, rest=[[0, 1, 0, 40]])
    assert check_plane_join(first, second, reach=40).order == "C3"


@pytest.mark.parametrize("far", [1e4, 1e6])
def test_orders_do_not_depend_on_the_origin(far):
    rng = np.random.default_rng(11)
    for order in ("G1", "G2", "G3", "C2"):
        pair = random_join(rng, order, FIRST)
        near = check_plane_join(*pair, reach=40)
        away = check_plane_join(*(one.transformed(np.eye(3), [far, -far, 0.3 * far]) for one in pair), reach=40)
        assert (away.order, away.beta) == (near.order, near.beta)
        assert away.order == order
        assert away.third_jump > 1e-3 or order == "G3"
        count = COUNTS[order]
        assert away.scale[:count] == pytest.approx(near.scale[:count], abs=1e-6)


def test_planes_at_right_angles():
    first = PlaneFamily([[1, 0, 0, 5], [1, 1, 0.2, 6], [0, 1, 0, 5]])
    report = check_plane_join(first, PlaneFamily([[1, 0, 0, 5], [1, 0, 1, 6], [0, 0.3, 1, 5]]))
    assert report.plane_angle_deg == pytest.approx(90)
    assert report.order == "none"
    assert math.isnan(report.third_jump)


def test_lower_orders_are_told_apart():
    rng = np.random.default_rng(5)
    for order, expected in (
        ("C0", "C0"),
        ("C1", "C1"),
        ("C2", "C2"),
        ("G0", "G0"),
        ("G1", "G1"),
        ("G2", "G2"),
        (BETA, "G2"),
    ):
        report = check_plane_join(*random_join(rng, order, FIRST), reach=40)
        assert report.order == expected
        assert report.meets(expected)
        assert not report.meets("G3")
    assert check_plane_join(FIRST, random_family(9)).order == "none"
    assert check_plane_join(FIRST, FIRST.reversed()).ruling_angle_deg == pytest.approx(180)
    assert check_plane_join(FIRST, FIRST.reversed()).order == "C0"


@pytest.mark.parametrize("order", ["G1", "G2", BETA, FARIN_BOEHM, "G3"])
@pytest.mark.parametrize("seed", range(4))
def test_the_patches_join_as_surfaces(order, seed):
    """What the planes promise, seen on the patches: tangent planes, and for G2 curvatures, along the common ruling."""
    rng = np.random.default_rng(seed)
    low, high = (0.0, 0.05, 1.0, 0.0), (0.1, 0.0, 1.0, 25.0)
    checked = 0
    while not checked:
        found = random_join(rng, order)
        if found is None:
            continue
        ends = np.linspace(0, 0.06, 2)
        try:
            before = found[0].enveloping(low, high, (0.9, 1.0))
            after = found[1].enveloping(low, high, tuple(ends))
        except InputError:
            continue
        report = check_edge(before, "u1", after, "u0")
        stretches = [sampled_stretch(one, low, np.array([t]))[0] for one, t in zip(found, (1.0, 0.0), strict=True)]
        folds = np.prod(stretches) * (found[0].evaluate(1.0) @ found[1].evaluate(0.0)) < 0
        if COUNTS[order] == 1:  # the planes run on, but the patch may turn back: on the other side of its edge
            assert report.normal_angle_deg == pytest.approx(180 if folds else 0, abs=1e-5)
        else:
            assert report.meets(f"G{COUNTS[order]}")
        checked += 1


def test_ratios_are_those_of_the_points():
    rng = np.random.default_rng(1)
    second = random_join(rng, FARIN_BOEHM, FIRST)[1]
    found = farin_boehm(FIRST, second)
    assert (found.r, found.r_minus) == pytest.approx((1.3, 0.8), rel=1e-9)
    assert found.misfit <= 1e-9
    assert found.apart <= 1e-12
    # the published form, with A1 = N + H (1 + g) and A2 = (1 - g*) H^2 + 2 N H (1 + g) + N (N - 1)
    half = math.pi / 2

    def coefficients(degree, gamma, other):
        n = degree - 2
        return n + half * (1 + gamma), (1 - other) * half**2 + 2 * n * half * (1 + gamma) + n * (n - 1)

    while second.family is BERNSTEIN:
        second = random_join(rng, FARIN_BOEHM, FIRST)[1]
        found = farin_boehm(FIRST, second)
    assert FIRST.family is not BERNSTEIN
    minus = coefficients(FIRST.degree, FIRST.gamma[1], FIRST.gamma[0])
    plus = coefficients(second.degree, *second.gamma)
    left, right = found.r**2 * plus[1] / plus[0] ** 2, found.r_minus * found.r_plus * minus[1] / minus[0] ** 2
    assert left == pytest.approx(right, rel=1e-9)


def test_ratios_of_other_joins_do_not_fit():
    rng = np.random.default_rng(2)
    found = farin_boehm(*random_join(rng, "G2", FIRST))
    assert found.misfit > 0.01 or found.apart > 0.01
    beta = farin_boehm(*random_join(rng, BETA, FIRST))
    assert beta.misfit <= 1e-8
    assert beta.apart <= 1e-8


@pytest.mark.parametrize(
    ("order", "change", "message"),
    [
        ("C2", {"scale": (2, 0, 0)}, "scale must be left alone for C2"),
        ("C2", {"weights": (2, 0, 0, 0)}, "weights must be left alone for C2"),
        (BETA, {"weights": (2, 0, 0, 0)}, "weights must be left alone for G2 beta"),
        ("G2", {"scale": (-1, 0, 0)}, "eta > 0"),
        ("G2", {"scale": (1, 0)}, "three finite numbers"),
        ("G2", {"weights": (0, 0, 0, 0)}, "rho not 0"),
        ("G2", {"ratios": (1, 1)}, "ratios are for Farin-Boehm G2"),
        (FARIN_BOEHM, {}, "ratios are for Farin-Boehm G2 and needed there"),
        (FARIN_BOEHM, {"ratios": (1, -1)}, "two numbers"),
        (FARIN_BOEHM, {"ratios": (1, 1), "scale": (2, 0, 0)}, "scale must be left alone"),
        ("G4", {}, "order must be one of"),
        ("G2", {"scale": None}, "three finite numbers"),
        ("G2", {"scale": "abc"}, "three finite numbers"),
        ("G2", {"weights": (1, math.nan, 0, 0)}, "four finite numbers"),
        (FARIN_BOEHM, {"ratios": 3}, "two numbers"),
        ("G2", {"rest": [[1, 2, 3, 4]]}, "rest must be 3 control planes .* for degree 5, G2; got 1"),
        (
            "G2",
            {"rest": np.ones((1, 12))},
            r"rest must be control planes \(a, b, c, d\), shape \(3, 4\), got \(1, 12\)",
        ),
        ("G2", {"rest": [[1, 2, 3, 4], [1]]}, "rest must be control planes"),
        ("G2", {"rest": "planes"}, "rest must be control planes"),
        ("G2", {"first": 3}, "first must be a PlaneFamily, got int"),
        ("G2", {"gamma": (0, 3)}, r"gamma\[1\] must lie"),
    ],
)
def test_wrong_arguments(order, change, message):
    with pytest.raises(InputError, match=message):
        join_planes(**{"first": FIRST, "degree": 5, "order": order, "rest": np.ones((3, 4)), **change})


def test_joins_that_are_not_determined():
    with pytest.raises(SingularJoin, match="gamma"):
        join_planes(FIRST, 2, order="G1", gamma=(-1, 0), rest=[[0, 1, 0, 1]])
    still = PlaneFamily([[1, 0, 0, 1], [0, 1, 0, 1], [0, 1, 0, 1]])
    with pytest.raises(SingularJoin, match="stands still"):
        join_planes(still, 3, order="G1", rest=[[0, 1, 0, 1]] * 2)
    with pytest.raises(SingularJoin, match="stands still"):
        check_plane_join(still, FIRST)
    line = PlaneFamily([[1, 0, 0, 1], [0, 1, 0, 1]], family=BERNSTEIN)
    with pytest.raises(InputError, match="degree 2 at least"):
        join_planes(line, 3, order=FARIN_BOEHM, ratios=(1, 1), rest=[[0, 1, 0, 1]])
    with pytest.raises(InputError, match="degrees of 2 at least"):
        farin_boehm(line, FIRST)
    for reach in (0, math.inf, "far"):
        with pytest.raises(InputError, match="reach must be"):
            check_plane_join(FIRST, FIRST, reach=reach)
    with pytest.raises(InputError, match="b must be a PlaneFamily, got int"):
        check_plane_join(FIRST, 3)
    for first, second in ((still, FIRST), (FIRST, still.reversed()), (still, still)):
        with pytest.raises(SingularJoin, match="ratios at the joint are not determined"):
            farin_boehm(first, second)


# The effect of the design variables


def test_the_effect_of_gamma():
    planes = PlaneFamily([[1, 0, 0, 20], [1, 1, 0, 24], [0, 1, 0, 20]])
    gammas = [(-0.9, -0.9), (0, 0), (0.5, 0.5), (1, 1)]
    effects = gamma_effects(planes, [0, 0, 1, 0], [0, 0, 1, 10], gammas)
    assert [effect.gamma for effect in effects] == gammas
    assert [effect.patch is None for effect in effects] == [False, False, False, True]
    assert effects[3].refused == "a ruling has no tangent plane at t = 0"
    assert math.isnan(effects[3].area)
    for effect in effects[:3]:
        assert effect.area == pytest.approx(10 * effect.lengths[0], rel=1e-12)
        assert effect.regression_distance == math.inf
    assert effects[1].area == pytest.approx(80 * math.pi, rel=1e-12)
    assert effects[0].area > effects[1].area > effects[2].area
    with pytest.raises(InputError, match="bound_b must be a plane"):
        gamma_effects(planes, [0, 0, 1, 0], [0, 0, 0, 10], gammas)
    with pytest.raises(SingularDevelopable):
        planes.with_gamma((1, 1)).enveloping([0, 0, 1, 0], [0, 0, 1, 10])
