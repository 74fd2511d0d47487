"""The kinds of shapes made of several patches that a model file can hold."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Discriminator, Field, Tag

from gtcad import _checks as checks
from gtcad._curve_kinds import CurveName
from gtcad._documents import Location
from gtcad._entries import INLINE, NAMED, ShapeEntry, Shapes, Strict, Yes
from gtcad._patch_kinds import (
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
from gtcad._surface_kinds import SurfaceEntry, surface_data
from gtcad.errors import InputError
from gtcad.protocol import SeparableSurface
from gtcad.quilt import SAME, Quilt, SharedEdge, Use
from gtcad.solid import Solid


def _tag(value: Any) -> str | None:
    if isinstance(value, str):
        return NAMED
    kind = value.get("kind") if isinstance(value, dict) else getattr(value, "kind", None)
    return f"{INLINE}{kind}" if isinstance(kind, str) else None


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
    | Annotated[CoonsEntry, Tag(f"{INLINE}coons")],
    Discriminator(_tag),
]
Order = Annotated[str, BeforeValidator(checks.order), Field(pattern="^[CG][0-3]$")]
Side = Annotated[str, BeforeValidator(checks.side), Field(examples=["roof.u1"])]


class EdgeFields(Strict):
    """An edge that two patches share, stated where it is not to be found by equal curves."""

    first: Side = Field(description="Patch and side, such as roof.u1: its curve is the edge.")
    second: Side = Field(description="The other patch and side.")
    reversed: Yes = Field(default=False, description="Whether the second curve runs backwards along the first.")
    order: Order = Field(default="C0", description="The order of continuity across the edge, C0 to C3 or G0 to G3.")


class QuiltFields(ShapeEntry):
    """What quilts and solids have in common."""

    patches: list[PatchField] = Field(
        description="Surfaces of this file by name, or spelled out with names of their own.", min_length=1
    )
    order: Order = Field(default="C0", description="The order of continuity across all edges that are not stated.")
    edges: list[EdgeFields] = Field(default=[], description="Edges that are stated; all others are found.")
    gap: Annotated[float, BeforeValidator(checks.not_negative), Field(ge=0)] = Field(
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
        names, surfaces = [], []
        for index, patch in enumerate(self.patches):
            surface = shapes[patch] if isinstance(patch, str) else patch.build(shapes)
            if not isinstance(surface, SeparableSurface):
                raise InputError(f"patches[{index}]: {patch!r} is no single surface")
            names.append(patch if isinstance(patch, str) else patch.name)
            surfaces.append(surface)
        stated = [
            SharedEdge(_use(names, edge.first), _use(names, edge.second), edge.reversed, edge.order)
            for edge in self.edges
        ]
        return Quilt.recognised(surfaces, names=names, order=self.order, stated=stated, gap=self.gap)


def _use(names: list[str], text: str) -> Use:
    name, _, side = text.rpartition(".")
    if name not in names:
        raise InputError(f"edges: {text!r} names no patch of this shape: it has {', '.join(names)}")
    return Use(names.index(name), side)


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
        found = patch_data(patch)
        if found is None:
            fields = surface_data(patch)
            if fields is None:
                return None
            found = "surface", fields
        kind, fields = found
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
