"""Curves and surfaces of models and of files in one form, to be held against each other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gtcad import measure
from gtcad.chebyshev import UNIT_ROUNDOFF, gauss_legendre
from gtcad.composite import Composite
from gtcad.converters.arcs import curve_of_arc
from gtcad.converters.bspline import BSplineCurve, BSplineSurface
from gtcad.converters.nearest import SEARCHES, Nearest, PointSet, is_farther, lattice, nearest
from gtcad.converters.part import Built, EllipseArc, Part, TrimmedFace, Wire
from gtcad.converters.quadrics import Quadric, surface_of_quadric
from gtcad.converters.spline_parts import part_of_surface
from gtcad.protocol import SeparableCurve, SeparableSurface

Array = NDArray[np.float64]
Geometry = SeparableCurve | SeparableSurface | Composite | BSplineCurve | BSplineSurface

_LEAST, _MOST, _PER_SPAN = {1: 129, 2: 33}, {1: 2049, 2: 193}, 3
_SEEN = 1.0  # step of the samples: narrower spans are looked into besides
_MARKS = {1: 17, 2: 7}
_OUTLINE = 257
_AREA = 1e-5  # relative: what the kernel's area of a face may be off


@dataclass(frozen=True, eq=False)
class Figure:
    """A curve, a chain, or a surface with what it is trimmed to.

    Attributes
    ----------
    geometry
        In mm, in space.
    face
        Of surfaces that reach beyond their face: what the kernel knows of it.
    source
        What stood in the file, where it is an arc or a quadric.
    rounding
        How far, in mm, the geometry may be from what the file says because it was computed from that.
    """

    geometry: Geometry
    face: TrimmedFace | None = None
    source: EllipseArc | Quadric | None = None
    rounding: float = 0.0

    @property
    def variables(self) -> int:
        """1 for curves, 2 for surfaces."""
        return 1 if isinstance(self.geometry, SeparableCurve | Composite | BSplineCurve) else 2

    @property
    def is_chain(self) -> bool:
        """Whether it is a chain of curves."""
        return isinstance(self.geometry, Composite)

    @cached_property
    def points(self) -> PointSet:
        """All of the geometry over [0, 1] or its square."""
        return PointSet.measured(self.variables, *_functions(self.geometry), self.lines())

    def lines(self, least: int | None = None) -> tuple[int, ...]:
        """How many equal steps of samples in each direction see every span of a spline with equal spans."""
        least = least or _LEAST[self.variables]
        return tuple(max(least, min(_PER_SPAN * (len(x) - 1) + 1, _MOST[self.variables])) for x in self._breaks)

    def passed_by(self, lines: int) -> Array:
        """Parameters, shape (n, variables), in those spans that so many lines or more may pass by: their middles."""
        counts = self.lines(lines)
        equal = [np.linspace(0.0, 1.0, count) for count in counts]
        found = [np.empty((0, self.variables))]
        for axis, (breaks, count) in enumerate(zip(self._breaks, counts, strict=True)):
            narrow = np.diff(breaks) * (count - 1) < _SEEN
            middles = ((breaks[:-1] + breaks[1:]) / 2)[narrow]
            found.append(lattice(*(middles if k == axis else line for k, line in enumerate(equal))))
        return np.concatenate(found)

    @property
    def _breaks(self) -> tuple[Array, ...]:
        """In each direction what divides [0, 1] into spans."""
        match self.geometry:
            case BSplineCurve():
                return (_on_unit(self.geometry.knots),)
            case BSplineSurface():
                return _on_unit(self.geometry.knots_u), _on_unit(self.geometry.knots_v)
            case Composite():
                return (np.linspace(0.0, 1.0, 8 * len(self.geometry.pieces) + 1),)
            case _:
                return (np.array([0.0, 1.0]),) * self.variables

    @cached_property
    def marks(self) -> Array:
        """A few points, those of the boundary among them, shape (n, 3)."""
        if self.face is not None and self.face.region is not None:
            return self.face.region.sampled(_MARKS[2])
        count = _MARKS[self.variables] * (len(self.geometry.pieces) if isinstance(self.geometry, Composite) else 1)
        return self.points.evaluate(lattice(*[np.linspace(0.0, 1.0, count)] * self.variables))

    @cached_property
    def box(self) -> Array:
        """Least and largest coordinates of a grid of points, shape (2, 3)."""
        points = self.marks if self.face is not None else self.points.points
        return np.stack([points.min(axis=0), points.max(axis=0)])

    @property
    def size(self) -> float:
        """The diagonal of the box, in mm."""
        return float(np.linalg.norm(self.box[1] - self.box[0]))

    def sampled(self, lines: int) -> tuple[Array, Array | None]:
        """Points of the figure, (n, 3), and their parameters, (n, variables), where these are known."""
        if self.face is not None:
            assert self.face.region is not None
            return self.face.region.sampled(lines), None
        places = lattice(*(np.linspace(0.0, 1.0, count) for count in self.lines(lines)))
        return self.points.evaluate(places), places

    def nearest(self, points: Array, *, enough: float = 0.0, searches: int = SEARCHES) -> Nearest:
        """The nearest points of the figure that were found, what is cut away left out."""
        found, _ = self.nearest_inside(points, enough=enough, searches=searches)
        away = np.flatnonzero(~np.isfinite(found.distances))
        return self.with_feet(points, found, away) if len(away) else found

    def nearest_inside(self, points: Array, *, enough: float = 0.0, searches: int = SEARCHES) -> tuple[Nearest, Array]:
        """The same of all of the surface, infinitely far where that point is cut away; and how far it would be."""
        if self.face is None:
            found = nearest(points, self.points, enough=enough, searches=searches)
            return found, found.distances
        if self.face.region is None:
            unknown = np.full_like(points, np.nan)
            nowhere = Nearest(np.full(len(points), np.inf), unknown, unknown[:, : self.variables])
            return nowhere, np.zeros(len(points))
        found = nearest(points, self.points, enough=enough, searches=searches)
        inside = self.face.region.inside(self.own(found.places))
        unknown = np.where(inside[:, None], 1.0, np.nan)
        distances = np.where(inside, found.distances, np.inf)
        return Nearest(distances, unknown * found.points, unknown * found.places), found.distances

    def with_feet(self, points: Array, found: Nearest, which: NDArray[np.int_]) -> Nearest:
        """What was found, with the nearest points of the trimmed face for some of the points: the kernel's, slowly."""
        assert self.face is not None
        distances, feet, places = found.distances.copy(), found.points.copy(), found.places.copy()
        places[which] = np.nan
        if self.face.region is None:
            distances[which], feet[which] = self.face.distances(points[which]), np.nan
        else:
            feet[which] = self.face.region.feet(points[which])
            distances[which] = np.linalg.norm(feet[which] - points[which], axis=1)
        return Nearest(distances, feet, places)

    def is_farther(self, point: Array, length: float) -> bool | None:
        """Whether a point is farther than the length from every point of the figure; None when too close to call."""
        if self.face is not None:
            return bool(self.face.distances(point[None])[0] > length)
        return is_farther(point, length, self.points)

    def own(self, places: Array) -> Array:
        """The geometry's own parameters for those on [0, 1] or its square, shape (n, variables)."""
        match self.geometry:
            case BSplineCurve():
                return _stretched(places, (self.geometry.domain,))
            case BSplineSurface():
                return _stretched(places, self.geometry.domain)
            case Composite():
                return places * len(self.geometry.pieces)
            case _:
                return places

    @cached_property
    def area(self) -> float:
        """In mm^2, of surfaces: to about 1e-6 of it."""
        if self.face is not None:
            return self.face.area
        if isinstance(self.geometry, SeparableSurface):
            return float(measure.area(self.geometry, rtol=1e-9))
        assert isinstance(self.geometry, BSplineSurface)
        x, w = gauss_legendre(8)
        knots = self.geometry.knots_u, self.geometry.knots_v
        lines, weights = zip(*(_quadrature(one, x, w) for one in knots), strict=True)
        du, dv = self.geometry.derivatives(lines[0][:, None], lines[1][None, :])
        return float(weights[0] @ np.linalg.norm(np.cross(du, dv), axis=-1) @ weights[1])

    @cached_property
    def outline(self) -> float:
        """Length of the boundary of a surface, as that of polygons, in mm."""
        line = np.linspace(0.0, 1.0, _OUTLINE)
        total = 0.0
        for fixed in (0.0, 1.0):
            for axis in (0, 1):
                places = np.full((_OUTLINE, 2), fixed)
                places[:, axis] = line
                steps = np.diff(self.points.evaluate(places), axis=0)
                total += float(np.linalg.norm(steps, axis=1).sum())
        return total


