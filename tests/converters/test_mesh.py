"""Meshes: the proof against dense samples of the exact surfaces, what neighbours share, and the files."""

from __future__ import annotations

import itertools
import json
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from typer.testing import CliRunner

import gtcad
from gtcad import BERNSTEIN, Curve, Restricted, Surface, cli, measure
from gtcad.converters import mesh as meshing
from gtcad.converters.mesh import Mesh, combined, mesh_surface, mesh_surfaces, write_mesh
from gtcad.converters.triangles import Bounds, divided
from gtcad.errors import ExtraMissing, FileError, InputError, ToleranceBelowPrecision, ToleranceNotMet
from gtcad.patches import Rotation
from gtcad.protocol import SeparableSurface
from gtcad.quilt import Quilt
from gtcad.solid import Solid
from tests.pieces import random_surface, surfaces

trimesh: Any = pytest.importorskip("trimesh")
Array = NDArray[np.float64]

ARC, RISE, ONE = (1.0, 1.0, 0.0), (0.0, 1.0, 1.0), (1.0, 1.0, 1.0)  # cos, sin and 1 at degree 2, gamma (0, 0)
DEGREES = [(2, 2), (3, 5), (4, 2), (6, 6), (8, 3), (7, 8)]


def octants(radius: float = 10.0) -> dict[str, Surface]:
    """A sphere; every second octant is turned inside out, and each is collapsed at a pole."""
    net = radius * np.stack([np.outer(ARC, ARC), np.outer(RISE, ARC), np.outer(ONE, RISE)], axis=-1)
    return {str(signs): Surface(net * signs) for signs in itertools.product((1, -1), repeat=3)}


def box(size: Array) -> dict[str, Surface]:
    """The six faces of a box, in directions that chance gave them."""
    rng, faces = np.random.default_rng(3), {}
    s = np.linspace(0, 1, 3)
    for axis, end in itertools.product(range(3), (0.0, 1.0)):
        net = np.full((3, 3, 3), end)
        net[..., (axis + 1) % 3], net[..., (axis + 2) % 3] = np.meshgrid(s, s, indexing="ij")
        face = Surface(net * size)
        for change in (face.reversed("u"), face.transposed(), face.reversed("v")):
            face = change if rng.random() < 0.5 else face
        faces[f"{axis} {end}"] = face
    return faces


def tube(gamma: float = 0.0) -> Surface:
    """Closed in u, its end v1 a point."""
    angle = np.linspace(0, 2 * np.pi, 7)
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)
    ring[-1] = ring[0]
    net = np.stack([ring * width + [0, 0, height] for width, height in ((3, 0), (3, 3), (1, 5), (0, 5))], axis=1)
    return Surface(net, gamma_v=(gamma, gamma), family_u=BERNSTEIN)


def file_mesh(mesh: Mesh) -> Any:
    return trimesh.Trimesh(mesh.vertices, mesh.triangles, process=False)


