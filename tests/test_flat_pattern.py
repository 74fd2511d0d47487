from __future__ import annotations

import math
import pickle
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from gtcad import BERNSTEIN, Composite, Curve, Restricted, Surface, measure
from gtcad._flat_places import first_crossing
from gtcad.conics import circle
from gtcad.errors import InputError, NotDevelopable
from gtcad.factors import CurveOfTerms, Stacked, Waves
from gtcad.flat_curves import FlatCurve
from gtcad.flat_pattern import SIDES, FlatPattern, develop
from gtcad.patches import PlaneFamily, Rotation, Ruled, cone, cylinder, geodesic_developable, spine_developable
from gtcad.protocol import SeparableSurface
from tests.unfolding import unfolded

Array = NDArray[np.float64]

QUARTER = Curve([[1, 0, 0], [1, 1, 0], [0, 1, 0]])
SWING = Curve([[40, 0, 0], [40, 3, 10], [20, 40, 10], [0, 40, 30]], (0.1, -1 / 3))
BOW = Curve([[0, 0, 0], [30, 10, 0], [40, 40, 20], [10, 60, 40]], (0.2, -0.3))
SADDLE = Ruled(Curve([[0, 0, 0], [1, 0, 0]], family=BERNSTEIN), Curve([[0, 1, 0], [1, 1, 1]], family=BERNSTEIN))

PATCHES: dict[str, SeparableSurface] = {
    "cylinder": cylinder(SWING, [10, 20, 30]),
    "cone": cone(SWING, [10, 20, 300], (0, 0.6)),
    "cone with its apex": cone(SWING, [10, 20, 100]),
    "cone from its apex": cone(SWING, [10, 20, 100], (1, 0)),
    "part of a cone": Restricted(cone(SWING, [10, 20, 300]), ((0.9, 0.2), (0.25, 0.75))),
    "rotation": Rotation(Curve([[30, 0, 0], [10, 0, 50]], family=BERNSTEIN), [0, 0, 0], [0, 0, 1], 250),
    "tangent surface": spine_developable(BOW, (5, 40)),
    "rectifying": geodesic_developable(BOW, (-10, 10)),
    "lens": Ruled(
        Curve([[0, 0, 0], [30, 0, 0], [50, 0, 40], [90, 0, 0]]),
        Curve([[0, 0, 0], [30, 20, 0], [50, 50, 40], [90, 0, 0]]),
    ),
    "plane": Surface([[[0, 0], [0, 30]], [[40, 0], [50, 70]]], family_u=BERNSTEIN, family_v=BERNSTEIN),
}
each_patch = pytest.mark.parametrize("patch", PATCHES.values(), ids=PATCHES)


def helix(turns: float, radius: float, pitch: float, reach: tuple[float, float]) -> Ruled:
    """The tangent surface of a helix between two distances from it."""
    angle = 2 * math.pi * turns
    factors = Stacked((Waves(0.0, angle), Curve([[0, 0], [1, 0]], family=BERNSTEIN).factors))
    rise = pitch / (2 * math.pi)
    points = np.array([[0, 0, 0], [radius, 0, 0], [0, radius, 0], [0, 0, 0], [0, 0, angle * rise]])
    slope = np.array([[0, 0, rise], [0, radius, 0], [-radius, 0, 0], [0, 0, 0], [0, 0, 0]])
    tangent = slope / math.hypot(radius, rise)
    return Ruled(*(CurveOfTerms(factors, points + w * tangent) for w in reach))


def forms(shape: Any, u: Array, v: Array) -> tuple[Array, Array, Array]:
    """E, F and G of the first fundamental form."""
    s_u, s_v = shape.derivative(u, v, (1, 0)), shape.derivative(u, v, (0, 1))
    return (s_u * s_u).sum(axis=-1), (s_u * s_v).sum(axis=-1), (s_v * s_v).sum(axis=-1)


def isometry_error(pattern: FlatPattern, seed: int = 0) -> float:
    """The largest difference of the first fundamental forms, relative to the largest E and G on the patch."""
    u, v = np.random.default_rng(seed).random((2, 300))
    flat, space = forms(pattern, u, v), forms(pattern.patch, u, v)
    e, g = (float(space[k].max()) for k in (0, 2))
    sizes = (e, math.sqrt(e * g), g)
    return max(float(np.abs(a - b).max()) / size for a, b, size in zip(flat, space, sizes, strict=True))


