"""One patch or more of each kind, with its definition as a formula at many digits."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import mpmath as mp

from gtcad import BERNSTEIN, Curve, Restricted
from gtcad.factors import CurveOfTerms, Waves
from gtcad.patches import Coons, Lofted, Plateau, Rotation, Ruled, Swept, Swung, TBCoons, cone, cylinder
from gtcad.protocol import SeparableCurve, SeparableSurface
from gtcad.restricted import RestrictedCurve
from tests import reference

Point = list[Any]
Formula = Callable[[Any, Any], Point]


@dataclass(frozen=True)
class Sample:
    name: str
    patch: SeparableSurface
    formula: Formula
    size: float = 100.0  # of its coordinates


def line(a: Sequence[float], b: Sequence[float]) -> Curve:
    return Curve([a, b], family=BERNSTEIN)


def point(curve: SeparableCurve, t: Any) -> Point:
    """C(t) from the basis' recursion at many digits."""
    if isinstance(curve, RestrictedCurve):
        start, end = (mp.mpf(x) for x in curve.range)
        return point(curve.shape, start + (end - start) * t)
    if isinstance(curve, Curve):
        values = reference.values(curve.family.name, curve.degree, curve.gamma, t)
    else:
        angle = mp.mpf(curve.factors.start) + mp.mpf(curve.factors.sweep) * t
        values = [mp.mpf(1), mp.cos(angle), mp.sin(angle)]
    columns = zip(*curve.coefficients.tolist(), strict=True)
    return [mp.fsum(f * mp.mpf(x) for f, x in zip(values, column, strict=True)) for column in columns]


def blend(*terms: tuple[Any, Point]) -> Point:
    weights, points = zip(*terms, strict=True)
    return [mp.fdot(weights, axis) for axis in zip(*points, strict=True)]


def turned(p: Point, center: Point, axis: Point, angle: Any) -> Point:
    """Rodrigues' formula."""
    k = [x / mp.norm(axis) for x in axis]
    r = [a - b for a, b in zip(p, center, strict=True)]
    cross = [k[1] * r[2] - k[2] * r[1], k[2] * r[0] - k[0] * r[2], k[0] * r[1] - k[1] * r[0]]
    along = mp.fsum(a * b for a, b in zip(k, r, strict=True))
    return blend((1, center), (mp.cos(angle), r), (mp.sin(angle), cross), (along * (1 - mp.cos(angle)), k))


def partial(formula: Formula, u: float, v: float, orders: tuple[int, int]) -> list[float]:
    """The partial derivative from central differences at many digits: 1e-19 of the next but one derivative off."""
    with mp.workdps(reference.DIGITS):
        step = mp.mpf(10) ** -10
        total = [mp.mpf(0)] * 3
        for i, j in itertools.product(*(range(order + 1) for order in orders)):
            weight = (-1) ** (i + j) * math.comb(orders[0], i) * math.comb(orders[1], j)
            place = (mp.mpf(x) + (mp.mpf(n) / 2 - k) * step for x, n, k in ((u, orders[0], i), (v, orders[1], j)))
            total = blend((1, total), (weight, formula(*place)))
        return [float(x / step ** sum(orders)) for x in total]


WAVE = Curve([[0, 0, 0], [30, 20, 10], [60, -20, 5], [100, 10, 0]], (0.4, -0.6))
OTHER = Curve([[0, 50, 30], [40, 80, 10], [90, 60, 40]], (0.2, 0.7))
RAIL = Curve([[0, 0, 0], [5, 30, 30], [0, 60, -20], [10, 90, 10], [0, 99, 0]], (-0.5, 1.0))
QUARTER = Curve([[40, 0, 0], [40, 40, 0], [0, 40, 0]])
TWISTED = Curve([[0, 90, 0], [20, 80, -10], [70, 120, 5], [90, 99, 30]], (0.4, -0.6))
PART = Restricted(Curve([[60, -10, 0], [10, 20, 5], [50, 40, 30], [20, 20, 80]], (0.3, 0.3)), (0.9, 0.2))
RING = CurveOfTerms(Waves(0.0, 2 * math.pi), [[30, 0, 0], [10, 0, 0], [0, 0, 10]])
HALF = CurveOfTerms(Waves(-math.pi / 2, math.pi), [[0, 0, 0], [20, 0, 0], [0, 0, 20]])
PROFILE = Curve([[30, 0], [50, 20], [20, 50], [40, 80]], (0.3, 0.3))
TRAJECTORY = Curve([[1, 0], [1.2, 1], [0, 1.4]], (0.5, 0.5))
SECTIONS = [
    Curve([[0, y, 0], [30, y, h], [60, y, -h], [90, y, 0]], (0.3, -0.2))
    for y, h in ((0, 40), (30, 80), (60, -10), (90, 30))
]
FRAME = (  # c0, c1, d0, d1
    Curve([[0, 0, 0], [50, 10, 30], [100, 0, 0]]),
    Curve([[0, 90, 10], [50, 100, -40], [100, 100, 20]], (-0.3, 0.3)),
    line([0, 0, 0], [0, 90, 10]),
    Curve([[100, 0, 0], [120, 30, 10], [90, 70, 40], [100, 100, 20]], (0.5, 0)),
)


