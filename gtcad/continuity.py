"""Joins of curves to C3 and G3: built from the end derivatives of one curve, and checked on any two.

With D_k the k-th derivative of the first curve at its end and T_k that of the second at its start, the curves join
C^k when T_r = D_r for r = 0..k, and G^k when scale factors eta > 0, psi and omega exist with

    T_0 = D_0,  T_1 = eta D_1,  T_2 = eta^2 D_2 + psi D_1,  T_3 = eta^3 D_3 + 3 eta psi D_2 + omega D_1.

T_r involves the first r + 1 control points of the second curve alone, so they follow in order. A check needs no scale
factors: it compares the derivatives with respect to arc length.

References
----------
B. A. Barsky, T. D. DeRose, Geometric continuity of parametric curves: three equivalent characterizations, IEEE
Comput. Graph. Appl. 9(6) (1989) 60-69.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.basis import GT, Basis, Family
from gtcad.curve import Curve
from gtcad.errors import InputError, SingularJoin

Array = NDArray[np.float64]
Scale = tuple[float, float, float]

MAX_ORDER = 3
PARAMETRIC: Scale = (1.0, 0.0, 0.0)
_INVISIBLE = 1e-6  # of the size: derivatives, and curvatures times the size, of which less makes no difference
_SINGULAR = 1e-10  # of a row's largest coefficient, and of the size of the first curve's derivatives


class Derivable(Protocol):
    """A curve, or a spline, with derivatives on a domain."""

    @property
    def domain(self) -> tuple[float, float]:
        """First and last parameter."""
        ...

    def derivative(self, t: ArrayLike, order: int = 1) -> Array:
        """Derivatives of the order, 0 the point."""
        ...


@dataclass(frozen=True)
class Thresholds:
    """What still counts as continuous.

    Attributes
    ----------
    gap
        Distance of the end points, in the model's unit.
    angle_deg
        Angle of the tangents, in degrees.
    curvature
        Jump of the curvature vector, relative to the larger curvature.
    curvature_rate
        Jump of the third derivative by arc length, relative to the larger one.
    """

    gap: float = 1e-7
    angle_deg: float = 1e-6
    curvature: float = 1e-6
    curvature_rate: float = 1e-4


@dataclass(frozen=True)
class JoinReport:
    """What happens where one curve ends and the next begins.

    Attributes
    ----------
    gap
        Distance of the end points, in the model's unit.
    tangent_angle_deg
        Angle of the tangents, in degrees; NaN where a curve has no tangent.
    curvature_jump
        Norm of the jump of the curvature vector over the larger of both curvatures.
    curvature_rate_jump
        Jump of d kappa / ds over the larger of |d kappa / ds| and kappa^2 on both sides.
    torsion_jump
        Jump of the torsion, in the inverse of the unit; 0 for plane curves.
    parametric_jumps
        Jumps of the first, second and third derivative by the parameter, relative like the geometric ones.
    parametric_order, geometric_order
        The highest k of C^k and of G^k within the thresholds; -1 when the gap is too wide. C^k is G^k as well.
    """

    gap: float
    tangent_angle_deg: float
    curvature_jump: float
    curvature_rate_jump: float
    torsion_jump: float
    parametric_jumps: tuple[float, float, float]
    parametric_order: int
    geometric_order: int

    @property
    def order(self) -> str:
        """The highest order, "C3" to "C0" or "G1" to "G3", C before G at equal orders; "none" with too wide a gap."""
        return highest_order(self.parametric_order, self.geometric_order)

    def meets(self, order: str) -> bool:
        """Whether the join is of that order: C^k counts as G^k too."""
        return meets_order(order, self.parametric_order, self.geometric_order)


def highest_order(parametric: int, geometric: int) -> str:
    """The name of the higher one of two orders, C before G when they are equal; "none" below 0."""
    if parametric < 0:
        return "none"
    return f"C{parametric}" if parametric >= geometric else f"G{geometric}"


def meets_order(order: str, parametric: int, geometric: int) -> bool:
    """Whether C^parametric and G^geometric are the order, such as "G2"."""
    kind, wanted = parsed_order(order)
    return parametric >= wanted or (kind == "G" and geometric >= wanted)


def parsed_order(order: str) -> tuple[str, int]:
    """("C" or "G", 0 to 3).

    Raises
    ------
    InputError
        When the text is none of "C0" to "C3" and "G0" to "G3".
    """
    if not (isinstance(order, str) and len(order) == 2 and order[0] in "CG" and order[1] in "0123"):
        raise InputError(f'order must be one of "C0" to "C3" and "G0" to "G3", got {order!r}')
    return order[0], int(order[1])


@dataclass(frozen=True)
class Start:
    """How the derivatives 0..k at the start of a curve depend on its first k + 1 control points.

    Attributes
    ----------
    matrix
        Row r gives the r-th derivative: lower triangular, shape (k + 1, k + 1).
    conditioning
        For each row its last coefficient over its largest: near 0 the control point is badly determined.
    """

    matrix: Array
    conditioning: tuple[float, ...] = field(default=())

    @classmethod
    def of(cls, basis: Basis, order: int) -> Start:
        """Of the curves of a basis, for the derivatives 0..order.

        Raises
        ------
        SingularJoin
            When a control point is not determined: its coefficient is below 1e-10 of the largest one of its row.
        """
        if basis.degree < order:
            raise SingularJoin(f"degree {basis.degree} has too few control points for order {order}", 0.0)
        rows = np.array([basis.derivative(0.0, r) for r in range(order + 1)])
        matrix = np.tril(rows[:, : order + 1])
        largest = np.abs(rows).max(axis=1)
        conditioning = tuple(
            float(abs(matrix[r, r]) / largest[r]) if largest[r] > _SINGULAR else 0.0 for r in range(order + 1)
        )
        for r, value in enumerate(conditioning):
            if value < _SINGULAR:
                raise SingularJoin(
                    f"degree {basis.degree} with gamma = {basis.gamma} leaves control point {r} undetermined: "
                    f"no join of order {r} can start this curve",
                    value,
                )
        return cls(matrix, conditioning)


def chain_rule(scale: Scale, count: int) -> Array:
    """Matrix from D_0.. to T_0.. for a reparametrisation with the scale factors, shape (count, count), count <= 4."""
    eta, psi, omega = scale
    rules = [
        [1.0, 0.0, 0.0, 0.0],
        [0.0, eta, 0.0, 0.0],
        [0.0, psi, eta**2, 0.0],
        [0.0, omega, 3 * eta * psi, eta**3],
    ]
    return np.array(rules)[:count, :count]


def join_curve(
    curve: Derivable,
    degree: int,
    *,
    order: str,
    gamma: Sequence[float] = (0.0, 0.0),
    scale: Scale = PARAMETRIC,
    rest: ArrayLike = (),
    family: Family = GT,
) -> Curve:
    """The curve that continues another one, joined C^k or G^k at its end.

    Parameters
    ----------
    curve
        The first curve; any shape with derivatives.
    degree, gamma, family
        Of the new curve.
    order
        "C0" to "C3" or "G0" to "G3".
    scale
        (eta, psi, omega) of a G join, eta > 0; left alone for a C join.
    rest
        The control points after the first k + 1, shape (degree - k, d).

    Returns
    -------
    Curve
        Its first k + 1 control points follow from the join.

    Raises
    ------
    InputError
        When an argument is out of its range or ``rest`` has another shape.
    SingularJoin
        When the first curve has no tangent at its end, or a control point is not determined: degree 2 with
        gamma_1 = -1; order 2 with degree 2 and gamma_2 = 1 or degree 3 and gamma = (-1, 1); order 3 with degree 2,
        degree 3 and gamma_2 = 1 or degree 4 and gamma = (-1, 1).

    Examples
    --------
    C1: the first leg of the new polygon continues the last one of the old.

    >>> first = Curve([[0, 0], [1, 1], [2, 0]])
    >>> join_curve(first, 2, order="C1", rest=[[4, 0]]).control_points.round(12).tolist()
    [[2.0, 0.0], [3.0, -1.0], [4.0, 0.0]]
    """
    kind, count = parsed_order(order)
    if kind == "C" and tuple(scale) != PARAMETRIC:
        raise InputError(f"scale is for G joins; a {order} join has (1, 0, 0), got {tuple(scale)}")
    if len(scale) != 3 or not all(math.isfinite(x) for x in scale) or not scale[0] > 0:
        raise InputError(f"scale must be three finite numbers (eta, psi, omega) with eta > 0, got {tuple(scale)}")
    basis = Basis(degree, (float(gamma[0]), float(gamma[1])), family)
    start = Start.of(basis, count)
    ends = _end_derivatives(curve, count)
    points = np.linalg.solve(start.matrix, chain_rule(scale, len(ends)) @ ends)
    points[0] = ends[0]
    free = checked_rest("points", rest, (degree - count, points.shape[1]), f"degree {degree}, {order}")
    return Curve(np.concatenate([points, free]), basis.gamma, family)


def checked_rest(what: str, rest: ArrayLike, shape: tuple[int, int], wanting: str) -> Array:
    """The control points, or planes, that a join leaves free.

    Raises
    ------
    InputError
        When there are not so many of that length.
    """
    try:
        rows = np.asarray(rest, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"rest must be control {what}, shape {shape}: {error}") from None
    rows = rows if rows.size else np.empty((0, shape[1]))
    if rows.ndim != 2 or rows.shape[1] != shape[1]:
        raise InputError(f"rest must be control {what}, shape {shape}, got {rows.shape}")
    if len(rows) != shape[0]:
        raise InputError(f"rest must be {shape[0]} control {what} for {wanting}; got {len(rows)}")
    return rows


def _end_derivatives(curve: Derivable, order: int) -> Array:
    end = curve.domain[1]
    ends = np.array([curve.derivative(end, r) for r in range(order + 1)])
    size = max(float(np.ptp(_sampled(curve), axis=0).max()), np.finfo(float).tiny)
    if order and np.linalg.norm(ends[1]) < _SINGULAR * size:
        raise SingularJoin("the first curve has no tangent at its end: its first derivative vanishes there", 0.0)
    return ends


def _sampled(curve: Derivable) -> Array:
    return curve.derivative(np.linspace(*curve.domain, 17), 0)


def speed_bounds(guess: Array, speeds: Sequence[int]) -> tuple[Array, Array]:
    """Bounds that keep the logarithms of speeds within a factor 8 of the guess: no tangent may vanish."""
    lower, upper = np.full(len(guess), -np.inf), np.full(len(guess), np.inf)
    lower[list(speeds)], upper[list(speeds)] = guess[list(speeds)] - math.log(8), guess[list(speeds)] + math.log(8)
    return lower, upper


def join_nearest(curve: Derivable, wanted: Curve, order: str) -> tuple[Curve, Scale]:
    """The join of that order whose first control points are nearest to those of a wanted curve.

    The scale factors of a G join are chosen to minimise the sum of squared distances of the first k + 1 control
    points; a C join has none to choose.

    Returns
    -------
    curve, scale
        The joined curve, with the other control points of the wanted one, and its (eta, psi, omega).

    Raises
    ------
    InputError, SingularJoin
        As ``join_curve``.
    """
    from scipy.optimize import least_squares

    kind, count = parsed_order(order)
    rest = wanted.control_points[count + 1 :]

    def joined(scale: Scale) -> Curve:
        return join_curve(
            curve, wanted.degree, order=order, gamma=wanted.gamma, scale=scale, rest=rest, family=wanted.family
        )

    if kind == "C" or count == 0:
        return joined(PARAMETRIC), PARAMETRIC
    inverse = np.linalg.inv(Start.of(wanted.factors, count).matrix)
    ends, goal = _end_derivatives(curve, count), wanted.control_points[: count + 1]

    def completed(free: Array) -> Scale:
        psi, omega = (*free[1:], 0.0, 0.0)[:2]
        return math.exp(free[0]), float(psi), float(omega)

    def misses(free: Array) -> Array:
        return np.asarray(inverse @ chain_rule(completed(free), len(ends)) @ ends - goal)[1:].reshape(-1)

    size = np.linalg.norm(np.ptp(wanted.control_points, axis=0))
    speed = max(float(np.linalg.norm(wanted.derivative(0.0))), 1e-3 * float(size)) / float(np.linalg.norm(ends[1]))
    guess = np.array([math.log(speed), 0.0, 0.0])[:count]
    found = completed(least_squares(misses, guess, bounds=speed_bounds(guess, [0]), x_scale="jac").x)
    return joined(found), found


def check_join(a: Derivable, b: Derivable, *, thresholds: Thresholds = Thresholds()) -> JoinReport:
    """What happens where curve a ends and curve b starts, for shapes and for splines alike.

    Parameters
    ----------
    a, b
        Curves, chains or splines of one dimension, in one unit.
    thresholds
        What still counts as continuous.

    Returns
    -------
    JoinReport
        Gap, angle and jumps, and the highest ``order`` that they allow.

    Raises
    ------
    InputError
        When one is no curve, or they have different dimensions.

    Examples
    --------
    >>> first = Curve([[0, 0], [1, 1], [2, 0]], gamma=(0.2, 0.5))
    >>> check_join(first, join_curve(first, 3, order="G2", scale=(2.0, 0.3, 0.0), rest=[[4, 1]])).order
    'G2'
    """
    for name, curve in (("a", a), ("b", b)):
        if not hasattr(curve, "domain"):
            raise InputError(f"{name} must be a curve, a chain or a spline, got {type(curve).__name__}")
    ends = np.array([a.derivative(a.domain[1], r) for r in range(MAX_ORDER + 1)])
    starts = np.array([b.derivative(b.domain[0], r) for r in range(MAX_ORDER + 1)])
    if ends.shape != starts.shape:
        raise InputError(f"both curves must have one dimension, got {ends.shape[1]} and {starts.shape[1]}")
    ends, starts = (np.pad(one, ((0, 0), (0, 3 - one.shape[1]))) for one in (ends, starts))
    size = max(float(np.ptp(np.concatenate([_sampled(a), _sampled(b)]), axis=0).max()), np.finfo(float).tiny)
    gap = float(np.linalg.norm(starts[0] - ends[0]))
    jumps = tuple(_relative(ends[r], starts[r], _INVISIBLE * size) for r in (1, 2, 3))
    if min(np.linalg.norm(ends[1]), np.linalg.norm(starts[1])) < _SINGULAR * size:
        nan = math.nan
        met = 0 if gap <= thresholds.gap else -1
        return JoinReport(gap, nan, nan, nan, nan, jumps, met, met)  # type: ignore[arg-type]
    before, after = _by_length(ends), _by_length(starts)
    angle = _angle_deg(before.tangent, after.tangent)
    least = _INVISIBLE / size
    curvature = _relative(before.bend, after.bend, least)
    third = _relative(before.third, after.third, least / size)
    rate_scale = max(abs(before.rate), abs(after.rate), before.curvature**2, after.curvature**2, least / size)
    measured = (angle / thresholds.angle_deg, curvature / thresholds.curvature, third / thresholds.curvature_rate)
    limits = (thresholds.angle_deg * math.pi / 180, thresholds.curvature, thresholds.curvature_rate)
    geometric = _reached([x <= 1 for x in measured])
    parametric = _reached([jump <= max(limit, 1e-8) for jump, limit in zip(jumps, limits, strict=True)])
    open_ends = gap > thresholds.gap
    return JoinReport(
        gap,
        angle,
        curvature,
        abs(after.rate - before.rate) / rate_scale,
        abs(after.torsion - before.torsion),
        jumps,  # type: ignore[arg-type]
        -1 if open_ends else parametric,
        -1 if open_ends else geometric,
    )


@dataclass(frozen=True)
class _ByLength:
    """Derivatives by arc length at one end: tangent, curvature vector, third derivative; and what follows."""

    tangent: Array
    bend: Array
    third: Array
    curvature: float
    rate: float
    torsion: float


def _by_length(derivatives: Array) -> _ByLength:
    """By the inverse function's chain rule, s' = |C'|."""
    first, second, third = derivatives[1:4]
    speed = float(np.linalg.norm(first))
    tangent = first / speed
    accel = float(tangent @ second)
    bend = (second - accel * tangent) / speed**2
    jerk = float(tangent @ third) + float(second @ second - accel**2) / speed
    by_length = (third - 3 * accel * speed * bend - jerk * tangent) / speed**3
    curvature = float(np.linalg.norm(bend))
    if curvature == 0:
        return _ByLength(tangent, bend, by_length, 0.0, float(np.linalg.norm(by_length)), 0.0)
    rate = float(bend @ by_length) / curvature
    twist = float(np.linalg.det([tangent, bend, by_length])) / curvature**2
    return _ByLength(tangent, bend, by_length, curvature, rate, twist)


def _relative(a: Array, b: Array, least: float) -> float:
    larger = max(float(np.linalg.norm(a)), float(np.linalg.norm(b)), least)
    return float(np.linalg.norm(b - a)) / larger


def _angle_deg(a: Array, b: Array) -> float:
    """By the chord, which keeps its digits for small angles."""
    return math.degrees(2 * math.asin(min(1.0, float(np.linalg.norm(b - a)) / 2)))


def _reached(met: Sequence[bool]) -> int:
    return next((k for k, one in enumerate(met) if not one), len(met))