def deviations(surface: SeparableSurface, tolerance: float) -> tuple[float, float, Mesh]:
    """Largest true distance at sampled parameters of all triangles, and the proved bound."""
    mesher = meshing._Mesher([surface], 10**6)
    seen = []
    original = meshing.triangulated

    def watched(*arguments: Any) -> Any:
        seen.append(original(*arguments))
        return seen[-1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(meshing, "triangulated", watched)
        meshes, _ = mesher.meshes(tolerance)
    grid, mesh = seen[-1], meshes[0]
    weights = np.array([(i, j, 8 - i - j) for i in range(9) for j in range(9 - i)]) / 8
    corners = grid.parameters[grid.triangles]
    places = np.clip(np.einsum("kc,mcd->mkd", weights, corners), 0, 1)
    flat = np.einsum("kc,mcd->mkd", weights, surface.evaluate(corners[..., 0], corners[..., 1]))
    true = np.linalg.norm(surface.evaluate(places[..., 0], places[..., 1]) - flat, axis=-1)
    return float(true.max()), mesh.deviation, mesh


def cases() -> list[tuple[SeparableSurface, float]]:
    rng = np.random.default_rng(11)
    found: list[tuple[SeparableSurface, float]] = []
    for size, degrees in itertools.product((1.0, 300.0), DEGREES):
        surface = random_surface(rng, degrees, size)
        found += [(surface, size * 10 ** rng.uniform(-4, -1.5)), (surface, size * 0.05)]
        part = Restricted(surface, ((0.9, 0.2), (0.1, 0.7)))
        found.append((part, size * 1e-3))
        classical = Surface(surface.control_points, family_u=BERNSTEIN, gamma_v=surface.gamma_v)
        found.append((classical, size * 1e-3))
    return found


def test_the_proof_holds_and_is_tight() -> None:
    ratios = []
    for surface, tolerance in cases():
        true, proved, mesh = deviations(surface, tolerance)
        assert true <= proved <= tolerance
        assert mesh.triangles.max() == len(mesh.vertices) - 1
        ratios.append(proved / true)
    assert np.median(ratios) < 2.2
    assert max(ratios) < 4


def test_the_bounds_of_second_derivatives_hold_and_are_tight() -> None:
    rng = np.random.default_rng(5)
    inside = (np.arange(16 * 8) + 0.5) / (16 * 8)
    for degrees in (*DEGREES, (20, 40)):
        surface = random_surface(rng, degrees, 10.0)
        bounds = Bounds.of(surface)
        for bound, orders in zip(bounds.blocks, ((2, 0), (1, 1), (0, 2)), strict=True):
            norms = np.linalg.norm(surface.derivative(inside[:, None], inside[None, :], orders), axis=-1)
            largest = norms.reshape(16, 8, 16, 8).max(axis=(1, 3))
            assert (largest <= bound).all()
            assert bound.max() <= (1.3 if max(degrees) <= 8 else 1.7) * largest.max()


def test_triangles_cover_the_square_once() -> None:
    for surface, tolerance in cases()[:12]:
        mesh = mesh_surface(surface, tolerance=tolerance)
        net = file_mesh(mesh)
        assert net.is_winding_consistent
        assert net.euler_number == 1
        assert mesh.area == pytest.approx(float(measure.area(surface, rtol=1e-6)), rel=0.15)


def test_the_number_of_triangles_follows_the_tolerance() -> None:
    surface = random_surface(np.random.default_rng(2), (4, 3), 100.0)
    counts = [len(mesh_surface(surface, tolerance=t).triangles) for t in (1e-1, 1e-2, 1e-3)]
    assert counts[1] / counts[0] == pytest.approx(10, rel=0.2)
    assert counts[2] / counts[1] == pytest.approx(10, rel=0.2)


def test_flat_and_straight_directions_cost_nothing() -> None:
    plane = Surface([[[0, 0], [0, 3]], [[2, 0], [2, 3]]], family_u=BERNSTEIN, family_v=BERNSTEIN)
    mesh = mesh_surface(plane, tolerance=1e-6)
    assert len(mesh.triangles) == 4
    assert (mesh.vertices[:, 2] == 0).all()
    net = np.stack([np.outer(ARC, (1, 1)), np.outer(RISE, (1, 1)), np.outer(ONE, (0, 50))], axis=-1)
    cylinder = mesh_surface(Surface(net, family_v=BERNSTEIN), tolerance=1e-3)
    assert len(cylinder.triangles) < 8 * math.pi / 2 / math.sqrt(8e-3)
    turned = Surface(net.swapaxes(0, 1), family_u=BERNSTEIN)
    assert len(mesh_surface(turned, tolerance=1e-3).triangles) == len(cylinder.triangles)


@pytest.mark.parametrize("tolerance", [1.0, 0.1, 1e-2])
def test_a_sphere_of_octants_is_watertight(tolerance: float) -> None:
    shapes = octants()
    meshes = mesh_surfaces(shapes, tolerance=tolerance)
    body = file_mesh(combined(meshes))
    assert body.is_watertight
    assert body.is_winding_consistent
    assert body.euler_number == 2
    assert body.area_faces.min() > 0
    exact = sum(abs(float(measure.volume(shape))) for shape in shapes.values())
    assert exact == pytest.approx(4000 * np.pi / 3, rel=1e-12)
    assert 0 < exact - body.volume <= tolerance * 400 * np.pi
    for name, mesh in meshes.items():
        assert mesh.deviation <= tolerance, name
        assert mesh.volume > 0, name
        np.testing.assert_allclose(np.linalg.norm(mesh.vertices, axis=1), 10, rtol=1e-14)


def test_a_box_is_watertight_whichever_way_its_faces_run() -> None:
    size = np.array([7.0, 2.0, 0.3])
    meshes = mesh_surfaces(box(size), tolerance=1e-3)
    body = file_mesh(combined(meshes))
    assert body.is_watertight
    assert body.is_winding_consistent
    assert body.euler_number == 2
    assert body.volume == pytest.approx(size.prod(), abs=1e-3 * 2 * (14 + 0.6 + 2.1))


def test_neighbours_that_bend_differently_share_their_vertices() -> None:
    rng = np.random.default_rng(8)
    left = random_surface(rng, (5, 4), 10.0)
    points = random_surface(rng, (7, 4), 10.0).control_points * [1, 1, 9] + [10.0, 0, 0]
    points[0] = left.control_points[-1]
    right = Surface(points, gamma_v=left.gamma_v)
    for other in (right, right.reversed("v"), right.transposed(), right.transposed().reversed("u")):
        meshes = mesh_surfaces({"left": left, "right": other}, tolerance=1e-2)
        whole = combined(meshes)
        assert file_mesh(whole).euler_number == 1
        assert file_mesh(whole).is_winding_consistent
        shared = sum(len(mesh.vertices) for mesh in meshes.values()) - len(whole.vertices)
        assert shared > 5


def test_parts_of_one_surface_are_sewn_along_the_cut() -> None:
    surface = random_surface(np.random.default_rng(9), (4, 5), 50.0)
    halves = {
        "a": Restricted(surface, ((0.0, 0.3), (0.0, 1.0))),
        "b": Restricted(surface, ((1.0, 0.3), (1.0, 0.0))),
    }
    assert file_mesh(combined(mesh_surfaces(halves, tolerance=1e-2))).euler_number == 1


@pytest.mark.parametrize("gamma", [0.0, -1.0, 0.7])
def test_closed_and_collapsed_sides_are_one(gamma: float) -> None:
    surface = tube(gamma)
    true, proved, mesh = deviations(surface, 1e-2)
    assert true <= proved <= 1e-2
    cup = file_mesh(mesh)
    assert cup.euler_number == 1
    assert cup.is_winding_consistent
    assert cup.area_faces.min() > 0
    lid = tube(gamma).transformed(np.diag([1, 1, -0.5]))
    both = file_mesh(combined(mesh_surfaces({"cup": surface, "lid": lid}, tolerance=1e-2)))
    assert both.is_watertight
    assert both.euler_number == 2
    assert both.volume > 0


@pytest.mark.parametrize("tolerance", [1e3, 1.0, 1e-2])
def test_a_patch_closed_both_ways_is_a_torus(tolerance: float) -> None:
    angle = np.append(np.linspace(0, 2 * np.pi, 8, endpoint=False), 0)
    a, b = np.meshgrid(angle, angle, indexing="ij")
    width = 5 + 2 * np.cos(b)
    net = np.stack([width * np.cos(a), width * np.sin(a), 2 * np.sin(b)], axis=-1)
    ring = Surface(net, family_u=BERNSTEIN, family_v=BERNSTEIN)
    body = file_mesh(mesh_surface(ring, tolerance=tolerance))
    assert body.is_watertight
    assert body.is_winding_consistent
    assert body.euler_number == 0
    exact = abs(float(measure.volume(ring)))
    assert abs(exact - body.volume) <= tolerance * float(measure.area(ring, rtol=1e-6))


def test_the_coarsest_mesh_is_within_any_tolerance() -> None:
    twisted = Surface([[[0, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 1]]], family_u=BERNSTEIN, family_v=BERNSTEIN)
    for tolerance in (1e3, 1e-3):
        true, proved, _ = deviations(twisted, tolerance)
        assert true <= proved <= min(2.01 * true, tolerance)
    assert len(mesh_surface(twisted, tolerance=1e3).triangles) == 4


def test_two_patches_between_the_same_corners_stay_two() -> None:
    arch = Surface([[[0, 0, 0], [4, 0, 0]], [[0, 1, 1], [4, 1, 1]], [[0, 2, 0], [4, 2, 0]]], family_v=BERNSTEIN)
    floor = Surface([[[0, 0, 0], [4, 0, 0]], [[0, 2, 0], [4, 2, 0]]], family_u=BERNSTEIN, family_v=BERNSTEIN)
    mesh = combined(mesh_surfaces({"arch": arch, "floor": floor}, tolerance=0.5))
    assert file_mesh(mesh).is_winding_consistent
    assert file_mesh(mesh).euler_number == 0  # a tunnel, open at both ends


def test_divisions_are_symmetric_and_have_equal_shares() -> None:
    density = np.random.default_rng(4).uniform(1, 50, 16)
    t = divided(density, 1)
    np.testing.assert_allclose(1 - divided(density[::-1], 1)[::-1], t, atol=1e-12)
    assert divided(np.zeros(16), 1).tolist() == [0, 1]
    assert len(divided(np.zeros(16), 3)) == 4
    assert (np.diff(t) > 0).all()


def test_refusals_carry_proved_numbers() -> None:
    surface = surfaces()[next(iter(surfaces()))]
    with pytest.raises(ToleranceNotMet, match="max_triangles = 500 reached") as caught:
        mesh_surface(surface, tolerance=1e-6, max_triangles=500)
    assert caught.value.requested == 1e-6
    assert len(mesh_surface(surface, tolerance=caught.value.achieved * 1.5).triangles) <= 500
    with pytest.raises(ToleranceBelowPrecision) as below:
        mesh_surface(surface, tolerance=1e-15)
    assert below.value.floor > 1e-15
    with pytest.raises(InputError, match="max_triangles must be at least"):
        mesh_surfaces(octants(), tolerance=1.0, max_triangles=20)


def test_wrong_arguments_are_named() -> None:
    surface: Any = octants()["(1, 1, 1)"]
    curve: Any = Curve([[0, 0, 0], [1, 1, 0], [2, 0, 0]])
    line = Surface([[[i, i * i, 0]] * 3 for i in range(3)])
    with pytest.raises(InputError, match="tolerance must be a finite number above 0, got 0"):
        mesh_surface(surface, tolerance=0)
    with pytest.raises(InputError, match="max_triangles must be at least 4, got 3"):
        mesh_surface(surface, tolerance=1, max_triangles=3)
    with pytest.raises(InputError, match="'c' must be a surface, got Curve"):
        mesh_surfaces({"c": curve}, tolerance=1)
    with pytest.raises(InputError, match="surface 'line' has no area"):
        mesh_surfaces({"line": line}, tolerance=0.1)
    assert mesh_surfaces({}, tolerance=1) == {}


# Files


@pytest.mark.parametrize("suffix", [".stl", ".glb", ".3mf"])
def test_files_read_back_watertight_and_in_their_unit(suffix: str, tmp_path: Path) -> None:
    meshes = mesh_surfaces(octants(), tolerance=0.1)
    path = tmp_path / f"sphere{suffix}"
    write_mesh(path, meshes, colors={"(1, 1, 1)": "#ff8000"})
    assert [file.name for file in tmp_path.iterdir()] == [path.name]
    loaded = trimesh.load(path)
    scale = 1e-3 if suffix == ".glb" else 1.0
    if suffix != ".stl":
        assert {name.strip() for name in loaded.geometry} == set(meshes)
        assert len(loaded.geometry) == 8
        if suffix == ".glb":
            color = loaded.geometry["(1, 1, 1)"].visual.material.baseColorFactor
            assert np.asarray(color)[[0, 2, 3]].tolist() == [255, 0, 255]
            assert color[1] == pytest.approx(255 * ((128 / 255 + 0.055) / 1.055) ** 2.4, abs=1)
        else:
            assert loaded.units == "millimeter"
        loaded = loaded.to_mesh()
    loaded.apply_scale(1 / scale)
    loaded.merge_vertices()
    assert loaded.is_watertight
    assert loaded.euler_number == 2
    assert loaded.volume == pytest.approx(combined(meshes).volume, rel=1e-6)
    assert loaded.extents == pytest.approx([20, 20, 20], abs=1e-3)


def test_nothing_half_written_is_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    meshes = mesh_surfaces(octants(), tolerance=1.0)
    with pytest.raises(InputError, match="must end in"):
        write_mesh(tmp_path / "a.obj", meshes)
    with pytest.raises(InputError, match="at least one triangle"):
        write_mesh(tmp_path / "a.stl", {})
    with pytest.raises(FileError):
        write_mesh(tmp_path / "none" / "a.stl", meshes)
    (tmp_path / "a.stl").write_text("before")

    def fail(self: Path, data: bytes) -> int:
        self.write_text("half")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", fail)
    with pytest.raises(FileError, match="No space left"):
        write_mesh(tmp_path / "a.stl", meshes)
    assert [file.name for file in tmp_path.iterdir()] == ["a.stl"]
    assert (tmp_path / "a.stl").read_text() == "before"


@pytest.mark.parametrize("missing", ["trimesh", "networkx"])
def test_a_missing_package_is_named(missing: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, missing, None)
    with pytest.raises(ExtraMissing, match=rf"{missing}.*pip install 'gtcad\[mesh\]'"):
        write_mesh(tmp_path / "a.3mf", mesh_surfaces(octants(), tolerance=1.0))
    assert not list(tmp_path.iterdir())


# The command


def run(*arguments: object) -> Any:
    return CliRunner().invoke(cli.app, [str(argument) for argument in arguments])


@pytest.fixture
def model(tmp_path: Path) -> Path:
    shapes = {"arch": Curve([[0, 0], [1, 2], [2, 0]]), **{f"o{k}": s for k, s in enumerate(octants(1.0).values())}}
    gtcad.dump_model(shapes, tmp_path / "model.toml", unit="in", colors={"o1": "#102030"})
    return tmp_path / "model.toml"


@pytest.mark.parametrize("suffix", [".stl", ".glb", ".3MF"])
def test_export_writes_triangles_and_warns_of_curves(suffix: str, model: Path, tmp_path: Path) -> None:
    out = tmp_path / f"out{suffix}"
    result = run("export", model, "-o", out, "--tolerance", "0.1", "--json")
    assert result.exit_code == 0, result.output
    content = json.loads(result.stdout)
    assert content["written"]
    assert content["left_out"] == ["arch"]
    assert [shape["name"] for shape in content["shapes"]] == [f"o{k}" for k in range(8)]
    assert all(0 < shape["deviation"] <= 0.1 for shape in content["shapes"])
    assert "'arch' is left out" in result.stderr
    loaded = trimesh.load(out)
    extent = loaded.extents * (1000 if suffix == ".glb" else 1)
    assert extent == pytest.approx([50.8] * 3, abs=1e-3)
    table = run("export", model, "-o", out, "--tolerance", "0.1").stdout
    assert "triangles" in table
    assert str(content["shapes"][0]["triangles"]) in table


@pytest.mark.parametrize("closed", [Quilt.recognised, lambda *own, **names: Solid(Quilt.recognised(*own, **names))])
def test_export_writes_the_patches_of_quilts_and_of_solids_without_caps(closed: Any, tmp_path: Path) -> None:
    names = [f"o{k}" for k in range(8)]
    ball = closed(list(octants().values()), names=names)
    gtcad.dump_model({"ball": ball}, tmp_path / "m.json", colors={"ball": "#102030"})
    result = run("export", tmp_path / "m.json", "-o", tmp_path / "a.glb", "--tolerance", "0.01", "--json")
    content = json.loads(result.stdout)
    assert (result.exit_code, content["left_out"]) == (0, [])
    assert [shape["name"] for shape in content["shapes"]] == [f"ball.{name}" for name in names]
    scene = trimesh.load(tmp_path / "a.glb")
    assert set(scene.geometry) == {f"ball.{name}" for name in names}
    [color] = {tuple(one.visual.material.baseColorFactor[:3]) for one in scene.geometry.values()}
    assert [round(255 * ((one / 255 + 0.055) / 1.055) ** 2.4) for one in (0x10, 0x20, 0x30)] == list(color)
    assert run("export", tmp_path / "m.json", "-o", tmp_path / "a.stl", "--tolerance", "0.01").exit_code == 0
    whole = trimesh.load(tmp_path / "a.stl")
    assert whole.is_watertight
    assert whole.volume == pytest.approx(4 / 3 * math.pi * 10**3, rel=0.01)


def test_export_refuses_what_would_lack_faces(tmp_path: Path) -> None:
    tube = Rotation(Curve([[30, 0, 0], [45, 0, 30], [25, 0, 90]]), [0, 0, 0], [0, 0, 1])
    sheet = Quilt.recognised([tube], names=["tube"])
    for pot in (Solid(sheet, caps="planar"), Solid(sheet, thickness=1.0)):
        gtcad.dump_model({"pot": pot, "other": tube}, tmp_path / "m.json")
        result = run("export", tmp_path / "m.json", "-o", tmp_path / "a.stl", "--tolerance", "1")
        assert result.exit_code == 3
        assert "shape 'pot': triangles are made of patches alone: leave out its caps" in result.stderr
        assert not (tmp_path / "a.stl").exists()


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["--degree", "5"], 2, "'--degree': is for splines"),
        (["--schema", "AP214"], 2, "'--schema': is for splines"),
        (["--no-exact"], 2, "'--no-exact': is for splines"),
        (["--tolerance", "1e-9"], 1, "is below"),
        (["--tolerance", "1e-5"], 1, "max_triangles = 2000000 reached"),
    ],
)
def test_export_refuses(arguments: list[str], code: int, message: str, model: Path, tmp_path: Path) -> None:
    result = run("export", model, "-o", tmp_path / "out.stl", "--tolerance", "1", *arguments)
    assert result.exit_code == code, result.output
    assert message in result.stderr
    assert not (tmp_path / "out.stl").exists()


def test_export_without_the_extra_says_how_to_get_it(
    model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "trimesh", None)
    result = run("export", model, "-o", tmp_path / "out.stl", "--tolerance", "1")
    assert result.exit_code == 4
    assert "pip install 'gtcad[mesh]'" in result.stderr


@pytest.mark.parametrize("command", [["info", "a.stl"], ["check", "a.glb", "--against", "m.json", "--tolerance", "1"]])
def test_meshes_are_not_read(command: list[str]) -> None:
    assert run(*command).exit_code == 2
