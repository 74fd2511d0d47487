"""Curves and patches whose shape is known exactly, built by hand from their control points."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from gtcad.converters.bspline import BSplineCurve, BSplineSurface
from gtcad.converters.part import EllipseArc, Part

S = math.sqrt(0.5)
CIRCLE = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]], dtype=float)
CIRCLE_WEIGHTS = np.array([1, S, 1, S, 1, S, 1, S, 1])
CIRCLE_KNOTS = ([0, 0.25, 0.5, 0.75, 1], [3, 2, 2, 2, 3], 2)


def circle(radius: float = 5.0) -> BSplineCurve:
    return BSplineCurve(radius * CIRCLE, *CIRCLE_KNOTS, CIRCLE_WEIGHTS)


def swung(profile: np.ndarray, weights: np.ndarray, knots: tuple[list[float], list[int], int], turn: int = 9):
    """Revolution of a profile of (radius, height) about z; `turn` control points of the circle, 3 for a quarter."""
    around = CIRCLE[:turn]
    points = np.concatenate(
        [around[:, None, :] * profile[None, :, :1], np.broadcast_to(profile[:, 1:], (turn, len(profile), 1))], axis=-1
    )
    around_knots = CIRCLE_KNOTS if turn == 9 else ([0, 1], [3, 3], 2)
    return BSplineSurface(points, *around_knots, *knots, CIRCLE_WEIGHTS[:turn, None] * weights)


def cylinder(radius: float = 2.0, height: float = 3.0) -> BSplineSurface:
    return swung(np.array([[radius, 0], [radius, height]]), np.ones(2), ([0, 1], [2, 2], 1))


def sphere(radius: float = 2.0) -> BSplineSurface:
    arc = radius * np.array([[0, -1], [1, -1], [1, 0], [1, 1], [0, 1]], dtype=float)
    return swung(arc, CIRCLE_WEIGHTS[:5], ([0, 0.5, 1], [3, 2, 3], 2))


def hemisphere(radius: float = 2.0) -> BSplineSurface:
    arc = radius * np.array([[1, 0], [1, 1], [0, 1]], dtype=float)
    return swung(arc, CIRCLE_WEIGHTS[:3], ([0, 1], [3, 3], 2))


def octant(radius: float = 2.0) -> BSplineSurface:
    arc = radius * np.array([[1, 0], [1, 1], [0, 1]], dtype=float)
    return swung(arc, CIRCLE_WEIGHTS[:3], ([0, 1], [3, 3], 2), turn=3)


def torus(major: float = 5.0, minor: float = 2.0) -> BSplineSurface:
    return swung(CIRCLE * minor + [major, 0], CIRCLE_WEIGHTS, CIRCLE_KNOTS)


def swapped(surface: BSplineSurface) -> BSplineSurface:
    """The same patch with u and v exchanged."""
    s = surface
    weights = None if s.weights is None else s.weights.T
    return BSplineSurface(
        s.control_points.swapaxes(0, 1),
        *(s.knots_v, s.multiplicities_v, s.degree_v),
        *(s.knots_u, s.multiplicities_u, s.degree_u),
        weights,
    )


def greville(knots: list[float], multiplicities: list[int], degree: int) -> np.ndarray:
    flat = np.repeat(knots, multiplicities)
    return np.array([flat[i + 1 : i + degree + 1].mean() for i in range(len(flat) - degree - 1)])


def patch(seed: int = 0, degrees: tuple[int, int] = (3, 4), rational: bool = False, dimension: int = 3):
    """A wavy patch, rough unless its degree is so high that the kernel evaluates rough ones with too few digits."""
    rng = np.random.default_rng(seed)
    p, q = degrees
    knots_u, mu = [0, 1 / 3, 1], [p + 1, 1, p + 1]
    knots_v, mv = [0, 0.7, 1], [q + 1, max(1, q - 1), q + 1]
    u, v = np.meshgrid(greville(knots_u, mu, p), greville(knots_v, mv, q), indexing="ij")
    points = np.stack([10 * u, 12 * v, np.sin(3 * u + v + seed) * np.cos(4 * v)], axis=-1)[..., :dimension]
    if max(degrees) < 16:
        points += rng.normal(scale=0.1, size=points.shape)
    weights = rng.uniform(0.5, 1.5, u.shape) if rational else None
    return BSplineSurface(points, knots_u, mu, p, knots_v, mv, q, weights)


def curve(seed: int = 0, degree: int = 4, rational: bool = False, dimension: int = 3) -> BSplineCurve:
    rng = np.random.default_rng(seed)
    multiplicities = [degree + 1, max(1, degree - 1), degree + 1]
    count = sum(multiplicities) - degree - 1
    points = np.linspace(0, 20, count)[:, None] + rng.normal(size=(count, dimension))
    weights = rng.uniform(0.5, 1.5, count) if rational else None
    return BSplineCurve(points, [0, 1 / 3, 1], multiplicities, degree, weights)


def closed_curve(seed: int = 0, rational: bool = False) -> BSplineCurve:
    open_one = curve(seed, rational=rational)
    points = np.array(open_one.control_points)
    points[-1] = points[0]
    return BSplineCurve(points, open_one.knots, open_one.multiplicities, open_one.degree, open_one.weights)


def all_parts() -> list[Part]:
    """Every kind of geometry that a file may be asked to hold, edges and faces mixed, named and coloured."""
    return [
        Part("Kurve ä", curve(1), (0.2, 0.4, 0.6)),
        Part("面 with a long name, it's 😀 and \\ back", patch(1), (0.1, 0.5, 0.9)),
        Part("rational curve", curve(2, rational=True)),
        Part("rational patch", patch(2, (5, 2), rational=True), (1.0, 0.0, 0.0)),
        Part("", closed_curve(3)),
        Part("closed, unequal end weights", closed_curve(4, rational=True), (0.0, 0.0, 0.0)),
        Part("circle", circle(), (1.0, 1.0, 1.0)),
        Part("cylinder", cylinder(), (0.3, 0.3, 0.3)),
        Part("cylinder", swapped(cylinder())),
        Part("sphere", sphere(), (1 / 3, 2 / 3, 0.123456)),
        Part("hemisphere", hemisphere()),
        Part(" octant ", octant(), (0.0, 1.0, 0.0)),
        Part("torus", torus()),
        Part("arc", EllipseArc([1, 2, 3], [0, 2, 0], [0, 0, 2], 0.3, 1.7), (1.0, 0.0, 0.0)),
        Part("ellipse", EllipseArc([1, 2, 3], [0, 2, 0], [0, 0, 1], 0.3, 5.7), (0.0, 0.0, 1.0)),
        Part("upright ellipse", EllipseArc([1, 2, 3], [0, 1, 0], [0, 0, 2], 5.0, 7.7)),
        Part("full circle", EllipseArc([1, 2, 3], [0, 2, 0], [0, 0, 2], 0.3, 0.3 + 2 * math.pi)),
        Part("full ellipse", EllipseArc([1, 2, 3], [0, 2, 0], [0, 0, 1], 0.0, 2 * math.pi)),
        Part("plane curve", curve(5, dimension=2)),
        Part("plane patch", patch(5, dimension=2)),
        Part("degree 1", curve(6, degree=1)),
        Part("degree 25", curve(7, degree=25)),
    ]


def arrays(geometry: BSplineCurve | BSplineSurface) -> Iterator[np.ndarray]:
    """All that describes a spline, in space."""
    points = geometry.control_points
    yield np.concatenate([points, np.zeros((*points.shape[:-1], 3 - points.shape[-1]))], axis=-1)
    yield np.array([]) if geometry.weights is None else geometry.weights
    if isinstance(geometry, BSplineCurve):
        yield geometry.flat_knots
    else:
        yield geometry.flat_knots_u
        yield geometry.flat_knots_v


def same_bits(a: BSplineCurve | BSplineSurface, b: BSplineCurve | BSplineSurface) -> bool:
    return type(a) is type(b) and all(np.array_equal(x, y) for x, y in zip(arrays(a), arrays(b), strict=True))


def same_arc(a: EllipseArc, b: EllipseArc) -> bool:
    """Equal points at equal fractions of the arc, within rounding; the angles may be counted from another axis."""
    along = np.linspace(0, 1, 9)
    gap = a.evaluate(a.start + along * (a.end - a.start)) - b.evaluate(b.start + along * (b.end - b.start))
    return bool(np.abs(gap).max() < 1e-13)


def same(a: Part, b: Part) -> bool:
    if isinstance(a.geometry, EllipseArc):
        return isinstance(b.geometry, EllipseArc) and same_arc(a.geometry, b.geometry)
    return not isinstance(b.geometry, EllipseArc) and same_bits(a.geometry, b.geometry)


def area(surface: BSplineSurface, points: int = 12) -> float:
    """Area by Gauss quadrature on each knot rectangle, without the kernel; derivatives by complex-free differences."""
    nodes, weights = np.polynomial.legendre.leggauss(points)

    def rule(knots: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        half = np.diff(knots)[:, None] / 2
        return (knots[:-1, None] + half * (nodes + 1)).ravel(), (half * weights).ravel()

    (u, wu), (v, wv) = rule(surface.knots_u), rule(surface.knots_v)
    h = 1e-5
    du = (surface.evaluate((u + h)[:, None], v) - surface.evaluate((u - h)[:, None], v)) / (2 * h)
    dv = (surface.evaluate(u[:, None], v + h) - surface.evaluate(u[:, None], v - h)) / (2 * h)
    return float(wu @ np.linalg.norm(np.cross(du, dv), axis=-1) @ wv)
