"""Where the curvature of a curve or a chain is largest, least, or 0: all places of the whole curve.

They are zeros of functions of the derivatives (``gtcad.roots``): accurate to rounding; that none is missed is judged by
the decay of Chebyshev coefficients, not proved.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad._jets import norm, space
from gtcad.composite import Composite
from gtcad.differential import curvature, signed_curvature
from gtcad.protocol import SeparableCurve
from gtcad.queries import SAMPLES, is_closed, pieces_of, signs_beside
from gtcad.roots import roots

Array = NDArray[np.float64]

_SLOPE_NOISE = 1e-11  # of functions that were divided by their size: slow parts of a curve have fewer digits
_APART = 1e-6  # stations of the curvature that are closer than this in the parameter are one
_JUMP = 1e-6  # relative: curvatures at a joint that differ by more have no extreme there
_BESIDE = 1e-4  # how far from a cusp the side it turns to is looked up


@dataclass(frozen=True)
class Extreme:
    """A station of the curvature.

    Attributes
    ----------
    parameter
        Where it is.
    kind
        "maximum" or "minimum" of the curvature's absolute value; "inflection" where a plane curve turns from one side
        to the other.
    curvature
        In the inverse of the unit: signed (positive to the left) for plane curves, from 0 for curves in space.
    """

    parameter: float
    kind: Literal["minimum", "maximum", "inflection"]
    curvature: float


class Bending(Protocol):
    """What has derivatives on [0, 1]."""

    @property
    def dimension(self) -> int:
        """Space dimension d."""
        ...

    def derivative(self, t: ArrayLike, order: int = 1) -> Array:
        """Derivatives of the order, 0 the point, shape t.shape + (d,)."""
        ...


def curvature_extremes(curve: SeparableCurve | Composite) -> tuple[Extreme, ...]:
    """Where the curvature of a curve is stationary, and where a plane curve inflects, in order.

    With ``X = C' x C''`` the zeros of ``(X . C' x C''') |C'|^2 - 3 |X|^2 (C'.C'')`` at which it changes sign, and of a
    plane curve those of X. Ends of an open curve are left out, so are cusps, and joints where the curvature jumps.

    Parameters
    ----------
    curve
        Any curve or chain; a chain is looked at across its joints.

    Notes
    -----
    Stations that are within 1e-6 of each other in the parameter, or of an end, are one. A piece that turns by less than
    about 1e-5 radians in all has too few digits to show any. Cost of a piece: 10 ms at degree 3, 80 at 20, 300 at 60.

    Examples
    --------
    A parabola bends most at its vertex, by 2 a of y = a x^2:

    >>> from gtcad import BERNSTEIN, Curve
    >>> parabola = Curve([[-1, 1], [0, -1], [1, 1]], family=BERNSTEIN)
    >>> [(round(x.parameter, 9), x.kind, round(x.curvature, 9)) for x in curvature_extremes(parabola)]
    [(0.5, 'maximum', 2.0)]
    """
    return extremes_along(pieces_of(curve), closed=is_closed(curve))


def extremes_along(pieces: Sequence[Bending], *, closed: bool = False) -> tuple[Extreme, ...]:
    """The same of pieces over [0, 1], [1, 2], ... that are anything with derivatives, such as spans of a spline."""
    bends = [_Bend(piece) for piece in pieces]
    joints = np.arange(0.0 if closed else 1.0, len(bends))
    last = float(len(bends))
    inner = [start + roots(f, noise=_SLOPE_NOISE) for start, bend in enumerate(bends) for f in bend.functions]
    t = _stations(np.concatenate([joints, *inner]), joints, last)
    if not t.size:
        return ()
    growth = signs_beside(t, last, closed, lambda s: _by_piece(s, [bend.growth for bend in bends]))
    turn = signs_beside(t, last, closed, lambda s: _by_piece(s, [bend.turn for bend in bends]))
    result = []
    for k, place in enumerate(t.tolist()):
        value = _curvature_at(bends, place)
        if not math.isfinite(value):
            continue
        if turn[0][k] * turn[1][k] < 0:
            result.append(Extreme(place, "inflection", 0.0))
        elif growth[0][k] * growth[1][k] < 0:
            result.append(Extreme(place, "maximum" if growth[0][k] > 0 else "minimum", value))
    return tuple(result)


def curvature_range(curve: SeparableCurve | Composite) -> tuple[float, float]:
    """Least and largest signed curvature of a plane curve, ends and joints included; infinite at cusps.

    Raises
    ------
    InputError
        When the curve is not plane (d = 2).

    Examples
    --------
    An ellipse with the semi-axes 3 and 2, run to the left: a / b^2 and b / a^2.

    >>> from gtcad import Curve
    >>> [round(x, 9) for x in curvature_range(Curve([[3, 0], [3, 2], [0, 2]]))]
    [0.222222222, 0.75]
    """
    values = []
    for piece in pieces_of(curve):
        bend = _Bend(piece)
        stations = np.concatenate([[0.0], roots(bend.rate, noise=_SLOPE_NOISE), [1.0]])
        found = signed_curvature(piece, stations)
        cusps = np.isnan(found)
        found[cusps] = np.copysign(np.inf, bend.bend(np.clip(stations[cusps], _BESIDE, 1 - _BESIDE)))
        values.append(found)
    every = np.concatenate(values)
    return float(every.min()), float(every.max())


class _Bend:
    """Functions of one piece whose zeros and signs tell how its curvature changes, free of units and of the speed."""

    def __init__(self, piece: Bending) -> None:
        self.piece = piece
        self.tiny = (1e-14 * float(norm(piece.derivative(SAMPLES)).max())) ** 2 + np.finfo(float).tiny

    @property
    def functions(self) -> tuple[Callable[[Array], Array], ...]:
        """Those whose zeros are stations."""
        return (self.rate, self.bend) if self.piece.dimension == 2 else (self.rate,)

    def bend(self, t: Array) -> Array:
        """Sign of the signed curvature of a plane curve."""
        first, second = (space(self.piece.derivative(t, order)) for order in (1, 2))
        speed = (first * first).sum(axis=1) + self.tiny
        return np.asarray(np.cross(first, second)[:, 2] / np.sqrt(speed * (speed + (second * second).sum(axis=1))))

    def rate(self, t: Array) -> Array:
        """Sign of d kappa / dt: of the signed curvature for plane curves."""
        first, second, third = (space(self.piece.derivative(t, order)) for order in (1, 2, 3))
        speed = (first * first).sum(axis=1) + self.tiny
        along = (first * second).sum(axis=1)
        bend, change = np.cross(first, second), np.cross(first, third)
        squared = (second * second).sum(axis=1)
        size = speed * np.sqrt(speed * (speed + (third * third).sum(axis=1)) + squared**2)
        if self.piece.dimension == 2:
            return np.asarray((change[:, 2] * speed - 3 * bend[:, 2] * along) / size)
        square = (bend * bend).sum(axis=1)
        return np.asarray(((bend * change).sum(axis=1) * speed - 3 * square * along) / (size * (speed + squared)))

    def growth(self, t: Array) -> Array:
        """Sign of d |kappa| / dt, 0 within the noise."""
        rate = self.rate(t)
        sign = np.where(np.abs(rate) <= _SLOPE_NOISE, 0.0, np.sign(rate))
        return sign * self.turn(t) if self.piece.dimension == 2 else sign

    def turn(self, t: Array) -> Array:
        """1 where a plane curve turns left, -1 where it turns right, 0 within the noise and in space."""
        if self.piece.dimension != 2:
            return np.zeros(t.size)
        bend = self.bend(t)
        return np.where(np.abs(bend) <= _SLOPE_NOISE, 0.0, np.sign(bend))

    def curvature(self, t: float) -> float:
        """Signed in the plane."""
        return float(signed_curvature(self.piece, t) if self.piece.dimension == 2 else curvature(self.piece, t))


def _curvature_at(bends: list[_Bend], t: float) -> float:
    """The curvature at a station, NaN at a joint where it jumps."""
    joint = round(t)
    if abs(t - joint) > 0:
        return bends[math.floor(t)].curvature(t - math.floor(t))
    before, after = bends[joint - 1].curvature(1.0), bends[joint].curvature(0.0)
    jump = abs(after - before) > _JUMP * max(abs(before), abs(after))
    return math.nan if jump else after


def _stations(t: Array, joints: Array, last: float) -> Array:
    """Ascending and apart, joints standing for what is near them; without the ends of an open curve."""
    fixed = np.concatenate([joints, [0.0, last]])
    inner = np.sort(t[np.abs(t[:, None] - fixed).min(axis=1) > _APART])
    return np.sort(np.concatenate([joints, inner[np.diff(inner, prepend=-1.0) > _APART]]))


def _by_piece(t: Array, functions: list[Callable[[Array], Array]]) -> Array:
    result = np.empty(t.size)
    places = np.minimum(t.astype(int), len(functions) - 1)
    for place in np.unique(places):
        here = places == place
        result[here] = functions[place](t[here] - place)
    return result
