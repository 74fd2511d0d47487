"""Tables of minimal patches: what they say, and that areas are compared over one contour only."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gtcad import BERNSTEIN, GT, Curve, Surface
from gtcad.differential import mean_curvature
from gtcad.errors import InputError
from gtcad.patches import Rotation, fixed_contour, minimal_patch, minimal_table
from gtcad.patches.minimal_study import FUNCTIONALS, largest_mean_curvature, same_contour
from tests.patches.kinds import FRAME
from tests.patches.surfaces import catenoid, skew_quadrilateral

NET = np.array([[[i, j, 0.3 * ((i * i + 2 * j) % 3)] for j in range(4)] for i in range(4)], dtype=float)


def test_each_functional_is_least_in_its_own_row() -> None:
    for table in (minimal_table(FRAME, degree=4, gamma_u=(0.3, 0), families=[GT]), minimal_table(NET, families=[GT])):
        by_functional = {entry.functional: entry for entry in table.entries}
        assert tuple(by_functional) == FUNCTIONALS
        rows = by_functional.values()
        assert min(row.dirichlet_energy for row in rows) == by_functional["dirichlet"].dirichlet_energy
        assert min(row.residual for row in rows) == by_functional["quasi-harmonic"].residual
        assert min(row.area for row in rows) == by_functional["area"].area
        assert all(row.area < row.dirichlet_energy for row in rows)
        excess = table.area_excess()
        assert min(excess) == excess[FUNCTIONALS.index("area")] == 0


def test_a_table_says_which_setting_and_which_contour() -> None:
    free = minimal_table(NET, gamma_u=(0.5, 0.5))
    assert {row[0] for row in free.rows()} == {"free boundary"}
    assert [row[4] for row in free.rows()] == [1] * 4 + [2] * 4  # the boundary moves with the family
    with pytest.raises(InputError, match="areas are compared over one contour only, and these patches have several"):
        free.area_excess()
    fixed = minimal_table(FRAME, degree=(3, 4), functionals=["dirichlet", "bending"])
    assert [row[:5] for row in fixed.rows()] == [
        ("fixed contour", family, functional, "3x4", 1)
        for family in ("GT", "bernstein")
        for functional in ("dirichlet", "bending")
    ]
    assert len(fixed.area_excess()) == 4


def test_straight_edges_are_one_contour_for_all() -> None:
    corners = np.array([[0, 0, 0], [1, 0, 1], [1, 1, 0], [0, 1, 1]], dtype=float)
    t = np.linspace(0, 1, 4)
    u, v = t[:, None, None], t[None, :, None]
    net = (1 - u) * ((1 - v) * corners[0] + v * corners[3]) + u * ((1 - v) * corners[1] + v * corners[2])
    table = minimal_table(net, gamma_u=(1, 1), gamma_v=(1, 1), functionals=["dirichlet"])
    assert {row[4] for row in table.rows()} == {1}
    gt, classical = table.area_excess(skew_quadrilateral().area)
    assert classical == pytest.approx(1.2807892752734 / 1.27926157117100646 - 1, rel=1e-9)
    assert gt > 0
    assert table.entries[0].dirichlet_energy == pytest.approx(1.2956353421, abs=1e-10)
    assert not same_contour(table.entries[0].patch, table.entries[0].patch.reversed("u"))
    assert not same_contour(table.entries[0].patch, table.entries[0].patch.transformed(1.0001 * np.eye(3)))
    assert not same_contour(table.entries[0].patch, Surface(net[..., :2]))


def test_a_true_minimal_surface_has_no_mean_curvature() -> None:
    surface = catenoid()
    table = minimal_table(surface.contour, degree=8, families=[GT], functionals=["dirichlet", "area"])
    rough, fine = table.area_excess(surface.area)
    assert rough > 1e-6
    assert 1e-9 > fine > -1e-12
    curvatures = [entry.mean_curvature for entry in table.entries]
    assert curvatures[1] < 1e-4 < curvatures[0]


def test_a_table_prints() -> None:
    table = minimal_table(FRAME, degree=3, functionals=["dirichlet"])
    lines = str(table).splitlines()
    words = "setting family functional degrees contour area Dirichlet energy residual max |H|"
    assert lines[0].split() == words.split()
    assert len(lines) == 4
    assert lines[2].startswith("fixed contour  GT         dirichlet   3x3      1        ")
    assert float(lines[2].split()[6]) == pytest.approx(float(table.entries[0].area), rel=1e-8)
    assert table.columns[5:] == ("area", "Dirichlet energy", "residual", "max |H|")


def test_the_largest_mean_curvature_is_found_between_samples() -> None:
    torus = Rotation(Curve([[4, 0, 0], [4, 0, 1], [3, 0, 1]]), [0, 0, 0], [0, 0, 1], 90)
    # curvatures 1 of the tube and cos / (3 + cos) around it
    assert largest_mean_curvature(torus) == pytest.approx((1 + 1 / 4) / 2, rel=1e-9)
    wavy = Surface(
        np.random.default_rng(1).normal(size=(5, 5, 3)) * 0.2
        + np.array([[[i, j, 0] for j in range(5)] for i in range(5)])
    )
    t = np.linspace(0, 1, 800)
    dense = abs(mean_curvature(wavy, t[:, None], t[None, :])).max()
    assert dense * (1 - 1e-12) <= largest_mean_curvature(wavy) <= dense * 1.01
    assert largest_mean_curvature(Surface(NET[..., :2])) == 0.0
    octant = Surface([[[0, 0, 1]] * 3, [[1, 0, 1], [1, 1, 1], [0, 1, 1]], [[1, 0, 0], [1, 1, 0], [0, 1, 0]]])
    assert largest_mean_curvature(octant) == pytest.approx(1, rel=1e-6)


def test_minimal_patches_by_name() -> None:
    assert minimal_patch(FRAME, "bending", degree=3) == fixed_contour(FRAME, 3, "bending")
    film = minimal_patch(FRAME, "area", degree=3, family=BERNSTEIN)
    assert film.family is BERNSTEIN


ONE = minimal_table(FRAME, degree=2, families=[GT], functionals=["dirichlet"])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: minimal_patch(NET, "volume"), "functional must be one of dirichlet, quasi-harmonic, bending, area"),
        (lambda: minimal_patch(FRAME), "degree is needed for a fixed contour"),
        (lambda: minimal_patch(NET, degree=3), "degree is that of the net, got 3"),
        (lambda: ONE.area_excess(0), "reference must be above 0, got 0"),
        (lambda: ONE.area_excess(math.nan), "reference must be above 0, got nan"),
        (lambda: minimal_table(FRAME, degree=3, families=[]).area_excess(), "there are no patches to compare"),
    ],
)  # fmt: skip
def test_wrong_arguments(call: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        call()
