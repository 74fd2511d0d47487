"""The patch of least area among those with one boundary, and proved bounds of the area of a patch."""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gtcad.chebyshev import (
    UNIT_ROUNDOFF,
    evaluation,
    interpolation_tail,
    maximum,
    nodes,
    transform,
)
from gtcad.errors import InputError
from gtcad.measure import Estimate, area
from gtcad.patches._area import AreaFunctional
from gtcad.patches._plateau import Plateau, Setting, setting_of
from gtcad.patches._trial import Trial
from gtcad.protocol import Factors, SeparableSurface
from gtcad.surface import Surface

Array = NDArray[np.float64]

_LEAST_NODES = 32  # of the rule in each direction
_MOST_NODES = 96
_RULE = 1e-10  # relative: what the rule may differ from the adaptive quadrature by
_STEEP = 1e-6  # of the root of the area: the gradient at which the minimum is reached, to about its square
_GAIN = 1e-11  # relative: a step that gains less is the last one
_ROUNDS = 200
_MOST_CELLS = 1000
_NOTHING = 1e-12  # of the square of the largest coordinate: an area that rounding may make
_LEAST_TERMS, _MOST_TERMS = 4, 40
_TAIL = 1e-6  # of the wanted accuracy: what series leave out, by bounds that are far from sharp
_ROUNDING = 64 * UNIT_ROUNDOFF


# --- least area -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class LeastArea:
    """A patch of least area.

    Attributes
    ----------
    patch
        Of the kind, with the boundary, the degrees and the design variables that were given.
    area
        Its area, with an estimate of the error of the quadrature; ``area_bounds`` proves bounds.
    start
        The area of the patch that was given.
    setting
        "free boundary" or "fixed contour".
    gradient
        The norm of the derivative of the area that is left, by coordinates in which half the sum of squares is the
        Dirichlet energy; over the root of the area.
    iterations
        Steps of the trust-region method.
    """

    patch: Surface | Plateau
    area: Estimate
    start: Estimate
    setting: Setting
    gradient: float
    iterations: int


