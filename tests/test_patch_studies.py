from __future__ import annotations

import itertools
import math
from dataclasses import replace

import mpmath as mp
import numpy as np
import pytest

from gtcad import BERNSTEIN, Curve, Restricted, Surface
from gtcad.design_variables import design_rate, design_variables, with_design_variables
from gtcad.differential import gaussian_curvature, mean_curvature, principal_curvatures
from gtcad.errors import InputError
from gtcad.factors import CurveOfTerms, Waves
from gtcad.measure import area, volume
from gtcad.patch_studies import curvature_range, patch_study, sensitivities
from gtcad.patches import Coons, Lofted, Rotation, Ruled, Swept, Swung, cone
from gtcad.patches.sweep import Sweep
from gtcad.restricted import RestrictedCurve
from tests.patches.kinds import (
    FRAME,
    HALF,
    OTHER,
    PART,
    PROFILE,
    RAIL,
    RING,
    SECTIONS,
    TRAJECTORY,
    UNEVEN,
    WAVE,
    line,
)

U, V = np.meshgrid(np.linspace(0, 1, 7), np.linspace(0, 1, 6), indexing="ij")
BOWL = Surface(
    [[[x, y, (x - 3) ** 2 / 4 + (y - 2) ** 2 / 5 + x * y / 9] for y in (0, 1, 3, 5)] for x in (0, 2, 5)],
    (0.3, -0.5),
    (-0.2, 0.6),
)
SPINE = Curve([[0, 0, 0], [20, 5, 0], [30, 25, 10], [30, 40, 30]], (0.2, -0.3))
SWEEP = Sweep(Curve([[4, 0], [3, 5], [-2, 4], [-4, 0]], (0.1, 0.5)), SPINE, scale=(1.0, 0.6), twist_deg=30)
KINDS = {
    "surface": BOWL,
    "ruled": Ruled(WAVE, OTHER),
    "swept": Swept(WAVE, RAIL),
    "swung": Swung(PROFILE, TRAJECTORY, 1.5),
    "rotation": Rotation(PART, [1.0, -2.0, 3.0], [0.3, 0.2, -1.0], -200, 77),
    "lofted": Lofted(SECTIONS, UNEVEN, (0.1, -0.9)),
    "coons": Coons(*FRAME),
    "sweep": SWEEP,
    "restricted": Restricted(Lofted(SECTIONS, UNEVEN, (0.1, -0.9)), ((0.9, 0.1), (0.2, 0.7))),
}
NOT_AFFINE = {("lofted", "gamma_v"), ("restricted", "gamma_v"), ("sweep", "spine")}
SINGLES = [(kind, name, k) for kind, patch in KINDS.items() for name in design_variables(patch) for k in (0, 1)]
SOME = [single for single in SINGLES if single[2] == len(single[1]) % 2]  # one of each pair


def at(patch, name, index, value):
    gamma = list(design_variables(patch)[name])
    gamma[index] = value
    return with_design_variables(patch, {name: gamma})


def differences(function, value, step=2e-3):
    """The first derivative to the fourth order."""
    (a, b), (c, d) = ([np.asarray(function(value + side * k * step)) for side in (1, -1)] for k in (1, 2))
    return (8 * (a - b) - (c - d)) / (12 * step)


# Which there are


def test_every_kind_has_those_of_its_curves_and_directions():
    assert {kind: design_variables(patch) for kind, patch in KINDS.items()} == {
        "surface": {"gamma_u": (0.3, -0.5), "gamma_v": (-0.2, 0.6)},
        "ruled": {"a": (0.4, -0.6), "b": (0.2, 0.7)},
        "swept": {"profile": (0.4, -0.6), "trajectory": (-0.5, 1.0)},
        "swung": {"profile": (0.3, 0.3), "trajectory": (0.5, 0.5)},
        "rotation": {"profile": (0.3, 0.3)},
        "lofted": {"sections": (0.3, -0.2), "gamma_v": (0.1, -0.9)},
        "coons": {"c0": (0.0, 0.0), "c1": (-0.3, 0.3), "d1": (0.5, 0.0)},  # d0 is a classical line
        "sweep": {"profile": (0.1, 0.5), "spine": (0.2, -0.3)},
        "restricted": {"sections": (0.3, -0.2), "gamma_v": (0.1, -0.9)},
    }


