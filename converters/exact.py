"""Exact rational and polynomial forms of pieces of degree 2, and of classical Bezier pieces.

With u = tan(pi t / 4), sin(pi t / 2) = 2u / (1 + u^2) and cos(pi t / 2) = (1 - u^2) / (1 + u^2), every GT piece of
degree 2 is a rational Bezier piece of degree 4 in u; for some design variables a simpler one in another parameter w:

    gamma = (-1, -1)   chord, degree 1 in w = s^2
    gamma_1 = -1       parabola, polynomial degree 2 in w = 1 - c
    gamma_2 = -1       parabola, polynomial degree 2 in w = s
    gamma = (0, 0)     ellipse arc, rational degree 2 in w = u
    any other          rational degree 4 in w = u

Classical Bezier pieces are their own polynomial form. The parameter of an exact form is not the model's: the
``ParameterMap`` says how they correspond.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.basis import BERNSTEIN, GT, Basis
from gtcad.chebyshev import UNIT_ROUNDOFF
from gtcad.converters.bspline import MAX_DEGREE, BSplineCurve, BSplineSurface
from gtcad.errors import InputError
from gtcad.factors import RestrictedFactors
from gtcad.protocol import Factors, SeparableCurve, SeparableSurface

Array = NDArray[np.float64]

_QUARTER_PI, _HALF_PI = math.pi / 4, math.pi / 2
_TO_EXACT: dict[str, Callable[[Array], Array]] = {
    "identity": lambda t: t,
    "tangent": lambda t: np.tan(_QUARTER_PI * t),
    "versine": lambda t: 2 * np.sin(_QUARTER_PI * t) ** 2,
    "sine": lambda t: np.sin(_HALF_PI * t),
    "sine squared": lambda t: np.sin(_HALF_PI * t) ** 2,
}
_FROM_EXACT: dict[str, Callable[[Array], Array]] = {
    "identity": lambda w: w,
    "tangent": lambda w: np.arctan(w) / _QUARTER_PI,
    "versine": lambda w: np.arcsin(np.sqrt(w / 2)) / _QUARTER_PI,
    "sine": lambda w: np.arcsin(w) / _HALF_PI,
    "sine squared": lambda w: np.arcsin(np.sqrt(w)) / _HALF_PI,
}


@dataclass(frozen=True)
class ParameterMap:
    """How the spline's parameter x in [0, 1] corresponds to the shape's parameter t in [0, 1].

    Attributes
    ----------
    kind
        "identity", "tangent" (w = tan(pi t / 4)), "versine" (w = 1 - cos(pi t / 2)), "sine" (w = sin(pi t / 2)) or
        "sine squared".
    start, end
        The part of the whole piece's domain that the shape covers; x runs linearly from w(start) to w(end).
    """

    kind: str = "identity"
    start: float = 0.0
    end: float = 1.0

    def __call__(self, x: ArrayLike) -> Array:
        """The shape's parameters t at the spline's parameters x."""
        if self.kind == "identity":
            return np.asarray(x, dtype=np.float64)
        whole: Array = _FROM_EXACT[self.kind](np.clip(self.whole(np.asarray(x, dtype=np.float64)), 0.0, 1.0))
        return np.asarray(np.clip((whole - self.start) / (self.end - self.start), 0.0, 1.0))

    def inverse(self, t: ArrayLike) -> Array:
        """The spline's parameters x at the shape's parameters t."""
        t = np.asarray(t, dtype=np.float64)
        if self.kind == "identity":
            return t
        start, end = self.ends
        whole: Array = _TO_EXACT[self.kind](self.start * (1 - t) + self.end * t)
        return np.asarray(np.clip((whole - start) / (end - start), 0.0, 1.0))

    @property
    def ends(self) -> tuple[float, float]:
        """The exact form's own parameter w at start and end."""
        forward = _TO_EXACT[self.kind]
        # tan(pi/4) rounds to just below 1
        start, end = (x if x in (0.0, 1.0) else float(forward(np.array(x))) for x in (self.start, self.end))
        return start, end

    def whole(self, x: Array) -> Array:
        """The exact form's own parameter w."""
        start, end = self.ends
        return start * (1 - x) + end * x


