from __future__ import annotations

import copy
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gtcad import BERNSTEIN, Basis, Curve, Quilt, Solid, Surface
from gtcad.composite import Composite
from gtcad.conics import Arc, circle
from gtcad.continuity import check_join, join_curve
from gtcad.converters import face_designs, hosts
from gtcad.converters.bspline import BSplineCurve, BSplineSurface
from gtcad.converters.face_designs import fitting
from gtcad.converters.figures import Figure
from gtcad.converters.occt.compat import as_edge, as_face, kernel_module
from gtcad.converters.occt.faces import area, volume
from gtcad.converters.occt.pieces import edge_geometry, is_valid, subshapes
from gtcad.converters.occt.topology import make_edge, make_face
from gtcad.converters.part import EllipseArc
from gtcad.converters.quadrics import Quadric
from gtcad.converters.smooth_edges import closing_orders, with_smooth_edges
from gtcad.edge_check import check_edge
from gtcad.errors import InputError, ToleranceBelowPrecision, ToleranceNotMet
from gtcad.patches import Rotation, Ruled
from gtcad.restricted import RestrictedSurface

SWING = Curve([[0, 0, 0], [3, 7, 1], [7, -2, 0], [10, 3, 2]], gamma=(0.4, -0.6))
TUBE = Rotation(Curve([[3, 0, 0], [3, 0, 5]], family=BERNSTEIN), [0, 0, 0], [0, 0, 1])
adaptor = kernel_module("BRepAdaptor")


def kind_of(edge: Any) -> str:
    return str(adaptor.BRepAdaptor_Curve(edge).GetType()).rsplit("_", 1)[-1]


def reversed_edge(curve: Curve) -> Any:
    return kernel_module("TopoDS").TopoDS.Edge(hosts.made_edge(curve, tolerance=1e-9).shape.Reversed())


FORWARDS = hosts.made_edge(SWING, tolerance=1e-9).shape
BACKWARDS = reversed_edge(SWING)


# --- made -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("curve", "kind"),
    [
        (SWING, "BSplineCurve"),
        (Curve([[0, 0, 0], [3, 4, 12]], family=BERNSTEIN), "Line"),
        (Curve([[2, 0], [2, 2], [0, 2]]), "Circle"),
        (circle([1, 2, 3], 5, [0, 0, 1]), "Circle"),
        (Curve([[2, 0, 0], [2, 1, 0], [0, 1, 0]]), "Ellipse"),
    ],
)
def test_edges_are_of_the_kind_that_the_curve_is(curve: Any, kind: str) -> None:
    made = hosts.made_edge(curve)
    assert kind_of(made.shape) == kind
    assert is_valid(made.shape)
    assert made.exact is curve
    assert made.deviation == made.fit.deviation
    assert made.deviation[1] <= hosts.DEFAULT_TOLERANCE


def test_a_line_keeps_its_ends_and_its_length() -> None:
    made = hosts.made_edge(Curve([[1, 2, 3], [4, 6, 15]], family=BERNSTEIN))
    geometry, kind = edge_geometry(made.shape)
    assert kind == "LINE"
    np.testing.assert_allclose(hosts.core_of_edge(made.shape).evaluate(0.0), [1, 2, 3], atol=1e-12)
    assert geometry.knots.tolist() == [0.0, 13.0]  # type: ignore[union-attr]


def test_the_deviation_is_that_of_the_edge() -> None:
    made = hosts.made_edge(SWING, tolerance=1e-2)
    spline = edge_geometry(made.shape)[0]
    t = np.linspace(0, 1, 4001)
    gap = np.linalg.norm(spline.evaluate(t) - SWING.evaluate(t), axis=1).max()
    assert made.deviation[0] * (1 - 1e-3) <= gap <= made.deviation[1]


def test_a_chain_with_corners_is_a_wire_that_shares_vertices() -> None:
    back = Curve([[10, 3, 2], [0, 0, 0]], family=BERNSTEIN)
    made = hosts.made_wire(Composite((SWING, back), ("C0", "C0"), True))
    edges = subshapes(made.shape, "EDGE")
    assert [kind_of(as_edge(edge)) for edge in edges] == ["BSplineCurve", "Line"]
    assert len(subshapes(made.shape, "VERTEX")) == 2
    assert made.shape.Closed()
    with pytest.raises(InputError, match="2 edges, not one"):
        hosts.made_edge(made.exact)


def test_one_curve_may_be_a_wire() -> None:
    assert len(subshapes(hosts.made_wire(SWING).shape, "EDGE")) == 1


