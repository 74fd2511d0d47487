"""Chains of curves with a wanted order of continuity at each joint.

All joints are solved together: with the scale factors of the G joins given, the conditions at the joints are linear in
the control points, and the nearest control points that meet them are an orthogonal projection of the designer's. The
scale factors that move the designer's points least, and leave the curves a speed at the joints, are then found by
nonlinear least squares around that projection (variable projection).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.basis import checked_order
from gtcad.continuity import (
    PARAMETRIC,
    JoinReport,
    Scale,
    Start,
    Thresholds,
    chain_rule,
    check_join,
    parsed_order,
    speed_bounds,
)
from gtcad.curve import Curve
from gtcad.errors import InputError, SingularJoin
from gtcad.protocol import SeparableCurve
from gtcad.restricted import RestrictedCurve

Array = NDArray[np.float64]

_RESIDUAL = 1e-11  # of the size: what the joined derivatives may differ by after the solution
_KEPT_SPEED = 0.25  # of the drawn one: a derivative that nearly vanishes at a joint is cheap in moves and no join


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
        When the numbers or dimensions do not fit.
    """

    pieces: tuple[SeparableCurve, ...]
    orders: tuple[str, ...]
    closed: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "pieces", tuple(self.pieces))
        object.__setattr__(self, "orders", tuple(self.orders))
        wanted = len(self.pieces) - (0 if self.closed else 1)
        if not self.pieces or len(self.orders) != wanted:
            kind = "closed" if self.closed else "open"
            raise InputError(f"a {kind} chain of {len(self.pieces)} pieces has {wanted} joints, got {len(self.orders)}")
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

        Where scale factors are free, no curve loses more than three quarters of its speed at a joint.

        Parameters
        ----------
        pieces
            As the designer drew them; they need not join.
        orders, closed
            As of the class.
        scales
            (eta, psi, omega) for each joint; None where they are free. All free unless given.
        fixed
            (piece, control point) pairs that must stay where they are.

        Raises
        ------
        InputError
            When an argument is out of its range.
        SingularJoin
            When the joints cannot all be met, or a control point at a joint is not determined.
        """
        drawn = Composite(tuple(pieces), tuple(orders), closed)
        system = _System(drawn, fixed)
        given = [None] * len(drawn.orders) if scales is None else list(scales)
        if len(given) != len(drawn.orders):
            raise InputError(f"scales must be one for each of {len(drawn.orders)} joints, got {len(given)}")
        return system.chain(system.best_scales(given))

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
        if not ((values >= 0) & (values <= len(self.pieces))).all():
            raise InputError(f"t must lie in [0, {len(self.pieces)}], got {values.min()} to {values.max()}")
        flat = values.reshape(-1)
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

    def touched(self, piece: int, control_point: int | None = None) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Local control: the joints that must be solved anew when a control point moves, and the pieces they change.

        Parameters
        ----------
        piece, control_point
            Which one; None for the design variables of the piece, which touch both its joints.

        Returns
        -------
        joints, pieces
            Indices. A joint reaches k + 1 control points into each side; joints that share a control point are solved
            together. The piece itself is always among the pieces.
        """
        curves = _designed(self.pieces)
        joints = range(len(self.orders))
        reach = {joint: self._reach(joint) for joint in joints}
        count = curves[piece].degree + 1
        points = range(count) if control_point is None else (control_point,)
        if control_point is not None and not 0 <= control_point < count:
            raise InputError(f"control_point must lie in [0, {count - 1}], got {control_point}")
        touched = {joint for joint in joints if reach[joint] & {(piece, k) for k in points}}
        while True:
            grown = {joint for joint in joints if any(reach[joint] & reach[other] for other in touched)}
            if grown <= touched:
                break
            touched |= grown
        pieces = {piece} | {p for joint in touched for p, _ in reach[joint]}
        return tuple(sorted(touched)), tuple(sorted(pieces))

    def _reach(self, joint: int) -> set[tuple[int, int]]:
        order = parsed_order(self.orders[joint])[1]
        before, after = joint, (joint + 1) % len(self.pieces)
        last = _designed(self.pieces)[before].degree
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


