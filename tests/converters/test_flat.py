from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import ezdxf
import numpy as np
import pytest
from numpy.typing import NDArray

from gtcad import BERNSTEIN, Curve, measure
from gtcad._flat_bends import BendLine
from gtcad.conics import circle
from gtcad.converters.flat import LAYERS, write_dxf, write_svg
from gtcad.converters.flat_outline import CircleArc, Cubic, Sheet, Straight, arranged, draw_pattern
from gtcad.errors import FileError, InputError, KernelError, ToleranceBelowPrecision
from gtcad.flat_pattern import FlatPattern, develop
from gtcad.flat_strip import develop_strip
from gtcad.patches import Rotation, cone, cylinder, spine_developable
from tests.hopper import hopper
from tests.test_flat_pattern import helix

Array = NDArray[np.float64]

QUARTER = Curve([[100, 0, 0], [100, 100, 0], [0, 100, 0]])
BOW = Curve([[0, 0, 0], [30, 10, 0], [40, 40, 20], [10, 60, 40]], (0.2, -0.3))
SLIT = Curve([[0.1, 0.1], [0.5, 0.2], [0.8, 0.4]])
SVG = "{http://www.w3.org/2000/svg}"


def plate() -> FlatPattern:
    return develop(spine_developable(BOW, (5, 40)))


def drawn(tolerance: float = 1e-2, **options: Any) -> Sheet:
    pattern = plate()
    hole, mark = pattern.image(circle([0.5, 0.5], 0.2)), pattern.image(SLIT)
    given: dict[str, Any] = {"name": "plate", "bend_lines": 5, "holes": [hole], "marks": [mark]}
    return draw_pattern(pattern, tolerance=tolerance, **given | options)


def distances(points: Array, line: Array) -> Array:
    """Distances of points from a polyline."""
    start, along = line[:-1], np.diff(line, axis=0)
    found = []
    for point in points:
        offset = point - start
        s = np.clip((offset * along).sum(axis=1) / np.maximum((along**2).sum(axis=1), 1e-300), 0, 1)
        found.append(np.linalg.norm(offset - s[:, None] * along, axis=1).min())
    return np.array(found)


def around(pattern: Any, count: int) -> Array:
    t = np.linspace(0, 1, count)
    return np.concatenate([curve.evaluate(t) for curve in pattern.contour])


def outside_of_the_hole(line: BendLine) -> float:
    """The length of a ruling of ``drawn`` without what lies in the circle of radius 0.2 around (0.5, 0.5)."""
    inside = 2 * math.sqrt(max(0.0, 0.2**2 - (line.parameter - 0.5) ** 2))
    return math.dist(line.start, line.end) * (1 - inside)


# --- drawings ---------------------------------------------------------------------------------------------------------


def test_a_sector_is_drawn_with_an_arc_and_lines() -> None:
    sheet = draw_pattern(develop(cone(QUARTER, [0, 0, 200])), tolerance=1e-2)
    arc, *lines = sheet.cut[0].entities
    assert isinstance(arc, CircleArc)
    assert [type(line) for line in lines] == [Straight, Straight]
    assert arc.radius == pytest.approx(math.hypot(100, 200), rel=1e-12)
    assert abs(arc.sweep) == pytest.approx(math.pi / 2 * 100 / math.hypot(100, 200), rel=1e-12)
    assert sheet.deviation < 1e-8


def test_a_rectangle_is_drawn_with_lines() -> None:
    swing = Curve([[40, 0, 0], [40, 3, 0], [20, 40, 0], [0, 40, 0]], (0.1, -1 / 3))
    sheet = draw_pattern(develop(cylinder(swing, [0, 0, 30])), tolerance=1e-2)
    assert [type(entity) for entity in sheet.cut[0].entities] == [Straight] * 4
    np.testing.assert_allclose(sheet.box, [[0, 0], [measure.length(swing), 30]], atol=1e-9)


