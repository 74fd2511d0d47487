"""Coordinates that were rounded to the digits of a file, and joints judged by what that may have done to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.continuity import Derivable, JoinReport, Thresholds, check_join
from gtcad.converters.bspline import BSplineCurve, BSplineSurface
from gtcad.converters.chain import as_curve
from gtcad.converters.part import EllipseArc
from gtcad.protocol import SeparableSurface

Array = NDArray[np.float64]
Bounds = tuple[float, float]
Surface = BSplineSurface | SeparableSurface

_DECIMAL = 1e-9  # of a unit: the last decimal of coordinates
_DECIMALS_FROM = 0.1  # of a unit: the least that are written with it
_DECIMAL_SLACK = 1e-14  # relative: what rounding to other units may leave of a decimal
_UNITS = (1.0, 10.0, 25.4, 304.8, 1000.0)  # mm
_COUNT = 97  # places along a side
_SINGULAR = 1e-6  # relative: a normal shorter than that, for the longest along the side, is none


def rounded_by(points: Array) -> float:
    """How far, in mm, coordinates may be from those that were written, by the digits that files keep.

    Half a unit of the tenth digit of the largest number, in millimetres. In another unit ten digits may be worth less,
    and the kernel's writer of IGES gives numbers from 0.1 on nine decimals, which in metres are 1e-6 mm: that counts
    only where every number is such a decimal of the unit, which unrounded ones never are, and not all of a coarser one.

    Parameters
    ----------
    points
        As the file has them, in mm: what was computed from them is no decimal any more.
    """
    numbers = np.abs(points)
    numbers = numbers[numbers > 0]
    if not len(numbers):
        return 0.0
    moved = 0.0
    for unit in _UNITS:
        held = numbers / unit
        digits = 10.0 ** (np.floor(np.log10(held)) - 9)
        decimals = np.where(held >= _DECIMALS_FROM, _DECIMAL, digits)
        coarse = np.maximum(digits, decimals)
        if unit == 1 or (_are_whole(held / np.minimum(digits, decimals)) and not _are_whole(held / (10 * coarse))):
            moved = max(moved, unit * float(coarse.max()) / 2)
    return moved


def _are_whole(counts: Array) -> bool:
    return bool((np.abs(counts - np.round(counts)) <= _DECIMAL_SLACK * counts).all())


def rounding_limits(
    surfaces: Sequence[Surface], sides: Sequence[str], moved: Sequence[float], curvature: float
) -> Thresholds:
    """What still counts as continuous along a side when coordinates are rounded, as IGES files have them.

    A spline's derivative moves by at most 2 e p / h when its poles move by e, where p is its degree and h the span at
    the side, and its second derivative by 4 e p (p - 1) / h^2.

    Parameters
    ----------
    surfaces, sides
        Of the joint.
    moved
        How far rounding may have moved the coordinates of each surface, in mm.
    curvature
        That jumps of curvature are relative to, in 1/mm.
    """
    usual = Thresholds()
    noise = [_noise(*one) for one in zip(surfaces, sides, moved, strict=True)]
    gap, angle, bending = (sum(values) for values in zip(*noise, strict=True))
    relative = bending / curvature if curvature > 0 else 0.0
    return Thresholds(usual.gap + gap, usual.angle_deg + np.rad2deg(angle), usual.curvature + relative)


def _noise(surface: Surface, side: str, moved: float) -> tuple[float, float, float]:
    """How far rounding moves points (mm), normals (radians) and curvatures (1/mm) along a side, to first order."""
    if isinstance(surface, SeparableSurface):
        return 0.0, 0.0, 0.0
    axis, last = "uv".index(side[0]), -1 if side[1] == "1" else 0
    places = [np.linspace(*ends, _COUNT) for ends in surface.domain]
    places[axis] = np.full(_COUNT, surface.domain[axis][last])
    tangents = surface.derivatives(*places)
    area = np.linalg.norm(np.cross(*tangents), axis=-1)
    regular = area > _SINGULAR * area.max()
    spans = np.diff(surface.knots_u), np.diff(surface.knots_v)
    angle = bending = np.zeros(np.count_nonzero(regular))
    for k, degree in enumerate((surface.degree_u, surface.degree_v)):
        height = (area / np.linalg.norm(tangents[1 - k], axis=-1).clip(np.finfo(float).tiny))[regular]
        span = float(spans[k][last] if k == axis else spans[k].min())
        angle = angle + 2 * moved * degree / span / height
        bending = bending + 4 * moved * degree * (degree - 1) / span**2 / height**2
    return moved, float(angle.max(initial=0.0)), float(bending.max(initial=0.0))


# --- ends of curves ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class End:
    """An edge's end, or its beginning, as rounding leaves it; the edge's parameter runs over [0, 1].

    Parameters
    ----------
    edge
        As the file has it, or a part of that.
    moved
        How far its coordinates may be from those that were written, in mm.
    backwards
        Whether it is run through from its last point.
    """

    edge: BSplineCurve | EllipseArc
    moved: float
    backwards: bool = False

    @property
    def domain(self) -> Bounds:
        """Of the parameter."""
        return 0.0, 1.0

    @cached_property
    def _curve(self) -> Derivable:
        return as_curve(self.edge)

    @property
    def _ends(self) -> Bounds:
        first, last = self._curve.domain
        return (last, first) if self.backwards else (first, last)

    def reversed(self) -> End:
        """From its other end."""
        return End(self.edge, self.moved, not self.backwards)

    def derivative(self, t: ArrayLike, order: int = 1) -> Array:
        """Derivatives of the order, 0 the point."""
        first, last = self._ends
        t = np.asarray(t, dtype=np.float64)
        return (last - first) ** order * self._curve.derivative(first * (1 - t) + last * t, order)

    def noise(self, last: bool) -> Array:
        """How far rounding moves the point and the derivatives 1 to 3 at the last parameter, or the first: bounds.

        A derivative is a sum of poles with the derivatives of the basis as weights: it moves by no more than the sum of
        their absolute values times the largest shift of a pole, which is that of a coordinate times the root of 3.
        The vectors of an arc follow from three points, its radii from differences of two.
        """
        ends = self._ends
        shift, powers = np.sqrt(3.0) * self.moved, np.abs(ends[1] - ends[0]) ** np.arange(4)
        if isinstance(self.edge, EllipseArc):
            turn = (self.edge.end - self.edge.start) ** np.arange(4)
            return np.asarray(2 * np.sqrt(2.0) * shift * turn + [shift, 0.0, 0.0, 0.0])
        return np.asarray(shift * powers * _basis_sums(self.edge, ends[last]))


def _basis_sums(spline: BSplineCurve, t: float) -> Array:
    """Sums of the absolute values of all basis functions' derivatives of order 0 to 3 at an end: of four at most."""
    count = len(spline.control_points)
    acting = range(min(4, count)) if t == spline.domain[0] else range(max(0, count - 4), count)
    sums = np.zeros(4)
    for k in acting:
        one = replace(spline, control_points=np.eye(count)[:, [k, k]])
        sums += [abs(float(one.derivative(t, order)[0])) for order in range(4)]
    return sums