@pytest.mark.parametrize("mirrored", [False, True])
def test_patches_in_the_plane_are_faces_of_the_plane(mirrored: bool) -> None:
    net = np.array([[[0, 0], [1, 5], [0, 9]], [[4, -2], [5, 4], [5, 11]], [[9, 0], [9, 5], [8, 9]]], dtype=float)
    surface = Surface(net[:, ::-1] if mirrored else net)
    made = hosts.made_face(surface, tolerance=1e-6)
    assert str(adaptor.BRepAdaptor_Surface(made.shape).GetType()).endswith("Plane")
    x, w = np.polynomial.legendre.leggauss(24)
    u = (x + 1) / 2
    jacobian = np.linalg.det(
        np.stack([surface.derivative(u[:, None], u, (1, 0)), surface.derivative(u[:, None], u, (0, 1))], axis=-1)
    )
    assert area(made.shape) == pytest.approx(abs(w @ jacobian @ w) / 4, abs=40e-6)


@pytest.mark.parametrize(
    ("surface", "kind"), [(TUBE, "Cylinder"), (Ruled(SWING, SWING.transformed(-np.eye(3))), "BSplineSurface")]
)
def test_faces_are_of_the_kind_that_the_patch_is(surface: Any, kind: str) -> None:
    made = hosts.made_face(surface)
    assert str(adaptor.BRepAdaptor_Surface(made.shape).GetType()).endswith(kind)
    assert made.deviation[1] <= 1e-3


def test_an_analytic_surface_that_misses_the_tolerance_by_rounding_is_refused_like_a_spline() -> None:
    geometry, fit = hosts.choose_geometry(TUBE, tolerance=1e-12)
    assert isinstance(geometry, Quadric)
    assert fit.deviation[1] <= 1e-12
    with pytest.raises(ToleranceBelowPrecision):
        hosts.choose_geometry(TUBE, tolerance=fit.deviation[1] / 2)


def test_exact_false_makes_splines_of_all() -> None:
    assert kind_of(hosts.made_edge(Curve([[2, 0], [2, 2], [0, 2]]), exact=False).shape) == "BSplineCurve"
    made = hosts.made_face(TUBE, exact=False)
    assert str(adaptor.BRepAdaptor_Surface(made.shape).GetType()).endswith("BSplineSurface")


def test_shells_and_solids() -> None:
    vase = Rotation(Curve([[4, 0, 0], [7, 0, 5], [3, 0, 10]]), [0, 0, 0], [0, 0, 1])
    quilt = Quilt.recognised([vase])
    assert len(subshapes(hosts.made_shell(quilt).shape, "FACE")) == 1
    made = hosts.made_solid(Solid(quilt, caps="planar"))
    assert made.body is not None
    assert made.proved
    assert volume(made.shape, rtol=1e-10) == pytest.approx(
        float(Solid(quilt, caps="planar").volume()), abs=1e-3 * made.body.area
    )  # type: ignore[arg-type]
    wall = hosts.made_solid(Solid(quilt, thickness=0.5))
    assert not wall.proved
    assert wall.deviation[1] <= 1e-3
    with pytest.raises(InputError, match="free"):
        hosts.made_solid(quilt)


def test_the_deviation_of_a_wall_is_that_of_its_worst_faces(monkeypatch: pytest.MonkeyPatch) -> None:
    vase = Rotation(Curve([[4, 0, 0], [7, 0, 5], [3, 0, 10]]), [0, 0, 0], [0, 0, 1])
    thicken = hosts.thicken
    monkeypatch.setattr(hosts, "thicken", lambda *given, **named: replace(thicken(*given, **named), deviation=0.25))
    made = hosts.made_solid(Solid(Quilt.recognised([vase]), thickness=0.5))
    assert made.deviation == (made.fit.deviation[0], 0.25)


def test_wrong_kinds_are_named() -> None:
    with pytest.raises(InputError, match="surface must be a SeparableSurface of gtcad, got Curve"):
        hosts.made_face(SWING)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="quilt must be a Quilt of gtcad, got int"):
        hosts.made_shell(3)  # type: ignore[arg-type]


def test_copies_of_what_was_made_are_itself() -> None:
    made = hosts.made_edge(SWING)
    assert copy.deepcopy(made) is made


# --- edges of hosts ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("at", [0.0, 0.3, 1.0])
def test_the_curve_of_an_edge_runs_with_the_edge(at: float) -> None:
    edge = BACKWARDS
    curve = hosts.core_of_edge(edge, at=at)
    start, end = (1.0, 0.0) if at == 0 else (0.0, at)  # along the edge, which runs against the curve
    np.testing.assert_allclose(curve.evaluate(0.0), SWING.evaluate(1 - start), atol=1e-7)
    np.testing.assert_allclose(curve.evaluate(curve.domain[1]), SWING.evaluate(1 - end), atol=1e-7)
    assert np.linalg.norm(curve.derivative(curve.domain[1])) == pytest.approx(1)


