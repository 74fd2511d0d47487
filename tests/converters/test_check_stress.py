"""A hundred files of each kind: moved ones are all caught, slipped and rewritten ones never accused."""

from __future__ import annotations

import pytest

from gtcad.converters.check import check_parts
from tests.converters.test_matching import (
    AFFINE,
    CHANGES,
    MODELS,
    T,
    assert_not_accused,
    assert_proved,
    pushed_parts,
    rewritten,
    slipped_parts,
)

pytestmark = pytest.mark.stress


@pytest.mark.parametrize(("through", "unit"), [("step", "INCH"), ("step", "M"), ("iges", "MM")])
@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("model", MODELS)
def test_every_rewritten_file_is_found_whole(tmp_path, model, change, unit, through):
    parts = rewritten(tmp_path, model, change, unit, through)
    report = check_parts(parts, MODELS[model], T)
    assert_not_accused(report, parts)
    if change in AFFINE:
        assert_proved(report, MODELS[model])


@pytest.mark.parametrize("seed", range(100, 200))
def test_every_moved_pole_is_caught(seed):
    shape, part = pushed_parts(seed, 3 * T)
    (row,) = check_parts([part], {"x": shape}, T).rows
    assert row.verdict == "failed"


@pytest.mark.parametrize("seed", range(100, 200))
def test_no_slip_is_accused(seed):
    shape, part = slipped_parts(seed)
    (row,) = check_parts([part], {"x": shape}, T).rows
    assert row.verdict in ("proved", "estimated")
