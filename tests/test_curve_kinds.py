"""Chains and conics in model files: round trips, units, construction shapes, and every mistake named."""

from __future__ import annotations

import json
import math
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import gtcad
from gtcad import BERNSTEIN, Composite, Curve, Restricted
from gtcad.conics import Arc, arc, circle, ellipse, hyperbola, parabola
from gtcad.errors import InputError, ModelError
from gtcad.model import Model
from tests import test_model
from tests.model_files import loaded
from tests.test_composite import loop

LINE: dict[str, Any] = {"name": "line", "kind": "curve", "family": "bernstein", "control_points": [[0, 0], [1, 0]]}
ROOF: dict[str, Any] = {
    "name": "roof",
    "kind": "surface",
    "control_points": [[[i, j, 0] for j in range(3)] for i in range(3)],
}
FIRST: dict[str, Any] = {"control_points": [[0, 0], [1, 1], [2, 0], [3, 1]], "gamma": [0.25, -0.5]}
SECOND: dict[str, Any] = {"control_points": [[3, 2], [4, 1], [5, 0], [6, 1]]}
CHAIN: dict[str, Any] = {"name": "chain", "kind": "composite", "pieces": [FIRST, SECOND], "orders": "G1"}
CIRCLE: dict[str, Any] = {"name": "ring", "kind": "circle", "center": [1, 2], "radius": 3}
SPATIAL: dict[str, Any] = CIRCLE | {"center": [1, 2, 4]}
ELLIPSE: dict[str, Any] = {"name": "oval", "kind": "ellipse", "center": [1, 2], "axis_a": [2, 0], "axis_b": [0, 1]}
ARC: dict[str, Any] = {"name": "bow", "kind": "arc", "center": [1, 2], "radius": 3, "angles": [20, 250]}
AXES: dict[str, Any] = {"name": "bow", "kind": "arc", "center": [1, 2], "axis_a": [2, 0], "axis_b": [0, 1]}
PARABOLA: dict[str, Any] = {"name": "dish", "kind": "parabola", "control_points": [[0, 0], [1, 2], [2, 0]]}


def mixed() -> Composite:
    drawn = loop(np.random.default_rng(5), 4, 7, 2.0)
    return Composite.solved(drawn, ["G3", "C0", "C2", "G1"], closed=True)


def shapes() -> dict[str, Any]:
    quarter = circle([0, 0, 1], 2).pieces[0]
    return {
        "mixed": mixed(),
        "open": Composite.solved(mixed().pieces[:2], ["C3"]),
        "one": Composite(mixed().pieces[:1], ()),
        "parts": Composite(
            (
                Restricted(quarter, (0.0, 0.4)),
                Restricted(quarter, (0.4, 1.0)),
                Curve([[0, 2, 1], [9, 2, 7]], family=BERNSTEIN),
            ),
            ("G3", "C0"),
        ),
        "circle": circle([0.1, 0.2], 1 / 3),
        "tilted": circle([0.1, 0.2, 0.3], 1 / 3, [1, 2, 3]),
        "ellipse": ellipse([0.1, 0.2], [3, 1], [1, 2]),
        "arc": arc([0.1, 0.2], 1 / 3, 10.1, -200.3),
        "turn": Arc([0, 0], [1, 0], [0, 2], 30, 390),
        "parabola": parabola([0, 0], [0.1, 0.7], [1, 0]),
    }


def bits(shape: Any) -> list[bytes]:
    pieces = shape.pieces if isinstance(shape, Composite) else [shape]
    return [np.asarray(piece.coefficients).tobytes() for piece in pieces]


