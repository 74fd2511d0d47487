"""The samples of shape optimisation: what they find, against other measures, and the script that draws them."""

from __future__ import annotations

import runpy
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from gtcad import measure
from gtcad.flat_pattern import develop
from gtcad.patches.developable import developability

SCRIPT = Path(__file__).parents[1] / "samples" / "optimize.py"


@pytest.fixture(scope="module")
def sample() -> Any:
    """The names of the script, which finds the module beside it as when it is run."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(SCRIPT.parent)
        return runpy.run_path(str(SCRIPT))


@pytest.mark.parametrize("name", ["chute", "hood"])
def test_an_optimised_developable_keeps_its_control_points_and_flattens(sample: Any, name: str) -> None:
    design, best = sample["optimised"](sample[name])
    assert best.converged
    assert best.value < 0.7 * best.start_value
    for patch in (design.patch, best.shape):
        pattern = develop(patch, twist_deg=sample["MOST_TWIST"])
        strain = 1e-9 if name == "chute" else 0.1  # the hood is no developable, only nearly one
        assert np.isclose(pattern.area, measure.area(patch), rtol=strain)
        assert pattern.overlap is None
    if name == "chute":
        assert np.array_equal(best.shape.spine.control_points, design.patch.spine.control_points)
        assert developability(best.shape).regular
    else:
        for side in "ab":
            before, after = (getattr(patch, side).control_points for patch in (design.patch, best.shape))
            assert np.array_equal(before, after)
        assert developability(best.shape).twist_deg < 0.5 * developability(design.patch).twist_deg


def test_the_canopy_has_less_energy_between_the_same_corners(sample: Any) -> None:
    design, best = sample["optimised"](sample["canopy"])
    assert best.setting.startswith("free boundary")
    energies = [measure.dirichlet_energy(patch) for patch in (design.patch, best.shape)]
    assert np.allclose(energies, [best.start_value, best.value], rtol=1e-11)
    assert energies[1] < energies[0]
    assert np.array_equal(best.shape.control_points[::3, ::3], design.patch.control_points[::3, ::3])


def test_the_script_draws_what_it_is_asked_for(tmp_path: Path) -> None:
    command = [sys.executable, str(SCRIPT), "--output", str(tmp_path)]
    subprocess.run([*command, "optimised-canopy"], check=True, capture_output=True)
    with Image.open(tmp_path / "optimised-canopy.png") as picture:
        assert min(picture.size) > 300
        assert len(set(picture.convert("L").tobytes())) > 20
    wrong = subprocess.run([*command, "nothing"], check=False, capture_output=True, text=True)
    assert wrong.returncode == 2
    assert "no such picture: nothing" in wrong.stderr
