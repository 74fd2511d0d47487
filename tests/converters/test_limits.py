from __future__ import annotations

import math

import pytest

from gtcad import Composite, Curve, Surface
from gtcad.converters import fit_curve, fit_surface
from gtcad.converters.limits import DeviationLimit, PoleCount, PoleLimit
from gtcad.errors import InputError, NoFeasibleDesign
from gtcad.fronts import pareto_front
from gtcad.optimize import optimize

ARC = Curve([(0, 0, 0), (20, 40, 10), (40, 50, 40), (60, 20, 50), (80, 0, 20)], (0.2, -0.3))
BOWL = Surface(
    [
        [[0, 0, 9], [0, 30, 0], [0, 60, 9]],
        [[30, 0, 0], [30, 30, -9], [30, 60, 0]],
        [[60, 0, 9], [60, 30, 0], [60, 60, 9]],
    ]
)


def test_poles_are_counted_on_the_spline() -> None:
    assert PoleCount(1e-4)(ARC) == len(fit_curve(ARC, tolerance=1e-4).spline.control_points)
    rows, columns = fit_surface(BOWL, tolerance=1e-3, degree=4).spline.control_points.shape[:2]
    assert PoleCount(1e-3, degree=4)(BOWL) == rows * columns
    assert PoleLimit(8, 1e-4)(ARC) == PoleCount(1e-4)(ARC) - 8


def test_what_cannot_be_fitted_has_no_end_of_poles() -> None:
    assert math.isinf(PoleCount(1e-18)(ARC))
    assert PoleLimit(8, 1e-18)(ARC) == math.inf
    assert DeviationLimit(1e-18)(ARC) > 0


def test_deviations_are_compared_in_orders_of_magnitude() -> None:
    best = fit_curve(ARC, tolerance=1.0, max_spans=1).deviation[1]
    assert DeviationLimit(2 * best, spans=1)(ARC) <= 0
    beyond = DeviationLimit(best / 100, spans=1)(ARC)
    assert 1.5 < beyond < 3
    assert DeviationLimit(best / 100, spans=8)(ARC) <= 0


@pytest.mark.parametrize("limit", [PoleCount(1e-3), PoleLimit(9, 1e-3), DeviationLimit(1e-3)])
def test_only_curves_and_surfaces_are_converted(limit: PoleCount) -> None:
    with pytest.raises(InputError, match=r"only curves and surfaces .* got Composite"):
        limit(Composite((ARC,), ()))


def test_a_pole_limit_is_kept_where_the_free_optimum_breaks_it() -> None:
    free = optimize(ARC, "length")
    limit = PoleLimit(8, tolerance=1e-3)
    assert limit(free.shape) > 0
    found = optimize(ARC, "length", constraints=limit, particles=5, iterations=4, polished=False)
    assert limit(found.shape) <= 0
    assert found.value > free.value
    with pytest.raises(NoFeasibleDesign):
        optimize(ARC, "length", constraints=PoleLimit(4, tolerance=1e-3), particles=3, iterations=2)


def test_a_front_of_area_energy_and_poles() -> None:
    front = pareto_front(BOWL, ["area", "bending", PoleCount(1e-2)], population=6, generations=3)
    assert front.objectives == ("area", "bending", "PoleCount")
    assert all(PoleCount(1e-2)(shape) == count for shape, count in zip(front.shapes, front.values[:, 2], strict=True))
    for one in front.values:
        assert not any((other <= one).all() and (other < one).any() for other in front.values)
