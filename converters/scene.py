"""What a file holds as triangles and lines that can be drawn: plain arrays, free of kernel objects."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtcad._entries import ModelShape
from gtcad.combs import comb
from gtcad.converters.arcs import curve_of_arc
from gtcad.converters.bspline import BSplineCurve, BSplineSurface
from gtcad.converters.deviations import signed_distances
from gtcad.converters.part import EllipseArc, Facets, Geometry, Part, Side
from gtcad.converters.quadrics import Quadric, surface_of_quadric
from gtcad.converters.scene_edges import SceneCurve, shared_edges
from gtcad.differential import ParametricSurface, normal, principal_curvatures
from gtcad.errors import InputError, KernelError
from gtcad.protocol import SeparableSurface
from gtcad.quilt import Quilt
from gtcad.solid import Solid

if TYPE_CHECKING:
    from gtcad.converters.verdicts import Row

__all__ = ["Scene", "SceneCurve", "SceneFace", "scene_of_parts"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

_MOST_VERTICES = 60_000  # of all faces together
_LEAST, _MOST = 25, 61  # lines in each direction of an untrimmed face
_TURN = math.radians(3.0)  # between neighbouring lines
_PER_SPAN = 8  # lines on each span of a spline: deviations change sign within it
_ALONG = 97  # points along a side
_TEETH = 120


@dataclass(frozen=True, eq=False)
class SceneFace:
    """One face.

    Attributes
    ----------
    name
        As in the file, or "no. k" by its place there.
    vertices, normals
        Corners in mm and the face's unit normals there, each (n, 3).
    triangles
        Three corners each, counterclockwise seen from where the normals point, shape (m, 3).
    values
        At the corners, shape (n,), NaN where unknown: "deviation", the distance in mm from the shapes of the model that
        the face stands for, positive on the side of the face's normal; "mean" and "gaussian" curvature in 1/mm and
        1/mm^2, the mean one positive where the face bends towards its normal.
    net
        The lines of the control net, shape (k, 3) each.
    part, number
        Its place among the parts, from 0, and among the faces, from 1.
    facts
        What the face is: "source", "degree", "poles", "rational", "trimmed", "valid".
    """

    name: str
    vertices: Array
    triangles: Indices
    normals: Array
    values: Mapping[str, Array]
    net: tuple[Array, ...] = ()
    part: int = -1
    number: int = 0
    facts: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Scene:
    """Faces, their edges and the free curves of a file."""

    faces: tuple[SceneFace, ...]
    curves: tuple[SceneCurve, ...]


def scene_of_parts(
    parts: Sequence[Part],
    rows: Sequence[Row] = (),
    shapes: Mapping[str, ModelShape] | None = None,
    *,
    others: Sequence[Part] = (),
) -> Scene:
    """What is to be drawn of the parts of a file.

    Parameters
    ----------
    parts
        As read from the file, in mm.
    rows
        Of the check of these parts: they say which shape a face stands for.
    shapes
        Of the model, in mm; without them, and without others, deviations are NaN.
    others
        Of another file that these parts were compared with: one for each row. A trimmed one stands for its surface.

    Returns
    -------
    Scene
        For the eye: at most about 60 000 corners in all, deviations and orders of edges from samples. Faces that the
        kernel cannot divide are left out.
    """
    with np.errstate(all="ignore"):  # sizes beyond all use give NaN
        return _scene(parts, _wanted(parts, rows, shapes or {}, others))


def _scene(parts: Sequence[Part], wanted: Mapping[int, Sequence[ParametricSurface]]) -> Scene:
    surfaces = [k for k, part in enumerate(parts) if isinstance(part.geometry, BSplineSurface | Quadric)]
    most = _MOST_VERTICES // max(1, len(surfaces))
    faces: list[SceneFace] = []
    sides: list[tuple[int, str, Side]] = []
    for number, place in enumerate(surfaces, start=1):
        facets = _facets(parts[place], most)
        if facets is not None:
            sides += [(len(faces), f"side {k + 1}", side) for k, side in enumerate(facets.sides)]
            faces.append(_face(parts[place], (place, number), facets, wanted.get(place, [])))
    bodies = [parts[face.part].body for face in faces]
    edges = shared_edges(sides, [face.name for face in faces], [None if body is None else id(body) for body in bodies])
    curves = [
        curve
        for place, part in enumerate(parts)
        if isinstance(part.geometry, BSplineCurve | EllipseArc)
        for curve in _curves(part, place)
    ]
    return Scene(tuple(faces), (*edges, *curves))


def _label(part: Part, place: int) -> str:
    return part.name or f"no. {place + 1}"


def _wanted(
    parts: Sequence[Part], rows: Sequence[Row], shapes: Mapping[str, ModelShape], others: Sequence[Part]
) -> dict[int, list[ParametricSurface]]:
    """For the places of faces the surfaces that they stand for."""
    patches = _patches(shapes)
    wanted: dict[int, list[ParametricSurface]] = {}
    for k, row in enumerate(rows):
        surface = _surface(others[k].geometry) if others else patches.get(row.name)
        if surface is not None:
            for place in row.face or [k for k, part in enumerate(parts) if part.name == row.name]:
                wanted.setdefault(place, []).append(surface)
    return wanted


def _surface(geometry: Geometry) -> ParametricSurface | None:
    """The surface of a face over the unit square."""
    if isinstance(geometry, Quadric):
        return surface_of_quadric(geometry)
    return _Unit(geometry) if isinstance(geometry, BSplineSurface) else None


def _patches(shapes: Mapping[str, ModelShape]) -> dict[str, SeparableSurface]:
    """The surfaces of a model under the names of their rows."""
    found: dict[str, SeparableSurface] = {}
    for name, shape in shapes.items():
        if isinstance(shape, Quilt | Solid):
            quilt = shape.quilt if isinstance(shape, Solid) else shape
            found.update(
                {f"{name}.{patch}": surface for patch, surface in zip(quilt.names, quilt.patches, strict=True)}
            )
        elif isinstance(shape, SeparableSurface):
            found[name] = shape
    return {name: s if s.dimension == 3 else s.transformed(np.eye(3, 2)) for name, s in found.items()}


# --- faces ------------------------------------------------------------------------------------------------------------


def _face(part: Part, places: tuple[int, int], facets: Facets, shapes: Sequence[ParametricSurface]) -> SceneFace:
    deviation = np.full(len(facets.points), np.nan)
    if shapes:
        deviation = signed_distances(facets.points, facets.normals, shapes)
    values = {"deviation": deviation, "mean": facets.mean, "gaussian": facets.gaussian}
    normals = np.where(np.isfinite(facets.normals), facets.normals, _corner_normals(facets))
    label, facts = _label(part, places[0]), _facts(part)
    return SceneFace(label, facets.points, facets.triangles, normals, values, _net(part), *places, facts)


def _corner_normals(facets: Facets) -> Array:
    """Means of the normals of the triangles around each corner."""
    a, b, c = np.moveaxis(facets.points[facets.triangles], 1, 0)
    sums = np.zeros_like(facets.points)
    np.add.at(sums, facets.triangles.reshape(-1), np.repeat(np.cross(b - a, c - a), 3, axis=0))
    lengths = np.linalg.norm(sums, axis=1, keepdims=True)
    return np.where(lengths > 0, sums / np.where(lengths > 0, lengths, 1.0), [0.0, 0.0, 1.0])


def _facts(part: Part) -> dict[str, Any]:
    facts: dict[str, Any] = {"source": part.source, "trimmed": part.trimmed, "valid": part.valid}
    geometry = part.geometry
    if isinstance(geometry, BSplineSurface):
        facts["degree"] = (geometry.degree_u, geometry.degree_v)
        facts["poles"] = geometry.control_points.shape[:2]
        facts["rational"] = geometry.weights is not None
    elif isinstance(geometry, BSplineCurve):
        facts["degree"] = (geometry.degree,)
        facts["poles"] = geometry.control_points.shape[:1]
        facts["rational"] = geometry.weights is not None
    return facts


def _net(part: Part) -> tuple[Array, ...]:
    if isinstance(part.geometry, BSplineSurface):
        points = part.geometry.control_points
        return (*points, *points.swapaxes(0, 1))
    return (part.geometry.control_points,) if isinstance(part.geometry, BSplineCurve) else ()


def _facets(part: Part, most: int) -> Facets | None:
    if not part.trimmed:
        return _grid(part, most)
    try:
        return part.face.facets() if part.face is not None and part.face.facets is not None else None
    except KernelError:
        return None


@dataclass(frozen=True)
class _Unit:
    """A spline over the unit square."""

    spline: BSplineSurface

    @property
    def dimension(self) -> int:
        return self.spline.dimension

    def derivative(self, u: ArrayLike, v: ArrayLike, orders: tuple[int, int] = (1, 0)) -> Array:
        (u0, u1), (v0, v1) = self.spline.domain
        x, y = (np.clip(a + (b - a) * np.asarray(t), a, b) for a, b, t in ((u0, u1, u), (v0, v1, v)))
        return self.spline.derivative(x, y, orders) * (u1 - u0) ** orders[0] * (v1 - v0) ** orders[1]


def _grid(part: Part, most: int) -> Facets:
    """Triangles of a whole parameter rectangle."""
    geometry = part.geometry
    assert isinstance(geometry, BSplineSurface | Quadric)
    surface = _surface(geometry)
    assert surface is not None
    sign = -1.0 if part.reversed else 1.0
    nu, nv = _lines(geometry, surface, most)
    t, zero, one = np.linspace(0.0, 1.0, _ALONG), np.zeros(_ALONG), np.ones(_ALONG)
    inside = (np.repeat(np.linspace(0.0, 1.0, nu), nv), np.tile(np.linspace(0.0, 1.0, nv), nu))
    lines = (inside, (t, zero), (one, t), (t, one), (zero, t))
    u, v = (np.concatenate(values) for values in zip(*lines, strict=True))  # at once: each call costs more than points
    ends = np.cumsum([len(line[0]) for line in lines])[:-1]
    (points, *along), (normals, *across), (mean, *bends), (gaussian, *_) = (
        np.split(values, ends) for values in _measured(surface, u, v, sign)
    )
    corner = np.arange(nu * nv).reshape(nu, nv)
    a, b, c, d = (corner[i, j].reshape(-1) for i, j in itertools.product((slice(-1), slice(1, None)), repeat=2))
    triangles = np.concatenate([np.stack([a, c, d], axis=1), np.stack([a, d, b], axis=1)])
    if part.reversed:
        triangles = triangles[:, ::-1]
    sides = tuple(Side(*values) for values in zip(along, across, bends, strict=True))
    return Facets(points, np.ascontiguousarray(triangles), normals, mean, gaussian, sides)


def _lines(geometry: BSplineSurface | Quadric, surface: ParametricSurface, most: int) -> tuple[int, int]:
    """How many lines the eye needs in each direction."""
    t = np.linspace(0.0, 1.0, 17)
    unit = normal(surface, t[:, None], t[None, :])
    counts = []
    for axis in (0, 1):
        turns = np.arccos(np.clip((np.diff(unit, axis=axis) ** 2).sum(axis=-1) / -2 + 1, -1, 1))
        turned = float(np.nansum(turns, axis=axis).max(initial=0.0))
        knots = (geometry.knots_u, geometry.knots_v)[axis] if isinstance(geometry, BSplineSurface) else t[:2]
        counts.append(min(max(_LEAST, 1 + math.ceil(turned / _TURN), 1 + _PER_SPAN * (len(knots) - 1)), _MOST))
    shrink = math.sqrt(min(1.0, most / (counts[0] * counts[1])))
    return max(3, int(counts[0] * shrink)), max(3, int(counts[1] * shrink))


def _measured(surface: ParametricSurface, u: Array, v: Array, sign: float) -> tuple[Array, Array, Array, Array]:
    """Points, normals, mean and Gaussian curvature of a face; NaN where there is none."""
    k = principal_curvatures(surface, u, v)
    points, normals = surface.derivative(u, v, (0, 0)), normal(surface, u, v)
    return points, sign * normals, sign * k.mean(axis=-1), k.prod(axis=-1)


# --- curves -----------------------------------------------------------------------------------------------------------


def _curves(part: Part, place: int) -> Iterator[SceneCurve]:
    geometry = part.geometry
    assert isinstance(geometry, BSplineCurve | EllipseArc)
    curve = curve_of_arc(geometry) if isinstance(geometry, EllipseArc) else geometry
    try:
        found = comb(curve, teeth=_TEETH)
    except InputError:  # a point
        return
    yield SceneCurve(
        _label(part, place),
        found.points,
        "curve",
        "",
        found.tips,
        part=place,
        facts=_facts(part),
        arc_lengths=found.arc_lengths,
        curvature=found.curvature,
        net=_net(part),
    )