@pytest.mark.parametrize("suffix", [".json", ".toml"])
def test_reading_what_was_written_gives_the_same_shapes_bit_for_bit(tmp_path: Path, suffix: str) -> None:
    model = Model(shapes(), "in", {"mixed": "#102030"}, frozenset({"one", "circle"}))
    path = tmp_path / f"m{suffix}"
    gtcad.dump_model(model, path)
    back = gtcad.load_model(path)
    assert back == model
    for name, shape in model.items():
        assert type(back[name]) is type(shape)
        assert bits(back[name]) == bits(shape)
    assert back.construction == {"one", "circle"}
    text = path.read_text()
    data = json.loads(text) if suffix == ".json" else tomllib.loads(text)
    kinds = [entry["kind"] for entry in data["shape"]]
    assert kinds == [*["composite"] * 4, *["ellipse"] * 3, "arc", "arc", "curve"]


@pytest.mark.parametrize(("unit", "factor"), [("mm", 1), ("cm", 10), ("m", 1000), ("in", 25.4), ("ft", 304.8)])
def test_lengths_become_millimetres_and_joints_stay_joined(unit: str, factor: float) -> None:
    for name, shape in Model(shapes(), unit).in_millimetres().items():
        given = shapes()[name]
        end = given.domain[1]
        t = np.linspace(0, end, 31)
        assert shape.evaluate(t) == pytest.approx(factor * given.evaluate(t), rel=1e-13, abs=1e-13 * factor)
        if isinstance(shape, Composite):
            assert shape.unmet() == ""


def test_the_kinds_are_what_they_say(tmp_path: Path) -> None:
    model = loaded(
        tmp_path,
        CIRCLE,
        SPATIAL | {"name": "flat", "normal": [0, 0, -2]},
        ELLIPSE,
        ARC,
        AXES | {"name": "part", "angles": [90, 0]},
        PARABOLA,
        CHAIN,
    )
    t = np.linspace(0, 4, 57)
    assert np.linalg.norm(model["ring"].evaluate(t) - [1, 2], axis=1) == pytest.approx(3.0)
    flat = model["flat"].evaluate(t)
    assert flat[:, 2] == pytest.approx(4.0)
    assert np.linalg.norm(flat - [1, 2, 4], axis=1) == pytest.approx(3.0)
    turn = np.cross(flat[0] - [1, 2, 4], flat[1] - [1, 2, 4])
    assert turn[2] < 0  # counterclockwise as seen from the normal's tip, which points down
    x, y = ((model["oval"].evaluate(t) - [1, 2]) / [2, 1]).T
    assert x**2 + y**2 == pytest.approx(1.0)
    bow = model["bow"]
    ends = [[1 + 3 * math.cos(math.radians(a)), 2 + 3 * math.sin(math.radians(a))] for a in (20, 250)]
    assert bow.evaluate(list(bow.domain)) == pytest.approx(np.array(ends))
    assert model["part"].evaluate([0, 1]) == pytest.approx(np.array([[1, 3], [3, 2]]))
    x, y = model["dish"].evaluate(np.linspace(0, 1, 9)).T
    assert y == pytest.approx(2 * x - x**2)
    assert [report.order for report in model["chain"].report()] == ["G1"]


def test_a_chain_that_meets_its_orders_is_taken_as_it_is_and_another_one_solved(tmp_path: Path) -> None:
    model = loaded(tmp_path, CHAIN)
    drawn = [Curve(FIRST["control_points"], FIRST["gamma"]), Curve(SECOND["control_points"])]
    assert model["chain"] == Composite.solved(drawn, ["G1"])
    pieces = [
        {"control_points": piece.control_points.tolist(), "gamma": piece.gamma} for piece in model["chain"].pieces
    ]
    assert bits(loaded(tmp_path, CHAIN | {"pieces": pieces})["chain"]) == bits(model["chain"])


def test_fixed_control_points_stay(tmp_path: Path) -> None:
    chain = loaded(tmp_path, CHAIN | {"fixed": [[0, 3], [1, 1]]})["chain"]
    assert isinstance(chain, Composite)
    assert chain.pieces[0].coefficients[3] == pytest.approx([3, 1], abs=1e-12)
    assert chain.pieces[1].coefficients[1] == pytest.approx([4, 1], abs=1e-12)
    assert chain.unmet() == ""


