from __future__ import annotations

import itertools
import math
import pickle
from collections import Counter
from dataclasses import replace
from functools import cache
from pathlib import Path

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gtcad import BERNSTEIN, Curve, Restricted
from gtcad.basis import Basis
from gtcad.composite import Composite
from gtcad.conics import circle
from gtcad.converters import fit_surface
from gtcad.converters.mesh import mesh_surface
from gtcad.differential import frenet_frame
from gtcad.errors import InputError
from gtcad.factors import CurveOfTerms, Stacked, Waves
from gtcad.measure import area, volume
from gtcad.patches import Rotation, Swept
from gtcad.patches.sweep import Sweep, sweep_parts
from gtcad.restricted import RestrictedCurve
from tests import reference
from tests.patches.developables import at_start
from tests.patches.kinds import WAVE, line

FRAMES = ("rotation-minimising", "frenet", "fixed")
T = np.linspace(0, 1, 41)
U, V = np.meshgrid(T, np.linspace(0, 1, 61), indexing="ij")
TURN = 2 * math.pi
RING = CurveOfTerms(Waves(0.0, TURN), [[0, 0], [5, 0], [0, 5]])
CIRCLE = CurveOfTerms(Waves(0.0, TURN), [[1, 2, 3], [30, 0, 0], [0, 30, 0]])
SPINE = Curve([[0, 0, 0], [60, 0, 0], [80, 60, 20], [20, 100, 60], [0, 50, 100]], (0.3, -0.2))
LENS = Curve([[-4, -2], [0, 6], [7, 1], [3, -5]], (0.2, 0.4))
RADIUS, PITCH = 30.0, 40.0


def helix(turns):
    """Radius 30, rising 40 for each turn."""
    factors = Stacked((Waves(0.0, TURN * turns), Basis(1, family=BERNSTEIN)))
    return CurveOfTerms(factors, [[0, 0, 0], [RADIUS, 0, 0], [0, RADIUS, 0], [0, 0, 0], [0, 0, PITCH * turns]])


def knot(height=3.0, waves=2):
    """A closed curve that is not plane."""
    factors = Stacked((Waves(0.0, TURN), Waves(0.0, waves * TURN)))
    rows = [[0, 0, 0], [40, 0, 0], [0, 40, 0], [0, 0, 0], [0, 0, height], [0, 3, height]]
    return CurveOfTerms(factors, rows)


def polynomial_frame(sweep, v):
    """The n and b without twist that the surface is made with, shape (2, v.size, 3)."""
    plain = Sweep(sweep.profile, sweep.spine, frame=sweep.frame, start_normal=sweep.start_normal)
    return np.stack(plain.frame_at(v)[1:])


# Truths in closed form


@pytest.mark.parametrize("frame", ["rotation-minimising", "fixed"])
def test_a_straight_spine_is_a_translation(frame):
    for spine in (line([1, 2, 3], [1, 2, 90]), Curve([[1, 2, 3], [1, 2, 10], [1, 2, 90]])):
        sweep = Sweep(LENS, spine, frame=frame, start_normal=[1, 0, 0])
        swept = Swept(LENS.transformed(np.eye(3, 2)), spine)
        assert abs(sweep.evaluate(U, V) - swept.evaluate(U, V)).max() <= 1e-13
        assert sweep.definition_error <= 1e-9


def test_a_fixed_frame_translates_along_any_spine():
    sweep = Sweep(LENS, SPINE, frame="fixed")
    _, n, b = sweep.frame_at(0.0)
    carried = LENS.transformed(np.column_stack([n, b]))
    assert abs(sweep.evaluate(U, V) - Swept(carried, SPINE).evaluate(U, V)).max() <= 1e-13
    assert sweep.frame_error <= 1e-12


@pytest.mark.parametrize("frame", ["rotation-minimising", "frenet"])
def test_a_circle_along_a_circle_is_a_torus(frame):
    torus = Sweep(RING, CIRCLE, frame=frame)
    x, y, z = np.moveaxis(torus.evaluate(U, V) - [1, 2, 3], -1, 0)
    assert abs((np.hypot(x, y) - 30) ** 2 + z**2 - 25).max() <= 1e-11
    assert float(area(torus)) == pytest.approx(4 * math.pi**2 * 30 * 5, rel=1e-11)
    assert abs(float(volume(torus))) == pytest.approx(2 * math.pi**2 * 30 * 25, rel=1e-11)
    assert torus.definition_error <= 1e-10


