"""How time and poles grow with the number of patches, the degree of the shape and the tolerance."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gtcad import Curve, Surface
from gtcad.converters import fit_curve, fit_surface
from gtcad.errors import GtcadError
from tests import pieces
from tests.benchmarks.timing import table
from tests.benchmarks.workload import forget_kinds

PICTURE = Path("docs/images/growth.svg")
PATCHES = (1, 10, 100, 1000, 10000)
SHAPE_DEGREES = (2, 3, 4, 6, 8, 10, 14, 20, 28, 40)
TOLERANCES = tuple(10.0**-k for k in range(1, 11))
Series = tuple[list[float], list[float], list[float]]  # sizes, seconds, poles


def run() -> str:
    """The tables of this part; a picture of them goes into docs/images."""
    series = {
        "patches, cached": _patches(),
        "degree of the curve, cached": _degrees(False),
        "degree of the curve, adapted": _degrees(True),
        "1 / tolerance, degree 3, cached": _tolerances(3, False),
        "1 / tolerance, degree 3, adapted": _tolerances(3, True),
        "1 / tolerance, degree 5, adapted": _tolerances(5, True),
        "1 / tolerance, degree 7, adapted": _tolerances(7, True),
        "1 / tolerance, auto, adapted": _tolerances("auto", True),
    }
    _plot(series)
    rows = [row for name, (sizes, times, poles) in series.items() for row in _rows(name, sizes, times, poles)]
    header = ["growing", "size", "processor ms", "poles", "slope of time since the row above", "slope of poles"]
    return "## Growth\n\n" + table(header, rows)


def _rows(name: str, sizes: list[float], times: list[float], poles: list[float]) -> list[list[str]]:
    rows = []
    for i, size in enumerate(sizes):
        slopes = ["", ""]
        if i:
            step = np.log(size / sizes[i - 1])
            slopes = [f"{np.log(column[i] / column[i - 1]) / step:.2f}" for column in (times, poles)]
        rows.append([name, f"{size:g}", f"{1e3 * times[i]:.2f}", f"{poles[i]:g}", *slopes])
    return rows


def _measured(action: Callable[[], Any], repeats: int = 3) -> tuple[float, Any]:
    """Median processor time of a call that finds nothing cached, and its result: slopes that other programs spare."""
    times = []
    for _ in range(repeats):
        forget_kinds()
        start = time.process_time()
        result = action()
        times.append(time.process_time() - start)
    return statistics.median(times), result


def _patches() -> Series:
    base = pieces.surfaces()["S54"]
    rng = np.random.default_rng(0)
    times, poles = [], []
    for count in PATCHES:
        nets = [base.control_points + rng.normal(0, 5, base.control_points.shape) for _ in range(count)]
        surfaces = [Surface(net, base.gamma_u, base.gamma_v) for net in nets]

        def convert(surfaces: Sequence[Surface] = surfaces) -> int:
            fits = (fit_surface(surface, tolerance=1e-4, adapt=False) for surface in surfaces)
            return sum(int(np.prod(fit.spline.control_points.shape[:2])) for fit in fits)

        taken, total = _measured(convert, 1 if count > 1000 else 3)
        times.append(taken)
        poles.append(total)
    return list(map(float, PATCHES)), times, poles


def _degrees(adapt: bool) -> Series:
    """Space curves of about 100 mm whose control points lie on one smooth line whatever their number."""
    times, poles = [], []
    for degree in SHAPE_DEGREES:
        x = np.linspace(0, 1, degree + 1)
        points = 100 * np.stack([x, 0.6 * np.sin(7 * x), 0.4 * np.cos(5 * x)], axis=1)
        curve = Curve(points, (0.5, -0.3))
        taken, fit = _measured(lambda curve=curve: fit_curve(curve, tolerance=1e-4, exact=False, adapt=adapt))
        times.append(taken)
        poles.append(len(fit.spline.control_points))
    return list(map(float, SHAPE_DEGREES)), times, poles


def _tolerances(degree: int | str, adapt: bool) -> Series:
    curve = pieces.curves()["D5s"]
    sizes, times, poles = [], [], []
    for tolerance in TOLERANCES:

        def convert(tolerance: float = tolerance) -> Any:
            return fit_curve(curve, tolerance=tolerance, degree=degree, exact=False, adapt=adapt)

        try:
            taken, fit = _measured(convert, 3 if tolerance > 1e-6 else 1)
        except GtcadError:
            break  # refused: below what double precision can prove
        sizes.append(1 / tolerance)
        times.append(taken)
        poles.append(len(fit.spline.control_points))
    return sizes, times, poles


def _plot(series: dict[str, Series]) -> None:
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot

    mpl.rcParams.update({"svg.hashsalt": "gtcad", "svg.fonttype": "none"})
    figure, rows = pyplot.subplots(3, 2, figsize=(10, 11), layout="constrained")
    for axes, kind in zip(rows, ("patches", "degree", "1 / tolerance"), strict=True):
        for name, (sizes, times, poles) in series.items():
            if name.startswith(kind):
                label = name.removeprefix(kind).removeprefix(" of the curve").strip(", ")
                axes[0].loglog(sizes, times, "o-", label=label, markersize=4)
                axes[1].loglog(sizes, poles, "o-", label=label, markersize=4)
        for axis, what in zip(axes, ("processor time, s", "poles"), strict=True):
            if kind == "degree":
                axis.set_xticks(SHAPE_DEGREES, [str(degree) for degree in SHAPE_DEGREES])
                axis.minorticks_off()
                axis.set_yscale("linear" if what == "poles" else "log")
            axis.set(
                xlabel={"1 / tolerance": "1 / tolerance, 1/mm", "degree": "degree of the curve"}.get(kind, kind),
                ylabel=what,
            )
            axis.grid(True, which="major", alpha=0.3)
            axis.legend()
    figure.savefig(PICTURE, metadata={"Date": None})
    pyplot.close(figure)
