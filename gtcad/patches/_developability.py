"""How developable a patch is: twist, edge of regression, singular rulings."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gtcad.errors import InputError
from gtcad.factors import Constant, CurveOfTerms, WithIsoparametrics, constant_term
from gtcad.patches._definitions import constant
from gtcad.patches._developable import Developable
from gtcad.patches._moving_frames import proved_bound
from gtcad.patches._singular import highest, kept, zeros
from gtcad.patches._twist import twist_bound
from gtcad.polynomial import Spanned
from gtcad.protocol import SeparableCurve, SeparableSurface

Array = NDArray[np.float64]

_PARALLEL = 1e-12  # relative difference of two normals that is rounding
_TINY = 1e-300


@dataclass(frozen=True)
class Developability:
    """How far a patch linear in v is from a developable, and from being singular.

    Attributes
    ----------
    determinant, determinant_t
        Largest ``|det(a', b', b - a)| / (|a'| |b'| |b - a|)``, without unit, and where: 0 for developables. Sampled.
    twist_deg, twist_t
        Largest angle between the normals along one ruling, in degrees, and where. Sampled.
    twist_bound_deg
        Proved upper bound of that angle for the patch as it is evaluated, rounding included: never below
        ``twist_deg`` but for rounding; infinite where no bound was found.
    regression_distance, regression_t
        How far beyond the patch the edge of regression runs where it comes nearest, along the ruling and in the model's
        unit, and where; negative where it crosses the patch, infinite when it is at infinity. For a patch that is not
        developable its line of striction stands for it. Sampled.
    singular_rulings
        The t where the ruling has no length or no tangent plane. Found from samples, each followed to its place.
    regular
        True: proved, that the patch as it is evaluated has a tangent plane everywhere, and so is not crossed by its
        edge of regression. False: not proved.
    by_definition
        Whether sampled figures are those of the patch by definition, in closed form: of a ``Developable``.
    """

    determinant: float
    determinant_t: float
    twist_deg: float
    twist_t: float
    twist_bound_deg: float
    regression_distance: float
    regression_t: float
    singular_rulings: tuple[float, ...]
    regular: bool
    by_definition: bool


class _Rulings(NamedTuple):
    """What the rulings at some parameters say: a', b', b - a, a' x R and b' x R with R the unit vector along b - a."""

    slopes: tuple[Array, Array]
    along: Array
    normals: tuple[Array, Array]

    @property
    def length(self) -> Array:
        return np.asarray(np.linalg.norm(self.along, axis=1))


_Source = Callable[[Array], _Rulings]


def developability(patch: SeparableSurface) -> Developability:
    """Measure how developable a patch is that is linear in v: ruled, cylinder, cone, developable.

    Parameters
    ----------
    patch
        Of the form ``S(u, v) = (1 - v) a(u) + v b(u)``, in space.

    Raises
    ------
    InputError
        When it is not linear in v, or not in space.

    Notes
    -----
    About 0.05 s, the proof included.

    Examples
    --------
    The saddle z = x y turns its normal by 45 degrees along the ruling x = 1:

    >>> from gtcad import BERNSTEIN, Curve
    >>> from gtcad.patches import Ruled
    >>> saddle = Ruled(
    ...     Curve([[0, 0, 0], [1, 0, 0]], family=BERNSTEIN), Curve([[0, 1, 0], [1, 1, 1]], family=BERNSTEIN)
    ... )
    >>> report = developability(saddle)
    >>> round(report.twist_deg, 9), report.twist_t
    (45.0, 0.0)
    """
    if not isinstance(patch, SeparableSurface) or patch.factors_v.derivative_bound(2) != 0:
        raise InputError(f"patch must be linear in v, got {type(patch).__name__}")
    if patch.dimension != 3:
        raise InputError(f"patch must lie in space, got dimension {patch.dimension}")
    a, b = (_still(_boundary(patch, v)) for v in (0.0, 1.0))
    source = kept(partial(_exact, patch)) if isinstance(patch, Developable) else kept(partial(_of, a, b))
    determinant_t, determinant = highest(lambda t: _determinants(source(t)))
    twist_t, twist = highest(lambda t: _angles(source(t)))
    regression_t, far = highest(lambda t: -_beyond(source(t)))
    bound = proved_bound(lambda spans: _bound(a, b, spans))
    return Developability(
        determinant,
        determinant_t,
        math.degrees(twist),
        twist_t,
        math.degrees(bound),
        -far,
        regression_t,
        tuple(_singular(source)),
        bound < math.inf and not any(isinstance(curve.factors, Constant) for curve in (a, b)),
        isinstance(patch, Developable),
    )


def _boundary(patch: SeparableSurface, v: float) -> CurveOfTerms:
    if isinstance(patch, WithIsoparametrics):
        return patch.isoparametric(v=v)
    row = patch.factors_v.rows(np.array([v]))[:, 0]
    return CurveOfTerms(patch.factors_u, np.einsum("ijd,j->id", patch.coefficients, row))


def _still(curve: CurveOfTerms) -> CurveOfTerms:
    """The curve, or if it is known to be one point, that."""
    factors, weights = constant_term(curve.factors)
    still = factors.key == curve.factors.key and (weights == 1).all() and not np.ptp(curve.coefficients, axis=0).any()
    return constant(curve.coefficients[0]) if still else curve


def _of(a: SeparableCurve, b: SeparableCurve, t: Array) -> _Rulings:
    start, end = (np.stack([curve.derivative(t, order) for order in (0, 1)]) for curve in (a, b))
    return _rulings(start, end)


def _rulings(a: Array, b: Array) -> _Rulings:
    along = np.asarray(b[0] - a[0])
    unit = along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), _TINY)
    return _Rulings((a[1], b[1]), along, (np.cross(a[1], unit), np.cross(b[1], unit)))


def _exact(patch: Developable, t: Array) -> _Rulings:
    a, b = patch.exact_derivatives(t, 1)
    return _rulings(a, b)


def _bound(a: SeparableCurve, b: SeparableCurve, spans: int) -> float:
    start, end = (Spanned.of(curve, 0, spans) for curve in (a, b))
    return twist_bound(Spanned.of(a, 1, spans), Spanned.of(b, 1, spans), end - start)


def _determinants(rulings: _Rulings) -> Array:
    (first, second), along = rulings.slopes, rulings.along
    sizes = np.linalg.norm(first, axis=1) * np.linalg.norm(second, axis=1) * rulings.length
    return np.asarray(np.abs(np.einsum("td,td->t", np.cross(first, second), along)) / np.maximum(sizes, _TINY))


def _angles(rulings: _Rulings) -> Array:
    """Between the normals at both ends, 0 where one has none."""
    first, second = rulings.normals
    sine = np.linalg.norm(np.cross(first, second), axis=1)
    angle = np.arctan2(sine, np.einsum("td,td->t", first, second))
    return np.asarray(np.where(sine > 0, angle, 0.0))


def _beyond(rulings: _Rulings) -> Array:
    """How far the edge of regression is beyond the ruling, negative on it."""
    first, second = rulings.normals
    gap = first - second
    square = np.einsum("td,td->t", gap, gap)
    sizes = np.maximum(np.linalg.norm(first, axis=1), np.linalg.norm(second, axis=1))
    far = square <= (_PARALLEL * sizes) ** 2
    place = np.einsum("td,td->t", first, gap) / np.where(far, 1.0, square)
    outside = np.maximum(-place, place - 1) * rulings.length
    return np.asarray(np.where(far, np.inf, outside))


def _singular(source: _Source) -> list[float]:
    t = np.linspace(0, 1, 129)
    rulings = source(t)
    sizes = np.hypot(*(np.linalg.norm(normal, axis=1) for normal in rulings.normals))
    found = zeros(lambda t: source(t).along, max(float(rulings.length.max()), _TINY))
    found += zeros(lambda t: np.hstack(source(t).normals), max(float(sizes.max()), _TINY))
    return sorted(set(found))
