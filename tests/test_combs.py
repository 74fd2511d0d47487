from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gtcad import BERNSTEIN, Basis, Composite, Curve
from gtcad.combs import comb, gamma_study, spans
from gtcad.continuity import check_join, join_curve
from gtcad.converters.bspline import BSplineCurve
from gtcad.converters.fit import fit_curve
from gtcad.errors import InputError
from gtcad.factors import CurveOfTerms, Stacked, Waves
from gtcad.measure import length
from gtcad.restricted import Restricted
from tests import pieces

WAVY = Curve([[0, 0], [20, 80], [80, -60], [100, 20]], (0.8, -0.7))


def ellipse(a: float, b: float, sweep: float = 2 * math.pi) -> CurveOfTerms:
    return CurveOfTerms(Waves(0.0, sweep), [[0, 0], [a, 0], [0, b]])


def helix(radius: float, rise: float, sweep: float) -> CurveOfTerms:
    """Rising by ``rise`` over the whole sweep."""
    line = Basis(1, (0.0, 0.0), BERNSTEIN)
    coefficients = [[0, 0, 0], [radius, 0, 0], [0, radius, 0], [0, 0, 0], [0, 0, rise]]
    return CurveOfTerms(Stacked((Waves(0.0, sweep), line)), coefficients)


def kinked() -> Composite:
    """Two curves with one tangent and different curvatures."""
    rest = [[130, 30], [150, 0], [160, 10]]
    return Composite((WAVY, join_curve(WAVY, 4, order="G1", scale=(1.3, 0.0, 0.0), rest=rest)), ("G1",))


# Known shapes


@given(st.floats(1e-3, 1e3), st.floats(0.1, 10.0), st.sampled_from([1.0, -1.0]))
def test_the_comb_of_a_circle_is_a_concentric_circle(radius: float, times: float, direction: float) -> None:
    scale = times * radius**2
    found = comb(ellipse(radius, radius, direction * 2 * math.pi), teeth=40, scale=scale)
    assert np.hypot(*found.tips.T) == pytest.approx(np.full(40, radius + scale / radius), rel=1e-11)
    assert found.curvature == pytest.approx(np.full(40, direction / radius), rel=1e-11)
    assert found.tips / np.hypot(*found.tips.T)[:, None] == pytest.approx(found.points / radius, abs=1e-11)


def test_the_comb_of_an_ellipse() -> None:
    a, b, scale = 3.0, 2.0, 0.7
    found = comb(ellipse(a, b), teeth=77, scale=scale)
    angle = 2 * math.pi * found.parameters
    outward = np.stack([b * np.cos(angle), a * np.sin(angle)], axis=1)
    outward /= np.hypot(*outward.T)[:, None]
    curvature = a * b / (a**2 * np.sin(angle) ** 2 + b**2 * np.cos(angle) ** 2) ** 1.5
    assert found.tips == pytest.approx(found.points + scale * curvature[:, None] * outward, abs=1e-13)


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_straight_line_has_no_teeth(dimension: int) -> None:
    along = np.array([0.0, 0.1, 0.8, 0.7, 1.0])[:, None] * [70.0, 30.0, 11.0][:dimension] + 5.0
    found = comb(Curve(along, (0.4, -0.9)))
    assert (found.tips == found.points).all()
    assert (found.curvature == 0).all()
    assert math.isfinite(found.scale)


def test_the_comb_changes_side_at_an_inflection() -> None:
    cubic = Curve([[-1, -1], [-1 / 3, 1], [1 / 3, -1], [1, 1]], family=BERNSTEIN)  # y = x^3
    found = comb(cubic, teeth=101, scale=0.1)
    x = found.points[:, 0]
    curvature = 6 * x / (1 + 9 * x**4) ** 1.5
    assert found.curvature == pytest.approx(curvature, abs=1e-12)
    above = found.tips[:, 1] - found.points[:, 1]
    assert (above[x > 0.01] < 0).all()
    assert (above[x < -0.01] > 0).all()


def test_the_comb_of_a_helix_is_a_helix_around_the_same_axis() -> None:
    radius, rise, sweep, scale = 20.0, 40.0, 4 * math.pi, 150.0
    found = comb(helix(radius, rise, sweep), teeth=200, scale=scale)
    curvature = radius / (radius**2 + (rise / sweep) ** 2)
    assert found.curvature == pytest.approx(np.full(200, curvature), rel=1e-12)
    assert np.hypot(*found.tips[:, :2].T) == pytest.approx(np.full(200, radius + scale * curvature), rel=1e-12)
    assert found.tips[:, 2] == pytest.approx(found.points[:, 2], abs=1e-12)


