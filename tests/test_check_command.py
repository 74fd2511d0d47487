"""``gtcad check``: what it prints, its exit codes, one file and many, limits, reports, and files that are no files."""

from __future__ import annotations

import json
import os
import random
import re
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import gtcad
from gtcad import BERNSTEIN, Curve, Surface, _options, cli
from gtcad.continuity import check_join
from gtcad.converters import check as check_module
from gtcad.converters import isolated, jobs
from gtcad.converters.chain_check import Joint
from gtcad.converters.check import Report
from gtcad.converters.verdicts import Row
from tests.converters import faulty
from tests.converters.test_isolated import alive, waited_for

QUARTER = Curve([[5, 0, 0], [5, 5, 0], [0, 5, 0]])
ROOF = Surface([[[30 * i, 30 * j, 4 * (i - 1) * (j - 1) ** 2] for j in range(3)] for i in range(3)], (0.2, 0))
HONEST = {0, 1, 3, 4, 5}  # codes that say something about the file


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A model and its exports, whose shapes have exact forms, which are quick to find."""
    path = tmp_path_factory.mktemp("exported")
    gtcad.dump_model({"quarter": QUARTER, "roof": ROOF}, path / "model.toml")
    for name in ("out.step", "out.igs", "out.brep"):
        arguments = ["export", path / "model.toml", "-o", path / name, "--tolerance", "1e-4"]
        assert CliRunner().invoke(cli.app, list(map(str, arguments))).exit_code == 0
    return path


@pytest.fixture
def in_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Jobs run here: a process for each takes a second."""
    monkeypatch.setattr(isolated.Runner, "run", lambda self, job, *arguments: job(*arguments))


def run(*arguments: object) -> Any:
    result = CliRunner().invoke(cli.app, ["check", *map(str, arguments)])
    assert "Traceback" not in result.output
    return result


def against(folder: Path, name: str, *arguments: object) -> Any:
    return run(folder / name, "--against", folder / "model.toml", "--tolerance", "1e-4", *arguments)


# --- against a model -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["out.step", "out.igs", "out.brep"])
def test_what_is_exported_passes_its_own_check(folder: Path, name: str) -> None:
    result = against(folder, name, *([] if name.endswith("step") else ["--in-process"]))
    assert (result.exit_code, result.stderr) == (0, "")
    assert result.stdout.splitlines()[0].split()[:2] == ["name", "verdict"]
    document = json.loads(against(folder, name, "--json", "--in-process").stdout)
    assert [shape["name"] for shape in document["shapes"]] == ["quarter", "roof"]
    assert {shape["verdict"] for shape in document["shapes"]} <= {"proved", "estimated"}
    assert (document["extra"], document["code"], document["tolerance"]) == ([], 0, 1e-4)
    assert document["environment"]["gtcad"] == gtcad.__version__
    assert "readiness" not in document


@pytest.mark.usefixtures("in_process")
def test_check_finds_what_was_changed(folder: Path, tmp_path: Path) -> None:
    moved = Curve(QUARTER.control_points * [[1, 1, 1], [1, 1.001, 1], [1, 1, 1]])
    gtcad.dump_model({"quarter": moved, "roof": ROOF}, tmp_path / "moved.json")
    result = run(folder / "out.step", "--against", tmp_path / "moved.json", "--tolerance", "1e-4", "--json")
    assert result.exit_code == 1
    verdicts = [shape["verdict"] for shape in json.loads(result.stdout)["shapes"]]
    assert verdicts == ["failed", "proved"]


@pytest.mark.usefixtures("in_process")
def test_two_exchange_files_are_compared(folder: Path) -> None:
    result = run(folder / "out.step", "--against", folder / "out.igs", "--tolerance", "1e-4", "--json")
    assert result.exit_code == 0, result.output
    document = json.loads(result.stdout)
    assert len(document["shapes"]) == 2
    assert {shape["verdict"] for shape in document["shapes"]} <= {"proved", "estimated"}


