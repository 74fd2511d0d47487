"""Conics: exact circles, ellipses, arcs of both and parabola arcs; hyperbolas to be fitted.

A GT piece of degree 2 with gamma = (0, 0) is the quarter ``cos(pi t/2) u + sin(pi t/2) v`` of an ellipse with the
conjugate half diameters u and v, so an arc is a chain of quarters, the last one restricted to a part of its domain.

No GT curve of any degree is an arc of a hyperbola. Its coordinates are polynomials in t, z and 1/z, z = exp(i pi t/2),
and those of the hyperbola's plane can be chosen such that the hyperbola is X Y = 1. That would hold for all t, since
both sides are analytic. But t and z are algebraically independent, so only the polynomials c z^k have such an inverse,
and c z^k is real for all t only when k = 0: X and Y would be constant. ``hyperbola`` therefore is no GT curve but a
shape of the protocol, which is fitted and proved like all others.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.composite import Composite
from gtcad.curve import Curve
from gtcad.errors import InputError
from gtcad.factors import CurveOfTerms, Hyperbolic
from gtcad.protocol import SeparableCurve, affine
from gtcad.restricted import Restricted

Array = NDArray[np.float64]

_LEAST_TURN = 1e-7  # degrees: about the least part of a quarter that `Restricted` takes
_SLIVER = 1e-6  # of a quarter: a last piece as short as this would be a useless edge
_PARALLEL = 1e-12  # sine of the angle of two half diameters
_COLLINEAR = 1e-9  # of the square of the largest distance: area of a triangle that is none
_FARTHEST = 16.0  # hyperbolic angle at which a branch is within exp(-32) = 1e-14 of its size from an asymptote


@dataclass(frozen=True, eq=False, init=False, repr=False)
class Arc(Composite):
    r"""An arc of an ellipse, or all of it, as a chain of exact quarters.

    .. math:: p(\theta) = c + \cos(\theta)\, a + \sin(\theta)\, b

    Parameters
    ----------
    center
        c, shape (2,) or (3,), in the model's unit.
    axis_a, axis_b
        Any two conjugate half diameters, not parallel; at right angles they are the half axes.
    start_deg, end_deg
        First and last theta, at most 360 apart; end < start runs backwards. In degrees, because quarters and full
        turns are whole numbers of these.

    Raises
    ------
    InputError
        When an argument is out of its range.

    Notes
    -----
    The pieces are quarters from the start on, joined C3, and the rest, joined G3. (A rest below 1e-6 of a quarter and
    the quarter before it are halved instead.) At multiples of 90 degrees from a start at one, points are exact; a full
    turn is closed and ends at the very numbers where it starts. All other points are within a few units of rounding.

    Examples
    --------
    >>> half = Arc([0, 0], [2, 0], [0, 1], 0, 180)
    >>> half.evaluate([0, 1, 2]).tolist()
    [[2.0, 0.0], [0.0, 1.0], [-2.0, 0.0]]
    """

    center: Array = field(init=False)
    axis_a: Array = field(init=False)
    axis_b: Array = field(init=False)
    start_deg: float = field(init=False)
    end_deg: float = field(init=False)

    def __init__(
        self,
        center: ArrayLike,
        axis_a: ArrayLike,
        axis_b: ArrayLike,
        start_deg: float = 0.0,
        end_deg: float = 360.0,
    ) -> None:
        vectors = _vectors(center=center, axis_a=axis_a, axis_b=axis_b)
        _check_not_parallel(*vectors[1:])
        start, end = _number("start_deg", start_deg), _number("end_deg", end_deg)
        turn = _turn(start, end)
        parts = _parts(abs(turn))
        pieces = [
            _piece(vectors, start, math.copysign(90.0, turn), sum(parts[:k]), part) for k, part in enumerate(parts)
        ]
        closed = abs(turn) == 360
        orders = ["C3" if part == following else "G3" for part, following in pairwise(parts)]
        super().__init__(tuple(pieces), (*orders, *["C3"] * closed), closed)
        for name, value in zip(("center", "axis_a", "axis_b"), vectors, strict=True):
            object.__setattr__(self, name, value)
        object.__setattr__(self, "start_deg", start)
        object.__setattr__(self, "end_deg", end)

    def reversed(self) -> Arc:
        """The same points from the other end."""
        return Arc(self.center, self.axis_a, self.axis_b, self.end_deg, self.start_deg)

    def transformed(self, matrix: ArrayLike, translation: ArrayLike | None = None) -> Arc:
        """The affine image, with the same angles: points x become ``matrix @ x + translation``.

        Raises
        ------
        InputError
            When the shapes do not fit, or the matrix makes a line of the arc.
        """
        center = affine(self.center, matrix, translation)
        axis_a, axis_b = (affine(axis, matrix, None) for axis in (self.axis_a, self.axis_b))
        return Arc(center, axis_a, axis_b, self.start_deg, self.end_deg)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Arc):
            return NotImplemented
        return self._values == other._values

    def __hash__(self) -> int:
        return hash(self._values)

    def __repr__(self) -> str:
        center, axis_a, axis_b, start, end = self._values
        return f"Arc(center={center}, axis_a={axis_a}, axis_b={axis_b}, start_deg={start}, end_deg={end})"

    def __reduce__(self) -> tuple[object, ...]:
        return Arc, self._values

    @property
    def _values(self) -> tuple[object, ...]:
        vectors = (tuple(vector.tolist()) for vector in (self.center, self.axis_a, self.axis_b))
        return (*vectors, self.start_deg, self.end_deg)


def ellipse(center: ArrayLike, axis_a: ArrayLike, axis_b: ArrayLike) -> Arc:
    """The whole ellipse with two conjugate half diameters, from the end of the first one on, as a chain of quarters.

    Parameters
    ----------
    center
        Shape (2,) or (3,), in the model's unit.
    axis_a, axis_b
        The half diameters as vectors, not parallel; at right angles they are the half axes.

    Raises
    ------
    InputError
        When an argument is out of its range.

    Examples
    --------
    >>> len(ellipse([0, 0], [2, 0], [0, 1]).pieces)
    4
    """
    return Arc(center, axis_a, axis_b)


def circle(center: ArrayLike, radius: float, normal: ArrayLike | None = None) -> Arc:
    """The whole circle, counterclockwise from angle 0 of ``arc``, as a closed chain of quarters.

    Parameters
    ----------
    center
        Shape (2,) or (3,), in the model's unit.
    radius
        Above 0.
    normal
        Of the plane, of any length, for a center in space: z unless given.

    Raises
    ------
    InputError
        When an argument is out of its range.

    Examples
    --------
    >>> circle([0, 0, 5], 2).evaluate(3).tolist()
    [0.0, -2.0, 5.0]
    """
    return arc(center, radius, 0.0, 360.0, normal)


def arc(
    center: ArrayLike,
    radius: float,
    start_deg: float,
    end_deg: float,
    normal: ArrayLike | None = None,
) -> Arc:
    """An arc of a circle.

    Parameters
    ----------
    center
        Shape (2,) or (3,).
    radius
        Above 0.
    start_deg, end_deg
        As of ``Arc``. Angle 0 is where the direction of x projects into the plane, or that of y when the normal is
        nearly along x (more than 0.9 of its length).
    normal
        Of the plane, of any length, for a center in space: z unless given. Seen from its tip, angles are
        counterclockwise.

    Raises
    ------
    InputError
        When an argument is out of its range.

    Examples
    --------
    >>> arc([1, 0], 2, 90, 0).evaluate([0, 1]).tolist()
    [[1.0, 2.0], [3.0, 0.0]]
    """
    (middle,) = _vectors(center=center)
    length = _number("radius", radius)
    if not length > 0:
        raise InputError(f"radius must be above 0, got {length}")
    if len(middle) == 2:
        if normal is not None:
            raise InputError(f"normal is for a center in space; the center has two coordinates, got {normal}")
        directions = np.eye(2)
    else:
        directions = _plane((0.0, 0.0, 1.0) if normal is None else normal)
    return Arc(middle, length * directions[0], length * directions[1], start_deg, end_deg)


def arc_through(a: ArrayLike, b: ArrayLike, c: ArrayLike) -> Arc:
    """The arc of a circle from a through b to c, in the plane or in space.

    Parameters
    ----------
    a, b, c
        Shape (2,) or (3,), not on one line.

    Raises
    ------
    InputError
        When an argument is out of its range, or the points are on one line.

    Notes
    -----
    The three points are met to rounding of the radius. The arc turns by twice the angle that the polygon turns at b.

    Examples
    --------
    >>> half = arc_through([2, 0], [2, 2], [0, 2])
    >>> half.center.tolist(), half.end_deg
    ([1.0, 1.0], 180.0)
    """
    first, second, third = _vectors(a=a, b=b, c=c)
    frame = _triangle(a=first, b=second, c=third)
    length = float(frame[0] @ (second - first))
    x, y = (frame @ (third - first)).tolist()
    center = np.array([length / 2, x / 2 * ((x - length) / y) + y / 2])  # in the frame: as far from all three
    to_start, quarter_on = -center @ frame, np.array([center[1], -center[0]]) @ frame
    return Arc(first - to_start, to_start, quarter_on, 0.0, math.degrees(2 * math.atan2(y, x - length)))


def parabola(p0: ArrayLike, p1: ArrayLike, p2: ArrayLike) -> Curve:
    """The arc of a parabola from p0 to p2 whose end tangents meet at p1, as one GT piece of degree 2.

    ``C(t) = (1 - w)^2 p0 + 2 w (1 - w) p1 + w^2 p2`` with w = 1 - cos(pi t/2): gamma = (-1, 1).

    Parameters
    ----------
    p0, p1, p2
        Shape (2,) or (3,), not on one line.

    Raises
    ------
    InputError
        When an argument is out of its range, or the points are on one line.

    Notes
    -----
    The speed is 0 at t = 0, as it is at one end of every whole GT piece that is a parabola: ``check_join`` finds no
    tangent there, though the points have one.

    Examples
    --------
    >>> x, y = parabola([0, 0], [1, 0], [2, 4]).evaluate(0.6)
    >>> bool(abs(y - x**2) < 1e-15)
    True
    """
    points = _vectors(p0=p0, p1=p1, p2=p2)
    _triangle(p0=points[0], p1=points[1], p2=points[2])
    return Curve(points, gamma=(-1.0, 1.0))


def hyperbola(center: ArrayLike, axis_a: ArrayLike, axis_b: ArrayLike, start: float, end: float) -> CurveOfTerms:
    r"""An arc of one branch of a hyperbola: no GT curve, but one that can be fitted.

    .. math:: p(s) = c + \cosh(s)\, a + \sinh(s)\, b, \qquad s = (1 - t)\, \text{start} + t\, \text{end}

    Parameters
    ----------
    center
        c, shape (2,) or (3,), in the model's unit.
    axis_a, axis_b
        Any two conjugate half diameters, not parallel: c + a is on the branch, and b is the tangent there.
    start, end
        First and last s, in [-16, 16], at least 1e-9 apart; end < start runs backwards.

    Raises
    ------
    InputError
        When an argument is out of its range.

    Notes
    -----
    Why no GT curve is one is said at the top of this module. ``gtcad.converters.fit_curve`` makes a B-spline of it with
    a proved deviation.

    Examples
    --------
    The hyperbola x^2 - y^2 = 1:

    >>> x, y = hyperbola([0, 0], [1, 0], [0, 1], -1, 2).evaluate(0.4)
    >>> bool(abs(x**2 - y**2 - 1) < 1e-14)
    True
    """
    middle, half_a, half_b = _vectors(center=center, axis_a=axis_a, axis_b=axis_b)
    _check_not_parallel(half_a, half_b)
    ends = _number("start", start), _number("end", end)
    if max(map(abs, ends)) > _FARTHEST or abs(ends[1] - ends[0]) < 1e-9:
        raise InputError(f"start and end must be two different numbers in [-16, 16], got {ends[0]} and {ends[1]}")
    factors = Hyperbolic(*ends)
    return CurveOfTerms(factors, [middle, factors.weight * half_a, factors.weight * half_b])


def _turn(start: float, end: float) -> float:
    """The signed turn in degrees; a multiple of 90 when it is one to the rounding of the angles."""
    turn = end - start
    whole = 90.0 * round(turn / 90)
    if abs(turn - whole) <= math.ulp(max(abs(start), abs(end))):
        turn = whole
    if not _LEAST_TURN <= abs(turn) <= 360:
        raise InputError(f"start_deg and end_deg must be {_LEAST_TURN:g} to 360 degrees apart, got {start} and {end}")
    return turn


def _parts(turn: float) -> tuple[float, ...]:
    """The parts of quarters that make up a turn: whole ones, and the rest."""
    count, degrees = divmod(turn, 90.0)
    whole, rest = int(count), degrees / 90
    if rest == 0:
        return (1.0,) * whole
    if whole and rest < _SLIVER:
        return (1.0,) * (whole - 1) + ((1 + rest) / 2,) * 2
    return (1.0,) * whole + (rest,)


def _piece(vectors: list[Array], start: float, quarter: float, before: float, part: float) -> SeparableCurve:
    """A part of a quarter of +90 or -90 degrees that begins so many quarters after the start."""
    center, a, b = vectors
    turned = int(before)
    cosine, sine = _cosine_sine(start + quarter * (before - turned))
    u, v = cosine * a + sine * b, math.copysign(1.0, quarter) * (cosine * b - sine * a)
    for _ in range(turned):  # without rounding: neighbours share their points to the last digit
        u, v = v, -u
    whole = Curve([center + u, center + (u + v), center + v])
    return whole if part == 1 else Restricted(whole, (0.0, part))


def _cosine_sine(degrees: float) -> tuple[float, float]:
    """Exact at multiples of 90."""
    quarters = round(degrees / 90)
    rest = math.radians(degrees - 90 * quarters)
    c, s = math.cos(rest), math.sin(rest)
    return ((c, s), (-s, c), (-c, -s), (s, -c))[quarters % 4]


def _plane(normal: ArrayLike) -> Array:
    """The directions of angles 0 and 90 in a plane of space, shape (2, 3)."""
    (given,) = _vectors(normal=normal)
    if len(given) != 3 or not given.any():
        raise InputError(f"normal must be three numbers, not all 0, got {given.tolist()}")
    unit = _unit(given)
    nearest = np.eye(3)[0] if abs(unit[0]) <= 0.9 else np.eye(3)[1]
    first = _unit(nearest - (nearest @ unit) * unit)
    return np.array([first, np.cross(unit, first)])


def _triangle(**points: Array) -> Array:
    """The directions from the first point to the second, and across it to the third, shape (2, d)."""
    a, b, c = points.values()
    sides = b - a, c - a, c - b
    if sides[0].any():
        along = _unit(sides[0])
        across = sides[1] - (sides[1] @ along) * along
        area, longest = np.linalg.norm(sides[0]) * np.linalg.norm(across), max(map(np.linalg.norm, sides))
        if area > _COLLINEAR * longest * longest:
            return np.array([along, _unit(across - (across @ along) * along)])  # again, for what rounding left
    shown = ", ".join(f"{name} = {point.tolist()}" for name, point in points.items())
    raise InputError(f"three points that are not on one line are needed, got {shown}")


def _unit(vector: Array) -> Array:
    scaled = vector / np.abs(vector).max()  # squares neither overflow nor vanish
    return np.asarray(scaled / np.linalg.norm(scaled))


def _number(name: str, value: float) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise InputError(f"{name} must be a number, got {value!r}") from None
    if not math.isfinite(number):
        raise InputError(f"{name} must be finite, got {number}")
    return number


def _vectors(**given: ArrayLike) -> list[Array]:
    """Points or directions of one dimension, 2 or 3, as read-only arrays."""
    vectors: list[Array] = []
    for name, value in given.items():
        try:
            vector = np.array(value, dtype=np.float64) + 0.0  # -0.0 and 0.0 are one
        except (TypeError, ValueError):
            raise InputError(f"{name} must be two or three numbers, got {value!r}") from None
        if vector.shape not in ((2,), (3,)) or not np.isfinite(vector).all():
            raise InputError(f"{name} must be two or three finite numbers, got {vector.tolist()}")
        if vectors and len(vector) != len(vectors[0]):
            raise InputError(f"{name} must have {len(vectors[0])} coordinates like the others, got {vector.tolist()}")
        vector.flags.writeable = False
        vectors.append(vector)
    return vectors


def _check_not_parallel(a: Array, b: Array) -> None:
    if a.any() and b.any():
        p, q = _unit(a), _unit(b)
        if np.linalg.norm(q - (p @ q) * p) > _PARALLEL:
            return
    raise InputError(f"axis_a and axis_b must not be zero or parallel, got {a.tolist()} and {b.tolist()}")
