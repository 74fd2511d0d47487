"""Derivatives of curves and of surface normals at regular and singular points, for differential.py."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Places = NDArray[np.intp]

AT_END = 1e-9  # parameters as close as this to 0 or 1 have limits from inside only
_VANISHING = 1e-12  # of the largest value on the shape
_HIGHEST_POWER = 4  # r of a singular point, at most; the third derivative by delta^r then needs order 12
_HIGHEST_BEND = 6


class ParametricCurve(Protocol):
    """Anything with derivatives in one parameter on [0, 1], order 0 the point."""

    @property
    def dimension(self) -> int:
        """Space dimension, 2 or 3."""
        ...

    def derivative(self, t: ArrayLike, order: int = 1) -> Array:
        """Derivatives of the order, shape t.shape + (d,)."""
        ...


class ParametricSurface(Protocol):
    """Anything with partial derivatives in two parameters on [0, 1], orders (0, 0) the point."""

    @property
    def dimension(self) -> int:
        """Space dimension, 2 or 3."""
        ...

    def derivative(self, u: ArrayLike, v: ArrayLike, orders: tuple[int, int] = (1, 0)) -> Array:
        """Partial derivatives of the orders, shape broadcast(u, v).shape + (d,)."""
        ...


@dataclass(frozen=True)
class CurveJets:
    """Derivatives C', C'', ... at flat parameters, by a regular parameter also where C' vanishes.

    Attributes
    ----------
    t
        Parameters, shape (size,).
    derivatives
        Shape (count, size, 3), NaN where there is no regular parameter.
    noise
        What counts as vanishing for each of them, shape (count, size).
    regular
        Where C' does not vanish: derivatives are those by t.
    reverses
        Interior points where the direction of travel jumps to its opposite.
    cusp
        Where the curvature tends to infinity.
    """

    t: Array
    derivatives: Array
    noise: Array
    regular: Mask
    reverses: Mask
    cusp: Mask

    @property
    def speed(self) -> Array:
        """|C'|."""
        return norm(self.derivatives[0])

    @property
    def tangent(self) -> Array:
        """Unit tangents, NaN where the travel reverses."""
        return np.asarray(np.where(self.reverses, np.nan, 1 / self.speed)[:, None] * self.derivatives[0])

    def across(self, order: int) -> tuple[Array, Mask]:
        """``C' x C^(order) / |C'|^(order + 1)``, kappa B for order 2, and where it vanishes."""
        first, other, speed = self.derivatives[0], self.derivatives[order - 1], self.speed
        values = np.cross(first / speed[:, None], other / speed[:, None] ** order)
        level = self.noise[order - 1] + norm(other) * self.noise[0] / speed
        return values, norm(values) * speed**order <= level

    @property
    def stretch(self) -> Array:
        """``C'.C'' / |C'|^3``: how fast the speed changes with arc length, relatively."""
        return np.asarray((self.derivatives[0] * self.derivatives[1]).sum(axis=1) / self.speed**3)


def curve_jets(curve: ParametricCurve, t: ArrayLike, count: int) -> CurveJets:
    """The first derivatives, ``count`` of them, of a curve at t."""
    flat = np.asarray(t, dtype=np.float64).reshape(-1)
    derivatives = np.stack([space(curve.derivative(flat, order)) for order in range(1, count + 1)])
    noise = np.repeat(curve_noise(curve, count)[:, None], flat.size, axis=1)
    singular = norm(derivatives[0]) <= noise[0]
    jets = CurveJets(flat, derivatives, noise, ~singular, np.zeros_like(singular), np.zeros_like(singular))
    if singular.any():
        _regularise(curve, jets, np.flatnonzero(singular))
    return jets


def _regularise(curve: ParametricCurve, jets: CurveJets, places: Places) -> None:
    """Put derivatives by w = +-delta^r, growing in the direction of travel, in place of those by t.

    With ``C = sum_k a_k delta^k`` and a_r the first that does not vanish, the first derivative by w is a_r. The
    second is 2 a_2r when the terms between are parallel to a_r (else the curvature is infinite), the third 6 a_3r
    when all terms between vanish.
    """
    count = len(jets.derivatives)
    orders = range(1, _HIGHEST_POWER * count + 1)
    factorials = np.array([math.factorial(k) for k in orders], dtype=np.float64)
    taylor = np.stack([space(curve.derivative(jets.t[places], k)) for k in orders]) / factorials[:, None, None]
    noise = curve_noise(curve, len(orders)) / factorials
    small = norm(taylor) <= noise[:, None]
    jets.derivatives[:, places] = np.nan
    for r in range(2, _HIGHEST_POWER + 1):
        here = small[: r - 1].all(axis=0) & ~small[r - 1]
        at, a, vanishing = places[here], taylor[:, here], small[:, here]
        inside, at_end = _sides(jets.t[at])
        between, level = a[r : 2 * r - 1], noise[r : 2 * r - 1, None]
        level = level * norm(a[r - 1]) + noise[r - 1] * norm(between)
        parallel = np.asarray((norm(np.cross(a[r - 1], between)) <= level).all(axis=0))
        mixed = [k - 1 for k in range(1, 3 * r) if k % r and k <= len(a)]
        known = (np.ones_like(parallel), parallel, np.asarray(vanishing[mixed].all(axis=0)))
        sign = np.where(at_end, (-1.0) ** (r + 1), 1.0)
        for k in range(1, count + 1):
            values = (sign**k * math.factorial(k))[:, None] * a[r * k - 1]
            jets.derivatives[k - 1, at] = np.where(known[k - 1][:, None], values, np.nan)
            jets.noise[k - 1, at] = math.factorial(k) * noise[r * k - 1]
        jets.cusp[at] = ~parallel
        jets.reverses[at] = inside & (r % 2 == 0)


