from __future__ import annotations

import math

import mpmath as mp
import numpy as np
import pytest
from scipy.interpolate import BSpline

from gtcad.chebyshev import nodes
from gtcad.converters.spline_basis import (
    Knots,
    both_ends,
    dense,
    doubled,
    end_derivatives,
    local_values,
    sampled,
    top_jumps,
)
from tests import reference, splines


def random_knots(seed, degree, spans=6):
    """Breaks of uneven distance, interior multiplicities from 1 to the degree."""
    rng = np.random.default_rng(seed)
    breaks = np.concatenate([[0.0], np.cumsum(rng.uniform(0.02, 1, spans))])
    counts = (degree + 1, *rng.integers(1, degree + 1, spans - 1).tolist(), degree + 1)
    return Knots.normalised(breaks, counts, degree)


DEGREES = [1, 2, 3, 5, 9, 17, 25]


@pytest.mark.parametrize("degree", DEGREES)
def test_values_are_those_of_scipy(degree):
    knots = random_knots(degree, degree)
    z = nodes(11)
    t = knots.places(z)
    local = local_values(knots, z)
    assert local.shape == (6, 11, degree + 1)
    expected = BSpline.design_matrix(t.reshape(-1), knots.flat, degree).toarray()
    columns = knots.first[:, None] + np.arange(degree + 1)
    assert abs(dense(local, columns, knots.poles) - expected).max() <= 2e-14


@pytest.mark.parametrize("degree", DEGREES)
def test_values_have_a_small_relative_error(degree):
    """5 (degree + 1) units, as promised, at 50 digits: no digits are lost where a function is nearly zero."""
    knots = random_knots(degree, degree, spans=3)
    z = np.array([-1.0, -0.999, -0.3, 0.1, 0.7, 0.999])
    local = local_values(knots, z)
    t = knots.places(z)
    for span, place in np.ndindex(t.shape):
        with mp.workdps(reference.DIGITS):
            near = splines.basis(knots.flat.tolist(), degree, mp.mpf(float(t[span, place])))
            for index in range(degree + 1):
                exact = near[int(knots.first[span]) + index]
                error = abs(mp.mpf(float(local[span, place, index])) - exact)
                assert error <= 5 * (degree + 1) * 2.0**-53 * exact


@pytest.mark.parametrize("degree", DEGREES)
def test_values_are_non_negative_and_sum_to_1(degree):
    local = local_values(random_knots(degree + 7, degree), np.linspace(-1, 1, 21))
    assert local.min() >= 0
    assert abs(local.sum(axis=2) - 1).max() <= 4e-15


@pytest.mark.parametrize("degree", DEGREES)
def test_ends_of_the_domain_are_interpolated(degree):
    local = local_values(random_knots(degree, degree), np.array([-1.0, 1.0]))
    assert local[0, 0].tolist() == [1.0] + [0.0] * degree
    assert local[-1, 1].tolist() == [0.0] * degree + [1.0]


@pytest.mark.parametrize("order", range(4))
@pytest.mark.parametrize("degree", [3, 4, 5, 9, 25])
def test_end_derivatives_are_those_of_scipy(degree, order):
    knots = random_knots(degree + order, degree)
    start, end = end_derivatives(knots, order)
    identity = BSpline(knots.flat, np.eye(knots.poles), degree)
    for row in range(order + 1):
        at_0, at_1 = identity(0.0, row), identity(1.0, row)
        assert not at_0[order + 1 :][row:].any()
        expected = at_0[: order + 1], at_1[::-1][: order + 1]
        for found, wanted in zip((start[row], end[row]), expected, strict=True):
            assert abs(found - wanted).max() <= 1e-13 * abs(wanted).max()


def test_end_derivatives_are_triangular():
    start, end = end_derivatives(random_knots(1, 6), 3)
    assert np.array_equal(start, np.tril(start))
    assert np.array_equal(end, np.tril(end))
    assert start[0, 0] == end[0, 0] == 1


def test_each_end_has_its_own_order():
    knots = random_knots(1, 6)
    start, end = end_derivatives(knots, (3, 1))
    assert np.array_equal(start, end_derivatives(knots, 3)[0])
    assert np.array_equal(end, end_derivatives(knots, 1)[1])
    assert (both_ends(2), both_ends((2, 1))) == ((2, 2), (2, 1))


# Functions at fixed parameters, for knots that move


def simple_knots(degree, spans=7):
    """Uneven breaks, and parameters with breaks among them."""
    rng = np.random.default_rng(degree)
    breaks = np.concatenate([[0.0], np.sort(rng.uniform(0.02, 0.98, spans - 1)), [1.0]])
    return breaks, Knots.smooth(breaks, degree).flat, np.sort(np.concatenate([rng.random(400), breaks[:-1]]))


