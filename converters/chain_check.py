"""The edges of a file held against a chain of curves: every piece, and every joint."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gtcad.composite import Composite
from gtcad.continuity import JoinReport
from gtcad.converters.bspline import BSplineCurve
from gtcad.converters.certificate import certify_curve, deciding
from gtcad.converters.chain import as_curve, joint_knots, parts_of, runs_of
from gtcad.converters.figures import Piece, figure_of, figure_of_part
from gtcad.converters.part import EllipseArc, ends_of
from gtcad.converters.rounding import End, check_rounded_join, rounded_by
from gtcad.converters.spline_parts import part_of_curve
from gtcad.converters.verdicts import Row, compared, joined
from gtcad.errors import InputError
from gtcad.protocol import SeparableCurve
from gtcad.restricted import RestrictedCurve

Array = NDArray[np.float64]

_GUESS = np.linspace(0.0, 1.0, 17)
_NEAR = 0.05  # of the largest piece: when edges are too few or too many, one this near stands for a piece, good or bad
_APART = 1e100  # what stands for an infinite gap
_LOOKED_AT = 4  # edges for each run, and runs for each edge
_ON = 4.0  # tolerances: a point that near lies on an edge
_KNOT = 1e-6  # of the domain: a place that near to a knot is it
_UNITS = 1e-14  # rounding of the ends of a part of an arc, of its size


@dataclass(frozen=True)
class Joint:
    """A joint of a chain, as the file has it.

    Attributes
    ----------
    name
        The chain's name and the numbers of both pieces, from 1.
    wanted
        The order that the model asks for.
    report
        What was found in the file; within gtcad.continuity.Thresholds, a length in mm.
    """

    name: str
    wanted: str
    report: JoinReport

    @property
    def kept(self) -> bool:
        """Whether the order is met."""
        return self.report.meets(self.wanted)


@dataclass(frozen=True)
class _Held:
    """An edge with the pieces that it stands for, in the edge's direction; their numbers are in the chain's."""

    piece: Piece
    edge: BSplineCurve | EllipseArc
    pieces: tuple[SeparableCurve, ...]
    run: range
    backwards: bool


@dataclass(frozen=True)
class _Checked:
    """What was found of a chain in one way to look at it."""

    rows: list[Row]
    joints: list[Joint]
    used: set[int]

    @property
    def bad(self) -> int:
        """How many rows are neither proved nor estimated."""
        return sum(row.verdict not in ("proved", "estimated") for row in self.rows)


def check_chain(
    name: str, chain: Composite, held: Sequence[Piece], tolerance: float
) -> tuple[list[Row], list[Joint], list[Piece]]:
    """Hold the edges that a file has for a chain against its pieces.

    Parameters
    ----------
    name
        Of the chain: its pieces and joints are called after it.
    chain
        In space, in mm.
    held
        Edges, in any order and direction.
    tolerance
        In mm.

    Returns
    -------
    rows, joints, extra
        One row for each piece, or one for the chain when it has no edges at all; a joint for each pair of pieces that
        the file has; the edges that stand for no piece.

    Notes
    -----
    Edges that stand for one or several whole pieces are held against these. Where they do not, they are cut where the
    pieces meet, and each part is held against the piece that it lies along.
    """
    if not held:
        return [Row(name, "missing")], [], []
    if not all(piece.figure.variables == 1 for piece in held):
        return [Row(name, "missing", remark="the file holds a face of this name, not an edge")], [], []
    if not all(piece.part.valid for piece in held):
        return [Row(name, "invalid", remark="the kernel calls an edge of it invalid")], [], []
    names = [f"{name} #{k + 1}" for k in range(len(chain.pieces))]
    found = _by_correspondence(name, names, chain, held, tolerance)
    if found is None or found.bad:
        other = _by_place(name, names, chain, held, tolerance)
        found = other if found is None or other.bad < found.bad else found
    rows = _less_sure(name, chain, found)
    return rows, found.joints, [piece for piece in held if piece.index not in found.used]


def _less_sure(name: str, chain: Composite, found: _Checked) -> list[Row]:
    """The rows, none of them proved where an order is asked for at a joint that was not compared."""
    rows, known_ones = list(found.rows), {joint.name for joint in found.joints}
    for k, wanted in enumerate(chain.orders):
        both = k, (k + 1) % len(rows)
        known = _joint_name(name, *both) in known_ones or wanted[1] == "0"
        if known or not {rows[i].verdict for i in both} <= {"proved", "estimated"}:
            continue
        for i in both:
            remark = joined(rows[i].remark, f"the joint of {both[0] + 1} and {both[1] + 1} not compared")
            rows[i] = replace(rows[i], verdict="estimated", remark=remark)
    return rows


# --- edges of whole pieces --------------------------------------------------------------------------------------------


def _by_correspondence(
    name: str, names: Sequence[str], chain: Composite, held: Sequence[Piece], tolerance: float
) -> _Checked | None:
    found = _runs_held(chain, held)
    if not found:
        return None
    rows = {k: row for one in found for k, row in _rows(one, names, tolerance)}
    ends = {k: curve for one in found for k, curve in zip(one.run, _ends(one), strict=True)}
    joints = []
    for k, wanted in enumerate(chain.orders):
        following = (k + 1) % len(names)
        if k in ends and following in ends:
            report = check_rounded_join(ends[k], ends[following], wanted)
            joints.append(Joint(_joint_name(name, k, following), wanted, report))
    every = [rows.get(k, Row(one, "missing")) for k, one in enumerate(names)]
    return _Checked(every, joints, {one.piece.index for one in found})


def _joint_name(name: str, k: int, following: int) -> str:
    return f"{name} #{k + 1}-#{following + 1}"


def _runs_held(chain: Composite, held: Sequence[Piece]) -> list[_Held]:
    """Runs of pieces with the edges that are nearest to them; none when there is no such correspondence."""
    count, size = len(chain.pieces), -(-len(chain.pieces) // len(held))
    even = tuple(range(k, min(k + size, count)) for k in range(0, count, size))
    for runs in (runs_of(chain), even):
        if len(runs) == len(held) and len(found := _matched(chain, runs, held, math.inf)) == len(runs):
            return found
    extent = max(float(np.ptp(piece.coefficients, axis=0).max()) for piece in chain.pieces)
    runs = runs_of(chain)  # too few edges, or too many
    found = _matched(chain, runs, held, _NEAR * extent)
    return found if len(found) == min(len(runs), len(held)) else []


def _matched(chain: Composite, runs: Sequence[range], held: Sequence[Piece], farthest: float) -> list[_Held]:
    """The assignment of edges to runs of the least sum of gaps, those below a limit."""
    from scipy.optimize import linear_sum_assignment

    gaps = _end_gaps(chain, runs, held)
    near = (gaps.argsort(axis=1).argsort(axis=1) < _LOOKED_AT) | (gaps.argsort(axis=0).argsort(axis=0) < _LOOKED_AT)
    best: dict[tuple[int, int], _Held] = {}
    for k, j in np.argwhere(near).tolist():
        gaps[k, j], best[k, j] = min(_ways(chain, runs[k], held[j]), key=lambda way: way[0])
    pairs = zip(*linear_sum_assignment(np.minimum(gaps, _APART)), strict=True)
    return [best[k, j] for k, j in pairs if gaps[k, j] < farthest and (k, j) in best]


def _end_gaps(chain: Composite, runs: Sequence[range], held: Sequence[Piece]) -> Array:
    """How far the ends of edges are from those of runs, shape (runs, edges): bounds of the gaps from below."""
    wanted = np.array([[chain.pieces[run[0]].evaluate(0.0), chain.pieces[run[-1]].evaluate(1.0)] for run in runs])
    given = np.array([piece.figure.points.evaluate(np.array([[0.0], [1.0]])) for piece in held])
    ways = [np.linalg.norm(wanted[:, None] - own, axis=-1).max(axis=-1) for own in (given, given[:, ::-1])]
    return np.asarray(np.minimum(*ways))


def _ways(chain: Composite, run: range, piece: Piece) -> Iterator[tuple[float, _Held]]:
    """The edge along the pieces, and against them, with the gaps."""
    edge = _edge(piece)
    along = tuple(chain.pieces[k] for k in run)
    against = tuple(RestrictedCurve(one, (1.0, 0.0)) for one in reversed(along))
    for pieces in (along, against):
        held = _Held(piece, edge, pieces, run, pieces is against)
        yield _gap(held), held


def _gap(held: _Held) -> float:
    """Distance of points that correspond where pieces meet, and about in between; infinite without knots there."""
    try:
        parts = parts_of(held.edge, held.pieces)
    except InputError:
        return math.inf
    largest = 0.0
    for piece, part in zip(held.pieces, map(as_curve, parts), strict=True):
        points, along = piece.evaluate(_GUESS), part.derivative(np.linspace(*part.domain, 65), 0)
        middle = np.linalg.norm(points[:, None] - along, axis=-1).min(axis=1)
        ends = np.linalg.norm(points[[0, -1]] - along[[0, -1]], axis=-1)
        largest = max(largest, float(middle.max()), float(ends.max()))
    return largest


def _rows(held: _Held, names: Sequence[str], tolerance: float) -> Iterator[tuple[int, Row]]:
    """The number and the verdict of each piece."""
    numbers = tuple(reversed(held.run)) if held.backwards else tuple(held.run)
    parts = parts_of(held.edge, held.pieces)
    rounding = _rounding(held.edge) if len(numbers) > 1 else 0.0
    windows: Sequence[tuple[int, int] | None] = [None] * len(numbers)
    if len(numbers) > 1 and isinstance(held.edge, BSplineCurve):
        windows = list(pairwise(joint_knots(held.edge, len(numbers))))
    for k, piece, part, window in zip(numbers, held.pieces, parts, windows, strict=True):
        edge = replace(figure_of_part(replace(held.piece.part, geometry=part)), rounding=rounding)
        row = compared(names[k], figure_of(piece), [edge], tolerance)
        if window is not None and isinstance(held.edge, BSplineCurve):  # without the rounding of cutting
            proof = deciding(partial(certify_curve, piece, held.edge, window=window), tolerance)
            if proof.upper <= tolerance:
                row = replace(row, verdict="proved", deviation=(proof.lower, proof.upper), method="equal parameters")
        yield k, replace(_turned(row) if held.backwards else row, face=(held.piece.index,))


def _rounding(edge: BSplineCurve | EllipseArc) -> float:
    """Of the parts of an edge, in mm."""
    if isinstance(edge, EllipseArc):
        return _UNITS * float(np.abs(ends_of(edge)).max() + np.linalg.norm(edge.axis_a) + np.linalg.norm(edge.axis_b))
    first, last = edge.domain
    return part_of_curve(edge, (first, (first + last) / 2))[1]


def _turned(row: Row) -> Row:
    """The row of a piece that was looked at from its other end, its worst place in the piece's own parameter."""
    if row.worst is None:
        return row
    return replace(row, worst=replace(row.worst, parameters=(1.0 - row.worst.parameters[0],)))


