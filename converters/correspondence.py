"""How the parameters of what a file holds correspond to those of a shape, and what that proves.

A file may hold all of a shape or a part of it, in either direction, with u and v exchanged, its parameters affine to
the shape's or to those of an exact form of it. Which part it is, nearest points tell about, and least squares exactly.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gtcad.composite import Composite
from gtcad.converters.analytic import certify_quadric
from gtcad.converters.bspline import BSplineCurve, BSplineSurface
from gtcad.converters.certificate import Certificate, certify_curve, certify_surface, deciding
from gtcad.converters.exact import IDENTITY, ParameterMap, exact_map
from gtcad.converters.figures import Figure, Geometry
from gtcad.converters.nearest import lattice
from gtcad.converters.part import EllipseArc
from gtcad.converters.quadrics import Quadric
from gtcad.converters.spline_difference import certify_splines
from gtcad.converters.spline_parts import part_of_curve, part_of_surface
from gtcad.factors import CurveOfTerms, RestrictedFactors, Stacked, SurfaceOfTerms
from gtcad.protocol import Factors, SeparableCurve, SeparableSurface
from gtcad.restricted import RestrictedCurve, RestrictedSurface

Array = NDArray[np.float64]
Bounds = tuple[float, float]

_FORWARD, _BACKWARD = (0.0, 1.0), (1.0, 0.0)
_GUESS = {1: np.linspace(0.0, 1.0, 17), 2: np.linspace(0.0, 1.0, 9)}
_INSIDE = {1: np.linspace(0.04, 0.96, 15), 2: np.linspace(0.04, 0.96, 7)}
_ROUNDS, _DIFFERENCE = 4, 1e-6
_LEAST = 1e-6  # of the domain: a part as small as this is none
_FORWARDS = {1: (_FORWARD,), 2: (_FORWARD, _FORWARD)}
_NEAR = 1e-3  # of the domain: how far the parameters that a piece keeps, or 0 and 1, may be from those found


@dataclass(frozen=True, eq=False)
class Way:
    """Where in a figure's domain, [0, 1] or its square, the parameters of a piece run.

    Attributes
    ----------
    figure, piece
        What the model has, and what the file holds of it.
    ranges
        First and last parameter of the figure, one pair for each of its directions; they may run backwards.
    transposed
        Whether the piece's u runs along the figure's v.
    maps
        The exact form whose parameter is affine to the piece's, one for each direction.
    """

    figure: Figure
    piece: Figure
    ranges: tuple[Bounds, ...]
    transposed: bool
    maps: tuple[ParameterMap, ...]

    def parameters(self, places: Array) -> Array:
        """The figure's parameters for those of the piece, exchanged if they must be, shape (n, variables)."""
        columns = [a + (b - a) * one(x) for (a, b), one, x in zip(self.ranges, self.maps, places.T, strict=True)]
        return np.clip(np.stack(columns, axis=1), 0.0, 1.0)

    def held(self, places: Array) -> Array:
        """Points of the piece at parameters in the figure's order."""
        return self.piece.points.evaluate(places[:, ::-1] if self.transposed else places)

    def differences(self, places: Array) -> Array:
        """From the figure to the piece at corresponding parameters, shape (n, 3)."""
        return self.held(places) - self.figure.points.evaluate(self.parameters(places))

    def gap(self, places: Array) -> float:
        """The largest length of these differences."""
        return float(np.linalg.norm(self.differences(places), axis=1).max())

    def over(self, ranges: tuple[Bounds, ...]) -> Way:
        """The same over other ranges."""
        maps = tuple(
            one if one.kind == "identity" else _own_map(factors, ends)
            for one, factors, ends in zip(self.maps, _factors(self.figure.geometry), ranges, strict=True)
        )
        return replace(self, ranges=ranges, maps=maps)

    @property
    def method(self) -> str:
        """How parameters correspond, in words."""
        if self.piece.source is not None:
            return "equal angles" if isinstance(self.piece.source, EllipseArc) else "equal angles and lengths"
        kinds = [one.kind for one in self.maps if one != IDENTITY]
        return f"exact form ({' and '.join(dict.fromkeys(kinds))})" if kinds else "equal parameters"

    def certificate(self, tolerance: float) -> Certificate:
        """What is proved of the distance of the two, its place in parameters of the figure."""
        whole = {tuple(sorted(ends)) for ends in self.ranges} == {_FORWARD}
        if whole and isinstance(self.piece.source, Quadric) and isinstance(self.figure.geometry, SeparableSurface):
            found = certify_quadric(self.figure.geometry, self.piece.source)
            return replace(found, upper=found.upper + self.piece.rounding)
        part, cutting = _part(self.figure.geometry, self.ranges)
        held = _transposed(self.piece.geometry) if self.transposed else self.piece.geometry
        found = deciding(partial(_certify, part, held, self.maps), tolerance)
        slack = cutting + self.piece.rounding + self.figure.rounding
        place = tuple(float(a + (b - a) * x) for (a, b), x in zip(self.ranges, found.place, strict=True))
        return Certificate(max(0.0, found.lower - slack), found.upper + slack, place)