@pytest.mark.usefixtures("in_process")
def test_a_profile_is_judged_beside_a_model(folder: Path) -> None:
    document = json.loads(against(folder, "out.step", "--json", "--profile", "vda-4955").stdout)
    assert (document["readiness"]["profile"], document["readiness"]["verdict"]) == ("vda-4955", "ready")
    assert [shape["name"] for shape in document["shapes"]] == ["quarter", "roof"]
    text = against(folder, "out.step", "--limit", "tiny-edge=1m").stdout
    assert "2 proved" in text
    assert "not ready (profile cam" in text


def fake_report(
    monkeypatch: pytest.MonkeyPatch, *verdicts: Any, extra: tuple[str, ...] = (), kept: tuple[bool, ...] = ()
) -> None:
    rows = tuple(Row(f"s{i}", verdict, (0.0, np.inf), "certificate") for i, verdict in enumerate(verdicts))
    line = Curve([[0, 0], [1, 0]], family=BERNSTEIN)
    following = Curve([[1, 0], [2, 0]], family=BERNSTEIN)
    joints = tuple(
        Joint(f"s{i} #1-#2", "C3", check_join(line, following if one else line.reversed()))
        for i, one in enumerate(kept)
    )
    report = Report(rows, extra, joints)
    monkeypatch.setattr(check_module, "check_parts", lambda parts, shapes, tolerance: report)
    monkeypatch.setattr(jobs, "read_parts", lambda path, form: [])
    monkeypatch.setattr(isolated.Runner, "run", lambda self, job, *arguments: job(*arguments))


@pytest.mark.parametrize(
    ("verdicts", "code", "code_with_proof_required"),
    [
        (["proved", "proved"], 0, 0),
        (["proved", "estimated"], 0, 5),
        (["proved", "undecided"], 5, 5),
        (["undecided", "failed"], 1, 1),
        (["missing", "proved"], 1, 1),
        (["invalid", "estimated"], 1, 1),
    ],
)
def test_the_verdicts_make_the_exit_code(
    monkeypatch: pytest.MonkeyPatch, folder: Path, verdicts: list[str], code: int, code_with_proof_required: int
) -> None:
    fake_report(monkeypatch, *verdicts)
    assert against(folder, "out.step").exit_code == code
    assert against(folder, "out.step", "--require-proof").exit_code == code_with_proof_required
    document = json.loads(against(folder, "out.step", "--json").stdout)
    assert [shape["verdict"] for shape in document["shapes"]] == verdicts
    assert document["shapes"][0]["deviation"] == [0.0, None]


