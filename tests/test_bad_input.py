"""Every bad input tried, what it gets, and docs/bad-input.md, which is written from the same list.

``python -m tests.test_bad_input`` writes the page anew.
"""

from __future__ import annotations

import contextlib
import json
import re
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

import gtcad
from gtcad import cli

PAGE = Path(__file__).parent.parent / "docs" / "bad-input.md"
MOST_LINES = 3
MEASURED = re.compile(r"\b\d\.\d+e[-+]\d+")  # figures that a better proof would change
PARSER = "the parser's usage message"

CURVE: dict[str, Any] = {"name": "arch", "kind": "curve", "control_points": [[0, 0], [1, 2], [2, 0]]}
SURFACE: dict[str, Any] = {
    "name": "roof",
    "kind": "surface",
    "control_points": [[[i, j, i * j] for j in range(3)] for i in range(3)],
}
NEXT = CURVE | {"name": "next", "control_points": [[2, 0], [3, -1], [4, 0]]}
CHAIN: dict[str, Any] = {"name": "rail", "kind": "composite", "orders": "G1", "pieces": ["arch", "next"]}
CIRCLE: dict[str, Any] = {"name": "ring", "kind": "circle", "center": [0, 0, 5], "radius": 30}
ELLIPSE: dict[str, Any] = {"name": "oval", "kind": "ellipse", "center": [0, 0], "axis_a": [3, 0], "axis_b": [0, 1]}
ARC: dict[str, Any] = {"name": "bow", "kind": "arc", "center": [0, 0], "radius": 12, "angles": [0, 90]}
PARABOLA: dict[str, Any] = {"name": "vault", "kind": "parabola", "control_points": [[0, 0], [1, 2], [2, 0]]}
SPACE: dict[str, Any] = {"control_points": [[30, 0, 0], [45, 0, 30], [25, 0, 90]]}
TUBE: dict[str, Any] = {"name": "tube", "kind": "rotation", "profile": SPACE}
POT: dict[str, Any] = {"name": "pot", "kind": "solid", "caps": "planar", "patches": ["tube"]}
SKIN: dict[str, Any] = {"name": "skin", "kind": "quilt", "patches": ["tube"]}
NEXT_PART = {"range": [0, 0.5], "control_points": NEXT["control_points"]}
NEXT_FREE = {"gamma": [-1, 0], "control_points": [[2, 0], [3, 1], [4, 0]]}
EXPORT = ["export", "model.json", "-o", "out.step", "--tolerance", "1e-4"]
CHECK = ["check", "out.step", "--against", "model.json", "--tolerance", "1e-4"]


@dataclass(frozen=True)
class Case:
    """An input, the command it is given to, and the code that the command must end with.

    Parameters
    ----------
    what
        The input in words.
    arguments
        Of the command.
    code
        The exit code.
    files
        Name and content of the files that lie in the current folder.
    names
        Where the message is the command-line parser's own: what it must name.
    """

    what: str
    arguments: list[str]
    code: int
    files: Mapping[str, bytes] = field(default_factory=dict)
    names: str = ""


def model(*shapes: Mapping[str, Any], **head: Any) -> dict[str, bytes]:
    return {"model.json": json.dumps({"gtcad": 1, "shape": list(shapes)} | head).encode()}


def wrong_model(what: str, *shapes: Mapping[str, Any], **head: Any) -> Case:
    return Case(what, EXPORT, 3, model(*shapes, **head))


def wrong_chain(what: str, *others: Mapping[str, Any], **fields: Any) -> Case:
    return wrong_model(what, CURVE, NEXT, *others, CHAIN | fields)


def wrong_text(what: str, content: bytes, name: str = "model.json") -> Case:
    return Case(what, ["info", name], 3, {name: content})


def wrong_option(what: str, *arguments: str, names: str = "") -> Case:
    return Case(what, list(arguments), 2, model(CURVE), names)


