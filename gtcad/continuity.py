"""Joins of curves to C3 and G3: built from the end derivatives of one curve, and checked on any two.

With D_k the k-th derivative of the first curve at its end and T_k that of the second at its start, the curves join
C^k when T_r = D_r for r = 0..k, and G^k when scale factors eta > 0, psi and omega exist with

    T_0 = D_0,  T_1 = eta D_1,  T_2 = eta^2 D_2 + psi D_1,  T_3 = eta^3 D_3 + 3 eta psi D_2 + omega D_1.

T_r involves the first r + 1 control points of the second curve alone, so they follow in order. A check needs no scale
factors: it compares the derivatives with respect to arc length.

References
----------
B. A. Barsky, T. D. DeRose, Geometric continuity of parametric curves: three equivalent characterizations, IEEE
Comput. Graph. Appl. 9(6) (1989) 60-69.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.basis import GT, Basis, Family
from gtcad.curve import Curve
from gtcad.errors import InputError, SingularJoin

Array = NDArray[np.float64]
Scale = tuple[float, float, float]

MAX_ORDER = 3
PARAMETRIC: Scale = (1.0, 0.0, 0.0)
_SINGULAR = 1e-10  # of a row's largest coefficient, and of the size of the first curve's derivatives


class Derivable(Protocol):
    """A curve, or a spline, with derivatives on a domain."""

    @property
    def domain(self) -> tuple[float, float]:
        """First and last parameter."""
        ...

    def derivative(self, t: ArrayLike, order: int = 1) -> Array:
        """Derivatives of the order, 0 the point."""
        ...


@dataclass(frozen=True)
class Thresholds:
    """What still counts as continuous.

    Attributes
    ----------
    gap
        Distance of the end points, in the model's unit.
    angle_deg
        Angle of the tangents, in degrees.
    curvature
        Jump of the curvature vector, relative to the larger curvature.
    curvature_rate
        Jump of the third derivative by arc length, relative to the larger one.
    """

    gap: float = 1e-7
    angle_deg: float = 1e-6
    curvature: float = 1e-6
    curvature_rate: float = 1e-4


@dataclass(frozen=True)
class JoinReport:
    """What happens where one curve ends and the next begins.

    Attributes
    ----------
    gap
        Distance of the end points, in the model's unit.
    tangent_angle_deg
        Angle of the tangents, in degrees; NaN where a curve has no tangent.
    curvature_jump
        Norm of the jump of the curvature vector over the larger of both curvatures.
    curvature_rate_jump
        Jump of d kappa / ds over the larger of |d kappa / ds| and kappa^2 on both sides.
    torsion_jump
        Jump of the torsion, in the inverse of the unit; 0 for plane curves.
    parametric_jumps
        Jumps of the first, second and third derivative by the parameter, relative like the geometric ones.
    order
        "C3" to "C0" or "G1" to "G3": the highest order within the thresholds, C before G at equal orders; "none" when
        the gap is too wide.
    """

    gap: float
    tangent_angle_deg: float
    curvature_jump: float
    curvature_rate_jump: float
    torsion_jump: float
    parametric_jumps: tuple[float, float, float]
    order: str

    def meets(self, order: str) -> bool:
        """Whether the join is of that order: C^k counts as G^k too."""
        if self.order == "none":
            return False
        kind, wanted = parsed_order(order)
        return int(self.order[1]) >= wanted and (kind == "G" or self.order[0] == "C" or wanted == 0)


def parsed_order(order: str) -> tuple[str, int]:
    """("C" or "G", 0 to 3).

    Raises
    ------
    InputError
        When the text is none of "C0" to "C3" and "G0" to "G3".
    """
    if not (isinstance(order, str) and len(order) == 2 and order[0] in "CG" and order[1] in "0123"):
        raise InputError(f'order must be one of "C0" to "C3" and "G0" to "G3", got {order!r}')
    return order[0], int(order[1])
