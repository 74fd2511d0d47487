"""B-splines at many digits by de Boor's recursion on the poles as they stand: independent of the package."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mpmath as mp
import numpy as np

from gtcad.converters.bspline import BSplineCurve, BSplineSurface
from tests import reference


def basis(flat: Sequence[float], degree: int, x: Any) -> dict[int, Any]:
    """The basis functions that do not vanish at x, by their index, as mpf."""
    last = max(k for k in range(degree, len(flat) - degree - 1) if flat[k] <= x or k == degree)
    values = {last: mp.mpf(1)}
    for p in range(1, degree + 1):
        raised = {}
        for i in range(last - p, last + 1):
            total = mp.mpf(0)
            if i in values:
                total += (x - flat[i]) / (mp.mpf(flat[i + p]) - flat[i]) * values[i]
            if i + 1 in values:
                total += (flat[i + p + 1] - x) / (mp.mpf(flat[i + p + 1]) - flat[i + 1]) * values[i + 1]
            raised[i] = total
        values = raised
    return values


def exact_point(spline: Any, x: float) -> list[Any]:
    """The point of a spline curve, rational or not, at the digits that mpmath is set to."""
    near = basis(spline.flat_knots.tolist(), spline.degree, mp.mpf(x))
    unit = np.ones(len(spline.control_points)) if spline.weights is None else spline.weights
    shares = {i: value * mp.mpf(float(unit[i])) for i, value in near.items()}
    total = mp.fsum(shares.values())
    return [
        mp.fsum(share * mp.mpf(float(spline.control_points[i, k])) for i, share in shares.items()) / total
        for k in range(spline.dimension)
    ]


def curve_error(curve: Any, spline: Any, t: float, at: Any = None) -> float:
    """|curve(at) - spline(t)| at 50 digits; at = t unless given."""
    with mp.workdps(reference.DIGITS):
        at = mp.mpf(t) if at is None else at
        weights = reference.values(curve.family.name, curve.degree, curve.gamma, at)
        near = basis(spline.flat_knots.tolist(), spline.degree, mp.mpf(t))
        unit = np.ones(len(spline.control_points)) if spline.weights is None else spline.weights
        denominator = mp.fsum(value * float(unit[i]) for i, value in near.items())
        total = mp.mpf(0)
        for k in range(curve.dimension):
            model = mp.fsum(w * float(p) for w, p in zip(weights, curve.control_points[:, k], strict=True))
            held = mp.fsum(v * float(unit[i]) * float(spline.control_points[i, k]) for i, v in near.items())
            total += (model - held / denominator) ** 2
        return float(mp.sqrt(total))


def surface_error(surface: Any, spline: Any, u: float, v: float) -> float:
    """|surface(u, v) - spline(u, v)| at 50 digits, for a polynomial spline."""
    with mp.workdps(reference.DIGITS):
        rows = [
            reference.values(family.name, degree, gamma, mp.mpf(t))
            for family, degree, gamma, t in (
                (surface.family_u, surface.degrees[0], surface.gamma_u, u),
                (surface.family_v, surface.degrees[1], surface.gamma_v, v),
            )
        ]
        near_u = basis(spline.flat_knots_u.tolist(), spline.degree_u, mp.mpf(u))
        near_v = basis(spline.flat_knots_v.tolist(), spline.degree_v, mp.mpf(v))
        total = mp.mpf(0)
        for k in range(3):
            model = mp.fsum(
                a * b * float(surface.control_points[i, j, k])
                for i, a in enumerate(rows[0])
                for j, b in enumerate(rows[1])
            )
            held = mp.fsum(
                a * b * float(spline.control_points[i, j, k]) for i, a in near_u.items() for j, b in near_v.items()
            )
            total += (model - held) ** 2
        return float(mp.sqrt(total))


# --- in ordinary numbers: any splines, and their points ---------------------------------------------------------------

PLACES = np.linspace(0, 1, 121)


def random_knots(rng, degree, ends=(0.0, 1.0)):
    inner = np.sort(rng.choice(np.linspace(*ends, 23)[1:-1], int(rng.integers(0, 5)), replace=False))
    counts = [degree + 1, *rng.integers(1, degree + 1, len(inner)).tolist(), degree + 1]
    return [ends[0], *inner, ends[1]], counts


def random_curve(rng, rational, ends=(0.0, 1.0)):
    degree = int(rng.integers(1, 6))
    knots, counts = random_knots(rng, degree, ends)
    count = sum(counts) - degree - 1
    weights = rng.uniform(0.6, 1.6, count) if rational else None
    return BSplineCurve(rng.normal(size=(count, 3)), knots, counts, degree, weights)


def random_surface(rng, rational, ends=(0.0, 1.0)):
    degrees = [int(n) for n in rng.integers(1, 5, 2)]
    u, v = (random_knots(rng, degree, ends) for degree in degrees)
    shape = tuple(sum(counts) - degree - 1 for (_, counts), degree in zip((u, v), degrees, strict=True))
    weights = rng.uniform(0.6, 1.6, shape) if rational else None
    return BSplineSurface(rng.normal(size=(*shape, 3)), *u, degrees[0], *v, degrees[1], weights)


def points(spline, x=PLACES):
    """Over the domain, at places on [0, 1] in each direction."""
    if isinstance(spline, BSplineCurve):
        return spline.evaluate(np.interp(x, [0, 1], spline.domain))
    (u0, u1), (v0, v1) = spline.domain
    return spline.evaluate((u0 + (u1 - u0) * x)[:, None], (v0 + (v1 - v0) * x)[None, :])
