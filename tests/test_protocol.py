from __future__ import annotations

import math
import tracemalloc
from collections.abc import Hashable
from dataclasses import dataclass
from typing import Self

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from gtcad.basis import BERNSTEIN, Basis
from gtcad.chebyshev import interpolation_tail, nodes, transform
from gtcad.curve import Curve
from gtcad.differential import curvature, gaussian_curvature
from gtcad.errors import InputError
from gtcad.factors import RestrictedFactors, Stacked
from gtcad.measure import area, length
from gtcad.protocol import Factors, SeparableCurve, SeparableSurface, affine, checked_points, domain_part
from gtcad.surface import Surface
from tests import reference

Array = np.ndarray


@dataclass(frozen=True)
class Turn:
    """1, cos and sin of an angle times t: a kind of factor of its own, as a new kind of shape would bring it."""

    angle: float

    @property
    def count(self) -> int:
        return 3

    @property
    def key(self) -> Hashable:
        return ("turn", self.angle)

    def rows(self, t: Array, order: int = 0) -> Array:
        phase = self.angle * t + order * math.pi / 2
        constant = np.full(t.shape, 1.0 if order == 0 else 0.0)
        return np.stack([constant, self.angle**order * np.cos(phase), self.angle**order * np.sin(phase)])

    def derivative_bound(self, order: int) -> float:
        return (order == 0) + math.sqrt(2) * self.angle**order

    @property
    def rounding(self) -> float:
        return 1e-15


@dataclass(frozen=True)
class Helix(SeparableCurve):
    """(cos a t, sin a t, 0) + t (0, 0, pitch), as a sum of two kinds of factors."""

    angle: float
    pitch: float

    @property
    def factors(self) -> Factors:
        return Stacked((Turn(self.angle), Basis(1, family=BERNSTEIN)))

    @property
    def coefficients(self) -> Array:
        return np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0], [0, 0, self.pitch]], dtype=np.float64)

    def transformed(self, matrix: ArrayLike, translation: ArrayLike | None = None) -> Self:
        raise NotImplementedError


@dataclass(frozen=True)
class Cylinder(SeparableSurface):
    """(cos a v, sin a v, u)."""

    angle: float

    @property
    def factors_u(self) -> Factors:
        return Basis(1, family=BERNSTEIN)

    @property
    def factors_v(self) -> Factors:
        return Turn(self.angle)

    @property
    def coefficients(self) -> Array:
        table = np.zeros((2, 3, 3))
        table[:, 1, 0] = table[:, 2, 1] = 1
        table[1, 0, 2] = 1
        return table

    def transformed(self, matrix: ArrayLike, translation: ArrayLike | None = None) -> Self:
        raise NotImplementedError


# A new kind of shape, from its factors alone


def test_a_new_kind_of_curve() -> None:
    helix = Helix(5.0, 2.0)
    t = np.linspace(0, 1, 50)
    assert helix.dimension == 3
    expected = np.stack([np.cos(5 * t), np.sin(5 * t), 2 * t], axis=-1)
    assert abs(helix.evaluate(t) - expected).max() <= 1e-15
    expected = np.stack([-25 * np.cos(5 * t), -25 * np.sin(5 * t), 0 * t], axis=-1)
    assert abs(helix.derivative(t, 2) - expected).max() <= 1e-13
    assert float(length(helix)) == pytest.approx(math.hypot(5, 2), rel=1e-14)
    assert abs(curvature(helix, t) - 25 / 29).max() <= 1e-14


def test_a_new_kind_of_surface() -> None:
    cylinder = Cylinder(3.0)
    assert cylinder.evaluate(0.25, 1.0).tolist() == pytest.approx([math.cos(3), math.sin(3), 0.25], rel=1e-15)
    assert float(area(cylinder)) == pytest.approx(3, rel=1e-14)
    assert abs(gaussian_curvature(cylinder, 0.3, np.linspace(0, 1, 9))).max() <= 1e-15


