"""Flat patterns as drawings: lines, arcs and cubic splines within a tolerance, and sheets of them side by side."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gtcad._flat_bends import BendLine
from gtcad._flat_places import Crossing
from gtcad.chebyshev import UNIT_ROUNDOFF
from gtcad.converters.arcs import certify_arc
from gtcad.converters.bspline import BSplineCurve
from gtcad.converters.fit import fit_curve
from gtcad.converters.flat_loops import check_holes, cut_at_holes, outline_loops
from gtcad.converters.part import EllipseArc
from gtcad.errors import InputError, ToleranceBelowPrecision
from gtcad.flat_curves import FlatCurve
from gtcad.flat_pattern import FlatPattern
from gtcad.flat_strip import FlatStrip
from gtcad.polynomial import Polynomials
from gtcad.protocol import SeparableCurve

Array = NDArray[np.float64]
Layout = FlatPattern | FlatStrip

_DEGREE = 3
_ROUND = 1e-9  # of the size: an arc or a line that is one up to rounding is drawn as such
_LARGEST = 1e4  # radius of an arc, in its lengths
_PER_ENTITY = 64


@dataclass(frozen=True, eq=False)
class Straight:
    """A line segment.

    Attributes
    ----------
    start, end
        Shape (2,), in mm.
    """

    start: Array
    end: Array

    @property
    def extremes(self) -> Array:
        """Points of which the box is that of the segment, shape (n, 2)."""
        return np.stack([self.start, self.end])

    def points(self, count: int) -> Array:
        """Points from the start to the end, shape (count, 2)."""
        t = np.linspace(0.0, 1.0, count)[:, None]
        return np.asarray((1 - t) * self.start + t * self.end)

    def moved(self, offset: Array) -> Straight:
        """The segment elsewhere."""
        return Straight(self.start + offset, self.end + offset)


@dataclass(frozen=True, eq=False)
class CircleArc:
    """An arc of a circle.

    Attributes
    ----------
    center
        Shape (2,), in mm.
    radius
        In mm.
    angle, sweep
        Where it starts, and how far it turns, counter-clockwise, in radians.
    """

    center: Array
    radius: float
    angle: float
    sweep: float

    @property
    def start(self) -> Array:
        """The first point."""
        return np.asarray(self.points(2)[0])

    @property
    def end(self) -> Array:
        """The last point."""
        return np.asarray(self.points(2)[1])

    @property
    def extremes(self) -> Array:
        """Points of which the box is that of the arc, shape (n, 2)."""
        low, high = sorted([self.angle, self.angle + self.sweep])
        quarters = np.arange(math.ceil(2 * low / math.pi), math.floor(2 * high / math.pi) + 1) * math.pi / 2
        return self._at(np.array([low, *quarters, high]))

    def points(self, count: int) -> Array:
        """Points from the start to the end, shape (count, 2)."""
        return self._at(self.angle + self.sweep * np.linspace(0.0, 1.0, count))

    def _at(self, angle: Array) -> Array:
        return np.asarray(self.center + self.radius * np.stack([np.cos(angle), np.sin(angle)], axis=1))

    def moved(self, offset: Array) -> CircleArc:
        """The arc elsewhere."""
        return replace(self, center=self.center + offset)


@dataclass(frozen=True, eq=False)
class Cubic:
    """A cubic B-spline.

    Attributes
    ----------
    spline
        Plane, in mm.
    """

    spline: BSplineCurve

    @property
    def start(self) -> Array:
        """The first point."""
        return np.asarray(self.spline.control_points[0])

    @property
    def end(self) -> Array:
        """The last point."""
        return np.asarray(self.spline.control_points[-1])

    @property
    def extremes(self) -> Array:
        """Points of which the box is that of the spline, shape (n, 2)."""
        a, b, c, d = np.moveaxis(bezier_spans(self.spline), 1, 0)
        second, first, rest = d - 3 * c + 3 * b - a, c - 2 * b + a, b - a  # of the derivative: zeros of a parabola
        root = np.sqrt(np.maximum(first**2 - second * rest, 0.0))
        q = -(first + np.where(first < 0, -root, root))
        with np.errstate(divide="ignore", invalid="ignore"):
            zeros = np.stack([q / second, rest / q])
        spans, widths = self.spline.knots[:-1, None], np.diff(self.spline.knots)[:, None]
        t = (spans + widths * np.where((zeros > 0) & (zeros < 1), zeros, 0.0)).reshape(-1)
        return self.spline.evaluate(np.append(t, 1.0))

    def points(self, count: int) -> Array:
        """Points from the start to the end, shape (count, 2)."""
        return self.spline.evaluate(np.linspace(0.0, 1.0, count))

    def moved(self, offset: Array) -> Cubic:
        """The spline elsewhere."""
        s = self.spline
        return Cubic(BSplineCurve(s.control_points + offset, s.knots, s.multiplicities, s.degree))


def bezier_spans(spline: BSplineCurve) -> Array:
    """The control points of the cubic on each span of a spline with continuous derivatives, shape (spans, 4, 2)."""
    points, slopes = spline.evaluate(spline.knots), spline.derivative(spline.knots)
    third = np.diff(spline.knots)[:, None] / 3
    return np.stack(
        [points[:-1], points[:-1] + third * slopes[:-1], points[1:] - third * slopes[1:], points[1:]], axis=1
    )


Entity = Straight | CircleArc | Cubic


@dataclass(frozen=True, eq=False)
class Path:
    """Entities end to end.

    Attributes
    ----------
    entities
        In their order.
    closed
        Whether the last one ends where the first one starts.
    deviation
        The largest distance of the entities from the curves of the pattern, in mm, proved; what the pattern's own
        curves are off by comes on top of it.
    """

    entities: tuple[Entity, ...]
    closed: bool
    deviation: float

    def moved(self, offset: Array) -> Path:
        """The path elsewhere."""
        return replace(self, entities=tuple(entity.moved(offset) for entity in self.entities))

    def points(self, count: int = _PER_ENTITY) -> Array:
        """Points along the path, that many on each entity."""
        return np.concatenate([entity.points(count) for entity in self.entities])

    @property
    def length(self) -> float:
        """The length of a fine polygon along the path."""
        points = self.points(1025)
        return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


@dataclass(frozen=True, eq=False)
class Sheet:
    """One flat pattern as it is drawn.

    Attributes
    ----------
    name
        For readers.
    cut
        Closed paths: the outline, of a plane ring also the inner one, then the holes.
    bend
        Where to bend; each line knows which parts of it lie in holes, and are not drawn.
    mark
        What to draw on the sheet.
    deviation
        The largest distance from the exact development, in mm: of the paths, proved, and of the pattern, estimated.
    overlap
        Where the pattern lies over itself, so that it cannot be cut from one sheet; None where it does not.
    """

    name: str
    cut: tuple[Path, ...]
    bend: tuple[BendLine, ...]
    mark: tuple[Path, ...]
    deviation: float
    overlap: Crossing | None

    @property
    def box(self) -> Array:
        """Least and largest coordinates of the outline, shape (2, 2)."""
        points = np.concatenate([entity.extremes for entity in self.cut[0].entities])
        return np.stack([points.min(axis=0), points.max(axis=0)])

    def moved(self, offset: Array) -> Sheet:
        """The sheet elsewhere."""
        x, y = offset.tolist()
        bend = tuple(
            replace(line, start=(line.start[0] + x, line.start[1] + y), end=(line.end[0] + x, line.end[1] + y))
            for line in self.bend
        )
        cut, mark = (tuple(path.moved(offset) for path in paths) for paths in (self.cut, self.mark))
        crossing = self.overlap and Crossing(
            (self.overlap.point[0] + x, self.overlap.point[1] + y), self.overlap.places
        )
        return replace(self, cut=cut, mark=mark, bend=bend, overlap=crossing)


def draw_pattern(
    pattern: Layout,
    *,
    tolerance: float,
    name: str = "pattern",
    bend_lines: int = 0,
    holes: Sequence[FlatCurve] = (),
    marks: Sequence[FlatCurve] = (),
) -> Sheet:
    """A flat pattern as lines, arcs and cubic splines.

    Parameters
    ----------
    pattern
        Of a patch or a strip, in mm.
    tolerance
        The largest distance allowed, in mm.
    name
        For readers of the drawing, of printable characters.
    bend_lines
        How many rulings to draw as bend lines, besides the creases of a strip: outside the holes, where the sheet is.
    holes
        Closed curves of the pattern, each from ``pattern.image``.
    marks
        Curves of the pattern.

    Raises
    ------
    InputError
        When the tolerance or the name is none, a hole is not closed or crosses itself, or holes cross or lie in each
        other though the pattern does not lie over itself.
    ToleranceNotMet, ToleranceBelowPrecision
        As ``fit_curve``; also when the pattern itself is not as good.
    """
    if not math.isfinite(tolerance) or tolerance <= 0:
        raise InputError(f"tolerance must be a finite number above 0, got {tolerance}")
    if not name.isprintable():
        raise InputError(f"name must consist of printable characters, got {name!r}")
    check_holes(holes, apart=pattern.overlap is None)
    off = max([pattern.error, *(curve.error for curve in (*holes, *marks))])
    if tolerance <= 2 * off:
        raise ToleranceBelowPrecision(tolerance, 2 * off)
    allowed = tolerance - off
    loops = [*outline_loops(pattern.contour), *((hole,) for hole in holes)]
    cut = [path_of(loop, allowed, closed=True) for loop in loops]
    mark = [path_of((curve,), allowed, closed=curve.closed) for curve in marks]
    deviation = max(path.deviation for path in (*cut, *mark)) + off
    bend = pattern.bend_lines(bend_lines) if isinstance(pattern, FlatStrip) or bend_lines else ()
    return Sheet(name, tuple(cut), cut_at_holes(bend, holes), tuple(mark), deviation, pattern.overlap)


def arranged(sheets: Sequence[Sheet], spacing: float = 10.0) -> tuple[Sheet, ...]:
    """Sheets beside each other from the origin to the right, the spacing between their boxes."""
    found, left = [], 0.0
    for sheet in sheets:
        low, high = sheet.box
        found.append(sheet.moved(np.array([left, 0.0]) - low))
        left += float(high[0] - low[0]) + spacing
    return tuple(found)


def path_of(curves: Sequence[FlatCurve], tolerance: float, *, closed: bool) -> Path:
    """Curves end to end as entities that share their ends bit for bit, arcs up to rounding."""
    pieces = [piece for curve in curves for piece in curve.pieces]
    starts = [piece.evaluate(0.0) for piece in pieces]
    ends = [*starts[1:], starts[0] if closed else pieces[-1].evaluate(1.0)]
    entities: list[Entity] = []
    worst = 0.0
    for piece, start, end in zip(pieces, starts, ends, strict=True):
        moved = float(np.linalg.norm(piece.evaluate(1.0) - end))
        entity, deviation = _entity(piece, start, end, tolerance - moved)
        entities.append(entity)
        worst = max(worst, deviation + moved)
    return Path(tuple(entities), closed, worst)


def _entity(curve: SeparableCurve, start: Array, end: Array, tolerance: float) -> tuple[Entity, float]:
    """A curve as the simplest entity, and the proved bound of its distance."""
    level = min(tolerance, _ROUND * float(np.linalg.norm(end - start)))
    aside = _from_chord(curve, start, end)
    if aside is not None and aside <= level:
        return Straight(start, end), aside
    arc = _arc(curve, start, end)
    if arc is not None:
        lifted = curve.transformed(np.eye(3, 2))
        deviation = certify_arc(lifted, _in_space(arc)).upper
        if deviation <= min(tolerance, _ROUND * arc.radius):
            return arc, deviation
    fit = fit_curve(curve, tolerance=tolerance, degree=_DEGREE, exact=False, end_order=1, adapt=False)
    poles = np.array(fit.spline.control_points)
    poles[0], poles[-1] = start, end
    snapped = float(max(np.linalg.norm(poles[k] - fit.spline.control_points[k]) for k in (0, -1)))
    spline = BSplineCurve(poles, fit.spline.knots, fit.spline.multiplicities, fit.spline.degree)
    return Cubic(spline), fit.deviation[1] + snapped


def _from_chord(curve: SeparableCurve, start: Array, end: Array) -> float | None:
    """A bound of the distance from the chord as a point set; None for a curve that is no line run through once."""
    chord = end - start
    length = float(np.linalg.norm(chord))
    if length == 0:
        return None
    along = chord / length
    aside = np.array([-along[1], along[0]])
    speed = curve.derivative(np.linspace(0.0, 1.0, 65)) @ along
    if speed.min() < 0:
        return None
    values = curve.coefficients @ aside
    if isinstance(curve.factors, Polynomials):
        series = values @ curve.factors.coefficients
        series[0] -= start @ aside
        return float(np.abs(series).sum()) + 64 * UNIT_ROUNDOFF * (length + float(np.abs(start).max()))
    return float(np.abs(values - start @ aside).max())


def _arc(curve: SeparableCurve, start: Array, end: Array) -> CircleArc | None:
    """The circle through three points of a curve, from the start on and with the sense and turns of the curve."""
    points = curve.evaluate(np.linspace(0.0, 1.0, 65))
    a, b = points[21] - start, points[43] - start
    area = 2 * float(a[0] * b[1] - a[1] * b[0])
    reach = max(float(np.linalg.norm(a)), float(np.linalg.norm(b)))
    if abs(area) < reach**2 / _LARGEST:
        return None
    offset = np.array([b[1] * (a @ a) - a[1] * (b @ b), a[0] * (b @ b) - b[0] * (a @ a)]) / area
    center, radius = start + offset, float(np.linalg.norm(offset))
    spokes = points - center
    if np.abs(np.linalg.norm(spokes, axis=1) - radius).max() > _ROUND * radius:
        return None
    turns = np.unwrap(np.arctan2(spokes[:, 1], spokes[:, 0]))
    sweep = float(turns[-1] - turns[0])
    if abs(sweep) > 2 * math.pi + _ROUND:
        return None
    return CircleArc(center, radius, float(turns[0]), sweep)


def _in_space(arc: CircleArc) -> EllipseArc:
    """The arc at z = 0, in its own sense."""
    sense = math.copysign(1.0, arc.sweep)
    cosine, sine = math.cos(arc.angle), math.sin(arc.angle)
    along = arc.radius * np.array([cosine, sine, 0.0])
    across = sense * arc.radius * np.array([-sine, cosine, 0.0])
    return EllipseArc([*arc.center, 0.0], along, across, 0.0, min(abs(arc.sweep), 2 * math.pi))
