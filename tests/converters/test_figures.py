from __future__ import annotations

import numpy as np
import pytest

from gtcad import BERNSTEIN, Surface
from gtcad.converters.figures import Figure, areas_differ, figure_of


def sheet(width: float) -> Figure:
    points = np.array([[[x, y, 0.0] for y in (0.0, 10.0)] for x in (0.0, width)])
    return figure_of(Surface(points, family_u=BERNSTEIN, family_v=BERNSTEIN))


@pytest.mark.parametrize(
    ("width", "same"), [(10.0, True), (9.993, True), (10.007, True), (9.99, False), (10.01, False)]
)
def test_areas_may_differ_by_what_a_border_that_moves_by_the_tolerance_takes(width: float, same: bool) -> None:
    """A border of 40 mm that lies 1 um off, twice over, takes 0.08 mm^2 of 100."""
    remark = areas_differ(sheet(10.0), (sheet(width),), 1e-3)
    assert remark == ("" if same else f"its area is {10 * width:.6g} mm^2, the model's 100 mm^2")
    halves = (sheet(width / 2), sheet(width / 2))
    assert (areas_differ(sheet(10.0), halves, 1e-3) == "") == same
