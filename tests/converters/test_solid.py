from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gtcad import Restricted, Surface
from gtcad.converters.occt.compat import kernel_module
from gtcad.converters.occt.pieces import ShapeKey, is_valid, subshapes
from gtcad.converters.occt.shells import EdgeUses, edge_uses
from gtcad.converters.quilt_fit import fit_quilt
from gtcad.converters.solid import solid_of
from gtcad.errors import InputError, KernelError
from gtcad.quilt import Quilt
from tests.converters import bodies

TOLERANCE = 1e-5


def check(body, volume, uses):
    """What holds for every body: valid, each edge in two faces, and the volume within deviation times area."""
    assert is_valid(body.shape)
    assert edge_uses(body.shape) == uses
    assert body.exact_volume == pytest.approx(volume, rel=1e-11)
    assert abs(body.volume - volume) <= body.deviation * body.area + 1e-9 * volume
    assert body.deviation <= TOLERANCE
    assert body.proved
    in_shape = {ShapeKey(face) for face in subshapes(body.shape, "FACE")}
    assert {ShapeKey(face) for face in body.faces.values()} == in_shape
    assert len(body.faces) == len(in_shape)


@pytest.mark.parametrize(
    ("patches", "volume", "uses"),
    [
        (bodies.box(), 6000, EdgeUses(shared=12)),
        ([bodies.sphere()], 32 * math.pi / 3, EdgeUses(seams=1, degenerate=2)),
        (bodies.sphere().quarters(), 32 * math.pi / 3, EdgeUses(shared=4, degenerate=8)),
        ([bodies.torus()], 40 * math.pi**2, EdgeUses(seams=2)),
        (bodies.torus().quarters(), 40 * math.pi**2, EdgeUses(shared=4, seams=4)),
    ],
    ids=["box", "sphere", "quarters of a sphere", "torus", "quarters of a torus"],
)
def test_closed_quilts_become_solids_of_their_volume(patches, volume, uses):
    body = solid_of(bodies.fitted(patches, TOLERANCE))
    check(body, volume, uses)
    assert list(body.faces) == [f"patch {k + 1}" for k in range(len(patches))]


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("quarters", [False, True])
def test_tubes_get_planar_caps_and_normals_outwards(quarters, turned):
    whole = bodies.barrel()
    patches = whole.quarters() if quarters else (whole,)
    if turned:
        patches = tuple(Restricted(patch, ((1, 0), (0, 1))) for patch in patches)
    body = solid_of(bodies.fitted(patches, TOLERANCE), caps="planar")
    check(body, bodies.barrel_volume(), EdgeUses(shared=12) if quarters else EdgeUses(shared=2, seams=1))
    assert list(body.faces)[-2:] == ["cap 1", "cap 2"]


@settings(max_examples=6)
@given(st.lists(st.integers(0, 7), min_size=4, max_size=4), st.integers(0, 99))
def test_patches_may_run_any_way_and_lie_anywhere(variants, seed):
    turn = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    patches = []
    for patch, number in zip(bodies.barrel().quarters(), variants, strict=True):
        u, v = (1, 0) if number & 2 else (0, 1), (1, 0) if number & 4 else (0, 1)
        patches.append(Restricted(patch, (u, v)).transformed(turn, [3, 1, -4]))
    body = solid_of(bodies.fitted(patches, TOLERANCE), caps="planar")
    check(body, bodies.barrel_volume(), EdgeUses(shared=12))


def test_a_box_without_a_lid_gets_one():
    body = solid_of(bodies.fitted(bodies.box()[:5], TOLERANCE), caps="planar")
    check(body, 6000, EdgeUses(shared=12))
    assert list(body.faces)[5] == "cap 1"


def test_caps_take_no_name_that_a_patch_has():
    quilt = Quilt.recognised([bodies.cylinder()], names=["cap 1"])
    body = solid_of(fit_quilt(quilt, tolerance=TOLERANCE), caps="planar")
    assert list(body.faces) == ["cap 1", "cap 2", "cap 3"]
    check(body, 12 * math.pi, EdgeUses(shared=2, seams=1))


def test_what_is_no_body_is_refused():
    open_one = bodies.fitted(bodies.box()[:5])
    with pytest.raises(InputError, match=r"these sides are free: patch 1\.\w\d, .*caps can close plane loops"):
        solid_of(open_one)
    with pytest.raises(InputError, match=r'caps must be "none" or "planar", got \'round\''):
        solid_of(open_one, caps="round")
    with pytest.raises(InputError, match="is not plane: it lies up to"):
        solid_of(bodies.fitted(bodies.box()[:3]), caps="planar")
    plane = Surface([[[0, 0], [0, 1], [0, 2]], [[1, 0], [1, 1], [1, 2]], [[2, 0], [2, 1], [2, 2]]])
    with pytest.raises(InputError, match="patches in space, d = 3, got d = 2"):
        solid_of(bodies.fitted([plane]), caps="planar")
    x = np.linspace(0, 2, 3)
    flat = Surface(np.stack([*np.meshgrid(x, x), np.zeros((3, 3))], axis=-1))
    with pytest.raises(InputError, match="the surface encloses no volume"):
        solid_of(bodies.fitted([flat]), caps="planar")
    apart = [patch.transformed(np.eye(3), shift) for patch in [bodies.sphere()] for shift in ([0, 0, 0], [9, 0, 0])]
    with pytest.raises(InputError, match="fall into 2 separate parts"):
        solid_of(bodies.fitted(apart))


def test_a_kernel_solid_of_another_volume_is_refused():
    fit = bodies.fitted([bodies.sphere()])
    grown = tuple(spline.with_control_points(1.0001 * spline.control_points) for spline in fit.splines)
    with pytest.raises(KernelError, match=r"volume 33\.52.* the exact surface 33\.51.* apart, allowed are"):
        solid_of(replace(fit, splines=grown))


STEP = kernel_module("STEPControl")


@pytest.mark.parametrize(
    ("patches", "caps"),
    [(bodies.box(), "none"), ([bodies.sphere()], "none"), ([bodies.torus()], "none"), ([bodies.barrel()], "planar")],
    ids=["box", "sphere", "torus", "barrel"],
)
def test_step_keeps_the_solid(tmp_path, patches, caps):
    body = solid_of(bodies.fitted(patches, TOLERANCE), caps=caps)
    path = str(tmp_path / "body.step")
    writer = STEP.STEPControl_Writer()
    writer.Transfer(body.shape, STEP.STEPControl_StepModelType.STEPControl_AsIs)
    writer.Write(path)
    reader = STEP.STEPControl_Reader()
    reader.ReadFile(path)
    reader.TransferRoots()
    back = reader.OneShape()
    assert [str(back.ShapeType()).rpartition("_")[2], is_valid(back)] == ["SOLID", True]
    assert edge_uses(back) == edge_uses(body.shape)
    properties = kernel_module("GProp").GProp_GProps()
    kernel_module("BRepGProp").BRepGProp.VolumeProperties_s(back, properties, 1e-9)
    assert properties.Mass() == pytest.approx(body.volume, rel=1e-9)