def _part(geometry: Geometry, ranges: tuple[Bounds, ...]) -> tuple[Any, float]:
    """The part of a geometry over ranges of [0, 1], and its rounding."""
    assert not isinstance(geometry, Composite)
    if all(ends == _FORWARD for ends in ranges):
        return geometry, 0.0
    if isinstance(geometry, SeparableCurve):
        return RestrictedCurve(geometry, ranges[0]), 0.0
    if isinstance(geometry, SeparableSurface):
        return RestrictedSurface(geometry, (ranges[0], ranges[1])), 0.0
    if isinstance(geometry, BSplineCurve):
        return part_of_curve(geometry, _within(ranges[0], geometry.domain))
    u, v = geometry.domain
    return part_of_surface(geometry, (_within(ranges[0], u), _within(ranges[1], v)))


def _within(ends: Bounds, domain: Bounds) -> Bounds:
    first, last = (domain[0] * (1 - x) + domain[1] * x for x in ends)
    return first, last


def _transposed(geometry: Geometry) -> Geometry:
    if isinstance(geometry, BSplineSurface):
        return geometry.transposed()
    assert isinstance(geometry, SeparableSurface)
    return SurfaceOfTerms(geometry.factors_v, geometry.factors_u, geometry.coefficients.swapaxes(0, 1))


def _certify(part: Any, held: Any, maps: tuple[ParameterMap, ...], *, rtol: float) -> Certificate:
    """Of two geometries over their whole domains, at equal or mapped parameters."""
    if isinstance(part, BSplineCurve | BSplineSurface):
        if isinstance(held, BSplineCurve | BSplineSurface):
            return certify_splines(part, held, rtol=rtol)
        return _certify(held, part, maps, rtol=rtol)
    if isinstance(held, BSplineCurve):
        return certify_curve(part, held, parameter_map=maps[0], rtol=rtol)
    if isinstance(held, BSplineSurface):
        return certify_surface(part, held, parameter_maps=(maps[0], maps[1]), rtol=rtol)
    if isinstance(part, SeparableCurve):
        stacked = np.concatenate([part.coefficients, -held.coefficients])
        nothing = BSplineCurve(np.zeros((2, 3)), [0.0, 1.0], [2, 2], 1)
        return certify_curve(CurveOfTerms(Stacked((part.factors, held.factors)), stacked), nothing, rtol=rtol)
    terms = [(one.factors_u, one.factors_v, sign * one.coefficients) for one, sign in ((part, 1), (held, -1))]
    flat = BSplineSurface(np.zeros((2, 2, 3)), [0.0, 1.0], [2, 2], 1, [0.0, 1.0], [2, 2], 1)
    found = certify_surface(SurfaceOfTerms.summed(terms), flat, rtol=rtol)
    own = part.definition_error
    return Certificate(max(0.0, found.lower - own), found.upper + own, found.place)


# --- all of a shape ---------------------------------------------------------------------------------------------------


def whole_way(figure: Figure, piece: Figure) -> Way:
    """The way over all of a figure that fits best."""
    places = lattice(*[_GUESS[figure.variables]] * figure.variables)
    return min(_whole_ways(figure, piece), key=lambda way: way.gap(places))


