from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from scipy.interpolate import BSpline

from gtcad import BERNSTEIN, Curve, Restricted, Surface
from gtcad.converters import fit_curve, fit_surface
from gtcad.converters.approximation import _of_kind
from gtcad.errors import InputError, ToleranceBelowPrecision, ToleranceNotMet
from tests import pieces

LINE = np.linspace(0, 1, 4001)


def truth(curve, spline):
    """Largest distance at equal parameters, by scipy alone."""
    held = BSpline(spline.flat_knots, spline.control_points, spline.degree)(LINE)
    return np.linalg.norm(curve.evaluate(LINE) - held, axis=1).max()


def poles(fit):
    return int(np.prod(fit.spline.control_points.shape[:-1]))


@pytest.mark.parametrize(("tolerance", "bar"), [(1e-4, 65), (1e-6, 109)])
def test_five_curves_keep_their_bar_at_degree_5(tolerance, bar):
    fits = {name: fit_curve(curve, tolerance=tolerance, exact=False) for name, curve in pieces.curves().items()}
    for name, fit in fits.items():
        assert truth(pieces.curves()[name], fit.spline) <= fit.deviation[1] <= tolerance
    assert sum(poles(fit) for fit in fits.values()) <= bar


@pytest.mark.parametrize(
    ("degree", "tolerance", "bars"),
    [
        (5, 1e-4, (100, 156, 272)),
        (5, 1e-6, (210, 396, 756)),
        ("auto", 1e-4, (81, 110, 144)),
        ("auto", 1e-6, (121, 156, 256)),
    ],
)
def test_patches_keep_their_bars(degree, tolerance, bars):
    line = np.linspace(0, 1, 151)
    for surface, bar in zip(pieces.surfaces().values(), bars, strict=True):
        fit = fit_surface(surface, tolerance=tolerance, degree=degree)
        gaps = surface.evaluate(line[:, None], line) - fit.spline.evaluate(line[:, None], line[None, :])
        assert np.linalg.norm(gaps, axis=2).max() <= fit.deviation[1] <= tolerance
        assert poles(fit) <= bar


@pytest.mark.parametrize("degree", range(3, 26))
def test_every_degree_keeps_its_tolerance(degree):
    curve = pieces.curves()["D5s"]
    fit = fit_curve(curve, tolerance=1e-5, degree=degree)
    assert fit.spline.degree == degree
    assert truth(curve, fit.spline) <= fit.deviation[1] <= 1e-5


@pytest.mark.parametrize("continuity", [0, 1, 2, 4])
def test_continuity_is_that_of_the_interior_knots(continuity):
    curve = pieces.curves()["E8p"]
    fit = fit_curve(curve, tolerance=1e-5, degree=5, continuity=continuity)
    assert set(fit.spline.multiplicities[1:-1]) == {5 - continuity}
    assert truth(curve, fit.spline) <= fit.deviation[1] <= 1e-5


@pytest.mark.parametrize("adapt", [False, True], ids=["cached", "adapted"])
@pytest.mark.parametrize("end_order", [*range(4), *product(range(4), range(4))], ids=str)
def test_end_derivatives_are_exact(end_order, adapt):
    curve = pieces.curves()["C3s"]
    spline = fit_curve(curve, tolerance=1e-4, end_order=end_order, adapt=adapt).spline
    assert np.array_equal(spline.control_points[[0, -1]], curve.control_points[[0, -1]])
    for t, highest in zip((0.0, 1.0), end_order if isinstance(end_order, tuple) else (end_order,) * 2, strict=True):
        for order in range(highest + 1):
            wanted = curve.derivative(t, order)
            assert np.abs(spline.derivative(t, order) - wanted).max() <= 1e-10 * np.abs(wanted).max()


@pytest.mark.parametrize("degree", [3, 5, 8])
@pytest.mark.parametrize("name", ["B3p", "D5s", "E8p"])
def test_an_end_that_needs_less_never_costs_poles(name, degree):
    curve = pieces.curves()[name]
    options = {"tolerance": 1e-2 if degree == 3 else 1e-4, "degree": degree}
    for adapt in (False, True):
        both = [poles(fit_curve(curve, **options, end_order=order, adapt=adapt)) for order in range(4)]
        for pair in product(range(4), range(4)):
            fit = fit_curve(curve, **options, end_order=pair, adapt=adapt)
            assert poles(fit) <= both[max(pair)]


