from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from gtcad import BERNSTEIN, Curve, Restricted, Surface, measure
from gtcad.converters.analytic import certify_quadric, quadric_of
from gtcad.converters.quadrics import Quadric, extremes, surface_of_quadric
from gtcad.errors import InputError
from gtcad.factors import SurfaceOfTerms, Waves
from gtcad.patches import Rotation, Ruled, Swung, cone, coons_from_loop, cylinder

TURN = 2 * math.pi
QUARTER = Curve([[2, 0, 0], [2, 2, 0], [0, 2, 0]])
UNIT = Curve([[1, 0], [1, 1], [0, 1]])
UP = ([0, 0, 0], [0, 0, 1])
LINEAR = Surface([[[0, 0, 0], [0, 3, 0]], [[2, 0, 0], [2, 3, 0]]], family_u=BERNSTEIN, family_v=BERNSTEIN)


def line(a, b):
    return Curve([a, b], family=BERNSTEIN)


def quarter(major, minor, height=0.0):
    """A quarter of a circle in the xz plane, from the outermost point to the highest."""
    return Curve([[major + minor, 0, height], [major + minor, 0, height + minor], [major, 0, height + minor]])


def octant_net():
    """P_ij of the octant of a sphere of radius 3, from x = 3 and from the equator."""
    x, z = np.array([3, 3, 0]), np.array([0, 3, 3])
    net = [
        [[x[i] * UNIT.control_points[j, 0], x[i] * UNIT.control_points[j, 1], z[i]] for j in range(3)] for i in range(3)
    ]
    return Surface(net)


# patch, kind, area, and a function that is 0 on the surface
def on_cylinder(radius):
    return lambda p: np.hypot(p[..., 0], p[..., 1]) - radius


def on_cone(radius, height):
    return lambda p: np.hypot(p[..., 0], p[..., 1]) - radius * np.abs(1 - p[..., 2] / height)


def on_sphere(radius):
    return lambda p: np.linalg.norm(p, axis=-1) - radius


def on_torus(major, minor):
    return lambda p: np.hypot(np.hypot(p[..., 0], p[..., 1]) - major, p[..., 2]) - minor


def on_plane(height=0.0):
    return lambda p: p[..., 2] - height


SLANT = math.hypot(2, 4)
CASES = {
    "cylinder": (cylinder(QUARTER, [0, 0, 5]), "cylinder", 5 * math.pi, on_cylinder(2)),
    "cylinder down": (cylinder(QUARTER, [0, 0, -5]), "cylinder", 5 * math.pi, on_cylinder(2)),
    "tube": (Rotation(line([2, 0, 1], [2, 0, 6]), *UP), "cylinder", 20 * math.pi, on_cylinder(2)),
    "tube of two arcs": (
        Ruled(Restricted(QUARTER, (0.2, 0.8)), Restricted(QUARTER.transformed(np.eye(3), [0, 0, 5]), (0.2, 0.8))),
        *("cylinder", 3 * math.pi, on_cylinder(2)),
    ),
    "tensor product": (
        Surface([[[2, 0, 0], [2, 0, 5]], [[2, 2, 0], [2, 2, 5]], [[0, 2, 0], [0, 2, 5]]], family_v=BERNSTEIN),
        *("cylinder", 5 * math.pi, on_cylinder(2)),
    ),
    "coons": (
        coons_from_loop(
            [QUARTER, line([0, 2, 0], [0, 2, 5]), QUARTER.transformed(np.eye(3), [0, 0, 5]), line([2, 0, 5], [2, 0, 0])]
        ),
        *("cylinder", 5 * math.pi, on_cylinder(2)),
    ),
    "cone": (cone(QUARTER, [0, 0, 4]), "cone", math.pi / 2 * SLANT, on_cone(2, 4)),
    "frustum": (cone(QUARTER, [0, 0, 4], (0.0, 0.5)), "cone", 0.75 * math.pi / 2 * SLANT, on_cone(2, 4)),
    "cone away": (cone(QUARTER, [0, 0, 4], (0.0, -1.0)), "cone", 3 * math.pi / 2 * SLANT, on_cone(2, 4)),
    "whole cone": (Rotation(line([2, 0, 0], [0, 0, 4]), *UP, -360, 20), "cone", 2 * math.pi * SLANT, on_cone(2, 4)),
    "funnel": (Rotation(line([0, 0, 4], [2, 0, 0]), *UP, 300), "cone", 5 / 3 * math.pi * SLANT, on_cone(2, 4)),
    "sector": (cone(QUARTER, [0, 0, 0], (0.0, 0.5)), "disc", 0.75 * math.pi, on_plane()),
    "whole disc": (Rotation(line([0, 0, 1], [3, 0, 1]), *UP), "disc", 9 * math.pi, on_plane(1)),
    "ring": (Rotation(line([3, 0, 1], [1, 0, 1]), *UP), "disc", 8 * math.pi, on_plane(1)),
    "octant": (Swung(UNIT, UNIT), "sphere", math.pi / 2, on_sphere(1)),
    "octant net": (octant_net(), "sphere", 9 * math.pi / 2, on_sphere(3)),
    "hemisphere": (Rotation(quarter(0, 3), *UP), "sphere", 18 * math.pi, on_sphere(3)),
    "sphere": (
        SurfaceOfTerms(
            Waves(-math.pi / 2, math.pi),
            Waves(0.3, TURN),
            [[[0, 0, 0]] * 3, [[0, 0, 0], [3, 0, 0], [0, 3, 0]], [[0, 0, 3], [0, 0, 0], [0, 0, 0]]],
        ),
        *("sphere", 36 * math.pi, on_sphere(3)),
    ),
    "torus": (
        Rotation(quarter(3, 1), *UP, 90),
        *("torus", math.pi / 2 * (3 * math.pi / 2 + 1), on_torus(3, 1)),  # as in the documentation: 8.9729996276
    ),
    "inside of a torus": (
        Rotation(Curve([[3, 0, 1], [2, 0, 1], [2, 0, 0]]), *UP, -200),
        *("torus", math.radians(200) * (3 * math.pi / 2 - 1), on_torus(3, 1)),
    ),
    "whole torus": (
        SurfaceOfTerms(
            Waves(0.0, TURN),
            Waves(1.0, -TURN),
            [[[0, 0, 0], [0, 0, 0], [0, 0, 1]], [[3, 0, 0], [1, 0, 0], [0, 0, 0]], [[0, 3, 0], [0, 1, 0], [0, 0, 0]]],
        ),
        *("torus", 4 * math.pi**2 * 3, on_torus(3, 1)),
    ),
    "plane": (LINEAR, "plane", 6.0, on_plane()),
}


