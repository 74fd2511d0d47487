"""Model files: round trips without loss, and every mistake named with file, shape and field."""

from __future__ import annotations

import json
import math
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

import gtcad
from gtcad import BERNSTEIN, GT, Curve, Restricted, Surface
from gtcad.errors import FileError, GtcadError, InputError, ModelError
from gtcad.model import Model, schema

SAMPLES = Path(__file__).parent.parent / "samples"
SCHEMA = schema()
KINDS = (
    "curve, composite, circle, ellipse, arc, parabola, surface, "
    "ruled, cylinder, cone, swept, swung, rotation, sweep, lofted, coons, enveloping, spine-developable, "
    "geodesic-developable, quasi-developable, plateau, tb_coons, quilt, solid"
)
ARCH: dict[str, Any] = {"name": "arch", "kind": "curve", "control_points": [[0, 0], [1, 2], [2, 0]]}
ROOF: dict[str, Any] = {
    "name": "roof",
    "kind": "surface",
    "control_points": [[[i, j, i * j] for j in range(4)] for i in range(3)],
}

coordinates = st.floats(-1e50, 1e50)
gammas = st.tuples(st.floats(-1, 1), st.floats(-1, 1))
families = st.sampled_from([GT, BERNSTEIN])
names = st.text(st.characters(exclude_categories=["C", "Z"]), min_size=1, max_size=200)
ranges = st.tuples(st.floats(0, 1), st.floats(0, 1)).filter(lambda pair: abs(pair[0] - pair[1]) >= 1e-9)


@st.composite
def curves(draw: st.DrawFn) -> Any:
    family = draw(families)
    count = draw(st.integers(family.minimum_degree + 1, 8))
    size = draw(st.integers(2, 3))
    points = draw(st.lists(st.lists(coordinates, min_size=size, max_size=size), min_size=count, max_size=count))
    curve = Curve(points, draw(gammas) if family is GT else (0, 0), family)
    part = draw(st.none() | ranges)
    return curve if part is None else Restricted(curve, part)


@st.composite
def surfaces(draw: st.DrawFn) -> Any:
    pair = draw(families), draw(families)
    rows, columns = (draw(st.integers(family.minimum_degree + 1, 4)) for family in pair)
    flat = draw(st.lists(coordinates, min_size=rows * columns * 3, max_size=rows * columns * 3))
    gamma_u, gamma_v = (draw(gammas) if family is GT else (0, 0) for family in pair)
    surface = Surface(np.reshape(flat, (rows, columns, 3)), gamma_u, gamma_v, *pair)
    part = draw(st.none() | st.tuples(ranges, ranges))
    return surface if part is None else Restricted(surface, part)


@st.composite
def models(draw: st.DrawFn) -> Model:
    shapes = draw(st.dictionaries(names, curves() | surfaces(), min_size=1, max_size=3))
    colors = draw(st.dictionaries(st.sampled_from(list(shapes)), st.from_regex("#[0-9a-fA-F]{6}", fullmatch=True)))
    return Model(shapes, draw(st.sampled_from(["mm", "cm", "m", "in", "ft"])), colors)


def written(folder: Path, *shapes: Any, **head: Any) -> Path:
    path = folder / "model.json"
    path.write_text(json.dumps({"gtcad": 1, "shape": list(shapes)} | head))
    return path


def problems(path: Path) -> list[str]:
    with pytest.raises(ModelError) as caught:
        gtcad.load_model(path)
    assert caught.value.path == str(path)
    return list(caught.value.problems)


def control_bits(shape: Any) -> bytes:
    return bytes((shape.shape if hasattr(shape, "range") else shape).control_points.tobytes())


@pytest.mark.parametrize("suffix", [".json", ".toml"])
@given(model=models())
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_reading_what_was_written_gives_the_same_model_bit_for_bit(
    tmp_path_factory: pytest.TempPathFactory, suffix: str, model: Model
) -> None:
    path = tmp_path_factory.getbasetemp() / f"round{suffix}"
    gtcad.dump_model(model, path)
    back = gtcad.load_model(path)
    assert back == model
    assert list(back) == list(model)
    assert [control_bits(shape) for shape in back.values()] == [control_bits(shape) for shape in model.values()]
    assert valid_by_schema(model.document(), SCHEMA)