def test_a_lost_joint_is_a_failure(monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
    fake_report(monkeypatch, "proved", kept=(True, True))
    result = against(folder, "out.step")
    assert (result.exit_code, result.stdout.splitlines()[-1]) == (0, "1 proved; 2 joints kept")
    fake_report(monkeypatch, "proved", kept=(True, False))
    result = against(folder, "out.step")
    assert (result.exit_code, result.stdout.splitlines()[-1]) == (1, "1 proved; 1 joint kept; 1 joint lost")
    joints = json.loads(against(folder, "out.step", "--json").stdout)["joints"]
    assert [(joint["name"], joint["kept"]) for joint in joints] == [("s0 #1-#2", True), ("s1 #1-#2", False)]
    many = against(folder, "out.step", "-j", 1)
    assert many.exit_code == 1
    assert many.stdout == f"failed: {folder / 'out.step'}: 1 proved; 1 joint kept; 1 joint lost\n"


def test_extra_shapes_warn_and_do_no_harm(monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
    fake_report(monkeypatch, "proved", extra=("stray\x1b[2J",))
    result = against(folder, "out.step")
    assert result.exit_code == 0
    warning = r"out.step holds a shape that the model does not have: 'stray\x1b[2J'"
    assert result.stderr == f"Warning: {folder}/{warning}\n"
    assert result.stdout.endswith("1 proved\n")


# --- readiness for CAM ---------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("in_process")
def test_a_file_alone_is_judged_for_cam(tmp_path: Path) -> None:
    path = faulty.write(faulty.box(10, 20, 30), str(tmp_path / "box.brep"))
    result = run(path)
    assert (result.exit_code, result.stderr) == (0, "")
    lines = result.stdout.splitlines()
    assert lines[0].split() == ["criterion", "limit", "worst", "checked", "found"]
    assert lines[-1] == "ready (profile cam)"
    assert max(map(len, lines)) <= 80


@pytest.mark.usefixtures("in_process")
def test_a_fault_fails_and_says_where(tmp_path: Path) -> None:
    path = faulty.write(faulty.neighbours(0.05), str(tmp_path / "gap.brep"))
    result = run(path)
    assert result.exit_code == 1
    expected = "error: face-gap 0.05 mm at 10, 0.625, 0: edge 2 of face 1 (beside edges that it does not share)"
    assert expected in result.stdout.splitlines()
    assert result.stdout.endswith("not ready (profile cam, 2 errors)\n")
    assert run(path, "--limit", "face-gap=0.06mm").exit_code == 0
    assert run(path, "--limit", "face-gap=off", "--profile", "sasig").stdout.endswith("ready (profile sasig)\n")


@pytest.mark.usefixtures("in_process")
def test_json_holds_codes_limits_and_places(tmp_path: Path) -> None:
    path = faulty.write(faulty.lifted_edge(0.03), str(tmp_path / "a.brep"))
    document = json.loads(run(path, "--json", "--profile", "sasig", "--limit", "vertex-gap=off").stdout)
    found = document["readiness"]
    assert [(f["code"], f["criterion"], f["level"]) for f in found["findings"]][:1] == [
        ("G-FA-EG", "edge-gap", "error")
    ]
    assert found["findings"][0]["value"] == pytest.approx(0.03)
    criteria = {criterion["name"]: criterion for criterion in found["criteria"]}
    assert criteria["edge-gap"]["source"].startswith("MIL-STD-31000A")
    assert (criteria["vertex-gap"]["limit"], criteria["vertex-gap"]["active"]) == (None, False)
    assert (document["file"], document["against"], document["code"]) == (path, None, 1)


@pytest.mark.usefixtures("in_process")
def test_many_findings_are_cut_short(tmp_path: Path) -> None:
    path = faulty.write(faulty.compound(*(faulty.box(0.001, 10, 10 + k) for k in range(5))), str(tmp_path / "a.brep"))
    lines = run(path, "--limit", "self-intersection=off").stdout.splitlines()
    assert re.fullmatch(r"and \d+ more, which --json lists", lines[-2])
    assert sum(line.startswith("error: ") for line in lines) == 20


# --- usage ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ([], "FILE"),
        (["a.step", "--tolerance", "1"], "--tolerance"),
        (["a.step", "--against", "b.json"], "--tolerance"),
        (["a.step", "--against", "b.txt", "--tolerance", "1"], "--against"),
        (["a.step", "--require-proof"], "--require-proof"),
        (["a.step", "--profile", "iso"], "--profile"),
        (["a.step", "--limit", "tiny-edge"], "--limit"),
        (["a.step", "--limit", "tiny-edge=1deg"], "--limit"),
        (["a.step", "--report", "a.txt"], "--report"),
        (["a.step", "--report", "a.html", "--resume", "log"], "--report"),
        (["a.step", "-j", "0"], "--jobs"),
        (["a.step", "--scheduler", "tcp://a:1", "-j", "2"], "--jobs"),
        (["a.step", "--scheduler", "nowhere"], "--scheduler"),
        (["a.step", "--scheduler", "tcp://nowhere"], "--scheduler"),
        (["a.step", "b.step", "--in-process"], "--in-process"),
        (["a.step", "--timeout", "soon"], "--timeout"),
        (["a.step", "--memory", "100MB"], "--memory"),
        (["a.step", "--manifest", "l.toml"], "--manifest"),
        (["--manifest", "l.txt"], "--manifest"),
        (["a.txt"], "FILE"),
    ],
)
def test_wrong_usage_is_told_before_any_file_is_opened(arguments: list[str], named: str) -> None:
    result = run(*arguments)
    assert result.exit_code == 2
    assert f"'{named}'" in result.stderr


