"""What a shape must offer to be evaluated, fitted and proved: separable terms.

Most shapes of gtcad are finite sums of products of analytic functions of one parameter,

    C(t) = sum_i F_i(t) c_i          S(u, v) = sum_ij F_i(u) G_j(v) c_ij,

with ``F`` and ``G`` a few *factors* (a basis, cos and sin of an angle, ...) and constant coefficients. A sum of such
sums is one again, over the factors side by side (``gtcad.factors.Stacked``). A new kind of shape gives its factors and
coefficients and is then evaluated, differentiated, converted, proved and exported like every other; a new kind of
factor gives its derivatives, and a bound of each order of them.
"""

from __future__ import annotations

import abc
import math
from collections.abc import Hashable, Sequence
from numbers import Real
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.basis import AT_ONCE, checked_order, checked_parameters
from gtcad.errors import InputError

Array = NDArray[np.float64]

SIDES = ("u0", "u1", "v0", "v1")  # of a surface's domain


class Factors(Protocol):
    """A few analytic functions on [0, 1], known well enough to prove with."""

    @property
    def count(self) -> int:
        """Number of functions."""
        ...

    @property
    def key(self) -> Hashable:
        """Equal for equal functions: what depends on the factors alone is kept under it."""
        ...

    def rows(self, t: Array, order: int = 0) -> Array:
        """Derivatives of the order at flat parameters, shape (count, t.size), in closed form."""
        ...

    def derivative_bound(self, order: int) -> float:
        """Bound of ``sum_i |F_i^(order)|`` on [0, 1]; order 0 bounds the values, high orders the tails of series."""
        ...

    @property
    def rounding(self) -> float:
        """Bound of ``sum_i |computed F_i - F_i|`` in ``rows`` of order 0."""
        ...


class SeparableCurve(abc.ABC):
    """A curve ``C(t) = sum_i F_i(t) c_i``, t in [0, 1]."""

    @property
    @abc.abstractmethod
    def factors(self) -> Factors:
        """The functions F."""

    @property
    @abc.abstractmethod
    def coefficients(self) -> Array:
        """The constants c, shape (count, d)."""

    @abc.abstractmethod
    def transformed(self, matrix: ArrayLike, translation: ArrayLike | None = None) -> Self:
        """The affine image: points x become ``matrix @ x + translation``."""

    @property
    def dimension(self) -> int:
        """Space dimension d."""
        return int(self.coefficients.shape[-1])

    @property
    def domain(self) -> tuple[float, float]:
        """First and last parameter."""
        return 0.0, 1.0

    def evaluate(self, t: ArrayLike) -> Array:
        """Points C(t), shape t.shape + (d,).

        Raises
        ------
        InputError
            When a parameter is outside [0, 1].
        """
        return self.derivative(t, 0)

    def derivative(self, t: ArrayLike, order: int = 1) -> Array:
        """Derivatives of the order (0 or more) with respect to t, shape t.shape + (d,).

        Raises
        ------
        InputError
            When a parameter is outside [0, 1] or the order is not a whole number from 0.
        """
        order = checked_order("order", order)
        t = checked_parameters("t", t)
        flat = t.reshape(-1)
        result = np.empty((flat.size, self.dimension))
        for start in range(0, flat.size, AT_ONCE):
            part = slice(start, start + AT_ONCE)
            np.matmul(self.factors.rows(flat[part], order).T, self.coefficients, out=result[part])
        return result.reshape(*t.shape, self.dimension)


class SeparableSurface(abc.ABC):
    """A surface ``S(u, v) = sum_ij F_i(u) G_j(v) c_ij``, u and v in [0, 1]."""

    @property
    @abc.abstractmethod
    def factors_u(self) -> Factors:
        """The functions F of u."""

    @property
    @abc.abstractmethod
    def factors_v(self) -> Factors:
        """The functions G of v."""

    @property
    @abc.abstractmethod
    def coefficients(self) -> Array:
        """The constants c, shape (count_u, count_v, d)."""

    @abc.abstractmethod
    def transformed(self, matrix: ArrayLike, translation: ArrayLike | None = None) -> Self:
        """The affine image: points x become ``matrix @ x + translation``."""

    @property
    def dimension(self) -> int:
        """Space dimension d."""
        return int(self.coefficients.shape[-1])

    @property
    def definition_error(self) -> float:
        """Bound of the distance of the points of equal parameters from what the surface stands for, proved.

        0 for surfaces that are what their terms say; proofs of deviations include it.
        """
        return 0.0

    def evaluate(self, u: ArrayLike, v: ArrayLike) -> Array:
        """Points S(u, v), shape broadcast(u, v).shape + (d,).

        u and v broadcast; ``u[:, None], v[None, :]`` is evaluated as a tensor product, at the cost of one matrix
        product for the whole grid.

        Raises
        ------
        InputError
            When a parameter is outside [0, 1] or the shapes do not broadcast.
        """
        return self.derivative(u, v, (0, 0))

    def derivative(self, u: ArrayLike, v: ArrayLike, orders: tuple[int, int] = (1, 0)) -> Array:
        """Partial derivatives of the orders (in u, in v), shape broadcast(u, v).shape + (d,).

        Raises
        ------
        InputError
            When a parameter is outside [0, 1], an order is not a whole number from 0, or the shapes do not broadcast.
        """
        order_u, order_v = (checked_order(f"orders[{k}]", order) for k, order in enumerate(orders))
        u, v = checked_parameters("u", u), checked_parameters("v", v)
        try:
            shape = np.broadcast_shapes(u.shape, v.shape)
        except ValueError:
            raise InputError(f"u and v must broadcast, got shapes {u.shape} and {v.shape}") from None
        if u.ndim == v.ndim == 2 and u.shape[1] == 1 and v.shape[0] == 1:
            return self._on_grid(u[:, 0], v[0], order_u, order_v)
        return self._at_points(np.broadcast_to(u, shape), np.broadcast_to(v, shape), order_u, order_v)

    def _on_grid(self, u: Array, v: Array, order_u: int, order_v: int) -> Array:
        rows_u, rows_v = self.factors_u.rows(u, order_u), self.factors_v.rows(v, order_v)
        lines = rows_v.T @ self.coefficients  # (count_u, v.size, d)
        return np.asarray(rows_u.T @ lines.reshape(len(lines), -1)).reshape(u.size, v.size, self.dimension)

    def _at_points(self, u: Array, v: Array, order_u: int, order_v: int) -> Array:
        flat_u, flat_v = u.reshape(-1), v.reshape(-1)
        result = np.empty((flat_u.size, self.dimension))
        count_u, count_v, dimension = self.coefficients.shape
        table = self.coefficients.reshape(count_u, -1)
        for start in range(0, flat_u.size, AT_ONCE):
            part = slice(start, start + AT_ONCE)
            rows_u, rows_v = self.factors_u.rows(flat_u[part], order_u), self.factors_v.rows(flat_v[part], order_v)
            lines = (rows_u.T @ table).reshape(-1, count_v, dimension)
            np.einsum("jp,pjd->pd", rows_v, lines, out=result[part])
        return result.reshape(*u.shape, dimension)


