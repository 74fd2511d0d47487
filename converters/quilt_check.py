"""The faces of a file held against a quilt or a solid: every patch, every shared edge, and what they enclose."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gtcad._sides import DerivableSurface
from gtcad.continuity import JoinReport
from gtcad.converters.bspline import BSplineSurface
from gtcad.converters.chain_check import Joint
from gtcad.converters.correspondence import Way
from gtcad.converters.figures import Figure, Piece
from gtcad.converters.folds import crease
from gtcad.converters.pace import paced
from gtcad.converters.part import BodyFacts
from gtcad.converters.rounding import rounded_by, rounding_limits
from gtcad.converters.split_edges import Stretch, check_split_edge, stretches_of
from gtcad.converters.verdicts import Row, Verdict, compared_parts, joined, ways_over
from gtcad.converters.wall import SMOOTH, wall_volume
from gtcad.edge_check import check_edge
from gtcad.measure import Estimate
from gtcad.protocol import SeparableSurface
from gtcad.quilt import Quilt, SharedEdge, Use
from gtcad.solid import Solid

Array = NDArray[np.float64]

_ORDER: tuple[Verdict, ...] = ("proved", "estimated", "undecided", "failed", "invalid", "missing")
_PLACES = np.array([0.0, 0.3, 0.5, 0.7, 1.0])  # the same from both ends
_THINNER = 0.99  # of a wall, whose volume tells the area of the last layer


def check_quilt(
    name: str,
    shape: Quilt | Solid,
    figures: Sequence[Figure],
    groups: Sequence[Sequence[Piece]],
    others: Sequence[Piece],
    tolerance: float,
) -> tuple[list[Row], list[Joint]]:
    """Hold the faces that a file has for a quilt or a solid against its patches.

    Parameters
    ----------
    name
        Of the shape; its patches are called "name.patch".
    shape
        In mm.
    figures
        Its patches.
    groups
        For each patch the faces that hold it, one or several together.
    others
        Faces of the same body, or with its name, that hold no patch.
    tolerance
        In mm.

    Returns
    -------
    rows
        One for the whole, one for each patch.
    joints
        One for each shared edge whose patches are untrimmed faces, or parts of the patches cut along their parameters.
    """
    quilt = shape.quilt if isinstance(shape, Solid) else shape
    ways = [_ways_over(figure, group, tolerance) for figure, group in zip(figures, groups, strict=True)]
    rows = [
        compared_parts(f"{name}.{patch}", figure, group, tolerance, own)
        for patch, figure, group, own in zip(quilt.names, figures, groups, ways, strict=True)
    ]
    held = [
        _held(surface, group) if own is None else _Split(own, [_moved(piece) for piece in group])
        for surface, group, own in zip(quilt.patches, groups, ways, strict=True)
    ]
    found = [_joint(name, quilt, edge, held, tolerance) for edge in quilt.edges]
    pieces = [piece for group in groups for piece in group]
    whole = _whole(name, shape, pieces, others, rows, tolerance)
    if all(groups):
        whole = _less_sure(whole, quilt, found)
    return [whole, *rows], [joint for joint in found if joint is not None]


# --- shared edges -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Held:
    """What a face holds of a patch and how it runs: its u along the v of the patch, and against the patch's u and v."""

    surface: BSplineSurface | SeparableSurface
    transposed: bool
    backwards: tuple[bool, bool]
    gap: float
    moved: float

    def side(self, side: str) -> str:
        """The surface's side for a side of the patch."""
        axis = "uv".index(side[0])
        return f"{'uv'[axis ^ self.transposed]}{int(side[1]) ^ self.backwards[axis]}"

    def against(self, use: Use) -> bool:
        """Whether the surface runs along the side against the patch."""
        return self.backwards["uv".index(use.along)]


@dataclass(frozen=True)
class _Split:
    """How several faces run over a patch, and how far rounding may have moved each."""

    ways: Sequence[Way]
    moved: Sequence[float]


def _held(surface: SeparableSurface, group: Sequence[Piece]) -> _Held | None:
    if len(group) != 1 or group[0].figure.face is not None:
        return None
    own = group[0].figure.geometry
    assert isinstance(own, BSplineSurface | SeparableSurface)
    gap, transposed, backwards = _ways(surface, own)
    return _Held(own, transposed, backwards, gap, _moved(group[0]))


def _moved(piece: Piece) -> float:
    """How far rounding may have moved the coordinates in the file."""
    own = piece.part.geometry
    return rounded_by(own.control_points) if isinstance(own, BSplineSurface) else 0.0


def _ways_over(figure: Figure, group: Sequence[Piece], tolerance: float) -> list[Way] | None:
    """How several faces run over a patch; None where that is not known."""
    if len(group) < 2 or any(piece.figure.face is not None for piece in group):
        return None
    return ways_over(figure, [piece.figure for piece in group], tolerance)


