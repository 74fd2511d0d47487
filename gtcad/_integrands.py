"""What objectives integrate: formulas of derivatives, for many shapes at once, for real and complex numbers alike.

Complex ones carry a derivative: ``Im f(x + i h) / h`` with h = 1e-30 is f' to rounding.

References
----------
W. Squire, G. Trapp, Using complex variables to estimate derivatives of real functions, SIAM Rev. 40 (1998) 110-112.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Numbers = NDArray[Any]
_STILL = 1e-24  # of the square of the other boundary's speed

Form = tuple[tuple[float, int, int], ...]


@dataclass(frozen=True)
class Integrand:
    """What an objective integrates over the parameters.

    Attributes
    ----------
    formula
        For people.
    highest
        Of the derivatives: those of a curve are C', C'', ... up to it; those of a patch S_u, S_v and with 2 also S_uu,
        S_uv, S_vv.
    values
        From derivatives, shape (derivatives, ..., d), to values, shape (...).
    form
        Weights and places of pairs of derivatives when the values are the sum of their dot products.
    """

    formula: str
    highest: int
    values: Callable[[Numbers], Numbers]
    form: Form | None = None


def _dot(a: Numbers, b: Numbers) -> Numbers:
    return np.asarray((a * b).sum(axis=-1))


def _sum_of_products(formula: str, highest: int, form: Form) -> Integrand:
    def values(jets: Numbers) -> Numbers:
        return np.asarray(sum(weight * _dot(jets[i], jets[k]) for weight, i, k in form))

    return Integrand(formula, highest, values, form)


def _speed(jets: Numbers) -> Numbers:
    return np.sqrt(_dot(jets[0], jets[0]))


def _across(vector: Numbers, along: Numbers) -> Numbers:
    """The part of a vector at right angles to another."""
    return vector - (_dot(vector, along) / _dot(along, along))[..., None] * along


def _curvature_energy(jets: Numbers) -> Numbers:
    """``kappa = |b| / |C'|^2`` with b the part of C'' across C'."""
    bend = _across(jets[1], jets[0])
    return np.asarray(_dot(bend, bend) / _speed(jets) ** 3)


def _curvature_variation(jets: Numbers) -> Numbers:
    """``kappa' = (b.c) / (|b| |C'|^2) - 3 |b| (C'.C'') / |C'|^4``, c the part of C''' across C'; |c| where b = 0."""
    first, second, third = jets
    bend, change = _across(second, first), _across(third, first)
    square, size = _dot(first, first), _dot(bend, bend)
    straight = size == 0
    size = np.sqrt(np.where(straight, 1.0, size))
    rate = _dot(bend, change) / (size * square) - 3 * size * _dot(first, second) / square**2
    at_inflection = _dot(change, change) / square**2
    return np.asarray(np.where(straight, at_inflection, rate**2) / np.sqrt(square))


CURVE: dict[str, Integrand] = {
    "dirichlet": _sum_of_products("1/2 int |C'|^2 dt", 1, ((0.5, 0, 0),)),
    "length": Integrand("int |C'| dt", 1, _speed),
    "energy": _sum_of_products("int |C''|^2 dt", 2, ((1.0, 1, 1),)),
    "variation": _sum_of_products("int |C'''|^2 dt", 3, ((1.0, 2, 2),)),
    "curvature-energy": Integrand("int kappa^2 ds", 2, _curvature_energy),
    "curvature-variation": Integrand("int (d kappa / ds)^2 ds", 3, _curvature_variation),
}


def _area(jets: Numbers) -> Numbers:
    s_u, s_v = jets[0], jets[1]
    if jets.shape[-1] == 2:
        return np.asarray(np.sqrt((s_u[..., 0] * s_v[..., 1] - s_u[..., 1] * s_v[..., 0]) ** 2))
    crossed = np.cross(s_u, s_v)
    return np.sqrt(_dot(crossed, crossed))


PATCH: dict[str, Integrand] = {
    "dirichlet": _sum_of_products("1/2 int |S_u|^2 + |S_v|^2 du dv", 1, ((0.5, 0, 0), (0.5, 1, 1))),
    "area": Integrand("int |S_u x S_v| du dv", 1, _area),
    "bending": _sum_of_products(
        "int |S_uu|^2 + 2 |S_uv|^2 + |S_vv|^2 du dv", 2, ((1.0, 2, 2), (2.0, 3, 3), (1.0, 4, 4))
    ),
    "quasi-harmonic": _sum_of_products("int |S_uu + S_vv|^2 du dv", 2, ((1.0, 2, 2), (2.0, 2, 4), (1.0, 4, 4))),
}


def _of_lines(a: Numbers, b: Numbers, values: Numbers) -> Numbers:
    """The values; 0 where a boundary stands still but for rounding, as at the apex of a cone: nothing twists there."""
    first, second = np.real(_dot(a, a)), np.real(_dot(b, b))
    return np.asarray(np.where(np.minimum(first, second) <= _STILL * np.maximum(first, second), 0.0, values))


def _developability(jets: Numbers) -> Numbers:
    a, b, across = jets
    volume = _dot(np.cross(a, b), across)
    return _of_lines(a, b, volume**2 / (_dot(a, a) * _dot(b, b) * _dot(across, across)))


def _twist(jets: Numbers) -> Numbers:
    """``tan(angle / 2) = sin / (1 + cos)``."""
    a, b, across = jets
    sine = np.sqrt(_dot(across, across)) * _dot(np.cross(a, b), across)
    cosine = _dot(np.cross(across, a), np.cross(across, b))
    angle = 2 * np.arctan(sine / (np.sqrt(sine**2 + cosine**2) + cosine))
    turned_over = (sine == 0) & (np.real(cosine) < 0)
    return _of_lines(a, b, np.where(turned_over, math.pi, angle) ** 2)


STRIP: dict[str, Integrand] = {
    "developability": Integrand("int (det(a', b', r) / (|a'| |b'| |r|))^2 du", 1, _developability),
    "twist": Integrand("int (angle between the normals at both ends of a ruling)^2 du", 1, _twist),
}


def regression_jets(planes: Numbers, highest: int) -> Numbers:
    """Derivatives 1..highest of the edge of regression E of planes (n, d), from theirs of orders 0..highest + 2.

    ``n^(r).E = d^(r)`` for r = 0, 1, 2, and by Leibniz' rule for the k-th derivative of each

        ``n^(r).E^(k) = d^(r+k) - sum_(j>=1) binomial(k, j) n^(r+j).E^(k-j)``,

    solved by Cramer's rule. Shape (highest, ..., 3).
    """
    normals, offsets = planes[..., :3], planes[..., 3]
    columns = [np.cross(normals[(r + 1) % 3], normals[(r + 2) % 3]) for r in range(3)]
    determinant = _dot(normals[0], columns[0])
    edge: list[Numbers] = []
    for k in range(highest + 1):
        rows = [
            offsets[r + k] - sum(math.comb(k, j) * _dot(normals[r + j], edge[k - j]) for j in range(1, k + 1))
            for r in range(3)
        ]
        point = sum(row[..., None] * column for row, column in zip(rows, columns, strict=True))
        edge.append(np.asarray(point / determinant[..., None]))
    return np.stack(edge[1:])
