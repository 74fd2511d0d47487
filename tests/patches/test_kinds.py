"""What holds of every kind of patch."""

from __future__ import annotations

import math
import pickle
from collections import Counter
from functools import cache
from pathlib import Path

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gtcad import Restricted, patches
from gtcad.converters import fit_curve, fit_surface
from gtcad.converters.mesh import mesh_surface
from gtcad.differential import gaussian_curvature, normal
from gtcad.errors import InputError
from gtcad.measure import area
from gtcad.patches import Coons, Lofted, Plateau, Rotation, Ruled, Swept, Swung, TBCoons
from tests import reference
from tests.patches.kinds import NAMES, SAMPLES, partial

T = 1e-4
DEVELOPABLES = {"PlaneFamily", "Developable", "developability"} | {  # with samples in test_developable.py
    *("Enveloping", "SpineDevelopable", "GeodesicDevelopable", "QuasiDevelopable"),
    *("spine_developable", "geodesic_developable", "quasi_developable"),
}
PLACES = [(0.0, 0.0), (0.37, 0.81), (1.0, 0.25), (0.6, 1.0)]

every_kind = pytest.mark.parametrize("sample", SAMPLES, ids=NAMES)


@cache
def fitted(patch):
    return fit_surface(patch, tolerance=T)


@every_kind
def test_points_are_those_of_the_definition(sample):
    for u, v in PLACES:
        with mp.workdps(reference.DIGITS):
            expected = [float(x) for x in sample.formula(mp.mpf(u), mp.mpf(v))]
        assert abs(sample.patch.evaluate(u, v) - expected).max() <= 2e-15 * sample.size


@every_kind
@pytest.mark.parametrize("orders", [(1, 0), (0, 1), (1, 1), (2, 1), (0, 2), (3, 0)])
def test_derivatives_are_those_of_the_definition(sample, orders):
    u, v = 0.37, 0.81
    expected = partial(sample.formula, u, v, orders)
    found = sample.patch.derivative(u, v, orders)
    bounds = sample.patch.factors_u.derivative_bound(orders[0]), sample.patch.factors_v.derivative_bound(orders[1])
    assert abs(found - expected).max() <= 2e-15 * sample.size * math.prod(max(1, bound) for bound in bounds)


@every_kind
@pytest.mark.parametrize("order", range(6))
def test_bounds_of_derivatives_hold(sample, order):
    t = np.linspace(0, 1, 501)
    for factors in (sample.patch.factors_u, sample.patch.factors_v):
        largest = abs(factors.rows(t, order)).sum(axis=0).max()
        assert largest <= factors.derivative_bound(order) * (1 + 1e-14)


@every_kind
@settings(max_examples=10)
@given(seed=st.integers(0, 10**6), u=st.floats(0, 1), v=st.floats(0, 1))
def test_affine_images(sample, seed, u, v):
    rng = np.random.default_rng(seed)
    matrix, offset = rng.normal(size=(int(rng.integers(2, 4)), 3)), rng.normal(size=3)
    offset = 50 * offset[: len(matrix)]
    patch = sample.patch
    moved = patch.transformed(matrix, offset)
    assert type(moved) is type(patch)
    assert moved.dimension == len(matrix)
    size = 1e-14 * (sample.size * np.linalg.norm(matrix) + 150)
    assert abs(moved.evaluate(u, v) - (matrix @ patch.evaluate(u, v) + offset)).max() <= size
    assert abs(patch.transformed(matrix).evaluate(u, v) - matrix @ patch.evaluate(u, v)).max() <= size
    if len(matrix) == 3:
        again = moved.transformed(matrix, offset)
        expected = matrix @ (matrix @ patch.evaluate(u, v) + offset) + offset
        assert abs(again.evaluate(u, v) - expected).max() <= size * (2 + np.linalg.norm(matrix))


@every_kind
def test_grids_and_points_agree(sample):
    u, v = np.linspace(0, 1, 7), np.linspace(0, 1, 5)
    grid = sample.patch.evaluate(u[:, None], v[None, :])
    points = sample.patch.evaluate(*np.meshgrid(u, v, indexing="ij"))
    assert abs(grid - points).max() <= 1e-15 * sample.size


@every_kind
def test_equal_patches_and_copies(sample):
    patch = sample.patch
    copy = pickle.loads(pickle.dumps(patch))
    assert copy == patch
    assert hash(copy) == hash(patch)
    assert copy is not patch
    assert patch != patch.transformed(2 * np.eye(3))
    assert patch.transformed(np.eye(3)).terms == patch.terms
    assert len({patch, copy, patch.transformed(2 * np.eye(3))}) == 2
    with pytest.raises(ValueError, match="read-only"):
        patch.coefficients[0] = 0


@every_kind
def test_isoparametric_curves(sample):
    t = np.linspace(0, 1, 9)
    patch, near = sample.patch, 1e-15 * sample.size
    assert abs(patch.isoparametric(u=0.3).evaluate(t) - patch.evaluate(0.3, t)).max() <= near
    assert abs(patch.isoparametric(v=0.3).evaluate(t) - patch.evaluate(t, 0.3)).max() <= near
    for side, place in (("u0", (0.0, t)), ("u1", (1.0, t)), ("v0", (t, 0.0)), ("v1", (t, 1.0))):
        assert abs(patch.boundary(side).evaluate(t) - patch.evaluate(*place)).max() <= near