def _quadrature(knots: Array, x: Array, w: Array) -> tuple[Array, Array]:
    half = np.diff(knots)[:, None] / 2
    return ((knots[:-1, None] + half) + half * x).reshape(-1), (half * w).reshape(-1)


def _on_unit(knots: Array) -> Array:
    return np.asarray((knots - knots[0]) / (knots[-1] - knots[0]))


def _stretched(places: Array, domain: tuple[tuple[float, float], ...]) -> Array:
    first, last = np.array(domain).T
    return np.asarray(np.clip(first * (1 - places) + last * places, first, last))


def _functions(geometry: Geometry) -> tuple[Callable[[Array], Array], Callable[[Array], Array]]:
    """Points and derivatives over [0, 1] or its square."""
    match geometry:
        case SeparableCurve():
            return lambda p: geometry.evaluate(p[:, 0]), lambda p: geometry.derivative(p[:, 0])[:, None]
        case Composite():
            count = len(geometry.pieces)
            return (
                lambda p: geometry.evaluate(count * p[:, 0]),
                lambda p: count * geometry.derivative(count * p[:, 0])[:, None],
            )
        case BSplineCurve():
            ends = (geometry.domain,)
            length = ends[0][1] - ends[0][0]
            return (
                lambda p: geometry.evaluate(_stretched(p, ends)[:, 0]),
                lambda p: length * geometry.derivative(_stretched(p, ends)[:, 0])[:, None],
            )
        case SeparableSurface():
            return (
                lambda p: geometry.evaluate(p[:, 0], p[:, 1]),
                lambda p: np.stack([geometry.derivative(p[:, 0], p[:, 1], (1 - k, k)) for k in (0, 1)], axis=1),
            )
    domain = geometry.domain
    lengths = np.array([last - first for first, last in domain])
    return (
        lambda p: geometry.evaluate(*_stretched(p, domain).T),
        lambda p: np.stack(geometry.derivatives(*_stretched(p, domain).T), axis=1) * lengths[:, None],
    )


