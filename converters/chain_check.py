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
from gtcad.converters.arcs import certify_chain_arc
from gtcad.converters.bspline import BSplineCurve
from gtcad.converters.certificate import certify_curve, deciding
from gtcad.converters.chain import joint_knots, pieces_of, runs_of
from gtcad.converters.part import EllipseArc, Part
from gtcad.converters.verdicts import Row, compared
from gtcad.errors import InputError
from gtcad.protocol import SeparableCurve
from gtcad.restricted import RestrictedCurve

Array = NDArray[np.float64]

_GUESS = np.linspace(0.0, 1.0, 17)


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
    """An edge with the pieces that it stands for, in the edge's direction."""

    part: Part
    edge: BSplineCurve | EllipseArc
    pieces: tuple[SeparableCurve, ...]
    run: range
    backwards: bool


def check_chain(name: str, chain: Composite, parts: Sequence[Part], tolerance: float) -> tuple[list[Row], list[Joint]]:
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
    """
    names = [f"{name} #{k + 1}" for k in range(len(chain.pieces))]
    if not parts:
        return [Row(name, "missing")], []
    if not all(part.valid for part in parts):
        return [Row(name, "invalid", remark="the kernel calls an edge of it invalid")], []
    held = _held(chain, parts)
    if held is None:
        remark = f"the file holds {len(parts)} edges for {len(chain.pieces)} pieces, which do not correspond"
        return [Row(name, "undecided", remark=remark)], []
    rows = {k: row for one in held for k, row in _rows(one, names, tolerance)}
    ends = [part for one in sorted(held, key=lambda one: one.run.start) for part in _derivables(one)]
    following = [*ends[1:], ends[0]]
    joints = [
        Joint(f"{name} #{k + 1}-#{(k + 1) % len(names) + 1}", wanted, check_join(ends[k], following[k]))
        for k, wanted in enumerate(chain.orders)
    ]
    return [rows[k] for k in range(len(names))], joints


def _held(chain: Composite, parts: Sequence[Part]) -> list[_Held] | None:
    """Each run of pieces with the edge that is nearest to it; None when there is no such correspondence."""
    count, size = len(chain.pieces), -(-len(chain.pieces) // len(parts))
    even = tuple(range(k, min(k + size, count)) for k in range(0, count, size))
    left, result = list(parts), []
    for run in next((runs for runs in (runs_of(chain), even) if len(runs) == len(parts)), ()):
        ways = [(_gap(way), k, way) for k, part in enumerate(left) for way in _ways(chain, run, part)]
        gap, k, best = min(ways, key=lambda way: way[0])
        if gap == math.inf:
            return None
        result.append(best)
        del left[k]
    return result or None


def _ways(chain: Composite, run: range, part: Part) -> Iterator[_Held]:
    """The edge along the pieces, and against them."""
    assert isinstance(part.geometry, BSplineCurve | EllipseArc)
    pieces = tuple(chain.pieces[k] for k in run)
    yield _Held(part, part.geometry, pieces, run, False)
    yield _Held(part, part.geometry, tuple(RestrictedCurve(one, (1.0, 0.0)) for one in reversed(pieces)), run, True)


def _gap(held: _Held) -> float:
    """Distance of points that correspond where pieces meet, and about in between; infinite without knots there."""
    try:
        parts = pieces_of(held.edge, held.pieces)
    except InputError:
        return math.inf
    gaps = [
        np.abs(piece.evaluate(_GUESS[[0, -1]]) - part.derivative(np.array(part.domain), 0)).max()
        for piece, part in zip(held.pieces, parts, strict=True)
    ]
    middle = [
        np.linalg.norm(piece.evaluate(_GUESS)[:, None] - _along(part)[None], axis=-1).min(axis=1).max()
        for piece, part in zip(held.pieces, parts, strict=True)
    ]
    return float(max(*gaps, *middle))


def _along(part: Derivable) -> Array:
    return part.derivative(np.linspace(*part.domain, 65), 0)


def _rows(held: _Held, names: Sequence[str], tolerance: float) -> Iterator[tuple[int, Row]]:
    """The number and the verdict of each piece."""
    numbers = tuple(reversed(held.run)) if held.backwards else tuple(held.run)
    if len(numbers) == 1:
        yield numbers[0], compared(names[numbers[0]], held.pieces[0], held.part, tolerance)
        return
    if isinstance(held.edge, EllipseArc):
        certificates = certify_chain_arc(Composite(held.pieces, ("C0",) * (len(held.pieces) - 1)), held.edge)
        method = "equal angles"
    else:
        windows = pairwise(joint_knots(held.edge, len(numbers)))
        certificates = tuple(
            deciding(partial(certify_curve, piece, held.edge, window=window), tolerance)
            for piece, window in zip(held.pieces, windows, strict=True)
        )
        method = "equal parameters"
    for k, piece, proof, part in zip(
        numbers, held.pieces, certificates, pieces_of(held.edge, held.pieces), strict=True
    ):
        if proof.upper <= tolerance:
            yield k, Row(names[k], "proved", (proof.lower, proof.upper), method)
        elif isinstance(part, BSplineCurve):
            yield k, compared(names[k], piece, replace(held.part, geometry=part), tolerance)
        else:
            yield k, Row(names[k], "undecided", (proof.lower, proof.upper), method)


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
    parts = pieces_of(held.edge, held.pieces)
    return [_Backwards(part) for part in reversed(parts)] if held.backwards else parts
