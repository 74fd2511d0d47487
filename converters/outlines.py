"""Outlines for hosts: wires with lines and arcs where a chain has them, and the plane faces inside."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gtcad.composite import Composite
from gtcad.converters.arcs import arc_of_chain, certify_chain_arc
from gtcad.converters.bspline import BSplineCurve, BSplineSurface
from gtcad.converters.chain import ChainFit
from gtcad.converters.part import EllipseArc, Wire
from gtcad.curve import Curve

Edge = BSplineCurve | EllipseArc
Bounds = tuple[float, float]


# --- lines and arcs of a chain ----------------------------------------------------------------------------------------


def with_exact_edges(fit: ChainFit, tolerance: float) -> ChainFit:
    """The chain with straight pieces as lines and arcs of ellipses as such, neighbours of one ellipse as one.

    Joints keep their order: splines have the derivatives of their pieces there, and lines and arcs are their pieces.
    A piece that shares a spline with others, joined C1 to C3, stays in that.
    """
    edges: list[Edge] = []
    runs: list[range] = []
    deviations, exact, k = list(fit.deviations), True, 0
    while k < len(fit.runs):
        edge, run, proofs = _line(fit, k) or _arc(fit, k, tolerance) or (fit.edges[k], fit.runs[k], None)
        deviations[run.start : run.stop] = proofs or fit.deviations[run.start : run.stop]
        exact &= proofs is not None
        edges.append(edge)
        runs.append(run)
        k += sum(run.start <= one.start < run.stop for one in fit.runs)
    if any(isinstance(edge, EllipseArc) for edge in edges):
        edges = [edge if isinstance(edge, EllipseArc) else _spatial(edge) for edge in edges]
    return replace(fit, edges=tuple(edges), runs=tuple(runs), deviations=tuple(deviations), exact=fit.exact or exact)


def _line(fit: ChainFit, k: int) -> tuple[Edge, range, list[Bounds]] | None:
    """The line of a straight piece, between the ends of its spline: no farther off than these."""
    edge, run = fit.edges[k], fit.runs[k]
    piece = fit.chain.pieces[run.start]
    if len(run) > 1 or isinstance(edge, EllipseArc) or not isinstance(piece, Curve) or piece.degree != 1:
        return None
    return BSplineCurve(edge.control_points[[0, -1]], [0.0, 1.0], [2, 2], 1), run, [fit.deviations[run.start]]


def _arc(fit: ChainFit, k: int, tolerance: float) -> tuple[Edge, range, list[Bounds]] | None:
    """The longest arc that whole edges from this one on are, when it is proved."""
    found = None
    for last in range(k, len(fit.runs)):
        run = range(fit.runs[k].start, fit.runs[last].stop)
        pieces = tuple(piece if piece.dimension == 3 else piece.transformed(np.eye(3, 2)) for piece in _of(fit, run))
        part = Composite(pieces, fit.chain.orders[run.start : run.stop - 1])
        arc = arc_of_chain(part)
        if arc is None:
            break
        proofs = [(proof.lower, proof.upper) for proof in certify_chain_arc(part, arc)]
        if max(upper for _, upper in proofs) > tolerance:
            break
        found = arc, run, proofs
    return found


def _spatial(spline: BSplineCurve) -> BSplineCurve:
    """A plane spline at z = 0, where arcs always are in space."""
    points = np.pad(spline.control_points, ((0, 0), (0, 3 - spline.dimension)))
    return replace(spline, control_points=points)


def _of(fit: ChainFit, run: range) -> Sequence[Any]:
    return fit.chain.pieces[run.start : run.stop]


# --- edges, wires, faces ----------------------------------------------------------------------------------------------


def straightened(edge: Any, curve: BSplineCurve | EllipseArc) -> Any:
    """The edge of a line as one on a Geom_Line: what hosts extrude from it is a plane then."""
    from gtcad.converters.occt.compat import kernel_guard, kernel_module, point
    from gtcad.converters.occt.topology import TOLERANCE, checked, edge_between

    if isinstance(curve, EllipseArc) or curve.degree != 1 or len(curve.control_points) != 2:
        return edge
    start, end = np.pad(curve.control_points, ((0, 0), (0, 3 - curve.dimension)))
    length = float(np.linalg.norm(end - start))
    ends = kernel_module("TopExp").TopExp
    with kernel_guard("making a line"):
        direction = kernel_module("gp").gp_Dir(*((end - start) / length).tolist())
        line = kernel_module("Geom").Geom_Line(point(start), direction)
        vertices = ends.FirstVertex_s(edge), ends.LastVertex_s(edge)
        return checked(edge_between(line, *vertices, (0.0, length), TOLERANCE), "edge")


def wire_of(wire: Wire) -> Any:
    """The kernel's wire of these edges, which share their vertices."""
    from gtcad.converters.occt.compat import as_edge, kernel_module
    from gtcad.converters.occt.pieces import subshapes
    from gtcad.converters.occt.topology import checked, make_wire

    first = make_wire(wire)
    builder, result = kernel_module("BRep").BRep_Builder(), kernel_module("TopoDS").TopoDS_Wire()
    builder.MakeWire(result)
    for edge, curve in zip(subshapes(first, "EDGE"), wire.edges, strict=True):
        builder.Add(result, straightened(as_edge(edge), curve))
    result.Closed(first.Closed())
    return checked(result, "wire")


def plane_face(surface: BSplineSurface) -> Any:
    """The face of the plane z = 0 inside the four sides of a patch; sides that are points are left out."""
    from gtcad.converters.occt.compat import kernel_guard, kernel_module
    from gtcad.converters.occt.topology import checked

    sides = [(surface.boundary(side), side in ("v1", "u0")) for side in ("v0", "u1", "v1", "u0")]
    loop = [_backwards(curve) if turn else curve for curve, turn in sides if np.ptp(curve.control_points, axis=0).any()]
    gp = kernel_module("gp")
    with kernel_guard("making a plane face"):
        plane = gp.gp_Pln(gp.gp_Pnt(0.0, 0.0, 0.0), gp.gp_Dir(0.0, 0.0, 1.0))
        made = kernel_module("BRepBuilderAPI").BRepBuilderAPI_MakeFace(plane, wire_of(Wire(tuple(loop))), True)
        return checked(made.Face(), "face")


def _backwards(curve: BSplineCurve) -> BSplineCurve:
    knots = (curve.knots[0] + curve.knots[-1] - curve.knots)[::-1]
    weights = None if curve.weights is None else curve.weights[::-1]
    return BSplineCurve(curve.control_points[::-1], knots, curve.multiplicities[::-1], curve.degree, weights)
