from __future__ import annotations

import math
from dataclasses import dataclass

import mpmath as mp
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from gtcad import BERNSTEIN, GT, Curve, Restricted, Surface, differential
from gtcad._sides import SeparableSide
from gtcad.basis import Basis
from gtcad.continuity import Start, Thresholds, check_join, join_curve
from gtcad.converters import fit_surface
from gtcad.converters.bspline import BSplineSurface
from gtcad.errors import InputError, SingularJoin
from gtcad.factors import SurfaceOfTerms, Waves
from gtcad.patch_joins import check_edge, join_patch, join_patch_nearest, joined_sheet
from gtcad.patches.rotation import Rotation
from gtcad.patches.ruled import cylinder
from gtcad.protocol import SIDES
from tests import pieces

ORDERS = ("C1", "C2", "C3", "G1", "G2", "G3")
OPPOSITE = {"u0": "u1", "u1": "u0", "v0": "v1", "v1": "v0"}
SQUARE = Surface([[[0, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 0]]], family_u=BERNSTEIN, family_v=BERNSTEIN)


@dataclass(frozen=True)
class Case:
    old: Surface
    new: Surface
    side: str
    order: str
    scale: tuple[float, float, float]

    def report(self):
        return check_edge(self.old, self.side, self.new, OPPOSITE[self.side])


def well_determined(old, side, basis, order):
    """Whether neither the new rows nor the old derivatives lose digits, as they do near a vanishing tangent."""
    across = old.factors_u if side[0] == "u" else old.factors_v
    tangents = np.abs(across.derivative(float(side[1]))).max(), np.abs(basis.derivative(0.0)).max()
    return min(*tangents, *Start.of(basis, order).conditioning) > 0.05


def random_basis(rng, least=1):
    family = BERNSTEIN if rng.random() < 0.25 else GT
    degree = int(rng.integers(max(least, family.minimum_degree), 9))
    return Basis(degree, pieces.random_gamma(rng) if family is GT else (0.0, 0.0), family)


def random_case(rng, order, side):
    """A patch, and one joined to it with random rows."""
    kind, k = order[0], int(order[1])
    u, v = random_basis(rng), random_basis(rng)
    net = rng.normal(0, 10, (u.count, v.count, 3))
    net[..., :2] += np.stack(np.meshgrid(np.linspace(0, 100, u.count), np.linspace(0, 80, v.count), indexing="ij"), -1)
    old = Surface(net, u.gamma, v.gamma, u.family, v.family)
    new = random_basis(rng, k)
    scale = (1.0, 0.0, 0.0)
    if kind == "G":
        scale = (math.exp(rng.normal(0, 0.4)), float(rng.normal()), float(rng.normal()))
    rest = rng.normal(0, 40, (new.degree - k, (v if side[0] == "u" else u).count, 3))
    options = {"order": order, "gamma": new.gamma, "scale": scale, "rest": rest, "family": new.family}
    try:
        if not well_determined(old, side, new, k):
            return None
        return Case(old, join_patch(old, side, new.degree, **options), side, order, scale)
    except SingularJoin:
        return None


def assert_joined(case):
    k, report = int(case.order[1]), case.report()
    assert case.old.boundary(case.side) == case.new.boundary(OPPOSITE[case.side])
    assert report.proved
    assert not report.reversed
    assert report.gap[1] <= 1e-12 * np.abs(case.new.control_points).max()
    assert max(report.residuals[:k]) < 1e-11
    assert report.scale[:k] == pytest.approx(case.scale[:k], rel=1e-7, abs=1e-7)
    assert report.meets(case.order)


@pytest.mark.parametrize("order", ORDERS)
@given(seed=st.integers(0, 10**9), side=st.sampled_from(SIDES))
@settings(max_examples=12)
def test_neighbours_join_along_the_whole_edge(order, side, seed):
    case = random_case(np.random.default_rng(seed), order, side)
    assume(case is not None)
    assert_joined(case)


