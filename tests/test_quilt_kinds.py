"""Quilts and solids in model files: round trips, units, seams, the schema, and every mistake named."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import gtcad
from gtcad import BERNSTEIN, Curve, Restricted, Surface
from gtcad.edge_check import check_edge
from gtcad.errors import InputError, ModelError
from gtcad.model import Model, schema
from gtcad.patches import Rotation
from gtcad.quilt import Quilt, SharedEdge, Use
from gtcad.solid import Solid
from tests.converters import bodies
from tests.model_files import loaded
from tests.test_model import valid_by_schema
from tests.test_patch_kinds import UNITS, patches

SCHEMA = schema()
AXIS = ([0, 0, 0], [0, 0, 1])

MERIDIAN: dict[str, Any] = {"control_points": [[3, 0, 0], [4, 0, 3], [2, 0, 6]]}
LINE: dict[str, Any] = {"name": "line", "kind": "curve", "control_points": [[3, 0, 0], [4, 0, 3], [2, 0, 6]]}
ROOF: dict[str, Any] = {
    "name": "roof",
    "kind": "surface",
    "control_points": [[[i, j, i * j] for j in range(3)] for i in range(3)],
}
TUBE: dict[str, Any] = {"name": "tube", "kind": "rotation", "profile": "line"}
INLINE: dict[str, Any] = {"name": "p", "kind": "rotation", "profile": MERIDIAN}
QUILT: dict[str, Any] = {"name": "x", "kind": "quilt", "patches": ["tube"]}
SOLID: dict[str, Any] = {"name": "x", "kind": "solid", "caps": "planar", "patches": ["tube"]}
OTHER: dict[str, Any] = {"name": "other", "kind": "quilt", "patches": ["roof"]}
EDGE: dict[str, Any] = {"first": "tube.v0", "second": "tube.v1"}


def sheet() -> list[Surface]:
    low, middle, high = ([[x, y, x * y / 3] for y in (0, 1, 2.5)] for x in (0, 1, 2))
    return [Surface([low, middle, high]), Surface([high, [[3, 1, 0.1], [3, 2, 0], [3, 3, 0]], [[4, 1, 0]] * 3])]


@cache
def shapes() -> dict[str, Any]:
    """Every field at a value of its own, every kind of patch spelled out."""
    left, right = sheet()
    pole = [replace(patch, start_deg=1 / 3) for patch in ball()]
    apart = Quilt.recognised(
        [left, right.transformed(np.eye(3), [1e-4, 0, 0])],
        stated=[SharedEdge(Use(0, "u1"), Use(1, "u0"), False)],
        gap=2e-4,
    )
    everything = {
        name: patch.transformed(np.eye(3), [100 * k, 0, 0])
        for k, (name, patch) in enumerate(patches().items())
        if patch.dimension == 3
    }
    return {
        "sheet": Quilt.recognised([left, right], names=["left one", "r.u1"], order="G2"),
        "turned": Quilt.recognised([left, Restricted(right, ((1, 0), (1, 0)))], order="C1"),
        "apart": apart,
        "loose": Quilt.recognised(list(everything.values()), names=list(everything)),
        "ball": Solid(Quilt.recognised(pole, names=["low", "high"], order={Use(0, "v0"): "C3"})),
        "pot": Solid(Quilt.recognised([bodies.barrel()]), "planar"),
        "wall": Solid(Quilt.recognised([bodies.barrel()]), thickness=-1 / 3),
        "hollow": Solid(Quilt.recognised([bodies.barrel()]), "planar", 0.25),
        "box": Solid(Quilt.recognised(bodies.box(variants=range(6)))),
    }


def ball(radius: float = 2.0) -> list[Rotation]:
    halves = [
        [[0, 0, -radius], [radius, 0, -radius], [radius, 0, 0]],
        [[radius, 0, 0], [radius, 0, radius], [0, 0, radius]],
    ]
    return [Rotation(Curve(half), *AXIS) for half in halves]


@pytest.mark.parametrize("suffix", [".json", ".toml"])
def test_reading_what_was_written_gives_the_same_shapes_bit_for_bit(tmp_path: Path, suffix: str) -> None:
    model = Model(shapes(), "cm", {"box": "#102030"}, frozenset({"pot"}))
    path = tmp_path / f"m{suffix}"
    gtcad.dump_model(model, path)
    back = gtcad.load_model(path)
    assert back == model
    for name, shape in model.items():
        quilt, found = (one.quilt if isinstance(one, Solid) else one for one in (shape, back[name]))
        assert type(back[name]) is type(shape)
        assert found.edges == quilt.edges
        assert found.names == quilt.names
        assert [p.coefficients.tobytes() for p in found.patches] == [p.coefficients.tobytes() for p in quilt.patches]
    assert (back["wall"].thickness, back["hollow"].caps, back["hollow"].thickness) == (-1 / 3, "planar", 0.25)
    assert valid_by_schema(model.document(), SCHEMA)


def test_quilts_differ_where_anything_of_them_does() -> None:
    """Or the round trip would show nothing."""
    left, right = sheet()
    one = Quilt.recognised([left, right])
    for other in (
        Quilt.recognised([left, right], order="G1"),
        Quilt.recognised([left, right], names=["a", "b"]),
        Quilt.recognised([left, right.transformed(np.eye(3), [0, 0, 1e-13])]),
        Quilt((left, right), one.names, ()),
    ):
        assert one != other
    ball = Quilt.recognised([bodies.sphere()])
    assert len({Solid(ball), Solid(ball, "planar"), Solid(ball, thickness=1.0)}) == 3


@pytest.mark.parametrize(("unit", "factor"), UNITS)
def test_lengths_become_millimetres(unit: str, factor: float) -> None:
    scaled = Model(shapes(), unit).in_millimetres()
    for name in ("ball", "pot", "box"):
        assert scaled[name].volume() == pytest.approx(factor**3 * shapes()[name].volume(), rel=1e-10)
    assert (scaled["wall"].thickness, scaled["hollow"].thickness) == pytest.approx((-factor / 3, factor / 4))
    assert scaled["apart"].gaps == pytest.approx(tuple(factor * gap for gap in shapes()["apart"].gaps))
    assert [quilt.edges for quilt in (scaled["sheet"], scaled["turned"])] == [
        quilt.edges for quilt in (shapes()["sheet"], shapes()["turned"])
    ]


def test_named_and_spelled_out_patches_make_the_same_quilt(tmp_path: Path) -> None:
    by_name = QUILT | {"name": "y", "patches": ["tube", "roof"]}
    inline = QUILT | {"patches": [INLINE | {"name": "tube"}, ROOF]}
    model = loaded(tmp_path, by_name, inline, TUBE, ROOF, LINE)
    assert model["x"] == model["y"]
    assert model["y"].names == ("tube", "roof")
    assert model["y"].patches[0] is model["tube"]


# --- seams ------------------------------------------------------------------------------------------------------------


def order(folder: Path, *shapes: Any, **fields: Any) -> list[str]:
    shape = loaded(folder, LINE, TUBE, *shapes, QUILT | fields)["x"]
    return [edge.order for edge in shape.edges]


def test_a_smooth_seam_is_smooth_unless_an_order_is_given(tmp_path: Path) -> None:
    assert order(tmp_path) == ["G2"]
    assert order(tmp_path, order="C0") == ["C0"]
    assert order(tmp_path, order="C3") == ["C3"]
    assert order(tmp_path, order=None) == ["G2"]
    assert order(tmp_path, edges=[EDGE]) == ["C0"]
    assert order(tmp_path, edges=[EDGE | {"order": "G1"}]) == ["G1"]
    halves = [INLINE | {"name": str(k), "angle": 180, "start": start} for k, start in enumerate((0, 180))]
    assert order(tmp_path, patches=halves) == ["C0", "C0"]


@pytest.mark.parametrize(
    ("loop", "expected"),
    [
        ([[3, 0, 0], [3, 3, 0], [-3, 2, 0], [3, 0, 0]], "C0"),  # a corner
        ([[3, 0, 0], [3, 3, 0], [-3, 2, 0], [3, -1, 0], [3, 0, 0]], "G1"),  # one tangent, at other speeds
    ],
)
def test_a_seam_with_a_kink_keeps_it(tmp_path: Path, loop: Any, expected: str) -> None:
    tube = {"name": "p", "kind": "cylinder", "curve": {"control_points": loop}, "vector": [0, 0, 5]}
    quilt = loaded(tmp_path, LINE, TUBE, QUILT | {"patches": [tube]})["x"]
    (edge,) = quilt.edges
    assert edge.order == expected
    report = check_edge(quilt.patches[0], edge.first.side, quilt.patches[0], edge.second.side)
    assert report.meets(expected)
    assert not report.meets("G2")


def test_two_seams_of_a_patch_are_two_matters(tmp_path: Path) -> None:
    hoop = {"kind": "swung", "name": "p"}  # a profile with a corner around a smooth trajectory
    corner = {"control_points": [[3, 0], [5, 0], [5, 2], [3, 0]], "family": "bernstein"}
    around = {"control_points": [[1, 0], [1, 1], [-1, 1], [-1, -1], [1, -1], [1, 0]]}
    quilt = loaded(tmp_path, QUILT | {"patches": [hoop | {"profile": corner, "trajectory": around}]})["x"]
    assert [(edge.first.side, edge.order) for edge in quilt.edges] == [("u0", "C0"), ("v0", "G2")]


# --- mistakes ---------------------------------------------------------------------------------------------------------

KINDS = (
    "surface, ruled, cylinder, cone, swept, swung, rotation, sweep, lofted, coons, plateau, tb_coons, "
    "enveloping, spine-developable, geodesic-developable, quasi-developable"
)


@pytest.mark.parametrize(
    ("shape", "expected"),
    [
        (QUILT | {"patches": []}, ", patches: must hold 1 at least, got 0"),
        (QUILT | {"patches": "tube"}, ", patches: must be a list of patches, got 'tube'"),
        (QUILT | {"patches": ["tub"]}, ", patches[0]: there is no shape of the name 'tub'; did you mean 'tube'?"),
        (QUILT | {"patches": ["tube", "line"]}, ": patches[1] must be a surface, 'line' is a curve"),
        (QUILT | {"patches": ["other"]}, ": patches[0] must be a surface, 'other' is a quilt"),
        (QUILT | {"patches": ["tube", "tube"]}, ": patches[1]: 'tube' is the name of patches[0] already"),
        (QUILT | {"patches": ["tube", INLINE | {"name": "tube"}]}, ": patches[1]: 'tube' is the name of patches[0]"),
        (QUILT | {"patches": ["x"]}, ", patches[0]: a shape cannot be made of itself: 'x' -> 'x'"),
        (QUILT | {"patches": [7]}, ", patches[0]: must be the name of a surface or an object with the fields of one"),
        (QUILT | {"patches": [{"name": "p"}]}, f", patches[0].kind: is missing; must be one of {KINDS}"),
        (QUILT | {"patches": [INLINE | {"kind": "quilt"}]}, f", patches[0].kind: must be one of {KINDS}, got 'quilt'"),
        (QUILT | {"patches": [INLINE | {"kind": ["x"]}]}, f", patches[0].kind: must be one of {KINDS}, got a list"),
        (QUILT | {"patches": [{"kind": "rotation", "profile": MERIDIAN}]}, ", patches[0].name: is missing"),
        (QUILT | {"patches": [INLINE | {"angle": 0}]}, ", patches[0].angle: must lie in [-360, 360] and not be 0"),
        (QUILT | {"patches": [INLINE | {"profil": 1}]}, ", patches[0].profil: is not a field of this format"),
        (QUILT | {"patches": [INLINE | {"profile": "roof"}]}, ": patches[0]: profile must be a single curve, 'roof'"),
        (QUILT | {"patches": [INLINE | {"profile": "nope"}]}, ", patches[0].profile: there is no shape of the name"),
        (QUILT | {"patches": [INLINE | {"profile": {"gamma": [0, 0]}}]}, ", patches[0].profile.control_points: is mis"),
        (QUILT | {"patches": [INLINE | {"axis_direction": [0, 0, 0]}]}, ": patches[0]: axis_direction must not be zer"),
        (QUILT | {"patches": [INLINE | {"color": "#aabbcc"}]}, ", patches[0].color: belongs to the whole shape"),
        (QUILT | {"patches": [ROOF | {"construction": True}]}, ", patches[0].construction: belongs to the whole"),
        (QUILT | {"caps": "planar"}, ", caps: is not a field of this format"),
        (QUILT | {"order": "c1"}, ", order: must be one of C0 to C3 and G0 to G3, got 'c1'"),
        (QUILT | {"order": ["C1"]}, ", order: must be one of C0 to C3 and G0 to G3, got a list of 1"),
        (QUILT | {"gap": -1}, ", gap: must not be negative, got -1"),
        (QUILT | {"gap": "wide"}, ", gap: must be a number, got 'wide'"),
        (QUILT | {"edges": EDGE}, ", edges: must be a list of edges, got an object"),
        (QUILT | {"edges": [{"first": "tube.v0"}]}, ", edges[0].second: is missing"),
        (QUILT | {"edges": [EDGE | {"second": "tube.w1"}]}, ", edges[0].second: must be a patch and a side, such as"),
        (QUILT | {"edges": [EDGE | {"second": "tube"}]}, ", edges[0].second: must be a patch and a side, such as"),
        (QUILT | {"edges": [EDGE | {"first": "tub.v0"}]}, ": edges[0].first: 'tub.v0' names no patch of this shape"),
        (QUILT | {"edges": [EDGE | {"order": "G4"}]}, ", edges[0].order: must be one of C0 to C3 and G0 to G3"),
        (QUILT | {"edges": [EDGE | {"oder": "G1"}]}, ", edges[0].oder: is not a field of this format; did you mean o"),
        (QUILT | {"edges": [EDGE | {"reversed": 1}]}, ", edges[0].reversed: must be true or false, got 1"),
        (QUILT | {"edges": [EDGE, EDGE]}, ": side tube.v0 is stated in two edges"),
        (
            QUILT | {"edges": [{"first": "tube.u0", "second": "tube.u1"}]},
            ": tube.u0 and tube.u1 are stated as one edge",
        ),
        (QUILT | {"edges": [EDGE | {"reversed": True}], "gap": 99}, "not orientable: their sides disagree at tube.v0"),
        (SOLID | {"caps": "none"}, ": the quilt must be closed, capped or thickened; these sides are free: tube.u0, "),
        (SOLID | {"caps": "round"}, ", caps: must be one of none, planar, got 'round'"),
        (SOLID | {"thickness": 0}, ": thickness must be a finite number other than 0, got 0"),
        (SOLID | {"thickness": "thin"}, ", thickness: must be a number, got 'thin'"),
        (SOLID | {"thicknes": 1}, ", thicknes: is not a field of this format; did you mean thickness?"),
    ],
)
def test_a_wrong_field_is_named_with_what_was_given_and_what_is_allowed(
    tmp_path: Path, shape: dict[str, Any], expected: str
) -> None:
    with pytest.raises(ModelError) as caught:
        loaded(tmp_path, LINE, ROOF, TUBE, OTHER, shape)
    (problem,) = caught.value.problems
    assert problem.startswith("shape 'x' (no. 5)")
    assert expected in problem


def test_a_message_does_not_list_hundreds_of_patches(tmp_path: Path) -> None:
    many = [INLINE | {"name": f"patch {k}", "start": k, "angle": 1} for k in range(12)]
    with pytest.raises(ModelError, match=r"which has 'patch 0', .*'patch 7' and 4 more$"):
        loaded(tmp_path, QUILT | {"patches": many, "edges": [EDGE]})


def test_references_in_a_circle(tmp_path: Path) -> None:
    with pytest.raises(ModelError) as caught:
        loaded(tmp_path, QUILT | {"patches": ["y"]}, SOLID | {"name": "y", "patches": ["x"]})
    assert caught.value.problems == (
        "shape 'y' (no. 2), patches[0]: a shape cannot be made of itself: 'x' -> 'y' -> 'x'",
    )


def test_patch_names_with_dots_are_told_from_sides(tmp_path: Path) -> None:
    patch = INLINE | {"name": "p.u0"}
    edge = {"first": "p.u0.v0", "second": "p.u0.v1", "order": "C2"}
    quilt = loaded(tmp_path, QUILT | {"patches": [patch], "edges": [edge]})["x"]
    assert quilt.edges == (SharedEdge(Use(0, "v0"), Use(0, "v1"), False, "C2"),)


def test_plane_patches_make_plane_quilts_but_no_solids(tmp_path: Path) -> None:
    square = [{"family": "bernstein", "control_points": ends} for ends in ([[0, 0], [1, 0]], [[0, 1], [1, 1]])]
    patch = {"name": "p", "kind": "ruled", "a": square[0], "b": square[1]}
    assert loaded(tmp_path, QUILT | {"patches": [patch]})["x"].dimension == 2
    with pytest.raises(ModelError, match="a solid needs patches in space, d = 3, got d = 2"):
        loaded(tmp_path, SOLID | {"patches": [patch]})


def test_what_a_model_file_cannot_hold_is_refused() -> None:
    for shape in (Quilt.recognised([bodies.sphere()]), Solid(Quilt.recognised([bodies.sphere()]))):
        with pytest.raises(InputError, match="shape 'x': a model file cannot hold"):
            Model({"x": shape})


@pytest.mark.parametrize(
    "shape",
    [
        QUILT | {"patches": []},
        QUILT | {"patches": [7]},
        QUILT | {"patches": [INLINE | {"kind": "quilt"}]},
        QUILT | {"patches": [INLINE | {"angle": 361}]},
        QUILT | {"order": "G4"},
        QUILT | {"gap": -1},
        QUILT | {"edges": [{"first": "tube.v0"}]},
        QUILT | {"edges": [EDGE | {"order": None}]},
        QUILT | {"caps": "planar"},
        SOLID | {"caps": "round"},
        SOLID | {"thickness": "thin"},
    ],
)
def test_the_schema_refuses_what_the_reader_refuses(tmp_path: Path, shape: dict[str, Any]) -> None:
    assert not valid_by_schema({"gtcad": 1, "shape": [LINE, TUBE, shape]}, SCHEMA)
    with pytest.raises(ModelError):
        loaded(tmp_path, LINE, TUBE, shape)


@pytest.mark.parametrize(
    "shape",
    [
        QUILT,
        QUILT | {"order": None, "gap": 0, "edges": [EDGE | {"order": "G2", "reversed": False}]},
        SOLID | {"thickness": None},
        SOLID | {"patches": [INLINE, "tube", ROOF]},
    ],
)
def test_the_schema_holds_for_what_may_be_written(shape: dict[str, Any]) -> None:
    assert valid_by_schema({"gtcad": 1, "shape": [LINE, TUBE, shape]}, SCHEMA)


def test_the_schema_describes_every_field() -> None:
    for kind in ("QuiltEntry", "SolidEntry", "EdgeFields"):
        entry = SCHEMA["$defs"][kind]
        assert entry["description"]
        assert all(name == "kind" or field["description"] for name, field in entry["properties"].items())


def test_classical_patches_need_no_gamma(tmp_path: Path) -> None:
    square = Surface([[[0, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, math.pi]]], family_u=BERNSTEIN, family_v=BERNSTEIN)
    straight = Rotation(Curve([[1, 0, 0], [1, 0, 1]], family=BERNSTEIN), *AXIS)
    model = Model({"x": Quilt.recognised([square, straight])})
    gtcad.dump_model(model, tmp_path / "m.toml")
    assert gtcad.load_model(tmp_path / "m.toml") == model
