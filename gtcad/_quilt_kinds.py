"""The kinds of shapes made of several patches that a model file can hold."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Discriminator, Field, Tag, ValidationInfo

from gtcad import _checks as checks
from gtcad._curve_kinds import CurveName
from gtcad._developable_kinds import (
    DEVELOPABLE_ENTRIES,
    EnvelopingEntry,
    GeodesicDevelopableEntry,
    QuasiDevelopableEntry,
    SpineDevelopableEntry,
    developable_data,
)
from gtcad._documents import Location, Problem, shown
from gtcad._entries import INLINE, NAMED, ShapeEntry, Shapes, Strict, Yes
from gtcad._minimal_kinds import MINIMAL_ENTRIES, PlateauEntry, TBCoonsEntry, minimal_data
from gtcad._patch_kinds import (
    PATCH_ENTRIES,
    ConeEntry,
    CoonsEntry,
    CylinderEntry,
    LoftedEntry,
    PatchEntry,
    RotationEntry,
    RuledEntry,
    SweepEntry,
    SweptEntry,
    SwungEntry,
    list_of,
    patch_data,
    what,
)
from gtcad._surface_kinds import SurfaceEntry, surface_data
from gtcad.edge_check import check_edge
from gtcad.errors import InputError
from gtcad.protocol import SeparableSurface
from gtcad.quilt import SAME, Quilt, SharedEdge, Use
from gtcad.solid import Solid

_NAMED_PATCHES = 8  # in a message


def _tag(value: Any) -> str | None:
    if isinstance(value, str):
        return NAMED
    kind = value.get("kind") if isinstance(value, dict) else getattr(value, "kind", None)
    return f"{INLINE}{kind}" if isinstance(kind, str) else None


PATCHES = ("surface", *PATCH_ENTRIES, *MINIMAL_ENTRIES, *DEVELOPABLE_ENTRIES)


def _patch(value: Any, info: ValidationInfo) -> Any:
    """Refuse what is neither a name nor a mapping of a kind of patch, and what only whole shapes have."""
    if isinstance(value, str | PatchEntry | SurfaceEntry):
        return value
    if not isinstance(value, dict):
        checks.refuse([((), f"must be the name of a surface or an object with the fields of one, got {shown(value)}")])
    problems: list[Problem] = [
        ((field,), "belongs to the whole shape: a patch that is spelled out has none")
        for field in ("color", "construction")
        if field in value
    ]
    if value.get("kind") not in PATCHES:
        wanted = f"must be one of {', '.join(PATCHES)}"
        found = f"{wanted}, got {shown(value['kind'])}" if "kind" in value else f"is missing; {wanted}"
        problems.append((("kind",), found))
    if problems:
        checks.refuse(problems)
    return value


PatchField = Annotated[
    CurveName
    | Annotated[SurfaceEntry, Tag(f"{INLINE}surface")]
    | Annotated[RuledEntry, Tag(f"{INLINE}ruled")]
    | Annotated[CylinderEntry, Tag(f"{INLINE}cylinder")]
    | Annotated[ConeEntry, Tag(f"{INLINE}cone")]
    | Annotated[SweepEntry, Tag(f"{INLINE}sweep")]
    | Annotated[SweptEntry, Tag(f"{INLINE}swept")]
    | Annotated[SwungEntry, Tag(f"{INLINE}swung")]
    | Annotated[RotationEntry, Tag(f"{INLINE}rotation")]
    | Annotated[LoftedEntry, Tag(f"{INLINE}lofted")]
    | Annotated[CoonsEntry, Tag(f"{INLINE}coons")]
    | Annotated[PlateauEntry, Tag(f"{INLINE}plateau")]
    | Annotated[TBCoonsEntry, Tag(f"{INLINE}tb_coons")]
    | Annotated[EnvelopingEntry, Tag(f"{INLINE}enveloping")]
    | Annotated[SpineDevelopableEntry, Tag(f"{INLINE}spine-developable")]
    | Annotated[GeodesicDevelopableEntry, Tag(f"{INLINE}geodesic-developable")]
    | Annotated[QuasiDevelopableEntry, Tag(f"{INLINE}quasi-developable")],
    Discriminator(_tag),
    BeforeValidator(_patch),
]
OrderText = Annotated[str, Field(pattern="^[CG][0-3]$")]
Order = Annotated[OrderText, BeforeValidator(checks.order)]
Side = Annotated[str, BeforeValidator(checks.side), Field(examples=["roof.u1"])]


class EdgeFields(Strict):
    """An edge that two patches share, stated where it is not to be found by equal curves."""

    first: Side = Field(description="Patch and side, such as roof.u1: its curve is the edge.")
    second: Side = Field(description="The other patch and side.")
    reversed: Yes = Field(default=False, description="Whether the second curve runs backwards along the first.")
    order: Order = Field(default="C0", description="The order of continuity across the edge, C0 to C3 or G0 to G3.")


class QuiltFields(ShapeEntry):
    """What quilts and solids have in common."""

    patches: Annotated[list[PatchField], BeforeValidator(list_of("patches"))] = Field(
        description="Surfaces of this file by name, or spelled out with names of their own.", min_length=1
    )
    order: Annotated[OrderText | None, BeforeValidator(checks.optional(checks.order))] = Field(
        default=None,
        description="The order of continuity across all edges that are not stated, C0 to C3 or G0 to G3. When left out "
        "C0; but where a patch meets itself, as smooth as it does, up to G2.",
    )
    edges: Annotated[list[EdgeFields], BeforeValidator(list_of("edges"))] = Field(
        default=[], description="Edges that are stated; all others are found."
    )
    gap: Annotated[float, Field(ge=0), BeforeValidator(checks.not_negative)] = Field(
        default=0.0, description="How far apart the curves of a stated edge may be, in the file's unit."
    )

    def references(self) -> Iterator[tuple[Location, str]]:
        """The named patches, and what the others name."""
        for index, patch in enumerate(self.patches):
            if isinstance(patch, str):
                yield ("patches", index), patch
            else:
                yield from ((("patches", index, *location), name) for location, name in patch.references())

    def quilt(self, shapes: Shapes) -> Quilt:
        """The patches with their shared edges."""
        names: list[str] = []
        surfaces = []
        for index, patch in enumerate(self.patches):
            name = patch if isinstance(patch, str) else patch.name
            if name in names:
                raise InputError(f"patches[{index}]: {shown(name)} is the name of patches[{names.index(name)}] already")
            names.append(name)
            surfaces.append(_surface(shapes, f"patches[{index}]", patch))
        stated = [
            SharedEdge(
                _use(names, f"edges[{k}].first", edge.first),
                _use(names, f"edges[{k}].second", edge.second),
                edge.reversed,
                edge.order,
            )
            for k, edge in enumerate(self.edges)
        ]
        quilt = Quilt.recognised(surfaces, names=names, order=self.order or "C0", stated=stated, gap=self.gap)
        return quilt if self.order else _with_smooth_seams(quilt, len(stated))


def _surface(shapes: Shapes, where: str, patch: SurfaceEntry | PatchEntry | str) -> SeparableSurface:
    try:
        surface = shapes[patch] if isinstance(patch, str) else patch.build(shapes)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    if not isinstance(surface, SeparableSurface):
        raise InputError(f"{where} must be a surface, {shown(patch)} is {what(surface)}")
    return surface


def _use(names: list[str], where: str, text: str) -> Use:
    name, _, side = text.rpartition(".")
    if name not in names:
        raise InputError(f"{where}: {shown(text)} names no patch of this shape, which has {_listed(names)}")
    return Use(names.index(name), side)


def _listed(names: list[str]) -> str:
    more = f" and {len(names) - _NAMED_PATCHES} more" if len(names) > _NAMED_PATCHES else ""
    return ", ".join(map(shown, names[:_NAMED_PATCHES])) + more


def _with_smooth_seams(quilt: Quilt, stated: int) -> Quilt:
    """The seams that were found joined as smoothly as their patches are: a kink there is an artefact of the fit."""
    edges = [
        replace(edge, order=_smoothness(quilt, edge)) if edge.first.patch == edge.second.patch else edge
        for edge in quilt.edges[stated:]
    ]
    return replace(quilt, edges=(*quilt.edges[:stated], *edges))


def _smoothness(quilt: Quilt, edge: SharedEdge) -> str:
    sides = ((quilt.patches[use.patch], use.side) for use in edge.uses)
    (first, side), (second, other) = sides
    report = check_edge(first, side, second, other, reversed=edge.reversed)
    return next((order for order in ("G2", "G1") if report.meets(order)), "C0")


class QuiltEntry(QuiltFields):
    """Patches that share edges: one shell."""

    kind: Literal["quilt"]

    def build(self, shapes: Shapes) -> Quilt:
        """The quilt."""
        return self.quilt(shapes)


class SolidEntry(QuiltFields):
    """A body inside patches that share edges, or a wall along them."""

    kind: Literal["solid"]
    caps: Annotated[Literal["none", "planar"], BeforeValidator(checks.one_of("none", "planar"))] = Field(
        default="none", description="planar: loops of free edges are closed by plane faces."
    )
    thickness: Annotated[float | None, BeforeValidator(checks.optional(checks.number))] = Field(
        default=None,
        description="Of a wall, in the file's unit; positive to the side of the normals, which of a closed quilt is "
        "outside. A full body when left out.",
    )

    def build(self, shapes: Shapes) -> Solid:
        """The solid."""
        return Solid(self.quilt(shapes), self.caps, self.thickness)


def quilt_data(quilt: Quilt) -> dict[str, Any] | None:
    """The fields of a quilt, or None when a model file cannot hold a patch of it."""
    entries = []
    for name, patch in zip(quilt.names, quilt.patches, strict=True):
        kind, fields = (
            minimal_data(patch) or patch_data(patch) or developable_data(patch) or ("surface", surface_data(patch))
        )
        if fields is None:
            return None
        entries.append({"name": name, "kind": kind} | fields)
    gap = max(quilt.gaps, default=0.0)
    rounding = SAME * max(float(np.abs(patch.coefficients).max()) for patch in quilt.patches)
    edges = [
        {"first": quilt.label(edge.first), "second": quilt.label(edge.second), "order": edge.order}
        | ({"reversed": True} if edge.reversed else {})
        for edge in quilt.edges
    ]
    plain = {"gap": gap} if gap > rounding else {}
    return plain | ({"edges": edges} if edges else {}) | {"patches": entries}


def solid_data(solid: Solid) -> dict[str, Any] | None:
    """The fields of a solid, or None when a model file cannot hold a patch of it."""
    fields = quilt_data(solid.quilt)
    if fields is None:
        return None
    wall = {} if solid.thickness is None else {"thickness": solid.thickness}
    return {"caps": solid.caps} | wall | fields
