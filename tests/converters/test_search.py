from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import BSpline

from gtcad import BERNSTEIN, Curve, Surface
from gtcad.chebyshev import nodes
from gtcad.converters.approximation import Bundle, of_kind
from gtcad.converters.exact import polynomial_form
from gtcad.converters.search import Side, fewest, fewest_pair
from tests import pieces

LINE = np.linspace(0, 1, 2001)


def curve_side(curve, degrees=(5,), *, continuity=None, end_order=0, max_spans=4096, polynomial=False):
    bundle = Bundle(curve.factors, curve.coefficients[:, None, :])
    matrix = polynomial_form(curve.factors) if polynomial else None
    return Side(bundle, degrees, continuity, end_order, max_spans, matrix)


def surface_sides(surface, degrees=(5,), **options):
    """Both directions, through places dense enough for the largest error."""
    t = np.concatenate([[0.0], (nodes(25) + 1) / 2, [1.0]])
    along_u = np.einsum("ijd,jp->ipd", surface.coefficients, surface.factors_v.rows(t))
    along_v = np.einsum("ijd,ip->jpd", surface.coefficients, surface.factors_u.rows(t))
    settings = {"continuity": None, "end_order": 0, "max_spans": 4096} | options
    return [
        Side(Bundle(factors, vectors), degrees, **settings)
        for factors, vectors in ((surface.factors_u, along_u), (surface.factors_v, along_v))
    ]


def deviation(one, curve):
    held = BSpline(one.knots.flat, one.matrix @ curve.coefficients, one.knots.degree)(LINE)
    return np.linalg.norm(curve.evaluate(LINE) - held, axis=1).max()


def within(curve, goal):
    """A proof by dense samples that remembers what it was asked."""

    def proof(one):
        proof.asked.append(one)
        return one if deviation(one, curve) <= goal else None

    proof.asked = []
    return proof


# Approximations by their number of poles


@pytest.mark.parametrize("adapt", [False, True], ids=["cached", "adapted"])
@pytest.mark.parametrize("name", ["A2p", "D5s", "E8p"])
def test_errors_are_those_of_the_piece(name, adapt):
    curve = pieces.curves()[name]
    side = curve_side(curve, range(3, 8))
    for poles in range(side.least, 20, 3):
        one = side.adapted(poles, 1e-9) if adapt else side.kind(poles)
        truth = deviation(one, curve)
        assert one.knots.poles <= poles
        assert 0.88 * truth <= one.error <= truth * (1 + 5e-4)  # the maximum lies between dense places, too


def test_own_knots_are_no_worse_than_those_of_the_kind():
    for curve in pieces.curves().values():
        side = curve_side(curve, (3, 5, 7))
        for poles in range(side.least, 18, 2):
            assert side.adapted(poles, 1e-9).error <= side.kind(poles).error


def test_the_best_degree_is_taken():
    curve = pieces.curves()["D5s"]
    side = curve_side(curve, range(3, 12))
    for poles in (8, 12, 16):
        alone = {p: curve_side(curve, (p,)).kind(poles).error for p in range(3, min(11, poles - 1) + 1)}
        assert side.kind(poles).error == min(alone.values())
        assert alone[side.kind(poles).knots.degree] == side.kind(poles).error


@pytest.mark.parametrize(
    ("degrees", "end_order", "max_spans", "continuity", "least", "most"),
    [
        ((5,), 0, 10, None, 6, 15),
        ((5,), 2, 10, None, 6, 15),
        ((5,), 3, 10, None, 8, 15),
        ((3,), 3, 10, None, 8, 13),
        (range(3, 12), 0, 10, None, 4, 21),
        (range(3, 12), 3, 1, None, 8, 12),
        ((5,), 0, 10, 2, 6, 33),
        ((5,), 0, 10, 0, 6, 51),
    ],
)
def test_fewest_and_most_poles(degrees, end_order, max_spans, continuity, least, most):
    curve = pieces.curves()["D5s"]
    side = curve_side(curve, degrees, end_order=end_order, max_spans=max_spans, continuity=continuity)
    assert (side.least, side.most) == (least, most)
    assert side.kind(least) is not None
    assert side.kind(least - 1) is None


@pytest.mark.parametrize("continuity", range(5))
def test_interior_knots_have_the_multiplicity_of_the_continuity(continuity):
    side = curve_side(pieces.curves()["E8p"], continuity=continuity)
    for poles in range(6, 40, 5):
        for one in (side.kind(poles), side.adapted(poles, 1e-6)):
            assert set(one.knots.multiplicities[1:-1]) <= {5 - continuity}
            assert poles - (5 - continuity) < one.knots.poles <= poles


def test_spans_stay_below_their_limit():
    side = curve_side(pieces.curves()["E8p"], (3, 5), max_spans=4)
    for poles in range(4, 30):
        assert side.kind(poles).knots.spans <= 4
        assert side.adapted(poles, 1e-9).knots.spans <= 4
    assert side.best_of(3).knots.spans == 3


