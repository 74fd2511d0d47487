"""Frames, normals, curvatures and torsion of any curve or surface that can be differentiated.

Lengths are in the model's unit, curvatures in its inverse. Plane shapes are taken as lying in z = 0. All functions
take arrays of parameters in [0, 1], raise InputError for others, and return NaN, never a warning, where a quantity
does not exist.

Singular points of curves. Where C' vanishes but C is a regular arc in a power w = delta^r, r <= 4, of the distance
from the point (r = 2 for degree 2 with gamma_1 = -1), every quantity is that of the arc. Where only the direction has
a limit there is only a tangent, and the curvature is infinite. At an end of the domain limits are those from inside;
an interior point where the travel reverses has no tangent.

Singular points of surfaces. Where S_u x S_v vanishes (a side collapsed to a point, a corner with one tangent) the
normal is the limit along the isoparametric lines into the domain, from the first derivative of S_u x S_v that does not
vanish, when both lines agree or one is singular throughout; curvatures are NaN there.

A derivative counts as vanishing below 1e-12 of its largest value on the shape plus 1e-12 of the largest coordinate.

Accuracy: with e the relative error of the derivatives (about 1e-15, growing to 1e-14 at degree 60) and q >= 1 the ratio
of the largest |C'| or |S_u x S_v| on the shape to the local one, tangents and normals have errors of about e q,
curvatures relative errors of about e q^2, their rates e q^4: in the neighbourhood of a singular point digits are lost,
at the point itself the limits are as good as elsewhere. Torsion also loses the ratio by which kappa is small.

References
----------
M. P. do Carmo, Differential Geometry of Curves and Surfaces, 2nd ed., Dover 2016, sections 1.5, 2.5 and 3.3.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import NamedTuple, ParamSpec, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad._jets import (
    AT_END,
    ParametricCurve,
    ParametricSurface,
    crossed,
    crossed_noise,
    curve_jets,
    first_bend,
    limit_normals,
    norm,
    space,
)
from gtcad.errors import InputError

__all__ = [
    "Frame",
    "ParametricCurve",
    "ParametricSurface",
    "curvature",
    "curvature_rate",
    "first_fundamental_form",
    "frenet_frame",
    "gaussian_curvature",
    "mean_curvature",
    "normal",
    "principal_curvatures",
    "second_fundamental_form",
    "signed_curvature",
    "signed_curvature_rate",
    "tangent",
    "torsion",
]

Array = NDArray[np.float64]
_Parameters = ParamSpec("_Parameters")
_Result = TypeVar("_Result")


class Frame(NamedTuple):
    """Orthonormal, right-handed vectors at each parameter, each of shape t.shape + (3,)."""

    tangent: Array
    normal: Array
    binormal: Array


def _quiet(function: Callable[_Parameters, _Result]) -> Callable[_Parameters, _Result]:
    """The function without floating-point warnings: 0/0 is the NaN that is documented."""

    @functools.wraps(function)
    def wrapped(*args: _Parameters.args, **kwargs: _Parameters.kwargs) -> _Result:
        with np.errstate(all="ignore"):
            return function(*args, **kwargs)

    return wrapped


@_quiet
def tangent(curve: ParametricCurve, t: ArrayLike) -> Array:
    """Unit tangent C'/|C'| in the direction of travel, shape t.shape + (d,).

    Where C' vanishes it is the direction of the first derivative that does not, up to the fourth.

    Examples
    --------
    >>> from gtcad import Curve
    >>> tangent(Curve([[1, 0], [1, 1], [0, 1]]), 0.0).round(12).tolist()
    [0.0, 1.0]
    """
    return _shaped(curve_jets(curve, t, 1).tangent[:, : curve.dimension], t)


@_quiet
def frenet_frame(curve: ParametricCurve, t: ArrayLike) -> Frame:
    """Tangent T, principal normal N (towards the centre of curvature) and binormal B = T x N.

    ``B = C' x C'' / |C' x C''|``. Where the curvature vanishes, B is the limit from the first derivative that leaves
    the tangent; N and B are NaN at an interior inflection, where they flip, and on straight lines.

    Examples
    --------
    >>> from gtcad import Curve
    >>> frenet_frame(Curve([[1, 0], [1, 1], [0, 1]]), 0.0).normal.round(12).tolist()
    [-1.0, 0.0, 0.0]
    """
    jets = curve_jets(curve, t, 2)
    bend, straight = jets.across(2)
    bend[straight] = np.nan
    straight &= jets.regular
    if straight.any():
        bend[straight] = first_bend(curve, jets.t[straight])
    binormal = bend / norm(bend)[:, None]
    return Frame(*(_shaped(field, t) for field in (jets.tangent, np.cross(binormal, jets.tangent), binormal)))


@_quiet
def curvature(curve: ParametricCurve, t: ArrayLike) -> Array:
    """Curvature ``kappa = |C' x C''| / |C'|^3 >= 0``, infinite at cusps; shape t.shape.

    Examples
    --------
    A quarter circle of radius 2:

    >>> from gtcad import Curve
    >>> float(curvature(Curve([[2, 0], [2, 2], [0, 2]]), 0.3).round(12))
    0.5
    """
    jets = curve_jets(curve, t, 2)
    return _shaped(np.where(jets.cusp, np.inf, norm(jets.across(2)[0])), t)


@_quiet
def signed_curvature(curve: ParametricCurve, t: ArrayLike) -> Array:
    """Curvature of a plane curve, positive where it turns left: ``(x' y'' - y' x'') / |C'|^3``; NaN at cusps.

    Raises
    ------
    InputError
        When the curve is not plane (d = 2), or a parameter is outside [0, 1].

    Examples
    --------
    A quarter circle of radius 2, run clockwise:

    >>> from gtcad import Curve
    >>> float(signed_curvature(Curve([[0, 2], [2, 2], [2, 0]]), 0.3).round(12))
    -0.5
    """
    _check_plane(curve)
    jets = curve_jets(curve, t, 2)
    return _shaped(np.where(jets.reverses, np.nan, jets.across(2)[0][:, 2]), t)


@_quiet
def curvature_rate(curve: ParametricCurve, t: ArrayLike) -> Array:
    """Derivative of the curvature by arc length, ``d kappa / ds``, in the inverse square of the unit; shape t.shape.

    With X = C' x C'', X' = C' x C''' and v = |C'|: ``d kappa / ds = X.X' / (|X| v^4) - 3 |X| (C'.C'') / v^6``. Where
    the curvature vanishes it is one-sided at the ends; in the interior it is 0 if X' vanishes too and NaN if not, as
    kappa then has a corner. NaN at cusps.

    Examples
    --------
    The curvature of an ellipse is stationary at its vertices:

    >>> from gtcad import Curve
    >>> abs(float(curvature_rate(Curve([[3, 0], [3, 2], [0, 2]]), 0.0))) < 1e-14
    True
    """
    jets = curve_jets(curve, t, 3)
    (bend, straight), (change, level) = jets.across(2), jets.across(3)
    one_sided = np.where(jets.t <= AT_END, norm(change), np.where(jets.t >= 1 - AT_END, -norm(change), np.nan))
    rate = np.where(straight, np.where(level, 0.0, one_sided), (bend * change).sum(axis=1) / norm(bend))
    return _shaped(np.where(jets.reverses, np.nan, rate - 3 * norm(bend) * jets.stretch), t)


@_quiet
def signed_curvature_rate(curve: ParametricCurve, t: ArrayLike) -> Array:
    """Derivative of the signed curvature of a plane curve by arc length, smooth at inflections; shape t.shape.

    Raises
    ------
    InputError
        When the curve is not plane (d = 2), or a parameter is outside [0, 1].
    """
    _check_plane(curve)
    jets = curve_jets(curve, t, 3)
    rate = jets.across(3)[0][:, 2] - 3 * jets.across(2)[0][:, 2] * jets.stretch
    return _shaped(np.where(jets.reverses, np.nan, rate), t)


@_quiet
def torsion(curve: ParametricCurve, t: ArrayLike) -> Array:
    """Torsion ``det(C', C'', C''') / |C' x C''|^2``, positive on right-handed helices; shape t.shape.

    0 for plane curves (d = 2); NaN where the curvature of a space curve vanishes.

    Examples
    --------
    The twisted cubic (t, t^2, t^3) has torsion 3 at t = 0:

    >>> from gtcad import BERNSTEIN, Curve
    >>> float(torsion(Curve([[0, 0, 0], [1/3, 0, 0], [2/3, 1/3, 0], [1, 1, 1]], family=BERNSTEIN), 0.0).round(12))
    3.0
    """
    jets = curve_jets(curve, t, 3)
    if curve.dimension == 2:
        return _shaped(np.zeros(jets.t.size), t)
    bend, straight = jets.across(2)
    twist = (bend * jets.derivatives[2]).sum(axis=1) / jets.speed**3 / norm(bend) ** 2
    return _shaped(np.where(straight, np.nan, twist), t)


@_quiet
def normal(surface: ParametricSurface, u: ArrayLike, v: ArrayLike) -> Array:
    """Unit normal ``S_u x S_v / |S_u x S_v|``, shape broadcast(u, v).shape + (3,).

    Examples
    --------
    >>> from gtcad import BERNSTEIN, Surface
    >>> square = Surface([[[0, 0], [0, 1]], [[1, 0], [1, 1]]], family_u=BERNSTEIN, family_v=BERNSTEIN)
    >>> normal(square, 0.5, 0.5).tolist()
    [0.0, 0.0, 1.0]
    """
    values = crossed(surface, u, v)
    lengths = norm(values)
    unit = np.asarray(values / lengths[..., None])
    singular = lengths <= crossed_noise(surface)
    if singular.any():
        places = (np.broadcast_to(np.asarray(x, dtype=np.float64), singular.shape)[singular] for x in (u, v))
        unit[singular] = limit_normals(surface, *places)
    return unit


def first_fundamental_form(surface: ParametricSurface, u: ArrayLike, v: ArrayLike) -> Array:
    """The matrix [[E, F], [F, G]] of the products of S_u and S_v, shape broadcast(u, v).shape + (2, 2).

    Examples
    --------
    >>> from gtcad import BERNSTEIN, Surface
    >>> slanted = Surface([[[0, 0], [0, 1]], [[2, 1], [2, 2]]], family_u=BERNSTEIN, family_v=BERNSTEIN)
    >>> first_fundamental_form(slanted, 0.5, 0.5).tolist()
    [[5.0, 1.0], [1.0, 1.0]]
    """
    partials = np.stack([surface.derivative(u, v, (1, 0)), surface.derivative(u, v, (0, 1))], axis=-2)
    return np.asarray(partials @ partials.swapaxes(-1, -2))


@_quiet
def second_fundamental_form(surface: ParametricSurface, u: ArrayLike, v: ArrayLike) -> Array:
    """The matrix [[L, M], [M, N]] of the products of S_uu, S_uv, S_vv with the normal, in the model's unit.

    Positive definite where the surface bends towards its normal; shape broadcast(u, v).shape + (2, 2).
    """
    unit = normal(surface, u, v)
    orders = ((2, 0), (1, 1), (1, 1), (0, 2))
    products = [(space(surface.derivative(u, v, order)) * unit).sum(axis=-1) for order in orders]
    return np.stack(products, axis=-1).reshape(*unit.shape[:-1], 2, 2)


@_quiet
def gaussian_curvature(surface: ParametricSurface, u: ArrayLike, v: ArrayLike) -> Array:
    """Gaussian curvature ``K = (L N - M^2) / (E G - F^2)``, shape broadcast(u, v).shape; free of the normal's sign.

    Examples
    --------
    The hyperbolic paraboloid z = x y has K = -1 in its saddle:

    >>> from gtcad import BERNSTEIN, Surface
    >>> saddle = [[[-1, -1, 1], [-1, 1, -1]], [[1, -1, -1], [1, 1, 1]]]
    >>> float(gaussian_curvature(Surface(saddle, family_u=BERNSTEIN, family_v=BERNSTEIN), 0.5, 0.5))
    -1.0
    """
    a, b, c = _shape_operator(surface, u, v)
    return a * c - b * b


@_quiet
def mean_curvature(surface: ParametricSurface, u: ArrayLike, v: ArrayLike) -> Array:
    """Mean curvature ``H = (E N - 2 F M + G L) / (2 (E G - F^2))``, shape broadcast(u, v).shape.

    Positive where the surface bends towards its normal: 1/r on a sphere whose normal points inwards.
    """
    a, _, c = _shape_operator(surface, u, v)
    return (a + c) / 2


@_quiet
def principal_curvatures(surface: ParametricSurface, u: ArrayLike, v: ArrayLike) -> Array:
    """The two principal curvatures, largest first, with the sign of ``mean_curvature``.

    The eigenvalues of the shape operator in an orthonormal basis: no digits are lost near umbilics. Shape
    broadcast(u, v).shape + (2,).
    """
    a, b, c = _shape_operator(surface, u, v)
    middle, half = (a + c) / 2, np.hypot((a - c) / 2, b)
    return np.stack([middle + half, middle - half], axis=-1)


def _shape_operator(surface: ParametricSurface, u: ArrayLike, v: ArrayLike) -> tuple[Array, Array, Array]:
    """Entries 11, 12, 22 in the orthonormal basis S_u/|S_u|, n x S_u/|S_u|."""
    s_u, s_v = (space(surface.derivative(u, v, order)) for order in ((1, 0), (0, 1)))
    across = np.cross(s_u, s_v)
    area = norm(across)
    area = np.where(area <= crossed_noise(surface), np.nan, area)
    l, m, n = (  # noqa: E741 - the form's usual letters
        (space(surface.derivative(u, v, order)) * across).sum(axis=-1) / area for order in ((2, 0), (1, 1), (0, 2))
    )
    p = norm(s_u)
    q, r = (s_u * s_v).sum(axis=-1) / p, area / p
    a = l / p**2
    b = (m / p - q * a) / r
    return a, b, (n - 2 * q * m / p + q * q * a) / r**2


def _check_plane(curve: ParametricCurve) -> None:
    if curve.dimension != 2:
        raise InputError(f"the sign of the curvature needs a plane curve, d = 2, got d = {curve.dimension}")


def _shaped(values: Array, t: ArrayLike) -> Array:
    return values.reshape(np.shape(t) + values.shape[1:])
