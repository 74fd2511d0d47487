from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from gtcad import Curve, Quilt, Restricted, measure
from gtcad.errors import InputError, NotDevelopable
from gtcad.flat_pattern import develop
from gtcad.flat_strip import FlatStrip, develop_strip
from gtcad.patches import Rotation, Ruled, cone, cylinder, spine_developable
from gtcad.protocol import SeparableSurface
from tests.hopper import HEIGHT, LENGTH, RADIUS, WIDTH, hopper, line
from tests.unfolding import unfolded

Array = NDArray[np.float64]

BOW = Curve([[0, 0, 0], [30, 10, 0], [40, 40, 20], [10, 60, 40]], (0.2, -0.3))
SWING = Curve([[40, 0, 0], [40, 3, 10], [20, 40, 10], [0, 40, 30]], (0.1, -1 / 3))


def enclosed(strip: FlatStrip) -> float:
    """The area inside the contour, by Gauss-Legendre quadrature of x dy - y dx, after a look at its joints."""
    z, weights = np.polynomial.legendre.leggauss(20)
    total = 0.0
    for before, after in pairwise((*strip.contour, strip.contour[0])):
        np.testing.assert_allclose(before.evaluate(1.0), after.evaluate(0.0), atol=1e-9)
        edges = np.unique([*np.linspace(0, 1, 17), *before.breaks])
        for a, b in pairwise(edges):
            t = (a + b) / 2 + (b - a) / 2 * z
            (x, y), (dx, dy) = before.evaluate(t).T, before.derivative(t).T
            total += (b - a) / 4 * float(weights @ (x * dy - y * dx))
    return total


def parts_of(patch: SeparableSurface, breaks: list[float]) -> list[SeparableSurface]:
    return [Restricted(patch, ((a, b), (0.0, 1.0))) for a, b in pairwise(breaks)]


def test_a_hopper_has_the_area_of_its_surface_and_the_lengths_of_its_rims() -> None:
    strip = develop_strip(hopper())
    area = math.fsum(measure.area(patch) for patch in hopper())
    assert strip.area == pytest.approx(area, rel=1e-12)
    assert enclosed(strip) == pytest.approx(area, rel=1e-12)
    around = math.fsum(curve.length for curve in strip.contour)
    seam = math.dist((0, -WIDTH / 2, 0), (0, -RADIUS, HEIGHT))
    assert around == pytest.approx(2 * (LENGTH + WIDTH) + 2 * math.pi * RADIUS + 2 * seam, rel=1e-12)
    assert strip.gap < 1e-12
    assert strip.overlap is None
    assert strip.creases == ()  # triangles touch the cones beside them


def test_a_hopper_agrees_with_its_triangles() -> None:
    """1e5 triangles around the whole hopper, laid flat without gtcad."""
    lower, upper = [], []
    for k, patch in enumerate(hopper()):
        is_cone = k % 2 == 1  # its apex is a corner of the rectangle, that of a triangle a point of the circle
        t = np.linspace(0, 1, 12_501) if is_cone else np.array([0.0, 1.0])
        lower.append(patch.evaluate(t, float(is_cone)))
        upper.append(patch.evaluate(t, float(not is_cone)))
    flat = unfolded(np.concatenate(lower), np.concatenate(upper))
    strip = develop_strip(hopper())
    assert sum(map(len, lower)) > 50_000
    last = strip.patterns[-1]
    corners = last.point(1.0, 0.0), last.point(1.0, 1.0)
    np.testing.assert_allclose([flat[0][-1], flat[1][-1]], corners, atol=1e-5)


@pytest.mark.parametrize("order", [[0, 1, 2, 3], [3, 1, 0, 2], [2, 3, 1, 0]])
def test_parts_of_a_patch_lie_as_in_its_own_pattern(order: list[int]) -> None:
    patch = spine_developable(BOW, (5, 40))
    parts = parts_of(patch, [0, 0.2, 0.5, 0.6, 1])
    names = [f"part {k}" for k in order]
    strip = develop_strip([parts[k] for k in order], names=names)
    assert list(strip.names) in (["part 0", "part 1", "part 2", "part 3"], ["part 3", "part 2", "part 1", "part 0"])
    whole = develop(patch)
    corners = np.array([whole.point(u, v) for u in (0, 0.2, 0.5, 0.6, 1) for v in (0, 1)])
    u, v = np.array([0.0, 1.0])[:, None], np.array([0.0, 1.0])[None, :]
    ordered = [strip.pattern(f"part {k}") for k in range(4)]
    found = np.concatenate([ordered[0].point(0.0, v[0]), *(pattern.point(1.0, v[0]) for pattern in ordered)])
    distances = [np.linalg.norm(points[:, None] - points, axis=2) for points in (corners, found)]
    np.testing.assert_allclose(distances[0], distances[1], atol=1e-10)
    assert strip.patterns[0].point(u, v).shape == (2, 2, 2)