@pytest.mark.stress
@pytest.mark.parametrize("order", ORDERS)
def test_neighbours_join_along_the_whole_edge_stress(order):
    rng = np.random.default_rng(21)
    made = 0
    while made < 1000:
        case = random_case(rng, order, str(rng.choice(SIDES)))
        if case is not None:
            assert_joined(case)
            made += 1


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("order", ORDERS)
def test_points_follow_the_reparametrised_taylor_series(order, side):
    """By values alone: new(x) - old(1 + eta x + psi x^2/2 + omega x^3/6) is of order x^(k+1), old continued in u.

    The old patch being polynomial, its control points on [1, 2] are found by interpolation.
    """
    k = int(order[1])
    scale = (1.0, 0.0, 0.0) if order[0] == "C" else (0.8, 0.5, -0.4)
    rng = np.random.default_rng(5)
    old = Surface(rng.normal(size=(4, 4, 3)), family_u=BERNSTEIN, family_v=BERNSTEIN)
    new = join_patch(
        old, side, 5, order=order, gamma=(0.3, -0.2), scale=scale, rest=rng.normal(size=(5 - k, 4, 3)), family=GT
    )
    x = np.array([0.02, 0.01])
    y = np.linspace(0, 1, 5)
    walked = scale[0] * x + scale[1] * x**2 / 2 + scale[2] * x**3 / 6
    at = walked + 1 if side[1] == "1" else -walked
    taken = np.linspace(0, 1, 4)
    lines = np.array([[np.prod([(p - q) / (r - q) for q in taken if q != r]) for r in taken] for p in at])
    inside = x if side[1] == "1" else 1 - x
    if side[0] == "u":
        continued = np.einsum("xr,ryd->xyd", lines, old.evaluate(taken[:, None], y[None, :]))
        difference = new.evaluate(inside[:, None], y[None, :]) - continued
    else:
        continued = np.einsum("xr,yrd->xyd", lines, old.evaluate(y[:, None], taken[None, :]))
        difference = new.evaluate(y[:, None], inside[None, :]).swapaxes(0, 1) - continued
    ratio = np.abs(difference[0]).max() / np.abs(difference[1]).max()
    assert 2**k * 1.5 < ratio < 2 ** (k + 1) * 1.3


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("order", ORDERS)
def test_a_moved_row_is_seen(order, side):
    """A row k that is off by 1e-3 leaves order k - 1."""
    k = int(order[1])
    rng = np.random.default_rng([ORDERS.index(order), SIDES.index(side)])
    old = pieces.random_surface(rng, (5, 4), 100.0)
    old = Surface(old.control_points, (0.2, 0.4), (-0.3, 0.1))
    count = old.control_points.shape[1 if side[0] == "u" else 0]
    scale = (1.0, 0.0, 0.0) if order[0] == "C" else (1.2, 0.3, -0.2)
    new = join_patch(
        old, side, 5, order=order, gamma=(0.2, 0.3), scale=scale, rest=rng.normal(0, 50, (5 - k, count, 3))
    )
    net = np.array(new.control_points if side[0] == "u" else new.control_points.swapaxes(0, 1))
    net[k if side[1] == "1" else -k - 1] += rng.normal(0, 0.05, (count, 3))
    net = net if side[0] == "u" else net.swapaxes(0, 1)
    report = check_edge(old, side, Surface(net, new.gamma_u, new.gamma_v), OPPOSITE[side])
    assert report.order == f"{order[0] if k > 1 else 'C'}{k - 1}"
    assert report.residuals[k - 1] > 1e-6
    assert max(report.residuals[: k - 1], default=0) < 1e-11


@pytest.mark.parametrize("side", SIDES)
def test_a_strip_joins_like_the_curves_across_it(side):
    """Every row of control points obeys the curves' own rule."""
    rng = np.random.default_rng(8)
    old = pieces.random_surface(rng, (4, 3), 10.0)
    turned = old if side[0] == "u" else old.transposed()
    turned = turned if side[1] == "1" else turned.reversed("u")
    count = turned.control_points.shape[1]
    rest = rng.normal(size=(3, count, 3))
    options = {"order": "G2", "gamma": (0.4, -0.1), "scale": (1.3, 0.2, 0.0)}
    new = join_patch(old, side, 5, rest=rest, **options)
    across = new if side[0] == "u" else new.transposed()
    across = across if side[1] == "1" else across.reversed("u")
    for j in range(count):
        line = Curve(turned.control_points[:, j], turned.gamma_u)
        wanted = join_curve(line, 5, rest=rest[:, j], **options)
        np.testing.assert_allclose(across.control_points[:, j], wanted.control_points, rtol=0, atol=1e-11)


def test_other_shapes_are_continued_where_they_have_a_basis_along_the_edge():
    """A quarter of a cylinder continued along its axis by a cylinder."""
    tube = Rotation(Curve([[2, 0, 0], [2, 0, 3]], family=BERNSTEIN), [0, 0, 0], [0, 0, 1], 90)
    new = join_patch(tube, "u1", 1, order="C1", family=BERNSTEIN)
    points = new.evaluate(np.linspace(0, 1, 4)[:, None], np.linspace(0, 1, 9)[None, :])
    np.testing.assert_allclose(np.hypot(points[..., 0], points[..., 1]), 2, rtol=1e-14)
    assert points[-1, 0, 2] == pytest.approx(6, rel=1e-14)
    wide = Rotation(Curve([[2, 0, 0], [2, 0, 3]], family=BERNSTEIN), [0, 0, 0], [0, 0, 1], 180)
    with pytest.raises(InputError, match="must be a Basis, got Waves"):
        join_patch(wide, "u1", 1, order="C1", family=BERNSTEIN)


