"""Files that other systems have rewritten: every face found, whatever they call it and however they run over it."""

from __future__ import annotations

import itertools
from functools import cache

import numpy as np
import pytest

from gtcad import Curve
from gtcad.composite import Composite
from gtcad.conics import arc, circle
from gtcad.converters import fit_curve, fit_surface
from gtcad.converters.check import check_parts, compare_parts
from gtcad.converters.correspondence import part_way
from gtcad.converters.figures import figure_of, figure_of_part
from gtcad.converters.jobs import fit_shapes, parts_of
from gtcad.converters.occt.geometry import to_geom_surface
from gtcad.converters.part import Part
from gtcad.converters.quadrics import Quadric
from gtcad.converters.spline_parts import part_of_surface
from gtcad.patches import Swung
from gtcad.quilt import Quilt
from gtcad.restricted import RestrictedSurface
from gtcad.solid import Solid
from tests import pieces
from tests.converters import bodies, rewriting
from tests.converters.test_chain_check import drawn
from tests.converters.test_quilt_check import SHAPES, sheet

T = 1e-4

MODELS = {
    "tensor": {"t": pieces.random_surface(np.random.default_rng(3), (3, 4), 60.0), "c": pieces.curves()["D5s"]},
    "swung": {"s": Swung(Curve([[30, 0], [50, 20], [20, 50]], (0.3, 0.3)), Curve([[1, 0], [1.2, 1], [0, 1.4]]))},
    "rotation": {"r": bodies.barrel(), "t": bodies.torus()},
    "sheet": {"q": SHAPES["sheet"]},
    "can": {"s": SHAPES["can"]},
    "ball": {"s": SHAPES["ball"]},
    "box": {"s": SHAPES["box"]},
    "chain": {"x": Composite.solved(drawn(4), ["G3", "G2", "G1"])},
    "loop": {"x": Composite.solved(drawn(), ["C2", "G1", "C1", "C3", "G3"], closed=True)},
    "circle": {"x": circle([1, 2, 0], 5), "a": arc([1, 2, 3], 5, 20, 290, [1, 1, 1])},
}
AFFINE = {
    "turned": rewriting.turned,
    "transposed": rewriting.transposed,
    "stretched": rewriting.stretched,
    "elevated": rewriting.elevated,
    "refined": rewriting.refined,
    "reversed": rewriting.reversed_faces,
    "reordered": rewriting.reordered,
    "split": rewriting.split,
    "parted": lambda shape: rewriting.split(shape, segments=True),
    "stretched parts": lambda shape: rewriting.transposed(
        rewriting.stretched(rewriting.split(shape, (0.2, 0.5), segments=True))
    ),
}
WHOLE = {"nurbs": rewriting.as_nurbs, "open": rewriting.divided_where_closed}
CHANGES = AFFINE | WHOLE | {"cut": rewriting.cut_by_plane}


@cache
def written(model):
    return rewriting.shape_of(parts_of(list(fit_shapes(MODELS[model], {"tolerance": T / 2})), {}))


def rewritten(folder, model, change, unit="MM", through="step"):
    """What a file holds after a change; bodies stay bodies."""
    shape = CHANGES[change](written(model)) if change else written(model)
    if change not in WHOLE and change and any(isinstance(x, Quilt | Solid) for x in MODELS[model].values()):
        shape = rewriting.sewn(shape)
    if through == "step":
        return rewriting.through_step(folder, shape, unit)
    return rewriting.through_iges(folder, shape, "M" if unit == "M" else "MM", bodies=True)


def assert_not_accused(report, parts):
    assert [
        (row.name, row.verdict, row.remark) for row in report.rows if row.verdict not in ("proved", "estimated")
    ] == []
    assert report.extra == ()
    assert [joint for joint in report.joints if not joint.kept] == []
    assert {k for row in report.rows for k in row.face} == set(range(len(parts)))


def assert_proved(report, shapes):
    assert {row.verdict for row in report.rows} == {"proved"}
    edges = [
        len(quilt.edges) for quilt in (getattr(x, "quilt", x) for x in shapes.values()) if isinstance(quilt, Quilt)
    ]
    chains = [len(chain.orders) for chain in shapes.values() if isinstance(chain, Composite)]
    assert len(report.joints) == sum(edges) + sum(chains)  # none of them left out