def motion(seed):
    rng = np.random.default_rng(seed)
    matrix = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return matrix * np.sign(np.linalg.det(matrix)), rng.normal(size=3)


def size(surface):
    u, v = np.linspace(0, 1, 17)[:, None], np.linspace(0, 1, 17)[None, :]
    return float(np.abs(surface.evaluate(u, v)).max())


def grid(surface, count=17):
    line_u, line_v = np.linspace(0, 1, count)[:, None], np.linspace(0, 1, count)[None, :]
    return surface.evaluate(line_u, line_v)


def normal(surface):
    return np.cross(surface.derivative(0.5, 0.5, (1, 0)), surface.derivative(0.5, 0.5, (0, 1)))


def own_points(q, count=9):
    return q.evaluate(np.linspace(*q.u_range, count)[:, None], np.linspace(*q.v_range, count)[None, :])


PARTS = [None, ((0.0, 1.0), (1.0, 0.0)), ((0.9, 0.2), (0.3, 0.8)), ((1.0, 0.4), (0.7, 0.0))]


@pytest.mark.parametrize("part", PARTS, ids=str)
@pytest.mark.parametrize("name", CASES)
def test_what_is_analytic_is_recognised_and_proved(name, part):
    """Wherever it is put, however large, run through in any way; the implicit equation tells what it is."""
    patch, kind, _, implicit = CASES[name]
    patch = patch if part is None else Restricted(patch, part)
    for seed, scale in enumerate((1e-2, 1.0, 1e4)):
        matrix, offset = motion(seed)
        moved = patch.transformed(scale * matrix, scale * offset)
        q = quadric_of(moved)
        assert q is not None
        assert q.kind == kind
        back = (own_points(q) / scale - offset) @ matrix
        assert np.abs(implicit(back)).max() < 1e-13
        proved = certify_quadric(moved, q)
        assert proved.upper < 2e-11 * scale
        assert np.abs(grid(surface_of_quadric(q), 9) - own_points(q)).max() < 1e-13 * scale
        assert normal(surface_of_quadric(q)) @ normal(moved) > 0
        # not only the same surface: the same part of it
        assert float(measure.area(surface_of_quadric(q))) == pytest.approx(float(measure.area(moved)), rel=1e-12)


