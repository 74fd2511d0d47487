"""The command: what it prints where, and with which exit code it ends."""

from __future__ import annotations

import ctypes
import io
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import gtcad
import gtcad.model
from gtcad import BERNSTEIN, Curve, Restricted, Surface, _options, _tables, cli
from gtcad.converters import hosts, jobs
from gtcad.converters.bspline import BSplineSurface
from gtcad.converters.part import EllipseArc, Part
from gtcad.errors import KernelError, KernelMissing, ToleranceNotMet
from gtcad.model import Model
from gtcad.protocol import Shape

ARCH = Curve([[0, 0], [30, 70], [70, -20], [100, 30]], (0.4, -0.6))
QUARTER = Curve([[5, 0, 0], [5, 5, 0], [0, 5, 0]])
ROOF = Surface([[[30 * i, 30 * j, 4 * (i - 1) * (j - 1) ** 2] for j in range(3)] for i in range(3)], (0.2, 0))
LONG_NAME = "[bold]panel[/bold] " + "of the left front door " * 4
FORMATS = ["out.step", "out.STP", "out.igs", "out.iges", "out.brep"]


def run(*arguments: object) -> Any:
    result = CliRunner().invoke(cli.app, [str(argument) for argument in arguments])
    assert "Traceback" not in result.output
    return result


def process(*arguments: object, **keywords: Any) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "gtcad", *map(str, arguments)]
    return subprocess.run(command, text=True, check=False, **{"capture_output": True} | keywords)


@pytest.fixture
def model(tmp_path: Path) -> Path:
    """A model whose shapes have exact forms, which are quick to find."""
    path = tmp_path / "model.toml"
    gtcad.dump_model({"quarter": QUARTER, "roof": ROOF}, path, colors={"roof": "#ff8000"})
    return path


@pytest.fixture
def fitted(tmp_path: Path) -> Path:
    """A model with a shape that has no exact form."""
    path = tmp_path / "fitted.json"
    gtcad.dump_model({"arch": ARCH, "quarter": QUARTER}, path)
    return path


def export(model: Path, output: Path, *arguments: object) -> Any:
    return run("export", model, "-o", output, "--tolerance", "1e-4", *arguments)


def exported(model: Path, output: Path, *arguments: object) -> dict[str, Any]:
    result = export(model, output, "--json", *arguments)
    assert result.exit_code == 0, result.output
    return {shape["name"]: shape for shape in json.loads(result.stdout)["shapes"]}


# --- start --------------------------------------------------------------------------------------------------------


def test_asking_for_help_imports_nothing_heavy() -> None:
    code = "import sys, gtcad.cli; print({'numpy', 'scipy', 'pydantic', 'rich', 'OCP'} & set(sys.modules))"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "set()"


def test_help_names_every_command_and_the_module_is_the_command() -> None:
    result = process("--help")
    assert (result.returncode, result.stderr) == (0, "")
    assert result.stdout.startswith("Usage: gtcad ")
    for command in ("export", "check", "info", "schema", "doctor"):
        assert f"\n  {command} " in result.stdout
        assert run(command, "--help").exit_code == 0


def test_version() -> None:
    result = run("--version")
    assert (result.exit_code, result.stdout) == (0, f"gtcad {gtcad.__version__}\n")


# --- export -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", FORMATS)
def test_export_writes_the_format_of_the_suffix(model: Path, tmp_path: Path, name: str) -> None:
    result = export(model, tmp_path / name)
    assert (result.exit_code, result.stderr) == (0, "")
    assert (tmp_path / name).stat().st_size > 1000
    form = _options.exchange_format(name)
    names = [part.name for part in jobs.read_parts(str(tmp_path / name), form)]
    assert names == (["", ""] if form == "BREP" else ["quarter", "roof"])


def test_export_prints_a_row_for_each_shape(fitted: Path, tmp_path: Path) -> None:
    lines = export(fitted, tmp_path / "out.step").stdout.splitlines()
    assert lines[0].split() == ["name", "poles", "degree", "deviation", "in", "mm", "form"]
    assert [line.split()[0] for line in lines[2:]] == ["arch", "quarter"]
    assert [line.split()[-1] for line in lines[2:]] == ["fitted", "circle"]
    assert max(map(len, lines)) <= 80