def test_each_boundary_of_a_surface_has_its_own_order():
    surface = pieces.surfaces()["S33"]
    spline = fit_surface(surface, tolerance=1e-5, end_order=((2, 0), (1, 3))).spline
    reference = fit_surface(surface, tolerance=1e-5, end_order=3)
    assert np.prod(spline.control_points.shape[:2]) < poles(reference)
    for u, v, orders in product((0.0, 1.0), (0.0, 1.0), product(range(4), range(4))):
        if orders[0] <= (2, 0)[int(u)] and orders[1] <= (1, 3)[int(v)]:
            along_u, along_v = _functions(spline, u, v, orders)
            found = np.einsum("i,ijd,j->d", along_u, spline.control_points, along_v)
            rounding = 1e-15 * np.abs(spline.control_points).max() * np.abs(along_u).sum() * np.abs(along_v).sum()
            wanted = surface.derivative(u, v, orders)
            assert np.abs(found - wanted).max() <= 8 * rounding + 1e-14 * np.abs(wanted).max()


def _functions(spline, u, v, orders):
    """Derivatives of the basis functions of both directions, by scipy alone."""
    flat_u = np.repeat(spline.knots_u, spline.multiplicities_u)
    flat_v = np.repeat(spline.knots_v, spline.multiplicities_v)
    rows, columns = np.eye(len(spline.control_points)), np.eye(spline.control_points.shape[1])
    return BSpline(flat_u, rows, spline.degree_u)(u, orders[0]), BSpline(flat_v, columns, spline.degree_v)(v, orders[1])


def test_boundary_rows_of_a_surface_and_their_cross_derivatives_are_exact():
    surface = pieces.surfaces()["S54"]
    spline = fit_surface(surface, tolerance=1e-4, end_order=1).spline
    assert np.array_equal(spline.control_points[0, 0], surface.control_points[0, 0])
    along_u, _ = spline.derivatives(0.0, np.linspace(0, 1, 20))
    wanted = surface.derivative(0.0, np.linspace(0, 1, 20), (1, 0))
    assert np.abs(along_u - wanted).max() <= 3e-3  # C_u at the boundary, itself fitted along v


def test_closed_and_collapsed_boundaries_stay_so():
    ring = Curve([[0, 0], [40, 0], [40, 40], [-30, 50], [0, 0]], (0.3, -0.2))
    spline = fit_curve(ring, tolerance=1e-4).spline
    assert np.array_equal(spline.control_points[0], spline.control_points[-1])
    points = np.random.default_rng(2).random((4, 5, 3)) * 50
    points[0] = points[0, 0]
    points[:, -1] = points[:, 0]
    held = fit_surface(Surface(points, (0.4, 0.1), (0.2, -0.6)), tolerance=1e-4).spline.control_points
    assert (held[0] == held[0, 0]).all()
    assert np.array_equal(held[:, 0], held[:, -1])


def test_too_few_spans_are_told_with_figures():
    with pytest.raises(ToleranceNotMet) as caught:
        fit_curve(pieces.curves()["D5s"], tolerance=1e-6, max_spans=3)
    assert caught.value.requested == 1e-6
    assert 1e-6 < caught.value.achieved < 10
    assert caught.value.spans <= 3
    with pytest.raises(ToleranceNotMet):
        fit_surface(pieces.surfaces()["S54"], tolerance=1e-6, max_spans=3)


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e5])
def test_a_tolerance_below_precision_names_its_floor(size):
    curve = pieces.random_curve(np.random.default_rng(4), 5, size)
    with pytest.raises(ToleranceBelowPrecision) as caught:
        fit_curve(curve, tolerance=1e-15 * size)
    floor = caught.value.floor
    assert 1e-14 * size < floor < 1e-11 * size
    assert fit_curve(curve, tolerance=20 * floor, degree=11).deviation[1] <= 20 * floor


def test_cached_operators_serve_the_next_piece_of_a_kind():
    rng = np.random.default_rng(6)
    first = Curve(rng.random((6, 3)) * 100, (0.123, 0.456))
    fit_curve(first, tolerance=1e-4, adapt=False)
    before = _of_kind.cache_info()
    fit_curve(Curve(first.control_points * 1.01, first.gamma), tolerance=1e-4, adapt=False)
    after = _of_kind.cache_info()
    assert after.hits > before.hits
    assert after.misses == before.misses


def test_adapted_knots_never_need_more_poles():
    for curve in pieces.curves().values():
        cached, own = (fit_curve(curve, tolerance=1e-5, exact=False, adapt=adapt) for adapt in (False, True))
        assert poles(own) <= poles(cached)


