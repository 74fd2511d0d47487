"""Chains of curves with a wanted order of continuity at each joint."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad._chain_system import ChainSystem
from gtcad.basis import checked_order, is_whole
from gtcad.continuity import (
    PARAMETRIC,
    JoinReport,
    Scale,
    Thresholds,
    check_join,
    parsed_order,
)
from gtcad.curve import Curve
from gtcad.errors import InputError
from gtcad.protocol import SeparableCurve
from gtcad.restricted import RestrictedCurve

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Composite:
    """An ordered chain of curves, open or closed: piece i is the part over [i, i + 1] of its domain [0, pieces].

    Parameters
    ----------
    pieces
        The curves, of one dimension, each starting where the one before ends: curves of the protocol of any kind.
    orders
        The wanted order at each joint, "C0" to "G3": one less than the pieces, or as many when the chain is closed,
        the last one for the joint of the last piece with the first.
    closed
        Whether the last piece ends where the first starts.

    Raises
    ------
    InputError
        When the numbers or dimensions do not fit, or a piece is no curve of the protocol.

    Examples
    --------
    >>> chain = Composite((Curve([[0, 0], [1, 1], [2, 0]]), Curve([[2, 0], [3, -1], [4, 0]])), ("C1",))
    >>> chain.evaluate([0, 1, 2]).tolist()
    [[0.0, 0.0], [2.0, 0.0], [4.0, 0.0]]
    >>> [report.order for report in chain.report()]
    ['C1']
    """

    pieces: tuple[SeparableCurve, ...]
    orders: tuple[str, ...]
    closed: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "pieces", tuple(self.pieces))
        object.__setattr__(self, "orders", tuple(self.orders))
        for index, piece in enumerate(self.pieces):
            if not isinstance(piece, SeparableCurve):
                raise InputError(f"pieces[{index}] must be a single curve, got {type(piece).__name__}")
        if not self.pieces:
            raise InputError("a chain needs at least one piece")
        wanted = len(self.pieces) - (0 if self.closed else 1)
        if len(self.orders) != wanted:
            kind = "a closed" if self.closed else "an open"
            raise InputError(f"{kind} chain of {len(self.pieces)} pieces has {wanted} joints, got {len(self.orders)}")
        if len({piece.dimension for piece in self.pieces}) != 1:
            raise InputError(f"all pieces must have one dimension, got {[p.dimension for p in self.pieces]}")
        for order in self.orders:
            parsed_order(order)

    @classmethod
    def solved(
        cls,
        pieces: Sequence[Curve],
        orders: Sequence[str],
        *,
        closed: bool = False,
        scales: Sequence[Scale | None] | None = None,
        fixed: Sequence[tuple[int, int]] = (),
    ) -> Composite:
        """The chain that meets its orders and moves the designer's control points least (sum of squares).

        The scale factors are a local minimum, searched for from the drawn speeds on. Speeds at the joints that fall
        below a quarter of the drawn ones count like moves, so that no tangent vanishes.

        Parameters
        ----------
        pieces
            As the designer drew them; they need not join.
        orders, closed
            As of the class.
        scales
            (eta, psi, omega) for each G joint, eta > 0; None where they are free, and at C joints, which have none.
            All free unless given.
        fixed
            (piece, control point) pairs, from 0, that must stay where they are.

        Raises
        ------
        InputError
            When an argument is out of its range.
        SingularJoin
            When the joints cannot all be met, a control point at a joint is not determined, or a piece has no tangent
            at a joint that asks for one.

        Notes
        -----
        Each condition holds to 1e-11 of the chain's size, its coefficients scaled to norm 1. Points that meet are
        equal bit for bit.
        """
        drawn = Composite(tuple(pieces), tuple(orders), closed)
        places = checked_places("fixed", drawn.pieces, fixed)
        system = ChainSystem(_designed(drawn.pieces), drawn.orders, places)
        moved = system.moved(system.best_scales(_checked_scales(drawn.orders, scales)))
        return Composite(moved, drawn.orders, drawn.closed)

    @property
    def joints(self) -> tuple[tuple[SeparableCurve, SeparableCurve], ...]:
        """The pieces before and after each joint."""
        following = (*self.pieces[1:], self.pieces[0])
        return tuple(zip(self.pieces, following, strict=True))[: len(self.orders)]

    @property
    def dimension(self) -> int:
        """Space dimension d."""
        return self.pieces[0].dimension

    @property
    def domain(self) -> tuple[float, float]:
        """First and last parameter."""
        return 0.0, float(len(self.pieces))

    def evaluate(self, t: ArrayLike) -> Array:
        """Points at parameters in [0, number of pieces], shape t.shape + (d,)."""
        return self.derivative(t, 0)

    def derivative(self, t: ArrayLike, order: int = 1) -> Array:
        """Derivatives of the order, shape t.shape + (d,); at a joint those of the piece that starts there.

        Raises
        ------
        InputError
            When a parameter is outside the domain or the order is not a whole number from 0.
        """
        order = checked_order("order", order)
        values = np.asarray(t, dtype=np.float64)
        flat = values.reshape(-1)
        outside = ~((flat >= 0) & (flat <= len(self.pieces)))
        if outside.any():
            raise InputError(f"t must lie in [0, {len(self.pieces)}], got {flat[outside][0]}")
        places = np.minimum(flat.astype(int), len(self.pieces) - 1)
        result = np.empty((flat.size, self.dimension))
        for place in np.unique(places):
            here = places == place
            result[here] = self.pieces[place].derivative(flat[here] - place, order)
        return result.reshape(*values.shape, self.dimension)

    def report(self, *, thresholds: Thresholds | None = None) -> tuple[JoinReport, ...]:
        """What happens at each joint."""
        limits = thresholds or Thresholds()
        return tuple(check_join(a, b, thresholds=limits) for a, b in self.joints)

    def unmet(self, *, thresholds: Thresholds | None = None) -> str:
        """What is wrong with the first joint that does not meet its order; empty when all do."""
        for joint, (found, wanted) in enumerate(zip(self.report(thresholds=thresholds), self.orders, strict=True)):
            if not found.meets(wanted):
                what = found.order if found.order != "none" else f"a gap of {found.gap:.3g}"
                return f"joint {joint} must be {wanted}, it is {what}"
        return ""

    def touched(self, piece: int, control_point: int | None = None) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Local control: the joints that must be solved anew when a control point moves, and the pieces they change.

        Parameters
        ----------
        piece, control_point
            Which one; None for the design variables of the piece, which touch all its joints.

        Returns
        -------
        joints, pieces
            Indices. A joint reaches k + 1 control points into each side; joints that share a control point are solved
            together. The piece itself is always among the pieces.

        Raises
        ------
        InputError
            When there is no such control point, or a piece has none at all.
        """
        curves = _designed(self.pieces)
        given = (piece, 0 if control_point is None else control_point)
        ((piece, first),) = checked_places("touched", curves, [given])
        moved = {(piece, k) for k in (range(curves[piece].degree + 1) if control_point is None else (first,))}
        reaches = [self._reach(joint) for joint in range(len(self.orders))]
        joints: set[int] = set()
        while True:
            grown = {joint for joint, reach in enumerate(reaches) if reach & moved}
            if grown == joints:
                break
            joints = grown
            moved = moved.union(*(reaches[joint] for joint in joints))
        return tuple(sorted(joints)), tuple(
            sorted({piece} | {place[0] for joint in joints for place in reaches[joint]})
        )

    def _reach(self, joint: int) -> set[tuple[int, int]]:
        """The control points, as (piece, control point), that the conditions of a joint involve."""
        order = parsed_order(self.orders[joint])[1]
        before, after = joint, (joint + 1) % len(self.pieces)
        last = len(self.pieces[before].coefficients) - 1
        return {(before, last - k) for k in range(order + 1)} | {(after, k) for k in range(order + 1)}

    def reversed(self) -> Composite:
        """The same points from the other end."""
        pieces = tuple(_reversed(piece) for piece in self.pieces[::-1])
        orders = self.orders[::-1] if not self.closed else (*self.orders[-2::-1], self.orders[-1])
        return Composite(pieces, orders, self.closed)

    def transformed(self, matrix: ArrayLike, translation: ArrayLike | None = None) -> Composite:
        """The affine image: points x become ``matrix @ x + translation``."""
        return Composite(tuple(p.transformed(matrix, translation) for p in self.pieces), self.orders, self.closed)