def test_export_as_json_is_one_document_with_proved_deviations(fitted: Path, tmp_path: Path) -> None:
    result = export(fitted, tmp_path / "out.step", "--json")
    document = json.loads(result.stdout)
    assert (document["model"], document["output"]) == (str(fitted), str(tmp_path / "out.step"))
    assert (document["written"], document["tolerance"]) == (True, 1e-4)
    for shape in document["shapes"]:
        lower, upper = shape["deviation"]
        assert 0 <= lower <= upper <= 1e-4
    arch, quarter = document["shapes"]
    assert (arch["degree"], arch["exact"], arch["rational"]) == ([5], False, False)
    assert (quarter["degree"], quarter["exact"], quarter["entity"]) == ([], True, "circle")


@pytest.mark.parametrize("name", ["out.step", "out.igs", "out.brep"])
def test_the_kernel_prints_nothing_between(
    capfd: pytest.CaptureFixture[str], model: Path, tmp_path: Path, name: str
) -> None:
    exported(model, tmp_path / name)
    run(
        "check",
        tmp_path / name,
        "--against",
        model,
        "--tolerance",
        "1e-4",
        "--profile",
        "cam",
        "--json",
        "--in-process",
    )
    ctypes.CDLL(None).fflush(None)  # the kernel's own streams, which only print when they are full
    assert capfd.readouterr() == ("", "")


