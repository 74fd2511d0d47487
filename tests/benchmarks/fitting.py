"""Poles, deviation and processor time of fits: the benchmark pieces, cold and warm, and a batch of one kind."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable

import numpy as np

from gtcad import Surface
from gtcad.converters import fit_curve, fit_surface
from tests import pieces
from tests.benchmarks.timing import median, seconds, table
from tests.benchmarks.workload import forget_kinds

BATCH = 1000


def run() -> str:
    """The tables of this part."""
    return "\n\n".join(["## Poles", _poles(), "## Fit and proof of one patch", _single(), "## Batch", _batch()])


def _poles() -> str:
    rows = []
    for tolerance in (1e-2, 1e-4, 1e-6):
        for degree in (3, 5, 7, "auto"):
            for adapt in (True, False):
                fits = [
                    fit_curve(curve, tolerance=tolerance, degree=degree, exact=False, adapt=adapt)
                    for curve in pieces.curves().values()
                ]
                patches = [
                    fit_surface(surface, tolerance=tolerance, degree=degree, adapt=adapt)
                    for surface in pieces.surfaces().values()
                ]
                counts = [np.prod(fit.spline.control_points.shape[:2]) for fit in patches]
                rows.append(
                    [
                        f"{tolerance:.0e}",
                        str(degree),
                        "adapted" if adapt else "cached",
                        str(sum(len(fit.spline.control_points) for fit in fits)),
                        *(str(count) for count in counts),
                        f"{statistics.median(fit.deviation[1] / fit.deviation[0] for fit in [*fits, *patches]):.3f}",
                    ]
                )
    names = list(pieces.surfaces())
    header = ["tolerance, mm", "degree", "knots", "five curves", *names, "proved upper / lower, median"]
    return table(header, rows)


def _cold(action: Callable[[], object]) -> Callable[[], object]:
    def run_cold() -> object:
        forget_kinds()
        return action()

    return run_cold


def _single() -> str:
    surface = pieces.surfaces()["S54"]
    rows = []
    for tolerance in (1e-4, 1e-6):
        for adapt in (False, True):

            def fit(tolerance: float = tolerance, adapt: bool = adapt) -> object:
                return fit_surface(surface, tolerance=tolerance, adapt=adapt)

            cold, warm = median(_cold(fit), clock=time.process_time), median(fit, clock=time.process_time)
            knots = "adapted" if adapt else "cached"
            rows.append(["S54, degree 5", f"{tolerance:.0e}", knots, f"{1e3 * cold:.1f}", f"{1e3 * warm:.1f}"])
    return table(["patch", "tolerance, mm", "knots", "first of its kind, ms", "next, ms"], rows)


def _batch() -> str:
    base = pieces.surfaces()["S54"]
    rng = np.random.default_rng(0)
    surfaces = [
        Surface(base.control_points + rng.normal(0, 5, base.control_points.shape), base.gamma_u, base.gamma_v)
        for _ in range(BATCH)
    ]
    rows = []
    for tolerance in (1e-4, 1e-6):
        for degree in (5, "auto"):
            taken = seconds(
                lambda tolerance=tolerance, degree=degree: [
                    fit_surface(surface, tolerance=tolerance, degree=degree, adapt=False) for surface in surfaces
                ],
                time.process_time,
            )
            rows.append([f"{BATCH} patches of the kind S54", f"{tolerance:.0e}", str(degree), f"{taken:.2f}"])
    return table(["what", "tolerance, mm", "degree", "s"], rows)
