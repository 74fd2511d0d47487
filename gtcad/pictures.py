"""Pictures of curvature combs and of what the design variables do, as PNG or SVG; they need the extra ``plot``.

Equal input gives equal bytes: no dates, and matplotlib's defaults whatever its settings are. These are set for the
time of drawing alone; as they are matplotlib's own and not of a thread, draw in one thread at a time.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gtcad._files import written_whole
from gtcad._jets import norm
from gtcad.combs import Comb, GammaStudy, GammaVariant, Part, comb, gamma_study, spans
from gtcad.composite import Composite
from gtcad.continuity import Derivable
from gtcad.curve import Curve
from gtcad.differential import torsion
from gtcad.errors import ExtraMissing, FileError, InputError
from gtcad.extremes import curvature_extremes, extremes_along
from gtcad.protocol import SeparableCurve

Array = NDArray[np.float64]

# distinguishable with any colour vision (M. Okabe, K. Ito, Color Universal Design, 2008), and by their markers
INK, LINE, COMB, GREY = "#222222", "#0072B2", "#E69F00", "#8A8A8A"
EXTREMES = {
    "maximum": ("^", "#D55E00", "curvature maximum"),
    "minimum": ("v", "#009E73", "curvature minimum"),
    "inflection": ("o", "#CC79A7", "inflection"),
}
_LEGEND = (
    "curve",
    "the other curves",
    "curvature comb",
    "control polygon",
    "joint",
    *(label for _, _, label in EXTREMES.values()),
)
_SUFFIXES = (".png", ".svg")
_DPI = 150
_FINE = 1500  # teeth behind smooth lines
_LARGEST_STUDY = 49
_LONGEST = 2 / 3  # of the diagonal: the longest tooth that a study shows
_THINNEST = 0.15  # of the largest side: the least side of a box in space
_TORSION_SHOWN = 5.0  # times the quantile of 90 %: the graph is cut there, torsion has poles at inflections


def draw_comb(
    curve: Derivable,
    path: str | os.PathLike[str],
    *,
    title: str | None = None,
    polygon: bool = True,
    extremes: bool = True,
    teeth: int = 120,
    scale: float | None = None,
    unit: str = "mm",
) -> None:
    """A curve with its curvature comb, and below it the curvature over arc length, in space the torsion too.

    Parameters
    ----------
    curve
        A plane or space curve: a shape of the protocol, a ``Composite`` or a B-spline.
    path
        The picture, ending in .png or .svg.
    title
        Above the picture; none by default.
    polygon
        Whether to draw the control polygon, where there is one.
    extremes
        Whether to mark maxima and minima of the curvature and inflections.
    teeth, scale
        Of the comb, as for ``gtcad.combs.comb``.
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
    smooth = comb(curve, teeth=_FINE, scale=scale)
    sparse = comb(curve, teeth=teeth, scale=smooth.scale)
    marks = _marks(curve, smooth) if extremes else []
    plane = sparse.points.shape[1] == 2
    with written_picture(path, (8.0, 7.5) if plane else (8.0, 9.5), title or "Curvature comb", unit) as figure:
        ratios = (3, 1) if plane else (3, 0.7, 0.7)
        grid = figure.add_gridspec(len(ratios), 1, height_ratios=ratios)
        axes = figure.add_subplot(grid[0], projection=None if plane else "3d")
        polygons = _polygons(curve) if polygon else []
        _draw_shape(axes, smooth, sparse, polygons)
        _draw_marks(axes, [(kind, point) for kind, _, _, point in marks])
        framed(axes, [smooth.points, sparse.tips, smooth.envelope, *polygons], unit)
        graph = figure.add_subplot(grid[1])
        _draw_curvature(graph, smooth, marks, unit)
        if not plane:
            lower = figure.add_subplot(grid[2], sharex=graph)
            _draw_torsion(lower, curve, smooth, unit)
            graph.tick_params(labelbottom=False)
            graph.set_xlabel("")
        _finish(figure, title)