@settings(max_examples=6)
@given(st.lists(st.tuples(st.booleans(), st.booleans()), min_size=3, max_size=3))
def test_it_does_not_matter_which_way_the_parameters_run(turns: list[tuple[bool, bool]]) -> None:
    patch = cone(SWING, [10, 20, 300], (0.0, 0.6))
    parts = []
    for (a, b), (back, over) in zip(pairwise([0.0, 0.3, 0.6, 1.0]), turns, strict=True):
        parts.append(Restricted(patch, ((b, a) if back else (a, b), (1.0, 0.0) if over else (0.0, 1.0))))
    strip = develop_strip(parts)
    assert strip.gap < 1e-11
    assert strip.overlap is None
    assert enclosed(strip) == pytest.approx(measure.area(patch), rel=1e-9)
    assert strip.creases == ()


def test_rulings_in_u_and_in_v_go_together() -> None:
    profile = line([30, 0, 0], [10, 0, 50])
    turned = Rotation(profile, [0, 0, 0], [0, 0, 1], 60)
    ruling = turned.evaluate(np.array([0.0, 1.0]), 1.0)
    plate = cylinder(line(ruling[0], ruling[0] + [20, 40, 0]), ruling[1] - ruling[0])
    strip = develop_strip([turned, plate])
    assert strip.gap < 1e-12
    assert enclosed(strip) == pytest.approx(measure.area(turned) + measure.area(plate), rel=1e-12)
    assert len(strip.creases) == 1


@pytest.mark.parametrize("turned", [(), (0,), (1, 2), (0, 1, 2, 3)])
def test_plates_go_together_by_either_pair_of_sides(turned: tuple[int, ...]) -> None:
    """A folded channel with a lip, each plate between two fold lines: these are sides in v, or in u where turned."""
    section = [(0, 0, 30), (0, 0, 0), (100, 0, 0), (100, 0, 40), (80, 0, 40)]
    folds = [line((x, 0, z), (x, 200, z)) for x, _, z in section]
    plates: list[SeparableSurface] = [Ruled(a, b) for a, b in pairwise(folds)]
    for k in turned:
        ends = [folds[k].control_points, folds[k + 1].control_points]
        plates[k] = Ruled(line(ends[0][0], ends[1][0]), line(ends[0][1], ends[1][1]))
    strip = develop_strip(plates)
    assert strip.gap < 1e-12
    assert strip.overlap is None
    assert enclosed(strip) == pytest.approx(200 * (30 + 100 + 40 + 20), rel=1e-12)
    assert [abs(crease.angle_deg) for crease in strip.creases] == pytest.approx([90, 90, 90], rel=1e-12)
    assert len({math.copysign(1, crease.angle_deg) for crease in strip.creases}) == 1  # all to one side
    for pattern, crease, fold in zip(strip.patterns[:-1], strip.creases, folds[1:-1], strict=True):
        ends = pattern.patch.evaluate(*pattern.locate([crease.start, crease.end]).T)
        np.testing.assert_allclose(ends[ends[:, 1].argsort()], fold.control_points, atol=1e-9)


def test_plates_of_the_plane_have_no_creases() -> None:
    plates = [Ruled(line([x, 0], [x + 3, 0]), line([x, 2], [x + 3, 2])) for x in (0, 3)]
    strip = develop_strip(plates)
    assert (strip.creases, float(strip.area)) == ((), pytest.approx(12))


@pytest.mark.parametrize(("direction", "angle"), [([1, 0], 0.0), ([1, 1], -45.0), ([1, -1], 45.0), ([0, 1], -90.0)])
def test_creases_say_how_far_to_fold(direction: list[float], angle: float) -> None:
    """Walls along x, then along a direction; the normal is -y, so that turning towards y is away from the viewer."""
    end = np.array([3, 0, 0]) + [*direction, 0]
    walls = [cylinder(line([0, 0, 0], [3, 0, 0]), [0, 0, 2]), cylinder(line([3, 0, 0], end), [0, 0, 2])]
    for second in (
        walls[1],
        Restricted(walls[1], ((1.0, 0.0), (0.0, 1.0))),
        Restricted(walls[1], ((0.0, 1.0), (1.0, 0.0))),
    ):
        creases = develop_strip([walls[0], second]).creases
        assert [crease.angle_deg for crease in creases] == pytest.approx([angle] if angle else [])
        for crease in creases:
            np.testing.assert_allclose(sorted([crease.start, crease.end]), [[3, 0], [3, 2]], atol=1e-12)


def test_bend_lines_are_shared_out_by_the_turning() -> None:
    strip = develop_strip(hopper())
    lines = strip.bend_lines(24)
    assert len(lines) == 24
    assert math.fsum(line.angle_deg for line in lines) == pytest.approx(
        math.fsum(math.degrees(pattern.turning) for pattern in strip.patterns) * np.sign(lines[0].angle_deg), rel=1e-4
    )


