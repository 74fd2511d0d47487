from __future__ import annotations

import math

import mpmath as mp
import numpy as np
import pytest

from gtcad import Curve
from gtcad.converters import fit_curve, fit_surface
from gtcad.converters.bspline import BSplineSurface
from gtcad.converters.developable_fit import fit_developable, spline_twist_deg
from gtcad.converters.occt.pieces import is_valid
from gtcad.converters.occt.topology import make_face
from gtcad.errors import InputError, ToleranceBelowPrecision, ToleranceNotMet
from gtcad.patches import Rotation, Ruled, cone, cylinder, developability, geodesic_developable, spine_developable
from tests.patches import developables as exact
from tests.patches.developables import HIGH, LOW, distances, random_family, regular_patches
from tests.patches.kinds import OTHER, QUARTER, WAVE, line

PATCHES = regular_patches(4)
SPINE = Curve([[0, 0, 0], [10, 20, 5], [20, 25, 20], [30, 10, 25], [40, 0, 10]], (0.2, -0.3))
T = np.linspace(0, 1, 801)


def sampled_deviation(spline, patch):
    """From the exact patch, by its definition."""
    a, b = patch.exact_boundaries(T)
    gaps = [np.linalg.norm(spline.evaluate(T, v) - one, axis=-1).max() for v, one in ((0.0, a), (1.0, b))]
    return max(gaps)


def sliding_deviation(spline, patch, t=T[::8]):
    """The largest distance of points of either surface from the other one, and how far they slide on the boundaries."""

    def of_spline(u, order):
        return [spline.derivative(u, v, (order, 0)) for v in (0.0, 1.0)]

    gaps, slides = [], []
    for one, other in ((of_spline, patch.exact_boundaries), (patch.exact_boundaries, of_spline)):
        a, b = one(t, 0)
        for v in (0, 0.1, 0.3, 0.5, 0.7, 0.9, 1):
            gap, u = distances(a + v * (b - a), t, v, other)
            gaps.append(gap.max())
            slides.append(abs(u - t).max() if v in (0, 1) else 0)
    return max(gaps), max(slides)


def sampled_twist(spline):
    normals = []
    for v in (0.0, 1.0):
        normal = np.cross(spline.derivative(T, v, (1, 0)), spline.derivative(T, v, (0, 1)))
        normals.append(normal / np.linalg.norm(normal, axis=-1, keepdims=True))
    sine = np.linalg.norm(np.cross(*normals), axis=-1)
    return math.degrees(np.arctan2(sine, np.einsum("td,td->t", *normals)).max())


@pytest.mark.parametrize("tolerance", [1e-2, 1e-4, 1e-6])
@pytest.mark.parametrize(
    "patch", [*PATCHES[:3], spine_developable(SPINE, (5, 30)), geodesic_developable(SPINE, (-1, 2))]
)
def test_the_tolerance_is_kept_and_the_twist_bounded(patch, tolerance):
    fit = fit_developable(patch, tolerance=tolerance, sliding=False)
    spline, (lower, upper) = fit.spline, fit.deviation
    assert (spline.degree_u, spline.degree_v, spline.control_points.shape[1]) == (5, 1, 2)
    found = sampled_deviation(spline, patch)
    assert lower * 0.999 <= found * 1.01 + patch.definition_error
    assert found <= upper <= tolerance
    assert upper <= 1.2 * found + 2 * patch.definition_error
    twist = sampled_twist(spline)
    assert twist <= fit.twist_deg[1] + 1e-9
    assert fit.twist_deg[0] <= fit.twist_deg[1] <= 1.5 * twist + 1e-9
    assert fit.tolerance == tolerance
    assert fit.slide == 0
    assert not fit.exact


def test_parameters_that_slide_save_poles():
    fewer, tolerance = 0, 1e-4
    for patch in PATCHES:
        fit, equal = (fit_developable(patch, tolerance=tolerance, sliding=sliding) for sliding in (True, False))
        found, slide = sliding_deviation(fit.spline, patch)
        assert found <= fit.deviation[1] <= tolerance
        assert fit.deviation[0] <= fit.deviation[1] <= 1.6 * found + patch.definition_error
        assert slide <= fit.slide * 1.01 + 1e-9 or fit.slide == 0
        saved = len(equal.spline.control_points) - len(fit.spline.control_points)
        assert (saved > 0) == (fit.slide > 0)
        assert saved >= 0
        fewer += saved
        twist = sampled_twist(fit.spline)
        assert twist - 1e-9 <= fit.twist_deg[1] <= 1.5 * twist + 1e-9
    assert fewer