def _stretches(held: _Held | _Split, use: Use) -> list[Stretch]:
    if isinstance(held, _Split):
        return stretches_of(held.ways, held.moved, use.side)
    return [Stretch(held.surface, held.side(use.side), held.moved, (1.0, 0.0) if held.against(use) else (0.0, 1.0))]


def _ways(surface: SeparableSurface, held: BSplineSurface | SeparableSurface) -> tuple[float, bool, tuple[bool, bool]]:
    """How far apart both are where the face runs as it fits best, and how that is: transposed, backwards in u, v."""
    model = surface.evaluate(_PLACES[:, None], _PLACES[None, :])
    (u0, u1), (v0, v1) = ((0.0, 1.0), (0.0, 1.0)) if isinstance(held, SeparableSurface) else held.domain
    own = held.evaluate((u0 * (1 - _PLACES) + u1 * _PLACES)[:, None], (v0 * (1 - _PLACES) + v1 * _PLACES)[None, :])
    ways = []
    for transposed, back_u, back_v in itertools.product((False, True), repeat=3):
        turned = own.swapaxes(0, 1) if transposed else own
        turned = turned[:: -1 if back_u else 1, :: -1 if back_v else 1]
        ways.append((float(np.linalg.norm(turned - model, axis=-1).max()), transposed, (back_u, back_v)))
    return min(ways)


def _joint(
    name: str, quilt: Quilt, edge: SharedEdge, held: Sequence[_Held | _Split | None], tolerance: float
) -> Joint | None:
    """What happens at an edge in the file; None where a face is missing or trimmed.

    Faces with other parameters than the patches' cannot keep derivatives by these: only what points tell is wanted.
    """
    first, second = (held[use.patch] for use in edge.uses)
    if first is None or second is None:
        return None
    label = f"{name}.{'-'.join(quilt.label(use) for use in edge.uses)}"
    if isinstance(first, _Split) or isinstance(second, _Split):
        others = _stretches(second, edge.second)
        others = [one.mirrored() for one in others] if edge.reversed else others
        split = check_split_edge(_stretches(first, edge.first), others, f"G{edge.order[1]}")
        return None if split is None else Joint(label, f"G{edge.order[1]}", split)
    backwards = edge.reversed ^ first.against(edge.first) ^ second.against(edge.second)
    sides = first.side(edge.first.side), second.side(edge.second.side)
    other: BSplineSurface | SeparableSurface | DerivableSurface = second.surface
    wanted, way = edge.order, backwards
    if max(first.gap, second.gap) > tolerance:
        wanted, other, way = f"G{edge.order[1]}", paced(second.surface, sides[1], first.surface, sides[0]), False
    found = check_edge(first.surface, sides[0], other, sides[1], reversed=way)
    order = found.geometric_order
    if not found.meets(wanted):
        limits = rounding_limits((first.surface, second.surface), sides, (first.moved, second.moved), found.curvature)
        order = check_edge(first.surface, sides[0], other, sides[1], reversed=way, thresholds=limits).geometric_order
    figures = (found.gap[1], found.normal_angle_deg, found.curvature_jump, found.curvature_rate_jump)
    orders = found.parametric_order, order
    report = JoinReport(*figures, 0.0, found.parametric_jumps, *orders)
    return Joint(label, wanted, report)


def _less_sure(whole: Row, quilt: Quilt, found: Sequence[Joint | None]) -> Row:
    """The whole with a remark on edges that were not compared: not proved if more than a common edge is asked there."""
    open_edges = [edge for edge, joint in zip(quilt.edges, found, strict=True) if joint is None]
    if not open_edges:
        return whole
    asked = whole.verdict == "proved" and any(edge.order[1] != "0" for edge in open_edges)
    remark = f"{len(open_edges)} of {len(quilt.edges)} shared edges not compared"
    return replace(whole, verdict="estimated" if asked else whole.verdict, remark=joined(whole.remark, remark))


# --- the whole body ---------------------------------------------------------------------------------------------------


