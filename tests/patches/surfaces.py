"""True minimal surfaces: contours, and areas that come from elsewhere."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import mpmath as mp
import numpy as np

from gtcad import BERNSTEIN, Curve
from gtcad.factors import CurveOfTerms, Waves
from gtcad.protocol import SeparableCurve

Point = Callable[[Any, Any], Any]


@dataclass(frozen=True)
class MinimalSurface:
    """A piece of a minimal surface: c0, c1, d0, d1 and its area."""

    contour: tuple[SeparableCurve, ...]
    area: float


def through(function: Callable[[np.ndarray], Any], degree: int = 20) -> Curve:
    """The Bezier curve through a curve's points at Chebyshev parameters: the curve itself up to rounding."""
    t = (1 - np.cos(np.pi * np.arange(degree + 1) / degree)) / 2
    basis = Curve(np.zeros((degree + 1, 3)), family=BERNSTEIN).factors
    points = np.stack(np.broadcast_arrays(*function(t)), axis=-1).astype(float)
    control_points = np.linalg.solve(basis.evaluate(t), points)
    control_points[[0, -1]] = points[[0, -1]]
    return Curve(control_points, family=BERNSTEIN)


def contour_of(point: Point) -> tuple[Curve, ...]:
    """The boundary of a parametrised surface over the unit square."""
    sides = (lambda t: point(t, 0.0), lambda t: point(t, 1.0), lambda t: point(0.0, t), lambda t: point(1.0, t))
    return tuple(map(through, sides))


def line(a: Any, b: Any) -> Curve:
    return Curve([a, b], family=BERNSTEIN)


def skew_quadrilateral() -> MinimalSurface:
    a, b, c, d = [0, 0, 0], [1, 0, 1], [0, 1, 1], [1, 1, 0]
    area = float(mp.ellipk(mp.mpf(3) / 4) / mp.ellipk(mp.mpf(1) / 4))
    return MinimalSurface((line(a, b), line(c, d), line(a, c), line(b, d)), area)


def enneper_square() -> MinimalSurface:
    """Over the unit square: its own Coons patch."""
    return MinimalSurface(contour_of(_enneper), 133 / 45)


def enneper_sector() -> MinimalSurface:
    """Over a sector of a ring, radii 0.3 to 1.1, a quarter turn: area int (1 + r^2)^2 r dr da."""
    inner, outer = 0.3, 1.1

    def point(u: Any, v: Any) -> Any:
        r, a = inner + (outer - inner) * u, np.pi / 2 * v
        return _enneper(r * np.cos(a), r * np.sin(a))

    return MinimalSurface(contour_of(point), math.pi / 2 * ((1 + outer**2) ** 3 - (1 + inner**2) ** 3) / 6)


def _enneper(u: Any, v: Any) -> Any:
    return u - u**3 / 3 + u * v**2, -v + v**3 / 3 - v * u**2, u**2 - v**2


def catenoid() -> MinimalSurface:
    """A quarter turn, between heights -0.8 and 0.8: the circles are exact, and area is 2 pi int cosh^2."""
    h = 0.8
    circle = CurveOfTerms(Waves(0.0, math.pi / 2), [[0, 0, 0], [math.cosh(h), 0, 0], [0, math.cosh(h), 0]])
    low, high = (circle.transformed(np.eye(3), [0, 0, z]) for z in (-h, h))
    meridian = through(lambda t: (np.cosh(h * (2 * t - 1)), 0.0, h * (2 * t - 1)))
    turned = meridian.transformed([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    return MinimalSurface((low, high, meridian, turned), math.pi / 2 * (h + math.sinh(2 * h) / 2))


def helicoid() -> MinimalSurface:
    """(sinh p cos a, sinh p sin a, a) over a parallelogram of p and a whose sides are no rulings."""

    def place(u: Any, v: Any) -> Any:
        return 0.1 + 0.8 * u + 0.3 * v, 1.2 * v - 0.4 * u

    def point(u: Any, v: Any) -> Any:
        p, a = place(u, v)
        return np.sinh(p) * np.cos(a), np.sinh(p) * np.sin(a), a

    return MinimalSurface(contour_of(point), (0.8 * 1.2 + 0.3 * 0.4) * mean(lambda u, v: np.cosh(place(u, v)[0]) ** 2))


def scherk() -> MinimalSurface:
    """z = log(cos y / cos x) over a turned square that keeps away from |x| = pi / 2 and |y| = pi / 2."""
    half, turn = 0.75, 0.5

    def place(u: Any, v: Any) -> Any:
        p, q = half * (2 * u - 1), half * (2 * v - 1)
        return p * np.cos(turn) - q * np.sin(turn), p * np.sin(turn) + q * np.cos(turn)

    def point(u: Any, v: Any) -> Any:
        x, y = place(u, v)
        return x, y, np.log(np.cos(y) / np.cos(x))

    def density(u: Any, v: Any) -> Any:
        x, y = place(u, v)
        return np.sqrt(1 + np.tan(x) ** 2 + np.tan(y) ** 2)

    return MinimalSurface(contour_of(point), 4 * half**2 * mean(density))


def mean(function: Point) -> float:
    """Of an analytic function over the unit square."""
    x, weights = np.polynomial.legendre.leggauss(60)
    t = (x + 1) / 2
    return float(weights @ function(t[:, None], t[None, :]) @ weights) / 4


SURFACES: dict[str, Callable[[], MinimalSurface]] = {
    "skew quadrilateral": skew_quadrilateral,
    "Enneper, square": enneper_square,
    "Enneper, sector": enneper_sector,
    "catenoid": catenoid,
    "helicoid": helicoid,
    "Scherk": scherk,
}
