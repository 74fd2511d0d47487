"""Files of chains held against their models: every piece proved, every joint as the file has it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

from gtcad import Composite, Curve
from gtcad.conics import Arc, arc, circle
from gtcad.converters import fit_curve
from gtcad.converters.brep import read_brep, write_brep
from gtcad.converters.bspline import BSplineCurve, BSplineSurface
from gtcad.converters.chain import fit_chain
from gtcad.converters.check import check_parts
from gtcad.converters.iges import read_iges, write_iges
from gtcad.converters.part import EllipseArc, Part, Wire
from gtcad.converters.spline_parts import cut, merged
from gtcad.converters.step import read_step, write_step
from gtcad.model import load_model
from tests.converters import rewriting
from tests.test_composite import loop

T = 1e-4
FORMATS = {".step": (write_step, read_step), ".igs": (write_iges, read_iges), ".brep": (write_brep, read_brep)}


def drawn(count=5):
    return loop(np.random.default_rng(5), count, 7, 2.0)


@pytest.fixture(scope="module")
def mixed():
    """Two edges: of the pieces 1 to 2, and of 3 to 5."""
    return Composite.solved(drawn(), ["C2", "G1", "C1", "C3", "G3"], closed=True)


@pytest.fixture(scope="module")
def wire():
    """An edge for each piece."""
    return Composite.solved(drawn(4), ["G3", "G2", "G1"])


def edges_of(chain, tolerance=T):
    return fit_chain(chain, tolerance=tolerance, adapt=False).edges


def named(edges, name="x"):
    return [Part(name, edge) for edge in edges]


def check(parts, chain, tolerance=T):
    return check_parts(parts, {"x": chain}, tolerance)


def backwards(spline):
    knots = spline.knots[0] + spline.knots[-1] - spline.knots[::-1]
    return BSplineCurve(spline.control_points[::-1], knots, spline.multiplicities[::-1], spline.degree)


def moved(spline, shift, pole=None):
    """All poles moved, or one."""
    points = np.array(spline.control_points)
    points[slice(None) if pole is None else pole] += shift
    return BSplineCurve(points, spline.knots, spline.multiplicities, spline.degree)


def verdicts(report):
    return [row.verdict for row in report.rows]


def assert_all_well(report, chain):
    assert verdicts(report) == ["proved"] * len(chain.pieces)
    assert report.extra == ()
    assert [joint.wanted for joint in report.joints] == list(chain.orders)
    assert all(joint.kept for joint in report.joints)


@pytest.mark.parametrize("suffix", FORMATS)
def test_what_was_written_is_proved_in_every_format_with_and_without_names(tmp_path, suffix, mixed, wire):
    shapes = {
        "mixed": mixed,
        "wire": wire,
        "spline": Composite.solved(drawn(3), ["C2"] * 2),
        "plane": Composite.solved([piece.transformed(np.eye(2, 3)) for piece in drawn(3)], ["G2"] * 3, closed=True),
        "circle": circle([1, 2], 5),
        "arc": arc([1, 2, 3], 5, 20, 290, [1, 1, 1]),
        "turned": Arc([0, 0, 9], [3, 0, 0], [0, 4, 0], 30, 390),
        "back": Arc([0, 0, 19], [3, 0, 0], [0, 4, 0], 30, -330),
        "exact": Composite((*arc([0, 0], 5, 0, 90).pieces, *arc([0, 8], 3, -90, -180).pieces), ("G1",)),
    }
    fits = {name: edges_of(chain) for name, chain in shapes.items()}
    parts = [Part(name, edges[0] if len(edges) == 1 else Wire(edges)) for name, edges in fits.items()]
    write, read = FORMATS[suffix]
    path = tmp_path / f"chains{suffix}"
    write(path, parts)
    back = read(path)
    assert all(part.valid for part in back)
    for held in (back, [Part("", part.geometry) for part in back]):
        report = check_parts(held, shapes, T)
        assert set(verdicts(report)) == {"proved"}
        assert len(report.rows) == sum(len(chain.pieces) for chain in shapes.values())
        assert len(report.joints) == sum(len(chain.orders) for chain in shapes.values())
        assert [joint for joint in report.joints if not joint.kept] == []
        assert report.extra == ()
    assert {row.remark for row in report.rows} == {"matched by position"}
    assert [row.name for row in report.rows[:6]] == [*(f"mixed #{k}" for k in range(1, 6)), "wire #1"]
    assert [joint.name for joint in report.joints[3:6]] == ["mixed #4-#5", "mixed #5-#1", "wire #1-#2"]


def test_edges_in_any_order_and_direction(mixed, wire):
    rng = np.random.default_rng(1)
    for chain in (mixed, wire):
        for _ in range(6):
            edges = [backwards(edge) if rng.random() < 0.5 else edge for edge in edges_of(chain)]
            assert_all_well(check(named([edges[k] for k in rng.permutation(len(edges))]), chain), chain)


def test_a_chain_the_other_way_round_is_the_same(mixed, wire):
    for chain in (mixed, wire, circle([0, 0, 0], 2), arc([0, 0, 0], 2, 10, 200)):
        assert_all_well(check(named(edges_of(chain)), chain.reversed()), chain.reversed())


@pytest.mark.parametrize("end_order", [0, 1, 2])
def test_pieces_fitted_without_their_joins_lose_them(end_order):
    """Each piece is within the tolerance all the same."""
    chain = Composite.solved(drawn(3), ["G3"] * 3, closed=True)
    settings = {"tolerance": 1e-2, "degree": 4, "end_order": end_order, "exact": False, "adapt": False}
    report = check(named(fit_curve(piece, **settings).spline for piece in chain.pieces), chain, 1e-2)
    assert verdicts(report) == ["proved"] * 3
    assert [joint.kept for joint in report.joints] == [False] * 3
    assert {joint.report.order for joint in report.joints} <= {f"{kind}{end_order}" for kind in "CG"}
    assert {joint.wanted for joint in report.joints} == {"G3"}


def test_a_file_of_the_same_points_joined_less_well(wire):
    """The model asks for more than the chain that was written has."""
    edges = edges_of(Composite(wire.pieces, ("G1", "G1", "G1")), 1e-2)
    report = check(named(edges), wire, 1e-2)
    assert verdicts(report) == ["proved"] * 4
    assert [(joint.name, joint.wanted, joint.kept) for joint in report.joints] == [
        ("x #1-#2", "G3", False),
        ("x #2-#3", "G2", False),
        ("x #3-#4", "G1", True),
    ]


def test_a_gap_between_edges_is_a_lost_joint(wire):
    edges = list(edges_of(wire, 1e-5))
    edges[1] = moved(edges[1], [0, 0, 2e-5])
    report = check(named(edges), wire, T)
    assert verdicts(report) == ["proved"] * 4
    assert [joint.kept for joint in report.joints] == [False, False, True]
    assert [joint.report.gap for joint in report.joints[:2]] == pytest.approx([2e-5, 2e-5])


def test_a_kink_within_a_spline_is_a_lost_joint():
    chain = Composite.solved(drawn(2), ["C1"])
    before, after = (fit_curve(piece, tolerance=1e-6, end_order=1, exact=False).spline for piece in chain.pieces)
    report = check(named([merged(before, moved(after, [0, 0, 1e-5], pole=1), 0)]), chain, T)
    assert verdicts(report) == ["proved"] * 2
    assert [joint.kept for joint in report.joints] == [False]


@pytest.mark.parametrize("piece", range(5))
def test_a_moved_pole_is_caught_in_its_piece(mixed, piece):
    edges = list(edges_of(mixed, 1e-6))
    place, inside = (0, piece) if piece < 2 else (1, piece - 2)
    edge = edges[place]
    middle = int(np.searchsorted(edge.flat_knots, inside + 0.5)) - (edge.degree + 1) // 2
    edges[place] = moved(edge, [0, 0, 30 * T], middle)
    found = verdicts(check(named(edges), mixed))
    assert found[piece] == "failed"
    assert found.count("proved") >= 3


@pytest.mark.parametrize("unit", ["MM", "INCH", "M"])
def test_the_digits_of_a_file_lose_no_joint_and_explain_no_kink(tmp_path, unit):
    """In metres the kernel's writer of IGES keeps a millionth of a millimetre."""
    samples = Path(__file__).parents[2] / "samples"
    models = [load_model(samples / name).in_millimetres() for name in ("letter-a.toml", "wheel-arch.toml")]
    chains = {
        name: models[k][name].transformed(np.eye(3, 2)) for k, name in ((0, "left leg"), (0, "right leg"), (1, "trim"))
    }
    for name, chain in chains.items():
        edges = edges_of(chain)
        back = rewriting.through_iges(tmp_path, rewriting.shape_of([Part(name, Wire(edges))]), unit)
        assert_all_well(check(back, chain), chain)
        bent = [moved(edges[0], [0, 1e-4, 1e-4], pole=-2), *edges[1:]]
        back = rewriting.through_iges(tmp_path, rewriting.shape_of([Part("", edge) for edge in bent]), unit)
        assert not all(joint.kept for joint in check(back, chain, 1e-2).joints)