TOML = b'gtcad = 1\n[[shape]]\nname = "arch"\nkind = "curve"\ncontrol_points = [[0, 0], [1, 2], [2, 0]]\n'

GROUPS: dict[str, list[Case]] = {
    "Model files: text": [
        wrong_text("an empty file", b""),
        wrong_text("blanks only", b" \n\t\n", "model.toml"),
        wrong_text("binary", b"\x89PNG\r\n\x1a\n\x00\x00"),
        wrong_text("UTF-16, as Windows tools write it", '{"gtcad": 1}'.encode("utf-16")),
        wrong_text("JSON cut off", b'{"gtcad": 1,\n "shape": [{"name"'),
        wrong_text("TOML without quotes", b"gtcad = 1\nunit = mm\n", "model.toml"),
        wrong_text("a table given twice in TOML", b"gtcad = 1\ngtcad = 1\n", "model.toml"),
        wrong_text("a list instead of an object", b"[1, 2, 3]"),
        wrong_text("JSON in a .toml file", b'{"gtcad": 1}', "model.toml"),
        wrong_text("200000 brackets", b"[" * 200_000),
        wrong_text("200000 brackets in TOML", b"gtcad = " + b"[" * 200_000, "model.toml"),
        wrong_text("an integer of 5000 digits", b'{"gtcad": ' + b"9" * 5000 + b"}"),
        wrong_text("a hexadecimal integer of 5000 digits", b"gtcad = 0x" + b"f" * 5000 + b"\nshape = []", "model.toml"),
        wrong_text("a field given twice", b'{"gtcad": 1, "unit": "mm", "unit": "in", "shape": []}'),
    ],
    "Model files: head": [
        wrong_text("no fields at all", b"{}"),
        wrong_model("another version", CURVE, gtcad=2),
        wrong_model("true as the version", CURVE, gtcad=True),
        wrong_model("an unknown unit", CURVE, unit="km"),
        wrong_model("an unknown field", CURVE, units="mm"),
        wrong_model("no shapes"),
        wrong_model("shapes by name instead of a list", shape={"arch": CURVE}),
        wrong_model("a number among the shapes", CURVE, shape=[7]),
    ],
    "Model files: shapes": [
        wrong_model("no kind", {"name": "arch"}),
        wrong_model("an unknown kind", CURVE | {"kind": "spiral"}),
        wrong_model("no control points", {"name": "arch", "kind": "curve"}),
        wrong_model("an unknown field", CURVE | {"gama": [0, 0]}),
        wrong_model("a field of another kind", CURVE | {"gamma_u": [0, 0]}),
        wrong_model("no name", {key: value for key, value in CURVE.items() if key != "name"}),
        wrong_model("an empty name", CURVE | {"name": ""}),
        wrong_model("a number as the name", CURVE | {"name": 5}),
        wrong_model("a name that clears the screen", CURVE | {"name": "\x1b[2J"}),
        wrong_model("half a character as the name", CURVE | {"name": "\ud800"}),
        wrong_model("a name of 300 characters", CURVE | {"name": "n" * 300}),
        wrong_model("one name for two shapes", CURVE, SURFACE | {"name": "arch"}),
        wrong_model("a colour by name", CURVE | {"color": "red"}),
        wrong_model("gamma out of range", CURVE | {"gamma": [0, 1.25]}),
        wrong_model("gamma not a number", SURFACE | {"gamma_v": [float("nan"), 0]}),
        wrong_model("three design variables", CURVE | {"gamma": [0, 0, 0]}),
        wrong_model("design variables of a Bezier curve", CURVE | {"family": "bernstein", "gamma": [0, 0]}),
        wrong_model("an unknown family", CURVE | {"family": "bezier"}),
        wrong_model("an empty range", CURVE | {"range": [0.5, 0.5]}),
        wrong_model("a range beyond the domain", CURVE | {"range": [0, 1.5]}),
        wrong_model("a curve's range on a surface", SURFACE | {"range": [0, 1]}),
    ],
    "Model files: control points": [
        wrong_model("too few for the least degree", CURVE | {"control_points": [[0, 0], [1, 1]]}),
        wrong_model("too many for the highest degree", CURVE | {"control_points": [[i, 0] for i in range(62)]}),
        wrong_model("none", CURVE | {"control_points": []}),
        wrong_model("a text", CURVE | {"control_points": "zigzag"}),
        wrong_model("a text as a coordinate", CURVE | {"control_points": [[0, 0], [1, "2"], [2, 0]]}),
        wrong_model("true as a coordinate", CURVE | {"control_points": [[0, 0], [1, True], [2, 0]]}),
        wrong_model("NaN", CURVE | {"control_points": [[0, 0], [1, float("nan")], [2, 0]]}),
        wrong_text("1e999", json.dumps({"gtcad": 1, "shape": [CURVE]}).replace("[1, 2]", "[1, 1e999]").encode()),
        wrong_text("nan in TOML", TOML.replace(b"[1, 2]", b"[1, nan]"), "model.toml"),
        wrong_text("a date in TOML", TOML.replace(b"[1, 2]", b"[1, 2024-05-31]"), "model.toml"),
        wrong_model("1e60", CURVE | {"control_points": [[0, 0], [1, 1e60], [2, 0]]}),
        wrong_model("one coordinate", CURVE | {"control_points": [[0, 0], [1], [2, 0]]}),
        wrong_model("two and three coordinates mixed", CURVE | {"control_points": [[0, 0], [1, 2, 3], [2, 0]]}),
        wrong_model("plane points of a surface", SURFACE | {"control_points": [[[0, 0]] * 3] * 3}),
        wrong_model("a ragged net", SURFACE | {"control_points": [[[0, 0, 0]] * 3, [[1, 0, 0]] * 3, [[2, 0, 0]] * 2]}),
        wrong_model("a net of two rows", SURFACE | {"control_points": SURFACE["control_points"][:2]}),
        wrong_model("a list of points for a surface", SURFACE | {"control_points": CURVE["control_points"]}),
        wrong_model("a hundred mistakes", CURVE | {"control_points": [["x", "y"] for _ in range(50)]}),
    ],
    "Model files: chains": [
        wrong_chain("a piece that the file does not have", pieces=["arch", "nexxt"]),
        wrong_chain("a chain that is a piece of itself", pieces=["arch", "rail"]),
        wrong_chain(
            "two chains that are pieces of each other", CHAIN | {"name": "b", "pieces": ["rail"]}, pieces=["b"]
        ),
        wrong_chain("a chain as a piece", CHAIN | {"name": "b"}, pieces=["b", "next"]),
        wrong_chain("a surface as a piece", SURFACE, pieces=["roof", "next"]),
        wrong_chain(
            "a plane piece and one in space", pieces=["arch", {"control_points": [[2, 0, 0], [3, 1, 1], [4, 0, 1]]}]
        ),
        wrong_chain("a number as a piece", pieces=["arch", 7]),
        wrong_chain("a mistake in a piece", pieces=["arch", {"gamma": [0, 2], "control_points": [[2, 0], [3, 1]]}]),
        wrong_chain("no pieces", pieces=[]),
        wrong_chain("an unknown order", orders="G4"),
        wrong_chain("an unknown order of one joint", orders=["smooth"]),
        wrong_chain("two orders for one joint", orders=["G1", "G1"]),
        wrong_chain("one order too few for a closed chain", orders=["G1"], closed=True),
        wrong_chain("closed in words", closed="yes"),
        wrong_chain("a joint of an order that a piece has too few control points for", orders="G3"),
        wrong_chain("a design variable that leaves a joint undetermined", pieces=["arch", NEXT_FREE]),
        wrong_chain(
            "joints between control points that are all fixed", fixed=[[k, i] for k in range(2) for i in range(3)]
        ),
        wrong_chain("a joint beside a part of a curve, which cannot move", pieces=["arch", NEXT_PART]),
        wrong_chain("a control point to be fixed that there is not", fixed=[[0, 3]]),
        wrong_chain("a control point to be fixed without its piece", fixed=[1]),
        wrong_chain("construction in words", construction="yes"),
    ],
    "Model files: conics": [
        wrong_model("a circle without a radius", {key: CIRCLE[key] for key in ("name", "kind", "center")}),
        wrong_model("a radius of zero", CIRCLE | {"radius": 0}),
        wrong_model("a centre of one coordinate", CIRCLE | {"center": [5]}),
        wrong_model("a normal without direction", CIRCLE | {"normal": [0, 0, 0]}),
        wrong_model("a normal of a plane circle", CIRCLE | {"center": [0, 0], "normal": [0, 0, 1]}),
        wrong_model("control points of a circle", CIRCLE | {"control_points": [[0, 0], [1, 1], [2, 0]]}),
        wrong_model("parallel axes", ELLIPSE | {"axis_b": [6, 0]}),
        wrong_model("axes of a plane ellipse in space", ELLIPSE | {"axis_a": [3, 0, 0], "axis_b": [0, 1, 0]}),
        wrong_model("an arc of no size", {key: ARC[key] for key in ("name", "kind", "center", "angles")}),
        wrong_model("a radius and axes", ARC | {"axis_a": [3, 0], "axis_b": [0, 1]}),
        wrong_model("an arc of no length", ARC | {"angles": [30, 30]}),
        wrong_model("more than a turn", ARC | {"angles": [0, 400]}),
        wrong_model("an angle in words", ARC | {"angles": [0, "right"]}),
        wrong_model("a parabola of three points on a line", PARABOLA | {"control_points": [[0, 0], [1, 1], [2, 2]]}),
        wrong_model("a parabola of four points", PARABOLA | {"control_points": [[0, 0], [1, 2], [2, 2], [3, 0]]}),
    ],
    "Model files: patches": [
        wrong_model("a profile that the file does not have", TUBE | {"profile": "tubbe"}),
        wrong_model("a surface as the profile", SURFACE, TUBE | {"profile": "roof"}),
        wrong_model("no profile", {"name": "tube", "kind": "rotation"}),
        wrong_model("no turn", TUBE | {"angle": 0}),
        wrong_model("more than a whole turn", TUBE | {"angle": 400}),
        wrong_model("an axis without direction", TUBE | {"axis_direction": [0, 0, 0]}),
        wrong_model("a placement of two rows", TUBE | {"placement": [[1, 0, 0, 0], [0, 1, 0, 0]]}),
        wrong_model(
            "a swung profile that is not plane",
            {"name": "s", "kind": "swung", "trajectory": {"control_points": [[1, 0], [1, 1], [0, 1]]}}
            | {"profile": {"control_points": [[1, 0, 0], [1, 1, 1], [1, 0, 2]]}},
        ),
        wrong_model("a cone without an apex", {"name": "c", "kind": "cone", "curve": SPACE}),
        wrong_model("two sections of a GT loft", {"name": "l", "kind": "lofted", "sections": [SPACE, SPACE]}),
        wrong_model(
            "an unknown frame of a sweep",
            {"name": "s", "kind": "sweep", "profile": SPACE, "spine": SPACE, "frame": "bishop"},
        ),
        wrong_model(
            "boundaries of a Coons patch that do not meet",
            {"name": "c", "kind": "coons"} | dict.fromkeys(("c0", "c1", "d0", "d1"), SPACE),
        ),
    ],
    "Model files: quilts and solids": [
        wrong_model("a patch that the file does not have", TUBE, POT | {"patches": ["tub"]}),
        wrong_model("a curve as a patch", CURVE, POT | {"patches": ["arch"]}),
        wrong_model("no patches", POT | {"patches": []}),
        wrong_model("a patch twice", TUBE, SKIN | {"patches": ["tube", "tube"]}),
        wrong_model("an unknown order across edges", TUBE, SKIN | {"order": "G4"}),
        wrong_model("an open quilt as a solid", TUBE, POT | {"caps": "none"}),
        wrong_model("unknown caps", TUBE, POT | {"caps": "round"}),
        wrong_model("a wall of no thickness", TUBE, POT | {"thickness": 0}),
        wrong_model(
            "an edge of sides that are apart",
            TUBE,
            SKIN | {"edges": [{"first": "tube.u0", "second": "tube.u1"}]},
        ),
        wrong_model(
            "an edge of a patch that there is not",
            TUBE,
            SKIN | {"edges": [{"first": "tube.u0", "second": "lid.u1"}]},
        ),
        wrong_model("a side that there is not", TUBE, SKIN | {"edges": [{"first": "tube.u2", "second": "tube.u1"}]}),
        wrong_model("a wall that folds", TUBE, POT | {"caps": "none", "thickness": 60}),
    ],
    "Files": [
        Case("a model that is not there", EXPORT, 3),
        Case("a folder as the model", EXPORT, 3, {"model.json/inside": b""}),
        Case("a folder to write to that is not there", [*EXPORT[:3], "none/out.step", *EXPORT[4:]], 3, model(CURVE)),
        Case("a folder as the file to write", EXPORT, 3, model(CURVE) | {"out.step/inside": b""}),
        Case("an exchange file that is not there", CHECK, 3, model(CURVE)),
        Case("an empty STEP file", CHECK, 3, model(CURVE) | {"out.step": b""}),
        Case("a STEP file cut off", CHECK, 3, model(CURVE) | {"out.step": b"ISO-10303-21;\nHEADER;\n"}),
        Case("a STEP file of garbage", CHECK, 3, model(CURVE) | {"out.step": b"\x00garbage" * 99}),
        Case("an IGES file of garbage", ["info", "out.igs"], 3, {"out.igs": b"\x00garbage" * 99}),
        Case("a BREP file of garbage", ["info", "out.brep"], 3, {"out.brep": b"\x00garbage" * 99}),
        Case(
            "no file to compare with",
            ["check", "a.step", "--against", "b.step", "--tolerance", "1"],
            3,
            {"a.step": b"x"},
        ),
        Case(
            "a list that is none", ["check", "--manifest", "l.json"], 3, {"l.json": b'{"check": [{"fil": "a.step"}]}'}
        ),
        Case("a log that is none", ["check", "a.step", "--resume", "l.txt"], 3, {"a.step": b"x", "l.txt": b"notes\n"}),
        Case("a folder as the exchange file", ["info", "out.brep"], 3, {"out.brep/inside": b""}),
    ],
    "Usage": [
        wrong_option("a tolerance of zero", *EXPORT[:-1], "0"),
        wrong_option("a negative tolerance", *EXPORT[:-2], "--tolerance=-1e-4"),
        wrong_option("a tolerance that is not a number", *EXPORT[:-1], "nan"),
        wrong_option("an infinite tolerance", *EXPORT[:-1], "inf"),
        wrong_option("a tolerance beyond all numbers", *EXPORT[:-1], "1e999"),
        wrong_option("a tolerance below all numbers", *EXPORT[:-1], "1e-999"),
        wrong_option("a tolerance in words", *EXPORT[:-1], "fine"),
        wrong_option("a tolerance in an unknown unit", *EXPORT[:-1], "1 parsec"),
        wrong_option("an empty tolerance", *EXPORT[:-1], ""),
        wrong_option("a bad tolerance and no such model", "export", "none.json", "-o", "a.step", "--tolerance", "x"),
        wrong_option("degree 30", *EXPORT, "--degree", "30"),
        wrong_option("degree 2", *EXPORT, "--degree", "2"),
        wrong_option("degree 5.0", *EXPORT, "--degree", "5.0"),
        wrong_option("a highest degree without auto", *EXPORT, "--max-degree", "7"),
        wrong_option("continuity of the degree", *EXPORT, "--continuity", "5"),
        wrong_option("end order 4", *EXPORT, "--end-order", "4"),
        wrong_option("an unknown schema", *EXPORT, "--schema", "AP209"),
        wrong_option(
            "a schema for IGES", "export", "model.json", "-o", "a.igs", "--tolerance", "1", "--schema", "AP203"
        ),
        wrong_option("a time in words", *EXPORT, "--timestamp", "yesterday"),
        wrong_option("an unknown suffix to write", "export", "model.json", "-o", "out.obj", "--tolerance", "1e-4"),
        wrong_option(
            "a degree for triangles", "export", "model.json", "-o", "a.stl", "--tolerance", "1", "--degree", "5"
        ),
        wrong_option("a mesh to look into", "info", "a.stl"),
        wrong_option("no suffix to write", "export", "model.json", "-o", "out", "--tolerance", "1e-4"),
        wrong_option("the model as the file to write", "export", "model.json", "-o", "model.json", "--tolerance", "1"),
        wrong_option("a STEP file as the model", "export", "in.step", "-o", "out.step", "--tolerance", "1e-4"),
        wrong_option(
            "a model as the exchange file", "check", "model.json", "--against", "model.json", "--tolerance", "1"
        ),
        wrong_option("a mesh to check against", "check", "a.step", "--against", "b.stl", "--tolerance", "1"),
        wrong_option("a tolerance without anything to check against", "check", "a.step", "--tolerance", "1"),
        wrong_option("something to check against without a tolerance", "check", "a.step", "--against", "b.step"),
        wrong_option("a proof of nothing", "check", "a.step", "--require-proof"),
        wrong_option("an unknown profile", "check", "a.step", "--profile", "iso"),
        wrong_option("an unknown limit", "check", "a.step", "--limit", "small-edge=1mm"),
        wrong_option("a limit in a wrong unit", "check", "a.step", "--limit", "tiny-edge=1deg"),
        wrong_option("a report of an unknown kind", "check", "a.step", "--report", "a.doc"),
        wrong_option("a time limit in words", "check", "a.step", "--timeout", "soon"),
        wrong_option("too little memory for the kernel", "check", "a.step", "--memory", "100MB"),
        wrong_option("no file to check", "check"),
        wrong_option("an unknown suffix to look into", "info", "notes.txt"),
        wrong_option("no tolerance", *EXPORT[:-2], names="--tolerance"),
        wrong_option("no file to write", "export", "model.json", "--tolerance", "1", names="--output"),
        wrong_option("no model", "export", "-o", "out.step", "--tolerance", "1", names="MODEL"),
        wrong_option("an unknown option", *EXPORT, "--tolerence", "1", names="--tolerence"),
        wrong_option("an unknown command", "exprot", names="exprot"),
        wrong_option("two models", "info", "model.json", "model.json", names="model.json"),
    ],
    "What cannot be done": [
        Case("shapes for construction only", EXPORT, 3, model(CURVE | {"construction": True})),
        Case("a curve that is one point", EXPORT, 3, model(CURVE | {"control_points": [[1, 1]] * 3})),
        Case(
            "a surface that is only a curve",
            EXPORT,
            3,
            model(SURFACE | {"control_points": [[[i, i * i, 0]] * 3 for i in range(3)]}),
        ),
        Case("triangles of curves", ["export", "model.json", "-o", "a.stl", "--tolerance", "1"], 3, model(CURVE)),
        Case("triangles of caps", ["export", "model.json", "-o", "a.stl", "--tolerance", "1"], 3, model(POT, TUBE)),
        Case("a tolerance below double precision", [*EXPORT[:-1], "1e-18"], 1, model(SURFACE)),
        Case(
            "a tolerance below double precision for one shape of two",
            [*EXPORT[:-1], "1e-9"],
            1,
            model(CURVE, SURFACE | {"control_points": [[[1e6 * i, 1e6 * j, 0] for j in range(3)] for i in range(3)]}),
        ),
    ],
}
CASES = [case for group in GROUPS.values() for case in group]


