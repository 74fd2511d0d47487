"""Joins of plane families, and so of the developables that they envelop, to C3 and G3: constructed, and checked.

Planes are 4-vectors R = (n, d) up to a factor. With D_k the k-th derivatives of the first family at its end, after a
change of the parameter with the scale factors (eta, psi, omega) of ``gtcad.continuity``,

    R = rho D_0,  R' = rho (D_1 + a_1 D_0),  R'' = rho (D_2 + 2 a_1 D_1 + a_2 D_0),
    R''' = rho (D_3 + 3 a_1 D_2 + 3 a_2 D_1 + a_3 D_0)

at the start of the second one make a G^k join: G1 has the plane and the ruling in common, G2 also the point of
regression and the principal curvatures along the ruling. C^k means equal derivatives. "G2 beta" is G2 with rho = 1 and
a_k = 0, "Farin-Boehm G2" the same by ratios of lengths between the control planes, as points with four coordinates.

References
----------
S. Maqsood, M. Abbas, K. T. Miura, A. Majeed, G. BiBi, T. Nazir, Geometric modeling and applications of generalized
blended trigonometric Bezier developable surfaces with shape parameters, Adv. Difference Equ. 2021:459.
G. Farin, Curves and Surfaces for CAGD, 5th edition, 2002, chapter 11.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.basis import GT, Basis, Family, checked_gamma
from gtcad.continuity import PARAMETRIC, Scale, Start, Thresholds, chain_rule, meets_order, parsed_order
from gtcad.errors import InputError, SingularJoin
from gtcad.patches.developable import PlaneFamily

Array = NDArray[np.float64]
Weights = tuple[float, float, float, float]

PLAIN: Weights = (1.0, 0.0, 0.0, 0.0)
BETA, FARIN_BOEHM = "G2 beta", "Farin-Boehm G2"

_THRESHOLDS = Thresholds()
_SAME = 1e-9  # relative jump of derivatives that are equal; a weight that is 1 or 0
_STILL = 1e-10  # of the planes' size: a first derivative that leaves the ruling undetermined


def join_planes(
    first: PlaneFamily,
    degree: int,
    *,
    order: str,
    gamma: Sequence[float] = (0.0, 0.0),
    scale: Scale = PARAMETRIC,
    weights: Weights = PLAIN,
    ratios: tuple[float, float] | None = None,
    rest: ArrayLike = (),
    family: Family = GT,
) -> PlaneFamily:
    """The plane family that continues another one.

    Parameters
    ----------
    first
        The family that it joins at its end.
    degree, gamma, family
        Of the new family.
    order
        "C0" to "C3", "G0" to "G3", "G2 beta" or "Farin-Boehm G2".
    scale
        (eta, psi, omega), eta > 0: for G0 to G3 and "G2 beta".
    weights
        (rho, a_1, a_2, a_3), rho not 0: for G0 to G3.
    ratios
        (r, r_minus), both above 0, for "Farin-Boehm G2". With b_i the control planes of the first family, q_i of the
        second and d the common point of the lines b_{n-2} b_{n-1} and q_1 q_2: ``r = |b_{n-1} b_n| / |b_n q_1|`` and
        ``r_minus = |b_{n-2} b_{n-1}| / |b_{n-1} d|``.
    rest
        The control planes after the first k + 1, shape (degree - k, 4).

    Returns
    -------
    PlaneFamily
        Its first k + 1 control planes follow from the join.

    Raises
    ------
    InputError
        When an argument is out of its range, or does not go with the order.
    SingularJoin
        When the first family stands still at its end, or a control plane is not determined, as for curves
        (``gtcad.continuity.join_curve``).

    Examples
    --------
    C1: the first leg of the new control planes continues the last one of the old.

    >>> first = PlaneFamily([[1, 0, 0, 1], [1, 1, 0, 1], [0, 1, 0, 1]])
    >>> join_planes(first, 2, order="C1", rest=[[-1, 0, 0, 1]]).control_planes.round(12).tolist()
    [[0.0, 1.0, 0.0, 1.0], [-1.0, 1.0, 0.0, 1.0], [-1.0, 0.0, 0.0, 1.0]]
    """
    kind, count = ("G", 2) if order in (BETA, FARIN_BOEHM) else parsed_order(order)
    _check(order, kind, scale, weights, ratios)
    basis = Basis(degree, checked_gamma("gamma", gamma, family), family)
    start = Start.of(basis, count)
    if ratios is not None:
        rows = _by_ratios(first, start, *ratios)
    else:
        wanted = _products(weights, count + 1) @ chain_rule(scale, count + 1) @ _ends(first, count)
        rows = np.asarray(np.linalg.solve(start.matrix, wanted))
        rows[0] = wanted[0]
    free = np.asarray(rest, dtype=np.float64).reshape(-1, 4) if np.size(rest) else rows[:0]
    if len(free) != degree - count:
        raise InputError(f"rest must be {degree - count} control planes for degree {degree}, {order}; got {len(free)}")
    return PlaneFamily(np.concatenate([rows, free]), basis.gamma, family)


def _check(order: str, kind: str, scale: Scale, weights: Weights, ratios: tuple[float, float] | None) -> None:
    plain = len(scale) == 3 and tuple(scale) == PARAMETRIC
    if (kind == "C" or order == FARIN_BOEHM) and not plain:
        raise InputError(f"scale must be left alone for {order}, got {tuple(scale)}")
    if len(scale) != 3 or not all(map(math.isfinite, scale)) or not scale[0] > 0:
        raise InputError(f"scale must be three finite numbers (eta, psi, omega) with eta > 0, got {tuple(scale)}")
    if (kind == "C" or order in (BETA, FARIN_BOEHM)) and tuple(weights) != PLAIN:
        raise InputError(f"weights must be left alone for {order}, got {tuple(weights)}")
    if len(weights) != 4 or not all(map(math.isfinite, weights)) or weights[0] == 0:
        raise InputError(f"weights must be four finite numbers (rho, a_1, a_2, a_3), rho not 0, got {tuple(weights)}")
    if (order == FARIN_BOEHM) != (ratios is not None):
        raise InputError(f"ratios are for {FARIN_BOEHM} and needed there, got {ratios} for {order}")
    if ratios is not None and (len(ratios) != 2 or not all(math.isfinite(x) and x > 0 for x in ratios)):
        raise InputError(f"ratios must be two numbers (r, r_minus) above 0, got {ratios}")


def _products(weights: Weights, count: int) -> Array:
    """Matrix from the derivatives of R to those of a multiple of it, by Leibniz' rule, shape (count, count)."""
    rho, *slopes = weights
    parts = [1.0, *slopes]
    return rho * np.array(
        [[math.comb(k, j) * parts[k - j] if j <= k else 0.0 for j in range(count)] for k in range(count)]
    )