def _whole_ways(figure: Figure, piece: Figure) -> Iterator[Way]:
    mappable = isinstance(piece.geometry, BSplineCurve | BSplineSurface)
    factors = _factors(figure.geometry)
    for ranges in itertools.product((_FORWARD, _BACKWARD), repeat=figure.variables):
        kinds = [_maps(one, ends) if mappable else (IDENTITY,) for one, ends in zip(factors, ranges, strict=True)]
        for maps in itertools.product(*kinds):
            for transposed in (False, True)[: figure.variables]:
                yield Way(figure, piece, ranges, transposed, maps)


def _factors(geometry: Geometry) -> tuple[Factors | None, ...]:
    if isinstance(geometry, SeparableCurve):
        return (geometry.factors,)
    if isinstance(geometry, SeparableSurface):
        return geometry.factors_u, geometry.factors_v
    return (None,) if isinstance(geometry, BSplineCurve | Composite) else (None, None)


def _maps(factors: Factors | None, ends: Bounds) -> tuple[ParameterMap, ...]:
    own = _own_map(factors, ends)
    return (IDENTITY,) if own == IDENTITY else (IDENTITY, own)


def _own_map(factors: Factors | None, ends: Bounds) -> ParameterMap:
    """That of the exact form of a part of the factors' domain; the identity where there is none."""
    if factors is None:
        return IDENTITY
    return exact_map(factors if ends == _FORWARD else RestrictedFactors(factors, *ends)) or IDENTITY


# --- parts of a shape -------------------------------------------------------------------------------------------------


def part_way(figure: Figure, piece: Figure, tolerance: float) -> Way | None:
    """The way over the part of a figure that a piece is; None where its parameters run otherwise.

    A piece may keep the parameters of the whole; if they do, within the tolerance, these are its ranges.
    """
    if piece.face is not None or figure.face is not None or isinstance(figure.geometry, Composite):
        return None
    places = lattice(*[_INSIDE[figure.variables]] * figure.variables)
    found = figure.nearest(piece.points.evaluate(places), searches=1)
    if found.distances.max() > 4 * tolerance:
        return None
    ways = (_fitted(figure, piece, places, found.places, kinds) for kinds in _kinds(figure, piece))
    near = [way for way in ways if way is not None]
    if not near:
        return None
    best = min(near, key=lambda way: way.gap(places))
    if best.gap(places) > 4 * tolerance:
        return None
    kept = best.over(_kept(best))
    return kept if kept.gap(places) <= best.gap(places) + tolerance / 4 else best


def _kinds(figure: Figure, piece: Figure) -> Iterator[tuple[bool, ...]]:
    """For each direction whether the exact form's parameter is meant."""
    mappable = isinstance(piece.geometry, BSplineCurve | BSplineSurface)
    has = [
        (False, True) if mappable and len(_maps(one, _FORWARD)) > 1 else (False,) for one in _factors(figure.geometry)
    ]
    return itertools.product(*has)


def _fitted(figure: Figure, piece: Figure, places: Array, feet: Array, kinds: tuple[bool, ...]) -> Way | None:
    """The ranges by least squares: of parameters for a start, then of points."""
    maps = [
        _own_map(one, _FORWARD) if kind else IDENTITY
        for one, kind in zip(_factors(figure.geometry), kinds, strict=True)
    ]
    x = np.column_stack([np.ones(len(places)), places])
    forms = np.stack([one.inverse(column) for one, column in zip(maps, feet.T, strict=True)], axis=1)
    slopes = np.linalg.lstsq(x, forms, rcond=None)[0]  # (1 + variables, variables)
    transposed = figure.variables == 2 and abs(slopes[1, 0] * slopes[2, 1]) < abs(slopes[2, 0] * slopes[1, 1])
    order = [1, 0] if transposed else [0, 1]
    ranges = []
    for k in range(figure.variables):
        ends = np.clip([slopes[0, k], slopes[0, k] + slopes[1 + order[k], k]], 0.0, 1.0)
        first, last = (float(end) for end in maps[k](ends))
        if abs(last - first) < _LEAST:
            return None
        ranges.append((first, last))
    start = Way(figure, piece, _FORWARDS[figure.variables], transposed, tuple(maps))
    return _refined(start, tuple(ranges), places[:, ::-1] if transposed else places)


