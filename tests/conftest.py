from __future__ import annotations

import pytest
from hypothesis import settings

settings.register_profile("default", deadline=None, derandomize=True, max_examples=50)
settings.register_profile("stress", deadline=None, derandomize=True, max_examples=2000)


def pytest_configure(config: pytest.Config) -> None:
    chosen = config.option.markexpr == "stress"
    settings.load_profile("stress" if chosen else "default")
