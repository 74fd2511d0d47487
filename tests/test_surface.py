from __future__ import annotations

import copy
import dataclasses
import json
import math
import pickle
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gtcad.basis import BERNSTEIN, GT, Basis
from gtcad.curve import Curve
from gtcad.errors import InputError
from gtcad.surface import Surface

design_variables = st.one_of(st.floats(-1, 1), st.sampled_from([-1.0, 0.0, 1.0]))
gammas = st.tuples(design_variables, design_variables)
parameters = st.floats(0, 1)
orders = st.tuples(st.integers(0, 2), st.integers(0, 2))

QUARTER = np.array([(1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])


@st.composite
def surfaces(draw: st.DrawFn) -> Surface:
    family_u, family_v = draw(st.sampled_from([(GT, GT), (GT, BERNSTEIN), (BERNSTEIN, GT), (BERNSTEIN, BERNSTEIN)]))
    shape = [draw(st.integers(family.minimum_degree, 8)) + 1 for family in (family_u, family_v)]
    points = np.random.default_rng(draw(st.integers(0, 10**6))).standard_normal((*shape, draw(st.sampled_from([2, 3]))))
    gamma_u, gamma_v = (draw(gammas) if family.takes_gamma else (0.0, 0.0) for family in (family_u, family_v))
    return Surface(points, gamma_u, gamma_v, family_u, family_v)


def scale(surface: Surface, order: tuple[int, int]) -> float:
    """What rounding errors of the derivatives may be compared with."""
    return 30.0 ** sum(order) * abs(surface.control_points).max()


# Values


@given(surfaces(), parameters, parameters, orders)
def test_is_the_sum_of_its_definition(surface: Surface, u: float, v: float, order: tuple[int, int]) -> None:
    n, m = surface.degrees
    rows_u = Basis(n, surface.gamma_u, surface.family_u).derivative(u, order[0])
    rows_v = Basis(m, surface.gamma_v, surface.family_v).derivative(v, order[1])
    expected = sum(rows_u[i] * rows_v[j] * surface.control_points[i, j] for i in range(n + 1) for j in range(m + 1))
    assert abs(surface.derivative(u, v, order) - expected).max() <= 1e-14 * scale(surface, order)


@given(st.integers(1, 8), st.integers(1, 8), parameters, parameters)
def test_classical_tensor_surface(n: int, m: int, u: float, v: float) -> None:
    points = np.random.default_rng(n + 10 * m).standard_normal((n + 1, m + 1, 3))
    surface = Surface(points, family_u=BERNSTEIN, family_v=BERNSTEIN)
    rows_u, rows_v = (
        np.array([math.comb(k, i) * t**i * (1 - t) ** (k - i) for i in range(k + 1)]) for k, t in ((n, u), (m, v))
    )
    assert abs(surface.evaluate(u, v) - np.einsum("i,j,ijd->d", rows_u, rows_v, points)).max() <= 1e-14
    control_u = Surface(n * np.diff(points, axis=0), family_u=BERNSTEIN, family_v=BERNSTEIN) if n > 1 else None
    if control_u is not None:
        assert abs(surface.derivative(u, v) - control_u.evaluate(u, v)).max() <= 1e-13 * n
    at_corner = surface.derivative(0.0, 0.0, (0, 1))
    assert abs(at_corner - m * (points[0, 1] - points[0, 0])).max() <= 1e-14 * m


@given(parameters, parameters)
def test_rotation_without_design_variables_is_a_sphere(u: float, v: float) -> None:
    meridian = [(2, 0), (2, 2), (0, 2)]  # distance from the axis, height
    points = [[(r * x, r * y, z) for x, y in QUARTER] for r, z in meridian]
    assert np.linalg.norm(Surface(points).evaluate(u, v)) == pytest.approx(2, abs=1e-15 * 4)


@given(parameters, parameters)
def test_translational_sweep(u: float, v: float) -> None:
    profile, trajectory = np.random.default_rng(0).standard_normal((2, 5, 3))
    surface = Surface(profile[:, None] + trajectory[None, :3], (0.5, -0.5), (1, 0.3))
    expected = Curve(profile, (0.5, -0.5)).evaluate(u) + Curve(trajectory[:3], (1, 0.3)).evaluate(v)
    assert abs(surface.evaluate(u, v) - expected).max() <= 1e-14


@given(surfaces(), parameters, parameters)
def test_lies_in_the_box_of_its_control_points(surface: Surface, u: float, v: float) -> None:
    point = surface.evaluate(u, v)
    points = surface.control_points.reshape(-1, surface.dimension)
    assert (point >= points.min(axis=0) - 1e-14).all()
    assert (point <= points.max(axis=0) + 1e-14).all()


# Curves on it


@given(surfaces(), parameters)
def test_boundary_curves(surface: Surface, t: float) -> None:
    for side, point in {
        "u0": surface.evaluate(0, t),
        "u1": surface.evaluate(1, t),
        "v0": surface.evaluate(t, 0),
        "v1": surface.evaluate(t, 1),
    }.items():
        assert abs(surface.boundary(side).evaluate(t) - point).max() <= 1e-14
    assert np.array_equal(surface.boundary("u1").control_points, surface.control_points[-1])
    assert np.array_equal(surface.boundary("v0").control_points, surface.control_points[:, 0])


@given(surfaces(), parameters, parameters, st.integers(0, 2))
def test_isoparametric_curves(surface: Surface, u: float, v: float, order: int) -> None:
    along_v, along_u = surface.isoparametric(u=u), surface.isoparametric(v=v)
    bound = 1e-14 * scale(surface, (order, 0))
    assert abs(along_v.derivative(v, order) - surface.derivative(u, v, (0, order))).max() <= bound
    assert abs(along_u.derivative(u, order) - surface.derivative(u, v, (order, 0))).max() <= bound


# Changes


@given(surfaces(), parameters, parameters, orders)
def test_reversed(surface: Surface, u: float, v: float, order: tuple[int, int]) -> None:
    bound = 1e-14 * scale(surface, order)
    expected = (-1) ** order[0] * surface.derivative(1 - u, v, order)
    assert abs(surface.reversed("u").derivative(u, v, order) - expected).max() <= bound
    expected = (-1) ** order[1] * surface.derivative(u, 1 - v, order)
    assert abs(surface.reversed("v").derivative(u, v, order) - expected).max() <= bound
    assert surface.reversed("u").reversed("u") == surface.reversed("v").reversed("v") == surface


@given(surfaces(), parameters, parameters, orders)
def test_transposed(surface: Surface, u: float, v: float, order: tuple[int, int]) -> None:
    expected = surface.transposed().derivative(v, u, order[::-1])
    assert abs(surface.derivative(u, v, order) - expected).max() <= 1e-14 * scale(surface, order)
    assert surface.transposed().transposed() == surface


@given(surfaces(), parameters, parameters, orders)
def test_transformed(surface: Surface, u: float, v: float, order: tuple[int, int]) -> None:
    random = np.random.default_rng(3)
    matrix, translation = random.standard_normal((3, surface.dimension)), random.standard_normal(3)
    expected = matrix @ surface.derivative(u, v, order) + (translation if order == (0, 0) else 0)
    moved = surface.transformed(matrix, translation)
    assert abs(moved.derivative(u, v, order) - expected).max() <= 1e-13 * scale(surface, order) + 1e-14
    assert (moved.gamma_u, moved.family_v) == (surface.gamma_u, surface.family_v)


# Identity


def make(**changes: object) -> Surface:
    arguments = {"control_points": np.arange(27.0).reshape(3, 3, 3), "gamma_u": (0.5, 0.25), "gamma_v": (0.0, 1.0)}
    return Surface(**(arguments | changes))


def test_equality_and_hash() -> None:
    assert make() == make()
    assert hash(make()) == hash(make())
    assert make() != make(gamma_u=(0.5, 0.2))
    assert make() != make(gamma_v=(0.0, 0.9))
    assert make(gamma_v=(0, 0)) != make(gamma_v=(0, 0), family_v=BERNSTEIN)
    assert make() != make(control_points=np.ones((3, 3, 3)))
    assert make() != 3


def test_equal_surfaces_have_equal_hashes_whatever_the_sign_of_zero() -> None:
    surface, other = make(control_points=np.zeros((3, 3, 3))), make(control_points=-np.zeros((3, 3, 3)))
    assert surface == other
    assert hash(surface) == hash(other)


def test_copies() -> None:
    for other in (pickle.loads(pickle.dumps(make())), copy.copy(make()), copy.deepcopy(make())):
        assert other == make()
        assert np.array_equal(other.evaluate(0.3, 0.6), make().evaluate(0.3, 0.6))
    assert dataclasses.replace(make(), gamma_u=(0.0, 0.0)) == make(gamma_u=(0.0, 0.0))


def test_control_points_stay_read_only_in_copies() -> None:
    for other in (make(), pickle.loads(pickle.dumps(make())), copy.deepcopy(make())):
        assert not other.control_points.flags.writeable


def test_cannot_be_changed() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        make().gamma_u = (1.0, 0.0)
    assert (make().degrees, make().dimension) == ((2, 2), 3)
    assert (make().factors_u, make().factors_v) == (Basis(2, (0.5, 0.25)), Basis(2, (0.0, 1.0)))


# Refusals


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"control_points": np.zeros((2, 3, 3))}, "degree"),
        ({"control_points": np.zeros((3, 62, 3))}, "degree"),
        ({"control_points": np.zeros((3, 3))}, "control_points"),
        ({"control_points": np.zeros((3, 3, 4))}, "d = 2 or 3"),
        ({"control_points": np.full((3, 3, 3), math.nan)}, r"control_points\[0, 0, 0\] must be finite"),
        ({"control_points": [[[0, 0, 0]] * 3, [[0, 0, 0]] * 4, [[0, 0, 0]] * 3]}, "control_points"),
        ({"gamma_u": (0, 1.5)}, r"gamma_u\[1\] must lie in \[-1, 1\], got 1\.5"),
        ({"gamma_v": (-2, 0)}, r"gamma_v\[0\]"),
        ({"gamma_v": (1, 0, 0)}, "gamma_v"),
        ({"family_u": BERNSTEIN}, "gamma_u"),
    ],
)
def test_refuses(changes: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        make(**changes)


def test_refuses_unknown_sides_and_directions() -> None:
    with pytest.raises(InputError, match="u0"):
        make().boundary("u2")
    with pytest.raises(InputError, match='"u" or "v"'):
        make().reversed("w")
    for both in ({}, {"u": 0.5, "v": 0.5}):
        with pytest.raises(InputError, match="just one"):
            make().isoparametric(**both)
    with pytest.raises(InputError, match="u must lie in"):
        make().isoparametric(u=1.5)


def test_reference_pieces_can_be_made() -> None:
    pieces = json.loads((Path(__file__).parent / "data" / "pieces.json").read_text())
    for piece in pieces["surfaces"]:
        surface = Surface(piece["control_points"], piece["gamma_u"], piece["gamma_v"])
        assert np.array_equal(surface.evaluate(0, 1), surface.control_points[0, -1])