@pytest.mark.parametrize("name", CASES)
def test_areas(name):
    patch, _, area, _ = CASES[name]
    assert float(measure.area(surface_of_quadric(quadric_of(patch)))) == pytest.approx(area, rel=1e-12)


@pytest.mark.parametrize("angle", [-360, -271, -90, -1e-3, 0.5, 45, 90, 91, 180, 359.999, 360])
@pytest.mark.parametrize("start", [0, 33, -200])
def test_all_angles(angle, start):
    patch = Rotation(quarter(3, 1), *UP, angle, start).transformed(*motion(4))
    q = quadric_of(patch)
    assert abs(q.u_range[1] - q.u_range[0]) == pytest.approx(math.radians(abs(angle)), rel=1e-14)
    assert q.full_turns == (abs(angle) == 360, False)
    assert certify_quadric(patch, q).upper < 1e-10


def test_plane_patches_lie_at_zero():
    patch = Surface([[[1, 1], [1, 4]], [[3, 1], [3, 4]]], family_u=BERNSTEIN, family_v=BERNSTEIN)
    q = quadric_of(patch)
    assert (q.kind, q.origin.tolist(), q.axis.tolist()) == ("plane", [1, 1, 0], [0, 0, 1])
    assert certify_quadric(patch, q).upper < 1e-13


def moved_point(surface, shift):
    points = np.array(surface.control_points)
    points[1, 1] += [shift, 0, 0]
    return Surface(points, surface.gamma_u, surface.gamma_v, surface.family_u, surface.family_v)


def stretched(patch):
    return patch.transformed(np.diag([1.0, 1.0, 1.001]))


TENSOR = CASES["tensor product"][0]
OTHERS = {
    "elliptic cylinder": cylinder(Curve([[2, 0, 0], [2, 2.0001, 0], [0, 2.0001, 0]]), [0, 0, 5]),
    "arc that is not at right angles": cylinder(Curve([[2, 0, 0], [2.1, 2, 0], [0, 2, 0]]), [0, 0, 5]),
    "oblique cylinder": cylinder(QUARTER, [0, 1e-6, 5]),
    "oblique cone": cone(QUARTER, [1e-6, 0, 4]),
    "oblique frustum": cone(QUARTER, [1e-6, 0, 4], (0.0, 0.5)),
    "stretched sphere": stretched(Swung(UNIT, UNIT)),
    "stretched torus": stretched(Rotation(quarter(3, 1), *UP, 200)),
    "sheared cylinder": cylinder(QUARTER, [0, 0, 5]).transformed([[1, 0, 0.001], [0, 1, 0], [0, 0, 1]]),
    "ellipsoid by its factor": Swung(UNIT, UNIT, 1.001),
    "other gamma": cylinder(Curve(QUARTER.control_points, gamma=(1e-6, 0.0)), [0, 0, 5]),
    "other gamma of a net": Surface(octant_net().control_points, gamma_v=(0.0, -1e-6)),
    "degree 3": cylinder(Curve([[2, 0, 0], [2, 1, 0], [1, 2, 0], [0, 2, 0]]), [0, 0, 5]),
    "moved control point": moved_point(octant_net(), 1e-9),
    "slightly moved control point": moved_point(octant_net(), 1e-11),
    "moved control point of a cylinder": moved_point(TENSOR, 1e-9),
    "uneven height": Surface(
        [[p, p + [0, 0, 2.5], p + [0, 0, 5]] for p in QUARTER.control_points],
    ),
    "uneven profile": Rotation(Curve([[2, 0, 0], [2, 0, 1], [2, 0, 3]], gamma=(0.2, 0.1)), *UP),
    "uneven plane": Surface([[[0, 0, 0], [0, 1, 0], [0, 2, 0]], [[2, 0, 0], [2, 1, 0], [2, 2, 0]]], family_u=BERNSTEIN),
    "profile across the axis": Rotation(line([1, 0, 0], [-1, 0, 2]), *UP),
    "skew profile": Rotation(line([1, -1, 0], [1, 1, 2]), *UP),
    "spindle torus": Rotation(quarter(1, 2), *UP),
    "lemon": Rotation(quarter(-1, 2), *UP),
    "horn torus": Rotation(quarter(2, 2), *UP),
    "beyond the pole": Rotation(quarter(0, 2).transformed([[0.8, 0, -0.6], [0, 1, 0], [0.6, 0, 0.8]]), *UP),
    "tilted circle": Rotation(quarter(0, 2).transformed([[1, 0, 0], [0, 0.8, -0.6], [0, 0.6, 0.8]]), *UP),
    "helicoid": Ruled(line([0, 0, 0], [0, 0, 2]), Curve([[2, 0, 0], [2, 2, 1], [0, 2, 2]])),
    "parallelogram": Surface(
        [[[0, 0, 0], [0.001, 3, 0]], [[2, 0, 0], [2.001, 3, 0]]], family_u=BERNSTEIN, family_v=BERNSTEIN
    ),
    "trapezium": Surface([[[0, 0, 0], [0, 3, 0]], [[2, 0, 0], [2.001, 3, 0]]], family_u=BERNSTEIN, family_v=BERNSTEIN),
    "saddle": Surface([[[0, 0, 0], [0, 3, 0]], [[2, 0, 0], [2, 3, 0.001]]], family_u=BERNSTEIN, family_v=BERNSTEIN),
    "more than a turn": SurfaceOfTerms(
        Waves(0.0, 6.3),
        line([0, 0, 0], [0, 0, 1]).factors,
        [[[0, 0, 0], [0, 0, 1]], [[1, 0, 0]] * 2, [[0, 1, 0]] * 2],
    ),
    "only a curve": Surface([[[0, 0, 0], [0, 0, 0]], [[2, 0, 0], [2, 0, 0]]], family_u=BERNSTEIN, family_v=BERNSTEIN),
    "only an arc": Ruled(QUARTER, QUARTER),
    "only a point": Surface(np.ones((3, 3, 3))),
    "freeform": Surface(np.random.default_rng(1).normal(size=(4, 5, 3))),
}


