"""The kinds of surfaces that a model file can hold."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from gtcad import _checks as checks
from gtcad._entries import (
    DesignVariables,
    FamilyName,
    Interval,
    OptionalFamily,
    Row,
    ShapeEntry,
    Shapes,
    basis_fields,
    gamma_fields,
)
from gtcad.basis import FAMILIES
from gtcad.protocol import SeparableSurface
from gtcad.restricted import Restricted, RestrictedSurface
from gtcad.surface import Surface


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

    def build(self, shapes: Shapes) -> SeparableSurface:
        """The surface, restricted to its range if it has one."""
        none = (0.0, 0.0)
        families = (FAMILIES[name or self.family] for name in (self.family_u, self.family_v))
        surface = Surface(self.control_points, self.gamma_u or none, self.gamma_v or none, *families)
        return surface if self.range is None else Restricted(surface, self.range)


def surface_data(surface: SeparableSurface) -> dict[str, Any] | None:
    """The fields of a surface, or None when a model file cannot hold it."""
    whole = surface.shape if isinstance(surface, RestrictedSurface) else surface
    if not isinstance(whole, Surface):
        return None
    fields = _basis_fields(whole)
    if isinstance(surface, RestrictedSurface):
        fields["range"] = [list(side) for side in surface.range]
    return fields | {"control_points": whole.control_points.tolist()}


def _basis_fields(surface: Surface) -> dict[str, Any]:
    family_u, family_v = surface.family_u, surface.family_v
    if family_u == family_v:
        families = basis_fields("family", family_u)
    else:
        families = basis_fields("family_u", family_u) | basis_fields("family_v", family_v)
    return (
        families
        | gamma_fields("gamma_u", surface.gamma_u, family_u)
        | gamma_fields("gamma_v", surface.gamma_v, family_v)
    )