@pytest.mark.parametrize("end_order", range(4))
def test_best_of_is_the_best_degree_of_that_many_spans(end_order):
    curve = pieces.curves()["D5s"]
    side = curve_side(curve, range(3, 9), end_order=end_order)
    best = side.best_of(6)
    for degree in range(3, 9):
        other = of_kind(curve.factors, degree, degree - 1, end_order, 6)
        assert best.error <= side.bundle.norms(other.residual).max()


def test_polynomials_are_taken_as_they_are():
    curve = Curve(np.random.default_rng(1).normal(size=(9, 3)) * 100, family=BERNSTEIN)
    side = curve_side(curve, (5,), polynomial=True)
    assert side.kind(8).knots.poles == 8
    for poles in (9, 12, 30):
        one = side.kind(poles)
        assert (one.knots.poles, one.knots.degree, one.error) == (9, 8, 0.0)
        assert np.array_equal(one.matrix, np.eye(9))
    assert side.adapted(15, 1e-6).knots.poles == 9
    assert curve_side(curve, (5,)).kind(12).knots.degree == 5


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_polynomials_of_low_degree_are_found_at_the_least_number_of_poles(degree):
    curve = Curve(np.random.default_rng(1).normal(size=(degree + 1, 3)), family=BERNSTEIN)
    for end_order in range(4):
        side = curve_side(curve, (5, 7), end_order=end_order, polynomial=True)
        assert fewest(side, 1e-6, lambda one: one, adapt=True).knots.poles == degree + 1


# The fewest poles of a curve


@pytest.mark.parametrize("adapt", [False, True], ids=["cached", "adapted"])
@pytest.mark.parametrize("goal", [1e-2, 1e-5])
def test_what_is_found_has_passed_the_proof(adapt, goal):
    for curve in pieces.curves().values():
        proof = within(curve, goal)
        found = fewest(curve_side(curve), goal, proof, adapt=adapt)
        assert deviation(found, curve) <= goal
        assert any(one is found for one in proof.asked)
        assert all(one.error <= goal for one in proof.asked)


@pytest.mark.parametrize("name", ["A2p", "B3p", "C3s", "D5s", "E8p"])
def test_no_cached_approximation_with_fewer_poles_passes(name):
    curve = pieces.curves()[name]
    for degree in (3, 5, 8):
        for goal in (1e-1, 1e-3, 1e-5):
            side = curve_side(curve, (degree,))
            found = fewest(side, goal, within(curve, goal), adapt=False)
            step = found.knots.poles // 24  # many poles are searched in steps
            for poles in range(side.least, found.knots.poles - step):
                assert deviation(side.kind(poles), curve) > goal * 0.999


@pytest.mark.parametrize("degrees", [(5,), (7,), (3, 4, 5, 6, 7, 8, 9)], ids=str)
@pytest.mark.parametrize("name", ["A2p", "C3s", "D5s", "E8p"])
def test_finer_tolerances_never_need_fewer_poles(name, degrees):
    curve = pieces.curves()[name]
    counts = [
        fewest(curve_side(curve, degrees), goal, within(curve, goal), adapt=True).knots.poles
        for goal in 10.0 ** -np.arange(0, 6.01, 0.25)
    ]
    assert counts == sorted(counts)


@pytest.mark.parametrize("least", [11, 13, 17])
def test_the_proof_has_the_last_word(least):
    """A proof that refuses fewer than so many poles: just that many are taken."""
    side = curve_side(pieces.curves()["C3s"])
    found = fewest(side, 1e-2, lambda one: one if one.knots.poles >= least else None, adapt=True)
    assert found.knots.poles == least


def test_none_when_the_proof_refuses_everything():
    side = curve_side(pieces.curves()["C3s"])
    assert fewest(side, 1e-3, lambda one: None, adapt=True) is None


@pytest.mark.parametrize("adapt", [False, True], ids=["cached", "adapted"])
def test_none_when_the_limit_of_spans_is_too_low(adapt):
    curve = pieces.curves()["D5s"]
    assert fewest(curve_side(curve, max_spans=3), 1e-6, within(curve, 1e-6), adapt=adapt) is None


def test_ties_go_to_the_lower_degree():
    for curve in pieces.curves().values():
        for goal in (1e-2, 1e-4):
            found = fewest(curve_side(curve, range(3, 12)), goal, within(curve, goal), adapt=True)
            for degree in range(3, found.knots.degree):
                alone = fewest(curve_side(curve, (degree,)), goal, within(curve, goal), adapt=True)
                assert alone.knots.poles > found.knots.poles


def test_a_limit_of_spans_that_own_knots_keep_is_enough():
    """Degree 7 needs five spans for this curve with knots of its own, more with those of its kind."""
    curve = pieces.curves()["D5s"]
    free = fewest(curve_side(curve, (7,)), 1e-4, within(curve, 1e-4), adapt=True)
    limited = curve_side(curve, (7,), max_spans=free.knots.spans)
    found = fewest(limited, 1e-4, within(curve, 1e-4), adapt=True)
    assert found is not None
    assert found.knots.spans <= free.knots.spans


# The fewest poles of a surface


