"""Every example of README.md and docs/ runs, and prints what is printed there."""

from __future__ import annotations

import contextlib
import importlib.util
import io
import math
import re
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from typer.testing import CliRunner

import gtcad
from gtcad import cli

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
BLOCK = re.compile(r"^```([a-z]+)(?: (\S+))?\n(.*?)^```$", re.MULTILINE | re.DOTALL)
MOMENT = re.compile(r"\d{4}-\d\d-\d\dT")
ROUNDING = 1e-8  # mm or degrees: what sessions show below it differs between machines
NUMBER = re.compile(r"\d+(?:\.\d+)?(?:e[-+]?\d+)?")


@dataclass(frozen=True)
class Block:
    """A block of code of a page: its language, the file that it stands for, if any, and its text."""

    language: str
    file: str
    text: str

    @property
    def is_model(self) -> bool:
        return self.language in ("json", "toml") and "gtcad" in self.text


def blocks(page: Path) -> list[Block]:
    return [Block(language, file, text) for language, file, text in BLOCK.findall(page.read_text(encoding="utf-8"))]


def commands(text: str) -> Iterator[tuple[str, list[str]]]:
    """The commands of a session and what it shows of their output, all white space being equal."""
    for command, output in re.findall(r"^\$ (.*)\n((?:(?!\$ ).*\n)*)", text, re.MULTILINE):
        yield command, output.split()


def masked(words: list[str]) -> list[str]:
    """The words with a sign for each number and for each rule of a table."""
    return [NUMBER.sub("#", word) for word in words if word.strip("─")]


def numbers(words: list[str]) -> list[float]:
    """The numbers of the words, moments left out."""
    return [float(number) for word in words if not MOMENT.match(word) for number in NUMBER.findall(word)]


def check_figures(shown: list[str], now: list[str], rounding: float = 0.0) -> None:
    """Better fits and proofs move the figures a little."""
    for before, after in zip(numbers(shown), numbers(now), strict=True):
        assert math.isclose(before, after, rel_tol=0.1, abs_tol=rounding), (before, after)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the samples and with every file that the pages show."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(ROOT / "samples", tmp_path / "samples", ignore=shutil.ignore_patterns("__pycache__", "*.py"))
    for page in PAGES:
        for block in blocks(page):
            if block.file:
                (tmp_path / block.file).write_text(block.text, encoding="utf-8")
    return tmp_path


def gtcad_command(command: str) -> tuple[int, list[str]]:
    """Exit code and output of a command, errors included, as on a terminal of 80 columns."""
    program, *arguments = command.split()
    assert program == "gtcad", command
    result = CliRunner(env={"COLUMNS": "80"}).invoke(cli.app, arguments, prog_name=program)
    return result.exit_code, result.output.split()


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_examples_run_and_print_what_the_page_shows(page: Path, folder: Path) -> None:
    if page.stem in ("build123d", "cadquery"):
        pytest.importorskip(page.stem)
    namespace: dict[str, object] = {"__name__": "__main__"}  # examples of a page go on from those above
    printed: list[str] = []
    for block in blocks(page):
        if "import cadquery" in block.text and importlib.util.find_spec("cadquery") is None:
            continue  # it only goes with OCCT 7.9
        if block.language == "python":
            output = io.StringIO()
            with contextlib.redirect_stdout(output):
                exec(compile(block.text, f"{page.name}: example", "exec"), namespace)
            printed = output.getvalue().split()
        elif block.language == "text":
            assert masked(printed) == masked(block.text.split())
            assert printed
            check_figures(block.text.split(), printed)
        elif block.language == "console":
            check_session(block.text)
        elif block.is_model:
            check_model(block, folder)


def check_session(text: str) -> None:
    code = 0
    for command, shown in commands(text):
        if command == "echo $?":
            assert shown == [str(code)]
        else:
            code, output = gtcad_command(command)
            assert masked(output) == masked(shown), command
            check_figures(shown, output, ROUNDING)


def check_model(block: Block, folder: Path) -> None:
    if block.file.startswith("wrong"):
        with pytest.raises(gtcad.GtcadError):
            gtcad.load_model(folder / block.file)
    else:
        assert len(gtcad.load_model(folder / block.file)) > 0


def test_the_pages_have_examples_of_every_kind() -> None:
    found = [block for page in PAGES for block in blocks(page)]
    assert {block.language for block in found} >= {"python", "text", "console", "toml", "json"}
    assert all(block.file for block in found if block.is_model)
    sessions = [command for block in found if block.language == "console" for command, _ in commands(block.text)]
    assert {command.split()[1] for command in sessions if command.startswith("gtcad")} >= {"export", "check", "info"}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_the_pictures_and_pages_that_a_page_names_are_there(page: Path) -> None:
    for target in re.findall(r"\]\((?!https?://)([^)#\s]+)", page.read_text(encoding="utf-8")):
        assert (page.parent / target).exists(), target


def test_the_build123d_example_is_short() -> None:
    [example] = [b for b in blocks(PAGES[0]) if b.language == "python" and "import build123d" in b.text]
    assert len(example.text.strip().splitlines()) <= 12
