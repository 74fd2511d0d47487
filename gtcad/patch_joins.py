"""Patches joined to C3 and G3 across a side of another, and sheets of patches joined along all their edges.

Across a side x runs out of the one patch and into the other, y runs along it. With D_k(y) the k-th derivatives by x of
the first patch and T_k(y) those of the second, the patches join C^k when T_r = D_r for r = 0..k, and G^k when

    T_0 = D_0,  T_1 = eta D_1,  T_2 = eta^2 D_2 + psi D_1,  T_3 = eta^3 D_3 + 3 eta psi D_2 + omega D_1

for all y, with one (eta, psi, omega), eta > 0. Both patches having one basis along the edge, these are the rules of
curves (``gtcad.continuity``) for the rows of control points. ``check_edge`` (``gtcad.edge_check``) says what became of
a join, and of any other.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad._jets import norm
from gtcad._sides import DerivableSurface, SeparableSide
from gtcad.basis import GT, Basis, Family, checked_gamma
from gtcad.continuity import PARAMETRIC, Scale, Start, chain_rule, parsed_order, speed_bounds
from gtcad.edge_check import SINGULAR, EdgeReport, check_edge
from gtcad.errors import InputError, SingularJoin
from gtcad.protocol import SeparableSurface
from gtcad.surface import Surface

__all__ = [
    "DerivableSurface",
    "EdgeReport",
    "check_edge",
    "join_patch",
    "join_patch_nearest",
    "joined_sheet",
]

Array = NDArray[np.float64]


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
    _, count = parsed_order(order)
    scale = _checked_scale(order, scale)
    basis = Basis(degree, checked_gamma("gamma", gamma, family), family)
    start = Start.of(basis, count)
    along, ends = _old_rows(surface, side, count)
    rows = np.linalg.solve(start.matrix, chain_rule(scale, count + 1) @ ends.reshape(count + 1, -1)).reshape(ends.shape)
    rows[0] = ends[0]
    wanted = (basis.degree - count, *ends.shape[1:])
    try:
        free = np.asarray(rest, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"rest must be numbers of shape {wanted}: {error}") from None
    free = free if free.size else np.empty((0, *ends.shape[1:]))
    if free.shape != wanted:
        raise InputError(f"rest must have shape {wanted} for degree {degree}, {order}; got {free.shape}")
    return _turned_back(
        Surface(np.concatenate([rows, free]), basis.gamma, along.gamma, family, along.family),
        side,
    )


def join_patch_nearest(surface: SeparableSurface, side: str, wanted: Surface, order: str) -> tuple[Surface, Scale]:
    """The join of that order whose control points are nearest to those of a wanted patch.

    The scale factors of a G join, one (eta, psi, omega) for the edge, are chosen to minimise the sum of squared
    distances of the k + 1 rows next to the edge, eta within a factor 8 of the drawn speed; a C join has none to choose.

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
    if not isinstance(wanted, Surface):
        raise InputError(f"wanted must be a Surface, got {type(wanted).__name__}")
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
    own = float(np.linalg.norm(inverse[1, 1] * flat[1]))
    speed = max(float(np.linalg.norm(legs[0])), 1e-3 * float(np.linalg.norm(legs)), 1e-3 * own)
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
    projections = _projection("u", bases_u, orders_u, scales_u), _projection("v", bases_v, orders_v, scales_v)
    middle = net.mean(axis=(0, 1))  # joins whatever the factors, and costs digits
    net = middle + np.einsum("ai,bj,ijd->abd", *projections, net - middle, optimize=True)
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
    if not patches or not all(isinstance(row, Sequence) and len(row) == len(patches[0]) > 0 for row in patches):
        raise InputError("patches must be rows of equally many Surfaces")
    for i, row in enumerate(patches):
        for j, patch in enumerate(row):
            if not isinstance(patch, Surface) or patch.dimension != patches[0][0].dimension:
                raise InputError(f"patches[{i}][{j}] must be a Surface of the dimension of the others, got {patch!r}")
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
    for line, (order, own) in enumerate(zip(orders, given, strict=True)):
        _, count = parsed_order(order)
        scale = _checked_scale(order, own)
        ends = np.array([bases[line].derivative(1.0, r) for r in range(count + 1)])
        block = np.zeros((count + 1, starts[-1]))
        block[:, starts[line] : starts[line + 1]] = chain_rule(scale, count + 1) @ ends
        block[:, starts[line + 1] : starts[line + 1] + count + 1] = -Start.of(bases[line + 1], count).matrix
        equations.append(block / np.linalg.norm(block, axis=1)[:, None])
    # each line's equations have a triangular block of their own, so that all of them are independent
    across = np.linalg.qr(np.concatenate(equations).T)[0]
    return np.asarray(np.eye(starts[-1]) - across @ across.T)


def _checked_scale(order: str, scale: Scale) -> Scale:
    try:
        eta, psi, omega = (float(x) for x in scale)
    except (TypeError, ValueError):
        eta = psi = omega = math.nan
    if not (math.isfinite(eta + psi + omega) and eta > 0):
        raise InputError(f"scale must be three finite numbers (eta, psi, omega) with eta > 0, got {scale}")
    if order[0] == "C" and (eta, psi, omega) != PARAMETRIC:
        raise InputError(f"scale is for G joins; a {order} join has (1, 0, 0), got {scale}")
    return eta, psi, omega


def _old_rows(surface: SeparableSurface, side: str, order: int) -> tuple[Basis, Array]:
    """The basis along the edge, and the coefficients over it of D_0..D_order, shape (order + 1, m + 1, d)."""
    if not isinstance(surface, SeparableSurface):
        raise InputError(f"surface must be a surface of the protocol, got {type(surface).__name__}")
    edge = SeparableSide(surface, side, outward=True)
    if not isinstance(edge.along, Basis):
        raise InputError(f"the functions along the side {side} must be a Basis, got {type(edge.along).__name__}")
    rows = np.array([edge.coefficients(r) for r in range(order + 1)])
    if order and norm(rows[1]).max() < SINGULAR * edge.size:
        raise SingularJoin(f"the first patch has no derivative across its side {side}: it vanishes on all of it", 0.0)
    return edge.along, rows


def _turned(patch: Surface, side: str) -> Surface:
    """The neighbour across the side with u running away from the edge."""
    turned = patch if side[0] == "u" else patch.transposed()
    return turned if side[1] == "1" else turned.reversed("u")


def _turned_back(patch: Surface, side: str) -> Surface:
    turned = patch if side[1] == "1" else patch.reversed("u")
    return turned if side[0] == "u" else turned.transposed()