def least_area(patch: Surface | Plateau) -> LeastArea:
    """The patch of least area with the same boundary, degrees and design variables: a local minimum near the patch.

    The area of a Gauss-Legendre rule, with its exact gradient and second derivatives, is minimised over the interior
    control points by a trust-region Newton method; the rule is refined until its area is that of the patch.

    Parameters
    ----------
    patch
        In space. The best start is the Dirichlet extremal, ``dirichlet_extremal`` or ``fixed_contour``.

    Raises
    ------
    InputError
        When the patch is of another kind, or plane.

    Notes
    -----
    The area found is at most the area of the start, and within about 1e-9 of a local minimum among patches of these
    degrees, where the parametrisation hardly matters to the area. It is an upper bound of the least area that a surface
    with this boundary has, up to the error that it carries; nothing is said about how far above it is. Cost: 0.1 s at
    degrees (8, 8).

    References
    ----------
    J. Nocedal, S. J. Wright, Numerical Optimization, 2nd ed., Springer 2006, section 7.1.

    Examples
    --------
    A bump over a flat square goes flat; the boundary stays.

    >>> bump = [[[i, j, 1.0 if (i, j) == (1, 1) else 0.0] for j in range(3)] for i in range(3)]
    >>> found = least_area(Surface(bump))
    >>> found.start > 4, round(found.area, 9), found.setting
    (True, 4.0, 'free boundary')
    """
    if not isinstance(patch, Surface | Plateau):
        raise InputError(f"patch must be a Surface or a Plateau, got {type(patch).__name__}")
    if patch.dimension != 3:
        raise InputError("the area of a plane patch does not depend on its interior: give a patch in space, d = 3")
    start = best = area(patch)
    found, steps, count, steepness = patch, 0, _LEAST_NODES, math.inf
    while True:
        functional = AreaFunctional(_trial_of(found, count))
        unknowns = math.prod(functional.trial.shape)
        if not unknowns:
            return LeastArea(patch, start, start, setting_of(patch), 0.0, 0)
        scale = math.sqrt(max(float(best), np.finfo(float).tiny))
        result = _minimum(functional, unknowns, scale)
        moved = _moved(found, functional, result.x)
        size = area(moved)
        if not size <= best:
            if math.isinf(steepness):  # the patch was at a minimum already
                steepness = float(np.linalg.norm(functional.gradient(np.zeros(unknowns)))) / scale
            break
        found, best, steps = moved, size, steps + int(result.nit)
        steepness = float(np.linalg.norm(result.jac)) / scale
        if abs(size - float(result.fun)) <= _RULE * size or count >= _MOST_NODES:
            break
        count = min(_MOST_NODES, 3 * count // 2)
    return LeastArea(found, best, start, setting_of(patch), steepness, steps)


def _minimum(functional: AreaFunctional, unknowns: int, scale: float) -> Any:
    """What scipy's trust-region method finds from the patch as it is."""
    from scipy.optimize import minimize

    before = [math.inf]

    def stop_when_idle(intermediate_result: Any) -> None:
        now = float(intermediate_result.fun)
        if 0 < before[0] - now <= _GAIN * now:  # steps that were refused gain 0, and a shorter one follows
            raise StopIteration
        before[0] = now

    with np.errstate(all="ignore"):
        return minimize(
            functional.value_and_gradient,
            np.zeros(unknowns),
            jac=True,
            hessp=functional.product,
            method="trust-ncg",
            callback=stop_when_idle,
            options={
                "gtol": _STEEP * scale,
                "maxiter": _ROUNDS,
                "initial_trust_radius": 0.1 * scale,
                "max_trust_radius": scale,
            },
        )


def _trial_of(patch: Surface | Plateau, count: int) -> Trial:
    bases = patch.bases if isinstance(patch, Plateau) else (patch.factors_u, patch.factors_v)
    return Trial.of(patch, *bases, least=count)


def _moved(patch: Surface | Plateau, functional: AreaFunctional, z: Array) -> Surface | Plateau:
    trial = functional.trial
    change = trial.interior(z.reshape(trial.shape) * trial.scale)
    if isinstance(patch, Plateau):
        return patch.with_interior(patch.interior + change)
    points = np.array(patch.control_points)
    points[1:-1, 1:-1] += change
    return Surface(points, patch.gamma_u, patch.gamma_v, patch.family_u, patch.family_v)


# --- proved bounds ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class AreaBounds:
    """Proved bounds of an area.

    Attributes
    ----------
    lower, upper
        ``lower <= area <= upper``, in the square of the model's unit.
    cells
        Into how many rectangles the domain was cut.
    """

    lower: float
    upper: float
    cells: int


def area_bounds(surface: SeparableSurface, *, rtol: float = 1e-9) -> AreaBounds:
    """Proved bounds of the area of a surface.

    On a rectangle of the domain ``|S_u x S_v|^2`` is a polynomial W up to a bounded tail, and with any polynomial q

        |int sqrt(W) - int q| <= max |W - q^2| int 1 / (sqrt(W) + q),

    where both sides are computed from Chebyshev coefficients. q interpolates sqrt(W). Rectangles are quartered where
    that is not good enough, or where the surface is singular: there 0 and ``max sqrt(W)`` are the bounds.

    Parameters
    ----------
    surface
        Any surface of the protocol.
    rtol
        Wanted ``upper / lower - 1``, from 1e-12; the work is bounded, and singular points may leave more.

    Returns
    -------
    AreaBounds
        Tails are proved, and rounding is allowed for by a bound of its own. No samples decide, unlike in
        ``gtcad.measure.area``, whose error is an estimate.

    Raises
    ------
    InputError
        When rtol is out of its range.

    Notes
    -----
    Cost: a few milliseconds; seconds where the patch has singular points, and then about 1e-5 is left.

    Examples
    --------
    A quarter of a tube of radius 1 and length 2: pi.

    >>> from gtcad import BERNSTEIN
    >>> rows = [[x, y, z] for x, y in ((1, 0), (1, 1), (0, 1)) for z in (0, 2)]
    >>> found = area_bounds(Surface(np.reshape(rows, (3, 2, 3)), family_v=BERNSTEIN))
    >>> found.lower < math.pi < found.upper, found.upper - found.lower < 1e-8
    (True, True)
    """
    if not 1e-12 <= rtol < 1:
        raise InputError(f"rtol must lie in [1e-12, 1), got {rtol}")
    shape = surface if surface.dimension == 3 else surface.transformed(np.eye(3, 2))
    nothing = _NOTHING * float(np.abs(shape.coefficients).max(initial=0.0)) ** 2
    cells = [_Cell.of(shape, (0.0, 1.0), (0.0, 1.0), rtol)]
    while True:
        lower, upper = (math.fsum(values) for values in zip(*((c.lower, c.upper) for c in cells), strict=True))
        if upper - lower <= max(rtol * lower, nothing) or len(cells) > _MOST_CELLS:
            return AreaBounds(lower, upper, len(cells))
        heapq.heapify(cells)
        for _ in range(max(1, len(cells) // 8)):
            worst = heapq.heappop(cells)
            for quarter in worst.quarters(shape, rtol):
                heapq.heappush(cells, quarter)


@dataclass(frozen=True)
class _Cell:
    """A rectangle of the domain and the bounds of the area over it."""

    u: tuple[float, float]
    v: tuple[float, float]
    lower: float
    upper: float

    def __lt__(self, other: _Cell) -> bool:
        return self.upper - self.lower > other.upper - other.lower

    @classmethod
    def of(cls, surface: SeparableSurface, u: tuple[float, float], v: tuple[float, float], rtol: float) -> _Cell:
        size = (u[1] - u[0]) * (v[1] - v[0])
        lower, upper = _bounds(surface, u, v, rtol)
        return cls(u, v, size * lower, size * upper)

    def quarters(self, surface: SeparableSurface, rtol: float) -> list[_Cell]:
        halves = [((a, (a + b) / 2), ((a + b) / 2, b)) for a, b in (self.u, self.v)]
        return [_Cell.of(surface, u, v, rtol) for u in halves[0] for v in halves[1]]


@dataclass(frozen=True)
class _Side:
    """Factors on a part of [0, 1], as Chebyshev interpolants up to a tail.

    Attributes
    ----------
    values
        Of the factors and of their first derivatives at Chebyshev nodes, shape (count, nodes) each.
    sizes, tails
        Bounds of the sums of absolute values, and of what the interpolants leave out.
    """

    values: tuple[Array, Array]
    sizes: tuple[float, float]
    tails: tuple[float, float]

    @classmethod
    def of(cls, factors: Factors, start: float, end: float, wanted: float) -> _Side:
        half = (end - start) / 2
        sizes = [factors.derivative_bound(order) for order in (0, 1)]
        for terms in range(_LEAST_TERMS, _MOST_TERMS + 1):
            tails = [interpolation_tail(half, terms, factors.derivative_bound(terms + order)) for order in (0, 1)]
            if all(tail <= wanted * max(size, 1e-300) for tail, size in zip(tails, sizes, strict=True)):
                break
        t = start + half * (nodes(terms) + 1)
        return cls((factors.rows(t), factors.rows(t, 1)), (sizes[0], sizes[1]), (tails[0], tails[1]))


def _bounds(
    surface: SeparableSurface, u: tuple[float, float], v: tuple[float, float], rtol: float
) -> tuple[float, float]:
    """Bounds of the mean of |S_u x S_v| over a rectangle."""
    left, right = (
        _Side.of(factors, *ends, _TAIL * rtol) for factors, ends in ((surface.factors_u, u), (surface.factors_v, v))
    )
    reach = float(np.linalg.norm(surface.coefficients, axis=2).max(initial=0.0))
    series, errors, sizes = [], [], []
    for a, b in ((1, 0), (0, 1)):
        values = np.einsum("ip,jq,ijd->dpq", left.values[a], right.values[b], surface.coefficients, optimize=True)
        series.append(transform(values.shape[1]) @ values @ transform(values.shape[2]).T)
        sizes.append(float(np.linalg.norm(np.abs(series[-1]).sum(axis=(1, 2)))))
        tail = left.tails[a] * right.sizes[b] + (left.sizes[a] + left.tails[a]) * right.tails[b]
        errors.append(reach * (tail + _ROUNDING * left.sizes[a] * right.sizes[b]))
    slack = sizes[0] * errors[1] + sizes[1] * errors[0] + errors[0] * errors[1]
    lower, upper = _of_polynomials(series[0], series[1])
    return max(0.0, lower - slack), upper + slack


def _of_polynomials(along_u: Array, along_v: Array) -> tuple[float, float]:
    """Bounds of the mean of |p x q| over [-1, 1]^2 for vector polynomials, series of shape (3, K, L)."""
    counts = along_u.shape[1:]
    fine = [4 * count - 3 for count in counts]
    square = _squares(along_u, along_v, fine)
    series = _series(square)
    largest = float(np.abs(series).sum())
    coarse = [2 * count - 1 for count in counts]
    root = _series(np.sqrt(_squares(along_u, along_v, coarse)))
    rest = _series(square - _values(root, fine) ** 2)
    defect = float(np.abs(rest).sum()) + _ROUNDING * largest
    below = -series
    below[0, 0] += float(square.max())
    least = float(square.max()) - maximum(below[None, :, :, None], rtol=0.1).upper - _ROUNDING * largest
    if least <= 2 * defect:
        return 0.0, math.sqrt(largest) * (1 + _ROUNDING)
    moments = [np.array([1 / (1 - k * k) if k % 2 == 0 else 0.0 for k in range(count)]) for count in coarse]
    middle = float(moments[0] @ root @ moments[1])
    error = defect / (math.sqrt(least) + math.sqrt(least - defect)) + _ROUNDING * middle
    return middle - error, middle + error


def _squares(along_u: Array, along_v: Array, counts: list[int]) -> Array:
    """|p x q|^2 at Chebyshev nodes."""
    p, q = (np.stack([_values(part, counts) for part in one], axis=-1) for one in (along_u, along_v))
    crossed = np.cross(p, q)
    return np.asarray(np.einsum("uvd,uvd->uv", crossed, crossed))


def _values(series: Array, counts: list[int]) -> Array:
    left, right = (evaluation(count, terms) for count, terms in zip(counts, series.shape, strict=True))
    return np.asarray(left @ series @ right.T)


def _series(values: Array) -> Array:
    return np.asarray(transform(values.shape[0]) @ values @ transform(values.shape[1]).T)