def surface_deviation(a, b, surface):
    line = np.linspace(0, 1, 121)
    u, v = (BSpline(one.knots.flat, one.matrix, one.knots.degree)(line) for one in (a, b))
    held = np.einsum("pi,ijd,qj->pqd", u, surface.coefficients, v)
    return np.linalg.norm(surface.evaluate(line[:, None], line[None, :]) - held, axis=2).max()


@pytest.mark.parametrize("goal", [1e-1, 1e-3])
@pytest.mark.parametrize("name", ["S33", "S54"])
def test_no_pair_of_cached_approximations_with_fewer_poles_passes(name, goal):
    surface = pieces.surfaces()[name]
    u, v = surface_sides(surface)

    def proof(a, b):
        return (a, b) if surface_deviation(a, b, surface) <= goal else None

    a, b = fewest_pair(u, v, goal, proof, surface.coefficients, adapt=False)
    best = a.knots.poles * b.knots.poles
    others = [(p, q) for p in range(u.least, best // v.least) for q in range(v.least, best // u.least) if p * q < best]
    for p, q in others:
        one, other = u.kind(p), v.kind(q)
        if one.error + other.error <= 4 * goal:  # others are far off
            assert surface_deviation(one, other, surface) > goal * 0.999


@pytest.mark.parametrize("goal", [1e-2, 1e-5])
def test_own_knots_save_poles_of_surfaces(goal):
    for surface in pieces.surfaces().values():
        counts = []
        for adapt in (False, True):
            u, v = surface_sides(surface)

            def proof(a, b, surface=surface):
                return (a, b) if surface_deviation(a, b, surface) <= goal else None

            a, b = fewest_pair(u, v, goal, proof, surface.coefficients, adapt=adapt)
            assert surface_deviation(a, b, surface) <= goal
            counts.append(a.knots.poles * b.knots.poles)
        assert counts[1] <= counts[0]


def test_a_direction_that_is_a_polynomial_keeps_its_degree():
    points = np.random.default_rng(2).normal(size=(6, 8, 3)) * 50
    surface = Surface(points, (0.3, -0.2), family_v=BERNSTEIN)
    u, _ = surface_sides(surface)
    along_v = np.einsum("ijd,ip->jpd", surface.coefficients, surface.factors_u.rows(np.linspace(0, 1, 15)))
    v = Side(Bundle(surface.factors_v, along_v), (5,), None, 0, 4096, polynomial_form(surface.factors_v))
    a, b = fewest_pair(u, v, 1e-5, lambda a, b: (a, b), surface.coefficients, adapt=True)
    assert (b.knots.poles, b.knots.degree) == (8, 7)
    assert surface_deviation(a, b, surface) <= 1.2e-5


@pytest.mark.parametrize(
    ("degree", "degrees", "exact"), [(1, (5,), True), (5, (5, 7), True), (6, (5, 7), False), (8, (7,), False)]
)
def test_splines_hold_polynomials_up_to_their_degree(degree, degrees, exact):
    curve = Curve(np.random.default_rng(1).normal(size=(degree + 1, 3)), family=BERNSTEIN)
    assert curve_side(curve, degrees).exact == exact
    assert not curve_side(Curve(np.eye(4)[:, :3], (0.2, 0.1)), degrees).exact


def test_a_direction_may_take_the_whole_goal_when_the_other_one_is_exact():
    for seed in range(6):
        points = np.random.default_rng(seed).normal(size=(7, 2, 3)) * 30
        surface = Surface(points, (0.4, -0.3), family_v=BERNSTEIN)
        alone, v = surface_sides(surface)
        assert (alone.exact, v.exact) == (False, True)
        a = fewest(alone, 1e-4, lambda one: one, adapt=True)
        u, v = surface_sides(surface)
        pair = fewest_pair(u, v, 1e-4, lambda a, b: (a, b), surface.coefficients, adapt=True)
        assert pair[0].knots.poles <= a.knots.poles
        assert surface_deviation(*pair, surface) <= 1e-4 * (1 + 1e-3)


def test_none_when_no_pair_passes():
    surface = pieces.surfaces()["S33"]
    u, v = surface_sides(surface)
    assert fewest_pair(u, v, 1e-3, lambda a, b: None, surface.coefficients, adapt=True) is None
    u, v = surface_sides(surface, max_spans=2)
    assert fewest_pair(u, v, 1e-6, lambda a, b: (a, b), surface.coefficients, adapt=True) is None


def test_a_limit_of_spans_that_own_knots_of_a_surface_keep_is_enough():
    surface = pieces.surfaces()["S54"]

    def proof(a, b):
        return (a, b) if surface_deviation(a, b, surface) <= 1e-4 else None

    u, v = surface_sides(surface)
    free = fewest_pair(u, v, 1e-4, proof, surface.coefficients, adapt=True)
    u, v = surface_sides(surface, max_spans=max(one.knots.spans for one in free))
    assert fewest_pair(u, v, 1e-4, proof, surface.coefficients, adapt=False) is None
    a, b = fewest_pair(u, v, 1e-4, proof, surface.coefficients, adapt=True)
    assert a.knots.poles * b.knots.poles <= free[0].knots.poles * free[1].knots.poles
