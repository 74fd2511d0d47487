"""The limit: how few poles a spline with free knots needs, found by an optimiser that shares no code with gtcad.

The knots are the unknowns of a nonlinear least-squares problem (scipy's, trust region), weighted anew after each
round so that the largest error falls. What it finds bounds the limit from above. From below it is bounded by
pieces that need not join: as many spans as polynomials, each as long as the tolerance allows.
"""

from __future__ import annotations

import math
import time

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline, make_lsq_spline
from scipy.optimize import least_squares

from gtcad import Curve
from tests.benchmarks.workload import at_equal_parameters, spatial

_ROUNDS = 30
_STARTS = 4
_ENOUGH = 0.999  # of the tolerance
_END_WEIGHT = 1e4  # of the end points in least squares: they are then met to about 1e-8 of the error elsewhere


class FreeKnots:
    """Splines of one degree with free knots for one curve, through its ends or not."""

    def __init__(self, curve: Curve, degree: int, through_ends: bool = False) -> None:
        self.curve, self.degree = curve, degree
        self.through_ends = through_ends
        self.fine = np.linspace(0, 1, 1201)
        points = curve.evaluate(self.fine)
        flat = np.ptp(points[:, -1]) == 0
        self.keep = slice(0, points.shape[1] - 1) if flat else slice(None)
        slope = make_interp_spline(self.fine[::10], points[::10], degree + 2).derivative(degree + 1)
        density = np.linalg.norm(slope(self.fine), axis=1) ** (1 / (degree + 1))
        density = density / density.max() + 0.02
        self.share = np.concatenate([[0], np.cumsum((density[1:] + density[:-1]) / 2)])
        self.share /= self.share[-1]

    def reaches(self, poles: int, tolerance: float, rng: np.random.Generator) -> bool:
        """Whether a spline of so many poles within the tolerance was found, from several starts."""
        spans = poles - self.degree
        even = np.interp(np.linspace(0, 1, spans + 1), self.share, self.fine)
        for start in range(_STARTS if spans > 1 else 1):
            gaps = np.diff(even) * (1 if start == 0 else np.exp(rng.normal(0, 0.15, spans)))
            if self._descend(gaps / gaps.sum(), tolerance):
                return True
        return False

    def _flat(self, gaps: np.ndarray) -> np.ndarray:
        inner = np.cumsum(gaps)[:-1] / gaps.sum()
        return np.r_[[0.0] * (self.degree + 1), inner, [1.0] * (self.degree + 1)]

    def _descend(self, gaps: np.ndarray, tolerance: float) -> bool:
        count = max(121, 12 * (len(gaps) + self.degree))
        t = (1 - np.cos(np.linspace(0, np.pi, count))) / 2 * 0.5 + np.linspace(0, 1, count) * 0.5
        target = self.curve.evaluate(t)[:, self.keep]
        weights, best, idle = np.ones(count), math.inf, 0
        for turn in range(_ROUNDS):
            trial = weights.copy()
            for step in range(5):  # Lawson's iteration for these knots
                scale = self._scale(trial)
                spline = make_lsq_spline(t, target, self._flat(gaps), self.degree, w=scale)
                errors = np.linalg.norm(spline(t) - target, axis=1)
                if errors.max() <= _ENOUGH * tolerance and self._keeps(spline, tolerance):
                    return True
                if step == 0:
                    weights = weights * np.sqrt(errors / errors.max() + 1e-3)
                    weights /= weights.max()
                trial *= errors / errors.max() + 1e-3
                trial /= trial.max()
            idle = 0 if errors.max() < 0.99 * best else idle + 1
            best = min(best, errors.max())
            if len(gaps) == 1 or idle > 7 or (turn > 4 and best > 2.5 * tolerance):
                return False
            gaps = self._moved(t, target, gaps, self._scale(weights))
        return False

    def _scale(self, weights: np.ndarray) -> np.ndarray:
        scale = np.sqrt(weights)
        if self.through_ends:
            scale[[0, -1]] = _END_WEIGHT
        return scale

    def _keeps(self, spline: BSpline, tolerance: float) -> bool:
        def full(t: np.ndarray) -> np.ndarray:
            points = spatial(self.curve.evaluate(t))
            points[:, : spline.c.shape[1]] = spline(t)
            return points

        return at_equal_parameters(self.curve, full) <= tolerance

    def _moved(self, t: np.ndarray, target: np.ndarray, gaps: np.ndarray, scale: np.ndarray) -> np.ndarray:
        """Gaps after a few steps of least squares in their logarithms, the poles eliminated."""

        def residual(x: np.ndarray) -> np.ndarray:
            spline = make_lsq_spline(t, target, self._flat(gaps * np.exp(x)), self.degree, w=scale)
            return ((spline(t) - target) * scale[:, None]).ravel()

        start = np.zeros(len(gaps))
        unit = np.abs(residual(start)).max()
        found = least_squares(
            lambda x: residual(np.clip(x, -1.0, 1.0)) / unit,
            start,
            diff_step=1e-5,
            max_nfev=4,
            gtol=None,
            xtol=None,
        )
        moved = np.exp(np.clip(found.x, -1.0, 1.0)) * gaps
        return moved / moved.sum()


def fewest_poles(curve: Curve, degree: int, tolerance: float, known: int, budget: float) -> tuple[int, bool]:
    """The fewest poles found, gtcad's `known` ones included, and whether the search ended before its time did."""
    rng = np.random.default_rng(degree)
    problem, end = FreeKnots(curve, degree), time.perf_counter() + budget
    poles = known
    while poles > degree + 1:
        if time.perf_counter() > end:
            return poles, False
        if not problem.reaches(poles - 1, tolerance, rng):
            break
        poles -= 1
    return poles, True


def fewer_possible(curve: Curve, degree: int, tolerance: float, poles: int) -> bool:
    """Whether a spline through the ends with one pole fewer was found within the tolerance."""
    if poles == degree + 1:
        return False
    return FreeKnots(curve, degree, through_ends=True).reaches(poles - 1, tolerance, np.random.default_rng(degree))


def least_poles(curve: Curve, degree: int, tolerance: float) -> int:
    """No spline with simple knots has fewer: each of its spans is one polynomial within the tolerance.

    The longest polynomials, without any joint, are found one after the other; a polynomial is taken to be out of
    reach when least squares with Lawson's weights exceed 1.02 of the tolerance.
    """
    start, spans = 0.0, 0
    while start < 1:
        low, high = start, 1.0
        if not _one_polynomial(curve, degree, start, 1.0, tolerance):
            for _ in range(16):
                middle = (low + high) / 2
                low, high = (
                    (middle, high) if _one_polynomial(curve, degree, start, middle, tolerance) else (low, middle)
                )
        start, spans = high, spans + 1
    return spans + degree


def _one_polynomial(curve: Curve, degree: int, start: float, end: float, tolerance: float) -> bool:
    x = -np.cos(np.linspace(0, np.pi, 8 * (degree + 1)))
    target = curve.evaluate(start + (end - start) * (x + 1) / 2)
    design = np.polynomial.chebyshev.chebvander(x, degree)
    weights = np.ones(len(x))
    for _ in range(30):
        scale = np.sqrt(weights)[:, None]
        errors = np.linalg.norm(target - design @ np.linalg.lstsq(design * scale, target * scale)[0], axis=1)
        if errors.max() <= 1.02 * tolerance:
            return True
        if math.sqrt((weights * errors**2).sum() / weights.sum()) > 1.02 * tolerance:
            return False  # the weighted mean of the least-squares solution bounds the least largest error from below
        weights *= errors / errors.max() + 1e-6
        weights /= weights.max()
    return False