@settings(max_examples=15)
@given(
    st.sampled_from(["G0", "G1", "G2", "G3"]),
    st.one_of(st.just(0.0), st.floats(1e-3, 1.0)),
    st.tuples(st.floats(-0.9, 0.9), st.floats(-0.9, 0.9)),
    st.booleans(),
)
def test_curves_continue_edges(order: str, at: float, gamma: tuple[float, float], backwards: bool) -> None:
    edge = BACKWARDS if backwards else FORWARDS
    curve = hosts.curve_on_edge(edge, [(14, 20, 3), (3, 25, 5)], order=order, at=at, gamma=gamma)
    report = check_join(hosts.core_of_edge(edge, at=at), curve)
    assert int(report.order[1]) >= int(order[1]) or report.meets(order)
    np.testing.assert_array_equal(curve.control_points[-1], [3, 25, 5])


def test_bad_joins_are_refused() -> None:
    edge = hosts.made_edge(SWING).shape
    with pytest.raises(InputError, match="G0"):
        hosts.curve_on_edge(edge, [(1, 2, 3)], order="C2")
    with pytest.raises(InputError, match=r"at must be 0, or lie in \[0.001, 1\], got 1.5"):
        hosts.curve_on_edge(edge, [(1, 2, 3)], at=1.5)
    with pytest.raises(InputError, match="points"):
        hosts.curve_on_edge(edge, [])
    with pytest.raises(InputError, match="edge must be one of the host's edges, got int"):
        hosts.curve_on_edge(7, [(1, 2, 3)])
    with pytest.raises(InputError, match="edges, got TopoDS_"):
        hosts.core_of_edge(hosts.made_face(TUBE).shape)


@pytest.mark.parametrize("backwards", [False, True])
@pytest.mark.parametrize(("axes", "ends"), [((5, 5), (0.2, 1.9)), ((5, 2), (0.0, 2 * math.pi)), ((5, 5), (1.0, 4.0))])
def test_arcs_and_full_turns_come_out_exactly(axes: Any, ends: Any, backwards: bool) -> None:
    ellipse = EllipseArc([1, 2, 3], [axes[0], 0, 0], [0, axes[1], 0], *ends)
    edge = make_edge(ellipse)
    design = hosts.design_from_edge(edge.Reversed() if backwards else edge, tolerance=1e-9)
    assert isinstance(design.curve, Arc)
    assert design.deviation[1] < 1e-11
    assert design.curve.closed is (ends[1] == 2 * math.pi)
    assert design.breaks[0] == 0
    assert design.breaks[-1] == 1
    points = design.curve.evaluate(np.linspace(*design.curve.domain, 99)) - [1, 2, 3]
    assert np.abs((points[:, :2] ** 2 / np.square(axes)).sum(axis=1) - 1).max() < 1e-13
    there = [ellipse.center + math.cos(x) * ellipse.axis_a + math.sin(x) * ellipse.axis_b for x in ends]
    np.testing.assert_allclose(points[[0, -1]] + [1, 2, 3], there[::-1] if backwards else there, atol=1e-12)
    assert kind_of(hosts.made_edge(design.curve).shape) == ("Circle" if axes[0] == axes[1] else "Ellipse")


def test_lines_and_polygons_come_out_exactly() -> None:
    line = hosts.design_from_edge(hosts.made_edge(Curve([[1, 2, 3], [4, 6, 15]], family=BERNSTEIN)).shape)
    assert line.deviation == (0.0, 0.0)
    np.testing.assert_allclose(line.curve.evaluate(0.25), [1.75, 3, 6], atol=1e-12)
    corners = np.array([[0, 0, 0], [4, 0, 0], [4, 3, 0], [0, 0, 0]], dtype=float)
    loop = hosts.design_from_edge(make_edge(BSplineCurve(corners, [0, 1, 3, 4], [2, 1, 1, 2], 1)))
    assert [piece.degree for piece in loop.curve.pieces] == [1, 1, 1]
    assert loop.curve.closed
    assert loop.breaks == (0.0, 0.25, 0.75, 1.0)
    np.testing.assert_array_equal(loop.curve.pieces[1].control_points, corners[1:3])


def test_a_degree_makes_an_arc_one_curve_within_the_tolerance() -> None:
    arc = make_edge(EllipseArc([0, 0, 0], [5, 0, 0], [0, 5, 0], 0.2, 1.9))
    design = hosts.design_from_edge(arc, tolerance=1e-3, degree=8)
    assert isinstance(design.curve, Curve)
    radii = np.linalg.norm(design.curve.evaluate(np.linspace(0, 1, 500)), axis=1)
    assert np.abs(radii - 5).max() <= design.deviation[1] <= 1e-3


