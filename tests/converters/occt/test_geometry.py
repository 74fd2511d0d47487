from __future__ import annotations

import math

import numpy as np
import pytest

from gtcad.converters.bspline import BSplineCurve
from gtcad.converters.occt import geometry
from gtcad.converters.occt.compat import integer_array, kernel_module, point, point_array, real_array
from gtcad.converters.part import EllipseArc
from gtcad.errors import InputError, KernelError
from tests.converters.occt import shapes

Geom = kernel_module("Geom")
gp = kernel_module("gp")
FRAME = gp.gp_Ax3(gp.gp_Pnt(1, 2, 3), gp.gp_Dir(1, 2, 2), gp.gp_Dir(2, -2, 1))
AXES = FRAME.Ax2()
ORIGIN, NORMAL, ALONG = np.array([1, 2, 3]), np.array([1, 2, 2]) / 3, np.array([2, -2, 1]) / 3
ACROSS = np.cross(NORMAL, ALONG)
FULL = 2 * math.pi


def coordinates(kernel_point):
    return np.array(kernel_point.Coord())


def local(points):
    """Coordinates in FRAME: along its x, y and z axes."""
    return (points - ORIGIN) @ np.stack([ALONG, ACROSS, NORMAL], axis=-1)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("rational", [False, True])
@pytest.mark.parametrize("degree", [1, 2, 5, 25])
def test_curves_come_back_bit_for_bit_and_mean_the_same(degree, rational, dimension):
    spline = shapes.curve(degree, degree, rational, dimension)
    kernel = geometry.to_geom_curve(spline)
    assert shapes.same_bits(spline, geometry.from_geom_curve(kernel))
    for t in np.linspace(0, 1, 11):
        assert np.abs(coordinates(kernel.Value(t))[:dimension] - spline.evaluate(t)).max() < 1e-12


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("rational", [False, True])
@pytest.mark.parametrize("degrees", [(1, 1), (3, 2), (1, 9), (25, 25)])
def test_surfaces_come_back_bit_for_bit_and_mean_the_same(degrees, rational, dimension):
    spline = shapes.patch(1, degrees, rational, dimension)
    kernel = geometry.to_geom_surface(spline)
    assert shapes.same_bits(spline, geometry.from_geom_surface(kernel))
    for u, v in np.random.default_rng(0).random((10, 2)):
        assert np.abs(coordinates(kernel.Value(u, v))[:dimension] - spline.evaluate(u, v)).max() < 1e-11


def test_equal_weights_are_dropped_by_the_kernel():
    spline = shapes.curve(1)
    weighted = BSplineCurve(
        spline.control_points,
        spline.knots,
        spline.multiplicities,
        spline.degree,
        np.full(len(spline.control_points), 2.0),
    )
    assert shapes.same_bits(geometry.from_geom_curve(geometry.to_geom_curve(weighted)), spline)


def test_knots_that_the_kernel_would_merge_are_refused():
    curve = BSplineCurve(np.eye(3), [0, 0.5, 0.5 + 1e-10, 1][:2], [3, 3], 2)
    geometry.to_geom_curve(curve)
    points = np.random.default_rng(0).random((6, 3))
    with pytest.raises(
        InputError, match=r"knots must lie at least 1e-09 apart for the kernel, got 0.5 and 0.5000000001"
    ):
        geometry.to_geom_curve(BSplineCurve(points, [0, 0.5, 0.5 + 1e-10, 1], [4, 1, 1, 4], 3))
    with pytest.raises(InputError, match="apart"):
        geometry.to_geom_curve(BSplineCurve(points[:3], [0, 1e-10], [3, 3], 2))
    with pytest.raises(InputError, match="at least 1e-06 apart"):
        geometry.to_geom_curve(BSplineCurve(points[:5], [0, 1e-7, 1000], [4, 1, 4], 3))


def test_close_knots_of_a_surface_are_refused_in_either_direction():
    patch = shapes.patch(1)
    for name in ("knots_u", "knots_v"):
        close = {f: getattr(patch, f) for f in ("control_points", "multiplicities_u", "degree_u", "knots_u")}
        close |= {f: getattr(patch, f) for f in ("multiplicities_v", "degree_v", "knots_v")}
        close[name] = [0, 1 - 1e-11, 1]
        with pytest.raises(InputError, match=name):
            geometry.to_geom_surface(type(patch)(**close))


