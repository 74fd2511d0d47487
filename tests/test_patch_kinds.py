"""Patches made of curves in model files: round trips, units, the schema, and every mistake named."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gtcad import BERNSTEIN, GT, Curve, Restricted
from gtcad.errors import InputError, ModelError
from gtcad.model import Model, schema
from gtcad.patches import Coons, Lofted, Rotation, Ruled, Sweep, Swept, Swung, cone, cylinder
from gtcad.protocol import SeparableSurface
from tests.model_files import loaded, sent_round
from tests.test_model import valid_by_schema

SCHEMA = schema()
UNITS = [("mm", 1), ("cm", 10), ("in", 25.4)]
GRID = np.linspace(0, 1, 9)
TILT = np.array([[1.0, 0.2, 0.0, 5.0], [0.0, 1.0, 0.3, -1.0], [0.1, 0.0, 2.0, 1 / 3]])

LINE: dict[str, Any] = {"name": "line", "kind": "curve", "control_points": [[3, 0, 0], [3, 3, 0], [0, 3, 0]]}
PLANE: dict[str, Any] = {"name": "plane", "kind": "curve", "control_points": [[1, 0], [2, 2], [1, 3]]}
ROOF: dict[str, Any] = {
    "name": "roof",
    "kind": "surface",
    "control_points": [[[i, j, 0] for j in range(3)] for i in range(3)],
}
RING: dict[str, Any] = {"name": "ring", "kind": "circle", "center": [0, 0, 0], "radius": 3}
ROUND: dict[str, Any] = {"name": "x", "kind": "rotation", "profile": "line"}
SWEEP: dict[str, Any] = {"name": "x", "kind": "sweep", "profile": "plane", "spine": "line"}
LOFT: dict[str, Any] = {"name": "x", "kind": "lofted", "sections": ["line", "line", "line"]}
RULED: dict[str, Any] = {"name": "x", "kind": "ruled", "a": "line", "b": "line"}


def arc(z: float = 0.0, gamma: tuple[float, float] = (0.1, -1 / 3)) -> Curve:
    return Curve([[4, 0, z], [4, 1 / 3, z], [2, 4, z + 1], [0, 4, z]], gamma)


def line(a: Any, b: Any) -> Curve:
    return Curve([a, b], family=BERNSTEIN)


@cache
def patches() -> dict[str, SeparableSurface]:
    """One of every kind and with every field at a value of its own."""
    meridian = Curve([[3, 0, 0], [4.5, 0, 1 / 3], [2, 0, 6]], (0.25, 0.5))
    plane = Curve([[0.1, 0], [0.2, 0.4], [0.3, 0.1]], (-0.5, 1))
    bow = Curve([[0, 0, 0], [0, 0, 10], [10, 0, 20], [20, 10, 20]], (0.2, -0.2))
    loop = Curve([[5, 0, 0], [5, 5, 2], [-9, 5, 1], [1, -9, -2], [5, -5, -2], [5, 0, 0]])
    sections = [arc(z) for z in (0, 1, 2.5, 7)]
    return {
        "ruled": Ruled(arc(), Restricted(line([4, 0, 5], [0, 5, 6]), (1.0, 0.25))),
        "cylinder": cylinder(arc(), [0.1, 0.2, 1 / 3]),
        "cone": cone(arc(), [0.1, 0.2, 9], (0.1, 0.7)),
        "swept": Swept(arc(), meridian),
        "swung": Swung(plane, Curve([[1, 0], [1, 1], [0, 1]]), 1 / 3, TILT),
        "plain swung": Swung(plane, Curve([[1, 0], [1, 1], [0, 1]])),
        "rotation": Rotation(meridian, [0.1, 0.2, 0.3], [0.1, 0.2, 1], -123.4, 1 / 3, TILT),
        "plain rotation": Rotation(meridian, [0, 0, 0], [0, 0, 1]),
        "sweep": Sweep(plane, bow, frame="fixed", start_normal=[1, 0, 0.1], scale=(1, 0.5, 1 / 3), placement=TILT),
        "frenet": Sweep(plane, bow, frame="frenet", twist_deg=-12.5),
        "closed sweep": Sweep(plane, loop, closed=True),
        "lofted": Lofted(sections, [0, 0.2, 0.6, 1], (0.3, -0.1)),
        "classical loft": Lofted(sections, family_v=BERNSTEIN),
        "coons": Coons(
            line([0, 0, 0], [9, 0, 1 / 3]),
            Curve([[0, 9, 0], [4, 10, 5], [9, 9, 1]], (0.5, 0.5)),
            line([0, 0, 0], [0, 9, 0]),
            line([9, 0, 1 / 3], [9, 9, 1]),
        ),
        "plane coons": Coons(line([0, 0], [9, 0]), line([0, 9], [9, 9]), line([0, 0], [0, 9]), line([9, 0], [9, 9])),
    }


@pytest.mark.parametrize("suffix", [".json", ".toml"])
def test_reading_what_was_written_gives_the_same_patches_bit_for_bit(tmp_path: Path, suffix: str) -> None:
    model = Model(patches(), "in", {"coons": "#102030"}, frozenset({"swept"}))
    data = sent_round(model, tmp_path / f"m{suffix}")
    kinds = {entry["name"]: entry["kind"] for entry in data["shape"]}
    assert {name: kind for name, kind in kinds.items() if name.split()[-1] != kind} == {
        "cylinder": "ruled",
        "cone": "ruled",
        "frenet": "sweep",
        "classical loft": "lofted",
    }
    assert valid_by_schema(data, SCHEMA)


@pytest.mark.parametrize(("unit", "factor"), UNITS)
def test_lengths_become_millimetres(unit: str, factor: float) -> None:
    for name, patch in Model(patches(), unit).in_millimetres().items():
        given = patches()[name]
        scaled = patch.evaluate(GRID[:, None], GRID[None, :])
        wanted = factor * given.evaluate(GRID[:, None], GRID[None, :])
        assert np.abs(scaled - wanted).max() <= 1e-11 * np.abs(wanted).max(), name


def test_the_kinds_are_what_they_say(tmp_path: Path) -> None:
    model = loaded(
        tmp_path,
        LINE,
        PLANE,
        RULED | {"name": "ruled", "b": {"family": "bernstein", "control_points": [[3, 0, 9], [0, 3, 9]]}},
        {"name": "cylinder", "kind": "cylinder", "curve": "plane", "vector": [1, 2, 3]},
        {"name": "cone", "kind": "cone", "curve": "line", "apex": [1, 2, 9], "part": [0, 0.5]},
        {"name": "swept", "kind": "swept", "profile": "line", "trajectory": "line"},
        {"name": "swung", "kind": "swung", "profile": "plane", "trajectory": "plane", "factor": -2},
        ROUND | {"name": "rotation", "axis_point": [3, 0, 0], "axis_direction": [0, 2, 0], "angle": -90, "start": 180},
        SWEEP | {"name": "sweep", "frame": "fixed", "start_normal": [0, 0, 1], "scale": [2]},
        LOFT | {"name": "lofted", "parameters": [0, 0.25, 1], "gamma_v": [0.5, 0]},
    )
    u, v = GRID[:, None], GRID[None, :]
    along, flat, one = model["line"].evaluate(GRID)[:, None], model["plane"].evaluate(GRID)[:, None], v[..., None]
    assert model["ruled"].evaluate(GRID, 1) == pytest.approx((1 - u) * [3, 0, 9] + u * [0, 3, 9], abs=1e-12)
    assert model["cylinder"].evaluate(u, v) == pytest.approx(np.insert(flat, 2, 0, -1) + one * [1, 2, 3])
    assert model["cone"].evaluate(u, v) == pytest.approx((1 - one / 2) * along + one / 2 * [1, 2, 9])
    assert model["swept"].evaluate(u, v) == pytest.approx(along + model["line"].evaluate(GRID))
    (x, z), (across, up) = flat[:, 0].T[:, :, None], model["plane"].evaluate(GRID).T[:, None]
    swung = np.stack([-2 * x * across, -2 * x * up, z + 0 * up], -1)
    assert model["swung"].evaluate(u, v) == pytest.approx(swung)
    turn = np.radians(180 - 90 * one)
    out = along - [3, 0, 0]
    spun = np.concatenate(
        [3 + np.cos(turn) * out[..., :1], out[..., 1:2] + 0 * one, -np.sin(turn) * out[..., :1]], axis=-1
    )
    assert model["rotation"].evaluate(u, v) == pytest.approx(spun, abs=1e-12)
    x, y = 2 * flat[:, 0].T[:, :, None]
    tangent, normal = np.array([0, 1, 0]), np.array([0, 0, 1])
    carried = x[..., None] * normal + y[..., None] * np.cross(tangent, normal) + model["line"].evaluate(GRID)
    assert model["sweep"].evaluate(u, v) == pytest.approx(carried, abs=1e-12)
    assert model["lofted"].family_v is GT
    assert model["lofted"].evaluate(GRID, 0.25) == pytest.approx(along[:, 0], abs=1e-12)


def test_named_curves_may_follow_and_serve_several_patches(tmp_path: Path) -> None:
    model = loaded(tmp_path, ROUND, LOFT | {"name": "y"}, LINE | {"construction": True})
    assert list(model) == ["x", "y", "line"]
    assert model["x"].profile == model["y"].sections[2] == model["line"]
    assert list(model.in_millimetres()) == ["x", "y"]


@pytest.mark.parametrize(
    ("shape", "expected"),
    [
        (RULED | {"a": "roof"}, ": a must be a single curve, 'roof' is a surface"),
        (RULED | {"b": "ring"}, ": b must be a single curve, 'ring' is a chain"),
        (RULED | {"b": "lime"}, ", b: there is no shape of the name 'lime'; did you mean 'line'?"),
        (RULED | {"b": 7}, ", b: must be an object with the fields of a shape, got 7"),
        (RULED | {"b": "plane"}, ": a and b must have one dimension, got [3, 2]"),
        (RULED | {"b": {"control_points": [[0, "0"], [1, 1], [2, 2]]}}, ", b.control_points[0][1]: must be a number"),
        (RULED | {"b": "x"}, ", b: a shape cannot be made of itself: 'x' -> 'x'"),
        ({"name": "x", "kind": "ruled", "a": "line"}, ", b: is missing"),
        ({"name": "x", "kind": "cylinder", "curve": "line", "vector": [0, 0, 0]}, ": vector must not be zero"),
        ({"name": "x", "kind": "cylinder", "curve": "line", "vector": [0, 1]}, ", vector: must have 3 coordinates"),
        ({"name": "x", "kind": "cone", "curve": "line", "apex": [0, 0, 1], "part": [0, 2]}, ", part[1]: must lie in"),
        ({"name": "x", "kind": "swung", "profile": "line", "trajectory": "plane"}, ": profile must lie in the xz"),
        ({"name": "x", "kind": "swung", "profile": "plane", "trajectory": "plane", "factor": 0}, ": factor must not"),
        (ROUND | {"angle": 0}, ", angle: must lie in [-360, 360] and not be 0, got 0"),
        (ROUND | {"angle": 360.5}, ", angle: must lie in [-360, 360] and not be 0, got 360.5"),
        (ROUND | {"angle": "90"}, ", angle: must be a number, got '90'"),
        (ROUND | {"start": None}, ", start: must be a number, got null"),
        (ROUND | {"axis_direction": [0, 0, 0]}, ": axis_direction must not be zero, got"),
        (ROUND | {"axis_dir": [0, 0, 1]}, ", axis_dir: is not a field of this format; did you mean axis_direction?"),
        (ROUND | {"placement": [[1, 0, 0, 0]]}, ", placement: must be three rows of four numbers, got a list of 1"),
        (ROUND | {"placement": [[1, 0, 0, 0]] * 2 + [[0, 0, 1]]}, ", placement[2]: must be a row of four numbers"),
        (ROUND | {"placement": [[1, 0, 0, 0]] * 2 + [[0, 0, 1, "a"]]}, ", placement[2][3]: must be a number, got 'a'"),
        (SWEEP | {"frame": "Frenet"}, ", frame: must be one of rotation-minimising, frenet, fixed, got 'Frenet'"),
        (SWEEP | {"scale": []}, ", scale: must hold 1 at least, got 0"),
        (SWEEP | {"scale": 2}, ", scale: must be a list of numbers, got 2"),
        (SWEEP | {"scale": [1, None]}, ", scale[1]: must be a number, got null"),
        (SWEEP | {"scale": [1, -1]}, ": scale must not be negative"),
        (SWEEP | {"closed": True}, ": spine must close with one tangent"),
        (SWEEP | {"closed": "no"}, ", closed: must be true or false, got 'no'"),
        (SWEEP | {"frame": "frenet", "start_normal": [0, 0, 1]}, ": start_normal must be None: the Frenet frame has"),
        (LOFT | {"sections": ["line"]}, ", sections: must hold 2 at least, got 1"),
        (LOFT | {"sections": ["line", "line"]}, ": sections must be at least 3 for the family GT, got 2"),
        (LOFT | {"sections": "line"}, ", sections: must be a list of sections, got 'line'"),
        (LOFT | {"sections": ["line", "roof", "line"]}, ": sections[1] must be a single curve, 'roof' is a surface"),
        (LOFT | {"sections": ["line", "nope", "line"]}, ", sections[1]: there is no shape of the name 'nope'"),
        (LOFT | {"sections": ["line", "line", "plane"]}, "must have one dimension, got [3, 3, 2]"),
        (LOFT | {"parameters": [0, 1]}, ": parameters must be one number for each of 3 sections"),
        (LOFT | {"parameters": [0, 0, 1]}, ": parameters must increase within [0, 1]"),
        (LOFT | {"family_v": "bernstein", "gamma_v": [0, 0]}, ", gamma_v: the family bernstein takes no design"),
        (
            {"name": "x", "kind": "coons", "c0": "line", "c1": "line", "d0": "line", "d1": "line"},
            ": corner u = 0, v = 1: the start of c1",
        ),
    ],
)
def test_a_wrong_field_is_named_with_what_was_given_and_what_is_allowed(
    tmp_path: Path, shape: dict[str, Any], expected: str
) -> None:
    with pytest.raises(ModelError) as caught:
        loaded(tmp_path, LINE, PLANE, ROOF, RING, shape)
    (problem,) = caught.value.problems
    assert problem.startswith("shape 'x' (no. 5)")
    assert expected in problem


def test_patches_of_what_a_model_file_cannot_hold_are_refused() -> None:
    whole = Rotation(arc(), [0, 0, 0], [0, 0, 1])
    for patch in (Restricted(whole, ((0, 1), (0, 0.5))), Swept(whole.boundary("u0"), arc())):
        with pytest.raises(InputError, match="shape 'x': a model file cannot hold"):
            Model({"x": patch})


@pytest.mark.parametrize(
    "shape",
    [
        RULED | {"a": 7},
        RULED | {"a": {"control_points": []}},
        {"name": "x", "kind": "cylinder", "curve": "line", "vector": [0, 1]},
        {"name": "x", "kind": "cone", "curve": "line", "apex": [0, 0, 1], "part": [0, 2]},
        ROUND | {"angle": 400},
        ROUND | {"placement": [[1, 0, 0, 0]]},
        ROUND | {"axis": [0, 0, 1]},
        SWEEP | {"frame": "Frenet"},
        SWEEP | {"scale": []},
        SWEEP | {"start_normal": [1, 0]},
        LOFT | {"sections": ["line"]},
        LOFT | {"gamma_v": [0, 2]},
        {key: value for key, value in ROUND.items() if key != "profile"},
    ],
)
def test_the_schema_refuses_what_the_reader_refuses(tmp_path: Path, shape: dict[str, Any]) -> None:
    assert not valid_by_schema({"gtcad": 1, "shape": [LINE, PLANE, shape]}, SCHEMA)
    with pytest.raises(ModelError):
        loaded(tmp_path, LINE, PLANE, shape)


def test_the_schema_describes_every_field() -> None:
    for kind in ("Ruled", "Cylinder", "Cone", "Swept", "Swung", "Rotation", "Sweep", "Lofted", "Coons"):
        entry = SCHEMA["$defs"][f"{kind}Entry"]
        assert entry["description"]
        assert all(name == "kind" or field["description"] for name, field in entry["properties"].items())