def draw_gamma_study(
    study: GammaStudy | Curve,
    path: str | os.PathLike[str],
    *,
    title: str | None = None,
    polygon: bool = True,
    extremes: bool = True,
    teeth: int = 60,
    scale: float | None = None,
    unit: str = "mm",
) -> None:
    """The curves of a study side by side with their combs, all at one scale, gamma_1 downwards, gamma_2 to the right.

    Behind each curve the others are drawn in grey; above it stand its length L and energy E = int kappa^2 ds.

    Parameters
    ----------
    study
        At most 49 curves; of a curve the study over {-1, 0, 1} x {-1, 0, 1}.
    path, title, polygon, extremes, unit
        As for ``draw_comb``.
    teeth, scale
        Of the combs. By default the scale is the median of the automatic ones. Teeth longer than two thirds of the
        diagonal of the box around all curves are left out.

    Raises
    ------
    InputError
        When an argument is out of its range.
    FileError
        When the path cannot be written to.
    ExtraMissing
        When matplotlib is not installed.
    """
    study = gamma_study(study) if isinstance(study, Curve) else study
    if not 1 <= len(study.variants) <= _LARGEST_STUDY:
        raise InputError(f"a picture holds 1 to {_LARGEST_STUDY} curves, got {len(study.variants)}")
    if scale is None:
        scale = float(np.median([comb(curve, teeth=_FINE).scale for curve in study.curves]))
    smooth = [comb(curve, teeth=_FINE, scale=scale) for curve in study.curves]
    points = np.concatenate([one.points for one in smooth])
    longest = _LONGEST * float(norm(np.ptp(points, axis=0)))
    smooth = [_cut(one, longest) for one in smooth]
    drawn = [points, *(one.tips for one in smooth), *(_polygons(study.curves[0]) if polygon else [])]
    rows, columns = len(study.gamma_1), len(study.gamma_2)
    plane = points.shape[1] == 2
    size = (max(2.8 * columns, 6.0), (2.4 if plane else 3.2) * rows + 1.2)
    with written_picture(path, size, title or "Design variables", unit) as figure:
        for place, (variant, fine) in enumerate(zip(study.variants, smooth, strict=True)):
            axes = figure.add_subplot(rows, columns, place + 1, projection=None if plane else "3d")
            for k, other in enumerate(smooth):
                label = None if k else "the other curves"
                axes.plot(*other.points.T, color=GREY, alpha=0.5, linewidth=0.6, label=label, gid="family")
            sparse = _cut(comb(variant.curve, teeth=teeth, scale=scale), longest)
            _draw_shape(axes, fine, sparse, _polygons(variant.curve) if polygon else [])
            marks = _marks(variant.curve, fine) if extremes else []
            _draw_marks(axes, [(kind, point) for kind, _, _, point in marks])
            framed(axes, drawn, unit)
            inner_box(axes, place, rows, columns)
            axes.set_title(_figures(variant, unit), fontsize=9, color=INK)
        _finish(figure, title)


def _cut(whole: Comb, longest: float) -> Comb:
    """Without the tips of teeth that are longer than that."""
    far = norm(whole.tips - whole.points) > longest
    return replace(whole, tips=np.where(far[:, None], np.nan, whole.tips))


def inner_box(axes: Any, place: int, rows: int, columns: int) -> None:
    """Take away the labels that the first column and the last row show for all; in space those of all but one."""
    first, last = place % columns == 0, place // columns == rows - 1
    if hasattr(axes, "zaxis"):
        first = last = first and last
    for kept, names in ((last, "x"), (first, "yz")):
        for name in names if not kept else "":
            if hasattr(axes, f"set_{name}label"):
                axes.tick_params(axis=name, labelcolor="none")
                getattr(axes, f"set_{name}label")("")


# --- the file ---------------------------------------------------------------------------------------------------------


