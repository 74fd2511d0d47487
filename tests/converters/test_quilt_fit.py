from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import NdBSpline

from gtcad import BERNSTEIN, Curve, Surface
from gtcad.converters.bspline import BSplineSurface
from gtcad.converters.quilt_fit import QuiltFit, fit_quilt
from gtcad.errors import InputError, ToleranceBelowPrecision, ToleranceNotMet
from gtcad.patches import Coons, Rotation, Ruled
from gtcad.protocol import SeparableSurface
from gtcad.quilt import Quilt, SharedEdge, Use
from gtcad.restricted import Restricted
from tests.test_quilt import (
    AXIS,
    Turn,
    apart,
    backwards,
    ball,
    box,
    can,
    circle,
    line,
    random_turns,
    sheet,
    torus,
    turned,
)

Array = NDArray[np.float64]

STRAIGHT = (False, False, False)


def random_box(seed: int) -> list[SeparableSurface]:
    rng = np.random.default_rng(seed)
    return [turned(face, turn) for face, turn in zip(box(rng), random_turns(rng, 6), strict=True)]


def mixed_seam() -> list[SeparableSurface]:
    """A turned tube, half of it as one kind and half as another, between a ruled flange and a free one."""
    profile = Curve([[20, 0, 0], [26, 0, 8], [22, 0, 15], [30, 0, 30]], (0.4, -0.7))
    quarter, half = Rotation(profile, *AXIS, 90), Rotation(profile, *AXIS, 180, 90)
    rim = Curve([[20, 0, 0], [20, 20, 0], [0, 20, 0]])
    top = np.array([[30, 0, 30], [30, 30, 30], [0, 30, 30]])
    flange = np.stack([top, top * [1.2, 1.2, 1] + [0, 0, 4], top * [1.5, 1.6, 1.1]])
    return [
        quarter,
        backwards(Restricted(half, ((0, 1), (0, 0.5))), "v"),
        Ruled(rim.transformed(np.eye(3) * [1.5, 1.5, 1]), rim),
        Surface(flange, (0.1, 0.9)).transposed(),
    ]


def coons() -> list[SeparableSurface]:
    """A Coons patch in a hole between two surfaces of other degrees and design variables."""
    rng = np.random.default_rng(4)
    x, y = np.meshgrid(np.linspace(0, 40, 5), np.linspace(0, 30, 4), indexing="ij")
    left = Surface(np.stack([x, y, rng.normal(0, 4, x.shape)], axis=-1), (0.2, -0.9), (0.5, 0.6))
    right = Surface(np.stack([x[:3] + 90, y[:3], rng.normal(0, 4, (3, 4))], axis=-1), (-0.2, 0.1), (-0.4, 1))
    one, other = left.boundary("u1"), right.boundary("u0")
    low, high = (line(one.evaluate(v).tolist(), other.evaluate(v).tolist()) for v in (0.0, 1.0))
    return [left, Coons(low, high, one, other), right.reversed("v")]


QUILTS: dict[str, Callable[[], list[SeparableSurface]]] = {
    "box": lambda: random_box(1),
    "box, other turns": lambda: random_box(2),
    "torus": lambda: torus(40, 10),
    "can": lambda: can(30, 50),
    "ball": lambda: ball(25),
    "ball, one half backwards": lambda: [ball(25)[0], backwards(ball(25)[1], "v")],
    "mixed kinds": mixed_seam,
    "Coons patch": coons,
    "two tubes": lambda: [*torus(40, 10), Rotation(circle(3, 80), *AXIS, 200)],
    "plane sheet": lambda: [patch.transformed(np.eye(2, 3)) for patch in sheet(np.random.default_rng(2), (2, 2), 1)[0]],
    "one patch": lambda: list(sheet(np.random.default_rng(3), (1, 1), 1)[0]),
}


