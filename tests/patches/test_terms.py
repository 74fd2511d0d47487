"""Surfaces of terms, and what else the patches are made with."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest

from gtcad import BERNSTEIN, Curve, Restricted, Surface
from gtcad.basis import Basis
from gtcad.errors import InputError
from gtcad.factors import Constant, CurveOfTerms, RestrictedFactors, Stacked, SurfaceOfTerms, Waves, constant_term
from tests.test_protocol import Turn

T = np.linspace(0, 1, 17)
LINEAR = Basis(1, family=BERNSTEIN)
WAVES = Waves(0.3, 5.0)
PLAIN = [Basis(4, (0.5, -0.5)), LINEAR, WAVES, Constant()]
WITH_ONE = [
    *PLAIN,
    RestrictedFactors(WAVES, 0.8, 0.1),
    Stacked((WAVES, LINEAR)),
    Stacked((Turn(2.0), LINEAR, WAVES)),
    RestrictedFactors(Stacked((Turn(2.0), Basis(2))), 0.0, 0.5),
]


def test_the_constant():
    assert Constant().rows(T).tolist() == [[1.0] * 17]
    assert not Constant().rows(T, 1).any()
    assert [Constant().derivative_bound(k) for k in range(3)] == [1.0, 0.0, 0.0]
    assert Constant().rounding == 0
    assert Constant().key not in {one.key for one in PLAIN[:3]}


@pytest.mark.parametrize("factors", WITH_ONE)
def test_the_constant_from_other_factors(factors):
    found, weights = constant_term(factors)
    assert found == factors
    assert abs(weights @ factors.rows(T) - 1).max() <= 1e-15


def test_factors_without_a_constant_get_one():
    for factors in (Turn(2.0), Stacked((Turn(2.0), Turn(3.0))), RestrictedFactors(Turn(2.0), 0.0, 0.5)):
        assert constant_term(factors) == (Constant(), np.ones(1))


def test_translations_add_no_terms_where_there_is_a_constant():
    curve = CurveOfTerms(WAVES, [[1, 2, 3], [4, 0, 0], [0, 4, 0]])
    moved = curve.transformed(np.eye(3), [5, 5, 5]).transformed(np.eye(3), [-5, -5, -5])
    assert moved == curve
    other = CurveOfTerms(Turn(2.0), [[1, 2], [4, 0], [0, 4]])
    twice = other.transformed(np.eye(2), [5, 5]).transformed(np.eye(2), [1, 0])
    assert twice.factors.count == 4
    assert abs(twice.evaluate(T) - other.evaluate(T) - [6, 5]).max() <= 1e-14


def test_equal_curves_of_terms():
    curve = CurveOfTerms(WAVES, [[1, 2], [4, 0], [0.0, 4]])
    same = CurveOfTerms(Waves(0.3, 5), [[1, 2], [4, -0.0], [0, 4]])
    assert curve == same == pickle.loads(pickle.dumps(curve))
    assert hash(curve) == hash(same)
    assert curve != CurveOfTerms(Waves(0.3, 4), curve.coefficients)
    assert curve != CurveOfTerms(WAVES, 2 * curve.coefficients)
    assert curve != "curve"


def test_a_surface_of_terms_is_the_tensor_product():
    points = np.random.default_rng(0).normal(size=(5, 2, 3))
    surface = SurfaceOfTerms(PLAIN[0], LINEAR, points)
    expected = Surface(points, (0.5, -0.5), family_v=BERNSTEIN)
    assert np.array_equal(surface.evaluate(T[:, None], T), expected.evaluate(T[:, None], T))
    points[0] = 9
    assert surface.coefficients[0, 0, 0] != 9
    assert surface == SurfaceOfTerms(PLAIN[0], LINEAR, surface.coefficients)
    assert hash(surface) == hash(pickle.loads(pickle.dumps(surface)))
    assert surface != SurfaceOfTerms(PLAIN[0], LINEAR, 2 * surface.coefficients)
    assert surface != expected


@pytest.mark.parametrize("shape", [(5, 3, 3), (2, 5, 3), (5, 2)])
def test_coefficients_that_do_not_fit(shape):
    with pytest.raises(InputError, match=r"coefficients must have shape \(5, 2, d\), got"):
        SurfaceOfTerms(PLAIN[0], LINEAR, np.zeros(shape))


def test_sums_hold_equal_factors_once():
    rng = np.random.default_rng(1)
    terms = [
        (a, b, rng.normal(size=(a.count, b.count, 3)))
        for a, b in ((WAVES, LINEAR), (PLAIN[0], LINEAR), (WAVES, WAVES), (WAVES, LINEAR))
    ]
    total = SurfaceOfTerms.summed(terms)
    assert total.coefficients.shape == (3 + 5, 2 + 3, 3)
    expected = sum(SurfaceOfTerms(*term).evaluate(T[:, None], T) for term in terms)
    assert abs(total.evaluate(T[:, None], T) - expected).max() <= 2e-14


@pytest.mark.parametrize("factors_v", [WAVES, Turn(2.0)])
@pytest.mark.parametrize("factors_u", [Basis(3), Turn(3.0)])
def test_affine_images_with_and_without_a_constant(factors_u, factors_v):
    rng = np.random.default_rng(2)
    surface = SurfaceOfTerms(factors_u, factors_v, rng.normal(size=(factors_u.count, factors_v.count, 3)))
    matrix, offset = rng.normal(size=(2, 3)), rng.normal(size=2)
    moved = surface.transformed(matrix, offset)
    assert abs(moved.evaluate(T[:, None], T) - (surface.evaluate(T[:, None], T) @ matrix.T + offset)).max() <= 2e-14
    assert moved.transformed(np.eye(2), offset).coefficients.shape == moved.coefficients.shape


def test_translations_that_do_not_fit():
    surface = SurfaceOfTerms(LINEAR, LINEAR, np.zeros((2, 2, 3)))
    with pytest.raises(InputError, match=r"translation must have shape \(3,\), got \(2,\)"):
        surface.transformed(np.eye(3), [1, 2])
    with pytest.raises(InputError, match=r"translation must have shape \(2,\), got \(3,\)"):
        CurveOfTerms(LINEAR, np.zeros((2, 2))).transformed(np.eye(2), [1, 2, 3])


def test_isoparametric_curves_have_the_terms_they_need():
    arc, wave = Curve([[1, 0], [1, 1], [0, 1]]), CurveOfTerms(Waves(0.0, math.pi), [[0, 2], [1, 0], [0, 1]])
    across = np.eye(2)[:, :, None]
    surface = SurfaceOfTerms.summed(
        [
            (arc.factors, LINEAR, arc.coefficients[:, None] * across[0]),
            (wave.factors, LINEAR, wave.coefficients[:, None] * across[1]),
        ]
    )
    assert surface.boundary("v0") == CurveOfTerms(arc.factors, arc.coefficients)
    assert surface.boundary("v1") == wave
    assert surface.isoparametric(v=0.5).factors.count == 6
    part = SurfaceOfTerms(RestrictedFactors(surface.factors_u, 0.5, 0.1), LINEAR, surface.coefficients)
    assert part.boundary("v0") == CurveOfTerms(RestrictedFactors(arc.factors, 0.5, 0.1), arc.coefficients)
    nothing = SurfaceOfTerms(Stacked((LINEAR, WAVES)), LINEAR, np.zeros((5, 2, 3))).boundary("v0")
    assert not nothing.evaluate(T).any()


def test_a_part_of_a_surface_of_terms():
    surface = SurfaceOfTerms(WAVES, LINEAR, np.random.default_rng(3).normal(size=(3, 2, 3)))
    part = Restricted(surface, ((0.5, 1.0), (1.0, 0.0)))
    assert abs(part.evaluate(0.5, 0.25) - surface.evaluate(0.75, 0.75)).max() <= 1e-15
