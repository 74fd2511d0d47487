"""B-spline curves and surfaces as plain arrays: what a fit returns, what an exchange file holds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.basis import checked_order, is_whole
from gtcad.errors import InputError
from gtcad.protocol import checked_side

Array = NDArray[np.float64]
MAX_DEGREE = 25  # OCCT's limit


def _numbers(name: str, value: ArrayLike) -> Array:
    """A new array of floats."""
    try:
        return np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} must be numbers: {error}") from None


def _points(name: str, value: ArrayLike, ndim: int) -> Array:
    points = _numbers(name, value)
    if points.ndim != ndim or points.shape[-1] not in (2, 3):
        wanted = "(n, d)" if ndim == 2 else "(nu, nv, d)"
        raise InputError(f"{name} must have shape {wanted} with d = 2 or 3, got {points.shape}")
    if not np.isfinite(points).all():
        raise InputError(f"{name} must be finite, got {points[~np.isfinite(points)][0]}")
    points.flags.writeable = False
    return points


def _weights(value: ArrayLike | None, shape: tuple[int, ...]) -> Array | None:
    if value is None:
        return None
    weights = _numbers("weights", value)
    if weights.shape != shape:
        raise InputError(f"weights must have shape {shape}, got {weights.shape}")
    if not (np.isfinite(weights).all() and (weights > 0).all()):
        raise InputError(f"weights must be positive and finite, got {weights.min()} to {weights.max()}")
    weights.flags.writeable = False
    return weights


def _knots(
    name: str, knots: ArrayLike, multiplicities: Sequence[int] | NDArray[np.int_], degree: int, count: int
) -> tuple[Array, tuple[int, ...]]:
    values = _numbers(name, knots)
    if not is_whole(degree) or not 1 <= degree <= MAX_DEGREE:
        raise InputError(f"degree must be a whole number in [1, {MAX_DEGREE}], got {degree}")
    if not all(is_whole(m) for m in multiplicities):
        raise InputError(f"multiplicities of {name} must be whole numbers, got {list(multiplicities)}")
    counts = tuple(int(m) for m in multiplicities)
    if values.ndim != 1 or len(values) < 2 or len(values) != len(counts):
        raise InputError(
            f"{name} must be two knots or more with one multiplicity each, got {values.shape} and {len(counts)}"
        )
    if not np.isfinite(values).all() or (np.diff(values) <= 0).any():
        raise InputError(f"{name} must be finite and strictly increasing, got {values.tolist()}")
    if counts[0] != degree + 1 or counts[-1] != degree + 1:
        raise InputError(f"{name} must be clamped: end multiplicities {degree + 1}, got {counts[0]} and {counts[-1]}")
    if any(not 1 <= m <= degree for m in counts[1:-1]):
        raise InputError(f"{name}: interior multiplicities must lie in [1, {degree}], got {counts[1:-1]}")
    if sum(counts) != count + degree + 1:
        raise InputError(
            f"{name}: multiplicities must add up to poles + degree + 1 = {count + degree + 1}, got {sum(counts)}"
        )
    values.flags.writeable = False
    return values, counts


@dataclass(frozen=True, eq=False)
class BSplineCurve:
    """A clamped, non-periodic B-spline curve, rational when it has weights.

    Parameters
    ----------
    control_points
        Shape (n, d), d = 2 or 3.
    knots
        Distinct knots, strictly increasing.
    multiplicities
        One for each knot; degree + 1 at both ends.
    degree
        1 to 25.
    weights
        Shape (n,), positive, or None.

    Raises
    ------
    InputError
        When the arrays do not describe such a curve.

    Examples
    --------
    >>> BSplineCurve([[0, 0], [1, 2], [2, 0]], [0, 1], [3, 3], 2).evaluate(0.5)
    array([1., 1.])
    """

    control_points: Array
    knots: Array
    multiplicities: tuple[int, ...]
    degree: int
    weights: Array | None = None

    def __init__(
        self,
        control_points: ArrayLike,
        knots: ArrayLike,
        multiplicities: Sequence[int] | NDArray[np.int_],
        degree: int,
        weights: ArrayLike | None = None,
    ) -> None:
        points = _points("control_points", control_points, 2)
        values, counts = _knots("knots", knots, multiplicities, degree, len(points))
        object.__setattr__(self, "control_points", points)
        object.__setattr__(self, "knots", values)
        object.__setattr__(self, "multiplicities", counts)
        object.__setattr__(self, "degree", int(degree))
        object.__setattr__(self, "weights", _weights(weights, points.shape[:1]))

    @property
    def dimension(self) -> int:
        """Space dimension d."""
        return int(self.control_points.shape[-1])

    @property
    def flat_knots(self) -> Array:
        """Each knot repeated by its multiplicity, shape (n + degree + 1,)."""
        return np.repeat(self.knots, self.multiplicities)

    @property
    def homogeneous(self) -> Array:
        """Control points times weight, then the weight: shape (n, d + 1); just the control points without weights."""
        return _homogeneous(self.control_points, self.weights)

    def evaluate(self, t: ArrayLike) -> Array:
        """Points at the parameters t, shape t.shape + (d,)."""
        from scipy.interpolate import BSpline

        values = BSpline(self.flat_knots, self.homogeneous, self.degree)(np.asarray(t, dtype=np.float64))
        return _project(np.asarray(values), self.weights)

    def __reduce__(self) -> tuple[object, ...]:
        return BSplineCurve, (self.control_points, self.knots, self.multiplicities, self.degree, self.weights)

    @property
    def domain(self) -> tuple[float, float]:
        """First and last parameter."""
        return float(self.knots[0]), float(self.knots[-1])

    def derivative(self, t: ArrayLike, order: int = 1) -> Array:
        """Derivatives of the order with respect to the spline's own parameter, 0 the point: shape t.shape + (d,)."""
        from scipy.interpolate import BSpline

        order = checked_order("order", order)
        spline = BSpline(self.flat_knots, self.homogeneous, self.degree)
        t = np.asarray(t, dtype=np.float64)
        values = [np.asarray(spline(t, k)) for k in range(order + 1)]
        if self.weights is None:
            return values[order]
        found: list[Array] = []
        for k, value in enumerate(values):  # Leibniz' rule for C w = X, solved for the k-th derivative of C
            lower = sum(math.comb(k, i) * values[i][..., -1:] * found[k - i] for i in range(1, k + 1))
            found.append((value[..., :-1] - lower) / values[0][..., -1:])
        return found[order]