@pytest.mark.parametrize(
    ("model", "change", "unit", "through"),
    [
        ("tensor", "transposed", "INCH", "step"),
        ("tensor", "stretched parts", "M", "step"),
        ("tensor", "cut", "MM", "iges"),
        ("swung", "elevated", "MM", "iges"),
        ("swung", "split", "INCH", "step"),
        ("rotation", "refined", "MM", "step"),
        ("rotation", "open", "M", "iges"),
        ("sheet", "turned", "INCH", "step"),
        ("sheet", "parted", "MM", "iges"),
        ("can", "cut", "INCH", "step"),
        ("can", "reversed", "M", "iges"),
        ("ball", "nurbs", "M", "step"),
        ("box", "split", "INCH", "step"),
        ("box", "reordered", "MM", "iges"),
        ("chain", "parted", "M", "step"),
        ("loop", "stretched", "MM", "iges"),
        ("loop", "split", "INCH", "step"),
        ("circle", "nurbs", "MM", "step"),
    ],
)
def test_rewritten_files_are_found_whole(tmp_path, model, change, unit, through):
    parts = rewritten(tmp_path, model, change, unit, through)
    report = check_parts(parts, MODELS[model], T)
    assert_not_accused(report, parts)
    if change in AFFINE:
        assert_proved(report, MODELS[model])
        assert max(row.deviation[1] for row in report.rows) <= T


@pytest.mark.parametrize(("change", "verdict"), [("split", "proved"), ("cut", "estimated"), (None, "proved")])
def test_the_smooth_edge_of_patches_cut_at_a_slant_is_not_compared(tmp_path, change, verdict):
    report = check_parts(rewritten(tmp_path, "sheet", change), {"q": sheet("G1")}, T)
    assert {row.verdict for row in report.rows} == {verdict}
    assert ("1 of 1 shared edges not compared" in report.rows[0].remark) == (not report.joints) == (change == "cut")


def test_a_missing_piece_of_a_split_face_fails(tmp_path):
    parts = [part for part in rewritten(tmp_path, "tensor", "split") if part.source == "B_SPLINE_SURFACE"]
    assert len(parts) == 4
    surface = {"t": MODELS["tensor"]["t"]}
    for gone in (0, 3):
        (row,) = check_parts(parts[:gone] + parts[gone + 1 :], surface, T).rows
        assert row.verdict == "failed"
        assert row.deviation[1] > 10
    (row,) = check_parts(parts, surface, T).rows
    assert (row.verdict, row.remark) == ("proved", "matched by position; held by 4 parts")


def test_the_other_side_of_a_split_wall_is_not_taken_for_the_patch_where_the_tolerance_is_missed(tmp_path):
    """How far the file is off is a figure for people: not the wall's thickness, 0.5 mm."""
    wall = Solid(Quilt.recognised([bodies.barrel()], names=["side"]), thickness=-0.5)
    parts = parts_of(list(fit_shapes({"w": wall}, {"tolerance": 1e-3})), {})
    split = rewriting.split(rewriting.shape_of(parts))
    back = rewriting.through_step(tmp_path, split)
    row = {row.name: row for row in check_parts(back, {"w": wall}, 1e-7).rows}["w.side"]
    assert (row.verdict, len(row.face)) == ("failed", 4)
    assert row.deviation[1] <= 1e-3


def test_a_thin_strip_that_is_missing_fails_and_is_found_when_it_is_there(tmp_path):
    surface = MODELS["tensor"]["t"]
    spline = fit_surface(surface, tolerance=T / 2).spline
    rest, strip = (part_of_surface(spline, (ends, (0.0, 1.0)))[0] for ends in ((0.0, 0.9997), (0.9997, 1.0)))
    parts = rewriting.through_step(tmp_path, rewriting.shape_of([Part("", rest), Part("", strip)]))
    assert check_parts(parts, {"t": surface}, T).rows[0].verdict == "proved"
    (row,) = check_parts(parts[:1], {"t": surface}, T).rows
    assert row.verdict == "failed"
    assert row.worst.parameters[0] == pytest.approx(1.0, abs=1e-3)


def test_a_face_that_is_there_twice_is_left_over():
    spline = fit_surface(MODELS["tensor"]["t"], tolerance=T / 2).spline
    report = check_parts([Part("", spline), Part("again", spline)], {"t": MODELS["tensor"]["t"]}, T)
    assert report.rows[0].verdict == "proved"
    assert report.extra == ("again",)