def test_json_and_toml_hold_the_same_data(tmp_path: Path) -> None:
    model = Model({"a": Curve([[0, 0.1], [1, 1 / 3], [2, -0.0]], (0.25, -1))}, "ft", {"a": "#0000ff"})
    gtcad.dump_model(model, tmp_path / "m.json")
    gtcad.dump_model(model, tmp_path / "m.toml")
    assert json.loads((tmp_path / "m.json").read_text()) == tomllib.loads((tmp_path / "m.toml").read_text())


def test_a_written_toml_file_can_be_read_by_people(tmp_path: Path) -> None:
    gtcad.dump_model({"arch": Curve([[0, 0], [1, 2], [2, 0]])}, tmp_path / "m.toml", colors={"arch": "#1f77b4"})
    assert (tmp_path / "m.toml").read_text() == (
        'gtcad = 1\nunit = "mm"\n\n[[shape]]\nname = "arch"\nkind = "curve"\ncolor = "#1f77b4"\ngamma = [0.0, 0.0]\n'
        "control_points = [\n  [0.0, 0.0],\n  [1.0, 2.0],\n  [2.0, 0.0]\n]\n"
    )


def test_what_may_be_left_out_has_the_values_that_the_documentation_states(tmp_path: Path) -> None:
    model = gtcad.load_model(written(tmp_path, ARCH, ROOF | {"color": None, "range": None}))
    assert model.unit == "mm"
    assert model.colors == {}
    assert model["arch"] == Curve([[0, 0], [1, 2], [2, 0]], (0, 0), GT)
    assert model["roof"] == Surface(ROOF["control_points"])


def test_each_direction_of_a_surface_can_have_its_own_family(tmp_path: Path) -> None:
    model = gtcad.load_model(
        written(
            tmp_path,
            ROOF | {"family_u": "bernstein", "gamma_v": [0.5, 0]},
            ROOF | {"name": "both", "family": "bernstein"},
            ROOF | {"name": "one", "family": "bernstein", "family_v": "GT", "gamma_v": [1, -1]},
        )
    )
    roof, both, one = model.values()
    assert isinstance(roof, Surface)
    assert isinstance(both, Surface)
    assert isinstance(one, Surface)
    assert (roof.family_u, roof.family_v, roof.gamma_v) == (BERNSTEIN, GT, (0.5, 0))
    assert (both.family_u, both.family_v) == (BERNSTEIN, BERNSTEIN)
    assert (one.family_u, one.family_v, one.gamma_v) == (BERNSTEIN, GT, (1, -1))


def test_a_range_gives_a_part_of_the_domain(tmp_path: Path) -> None:
    curve, surface = gtcad.load_model(
        written(tmp_path, ARCH | {"range": [1, 0.25]}, ROOF | {"range": [[0, 0.5], [0.25, 1]]})
    ).values()
    assert curve == Restricted(Curve([[0, 0], [1, 2], [2, 0]]), (1, 0.25))
    assert surface == Restricted(Surface(ROOF["control_points"]), ((0, 0.5), (0.25, 1)))


@pytest.mark.parametrize(("unit", "factor"), [("mm", 1), ("cm", 10), ("m", 1000), ("in", 25.4), ("ft", 304.8)])
def test_lengths_become_millimetres(tmp_path: Path, unit: str, factor: float) -> None:
    part = ARCH | {"name": "part", "range": [0, 0.5]}
    model = gtcad.load_model(written(tmp_path, ARCH, ROOF, part, unit=unit))
    scaled = model.in_millimetres()
    for name, shape in model.items():
        assert np.array_equal(scaled[name].coefficients, factor * shape.coefficients)
        if unit == "mm":
            assert scaled[name] is shape


def test_a_file_may_begin_with_a_byte_order_mark_and_end_its_lines_as_windows_does(tmp_path: Path) -> None:
    for suffix, text in [(".json", json.dumps({"gtcad": 1, "shape": [ARCH]})), (".toml", TOML)]:
        path = tmp_path / f"MODEL{suffix.upper()}"
        path.write_bytes(b"\xef\xbb\xbf" + text.replace("\n", "\r\n").encode())
        assert list(gtcad.load_model(path)) == ["arch"]


