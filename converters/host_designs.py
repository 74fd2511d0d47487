"""What a host's edges and faces are to gtcad, and the GT curves nearest to edges.

All lengths are in mm. A host's shape is one of build123d or CadQuery, or the kernel's own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad.basis import BERNSTEIN
from gtcad.composite import Composite
from gtcad.conics import Arc
from gtcad.continuity import check_join
from gtcad.converters.arcs import certify_chain_arc
from gtcad.converters.bspline import BSplineCurve, BSplineSurface
from gtcad.converters.chain import as_curve
from gtcad.converters.design import Design, nearest_chain, nearest_gt
from gtcad.converters.fit import Degree
from gtcad.converters.part import EllipseArc
from gtcad.curve import Curve
from gtcad.errors import InputError, ToleranceNotMet

Array = NDArray[np.float64]

DEFAULT_TOLERANCE = 1e-3
"""mm: what a host's object keeps unless told otherwise."""

DEFAULT_DEGREE: Degree = "auto"
"""Of the splines: what needs the fewest poles. Kernels offset, shell and fillet all degrees alike, see smooth_edges."""

_LEAST_PART = 1e-3
_EDGE_DEGREE, _CHAIN_DEGREE = 8, 5


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
    shape = host_shape(edge, "EDGE")
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
        return face_geometry(host_shape(face, "FACE"))[0]


def host_shape(given: Any, kind: str) -> Any:
    """The kernel's shape of a host's shape, which must be of the kind: "EDGE" or "FACE"."""
    shape = getattr(given, "wrapped", given)
    name = type(shape).__name__
    if not name.startswith("TopoDS_") or shape.IsNull() or not str(shape.ShapeType()).endswith(f"_{kind}"):
        raise InputError(f"{kind.lower()} must be one of the host's {kind.lower()}s, got {type(given).__name__}")
    return shape


# --- designs for edges ------------------------------------------------------------------------------------------------


def design_from_edge(
    edge: Any, *, tolerance: float = DEFAULT_TOLERANCE, degree: int | None = None, order: str = "G1"
) -> Design[Any]:
    """The GT curve nearest to an edge, in the edge's direction, or a chain of them where one is not enough.

    Lines, circles, ellipses, their arcs and polygons come out exactly, unless a degree is given.

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

    Returns
    -------
    Design
        Its curve an ``Arc`` for arcs of circles and ellipses, a ``Curve`` where one is enough, else a ``Composite``.

    Raises
    ------
    InputError, ToleranceBelowPrecision, ToleranceNotMet, KernelError
        As ``nearest_chain``.
    """
    from gtcad.converters.occt.compat import kernel_guard, kernel_module
    from gtcad.converters.occt.pieces import edge_geometry

    shape = host_shape(edge, "EDGE")
    with kernel_guard("the curve of an edge"):
        geometry = edge_geometry(shape)[0]
    design = design_of(geometry, tolerance=tolerance, degree=degree, order=order)
    if shape.Orientation() != kernel_module("TopAbs").TopAbs_REVERSED:
        return design
    breaks = tuple(1 - x for x in design.breaks[::-1])
    return Design(design.curve.reversed(), design.deviation, design.parametrisation, breaks)


def design_of(
    geometry: BSplineCurve | EllipseArc,
    *,
    tolerance: float = DEFAULT_TOLERANCE,
    degree: int | None = None,
    order: str = "G1",
) -> Design[Any]:
    """The design for a curve; see ``design_from_edge``."""
    if degree is None and (exact := _exact_design(geometry)) and exact.deviation[1] <= tolerance:
        return exact
    try:
        return nearest_gt(geometry, degree or _EDGE_DEGREE, tolerance=tolerance, gamma=(0.0, 0.0))
    except ToleranceNotMet:
        return nearest_chain(geometry, degree or _CHAIN_DEGREE, tolerance=tolerance, order=order, gamma=(0.0, 0.0))


def _exact_design(geometry: BSplineCurve | EllipseArc) -> Design[Any] | None:
    """Of an arc or a polygon; None of other curves."""
    if isinstance(geometry, EllipseArc):
        ends = (math.degrees(angle) for angle in (geometry.start, geometry.end))
        arc = Arc(geometry.center, geometry.axis_a, geometry.axis_b, *_rounded(*ends))
        proofs = certify_chain_arc(arc, geometry)
        deviation = max(proof.lower for proof in proofs), max(proof.upper for proof in proofs)
        shares = np.cumsum(
            [0.0, *(abs(np.subtract(*piece.range)) if hasattr(piece, "range") else 1.0 for piece in arc.pieces)]
        )
        return Design(arc, deviation, "equal", tuple((shares / shares[-1]).tolist()))
    if geometry.degree > 1 or geometry.weights is not None:
        return None
    pieces = tuple(Curve(np.array(ends), family=BERNSTEIN) for ends in pairwise(geometry.control_points))
    if len(pieces) == 1:
        return Design(pieces[0], (0.0, 0.0), "equal")
    closed = bool((geometry.control_points[0] == geometry.control_points[-1]).all())
    orders = tuple(check_join(*joint).order for joint in zip(pieces, pieces[1:] + pieces[:1] * closed, strict=False))
    breaks = (geometry.knots - geometry.knots[0]) / np.ptp(geometry.knots)
    return Design(Composite(pieces, orders, closed), (0.0, 0.0), "equal", tuple(breaks.tolist()))


def _rounded(start: float, end: float) -> tuple[float, float]:
    """Angles in degrees, those of whole quarters from the start on to the last digit."""
    quarters = round((end - start) / 90)
    near = abs(end - start - 90 * quarters) <= 1e-12 * 360
    return start, start + 90.0 * quarters if near and quarters else end
