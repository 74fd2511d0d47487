"""Developable patches in model files: round trips, units, the schema, every mistake named, and the way into files."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gtcad import BERNSTEIN, Curve, Restricted
from gtcad.converters.descriptions import describe_model
from gtcad.errors import InputError, ModelError
from gtcad.model import Model, schema
from gtcad.patches import (
    Developable,
    Enveloping,
    GeodesicDevelopable,
    PlaneFamily,
    QuasiDevelopable,
    Rotation,
    SpineDevelopable,
    quasi_developable,
)
from gtcad.protocol import SeparableSurface
from tests.model_files import loaded, sent_round
from tests.patches.developables import LOW, regular_patches
from tests.test_model import valid_by_schema

SCHEMA = schema()
GRID = np.linspace(0, 1, 9)
TILT = np.array([[1.0, 0.2, 0.0, 5.0], [0.0, 1.0, 0.3, -1.0], [0.1, 0.0, 2.0, 1 / 3]])
SPINE = Curve([[0, 0, 0], [10, 20, 5], [20, 25, 20], [30, 10, 25], [40, 0, 10]], (0.2, -0.3))
PLANES = [[1, 0, 0.3, 20], [1, 1, 0.2, 30], [0, 1, 0.3, 20]]

CURVE: dict[str, Any] = {"name": "curve", "kind": "curve", "control_points": SPINE.control_points.tolist()}
RING: dict[str, Any] = {"name": "ring", "kind": "circle", "center": [0, 0, 0], "radius": 3}
ENVELOPING: dict[str, Any] = {
    "name": "x",
    "kind": "enveloping",
    "control_planes": PLANES,
    "bound_a": [0, 0, 1, 0],
    "bound_b": [0, 0.1, 1, 20],
}
TANGENT: dict[str, Any] = {"name": "x", "kind": "spine-developable", "spine": "curve", "distances": [5, 20]}
GEODESIC: dict[str, Any] = {"name": "x", "kind": "geodesic-developable", "curve": "curve", "distances": [-1, 2]}
QUASI: dict[str, Any] = {
    "name": "x",
    "kind": "quasi-developable",
    "a": "curve",
    "b": {"control_points": [[0, 0, 30], [20, 30, 35], [40, 0, 30]]},
}


@cache
def patches() -> dict[str, SeparableSurface]:
    """One of every kind and with every field at a value of its own."""
    regular, other = regular_patches(2)
    rail = Restricted(Curve([[40, 10, 30], [30, 40, 35], [-10, 50, 30]]), (0.0, 1 / 3))
    classical = PlaneFamily(PLANES, family=BERNSTEIN)
    top = Curve([[0, 0, 30], [20, 30, 35], [40, 0, 30]], (0.1, 0.2))
    return {
        "enveloping": regular,
        "part": other.family.enveloping(LOW, rail, (0.75, 1 / 3)),
        "classical": Enveloping(classical, [0, 0, 1, 0], [0, 0.1, 1, 20], placement=TILT),
        "tangent": SpineDevelopable(SPINE, (5, 20), TILT),
        "regression": SpineDevelopable(PlaneFamily([*PLANES, [-0.5, 1, 0.5, 25]], (0.3, 1 / 3)), (-5, -20)),
        "geodesic": GeodesicDevelopable(Restricted(SPINE, (1.0, 0.1)), (-1 / 3, 2)),
        "placed geodesic": GeodesicDevelopable(SPINE, (-1 / 3, 2), TILT),
        "strip": QuasiDevelopable(SPINE, top, (0, 0.3, 0.7, 1), 89.0),
        "plain strip": QuasiDevelopable(SPINE, top),
        "searched strip": quasi_developable(SPINE, top, pairing="least-twist"),
    }


@pytest.mark.parametrize("suffix", [".json", ".toml"])
def test_reading_what_was_written_gives_the_same_patches_bit_for_bit(tmp_path: Path, suffix: str) -> None:
    model = Model(patches(), "in", {"tangent": "#102030"}, frozenset({"part"}))
    data = sent_round(model, tmp_path / f"m{suffix}")
    kinds = [entry["kind"] for entry in data["shape"]]
    assert kinds == [
        *["enveloping"] * 3,
        *["spine-developable"] * 2,
        *["geodesic-developable"] * 2,
        *["quasi-developable"] * 3,
    ]
    assert valid_by_schema(data, SCHEMA)


@pytest.mark.parametrize(("unit", "factor"), [("mm", 1), ("cm", 10), ("in", 25.4)])
def test_lengths_become_millimetres(unit: str, factor: float) -> None:
    for name, patch in Model(patches(), unit).in_millimetres().items():
        given = patches()[name]
        wanted = factor * given.evaluate(GRID[:, None], GRID[None, :])
        error = given.definition_error * factor + (patch.definition_error if isinstance(patch, Developable) else 0)
        allowed = error + 1e-11 * np.abs(wanted).max()
        assert np.abs(patch.evaluate(GRID[:, None], GRID[None, :]) - wanted).max() <= allowed, name


def test_the_kinds_are_what_they_say(tmp_path: Path) -> None:
    model = loaded(
        tmp_path,
        CURVE | {"construction": True},
        ENVELOPING | {"name": "walls", "gamma": [0.2, 0.1], "part": [0.1, 1]},
        ENVELOPING | {"name": "rail", "bound_b": "curve", "bound_a": [0, 0, 1, -20]},
        ENVELOPING | {"name": "foot", "bound_a": {"control_points": [[20, 0], [15, 15], [0, 20]]}},
        TANGENT | {"name": "tangent"},
        TANGENT | {"name": "edge", "spine": {"control_planes": PLANES, "family": "bernstein"}},
        GEODESIC | {"name": "geodesic"},
        QUASI | {"name": "quasi", "pairing": [0, 0.4, 1], "max_twist": 80},
        QUASI | {"name": "searched", "pairing": "least-twist"},
    )
    curve = Curve(SPINE.control_points)
    family = PlaneFamily(PLANES, (0.2, 0.1))
    assert model["walls"] == family.enveloping([0, 0, 1, 0], [0, 0.1, 1, 20], (0.1, 1.0))
    assert model["rail"].bound_b == curve
    assert model["foot"].bound_a.dimension == 3
    assert model["tangent"] == SpineDevelopable(curve, (5, 20))
    assert model["edge"] == SpineDevelopable(PlaneFamily(PLANES, family=BERNSTEIN), (5, 20))
    assert model["geodesic"] == GeodesicDevelopable(curve, (-1, 2))
    assert model["quasi"].pairing == (0, 0.4, 1)
    assert model["quasi"].max_twist_deg == 80
    assert len(model["searched"].pairing) == 7
    assert list(model.in_millimetres()) == [name for name in model if name != "curve"]


@pytest.mark.parametrize("shape", [ENVELOPING, TANGENT, QUASI], ids=["enveloping", "tangent", "quasi"])
def test_null_is_a_field_left_out(tmp_path: Path, shape: dict[str, Any]) -> None:
    field = "max_twist" if shape is QUASI else "placement"
    assert loaded(tmp_path, CURVE, shape | {field: None})["x"] == loaded(tmp_path, CURVE, shape)["x"]
    assert valid_by_schema({"gtcad": 1, "shape": [CURVE, shape | {field: None}]}, SCHEMA)


@pytest.mark.parametrize(
    ("shape", "expected"),
    [
        (ENVELOPING | {"bound_a": "ring"}, ": bound_a must be a single curve, 'ring' is a chain"),
        (ENVELOPING | {"bound_a": "curv"}, ", bound_a: there is no shape of the name 'curv'; did you mean 'curve'?"),
        (ENVELOPING | {"bound_a": 7}, ", bound_a: must be a plane [a, b, c, d], a curve or the name of one, got 7"),
        (ENVELOPING | {"bound_a": [0, 0, 1]}, ", bound_a: must be a plane [a, b, c, d], a x + b y + c z = d, got 3"),
        (ENVELOPING | {"bound_a": [0, 0, 0, 1]}, ", bound_a: must have a normal: a, b and c are all 0"),
        (ENVELOPING | {"bound_a": [0, 0, "1", 1]}, ", bound_a[2]: must be a number, got '1'"),
        (ENVELOPING | {"bound_a": {"control_points": 3}}, ", bound_a.control_points: must be a list of points"),
        (ENVELOPING | {"control_planes": 3}, ", control_planes: must be a list of planes"),
        (ENVELOPING | {"control_planes": PLANES[:2]}, ", control_planes: must hold 3 to 61 planes"),
        (ENVELOPING | {"control_planes": [*PLANES, [1, 2, 3]]}, ", control_planes[3]: must be a plane"),
        (ENVELOPING | {"control_planes": [*PLANES, [0, 0, 0, 3]]}, ", control_planes[3]: must have a normal"),
        (ENVELOPING | {"gamma": [0, 2]}, ", gamma[1]: must lie in [-1, 1], got 2"),
        (ENVELOPING | {"part": [0, 0]}, ", part: must be two different parameters"),
        (ENVELOPING | {"bound_c": [0, 0, 1, 1]}, ", bound_c: is not a field of this format; did you mean bound_"),
        (ENVELOPING | {"control_planes": [PLANES[0]] * 3}, ": a plane of the family does not turn at t = 0"),
        (ENVELOPING | {"bound_b": [1, 0, 0, 0]}, ": a ruling is parallel to the plane bound_b at t = "),
        (ENVELOPING | {"bound_b": [0, 0, 1, 900]}, ": the edge of regression meets the patch at t = 0"),
        ({key: value for key, value in ENVELOPING.items() if key != "bound_a"}, ", bound_a: is missing"),
        (TANGENT | {"distances": [1]}, ", distances: must be two distances along the rulings, got a list of 1"),
        (TANGENT | {"distances": [1, 1]}, ", distances: must be two different distances, got 1 twice"),
        (TANGENT | {"distances": [1, "2"]}, ", distances[1]: must be a number, got '2'"),
        (TANGENT | {"distances": [-1, 2]}, ": distances must be both above 0 or both below"),
        (TANGENT | {"spine": {"control_planes": [*PLANES, [1, 2, 3]]}}, ", spine.control_planes[3]: must be a plane"),
        (TANGENT | {"spine": 3}, ", spine: must be an object with the fields of a shape, got 3"),
        (TANGENT | {"spine": "x"}, ", spine: a shape cannot be made of itself"),
        (GEODESIC | {"curve": "ring"}, ": curve must be a single curve, 'ring' is a chain"),
        (GEODESIC | {"distances": [0, 900]}, ": the edge of regression meets the patch at t = "),
        (GEODESIC | {"curve": {"control_points": [[0, 0], [1, 1], [2, 2]]}}, ": the curvature of the curve vanishes"),
        (QUASI | {"pairing": "best"}, ", pairing: must be least-twist or a list of numbers"),
        (QUASI | {"pairing": [0, 0.7, 0.6, 1]}, ", pairing: must be 2 to 61 numbers that rise from 0 to 1"),
        (QUASI | {"pairing": [0, None, 1]}, ", pairing[1]: must be a number, got null"),
        (QUASI | {"pairing": []}, ", pairing: must be 2 to 61 numbers that rise from 0 to 1"),
        (QUASI | {"max_twist": -1}, ", max_twist: must not be negative, got -1"),
        (QUASI | {"max_twist": 1e-3}, ": the strip may twist by 0.001 degrees along a ruling, but does by"),
    ],
)
def test_a_wrong_field_is_named_with_what_was_given_and_what_is_allowed(
    tmp_path: Path, shape: dict[str, Any], expected: str
) -> None:
    with pytest.raises(ModelError) as caught:
        loaded(tmp_path, CURVE, RING, shape)
    (problem,) = caught.value.problems
    assert problem.startswith("shape 'x' (no. 3)")
    assert expected in problem


def test_patches_of_what_a_model_file_cannot_hold_are_refused() -> None:
    foreign = Rotation(SPINE, [0, 0, 0], [0, 0, 1]).isoparametric(u=0.3)
    for patch in (GeodesicDevelopable(foreign, (1, 2)), Restricted(regular_patches(1)[0], ((0, 1), (0, 0.5)))):
        with pytest.raises(InputError, match="shape 'x': a model file cannot hold"):
            Model({"x": patch}).document()


@pytest.mark.parametrize(
    "shape",
    [
        ENVELOPING | {"bound_a": 7},
        ENVELOPING | {"bound_a": [0, 0, 1]},
        ENVELOPING | {"control_planes": [[1, 2, 3]] * 3},
        ENVELOPING | {"gamma": [0, 2]},
        ENVELOPING | {"colour": "#ffffff"},
        TANGENT | {"distances": [1]},
        TANGENT | {"spine": 3},
        GEODESIC | {"curve": [0, 0, 1, 1]},
        QUASI | {"pairing": "best"},
        QUASI | {"max_twist": -1},
        {key: value for key, value in GEODESIC.items() if key != "curve"},
    ],
)
def test_the_schema_refuses_what_the_reader_refuses(tmp_path: Path, shape: dict[str, Any]) -> None:
    assert not valid_by_schema({"gtcad": 1, "shape": [CURVE, shape]}, SCHEMA)
    with pytest.raises(ModelError):
        loaded(tmp_path, CURVE, shape)


def test_the_schema_describes_every_field() -> None:
    for kind in ("Enveloping", "SpineDevelopable", "GeodesicDevelopable", "QuasiDevelopable"):
        entry = SCHEMA["$defs"][f"{kind}Entry"]
        assert entry["description"]
        assert all(name == "kind" or field["description"] for name, field in entry["properties"].items())


def test_models_are_described() -> None:
    shapes = {shape["name"]: shape for shape in describe_model(Model(patches()))["shapes"]}
    assert (shapes["classical"]["kind"], shapes["classical"]["families"]) == ("enveloping", ["bernstein"])
    assert (shapes["classical"]["degree"], shapes["classical"]["poles"]) == ([2], [3])
    assert (shapes["regression"]["kind"], shapes["regression"]["degree"]) == ("spine-developable", [3])
    assert shapes["geodesic"]["kind"] == "geodesic-developable"
    assert shapes["strip"]["kind"] == "quasi-developable"
