"""Model files of tests."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import Any

import gtcad
from gtcad.model import Model


def written(folder: Path, *shapes: Any, **head: Any) -> Path:
    """A model file with these shapes; the head adds to its other fields or replaces them."""
    path = folder / "model.json"
    path.write_text(json.dumps({"gtcad": 1, "shape": list(shapes)} | head))
    return path


def loaded(folder: Path, *shapes: Any, **head: Any) -> Model:
    """The same, read."""
    return gtcad.load_model(written(folder, *shapes, **head))


def sent_round(model: Model, path: Path) -> dict[str, Any]:
    """The content of a file that the model is written to, from which its patches come back bit for bit."""
    gtcad.dump_model(model, path)
    back = gtcad.load_model(path)
    assert back == model
    for name, patch in model.items():
        assert type(back[name]) is type(patch)
        assert back[name].coefficients.tobytes() == patch.coefficients.tobytes(), name
    text = path.read_text()
    data: dict[str, Any] = json.loads(text) if path.suffix == ".json" else tomllib.loads(text)
    return data