@contextmanager
def written_picture(path: str | os.PathLike[str], size: tuple[float, float], title: str, unit: str) -> Iterator[Any]:
    """A figure that is written to the path when the block ends without an error."""
    form = Path(path).suffix.lower()
    if form not in _SUFFIXES:
        raise InputError(f"the file of a picture must end in {' or '.join(_SUFFIXES)}, got {os.fspath(path)!r}")
    for name, text in (("title", title), ("unit", unit)):
        if not all(line.isprintable() for line in text.split("\n")):
            raise InputError(f"{name} must consist of printable characters, got {text!r}")
    try:
        import matplotlib as mpl
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise ExtraMissing(f"drawing needs more packages ({error}): pip install 'gtcad[plot]'") from error
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams["svg.hashsalt"] = "gtcad"  # of the identifiers within the file, random otherwise
        mpl.rcParams["text.parse_math"] = False  # a title may hold a dollar
        mpl.rcParams["grid.color"] = "#DDDDDD"
        figure = Figure(figsize=size, dpi=_DPI, layout="constrained")
        FigureCanvasAgg(figure)
        yield figure
        metadata = {"Title": title, "Date": None} if form == ".svg" else {"Title": title}
        with written_whole(path) as temporary:
            try:
                figure.savefig(temporary, format=form[1:], metadata=metadata)
            except OSError as error:
                raise FileError(str(path), f"cannot be written: {error.strerror}") from error


def _finish(figure: Any, title: str | None) -> None:
    """Title and legend."""
    named = {
        label: handle for axes in figure.axes for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    labels = [label for label in _LEGEND if label in named]
    handles = [named[label] for label in labels]
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False, fontsize=9)
    if title:
        figure.suptitle(title, fontsize=13, color=INK)


# --- what is drawn ----------------------------------------------------------------------------------------------------

Mark = tuple[str, float, float, Array]  # kind, arc length, curvature, point


def _marks(curve: Derivable, smooth: Comb) -> list[Mark]:
    """The extremes of the curvature, with their place on the curve and on its graph."""
    bounds = np.array(curve.domain)
    if isinstance(curve, SeparableCurve | Composite):
        found = curvature_extremes(curve)
        bounds = np.arange(bounds[0], bounds[1] + 1.0)
    else:  # analytic between knots, and looked at across them
        bounds = np.asarray(getattr(curve, "knots", bounds), dtype=np.float64)
        found = extremes_along([Part(curve, a, b) for a, b in pairwise(bounds.tolist())])
    places = np.interp([extreme.parameter for extreme in found], np.arange(len(bounds)), bounds)
    along = np.interp(places, smooth.parameters, smooth.arc_lengths)
    points = curve.derivative(places, 0)
    return [
        (extreme.kind, float(s), extreme.curvature, point)
        for extreme, s, point in zip(found, along, points, strict=True)
    ]


def _polygons(curve: Derivable) -> list[Array]:
    pieces = curve.pieces if isinstance(curve, Composite) else (curve,)
    return [piece.control_points for piece in pieces if hasattr(piece, "control_points")]


def _draw_shape(axes: Any, smooth: Comb, sparse: Comb, polygons: Sequence[Array]) -> None:
    """Curve, comb, polygons and joints, in the plane or in space."""
    for k, points in enumerate(polygons):
        label = None if k else "control polygon"
        axes.plot(
            *points.T,
            "--s",
            color=GREY,
            linewidth=0.9,
            markersize=3.5,
            markerfacecolor="white",
            label=label,
            gid="polygon",
        )
    gaps = np.full_like(sparse.points, np.nan)
    teeth = np.stack([sparse.points, sparse.tips, gaps], axis=1).reshape(-1, sparse.points.shape[1])
    axes.plot(*teeth.T, color=COMB, linewidth=0.6, gid="comb")
    axes.plot(*smooth.envelope.T, color=COMB, linewidth=1.1, label="curvature comb", gid="envelope")
    axes.plot(*smooth.points.T, color=LINE, linewidth=2.0, label="curve", gid="curve")
    if smooth.joints:
        points = smooth.points[[before for before, _ in smooth.joints]]
        axes.plot(*points.T, "D", color=INK, markersize=5, markerfacecolor="white", label="joint", gid="joints")


def _draw_marks(axes: Any, marks: Sequence[tuple[str, Array]]) -> None:
    for kind, (marker, color, label) in EXTREMES.items():
        points = np.array([point for found, point in marks if found == kind])
        if len(points):
            axes.plot(
                *points.T,
                marker,
                color=color,
                markersize=7,
                markeredgecolor="white",
                label=label,
                gid=f"extremes-{kind}",
                linestyle="none",
                zorder=5,
            )


