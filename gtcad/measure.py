"""Length, area, volume and energies of any curve or surface that can be differentiated, with an estimate of the error.

Integrals are had by adaptive Gauss-Legendre quadrature: every piece of the domain with rules of 16 and 20 nodes in
each direction, pieces where they differ too much halved again. The error is the sum of the differences, plus the
rounding of the sum: an estimate from comparison, not a bound, though usually far above the true error because the
value is the finer rule's. Digits that derivatives lose on shapes far from the origin are not in it. The wanted accuracy
``rtol`` is relative to the integral of the integrand's magnitude; the work is bounded, and an error above it says that
this bound was met first. Nodes never lie on an end of the domain.

References
----------
P. J. Davis, P. Rabinowitz, Methods of Numerical Integration, 2nd ed., Academic Press 1984, section 6.2.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Never, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.differential import ParametricCurve, ParametricSurface, curvature
from gtcad.errors import InputError
from gtcad.protocol import SeparableCurve, SeparableSurface
from gtcad.surface import Surface

Array = NDArray[np.float64]

_COARSE, _FINE = 16, 20
_MOST_PIECES = {1: 2000, 2: 600}  # by the number of variables
_LEAST_WIDTH = 2.0**-30  # a piece as narrow as this that has not settled holds a pole of the integrand
_NEAR_WORST = 1e-3  # pieces are halved in rounds, those with errors down to this part of the largest at once
_ROUNDING = 1e-15


class Estimate(float):
    """A number with an estimate of its error: a float in every use, immutable.

    Parameters
    ----------
    value
        The number.
    error
        Estimated absolute error, in the unit of the value; infinite where the integral seems to diverge.

    Examples
    --------
    >>> estimate = Estimate(2.0, 1e-12)
    >>> estimate, estimate.error, estimate + 1
    (Estimate(value=2.0, error=1e-12), 1e-12, 3.0)
    >>> f"{estimate:.3f}"
    '2.000'
    """

    __slots__ = ("_error",)
    _error: float

    def __new__(cls, value: float, error: float) -> Self:
        """Make the float and give it its error."""
        self = super().__new__(cls, value)
        object.__setattr__(self, "_error", float(error))
        return self

    @property
    def value(self) -> float:
        """The number as a plain float."""
        return float(self)

    @property
    def error(self) -> float:
        """Estimated absolute error."""
        return self._error

    def __setattr__(self, name: str, value: object) -> Never:
        raise AttributeError(f"an Estimate cannot be changed: {name}")

    def __reduce__(self) -> tuple[type[Estimate], tuple[float, float]]:
        return type(self), (self.value, self.error)

    def __repr__(self) -> str:
        return f"Estimate(value={self.value!r}, error={self.error:.3g})"

    def __str__(self) -> str:
        return float.__repr__(self)


def length(curve: ParametricCurve, *, rtol: float = 1e-12) -> Estimate:
    """Arc length ``int |C'| dt`` over the whole domain, in the model's unit.

    Parameters
    ----------
    curve
        Any curve, chain or spline.
    rtol
        Wanted relative error, from 1e-14; cusps cost time, not accuracy.

    Raises
    ------
    InputError
        When rtol is out of its range, or the shape is no curve.

    Examples
    --------
    A quarter circle of radius 1:

    >>> from gtcad import Curve
    >>> quarter = length(Curve([[1, 0], [1, 1], [0, 1]]))
    >>> abs(quarter - math.pi / 2) < 1e-14
    True
    """
    return _along(curve, lambda piece, t: _norm(piece.derivative(t, 1)), rtol)


def curvature_energy(curve: ParametricCurve, *, rtol: float = 1e-12) -> Estimate:
    """Bending energy ``int kappa^2 ds`` over the whole domain, in the inverse of the model's unit.

    Parameters
    ----------
    curve
        Any curve, chain or spline; corners of a chain add nothing. At a cusp the integral diverges as a rule: then the
        error is infinite, and the value means nothing.
    rtol
        Wanted relative error, from 1e-14.

    Raises
    ------
    InputError
        When rtol is out of its range, or the shape is no curve.

    Examples
    --------
    A quarter circle of radius 2: pi / (2 r).

    >>> from gtcad import Curve
    >>> float(curvature_energy(Curve([[2, 0], [2, 2], [0, 2]])).value.__round__(12))
    0.785398163397
    """
    return _along(curve, lambda piece, t: curvature(piece, t) ** 2 * _norm(piece.derivative(t, 1)), rtol)


def area(surface: ParametricSurface, *, rtol: float = 1e-12) -> Estimate:
    """Area ``int |S_u x S_v| du dv``, in the square of the model's unit.

    Parameters
    ----------
    surface
        Any surface, over its whole domain; where it folds back the parts count twice.
    rtol
        Wanted relative error, from 1e-14.

    Raises
    ------
    InputError
        When rtol is out of its range, or the shape is no surface.

    Examples
    --------
    >>> from gtcad import BERNSTEIN
    >>> rectangle = Surface([[[0, 0], [0, 3]], [[2, 0], [2, 3]]], family_u=BERNSTEIN, family_v=BERNSTEIN)
    >>> round(area(rectangle), 12)
    6.0
    """
    return over_domain(surface, lambda u, v: _norm(_crossed(surface, u, v)), rtol)


def volume(
    surfaces: ParametricSurface | Iterable[ParametricSurface],
    *,
    origin: ArrayLike = (0.0, 0.0, 0.0),
    rtol: float = 1e-12,
) -> Estimate:
    """Volume inside closed surfaces by the divergence theorem: ``1/3 int (S - origin).(S_u x S_v) du dv``.

    Parameters
    ----------
    surfaces
        One surface, or those that close a body together, with normals pointing outwards (inwards: negative).
        Of a surface that is not closed it is the signed volume of the cone over it from the origin.
    origin
        For a closed body it does not matter; one near the body keeps digits when that lies far away.
    rtol
        Wanted error relative to the integral of the integrand's magnitude, from 1e-14.

    Raises
    ------
    InputError
        When rtol is out of its range, or a shape is no surface or not in space (d = 3).

    Examples
    --------
    The cone over the unit square at height 3 from the origin has volume 1:

    >>> from gtcad import BERNSTEIN
    >>> square = Surface([[[0, 0, 3], [0, 1, 3]], [[1, 0, 3], [1, 1, 3]]], family_u=BERNSTEIN, family_v=BERNSTEIN)
    >>> round(volume(square), 12)
    1.0
    """
    centre = np.asarray(origin, dtype=np.float64)

    def part(surface: ParametricSurface) -> Estimate:
        if getattr(surface, "dimension", 3) != 3:
            raise InputError(f"a volume needs surfaces in space, d = 3, got d = {surface.dimension}")

        def integrand(u: Array, v: Array) -> Array:
            points = surface.derivative(u, v, (0, 0)) - centre
            return np.asarray(np.einsum("uvd,uvd->uv", points, _crossed(surface, u, v))) / 3

        return over_domain(surface, integrand, rtol)

    parts = [part(s) for s in (surfaces if isinstance(surfaces, Iterable) else (surfaces,))]
    return Estimate(math.fsum(parts), math.fsum(p.error for p in parts))


def dirichlet_energy(surface: ParametricSurface, *, rtol: float = 1e-12) -> Estimate:
    """Dirichlet energy ``1/2 int |S_u|^2 + |S_v|^2 du dv``, never below the area; in the square of the model's unit.

    Parameters
    ----------
    surface
        Of a ``Surface`` the energy is the quadratic form ``K_u (x) M_v + M_u (x) K_v`` of its control points, with the
        Gram matrices M of the basis functions and K of their derivatives: exact to rounding.
    rtol
        Wanted relative error for other surfaces, from 1e-14.

    Raises
    ------
    InputError
        When rtol is out of its range, or the shape is no surface.

    References
    ----------
    J. Monterde, The Plateau-Bezier problem, Mathematics of Surfaces 2003, Lecture Notes in Computer Science 2768.

    Examples
    --------
    The bilinear patch over a skew quadrilateral: 4/3.

    >>> from gtcad import BERNSTEIN
    >>> skew = [[[0, 0, 0], [0, 1, 1]], [[1, 0, 1], [1, 1, 0]]]
    >>> round(dirichlet_energy(Surface(skew, family_u=BERNSTEIN, family_v=BERNSTEIN)), 12)
    1.333333333333
    """
    _check_rtol(rtol)
    if isinstance(surface, Surface):
        return _dirichlet_form(surface)

    def integrand(u: Array, v: Array) -> Array:
        s_u, s_v = surface.derivative(u, v, (1, 0)), surface.derivative(u, v, (0, 1))
        return np.asarray((s_u * s_u).sum(axis=-1) + (s_v * s_v).sum(axis=-1)) / 2

    return over_domain(surface, integrand, rtol)


def _dirichlet_form(surface: Surface) -> Estimate:
    points = surface.control_points - surface.control_points.mean(axis=(0, 1))  # the energy does not see a shift
    value = size = 0.0
    for order_u, order_v in ((1, 0), (0, 1)):
        gram_u, gram_v = surface.factors_u.gram(order_u, order_u), surface.factors_v.gram(order_v, order_v)
        for x in np.moveaxis(points, -1, 0):
            value += float(np.sum(x * (gram_u @ x @ gram_v))) / 2
            size += float(np.sum(abs(x) * (abs(gram_u) @ abs(x) @ abs(gram_v)))) / 2
    return Estimate(value, _ROUNDING * size)


def _check_rtol(rtol: float) -> None:
    if not 1e-14 <= rtol < 1:
        raise InputError(f"rtol must lie in [1e-14, 1), got {rtol}")


def _norm(vectors: Array) -> Array:
    return np.asarray(np.sqrt(np.einsum("...d,...d->...", vectors, vectors)))


def _crossed(surface: ParametricSurface, u: Array, v: Array) -> Array:
    s_u, s_v = surface.derivative(u, v, (1, 0)), surface.derivative(u, v, (0, 1))
    if surface.dimension == 2:
        return np.asarray(s_u[..., :1] * s_v[..., 1:] - s_u[..., 1:] * s_v[..., :1])
    return np.cross(s_u, s_v)


@lru_cache(maxsize=1)
def _rules() -> tuple[Array, Array]:
    """Nodes of both rules on [0, 1] side by side; the weights of the fine and of the coarse one, shape (2, nodes)."""
    (z, weights), (z_fine, weights_fine) = (np.polynomial.legendre.leggauss(n) for n in (_COARSE, _FINE))
    nodes = (np.concatenate([z, z_fine]) + 1) / 2
    table = np.zeros((2, _COARSE + _FINE))
    table[0, _COARSE:], table[1, :_COARSE] = weights_fine / 2, weights / 2
    return nodes, table


@dataclass(frozen=True)
class _Pieces:
    """Parts of the domain side by side; arrays of shape (pieces,) or (pieces, variables)."""

    corner: Array
    width: Array
    value: Array
    magnitude: Array
    errors: Array

    def joined(self, other: _Pieces) -> _Pieces:
        return _Pieces(*(np.concatenate(pair) for pair in zip(self._arrays(), other._arrays(), strict=True)))

    def where(self, mask: NDArray[np.bool_]) -> _Pieces:
        return _Pieces(*(array[mask] for array in self._arrays()))

    def _arrays(self) -> tuple[Array, ...]:
        return self.corner, self.width, self.value, self.magnitude, self.errors

    def halves(self) -> tuple[Array, Array]:
        """Corners and widths of the halves across the variable of larger error."""
        across = self.errors.argmax(axis=1)[:, None] == np.arange(self.errors.shape[1])
        width = np.where(across, self.width / 2, self.width)
        second = self.corner + np.where(across, width, 0.0)
        return np.concatenate([self.corner, second]), np.concatenate([width, width])


def _integrated(corner: Array, width: Array, values: Array) -> _Pieces:
    """Both rules on values of shape (pieces, nodes) or (pieces, nodes, nodes)."""
    fine, coarse = _rules()[1]
    cell = width.prod(axis=1)
    if values.ndim == 2:
        value, magnitude = cell * (values @ fine), cell * (abs(values) @ fine)
        others = [values @ coarse]
    else:
        value, magnitude = cell * (values @ fine @ fine), cell * (abs(values) @ fine @ fine)
        others = [values @ fine @ coarse, values @ coarse @ fine]
    errors = np.stack([abs(cell * other - value) for other in others], axis=1)
    return _Pieces(corner, width, value, magnitude, errors)


def _adaptive(pieces_at: Callable[[Array, Array], _Pieces], variables: int, rtol: float) -> Estimate:
    _check_rtol(rtol)
    with np.errstate(all="ignore"):
        pieces = pieces_at(np.zeros((1, variables)), np.ones((1, variables)))
        while True:
            value, magnitude = math.fsum(pieces.value), math.fsum(pieces.magnitude)
            errors = pieces.errors.sum(axis=1)
            if not math.isfinite(magnitude):
                return Estimate(value, math.inf)
            if errors.sum() <= rtol * magnitude or len(errors) >= _MOST_PIECES[variables]:
                return Estimate(value, float(errors.sum()) + _ROUNDING * magnitude)
            splitting = _worst(errors, rtol * magnitude, _MOST_PIECES[variables] - len(errors))
            if pieces.width[splitting].min() <= _LEAST_WIDTH:
                return Estimate(value, math.inf)
            pieces = pieces.where(~splitting).joined(pieces_at(*pieces.where(splitting).halves()))


def _worst(errors: Array, target: float, most: int) -> NDArray[np.bool_]:
    """Which pieces to halve next: of those that keep the sum above the target the ones near the largest error."""
    order = errors.argsort()
    chosen = (errors[order].cumsum() > target) & (errors[order] >= _NEAR_WORST * errors.max())
    chosen[:-most] = False
    result = np.empty(errors.shape, dtype=bool)
    result[order] = chosen
    return result


def _along(curve: Any, integrand: Callable[[Any, Array], Array], rtol: float) -> Estimate:
    """The integral of a function of a curve and its parameters over the curve's domain, piece by piece of a chain."""
    if isinstance(curve, SeparableSurface) or not hasattr(curve, "derivative"):
        raise InputError(f"curve must be a curve, got {type(curve).__name__}")
    pieces = getattr(curve, "pieces", ())
    if len(pieces) > 1:
        parts = [_along(piece, integrand, rtol) for piece in pieces]
        return Estimate(math.fsum(parts), math.fsum(part.error for part in parts))
    first, last = getattr(curve, "domain", (0.0, 1.0))
    width = last - first
    return _over_interval(lambda t: width * integrand(curve, first + width * t), rtol)