def _ends(held: _Held) -> list[End]:
    """What the edge holds of each piece, in the direction of the chain."""
    moved = rounded_by(_numbers(held.edge))
    parts = [End(part, moved, held.backwards) for part in parts_of(held.edge, held.pieces)]
    return parts[::-1] if held.backwards else parts


def _numbers(edge: BSplineCurve | EllipseArc) -> Array:
    """The coordinates that a file has of an edge."""
    return edge.control_points if isinstance(edge, BSplineCurve) else np.vstack([edge.center, ends_of(edge)])


# --- edges of anything ------------------------------------------------------------------------------------------------


def _by_place(name: str, names: Sequence[str], chain: Composite, held: Sequence[Piece], tolerance: float) -> _Checked:
    """Every edge cut where pieces meet, and its parts held against the pieces that they lie along."""
    figures = [figure_of(piece) for piece in chain.pieces]
    meeting = [chain.pieces[k].evaluate(1.0) for k in range(len(chain.orders))]
    groups: list[list[Piece]] = [[] for _ in figures]
    whole = figure_of(chain)
    for piece in held:
        for part in _cut(piece, meeting, tolerance):
            along = whole.nearest(part.figure.marks[1:-1]).places[:, 0] * len(figures)
            counts = np.bincount(np.minimum(along.astype(int), len(figures) - 1))
            groups[int(counts.argmax())].append(part)
    rows = []
    for one, figure, group in zip(names, figures, groups, strict=True):
        if not group:
            rows.append(Row(one, "missing"))
            continue
        row = compared(one, figure, [part.figure for part in group], tolerance)
        rows.append(replace(row, face=tuple(dict.fromkeys(part.index for part in group))))
    joints = []
    moved = {piece.index: rounded_by(_numbers(_edge(piece))) for piece in held}
    for k, wanted in enumerate(chain.orders):
        following = (k + 1) % len(names)
        before, after = (_starting(groups[i], meeting[k], moved, tolerance) for i in (k, following))
        if before is not None and after is not None:
            report = check_rounded_join(before.reversed(), after, f"G{wanted[1]}")
            joints.append(Joint(_joint_name(name, k, following), f"G{wanted[1]}", report))
    return _Checked(rows, joints, {piece.index for piece in held})