def test_a_missing_edge_is_missing_and_the_others_are_proved(wire):
    edges = edges_of(wire)
    for gone in range(4):
        report = check(named(edges[:gone] + edges[gone + 1 :]), wire)
        assert [row.verdict for row in report.rows] == ["missing" if k == gone else "proved" for k in range(4)]
        assert [joint.name for joint in report.joints] == [
            f"x #{k + 1}-#{k + 2}" for k in range(3) if gone not in (k, k + 1)
        ]
    assert [(row.name, row.verdict) for row in check([], wire).rows] == [("x", "missing")]


def test_an_edge_too_many_is_extra(wire):
    edges = [*edges_of(wire), moved(edges_of(wire)[2], [0, 0, 40.0])]
    for parts in (named(edges), named(edges[::-1])):
        report = check(parts, wire)
        assert verdicts(report) == ["proved"] * 4
        assert report.extra == ("x",)
        assert all(joint.kept for joint in report.joints)


def resampled(chain, count=59):
    """One edge through points of all pieces, without knots at the joints."""
    x = np.linspace(0, len(chain.pieces), count)
    spline = make_interp_spline(x, chain.evaluate(x), 5)
    inner = spline.t[6:-6]
    return BSplineCurve(spline.c, np.r_[x[0], inner, x[-1]], [6, *[1] * len(inner), 6], 5)