def _ends(first: PlaneFamily, order: int) -> Array:
    ends = np.array([first.derivative(1.0, k) for k in range(order + 1)])
    if order and np.linalg.norm(ends[1]) <= _STILL * np.abs(first.control_planes).max():
        raise SingularJoin("the first family stands still at its end: its first derivative vanishes there", 0.0)
    return ends


def _by_ratios(first: PlaneFamily, start: Start, r: float, r_minus: float) -> Array:
    """The first three control planes of a "Farin-Boehm G2" join."""
    if first.degree < 2:
        raise InputError(f"{FARIN_BOEHM} needs a first family of degree 2 at least, got {first.degree}")
    b, middle, last = first.control_planes[-3:]
    r_plus = _needed_ratio(first, start, r, r_minus)
    corner = middle + (middle - b) / r_minus
    second = last + (last - middle) / r
    return np.array([last, second, second + (second - corner) / r_plus])


def _needed_ratio(first: PlaneFamily, start: Start, r: float, r_minus: float) -> float:
    """The r_plus of ``r^2 A2+ / (A1+)^2 = r_minus r_plus A2- / (A1-)^2``, A_k of plane k in the k-th derivative."""
    end = Start.of(Basis(first.degree, first.gamma[::-1], first.family), 2).matrix
    return float(r**2 * start.matrix[2, 2] / start.matrix[1, 1] ** 2 * end[1, 1] ** 2 / (r_minus * end[2, 2]))


@dataclass(frozen=True)
class FarinBoehm:
    """The ratios of two families that meet.

    Attributes
    ----------
    r, r_minus, r_plus
        ``|b_{n-1} b_n| / |b_n q_1|``, ``|b_{n-2} b_{n-1}| / |b_{n-1} d|`` and ``|d q_1| / |q_1 q_2|``, without unit.
    misfit
        Relative difference of r_plus from what "Farin-Boehm G2" asks for.
    apart
        How far the control planes are from being arranged as the ratios suppose (b_{n-1}, b_n, q_1 on one line, d on
        both lines), over the length of the legs.
    """

    r: float
    r_minus: float
    r_plus: float
    misfit: float
    apart: float


