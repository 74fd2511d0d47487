from __future__ import annotations

import math

import numpy as np
import pytest

from gtcad import BERNSTEIN, Curve, Restricted, differential
from gtcad.basis import Basis
from gtcad.continuity import Start, Thresholds, chain_rule, check_join, join_curve, join_nearest, parsed_order
from gtcad.converters.exact import exact_curve
from gtcad.errors import InputError, SingularJoin
from tests import pieces


def test_the_chain_rule_is_that_of_a_reparametrisation():
    """C(1 + p(x)) with p = eta x + psi x^2 / 2 + omega x^3 / 6, for a cubic C: polynomials throughout."""
    eta, psi, omega = 0.7, -1.3, 2.1
    p = np.polynomial.Polynomial([1, eta, psi / 2, omega / 6])
    curve = np.polynomial.Polynomial([2.0, -1.0, 0.5, 3.0])
    ends = np.array([curve.deriv(r)(1.0) if r else curve(1.0) for r in range(4)])
    composed = curve(p)
    wanted = [composed.deriv(r)(0.0) if r else composed(0.0) for r in range(4)]
    assert chain_rule((eta, psi, omega), 4) @ ends == pytest.approx(wanted, rel=1e-14)


@pytest.mark.parametrize(
    ("degree", "gamma", "order"),
    [
        (2, (-1.0, 0.3), "G1"),
        (2, (0.3, 1.0), "G2"),
        (3, (-1.0, 1.0), "C2"),
        (2, (0.1, 0.2), "C3"),
        (3, (0.4, 1.0), "G3"),
        (4, (-1.0, 1.0), "C3"),
    ],
)
def test_undetermined_control_points_are_refused(degree, gamma, order):
    first = Curve([[0, 0], [1, 2], [3, 2], [4, 0]], (0.2, 0.3))
    rest = np.ones((max(0, degree - int(order[1])), 2))
    with pytest.raises(SingularJoin) as caught:
        join_curve(first, degree, order=order, gamma=gamma, rest=rest)
    assert f"degree {degree}" in str(caught.value)
    assert caught.value.conditioning < 1e-10


def test_conditioning_is_reported_near_a_singular_case():
    values = [Start.of(Basis(3, (-1 + d, 1 - d)), 2).conditioning[2] for d in (1e-2, 1e-4, 1e-6)]
    assert values == sorted(values, reverse=True)
    assert 1e-8 < values[-1] < 1e-5


@pytest.mark.parametrize(
    "first",
    [Curve([[0, 0], [1, 1], [2, 0]], (0.3, -1.0)), Curve([[0, 0], [1, 1], [2, 0], [2, 0]], (0.3, 0.1))],
    ids=["gamma", "equal points"],
)
def test_a_first_curve_without_a_tangent_is_refused(first):
    with pytest.raises(SingularJoin, match="no tangent"):
        join_curve(first, 3, order="G1", rest=[[3, 3], [4, 4]])
    assert join_curve(first, 2, order="C0", rest=[[3, 3], [4, 4]]).control_points[0].tolist() == [2, 0]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"order": "C4"}, "order must be one of"),
        ({"order": 2}, "order must be one of"),
        ({"order": "C1", "scale": (2.0, 0.0, 0.0)}, "scale is for G joins"),
        ({"order": "G1", "scale": (-1.0, 0.0, 0.0)}, "eta > 0"),
        ({"order": "G1", "scale": (1.0, math.nan, 0.0)}, "finite"),
        ({"order": "G2", "rest": [[1, 1]]}, "rest must be 2 control points"),
        ({"order": "G2", "rest": [[1, 1, 2, 3]]}, r"rest must be control points, shape \(2, \d\), got \(1, 4\)"),
        ({"order": "G2", "rest": "points"}, "rest must be control points, shape"),
        ({"order": "G1", "gamma": (0.0, 2.0)}, "gamma"),
    ],
)
def test_bad_arguments(options, message):
    arguments = {"degree": 4, "rest": [[1, 1]] * 3, **options}
    with pytest.raises(InputError, match=message):
        join_curve(Curve([[0, 0], [1, 1], [2, 0]]), **arguments)


def test_parsed_order():
    assert parsed_order("G3") == ("G", 3)


def arc(radius, start, end, center=(0.0, 0.0)):
    """An arc of a circle between two angles in one quadrant, in degrees."""
    quarter = Curve(np.array([[radius, 0], [radius, radius], [0, radius]]) + center)
    return Restricted(quarter, (start / 90, end / 90))


def test_a_line_and_an_arc_join_g1():
    line = Curve([[-5, 0], [0, 0]], family=BERNSTEIN)
    turn = Curve([[0, 0], [2, 0], [2, 2]])
    report = check_join(line, turn)
    assert report.order == "G1"
    assert report.gap == 0
    assert report.tangent_angle_deg < 1e-12
    assert report.curvature_jump == pytest.approx(1.0)


