"""Joins to what a host holds: curves that continue an edge, patches that continue a face.

All lengths are in mm. A host's shape is one of build123d or CadQuery, or the kernel's own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.basis import BERNSTEIN
from gtcad.continuity import Scale, Thresholds, join_curve, parsed_order
from gtcad.converters.bspline import BSplineSurface
from gtcad.converters.face_designs import fitting
from gtcad.converters.host_designs import DEFAULT_TOLERANCE, HostCurve, core_of_edge, core_of_face
from gtcad.curve import Curve
from gtcad.edge_check import EdgeReport, check_edge
from gtcad.errors import InputError, ToleranceNotMet
from gtcad.patch_joins import join_patch
from gtcad.protocol import SeparableCurve
from gtcad.surface import Surface

Array = NDArray[np.float64]


def curve_on_edge(
    edge: Any,
    points: Sequence[ArrayLike],
    *,
    order: str = "G1",
    at: float = 1.0,
    gamma: Sequence[float] = (0.0, 0.0),
    scale: Scale | None = None,
) -> Curve:
    """The GT curve that continues an edge of a host, joined G^k where it starts.

    Parameters
    ----------
    edge
        An edge of build123d or CadQuery, or a TopoDS_Edge.
    points
        The control points after those that the join gives (k + 1 of them), at least one, in mm.
    order
        "G0" to "G3".
    at
        Where on the edge: 1 at its end, going on; 0 at its start, going back; between them going on.
    gamma
        Design variables of the new curve.
    scale
        (eta, psi, omega) of the join, by length along the edge: eta is the speed at the start in mm, by default the
        distance from there to the last point.

    Raises
    ------
    InputError
        When an argument is out of its range.
    SingularJoin
        As ``join_curve``.
    KernelError
        When the edge has no exact rational form.
    """
    kind, count = parsed_order(order)
    if kind != "G":
        raise InputError(f'order must be "G0" to "G3": the parameter of a host\'s edge means nothing, got {order!r}')
    source = core_of_edge(edge, at=at)
    rest = _points(points)
    if scale is None:
        reach = float(np.linalg.norm(rest[-1] - source.evaluate(source.domain[1])))
        scale = (reach or 1.0, 0.0, 0.0)
    return join_curve(source, count + len(rest), order=order, gamma=gamma, scale=scale, rest=rest)


def _points(points: Sequence[ArrayLike]) -> Array:
    try:
        found = np.array([np.asarray(tuple(one), dtype=np.float64) for one in points])  # type: ignore[arg-type]
    except (TypeError, ValueError) as error:
        raise InputError(f"points must be points of the host or of three numbers: {error}") from None
    if found.ndim != 2 or found.shape[1] not in (2, 3) or not np.isfinite(found).all():
        raise InputError(f"points must be at least one point of three finite numbers, got shape {found.shape}")
    return np.pad(found, ((0, 0), (0, 3 - found.shape[1])))


@dataclass(frozen=True, eq=False)
class FaceJoin:
    """A GT patch that continues a face of a host, and how well it does.

    Attributes
    ----------
    surface
        u runs away from the face, v along the edge.
    report
        Of the exact patch against the face's surface: its figures are those of samples.
    """

    surface: Surface
    report: EdgeReport


def patch_on_face(
    face: Any,
    edge: Any,
    curve: SeparableCurve,
    *,
    order: str = "G1",
    reach: float | None = None,
    tolerance: float = DEFAULT_TOLERANCE,
    thresholds: Thresholds | None = None,
    max_degree: int = 24,
) -> FaceJoin:
    """The GT patch from an edge of a host's face to a given curve, joined G^k along the whole edge.

    The derivatives across the edge are approximated by GT functions along it, of the least degree for which
    ``check_edge`` finds the order; at G2 the patch has degree 3 away from the face, at G1 degree 2.

    Parameters
    ----------
    face
        A face of build123d or CadQuery, or a TopoDS_Face.
    edge
        One of its edges, all of a side u or v = constant of the surface.
    curve
        The opposite side of the patch, in either direction.
    order
        "G0", "G1" or "G2".
    reach
        Speed away from the edge in mm (mean along it), by default the mean distance from the edge to the curve.
    tolerance
        Largest distance from the edge, and of the opposite side from the curve, in mm.
    thresholds
        What still counts as continuous: the tolerance, 0.001 degrees and 0.001 of the curvature unless given.
    max_degree
        Largest degree along the edge.

    Raises
    ------
    InputError
        When an argument is out of its range, or the edge is no whole side of the face's surface.
    ToleranceNotMet
        When no degree reaches the order.
    KernelError
        When the surface has no exact rational form.
    """
    kind, count = parsed_order(order)
    if kind != "G" or count > 2:
        raise InputError(f'order must be "G0", "G1" or "G2", got {order!r}')
    limits = thresholds or Thresholds(tolerance, 1e-3, 1e-3, 1e-2)
    spline, side = _side_of(core_of_face(face), core_of_edge(edge))
    x = (1 - np.cos(np.linspace(0, np.pi, 4 * max_degree + 9))) / 2
    ends = _outwards(spline, side, x, count)
    far = _lifted(curve.evaluate(x))
    if np.linalg.norm(far[[-1, 0]] - ends[0][[0, -1]]) < np.linalg.norm(far[[0, -1]] - ends[0][[0, -1]]):
        far = _lifted(curve.evaluate(1 - x))
    speed = float(np.linalg.norm(ends[1], axis=-1).mean()) if count else 1.0
    if not speed > 0:
        raise InputError("the face has no direction across this edge: it is a point there")
    eta = (float(np.linalg.norm(far - ends[0], axis=-1).mean()) if reach is None else float(reach)) / speed
    if not eta > 0:
        raise InputError(f"reach must be above 0, got {reach!r}: or the curve is the edge itself")
    least = np.inf
    for degree in range(2, max_degree + 1):
        surface = _joined_patch(ends, far, degree, x, eta)
        report = check_edge(spline, side, surface, "u0", thresholds=limits)
        missed = float(np.linalg.norm(surface.evaluate(1.0, x) - far, axis=-1).max())
        if missed <= tolerance and report.meets(order):
            return FaceJoin(surface, report)
        least = min(least, max(missed, report.gap[1]))
    raise ToleranceNotMet(
        tolerance, float(least), 1, f"{order} is not reached up to degree {max_degree} along the edge"
    )


def _lifted(points: Array) -> Array:
    return np.pad(points, ((0, 0), (0, 3 - points.shape[1])))


def _side_of(spline: BSplineSurface, edge: HostCurve) -> tuple[BSplineSurface, str]:
    """The surface, u across the edge, and which of its sides the edge is: "u0" or "u1"."""
    points = edge.evaluate(np.linspace(*edge.domain, 9))
    gaps = {}
    for side in ("u0", "u1", "v0", "v1"):
        curve = spline.boundary(side)
        line = curve.evaluate(np.linspace(*curve.domain, 513))
        chord = float(np.linalg.norm(np.diff(line, axis=0), axis=-1).max())
        gap = float(np.linalg.norm(points[:, None] - line, axis=-1).min(axis=1).max())
        ends = line[[0, -1]] - points[[0, -1]], line[[-1, 0]] - points[[0, -1]]
        apart = min(float(np.linalg.norm(one, axis=-1).max()) for one in ends)
        gaps[side] = max(apart, gap - chord)
    side = min(gaps, key=lambda one: gaps[one])
    size = float(np.ptp(spline.control_points.reshape(-1, 3), axis=0).max())
    if gaps[side] > 1e-6 * size:
        raise InputError(
            f"the edge must be a whole side of the face's surface: it is {gaps[side]:.3g} mm from the nearest one"
        )
    return (spline, side) if side[0] == "u" else (spline.transposed(), "u" + side[1])


def _outwards(spline: BSplineSurface, side: str, x: Array, order: int) -> Array:
    """Derivatives 0..order by u, out of the patch, per unit of its whole width: shape (order + 1, n, 3)."""
    across, along = spline.domain
    fixed = np.full_like(x, across[int(side[1])])
    rate = (across[1] - across[0]) * (1 if side == "u1" else -1)
    y = along[0] + (along[1] - along[0]) * x
    return np.array([spline.derivative(fixed, y, (r, 0)) * rate**r for r in range(order + 1)])


def _joined_patch(ends: Array, far: Array, degree: int, x: Array, eta: float) -> Surface:
    """The patch with these derivatives at u = 0, times the powers of eta, as functions of that degree along v."""
    count, fit = len(ends) - 1, fitting(degree, x)
    point, *others = np.einsum("jb,rbd->rjd", fit, ends)
    first = others[0] if others else np.zeros_like(point)
    second = others[1] if count == 2 else np.zeros_like(point)
    # the polynomial of degree 2 with these at its end: what join_patch takes them from
    before = Surface(np.array([point - first + second / 2, point - first / 2, point]), family_u=BERNSTEIN)
    scale = (eta, 0.0, 0.0)
    return join_patch(
        before, "u1", max(2, count + 1), order=f"G{count}", scale=scale, rest=_rest(point, fit @ far, count)
    )


def _rest(near: Array, far: Array, count: int) -> Array:
    """The rows that the join leaves free: the last one, at G0 with the middle before it."""
    return np.array([(near + far) / 2, far]) if count == 0 else far[None]