def test_edges_that_do_not_correspond_are_held_against_the_pieces_that_they_lie_along(wire):
    rough = np.abs(resampled(wire).evaluate(np.linspace(0, 4, 9999)) - wire.evaluate(np.linspace(0, 4, 9999))).max()
    report = check(named([resampled(wire)]), wire, 3 * rough)
    assert set(verdicts(report)) <= {"proved", "estimated"}
    assert {row.face for row in report.rows} == {(0,)}
    assert "failed" in verdicts(check(named([moved(resampled(wire), [0, 0, 9 * rough])]), wire, 3 * rough))


def test_split_edges_are_proved_and_joined(wire, mixed):
    for chain in (wire, mixed):
        for seed in range(3):
            rng = np.random.default_rng(seed)
            halves = [
                half
                for edge in edges_of(chain)
                for at in [rng.uniform(*edge.domain)]
                for half in (cut(edge, edge.knots[0], at), backwards(cut(edge, at, edge.knots[-1])))
            ]
            order = rng.permutation(len(halves))
            report = check(named([halves[k] for k in order]), chain)
            assert_all_well(report, replace(chain, orders=tuple(f"G{order[1]}" for order in chain.orders)))
            assert any("held by" in row.remark for row in report.rows)
            lost = check(named([halves[k] for k in order[1:]]), chain)
            assert set(verdicts(lost)) & {"failed", "missing"}