def test_a_list_of_checks_is_not_called_a_model() -> None:
    assert "must be a list of checks, ending in .json or .toml, got 'l.txt'" in run("--manifest", "l.txt").stderr


def test_a_model_for_construction_only_proves_nothing(folder: Path, tmp_path: Path) -> None:
    model = tmp_path / "none.toml"
    shape = 'name = "a"\nkind = "curve"\nconstruction = true\ncontrol_points = [[0, 0], [1, 2], [2, 0]]'
    model.write_text(f"gtcad = 1\n[[shape]]\n{shape}\n")
    result = run(folder / "out.step", "--against", model, "--tolerance", "1e-4", "--in-process")
    assert (result.exit_code, result.stdout) == (3, "")
    assert result.stderr == f"Error: {model}: all its shapes are for construction: there is nothing to check\n"


def test_a_report_that_cannot_be_written_is_told_before_files_are_checked(folder: Path, tmp_path: Path) -> None:
    for report in (tmp_path / "none" / "report.html", tmp_path / "folder.html"):
        (tmp_path / "folder.html").mkdir(exist_ok=True)
        result = run(folder / "out.step", folder / "out.step", "--report", report)
        assert (result.exit_code, result.stdout) == (3, "")
        assert result.stderr.startswith(f"Error: {report}: ")


@pytest.mark.parametrize(("text", "seconds"), [("90", 90), ("1.5s", 1.5), ("10min", 600), ("2H", 7200), ("off", None)])
def test_times_can_have_units(text: str, seconds: float | None) -> None:
    assert _options.seconds(text) == seconds


@pytest.mark.parametrize(("text", "size"), [("2GB", 2 << 30), ("1500mb", 1500 << 20), ("1e10", 10**10), ("OFF", None)])
def test_sizes_can_have_units(text: str, size: int | None) -> None:
    assert _options.size(text) == size


@pytest.mark.parametrize("text", ["", "0", "-1s", "1 fortnight", "1e999"])
def test_other_times_and_sizes_are_refused(text: str) -> None:
    for convert in (_options.seconds, _options.size):
        with pytest.raises(_options.Refused):
            convert(text)


# --- many files ----------------------------------------------------------------------------------------------------


def test_many_files_end_each_with_a_line_and_together_with_the_worst_code(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "cut.step").write_bytes((folder / "out.step").read_bytes()[:3000])
    names = [folder / "out.step", tmp_path / "cut.step", tmp_path / "none.step"]
    result = run(*names, "--against", folder / "model.toml", "--tolerance", "1e-4", "-j", 2)
    assert result.exit_code == 3
    assert sorted(result.stdout.splitlines()) == [
        f"fine: {folder / 'out.step'}: 2 proved",
        f"unreadable: {tmp_path / 'cut.step'}: is not a readable STEP file: its end is missing",
        f"unreadable: {tmp_path / 'none.step'}: no such file",
    ]
    assert re.fullmatch(r"3 files: (1 fine, 2 unreadable|2 unreadable, 1 fine)\n", result.stderr)


@pytest.mark.usefixtures("in_process")
def test_json_of_many_files_is_a_line_for_each(folder: Path) -> None:
    result = run(folder / "out.step", folder / "out.brep", "--json")
    documents = [json.loads(line) for line in result.stdout.splitlines()]
    assert {document["file"] for document in documents} == {str(folder / "out.step"), str(folder / "out.brep")}
    assert all(document["readiness"]["verdict"] == "ready" for document in documents)


