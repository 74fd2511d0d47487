"""GT shapes made for what a host holds: nearest to its edges and faces, and joined to them.

All lengths are in mm. A host's shape is one of build123d or CadQuery, or the kernel's own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.basis import BERNSTEIN, Basis
from gtcad.continuity import Scale, Thresholds, join_curve, parsed_order
from gtcad.converters.bspline import BSplineSurface
from gtcad.converters.chain import as_curve
from gtcad.converters.design import Design, nearest_chain, nearest_gt
from gtcad.converters.fit import Degree
from gtcad.curve import Curve
from gtcad.edge_check import EdgeReport, check_edge
from gtcad.errors import InputError, ToleranceNotMet
from gtcad.patch_joins import join_patch
from gtcad.protocol import SeparableCurve
from gtcad.surface import Surface

Array = NDArray[np.float64]

DEFAULT_TOLERANCE = 1e-3
"""mm: what a host's object keeps unless told otherwise."""

DEFAULT_DEGREE: Degree = "auto"
"""Of the splines: one span of a high degree where that needs the fewest poles. Kernels shell and fillet it best."""

_LEAST_PART = 1e-3
_EDGE_DEGREE, _CHAIN_DEGREE, _FACE_DEGREE = 8, 5, 16


# --- from the kernel --------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class HostCurve:
    """An edge of a host as a curve with derivatives, on [0, length], in the direction of the edge.

    Attributes
    ----------
    geometry
        The curve under the edge, in mm.
    start, end
        The parameters of `geometry` where the edge, or the part of it that is meant, starts and ends.
    length
        Of the parameter: such that the speed at the end is 1.
    """

    geometry: Any
    start: float
    end: float
    length: float = 1.0

    @property
    def domain(self) -> tuple[float, float]:
        """First and last parameter."""
        return 0.0, self.length

    def evaluate(self, t: ArrayLike) -> Array:
        """Points, shape t.shape + (3,)."""
        return self.derivative(t, 0)

    def derivative(self, t: ArrayLike, order: int = 1) -> Array:
        """Derivatives of the order, shape t.shape + (3,)."""
        rate = (self.end - self.start) / self.length
        x = self.start + rate * np.asarray(t, dtype=np.float64)
        derived: Array = self.geometry.derivative(np.clip(x, *self.geometry.domain), order)
        return derived * rate**order


def core_of_edge(edge: Any, *, at: float = 1.0) -> HostCurve:
    """The curve of a host's edge from its start to the place ``at``, or with ``at=0`` from its end to its start.

    Parameters
    ----------
    edge
        An edge of build123d or CadQuery, or a TopoDS_Edge.
    at
        0, or in [0.001, 1] of the parameter of the edge's curve.

    Raises
    ------
    InputError
        When it is no edge, or ``at`` is out of range.
    KernelError
        When the edge has no exact rational form.
    """
    from gtcad.converters.occt.compat import kernel_guard, kernel_module
    from gtcad.converters.occt.pieces import edge_geometry

    if not (at == 0 or _LEAST_PART <= at <= 1):
        raise InputError(f"at must be 0, or lie in [{_LEAST_PART}, 1], got {at!r}")
    shape = _topology(edge, "EDGE")
    with kernel_guard("the curve of an edge"):
        curve = as_curve(edge_geometry(shape)[0])
    first, last = curve.domain
    if shape.Orientation() == kernel_module("TopAbs").TopAbs_REVERSED:
        first, last = last, first
    ends = (last, first) if at == 0 else (first, first * (1 - at) + last * at)
    whole = HostCurve(curve, *ends)
    speed = float(np.linalg.norm(whole.derivative(1.0)))
    return HostCurve(curve, *ends, speed) if speed > 0 else whole


def core_of_face(face: Any) -> BSplineSurface:
    """The surface under a host's face, as a B-spline: all of the face, and more where it is trimmed.

    Raises
    ------
    InputError
        When it is no face.
    KernelError
        When the surface has no exact rational form.
    """
    from gtcad.converters.occt.compat import kernel_guard
    from gtcad.converters.occt.pieces import face_geometry

    with kernel_guard("the surface of a face"):
        return face_geometry(_topology(face, "FACE"))[0]


def _topology(given: Any, kind: str) -> Any:
    shape = getattr(given, "wrapped", given)
    name = type(shape).__name__
    if not name.startswith("TopoDS_") or shape.IsNull() or not str(shape.ShapeType()).endswith(f"_{kind}"):
        raise InputError(f"{kind.lower()} must be one of the host's {kind.lower()}s, got {type(given).__name__}")
    return shape


# --- designs for what a host holds ------------------------------------------------------------------------------------