def test_pieces_by_name_whatever_the_order_of_the_file(tmp_path: Path) -> None:
    parts = [{"name": "a", "kind": "curve"} | FIRST, {"name": "b", "kind": "curve", "construction": True} | SECOND]
    spelled = loaded(tmp_path, CHAIN)["chain"]
    for entries in ([*parts, CHAIN | {"pieces": ["a", "b"]}], [CHAIN | {"pieces": ["a", "b"]}, *parts]):
        model = loaded(tmp_path, *entries)
        assert model["chain"] == spelled
        assert list(model) == [entry["name"] for entry in entries]
        assert model["a"] == Curve(FIRST["control_points"], FIRST["gamma"])  # as drawn, not as solved
    twice = loaded(tmp_path, LINE, CHAIN | {"pieces": ["line", SECOND, "line"], "orders": ["G1", "C1"]})["chain"]
    assert isinstance(twice, Composite)
    assert len(twice.pieces) == 3


def test_one_text_stands_for_all_joints(tmp_path: Path) -> None:
    for closed, orders in ((False, ("C1",)), (True, ("C1", "C1"))):
        chain = loaded(tmp_path, CHAIN | {"orders": "C1", "closed": closed})["chain"]
        assert isinstance(chain, Composite)
        assert (chain.orders, chain.closed) == (orders, closed)
    alone = loaded(tmp_path, CHAIN | {"pieces": [FIRST], "orders": []})["chain"]
    assert isinstance(alone, Composite)
    assert alone.orders == ()


def test_construction_shapes_are_neither_exported_nor_checked(tmp_path: Path) -> None:
    from gtcad.converters.check import check_parts
    from gtcad.converters.jobs import fit_shapes, parts_of
    from gtcad.converters.step import read_step, write_step

    model = loaded(tmp_path, LINE | {"construction": True}, CHAIN | {"pieces": ["line", SECOND]}, CIRCLE)
    assert list(model) == ["line", "chain", "ring"]
    shapes = model.in_millimetres()
    assert list(shapes) == ["chain", "ring"]
    write_step(tmp_path / "m.step", parts_of(list(fit_shapes(shapes, {"tolerance": 1e-3})), {}))
    parts = read_step(tmp_path / "m.step")
    assert {part.name for part in parts} == {"chain", "ring"}
    report = check_parts(parts, shapes, 1e-3)
    assert {row.name.split(" #")[0] for row in report.rows} == {"chain", "ring"}
    assert {row.verdict for row in report.rows} == {"proved"}
    assert Model(model, "mm", {}, frozenset({"line"})) == model
    with pytest.raises(InputError, match="construction names a shape that the model does not have: 'lines'"):
        Model(model, "mm", {}, frozenset({"lines"}))


