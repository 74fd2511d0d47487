"""Points and directions on moving rulings: by definition, and as polynomials with a proved distance from it."""

from __future__ import annotations

import abc
import math
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.chebyshev import UNIT_ROUNDOFF, nodes, transform
from gtcad.factors import Constant, CurveOfTerms, Stacked
from gtcad.patches._moving_frames import Unresolved, largest_norm, proved_bound
from gtcad.patches._taylor import At, F, Taylor
from gtcad.polynomial import MAX_COUNT, Polynomials, Spanned, resolved
from gtcad.protocol import SeparableCurve

Array = NDArray[np.float64]

_WORST = 1e-6  # of the size: a polynomial proved no better does not stand for what defines it


def constant(values: ArrayLike) -> CurveOfTerms:
    """The curve that stays at one point."""
    return CurveOfTerms(Constant(), np.atleast_2d(np.asarray(values, dtype=np.float64)))


@dataclass(frozen=True)
class Planes:
    """Planes ``n.x = d`` that move: n and d as curves, d of dimension 1."""

    normals: SeparableCurve
    offsets: SeparableCurve

    def rulings(self, at: At[F]) -> F:
        """``n x n'``, along the rulings."""
        return at(self.normals, 0).cross(at(self.normals, 1))


@dataclass(frozen=True)
class Definition(abc.ABC):
    """A vector function that has a formula, but no finite sum of factors; its coefficients are off by the error."""

    error: float

    @abc.abstractmethod
    def taylor(self, t: Array, count: int) -> Taylor:
        """The function itself at flat parameters."""

    @abc.abstractmethod
    def _bound(self, curve: CurveOfTerms, spans: int) -> float:
        """Bound of the distance of a curve from it, on so many spans; infinite when these are too few."""

    @cached_property
    def polynomial(self) -> tuple[CurveOfTerms, float]:
        """A polynomial curve and its proved distance from the function.

        Raises
        ------
        Unresolved
            When there is none of degree 190 within rounding.
        """
        found = resolved(lambda count: (transform(count) @ self.taylor((nodes(count) + 1) / 2, 1).values).T)
        if found is None or found[1].shape[1] > MAX_COUNT:
            raise _unresolved("its polynomials do not come within rounding")
        scale = 2.0 ** math.ceil(math.log2(max(float(np.abs(found[1]).max()), 1e-300)))  # a power of two: exact
        curve = CurveOfTerms(Polynomials(found[1] / scale), scale * np.eye(3))
        bound = proved_bound(partial(self._bound, curve))
        if not bound <= _WORST * scale:
            raise _unresolved(f"its polynomials are not proved to come closer than {bound:.3g}")
        return curve, bound

    def _at(self, spans: int) -> At[Spanned]:
        def spanned(curve: SeparableCurve, order: int) -> Spanned:
            return Spanned.of(curve, order, spans, self.error)

        return spanned


def _unresolved(reason: str) -> Unresolved:
    return Unresolved(
        f"the patch needs polynomials of a degree above {MAX_COUNT - 1}: {reason}; it is nearly singular somewhere, or "
        "winds too much for one piece: make it of parts"
    )


@dataclass(frozen=True)
class Cut(Definition):
    """The points of rulings on other planes ``m.x = e``, from ``n.x = d``, ``n'.x = d'`` and that.

    Attributes
    ----------
    other
        Planes that have m and e; a curve whose nearest points are meant (m along the ruling); None for the edge of
        regression (m = n'').
    """

    planes: Planes
    other: Planes | SeparableCurve | None

    def _equations(self, at: At[F]) -> tuple[tuple[F, F, F], tuple[F, F, F]]:
        """The rows n, n', m and the right sides d, d', e."""
        n, slope = (at(self.planes.normals, order) for order in (0, 1))
        d, rate = (at(self.planes.offsets, order) for order in (0, 1))
        if isinstance(self.other, Planes):
            m, e = at(self.other.normals, 0), at(self.other.offsets, 0)
        elif self.other is None:
            m, e = at(self.planes.normals, 2), at(self.planes.offsets, 2)
        else:
            m = n.cross(slope)
            e = m.dot(at(self.other, 0))
        return (n, slope, m), (d, rate, e)

    def parts(self, at: At[F]) -> tuple[F, F]:
        """Numerator ``d (n' x m) + d' (m x n) + e (n x n')`` and determinant ``(n x n').m``."""
        rows, right = self._equations(at)
        return _numerator(rows, right), rows[0].cross(rows[1]).dot(rows[2])

    def determinant(self, t: Array) -> Array:
        """``(n x n').m`` at flat parameters."""
        return self.parts(Taylor.at(t, 1))[1].terms[0, :, 0]

    def taylor(self, t: Array, count: int) -> Taylor:
        """The points; a second solution, for the residuals of the first, keeps them in both planes."""
        rows, right = self._equations(Taylor.at(t, count))
        determinant = rows[0].cross(rows[1]).dot(rows[2])
        first = _numerator(rows, right).over(determinant)
        (n, slope, m), (d, rate, e) = rows, right
        missed = d - n.dot(first), rate - slope.dot(first), e - m.dot(first)
        return first + _numerator(rows, missed).over(determinant)

    def _bound(self, curve: CurveOfTerms, spans: int) -> float:
        at = self._at(spans)
        numerator, determinant = self.parts(at)
        least = np.sqrt(determinant.times(determinant).least())
        if not least.all():
            return math.inf
        return (at(curve, 0).times(determinant) - numerator).largest(least)


