from __future__ import annotations

import doctest
import importlib

import pytest

from tests.test_imports import KERNELS, closure, modules


def needs_kernel(name: str) -> bool:
    return name.startswith("gtcad.converters.occt") or any(
        other.split(".")[0] in KERNELS or other.startswith("gtcad.converters.occt") for other in closure(name)
    )


NAMES = [name for name in modules() if not needs_kernel(name) and not name.endswith("__main__")]


@pytest.mark.parametrize("name", NAMES)
def test_examples(name: str) -> None:
    failed, _ = doctest.testmod(importlib.import_module(name))
    assert failed == 0


def test_there_are_examples() -> None:
    finder = doctest.DocTestFinder()
    counts = {name: sum(len(t.examples) for t in finder.find(importlib.import_module(name))) for name in NAMES}
    for name in ("gtcad.basis", "gtcad.curve", "gtcad.restricted", "gtcad.differential", "gtcad.measure"):
        assert counts[name] >= 1, name