@pytest.mark.parametrize(
    ("shape", "expected"),
    [
        (CHAIN | {"orders": "G4"}, ", orders: must be one of C0 to C3 and G0 to G3, got 'G4'"),
        (CHAIN | {"orders": ["G1", 7]}, ", orders[1]: must be one of C0 to C3 and G0 to G3, got 7"),
        (CHAIN | {"orders": 3}, ", orders: must be one of C0 to C3 and G0 to G3, or a list of them, got 3"),
        (CHAIN | {"orders": ["G1", "G2"]}, ": an open chain of 2 pieces has 1 joints, got 2"),
        (CHAIN | {"orders": ["G1"], "closed": True}, ": a closed chain of 2 pieces has 2 joints, got 1"),
        (CHAIN | {"closed": 1}, ", closed: must be true or false, got 1"),
        (CHAIN | {"construction": "yes"}, ", construction: must be true or false, got 'yes'"),
        (
            CHAIN | {"pieces": ["line", "lime"]},
            ", pieces[1]: there is no shape of the name 'lime'; did you mean 'line'?",
        ),
        (CHAIN | {"pieces": ["chain"]}, ", pieces[0]: a shape cannot be made of itself: 'chain' -> 'chain'"),
        (CHAIN | {"pieces": ["roof", "line"]}, ": pieces[0] must be a curve, 'roof' is a surface"),
        (CHAIN | {"pieces": ["line", "hoop"]}, ": pieces[1] must be a curve, 'hoop' is a chain"),
        (
            CHAIN | {"pieces": [FIRST | {"gamma": [2, 0]}]},
            ", pieces[0].gamma[0]: must lie in [-1, 1], got 2",
        ),
        (
            CHAIN | {"pieces": ["line", {"control_points": [[0, 0]]}]},
            ", pieces[1].control_points: must have at least 3 points (degree 2 of the family GT), got 1",
        ),
        (CHAIN | {"pieces": [FIRST | {"weight": 1}]}, ", pieces[0].weight: is not a field of this format"),
        (CHAIN | {"fixed": 7}, ", fixed: must be a list of pairs [piece, control point], got 7"),
        (CHAIN | {"fixed": [[0]]}, ", fixed[0]: must be a pair of whole numbers from 0, got a list of 1"),
        (CHAIN | {"fixed": [[0, 1], [0, -1]]}, ", fixed[1]: must be a pair of whole numbers from 0, got a list of 2"),
        (CHAIN | {"fixed": [[0, True]]}, ", fixed[0]: must be a pair of whole numbers from 0, got a list of 2"),
        (CHAIN | {"fixed": [[0, 9]]}, ": fixed: there is no control point 9 of piece 0, its last is 3"),
        (CHAIN | {"fixed": [[2, 0]]}, ": fixed: there is no piece 2, the last one is 1"),
        (
            CHAIN | {"pieces": ["line"], "orders": [], "fixed": [[0, 2]]},
            ": fixed: there is no control point 2 of piece 0, its last is 1",
        ),
        (
            CHAIN | {"pieces": [FIRST | {"range": [0, 0.5]}, SECOND]},
            ": joint 0 must be G1, it is a gap of 2.01; only pieces without a range have control points that can be"
            " moved",
        ),
        (
            CHAIN | {"pieces": [FIRST, {"control_points": [[3, 2, 0], [4, 1, 0], [5, 0, 0]]}]},
            ": all pieces must have one dimension, got [2, 3]",
        ),
        (
            CHAIN | {"orders": "G3", "pieces": [FIRST, {"control_points": [[3, 2], [4, 1], [5, 0]]}]},
            ": joint 0, piece 1: degree 2 has too few control points for order 3",
        ),
        (
            CHAIN | {"orders": "C2", "pieces": [FIRST, SECOND | {"gamma": [-1, 1]}]},
            ": joint 0, piece 1: degree 3 with gamma = (-1.0, 1.0) leaves control point 2 undetermined: no join of"
            " order 2 can start this curve",
        ),
        (CIRCLE | {"radius": 0}, ", radius: must be above 0, got 0"),
        (CIRCLE | {"radius": "1"}, ", radius: must be a number, got '1'"),
        (CIRCLE | {"radius": None}, ", radius: must be a number, got null"),
        (CIRCLE | {"center": [0]}, ", center: must have 2 or 3 coordinates, got 1"),
        (CIRCLE | {"center": 3}, ", center: must be a point, a list of 2 or 3 numbers, got 3"),
        (CIRCLE | {"angles": [0, 1]}, ", angles: is not a field of this format"),
        (
            CIRCLE | {"normal": [0, 0, 1]},
            ": normal is for a center in space; the center has two coordinates, got [0.0, 0.0, 1.0]",
        ),
        (SPATIAL | {"normal": [0, 1]}, ", normal: must have 3 coordinates, got 2"),
        (SPATIAL | {"normal": [0, 0, 0]}, ": normal must be three numbers, not all 0, got [0.0, 0.0, 0.0]"),
        (
            ELLIPSE | {"axis_b": [4, 0]},
            ": axis_a and axis_b must not be zero or parallel, got [2.0, 0.0] and [4.0, 0.0]",
        ),
        (ELLIPSE | {"axis_b": [4, 0, 0]}, ": axis_b must have 2 coordinates like the others, got [4.0, 0.0, 0.0]"),
        (ARC | {"axis_a": [1, 0]}, ": an arc has a radius, or axis_a and axis_b, not both"),
        (ARC | {"radius": None}, ": an arc has a radius and perhaps a normal, or axis_a and axis_b"),
        (ARC | {"angles": [0]}, ", angles: must be two angles in degrees in [-1000000.0, 1000000.0], got a list of 1"),
        (ARC | {"angles": [0, 1e9]}, ", angles[1]: must lie in [-1000000.0, 1000000.0], got 1000000000.0"),
        (ARC | {"angles": [0, 361]}, ", angles: must be 1e-07 to 360 degrees apart, got 0 and 361"),
        (AXES, ", angles: is missing"),
        (
            AXES | {"angles": [0, 9], "normal": [0, 0, 1]},
            ": an arc has a radius and perhaps a normal, or axis_a and axis_b",
        ),
        (PARABOLA | {"control_points": [[0, 0], [1, 1]]}, ", control_points: must be three points, got a list of 2"),
        (PARABOLA | {"control_points": "flat"}, ", control_points: must be three points, got 'flat'"),
        (
            PARABOLA | {"control_points": [[0, 0], [1, 1], [2, 2]]},
            ": three points that are not on one line are needed, got p0 = [0.0, 0.0], p1 = [1.0, 1.0], p2 = [2.0, 2.0]",
        ),
        (PARABOLA | {"gamma": [0, 0]}, ", gamma: is not a field of this format"),
    ],
)
def test_a_wrong_field_is_named_with_what_was_given_and_what_is_allowed(
    tmp_path: Path, shape: dict[str, Any], expected: str
) -> None:
    with pytest.raises(ModelError) as caught:
        loaded(tmp_path, LINE, ROOF, CIRCLE | {"name": "hoop"}, shape)
    assert caught.value.problems == (f"shape {shape['name']!r} (no. 4){expected}",)


