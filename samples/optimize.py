"""Pictures of docs/optimisation.md: developables of each kind with their flat patterns, and a patch, before and after.

``python samples/optimize.py --output docs/images`` draws them all anew; names after it draw only these.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import SubFigure
from mpl_toolkits.mplot3d import Axes3D
from numpy.typing import NDArray
from pages import draw_pictures

import gtcad
from gtcad.differential import mean_curvature
from gtcad.flat_pattern import FlatPattern, develop, polygon
from gtcad.optimize import Optimum, optimize
from gtcad.patches.developable import quasi_developable, spine_developable
from gtcad.patches.minimal import dirichlet_extremal
from gtcad.protocol import SeparableSurface

Array = NDArray[np.float64]

SAMPLES = Path(__file__).parent
INK, BEFORE, AFTER = "#20242c", "#9aa3ad", "#1f4fb2"
MAP = plt.get_cmap("RdBu_r")
CELLS = 48
MOST_TWIST = 45.0  # degrees: strips are flattened as they are
BENDS = 10


@dataclass(frozen=True)
class Design:
    """A sample to optimise: what it is, what for, where to look from (azimuth and elevation), and its unit."""

    title: str
    patch: SeparableSurface
    objective: str
    view: tuple[float, float]
    unit: str = "mm"


def boat() -> Design:
    """The side of a boat, enveloped by planes."""
    plate = gtcad.load_model(SAMPLES / "hull-plate.toml")["side"]
    assert isinstance(plate, SeparableSurface)
    return Design("enveloping: the side of a boat", plate, "dual-variation", (75, 28), "m")


def chute() -> Design:
    """A chute along the tangents of a space curve."""
    spine = gtcad.Curve([(0, 0, 0), (120, 0, 0), (160, 90, 30), (90, 150, 90), (20, 100, 150)], (-0.6, 0.9))
    return Design(
        "tangent surface: a chute", spine_developable(spine, (30, 90)), "spine-curvature-variation", (-60, 30)
    )


def collar() -> Design:
    """The collar of a shoe, its topline a geodesic."""
    half = gtcad.load_model(SAMPLES / "shoe-upper.toml")["left"]
    assert isinstance(half, SeparableSurface)
    return Design("geodesic: the collar of a shoe", half, "geodesic-curvature-variation", (150, 32))


def hood() -> Design:
    """A hood of sheet metal between two given edges."""
    low = gtcad.Curve([(0, 0, 0), (10, 90, 0), (130, 110, 0), (200, 0, 0)], (0.8, -0.8))
    high = gtcad.Curve([(40, 0, 80), (60, 50, 95), (120, 60, 95), (150, 0, 80)], (-0.8, 0.8))
    return Design("between two curves: a hood", quasi_developable(low, high), "twist", (-60, 28))


DESIGNS: tuple[Callable[[], Design], ...] = (boat, chute, collar, hood)


def canopy() -> Design:
    """A canopy inside a net of boundary control points: the extremal for every gamma, as published."""
    t = np.linspace(0, 1, 4)
    x, y = np.meshgrid(6 * t, 4 * t, indexing="ij")
    z = 2.5 + 1.5 * np.cos(np.pi * x / 6) * np.cos(np.pi * y / 4) - 0.8 * np.sin(np.pi * y / 4)
    film = dirichlet_extremal(np.stack([x, y, z], axis=-1))
    return Design("canopy, its edges free to move with gamma", film, "dirichlet", (-60, 28), "m")


@cache
def optimised(make: Callable[[], Design]) -> tuple[Design, Optimum]:
    """A design and the best of its shapes."""
    design = make()
    return design, optimize(design.patch, design.objective, particles=12, iterations=25)


def draw_developables(path: Path) -> None:
    figure = plt.figure(figsize=(12, 3.1 * len(DESIGNS)), layout="constrained")
    rows = figure.subfigures(len(DESIGNS), 1)
    for row, make in zip(rows, DESIGNS, strict=True):
        design, best = optimised(make)
        draw_pair(row, design, best, columns=3)
        flat = row.add_subplot(1, 3, 3)
        for patch, color, label in ((design.patch, BEFORE, "before"), (best.shape, AFTER, "after")):
            draw_pattern(flat, develop(patch, twist_deg=MOST_TWIST), color, label)
        flat.set_aspect("equal")
        flat.tick_params(labelsize=7)
        flat.set_title(f"flat, in {design.unit}", fontsize=10, color=INK)
        if make is DESIGNS[0]:
            flat.legend(fontsize=8, frameon=False, loc="upper left")
    figure.savefig(path, dpi=80)
    plt.close(figure)


def draw_canopy(path: Path) -> None:
    design, best = optimised(canopy)
    figure = plt.figure(figsize=(10, 4.2), layout="constrained")
    draw_pair(figure.subfigures(1, 1), design, best, columns=2)
    figure.savefig(path, dpi=80)
    plt.close(figure)


def draw_convergence(path: Path) -> None:
    design, best = optimised(hood)
    best.plot(path, title=f"{design.title}: {design.objective}")


def draw_pair(place: SubFigure, design: Design, best: Optimum, columns: int) -> None:
    """The patch before and after, with one range of colours for both."""
    pair: Sequence[tuple[str, Any, float]] = (
        ("before", design.patch, best.start_value),
        ("after", best.shape, best.value),
    )
    t = np.linspace(0, 1, CELLS + 1)
    middle = (t[1:] + t[:-1]) / 2
    curvatures = [mean_curvature(patch, middle[:, None], middle[None, :]) for _, patch, _ in pair]
    limit = float(np.quantile(np.abs(curvatures), 0.98))
    scale = ScalarMappable(Normalize(-limit, limit), MAP)
    axes = []
    for column, ((label, patch, value), values) in enumerate(zip(pair, curvatures, strict=True), 1):
        one = place.add_subplot(1, columns, column, projection="3d")
        draw_space(one, patch.evaluate(t[:, None], t[None, :]), scale.to_rgba(values), design.view)
        name = design.title if column == 1 else design.objective
        one.set_title(f"{name}\n{label}: {value:.5g}", fontsize=10, color=INK)
        axes.append(one)
    bar = place.colorbar(scale, ax=axes, shrink=0.7, pad=0.02)
    bar.set_label(f"mean curvature, 1/{design.unit}", fontsize=8)
    bar.ax.tick_params(labelsize=7)


def draw_space(axes: Axes3D, points: Array, colors: Array, view: tuple[float, float]) -> None:
    x, y, z = np.moveaxis(points, 2, 0)
    axes.plot_surface(x, y, z, facecolors=colors, rstride=1, cstride=1, linewidth=0, antialiased=False, shade=False)
    for line in (points[0], points[-1], points[:, 0], points[:, -1]):
        axes.plot(*line.T, color=INK, linewidth=0.8)
    axes.set_box_aspect(np.maximum(np.ptp(points, axis=(0, 1)), 1e-9), zoom=1.2)
    axes.view_init(elev=view[1], azim=view[0])
    axes.set_axis_off()


def draw_pattern(axes: Axes, pattern: FlatPattern, color: str, label: str) -> None:
    points = polygon(pattern.contour)
    axes.plot(*np.concatenate([points, points[:1]]).T, color=color, linewidth=1.6, label=label)
    for bend in pattern.bend_lines(BENDS):
        axes.plot(*np.transpose([bend.start, bend.end]), color=color, linewidth=0.6, linestyle="--")


PICTURES: dict[str, Callable[[Path], None]] = {
    "optimised-developables": draw_developables,
    "optimised-canopy": draw_canopy,
    "convergence": draw_convergence,
}


if __name__ == "__main__":
    draw_pictures("docs/optimisation.md", PICTURES)