def test_plane_patches_join():
    old = Surface(pieces.random_surface(np.random.default_rng(2), (3, 2), 1.0).control_points[..., :2])
    new = join_patch(old, "v1", 2, order="G1", scale=(2.0, 0.0, 0.0), rest=[[[x, 3] for x in (0, 0.3, 0.6, 1)]])
    assert new.dimension == 2
    report = check_edge(old, "v1", new, "v0")
    assert (report.parametric_order, report.geometric_order) == (0, 3)  # nothing bends
    assert report.residuals[0] < 1e-13


@pytest.mark.parametrize(
    ("degree", "gamma", "order"),
    [(2, (-1.0, 0.3), "G1"), (2, (0.3, 1.0), "G2"), (3, (-1.0, 1.0), "C2"), (2, (0.1, 0.2), "C3"), (4, (-1, 1), "C3")],
)
def test_undetermined_rows_are_refused(degree, gamma, order):
    old = pieces.random_surface(np.random.default_rng(1), (3, 3), 1.0)
    with pytest.raises(SingularJoin, match=f"degree {degree}") as caught:
        join_patch(old, "u1", degree, order=order, gamma=gamma)
    assert caught.value.conditioning < 1e-10


def test_a_side_without_a_derivative_across_is_refused():
    net = np.array(pieces.random_surface(np.random.default_rng(1), (3, 3), 1.0).control_points)
    net[-2] = net[-1]
    old = Surface(net, (0.1, 0.2), (0.3, 0.4))
    with pytest.raises(SingularJoin, match="no derivative across its side u1"):
        join_patch(old, "u1", 3, order="G1", rest=np.zeros((2, 4, 3)))
    assert join_patch(old, "u1", 2, order="C0", rest=np.zeros((2, 4, 3))).boundary("u0") == old.boundary("u1")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"order": "C4"}, "order must be one of"),
        ({"side": "w1"}, "side must be"),
        ({"order": "C1", "scale": (2.0, 0.0, 0.0)}, "scale is for G joins"),
        ({"scale": (-1.0, 0.0, 0.0)}, "eta > 0"),
        ({"scale": (1.0, math.nan, 0.0)}, "finite"),
        ({"rest": [[[0, 0, 0]]]}, r"rest must have shape \(2, 2, 3\)"),
        ({"rest": [[1, 2], [3]]}, r"rest must be numbers"),
        ({"scale": 2.0}, "three finite numbers"),
        ({"gamma": (0.5,)}, "gamma must be two"),
        ({"rest": ()}, r"rest must have shape \(2, 2, 3\)"),
        ({"gamma": (0.0, 2.0)}, "gamma"),
        ({"degree": 61}, "degree"),
    ],
)
def test_bad_arguments_of_a_join(options, message):
    arguments = {"side": "u1", "degree": 3, "order": "G1", "rest": np.zeros((2, 2, 3)), **options}
    with pytest.raises(InputError, match=message):
        join_patch(SQUARE, arguments.pop("side"), arguments.pop("degree"), **arguments)


# The nearest neighbour


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("order", ["G1", "G2", "G3", "C2"])
def test_a_wanted_patch_that_joins_stays(order, side):
    rng = np.random.default_rng(13)
    old = Surface(pieces.random_surface(rng, (4, 3), 100.0).control_points, (0.1, -0.4), (0.6, 0.2))
    count = old.control_points.shape[1 if side[0] == "u" else 0]
    k = int(order[1])
    scale = (1.0, 0.0, 0.0) if order[0] == "C" else (0.7, 0.4 * (k > 1), -0.3 * (k > 2))
    rest = rng.normal(0, 50, (5 - k, count, 3))
    wanted = join_patch(old, side, 5, order=order, gamma=(0.2, 0.3), scale=scale, rest=rest)
    found, factors = join_patch_nearest(old, side, wanted, order)
    np.testing.assert_allclose(found.control_points, wanted.control_points, rtol=0, atol=1e-4)
    assert factors == pytest.approx(scale, abs=1e-5)