def test_conditions_that_contradict_each_other_are_named(tmp_path: Path) -> None:
    everything = [[piece, k] for piece in (0, 1) for k in range(4)]
    with pytest.raises(ModelError, match=r"'chain'.*the joints cannot all be met: a condition is missed by"):
        loaded(tmp_path, CHAIN | {"fixed": everything})


def test_references_in_a_circle_and_to_what_is_wrong_itself(tmp_path: Path) -> None:
    other = CHAIN | {"name": "other", "pieces": ["chain"], "orders": []}
    with pytest.raises(ModelError) as caught:
        loaded(tmp_path, CHAIN | {"pieces": ["other"], "orders": []}, other)
    assert caught.value.problems == (
        "shape 'other' (no. 2), pieces[0]: a shape cannot be made of itself: 'chain' -> 'other' -> 'chain'",
    )
    with pytest.raises(ModelError) as caught:
        loaded(tmp_path, CHAIN | {"pieces": ["dish"], "orders": []}, PARABOLA | {"control_points": [[0, 0]] * 3})
    assert [problem.split(":")[0] for problem in caught.value.problems] == ["shape 'dish' (no. 2)"]


def test_what_a_model_file_cannot_hold_is_refused() -> None:
    corner = Composite((Curve([[0, 0], [1, 0]], family=BERNSTEIN), Curve([[1, 0], [2, 1]], family=BERNSTEIN)), ("G1",))
    with pytest.raises(InputError, match="shape 'x': joint 0 must be G1, it is C0: solve the chain first"):
        Model({"x": corner})
    strange = Composite((hyperbola([0, 0], [1, 0], [0, 1], -1, 2),), ())
    with pytest.raises(InputError, match="shape 'x': a model file cannot hold"):
        Model({"x": strange})