@pytest.mark.parametrize("tolerance", [1e-2, 1e-4])
def test_periodic_splines_give_closed_chains(tolerance: float) -> None:
    angles = np.linspace(0, 2 * np.pi, 7)[:-1]
    array = (
        kernel_module("TColgp").TColgp_HArray1OfPnt
        if hasattr(kernel_module("TColgp"), "TColgp_HArray1OfPnt")
        else kernel_module("collections").HArray1_gp_Pnt
    )
    points = array(1, 6)
    for k, angle in enumerate(angles, 1):
        points.SetValue(k, kernel_module("gp").gp_Pnt(9 * math.cos(angle), 5 * math.sin(angle), math.sin(3 * angle)))
    builder = kernel_module("GeomAPI").GeomAPI_Interpolate(points, True, 1e-9)
    builder.Perform()
    spline = builder.Curve()
    assert spline.IsPeriodic()
    edge = kernel_module("BRepBuilderAPI").BRepBuilderAPI_MakeEdge(spline).Edge()
    design = hosts.design_from_edge(edge, tolerance=tolerance)
    assert isinstance(design.curve, Composite)
    assert design.curve.closed
    assert set(design.curve.orders) <= {"G1", "G2", "G3", "C1", "C2", "C3"}
    assert design.deviation[1] <= tolerance
    made = hosts.made_wire(design.curve)
    assert made.shape.Closed()
    extrema = kernel_module("BRepExtrema").BRepExtrema_DistShapeShape
    for place in design.curve.evaluate(np.linspace(*design.curve.domain, 21)[:-1]):
        vertex = kernel_module("BRepBuilderAPI").BRepBuilderAPI_MakeVertex(kernel_module("gp").gp_Pnt(*place.tolist()))
        assert extrema(edge, vertex.Vertex()).Value() <= tolerance + 1e-9


# --- outlines ---------------------------------------------------------------------------------------------------------


def line(*ends: Any) -> Curve:
    return Curve(ends, family=BERNSTEIN)


def test_lines_and_arcs_of_mixed_chains_stay_such() -> None:
    swing = Curve([[0, 0], [3, 7], [7, -2], [10, 3]], gamma=(0.4, -0.6))
    bow = Arc([10, 0], [0, 3], [3, 0], 0, 120)
    end = bow.evaluate(bow.domain[1])
    pieces = (swing, *bow.pieces, line(end, [5, -6]), line([5, -6], [0, 0]))
    chain = Composite(pieces, ("G0", *bow.orders, "C0", "C0", "C0"), True)
    made = hosts.made_wire(chain)
    edges = [as_edge(edge) for edge in subshapes(made.shape, "EDGE")]
    assert [kind_of(edge) for edge in edges] == ["BSplineCurve", "Circle", "Line", "Line"]
    assert made.fit.runs == (range(1), range(1, 3), range(3, 4), range(4, 5))
    assert made.shape.Closed()
    assert len(subshapes(made.shape, "VERTEX")) == 4
    assert max(upper for _, upper in made.fit.deviations[1:]) < 1e-11
    assert made.deviation[0] == made.fit.deviations[0][0] > 0
    assert not made.fit.exact
    splines = hosts.made_wire(chain, exact=False)
    assert {kind_of(as_edge(edge)) for edge in subshapes(splines.shape, "EDGE")} == {"BSplineCurve"}


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_slot_is_two_lines_and_two_circles_that_join_smoothly(dimension: int) -> None:
    ends = Arc([5, 0], [0, 1], [1, 0], 0, 180), Arc([0, 0], [0, -1], [-1, 0], 0, 180)
    pieces = (line([0, 1], [5, 1]), *ends[0].pieces, line([5, -1], [0, -1]), *ends[1].pieces)
    chain = Composite(pieces, ("G1", "C3", "G1", "G1", "C3", "G1"), True)
    made = hosts.made_wire(chain if dimension == 2 else chain.transformed(np.eye(3, 2), [0, 0, 7]))
    kinds = [kind_of(as_edge(edge)) for edge in subshapes(made.shape, "EDGE")]
    assert kinds == ["Line", "Circle", "Line", "Circle"]
    assert made.fit.exact
    assert [report.order for report in made.fit.report()] == ["G1", "C3", "G1", "G1", "C3", "G1"]


def test_smooth_joints_to_arcs_are_kept_by_the_splines() -> None:
    bow = Arc([0, 0], [2, 0], [0, 2], 0, 90)
    swing = join_curve(bow.pieces[0], 4, order="G2", scale=(1.0, 0.0, 0.0), rest=[[-5, 3], [-6, 0]])
    made = hosts.made_wire(Composite((*bow.pieces, swing), ("G2",)))
    assert [kind_of(as_edge(edge)) for edge in subshapes(made.shape, "EDGE")] == ["Circle", "BSplineCurve"]
    assert made.fit.report()[0].meets("G2")


# --- smooth edges -----------------------------------------------------------------------------------------------------