@dataclass(frozen=True, eq=False)
class Piece:
    """A part of a file, and its number there."""

    index: int
    part: Part
    figure: Figure


def figure_of(shape: SeparableCurve | SeparableSurface | Composite) -> Figure:
    """A shape of a model, plane ones at z = 0."""
    return Figure(shape if shape.dimension == 3 else shape.transformed(np.eye(3, 2)))


def figure_of_part(part: Part) -> Figure:
    """A part of a file; a face that is a parameter rectangle of its surface is that part of it, untrimmed."""
    geometry = part.geometry
    assert not isinstance(geometry, Wire | Built)
    if isinstance(geometry, EllipseArc):
        return Figure(curve_of_arc(geometry), source=geometry)
    if isinstance(geometry, Quadric):
        surface = surface_of_quadric(geometry)
        # its coefficients are computed, each with a few roundings
        rounding = 16 * UNIT_ROUNDOFF * float(np.linalg.norm(surface.coefficients, axis=-1).sum())
        return Figure(surface, source=geometry, rounding=rounding)
    if isinstance(geometry, BSplineSurface) and part.trimmed:
        face = part.face or TrimmedFace(lambda points: np.full(len(points), np.nan), np.nan)
        if face.region is not None and face.region.rectangle is not None:
            spline, rounding = part_of_surface(geometry, face.region.rectangle)
            return Figure(spline, rounding=rounding)
        return Figure(geometry, face)
    return Figure(geometry)


def scaled(figure: Figure, factor: float) -> Figure:
    """The figure larger by a factor, untrimmed."""
    geometry = figure.geometry
    if isinstance(geometry, BSplineCurve | BSplineSurface):
        return Figure(replace(geometry, control_points=factor * geometry.control_points))
    return Figure(geometry.transformed(factor * np.eye(3)))


def areas_differ(figure: Figure, pieces: tuple[Figure, ...], tolerance: float) -> str:
    """What to say where the pieces have another area than the figure, beyond what the tolerance explains."""
    wanted, held = figure.area, sum(piece.area for piece in pieces)
    if abs(held - wanted) <= 2 * tolerance * figure.outline + _AREA * wanted:
        return ""
    return f"its area is {held:.6g} mm^2, the model's {wanted:.6g} mm^2"
