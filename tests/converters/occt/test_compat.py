from __future__ import annotations

import importlib.metadata
import subprocess
import sys
import types
from pathlib import Path

import numpy as np
import pytest

from gtcad.converters.occt import compat
from gtcad.errors import KernelError, KernelMissing

ROOT = Path(__file__).parents[3]
POINTS = np.array([[1 / 3, -2e-300, 3e17], [0.1, 0.2, 0.3]])


def test_missing_kernel_says_how_to_install_one(monkeypatch):
    monkeypatch.setitem(sys.modules, "OCP", None)
    monkeypatch.setitem(sys.modules, "OCP.gp", None)
    monkeypatch.setattr(compat, "_installed_kernels", dict)
    with pytest.raises(
        KernelMissing, match=r"no CAD kernel is installed.*gtcad\[cadquery\].*gtcad\[build123d\]"
    ) as info:
        compat.kernel_module("gp")
    assert isinstance(info.value, ImportError)


def test_two_kernels_of_different_versions_are_named(monkeypatch):
    def version(name):
        return {"cadquery-ocp": "7.9.3.1.1", "cadquery-ocp-novtk": "8.0.1.1.0"}[name]

    monkeypatch.setitem(sys.modules, "OCP.gp", None)
    monkeypatch.setattr(importlib.metadata, "version", version)
    with pytest.raises(KernelMissing, match=r"cadquery-ocp 7.9.3.1.1 and cadquery-ocp-novtk 8.0.1.1.0 write the same"):
        compat.kernel_module("gp")


def test_one_broken_kernel_is_named(monkeypatch):
    def version(name):
        if name == "cadquery-ocp":
            raise importlib.metadata.PackageNotFoundError(name)
        return "8.0.1.1.0"

    monkeypatch.setitem(sys.modules, "OCP.gp", None)
    monkeypatch.setattr(importlib.metadata, "version", version)
    with pytest.raises(KernelMissing, match=r"the CAD kernel of cadquery-ocp-novtk 8.0.1.1.0 is broken"):
        compat.kernel_module("gp")


def test_a_kernel_that_is_interrupted_while_it_loads_is_not_broken(monkeypatch):
    def load(name):
        raise ImportError("initialization failed") from KeyboardInterrupt()

    monkeypatch.setattr(compat.importlib, "import_module", load)
    with pytest.raises(KeyboardInterrupt):
        compat.kernel_module("gp")


def test_a_damaged_OCP_is_kernel_missing_in_a_fresh_process(tmp_path):
    (tmp_path / "OCP").mkdir()
    (tmp_path / "OCP" / "__init__.py").write_text("")
    script = (
        f"import sys; sys.path.insert(0, {str(tmp_path)!r})\n"
        "from gtcad.errors import KernelMissing\n"
        "try:\n    import gtcad.converters.step\n"
        "except KernelMissing as error:\n    print('missing:', error)\n"
    )
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, cwd=ROOT, check=True)
    assert run.stdout.startswith("missing:")
    assert "pip install" in run.stdout


def test_collections_without_their_classes_are_a_broken_kernel(monkeypatch):
    monkeypatch.setitem(sys.modules, "OCP.collections", types.ModuleType("OCP.collections"))
    with pytest.raises(KernelMissing, match=r"OCP.collections has no Array1_gp_Pnt"):
        compat._kernel_class("Array1_gp_Pnt", "TColgp.TColgp_Array1OfPnt")


def test_kernel_exceptions_become_kernel_errors():
    geom, gp = compat.kernel_module("Geom"), compat.kernel_module("gp")
    with pytest.raises(KernelError, match="making a circle: Standard_ConstructionError"):  # noqa: SIM117
        with compat.kernel_guard("making a circle"):
            geom.Geom_Circle(gp.gp_Ax2(), -1.0)


def test_other_exceptions_pass_the_guard():
    with pytest.raises(ZeroDivisionError), compat.kernel_guard("dividing"):
        1 / 0  # noqa: B018


def test_point_arrays_keep_every_bit():
    row = compat.point_array(POINTS)
    assert [row.Value(i + 1).Coord() for i in range(2)] == [tuple(p) for p in POINTS]
    grid = compat.point_array(POINTS[None])
    assert grid.Value(1, 2).Coord() == tuple(POINTS[1])
    assert (grid.NbRows(), grid.NbColumns()) == (1, 2)


def test_plane_points_get_height_zero():
    assert compat.point_array(POINTS[:, :2]).Value(2).Coord() == (0.1, 0.2, 0.0)
    assert compat.point([1, 2]).Coord() == (1.0, 2.0, 0.0)


def test_number_arrays():
    reals = compat.real_array(np.array([[1 / 3, 2.0], [3.0, 4.0]]))
    assert reals.Value(1, 1) == 1 / 3
    assert reals.Value(2, 1) == 3.0
    integers = compat.integer_array((4, 1, 4))
    assert [integers.Value(i) for i in (1, 2, 3)] == [4, 1, 4]


def test_casts_and_sequences():
    shape = compat.kernel_module("BRepPrimAPI").BRepPrimAPI_MakeBox(1.0, 1.0, 1.0).Shape()
    explorer = compat.kernel_module("TopExp").TopExp_Explorer(shape, compat.kernel_module("TopAbs").TopAbs_FACE)
    assert type(compat.as_face(explorer.Current())).__name__ == "TopoDS_Face"
    labels = compat.LabelSequence()
    labels.Append(compat.kernel_module("TDF").TDF_Label())
    assert len(list(compat.listed(labels))) == 1
