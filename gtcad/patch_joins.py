"""Joins of patches to C3 and G3: built across one side of a patch, and checked along the whole edge of any two.

Across a side x runs out of the one patch and into the other, y runs along it. With D_k(y) the k-th derivatives by x of
the first patch and T_k(y) those of the second, the patches join C^k when T_r = D_r for r = 0..k, and G^k when

    T_0 = D_0,  T_1 = eta D_1,  T_2 = eta^2 D_2 + psi D_1,  T_3 = eta^3 D_3 + 3 eta psi D_2 + omega D_1

for all y, with one (eta, psi, omega), eta > 0. Both patches having one basis along the edge, these are the rules of
curves (``gtcad.continuity``) for the rows of control points. They are sufficient: patches may also join G^k with
factors that vary along the edge, or with x running at a slant. ``check_edge`` shows both: how well constant factors
explain the join, and the tangent planes and curvatures themselves, which decide.

References
----------
J. Hahn, Geometric continuous patch complexes, Comput. Aided Geom. Design 6 (1989) 55-67.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad._jets import norm, space
from gtcad.basis import GT, Basis, Family
from gtcad.chebyshev import UNIT_ROUNDOFF, interpolation_tail, lebesgue, maximum, nodes, transform
from gtcad.continuity import MAX_ORDER, PARAMETRIC, Scale, Start, Thresholds, chain_rule, parsed_order, speed_bounds
from gtcad.errors import InputError, SingularJoin
from gtcad.factors import KeyedFactors, RestrictedFactors, Stacked
from gtcad.protocol import Factors, SeparableSurface
from gtcad.surface import Surface

Array = NDArray[np.float64]
Bounds = tuple[float, float]
Figures = tuple[float, float, float]

SIDES = ("u0", "u1", "v0", "v1")
_SINGULAR = 1e-10  # of the size: derivatives and edges that count as vanishing
_SAMPLES = 257
_NEGLIGIBLE = 1e-17  # tail of a series, relative to its coefficients
_MOST_NODES = 512
_ROWS_DIFFER = 1e-8  # relative difference of derivatives that is never a jump


class DerivableSurface(Protocol):
    """A surface, or a spline, with partial derivatives on a domain."""

    @property
    def domain(self) -> tuple[Bounds, Bounds]:
        """First and last u, first and last v."""
        ...

    def derivative(self, u: ArrayLike, v: ArrayLike, orders: tuple[int, int] = (1, 0)) -> Array:
        """Partial derivatives of the orders, (0, 0) the point, shape broadcast(u, v).shape + (d,)."""
        ...


def join_patch(
    surface: SeparableSurface,
    side: str,
    degree: int,
    *,
    order: str,
    gamma: Sequence[float] = (0.0, 0.0),
    scale: Scale = PARAMETRIC,
    rest: ArrayLike = (),
    family: Family = GT,
) -> Surface:
    """The patch that continues another one across a side, joined C^k or G^k along the whole edge.

    u and v of the new patch run in the directions of the old one, so that normals agree: its side opposite to ``side``
    is the shared edge ("u0" of the new patch for "u1" of the old one). Along the edge it has the degree, design
    variables and family of the old one.

    Parameters
    ----------
    surface
        The first patch. Its functions along the edge must be a ``Basis``, as those of every ``Surface`` are.
    side
        "u0", "u1", "v0" or "v1".
    degree, gamma, family
        Of the new patch across the edge; gamma counted away from the edge.
    order
        "C0" to "C3" or "G0" to "G3".
    scale
        (eta, psi, omega) of a G join, eta > 0; left alone for a C join.
    rest
        The rows of control points after the first k + 1, counted away from the edge, shape (degree - k, m + 1, d).

    Returns
    -------
    Surface
        Its k + 1 rows next to the edge follow from the join, the first one equal to the old row to the last bit.

    Raises
    ------
    InputError
        When an argument is out of its range or ``rest`` has another shape.
    SingularJoin
        When the first patch has no derivative across the edge, or a row is not determined (see ``join_curve``).

    Examples
    --------
    C1: every leg of the new net continues the last one of the old.

    >>> first = Surface([[[x, y, x * x] for y in (0, 1, 2)] for x in (0, 1, 2)])
    >>> second = join_patch(first, "u1", 2, order="C1", rest=[[[4, y, 4] for y in (0, 1, 2)]])
    >>> second.control_points[:, 0].round(12).tolist()
    [[2.0, 0.0, 4.0], [3.0, 0.0, 7.0], [4.0, 0.0, 4.0]]
    """
    kind, count = parsed_order(order)
    _check_scale(kind, order, scale)
    basis = Basis(degree, (float(gamma[0]), float(gamma[1])), family)
    start = Start.of(basis, count)
    along, ends = _old_rows(surface, side, count)
    rows = np.linalg.solve(start.matrix, chain_rule(scale, count + 1) @ ends.reshape(count + 1, -1)).reshape(ends.shape)
    rows[0] = ends[0]
    wanted = (degree - count, *ends.shape[1:])
    free = np.asarray(rest, dtype=np.float64) if np.size(rest) else np.empty((0, *ends.shape[1:]))
    if free.shape != wanted:
        raise InputError(f"rest must have shape {wanted} for degree {degree}, {order}; got {np.shape(rest)}")
    return _turned_back(
        Surface(np.concatenate([rows, free]), basis.gamma, along.gamma, family, along.family),
        side,
    )


def join_patch_nearest(surface: SeparableSurface, side: str, wanted: Surface, order: str) -> tuple[Surface, Scale]:
    """The join of that order whose control points are nearest to those of a wanted patch.

    The scale factors of a G join, one (eta, psi, omega) for the edge, are chosen to minimise the sum of squared
    distances of the k + 1 rows next to the edge; a C join has none to choose.

    Parameters
    ----------
    surface, side, order
        As of ``join_patch``.
    wanted
        The neighbour as drawn, in the directions of the first patch; it need not touch it.

    Returns
    -------
    patch, scale
        The joined patch, with the other control points of the wanted one, and its (eta, psi, omega).

    Raises
    ------
    InputError
        Also when the wanted patch has another basis along the edge.
    SingularJoin
        As ``join_patch``.
    """
    from scipy.optimize import least_squares

    kind, count = parsed_order(order)
    along, ends = _old_rows(surface, side, count)
    turned = _turned(wanted, side)
    if turned.factors_v != along:
        raise InputError(f"wanted must have the basis of the edge, {along}, got {turned.factors_v}")

    def joined(scale: Scale) -> Surface:
        return join_patch(
            surface,
            side,
            turned.degrees[0],
            order=order,
            gamma=turned.gamma_u,
            scale=scale,
            rest=turned.control_points[count + 1 :],
            family=turned.family_u,
        )

    if kind == "C" or count == 0:
        return joined(PARAMETRIC), PARAMETRIC
    inverse = np.linalg.inv(Start.of(turned.factors_u, count).matrix)
    flat = ends.reshape(count + 1, -1)
    goal = turned.control_points[: count + 1].reshape(count + 1, -1)

    def completed(free: Array) -> Scale:
        psi, omega = (*free[1:], 0.0, 0.0)[:2]
        return math.exp(free[0]), float(psi), float(omega)

    def misses(free: Array) -> Array:
        return np.asarray(inverse @ chain_rule(completed(free), count + 1) @ flat - goal)[1:].reshape(-1)

    legs = np.diff(turned.control_points, axis=0)
    speed = max(float(np.linalg.norm(legs[0])), 1e-3 * float(np.linalg.norm(legs)))
    own = float(np.linalg.norm(inverse[1, 1] * flat[1]))
    guess = np.array([math.log(speed / own), 0.0, 0.0])[:count]
    found = completed(least_squares(misses, guess, bounds=speed_bounds(guess, [0]), x_scale="jac").x)
    return joined(found), found


def joined_sheet(
    patches: Sequence[Sequence[Surface]],
    orders_u: Sequence[str],
    orders_v: Sequence[str],
    *,
    scales_u: Sequence[Scale] | None = None,
    scales_v: Sequence[Scale] | None = None,
) -> tuple[tuple[Surface, ...], ...]:
    """The open sheet of m x n patches nearest to the drawn ones that joins along all its interior edges.

    The scale factors and the order belong to the whole line between two strips. Around an interior vertex the rules of
    both lines then commute: going around it either way gives the same derivatives, so that the sheet exists for all
    factors. In the control points the rules of each direction are linear, and the nearest net (sum of squares) is the
    drawn one under the orthogonal projection of each direction.

    Parameters
    ----------
    patches
        ``patches[i][j]``, i along u: "u1" of one meets "u0" of ``patches[i + 1][j]``. Strips have one basis: that of u
        depends on i alone, that of v on j alone.
    orders_u, orders_v
        "C0" to "G3" for the m - 1 lines across u and the n - 1 lines across v.
    scales_u, scales_v
        (eta, psi, omega) for each line; (1, 0, 0) unless given.

    Returns
    -------
    tuple of tuples of Surface
        Neighbours have equal control points on their common edge, to the last bit.

    Raises
    ------
    InputError
        When an argument is out of its range, or patches of a strip differ in their basis.
    SingularJoin
        When control points at a line are not determined (see ``join_curve``).
    """
    bases_u, bases_v = _strips(patches)
    net = np.concatenate([np.concatenate([patch.control_points for patch in row], axis=1) for row in patches])
    net = np.tensordot(_projection("u", bases_u, orders_u, scales_u), net, 1)
    net = np.ascontiguousarray((_projection("v", bases_v, orders_v, scales_v) @ net.swapaxes(0, 1)).swapaxes(0, 1))
    starts_u, starts_v = (np.cumsum([0, *(basis.count for basis in bases)]) for bases in (bases_u, bases_v))
    net[starts_u[1:-1]] = net[starts_u[1:-1] - 1]
    net[:, starts_v[1:-1]] = net[:, starts_v[1:-1] - 1]
    return tuple(
        tuple(
            Surface(net[a : a + u.count, b : b + v.count], u.gamma, v.gamma, u.family, v.family)
            for b, v in zip(starts_v[:-1], bases_v, strict=True)
        )
        for a, u in zip(starts_u[:-1], bases_u, strict=True)
    )


def _strips(patches: Sequence[Sequence[Surface]]) -> tuple[list[Basis], list[Basis]]:
    """The bases of the strips in u and in v, all patches being checked."""
    if not patches or not patches[0] or len({len(row) for row in patches}) != 1:
        raise InputError(f"patches must be rows of equally many, got {[len(row) for row in patches]}")
    bases_u, bases_v = [row[0].factors_u for row in patches], [patch.factors_v for patch in patches[0]]
    for i, row in enumerate(patches):
        for j, patch in enumerate(row):
            for name, own, strip in (("u", patch.factors_u, bases_u[i]), ("v", patch.factors_v, bases_v[j])):
                if own != strip:
                    raise InputError(f"patches[{i}][{j}] must have its strip's basis of {name}, {strip}, got {own}")
    return bases_u, bases_v


def _projection(name: str, bases: list[Basis], orders: Sequence[str], scales: Sequence[Scale] | None) -> Array:
    """Orthogonal projection of the control points of a chain onto those that join, shape (total, total)."""
    given = [PARAMETRIC] * (len(bases) - 1) if scales is None else list(scales)
    for what, values in (("orders", orders), ("scales", given)):
        if isinstance(values, str) or len(values) != len(bases) - 1:
            raise InputError(f"{what}_{name} must be one for each of {len(bases) - 1} lines, got {values!r}")
    starts = np.cumsum([0, *(basis.count for basis in bases)])
    equations = [np.empty((0, starts[-1]))]
    for line, (order, scale) in enumerate(zip(orders, given, strict=True)):
        kind, count = parsed_order(order)
        _check_scale(kind, order, scale)
        ends = np.array([bases[line].derivative(1.0, r) for r in range(count + 1)])
        block = np.zeros((count + 1, starts[-1]))
        block[:, starts[line] : starts[line + 1]] = chain_rule(scale, count + 1) @ ends
        block[:, starts[line + 1] : starts[line + 1] + count + 1] = -Start.of(bases[line + 1], count).matrix
        equations.append(block / np.linalg.norm(block, axis=1)[:, None])
    # each line's equations have a triangular block of their own, so that all of them are independent
    across = np.linalg.qr(np.concatenate(equations).T)[0]
    return np.asarray(np.eye(starts[-1]) - across @ across.T)


def _check_scale(kind: str, order: str, scale: Scale) -> None:
    if kind == "C" and tuple(scale) != PARAMETRIC:
        raise InputError(f"scale is for G joins; a {order} join has (1, 0, 0), got {tuple(scale)}")
    if len(scale) != 3 or not all(math.isfinite(x) for x in scale) or not scale[0] > 0:
        raise InputError(f"scale must be three finite numbers (eta, psi, omega) with eta > 0, got {tuple(scale)}")


def _old_rows(surface: SeparableSurface, side: str, order: int) -> tuple[Basis, Array]:
    """The basis along the edge, and the coefficients over it of D_0..D_order, shape (order + 1, m + 1, d)."""
    edge = _SeparableSide(surface, side, outward=True)
    if not isinstance(edge.along, Basis):
        raise InputError(f"the functions along the side {side} must be a Basis, got {type(edge.along).__name__}")
    rows = np.array([edge.coefficients(r) for r in range(order + 1)])
    if order and norm(rows[1]).max() < _SINGULAR * edge.size:
        raise SingularJoin(f"the first patch has no derivative across its side {side}: it vanishes on all of it", 0.0)
    return edge.along, rows


def _turned(patch: Surface, side: str) -> Surface:
    """The neighbour across the side with u running away from the edge."""
    turned = patch if side[0] == "u" else patch.transposed()
    return turned if side[1] == "1" else turned.reversed("u")


def _turned_back(patch: Surface, side: str) -> Surface:
    turned = patch if side[1] == "1" else patch.reversed("u")
    return turned if side[0] == "u" else turned.transposed()


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
        folds back over the first. It does not depend on how they are parametrised. Estimated, like all below; NaN
        when a patch has no normals along the edge.
    curvature
        Largest normal curvature of both patches along the edge, in the inverse of the unit.
    curvature_jump
        Largest jump of the normal curvature, over all directions, relative to ``curvature``.
    curvature_rate_jump
        Largest jump of the derivative, by arc length, of the normal curvature along the geodesic across the edge,
        over the larger of the derivative and the square of the curvature.
    places
        Parameters of the first patch's edge where gap, angle, curvature jump and rate jump are largest.
    reversed
        Whether the edges run in opposite directions.
    proved
        Whether ``gap``, ``residuals`` and ``parametric_jumps`` are bounds (shapes of the protocol); estimated from
        samples otherwise, like all others always.
    order
        "C3" to "C0" or "G1" to "G3": the highest order within the thresholds, C before G at equal orders; "none" when
        the gap is too wide.
    """

    gap: Bounds
    scale: Scale
    residuals: Figures
    parametric_jumps: Figures
    normal_angle_deg: float
    curvature: float
    curvature_jump: float
    curvature_rate_jump: float
    places: tuple[float, float, float, float]
    reversed: bool
    proved: bool
    order: str

    def meets(self, order: str) -> bool:
        """Whether the join is of that order: C^k counts as G^k too."""
        if self.order == "none":
            return False
        kind, wanted = parsed_order(order)
        return int(self.order[1]) >= wanted and (kind == "G" or self.order[0] == "C" or wanted == 0)