def test_options_reach_the_fit(monkeypatch: pytest.MonkeyPatch, model: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.brep"
    roof = exported(model, out)["roof"]
    assert (roof["poles"], roof["degree"], roof["rational"], roof["exact"]) == ([5, 3], [4, 2], True, True)
    roof = exported(model, out, "--no-exact", "--degree", 7)["roof"]
    assert (roof["degree"], roof["rational"], roof["exact"]) == ([7, 7], False, False)
    asked: list[Any] = []

    def fit_shapes(shapes: Any, settings: Any) -> list[Any]:
        asked.append(settings)
        return []

    monkeypatch.setattr(jobs, "fit_shapes", fit_shapes)
    export(model, out)
    export(model, out, "--degree", "auto", "--max-degree", 7, "--continuity", 6, "--end-order", 3, "--no-exact")
    common = {"tolerance": 1e-4}
    assert asked == [
        common | {"degree": 5, "max_degree": 11, "end_order": 0, "exact": "auto"},
        common | {"degree": "auto", "max_degree": 7, "end_order": 3, "exact": False, "continuity": 6},
    ]


@pytest.mark.parametrize("name", ["out.step", "out.igs", "out.brep"])
def test_equal_input_and_time_give_equal_bytes(model: Path, tmp_path: Path, name: str) -> None:
    first, second = tmp_path / name, tmp_path / f"second.{name}"
    for path in (first, second):
        assert export(model, path, "--timestamp", "2024-05-31T12:00:00").exit_code == 0
    assert first.read_bytes().replace(b"first", b"") == second.read_bytes().replace(b"second", b"")


@pytest.mark.parametrize(
    ("schema", "expected"), [("ap203", b"CONFIG_CONTROL"), ("AP214", b"AUTOMOTIVE"), ("AP242", b"AP242")]
)
def test_the_schema_of_a_step_file_can_be_chosen(model: Path, tmp_path: Path, schema: str, expected: bytes) -> None:
    assert export(model, tmp_path / "out.step", "--schema", schema).exit_code == 0
    header = (tmp_path / "out.step").read_bytes().partition(b"DATA;")[0]
    assert expected in header


def test_a_tolerance_that_cannot_be_met_writes_nothing_and_says_the_numbers(model: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.step"
    out.write_text("what was there before")
    result = run("export", model, "-o", out, "--tolerance", "1e-17")
    assert result.exit_code == 1
    assert out.read_text() == "what was there before"
    assert "Error: shape 'quarter': tolerance 1e-17 is below" in result.stderr
    assert result.stderr.endswith("out.step is not written\n")
    assert "failed" in result.stdout
    document = json.loads(run("export", model, "-o", out, "--tolerance", "1e-17", "--json").stdout)
    assert document["written"] is False
    assert "1e-17" in document["shapes"][0]["error"]
    assert list(tmp_path.iterdir()) == [model, out] or list(tmp_path.iterdir()) == [out, model]


def test_a_fit_that_stays_beyond_the_tolerance_is_told_and_the_others_are_tried(
    monkeypatch: pytest.MonkeyPatch, fitted: Path, tmp_path: Path
) -> None:
    real = hosts.fit_curve

    def fit_curve(curve: Any, **settings: Any) -> Any:
        if len(curve.control_points) == 4:
            raise ToleranceNotMet(settings["tolerance"], 3e-4, 4096, "that is the limit")
        return real(curve, **settings)

    monkeypatch.setattr(hosts, "fit_curve", fit_curve)
    result = export(fitted, tmp_path / "out.step")
    assert result.exit_code == 1
    assert not (tmp_path / "out.step").exists()
    assert "Error: shape 'arch': tolerance 0.0001 not met: 0.0003 proved with 4096 spans; that is the" in result.stderr
    rows = [line.split() for line in result.stdout.splitlines()[2:]]
    assert [(row[0], row[-1]) for row in rows] == [("arch", "failed"), ("quarter", "circle")]


def test_lengths_are_scaled_to_millimetres_before_they_are_fitted(tmp_path: Path) -> None:
    gtcad.dump_model({"quarter": QUARTER}, tmp_path / "inch.json", unit="in")
    result = run("export", tmp_path / "inch.json", "-o", tmp_path / "out.step", "--tolerance", "1e-5in", "--json")
    document = json.loads(result.stdout)
    assert document["tolerance"] == 1e-5 * 25.4
    assert document["shapes"][0]["deviation"][1] <= document["tolerance"]
    (part,) = jobs.read_parts(str(tmp_path / "out.step"), "STEP")
    assert isinstance(part.geometry, EllipseArc)
    assert np.allclose(part.geometry.evaluate(part.geometry.end), [0, 127, 0])


@pytest.mark.parametrize(
    ("text", "millimetres"),
    [
        ("1e-4", 1e-4),
        (" 2.5 mm", 2.5),
        (".5UM", 5e-4),
        ("1nm", 1e-6),
        ("1.cm", 10),
        ("1m", 1e3),
        ("+1in", 25.4),
        ("1ft", 304.8),
    ],
)
def test_lengths_can_have_units(text: str, millimetres: float) -> None:
    assert _options.length(text) == pytest.approx(millimetres, rel=1e-15)


def test_the_model_under_another_name_is_not_overwritten(model: Path, tmp_path: Path) -> None:
    (tmp_path / "link.step").hardlink_to(model)
    before = model.read_bytes()
    result = export(model, tmp_path / "link.step")
    assert result.exit_code == 2
    assert "is the model itself" in result.stderr
    assert model.read_bytes() == (tmp_path / "link.step").read_bytes() == before


# --- info, schema -------------------------------------------------------------------------------------------------


def test_info_of_a_model(tmp_path: Path) -> None:
    shapes: dict[str, Shape] = {
        "arch": Restricted(ARCH, (1, 0.25)),
        "mixed": Surface(ROOF.control_points, family_v=BERNSTEIN),
    }
    gtcad.dump_model(shapes, tmp_path / "m.json", unit="cm", colors={"arch": "#102030"})
    lines = run("info", tmp_path / "m.json").stdout.splitlines()
    assert lines[0].endswith("m.json: model, unit cm, size 1000 x 900 x 80 mm (control points)")
    assert lines[3].split() == ["arch", "GT", "curve", "3", "4", "#102030", "part", "[1.0,", "0.25]"]
    assert lines[4].split() == ["mixed", "GT/bernstein", "surface", "2x2", "3x3"]
    document = json.loads(run("info", tmp_path / "m.json", "--json").stdout)
    assert document["box"] == {"least": [0, -200, -40], "most": [1000, 700, 40]}
    assert document["shapes"][0]["range"] == [1.0, 0.25]
    assert document["shapes"][1]["families"] == ["GT", "bernstein"]


@pytest.mark.parametrize(("name", "form"), [("out.stp", "STEP"), ("out.igs", "IGES"), ("out.brep", "BREP")])
def test_info_of_an_exchange_file(model: Path, tmp_path: Path, name: str, form: str) -> None:
    poles = [shape["poles"] for shape in exported(model, tmp_path / name).values()]
    document = json.loads(run("info", tmp_path / name, "--json").stdout)
    assert (document["format"], document["unit"]) == (form, "mm")
    assert [shape["kind"] for shape in document["shapes"]] == ["curve", "surface"]
    assert document["shapes"][0]["poles"] == poles[0]
    assert all(shape["valid"] for shape in document["shapes"])
    lines = run("info", tmp_path / name).stdout.splitlines()
    assert lines[0].startswith(f"{tmp_path / name}: {form}, unit mm, size 60 x ")
    if form != "BREP":  # which has neither names nor colours
        assert document["shapes"][1]["color"] == "#ff8000"
        assert lines[4].split()[0] == "roof"


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
@pytest.mark.parametrize("name", ["a.json", "a.step", "a.igs", "a.brep"])
def test_a_pipe_is_not_waited_for(tmp_path: Path, name: str) -> None:
    os.mkfifo(tmp_path / name)
    result = process("info", tmp_path / name, timeout=60)
    assert (result.returncode, result.stdout) == (3, "")
    assert result.stderr in [f"Error: {tmp_path / name}: is {word} ordinary file\n" for word in ("no", "not an")]


def test_a_name_that_no_file_can_have_is_no_output(model: Path, tmp_path: Path) -> None:
    out = tmp_path / f"{'n' * 300}.step"
    result = run("export", model, "-o", out, "--tolerance", "1e-3")
    assert result.exit_code == 3
    assert result.stderr.startswith(f"Error: {out}: cannot be written: ")


def test_a_folder_without_permission_is_told_before_the_work(model: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "access", lambda path, mode: False)  # nobody can take it from the superuser
    monkeypatch.setattr(gtcad.model, "load_model", pytest.fail)
    result = run("export", model, "-o", model.parent / "a.step", "--tolerance", "1e-3")
    assert result.exit_code == 3
    assert "a.step: cannot be written: the folder" in result.stderr


def test_info_of_a_model_for_construction_only(tmp_path: Path) -> None:
    gtcad.dump_model(Model({"arch": ARCH}, construction=frozenset({"arch"})), tmp_path / "m.toml")
    first, *_, last = run("info", tmp_path / "m.toml").stdout.splitlines()
    assert first.endswith("unit mm, size none: all its shapes are for construction")
    assert last.split() == ["arch", "GT", "curve", str(ARCH.degree), str(ARCH.degree + 1), "construction"]


def test_info_marks_what_is_trimmed_or_invalid(monkeypatch: pytest.MonkeyPatch) -> None:
    plane = BSplineSurface([[[0, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 0]]], [0, 1], [2, 2], 1, [0, 1], [2, 2], 1)
    parts = [Part("p", plane, source="PLANE", trimmed=True, valid=False)]
    monkeypatch.setattr(jobs, "read_parts", lambda path, form: parts)
    assert run("info", "a.step").stdout.splitlines()[3].split() == ["p", "plane", "1x1", "2x2", "trimmed,", "invalid"]
    monkeypatch.setattr(jobs, "read_parts", lambda path, form: [])
    assert run("info", "a.step").stdout == "a.step: STEP, unit mm, size none: it holds no shapes\n"


def test_schema_prints_the_json_schema() -> None:
    result = run("schema")
    assert json.loads(result.stdout) == gtcad.model.schema()


# --- tables -------------------------------------------------------------------------------------------------------


def test_names_are_printed_literally_and_shortened_to_80_columns(tmp_path: Path) -> None:
    gtcad.dump_model({LONG_NAME: ARCH, "[red]x[/]": ARCH, ":smile:": ARCH}, tmp_path / "m.json")
    result = process("info", tmp_path / "m.json", env={**os.environ, "COLUMNS": "80", "PYTHONIOENCODING": "utf-8"})
    assert "\x1b" not in result.stdout
    lines = result.stdout.splitlines()[1:]
    assert max(map(len, lines)) <= 80
    assert lines[2].startswith("[bold]panel[/bold] of the ")
    assert "…" in lines[2]
    assert lines[2].split()[-4:] == ["GT", "curve", "3", "4"]
    assert lines[3].startswith("[red]x[/] ")
    assert lines[4].startswith(":smile: ")


def test_what_could_command_a_terminal_is_written_out() -> None:
    assert _tables.printable("a\x1b[2J\n") == r"a\x1b[2J\n"
    assert _tables.printable("Tür") == "Tür"


@pytest.mark.parametrize(
    ("bounds", "text"),
    [
        ((1.2341e-5, 9.9901e-5), "1.23e-5 .. 1.00e-4"),
        ((0.0, 0.0), "0 .. 0"),
        ((0.0, 3e-14), "0 .. 3.00e-14"),
        ((0.0, np.inf), "-"),
        (None, "-"),
    ],
)
def test_printed_bounds_are_rounded_outwards(bounds: tuple[float, float] | None, text: str) -> None:
    assert _tables.interval(bounds) == text


def test_progress_shows_on_a_terminal_only(monkeypatch: pytest.MonkeyPatch) -> None:
    for is_terminal in (False, True):
        stream = io.StringIO()
        stream.isatty = lambda answer=is_terminal: answer  # type: ignore[method-assign, misc]
        monkeypatch.setattr(sys, "stderr", stream)
        with _tables.progress("fitting", 2) as advance:
            advance()
        assert ("fitting" in stream.getvalue()) is is_terminal


# --- errors -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("error", "code", "message"),
    [
        (KernelError("it broke the face"), 4, "Error: it broke the face\n"),
        (KernelMissing("there is no kernel"), 4, "Error: there is no kernel\n"),
        (OSError(28, "No space left on device"), 3, "Error: [Errno 28] No space left on device\n"),
        (KeyboardInterrupt(), 130, ""),
        (
            ZeroDivisionError("a\nb"),
            70,
            "internal error: ZeroDivisionError: a b; run again as 'gtcad --debug ...' to see where" + "\n",
        ),
    ],
)
def test_every_error_has_a_code_and_a_message(
    monkeypatch: pytest.MonkeyPatch, model: Path, error: BaseException, code: int, message: str
) -> None:
    def fail(path: str) -> Model:
        raise error

    monkeypatch.setattr(gtcad.model, "load_model", fail)
    result = run("info", model)
    assert (result.exit_code, result.stdout, result.stderr) == (code, "", message)
    debugged = CliRunner().invoke(cli.app, ["--debug", "info", str(model)])
    assert debugged.exit_code == code
    assert "Traceback (most recent call last):" in debugged.stderr


def test_an_interrupt_is_none_of_the_errors_that_it_causes(monkeypatch: pytest.MonkeyPatch, model: Path) -> None:
    def fail(path: str) -> Model:
        try:
            try:
                raise KeyboardInterrupt
            except KeyboardInterrupt as stop:
                raise ImportError("initialization failed") from stop  # as extensions do that are stopped at their start
        except ImportError as broken:
            raise KernelMissing("the CAD kernel is broken: install another") from broken

    monkeypatch.setattr(gtcad.model, "load_model", fail)
    result = run("info", model)
    assert (result.exit_code, result.stdout, result.stderr) == (130, "", "")


def test_a_process_ends_with_message_code_and_no_traceback(tmp_path: Path) -> None:
    result = process("info", tmp_path / "none.json")
    assert (result.returncode, result.stdout) == (3, "")
    assert result.stderr == f"Error: {tmp_path / 'none.json'}: cannot be read: No such file or directory\n"
    debugged = process("--debug", "info", tmp_path / "none.json")
    assert debugged.returncode == 3
    assert "Traceback" in debugged.stderr


@pytest.mark.parametrize("arguments", [["schema"], ["--help"], ["--version"]])
def test_a_closed_pipe_is_silent(arguments: list[str]) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    result = process(*arguments, capture_output=False, stdout=writer, stderr=subprocess.PIPE)
    os.close(writer)
    assert result.stderr == ""


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs a device that is always full")
def test_a_full_disk_is_no_traceback() -> None:
    with open("/dev/full", "w") as full:
        result = process("schema", capture_output=False, stdout=full, stderr=subprocess.PIPE)
    assert result.returncode == 3
    assert result.stderr == "Error: [Errno 28] No space left on device\n"


def test_names_that_the_terminal_cannot_show_are_no_failure(tmp_path: Path) -> None:
    gtcad.dump_model({"Tür": ARCH}, tmp_path / "m.json")
    result = process("info", tmp_path / "m.json", env={**os.environ, "PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0"})
    assert (result.returncode, result.stderr) == (0, "")
    assert r"T\xfcr" in result.stdout
