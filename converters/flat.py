"""Flat patterns to DXF and SVG files, in millimetres, on the layers CUT, BEND and MARK."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gtcad._files import written_whole
from gtcad.converters.flat_outline import CircleArc, Cubic, Entity, Path, Sheet, Straight, bezier_spans
from gtcad.errors import ExtraMissing, InputError

if TYPE_CHECKING:
    from ezdxf.layouts.layout import Modelspace

Array = NDArray[np.float64]

LAYERS = ("CUT", "BEND", "MARK")
_COLORS = {"CUT": 7, "BEND": 5, "MARK": 3}  # of AutoCAD: black or white, blue, green
_STYLES = {
    "CUT": 'stroke="#000000" stroke-width="0.35"',
    "BEND": 'stroke="#1f4fb2" stroke-width="0.25" stroke-dasharray="4 2"',
    "MARK": 'stroke="#2a7f3f" stroke-width="0.25"',
}
_DASHES = 10.0  # scale of the dashes: about 5 mm each
_MARGIN = 5.0  # mm around an SVG drawing
_LARGEST_ARC = math.pi / 2


def write_dxf(path: str | os.PathLike[str], sheets: Sequence[Sheet]) -> None:
    """Write sheets to a DXF file (R2010, millimetres): outlines and holes on CUT, bend lines on BEND, curves on MARK.

    Lines are LINE, arcs ARC, and all else SPLINE entities of degree 3; each sheet is a group of its name.

    Raises
    ------
    InputError
        When there are no sheets.
    ExtraMissing
        When ezdxf is not installed.
    FileError
        When the file cannot be written.
    """
    _check_sheets(sheets)
    try:
        import ezdxf
        from ezdxf.lldxf import const
    except ImportError as error:
        raise ExtraMissing("DXF files need ezdxf: pip install 'gtcad[flat]'") from error
    document = ezdxf.new("R2010", setup=["linetypes"], units=4)  # type: ignore[attr-defined]
    document.header["$MEASUREMENT"], document.header["$LTSCALE"] = 1, _DASHES
    for layer in LAYERS:
        document.layers.add(layer, color=_COLORS[layer], linetype="DASHED" if layer == "BEND" else "CONTINUOUS")
    space = document.modelspace()
    for number, sheet in enumerate(sheets, 1):
        entities = list(_dxf_entities(space, sheet))
        name = _group_name(sheet.name, number)
        group = document.groups.new(name, description=sheet.name[: const.MAX_STR_LEN])
        group.extend(entities)
    low, high = _box(sheets)
    document.header["$EXTMIN"], document.header["$EXTMAX"] = (*low, 0.0), (*high, 0.0)
    with written_whole(path) as temporary:
        document.saveas(temporary)


def _group_name(name: str, number: int) -> str:
    """A name that DXF takes, different for each number."""
    letters = "".join(letter if letter.isalnum() and letter.isascii() else "_" for letter in name)
    return f"{number}_{letters}"[:31]


def _dxf_entities(space: Modelspace, sheet: Sheet) -> Iterator[Any]:
    for layer, paths in (("CUT", sheet.cut), ("MARK", sheet.mark)):
        for path in paths:
            for entity in path.entities:
                yield _dxf_entity(space, entity, {"layer": layer})
    for start, end in (piece for line in sheet.bend for piece in line.pieces):
        yield space.add_line(start, end, {"layer": "BEND"})


def _dxf_entity(space: Modelspace, entity: Entity, attributes: dict[str, str]) -> Any:
    match entity:
        case Straight():
            return space.add_line(tuple(entity.start), tuple(entity.end), attributes)
        case CircleArc():
            center, whole = tuple(entity.center), abs(entity.sweep) >= 2 * math.pi - 1e-9
            if whole:
                return space.add_circle(center, entity.radius, attributes)
            first, last = sorted([entity.angle, entity.angle + entity.sweep])
            return space.add_arc(center, entity.radius, math.degrees(first), math.degrees(last), dxfattribs=attributes)
        case Cubic(spline):
            points = [(x, y, 0.0) for x, y in spline.control_points.tolist()]
            return space.add_open_spline(points, spline.degree, knots=spline.flat_knots.tolist(), dxfattribs=attributes)


def write_svg(path: str | os.PathLike[str], sheets: Sequence[Sheet]) -> None:
    """Write sheets to an SVG file whose unit is the millimetre, with a group for each of CUT, BEND and MARK.

    Raises
    ------
    InputError
        When there are no sheets.
    FileError
        When the file cannot be written.
    """
    _check_sheets(sheets)
    low, high = _box(sheets)
    width, height = (high - low + 2 * _MARGIN).tolist()
    corner = np.array([low[0] - _MARGIN, high[1] + _MARGIN])
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{_number(width)}mm" height="{_number(height)}mm" '
        f'viewBox="0 0 {_number(width)} {_number(height)}">',
    ]
    for layer in LAYERS:
        lines.append(f'  <g id="{layer}" fill="none" {_STYLES[layer]}>')
        for sheet in sheets:
            lines += [f"    {line}" for line in _svg_lines(sheet, layer, corner)]
        lines.append("  </g>")
    lines.append("</svg>")
    with written_whole(path) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")


def _svg_lines(sheet: Sheet, layer: str, corner: Array) -> Iterator[str]:
    title = f"<title>{escape(sheet.name)}</title>"
    if layer == "BEND":
        for line in sheet.bend:
            text = f"<title>{escape(sheet.name)}: {line.angle_deg:+.3g} degrees</title>"
            for piece in line.pieces:
                (a, b), (c, d) = (_pair(np.array(end), corner) for end in piece)
                yield f'<line x1="{a}" y1="{b}" x2="{c}" y2="{d}">{text}</line>'
        return
    if layer == "CUT":
        yield f'<path fill-rule="evenodd" d="{" ".join(_svg_path(path, corner) for path in sheet.cut)}">{title}</path>'
        return
    for path in sheet.mark:
        yield f'<path d="{_svg_path(path, corner)}">{title}</path>'


def _svg_path(path: Path, corner: Array) -> str:
    parts = ["M", *_pair(path.entities[0].start, corner)]
    for entity in path.entities:
        match entity:
            case Straight():
                parts += ["L", *_pair(entity.end, corner)]
            case CircleArc():  # quarters: of its ends alone the centre of a half is badly known; y points downwards
                for point in entity.points(1 + max(1, math.ceil(abs(entity.sweep) / _LARGEST_ARC)))[1:]:
                    turn = "0" if entity.sweep > 0 else "1"
                    parts += [
                        "A",
                        _number(entity.radius),
                        _number(entity.radius),
                        "0",
                        "0",
                        turn,
                        *_pair(point, corner),
                    ]
            case Cubic(spline):
                for poles in bezier_spans(spline):
                    parts += ["C", *(text for pole in poles[1:] for text in _pair(pole, corner))]
    if path.closed:
        parts.append("Z")
    return " ".join(parts)


def _pair(point: Array, corner: Array) -> tuple[str, str]:
    return _number(point[0] - corner[0]), _number(corner[1] - point[1])


def _number(value: float) -> str:
    text = f"{value:.9f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def _box(sheets: Sequence[Sheet]) -> tuple[Array, Array]:
    boxes = np.stack([sheet.box for sheet in sheets])
    return boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)


def _check_sheets(sheets: Sequence[Sheet]) -> None:
    if not sheets:
        raise InputError("a drawing needs one sheet at least, got none")