TOML = 'gtcad = 1\n[[shape]]\nname = "arch"\nkind = "curve"\ncontrol_points = [[0, 0], [1, 2], [2, 0]]\n'


@pytest.mark.parametrize(
    ("shape", "expected"),
    [
        (ARCH | {"gamma": [0, 1.25]}, "gamma[1]: must lie in [-1, 1], got 1.25"),
        (ARCH | {"gamma": [math.nan, 0]}, "gamma[0]: must be finite, got nan"),
        (ARCH | {"gamma": [0, 0, 0]}, "gamma: must be two design variables in [-1, 1], got a list of 3"),
        (ARCH | {"gamma": 0.5}, "gamma: must be two design variables in [-1, 1], got 0.5"),
        (ARCH | {"gamma": [True, "0"]}, "gamma[0]: must be a number, got true"),
        (
            ARCH | {"family": "bernstein", "gamma": [0, 0]},
            "gamma: the family bernstein takes no design variables: leave it out, got a list of 2",
        ),
        (
            ROOF | {"family": "bernstein", "family_v": "GT", "gamma_u": [0, 0], "gamma_v": [0, 0]},
            "gamma_u: the family bernstein takes no design variables: leave it out, got a list of 2",
        ),
        (ARCH | {"family": "Bernstein"}, "family: must be one of GT, bernstein, got 'Bernstein'"),
        (ARCH | {"family_u": "GT"}, "family_u: is not a field of this format; did you mean family?"),
        (ARCH | {"kind": "spiral"}, f"kind: must be one of {KINDS}, got 'spiral'"),
        (ARCH | {"kind": ["curve"]}, f"kind: must be one of {KINDS}, got a list of 1"),
        (ARCH | {"color": "blue"}, "color: must be a text like '#1f77b4' (red, green, blue), got 'blue'"),
        (ARCH | {"range": [0.5, 0.5]}, "range: must be two different parameters, got [0.5, 0.5]"),
        (ARCH | {"range": [-0.1, 0.5]}, "range[0]: must lie in [0, 1], got -0.1"),
        (ROOF | {"range": [0, 1]}, "range[0]: must be two parameters in [0, 1], got 0"),
        (ROOF | {"range": [[0, 1]]}, "range: must be two ranges, one for u and one for v, got a list of 1"),
        (
            ARCH | {"control_points": []},
            "control_points: must have at least 3 points (degree 2 of the family GT), got 0",
        ),
        (
            ARCH | {"family": "bernstein", "control_points": [[0, 0]]},
            "control_points: must have at least 2 points (degree 1 of the family bernstein), got 1",
        ),
        (ARCH | {"control_points": [[0, 0]] * 62}, "control_points: must have at most 61 points (degree 60), got 62"),
        (ARCH | {"control_points": "zigzag"}, "control_points: must be a list of points, got 'zigzag'"),
        (ARCH | {"control_points": [[0, 0], [1, "2"], [2, 0]]}, "control_points[1][1]: must be a number, got '2'"),
        (ARCH | {"control_points": [[0, 0], [1, None], [2, 0]]}, "control_points[1][1]: must be a number, got null"),
        (ARCH | {"control_points": [[0, 0], [1, False], [2, 0]]}, "control_points[1][1]: must be a number, got false"),
        (
            ARCH | {"control_points": [[0, 0], [1, [2]], [2, 0]]},
            "control_points[1][1]: must be a number, got a list of 1",
        ),
        (
            ARCH | {"control_points": [[0, 0], 1, [2, 0]]},
            "control_points[1]: must be a point, a list of 2 or 3 numbers, got 1",
        ),
        (ARCH | {"control_points": [[0, 0], [1], [2, 0]]}, "control_points[1]: must have 2 or 3 coordinates, got 1"),
        (
            ARCH | {"control_points": [[0, 0], [1, 2, 3], [2, 0]]},
            "control_points[1]: must have 2 coordinates like the points before, got 3",
        ),
        (
            ARCH | {"control_points": [[0, 0], [1, 2], [2, 10**60]]},
            "control_points[2][1]: must be at most 1e+50 in size, got an integer of 200 bits",
        ),
        (ARCH | {"control_points": [[0, 0], [1, 2], [2, math.inf]]}, "control_points[2][1]: must be finite, got inf"),
        (
            ROOF | {"control_points": [[1, 2, 3]] * 3},
            "control_points[0][0]: must be a point, a list of 3 numbers, got 1",
        ),
        (ROOF | {"control_points": {"a": 1}}, "control_points: must be a list of rows of points, got an object"),
        (
            ROOF | {"control_points": [[[0, 0]] * 3] * 3},
            "control_points: points must have 3 coordinates, got 2 in each",
        ),
        (
            ROOF | {"control_points": [[[0, 0, 0]] * 3] * 2},
            "control_points: must have at least 3 rows (degree 2 in u of the family GT), got 2",
        ),
        (
            ROOF | {"family_u": "bernstein", "control_points": [[[0, 0, 0]] * 2] * 2},
            "control_points: must have at least 3 points in each row (degree 2 in v of the family GT), got 2",
        ),
        (
            ROOF | {"control_points": [[[0, 0, 0]] * 3, [[0, 0, 0]] * 4, [[0, 0, 0]] * 4]},
            "control_points[0]: row 0 has 3 points, row 1 has 4: all rows must be equally long",
        ),
        ({"kind": "curve", "name": "arch"}, "control_points: is missing"),
        (ARCH | {"gama": [0, 0]}, "gama: is not a field of this format; did you mean gamma?"),
        (ARCH | {"x y": 1}, "'x y': is not a field of this format"),
        (ARCH | {"@": None}, "'@': is not a field of this format"),
    ],
)
def test_a_wrong_field_is_named_with_what_was_given_and_what_is_allowed(
    tmp_path: Path, shape: dict[str, Any], expected: str
) -> None:
    path = written(tmp_path, ROOF | {"name": "before"}, shape)
    found = problems(path)
    assert found[0] == f"shape {shape['name']!r} (no. 2), {expected}"


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        (3, "shape no. 1, name: must be a text, got 3"),
        ("", "shape '' (no. 1), name: must not be empty, got ''"),
        (" \t", r"shape ' \t' (no. 1), name: must not be empty, got ' \t'"),
        ("a\x1b[2J", r"shape 'a\x1b[2J' (no. 1), name: must consist of printable characters, got 'a\x1b[2J'"),
        ("\ud800", r"shape '\ud800' (no. 1), name: must consist of printable characters, got '\ud800'"),
        ("n" * 201, f"shape '{'n' * 37}...' (no. 1), name: must have at most 200 characters, got 201"),
    ],
)
def test_names_are_texts_that_can_be_printed(tmp_path: Path, name: object, expected: str) -> None:
    assert problems(written(tmp_path, ARCH | {"name": name})) == [expected]