def test_what_takes_none_has_none():
    flat = Surface([[[0, 0], [0, 1]], [[1, 0], [1, 1]]], family_u=BERNSTEIN, family_v=BERNSTEIN)
    plain = Lofted([line([0, y, 0], [1, y, 1]) for y in (0, 1)], family_v=BERNSTEIN)
    for patch in (flat, plain, Rotation(HALF, [0, 0, 0], [0, 0, 1]), KINDS["ruled"].terms):
        assert design_variables(patch) == {}
        with pytest.raises(InputError, match="no design variables"):
            patch_study(patch)
        with pytest.raises(InputError, match="no design variables"):
            sensitivities(patch)


def test_coons_boundaries_that_are_parts_would_leave_the_corners():
    c0, c1, d0, d1 = FRAME
    turned = RestrictedCurve(c1.reversed(), (1.0, 0.0))
    assert design_variables(Coons(c0, turned, d0, d1)) == {"c0": (0.0, 0.0), "c1": (0.3, -0.3), "d1": (0.5, 0.0)}
    part = Restricted(c0, (0.0, 0.5))
    middle = c0.evaluate(0.5)
    patch = Coons(part, line([0, 90, 10], [50, 90, 0]), line([0, 0, 0], [0, 90, 10]), line(middle, [50, 90, 0]))
    assert design_variables(patch) == {}
    assert with_design_variables(Ruled(part, c1), {"a": (1, 1)}).a.evaluate(1.0)[2] != pytest.approx(middle[2])


def test_other_values_make_the_patch_of_the_other_curves():
    wave = Curve(WAVE.control_points, (-1, 0.25))
    assert with_design_variables(KINDS["swept"], {"profile": (-1, 0.25)}) == Swept(wave, RAIL)
    turned = Restricted(Curve(PART.shape.control_points, (0, 1)), PART.range)
    assert with_design_variables(KINDS["rotation"], {"profile": [0, 1]}) == replace(KINDS["rotation"], profile=turned)
    sections = [Curve(section.control_points, (1, 1)) for section in SECTIONS]
    expected = Lofted(sections, UNEVEN, (0.0, 0.5))
    assert with_design_variables(KINDS["lofted"], {"gamma_v": (0, 0.5), "sections": (1, 1)}) == expected
    assert with_design_variables(BOWL, {"gamma_v": (0, 1)}) == Surface(BOWL.control_points, BOWL.gamma_u, (0, 1))
    part = with_design_variables(KINDS["restricted"], {"gamma_v": (0, 0.5), "sections": (1, 1)})
    assert part == Restricted(expected, ((0.9, 0.1), (0.2, 0.7)))


@pytest.mark.parametrize("kind", KINDS)
def test_the_own_values_give_the_patch_back(kind):
    assert with_design_variables(KINDS[kind], design_variables(KINDS[kind])) == KINDS[kind]


def test_wrong_values_are_named():
    with pytest.raises(InputError, match=r"among a, b of the patch, got 'c'"):
        with_design_variables(KINDS["ruled"], {"c": (0, 0)})
    with pytest.raises(InputError, match=r"a\[1\] must lie in \[-1, 1\], got 1.25"):
        with_design_variables(KINDS["ruled"], {"a": (0, 1.25)})
    with pytest.raises(InputError, match=r"gamma_u must be two design variables, got 3"):
        with_design_variables(BOWL, {"gamma_u": (0, 0, 0)})
    with pytest.raises(InputError, match=r"one of gamma_u\[0\], gamma_u\[1\], .*, got 'gamma_u'"):
        design_rate(BOWL, "gamma_u")


# How points move


@pytest.mark.parametrize(("kind", "name", "index"), SINGLES)
def test_the_rate_of_points(kind, name, index):
    patch = KINDS[kind]
    value = design_variables(patch)[name][index]
    middle = min(max(value, -0.99), 0.99)
    moved = at(patch, name, index, middle)
    found = design_rate(moved, f"{name}[{index}]").evaluate(U, V)
    expected = differences(lambda g: at(patch, name, index, g).evaluate(U, V), middle)
    assert abs(expected).max() > 0.01
    assert abs(found - expected).max() <= 2e-8 * abs(expected).max()


