"""TB-Coons patches: the Boolean sum of four GT boundary curves, and those of least energy with a part of it free."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.basis import is_whole
from gtcad.curve import Curve
from gtcad.errors import InputError
from gtcad.patches._forms import Energy, checked_energy, rule
from gtcad.patches._patch import LINEAR
from gtcad.patches.coons import Coons

Array = NDArray[np.float64]
ControlPoint = tuple[str, int]

_IDLE = 1e-13  # of the largest: the energy of a function that vanishes
BOUNDARIES = ("c0", "c1", "d0", "d1")


@dataclass(frozen=True)
class TBCoons(Coons):
    """The Boolean sum of four GT boundary curves: ``(1-v) c0 + v c1 + (1-u) d0 + u d1 - bilinear(corners)``.

    A Coons patch that is a function of the boundary control points alone: every one of them has a cardinal function,
    such as ``f_i(u) (1 - v)`` for the inner ones of c0.

    Parameters
    ----------
    c0, c1, d0, d1
        As of ``Coons``, each a ``Curve`` of any degree, design variables and family.

    Raises
    ------
    InputError
        When one is no ``Curve``, the dimensions differ, or two ends are apart at a corner.

    Examples
    --------
    A vault between two quarter circles:

    >>> arc, rail = [[1, 0, 0], [1, 0, 1], [0, 0, 1]], [[1, 0, 0], [1, 1, 0], [1, 2, 0]]
    >>> shift = [0, 2, 0], [-1, 0, 1]
    >>> vault = TBCoons(Curve(arc), Curve(np.add(arc, shift[0])), Curve(rail), Curve(np.add(rail, shift[1])))
    >>> np.abs(vault.evaluate(0.5, [0.0, 0.5, 1.0])[:, 0] - np.sqrt(0.5)).max() < 1e-15
    np.True_
    """

    def __post_init__(self) -> None:
        for name in BOUNDARIES:
            if not isinstance(getattr(self, name), Curve):
                raise InputError(f"{name} must be a Curve, got {type(getattr(self, name)).__name__}")
        super().__post_init__()

    def transformed(self, matrix: ArrayLike, translation: ArrayLike | None = None) -> TBCoons:
        """The affine image: points x become ``matrix @ x + translation``."""
        return TBCoons(*(getattr(self, name).transformed(matrix, translation) for name in BOUNDARIES))

    @property
    def inner(self) -> tuple[ControlPoint, ...]:
        """All boundary control points but the corners, as pairs such as ("c0", 1)."""
        return tuple((name, k) for name in BOUNDARIES for k in range(1, getattr(self, name).degree))


def tb_coons_extremal(patch: Coons, free: Iterable[ControlPoint], functional: Energy = "dirichlet") -> TBCoons:
    """The TB-Coons patch of least energy when some boundary control points are free: setting "free boundary".

    With the cardinal functions phi_k of the free points P_k, ``S = S_0 + sum_k phi_k P_k`` and the energy is quadratic
    in the P: one linear system.

    Parameters
    ----------
    patch
        A ``TBCoons``, or a ``Coons`` patch of four ``Curve``; its control points stay but for the free ones.
    free
        Pairs of a boundary, "c0", "c1", "d0" or "d1", and the index of a control point, neither the first nor the last.
    functional
        "dirichlet", "quasi-harmonic" or "bending".

    Raises
    ------
    InputError
        When a pair names no inner control point, or names one twice; or when none but the corners would stay: the
        patch of least energy then shrinks to nearly nothing, with four thorns.

    Notes
    -----
    The boundary moves with the free points: areas of different results are not areas over one contour.

    Examples
    --------
    One rail of a flat strip is free, and is drawn in:

    >>> from gtcad import BERNSTEIN
    >>> rails = [[[i, y, 0] for i in range(3)] for y in (0, 3)]
    >>> ends = [[[x, y, 0] for y in (0, 3)] for x in (0, 2)]
    >>> strip = TBCoons(*map(Curve, rails), *(Curve(end, family=BERNSTEIN) for end in ends))
    >>> drawn = tb_coons_extremal(strip, [("c1", 1)])
    >>> bool(drawn.c1.control_points[1, 1] < 3), drawn.c0 == strip.c0
    (True, True)
    """
    form = checked_energy(functional)
    whole = patch if isinstance(patch, TBCoons) else TBCoons(*(getattr(patch, name) for name in BOUNDARIES))
    points = _checked_free(whole, free)
    if not points:
        return whole
    (u, weights_u), (v, weights_v) = (rule(factors, LINEAR) for factors in (whole.factors_u, whole.factors_v))
    along_u = {order: np.stack([_cardinal(whole, point, "u", u, order) for point in points]) for order in (0, 1, 2)}
    along_v = {order: np.stack([_cardinal(whole, point, "v", v, order) for point in points]) for order in (0, 1, 2)}
    matrix, right = np.zeros((len(points), len(points))), np.zeros((len(points), whole.dimension))
    for weight, (a, a_base), (b, b_base) in form:
        left = along_u[a] * weights_u, along_v[b] * weights_v
        matrix += weight * (left[0] @ along_u[a_base].T) * (left[1] @ along_v[b_base].T)
        forces = whole.derivative(u[:, None], v[None, :], (a_base, b_base))
        right -= weight * np.einsum("ku,kv,uvd->kd", *left, forces, optimize=True)
    idle = np.flatnonzero(np.diag(matrix) <= _IDLE * np.diag(matrix).max())
    if len(idle):
        raise InputError(f"free: the control point {points[idle[0]]} has no influence: its function vanishes")
    change = np.linalg.solve(matrix, right)
    curves = {name: np.array(getattr(whole, name).control_points) for name in BOUNDARIES}
    for (name, index), step in zip(points, change, strict=True):
        curves[name][index] += step
    return TBCoons(*(_with_points(getattr(whole, name), curves[name]) for name in BOUNDARIES))


def _checked_free(patch: TBCoons, free: Iterable[Any]) -> list[ControlPoint]:
    allowed = patch.inner
    points: list[ControlPoint] = []
    for entry in free:
        pair = tuple(entry) if isinstance(entry, Iterable) and not isinstance(entry, str) else ()
        if len(pair) != 2 or pair[0] not in BOUNDARIES or not is_whole(pair[1]):
            raise InputError(f"free must hold pairs such as ('c0', 1), of {', '.join(BOUNDARIES)}, got {entry!r}")
        point = (pair[0], int(pair[1]))
        if point not in allowed:
            last = getattr(patch, point[0]).degree - 1
            inner = f"1 to {last} are inner ones" if last else "it has no inner ones"
            raise InputError(f"free: {point[0]} has no inner control point {point[1]}: {inner}")
        if point in points:
            raise InputError(f"free: {point} is named twice")
        points.append(point)
    if points and len(points) == len(allowed):
        raise InputError(
            f"free: all {len(allowed)} boundary control points but the corners are free, and the patch would "
            "collapse: keep a part of the boundary"
        )
    return points


def _cardinal(patch: TBCoons, point: ControlPoint, direction: str, t: Array, order: int) -> Array:
    """The factor of u or of v of the cardinal function of a control point."""
    name, index = point
    curve: Curve = getattr(patch, name)
    if (name[0] == "c") == (direction == "u"):
        return np.asarray(curve.factors.rows(t, order)[index])
    return np.asarray(LINEAR.rows(t, order)[int(name[1])])


def _with_points(curve: Curve, points: Array) -> Curve:
    return Curve(points, curve.gamma, curve.family)
