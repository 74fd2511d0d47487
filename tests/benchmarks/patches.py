"""Patches beside other libraries, and what their poles cost downstream: files, cuts and sections."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import BSpline, make_lsq_spline
from scipy.spatial import cKDTree

from gtcad import Surface
from gtcad.converters import fit_surface
from gtcad.converters.bspline import BSplineSurface
from gtcad.converters.occt import topology
from gtcad.converters.occt.compat import kernel_module, point_array
from gtcad.converters.occt.geometry import from_geom_surface
from gtcad.converters.part import Part
from gtcad.converters.step import write_step
from tests import pieces
from tests.benchmarks.peers import uniform_knots
from tests.benchmarks.timing import median, table
from tests.benchmarks.workload import DEGREES, TOLERANCES, samples

_MOST = 60
_SECONDS = 4.0  # for one peer, patch and tolerance
Grid = np.ndarray


def run() -> str:
    """The tables of this part."""
    return "\n\n".join(["## Patches beside others", _poles(), "## Downstream", _downstream()])


def _true_deviation(surface: Surface, spline: BSplineSurface) -> float:
    line = np.linspace(0, 1, 301)
    gap = surface.evaluate(line[:, None], line) - spline.evaluate(line[:, None], line)
    return float(np.linalg.norm(gap, axis=-1).max())


def _to_nearest(surface: Surface, spline: BSplineSurface) -> float:
    """Largest distance of 31 x 31 points from the spline, whatever its parameters: kind to the spline."""
    line = np.linspace(0, 1, 31)
    points = surface.evaluate(line[:, None], line).reshape(-1, 3)
    (u0, u1), (v0, v1) = ((knots[0], knots[-1]) for knots in (spline.knots_u, spline.knots_v))
    grid_u, grid_v = np.linspace(u0, u1, 301), np.linspace(v0, v1, 301)
    found = cKDTree(spline.evaluate(grid_u[:, None], grid_v).reshape(-1, 3)).query(points)[1]
    u, v = grid_u[found // 301], grid_v[found % 301]
    step_u, step_v = 1e-6 * (u1 - u0), 1e-6 * (v1 - v0)
    for _ in range(6):
        left, low = np.maximum(u - step_u, u0), np.maximum(v - step_v, v0)
        right, high = np.minimum(u + step_u, u1), np.minimum(v + step_v, v1)
        along_u = (spline.evaluate(right, v) - spline.evaluate(left, v)) / (right - left)[:, None]
        along_v = (spline.evaluate(u, high) - spline.evaluate(u, low)) / (high - low)[:, None]
        frame = np.stack([along_u, along_v], axis=2)
        move = np.einsum("kij,kj->ki", np.linalg.pinv(frame), points - spline.evaluate(u, v))
        u, v = np.clip(u + move[:, 0], u0, u1), np.clip(v + move[:, 1], v0, v1)
    return float(np.linalg.norm(spline.evaluate(u, v) - points, axis=1).max())


def least_squares(surface: Surface, degree: int, tolerance: float) -> BSplineSurface | None:
    """Tensor least squares with uniform knots at the true parameters: the least product of poles that keeps it."""
    t, best = samples(200), None
    data = surface.evaluate(t[:, None], t)
    along_u = {}
    for n in range(degree + 1, _MOST):
        along_u[n] = make_lsq_spline(t, data, uniform_knots(degree, n), degree).c
    order = sorted(product(along_u, along_u), key=lambda pair: pair[0] * pair[1])
    line = np.linspace(0, 1, 101)
    exact = surface.evaluate(line[:, None], line)
    alone = {n: _directional(line, exact, along_u[n], t, degree, n) for n in along_u}
    turned = data.swapaxes(0, 1)
    alone_v = {}
    for n in along_u:
        rows = make_lsq_spline(t, turned, uniform_knots(degree, n), degree).c
        alone_v[n] = _directional(line, exact.swapaxes(0, 1), rows, t, degree, n)
    for n, m in order:
        if max(alone[n], alone_v[m]) > tolerance:
            continue
        poles = make_lsq_spline(t, along_u[n].swapaxes(0, 1), uniform_knots(degree, m), degree).c.swapaxes(0, 1)
        best = _spline(poles, degree)
        if _true_deviation(surface, best) <= tolerance:
            return best
    return None


def _directional(line: Grid, exact: Grid, rows: Grid, t: Grid, degree: int, n: int) -> float:
    """A bit less than the error of one direction alone, which no choice of the other one repairs."""
    across = make_lsq_spline(t, rows.swapaxes(0, 1), uniform_knots(11, 40), 11)(line).swapaxes(0, 1)
    gap = BSpline(uniform_knots(degree, n), across, degree)(line) - exact
    return 0.7 * float(np.linalg.norm(gap, axis=-1).max())


def _spline(poles: Grid, degree: int) -> BSplineSurface:
    directions = []
    for count in poles.shape[:2]:
        breaks = np.linspace(0, 1, count - degree + 1)
        directions += [breaks, [degree + 1] + [1] * (len(breaks) - 2) + [degree + 1], degree]
    return BSplineSurface(poles, *directions)


def _occt(surface: Surface, tolerance: float, degrees: tuple[int, int], counts: tuple[int, ...]) -> Any:
    """GeomAPI_PointsToBSplineSurface: the fewest poles of several numbers of points and tolerances."""
    api, c2 = kernel_module("GeomAPI"), kernel_module("GeomAbs").GeomAbs_Shape.GeomAbs_C2

    def make(points: Grid, asked: float) -> Any:
        return api.GeomAPI_PointsToBSplineSurface(point_array(points), *degrees, c2, asked).Surface()

    return _searched(surface, tolerance, counts, make)


def _build123d(surface: Surface, tolerance: float, counts: tuple[int, ...]) -> Any:
    from build123d import Face, Vector

    def make(points: Grid, asked: float) -> Any:
        rows = [[Vector(*point) for point in row] for row in points.tolist()]
        return kernel_module("BRep").BRep_Tool.Surface_s(Face.make_surface_from_array_of_points(rows, asked).wrapped)

    return _searched(surface, tolerance, counts, make)


def _searched(surface: Surface, tolerance: float, counts: tuple[int, ...], make: Callable[[Grid, float], Any]) -> Any:
    best, end = None, time.perf_counter() + _SECONDS
    for count, tighter in product(counts, (1.0, 0.1) if len(counts) > 1 else (1.0,)):
        if time.perf_counter() > end:
            break
        line = np.linspace(0, 1, count)
        try:
            spline = from_geom_surface(make(surface.evaluate(line[:, None], line), tighter * tolerance))
        except Exception:  # the kernel's errors share no base that is bound in every version
            continue
        fewer = best is None or np.prod(spline.control_points.shape[:2]) < np.prod(best.control_points.shape[:2])
        if fewer and _to_nearest(surface, spline) <= tolerance:
            best = spline
    return best


def _own(surface: Surface, degree: int | str, tolerance: float, adapt: bool) -> BSplineSurface:
    return fit_surface(surface, tolerance=tolerance, degree=degree, adapt=adapt).spline


def _poles() -> str:
    methods: list[tuple[str, str, Callable[[Surface, float], Any]]] = []
    for degree in (*DEGREES, "auto"):
        for adapt in (True, False):
            name = f"**gtcad**, {'adapted' if adapt else 'cached'}"
            methods.append((name, str(degree), lambda s, tol, d=degree, a=adapt: _own(s, d, tol, a)))
    for degree in DEGREES:
        name = "tensor least squares (scipy), uniform knots"
        methods.append((name, str(degree), lambda s, tol, d=degree: least_squares(s, d, tol)))
    several = (10, 15, 20, 30)
    for degree in (5, 8):
        name = "OCCT PointsToBSplineSurface, searched"
        methods.append((name, f"<= {degree}", lambda s, tol, d=degree: _occt(s, tol, (3, d), several)))
    methods.append(("OCCT PointsToBSplineSurface, defaults, 20 x 20", "<= 8", lambda s, t: _occt(s, t, (3, 8), (20,))))
    methods.append(("build123d from array of points, searched", "<= 3", lambda s, t: _build123d(s, t, several)))
    methods.append(("build123d from array of points, defaults, 20 x 20", "<= 3", lambda s, t: _build123d(s, t, (20,))))
    counts, deviations = [], []
    for name, degree, method in methods:
        found = {tol: [_timed(method, surface, tol) for surface in pieces.surfaces().values()] for tol in TOLERANCES}
        missed = f"over {_MOST - 1}" if name.startswith("tensor") else "misses"
        counts.append([name, degree])
        deviations.append([name, degree])
        measure = _to_nearest if name.startswith(("OCCT", "build123d")) else _true_deviation
        for tolerance, results in found.items():
            counts[-1].append(" / ".join(_size(spline) if spline else missed for spline, _ in results))
            shares = [
                f"{measure(surface, spline) / tolerance:.2f}" if spline else "-"
                for surface, (spline, _) in zip(pieces.surfaces().values(), results, strict=True)
            ]
            deviations[-1].append(" / ".join(shares))
            deviations[-1].append(" / ".join(f"{1e3 * taken:.0f}" if spline else "-" for spline, taken in results))
    names = " / ".join(pieces.surfaces())
    first = table(["method", "degree", *(f"{tol:.0e}: {names}" for tol in TOLERANCES)], counts)
    columns = [f"{tol:.0e}: {what}" for tol in TOLERANCES for what in ("deviation / tolerance", "ms")]
    heading = "### True deviation and time (the whole search, for those that were searched)"
    return "\n\n".join([first, heading, table(["method", "degree", *columns], deviations)])


def _timed(method: Callable[[Surface, float], Any], surface: Surface, tolerance: float) -> tuple[Any, float]:
    start = time.perf_counter()
    spline = method(surface, tolerance)
    return spline, time.perf_counter() - start


def _size(spline: BSplineSurface) -> str:
    return "x".join(map(str, spline.control_points.shape[:2]))


def _downstream() -> str:
    surface, rows = pieces.surfaces()["S54"], []
    for tolerance, degree in product((1e-4, 1e-6), (3, 5, 7, "auto")):
        fit = fit_surface(surface, tolerance=tolerance, degree=degree)
        rows.append([f"{tolerance:.0e}", f"gtcad, {degree}", *_costs(fit.spline)])
        if degree != "auto" and (spline := least_squares(surface, degree, tolerance)) is not None:
            rows.append([f"{tolerance:.0e}", f"tensor least squares, {degree}", *_costs(spline)])
    header = [
        "tolerance, mm",
        "S54 by, degree",
        "poles",
        "STEP, kB",
        "STEP, ms",
        "cylinder cut, ms",
        "plane section, ms",
    ]
    return table(header, rows)


def _costs(spline: BSplineSurface) -> list[str]:
    face = topology.make_face(spline)
    gp = kernel_module("gp")
    centre = spline.control_points.reshape(-1, 3).mean(axis=0)
    size = float(np.ptp(spline.control_points.reshape(-1, 3), axis=0).max())
    low = gp.gp_Ax2(gp.gp_Pnt(*(centre - [0, 0, size]).tolist()), gp.gp_Dir(0, 0, 1))
    cylinder = kernel_module("BRepPrimAPI").BRepPrimAPI_MakeCylinder(low, 0.2 * size, 2 * size).Shape()
    plane = gp.gp_Pln(gp.gp_Pnt(*centre.tolist()), gp.gp_Dir(1, 0.3, 0.2))
    operations = kernel_module("BRepAlgoAPI")
    cut = median(lambda: operations.BRepAlgoAPI_Cut(face, cylinder).Shape(), repeats=3)
    section = median(lambda: operations.BRepAlgoAPI_Section(face, plane).Shape(), repeats=3)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "patch.step"
        taken = median(lambda: write_step(path, [Part("patch", spline)]), repeats=3)
        size_in_file = path.stat().st_size
    figures = f"{size_in_file / 1e3:.0f}", f"{1e3 * taken:.0f}", f"{1e3 * cut:.0f}", f"{1e3 * section:.0f}"
    return [_size(spline), *figures]