def test_no_other_scale_factors_come_nearer():
    rng = np.random.default_rng(14)
    old = Surface(pieces.random_surface(rng, (4, 3), 100.0).control_points, (0.1, -0.4), (0.6, 0.2))
    rest = rng.normal(0, 30, (3, 4, 3)) + [150, 40, 0]
    close = join_patch(old, "u1", 5, order="G2", gamma=(0.2, 0.1), scale=(0.9, 0.5, 0), rest=rest)
    wanted = Surface(close.control_points + rng.normal(0, 2, close.control_points.shape), close.gamma_u, old.gamma_v)
    found, scale = join_patch_nearest(old, "u1", wanted, "G2")
    assert check_edge(old, "u1", found, "u0").order == "G2"
    np.testing.assert_array_equal(found.control_points[3:], wanted.control_points[3:])

    def moved(patch):
        return float(((patch.control_points - wanted.control_points) ** 2).sum())

    for change in ((1e-3, 0, 0), (-1e-3, 0, 0), (0, 1e-3, 0), (0, -1e-3, 0)):
        other = (scale[0] + change[0], scale[1] + change[1], 0.0)
        rest = wanted.control_points[3:]
        assert moved(join_patch(old, "u1", 5, order="G2", gamma=(0.2, 0.1), scale=other, rest=rest)) > moved(found)


def test_a_wanted_patch_must_have_the_basis_of_the_edge():
    with pytest.raises(InputError, match="wanted must be a Surface, got Curve"):
        join_patch_nearest(SQUARE, "u1", SQUARE.boundary("u1"), "G1")
    with pytest.raises(InputError, match="surface must be a surface of the protocol, got Curve"):
        join_patch(SQUARE.boundary("u1"), "u1", 2, order="C0")
    with pytest.raises(InputError, match="basis of the edge"):
        join_patch_nearest(SQUARE, "u1", pieces.random_surface(np.random.default_rng(1), (3, 3), 1.0), "G1")


# Sheets


def random_sheet(rng, order, m, n):
    k = int(order[1])
    gammas = [[tuple(rng.uniform(-0.8, 0.8, 2)) for _ in range(count)] for count in (m, n)]
    degrees = [rng.integers(max(3, k), 9, count) for count in (m, n)]
    scales = [
        [
            (1.0, 0.0, 0.0) if order[0] == "C" else (math.exp(rng.normal(0, 0.3)), rng.normal(), rng.normal())
            for _ in range(count - 1)
        ]
        for count in (m, n)
    ]
    drawn = [
        [
            Surface(
                pieces.random_surface(rng, (degrees[0][i], degrees[1][j]), 100.0).control_points + [100 * i, 80 * j, 0],
                gammas[0][i],
                gammas[1][j],
            )
            for j in range(n)
        ]
        for i in range(m)
    ]
    sheet = joined_sheet(drawn, [order] * (m - 1), [order] * (n - 1), scales_u=scales[0], scales_v=scales[1])
    return drawn, sheet, scales


def interior_edges(sheet):
    for i, row in enumerate(sheet):
        for j, patch in enumerate(row):
            if i + 1 < len(sheet):
                yield patch, "u1", sheet[i + 1][j], ("u", i)
            if j + 1 < len(row):
                yield patch, "v1", row[j + 1], ("v", j)


def assert_sheet(rng, order, m, n):
    _, sheet, scales = random_sheet(rng, order, m, n)
    k = int(order[1])
    for old, side, new, (direction, line) in interior_edges(sheet):
        assert old.boundary(side) == new.boundary(OPPOSITE[side])
        report = check_edge(old, side, new, OPPOSITE[side])
        assert max(report.residuals[:k]) < 2e-11
        assert report.meets(order)
        wanted = scales["uv".index(direction)][line]
        assert report.scale[:k] == pytest.approx(wanted[:k], abs=1e-6)


@pytest.mark.parametrize("order", ORDERS)
def test_sheets_join_along_every_interior_edge(order):
    assert_sheet(np.random.default_rng(ORDERS.index(order)), order, 3, 2)


@pytest.mark.stress
@pytest.mark.parametrize("order", ORDERS)
def test_sheets_join_along_every_interior_edge_stress(order):
    rng = np.random.default_rng(31)
    for _ in range(200):
        assert_sheet(rng, order, int(rng.integers(2, 5)), int(rng.integers(2, 5)))


def test_a_sheet_around_a_vertex_built_patch_by_patch_closes():
    """With one set of factors for each line the fourth patch follows from either neighbour."""
    rng = np.random.default_rng(4)
    corner = Surface(pieces.random_surface(rng, (3, 4), 10.0).control_points, (0.1, 0.3), (-0.2, 0.4))
    lines = {"u1": ((1.3, 0.4, -0.2), (0.2, -0.5)), "v1": ((0.8, -0.3, 0.5), (-0.1, 0.6))}

    def next_to(patch, side, rest=None):
        scale, gamma = lines[side]
        count = patch.control_points.shape[1 if side == "u1" else 0]
        rest = rng.normal(size=(2, count, 3)) if rest is None else rest
        return join_patch(patch, side, 5, order="G3", gamma=gamma, scale=scale, rest=rest)

    right, upper = next_to(corner, "u1"), next_to(corner, "v1")
    fourth = next_to(right, "v1")
    other = next_to(upper, "u1")
    np.testing.assert_allclose(fourth.control_points[:4, :4], other.control_points[:4, :4], rtol=0, atol=1e-9)


