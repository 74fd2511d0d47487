"""What an exchange file holds, held against a model: proved where it can be, estimated and called so where not.

Equal parameters bound the distance of the point sets from above, so they can prove a pass. They cannot prove a fail: a
shape fails when a sample of it, or of what the file holds, is farther than the tolerance from the other point set.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad import measure
from gtcad.converters.arcs import certify_arc, curve_of_arc
from gtcad.converters.bspline import BSplineCurve, BSplineSurface
from gtcad.converters.certificate import Certificate, certify_curve, certify_surface
from gtcad.converters.exact import IDENTITY, ParameterMap, exact_map
from gtcad.converters.nearest import PointSet, distances, grid, is_farther
from gtcad.converters.part import EllipseArc, Part, TrimmedFace
from gtcad.errors import InputError
from gtcad.protocol import Factors, SeparableCurve, SeparableSurface, Shape
from gtcad.restricted import RestrictedCurve, RestrictedSurface

Array = NDArray[np.float64]
Verdict = Literal["proved", "estimated", "failed", "missing", "invalid", "undecided"]

_SAMPLES = {1: 513, 2: 49}
_GUESS = {1: 17, 2: 9}
_SUSPECTS = 3
_AREA = 1e-5  # relative: what the kernel's area of a face may be off


@dataclass(frozen=True)
class Row:
    """What was found of one shape of the model.

    Attributes
    ----------
    name
        The shape's name in the model.
    verdict
        "proved": within the tolerance by a certificate; "estimated": within it on dense samples; "failed": a sample
        is farther than the tolerance from the other point set; "missing": the file holds no part for it; "invalid":
        the kernel calls the part invalid; "undecided": none of these could be settled.
    deviation
        (lower, upper) in mm: of a certificate when proved; twice the largest distance found when estimated or failed.
    method
        How the figure was had.
    remark
        What a reader should know besides.
    """

    name: str
    verdict: Verdict
    deviation: tuple[float, float] | None = None
    method: str = ""
    remark: str = ""


@dataclass(frozen=True)
class Report:
    """Rows in the order of the model, and the names of parts that no shape claims."""

    rows: tuple[Row, ...]
    extra: tuple[str, ...]


def check_parts(parts: Sequence[Part], shapes: Mapping[str, Shape], tolerance: float) -> Report:
    """Hold the parts of a file against the shapes of a model.

    Parameters
    ----------
    parts
        As read from the file, in mm.
    shapes
        By name, in mm.
    tolerance
        In mm, above 0.

    Returns
    -------
    Report
        One row for each shape. Shapes are matched by name; those left over by position among the parts left over, faces
        and edges apart.
    """
    if not tolerance > 0:
        raise InputError(f"tolerance must be above 0, got {tolerance}")
    matches = _matched(parts, shapes)
    rows = tuple(_row(name, shape, matches.get(name), tolerance) for name, shape in shapes.items())
    claimed = {id(part) for part in matches.values()}
    extra = tuple(part.name or f"no. {k + 1}" for k, part in enumerate(parts) if id(part) not in claimed)
    return Report(rows, extra)


def _matched(parts: Sequence[Part], shapes: Mapping[str, Shape]) -> dict[str, Part]:
    matches: dict[str, Part] = {}
    for part in parts:
        if part.name in shapes and part.name not in matches:
            matches[part.name] = part
    claimed = {id(part) for part in matches.values()}
    for wanted in (SeparableCurve, SeparableSurface):
        left = [part for part in parts if id(part) not in claimed and _is_curve(part) == (wanted is SeparableCurve)]
        names = [name for name, shape in shapes.items() if name not in matches and isinstance(shape, wanted)]
        matches.update(zip(names, left, strict=False))
    return matches


def _is_curve(part: Part) -> bool:
    return not isinstance(part.geometry, BSplineSurface)


def _row(name: str, shape: Shape, part: Part | None, tolerance: float) -> Row:
    if part is None:
        return Row(name, "missing")
    if isinstance(shape, SeparableCurve) != _is_curve(part):
        found, wanted = ("an edge", "a face") if _is_curve(part) else ("a face", "an edge")
        return Row(name, "missing", remark=f"the file holds {found} of this name, not {wanted}")
    if part.valid:
        row = _compared(name, shape if shape.dimension == 3 else shape.transformed(np.eye(3, 2)), part, tolerance)
    else:
        row = Row(name, "invalid", remark="the kernel calls it invalid")
    return row if part.name == name else replace(row, remark=_joined("matched by position", row.remark))


def _compared(name: str, shape: Shape, part: Part, tolerance: float) -> Row:
    if part.trimmed and isinstance(shape, SeparableSurface):
        if part.face is None:
            return Row(name, "undecided", remark="trimmed, and nothing is known of its boundary")
        return _estimated_trimmed(name, shape, part.face, tolerance)
    certificate, method, suspect = _proof(shape, part)
    if certificate.upper <= tolerance:
        return Row(name, "proved", (certificate.lower, certificate.upper), method)
    return _estimated(name, shape, part, tolerance, suspect)


def _joined(*remarks: str) -> str:
    return "; ".join(remark for remark in remarks if remark)


def _proof(shape: Shape, part: Part) -> tuple[Certificate, str, Array]:
    """The certificate under the correspondence that fits best, its name, and the shape's point where it is worst."""
    geometry = part.geometry
    if isinstance(shape, SeparableCurve):
        if isinstance(geometry, EllipseArc):
            ways = (shape, RestrictedCurve(shape, (1.0, 0.0)))
            curve = min(
                ways, key=lambda way: float(np.abs(way.evaluate(0.0) - geometry.evaluate(geometry.start)).max())
            )
            certificate, method = certify_arc(curve, geometry), "equal angles"
        else:
            assert isinstance(geometry, BSplineCurve)
            curve, parameter_map = min(_curve_ways(shape), key=lambda way: _gap_of_curves(way, geometry))
            certificate, method = certify_curve(curve, geometry, parameter_map=parameter_map), _method(parameter_map)
        return certificate, method, curve.evaluate(*certificate.place)
    assert isinstance(geometry, BSplineSurface)
    both = itertools.product(_surface_ways(shape), (geometry, geometry.transposed()))
    (surface, maps), spline = min(both, key=lambda way: _gap_of_surfaces(*way))
    certificate = certify_surface(surface, spline, parameter_maps=maps)
    return certificate, _method(*maps), surface.evaluate(*certificate.place)


