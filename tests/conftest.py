from __future__ import annotations

import pytest
from hypothesis import is_hypothesis_test, settings

settings.register_profile("default", deadline=None, derandomize=True, max_examples=50)
settings.register_profile("stress", deadline=None, derandomize=True, max_examples=2000)

# their properties are cheap enough to be tried on many more examples by `make stress`
CORE = {"basis", "chebyshev", "protocol", "curve", "surface", "restricted", "differential", "measure", "conics"}


def _stress(config: pytest.Config) -> bool:
    return bool(config.option.markexpr == "stress")


def pytest_configure(config: pytest.Config) -> None:
    settings.load_profile("stress" if _stress(config) else "default")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    for item in items if _stress(config) else []:
        if item.path.stem.removeprefix("test_") in CORE and is_hypothesis_test(getattr(item, "function", None)):
            item.add_marker(pytest.mark.stress)
