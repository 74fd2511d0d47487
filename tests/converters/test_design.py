from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline
from scipy.spatial import cKDTree

from gtcad import Curve
from gtcad.continuity import check_join
from gtcad.converters import fit_curve
from gtcad.converters.bspline import BSplineCurve
from gtcad.converters.design import nearest_chain, nearest_gt
from gtcad.converters.occt.compat import kernel_module, point
from gtcad.converters.occt.geometry import to_geom_curve
from gtcad.converters.part import EllipseArc
from gtcad.converters.spline_parts import cut
from gtcad.errors import InputError, KernelError, ToleranceBelowPrecision, ToleranceNotMet
from gtcad.restricted import Restricted
from tests import pieces, splines
from tests.converters.occt import shapes

LINE = np.linspace(0, 1, 4001)
ARC = EllipseArc([1, 2, 3], [50, 0, 0], [0, 30, 0], 0.3, 4.0)
TURN = EllipseArc([1, 2, 3], [40, 0, 0], [0, 0, 40], 0.0, 2 * math.pi)
EDGES, GEOM, GP = kernel_module("BRepBuilderAPI"), kernel_module("Geom"), kernel_module("gp")


def held(spline, x):
    """Points of a B-spline at parts of its domain, by scipy alone."""
    u = spline.knots[0] + x * (spline.knots[-1] - spline.knots[0])
    values = BSpline(spline.flat_knots, spline.homogeneous, spline.degree)(u)
    return values if spline.weights is None else values[..., :-1] / values[..., -1:]


def on(source, x):
    if isinstance(source, BSplineCurve):
        return held(source, x)
    return source.evaluate(source.start + x * (source.end - source.start))


def random_spline(seed, rational=False):
    rng = np.random.default_rng(seed)
    degree, spans = int(rng.integers(1, 8)), int(rng.integers(1, 5))
    counts = rng.integers(1, degree + 1, spans - 1)
    count = degree + 1 + int(counts.sum())
    points = rng.normal(0, 15, (count, 3))
    points[:, 0] = np.linspace(0, 100, count)
    knots = np.cumsum([-3, *rng.uniform(0.2, 3, spans)])
    weights = rng.uniform(0.3, 3, count) if rational else None
    return BSplineCurve(points, knots, [degree + 1, *counts, degree + 1], degree, weights)


# --- one curve ----------------------------------------------------------------------------------------------------


@given(st.integers(0, 10**6), st.integers(2, 9), st.booleans())
def test_the_proved_pair_brackets_what_dense_samples_see(seed, degree, rational):
    source = random_spline(seed, rational)
    design = nearest_gt(source, degree)
    breaks = (source.knots - source.knots[0]) / (source.knots[-1] - source.knots[0])
    line = np.unique(np.concatenate([LINE, breaks]))  # the largest distance may be at a corner
    seen = np.linalg.norm(design.curve.evaluate(line) - held(source, line), axis=1).max()
    lower, upper = design.deviation
    assert lower <= upper
    assert seen <= upper
    assert lower <= seen * (1 + 1e-3)  # attained, perhaps between two samples
    assert np.abs(design.curve.evaluate([0, 1]) - held(source, np.array([0, 1]))).max() < 1e-12
    assert (design.parametrisation, design.breaks) == ("equal", (0.0, 1.0))


def test_the_upper_bound_holds_at_fifty_digits_where_rounding_is_all_that_is_left():
    curve = Curve([[0, 0, 0], [30, 50, 10], [100, 20, -10]], gamma=(0.4, -0.7))
    form = fit_curve(curve, tolerance=2e-11, degree=11, exact=False).spline
    design = nearest_gt(form, 2)
    assert design.deviation[1] < 1e-10
    errors = [splines.curve_error(design.curve, form, float(t)) for t in np.linspace(0, 1, 41)]
    assert max(errors) <= design.deviation[1]


@pytest.mark.parametrize("name", ["C3s", "D5s", "E8p"])
def test_splines_made_from_gt_curves_lead_back(name):
    curve = pieces.curves()[name]
    spline = fit_curve(curve, tolerance=1e-9, degree=9).spline
    design = nearest_gt(spline, curve.degree)
    assert design.deviation[1] <= 2.5e-9
    if curve.degree == 3:
        assert np.abs(np.subtract(design.curve.gamma, curve.gamma)).max() < 1e-7
        assert np.abs(design.curve.control_points - curve.control_points).max() < 1e-5