IDENTITY = ParameterMap()


@dataclass(frozen=True)
class MappedFactors:
    """Factors followed through a parameter map: polynomials p_i and one denominator D, F_i = p_i / D.

    Attributes
    ----------
    map
        The parameter map.
    gamma
        Design variables of the whole piece, of degree 2.
    """

    map: ParameterMap
    gamma: tuple[float, float]

    @staticmethod
    def of(factors: Factors, parameter_map: ParameterMap) -> MappedFactors:
        """The form of that kind.

        Raises
        ------
        InputError
            When these factors have no exact form under that map.
        """
        base, start, end = whole_factors(factors)
        kinds = _kinds(base)
        if parameter_map.kind not in kinds or (parameter_map.start, parameter_map.end) != (start, end):
            raise InputError(f"no exact form of kind {parameter_map.kind!r} for {factors.key}")
        assert isinstance(base, Basis)
        return MappedFactors(parameter_map, base.gamma)

    @property
    def degree(self) -> int:
        """Degree of the polynomials."""
        return len(self._numerators()) - 1

    @property
    def rounding(self) -> float:
        """Bound of the rounding errors of ``rows``, summed, in units of the denominator."""
        return 64 * UNIT_ROUNDOFF

    def rows(self, x: Array) -> Array:
        """Numerators p_i at flat parameters, shape (3, x.size)."""
        return np.asarray(_bezier_values(self._numerators(), self.map.whole(x)).T)

    def denominator(self, x: Array) -> Array:
        """The denominator D, growing with w from 1 on."""
        w = self.map.whole(x)
        power = {1: 0, 2: 1, 4: 2}[self.degree] if self.map.kind == "tangent" else 0
        return np.asarray((1 + w * w) ** power)

    def bezier(self) -> tuple[Array, Array | None]:
        """Bezier coefficients of the p_i, shape (degree + 1, 3), and of D, over x in [0, 1]."""
        numerators, denominator = self._numerators(), self._denominator()
        start, end = self.map.ends
        if (start, end) != (0.0, 1.0):
            part = _restriction(len(numerators) - 1, start, end)
            numerators, denominator = part @ numerators, part @ denominator
        return numerators, None if self.map.kind != "tangent" else denominator

    def _numerators(self) -> Array:
        """Bezier coefficients over w in [0, 1], shape (degree + 1, 3)."""
        g1, g2 = self.gamma
        if self.map.kind == "sine squared":
            return np.array([[1.0, 0, 0], [0, 0, 1]])
        if self.map.kind == "versine":
            return np.array([[1.0, 0, 0], [0, (1 + g2) / 2, (1 - g2) / 2], [0, 0, 1]])
        if self.map.kind == "sine":
            return np.array([[1.0, 0, 0], [(1 - g1) / 2, (1 + g1) / 2, 0], [0, 0, 1]])
        if self.gamma == (0.0, 0.0):
            return np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 2]])
        return np.array(
            [
                [1.0, 0, 0],
                [(1 - g1) / 2, (1 + g1) / 2, 0],
                [(1 - g1) / 3, (2 + g1 + g2) / 3, (1 - g2) / 3],
                [0, 1 + g2, 1 - g2],
                [0, 0, 4],
            ]
        )

    def _denominator(self) -> Array:
        if self.map.kind != "tangent":
            return np.ones(self.degree + 1)
        return np.array([1.0, 1, 2]) if self.gamma == (0.0, 0.0) else np.array([1.0, 1, 4 / 3, 2, 4])


def exact_map(factors: Factors) -> ParameterMap | None:
    """The parameter map of the simplest exact form of these factors, or None when there is none."""
    base, start, end = whole_factors(factors)
    kinds = _kinds(base)
    if not kinds:
        return None
    return IDENTITY if kinds[0] == "identity" else ParameterMap(kinds[0], start, end)


def polynomial_form(factors: Factors) -> Array | None:
    """Matrix from coefficients to Bezier poles for factors that are polynomials themselves, else None."""
    base, start, end = whole_factors(factors)
    return _restriction(base.count - 1, start, end) if _kinds(base) == ("identity",) else None