def test_a_sweep_along_a_circle_is_a_rotation():
    spine = CurveOfTerms(Waves(0.0, 4.0), [[0, 0, 0], [30, 0, 0], [0, 30, 0]])
    sweep = Sweep(LENS, spine, start_normal=[1, 0, 0])  # n points outwards, b = t x n down
    meridian = LENS.transformed([[1, 0], [0, 0], [0, -1]], [30, 0, 0])
    expected = Rotation(meridian, [0, 0, 0], [0, 0, 1], math.degrees(4.0))
    assert abs(sweep.evaluate(U, V) - expected.evaluate(U, V)).max() <= 1e-12


def helix_frames(turns, v):
    """Tangent, Frenet normal and binormal, and the angle from there to the frame that is n = -N at the start."""
    with mp.workdps(40):
        angle, rise = 2 * mp.pi * turns * mp.mpf(v), mp.mpf(PITCH) / (2 * mp.pi)
        speed = mp.sqrt(RADIUS**2 + rise**2)
        cosine, sine = mp.cos(angle), mp.sin(angle)
        tangent = [-RADIUS * sine / speed, RADIUS * cosine / speed, rise / speed]
        normal = [-cosine, -sine, mp.mpf(0)]
        binormal = [rise * sine / speed, -rise * cosine / speed, RADIUS / speed]
        return tangent, normal, binormal, -angle * rise / speed  # torsion times length


def turned_pair(n, b, angle):
    cosine, sine = mp.cos(angle), mp.sin(angle)
    first = [cosine * x + sine * y for x, y in zip(n, b, strict=True)]
    return first, [cosine * y - sine * x for x, y in zip(n, b, strict=True)]


def distance(found, expected):
    """The root of the sum of squares over all vectors."""
    pairs = zip(np.ravel(found), [x for vector in expected for x in vector], strict=True)
    return mp.sqrt(mp.fsum((mp.mpf(float(x)) - y) ** 2 for x, y in pairs))


@pytest.mark.parametrize("turns", [0.3, 2, 7])
def test_frames_of_a_helix_are_within_their_proved_error(turns):
    spine = helix(turns)
    frenet = Sweep(LENS, spine, frame="frenet")
    minimising = Sweep(LENS, spine, start_normal=[1, 0, 0])
    for v in (0.0, 0.21, 0.5, 0.77, 1.0):
        _, n, b, angle = helix_frames(turns, v)
        assert distance(polynomial_frame(frenet, v), (n, b)) <= frenet.frame_error
        n, b = ([-x for x in vector] for vector in turned_pair(n, b, angle))
        assert distance(polynomial_frame(minimising, v), (n, b)) <= minimising.frame_error
    assert frenet.frame_error <= 1e-11
    assert minimising.frame_error <= 1e-9


@pytest.mark.parametrize("frame", ["rotation-minimising", "frenet"])
def test_the_surface_is_within_its_definition_error(frame):
    profile = Curve([[-4, -2, 3], [0, 6, 1], [7, 1, -2]], family=BERNSTEIN)
    scale, twist = (1.0, 0.2, 2.5), 500.0
    normal = [1, 0, 0] if frame != "frenet" else None
    sweep = Sweep(profile, helix(2), frame=frame, start_normal=normal, scale=scale, twist_deg=twist)
    assert sweep.definition_error <= 1e-9
    for u, v in ((0.0, 0.0), (0.3, 0.4), (1.0, 0.9), (0.5, 1.0)):
        with mp.workdps(40):
            tangent, n, b, angle = helix_frames(2, v)
            side = 1 if frame == "frenet" else -1
            more = mp.mpf(v) * mp.mpf(twist) * mp.pi / 180
            n, b = turned_pair(n, b, more + (0 if frame == "frenet" else angle))
            w = mp.mpf(v)
            s = (1 - w) ** 2 + 2 * mp.mpf(0.2) * w * (1 - w) + mp.mpf(2.5) * w**2
            a = mp.mpf(u)
            x, y, z = (
                (1 - a) ** 2 * mp.mpf(p) + 2 * a * (1 - a) * mp.mpf(q) + a**2 * mp.mpf(r)
                for p, q, r in zip(*profile.control_points.tolist(), strict=True)
            )
            turn = 4 * mp.pi * w
            spine = [RADIUS * mp.cos(turn), RADIUS * mp.sin(turn), 80 * w]
            expected = [
                c + s * (side * (x * f + y * g) + z * t) for c, f, g, t in zip(spine, n, b, tangent, strict=True)
            ]
            gap = distance(sweep.evaluate(u, v), (expected,))
        assert gap <= sweep.definition_error + 1e-13  # what the evaluation itself rounds