@pytest.mark.parametrize("name", OTHERS)
def test_what_is_not_analytic_is_none(name):
    matrix, offset = motion(7)
    for scale in (1e-2, 1.0, 1e4):
        assert quadric_of(OTHERS[name].transformed(scale * matrix, scale * offset)) is None
    assert quadric_of(OTHERS[name]) is None


def test_a_patch_far_away_is_recognised_within_the_rounding_of_its_place():
    patch = Rotation(quarter(0, 0.3), *UP, 120).transformed(np.eye(3), [1234.5, -987.6, 0.1])
    q = quadric_of(patch)
    assert q.kind == "sphere"
    assert q.radius == pytest.approx(0.3, abs=1e-12)
    assert certify_quadric(patch, q).upper < 1e-8


# The certificate


@pytest.mark.parametrize("shift", [1e-9, 1e-4, 1.0])
@pytest.mark.parametrize("name", ["tube", "hemisphere", "torus", "ring", "plane", "cone"])
def test_a_moved_quadric_is_found_out(name, shift):
    """Everything moved by the same vector is so far away everywhere, at equal parameters."""
    patch = CASES[name][0]
    q = quadric_of(patch)
    moved = Quadric(q.kind, q.origin + [0, 0, shift], q.axis, q.x_direction, q.radius, q.second, q.u_range, q.v_range)
    found = certify_quadric(patch, moved)
    assert found.lower <= shift * (1 + 1e-9)
    assert shift * (1 - 1e-6) - 1e-11 <= found.upper <= shift * 1.02 + 2e-11


@pytest.mark.parametrize("name", ["cylinder", "cone", "torus", "sector", "octant"])
def test_the_proof_finds_how_the_parameters_run(name):
    patch, _, _, _ = CASES[name]
    q = quadric_of(patch)
    for back_u, back_v in itertools.product((1, -1), repeat=2):
        turned = Quadric(
            *(q.kind, q.origin, q.axis, q.x_direction, q.radius, q.second), q.u_range[::back_u], q.v_range[::back_v]
        )
        assert certify_quadric(patch, turned).upper < 2e-11


@pytest.mark.parametrize("start", [0.0, 1.0, -4.0])
def test_a_full_turn_may_begin_anywhere(start):
    patch = CASES["whole torus"][0]
    q = quadric_of(patch)
    for ends in ((start, start + TURN), (start, start - TURN)):
        other = Quadric("torus", q.origin, q.axis, q.x_direction, q.radius, q.second, ends, ends)
        assert certify_quadric(patch, other).upper < 2e-11
    shorter = Quadric("torus", q.origin, q.axis, q.x_direction, 3, 1, (start, start + TURN - 0.01), (0.0, TURN))
    assert certify_quadric(patch, shorter).lower > 0.005


# Quadrics themselves