@pytest.mark.parametrize("tolerance", [1e-1, 1e-3, 1e-5])
def test_the_outline_keeps_the_tolerance(tolerance: float) -> None:
    sheet, pattern = drawn(tolerance), plate()
    assert sheet.deviation <= tolerance
    fine = around(pattern, 4001)
    points = np.concatenate([entity.points(37) for entity in sheet.cut[0].entities])
    sagitta = 1e-6  # of the polyline that stands for the exact outline
    assert distances(points, fine).max() <= sheet.deviation + sagitta
    assert any(isinstance(entity, Cubic) for entity in sheet.cut[0].entities)


def test_paths_are_closed_bit_for_bit() -> None:
    for path in (*drawn().cut, *draw_pattern(develop_strip(hopper()), tolerance=1e-2).cut):
        assert path.closed
        for before, after in zip(path.entities, (*path.entities[1:], path.entities[0]), strict=True):
            if isinstance(before, CircleArc) or isinstance(after, CircleArc):
                np.testing.assert_allclose(before.end, after.start, atol=1e-10)
            else:
                assert before.end.tolist() == after.start.tolist()


def test_sheets_lie_beside_each_other() -> None:
    sheets = arranged([drawn(), draw_pattern(develop_strip(hopper()), tolerance=1e-2), drawn()], spacing=7)
    boxes = [sheet.box for sheet in sheets]
    np.testing.assert_allclose([box[0, 1] for box in boxes], 0, atol=1e-12)
    assert boxes[0][0, 0] == pytest.approx(0, abs=1e-12)
    for before, after in pairwise(boxes):
        assert after[0, 0] - before[1, 0] == pytest.approx(7)
    moved = sheets[2].bend[0].start[0] - sheets[0].bend[0].start[0]
    assert moved == pytest.approx(boxes[2][0, 0])


@pytest.mark.parametrize("tolerance", [1e-2, 1e-5])
def test_the_box_is_that_of_the_outline(tolerance: float) -> None:
    ring = develop(Rotation(Curve([[80, 0, 0], [100, 0, 0]], family=BERNSTEIN), (0, 0, 0), (0, 0, 1), 300))
    for sheet in (drawn(tolerance), draw_pattern(ring, tolerance=tolerance), sector()):
        fine = np.concatenate([entity.points(20001) for entity in sheet.cut[0].entities])
        size = float(np.ptp(fine, axis=0).max())
        np.testing.assert_allclose(sheet.box, [fine.min(axis=0), fine.max(axis=0)], atol=1e-8 * size)
    np.testing.assert_allclose(np.ptp(draw_pattern(ring, tolerance=1e-2).box, axis=0), [200, 200], rtol=1e-9)


def test_what_cannot_be_drawn_is_refused() -> None:
    pattern = plate()
    with pytest.raises(InputError, match="a hole must be a closed curve"):
        draw_pattern(pattern, tolerance=1e-2, holes=[pattern.image(SLIT)])
    eight = pattern.image(lambda t: 0.5 + 0.3 * np.stack([np.sin(2 * np.pi * t), np.sin(4 * np.pi * t)], axis=1))
    with pytest.raises(InputError, match="a hole must not cross itself"):
        draw_pattern(pattern, tolerance=1e-2, holes=[eight])
    with pytest.raises(ToleranceBelowPrecision):
        draw_pattern(pattern, tolerance=1e-14)
    for tolerance in (0.0, -1.0, math.inf, math.nan):
        with pytest.raises(InputError, match="tolerance must be a finite number above 0"):
            draw_pattern(pattern, tolerance=tolerance)
    for name in ("a\nb", "\x01", "\ud800"):  # which neither DXF nor SVG can hold
        with pytest.raises(InputError, match="name must consist of printable characters"):
            draw_pattern(pattern, tolerance=1e-2, name=name)


# --- DXF --------------------------------------------------------------------------------------------------------------


def lengths_by_layer(path: Path) -> dict[str, float]:
    """The lengths of the entities of a DXF file, by ezdxf's own evaluation."""
    found = dict.fromkeys(LAYERS, 0.0)
    for entity in ezdxf.readfile(path).modelspace():  # type: ignore[attr-defined]
        found[entity.dxf.layer] += length_of(entity)
    return found


