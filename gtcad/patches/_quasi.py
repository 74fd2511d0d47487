"""Strips between two given curves: as developable as the pairing of their points makes them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.basis import BERNSTEIN, MAX_DEGREE, Basis, checked_parameters
from gtcad.chebyshev import UNIT_ROUNDOFF
from gtcad.errors import InputError
from gtcad.factors import CurveOfTerms, SurfaceOfTerms
from gtcad.patches._definitions import Definition
from gtcad.patches._developability import Developability, developability
from gtcad.patches._moving_frames import largest_norm
from gtcad.patches._patch import LINEAR, Patch, checked_curves, checked_number, in_space
from gtcad.patches._taylor import Taylor
from gtcad.polynomial import Spanned, derivative_rounding
from gtcad.protocol import SeparableCurve

Array = NDArray[np.float64]
Pairing = tuple[float, ...]

EVEN: Pairing = (0.0, 1.0)
_DEGREE = 6  # of a pairing that is searched for
_SAMPLES = 129
_SLACK = 1e-5  # of the sum of squares: a step that makes it less by no more is the last
_UNEVEN = 2.5  # largest logarithm of its steps: no stretch of a is joined to what is nearly a point of b


@dataclass(frozen=True)
class Composed(Definition):
    """The curve ``C(phi(t))``, phi a polynomial that rises from 0 to 1."""

    curve: SeparableCurve
    law: CurveOfTerms

    def taylor(self, t: Array, count: int) -> Taylor:
        """Its points; no derivatives."""
        return Taylor(self.curve.evaluate(np.clip(self.law.evaluate(t)[:, 0], 0, 1))[None])

    def _bound(self, curve: CurveOfTerms, spans: int) -> float:
        found = Spanned.of(curve, 0, spans)
        inner = Spanned.of(self.law, 0, spans)
        places = np.clip(inner.values[..., 0], 0, 1)
        factors, size = self.curve.factors, largest_norm(self.curve.coefficients)
        values = self.curve.evaluate(places.reshape(-1)).reshape(*places.shape, -1)
        bounds = np.array([factors.derivative_bound(k) / math.factorial(k) for k in range(inner.taylor.size)]) * size
        off = derivative_rounding(factors, 0) * size + (factors.count + 2) * UNIT_ROUNDOFF * size
        exact = Spanned(values, _composition(bounds, inner.taylor), off + bounds[1] * inner.rounding)
        return (found - exact).largest()


def _composition(outer: Array, inner: Array) -> Array:
    """Bounds of the Taylor coefficients of f(g) from those of f and of g, by powers of g less its value."""
    step = inner.copy()
    step[0] = 0.0
    total, power = np.zeros(inner.size), np.eye(1, inner.size)[0]
    for bound in outer:
        total += bound * power
        power = np.convolve(power, step)[: inner.size]
    return total * (1 + 1e-12)


@dataclass(frozen=True)
class QuasiDevelopable(Patch):
    """The strip of straight lines between two given curves, ``S(u, v) = (1 - v) a(u) + v b(phi(u))``.

    Parameters
    ----------
    a, b
        Curves of any kind, kept as they are.
    pairing
        Bernstein coefficients of phi, rising from 0 to 1: which point of b each point of a is joined to. (0, 1) pairs
        equal parameters.
    max_twist_deg
        A strip whose normals turn by more than so many degrees along a ruling, or are not proved to turn by less, is
        refused. None: any strip is taken.

    Raises
    ------
    InputError
        When an argument is out of its range, or the strip twists more than it may: the message says how much and where.

    Notes
    -----
    Through two curves in general there is no developable with the rulings at both ends given. ``report`` tells how far
    the strip is from one.
    """

    a: SeparableCurve
    b: SeparableCurve
    pairing: Pairing = EVEN
    max_twist_deg: float | None = None

    def __init__(
        self,
        a: SeparableCurve,
        b: SeparableCurve,
        pairing: Sequence[float] = EVEN,
        max_twist_deg: float | None = None,
    ) -> None:
        checked_curves(a=a)
        checked_curves(b=b)
        object.__setattr__(self, "a", in_space(a))
        object.__setattr__(self, "b", in_space(b))
        object.__setattr__(self, "pairing", _checked_pairing(pairing))
        limit = None if max_twist_deg is None else checked_number("max_twist_deg", max_twist_deg)
        if limit is not None and limit < 0:
            raise InputError(f"max_twist_deg must not be below 0, got {limit:g}")
        object.__setattr__(self, "max_twist_deg", limit)
        if limit is not None and not self.report.twist_bound_deg <= limit:
            found = self.report
            lead = "but does" if found.twist_deg > limit else "and is not proved to twist by less: it does"
            bound = found.twist_bound_deg
            most = f"at most {bound:.4g}, proved" if bound < math.inf else "with no bound: it is singular or nearly so"
            raise InputError(
                f"the strip may twist by {limit:g} degrees along a ruling, {lead} by {found.twist_deg:.4g} at t = "
                f"{found.twist_t:.6g} ({most})"
            )

    @cached_property
    def report(self) -> Developability:
        """Its twist, line of striction and singular rulings."""
        return developability(self)

    @cached_property
    def _paired(self) -> tuple[SeparableCurve, float]:
        """The boundary v = 1 and its proved distance from b(phi)."""
        if self.pairing == EVEN:
            return self.b, 0.0
        return Composed(0.0, self.b, _law(self.pairing)).polynomial

    @property
    def definition_error(self) -> float:
        """Proved bound of the distance of the points of equal parameters from the strip by definition."""
        return self._paired[1]

    def paired(self, t: ArrayLike) -> Array:
        """The parameters phi(t) of b, shape t.shape."""
        return _law(self.pairing).evaluate(checked_parameters("t", t))[..., 0]

    def _built(self) -> SurfaceOfTerms:
        return SurfaceOfTerms.summed(
            [
                (curve.factors, LINEAR, np.stack([end * curve.coefficients for end in ends], axis=1))
                for curve, ends in ((self.a, (1.0, 0.0)), (self._paired[0], (0.0, 1.0)))
            ]
        )

    def transformed(self, matrix: ArrayLike, translation: ArrayLike | None = None) -> QuasiDevelopable:
        """The affine image: points x become ``matrix @ x + translation``, without a limit of its twist."""
        a, b = (curve.transformed(matrix, translation) for curve in (self.a, self.b))
        return replace(self, a=a, b=b, max_twist_deg=None)


def quasi_developable(
    a: SeparableCurve,
    b: SeparableCurve,
    *,
    pairing: Sequence[float] | Literal["least-twist"] = EVEN,
    max_twist_deg: float | None = None,
) -> QuasiDevelopable:
    """A strip between two given curves, its twist in ``report``; see ``QuasiDevelopable``.

    Parameters
    ----------
    a, b, max_twist_deg
        As of ``QuasiDevelopable``.
    pairing
        Its pairing; or "least-twist": a polynomial of degree 6 that makes the mean square of the twist's sine small,
        found by a local search from equal parameters (0.1 s), none of its steps below 1/150 of another. The first and
        the last ruling keep their twist.

    Examples
    --------
    Between two arcs that are run through at different speeds:

    >>> from gtcad import Curve
    >>> low, high = Curve([[1, 0, 0], [1, 1, 0], [0, 1, 0]]), Curve([[1, 0, 1], [1, 1, 1], [0, 1, 1]], (-0.3, 0.6))
    >>> even, better = quasi_developable(low, high), quasi_developable(low, high, pairing="least-twist")
    >>> round(even.report.twist_deg, 1), better.report.twist_deg < 0.5
    (12.6, True)
    """
    if not isinstance(pairing, str):
        return QuasiDevelopable(a, b, pairing, max_twist_deg)
    if pairing != "least-twist":
        raise InputError(f'pairing must be "least-twist" or numbers that rise from 0 to 1, got {pairing!r}')
    even = QuasiDevelopable(a, b)
    return replace(even, pairing=_least_twist(even.a, even.b), max_twist_deg=max_twist_deg)


def _least_twist(a: SeparableCurve, b: SeparableCurve) -> Pairing:
    from scipy.optimize import least_squares

    t = (np.arange(_SAMPLES) + 0.5) / _SAMPLES
    point, slope, basis = a.evaluate(t), a.derivative(t), Basis(_DEGREE, family=BERNSTEIN).rows(t)

    def law(free: Array) -> Array:
        steps = np.exp(free - free.max())
        return np.concatenate([[0.0], np.cumsum(steps) / steps.sum()])

    def sines(free: Array) -> Array:
        places = np.clip(law(free) @ basis, 0, 1)
        along, other = b.evaluate(places) - point, b.derivative(places)
        first, second = np.cross(slope, along), np.cross(other, along)
        sizes = np.linalg.norm(first, axis=1) * np.linalg.norm(second, axis=1)
        volumes = np.einsum("td,td->t", np.cross(slope, other), along) * np.linalg.norm(along, axis=1)
        return np.asarray(volumes / np.maximum(sizes, 1e-300))

    found = law(least_squares(sines, np.zeros(_DEGREE), bounds=(-_UNEVEN, _UNEVEN), x_scale="jac", ftol=_SLACK).x)
    found[-1] = 1.0
    return tuple(found.tolist())


def _law(pairing: Pairing) -> CurveOfTerms:
    return CurveOfTerms(Basis(len(pairing) - 1, family=BERNSTEIN), np.array(pairing)[:, None])


def _checked_pairing(value: Sequence[float]) -> Pairing:
    try:
        values = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        values = np.empty(0)
    good = values.ndim == 1 and 2 <= values.size <= MAX_DEGREE + 1 and (values[0], values[-1]) == (0.0, 1.0)
    if not good or not (np.diff(values) > 0).all():
        raise InputError(f"pairing must be 2 to {MAX_DEGREE + 1} numbers that rise from 0 to 1, got {value!r}")
    return tuple((values + 0.0).tolist())