def test_a_cone_with_its_apex():
    patch = cone(QUARTER, [0, 0, 50])
    fit, equal = (fit_developable(patch, tolerance=1e-5, sliding=sliding) for sliding in (True, False))
    assert np.unique(fit.spline.control_points[:, 1], axis=0).tolist() == [[0, 0, 50]]
    assert fit.twist_deg == equal.twist_deg == (0, 0)
    assert len(fit.spline.control_points) < len(equal.spline.control_points)
    points = fit.spline.evaluate(T[:, None], T[::40])
    directrix = patch.evaluate(T, 0.0)
    tangents = patch.derivative(T, 0.0, (1, 0))
    normals = np.cross(tangents, [0, 0, 50] - directrix)
    inside = np.einsum("td,tvd->tv", normals / np.linalg.norm(normals, axis=-1, keepdims=True), points - [0, 0, 50])
    assert (
        abs(inside).max() <= fit.deviation[1] + fit.slide**2 * 1e3
    )  # tangent planes at the same u, not at the nearest


def test_the_corners_are_those_of_the_exact_patch():
    fit, patch = fit_developable(PATCHES[0], tolerance=1e-2), PATCHES[0]
    for u in (0, 1):
        with mp.workdps(30):
            planes = exact.derivatives(patch.family, mp.mpf(u), 1)
            for v, bound in ((0, patch.bound_a), (1, patch.bound_b)):
                corner = fit.spline.control_points[-u, v]
                assert exact.distance(corner, exact.cut(planes, bound)) <= 2 * patch.definition_error


@pytest.mark.parametrize("limit", [0.1, 1e-3, 1e-5])
def test_a_limit_of_the_twist_is_kept(limit):
    for patch in PATCHES[1:2]:
        fit = fit_developable(patch, tolerance=1e-2, max_twist_deg=limit)
        assert fit.twist_deg[1] <= limit
        assert sampled_twist(fit.spline) <= limit
        assert fit.deviation[1] <= fit.tolerance <= 1e-2
        plain = fit_developable(patch, tolerance=fit.tolerance, sliding=False)
        assert plain.spline.control_points.shape == fit.spline.control_points.shape


def test_a_limit_of_the_twist_out_of_reach_is_refused():
    with pytest.raises(ToleranceNotMet, match="degrees between normals along a ruling") as caught:
        fit_developable(PATCHES[0], tolerance=1e-2, max_twist_deg=1e-13)
    assert caught.value.requested == 1e-13
    assert 1e-13 < caught.value.achieved < 1e-4
    with pytest.raises(ToleranceNotMet, match="degrees between normals"):
        fit_developable(Ruled(WAVE, OTHER), tolerance=1e-2, max_twist_deg=10)  # it twists by 60


def test_any_ruled_patch_has_a_ruled_face():
    for patch in (Ruled(WAVE, OTHER), cylinder(QUARTER, [10, 5, 50])):
        fit = fit_developable(patch, tolerance=1e-4, sliding=False)
        gap = np.linalg.norm(fit.spline.evaluate(T[:, None], T[::80]) - patch.evaluate(T[:, None], T[::80]), axis=-1)
        assert gap.max() <= fit.deviation[1] <= 1e-4
        report = developability(patch)
        assert fit.twist_deg[1] == pytest.approx(report.twist_deg, rel=0.3, abs=1e-6)


def test_a_spline_that_twists_by_45_degrees():
    # z = x y, with the degree in x raised to 3: the tangent plane turns from (0, 0, 1) to (-1, 0, 1) at x = 0
    x = np.linspace(0, 1, 4)
    poles = np.stack([np.column_stack([x, 0 * x, 0 * x]), np.column_stack([x, 0 * x + 1, x])], axis=1)
    saddle = BSplineSurface(poles, (0, 1), (4, 4), 3, (0, 1), (2, 2), 1)
    lower, upper = spline_twist_deg(saddle)
    assert lower <= 45 <= upper
    assert (lower, upper) == pytest.approx((45, 45), rel=0.1)


