"""The tree as a newcomer finds it: links, packaging, targets, samples, and nothing that belongs to one machine."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
TARGETS = ("setup", "demo", "test", "test-occt8", "stress", "lint", "types", "bench", "docs", "clean", "help")
FOREIGN = re.compile(r"(?<![\w.])/(?:home|root|work|Users)/\w")


def text(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def tracked() -> list[Path]:
    """The text files that a clone would have."""
    listing = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard"],
        capture_output=True,
        text=True,
        check=False,
        cwd=ROOT,
    )
    if listing.returncode:
        pytest.skip("not a git checkout")
    paths = [ROOT / name for name in listing.stdout.splitlines()]
    return [path for path in paths if path.is_file() and not path.is_symlink() and path.suffix != ".png"]


def test_the_converters_are_reached_through_a_relative_link() -> None:
    assert os.readlink(ROOT / "gtcad" / "converters") == "../converters"


def test_every_package_is_packaged() -> None:
    listed = set(tomllib.loads(text("pyproject.toml"))["tool"]["setuptools"]["packages"])
    folders = {path.parent for top in ("gtcad", "converters") for path in (ROOT / top).rglob("__init__.py")}
    names = {".".join(folder.relative_to(ROOT).parts) for folder in folders}
    assert listed == {
        f"gtcad.{name}" if name.startswith("converters") else name for name in names if "gtcad.con" not in name
    }


def test_the_two_kernels_cannot_be_asked_for_at_once() -> None:
    extras = tomllib.loads(text("pyproject.toml"))["project"]["optional-dependencies"]
    assert any(line.startswith("build123d>=0.12,<0.13") for line in extras["cadquery"])
    assert any(line.startswith("build123d>=0.13,<0.14") for line in extras["build123d"])


def test_make_lists_and_has_every_target() -> None:
    listed = subprocess.run(["make", "help"], capture_output=True, text=True, check=True, cwd=ROOT).stdout
    for target in TARGETS:
        assert re.search(rf"^{target}\s", listed, re.MULTILINE), target
        dry = subprocess.run(["make", "-n", target], capture_output=True, text=True, check=False, cwd=ROOT)
        assert dry.returncode == 0, dry.stderr


@pytest.mark.parametrize("failing", ["", "lint types", "test-occt8"])
def test_continuous_integration_runs_everything_and_stops_at_a_failure(failing: str, tmp_path: Path) -> None:
    assert os.access(ROOT / ".ci" / "run", os.X_OK)
    (tmp_path / ".ci").mkdir()
    script = shutil.copy(ROOT / ".ci" / "run", tmp_path / ".ci" / "run")
    make = tmp_path / "make"
    make.write_text(f'#!/bin/sh\necho "CI=$CI"\necho "$* done"\n[ "$*" != "{failing}" ]\n')
    make.chmod(0o755)
    environment = os.environ | {"PATH": f"{tmp_path}:{os.environ['PATH']}"}
    result = subprocess.run([script], capture_output=True, text=True, check=False, cwd="/", env=environment)
    runs = [line for line in result.stdout.splitlines() if line.endswith(" done") and not line.startswith("make")]
    everything = ["lint types done", "test done", "test-occt8 done"]
    assert "CI=true" in result.stdout
    if failing:
        assert result.returncode != 0
        assert runs == everything[: everything.index(f"{failing} done") + 1]
    else:
        assert result.returncode == 0
        assert runs == everything
        assert result.stdout.endswith("make test: test done\nmake test-occt8: test-occt8 done\n")


def test_samples_are_small_enough_to_read() -> None:
    models = [path for path in (ROOT / "samples").iterdir() if path.suffix in (".json", ".toml")]
    assert len(models) >= 6
    for path in models:
        if path.with_suffix(".py").exists():  # written by the script beside it, which is what one reads
            continue
        lines = path.read_text(encoding="utf-8").splitlines()
        assert len(lines) < 120, path.name
        assert max(map(len, lines)) <= 120, path.name


def test_the_pictures_of_the_readme_are_there_and_small() -> None:
    names = re.findall(r"!\[[^\]]*\]\(([^)]+)\)", text("README.md"))
    assert "docs/images/overview.png" in names
    for name in names:
        assert 10_000 < (ROOT / name).stat().st_size < 300_000, name


def test_links_in_the_documents_lead_somewhere() -> None:
    documents = [ROOT / "README.md", ROOT / "CHANGELOG.md", *(ROOT / "docs").glob("*.md")]
    links = [(page, link) for page in documents for link in re.findall(r"\]\(([^)#]+)[^)]*\)", page.read_text("utf-8"))]
    assert len(links) > 5
    for page, link in links:
        assert link.startswith("https://") or (page.parent / link).exists(), f"{page.name}: {link}"


def test_nothing_belongs_to_one_machine() -> None:
    found = [
        f"{path.relative_to(ROOT)}: {match[0]}"
        for path in tracked()
        if path.name != Path(__file__).name
        for match in FOREIGN.finditer(path.read_text(encoding="utf-8", errors="replace"))
    ]
    assert found == []