def test_seams_and_joints_that_are_smooth_arrive_smooth() -> None:
    profile = Curve([[4, 0, 0], [7, 0, 5], [3, 0, 10]])
    whole = Rotation(profile, [0, 0, 0], [0, 0, 1])
    spline = hosts.made_face(whole, tolerance=1e-2).fit.spline  # type: ignore[union-attr]
    u = np.linspace(0, 1, 9)
    start, end = (spline.derivative(u, np.full(9, t), (0, 1)) for t in (0.0, 1.0))
    np.testing.assert_allclose(start, end, atol=1e-10)
    halves = [Rotation(profile, [0, 0, 0], [0, 0, 1], 180, start) for start in (0, 180)]
    quilt = Quilt.recognised(halves)
    solid = hosts.made_solid(Solid(quilt, caps="planar"), tolerance=1e-2)
    shell = hosts.made_shell(quilt, tolerance=1e-2)
    assert solid.exact.quilt is shell.exact is quilt
    for fit in (solid.fit, shell.fit):
        assert {edge.order for edge in fit.quilt.edges} == {"G1"}  # type: ignore[union-attr]
        for edge in quilt.edges:
            a, b = (fit.splines[use.patch] for use in edge.uses)  # type: ignore[union-attr]
            assert check_edge(a, edge.first.side, b, edge.second.side).meets("G1")


@pytest.mark.parametrize("backwards", [False, True])
def test_a_smooth_edge_is_recognised_whichever_way_its_second_patch_runs(backwards: bool) -> None:
    net = np.random.default_rng(4).normal(size=(4, 4, 3)) + 9 * np.moveaxis(np.indices((4, 4, 1))[..., 0], 0, -1)
    across = (1.0, 0.0) if backwards else (0.0, 1.0)
    halves = [RestrictedSurface(Surface(net), ends) for ends in (((0.0, 0.4), (0.0, 1.0)), ((0.4, 1.0), across))]
    (edge,) = with_smooth_edges(Quilt.recognised(halves)).edges
    assert (edge.order, edge.reversed) == ("G1", backwards)


def test_edges_that_bend_are_left_alone() -> None:
    roof = [Ruled(line([0, 0, 0], [0, 9, 0]), line([5, 0, h], [5, 9, h])) for h in (3,)]
    roof += [Ruled(line([5, 0, 3], [5, 9, 3]), line([10, 0, 0], [10, 9, 0]))]
    folded = [roof[0], Ruled(line([5, 0, 3], [5, 9, 3]), line([0, 0, 0], [0, 9, 1]))]
    flat = [roof[0], Ruled(line([5, 0, 3], [5, 9, 3]), line([10, 0, 6], [10, 9, 6]))]
    orders = [with_smooth_edges(Quilt.recognised(patches)).edges[0].order for patches in (roof, folded, flat)]
    assert orders == ["C0", "C0", "G1"]
    assert closing_orders(TUBE) == ((0, 0), (1, 1))
    assert closing_orders(Ruled(SWING, SWING.transformed(-np.eye(3)))) == ((0, 0), (0, 0))


# --- faces of hosts ---------------------------------------------------------------------------------------------------


def quarter(radius: float = 5.0) -> Any:
    """A third of a cylinder, about the z axis."""
    profile = Curve([[radius, 0, 0], [radius, 0, 10]], family=BERNSTEIN)
    return hosts.made_face(Rotation(profile, [0, 0, 0], [0, 0, 1], 120.0)).shape


def kernel_face(kind: str) -> Any:
    """A whole primitive's curved face, in a place of its own."""
    gp, api = kernel_module("gp"), kernel_module("BRepPrimAPI")
    axes = gp.gp_Ax2(gp.gp_Pnt(1.0, 2.0, 3.0), gp.gp_Dir(0.3, -0.5, 0.8))
    sizes = {"Cylinder": (5.0, 10.0), "Cone": (5.0, 2.0, 10.0), "Sphere": (5.0,), "Torus": (5.0, 2.0)}[kind]
    solid = getattr(api, f"BRepPrimAPI_Make{kind}")(axes, *sizes).Shape()
    faces = [as_face(face) for face in subshapes(solid, "FACE")]
    return next(face for face in faces if str(adaptor.BRepAdaptor_Surface(face).GetType()).endswith(kind))


def normal_gap(face: Any, patch: Any) -> float:
    """The largest sine of angles between the normals of a patch and those of a face near it."""
    gp, surface = kernel_module("gp"), kernel_module("BRep").BRep_Tool.Surface_s(face)
    sign = -1.0 if face.Orientation() == kernel_module("TopAbs").TopAbs_REVERSED else 1.0
    worst = 0.0
    for u, v in ((0.3, 0.2), (0.6, 0.7)):
        normal = np.cross(patch.derivative(u, v, (1, 0)), patch.derivative(u, v, (0, 1)))
        place = gp.gp_Pnt(*patch.evaluate(u, v).tolist())
        near = kernel_module("GeomAPI").GeomAPI_ProjectPointOnSurf(place, surface)
        local = kernel_module("GeomLProp").GeomLProp_SLProps(surface, *near.LowerDistanceParameters(), 1, 1e-9)
        own = sign * np.array([local.Normal().X(), local.Normal().Y(), local.Normal().Z()])
        worst = max(worst, float(np.linalg.norm(normal / np.linalg.norm(normal) - own)))
    return worst


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("kind", ["Cylinder", "Cone", "Sphere", "Torus"])
def test_whole_faces_come_out_exactly_as_one(kind: str, turned: bool) -> None:
    face = kernel_face(kind)
    face = as_face(face.Reversed()) if turned else face
    design = hosts.design_from_face(face, tolerance=1e-9)
    assert isinstance(design.surface, Rotation)
    assert design.patches == (design.surface,)
    assert design.deviation[1] < 1e-11
    made = hosts.made_face(design.surface)
    assert str(adaptor.BRepAdaptor_Surface(made.shape).GetType()).endswith(kind)
    assert area(made.shape) == pytest.approx(area(face), rel=1e-9)
    assert normal_gap(face, design.surface) < 1e-9


