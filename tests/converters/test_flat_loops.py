"""The loops of flat patterns, and bend lines outside of holes."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from gtcad import BERNSTEIN, Composite, Curve
from gtcad.conics import circle
from gtcad.converters.flat_loops import check_holes, cut_at_holes, outline_loops
from gtcad.converters.flat_outline import CircleArc, draw_pattern
from gtcad.errors import InputError
from gtcad.flat_curves import FlatCurve
from gtcad.flat_pattern import FlatPattern, develop
from gtcad.flat_strip import develop_strip
from gtcad.patches import Rotation, Ruled, cylinder
from tests.hopper import line
from tests.test_flat_pattern import helix

Array = NDArray[np.float64]

RADIUS, HEIGHT = 100.0, 50.0
WIDTH = RADIUS * math.pi / 2
QUARTER = Curve([[RADIUS, 0, 0], [RADIUS, RADIUS, 0], [0, RADIUS, 0]])
FOLDED = [(0, 0, 100, 0), (100, 0, 100, 50), (100, 50, 0, 50)]  # x and z of both sides of plates along y
AXIS = ((0, 0, 0), (0, 0, 1))


def bent() -> FlatPattern:
    """A rectangle of WIDTH by HEIGHT, bent evenly."""
    return develop(cylinder(QUARTER, [0, 0, HEIGHT]))


def slot(x: tuple[float, float], y: tuple[float, float]) -> Composite:
    """A rectangle."""
    corners = [(x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1]), (x[0], y[0])]
    return Composite(tuple(line(a, b) for a, b in pairwise(corners)), ("C0",) * 4, closed=True)


def in_pattern(curve: Curve | Composite) -> FlatCurve:
    """A curve whose points are fractions of the rectangle."""
    return bent().image(curve)


# --- bend lines -------------------------------------------------------------------------------------------------------


def test_a_bend_line_stops_at_the_borders_of_a_hole() -> None:
    hole = in_pattern(slot((0.2, 0.6), (0.25, 0.75)))
    bends = cut_at_holes(bent().bend_lines(at=[0.1, 0.4, 0.9]), [hole])
    assert [bend.holes for bend in bends[::2]] == [(), ()]
    np.testing.assert_allclose(bends[1].holes, [[0.25, 0.75]], atol=1e-12)
    pieces = sorted(sorted(piece) for piece in bends[1].pieces)
    x, ends = bends[1].start[0], [0, HEIGHT / 4, 3 * HEIGHT / 4, HEIGHT]
    np.testing.assert_allclose(np.reshape(pieces, (-1, 2)), [[x, y] for y in ends], atol=1e-10)
    assert bends[0].pieces == ((bends[0].start, bends[0].end),)


def test_a_line_through_two_holes_has_three_pieces() -> None:
    holes = [in_pattern(circle([0.5, v], 0.1)) for v in (0.7, 0.3)]
    [bend] = cut_at_holes(bent().bend_lines(1), holes)
    np.testing.assert_allclose(bend.holes, [[0.2, 0.4], [0.6, 0.8]], atol=1e-12)
    assert len(bend.pieces) == 3


def test_a_line_through_a_notch_is_drawn_between_its_legs() -> None:
    """A hole in the form of a U, met twice."""
    corners = [(0.3, 0.2), (0.7, 0.2), (0.7, 0.4), (0.4, 0.4), (0.4, 0.6), (0.7, 0.6), (0.7, 0.8), (0.3, 0.8)]
    hole = Composite(tuple(line(a, b) for a, b in pairwise([*corners, corners[0]])), ("C0",) * 8, closed=True)
    bends = cut_at_holes(bent().bend_lines(at=[0.35, 0.6]), [in_pattern(hole)])
    np.testing.assert_allclose(bends[0].holes, [[0.2, 0.8]], atol=1e-9)
    np.testing.assert_allclose(bends[1].holes, [[0.2, 0.4], [0.6, 0.8]], atol=1e-9)


@pytest.mark.parametrize("x", [(0.5, 0.9), (0.1, 0.5)])
def test_there_is_no_line_along_the_border_of_a_hole(x: tuple[float, float]) -> None:
    [bend] = cut_at_holes(bent().bend_lines(at=[0.5]), [in_pattern(slot(x, (0.25, 0.75)))])
    np.testing.assert_allclose(bend.holes, [[0.25, 0.75]], atol=1e-9)


def test_a_crease_is_cut_where_holes_on_both_sides_meet() -> None:
    plates = [Ruled(line([x, 0, z], [x, 200, z]), line([y, 0, w], [y, 200, w])) for x, z, y, w in FOLDED]
    strip = develop_strip(plates)
    holes = [strip.image(k, slot((0.4, 0.6), y)) for k, y in ((0, (0.7, 1)), (1, (0, 0.5)))]
    for sheet in (draw_pattern(strip, tolerance=1e-2, holes=found) for found in (holes, holes[:1], holes[1:])):
        assert [bend.holes for bend in sheet.bend[1:]] == [()]
        np.testing.assert_allclose(sheet.bend[0].holes, [[0.4, 0.6]], atol=1e-9)


@pytest.mark.parametrize("inwards", [-1e-2, -1e-6, -1e-8, 0.0, 1e-12, 1e-9, 1e-7, 1e-5, 1e-4, 1e-2])
def test_a_line_next_to_the_border_loses_no_more_than_its_chord(inwards: float) -> None:
    hole = in_pattern(circle([0.7, 0.5], 0.2))
    [bend] = cut_at_holes(bent().bend_lines(at=[0.5 + inwards]), [hole])
    lost = math.fsum(end - start for start, end in bend.holes)
    assert lost == pytest.approx(2 * math.sqrt(max(0.0, 0.2**2 - (0.2 - inwards) ** 2)), abs=1e-6)


@settings(max_examples=25)
@given(st.floats(0.2, 0.8), st.floats(0.2, 0.8), st.floats(0.05, 0.18), st.integers(1, 9))
def test_pieces_are_what_a_circle_leaves(u: float, v: float, radius: float, count: int) -> None:
    pattern = bent()
    hole = pattern.image(circle([u, v], radius))
    for bend in cut_at_holes(pattern.bend_lines(count), [hole]):
        half = math.sqrt(max(0.0, radius**2 - (bend.parameter - u) ** 2))
        drawn = math.fsum(math.dist(*piece) for piece in bend.pieces)
        assert drawn == pytest.approx(HEIGHT * (1 - 2 * half), abs=1e-5)


def test_moved_sheets_keep_their_pieces() -> None:
    sheet = draw_pattern(bent(), tolerance=1e-2, bend_lines=3, holes=[in_pattern(circle([0.5, 0.5], 0.2))])
    moved = sheet.moved(np.array([7.0, -3.0]))
    for bend, other in zip(sheet.bend, moved.bend, strict=True):
        np.testing.assert_allclose(np.array(other.pieces) - np.array(bend.pieces), [[[7, -3]] * 2] * len(bend.pieces))


# --- holes ------------------------------------------------------------------------------------------------------------


def test_holes_that_cross_are_refused() -> None:
    holes = [in_pattern(circle([u, 0.5], 0.2)) for u in (0.4, 0.6)]
    with pytest.raises(InputError, match="holes must not cross: 1 and 2 do near") as caught:
        check_holes(holes)
    x, y = (float(text.strip("(), ")) for text in str(caught.value).split("near ")[1].split(" of")[0].split(","))
    assert x == pytest.approx(WIDTH * 0.5, rel=1e-2)
    assert min(abs(y / HEIGHT - 0.5 - sign * math.sqrt(0.03)) for sign in (1, -1)) < 1e-2


def test_holes_that_cross_where_points_of_both_are_are_refused() -> None:
    """Circles that cross in the middle of their quarters."""
    across = 0.1 * math.sqrt(2)
    with pytest.raises(InputError, match="holes must not cross"):
        check_holes([in_pattern(circle([u, 0.5], 0.1)) for u in (0.5 - across / 2, 0.5 + across / 2)])


def teeth(u: float, count: int) -> Composite:
    """A comb of slender teeth at u, 2 * count corners on each side."""
    v = np.linspace(0.1, 0.9, 2 * count)
    left = [(u + 0.01 + 0.1 * (k % 2), y) for k, y in enumerate(v)]
    corners = [*left, (u, 0.9), (u, 0.1), left[0]]
    return Composite(tuple(line(a, b) for a, b in pairwise(corners)), ("C0",) * (len(corners) - 1), closed=True)


def test_holes_of_many_corners_are_seen_as_they_are() -> None:
    comb = in_pattern(teeth(0.3, 60))
    check_holes([comb, in_pattern(slot((0.411, 0.5), (0.2, 0.8)))])
    with pytest.raises(InputError, match="holes must not cross"):
        check_holes([comb, in_pattern(slot((0.409, 0.5), (0.2, 0.8)))])
    [bend] = cut_at_holes(bent().bend_lines(at=[0.36]), [comb])
    assert len(bend.holes) == 60
    half = 0.8 / 119 / 2  # of a tooth, between where it begins and ends in the middle of its flanks
    np.testing.assert_allclose(np.diff(bend.holes)[:-1], 2 * half, atol=1e-9)
    assert np.diff(bend.holes)[-1] == pytest.approx(half, abs=1e-9)


@pytest.mark.parametrize(("radii", "inner"), [((0.3, 0.1), "2 lies in 1"), ((0.1, 0.3), "1 lies in 2")])
def test_a_hole_in_a_hole_is_refused(radii: tuple[float, float], inner: str) -> None:
    with pytest.raises(InputError, match=inner):
        check_holes([in_pattern(circle([0.45, 0.5], radius)) for radius in radii])


def test_a_hole_stated_twice_is_refused() -> None:
    for hole in (circle([0.5, 0.5], 0.2), slot((0.2, 0.4), (0.3, 0.6))):
        with pytest.raises(InputError, match="holes must"):
            check_holes([in_pattern(hole)] * 2)


def test_holes_side_by_side_may_share_a_border() -> None:
    """Halves of one hole on both sides of a shared ruling."""
    check_holes([in_pattern(slot(x, (0.25, 0.75))) for x in ((0.2, 0.5), (0.5, 0.7))])
    check_holes([in_pattern(slot((0.2, 0.4), y)) for y in ((0.1, 0.5), (0.5, 0.9))])
    check_holes([in_pattern(circle([u, 0.5], 0.1)) for u in (0.2, 0.5, 0.8)])


def test_holes_of_a_pattern_over_itself_may_lie_over_each_other() -> None:
    pattern = develop(helix(2.0, 20.0, 30.0, (4.0, 30.0)))
    turn = math.hypot(20.0, 30.0 / (2 * math.pi)) / 20.0 / 2.0  # of the parameter, for a full turn in the plane
    holes = [pattern.image(circle([u, 0.5], 0.02)) for u in (0.05, 0.05 + turn)]
    centers = [np.mean([piece.evaluate(0.0) for piece in hole.pieces], axis=0) for hole in holes]
    assert math.dist(*centers) < 1
    with pytest.raises(InputError, match="holes must"):
        check_holes(holes)
    assert len(draw_pattern(pattern, tolerance=1e-2, holes=holes).cut) == 3


def test_a_number_says_which_hole_is_wrong() -> None:
    arc = in_pattern(Curve([[0.1, 0.1], [0.5, 0.2], [0.8, 0.4]]))
    with pytest.raises(InputError, match="hole 2 must be a closed curve"):
        check_holes([in_pattern(circle([0.5, 0.5], 0.2)), arc])


# --- rings ------------------------------------------------------------------------------------------------------------


def test_a_washer_has_no_seam() -> None:
    washer = develop(Rotation(line([100, 0, 0], [30, 0, 0]), *AXIS))
    sheet = draw_pattern(washer, tolerance=1e-2, bend_lines=12)
    rims = [path.entities for path in sheet.cut]
    assert [[type(entity) for entity in entities] for entities in rims] == [[CircleArc]] * 2
    assert [entities[0].radius for entities in rims] == pytest.approx([100, 30])  # type: ignore[union-attr]
    np.testing.assert_allclose(np.ptp(sheet.box, axis=0), [200, 200], rtol=1e-12)
    assert sheet.bend == ()


def test_a_disc_is_a_circle() -> None:
    sheet = draw_pattern(develop(Rotation(line([0, 0, 0], [100, 0, 0]), *AXIS)), tolerance=1e-2)
    assert [[type(entity) for entity in path.entities] for path in sheet.cut] == [[CircleArc]]


def test_a_washer_of_parts_has_no_seam() -> None:
    parts = [Rotation(line([100, 0, 0], [30, 0, 0]), *AXIS, 120.0, start) for start in (0.0, 120.0, 240.0)]
    sheet = draw_pattern(develop_strip(parts), tolerance=1e-2)
    assert [len(path.entities) for path in sheet.cut] == [3, 3]
    radii = [{round(entity.radius, 9) for entity in path.entities} for path in sheet.cut]  # type: ignore[union-attr]
    assert radii == [{100.0}, {30.0}]


def test_what_does_not_close_in_the_plane_has_its_seam() -> None:
    for rise in (0.5, 50.0):
        contour = develop(Rotation(line([100, 0, 0], [30, 0, rise]), *AXIS)).contour
        assert outline_loops(contour) == (contour,)
    for pattern in (bent(), develop(cylinder(Curve([[0, 0, 0], [5, 0, 0]], family=BERNSTEIN), [0, 0, 3]))):
        assert outline_loops(pattern.contour) == (pattern.contour,)


@pytest.mark.parametrize("radii", [(100, 30), (100, 0)])
def test_washers_and_discs_are_faces_of_build123d(radii: tuple[float, float]) -> None:
    pytest.importorskip("build123d")
    from gtcad.converters.build123d_flat import flat_face

    ring = develop(Rotation(line([radii[0], 0, 0], [radii[1], 0, 0]), *AXIS))
    face = flat_face(draw_pattern(ring, tolerance=1e-2))
    assert face.area == pytest.approx(math.pi * (radii[0] ** 2 - radii[1] ** 2), rel=1e-9)
    assert len(face.inner_wires()) == (radii[1] > 0)