def farin_boehm(first: PlaneFamily, second: PlaneFamily) -> FarinBoehm:
    """The ratios between the control planes next to a joint, as points with four coordinates.

    Raises
    ------
    InputError
        When a family has a degree below 2.
    SingularJoin
        When a second derivative does not depend on the third control plane.
    """
    if min(first.degree, second.degree) < 2:
        raise InputError(f"{FARIN_BOEHM} needs degrees of 2 at least, got {first.degree} and {second.degree}")
    (b, middle, last), (start, one, two) = first.control_planes[-3:], second.control_planes[:3]
    legs = np.array([middle - b, last - middle, one - start, two - one])
    # d = middle + x (middle - b) = one - y (two - one)
    system = np.column_stack([legs[0], legs[3]])
    (x, y), *_ = np.linalg.lstsq(system, one - middle, rcond=None)
    size = float(np.linalg.norm(legs, axis=1).max())
    r = float(np.linalg.norm(legs[1]) / np.linalg.norm(legs[2]))
    misses = [last - start, legs[1] - r * legs[2], system @ np.array([x, y]) - (one - middle)]
    apart = max(float(np.linalg.norm(miss)) for miss in misses) / size
    basis = Basis(second.degree, second.gamma, second.family)
    r_plus = _needed_ratio(first, Start.of(basis, 2), r, 1 / float(x))
    return FarinBoehm(r, 1 / float(x), float(y), abs(float(y) / r_plus - 1), apart)


@dataclass(frozen=True)
class PlaneJoinReport:
    """What happens where one family ends and the next begins.

    Attributes
    ----------
    plane_angle_deg
        Angle of the two planes, in degrees, whichever way their normals point.
    plane_gap
        Distance of the second plane from the first ruling's point nearest to the origin, in the model's unit.
    ruling_angle_deg
        Angle of the rulings, in degrees: 180 where the second family runs back.
    ruling_gap
        Distance of the second ruling from that point, in the model's unit.
    regression_gap
        Distance of the points of regression, in the model's unit; 0 when both are at infinity, infinite when one is.
    curvature_jump
        Jump of the radius of curvature across the ruling, a linear function along it, relative: of its value at that
        point and of its slope times ``reach`` together.
    third_jump
        Least jump of the third derivatives that scale factors and weights leave, relative.
    scale, weights
        The (eta, psi, omega) and (rho, a_1, a_2, a_3) that fit best.
    parametric_order, geometric_order
        The highest k of C^k and of G^k within the thresholds; -1 when the planes differ.
    beta
        Whether the join is "G2 beta": G2 with rho = 1 and a_1 = a_2 = 0.
    """

    plane_angle_deg: float
    plane_gap: float
    ruling_angle_deg: float
    ruling_gap: float
    regression_gap: float
    curvature_jump: float
    third_jump: float
    scale: Scale
    weights: Weights
    parametric_order: int
    geometric_order: int
    beta: bool

    @property
    def order(self) -> str:
        """The highest order, "C3" to "C0" or "G0" to "G3", C before G at equal orders; "none" where planes differ."""
        if self.geometric_order < 0:
            return "none"
        c = self.parametric_order >= self.geometric_order
        return f"C{self.parametric_order}" if c else f"G{self.geometric_order}"

    def meets(self, order: str) -> bool:
        """Whether the join is of that order: C^k counts as G^k, and "G2 beta" and "Farin-Boehm G2" are one."""
        if order in (BETA, FARIN_BOEHM):
            return self.beta
        return meets_order(order, self.parametric_order, self.geometric_order)


def check_plane_join(
    a: PlaneFamily, b: PlaneFamily, *, reach: float = 1.0, thresholds: Thresholds = _THRESHOLDS
) -> PlaneJoinReport:
    """What happens where family a ends and family b starts.

    Parameters
    ----------
    a, b
        The families.
    reach
        A length along the ruling, in the model's unit, such as that of the patch: it weighs lengths against angles.
    thresholds
        What still counts as continuous; ``curvature`` is for the radii, ``curvature_rate`` for the third derivatives.

    Examples
    --------
    >>> first = PlaneFamily([[1, 0, 0, 9], [1, 1, 0.1, 9], [0, 1, 0, 9]])
    >>> scale, weights = (2.0, 0.3, 0.0), (-0.5, 0.1, 0.2, 0.0)
    >>> second = join_planes(first, 3, order="G2", scale=scale, weights=weights, rest=[[-1, 0, 0, 9]])
    >>> check_plane_join(first, second).order
    'G2'
    """
    if not (reach > 0 and math.isfinite(reach)):
        raise InputError(f"reach must be a finite length above 0, got {reach}")
    before, after = (np.array([one.derivative(t, k) for k in range(4)]) for one, t in ((a, 1.0), (b, 0.0)))
    here, there = _Local.of(before), _Local.of(after)
    plane_angle = _angle_deg(here.normal, there.normal * np.sign(here.normal @ there.normal))
    plane_gap = float(abs(there.normal @ here.foot - there.offset))
    ruling_angle = _angle_deg(here.ruling, there.ruling)
    away = here.foot - there.foot
    ruling_gap = float(np.linalg.norm(away - (away @ there.ruling) * there.ruling))
    radii = [one.radius_at(here.foot, here.ruling, reach) for one in (here, there)]
    curvature = _relative(*radii)
    scale, weights, third = _fitted(before, after, reach)
    units = np.array([1.0, 1.0, 1.0, 1.0 / reach])
    jumps = [_relative(x * units, y * units) for x, y in zip(before, after, strict=True)]
    measured = [
        plane_angle <= thresholds.angle_deg and plane_gap <= thresholds.gap,
        ruling_angle <= thresholds.angle_deg and ruling_gap <= thresholds.gap,
        curvature <= thresholds.curvature,
        third <= thresholds.curvature_rate,
    ]
    geometric = _reached(measured)
    plain = all(abs(x - y) <= thresholds.curvature for x, y in zip(weights[:3], PLAIN, strict=False))
    return PlaneJoinReport(
        plane_angle,
        plane_gap,
        ruling_angle,
        ruling_gap,
        _gap(here.regression, there.regression),
        curvature,
        third,
        scale,
        weights,
        _reached([jump <= _SAME for jump in jumps]),
        geometric,
        geometric >= 2 and plain,
    )


