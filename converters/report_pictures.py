"""Pictures of a scene for print, from two sides, coloured by the deviation."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gtcad.converters.report_view import COMB, CURVE, EDGES, MAPS
from gtcad.converters.scene import Scene

Array = NDArray[np.float64]

_VIEWS = ((-0.9, 0.5), (1.7, -0.6))  # azimuth, elevation: from in front above, from behind below
_PLAIN, _UNKNOWN = np.array([0.55, 0.68, 0.8]), np.array([0.72, 0.72, 0.72])
_LIGHT = np.array([-0.2, 0.3, 0.75])
_LIFT = 0.02  # of half the size: lines before the faces that they lie on
_DASHES = {"free": (3, 2), "G0": (1, 0), "G1": (6, 2), "G2": (1, 1)}  # of the segments drawn, left out
_TITLES = ("from in front, above", "from behind, below")


def draw_scene(figure: Any, box: tuple[float, float, float, float], scene: Scene) -> None:
    """Draw a scene into a box (left, bottom, width, height) of a figure, deviations with their scale of colours."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LinearSegmentedColormap, Normalize

    known = [face.values["deviation"][np.isfinite(face.values["deviation"])] for face in scene.faces]
    largest = max((float(np.abs(values).max()) for values in known if len(values)), default=0.0)
    coloured = any(map(len, known))
    scale = ScalarMappable(
        Normalize(-max(largest, 1e-15), max(largest, 1e-15)),
        LinearSegmentedColormap.from_list("signed", MAPS["signed"]),
    )
    left, bottom, width, height = box
    low = 0.16 if coloured else 0.0
    for k, view in enumerate(_VIEWS):
        place = (left + k * width / 2, bottom + low * height, width / 2, (1 - low) * height)
        axes = figure.add_axes(place, aspect="equal")
        axes.set_axis_off()
        axes.set_title(_TITLES[k], fontsize=7, color="#444444", pad=2)
        _draw(axes, scene, _directions(*view), scale if coloured else None)
    if coloured:
        bar_axes = figure.add_axes((left + 0.25 * width, bottom + 0.09 * height, 0.5 * width, 0.025 * height))
        bar = figure.colorbar(scale, cax=bar_axes, orientation="horizontal")
        bar.ax.tick_params(labelsize=6, length=2, pad=1)
        bar.ax.xaxis.get_offset_text().set(fontsize=6, x=1.1)  # beside the label
        bar.set_label("deviation, mm (sampled; positive on the side of the face's normal)", fontsize=6.5, labelpad=2)


def _directions(azimuth: float, elevation: float) -> Array:
    """Unit vectors to the right, up and towards the viewer, shape (3, 3)."""
    ca, sa, ce, se = np.cos(azimuth), np.sin(azimuth), np.cos(elevation), np.sin(elevation)
    return np.array([[-sa, ca, 0.0], [-se * ca, -se * sa, ce], [ce * ca, ce * sa, se]])


def _draw(axes: Any, scene: Scene, turn: Array, scale: Any) -> None:
    """Triangles and pieces of lines in one collection, those far away first."""
    from matplotlib.collections import PolyCollection

    points = np.concatenate([face.vertices for face in scene.faces] + [curve.points for curve in scene.curves])
    middle = points.min(axis=0) / 2 + points.max(axis=0) / 2
    size = max(float(np.abs(points - middle).max()), 1e-300)
    seen: _Seen = lambda places: (places - middle) / size @ turn.T  # noqa: E731
    pieces = [*_triangles(scene, turn, scale, seen), *_lines(scene, seen)]
    shapes, depths, colours, widths = (np.concatenate(column) for column in zip(*pieces, strict=True))
    order = np.argsort(depths, kind="stable")
    drawn = PolyCollection(
        list(shapes[order]), facecolors=colours[order], edgecolors=colours[order], linewidths=widths[order]
    )
    drawn.set_rasterized(True)  # thousands of triangles: a page holds them as a picture
    axes.add_collection(drawn)
    low, high = shapes.reshape(-1, 2).min(axis=0), shapes.reshape(-1, 2).max(axis=0)
    margin = 0.02 * float((high - low).max())
    axes.set_xlim(low[0] - margin, high[0] + margin)
    axes.set_ylim(low[1] - margin, high[1] + margin)


_Seen = Callable[[Array], Array]  # from places to right, up and towards the eye, within about 1
_Piece = tuple[Array, Array, Array, Array]  # polygons (k, 4, 2), depths, colours, widths of their outlines


def _triangles(scene: Scene, turn: Array, scale: Any, seen: _Seen) -> Iterator[_Piece]:
    for face in scene.faces:
        corners = seen(face.vertices)[face.triangles]
        normals = (face.normals @ turn.T)[face.triangles].mean(axis=1)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
        normals *= np.where(normals[:, 2:] < 0, -1.0, 1.0)
        light = 0.45 + 0.55 * np.clip(normals @ _LIGHT, 0.0, 1.0)
        colours = np.broadcast_to(_PLAIN, (len(corners), 3))
        if scale is not None:
            values = face.values["deviation"][face.triangles].mean(axis=1)
            colours = np.where(np.isfinite(values)[:, None], scale.to_rgba(np.nan_to_num(values))[:, :3], _UNKNOWN)
            light = 0.72 + 0.28 * light
        polygons = corners[:, [0, 1, 2, 2], :2]
        yield polygons, corners[..., 2].mean(axis=1), colours * light[:, None], np.full(len(corners), 0.2)


def _lines(scene: Scene, seen: _Seen) -> Iterator[_Piece]:
    for curve in scene.curves:
        if curve.kind == "edge":
            colour, width, _, _ = EDGES[curve.continuity]
            on, off = _DASHES[curve.continuity]
            yield _segments(curve.points, seen, colour, 0.4 * width, np.arange(len(curve.points) - 1) % (on + off) < on)
        else:
            yield _segments(curve.points, seen, CURVE, 1.2, None)
            if curve.comb is not None:
                known = np.isfinite(curve.comb).all(axis=1)
                teeth = np.stack([curve.points[known], curve.comb[known]], axis=1).reshape(-1, 3)
                yield _segments(teeth, seen, COMB, 0.4, np.arange(len(teeth) - 1) % 2 == 0)
                yield _segments(curve.comb[known], seen, COMB, 0.6, None)


def _segments(points: Array, seen: _Seen, colour: str, width: float, shown: Any) -> _Piece:
    places = seen(points)
    start, end = places[:-1], places[1:]
    if shown is not None:
        start, end = start[shown], end[shown]
    rgb = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    polygons = np.stack([start, end, end, start], axis=1)[..., :2]
    return polygons, (start + end)[:, 2] / 2 + _LIFT, np.tile(rgb, (len(start), 1)), np.full(len(start), width)