@contextlib.contextmanager
def files_of(case: Case) -> Iterator[Path]:
    """The current folder of the case, with its files."""
    with tempfile.TemporaryDirectory() as name, contextlib.chdir(name):
        for path, content in case.files.items():
            Path(path).parent.mkdir(exist_ok=True)
            Path(path).write_bytes(content)
        yield Path(name)


def outcome(case: Case) -> tuple[int, list[str]]:
    """The exit code of a case and the lines of its message, without the usage that comes before."""
    with files_of(case) as folder:
        before = sorted(folder.rglob("*"))
        result = CliRunner().invoke(cli.app, case.arguments)
        assert sorted(folder.rglob("*")) == before, "something was written"
    assert "Traceback" not in result.output
    lines = result.stderr.splitlines()
    return result.exit_code, [line for line in lines if not line.startswith(("Usage:", "Try ")) and line]


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.what)
def test_bad_input_gets_its_code_and_a_message_and_writes_nothing(case: Case) -> None:
    code, message = outcome(case)
    assert code == case.code, message
    assert message
    assert len(message) <= 51
    assert all(line.startswith("Error: ") for line in message)
    assert case.names in " ".join(message)


def test_no_case_is_listed_twice() -> None:
    assert len({(tuple(case.arguments), *map(tuple, case.files.items())) for case in CASES}) == len(CASES)


