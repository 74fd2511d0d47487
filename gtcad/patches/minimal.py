"""Minimal surfaces in the Plateau sense: patches of least energy inside a given boundary.

Two settings, which every report names:

- "free boundary": the boundary control points are given, and the boundary curves follow the design variables. The
  interior control points are solved for. The result is a ``Surface``.
- "fixed contour": four boundary curves are given. The patch is their Coons patch plus interior functions of any degree
  and design variables, which vanish on the boundary. The result is a ``Plateau``.

Energies, each a quadratic form, so that its extremal is the solution of one linear system:

    Dirichlet       D = 1/2 int |S_u|^2 + |S_v|^2 du dv,    never below the area
    quasi-harmonic  int |S_uu + S_vv|^2 du dv
    bending         int |S_uu|^2 + 2 |S_uv|^2 + |S_vv|^2 du dv

Only constants are harmonic GT patches (for generic design variables), so ``S_uu + S_vv = 0`` cannot be had. Inside a
whole boundary the quasi-harmonic extremal is the patch of least harmonic residual; ``harmonic_residual_extremal`` also
leaves sides free, as harmonic Bezier surfaces have it. The patch of least area itself: ``gtcad.patches.least_area``.

References
----------
J. Monterde, The Plateau-Bezier problem, Mathematics of Surfaces 2003, Lecture Notes in Computer Science 2768.
J. Monterde, H. Ugail, On harmonic and biharmonic Bezier surfaces, Comput. Aided Geom. Design 21 (2004) 697-715.
M. Ammad, M. Y. Misro, M. Bibi, A. Ramli, arXiv:2601.11677: Dirichlet extremals of GT-Bezier surfaces.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.basis import GT, Basis, Family
from gtcad.chebyshev import UNIT_ROUNDOFF
from gtcad.errors import InputError
from gtcad.measure import Estimate, over_square
from gtcad.patches._forms import INNER, SQUARES, Energy, checked_energy, resolved, rule
from gtcad.patches._many import ExtremalEnergies, dirichlet_energies
from gtcad.patches._plateau import (
    Contour,
    Plateau,
    boundary_filled,
    checked_degrees,
    contour_of,
    setting_of,
    sides_of,
)
from gtcad.patches._trial import Trial
from gtcad.protocol import SeparableSurface
from gtcad.surface import Surface

__all__ = [
    "ExtremalEnergies",
    "Plateau",
    "bending_extremal",
    "dirichlet_energies",
    "dirichlet_extremal",
    "energy",
    "extremal",
    "fixed_contour",
    "harmonic_residual",
    "harmonic_residual_extremal",
    "quasi_harmonic_extremal",
    "setting_of",
]

Array = NDArray[np.float64]

_ROUNDING = 8 * UNIT_ROUNDOFF
_SIDES = ("u0", "u1", "v0", "v1")


# --- free boundary ----------------------------------------------------------------------------------------------------


def extremal(
    net: ArrayLike,
    functional: Energy = "dirichlet",
    *,
    gamma_u: ArrayLike = (0.0, 0.0),
    gamma_v: ArrayLike = (0.0, 0.0),
    family: Family = GT,
) -> Surface:
    """The surface of least energy with the given boundary control points: setting "free boundary".

    Parameters
    ----------
    net
        Control points, shape (n + 1, m + 1, d), d = 2 or 3. Interior ones are not looked at and may be NaN.
    functional
        "dirichlet", "quasi-harmonic" or "bending".
    gamma_u, gamma_v
        Design variables, each in [-1, 1].
    family
        ``GT``, or ``BERNSTEIN`` for the classical Bezier surface to compare with.

    Raises
    ------
    InputError
        When an argument is out of its range.

    Notes
    -----
    The linear system is solved in orthonormal interior functions: energies are least to rounding; control points are
    accurate to about 1e-15 of the size at degree 3, 1e-12 at 8, 1e-9 at 12. Cost: 1 ms, at degrees (8, 8) 3 ms.
    """
    points = boundary_filled(net)
    base = Surface(points, gamma_u, gamma_v, family, family)
    if min(points.shape[:2]) == 2:
        return base  # no interior control points
    solved = _solved(base, base.factors_u, base.factors_v, functional)
    points[1:-1, 1:-1] += solved
    return Surface(points, base.gamma_u, base.gamma_v, family, family)


def dirichlet_extremal(
    net: ArrayLike,
    gamma_u: ArrayLike = (0.0, 0.0),
    gamma_v: ArrayLike = (0.0, 0.0),
    family: Family = GT,
) -> Surface:
    """The surface of least Dirichlet energy ``1/2 int |S_u|^2 + |S_v|^2`` with the given boundary control points.

    Parameters
    ----------
    net, gamma_u, gamma_v, family
        As for ``extremal``.

    Raises
    ------
    InputError
        When an argument is out of its range.

    Examples
    --------
    The classical extremal inside straight edges is the bilinear patch:

    >>> from gtcad import BERNSTEIN
    >>> nan = [np.nan] * 3
    >>> skew = [[[0, 0, 0], [0, 1, 1], [0, 2, 2]], [[1, 0, 1], nan, [1, 2, 1]], [[2, 0, 2], [2, 1, 1], [2, 2, 0]]]
    >>> dirichlet_extremal(skew, family=BERNSTEIN).control_points[1, 1].round(12).tolist()
    [1.0, 1.0, 1.0]
    """
    return extremal(net, "dirichlet", gamma_u=gamma_u, gamma_v=gamma_v, family=family)


def quasi_harmonic_extremal(
    net: ArrayLike,
    gamma_u: ArrayLike = (0.0, 0.0),
    gamma_v: ArrayLike = (0.0, 0.0),
    family: Family = GT,
) -> Surface:
    """The surface of least ``int |S_uu + S_vv|^2`` with the given boundary control points, as ``extremal``."""
    return extremal(net, "quasi-harmonic", gamma_u=gamma_u, gamma_v=gamma_v, family=family)


def bending_extremal(
    net: ArrayLike,
    gamma_u: ArrayLike = (0.0, 0.0),
    gamma_v: ArrayLike = (0.0, 0.0),
    family: Family = GT,
) -> Surface:
    """The surface of least ``int |S_uu|^2 + 2 |S_uv|^2 + |S_vv|^2`` with these boundary points, as ``extremal``."""
    return extremal(net, "bending", gamma_u=gamma_u, gamma_v=gamma_v, family=family)


def harmonic_residual_extremal(
    net: ArrayLike,
    gamma_u: ArrayLike = (0.0, 0.0),
    gamma_v: ArrayLike = (0.0, 0.0),
    family: Family = GT,
    *,
    given: Collection[str] = _SIDES,
) -> Surface:
    """The surface of least harmonic residual, ``int |S_uu + S_vv|^2``, with the control points of the given sides.

    Parameters
    ----------
    net, gamma_u, gamma_v, family
        As for ``extremal``, but control points of sides that are not given are not looked at either.
    given
        "u0" and "u1", "v0" and "v1", or all four sides. With all of them this is the quasi-harmonic extremal. Two
        opposite sides determine a harmonic Bezier surface, whose residual is 0 up to rounding.

    Raises
    ------
    InputError
        When an argument is out of its range.

    Notes
    -----
    The problem with two sides given is ill-conditioned like all continuation of harmonic functions: the residual is
    least to rounding, but control points are accurate to about 1e-8 of the size at degree 8, and hardly at all from 12.

    References
    ----------
    J. Monterde, H. Ugail, On harmonic and biharmonic Bezier surfaces, Comput. Aided Geom. Design 21 (2004) 697-715.

    Examples
    --------
    Two opposite sides of the saddle z = u^2 - v^2 are enough:

    >>> from gtcad import BERNSTEIN
    >>> nan = [np.nan] * 3
    >>> sides = [[[0, 0, 0], [0, 0.5, 0], [0, 1, -1]], [nan, nan, nan], [[1, 0, 1], [1, 0.5, 1], [1, 1, 0]]]
    >>> harmonic_residual_extremal(sides, family=BERNSTEIN, given=("u0", "u1")).evaluate(0.5, 0.25).round(12).tolist()
    [0.5, 0.25, 0.1875]
    """
    if set(given) == set(_SIDES):
        return extremal(net, "quasi-harmonic", gamma_u=gamma_u, gamma_v=gamma_v, family=family)
    if set(given) == {"v0", "v1"}:
        turned = np.swapaxes(np.asarray(net, dtype=np.float64), 0, 1)
        return harmonic_residual_extremal(turned, gamma_v, gamma_u, family, given=("u0", "u1")).transposed()
    if set(given) != {"u0", "u1"}:
        raise InputError(f"given must be u0 and u1, v0 and v1 or all four sides, got {', '.join(given) or 'none'}")
    points = np.array(net, dtype=np.float64)
    if points.ndim == 3 and len(points) > 1:
        inner = np.linspace(0, 1, len(points))[1:-1, None, None]
        points[1:-1] = (1 - inner) * points[0] + inner * points[-1]
    base = Surface(points, gamma_u, gamma_v, family, family)
    trial = Trial.of(base, base.factors_u, base.factors_v, used=(INNER, slice(None)))
    points[1:-1] += trial.interior(trial.least_residual())
    return Surface(points, gamma_u, gamma_v, family, family)


# --- fixed contour ----------------------------------------------------------------------------------------------------


def fixed_contour(
    curves: Contour,
    degree: int | Sequence[int],
    functional: Energy = "dirichlet",
    *,
    gamma_u: ArrayLike = (0.0, 0.0),
    gamma_v: ArrayLike = (0.0, 0.0),
    family: Family = GT,
) -> Plateau:
    """The patch of least energy inside four boundary curves: setting "fixed contour".

    Parameters
    ----------
    curves
        c0, c1, d0, d1 as of ``Coons``, any curves of the protocol; or a ``Coons`` patch, for its boundary.
    degree
        Of the interior functions, from 2; or a pair (n, m).
    functional
        As for ``extremal``.
    gamma_u, gamma_v, family
        Of the interior functions.

    Raises
    ------
    InputError
        When an argument is out of its range, or the curves do not meet at the corners.

    Notes
    -----
    Unlike in the setting "free boundary" all degrees, design variables and families give patches over one contour,
    whose areas can be compared.

    Examples
    --------
    Inside a flat square everything is flat:

    >>> from gtcad import BERNSTEIN, Curve
    >>> corners = [0, 0, 1], [2, 0, 1], [0, 2, 1], [2, 2, 1]
    >>> sides = [Curve([corners[a], corners[b]], family=BERNSTEIN) for a, b in ((0, 1), (2, 3), (0, 2), (1, 3))]
    >>> bool(np.allclose(fixed_contour(sides, 4).evaluate(0.3, 0.8), [0.6, 1.6, 1]))
    True
    """
    contour = contour_of(curves)
    n, m = checked_degrees(degree)
    start = Plateau(*sides_of(contour), np.zeros((n - 1, m - 1, contour.dimension)), gamma_u, gamma_v, family)
    return start.with_interior(_solved(start.contour, *start.bases, functional))


def _solved(base: SeparableSurface, basis_u: Basis, basis_v: Basis, functional: str) -> Array:
    """What the interior functions must add to the base."""
    checked_energy(functional)
    trial = Trial.of(base, basis_u, basis_v)
    if 0 in trial.shape:
        return np.zeros((basis_u.degree - 1, basis_v.degree - 1, base.dimension))
    return trial.interior(trial.extremal(functional))


# --- energies ---------------------------------------------------------------------------------------------------------


def energy(surface: SeparableSurface, functional: Energy = "dirichlet") -> Estimate:
    """An energy of any surface of the protocol.

    Parameters
    ----------
    surface
        Any surface.
    functional
        "dirichlet", "quasi-harmonic" or "bending".

    Returns
    -------
    Estimate
        In the square of the model's unit, u and v having none. The quadrature is exact for all usual factors, and the
        error bounds what rounding does to the derivatives; waves by the dozen are left to adaptive quadrature.

    Raises
    ------
    InputError
        When there is no such functional.

    Examples
    --------
    z = u v: bending sees twice the square of S_uv = 1, the quasi-harmonic energy nothing.

    >>> from gtcad import BERNSTEIN
    >>> saddle = Surface([[[0, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 1]]], family_u=BERNSTEIN, family_v=BERNSTEIN)
    >>> round(energy(saddle, "bending"), 12), round(energy(saddle, "quasi-harmonic"), 12)
    (2.0, 0.0)
    """
    checked_energy(functional)
    if not resolved(surface.factors_u, surface.factors_v):
        return over_square(lambda u, v: _density(surface, u, v, functional), 1e-12)
    (u, weights_u), (v, weights_v) = rule(surface.factors_u), rule(surface.factors_v)
    weights = np.outer(weights_u, weights_v)
    reach = _ROUNDING * float(np.abs(surface.coefficients).max(initial=0.0))
    value = error = 0.0
    for weight, orders in SQUARES[functional]:
        part = sum(surface.derivative(u[:, None], v[None, :], one) for one in orders)
        square = float(np.einsum("uvd,uvd,uv", part, part, weights))
        lost = reach * sum(
            surface.factors_u.derivative_bound(k) * surface.factors_v.derivative_bound(m) for k, m in orders
        )
        value += weight * square
        error += weight * (2 * lost * math.sqrt(square) + lost**2 + _ROUNDING * square)
    return Estimate(value, error)


def _density(surface: SeparableSurface, u: Array, v: Array, functional: str) -> Array:
    total = np.zeros(np.broadcast_shapes(u.shape, v.shape))
    for weight, orders in SQUARES[functional]:
        part = np.sum([surface.derivative(u, v, one) for one in orders], axis=0)
        total += weight * np.einsum("uvd,uvd->uv", part, part)
    return total


def harmonic_residual(surface: SeparableSurface) -> Estimate:
    """How far a surface is from a harmonic one: the root of the mean of ``|S_uu + S_vv|^2``, in the model's unit.

    Parameters
    ----------
    surface
        Any surface.

    Examples
    --------
    >>> bowl = Surface([[[0, 0, 0], [0, 1, 0], [0, 2, 0]]] * 3)
    >>> harmonic_residual(bowl) > 1  # equal distances are run through at uneven speed
    True
    """
    square = energy(surface, "quasi-harmonic")
    root = math.sqrt(square.value)
    return Estimate(root, min(square.error / root if root else math.inf, math.sqrt(square.error)))
