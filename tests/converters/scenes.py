"""Parts whose faces, curvatures and edges are known exactly, and outcomes made of them."""

from __future__ import annotations

from functools import cache

import numpy as np

from gtcad import BERNSTEIN, Surface
from gtcad.converters.bspline import BSplineCurve, BSplineSurface
from gtcad.converters.check import Report
from gtcad.converters.outcome import Outcome
from gtcad.converters.part import Part
from gtcad.converters.scene import Scene, scene_of_parts
from gtcad.converters.verdicts import Histogram, Row, Worst

ENVIRONMENT = {"gtcad": "0.1.0", "kernel": "OCCT 7.9.3", "file_sha256": "9f86d081884c7d65"}
TOLERANCE = 1e-3


def patch(origin, u, v, height: float = 0.0) -> Surface:
    """A biquadratic patch over a parallelogram, its middle raised by `height` / 4."""
    origin, u, v = (np.array(vector, dtype=float) for vector in (origin, u, v))
    t = np.array([0.0, 0.5, 1.0])
    points = origin + t[:, None, None] * u + t[None, :, None] * v
    up = np.cross(u / np.abs(u).max(), v / np.abs(v).max())
    points[1, 1] += height * up / np.linalg.norm(up)
    return Surface(points, family_u=BERNSTEIN, family_v=BERNSTEIN)


def spline(surface: Surface) -> BSplineSurface:
    """A Bezier patch as a spline of one span."""
    n, m = (count - 1 for count in surface.control_points.shape[:2])
    return BSplineSurface(surface.control_points, [0, 1], [n + 1] * 2, n, [0, 1], [m + 1] * 2, m)


def face(name: str, surface: Surface, **about) -> Part:
    return Part(name, spline(surface), source="B_SPLINE_SURFACE", **about)


def bent_curve() -> Part:
    points = [[0, 12, 1], [10, 17, 1], [20, 7, 3], [30, 12, 1]]
    return Part("wave", BSplineCurve(points, [0, 1], [4, 4], 3), source="B_SPLINE_CURVE")


def strip(count: int = 3, bump: float = 0.02) -> tuple[dict[str, Surface], list[Part]]:
    """A row of patches of 10 mm, and faces of which the second is raised in its middle by a quarter of `bump`."""
    shapes = {f"patch {k + 1}": patch([10 * k, 0, 0], [10, 0, 0], [0, 10, 0]) for k in range(count)}
    parts = [face(name, surface) for name, surface in shapes.items()]
    parts[1] = face("patch 2", patch([10, 0, 0], [10, 0, 0], [0, 10, 0], bump))
    return shapes, parts


@cache
def strip_outcome(count: int = 3, bump: float = 0.02, **changes) -> Outcome:
    """The strip with rows as a check gives them: the raised face failed."""
    shapes, parts = strip(count, bump)
    parts.append(bent_curve())
    rows = []
    for k, name in enumerate(shapes):
        high = abs(bump) / 4 if k == 1 else 0.0
        deviation = (high, high) if k == 1 else (0.0, 1e-9 * (count - k))
        worst = Worst((0.5, 0.5), (10.0 * k + 5, 5.0, 0.0), (0.0, 0.0, float(np.copysign(high, bump))))
        histogram = Histogram((0.0, 0.5, 1.0), (3 + k, 1))
        verdict = "failed" if k == 1 and high > TOLERANCE else "proved"
        rows.append(Row(name, verdict, deviation, "equal parameters", "", worst, histogram, (k,)))
    report = Report(tuple(rows), ("wave",))
    scene = scene_of_parts(parts, rows, shapes)
    return outcome(report=report, scene=scene, code=1, **changes)


def outcome(**changes) -> Outcome:
    fields = {
        "file": "folder/strip.step", "form": "STEP", "against": "models/strip.toml", "tolerance": TOLERANCE,
        "report": None, "readiness": None, "scene": None, "environment": ENVIRONMENT, "code": 0,
    }  # fmt: skip
    return Outcome(**{**fields, **changes})


def edges(scene: Scene) -> dict[str, int]:
    """How many edges there are of each order."""
    orders = [curve.continuity for curve in scene.curves if curve.kind == "edge"]
    return {order: orders.count(order) for order in sorted(set(orders))}