def family(rng: np.random.Generator) -> PlaneFamily:
    """Planes around a bent sheet, of random degree, design variables and scales."""
    degree = int(rng.integers(2, 7))
    angle = np.linspace(0, rng.uniform(0.4, 1.6), degree + 1) + rng.normal(0, 0.01, degree + 1)
    rows = [
        np.cos(angle),
        np.sin(angle),
        rng.normal(0, 0.03, degree + 1),
        rng.uniform(80, 120) + rng.normal(0, 1, degree + 1),
    ]
    scales = rng.uniform(0.7, 1.3, (degree + 1, 1))
    return PlaneFamily(np.stack(rows, axis=1) * scales, tuple(rng.uniform(-0.9, 0.9, 2)))


def regular(count: int, seed: int) -> list[SeparableSurface]:
    """Patches of random families that are regular."""
    rng, found = np.random.default_rng(seed), list[SeparableSurface]()
    while len(found) < count:
        bounds = (0.0, 0.0, 1.0, 0.0), (*rng.normal(0, 0.1, 2), 1.0, rng.uniform(30, 80))
        try:
            found.append(family(rng).enveloping(*bounds))
        except InputError:
            continue
    return found


# --- exact ------------------------------------------------------------------------------------------------------------


def test_a_cylinder_becomes_a_rectangle() -> None:
    pattern = develop(cylinder(QUARTER, [0, 0, 3]))
    corners = pattern.point([0, 1, 1, 0], [0, 0, 1, 1])
    np.testing.assert_allclose(corners, [[0, 0], [math.pi / 2, 0], [math.pi / 2, 3], [0, 3]], atol=1e-14)
    angle = np.linspace(0, 1, 7)
    np.testing.assert_allclose(pattern.point(angle, 0.5)[:, 0], angle * math.pi / 2, atol=1e-14)


@pytest.mark.parametrize("part", [(0.0, 1.0), (1.0, 0.0), (0.25, 0.5)])
def test_a_cone_becomes_a_sector(part: tuple[float, float]) -> None:
    slant = math.hypot(1, 2)
    patch = cone(QUARTER, [0, 0, 2], part)
    pattern = develop(patch)
    apex = pattern.point(0.0, 0.0) + (1 - part[0]) / (part[1] - part[0]) * (
        pattern.point(0.0, 1.0) - pattern.point(0.0, 0.0)
    )
    t = np.linspace(0, 1, 9)
    for v, w in zip((0.0, 1.0), part, strict=True):
        spokes = pattern.point(t, v) - apex
        np.testing.assert_allclose(np.linalg.norm(spokes, axis=1), (1 - w) * slant, atol=1e-14)
        if w < 1:
            turned = np.unwrap(np.arctan2(*spokes.T[::-1]))
            np.testing.assert_allclose(np.abs(turned - turned[0]), t * math.pi / 2 / slant, atol=1e-13)
    assert pattern.area == pytest.approx(
        math.pi / 4 * slant * ((1 - part[0]) ** 2 - (1 - part[1]) ** 2).__abs__(), rel=1e-14
    )


def test_the_spine_of_a_tangent_surface_of_a_helix_becomes_a_circle() -> None:
    """Its curvature r / (r^2 + h^2) stays, so the boundary is concentric: its radius is hypot(R, w)."""
    radius, pitch = 20.0, 30.0
    rise = pitch / (2 * math.pi)
    pattern = develop(helix(0.4, radius, pitch, (4.0, 30.0)))
    circle_radius = (radius**2 + rise**2) / radius
    points = pattern.point(np.linspace(0, 1, 50)[:, None], np.array([[0.0, 1.0]]))
    for side, reach in ((0, 4.0), (1, 30.0)):
        line = points[:, side]
        centre = np.linalg.lstsq(2 * (line[1:] - line[0]), (line[1:] ** 2).sum(axis=1) - line[0] @ line[0], rcond=None)[
            0
        ]
        expected = math.hypot(circle_radius, reach)
        np.testing.assert_allclose(np.linalg.norm(line - centre, axis=1), expected, rtol=1e-12)


