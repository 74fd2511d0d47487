"""Shells and solids of many faces that share their edges: built from equal boundary curves, without sewing."""

from __future__ import annotations

import itertools
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from gtcad.converters.bspline import Array, BSplineCurve, BSplineSurface
from gtcad.converters.occt.compat import as_edge, as_face, kernel_guard, kernel_module, point
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
_Geom = kernel_module("Geom")
_gp = kernel_module("gp")
_TopAbs = kernel_module("TopAbs")
_TopExp = kernel_module("TopExp")
_TopoDS = kernel_module("TopoDS")

Place = tuple[int, Side]
_SAME = 1e-2  # of the tolerance: how far curves that are one may be apart by rounding
_STEPS = 32  # points of each knot span for the sign of an area and for what lies inside
_PARALLEL = 1e-6  # sine of the angle between planes that may be one


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
        The edges that only one face uses.
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

    A side whose control points are all equal becomes a degenerate edge, and sides that a patch shares with itself
    one seam edge.

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


def make_solid(shell: Shell) -> Any:
    """The solid inside a closed shell whose normals point outwards.

    Raises
    ------
    InputError
        When an edge is free.
    KernelError
        When the kernel's own check refuses the solid.
    """
    if shell.free:
        first = shell.free[0]
        raise InputError(f"a solid needs a closed shell: side {first.side} of patch {first.patch} is free")
    with kernel_guard("making a solid"):
        return checked(solid_between([shell.shape]), "solid")


def solid_between(shells: Iterable[Any]) -> Any:
    """The kernel's solid between shells, unchecked: the outer one, then those of its cavities, normals into them."""
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
                raise InputError(f"{_named(place)} is shared twice")
            self.owner[place] = first
        if edge.reversed:
            self.mirrored[second[0]].add(second[1])
        if self.ahead(first) == self.ahead(second):
            raise InputError(
                f"{_named(first)} and {_named(second)} are one edge, but the faces turn against each other there: "
                "wrong flips, or a surface with one side only"
            )
        if first[0] == second[0]:
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
            raise InputError(f"{_named(first)} and {_named(second)} are one edge, but their domains differ")
        gap = _apart(a, b, mirrored)
        if gap > self.allowed:
            raise InputError(
                f"{_named(first)} and {_named(second)} are one edge, but {gap:.3g} mm apart, "
                f"more than {self.allowed:.3g} mm"
            )


def _named(place: Place) -> str:
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
        for side in AROUND:
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


# --- planar caps ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Cap:
    """A plane face that closes one loop of free edges.

    Attributes
    ----------
    face
        The kernel's, oriented as in the shell.
    loop
        The free edges, in the direction in which their own faces use them.
    centre, normal
        Of the plane; the unit normal goes out of the shell like those of its other faces. Each of shape (3,).
    flatness
        Largest distance of a control point of the loop from the plane, in mm.
    """

    face: Any
    loop: tuple[FreeEdge, ...]
    centre: Array
    normal: Array
    flatness: float


def planar_caps(shell: Shell, *, flatness: float, tolerance: float = TOLERANCE) -> tuple[Cap, ...]:
    """A plane face for each loop of free edges, on these edges themselves.

    Parameters
    ----------
    shell
        A loop must not cross itself: that is not tested.
    flatness
        How far the edges may leave their plane, in mm. The tolerance of edges that do is raised to what they do.
    tolerance
        Of the faces, in mm.

    Raises
    ------
    InputError
        When no edge is free, loops touch each other or lie within each other in one plane, or a loop is not plane or
        encloses nothing.
    KernelError
        When the kernel's own check refuses a face.
    """
    if not shell.free:
        raise InputError("the shell is closed: there is nothing to cap")
    with kernel_guard("making planar caps"):
        caps = tuple(_cap(loop, flatness, tolerance) for loop in _loops(shell.free))
        for one, other in itertools.permutations(caps, 2):
            if _within(one, other, max(flatness, tolerance)):
                raise InputError(
                    f"the loops at {_listed(one.loop)} and at {_listed(other.loop)} lie in one plane, one inside the "
                    "other: close the gap between them with patches"
                )
        return caps


def capped(shell: Shell, caps: Sequence[Cap]) -> Shell:
    """The shell with the caps among its faces.

    Raises
    ------
    KernelError
        When the kernel's own check refuses it.
    """
    with kernel_guard("capping a shell"):
        used = {(edge.patch, edge.side) for cap in caps for edge in cap.loop}
        free = [edge for edge in shell.free if (edge.patch, edge.side) not in used]
        return shell_of([*shell.faces, *(cap.face for cap in caps)], free)