def test_a_name_is_given_once(tmp_path: Path) -> None:
    found = problems(written(tmp_path, ARCH, ROOF, ARCH, ROOF | {"name": "arch"}))
    assert found == [
        "shape 'arch' (no. 3), name: is already the name of shape no. 1",
        "shape 'arch' (no. 4), name: is already the name of shape no. 1",
    ]


@pytest.mark.parametrize(
    ("head", "expected"),
    [
        ({"gtcad": 2}, "gtcad: must be 1, got 2"),
        ({"gtcad": "1"}, "gtcad: must be 1, got '1'"),
        ({"gtcad": True}, "gtcad: must be 1, got true"),
        ({"gtcad": 1.0}, "gtcad: must be 1, got 1.0"),
        ({"unit": "km"}, "unit: must be one of mm, cm, m, in, ft, got 'km'"),
        ({"unit": 25.4}, "unit: must be one of mm, cm, m, in, ft, got 25.4"),
        ({"shape": []}, "shape: must hold 1 at least, got 0"),
        ({"shape": {"arch": ARCH}}, "shape: must be a list of shapes, got an object"),
        ({"shape": [ARCH, 7]}, "shape no. 2: must be an object with the fields of a shape, got 7"),
        ({"shape": [{}]}, f"shape no. 1, kind: is missing; must be one of {KINDS}"),
        ({"shapes": [ARCH]}, "shapes: is not a field of this format; did you mean shape?"),
    ],
)
def test_a_wrong_head_is_named(tmp_path: Path, head: dict[str, Any], expected: str) -> None:
    assert problems(written(tmp_path, ARCH, **head)) == [expected]


