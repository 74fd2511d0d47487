"""The four sides of a patch, all seen alike: a parameter across the side and one along it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad._jets import norm, space
from gtcad.basis import Basis
from gtcad.chebyshev import UNIT_ROUNDOFF
from gtcad.errors import InputError
from gtcad.factors import RestrictedFactors
from gtcad.protocol import Factors, SeparableSurface, checked_side

Array = NDArray[np.float64]
Bounds = tuple[float, float]

_END_UNITS = 20  # roundings in a derivative of a basis at its end, and in its product with the control points


class DerivableSurface(Protocol):
    """A surface, or a spline, with partial derivatives on a domain."""

    @property
    def domain(self) -> tuple[Bounds, Bounds]:
        """First and last u, first and last v."""
        ...

    def derivative(self, u: ArrayLike, v: ArrayLike, orders: tuple[int, int] = (1, 0)) -> Array:
        """Partial derivatives of the orders, (0, 0) the point, shape broadcast(u, v).shape + (d,)."""
        ...


@dataclass(frozen=True)
class Side:
    """One side of a patch: x runs across it, out of the patch or into it, y along it, both over [0, 1]."""

    surface: SeparableSurface | DerivableSurface
    name: str
    outward: bool
    backwards: bool = False

    def __post_init__(self) -> None:
        checked_side(self.name)

    @property
    def domain(self) -> tuple[Bounds, Bounds]:
        """Of the surface."""
        return ((0.0, 1.0), (0.0, 1.0)) if isinstance(self.surface, SeparableSurface) else self.surface.domain

    @property
    def sign(self) -> float:
        """Of the surface's own parameter across the edge, along x."""
        return 1.0 if (self.name[1] == "1") == self.outward else -1.0

    @cached_property
    def dimension(self) -> int:
        return int(self._own(np.zeros(1), (0, 0)).shape[-1])

    @cached_property
    def size(self) -> float:
        """Of the whole patch, from samples."""
        u, v = (np.linspace(*bounds, 9) for bounds in self.domain)
        points = self.surface.derivative(u[:, None], v[None, :], (0, 0))
        return float(np.ptp(points.reshape(-1, points.shape[-1]), axis=0).max())

    def parameter(self, y: float) -> float:
        """The surface's own parameter along the edge."""
        start, end = self.domain[1 if self.name[0] == "u" else 0]
        part = 1 - y if self.backwards else y
        return float(start * (1 - part) + end * part)

    def derivative(self, y: Array, orders: tuple[int, int]) -> Array:
        """Partial derivatives of the orders (in x, in y) on the side, in space: shape (y.size, 3)."""
        (u0, u1), (v0, v1) = self.domain
        across, along = (u1 - u0, v1 - v0) if self.name[0] == "u" else (v1 - v0, u1 - u0)
        factor = (self.sign * across) ** orders[0] * (-along if self.backwards else along) ** orders[1]
        return np.asarray(factor * space(self._own(1 - y if self.backwards else y, orders)))

    def _own(self, y: Array, orders: tuple[int, int]) -> Array:
        (u0, u1), (v0, v1) = self.domain
        last = self.name[1] == "1"
        if self.name[0] == "u":
            return self.surface.derivative(np.full(y.shape, u1 if last else u0), v0 * (1 - y) + v1 * y, orders)
        place = np.full(y.shape, v1 if last else v0)
        return self.surface.derivative(u0 * (1 - y) + u1 * y, place, (orders[1], orders[0]))


@dataclass(frozen=True)
class SeparableSide(Side):
    """One side of a shape of the protocol: derivatives by x are curves of the protocol."""

    surface: SeparableSurface

    @cached_property
    def along(self) -> Factors:
        """The functions of y."""
        own = self.surface.factors_v if self.name[0] == "u" else self.surface.factors_u
        return RestrictedFactors(own, 1.0, 0.0) if self.backwards else own

    def coefficients(self, order: int) -> Array:
        """Coefficients of the derivative by x over ``along``, shape (count, d)."""
        row, points, _ = self._acting(order)
        return np.asarray(np.tensordot(row, points, 1))

    def rounding(self, order: int) -> float:
        """Bound of the rounding errors of the curve of the coefficients."""
        _, points, units = self._acting(order)
        return units * float(norm(points).max()) * self.along.derivative_bound(0)

    def _acting(self, order: int) -> tuple[Array, Array, float]:
        """Derivatives of the functions across the side, the coefficients they act on, and the errors of their sum.

        At the ends of a basis order + 1 functions act, their waves being 0 or 1; and as they sum to 1, their
        derivatives act on differences of control points.
        """
        across, points = self.surface.factors_u, self.surface.coefficients
        if self.name[0] == "v":
            across, points = self.surface.factors_v, points.swapaxes(0, 1)
        bound = across.derivative_bound(order)
        row = across.rows(np.array([float(self.name[1])]), order)[:, 0] * self.sign**order
        if not isinstance(across, Basis):
            return row, points, bound * (across.rounding + (across.count + 2) * UNIT_ROUNDOFF)
        acting = slice(order + 1) if self.name[1] == "0" else slice(-order - 1, None)
        if order == 0:
            return row[acting], points[acting], 0.0
        return row[acting], (points - points[-int(self.name[1])])[acting], bound * _END_UNITS * UNIT_ROUNDOFF


def side_of(
    surface: SeparableSurface | DerivableSurface, name: str, *, outward: bool, backwards: bool = False
) -> Side | SeparableSide:
    """A side of a surface, of the protocol or not.

    Raises
    ------
    InputError
        When it is no surface, or the name none of a side.
    """
    kind = SeparableSide if isinstance(surface, SeparableSurface) else Side
    if not (kind is SeparableSide or (hasattr(surface, "derivative") and hasattr(surface, "domain"))):
        raise InputError(f"a surface with a domain and derivatives is wanted, got {type(surface).__name__}")
    return kind(surface, name, outward, backwards)  # type: ignore[arg-type]
