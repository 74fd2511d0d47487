"""Walls: a quilt without creases, its exact offset as splines with shared edges, and the rims between the two.

The wall between a surface and its offset by t along the unit normals has the volume

    int |t| - t |t| H + |t|^3 K / 3 dA

(Steiner's formula), with H and K the mean and the Gaussian curvature, H positive where the surface bends towards its
normal.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gtcad.converters.bspline import BSplineCurve, BSplineSurface
from gtcad.converters.folds import oriented_normal, side_normals
from gtcad.converters.quilt_fit import QuiltFit
from gtcad.differential import gaussian_curvature, mean_curvature
from gtcad.errors import InputError, ToleranceNotMet
from gtcad.measure import Estimate
from gtcad.protocol import SeparableSurface
from gtcad.quilt import Quilt, SharedEdge, Use

Array = NDArray[np.float64]

SMOOTH = 0.02
"""Of the tolerance: how far offsets of neighbours may part at an edge that counts as smooth."""

_DEGREE = 5
_MOST_SPANS = 256
_SHARE = 0.4  # of the tolerance for each direction
_FINAL = 0.8  # of the tolerance for the samples: between them the deviation is a little larger
_ROWS = 13  # samples of one direction that stand for all when the other one is divided
_SAME_KNOT = 1e-8  # knots so near are one: the kernel wants them apart, and the curve does not feel it
_CELLS = (1, 2, 4, 8, 16)  # divisions of the unit square, each way, of quadrature
_SETTLED = 1e-12  # relative


@dataclass(frozen=True, eq=False)
class Skin:
    """Patches that close, with their normals out of the wall: what ``make_shell`` takes, and a name for each."""

    names: tuple[str, ...]
    splines: tuple[BSplineSurface, ...]
    edges: tuple[SharedEdge, ...]
    flipped: tuple[bool, ...]


@dataclass(frozen=True, eq=False)
class Wall:
    """What bounds a wall.

    Attributes
    ----------
    skins
        One around the wall of an open quilt. Of a closed quilt two, the outer one first.
    deviation
        Largest distance of the splines from the exact surface and its exact offset, in mm: proved for the first,
        estimated by samples for the second.
    """

    skins: tuple[Skin, ...]
    deviation: float


# --- offsets ----------------------------------------------------------------------------------------------------------


def wall(fit: QuiltFit, thickness: float, tolerance: float) -> Wall:
    """The faces around the wall between a fitted quilt without creases and its offset.

    Parameters
    ----------
    fit
        In mm.
    thickness
        In mm, positive along the normals of the quilt.
    tolerance
        Largest distance of the offset's splines from the exact offset, in mm.

    Raises
    ------
    InputError
        When the splines are rational, or free sides meet in a way that leaves the rim unclear.
    ToleranceNotMet
        When 256 spans are not enough.
    """
    if any(spline.weights is not None for spline in fit.splines):
        raise InputError("a wall needs polynomial splines, as fit_quilt makes them")
    quilt = fit.quilt
    corners = _rim_corners(fit)
    offsets, deviation = _Offsets(fit, thickness, tolerance).fitted()
    inwards = tuple(flip != (thickness > 0) for flip in quilt.flipped)  # the wall is where the offset goes
    outwards = tuple(not flip for flip in inwards)
    own = Skin(quilt.names, fit.splines, quilt.edges, inwards)
    other = Skin(tuple(f"{name} offset" for name in quilt.names), offsets, quilt.edges, outwards)
    largest = max(fit.deviation[1], deviation)
    if not quilt.closed:
        return Wall((_with_rims(quilt, own, other, corners),), largest)
    return Wall((other, own) if thickness > 0 else (own, other), largest)


def _moved(edge: SharedEdge, by: int) -> SharedEdge:
    first, second = (Use(use.patch + by, use.side) for use in (edge.first, edge.second))
    return SharedEdge(first, second, edge.reversed, edge.order)


class _Offsets:
    """The search for the number of spans of each strip of patches that share a direction."""

    def __init__(self, fit: QuiltFit, thickness: float, tolerance: float) -> None:
        self.quilt, self.bases = fit.quilt, fit.splines
        self.thickness, self.tolerance = thickness, tolerance
        self.strips = _strips(fit.quilt)
        self.limits = {use: side_normals(fit.quilt, use, np.array([0.5]))[0] for use in fit.quilt.collapsed}

    def fitted(self) -> tuple[tuple[BSplineSurface, ...], float]:
        patches = range(len(self.bases))
        needed = {(k, way): self._spans(k, way) for k in patches for way in ("u", "v")}
        while True:
            spans = {place: max(needed[other] for other in strip) for strip in self.strips for place in strip}
            splines = self._snapped([self._interpolated(k, spans[k, "u"], spans[k, "v"]) for k in patches])
            found = [self._deviation(k, spline) for k, spline in zip(patches, splines, strict=True)]
            if max(found) <= _FINAL * self.tolerance:
                return splines, max(found)
            for k, deviation in enumerate(found):
                if deviation > _FINAL * self.tolerance:
                    for way in ("u", "v"):
                        needed[k, way] = self._checked(2 * spans[k, way], max(found))

    def _checked(self, spans: int, achieved: float) -> int:
        if spans > _MOST_SPANS:
            raise ToleranceNotMet(self.tolerance, achieved, _MOST_SPANS, f"{_MOST_SPANS} spans of an offset")
        return spans

    def _points(self, patch: int, u: Array, v: Array) -> Array:
        points = self.quilt.patches[patch].evaluate(u[:, None], v[None, :])
        return points + self.thickness * self._normals(patch, u, v)

    def _normals(self, patch: int, u: Array, v: Array) -> Array:
        """Normals on a grid; one limit serves all of a side that is a point, because limits are dear."""
        normals = np.empty((u.size, v.size, 3))
        open_u, open_v = np.ones(u.size, dtype=bool), np.ones(v.size, dtype=bool)
        for use, limit in self.limits.items():
            if use.patch == patch and use.side[0] == "u":
                normals[u == float(use.side[1])] = limit
                open_u &= u != float(use.side[1])
            elif use.patch == patch:
                normals[:, v == float(use.side[1])] = limit
                open_v &= v != float(use.side[1])
        inner = oriented_normal(self.quilt, patch, u[open_u][:, None], v[open_v][None, :])
        normals[np.ix_(open_u, open_v)] = inner
        return normals

    def _spans(self, patch: int, way: str) -> int:
        """Spans that one direction needs along a few lines of the other one."""
        rows, spans = np.linspace(0, 1, _ROWS), 1
        while True:
            flat, greville, inverse = _interpolation(spans)
            t = _between(flat)
            values, wanted = (
                self._points(patch, x, rows) if way == "u" else self._points(patch, rows, x).swapaxes(0, 1)
                for x in (greville, t)
            )
            poles = np.tensordot(inverse, values, 1)
            error = float(np.linalg.norm(np.tensordot(_design(flat, t), poles, 1) - wanted, axis=-1).max())
            if error <= _SHARE * self.tolerance:
                return spans
            spans = self._checked(2 * spans, error)

    def _interpolated(self, patch: int, spans_u: int, spans_v: int) -> BSplineSurface:
        (_, u, inverse_u), (_, v, inverse_v) = _interpolation(spans_u), _interpolation(spans_v)
        poles = np.einsum("ia,jb,abd->ijd", inverse_u, inverse_v, self._points(patch, u, v), optimize=True)
        return BSplineSurface(poles, *_uniform(spans_u), *_uniform(spans_v))

    def _deviation(self, patch: int, spline: BSplineSurface) -> float:
        u, v = _between(spline.flat_knots_u), _between(spline.flat_knots_v)
        poles = spline.control_points
        design_u, design_v = _design(spline.flat_knots_u, u), _design(spline.flat_knots_v, v)
        held = np.einsum("ai,bj,ijd->abd", design_u, design_v, poles, optimize=True)
        return float(np.linalg.norm(held - self._points(patch, u, v), axis=-1).max())

    def _snapped(self, splines: Sequence[BSplineSurface]) -> tuple[BSplineSurface, ...]:
        """Rows that are one made equal to the last bit, corners that are one too, points one point."""
        poles = [np.array(spline.control_points) for spline in splines]
        for edge in self.quilt.edges:
            row = _row(poles[edge.first.patch], edge.first.side)
            _row(poles[edge.second.patch], edge.second.side)[:] = row[::-1] if edge.reversed else row
        corners: dict[bytes, Array] = {}
        for base, points in zip(self.bases, poles, strict=True):
            for i, j in ((0, 0), (0, -1), (-1, 0), (-1, -1)):
                place = (base.control_points[i, j] + 0.0).tobytes()
                points[i, j] = corners.setdefault(place, points[i, j].copy())
        for use in self.quilt.collapsed:
            row = _row(poles[use.patch], use.side)
            row[:] = row[0]
        return tuple(spline.with_control_points(points) for spline, points in zip(splines, poles, strict=True))


def _row(poles: Array, side: str) -> Array:
    end = 0 if side[1] == "0" else -1
    return poles[end] if side[0] == "u" else poles[:, end]


def _strips(quilt: Quilt) -> list[set[tuple[int, str]]]:
    """Directions of patches that shared edges tie together."""
    strips = [{(patch, way)} for patch in range(len(quilt.patches)) for way in ("u", "v")]
    for edge in quilt.edges:
        ends = {(use.patch, use.along) for use in (edge.first, edge.second)}
        joined = set().union(*(strip for strip in strips if not strip.isdisjoint(ends)))
        strips = [strip for strip in strips if strip.isdisjoint(ends)] + [joined]
    return strips


def _uniform(spans: int) -> tuple[Array, tuple[int, ...], int]:
    """Knots, multiplicities and degree; knots of a power of two spans are exact, mirrored too."""
    return np.linspace(0, 1, spans + 1), (_DEGREE + 1, *[1] * (spans - 1), _DEGREE + 1), _DEGREE


def _interpolation(spans: int) -> tuple[Array, Array, Array]:
    """Flat knots, Greville abscissae, and the matrix from values there to poles."""
    knots, multiplicities, degree = _uniform(spans)
    flat = np.repeat(knots, multiplicities)
    greville = _greville(flat, degree)
    return flat, greville, np.asarray(np.linalg.inv(_design(flat, greville)))


def _greville(flat: Array, degree: int) -> Array:
    return np.array([flat[i + 1 : i + degree + 1].mean() for i in range(len(flat) - degree - 1)]).clip(0, 1)


def _design(flat: Array, t: Array, degree: int = _DEGREE) -> Array:
    from scipy.interpolate import BSpline

    return np.asarray(BSpline.design_matrix(t, flat, degree).toarray())


def _between(flat: Array) -> Array:
    """Samples of every span, its ends among them."""
    knots = np.unique(flat)
    steps = np.linspace(0, 1, 7)[:-1]
    return np.append((knots[:-1, None] + np.diff(knots)[:, None] * steps).reshape(-1), knots[-1])


# --- rims -------------------------------------------------------------------------------------------------------------


def _rim_corners(fit: QuiltFit) -> list[tuple[Use, Use]]:
    """The ends, "u0" or "u1", of rims that meet in a corner; rims count in the order of the free sides."""
    ends: dict[bytes, list[Use]] = {}
    for number, use in enumerate(fit.quilt.free):
        points = fit.splines[use.patch].boundary(use.side).control_points
        for side, point in (("u0", points[0]), ("u1", points[-1])):
            ends.setdefault((point + 0.0).tobytes(), []).append(Use(number, side))
    for uses in ends.values():
        if len(uses) != 2:
            labels = ", ".join(fit.quilt.label(fit.quilt.free[use.patch]) for use in uses)
            raise InputError(f"the free sides {labels} meet in one corner: the rim is not clear there")
    return [(first, second) for first, second in ends.values()]


def _with_rims(quilt: Quilt, own: Skin, other: Skin, corners: Sequence[tuple[Use, Use]]) -> Skin:
    """Both sides of the wall and a ruled patch from each free side to its offset: v0 on the side, v1 on the offset."""
    count = len(own.splines)
    rims, flips = [], []
    edges = [*own.edges, *(_moved(edge, count) for edge in other.edges)]
    for place, use in enumerate(quilt.free, start=2 * count):
        rims.append(_ruled(*(skin.splines[use.patch].boundary(use.side) for skin in (own, other))))
        edges.append(SharedEdge(use, Use(place, "v0"), False))
        edges.append(SharedEdge(Use(use.patch + count, use.side), Use(place, "v1"), False))
        flips.append((use.side in ("v0", "u1")) != own.flipped[use.patch])
    edges += [_moved(SharedEdge(first, second, False), 2 * count) for first, second in corners]
    names = (*own.names, *other.names, *(f"{quilt.label(use)} rim" for use in quilt.free))
    return Skin(names, (*own.splines, *other.splines, *rims), tuple(edges), (*own.flipped, *other.flipped, *flips))


def _ruled(a: BSplineCurve, b: BSplineCurve) -> BSplineSurface:
    """The ruled surface between two curves over one domain, in the smallest space that holds both."""
    degree = max(a.degree, b.degree)
    smooth: dict[float, int] = {}
    for curve in (a, b):
        for own, multiplicity in zip(curve.knots.tolist(), curve.multiplicities, strict=True):
            knot = next((known for known in smooth if abs(known - own) <= _SAME_KNOT), own)
            smooth[knot] = min(smooth.get(knot, degree), curve.degree - multiplicity)
    knots = np.array(sorted(smooth))
    multiplicities = [degree + 1, *(degree - smooth[knot] for knot in knots[1:-1].tolist()), degree + 1]
    flat = np.repeat(knots, multiplicities)
    t = _greville(flat, degree)
    poles = np.linalg.solve(
        _design(flat, t, degree), np.stack([a.evaluate(t), b.evaluate(t)], axis=1).reshape(t.size, -1)
    )
    points = poles.reshape(t.size, 2, -1)
    for end in (0, -1):
        points[end] = a.control_points[end], b.control_points[end]
    return BSplineSurface(points, knots, multiplicities, degree, [0.0, 1.0], [2, 2], 1)


# --- volumes ----------------------------------------------------------------------------------------------------------


def wall_volume(quilt: Quilt, thickness: float) -> Estimate:
    """Volume of the wall between a quilt and its offset by Steiner's formula, in mm^3.

    Edges and corners between neighbours add nothing: the quilt must have no creases.

    Parameters
    ----------
    quilt
        In space.
    thickness
        In mm, positive along the normals of the quilt.

    Notes
    -----
    By Gauss quadrature on finer and finer divisions; the error is the last change.

    Examples
    --------
    A quarter of a cylinder of radius 2 and height 1, clad by 1: a quarter of pi (3^2 - 2^2).

    >>> from gtcad import BERNSTEIN, Surface
    >>> points = [[[2, 0, 0], [2, 0, 1]], [[2, 2, 0], [2, 2, 1]], [[0, 2, 0], [0, 2, 1]]]
    >>> quilt = Quilt.recognised([Surface(points, family_v=BERNSTEIN)])
    >>> round(wall_volume(quilt, 1.0) / math.pi, 9)
    1.25
    """
    parts = [
        _settled(patch, -thickness if flip else thickness)
        for patch, flip in zip(quilt.patches, quilt.flipped, strict=True)
    ]
    return Estimate(math.fsum(parts), math.fsum(part.error for part in parts))


def _settled(patch: SeparableSurface, t: float) -> Estimate:
    """By finer and finer divisions, until nothing changes."""
    value = _steiner(patch, t, _CELLS[0])
    for cells in _CELLS[1:]:
        before, value = value, _steiner(patch, t, cells)
        if abs(value - before) <= _SETTLED * abs(value):
            break
    return Estimate(value, abs(value - before) + _SETTLED * abs(value))


def _steiner(patch: SeparableSurface, t: float, cells: int) -> float:
    z, w = np.polynomial.legendre.leggauss(24)
    x = ((np.arange(cells)[:, None] + (z + 1) / 2) / cells).reshape(-1)
    weights = np.tile(w / (2 * cells), cells)
    u, v = x[:, None], x[None, :]
    area = np.linalg.norm(np.cross(patch.derivative(u, v, (1, 0)), patch.derivative(u, v, (0, 1))), axis=-1)
    mean, gauss = mean_curvature(patch, u, v), gaussian_curvature(patch, u, v)
    return float(weights @ (area * (abs(t) - t * abs(t) * mean + abs(t) ** 3 * gauss / 3)) @ weights)
