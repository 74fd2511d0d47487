"""Flat patterns as plane faces of build123d."""

from __future__ import annotations

import math

import numpy as np

from gtcad.converters.bspline import BSplineCurve
from gtcad.converters.build123d_lines import host
from gtcad.converters.flat_outline import CircleArc, Cubic, Entity, Path, Sheet, Straight
from gtcad.converters.occt.topology import checked, make_wire
from gtcad.converters.part import EllipseArc, Wire
from gtcad.errors import InputError


def flat_face(sheet: Sheet) -> host.Face:
    """The plane face inside the outline of a sheet, with its holes, at z = 0; the normal points along z.

    Parameters
    ----------
    sheet
        From ``draw_pattern``, in mm.

    Raises
    ------
    InputError
        When the pattern lies over itself.
    KernelError
        When the kernel refuses the face: as where a hole touches the outline.
    """
    if sheet.overlap is not None:
        x, y = sheet.overlap.point
        raise InputError(f"{sheet.name!r} lies over itself near ({x:.6g}, {y:.6g}): it is no face")
    outer, *inner = (host.Wire(make_wire(_wire(path))) for path in sheet.cut)
    face = host.Face(outer, inner)
    checked(face.wrapped, f"face of {sheet.name!r}")
    face.label = sheet.name
    return face if face.normal_at().Z > 0 else -face


def flat_lines(sheet: Sheet) -> list[host.Edge]:
    """The bend lines of a sheet as edges at z = 0, without what lies in holes, each labelled with its angle."""
    edges = []
    for line in sheet.bend:
        for start, end in line.pieces:
            edge = host.Edge.make_line((*start, 0.0), (*end, 0.0))
            edge.label = f"bend {line.angle_deg:+.4g}"
            edges.append(edge)
    return edges


def _wire(path: Path) -> Wire:
    return Wire(tuple(_edge(entity) for entity in path.entities))


def _edge(entity: Entity) -> BSplineCurve | EllipseArc:
    match entity:
        case Straight():
            return BSplineCurve(np.pad([entity.start, entity.end], ((0, 0), (0, 1))), [0.0, 1.0], [2, 2], 1)
        case CircleArc():
            sense = math.copysign(entity.radius, entity.sweep)
            cosine, sine = math.cos(entity.angle), math.sin(entity.angle)
            axes = [entity.radius * cosine, entity.radius * sine, 0.0], [-sense * sine, sense * cosine, 0.0]
            return EllipseArc([*entity.center, 0.0], *axes, 0.0, min(abs(entity.sweep), 2 * math.pi))
        case Cubic(spline):
            poles = np.pad(spline.control_points, ((0, 0), (0, 1)))
            return BSplineCurve(poles, spline.knots, spline.multiplicities, spline.degree)
