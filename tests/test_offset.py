from __future__ import annotations

import math

import mpmath as mp
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from gtcad import BERNSTEIN, Composite, Curve
from gtcad.differential import signed_curvature
from gtcad.errors import InputError
from gtcad.offset import Offset, offset
from tests.pieces import random_curve

LINE = np.linspace(0, 1, 401)
SEEDS = st.integers(0, 2**31)
PARABOLA = Curve([[-1, 1], [0, -1], [1, 1]], family=BERNSTEIN)  # y = x^2, x = 2 t - 1
QUARTER = Curve([[1, 0], [1, 1], [0, 1]])


def on_parabola(x, distance):
    root = mp.sqrt(1 + 4 * x * x)
    return x - 2 * x * distance / root, x * x + distance / root


def in_space(curve, seed):
    """The curve somewhere in space, and the normal that it turns left around."""
    rng = np.random.default_rng(seed)
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return curve.transformed(axes[:, :2], rng.normal(size=3)), np.cross(axes[:, 0], axes[:, 1]), axes[:, :2]


@given(st.floats(-5, 0.95))
def test_an_offset_of_a_circle_is_a_circle(distance):
    assume(abs(distance) > 1e-6)
    radii = np.linalg.norm(offset(QUARTER, distance).evaluate(LINE), axis=1)
    assert np.abs(radii - (1 - distance)).max() <= 1e-14 * 8  # the centre lies to the left


def test_an_offset_of_a_line_is_a_line_on_the_left():
    line = offset(Curve([[0, 0], [1, 0], [3, 0]], (0.4, -0.2)), 2.0)
    assert np.abs(line.evaluate(LINE)[:, 1] - 2).max() <= 1e-15
    assert line.limit == math.inf


@pytest.mark.parametrize("distance", [-2.0, 0.3, 1.5])
def test_an_offset_of_a_parabola_and_its_derivatives(distance):
    found = Offset(PARABOLA, distance)
    for t in (0.0, 0.31, 0.5, 1.0):
        with mp.workdps(40):
            for axis in range(2):
                series = mp.taylor(lambda s, a=axis: on_parabola(2 * s - 1, mp.mpf(distance))[a], mp.mpf(t), 5)
                wanted = [float(mp.factorial(k) * c) for k, c in enumerate(series)]
                held = [found.derivative(t, k)[axis] for k in range(6)]
                assert np.allclose(held, wanted, rtol=1e-11, atol=1e-11)


@given(SEEDS, st.sampled_from([2, 3, 6, 20]), st.floats(-3, 3))
def test_it_lies_at_the_distance_to_the_left(seed, degree, distance):
    assume(abs(distance) > 1e-3)
    curve = random_curve(np.random.default_rng(seed), degree, 1.0, 2)
    away, along = Offset(curve, distance).evaluate(LINE) - curve.evaluate(LINE), curve.derivative(LINE)
    along = along[1:-1] / np.linalg.norm(along, axis=1)[1:-1, None]  # it may stop at the ends
    away = away[1:-1]
    assert np.abs((away * along).sum(axis=1)).max() <= 1e-11 * abs(distance)
    assert np.abs(along[:, 0] * away[:, 1] - along[:, 1] * away[:, 0] - distance).max() <= 1e-11 * abs(distance)


@given(st.floats(0.51, 5))
def test_cusps_of_a_parabola(distance):
    x = math.sqrt((2 * distance) ** (2 / 3) - 1) / 2  # where (1 + 4 x^2)^(3/2) / 2 = distance
    found = Offset(PARABOLA, distance)
    wanted = [(1 - x) / 2, (1 + x) / 2] if x <= 1 else []
    assert np.allclose(found.cusps, wanted, rtol=0, atol=1e-9)
    assert found.regular == (x > 1)
    assert np.abs(found.derivative(np.array(found.cusps))).max(initial=0) <= 1e-8
    assert found.limit == pytest.approx(0.5, rel=1e-13)
    with pytest.raises(InputError, match=r"stay short of 0\.5 on that side"):
        offset(PARABOLA, distance)
    assert offset(PARABOLA, distance, allow_cusps=True) == found
    assert offset(PARABOLA.reversed(), distance).regular


def test_a_cusp_that_only_touches():
    assert Offset(PARABOLA, 0.5).cusps == pytest.approx((0.5,), abs=1e-5)
    assert Offset(PARABOLA, 0.4999).regular


@given(SEEDS, st.sampled_from([3, 5, 10]), st.sampled_from([-1, 1]))
def test_the_limit_parts_distances_with_cusps_from_those_without(seed, degree, side):
    curve = random_curve(np.random.default_rng(seed), degree, 1.0, 2)
    limit = Offset(curve, side).limit
    tightest = (side * signed_curvature(curve, LINE)).max()
    assert limit <= (1 / tightest if tightest > 0 else math.inf) * (1 + 1e-12)
    if limit == math.inf:
        assert offset(curve, side * 1e3).regular
        return
    assert offset(curve, side * 0.999 * limit).regular
    with pytest.raises(InputError, match=rf"stay short of {side * limit:.6g}"):
        offset(curve, side * 1.001 * limit)


