from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq, minimize_scalar

from gtcad import Composite, Curve, Restricted
from gtcad.errors import InputError
from gtcad.queries import intersect_plane, nearest, split
from tests.pieces import ellipse, graph, random_curve

LINE = np.linspace(0, 1, 801)
SEEDS = st.integers(0, 2**31)


def searched(curve, point):
    """The least distance by dense samples and bounded minimisation."""
    last = curve.domain[1]
    t = last * LINE

    def distance(s):
        return float(np.linalg.norm(curve.evaluate(np.clip(s, 0, last)) - point))

    best = []
    for k in np.argsort(np.linalg.norm(curve.evaluate(t) - point, axis=1))[:3]:
        low, high = t[max(k - 1, 0)], t[min(k + 1, len(t) - 1)]
        best.append(
            float(minimize_scalar(distance, bounds=(low, high), method="bounded", options={"xatol": 1e-10}).fun)
        )
    return min(*best, distance(0), distance(last))


@given(SEEDS, st.sampled_from([2, 3, 5, 9, 20, 60]), st.sampled_from([2, 3]), st.sampled_from([0.01, 1.0, 1e4]))
def test_the_foot_is_the_nearest_point_of_all(seed, degree, dimension, size):
    rng = np.random.default_rng(seed)
    curve = random_curve(rng, degree, size, dimension)
    point = rng.normal(0, 0.5, dimension) * size
    foot = nearest(curve, point)
    assert foot.distance <= searched(curve, point) + 1e-12 * size
    assert foot.distance == pytest.approx(np.linalg.norm(curve.evaluate(foot.parameter) - point), abs=1e-13 * size)
    assert np.allclose(foot.point, curve.evaluate(foot.parameter), rtol=0, atol=1e-13 * size)


@given(SEEDS)
def test_the_foot_on_a_chain_is_the_nearest_point_of_all(seed):
    rng = np.random.default_rng(seed)
    first, second = random_curve(rng, 4, 1.0), random_curve(rng, 3, 1.0)
    second = second.transformed(np.eye(3), first.control_points[-1] - second.control_points[0])
    chain = Composite((first, second), ("C0",))
    point = rng.normal(0, 1, 3)
    assert nearest(chain, point).distance <= searched(chain, point) + 1e-12


@given(SEEDS, st.floats(0, 1))
def test_a_point_of_the_curve_is_its_own_foot(seed, t):
    curve = random_curve(np.random.default_rng(seed), 5, 1.0)
    foot = nearest(curve, curve.evaluate(t))
    assert foot.distance <= 1e-14


@given(st.floats(0.01, 1.6))
def test_feet_on_an_ellipse_from_its_axis(x):
    foot = nearest(ellipse(), (x, 0.0))
    wanted = 9 * x / 5  # a^2 x / (a^2 - b^2), as long as x < (a^2 - b^2) / a
    assert np.allclose(foot.point, [wanted, 2 * math.sqrt(1 - (wanted / 3) ** 2)], rtol=0, atol=1e-7)
    assert foot.parameter <= 1  # of the two feet that are equally near, above and below


def test_of_equally_near_points_the_first_is_taken():
    assert nearest(ellipse(1, 1), (0, 0)).parameter == 0
    assert nearest(ellipse(), (0, 0)).parameter == 1
    assert nearest(ellipse(), (4, 0)).parameter == 0


@pytest.mark.parametrize("point", [(0, 0, 0), (math.nan, 0), "ab", ((0, 0),)])
def test_points_of_another_space_are_refused(point):
    with pytest.raises(InputError, match="point must be 2"):
        nearest(ellipse(), point)


@given(st.floats(-2.9, 2.9), st.floats(0.1, math.pi - 0.1))
def test_a_line_meets_an_ellipse_in_two_points(x, angle):
    across = np.array([math.sin(angle), -math.cos(angle)])
    met = intersect_plane(ellipse(), (x, 0), 7 * across)
    assert len(met) == 2
    assert not any(crossing.touches for crossing in met)
    for crossing in met:
        assert abs((crossing.point - [x, 0]) @ across) <= 1e-13
        assert (crossing.point / [3, 2]) @ (crossing.point / [3, 2]) == pytest.approx(1, abs=1e-13)


def test_joints_and_the_seam_of_a_closed_chain_are_met_once():
    assert [(c.parameter, c.touches) for c in intersect_plane(ellipse(), (3, 0), (1, 0))] == [(0.0, True)]
    assert [(c.parameter, c.touches) for c in intersect_plane(ellipse(), (0, 2), (0, 1))] == [(1.0, True)]
    assert [(c.parameter, c.touches) for c in intersect_plane(ellipse(), (0, 0), (0, 1))] == [
        (0.0, False),
        (2.0, False),
    ]
    assert intersect_plane(ellipse(), (3.0001, 0), (1, 0)) == ()


