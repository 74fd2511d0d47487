"""Shaded pictures of surfaces, coloured by curvature, and of what the design variables do to a patch; PNG or SVG.

As with ``gtcad.pictures`` equal input gives equal bytes, the extra ``plot`` is needed, and drawing is for one thread.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from gtcad._jets import norm
from gtcad.design_variables import design_variables
from gtcad.differential import gaussian_curvature, mean_curvature
from gtcad.errors import InputError
from gtcad.patch_studies import PatchStudy, PatchVariant, patch_study
from gtcad.pictures import GREY, INK, framed, inner_box, view_along, written_picture
from gtcad.protocol import SeparableSurface
from gtcad.quilt import Quilt

Array = NDArray[np.float64]
ColourBy = Literal["mean curvature", "Gaussian curvature"]

_CURVATURES: dict[str, tuple[Callable[..., Array], str]] = {
    "mean curvature": (mean_curvature, "1/{}"),
    "Gaussian curvature": (gaussian_curvature, "1/{}\N{SUPERSCRIPT TWO}"),
}
_MAP = "RdBu_r"  # diverging, distinguishable with any colour vision
_ENDS = (0.06, 0.94)  # of the map: beyond, both ends are nearly black
_PLAIN = np.array([0x7F, 0xB2, 0xD6]) / 255
_DARKEST = {"plain": 0.3, "coloured": 0.7}  # brightness of a face that looks away from the light
_LIGHT = np.array([-0.5, 0.5, 0.7])  # to the right, up and towards the viewer
_SHOWN = 0.98  # of the faces have a colour of their own; larger curvatures get the last one
_FLAT = 1e-6  # over the diagonal: the least curvature that is shown
_LIFT = 0.02  # of the diagonal: lines in front of the faces they lie on
_LINE_COLOUR = 0.25
_LINES = 5  # in each direction of a patch, the edges included
_FACES = {"one": 64, "study": 32}  # in each direction of a patch
_MOST_FACES = 60_000
_LEAST_FACES = 8
_LARGEST_STUDY = 49
_MARGIN = 0.4  # inches, for the labels of axes in space, which the layout does not know
_GAP = 0.1  # of the axes: before the scale of colours, for the same labels
_NO_VOLUME = 1e-12  # of area and diagonal: what rounding leaves


@dataclass(frozen=True)
class _Drawing:
    """Patches as grids of points, shape (n, n, 3) each, and what their faces are coloured by, (n - 1, n - 1)."""

    grids: tuple[Array, ...]
    values: tuple[Array, ...] | None

    @property
    def points(self) -> Array:
        return np.concatenate([grid.reshape(-1, 3) for grid in self.grids])


def draw_surface(
    surface: SeparableSurface | Quilt | Sequence[SeparableSurface],
    path: str | os.PathLike[str],
    *,
    colour_by: ColourBy | None = None,
    title: str | None = None,
    unit: str = "mm",
) -> None:
    """One surface or several, shaded, with lines of constant parameters, coloured by curvature if wanted.

    Parameters
    ----------
    surface
        A surface, a quilt or a sequence of surfaces; plane ones lie at z = 0.
    path
        The picture, ending in .png or .svg.
    colour_by
        "mean curvature", positive where a surface bends towards its normal (of a quilt that of its orientation), or
        "Gaussian curvature". 98 % of the faces are within the range of colours, which is symmetric about 0.
    title
        Above the picture; none by default.
    unit
        The model's unit, for the labels.

    Raises
    ------
    InputError
        When an argument is out of its range.
    FileError
        When the path cannot be written to.
    ExtraMissing
        When matplotlib is not installed.
    """
    if isinstance(surface, Quilt):
        patches, turned = surface.patches, surface.flipped
    else:
        patches = tuple(surface) if isinstance(surface, Sequence) else (surface,)
        turned = (False,) * len(patches)
    _check(patches, colour_by)
    faces = min(_FACES["one"], max(_LEAST_FACES, math.isqrt(_MOST_FACES // len(patches))))
    drawing = _drawing(patches, turned, colour_by, faces)
    with written_picture(path, (8.0, 6.5), title or "Surface", unit) as figure:
        _leave_room(figure)
        axes = figure.add_subplot(projection="3d")
        framed(axes, [drawing.points], unit)
        _draw(figure, [(axes, drawing)], colour_by, unit, view_along(drawing.points))
        if title:
            figure.suptitle(title, fontsize=13, color=INK)


def draw_patch_study(
    study: PatchStudy | SeparableSurface,
    path: str | os.PathLike[str],
    *,
    colour_by: ColourBy | None = None,
    title: str | None = None,
    unit: str = "mm",
) -> None:
    """The patches of a study side by side, all in one view, at one scale and with one range of colours.

    The first axis of the study runs downwards, the second to the right. Above each patch stand the design variables
    that vary, its area A and its volume V (of the cone over it from the origin).

    Parameters
    ----------
    study
        At most 49 patches; of a patch the study of its first pair over {-1, 0, 1} x {-1, 0, 1}.
    path, colour_by, title, unit
        As for ``draw_surface``.

    Raises
    ------
    InputError
        When an argument is out of its range.
    FileError
        When the path cannot be written to.
    ExtraMissing
        When matplotlib is not installed.
    """
    study = patch_study(study) if isinstance(study, SeparableSurface) else study
    if not 1 <= len(study.variants) <= _LARGEST_STUDY:
        raise InputError(f"a picture holds 1 to {_LARGEST_STUDY} patches, got {len(study.variants)}")
    patches = tuple(variant.patch for variant in study.variants)
    _check(patches, colour_by)
    drawings = [_drawing((patch,), (False,), colour_by, _FACES["study"]) for patch in patches]
    points = np.concatenate([drawing.points for drawing in drawings])
    rows, columns = (len(study.values[0]), len(study.values[1])) if len(study.axes) == 2 else (1, len(patches))
    with written_picture(
        path, (max(3.0 * columns, 6.0), 3.0 * rows + 0.6), title or "Design variables", unit
    ) as figure:
        _leave_room(figure)
        cells = []
        for place, (variant, drawing) in enumerate(zip(study.variants, drawings, strict=True)):
            axes = figure.add_subplot(rows, columns, place + 1, projection="3d")
            framed(axes, [points], unit)
            inner_box(axes, place, rows, columns)
            axes.set_title(_figures(study, variant, float(norm(np.ptp(points, axis=0))), unit), fontsize=8, color=INK)
            cells.append((axes, drawing))
        _draw(figure, cells, colour_by, unit, view_along(points))
        if title:
            figure.suptitle(title, fontsize=13, color=INK)


def _check(patches: Sequence[SeparableSurface], colour_by: str | None) -> None:
    if not patches:
        raise InputError("there is no surface to draw")
    for index, patch in enumerate(patches):
        if not isinstance(patch, SeparableSurface):
            raise InputError(f"surface[{index}] must be a surface, got {type(patch).__name__}")
    if colour_by is not None and colour_by not in _CURVATURES:
        raise InputError(f"colour_by must be one of {', '.join(_CURVATURES)} or None, got {colour_by!r}")


def _drawing(
    patches: Sequence[SeparableSurface], turned: Sequence[bool], colour_by: ColourBy | None, faces: int
) -> _Drawing:
    faces += -faces % (_LINES - 1)  # lines of constant parameters run along the faces
    ends = np.linspace(0, 1, faces + 1)
    middles = (ends[:-1] + ends[1:]) / 2  # where there is a curvature, also next to a side that is a point
    shapes = [patch if patch.dimension == 3 else patch.transformed(np.eye(3, 2)) for patch in patches]
    grids = tuple(shape.evaluate(ends[:, None], ends[None, :]) for shape in shapes)
    if colour_by is None:
        return _Drawing(grids, None)
    values = [_CURVATURES[colour_by][0](shape, middles[:, None], middles[None, :]) for shape in shapes]
    if colour_by == "mean curvature":
        values = [-value if turn else value for value, turn in zip(values, turned, strict=True)]
    return _Drawing(grids, tuple(values))


def _figures(study: PatchStudy, variant: PatchVariant, diagonal: float, unit: str) -> str:
    varied = dict.fromkeys(axis.partition("[")[0] for axis in study.axes)
    gammas = design_variables(variant.patch)
    volume = variant.volume.value if abs(variant.volume) > _NO_VOLUME * variant.area * diagonal else 0.0
    return "\n".join(
        [
            *(f"{name} = ({gammas[name][0]:g}, {gammas[name][1]:g})" for name in varied),
            f"A = {variant.area:.4g} {unit}\N{SUPERSCRIPT TWO}",
            f"V = {volume:.4g} {unit}\N{SUPERSCRIPT THREE}",
        ]
    )


def _leave_room(figure: Any) -> None:
    """Margins on the left and below for the labels of axes."""
    width, height = figure.get_size_inches()
    left, below = _MARGIN / width, _MARGIN / height
    figure.get_layout_engine().set(rect=(left, below, 1 - left, 1 - below))


# --- what is drawn ----------------------------------------------------------------------------------------------------


def _draw(
    figure: Any,
    cells: Sequence[tuple[Any, _Drawing]],
    colour_by: ColourBy | None,
    unit: str,
    view: tuple[float, float],
) -> None:
    """The surfaces on their axes, and the scale of colours."""
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, Normalize
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # type: ignore[import-untyped]

    limit, beyond = _limit([drawing for _, drawing in cells])
    colours_of = ListedColormap(colormaps[_MAP](np.linspace(*_ENDS, 256)))
    scale = ScalarMappable(Normalize(-limit, limit), colours_of)
    darkest = _DARKEST["plain" if colour_by is None else "coloured"]
    towards = _directions(*view)
    for axes, drawing in cells:
        diagonal = float(norm(np.ptp(drawing.points, axis=0)))
        polygons, colours = [], []
        for k, grid in enumerate(drawing.grids):
            shades = _shades(grid, towards, darkest)[..., None]
            values = None if drawing.values is None else drawing.values[k]
            plain = np.broadcast_to(_PLAIN, (*shades.shape[:2], 3)) if values is None else _coloured(scale, values)
            faces = np.stack([grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]], axis=2)
            lines = _lines(grid) + _LIFT * diagonal * towards[2]
            polygons += [faces.reshape(-1, 4, 3), lines]
            colours += [(shades * plain).reshape(-1, 3), np.full((len(lines), 3), _LINE_COLOUR)]
        drawn = np.concatenate(colours)
        mesh = Poly3DCollection(np.concatenate(polygons), facecolors=drawn, edgecolors=drawn, linewidths=0.5)
        mesh.set_gid("surface")
        mesh.set_rasterized(True)  # thousands of faces: an SVG holds them as a picture
        axes.add_collection3d(mesh)
    if colour_by is not None:
        extend = "both" if beyond else "neither"
        label = f"{colour_by} ({_CURVATURES[colour_by][1].format(unit)})"
        beside = [axes for axes, _ in cells]
        bar = figure.colorbar(scale, ax=beside, shrink=0.6, aspect=30, pad=_GAP, extend=extend, label=label)
        bar.outline.set_edgecolor(GREY)


def _coloured(scale: Any, values: Array) -> Array:
    """Colours of the faces, grey where there is no curvature."""
    colours = scale.to_rgba(np.ma.masked_invalid(values))[..., :3]
    return np.where(np.isfinite(values)[..., None], colours, 0.8)


def _limit(drawings: Sequence[_Drawing]) -> tuple[float, bool]:
    """The end of the range of colours, and whether there are values beyond it."""
    values = [np.abs(value).ravel() for drawing in drawings for value in drawing.values or ()]
    known = np.concatenate([np.zeros(1), *values])
    known = known[np.isfinite(known)]
    diagonal = max(float(norm(np.ptp(drawing.points, axis=0))) for drawing in drawings)
    limit = max(float(np.quantile(known, _SHOWN)), _FLAT / max(diagonal, _FLAT))
    return limit, bool(known.max() > 1.001 * limit)


def _directions(elevation: float, azimuth: float) -> Array:
    """Unit vectors to the right, up and towards the viewer, shape (3, 3)."""
    e, a = math.radians(elevation), math.radians(azimuth)
    towards = np.array([math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e)])
    right = np.array([-math.sin(a), math.cos(a), 0.0])
    return np.stack([right, np.cross(towards, right), towards])


def _shades(grid: Array, towards: Array, darkest: float) -> Array:
    """Brightness of the faces, of both sides alike, shape (n - 1, n - 1)."""
    across = np.cross(grid[1:, 1:] - grid[:-1, :-1], grid[:-1, 1:] - grid[1:, :-1])
    lengths = norm(across)
    light = _LIGHT @ towards / float(norm(_LIGHT))
    facing = np.where(across @ towards[2] < 0, -1.0, 1.0)  # the side that is seen
    cosine = facing * (across @ light) / np.where(lengths > 0, lengths, 1.0)
    return darkest + (1 - darkest) * (1 + cosine) / 2


def _lines(grid: Array) -> Array:
    """Segments along lines of constant parameters, as triangles without area, shape (k, 4, 3)."""
    step = (len(grid) - 1) // (_LINES - 1)
    along_u, along_v = grid[:, ::step], grid[::step].swapaxes(0, 1)
    parts = []
    for line in (along_u, along_v):
        start, end = line[:-1].reshape(-1, 3), line[1:].reshape(-1, 3)
        parts.append(np.stack([start, end, end, start], axis=1))
    return np.concatenate(parts)
