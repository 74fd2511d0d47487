from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from gtcad import BERNSTEIN, GT, Curve, Restricted
from gtcad.errors import InputError
from gtcad.patches import Lofted, Ruled
from tests.patches.kinds import HALF, SECTIONS, WAVE, line
from tests.pieces import random_surface

U, V = np.meshgrid(np.linspace(0, 1, 21), np.linspace(0, 1, 13), indexing="ij")
gammas = st.tuples(st.floats(-0.9, 1), st.floats(-0.9, 1))


@given(st.integers(3, 9), gammas, st.sampled_from([GT, BERNSTEIN]), st.integers(0, 1000))
def test_sections_lie_on_the_patch(count, gamma, family, seed):
    rng = np.random.default_rng(seed)
    sections = [Curve(rng.normal(size=(4, 3)) + [0, 3 * k, 0], (0.3, -0.2)) for k in range(count)]
    parameters = np.cumsum(rng.uniform(0.5, 1.5, count))
    parameters = (parameters - parameters[0]) / np.ptp(parameters)
    patch = Lofted(sections, parameters, gamma if family is GT else (0, 0), family)
    size = abs(patch.coefficients).max()  # large where the patch swings
    for v, section in zip(parameters, sections, strict=True):
        assert abs(patch.evaluate(U[:, 0], v) - section.evaluate(U[:, 0])).max() <= 4e-15 * size
    for side, section in (("v0", sections[0]), ("v1", sections[-1])):
        assert np.array_equal(patch.boundary(side).coefficients, section.control_points)


@given(st.integers(0, 1000), st.integers(2, 6))
def test_sections_of_a_surface_give_it_back(seed, degree):
    rng = np.random.default_rng(seed)
    surface = random_surface(rng, (3, degree), 10)
    assume(min(surface.gamma_v) > -0.9 or degree > 2)
    parameters = np.sort(rng.uniform(0, 0.3, degree + 1)) + np.linspace(0, 0.7, degree + 1)
    sections = [surface.isoparametric(v=v) for v in parameters]
    patch = Lofted(sections, parameters, surface.gamma_v)
    loss = np.linalg.cond(surface.factors_v.evaluate(parameters))
    assert abs(patch.evaluate(U, V) - surface.evaluate(U, V)).max() <= 1e-14 * loss


def test_three_polynomial_sections_give_the_parabola_through_them():
    sections = [line([0, y, y**2], [5, y, y**2]) for y in (0.0, 1.0, 4.0)]
    x, y, z = np.moveaxis(Lofted(sections, (0, 0.25, 1), family_v=BERNSTEIN).evaluate(U, V), -1, 0)
    assert abs(y - 4 * V).max() <= 1e-14
    assert abs(z - y**2).max() <= 2e-14
    assert abs(x - 5 * U).max() <= 1e-14


def test_two_sections_give_a_ruled_patch():
    a, b = SECTIONS[:2]
    assert abs(Lofted([a, b], family_v=BERNSTEIN).coefficients - Ruled(a, b).coefficients).max() == 0


def test_parameters_are_uniform_unless_given():
    assert Lofted(SECTIONS).parameters == (0.0, 1 / 3, 2 / 3, 1.0)
    assert Lofted(SECTIONS) == Lofted(tuple(SECTIONS), [0, 1 / 3, 2 / 3, 1])
    assert Lofted(SECTIONS) != Lofted(SECTIONS, [0, 0.3, 0.6, 1])


def test_sections_of_other_kinds():
    arcs = [HALF.transformed(np.eye(3), [0, 10 * k, k * k]) for k in range(4)]
    parts = [Restricted(WAVE.transformed(np.eye(3), [0, 0, 30 * k]), (0.2, 0.9)) for k in range(3)]
    for sections in (arcs, parts):
        patch = Lofted(sections)
        assert abs(patch.evaluate(U[:, 0], 1.0) - sections[-1].evaluate(U[:, 0])).max() <= 1e-12
        assert patch.factors_u.key == sections[0].factors.key


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((WAVE,), "sections must be several curves, got one"),
        ((SECTIONS[:2],), "sections must be at least 3 for the family GT, got 2"),
        ((SECTIONS[:1], None, (0, 0), BERNSTEIN), "sections must be at least 2 for the family bernstein, got 1"),
        ((SECTIONS[:2] + [None],), r"sections\[2\] must be a curve, got NoneType"),
        (
            (SECTIONS[:3] + [WAVE],),
            r"sections\[3\] and sections\[0\] must be of one kind, got \('GT', 3, \(0.4, -0.6\)",
        ),
        ((SECTIONS[:2] + [line([0, 0], [1, 1])],), "must have one dimension"),
        ((SECTIONS, [0, 0.5, 1]), "parameters must be one number for each of 4 sections"),
        ((SECTIONS, [0, "a", 0.6, 1]), "parameters must be one number for each of 4 sections"),
        ((SECTIONS, [0, 0.6, 0.5, 1]), r"parameters must increase within \[0, 1\]"),
        ((SECTIONS, [0, 0.5, 0.6, 1.5]), r"parameters must increase within \[0, 1\]"),
        ((SECTIONS, [0, 0.5, math.nan, 1]), r"parameters must increase within \[0, 1\]"),
        ((SECTIONS, None, (2, 0)), r"gamma_v\[0\] must lie in \[-1, 1\], got 2"),
        ((SECTIONS[:3], None, (-1, -1)), r"degree 2 with gamma_v = \(-1.0, -1.0\) do not determine a patch"),
        ((SECTIONS, [0, 1e-12, 2e-12, 1]), "reciprocal condition"),
        (([SECTIONS[0]] * 50,), "reciprocal condition"),
        (([SECTIONS[0]] * 62,), "degree must be a whole number in"),
    ],
)
def test_bad_input(arguments, message):
    with pytest.raises(InputError, match=message):
        Lofted(*arguments)