def test_the_rounding_of_a_placement_is_within_the_definition_error():
    rows = np.array([[1 / 3, 0.2, 0.1, 1e7 / 7], [0.1, 1 / 7, 0.9, 3e6 / 11], [0.3, -0.7, 1 / 9, 5e6 / 13]])
    spine = Curve(SPINE.control_points * 1e6 / 3 + 1e6 / 7, SPINE.gamma)
    sweep = Sweep(LENS, spine, frame="fixed")
    far = replace(sweep, placement=rows)
    start, moved = (at_start(CurveOfTerms(one.factors_v, one.coefficients[0])) for one in (sweep, far))
    with mp.workdps(40):
        expected = [mp.fsum(mp.mpf(x) * y for x, y in zip(row, [*start, 1], strict=True)) for row in rows.tolist()]
        apart = mp.sqrt(mp.fsum((x - y) ** 2 for x, y in zip(moved, expected, strict=True)))
    assert sweep.definition_error < apart <= far.definition_error


# The frame of a GT curve at many digits, as the Frenet frame turned by the integral of the torsion


def derivatives(curve, v, order):
    rows = reference.taylor_rows(curve.family.name, curve.degree, curve.gamma, v, order)
    points = [[mp.mpf(x) for x in point] for point in curve.control_points.tolist()]
    return [
        [mp.factorial(k) * mp.fsum(row[k] * p[d] for row, p in zip(rows, points, strict=True)) for d in range(3)]
        for k in range(order + 1)
    ]


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def unit(a):
    size = mp.norm(a)
    return [x / size for x in a]


def exact_frenet(curve, v):
    _, first, second = derivatives(curve, v, 2)
    tangent, binormal = unit(first), unit(cross(first, second))
    return tangent, cross(binormal, tangent), binormal


def turn_rate(curve, v):
    _, first, second, third = derivatives(curve, v, 3)
    across = cross(first, second)
    return -mp.fdot(across, third) * mp.norm(first) / mp.fdot(across, across)


@cache
def exact_minimising(v):
    """n and b of SPINE that start with the part of x across the tangent."""
    with mp.workdps(reference.DIGITS):
        tangent, normal, binormal = exact_frenet(SPINE, mp.mpf(0))
        start = unit(cross(cross(tangent, [mp.mpf(0), mp.mpf(0), mp.mpf(1)]), tangent))
        angle = mp.atan2(mp.fdot(start, binormal), mp.fdot(start, normal))
        if v:
            angle += mp.quad(lambda w: turn_rate(SPINE, w), mp.linspace(0, mp.mpf(v), 5), maxdegree=4)
        _, normal, binormal = exact_frenet(SPINE, mp.mpf(v))
        return turned_pair(normal, binormal, angle)


@pytest.mark.parametrize("v", [0.0, 0.7])
def test_frames_of_a_gt_curve_are_within_their_proved_error(v):
    sweep = Sweep(LENS, SPINE, start_normal=[0, 0, 7])
    assert distance(polynomial_frame(sweep, v), exact_minimising(v)) <= sweep.frame_error <= 3e-11
    frenet = Sweep(LENS, SPINE, frame="frenet")
    with mp.workdps(reference.DIGITS):
        expected = exact_frenet(SPINE, mp.mpf(v))[1:]
    assert distance(polynomial_frame(frenet, v), expected) <= frenet.frame_error <= 1e-11


# The same by other methods


def random_spine(seed, degree=4):
    """A curve that winds, but has no near cusps: its legs are longer than what bends them."""
    rng = np.random.default_rng(seed)
    steps = rng.normal(size=(degree, 3)) * 12 + [25, 0, 0]
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    points = np.vstack([np.zeros(3), np.cumsum(steps, axis=0)]) @ turn
    return Curve(points, tuple(rng.uniform(-0.7, 1, 2)))


def integrated(spine, start, places):
    from scipy.integrate import solve_ivp

    def rate(v, r):
        first, second = spine.derivative(v, 1), spine.derivative(v, 2)
        return np.cross(np.cross(first, second), r) / (first @ first)

    return solve_ivp(rate, (0, 1), start, method="DOP853", rtol=1e-13, atol=1e-14, t_eval=places).y.T


def compare_with_integration(seed):
    spine = random_spine(seed, 3 + seed % 4)
    sweep = Sweep(LENS, spine)
    _, n, b = sweep.frame_at(T)
    for vectors in (n, b):
        assert abs(integrated(spine, vectors[0], T) - vectors).max() <= 1e-11