def _cut(piece: Piece, points: Sequence[Array], tolerance: float) -> Iterator[Piece]:
    """The parts of an edge between those points that lie on it, away from its ends."""
    edge = _edge(piece)
    first, last = edge.domain if isinstance(edge, BSplineCurve) else (edge.start, edge.end)
    near = _KNOT * (last - first)
    places = [first, last]
    found = piece.figure.nearest(_beside(piece, np.array(points).reshape(-1, 3), _ON * tolerance))
    for x, far in zip(found.places[:, 0].tolist(), found.distances.tolist(), strict=True):
        t = first * (1 - x) + last * x
        if isinstance(edge, BSplineCurve):
            knot = float(edge.knots[np.abs(edge.knots - t).argmin()])
            t = knot if abs(knot - t) <= near else t
        apart = float(np.linalg.norm(ends_of(edge) - edge.evaluate(t), axis=1).min())
        if far <= _ON * tolerance < apart and min(abs(t - other) for other in places) > near:
            places.append(t)
    if len(places) == 2:
        yield piece
        return
    for a, b in pairwise(sorted(places)):
        part, rounding = _part(edge, a, b)
        held = replace(piece.part, geometry=part)
        yield Piece(piece.index, held, replace(figure_of_part(held), rounding=rounding))


def _beside(piece: Piece, points: Array, margin: float) -> Array:
    """The points that are about in the box of a piece."""
    low, high = piece.figure.box
    margin += piece.figure.points.reach
    return np.asarray(points[((points >= low - margin) & (points <= high + margin)).all(axis=1)])


def _part(edge: BSplineCurve | EllipseArc, a: float, b: float) -> tuple[BSplineCurve | EllipseArc, float]:
    if isinstance(edge, EllipseArc):
        return EllipseArc(edge.center, edge.axis_a, edge.axis_b, a, b), _rounding(edge)
    return part_of_curve(edge, (a, b))


def _starting(group: Sequence[Piece], point: Array, moved: Mapping[int, float], tolerance: float) -> End | None:
    """The part that begins or ends at a point, so that it begins there."""
    for part in group:
        gaps = np.linalg.norm(ends_of(_edge(part)) - point, axis=1)
        if gaps.min() <= _ON * tolerance:
            return End(_edge(part), moved[part.index], backwards=bool(gaps[1] < gaps[0]))
    return None


def _edge(piece: Piece) -> BSplineCurve | EllipseArc:
    edge = piece.part.geometry
    assert isinstance(edge, BSplineCurve | EllipseArc)
    return edge