def _method(*maps: ParameterMap) -> str:
    kinds = [parameter_map.kind for parameter_map in maps if parameter_map != IDENTITY]
    return f"exact form ({' and '.join(dict.fromkeys(kinds))})" if kinds else "equal parameters"


_CurveWay = tuple[SeparableCurve, ParameterMap]
_SurfaceWay = tuple[SeparableSurface, tuple[ParameterMap, ParameterMap]]


def _maps(factors: Factors) -> tuple[ParameterMap, ...]:
    own = exact_map(factors)
    return (IDENTITY,) if own is None or own == IDENTITY else (IDENTITY, own)


def _curve_ways(curve: SeparableCurve) -> Iterator[_CurveWay]:
    """The curve in both directions, under each of its parameter maps."""
    for way in (curve, RestrictedCurve(curve, (1.0, 0.0))):
        for parameter_map in _maps(way.factors):
            yield way, parameter_map


def _surface_ways(surface: SeparableSurface) -> Iterator[_SurfaceWay]:
    forward, backward = (0.0, 1.0), (1.0, 0.0)
    for u, v in itertools.product((forward, backward), repeat=2):
        way = surface if u == v == forward else RestrictedSurface(surface, (u, v))
        yield from ((way, maps) for maps in itertools.product(_maps(way.factors_u), _maps(way.factors_v)))


def _gap_of_curves(way: _CurveWay, spline: BSplineCurve) -> float:
    curve, parameter_map = way
    x = np.linspace(0.0, 1.0, _GUESS[1])
    return float(np.abs(curve.evaluate(parameter_map(x)) - spline.evaluate(_stretched(x, spline.knots))).max())


def _gap_of_surfaces(way: _SurfaceWay, spline: BSplineSurface) -> float:
    surface, maps = way
    x = np.linspace(0.0, 1.0, _GUESS[2])
    u, v = x[:, None], x[None, :]
    model = surface.evaluate(maps[0](u), maps[1](v))
    return float(np.abs(model - spline.evaluate(_stretched(u, spline.knots_u), _stretched(v, spline.knots_v))).max())