def test_version_and_shapes_must_be_there(tmp_path: Path) -> None:
    path = tmp_path / "m.json"
    path.write_text("{}")
    assert problems(path) == ["gtcad: is missing (this program reads version 1)", "shape: is missing"]


def test_all_problems_come_at_once_and_shape_by_shape(tmp_path: Path) -> None:
    path = tmp_path / "m.toml"
    path.write_text(
        """
        unit = "inch"
        [[shape]]
        name = "hood"
        kind = "surface"
        gamma_u = [1.25, 0]
        family_v = "bernstein"
        gamma_v = [0, 0]
        control_points = [[[0, 0, nan], [1, 1, 1]], [[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 0, 0], [1, 2]]]
        [[shape]]
        name = "hood"
        colour = "#ffffff"
        kind = "curve"
        control_points = [[0, 0], [1, true]]
        """
    )
    assert problems(path) == [
        "gtcad: is missing (this program reads version 1)",
        "unit: must be one of mm, cm, m, in, ft, got 'inch'",
        "shape 'hood' (no. 1), gamma_u[0]: must lie in [-1, 1], got 1.25",
        "shape 'hood' (no. 1), gamma_v: the family bernstein takes no design variables: leave it out, got a list of 2",
        "shape 'hood' (no. 1), control_points[1]: row 1 has 3 points, row 0 has 2: all rows must be equally long",
        "shape 'hood' (no. 1), control_points[0][0][2]: must be finite, got nan",
        "shape 'hood' (no. 1), control_points[2][1]: must have 3 coordinates, got 2",
        "shape 'hood' (no. 2), name: is already the name of shape no. 1",
        "shape 'hood' (no. 2), control_points: must have at least 3 points (degree 2 of the family GT), got 2",
        "shape 'hood' (no. 2), control_points[1][1]: must be a number, got true",
        "shape 'hood' (no. 2), colour: is not a field of this format; did you mean color?",
    ]


def test_more_problems_than_help_anybody_are_only_counted(tmp_path: Path) -> None:
    found = problems(written(tmp_path, ARCH | {"control_points": [["x", "y"]] * 31}))
    assert len(found) == 51
    assert found[-1] == "and 12 more problems"


def test_a_field_given_twice_is_named(tmp_path: Path) -> None:
    path = tmp_path / "m.json"
    path.write_text('{"gtcad": 1, "unit": "mm", "unit": "in", "shape": [{"name": "a", "name": "b", "kind": "curve"}]}')
    assert problems(path) == [
        "unit: is given more than once",
        "shape 'b' (no. 1), name: is given more than once",
        "shape 'b' (no. 1), control_points: is missing",
    ]
    path.write_text('{"gtcad": 1, "shape": [{"name": {"a": 1, "a": 2}, "kind": "curve", "control_points": [[0, 0]]}]}')
    assert "a: is given more than once" in problems(path)


def test_absurd_integers_are_described_not_printed(tmp_path: Path) -> None:
    path = tmp_path / "m.toml"
    path.write_text(TOML.replace("gtcad = 1", f"gtcad = 0x{'f' * 9000}").replace("[1, 2]", f"[1, 0x{'f' * 9000}]"))
    assert problems(path) == [
        "gtcad: must be 1, got an integer of 36000 bits",
        "shape 'arch' (no. 1), control_points[1][1]: must be at most 1e+50 in size, got an integer of 36000 bits",
    ]
    path.write_text(TOML.replace("[1, 2]", f"[1, {'9' * 9000}]"))
    assert problems(path) == ["holds a number or a date that is beyond all limits"]


@pytest.mark.parametrize("suffix", [".json", ".toml"])
@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (b"", "is empty"),
        (b" \r\n\t ", "is empty"),
        (b"\xef\xbb\xbf", "is empty"),
        (b"\xff\xfeg\x00", "is not UTF-8 text: byte 0xff at position 0"),
        (b"{\x00\x9f", "is not UTF-8 text: byte 0x9f at position 2"),
    ],
)
def test_what_is_not_text_is_refused(tmp_path: Path, suffix: str, content: bytes, expected: str) -> None:
    path = tmp_path / f"m{suffix}"
    path.write_bytes(content)
    assert problems(path) == [expected]


