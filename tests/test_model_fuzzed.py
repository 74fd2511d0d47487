"""The reader of models meets arbitrary documents: it reads them or raises ModelError, and nothing else."""

from __future__ import annotations

import contextlib
import copy
import json
import math
import tomllib
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import gtcad
from gtcad._documents import document_text
from gtcad.errors import ModelError

SAMPLES = Path(__file__).parents[1] / "samples"
NAMES = ("aerofoil.toml", "letter-a.toml", "saddle-roof.toml", "pipe-elbow.json", "bottle.toml", "lamp-shade.toml")
WORDS = ["gtcad", "shape", "unit", "name", "kind", "control_points", "gamma", "pieces", "orders", "patches", "profile"]
KINDS = ["curve", "surface", "composite", "circle", "arc", "ruled", "rotation", "sweep", "coons", "quilt", "solid"]

scalars = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-3, 3),
    st.integers(),
    st.floats(),
    st.sampled_from([*WORDS, *KINDS, "mm", "in", "GT", "bernstein", "G1", "C2", "all", ""]),
    st.text(max_size=20),
)
values = st.recursive(
    scalars,
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(st.sampled_from(WORDS) | st.text(max_size=5), inner, max_size=4)
    ),
    max_leaves=12,
)
shapes = st.dictionaries(st.sampled_from([*WORDS, "center", "radius", "angle", "family", "range"]), values, max_size=6)
documents = st.fixed_dictionaries({"gtcad": st.just(1) | values, "shape": st.lists(shapes, max_size=3) | values})


def document_of(name: str) -> dict[str, Any]:
    text = (SAMPLES / name).read_text(encoding="utf-8")
    found: dict[str, Any] = json.loads(text) if name.endswith(".json") else tomllib.loads(text)
    return found


ORIGINALS = {name: document_of(name) for name in NAMES}


def read(path: Path) -> None:
    """Read a model; its shapes must then be usable."""
    with contextlib.suppress(ModelError):
        model = gtcad.load_model(path)
        for shape in model.in_millimetres().values():
            assert shape.dimension in (2, 3)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("models")


@given(st.binary(max_size=200) | st.text(max_size=200).map(lambda text: text.encode("utf-8", "surrogatepass")))
def test_arbitrary_bytes(folder: Path, data: bytes) -> None:
    for name in ("a.json", "a.toml"):
        (folder / name).write_bytes(data)
        read(folder / name)


@given(documents | values)
def test_arbitrary_documents(folder: Path, document: Any) -> None:
    (folder / "b.json").write_text(json.dumps(document), encoding="utf-8")
    read(folder / "b.json")


def places(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """The paths to all that a document holds."""
    found = [path] if path else []
    if isinstance(value, dict | list):
        for key, entry in value.items() if isinstance(value, dict) else enumerate(value):
            found += places(entry, (*path, key))
    return found


def changed(document: dict[str, Any], path: tuple[Any, ...], how: str, value: Any) -> dict[str, Any]:
    result = copy.deepcopy(document)
    around: Any = result
    for key in path[:-1]:
        around = around[key]
    if how == "lost":
        del around[path[-1]]
    elif how == "doubled" and isinstance(around, list):
        around.insert(path[-1], copy.deepcopy(around[path[-1]]))
    else:
        around[path[-1]] = value
    return result


near = st.sampled_from([0, -1, 1, 2, 0.5, 1e-300, 1e50, -1e50, math.inf, math.nan, [], {}, "", [0, 0], [[0, 0, 0]]])


@settings(suppress_health_check=[HealthCheck.too_slow])
@given(st.data())
def test_samples_with_something_changed(folder: Path, data: st.DataObject) -> None:
    name = data.draw(st.sampled_from(NAMES))
    document = ORIGINALS[name]
    for _ in range(data.draw(st.integers(1, 3))):
        path = data.draw(st.sampled_from(places(document)))
        document = changed(
            document, path, data.draw(st.sampled_from(["lost", "doubled", "new"])), data.draw(near | values)
        )
    (folder / "c.json").write_text(json.dumps(document), encoding="utf-8")
    read(folder / "c.json")


@given(st.data())
def test_samples_with_letters_changed(folder: Path, data: st.DataObject) -> None:
    name = data.draw(st.sampled_from(NAMES))
    text = bytearray(document_text(ORIGINALS[name], Path(name).suffix).encode())
    for _ in range(data.draw(st.integers(1, 4))):
        place = data.draw(st.integers(0, len(text) - 1))
        text[place : place + data.draw(st.integers(0, 3))] = data.draw(st.binary(max_size=3))
    (folder / f"d{Path(name).suffix}").write_bytes(bytes(text))
    read(folder / f"d{Path(name).suffix}")
