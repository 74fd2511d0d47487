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

from gtcad._plane_contact import STILL, Local, Weights, angle_deg, fitted, gap, largest, relative, seen_from
from gtcad.basis import GT, Basis, Family, checked_gamma
from gtcad.continuity import PARAMETRIC, Scale, Start, Thresholds, chain_rule, checked_rest, meets_order, parsed_order
from gtcad.errors import InputError, SingularJoin
from gtcad.patches.developable import PlaneFamily

Array = NDArray[np.float64]

PLAIN: Weights = (1.0, 0.0, 0.0, 0.0)
BETA, FARIN_BOEHM = "G2 beta", "Farin-Boehm G2"

_THRESHOLDS = Thresholds()
_SAME = 1e-9  # relative jump of derivatives that are equal
_INVISIBLE = 1e-5  # of the largest that a derivative may be: what is less is compared with so much


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
    _check_families(first=first)
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
    free = checked_rest("planes (a, b, c, d)", rest, (degree - count, 4), f"degree {degree}, {order}")
    return PlaneFamily(np.concatenate([rows, free]), gamma, family)


def _check_families(**families: PlaneFamily) -> None:
    for name, family in families.items():
        if not isinstance(family, PlaneFamily):
            raise InputError(f"{name} must be a PlaneFamily, got {type(family).__name__}")


def _finite(values: object, count: int) -> bool:
    """Whether they are so many finite numbers."""
    try:
        numbers = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        return False
    return numbers.shape == (count,) and bool(np.isfinite(numbers).all())


def _check(order: str, kind: str, scale: Scale, weights: Weights, ratios: tuple[float, float] | None) -> None:
    if not _finite(scale, 3) or not scale[0] > 0:
        raise InputError(f"scale must be three finite numbers (eta, psi, omega) with eta > 0, got {scale}")
    if (kind == "C" or order == FARIN_BOEHM) and tuple(scale) != PARAMETRIC:
        raise InputError(f"scale must be left alone for {order}, got {tuple(scale)}")
    if not _finite(weights, 4) or weights[0] == 0:
        raise InputError(f"weights must be four finite numbers (rho, a_1, a_2, a_3), rho not 0, got {weights}")
    if (kind == "C" or order in (BETA, FARIN_BOEHM)) and tuple(weights) != PLAIN:
        raise InputError(f"weights must be left alone for {order}, got {tuple(weights)}")
    if (order == FARIN_BOEHM) != (ratios is not None):
        raise InputError(f"ratios are for {FARIN_BOEHM} and needed there, got {ratios} for {order}")
    if ratios is not None and (not _finite(ratios, 2) or not min(ratios) > 0):
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
    if order and np.linalg.norm(ends[1]) <= STILL * np.abs(first.control_planes).max():
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
        When a second derivative does not depend on the third control plane, or a ratio is not determined: a leg has no
        length, or d is one of its ends.
    """
    _check_families(first=first, second=second)
    if min(first.degree, second.degree) < 2:
        raise InputError(f"{FARIN_BOEHM} needs degrees of 2 at least, got {first.degree} and {second.degree}")
    (b, middle, last), (start, one, two) = first.control_planes[-3:], second.control_planes[:3]
    legs = np.array([middle - b, last - middle, one - start, two - one])
    # d = middle + x (middle - b) = one - y (two - one)
    system = np.column_stack([legs[0], legs[3]])
    (x, y), *_ = np.linalg.lstsq(system, one - middle, rcond=None)
    lengths = np.linalg.norm(legs, axis=1)
    size = float(lengths.max())
    if lengths.min() <= STILL * size or min(abs(x), abs(y)) <= STILL:
        raise SingularJoin("the ratios at the joint are not determined: control planes next to it coincide", 0.0)
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
        Least jump of the third derivatives that scale factors and weights leave, relative to the larger one, or to 1e-5
        of the largest that it may be.
    scale, weights
        The (eta, psi, omega) and (rho, a_1, a_2, a_3) that fit best; NaN, as is ``third_jump``, when the planes are at
        right angles.
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

    Raises
    ------
    InputError
        When an argument is out of its range.
    SingularJoin
        When a family stands still at the joint: it has no ruling there.

    Examples
    --------
    >>> first = PlaneFamily([[1, 0, 0, 9], [1, 1, 0.1, 9], [0, 1, 0, 9]])
    >>> scale, weights = (2.0, 0.3, 0.0), (-0.5, 0.1, 0.2, 0.0)
    >>> second = join_planes(first, 3, order="G2", scale=scale, weights=weights, rest=[[-1, 0, 0, 9]])
    >>> check_plane_join(first, second).order
    'G2'
    """
    _check_families(a=a, b=b)
    if not (_finite([reach], 1) and reach > 0):
        raise InputError(f"reach must be a finite length above 0, got {reach}")
    before, after = (np.array([one.derivative(t, k) for k in range(4)]) for one, t in ((a, 1.0), (b, 0.0)))
    here, there = Local.of(before), Local.of(after)
    plane_angle = angle_deg(here.normal, there.normal * math.copysign(1, here.normal @ there.normal))
    plane_gap = float(abs(there.normal @ here.foot - there.offset))
    ruling_angle = angle_deg(here.ruling, there.ruling)
    away = here.foot - there.foot
    ruling_gap = float(np.linalg.norm(away - (away @ there.ruling) * there.ruling))
    first, second = (one.radius_at(here.foot, here.ruling, reach) for one in (here, there))
    curvature = relative(first, second)
    before, after = (seen_from(here.foot, reach, planes) for planes in (before, after))
    least = [_INVISIBLE * largest(one, here.foot, reach) for one in (a, b)]
    scale, weights, third = fitted(before, after, (float(least[0][3]), float(least[1][3])))
    jumps = [relative(x, y, float(z)) for x, y, z in zip(before, after, np.maximum(*least), strict=True)]
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
        gap(here.regression, there.regression),
        curvature,
        third,
        scale,
        weights,
        _reached([jump <= _SAME for jump in jumps]),
        geometric,
        geometric >= 2 and plain,
    )


def _reached(met: Sequence[bool]) -> int:
    return next((k for k, one in enumerate(met) if not one), len(met)) - 1
