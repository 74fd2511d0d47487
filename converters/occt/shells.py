"""Shells and solids of many faces that share their edges: built from equal boundary curves, without sewing."""

from __future__ import annotations

import itertools
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from gtcad.converters.bspline import BSplineCurve, BSplineSurface
from gtcad.converters.occt.compat import as_edge, as_face, kernel_guard, kernel_module
from gtcad.converters.occt.geometry import to_geom_curve
from gtcad.converters.occt.pieces import ShapeKey
from gtcad.converters.occt.topology import (
    AROUND,
    CORNERS,
    ENDS,
    TOLERANCE,
    Outline,
    Side,
    checked,
    corner_places,
    edge_between,
    face_on,
    outline_without_seams,
    vertices_at,
    walked_ahead,
)
from gtcad.errors import InputError, KernelError

if TYPE_CHECKING:
    from gtcad.quilt import SharedEdge

_BRep = kernel_module("BRep")
_TopAbs = kernel_module("TopAbs")
_TopExp = kernel_module("TopExp")
_TopoDS = kernel_module("TopoDS")

Place = tuple[int, Side]
_SAME = 1e-2  # of the tolerance: how far curves that are one may be apart by rounding


@dataclass(frozen=True, eq=False)
class FreeEdge:
    """An edge that only one face uses.

    Attributes
    ----------
    patch, side
        Where it is.
    edge
        The kernel's, oriented as its face uses it in the shell.
    curve
        The side as it runs with its parameter.
    ahead
        Whether the face uses it in the direction of that parameter.
    """

    patch: int
    side: Side
    edge: Any
    curve: BSplineCurve
    ahead: bool


@dataclass(frozen=True, eq=False)
class Shell:
    """Faces that share edges.

    Attributes
    ----------
    shape
        The kernel's shell; marked as closed when no edge is free.
    faces
        One for each patch, then one for each cap, oriented as in the shell.
    free
        The edges that only one face uses, by patch and side.
    """

    shape: Any
    faces: tuple[Any, ...]
    free: tuple[FreeEdge, ...]


def make_shell(
    splines: Sequence[BSplineSurface],
    edges: Iterable[SharedEdge],
    flipped: Sequence[bool],
    *,
    tolerance: float = TOLERANCE,
) -> Shell:
    """The shell of patches whose shared sides are equal curves: one kernel edge for each, one vertex for each corner.

    A side whose control points are all equal becomes a degenerate edge, and opposite sides that a patch shares with
    itself one seam edge.

    Parameters
    ----------
    splines
        In mm.
    edges
        The sides that are shared: at equal parameters, or where ``reversed`` at mirrored ones, they have equal points
        up to rounding. Corners that are one must be equal to the last bit.
    flipped
        For each patch whether its face is turned over, so that neighbours have their normals on one side.
    tolerance
        Of vertices, edges and faces, in mm.

    Raises
    ------
    InputError
        When shared sides differ, a side is shared twice, neighbours are turned against each other, the patches do not
        hang together, or one is not such that ``make_face`` takes it.
    KernelError
        When the kernel's own check refuses a face or the shell.

    Notes
    -----
    About 2 ms for each face.
    """
    if not splines or len(flipped) != len(splines):
        raise InputError(f"a shell needs a patch and one flag for each, got {len(splines)} and {len(flipped)}")
    with kernel_guard("making a shell"):
        outlines = [_outline(patch, spline, tolerance) for patch, spline in enumerate(splines)]
        sharing = _Sharing(outlines, flipped, tolerance)
        for edge in edges:
            sharing.add(edge)
        return _assembled(sharing, tolerance)


def make_solid(outer: Shell, *cavities: Shell) -> Any:
    """The solid inside a closed shell whose normals point outwards, without cavities with normals into them.

    Raises
    ------
    InputError
        When an edge is free.
    KernelError
        When the kernel's own check refuses the solid.
    """
    for shell in (outer, *cavities):
        if shell.free:
            first = shell.free[0]
            raise InputError(f"a solid needs closed shells: {named_side((first.patch, first.side))} is free")
    with kernel_guard("making a solid"):
        return checked(solid_between([shell.shape for shell in (outer, *cavities)]), "solid")


def solid_between(shells: Iterable[Any]) -> Any:
    """The kernel's solid between shells, the outer one first; unchecked."""
    builder, solid = _BRep.BRep_Builder(), _TopoDS.TopoDS_Solid()
    builder.MakeSolid(solid)
    for shell in shells:
        builder.Add(solid, shell)
    return solid