def test_a_quarter_ellipse_is_a_curve_of_degree_2():
    design = nearest_gt(EllipseArc([1, 2, 3], [5, 0, 0], [0, 3, 0], 0.4, 0.4 + math.pi / 2), 2)
    assert design.deviation[1] < 1e-12
    assert np.abs(design.curve.gamma).max() < 1e-9
    x, y, z = (design.curve.evaluate(LINE) - [1, 2, 3]).T
    assert np.abs((x / 5) ** 2 + (y / 3) ** 2 - 1).max() < 1e-13
    assert np.abs(z).max() < 1e-13


def test_curves_of_the_protocol_are_sources():
    curve = pieces.curves()["D5s"]
    part = Restricted(curve, (0.7, 0.2))
    design = nearest_gt(part, 7, tolerance=1e-3)
    distances = np.linalg.norm(design.curve.evaluate(LINE) - curve.evaluate(0.7 - 0.5 * LINE), axis=1)
    assert distances.max() <= design.deviation[1] <= 1e-3
    assert nearest_gt(curve, curve.degree, tolerance=1e-9).curve.degree <= curve.degree


@pytest.mark.parametrize("tolerance", [1.0, 1e-2, 1e-4, 1e-7])
def test_the_least_degree_within_the_tolerance_is_taken(tolerance):
    design = nearest_gt(ARC, 12, tolerance=tolerance)
    distances = np.linalg.norm(design.curve.evaluate(LINE) - on(ARC, LINE), axis=1)
    assert distances.max() <= design.deviation[1] <= tolerance
    assert nearest_gt(ARC, design.curve.degree - 1).deviation[0] > tolerance


def test_a_tolerance_is_kept_or_refused():
    with pytest.raises(ToleranceNotMet, match="degree = 4 is the largest allowed") as caught:
        nearest_gt(ARC, 4, tolerance=1e-6)
    assert caught.value.requested == 1e-6
    assert caught.value.achieved == nearest_gt(ARC, 4).deviation[1]


def test_given_design_variables_are_kept_and_searched_ones_are_nearer():
    source = random_spline(3)
    fixed, free = nearest_gt(source, 4, gamma=(0.5, -0.5)), nearest_gt(source, 4)
    assert fixed.curve.gamma == (0.5, -0.5)
    assert free.deviation[1] < fixed.deviation[0]


@pytest.mark.parametrize("source", [ARC, random_spline(8), shapes.circle()], ids=["arc", "spline", "circle"])
def test_corrected_parameters_are_nearer_as_point_sets_and_proved(source):
    equal, design = nearest_gt(source, 5), nearest_gt(source, 5, correct_parameters=True)
    assert design.parametrisation == "corrected"
    lower, upper = design.deviation
    assert lower <= upper < equal.deviation[0]
    dense = np.linspace(0, 1, 40001)
    sets = design.curve.evaluate(dense), on(source, dense)
    seen = max(cKDTree(a).query(b[::20])[0].max() for a, b in (sets, sets[::-1]))
    gap = max(np.linalg.norm(np.diff(one, axis=0), axis=1).max() for one in sets)
    assert lower - gap <= seen <= upper + gap


# --- chains -------------------------------------------------------------------------------------------------------


def assert_chain(source, design, tolerance):
    chain, breaks = design.curve, np.array(design.breaks)
    assert breaks[0] == 0.0
    assert breaks[-1] == 1.0
    assert len(chain.pieces) == len(breaks) - 1
    places = np.linspace(0, len(chain.pieces), 200 * len(chain.pieces) + 1)
    x = np.interp(places, np.arange(len(breaks)), breaks)
    distances = np.linalg.norm(chain.evaluate(places) - on(source, x), axis=1)
    assert distances.max() <= design.deviation[1] <= tolerance
    assert design.deviation[0] <= design.deviation[1]
    for (a, b), order in zip(chain.joints, chain.orders, strict=True):
        assert np.array_equal(a.control_points[-1], b.control_points[0])
        assert check_join(a, b).meets(order)


@pytest.mark.parametrize(("order", "degree"), [("C0", 2), ("G1", 3), ("G1", 5), ("G2", 6), ("G3", 8)])
@pytest.mark.parametrize("rational", [False, True])
def test_chains_keep_the_tolerance_and_the_order(order, degree, rational):
    rng = np.random.default_rng(2)
    points = np.c_[np.linspace(0, 100, 8), rng.normal(0, 10, (8, 2))]
    source = BSplineCurve(points, [0, 1, 2.2, 3], [6, 1, 1, 6], 5, rng.uniform(0.7, 1.4, 8) if rational else None)
    tolerance = 0.3 if degree < 5 else 1e-3
    design = nearest_chain(source, degree, tolerance=tolerance, order=order)
    assert_chain(source, design, tolerance)
    assert len(design.curve.pieces) > 1
    assert all(report.meets(order) for report in design.curve.report())