def test_a_sheet_that_joins_stays_and_the_nearest_is_orthogonal():
    rng = np.random.default_rng(6)
    drawn, sheet, scales = random_sheet(rng, "G2", 2, 3)
    again = joined_sheet(sheet, ["G2"], ["G2"] * 2, scales_u=scales[0], scales_v=scales[1])
    other = random_sheet(rng, "G2", 2, 3)[0]
    other = [[Surface(rng.normal(size=p.control_points.shape), p.gamma_u, p.gamma_v) for p in row] for row in drawn]
    tangent = joined_sheet(other, ["G2"], ["G2"] * 2, scales_u=scales[0], scales_v=scales[1])
    product = 0.0
    for i in range(2):
        for j in range(3):
            one = sheet[i][j].control_points
            np.testing.assert_allclose(again[i][j].control_points, one, rtol=0, atol=1e-9)
            product += float(((drawn[i][j].control_points - one) * tangent[i][j].control_points).sum())
    assert abs(product) < 1e-8


def test_bad_arguments_of_a_sheet():
    strange = Surface(SQUARE.control_points[:, [0, 1, 1]], family_u=BERNSTEIN, family_v=BERNSTEIN)
    with pytest.raises(InputError, match=r"patches\[1\]\[0\] must have its strip's basis of v"):
        joined_sheet([[SQUARE], [strange]], ["C0"], [])
    with pytest.raises(InputError, match=r"patches\[0\]\[1\] must be a Surface"):
        joined_sheet([[SQUARE, Curve([[0, 0], [1, 0], [1, 1]])]], [], ["C0"])
    with pytest.raises(InputError, match="equally many"):
        joined_sheet([[SQUARE], [SQUARE, SQUARE]], ["C0"], ["C0"])
    with pytest.raises(InputError, match="orders_u must be one for each of 1 lines"):
        joined_sheet([[SQUARE], [SQUARE]], [], [])
    with pytest.raises(InputError, match="scales_u must be one for each of 1 lines"):
        joined_sheet([[SQUARE], [SQUARE]], ["G1"], [], scales_u=[])
    with pytest.raises(SingularJoin, match="degree 1"):
        joined_sheet([[SQUARE], [SQUARE]], ["C2"], [])


# What check_edge says of surfaces that are known


def test_two_parts_of_one_surface_have_no_seam():
    whole = pieces.random_surface(np.random.default_rng(3), (6, 5), 100.0)
    lower, upper = (Restricted(whole, ((0, 1), part)) for part in ((0.0, 0.4), (0.4, 1.0)))
    report = check_edge(lower, "v1", upper, "v0")
    assert report.order == "G3"
    eta = 0.6 / 0.4
    assert report.scale == pytest.approx((eta, 0, 0), abs=1e-9)
    assert max(report.residuals) < 1e-11
    halves = [Restricted(whole, (part, (0, 1))) for part in ((0.0, 0.5), (0.5, 1.0))]
    assert check_edge(halves[0], "u1", halves[1], "u0").order == "C3"


@pytest.mark.parametrize("flip", [False, True])
def test_edges_that_run_in_opposite_directions(flip):
    whole = pieces.random_surface(np.random.default_rng(3), (4, 5), 100.0)
    lower = Restricted(whole, ((0, 1), (0.0, 0.5)))
    upper = Restricted(whole, ((1, 0), (1.0, 0.5) if flip else (0.5, 1.0)))
    report = check_edge(lower, "v1", upper, "v1" if flip else "v0")
    assert report.reversed
    assert report.order == "C3"
    assert check_edge(lower, "v1", upper, "v1" if flip else "v0", reversed=False).order == "none"


@pytest.mark.parametrize("radius", [0.5, 3.0, 200.0])
def test_a_cylinder_and_the_plane_that_touches_it(radius):
    arc = Curve([[radius, 0], [radius, radius], [0, radius]])
    quarter = cylinder(arc, [0, 0, 5 * radius])
    plane = Surface(
        [[[0, radius, 0], [0, radius, 5 * radius]], [[-radius, radius, 0], [-radius, radius, 5 * radius]]],
        family_u=BERNSTEIN,
        family_v=BERNSTEIN,
    )
    report = check_edge(quarter, "u1", plane, "u0")
    assert report.order == "G1"
    assert report.proved
    assert report.curvature_jump * report.curvature == pytest.approx(1 / radius, rel=1e-12)
    assert report.residuals[0] < 1e-13
    assert report.residuals[1] > 0.1


