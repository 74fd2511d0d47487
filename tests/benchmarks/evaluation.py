"""Evaluation throughput and memory beside scipy and a plain numpy tensor product; start and import times."""

from __future__ import annotations

import subprocess
import sys
import tracemalloc

import numpy as np
from scipy.interpolate import BSpline

from gtcad import Curve, Surface
from tests.benchmarks.timing import paired, table


def run() -> str:
    """The tables of this part."""
    return "\n\n".join(["## Evaluation", _throughput(), "## Start", _start()])


def _throughput() -> str:
    rng = np.random.default_rng(1)
    t = rng.random(1_000_000)
    curve = Curve(rng.random((6, 3)), (0.3, -0.2))
    knots = np.r_[[0.0] * 6, 0.25, 0.5, 0.75, [1.0] * 6]
    spline = BSpline(knots, rng.random((9, 3)), 5)
    own, other, ratio = paired(lambda: curve.evaluate(t), lambda: spline(t))
    rows = [["degree-5 space curve, 1e6 points", "scipy BSpline, degree 5", *_figures(own, other, ratio)]]
    rows[0].append(f"{_peak(lambda: curve.evaluate(t)):.2f}")

    surface = Surface(rng.random((6, 6, 3)), (0.3, -0.2), (0.1, 0.9))
    line = np.linspace(0, 1, 1000)

    def plain() -> np.ndarray:
        left, right = surface.factors_u.evaluate(line), surface.factors_v.evaluate(line)
        return np.stack([left @ surface.control_points[..., k] @ right.T for k in range(3)], axis=-1)

    own, other, ratio = paired(lambda: surface.evaluate(line[:, None], line[None, :]), plain)
    rows.append(["(5, 5) patch, 1000 x 1000 grid", "plain numpy tensor product", *_figures(own, other, ratio)])
    rows[1].append(f"{_peak(lambda: surface.evaluate(line[:, None], line[None, :])):.2f}")
    header = ["what", "beside", "gtcad, ms", "other, ms", "times as fast", "peak memory / result"]
    return table(header, rows)


def _figures(own: float, other: float, ratio: float) -> list[str]:
    return [f"{1e3 * own:.1f}", f"{1e3 * other:.1f}", f"{ratio:.2f}"]


def _peak(action: object) -> float:
    """Peak memory of a call over the size of its result."""
    tracemalloc.start()
    result = action()  # type: ignore[operator]
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak / result.nbytes


def _start() -> str:
    def command(*arguments: str) -> object:
        return lambda: subprocess.run([sys.executable, *arguments], check=True, capture_output=True)

    numpy = command("-c", "import numpy")
    rows = []
    for name, own, repeats in (
        ("import gtcad", command("-c", "import gtcad"), 11),
        ("gtcad --help", command("-m", "gtcad", "--help"), 11),
        ("import gtcad.converters", command("-c", "from gtcad.converters import fit_curve"), 5),
        ("import splipy", command("-c", "import splipy"), 5),
        ("import geomdl.fitting", command("-c", "import geomdl.fitting"), 5),
        ("import OCP", command("-c", "import OCP"), 3),
        ("import build123d", command("-c", "import build123d"), 3),
        ("import cadquery", command("-c", "import cadquery"), 3),
    ):
        other_time, own_time, ratio = paired(numpy, own, repeats=repeats)  # type: ignore[arg-type]
        rows.append([name, f"{1e3 * own_time:.0f}", f"{1e3 * other_time:.0f}", f"{ratio:.2f}"])
    return table(["what", "ms", 'python -c "import numpy", ms', "ratio"], rows)