def test_corners_stay_corners_and_nothing_else_becomes_one():
    points = [[0, 0], [10, 20], [20, 20], [30, 0], [40, 20], [50, 20], [60, 0]]
    source = BSplineCurve(points, [0, 1, 2], [4, 3, 4], 3)
    design = nearest_chain(source, 5, tolerance=1e-4, order="G1")
    assert_chain(source, design, 1e-4)
    corner = design.breaks.index(0.5)
    orders = list(design.curve.orders)
    assert orders.pop(corner - 1) == "C0"
    assert len(orders) > 1
    assert all(order in ("C1", "G1", "C2", "G2", "C3", "G3") for order in orders)


def test_joints_that_are_smoother_than_their_knots_stay_so():
    design = nearest_chain(shapes.circle(), 6, tolerance=1e-3, order="G2")  # double knots of degree 2: C0 by the knots
    assert_chain(shapes.circle(), design, 1e-3)
    assert design.curve.closed
    assert len(design.curve.orders) == len(design.curve.pieces)
    assert all(report.meets("G2") for report in design.curve.report())


def test_a_circle_is_four_exact_quarters():
    design = nearest_chain(TURN, 2, tolerance=1e-10, order="C0")
    assert_chain(TURN, design, 1e-10)
    assert design.breaks == (0, 0.25, 0.5, 0.75, 1)
    offset = design.curve.evaluate(np.linspace(0, 4, 999)) - [1, 2, 3]
    assert np.abs(np.linalg.norm(offset, axis=1) - 40).max() < 1e-12
    assert all(order in ("C2", "C3") for order in design.curve.orders)


def test_tangents_at_the_joints_are_those_of_the_source():
    source = random_spline(21)
    design = nearest_chain(source, 5, tolerance=1e-2, order="G1")
    slopes = BSpline(source.flat_knots, source.control_points, source.degree).derivative()
    width = source.knots[-1] - source.knots[0]
    assert len(design.curve.pieces) > 2
    for piece, a, b in zip(design.curve.pieces, design.breaks[:-1], design.breaks[1:], strict=True):
        wanted = slopes(source.knots[0] + a * width) * width * (b - a)  # from the right, as scipy takes it
        assert np.abs(piece.derivative(0.0) - wanted).max() <= 1e-9 * np.abs(wanted).max()


def assert_random_chain(seed, rational):
    source = random_spline(seed, rational)
    assert_chain(source, nearest_chain(source, 4, tolerance=2.0, order="G1"), 2.0)


