"""The joints of a chain solved together.

With the scale factors of the G joins given, the conditions at the joints are linear in the control points, and the
nearest control points that meet them are an orthogonal projection of the designer's. The scale factors that move the
designer's points least, and leave the curves a speed at the joints, are then found by nonlinear least squares around
that projection (variable projection, with its exact Jacobian).

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
from numpy.typing import NDArray

from gtcad.continuity import PARAMETRIC, Scale, Start, chain_rule, parsed_order, speed_bounds
from gtcad.curve import Curve
from gtcad.errors import SingularJoin

Array = NDArray[np.float64]

_RESIDUAL = 1e-11  # of the size: what a condition, its coefficients of norm 1, may be missed by after the solution
_RANK = 1e-13  # of the largest singular value: conditions that say the same twice
_KEPT_SPEED = 0.25  # of the drawn one: a derivative that nearly vanishes at a joint is cheap in moves and no join
_LEAST_SPEED = 1e-3  # of the size: what stands for a drawn speed that is less
_NO_SPEED = 1e-10  # of the size: a tangent that has no digits left


class ChainSystem:
    """The linear conditions of a chain in its control points, and the designer's control points.

    Parameters
    ----------
    curves
        The pieces as drawn.
    orders
        One for each joint: one less than the pieces, or as many when the last one is that of the last with the first.
    fixed
        (piece, control point) pairs that stay where they are.
    """

    def __init__(self, curves: Sequence[Curve], orders: Sequence[str], fixed: Sequence[tuple[int, int]]) -> None:
        self.curves, self.texts = tuple(curves), tuple(orders)
        self.offsets = np.cumsum([0, *(curve.degree + 1 for curve in self.curves)]).tolist()
        self.free = np.ones(self.offsets[-1], dtype=bool)
        self.free[[self.offsets[piece] + control_point for piece, control_point in fixed]] = False
        points = np.concatenate([curve.control_points for curve in self.curves])
        self.center = points.mean(axis=0)
        self.points = points - self.center  # far from the origin, digits would be lost to its distance
        self.size = max(float(np.ptp(points, axis=0).max()), np.finfo(float).tiny)
        self.orders = [parsed_order(order)[1] for order in orders]
        self.ends = [self._end_rows(joint) for joint in range(len(orders))]

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
        kinds = zip(self.texts, self.orders, given, strict=True)
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

    def moved(self, scales: Sequence[Scale]) -> tuple[Curve, ...]:
        """The pieces with their control points moved.

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
        return tuple(
            Curve(points[a:b], curve.gamma, curve.family)
            for curve, (a, b) in zip(self.curves, pairwise(self.offsets), strict=True)
        )


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
