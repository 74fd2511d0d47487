from __future__ import annotations

import numpy as np
import pytest

from gtcad import Curve
from gtcad._chain_system import ChainSystem
from gtcad.composite import Composite
from gtcad.continuity import chain_rule
from gtcad.errors import InputError, SingularJoin
from tests import pieces


def loop(rng, count, degree, noise, closed=True):
    """Curves around an ellipse, as a hasty designer draws them: their ends only nearly meet."""
    drawn = []
    for k in range(count):
        angle = 2 * np.pi * np.linspace(k, k + 1, degree + 1) / (count if closed else 1.5 * count)
        points = np.stack([100 * np.cos(angle), 60 * np.sin(angle), 10 * np.sin(2 * angle)], axis=1)
        drawn.append(Curve(points + rng.normal(0, noise, points.shape), pieces.random_gamma(rng)))
    return drawn


def moved(before, after):
    return sum(float(((a.control_points - b.control_points) ** 2).sum()) for a, b in zip(before, after, strict=True))


@pytest.mark.parametrize("closed", [False, True], ids=["open", "closed"])
@pytest.mark.parametrize("order", ["C0", "C1", "C2", "C3", "G1", "G2", "G3"])
def test_all_joints_meet_their_order(order, closed):
    drawn = loop(np.random.default_rng(4), 5, 7, 3.0, closed)
    chain = Composite.solved(drawn, [order] * (5 if closed else 4), closed=closed)
    reports = chain.report()
    assert len(reports) == (5 if closed else 4)
    assert all(report.meets(order) and report.gap == 0 for report in reports)
    assert [piece.gamma for piece in chain.pieces] == [piece.gamma for piece in drawn]


def test_mixed_orders():
    drawn = loop(np.random.default_rng(5), 4, 6, 2.0)
    orders = ["G3", "C0", "C2", "G1"]
    chain = Composite.solved(drawn, orders, closed=True)
    assert all(report.meets(order) for report, order in zip(chain.report(), orders, strict=True))


def test_a_chain_that_already_joins_does_not_move():
    drawn = loop(np.random.default_rng(6), 4, 6, 2.0)
    chain = Composite.solved(drawn, ["G2"] * 4, closed=True)
    again = Composite.solved(chain.pieces, ["G2"] * 4, closed=True)
    assert moved(chain.pieces, again.pieces) < 1e-12 * moved(drawn, chain.pieces)


def test_no_other_chain_that_meets_the_orders_is_nearer():
    """Random directions in the null space of the conditions, built here from the end derivatives alone."""
    rng = np.random.default_rng(7)
    drawn = loop(rng, 3, 5, 4.0)
    scales = [(1.3, 0.2, 0.0), (0.8, -0.1, 0.0), (1.1, 0.4, 0.0)]
    chain = Composite.solved(drawn, ["G2"] * 3, closed=True, scales=scales)
    rows = []
    for joint, scale in enumerate(scales):
        block = np.zeros((3, 18))
        after = (joint + 1) % 3
        for r in range(3):
            block[r, 6 * after : 6 * after + 6] += drawn[after].factors.derivative(0.0, r)
        before = np.array([drawn[joint].factors.derivative(1.0, r) for r in range(3)])
        block[:, 6 * joint : 6 * joint + 6] -= chain_rule(scale, 3) @ before
        rows.append(block)
    matrix = np.concatenate(rows)
    points = np.concatenate([piece.control_points for piece in chain.pieces])
    original = np.concatenate([piece.control_points for piece in drawn])
    assert np.abs(matrix @ points).max() < 1e-10 * np.abs(matrix).max() * np.abs(points).max()
    null = np.linalg.svd(matrix)[2][np.linalg.matrix_rank(matrix) :]
    assert np.abs(null @ (points - original)).max() < 1e-9  # the move is orthogonal to all that is allowed


