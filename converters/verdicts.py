"""One curve or surface of a file held against one of a model: proved where it can be, estimated where not.

Equal parameters bound the distance of the point sets from above, so they can prove a pass. They cannot prove a fail: a
shape fails when a sample of it, or of what the file holds, is farther than the tolerance from the other point set.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Literal, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad import measure
from gtcad.converters.analytic import certify_quadric
from gtcad.converters.arcs import certify_arc, curve_of_arc
from gtcad.converters.bspline import BSplineCurve, BSplineSurface
from gtcad.converters.certificate import Certificate, certify_curve, certify_surface, deciding
from gtcad.converters.exact import IDENTITY, ParameterMap, exact_map
from gtcad.converters.nearest import PointSet, distances, grid, is_farther
from gtcad.converters.part import Built, EllipseArc, Part, TrimmedFace, Wire
from gtcad.converters.quadrics import Quadric, surface_of_quadric
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


def compared(name: str, shape: Shape, part: Part, tolerance: float) -> Row:
    """Hold a valid part against a shape in space, both in mm."""
    if part.trimmed and isinstance(shape, SeparableSurface):
        if part.face is None:
            return Row(name, "undecided", remark="trimmed, and nothing is known of its boundary")
        return _estimated_trimmed(name, shape, part.face, tolerance)
    certificate, method, suspect = _proof(shape, part, tolerance)
    if certificate.upper <= tolerance:
        return Row(name, "proved", (certificate.lower, certificate.upper), method)
    return _estimated(name, shape, part, tolerance, suspect)


def joined(*remarks: str) -> str:
    """Those remarks that are not empty, as one."""
    return "; ".join(remark for remark in remarks if remark)


def _proof(shape: Shape, part: Part, tolerance: float) -> tuple[Certificate, str, Array]:
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
            curve, parameter_map = min(curve_ways(shape), key=lambda way: _gap_of_curves(way, geometry))
            certify = partial(certify_curve, curve, geometry, parameter_map=parameter_map)
            certificate, method = deciding(certify, tolerance), method_of(parameter_map)
        return certificate, method, curve.evaluate(*certificate.place)
    if isinstance(geometry, Quadric):
        certificate = certify_quadric(shape, geometry)
        return certificate, "equal angles and lengths", shape.evaluate(*certificate.place)
    assert isinstance(geometry, BSplineSurface)
    both = itertools.product(_surface_ways(shape), (geometry, geometry.transposed()))
    (surface, maps), spline = min(both, key=lambda way: _gap_of_surfaces(*way))
    certificate = deciding(partial(certify_surface, surface, spline, parameter_maps=maps), tolerance)
    return certificate, method_of(*maps), surface.evaluate(*certificate.place)


def method_of(*maps: ParameterMap) -> str:
    """How parameters correspond, in words."""
    kinds = [parameter_map.kind for parameter_map in maps if parameter_map != IDENTITY]
    return f"exact form ({' and '.join(dict.fromkeys(kinds))})" if kinds else "equal parameters"


CurveWay = tuple[SeparableCurve, ParameterMap]
_SurfaceWay = tuple[SeparableSurface, tuple[ParameterMap, ParameterMap]]


def _maps(factors: Factors) -> tuple[ParameterMap, ...]:
    own = exact_map(factors)
    return (IDENTITY,) if own is None or own == IDENTITY else (IDENTITY, own)


def curve_ways(curve: SeparableCurve) -> Iterator[CurveWay]:
    """The curve in both directions, under each of its parameter maps."""
    for way in (curve, RestrictedCurve(curve, (1.0, 0.0))):
        for parameter_map in _maps(way.factors):
            yield way, parameter_map


def _surface_ways(surface: SeparableSurface) -> Iterator[_SurfaceWay]:
    forward, backward = (0.0, 1.0), (1.0, 0.0)
    for u, v in itertools.product((forward, backward), repeat=2):
        way = surface if u == v == forward else RestrictedSurface(surface, (u, v))
        yield from ((way, maps) for maps in itertools.product(_maps(way.factors_u), _maps(way.factors_v)))


def _gap_of_curves(way: CurveWay, spline: BSplineCurve) -> float:
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
        remark = joined(remark, f"its area is {face.area:.6g} mm^2, the model's {float(wanted):.6g} mm^2")
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
    assert not isinstance(geometry, Wire | Built)
    if isinstance(geometry, EllipseArc):
        return _point_set(curve_of_arc(geometry))
    if isinstance(geometry, Quadric):
        return _point_set(surface_of_quadric(geometry))
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
