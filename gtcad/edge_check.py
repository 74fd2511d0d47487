"""What happens along the whole common edge of two patches: gap, joins to C3 and G3, tangent planes, curvatures.

Across the edge x runs out of the first patch and into the second, y runs along it. With D_k(y) the k-th derivatives by
x of the first patch and T_k(y) those of the second, they join C^k when T_r = D_r for r = 0..k, and G^k when

    T_0 = D_0,  T_1 = eta D_1,  T_2 = eta^2 D_2 + psi D_1,  T_3 = eta^3 D_3 + 3 eta psi D_2 + omega D_1

for all y, with one (eta, psi, omega), eta > 0. That is sufficient: patches may also join G^k with factors that vary
along the edge, or with x running at a slant. So two things are reported: how well constant factors explain the join,
as proved bounds, and the tangent planes and curvatures themselves, densely sampled, which decide.

References
----------
J. Hahn, Geometric continuous patch complexes, Comput. Aided Geom. Design 6 (1989) 55-67.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gtcad._jets import norm
from gtcad._sides import DerivableSurface, SeparableSide, Side, side_of
from gtcad.chebyshev import UNIT_ROUNDOFF, interpolation_tail, lebesgue, maximum, nodes, transform
from gtcad.continuity import MAX_ORDER, PARAMETRIC, Scale, Thresholds, chain_rule, highest_order, meets_order
from gtcad.errors import InputError
from gtcad.factors import KeyedFactors, Stacked
from gtcad.protocol import SeparableSurface

Array = NDArray[np.float64]
Bounds = tuple[float, float]
Figures = tuple[float, float, float]

SINGULAR = 1e-10  # of the size: derivatives and edges that count as vanishing
STANDARD = Thresholds()
_SAMPLES = 257
_NEGLIGIBLE = 1e-17  # tail of a series, relative to its coefficients
_MOST_NODES = 512
_INVISIBLE = 1e-6  # of the inverse of the size: curvatures as small as this
_ROWS_DIFFER = 1e-8  # relative difference of derivatives that is never a jump


@dataclass(frozen=True)
class EdgeReport:
    """What happens along the common edge of two patches.

    Derivatives are by parameters that run over [0, 1] on each patch, compared at equal parameters of the edge.

    Attributes
    ----------
    gap
        Largest distance of points of equal parameter, in the model's unit, as (lower, upper) bounds. Edges that are
        the same curve at different speeds show a gap.
    scale
        The (eta, psi, omega) that explains the join best, by least squares; eta < 0 when the patch folds back.
    residuals
        Bounds of what is left of the equations of G1, G2, G3 with them, over the largest derivatives up to that order.
    parametric_jumps
        The same with (1, 0, 0): of C1, C2, C3.
    normal_angle_deg
        Largest angle of the tangent planes, in degrees: 0 where the patches run on smoothly, 180 where the second
        folds back over the first. It does not depend on how they are parametrised or oriented. Estimated, like all
        below; NaN when a patch has no normals along the edge.
    curvature_jump
        Largest jump of the normal curvature, over all directions, relative to the largest normal curvature there.
    curvature
        That normal curvature, in the inverse of the unit: times ``curvature_jump`` it is the jump itself.
    curvature_rate_jump
        Largest jump of the derivative, by arc length, of the normal curvature along the geodesic across the edge,
        relative to the larger of the derivative and the square of the curvature there.
    places
        Parameters of the first patch's edge where gap, angle, curvature jump and rate jump are largest.
    reversed
        Whether the edges run in opposite directions.
    proved
        Whether ``gap``, ``residuals`` and ``parametric_jumps`` are bounds (shapes of the protocol); estimated from
        samples otherwise, like all others always.
    parametric_order, geometric_order
        The highest k of C^k by ``parametric_jumps``, and of G^k by the angle and the curvatures, within the
        thresholds; -1 when the gap is too wide. C^k is G^k as well.
    """

    gap: Bounds
    scale: Scale
    residuals: Figures
    parametric_jumps: Figures
    normal_angle_deg: float
    curvature_jump: float
    curvature: float
    curvature_rate_jump: float
    places: tuple[float, float, float, float]
    reversed: bool
    proved: bool
    parametric_order: int
    geometric_order: int

    @property
    def order(self) -> str:
        """The highest order, "C3" to "C0" or "G1" to "G3", C before G at equal orders; "none" with too wide a gap."""
        return highest_order(self.parametric_order, self.geometric_order)

    def meets(self, order: str) -> bool:
        """Whether the join is of that order: C^k counts as G^k too."""
        return meets_order(order, self.parametric_order, self.geometric_order)


def check_edge(
    a: SeparableSurface | DerivableSurface,
    side_a: str,
    b: SeparableSurface | DerivableSurface,
    side_b: str,
    *,
    reversed: bool | None = None,
    thresholds: Thresholds = STANDARD,
) -> EdgeReport:
    """What happens along the edge where two patches meet, for shapes and for splines alike.

    Parameters
    ----------
    a, b
        The patches.
    side_a, side_b
        "u0", "u1", "v0" or "v1" of each.
    reversed
        Whether the edges run in opposite directions; found by comparing both unless given.
    thresholds
        What still counts as continuous.

    Raises
    ------
    InputError
        When an argument is out of its range, or the dimensions differ.

    Notes
    -----
    For shapes of the protocol each residual is a curve of the protocol, and bounded as in a certificate: by its
    Chebyshev series, the tail, and rounding. That of the derivatives across the edge is taken as ``rounding`` times
    ``derivative_bound`` of their factors. All others are the worst of 257 samples; those where a patch has no normal
    are left out.

    Examples
    --------
    A quarter of a cylinder of radius 2, and the plane that touches it:

    >>> from gtcad import BERNSTEIN, Surface
    >>> quarter = Surface([[[2, 0, z], [2, 2, z], [0, 2, z]] for z in (0, 1)], family_u=BERNSTEIN)
    >>> plane = Surface([[[0, 2, z], [-3, 2, z]] for z in (0, 1)], family_u=BERNSTEIN, family_v=BERNSTEIN)
    >>> report = check_edge(quarter, "v1", plane, "v0")
    >>> report.order, round(report.curvature * report.curvature_jump, 9)
    ('G1', 0.5)
    """
    before = side_of(a, side_a, outward=True)
    after = side_of(b, side_b, outward=False)
    if before.dimension != after.dimension:
        raise InputError(f"both patches must have one dimension, got {before.dimension} and {after.dimension}")
    y = np.linspace(0, 1, _SAMPLES)
    if reversed if reversed is not None else _runs_backwards(before, after, y):
        after = side_of(b, side_b, outward=False, backwards=True)
    bound = _proved if isinstance(before, SeparableSide) and isinstance(after, SeparableSide) else _sampled
    ends, starts = (np.array([one.derivative(y, (r, 0)) for r in range(MAX_ORDER + 1)]) for one in (before, after))
    size = max(before.size, after.size, float(np.finfo(float).tiny))
    scale = _best_scale(ends, starts, SINGULAR * size)
    gap, at_gap = bound(before, after, np.ones(1))
    jumps, residuals = (
        _relative_bounds(before, after, bound, ends, starts, factors, SINGULAR * size)
        for factors in (PARAMETRIC, scale)
    )
    with np.errstate(all="ignore"):
        bent_before, bent_after = (_bending(one, y, size) for one in (before, after))
        figures, curvature, places = _jumps(bent_before, bent_after, size)
    limits = (math.radians(thresholds.angle_deg), thresholds.curvature, thresholds.curvature_rate)
    parametric = _reached(jumps, tuple(max(limit, _ROWS_DIFFER) for limit in limits))
    geometric = _reached(figures, (thresholds.angle_deg, *limits[1:]))
    touch = gap[1] <= thresholds.gap
    return EdgeReport(
        gap=gap,
        scale=scale,
        residuals=residuals,
        parametric_jumps=jumps,
        normal_angle_deg=figures[0],
        curvature_jump=figures[1],
        curvature=curvature,
        curvature_rate_jump=figures[2],
        places=tuple(before.parameter(p) for p in (at_gap, *(float(y[k]) for k in places))),  # type: ignore[arg-type]
        reversed=after.backwards,
        proved=bound is _proved,
        parametric_order=parametric if touch else -1,
        geometric_order=geometric if touch else -1,
    )


def _runs_backwards(before: Side, after: Side, y: Array) -> bool:
    own, other = before.derivative(y, (0, 0)), after.derivative(y, (0, 0))
    return float(norm(own - other[::-1]).max()) < float(norm(own - other).max())


def _best_scale(ends: Array, starts: Array, least: float) -> Scale:
    """Least squares, one factor after the other; (1, 0, 0) without a derivative across the edge."""
    first = ends[1].reshape(-1)
    square = float(first @ first)
    if norm(ends[1]).max() <= least:
        return PARAMETRIC

    def share(vectors: Array) -> float:
        return float(first @ vectors.reshape(-1)) / square

    eta = share(starts[1])
    psi = share(starts[2] - eta**2 * ends[2])
    return eta, psi, share(starts[3] - eta**3 * ends[3] - 3 * eta * psi * ends[2])


def _relative_bounds(
    before: Side, after: Side, bound: _Bound, ends: Array, starts: Array, scale: Scale, least: float
) -> Figures:
    """Bounds of |T_k - ...| for k = 1..3, over the largest derivatives up to that order."""
    rules = chain_rule(scale, MAX_ORDER + 1)
    found, size = [], least
    for k in range(1, MAX_ORDER + 1):
        wanted = np.tensordot(rules[k], ends, 1)
        size = max(size, float(norm(starts[k]).max()), float(norm(wanted).max()))
        found.append(bound(before, after, rules[k, : k + 1])[0][1] / size)
    return found[0], found[1], found[2]


class _Bound(Protocol):
    """The largest |T_k - sum_r weights_r D_r|, k = len(weights) - 1, as (lower, upper), and where."""

    def __call__(self, before: Side, after: Side, weights: Array, /) -> tuple[Bounds, float]: ...


def _sampled(before: Side, after: Side, weights: Array) -> tuple[Bounds, float]:
    y, order = np.linspace(0, 1, _SAMPLES), len(weights) - 1
    wanted = sum(weight * before.derivative(y, (r, 0)) for r, weight in enumerate(weights))
    distances = norm(after.derivative(y, (order, 0)) - wanted)
    place = int(distances.argmax())
    return (float(distances[place]), float(distances[place])), float(y[place])


def _proved(before: Side, after: Side, weights: Array) -> tuple[Bounds, float]:
    assert isinstance(before, SeparableSide)
    assert isinstance(after, SeparableSide)
    order = len(weights) - 1
    own = -sum(weight * before.coefficients(r) for r, weight in enumerate(weights))
    other = after.coefficients(order)
    slack = after.rounding(order) + sum(abs(weight) * before.rounding(r) for r, weight in enumerate(weights))
    if before.along.key == after.along.key:
        factors, coefficients = before.along, own + other
    else:
        factors, coefficients = Stacked((before.along, after.along)), np.concatenate([own, other])
    count, tail = _resolved(KeyedFactors(factors))
    z = nodes(count)
    values = factors.rows((z + 1) / 2).T @ coefficients
    found = maximum((transform(count) @ values)[None], rtol=1e-3)
    units = factors.rounding + (factors.count + 8) * UNIT_ROUNDOFF
    slack += float(norm(coefficients).max()) * (tail + lebesgue(count) * units)
    # nodes are rounded by a unit or two: by Markov's inequality less than 1e-7 of the difference itself
    bounds = max(0.0, found.lower * (1 - 1e-7) - slack), found.upper * (1 + 1e-7) + slack
    return (float(bounds[0]), float(bounds[1])), (found.place[0] + 1) / 2


@lru_cache(maxsize=128)
def _resolved(kept: KeyedFactors) -> tuple[int, float]:
    """Chebyshev zeros on [0, 1] for which the tail is negligible, and the tail."""
    try:
        for count in range(2, _MOST_NODES):
            tail = interpolation_tail(0.5, count, kept.factors.derivative_bound(count))
            if tail <= _NEGLIGIBLE:
                return count, tail
    except OverflowError:
        pass
    raise InputError(f"the functions along the edge are not resolved by {_MOST_NODES} Chebyshev points")


@dataclass(frozen=True)
class _Bending:
    """How a patch bends along a side, NaN where it has no normal.

    Normals have shape (samples, 3). Normal curvatures are the matrices in the frame (across, along) of the tangent
    plane, shape (samples, 2, 2); their rates belong to the geodesics across, shape (samples,).
    """

    normal: Array
    curvature: Array
    rate: Array


def _bending(side: Side, y: Array, size: float) -> _Bending:
    """With f_a = q_a^i S_i the orthonormal frame, H_ab = q_a^i q_b^j S_ij and f_0 across the edge: the curvatures are
    ``k_ab = H_ab . n``, and along the geodesic ``dk/ds = q_0^i q_0^j q_0^k S_ijk . n - 3 sum_a (H_00 . f_a) k_a0``.
    """  # noqa: D205

    def partial(order: int) -> Array:
        """All partial derivatives of the order: shape (samples, 2, ..., 2, 3), index 0 for x and 1 for y."""
        different = [side.derivative(y, (order - k, k)) for k in range(order + 1)]
        places = np.indices((2,) * order).sum(axis=0)
        return np.moveaxis(np.array(different)[places], -2, 0)

    first, second, third = (partial(order) for order in (1, 2, 3))
    normal = np.cross(first[:, 0], first[:, 1])
    area, length = norm(normal), norm(first[:, 1])
    area = np.where(area <= SINGULAR * size * norm(first).max(), np.nan, area)
    normal = normal / area[:, None]
    along = first[:, 1] / length[:, None]
    frame = np.stack([np.cross(along, normal), along], axis=1)
    width, slant = area / length, (first[:, 0] * along).sum(axis=1)
    q = np.stack([np.stack([1 / width, -slant / (width * length)], -1), np.stack([0 * length, 1 / length], -1)], 1)
    bend = np.einsum("nai,nbj,nijd->nabd", q, q, second)
    curvature = np.einsum("nabd,nd->nab", bend, normal)
    across = q[:, 0]
    rate = np.einsum("ni,nj,nk,nijkd,nd->n", across, across, across, third, normal)
    rate -= 3 * np.einsum("nd,nad,na->n", bend[:, 0, 0], frame, curvature[:, 0])
    return _Bending(normal, curvature, rate)


def _jumps(before: _Bending, after: _Bending, size: float) -> tuple[Figures, float, tuple[int, int, int]]:
    """Largest angle in degrees, relative jumps of curvature and rate, the curvature at its jump, and the samples.

    Curvatures below 1e-6 / size, and rates below 1e-6 / size^2, make no visible difference.
    """
    chord = norm(after.normal - before.normal)
    if np.isnan(chord).all():
        return (math.nan,) * 3, math.nan, (0, 0, 0)
    angles = np.degrees(2 * np.arcsin(np.minimum(1.0, chord / 2)))
    larger = np.maximum(_spectral(before.curvature), _spectral(after.curvature))
    steepest = np.maximum(np.abs(before.rate), np.abs(after.rate))
    curvatures = _spectral(after.curvature - before.curvature) / np.maximum(larger, _INVISIBLE / size)
    rates = np.abs(after.rate - before.rate) / np.maximum(np.maximum(steepest, larger**2), _INVISIBLE / size**2)
    a, c, r = (int(np.nanargmax(values)) for values in (angles, curvatures, rates))
    return (float(angles[a]), float(curvatures[c]), float(rates[r])), float(larger[c]), (a, c, r)


def _spectral(matrices: Array) -> Array:
    """The largest absolute eigenvalue of symmetric 2 x 2 matrices."""
    p, q, r = matrices[:, 0, 0], matrices[:, 0, 1], matrices[:, 1, 1]
    return np.asarray(np.abs(p + r) / 2 + np.hypot((p - r) / 2, q))


def _reached(values: Figures, limits: tuple[float, ...]) -> int:
    return next((k for k, (value, limit) in enumerate(zip(values, limits, strict=True)) if not value <= limit), 3)
