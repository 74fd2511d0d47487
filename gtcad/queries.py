"""What is asked of a curve or a chain: nearest point, crossings with a plane, extremes of curvature, its two parts.

Every answer looks at the whole curve: the critical points are all zeros of a function (``gtcad.roots``), so there is
no start value, and nothing is missed but what is smaller than the rounding of derivatives. A chain is taken piece by
piece; its parameter runs over [0, pieces]. Figures are accurate to rounding; that no critical point is missed is
judged by the decay of Chebyshev coefficients, not proved.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad._jets import norm, space
from gtcad.chebyshev import UNIT_ROUNDOFF, nodes
from gtcad.composite import Composite
from gtcad.differential import curvature, signed_curvature
from gtcad.errors import InputError
from gtcad.protocol import SeparableCurve
from gtcad.restricted import RestrictedCurve
from gtcad.roots import roots

Array = NDArray[np.float64]

SAMPLES = np.concatenate([[0.0], (nodes(64) + 1) / 2, [1.0]])  # where the size of a function is taken
SAMPLES.flags.writeable = False

_NOISE = 256 * UNIT_ROUNDOFF  # of derivatives, relative to their largest value on the curve
_SLOPE_NOISE = 1e-11  # of functions that were divided by their size: slow parts of a curve have fewer digits
_APART = 1e-6  # stations of the curvature that are closer than this in the parameter are one
_JUMP = 1e-6  # relative: curvatures at a joint that differ by more have no extreme there
_BESIDE = 1e-4  # how far from a cusp the side it turns to is looked up
_LEAST_PART = 1e-9  # as in gtcad.protocol.domain_part


@dataclass(frozen=True, eq=False)
class Foot:
    """The nearest point of a curve.

    Attributes
    ----------
    parameter
        Where it is, the least one when several points are equally near.
    point
        Shape (d,).
    distance
        From the given point, in the model's unit.
    """

    parameter: float
    point: Array
    distance: float


@dataclass(frozen=True, eq=False)
class Crossing:
    """A point where a curve meets a plane, or a plane curve a line.

    Attributes
    ----------
    parameter
        Where it is.
    point
        Shape (d,).
    touches
        Whether the curve stays on one side of the plane there; False where it passes through, and at open ends.
    """

    parameter: float
    point: Array
    touches: bool


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


def nearest(curve: SeparableCurve | Composite, point: ArrayLike) -> Foot:
    """The nearest point of a whole curve: the least of all critical points of ``|C - p|``, the ends and the joints.

    Parameters
    ----------
    curve
        Any curve or chain.
    point
        p, shape (d,), in the model's unit.

    Raises
    ------
    InputError
        When the point is not d finite numbers.

    Notes
    -----
    Distances that differ by rounding alone count as equal. Cost of a piece: 1 ms at degree 3, 20 at 60.

    Examples
    --------
    Of a quarter circle; from its centre all its points are equally near, so the first is taken:

    >>> from gtcad import Curve
    >>> quarter = Curve([[1, 0], [1, 1], [0, 1]])
    >>> round(nearest(quarter, (3, 3)).parameter, 9), round(nearest(quarter, (3, 3)).distance, 9)
    (0.5, 3.242640687)
    >>> nearest(quarter, (0, 0)).parameter
    0.0
    """
    target = _vector("point", point, curve.dimension)
    size, places = 0.0, []
    for start, piece in enumerate(pieces_of(curve)):
        reach = float(norm(piece.coefficients).max() + norm(target))
        size = max(size, reach)
        speed = float(norm(piece.derivative(SAMPLES)).max())
        critical = roots(_approach(piece, target), noise=_NOISE * reach * speed)
        places.append(start + np.concatenate([[0.0], critical, [1.0]]))
    t = np.concatenate(places)
    points = curve.evaluate(t)
    distances = norm(points - target)
    best = int(np.flatnonzero(distances <= distances.min() + 4 * UNIT_ROUNDOFF * size)[0])
    return Foot(float(t[best]), points[best], float(distances[best]))


def intersect_plane(curve: SeparableCurve | Composite, point: ArrayLike, normal: ArrayLike) -> tuple[Crossing, ...]:
    """All points where a curve meets a plane, in the order of their parameters.

    Parameters
    ----------
    curve
        Any curve or chain.
    point, normal
        Of the plane, shape (d,); the normal of any length. A plane curve (d = 2) is met with a line.

    Raises
    ------
    InputError
        When the curve, or a piece of the chain, lies in the plane; when an argument is not d finite numbers, or the
        normal vanishes.

    Notes
    -----
    What is nearer to the plane than the rounding of the curve's points (about 1e-14 of their size) touches it.

    Examples
    --------
    A half circle and the line y = 1/2, then the line y = 1:

    >>> from gtcad import Composite, Curve
    >>> half = Composite((Curve([[1, 0], [1, 1], [0, 1]]), Curve([[0, 1], [-1, 1], [-1, 0]])), ("G2",))
    >>> [crossing.point.round(6).tolist() for crossing in intersect_plane(half, (0, 0.5), (0, 1))]
    [[0.866025, 0.5], [-0.866025, 0.5]]
    >>> [(crossing.parameter, crossing.touches) for crossing in intersect_plane(half, (0, 1), (0, 1))]
    [(1.0, True)]
    """
    base = _vector("point", point, curve.dimension)
    across = _vector("normal", normal, curve.dimension)
    length = float(norm(across))
    if not length > 0:
        raise InputError(f"normal must not vanish, got {across.tolist()}")
    across = across / length
    met = []
    for start, piece in enumerate(pieces_of(curve)):
        noise = _height_noise(piece, base)
        height = _height(piece, base, across)
        if np.abs(height(SAMPLES)).max() <= noise:
            raise InputError(f"{_named(curve, start)} lies in the plane")
        met.append(start + roots(height, noise=noise))
    t = _joined(np.concatenate(met), curve)
    last = curve.domain[1]
    before, after = _sides(t, last, _is_closed(curve), lambda s: np.sign((curve.evaluate(s) - base) @ across))
    points = curve.evaluate(t)
    return tuple(Crossing(float(t[k]), points[k], bool(before[k] * after[k] > 0)) for k in range(t.size))


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
    return extremes_along(pieces_of(curve), closed=_is_closed(curve))


def extremes_along(pieces: Sequence[Bending], *, closed: bool = False) -> tuple[Extreme, ...]:
    """The same of pieces over [0, 1], [1, 2], ... that are anything with derivatives, such as spans of a spline."""
    bends = [_Bend(piece) for piece in pieces]
    joints = np.arange(0.0 if closed else 1.0, len(bends))
    last = float(len(bends))
    inner = [start + roots(f, noise=_SLOPE_NOISE) for start, bend in enumerate(bends) for f in bend.functions]
    t = _stations(np.concatenate([joints, *inner]), joints, last)
    if not t.size:
        return ()
    growth = _sides(t, last, closed, lambda s: _by_piece(s, [bend.growth for bend in bends]))
    turn = _sides(t, last, closed, lambda s: _by_piece(s, [bend.turn for bend in bends]))
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


@overload
def split(curve: SeparableCurve, t: float) -> tuple[RestrictedCurve, RestrictedCurve]: ...
@overload
def split(curve: Composite, t: float) -> tuple[Composite, Composite]: ...
def split(
    curve: SeparableCurve | Composite, t: float
) -> tuple[RestrictedCurve, RestrictedCurve] | tuple[Composite, Composite]:
    """The parts before and after a parameter, exactly: the same functions on parts of their domain.

    Parameters
    ----------
    curve
        Any curve or chain. A chain gives two open chains that keep the orders of their joints, a closed one those
        between its start and t.
    t
        Inside the domain, at least 1e-9 from its ends. Within 1e-9 of a joint it is the joint, and no piece is cut.

    Raises
    ------
    InputError
        When t is at an end or outside.

    Examples
    --------
    >>> from gtcad import Curve
    >>> before, after = split(Curve([[1, 0], [1, 1], [0, 1]]), 0.5)
    >>> before.evaluate(1.0).round(6).tolist(), after.evaluate(0.0).round(6).tolist()
    ([0.707107, 0.707107], [0.707107, 0.707107])
    """
    last = curve.domain[1]
    try:
        place = float(t)
    except (TypeError, ValueError):
        raise InputError(f"t must be a number inside (0, {last:g}), got {t!r}") from None
    if not _LEAST_PART <= place <= last - _LEAST_PART:
        raise InputError(f"t must lie inside (0, {last:g}), {_LEAST_PART:g} from its ends at least, got {place}")
    if not isinstance(curve, Composite):
        return RestrictedCurve(curve, (0.0, place)), RestrictedCurve(curve, (place, 1.0))
    pieces, orders = curve.pieces, curve.orders
    joint = round(place)
    if abs(place - joint) < _LEAST_PART:
        return (
            Composite(pieces[:joint], orders[: joint - 1]),
            Composite(pieces[joint:], orders[joint : len(pieces) - 1]),
        )
    cut = math.floor(place)
    before, after = split(pieces[cut], place - cut)
    return (
        Composite((*pieces[:cut], before), orders[:cut]),
        Composite((after, *pieces[cut + 1 :]), orders[cut : len(pieces) - 1]),
    )


def pieces_of(curve: SeparableCurve | Composite) -> tuple[SeparableCurve, ...]:
    """The pieces of a chain; a curve alone is its own."""
    return curve.pieces if isinstance(curve, Composite) else (curve,)


def _is_closed(curve: SeparableCurve | Composite) -> bool:
    return isinstance(curve, Composite) and curve.closed


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


def _sides(t: Array, last: float, closed: bool, sign: Callable[[Array], Array]) -> tuple[Array, Array]:
    """Signs half way to the station before and after each one, 0 beyond the ends of an open curve."""
    edges = np.concatenate([[0.0], t, [last]])
    if closed and t.size:
        edges[0], edges[-1] = t[-1] - last, t[0] + last
    half = (edges[:-1] + edges[1:]) / 2
    signs = sign(np.mod(half, last) if closed else half)
    signs = np.where(np.diff(edges) > 0, signs, 0.0)
    return signs[:-1], signs[1:]


def _joined(t: Array, curve: SeparableCurve | Composite) -> Array:
    """Ascending parameters with one for each joint; the end of a closed chain is its start."""
    whole = np.round(t)
    t = np.where(np.abs(t - whole) <= _LEAST_PART, whole, t) if isinstance(curve, Composite) else t
    if _is_closed(curve):
        t = np.where(t == curve.domain[1], 0.0, t)
    return np.unique(t)


def _approach(piece: SeparableCurve, target: Array) -> Callable[[Array], Array]:
    """Half the derivative of ``|C - p|^2``."""
    return lambda t: np.asarray(((piece.evaluate(t) - target) * piece.derivative(t)).sum(axis=1))


def _height(piece: SeparableCurve, base: Array, across: Array) -> Callable[[Array], Array]:
    return lambda t: np.asarray((piece.evaluate(t) - base) @ across)


def _height_noise(piece: SeparableCurve, base: Array) -> float:
    """Rounding of the curve's points and of the product with the normal."""
    units = piece.factors.rounding + (piece.factors.count + 8) * UNIT_ROUNDOFF
    return units * float(norm(piece.coefficients).max() + norm(base))


def _named(curve: SeparableCurve | Composite, place: int) -> str:
    return f"piece {place}" if isinstance(curve, Composite) else "the curve"


def _vector(name: str, value: ArrayLike, dimension: int) -> Array:
    try:
        vector = np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} must be {dimension} numbers: {error}") from None
    if vector.shape != (dimension,) or not np.isfinite(vector).all():
        raise InputError(f"{name} must be {dimension} finite numbers, got {vector.tolist()}")
    return vector