Shape = SeparableCurve | SeparableSurface


def checked_points(name: str, value: ArrayLike, ndim: int) -> Array:
    """Control points as a read-only array of finite floats with the given number of axes, the last one 2 or 3.

    Raises
    ------
    InputError
        When the shape or a value is wrong.
    """
    wanted = {2: "(n + 1, d)", 3: "(n + 1, m + 1, d)"}[ndim]
    try:
        points = np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} must be numbers of shape {wanted}: {error}") from None
    if points.ndim != ndim or points.shape[-1] not in (2, 3):
        raise InputError(f"{name} must have shape {wanted} with d = 2 or 3, got {points.shape}")
    if not np.isfinite(points).all():
        place = tuple(int(k) for k in np.argwhere(~np.isfinite(points))[0])
        raise InputError(f"{name}{list(place)} must be finite, got {points[place]}")
    points.flags.writeable = False
    return points


def checked_tolerance(tolerance: Any) -> float:
    """The largest distance that is allowed, as a float.

    Raises
    ------
    InputError
        When it is no finite number above 0.
    """
    try:
        value = math.nan if isinstance(tolerance, str) else float(tolerance)
    except (TypeError, ValueError, OverflowError):
        value = math.nan
    if not 0 < value < math.inf:
        got = tolerance if isinstance(tolerance, Real) else repr(tolerance)
        raise InputError(f"tolerance must be a finite number above 0, got {got}")
    return value


def checked_kind(name: str, value: object, kind: type | tuple[type, ...], wanted: str) -> None:
    """Refuse an argument of another class.

    Parameters
    ----------
    name
        Of the argument.
    value
        What was given.
    kind
        The classes that it may have.
    wanted
        What they are in words, and where to go with others.

    Raises
    ------
    InputError
        When it has none of them.
    """
    if not isinstance(value, kind):
        raise InputError(f"{name} must be {wanted}, got {type(value).__name__}")


def checked_side(side: str) -> str:
    """The name of one of the four sides of a surface's domain: "u0" is the side u = 0.

    Raises
    ------
    InputError
        When it is none of "u0", "u1", "v0", "v1".
    """
    if side not in SIDES:
        raise InputError(f'side must be "u0", "u1", "v0" or "v1", got {side!r}')
    return side


def affine(points: Array, matrix: ArrayLike, translation: ArrayLike | None) -> Array:
    """The image of points (..., d) under x -> matrix @ x + translation, matrix of shape (e, d), e = 2 or 3.

    Raises
    ------
    InputError
        When the shapes do not fit.
    """
    linear = np.asarray(matrix, dtype=np.float64)
    if linear.ndim != 2 or linear.shape[1] != points.shape[-1] or linear.shape[0] not in (2, 3):
        raise InputError(f"matrix must have shape (2 or 3, {points.shape[-1]}), got {linear.shape}")
    if not np.isfinite(linear).all():
        raise InputError(f"matrix must be finite, got {linear.tolist()}")
    offset = np.zeros(len(linear)) if translation is None else np.asarray(translation, dtype=np.float64)
    if offset.shape != linear.shape[:1]:
        raise InputError(f"translation must have shape ({len(linear)},), got {offset.shape}")
    return np.asarray(points @ linear.T + offset)


def domain_part(name: str, bounds: Sequence[float]) -> tuple[float, float]:
    """A part (a, b) of [0, 1]; a > b runs backwards.

    Raises
    ------
    InputError
        When it is empty or leaves [0, 1].
    """
    try:
        values = tuple(float(x) for x in bounds)
    except (TypeError, ValueError):
        raise InputError(f"{name} must be two different numbers in [0, 1], got {bounds!r}") from None
    if len(values) != 2 or not all(0 <= x <= 1 for x in values) or abs(values[1] - values[0]) < 1e-9:
        raise InputError(f"{name} must be two different numbers in [0, 1], got {values}")
    return values[0], values[1]
