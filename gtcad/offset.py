"""Offsets of plane curves: at a constant distance to one side, with their cusps.

With T = C' / |C'| and N its left normal, ``O(t) = C(t) + distance N(t)`` and ``O' = (1 - distance kappa) C'`` with the
curvature kappa positive to the left: where ``distance kappa = 1`` the offset stops, and beyond it runs backwards. Only
these cusps are looked for: an offset may also cross itself far from them, where the curve comes near itself.

References
----------
R. T. Farouki, C. A. Neff, Analytic properties of plane offset curves, Comput. Aided Geom. Design 7 (1990) 83-99.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad._jets import norm
from gtcad.basis import checked_order
from gtcad.composite import Composite
from gtcad.differential import tangent
from gtcad.errors import InputError
from gtcad.extremes import curvature_range
from gtcad.protocol import SeparableCurve
from gtcad.queries import SAMPLES, pieces_of
from gtcad.roots import roots

Array = NDArray[np.float64]

_FLAT = 1e-9  # of the size: how far a curve in space may leave its plane
_POINT = 1e-12  # of the coordinates: a curve whose speed is below does not leave its start
_NOISE = 1e-11  # of functions that were divided by their size
_STOPPED = 1e-9  # of the largest speed
_NEAR_STOP = 1e-4  # parameters so near an end where the curve stops have lost the digits that a cusp needs


@dataclass(frozen=True)
class Offset:
    """The curve at a constant distance from a plane curve, with or without cusps; ``offset`` refuses cusps.

    Parameters
    ----------
    curve
        A curve, or a chain whose pieces join with equal tangents. One in space must lie in a plane.
    distance
        Signed, in the model's unit, not 0: positive to the left of the direction of travel.
    normal
        Of the plane, for a curve in space: left is seen with the normal pointing at the viewer. Shape (3,), any length.

    Raises
    ------
    InputError
        When an argument is out of its range, the curve leaves its plane by more than 1e-9 of its size, it stops in its
        interior, where the side would change, or a chain has a corner.

    Notes
    -----
    A curve that leaves its plane by rounding keeps its heights: the offset moves along the plane only.

    Examples
    --------
    Inside the unit circle, run to the left:

    >>> from gtcad import Curve
    >>> Offset(Curve([[1, 0], [1, 1], [0, 1]]), 0.25).evaluate([0.0, 1.0]).round(12).tolist()
    [[0.75, 0.0], [0.0, 0.75]]
    """

    curve: SeparableCurve | Composite
    distance: float
    normal: Sequence[float] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "distance", _checked_distance(self.distance))
        object.__setattr__(self, "normal", _checked_normal(self.curve.dimension, self.normal))
        if self.normal is not None:
            _check_flat(self.curve, np.array(self.normal))
        _check_smooth(self.plane)
        for piece in pieces_of(self.plane):
            if np.abs(self._progress(piece, SAMPLES)).max() <= _NOISE:
                raise InputError(f"the offset by {self.distance:g} shrinks an arc of that radius to its centre")

    @property
    def dimension(self) -> int:
        """Space dimension d."""
        return self.curve.dimension

    @property
    def domain(self) -> tuple[float, float]:
        """First and last parameter, those of the curve."""
        return self.curve.domain

    @property
    def pieces(self) -> tuple[Offset, ...]:
        """The offsets of the pieces of a chain; an offset of one curve is its own."""
        if not isinstance(self.curve, Composite):
            return (self,)
        return tuple(Offset(piece, self.distance, self.normal) for piece in self.curve.pieces)

    @cached_property
    def frame(self) -> Array:
        """Rows: two axes of the plane, the second a left turn from the first; shape (2, d)."""
        if self.normal is None:
            return np.eye(2)
        normal = np.array(self.normal)
        first = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
        first /= norm(first)
        return np.stack([first, np.cross(normal, first)])

    @cached_property
    def plane(self) -> SeparableCurve | Composite:
        """The curve in the coordinates of ``frame``."""
        return self.curve if self.normal is None else self.curve.transformed(self.frame)

    @cached_property
    def cusps(self) -> tuple[float, ...]:
        """Parameters where ``distance kappa`` is 1, or jumps across it at a joint, in order: the offset stops there."""
        pieces = pieces_of(self.plane)
        found = [start + self._piece_cusps(piece) for start, piece in enumerate(pieces)]
        signs = np.sign([self._progress(piece, np.array([0.0, 1.0])) for piece in pieces])
        closed = isinstance(self.curve, Composite) and self.curve.closed
        flips = [k for k in range(0 if closed else 1, len(pieces)) if signs[k - 1, 1] * signs[k, 0] < 0]
        return tuple(np.unique(np.concatenate([flips, *found])).tolist())

    def _piece_cusps(self, piece: SeparableCurve) -> Array:
        t = roots(partial(self._progress, piece), noise=_NOISE)
        ends = norm(piece.derivative(np.array([0.0, 1.0]))) <= _STOPPED * norm(piece.derivative(SAMPLES)).max()
        return np.asarray(t[~((ends[0] & (t < _NEAR_STOP)) | (ends[1] & (t > 1 - _NEAR_STOP)))])

    @property
    def regular(self) -> bool:
        """Whether there is no cusp; an offset by more than every radius of curvature has none, but runs backwards."""
        return not self.cusps

    @property
    def limit(self) -> float:
        """Distances on this side below it give no cusp: the least radius of curvature, infinite when it turns away."""
        least, largest = curvature_range(self.plane)
        tightest = largest if self.distance > 0 else -least
        return 1 / tightest if tightest > 0 else math.inf

    def _progress(self, piece: SeparableCurve, t: Array) -> Array:
        """``1 - distance kappa``, divided by its size."""
        first, second = piece.derivative(t, 1), piece.derivative(t, 2)
        speed = norm(first)
        bend = self.distance * (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])
        size = speed**3 + abs(self.distance) * speed * np.sqrt(speed**2 + (second * second).sum(axis=1))
        return np.asarray((speed**3 - bend) / np.maximum(size, np.finfo(float).tiny))

    def evaluate(self, t: ArrayLike) -> Array:
        """Points O(t), shape t.shape + (d,).

        Raises
        ------
        InputError
            When a parameter is outside the domain.
        """
        t = np.asarray(t, dtype=np.float64)
        points = self.curve.evaluate(t)
        return np.asarray(points + self.distance * (self._tangents(t) @ _TURN.T) @ self.frame)

    def _tangents(self, t: Array) -> Array:
        """Unit tangents in the plane, their limits where the curve stops at an end."""
        flat, pieces = t.reshape(-1), pieces_of(self.plane)
        result = np.empty((flat.size, 2))
        places = np.minimum(flat.astype(int), len(pieces) - 1)
        for place in np.unique(places):
            here = places == place
            result[here] = tangent(pieces[place], flat[here] - place)
        return result.reshape(*t.shape, 2)

    def derivative(self, t: ArrayLike, order: int = 1) -> Array:
        """Derivatives of the order, 0 the point, shape t.shape + (d,); NaN where the curve stops.

        From exact derivatives of the curve: the Taylor series of ``C' |C'|^-1``.

        Raises
        ------
        InputError
            When a parameter is outside the domain or the order is not a whole number from 0.
        """
        order = checked_order("order", order)
        if order == 0:
            return self.evaluate(t)
        along = [self.plane.derivative(t, k + 1) / math.factorial(k) for k in range(order + 1)]
        square = [sum((along[j] * along[k - j]).sum(axis=-1) for j in range(k + 1)) for k in range(order + 1)]
        with np.errstate(all="ignore"):
            inverse = [1 / np.sqrt(square[0])]
            for k in range(1, order + 1):  # the recursion of (C'.C')^(-1/2)
                total = sum((-0.5 * j - (k - j)) * square[j] * inverse[k - j] for j in range(1, k + 1))
                inverse.append(total / (k * square[0]))
            unit = sum(inverse[j][..., None] * along[order - j] for j in range(order + 1))
        turned = math.factorial(order) * (unit @ _TURN.T) @ self.frame
        return np.asarray(self.curve.derivative(t, order) + self.distance * turned)


_TURN = np.array([[0.0, -1.0], [1.0, 0.0]])  # a quarter to the left


def offset(
    curve: SeparableCurve | Composite,
    distance: float,
    *,
    normal: Sequence[float] | None = None,
    allow_cusps: bool = False,
) -> Offset:
    """The offset of a plane curve, refused when it has cusps or runs backwards.

    Parameters
    ----------
    curve, distance, normal
        As of ``Offset``: positive distances are to the left.
    allow_cusps
        Whether such an offset is wanted all the same.

    Raises
    ------
    InputError
        When there is a cusp, or the offset runs backwards, with the parameters and the distance on that side short of
        which there is none. And as ``Offset``.

    Examples
    --------
    >>> from gtcad import BERNSTEIN, Curve
    >>> parabola = Curve([[-1, 1], [0, -1], [1, 1]], family=BERNSTEIN)
    >>> offset(parabola, -3.0).regular
    True
    >>> offset(parabola, 0.75)
    Traceback (most recent call last):
    gtcad.errors.InputError: the offset by 0.75 has cusps at t = 0.360723, 0.639277: stay short of 0.5 on that side
    """
    result = Offset(curve, distance, normal)
    if allow_cusps or (result.regular and abs(distance) < result.limit):
        return result
    places = ", ".join(f"{t:.6g}" for t in result.cusps[:4]) + (", ..." if len(result.cusps) > 4 else "")
    what = f"has cusps at t = {places}" if places else "runs backwards"
    least = math.copysign(result.limit, distance)
    raise InputError(f"the offset by {distance:g} {what}: stay short of {least:.6g} on that side")


def _speeding(piece: SeparableCurve, t: Array) -> Array:
    """Half the derivative of the squared speed."""
    return np.asarray((piece.derivative(t, 1) * piece.derivative(t, 2)).sum(axis=1))


def _checked_distance(distance: object) -> float:
    try:
        value = float(distance)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        value = math.nan
    if not math.isfinite(value) or value == 0:
        raise InputError(f"distance must be a finite number other than 0, got {distance!r}")
    return value


def _checked_normal(dimension: int, normal: Sequence[float] | None) -> tuple[float, ...] | None:
    if dimension == 2:
        if normal is not None:
            raise InputError(f"normal is for curves in space; this one is plane, got {normal}")
        return None
    try:
        vector = np.array(normal, dtype=np.float64)
    except (TypeError, ValueError):
        vector = np.zeros(0)
    if vector.shape != (3,) or not np.isfinite(vector).all() or not norm(vector) > 0:
        raise InputError(f"normal of the plane must be three finite numbers, not all 0, for a curve in space: {normal}")
    return tuple((vector / norm(vector)).tolist())


def _check_flat(curve: SeparableCurve | Composite, normal: Array) -> None:
    points = np.concatenate([piece.evaluate(SAMPLES) for piece in pieces_of(curve)])
    leaves = float(np.ptp(points @ normal))
    if leaves > _FLAT * float(np.ptp(points, axis=0).max()):
        raise InputError(
            f"the curve must lie in a plane of normal {normal.tolist()}; its points leave it by {leaves:.3g}"
        )


def _check_smooth(curve: SeparableCurve | Composite) -> None:
    """No stop inside a piece, no corner between two."""
    for place, piece in enumerate(pieces_of(curve)):
        first, second = (float(norm(piece.derivative(SAMPLES, order)).max()) for order in (1, 2))
        if first <= _POINT * float(norm(piece.coefficients).max()):
            raise InputError("the curve must not be a point")
        t = roots(partial(_speeding, piece), noise=_NOISE * first * second)
        stops = t[(t > _STOPPED) & (t < 1 - _STOPPED) & (norm(piece.derivative(t)) <= _STOPPED * first)]
        if stops.size:
            raise InputError(f"the curve stops at t = {place + stops[0]:.9g}: it has no side there")
    for joint, report in enumerate(curve.report() if isinstance(curve, Composite) else ()):
        if not report.meets("G1"):
            angle = f"the tangents differ by {report.tangent_angle_deg:.3g} degrees, the points by {report.gap:.3g}"
            raise InputError(f"joint {joint} is a corner: {angle}; an offset needs equal tangents there")
