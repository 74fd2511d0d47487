"""A surface whose parameter along one side runs at the pace of another surface's side: for joints of what is slid."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad._sides import DerivableSurface
from gtcad.converters.bspline import BSplineSurface
from gtcad.converters.nearest import PointSet, nearest
from gtcad.errors import InputError
from gtcad.protocol import SeparableSurface

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

Array = NDArray[np.float64]
Bounds = tuple[float, float]
Surface = BSplineSurface | SeparableSurface

_COUNT, _DEGREE = 97, 5
_AT_ENDS = 1e-9  # of the domain: feet as near to its ends are these


@dataclass(frozen=True, eq=False)
class Paced:
    """A surface over [0, 1]^2 with one of its parameters replaced by a function of it.

    Parameters
    ----------
    surface
        As it is.
    along
        The parameter that is replaced, "u" or "v".
    pace
        A spline from [0, 1] to [0, 1], growing or falling.
    """

    surface: Surface
    along: str
    pace: BSpline

    @property
    def domain(self) -> tuple[Bounds, Bounds]:
        """The unit square."""
        return (0.0, 1.0), (0.0, 1.0)

    @cached_property
    def _own(self) -> tuple[Bounds, Bounds]:
        return self.domain if isinstance(self.surface, SeparableSurface) else self.surface.domain

    def derivative(self, u: ArrayLike, v: ArrayLike, orders: tuple[int, int] = (1, 0)) -> Array:
        """Partial derivatives of the orders, each up to 3, by the chain rule."""
        u, v = np.broadcast_arrays(np.asarray(u, dtype=np.float64), np.asarray(v, dtype=np.float64))
        y, across, order = (v, orders[0], orders[1]) if self.along == "v" else (u, orders[1], orders[0])
        if order > 3:
            raise InputError(f"derivatives along a side go up to order 3, got {order}")
        slid = np.clip(self.pace(y), 0.0, 1.0)
        first, second, third = (np.asarray(self.pace(y, k)) for k in (1, 2, 3))
        one = np.ones_like(first)
        weights = {
            0: {0: one},
            1: {1: first},
            2: {2: first**2, 1: second},
            3: {3: first**3, 2: 3 * first * second, 1: third},
        }[order]
        total: Array | float = 0.0
        for k, weight in weights.items():
            found = self._at(u, slid, (across, k)) if self.along == "v" else self._at(slid, v, (k, across))
            total = total + weight[..., None] * found
        return np.asarray(total)

    def _at(self, u: Array, v: Array, orders: tuple[int, int]) -> Array:
        (u0, u1), (v0, v1) = self._own
        places = np.clip(u0 * (1 - u) + u1 * u, u0, u1), np.clip(v0 * (1 - v) + v1 * v, v0, v1)
        return (u1 - u0) ** orders[0] * (v1 - v0) ** orders[1] * self.surface.derivative(*places, orders)


def paced(surface: Surface, side: str, other: Surface, other_side: str) -> DerivableSurface:
    """The surface with its side run through as the other surface's side is, by nearest points."""
    from scipy.interpolate import make_interp_spline

    y = (1 - np.cos(np.pi * np.arange(_COUNT) / (_COUNT - 1))) / 2
    target = PointSet.measured(1, lambda p: _along(surface, side, p[:, 0], 0), lambda p: _tangents(surface, side, p))
    feet = nearest(_along(other, other_side, y, 0), target).places[:, 0]
    feet = np.where(feet <= _AT_ENDS, 0.0, np.where(feet >= 1 - _AT_ENDS, 1.0, feet))
    pace = make_interp_spline(y, feet, _DEGREE)
    return Paced(surface, "v" if side[0] == "u" else "u", pace)


def _tangents(surface: Surface, side: str, places: Array) -> Array:
    return _along(surface, side, places[:, 0], 1)[:, None]


def _along(surface: Surface, side: str, y: Array, order: int) -> Array:
    """Points or derivatives along a side, its parameter on [0, 1]."""
    (u0, u1), (v0, v1) = ((0.0, 1.0), (0.0, 1.0)) if isinstance(surface, SeparableSurface) else surface.domain
    last = side[1] == "1"
    if side[0] == "u":
        fixed, t = np.full(y.shape, u1 if last else u0), np.clip(v0 * (1 - y) + v1 * y, v0, v1)
        return (v1 - v0) ** order * surface.derivative(fixed, t, (0, order))
    fixed, t = np.full(y.shape, v1 if last else v0), np.clip(u0 * (1 - y) + u1 * y, u0, u1)
    return (u1 - u0) ** order * surface.derivative(t, fixed, (order, 0))