def design_from_edge(
    edge: Any, *, tolerance: float = DEFAULT_TOLERANCE, degree: int | None = None, order: str = "G1"
) -> Design[Any]:
    """The GT curve nearest to an edge, in the edge's direction, or a chain of them where one is not enough.

    Parameters
    ----------
    edge
        An edge of build123d or CadQuery, or a TopoDS_Edge.
    tolerance
        Largest deviation allowed, in mm.
    degree
        Of the one curve, or of the chain's pieces; by default the least up to 8 for one curve, 5 for a chain.
    order
        Of the chain's joints, as of ``nearest_chain``.

    Raises
    ------
    InputError, ToleranceBelowPrecision, ToleranceNotMet, KernelError
        As ``nearest_chain``.
    """
    from gtcad.converters.occt.compat import kernel_guard

    with kernel_guard("the curve of an edge"):
        shape = _topology(edge, "EDGE")
    try:
        return nearest_gt(shape, degree or _EDGE_DEGREE, tolerance=tolerance, gamma=(0.0, 0.0))
    except ToleranceNotMet:
        return nearest_chain(shape, degree or _CHAIN_DEGREE, tolerance=tolerance, order=order, gamma=(0.0, 0.0))


@dataclass(frozen=True, eq=False)
class FaceDesign:
    """A GT patch made for a face.

    Attributes
    ----------
    surface
        In the directions of the face's surface, whatever the face's orientation.
    deviation
        (lower, upper) in mm, at equal parameters: the lower one is attained, the upper one proved.
    """

    surface: Surface
    deviation: tuple[float, float]


def design_from_face(
    face: Any, *, tolerance: float = DEFAULT_TOLERANCE, max_degree: int = _FACE_DEGREE, untrimmed: bool = False
) -> FaceDesign:
    """The GT patch of the least degrees found within a tolerance of a face.

    Parameters
    ----------
    face
        A face of build123d or CadQuery, or a TopoDS_Face.
    tolerance
        Largest deviation allowed, in mm.
    max_degree
        Largest degree of each direction, 2 to 40.
    untrimmed
        Whether to take all of the surface under a face that is only a part of it.

    Raises
    ------
    InputError
        When the face is trimmed and that is not allowed, or an argument is out of its range.
    ToleranceNotMet
        When no degrees keep the tolerance: one patch is smooth, and cannot follow the knots of a spline closely.
    KernelError
        When the surface has no exact rational form.
    """
    from gtcad.converters.certificate import certify_surface
    from gtcad.converters.occt.compat import kernel_guard
    from gtcad.converters.occt.pieces import face_geometry

    if not 2 <= max_degree <= 40:
        raise InputError(f"max_degree must lie in [2, 40], got {max_degree!r}")
    if not tolerance > 0:
        raise InputError(f"tolerance must be above 0, got {tolerance!r}")
    with kernel_guard("the surface of a face"):
        spline, kind, trimmed = face_geometry(_topology(face, "FACE"))
    if trimmed and not untrimmed:
        raise InputError(f"the face is a trimmed part of its {kind}: untrimmed=True fits all of that")
    least = np.inf
    for degrees in _degrees(spline, tolerance, max_degree):
        surface = _nearest_patch(spline, degrees)
        proved = certify_surface(surface, spline, limit=tolerance)
        if proved.upper <= tolerance:
            return FaceDesign(surface, (proved.lower, proved.upper))
        least = min(least, proved.upper)
    raise ToleranceNotMet(tolerance, float(least), 1, f"max_degree = {max_degree}")


def _degrees(spline: BSplineSurface, tolerance: float, most: int) -> list[tuple[int, int]]:
    """Pairs of degrees, both enough by their samples for half the tolerance each, and then higher ones."""
    found = []
    for direction, along in enumerate((spline, spline.transposed())):
        u, v = np.linspace(*along.domain[0], 65), np.linspace(*along.domain[1], 9)
        points = along.evaluate(u[:, None], v[None, :])
        for degree in range(2, most + 1):
            matrix = _fitting(degree, np.linspace(0, 1, 65))
            gap = np.einsum("ij,jkd->ikd", Basis(degree).evaluate(np.linspace(0, 1, 65)) @ matrix, points) - points
            if np.linalg.norm(gap, axis=-1).max() <= tolerance / 2:
                break
        found.append((degree, direction))
    (m, _), (n, _) = found
    return [(min(m + k, most), min(n + k, most)) for k in range(most - min(m, n) + 1)]


def _fitting(degree: int, x: Array) -> Array:
    """The matrix from values at x, both ends among them, to control points: least squares with the ends kept."""
    values = Basis(degree).evaluate(x)
    inner = np.linalg.pinv(values[1:-1, 1:-1])
    matrix = np.zeros((degree + 1, len(x)))
    matrix[0, 0] = matrix[-1, -1] = 1.0
    matrix[1:-1, 1:-1] = inner
    matrix[1:-1, [0, -1]] -= inner @ values[1:-1, [0, -1]]
    return matrix


def _nearest_patch(spline: BSplineSurface, degrees: tuple[int, int]) -> Surface:
    """Least squares at Chebyshev points; corners and the fits of the sides are kept, whatever the other direction."""
    x = [(1 - np.cos(np.linspace(0, np.pi, 4 * degree + 9))) / 2 for degree in degrees]
    u, v = (a + (b - a) * one for (a, b), one in zip(spline.domain, x, strict=True))
    points = spline.evaluate(u[:, None], v[None, :])
    rows, columns = (_fitting(degree, one) for degree, one in zip(degrees, x, strict=True))
    return Surface(np.einsum("ia,jb,abd->ijd", rows, columns, points))


# --- joins to what a host holds ---------------------------------------------------------------------------------------


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
    count, fit = len(ends) - 1, _fitting(degree, x)
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