def test_the_models_that_the_cases_change_are_good(tmp_path: Path) -> None:
    path = tmp_path / "model.json"
    good = (CURVE, SURFACE, NEXT, CHAIN, CIRCLE, ELLIPSE, ARC, PARABOLA, TUBE, POT, SKIN)
    path.write_bytes(model(*good)["model.json"])
    assert list(gtcad.load_model(path)) == [shape["name"] for shape in good]
    (tmp_path / "model.toml").write_bytes(TOML)
    assert list(gtcad.load_model(tmp_path / "model.toml")) == ["arch"]


def test_the_page_says_what_the_program_does() -> None:
    assert PAGE.read_text(encoding="utf-8") == page()


def page() -> str:
    """docs/bad-input.md."""
    lines = [
        "# Bad input, and what it gets",
        "",
        "Every row is run by the tests, which also hold this page to what the program answers. Exit codes: 1 the",
        "tolerance cannot be met, 2 usage (judged before any file is opened), 3 a file is missing, unreadable or bad.",
        "All problems of a model are named at once, fifty at most. Nothing is written in any of these cases.",
    ]
    for title, cases in GROUPS.items():
        lines += ["", f"## {title}", "", "| input | command | code | message |", "|---|---|---|---|"]
        lines += [row(case) for case in cases]
    return "\n".join(lines) + "\n"


def row(case: Case) -> str:
    """One line of the table."""
    code, message = outcome(case)
    if case.names:
        text = f"{PARSER}, naming `{case.names}`"
    else:
        shown = [cell(MEASURED.sub("...", line.removeprefix("Error: "))) for line in message[:MOST_LINES]]
        more = [f"({len(message) - MOST_LINES} more lines)"] if len(message) > MOST_LINES else []
        text = "<br>".join([*shown, *more])
    return f"| {case.what} | {cell(' '.join(argument or repr('') for argument in case.arguments))} | {code} | {text} |"


def cell(text: str) -> str:
    """Text that Markdown leaves alone in a table."""
    return "`" + text.replace("|", "\\|") + "`"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