def test_free_scales_move_less_than_given_ones():
    drawn = loop(np.random.default_rng(8), 4, 6, 3.0)
    best = moved(drawn, Composite.solved(drawn, ["G2"] * 4, closed=True).pieces)
    rng = np.random.default_rng(0)
    for _ in range(20):
        scales = [(float(np.exp(rng.normal(0, 0.2))), float(rng.normal(0, 0.5)), 0.0) for _ in range(4)]
        given = moved(drawn, Composite.solved(drawn, ["G2"] * 4, closed=True, scales=scales).pieces)
        assert best <= given * (1 + 1e-9)


def test_fixed_control_points_stay():
    drawn = loop(np.random.default_rng(9), 4, 6, 3.0)
    fixed = [(0, 0), (1, 3), (2, 6)]
    chain = Composite.solved(drawn, ["C1"] * 4, closed=True, fixed=fixed)
    for piece, k in fixed:
        wanted = drawn[piece].control_points[k]
        assert np.abs(chain.pieces[piece].control_points[k] - wanted).max() < 1e-10


def test_conditions_that_contradict_each_other_are_refused():
    drawn = loop(np.random.default_rng(10), 3, 4, 3.0)
    every = [(piece, k) for piece in range(3) for k in range(5)]
    with pytest.raises(SingularJoin, match="cannot all be met"):
        Composite.solved(drawn, ["C1"] * 3, closed=True, fixed=every)


def test_local_control_is_what_a_change_does():
    drawn = loop(np.random.default_rng(11), 5, 7, 3.0)
    scales = [(1.0, 0.0, 0.0)] * 5
    base = Composite.solved(drawn, ["G2"] * 5, closed=True, scales=scales)
    for piece in range(5):
        for k in range(8):
            points = np.array(drawn[piece].control_points)
            points[k] += [1.0, -2.0, 0.5]
            changed = [*drawn[:piece], Curve(points, drawn[piece].gamma), *drawn[piece + 1 :]]
            chain = Composite.solved(changed, ["G2"] * 5, closed=True, scales=scales)
            differs = {
                p
                for p in range(5)
                if not np.allclose(chain.pieces[p].control_points, base.pieces[p].control_points, atol=1e-9)
            }
            joints, touched = base.touched(piece, k)
            assert differs <= set(touched)
            assert len(joints) <= 1
    assert base.touched(2)[0] == (1, 2)
    assert base.touched(2, 3) == ((), (2,))


def test_a_short_piece_couples_its_joints():
    drawn = loop(np.random.default_rng(12), 4, 4, 3.0)
    chain = Composite.solved(drawn, ["G2"] * 4, closed=True)
    assert chain.touched(1, 2)[0] == (0, 1, 2, 3)


def test_reversed_and_transformed():
    drawn = loop(np.random.default_rng(13), 4, 6, 3.0)
    orders = ["G1", "C2", "G3", "C1"]
    chain = Composite.solved(drawn, orders, closed=True)
    back = chain.reversed()
    assert all(report.meets(order) for report, order in zip(back.report(), back.orders, strict=True))
    assert back.orders == ("G3", "C2", "G1", "C1")
    assert back.pieces[0].evaluate(0.25) == pytest.approx(chain.pieces[-1].evaluate(0.75), rel=1e-14)
    turned = chain.transformed([[0, -1, 0], [1, 0, 0], [0, 0, 2]], [5, 6, 7])
    assert turned.pieces[2].evaluate(0.5) == pytest.approx(
        np.array([[0, -1, 0], [1, 0, 0], [0, 0, 2]]) @ chain.pieces[2].evaluate(0.5) + [5, 6, 7]
    )