def test_splines_without_a_bound():
    flat = np.stack([np.outer(np.arange(4.0), [1, 0, 0]), np.outer(np.arange(4.0), [1, 0, 0]) + [0, 1, 0]], axis=1)
    plane = BSplineSurface(flat, (0, 1), (4, 4), 3, (0, 1), (2, 2), 1)
    assert spline_twist_deg(plane)[1] <= 1e-9
    crossed = flat.copy()
    crossed[:, 1] = flat[::-1, 1]  # all rulings run through one point
    assert spline_twist_deg(BSplineSurface(crossed, (0, 1), (4, 4), 3, (0, 1), (2, 2), 1))[1] == math.inf
    cone = flat.copy()
    cone[:, 1] = [1.5, 4, 0]
    assert spline_twist_deg(BSplineSurface(cone, (0, 1), (4, 4), 3, (0, 1), (2, 2), 1)) == (0, 0)
    with pytest.raises(InputError, match="of degree 1 with two rows"):
        spline_twist_deg(plane.transposed())


@pytest.mark.parametrize("patch", PATCHES[:4], ids=range(4))
def test_the_general_fit_takes_developables_as_well(patch):
    general, own = fit_surface(patch, tolerance=1e-4), fit_developable(patch, tolerance=1e-4, sliding=False)
    assert general.spline.degree_v == 1
    assert general.deviation[1] <= 1e-4
    assert sampled_deviation(general.spline, patch) <= general.deviation[1]
    assert len(general.spline.control_points) <= len(own.spline.control_points)  # v takes nothing of the tolerance


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"tolerance": 0}, InputError, "tolerance must be a finite number above 0"),
        ({"tolerance": math.nan}, InputError, "tolerance must be a finite number above 0"),
        ({"tolerance": 1e-4, "max_twist_deg": 0}, InputError, "max_twist_deg must be a finite number above 0"),
        ({"tolerance": 1e-4, "degree": 2}, InputError, r"degree must be a whole number in \[3, 25\]"),
        ({"tolerance": 1e-4, "degree": True}, InputError, r"degree must be a whole number in \[3, 25\]"),
        ({"tolerance": None}, InputError, "tolerance must be a finite number above 0, got None"),
        ({"tolerance": 1e-4, "max_twist_deg": "a"}, InputError, "max_twist_deg must be a finite .*, got 'a'"),
        ({"tolerance": 1e-4, "continuity": 9}, InputError, r"continuity must be a whole number in \[0, 4\], got 9"),
        ({"tolerance": 1e-4, "max_spans": 0}, InputError, "max_spans must be a whole number"),
        ({"tolerance": 1e-13}, ToleranceBelowPrecision, "below"),
        ({"tolerance": 1e-6, "max_spans": 3}, ToleranceNotMet, "max_spans = 3"),
    ],
)
def test_wrong_arguments(options, error, message):
    with pytest.raises(error, match=message):
        fit_developable(PATCHES[0], **options)


def test_other_patches_are_refused():
    with pytest.raises(InputError, match="patch must be a patch that is linear in v, got Curve"):
        fit_developable(SPINE, tolerance=1e-3)
    with pytest.raises(InputError, match="must be linear in v, in space, got Rotation"):
        fit_developable(Rotation(WAVE, [0, 0, 0], [0, 0, 1]), tolerance=1e-3)
    with pytest.raises(InputError, match="in space"):
        fit_developable(Ruled(line([0, 0], [1, 0]), line([0, 1], [1, 1])), tolerance=1e-3)


# The bars


def poles_too_many(patch):
    """The bars of twist, fit and face; and how many poles a row has above the costlier boundary fitted alone."""
    fit = fit_developable(patch, tolerance=1e-4)
    found = sliding_deviation(fit.spline, patch)[0] if fit.slide else sampled_deviation(fit.spline, patch)
    assert found <= fit.deviation[1] <= 1e-4
    assert math.radians(developability(patch).twist_deg) <= 1e-12
    assert is_valid(make_face(fit.spline))
    alone = [len(fit_curve(curve, tolerance=1e-4).spline.control_points) for curve in (patch.a, patch.b)]
    return len(fit.spline.control_points) - max(alone)


def test_random_regular_families():
    near_its_edge_of_regression = random_family(22_023).enveloping(LOW, HIGH)
    excess = [poles_too_many(patch) for patch in (near_its_edge_of_regression, *regular_patches(5, 10_000))]
    assert max(excess) <= 0
    assert np.mean(excess) < -1


@pytest.mark.stress
@pytest.mark.parametrize("start", range(20_000, 30_000, 1000))
def test_random_regular_families_stress(start):
    excess = [poles_too_many(patch) for patch in regular_patches(50, start)]
    assert max(excess) <= 0
    assert np.mean(excess) < -0.9


def test_the_random_families_differ():
    families = [random_family(seed) for seed in range(60)]
    assert len({family.degree for family in families}) == 5
    assert len({family.family.name for family in families}) == 2