def test_beyond_every_radius_it_runs_backwards():
    with pytest.raises(InputError, match=r"the offset by 2 runs backwards: stay short of 1 "):
        offset(QUARTER, 2.0)
    beyond = offset(QUARTER, 2.0, allow_cusps=True)
    assert beyond.regular
    assert np.allclose(beyond.evaluate([0, 1]), [[-1, 0], [0, -1]], rtol=0, atol=1e-14)
    with pytest.raises(InputError, match="shrinks an arc"):
        Offset(QUARTER, 1.0)


@given(SEEDS, st.floats(-2, 0.4))
def test_in_space_it_stays_in_the_plane(seed, distance):
    assume(abs(distance) > 1e-3)
    lifted, normal, axes = in_space(PARABOLA, seed)
    flat, found = Offset(PARABOLA, distance), Offset(lifted, distance, 3 * normal)
    for order in range(4):
        shift = lifted.evaluate(0.0) - axes @ PARABOLA.evaluate(0.0) if order == 0 else 0
        wanted = flat.derivative(LINE, order) @ axes.T + shift
        assert np.abs(found.derivative(LINE, order) - wanted).max() <= 1e-12 * max(1, np.abs(wanted).max())
    assert found.limit == pytest.approx(0.5 if distance > 0 else math.inf, rel=1e-12)


def test_where_the_curve_stops_at_an_end_the_limit_of_the_normal_is_taken():
    parabola = Curve([[0, 0], [1, 0], [1, 1]], (-1.0, 0.3))  # C'(0) = 0, along a parabola
    assert np.linalg.norm(parabola.derivative(0.0)) == 0
    found = Offset(parabola, -0.5)
    assert np.linalg.norm(found.evaluate(0.0) - found.evaluate(1e-6)) <= 1e-6
    assert found.regular
    assert np.isnan(found.derivative(0.0)).all()


def test_a_chain_is_offset_as_one():
    chain = Composite((QUARTER, Curve([[0, 1], [-3, 1], [-3, -2]])), ("G1",))  # radii 1 and 3
    found = offset(chain, 0.5)
    t = np.linspace(0, 2, 101)
    centres = np.where(t[:, None] < 1, [0.0, 0.0], [0.0, -2.0])
    wanted = np.where(t < 1, 0.5, 2.5)
    assert np.abs(np.linalg.norm(found.evaluate(t) - centres, axis=1) - wanted).max() <= 1e-14
    assert len(found.pieces) == 2
    assert np.allclose(found.pieces[1].evaluate(LINE), found.evaluate(1 + LINE), rtol=0, atol=1e-14)
    assert found.limit == pytest.approx(1)
    assert Offset(chain, 2.0).cusps == (1.0,)  # the first piece runs backwards, the second does not
    with pytest.raises(InputError, match="has cusps at t = 1:"):
        offset(chain, 2.0)
    closed = Composite(
        (chain.pieces[0], Curve([[0, 1], [-1, 1], [-1, 0], [-1, -2], [1, -2], [1, 0]])), ("G1", "G1"), True
    )
    assert 0.0 in Offset(closed, 1.2).cusps


def test_corners_are_refused():
    corner = Composite((Curve([[0, 0], [1, 0], [2, 0]]), Curve([[2, 0], [2, 1], [2, 2]])), ("C0",))
    with pytest.raises(InputError, match="joint 0 is a corner: the tangents differ by 90 degrees"):
        offset(corner, 0.1)


@pytest.mark.parametrize(
    ("curve", "distance", "normal", "message"),
    [
        (PARABOLA, 0.0, None, "distance must be a finite number other than 0"),
        (PARABOLA, math.nan, None, "distance must be"),
        (PARABOLA, "near", None, "distance must be"),
        (PARABOLA, 1.0, (0, 0, 1), "normal is for curves in space"),
        (Curve([[0, 0, 0], [1, 1, 0], [2, 0, 0]]), 1.0, None, "normal of the plane must be"),
        (Curve([[0, 0, 0], [1, 1, 0], [2, 0, 0]]), 1.0, (0, 0, 0), "normal of the plane must be"),
        (Curve([[0, 0, 0], [1, 1, 0], [2, 0, 0.25]]), 1.0, (0, 0, 1), r"its points leave it by 0\.25"),
        (Curve([[0, 0], [2, 0], [0, 0]], family=BERNSTEIN), 1.0, None, r"stops at t = 0\.5"),
        (Curve([[1, 1], [1, 1], [1, 1]]), 1.0, None, "must not be a point"),
    ],
)
def test_what_has_no_offset_is_refused(curve, distance, normal, message):
    with pytest.raises(InputError, match=message):
        offset(curve, distance, normal=normal)