def check_edge(
    a: SeparableSurface | DerivableSurface,
    side_a: str,
    b: SeparableSurface | DerivableSurface,
    side_b: str,
    *,
    reversed: bool | None = None,
    thresholds: Thresholds = Thresholds(),
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

    >>> from gtcad import BERNSTEIN
    >>> quarter = Surface([[[2, 0, z], [2, 2, z], [0, 2, z]] for z in (0, 1)], family_u=BERNSTEIN)
    >>> plane = Surface([[[0, 2, z], [-3, 2, z]] for z in (0, 1)], family_u=BERNSTEIN, family_v=BERNSTEIN)
    >>> report = check_edge(quarter, "v1", plane, "v0")
    >>> report.order, round(report.curvature * report.curvature_jump, 9)
    ('G1', 0.5)
    """
    before = _side(a, side_a, outward=True)
    after = _side(b, side_b, outward=False)
    if before.dimension != after.dimension:
        raise InputError(f"both patches must have one dimension, got {before.dimension} and {after.dimension}")
    y = np.linspace(0, 1, _SAMPLES)
    if reversed if reversed is not None else _runs_backwards(before, after, y):
        after = _side(b, side_b, outward=False, backwards=True)
    bound = _proved if isinstance(before, _SeparableSide) and isinstance(after, _SeparableSide) else _sampled
    ends, starts = (np.array([one.derivative(y, (r, 0)) for r in range(MAX_ORDER + 1)]) for one in (before, after))
    size = max(before.size, after.size, float(np.finfo(float).tiny))
    scale = _best_scale(ends, starts, _SINGULAR * size)
    gap, at_gap = bound(before, after, np.ones(1))
    jumps, residuals = (
        _relative_bounds(before, after, bound, ends, starts, factors, _SINGULAR * size)
        for factors in (PARAMETRIC, scale)
    )
    with np.errstate(all="ignore"):
        bent_before, bent_after = (_bending(one, y, size) for one in (before, after))
        angle, curvature, rate, largest, places = _jumps(bent_before, bent_after, 1e-6 / size)
    limits = (math.radians(thresholds.angle_deg), thresholds.curvature, thresholds.curvature_rate)
    parametric = _reached(jumps, tuple(max(limit, _ROWS_DIFFER) for limit in limits))
    geometric = _reached((angle, curvature, rate), (thresholds.angle_deg, *limits[1:]))
    order = f"C{parametric}" if parametric >= geometric else f"G{geometric}"  # C^k implies G^k
    return EdgeReport(
        gap=gap,
        scale=scale,
        residuals=residuals,
        parametric_jumps=jumps,
        normal_angle_deg=angle,
        curvature=largest,
        curvature_jump=curvature,
        curvature_rate_jump=rate,
        places=tuple(before.parameter(p) for p in (at_gap, *(float(y[k]) for k in places))),  # type: ignore[arg-type]
        reversed=after.backwards,
        proved=bound is _proved,
        order=order if gap[1] <= thresholds.gap else "none",
    )


@dataclass(frozen=True)
class _Side:
    """One side of a patch: x runs across it, out of the patch or into it, y along it, both over [0, 1]."""

    surface: SeparableSurface | DerivableSurface
    name: str
    outward: bool
    backwards: bool = False

    def __post_init__(self) -> None:
        if self.name not in SIDES:
            raise InputError(f'side must be "u0", "u1", "v0" or "v1", got {self.name!r}')

    @property
    def domain(self) -> tuple[Bounds, Bounds]:
        """Of the surface."""
        return ((0.0, 1.0), (0.0, 1.0)) if isinstance(self.surface, SeparableSurface) else self.surface.domain

    @property
    def sign(self) -> float:
        """Of the surface's own parameter across the edge, along x."""
        return 1.0 if (self.name[1] == "1") == self.outward else -1.0

    @cached_property
    def dimension(self) -> int:
        return int(self._own(np.zeros(1), (0, 0)).shape[-1])

    @cached_property
    def size(self) -> float:
        """Of the whole patch, from samples."""
        u, v = (np.linspace(*bounds, 9) for bounds in self.domain)
        points = self.surface.derivative(u[:, None], v[None, :], (0, 0))
        return float(np.ptp(points.reshape(-1, points.shape[-1]), axis=0).max())

    def parameter(self, y: float) -> float:
        """The surface's own parameter along the edge."""
        start, end = self.domain[1 if self.name[0] == "u" else 0]
        part = 1 - y if self.backwards else y
        return float(start * (1 - part) + end * part)

    def derivative(self, y: Array, orders: tuple[int, int]) -> Array:
        """Partial derivatives of the orders (in x, in y) on the side, in space: shape (y.size, 3)."""
        (u0, u1), (v0, v1) = self.domain
        across, along = (u1 - u0, v1 - v0) if self.name[0] == "u" else (v1 - v0, u1 - u0)
        factor = (self.sign * across) ** orders[0] * (-along if self.backwards else along) ** orders[1]
        return np.asarray(factor * space(self._own(1 - y if self.backwards else y, orders)))

    def _own(self, y: Array, orders: tuple[int, int]) -> Array:
        (u0, u1), (v0, v1) = self.domain
        last = self.name[1] == "1"
        if self.name[0] == "u":
            return self.surface.derivative(np.full(y.shape, u1 if last else u0), v0 * (1 - y) + v1 * y, orders)
        place = np.full(y.shape, v1 if last else v0)
        return self.surface.derivative(u0 * (1 - y) + u1 * y, place, (orders[1], orders[0]))


@dataclass(frozen=True)
class _SeparableSide(_Side):
    """One side of a shape of the protocol: derivatives by x are curves of the protocol."""

    surface: SeparableSurface

    @property
    def across(self) -> Factors:
        return self.surface.factors_u if self.name[0] == "u" else self.surface.factors_v

    @cached_property
    def along(self) -> Factors:
        own = self.surface.factors_v if self.name[0] == "u" else self.surface.factors_u
        return RestrictedFactors(own, 1.0, 0.0) if self.backwards else own

    @cached_property
    def largest(self) -> float:
        """Bound of the sum of the patch's terms over its factors across, for each unit of these."""
        return float(norm(self.surface.coefficients).max()) * self.along.derivative_bound(0)

    def coefficients(self, order: int) -> Array:
        """Coefficients of the derivative by x over ``along``, shape (count, d)."""
        row = self.across.rows(np.array([float(self.name[1])]), order)[:, 0] * self.sign**order
        return np.asarray(np.tensordot(row, self.surface.coefficients, (0, 0 if self.name[0] == "u" else 1)))

    def rounding(self, order: int) -> float:
        """Bound of the rounding errors of the curve of the coefficients."""
        units = self.across.rounding + (self.across.count + 2) * UNIT_ROUNDOFF
        return units * self.across.derivative_bound(order) * self.largest


def _side(
    surface: SeparableSurface | DerivableSurface, name: str, *, outward: bool, backwards: bool = False
) -> _Side | _SeparableSide:
    kind = _SeparableSide if isinstance(surface, SeparableSurface) else _Side
    return kind(surface, name, outward, backwards)  # type: ignore[arg-type]


def _runs_backwards(before: _Side, after: _Side, y: Array) -> bool:
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
    before: _Side, after: _Side, bound: _Bound, ends: Array, starts: Array, scale: Scale, least: float
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

    def __call__(self, before: _Side, after: _Side, weights: Array, /) -> tuple[Bounds, float]: ...


def _sampled(before: _Side, after: _Side, weights: Array) -> tuple[Bounds, float]:
    y, order = np.linspace(0, 1, _SAMPLES), len(weights) - 1
    wanted = sum(weight * before.derivative(y, (r, 0)) for r, weight in enumerate(weights))
    distances = norm(after.derivative(y, (order, 0)) - wanted)
    place = int(distances.argmax())
    return (float(distances[place]), float(distances[place])), float(y[place])


def _proved(before: _Side, after: _Side, weights: Array) -> tuple[Bounds, float]:
    assert isinstance(before, _SeparableSide)
    assert isinstance(after, _SeparableSide)
    order = len(weights) - 1
    own = -sum(weight * before.coefficients(r) for r, weight in enumerate(weights))
    other = after.coefficients(order)
    slack = sum(abs(weight) * before.rounding(r) for r, weight in enumerate(weights)) + after.rounding(order)
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
    return bounds, (found.place[0] + 1) / 2


@lru_cache(maxsize=128)
def _resolved(kept: KeyedFactors) -> tuple[int, float]:
    """Chebyshev zeros on [0, 1] for which the tail is negligible, and the tail."""
    for count in range(2, _MOST_NODES):
        tail = interpolation_tail(0.5, count, kept.factors.derivative_bound(count))
        if tail <= _NEGLIGIBLE:
            return count, tail
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


def _bending(side: _Side, y: Array, size: float) -> _Bending:
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
    area = np.where(area <= _SINGULAR * size * norm(first).max(), np.nan, area)
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


def _jumps(before: _Bending, after: _Bending, least: float) -> tuple[float, float, float, float, tuple[int, int, int]]:
    """Largest angle in degrees, relative jumps of curvature and rate, largest curvature, and the samples of the jumps.

    Curvatures below ``least`` make no visible difference.
    """
    chord = norm(after.normal - before.normal)
    angles = np.degrees(2 * np.arcsin(np.minimum(1.0, chord / 2)))
    curvatures, rates = _spectral(after.curvature - before.curvature), np.abs(after.rate - before.rate)
    if np.isnan(chord).all():
        nan = math.nan
        return nan, nan, nan, nan, (0, 0, 0)
    a, c, r = (int(np.nanargmax(values)) for values in (angles, curvatures, rates))
    largest = float(np.nanmax([_spectral(one.curvature) for one in (before, after)]))
    steepest = float(np.nanmax(np.abs([before.rate, after.rate])))
    curvature = float(curvatures[c]) / max(largest, least)
    return float(angles[a]), curvature, float(rates[r]) / max(steepest, largest**2, least**2), largest, (a, c, r)


def _spectral(matrices: Array) -> Array:
    """The largest absolute eigenvalue of symmetric 2 x 2 matrices."""
    p, q, r = matrices[:, 0, 0], matrices[:, 0, 1], matrices[:, 1, 1]
    return np.asarray(np.abs(p + r) / 2 + np.hypot((p - r) / 2, q))


def _reached(values: Figures, limits: tuple[float, ...]) -> int:
    return next((k for k, (value, limit) in enumerate(zip(values, limits, strict=True)) if not value <= limit), 3)