# --- who shares what --------------------------------------------------------------------------------------------------


def _outline(patch: int, spline: BSplineSurface, tolerance: float) -> Outline:
    try:
        return outline_without_seams(spline, tolerance)
    except InputError as error:
        raise InputError(f"patch {patch}: {error}") from error


class _Sharing:
    """For each side of each patch the side whose edge it uses, and whether it runs against that."""

    def __init__(self, outlines: Sequence[Outline], flipped: Sequence[bool], tolerance: float) -> None:
        self.allowed = _SAME * tolerance
        self.outlines = list(outlines)
        self.flipped = tuple(flipped)
        self.owner: dict[Place, Place] = {}
        self.mirrored: defaultdict[int, set[Side]] = defaultdict(set)

    def add(self, edge: SharedEdge) -> None:
        """Take in a shared edge; sides that are points have an edge of their own in every face all the same."""
        first, second = self._place(edge.first), self._place(edge.second)
        self._check_equal(first, second, edge.reversed)
        if first[1] in self.outlines[first[0]].points:
            return
        for place in (first, second):
            if place in self.owner or first == second:
                raise InputError(f"{named_side(place)} is shared twice")
            self.owner[place] = first
        if edge.reversed:
            self.mirrored[second[0]].add(second[1])
        if self.ahead(first) == self.ahead(second):
            raise InputError(
                f"{named_side(first)} and {named_side(second)} are one edge, but the faces turn against each other "
                "there: wrong flips, or a surface with one side only"
            )
        if first[0] == second[0]:
            if first[1][0] != second[1][0]:
                raise InputError(
                    f"{named_side(first)} and {named_side(second)} are one edge, but not opposite: "
                    "the kernel has no such face, divide the patch"
                )
            outline = self.outlines[first[0]]
            seams = {**outline.seams, first[1]: first[1], second[1]: first[1]}
            self.outlines[first[0]] = replace(outline, seams=seams)

    def ahead(self, place: Place) -> bool:
        """Whether the face in the shell uses the edge of a side forwards."""
        patch, side = place
        return walked_ahead(side, self.mirrored[patch]) != self.flipped[patch]

    def _place(self, use: Any) -> Place:
        if not 0 <= use.patch < len(self.outlines) or use.side not in AROUND:
            raise InputError(f"there is no side {use.side!r} of a patch {use.patch}")
        return use.patch, use.side

    def _check_equal(self, first: Place, second: Place, mirrored: bool) -> None:
        a, b = (self.outlines[patch].curves[side] for patch, side in (first, second))
        if a.domain != b.domain:
            raise InputError(f"{named_side(first)} and {named_side(second)} are one edge, but their domains differ")
        gap = _apart(a, b, mirrored)
        if gap > self.allowed:
            raise InputError(
                f"{named_side(first)} and {named_side(second)} are one edge, but {gap:.3g} mm apart, "
                f"more than {self.allowed:.3g} mm"
            )


def named_side(place: Place) -> str:
    """A side in words."""
    return f"side {place[1]} of patch {place[0]}"


def _apart(a: BSplineCurve, b: BSplineCurve, mirrored: bool) -> float:
    """Largest distance at samples that tell any two polynomial splines over these knots apart."""
    start, end = a.domain
    knots = np.unique(np.concatenate([a.knots, start + end - b.knots if mirrored else b.knots]))
    steps = np.linspace(0, 1, a.degree + b.degree + 2)
    t = (knots[:-1, None] + np.diff(knots)[:, None] * steps).clip(start, end).reshape(-1)
    other = b.evaluate((start + end - t).clip(start, end) if mirrored else t)
    return float(np.linalg.norm(a.evaluate(t) - other, axis=-1).max())


# --- faces and shells -------------------------------------------------------------------------------------------------


def _assembled(sharing: _Sharing, tolerance: float) -> Shell:
    outlines = sharing.outlines
    vertices = vertices_at([place for outline in outlines for place in corner_places(outline.surface)], tolerance)
    by_corner = dict(zip(itertools.product(range(len(outlines)), CORNERS), vertices, strict=True))
    made: dict[Place, Any] = {}
    for patch, outline in enumerate(outlines):
        for side in outline.needed:
            if sharing.owner.get((patch, side), (patch, side)) == (patch, side):
                start, end = (by_corner[patch, corner] for corner in ENDS[side])
                geometry = None if side in outline.points else to_geom_curve(outline.curves[side])
                made[patch, side] = edge_between(geometry, start, end, outline.curves[side].domain, tolerance)
    faces, free = [], []
    for patch, outline in enumerate(outlines):
        edges = {side: made[sharing.owner.get((patch, side), (patch, side))] for side in outline.needed}
        face = face_on(outline, edges, tolerance, mirrored=sharing.mirrored[patch])
        faces.append(as_face(face.Reversed()) if sharing.flipped[patch] else face)
        for side in sorted(AROUND):
            if (patch, side) not in sharing.owner and side not in outline.points:
                ahead = sharing.ahead((patch, side))
                free.append(FreeEdge(patch, side, _turned(edges[side], ahead), outline.curves[side], ahead))
    return shell_of(faces, free)