def test_an_inflection_of_a_plane_curve_in_space() -> None:
    turn, _ = np.linalg.qr(np.random.default_rng(4).normal(size=(3, 3)))
    flat, lifted = comb(WAVY, scale=90.0), comb(WAVY.transformed(turn[:, :2], [7, 8, 9]), scale=90.0)
    assert lifted.tips == pytest.approx(flat.tips @ turn[:, :2].T + [7, 8, 9], abs=1e-10)
    assert lifted.curvature == pytest.approx(np.abs(flat.curvature), abs=1e-14)


def test_a_cusp_has_no_tooth() -> None:
    cusp = Curve([[0, 0], [0, 0], [1 / 3, 0], [1, 1]], family=BERNSTEIN)  # (t^2, t^3)
    found = comb(cusp, teeth=20)
    assert np.isnan(found.tips).any(axis=1).tolist() == [True] + [False] * 19
    assert np.isnan(found.curvature[0])


# Joints


def test_the_jump_at_a_joint_is_that_of_the_check() -> None:
    chain = kinked()
    found = comb(chain, scale=30.0)
    ((before, after),) = found.joints
    assert (found.parameters[before], found.parameters[after]) == (1.0, 1.0)
    assert found.points[before] == pytest.approx(found.points[after], abs=1e-12)
    bends = (found.points - found.tips)[[before, after]] / 30.0
    jump = np.linalg.norm(bends[1] - bends[0]) / np.linalg.norm(bends, axis=1).max()
    report = check_join(*chain.pieces)
    assert report.order == "G1"
    assert report.curvature_jump > 0.1
    assert jump == pytest.approx(report.curvature_jump, rel=1e-9)


def test_a_closed_chain_has_a_joint_at_its_start_and_a_closed_envelope() -> None:
    corners = np.array([[10.0, 0], [0, 10], [-15, 0], [0, -6], [10, 0]])
    quarters = [Curve([a, [a[0] + b[0], a[1] + b[1]], b]) for a, b in pairwise(corners)]
    found = comb(Composite(tuple(quarters), ("G1",) * 4, closed=True), teeth=80)
    assert len(found.joints) == 4
    last, first = found.joints[-1]
    assert (last, first) == (len(found.points) - 1, 0)
    assert found.points[last] == pytest.approx(found.points[first], abs=1e-12)
    assert (found.envelope[-1] == found.tips[0]).all()
    semi_axes = [(10, 10), (15, 10), (15, 6), (10, 6)]
    ends = [found.curvature[[before, after]] for before, after in found.joints]
    for k, (value_before, value_after) in enumerate(ends):
        for value, (a, b) in ((value_before, semi_axes[k]), (value_after, semi_axes[(k + 1) % 4])):
            across, along = (b, a) if k % 2 == 0 else (a, b)  # the joint lies on the axis `across`
            assert value == pytest.approx(across / along**2, rel=1e-10)


# Splines


def test_the_comb_of_a_fitted_spline_is_that_of_the_curve() -> None:
    spline = fit_curve(WAVY, tolerance=1e-7).spline
    assert comb(spline, scale=90.0).tips == pytest.approx(comb(WAVY, scale=90.0).tips, abs=1e-2)


def test_a_spline_shows_both_curvatures_at_a_rough_knot() -> None:
    spline = BSplineCurve([[0, 0], [1, 2], [3, 2], [4, -1]], [2, 3, 5], [3, 1, 3], 2)
    ((before, after),) = (found := comb(spline, teeth=30)).joints
    knot = np.array([1, 2]) * 2 / 3 + np.array([3, 2]) / 3  # at a knot ratio of 1 : 2
    assert (found.parameters[before], found.parameters[after]) == (3.0, 3.0)
    assert found.points[before] == pytest.approx(knot)
    first, second = np.array([[0, 0], [1, 2], knot]), np.array([knot, [3, 2], [4, -1]])
    for tooth, (p, q, r), corner in ((before, first, 2), (after, second, 0)):
        # at the end of a parabola: half the area of the polygon's parallelogram over the cube of the leg at that end
        area = (q - p)[0] * (r - q)[1] - (q - p)[1] * (r - q)[0]
        leg = np.linalg.norm((r - q) if corner == 2 else (q - p))
        assert found.curvature[tooth] == pytest.approx(area / 2 / leg**3, rel=1e-9)


def test_only_rough_knots_separate_spans() -> None:
    points = np.random.default_rng(1).normal(size=(7, 3))
    spline = BSplineCurve(points, [0, 1, 2, 3], [4, 1, 2, 4], 3)
    assert [(span.start, span.end) for span in spans(spline)] == [(0.0, 2.0), (2.0, 3.0)]


