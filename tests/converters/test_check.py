from __future__ import annotations

import numpy as np
import pytest

from gtcad import Curve, Surface
from gtcad.converters import BSplineCurve, fit_curve, fit_surface
from gtcad.converters.check import check_parts
from gtcad.converters.nearest import PointSet, distances, is_farther
from gtcad.converters.part import EllipseArc, Part, TrimmedFace
from gtcad.errors import InputError
from tests import pieces

T = 1e-4


def verdict(part, shape, tolerance=T):
    (row,) = check_parts([part], {"x": shape}, tolerance).rows
    return row


@pytest.fixture(scope="module")
def curve():
    return pieces.curves()["D5s"]


@pytest.fixture(scope="module")
def surface():
    return pieces.surfaces()["S54"]


@pytest.fixture(scope="module")
def spline(surface):
    return fit_surface(surface, tolerance=T).spline


def test_fitted_shapes_are_proved_whatever_way_they_run(curve, surface, spline):
    held = fit_curve(curve, tolerance=T).spline
    for shape in (curve, curve.reversed()):
        row = verdict(Part("x", held), shape)
        assert row.verdict == "proved"
        assert row.deviation[1] <= T
    for shape in (surface, surface.reversed("u"), surface.reversed("v"), surface.transposed()):
        assert verdict(Part("x", spline), shape).verdict == "proved"


def test_stretched_knots_and_exact_forms_are_proved(curve):
    held = fit_curve(curve, tolerance=T).spline
    stretched = BSplineCurve(held.control_points, 5 + 3 * held.knots, held.multiplicities, held.degree)
    assert verdict(Part("x", stretched), curve).verdict == "proved"
    parabola = Curve([[0, 0, 0], [5, 9, 0], [10, 0, 3]], (-1, 0.5))
    row = verdict(Part("x", fit_curve(parabola, tolerance=T).spline), parabola)
    assert (row.verdict, row.method) == ("proved", "exact form (versine)")


def test_circles_are_proved_and_wrong_ones_fail():
    quarter = Curve([[10, 0], [10, 10], [0, 10]])
    arc = EllipseArc([0, 0, 0], [10, 0, 0], [0, 10, 0], 0.0, np.pi / 2)
    assert verdict(Part("x", arc), quarter).verdict == "proved"
    assert verdict(Part("x", arc), quarter.reversed()).verdict == "proved"
    wide = EllipseArc([0, 0, 0], [10 + 3 * T, 0, 0], [0, 10 + 3 * T, 0], 0.0, np.pi / 2)
    assert verdict(Part("x", wide), quarter).verdict == "failed"


def test_a_moved_shape_fails(surface, spline):
    shifted = spline.with_control_points(spline.control_points + [0, 0, 6 * T])
    assert verdict(Part("x", shifted), surface).verdict == "failed"


def test_one_moved_pole_fails(surface, spline):
    points = np.array(spline.control_points)
    points[6, 4] += [0, 0, 12 * T]
    assert verdict(Part("x", spline.with_control_points(points)), surface).verdict == "failed"


def test_another_parametrisation_is_estimated_not_accused(curve):
    """The same points at another speed: the fit of samples taken at warped parameters."""
    from scipy.interpolate import make_interp_spline

    x = np.linspace(0, 1, 241)
    warped = make_interp_spline(x, curve.evaluate(x + 0.02 * np.sin(np.pi * x) ** 2), 5)
    inner = warped.t[6:-6]
    held = BSplineCurve(warped.c, np.r_[0, inner, 1], [6, *[1] * len(inner), 6], 5)
    row = verdict(Part("x", held), curve)
    assert row.verdict == "estimated"
    assert row.deviation[1] < T


def test_trimmed_faces(surface, spline):
    def face(distance, area):
        return Part("x", spline, trimmed=True, face=TrimmedFace(lambda p: np.full(len(p), distance), area))

    from gtcad import measure

    whole = float(measure.area(surface))
    assert verdict(face(T / 2, whole), surface).verdict == "estimated"
    assert verdict(face(2 * T, whole), surface).verdict == "failed"
    assert verdict(face(T / 2, 0.9 * whole), surface).verdict == "undecided"
    assert verdict(Part("x", spline, trimmed=True), surface).verdict == "undecided"


def test_matching_by_name_by_position_and_what_is_left(curve, surface, spline):
    held = fit_curve(curve, tolerance=T).spline
    parts = [Part("", held), Part("roof", spline), Part("other", held), Part("x", spline, valid=False)]
    shapes = {"edge": curve, "roof": surface, "x": surface, "gone": surface}
    report = check_parts(parts, shapes, T)
    assert [row.verdict for row in report.rows] == ["proved", "proved", "invalid", "missing"]
    assert report.rows[0].remark == "matched by position"
    assert report.extra == ("other",)


def test_a_face_is_no_edge(surface, spline, curve):
    row = verdict(Part("x", spline), curve)
    assert (row.verdict, row.remark) == ("missing", "the file holds a face of this name, not an edge")


def test_tolerance_must_be_positive(curve):
    with pytest.raises(InputError, match="above 0"):
        check_parts([], {"x": curve}, 0.0)


def test_nearest_points_against_a_sphere():
    octant = Surface(
        [[[1, 0, 0], [1, 1, 0], [0, 1, 0]], [[1, 0, 1], [1, 1, 1], [0, 1, 1]], [[0, 0, 1], [0, 0, 1], [0, 0, 1]]]
    )

    def derivatives(p):
        return np.stack([octant.derivative(p[:, 0], p[:, 1], orders) for orders in ((1, 0), (0, 1))], axis=1)

    target = PointSet.measured(2, lambda p: octant.evaluate(p[:, 0], p[:, 1]), derivatives)
    directions = np.abs(np.random.default_rng(0).normal(size=(60, 3))) + 0.02
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    assert np.abs(distances(1.3 * directions, target) - 0.3).max() < 1e-9
    assert is_farther(1.3 * directions[0], 0.2999, target) is True
    assert is_farther(1.3 * directions[0], 0.3001, target) is False