def test_planes_and_parts_of_cylinders_come_out_exactly() -> None:
    part = hosts.design_from_face(quarter(), tolerance=1e-9).surface
    u = np.linspace(0, 1, 60)
    points = part.evaluate(u[:, None], u)  # type: ignore[union-attr]
    assert np.abs(np.hypot(points[..., 0], points[..., 1]) - 5).max() < 1e-13
    assert np.ptp(points[..., 2]) == pytest.approx(10, abs=1e-12)
    plane = hosts.design_from_face(hosts.made_face(Ruled(line([0, 0, 1], [4, 0, 1]), line([0, 3, 1], [4, 3, 1]))).shape)
    assert isinstance(plane.surface, Surface)
    assert plane.surface.control_points.shape == (2, 2, 3)


def revolved(curve: Any, angle: float) -> Any:
    gp = kernel_module("gp")
    axis = gp.gp_Ax1(gp.gp_Pnt(0.0, 0.0, 0.0), gp.gp_Dir(0.0, 0.0, 1.0))
    made = kernel_module("BRepPrimAPI").BRepPrimAPI_MakeRevol(make_edge(curve), axis, math.radians(angle))
    return as_face(subshapes(made.Shape(), "FACE")[0])


WAVY = BSplineCurve([[5, 0, 0], [9, 0, 2], [2, 0, 5], [7, 0, 7], [4, 0, 10]], [0, 0.4, 1], [4, 1, 4], 3)


def distances_to_polyline(points: Any, line: Any) -> Any:
    """From each point to the two segments at its nearest corner."""
    nearest = np.linalg.norm(points[:, None] - line, axis=2).argmin(axis=1)
    found = []
    for k in (nearest.clip(1) - 1, nearest.clip(max=len(line) - 2)):
        along, out = line[k + 1] - line[k], points - line[k]
        share = ((along * out).sum(axis=1) / (along * along).sum(axis=1)).clip(0, 1)
        found.append(np.linalg.norm(out - share[:, None] * along, axis=1))
    return np.minimum(*found)


@pytest.mark.parametrize("angle", [360, 200])
@pytest.mark.parametrize("tolerance", [1e-3, 1e-5])
def test_revolved_splines_turn_exactly_about_their_axis(tolerance: float, angle: float) -> None:
    face = revolved(WAVY, angle)
    design = hosts.design_from_face(face, tolerance=tolerance)
    assert design.deviation[1] <= tolerance
    meridian = WAVY.evaluate(np.linspace(0, 1, 20001))[:, [0, 2]]
    for patch in design.patches:
        assert isinstance(patch, Rotation)
        assert abs(patch.angle_deg) == pytest.approx(angle, abs=1e-9)
        points = patch.evaluate(np.linspace(0, 1, 9)[:, None], np.linspace(0, 1, 7)).reshape(-1, 3)
        flat = np.stack([np.hypot(points[:, 0], points[:, 1]), points[:, 2]], axis=1)
        assert distances_to_polyline(flat, meridian).max() < 1.01 * tolerance
    assert normal_gap(face, design.patches[0]) < 0.05


def test_extruded_splines_keep_their_direction() -> None:
    gp = kernel_module("gp")
    prism = kernel_module("BRepPrimAPI").BRepPrimAPI_MakePrism(make_edge(WAVY), gp.gp_Vec(0.0, 8.0, 0.0)).Shape()
    face = as_face(subshapes(prism, "FACE")[0])
    design = hosts.design_from_face(face, tolerance=1e-4)
    assert design.deviation[1] <= 1e-4
    for patch in design.patches:
        np.testing.assert_allclose(np.abs(patch.derivative(0.3, [0.1, 0.9], (0, 1))), [[0, 8, 0]] * 2, atol=1e-12)
    assert normal_gap(face, design.patches[0]) < 0.02


def bumpy(columns: int = 7) -> BSplineSurface:
    """A cubic spline surface of several spans, of class C2."""
    x, y = np.meshgrid(np.linspace(0, 60, 8), np.linspace(0, 40, columns), indexing="ij")
    points = np.stack([x, y, 3 * np.sin(x / 9) * np.cos(y / 8)], axis=-1)
    inner = columns - 4
    knots = [0, *np.arange(1, inner + 1) / (inner + 1), 1]
    return BSplineSurface(points, [0, 0.2, 0.4, 0.6, 0.8, 1], [4, 1, 1, 1, 1, 4], 3, knots, [4, *[1] * inner, 4], 3)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-4])
