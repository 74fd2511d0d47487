"""What all kinds of entries of a model file have in common."""

from __future__ import annotations

import abc
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from gtcad import _checks as checks
from gtcad._documents import Location
from gtcad.basis import FAMILIES, Family
from gtcad.composite import Composite
from gtcad.protocol import Shape
from gtcad.quilt import Quilt
from gtcad.solid import Solid

ModelShape = Shape | Composite | Quilt | Solid
Shapes = Mapping[str, ModelShape]

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
PointField = Annotated[CurvePoint, BeforeValidator(checks.point(2, 3))]
Yes = Annotated[bool, BeforeValidator(checks.yes_or_no)]

TAG = "\0tag "
INLINE, NAMED = f"{TAG}inline ", f"{TAG}named"
"""Tags of what is spelled out, and of what is the name of another shape; no field begins like them."""


class Strict(BaseModel):
    """A mapping of just these fields, of just these types."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class ShapeEntry(Strict, abc.ABC):
    """What every kind of shape has."""

    name: Annotated[str, BeforeValidator(checks.name)] = Field(
        description="What the shape is called, here and in exchange files: unique in the file, printable.",
        min_length=1,
        max_length=checks.MAX_NAME,
    )
    color: Annotated[Color | None, BeforeValidator(checks.optional(checks.color))] = Field(
        default=None, description="Red, green and blue (sRGB), as #rrggbb.", examples=["#1f77b4"]
    )
    construction: Yes = Field(
        default=False, description="Whether the shape only serves others: it is neither exported nor checked then."
    )

    @abc.abstractmethod
    def build(self, shapes: Shapes) -> ModelShape:
        """The shape, in the model's unit, given those that it refers to."""

    def references(self) -> Iterator[tuple[Location, str]]:
        """The names of other shapes that this one is made of, and where they stand."""
        yield from ()


def inline_or_named(value: Any) -> str:
    """Whether a field spells a shape out or names one: the discriminator of such fields."""
    return NAMED if isinstance(value, str) else INLINE


def basis_fields(field: str, family: Family) -> dict[str, Any]:
    """The field of a family, left out where it is GT."""
    return {} if family.name == "GT" else {field: family.name}


def gamma_fields(field: str, gamma: tuple[float, float], family: Family) -> dict[str, Any]:
    """The field of a pair of design variables, left out where the family has none."""
    return {field: list(gamma)} if family.takes_gamma else {}
