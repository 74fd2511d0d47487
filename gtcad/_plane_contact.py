"""What two plane families have in common where they meet: lines, points, curvatures, derivatives."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gtcad.continuity import Scale
from gtcad.errors import SingularJoin
from gtcad.patches.developable import PlaneFamily

Array = NDArray[np.float64]
Weights = tuple[float, float, float, float]

STILL = 1e-10  # of the planes' size: a first derivative that leaves the ruling undetermined


@dataclass(frozen=True)
class Local:
    """A family at one parameter: unit normal and ruling, offset, foot, regression point, and its derivatives."""

    normal: Array
    offset: float
    ruling: Array
    foot: Array
    regression: Array | None
    derivatives: Array

    @classmethod
    def of(cls, derivatives: Array) -> Local:
        (n, slope, bend), (d, rate, change) = derivatives[:3, :3], derivatives[:3, 3]
        along = np.cross(n, slope)
        square, size = float(along @ along), float(np.linalg.norm(n))
        if square <= (STILL * size * max(float(np.linalg.norm(slope)), STILL * size)) ** 2:
            raise SingularJoin("a family stands still at the joint: it has no ruling there", 0.0)
        foot = (d * np.cross(slope, along) + rate * np.cross(along, n)) / square
        ruling = along / math.sqrt(square)
        turn = float(bend @ ruling)
        regression = None
        if abs(turn) > STILL * float(np.linalg.norm(bend)):
            regression = foot + (change - float(bend @ foot)) / turn * ruling
        return cls(n / size, float(d) / size, ruling, foot, regression, derivatives)

    def radius_at(self, point: Array, direction: Array, reach: float) -> Array:
        """The radius of curvature ``|n|^3 (d'' - n''.x) / |n x n'|^2`` at a point, and its slope, along the normal."""
        n, slope, bend = self.derivatives[:3, :3]
        factor = float(np.linalg.norm(n)) ** 3 / float(np.sum(np.cross(n, slope) ** 2))
        at = factor * (self.derivatives[2, 3] - bend @ point)
        return np.concatenate([at * self.normal, -reach * factor * (bend @ direction) * self.normal])


def seen_from(point: Array, reach: float, planes: Array) -> Array:
    """Planes (n, d), shape (..., 4), with the origin in a point, and d in units of the reach."""
    normals = planes[..., :3]
    return np.concatenate([normals, (planes[..., 3:] - normals @ point[:, None]) / reach], axis=-1)


def largest(family: PlaneFamily, point: Array, reach: float) -> Array:
    """Bounds of the planes, seen in the same way, and of all derivatives up to the first, second and third."""
    rows = seen_from(point, reach, family.control_planes)
    bounds = [family.basis.derivative_bound(order) for order in range(4)]
    return np.asarray(np.maximum.accumulate(bounds) * np.linalg.norm(rows, axis=1).max())


def fitted(old: Array, new: Array, least: tuple[float, float]) -> tuple[Scale, Weights, float]:
    """Scale factors and weights order by order, and what is left of the third derivatives.

    NaN for planes at right angles.
    """
    rho = float(new[0] @ old[0] / (old[0] @ old[0]))
    if abs(rho) <= STILL * float(np.linalg.norm(new[0]) / np.linalg.norm(old[0])):
        nan = math.nan
        return (nan, nan, nan), (0.0, nan, nan, nan), nan
    new = new / rho
    basis = np.column_stack([old[1], old[0]])
    (eta, a_1), *_ = np.linalg.lstsq(basis, new[1], rcond=None)
    known = eta**2 * old[2] + 2 * a_1 * eta * old[1]
    (psi, a_2), *_ = np.linalg.lstsq(basis, new[2] - known, rcond=None)
    known = eta**3 * old[3] + 3 * eta * psi * old[2]
    known = known + 3 * a_1 * (eta**2 * old[2] + psi * old[1]) + 3 * a_2 * eta * old[1]
    (omega, a_3), *_ = np.linalg.lstsq(basis, new[3] - known, rcond=None)
    model = known + omega * old[1] + a_3 * old[0]
    scale = float(eta), float(psi), float(omega)
    return scale, (rho, float(a_1), float(a_2), float(a_3)), relative(model, new[3], max(least[0], least[1] / abs(rho)))


def relative(a: Array, b: Array, least: float = 0.0) -> float:
    larger = max(float(np.linalg.norm(a)), float(np.linalg.norm(b)), least)
    return float(np.linalg.norm(b - a)) / larger if larger else 0.0


def angle_deg(a: Array, b: Array) -> float:
    """By the chord, which keeps its digits for small angles."""
    return math.degrees(2 * math.asin(min(1.0, float(np.linalg.norm(b - a)) / 2)))


def gap(a: Array | None, b: Array | None) -> float:
    if a is None or b is None:
        return 0.0 if a is b else math.inf
    return float(np.linalg.norm(b - a))
