"""Minimal patches in model files: round trips, units, the schema, every mistake named, and their way into CAD."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import gtcad
from gtcad import BERNSTEIN, Curve, Restricted, Surface
from gtcad.errors import InputError, ModelError
from gtcad.model import Model, schema
from gtcad.patches import Plateau, TBCoons, dirichlet_extremal, fixed_contour, minimal_patch, tb_coons_extremal
from gtcad.protocol import SeparableSurface
from gtcad.quilt import Quilt
from tests.model_files import loaded, sent_round, written
from tests.patches.kinds import FRAME, INTERIOR, TILTS
from tests.test_model import valid_by_schema

SCHEMA = schema()
GRID = np.linspace(0, 1, 9)
NAMES = ("c0", "c1", "d0", "d1")

CURVES: list[dict[str, Any]] = [
    {"name": name, "kind": "curve", "gamma": list(curve.gamma), "control_points": curve.control_points.tolist()}
    if curve.family is not BERNSTEIN
    else {"name": name, "kind": "curve", "family": "bernstein", "control_points": curve.control_points.tolist()}
    for name, curve in zip(NAMES, FRAME, strict=True)
]
NAMED = dict(zip(NAMES, NAMES, strict=True))
FILM: dict[str, Any] = {"name": "x", "kind": "plateau", "degree": 3} | NAMED
BLEND: dict[str, Any] = {"name": "x", "kind": "tb_coons"} | NAMED
NET: list[Any] = [[[i, j, 0.25 * ((i * i + 2 * j) % 3)] for j in range(4)] for i in range(4)]
HOLLOW = [[[] if 0 < i < 3 and 0 < j < 3 else point for j, point in enumerate(row)] for i, row in enumerate(NET)]
FREE: dict[str, Any] = {"name": "x", "kind": "plateau", "control_points": HOLLOW}


@cache
def patches() -> dict[str, SeparableSurface]:
    part = Restricted(Curve([[0, 0, 0], [0, 30, 9], [0, 90, 1], [0, 120, 1 / 3]], (0.5, -0.5)), (0.0, 0.75))
    return {
        "plateau": Plateau(*FRAME, INTERIOR, *TILTS),
        "classical": fixed_contour(FRAME, (2, 5), "bending", family=BERNSTEIN),
        "part": fixed_contour((*sides(part), part, part.transformed(np.eye(3), [50, 0, 0])), 3),
        "flat": fixed_contour([curve.transformed(np.eye(2, 3)) for curve in FRAME], 3),
        "tb_coons": TBCoons(*FRAME),
        "solved": tb_coons_extremal(TBCoons(*FRAME), [("d1", 1), ("c0", 1)]),
    }


def sides(post: Restricted) -> list[Curve]:
    shift = np.array([50, 0, 0])
    return [Curve([p, p + shift], family=BERNSTEIN) for p in post.evaluate([0.0, 1.0])]


@pytest.mark.parametrize("suffix", [".json", ".toml"])
def test_reading_what_was_written_gives_the_same_patches_bit_for_bit(tmp_path: Path, suffix: str) -> None:
    model = Model(patches(), "in", {"flat": "#102030"}, frozenset({"part"}))
    data = sent_round(model, tmp_path / f"m{suffix}")
    assert [entry["kind"] for entry in data["shape"]] == ["plateau"] * 4 + ["tb_coons"] * 2
    assert valid_by_schema(data, SCHEMA)


@pytest.mark.parametrize(("unit", "factor"), [("mm", 1), ("cm", 10), ("in", 25.4)])
def test_lengths_become_millimetres(unit: str, factor: float) -> None:
    for name, patch in Model(patches(), unit).in_millimetres().items():
        wanted = factor * patches()[name].evaluate(GRID[:, None], GRID[None, :])
        assert np.abs(patch.evaluate(GRID[:, None], GRID[None, :]) - wanted).max() <= 1e-11 * np.abs(wanted).max()


def test_the_kinds_are_what_they_say(tmp_path: Path) -> None:
    basis = {"gamma_u": [0.5, -0.5], "gamma_v": [1, 0]}
    gammas = {"gamma_u": (0.5, -0.5), "gamma_v": (1, 0)}
    model = loaded(
        tmp_path,
        *CURVES,
        FILM | {"name": "film"} | basis,
        FILM | {"name": "least", "functional": "area", "degree": [3, 4], "setting": "fixed contour"},
        FREE | {"name": "free"} | basis,
        FREE | {"name": "full", "control_points": NET} | basis,
        FREE | {"name": "bezier", "family": "bernstein", "functional": "bending"},
        FREE | {"name": "held", "setting": "fixed contour", "degree": 5} | basis,
        BLEND | {"name": "blend", "free": [["d1", 2]], "functional": "quasi-harmonic"},
        BLEND | {"name": "plain"},
    )
    assert model["film"] == fixed_contour(FRAME, 3, **gammas)
    assert model["least"] == minimal_patch(FRAME, "area", degree=(3, 4))
    assert model["free"] == model["full"] == dirichlet_extremal(NET, **gammas)
    assert model["bezier"] == minimal_patch(NET, "bending", family=BERNSTEIN)
    contour = [model["free"].boundary(side) for side in ("v0", "v1", "u0", "u1")]
    assert model["held"] == fixed_contour(contour, 5, **gammas)
    assert model["blend"] == tb_coons_extremal(TBCoons(*FRAME), [("d1", 2)], "quasi-harmonic")
    assert model["plain"] == TBCoons(*FRAME)
    gtcad.dump_model(model, tmp_path / "copy.json")
    kinds = [entry["kind"] for entry in json.loads((tmp_path / "copy.json").read_text())["shape"][4:]]
    assert kinds == ["plateau", "plateau", "surface", "surface", "surface", "plateau", "tb_coons", "tb_coons"]
    assert gtcad.load_model(tmp_path / "copy.json") == model


def test_patches_of_quilts_are_minimal_too(tmp_path: Path) -> None:
    other = {
        "name": "y",
        "kind": "tb_coons",
        "d0": "d1",
        "d1": {"control_points": [[200, 0, 0], [210, 50, 0], [200, 90, 0]]},
    }
    other |= {"c0": {"family": "bernstein", "control_points": [[100, 0, 0], [200, 0, 0]]}}
    other |= {"c1": {"family": "bernstein", "control_points": [[100, 100, 20], [200, 90, 0]]}}
    construction = [curve | {"construction": True} for curve in CURVES]
    model = loaded(tmp_path, *construction, {"name": "sheet", "kind": "quilt", "patches": [FILM, other]})
    sheet = model["sheet"]
    assert isinstance(sheet, Quilt)
    assert [type(patch) for patch in sheet.patches] == [Plateau, TBCoons]
    assert len(sheet.edges) == 1
    gtcad.dump_model(model, tmp_path / "copy.toml")
    assert gtcad.load_model(tmp_path / "copy.toml") == model


@pytest.mark.parametrize(
    ("shape", "expected"),
    [
        ({"name": "x", "kind": "plateau"}, ": a plateau has control_points, or the curves c0, c1, d0 and d1"),
        (FILM | {"control_points": NET}, ": a plateau has control_points, or the curves c0, c1, d0 and d1"),
        (FILM | {"c1": None, "d0": None}, ": c1 and d0 missing: a fixed contour has the curves"),
        (FILM | {"degree": None}, ": degree is missing: that of the interior functions"),
        (FILM | {"degree": 1}, ", degree: must be a whole number in [2, 60], or two"),
        (FILM | {"degree": [3, 2.5]}, ", degree: must be a whole number in [2, 60], or two of them"),
        (FILM | {"functional": "volume"}, ", functional: must be one of dirichlet, quasi-harmonic, bending, area, got"),
        (FILM | {"setting": "free"}, ", setting: must be one of free boundary, fixed contour, got 'free'"),
        (FILM | {"setting": "free boundary"}, ": setting: a free boundary is given by control_points, not by curves"),
        (FILM | {"gamma_u": [0, 2]}, ", gamma_u[1]: must lie in [-1, 1], got 2"),
        (FILM | {"family": "bernstein", "gamma_v": [0, 0]}, ", gamma_v: the family bernstein takes no design"),
        (FILM | {"d0": "d1"}, ": corner u = 0, v = "),
        (FILM | {"d0": "lime"}, ", d0: there is no shape of the name 'lime'"),
        (FILM | {"d0": 7}, ", d0: must be an object with the fields of a shape, got 7"),
        (FILM | {"interior": INTERIOR}, ": an interior that is given has its own degree"),
        (FILM | {"degree": None, "interior": []}, ", interior: must be a list of rows of points, got a list of 0"),
        (FILM | {"degree": None, "interior": [[[0, 0, 0]], []]}, ", interior[1]: must be a row of 1 points"),
        (FILM | {"degree": None, "interior": [[[0, 0, "a"]]]}, ", interior[0][0][2]: must be a number, got 'a'"),
        (FILM | {"degree": None, "interior": [[[0, 0]]]}, ": interior must have shape (n - 1, m - 1, 3)"),
        (FILM | {"fuctional": "area"}, ", fuctional: is not a field of this format; did you mean functional?"),
        (FREE | {"degree": 3}, ": degree belongs to a fixed contour, and this boundary is free"),
        (FREE | {"interior": INTERIOR}, ": interior belongs to a fixed contour, and this boundary is free"),
        (FREE | {"control_points": NET[:1]}, ", control_points: must have at least 2 rows"),
        (FREE | {"control_points": [*NET[:3], NET[3][:3]]}, ", control_points[3]: row 3 has 3 points, row 0 has 4"),
        (FREE | {"control_points": [[[], *NET[0][1:]], *NET[1:]]}, ", control_points[0][0]: must have 3 coordinates"),
        (FREE | {"control_points": 3}, ", control_points: must be a list of rows of points, got 3"),
        (BLEND | {"free": ["c0"]}, ", free[0]: must be a pair of one of c0, c1, d0, d1 and a whole number from 1, got"),
        (BLEND | {"free": [["c0", 0]]}, ", free[0]: must be a pair of one of c0, c1, d0, d1 and a whole number from 1"),
        (BLEND | {"free": {"c0": 1}}, ", free: must be a list of pairs such as ['c0', 1], got"),
        (BLEND | {"free": [["d0", 1]]}, ": free: d0 has no inner control point 1: it has no inner ones"),
        (BLEND | {"free": [["c0", 1], ["c1", 1], ["d1", 1], ["d1", 2]]}, "would collapse: keep a part of the boundary"),
        (BLEND | {"functional": "area"}, ", functional: must be one of dirichlet, quasi-harmonic, bending, got 'area'"),
        (BLEND | {"c0": {"range": [1, 0], "control_points": NET[0]}}, ": c0 must be a Curve, got RestrictedCurve"),
    ],
)  # fmt: skip
def test_a_wrong_field_is_named_with_what_was_given_and_what_is_allowed(
    tmp_path: Path, shape: dict[str, Any], expected: str
) -> None:
    with pytest.raises(ModelError) as caught:
        loaded(tmp_path, *CURVES, shape)
    (problem,) = caught.value.problems
    assert problem.startswith("shape 'x' (no. 5)")
    assert expected in problem


@pytest.mark.parametrize(
    "shape",
    [
        FILM | {"functional": "volume"},
        FILM | {"setting": 1},
        FILM | {"degree": "3"},
        FILM | {"gamma_u": [0, 2]},
        FILM | {"interior": [[[0, 0, 0, 0]]]},
        FREE | {"control_points": [[[0, 0, 0, 0]] * 3] * 3},
        BLEND | {"free": [["e", 1]]},
        BLEND | {"functional": "area"},
        {key: value for key, value in BLEND.items() if key != "c1"},
    ],
)
def test_the_schema_refuses_what_the_reader_refuses(tmp_path: Path, shape: dict[str, Any]) -> None:
    assert not valid_by_schema({"gtcad": 1, "shape": [*CURVES, shape]}, SCHEMA)
    with pytest.raises(ModelError):
        loaded(tmp_path, *CURVES, shape)


def test_the_schema_allows_what_the_reader_reads(tmp_path: Path) -> None:
    for shape in (FILM, FILM | {"degree": [2, 3]}, FREE, BLEND | {"free": [["d1", 1]]}):
        assert valid_by_schema(json.loads(written(tmp_path, *CURVES, shape).read_text()), SCHEMA)
    for kind in ("Plateau", "TBCoons"):
        entry = SCHEMA["$defs"][f"{kind}Entry"]
        assert entry["description"]
        assert all(name == "kind" or field["description"] for name, field in entry["properties"].items())


def test_what_a_model_file_cannot_hold_is_refused() -> None:
    patch = patches()["plateau"]
    whole = [patch.boundary(side).transformed(np.eye(3), [0, 0, 0]) for side in ("v0", "v1", "u0", "u1")]
    for shape in (Restricted(patch, ((0, 0.5), (0, 1))), Plateau(*whole, INTERIOR)):
        with pytest.raises(InputError, match="shape 'x': a model file cannot hold"):
            Model({"x": shape})


# --- into CAD ---------------------------------------------------------------------------------------------------------


def test_the_tent_is_one_valid_shell(tmp_path: Path) -> None:
    pytest.importorskip("OCP")
    from gtcad.converters import jobs
    from gtcad.converters.check import check_parts

    model = gtcad.load_model(Path(__file__).parents[1] / "samples" / "tent-roof.toml")
    tent = model["tent"]
    assert isinstance(tent, Quilt)
    assert len(tent.edges) == 4
    assert len(tent.free) == 8
    assert not tent.closed
    parts = jobs.parts_of(list(jobs.fit_shapes(model.in_millimetres(), {"tolerance": 1e-2})), model.colors)
    jobs.write_parts(str(tmp_path / "tent.step"), "STEP", parts, tolerance=1e-2, schema="AP242", timestamp=None)
    found = jobs.read_parts(str(tmp_path / "tent.step"), "STEP")
    assert len(found) == 4
    assert len({part.body for part in found}) == 1
    assert all(part.valid for part in found)
    [shell] = {part.body for part in found}
    assert (shell.kind, shell.closed, shell.valid) == ("shell", False, True)
    report = check_parts(found, model.in_millimetres(), 1e-2)
    assert [row.verdict for row in report.rows] == ["proved"] * 5
    assert len(report.joints) == 4
    assert all(joint.kept for joint in report.joints)


def test_surfaces_of_a_free_boundary_are_ordinary_ones(tmp_path: Path) -> None:
    model = loaded(tmp_path, FREE)
    assert isinstance(model["x"], Surface)