@pytest.mark.parametrize("radius", [1.0, 50.0])
def test_a_torus_and_the_cylinder_that_continues_it(radius):
    """G1: across the edge the meridian's curvature jumps from 1 / r to 0, along it both have 1 / (R + r)."""
    large = 3 * radius
    meridian = Curve([[large + radius, 0, 0], [large + radius, 0, radius], [large, 0, radius]])
    torus = Rotation(meridian, [0, 0, 0], [0, 0, 1], 360)
    tube = Rotation(
        Curve([[large + radius, 0, -radius], [large + radius, 0, 0]], family=BERNSTEIN), [0, 0, 0], [0, 0, 1], 360
    )
    report = check_edge(tube, "u1", torus, "u0")
    assert report.order == "G1"
    assert report.normal_angle_deg < 1e-10
    assert report.curvature_jump * report.curvature == pytest.approx(1 / radius, rel=1e-11)
    assert not report.reversed


def octant(start):
    """From the equator (u = 0) to the pole (u = 1)."""
    return Rotation(Curve([[2, 0, 0], [2, 0, 2], [0, 0, 2]]), [0, 0, 0], [0, 0, 1], 90, start)


def test_octants_of_a_sphere():
    side_by_side = check_edge(octant(0), "v1", octant(90), "v0")
    assert side_by_side.order == "C3"  # the poles, where there is no normal by derivatives, are left out
    mirrored = octant(0).transformed(np.diag([1.0, 1.0, -1.0]))
    over_the_equator = check_edge(octant(0), "u0", mirrored, "u0")
    assert over_the_equator.order == "C3"
    assert over_the_equator.curvature_jump < 1e-13
    bigger = Rotation(Curve([[2, 0, 0], [2, 0, -4], [0, 0, -4]]), [0, 0, 0], [0, 0, 1], 90)
    ellipsoid = check_edge(octant(0), "u0", bigger, "u0")
    assert ellipsoid.order == "G1"
    assert ellipsoid.curvature * ellipsoid.curvature_jump == pytest.approx(1 / 2 - 2 / 16, rel=1e-12)


@pytest.mark.parametrize("angle", [1e-5, 0.3, 90.0, 135.0, 179.0])
def test_the_angle_of_two_planes(angle):
    t = math.radians(angle)
    other = Surface(
        [[[1, 0, 0], [1, 1, 0]], [[1 + math.cos(t), 0, math.sin(t)], [1 + math.cos(t), 1, math.sin(t)]]],
        family_u=BERNSTEIN,
        family_v=BERNSTEIN,
    )
    report = check_edge(SQUARE, "u1", other, "u0")
    assert report.normal_angle_deg == pytest.approx(angle, rel=1e-9)
    assert report.order == "C0"


def test_a_patch_that_folds_back():
    """The same tangent plane all along, but the second patch lies over the first."""
    back = Surface([[[1, 0, 0], [1, 1, 0]], [[0.5, 0, 0], [0.5, 1, 0]]], family_u=BERNSTEIN, family_v=BERNSTEIN)
    report = check_edge(SQUARE, "u1", back, "u0")
    assert report.normal_angle_deg == pytest.approx(180)
    assert report.scale[0] == pytest.approx(-0.5)
    assert report.order == "C0"


@pytest.mark.parametrize("shift", [0.0, 1e-9, 1e-3, 5.0])
def test_the_gap_of_a_shifted_copy_is_exact(shift):
    whole = pieces.random_surface(np.random.default_rng(7), (6, 5), 100.0)
    lower, upper = (Restricted(whole, ((0, 1), part)) for part in ((0.0, 0.4), (0.4, 1.0)))
    moved = upper.transformed(np.eye(3), [0, 0.6 * shift, 0.8 * shift])
    report = check_edge(lower, "v1", moved, "v0")
    size = np.abs(whole.control_points).max()
    assert report.gap[0] <= shift * (1 + 1e-9) + 1e-15 * size
    assert report.gap[1] >= shift * (1 - 1e-9)
    assert report.gap[1] - report.gap[0] <= 1e-6 * shift + 1e-11 * size
    assert report.order == ("none" if shift > 1e-7 else "G3")


def test_the_gap_is_that_of_edges_sampled_a_thousand_times():
    rng = np.random.default_rng(9)
    a, b = (pieces.random_surface(rng, degrees, 10.0) for degrees in ((3, 5), (4, 7)))
    report = check_edge(a, "u1", b, "u0", reversed=False)
    t = np.linspace(0, 1, 100_001)
    distances = np.linalg.norm(a.boundary("u1").evaluate(t) - b.boundary("u0").evaluate(t), axis=1)
    assert report.gap[0] <= distances.max() * (1 + 1e-12)
    assert distances.max() <= report.gap[1] <= distances.max() * 1.002
    assert abs(report.places[0] - t[distances.argmax()]) < 0.01


