"""Curve conversions by other libraries: each with the best settings found, and with its defaults.

The best settings are searched for with knowledge that a user does not have: the true deviation after each try.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from geomdl import fitting as geomdl_fitting
from scipy.interpolate import BSpline, make_lsq_spline

from gtcad import Curve
from gtcad.converters import fit_curve
from gtcad.converters.occt.compat import kernel_module, point_array, real_array
from gtcad.converters.occt.geometry import from_geom_curve
from tests.benchmarks.workload import Result, at_equal_parameters, samples, spatial, to_nearest

Tries = Callable[[Curve, int, float], Iterator[Result]]
MAX_POLES = 700
_SAMPLES = 900
_TIGHTER = (1.0, 0.3, 0.1)
_DEFAULT_SAMPLES = 50


@dataclass(frozen=True)
class Peer:
    """One way to convert a curve; `tries` yields results, and the fewest poles within the tolerance count."""

    name: str
    tries: Tries
    degrees: tuple[int, ...] = (3, 5, 7)
    smooth: bool = False  # as smooth as gtcad: continuity degree - 1
    least_tolerance: float = 0.0  # below it the peer is not asked: too slow
    random: bool = True  # whether the random pieces are tried

    def best(self, curve: Curve, degree: int, tolerance: float) -> Result | None:
        """The fewest poles within the tolerance, or None."""
        kept = [one for one in self.tries(curve, degree, tolerance) if one.deviation <= tolerance]
        return min(kept, key=lambda one: one.poles, default=None)


def gtcad(curve: Curve, degree: int | str, tolerance: float, *, adapt: bool = True) -> Result:
    start = time.perf_counter()
    fit = fit_curve(curve, tolerance=tolerance, degree=degree, exact=False, adapt=adapt)
    taken = time.perf_counter() - start
    return Result(len(fit.spline.control_points), at_equal_parameters(curve, fit.spline.evaluate), taken)


def uniform_knots(degree: int, poles: int) -> np.ndarray:
    inner = np.linspace(0, 1, poles - degree + 1)[1:-1]
    return np.r_[[0.0] * (degree + 1), inner, [1.0] * (degree + 1)]


def _fewest(build: Callable[[int], Result], least: int, tolerance: float, most: int = MAX_POLES) -> Iterator[Result]:
    """The least number of poles by doubling and bisection, and three below it in case the error is not monotone."""
    below, above = least - 1, least
    while (result := build(above)).deviation > tolerance:
        if above == most:
            yield result
            return
        below, above = above, min(2 * above, most)
    yield result
    while above - below > 1:
        middle = (above + below) // 2
        result = build(middle)
        below, above = (below, middle) if result.deviation <= tolerance else (middle, above)
        yield result
    yield from (build(poles) for poles in range(max(least, above - 3), above))


def _timed(make: Callable[[], Any], poles: int, measure: Callable[[Any], float]) -> Result:
    start = time.perf_counter()
    spline = make()
    taken = time.perf_counter() - start
    return Result(poles, measure(spline), taken)


def scipy_least_squares(curve: Curve, degree: int, tolerance: float) -> Iterator[Result]:
    for t in (samples(_SAMPLES), np.linspace(0, 1, _SAMPLES)):
        points = curve.evaluate(t)

        def build(poles: int, t: np.ndarray = t, points: np.ndarray = points) -> Result:
            knots = uniform_knots(degree, poles)
            return _timed(
                lambda: make_lsq_spline(t, points, knots, degree), poles, lambda s: at_equal_parameters(curve, s)
            )

        yield from _fewest(build, degree + 1, tolerance)


def splipy_either(curve: Curve, degree: int, tolerance: float) -> Iterator[Result]:
    from splipy import BSplineBasis, curve_factory

    t_all = samples(_SAMPLES)
    points = curve.evaluate(t_all)

    def build(poles: int, least_squares: bool) -> Result:
        basis = BSplineBasis(degree + 1, uniform_knots(degree, poles))
        places = np.clip(basis.greville(), 0, 1)
        if least_squares:
            return _timed(lambda: curve_factory.least_square_fit(points, basis, t_all), poles, measure)
        data = curve.evaluate(places)
        return _timed(lambda: curve_factory.interpolate(data, basis, places), poles, measure)

    def measure(spline: Any) -> float:
        own = BSpline(spline.bases[0].knots, spline.controlpoints, degree)
        return at_equal_parameters(curve, own)

    for least_squares in (False, True):

        def one(poles: int, least_squares: bool = least_squares) -> Result:
            return build(poles, least_squares)

        yield from _fewest(one, degree + 1, tolerance, 400)


def geomdl_approximation(curve: Curve, degree: int, tolerance: float) -> Iterator[Result]:
    points = spatial(curve.evaluate(np.linspace(0, 1, 120))).tolist()

    def build(poles: int) -> Result:
        return _timed(
            lambda: geomdl_fitting.approximate_curve(points, degree, centripetal=False, ctrlpts_size=poles),
            poles,
            lambda s: to_nearest(curve, BSpline(np.array(s.knotvector), np.array(s.ctrlpts), degree)),
        )

    yield from _fewest(build, degree + 2, tolerance, 60)


def geomdl_defaults(curve: Curve, degree: int, tolerance: float) -> Iterator[Result]:
    points = spatial(curve.evaluate(np.linspace(0, 1, _DEFAULT_SAMPLES))).tolist()
    yield _timed(
        lambda: geomdl_fitting.interpolate_curve(points, degree),
        _DEFAULT_SAMPLES,
        lambda s: to_nearest(curve, BSpline(np.array(s.knotvector), np.array(s.ctrlpts), degree)),
    )


def _kernel_result(curve: Curve, make: Callable[[], Any], parametric: bool = False) -> Iterator[Result]:
    """A curve of the kernel, measured; nothing when the kernel gives up."""
    start = time.perf_counter()
    try:
        made = make()
    except Exception:  # the kernel's errors share no base that is bound in every version
        return
    taken = time.perf_counter() - start
    spline = from_geom_curve(made)
    poles = len(spline.control_points)
    if parametric:
        yield Result(poles, at_equal_parameters(curve, spline.evaluate), taken)
    else:
        yield Result(poles, to_nearest(curve, BSpline(spline.flat_knots, spline.control_points, spline.degree)), taken)


def occt_points(curve: Curve, degree: int, tolerance: float) -> Iterator[Result]:
    """GeomAPI_PointsToBSpline with the true parameters."""
    api, c2 = kernel_module("GeomAPI"), kernel_module("GeomAbs").GeomAbs_Shape.GeomAbs_C2
    for count, tighter in product((15, 30, 60, 120, 240, 480), _TIGHTER):
        t = np.linspace(0, 1, count)
        points, parameters = point_array(spatial(curve.evaluate(t))), real_array(t)
        yield from _kernel_result(
            curve,
            lambda points=points, parameters=parameters, tighter=tighter: api.GeomAPI_PointsToBSpline(
                points, parameters, degree, degree, c2, tighter * tolerance
            ).Curve(),
            parametric=True,
        )


def occt_points_defaults(curve: Curve, degree: int, tolerance: float) -> Iterator[Result]:
    """Degree 3 to 8, C2, chord length: the constructor's own, with 50 points and the tolerance."""
    api = kernel_module("GeomAPI")
    points = point_array(spatial(curve.evaluate(np.linspace(0, 1, _DEFAULT_SAMPLES))))
    yield from _kernel_result(curve, lambda: api.GeomAPI_PointsToBSpline(points, Tol3D=tolerance).Curve())


