from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from gtcad import BERNSTEIN, Composite, Curve, Restricted
from gtcad.conics import Arc, circle
from gtcad.converters.arcs import arc_of_chain, certify_arc, certify_chain_arc, curve_of_arc, ellipse_arc
from gtcad.converters.part import EllipseArc
from gtcad.errors import InputError


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


# Chains


def lifted(chain):
    """Into a plane of space that is along no axis."""
    return chain.transformed(np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0][:, :2], [1, 2, 3])


def plain(chain):
    """The same pieces, not known to be one arc."""
    return Composite(chain.pieces, chain.orders, chain.closed)


TURNS = [(0, 90), (10, 101), (0, 270), (30, 389.999), (200, -70), (0, -359.999), (725, 635), (0, 90 + 1e-9), (5, 35)]
AXES = [([40, 0], [0, 40]), ([40, 0], [0, 5]), ([30, 10], [-20, 25]), ([30, 10], [29, 11])]


@pytest.mark.parametrize("axes", AXES, ids=["circle", "ellipse", "oblique", "flat"])
@pytest.mark.parametrize("ends", [*TURNS, (0, 360), (77.7, 77.7 - 360)], ids=str)
@pytest.mark.parametrize("form", [lambda chain: chain, plain, lambda chain: plain(chain).reversed()])
def test_a_chain_of_quarters_is_one_arc(axes, ends, form):
    chain = form(lifted(Arc([3, 4], *axes, *ends)))
    arc = arc_of_chain(chain)
    turn = math.radians(abs(ends[1] - ends[0]))
    assert arc.end - arc.start == pytest.approx(turn, rel=1e-14)
    assert abs(arc.axis_a @ arc.axis_b) <= 1e-13 * np.linalg.norm(arc.axis_a) * np.linalg.norm(arc.axis_b)
    assert abs(arc.evaluate([arc.start, arc.end]) - chain.evaluate([0, chain.domain[1]])).max() < 1e-12
    proofs = certify_chain_arc(chain, arc)
    assert len(proofs) == len(chain.pieces)
    assert max(proof.upper for proof in proofs) < 1e-10
    # evenly in the angle: each piece by its own part of the turn
    parts = [abs(np.subtract(*getattr(piece, "range", (0, 1)))) * math.pi / 2 for piece in chain.pieces]
    t, begin = np.linspace(0, 1, 9), arc.start
    for piece, part in zip(chain.pieces, parts, strict=True):
        assert abs(piece.evaluate(t) - arc.evaluate(begin + part * t)).max() < 1e-12
        begin += part


def test_a_full_turn_is_one_however_its_angles_round():
    for start in np.random.default_rng(1).uniform(-400, 400, 50).tolist():
        chain = Arc([0, 0, 0], [2, 0, 0], [0, 1, 1], start, start - 360)
        for form in (chain, plain(chain)):
            arc = arc_of_chain(form)
            assert arc.end - arc.start == pytest.approx(2 * math.pi, rel=1e-15)


def test_a_circle_far_away_keeps_its_radius():
    """Its control points, to rounding, are those of an ellipse."""
    arc = arc_of_chain(circle([1234.5, -987.6, 0.1], 0.3))
    assert arc.is_circle
    assert arc.axis_a.tolist() == [0.3, 0, 0]
    assert arc.center.tolist() == [1234.5, -987.6, 0.1]
    assert (arc.start, arc.end) == (0.0, 2 * math.pi)


def test_parts_of_parts_are_one_arc():
    quarter = Curve([[10, 0, 5], [10, 10, 5], [0, 10, 5]])
    pieces = [Restricted(Restricted(quarter, (0.2, 0.8)), (0.0, 0.5)), Restricted(quarter, (0.5, 0.9))]
    arc = arc_of_chain(Composite(pieces, ["G3"]))
    assert arc.is_circle
    assert (arc.start, arc.end) == pytest.approx((0.1 * math.pi, 0.45 * math.pi))
    assert max(proof.upper for proof in certify_chain_arc(Composite(pieces, ["G3"]), arc)) < 1e-12