@pytest.mark.parametrize("seed", range(2))
def test_the_frame_is_that_of_an_integrator(seed):
    compare_with_integration(seed)


@pytest.mark.stress
@pytest.mark.parametrize("seed", range(2, 102))
def test_the_frame_is_that_of_an_integrator_stress(seed):
    compare_with_integration(seed)


def double_reflection(spine, normal, count):
    """W. Wang, B. Juttler, D. Zheng, Y. Liu, ACM Trans. Graph. 27 (2008) 2: of fourth order."""
    v = np.linspace(0, 1, count + 1)
    points, tangents = spine.evaluate(v), spine.derivative(v)
    tangents /= np.linalg.norm(tangents, axis=1)[:, None]
    r = normal
    for k in range(count):
        chord = points[k + 1] - points[k]
        reflected = r - 2 * (chord @ r) / (chord @ chord) * chord
        tangent = tangents[k] - 2 * (chord @ tangents[k]) / (chord @ chord) * chord
        second = tangents[k + 1] - tangent
        r = reflected - 2 * (second @ reflected) / (second @ second) * second
    return r


def test_the_frame_is_the_limit_of_double_reflections():
    sweep = Sweep(LENS, SPINE)
    _, n, _ = sweep.frame_at([0.0, 1.0])
    errors = [np.linalg.norm(double_reflection(SPINE, n[0], count) - n[1]) for count in (40, 80, 160, 320)]
    assert errors[-1] <= 1e-8
    for before, after in itertools.pairwise(errors):
        assert 12 <= before / after <= 20


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 10**6))
def test_what_defines_the_frame(seed):
    spine = random_spine(seed)
    sweep = Sweep(LENS, spine)
    tangent, n, b = sweep.frame_at(T)
    error = sweep.frame_error + 1e-14
    assert error <= 1e-9
    first = spine.derivative(T)
    first /= np.linalg.norm(first, axis=1)[:, None]
    for vector in (n, b):
        assert abs(np.linalg.norm(vector, axis=1) - 1).max() <= error
        assert abs(np.sum(vector * first, axis=1)).max() <= error
    assert abs(np.sum(n * b, axis=1)).max() <= 2 * error
    assert np.linalg.norm(tangent - first, axis=1).max() <= 2 * error
    rates = sweep._turned[0].rows(T, 1).reshape(2, 3, -1)  # n', b' along t
    sizes = np.linalg.norm(rates, axis=1).max()
    across = rates.transpose(0, 2, 1) - np.einsum("kdt,td->kt", rates, first)[..., None] * first
    assert abs(across).max() <= 1e-10 * max(1, sizes)


def test_the_frenet_frame_is_that_of_differential():
    sweep = Sweep(LENS, SPINE, frame="frenet")
    for found, expected in zip(sweep.frame_at(T), frenet_frame(SPINE, T), strict=True):
        assert abs(found - expected).max() <= 1e-12


# Twist, scale, closing


def test_twist_and_scale_act_on_the_profile():
    plain = Sweep(LENS, SPINE, start_normal=[0, 0, 1])
    changed = Sweep(LENS, SPINE, start_normal=[0, 0, 1], twist_deg=-200, scale=[0.5, 2, 1, 0])
    w = V[0]
    law = 0.5 * (1 - w) ** 3 + 6 * w * (1 - w) ** 2 + 3 * w**2 * (1 - w)
    angle = np.radians(-200) * w
    _, n, b = plain.frame_at(w)
    x, y = LENS.evaluate(U[:, 0]).T
    turned_x, turned_y = (
        np.outer(x, np.cos(angle)) - np.outer(y, np.sin(angle)),
        np.outer(x, np.sin(angle)) + np.outer(y, np.cos(angle)),
    )
    offsets = turned_x[..., None] * n + turned_y[..., None] * b
    expected = SPINE.evaluate(w) + law[:, None] * offsets
    assert abs(changed.evaluate(U, V) - expected).max() <= 1e-12
    assert abs(changed.boundary("v1").evaluate(T) - SPINE.evaluate(1.0)).max() <= 1e-12
    assert changed.definition_error <= 1e-9
    found = changed.frame_at(w)
    assert abs(found.normal - (np.cos(angle)[:, None] * n + np.sin(angle)[:, None] * b)).max() <= 1e-14