def test_faces_that_one_patch_cannot_follow_become_a_quilt_that_joins_smoothly(tolerance: float) -> None:
    spline = bumpy()
    face = make_face(spline)
    design = hosts.design_from_face(face, tolerance=tolerance)
    assert isinstance(design.surface, Quilt)
    assert design.deviation[1] <= tolerance
    assert float(design.surface.area()) == pytest.approx(area(face), rel=1e-3)
    for edge in design.surface.edges:
        a, b = (design.patches[use.patch] for use in edge.uses)
        assert check_edge(a, edge.first.side, b, edge.second.side).meets("G1")
    corners = {tuple(np.round(patch.evaluate(u, v), 9)) for patch in design.patches for u in (0, 1) for v in (0, 1)}
    assert {tuple(np.round(spline.control_points[i, j], 9)) for i in (0, -1) for j in (0, -1)} <= corners
    u = np.linspace(0, 1, 9)
    points = np.concatenate([patch.evaluate(u[:, None], u[None, :]).reshape(-1, 3) for patch in design.patches])
    assert Figure(spline).nearest(points).distances.max() <= design.deviation[1]
    for patch in design.patches:
        assert normal_gap(face, patch) < 0.02


def test_what_cutting_a_face_rounds_is_in_the_deviation(monkeypatch: pytest.MonkeyPatch) -> None:
    plain = hosts.design_from_face(make_face(bumpy()), tolerance=1e-3).deviation
    part = face_designs.part_of_surface
    monkeypatch.setattr(face_designs, "part_of_surface", lambda *given: (part(*given)[0], 1e-6))
    wider = hosts.design_from_face(make_face(bumpy()), tolerance=1e-3).deviation
    assert wider == pytest.approx((plain[0] - 1e-6, plain[1] + 1e-6), abs=1e-10)


@pytest.mark.parametrize(("tolerance", "patches"), [(0.5, 1), (1e-3, 4)])
def test_turned_faces_of_splines_give_turned_patches(tolerance: float, patches: int) -> None:
    face = as_face(make_face(bumpy()).Reversed())
    design = hosts.design_from_face(face, tolerance=tolerance)
    assert len(design.patches) >= patches
    assert isinstance(design.surface, Quilt) == (patches > 1)
    assert max(normal_gap(face, patch) for patch in design.patches) < 0.3


def test_corners_of_a_spline_are_where_patches_meet() -> None:
    points = np.array([[[x, y, abs(x - 2)] for y in (0.0, 1.0, 2.0)] for x in (0.0, 1.0, 2.0, 3.0, 4.0)])
    spline = BSplineSurface(points, [0, 1, 2], [3, 2, 3], 2, [0, 1], [3, 3], 2)
    design = hosts.design_from_face(make_face(spline), tolerance=1e-3)
    assert len(design.patches) == 2
    np.testing.assert_allclose(design.patches[0].evaluate(1.0, 0.5)[0], 2, atol=1e-3)


def test_fits_keep_the_derivatives_at_their_ends() -> None:
    x = (1 - np.cos(np.linspace(0, np.pi, 41))) / 2
    known = np.concatenate([np.sin(3 * x), [3, 3 * np.cos(3)]])
    basis = Basis(7)
    points = fitting(7, x, 1) @ known
    np.testing.assert_array_equal(points[[0, -1]], np.sin([0, 3]))
    ends = np.array([0.0, 1.0])
    np.testing.assert_allclose(basis.derivative(ends, 1) @ points, [3, 3 * np.cos(3)], atol=1e-12)
    t = np.linspace(0, 1, 200)
    assert np.abs(basis.evaluate(t) @ points - np.sin(3 * t)).max() < 1e-5


def test_a_patch_is_found_again() -> None:
    net = (
        np.random.default_rng(1).normal(size=(4, 3, 3))
        + np.stack(np.meshgrid(range(4), range(3), [0], indexing="ij"), -1)[:, :, 0] * 9
    )
    surface = Surface(net)
    design = hosts.design_from_face(hosts.made_face(surface, tolerance=1e-7).shape, tolerance=1e-5)
    u = np.linspace(0, 1, 21)
    np.testing.assert_allclose(design.surface.evaluate(u[:, None], u), surface.evaluate(u[:, None], u), atol=1.1e-5)


def test_faces_that_are_too_much_are_refused() -> None:
    with pytest.raises(ToleranceNotMet, match="more than 256 patches"):
        hosts.design_from_face(make_face(bumpy()), tolerance=1e-9, max_degree=3)
    with pytest.raises(InputError, match="max_degree"):
        hosts.design_from_face(quarter(), max_degree=1)
    with pytest.raises(InputError, match="tolerance must be above 0"):
        hosts.design_from_face(quarter(), tolerance=0)