@pytest.mark.usefixtures("in_process")
def test_a_batch_is_resumed(folder: Path, tmp_path: Path) -> None:
    log = tmp_path / "log.jsonl"
    first = run(folder / "out.step", "--resume", log)
    assert first.stdout == f"fine: {folder / 'out.step'}: ready\n"
    again = run(folder / "out.step", folder / "out.igs", "--resume", log)
    assert again.stdout.splitlines()[0] == f"fine: {folder / 'out.step'}: ready (from the log)"
    assert len(log.read_text().splitlines()) == 2


@pytest.mark.usefixtures("in_process")
def test_a_list_says_what_each_file_is_checked_with(folder: Path) -> None:
    path = folder / "list.json"
    entries = [{"file": "out.step", "against": "model.toml", "tolerance": "1e-4"}, {"file": "out.igs"}]
    path.write_text(json.dumps({"check": entries}))
    result = run("--manifest", path)
    assert result.exit_code == 0
    assert sorted(result.stdout.splitlines()) == [
        f"fine: {folder / 'out.igs'}: ready",
        f"fine: {folder / 'out.step'}: 2 proved",
    ]
    del entries[0]["tolerance"]
    path.write_text(json.dumps({"check": entries}))
    assert sorted(run("--manifest", path, "--tolerance", "1e-4").stdout.splitlines()) == sorted(
        result.stdout.splitlines()
    )
    entries[0] |= {"tolerance": "thin"}
    entries[1] |= {"file": "out.txt"}
    path.write_text(json.dumps({"check": entries}))
    result = run("--manifest", path)
    assert result.exit_code == 3
    lines = result.stderr.splitlines()
    assert lines[0].startswith(f"Error: {path}: check no. 1: must be a length")
    assert lines[1].startswith(f"Error: {path}: check no. 2: must end in one of")


