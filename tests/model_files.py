"""Model files of tests."""

from __future__ import annotations

import json
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