def occt_approximation(curve: Curve, degree: int, tolerance: float) -> Iterator[Result]:
    """GeomConvert_ApproxCurve of a dense interpolant of degree 7; C2 needs degree 5, so C1 at degree 3."""
    from scipy.interpolate import make_interp_spline

    from gtcad.converters.bspline import BSplineCurve
    from gtcad.converters.occt.geometry import to_geom_curve

    shapes = kernel_module("GeomAbs").GeomAbs_Shape
    order = shapes.GeomAbs_C1 if degree == 3 else shapes.GeomAbs_C2
    t = np.linspace(0, 1, 400)
    dense = make_interp_spline(t, spatial(curve.evaluate(t)), 7)
    breaks, counts = np.unique(dense.t, return_counts=True)
    source = to_geom_curve(BSplineCurve(dense.c, breaks, counts.tolist(), 7))
    convert = kernel_module("GeomConvert")
    for tighter in (3.0, 1.0, 0.5):
        yield from _kernel_result(
            curve,
            lambda tighter=tighter: convert.GeomConvert_ApproxCurve(
                source, tighter * tolerance, order, 500, degree
            ).Curve(),
            parametric=True,
        )


def _edge_curve(edge: Any) -> Any:
    return kernel_module("BRep").BRep_Tool.Curve_s(edge.wrapped, 0.0, 1.0)


