"""Least energies of one boundary for many design variables at once, in either setting."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad._jets import norm
from gtcad.basis import GT, Family
from gtcad.chebyshev import gauss_legendre
from gtcad.errors import InputError
from gtcad.factors import KeyedFactors
from gtcad.patches._forms import Energy, Form, ManyExtremals, checked_energy, checked_gammas, gram_polynomials
from gtcad.patches._plateau import Contour, Setting, boundary_filled, checked_degrees, contour_of, is_contour
from gtcad.patches.coons import Coons
from gtcad.surface import Surface

Array = NDArray[np.float64]

_NODES = 24


class ExtremalEnergies:
    """The least energies for many design variables at once, in either setting.

    Parameters
    ----------
    boundary
        Boundary control points as for ``extremal``, or four curves as for ``fixed_contour``.
    functional
        "dirichlet", "quasi-harmonic" or "bending".
    degree
        Of the interior functions, for a fixed contour; a net has its own.
    family
        One with design variables.

    Raises
    ------
    InputError
        When an argument is out of its range.

    Notes
    -----
    3000 energies of degrees (3, 3) take about 15 ms, of (8, 8) 0.4 s, and 30 of degrees (3, 3) 0.5 ms.
    """

    def __init__(
        self,
        boundary: ArrayLike | Contour,
        functional: Energy = "dirichlet",
        *,
        degree: int | Sequence[int] | None = None,
        family: Family = GT,
    ) -> None:
        form = checked_energy(functional)
        self.family = family
        checked_gammas(np.zeros((0, 4)), family)
        self.setting: Setting = "fixed contour" if is_contour(boundary) else "free boundary"
        if self.setting == "fixed contour":
            contour = contour_of(boundary)  # type: ignore[arg-type]
            if degree is None:
                raise InputError("degree is needed for a fixed contour: that of the interior functions, from 2")
            n, m = checked_degrees(degree)
            self._many = _over_contour(contour, n, m, form, family)
        else:
            if degree is not None:
                raise InputError(f"degree is that of the net, got {degree!r} besides")
            points = boundary_filled(boundary)  # type: ignore[arg-type]
            Surface(points, family_u=family, family_v=family)
            n, m = points.shape[0] - 1, points.shape[1] - 1
            shifted = points - points.mean(axis=(0, 1))  # energies do not see a shift, but digits do
            self._many = ManyExtremals(gram_polynomials(n, family), gram_polynomials(m, family), shifted, form)

    def __call__(self, gammas: ArrayLike) -> Array:
        """Least energies, shape (count,).

        Parameters
        ----------
        gammas
            Design variables (gamma_u[0], gamma_u[1], gamma_v[0], gamma_v[1]) in [-1, 1], shape (count, 4).

        Raises
        ------
        InputError
            When the shape is another one or a value is out of its range.
        """
        return self._many.energies(checked_gammas(gammas, self.family))[0]

    def with_rates(self, gammas: ArrayLike) -> tuple[Array, Array]:
        """Least energies, and their exact derivatives by the design variables, shapes (count,) and (count, 4)."""
        values = checked_gammas(gammas, self.family)
        energies, coefficients = self._many.energies(values)
        return energies, self._many.rates(values, coefficients)

    def areas(self, gammas: ArrayLike) -> Array:
        """The areas of the extremals, shape (count,).

        With a free boundary these are areas over different contours. One Gauss-Legendre rule of 24 x 24 nodes: exact to
        about 1e-9 for patches of moderate degree without folds, estimated.
        """
        values = checked_gammas(gammas, self.family)
        x, weights = gauss_legendre(_NODES)
        lift = np.eye(self._many.known.shape[2], 3)
        s_u, s_v = (self._many.derivatives(values, (x + 1) / 2, orders) @ lift for orders in ((1, 0), (0, 1)))
        return np.asarray(norm(np.cross(s_u, s_v)) @ weights @ weights) / 4


def _over_contour(contour: Coons, n: int, m: int, form: Form, family: Family) -> ManyExtremals:
    middle = contour.evaluate([0.0, 1.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0]).mean(axis=0)
    base = contour.terms.transformed(np.eye(contour.dimension), -middle)
    known = np.pad(base.coefficients, ((n + 1, 0), (m + 1, 0), (0, 0)))
    u, v = KeyedFactors(base.factors_u), KeyedFactors(base.factors_v)
    return ManyExtremals(gram_polynomials(n, family, u), gram_polynomials(m, family, v), known, form)


def dirichlet_energies(net: ArrayLike, gammas: ArrayLike, *, family: Family = GT) -> Array:
    """The Dirichlet energies of the extremals of one boundary net for many design variables at once.

    Parameters
    ----------
    net
        Boundary control points, as for ``extremal``.
    gammas
        Shape (count, 4): gamma_u[0], gamma_u[1], gamma_v[0], gamma_v[1] in [-1, 1].
    family
        One with design variables.

    Returns
    -------
    Array
        Shape (count,).

    Raises
    ------
    InputError
        When an argument is out of its range.

    Notes
    -----
    Where many calls share a net, keep an ``ExtremalEnergies``.

    Examples
    --------
    >>> flat = [[[i, j, 0] for j in range(4)] for i in range(4)]
    >>> dirichlet_energies(flat, [[-1, 1, 0.5, 0], [1, 1, 1, 1]]).shape
    (2,)
    """
    return ExtremalEnergies(net, family=family)(gammas)
