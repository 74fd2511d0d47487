"""Chains of curves with a wanted order of continuity at each joint.

All joints are solved together: with the scale factors of the G joins given, the conditions at the joints are linear in
the control points, and the nearest control points that meet them are an orthogonal projection of the designer's. The
scale factors that move the designer's points least, and leave the curves a speed at the joints, are then found by
nonlinear least squares around that projection (variable projection, with its exact Jacobian).

References
----------
G. H. Golub, V. Pereyra, The differentiation of pseudo-inverses and nonlinear least squares problems whose variables
separate, SIAM J. Numer. Anal. 10 (1973) 413-432.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.basis import checked_order, is_whole
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

_RESIDUAL = 1e-11  # of the size: what a condition, its coefficients of norm 1, may be missed by after the solution
_RANK = 1e-13  # of the largest singular value: conditions that say the same twice
_KEPT_SPEED = 0.25  # of the drawn one: a derivative that nearly vanishes at a joint is cheap in moves and no join
_LEAST_SPEED = 1e-3  # of the size: what stands for a drawn speed that is less
_NO_SPEED = 1e-10  # of the size: a tangent that has no digits left


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
        system = _System(drawn, checked_places("fixed", drawn.pieces, fixed))
        return system.chain(system.best_scales(_checked_scales(drawn.orders, scales)))

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


class _System:
    """The linear conditions of a chain in its control points, and the designer's control points."""

    def __init__(self, drawn: Composite, fixed: Sequence[tuple[int, int]]) -> None:
        self.drawn = drawn
        self.curves = _designed(drawn.pieces)
        self.offsets = np.cumsum([0, *(curve.degree + 1 for curve in self.curves)]).tolist()
        self.free = np.ones(self.offsets[-1], dtype=bool)
        self.free[[self.offsets[piece] + control_point for piece, control_point in fixed]] = False
        points = np.concatenate([curve.control_points for curve in self.curves])
        self.center = points.mean(axis=0)
        self.points = points - self.center  # far from the origin, digits would be lost to its distance
        self.size = max(float(np.ptp(points, axis=0).max()), np.finfo(float).tiny)
        self.orders = [parsed_order(order)[1] for order in drawn.orders]
        self.ends = [self._end_rows(joint) for joint in range(len(drawn.orders))]

    def _end_rows(self, joint: int) -> Array:
        """Rows that give the derivatives before and after a joint, shape (2, order + 1, all control points)."""
        count = self.orders[joint] + 1
        before, after = joint, (joint + 1) % len(self.curves)
        rows = np.zeros((2, count, self.offsets[-1]))
        for side, (piece, t) in enumerate(((before, 1.0), (after, 0.0))):
            basis = self.curves[piece].factors
            try:
                Start.of(basis if side else self.curves[piece].reversed().factors, count - 1)
            except SingularJoin as error:
                raise SingularJoin(f"joint {joint}, piece {piece}: {error.reason}", error.conditioning) from None
            where = slice(self.offsets[piece], self.offsets[piece + 1])
            rows[side, :, where] = [basis.derivative(t, r) for r in range(count)]
        return rows

    def conditions(self, scales: Sequence[Scale]) -> tuple[Array, Array]:
        """All conditions as rows that vanish on the control points, each of norm 1; and what they were divided by."""
        rows = [
            after - chain_rule(scale, len(after)) @ before
            for (before, after), scale in zip(self.ends, scales, strict=True)
        ]
        matrix = np.concatenate([np.zeros((0, len(self.points))), *rows])
        norms = np.linalg.norm(matrix, axis=1, keepdims=True)
        return matrix / norms, norms

    def solution(self, scales: Sequence[Scale]) -> _Solution:
        """The least moves of the free control points after which the conditions hold."""
        matrix, norms = self.conditions(scales)
        left, sizes, right = np.linalg.svd(matrix[:, self.free], full_matrices=False)
        kept = sizes > _RANK * sizes.max(initial=0.0)
        right = right[kept]
        inverse = (right.T / sizes[kept]) @ left[:, kept].T
        moves = np.zeros_like(self.points)
        for _ in range(2):  # the second pass takes up the rounding of the first
            moves[self.free] -= inverse @ (matrix @ (self.points + moves))
        return _Solution(moves, inverse, right, norms)

    def slopes(self, scales: Sequence[Scale], joints: Sequence[int], found: _Solution) -> Array:
        """Derivatives of the moves by the scale factors of some joints, shape (factors, all control points, d).

        With the conditions A (x + m) = 0 and m = A^T l, differentiation gives
        dm = (1 - A^+ A) dA^T l - A^+ dA (x + m).
        """
        first_rows = np.cumsum([0, *(order + 1 for order in self.orders)]).tolist()
        points = self.points + found.moves
        multipliers = found.inverse.T @ found.moves[self.free]
        result: list[Array] = []
        for joint in joints:
            rows = slice(first_rows[joint], first_rows[joint + 1])
            before = self.ends[joint][0]
            for slope in _chain_rule_slopes(scales[joint], self.orders[joint]):
                change = -slope @ before / found.norms[rows]
                pull = change[:, self.free].T @ multipliers[rows]
                moves = np.zeros_like(self.points)
                moves[self.free] = pull - found.right.T @ (found.right @ pull)
                moves[self.free] -= found.inverse[:, rows] @ (change @ points)
                result.append(moves)
        return np.array(result)

    def best_scales(self, given: Sequence[Scale | None]) -> list[Scale]:
        """Scale factors for all joints: the given ones, (1, 0, 0) for C, and for G those that move points least."""
        from scipy.optimize import least_squares

        scales = [scale or PARAMETRIC for scale in given]
        kinds = zip(self.drawn.orders, self.orders, given, strict=True)
        joints = [k for k, (text, order, scale) in enumerate(kinds) if text[0] == "G" and order > 0 and scale is None]
        if not joints:
            return scales
        starts = np.cumsum([0, *(self.orders[joint] for joint in joints)]).tolist()
        speed_rows = np.concatenate([self.ends[joint][:, 1] for joint in joints])
        drawn = np.maximum(np.linalg.norm(speed_rows @ self.points, axis=1), _LEAST_SPEED * self.size)

        def completed(free: Array) -> list[Scale]:
            for joint, (start, end) in zip(joints, pairwise(starts), strict=True):
                speed, psi, omega = (*free[start:end].tolist(), 0.0, 0.0)[:3]
                scales[joint] = (math.exp(speed), psi, omega)
            return scales

        def residuals(free: Array) -> Array:
            moves = self.solution(completed(free)).moves
            speeds = np.linalg.norm(speed_rows @ (self.points + moves), axis=1)
            lost = np.log(_KEPT_SPEED * drawn / np.maximum(speeds, np.finfo(float).tiny))
            return np.concatenate([(moves / self.size).reshape(-1), np.maximum(0.0, lost)])

        def jacobian(free: Array) -> Array:
            found = self.solution(completed(free))
            slopes = self.slopes(scales, joints, found)
            first = speed_rows @ (self.points + found.moves)
            squares = np.maximum((first**2).sum(axis=1), np.finfo(float).tiny)
            lost = -np.einsum("sd,ksd->ks", first, speed_rows @ slopes) / squares
            lost[:, np.sqrt(squares) >= _KEPT_SPEED * drawn] = 0.0
            return np.concatenate([(slopes / self.size).reshape(len(free), -1), lost], axis=1).T

        guess = np.zeros(starts[-1])
        guess[starts[:-1]] = np.log(drawn[1::2] / drawn[::2])
        bounds = speed_bounds(guess, starts[:-1])
        return completed(least_squares(residuals, guess, jac=jacobian, bounds=bounds, x_scale="jac").x)

    def chain(self, scales: Sequence[Scale]) -> Composite:
        """The chain with its control points moved.

        Raises
        ------
        SingularJoin
            When the conditions do not hold then, or only because a derivative vanishes.
        """
        points = self.points + self.solution(scales).moves
        residual = float(np.abs(self.conditions(scales)[0] @ points).max(initial=0.0)) / self.size
        if residual > _RESIDUAL:
            raise SingularJoin(
                f"the joints cannot all be met: a condition is missed by {residual:.2g} of the size", residual
            )
        for joint, rows in enumerate(self.ends):
            speed = float(np.linalg.norm(rows[:, 1:2] @ points, axis=-1).min(initial=math.inf)) / self.size
            if speed < _NO_SPEED:
                raise SingularJoin(f"a piece has no tangent at joint {joint}: its first derivative vanishes", speed)
        points += self.center
        for joint in range(len(self.ends)):
            end = self.offsets[joint + 1]
            points[end % self.offsets[-1]] = points[end - 1]  # the same point to the last digit
        pieces = tuple(
            Curve(points[a:b], curve.gamma, curve.family)
            for curve, (a, b) in zip(self.curves, pairwise(self.offsets), strict=True)
        )
        return Composite(pieces, self.drawn.orders, self.drawn.closed)


@dataclass(frozen=True, eq=False)
class _Solution:
    """The moves m of control points x, and what their derivatives need of the conditions A (x + m) = 0.

    Attributes
    ----------
    moves
        m, shape (all control points, d).
    inverse
        A^+, of the columns of control points that are free.
    right
        An orthonormal basis of the rows of A, in the same columns.
    norms
        What the rows of A were divided by.
    """

    moves: Array
    inverse: Array
    right: Array
    norms: Array


def _chain_rule_slopes(scale: Scale, order: int) -> Array:
    """Derivatives of ``chain_rule`` by log(eta), psi and omega, as many as the order has, (order, order + 1, ...)."""
    eta, psi, _ = scale
    slopes = np.zeros((3, 4, 4))
    slopes[0, [1, 2, 3, 3], [1, 2, 3, 2]] = eta, 2 * eta**2, 3 * eta**3, 3 * eta * psi
    slopes[1, [2, 3], [1, 2]] = 1.0, 3 * eta
    slopes[2, 3, 1] = 1.0
    return slopes[:order, : order + 1, : order + 1]
