from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import gtcad
from gtcad import BERNSTEIN, Composite, Curve, Surface, cli
from gtcad.errors import InputError
from gtcad.model import Model
from gtcad.objectives import measured
from gtcad.optimize import optimize
from gtcad.patches import Ruled
from gtcad.patches.minimal import dirichlet_extremal, fixed_contour

RAIL = Curve([(0, 0, 0), (1, 2, 0.5), (2, 2.5, 2), (3, 1, 2.5), (4, 0, 1)], (0.2, -0.3))
GRID = np.stack(np.meshgrid(np.linspace(0, 1, 4), np.linspace(0, 1, 4), [0.0], indexing="ij"), axis=-1)[:, :, 0]
TENT = dirichlet_extremal(GRID + [0, 0, 1] * (GRID[..., :1] - GRID[..., 1:2]) ** 2)
LINE = Curve([(0, 0, 0), (1, 1, 1)], family=BERNSTEIN)


@pytest.fixture
def model(tmp_path: Path) -> Path:
    """A model of two shapes to optimise and of others."""
    path = tmp_path / "model.toml"
    shapes = {"tent": TENT, "rail": RAIL, "line": LINE, "guide": RAIL.reversed(), "chain": Composite((RAIL,), ())}
    gtcad.dump_model(Model(shapes, "in", {"tent": "#112233"}, frozenset({"guide"})), path)
    return path


def run(*arguments: Any) -> int:
    with pytest.raises(SystemExit) as ended:
        cli.app(["optimize", *map(str, arguments)], prog_name="gtcad")
    return int(ended.value.code or 0)