def fitted(patches: list[SeparableSurface], tolerance: float = 1e-4, order: str = "C0", adapt: bool = True) -> QuiltFit:
    return fit_quilt(Quilt.recognised(patches, order=order), tolerance=tolerance, adapt=adapt)


def assert_no_gaps(fit: QuiltFit) -> None:
    """Edges, corners and collapsed sides are equal to the last bit."""
    for edge in fit.quilt.edges:
        one, other = (fit.splines[use.patch].boundary(use.side) for use in edge.uses)
        turn = slice(None, None, -1) if edge.reversed else slice(None)
        assert one.degree == other.degree
        assert one.multiplicities == other.multiplicities[turn]
        assert np.array_equal(one.control_points, other.control_points[turn])
        assert np.array_equal(one.knots, 1 - other.knots[turn] if edge.reversed else other.knots)
    for use in fit.quilt.collapsed:
        poles = fit.splines[use.patch].boundary(use.side).control_points
        assert (poles == poles[0]).all()
    nets = [spline.control_points for spline in fit.splines]
    corners = np.concatenate([net[[0, 0, -1, -1], [0, -1, 0, -1]] for net in nets])
    size = np.abs(corners).max()
    for corner in corners:
        near = corners[np.linalg.norm(corners - corner, axis=1) < 1e-6 * size]
        assert (near == corner).all()


def assert_proved(fit: QuiltFit, tolerance: float) -> None:
    """What is seen at many places lies within the proof, and comes near its lower bound."""
    t = np.linspace(0, 1, 113)
    for patch, spline, (lower, upper) in zip(fit.quilt.patches, fit.splines, fit.deviations, strict=True):
        difference = patch.evaluate(t[:, None], t[None, :]) - spline.evaluate(t[:, None], t[None, :])
        seen = float(np.linalg.norm(difference, axis=-1).max())
        assert 0.7 * lower - 1e-12 <= seen <= upper <= tolerance
        assert lower <= upper
    assert fit.deviation == (max(d[0] for d in fit.deviations), max(d[1] for d in fit.deviations))


@pytest.mark.parametrize("name", QUILTS)
@pytest.mark.parametrize("tolerance", [1e-1, 1e-4, 1e-8])
def test_quilts_have_no_gaps_and_keep_the_tolerance(name: str, tolerance: float) -> None:
    fit = fitted(QUILTS[name](), tolerance)
    assert len(fit.splines) == len(fit.quilt.patches)
    assert_no_gaps(fit)
    assert_proved(fit, tolerance)


@pytest.mark.parametrize("name", ["box", "mixed kinds", "ball"])
def test_knots_that_stay_where_they_are(name: str) -> None:
    fit = fitted(QUILTS[name](), adapt=False)
    assert_no_gaps(fit)
    assert_proved(fit, 1e-4)


def test_knots_that_move_save_poles() -> None:
    moved, fixed = (fitted(random_box(1), adapt=adapt).splines for adapt in (True, False))
    assert sum(one.control_points.size for one in moved) < sum(one.control_points.size for one in fixed)


@pytest.mark.parametrize(("name", "edges"), [("mixed kinds", 3), ("Coons patch", 2)])
def test_the_mixed_quilts_are_what_they_say(name: str, edges: int) -> None:
    assert len(Quilt.recognised(QUILTS[name]()).edges) == edges


def test_directions_that_are_polynomial_in_all_patches_stay_so() -> None:
    fit = fitted(can(30, 50))
    assert [spline.degree_u for spline in fit.splines] == [1, 1, 1]
    prism = box(np.random.default_rng(0), degree=2, noise=0)
    fit = fitted([Surface(face.control_points, family_u=BERNSTEIN, family_v=BERNSTEIN) for face in prism], 1e-9)
    assert {spline.control_points.shape for spline in fit.splines} == {(3, 3, 3)}
    assert_no_gaps(fit)
    assert_proved(fit, 1e-9)