def test_syntax_errors_are_placed(tmp_path: Path) -> None:
    path = tmp_path / "m.json"
    path.write_text('{"gtcad": 1,\n "shape" []}')
    assert problems(path) == ["is not valid JSON: expecting ':' delimiter (at line 2, column 10)"]
    path.write_text("[1, 2]")
    assert problems(path) == ["must be an object with the fields gtcad, unit and shape, got a list of 2"]
    path = tmp_path / "m.toml"
    path.write_text("gtcad = 1\nunit = mm\n")
    assert problems(path) == ["is not valid TOML: invalid value (at line 2, column 8)"]


@pytest.mark.parametrize(("suffix", "text"), [(".json", '{"gtcad": %s}'), (".toml", "gtcad = %s")])
def test_absurd_nesting_is_refused(tmp_path: Path, suffix: str, text: str) -> None:
    path = tmp_path / f"m{suffix}"
    path.write_text(text % ("[" * 200_000 + "]" * 200_000))
    assert problems(path) == ["is nested too deeply to be a model"]
    path.write_text(text % ("[" * 90 + "]" * 90))
    assert problems(path)[0] == "gtcad: must be 1, got a list of 1"


def test_files_that_cannot_be_read_are_no_models_gone_wrong(tmp_path: Path) -> None:
    (tmp_path / "folder.json").mkdir()
    (tmp_path / "notes.txt").write_text("{}")
    with (tmp_path / "huge.json").open("wb") as huge:
        huge.truncate(200_000_000)
    for name, reason in [
        ("none.json", "cannot be read: No such file or directory"),
        ("folder.json", "is a folder"),
        ("notes.txt", "a model file ends in .json or .toml, this one in '.txt'"),
        ("huge.json", "has 200000000 bytes, a model at most 100000000"),
        ("null\0.json", "cannot be read: embedded null byte"),
    ]:
        with pytest.raises(FileError) as caught:
            gtcad.load_model(tmp_path / name)
        assert not isinstance(caught.value, ModelError)
        assert caught.value.reason == reason


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_a_pipe_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.json")
    with pytest.raises(FileError, match="is not an ordinary file"):
        gtcad.load_model(tmp_path / "pipe.json")


@pytest.mark.parametrize(
    ("shapes", "keywords", "expected"),
    [
        ({}, {}, "shape: must hold 1 at least, got 0"),
        ({"a": ARCH}, {}, "cannot hold dict: it has no kind for it"),
        ({"\n": Curve([[0, 0], [1, 2], [2, 0]])}, {}, "name: must not be empty"),
        ({"a": Curve([[0.0, 0.0], [1.0, 2.0], [2.0, 1e60]])}, {}, r"control_points\[2\]\[1\]: must be at most 1e\+50"),
        ({"a": Surface(np.zeros((3, 3, 2)))}, {}, "points must have 3 coordinates, got 2"),
        ({"a": Curve([[0, 0], [1, 2], [2, 0]])}, {"unit": "km"}, "unit: must be one of mm, cm, m, in, ft, got 'km'"),
        ({"a": Curve([[0, 0], [1, 2], [2, 0]])}, {"colors": {"a": "red"}}, "color: must be a text like"),
        ({"a": Curve([[0, 0], [1, 2], [2, 0]])}, {"colors": {"b": "#ffffff"}}, "does not have: 'b'"),
        (
            {"a": Restricted(Restricted(Curve([[0, 0], [1, 2], [2, 0]]), (0, 0.5)), (0, 0.5))},
            {},
            "cannot hold RestrictedCurve of RestrictedCurve",
        ),
    ],
)
def test_what_no_model_file_can_hold_is_not_written(
    tmp_path: Path, shapes: dict[str, Any], keywords: dict[str, Any], expected: str
) -> None:
    with pytest.raises(InputError, match=expected):
        gtcad.dump_model(shapes, tmp_path / "m.json", **keywords)
    assert not list(tmp_path.iterdir())


def test_writing_a_model_keeps_its_unit(tmp_path: Path) -> None:
    model = Model({"a": Curve([[0, 0], [1, 2], [2, 0]])}, "in", {"a": "#ffffff"})
    with pytest.raises(InputError, match="unit must be that of the model, in, got 'mm'"):
        gtcad.dump_model(model, tmp_path / "m.json", unit="mm")
    gtcad.dump_model(model, tmp_path / "m.json", colors={})
    assert gtcad.load_model(tmp_path / "m.json") == Model(model, "in")