def _turned(edge: Any, ahead: bool) -> Any:
    return as_edge(edge.Oriented(_TopAbs.TopAbs_FORWARD if ahead else _TopAbs.TopAbs_REVERSED))


def shell_of(faces: Sequence[Any], free: Sequence[FreeEdge]) -> Shell:
    """The shell of faces that share their edges already, but for the free ones.

    Raises
    ------
    InputError
        When they do not hang together.
    KernelError
        When the kernel's own check refuses it, or an edge is not used as it should be.
    """
    builder, shape = _BRep.BRep_Builder(), _TopoDS.TopoDS_Shell()
    builder.MakeShell(shape)
    for face in faces:
        builder.Add(shape, face)
    shape.Closed(not free)
    if (parts := parts_of(shape)) > 1:
        raise InputError(f"a shell needs faces that hang together, these fall into {parts} separate parts")
    uses = edge_uses(shape)
    if uses.free != len(free) or uses.wrong:
        raise KernelError(f"the shell should have {len(free)} free edges and none that is used wrongly, got {uses}")
    return Shell(checked(shape, "shell"), tuple(faces), tuple(free))


# --- how edges are used -----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class EdgeUses:
    """How many edges of a shape are used in which way.

    Attributes
    ----------
    shared
        By two faces, once in each direction.
    seams
        Twice by one face, once in each direction.
    degenerate
        Points, by one face each.
    free
        Once.
    wrong
        In any other way.
    """

    shared: int = 0
    seams: int = 0
    degenerate: int = 0
    free: int = 0
    wrong: int = 0

    @property
    def closed(self) -> bool:
        """Whether every edge joins two faces, or two sides of one."""
        return self.free == self.wrong == 0


def edge_uses(shape: Any) -> EdgeUses:
    """How the faces of a shape use its edges."""
    uses: defaultdict[ShapeKey, list[tuple[int, Any]]] = defaultdict(list)
    edges: dict[ShapeKey, Any] = {}
    for number, face in enumerate(_explored(shape, _TopAbs.TopAbs_FACE)):
        for edge in _explored(face, _TopAbs.TopAbs_EDGE):
            uses[ShapeKey(edge)].append((number, edge.Orientation()))
            edges[ShapeKey(edge)] = edge
    counts: defaultdict[str, int] = defaultdict(int)
    for key, places in uses.items():
        counts[_way_of_use(edges[key], places)] += 1
    return EdgeUses(**counts)


def _explored(shape: Any, kind: Any) -> Iterable[Any]:
    """All uses of the sub-shapes of a kind, with the orientation that each has in the shape."""
    explorer = _TopExp.TopExp_Explorer(shape, kind)
    while explorer.More():
        yield explorer.Current()
        explorer.Next()


def _way_of_use(edge: Any, places: list[tuple[int, Any]]) -> str:
    faces = {number for number, _ in places}
    ways = {way for _, way in places}
    if _BRep.BRep_Tool.Degenerated_s(as_edge(edge)):
        return "degenerate" if len(places) == 1 else "wrong"
    if len(places) == 1:
        return "free"
    if len(places) != 2 or ways != {_TopAbs.TopAbs_FORWARD, _TopAbs.TopAbs_REVERSED}:
        return "wrong"
    return "shared" if len(faces) == 2 else "seams"


def parts_of(shape: Any) -> int:
    """Into how many parts the faces of a shape fall when only common edges hold them together."""
    parts: list[set[ShapeKey]] = []
    for face in _explored(shape, _TopAbs.TopAbs_FACE):
        edges = {ShapeKey(edge) for edge in _explored(face, _TopAbs.TopAbs_EDGE)}
        touched = [part for part in parts if not part.isdisjoint(edges)]
        parts = [part for part in parts if part.isdisjoint(edges)] + [edges.union(*touched)]
    return len(parts)
