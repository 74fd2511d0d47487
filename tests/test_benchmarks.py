from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

from gtcad.patches.minimal import dirichlet_energies
from tests import pieces
from tests.benchmarks import limit, minimal, workload
from tests.benchmarks.timing import table


def test_the_random_curves_are_the_same_each_time():
    first, again = workload.random_curves(), workload.random_curves.__wrapped__()
    assert len(first) == workload.RANDOM
    for name, curve in first.items():
        assert np.array_equal(curve.control_points, again[name].control_points)


def test_distances_are_those_of_a_shifted_copy():
    curve = pieces.curves()["B3p"]
    t = np.linspace(0, 1, 200)
    copy = make_interp_spline(t, curve.evaluate(t), 7)
    copy.c = copy.c + [0, 0, 0.5]
    assert workload.at_equal_parameters(curve, copy) == pytest.approx(0.5, rel=1e-9)
    assert workload.to_nearest(curve, copy) == pytest.approx(0.5, rel=1e-9)


def test_the_nearest_distance_does_not_see_the_speed():
    curve = pieces.curves()["B3p"]
    t = np.linspace(0, 1, 400)
    slower = make_interp_spline((t + t**2) / 2, curve.evaluate(t), 7)
    assert workload.at_equal_parameters(curve, slower) > 1
    assert workload.to_nearest(curve, slower) < 1e-7


def test_the_limit_lies_between_its_bounds():
    curve = pieces.curves()["A2p"]
    found, ended = limit.fewest_poles(curve, 3, 1e-2, 9, 60.0)
    assert ended
    assert limit.least_poles(curve, 3, 1e-2) <= found <= 9


def test_the_plain_loop_finds_the_same_energies():
    rng = np.random.default_rng(2)
    net, gammas = rng.normal(size=(4, 5, 3)), rng.uniform(-1, 1, (9, 4))
    loop = [minimal.plain_energy(net, gamma) for gamma in gammas]
    assert dirichlet_energies(net, gammas) == pytest.approx(loop, rel=1e-12)


def test_tables_are_markdown():
    assert table(["a", "b"], [["1", "2"]]) == "| a | b |\n| --- | --- |\n| 1 | 2 |"
