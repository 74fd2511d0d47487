"""The rulings of a patch, and the quadratures that unroll them.

With the boundaries a and b, c = b - a, m = (a' + b') / 2, r = c / |c|, n = m x c / |m x c| (turned over where the
rulings run in u), e = n x r, all functions of the parameter t that the rulings follow each other in, the frame in the
plane turns by ``theta' = r' . e`` and both boundaries go by ``A' = (a' . r) (cos theta, sin theta) + (a' . e)
(-sin theta, cos theta)``, B' likewise. So ``B - A = |c| (cos theta, sin theta)``, and of the first fundamental form
only n . S_t is lost: 0 in the middle of each ruling, and everywhere on a developable.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.polynomial.chebyshev import chebint, chebval
from numpy.typing import NDArray

from gtcad.chebyshev import gauss_legendre, nodes, transform
from gtcad.errors import InputError, NotDevelopable
from gtcad.flat_curves import LEAST_WIDTH, polynomial_curve
from gtcad.patches.ruled import Ruled
from gtcad.polynomial import MAX_COUNT, resolved
from gtcad.protocol import SeparableSurface
from gtcad.roots import roots

Array = NDArray[np.float64]
_Vectors = Callable[[Array, int], Array]

_VANISHES = 1e-12  # of the largest value: a vector as short as this is 0
_SAMPLES = 257
_HALVINGS = 48
_TURNED = 1e-6  # of its size beside: a vector as short, found by bisection, is 0
_FOLDED = 1e-10  # of the largest speed: what runs back by less is rounding
_QUOTIENT = 100  # nodes of the quadrature of a vector over its distance from a zero


@dataclass(frozen=True)
class Frame:
    """A patch along its rulings at flat parameters: vectors of shape (t.size, 3), numbers (t.size,).

    Attributes
    ----------
    a1, b1, length
        The derivatives of the boundaries, and the length of the ruling.
    r, n, e
        The moving frame.
    turn, bend
        theta', and n' . e.
    """

    a1: Array
    b1: Array
    length: Array
    r: Array
    n: Array
    e: Array
    turn: Array
    bend: Array

    @property
    def tilts(self) -> tuple[Array, Array]:
        """Angles in radians, modulo half a turn, of the tangent planes at both boundaries against that in the middle.

        0 where a boundary has no direction across the ruling.
        """
        return self._tilt(self.a1), self._tilt(self.b1)

    def _tilt(self, derivative: Array) -> Array:
        across, out = _dot(derivative, self.e), _dot(derivative, self.n)
        size = max(float(np.linalg.norm(vector, axis=1).max()) for vector in (self.a1, self.b1))
        still = np.hypot(across, out) <= _VANISHES * size
        return np.where(still, 0.0, np.arctan2(out * np.sign(across), np.abs(across)))


class Rulings:
    """The straight lines of a patch that is linear in v, or in u.

    Parameters
    ----------
    patch
        In the plane or in space.
    in_u
        Whether the lines in u are meant where the patch is linear in both.

    Raises
    ------
    NotDevelopable
        When the patch is linear in neither.
    """

    def __init__(self, patch: SeparableSurface, *, in_u: bool = False) -> None:
        if patch.dimension not in (2, 3):
            raise InputError(f"a patch must be in the plane or in space, got dimension {patch.dimension}")
        self.patch = patch
        straight = straight_in(patch)
        if not straight:
            raise NotDevelopable("the patch is straight in neither parameter: only ruled patches can be unrolled")
        self.along_v = straight == "v" or (straight == "uv" and not in_u)

    @property
    def across(self) -> str:
        """The parameter that the rulings follow each other in."""
        return "u" if self.along_v else "v"

    def edges(self, t: Array, order: int) -> tuple[Array, Array]:
        """Derivatives of the boundaries a and b, each of shape (t.size, 3)."""
        ends = np.array([0.0, 1.0])
        if self.along_v:
            both = self.patch.derivative(t[:, None], ends[None, :], (order, 0)).swapaxes(0, 1)
        else:
            both = self.patch.derivative(ends[:, None], t[None, :], (0, order))
        a, b = np.pad(both, [(0, 0), (0, 0), (0, 3 - both.shape[-1])])
        return a, b

    def ruling(self, t: Array, order: int) -> Array:
        """Derivatives of c."""
        a, b = self.edges(t, order)
        return b - a

    def middle(self, t: Array, order: int) -> Array:
        """Derivatives of m."""
        a, b = self.edges(t, order + 1)
        return (a + b) / 2

    def breaks(self) -> list[float]:
        """[0, 1], or both halves of it where vectors vanish at both ends.

        Raises
        ------
        NotDevelopable
            When a ruling vanishes between the ends, or has no tangent plane.
        """
        for what, vectors in (
            ("ruling has no length", self.ruling),
            ("line through the middles is still", self.middle),
        ):
            place = _zero_inside(vectors)
            if place is not None:
                raise NotDevelopable(f"{what} at {self.across} = {place:.6g}", parameter=place)
        return [0.0, 0.5, 1.0] if len({end for _, end in self._zeros}) == 2 else [0.0, 1.0]

    @cached_property
    def _zeros(self) -> set[tuple[str, float]]:
        """Which vectors vanish at which end of [0, 1], by name."""
        found = set()
        for vectors in (self.ruling, self.middle):
            sizes = np.linalg.norm(vectors(np.array([0.0, 0.25, 0.5, 0.75, 1.0]), 0), axis=1)
            found |= {(vectors.__name__, end) for end in (0.0, 1.0) if sizes[int(4 * end)] <= _VANISHES * sizes.max()}
        return found

    def frame(self, t: Array, start: float, end: float) -> Frame:
        """The moving frame at parameters inside a span of which one end at most is singular."""
        a1, b1 = self.edges(t, 1)
        c, c1 = self._without_zero(self.ruling, t, start, end)
        m, m1 = self._without_zero(self.middle, t, start, end)
        if not self.along_v:
            m, m1 = -m, -m1
        size, across = np.linalg.norm(c, axis=1), np.cross(m, c)
        lean = np.linalg.norm(across, axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            r, n = c / size[:, None], across / lean[:, None]
            e = np.cross(n, r)
            turn = _dot(e, c1) / size
            bend = _dot(e, np.cross(m1, c) + np.cross(m, c1)) / lean
        length = np.linalg.norm(self.ruling(t, 0), axis=1)
        return Frame(a1, b1, length, r, n, e, turn, bend)

    def _without_zero(self, vectors: _Vectors, t: Array, start: float, end: float) -> tuple[Array, Array]:
        """A vector and its derivative, divided by the distance from the end of [0, 1] where it vanishes."""
        for anchor, sign in ((0.0, 1.0), (1.0, -1.0)):
            if anchor in (start, end) and (vectors.__name__, anchor) in self._zeros:
                z, weights = gauss_legendre(_QUOTIENT)
                x, weights = (z + 1) / 2, sign * weights / 2
                places = np.clip(anchor + x * (t[:, None] - anchor), 0.0, 1.0).reshape(-1)
                shape = (t.size, _QUOTIENT, 3)
                first, second = (vectors(places, order).reshape(shape) for order in (1, 2))
                return np.einsum("k,tkd->td", weights, first), np.einsum("k,tkd->td", weights * x, second)
        return vectors(t, 0), vectors(t, 1)


def _zero_inside(vectors: _Vectors) -> float | None:
    """Where vectors vanish between the ends, at a sample, or between two samples and turn back there; or None."""
    t = np.union1d(np.linspace(0.0, 1.0, _SAMPLES), (nodes(_SAMPLES) + 1) / 2)  # the latter are dense at the ends
    values = vectors(t, 0)
    sizes = np.linalg.norm(values, axis=1)
    level = _VANISHES * float(sizes.max())
    inside = np.flatnonzero(sizes[1:-1] <= level) + 1
    places = [float(t[inside[0]])] if inside.size else []
    back = (_dot(values[1:], values[:-1]) < 0) & (sizes[1:] > level) & (sizes[:-1] > level)
    for k in np.flatnonzero(back):
        low, high, along = t[k], t[k + 1], values[k + 1] - values[k]
        for _ in range(_HALVINGS):
            middle = (low + high) / 2
            low, high = (middle, high) if vectors(np.array([middle]), 0)[0] @ along < 0 else (low, middle)
        if np.linalg.norm(vectors(np.array([high]), 0)[0]) <= _TURNED * sizes[k : k + 2].max():
            places.append(float(high))
    return min(places, default=None)


def _dot(a: Array, b: Array) -> Array:
    return np.asarray(np.einsum("td,td->t", a, b))


def straight_in(patch: SeparableSurface) -> str:
    """The parameters that a patch is linear in: "", "u", "v" or "uv"."""
    return "".join(name for direction, name in enumerate("uv") if _linear(patch, direction))


def _linear(patch: SeparableSurface, direction: int) -> bool:
    """Whether a patch is of degree 1 in u (0) or v (1)."""
    factors = (patch.factors_u, patch.factors_v)[direction]
    if factors.derivative_bound(2) == 0:
        return True
    t = (nodes(9) + 1) / 2
    second = np.moveaxis(patch.coefficients, direction, 0)
    curved = np.abs(np.tensordot(factors.rows(t, 2).T, second, 1)).max()
    return bool(curved <= 1e-13 * np.abs(np.tensordot(factors.rows(t, 1).T, second, 1)).max())


@dataclass(frozen=True)
class Twist:
    """The largest angle between the tangent planes at the two ends of a ruling, and where it was found."""

    degrees: float
    parameter: float


def largest_twist(rulings: Rulings, breaks: list[float]) -> Twist:
    """The largest of samples."""
    found = Twist(0.0, 0.0)
    for start, end in pairwise(breaks):
        t = (start + end) / 2 + (end - start) / 2 * nodes(129)
        tilt_a, tilt_b = rulings.frame(t, start, end).tilts
        twists = np.degrees(np.abs(tilt_a - tilt_b))
        twists = np.minimum(twists, 180.0 - twists)
        worst = int(twists.argmax()) if np.isfinite(twists).all() else int(np.flatnonzero(~np.isfinite(twists))[0])
        if not twists[worst] <= found.degrees:
            found = Twist(float(twists[worst]), float(t[worst]))
    return found


def check_regular(rulings: Rulings, breaks: list[float]) -> None:
    """See that the patch does not fold back over an edge of regression.

    Raises
    ------
    NotDevelopable
        When it does, with the parameter.
    """
    for start, end in pairwise(breaks):
        t = (start + end) / 2 + (end - start) / 2 * nodes(_SAMPLES)
        sides = _across(rulings, t, start, end)
        level = _FOLDED * float(np.abs(sides).max())
        for side, signed in enumerate(sides):
            if signed.min() < -level:
                place = _first_zero(lambda x, k=side, a=start, b=end: _across(rulings, x, a, b)[k], t, signed, level)  # type: ignore[misc]
                raise NotDevelopable(
                    f"the patch is crossed by its edge of regression, which leaves it over boundary {'ab'[side]} at "
                    f"{rulings.across} = {place:.9g}",
                    parameter=place,
                )


def _first_zero(function: Callable[[Array], Array], t: Array, values: Array, level: float) -> float:
    """The first place where a function that is negative somewhere changes its sign; its start where it does nowhere."""
    try:
        zeros = roots(function, breaks=(t[0], t[-1]), noise=level)
    except InputError:
        zeros = np.zeros(0)
    return float(zeros[0]) if zeros.size else float(t[values < -level][0])


def _across(rulings: Rulings, t: Array, start: float, end: float) -> tuple[Array, Array]:
    """How fast both boundaries go across the rulings, in the sense of the middle."""
    frame = rulings.frame(t, start, end)
    sign = -1.0 if rulings.along_v else 1.0
    return sign * _dot(frame.a1, frame.e), sign * _dot(frame.b1, frame.e)


@dataclass(frozen=True)
class Span:
    """A part of a patch in the plane: ``P(t, s) = (1 - s) A(t) + s B(t)`` as a ruled patch over [0, 1].

    Attributes
    ----------
    start, end
        Of the patch's parameter.
    flat
        The part, a ruled patch of the plane.
    bend
        Chebyshev series on [0, 1] of the angle that the normal turns by, from 0 at the start, in radians.
    """

    start: float
    end: float
    flat: Ruled
    bend: Array


def unrolled(rulings: Rulings, breaks: list[float]) -> tuple[tuple[Span, ...], float]:
    """The patch in the plane, and the estimated error of its points in the model's unit.

    Raises
    ------
    NotDevelopable
        When the quadratures are not resolved: the patch has a singular ruling.
    """
    spans: list[Span] = []
    angle = math.pi / 2 if rulings.along_v else 0.0
    corner, error = np.zeros(2), 0.0
    left = list(pairwise(breaks))[::-1]
    while left:
        start, end = left.pop()
        integral = _Integral(rulings, start, end)
        found = resolved(integral.series)
        if found is None or found[1].shape[1] >= MAX_COUNT:
            if end - start < 2 * LEAST_WIDTH:
                raise NotDevelopable(
                    f"a ruling is singular near {rulings.across} = {start:.6g}: its tangent plane turns too fast there",
                    parameter=start,
                )
            middle = (start + end) / 2
            left += [(middle, end), (start, middle)]
            continue
        turned = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
        a, b = (integral.walked(turned @ found[1][rows]) for rows in ([0, 1], [2, 3]))
        a[:, 0] += corner
        b[:, 0] += corner + integral.length * turned[:, 0]
        bend = integral.walked(found[1][5:6] / integral.scale)[0]
        spans.append(Span(start, end, Ruled(polynomial_curve(a), polynomial_curve(b)), bend))
        turning = integral.walked(found[1][4:5] / integral.scale)[0]
        angle += float(chebval(1.0, turning))
        corner = np.asarray(chebval(1.0, a.T))
        error += integral.error(found[0])
    return tuple(spans), error


class _Integral:
    """The integrands of a span."""

    def __init__(self, rulings: Rulings, start: float, end: float) -> None:
        self.rulings, self.start, self.end = rulings, start, end
        self.length = float(np.linalg.norm(rulings.ruling(np.array([start]), 0)[0]))
        a, b = rulings.edges(np.linspace(start, end, 33), 0)
        self.scale = float(np.linalg.norm(np.ptp(np.concatenate([a, b]), axis=0)))  # makes lengths of the angles

    def series(self, count: int) -> Array:
        """Chebyshev series of A', B', and of theta' and the bending by the scale, shape (6, count)."""
        t = (self.start + self.end) / 2 + (self.end - self.start) / 2 * nodes(count)
        frame = self.rulings.frame(t, self.start, self.end)
        angles = self.walked((transform(count) @ frame.turn)[None])[0]
        theta = chebval(nodes(count), angles)
        along, across = np.stack([np.cos(theta), np.sin(theta)]), np.stack([-np.sin(theta), np.cos(theta)])
        steps = [_dot(d, frame.r) * along + _dot(d, frame.e) * across for d in (frame.a1, frame.b1)]
        values = np.concatenate([*steps, self.scale * np.stack([frame.turn, frame.bend])])
        if not np.isfinite(values).all():
            place = float(t[~np.isfinite(values).all(axis=0)][0])
            raise NotDevelopable(
                f"a ruling has no tangent plane at {self.rulings.across} = {place:.6g}", parameter=place
            )
        return values @ transform(count).T

    def walked(self, series: Array) -> Array:
        """The integrals from the start of the span of Chebyshev series on it, shape (rows, count + 1)."""
        return np.asarray(chebint(series, axis=1, lbnd=-1.0, scl=(self.end - self.start) / 2))

    def error(self, whole: Array) -> float:
        """What the last eighth of the series, and rounding like it all along, adds up to."""
        eighth = whole.shape[1] // 8
        last = np.linalg.norm(whole[:, -eighth:], axis=0)
        return float((self.end - self.start) * (last.sum() + last.max() * math.sqrt(whole.shape[1])))
