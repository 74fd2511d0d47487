"""Patches over a fixed contour, and how a boundary is given: by four curves or by the control points of a net."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.basis import GT, Basis, Family, Gamma, checked_gamma, is_whole
from gtcad.errors import InputError
from gtcad.factors import Term
from gtcad.patches.coons import Coons
from gtcad.protocol import SeparableCurve, SeparableSurface, affine, checked_points

Array = NDArray[np.float64]
Contour = Coons | Sequence[SeparableCurve]
Setting = Literal["free boundary", "fixed contour"]


@dataclass(frozen=True, eq=False, repr=False)
class Plateau(Coons):
    """A patch over a fixed contour: ``S = Coons(c0, c1, d0, d1) + sum_ij f_i(u) f_j(v) Q_ij``, 0 < i < n, 0 < j < m.

    The interior functions vanish on the boundary, so the boundary curves are the given ones whatever the Q.

    Parameters
    ----------
    c0, c1, d0, d1
        The boundaries, as of ``Coons``.
    interior
        Q, shape (n - 1, m - 1, d): displacements from the Coons patch, in the model's unit; degrees n, m from 2.
    gamma_u, gamma_v
        Design variables of the interior functions, each in [-1, 1].
    family
        Of the interior functions.

    Raises
    ------
    InputError
        When an argument is out of its range.

    Notes
    -----
    ``fixed_contour`` finds the Q of least energy, ``gtcad.patches.least_area`` those of least area.

    Examples
    --------
    >>> from gtcad import BERNSTEIN, Curve
    >>> a, b, c, d = [0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]
    >>> sides = [Curve([p, q], family=BERNSTEIN) for p, q in ((a, b), (c, d), (a, c), (b, d))]
    >>> Plateau(*sides, [[[0, 0, 4]]], family=BERNSTEIN).evaluate(0.5, 0.5).tolist()
    [0.5, 0.5, 1.0]
    """

    interior: Array
    gamma_u: Gamma
    gamma_v: Gamma
    family: Family

    def __init__(
        self,
        c0: SeparableCurve,
        c1: SeparableCurve,
        d0: SeparableCurve,
        d1: SeparableCurve,
        interior: ArrayLike,
        gamma_u: ArrayLike = (0.0, 0.0),
        gamma_v: ArrayLike = (0.0, 0.0),
        family: Family = GT,
    ) -> None:
        points = checked_points("interior", interior, 3)
        gammas = [
            checked_gamma(name, np.asarray(gamma).tolist(), family)
            for name, gamma in (("gamma_u", gamma_u), ("gamma_v", gamma_v))
        ]
        values = (points, *gammas, family)
        for name, value in zip(("interior", "gamma_u", "gamma_v", "family"), values, strict=True):
            object.__setattr__(self, name, value)
        super().__init__(c0, c1, d0, d1)
        if points.shape[2] != c0.dimension or not points.size:
            raise InputError(f"interior must have shape (n - 1, m - 1, {c0.dimension}), got {points.shape}")
        _ = self.bases

    @property
    def degrees(self) -> tuple[int, int]:
        """The degrees (n, m) of the interior functions."""
        return self.interior.shape[0] + 1, self.interior.shape[1] + 1

    @property
    def bases(self) -> tuple[Basis, Basis]:
        """The bases whose interior functions are used."""
        n, m = self.degrees
        return Basis(n, self.gamma_u, self.family), Basis(m, self.gamma_v, self.family)

    @property
    def contour(self) -> Coons:
        """The Coons patch of the boundary."""
        return Coons(*sides_of(self))

    def _summands(self) -> list[Term]:
        padded = np.pad(self.interior, ((1, 1), (1, 1), (0, 0)))
        return [*super()._summands(), (*self.bases, padded)]

    def with_interior(self, interior: ArrayLike) -> Plateau:
        """The patch over the same contour with other Q."""
        return Plateau(*sides_of(self), interior, self.gamma_u, self.gamma_v, self.family)

    def transformed(self, matrix: ArrayLike, translation: ArrayLike | None = None) -> Plateau:
        """The affine image: points x become ``matrix @ x + translation``."""
        c0, c1, d0, d1 = (curve.transformed(matrix, translation) for curve in sides_of(self))
        return Plateau(c0, c1, d0, d1, affine(self.interior, matrix, None), self.gamma_u, self.gamma_v, self.family)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Plateau):
            return NotImplemented
        return self._key() == other._key()

    def __hash__(self) -> int:
        return hash(self._key())

    def _key(self) -> tuple[object, ...]:
        points = (self.interior + 0.0).tobytes()  # -0.0 equals 0.0
        return (*sides_of(self), self.interior.shape, points, self.gamma_u, self.gamma_v, self.family)

    def __repr__(self) -> str:
        n, m = self.degrees
        return f"Plateau({self.family.name}, degrees=({n}, {m}), gamma_u={self.gamma_u}, gamma_v={self.gamma_v})"

    def __reduce__(self) -> tuple[object, ...]:
        return Plateau, (*sides_of(self), self.interior, self.gamma_u, self.gamma_v, self.family)


def setting_of(surface: SeparableSurface) -> Setting:
    """Which setting a patch belongs to: "fixed contour" for ``Plateau``, else "free boundary"."""
    return "fixed contour" if isinstance(surface, Plateau) else "free boundary"


def checked_degrees(degree: int | Sequence[int]) -> tuple[int, int]:
    """A degree, or a pair of them, as a pair.

    Raises
    ------
    InputError
        When it is anything but whole numbers from 2.
    """
    pair = tuple(degree) if isinstance(degree, Sequence) else (degree, degree)
    if len(pair) != 2 or not all(is_whole(one) and one >= 2 for one in pair):
        raise InputError(f"degree must be a whole number from 2, or two of them, got {degree!r}")
    return int(pair[0]), int(pair[1])


def contour_of(curves: Contour) -> Coons:
    if isinstance(curves, Coons):
        return Coons(*sides_of(curves))
    if not isinstance(curves, Sequence) or len(curves) != 4:
        raise InputError("curves must be four, c0, c1, d0 and d1, or a Coons patch")
    return Coons(*curves)


def sides_of(patch: Coons) -> tuple[SeparableCurve, SeparableCurve, SeparableCurve, SeparableCurve]:
    return patch.c0, patch.c1, patch.d0, patch.d1


def is_contour(boundary: object) -> bool:
    """Whether a boundary is given by curves; otherwise it is a net."""
    if isinstance(boundary, Coons):
        return True
    return isinstance(boundary, Sequence) and any(isinstance(one, SeparableCurve) for one in boundary)


def boundary_filled(net: ArrayLike) -> Array:
    """A net whose interior is the Boolean sum of its sides, whatever it was.

    Raises
    ------
    InputError
        When the shape is not that of a net, or a boundary control point is not finite.
    """
    try:
        points = np.array(net, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"net must be numbers of shape (n + 1, m + 1, d): {error}") from None
    if points.ndim == 3:
        points[1:-1, 1:-1] = 0
    points = np.array(checked_points("net", points, 3))
    if min(points.shape[:2]) < 2:
        raise InputError(f"net must have at least two rows and columns, got {points.shape[:2]}")
    u, v = (np.linspace(0, 1, count)[1:-1, None] for count in points.shape[:2])
    u, v = u[:, None], v[None]
    along = (1 - v) * points[1:-1, :1] + v * points[1:-1, -1:]
    across = (1 - u) * points[:1, 1:-1] + u * points[-1:, 1:-1]
    corners = (1 - u) * ((1 - v) * points[0, 0] + v * points[0, -1])
    corners = corners + u * ((1 - v) * points[-1, 0] + v * points[-1, -1])
    points[1:-1, 1:-1] = along + across - corners
    return points