@pytest.mark.parametrize("order", ["G0", "G1", "G2"])
@pytest.mark.parametrize("number", range(4))
def test_patches_continue_faces(order: str, number: int) -> None:
    face = quarter()
    edge = subshapes(face, "EDGE")[number]
    line = hosts.core_of_edge(edge)
    ends, middle = line.evaluate(np.array([0.0, line.domain[1]])), line.evaluate(line.domain[1] / 2)
    spline = hosts.core_of_face(face)
    inside = np.mean(spline.evaluate(np.mean(spline.knots_u[[0, -1]]), np.mean(spline.knots_v[[0, -1]])), axis=0)
    out = 0.4 * (middle - inside) * [1, 1, 1]
    curve = Curve([ends[0] + out, middle + 1.5 * out, ends[1] + out])
    joined = hosts.patch_on_face(face, edge, curve, order=order)
    assert joined.report.meets(order)
    u = np.linspace(0, 1, 41)
    near = joined.surface.evaluate(0.0, u)
    on_edge = line.evaluate(np.linspace(*line.domain, 2001))
    assert np.linalg.norm(near[:, None] - on_edge, axis=2).min(axis=1).max() < 5e-3
    np.testing.assert_allclose(joined.surface.evaluate(1.0, 0.5), curve.evaluate(0.5), atol=1.1e-3)
    if order != "G0":  # the tangent plane there is that of the cylinder: its normal is radial
        normal = np.cross(joined.surface.derivative(0.0, u, (1, 0)), joined.surface.derivative(0.0, u, (0, 1)))
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        radial = near * [1, 1, 0] / np.linalg.norm(near * [1, 1, 0], axis=1)[:, None]
        assert np.abs((normal * radial).sum(axis=1)) == pytest.approx(1, abs=1e-8)


@pytest.mark.parametrize("number", [0, 1])
def test_the_curve_that_a_patch_reaches_may_run_either_way(number: int) -> None:
    face = quarter()
    edge = subshapes(face, "EDGE")[number]
    line = hosts.core_of_edge(edge)
    points = line.evaluate(np.linspace(*line.domain, 3)) + [4.0, 5.0, 6.0]
    there, back = (hosts.patch_on_face(face, edge, Curve(one)).surface for one in (points, points[::-1]))
    np.testing.assert_allclose(back.control_points, there.control_points, atol=1e-9)


@pytest.mark.parametrize("reach", [3.0, 12.0])
def test_the_reach_of_a_patch_is_its_speed_away_from_the_edge(reach: float) -> None:
    face = quarter()
    arcs = [edge for edge in subshapes(face, "EDGE") if kind_of(as_edge(edge)) == "Circle"]
    rim = next(edge for edge in arcs if hosts.core_of_edge(edge).evaluate(0.0)[2] > 5)
    line = hosts.core_of_edge(rim)
    points = line.evaluate(np.linspace(*line.domain, 3)) + [0, 0, 6]
    surface = hosts.patch_on_face(face, rim, Curve(points), reach=reach, tolerance=0.1).surface
    speeds = np.linalg.norm(surface.derivative(0.0, np.linspace(0, 1, 9), (1, 0)), axis=-1)
    assert speeds == pytest.approx(reach, rel=1e-6)


def test_what_is_no_side_is_refused() -> None:
    for arc in (
        EllipseArc([0, 0, 4], [5, 0, 0], [0, 5, 0], 0.0, 1.0),
        EllipseArc([0, 0, 0.01], [5, 0, 0], [0, 5, 0], 0.0, math.radians(120)),
    ):
        with pytest.raises(InputError, match="whole side"):
            hosts.patch_on_face(quarter(), make_edge(arc), SWING)
    other = make_edge(arc)
    with pytest.raises(InputError, match='"G0", "G1" or "G2"'):
        hosts.patch_on_face(quarter(), other, SWING, order="G3")


def test_a_trimmed_face_is_refused_unless_all_of_its_surface_is_wanted() -> None:
    gp, api = kernel_module("gp"), kernel_module("BRepBuilderAPI")
    plane = gp.gp_Pln(gp.gp_Pnt(0.0, 0.0, 0.0), gp.gp_Dir(0.0, 0.0, 1.0))
    wire = hosts.made_wire(circle([0, 0, 0], 3, [0, 0, 1])).shape
    face = api.BRepBuilderAPI_MakeFace(plane, wire, True).Face()
    with pytest.raises(InputError, match="untrimmed=True"):
        hosts.design_from_face(face)
    whole = hosts.design_from_face(face, untrimmed=True).surface
    assert np.ptp(whole.evaluate([0.0, 1.0], [0.0, 1.0]), axis=0) == pytest.approx([6, 6, 0], abs=2e-3)


def test_splines_of_the_kernel_come_back() -> None:
    spline = hosts.made_face(Ruled(SWING, SWING.transformed(np.eye(3), [0, 0, 5]))).fit.spline  # type: ignore[union-attr]
    back = hosts.core_of_face(make_face(spline))
    np.testing.assert_array_equal(back.control_points, spline.control_points)