def test_the_geodesic_of_a_rectifying_developable_becomes_a_straight_line() -> None:
    pattern = develop(geodesic_developable(BOW, (-10, 10)))
    line = pattern.point(np.linspace(0, 1, 40), 0.5)
    along = line[-1] - line[0]
    aside = (line - line[0]) @ [-along[1], along[0]]
    assert np.abs(aside).max() < 1e-11 * (along @ along)
    assert np.linalg.norm(along) == pytest.approx(measure.length(BOW), rel=1e-11)


# --- isometry ---------------------------------------------------------------------------------------------------------


@each_patch
def test_the_first_fundamental_form_stays(patch: SeparableSurface) -> None:
    assert isometry_error(develop(patch)) < 1e-11


@each_patch
def test_lengths_of_the_sides_and_area_stay(patch: SeparableSurface) -> None:
    pattern = develop(patch)
    for side in SIDES:
        flat, space = pattern.loss.lengths[side]
        assert flat == pattern.lengths[side]
        assert flat == pytest.approx(space, rel=1e-9, abs=1e-11)
    assert pattern.area == pytest.approx(measure.area(patch), rel=1e-9)
    assert pattern.loss.strain < 1e-11


@each_patch
def test_it_is_seen_from_the_side_of_the_normal(patch: SeparableSurface) -> None:
    u, v = np.random.default_rng(1).uniform(0.01, 0.99, (2, 50))
    pattern = develop(patch)
    p_u, p_v = pattern.derivative(u, v, (1, 0)), pattern.derivative(u, v, (0, 1))
    assert (p_u[:, 0] * p_v[:, 1] - p_u[:, 1] * p_v[:, 0] > 0).all()


@each_patch
def test_boundaries_are_the_sides_of_the_pattern(patch: SeparableSurface) -> None:
    pattern, t = develop(patch), np.linspace(0, 1, 17)
    for side, curve in pattern.boundary.items():
        at = float(side[1])
        u, v = (at, t) if side[0] == "u" else (t, at)
        order = (0, 1) if side[0] == "u" else (1, 0)
        np.testing.assert_allclose(curve.evaluate(t), pattern.point(u, v), atol=1e-11)
        np.testing.assert_allclose(curve.derivative(t), pattern.derivative(u, v, order), atol=1e-8)


FAR = np.array([[1, 0, 0], [1, 1, 0], [0, 1, 0]])
TURNS = Curve([[0, 0, 0], [10, 0.01, 0], [0, 0.02, 0], [10, 0.03, 0]], (0.9, 0.9))
HARD: dict[str, SeparableSurface] = {
    "no speed at the start": cylinder(Curve(QUARTER.control_points, (-1, 0.5)), [0, 0, 3]),
    "no speed at either end": cylinder(Curve(QUARTER.control_points[[0, 0, 1, 2, 2]], (0.2, 0.3)), [0, 0, 3]),
    "tight turns": cylinder(TURNS, [0, 0, 1]),
    "degree 20": cylinder(Curve([[k, 3 * math.sin(k), 0] for k in range(21)]), [0, 0, 3]),
    "tiny": cone(Curve(1e-6 * FAR), [0, 0, 2e-6], (0, 0.5)),
    "huge": cone(Curve(1e6 * FAR), [0, 0, 2e6], (0, 0.5)),
    "far away": cylinder(Curve(FAR + 1e5), [0, 0, 3]),
    "next to the apex": cone(QUARTER, [0, 0, 2], (0.999, 1)),
}


@pytest.mark.parametrize("patch", HARD.values(), ids=HARD)
def test_hard_cases_keep_their_metric_and_points(patch: SeparableSurface) -> None:
    pattern = develop(patch)
    assert isometry_error(pattern) < 1e-10
    uv = np.random.default_rng(4).random((50, 2))
    points, size = pattern.point(*uv.T), max(pattern.lengths.values())
    np.testing.assert_allclose(pattern.point(*pattern.locate(points).T), points, atol=1e-12 * size)
    assert pattern.overlap is None


