"""The faces of a file held against a quilt or a solid: every patch, every shared edge, and what they enclose."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gtcad.continuity import JoinReport
from gtcad.converters.bspline import BSplineSurface
from gtcad.converters.chain_check import Joint
from gtcad.converters.folds import crease
from gtcad.converters.part import BodyFacts, Part
from gtcad.converters.verdicts import Row, Verdict, compared, joined
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
    name: str, shape: Quilt | Solid, parts: Sequence[Part], tolerance: float
) -> tuple[list[Row], list[Joint]]:
    """Hold the faces that a file has for a quilt or a solid against its patches.

    Parameters
    ----------
    name
        Of the shape; its patches are called "name.patch".
    shape
        In mm.
    parts
        Its faces: those of patches by name, the others as they lie nearest to patches.
    tolerance
        In mm.

    Returns
    -------
    rows
        One for the whole, one for each patch.
    joints
        One for each shared edge of which the file has both faces untrimmed.
    """
    quilt = shape.quilt if isinstance(shape, Solid) else shape
    found = _by_patch(name, quilt, parts)
    rows = [
        _row(f"{name}.{patch}", surface, part, tolerance)
        for patch, surface, part in zip(quilt.names, quilt.patches, found, strict=True)
    ]
    held = [_held(surface, part) for surface, part in zip(quilt.patches, found, strict=True)]
    joints = [joint for edge in quilt.edges if (joint := _joint(name, quilt, edge, held)) is not None]
    more = len(parts) - sum(part is not None for part in found)
    return [_whole(name, shape, parts, rows, more, tolerance), *rows], joints


def _row(name: str, surface: SeparableSurface, part: Part | None, tolerance: float) -> Row:
    if part is None or not isinstance(part.geometry, BSplineSurface):
        return Row(name, "missing")
    if not part.valid:
        return Row(name, "invalid", remark="the kernel calls it invalid")
    return compared(name, surface, part, tolerance)


# --- which face is which patch ----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Held:
    """A face's spline and how it runs: its u along the v of the patch, and against the patch's u and v."""

    spline: BSplineSurface
    transposed: bool
    backwards: tuple[bool, bool]

    def side(self, side: str) -> str:
        """The spline's side for a side of the patch."""
        axis = "uv".index(side[0])
        return f"{'uv'[axis ^ self.transposed]}{int(side[1]) ^ self.backwards[axis]}"

    def against(self, use: Use) -> bool:
        """Whether the spline runs along the side against the patch."""
        return self.backwards["uv".index(use.along)]


def _by_patch(name: str, quilt: Quilt, parts: Sequence[Part]) -> list[Part | None]:
    """The face of each patch: by its name, or else the one that lies nearest, over all as near as possible."""
    from scipy.optimize import linear_sum_assignment

    named = {part.name: part for part in reversed(parts)}
    found = [named.get(f"{name}.{patch}") for patch in quilt.names]
    known = {id(part) for part in found if part is not None}
    left = [k for k, part in enumerate(found) if part is None]
    others = [
        part
        for part in parts
        if id(part) not in known
        and isinstance(part.geometry, BSplineSurface)
        and not (known and part.name.startswith(f"{name}."))
    ]
    gaps = np.array([[_ways(quilt.patches[k], part.geometry)[0] for part in others] for k in left])  # type: ignore[arg-type]
    if gaps.size:
        for row, column in zip(*linear_sum_assignment(gaps), strict=True):
            found[left[row]] = others[column]
    return found


def _held(surface: SeparableSurface, part: Part | None) -> _Held | None:
    if part is None or part.trimmed or not isinstance(part.geometry, BSplineSurface):
        return None
    return _Held(part.geometry, *_ways(surface, part.geometry)[1:])


def _ways(surface: SeparableSurface, spline: BSplineSurface) -> tuple[float, bool, tuple[bool, bool]]:
    """How far apart both are where the spline runs as it fits best, and how that is: transposed, backwards in u, v."""
    model = surface.evaluate(_PLACES[:, None], _PLACES[None, :])
    (u0, u1), (v0, v1) = spline.domain
    own = spline.evaluate((u0 * (1 - _PLACES) + u1 * _PLACES)[:, None], (v0 * (1 - _PLACES) + v1 * _PLACES)[None, :])
    ways = []
    for transposed, back_u, back_v in itertools.product((False, True), repeat=3):
        turned = own.swapaxes(0, 1) if transposed else own
        turned = turned[:: -1 if back_u else 1, :: -1 if back_v else 1]
        ways.append((float(np.linalg.norm(turned - model, axis=-1).max()), transposed, (back_u, back_v)))
    return min(ways)


def _joint(name: str, quilt: Quilt, edge: SharedEdge, held: Sequence[_Held | None]) -> Joint | None:
    """What happens at an edge in the file; None where a face is missing or trimmed."""
    first, second = (held[use.patch] for use in edge.uses)
    if first is None or second is None:
        return None
    backwards = edge.reversed ^ first.against(edge.first) ^ second.against(edge.second)
    sides = first.side(edge.first.side), second.side(edge.second.side)
    found = check_edge(first.spline, sides[0], second.spline, sides[1], reversed=backwards)
    figures = (found.gap[1], found.normal_angle_deg, found.curvature_jump, found.curvature_rate_jump)
    orders = found.parametric_order, found.geometric_order
    report = JoinReport(*figures, 0.0, found.parametric_jumps, *orders)
    labels = (quilt.label(use) for use in edge.uses)
    return Joint(f"{name}.{'-'.join(labels)}", edge.order, report)


# --- the whole body ---------------------------------------------------------------------------------------------------


def _whole(
    name: str, shape: Quilt | Solid, parts: Sequence[Part], rows: Sequence[Row], more: int, tolerance: float
) -> Row:
    """The verdict on the shell or solid: the worst of its faces', and whether it is what the model says."""
    if not parts:
        return Row(name, "missing")
    worst = max((row.verdict for row in rows), key=_ORDER.index)
    deviations = [row.deviation for row in rows if row.deviation is not None]
    deviation = tuple(np.max(deviations, axis=0).tolist()) if len(deviations) == len(rows) else None
    bodies = {id(part.body): part.body for part in parts}
    if len(bodies) > 1 or (len(parts) > 1 and None in bodies.values()):
        return Row(name, "failed", deviation, remark="its faces are not one shell or solid in the file")
    body = next(iter(bodies.values()))
    problems, fact = _problems(shape, body, more, tolerance)
    if problems:
        worst = max(worst, "failed", key=_ORDER.index)
    return Row(name, worst, deviation, "all faces", joined(*problems) or fact)


def _problems(shape: Quilt | Solid, body: BodyFacts | None, more: int, tolerance: float) -> tuple[list[str], str]:
    """What is wrong with the body, and what it is."""
    problems = _strangers(shape, more)
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


def _strangers(shape: Quilt | Solid, more: int) -> list[str]:
    """Whether the body has other faces than it should, as far as their number is known: not of walls."""
    if isinstance(shape, Solid) and shape.thickness is not None:
        return []
    caps = len(shape.loops) if isinstance(shape, Solid) else 0
    if more == caps:
        return []
    wanted = f", it should have {caps} for caps" if caps else ""
    return [f"{more} face{'' if more == 1 else 's'} besides those of patches{wanted}"]


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
    t = np.linspace(0.0, 1.0, 65)
    fixed = np.full_like(t, float(use.side[1]))
    u, v = (fixed, t) if use.side[0] == "u" else (t, fixed)
    return float(np.linalg.norm(np.diff(quilt.patches[use.patch].evaluate(u, v), axis=0), axis=1).sum())
