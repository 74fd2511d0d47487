"""The edges of a file held against a chain of curves: every piece, and every joint."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.composite import Composite
from gtcad.continuity import Derivable, JoinReport, check_join
from gtcad.converters.bspline import BSplineCurve
from gtcad.converters.certificate import certify_curve, deciding
from gtcad.converters.chain import as_curve, joint_knots, parts_of, runs_of
from gtcad.converters.part import EllipseArc, Part
from gtcad.converters.verdicts import Row, compared
from gtcad.errors import InputError
from gtcad.protocol import SeparableCurve
from gtcad.restricted import RestrictedCurve

Array = NDArray[np.float64]

_GUESS = np.linspace(0.0, 1.0, 17)
_NEAR = 0.05  # of the largest piece: when edges are too few or too many, one this near stands for a piece, good or bad
_APART = 1e100  # what stands for an infinite gap


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

    part: Part
    edge: BSplineCurve | EllipseArc
    pieces: tuple[SeparableCurve, ...]
    run: range
    backwards: bool


def check_chain(
    name: str, chain: Composite, parts: Sequence[Part], tolerance: float
) -> tuple[list[Row], list[Joint], list[Part]]:
    """Hold the edges that a file has for a chain against its pieces.

    Parameters
    ----------
    name
        Of the chain: its pieces and joints are called after it.
    chain
        In space, in mm.
    parts
        The edges, each for a piece, for pieces joined C1 to C3, for as many pieces as the others, or one for all; in
        any order and direction.
    tolerance
        In mm.

    Returns
    -------
    rows, joints, extra
        A row for each piece, or one for the chain when the edges do not correspond to its pieces; the joints between
        pieces that the file has; the edges that stand for no piece.
    """
    names = [f"{name} #{k + 1}" for k in range(len(chain.pieces))]
    if not parts:
        return [Row(name, "missing")], [], []
    if not all(isinstance(part.geometry, BSplineCurve | EllipseArc) for part in parts):
        return [Row(name, "missing", remark="the file holds a face of this name, not an edge")], [], []
    if not all(part.valid for part in parts):
        return [Row(name, "invalid", remark="the kernel calls an edge of it invalid")], [], []
    held = _held(chain, parts)
    if not held:
        remark = f"the file holds {len(parts)} edges for {len(names)} pieces, which do not correspond"
        return [Row(name, "undecided", remark=remark)], [], []
    rows = {k: row for one in held for k, row in _rows(one, names, tolerance)}
    ends = {k: curve for one in held for k, curve in zip(one.run, _derivables(one), strict=True)}
    joints = []
    for k, wanted in enumerate(chain.orders):
        following = (k + 1) % len(names)
        if k in ends and following in ends:
            joints.append(Joint(f"{name} #{k + 1}-#{following + 1}", wanted, check_join(ends[k], ends[following])))
    used = {id(one.part) for one in held}
    extra = [part for part in parts if id(part) not in used]
    return [rows.get(k, Row(name, "missing")) for k, name in enumerate(names)], joints, extra


def _held(chain: Composite, parts: Sequence[Part]) -> list[_Held]:
    """Runs of pieces with the edges that are nearest to them; none when there is no such correspondence."""
    count, size = len(chain.pieces), -(-len(chain.pieces) // len(parts))
    even = tuple(range(k, min(k + size, count)) for k in range(0, count, size))
    for runs in (runs_of(chain), even):
        if len(runs) == len(parts) and len(found := _matched(chain, runs, parts, math.inf)) == len(runs):
            return found
    extent = max(float(np.ptp(piece.coefficients, axis=0).max()) for piece in chain.pieces)
    runs = runs_of(chain)  # too few edges, or too many
    found = _matched(chain, runs, parts, _NEAR * extent)
    return found if len(found) == min(len(runs), len(parts)) else []


def _matched(chain: Composite, runs: Sequence[range], parts: Sequence[Part], farthest: float) -> list[_Held]:
    """The assignment of edges to runs of the least sum of gaps, those below a limit."""
    from scipy.optimize import linear_sum_assignment

    best = [[min(_ways(chain, run, part), key=lambda way: way[0]) for part in parts] for run in runs]
    gaps = np.array([[gap for gap, _ in row] for row in best])
    pairs = zip(*linear_sum_assignment(np.minimum(gaps, _APART)), strict=True)
    return [best[run][part][1] for run, part in pairs if gaps[run, part] < farthest]


def _ways(chain: Composite, run: range, part: Part) -> Iterator[tuple[float, _Held]]:
    """The edge along the pieces, and against them, with the gaps."""
    assert isinstance(part.geometry, BSplineCurve | EllipseArc)
    along = tuple(chain.pieces[k] for k in run)
    against = tuple(RestrictedCurve(piece, (1.0, 0.0)) for piece in reversed(along))
    for pieces in (along, against):
        held = _Held(part, part.geometry, pieces, run, pieces is against)
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
    if len(numbers) == 1 or not isinstance(held.edge, BSplineCurve):
        for k, piece, part in zip(numbers, held.pieces, parts, strict=True):
            yield k, compared(names[k], piece, replace(held.part, geometry=part), tolerance)
        return
    windows = pairwise(joint_knots(held.edge, len(numbers)))
    for k, piece, part, window in zip(numbers, held.pieces, parts, windows, strict=True):
        proof = deciding(partial(certify_curve, piece, held.edge, window=window), tolerance)
        if proof.upper <= tolerance:
            yield k, Row(names[k], "proved", (proof.lower, proof.upper), "equal parameters")
        else:
            row = compared(names[k], piece, replace(held.part, geometry=part), tolerance)
            yield k, replace(row, verdict="estimated") if row.verdict == "proved" else row  # of a part with rounding


@dataclass(frozen=True)
class _Backwards:
    """A curve from its other end."""

    curve: Derivable

    @property
    def domain(self) -> tuple[float, float]:
        return self.curve.domain

    def derivative(self, t: ArrayLike, order: int = 1) -> Array:
        first, last = self.domain
        return (-1.0) ** order * self.curve.derivative(first + last - np.asarray(t, dtype=np.float64), order)


def _derivables(held: _Held) -> list[Derivable]:
    """What the edge holds of each piece, in the direction of the chain."""
    parts = [as_curve(part) for part in parts_of(held.edge, held.pieces)]
    return [_Backwards(part) for part in reversed(parts)] if held.backwards else parts