def test_random_families_keep_their_metric() -> None:
    for patch in regular(10, 7):
        assert isometry_error(develop(patch)) < 1e-9


@pytest.mark.stress
def test_many_random_families_keep_their_metric_and_sides() -> None:
    for patch in regular(500, 11):
        pattern = develop(patch)
        assert isometry_error(pattern) < 1e-9
        for flat, space in pattern.loss.lengths.values():
            assert flat == pytest.approx(space, rel=1e-9)
        assert pattern.area == pytest.approx(measure.area(patch), rel=1e-9)


@given(st.lists(st.tuples(*[st.floats(-1, 1)] * 2), min_size=4, max_size=7), st.floats(-0.9, 0.9), st.floats(0.2, 3.0))
def test_cylinders_of_any_section_keep_their_lengths(
    offsets: list[tuple[float, float]], gamma: float, height: float
) -> None:
    points = np.array([[3.0 * k + x, 2.0 * y, 0.0] for k, (x, y) in enumerate(offsets)])
    patch = cylinder(Curve(points, (gamma, -gamma)), [0.1, 0.3, height])
    pattern = develop(patch)
    assert isometry_error(pattern) < 1e-9
    assert pattern.lengths["v0"] == pytest.approx(measure.length(patch.a), rel=1e-9)


# --- against triangles ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["cone", "tangent surface", "rectifying", "cylinder"])
def test_an_unfolding_of_triangles_converges_to_the_pattern(name: str) -> None:
    patch = PATCHES[name]
    pattern, errors = develop(patch), []
    for count in (125, 250, 500):
        t = np.linspace(0, 1, count + 1)
        flat = unfolded(patch.evaluate(t, 0.0), patch.evaluate(t, 1.0))
        errors.append(max(float(np.abs(flat[v] - pattern.point(t, float(v))).max()) for v in (0, 1)))
    assert errors[0] < 1e-2
    np.testing.assert_allclose(np.array(errors[:-1]) / errors[1:], 4.0, rtol=0.1)


def test_a_hundred_thousand_triangles_agree() -> None:
    patch = PATCHES["tangent surface"]
    t = np.linspace(0, 1, 50_001)
    flat = unfolded(patch.evaluate(t, 0.0), patch.evaluate(t, 1.0))
    pattern = develop(patch)
    for v in (0, 1):
        assert np.abs(flat[v] - pattern.point(t, float(v))).max() < 1e-6


# --- refused ----------------------------------------------------------------------------------------------------------


def test_a_saddle_is_refused_with_its_twist() -> None:
    with pytest.raises(NotDevelopable, match="not developable: its tangent plane twists by 45 degrees") as caught:
        develop(SADDLE)
    assert caught.value.twist_deg == pytest.approx(45, abs=1e-2)  # a sample near the end, where it is 45
    assert caught.value.parameter == pytest.approx(0, abs=1e-3)
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)


def test_a_patch_over_its_edge_of_regression_is_refused() -> None:
    with pytest.raises(NotDevelopable, match="crossed by its edge of regression"):
        develop(helix(0.4, 20.0, 30.0, (-4.0, 30.0)))


def test_the_place_of_the_crossing_is_found() -> None:
    """The apex lies at w = 1; a boundary that reaches over it for t > 1/4 turns back there."""
    base, apex = np.array([[30.0, 0, 0], [30, 30, 0], [0, 30, 0]]), np.array([0, 0, 60.0])
    reach = 0.8 + 0.8 * np.array([0.0, 0.5, 1.0])  # of the way to the apex, 1 at t = 1/4
    patch = Ruled(Curve(base, family=BERNSTEIN), _product(base, apex, reach))
    with pytest.raises(NotDevelopable, match="boundary b") as caught:
        develop(patch)
    assert caught.value.parameter == pytest.approx(0.25, abs=1e-6)


def _product(base: Array, apex: Array, reach: Array) -> Curve:
    """(1 - w(t)) C(t) + w(t) apex, w and C quadratic: the Bezier curve of degree 4."""
    whole = np.zeros((5, 3))
    for i in range(3):
        for j in range(3):
            weight = math.comb(2, i) * math.comb(2, j) / math.comb(4, i + j)
            whole[i + j] += weight * ((1 - reach[j]) * base[i] + reach[j] * apex)
    return Curve(whole, family=BERNSTEIN)


