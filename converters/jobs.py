"""What the command line does, without a terminal: fit a model, write and read files."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING, Any

from gtcad._entries import ModelShape
from gtcad.converters.descriptions import pieces_of, sizes
from gtcad.converters.part import Built, EllipseArc, Geometry, Part, Wire
from gtcad.converters.properties import stated
from gtcad.converters.quadrics import Quadric
from gtcad.errors import InputError, ModelError, ToleranceBelowPrecision, ToleranceNotMet
from gtcad.model import Model
from gtcad.protocol import SeparableSurface
from gtcad.quilt import Quilt
from gtcad.solid import Solid

if TYPE_CHECKING:
    from gtcad.converters.occt.exchange import Schema


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
            "rational": any(getattr(edge, "weights", None) is not None for edge in pieces_of(self.geometry)),
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
    """Write the triangles of the model's surfaces and quilts; data of each patch, and the names of curves, left out.

    The tolerance, in mm, and the deviations include what the rounding of the file's numbers adds.

    Raises
    ------
    ModelError
        When the model has no surfaces, one that has no area, or a solid with faces that are no patches.
    """
    from gtcad.converters.mesh import file_rounding, mesh_surfaces, write_mesh

    shapes = model.in_millimetres()
    patches = {name: _patches(path, name, shape) for name, shape in shapes.items()}
    surfaces = {label: patch for own in patches.values() for label, patch in own.items()}
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
    colors = {label: model.colors[name] for name, own in patches.items() if name in model.colors for label in own}
    write_mesh(output, meshes, colors=colors)
    rows = [
        {
            "name": name,
            "vertices": len(mesh.vertices),
            "triangles": len(mesh.triangles),
            "deviation": mesh.deviation + file_rounding(output, mesh),
        }
        for name, mesh in meshes.items()
    ]
    return rows, [name for name, own in patches.items() if not own]


def _patches(path: str, name: str, shape: ModelShape) -> dict[str, SeparableSurface]:
    """The surfaces that a shape consists of, by the names of their faces in files; none of a curve."""
    if isinstance(shape, Solid):
        if shape.caps != "none" or shape.thickness is not None:
            wanted = "triangles are made of patches alone: leave out its caps and its thickness, or write a .step file"
            raise ModelError(path, [f"shape {name!r}: {wanted}"])
        shape = shape.quilt
    if isinstance(shape, Quilt):
        return {f"{name}.{own}": patch for own, patch in zip(shape.names, shape.patches, strict=True)}
    return {name: shape} if isinstance(shape, SeparableSurface) else {}


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