def test_an_edge_that_two_chains_share_is_held_by_both():
    corners = [np.array(point, float) for point in ((0, 0, 0), (10, 0, 0), (10, 10, 0), (20, 0, 0))]
    lines = [Curve([a, (a + b) / 2, b]) for a, b in ((corners[0], corners[1]), (corners[3], corners[1]), corners[1:3])]
    chains = {"a": Composite([lines[0], lines[2]], ["C0"]), "b": Composite([lines[1], lines[2]], ["C0"])}
    parts = [Part("", fit_curve(piece, tolerance=T).spline) for chain in chains.values() for piece in chain.pieces]
    report = check_parts(parts, chains, T)
    assert [row.verdict for row in report.rows] == ["proved"] * 4
    assert sorted(row.face for row in report.rows) == [(0,), (1,), (2,), (3,)]
    assert report.extra == ()


def test_of_faces_in_one_place_each_goes_to_its_name_whatever_the_order():
    spline = fit_surface(MODELS["tensor"]["t"], tolerance=T / 2).spline
    shapes = dict.fromkeys("abc", MODELS["tensor"]["t"])
    for order in itertools.permutations("abc"):
        rows = check_parts([Part(name, spline) for name in order], shapes, T).rows
        assert [order[row.face[0]] for row in rows] == ["a", "b", "c"]
    rows = check_parts([Part("", spline)] * 3, shapes, T).rows
    assert [row.face for row in rows] == [(0,), (1,), (2,)]


def test_a_part_that_is_named_is_no_piece_of_a_shape_of_another_name_that_it_only_comes_near():
    line = Curve([[0, 0, 0], [50, 0, 0], [100, 0, 0]])
    shapes = {"a": line, "b": line.transformed(np.eye(3), [0, 400, 0])}
    beside = fit_curve(Curve([[10, 1, 0], [20, 1, 0], [30, 1, 0]]), tolerance=T / 2).spline
    for name, verdicts in (("b", ["missing", "failed"]), ("", ["failed", "missing"])):
        rows = check_parts([Part(name, beside)], shapes, T).rows
        assert [row.verdict for row in rows] == verdicts


def test_a_ring_is_not_taken_for_the_disc_around_it():
    disc, ring = (
        Part("", Quadric("disc", [0, 0, 0], [0, 0, 1], [1, 0, 0], 0.0, 0.0, (0.0, 2 * np.pi), ends))
        for ends in ((0.0, 10.0), (5.0, 10.0))
    )
    for others in ([disc, ring], [ring, disc]):
        report = compare_parts([ring], others, T)
        found = {others[k]: row.verdict for k, row in enumerate(report.rows)}
        assert (found[disc], found[ring]) == ("missing", "proved")


def test_names_decide_between_equals_and_points_between_others():
    curve = pieces.curves()["D5s"]
    held = fit_curve(curve, tolerance=T / 2).spline
    other = replace_points(held, held.control_points + [0, 0, 50])
    shapes = {"a": curve, "b": curve, "c": curve.transformed(np.eye(3), [0, 0, 50])}
    report = check_parts([Part("c", held), Part("b", held), Part("a", other)], shapes, T)
    assert [(row.verdict, row.face) for row in report.rows] == [("proved", (0,)), ("proved", (1,)), ("proved", (2,))]
    assert [row.remark for row in report.rows] == [
        "matched by position; the file calls it 'c'",
        "",
        "matched by position; the file calls it 'a'",
    ]


def replace_points(spline, points):
    return type(spline)(points, spline.knots, spline.multiplicities, spline.degree, spline.weights)


# --- moved and slipped ------------------------------------------------------------------------------------------------


def surfaces(seed):
    rng = np.random.default_rng(seed)
    degrees = tuple(int(n) for n in rng.integers(2, 6, 2))
    choices = (
        lambda: pieces.random_surface(rng, degrees, float(rng.choice([10.0, 60.0, 200.0]))),
        bodies.barrel,
        lambda: MODELS["swung"]["s"],
        bodies.torus,
        lambda: RestrictedSurface(pieces.random_surface(rng, degrees, 90.0), ((0.1, 0.7), (0.9, 0.2))),
    )
    return choices[seed % len(choices)]()


def pushed_parts(seed, by):
    """A shape and the fit of it that has one pole moved: of some slipped ones too."""
    rng = np.random.default_rng(1000 + seed)
    if seed % 4 == 3:
        curve = pieces.random_curve(rng, int(rng.integers(2, 7)), 80.0)
        spline = fit_curve(curve, tolerance=T / 4).spline if seed % 8 == 3 else rewriting.slipped_curve(curve, 0.3)
        return curve, Part("", rewriting.pushed_curve(spline, rng, by))
    surface = surfaces(seed)
    spline = (
        rewriting.slipped_surface(surface, 0.2, seed) if seed % 3 == 0 else fit_surface(surface, tolerance=T / 4).spline
    )
    return surface, Part("", rewriting.pushed_surface(spline, rng, by))