def _numerator(rows: tuple[F, F, F], right: tuple[F, F, F]) -> F:
    """By Cramer's rule."""
    (n, slope, m), (d, rate, e) = rows, right
    return slope.cross(m).times(d) + m.cross(n).times(rate) + n.cross(slope).times(e)


@dataclass(frozen=True)
class Direction(Definition):
    """The unit vectors along vectors f that do not vanish."""

    @abc.abstractmethod
    def field(self, at: At[F]) -> F:
        """The f."""

    def taylor(self, t: Array, count: int) -> Taylor:
        """The unit vectors."""
        return self.field(Taylor.at(t, count)).unit()

    def _bound(self, curve: CurveOfTerms, spans: int) -> float:
        """From ``p x f`` and ``|p|^2 - 1``."""
        vector, field = Spanned.of(curve, 0, spans), self.field(self._at(spans))
        least = field.dot(field).least()
        if not least.all():
            return math.inf
        lean = vector.cross(field).largest(np.sqrt(least))
        stretch = vector.dot(vector).plus(-1.0).largest()
        return math.hypot(lean, stretch + lean**2)


@dataclass(frozen=True)
class RulingDirection(Direction):
    """Along the rulings ``n x n'`` of planes."""

    planes: Planes

    def field(self, at: At[F]) -> F:
        """``n x n'``."""
        return self.planes.rulings(at)


@dataclass(frozen=True)
class TangentDirection(Direction):
    """Along the tangents of a curve."""

    curve: SeparableCurve

    def field(self, at: At[F]) -> F:
        """``C'``."""
        return at(self.curve, 1)


@dataclass(frozen=True)
class DarbouxDirection(Direction):
    """Along ``torsion T + curvature B`` of a curve: the rulings of its rectifying developable."""

    curve: SeparableCurve

    def field(self, at: At[F]) -> F:
        """``|w|^2 w + (w.C''') |C'|^2 C'`` with ``w = C' x C''``."""
        first, second, third = (at(self.curve, order) for order in (1, 2, 3))
        across = first.cross(second)
        return across.times(across.dot(across)) + first.times(across.dot(third).times(first.dot(first)))


@dataclass(frozen=True)
class Edge:
    """A boundary of a patch: a curve or points by definition, moved by a distance along rulings.

    Attributes
    ----------
    base
        What it is when the distance is 0.
    along, distance
        The direction of the rulings, if any, and how far.
    """

    base: SeparableCurve | Definition
    along: Direction | None = None
    distance: float = 0.0

    def taylor(self, t: Array, count: int) -> Taylor:
        """The boundary by definition."""
        base = self.base
        whole = base.taylor(t, count) if isinstance(base, Definition) else Taylor.at(t, count)(base, 0)
        if self.along is None:
            return whole
        return Taylor(whole.terms + self.distance * self.along.taylor(t, count).terms)

    @property
    def curve(self) -> tuple[SeparableCurve, float]:
        """The boundary as a sum of terms, and its proved distance from the definition."""
        curve, error = self.base.polynomial if isinstance(self.base, Definition) else (self.base, 0.0)
        if self.along is None:
            return curve, error
        direction, bound = self.along.polynomial
        coefficients = np.concatenate([curve.coefficients, self.distance * direction.coefficients])
        return CurveOfTerms(Stacked((curve.factors, direction.factors)), coefficients), error + abs(
            self.distance
        ) * bound


def centred(curve: SeparableCurve) -> tuple[SeparableCurve, float]:
    """A curve near the origin, where its derivatives have the least rounding, and the error of its coefficients."""
    center = curve.evaluate(0.5)
    error = 4 * UNIT_ROUNDOFF * (largest_norm(curve.coefficients) + float(np.linalg.norm(center)))
    return curve.transformed(np.eye(3), -center), error