def test_another_chain_altogether_fails(wire):
    far = [moved(edge, [0, 0, 500.0]) for edge in edges_of(wire)]
    assert set(verdicts(check(named(far), wire))) == {"failed"}


def test_an_arc_in_the_place_of_other_pieces_fails():
    """One arc for two pieces that share an edge and are none."""
    quarter = EllipseArc([0, 0, 0], [10, 0, 0], [0, 10, 0], 0.0, np.pi / 2)
    pieces = [
        Curve([[10, 0, 0], [10, 3, 0], [8, 7, 2], [7, 7, 0]]),
        Curve([[7, 7, 0], [5, 9, 0], [3, 10, 2], [0, 10, 0]]),
    ]
    report = check(named([quarter]), Composite.solved(pieces, ["C1"]))
    assert verdicts(report) == ["failed", "failed"]


def test_a_wrong_arc_fails():
    chain = circle([1, 2, 3], 5)
    (edge,) = edges_of(chain)
    wide = EllipseArc(edge.center, 1.0001 * edge.axis_a, 1.0001 * edge.axis_b, edge.start, edge.end)
    assert verdicts(check(named([wide]), chain)) == ["failed"] * 4
    short = EllipseArc(edge.center, edge.axis_a, edge.axis_b, edge.start, edge.end - 0.01)
    assert "failed" in verdicts(check(named([short]), chain))


def test_arcs_as_splines_of_whole_chains_and_of_quarters():
    chain = circle([1, 2, 3], 5)
    whole = fit_chain(chain, tolerance=1e-5, exact=False, adapt=False).edges
    assert_all_well(check(named(whole), chain), chain)
    quarters = [fit_curve(piece, tolerance=1e-5).spline for piece in chain.pieces]
    report = check(named(quarters), chain)
    assert verdicts(report) == ["proved"] * 4
    assert {row.method for row in report.rows} == {"exact form (tangent)"}
    assert {joint.report.order for joint in report.joints} <= {"C2", "C3", "G3"}  # rational, of one circle
    halves = [EllipseArc([1, 2, 3], [5, 0, 0], [0, 5, 0], a, a + np.pi) for a in (0.0, np.pi)]
    assert_all_well(check(named(halves), chain), chain)


def test_a_face_is_no_chain(wire):
    face = BSplineSurface(np.zeros((2, 2, 3)), [0, 1], [2, 2], 1, [0, 1], [2, 2], 1)
    (row,) = check([Part("x", face)], wire).rows
    assert (row.verdict, row.remark) == ("missing", "the file holds a face of this name, not an edge")


def test_an_invalid_edge(wire):
    parts = named(edges_of(wire))
    parts[2] = Part("x", parts[2].geometry, valid=False)
    (row,) = check(parts, wire).rows
    assert (row.verdict, row.remark) == ("invalid", "the kernel calls an edge of it invalid")


def test_edges_by_position_are_those_up_to_the_end_of_the_chain(wire):
    """What begins where a chain ends is not taken for a part of it."""
    smooth = Composite.solved(drawn(3), ["C1"] * 2)
    end = smooth.evaluate(3.0)
    after = Curve([end, end + [5, 5, 0], end + [9, 0, 3]], gamma=(0.3, 0.4))
    shapes = {"a": smooth, "b": after, "c": wire}
    edges = [*edges_of(smooth), fit_curve(after, tolerance=T).spline, *edges_of(wire)]
    report = check_parts([Part("", edge) for edge in edges], shapes, T)
    assert set(verdicts(report)) == {"proved"}
    assert [row.name for row in report.rows] == [
        *(f"a #{k}" for k in (1, 2, 3)),
        "b",
        *(f"c #{k}" for k in (1, 2, 3, 4)),
    ]