def check_rounded_join(a: End, b: End, wanted: str) -> JoinReport:
    """What happens where one edge ends and the next starts, orders judged by what rounding may have done to both.

    To first order in the shifts d_k of the derivatives D_k, with s = |D_1| and the tangent t = D_1 / s, the tangent
    turns by d_1 / s; the curvature vector and the third derivative by length follow by the product rule. A jump may
    pass the usual limit by the sum of what both sides move; the figures themselves stay as they are.
    """
    found = check_join(a, b)
    if found.meets(wanted) or not np.isfinite(found.tangent_angle_deg):
        return found
    places = ((a, True), (b, False))
    derivatives = [[end.derivative(float(last), k) for k in range(4)] for end, last in places]
    shifts = np.array([end.noise(last) for end, last in places])
    moves, sizes = zip(*(_moves(own, noise) for own, noise in zip(derivatives, shifts, strict=True)), strict=True)
    lengths = np.linalg.norm(derivatives, axis=2)
    geometric = _limits(shifts[:, 0].sum(), np.sum(moves, axis=0), np.max(sizes, axis=0))
    parametric = _limits(shifts[:, 0].sum(), shifts[:, 1:].sum(axis=0), lengths[:, 1:].max(axis=0))
    return replace(
        found,
        geometric_order=check_join(a, b, thresholds=geometric).geometric_order,
        parametric_order=check_join(a, b, thresholds=parametric).parametric_order,
    )


def _moves(derivatives: Sequence[Array], noise: Array) -> tuple[Array, Array]:
    """How far tangent, curvature vector and third derivative by length move, and how long they are: both (3,)."""
    _, d1, d2, d3 = noise.tolist()
    _, first, second, third = derivatives
    speed = float(np.linalg.norm(first))
    tangent, tilt = first / speed, d1 / speed
    pace = float(tangent @ second)
    bend = (second - pace * tangent) / speed**2
    curvature = float(np.linalg.norm(bend))
    jerk = float(tangent @ third) + speed**3 * curvature**2
    rate = (third - 3 * pace * speed * bend - jerk * tangent) / speed**3
    of_pace = d2 + tilt * float(np.linalg.norm(second))
    of_bend = (d2 + 2 * tilt * float(np.linalg.norm(second))) / speed**2 + 2 * tilt * curvature
    of_jerk = d3 + tilt * float(np.linalg.norm(third)) + 3 * speed**2 * d1 * curvature**2
    of_jerk += 2 * speed**3 * curvature * of_bend
    of_rate = d3 + of_jerk + abs(jerk) * tilt
    of_rate += 3 * (of_pace * speed * curvature + abs(pace) * (d1 * curvature + speed * of_bend))
    of_rate = of_rate / speed**3 + 3 * tilt * float(np.linalg.norm(rate))
    return np.array([tilt, of_bend, of_rate]), np.array([1.0, curvature, float(np.linalg.norm(rate))])


def _limits(gap: float, moves: Array, sizes: Array) -> Thresholds:
    """The usual ones and, relative to the sizes, what is moved."""
    usual = Thresholds()
    angle, curvature, rate = (moves / np.maximum(sizes, np.finfo(float).tiny)).tolist()
    angle_deg = usual.angle_deg + float(np.rad2deg(angle))
    return Thresholds(usual.gap + float(gap), angle_deg, usual.curvature + curvature, usual.curvature_rate + rate)