def test_polynomial_degrees_that_differ_in_one_strip() -> None:
    cubic, middle = Curve([[0, 0, 0], [3, 9, 0], [7, 0, 5], [10, 0, 0]], family=BERNSTEIN), line([0, 0, 9], [10, 0, 9])
    fit = fitted([Ruled(cubic, middle), Ruled(middle.transformed(np.eye(3), [0, 5, 5]), middle)], 1e-9)
    assert {(spline.degree_u, spline.degree_v) for spline in fit.splines} == {(3, 1)}
    assert_no_gaps(fit)
    assert_proved(fit, 1e-9)


# Joins


def across(spline: BSplineSurface, turn: Turn, direction: str, end: float, t: Array, order: int) -> Array:
    """Derivative across a side, in the parameters that the patch had before it was turned."""
    net = NdBSpline(
        (spline.flat_knots_u, spline.flat_knots_v), spline.control_points, (spline.degree_u, spline.degree_v)
    )
    places, orders = [np.full_like(t, end), t], [order, 0]
    if direction == "v":
        places, orders = places[::-1], orders[::-1]
    places = [1 - place if back else place for place, back in zip(places, turn[:2], strict=True)]
    sign = (-1) ** sum(k for k, back in zip(orders, turn[:2], strict=True) if back)
    if turn[2]:
        places, orders = places[::-1], orders[::-1]
    return np.asarray(sign * net(np.stack(places, axis=-1), nu=orders))


def join_errors(
    first: tuple[BSplineSurface, Turn], second: tuple[BSplineSurface, Turn], direction: str, rule: Array
) -> Array:
    """How far each order of the join is from its rule, relative to the derivatives of that order."""
    t = np.linspace(0, 1, 41)
    before = np.array([across(*first, direction, 1.0, t, r) for r in range(len(rule))])
    after = np.array([across(*second, direction, 0.0, t, r) for r in range(len(rule))])
    difference = np.abs(after - np.tensordot(rule, before, 1)).max(axis=(1, 2))
    return np.asarray(difference / (np.abs(rule) @ np.abs(before).max(axis=(1, 2))))


def sheet_errors(fit: QuiltFit, turns: list[Turn], shape: tuple[int, int], rules: tuple[list[Array], ...]) -> Array:
    """The largest of all joins of a sheet."""
    pieces = list(zip(fit.splines, turns, strict=True))
    found = []
    for i, j in itertools.product(*map(range, shape)):
        here = i * shape[1] + j
        if i + 1 < shape[0]:
            found.append(join_errors(pieces[here], pieces[here + shape[1]], "u", rules[0][i]))
        if j + 1 < shape[1]:
            found.append(join_errors(pieces[here], pieces[here + 1], "v", rules[1][j]))
    return np.asarray(np.max(found, axis=0))


ROUNDING = np.array([1e-13, 1e-11, 1e-9, 1e-7])  # of derivatives of splines at their ends, by order


def check_joins(seed: int, order: int, shape: tuple[int, int] | None = None, parametric: bool = False) -> None:
    rng = np.random.default_rng(seed)
    shape = shape or tuple(rng.integers(2, 5, 2).tolist())
    patches, *rules = sheet(rng, shape, order, parametric=parametric)
    turns = random_turns(rng, len(patches))
    kind = "C" if parametric else "G"
    fit = fitted([turned(patch, turn) for patch, turn in zip(patches, turns, strict=True)], order=f"{kind}{order}")
    assert_no_gaps(fit)
    assert all(upper <= 1e-4 for _, upper in fit.deviations)
    assert (sheet_errors(fit, turns, shape, tuple(rules)) < ROUNDING[: order + 1]).all()


@pytest.mark.parametrize("order", [1, 2, 3])
@pytest.mark.parametrize("seed", range(2))
def test_sheets_stay_joined_along_their_edges(order: int, seed: int) -> None:
    check_joins(seed, order)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_sheets_joined_by_equal_derivatives(order: int) -> None:
    check_joins(7, order, (2, 2), parametric=True)