def test_abstract_shapes_cannot_be_made() -> None:
    with pytest.raises(TypeError, match="abstract"):
        SeparableCurve()
    with pytest.raises(TypeError, match="abstract"):
        SeparableSurface()


# Factors


def test_stacked_factors() -> None:
    parts = (Basis(3, (0.1, 0.2)), Turn(2.0))
    stacked = Stacked(parts)
    t = np.linspace(0, 1, 5)
    assert stacked.count == 7
    for order in range(4):
        assert np.array_equal(stacked.rows(t, order)[:4], parts[0].rows(t, order))
        assert np.array_equal(stacked.rows(t, order)[4:], parts[1].rows(t, order))
    assert stacked.derivative_bound(12) == sum(part.derivative_bound(12) for part in parts)
    assert stacked.rounding == sum(part.rounding for part in parts)
    assert stacked.derivative_bound(0) == 2 + math.sqrt(2)
    assert stacked.key == Stacked((Basis(3, (0.1, 0.2)), Turn(2.0))).key != Stacked(parts[::-1]).key


@given(st.floats(0, 1), st.floats(0, 1), st.floats(0, 1), st.integers(0, 4))
def test_restricted_factors(start: float, end: float, t: float, order: int) -> None:
    base = Basis(5, (0.7, -0.2))
    part = RestrictedFactors(base, start, end)
    expected = (end - start) ** order * base.derivative(min(1.0, start * (1 - t) + end * t), order)
    assert part.count == base.count
    assert abs(part.rows(np.array([t]), order)[:, 0] - expected).max() <= 1e-13 * max(1, abs(expected).max())


def test_restricted_factors_reach_their_ends_exactly() -> None:
    base = Basis(5, (0.7, -0.2))
    for start, end in ((0.1, 0.7), (0.9, 0.3), (0.0, 1 / 3), (1.0, 0.0)):
        rows = RestrictedFactors(base, start, end).rows(np.array([0.0, 1.0]))
        assert np.array_equal(rows, base.rows(np.array([start, end])))


@pytest.mark.parametrize(("start", "end"), [(0.2, 0.45), (0.9, 0.1), (0.0, 1.0)])
@pytest.mark.parametrize("base", [Basis(4, (0.5, -0.5)), Turn(2.0)], ids=["basis", "turn"])
def test_restricted_factors_are_bounded(base: Factors, start: float, end: float) -> None:
    part = RestrictedFactors(base, start, end)
    count = 9
    series = part.rows((nodes(count) + 1) / 2) @ transform(count).T
    z = np.linspace(-1, 1, 201)
    interpolant = series @ np.cos(np.outer(np.arange(count), np.arccos(z)))
    error = abs(interpolant - part.rows((z + 1) / 2)).sum(axis=0).max()
    tail = interpolation_tail(0.5, count, part.derivative_bound(count))
    assert tail / 1e4 - 1e-14 <= error <= tail + 1e-14
    assert part.derivative_bound(0) == base.derivative_bound(0)
    assert part.key == RestrictedFactors(base, start, end).key != base.key


@given(st.sampled_from([5, 60]), st.floats(0, 1), st.floats(0, 1), st.floats(0, 1))
def test_rounding_of_restricted_factors_is_bounded(degree: int, start: float, end: float, t: float) -> None:
    gamma = (1.0, -0.3)
    part = RestrictedFactors(Basis(degree, gamma), start, end)
    with mp.workdps(reference.DIGITS):
        exact = reference.values("GT", degree, gamma, start * (1 - mp.mpf(t)) + end * mp.mpf(t))
        computed = part.rows(np.array([t]))[:, 0]
        error = mp.fsum(abs(mp.mpf(float(x)) - y) for x, y in zip(computed, exact, strict=True))
    assert error <= part.rounding


# Evaluation in blocks and on grids


@pytest.mark.parametrize("size", [8191, 8192, 8193, 20000])
def test_blocks_of_a_curve(size: int) -> None:
    curve = Curve(np.random.default_rng(1).standard_normal((6, 3)), (0.2, -0.9))
    t = np.random.default_rng(2).uniform(size=size)
    expected = curve.factors.derivative(t, 1) @ curve.control_points
    assert abs(curve.derivative(t, 1) - expected).max() <= 1e-13