def _stretched(x: ArrayLike, knots: Array) -> Array:
    x = np.asarray(x, dtype=np.float64)
    return np.asarray(np.clip(knots[0] * (1 - x) + knots[-1] * x, knots[0], knots[-1]))


def _estimated(name: str, shape: Shape, part: Part, tolerance: float, suspect: Array) -> Row:
    """Nearest-point distances of dense samples, both ways.

    The suspect is a point of the shape that is sampled besides: where the certificate found it worst.
    """
    model, held = _point_set(shape), _point_set_of(part)
    samples = grid(model.variables, _SAMPLES[model.variables])
    directions = ((np.vstack([model.evaluate(samples), suspect]), held), (held.evaluate(samples), model))
    worst, verdict = 0.0, "estimated"
    for sources, target in directions:
        found = distances(sources, target)
        worst = max(worst, float(found.max()))
        for place in np.argsort(-found)[:_SUSPECTS]:
            if found[place] > tolerance and verdict != "failed":
                verdict = "failed" if is_farther(sources[place], tolerance, target) else "undecided"
    count = sum(len(sources) for sources, _ in directions)
    return Row(name, cast("Verdict", verdict), (worst, worst), f"nearest points of {count} samples")


def _estimated_trimmed(name: str, surface: SeparableSurface, face: TrimmedFace, tolerance: float) -> Row:
    """Distances of dense samples of the model from a face that is part of a surface, and a comparison of areas.

    Distances tell what the face lacks; what it has too much would show in its area.
    """
    samples = grid(2, _SAMPLES[2])
    found = float(face.distances(surface.evaluate(samples[:, 0], samples[:, 1])).max())
    remark = "trimmed in the file"
    wanted, allowed = measure.area(surface, rtol=1e-9), 2 * tolerance * _perimeter(surface)
    verdict: Verdict = "failed" if found > tolerance else "estimated"
    if verdict == "estimated" and abs(face.area - wanted) > allowed + _AREA * wanted:
        verdict = "undecided"
        remark = _joined(remark, f"its area is {face.area:.6g} mm^2, the model's {float(wanted):.6g} mm^2")
    return Row(name, verdict, (found, found), f"distances of {len(samples)} samples from the face", remark)


def _perimeter(surface: SeparableSurface) -> float:
    """Length of the boundary, as that of polygons."""
    line = np.linspace(0.0, 1.0, 257)
    sides = (surface.evaluate(*side) for side in ((line, 0.0), (line, 1.0), (0.0, line), (1.0, line)))
    return sum(float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum()) for points in sides)


def _point_set(shape: Shape) -> PointSet:
    if isinstance(shape, SeparableCurve):
        return PointSet.measured(1, lambda p: shape.evaluate(p[:, 0]), lambda p: shape.derivative(p[:, 0])[:, None])
    return PointSet.measured(
        2,
        lambda p: shape.evaluate(p[:, 0], p[:, 1]),
        lambda p: np.stack([shape.derivative(p[:, 0], p[:, 1], orders) for orders in ((1, 0), (0, 1))], axis=1),
    )


def _point_set_of(part: Part) -> PointSet:
    geometry = part.geometry
    if isinstance(geometry, EllipseArc):
        return _point_set(curve_of_arc(geometry))
    if isinstance(geometry, BSplineCurve):
        return PointSet.measured(
            1,
            lambda p: geometry.evaluate(_stretched(p[:, 0], geometry.knots)),
            lambda p: geometry.derivative(_stretched(p[:, 0], geometry.knots))[:, None] * np.ptp(geometry.knots),
        )
    lengths = np.array([np.ptp(geometry.knots_u), np.ptp(geometry.knots_v)])

    def places(p: Array) -> tuple[Array, Array]:
        return _stretched(p[:, 0], geometry.knots_u), _stretched(p[:, 1], geometry.knots_v)

    return PointSet.measured(
        2,
        lambda p: geometry.evaluate(*places(p)),
        lambda p: np.stack(geometry.derivatives(*places(p)), axis=1) * lengths[:, None],
    )
