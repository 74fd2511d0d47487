"""The kinds of shape that a model file can hold: how each is written, checked, and made into a shape.

A new kind is a subclass of `ShapeEntry` with a `kind` of its own, listed in `Entry` and `ENTRIES`, and a branch in
`entry_of`.
"""

from __future__ import annotations

import abc
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from gtcad import _checks as checks
from gtcad.basis import FAMILIES, Family
from gtcad.curve import Curve
from gtcad.errors import InputError
from gtcad.protocol import Shape
from gtcad.restricted import Restricted, RestrictedCurve, RestrictedSurface
from gtcad.surface import Surface

VERSION = 1
MILLIMETRES = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4, "ft": 304.8}

FamilyName = Annotated[Literal["GT", "bernstein"], BeforeValidator(checks.one_of(*FAMILIES))]
OptionalFamily = Annotated[
    Literal["GT", "bernstein"] | None, BeforeValidator(checks.optional(checks.one_of(*FAMILIES)))
]
Color = Annotated[str, Field(pattern="^#[0-9a-fA-F]{6}$")]
DesignVariable = Annotated[float, Field(ge=-1, le=1)]
DesignVariables = tuple[DesignVariable, DesignVariable] | None
Parameter = Annotated[float, Field(ge=0, le=1)]
Interval = tuple[Parameter, Parameter]
CurvePoint = Annotated[list[float], Field(min_length=2, max_length=3)]
SurfacePoint = Annotated[list[float], Field(min_length=3, max_length=3)]
Row = Annotated[list[SurfacePoint], Field(min_length=2, max_length=61)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class ShapeEntry(_Strict, abc.ABC):
    """What every kind of shape has."""

    name: Annotated[str, BeforeValidator(checks.name)] = Field(
        description="What the shape is called, here and in exchange files: unique in the file, printable.",
        min_length=1,
        max_length=checks.MAX_NAME,
    )
    color: Annotated[Color | None, BeforeValidator(checks.optional(checks.color))] = Field(
        default=None, description="Red, green and blue (sRGB), as #rrggbb.", examples=["#1f77b4"]
    )

    @abc.abstractmethod
    def build(self) -> Shape:
        """The shape, in the model's unit."""


class CurveEntry(ShapeEntry):
    """A GT-Bezier or Bezier curve, or a part of one."""

    kind: Literal["curve"]
    family: FamilyName = Field(default="GT", description="The basis: generalized trigonometric, or classical Bezier.")
    gamma: Annotated[DesignVariables, BeforeValidator(checks.optional(checks.gamma("family")))] = Field(
        default=None, description="Design variables gamma_1, gamma_2; (0, 0) when left out; none for bernstein."
    )
    range: Annotated[Interval | None, BeforeValidator(checks.optional(checks.interval))] = Field(
        default=None,
        description="The part of the parameter interval [0, 1] that is meant; from a to b, also backwards.",
    )
    control_points: Annotated[list[CurvePoint], BeforeValidator(checks.curve_points)] = Field(
        description="The degree + 1 points [x, y] or [x, y, z] in the file's unit; degree 2 to 60, bernstein from 1.",
        min_length=2,
        max_length=61,
    )

    def build(self) -> Shape:
        """The curve, restricted to its range if it has one."""
        curve = Curve(self.control_points, self.gamma or (0.0, 0.0), FAMILIES[self.family])
        return curve if self.range is None else Restricted(curve, self.range)


class SurfaceEntry(ShapeEntry):
    """A GT-Bezier or Bezier tensor-product surface, or a part of one."""

    kind: Literal["surface"]
    family: FamilyName = Field(default="GT", description="The basis of both directions.")
    family_u: OptionalFamily = Field(default=None, description="The basis of the u direction, where it is another one.")
    family_v: OptionalFamily = Field(default=None, description="The basis of the v direction, where it is another one.")
    gamma_u: Annotated[DesignVariables, BeforeValidator(checks.optional(checks.gamma("family_u", "family")))] = Field(
        default=None, description="Design variables of u; (0, 0) when left out; none for bernstein."
    )
    gamma_v: Annotated[DesignVariables, BeforeValidator(checks.optional(checks.gamma("family_v", "family")))] = Field(
        default=None, description="Design variables of v; (0, 0) when left out; none for bernstein."
    )
    range: Annotated[tuple[Interval, Interval] | None, BeforeValidator(checks.optional(checks.rectangle))] = Field(
        default=None, description="The part of the domain that is meant: the range of u, then that of v, in [0, 1]."
    )
    control_points: Annotated[list[Row], BeforeValidator(checks.net)] = Field(
        description="Rows of points [x, y, z] in the file's unit, equally long; u runs from row to row, v along a row.",
        min_length=2,
        max_length=61,
    )

    def build(self) -> Shape:
        """The surface, restricted to its range if it has one."""
        none = (0.0, 0.0)
        families = (FAMILIES[name or self.family] for name in (self.family_u, self.family_v))
        surface = Surface(self.control_points, self.gamma_u or none, self.gamma_v or none, *families)
        return surface if self.range is None else Restricted(surface, self.range)


Entry = Annotated[CurveEntry | SurfaceEntry, Field(discriminator="kind")]
ENTRIES: dict[str, type[ShapeEntry]] = {"curve": CurveEntry, "surface": SurfaceEntry}


class ModelFile(_Strict):
    """A model of gtcad: curves and surfaces by name, all lengths in one unit."""

    gtcad: Annotated[Literal[1], BeforeValidator(checks.one_of(VERSION))] = Field(
        description="The version of this format."
    )
    unit: Annotated[Literal["mm", "cm", "m", "in", "ft"], BeforeValidator(checks.one_of(*MILLIMETRES))] = Field(
        default="mm", description="The unit of all coordinates: 1, 10, 1000, 25.4 or 304.8 mm."
    )
    shape: list[Entry] = Field(description="The shapes, in the order in which they are exported.", min_length=1)


def entry_of(name: str, shape: Shape, color: str | None) -> dict[str, Any]:
    """A shape as the plain data of its entry in a model file.

    Raises
    ------
    InputError
        When no kind of a model file can hold such a shape.
    """
    whole = shape.shape if isinstance(shape, RestrictedCurve | RestrictedSurface) else shape
    if isinstance(whole, Curve):
        kind, fields = "curve", _curve_fields(whole)
    elif isinstance(whole, Surface):
        kind, fields = "surface", _surface_fields(whole)
    else:
        raise InputError(f"shape {name!r}: a model file cannot hold {type(shape).__name__} of {type(whole).__name__}")
    data: dict[str, Any] = {"name": name, "kind": kind}
    if color is not None:
        data["color"] = color
    data |= fields
    if isinstance(shape, RestrictedCurve):
        data["range"] = list(shape.range)
    elif isinstance(shape, RestrictedSurface):
        data["range"] = [list(side) for side in shape.range]
    return data | {"control_points": whole.control_points.tolist()}


def _curve_fields(curve: Curve) -> dict[str, Any]:
    return _basis_fields("family", curve.family) | _gamma_fields("gamma", curve.gamma, curve.family)


def _surface_fields(surface: Surface) -> dict[str, Any]:
    family_u, family_v = surface.family_u, surface.family_v
    if family_u == family_v:
        families = _basis_fields("family", family_u)
    else:
        families = _basis_fields("family_u", family_u) | _basis_fields("family_v", family_v)
    gammas = _gamma_fields("gamma_u", surface.gamma_u, family_u) | _gamma_fields("gamma_v", surface.gamma_v, family_v)
    return families | gammas


def _basis_fields(field: str, family: Family) -> dict[str, Any]:
    return {} if family.name == "GT" else {field: family.name}


def _gamma_fields(field: str, gamma: tuple[float, float], family: Family) -> dict[str, Any]:
    return {field: list(gamma)} if family.takes_gamma else {}