@pytest.mark.parametrize("degree", DEGREES)
def test_functions_at_fixed_parameters_are_those_of_scipy(degree):
    _, flat, t = simple_knots(degree)
    expected = BSpline.design_matrix(t, flat, degree).toarray()
    functions = sampled(flat, degree, t)
    assert abs(functions.dense() - expected).max() <= 4e-14
    assert abs(functions.sparse() - expected).max() <= 4e-14


@pytest.mark.parametrize("end_order", [(0, 0), (3, 1), (0, 3), (3, 3)])
@pytest.mark.parametrize("degree", [3, 5, 8, 11])
def test_doubled_knots(degree, end_order):
    """One B-spline for each interior knot: of the space with that knot doubled, flat enough at both ends."""
    breaks, flat, t = simple_knots(degree)
    functions, jumps = doubled(flat, degree, end_order, t)
    values = functions.dense()
    assert values.shape == (len(t), len(breaks) - 2)
    assert abs(functions.sparse() - values).max() == 0
    for column, knot in enumerate(breaks[1:-1]):
        finer = np.sort(np.append(flat, knot))
        basis = BSpline(finer, np.eye(len(finer) - degree - 1), degree)
        here = basis(t)
        index = int(abs(here - values[:, [column]]).max(axis=0).argmin())
        assert abs(here[:, index] - values[:, column]).max() <= 1e-13
        below, above = (basis(np.nextafter(knot, side), degree - 1)[index] for side in (0, 1))
        jump = (above - below) / math.factorial(degree)
        assert jumps[column] == pytest.approx(jump, rel=1e-7)
        assert jumps[column] != 0
        for end, highest in zip((0.0, 1.0), end_order, strict=True):
            assert all(abs(basis(end, order)[index]) == 0 for order in range(highest + 1))


@pytest.mark.parametrize("degree", [1, 2, 3, 5, 8])
def test_jumps_of_the_highest_derivative_are_those_of_scipy(degree):
    breaks, flat, _ = simple_knots(degree)
    poles = np.random.default_rng(0).normal(size=(len(flat) - degree - 1, 2))
    spline = BSpline(flat, poles, degree)
    middles = (breaks[1:] + breaks[:-1]) / 2
    expected = np.diff(spline(middles, degree), axis=0) / math.factorial(degree)
    assert abs(top_jumps(poles, flat, degree) - expected).max() <= 1e-11 * abs(expected).max()


@pytest.mark.parametrize("parts", [1, 2, 3, 8])
def test_subdivided_knots_span_the_same_splines(parts):
    degree = 4
    knots = random_knots(3, degree)
    finer = knots.subdivided(parts)
    assert finer.spans == parts * knots.spans
    assert finer.poles == knots.poles
    assert np.array_equal(finer.flat, knots.flat)
    z = nodes(7)
    columns = finer.first[:, None] + np.arange(degree + 1)
    values = dense(local_values(finer, z), columns, finer.poles)
    expected = BSpline.design_matrix(finer.places(z).reshape(-1), knots.flat, degree).toarray()
    assert abs(values - expected).max() <= 1e-14


def test_smooth_knots():
    knots = Knots.smooth((0.0, 0.25, 0.5, 1.0), 5)
    assert knots.multiplicities == (6, 1, 1, 6)
    assert (knots.spans, knots.poles) == (3, 8)
    knots = Knots.smooth(np.array([0.0, 0.25, 0.5, 1.0]), 5, 2)
    assert knots.multiplicities == (6, 3, 3, 6)
    assert knots.poles == 12
    assert knots.first.tolist() == [0, 3, 6]
    assert knots.flat.tolist() == [0] * 6 + [0.25] * 3 + [0.5] * 3 + [1] * 6
    assert knots.widest == 0.25


def test_normalised_knots_run_from_0_to_1():
    knots = Knots.normalised(np.array([-3.0, 1.0, 5.0]), (4, 2, 4), 3)
    assert knots.breaks == (0.0, 0.5, 1.0)
    assert knots.multiplicities == (4, 2, 4)


def test_places_of_local_coordinates():
    knots = Knots.smooth((0.0, 0.5, 0.75, 1.0), 3)
    places = knots.places(np.array([-1.0, 0.0, 1.0]))
    assert places.tolist() == [[0, 0.25, 0.5], [0.5, 0.625, 0.75], [0.75, 0.875, 1.0]]


def test_equal_knots_are_looked_up():
    a, b = (Knots.smooth((0.0, 0.5, 1.0), 3) for _ in range(2))
    assert a == b
    assert local_values(a, nodes(5)) is local_values(b, nodes(5))
    assert local_values(a, nodes(6)) is not local_values(a, nodes(5))
    with pytest.raises(ValueError, match="read-only"):
        local_values(a, nodes(5))[0] = 0
