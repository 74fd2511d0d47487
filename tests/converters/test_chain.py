"""Chains to edges: the joins, the proofs and the pole counts, against dense evaluation and derivatives."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gtcad import BERNSTEIN, Composite, Curve, Restricted
from gtcad.conics import Arc, arc, circle, ellipse, hyperbola
from gtcad.continuity import Thresholds
from gtcad.converters import fit_curve
from gtcad.converters.bspline import BSplineCurve
from gtcad.converters.chain import fit_chain, joint_knots, runs_of
from gtcad.converters.part import EllipseArc
from gtcad.errors import InputError, ToleranceBelowPrecision, ToleranceNotMet
from tests.test_composite import loop

ORDERS = ("C0", "C1", "C2", "C3", "G1", "G2", "G3")
T = np.linspace(0, 1, 1501)


def solved(order, count=3, closed=False, degree=7, dimension=3, seed=4):
    drawn = loop(np.random.default_rng(seed), count, degree, 3.0, closed)
    if dimension == 2:
        drawn = [piece.transformed(np.eye(2, 3)) for piece in drawn]
    return Composite.solved(drawn, [order] * (count - (not closed)), closed=closed)


def line(*points):
    return Curve(points, family=BERNSTEIN)


def dense(fit):
    """The largest distance found at equal parameters, for each piece."""
    found = []
    for edge, run in zip(fit.edges, fit.runs, strict=True):
        for place, piece in enumerate(run):
            gaps = edge.evaluate(place + T) - fit.chain.pieces[piece].evaluate(T)
            found.append(float(np.linalg.norm(gaps, axis=1).max()))
    return found


def assert_sound(fit, tolerance):
    """All that is promised of every fit."""
    for found, (lower, upper) in zip(dense(fit), fit.deviations, strict=True):
        assert lower <= upper <= tolerance
        assert found <= upper
        assert lower <= found * 1.02 + 1e-12
    assert fit.deviation == tuple(np.max(fit.deviations, axis=0))
    following = [*fit.edges[1:], *([fit.edges[0]] if fit.chain.closed else [])]
    for a, b in zip(fit.edges, following, strict=False):
        assert np.array_equal(a.control_points[-1], b.control_points[0])
    reports = fit.report(thresholds=Thresholds(gap=1e-11))
    assert len(reports) == len(fit.chain.orders)
    assert all(report.meets(order) for report, order in zip(reports, fit.chain.orders, strict=True))
    assert [k for run in fit.runs for k in run] == list(range(len(fit.chain.pieces)))


@pytest.mark.parametrize("closed", [False, True], ids=["open", "closed"])
@pytest.mark.parametrize("order", ORDERS)
def test_every_order_is_kept(order, closed):
    fit = fit_chain(solved(order, closed=closed), tolerance=1e-4, adapt=False)
    assert_sound(fit, 1e-4)
    assert len(fit.edges) == (1 if order in ("C1", "C2", "C3") else 3)
    assert not fit.exact


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("degree", [3, 4, 7, 11])
def test_every_degree(degree, dimension):
    for order in ("C3", "G3"):
        fit = fit_chain(solved(order, dimension=dimension), tolerance=1e-3, degree=degree, adapt=False)
        assert_sound(fit, 1e-3)
        assert {edge.degree for edge in fit.edges} == {degree}
        assert {edge.dimension for edge in fit.edges} == {dimension}


@pytest.mark.parametrize("tolerance", [1e-2, 1e-5, 1e-9])
def test_every_tolerance(tolerance):
    chain = solved("C2", closed=True)
    few, many = (fit_chain(chain, tolerance=tolerance, degree=7, adapt=adapt) for adapt in (True, False))
    for fit in (few, many):
        assert_sound(fit, tolerance)
    assert len(few.edges[0].control_points) <= len(many.edges[0].control_points)


@pytest.mark.parametrize("order", ["C1", "C2", "C3", "G2"])
def test_one_spline_has_the_poles_of_its_pieces_less_what_the_joins_save(order):
    chain = solved(order)
    k = int(order[1])
    fit = fit_chain(chain, tolerance=1e-4)
    alone = [
        fit_curve(piece, tolerance=1e-4, end_order=ends, exact=False).spline
        for piece, ends in zip(chain.pieces, ((0, k), (k, k), (k, 0)), strict=True)
    ]
    count = sum(len(spline.control_points) for spline in alone)
    saved = 2 * (k + 1) if order[0] == "C" else 0
    assert sum(len(edge.control_points) for edge in fit.edges) == count - saved
    if order[0] == "C":
        assert fit.edges[0].multiplicities[joint_knots(fit.edges[0], 3)[1]] == 5 - k


def test_auto_needs_no_more_poles_than_any_degree():
    chain = solved("G2", count=2)
    best = fit_chain(chain, tolerance=1e-3, degree="auto", max_degree=6)
    assert_sound(best, 1e-3)
    (degree,) = {edge.degree for edge in best.edges}
    counts = {
        one: sum(len(edge.control_points) for edge in fit_chain(chain, tolerance=1e-3, degree=one).edges)
        for one in range(3, 7)
    }
    assert counts[degree] == min(counts.values())


def test_mixed_orders_part_the_edges():
    drawn = loop(np.random.default_rng(5), 5, 7, 2.0)
    chain = Composite.solved(drawn, ["C2", "G1", "C1", "C3", "G3"], closed=True)
    assert runs_of(chain) == (range(2), range(2, 5))
    fit = fit_chain(chain, tolerance=1e-4, adapt=False)
    assert fit.runs == runs_of(chain)
    assert [edge.domain for edge in fit.edges] == [(0, 2), (0, 3)]
    assert_sound(fit, 1e-4)


def test_ends_without_a_joint_have_the_order_that_is_asked_for():
    chain = solved("C1", count=2)
    fit = fit_chain(chain, tolerance=1e-2, end_order=(3, 1), adapt=False)
    (edge,) = fit.edges
    for piece, t, orders in ((chain.pieces[0], 0.0, (1, 2, 3)), (chain.pieces[1], 1.0, (1,))):
        for r in orders:
            wanted, found = piece.derivative(t, r), edge.derivative(2 * t, r)
            assert found == pytest.approx(wanted, rel=1e-9, abs=1e-9 * np.abs(wanted).max())


def test_one_closed_piece():
    chain = Composite.solved([Curve(np.random.default_rng(3).normal(0, 10, (10, 2)))], ["G3"], closed=True)
    fit = fit_chain(chain, tolerance=1e-5, adapt=False)
    assert_sound(fit, 1e-5)
    assert len(fit.edges) == 1


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize(
    ("chain", "turn", "is_circle"),
    [
        (circle([1, 2], 5), 360, True),
        (arc([1, 2], 5, 20, 290), 270, True),
        (arc([1, 2], 5, 290, 20), 270, True),
        (ellipse([1, 2], [3, 1], [0, 5]), 360, False),
    ],
    ids=["circle", "arc", "backwards", "ellipse"],
)
def test_arcs_of_one_ellipse_are_one_edge(chain, turn, is_circle, dimension):
    if dimension == 3:
        chain = chain.transformed(np.eye(3, 2), [0, 0, 7])
    fit = fit_chain(chain, tolerance=1e-9)
    (edge,) = fit.edges
    assert isinstance(edge, EllipseArc)
    assert edge.is_circle == is_circle
    assert math.degrees(edge.end - edge.start) == pytest.approx(turn)
    assert fit.exact
    assert fit.deviation[1] < 1e-11
    assert all(report.meets(order) for report, order in zip(fit.report(), chain.orders, strict=True))
    inexact = fit_chain(chain, tolerance=1e-4, exact=False, adapt=False)
    assert_sound(inexact, 1e-4)
    assert not inexact.exact


def test_exact_pieces_of_a_g_chain_are_exact_edges():
    chain = Composite((*arc([0, 0], 5, 0, 90).pieces, *arc([0, 8], 3, -90, -180).pieces), ("G1",))
    fit = fit_chain(chain, tolerance=1e-9)
    assert fit.exact
    assert [(edge.degree, edge.weights is not None) for edge in fit.edges] == [(2, True), (2, True)]
    for edge, (center, radius) in zip(fit.edges, (((0, 0), 5), ((0, 8), 3)), strict=True):
        assert np.abs(np.linalg.norm(edge.evaluate(T) - center, axis=1) - radius).max() < 1e-13
    assert np.array_equal(fit.edges[0].control_points[-1], fit.edges[1].control_points[0])


def test_bezier_pieces_are_exact_in_one_spline_of_their_highest_degree():
    cubic = line([2, 0], [3, 0], [4, 2], [5, 2])
    chain = Composite((line([1, 0], [2, 0]), Curve([*cubic.control_points], family=BERNSTEIN)), ("G1",))
    assert [edge.degree for edge in fit_chain(chain, tolerance=1e-9).edges] == [1, 3]
    smooth = Composite((line([1, 0], [2, 0]), line([2, 0], [7 / 3, 0], [4, 2], [5, 2])), ("C1",))
    fit = fit_chain(smooth, tolerance=1e-9)
    assert fit.exact
    assert [(edge.degree, edge.multiplicities) for edge in fit.edges] == [(3, (4, 2, 4))]
    assert_sound(fit, 1e-9)


def test_lines_that_go_on_are_one_edge():
    fit = fit_chain(Composite((line([0, 0], [1, 2]), line([1, 2], [2, 4])), ("C1",)), tolerance=1e-9)
    assert fit.exact
    assert fit.edges[0].control_points.tolist() == [[0, 0], [1, 2], [2, 4]]


def test_one_inexact_piece_makes_all_inexact():
    quarter = arc([0, 0], 5, 0, 90).pieces[0]
    chain = Composite((quarter, Curve([[0, 5], [-1, 5], [-2, 7], [-3, 5]])), ("G1",))
    fit = fit_chain(chain, tolerance=1e-6)
    assert_sound(fit, 1e-6)
    assert not fit.exact
    with pytest.raises(InputError, match="exact=True, but this chain has no exact form"):
        fit_chain(chain, tolerance=1e-6, exact=True)


def test_pieces_of_any_kind():
    branch = hyperbola([0, 0], [1, 0], [0, 1], -1, 2)
    end, tangent = branch.evaluate(1.0), branch.derivative(1.0)
    part = Restricted(hyperbola(2 * (end + tangent), [1, 0], [0, 1], -1, 2), (0.9, 0.1))
    back = part.transformed(np.eye(2), end + tangent - part.evaluate(0.0))
    chain = Composite((branch, line(end, end + tangent), back), ("C1", "C0"))
    assert_sound(fit_chain(chain, tolerance=1e-6, adapt=False), 1e-6)


def test_joints_must_meet_their_orders():
    corner = Composite((line([0, 0], [1, 0]), line([1, 0], [2, 1])), ("G1",))
    with pytest.raises(InputError, match="joint 0 must be G1, it is C0"):
        fit_chain(corner, tolerance=1e-3)
    apart = Composite((line([0, 0], [1, 0]), line([1, 1e-3], [2, 1])), ("C0",))
    with pytest.raises(InputError, match=r"joint 0 must be C0, it is a gap of 0\.001"):
        fit_chain(apart, tolerance=1e-2)


def test_a_gap_that_still_counts_as_none_must_be_within_the_tolerance():
    """Edges meet to the last digit whatever the pieces do, so a gap is a deviation."""
    chain = Composite((line([0, 0], [1, 0], [2, 1]), line([2 + 5e-8, 1], [3, 2], [4, 3])), ("C0",))
    fit = fit_chain(chain, tolerance=1e-7)
    assert np.array_equal(fit.edges[0].control_points[-1], fit.edges[1].control_points[0])
    assert fit.deviations[1][0] == pytest.approx(5e-8, rel=0.02)
    with pytest.raises(ToleranceNotMet, match="joining the pieces' splines") as caught:
        fit_chain(chain, tolerance=1e-8)
    assert caught.value.requested == 1e-8


def test_a_tolerance_is_kept_or_refused():
    chain = solved("G1", count=2)
    with pytest.raises(ToleranceNotMet, match="max_spans = 2") as missed:
        fit_chain(chain, tolerance=1e-9, max_spans=2)
    assert missed.value.requested == 1e-9
    assert missed.value.achieved > 1e-9
    with pytest.raises(ToleranceNotMet, match="max_spans = 1"):
        fit_chain(chain, tolerance=1e-10, max_spans=1, degree="auto", max_degree=5)
    with pytest.raises(ToleranceBelowPrecision) as below:
        fit_chain(chain, tolerance=1e-16)
    assert below.value.requested == 1e-16 < below.value.floor
    fit_chain(chain, tolerance=1.5 * below.value.floor, degree=9, adapt=False)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"tolerance": 0.0}, "tolerance must be a finite number above 0, got 0.0"),
        ({"tolerance": math.nan}, "tolerance must be a finite number above 0, got nan"),
        ({"degree": 2}, r"degree must be a whole number in \[3, 25\]"),
        ({"degree": "best"}, "degree must be"),
        ({"degree": "auto", "max_degree": 2}, r"max_degree must be a whole number in \[3, 25\], got 2"),
        ({"degree": "auto", "continuity": 11}, r"continuity must be a whole number in \[0, 10\], got 11"),
        ({"continuity": 5}, r"continuity must be a whole number in \[0, 4\], got 5"),
        ({"exact": "always"}, "exact must be"),
        ({"end_order": 4}, r"end_order.* must be a whole number in \[0, 3\]"),
        ({"max_spans": 0}, "max_spans"),
    ],
)
def test_bad_options(options, message):
    with pytest.raises(InputError, match=message):
        fit_chain(solved("G1", count=2), **{"tolerance": 1e-3, **options})


def test_continuity_within_the_pieces():
    fit = fit_chain(solved("C1", count=2), tolerance=1e-3, continuity=2, adapt=False)
    (edge,) = fit.edges
    assert set(edge.multiplicities[1:-1]) == {3, 4}
    assert edge.multiplicities[joint_knots(edge, 2)[1]] == 4
    assert_sound(fit, 1e-3)


def test_a_spline_without_knots_at_the_joints_is_no_chain():
    spline = BSplineCurve(np.zeros((6, 3)), [0, 0.4, 0.6, 1], [4, 1, 1, 4], 3)
    with pytest.raises(InputError, match="a spline of 2 pieces needs knots where they meet"):
        joint_knots(spline, 2)
    assert joint_knots(spline, 1) == [0, 3]


@pytest.mark.parametrize("chain", [Arc([0, 0, 1], [2, 0, 0], [0, 3, 0], 10, 200), circle([0, 0], 1)])
def test_the_report_of_an_arc_needs_no_knots(chain):
    fit = fit_chain(chain, tolerance=1e-9)
    assert [report.order for report in fit.report()] == [report.order for report in chain.report()]


def random_chain(rng):
    """Any orders, degrees, families, dimension and size, open or closed."""
    count, closed = int(rng.integers(1, 6)), bool(rng.random() < 0.5)
    orders = rng.choice(ORDERS, count - (not closed)).tolist()
    degree = int(rng.integers(7, 11))
    size = 10 ** rng.uniform(-1, 3)
    matrix = size / 100 * (np.eye(3) if rng.random() < 0.5 else np.eye(2, 3))
    drawn = [piece.transformed(matrix) for piece in loop(rng, count, degree, 3.0, closed)]
    return Composite.solved(drawn, orders, closed=closed), 1e-5 * size


def assert_random_chains(count, seed):
    rng = np.random.default_rng(seed)
    for _ in range(count):
        chain, tolerance = random_chain(rng)
        assert chain.unmet() == ""
        assert_sound(fit_chain(chain, tolerance=tolerance, degree=int(rng.integers(4, 10)), adapt=False), tolerance)


def test_random_chains():
    assert_random_chains(6, 21)


@pytest.mark.stress
def test_random_chains_stress():
    assert_random_chains(300, 22)
