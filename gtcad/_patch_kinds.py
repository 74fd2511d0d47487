"""The kinds of patches made of curves that a model file can hold."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, ValidationInfo

from gtcad import _checks as checks
from gtcad import patches
from gtcad._curve_kinds import CurveField, CurveFields, curve_data
from gtcad._documents import Location, shown
from gtcad._entries import (
    DesignVariables,
    FamilyName,
    Interval,
    ModelShape,
    ShapeEntry,
    Shapes,
    SurfacePoint,
    Yes,
    basis_fields,
    gamma_fields,
)
from gtcad.basis import FAMILIES
from gtcad.composite import Composite
from gtcad.errors import InputError
from gtcad.protocol import SeparableCurve, SeparableSurface
from gtcad.quilt import Quilt
from gtcad.solid import Solid

Vector = Annotated[SurfacePoint, BeforeValidator(checks.point(3))]
Number = Annotated[float, BeforeValidator(checks.number)]


def _turn(value: Any, info: ValidationInfo) -> Any:
    """Refuse what is not a number of degrees from -360 to 360 other than 0."""
    checks.number(value, info)
    if not 0 < abs(value) <= _FULL_TURN:
        checks.refuse([((), f"must lie in [-360, 360] and not be 0, got {shown(value)}")])
    return value


def list_of(things: str) -> checks.Check:
    """A check that the value is a list, whatever it holds."""

    def check(value: Any, info: ValidationInfo) -> Any:
        if not isinstance(value, list):
            checks.refuse([((), f"must be a list of {things}, got {shown(value)}")])
        return value

    return check


Placement = Annotated[
    Annotated[list[Annotated[list[float], Field(min_length=4, max_length=4)]], Field(min_length=3, max_length=3)]
    | None,
    BeforeValidator(checks.optional(checks.placement)),
    Field(
        default=None,
        description="Three rows [a, b, c, d] of an affine map that moves the patch: x' = a x + b y + c z + d, ...",
    ),
]

_FULL_TURN = 360.0
_CURVES = ("a", "b", "curve", "profile", "trajectory", "spine", "c0", "c1", "d0", "d1")


class PatchEntry(ShapeEntry):
    """A patch made of curves, which are spelled out or named."""

    def references(self) -> Iterator[tuple[Location, str]]:
        """The named curves."""
        for field in (*_CURVES, "sections"):
            value = getattr(self, field, None)
            if isinstance(value, str):
                yield (field,), value
            elif isinstance(value, list):
                yield from (((field, k), entry) for k, entry in enumerate(value) if isinstance(entry, str))

    def found(self, shapes: Shapes, field: str) -> SeparableCurve:
        """The curve of a field."""
        return curve_of(shapes, field, getattr(self, field))


def curve_of(shapes: Shapes, where: str, curve: CurveFields | str) -> SeparableCurve:
    """The curve that a field spells out or names."""
    found = shapes[curve] if isinstance(curve, str) else curve.curve()
    if not isinstance(found, SeparableCurve):
        raise InputError(f"{where} must be a single curve, {shown(curve)} is {what(found)}")
    return found


def what(shape: ModelShape) -> str:
    """What a shape is that is not of the kind that is wanted."""
    kinds = {Composite: "a chain", Quilt: "a quilt", Solid: "a solid"}
    curve = "a curve" if isinstance(shape, SeparableCurve) else "a surface"
    return next((text for kind, text in kinds.items() if isinstance(shape, kind)), curve)


class RuledEntry(PatchEntry):
    """The patch of straight lines between points of two curves at equal parameters."""

    kind: Literal["ruled"]
    a: CurveField = Field(description="The boundary at v = 0.")
    b: CurveField = Field(description="The boundary at v = 1.")

    def build(self, shapes: Shapes) -> SeparableSurface:
        """The patch."""
        return patches.Ruled(self.found(shapes, "a"), self.found(shapes, "b"))


class CylinderEntry(PatchEntry):
    """The general cylinder over a curve: straight lines along one vector."""

    kind: Literal["cylinder"]
    curve: CurveField = Field(description="The directrix, the boundary at v = 0.")
    vector: Vector = Field(description="From v = 0 to v = 1, in the file's unit.")

    def build(self, shapes: Shapes) -> SeparableSurface:
        """The patch."""
        return patches.cylinder(self.found(shapes, "curve"), self.vector)


class ConeEntry(PatchEntry):
    """The general cone over a curve: straight lines towards an apex."""

    kind: Literal["cone"]
    curve: CurveField = Field(description="The directrix.")
    apex: Vector = Field(description="The point where all lines meet.")
    part: Annotated[Interval, BeforeValidator(checks.interval)] = Field(
        default=(0.0, 1.0), description="The part of the way from the directrix (0) to the apex (1) that is meant."
    )

    def build(self, shapes: Shapes) -> SeparableSurface:
        """The patch."""
        return patches.cone(self.found(shapes, "curve"), self.apex, self.part)


class SweptEntry(PatchEntry):
    """A profile moved along a trajectory without turning: C(u) + T(v)."""

    kind: Literal["swept"]
    profile: CurveField = Field(description="C.")
    trajectory: CurveField = Field(description="T, counted from the origin.")

    def build(self, shapes: Shapes) -> SeparableSurface:
        """The patch."""
        return patches.Swept(self.found(shapes, "profile"), self.found(shapes, "trajectory"))


class SwungEntry(PatchEntry):
    """A profile (x, z) swung along a trajectory (X, Y): (a x X, a x Y, z)."""

    kind: Literal["swung"]
    profile: CurveField = Field(description="(x, z), or a curve in space with y = 0.")
    trajectory: CurveField = Field(description="(X, Y), or a curve in space with z = 0.")
    factor: Number = Field(default=1.0, description="a, not 0.")
    placement: Placement

    def build(self, shapes: Shapes) -> SeparableSurface:
        """The patch."""
        curves = self.found(shapes, "profile"), self.found(shapes, "trajectory")
        return patches.Swung(*curves, self.factor, self.placement)  # type: ignore[arg-type]


class RotationEntry(PatchEntry):
    """The surface of rotation of a profile about an axis, through any angle."""

    kind: Literal["rotation"]
    profile: CurveField = Field(description="The curve that turns.")
    axis_point: Vector = Field(default=[0.0, 0.0, 0.0], description="A point of the axis.")
    axis_direction: Vector = Field(default=[0.0, 0.0, 1.0], description="Its direction.")
    angle: Annotated[float, Field(ge=-_FULL_TURN, le=_FULL_TURN), BeforeValidator(_turn)] = Field(
        default=_FULL_TURN, description="In degrees, from -360 to 360, not 0."
    )
    start: Number = Field(default=0.0, description="The angle in degrees at v = 0.")
    placement: Placement

    def build(self, shapes: Shapes) -> SeparableSurface:
        """The patch."""
        turn = self.axis_point, self.axis_direction, self.angle, self.start
        return patches.Rotation(self.found(shapes, "profile"), *turn, self.placement)


class SweepEntry(PatchEntry):
    """A profile swept along a spine with a moving frame."""

    kind: Literal["sweep"]
    profile: CurveField = Field(description="(x, y) in the normal plane, or (x, y, z) with z along the spine.")
    spine: CurveField = Field(description="The curve in space that the profile's origin runs along.")
    frame: Annotated[
        Literal["rotation-minimising", "frenet", "fixed"],
        BeforeValidator(checks.one_of("rotation-minimising", "frenet", "fixed")),
    ] = Field(default="rotation-minimising", description="How the profile turns with the spine.")
    start_normal: Annotated[SurfacePoint | None, BeforeValidator(checks.optional(checks.point(3)))] = Field(
        default=None, description="Where x points at the start; chosen when left out. Not for the Frenet frame."
    )
    scale: Annotated[list[float], BeforeValidator(checks.numbers)] = Field(
        default=[1.0],
        description="Bernstein coefficients of the profile's scale: [1, 0.5] shrinks it evenly by half.",
        min_length=1,
        max_length=61,
    )
    twist: Number = Field(default=0.0, description="Degrees that the profile turns besides, evenly.")
    closed: Yes = Field(default=False, description="Whether to twist so that the frame of a closed spine closes.")
    placement: Placement

    def build(self, shapes: Shapes) -> SeparableSurface:
        """The patch."""
        return patches.Sweep(
            self.found(shapes, "profile"),
            self.found(shapes, "spine"),
            frame=self.frame,
            start_normal=self.start_normal,
            scale=self.scale,
            twist_deg=self.twist,
            closed=self.closed,
            placement=self.placement,
        )


class LoftedEntry(PatchEntry):
    """The patch through sections of one kind."""

    kind: Literal["lofted"]
    sections: Annotated[list[CurveField], BeforeValidator(list_of("sections"))] = Field(
        description="Curves of equal degree, design variables and family; three at least for GT.", min_length=2
    )
    parameters: Annotated[list[float] | None, BeforeValidator(checks.optional(checks.numbers))] = Field(
        default=None, description="The v of each section, increasing in [0, 1]; equally spaced when left out."
    )
    family_v: FamilyName = Field(default="GT", description="The basis in v.")
    gamma_v: Annotated[DesignVariables, BeforeValidator(checks.optional(checks.gamma("family_v")))] = Field(
        default=None, description="Design variables of v; (0, 0) when left out; none for bernstein."
    )

    def build(self, shapes: Shapes) -> SeparableSurface:
        """The patch."""
        sections = [curve_of(shapes, f"sections[{k}]", section) for k, section in enumerate(self.sections)]
        return patches.Lofted(sections, self.parameters, self.gamma_v or (0.0, 0.0), FAMILIES[self.family_v])


class CoonsEntry(PatchEntry):
    """The Boolean sum of four boundary curves."""

    kind: Literal["coons"]
    c0: CurveField = Field(description="The boundary at v = 0, along u.")
    c1: CurveField = Field(description="The boundary at v = 1, along u.")
    d0: CurveField = Field(description="The boundary at u = 0, along v.")
    d1: CurveField = Field(description="The boundary at u = 1, along v.")

    def build(self, shapes: Shapes) -> SeparableSurface:
        """The patch."""
        return patches.Coons(*(self.found(shapes, field) for field in ("c0", "c1", "d0", "d1")))


PATCH_ENTRIES: dict[str, type[PatchEntry]] = {
    "ruled": RuledEntry,
    "cylinder": CylinderEntry,
    "cone": ConeEntry,
    "swept": SweptEntry,
    "swung": SwungEntry,
    "rotation": RotationEntry,
    "sweep": SweepEntry,
    "lofted": LoftedEntry,
    "coons": CoonsEntry,
}


def patch_data(patch: SeparableSurface) -> tuple[str, dict[str, Any]] | None:
    """The kind and the fields of a patch, or None when a model file cannot hold it."""
    kind, fields = type(patch).__name__.lower(), dict[str, Any]()
    match patch:
        case patches.Swung():
            fields = {"factor": patch.factor} | placement_fields(patch.placement)
        case patches.Rotation():
            axis = {"axis_point": list(patch.axis_point), "axis_direction": list(patch.axis_direction)}
            fields = axis | {"angle": patch.angle_deg, "start": patch.start_deg} | placement_fields(patch.placement)
        case patches.Sweep():
            fields = {"frame": patch.frame, "scale": list(patch.scale), "twist": patch.twist_deg}
            if patch.start_normal is not None:
                fields["start_normal"] = list(patch.start_normal)
            fields |= ({"closed": True} if patch.closed else {}) | placement_fields(patch.placement)
        case patches.Lofted():
            fields = {"parameters": list(patch.parameters)} | basis_fields("family_v", patch.family_v)
            fields |= gamma_fields("gamma_v", patch.gamma_v, patch.family_v)
        case patches.Ruled() | patches.Swept() | patches.Coons():
            pass
        case _:
            return None
    for field in _CURVES:
        if hasattr(patch, field):
            fields[field] = curve_data(getattr(patch, field))
    if isinstance(patch, patches.Lofted):
        fields["sections"] = [curve_data(section) for section in patch.sections]
    held = None not in fields.values() and None not in fields.get("sections", [])
    return (kind, fields) if held else None


def placement_fields(placement: Sequence[Sequence[float]] | None) -> dict[str, Any]:
    """The field of a placement, left out where there is none."""
    return {} if placement is None else {"placement": [list(row) for row in placement]}
