"""What the command line does, without a terminal: fit a model, write and read files, describe their content."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from itertools import takewhile
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gtcad._entries import ModelShape
from gtcad.composite import Composite
from gtcad.converters.bspline import BSplineCurve, BSplineSurface
from gtcad.converters.part import BodyFacts, Built, EllipseArc, Geometry, Part, Single, Wire
from gtcad.converters.properties import stated
from gtcad.converters.quadrics import Quadric, extremes
from gtcad.errors import InputError, ModelError, ToleranceBelowPrecision, ToleranceNotMet
from gtcad.model import Model
from gtcad.patches import PlaneFamily
from gtcad.protocol import SeparableCurve, SeparableSurface, Shape
from gtcad.quilt import Quilt
from gtcad.restricted import RestrictedCurve, RestrictedSurface
from gtcad.solid import Solid

if TYPE_CHECKING:
    from gtcad.converters.occt.exchange import Schema

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Fitted:
    """A shape of a model after fitting.

    Parameters
    ----------
    name
        Its name in the model.
    geometry
        What files hold of it, in mm; None when the tolerance cannot be met.
    deviation
        (lower, upper) in mm.
    exact
        Whether the geometry is the shape itself, up to rounding.
    proved
        Whether the upper bound is proved: always, but for the offset faces of walls, which are estimated.
    error
        Why there is no geometry; empty when there is one.
    """

    name: str
    geometry: Geometry | None
    deviation: tuple[float, float] = (0.0, math.inf)
    exact: bool = False
    proved: bool = True
    error: str = ""

    def as_data(self) -> dict[str, Any]:
        """Plain data, for tables and JSON."""
        if self.geometry is None:
            return {"name": self.name, "error": self.error}
        poles, degrees = sizes(self.geometry)
        return {
            "name": self.name,
            "poles": poles,
            "degree": degrees,
            "rational": any(getattr(edge, "weights", None) is not None for edge in _pieces(self.geometry)),
            "deviation": list(self.deviation),
            "exact": self.exact,
            "proved": self.proved,
            "entity": self.entity,
        }

    @property
    def entity(self) -> str:
        """What a file holds of it: "circle", "ellipse", "plane", "cylinder", "b_spline", "wire", "solid" and so on."""
        if isinstance(self.geometry, Built):
            return self.geometry.kind
        if isinstance(self.geometry, Wire):
            return "wire"
        if isinstance(self.geometry, EllipseArc):
            return "circle" if self.geometry.is_circle else "ellipse"
        if isinstance(self.geometry, Quadric):
            return "plane" if self.geometry.kind == "disc" else self.geometry.kind
        return "b_spline"


def fit_shapes(shapes: Mapping[str, ModelShape], settings: Mapping[str, Any]) -> Iterator[Fitted]:
    """Fit the shapes one by one, going on where the tolerance cannot be met.

    Parameters
    ----------
    shapes
        By name, in mm.
    settings
        The keyword arguments of `fit_curve`, `fit_chain` and `fit_surface`; of those, quilts and solids take what
        `fit_quilt` takes.
    """
    for name, shape in shapes.items():
        try:
            yield _fitted(name, shape, settings)
        except (ToleranceNotMet, ToleranceBelowPrecision) as error:
            yield Fitted(name, None, error=str(error))


def _fitted(name: str, shape: ModelShape, settings: Mapping[str, Any]) -> Fitted:
    from gtcad.converters.hosts import choose_geometry

    if isinstance(shape, Quilt | Solid):
        return _built(name, shape, settings)
    geometry, fit = choose_geometry(shape, **settings)
    return Fitted(name, geometry, fit.deviation, fit.exact)


def _built(name: str, shape: Quilt | Solid, settings: Mapping[str, Any]) -> Fitted:
    """The shell or the solid of a quilt, which the kernel makes at once: its faces share edges."""
    from gtcad.converters.hosts import fitted_quilt
    from gtcad.converters.occt.shells import make_shell
    from gtcad.converters.solid import solid_of, thicken

    quilt = shape.quilt if isinstance(shape, Solid) else shape
    fit = fitted_quilt(quilt, **settings)
    if not isinstance(shape, Solid):
        shell = make_shell(fit.splines, quilt.edges, quilt.flipped)
        return Fitted(name, Built("shell", shell.shape, quilt.names, fit.splines), fit.deviation)
    if shape.thickness is None:
        body = solid_of(fit, caps=shape.caps)
    else:
        body = thicken(fit, shape.thickness, tolerance=settings["tolerance"], caps=shape.caps)
    built = Built("solid", body.shape, tuple(body.faces), fit.splines)
    return Fitted(name, built, (fit.deviation[0], body.deviation), proved=body.proved)


def parts_of(
    fits: Sequence[Fitted], colors: Mapping[str, str], stating: Mapping[str, ModelShape] | None = None
) -> list[Part]:
    """The fitted shapes as parts of a file.

    Parameters
    ----------
    fits
        Those without geometry are left out.
    colors
        By name, "#rrggbb".
    stating
        The exact shapes by name, in mm, if the file is to state their areas, volumes and points.
    """
    exact = stating or {}
    return [
        Part(
            item.name,
            item.geometry,
            color=_rgb(colors.get(item.name)),
            properties=stated(exact[item.name]) if item.name in exact else None,
        )
        for item in fits
        if item.geometry is not None
    ]


def _rgb(color: str | None) -> tuple[float, float, float] | None:
    if color is None:
        return None
    red, green, blue = bytes.fromhex(color[1:])
    return red / 255, green / 255, blue / 255


def _hex(color: tuple[float, float, float] | None) -> str | None:
    return None if color is None else "#" + bytes(round(255 * value) for value in color).hex()


def write_parts(
    path: str, form: str, parts: Sequence[Part], *, tolerance: float, schema: Schema, timestamp: datetime | None
) -> None:
    """Write a file of the form STEP, IGES or BREP; the tolerance in mm goes into those that state one."""
    if form == "STEP":
        from gtcad.converters.step import write_step

        write_step(path, parts, schema=schema, tolerance=tolerance, timestamp=timestamp)
    elif form == "IGES":
        from gtcad.converters.iges import write_iges

        write_iges(path, parts, tolerance=tolerance, timestamp=timestamp)
    else:
        from gtcad.converters.brep import write_brep

        write_brep(path, parts)


def export_mesh(model: Model, path: str, output: str, tolerance: float) -> tuple[list[dict[str, Any]], list[str]]:
    """Write the triangles of the model's surfaces; plain data of each, and the names of the curves, left out.

    The tolerance, in mm, and the deviations include what the rounding of the file's numbers adds.

    Raises
    ------
    ModelError
        When the model has no surfaces, or one that has no area.
    """
    from gtcad.converters.mesh import file_rounding, mesh_surfaces, write_mesh

    shapes = model.in_millimetres()
    surfaces = {name: shape for name, shape in shapes.items() if isinstance(shape, SeparableSurface)}
    if not surfaces:
        raise ModelError(path, [f"a mesh needs surfaces, and there are only curves: {', '.join(map(repr, shapes))}"])
    rounding = max(file_rounding(output, surface) for surface in surfaces.values())
    if tolerance < 2 * rounding:
        raise ToleranceBelowPrecision(tolerance, 2 * rounding)
    try:
        meshes = mesh_surfaces(surfaces, tolerance=tolerance - rounding)
    except InputError as error:
        raise ModelError(path, [str(error)]) from error
    except ToleranceNotMet as error:
        raise ToleranceNotMet(tolerance, error.achieved + rounding, error.spans, error.limit) from error
    except ToleranceBelowPrecision as error:
        raise ToleranceBelowPrecision(tolerance, error.floor + rounding) from error
    write_mesh(output, meshes, colors=model.colors)
    rows = [
        {
            "name": name,
            "vertices": len(mesh.vertices),
            "triangles": len(mesh.triangles),
            "deviation": mesh.deviation + file_rounding(output, mesh),
        }
        for name, mesh in meshes.items()
    ]
    return rows, [name for name in shapes if name not in surfaces]


def read_parts(path: str, form: str) -> list[Part]:
    """The parts of a file of the form STEP, IGES or BREP."""
    if form == "STEP":
        from gtcad.converters.step import read_step

        return read_step(path)
    if form == "IGES":
        from gtcad.converters.iges import read_iges

        return read_iges(path)
    from gtcad.converters.brep import read_brep

    return read_brep(path)


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


def describe_parts(parts: Sequence[Part], form: str) -> dict[str, Any]:
    """Box of the control points in mm, and the curves and surfaces of an exchange file, as plain data."""
    points = [_span(piece) for part in parts for piece in _pieces(part.geometry)]
    return {
        "format": form,
        "unit": "mm",
        "box": _box(points),
        "box_of": "control points",
        "shapes": [_part_data(part) for part in parts],
        "bodies": _bodies_data(parts),
    }


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


def sizes(geometry: Geometry) -> tuple[list[int], list[int]]:
    """The numbers of poles and the degrees of the directions: none if analytic; of each piece of a wire or body."""
    if isinstance(geometry, Wire | Built):
        found = [sizes(piece) for piece in _pieces(geometry)]
        return [math.prod(poles) for poles, _ in found], sorted({n for _, degrees in found for n in degrees})
    if isinstance(geometry, EllipseArc | Quadric):
        return [], []
    if isinstance(geometry, BSplineCurve):
        return list(geometry.control_points.shape[:1]), [geometry.degree]
    return list(geometry.control_points.shape[:2]), [geometry.degree_u, geometry.degree_v]


def _pieces(geometry: Geometry) -> tuple[Single, ...]:
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
