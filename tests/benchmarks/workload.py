"""What the comparisons run on, and how far a result truly is: dense samples, independent of every certificate."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.interpolate import BSpline
from scipy.spatial import cKDTree

from gtcad import Curve
from gtcad.converters import approximation, certificate, fit, spline_basis
from tests import pieces

SEED = 20
RANDOM = 20
TOLERANCES = (1e-2, 1e-4, 1e-6)
DEGREES = (3, 5, 7)
_DENSE = 3001

Array = np.ndarray
Evaluate = Callable[[Array], Array]


@dataclass(frozen=True)
class Result:
    """A spline curve that somebody made: its poles, how far it is and how long it took."""

    poles: int
    deviation: float
    seconds: float = 0.0


@cache
def random_curves() -> dict[str, Curve]:
    """Twenty random curves of degree 2 to 9 and about 100 mm, every other one planar."""
    rng = np.random.default_rng(SEED)
    return {f"random {i}": pieces.random_curve(rng, int(rng.integers(2, 10)), 100.0, 2 + i % 2) for i in range(RANDOM)}


def all_curves() -> dict[str, Curve]:
    return pieces.curves() | random_curves()


def spatial(points: Array) -> Array:
    """The points with a third coordinate."""
    return np.pad(points, [(0, 0)] * (points.ndim - 1) + [(0, 3 - points.shape[-1])])


def forget_kinds() -> None:
    """Nothing is cached for the next fit: it is the first of its kind."""
    kept = [approximation._of_kind, approximation._all_factors, approximation._shares]
    for cached in (*kept, certificate._direction, fit._places, spline_basis._local_values):
        cached.cache_clear()


def samples(count: int) -> Array:
    """Parameters that crowd at both ends, which is what least squares likes best."""
    return (1 - np.cos(np.linspace(0, np.pi, count))) / 2


@cache
def dense_points(curve: Curve) -> tuple[Array, Array]:
    t = np.concatenate([np.linspace(0, 1, _DENSE), samples(_DENSE)])
    return t, spatial(curve.evaluate(t))


def at_equal_parameters(curve: Curve, evaluate: Evaluate) -> float:
    """Largest distance at equal parameters over 6002 samples."""
    t, points = dense_points(curve)
    return float(np.linalg.norm(points - spatial(evaluate(t)), axis=1).max())


def to_nearest(curve: Curve, spline: BSpline) -> float:
    """Largest distance of 1001 points of the curve from the spline, whatever its parameter: kind to the spline."""
    points = spatial(curve.evaluate(np.linspace(0, 1, 1001)))
    start, end = spline.t[spline.k], spline.t[-spline.k - 1]
    grid = np.linspace(start, end, 4001)
    t = grid[cKDTree(spline(grid)).query(points)[1]]
    slope, bend = spline.derivative(1), spline.derivative(2)
    for _ in range(4):
        gap, first = spline(t) - points, slope(t)
        curvature = np.einsum("ij,ij->i", first, first) + np.einsum("ij,ij->i", gap, bend(t))
        t = np.clip(t - np.einsum("ij,ij->i", gap, first) / np.maximum(curvature, 1e-12), start, end)
    return float(np.linalg.norm(spline(t) - points, axis=1).max())