def _loops(free: Sequence[FreeEdge]) -> Iterator[tuple[FreeEdge, ...]]:
    """The free edges end to end; as many begin as end at a vertex, since the faces agree in their orientation."""
    following: dict[ShapeKey, FreeEdge] = {}
    for edge in free:
        start = ShapeKey(_TopExp.TopExp.FirstVertex_s(edge.edge, True))
        if start in following:
            raise InputError(f"{_listed([following[start], edge])} begin at one corner: the loops there are not clear")
        following[start] = edge
    while following:
        start = next(iter(following))
        loop = [following.pop(start)]
        while (end := ShapeKey(_TopExp.TopExp.LastVertex_s(loop[-1].edge, True))) != start:
            loop.append(following.pop(end))
        yield tuple(loop)


def _listed(loop: Iterable[FreeEdge]) -> str:
    return ", ".join(_named((edge.patch, edge.side)) for edge in loop)


def _cap(loop: tuple[FreeEdge, ...], flatness: float, tolerance: float) -> Cap:
    poles = np.concatenate([edge.curve.control_points for edge in loop])
    centre = poles.mean(axis=0)
    normal = np.linalg.svd(poles - centre)[2][-1]
    off_plane = float(np.abs((poles - centre) @ normal).max())
    if off_plane > max(flatness, tolerance):
        raise InputError(
            f"the loop at {_listed(loop)} is not plane: it lies up to {off_plane:.3g} mm off the best plane, "
            f"more than {max(flatness, tolerance):.3g} mm"
        )
    polygon = _polygon(loop)[::-1] - centre  # a cap uses its edges the other way round
    enclosed = float(np.cross(polygon, np.roll(polygon, -1, axis=0)).sum(axis=0) @ normal) / 2
    if abs(enclosed) <= tolerance * float(np.linalg.norm(polygon, axis=1).max()):
        raise InputError(f"the loop at {_listed(loop)} encloses no area")
    normal = np.copysign(1.0, enclosed) * normal
    face = _plane_face(loop, centre, normal, tolerance)
    if off_plane > tolerance:
        _loosen(loop, 1.01 * off_plane)
    return Cap(checked(face, "cap"), loop, centre, normal, off_plane)


def _plane_face(loop: Sequence[FreeEdge], centre: Array, normal: Array, tolerance: float) -> Any:
    builder, face, wire = _BRep.BRep_Builder(), _TopoDS.TopoDS_Face(), _TopoDS.TopoDS_Wire()
    plane = _Geom.Geom_Plane(point(centre), _gp.gp_Dir(*normal.tolist()))
    builder.MakeFace(face, plane, tolerance)
    builder.MakeWire(wire)
    for edge in reversed(loop):
        builder.Add(wire, edge.edge.Reversed())
    wire.Closed(True)
    builder.Add(face, wire)
    return face


def _loosen(loop: Sequence[FreeEdge], tolerance: float) -> None:
    builder = _BRep.BRep_Builder()
    for edge in loop:
        builder.UpdateEdge(edge.edge, tolerance)
        for end in (_TopExp.TopExp.FirstVertex_s, _TopExp.TopExp.LastVertex_s):
            builder.UpdateVertex(end(edge.edge), tolerance)


def _polygon(loop: Sequence[FreeEdge]) -> Array:
    """Points along the edges, in the direction in which their own faces use them."""
    parts = []
    for edge in loop:
        knots = edge.curve.knots
        t = np.linspace(knots[:-1], knots[1:], _STEPS, endpoint=False, axis=1).reshape(-1)
        points = edge.curve.evaluate(t if edge.ahead else knots[0] + knots[-1] - t)
        parts.append(points)
    return np.concatenate(parts)


def _within(inner: Cap, outer: Cap, flatness: float) -> bool:
    """Whether a loop lies in the plane of another one and begins inside it."""
    place = _polygon(inner.loop)[0] - outer.centre
    if abs(place @ outer.normal) > flatness or np.linalg.norm(np.cross(inner.normal, outer.normal)) > _PARALLEL:
        return False
    across = np.linalg.svd(outer.normal[None, :])[2][1:]
    x, y = across @ (_polygon(outer.loop) - outer.centre - place).T
    next_x, next_y = np.roll(x, -1), np.roll(y, -1)
    turns = np.arctan2(x * next_y - y * next_x, x * next_x + y * next_y).sum()
    return bool(abs(turns) > np.pi)


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