def test_a_constant_scale_scales_the_profile():
    scaled = Sweep(LENS, SPINE, scale=2.5)
    assert scaled.scale == (2.5,)
    assert abs(scaled.evaluate(U, V) - Sweep(LENS.transformed(2.5 * np.eye(2)), SPINE).evaluate(U, V)).max() <= 1e-12
    tapered = Sweep(LENS, SPINE, scale=(1, 3))
    assert abs(tapered.evaluate(U, 0.5) - Sweep(LENS, SPINE, scale=2).evaluate(U, 0.5)).max() <= 1e-12


def test_closed_spines_close():
    loose = Sweep(RING, knot())
    tight = Sweep(RING, knot(), closed=True)
    assert loose.closing_deg == 0
    assert 0.1 < abs(tight.closing_deg) <= 180
    start, end = (loose.frame_at(v).normal for v in (0.0, 1.0))
    assert math.degrees(math.acos(start @ end)) == pytest.approx(abs(tight.closing_deg), abs=1e-9)
    assert np.linalg.norm(loose.evaluate(0.2, 0.0) - loose.evaluate(0.2, 1.0)) > 1e-3
    assert abs(tight.evaluate(T, 0.0) - tight.evaluate(T, 1.0)).max() <= 1e-13
    assert tight.definition_error <= 1e-9
    poles = fit_surface(tight, tolerance=1e-3).spline.control_points
    assert np.array_equal(poles[:, 0], poles[:, -1])
    assert np.array_equal(poles[0], poles[-1])
    triangles = mesh_surface(tight, tolerance=0.05).triangles.tolist()
    edges = Counter(frozenset(pair) for t in triangles for pair in zip(t, t[1:] + t[:1], strict=True))
    assert set(edges.values()) == {2}


def test_closed_plane_spines_need_no_closing():
    sweep = Sweep(RING, CIRCLE, closed=True)
    assert abs(sweep.closing_deg) <= 1e-10
    whole = Sweep(LENS, CIRCLE, closed=True, twist_deg=360)
    assert abs(whole.evaluate(T, 0.0) - whole.evaluate(T, 1.0)).max() <= 1e-12
    assert Sweep(LENS, CIRCLE, frame="frenet", closed=True).closing_deg == 0


# As a shape


def test_profiles_in_space_lean_along_the_tangent():
    profile = LENS.transformed(np.eye(3, 2), [0, 0, 3])
    for frame in FRAMES:
        flat, lifted = (Sweep(one, SPINE, frame=frame) for one in (LENS, profile))
        expected = flat.evaluate(U, V) + 3 * flat.frame_at(V[0]).tangent
        assert abs(lifted.evaluate(U, V) - expected).max() <= 1e-12
        assert lifted.definition_error <= 1e-9


SWEEPS = {
    "duct": Sweep(RING, SPINE),
    "horn": Sweep(LENS, SPINE, scale=(0.5, 1.0, 3.0), twist_deg=270),
    "frenet": Sweep(LENS, helix(1.5), frame="frenet"),
    "fixed": Sweep(LENS, SPINE, frame="fixed", twist_deg=90),
    "closed": Sweep(RING, knot(), closed=True),
    "part": Sweep(Restricted(LENS, (0.8, 0.1)), Restricted(SPINE, (1.0, 0.3)), start_normal=[1, 1, 1]),
}
every_sweep = pytest.mark.parametrize("sweep", SWEEPS.values(), ids=SWEEPS)


@cache
def fitted(name, tolerance):
    return fit_surface(SWEEPS[name], tolerance=tolerance)


@pytest.mark.parametrize(
    ("name", "tolerance"),
    [
        *((name, 1e-4) for name in SWEEPS),
        ("horn", 1e-6),
        *(pytest.param(name, 1e-6, marks=pytest.mark.stress) for name in SWEEPS if name != "horn"),
    ],
)
def test_fits_keep_the_tolerance(name, tolerance):
    fit = fitted(name, tolerance)
    assert fit.deviation[1] + SWEEPS[name].definition_error <= tolerance * 1.001
    t = np.linspace(0, 1, 201)
    gaps = SWEEPS[name].evaluate(t[:, None], t[None]) - fit.spline.evaluate(t[:, None], t[None])
    assert fit.deviation[0] * 0.9 <= np.linalg.norm(gaps, axis=-1).max() <= fit.deviation[1]


@every_sweep
def test_meshes_keep_their_tolerance(sweep):
    mesh = mesh_surface(sweep, tolerance=0.05)
    assert mesh.deviation <= 0.05
    assert mesh.area == pytest.approx(float(area(sweep, rtol=1e-7)), rel=0.02)