class _System:
    """The linear conditions of a chain in its control points, and the designer's control points."""

    def __init__(self, drawn: Composite, fixed: Sequence[tuple[int, int]]) -> None:
        self.drawn = drawn
        self.curves = _designed(drawn.pieces)
        counts = [piece.degree + 1 for piece in self.curves]
        self.offsets = np.concatenate([[0], np.cumsum(counts)])
        self.points = np.concatenate([piece.control_points for piece in self.curves])
        self.size = max(float(np.ptp(self.points, axis=0).max()), np.finfo(float).tiny)
        self.free = np.ones(len(self.points), dtype=bool)
        for piece, control_point in fixed:
            if not (0 <= piece < len(counts) and 0 <= control_point < counts[piece]):
                raise InputError(f"fixed: there is no control point {control_point} of piece {piece}")
            self.free[self.offsets[piece] + control_point] = False
        self.ends = [self._end_rows(joint) for joint in range(len(drawn.orders))]

    def _end_rows(self, joint: int) -> tuple[Array, Array]:
        """Rows that give the derivatives before and after a joint, each (order + 1, all control points)."""
        order = parsed_order(self.drawn.orders[joint])[1]
        before, after = joint, (joint + 1) % len(self.drawn.pieces)
        rows = np.zeros((2, order + 1, len(self.points)))
        for side, (piece, t) in enumerate(((before, 1.0), (after, 0.0))):
            Start.of((self.curves[piece] if side else self.curves[piece].reversed()).factors, order)
            where = slice(self.offsets[piece], self.offsets[piece + 1])
            for r in range(order + 1):
                rows[side, r, where] = self.curves[piece].factors.derivative(t, r)
        return rows[0], rows[1]

    def conditions(self, scales: Sequence[Scale]) -> Array:
        """All conditions as rows that vanish on the control points, each of norm 1."""
        rows = [
            after - chain_rule(scale, len(after)) @ before
            for (before, after), scale in zip(self.ends, scales, strict=True)
        ]
        matrix = np.concatenate(rows) if rows else np.zeros((0, len(self.points)))
        return np.asarray(matrix / np.linalg.norm(matrix, axis=1, keepdims=True))

    def moves(self, scales: Sequence[Scale]) -> Array:
        """The least moves of the free control points after which the conditions hold."""
        matrix = self.conditions(scales)
        result = np.zeros_like(self.points)
        for _ in range(2):  # the second pass takes up the rounding of the first
            missing = matrix @ (self.points + result)
            result[self.free] -= np.linalg.lstsq(matrix[:, self.free], missing, rcond=1e-13)[0]
        return result

    def best_scales(self, given: Sequence[Scale | None]) -> list[Scale]:
        """Scale factors for all joints: the given ones, (1, 0, 0) for C, and for G those that move points least."""
        from scipy.optimize import least_squares

        parsed = [parsed_order(order) for order in self.drawn.orders]
        open_joints = [
            (joint, order)
            for joint, ((kind, order), scale) in enumerate(zip(parsed, given, strict=True))
            if kind == "G" and order > 0 and scale is None
        ]

        def completed(free: Array) -> list[Scale]:
            scales, left = [scale or PARAMETRIC for scale in given], free.tolist()
            for joint, order in open_joints:
                (speed, psi, omega), left = (*left[:order], 0.0, 0.0)[:3], left[order:]
                scales[joint] = (math.exp(speed), psi, omega)
            return scales

        if not open_joints:
            return completed(np.zeros(0))
        guess = np.concatenate([[self._speed_ratio(joint), 0.0, 0.0][:order] for joint, order in open_joints])
        speeds = np.cumsum([0, *(order for _, order in open_joints[:-1])]).tolist()

        def residuals(free: Array) -> Array:
            moves = self.moves(completed(free))
            speeds = [self._speeds(joint, self.points + moves) for joint, _ in open_joints]
            lost = np.maximum(0.0, np.log(_KEPT_SPEED * drawn / np.maximum(speeds, np.finfo(float).tiny)))
            return np.concatenate([(moves / self.size).reshape(-1), lost.reshape(-1)])

        drawn = np.array([self._speeds(joint, self.points) for joint, _ in open_joints])
        found = least_squares(residuals, guess, bounds=speed_bounds(guess, speeds), x_scale="jac")
        return completed(found.x)

    def _speeds(self, joint: int, points: Array) -> Array:
        """Norms of the first derivatives before and after a joint."""
        return np.array([np.linalg.norm(rows[1] @ points) for rows in self.ends[joint]])

    def _speed_ratio(self, joint: int) -> float:
        before, after = np.maximum(self._speeds(joint, self.points), 1e-3 * self.size)
        return math.log(after / before)

    def chain(self, scales: Sequence[Scale]) -> Composite:
        """The chain with its control points moved.

        Raises
        ------
        SingularJoin
            When the conditions do not hold then.
        """
        points = self.points + self.moves(scales)
        residual = float(np.abs(self.conditions(scales) @ points).max(initial=0.0)) / self.size
        if residual > _RESIDUAL:
            raise SingularJoin(
                f"the joints cannot all be met: a condition is missed by {residual:.2g} of the size", residual
            )
        for (before, after), _ in zip(self.ends, scales, strict=True):
            points[after[0] != 0] = points[before[0] != 0]  # the same point to the last digit
        pieces = tuple(
            Curve(points[a:b], piece.gamma, piece.family)
            for piece, a, b in zip(self.curves, self.offsets[:-1], self.offsets[1:], strict=True)
        )
        return Composite(pieces, self.drawn.orders, self.drawn.closed)