@dataclass(frozen=True, eq=False)
class BSplineSurface:
    """A clamped, non-periodic tensor-product B-spline surface, rational when it has weights.

    Parameters
    ----------
    control_points
        Shape (nu, nv, d), d = 2 or 3.
    knots_u, knots_v
        Distinct knots, strictly increasing.
    multiplicities_u, multiplicities_v
        One for each knot; degree + 1 at both ends.
    degree_u, degree_v
        1 to 25.
    weights
        Shape (nu, nv), positive, or None.

    Raises
    ------
    InputError
        When the arrays do not describe such a surface.
    """

    control_points: Array
    knots_u: Array
    multiplicities_u: tuple[int, ...]
    degree_u: int
    knots_v: Array
    multiplicities_v: tuple[int, ...]
    degree_v: int
    weights: Array | None = None

    def __init__(
        self,
        control_points: ArrayLike,
        knots_u: ArrayLike,
        multiplicities_u: Sequence[int] | NDArray[np.int_],
        degree_u: int,
        knots_v: ArrayLike,
        multiplicities_v: Sequence[int] | NDArray[np.int_],
        degree_v: int,
        weights: ArrayLike | None = None,
    ) -> None:
        points = _points("control_points", control_points, 3)
        values_u, counts_u = _knots("knots_u", knots_u, multiplicities_u, degree_u, points.shape[0])
        values_v, counts_v = _knots("knots_v", knots_v, multiplicities_v, degree_v, points.shape[1])
        object.__setattr__(self, "control_points", points)
        object.__setattr__(self, "knots_u", values_u)
        object.__setattr__(self, "multiplicities_u", counts_u)
        object.__setattr__(self, "degree_u", int(degree_u))
        object.__setattr__(self, "knots_v", values_v)
        object.__setattr__(self, "multiplicities_v", counts_v)
        object.__setattr__(self, "degree_v", int(degree_v))
        object.__setattr__(self, "weights", _weights(weights, points.shape[:2]))

    @property
    def dimension(self) -> int:
        """Space dimension d."""
        return int(self.control_points.shape[-1])

    @property
    def flat_knots_u(self) -> Array:
        """Each u knot repeated by its multiplicity, shape (nu + degree_u + 1,)."""
        return np.repeat(self.knots_u, self.multiplicities_u)

    @property
    def flat_knots_v(self) -> Array:
        """Each v knot repeated by its multiplicity, shape (nv + degree_v + 1,)."""
        return np.repeat(self.knots_v, self.multiplicities_v)

    @property
    def homogeneous(self) -> Array:
        """Control points times weight, then the weight: (nu, nv, d + 1); just the control points without weights."""
        return _homogeneous(self.control_points, self.weights)

    def evaluate(self, u: ArrayLike, v: ArrayLike) -> Array:
        """Points at the parameters (u, v), which broadcast: shape broadcast(u, v).shape + (d,)."""
        places = np.stack(
            np.broadcast_arrays(np.asarray(u, dtype=np.float64), np.asarray(v, dtype=np.float64)), axis=-1
        )
        return _project(np.asarray(self._evaluable(places)), self.weights)

    @cached_property
    def _evaluable(self) -> Any:
        """The homogeneous control points as scipy's spline."""
        from scipy.interpolate import NdBSpline

        return NdBSpline((self.flat_knots_u, self.flat_knots_v), self.homogeneous, (self.degree_u, self.degree_v))

    @property
    def domain(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """First and last u, first and last v."""
        u, v = self.knots_u, self.knots_v
        return (float(u[0]), float(u[-1])), (float(v[0]), float(v[-1]))

    def derivative(self, u: ArrayLike, v: ArrayLike, orders: tuple[int, int] = (1, 0)) -> Array:
        """Partial derivatives of the orders (in u, in v), (0, 0) the point: shape broadcast(u, v).shape + (d,)."""
        order_u, order_v = (checked_order(f"orders[{k}]", order) for k, order in enumerate(orders))
        places = np.stack(
            np.broadcast_arrays(np.asarray(u, dtype=np.float64), np.asarray(v, dtype=np.float64)), axis=-1
        )
        spline = self._evaluable
        if self.weights is None:
            return np.asarray(spline(places, nu=(order_u, order_v)))
        values = {(i, j): np.asarray(spline(places, nu=(i, j))) for i in range(order_u + 1) for j in range(order_v + 1)}
        found: dict[tuple[int, int], Array] = {}
        for (k, m), value in values.items():  # Leibniz' rule for S w = X, solved for the derivative of S
            lower = sum(
                math.comb(k, i) * math.comb(m, j) * values[i, j][..., -1:] * found[k - i, m - j]
                for i in range(k + 1)
                for j in range(m + 1)
                if i + j > 0
            )
            found[k, m] = (value[..., :-1] - lower) / values[0, 0][..., -1:]
        return found[order_u, order_v]

    def derivatives(self, u: ArrayLike, v: ArrayLike) -> tuple[Array, Array]:
        """First partial derivatives in u and in v at (u, v), which broadcast: each broadcast(u, v).shape + (d,)."""
        return self.derivative(u, v, (1, 0)), self.derivative(u, v, (0, 1))

    def __reduce__(self) -> tuple[object, ...]:
        along_u = self.knots_u, self.multiplicities_u, self.degree_u
        along_v = self.knots_v, self.multiplicities_v, self.degree_v
        return BSplineSurface, (self.control_points, *along_u, *along_v, self.weights)

    def transposed(self) -> BSplineSurface:
        """The same points with u and v exchanged."""
        return BSplineSurface(
            self.control_points.swapaxes(0, 1),
            self.knots_v,
            self.multiplicities_v,
            self.degree_v,
            self.knots_u,
            self.multiplicities_u,
            self.degree_u,
            None if self.weights is None else self.weights.T,
        )

    def with_control_points(self, control_points: ArrayLike) -> BSplineSurface:
        """The surface over the same knots and weights with other control points."""
        return BSplineSurface(
            control_points,
            self.knots_u,
            self.multiplicities_u,
            self.degree_u,
            self.knots_v,
            self.multiplicities_v,
            self.degree_v,
            self.weights,
        )

    def boundary(self, side: str) -> BSplineCurve:
        """The isoparametric curve of one side, "u0", "u1" (constant u), "v0" or "v1" (constant v): its own poles."""
        checked_side(side)
        row = 0 if side[1] == "0" else -1
        if side[0] == "u":
            weights = None if self.weights is None else self.weights[row]
            return BSplineCurve(self.control_points[row], self.knots_v, self.multiplicities_v, self.degree_v, weights)
        weights = None if self.weights is None else self.weights[:, row]
        return BSplineCurve(self.control_points[:, row], self.knots_u, self.multiplicities_u, self.degree_u, weights)


def _homogeneous(points: Array, weights: Array | None) -> Array:
    if weights is None:
        return points
    return np.concatenate([points * weights[..., None], weights[..., None]], axis=-1)


def _project(values: Array, weights: Array | None) -> Array:
    return values if weights is None else values[..., :-1] / values[..., -1:]