def framed(axes: Any, drawn: Sequence[Array], unit: str) -> None:
    """Limits around all that is drawn, with one scale on all axes, and labels."""
    points = np.concatenate(drawn)
    low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    sides = (high - low) * 1.08
    sides = np.maximum(sides, _THINNEST * sides.max())
    names = "xyz"[: len(sides)]
    for name, middle, side in zip(names, (low + high) / 2, sides, strict=True):
        getattr(axes, f"set_{name}lim")(middle - side / 2, middle + side / 2)
        getattr(axes, f"set_{name}label")(f"{name} ({unit})")
    axes.tick_params(labelsize=8)
    if len(sides) == 2:
        axes.set_aspect("equal")
        axes.spines[["top", "right"]].set_visible(False)
        return
    axes.set_proj_type("ortho")
    axes.set_box_aspect(sides.tolist())
    axes.view_init(*view_along(points[np.isfinite(points).all(axis=1)]))
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.set_pane_color("white")
    for name, side in zip(names, sides / sides.max(), strict=True):
        axes.locator_params(axis=name, nbins=1 + round(4 * side))


def view_along(points: Array) -> tuple[float, float]:
    """Elevation and azimuth in degrees, from where points in space look widest, turned a little towards the usual."""
    usual = np.array([0.43, -0.75, 0.5])
    across = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2][-1]
    x, y, z = across * np.copysign(1.0, across @ usual) + 0.8 * usual
    return max(math.degrees(math.atan2(z, math.hypot(x, y))), 10.0), math.degrees(math.atan2(y, x))


def _draw_curvature(axes: Any, smooth: Comb, marks: Sequence[Mark], unit: str) -> None:
    axes.plot(smooth.arc_lengths, smooth.curvature, color=COMB, linewidth=1.6, gid="curvature")
    _draw_marks(axes, [(kind, np.array([along, value])) for kind, along, value, _ in marks])
    _graph(axes, smooth, f"curvature (1/{unit})", unit)


def _draw_torsion(axes: Any, curve: Derivable, smooth: Comb, unit: str) -> None:
    values = _torsion(curve, smooth)
    axes.plot(smooth.arc_lengths, values, color=LINE, linewidth=1.6, gid="torsion")
    known = np.abs(values[np.isfinite(values)])
    shown = _TORSION_SHOWN * float(np.quantile(known, 0.9)) if known.size else 0.0
    if known.size and known.max() > shown > 0:
        low, high = max(float(np.nanmin(values)), -shown), min(float(np.nanmax(values)), shown)
        axes.set_ylim(low - 0.05 * shown, high + 0.05 * shown)
    _graph(axes, smooth, f"torsion (1/{unit})", unit)


def _torsion(curve: Derivable, smooth: Comb) -> Array:
    """At the feet of a comb, with both values at joints."""
    parts = spans(curve)
    inner = [before + 1 for before, after in smooth.joints if after]
    rows = np.split(smooth.parameters, inner)
    local = [(row - part.start) / (part.end - part.start) for part, row in zip(parts, rows, strict=True)]
    return np.concatenate([torsion(part.curve, t) for part, t in zip(parts, local, strict=True)])


def _graph(axes: Any, smooth: Comb, label: str, unit: str) -> None:
    axes.axhline(0.0, color=GREY, linewidth=0.8)
    for before, after in smooth.joints:
        if after:
            axes.axvline(smooth.arc_lengths[before], color=INK, linewidth=0.8, linestyle=":")
    axes.set_xlim(0.0, smooth.arc_lengths[-1])
    axes.set_xlabel(f"arc length ({unit})")
    axes.set_ylabel(label)
    axes.spines[["top", "right"]].set_visible(False)


def _figures(variant: GammaVariant, unit: str) -> str:
    first, second = variant.curve.gamma
    energy = f"{variant.curvature_energy:.3g}" if np.isfinite(variant.curvature_energy.error) else "infinite"
    names = f"\N{GREEK SMALL LETTER GAMMA} = ({first:g}, {second:g})"
    return f"{names}\nL = {variant.length:.4g} {unit},  E = {energy} / {unit}"