@pytest.mark.parametrize("rational", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_random_splines_become_chains(seed, rational):
    assert_random_chain(seed, rational)


@pytest.mark.stress
@settings(max_examples=200)
@given(st.integers(0, 10**6), st.booleans())
def test_many_random_splines_become_chains(seed, rational):
    assert_random_chain(seed, rational)


@pytest.mark.parametrize("rational", [False, True])
@pytest.mark.parametrize("degree", [1, 3, 8, 25])
def test_a_part_of_a_spline_is_the_spline(degree, rational):
    spline = shapes.curve(degree, degree, rational, 3)
    start, end = spline.domain
    for a, b in [(0.0, 0.4), (0.13, 0.86), (0.7, 1.0), (float(spline.knots[1] - start) / (end - start), 1.0)]:
        part = cut(spline, start + a * (end - start), start + b * (end - start))
        assert np.abs(held(part, LINE) - held(spline, a + LINE * (b - a))).max() < 1e-11


# --- edges of the kernel ------------------------------------------------------------------------------------------


class Wrapper:
    """An object of build123d or CadQuery, as far as it matters."""

    def __init__(self, shape):
        self.wrapped = shape


def circle_edge(first, last):
    axes = GP.gp_Ax2(point([1, 2, 3]), GP.gp_Dir(0, 0, 1), GP.gp_Dir(1, 0, 0))
    return EDGES.BRepBuilderAPI_MakeEdge(GP.gp_Circ(axes, 20.0), first, last).Edge()


@pytest.mark.parametrize("wrap", [lambda edge: edge, Wrapper])
def test_edges_of_circles_become_curves_of_degree_2(wrap):
    design = nearest_gt(wrap(circle_edge(0.5, 0.5 + math.pi / 2)), 6, tolerance=1e-9)
    assert design.curve.degree == 2
    offset = design.curve.evaluate(LINE) - [1, 2, 3]
    assert np.abs(np.linalg.norm(offset, axis=1) - 20).max() < 1e-12
    assert np.abs(offset[0] - [20 * math.cos(0.5), 20 * math.sin(0.5), 0]).max() < 1e-12


def test_a_reversed_edge_gives_the_curve_from_its_other_end():
    edge = circle_edge(0.5, 1.5)
    there, back = nearest_gt(edge, 3), nearest_gt(edge.Reversed(), 3)
    assert there.curve.reversed() == back.curve
    assert there.deviation == back.deviation
    there, back = (nearest_chain(one, 3, tolerance=5e-3) for one in (edge, edge.Reversed()))
    assert len(there.curve.pieces) > 1
    assert np.array_equal(there.curve.evaluate(0.0), back.curve.evaluate(float(len(back.curve.pieces))))
    assert back.breaks == tuple(1 - x for x in there.breaks[::-1])


def test_edges_of_splines_are_those_of_their_poles():
    source = shapes.curve(2, 4, True, 3)
    edge = EDGES.BRepBuilderAPI_MakeEdge(to_geom_curve(source)).Edge()
    design = nearest_gt(edge, 8)
    distances = np.linalg.norm(design.curve.evaluate(LINE) - held(source, LINE), axis=1)
    assert design.deviation[0] * 0.999 <= distances.max() <= design.deviation[1]
    chain = nearest_chain(edge, 5, tolerance=1e-3)
    assert_chain(source, chain, 1e-3)


def test_lines_and_straight_edges():
    edge = EDGES.BRepBuilderAPI_MakeEdge(point([0, 0, 0]), point([30, 40, 0])).Edge()
    design = nearest_gt(edge, 14, tolerance=1e-6)
    assert np.abs(np.cross(design.curve.evaluate(LINE), [0.6, 0.8, 0])).max() < 1e-12


def test_edges_without_an_exact_form_are_refused():
    base = GEOM.Geom_Ellipse(GP.gp_Ax2(point([0, 0, 0]), GP.gp_Dir(0, 0, 1)), 3.0, 2.0)
    offset = GEOM.Geom_OffsetCurve(base, 0.5, GP.gp_Dir(0, 0, 1))
    with pytest.raises(KernelError, match="OFFSET_CURVE_3D has no exact B-spline form"):
        nearest_gt(EDGES.BRepBuilderAPI_MakeEdge(offset).Edge(), 5)


def test_other_shapes_are_refused():
    wire = EDGES.BRepBuilderAPI_MakeWire(circle_edge(0, 1)).Wire()
    with pytest.raises(InputError, match="source must be an edge of the kernel, got wire"):
        nearest_gt(wire, 5)
    with pytest.raises(InputError, match="source must be an edge of the kernel, got an empty shape"):
        nearest_gt(kernel_module("TopoDS").TopoDS_Edge(), 5)
    with pytest.raises(InputError, match=r"source must be a BSplineCurve, .* got list"):
        nearest_gt([[0, 0], [1, 1]], 5)
    with pytest.raises(InputError, match="got Wrapper"):
        nearest_gt(Wrapper(None), 5)


# --- bad arguments ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: nearest_gt(ARC, 1), "degree must be a whole number"),
        (lambda: nearest_gt(ARC, 61), "degree must be a whole number"),
        (lambda: nearest_gt(ARC, 3, tolerance=0), "tolerance must be a finite number above 0, got 0"),
        (lambda: nearest_gt(ARC, 3, tolerance=math.nan), "tolerance must be a finite number above 0, got nan"),
        (lambda: nearest_gt(ARC, 3, gamma=(2, 0)), r"gamma\[0\] must lie in \[-1, 1\], got 2"),
        (lambda: nearest_chain(ARC, 2, tolerance=1), "order G1 needs degree 3 at least, got 2"),
        (lambda: nearest_chain(ARC, 5, tolerance=1, order="C1"), 'order must be "C0", or "G0" to "G3"'),
        (lambda: nearest_chain(ARC, 5, tolerance=1, order="G4"), "order must be one of"),
        (lambda: nearest_chain(ARC, 5, tolerance=-1), "tolerance must be a finite number above 0, got -1"),
        (lambda: nearest_chain(ARC, 5, tolerance=1, max_pieces=0), "max_pieces must be a whole number from 1, got 0"),
    ],
)
def test_bad_arguments_are_refused(call, message):
    with pytest.raises(InputError, match=message):
        call()


def test_chains_that_need_too_much_are_refused():
    with pytest.raises(ToleranceNotMet, match="max_pieces = 4") as caught:
        nearest_chain(random_spline(21), 3, tolerance=1e-6, max_pieces=4)
    assert caught.value.achieved > 1e-6
    assert caught.value.spans <= 4
    with pytest.raises(ToleranceBelowPrecision):
        nearest_chain(ARC, 3, tolerance=1e-16)