def test_the_best_shapes_are_written_and_the_others_stay(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = model.with_name("better.json")
    assert run(model, "-o", output) == 0
    before, after = gtcad.load_model(model), gtcad.load_model(output)
    assert (after.unit, after.colors, after.construction) == (before.unit, before.colors, before.construction)
    assert list(after) == list(before)
    for name in ("line", "guide", "chain"):
        assert after[name] == before[name]
    for name in ("tent", "rail"):
        assert after[name] == optimize(before[name]).shape
    shown, notes = capsys.readouterr()
    assert "dirichlet before" in " ".join(shown.split())
    assert "free boundary" in shown
    assert notes == ""


def test_one_shape_with_another_objective_and_method(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = model.with_name("better.json")
    options = [
        "--objective",
        "curvature-variation",
        "--method",
        "de",
        "--seed",
        3,
        "--particles",
        12,
        "--iterations",
        9,
    ]
    assert run(model, "-o", output, "--shape", "rail", *options, "--json") == 0
    data = json.loads(capsys.readouterr().out)
    before, after = gtcad.load_model(model), gtcad.load_model(output)
    wanted = optimize(RAIL, "curvature-variation", method="de", seed=3, particles=12, iterations=9)
    assert after["rail"] == wanted.shape
    assert after["tent"] == before["tent"]
    assert data["shapes"] == [{"name": "rail", **wanted.as_data()}]
    assert (data["unit"], data["interrupted"]) == ("in", False)
    assert measured(after["rail"], "curvature-variation") < measured(RAIL, "curvature-variation")


def test_equal_seeds_write_equal_files(model: Path) -> None:
    files = [model.with_name(f"{name}.toml") for name in "ab"]
    for file in files:
        assert run(model, "-o", file, "--seed", 7, "--iterations", 10) == 0
    assert files[0].read_bytes() == files[1].read_bytes()


def test_by_default_every_shape_that_the_objective_fits(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = model.with_name("better.json")
    assert run(model, "-o", output, "--objective", "area", "--method", "polish", "--json") == 0
    assert [shape["name"] for shape in json.loads(capsys.readouterr().out)["shapes"]] == ["tent"]
    assert run(model, "-o", output, "--objective", "length", "--method", "polish", "--json") == 0
    assert [shape["name"] for shape in json.loads(capsys.readouterr().out)["shapes"]] == ["rail"]


def test_fixed_contours_stay_fixed(tmp_path: Path) -> None:
    a, b, c, d = [0.0, 0.0, 0.0], [1.0, 0.0, 0.3], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]
    sides = [Curve([p, (np.add(p, q) / 2 + [0, 0, 0.4]).tolist(), q]) for p, q in ((a, b), (c, d), (a, c), (b, d))]
    gtcad.dump_model({"roof": fixed_contour(sides, 3)}, tmp_path / "roof.json")
    assert run(tmp_path / "roof.json", "-o", tmp_path / "best.json") == 0
    best = gtcad.load_model(tmp_path / "best.json")["roof"]
    assert best == optimize(gtcad.load_model(tmp_path / "roof.json")["roof"]).shape


def test_patches_that_part_are_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    points = np.array([[[x, y, x * y + y**2] for y in (0.0, 1.0, 2.0)] for x in (0.0, 1.0, 2.0)])
    left, right = Surface(points), Surface(points * [-1, 1, 1], (0.0, 0.0), (0.0, 0.0))
    gtcad.dump_model({"left": left, "right": right}, tmp_path / "m.json")
    assert run(tmp_path / "m.json", "-o", tmp_path / "one.json", "--shape", "left", "--objective", "bending") == 0
    assert capsys.readouterr().err == "Warning: 'left' and 'right' met before, and do so no longer\n"
    assert run(tmp_path / "m.json", "-o", tmp_path / "both.json", "--objective", "bending") == 0
    assert capsys.readouterr().err == ""  # mirror images move alike


# --- what is refused --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["--objective", "beauty"], 2, "must be one of dirichlet, length"),
        (["--method", "newton"], 2, "must be one of pso, polish, de, got 'newton'"),
        (["--seed", "-1"], 2, "must be a whole number from 0"),
        (["--particles", "2"], 2, "must be a whole number from 3"),
        (["--iterations", "0"], 2, "must be a whole number from 1"),
        (["--shape", "roof"], 3, "there is no shape of the name 'roof'; there are 'tent', 'rail'"),
        (["--shape", "line"], 3, "shape 'line': it has no design variables"),
        (["--shape", "chain"], 3, "shape 'chain': shape must be a curve, a patch or a family of planes, got Composite"),
        (["--shape", "tent", "--objective", "length"], 3, "shape 'tent': objective must be one of dirichlet, area"),
        (["--objective", "twist"], 3, "objective twist fits none of its shapes that have design variables; dirichlet"),
    ],
)
def test_errors_name_what_is_wrong_and_nothing_is_written(
    model: Path, arguments: list[str], code: int, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(model, "-o", model.with_name("x.json"), *arguments) == code
    assert message in " ".join(capsys.readouterr().err.replace("│", " ").split())
    assert not model.with_name("x.json").exists()


def test_a_model_without_design_variables_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    gtcad.dump_model({"line": LINE}, tmp_path / "m.json")
    assert run(tmp_path / "m.json", "-o", tmp_path / "x.json") == 3
    assert capsys.readouterr().err == f"Error: {tmp_path / 'm.json'}: none of its shapes has design variables\n"


def test_files_are_judged_first(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(model, "-o", model) == 2
    assert run(model, "-o", model.with_name("x.step")) == 2
    assert run(model.with_name("none.json"), "-o", model.with_name("x.json")) == 3
    assert run(model, "-o", model.parent / "nowhere" / "x.json") == 3
    assert not capsys.readouterr().out


def test_what_a_search_refuses_names_the_shape(
    model: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refuse(*_: Any, **__: Any) -> Any:
        raise InputError("nothing is finite")

    monkeypatch.setattr("gtcad.optimize.optimize", refuse)
    assert run(model, "-o", model.with_name("x.json"), "--shape", "rail") == 3
    assert capsys.readouterr().err == f"Error: {model}: shape 'rail': nothing is finite\n"


# --- interrupts -------------------------------------------------------------------------------------------------------


def test_an_interrupt_writes_the_best_so_far(model: Path) -> None:
    output = model.with_name("best.json")
    arguments = ["optimize", str(model), "-o", str(output), "--shape", "rail", "--objective", "curvature-variation"]
    watched = "import gtcad._search as s; from gtcad import cli; old = s.Search.step\n"
    watched += "def step(self, *a):\n    old(self, *a)\n    print('step', flush=True)\ns.Search.step = step\ncli.main()"
    process = subprocess.Popen(
        [sys.executable, "-c", watched, *arguments, "--iterations", "1000000"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    for _ in range(40):
        assert process.stdout.readline() == "step\n"
    process.send_signal(signal.SIGINT)
    shown, notes = process.communicate(timeout=60)
    assert process.returncode == 130
    assert notes == f"Interrupted: {output} holds the best so far\n"
    assert "interrupted" in shown
    best, before = gtcad.load_model(output), gtcad.load_model(model)
    assert measured(best["rail"], "curvature-variation") < measured(RAIL, "curvature-variation")
    assert {name: best[name] for name in best if name != "rail"} == {
        name: before[name] for name in before if name != "rail"
    }
    assert sorted(path.name for path in model.parent.iterdir()) == ["best.json", "model.toml"]


def test_an_interrupt_between_shapes_keeps_what_is_done(model: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import gtcad.optimize as module

    real, calls = module.optimize, []

    def second_time(shape: Any, *arguments: Any, **keywords: Any) -> Any:
        calls.append(shape)
        if len(calls) == 2:
            raise KeyboardInterrupt
        return real(shape, *arguments, **keywords)

    monkeypatch.setattr(module, "optimize", second_time)
    output = model.with_name("best.json")
    assert run(model, "-o", output, "--iterations", 5) == 130
    best = gtcad.load_model(output)
    assert best["tent"] == real(TENT, iterations=5).shape
    assert best["rail"] == RAIL


def test_progress_shows_on_a_terminal_only(model: Path) -> None:
    import os
    import pty

    main, other = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-m", "gtcad", "optimize", str(model), "-o", str(model.with_name("x.json"))],
        stdout=subprocess.DEVNULL,
        stderr=other,
    )
    os.close(other)
    text, end = b"", time.monotonic() + 60
    while time.monotonic() < end:
        try:
            part = os.read(main, 4096)
        except OSError:
            break
        if not part:
            break
        text += part
    os.close(main)
    assert process.wait(timeout=60) == 0
    assert b"optimising tent" in text


def test_ruled_patches_of_named_curves_are_spelled_out(tmp_path: Path) -> None:
    patch = Ruled(RAIL, RAIL.transformed(np.eye(3), (0, 1, 2)))
    gtcad.dump_model({"strip": patch}, tmp_path / "m.json")
    assert run(tmp_path / "m.json", "-o", tmp_path / "b.json", "--objective", "area", "--iterations", 5) == 0
    best: Any = gtcad.load_model(tmp_path / "b.json")["strip"]
    assert np.array_equal(best.a.control_points, RAIL.control_points)
    assert measured(best, "area") < measured(patch, "area")