@pytest.mark.parametrize("seed", range(12))
def test_a_pole_moved_by_three_tolerances_is_caught(seed):
    shape, part = pushed_parts(seed, 3 * T)
    (row,) = check_parts([part], {"x": shape}, T).rows
    assert row.verdict == "failed"
    assert 2 * T < row.deviation[1] < 4 * T
    assert np.linalg.norm(row.worst.vector) == pytest.approx(row.deviation[1], rel=1e-6)


def slipped_parts(seed):
    rng = np.random.default_rng(2000 + seed)
    amount = float(rng.uniform(-0.4, 0.4))
    if seed % 4 == 3:
        curve = pieces.random_curve(rng, int(rng.integers(2, 7)), 80.0)
        return curve, Part("", rewriting.slipped_curve(curve, amount))
    surface = surfaces(seed)
    return surface, Part("", rewriting.slipped_surface(surface, amount, float(rng.uniform(0, 6))))


@pytest.mark.parametrize("seed", range(12))
def test_what_only_slips_within_itself_is_not_accused(seed):
    shape, part = slipped_parts(seed)
    (row,) = check_parts([part], {"x": shape}, T).rows
    assert row.verdict in ("proved", "estimated")
    assert row.deviation[1] < T


def test_slipped_patches_keep_their_joint(tmp_path):
    quilt = SHAPES["sheet"]
    slipped = [rewriting.slipped_surface(patch, 0.25, 2.0 * k) for k, patch in enumerate(quilt.patches)]
    faces = rewriting.compound(rewriting.make_face(to_geom_surface(spline)) for spline in slipped)
    report = check_parts(rewriting.through_step(tmp_path, rewriting.sewn(faces)), {"q": quilt}, 10 * T)
    assert [row.verdict for row in report.rows] == ["estimated"] * 3
    assert [(joint.wanted, joint.kept) for joint in report.joints] == [("G1", True)]
    points = np.array(slipped[1].control_points)
    points[1, :, 2] += 1e-3
    kinked = [slipped[0], slipped[1].with_control_points(points)]
    faces = rewriting.compound(rewriting.make_face(to_geom_surface(spline)) for spline in kinked)
    report = check_parts(rewriting.through_step(tmp_path, rewriting.sewn(faces)), {"q": quilt}, 10 * T)
    assert [joint.kept for joint in report.joints] == [False]


# --- trimmed faces ----------------------------------------------------------------------------------------------------


def test_a_face_of_a_larger_surface_is_held_by_what_it_is_of_it(tmp_path):
    whole = pieces.surfaces()["S54"]
    part = RestrictedSurface(whole, ((0.2, 0.8), (0.1, 0.7)))
    spline = fit_surface(whole, tolerance=T / 4).spline
    shape = rewriting.make_face((to_geom_surface(spline), 0.2, 0.8, 0.1, 0.7))
    (row,) = check_parts(rewriting.through_step(tmp_path, rewriting.compound([shape])), {"x": part}, T).rows
    assert row.verdict == "proved"
    for (a, b, c, d), verdict in (((0.2, 0.8, 0.1, 0.69), "failed"), ((0.2, 0.83, 0.1, 0.7), "failed")):
        shape = rewriting.make_face((to_geom_surface(spline), a, b, c, d))
        (row,) = check_parts(rewriting.through_step(tmp_path, rewriting.compound([shape])), {"x": part}, T).rows
        assert row.verdict == verdict


def test_a_face_with_a_piece_cut_away_fails_and_tells_where(tmp_path):
    surface = MODELS["tensor"]["t"]
    spline = fit_surface(surface, tolerance=T / 2).spline
    halves = rewriting.cut_by_plane(rewriting.shape_of([Part("", spline)]))
    parts = rewriting.through_step(tmp_path, halves)
    assert [part.trimmed for part in parts] == [True, True]
    whole = check_parts(parts, {"t": surface}, T).rows[0]
    assert whole.verdict == "estimated"
    assert "trimmed in the file" in whole.remark
    (row,) = check_parts(parts[:1], {"t": surface}, T).rows
    assert row.verdict == "failed"
    lost = surface.evaluate(*row.worst.parameters)
    assert row.worst.point == pytest.approx(lost.tolist(), abs=1e-9)
    assert np.linalg.norm(row.worst.vector) == pytest.approx(row.deviation[1], rel=1e-9)


