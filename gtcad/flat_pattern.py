"""Flat patterns: patches of straight lines laid into the plane without stretching, and back.

References
----------
M. P. do Carmo, Differential Geometry of Curves and Surfaces, Prentice-Hall 1976, sections 3-5 and 4-2.
H. Pottmann, J. Wallner, Computational Line Geometry, Springer 2001, section 6.1.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad._development import Rulings, Span, Twist, check_regular, largest_twist, unrolled
from gtcad._flat_bends import BendLine, Turning
from gtcad._flat_places import Crossing, first_crossing, located
from gtcad.basis import BERNSTEIN, checked_parameters
from gtcad.curve import Curve
from gtcad.errors import InputError, NotDevelopable
from gtcad.flat_curves import (
    FlatCurve,
    ParameterCurve,
    RolledCurve,
    inside,
    localised,
    moved_curve,
    parameter_function,
    resolved_curve,
)
from gtcad.measure import Estimate, area, length
from gtcad.patches.ruled import Ruled
from gtcad.protocol import SeparableSurface, affine

Array = NDArray[np.float64]

SIDES = ("u0", "u1", "v0", "v1")
_OUTLINE = (("v0", False), ("u1", False), ("v1", True), ("u0", True))
_SAMPLES = 129
_SINGULAR = 1e-12
_UNEVEN = 0.381966


@dataclass(frozen=True)
class Loss:
    """What a flat pattern lost of its patch: nothing but rounding where the patch is developable.

    Attributes
    ----------
    twist_deg, twist_at
        The largest angle found between the tangent planes at both ends of a ruling, and its parameter.
    strain
        The largest relative change found of a length: pattern over patch, less 1.
    lengths
        Of each side: (pattern, patch), in the model's unit.
    area
        (pattern, patch).
    """

    twist_deg: float
    twist_at: float
    strain: float
    lengths: Mapping[str, tuple[Estimate, Estimate]]
    area: tuple[Estimate, Estimate]


@dataclass(frozen=True, eq=False)
class FlatPattern:
    """A patch laid into the plane, as it is seen from the side that S_u x S_v points to; made by ``develop``.

    Parameters
    ----------
    patch
        The patch in space.
    spans
        Its parts in the plane.
    twist
        The largest twist found.
    error
        Estimated distance of the points from those of the exact development, in the model's unit: what the series leave
        out, and rounding.
    along_v
        Whether the rulings run in v.
    """

    patch: SeparableSurface
    spans: tuple[Span, ...]
    twist: Twist
    error: float
    along_v: bool = True

    @property
    def breaks(self) -> tuple[float, ...]:
        """The ends of the spans, from 0 to 1."""
        return (self.spans[0].start, *(span.end for span in self.spans))

    @property
    def ruling_sides(self) -> tuple[str, str]:
        """The sides that are rulings, the first and the last one."""
        return ("u0", "u1") if self.along_v else ("v0", "v1")

    def point(self, u: ArrayLike, v: ArrayLike) -> Array:
        """The points of the plane that points S(u, v) go to, shape broadcast(u, v).shape + (2,)."""
        return self.derivative(u, v, (0, 0))

    def derivative(self, u: ArrayLike, v: ArrayLike, orders: tuple[int, int] = (1, 0)) -> Array:
        """Partial derivatives of the points, shape broadcast(u, v).shape + (2,).

        Raises
        ------
        InputError
            When a parameter is outside [0, 1] or the shapes do not broadcast.
        """
        u, v = checked_parameters("u", u), checked_parameters("v", v)
        try:
            u, v = np.broadcast_arrays(u, v)
        except ValueError:
            raise InputError(f"u and v must broadcast, got shapes {u.shape} and {v.shape}") from None
        (t, s), (order_t, order_s) = ((u, v), orders) if self.along_v else ((v, u), orders[::-1])
        place, local = localised(t.reshape(-1), self.breaks)
        result = np.empty((t.size, 2))
        for k in np.unique(place):
            here, span = place == k, self.spans[k]
            values = span.flat.derivative(local[here], s.reshape(-1)[here], (order_t, order_s))
            result[here] = values / (span.end - span.start) ** order_t
        return result.reshape(*t.shape, 2)

    @cached_property
    def boundary(self) -> Mapping[str, FlatCurve]:
        """The four sides by name, each with the parameter of the patch."""
        first, last = self.spans[0].flat, self.spans[-1].flat
        ends = [
            FlatCurve((Curve([flat.a.evaluate(t), flat.b.evaluate(t)], family=BERNSTEIN),), (0.0, 1.0), self.error)
            for flat, t in ((first, 0.0), (last, 1.0))
        ]
        runs = [
            FlatCurve(tuple(getattr(span.flat, side) for span in self.spans), self.breaks, self.error) for side in "ab"
        ]
        names = self.ruling_sides + tuple(side for side in SIDES if side not in self.ruling_sides)
        found = dict(zip(names, ends + runs, strict=True))
        return MappingProxyType({side: found[side] for side in SIDES})

    @cached_property
    def lengths(self) -> Mapping[str, Estimate]:
        """The lengths of the sides."""
        return MappingProxyType({side: curve.length for side, curve in self.boundary.items()})

    @cached_property
    def area(self) -> Estimate:
        """The area; where the pattern overlaps itself the parts count twice."""
        parts = [area(span.flat) for span in self.spans]
        return Estimate(math.fsum(parts), math.fsum(part.error for part in parts))

    def running(self, side: str) -> FlatCurve | None:
        """A side as the outline runs along it, counter-clockwise unless turned over; None where it is one point."""
        curve = self.boundary[side]
        if self.lengths[side] <= _SINGULAR * max(self.lengths.values()):
            return None
        return curve.reversed() if dict(_OUTLINE)[side] else curve

    @cached_property
    def contour(self) -> tuple[FlatCurve, ...]:
        """The sides one after the other, closed, without those that are one point."""
        return tuple(curve for side, _ in _OUTLINE if (curve := self.running(side)) is not None)

    @cached_property
    def overlap(self) -> Crossing | None:
        """Where the outline crosses itself, so that the pattern lies over itself; None where it does nowhere.

        Judged by a polygon of 256 points on each side: a crossing of less than its chords' sagitta may be missed.
        """
        return first_crossing(polygon(self.contour))

    @cached_property
    def loss(self) -> Loss:
        """What was lost of lengths and area."""
        grid = np.linspace(0.0, 1.0, _SAMPLES)
        ends = np.linspace(0.0, 1.0, 5)
        strain = 0.0
        for orders in ((1, 0), (0, 1)):
            flat, space = (
                np.linalg.norm(one.derivative(grid[:, None], ends[None, :], orders), axis=-1)
                for one in (self, self.patch)
            )
            moving = space > _SINGULAR * space.max()
            if moving.any():
                strain = max(strain, float(np.abs(flat[moving] / space[moving] - 1).max()))
        lengths = {side: (self.lengths[side], length(_Side(self.patch, side))) for side in SIDES}
        areas = (self.area, area(self.patch))
        return Loss(self.twist.degrees, self.twist.parameter, strain, MappingProxyType(lengths), areas)

    def bend_lines(self, count: int | None = None, *, at: Sequence[float] | None = None) -> tuple[BendLine, ...]:
        """Rulings to bend at.

        Parameters
        ----------
        count
            That many, each in the middle of an equal share of the angle that the normal turns by; none on a plane.
        at
            The parameters instead, increasing in [0, 1].

        Raises
        ------
        InputError
            Unless just one of both is given, in its range.
        """
        if (count is None) == (at is None):
            raise InputError(f"give just one of count and at, got count={count}, at={at}")
        places, angles = self._turning.equal(count) if at is None else self._turning.at(at)
        zeros, ones = np.zeros(places.size), np.ones(places.size)
        both = ((places, zeros), (places, ones)) if self.along_v else ((zeros, places), (ones, places))
        starts, ends = (self.point(u, v).tolist() for u, v in both)
        return tuple(
            BendLine(float(t), (start[0], start[1]), (end[0], end[1]), float(angle))
            for t, start, end, angle in zip(places, starts, ends, angles, strict=True)
        )

    @cached_property
    def _turning(self) -> Turning:
        return Turning(self.spans)

    @property
    def turning(self) -> float:
        """The angle in radians that the normal turns by in all, both ways counted."""
        return self._turning.total

    def image(self, curve: ParameterCurve) -> FlatCurve:
        """A curve on the patch, in the plane.

        Parameters
        ----------
        curve
            (u, v) as any plane curve of the project, or as a function from t, shape (count,), to points of shape
            (count, 2), analytic on [0, 1]. Of a chain each piece takes an equal part of [0, 1].

        Raises
        ------
        InputError
            When the curve leaves the patch, or is not resolved by polynomials.
        """
        function, breaks, error = parameter_function(curve)

        def flat(t: Array) -> Array:
            u, v = inside(function(t)).T
            return self.point(u, v)

        slope = max(float(np.abs(self.derivative(*_GRID, orders)).max()) for orders in ((1, 0), (0, 1)))
        return resolved_curve(flat, breaks, "the curve", self.error + slope * error)

    def locate(self, points: ArrayLike) -> Array:
        """The parameters (u, v) of points of the plane, shape (..., 2).

        Raises
        ------
        InputError
            When a point lies outside the pattern by more than rounding; where the pattern overlaps itself, one of
            the places is taken.
        """
        given = np.asarray(points, dtype=np.float64)
        if given.shape[-1:] != (2,) or not np.isfinite(given).all():
            raise InputError(f"points must be finite, of shape (..., 2), got shape {given.shape}")
        found = located(self.spans, given.reshape(-1, 2), 64 * self.error)
        return (found if self.along_v else found[:, ::-1]).reshape(given.shape)

    def roll(self, curve: ParameterCurve) -> RolledCurve:
        """A curve in the plane, rolled back onto the patch: the inverse of ``image``.

        Raises
        ------
        InputError
            When the curve leaves the pattern, or is not resolved by polynomials.
        """
        function, breaks, error = parameter_function(curve)
        parameters = resolved_curve(lambda t: self.locate(function(t)), breaks, "the curve rolled back", 0.0)

        def space(t: Array) -> Array:
            u, v = inside(parameters.evaluate(t)).T
            return self.patch.evaluate(u, v)

        return RolledCurve(parameters, resolved_curve(space, parameters.breaks, "the rolled curve", self.error + error))

    def moved(self, matrix: ArrayLike, translation: ArrayLike | None = None) -> FlatPattern:
        """The pattern after a motion of the plane, which may turn it over: points x become matrix @ x + translation.

        Raises
        ------
        InputError
            When the matrix is no rotation or reflection.
        """
        linear = affine(np.eye(2), matrix, None).T
        if linear.shape != (2, 2) or np.abs(linear @ linear.T - np.eye(2)).max() > 1e-12:
            raise InputError(f"matrix must be a rotation or reflection of the plane, got {np.asarray(matrix).tolist()}")
        sign = 1.0 if np.linalg.det(linear) > 0 else -1.0
        spans = tuple(
            replace(
                span,
                flat=Ruled(*(moved_curve(side, linear, translation) for side in (span.flat.a, span.flat.b))),
                bend=sign * span.bend,
            )
            for span in self.spans
        )
        return replace(self, spans=spans)


def develop(patch: SeparableSurface, *, twist_deg: float = 1e-6) -> FlatPattern:
    """The flat pattern of a patch.

    Lengths on the patch are lengths in the pattern. The first ruling points along y and the patch follows to the right,
    beginning at the origin (where the rulings run in u, with x and y changing their parts); it is seen from the side
    that ``S_u x S_v`` points to.

    Parameters
    ----------
    patch
        A surface that is linear in v, or in u: a ruled patch, cylinder, cone, developable, or a part of one, in the
        model's unit.
    twist_deg
        The largest angle in degrees allowed between the tangent planes at both ends of a ruling. Above 0.001 or so the
        pattern loses length visibly: ``loss`` says how much.

    Raises
    ------
    NotDevelopable
        When the twist is larger, the patch is crossed by its edge of regression, a ruling is singular, or it is not
        straight in u or v.
    InputError
        When an argument is out of its range.

    Notes
    -----
    Two quadratures by Chebyshev series on spans that are halved until the series are resolved: lengths and area agree
    with those of the patch to 1e-12 as a rule. The twist is that of samples; the strain of a quasi-developable is
    ``1 - cos(phi)`` along a boundary that leaves the middle's tangent plane by the angle phi: of second order.
    A boundary may be one point (a cone with its apex), as may the first and the last ruling. What is laid flat is the
    patch as it is evaluated, within its ``definition_error``. The cost is some milliseconds, up to 0.1 s where the
    series get long.

    Examples
    --------
    A quarter of a cylinder of radius 2 and height 3 becomes a rectangle of pi by 3:

    >>> from gtcad import Curve
    >>> from gtcad.patches import cylinder
    >>> pattern = develop(cylinder(Curve([[2, 0, 0], [2, 2, 0], [0, 2, 0]]), [0, 0, 3]))
    >>> round(pattern.lengths["v0"], 12), round(pattern.area, 12)
    (3.14159265359, 9.424777960769)
    """
    return developed(patch, twist_deg)


def developed(patch: SeparableSurface, twist_deg: float, *, in_u: bool = False) -> FlatPattern:
    """As ``develop``; along the lines in u if wanted, where the patch is straight in both parameters."""
    if not isinstance(patch, SeparableSurface):
        raise InputError(f"patch must be a surface, got {type(patch).__name__}")
    if not 0 <= twist_deg < 90:
        raise InputError(f"twist_deg must lie in [0, 90), got {twist_deg}")
    rulings = Rulings(patch, in_u=in_u)
    breaks = rulings.breaks()
    twist = largest_twist(rulings, breaks)
    if not math.isfinite(twist.degrees):
        raise NotDevelopable(
            f"a ruling has no tangent plane at {rulings.across} = {twist.parameter:.6g}", parameter=twist.parameter
        )
    if twist.degrees > twist_deg:
        raise NotDevelopable(
            f"the patch is not developable: its tangent plane twists by {twist.degrees:.3g} degrees along the ruling "
            f"{rulings.across} = {twist.parameter:.6g}; twist_deg allows {twist_deg:.3g}",
            twist_deg=twist.degrees,
            parameter=twist.parameter,
        )
    check_regular(rulings, breaks)
    spans, error = unrolled(rulings, breaks)
    return FlatPattern(patch, spans, twist, error, rulings.along_v)


def polygon(contour: Sequence[FlatCurve], count: int = 256) -> Array:
    """Points of a closed contour, that many on each of its curves, shape (n, 2); its corners are among them."""
    first = 0.0 if len(contour) > 1 else _UNEVEN  # a curve that closes smoothly may cross itself where it begins
    t = (np.arange(count) + first) / count
    return np.concatenate([curve.evaluate(t) for curve in contour])


_GRID = (np.linspace(0.0, 1.0, 17)[:, None], np.linspace(0.0, 1.0, 17)[None, :])


class _Side:
    """A side of a patch as a curve to be measured."""

    def __init__(self, patch: SeparableSurface, side: str) -> None:
        self.patch, self.side, self.dimension = patch, side, patch.dimension

    def derivative(self, t: ArrayLike, order: int = 1) -> Array:
        """Derivatives with respect to the parameter of the side."""
        at = float(self.side[1])
        if self.side[0] == "u":
            return self.patch.derivative(at, t, (0, order))
        return self.patch.derivative(t, at, (order, 0))
