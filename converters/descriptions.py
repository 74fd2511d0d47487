"""What models and exchange files hold, as plain data for tables and JSON: shapes, boxes, numbers of poles, degrees."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from itertools import takewhile
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gtcad._entries import ModelShape
from gtcad.composite import Composite
from gtcad.converters.bspline import BSplineCurve, BSplineSurface
from gtcad.converters.part import BodyFacts, Built, EllipseArc, Geometry, Part, Single, Wire
from gtcad.converters.quadrics import Quadric, extremes
from gtcad.model import Model
from gtcad.patches import PlaneFamily
from gtcad.protocol import SeparableCurve, Shape
from gtcad.quilt import Quilt
from gtcad.restricted import RestrictedCurve, RestrictedSurface
from gtcad.solid import Solid

Array = NDArray[np.float64]

# --- models -----------------------------------------------------------------------------------------------------------


def describe_model(model: Model) -> dict[str, Any]:
    """Unit, box of the control points in mm, and the shapes of a model, as plain data."""
    shapes = [
        _shape_data(name, shape) | {"color": model.colors.get(name), "construction": name in model.construction}
        for name, shape in model.items()
    ]
    meant = model.in_millimetres().values()
    points = [_points(shape) for shape in meant]
    of = "control points" if all(map(_has_control_points, meant)) else "control points and samples"
    return {"format": "model", "unit": model.unit, "box": _box(points), "box_of": of, "shapes": shapes}


def _has_control_points(shape: ModelShape) -> bool:
    return all(hasattr(_whole(piece), "control_points") for piece in _parts(shape))


def _parts(shape: ModelShape) -> tuple[Shape, ...]:
    """The curves or patches that a shape is made of."""
    if isinstance(shape, Solid):
        return shape.quilt.patches
    if isinstance(shape, Quilt):
        return shape.patches
    return shape.pieces if isinstance(shape, Composite) else (shape,)


def _points(shape: ModelShape) -> Array:
    """Control points, or points of what has none."""
    return np.concatenate([_points_of(piece) for piece in _parts(shape)])


def _points_of(shape: Shape) -> Array:
    if _has_control_points(shape):
        return np.asarray(_whole(shape).control_points).reshape(-1, shape.dimension)
    line = np.linspace(0.0, 1.0, 129)
    points = shape.evaluate(line) if isinstance(shape, SeparableCurve) else shape.evaluate(line[:, None], line[None, :])
    return points.reshape(-1, shape.dimension)


def _shape_data(name: str, shape: ModelShape) -> dict[str, Any]:
    pieces = _parts(shape)
    families = dict.fromkeys(family for piece in pieces for family in _families(_whole(piece)))
    counts = [_count(_whole(piece)) for piece in pieces]
    kind, part, joints = _kind(_whole(pieces[0])), None, []
    if isinstance(shape, Composite):
        kind, joints = "closed composite" if shape.closed else "composite", list(shape.orders)
    elif isinstance(shape, Quilt | Solid):
        quilt = shape.quilt if isinstance(shape, Solid) else shape
        kind, joints = type(shape).__name__.lower(), [edge.order for edge in quilt.edges]
    elif isinstance(shape, RestrictedCurve | RestrictedSurface):
        part = shape.range
    several = len(pieces) > 1
    fields = {
        "families": list(families),
        "degree": sorted({n - 1 for count in counts for n in count}) if several else [n - 1 for n in counts[0]],
        "poles": [math.prod(count) for count in counts if count] if several else counts[0],
    }
    return {"name": name, "kind": kind, **fields, "range": part, "joints": joints}


def _whole(shape: Shape) -> Any:
    return shape.shape if isinstance(shape, RestrictedCurve | RestrictedSurface) else shape


def _kind(whole: Any) -> str:
    """The name of the class as words: "spine-developable", "tb-coons"."""
    return re.sub("(?<=[A-Z])(?=[A-Z][a-z])|(?<=[a-z])(?=[A-Z])", "-", type(whole).__name__).lower()


def _planes(whole: Any) -> PlaneFamily | None:
    """The planes that a developable is made of."""
    found = (getattr(whole, field, None) for field in ("family", "spine"))
    return next((one for one in found if isinstance(one, PlaneFamily)), None)


def _count(whole: Any) -> list[int]:
    """The numbers of control points in each direction, or of control planes."""
    planes = _planes(whole)
    net = getattr(whole, "control_points", np.empty(1)) if planes is None else planes.control_planes
    return list(net.shape[:-1])


def _families(whole: Any) -> list[str]:
    if (planes := _planes(whole)) is not None:
        return [planes.family.name]
    return [getattr(whole, field).name for field in ("family", "family_u", "family_v") if hasattr(whole, field)]


# --- exchange files ---------------------------------------------------------------------------------------------------


def describe_parts(parts: Sequence[Part], form: str) -> dict[str, Any]:
    """Box of the control points in mm, and the curves and surfaces of an exchange file, as plain data."""
    return {
        "format": form,
        "unit": "mm",
        "box": box_of(parts),
        "box_of": "control points",
        "shapes": [_part_data(part) for part in parts],
        "bodies": _bodies_data(parts),
    }


def box_of(parts: Sequence[Part]) -> dict[str, list[float]] | None:
    """Least and largest coordinates of control points, of arcs and quadrics of their points; None without parts."""
    return _box([_span(piece) for part in parts for piece in pieces_of(part.geometry)])


def _bodies_data(parts: Sequence[Part]) -> list[dict[str, Any]]:
    """The shells and solids that the faces belong to, in order, called by what the names of their faces have alike."""
    faces: dict[int, list[Part]] = {}
    for part in parts:
        if part.body is not None:
            faces.setdefault(id(part.body), []).append(part)
    return [_body_data(own[0].body, own) for own in faces.values() if own[0].body is not None]


def _body_data(body: BodyFacts, faces: Sequence[Part]) -> dict[str, Any]:
    names = [part.name for part in faces]
    pairs = takewhile(lambda pair: pair[0] == pair[1], zip(min(names), max(names), strict=False))
    common = "".join(letter for letter, _ in pairs)
    solid = body.kind == "solid"
    return {
        "name": common if set(names) == {common} else common.rpartition(".")[0],
        "kind": body.kind,
        "faces": len(faces),
        "closed": body.closed,
        "valid": body.valid,
        "volume": float(body.volume()) if solid else None,
    }


def _part_data(part: Part) -> dict[str, Any]:
    poles, degrees = sizes(part.geometry)
    return {
        "name": part.name,
        "kind": "surface" if isinstance(part.geometry, BSplineSurface | Quadric) else "curve",
        "entity": part.source,
        "degree": degrees,
        "poles": poles,
        "trimmed": part.trimmed,
        "valid": part.valid,
        "color": _hex(part.color),
    }


def _hex(color: tuple[float, float, float] | None) -> str | None:
    return None if color is None else "#" + bytes(round(255 * value) for value in color).hex()


def sizes(geometry: Geometry) -> tuple[list[int], list[int]]:
    """The numbers of poles and the degrees of the directions: none if analytic; of each piece of a wire or body."""
    if isinstance(geometry, Wire | Built):
        found = [sizes(piece) for piece in pieces_of(geometry)]
        return [math.prod(poles) for poles, _ in found], sorted({n for _, degrees in found for n in degrees})
    if isinstance(geometry, EllipseArc | Quadric):
        return [], []
    if isinstance(geometry, BSplineCurve):
        return list(geometry.control_points.shape[:1]), [geometry.degree]
    return list(geometry.control_points.shape[:2]), [geometry.degree_u, geometry.degree_v]


def pieces_of(geometry: Geometry) -> tuple[Single, ...]:
    """The edges of a wire, the splines of a body, else the geometry itself."""
    if isinstance(geometry, Built):
        return geometry.splines
    return geometry.edges if isinstance(geometry, Wire) else (geometry,)


def _span(piece: Single) -> Array:
    """Points whose box holds the piece."""
    if isinstance(piece, Quadric):
        return extremes(piece)
    return _arc_extremes(piece) if isinstance(piece, EllipseArc) else piece.control_points


def _arc_extremes(arc: EllipseArc) -> Array:
    """The ends of the arc and its points that lie farthest out along the axes of space."""
    extreme = np.arctan2(arc.axis_b, arc.axis_a)
    turns = np.pi * np.arange(-4, 5)
    angles = (extreme[:, None] + turns + 2 * np.pi * np.floor(arc.start / (2 * np.pi))).reshape(-1)
    inside = angles[(angles > arc.start) & (angles < arc.end)]
    return arc.evaluate(np.concatenate([[arc.start, arc.end], inside]))


def _box(points: Sequence[Array]) -> dict[str, list[float]] | None:
    """The least box with sides along the axes of space, plane points lying at z = 0."""
    flat = [p.reshape(-1, p.shape[-1]) for p in points]
    spatial = [np.pad(p, ((0, 0), (0, 3 - p.shape[1]))) for p in flat]
    if not spatial:
        return None
    everything = np.concatenate(spatial)
    return {"least": everything.min(axis=0).tolist(), "most": everything.max(axis=0).tolist()}