def test_exact_forms_are_used_only_where_they_may():
    arc = Curve([[10, 0], [10, 10], [0, 10]])
    assert fit_curve(arc, tolerance=1e-4).exact
    assert fit_curve(arc, tolerance=1e-4).parameter_map.kind == "tangent"
    assert not fit_curve(arc, tolerance=1e-4, exact=False).exact
    assert fit_curve(arc, tolerance=1e-4, end_order=(0, 0)).exact
    assert not fit_curve(arc, tolerance=1e-4, end_order=(0, 1)).exact
    joined = fit_curve(arc, tolerance=1e-4, end_order=2)
    assert not joined.exact
    assert joined.parameter_map.kind == "identity"
    with pytest.raises(InputError, match="exact=True"):
        fit_curve(pieces.curves()["D5s"], tolerance=1e-4, exact=True)
    straight = Surface(np.random.default_rng(1).random((4, 2, 3)), (0.1, 0.2), family_v=BERNSTEIN)
    ruled = fit_surface(straight, tolerance=1e-5)
    assert (ruled.spline.degree_v, ruled.spline.control_points.shape[1]) == (1, 2)
    assert not ruled.exact


@pytest.mark.parametrize(
    "curve",
    [
        Curve(np.zeros((4, 3)), (0.2, 0.3)),
        Curve(np.linspace(0, 1, 4)[:, None] * [30, 20, 10], (0.2, 0.3)),
        Curve(np.random.default_rng(3).random((61, 2)) * 100, (0.5, -0.5)),
        Restricted(pieces.random_curve(np.random.default_rng(5), 7, 100.0), (0.8, 0.1)),
    ],
    ids=["a point", "a line", "degree 60", "part, backwards"],
)
def test_unusual_curves(curve):
    fit = fit_curve(curve, tolerance=1e-5)
    assert truth(curve, fit.spline) <= fit.deviation[1] <= 1e-5


def test_auto_needs_no_more_poles_than_any_degree():
    for curve in pieces.curves().values():
        best = poles(fit_curve(curve, tolerance=1e-4, degree="auto", exact=False))
        assert best <= min(poles(fit_curve(curve, tolerance=1e-4, degree=p, exact=False)) for p in range(3, 12))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"tolerance": 0}, "tolerance must be"),
        ({"tolerance": float("nan")}, "tolerance must be"),
        ({"degree": 2}, r"degree must be a whole number in \[3, 25\]"),
        ({"degree": 26}, "got 26"),
        ({"degree": True}, "got True"),
        ({"degree": "Auto"}, 'or "auto"'),
        ({"continuity": 5}, r"continuity must be a whole number in \[0, 4\]"),
        ({"end_order": 4}, r"end_order must be a whole number in \[0, 3\] or a pair of such, got 4"),
        ({"end_order": (1, 2, 3)}, r"or a pair of such, got \(1, 2, 3\)"),
        ({"end_order": (1, 4)}, r"end_order\[1\] must be a whole number in \[0, 3\], got 4"),
        ({"end_order": (-1, 0)}, r"end_order\[0\] must be .*, got -1"),
        ({"end_order": (True, 0)}, r"end_order\[0\] must be .*, got True"),
        ({"end_order": "21"}, "or a pair of such, got '21'"),
        ({"max_spans": 0}, "max_spans"),
        ({"degree": "auto", "max_degree": 30}, "max_degree"),
        ({"exact": "never"}, "exact must be"),
        ({"degree": 3, "max_spans": 1, "end_order": 3}, "end_order 3 takes 8"),
        ({"degree": 3, "max_spans": 1, "end_order": (3, 1)}, r"end_order \(3, 1\) takes 6"),
    ],
)
def test_bad_arguments(options, message):
    with pytest.raises(InputError, match=message):
        fit_curve(pieces.curves()["D5s"], **{"tolerance": 1e-4, **options})


@pytest.mark.parametrize(
    ("end_order", "message"),
    [
        (4, r"end_order must be a whole number in \[0, 3\] or \(\(u0, u1\), \(v0, v1\)\) of such, got 4"),
        ((1, 2), r"got \(1, 2\)"),
        (((1, 2), 3), r"got \(\(1, 2\), 3\)"),
        (((1, 2), (0, 4)), r"end_order\[1\]\[1\] must be a whole number in \[0, 3\], got 4"),
    ],
)
def test_bad_end_orders_of_surfaces(end_order, message):
    with pytest.raises(InputError, match=message):
        fit_surface(pieces.surfaces()["S33"], tolerance=1e-4, end_order=end_order)