@pytest.mark.parametrize("order", ["G1", "G2", "G3"])
def test_cylinders_over_curves_jump_as_the_curves_do(order):
    """Bending only across the edge: the figures are those of the plane curves."""
    first = Curve([[0, 0], [1, 1], [2.5, 1.2], [3, 0]], (0.3, -0.4))
    k = int(order[1])
    second = join_curve(
        first,
        4,
        order=order,
        gamma=(0.1, 0.2),
        scale=(1.2, 0.3, 0.4 * (k > 2)),
        rest=[[6, 1], [5, 4], [4, 2]][k - 1 :] if k > 1 else [[6, 1], [5, 4], [4, 2]],
    )
    curves = check_join(first, second)
    report = check_edge(cylinder(first, [0.3, 0.2, 2]), "u1", cylinder(second, [0.3, 0.2, 2]), "u0")
    straight = check_edge(cylinder(first, [0, 0, 2]), "u1", cylinder(second, [0, 0, 2]), "u0")
    assert report.order == straight.order == curves.order == order
    kappas = [float(differential.signed_curvature(c, t)) for c, t in ((first, 1.0), (second, 0.0))]
    rates = [float(differential.signed_curvature_rate(c, t)) for c, t in ((first, 1.0), (second, 0.0))]
    jump = abs(kappas[1] - kappas[0]) / max(map(abs, kappas))
    assert straight.curvature_jump == pytest.approx(jump, abs=1e-11)
    larger = max(*map(abs, rates), *(kappa**2 for kappa in kappas))
    assert straight.curvature_rate_jump == pytest.approx(abs(rates[1] - rates[0]) / larger, abs=1e-9)


def test_the_figures_do_not_depend_on_the_parametrisation_across():
    """A slanted parametrisation, x -> (x, y + x (1 - x / 2) / 3): G3 with tangential parts, no constant factors."""
    height = lambda x, y: [x, y, 0.3 * x * x - 0.2 * x * y + 0.1 * x**3 + 0.4 * y * y]  # noqa: E731
    grid = np.linspace(0, 1, 7)
    nodes = np.linalg.inv(Basis(6, family=BERNSTEIN).evaluate(grid))

    def patch(function):
        values = np.array([[function(s, t) for t in grid] for s in grid])
        return Surface(np.einsum("ai,bj,ijd->abd", nodes, nodes, values), family_u=BERNSTEIN, family_v=BERNSTEIN)

    left = patch(lambda s, t: height(s - 1, t))
    right = patch(lambda s, t: height(s, t + s * (1 - s / 2) / 3))
    report = check_edge(left, "u1", right, "u0")
    assert report.order == "G3"
    assert report.residuals[0] > 0.1


def test_the_place_of_the_worst_is_found():
    """Two bilinear patches that open like a book towards y = 1."""
    other = Surface([[[1, 0, 0], [1, 1, 0]], [[2, 0, 0], [2, 1, 0.5]]], family_u=BERNSTEIN, family_v=BERNSTEIN)
    report = check_edge(SQUARE, "u1", other, "u0")
    assert report.places[1] == 1.0
    assert report.normal_angle_deg == pytest.approx(math.degrees(math.atan(0.5)), rel=1e-12)


def test_an_edge_that_is_one_point_has_no_tangent_planes():
    net = [[[0, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 0, 0]]]
    triangle = Surface(net, family_u=BERNSTEIN, family_v=BERNSTEIN)
    report = check_edge(triangle, "u1", triangle, "u1")
    assert math.isnan(report.normal_angle_deg)
    assert report.order == "C0"


def test_thresholds_decide():
    whole = pieces.random_surface(np.random.default_rng(7), (4, 4), 100.0)
    moved = whole.transformed(np.eye(3), [0, 0, 1e-3])
    assert check_edge(whole, "u1", moved, "u1").order == "none"
    assert check_edge(whole, "u1", moved, "u1", thresholds=Thresholds(gap=2e-3)).order == "C0"
    assert not check_edge(whole, "u1", moved, "u1").meets("C0")


def test_bad_arguments_of_a_check():
    with pytest.raises(InputError, match="side must be"):
        check_edge(SQUARE, "u2", SQUARE, "u0")
    with pytest.raises(InputError, match="one dimension, got 3 and 2"):
        check_edge(SQUARE, "u1", Surface(SQUARE.control_points[..., :2], (0, 0), (0, 0), BERNSTEIN, BERNSTEIN), "u0")
    with pytest.raises(InputError, match="a surface with a domain and derivatives is wanted, got str"):
        check_edge(SQUARE, "u1", "the other", "u0")
    fast = SurfaceOfTerms(Waves(0, 1.0), Waves(0, 900.0), np.ones((3, 3, 3)))
    with pytest.raises(InputError, match="not resolved"):
        check_edge(fast, "u1", fast, "u0")


