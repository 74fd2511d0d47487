"""The kinds of developable patches that a model file can hold."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Discriminator, Field, Tag, ValidationInfo

from gtcad import _checks as checks
from gtcad import patches
from gtcad._curve_kinds import CurveField, CurveFields, CurveName, curve_data
from gtcad._documents import Location, shown
from gtcad._entries import (
    INLINE,
    TAG,
    DesignVariables,
    FamilyName,
    Interval,
    Shapes,
    Strict,
    basis_fields,
    gamma_fields,
    inline_or_named,
)
from gtcad._patch_kinds import PatchEntry, Placement, curve_of, placement_fields
from gtcad.basis import FAMILIES, MAX_DEGREE
from gtcad.patches import PlaneFamily
from gtcad.protocol import SeparableCurve, SeparableSurface

_PLANE, _PLANES = f"{TAG}plane", f"{TAG}planes"


def _plane(value: Any, info: ValidationInfo) -> Any:
    """Refuse what is not four numbers with a normal."""
    if not isinstance(value, list) or len(value) != 4:
        got = f"{len(value)} numbers" if isinstance(value, list) else shown(value)
        checks.refuse([((), f"must be a plane [a, b, c, d], a x + b y + c z = d, got {got}")])
    checks.numbers(value, info)
    if not any(value[:3]):
        checks.refuse([((), "must have a normal: a, b and c are all 0")])
    return value


def _planes(value: Any, info: ValidationInfo) -> Any:
    """Refuse what is not a list of as many planes as some degree of the family needs."""
    if not isinstance(value, list):
        checks.refuse([((), f"must be a list of planes [a, b, c, d], got {shown(value)}")])
    family = checks.family_of(info.data, "family")
    least = 1 if family is None else FAMILIES[family].minimum_degree
    if not least + 1 <= len(value) <= MAX_DEGREE + 1:
        wanted = f"{least + 1} to {MAX_DEGREE + 1} planes (degree {least} to {MAX_DEGREE})"
        checks.refuse([((), f"must hold {wanted}, got {len(value)}")])
    return value


def _distances(value: Any, info: ValidationInfo) -> Any:
    """Refuse what is not two different numbers."""
    if not isinstance(value, list) or len(value) != 2:
        checks.refuse([((), f"must be two distances along the rulings, got {shown(value)}")])
    checks.numbers(value, info)
    if value[0] == value[1]:
        checks.refuse([((), f"must be two different distances, got {shown(value[0])} twice")])
    return tuple(value)


def _pairing(value: Any, info: ValidationInfo) -> Any:
    """Refuse what is neither "least-twist" nor numbers that rise from 0 to 1."""
    if value == "least-twist":
        return value
    if not isinstance(value, list):
        checks.refuse([((), f"must be least-twist or a list of numbers that rise from 0 to 1, got {shown(value)}")])
    checks.numbers(value, info)
    rises = all(a < b for a, b in pairwise(value))
    if not 2 <= len(value) <= MAX_DEGREE + 1 or (value[0], value[-1]) != (0, 1) or not rises:
        checks.refuse([((), f"must be 2 to {MAX_DEGREE + 1} numbers that rise from 0 to 1")])
    return value


def _bound(value: Any, info: ValidationInfo) -> Any:
    """Refuse what is neither a plane nor a curve."""
    if not isinstance(value, list | dict | str):
        checks.refuse([((), f"must be a plane [a, b, c, d], a curve or the name of one, got {shown(value)}")])
    return value


def _kind_of_bound(value: Any) -> str:
    return _PLANE if isinstance(value, list) else inline_or_named(value)


def _kind_of_spine(value: Any) -> str:
    planes = isinstance(value, PlaneFields) or (isinstance(value, dict) and "control_planes" in value)
    return _PLANES if planes else inline_or_named(value)


PlaneField = Annotated[list[float], Field(min_length=4, max_length=4), BeforeValidator(_plane)]
BoundField = Annotated[
    Annotated[PlaneField, Tag(_PLANE)] | Annotated[CurveFields, Tag(INLINE)] | CurveName,
    Discriminator(_kind_of_bound),
    BeforeValidator(_bound),
]
Degrees = Annotated[float, Field(ge=0)]
Distances = Annotated[
    tuple[float, float],
    BeforeValidator(_distances),
    Field(description="Where along the rulings the patch begins and ends, in the file's unit."),
]


class PlaneFields(Strict):
    """A family of planes."""

    family: FamilyName = Field(default="GT", description="The basis: generalized trigonometric, or classical Bezier.")
    gamma: Annotated[DesignVariables, BeforeValidator(checks.optional(checks.gamma("family")))] = Field(
        default=None, description="Design variables gamma_1, gamma_2; (0, 0) when left out; none for bernstein."
    )
    control_planes: Annotated[list[PlaneField], BeforeValidator(_planes)] = Field(
        description="The degree + 1 planes [a, b, c, d], a x + b y + c z = d; d in the file's unit.",
        min_length=2,
        max_length=61,
    )

    def planes(self) -> PlaneFamily:
        """The family."""
        return PlaneFamily(self.control_planes, self.gamma or (0.0, 0.0), FAMILIES[self.family])


SpineField = Annotated[
    Annotated[PlaneFields, Tag(_PLANES)] | Annotated[CurveFields, Tag(INLINE)] | CurveName,
    Discriminator(_kind_of_spine),
]


class EnvelopingEntry(PatchEntry, PlaneFields):
    """The developable patch that a family of planes envelops, between two bounds."""

    kind: Literal["enveloping"]
    bound_a: BoundField = Field(
        description="What ends the rulings at v = 0: a plane, or a curve that they end next to, at equal parameters."
    )
    bound_b: BoundField = Field(description="What ends the rulings at v = 1.")
    part: Annotated[Interval, BeforeValidator(checks.interval)] = Field(
        default=(0.0, 1.0), description="The part of the planes' parameters that is meant."
    )
    placement: Placement

    def references(self) -> Iterator[tuple[Location, str]]:
        """The named bounds."""
        for field in ("bound_a", "bound_b"):
            if isinstance(name := getattr(self, field), str):
                yield (field,), name

    def build(self, shapes: Shapes) -> SeparableSurface:
        """The patch."""
        a, b = (
            bound if isinstance(bound, list) else curve_of(shapes, field, bound)
            for field, bound in (("bound_a", self.bound_a), ("bound_b", self.bound_b))
        )
        return patches.Enveloping(self.planes(), a, b, self.part, self.placement)


class SpineDevelopableEntry(PatchEntry):
    """The tangent surface of a curve, or of the edge of regression of a family of planes."""

    kind: Literal["spine-developable"]
    spine: SpineField = Field(description="A curve in space, or control_planes (with gamma and family) of planes.")
    distances: Distances
    placement: Placement

    def build(self, shapes: Shapes) -> SeparableSurface:
        """The patch."""
        spine = self.spine.planes() if isinstance(self.spine, PlaneFields) else self.found(shapes, "spine")
        return patches.SpineDevelopable(spine, self.distances, self.placement)


class GeodesicDevelopableEntry(PatchEntry):
    """The developable patch that has a given curve as a geodesic."""

    kind: Literal["geodesic-developable"]
    curve: CurveField = Field(description="The curve in space: a straight line of the flat pattern.")
    distances: Distances
    placement: Placement

    def build(self, shapes: Shapes) -> SeparableSurface:
        """The patch."""
        return patches.GeodesicDevelopable(self.found(shapes, "curve"), self.distances, self.placement)


class QuasiDevelopableEntry(PatchEntry):
    """The strip of straight lines between two given curves."""

    kind: Literal["quasi-developable"]
    a: CurveField = Field(description="The boundary at v = 0.")
    b: CurveField = Field(description="The boundary at v = 1.")
    pairing: Annotated[list[float] | Literal["least-twist"], BeforeValidator(_pairing)] = Field(
        default=[0.0, 1.0],
        description="Bernstein coefficients, rising from 0 to 1, of the parameter of b that each of a is joined to; or "
        "least-twist, for a pairing that makes the twist small.",
    )
    max_twist: Annotated[Degrees | None, BeforeValidator(checks.optional(checks.not_negative))] = Field(
        default=None, description="Degrees that the normal may turn along a ruling; any twist when left out."
    )

    def build(self, shapes: Shapes) -> SeparableSurface:
        """The patch."""
        curves = self.found(shapes, "a"), self.found(shapes, "b")
        return patches.quasi_developable(*curves, pairing=self.pairing, max_twist_deg=self.max_twist)


DEVELOPABLE_ENTRIES: dict[str, type[PatchEntry]] = {
    "enveloping": EnvelopingEntry,
    "spine-developable": SpineDevelopableEntry,
    "geodesic-developable": GeodesicDevelopableEntry,
    "quasi-developable": QuasiDevelopableEntry,
}


def developable_data(patch: SeparableSurface) -> tuple[str, dict[str, Any] | None] | None:
    """The kind and the fields of a developable patch; no fields when a model file cannot hold its curves."""
    match patch:
        case patches.Enveloping():
            bounds = {"bound_a": _bound_data(patch.bound_a), "bound_b": _bound_data(patch.bound_b)}
            fields = _family_data(patch.family) | bounds | {"part": list(patch.part)}
            kind = "enveloping"
        case patches.SpineDevelopable():
            planes = isinstance(patch.spine, PlaneFamily)
            spine = _family_data(patch.spine) if planes else curve_data(patch.spine)  # type: ignore[arg-type]
            kind, fields = "spine-developable", {"spine": spine, "distances": list(patch.distances)}
        case patches.GeodesicDevelopable():
            fields = {"curve": curve_data(patch.curve), "distances": list(patch.distances)}
            kind = "geodesic-developable"
        case patches.QuasiDevelopable():
            limit = {} if patch.max_twist_deg is None else {"max_twist": patch.max_twist_deg}
            fields = {"a": curve_data(patch.a), "b": curve_data(patch.b), "pairing": list(patch.pairing)} | limit
            kind = "quasi-developable"
        case _:
            return None
    fields |= placement_fields(getattr(patch, "placement", None))
    return kind, None if None in fields.values() else fields


def _family_data(family: PlaneFamily) -> dict[str, Any]:
    planes = {"control_planes": family.control_planes.tolist()}
    return basis_fields("family", family.family) | gamma_fields("gamma", family.gamma, family.family) | planes


def _bound_data(bound: tuple[float, ...] | SeparableCurve) -> Any:
    return curve_data(bound) if isinstance(bound, SeparableCurve) else list(bound)