def length_of(entity: Any) -> float:
    match entity.dxftype():
        case "LINE":
            return float(entity.dxf.start.distance(entity.dxf.end))
        case "ARC":
            return float(entity.dxf.radius * math.radians((entity.dxf.end_angle - entity.dxf.start_angle) % 360))
        case "SPLINE":
            points = np.array(list(entity.construction_tool().approximate(4000)))
            return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    raise AssertionError(entity.dxftype())


def test_dxf_has_the_layers_units_and_lengths(tmp_path: Path) -> None:
    path, pattern, sheet = tmp_path / "flat.dxf", plate(), drawn(1e-4)
    write_dxf(path, [sheet])
    document = ezdxf.readfile(path)  # type: ignore[attr-defined]
    assert (document.units, document.header["$MEASUREMENT"], document.header["$INSUNITS"]) == (4, 1, 4)
    assert set(LAYERS) <= {layer.dxf.name for layer in document.layers}
    assert document.layers.get("BEND").dxf.linetype == "DASHED"
    assert document.audit().errors == []
    hole, mark = pattern.image(circle([0.5, 0.5], 0.2)), pattern.image(SLIT)
    found = lengths_by_layer(path)
    assert found["CUT"] == pytest.approx(math.fsum(pattern.lengths.values()) + hole.length, rel=1e-5)
    assert found["MARK"] == pytest.approx(mark.length, rel=1e-5)
    assert found["BEND"] == pytest.approx(math.fsum(outside_of_the_hole(line) for line in sheet.bend), rel=1e-9)
    assert [len(list(group)) for _, group in document.groups] == [len(document.modelspace())]


def test_dxf_outlines_are_closed(tmp_path: Path) -> None:
    path = tmp_path / "flat.dxf"
    write_dxf(path, arranged([draw_pattern(develop_strip(hopper()), tolerance=1e-2), drawn(), sector()]))
    ends = []
    for entity in ezdxf.readfile(path).modelspace().query('*[layer=="CUT"]'):  # type: ignore[attr-defined]
        if entity.dxftype() == "SPLINE":
            points = entity.construction_tool().control_points
            ends += [points[0], points[-1]]
        else:
            ends += (
                [entity.start_point, entity.end_point]
                if entity.dxftype() == "ARC"
                else [entity.dxf.start, entity.dxf.end]
            )
    points = np.array([tuple(end) for end in ends])
    apart = np.linalg.norm(points[:, None] - points, axis=2)
    assert ((apart < 1e-9).sum(axis=1) == 2).all()  # itself and one other


def sector() -> Sheet:
    return draw_pattern(develop(cone(QUARTER, [0, 0, 200], (0, 0.5))), tolerance=1e-2, name="sector", bend_lines=3)


def test_dxf_arcs_lie_on_the_pattern(tmp_path: Path) -> None:
    path, pattern = tmp_path / "flat.dxf", develop(cone(QUARTER, [0, 0, 200], (0, 0.5)))
    write_dxf(path, [sector()])
    arcs = ezdxf.readfile(path).modelspace().query("ARC")  # type: ignore[attr-defined]
    assert len(arcs) == 2
    fine = around(pattern, 4001)
    for arc in arcs:
        points = np.array([tuple(point)[:2] for point in arc.flattening(1e-3)])
        assert distances(points, fine).max() < 1e-5


def test_equal_drawings_with_strange_names(tmp_path: Path) -> None:
    path = tmp_path / "flat.dxf"
    write_dxf(path, arranged([drawn(name="<plate> & *|?"), drawn(name="<plate> & *|?")]))
    document = ezdxf.readfile(path)  # type: ignore[attr-defined]
    assert len(document.groups) == 2
    assert document.audit().errors == []


def test_no_sheets_and_no_folder(tmp_path: Path) -> None:
    for write in (write_dxf, write_svg):
        with pytest.raises(InputError, match="one sheet at least"):
            write(tmp_path / "x.dxf", [])
        with pytest.raises(FileError):
            write(tmp_path / "nowhere" / "x.dxf", [drawn()])
    assert list(tmp_path.iterdir()) == []


# --- SVG --------------------------------------------------------------------------------------------------------------