def test_a_ruling_that_vanishes_inside_is_refused() -> None:
    crossing = Ruled(Curve([[0, 0], [2, 2]], family=BERNSTEIN), Curve([[0, 2], [2, 0]], family=BERNSTEIN))
    with pytest.raises(NotDevelopable) as caught:
        develop(crossing)
    assert caught.value.parameter == pytest.approx(0.5)


@pytest.mark.parametrize("place", [2e-5, 1e-3, 0.123, 1 / math.pi, 0.9995])
def test_rulings_that_turn_back_between_samples_are_refused(place: float) -> None:
    """Lines that cross at equal parameters; and a line that is run back after its end."""
    slope = np.array([0.3, 1.0])
    first = Curve([[0, 0], [1, 0]], family=BERNSTEIN)
    second = Curve([[place, 0] - place * slope, [place, 0] + (1 - place) * slope], family=BERNSTEIN)
    run_back = Curve([[place**2, 0, 0], [place**2 - place, 0, 0], [(1 - place) ** 2, 0, 0]], family=BERNSTEIN)
    for patch, reason in ((Ruled(first, second), "no length"), (cylinder(run_back, [0, 0, 1]), "is still")):
        with pytest.raises(NotDevelopable, match=reason) as caught:
            develop(patch)
        assert caught.value.parameter == pytest.approx(place, rel=1e-9)


@pytest.mark.parametrize(
    "other", [Surface(np.random.default_rng(0).random((3, 3, 3))), Rotation(SWING, [0, 0, 0], [0, 0, 1])]
)
def test_what_is_not_ruled_is_refused(other: SeparableSurface) -> None:
    with pytest.raises(NotDevelopable, match="straight in neither"):
        develop(other)


@pytest.mark.parametrize("limit", [-1, 90, math.nan])
def test_a_limit_of_the_twist_that_is_none(limit: float) -> None:
    with pytest.raises(InputError, match="twist_deg must lie"):
        develop(SADDLE, twist_deg=limit)
    with pytest.raises(InputError, match="patch must be a surface"):
        develop(SWING)  # type: ignore[arg-type]


# --- with an allowance ------------------------------------------------------------------------------------------------


def test_a_quasi_developable_says_what_is_lost() -> None:
    """z = h x y: n . S_x at the ends of a ruling is what is lost, |S_x| (1 - cos) with the plane of the middle."""
    height = 0.1
    saddle = SADDLE.transformed(np.diag([1, 1, height]))
    pattern = develop(saddle, twist_deg=10)
    loss = pattern.loss
    assert loss.twist_deg == pytest.approx(math.degrees(math.atan(height)), rel=1e-3)
    half = height / 2
    # at x = 0 the tangent planes at y = 0, 1/2, 1 are turned about the ruling by atan(h y)
    expected = 1 - math.cos(math.atan(height) - math.atan(half)), 1 - math.cos(math.atan(half))
    assert loss.strain == pytest.approx(max(expected), rel=1e-2)
    for side in ("u0", "u1"):
        assert loss.lengths[side][0] == pytest.approx(loss.lengths[side][1], rel=1e-12)
    for side in ("v0", "v1"):
        assert 0 < 1 - loss.lengths[side][0] / loss.lengths[side][1] <= loss.strain
    assert 0 < 1 - loss.area[0] / loss.area[1] < loss.strain


def test_strain_is_of_second_order_in_the_twist() -> None:
    strains = [develop(SADDLE.transformed(np.diag([1, 1, h])), twist_deg=20).loss.strain for h in (0.02, 0.04)]
    assert strains[1] / strains[0] == pytest.approx(4, rel=0.01)


# --- curves and holes -------------------------------------------------------------------------------------------------


def ring(t: Array) -> Array:
    return np.stack([0.5 + 0.3 * np.cos(2 * np.pi * t), 0.4 + 0.2 * np.sin(2 * np.pi * t)], axis=1)


