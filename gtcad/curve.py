"""GT-Bezier curves, and the classical Bezier curves beside them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.basis import GT, Basis, Family, Gamma, checked_gamma
from gtcad.protocol import SeparableCurve, affine, checked_points

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Curve(SeparableCurve):
    """The curve ``C(t) = sum_i f_i(t; gamma_1, gamma_2) P_i``, t in [0, 1], of degree n.

    Parameters
    ----------
    control_points
        P, shape (n + 1, d), d = 2 or 3, in the model's unit.
    gamma
        Design variables, each in [-1, 1]: they change the shape without moving a control point.
    family
        ``GT`` (n = 2 to 60) or ``BERNSTEIN`` (n = 1 to 60, no design variables).

    Raises
    ------
    InputError
        When an argument is out of its range.

    Notes
    -----
    The curve starts at P_0 and ends at P_n, is tangent there to the control polygon, and lies in its convex hull.
    Control points on a line give that line, at uneven speed.

    Examples
    --------
    Degree 2 with gamma = (0, 0) is an ellipse arc: this one the quarter of the unit circle.

    >>> quarter = Curve([[1, 0], [1, 1], [0, 1]])
    >>> float(np.hypot(*quarter.evaluate(0.3)).round(12))
    1.0
    """

    control_points: Array
    gamma: Gamma = (0.0, 0.0)
    family: Family = GT

    def __init__(self, control_points: ArrayLike, gamma: ArrayLike = (0.0, 0.0), family: Family = GT) -> None:
        points = checked_points("control_points", control_points, 2)
        object.__setattr__(self, "control_points", points)
        object.__setattr__(self, "gamma", checked_gamma("gamma", np.asarray(gamma).tolist(), family))
        object.__setattr__(self, "family", family)
        object.__setattr__(self, "_basis", Basis(len(points) - 1, self.gamma, family))

    @property
    def degree(self) -> int:
        """The degree n, one less than the number of control points."""
        return len(self.control_points) - 1

    @property
    def factors(self) -> Basis:
        """The basis functions."""
        return self._basis  # type: ignore[attr-defined, no-any-return]

    @property
    def coefficients(self) -> Array:
        """The control points."""
        return self.control_points

    def reversed(self) -> Curve:
        """The same points from the other end: C(1 - t)."""
        return Curve(self.control_points[::-1], self.gamma[::-1], self.family)

    def transformed(self, matrix: ArrayLike, translation: ArrayLike | None = None) -> Curve:
        """The affine image: points x become ``matrix @ x + translation``. A (3, 2) matrix lifts a plane curve."""
        return Curve(affine(self.control_points, matrix, translation), self.gamma, self.family)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Curve):
            return NotImplemented
        return (self.gamma, self.family) == (other.gamma, other.family) and np.array_equal(
            self.control_points, other.control_points
        )

    def __hash__(self) -> int:
        return hash(((self.control_points + 0.0).tobytes(), self.gamma, self.family))  # -0.0 equals 0.0

    def __reduce__(self) -> tuple[object, ...]:
        return Curve, (self.control_points, self.gamma, self.family)