@pytest.mark.usefixtures("in_process")
def test_a_report_is_written(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "report.html"
    assert run(folder / "out.step", "--report", out).exit_code == 0
    assert out.read_text().lower().startswith("<!doctype html>")
    assert against(folder, "out.igs", "--report", out).exit_code == 0
    assert run(folder / "out.step", folder / "none.step", "--report", out).exit_code == 3
    assert "none.step" in out.read_text()


# --- processes -----------------------------------------------------------------------------------------------------


def test_a_crash_of_the_kernel_is_code_4(monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
    real = isolated.Runner.run
    monkeypatch.setattr(isolated.Runner, "run", lambda self, job, *arguments: real(self, os.abort))
    result = run(folder / "out.step")
    assert result.exit_code == 4
    assert result.stderr.startswith("Error: the kernel crashed (SIGABRT)")


def test_a_time_limit_is_code_4(folder: Path) -> None:
    result = run(folder / "out.step", "--timeout", "0.05s")
    assert (result.exit_code, result.stdout) == (4, "")
    assert result.stderr == "Error: the kernel did not answer within 0.05 s and was stopped\n"


@pytest.mark.skipif(sys.platform != "linux", reason="looks for processes in /proc")
@pytest.mark.parametrize("several", [False, True])
def test_an_interrupt_ends_the_children_too(folder: Path, several: bool) -> None:
    files = [folder / "out.step", folder / "out.igs"] if several else [folder / "out.step"]
    command = [sys.executable, "-m", "gtcad", "check", *files]  # its children take a second to start
    program = subprocess.Popen(list(map(str, command)), stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    try:
        assert waited_for(lambda: bool(children(program.pid)))
        found = children(program.pid)
        program.send_signal(signal.SIGINT)
        stdout, stderr = program.communicate(timeout=20)
        assert (program.returncode, stdout) == (130, b"")
        assert b"Traceback" not in stderr
        assert waited_for(lambda: not any(map(alive, found)))
    finally:
        program.kill()
        program.wait()


def children(process: int) -> list[int]:
    found = []
    for task in Path(f"/proc/{process}/task").glob("*/children"):
        found += map(int, task.read_text().split())
    return found


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs pipes with names")
@pytest.mark.parametrize("several", [False, True])
def test_pipes_are_not_waited_for(tmp_path: Path, several: bool) -> None:
    os.mkfifo(tmp_path / "a.step")
    result = run(tmp_path / "a.step", *(["-j", "1"] if several else []))
    assert result.exit_code == 3
    assert "is no ordinary file" in result.output


# --- files that are no files ---------------------------------------------------------------------------------------


def text_of(folder: Path, name: str) -> bytes:
    return (folder / name).read_bytes()


def hostile_step(old: str, new: str) -> Callable[[bytes], bytes]:
    def change(data: bytes) -> bytes:
        changed, count = re.subn(old.encode(), new.encode(), data)
        assert count, f"{old} is not in the file"
        return changed

    return change


def numbers_to(value: bytes) -> Callable[[bytes], bytes]:
    """All coordinates of control points of STEP, replaced."""
    point = re.compile(rb"(CARTESIAN_POINT\('[^']*',\()[^)]*\)")
    return lambda data: point.sub(lambda match: match[1] + b",".join([value] * 3) + b")", data)


FILES: dict[str, tuple[str, Callable[[bytes], bytes], set[int]]] = {
    "step cut in the middle": ("out.step", lambda data: data[: len(data) // 2], {3}),
    "step without data": (
        "out.step",
        lambda data: data[: data.index(b"DATA;")] + b"DATA;\nENDSEC;\nEND-ISO-10303-21;\n",
        {3},
    ),
    "step empty": ("out.step", lambda data: b"", {3}),
    "step blank": ("out.step", lambda data: b" \n" * 5000, {3}),
    "step binary": ("out.step", lambda data: bytes(range(256)) * 100, {3}),
    "step with binary in the middle": (
        "out.step",
        lambda data: data[:4000] + bytes(range(256)) * 9 + data[5000:],
        HONEST,
    ),
    "step with huge coordinates": ("out.step", numbers_to(b"1.E+300"), {3}),
    "step with infinite coordinates": ("out.step", numbers_to(b"1.E+999"), {3}),
    "step with all points at one place": ("out.step", numbers_to(b"1."), HONEST - {0}),
    "step with texts for coordinates": ("out.step", numbers_to(b"'x'"), {3}),
    "step that refers to itself": (
        "out.step",
        hostile_step(r"#(\d+)\s*=\s*ADVANCED_FACE\('([^']*)',\(#\d+\)", r"#\1=ADVANCED_FACE('\2',(#\1)"),
        HONEST - {0},
    ),
    "step that refers to nothing": (
        "out.step",
        hostile_step(r"EDGE_LOOP\('([^']*)',\(#\d+", r"EDGE_LOOP('\1',(#999999"),
        HONEST - {0},
    ),
    "step of nested brackets": (
        "out.step",
        hostile_step(r"CARTESIAN_POINT\('[^']*',\(", "CARTESIAN_POINT('',(" + "(" * 2000),
        HONEST - {0},
    ),
    "iges cut in the middle": ("out.igs", lambda data: data[: len(data) // 2], {3}),
    "iges empty": ("out.igs", lambda data: b"", {3}),
    "iges binary": ("out.igs", lambda data: bytes(range(256)) * 100, {3}),
    "iges with huge coordinates": ("out.igs", hostile_step(r"(?<=,)\d\.\d{16}E\+01", "9.0000000000000000E+99"), HONEST),
    "iges with a coordinate that is no number": (
        "out.igs",
        hostile_step(r"(?<=,)\d\.\d{16}E\+01", "NAN                   "),
        {3},
    ),
    "iges of another entity": ("out.igs", hostile_step(r"(?m)^(     )128(?=.{64}D)", r"\g<1>144"), HONEST - {0}),
    "brep cut in the middle": ("out.brep", lambda data: data[: len(data) // 2], {3}),
    "brep empty": ("out.brep", lambda data: b"", {3}),
    "brep binary": ("out.brep", lambda data: bytes(range(256)) * 100, {3}),
}


@pytest.mark.parametrize("case", FILES)
def test_bad_files_get_a_code_and_a_message(folder: Path, tmp_path: Path, case: str) -> None:
    name, change, codes = FILES[case]
    path = tmp_path / name
    path.write_bytes(change(text_of(folder, name)))
    # what is refused before the kernel sees it needs no process of its own
    apart = ["--in-process"] if codes == {3} else ["--timeout", "60s"]
    result = run(path, "--against", folder / "model.toml", "--tolerance", "1e-4", *apart)
    assert result.exit_code in codes, result.output
    if result.exit_code in (3, 4):
        assert result.stdout == ""
        assert re.fullmatch(r"Error: [^\n]+\n", result.stderr)


@pytest.mark.usefixtures("in_process")
@pytest.mark.parametrize("name", ["out.step", "out.igs"])
def test_a_file_in_the_wrong_unit_fails(tmp_path: Path, name: str) -> None:
    gtcad.dump_model({"roof": ROOF}, tmp_path / "mm.toml")
    gtcad.dump_model({"roof": ROOF}, tmp_path / "in.toml", unit="in")
    arguments = ["export", tmp_path / "in.toml", "-o", tmp_path / name, "--tolerance", "1e-3"]
    assert CliRunner().invoke(cli.app, list(map(str, arguments))).exit_code == 0
    result = run(tmp_path / name, "--against", tmp_path / "mm.toml", "--tolerance", "1e-3")
    assert result.exit_code == 1
    assert "inch" in result.stdout


def mutated(data: bytes, rng: random.Random) -> bytes:
    """The bytes with some digits, references, words or lines changed, lost or doubled, but with beginning and end."""
    start, end = data.index(b"DATA;") if b"DATA;" in data else 400, len(data) - 200
    changed = bytearray(data)
    for _ in range(rng.randint(1, 6)):
        place = rng.randrange(start, end)
        kind = rng.randrange(5)
        if kind == 0:
            changed[place] = rng.randrange(32, 127)
        elif kind == 1:
            digits = [i for i in range(place, min(place + 200, end)) if 48 <= changed[i] < 58]
            if digits:
                changed[rng.choice(digits)] = rng.randrange(48, 58)
        elif kind == 2:
            changed[place : place + rng.randint(1, 30)] = b"" if b"DATA;" in data else b" " * 10
        elif kind == 3:
            other = rng.randrange(start, end)
            changed[place : place + 8] = changed[other : other + 8]
        else:
            reference = re.compile(rb"#\d+").search(changed, place)
            if reference:
                changed[reference.start() : reference.end()] = b"#%d" % rng.randint(1, 200)
    return bytes(changed)


def fuzz(folder: Path, path: Path, seed: int) -> Any:
    rng = random.Random(seed)
    path.write_bytes(mutated(text_of(folder, path.name), rng))
    result = run(
        path, "--against", folder / "model.toml", "--tolerance", "1e-4", "--profile", "cam", "--timeout", "60s"
    )
    assert result.exit_code in HONEST, f"seed {seed}: {result.output}"
    return result


@pytest.mark.parametrize("name", ["out.step", "out.igs"])
@pytest.mark.parametrize("seed", [0])
def test_damaged_files_end_with_a_code(folder: Path, tmp_path: Path, name: str, seed: int) -> None:
    fuzz(folder, tmp_path / name, seed)


@pytest.mark.stress
@pytest.mark.parametrize("name", ["out.step", "out.igs", "out.brep"])
@pytest.mark.parametrize("seed", range(100, 200))
def test_many_damaged_files_end_with_a_code(folder: Path, tmp_path: Path, name: str, seed: int) -> None:
    fuzz(folder, tmp_path / name, seed)
