"""The entries of a model file: one class for each kind of shape.

A new kind is a subclass of `ShapeEntry` with a `kind` of its own, listed in `Entry` and `ENTRIES`, and a branch in
`entry_of`.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from gtcad import _checks as checks
from gtcad._curve_kinds import (
    ArcEntry,
    CircleEntry,
    CompositeEntry,
    CurveEntry,
    EllipseEntry,
    ParabolaEntry,
    chain_data,
    curve_data,
)
from gtcad._developable_kinds import (
    DEVELOPABLE_ENTRIES,
    EnvelopingEntry,
    GeodesicDevelopableEntry,
    QuasiDevelopableEntry,
    SpineDevelopableEntry,
    developable_data,
)
from gtcad._entries import ModelShape, ShapeEntry, Strict
from gtcad._markings import MarkingFields
from gtcad._minimal_kinds import MINIMAL_ENTRIES, PlateauEntry, TBCoonsEntry, minimal_data
from gtcad._patch_kinds import (
    PATCH_ENTRIES,
    ConeEntry,
    CoonsEntry,
    CylinderEntry,
    LoftedEntry,
    RotationEntry,
    RuledEntry,
    SweepEntry,
    SweptEntry,
    SwungEntry,
    patch_data,
)
from gtcad._quilt_kinds import QuiltEntry, SolidEntry, quilt_data, solid_data
from gtcad._surface_kinds import SurfaceEntry, surface_data
from gtcad.composite import Composite
from gtcad.errors import InputError
from gtcad.protocol import SeparableCurve
from gtcad.quilt import Quilt
from gtcad.restricted import RestrictedCurve, RestrictedSurface
from gtcad.solid import Solid

VERSION = 1
MILLIMETRES = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4, "ft": 304.8}

Entry = Annotated[
    CurveEntry
    | CompositeEntry
    | CircleEntry
    | EllipseEntry
    | ArcEntry
    | ParabolaEntry
    | SurfaceEntry
    | RuledEntry
    | CylinderEntry
    | ConeEntry
    | SweepEntry
    | SweptEntry
    | SwungEntry
    | RotationEntry
    | LoftedEntry
    | CoonsEntry
    | EnvelopingEntry
    | SpineDevelopableEntry
    | GeodesicDevelopableEntry
    | QuasiDevelopableEntry
    | PlateauEntry
    | TBCoonsEntry
    | QuiltEntry
    | SolidEntry,
    Field(discriminator="kind"),
]
ENTRIES: dict[str, type[ShapeEntry]] = {
    "curve": CurveEntry,
    "composite": CompositeEntry,
    "circle": CircleEntry,
    "ellipse": EllipseEntry,
    "arc": ArcEntry,
    "parabola": ParabolaEntry,
    "surface": SurfaceEntry,
    **PATCH_ENTRIES,
    **DEVELOPABLE_ENTRIES,
    **MINIMAL_ENTRIES,
    "quilt": QuiltEntry,
    "solid": SolidEntry,
}


class ModelFile(Strict):
    """A model of gtcad: curves and surfaces by name, all lengths in one unit."""

    gtcad: Annotated[Literal[1], BeforeValidator(checks.one_of(VERSION))] = Field(
        description="The version of this format."
    )
    unit: Annotated[Literal["mm", "cm", "m", "in", "ft"], BeforeValidator(checks.one_of(*MILLIMETRES))] = Field(
        default="mm", description="The unit of all coordinates: 1, 10, 1000, 25.4 or 304.8 mm."
    )
    marking: list[MarkingFields] = Field(default=[], description="Curves on shapes, for their flat patterns.")
    shape: list[Entry] = Field(description="The shapes, in the order in which they are exported.", min_length=1)


def entry_of(name: str, shape: ModelShape, color: str | None, *, construction: bool = False) -> dict[str, Any]:
    """A shape as the plain data of its entry in a model file.

    Raises
    ------
    InputError
        When no kind of a model file can hold such a shape.
    """
    data: dict[str, Any] = {"name": name, "kind": ""}
    if color is not None:
        data["color"] = color
    if construction:
        data["construction"] = True
    try:
        kind, fields = _fields(shape)
    except InputError as error:
        raise InputError(f"shape {name!r}: {error}") from None
    return data | {"kind": kind} | fields


def _fields(shape: ModelShape) -> tuple[str, dict[str, Any]]:
    found: tuple[str, dict[str, Any] | None] | None
    if isinstance(shape, Solid):
        found = "solid", solid_data(shape)
    elif isinstance(shape, Quilt):
        found = "quilt", quilt_data(shape)
    elif isinstance(shape, Composite):
        found = chain_data(shape)
    elif isinstance(shape, SeparableCurve):
        found = "curve", curve_data(shape)
    else:
        found = minimal_data(shape) or patch_data(shape) or developable_data(shape)
        found = found or ("surface", surface_data(shape))
    if found is None or found[1] is None:
        whole = shape.shape if isinstance(shape, RestrictedCurve | RestrictedSurface) else shape
        of = "" if whole is shape else f" of {type(whole).__name__}"
        what = "all that it is made of" if isinstance(shape, Composite | Quilt | Solid) else "it"
        raise InputError(f"a model file cannot hold {type(shape).__name__}{of}: it has no kind for {what}")
    return found[0], found[1]