# Teeth and scale


@pytest.mark.parametrize("name", pieces.curves())
def test_teeth_stand_at_equal_distances(name: str) -> None:
    curve = pieces.curves()[name]
    found = comb(curve, teeth=11)
    gaps = [float(length(Restricted(curve, part), rtol=1e-9)) for part in pairwise(found.parameters.tolist())]
    whole = float(length(curve))
    assert gaps == pytest.approx([whole / 10] * 10, rel=1e-3)
    assert found.arc_lengths == pytest.approx(np.linspace(0, whole, 11), rel=1e-6)
    assert (found.parameters[0], found.parameters[-1]) == (0.0, 1.0)


@given(st.integers(0, 10_000))
def test_the_longest_tooth_is_a_third_of_the_diagonal(seed: int) -> None:
    rng = np.random.default_rng(seed)
    curve = pieces.random_curve(rng, int(rng.integers(2, 7)), 10.0 ** rng.uniform(-2, 3))
    found = comb(curve, teeth=50)
    diagonal = np.linalg.norm(np.ptp(found.points, axis=0))
    assert np.nanmax(np.linalg.norm(found.tips - found.points, axis=1)) == pytest.approx(diagonal / 3, rel=1e-9)


def test_combs_cannot_be_changed() -> None:
    found = comb(WAVY)
    with pytest.raises(ValueError, match="read-only"):
        found.tips[0] = 0.0


@pytest.mark.parametrize("teeth", [1, 0, -3, 2.5, True, 10**6, "10"])
def test_wrong_numbers_of_teeth_are_refused(teeth: object) -> None:
    with pytest.raises(InputError, match=r"teeth must be a whole number in \[2, 100000\]"):
        comb(WAVY, teeth=teeth)  # type: ignore[arg-type]


def test_a_curve_of_no_length_is_refused_wherever_it_is() -> None:
    for place in (0.0, 1.0, 1e9):
        with pytest.raises(InputError, match="the curve is a point"):
            comb(Curve([[place, 2 * place]] * 3))


@pytest.mark.parametrize("scale", [0.0, -1.0, math.nan, math.inf])
def test_wrong_scales_are_refused(scale: float) -> None:
    with pytest.raises(InputError, match="scale must be positive and finite"):
        comb(WAVY, scale=scale)


# Studies


def test_a_study_has_every_pair_and_its_figures() -> None:
    from scipy.integrate import quad

    study = gamma_study(WAVY, gamma_1=[-0.5, 0.5], gamma_2=[0, 0.9])
    assert [curve.gamma for curve in study.curves] == [(a, b) for a in (-0.5, 0.5) for b in (0.0, 0.9)]
    assert all((curve.control_points == WAVY.control_points).all() for curve in study.curves)
    assert all(len(row) == len(study.columns) for row in study.rows())
    for curve, row in zip(study.curves, study.rows(), strict=True):

        def speed(t: float, curve: Curve = curve) -> float:
            return float(np.hypot(*curve.derivative(t)))

        def bend(t: float, curve: Curve = curve) -> float:
            (x, y), (xx, yy) = curve.derivative(t), curve.derivative(t, 2)
            return float((x * yy - y * xx) / np.hypot(x, y) ** 3)

        assert row[:2] == curve.gamma
        assert row[2] == pytest.approx(quad(speed, 0, 1, epsabs=0, epsrel=1e-10)[0], rel=1e-8)
        energy = quad(lambda t, k=bend, v=speed: k(t) ** 2 * v(t), 0, 1, epsabs=0, epsrel=1e-10, limit=200)[0]
        assert row[3] == pytest.approx(energy, rel=1e-8)
        dense = [bend(t) for t in np.linspace(0, 1, 501).tolist()]
        assert row[4] <= min(dense) + 1e-12
        assert row[5] >= max(dense) - 1e-12
        assert row[4:] == pytest.approx((min(dense), max(dense)), rel=1e-3)


@pytest.mark.parametrize(
    ("curve", "values", "message"),
    [
        (Curve([[0, 0], [1, 1]], family=BERNSTEIN), [0], "takes no design variables"),
        (WAVY, [], "one value or more"),
        (WAVY, [0, 1.5], r"must lie in \[-1, 1\], got 1.5"),
        (WAVY, ["x"], "gamma"),
    ],
)
def test_wrong_studies_are_refused(curve: Curve, values: list[float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        gamma_study(curve, gamma_1=values)
