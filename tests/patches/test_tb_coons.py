"""TB-Coons patches: the Boolean sum, its cardinal functions, and extremals with a part of the boundary free."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gtcad import BERNSTEIN, Curve, Restricted
from gtcad.errors import InputError
from gtcad.measure import dirichlet_energy
from gtcad.patches import Coons, TBCoons, tb_coons_extremal
from gtcad.patches.minimal import energy
from tests.patches.kinds import FRAME, PART, line
from tests.pieces import random_surface

NAMES = ("c0", "c1", "d0", "d1")
T = np.linspace(0, 1, 9)
X, W = np.polynomial.legendre.leggauss(40)
X, W = (X + 1) / 2, W / 2


def random_patch(seed: int, n: int = 3, k: int = 4) -> TBCoons:
    surface = random_surface(np.random.default_rng(seed), (n, k), 10.0)
    return TBCoons(*(surface.boundary(side) for side in ("v0", "v1", "u0", "u1")))


def with_point(patch: TBCoons, name: str, index: int, step: np.ndarray) -> TBCoons:
    curves = {key: getattr(patch, key) for key in NAMES}
    points = np.array(curves[name].control_points)
    points[index] += step
    curves[name] = Curve(points, curves[name].gamma, curves[name].family)
    return TBCoons(*curves.values())


def test_it_is_the_boolean_sum() -> None:
    patch = TBCoons(*FRAME)
    assert np.array_equal(patch.evaluate(T[:, None], T), Coons(*FRAME).evaluate(T[:, None], T))
    assert patch != Coons(*FRAME)
    copy = pickle.loads(pickle.dumps(patch))
    assert copy == patch
    assert hash(copy) == hash(patch)
    assert patch.inner == (
        ("c0", 1), ("c1", 1), ("d1", 1), ("d1", 2),
    )  # fmt: skip


@settings(max_examples=10)
@given(seed=st.integers(0, 10**6))
def test_cardinal_functions(seed: int) -> None:
    """A step of a control point moves the patch by its cardinal function, such as f_1(u) (1 - v) for c0."""
    patch, step = random_patch(seed), np.array([1.0, -2.0, 3.0])
    base = patch.evaluate(T[:, None], T)
    blends = {"c0": 1 - T, "c1": T, "d0": 1 - T, "d1": T}
    for name, index in patch.inner:
        values = getattr(patch, name).factors.evaluate(T)[:, index]
        product = np.outer(values, blends[name]) if name[0] == "c" else np.outer(blends[name], values)
        moved = with_point(patch, name, index, step).evaluate(T[:, None], T)
        assert abs(moved - base - product[..., None] * step).max() <= 1e-13


@pytest.mark.parametrize("functional", ["dirichlet", "quasi-harmonic", "bending"])
@settings(max_examples=8)
@given(seed=st.integers(0, 10**6), data=st.data())
def test_no_free_points_have_less_energy(functional: str, seed: int, data: st.DataObject) -> None:
    patch = random_patch(seed)
    count = data.draw(st.integers(1, len(patch.inner) - 1))
    rng = np.random.default_rng(seed)
    free = [patch.inner[k] for k in rng.permutation(len(patch.inner))[:count]]
    found = tb_coons_extremal(patch, free, functional)
    for name in NAMES:
        before, after = getattr(patch, name), getattr(found, name)
        moved = {index for key, index in free if key == name}
        kept = [k for k in range(before.degree + 1) if k not in moved]
        assert np.array_equal(before.control_points[kept], after.control_points[kept])
        assert (before.gamma, before.family) == (after.gamma, after.family)
    least = float(energy(found, functional))
    assert least <= energy(patch, functional)
    for name, index in free:
        step = 0.1 * rng.normal(size=3)
        energies = [float(energy(with_point(found, name, index, s * step), functional)) for s in (1, -1)]
        assert min(energies) > least
        assert energies[0] - least == pytest.approx(energies[1] - least, rel=1e-4, abs=1e-10 * least)


def test_the_normal_equations_by_hand() -> None:
    """One free point of one classical boundary: the minimum of a parabola, from integrals of polynomials.

    phi = 2 u (1 - u) (1 - v); S_0 = (u, v, h 2 u (1 - u) v), with the fixed point of c1 at height h.
    int phi_u^2 + phi_v^2 = 4/9 + 4/30, with z: h (4/18 - 4/30), with y: -1/3.
    """
    h = 3.0
    c0 = Curve([[0, 0, 0], [0.5, 0, 0], [1, 0, 0]], family=BERNSTEIN)
    c1 = Curve([[0, 1, 0], [0.5, 1, h], [1, 1, 0]], family=BERNSTEIN)
    patch = TBCoons(c0, c1, line([0, 0, 0], [0, 1, 0]), line([1, 0, 0], [1, 1, 0]))
    found = tb_coons_extremal(patch, [("c0", 1)])
    own, mixed = 4 / 9 + 4 / 30, 4 / 18 - 4 / 30
    assert found.c0.control_points[1] == pytest.approx([0.5, 1 / 3 / own, -h * mixed / own], abs=1e-14)
    least = 1 - (1 / 3) ** 2 / own / 2 + (own - mixed**2 / own) * h**2 / 2
    assert dirichlet_energy(found) == pytest.approx(least, rel=1e-13)


def test_nothing_free_changes_nothing() -> None:
    assert tb_coons_extremal(Coons(*FRAME), []) == TBCoons(*FRAME)


def test_only_corners_fixed_would_collapse() -> None:
    patch = random_patch(1)
    with pytest.raises(InputError, match=r"all 10 boundary control points but the corners are free, .* would collapse"):
        tb_coons_extremal(patch, patch.inner)
    kept = tb_coons_extremal(patch, patch.inner[1:])
    assert energy(kept) < energy(patch)


SMALL = TBCoons(
    line([0, 0, 0], [1, 0, 0]),
    Curve([[0, 1, 0], [0.5, 1, 1], [1, 1, 0]], (-1, -1)),
    Curve([[0, 0, 0], [0, 0.5, 1], [0, 1, 0]]),
    line([1, 0, 0], [1, 1, 0]),
)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: TBCoons(*FRAME[:3], Restricted(PART.shape, (0, 1))), "d1 must be a Curve, got RestrictedCurve"),
        (lambda: TBCoons(*FRAME[::-1]), "corner u = "),
        (lambda: tb_coons_extremal(SMALL, [("c0", 1)]), "free: c0 has no inner control point 1: it has no inner ones"),
        (lambda: tb_coons_extremal(SMALL, [("c1", 2)]), "free: c1 has no inner control point 2: 1 to 1 are inner ones"),
        (lambda: tb_coons_extremal(SMALL, [("c1", 0)]), "free: c1 has no inner control point 0"),
        (lambda: tb_coons_extremal(SMALL, [("e", 1)]), r"free must hold pairs such as \('c0', 1\)"),
        (lambda: tb_coons_extremal(SMALL, ["c1"]), "free must hold pairs .* got 'c1'"),
        (lambda: tb_coons_extremal(SMALL, [("c1", 1.5)]), "free must hold pairs"),
        (lambda: tb_coons_extremal(SMALL, [("d0", 1), ("d0", 1)]), r"\('d0', 1\) is named twice"),
        (lambda: tb_coons_extremal(SMALL, [("c1", 1)]), r"control point \('c1', 1\) has no influence"),
        (lambda: tb_coons_extremal(SMALL, [("d0", 1)], "area"), "functional must be one of dirichlet"),
    ],
)  # fmt: skip
def test_wrong_arguments(call: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        call()
