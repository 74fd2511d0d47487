"""Families of planes with control planes: the dual of GT-Bezier curves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.basis import GT, Basis, Family, Gamma, checked_gamma, checked_order, checked_parameters
from gtcad.errors import InputError
from gtcad.factors import CurveOfTerms, RestrictedFactors
from gtcad.patches._definitions import Cut, Planes, constant
from gtcad.patches._developable import Ruling
from gtcad.patches._taylor import Taylor
from gtcad.protocol import Factors, SeparableCurve, affine

if TYPE_CHECKING:
    from gtcad.patches._enveloping import Enveloping

Array = NDArray[np.float64]

_ROUNDING = 1e-14  # of the largest that a derivative may be: so much of it is rounding


@dataclass(frozen=True, eq=False)
class PlaneFamily:
    """Planes ``n(t).x = d(t)`` that move, ``(n, d)(t) = sum_i f_i(t; gamma_1, gamma_2) R_i``, t in [0, 1].

    They envelop a developable surface: each touches it along a ruling, where it meets its derivative
    ``n'(t).x = d'(t)``.

    Parameters
    ----------
    control_planes
        R, rows (a, b, c, d) of planes a x + b y + c z = d, shape (n + 1, 4). A common factor of all rows changes
        nothing, a factor of one row is a weight of that plane.
    gamma
        Design variables, each in [-1, 1]: they change the surface without moving a control plane.
    family
        ``GT`` (n = 2 to 60) or ``BERNSTEIN`` (n = 1 to 60, no design variables).

    Raises
    ------
    InputError
        When an argument is out of its range, or a control plane has no normal.

    References
    ----------
    S. Maqsood, M. Abbas, K. T. Miura, A. Majeed, G. BiBi, T. Nazir, Geometric modeling and applications of generalized
    blended trigonometric Bezier developable surfaces with shape parameters, Adv. Difference Equ. 2021:459.
    H. Pottmann, G. Farin, Developable rational Bezier and B-spline surfaces, Comput. Aided Geom. Design 12 (1995).

    Examples
    --------
    The tangent planes x cos + y sin = 1 of a quarter of the unit cylinder:

    >>> quarter = PlaneFamily([[1, 0, 0, 1], [1, 1, 0, 1], [0, 1, 0, 1]])
    >>> quarter.ruling(0.0).point.tolist(), quarter.ruling(0.0).direction.tolist()
    ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0])
    """

    control_planes: Array
    gamma: Gamma = (0.0, 0.0)
    family: Family = GT

    def __init__(self, control_planes: ArrayLike, gamma: ArrayLike = (0.0, 0.0), family: Family = GT) -> None:
        planes = _checked_planes(control_planes)
        object.__setattr__(self, "control_planes", planes)
        object.__setattr__(self, "gamma", checked_gamma("gamma", np.asarray(gamma).tolist(), family))
        object.__setattr__(self, "family", family)
        object.__setattr__(self, "_basis", Basis(len(planes) - 1, self.gamma, family))

    @property
    def degree(self) -> int:
        """The degree n, one less than the number of control planes."""
        return len(self.control_planes) - 1

    @property
    def basis(self) -> Basis:
        """The basis functions."""
        return self._basis  # type: ignore[attr-defined, no-any-return]

    def evaluate(self, t: ArrayLike) -> Array:
        """Planes (n, d)(t), shape t.shape + (4,).

        Raises
        ------
        InputError
            When a parameter is outside [0, 1].
        """
        return self.derivative(t, 0)

    def derivative(self, t: ArrayLike, order: int = 1) -> Array:
        """Derivatives of the order (0 or more) of (n, d), shape t.shape + (4,).

        Raises
        ------
        InputError
            When a parameter is outside [0, 1] or the order is not a whole number from 0.
        """
        order, t = checked_order("order", order), checked_parameters("t", t)
        rows = self.basis.rows(t.reshape(-1), order)
        return np.asarray(rows.T @ self.control_planes).reshape(*t.shape, 4)

    def normal(self, t: ArrayLike) -> Array:
        """Unit normals n / |n|, shape t.shape + (3,); NaN where a plane has none (n = 0).

        Raises
        ------
        InputError
            When a parameter is outside [0, 1].
        """
        normals = self.evaluate(t)[..., :3]
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(normals / np.linalg.norm(normals, axis=-1, keepdims=True))

    def ruling(self, t: ArrayLike) -> Ruling:
        """The lines in which the planes touch the surface: their points nearest to the origin, unit ``n x n'``.

        ``X_0 = [d (n' x r) + d' (r x n)] / |r|^2`` with ``r = n x n'``. NaN where a plane does not turn: where r is 0
        but for rounding.

        Raises
        ------
        InputError
            When a parameter is outside [0, 1].
        """
        t = checked_parameters("t", t)
        flat, planes = t.reshape(-1), self.planes()
        rulings = planes.rulings(Taylor.at(flat, 1))
        with np.errstate(divide="ignore", invalid="ignore"):
            points = Cut(0.0, planes, constant(np.zeros(3))).taylor(flat, 1).values
            directions = rulings.unit().values
        still = np.linalg.norm(rulings.values, axis=1) <= self._rounding(flat, 2)
        points[still] = directions[still] = np.nan
        return Ruling(points.reshape(*t.shape, 3), directions.reshape(*t.shape, 3))

    def edge_of_regression(self, t: ArrayLike) -> Array:
        """The points that three consecutive planes share, shape t.shape + (3,).

        ``E = [d (n' x n'') + d' (n'' x n) + d'' (n x n')] / det(n, n', n'')``; E' is parallel to the ruling. NaN where
        the determinant is 0 but for rounding: E is at infinity, or a plane does not turn.

        Raises
        ------
        InputError
            When a parameter is outside [0, 1].
        """
        t = checked_parameters("t", t)
        flat = t.reshape(-1)
        cut = Cut(0.0, self.planes(), None)
        with np.errstate(divide="ignore", invalid="ignore"):
            points = cut.taylor(flat, 1).values
        points[np.abs(cut.determinant(flat)) <= self._rounding(flat, 3)] = np.nan
        return points.reshape(*t.shape, 3)

    def _rounding(self, t: Array, count: int) -> Array:
        """How much of a product of n, n', ..., so many, is rounding, shape (t.size,)."""
        largest = float(np.linalg.norm(self.control_planes[:, :3], axis=1).max())
        sizes = [np.linalg.norm(self.derivative(t, order)[:, :3], axis=1) for order in range(count)]
        lost = [_ROUNDING * largest * self.basis.derivative_bound(order) for order in range(count)]
        off = [size + part for size, part in zip(sizes, lost, strict=True)]
        return np.asarray(np.prod(off, axis=0) - np.prod(sizes, axis=0))

    def enveloping(
        self,
        bound_a: ArrayLike | SeparableCurve,
        bound_b: ArrayLike | SeparableCurve,
        part: tuple[float, float] = (0.0, 1.0),
    ) -> Enveloping:
        """The developable patch that the planes envelop, between two bounds.

        Parameters
        ----------
        bound_a, bound_b
            Each a plane (a, b, c, d), a x + b y + c z = d, that every ruling is cut by; or a curve in space: each
            ruling then ends at its point nearest to the curve's point of equal parameter, on the curve when that lies
            on the ruling.
        part
            The part of the parameters t that is meant; from the larger to the smaller one runs backwards.

        Raises
        ------
        SingularDevelopable
            With the first t where a plane stands still, a ruling is parallel to a bounding plane, the bounds meet, or
            the edge of regression meets the patch, looked for in this order.
        InputError
            When an argument is out of its range, or the patch needs polynomials of a degree above 190: take parts.

        Examples
        --------
        >>> quarter = PlaneFamily([[1, 0, 0, 1], [1, 1, 0, 1], [0, 1, 0, 1]])
        >>> wall = quarter.enveloping([0, 0, 1, 0], [0, 0, 1, 3])
        >>> wall.evaluate(1.0, 0.5).round(12).tolist()
        [0.0, 1.0, 1.5]
        """
        from gtcad.patches._enveloping import Enveloping

        return Enveloping(self, bound_a, bound_b, part)

    def planes(self, part: tuple[float, float] = (0.0, 1.0)) -> Planes:
        """Normals and offsets as curves, over a part of the parameters."""
        factors: Factors = self.basis if part == (0.0, 1.0) else RestrictedFactors(self.basis, *part)
        rows = self.control_planes
        return Planes(CurveOfTerms(factors, rows[:, :3]), CurveOfTerms(factors, rows[:, 3:]))

    def with_gamma(self, gamma: ArrayLike) -> PlaneFamily:
        """The same control planes with other design variables."""
        return PlaneFamily(self.control_planes, gamma, self.family)

    def reversed(self) -> PlaneFamily:
        """The same planes from the other end."""
        return PlaneFamily(self.control_planes[::-1], self.gamma[::-1], self.family)

    def transformed(self, matrix: ArrayLike, translation: ArrayLike | None = None) -> PlaneFamily:
        """The planes of the affine image: points x become ``matrix @ x + translation``.

        Raises
        ------
        InputError
            When the matrix is not an invertible one of shape (3, 3).
        """
        return PlaneFamily(moved_planes(self.control_planes, matrix, translation), self.gamma, self.family)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, PlaneFamily):
            return NotImplemented
        return (self.gamma, self.family) == (other.gamma, other.family) and np.array_equal(
            self.control_planes, other.control_planes
        )

    def __hash__(self) -> int:
        return hash(((self.control_planes + 0.0).tobytes(), self.gamma, self.family))  # -0.0 equals 0.0

    def __reduce__(self) -> tuple[object, ...]:
        return PlaneFamily, (self.control_planes, self.gamma, self.family)


def moved_planes(planes: Array, matrix: ArrayLike, translation: ArrayLike | None) -> Array:
    """Planes (a, b, c, d), shape (..., 4), moved as points are: by the inverse transpose of the matrix.

    Raises
    ------
    InputError
        When the matrix is not an invertible one of shape (3, 3).
    """
    offset = affine(np.zeros(3), matrix, translation)
    linear = np.asarray(matrix, dtype=np.float64)
    if linear.shape != (3, 3) or np.linalg.cond(linear) > 1e12:
        raise InputError(f"matrix must be an invertible one of shape (3, 3) to move planes, got {linear.tolist()}")
    normals = planes[..., :3] @ np.linalg.inv(linear)
    return np.concatenate([normals, (planes[..., 3] + normals @ offset)[..., None]], axis=-1)


def _checked_planes(value: ArrayLike) -> Array:
    try:
        planes = np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"control_planes must be numbers of shape (n + 1, 4): {error}") from None
    if planes.ndim != 2 or planes.shape[1] != 4:
        raise InputError(f"control_planes must have shape (n + 1, 4), got {planes.shape}")
    for k, row in enumerate(planes):
        if not np.isfinite(row).all():
            raise InputError(f"control_planes[{k}] must be finite, got {row.tolist()}")
        if not row[:3].any():
            raise InputError(f"control_planes[{k}] must have a normal, got {row.tolist()}")
    planes.flags.writeable = False
    return planes


def checked_plane(name: str, value: ArrayLike) -> tuple[float, float, float, float]:
    """A plane (a, b, c, d).

    Raises
    ------
    InputError
        When it is no four finite numbers, or has no normal.
    """
    try:
        plane = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        plane = np.empty(0)
    if plane.shape != (4,) or not np.isfinite(plane).all() or not plane[:3].any():
        got = repr(value) if isinstance(value, Sequence | np.ndarray) or value is None else type(value).__name__
        raise InputError(f"{name} must be a plane (a, b, c, d), its normal (a, b, c) not zero, or a curve, got {got}")
    a, b, c, d = (plane + 0.0).tolist()
    return a, b, c, d
