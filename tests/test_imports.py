from __future__ import annotations

import ast
import fnmatch
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent

# Each module may import at run time from those above it. The list of docs' architecture, with chebyshev before basis,
# which takes its bounds from there, exact and certificate before fit, which proves with them, and the helpers where
# they serve.
ORDER = [
    "gtcad._lazy",
    "gtcad.errors",
    "gtcad._files",
    "gtcad.chebyshev",
    "gtcad.basis",
    "gtcad.protocol",
    "gtcad.factors",
    "gtcad.curve",
    "gtcad.surface",
    "gtcad.restricted",
    "gtcad._jets",
    "gtcad.differential",
    "gtcad.measure",
    "gtcad.continuity",
    "gtcad._chain_system",
    "gtcad.composite",
    "gtcad.conics",
    "gtcad.roots",
    "gtcad.queries",
    "gtcad.extremes",
    "gtcad.offset",
    "gtcad._fitting",
    "gtcad.interpolation",
    "gtcad.combs",
    "gtcad.pictures",
    "gtcad.polynomial",
    "gtcad.patches.*",
    "gtcad._sides",
    "gtcad._plane_contact",
    "gtcad.plane_joins",
    "gtcad.developable_studies",
    "gtcad.edge_check",
    "gtcad.patch_joins",
    "gtcad.design_variables",
    "gtcad.patch_studies",
    "gtcad.quilt",
    "gtcad.flat_curves",
    "gtcad._development",
    "gtcad._flat_bends",
    "gtcad._flat_places",
    "gtcad.flat_pattern",
    "gtcad.flat_strip",
    "gtcad.surface_pictures",
    "gtcad.solid",
    "gtcad.centroids",
    "gtcad._search",
    "gtcad._swarm",
    "gtcad._descent",
    "gtcad._design_space",
    "gtcad._extremal_space",
    "gtcad._integrands",
    "gtcad.objectives",
    "gtcad.optimum_pictures",
    "gtcad.optimize",
    "gtcad.fronts",
    "gtcad._documents",
    "gtcad._checks",
    "gtcad._entries",
    "gtcad._curve_kinds",
    "gtcad._surface_kinds",
    "gtcad._patch_kinds",
    "gtcad._developable_kinds",
    "gtcad._minimal_kinds",
    "gtcad._quilt_kinds",
    "gtcad._markings",
    "gtcad._kinds",
    "gtcad.model",
    "gtcad.converters.bspline",
    "gtcad.converters.quadrics",
    "gtcad.converters.part",
    "gtcad.converters.properties",
    "gtcad.converters.spline_basis",
    "gtcad.converters.approximation",
    "gtcad.converters.knot_search",
    "gtcad.converters.exact",
    "gtcad.converters.certificate",
    "gtcad.converters.analytic",
    "gtcad.converters.arcs",
    "gtcad.converters.search",
    "gtcad.converters.fit",
    "gtcad.converters.sliding",
    "gtcad.converters.developable_fit",
    "gtcad.converters.limits",
    "gtcad.converters.spline_parts",
    "gtcad.converters.chain",
    "gtcad.converters.quilt_fit",
    "gtcad.converters.folds",
    "gtcad.converters.offset",
    "gtcad.converters.nearest",
    "gtcad.converters.crossings",
    "gtcad.converters.occt.compat",
    "gtcad.converters.occt.geometry",
    "gtcad.converters.occt.pieces",
    "gtcad.converters.occt.generated",
    "gtcad.converters.occt.faces",
    "gtcad.converters.occt.facets",
    "gtcad.converters.occt.regions",
    "gtcad.converters.occt.topology",
    "gtcad.converters.occt.quadrics",
    "gtcad.converters.occt.lines",
    "gtcad.converters.occt.shells",
    "gtcad.converters.occt.caps",
    "gtcad.converters.occt.thickening",
    "gtcad.converters.occt.originals",
    "gtcad.converters.occt.session",
    "gtcad.converters.occt.guards",
    "gtcad.converters.occt.document",
    "gtcad.converters.occt.entities",
    "gtcad.converters.occt.inspection",
    "gtcad.converters.occt.measuring",
    "gtcad.converters.occt.properties",
    "gtcad.converters.wall",
    "gtcad.converters.solid",
    "gtcad.converters.occt.exchange",
    "gtcad.converters.sources",
    "gtcad.converters.design",
    "gtcad.converters.step",
    "gtcad.converters.iges",
    "gtcad.converters.brep",
    "gtcad.converters.stated",
    "gtcad.converters.profiles",
    "gtcad.converters.spline_quality",
    "gtcad.converters.observations",
    "gtcad.converters.edge_quality",
    "gtcad.converters.readiness",
    "gtcad.converters.triangles",
    "gtcad.converters.welding",
    "gtcad.converters.mesh",
    "gtcad.converters.flat_loops",
    "gtcad.converters.flat_outline",
    "gtcad.converters.flat",
    "gtcad.converters.unroll",
    "gtcad.converters.host_designs",
    "gtcad.converters.face_designs",
    "gtcad.converters.host_joins",
    "gtcad.converters.outlines",
    "gtcad.converters.smooth_edges",
    "gtcad.converters.hosts",
    "gtcad.converters.build123d_lines",
    "gtcad.converters.build123d_flat",
    "gtcad.converters.build123d_faces",
    "gtcad.converters.build123d_sheets",
    "gtcad.converters.build123d",
    "gtcad.converters.cadquery_shapes",
    "gtcad.converters.cadquery_functions",
    "gtcad.converters.cadquery_sheets",
    "gtcad.converters.cadquery",
    "gtcad.converters.doctor",
    "gtcad.converters.spline_difference",
    "gtcad.converters.figures",
    "gtcad.converters.correspondence",
    "gtcad.converters.estimates",
    "gtcad.converters.matching",
    "gtcad.converters.deviations",
    "gtcad.converters.scene_edges",
    "gtcad.converters.scene",
    "gtcad.converters.verdicts",
    "gtcad.converters.pace",
    "gtcad.converters.rounding",
    "gtcad.converters.split_edges",
    "gtcad.converters.chain_check",
    "gtcad.converters.quilt_check",
    "gtcad.converters.stated_check",
    "gtcad.converters.check",
    "gtcad.converters.descriptions",
    "gtcad.converters.jobs",
    "gtcad.converters.outcome",
    "gtcad.converters.file_certificate",
    "gtcad.converters.report_markup",
    "gtcad.converters.report_words",
    "gtcad.converters.report_view",
    "gtcad.converters.report_figures",
    "gtcad.converters.report_page",
    "gtcad.converters.report_pictures",
    "gtcad.converters.report_print",
    "gtcad.converters.report",
    "gtcad.converters.isolated",
    "gtcad.converters.manifest",
    "gtcad.converters.batch",
    "gtcad._options",
    "gtcad._tables",
    "gtcad._check_tables",
    "gtcad._command",
    "gtcad._export_command",
    "gtcad._check_command",
    "gtcad._unroll_command",
    "gtcad._optimize_command",
    "gtcad.cli",
    "gtcad.__main__",
]
WITHOUT_KERNEL = ("bspline", "fit", "certificate", "exact", "chain", "offset", "quilt_fit")
KERNELS = ("OCP", "build123d", "cadquery", "cadquery_ocp", "ocpsvg", "ocp_vscode")