def _refined(way: Way, ranges: tuple[Bounds, ...], places: Array) -> Way:
    """Gauss-Newton on the sum of the squared differences, with difference quotients by the ends of the ranges."""

    def residuals(ends: Array) -> Array:
        return way.over(_pairs(ends)).differences(places).reshape(-1)

    ends = np.array(ranges).reshape(-1)
    best = residuals(ends)
    for _ in range(_ROUNDS):
        steps = np.where(ends > 0.5, -_DIFFERENCE, _DIFFERENCE)
        matrix = np.stack(
            [
                (residuals(ends + step * unit) - best) / step
                for step, unit in zip(steps, np.eye(len(ends)), strict=True)
            ],
            axis=1,
        )
        trial = np.clip(ends - np.linalg.lstsq(matrix, best, rcond=None)[0], 0.0, 1.0)
        if np.abs(trial.reshape(-1, 2) @ [-1.0, 1.0]).min() < _LEAST:
            break
        found = residuals(trial)
        if found @ found >= best @ best:
            break
        ends, best = trial, found
    return way.over(_pairs(ends))


def _pairs(ends: Array) -> tuple[Bounds, ...]:
    return tuple((float(a), float(b)) for a, b in ends.reshape(-1, 2))


def _kept(way: Way) -> tuple[Bounds, ...]:
    """The piece's own parameters, where they lie in [0, 1] and near the ranges; else 0 or 1 where the range is near."""
    geometry = way.piece.geometry
    domain: tuple[Bounds, ...] = _FORWARDS[way.figure.variables]
    if isinstance(geometry, BSplineCurve):
        domain = (geometry.domain,)
    elif isinstance(geometry, BSplineSurface):
        domain = geometry.domain[::-1] if way.transposed else geometry.domain
    kept: list[Bounds] = []
    for ends, own in zip(way.ranges, domain, strict=True):
        first, last = (_best(x, own) for x in ends)
        kept.append((first, last) if abs(first - last) >= _LEAST else ends)
    return tuple(kept)


def _best(x: float, own: Bounds) -> float:
    """What serves for an end of a range: 0 or 1, or one of the piece's own, if near; else itself."""
    near = [y for y in (0.0, 1.0, *own) if 0.0 <= y <= 1.0 and abs(x - y) <= _NEAR]
    return min(near, key=lambda y: abs(x - y), default=x)


# --- several pieces ---------------------------------------------------------------------------------------------------


def common_ranges(ways: list[Way], slack: Callable[[int], float]) -> list[Way]:
    """The ways with ends that nearly coincide made equal: 0 and 1 first, then the mean of those together.

    The slack tells, for each direction, how near ends must be, in parameters.
    """
    ranges = [list(map(list, way.ranges)) for way in ways]
    for axis in range(ways[0].figure.variables):
        values = np.array([way.ranges[axis] for way in ways])
        snapped = _snapped(values.reshape(-1), slack(axis)).reshape(values.shape)
        for k in range(len(ways)):
            ranges[k][axis] = snapped[k].tolist()
    return [
        way.over(tuple((a, b) for a, b in own)) if own != [list(ends) for ends in way.ranges] else way
        for way, own in zip(ways, ranges, strict=True)
    ]


def _snapped(values: Array, slack: float) -> Array:
    order = np.argsort(values)
    groups = np.split(order, np.flatnonzero(np.diff(values[order]) > slack) + 1)
    result = values.copy()
    for group in groups:
        mean = float(values[group].mean())
        near = [end for end in (0.0, 1.0) if abs(mean - end) <= slack]
        result[group] = near[0] if near else (mean if np.ptp(values[group]) > 0 else values[group[0]])
    return result


def covers(ways: list[Way]) -> bool:
    """Whether the ranges together leave out nothing of the figure's domain."""
    boxes = np.array([[sorted(ends) for ends in way.ranges] for way in ways])  # (pieces, variables, 2)
    lines = [np.unique(np.concatenate([[0.0, 1.0], boxes[:, axis].reshape(-1)])) for axis in range(boxes.shape[1])]
    middles = lattice(*((line[:-1] + line[1:]) / 2 for line in lines))
    inside = (boxes[:, None, :, 0] < middles) & (middles < boxes[:, None, :, 1])
    return bool(inside.all(axis=2).any(axis=0).all())