def _ruled(a: SeparableCurve, b: SeparableCurve) -> Formula:
    return lambda u, v: blend((1 - v, point(a, u)), (v, point(b, u)))


def _rotation(curve: SeparableCurve, center: Point, axis: Point, angle: float, start: float) -> Formula:
    def formula(u: Any, v: Any) -> Point:
        radians = (mp.mpf(start) + mp.mpf(angle) * v) * mp.pi / 180
        return turned(point(curve, u), [mp.mpf(x) for x in center], [mp.mpf(x) for x in axis], radians)

    return formula


def _swung(u: Any, v: Any) -> Point:
    (x, z), (far, along) = point(PROFILE, u), point(TRAJECTORY, v)
    return [mp.mpf(1.5) * x * far, mp.mpf(1.5) * x * along, z]


def _lofted(parameters: Sequence[float]) -> Formula:
    with mp.workdps(reference.DIGITS):
        values = mp.matrix([reference.values("GT", 3, (0.1, -0.9), mp.mpf(v)) for v in parameters])
        inverse = mp.inverse(values)

    def formula(u: Any, v: Any) -> Point:
        functions = mp.matrix([reference.values("GT", 3, (0.1, -0.9), v)])
        cardinal = functions * inverse
        return blend(*((cardinal[k], point(section, u)) for k, section in enumerate(SECTIONS)))

    return formula


def _coons(u: Any, v: Any) -> Point:
    c0, c1, d0, d1 = FRAME
    corners = [((1 - u) * (1 - v), c0, 0), (u * (1 - v), c0, 1), ((1 - u) * v, c1, 0), (u * v, c1, 1)]
    return blend(
        (1 - v, point(c0, u)),
        (v, point(c1, u)),
        (1 - u, point(d0, v)),
        (u, point(d1, v)),
        *((-weight, point(curve, mp.mpf(end))) for weight, curve, end in corners),
    )


INTERIOR = [[[5, 1, 20], [0, 5, -30], [1, 2, 3]], [[-4, 3, 10], [9, 9, 9], [0, 0, 40]]]
TILTS = ((0.4, -0.7), (-1.0, 0.2))


def _plateau(u: Any, v: Any) -> Point:
    along, across = (reference.values("GT", n, g, t) for n, g, t in zip((3, 4), TILTS, (u, v), strict=True))
    inside = [(along[i + 1] * across[j + 1], q) for i, row in enumerate(INTERIOR) for j, q in enumerate(row)]
    return blend((1, _coons(u, v)), *inside)


def _sums(profile: SeparableCurve, trajectory: SeparableCurve) -> Formula:
    return lambda u, v: blend((1, point(profile, u)), (1, point(trajectory, v)))


UNEVEN = (0.0, 0.3, 0.8, 1.0)
APEX = [50.0, 0.0, 80.0]
CENTER, AXIS = [1.0, -2.0, 3.0], [0.3, 0.2, -1.0]
SAMPLES = [
    Sample("ruled", Ruled(WAVE, OTHER), _ruled(WAVE, OTHER)),
    Sample("ruled, one kind", Ruled(WAVE, TWISTED), _ruled(WAVE, TWISTED)),
    Sample("ruled, arc and part", Ruled(HALF, PART), _ruled(HALF, PART)),
    Sample("cylinder", cylinder(QUARTER, [10, 5, 50]), lambda u, v: blend((1, point(QUARTER, u)), (v, [10, 5, 50]))),
    Sample("cone", cone(WAVE, APEX), lambda u, v: blend((1 - v, point(WAVE, u)), (v, APEX))),
    Sample(
        "part of a cone",
        cone(PART, APEX, (1.5, 1.25)),
        lambda u, v: blend((v / 4 - 0.5, point(PART, u)), (1.5 - v / 4, APEX)),
    ),
    Sample("swept", Swept(WAVE, RAIL), _sums(WAVE, RAIL), 200),
    Sample("swept arc", Swept(RING, PART), _sums(RING, PART), 200),
    Sample("swung", Swung(PROFILE, TRAJECTORY, 1.5), _swung, 200),
    Sample("rotation, full", Rotation(RING, [0, 0, 0], [0, 0, 1]), _rotation(RING, [0, 0, 0], [0, 0, 1], 360, 0)),
    Sample("sphere", Rotation(HALF, [0, 0, 0], [0, 0, 2]), _rotation(HALF, [0, 0, 0], [0, 0, 2], 360, 0)),
    Sample("rotation", Rotation(PART, CENTER, AXIS, -200, 77), _rotation(PART, CENTER, AXIS, -200, 77)),
    Sample("rotation, quarter", Rotation(QUARTER, CENTER, AXIS, 90), _rotation(QUARTER, CENTER, AXIS, 90, 0)),
    Sample("rotation, part", Rotation(WAVE, CENTER, AXIS, -50, 10), _rotation(WAVE, CENTER, AXIS, -50, 10)),
    Sample("lofted", Lofted(SECTIONS, UNEVEN, (0.1, -0.9)), _lofted(UNEVEN)),
    Sample("coons", Coons(*FRAME), _coons),
    Sample("plateau", Plateau(*FRAME, INTERIOR, *TILTS), _plateau),
    Sample("tb_coons", TBCoons(*FRAME), _coons),
]
NAMES = [sample.name for sample in SAMPLES]