@pytest.mark.parametrize("size", [8191, 8192, 8193, 20000])
def test_blocks_of_a_surface(size: int) -> None:
    surface = Surface(np.random.default_rng(1).standard_normal((4, 6, 3)), (0.2, -0.9), (1.0, 0.5))
    u, v = np.random.default_rng(2).uniform(size=(2, size))
    expected = np.einsum(
        "pi,pj,ijd->pd", surface.factors_u.derivative(u, 1), surface.factors_v.derivative(v, 2), surface.control_points
    )
    assert abs(surface.derivative(u, v, (1, 2)) - expected).max() <= 1e-12


@given(st.integers(0, 5), st.integers(0, 5), st.integers(0, 2), st.integers(0, 2))
def test_grid_equals_scattered(size_u: int, size_v: int, order_u: int, order_v: int) -> None:
    random = np.random.default_rng(size_u * 10 + size_v)
    surface = Surface(random.standard_normal((5, 4, 3)), (0.2, -0.9), (1.0, 0.5))
    u, v = random.uniform(size=size_u), random.uniform(size=size_v)
    grid = surface.derivative(u[:, None], v[None, :], (order_u, order_v))
    assert grid.shape == (size_u, size_v, 3)
    u_full, v_full = np.meshgrid(u, v, indexing="ij")
    scattered = surface.derivative(u_full, v_full, (order_u, order_v))
    assert abs(grid - scattered).max(initial=0) <= 1e-13 * 20.0 ** (order_u + order_v)


@pytest.mark.parametrize(
    ("shape_u", "shape_v", "shape"),
    [
        ((), (), ()),
        ((0,), (), (0,)),
        ((3, 4), (), (3, 4)),
        ((3, 1), (1, 4), (3, 4)),
        ((3, 1), (4,), (3, 4)),
        ((1, 4), (3, 1), (3, 4)),
        ((1, 1), (1, 4), (1, 4)),
        ((3, 1), (1, 1), (3, 1)),
        ((2, 3, 1), (1, 4), (2, 3, 4)),
        ((0, 1), (1, 4), (0, 4)),
        ((5,), (5,), (5,)),
    ],
)
def test_broadcasting(shape_u: tuple[int, ...], shape_v: tuple[int, ...], shape: tuple[int, ...]) -> None:
    random = np.random.default_rng(0)
    surface = Surface(random.standard_normal((3, 4, 3)))
    u, v = random.uniform(size=shape_u), random.uniform(size=shape_v)
    points = surface.evaluate(u, v)
    assert points.shape == (*shape, 3)
    full_u, full_v = np.broadcast_arrays(u, v)
    for k in np.ndindex(shape):
        assert abs(points[k] - surface.evaluate(full_u[k], full_v[k])).max() <= 1e-14


@pytest.mark.parametrize("shape", [(), (0,), (3, 4), (2, 0)])
def test_shapes_of_a_curve(shape: tuple[int, ...]) -> None:
    curve = Curve([[0, 0], [1, 2], [3, 1]])
    t = np.random.default_rng(0).uniform(size=shape)
    assert curve.evaluate(t).shape == (*shape, 2)
    assert curve.derivative(t, 3).shape == (*shape, 2)


def peak(action: object) -> tuple[int, int]:
    """Largest memory in use while it runs, and that of its result."""
    tracemalloc.start()
    try:
        result = action()
        return tracemalloc.get_traced_memory()[1], result.nbytes
    finally:
        tracemalloc.stop()


def test_memory_of_a_curve() -> None:
    curve = Curve(np.random.default_rng(0).standard_normal((6, 3)))
    t = np.linspace(0, 1, 1_000_000)
    for order in (0, 2):
        used, size = peak(lambda order=order: curve.derivative(t, order))
        assert size == 24_000_000
        assert used <= 3 * size