@pytest.mark.parametrize("seed", range(20))
def test_a_full_turn_in_many_parts_is_one(seed):
    """Whose lengths sum up to a full turn but for rounding, one way or the other."""
    pieces = []
    inner = np.random.default_rng(seed).uniform(0.1, 0.9, (4, 4)).tolist()
    for whole, places in zip(circle([0, 0, 0], 5).pieces, inner, strict=True):
        ends = [0.0, *sorted(places), 1.0]
        pieces += [Restricted(whole, part) for part in pairwise(ends)]
    arc = arc_of_chain(Composite(pieces, ["G3"] * 20, closed=True))
    assert (arc.start, arc.end) == (0.0, 2 * math.pi)


def quarter(radius=10.0, start=0.0, sense=1.0, height=0.0):
    return Arc([0, 0, height], [radius, 0, 0], [0, radius, 0], start, start + sense * 90).pieces[0]


@pytest.mark.parametrize(
    "pieces",
    [
        [quarter(), quarter(radius=11.0, start=90)],
        [quarter(), quarter(radius=10 + 1e-9, start=90)],
        [quarter(), quarter(start=91)],
        [quarter(), quarter(start=90, height=1.0)],
        [quarter(), quarter(start=90, sense=-1)],
        [quarter(), quarter(start=180, sense=-1)],
        [quarter(), quarter()],
        [quarter(), Curve([[0, 10, 0], [-12, 10, 0], [-12, 0, 0]])],
        [quarter(), Curve([[0, 10, 0], [0, 20, 0], [-10, 20, 0]])],
        [quarter(), Curve([[0, 10, 0], [-10, 10, 1], [-10, 0, 1]])],
        [quarter(), Curve([[0, 10, 0], [-10, 10, 0], [-10, 0, 0]], gamma=(0.1, 0.0))],
        [quarter(), Curve([[0, 10, 0], [-10, 10, 0]], family=BERNSTEIN)],
        [quarter(start=90 * k) for k in range(5)],
        [*(quarter(start=90 * k) for k in range(4)), Restricted(quarter(), (0.0, 1e-6))],
        [Curve([[0, 0, 0], [1, 0, 0], [3, 0, 0]]), Curve([[3, 0, 0], [2, 0, 0], [0, 0, 0]])],
    ],
    ids=[
        "radius",
        "radius by little",
        "gap",
        "height",
        "back on itself",
        "not from the end",
        "twice the same",
        "another ellipse",
        "kink",
        "out of the plane",
        "gamma",
        "line",
        "more than a turn",
        "a little more",
        "flat",
    ],
)
def test_other_chains_are_none(pieces):
    assert arc_of_chain(Composite(pieces, ["C0"] * (len(pieces) - 1))) is None


def test_plane_chains_are_none():
    assert arc_of_chain(circle([0, 0], 1)) is None
    with pytest.raises(InputError, match=r"space curve of degree 2 with gamma = \(0, 0\)"):
        certify_chain_arc(circle([0, 0], 1), ellipse_arc(quarter()))


@pytest.mark.parametrize("shift", [1e-9, 1e-3])
def test_each_piece_of_a_chain_has_its_own_proof(shift):
    """Against an arc that begins too late the angles differ most where a piece begins, by a known amount."""
    chain = circle([0, 0, 0], 10)
    arc = arc_of_chain(chain)
    longer = EllipseArc(arc.center, arc.axis_a, arc.axis_b, arc.start + shift, arc.end)
    for k, proof in enumerate(certify_chain_arc(chain, longer)):
        wanted = 2 * 10 * math.sin(shift * (4 - k) / 8)
        assert proof.lower <= wanted * (1 + 1e-9) + 1e-13
        assert wanted <= proof.upper * (1 + 1e-9)
        assert proof.upper == pytest.approx(wanted, rel=0.02, abs=1e-11)