@cache
def modules() -> dict[str, Path]:
    """Files by the name they are imported as; packages' own files under the package's name."""
    found = {}
    for package, folder in (("gtcad", ROOT / "gtcad"), ("gtcad.converters", ROOT / "converters")):
        for path in sorted(folder.rglob("*.py")):
            parts = path.relative_to(folder).with_suffix("").parts
            if "converters" in parts[:1]:
                continue  # the symbolic link
            name = ".".join((package, *parts))
            found[name.removesuffix(".__init__")] = path
    return found


def is_package(name: str) -> bool:
    return modules()[name].name == "__init__.py"


def run_time_nodes(tree: ast.AST) -> Iterator[ast.AST]:
    """All nodes but those under ``if TYPE_CHECKING``."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            for other in node.orelse:
                yield other
                yield from run_time_nodes(other)
            continue
        yield node
        yield from run_time_nodes(node)


@cache
def imported(name: str) -> frozenset[str]:
    """Absolute names that a module imports at run time, in functions too; ``from x import y`` gives x.y or x."""
    found = set()
    for node in run_time_nodes(ast.parse(modules()[name].read_text(), str(modules()[name]))):
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{name}: relative import, line {node.lineno}"
            found.update(origin(node.module or "", alias.name) for alias in node.names)
        elif isinstance(node, ast.Call) and ast.unparse(node.func) in ("importlib.import_module", "import_module"):
            found.update(a.value for a in node.args if isinstance(a, ast.Constant) and isinstance(a.value, str))
    return frozenset(found)


def origin(module: str, name: str) -> str:
    """Where a name imported from a module comes from: a submodule, or the module itself."""
    return f"{module}.{name}" if f"{module}.{name}" in modules() else module


def own(names: frozenset[str]) -> set[str]:
    """Those of this project but the packages, whose own files resolve names lazily."""
    return {name for name in names if name.split(".")[0] == "gtcad" and not is_package(name)}


def place(name: str) -> int:
    found = [index for index, pattern in enumerate(ORDER) if fnmatch.fnmatchcase(name, pattern)]
    assert found, f"{name} has no place in ORDER: add it where it belongs"
    return found[0]


def closure(name: str) -> set[str]:
    """All that a module imports, and what these import."""
    reached, left = set(), [name]
    while left:
        for other in imported(left.pop()) - reached:
            reached.add(other)
            if other in modules():
                left.append(other)
    return reached


def test_every_module_has_one_place() -> None:
    files = [name for name in modules() if not is_package(name)]
    assert len(files) > 12
    for name in files:
        assert ORDER[place(name)] in (name, "gtcad.patches.*")
    assert len(set(ORDER)) == len(ORDER)


@pytest.mark.parametrize("name", [name for name in modules() if not is_package(name)])
def test_imports_only_from_above(name: str) -> None:
    others = own(imported(name)) - {name}
    if name.startswith("gtcad.patches."):
        others = {other for other in others if not other.startswith("gtcad.patches.")}  # one line of the list
    assert not [other for other in others if place(other) >= place(name)]


@pytest.mark.parametrize("name", [name for name in modules() if is_package(name)])
def test_packages_import_nothing_but_the_helper_for_lazy_names(name: str) -> None:
    allowed = {"gtcad._lazy"} if "patches" not in name else {"gtcad._lazy", *modules()}
    assert own(imported(name)) <= allowed


def test_every_import_can_be_found() -> None:
    for name in modules():
        wanted = {other for other in imported(name) if other.split(".")[0] == "gtcad"}
        assert wanted <= set(modules()), f"{name} imports {wanted - set(modules())}"


def is_command(name: str) -> bool:
    return name in ("gtcad.cli", "gtcad.__main__") or name.endswith("_command")


def test_the_core_never_imports_converters() -> None:
    for name in modules():
        if not name.startswith("gtcad.converters") and not is_command(name):
            assert not [other for other in imported(name) if other.startswith("gtcad.converters")], name


def test_nothing_imports_the_command_line() -> None:
    for name in modules():
        commands = {other for other in imported(name) if other.endswith("_command")} & set(modules())
        assert is_command(name) or not commands, name
        assert name == "gtcad.__main__" or "gtcad.cli" not in imported(name), name


def test_the_kernel_is_imported_in_one_folder() -> None:
    for name in modules():
        roots = {other.split(".")[0] for other in imported(name)}
        if not name.startswith("gtcad.converters.occt"):
            assert "OCP" not in roots, name
        if not name.startswith(("gtcad.converters.build123d", "gtcad.converters.cadquery")):
            assert not roots & {"build123d", "cadquery"}, name


@pytest.mark.parametrize("name", WITHOUT_KERNEL)
def test_no_kernel_is_needed_to_fit_and_prove(name: str) -> None:
    reached = closure(f"gtcad.converters.{name}")
    assert not [other for other in reached if other.startswith("gtcad.converters.occt")]
    assert not [other for other in reached if other.split(".")[0] in KERNELS]


# The same, by running it


def python(code: str, folder: Path = ROOT) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=False)


def loaded_after(code: str) -> set[str]:
    """Top-level modules loaded by the code and not by the interpreter itself."""
    show = (
        f"import sys; before = set(sys.modules); {code}; print(*{{m.split('.')[0] for m in set(sys.modules) - before}})"
    )
    result = python(show)
    assert result.returncode == 0, result.stderr
    return set(result.stdout.split())


def outside(names: set[str]) -> set[str]:
    return {name for name in names if name not in sys.stdlib_module_names and not name.startswith("_")} - {"gtcad"}


def test_importing_gtcad_loads_numpy_at_most() -> None:
    assert outside(loaded_after("import gtcad")) <= {"numpy"}


def test_the_core_loads_numpy_only() -> None:
    assert outside(loaded_after("import gtcad; gtcad.Curve, gtcad.Surface, gtcad.measure, gtcad.differential")) <= {
        "numpy"
    }


def test_fit_and_proof_load_no_kernel() -> None:
    loaded = loaded_after("; ".join(f"import gtcad.converters.{name}" for name in WITHOUT_KERNEL))
    assert not loaded & set(KERNELS)


def test_names_are_resolved_when_used() -> None:
    import gtcad
    import gtcad.converters

    for package in (gtcad, gtcad.converters):
        assert set(package.__all__) <= set(dir(package))
        for name in package.__all__:
            assert getattr(package, name) is getattr(package, name), name
        with pytest.raises(AttributeError, match="no attribute 'nothing'"):
            getattr(package, "nothing")  # noqa: B009 - as a user would write it


def test_converters_under_their_folder_name_are_refused() -> None:
    result = python("import converters")
    assert result.returncode == 1
    assert result.stderr.splitlines()[-1] == "ImportError: imported as 'converters'; import it as 'gtcad.converters'"