def points_of(path: Any) -> Array:
    """Many points along a path of svgpathtools."""
    s = np.linspace(0, 1, 401)
    parts = [part.poly()(s) if hasattr(part, "poly") else np.array([part.point(x) for x in s]) for part in path]
    found = np.concatenate(parts)
    return np.stack([found.real, found.imag], axis=1)


def length_along(points: Array) -> float:
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def test_svg_has_millimetres_groups_and_lengths(tmp_path: Path) -> None:
    svgpathtools = pytest.importorskip("svgpathtools")
    path, pattern, sheet = tmp_path / "flat.svg", plate(), drawn(1e-4, name="<plate> & 1")
    write_svg(path, [sheet])
    root = ElementTree.parse(path).getroot()
    width, height = (float(root.attrib[side].removesuffix("mm")) for side in ("width", "height"))
    assert [float(number) for number in root.attrib["viewBox"].split()] == [0, 0, width, height]
    low, high = sheet.box
    np.testing.assert_allclose([width, height], high - low + 10, atol=1e-5)
    groups = {group.attrib["id"]: group for group in root.findall(f"{SVG}g")}
    lines = [[float(line.attrib[end]) for end in ("x1", "y1", "x2", "y2")] for line in groups["BEND"]]
    drawn_length = math.fsum(math.dist(line[:2], line[2:]) for line in lines)
    assert drawn_length == pytest.approx(math.fsum(outside_of_the_hole(line) for line in sheet.bend), rel=1e-8)
    assert list(groups) == list(LAYERS)
    assert "stroke-dasharray" in groups["BEND"].attrib
    [cut] = groups["CUT"].findall(f"{SVG}path")
    assert cut[0].text == "<plate> & 1"
    loops = svgpathtools.parse_path(cut.attrib["d"]).continuous_subpaths()
    assert [loop.isclosed() for loop in loops] == [True, True]
    hole = pattern.image(circle([0.5, 0.5], 0.2))
    assert length_along(points_of(loops[0])) == pytest.approx(math.fsum(pattern.lengths.values()), rel=1e-5)
    assert length_along(points_of(loops[1])) == pytest.approx(hole.length, rel=1e-5)
    assert len(groups["BEND"]) == 7  # two of five rulings cross the hole
    upright = np.array([low[0] - 5, high[1] + 5]) + points_of(loops[0])[::97] * [1, -1]
    assert distances(upright, around(pattern, 4001)).max() < 2e-4


def test_svg_arcs_turn_the_right_way(tmp_path: Path) -> None:
    svgpathtools = pytest.importorskip("svgpathtools")
    path, pattern = tmp_path / "flat.svg", develop(cone(QUARTER, [0, 0, 200], (0, 0.5)))
    write_svg(path, [sector()])
    [cut] = ElementTree.parse(path).getroot().findall(f"{SVG}g[@id='CUT']/{SVG}path")
    outline = svgpathtools.parse_path(cut.attrib["d"])
    assert sum(isinstance(part, svgpathtools.Arc) for part in outline) == 2
    points = points_of(outline)
    assert length_along(points) == pytest.approx(math.fsum(pattern.lengths.values()), rel=1e-5)
    x, y = points.T
    assert abs(float(x[:-1] @ y[1:] - x[1:] @ y[:-1])) / 2 == pytest.approx(pattern.area, rel=1e-5)


