"""Quilts whose bodies are known exactly."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from gtcad import BERNSTEIN, Curve, Surface
from gtcad.converters.quilt_fit import QuiltFit, fit_quilt
from gtcad.factors import CurveOfTerms, Waves
from gtcad.patches.rotation import Rotation
from gtcad.protocol import SeparableSurface
from gtcad.quilt import Quilt

ORIGIN, AXIS = [0, 0, 0], [0, 0, 1]


def bilinear(corners) -> Surface:
    return Surface(corners, family_u=BERNSTEIN, family_v=BERNSTEIN)


def variant(points: np.ndarray, number: int) -> np.ndarray:
    """One of the eight ways to run through a net: transposed, reversed in u, in v."""
    points = points.swapaxes(0, 1) if number & 1 else points
    points = points[::-1] if number & 2 else points
    return points[:, ::-1] if number & 4 else points


def box(size: Sequence[float] = (10, 20, 30), variants: Iterable[int] = (0,) * 6) -> list[Surface]:
    patches = []
    for face, number in zip(range(6), variants, strict=True):
        axis, end = divmod(face, 2)
        corners = np.full((2, 2, 3), float(end))
        for i, j in np.ndindex(2, 2):
            corners[i, j, (axis + 1) % 3], corners[i, j, (axis + 2) % 3] = i, j
        patches.append(bilinear(variant(corners, number) * size))
    return patches


def circle(x: float, radius: float, start_deg: float = 0.0, angle_deg: float = 360.0) -> CurveOfTerms:
    """An arc in the plane y = 0."""
    waves = Waves(math.radians(start_deg), math.radians(angle_deg))
    return CurveOfTerms(waves, np.array([[x, 0, 0], [radius, 0, 0], [0, 0, radius]], dtype=float))


def sphere(radius: float = 2.0) -> Rotation:
    return Rotation(circle(0, radius, -90, 180), ORIGIN, AXIS)


def torus(major: float = 5.0, minor: float = 2.0) -> Rotation:
    return Rotation(circle(major, minor), ORIGIN, AXIS)


def cylinder(radius: float = 2.0, height: float = 3.0) -> Rotation:
    return Rotation(Curve([[radius, 0, 0], [radius, 0, height]], family=BERNSTEIN), ORIGIN, AXIS)


def barrel() -> Rotation:
    """The cross-section area is that of a quarter ellipse: the GT arc of degree 2 from (4, 0) over (6, 3) to (3, 5)."""
    return Rotation(Curve([[4, 0, 0], [6, 0, 3], [3, 0, 5]]), ORIGIN, AXIS)


def barrel_volume() -> float:
    """The integral of pi r^2 dz along the meridian, by quadrature of the basis 1 - s, s + c - 1, 1 - c."""
    x, w = np.polynomial.legendre.leggauss(60)
    angle = (x + 1) * math.pi / 4
    s, c = np.sin(angle), np.cos(angle)
    radius = 4 * (1 - s) + 6 * (s + c - 1) + 3 * (1 - c)
    slope = 3 * (c - s) + 5 * s
    return float(math.pi * (radius**2 * slope) @ w * math.pi / 4)


def fitted(patches: Iterable[SeparableSurface], tolerance: float = 1e-5) -> QuiltFit:
    return fit_quilt(Quilt.recognised(patches), tolerance=tolerance)