def _whole(
    name: str,
    shape: Quilt | Solid,
    pieces: Sequence[Piece],
    others: Sequence[Piece],
    rows: Sequence[Row],
    tolerance: float,
) -> Row:
    """The verdict on the shell or solid: the worst of its faces', and whether it is what the model says.

    A wall is never proved: of the faces that its patches do not make only the volume tells.
    """
    if not pieces:
        return Row(name, "missing")
    numbers = tuple(sorted({piece.index for piece in (*pieces, *others)}))
    worst = max((row.verdict for row in rows), key=_ORDER.index)
    deviations = [row.deviation for row in rows if row.deviation is not None]
    deviation = tuple(np.max(deviations, axis=0).tolist()) if len(deviations) == len(rows) else None
    bodies = {id(piece.part.body): piece.part.body for piece in (*pieces, *others)}
    count = len(pieces) + len(others)
    if len(bodies) > 1 or (count > 1 and None in bodies.values()):
        return Row(name, "failed", deviation, remark="its faces are not one shell or solid in the file", face=numbers)
    body = next(iter(bodies.values()))
    problems, fact = _problems(shape, body, others, tolerance)
    if problems:
        worst = max(worst, "failed", key=_ORDER.index)
    if isinstance(shape, Solid) and shape.thickness is not None:  # how far its other faces are off nobody has measured
        worst = max(worst, "estimated", key=_ORDER.index)
        return Row(name, worst, None, "patches, and the wall's volume", joined(*problems) or fact, face=numbers)
    return Row(name, worst, deviation, "all faces", joined(*problems) or fact, face=numbers)


def _problems(
    shape: Quilt | Solid, body: BodyFacts | None, others: Sequence[Piece], tolerance: float
) -> tuple[list[str], str]:
    """What is wrong with the body, and what it is."""
    problems = _strangers(shape, others, tolerance)
    if body is None:
        return problems + (["a face, not a solid"] if isinstance(shape, Solid) else []), ""
    if isinstance(shape, Solid) and body.kind != "solid":
        problems.append(f"a {body.kind}, not a solid")
    if not isinstance(shape, Solid) and body.kind != "shell":
        problems.append(f"a {body.kind}, not a shell")
    if not body.valid:
        problems.append("the kernel calls it invalid")
    if not body.closed and (isinstance(shape, Solid) or shape.closed):
        problems.append("not closed: an edge is not in two faces")
    if problems or not isinstance(shape, Solid):
        return problems, "closed shell" if body.closed else "shell"
    held = body.volume()
    fact = f"closed solid, {float(held):.9g} mm^3 by the kernel"
    wanted = _volume(shape, tolerance)
    if wanted is None:
        return [], f"{fact}, which is not compared"
    exact, allowed = wanted
    if abs(held - exact) <= allowed + held.error + exact.error:
        return [], fact
    return [f"{fact}, but the model's volume is {float(exact):.9g} mm^3"], fact


def _strangers(shape: Quilt | Solid, others: Sequence[Piece], tolerance: float) -> list[str]:
    """Whether the body has other faces than it should, as far as that is known: not of walls.

    A cap may be in several faces, each in its plane.
    """
    if isinstance(shape, Solid) and shape.thickness is not None:
        return []
    loops = shape.loops if isinstance(shape, Solid) else ()
    more = len(others)
    if more == len(loops):
        return []
    wanted = ""
    if loops:
        assert isinstance(shape, Solid)
        rims = [np.concatenate([_points(shape.quilt, use) for use in loop]) for loop in loops]
        on = [{k for k, rim in enumerate(rims) if _in_plane(piece.figure.marks, rim, tolerance)} for piece in others]
        if all(on) and set().union(*on) == set(range(len(rims))):
            return []
        wanted = f", it should have {len(loops)} for caps"
    return [f"{more} face{'' if more == 1 else 's'} besides those of patches{wanted}"]


def _in_plane(points: Array, rim: Array, tolerance: float) -> bool:
    """Whether points lie in the plane of a rim."""
    middle = rim.mean(axis=0)
    normal = np.linalg.svd(rim - middle)[2][2]
    return bool(np.abs((points - middle) @ normal).max() <= 2 * tolerance)


def _volume(solid: Solid, tolerance: float) -> tuple[Estimate, float] | None:
    """The exact volume, and how much a body within the tolerance may be off; None where it is not known."""
    full = solid.volume()
    if full is not None:
        return full, tolerance * solid.closed.area()
    thickness, quilt = solid.thickness, solid.quilt
    assert thickness is not None
    if (solid.caps == "planar" and quilt.free) or crease(quilt, SMOOTH * tolerance / abs(thickness)) is not None:
        return None
    exact = wall_volume(quilt, thickness)
    offset = abs(exact - wall_volume(quilt, _THINNER * thickness)) / ((1 - _THINNER) * abs(thickness))
    rims = sum(_length(quilt, use) for use in quilt.free) * abs(thickness)
    return exact, tolerance * (quilt.area() + offset + rims)


def _length(quilt: Quilt, use: Use) -> float:
    """Of a side, as that of a polygon."""
    return float(np.linalg.norm(np.diff(_points(quilt, use), axis=0), axis=1).sum())


def _points(quilt: Quilt, use: Use) -> Array:
    """Points along a side."""
    t = np.linspace(0.0, 1.0, 65)
    fixed = np.full_like(t, float(use.side[1]))
    u, v = (fixed, t) if use.side[0] == "u" else (t, fixed)
    return quilt.patches[use.patch].evaluate(u, v)
