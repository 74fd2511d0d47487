from __future__ import annotations

import math
import pickle

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from gtcad.basis import BERNSTEIN
from gtcad.curve import Curve
from gtcad.errors import InputError
from gtcad.measure import area, length
from gtcad.restricted import Restricted, RestrictedCurve, RestrictedSurface
from gtcad.surface import Surface

CURVE = Curve(np.random.default_rng(0).standard_normal((6, 3)), (0.4, -0.8))
SURFACE = Surface(np.random.default_rng(1).standard_normal((5, 4, 3)), (0.4, -0.8), (1.0, 0.0))

parameters = st.floats(0, 1)


@st.composite
def ranges(draw: st.DrawFn) -> tuple[float, float]:
    start, end = draw(parameters), draw(parameters)
    assume(abs(end - start) > 1e-3)
    return start, end


@given(ranges(), parameters, st.integers(0, 3))
def test_part_of_a_curve(part: tuple[float, float], t: float, order: int) -> None:
    start, end = part
    inner = min(1.0, start * (1 - t) + end * t)
    expected = (end - start) ** order * CURVE.derivative(inner, order)
    assert abs(Restricted(CURVE, part).derivative(t, order) - expected).max() <= 1e-14 * 20.0**order


@given(ranges(), ranges(), parameters, parameters, st.integers(0, 2), st.integers(0, 2))
def test_part_of_a_surface(
    part_u: tuple[float, float], part_v: tuple[float, float], u: float, v: float, order_u: int, order_v: int
) -> None:
    inner_u, inner_v = (min(1.0, a * (1 - t) + b * t) for (a, b), t in ((part_u, u), (part_v, v)))
    factor = (part_u[1] - part_u[0]) ** order_u * (part_v[1] - part_v[0]) ** order_v
    expected = factor * SURFACE.derivative(inner_u, inner_v, (order_u, order_v))
    found = Restricted(SURFACE, (part_u, part_v)).derivative(u, v, (order_u, order_v))
    assert abs(found - expected).max() <= 1e-14 * 20.0 ** (order_u + order_v)


@given(ranges())
def test_ends_are_exact(part: tuple[float, float]) -> None:
    assert np.array_equal(Restricted(CURVE, part).evaluate([0.0, 1.0]), CURVE.evaluate(np.array(part)))


@given(ranges(), ranges(), parameters)
def test_part_of_a_part(outer: tuple[float, float], inner: tuple[float, float], t: float) -> None:
    twice = Restricted(Restricted(CURVE, outer), inner)
    start, end = (outer[0] * (1 - x) + outer[1] * x for x in inner)
    assert abs(twice.evaluate(t) - CURVE.evaluate(min(1.0, start * (1 - t) + end * t))).max() <= 1e-14 * 8


def test_the_whole_is_the_whole() -> None:
    t = np.linspace(0, 1, 11)
    assert np.array_equal(Restricted(CURVE, (0, 1)).evaluate(t), CURVE.evaluate(t))
    backwards = Restricted(CURVE, (1, 0))
    assert abs(backwards.evaluate(t) - CURVE.reversed().evaluate(t)).max() <= 1e-14


@given(ranges(), parameters)
def test_reversed(part: tuple[float, float], t: float) -> None:
    shape = Restricted(CURVE, part)
    assert abs(shape.reversed().evaluate(t) - shape.evaluate(1 - t)).max() <= 1e-14
    assert shape.reversed().range == part[::-1]


@given(ranges(), ranges(), parameters, parameters)
def test_transformed(part_u: tuple[float, float], part_v: tuple[float, float], u: float, v: float) -> None:
    matrix, translation = np.random.default_rng(5).standard_normal((3, 3)), np.array([1.0, 2.0, 3.0])
    for shape, at in ((Restricted(CURVE, part_u), (u,)), (Restricted(SURFACE, (part_u, part_v)), (u, v))):
        expected = matrix @ shape.evaluate(*at) + translation
        assert abs(shape.transformed(matrix, translation).evaluate(*at) - expected).max() <= 1e-13


def test_parts_add_up() -> None:
    whole = float(length(CURVE))
    assert sum(map(length, (Restricted(CURVE, (0, 0.3)), Restricted(CURVE, (1, 0.3))))) == pytest.approx(
        whole, rel=1e-12
    )
    quarters = [((a, a + 0.5), (b, b + 0.5)) for a in (0, 0.5) for b in (0, 0.5)]
    parts = sum(area(Restricted(SURFACE, part), rtol=1e-10) for part in quarters)
    assert parts == pytest.approx(float(area(SURFACE, rtol=1e-10)), rel=1e-9)


def test_arcs_of_a_circle() -> None:
    quarter = Curve([[1, 0], [1, 1], [0, 1]])
    assert float(length(Restricted(quarter, (0, 1 / 3)))) == pytest.approx(math.pi / 6, rel=1e-14)
    assert float(length(Restricted(quarter, (0.9, 0.4)))) == pytest.approx(math.pi / 4, rel=1e-14)


def test_kinds() -> None:
    curve, surface = Restricted(CURVE, (0.25, 0.75)), Restricted(SURFACE, ((0, 1), [0.5, 0]))
    assert isinstance(curve, RestrictedCurve)
    assert isinstance(surface, RestrictedSurface)
    assert (curve.dimension, surface.dimension) == (3, 3)
    assert surface.range == ((0.0, 1.0), (0.5, 0.0))
    assert curve == Restricted(CURVE, np.array([0.25, 0.75])) != Restricted(CURVE, (0.25, 0.7))
    assert hash(surface) == hash(Restricted(SURFACE, ((0, 1), (0.5, 0))))
    assert pickle.loads(pickle.dumps(surface)) == surface
    segment = Restricted(Curve([[0, 0], [8, 4]], family=BERNSTEIN), (0.25, 0.5))
    assert segment.evaluate([0, 1]).tolist() == [[2, 1], [4, 2]]


@pytest.mark.parametrize(
    ("shape", "part"),
    [
        (CURVE, (0.5, 0.5)),
        (CURVE, (-0.1, 0.5)),
        (CURVE, (0.5, math.nan)),
        (CURVE, (0.1, 0.2, 0.3)),
        (CURVE, ((0, 1), (0, 1))),
        (CURVE, 0.5),
        (CURVE, ("a", "b")),
        (CURVE, None),
        (SURFACE, (0, 1)),
        (SURFACE, ((0, 1), (0.5, 0.5))),
        (SURFACE, ((0, 1), (0.5, 2))),
        (SURFACE, ((0, 1), (0.5,))),
    ],
)
def test_refuses(shape: Curve | Surface, part: object) -> None:
    with pytest.raises(InputError, match="range"):
        Restricted(shape, part)