def test_evaluate_gives_the_points_of_the_kernels_parameters():
    frame = ([1, 2, 3], [0, 0, 2], [0, 5, 0])
    u, v = 0.4, 0.3
    c, s = math.cos(u), math.sin(u)
    wanted = {
        ("plane", 0, 0): [1 - v, 2 + u, 3],
        ("disc", 0, 0): [1 - v * s, 2 + v * c, 3],
        ("cylinder", 2, 0): [1 - 2 * s, 2 + 2 * c, 3 + v],
        ("cone", 2, 0.5): [1 - (2 + v * math.sin(0.5)) * s, 2 + (2 + v * math.sin(0.5)) * c, 3 + v * math.cos(0.5)],
        ("sphere", 2, 0): [1 - 2 * math.cos(v) * s, 2 + 2 * math.cos(v) * c, 3 + 2 * math.sin(v)],
        ("torus", 3, 1): [1 - (3 + math.cos(v)) * s, 2 + (3 + math.cos(v)) * c, 3 + math.sin(v)],
    }
    for (kind, radius, second), point in wanted.items():
        q = Quadric(kind, *frame, radius, second, (0.0, 1.0), (0.0, 1.0))
        assert np.abs(q.evaluate(u, v) - point).max() < 1e-15
        assert q.evaluate(np.zeros((3, 1)), np.zeros(4)).shape == (3, 4, 3)


def test_just_one_range_backwards_reverses():
    for u, v in itertools.product(((0.0, 1.0), (1.0, 0.0)), repeat=2):
        q = Quadric("sphere", [0, 0, 0], [0, 0, 1], [1, 0, 0], 2.0, 0.0, u, v)
        assert q.reversed == (u != v)
        assert (normal(surface_of_quadric(q)) @ q.evaluate(0.5, 0.5) < 0) == q.reversed


@pytest.mark.parametrize("name", CASES)
def test_extremes_span_the_box(name):
    matrix, offset = motion(3)
    q = quadric_of(CASES[name][0].transformed(matrix, offset))
    points, dense = extremes(q), own_points(q, 401).reshape(-1, 3)
    assert (points.min(axis=0) <= dense.min(axis=0) + 1e-12).all()
    assert (points.max(axis=0) >= dense.max(axis=0) - 1e-12).all()
    # and no farther than the patch reaches: the samples are a step of 1/400 apart
    assert np.abs(points.min(axis=0) - dense.min(axis=0)).max() < 1e-3
    assert np.abs(points.max(axis=0) - dense.max(axis=0)).max() < 1e-3


GOOD = {
    "kind": "cone",
    "origin": [0, 0, 0],
    "axis": [0, 0, 1],
    "x_direction": [1, 0, 0],
    "radius": 1.0,
    "second": 0.5,
    "u_range": (0.0, 1.0),
    "v_range": (0.0, 1.0),
}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"kind": "ellipsoid"}, "kind must be one of plane, disc"),
        ({"origin": [0, 0]}, "origin must be three finite numbers"),
        ({"origin": [0, 0, math.nan]}, "origin must be three finite numbers"),
        ({"axis": [0, 0, 0]}, "axis must not be zero"),
        ({"x_direction": [1, 0, 1]}, "right angles"),
        ({"radius": -1.0}, "a cone needs radius >= 0 and 0 < second < pi/2"),
        ({"radius": math.inf}, "a cone needs"),
        ({"second": 0.0}, "a cone needs"),
        ({"second": math.pi / 2}, "a cone needs"),
        ({"v_range": (-3.0, 1.0)}, "must not go beyond its apex"),
        ({"u_range": (1.0, 1.0)}, "u_range must be two different finite numbers"),
        ({"v_range": (0.0, math.inf)}, "v_range must be two different finite numbers"),
        ({"u_range": (0.0, 6.3)}, "u_range must be at most a full turn"),
        ({"kind": "plane"}, "a plane needs radius = second = 0"),
        ({"kind": "disc", "radius": 0, "second": 0, "v_range": (-1.0, 1.0)}, "must not go beyond its center"),
        ({"kind": "cylinder"}, "a cylinder needs radius > 0 and second = 0"),
        ({"kind": "sphere", "radius": 0, "second": 0}, "a sphere needs radius > 0"),
        ({"kind": "sphere", "second": 0, "v_range": (0.0, 1.6)}, r"must lie in \[-pi/2, pi/2\]"),
        ({"kind": "torus", "second": 1.0}, "a torus needs radius > second > 0"),
        ({"kind": "torus", "v_range": (0.0, 6.3)}, "v_range must be at most a full turn"),
    ],
    ids=str,
)
def test_wrong_quadrics_are_refused(change, words):
    with pytest.raises(InputError, match=words):
        Quadric(**(GOOD | change))