def test_memory_of_a_surface() -> None:
    surface = Surface(np.random.default_rng(0).standard_normal((6, 6, 3)))
    u = v = np.linspace(0, 1, 1000)
    used, size = peak(lambda: surface.evaluate(u[:, None], v[None, :]))
    assert size == 24_000_000
    assert used <= 3 * size
    many = np.random.default_rng(1).uniform(size=(2, 1_000_000))
    used, size = peak(lambda: surface.evaluate(*many))
    assert used <= 3 * size
    used, size = peak(lambda: surface.evaluate(many[0], 0.5))
    assert used <= 3 * size


# Refusals


@pytest.mark.parametrize("order", [-1, 1.5, math.nan, math.inf])
def test_refuses_orders(order: float) -> None:
    with pytest.raises(InputError, match="order"):
        Curve([[0, 0], [1, 2], [3, 1]]).derivative(0.5, order)
    with pytest.raises(InputError, match=r"orders\[1\]"):
        Surface(np.zeros((3, 3, 3))).derivative(0.5, 0.5, (0, order))


@pytest.mark.parametrize("bad", [-0.1, 1.0001, math.nan, math.inf])
def test_refuses_parameters(bad: float) -> None:
    with pytest.raises(InputError, match="t must lie in"):
        Curve([[0, 0], [1, 2], [3, 1]]).evaluate([0.5, bad])
    with pytest.raises(InputError, match="u must lie in"):
        Surface(np.zeros((3, 3, 3))).evaluate(bad, 0.5)
    with pytest.raises(InputError, match="v must lie in"):
        Surface(np.zeros((3, 3, 3))).evaluate(0.5, bad)


def test_refuses_shapes_that_do_not_broadcast() -> None:
    with pytest.raises(InputError, match=r"\(3,\) and \(4,\)"):
        Surface(np.zeros((3, 3, 3))).evaluate(np.zeros(3), np.zeros(4))


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ([[0, 0], [1]], "numbers of shape"),
        ([["a", "b"]], "numbers of shape"),
        ([[0, 0, 0, 0], [1, 1, 1, 1]], r"d = 2 or 3, got \(2, 4\)"),
        ([0, 1, 2], "shape"),
        ([[0, 0], [math.nan, 1]], r"points\[1, 0\] must be finite, got nan"),
        ([[0, 0], [0, math.inf]], r"points\[1, 1\] must be finite, got inf"),
        ([[0j, 0], [0, 1]], "numbers"),
        ([], "shape"),
        (None, "shape"),
    ],
)
def test_refuses_points(points: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        checked_points("points", points, 2)


def test_points_are_a_read_only_copy() -> None:
    given = np.zeros((3, 2))
    points = checked_points("points", given, 2)
    given[0, 0] = 7
    assert points[0, 0] == 0
    with pytest.raises(ValueError, match="read-only"):
        points[0, 0] = 1


def test_affine() -> None:
    points = np.array([[1.0, 2.0], [0.0, 1.0]])
    assert affine(points, [[0, -1], [1, 0]], [10, 20]).tolist() == [[8, 21], [9, 20]]
    assert affine(points, [[1, 0], [0, 1], [1, 1]], None).tolist() == [[1, 2, 3], [0, 1, 1]]
    with pytest.raises(InputError, match=r"matrix must have shape \(2 or 3, 2\), got \(3, 3\)"):
        affine(points, np.eye(3), None)
    with pytest.raises(InputError, match=r"translation must have shape \(2,\), got \(3,\)"):
        affine(points, np.eye(2), [1, 2, 3])


@pytest.mark.parametrize("bounds", [(0.5, 0.5), (0.2, 1.2), (-0.1, 0.5), (0.1,), (0.1, 0.2, 0.3), (math.nan, 1)])
def test_refuses_parts_of_the_domain(bounds: tuple[float, ...]) -> None:
    with pytest.raises(InputError, match="range"):
        domain_part("range", bounds)


def test_parts_of_the_domain_may_run_backwards() -> None:
    assert domain_part("range", [1, 0]) == (1.0, 0.0)