def test_bad_chains():
    a, b = Curve([[0, 0], [1, 1], [2, 0]]), Curve([[2, 0], [3, 1], [4, 0]])
    with pytest.raises(InputError, match="open chain of 2 pieces has 1 joints, got 2"):
        Composite((a, b), ("C1", "C1"))
    with pytest.raises(InputError, match="closed chain of 2 pieces has 2 joints, got 1"):
        Composite((a, b), ("C1",), closed=True)
    with pytest.raises(InputError, match="order must be one of"):
        Composite((a, b), ("C9",))
    with pytest.raises(InputError, match="one dimension"):
        Composite((a, Curve([[0, 0, 0], [1, 1, 0], [2, 0, 0]])), ("C1",))
    with pytest.raises(InputError, match="scales must be one for each of 1 joints"):
        Composite.solved((a, b), ("G1",), scales=[])
    with pytest.raises(InputError, match="no control point 7 of piece 0"):
        Composite.solved((a, b), ("C1",), fixed=[(0, 7)])
    with pytest.raises(InputError, match="no control point 5 of piece 0"):
        Composite((a, b), ("C1",)).touched(0, 5)


def test_the_slopes_of_the_moves_are_what_differences_say():
    drawn = loop(np.random.default_rng(3), 3, 6, 3.0)
    system = ChainSystem(drawn, ("G3", "G2", "G1"), [(0, 2)])
    scales = [(1.3, 0.4, -0.2), (0.8, -0.3, 0.0), (1.1, 0.0, 0.0)]
    slopes = system.slopes(scales, [0, 1, 2], system.solution(scales))
    step, k = 1e-6, 0
    for joint, count in enumerate((3, 2, 1)):
        for factor in range(count):
            moves = []
            for sign in (1, -1):
                changed = [list(scale) for scale in scales]
                changed[joint][factor] *= np.exp(sign * step) if factor == 0 else 1.0
                changed[joint][factor] += 0.0 if factor == 0 else sign * step
                moves.append(system.solution([tuple(scale) for scale in changed]).moves)
            assert slopes[k] == pytest.approx((moves[0] - moves[1]) / (2 * step), rel=1e-5, abs=1e-5)
            k += 1


def test_far_from_the_origin_and_one_piece_alone():
    drawn = [piece.transformed(np.eye(3) / 60, [1e6, 1e6, 0]) for piece in loop(np.random.default_rng(0), 3, 6, 3.0)]
    assert Composite.solved(drawn, ["G2"] * 3, closed=True).unmet() == ""
    alone = Composite.solved([Curve(np.random.default_rng(3).normal(0, 10, (10, 2)))], ["G3"], closed=True)
    assert alone.unmet() == ""


def test_a_piece_without_a_tangent_is_refused():
    first = Curve([[0, 0], [1, 1], [2, 0], [2, 0]])
    with pytest.raises(SingularJoin, match="no tangent at joint 0"):
        Composite.solved([first, Curve([[2, 0], [2, 0], [4, 0], [5, 0]])], ["C1"])
    solved = Composite.solved([first, Curve([[2, 0], [3, 1], [4, 0], [5, 0]])], ["G1"])
    assert solved.unmet() == ""


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"scales": [(2.0, 0.0, 0.0)]}, "is for G joins"),
        ({"scales": [(0.0, 0.0, 0.0)]}, "eta > 0"),
        ({"scales": ["abc"]}, "three finite numbers"),
        ({"scales": [5]}, "three finite numbers"),
        ({"fixed": [3]}, "pair of whole numbers"),
        ({"fixed": [(0, 1.5)]}, "pair of whole numbers"),
        ({"fixed": [(-1, 0)]}, "no piece -1"),
    ],
)
def test_bad_scales_and_places(options, message):
    pair = Curve([[0, 0], [1, 1], [2, 0]]), Curve([[2, 0], [3, 1], [4, 0]])
    with pytest.raises(InputError, match=message):
        Composite.solved(pair, ["C1"], **options)


def test_what_is_no_chain():
    with pytest.raises(InputError, match="at least one piece"):
        Composite((), ())
    with pytest.raises(InputError, match=r"pieces\[0\] must be a single curve, got int"):
        Composite((3,), ())
    with pytest.raises(InputError, match="no piece 5"):
        Composite((Curve([[0, 0], [1, 1], [2, 0]]),), ()).touched(5)