ON_PATCH: dict[str, Any] = {
    "curve": Curve([[0.1, 0.2], [0.9, 0.1], [0.5, 0.9]], (0.3, 0.1)),
    "circle": circle([0.5, 0.5], 0.3),
    "function": ring,
    "corners": Composite(
        (Curve([[0.2, 0.2], [0.8, 0.3]], family=BERNSTEIN), Curve([[0.8, 0.3], [0.5, 0.9]], family=BERNSTEIN)), ("C0",)
    ),
    "border": Curve([[0.0, 0.0], [1.0, 1.0]], family=BERNSTEIN),
}
each_curve = pytest.mark.parametrize("curve", ON_PATCH.values(), ids=ON_PATCH)


def parameters_at(curve: Any, t: Array) -> Array:
    if isinstance(curve, Composite):
        return curve.evaluate(t * len(curve.pieces))
    return np.asarray(curve(t) if callable(curve) else curve.evaluate(t))


@each_curve
@pytest.mark.parametrize("name", ["cone", "tangent surface", "rotation", "lens"])
def test_curves_are_carried_along_and_back(name: str, curve: Any) -> None:
    patch = PATCHES[name]
    pattern, t = develop(patch), np.linspace(0, 1, 101)
    image = pattern.image(curve)
    u, v = parameters_at(curve, t).T
    np.testing.assert_allclose(image.evaluate(t), pattern.point(u, v), atol=1e-10)
    rolled = pattern.roll(image)
    if name != "lens" or not np.isin([0.0, 1.0], u).any():  # at a tip of the lens all v are one point
        np.testing.assert_allclose(rolled.parameters.evaluate(t), np.stack([u, v], axis=1), atol=1e-10)
    np.testing.assert_allclose(rolled.space.evaluate(t), patch.evaluate(u, v), atol=1e-9)
    assert image.length == pytest.approx(rolled.space.length, rel=1e-9)


@each_curve
def test_closed_holes_stay_closed(curve: Any) -> None:
    pattern = develop(PATCHES["cone"])
    closed = bool(np.allclose(*parameters_at(curve, np.array([0.0, 1.0])), atol=1e-14))
    assert pattern.image(curve).closed is closed
    assert pattern.roll(pattern.image(curve)).parameters.closed is closed


def test_a_straight_line_rolls_onto_a_geodesic() -> None:
    """On a cylinder about z the slope of a helix against the circles is constant."""
    pattern = develop(cylinder(QUARTER, [0, 0, 3]))
    rolled = pattern.roll(Curve([[0.1, 0.2], [1.5, 2.8]], family=BERNSTEIN))
    t = np.linspace(0, 1, 30)
    points = rolled.space.evaluate(t)
    np.testing.assert_allclose(np.hypot(points[:, 0], points[:, 1]), 1, atol=1e-13)
    np.testing.assert_allclose(np.arctan2(points[:, 1], points[:, 0]), 0.1 + 1.4 * t, atol=1e-12)
    np.testing.assert_allclose(points[:, 2], 0.2 + 2.6 * t, atol=1e-12)


@each_patch
def test_points_are_located(patch: SeparableSurface) -> None:
    pattern = develop(patch)
    uv = np.random.default_rng(2).random((200, 2))
    points = pattern.point(*uv.T)
    found = pattern.locate(points)
    np.testing.assert_allclose(pattern.point(*found.T), points, atol=1e-10)
    np.testing.assert_allclose(found, uv, atol=1e-8)
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    places = pattern.point(*corners.T)
    np.testing.assert_allclose(pattern.point(*pattern.locate(places).T), places, atol=1e-10)


@each_patch
def test_points_outside_are_refused(patch: SeparableSurface) -> None:
    pattern = develop(patch)
    centre, far = pattern.point(0.5, 0.5), pattern.point(0.5, 1.0)
    outwards = pattern.derivative(0.5, 1.0, (0, 1))
    with pytest.raises(InputError, match="lies outside the pattern"):
        pattern.locate(far + 1e-3 * outwards)
    with pytest.raises(InputError, match="lies outside the pattern"):
        pattern.locate(np.stack([centre, centre + [1e4, 0]]))
    assert pattern.locate(centre) == pytest.approx([0.5, 0.5])