def test_isoparametric_curves_that_there_are_not():
    patch = SAMPLES[0].patch
    for wrong in ({}, {"u": 0.5, "v": 0.5}):
        with pytest.raises(InputError, match="just one of u and v"):
            patch.isoparametric(**wrong)
    with pytest.raises(InputError, match=r"u must lie in \[0, 1\], got 1.5"):
        patch.isoparametric(u=1.5)
    with pytest.raises(InputError, match='side must be "u0", "u1", "v0" or "v1"'):
        patch.boundary("w0")


@every_kind
def test_fits_keep_the_tolerance(sample):
    patch = sample.patch
    fit = fitted(patch)
    assert fit.deviation[1] <= T
    assert (fit.spline.degree_v == 1) == isinstance(patch, Ruled)
    t = np.linspace(0, 1, 151)
    u, v = (way(t) for way in fit.parameter_map)
    model = patch.evaluate(u[:, None], v[None, :])
    gaps = np.linalg.norm(model - fit.spline.evaluate(t[:, None], t[None, :]), axis=-1)
    assert fit.deviation[0] * 0.95 - 1e-12 <= gaps.max() <= fit.deviation[1]


@every_kind
def test_parts_are_fitted_too(sample):
    part = Restricted(sample.patch, ((0.7, 0.2), (0.5, 1.0)))
    fit = fit_surface(part, tolerance=T)
    assert fit.deviation[1] <= T
    u, v = (way(np.linspace(0, 1, 33)) for way in fit.parameter_map)
    model = sample.patch.evaluate(0.7 - 0.5 * u[:, None], 0.5 + 0.5 * v[None, :])
    t = np.linspace(0, 1, 33)
    assert np.linalg.norm(model - fit.spline.evaluate(t[:, None], t[None, :]), axis=-1).max() <= T


@every_kind
def test_boundaries_are_fitted(sample):
    for side in ("u0", "v1"):
        curve = sample.patch.boundary(side)
        if float(np.ptp(curve.evaluate(np.linspace(0, 1, 9)), axis=0).max()) > 1e-9:
            assert fit_curve(curve, tolerance=T).deviation[1] <= T


@every_kind
def test_meshes(sample):
    mesh = mesh_surface(sample.patch, tolerance=0.05)
    assert mesh.deviation <= 0.05
    exact_area = float(area(sample.patch, rtol=1e-8))
    assert mesh.area == pytest.approx(exact_area, rel=0.02)
    edges = Counter(frozenset(pair) for t in mesh.triangles.tolist() for pair in zip(t, t[1:] + t[:1], strict=True))
    assert max(edges.values()) <= 2
    assert (min(edges.values()) == 2) == (sample.name in ("rotation, full", "sphere"))


@every_kind
def test_normals_and_curvatures_from_the_definition(sample):
    u, v = 0.37, 0.81
    patch = sample.patch
    orders = ((1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
    partials = {order: np.array(partial(sample.formula, u, v, order)) for order in orders}
    su, sv = partials[1, 0], partials[0, 1]
    across = np.cross(su, sv)
    unit = across / np.linalg.norm(across)
    assert abs(normal(patch, u, v) - unit).max() <= 1e-13
    second = [float(unit @ partials[order]) for order in orders[2:]]
    curved = (second[0] * second[2] - second[1] ** 2) / (across @ across)
    scale = (second[1] ** 2 + abs(second[0] * second[2])) / (across @ across) + 1e-6
    assert abs(float(gaussian_curvature(patch, u, v)) - curved) <= 1e-11 * scale


def test_step_files_hold_what_is_proved(tmp_path: Path):
    pytest.importorskip("OCP")
    from gtcad.converters.check import check_parts
    from gtcad.converters.part import Part
    from gtcad.converters.step import read_step, write_step

    shapes = {sample.name: sample.patch for sample in SAMPLES}
    parts = [Part(name, fitted(patch).spline) for name, patch in shapes.items()]
    write_step(tmp_path / "patches.step", parts, tolerance=T)
    found = read_step(tmp_path / "patches.step")
    assert [part.name for part in found] == NAMES
    assert all(part.valid and not part.trimmed for part in found)
    report = check_parts(found, shapes, T)
    assert [(row.name, row.verdict) for row in report.rows] == [(name, "proved") for name in NAMES]


def test_names_of_the_package():
    classes = {type(sample.patch) for sample in SAMPLES}
    assert classes == {Ruled, Swept, Swung, Rotation, Lofted, Coons, Plateau, TBCoons}
    functions = {"cylinder", "cone", "coons_from_loop", "sweep_parts"}
    functions |= {"dirichlet_extremal", "fixed_contour", "minimal_patch", "minimal_table"}
    functions |= {"area_bounds", "least_area", "tb_coons_extremal"}
    assert set(patches.__all__) == {kind.__name__ for kind in classes} | {"Sweep"} | functions | DEVELOPABLES
    assert set(patches.__all__) <= set(dir(patches))