def test_without_the_order_the_join_is_lost() -> None:
    patches, *rules = sheet(np.random.default_rng(0), (2, 2), 2)
    fit = fitted(list(patches), order="C0")
    errors = sheet_errors(fit, [STRAIGHT] * 4, (2, 2), tuple(rules))
    assert errors[0] < 1e-13
    assert (errors[1:] > 1e-6).all()


@pytest.mark.parametrize("turn", [STRAIGHT, (True, False, False), (True, True, True)])
def test_an_order_holds_at_the_end_where_it_is_wanted(turn: Turn) -> None:
    patches, rules, _ = sheet(np.random.default_rng(6), (2, 2), 2)
    turns = [STRAIGHT, turn, STRAIGHT, turn]
    first = Use(1, {STRAIGHT: "u1", (True, False, False): "u0", (True, True, True): "v0"}[turn])
    laid = [turned(patch, one) for patch, one in zip(patches, turns, strict=True)]
    fit = fit_quilt(Quilt.recognised(laid, order={first: "G2"}), tolerance=1e-4)
    pieces = list(zip(fit.splines, turns, strict=True))
    assert (join_errors(pieces[1], pieces[3], "u", rules[0]) < ROUNDING[:3]).all()


def test_a_seam_stays_smooth() -> None:
    fit = fitted(torus(40, 10), order="C3")
    for direction, r in itertools.product("uv", (1, 2, 3)):
        start, end = (across(fit.splines[0], STRAIGHT, direction, at, np.linspace(0, 1, 30), r) for at in (0.0, 1.0))
        assert np.abs(start - end).max() < 1e-9 * np.abs(start).max()


def test_orders_cost_poles_only_where_they_are_wanted() -> None:
    patches = sheet(np.random.default_rng(2), (1, 3), 3)[0]
    some = fit_quilt(Quilt.recognised(patches, order={Use(2, "v0"): "G3"}), tolerance=1e-4).splines
    none = fitted(list(patches)).splines
    assert np.array_equal(some[0].control_points, none[0].control_points)
    assert all(a.control_points.shape[0] == b.control_points.shape[0] for a, b in zip(some, none, strict=True))
    assert some[2].control_points.shape[1] > none[2].control_points.shape[1]


# Limits


def stated(gap: float, first: int = 0) -> Quilt:
    uses = Use(0, "v1"), Use(1, "v0")
    return Quilt.recognised(apart(gap), stated=[SharedEdge(uses[first], uses[1 - first], False)], gap=1)


@pytest.mark.parametrize("gap", [0.0, 1e-7, 5e-4])
@pytest.mark.parametrize("first", [0, 1])
def test_a_stated_gap_is_closed_by_the_first_side(gap: float, first: int) -> None:
    fit = fit_quilt(stated(gap, first), tolerance=1e-3)
    assert_no_gaps(fit)
    assert_proved(fit, 1e-3)
    assert fit.deviations[1 - first][1] > gap
    patch = fit.quilt.patches[first]
    for u, v in itertools.product((0, 1), (0, 1)):  # the corners are its own
        np.testing.assert_allclose(fit.splines[first].evaluate(u, v), patch.evaluate(u, v), rtol=0, atol=1e-13)


@pytest.mark.parametrize("gap", [1e-3 * (1 - 1e-9), 2e-3])
def test_a_gap_that_the_tolerance_does_not_allow_is_refused(gap: float) -> None:
    with pytest.raises(ToleranceNotMet) as caught:
        fit_quilt(stated(gap), tolerance=1e-3)
    assert caught.value.requested == 1e-3
    assert caught.value.achieved > 1e-3