def _reversed(piece: SeparableCurve) -> SeparableCurve:
    return piece.reversed() if isinstance(piece, Curve | RestrictedCurve) else RestrictedCurve(piece, (1.0, 0.0))


def _designed(pieces: Sequence[SeparableCurve]) -> tuple[Curve, ...]:
    """The pieces, all with control points that can be moved."""
    curves = tuple(piece for piece in pieces if isinstance(piece, Curve))
    if len(curves) < len(pieces):
        strange = next(type(piece).__name__ for piece in pieces if not isinstance(piece, Curve))
        raise InputError(f"the pieces must be of the class Curve to have control points that move, got {strange}")
    return curves


def checked_places(
    name: str, pieces: Sequence[SeparableCurve], places: Sequence[tuple[int, int]]
) -> tuple[tuple[int, int], ...]:
    """(piece, control point) pairs that a chain has.

    Raises
    ------
    InputError
        When one of them is no such pair.
    """
    for place in places:
        if not (isinstance(place, Sequence) and len(place) == 2 and all(map(is_whole, place))):
            raise InputError(f"{name}: (piece, control point) must be a pair of whole numbers, got {place!r}")
        piece, control_point = place
        if not 0 <= piece < len(pieces):
            raise InputError(f"{name}: there is no piece {piece}, the last one is {len(pieces) - 1}")
        last = len(pieces[int(piece)].coefficients) - 1
        if not 0 <= control_point <= last:
            raise InputError(f"{name}: there is no control point {control_point} of piece {piece}, its last is {last}")
    return tuple((int(piece), int(control_point)) for piece, control_point in places)


def _checked_scales(orders: Sequence[str], scales: Sequence[Scale | None] | None) -> list[Scale | None]:
    if scales is None:
        return [None] * len(orders)
    if len(scales) != len(orders):
        raise InputError(f"scales must be one for each of {len(orders)} joints, got {len(scales)}")
    for joint, (scale, order) in enumerate(zip(scales, orders, strict=True)):
        if scale is None:
            continue
        try:
            fine = np.shape(scale) == (3,) and bool(np.isfinite(scale).all()) and scale[0] > 0
        except (TypeError, ValueError):
            fine = False
        if not fine:
            raise InputError(f"scales[{joint}] must be three finite numbers (eta, psi, omega), eta > 0, got {scale!r}")
        if order[0] == "C" and tuple(scale) != PARAMETRIC:
            raise InputError(f"scales[{joint}] is for G joins; a {order} join has (1, 0, 0), got {tuple(scale)}")
    return list(scales)
