from __future__ import annotations

import math

import numpy as np
import pytest

from gtcad import Curve, Restricted
from gtcad.converters.arcs import certify_arc, curve_of_arc, ellipse_arc
from gtcad.converters.part import EllipseArc

RNG = np.random.default_rng(2)


def ways(curve):
    """The curve, parts of it, and parts run backwards."""
    return [curve, *(Restricted(curve, part) for part in ((0.0, 0.3), (0.2, 0.9), (0.9, 0.1), (1.0, 0.0)))]


@pytest.mark.parametrize("seed", range(10))
def test_random_pieces_are_arcs_at_the_speed_of_the_curve(seed):
    curve = Curve(np.random.default_rng(seed).normal(0, 40, (3, 3)))
    t = np.linspace(0, 1, 33)
    for way in ways(curve):
        arc = ellipse_arc(way)
        angles = arc.start + (arc.end - arc.start) * t
        assert np.abs(arc.evaluate(angles) - way.evaluate(t)).max() < 1e-12
        assert np.abs(curve_of_arc(arc).evaluate(t) - way.evaluate(t)).max() < 1e-12
        assert abs(arc.axis_a @ arc.axis_b) <= 1e-13 * np.linalg.norm(arc.axis_a) * np.linalg.norm(arc.axis_b)
        found = certify_arc(way, arc)
        assert found.lower <= np.abs(arc.evaluate(angles) - way.evaluate(t)).max() + 1e-13
        assert found.upper < 1e-10


def test_a_circle_is_one():
    arc = ellipse_arc(Curve([[10, 0, 5], [10, 10, 5], [0, 10, 5]]))
    assert arc.is_circle
    assert arc.center.tolist() == [0, 0, 5]
    assert (arc.start, arc.end) == (0.0, math.pi / 2)
    assert not ellipse_arc(Curve([[10, 0, 5], [10, 8, 5], [0, 8, 5]])).is_circle


@pytest.mark.parametrize(
    "curve",
    [
        Curve([[10, 0, 0], [10, 10, 0], [0, 10, 0]], gamma=(0.1, 0.0)),
        Curve([[10, 0, 0], [10, 10, 0], [0, 10, 0], [0, 0, 0]]),
        Curve([[10, 0], [10, 10], [0, 10]]),
        Curve([[0, 0, 0], [1, 1, 1], [3, 3, 3]]),
    ],
    ids=["gamma", "degree 3", "plane", "collinear"],
)
def test_other_curves_are_none(curve):
    assert ellipse_arc(curve) is None


@pytest.mark.parametrize("shift", [1e-9, 1e-4, 1.0])
def test_a_moved_arc_is_found_out(shift):
    """A circle moved off its plane is so far away everywhere."""
    curve = Curve([[10, 0, 0], [10, 10, 0], [0, 10, 0]])
    arc = ellipse_arc(curve)
    moved = EllipseArc(arc.center + [0, 0, shift], arc.axis_a, arc.axis_b, arc.start, arc.end)
    found = certify_arc(curve, moved)
    assert found.lower <= shift * (1 + 1e-12) <= found.upper * (1 + 1e-9)
    assert found.upper <= shift * 1.02 + 1e-11
    longer = EllipseArc(arc.center, arc.axis_a, arc.axis_b, arc.start, arc.end + 1e-3)
    assert certify_arc(curve, longer).upper == pytest.approx(0.01, rel=0.02)