def test_too_few_spans_are_refused() -> None:
    quilt = Quilt.recognised(random_box(1), names="abcdef")
    with pytest.raises(ToleranceNotMet, match=r"max_spans = 2 in each direction, at [a-f]") as caught:
        fit_quilt(quilt, tolerance=1e-6, max_spans=2)
    assert caught.value.achieved > 1e-6
    assert fit_quilt(quilt, tolerance=caught.value.achieved * 1.5, max_spans=2).deviation[1] > 1e-6


def test_a_tolerance_below_precision_is_refused() -> None:
    with pytest.raises(ToleranceBelowPrecision):
        fitted(random_box(1), 1e-14)


@pytest.mark.parametrize("continuity", [0, 2])
def test_continuity_at_knots(continuity: int) -> None:
    fit = fit_quilt(Quilt.recognised(random_box(1)), tolerance=1e-6, continuity=continuity)
    assert_no_gaps(fit)
    assert_proved(fit, 1e-6)
    assert {m for spline in fit.splines for m in spline.multiplicities_u[1:-1]} == {5 - continuity}


@pytest.mark.parametrize("degree", [3, 8])
def test_degrees(degree: int) -> None:
    fit = fit_quilt(Quilt.recognised(random_box(1)), tolerance=1e-4, degree=degree)
    assert {(spline.degree_u, spline.degree_v) for spline in fit.splines} == {(degree, degree)}
    assert_no_gaps(fit)
    assert_proved(fit, 1e-4)


def test_the_degree_that_needs_the_fewest_poles() -> None:
    quilt = Quilt.recognised(random_box(1))
    fit = fit_quilt(quilt, tolerance=1e-6, degree="auto", max_degree=9)
    assert_no_gaps(fit)
    assert_proved(fit, 1e-6)
    assert max(max(spline.degree_u, spline.degree_v) for spline in fit.splines) <= 9
    counts = {
        degree: sum(one.control_points.size for one in fit_quilt(quilt, tolerance=1e-6, degree=degree).splines)
        for degree in (3, 5)
    }
    assert sum(one.control_points.size for one in fit.splines) < min(counts.values())


def test_bad_arguments_are_refused() -> None:
    quilt = Quilt.recognised(torus(4, 1))
    for tolerance in (0, -1, np.inf, np.nan):
        with pytest.raises(InputError, match="tolerance must be a finite number above 0"):
            fit_quilt(quilt, tolerance=tolerance)
    for degree in (2, 26, 3.5):
        with pytest.raises(InputError, match=r"degree must be a whole number in \[3, 25\] or"):
            fit_quilt(quilt, tolerance=1, degree=degree)  # type: ignore[arg-type]
    for continuity in (-1, 5):
        with pytest.raises(InputError, match=r"continuity must be a whole number in \[0, 4\]"):
            fit_quilt(quilt, tolerance=1, continuity=continuity)
    with pytest.raises(InputError, match=r"max_degree must be a whole number in \[3, 25\], got 26"):
        fit_quilt(quilt, tolerance=1, degree="auto", max_degree=26)
    with pytest.raises(InputError, match="max_spans must be 1 or more, got 0"):
        fit_quilt(quilt, tolerance=1, max_spans=0)
    smooth = Quilt.recognised(torus(4, 1), order="C3")
    with pytest.raises(
        InputError, match=r"max_spans = 1 and degree up to 5 give 6 poles at most, and joins of orders \(3, 3\)"
    ):
        fit_quilt(smooth, tolerance=1, max_spans=1)


@pytest.mark.stress
@pytest.mark.parametrize("seed", range(200))
def test_random_sheets(seed: int) -> None:
    check_joins(1000 + seed, 1 + seed % 3, parametric=seed % 5 == 0)


@pytest.mark.stress
@pytest.mark.parametrize("seed", range(100))
def test_random_boxes(seed: int) -> None:
    fit = fitted(random_box(seed), 10.0 ** -(seed % 8))
    assert_no_gaps(fit)
    assert_proved(fit, 10.0 ** -(seed % 8))