def build123d_approximation(curve: Curve, degree: int, tolerance: float) -> Iterator[Result]:
    from build123d import Edge

    for count, tighter in product((15, 30, 60, 120, 240), _TIGHTER):
        points = [tuple(row) for row in spatial(curve.evaluate(np.linspace(0, 1, count))).tolist()]
        yield from _kernel_result(
            curve,
            lambda points=points, tighter=tighter: _edge_curve(
                Edge.make_spline_approx(points, tighter * tolerance, min_deg=degree, max_deg=degree)
            ),
        )


def build123d_defaults(curve: Curve, degree: int, tolerance: float) -> Iterator[Result]:
    from build123d import Edge

    points = [tuple(row) for row in spatial(curve.evaluate(np.linspace(0, 1, _DEFAULT_SAMPLES))).tolist()]
    yield from _kernel_result(curve, lambda: _edge_curve(Edge.make_spline_approx(points, tolerance)))


def cadquery_defaults(curve: Curve, degree: int, tolerance: float) -> Iterator[Result]:
    from cadquery import Edge, Vector

    points = [Vector(*row) for row in spatial(curve.evaluate(np.linspace(0, 1, _DEFAULT_SAMPLES))).tolist()]
    yield from _kernel_result(curve, lambda: _edge_curve(Edge.makeSplineApprox(points, tolerance)))


def build123d_spline(curve: Curve, degree: int, tolerance: float) -> Iterator[Result]:
    """Interpolation (degree 3) with as many points as it takes, at equal steps of the parameter."""
    from build123d import Edge

    def build(poles: int) -> Result:
        points = [tuple(row) for row in spatial(curve.evaluate(np.linspace(0, 1, poles - 2))).tolist()]
        return next(_kernel_result(curve, lambda: _edge_curve(Edge.make_spline(points))))

    yield from _fewest(build, 5, tolerance, 400)


BEST = [
    Peer("scipy make_lsq_spline, uniform knots", scipy_least_squares, smooth=True),
    Peer("splipy least squares or interpolation", splipy_either, smooth=True),
    Peer("geomdl approximate_curve", geomdl_approximation, (3,), smooth=True, least_tolerance=1e-4, random=False),
    Peer("OCCT PointsToBSpline, true parameters", occt_points),
    Peer("OCCT GeomConvert_ApproxCurve", occt_approximation),
    Peer("build123d make_spline_approx, searched", build123d_approximation, least_tolerance=1e-4),
    Peer("build123d Spline (interpolation)", build123d_spline, (3,), smooth=True, least_tolerance=1e-4, random=False),
]
DEFAULTS = [
    Peer("OCCT PointsToBSpline", occt_points_defaults, (0,)),
    Peer("build123d make_spline_approx", build123d_defaults, (0,)),
    Peer("CadQuery makeSplineApprox", cadquery_defaults, (0,)),
    Peer("geomdl interpolate_curve, degree 3", geomdl_defaults, (3,)),
]