def test_arcs_of_two_radii_jump_in_curvature():
    small, large = arc(2.0, 20, 45), arc(3.0, 45, 80)
    shift = small.evaluate(1.0) - large.evaluate(0.0)
    report = check_join(small, large.transformed(np.eye(2), shift))
    assert report.order == "G1"
    assert report.curvature_jump == pytest.approx(1 - 2 / 3)


def test_arcs_of_one_circle_join_at_every_order_also_as_rational_splines():
    before, after = arc(2.0, 10, 50), arc(2.0, 50, 75)
    assert check_join(before, after).order == "G3"
    assert check_join(arc(2.0, 10, 40), arc(2.0, 40, 70)).order == "C3"
    splines = [exact_curve(one)[0] for one in (before, after)]
    assert check_join(*splines).order == "G3"


def test_a_kink_and_a_gap():
    a, b = Curve([[0, 0], [1, 0]], family=BERNSTEIN), Curve([[1, 0], [2, 1]], family=BERNSTEIN)
    report = check_join(a, b)
    assert report.order == "C0"
    assert report.tangent_angle_deg == pytest.approx(45.0)
    apart = check_join(a, Curve([[1, 1e-3], [2, 1]], family=BERNSTEIN))
    assert apart.order == "none"
    assert apart.gap == pytest.approx(1e-3)
    assert not apart.meets("C0")
    assert check_join(a, b, thresholds=Thresholds(angle_deg=50)).order[1] >= "1"


def test_jumps_against_differential_geometry():
    rng = np.random.default_rng(3)
    for _ in range(20):
        first, second = pieces.random_curve(rng, 5, 10.0), pieces.random_curve(rng, 4, 10.0)
        second = second.transformed(np.eye(3), first.evaluate(1.0) - second.evaluate(0.0))
        report = check_join(first, second)
        kappa = [float(differential.curvature(c, t)) for c, t in ((first, 1.0), (second, 0.0))]
        rate = [float(differential.curvature_rate(c, t)) for c, t in ((first, 1.0), (second, 0.0))]
        torsion = [float(differential.torsion(c, t)) for c, t in ((first, 1.0), (second, 0.0))]
        scale = max(abs(rate[0]), abs(rate[1]), kappa[0] ** 2, kappa[1] ** 2)
        assert report.curvature_rate_jump == pytest.approx(abs(rate[1] - rate[0]) / scale, rel=1e-9)
        assert report.torsion_jump == pytest.approx(abs(torsion[1] - torsion[0]), rel=1e-9)
        tangents = [differential.tangent(c, t) for c, t in ((first, 1.0), (second, 0.0))]
        assert report.tangent_angle_deg == pytest.approx(math.degrees(math.acos(tangents[0] @ tangents[1])), rel=1e-6)


def test_thresholds_decide_the_order():
    """A G2 join whose curvature is off by 1e-5: G2 within 1e-4, G1 within 1e-6."""
    first = Curve([[0, 0], [1, 2], [3, 2], [4, 0]], (0.2, 0.3))
    joined = join_curve(first, 4, order="G2", rest=[[6, 0], [7, 1]])
    points = np.array(joined.control_points)
    points[2] += 1e-5 * (points[2] - points[1])[::-1] * [1, -1]
    moved = Curve(points, joined.gamma)
    jump = check_join(first, moved).curvature_jump
    assert 1e-6 < jump < 1e-4
    assert check_join(first, moved).order == "C1"
    assert check_join(first, moved, thresholds=Thresholds(curvature=1e-4)).meets("G2")


@pytest.mark.parametrize("order", ["G1", "G2", "G3"])
def test_the_nearest_join_beats_every_other_scale(order):
    rng = np.random.default_rng(8)
    first = pieces.random_curve(rng, 5, 10.0)
    rest = first.evaluate(1.0) + rng.normal(0, 3, (5 - int(order[1]), 3))
    drawn = join_curve(first, 5, order=order, gamma=(0.1, 0.2), scale=(0.7, 0.0, 0.0), rest=rest)
    wanted = Curve(drawn.control_points + rng.normal(0, 0.3, (6, 3)), drawn.gamma)
    joined, scale = join_nearest(first, wanted, order=order)
    assert check_join(first, joined).meets(order)

    def moved(curve):
        return float(((curve.control_points - wanted.control_points) ** 2).sum())

    count = int(order[1])
    for _ in range(300):
        nearby = np.array(scale) + rng.normal(0, 0.1, 3) * [scale[0], count > 1, count > 2]
        other = join_curve(
            first, 5, order=order, gamma=wanted.gamma, scale=tuple(nearby), rest=wanted.control_points[count + 1 :]
        )
        assert moved(joined) <= moved(other) * (1 + 1e-9)
