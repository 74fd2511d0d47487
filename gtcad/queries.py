"""What is asked of a curve or a chain: nearest point, crossings with a plane, its two parts.

Every answer looks at the whole curve: the critical points are all zeros of a function (``gtcad.roots``), so there is
no start value, and nothing is missed but what is smaller than the rounding of derivatives. A chain is taken piece by
piece; its parameter runs over [0, pieces]. Figures are accurate to rounding; that no critical point is missed is
judged by the decay of Chebyshev coefficients, not proved.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad._jets import norm
from gtcad.chebyshev import UNIT_ROUNDOFF, nodes
from gtcad.composite import Composite
from gtcad.errors import InputError
from gtcad.protocol import SeparableCurve, checked_kind
from gtcad.restricted import RestrictedCurve
from gtcad.roots import roots

Array = NDArray[np.float64]

SAMPLES = np.concatenate([[0.0], (nodes(64) + 1) / 2, [1.0]])  # where the size of a function is taken
SAMPLES.flags.writeable = False

_NOISE = 256 * UNIT_ROUNDOFF  # of derivatives, relative to their largest value on the curve
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
    pieces = pieces_of(curve)
    target = _vector("point", point, curve.dimension)
    size, places = 0.0, []
    for start, piece in enumerate(pieces):
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
    before, after = signs_beside(t, last, is_closed(curve), lambda s: np.sign((curve.evaluate(s) - base) @ across))
    points = curve.evaluate(t)
    return tuple(Crossing(float(t[k]), points[k], bool(before[k] * after[k] > 0)) for k in range(t.size))


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
    """The pieces of a chain; a curve alone is its own.

    Raises
    ------
    InputError
        When it is neither.
    """
    checked_kind("curve", curve, (SeparableCurve, Composite), "a curve or a chain")
    return curve.pieces if isinstance(curve, Composite) else (curve,)


def is_closed(curve: SeparableCurve | Composite) -> bool:
    """Whether it is a chain that ends where it begins."""
    return isinstance(curve, Composite) and curve.closed


def signs_beside(t: Array, last: float, closed: bool, sign: Callable[[Array], Array]) -> tuple[Array, Array]:
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
    if is_closed(curve):
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
