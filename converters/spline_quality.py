"""What makes a B-spline good or bad for CAM: degree, poles, knots that are close together or kinked."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from gtcad.converters.bspline import Array, BSplineCurve, BSplineSurface

_SAMPLES = 17  # along a knot line of a surface
_ASIDE = 1e-7  # share of a span by which a kink is looked at from both sides

Point = tuple[float, float, float]


@dataclass(frozen=True)
class SplineQuality:
    """Figures of one spline.

    Attributes
    ----------
    degrees
        Of each direction.
    poles
        Their number.
    rational
        Whether it has weights.
    multiple_knots
        How many inner knots are multiple.
    knot_distance, knot_place
        The least distance in space between neighbouring knots, for a surface the largest along their lines, and
        where; None without inner knots.
    knot_angle, angle_place
        The largest angle in degrees at inner knots of full multiplicity, where the spline may have a kink, and where;
        None without such knots.
    """

    degrees: tuple[int, ...]
    poles: int
    rational: bool
    multiple_knots: int
    knot_distance: float | None
    knot_place: Point | None
    knot_angle: float | None
    angle_place: Point | None

    @property
    def degree(self) -> int:
        """The higher of the degrees."""
        return max(self.degrees)


def curve_quality(curve: BSplineCurve) -> SplineQuality:
    """The figures of a curve in space."""
    distance, angle = None, None
    if len(curve.knots) > 2:
        points = curve.evaluate(curve.knots)
        lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
        distance = float(lengths.min()), _point(points[int(lengths.argmin())])
    for knot, before, after in _kinks(curve.knots, curve.multiplicities, curve.degree):
        found = float(_angles(curve.derivative(before), curve.derivative(after)))
        if angle is None or found > angle[0]:
            angle = found, _point(curve.evaluate(knot))
    several = sum(count > 1 for count in curve.multiplicities[1:-1])
    return SplineQuality(
        (curve.degree,),
        len(curve.control_points),
        curve.weights is not None,
        several,
        *(distance or (None, None)),
        *(angle or (None, None)),
    )


def surface_quality(surface: BSplineSurface) -> SplineQuality:
    """The figures of a surface in space; angles between its tangent planes are sampled along the knot lines."""
    found = [_along_u(surface), _along_u(surface.transposed())]
    distances = [distance for distance, _ in found if distance is not None]
    angles = [angle for _, angle in found if angle is not None]
    counts = surface.multiplicities_u[1:-1] + surface.multiplicities_v[1:-1]
    return SplineQuality(
        (surface.degree_u, surface.degree_v),
        int(np.prod(surface.control_points.shape[:2])),
        surface.weights is not None,
        sum(count > 1 for count in counts),
        *(min(distances, default=(None, None))),
        *(max(angles, default=(None, None))),
    )


_Found = tuple[float, Point] | None


def _along_u(surface: BSplineSurface) -> tuple[_Found, _Found]:
    """The least distance between the lines of neighbouring knots of u, and the largest angle across one of them."""
    distance, angle = None, None
    v = np.linspace(surface.knots_v[0], surface.knots_v[-1], _SAMPLES)
    if len(surface.knots_u) > 2:
        points = surface.evaluate(surface.knots_u[:, None], v[None, :])
        apart = np.linalg.norm(np.diff(points, axis=0), axis=2)
        row = int(apart.max(axis=1).argmin())
        distance = float(apart[row].max()), _point(points[row, int(apart[row].argmax())])
    for knot, before, after in _kinks(surface.knots_u, surface.multiplicities_u, surface.degree_u):
        sides = [
            np.cross(surface.derivative(u, v, (1, 0)), surface.derivative(u, v, (0, 1)))
            for u in (np.full_like(v, before), np.full_like(v, after))
        ]
        angles = _angles(sides[0], sides[1])
        place = int(angles.argmax())
        if angle is None or angles[place] > angle[0]:
            angle = float(angles[place]), _point(surface.evaluate(knot, v[place]))
    return distance, angle


def _kinks(knots: Array, multiplicities: tuple[int, ...], degree: int) -> list[tuple[float, float, float]]:
    """Inner knots of full multiplicity, with parameters just before and after each."""
    found = []
    for index, ((a, b), count) in enumerate(zip(pairwise(knots.tolist()), multiplicities[1:], strict=True)):
        if count >= degree and index + 2 < len(knots):
            c = float(knots[index + 2])
            found.append((b, b - _ASIDE * (b - a), b + _ASIDE * (c - b)))
    return found


def _angles(first: Array, second: Array) -> Array:
    """Angles between vectors in degrees; 0 where one of them is none."""
    cross = np.linalg.norm(np.cross(first, second), axis=-1)
    angles: Array = np.degrees(np.arctan2(cross, (first * second).sum(axis=-1)))
    return angles


def _point(value: Array) -> Point:
    x, y, z = np.asarray(value).reshape(3).tolist()
    return x, y, z