@pytest.mark.parametrize(("kind", "name", "index"), [single for single in SINGLES if single[:2] not in NOT_AFFINE])
def test_points_are_affine_in_each_variable(kind, name, index):
    patch, variable = KINDS[kind], f"{name}[{index}]"
    start, rate = at(patch, name, index, -1.0), design_rate(patch, variable).evaluate(U, V)
    for value in (-0.7, 0.4, 1.0):
        line_of_points = start.evaluate(U, V) + (value + 1) * rate
        assert abs(at(patch, name, index, value).evaluate(U, V) - line_of_points).max() <= 1e-12 * 200


@pytest.mark.parametrize(("kind", "name"), sorted(NOT_AFFINE))
@pytest.mark.parametrize("end", [-1.0, 1.0])
def test_the_rate_at_the_ends_is_that_from_inside(kind, name, end):
    """Of what is not affine: by the difference of the second order from inside."""
    step = -end * 1e-4
    near = [at(KINDS[kind], name, 0, end + k * step).evaluate(U, V) for k in range(3)]
    expected = (-3 * near[0] + 4 * near[1] - near[2]) / (2 * step)
    found = design_rate(at(KINDS[kind], name, 0, end), f"{name}[0]").evaluate(U, V)
    assert abs(expected).max() > 0.01
    assert abs(found - expected).max() <= 2e-6 * abs(expected).max()


# Rates of areas and volumes


@pytest.fixture(scope="module")
def rates():
    origin = (3.0, -50.0, 7.0)
    return origin, {kind: {e.variable: e for e in sensitivities(KINDS[kind], origin=origin).entries} for kind in KINDS}


@pytest.mark.parametrize(("kind", "name", "index"), SOME)
def test_rates_of_area_and_volume_are_those_of_measured_ones(kind, name, index, rates):
    origin, found = rates
    entry = found[kind][f"{name}[{index}]"]
    assert entry.value == design_variables(KINDS[kind])[name][index]

    def measured(value):
        patch = at(KINDS[kind], name, index, value)
        return area(patch, rtol=1e-12), volume(patch, origin=origin, rtol=1e-12)

    if abs(entry.value) == 1:
        step = -entry.value * 2e-3
        values = np.array([measured(entry.value + k * step) for k in range(5)])
        expected = np.array([-25, 48, -36, 16, -3]) @ values / (12 * step)
    else:
        expected = differences(measured, entry.value)
    assert entry.area == pytest.approx(expected[0], rel=2e-7)
    assert entry.volume == pytest.approx(expected[1], rel=2e-7)


def test_rates_of_a_surface_of_rotation_in_closed_form():
    """Pappus' theorems: ``A = 2 pi int x |C'|``, ``V = 2 pi / 3 int x (x z' - z x')``, by quadrature at many digits."""
    points = [[3, 0], [5, 2], [2, 6]]
    patch = Rotation(Curve([[x, 0, z] for x, z in points], (0.4, -0.3)), [0, 0, 0], [0, 0, 1])

    def coordinate(g, axis):
        def value(t):
            s, c = mp.sin(mp.pi * t / 2), mp.cos(mp.pi * t / 2)
            first, last = (1 - s) * (1 - g[0] * s), (1 - c) * (1 - g[1] * c)
            return first * points[0][axis] + (1 - first - last) * points[1][axis] + last * points[2][axis]

        return value

    def figures(g):
        (x, dx), (z, dz) = ((f, lambda t, f=f: mp.diff(f, t)) for f in (coordinate(g, 0), coordinate(g, 1)))
        around = mp.quad(lambda t: x(t) * mp.hypot(dx(t), dz(t)), [0, 1])
        inside = mp.quad(lambda t: x(t) * (x(t) * dz(t) - z(t) * dx(t)), [0, 1])
        return mp.matrix([2 * mp.pi * around, 2 * mp.pi / 3 * inside])

    with mp.workdps(20):
        step = mp.mpf(10) ** -5
        for entry, g in zip(sensitivities(patch).entries, (0, 1), strict=True):
            sides = []
            for side in (1, -1):
                gamma = [mp.mpf("0.4"), mp.mpf("-0.3")]
                gamma[g] += side * step
                sides.append(figures(gamma))
            expected = (sides[0] - sides[1]) / (2 * step)
            assert entry.area == pytest.approx(float(expected[0]), rel=1e-8)
            assert abs(entry.volume) == pytest.approx(abs(float(expected[1])), rel=1e-8)
            sign = math.copysign(1, float(volume(patch)) * float(sides[0][1]))
            assert math.copysign(1, entry.volume * float(expected[1])) == sign


