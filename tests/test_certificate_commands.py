"""Certificates and statements on the command line: written, verified, refused, and shown in every report."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import gtcad
from gtcad import Surface, cli
from gtcad.converters import isolated, jobs
from gtcad.converters.file_certificate import read_certificate
from gtcad.converters.outcome import Job, Outcome, run_job
from gtcad.converters.report import write_report
from gtcad.converters.step import write_step

ROOF = Surface([[[30 * i, 30 * j, 4 * (i - 1) * (j - 1) ** 2] for j in range(3)] for i in range(3)], (0.2, 0))
WING = Surface(ROOF.control_points + [100.0, 0.0, 0.0], (0.1, 0.3))
TIME = "2024-02-29T12:00:00Z"


def call(*arguments: object) -> Any:
    result = CliRunner(env={"COLUMNS": "200"}).invoke(cli.app, list(map(str, arguments)))
    assert "Traceback" not in result.output
    return result


def exported(folder: Path, *more: object, name: str = "a.step") -> Any:
    settings = ("--tolerance", "1e-4", "--no-exact", "--timestamp", TIME)
    return call("export", folder / "model.json", "-o", folder / name, *settings, *more)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A model, its file and its certificate, as one command makes them."""
    folder = tmp_path_factory.mktemp("made")
    gtcad.dump_model({"roof": ROOF, "wing": WING}, folder / "model.json")
    result = exported(folder, "--certificate", folder / "c.json")
    assert (result.exit_code, result.stderr) == (0, "")
    return folder


@pytest.fixture
def folder(made: Path, tmp_path: Path) -> Path:
    """Copies, to be changed."""
    return Path(shutil.copytree(made, tmp_path / "folder"))