@pytest.mark.parametrize(
    ("curve", "message"),
    [
        (Curve([[0.1, 0.2], [1.5, 0.5]], family=BERNSTEIN), "leaves the patch"),
        (SWING, "must be plane, got dimension 3"),
        ("circle", "must be a plane curve or a function"),
        (lambda t: t, "must return points"),
        (lambda t: np.stack([t, np.abs(t - 0.3)], axis=1), r"not resolved near t = 0\.(299|300)"),
        (lambda t: np.stack([t, np.full(t.shape, np.nan)], axis=1), "leaves the patch"),
    ],
)
def test_curves_that_are_none(curve: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        develop(PATCHES["cone"]).image(curve)


# --- bend lines -------------------------------------------------------------------------------------------------------


def test_bend_lines_share_the_turning_equally() -> None:
    pattern = develop(cylinder(QUARTER, [0, 0, 3]))
    lines = pattern.bend_lines(5)
    np.testing.assert_allclose([line.parameter for line in lines], [0.1, 0.3, 0.5, 0.7, 0.9], atol=1e-6)
    np.testing.assert_allclose([line.angle_deg for line in lines], -18, atol=1e-4)  # away from the outside
    for line in lines:
        np.testing.assert_allclose(line.start, [line.parameter * math.pi / 2, 0], atol=1e-12)
        np.testing.assert_allclose(line.end, [line.parameter * math.pi / 2, 3], atol=1e-12)
    inside = develop(cylinder(QUARTER.reversed(), [0, 0, 3])).bend_lines(5)
    np.testing.assert_allclose([line.angle_deg for line in inside], 18, atol=1e-4)


@each_patch
def test_bend_lines_are_rulings_and_add_up(patch: SeparableSurface) -> None:
    pattern = develop(patch)
    lines = pattern.bend_lines(at=[0.2, 0.5, 0.9])
    for line in lines:
        ends = [(line.parameter, v) if pattern.along_v else (v, line.parameter) for v in (0.0, 1.0)]
        np.testing.assert_allclose([line.start, line.end], [pattern.point(*end) for end in ends], atol=1e-12)
    normals = [normal_at(pattern, t) for t in (1e-6, 0.35, 0.7, 1 - 1e-6)]
    for line, before, after in zip(lines, normals, normals[1:], strict=False):
        angle = math.degrees(math.atan2(float(np.linalg.norm(np.cross(before, after))), float(before @ after)))
        assert abs(line.angle_deg) >= angle - 1e-3  # of a cone the normal does not turn in a plane


def normal_at(pattern: FlatPattern, t: float) -> Array:
    u, v = (t, 0.5) if pattern.along_v else (0.5, t)
    s_u, s_v = (
        np.pad(pattern.patch.derivative(u, v, orders), (0, 3 - pattern.patch.dimension)) for orders in ((1, 0), (0, 1))
    )
    across = np.cross(s_u, s_v)
    return np.asarray(across / np.linalg.norm(across))


def test_a_plane_has_no_bends() -> None:
    assert develop(PATCHES["plane"]).bend_lines(7) == ()
    assert develop(PATCHES["cone"]).bend_lines(0) == ()


@pytest.mark.parametrize(
    "arguments", [{}, {"count": 2, "at": [0.5]}, {"count": -1}, {"count": 1.5}, {"at": [0.5, 0.2]}, {"at": [2.0]}]
)
def test_bend_lines_that_are_none(arguments: dict[str, Any]) -> None:
    with pytest.raises(InputError):
        develop(PATCHES["cone"]).bend_lines(**arguments)


# --- overlap ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("turns", "overlaps"), [(0.7, False), (0.95, False), (1.2, True), (2.5, True)])
def test_patterns_that_lie_over_themselves_are_found(turns: float, overlaps: bool) -> None:
    """A tangent surface of a helix becomes a ring: it overlaps when it turns by more than a full turn."""
    radius, pitch = 20.0, 30.0
    bending = radius / math.hypot(radius, pitch / (2 * math.pi))  # turn in the plane for each turn in space
    pattern = develop(helix(turns / bending, radius, pitch, (4.0, 30.0)))
    assert (pattern.overlap is not None) is overlaps
    if pattern.overlap is not None:
        first, second = pattern.overlap.places
        sides = [pattern.contour[int(place * len(pattern.contour))] for place in (first, second)]
        assert 0 <= first < second <= 1
        for side in sides:
            t = np.linspace(0, 1, 4001)
            assert np.linalg.norm(side.evaluate(t) - pattern.overlap.point, axis=1).min() < 0.05


@each_patch
def test_plain_patches_do_not_overlap(patch: SeparableSurface) -> None:
    assert develop(patch).overlap is None


def crosses_itself(polygon: Array) -> bool:
    """By every pair of sides: whether each has its ends on both sides of the other."""
    sides = list(zip(polygon, np.roll(polygon, -1, axis=0), strict=True))
    across = [[tuple(np.sign(np.linalg.det([b - a, end - a])) for end in other) for other in sides] for a, b in sides]
    return any(
        {across[i][j], across[j][i]} <= {(1, -1), (-1, 1)} for i in range(len(sides)) for j in range(i + 1, len(sides))
    )


@pytest.mark.parametrize("stretch", [(1, 1), (9, 1), (1, 9)])
def test_crossings_are_those_of_every_pair_of_sides(stretch: tuple[int, int]) -> None:
    rng, found = np.random.default_rng(5), 0
    for count in rng.integers(3, 8, 200):
        for polygon in (rng.integers(0, 5, (count, 2)) * stretch, rng.normal(size=(count, 2)) * stretch):
            crossing = first_crossing(polygon.astype(float))
            assert (crossing is not None) == crosses_itself(polygon)
            if crossing is not None:
                found += 1
                closed = np.concatenate([polygon, polygon[:1]])
                for place in crossing.places:
                    x, y = (np.interp(place * count, np.arange(count + 1), axis) for axis in closed.T)
                    assert (x, y) == pytest.approx(crossing.point, abs=1e-9)
    assert 100 < found < 300


# --- motions ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("flip", [1.0, -1.0])
def test_moved_patterns_are_the_same_elsewhere(flip: float) -> None:
    pattern = develop(PATCHES["cone"])
    cosine, sine = math.cos(0.7), math.sin(0.7)
    matrix = np.array([[cosine, -sine], [sine, cosine]]) @ np.diag([1.0, flip])
    moved = pattern.moved(matrix, [5, -3])
    u, v = np.random.default_rng(3).random((2, 40))
    np.testing.assert_allclose(moved.point(u, v), pattern.point(u, v) @ matrix.T + [5, -3], atol=1e-12)
    assert moved.bend_lines(3)[1].angle_deg == pytest.approx(flip * pattern.bend_lines(3)[1].angle_deg)
    np.testing.assert_allclose(moved.locate(moved.point(u, v)), np.stack([u, v], axis=1), atol=1e-9)
    with pytest.raises(InputError, match="rotation or reflection"):
        pattern.moved(2 * np.eye(2))


@each_patch
def test_the_contour_is_closed_and_runs_around_the_area(patch: SeparableSurface) -> None:
    pattern = develop(patch)
    curves: tuple[FlatCurve, ...] = pattern.contour
    for before, after in pairwise((*curves, curves[0])):
        np.testing.assert_allclose(before.evaluate(1.0), after.evaluate(0.0), atol=1e-10)
    signed = math.fsum(_enclosed(curve) for curve in curves)
    assert signed == pytest.approx(measure.area(patch), rel=1e-9)


def _enclosed(curve: FlatCurve) -> float:
    """Half the integral of x dy - y dx, by Gauss-Legendre quadrature on many parts."""
    z, weights = np.polynomial.legendre.leggauss(20)
    edges = np.unique([*np.linspace(0, 1, 33), *curve.breaks])
    total = 0.0
    for a, b in pairwise(edges):
        t = (a + b) / 2 + (b - a) / 2 * z
        (x, y), (dx, dy) = curve.evaluate(t).T, curve.derivative(t).T
        total += (b - a) / 4 * float(weights @ (x * dy - y * dx))
    return total