def test_a_collapsed_side_and_a_rate_of_nothing():
    """The apex of a cone has design variables that move nothing: exact zeros, quickly."""
    found = {entry.variable: entry for entry in sensitivities(cone(WAVE, [50.0, 0.0, 80.0])).entries}
    assert found["b[0]"].area == found["b[1]"].volume == 0
    assert found["a[0]"].area > 1
    assert math.isnan(found["a[0]"].curvatures.mean[1])


# Curvatures


def test_curvatures_of_a_torus():
    found = curvature_range(Rotation(RING, [0, 0, 0], [0, 0, 1]))
    assert found.gaussian == pytest.approx((-1 / 200, 1 / 400), rel=1e-9)
    side = 1 if found.mean[1] > 0 else -1
    assert found.mean == pytest.approx(sorted((side * 0.025, side * 0.0625)), rel=1e-9)
    assert found.principal == pytest.approx(sorted((side * 0.1, -side * 0.05)), rel=1e-9)


def test_curvatures_of_a_sphere_with_its_poles():
    found = curvature_range(Rotation(HALF, [0, 0, 0], [0, 0, 1]))
    assert found.gaussian == pytest.approx((1 / 400, 1 / 400), rel=1e-6)
    assert np.abs(found.mean + found.principal) == pytest.approx(np.full(4, 1 / 20), rel=1e-6)


def test_curvatures_of_a_cone_are_infinite_at_its_apex_and_finite_off_it():
    rim = CurveOfTerms(Waves(0.0, math.pi), [[0, 0, 0], [3, 0, 0], [0, 3, 0]])
    found = curvature_range(cone(rim, [0, 0, 4]))
    assert [math.isinf(value) for value in found.mean].count(True) == 1
    assert found.gaussian == pytest.approx((0, 0), abs=1e-9)
    truncated = curvature_range(cone(rim, [0, 0, 4], (0.0, 0.75)))
    # the curvature across a ruling at the radius r is cos(slope) / r, slope from the axis' normal plane: 4 / 5 / r
    assert max(np.abs(truncated.principal)) == pytest.approx(0.8 / 0.75, rel=1e-9)
    assert min(np.abs(truncated.mean)) == pytest.approx(0.4 / 3, rel=1e-9)