@every_sweep
def test_derivatives_match_differences(sweep):
    u, v, step = 0.37, 0.81, 1e-5
    along = (sweep.evaluate(u, v + step) - sweep.evaluate(u, v - step)) / (2 * step)
    assert abs(sweep.derivative(u, v, (0, 1)) - along).max() <= 1e-4 * abs(along).max()
    for order in range(4):
        rows = sweep.factors_v.rows(np.linspace(0, 1, 301), order)
        assert abs(rows).sum(axis=0).max() <= sweep.factors_v.derivative_bound(order)


def test_step_files_hold_what_is_proved(tmp_path: Path):
    pytest.importorskip("OCP")
    from gtcad.converters.check import check_parts
    from gtcad.converters.part import Part
    from gtcad.converters.step import read_step, write_step

    parts = [Part(name, fitted(name, 1e-4).spline) for name in SWEEPS]
    write_step(tmp_path / "sweeps.step", parts, tolerance=1e-4)
    found = read_step(tmp_path / "sweeps.step")
    assert [part.name for part in found] == list(SWEEPS)
    assert all(part.valid and not part.trimmed for part in found)
    report = check_parts(found, SWEEPS, 1e-4)
    assert [(row.name, row.verdict) for row in report.rows] == [(name, "proved") for name in SWEEPS]


@every_sweep
def test_affine_images(sweep):
    rng = np.random.default_rng(3)
    turn, offset = np.linalg.qr(rng.normal(size=(3, 3)))[0], [5.0, 60, -7]
    for matrix in (-25.4 * turn, rng.normal(size=(3, 3)), rng.normal(size=(2, 3))):
        moved = sweep.transformed(matrix, offset[: len(matrix)])
        expected = sweep.evaluate(U, V) @ matrix.T + offset[: len(matrix)]
        assert abs(moved.evaluate(U, V) - expected).max() <= 1e-12 * abs(expected).max()
        similar = len(matrix) == 3 and np.ptp(np.linalg.svd(matrix)[1]) <= 1e-12 * abs(matrix).max()
        assert (moved.placement is None) == similar
    twice = sweep.transformed(2 * turn).transformed(np.diag([1.0, 2, 3]))
    assert abs(twice.evaluate(U, V) - 2 * sweep.evaluate(U, V) @ turn.T * [1, 2, 3]).max() <= 1e-10
    rounding = 1e-14 * abs(twice.evaluate(U, V)).max()  # of the placement
    assert twice.definition_error == pytest.approx(3 * sweep.transformed(2 * turn).definition_error, abs=rounding)


@every_sweep
def test_equal_sweeps_and_copies(sweep):
    copy = pickle.loads(pickle.dumps(sweep))
    assert copy == sweep
    assert hash(copy) == hash(sweep)
    assert copy.terms == sweep.terms
    assert sweep.transformed(np.eye(3)).terms == sweep.terms
    assert sweep != sweep.transformed(2 * np.eye(3))
    with pytest.raises(AttributeError):
        copy.scale = (2.0,)


def test_neighbours_share_their_edge_to_the_last_bit():
    halves = [Sweep(Restricted(RING, part), SPINE) for part in ((0.0, 0.5), (0.5, 1.0))]
    assert np.array_equal(halves[0].boundary("u1").evaluate(T), halves[1].boundary("u0").evaluate(T))


def test_parts_go_on_in_the_frame_of_the_part_before():
    whole = Sweep(LENS, SPINE)
    first = Sweep(LENS, Restricted(SPINE, (0.0, 0.4)))
    second = Sweep(LENS, Restricted(SPINE, (0.4, 1.0)), start_normal=first.frame_at(1.0).normal)
    assert abs(first.evaluate(U, V) - whole.evaluate(U, 0.4 * V)).max() <= 1e-11
    assert abs(second.evaluate(U, V) - whole.evaluate(U, 0.4 + 0.6 * V)).max() <= 1e-11


def whole_parameter(curve, t):
    while isinstance(curve, RestrictedCurve):
        t, curve = curve.range[0] + (curve.range[1] - curve.range[0]) * t, curve.shape
    return t


def check_goes_on(parts, closed):
    """Points and first derivatives by arc length agree across the seams."""
    pairs = [*itertools.pairwise(parts), *([(parts[-1], parts[0])] if closed else [])]
    for before, after in pairs:
        assert abs(before.evaluate(T, 1.0) - after.evaluate(T, 0.0)).max() <= 1e-10
        slopes = before.derivative(T, 1.0, (0, 1)), after.derivative(T, 0.0, (0, 1))
        speeds = (np.linalg.norm(part.spine.derivative(end)) for part, end in ((before, 1.0), (after, 0.0)))
        first, second = (slope / speed for slope, speed in zip(slopes, speeds, strict=True))
        assert abs(first - second).max() <= 1e-8


