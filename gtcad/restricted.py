"""A part of the domain of any separable shape, as a shape of its own on [0, 1]."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.errors import InputError
from gtcad.factors import RestrictedFactors, WithIsoparametrics
from gtcad.protocol import Factors, SeparableCurve, SeparableSurface, domain_part

Array = NDArray[np.float64]
Bounds = tuple[float, float]


@dataclass(frozen=True)
class RestrictedCurve(SeparableCurve):
    """The part of a curve over ``range = (a, b)``; made by ``Restricted``."""

    shape: SeparableCurve
    range: Bounds

    @property
    def factors(self) -> Factors:
        """The factors of the whole, on the part."""
        return RestrictedFactors(self.shape.factors, *self.range)

    @property
    def coefficients(self) -> Array:
        """The coefficients of the whole."""
        return self.shape.coefficients

    def reversed(self) -> RestrictedCurve:
        """The same points from the other end."""
        return RestrictedCurve(self.shape, self.range[::-1])

    def transformed(self, matrix: ArrayLike, translation: ArrayLike | None = None) -> RestrictedCurve:
        """The affine image: points x become ``matrix @ x + translation``."""
        return RestrictedCurve(self.shape.transformed(matrix, translation), self.range)


@dataclass(frozen=True)
class RestrictedSurface(WithIsoparametrics):
    """The part of a surface over ``range = ((u_a, u_b), (v_a, v_b))``; made by ``Restricted``."""

    shape: SeparableSurface
    range: tuple[Bounds, Bounds]

    @property
    def factors_u(self) -> Factors:
        """The factors of the whole in u, on the part."""
        return RestrictedFactors(self.shape.factors_u, *self.range[0])

    @property
    def factors_v(self) -> Factors:
        """The factors of the whole in v, on the part."""
        return RestrictedFactors(self.shape.factors_v, *self.range[1])

    @property
    def coefficients(self) -> Array:
        """The coefficients of the whole."""
        return self.shape.coefficients

    @property
    def definition_error(self) -> float:
        """That of the whole."""
        return self.shape.definition_error

    def reversed(self, direction: str) -> RestrictedSurface:
        """The same points with one parameter, "u" or "v", running backwards."""
        if direction not in ("u", "v"):
            raise InputError(f'direction must be "u" or "v", got {direction!r}')
        u, v = self.range
        return RestrictedSurface(self.shape, (u[::-1], v) if direction == "u" else (u, v[::-1]))

    def transformed(self, matrix: ArrayLike, translation: ArrayLike | None = None) -> RestrictedSurface:
        """The affine image: points x become ``matrix @ x + translation``."""
        return RestrictedSurface(self.shape.transformed(matrix, translation), self.range)


@overload
def Restricted(shape: SeparableCurve, range: Sequence[float]) -> RestrictedCurve: ...
@overload
def Restricted(shape: SeparableSurface, range: Sequence[Sequence[float]]) -> RestrictedSurface: ...
def Restricted(
    shape: SeparableCurve | SeparableSurface,
    range: Sequence[float] | Sequence[Sequence[float]],
) -> RestrictedCurve | RestrictedSurface:
    """A part of a shape's domain, stretched to [0, 1].

    Parameters
    ----------
    shape
        Any curve or surface of the protocol.
    range
        (a, b) of a curve, ((u_a, u_b), (v_a, v_b)) of a surface, all in [0, 1]; a > b runs backwards.

    Raises
    ------
    InputError
        When the range is empty, leaves [0, 1], or is that of the other kind of shape.

    Examples
    --------
    >>> from gtcad import Curve
    >>> Restricted(Curve([[1, 0], [1, 1], [0, 1]]), (0.0, 0.5)).evaluate(1.0).round(6).tolist()
    [0.707107, 0.707107]
    """
    try:
        values = np.shape(range)
    except ValueError:  # ragged
        values = ()
    if isinstance(shape, SeparableCurve):
        if values != (2,):
            raise InputError(f"range must be (a, b) for a curve, got {range}")
        return RestrictedCurve(shape, domain_part("range", range))  # type: ignore[arg-type]
    if values != (2, 2):
        raise InputError(f"range must be ((u_a, u_b), (v_a, v_b)) for a surface, got {range}")
    u, v = range
    return RestrictedSurface(shape, (domain_part("range[0]", u), domain_part("range[1]", v)))  # type: ignore[arg-type]
