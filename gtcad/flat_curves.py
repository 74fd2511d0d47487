"""Plane curves that are known by their values: Chebyshev polynomials on as many spans as they take.

Where a curve has no closed form, as the image of a curve in a flat pattern, it is resolved to rounding by polynomials
of degree 190 at most, span by span. Every span is a curve of the protocol, which can be fitted with a proof.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.basis import checked_order, checked_parameters
from gtcad.chebyshev import nodes, transform
from gtcad.composite import Composite
from gtcad.curve import Curve
from gtcad.errors import InputError
from gtcad.factors import CurveOfTerms
from gtcad.measure import Estimate, length
from gtcad.polynomial import MAX_COUNT, Polynomials, resolved
from gtcad.protocol import SeparableCurve
from gtcad.restricted import RestrictedCurve

Array = NDArray[np.float64]

LEAST_WIDTH = 2.0**-12
"""Of [0, 1]: a span as narrow that is not resolved holds a singularity."""

_JOINED = 1e-10  # of the coordinates: ends of pieces as near are one


@dataclass(frozen=True, eq=False)
class FlatCurve:
    """A curve of curves of the protocol, t in [0, 1].

    Parameters
    ----------
    pieces
        One for each span, of one dimension, in the model's unit.
    breaks
        The ends of the spans, from 0 to 1, one more than the pieces.
    error
        Estimated distance from what the curve stands for at equal parameters, in the model's unit.

    Examples
    --------
    >>> from gtcad import BERNSTEIN, Curve
    >>> FlatCurve((Curve([[0, 0], [4, 2]], family=BERNSTEIN),), (0.0, 1.0)).evaluate(0.25).tolist()
    [1.0, 0.5]
    """

    pieces: tuple[SeparableCurve, ...]
    breaks: tuple[float, ...]
    error: float = 0.0

    @property
    def dimension(self) -> int:
        """Space dimension d."""
        return self.pieces[0].dimension

    @property
    def domain(self) -> tuple[float, float]:
        """First and last parameter."""
        return 0.0, 1.0

    @property
    def extent(self) -> float:
        """The longest side of the box around samples of the curve."""
        return float(np.ptp(self.evaluate(np.linspace(0.0, 1.0, 65)), axis=0).max())

    def evaluate(self, t: ArrayLike) -> Array:
        """Points, shape t.shape + (d,)."""
        return self.derivative(t, 0)

    def derivative(self, t: ArrayLike, order: int = 1) -> Array:
        """Derivatives of the order with respect to t, shape t.shape + (d,).

        Raises
        ------
        InputError
            When a parameter is outside [0, 1] or the order is not a whole number from 0.
        """
        order = checked_order("order", order)
        t = checked_parameters("t", t)
        flat = t.reshape(-1)
        place, local = localised(flat, self.breaks)
        result = np.empty((flat.size, self.dimension))
        for k in np.unique(place):
            here, width = place == k, self.breaks[k + 1] - self.breaks[k]
            result[here] = self.pieces[k].derivative(local[here], order) / width**order
        return result.reshape(*t.shape, self.dimension)

    @property
    def length(self) -> Estimate:
        """Arc length in the model's unit."""
        parts = [length(piece) for piece in self.pieces]
        return Estimate(math.fsum(parts), math.fsum(part.error for part in parts))

    @property
    def closed(self) -> bool:
        """Whether the curve ends where it starts, up to its error and rounding."""
        ends = self.evaluate(np.array([0.0, 1.0]))
        return bool(np.linalg.norm(ends[1] - ends[0]) <= 2 * self.error + 1e-12 * max(self.extent, np.abs(ends).max()))

    def reversed(self) -> FlatCurve:
        """The same points from the other end."""
        breaks = tuple(1.0 - place for place in self.breaks[::-1])
        return replace(self, pieces=tuple(_backwards(piece) for piece in self.pieces[::-1]), breaks=breaks)

    def transformed(self, matrix: ArrayLike, translation: ArrayLike | None = None) -> FlatCurve:
        """The affine image: points x become ``matrix @ x + translation``; of the error that of a similarity."""
        scale = float(np.linalg.norm(np.asarray(matrix, dtype=np.float64), 2))
        moved = tuple(moved_curve(piece, matrix, translation) for piece in self.pieces)
        return replace(self, pieces=moved, error=scale * self.error)


ParameterCurve = SeparableCurve | Composite | FlatCurve | Callable[[Array], Array]


def localised(t: Array, breaks: Sequence[float]) -> tuple[NDArray[np.int_], Array]:
    """The span that each parameter lies in, and the parameter counted on it from 0 to 1."""
    edges = np.array(breaks)
    place = np.clip(np.searchsorted(edges, t, side="right") - 1, 0, len(edges) - 2)
    start, end = edges[place], edges[place + 1]
    return place, np.clip((t - start) / (end - start), 0.0, 1.0)


def polynomial_curve(series: Array) -> CurveOfTerms:
    """The curve of Chebyshev series on [0, 1], one for each coordinate, shape (d, degree + 1)."""
    return CurveOfTerms(Polynomials(series), np.eye(len(series)))