@dataclass(frozen=True)
class _Local:
    """A family at one parameter: unit normal and ruling, offset, foot, regression point, and its derivatives."""

    normal: Array
    offset: float
    ruling: Array
    foot: Array
    regression: Array | None
    derivatives: Array

    @classmethod
    def of(cls, derivatives: Array) -> _Local:
        (n, slope, bend), (d, rate, change) = derivatives[:3, :3], derivatives[:3, 3]
        along = np.cross(n, slope)
        square, size = float(along @ along), float(np.linalg.norm(n))
        if square <= (_STILL * size * max(float(np.linalg.norm(slope)), _STILL * size)) ** 2:
            raise SingularJoin("a family stands still at the joint: it has no ruling there", 0.0)
        foot = (d * np.cross(slope, along) + rate * np.cross(along, n)) / square
        ruling = along / math.sqrt(square)
        turn = float(bend @ ruling)
        regression = None
        if abs(turn) > _STILL * float(np.linalg.norm(bend)):
            regression = foot + (change - float(bend @ foot)) / turn * ruling
        return cls(n / size, float(d) / size, ruling, foot, regression, derivatives)

    def radius_at(self, point: Array, direction: Array, reach: float) -> Array:
        """The radius of curvature ``|n|^3 (d'' - n''.x) / |n x n'|^2`` at a point, and its slope, along the normal."""
        n, slope, bend = self.derivatives[:3, :3]
        factor = float(np.linalg.norm(n)) ** 3 / float(np.sum(np.cross(n, slope) ** 2))
        at = factor * (self.derivatives[2, 3] - bend @ point)
        return np.concatenate([at * self.normal, -reach * factor * (bend @ direction) * self.normal])


def _fitted(before: Array, after: Array, reach: float) -> tuple[Scale, Weights, float]:
    """Scale factors and weights order by order, and what is left of the third derivatives."""
    units = np.array([1.0, 1.0, 1.0, 1.0 / reach])
    old, new = before * units, after * units
    rho = float(new[0] @ old[0] / (old[0] @ old[0]))
    new = new / rho
    basis = np.column_stack([old[1], old[0]])
    (eta, a_1), *_ = np.linalg.lstsq(basis, new[1], rcond=None)
    known = eta**2 * old[2] + 2 * a_1 * eta * old[1]
    (psi, a_2), *_ = np.linalg.lstsq(basis, new[2] - known, rcond=None)
    known = eta**3 * old[3] + 3 * eta * psi * old[2]
    known = known + 3 * a_1 * (eta**2 * old[2] + psi * old[1]) + 3 * a_2 * eta * old[1]
    (omega, a_3), *_ = np.linalg.lstsq(basis, new[3] - known, rcond=None)
    model = known + omega * old[1] + a_3 * old[0]
    scale = float(eta), float(psi), float(omega)
    return scale, (rho, float(a_1), float(a_2), float(a_3)), _relative(model, new[3])


def _relative(a: Array, b: Array) -> float:
    larger = max(float(np.linalg.norm(a)), float(np.linalg.norm(b)))
    return float(np.linalg.norm(b - a)) / larger if larger else 0.0


def _angle_deg(a: Array, b: Array) -> float:
    """By the chord, which keeps its digits for small angles."""
    return math.degrees(2 * math.asin(min(1.0, float(np.linalg.norm(b - a)) / 2)))


def _gap(a: Array | None, b: Array | None) -> float:
    if a is None or b is None:
        return 0.0 if a is b else math.inf
    return float(np.linalg.norm(b - a))


def _reached(met: Sequence[bool]) -> int:
    return next((k for k, one in enumerate(met) if not one), len(met)) - 1
