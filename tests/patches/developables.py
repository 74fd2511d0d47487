"""Random plane families, and what they envelop at many digits: independent of the code under test."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from typing import Any

import mpmath as mp
import numpy as np

from gtcad import BERNSTEIN, GT
from gtcad.basis import Basis
from gtcad.errors import SingularDevelopable
from gtcad.patches import Enveloping, PlaneFamily
from tests import reference

LOW, HIGH = (0.0, 0.05, 1.0, 0.0), (0.1, 0.0, 1.0, 40.0)


def random_family(seed: int) -> PlaneFamily:
    """Planes that turn through 40 to 120 degrees at a distance of about 50 from the z axis."""
    rng = np.random.default_rng(seed)
    degree = int(rng.integers(2, 7))
    turn = np.cumsum(rng.uniform(0.3, 1, degree + 1))
    turn *= np.radians(rng.uniform(60, 120)) / (0.65 * degree)
    tilt, far = 0.25 + 0.04 * rng.normal(size=degree + 1), 50 + 1.6 * rng.normal(size=degree + 1)
    rows = np.column_stack([np.cos(turn), np.sin(turn), tilt, far]) * rng.uniform(0.7, 1.4, (degree + 1, 1))
    if rng.random() < 0.2:
        return PlaneFamily(rows, family=BERNSTEIN)
    return PlaneFamily(rows, rng.uniform(-0.9, 1, 2), GT)


def regular_patches(count: int, first: int = 0) -> list[Enveloping]:
    """The first patches between LOW and HIGH that are not singular."""
    found: list[Enveloping] = []
    seed = first
    while len(found) < count:
        with contextlib.suppress(SingularDevelopable):
            found.append(random_family(seed).enveloping(LOW, HIGH))
        seed += 1
    return found


def derivatives(family: PlaneFamily, t: Any, order: int) -> list[list[Any]]:
    """(n, d) and its derivatives up to the order, as lists of four mpf."""
    rows = reference.taylor_rows(family.family.name, family.degree, family.gamma, t, order)
    planes = [[mp.mpf(x) for x in row] for row in family.control_planes.tolist()]
    return [
        [
            mp.factorial(k) * mp.fsum(row[k] * plane[j] for row, plane in zip(rows, planes, strict=True))
            for j in range(4)
        ]
        for k in range(order + 1)
    ]


def dot(a: Sequence[Any], b: Sequence[Any]) -> Any:
    return mp.fsum(x * y for x, y in zip(a, b, strict=True))


def cross(a: Sequence[Any], b: Sequence[Any]) -> list[Any]:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def unit(a: Sequence[Any]) -> list[Any]:
    size = mp.sqrt(dot(a, a))
    return [x / size for x in a]


def cut(planes: Sequence[Sequence[Any]], bound: Sequence[float]) -> list[Any]:
    """The point of the ruling on a bounding plane."""
    matrix = mp.matrix([list(plane[:3]) for plane in (*planes[:2], [mp.mpf(x) for x in bound])])
    return list(mp.lu_solve(matrix, mp.matrix([planes[0][3], planes[1][3], mp.mpf(bound[3])])))


def distance(found: Any, expected: Sequence[Any]) -> float:
    pairs = zip(np.ravel(found).tolist(), expected, strict=True)
    return float(mp.sqrt(mp.fsum((mp.mpf(x) - y) ** 2 for x, y in pairs)))


def stretch(family: PlaneFamily, bound: Sequence[float], t: Any) -> Any:
    """``d'' - n''.x`` at the point x of the ruling on a plane: 0 where that is the point of regression."""
    planes = derivatives(family, t, 2)
    return planes[2][3] - dot(planes[2][:3], cut(planes, bound))


def sampled_stretch(family: PlaneFamily, bound: Sequence[float], t: np.ndarray) -> np.ndarray:
    """The same at many parameters, in double precision."""
    basis = Basis(family.degree, family.gamma, family.family)
    planes = np.stack([basis.derivative(t, order) @ family.control_planes for order in range(3)])
    matrices = np.stack([planes[0, :, :3], planes[1, :, :3], np.broadcast_to(bound[:3], (t.size, 3))], axis=1)
    right = np.column_stack([planes[0, :, 3], planes[1, :, 3], np.full(t.size, bound[3])])
    points = np.linalg.solve(matrices, right[..., None])[..., 0]
    return planes[2, :, 3] - np.einsum("td,td->t", planes[2, :, :3], points)


def first_crossing(family: PlaneFamily, bounds: Sequence[Sequence[float]] = (LOW, HIGH)) -> float | None:
    """The first t where the edge of regression meets the patch: a dense search for signs, a root at many digits."""
    t = np.linspace(0, 1, 4001)
    values = [sampled_stretch(family, bound, t) for bound in bounds]
    if values[0][0] * values[1][0] < 0:
        return 0.0
    roots = []
    for bound, one in zip(bounds, values, strict=True):
        changes = np.flatnonzero(one[:-1] * one[1:] < 0)
        if changes.size:
            ends = float(t[changes[0]]), float(t[changes[0] + 1])
            with mp.workdps(30):
                root = mp.findroot(lambda x, bound=bound: stretch(family, bound, x), ends, solver="anderson")
            roots.append(float(root))
    return min(roots, default=None)


def at_start(curve: Any) -> list[Any]:
    """The exact start of a curve of basis functions and Chebyshev series."""
    values = []
    for part in getattr(curve.factors, "parts", (curve.factors,)):
        if isinstance(part, Basis):
            values += [mp.mpf(1)] + [mp.mpf(0)] * (part.count - 1)
        else:
            values += [mp.fsum((-1) ** j * mp.mpf(c) for j, c in enumerate(row)) for row in part.coefficients.tolist()]
    return [
        mp.fsum(x * mp.mpf(c) for x, c in zip(values, column, strict=True)) for column in curve.coefficients.T.tolist()
    ]


def distances(points: Any, u: Any, v: float, boundaries: Any) -> tuple[Any, Any]:
    """Of points from a ruled surface, for v = 0 and 1 from its boundary; and their places u. By Newton."""
    inner, along = 0 < v < 1, np.full(u.size, v)
    for _ in range(6):
        a, b = boundaries(u, 0)
        slope_a, slope_b = boundaries(u, 1)
        miss = points - a - along[:, None] * (b - a)
        tangents = np.stack([slope_a + along[:, None] * (slope_b - slope_a), b - a][: 1 + inner], axis=2)
        steps = (np.linalg.pinv(tangents) @ miss[..., None])[..., 0]
        u = np.clip(u + steps[:, 0], 0, 1)
        if inner:
            along = np.clip(along + steps[:, 1], 0, 1)
    a, b = boundaries(u, 0)
    return np.linalg.norm(points - a - along[:, None] * (b - a), axis=-1), u
