from __future__ import annotations

import copy
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gtcad import BERNSTEIN, Curve, Quilt, Solid, Surface
from gtcad.composite import Composite
from gtcad.conics import circle
from gtcad.continuity import check_join
from gtcad.converters import hosts
from gtcad.converters.occt.compat import as_edge, kernel_module
from gtcad.converters.occt.faces import area, volume
from gtcad.converters.occt.pieces import edge_geometry, is_valid, subshapes
from gtcad.converters.occt.topology import make_edge, make_face
from gtcad.converters.part import EllipseArc
from gtcad.errors import InputError, ToleranceNotMet
from gtcad.patches import Rotation, Ruled

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


def test_designs_for_edges_are_within_the_tolerance() -> None:
    arc = make_edge(EllipseArc([0, 0, 0], [5, 0, 0], [0, 5, 0], 0.2, 1.9))
    design = hosts.design_from_edge(arc, tolerance=1e-3)
    assert isinstance(design.curve, Curve)
    radii = np.linalg.norm(design.curve.evaluate(np.linspace(0, 1, 500)), axis=1)
    assert np.abs(radii - 5).max() <= design.deviation[1] <= 1e-3
    full = make_edge(EllipseArc([0, 0, 0], [5, 0, 0], [0, 2, 0], 0.0, 2 * math.pi))
    chain = hosts.design_from_edge(full, tolerance=1e-5)
    assert isinstance(chain.curve, Composite)
    assert chain.curve.closed
    assert chain.deviation[1] <= 1e-5


# --- faces of hosts ---------------------------------------------------------------------------------------------------


def quarter(radius: float = 5.0) -> Any:
    """A third of a cylinder, about the z axis."""
    profile = Curve([[radius, 0, 0], [radius, 0, 10]], family=BERNSTEIN)
    return hosts.made_face(Rotation(profile, [0, 0, 0], [0, 0, 1], 120.0)).shape


def test_designs_for_faces_are_within_the_tolerance() -> None:
    design = hosts.design_from_face(quarter(), tolerance=1e-3)
    u = np.linspace(0, 1, 60)
    points = design.surface.evaluate(u[:, None], u)
    assert np.abs(np.hypot(points[..., 0], points[..., 1]) - 5).max() <= design.deviation[1] <= 1e-3
    assert np.ptp(points[..., 2]) == pytest.approx(10, abs=1e-3)


def test_a_patch_is_found_again() -> None:
    net = (
        np.random.default_rng(1).normal(size=(4, 3, 3))
        + np.stack(np.meshgrid(range(4), range(3), [0], indexing="ij"), -1)[:, :, 0] * 9
    )
    surface = Surface(net)
    design = hosts.design_from_face(hosts.made_face(surface, tolerance=1e-7).shape, tolerance=1e-5)
    u = np.linspace(0, 1, 21)
    np.testing.assert_allclose(design.surface.evaluate(u[:, None], u), surface.evaluate(u[:, None], u), atol=1.1e-5)


def test_faces_that_are_too_much_for_one_patch_are_refused() -> None:
    with pytest.raises(ToleranceNotMet, match="max_degree = 6"):
        hosts.design_from_face(hosts.made_face(TUBE).shape, tolerance=1e-6, max_degree=6)
    with pytest.raises(InputError, match="max_degree"):
        hosts.design_from_face(quarter(), max_degree=1)


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


def test_what_is_no_side_is_refused() -> None:
    other = make_edge(EllipseArc([0, 0, 4], [5, 0, 0], [0, 5, 0], 0.0, 1.0))
    with pytest.raises(InputError, match="whole side"):
        hosts.patch_on_face(quarter(), other, SWING)
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