@pytest.fixture(autouse=True)
def in_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Jobs run here: a process for each takes seconds, and does the same."""
    monkeypatch.setattr(isolated.Runner, "run", lambda self, job, *arguments: job(*arguments))


def verified(folder: Path, *more: object, name: str = "a.step") -> Any:
    return call("check", folder / name, "--certificate", folder / "c.json", *more)


# --- certificates --------------------------------------------------------------------------------------------------


def test_a_certificate_is_verified_by_its_model_beside_it(folder: Path) -> None:
    result = verified(folder)
    assert (result.exit_code, result.stderr) == (0, "")
    line = result.stdout.splitlines()[-1]
    assert line == "the certificate of 2024-02-29T12:00:00+00:00 is verified: 2 proved within 0.0001 mm"


def test_the_check_writes_the_certificate_that_the_export_writes(folder: Path) -> None:
    against = ("--against", folder / "model.json", "--tolerance", "1e-4")
    result = call("check", folder / "a.step", *against, "--write-certificate", folder / "d.json")
    assert (result.exit_code, result.stderr) == (0, "")
    exporting, checking = read_certificate(folder / "c.json"), read_certificate(folder / "d.json")
    assert checking == exporting.model_copy(update={"created": checking.created})


def test_the_model_can_be_elsewhere_and_its_name_is_given(folder: Path, tmp_path: Path) -> None:
    (folder / "model.json").rename(tmp_path / "moved.json")
    result = verified(folder)
    assert (result.exit_code, result.stdout) == (3, "")
    assert result.stderr == f"Error: {folder}/c.json: its model 'model.json' is not beside it: name it with --against\n"
    assert verified(folder, "--against", tmp_path / "moved.json").exit_code == 0
    assert verified(folder, "--against", tmp_path / "none.json").exit_code == 3


def test_another_file_is_not_verified_although_it_passes_its_check(folder: Path) -> None:
    assert exported(folder, "--degree", "6", name="b.step").exit_code == 0
    result = verified(folder, name="b.step")
    assert result.exit_code == 1
    assert "2 proved" in result.stdout
    assert "is verified" not in result.output
    assert "Error: the certificate is not verified: the file is not the one it is for" in result.stderr


def test_another_model_is_not_verified_although_the_file_is_within_the_tolerance(folder: Path) -> None:
    moved = Surface(ROOF.control_points + np.array([0, 0, 1e-6]), (0.2, 0))
    gtcad.dump_model({"roof": moved, "wing": WING}, folder / "model.json")
    result = verified(folder)
    assert (result.exit_code, result.stdout.splitlines()[-2]) == (1, "2 proved")
    assert result.stderr.startswith("Error: the certificate is not verified: the model is not the one it is for")


def changed(folder: Path, **shape: Any) -> None:
    document = json.loads((folder / "c.json").read_text())
    document["shapes"][0] |= shape
    (folder / "c.json").write_text(json.dumps(document))


@pytest.mark.parametrize(
    ("factors", "problem"),
    [((0.0, 0.5), "these exclude each other"), ((1.0, 1e3), "is above its tolerance")],
)
def test_forged_bounds_are_not_verified(folder: Path, factors: tuple[float, float], problem: str) -> None:
    true = json.loads((folder / "c.json").read_text())["shapes"][0]["deviation"]
    changed(folder, deviation=[factor * bound for factor, bound in zip(factors, true, strict=True)])
    result = verified(folder)
    assert result.exit_code == 1
    assert result.stderr.startswith("Error: the certificate is not verified: shape 'roof': ")
    assert problem in result.stderr


def test_a_certificate_is_not_verified_with_a_larger_tolerance(folder: Path) -> None:
    assert verified(folder, "--tolerance", "1e-4mm").exit_code == 0
    result = verified(folder, "--tolerance", "0.1um")  # the same, in another unit
    assert result.exit_code == 0
    result = verified(folder, "--tolerance", "1e-3")
    assert (result.exit_code, result.stdout.count("proved\n")) == (1, 1)
    assert "checked to 0.001 mm now, which is more than its 0.0001 mm" in result.stderr


def test_json_says_whether_it_is_verified(folder: Path) -> None:
    document = json.loads(verified(folder, "--json").stdout)
    assert document["code"] == 0
    assert document["certificate"] == {"created": "2024-02-29T12:00:00+00:00", "verified": True, "problems": []}
    changed(folder, deviation=[0.0, 1e-9])
    result = verified(folder, "--json")
    document = json.loads(result.stdout)
    found = document["certificate"]
    assert document["code"] == 1
    assert (result.exit_code, found["verified"], len(found["problems"])) == (1, False, 1)
    assert result.stderr == f"Error: the certificate is not verified: {found['problems'][0]}\n"


def test_reports_say_whether_the_certificate_is_verified_and_by_what(folder: Path, tmp_path: Path) -> None:
    line = "the certificate of 2024-02-29T12:00:00+00:00 is verified: 2 proved within 0.0001 mm"
    assert verified(folder, "--report", tmp_path / "a.html").exit_code == 0
    text = (tmp_path / "a.html").read_text()
    assert f"{line} (checked again by gtcad {gtcad.__version__}, OCCT " in text
    assert text.count('class="badge verified"') == text.count('class="headline passed"') == 1
    assert 'class="badge kept"' in text.partition("the file keeps 6 of 6 statements about areas")[0]
    changed(folder, deviation=[0.0, 1e-9])
    assert verified(folder, "--report", tmp_path / "b.html").exit_code == 1
    text = (tmp_path / "b.html").read_text()
    assert 'class="headline failed"' in text
    assert "Its certificate is not verified." in text
    assert "is not verified: shape &#x27;roof&#x27;: the deviation lies in" in text
    assert 'class="badge verified"' not in text


@pytest.mark.parametrize("text", ["", "{}", "no JSON", '{"gtcad_certificate": 1}'])
def test_what_is_no_certificate_is_a_bad_file(folder: Path, text: str) -> None:
    (folder / "c.json").write_text(text)
    result = verified(folder)
    assert (result.exit_code, result.stdout) == (3, "")
    assert result.stderr.startswith(f"Error: {folder}/c.json: is no certificate: ")


def test_a_check_that_fails_writes_no_certificate(folder: Path) -> None:
    arguments = ("--against", folder / "model.json", "--tolerance", "1e-6", "--write-certificate", folder / "d.json")
    result = call("check", folder / "a.step", *arguments)
    assert result.exit_code == 1
    assert result.stderr == f"Error: {folder}/a.step does not pass its check: {folder}/d.json is not written\n"
    assert not (folder / "d.json").exists()


def test_an_export_that_fails_writes_no_certificate(folder: Path) -> None:
    out = ("-o", folder / "b.step", "--certificate", folder / "d.json")
    assert call("export", folder / "model.json", *out, "--tolerance", "1e-15").exit_code == 1
    assert not (folder / "d.json").exists()
    assert not (folder / "b.step").exists()


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["check", "a.step", "b.step", "--certificate", "c.json"], "--certificate"),
        (["check", "a.step", "-j", "2", "--certificate", "c.json"], "--certificate"),
        (["check", "--manifest", "l.toml", "--certificate", "c.json"], "--certificate"),
        (["check", "a.step", "--certificate", "c.json", "--profile", "cam"], "--certificate"),
        (["check", "a.step", "--certificate", "c.json", "--limit", "degree=9"], "--certificate"),
        (["check", "a.step", "--certificate", "c.json", "--write-certificate", "d.json"], "--write-certificate"),
        (["check", "a.step", "--certificate", "c.json", "--against", "b.step"], "--against"),
        (["check", "a.step", "--certificate", "c.json", "--tolerance", "thin"], "--tolerance"),
        (["check", "a.txt", "--certificate", "c.json"], "FILE"),
        (["check", "a.step", "--write-certificate", "c.json"], "--write-certificate"),
        (["check", "a.step", "--against", "m.json", "--write-certificate", "c.json"], "--tolerance"),
        (["check", "a.step", "--against", "m.json", "--tolerance", "1", "--write-certificate", "c.txt"],
         "--write-certificate"),
        (["check", "a.step", "--against", "m.json", "--tolerance", "1", "--write-certificate", "m.json"],
         "--write-certificate"),
        (["export", "m.json", "-o", "a.step", "--tolerance", "1", "--certificate", "c.txt"], "--certificate"),
        (["export", "m.json", "-o", "a.step", "--tolerance", "1", "--certificate", "m.json"], "--certificate"),
        (["export", "m.json", "-o", "a.stl", "--tolerance", "1", "--certificate", "c.json"], "--certificate"),
    ],
)  # fmt: skip
def test_wrong_usage_leaves_every_file_as_it_is(
    arguments: list[str], named: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("m.json", "a.step", "c.json"):
        Path(name).write_text("as it was")
    result = call(*arguments)
    assert result.exit_code == 2
    assert f"'{named}'" in result.stderr
    assert [path.read_text() for path in sorted(tmp_path.iterdir())] == ["as it was"] * 3


@pytest.mark.parametrize("command", ["check", "export"])
def test_a_certificate_in_no_folder_is_refused_before_the_work(folder: Path, command: str) -> None:
    nowhere = folder / "none" / "d.json"
    if command == "check":
        arguments = ("--against", folder / "model.json", "--tolerance", "1e-4", "--write-certificate", nowhere)
        result = call("check", folder / "a.step", *arguments)
    else:
        result = exported(folder, "--certificate", nowhere, name="b.step")
    assert (result.exit_code, result.stdout) == (3, "")
    assert result.stderr.startswith(f"Error: {nowhere}: cannot be written: there is no folder")
    assert not (folder / "b.step").exists()


# --- statements ----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def liar(made: Path) -> Path:
    """A file whose first shape states the area, the centre and the points of another one: moved by 0.5 mm, larger."""
    shapes = {"roof": ROOF, "wing": WING}
    other = ROOF.transformed(1.01 * np.eye(3), (0, 0, 0.5))
    parts = jobs.parts_of(list(jobs.fit_shapes(shapes, {"tolerance": 1e-4})), {}, {"roof": other, "wing": WING})
    write_step(made / "liar.step", parts, tolerance=1e-4)
    return made / "liar.step"


def test_kept_statements_are_one_line(folder: Path) -> None:
    result = call("check", folder / "a.step")
    assert (result.exit_code, result.stderr) == (0, "")
    assert result.stdout.splitlines()[-1] == (
        "the file keeps 6 of 6 statements about areas, volumes, centres and points"
    )


def test_broken_statements_are_listed_and_fail_the_file(liar: Path) -> None:
    result = call("check", liar, "--against", liar.parent / "model.json", "--tolerance", "1e-4")
    assert result.exit_code == 1
    lines = result.stdout.splitlines()
    assert "2 proved" in lines  # the shapes are those of the model: only what is said of them is wrong
    start = next(i for i, line in enumerate(lines) if line.split()[:2] == ["name", "quantity"])
    listed = [line.split("   ")[:2] for line in lines[start + 2 : start + 5]]
    assert [[cell.strip() for cell in row] for row in listed] == [
        ["roof", "area"],
        ["roof", "centre of gravity"],
        ["roof", "points"],
    ]
    assert lines[-1] == "the file keeps 3 of 6 statements about areas, volumes, centres and points"


def test_a_file_that_breaks_its_statements_gets_no_certificate(liar: Path, tmp_path: Path) -> None:
    arguments = ("--against", liar.parent / "model.json", "--tolerance", "1e-4", "--write-certificate")
    assert call("check", liar, *arguments, tmp_path / "c.json").exit_code == 1
    assert list(tmp_path.iterdir()) == []


def test_json_lists_every_statement(liar: Path) -> None:
    result = call("check", liar, "--json")
    found = json.loads(result.stdout)["statements"]
    assert result.exit_code == 1
    assert [(item["name"], item["quantity"], item["unit"], item["kept"]) for item in found] == [
        (name, quantity, unit, name == "wing")
        for name in ("roof", "wing")
        for quantity, unit in (("area", "mm^2"), ("centre of gravity", "mm"), ("points", "mm"))
    ]
    area = found[0]
    assert area["stated"] == pytest.approx(1.01**2 * area["found"], rel=1e-6)
    assert abs(area["stated"] - area["found"]) > area["limit"] > 0


def test_many_files_say_that_statements_are_broken(liar: Path, folder: Path) -> None:
    result = call("check", liar, folder / "a.step")
    assert result.exit_code == 1
    assert set(result.stdout.splitlines()) == {
        f"failed: {liar}: ready; 3 of 6 statements broken",
        f"fine: {folder}/a.step: ready",
    }


@pytest.fixture(scope="module")
def outcome(liar: Path) -> Outcome:
    """Of the check of the liar for CAM."""
    return run_job(Job(str(liar), "STEP", profile="cam"))


def test_the_page_shows_the_statements(outcome: Outcome, tmp_path: Path) -> None:
    write_report(tmp_path / "a.html", [outcome])
    text = (tmp_path / "a.html").read_text()
    assert "The file does not hold what it states: 3 statements broken." in text
    rows = text.partition("What the file states of its shapes, and holds")[2]
    assert rows.count("centre of gravity") == 2
    assert rows.count('class="badge broken"') == rows.count('class="badge kept"') == 3
    assert "may differ by" in rows


def test_the_print_shows_the_statements(outcome: Outcome, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    figure = pytest.importorskip("matplotlib.figure")
    texts: list[str] = []
    real = figure.Figure.savefig

    def saved(self: Any, *arguments: Any, **keywords: Any) -> Any:
        texts.extend(text.get_text() for text in self.findobj(lambda artist: hasattr(artist, "get_text")))
        return real(self, *arguments, **keywords)

    monkeypatch.setattr(figure.Figure, "savefig", saved)
    write_report(tmp_path / "a.pdf", [outcome])
    assert (tmp_path / "a.pdf").read_bytes().startswith(b"%PDF")
    assert texts.count("centre of gravity") == 2
    assert any("3 statements broken" in text for text in texts)
    assert any("broken: the file keeps 3 of 6 statements" in text for text in texts)