def _backwards(curve: SeparableCurve) -> SeparableCurve:
    factors = curve.factors
    if isinstance(curve, Curve):
        return curve.reversed()
    if not isinstance(factors, Polynomials):
        return RestrictedCurve(curve, (1.0, 0.0))
    signs = (-1.0) ** np.arange(factors.degree + 1)
    return CurveOfTerms(Polynomials(signs * factors.coefficients), curve.coefficients)


def moved_curve(curve: SeparableCurve, matrix: ArrayLike, translation: ArrayLike | None = None) -> SeparableCurve:
    """The affine image of a curve; one of polynomials alone keeps its few factors."""
    factors = curve.factors
    if not isinstance(factors, Polynomials):
        return curve.transformed(matrix, translation)
    series = np.asarray(matrix, dtype=np.float64) @ curve.coefficients.T @ factors.coefficients
    if translation is not None:
        series[:, 0] += np.asarray(translation, dtype=np.float64)
    return polynomial_curve(series)


def resolved_curve(function: Callable[[Array], Array], breaks: Sequence[float], what: str, error: float) -> FlatCurve:
    """The curve of a function that is analytic between the breaks.

    Parameters
    ----------
    function
        From flat parameters in [0, 1] to points, shape (t.size, d).
    breaks
        From 0 to 1.
    what
        The name of the function in messages.
    error
        Of its values.

    Raises
    ------
    InputError
        When a value is not finite, or polynomials do not resolve the function.
    """
    spans, left = [], list(pairwise(breaks))[::-1]
    while left:
        start, end = left.pop()
        found = resolved(lambda count, a=start, b=end: _series(function, a, b, count, what))  # type: ignore[misc]
        if found is not None and found[1].shape[1] <= MAX_COUNT:
            spans.append((start, end, found))
            continue
        if end - start < 2 * LEAST_WIDTH:
            raise InputError(f"{what} is not resolved near t = {start:.6g}: it has a jump or a kink there")
        middle = (start + end) / 2
        left += [(middle, end), (start, middle)]
    off = max(float(np.linalg.norm(whole[:, -(whole.shape[1] // 8) :], axis=0).sum()) for _, _, (whole, _) in spans)
    pieces = tuple(polynomial_curve(kept) for _, _, (_, kept) in spans)
    for (start, _, _), (before, after) in zip(spans[1:], pairwise(pieces), strict=True):
        ends = before.evaluate(1.0), after.evaluate(0.0)
        if np.linalg.norm(ends[1] - ends[0]) > 4 * (error + off) + _JOINED * float(np.abs(ends).max()):
            raise InputError(f"{what} is not resolved near t = {start:.6g}: it has a jump there")
    return FlatCurve(pieces, (spans[0][0], *(end for _, end, _ in spans)), error + off)


def _series(function: Callable[[Array], Array], start: float, end: float, count: int, what: str) -> Array:
    t = (start + end) / 2 + (end - start) / 2 * nodes(count)
    values = np.asarray(function(np.clip(t, start, end)), dtype=np.float64)
    if values.ndim != 2 or len(values) != count or values.shape[1] not in (2, 3):
        raise InputError(f"{what} must return points of shape (t.size, 2 or 3), got {values.shape}")
    if not np.isfinite(values).all():
        raise InputError(f"{what} must be finite, it is not near t = {t[~np.isfinite(values).all(axis=1)][0]:.6g}")
    return (transform(count) @ values).T


def parameter_function(curve: ParameterCurve) -> tuple[Callable[[Array], Array], tuple[float, ...], float]:
    """A curve as a function of flat t in [0, 1], the ends of its analytic parts, and its error."""
    if isinstance(curve, Composite):
        count = len(curve.pieces)
        joints = tuple((np.arange(count + 1) / count).tolist())
        pieces = FlatCurve(curve.pieces, joints)
        return _plane(pieces), joints, 0.0
    if isinstance(curve, FlatCurve):
        return _plane(curve), curve.breaks, curve.error
    if isinstance(curve, SeparableCurve):
        return _plane(curve), (0.0, 1.0), 0.0
    if not callable(curve):
        raise InputError(f"the curve must be a plane curve or a function, got {type(curve).__name__}")
    return curve, (0.0, 1.0), 0.0


def _plane(curve: SeparableCurve | FlatCurve) -> Callable[[Array], Array]:
    if curve.dimension != 2:
        raise InputError(f"the curve must be plane, got dimension {curve.dimension}")
    return curve.evaluate


def inside(parameters: ArrayLike) -> Array:
    """Parameters, shape (count, 2), rounding taken off at the borders.

    Raises
    ------
    InputError
        When they leave [0, 1] by more.
    """
    found = np.asarray(parameters, dtype=np.float64)
    if found.ndim != 2 or found.shape[1] != 2:
        raise InputError(f"the curve must return points of shape (t.size, 2), got {found.shape}")
    outside = ~((found >= -1e-12) & (found <= 1 + 1e-12)).all(axis=-1)
    if outside.any():
        raise InputError(f"the curve leaves the patch: (u, v) = {tuple(found[outside][0].tolist())} is outside [0, 1]")
    return np.clip(found, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class RolledCurve:
    """A curve on a patch.

    Attributes
    ----------
    parameters
        (u, v).
    space
        The curve itself, in the model's unit.
    """

    parameters: FlatCurve
    space: FlatCurve