def test_points_that_meet_in_the_file_meet_in_millimetres() -> None:
    """A gap that counts as none in the file's unit could be one in mm."""

    def broken(gap: float) -> Composite:
        second = Curve([[1 + gap, 0], [2, 1]], family=BERNSTEIN)
        return Composite((Curve([[0, 0], [1, 0]], family=BERNSTEIN), second), ("C0",))

    assert broken(5e-8).unmet() == ""
    with pytest.raises(InputError, match="joint 0 must be C0"):
        Model({"x": broken(5e-8)}, "ft")
    (chain,) = Model({"x": broken(5e-11)}, "ft").in_millimetres().values()
    assert isinstance(chain, Composite)
    assert chain.unmet() == ""


def plainer(content: Any) -> Any:
    """A schema in the keywords that the tests of model files know; "exclusiveMinimum" is looked at by itself."""
    if isinstance(content, dict):
        if content.get("type") == "boolean":
            content = {key: value for key, value in content.items() if key != "type"} | {"enum": [True, False]}
        return {key: plainer(value) for key, value in content.items() if key != "exclusiveMinimum"}
    return [plainer(value) for value in content] if isinstance(content, list) else content


@pytest.fixture
def schema(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    content: dict[str, Any] = plainer(test_model.SCHEMA)
    monkeypatch.setattr(test_model, "SCHEMA", content)
    return content


def test_the_schema_holds_for_what_is_written_and_for_what_may_be_written(schema: dict[str, Any]) -> None:
    assert test_model.valid_by_schema(Model(shapes()).document(), schema)
    for shape in (CHAIN, CHAIN | {"pieces": ["a", FIRST], "orders": ["C1"], "fixed": [[0, 1]]}, SPATIAL, ARC, PARABOLA):
        assert test_model.valid_by_schema({"gtcad": 1, "shape": [shape]}, schema)


@pytest.mark.parametrize(
    "shape",
    [
        CHAIN | {"orders": "G4"},
        CHAIN | {"orders": ["G1", "g2"]},
        CHAIN | {"pieces": []},
        CHAIN | {"pieces": [7]},
        CHAIN | {"pieces": [FIRST | {"gamma": [2, 0]}]},
        CHAIN | {"fixed": [[0, -1]]},
        CHAIN | {"fixed": [[0, 1, 2]]},
        CHAIN | {"closed": "no"},
        CIRCLE | {"center": [1]},
        SPATIAL | {"normal": [0, 1]},
        ARC | {"angles": [0, 1e7]},
        ARC | {"angles": [0]},
        PARABOLA | {"control_points": [[0, 0], [1, 1]]},
        {key: value for key, value in CHAIN.items() if key != "orders"},
    ],
)
def test_the_schema_refuses_what_the_reader_refuses(tmp_path: Path, schema: dict[str, Any], shape: Any) -> None:
    assert not test_model.valid_by_schema({"gtcad": 1, "shape": [shape]}, schema)
    with pytest.raises(ModelError):
        loaded(tmp_path, shape)


def test_the_schema_says_that_a_radius_is_above_0_and_describes_every_field() -> None:
    definitions = test_model.SCHEMA["$defs"]
    assert definitions["CircleEntry"]["properties"]["radius"]["exclusiveMinimum"] == 0
    assert definitions["ArcEntry"]["properties"]["radius"]["anyOf"][0]["exclusiveMinimum"] == 0
    for kind in ("Composite", "Circle", "Ellipse", "Arc", "Parabola"):
        entry = definitions[f"{kind}Entry"]
        assert entry["description"]
        assert all(name == "kind" or field["description"] for name, field in entry["properties"].items())
