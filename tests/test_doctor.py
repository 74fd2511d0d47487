"""The doctor: what it finds in lists of distributions, and that a broken kernel cannot take it down."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import json
import os
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from gtcad import cli
from gtcad.converters import doctor
from gtcad.converters.doctor import Distribution, Probe

FINE_7 = Probe("7.9.3.1")
GTCAD = Distribution(
    "gtcad",
    "0.1.0",
    (
        "numpy<3,>=1.26",
        'build123d<0.14,>=0.13; extra == "build123d"',
        'cadquery-ocp-novtk<8.1,>=8.0.1; extra == "build123d"',
        'cadquery<2.9,>=2.8; extra == "cadquery"',
        'cadquery-ocp==7.9.3.1.1; extra == "cadquery"',
        'cadquery-ocp-novtk==7.9.3.1.1; extra == "cadquery"',
    ),
)
BUILD123D_12 = Distribution("build123d", "0.12.0", ("cadquery-ocp-novtk<8.0,>=7.9", "ocpsvg<0.7,>=0.6"))
BUILD123D_13 = Distribution("build123d", "0.13.0", ("cadquery-ocp-novtk<8.1,>=8.0", 'ocp_vscode; extra == "all"'))
CADQUERY_28 = Distribution("cadquery", "2.8.0", ("cadquery-ocp<8.0,>=7.9.3.1",))
CADQUERY_27 = Distribution("cadquery", "2.7.0", ("cadquery-ocp (>=7.8.1,<7.9)",))


def full(version: str) -> Distribution:
    return Distribution("cadquery-ocp", version, (f"cadquery-ocp-proxy=={version}",))


def slim(version: str) -> Distribution:
    return Distribution("cadquery-ocp-novtk", version, (f"cadquery-ocp-proxy=={version}",))


def proxy(version: str) -> Distribution:
    return Distribution("cadquery-ocp-proxy", version)


@pytest.mark.parametrize(
    "found",
    [
        [slim("8.0.1.1.0"), proxy("8.0.1.1.0"), BUILD123D_13],
        [full("7.9.3.1.1"), slim("7.9.3.1.1"), proxy("7.9.3.1.1"), BUILD123D_12, CADQUERY_28],
        [full("7.9.3.1.1"), BUILD123D_12],
        [full("7.9.3.1.1")],
        [],
    ],
)
def test_environments_that_work_are_left_alone(found: list[Distribution]) -> None:
    assert doctor.examine([GTCAD, *found], FINE_7) == []


def test_two_kernels_of_different_versions_lie_over_each_other_even_if_they_import() -> None:
    found = [GTCAD, full("7.8.1.1"), slim("8.0.1.1.0"), BUILD123D_13, CADQUERY_27]
    problems = doctor.examine(found, FINE_7)
    assert problems[0] == (
        "cadquery-ocp 7.8.1.1 and cadquery-ocp-novtk 8.0.1.1.0 write the same folder OCP and lie over each other"
    )
    python = shlex.quote(sys.executable)
    assert doctor.repair_commands(found) == [
        f"{python} -m pip uninstall -y cadquery-ocp cadquery-ocp-novtk",
        f"{python} -m pip install 'cadquery<2.9,>=2.8' cadquery-ocp==7.9.3.1.1 cadquery-ocp-novtk==7.9.3.1.1",
    ]


def test_one_distribution_left_behind_by_another_version_of_itself_is_found() -> None:
    problems = doctor.examine([slim("7.9.3.1.1"), slim("8.0.1.1.0")], FINE_7)
    assert "lie over each other" in problems[0]


def test_a_proxy_of_another_version_is_found() -> None:
    problems = doctor.examine([slim("8.0.1.1.0"), proxy("7.9.3.1.1")], FINE_7)
    assert problems == ["cadquery-ocp-proxy 7.9.3.1.1 does not belong to cadquery-ocp-novtk 8.0.1.1.0"]


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        (
            [slim("8.0.1.1.0"), BUILD123D_12],
            "build123d 0.12.0 needs cadquery-ocp-novtk<8.0,>=7.9, but 8.0.1.1.0 is installed",
        ),
        (
            [full("7.9.3.1.1"), CADQUERY_27],
            "cadquery 2.7.0 needs cadquery-ocp>=7.8.1,<7.9, but 7.9.3.1.1 is installed",
        ),
        (  # the slim kernel lacks what CadQuery shows its pictures with
            [slim("7.9.3.1.1"), CADQUERY_28],
            "cadquery 2.8.0 needs cadquery-ocp<8.0,>=7.9.3.1, but it is not installed",
        ),
    ],
)
def test_hosts_that_do_not_fit_the_kernel_are_found(found: list[Distribution], expected: str) -> None:
    assert doctor.examine(found, FINE_7) == [expected]


def test_a_kernel_that_does_not_work_is_found_whatever_the_metadata_say() -> None:
    probe = Probe(None, "ModuleNotFoundError: No module named 'OCP.gp'")
    assert doctor.examine([], probe) == ["the kernel does not work: ModuleNotFoundError: No module named 'OCP.gp'"]
    assert len(doctor.examine([slim("7.9.3.1.1")], probe)) == 1


def test_no_kernel_is_no_problem_but_how_to_get_one_is_told() -> None:
    assert doctor.examine([GTCAD, BUILD123D_13], None) == []
    python = shlex.quote(sys.executable)
    assert doctor.repair_commands([GTCAD]) == [
        f"{python} -m pip install 'build123d<0.14,>=0.13' 'cadquery-ocp-novtk<8.1,>=8.0.1'"
    ]
    assert doctor.repair_commands([]) == [f"{python} -m pip install 'gtcad[build123d]'"]


@pytest.mark.parametrize(
    ("version", "specifier", "expected"),
    [
        ("7.9.3.1.1", "<8.0,>=7.9", True),
        ("8.0", "<8.0,>=7.9", False),
        ("8.0.1.1.0", "<8.1,>=8.0", True),
        ("8.0.0", "==8.0", True),
        ("7.10", ">=7.9", True),
        ("7.9", ">7.9,<=7.9", False),
        ("7.9", "!=7.9", False),
        ("7.9", "", True),
        ("7.9", "~=8.0", True),
    ],
)
def test_versions_against_specifiers(version: str, specifier: str, expected: bool) -> None:
    assert doctor.satisfies(version, specifier) is expected


@pytest.mark.parametrize(
    ("requirement", "expected"),
    [
        ("cadquery_ocp.novtk <8.0, >=7.9", ("cadquery-ocp-novtk", "<8.0,>=7.9")),
        ("cadquery-ocp (>=7.8.1,<7.9)", ("cadquery-ocp", ">=7.8.1,<7.9")),
        ("cadquery-ocp[all]>=7; python_version > '3'", ("cadquery-ocp", ">=7")),
        ("cadquery-ocp>=7; extra == 'dev'", ("", "")),
        ("cadquery-ocp @ file:///a/b(c)", ("", "")),
    ],
)
def test_requirements_are_taken_apart(requirement: str, expected: tuple[str, str]) -> None:
    assert doctor.parsed_requirement(requirement) == expected


@pytest.mark.parametrize(
    ("returncode", "stdout", "stderr", "expected"),
    [
        (0, 'noise\n{"version": "7.9.3.1", "error": ""}\n', "warnings", Probe("7.9.3.1")),
        (0, '{"version": null, "error": "ImportError: no"}', "", Probe(None, "ImportError: no")),
        (-11, "", "", Probe(None, "it crashed (signal 11)")),
        (1, "", "Traceback\nSyntaxError: bad\n", Probe(None, "SyntaxError: bad")),
        (1, "garbage", "", Probe(None, "exit code 1")),
        (3, "", "", Probe(None, "exit code 3")),
        (0, "3", "", Probe(None, "exit code 0")),
    ],
)
def test_the_answer_of_the_kernel(returncode: int, stdout: str, stderr: str, expected: Probe) -> None:
    assert doctor.read_answer(returncode, stdout, stderr) == expected


def test_a_kernel_that_does_not_answer_is_not_waited_for() -> None:
    assert doctor.probe_kernel(timeout=0.001) == Probe(None, "it did not answer within 0.001 s")


def broken(folder: Path, source: str, package: str = "OCP") -> dict[str, str]:
    """The environment of a process that finds a package of that source before the installed one."""
    (folder / package).mkdir()
    (folder / package / "__init__.py").write_text(source)
    return {**os.environ, "PYTHONPATH": str(folder)}


def run_doctor(environment: dict[str, str]) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "gtcad", "doctor", "--json"]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("raise ImportError('half of it is missing')", "half of it is missing"),
        ("import os; os.kill(os.getpid(), 9)", "it crashed (signal 9)"),
        ("import sys; sys.exit(0)", "exit code 0"),
    ],
)
def test_a_broken_kernel_does_not_take_the_doctor_down(tmp_path: Path, source: str, expected: str) -> None:
    result = run_doctor(broken(tmp_path, source))
    found = json.loads(result.stdout)
    assert result.returncode == 4
    assert expected in found["kernel"]["error"]
    assert any("the kernel does not work" in problem for problem in found["problems"])
    assert found["repair"][-1].startswith(f"{shlex.quote(sys.executable)} -m pip install ")
    assert {host["error"] for host in found["hosts"].values()} <= {"not tried: the kernel does not work"}


@pytest.mark.skipif(importlib.util.find_spec("build123d") is None, reason="needs the host")
@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("raise ImportError('half of it is missing')", "ExtraMissing: build123d is needed here"),
        ("import os; os.kill(os.getpid(), 9)", "it crashed (signal 9)"),
    ],
)
def test_a_broken_host_does_not_take_the_doctor_down(tmp_path: Path, source: str, expected: str) -> None:
    result = run_doctor(broken(tmp_path, source, "build123d"))
    found = json.loads(result.stdout)
    version = importlib.metadata.version("build123d")
    assert result.returncode == 4
    assert found["kernel"]["error"] == ""
    assert found["hosts"].pop("build123d")["error"].startswith(expected)
    assert all(host["error"] == "" for host in found["hosts"].values())
    [problem] = found["problems"]
    assert problem.startswith(f"build123d does not work: {expected}")
    python = shlex.quote(sys.executable)
    assert found["repair"] == [
        f"{python} -m pip install --force-reinstall --no-deps build123d=={version}",
        f"{python} -m pip install build123d=={version}",
    ]


def test_hosts_are_tried_where_they_and_a_kernel_are(monkeypatch: pytest.MonkeyPatch) -> None:
    answers = {"build123d": Probe("0.13.0"), "cadquery": Probe("2.8.0", "KernelError: invalid")}
    monkeypatch.setattr(doctor, "probe_host", lambda name, timeout: answers[name])
    found = [slim("8.0.1.1.0"), BUILD123D_13, CADQUERY_28]
    assert doctor.try_hosts(found, FINE_7) == answers
    assert doctor.try_hosts(found[:2], FINE_7) == {"build123d": answers["build123d"]}
    assert doctor.try_hosts(found[:1], FINE_7) == {}
    for kernel in (None, Probe(None, "it crashed")):
        assert doctor.try_hosts(found, kernel)["cadquery"] == Probe(None, "not tried: the kernel does not work")
    assert doctor.host_repairs(found, answers)[1].endswith(" -m pip install cadquery==2.8.0")


def test_a_face_that_a_host_gets_wrong_is_an_error(capsys: pytest.CaptureFixture[str]) -> None:
    host = pytest.importorskip("build123d")
    whole = host.Face.area
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(host.Face, "area", property(lambda face: 2 * whole.fget(face)))
        doctor.answer_host("build123d")
    answer = json.loads(capsys.readouterr().out)
    assert "it measures" in answer["error"]
    assert answer["version"] == host.__version__
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(host.Face, "is_valid", False)
        doctor.answer_host("build123d")
    assert "calls a GT face invalid" in json.loads(capsys.readouterr().out)["error"]


def invoke(monkeypatch: pytest.MonkeyPatch, found: list[Distribution], probe: Probe, *arguments: str) -> Any:
    monkeypatch.setattr(doctor, "installed_distributions", lambda: found)
    monkeypatch.setattr(doctor, "probe_kernel", lambda timeout: probe)
    return CliRunner().invoke(cli.app, ["doctor", *arguments])


def test_the_command_says_what_is_wrong_and_what_to_run(monkeypatch: pytest.MonkeyPatch) -> None:
    result = invoke(monkeypatch, [GTCAD, full("7.9.3.1.1"), slim("8.0.1.1.0")], Probe(None, "ImportError: x"))
    assert result.exit_code == 4
    assert "problem: cadquery-ocp 7.9.3.1.1 and cadquery-ocp-novtk 8.0.1.1.0 write the same folder" in result.stdout
    assert "problem: the kernel does not work: ImportError: x" in result.stdout
    assert "    " + doctor.repair_commands([full("1"), slim("2"), GTCAD])[0] + "\n" in result.stdout


def test_the_command_is_content_without_a_kernel(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    result = invoke(monkeypatch, [GTCAD], FINE_7)
    assert result.exit_code == 0
    assert "no CAD kernel" in result.stdout
    assert "pip install 'build123d<0.14,>=0.13'" in result.stdout


@pytest.mark.skipif(importlib.util.find_spec("OCP") is None, reason="needs a kernel")
def test_the_kernel_installed_here_works() -> None:
    result = CliRunner().invoke(cli.app, ["doctor"])
    assert result.exit_code == 0, result.stdout
    assert "the kernel works: it made and checked a face" in result.stdout
    data = json.loads(CliRunner().invoke(cli.app, ["doctor", "--json"]).stdout)
    assert data["problems"] == []
    installed = [name for name in doctor.HOSTS if importlib.util.find_spec(name)]
    assert {name: host["error"] for name, host in data["hosts"].items()} == dict.fromkeys(installed, "")
    for name in installed:
        assert f"{name} works: it made and checked a GT face" in result.stdout
        assert data["hosts"][name]["version"] == data["versions"][name]
    assert data["kernel"]["version"] in (data["versions"]["cadquery-ocp-novtk"] or data["versions"]["cadquery-ocp"])