def test_a_file_is_written_whole_or_not_at_all(tmp_path: Path) -> None:
    shapes = {"a": Curve([[0, 0], [1, 2], [2, 0]])}
    with pytest.raises(FileError, match="cannot be written"):
        gtcad.dump_model(shapes, tmp_path / "none" / "m.json")
    with pytest.raises(FileError, match=r"ends in \.json or \.toml"):
        gtcad.dump_model(shapes, tmp_path / "m.yaml")
    assert not list(tmp_path.iterdir())


def test_a_model_is_a_mapping_that_does_not_change() -> None:
    curve, surface = Curve([[0, 0], [1, 2], [2, 0]]), Surface(np.zeros((3, 3, 3)))
    model = Model({"a": curve, "b": surface})
    assert dict(model) == {"a": curve, "b": surface}
    assert model == Model({"a": curve, "b": surface})
    assert hash(model) == hash(Model({"a": curve, "b": surface}))
    assert model != Model({"b": surface, "a": curve})
    assert model != Model({"a": curve, "b": surface}, "cm")
    assert model != Model({"a": curve, "b": surface}, colors={"a": "#000000"})
    assert model != Model({"a": curve.reversed(), "b": surface.transposed()}, colors={"a": "#000000"})
    with pytest.raises(TypeError):
        model.shapes["a"] = surface  # type: ignore[index]


VALID = {
    "gtcad": 1,
    "unit": "mm",
    "shape": [ARCH | {"gamma": [0, 1], "color": "#ffffff"}, ROOF | {"range": [[0, 1], [0, 1]]}],
}
FUZZ = settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
plain = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=4),
    max_leaves=10,
)


def load_or_refuse(path: Path) -> None:
    """Only errors of ours may come out, in our words."""
    message = ""
    try:
        gtcad.load_model(path)
    except GtcadError as error:
        message = str(error)
        assert message.startswith(f"{path}: ")
    assert "Input should" not in message
    assert "Value error" not in message
    assert len(message) < 60 * 500


@pytest.mark.parametrize("suffix", [".json", ".toml"])
@given(content=st.binary(max_size=80) | st.text(max_size=80).map(lambda text: text.encode("utf-8", "replace")))
@FUZZ
def test_random_bytes_are_refused_in_our_words(tmp_path: Path, suffix: str, content: bytes) -> None:
    path = tmp_path / f"m{suffix}"
    path.write_bytes(content)
    with pytest.raises(ModelError):
        gtcad.load_model(path)


@pytest.mark.parametrize("suffix", [".json", ".toml"])
@given(data=st.data())
@FUZZ
def test_files_with_bytes_changed_are_read_or_refused_in_our_words(
    tmp_path: Path, suffix: str, data: st.DataObject
) -> None:
    content = bytearray((json.dumps(VALID) if suffix == ".json" else TOML).encode())
    for _ in range(data.draw(st.integers(1, 4))):
        start = data.draw(st.integers(0, len(content) - 1))
        content[start : start + data.draw(st.integers(0, 6))] = data.draw(st.binary(max_size=6))
        assume(content)
    path = tmp_path / f"m{suffix}"
    path.write_bytes(content)
    load_or_refuse(path)


@given(data=st.data(), value=plain)
@FUZZ
def test_files_with_a_value_changed_are_read_or_refused_in_our_words(
    tmp_path: Path, data: st.DataObject, value: object
) -> None:
    model = json.loads(json.dumps(VALID))
    place: Any = model
    while True:
        key = data.draw(st.sampled_from(sorted(place) if isinstance(place, dict) else range(len(place))))
        if not isinstance(place[key], dict | list) or not place[key] or data.draw(st.booleans()):
            break
        place = place[key]
    place[key] = value
    path = tmp_path / "m.json"
    path.write_text(json.dumps(model))
    load_or_refuse(path)


@given(value=plain)
@FUZZ
def test_any_json_is_read_or_refused_in_our_words(tmp_path: Path, value: object) -> None:
    path = tmp_path / "m.json"
    path.write_text(json.dumps(value))
    load_or_refuse(path)