@pytest.mark.parametrize("degrees", [359.99, 270.0, 180.0])
def test_svg_arcs_of_nearly_a_full_turn_keep_their_centres(tmp_path: Path, degrees: float) -> None:
    """Of the ends of half a circle alone its centre is known to the root of their rounding, which is 5e-10 mm."""
    svgpathtools = pytest.importorskip("svgpathtools")
    cosine = degrees / 360  # of the slope of a cone whose sector turns by that much
    rise = np.array([cosine, 0.0, math.sqrt(1 - cosine**2)])
    profile = Curve([30 * rise, 100 * rise], family=BERNSTEIN)
    sheet = draw_pattern(develop(Rotation(profile, (0, 0, 0), (0, 0, 1))), tolerance=1e-6)
    path = tmp_path / "flat.svg"
    write_svg(path, [sheet])
    [cut] = ElementTree.parse(path).getroot().findall(f"{SVG}g[@id='CUT']/{SVG}path")
    arcs = [part for part in svgpathtools.parse_path(cut.attrib["d"]) if isinstance(part, svgpathtools.Arc)]
    center, other = (entity.center for entity in sheet.cut[0].entities if isinstance(entity, CircleArc))
    np.testing.assert_allclose(center, other, atol=1e-10)
    origin = np.array([sheet.box[0, 0] - 5, sheet.box[1, 1] + 5])
    x, y = points_of(arcs).T
    radii = np.hypot(origin[0] + x - center[0], origin[1] - y - center[1])
    np.testing.assert_allclose(np.minimum(abs(radii - 30), abs(radii - 100)), 0, atol=1e-8)


# --- build123d --------------------------------------------------------------------------------------------------------


def test_a_face_of_build123d_has_the_area_and_the_hole() -> None:
    pytest.importorskip("build123d")
    from gtcad.converters.build123d_flat import flat_face, flat_lines

    sheet, pattern = drawn(1e-5), plate()
    face = flat_face(sheet)
    hole = pattern.image(circle([0.5, 0.5], 0.2))
    t = np.linspace(0, 1, 200_001)
    x, y = hole.evaluate(t).T
    removed = abs(float(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]))) / 2
    assert face.is_valid if isinstance(face.is_valid, bool) else face.is_valid()
    assert len(face.inner_wires()) == 1
    assert face.area == pytest.approx(pattern.area - removed, rel=1e-6)
    assert tuple(face.normal_at()) == pytest.approx((0, 0, 1))
    assert face.label == "plate"
    lines = flat_lines(sheet)
    assert len(lines) == 7  # two of five rulings cross the hole
    total = math.fsum(outside_of_the_hole(line) for line in sheet.bend)
    assert math.fsum(line.length for line in lines) == pytest.approx(total, rel=1e-9)
    assert {line.label for line in lines} == {f"bend {line.angle_deg:+.4g}" for line in sheet.bend}


def test_a_hole_that_touches_the_outline_leaves_no_face() -> None:
    pytest.importorskip("build123d")
    from gtcad.converters.build123d_flat import flat_face

    pattern = develop(cylinder(QUARTER, [0, 0, 30]))
    sheet = draw_pattern(pattern, tolerance=1e-2, name="eye", holes=[pattern.image(circle([0.5, 0.5], 0.5))])
    with pytest.raises(KernelError, match="face of 'eye'"):
        flat_face(sheet)


@pytest.mark.parametrize(
    "sheet", [sector(), draw_pattern(develop_strip(hopper()), tolerance=1e-4)], ids=["sector", "hopper"]
)
def test_faces_with_arcs_and_of_strips(sheet: Sheet) -> None:
    pytest.importorskip("build123d")
    from gtcad.converters.build123d_flat import flat_face

    area = {"sector": 0.75 * math.pi / 4 * 100 * math.hypot(100, 200)}
    expected = area.get(sheet.name, math.fsum(measure.area(patch) for patch in hopper()))
    assert flat_face(sheet).area == pytest.approx(expected, rel=1e-7)


def test_a_pattern_over_itself_is_no_face() -> None:
    pytest.importorskip("build123d")
    from gtcad.converters.build123d_flat import flat_face

    sheet = draw_pattern(develop(helix(2.0, 20.0, 30.0, (4.0, 30.0))), tolerance=1e-2)
    with pytest.raises(InputError, match="lies over itself near"):
        flat_face(sheet)


def test_a_straight_mark_is_a_line() -> None:
    pattern = develop(cylinder(QUARTER, [0, 0, 30]))
    mark = pattern.image(Curve([[0.1, 0.1], [0.9, 0.7]], family=BERNSTEIN))
    sheet = draw_pattern(pattern, tolerance=1e-2, marks=[mark])
    assert [type(entity) for entity in sheet.mark[0].entities] == [Straight]
    assert sheet.bend == ()
