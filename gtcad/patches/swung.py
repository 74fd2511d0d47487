"""Swung patches: a profile that a trajectory turns and stretches about an axis."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from gtcad.errors import InputError
from gtcad.factors import SurfaceOfTerms, constant_term
from gtcad.patches._patch import (
    Patch,
    Rows,
    checked_curves,
    checked_number,
    checked_placement,
    followed,
    placed,
)
from gtcad.protocol import SeparableCurve

_PLANE = 1e-12  # of the size: how far a curve may leave its plane by rounding


@dataclass(frozen=True)
class Swung(Patch):
    """The swung patch ``S(u, v) = (a x(u) X(v), a x(u) Y(v), z(u))``.

    Of two GT curves it is the tensor-product surface with the control points ``P_ij = (a x_i X_j, a x_i Y_j, z_i)``;
    with the unit circle's arc as trajectory and a = 1 it is a surface of rotation about the z axis.

    Parameters
    ----------
    profile
        (x, z): a plane curve, or one in space with y = 0.
    trajectory
        (X, Y): a plane curve, or one in space with z = 0.
    factor
        a, not 0.
    placement
        Rows ``[matrix | translation]`` of an affine map that the patch is moved by, shape (2 or 3, 4); where it is
        by the formula unless given.

    Raises
    ------
    InputError
        When an argument is out of its range or a curve leaves its plane.

    References
    ----------
    L. Piegl, W. Tiller, The NURBS Book, 2nd ed., Springer 1997, section 8.4.

    Examples
    --------
    An octant of the unit sphere:

    >>> from gtcad import Curve
    >>> quarter = Curve([[1, 0], [1, 1], [0, 1]])
    >>> octant = Swung(quarter, quarter)
    >>> round(float(np.linalg.norm(octant.evaluate(0.2, 0.7))), 12)
    1.0
    """

    profile: SeparableCurve
    trajectory: SeparableCurve
    factor: float = 1.0
    placement: Rows | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "profile", _plane_curve("profile", self.profile, "xz"))
        object.__setattr__(self, "trajectory", _plane_curve("trajectory", self.trajectory, "xy"))
        object.__setattr__(self, "factor", checked_number("factor", self.factor))
        object.__setattr__(self, "placement", checked_placement(self.placement))
        if self.factor == 0:
            raise InputError("factor must not be 0")

    def _built(self) -> SurfaceOfTerms:
        (x, z), (far, along) = self.profile.coefficients.T, self.trajectory.coefficients.T
        one, weights = constant_term(self.trajectory.factors)
        around, upwards = np.zeros((x.size, far.size, 3)), np.zeros((x.size, weights.size, 3))
        around[..., 0], around[..., 1] = np.outer(self.factor * x, far), np.outer(self.factor * x, along)
        upwards[..., 2] = np.outer(z, weights)
        factors = self.profile.factors
        terms = SurfaceOfTerms.summed([(factors, self.trajectory.factors, around), (factors, one, upwards)])
        return placed(terms, self.placement)

    def transformed(self, matrix: ArrayLike, translation: ArrayLike | None = None) -> Swung:
        """The affine image: points x become ``matrix @ x + translation``."""
        return replace(self, placement=followed(self.placement, matrix, translation))


def _plane_curve(name: str, curve: SeparableCurve, plane: str) -> SeparableCurve:
    """The curve in the two coordinates of its plane."""
    checked_curves(**{name: curve})
    if curve.dimension == 2:
        return curve
    across = next(axis for axis in range(3) if "xyz"[axis] not in plane)
    coefficients = np.abs(curve.coefficients)
    if coefficients[:, across].max() > _PLANE * coefficients.max():
        raise InputError(
            f"{name} must lie in the {plane} plane, got {'xyz'[across]} up to {coefficients[:, across].max():g}"
        )
    return curve.transformed(np.delete(np.eye(3), across, axis=0))