def valid_by_schema(value: Any, rule: dict[str, Any]) -> bool:
    """Whether a value satisfies a JSON Schema, for the keywords that ours uses; an unknown one is an error."""
    definitions = SCHEMA["$defs"]
    types: dict[str, Any] = {
        "object": dict,
        "array": list,
        "string": str,
        "number": (int, float),
        "integer": int,
        "boolean": bool,
    }
    tests: dict[str, Any] = {
        "$ref": lambda to: valid_by_schema(value, definitions[to.rpartition("/")[2]]),
        "anyOf": lambda rules: any(valid_by_schema(value, entry) for entry in rules),
        "oneOf": lambda rules: sum(valid_by_schema(value, entry) for entry in rules) == 1,
        "const": lambda wanted: value == wanted,
        "enum": lambda wanted: value in wanted,
        "type": lambda name: (
            value is None
            if name == "null"
            else isinstance(value, types[name]) and (name == "boolean" or not isinstance(value, bool))
        ),
        "required": lambda fields: set(fields) <= set(value),
        "additionalProperties": lambda allowed: allowed or rule["properties"].keys() >= value.keys(),
        "properties": lambda rules: all(valid_by_schema(value[k], rules[k]) for k in value if k in rules),
        "items": lambda entry: all(valid_by_schema(item, entry) for item in value),
        "prefixItems": lambda rules: all(map(valid_by_schema, value, rules)),
        "minItems": lambda least: len(value) >= least,
        "maxItems": lambda most: len(value) <= most,
        "minLength": lambda least: len(value) >= least,
        "maxLength": lambda most: len(value) <= most,
        "minimum": lambda least: value >= least,
        "exclusiveMinimum": lambda least: value > least,
        "maximum": lambda most: value <= most,
        "pattern": lambda pattern: re.search(pattern, value) is not None,
    }
    silent = {"$schema", "$defs", "title", "description", "default", "examples", "discriminator"}
    assert set(rule) <= set(tests) | silent, set(rule) - set(tests) - silent
    ordered = sorted(set(rule) & set(tests), key=lambda keyword: keyword not in ("type", "anyOf"))
    return all(tests[keyword](rule[keyword]) for keyword in ordered)


@pytest.mark.parametrize(
    "path", sorted((*SAMPLES.rglob("*.json"), *SAMPLES.rglob("*.toml"))), ids=lambda path: path.name
)
def test_every_sample_loads_and_satisfies_the_schema(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    data = json.loads(text) if path.suffix == ".json" else tomllib.loads(text)
    assert valid_by_schema(data, SCHEMA)
    assert len(gtcad.load_model(path)) == len(data["shape"])


@pytest.mark.parametrize(
    "change",
    [
        {"gtcad": 2},
        {"unit": "km"},
        {"shape": []},
        {"shapes": []},
        {"shape": [{"kind": "curve", "name": "a"}]},
        {"shape": [ARCH | {"gamma": [0, 2]}]},
        {"shape": [ARCH | {"color": "blue"}]},
        {"shape": [ARCH | {"gama": [0, 0]}]},
        {"shape": [ARCH | {"control_points": [[0, 0], [1], [2, 2]]}]},
        {"shape": [ROOF | {"control_points": [[[0, 0]] * 3] * 3}]},
        {"shape": [ROOF | {"range": [0, 1]}]},
    ],
)
def test_the_schema_refuses_what_the_reader_refuses(tmp_path: Path, change: dict[str, Any]) -> None:
    assert valid_by_schema(VALID, SCHEMA)
    assert not valid_by_schema(VALID | change, SCHEMA)
    assert problems(written(tmp_path, **VALID | change))


def test_the_schema_describes_every_field() -> None:
    content = schema()
    assert content["$schema"].endswith("2020-12/schema")
    for model in (content, content["$defs"]["CurveEntry"], content["$defs"]["SurfaceEntry"]):
        assert model["description"]
        for name, field in model["properties"].items():
            assert name == "kind" or field["description"], name


def test_importing_gtcad_does_not_import_what_only_models_need() -> None:
    code = "import sys, gtcad; print([m for m in ('gtcad.model', 'pydantic', 'scipy') if m in sys.modules])"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"
