"""The faces of a file held against a quilt or a solid: every patch, every shared edge, and what they enclose."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gtcad.continuity import JoinReport
from gtcad.converters.bspline import BSplineSurface
from gtcad.converters.chain_check import Joint
from gtcad.converters.part import BodyFacts, Part
from gtcad.converters.verdicts import Row, Verdict, compared, joined
from gtcad.edge_check import check_edge
from gtcad.protocol import SeparableSurface
from gtcad.quilt import Quilt, SharedEdge
from gtcad.solid import Solid

_ORDER: tuple[Verdict, ...] = ("proved", "estimated", "undecided", "failed", "invalid", "missing")


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
        Its faces, those of patches by name or else first and in order.
    tolerance
        In mm.

    Returns
    -------
    rows
        One for the whole, one for each patch.
    joints
        One for each shared edge.
    """
    quilt = shape.quilt if isinstance(shape, Solid) else shape
    found = _by_patch(name, quilt, parts)
    rows = [
        _row(f"{name}.{patch}", surface, part, tolerance)
        for patch, surface, part in zip(quilt.names, quilt.patches, found, strict=True)
    ]
    joints = [joint for edge in quilt.edges if (joint := _joint(name, quilt, edge, found)) is not None]
    return [_whole(name, shape, parts, rows, tolerance), *rows], joints


def _by_patch(name: str, quilt: Quilt, parts: Sequence[Part]) -> list[Part | None]:
    named = {part.name: part for part in parts}
    wanted = [f"{name}.{patch}" for patch in quilt.names]
    if any(one in named for one in wanted):
        return [named.get(one) for one in wanted]
    return [parts[k] if k < len(parts) else None for k in range(len(wanted))]


def _row(name: str, surface: SeparableSurface, part: Part | None, tolerance: float) -> Row:
    if part is None or not isinstance(part.geometry, BSplineSurface):
        return Row(name, "missing")
    if not part.valid:
        return Row(name, "invalid", remark="the kernel calls it invalid")
    return compared(name, surface, part, tolerance)


def _joint(name: str, quilt: Quilt, edge: SharedEdge, parts: Sequence[Part | None]) -> Joint | None:
    """What happens at an edge in the file; None where a face is missing or runs otherwise than its patch."""
    sides = []
    for use in edge.uses:
        part = parts[use.patch]
        if part is None or not isinstance(part.geometry, BSplineSurface) or part.trimmed:
            return None
        if not _runs_alike(quilt.patches[use.patch], part.geometry):
            return None
        sides += [part.geometry, use.side]
    found = check_edge(*sides, reversed=edge.reversed)  # type: ignore[arg-type]
    figures = (found.gap[1], found.normal_angle_deg, found.curvature_jump, found.curvature_rate_jump)
    report = JoinReport(*figures, torsion_jump=0.0, parametric_jumps=found.parametric_jumps, order=found.order)
    first, second = (quilt.label(use) for use in edge.uses)
    return Joint(f"{name}.{first}-{second}", edge.order, report)


def _runs_alike(surface: SeparableSurface, spline: BSplineSurface) -> bool:
    """Whether a spline has its corners, and the middles of its sides, where the patch has them."""
    x = np.array([0.0, 0.5, 1.0])
    (u0, u1), (v0, v1) = spline.domain
    model = surface.evaluate(x[:, None], x[None, :])
    held = spline.evaluate(u0 + (u1 - u0) * x[:, None], v0 + (v1 - v0) * x[None, :])
    gap = np.linalg.norm(model - held, axis=-1)
    others = (model[::-1], model[:, ::-1], model[::-1, ::-1], *_transposes(model))
    least = min(float(np.linalg.norm(other - held, axis=-1).max()) for other in others)
    return bool(gap.max() <= 1.01 * least + 1e-9 * np.abs(model).max())


def _transposes(model: np.ndarray) -> tuple[np.ndarray, ...]:
    turned = model.swapaxes(0, 1)
    return turned, turned[::-1], turned[:, ::-1], turned[::-1, ::-1]


def _whole(name: str, shape: Quilt | Solid, parts: Sequence[Part], rows: Sequence[Row], tolerance: float) -> Row:
    """The verdict on the shell or solid: the worst of its faces', and whether it is what the model says."""
    if not parts:
        return Row(name, "missing")
    worst = max((row.verdict for row in rows), key=_ORDER.index)
    deviations = [row.deviation for row in rows if row.deviation is not None]
    deviation = tuple(np.max(deviations, axis=0).tolist()) if len(deviations) == len(rows) else None
    bodies = {id(part.body): part.body for part in parts}
    body = next(iter(bodies.values()))
    if len(parts) > 1 and (body is None or len(bodies) > 1):
        return Row(name, "failed", deviation, remark="its faces are not one shell or solid in the file")
    remark, ok = _body_remark(shape, body, tolerance)
    if not ok:
        worst = max(worst, "failed", key=_ORDER.index)
    return Row(name, worst, deviation, "all faces", remark)


def _body_remark(shape: Quilt | Solid, body: BodyFacts | None, tolerance: float) -> tuple[str, bool]:
    """What is to be said of the body, and whether it is right."""
    if body is None:
        return ("", not isinstance(shape, Solid))
    wanted_closed = isinstance(shape, Solid) or shape.closed
    problems = []
    if isinstance(shape, Solid) and body.kind != "solid":
        problems.append(f"a {body.kind}, not a solid")
    if not body.valid:
        problems.append("the kernel calls it invalid")
    if wanted_closed and not body.closed:
        problems.append("not closed: an edge is in one face only")
    remark = joined(*problems)
    if problems or not isinstance(shape, Solid):
        return remark or ("closed shell" if body.closed else "shell"), not problems
    held = body.volume()
    text = f"closed solid, {float(held):.9g} mm^3 by the kernel"
    if shape.thickness is not None or shape.caps != "none":
        return text, True
    exact, allowed = shape.quilt.volume(), tolerance * shape.quilt.area()
    if abs(held - exact) <= allowed + held.error + exact.error:
        return text, True
    return f"{text}, but the model's volume is {float(exact):.9g} mm^3", False