def test_a_plane_patch_has_neither_curvature_nor_volume():
    sheet = Ruled(Curve([[0, 0], [2, 1], [4, 0]], (0.5, 0)), Curve([[0, 3], [2, 5], [4, 3]]))
    study = patch_study(sheet, "a", values=[-0.5, 1])
    for variant, row in zip(study.variants, study.rows(), strict=True):
        assert row[2] == pytest.approx(float(area(variant.patch)), rel=1e-9)
        assert row[3:] == pytest.approx([0] * 7, abs=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_no_sample_is_outside_the_estimated_range(kind):
    found = curvature_range(KINDS[kind])
    u, v = np.random.default_rng(3).random((2, 3000))
    arguments = (KINDS[kind], u, v)
    values = gaussian_curvature(*arguments), mean_curvature(*arguments), principal_curvatures(*arguments)
    for (low, high), sampled in zip(found, values, strict=True):
        room = 1e-6 * (high - low)
        assert low - room <= sampled.min() <= sampled.max() <= high + room


@pytest.mark.parametrize(
    ("kind", "name", "index"), [("surface", "gamma_u", 0), ("swept", "profile", 1), ("sweep", "spine", 1)]
)
def test_rates_of_curvatures(kind, name, index, rates):
    """Of those extremes that one place has: the others have no derivative."""
    entry = rates[1][kind][f"{name}[{index}]"]
    found = np.ravel(entry.curvatures)
    expected = differences(lambda g: np.ravel(curvature_range(at(KINDS[kind], name, index, g))), entry.value)
    assert found == pytest.approx(expected, rel=1e-4, abs=1e-7 * abs(expected).max())


# Studies


def test_a_study_is_a_grid_with_its_figures():
    study = patch_study(KINDS["swung"], ("trajectory", "profile[1]"), values=(-0.5, 1), origin=(1, 2, 3))
    assert study.axes == ("trajectory", "profile[1]")
    expected = [(a, b) for a in (-0.5, 1.0) for b in (-0.5, 1.0)]
    assert [row[:2] for row in study.rows()] == expected
    assert len(study.columns) == len(study.rows()[0]) == 2 + 2 + 6
    for (a, b), variant, row in zip(expected, study.variants, study.rows(), strict=True):
        patch = Swung(Curve(PROFILE.control_points, (0.3, b)), Curve(TRAJECTORY.control_points, (a, a)), 1.5)
        assert variant.patch == patch
        assert row[2] == pytest.approx(float(area(patch)), rel=1e-9)
        assert row[3] == pytest.approx(float(volume(patch, origin=(1, 2, 3))), rel=1e-9)
        assert row[4:] == tuple(itertools.chain(*curvature_range(patch)))


@pytest.mark.parametrize(
    ("variables", "axes"),
    [(None, ("a[0]", "a[1]")), ("b", ("b[0]", "b[1]")), ("b[1]", ("b[1]",)), (["b"], ("b",)), (["a[0]", "b[0]"],) * 2],
)
def test_what_varies(variables, axes):
    study = patch_study(KINDS["ruled"], variables, values=[0.5])
    assert study.axes == tuple(axes)
    assert study.values == ((0.5,),) * len(axes)


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind not in ("rotation", "restricted")])
def test_all_patches_of_a_study_share_the_corners(kind):
    """But where a profile or the whole is a part of a curve or patch."""
    corners = KINDS[kind].evaluate([0, 0, 1, 1], [0, 1, 0, 1])
    middle = KINDS[kind].evaluate(0.4, 0.45)
    for name in design_variables(KINDS[kind]):
        for pair in ((-1, 1), (1, -0.5)):
            patch = with_design_variables(KINDS[kind], {name: pair})
            if (kind, name) != ("sweep", "spine"):  # the frame at its end is another
                assert abs(patch.evaluate([0, 0, 1, 1], [0, 1, 0, 1]) - corners).max() <= 1e-9
            assert np.linalg.norm(patch.evaluate(0.4, 0.45) - middle) > 1e-3


def test_wrong_studies_are_refused():
    ruled = KINDS["ruled"]
    for variables in ("c", ["a", "c[0]"], ["a[2]"], [], ["a[0]", "a[1]", "b"], 3):
        with pytest.raises(InputError, match=r"variables must be one or two of a, a\[0\], a\[1\], b"):
            patch_study(ruled, variables)
    for variables in (["a", "a[0]"], ["a[1]", "a"], ["b", "b"]):
        with pytest.raises(InputError, match="variables must be different ones"):
            patch_study(ruled, variables)
    with pytest.raises(InputError, match=r"a\[0\] = 2, a\[1\] = 2: a\[0\] must lie in \[-1, 1\], got 2"):
        patch_study(ruled, values=[2])
    for values in ([], "x", [[0.0, 1.0]]):
        with pytest.raises(InputError, match="values must be one number or more, got"):
            patch_study(ruled, values=values)
    with pytest.raises(InputError, match="origin must be three finite numbers"):
        patch_study(ruled, values=[0], origin=(0, 0))
    three = Lofted(SECTIONS[:3])
    with pytest.raises(InputError, match=r"gamma_v\[0\] = -1, gamma_v\[1\] = -1: functions of degree 2"):
        patch_study(three, "gamma_v", values=[-1])