def first_bend(curve: ParametricCurve, t: Array) -> Array:
    """A vector along the limit of B where the curvature vanishes, from the first C' x C^(k) that does not."""
    first, noise = space(curve.derivative(t, 1)), curve_noise(curve, _HIGHEST_BEND)
    inside, at_end = _sides(t)
    bend = np.full((t.size, 3), np.nan)
    unknown = np.ones(t.size, dtype=bool)
    for order in range(3, _HIGHEST_BEND + 1):
        other = space(curve.derivative(t, order))
        values = np.cross(first, other)
        found = unknown & (norm(values) > noise[order - 1] * norm(first) + noise[0] * norm(other))
        odd = order % 2 == 1
        side = np.where(inside & odd, np.nan, np.where(at_end & odd, -1.0, 1.0))
        bend[found] = (values * side[:, None])[found]
        unknown &= ~found
    return bend


def _sides(t: Array) -> tuple[Mask, Mask]:
    """Which parameters are inside the domain, and which at its end."""
    at_end = t >= 1 - AT_END
    return ~at_end & (t > AT_END), at_end


def curve_noise(curve: ParametricCurve, count: int) -> Array:
    """What counts as vanishing for the derivatives of the orders 1..count, shape (count,)."""
    t = np.linspace(0, 1, 33)
    size, *largest = (norm(curve.derivative(t, order)).max() for order in range(count + 1))
    return np.asarray(_VANISHING * (np.array(largest) + size))


_LINES = {"u": ((1, 0), (2, 0), (3, 0)), "v": ((0, 1), (0, 2), (0, 3)), "both": ((1, 1),)}


def crossed(surface: ParametricSurface, u: ArrayLike, v: ArrayLike, orders: tuple[int, int] = (0, 0)) -> Array:
    """Partial derivatives of S_u x S_v by Leibniz' rule, shape broadcast(u, v).shape + (3,)."""

    def partial(i: int, j: int) -> Array:
        return space(surface.derivative(u, v, (i, j)))

    return np.asarray(
        sum(
            factor * np.cross(partial(i + 1, j), partial(orders[0] - i, orders[1] - j + 1))
            for i, j, factor in _leibniz(orders)
        )
    )


def crossed_noise(surface: ParametricSurface, orders: tuple[int, int] = (0, 0)) -> float:
    """What counts as vanishing for ``crossed`` of those orders."""
    t = np.linspace(0, 1, 9)

    def largest(i: int, j: int) -> float:
        return float(norm(surface.derivative(t[:, None], t[None, :], (i, j))).max())

    size, total = largest(0, 0), 0.0
    for i, j, factor in _leibniz(orders):
        left, right = largest(i + 1, j), largest(orders[0] - i, orders[1] - j + 1)
        total += factor * (left * right + size * (left + right) / 8)
    return _VANISHING * total


def _leibniz(orders: tuple[int, int]) -> list[tuple[int, int, int]]:
    m, n = orders
    return [(i, j, math.comb(m, i) * math.comb(n, j)) for i in range(m + 1) for j in range(n + 1)]


def limit_normals(surface: ParametricSurface, u: Array, v: Array) -> Array:
    """Limits of the unit normal along the isoparametric lines where S_u x S_v vanishes, NaN where they differ."""
    along_u, along_v = (_along(surface, u, v, _LINES[line]) for line in ("u", "v"))
    both = _along(surface, u, v, _LINES["both"])
    none_u, none_v = ((line == 0).all(axis=1) for line in (along_u, along_v))
    agree = norm(along_u - along_v) <= 1e-9
    result = np.where(agree[:, None], along_u, np.nan)
    result = np.where(none_u[:, None], along_v, np.where(none_v[:, None], along_u, result))
    result = np.where((none_u & none_v)[:, None], both, result)
    return np.where((norm(result) > 0)[:, None], result, np.nan)


def _along(surface: ParametricSurface, u: Array, v: Array, line: tuple[tuple[int, int], ...]) -> Array:
    """Unit limit of the normal along a line into the domain: 0 where unknown, NaN where it flips."""
    result = np.zeros((u.size, 3))
    (inside_u, at_end_u), (inside_v, at_end_v) = _sides(u), _sides(v)
    for i, j in line:
        values = crossed(surface, u, v, (i, j))
        found = (norm(values) > crossed_noise(surface, (i, j))) & (result == 0).all(axis=1)
        flips = (inside_u & (i % 2 == 1)) | (inside_v & (j % 2 == 1))
        sign = np.where(at_end_u & (i % 2 == 1), -1.0, 1.0) * np.where(at_end_v & (j % 2 == 1), -1.0, 1.0)
        unit = values / norm(values)[:, None] * np.where(flips, np.nan, sign)[:, None]
        result[found] = unit[found]
    return result


def space(vectors: Array) -> Array:
    """Plane vectors with z = 0, others as they are."""
    if vectors.shape[-1] == 3:
        return vectors
    return np.concatenate([vectors, np.zeros((*vectors.shape[:-1], 1))], axis=-1)


def norm(vectors: Array) -> Array:
    """Euclidean norms along the last axis."""
    return np.asarray(np.sqrt(np.einsum("...d,...d->...", vectors, vectors)))