def test_touching_inside_a_piece_and_a_flat_crossing():
    parabola, cubic = graph(1, -1, 1), graph(-1, 1, -1, 1)
    (touch,), (crossing,) = (intersect_plane(curve, (0, 0), (0, 1)) for curve in (parabola, cubic))
    assert touch.touches
    assert not crossing.touches  # through 0 with a horizontal tangent
    assert abs(touch.parameter - 0.5) <= 1e-6
    assert abs(crossing.parameter - 0.5) <= 1e-4


def test_ends_on_the_plane_do_not_touch():
    met = intersect_plane(Curve([[1, 0], [1, 1], [0, 1]]), (1, 0), (1, 1))
    assert [(round(c.parameter, 9), c.touches) for c in met] == [(0.0, False), (1.0, False)]


@given(SEEDS, st.sampled_from([2, 4, 8, 25]))
def test_no_crossing_is_missed(seed, degree):
    rng = np.random.default_rng(seed)
    curve = random_curve(rng, degree, 10.0)
    base, across = curve.evaluate(rng.random()), rng.normal(0, 1, 3)

    def height(t):
        return float((curve.evaluate(t) - base) @ across)

    heights = (curve.evaluate(LINE) - base) @ across
    wanted = [brentq(height, LINE[k], LINE[k + 1]) for k in np.flatnonzero(heights[:-1] * heights[1:] < 0)]
    met = intersect_plane(curve, base, across)
    for t in wanted:
        assert min(abs(crossing.parameter - t) for crossing in met) <= 1e-6
    for crossing in met:
        assert abs((crossing.point - base) @ across) <= 1e-11
    signs = np.sign([height(t) for t in (0.0, 1.0)])
    assert (len([crossing for crossing in met if not crossing.touches]) % 2 == 1) == (signs[0] * signs[1] < 0)


def test_a_curve_in_the_plane_is_refused():
    with pytest.raises(InputError, match="the curve lies in the plane"):
        intersect_plane(Curve([[0, 0, 1], [1, 0, 1], [3, 5, 1]], (0.2, 0.7)), (9, 9, 1), (0, 0, 2))
    chain = Composite((Curve([[0, 1], [1, 2], [2, 0]]), Curve([[2, 0], [3, 0], [4, 0]])), ("C0",))
    with pytest.raises(InputError, match="piece 1 lies in the plane"):
        intersect_plane(chain, (0, 0), (0, 1))
    with pytest.raises(InputError, match="normal must not vanish"):
        intersect_plane(chain, (0, 0), (0, 0))


@given(SEEDS, st.floats(0.001, 0.999))
def test_the_parts_of_a_curve_are_the_curve(seed, t):
    curve = random_curve(np.random.default_rng(seed), 5, 1.0)
    before, after = split(curve, t)
    assert np.allclose(before.evaluate(LINE), curve.evaluate(t * LINE), rtol=0, atol=1e-14)
    assert np.allclose(after.evaluate(LINE), curve.evaluate(np.minimum(t + (1 - t) * LINE, 1)), rtol=0, atol=1e-13)
    assert np.array_equal(before.evaluate(1.0), after.evaluate(0.0))


def test_the_parts_of_a_chain_keep_its_joints():
    open_chain = Composite(ellipse().pieces[:3], ("G1", "G2"))
    for t, counts, orders in (
        (0.3, (1, 3), ((), ("G1", "G2"))),
        (1.5, (2, 2), (("G1",), ("G2",))),
        (2.0, (2, 1), (("G1",), ())),
        (1 + 1e-12, (1, 2), ((), ("G2",))),
    ):
        parts = split(open_chain, t)
        assert tuple(len(part.pieces) for part in parts) == counts
        assert tuple(part.orders for part in parts) == orders
        assert np.allclose(parts[0].evaluate(counts[0]), open_chain.evaluate(t), rtol=0, atol=1e-11)
        assert np.allclose(parts[1].evaluate(0.0), open_chain.evaluate(t), rtol=0, atol=1e-11)
    for part in split(ellipse(), 2.5):
        assert not part.closed
        assert len(part.orders) == len(part.pieces) - 1
    assert all(report.meets("G1") for part in split(ellipse(), 2.5) for report in part.report())


@pytest.mark.parametrize("t", [0, 1, -0.1, 1e-12, math.nan, "middle", None])
def test_a_split_at_an_end_is_refused(t):
    with pytest.raises(InputError, match="t must"):
        split(Curve([[0, 0], [1, 1], [2, 0]]), t)


def test_parts_can_be_split_again():
    curve = Curve([[0, 0], [1, 3], [2, -1], [4, 0]], (0.5, -0.3))
    middle = split(split(curve, 0.25)[1], 2 / 3)[0]
    assert np.allclose(middle.evaluate(LINE), Restricted(curve, (0.25, 0.75)).evaluate(LINE), rtol=0, atol=1e-14)