def domain_of(surface: Any) -> tuple[tuple[float, float], tuple[float, float]]:
    """First and last u, first and last v: those of a spline, else of the unit square."""
    (left, right), (lower, upper) = getattr(surface, "domain", ((0.0, 1.0), (0.0, 1.0)))
    return (left, right), (lower, upper)


def over_domain(surface: Any, integrand: Callable[[Array, Array], Array], rtol: float) -> Estimate:
    """The integral of a function of a surface's parameters over its domain; as ``over_square``.

    Raises
    ------
    InputError
        When the shape is no surface.
    """
    if isinstance(surface, SeparableCurve) or not hasattr(surface, "derivative"):
        raise InputError(f"surface must be a surface, got {type(surface).__name__}")
    (left, right), (lower, upper) = domain_of(surface)
    a, b = right - left, upper - lower
    return over_square(lambda u, v: a * b * integrand(left + a * u, lower + b * v), rtol)


def _over_interval(integrand: Callable[[Array], Array], rtol: float) -> Estimate:
    def pieces_at(corner: Array, width: Array) -> _Pieces:
        return _integrated(corner, width, integrand(corner + width * _rules()[0]))

    return _adaptive(pieces_at, 1, rtol)


def over_square(integrand: Callable[[Array, Array], Array], rtol: float) -> Estimate:
    """The integral of a function of u and v over the unit square, by adaptive Gauss-Legendre quadrature."""

    def pieces_at(corner: Array, width: Array) -> _Pieces:
        parameters = corner[:, :, None] + width[:, :, None] * _rules()[0]
        return _integrated(corner, width, np.stack([integrand(u[:, None], v[None, :]) for u, v in parameters]))

    return _adaptive(pieces_at, 2, rtol)