# --- units ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("model", "factor", "remark"),
    [
        ("tensor", 1000.0, "as if written in metres"),
        ("box", 25.4, "as if written in inches"),
        ("chain", 0.001, "as if metres were taken for mm"),
    ],
)
def test_other_units_are_said_plainly(tmp_path, model, factor, remark):
    parts = rewriting.through_step(tmp_path, rewriting.scaled(written(model), factor))
    report = check_parts(parts, MODELS[model], T)
    assert {row.verdict for row in report.rows} == {"failed"}
    assert all(row.remark.startswith(remark) for row in report.rows)
    assert report.extra == ()


def test_what_is_far_away_is_said_to_be(tmp_path):
    parts = rewriting.through_step(tmp_path, rewriting.moved(written("tensor"), (1e7, 0, 0)))
    rows = check_parts(parts, MODELS["tensor"], T).rows
    assert [row.verdict for row in rows] == ["failed", "failed"]
    assert all("it lies up to 1e+07 mm away" in row.remark for row in rows)


# --- worst places -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("by", [1e-5, 1e-3])
def test_the_worst_place_and_the_histogram_of_a_known_displacement(by):
    surface = MODELS["tensor"]["t"]
    spline = fit_surface(surface, tolerance=1e-7).spline
    held = spline.with_control_points(spline.control_points + [0, 0, by])
    (row,) = check_parts([Part("", held.transposed())], {"t": surface}, T).rows
    assert row.verdict == ("proved" if by < T else "failed")
    assert row.worst.point == pytest.approx(surface.evaluate(*row.worst.parameters).tolist(), abs=1e-9)
    if by < T:
        assert row.worst.vector == pytest.approx((0, 0, by), abs=2e-7)
        assert np.repeat(row.histogram.edges[1:], row.histogram.counts).min() >= by - 1e-6
    else:
        assert np.linalg.norm(row.worst.vector) == pytest.approx(row.deviation[1], rel=1e-9)
        assert row.worst.vector[2] > 0
    assert len(row.histogram.edges) == len(row.histogram.counts) + 1
    assert row.histogram.edges[-1] == pytest.approx(np.linalg.norm(row.worst.vector), rel=1e-9)
    assert row.face == (0,)


# --- parts of shapes --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(4))
def test_the_part_that_a_piece_is_is_found(seed):
    rng = np.random.default_rng(seed)
    surface = pieces.random_surface(rng, (3, 4), 50.0)
    (a, b), (c, d) = np.sort(rng.uniform(0, 1, (2, 2)), axis=1)
    ranges = ((b, a), (c, d)) if seed % 2 else ((a, b), (d, c))
    spline = fit_surface(RestrictedSurface(surface, ranges), tolerance=1e-6).spline
    way = part_way(figure_of(surface), figure_of_part(Part("", spline.transposed())), T)
    assert way.transposed
    assert np.abs(np.array(way.ranges) - ranges).max() < 1e-6
    assert way.certificate(T).upper < 3e-6


# --- two files --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("model", "change", "verdicts"),
    [
        ("tensor", "transposed", {"proved"}),
        ("tensor", "split", {"proved"}),
        ("box", "stretched", {"proved"}),
        ("loop", "parted", {"proved"}),
        ("rotation", "cut", {"estimated"}),
        ("circle", "nurbs", {"estimated"}),
    ],
)
def test_two_files_of_the_same_points(tmp_path, model, change, verdicts):
    first = rewriting.through_step(tmp_path, written(model))
    parts = rewriting.through_step(tmp_path, CHANGES[change](written(model)))
    report = compare_parts(parts, first, T)
    assert {row.verdict for row in report.rows} == verdicts
    assert report.extra == ()
    assert max(row.deviation[1] for row in report.rows) < 1e-6


def test_two_files_with_a_pole_moved():
    spline = fit_surface(MODELS["tensor"]["t"], tolerance=T).spline
    part = Part("x", spline)
    rng = np.random.default_rng(1)
    for by, verdict in ((3 * T, "failed"), (0.5 * T, "proved")):
        other = Part("x", rewriting.pushed_surface(spline, rng, by).transposed())
        (row,) = compare_parts([other], [part], T).rows
        assert (row.name, row.verdict, row.remark) == ("x", verdict, "")
        assert row.deviation[1] == pytest.approx(by, rel=0.05)


def test_faces_of_a_name_are_told_apart_by_their_number():
    spline = fit_surface(MODELS["tensor"]["t"], tolerance=T).spline
    away = spline.with_control_points(spline.control_points + [0, 0, 500])
    report = compare_parts([Part("x", away)], [Part("x", spline), Part("x", away), Part("", away)], T)
    assert [(row.name, row.verdict) for row in report.rows] == [
        ("x no. 1", "missing"),
        ("x no. 2", "proved"),
        ("no. 3", "missing"),
    ]
