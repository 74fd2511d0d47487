"""Surfaces of rotation through any angle, their circles exact."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.basis import Basis
from gtcad.errors import InputError
from gtcad.factors import RestrictedFactors, SurfaceOfTerms, Waves
from gtcad.patches._patch import (
    Patch,
    Rows,
    Vector,
    checked_curves,
    checked_direction,
    checked_number,
    checked_placement,
    checked_vector,
    followed,
    handedness,
    in_space,
    placed,
)
from gtcad.protocol import Factors, SeparableCurve, affine

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Rotation(Patch):
    """The surface of rotation of a profile u -> C(u); v turns it about an axis, at even speed.

    With p and k the axis, a the foot of C(u) on it, r = C(u) - a and theta = start + v angle,

        ``S(u, v) = a(u) + r(u) cos(theta) + (k x r(u)) sin(theta)``.

    Parameters
    ----------
    profile
        C; a plane one lies at z = 0. It need not lie in a plane with the axis.
    axis_point, axis_direction
        p, and k of any length but 0; turning is counterclockwise seen against k.
    angle_deg
        From -360 to 360 degrees, not 0. A full turn closes.
    start_deg
        The angle in degrees at v = 0.
    placement
        Rows ``[matrix | translation]`` of an affine map that the surface is moved by afterwards, shape (2 or 3, 4).

    Raises
    ------
    InputError
        When an argument is out of its range.

    Notes
    -----
    Circles are exact at every angle. Up to 90 degrees the functions of v are those of degree 2 (on a part of their
    domain), so that the patch has an exact rational form when its profile has one; ``quarters`` divides other angles.

    Examples
    --------
    A point at height 3 turned by half a turn about the z axis:

    >>> from gtcad import BERNSTEIN, Curve
    >>> tube = Rotation(Curve([[1, 0, 0], [1, 0, 3]], family=BERNSTEIN), [0, 0, 0], [0, 0, 1], 180)
    >>> tube.evaluate(1.0, 1.0).round(12).tolist()
    [-1.0, 0.0, 3.0]
    """

    profile: SeparableCurve
    axis_point: Vector
    axis_direction: Vector
    angle_deg: float = 360.0
    start_deg: float = 0.0
    placement: Rows | None = None

    def __init__(
        self,
        profile: SeparableCurve,
        axis_point: ArrayLike,
        axis_direction: ArrayLike,
        angle_deg: float = 360.0,
        start_deg: float = 0.0,
        placement: ArrayLike | None = None,
    ) -> None:
        checked_curves(profile=profile)
        object.__setattr__(self, "profile", in_space(profile))
        object.__setattr__(self, "axis_point", checked_vector("axis_point", axis_point))
        object.__setattr__(self, "axis_direction", checked_direction("axis_direction", axis_direction))
        object.__setattr__(self, "angle_deg", checked_number("angle_deg", angle_deg))
        object.__setattr__(self, "start_deg", checked_number("start_deg", start_deg))
        object.__setattr__(self, "placement", checked_placement(placement))
        if not 0 < abs(self.angle_deg) <= 360:
            raise InputError(f"angle_deg must lie in [-360, 360] and not be 0, got {self.angle_deg:g}")

    def quarters(self) -> tuple[Rotation, ...]:
        """The same surface as equal parts of at most 90 degrees, in order: exactly rational if the profile is."""
        count = math.ceil(abs(self.angle_deg) / 90)
        part = self.angle_deg / count
        return tuple(replace(self, angle_deg=part, start_deg=self.start_deg + k * part) for k in range(count))

    def _built(self) -> SurfaceOfTerms:
        axis = np.array(self.axis_direction) / math.hypot(*self.axis_direction)
        curve = self.profile.transformed(np.eye(3), -np.array(self.axis_point))
        foot = np.outer(curve.coefficients @ axis, axis)
        out = curve.coefficients - foot
        across = np.cross(axis, out)
        cosine, sine = _cosine(self.start_deg), _cosine(self.start_deg - 90)
        first, second = cosine * out + sine * across, cosine * across - sine * out
        factors, matrix = self._turning()
        coefficients = np.einsum("jk,kid->ijd", matrix, np.stack([foot, first, second]))
        local = SurfaceOfTerms(curve.factors, factors, coefficients)
        return placed(local.transformed(np.eye(3), self.axis_point), self.placement)

    def _turning(self) -> tuple[Factors, Array]:
        """Functions of v, and the matrix to their coefficients from those of 1, cos and sin of the angle turned."""
        if abs(self.angle_deg) > 90:
            return Waves(0.0, math.radians(self.angle_deg)), np.eye(3)
        quarter, part, side = Basis(2), abs(self.angle_deg) / 90, math.copysign(1.0, self.angle_deg)
        factors = quarter if part == 1 else RestrictedFactors(quarter, 0.0, part)
        return factors, np.array([[1.0, 1.0, 0.0], [1.0, 1.0, side], [1.0, 0.0, side]])

    def transformed(self, matrix: ArrayLike, translation: ArrayLike | None = None) -> Rotation:
        """The affine image: points x become ``matrix @ x + translation``; of a similarity it has no placement."""
        if self.placement is None and (turn := handedness(matrix)):
            profile = self.profile.transformed(matrix, translation)
            point = affine(np.array(self.axis_point), matrix, translation)
            direction = turn * affine(np.array(self.axis_direction), matrix, None)
            return Rotation(profile, point, direction, self.angle_deg, self.start_deg)
        return replace(self, placement=followed(self.placement, matrix, translation))


def _cosine(degrees: float) -> float:
    """The cosine, exact at right angles."""
    rest = abs(math.remainder(degrees, 360.0))
    return math.sin(math.radians(90 - rest))