@pytest.mark.parametrize("count", [0, 1, 2, 5, 6, 7, 12])
def test_there_are_as_many_bend_lines_as_asked_for(count: int) -> None:
    quarters = [[[1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 0], [-1, 1, 0], [-1, 0, 0]]]
    quarters += [[[-1, 0, 0], [-1, -1, 0], [0, -1, 0]], [[0, -1, 0], [1, -1, 0], [1, 0, 0]]]
    strip = develop_strip([cylinder(Curve(points), [0, 0, 3]) for points in quarters])
    assert len(strip.bend_lines(count)) == count
    flat = cylinder(line([0, 1, 0], [-9, 1, 0]), [0, 0, 3])
    lines = develop_strip([cylinder(Curve(quarters[0]), [0, 0, 3]), flat]).bend_lines(count)
    assert len(lines) == count
    assert all(line.start[0] < math.pi / 2 for line in lines)


@pytest.mark.parametrize("count", [-1, 2.5, True, "3"])
def test_numbers_of_bend_lines_that_are_none(count: object) -> None:
    with pytest.raises(InputError, match="count must be a whole number from 0, got"):
        develop_strip(hopper()).bend_lines(count)  # type: ignore[arg-type]


def test_a_ring_is_cut_at_the_first_ruling_of_the_first_patch() -> None:
    quarters = [[[1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 0], [-1, 1, 0], [-1, 0, 0]]]
    quarters += [[[-1, 0, 0], [-1, -1, 0], [0, -1, 0]], [[0, -1, 0], [1, -1, 0], [1, 0, 0]]]
    strip = develop_strip([cylinder(Curve(points), [0, 0, 3]) for points in quarters])
    u, v = np.array([0.0, 1.0]), np.array([0.0, 1.0])
    np.testing.assert_allclose(strip.patterns[0].point(u, v), [[0, 0], [math.pi / 2, 3]], atol=1e-13)
    np.testing.assert_allclose(strip.patterns[3].point(u, v), [[1.5 * math.pi, 0], [2 * math.pi, 3]], atol=1e-12)
    assert strip.names[0] == "patch 1"


def test_a_quilt_keeps_its_names_and_curves_their_patches() -> None:
    quilt = Quilt.recognised(hopper(), names=[f"plate {k}" for k in range(9)])
    strip = develop_strip(quilt)
    assert strip.names == quilt.names
    curve = Curve([[0.2, 0.2], [0.5, 0.8], [0.8, 0.3]])
    image = strip.image("plate 3", curve)
    assert image.length == pytest.approx(strip.roll(3, image).space.length, rel=1e-10)
    name, place = strip.locate(image.evaluate(0.5))
    assert name == "plate 3"
    np.testing.assert_allclose(place, curve.evaluate(0.5), atol=1e-9)
    for which in ("plate 9", 9):
        with pytest.raises(InputError, match="there is no patch"):
            strip.image(which, curve)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="outside the strip"):
        strip.locate([1e5, 0])
    for point in ([0, 0, 0], [[0, 0], [1, 1]], [math.nan, 0]):
        with pytest.raises(InputError, match="point must be two finite numbers"):
            strip.locate(point)


def test_what_is_no_strip_is_refused() -> None:
    first, second, third, *_ = hopper()
    with pytest.raises(NotDevelopable, match="'patch 2' shares no ruling"):
        develop_strip([first, third])
    with pytest.raises(NotDevelopable, match="more than two patches share the ruling"):
        develop_strip([first, second, second])
    with pytest.raises(
        NotDevelopable, match="patch 'b': the patch is not developable: its tangent plane twists"
    ) as caught:
        develop_strip([first, Ruled(line([0, 0, 0], [1, 0, 0]), line([0, 1, 0], [1, 1, 1]))], names=["a", "b"])
    assert caught.value.twist_deg is not None
    with pytest.raises(InputError, match="one patch at least"):
        develop_strip([])
    with pytest.raises(InputError, match="names must be 2 different ones"):
        develop_strip([first, second], names=["a", "a"])


def test_a_gap_is_allowed_where_it_is_asked_for() -> None:
    first, second, *_ = hopper()
    shifted = second.transformed(np.eye(3), [0, 0, 1e-3])
    with pytest.raises(NotDevelopable, match="shares no ruling"):
        develop_strip([first, shifted])
    assert develop_strip([first, shifted], gap=1e-5).gap == pytest.approx(1e-3, rel=1e-6)


def test_a_quilt_that_states_a_gap_is_a_strip_with_it() -> None:
    first, second, *_ = hopper()
    shifted = second.transformed(np.eye(3), [0, 0, 1e-3])
    [edge] = Quilt.recognised([first, second]).edges
    strip = develop_strip(Quilt.recognised([first, shifted], stated=[edge], gap=2e-3))
    assert strip.gap == pytest.approx(1e-3, rel=1e-6)


def test_what_is_no_patch_is_refused_by_name() -> None:
    with pytest.raises(InputError, match="'patch 2' must be a surface, got Curve"):
        develop_strip([hopper()[0], BOW])  # type: ignore[list-item]