# The rounding that proofs rest on


def exact_start(basis, order):
    """Derivatives of a GT basis at 0, from the Taylor series of the closed form."""
    half, (g1, g2), n = mp.pi / 2, map(mp.mpf, basis.gamma), basis.degree - 2
    first = mp.taylor(lambda t: (1 - mp.sin(half * t)) * (1 - g1 * mp.sin(half * t)), 0, order)
    last = mp.taylor(lambda t: (1 - mp.cos(half * t)) * (1 - g2 * mp.cos(half * t)), 0, order)
    middle = [(r == 0) - x - y for r, (x, y) in enumerate(zip(first, last, strict=True))]
    exact = [mp.mpf(0)] * basis.count
    for j, series in enumerate((first, middle, last)):
        for i in range(min(n, order) + 1):
            for r in range(i, min(order, n) + 1):
                power = (-1) ** (r - i) * mp.binomial(n, r) * mp.binomial(r, i)  # of t^r in B_i
                exact[i + j] += power * series[order - r] * math.factorial(order)
    return exact


@pytest.mark.parametrize("degree", [2, 3, 5, 8, 30, 60])
@pytest.mark.parametrize("order", [1, 2, 3])
def test_derivatives_of_a_basis_at_its_ends_have_few_roundings(degree, order):
    for gamma in np.random.default_rng(degree).uniform(-1, 1, (5, 2)).tolist():
        basis = Basis(degree, gamma)
        weights = np.linspace(0.1, 1, basis.count)
        patch = Surface(np.einsum("i,j,k->ijk", weights, [1.0, 1.0], [1.0, 0, 0]), gamma, family_v=BERNSTEIN)
        start = SeparableSide(patch, "u0", outward=False)
        end = SeparableSide(patch.reversed("u"), "u1", outward=False)
        with mp.workdps(40):
            exact = exact_start(basis, order)
            total = sum(mp.mpf(w) * x for w, x in zip(weights.tolist(), exact, strict=True))
            for side in (start, end):
                assert abs(mp.mpf(float(side.coefficients(order)[0, 0])) - total) <= side.rounding(order)
        assert not basis.rows(np.zeros(1), order)[order + 1 :].any()
        assert not basis.rows(np.ones(1), order)[: -order - 1].any()


# Splines


@dataclass(frozen=True)
class Derived:
    """A non-rational spline surface with derivatives of every order."""

    spline: BSplineSurface

    @property
    def domain(self):
        knots = (self.spline.knots_u, self.spline.knots_v)
        return tuple((float(k[0]), float(k[-1])) for k in knots)

    def derivative(self, u, v, orders=(1, 0)):
        from scipy.interpolate import NdBSpline

        s = self.spline
        places = np.stack(np.broadcast_arrays(np.asarray(u, float), np.asarray(v, float)), axis=-1)
        spline = NdBSpline((s.flat_knots_u, s.flat_knots_v), s.control_points, (s.degree_u, s.degree_v))
        return np.asarray(spline(places, nu=orders))


def splines_over_one_basis(patches, end_order):
    """Fits with the same knots along the edge, as patches need whose rows are to stay joined."""
    by_knots = [
        {
            tuple(spline.knots_v): spline
            for tolerance in np.geomspace(1e-3, 1e-6, 10)
            for spline in [
                fit_surface(patch, tolerance=tolerance, end_order=end_order, exact=False, adapt=False).spline
            ]
        }
        for patch in patches
    ]
    knots = next(knots for knots in by_knots[0] if knots in by_knots[1])
    return [splines[knots] for splines in by_knots]


@pytest.mark.parametrize("order", ORDERS)
def test_splines_join_as_the_patches_do(order):
    k = int(order[1])
    rng = np.random.default_rng(ORDERS.index(order))
    old = Surface(pieces.random_surface(rng, (4, 4), 100.0).control_points, (0.1, -0.4), (0.6, 0.2))
    scale = (1.0, 0.0, 0.0) if order[0] == "C" else (1.2, 0.3, -0.2)
    rest = old.control_points[-1] + np.arange(1, 6 - k)[:, None, None] * [40, 0, 0]
    new = join_patch(old, "u1", 5, order=order, gamma=(0.2, 0.1), scale=scale, rest=rest)
    before, after = splines_over_one_basis((old, new), k)
    report = check_edge(Derived(before), "u1", Derived(after), "u0")
    assert not report.proved
    assert report.order == order
    assert max(report.residuals[:k]) < 1e-10