@pytest.mark.parametrize("rational", [False, True])
def test_periodic_curves_become_clamped(rational):
    points = np.random.default_rng(0).random((5, 3))
    weights = (real_array(np.array([1, 2, 0.5, 1, 3.0])),) if rational else ()
    kernel = Geom.Geom_BSplineCurve(
        point_array(points), *weights, real_array(np.arange(6.0)), integer_array((1,) * 6), 3, True
    )
    spline = geometry.from_geom_curve(kernel)
    assert kernel.IsPeriodic()
    assert spline.knots[[0, -1]].tolist() == [0, 5]
    for t in np.linspace(0, 5, 11):
        assert np.abs(coordinates(kernel.Value(t)) - spline.evaluate(t)).max() < 1e-14


def test_unclamped_curves_become_clamped():
    points = np.random.default_rng(0).random((7, 3))
    kernel = Geom.Geom_BSplineCurve(
        point_array(points), real_array(np.arange(11.0)), integer_array((1,) * 11), 3, False
    )
    spline = geometry.from_geom_curve(kernel)
    assert spline.knots[[0, -1]].tolist() == [3, 7]
    for t in np.linspace(3, 7, 9):
        assert np.abs(coordinates(kernel.Value(t)) - spline.evaluate(t)).max() < 1e-14


def test_periodic_surfaces_become_clamped():
    for surface in (shapes.torus(), shapes.cylinder(), shapes.swapped(shapes.cylinder())):
        kernel = geometry.to_geom_surface(surface)
        if kernel.IsUClosed():
            kernel.SetUPeriodic()
        if kernel.IsVClosed():
            kernel.SetVPeriodic()
        spline = geometry.from_geom_surface(kernel)
        u = np.linspace(0, 1, 7)
        assert np.abs(spline.evaluate(u[:, None], u) - surface.evaluate(u[:, None], u)).max() < 1e-14


@pytest.mark.parametrize("start", [-20.0, -1.0, 0.0, 0.3, 6.0, 40.0])
@pytest.mark.parametrize("turn", [0.1, 3.0, math.pi, 6.0, FULL])
@pytest.mark.parametrize(
    ("a", "b"), [([0, 2, 0], [0, 0, 2]), ([3, 0, 1], [-1, 0, 3]), ([0, 3, 0], [1, 0, 0]), ([0, 1, 1], [0, -2, 2])]
)
def test_conics_run_through_the_arc(a, b, turn, start):
    arc = EllipseArc([1, 2, 3], a, b, start, start + turn)
    conic, first, last = geometry.to_geom_conic(arc)
    along = np.linspace(0, 1, 9)
    kernel = np.array([coordinates(conic.Value(t)) for t in first + along * (last - first)])
    assert np.abs(kernel - arc.evaluate(start + along * turn)).max() < 1e-13
    assert 0 <= first < FULL


def test_halves_are_the_arc():
    arc = EllipseArc([0, 0, 0], [3, 0, 0], [0, 2, 0], 0.3, 0.3 + FULL)
    first, second = geometry.halves(arc)
    assert (first.start, second.end, first.end) == (arc.start, arc.end, second.start)
    assert np.abs(second.evaluate(second.start) + arc.evaluate(0.3)).max() < 1e-15


def test_full_ellipses_are_told_from_circles_and_arcs():
    def full(b, end):
        return geometry.is_full_ellipse(EllipseArc([0, 0, 0], [3, 0, 0], [0, b, 0], 0.3, end))

    assert full(2, 0.3 + FULL)
    assert full(2, 0.3 + FULL - 1e-7)
    assert not full(3, 0.3 + FULL)
    assert not full(2, FULL)


def test_the_whole_curve_is_taken_as_it_is_and_a_part_is_cut_out():
    spline = shapes.curve(3, rational=True)
    whole, kind = geometry.exact_curve(geometry.to_geom_curve(spline), 0.0, 1.0)
    assert kind == "B_SPLINE_CURVE"
    assert shapes.same_bits(whole, spline)
    part, _ = geometry.exact_curve(geometry.to_geom_curve(spline), 0.25, 0.5)
    assert part.knots[[0, -1]].tolist() == [0.25, 0.5]
    t = np.linspace(0.25, 0.5, 9)
    assert np.abs(part.evaluate(t) - spline.evaluate(t)).max() < 1e-13