def exact_curve(curve: SeparableCurve) -> tuple[BSplineCurve, ParameterMap] | None:
    """The exact form of a curve as one Bezier span on [0, 1] with its parameter map, or None when there is none."""
    found = _direction(curve.factors)
    if found is None:
        return None
    matrix, weights, parameter_map = found
    poles = matrix @ curve.coefficients
    degree = len(matrix) - 1
    if weights is not None:
        poles = poles / weights[:, None]
    return BSplineCurve(poles, [0.0, 1.0], [degree + 1] * 2, degree, weights), parameter_map


def exact_surface(surface: SeparableSurface) -> tuple[BSplineSurface, tuple[ParameterMap, ParameterMap]] | None:
    """The exact form of a surface as one Bezier patch with its parameter maps, or None when a direction has none."""
    found_u, found_v = _direction(surface.factors_u), _direction(surface.factors_v)
    if found_u is None or found_v is None:
        return None
    (matrix_u, weights_u, map_u), (matrix_v, weights_v, map_v) = found_u, found_v
    poles = np.einsum("ai,bj,ijd->abd", matrix_u, matrix_v, surface.coefficients)
    weights = None
    if weights_u is not None or weights_v is not None:
        ones_u, ones_v = np.ones(len(matrix_u)), np.ones(len(matrix_v))
        weights = np.outer(ones_u if weights_u is None else weights_u, ones_v if weights_v is None else weights_v)
        poles = poles / weights[..., None]
    degree_u, degree_v = len(matrix_u) - 1, len(matrix_v) - 1
    spline = BSplineSurface(
        poles, [0.0, 1.0], [degree_u + 1] * 2, degree_u, [0.0, 1.0], [degree_v + 1] * 2, degree_v, weights
    )
    return spline, (map_u, map_v)


def _direction(factors: Factors) -> tuple[Array, Array | None, ParameterMap] | None:
    parameter_map = exact_map(factors)
    if parameter_map is None:
        return None
    if (polynomial := polynomial_form(factors)) is not None:
        return polynomial, None, parameter_map
    matrix, weights = MappedFactors.of(factors, parameter_map).bezier()
    return matrix, weights, parameter_map


def whole_factors(factors: Factors) -> tuple[Factors, float, float]:
    """The factors on their whole domain, and the part of it that is meant."""
    start, end = 0.0, 1.0
    while isinstance(factors, RestrictedFactors):
        start, end = (factors.start * (1 - x) + factors.end * x for x in (start, end))
        factors = factors.base
    return factors, start, end


def _kinds(base: Factors) -> tuple[str, ...]:
    """The kinds of exact forms of factors on their whole domain, the simplest first."""
    if not isinstance(base, Basis):
        return ()
    if base.family is BERNSTEIN:
        return ("identity",) if base.degree <= MAX_DEGREE else ()
    if base.family is not GT or base.degree != 2:
        return ()
    g1, g2 = base.gamma
    if g1 == -1 and g2 == -1:
        return ("sine squared", "versine", "sine", "tangent")
    return (("versine",) if g1 == -1 else ()) + (("sine",) if g2 == -1 else ()) + ("tangent",)


def _bezier_values(coefficients: Array, t: Array) -> Array:
    """De Casteljau's algorithm: coefficients (degree + 1, c), flat t, result (t.size, c)."""
    values = np.repeat(coefficients[:, None], t.size, axis=1)
    for _ in range(len(coefficients) - 1):
        values = values[:-1] * (1 - t[:, None]) + values[1:] * t[:, None]
    return np.asarray(values[0])


def _restriction(degree: int, start: float, end: float) -> Array:
    """Matrix from Bezier coefficients over [0, 1] to those over [start, end], by blossoming."""
    result = np.empty((degree + 1, degree + 1))
    for row in range(degree + 1):
        values = np.eye(degree + 1)
        for t in [start] * (degree - row) + [end] * row:
            values = values[:-1] * (1 - t) + values[1:] * t
        result[row] = values[0]
    return result
