"""Extremes of curvature against known curves and against samples."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gtcad import Composite, Curve
from gtcad.differential import curvature, signed_curvature
from gtcad.extremes import curvature_extremes, curvature_range
from tests.pieces import ellipse, graph, random_curve

LINE = np.linspace(0, 1, 801)
SEEDS = st.integers(0, 2**31)


def test_the_vertices_of_an_ellipse_lie_at_its_joints():
    found = curvature_extremes(ellipse())
    assert [(x.parameter, x.kind) for x in found] == [(0, "maximum"), (1, "minimum"), (2, "maximum"), (3, "minimum")]
    assert np.allclose([x.curvature for x in found], [3 / 4, 2 / 9] * 2, rtol=1e-13)
    assert np.allclose(curvature_range(ellipse()), [2 / 9, 3 / 4], rtol=1e-13)
    assert np.allclose(curvature_range(ellipse().reversed()), [-3 / 4, -2 / 9], rtol=1e-13)


@given(st.floats(-math.pi, math.pi), st.floats(0.3, 0.9), st.floats(0.1, 1.2), st.booleans())
def test_vertices_of_an_ellipse_arc(turn, ratio, start, in_space):
    # the quarter from the angle -start of an ellipse has one vertex on the long axis in its interior
    axes = np.array([[math.cos(turn), math.sin(turn)], [-ratio * math.sin(turn), ratio * math.cos(turn)]])
    u = math.cos(start) * axes[0] - math.sin(start) * axes[1]
    v = math.sin(start) * axes[0] + math.cos(start) * axes[1]
    arc = Curve([u, u + v, v])
    (found,) = curvature_extremes(arc.transformed([[0.6, 0], [0.8, 0], [0, -1]]) if in_space else arc)
    assert found.kind == "maximum"
    assert found.parameter == pytest.approx(start / (math.pi / 2), abs=1e-8)
    assert found.curvature == pytest.approx(1 / ratio**2, rel=1e-12)


def test_extremes_and_inflection_of_known_graphs():
    cubic = curvature_extremes(graph(-1, 1, -1, 1))  # y = x^3
    x = (1 / 45) ** 0.25
    top = 6 * x / (1 + 9 * x**4) ** 1.5
    assert [e.kind for e in cubic] == ["maximum", "inflection", "maximum"]
    assert np.allclose([2 * e.parameter - 1 for e in cubic], [-x, 0, x], rtol=0, atol=1e-9)
    assert np.allclose([e.curvature for e in cubic], [-top, 0, top], rtol=1e-12)
    quartic = curvature_extremes(graph(1, -1, 1, -1, 1))  # y = x^4: flat at 0, but no inflection
    x = (1 / 56) ** (1 / 6)
    assert [e.kind for e in quartic] == ["maximum", "minimum", "maximum"]
    assert np.allclose([2 * e.parameter - 1 for e in quartic], [-x, 0, x], rtol=0, atol=1e-6)


def test_what_has_no_extremes():
    assert curvature_extremes(ellipse(2, 2)) == ()
    assert curvature_extremes(Curve([[0, 0], [1, 1], [3, 3]], (0.3, 0.1))) == ()
    arcs = Composite((Curve([[1, 0], [1, 1], [0, 1]]), Curve([[0, 1], [-2, 1], [-2, -1]])), ("G1",))
    assert curvature_extremes(arcs) == ()  # the curvature jumps, and is stationary nowhere else
    assert curvature_extremes(Curve([[0, 0], [1, 2], [4, 0]], (-1.0, 0.0))) != ()  # C' = 0 at the start


@given(SEEDS, st.sampled_from([3, 4, 6, 12]), st.sampled_from([2, 3]))
def test_extremes_lie_where_samples_of_the_curvature_turn(seed, degree, dimension):
    curve = random_curve(np.random.default_rng(seed), degree, 1.0, dimension)
    t = np.linspace(0.001, 0.999, 1500)
    kappa = curvature(curve, t)
    up, down = (s * np.diff(kappa) > 1e-9 * kappa[1:] for s in (1, -1))
    found = curvature_extremes(curve)
    for kind, turns in (("maximum", up[:-1] & down[1:]), ("minimum", down[:-1] & up[1:])):
        for place in t[1:-1][turns]:
            assert any(abs(e.parameter - place) < 2e-3 and (e.kind == "maximum") == (kind == "maximum") for e in found)
    for e in found:
        near = [t for t in (e.parameter - 1e-5, e.parameter + 1e-5) if 0 <= t <= 1]
        beside, here = curvature(curve, near), abs(e.curvature)
        assert (beside <= here * (1 + 1e-8)).all() if e.kind == "maximum" else (beside >= here * (1 - 1e-8)).all()
    if dimension == 2:
        least, largest = curvature_range(curve)
        signed = signed_curvature(curve, LINE)
        assert least <= signed.min() + 1e-9 * abs(signed).max()
        assert largest >= signed.max() - 1e-9 * abs(signed).max()