def test_a_periodic_curve_is_cut_across_its_joint():
    kernel = geometry.to_geom_curve(shapes.circle())
    kernel.SetPeriodic()
    part, _ = geometry.exact_curve(kernel, 0.9, 1.1)
    assert np.abs(np.linalg.norm(part.evaluate(np.linspace(0.9, 1.1, 9))[:, :2], axis=1) - 5).max() < 1e-14
    assert np.abs(part.evaluate(1.1) - shapes.circle().evaluate(0.1).tolist().__add__([0.0])).max() < 1e-14


def test_circles_and_ellipses_stay_what_they_are():
    arc, kind = geometry.exact_curve(Geom.Geom_Circle(AXES, 2.0), 0.5, 7.0 - 1)
    assert kind == "CIRCLE"
    assert shapes.same_arc(arc, EllipseArc(ORIGIN, 2 * ALONG, 2 * ACROSS, 0.5, 6.0))
    arc, kind = geometry.exact_curve(Geom.Geom_TrimmedCurve(Geom.Geom_Ellipse(AXES, 3.0, 2.0), 0.5, 2.0), 0.5, 2.0)
    assert kind == "ELLIPSE"
    assert shapes.same_arc(arc, EllipseArc(ORIGIN, 3 * ALONG, 2 * ACROSS, 0.5, 2.0))


def test_lines_become_straight_splines():
    line, kind = geometry.exact_curve(Geom.Geom_Line(point([0, 0, 1]), gp.gp_Dir(0, 1, 0)), -2.0, 5.0)
    assert kind == "LINE"
    assert line.degree == 1
    assert line.control_points.tolist() == [[0, -2, 1], [0, 5, 1]]
    assert line.knots.tolist() == [-2, 5]


def test_parabolas_hyperbolas_and_bezier_curves_are_exact():
    parabola, kind = geometry.exact_curve(Geom.Geom_Parabola(AXES, 0.5), -1.0, 3.0)
    x, y, _ = local(parabola.evaluate(np.linspace(-1, 3, 20))).T
    assert kind == "PARABOLA"
    assert np.abs(y**2 - 2 * x).max() < 1e-13
    hyperbola, kind = geometry.exact_curve(Geom.Geom_Hyperbola(AXES, 2.0, 1.0), -1.0, 1.5)
    x, y, _ = local(hyperbola.evaluate(np.linspace(*hyperbola.knots[[0, -1]], 20))).T
    assert kind == "HYPERBOLA"
    assert np.abs(x**2 / 4 - y**2 - 1).max() < 1e-12
    points = np.random.default_rng(0).random((4, 3))
    bezier, kind = geometry.exact_curve(Geom.Geom_BezierCurve(point_array(points)), 0.0, 1.0)
    assert kind == "BEZIER_CURVE"
    assert np.array_equal(bezier.control_points, points)


def test_curves_without_an_exact_form_are_refused():
    offset = Geom.Geom_OffsetCurve(geometry.to_geom_curve(shapes.curve(1)), 0.1, gp.gp_Dir(0, 0, 1))
    with pytest.raises(KernelError, match="OFFSET_CURVE_3D has no exact B-spline form"):
        geometry.exact_curve(offset, 0.0, 1.0)
    with pytest.raises(KernelError, match="LINE without bounds"):
        geometry.exact_curve(Geom.Geom_Line(point([0, 0, 0]), gp.gp_Dir(1, 0, 0)), -2e100, 1.0)


SURFACES = {
    "PLANE": (Geom.Geom_Plane(FRAME), (-1, 2, 0, 3), lambda x, y, z: z),
    "CYLINDRICAL_SURFACE": (Geom.Geom_CylindricalSurface(FRAME, 2.0), (1, 2, 0, 3), lambda x, y, z: np.hypot(x, y) - 2),
    "CONICAL_SURFACE": (
        Geom.Geom_ConicalSurface(FRAME, 0.5, 2.0),
        (0, FULL, -1, 3),
        lambda x, y, z: np.hypot(x, y) - 2 - z * math.tan(0.5),
    ),
    "SPHERICAL_SURFACE": (
        Geom.Geom_SphericalSurface(FRAME, 2.0),
        (1, 1 + FULL, -math.pi / 2, math.pi / 2),
        lambda x, y, z: np.sqrt(x**2 + y**2 + z**2) - 2,
    ),
    "TOROIDAL_SURFACE": (
        Geom.Geom_ToroidalSurface(FRAME, 5.0, 2.0),
        (0, FULL, 0, FULL),
        lambda x, y, z: np.hypot(np.hypot(x, y) - 5, z) - 2,
    ),
    "SURFACE_OF_LINEAR_EXTRUSION": (
        Geom.Geom_SurfaceOfLinearExtrusion(Geom.Geom_Ellipse(AXES, 3.0, 1.0), gp.gp_Dir(1, 2, 2)),
        (1, 4, -2, 5),
        lambda x, y, z: x**2 / 9 + y**2 - 1,
    ),
    "SURFACE_OF_REVOLUTION": (  # of a parabola about its own axis: a paraboloid
        Geom.Geom_SurfaceOfRevolution(Geom.Geom_Parabola(AXES, 0.5), gp.gp_Ax1(FRAME.Location(), gp.gp_Dir(2, -2, 1))),
        (0.5, 5, 0, 2),
        lambda x, y, z: y**2 + z**2 - 2 * x,
    ),
}


