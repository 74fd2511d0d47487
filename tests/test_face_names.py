"""Names of faces in files: no two things that are exported may bear one name."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import gtcad
from gtcad.converters.check import check_parts
from gtcad.converters.jobs import fit_shapes, parts_of
from gtcad.converters.step import read_step, write_step
from gtcad.errors import InputError, ModelError
from gtcad.model import Model
from gtcad.quilt import Quilt
from tests.converters import bodies

TUBE: dict[str, Any] = {"kind": "rotation", "profile": {"control_points": [[3, 0, 0], [4, 0, 3], [2, 0, 6]]}}


def loaded(folder: Path, *shapes: Any) -> Model:
    path = folder / "model.json"
    path.write_text(json.dumps({"gtcad": 1, "shape": list(shapes)}))
    return gtcad.load_model(path)


def quilt(name: str, patch: str, **fields: Any) -> dict[str, Any]:
    return {"name": name, "kind": "quilt", "patches": [TUBE | {"name": patch}]} | fields


@pytest.mark.parametrize(
    ("shapes", "expected"),
    [
        (
            [TUBE | {"name": "pot.tube"}, quilt("pot", "tube")],
            "shape 'pot' (no. 2): patch 'tube' would be called 'pot.tube' in files, as shape 'pot.tube' is",
        ),
        (
            [quilt("a", "b.c"), quilt("a.b", "c")],
            "shape 'a.b' (no. 2): patch 'c' would be called 'a.b.c' in files, as patch 'b.c' of shape 'a' is",
        ),
    ],
)
def test_faces_that_would_bear_one_name_are_refused(tmp_path: Path, shapes: Any, expected: str) -> None:
    with pytest.raises(ModelError) as caught:
        loaded(tmp_path, *shapes)
    assert caught.value.problems == (expected,)
    whole = Quilt.recognised([bodies.box()[0]], names=["c"])
    with pytest.raises(InputError, match=r"would be called 'a\.c' in files"):
        Model({"a": whole, "a.c": bodies.box()[0]})


def test_shapes_that_are_not_exported_take_no_names(tmp_path: Path) -> None:
    assert len(loaded(tmp_path, TUBE | {"name": "pot.tube", "construction": True}, quilt("pot", "tube"))) == 2


def test_names_that_begin_alike_are_told_apart(tmp_path: Path) -> None:
    moved = [patch.transformed(np.eye(3), [99, 0, 0]) for patch in bodies.box()[1::2]]
    shapes = {
        "a": Quilt.recognised(bodies.box()[::2], names=["x", "b.y", "w"]),
        "a.b": Quilt.recognised(moved, names=["x", "c", "z"]),
    }
    fits = list(fit_shapes(shapes, {"tolerance": 1e-3}))
    for order in (1, -1):
        write_step(tmp_path / "a.step", parts_of(fits[::order], {}))
        found = read_step(tmp_path / "a.step")
        for names in (list(shapes), list(shapes)[::-1]):
            report = check_parts(found, {name: shapes[name] for name in names}, 1e-3)
            assert {(row.verdict, "position" in row.remark) for row in report.rows} == {("proved", False)}
            assert report.extra == ()