def test_parts_of_one_that_needs_none():
    options = {"scale": (1, 0.4, 2), "twist_deg": 100, "start_normal": [0, 1, 1]}
    assert sweep_parts(LENS, SPINE, **options) == (Sweep(LENS, SPINE, **options),)


def test_a_spine_that_winds_much_is_swept_in_parts():
    spine = knot(15.0, 3)
    with pytest.raises(InputError, match="sweep along parts of the spine"):
        Sweep(LENS, spine)
    parts = sweep_parts(LENS, spine, scale=(1, 3, 1), twist_deg=-720)
    assert len(parts) > 1
    check_goes_on(parts, closed=False)
    assert abs(parts[0].spine.evaluate(0.0) - spine.evaluate(0.0)).max() <= 1e-12
    assert abs(parts[-1].spine.evaluate(1.0) - spine.evaluate(1.0)).max() <= 1e-12
    assert sum(part.definition_error for part in parts) <= 1e-8
    for part in parts:
        place = whole_parameter(part.spine, 0.5)
        law = (1 - place) ** 2 + 6 * place * (1 - place) + place**2
        sizes = np.linalg.norm(part.evaluate(T, 0.5) - part.spine.evaluate(0.5), axis=1)
        assert abs(sizes - law * np.linalg.norm(LENS.evaluate(T), axis=1)).max() <= 1e-10


def test_parts_of_a_closed_spine_close():
    halves = Composite(tuple(Restricted(knot(), part) for part in ((0.0, 0.5), (0.5, 1.0))), ("C3", "C3"), True)
    parts = sweep_parts(LENS, halves, closed=True)
    check_goes_on(parts, closed=True)
    assert sum(part.twist_deg for part in parts) == pytest.approx(Sweep(LENS, knot(), closed=True).closing_deg)


def test_a_chain_is_swept_piece_by_piece():
    parts = sweep_parts(RING, circle([0, 0, 0], 30), closed=True)
    assert len(parts) == 4
    check_goes_on(parts, closed=True)
    for part in parts:
        x, y, z = np.moveaxis(part.evaluate(U, V), -1, 0)
        assert abs((np.hypot(x, y) - 30) ** 2 + z**2 - 25).max() <= 1e-11


def test_chains_with_a_corner_are_refused():
    corner = Composite((line([0, 0, 0], [9, 0, 0]), line([9, 0, 0], [9, 9, 0])), ("C0",))
    with pytest.raises(InputError, match="one tangent at joint 1, got ends 0 apart and tangents that differ by 1"):
        sweep_parts(LENS, corner)
    with pytest.raises(InputError, match="spine must close with one tangent for closed=True"):
        sweep_parts(LENS, SPINE, closed=True)
    with pytest.raises(InputError, match="no vanishing speed, but it vanishes at v = 0"):
        sweep_parts(LENS, BACK)


def test_the_normal_at_the_start():
    assert Sweep(LENS, CIRCLE).start_normal == (0, 0, 1)
    assert Sweep(LENS, line([0, 0, 0], [0, 0, 5])).start_normal == (0, 1, 0)
    given_one = Sweep(LENS, SPINE, start_normal=[3, 0, 4])
    tangent, normal, binormal = given_one.frame_at(0.0)
    assert abs(np.cross(np.cross(tangent, [3, 0, 4]), tangent) @ binormal) <= 1e-12
    assert normal @ [3, 0, 4] > 0
    assert Sweep(LENS, SPINE, start_normal=[3e200, 0, 4e200]).evaluate(0.3, 0.4).tolist() == pytest.approx(
        given_one.evaluate(0.3, 0.4).tolist(), rel=1e-13
    )


def test_spines_far_from_the_origin_keep_their_frame():
    near, far = Sweep(LENS, SPINE), Sweep(LENS, SPINE.transformed(np.eye(3), [1e5, -2e5, 3e5]))
    assert abs(near.frame_at(T).normal - far.frame_at(T).normal).max() <= far.frame_error + near.frame_error
    assert far.frame_error <= 1e-8


# What has no frame