@pytest.mark.parametrize("kind", SURFACES)
def test_analytic_surfaces_are_exact(kind):
    kernel, bounds, implicit = SURFACES[kind]
    spline, found, covered = geometry.exact_surface(kernel, bounds)
    assert (found, covered) == (kind, bounds)
    u, v = (np.linspace(k[0], k[-1], 23) for k in (spline.knots_u, spline.knots_v))
    points = spline.evaluate(u[:, None], v)
    assert np.abs(implicit(*np.moveaxis(local(points), -1, 0))).max() < 1e-13
    corners = [coordinates(kernel.Value(float(bounds[i]), float(bounds[j]))) for i in (0, 1) for j in (2, 3)]
    assert np.abs(points[[0, 0, -1, -1], [0, -1, 0, -1]] - corners).max() < 1e-14


def test_poles_and_seams_of_analytic_surfaces_are_exactly_closed():
    sphere, _, _ = geometry.exact_surface(*SURFACES["SPHERICAL_SURFACE"][:2])
    assert np.array_equal(sphere.control_points[0], sphere.control_points[-1])
    assert (sphere.control_points[:, 0] == sphere.control_points[0, 0]).all()
    assert (sphere.control_points[:, -1] == sphere.control_points[0, -1]).all()


def test_a_range_that_is_a_full_turn_but_for_rounding_is_closed():
    kernel = SURFACES["CYLINDRICAL_SURFACE"][0]
    spline, _, bounds = geometry.exact_surface(kernel, (1e-12, FULL - 1e-12, 0.0, 1.0))
    assert bounds == (0.0, FULL, 0.0, 1.0)
    assert np.array_equal(spline.control_points[0], spline.control_points[-1])


def test_spline_surfaces_are_taken_whole_whatever_the_bounds():
    patch = shapes.patch(3, rational=True)
    kernel = Geom.Geom_RectangularTrimmedSurface(geometry.to_geom_surface(patch), 0.2, 0.5, 0.3, 0.4)
    spline, kind, bounds = geometry.exact_surface(kernel, (0.2, 0.5, 0.3, 0.4))
    assert kind == "B_SPLINE_SURFACE"
    assert shapes.same_bits(spline, patch)
    assert bounds == (0.0, 1.0, 0.0, 1.0)
    points = np.random.default_rng(0).random((3, 4, 3))
    bezier, kind, _ = geometry.exact_surface(Geom.Geom_BezierSurface(point_array(points)), (0.0, 1.0, 0.0, 1.0))
    assert kind == "BEZIER_SURFACE"
    assert np.array_equal(bezier.control_points, points)


def test_surfaces_without_an_exact_form_are_refused():
    curve = geometry.to_geom_curve(shapes.curve(1))
    offset = Geom.Geom_OffsetSurface(geometry.to_geom_surface(shapes.patch(1)), 0.1)
    bounds = (0.0, 1.0, 0.0, 1.0)
    with pytest.raises(KernelError, match="OFFSET_SURFACE has no exact B-spline form"):
        geometry.exact_surface(offset, bounds)
    pushed = Geom.Geom_SurfaceOfLinearExtrusion(
        Geom.Geom_OffsetCurve(curve, 0.1, gp.gp_Dir(0, 0, 1)), gp.gp_Dir(0, 0, 1)
    )
    with pytest.raises(KernelError, match="SURFACE_OF_LINEAR_EXTRUSION has no exact B-spline form"):
        geometry.exact_surface(pushed, bounds)
    with pytest.raises(KernelError, match="PLANE without bounds"):
        geometry.exact_surface(Geom.Geom_Plane(FRAME), (0.0, 1.0, 0.0, 2e100))
