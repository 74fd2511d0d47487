"""GT-Bezier tensor-product surfaces, and the classical Bezier surfaces beside them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.basis import GT, Basis, Family, Gamma, checked_gamma, checked_parameters
from gtcad.curve import Curve
from gtcad.errors import InputError
from gtcad.protocol import SeparableSurface, affine, checked_points, checked_side

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Surface(SeparableSurface):
    """The surface ``S(u, v) = sum_ij f_i(u; gamma_u) f_j(v; gamma_v) P_ij`` of degrees (n, m), u and v in [0, 1].

    Parameters
    ----------
    control_points
        P, shape (n + 1, m + 1, d), d = 2 or 3, in the model's unit; the first index goes with u.
    gamma_u, gamma_v
        Design variables of the two directions, each in [-1, 1].
    family_u, family_v
        ``GT`` (degrees 2 to 60) or ``BERNSTEIN`` (degrees 1 to 60, no design variables), for each direction.

    Raises
    ------
    InputError
        When an argument is out of its range.

    Notes
    -----
    The boundary curves are the curves of the boundary control points, with the design variables of their direction.
    """

    control_points: Array
    gamma_u: Gamma = (0.0, 0.0)
    gamma_v: Gamma = (0.0, 0.0)
    family_u: Family = GT
    family_v: Family = GT

    def __init__(
        self,
        control_points: ArrayLike,
        gamma_u: ArrayLike = (0.0, 0.0),
        gamma_v: ArrayLike = (0.0, 0.0),
        family_u: Family = GT,
        family_v: Family = GT,
    ) -> None:
        points = checked_points("control_points", control_points, 3)
        object.__setattr__(self, "control_points", points)
        object.__setattr__(self, "gamma_u", checked_gamma("gamma_u", np.asarray(gamma_u).tolist(), family_u))
        object.__setattr__(self, "gamma_v", checked_gamma("gamma_v", np.asarray(gamma_v).tolist(), family_v))
        object.__setattr__(self, "family_u", family_u)
        object.__setattr__(self, "family_v", family_v)
        object.__setattr__(self, "_basis_u", Basis(points.shape[0] - 1, self.gamma_u, family_u))
        object.__setattr__(self, "_basis_v", Basis(points.shape[1] - 1, self.gamma_v, family_v))

    @property
    def degrees(self) -> tuple[int, int]:
        """The degrees (n, m)."""
        return self.control_points.shape[0] - 1, self.control_points.shape[1] - 1

    @property
    def factors_u(self) -> Basis:
        """The basis functions of u."""
        return self._basis_u  # type: ignore[attr-defined, no-any-return]

    @property
    def factors_v(self) -> Basis:
        """The basis functions of v."""
        return self._basis_v  # type: ignore[attr-defined, no-any-return]

    @property
    def coefficients(self) -> Array:
        """The control points."""
        return self.control_points

    def reversed(self, direction: str) -> Surface:
        """The same points with one parameter, "u" or "v", running backwards."""
        _check_direction(direction)
        if direction == "u":
            return self._with(self.control_points[::-1], gamma_u=self.gamma_u[::-1])
        return self._with(self.control_points[:, ::-1], gamma_v=self.gamma_v[::-1])

    def transposed(self) -> Surface:
        """The same points with u and v exchanged."""
        points = self.control_points.swapaxes(0, 1)
        return Surface(points, self.gamma_v, self.gamma_u, self.family_v, self.family_u)

    def transformed(self, matrix: ArrayLike, translation: ArrayLike | None = None) -> Surface:
        """The affine image: points x become ``matrix @ x + translation``."""
        return self._with(affine(self.control_points, matrix, translation))

    def isoparametric(self, *, u: float | None = None, v: float | None = None) -> Curve:
        """The curve of constant u (a curve in v) or of constant v (a curve in u), exactly.

        Raises
        ------
        InputError
            Unless just one of u and v is given, in [0, 1].
        """
        if (u is None) == (v is None):
            raise InputError(f"give just one of u and v, got u={u}, v={v}")
        if u is not None:
            row = self.factors_u.evaluate(checked_parameters("u", u))
            return Curve(np.tensordot(row, self.control_points, 1), self.gamma_v, self.family_v)
        row = self.factors_v.evaluate(checked_parameters("v", v))  # type: ignore[arg-type]
        return Curve(np.tensordot(row, self.control_points, (0, 1)), self.gamma_u, self.family_u)

    def boundary(self, side: str) -> Curve:
        """The boundary curve "u0" or "u1" (a curve in v at u = 0, 1), "v0" or "v1" (a curve in u)."""
        checked_side(side)
        index = 0 if side[1] == "0" else -1
        if side[0] == "u":
            return Curve(self.control_points[index], self.gamma_v, self.family_v)
        return Curve(self.control_points[:, index], self.gamma_u, self.family_u)

    def _with(self, points: Array, gamma_u: Gamma | None = None, gamma_v: Gamma | None = None) -> Surface:
        gamma_u, gamma_v = gamma_u or self.gamma_u, gamma_v or self.gamma_v
        return Surface(points, gamma_u, gamma_v, self.family_u, self.family_v)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Surface):
            return NotImplemented
        return (self.gamma_u, self.gamma_v, self.family_u, self.family_v) == (
            other.gamma_u,
            other.gamma_v,
            other.family_u,
            other.family_v,
        ) and np.array_equal(self.control_points, other.control_points)

    def __hash__(self) -> int:
        points = (self.control_points + 0.0).tobytes()  # -0.0 equals 0.0
        return hash((points, self.gamma_u, self.gamma_v, self.family_u, self.family_v))

    def __reduce__(self) -> tuple[object, ...]:
        return Surface, (self.control_points, self.gamma_u, self.gamma_v, self.family_u, self.family_v)


def _check_direction(direction: str) -> None:
    if direction not in ("u", "v"):
        raise InputError(f'direction must be "u" or "v", got {direction!r}')