CUSP = Curve([[0, 0, 0], [50, 0, 0], [50, 0, 0], [50, 50, 30]], family=BERNSTEIN)  # C'(1/2) is not 0
STOP = Curve([[0, 0, 0], [0, 0, 0], [50, 20, 0], [50, 50, 30]], family=BERNSTEIN)
BACK = Curve([[0, 0, 0], [30, 0, 0], [0, 0, 0]], family=BERNSTEIN)  # turns round at 1/2
WAVY = Curve([[0, 0], [30, 30], [60, -30], [90, 0]], family=BERNSTEIN)  # an inflection at 1/2
SHARP = Curve([[0, 0, 0], [60, 60, 3], [1, 60, 0], [60, 0, 1]], family=BERNSTEIN)


def stopping(place):
    """A spine that stops at one place, and nearly at 0.9: C' = (t - place) ((t - 0.9)^2 + 1e-5) q(t)."""
    slopes = [np.polynomial.Polynomial([-place, 1]) * [0.81001, -1.8, 1] * q for q in ([1, 0.3], [0.2, 1], [0.1, -0.4])]
    power = 100 * np.column_stack([one.integ().coef for one in slopes])
    count = len(power)
    rows = [[math.comb(i, k) / math.comb(count - 1, k) for k in range(count)] for i in range(count)]
    return Curve(rows @ power, family=BERNSTEIN)


@pytest.mark.parametrize(
    ("spine", "options", "message"),
    [
        (STOP, {}, "speed vanishes at v = 0"),
        (STOP.reversed(), {}, "no vanishing speed, but it vanishes at v = 1"),
        (BACK, {}, "no vanishing speed, but it vanishes at v = 0.5"),
        (STOP, {"frame": "fixed"}, "speed vanishes at v = 0"),
        (stopping(0.30027), {}, "no vanishing speed, but it vanishes at v = 0.30027"),
        (WAVY, {"frame": "frenet"}, "no vanishing curvature, but it vanishes at v = 0.5"),
        (line([0, 0, 0], [9, 0, 0]), {"frame": "frenet"}, "no vanishing curvature, but it vanishes at v = 0"),
        (Curve([[0, 0, 0], [4, 4, 4], [9, 9, 9]]), {"frame": "frenet"}, "it vanishes at v = "),
        (SHARP, {}, r"no polynomials of degree 190 within rounding: at v = 0\.\d+ it turns by \d"),
        (SPINE, {"twist_deg": 360 * 60}, "turned by 21600 degrees in all and scaled has no polynomials"),
        (SPINE, {"start_normal": SPINE.derivative(0.0)}, "start_normal must not be along the tangent"),
        (SPINE, {"start_normal": [0, 0, 0]}, "start_normal must not be zero"),
        (SPINE, {"start_normal": "up"}, "start_normal must be three finite numbers, got 'up'"),
        (SPINE, {"start_normal": [0, 0, 1], "frame": "frenet"}, "start_normal must be None: the Frenet frame"),
        (SPINE, {"frame": "natural"}, "frame must be one of rotation-minimising, frenet, fixed, got 'natural'"),
        (SPINE, {"scale": (1, -1)}, r"scale must not be negative, nor 0 throughout, got \[1.0, -1.0\]"),
        (SPINE, {"scale": 0}, "scale must not be negative, nor 0 throughout"),
        (SPINE, {"scale": []}, "scale must be 1 to 61 finite numbers"),
        (SPINE, {"scale": [1, math.nan]}, "scale must be 1 to 61 finite numbers"),
        (SPINE, {"scale": "linear"}, "scale must be 1 to 61 finite numbers, got 'linear'"),
        (SPINE, {"twist_deg": math.inf}, "twist_deg must be a finite number, got inf"),
        (SPINE, {"closed": "minimise"}, "closed must be True or False, got 'minimise'"),
        (SPINE, {"closed": True}, "spine must close with one tangent for closed=True, got ends 1"),
        (SPINE, {"placement": [1]}, "placement must be rows"),
        (circle([0, 0, 0], 5), {}, "spine must be a curve, got Arc"),
        (None, {}, "spine must be a curve, got NoneType"),
    ],
)
def test_bad_input(spine, options, message):
    with pytest.raises(InputError, match=message):
        Sweep(LENS, spine, **options)


def test_a_profile_must_be_a_curve():
    with pytest.raises(InputError, match="profile must be a curve, got int"):
        Sweep(3, SPINE)
    with pytest.raises(InputError, match=r"v must lie in \[0, 1\], got 2"):
        Sweep(LENS, SPINE).frame_at(2.0)


def test_bent_sharply_is_not_singular():
    assert Sweep(LENS, CUSP).frame_error <= 1e-8
    assert Sweep(LENS, WAVE).frame_error <= 1e-10
