"""Pictures of docs/developables.md: developable samples beside their flat patterns, and the effect of gamma.

``python samples/unroll.py --output docs/images`` draws them all anew; names after it draw only these.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from pages import draw_pictures
from render import Camera, Scene, frame

import gtcad
from gtcad.converters.flat_outline import Sheet, draw_pattern
from gtcad.developable_studies import gamma_effects
from gtcad.flat_pattern import FlatPattern, develop
from gtcad.flat_strip import FlatStrip, develop_strip
from gtcad.patches import Ruled
from gtcad.patches.developable import Enveloping
from gtcad.protocol import SeparableCurve, SeparableSurface
from gtcad.quilt import Quilt

SAMPLES = Path(__file__).parent
INK, BEND, MARK, PAPER = "#20242c", "#1f4fb2", "#2a7f3f", "#f4f1ea"
CELLS = 48
TOLERANCE = 0.01
GAMMAS = ((-0.8, -0.8), (0.0, 0.0), (0.9, 0.9))
SHOWN = {  # title, azimuth and elevation of the eye in degrees, bend lines
    "hopper.toml": ("Hopper: nine patches, one sheet", -60, 24, 32),
    "hull-plate.toml": ("Side of a boat: enveloped by planes", 62, 22, 12),
    "paper-lamp.toml": ("Paper lamp: six gores", -52, 18, 14),
    "shoe-upper.toml": ("Collar of a shoe: its topline is a geodesic", 150, 32, 30),
}


def draw_samples(path: Path) -> None:
    figure = plt.figure(figsize=(10.5, 12.5), layout="constrained")
    rows = figure.subfigures(len(SHOWN), 1)
    for row, (sample, (title, azimuth, elevation, bends)) in zip(rows, SHOWN.items(), strict=True):
        model = gtcad.load_model(SAMPLES / sample)
        shapes = {name: shape for name, shape in model.items() if name not in model.construction}
        left, right = row.add_subplot(1, 2, 1), row.add_subplot(1, 2, 2)
        patches = [patch for shape in shapes.values() for patch in patches_of(shape)]
        color = next(iter(model.colors.values()))
        draw_space(left, patches, color, (azimuth, elevation))
        left.set_title(title, fontsize=11, color=INK)
        name = next(iter(shapes))  # of shapes alike the first one
        draw_sheet(right, sheet_of(model, name, bends))
        sheets = "one of six" if len(shapes) > 1 else "flat"
        area, around = pattern_of(model[name]).area, sheet_of(model, name, 0).cut[0].length
        right.set_title(
            f"{sheets}: {figure_of(area)} {model.unit}², {figure_of(around)} {model.unit} around",
            fontsize=11,
            color=INK,
        )
    figure.savefig(path, dpi=80)
    plt.close(figure)


def draw_gamma(path: Path) -> None:
    """The lamp and the side of the boat with other design variables, all control points and planes being the same."""
    lamp = gtcad.load_model(SAMPLES / "paper-lamp.toml")
    gores = [shape for shape in lamp.values() if isinstance(shape, Ruled)]
    plate = gtcad.load_model(SAMPLES / "hull-plate.toml")["side"]
    assert isinstance(plate, Enveloping)
    effects = gamma_effects(plate.family, plate.bound_a, plate.bound_b, GAMMAS)
    figure = plt.figure(figsize=(10.5, 9.5), layout="constrained")
    for column, (gamma, effect) in enumerate(zip(GAMMAS, effects, strict=True), 1):
        others = [Ruled(with_gamma(gore.a, gamma), with_gamma(gore.b, gamma)) for gore in gores]
        upper = figure.add_subplot(3, 3, column)
        draw_space(upper, others, lamp.colors["gore 1"], SHOWN["paper-lamp.toml"][1:3])
        upper.set_title(f"gamma = ({gamma[0]:g}, {gamma[1]:g})", fontsize=11, color=INK)
        middle = figure.add_subplot(3, 3, 3 + column)
        gore = develop(others[0])
        draw_sheet(middle, draw_pattern(gore, tolerance=TOLERANCE, bend_lines=12))
        middle.set_title(f"gore: {gore.area / 100:.1f} cm², {gore.lengths['v0']:.1f} mm along", fontsize=9, color=INK)
        lower = figure.add_subplot(3, 3, 6 + column)
        assert effect.patch is not None
        draw_sheet(lower, draw_pattern(develop(effect.patch), tolerance=1e-4, bend_lines=12))
        text = f"boat: {effect.area:.3f} m², {effect.lengths[0]:.3f} and {effect.lengths[1]:.3f} m along"
        lower.set_title(text, fontsize=9, color=INK)
    figure.savefig(path, dpi=80)
    plt.close(figure)


def with_gamma(curve: SeparableCurve, gamma: tuple[float, float]) -> gtcad.Curve:
    assert isinstance(curve, gtcad.Curve)
    return gtcad.Curve(curve.control_points, gamma)


def figure_of(value: float) -> str:
    return f"{value:.0f}" if value > 100 else f"{value:.3f}"


def patches_of(shape: Any) -> Sequence[SeparableSurface]:
    return shape.patches if isinstance(shape, Quilt) else (shape,)


def pattern_of(shape: Any) -> FlatPattern | FlatStrip:
    return develop_strip(shape) if isinstance(shape, Quilt) else develop(shape)


def sheet_of(model: gtcad.Model, name: str, bends: int) -> Sheet:
    """The flat pattern of a shape with what the model states on it, in the model's unit."""
    pattern = pattern_of(model[name])
    drawn: dict[bool, list[Any]] = {True: [], False: []}
    for marking in model.markings:
        curve: Any = model[marking.curve]
        if marking.on == name and isinstance(pattern, FlatPattern):
            drawn[marking.hole].append(pattern.image(curve))
        elif marking.on.startswith(f"{name}.") and isinstance(pattern, FlatStrip):
            drawn[marking.hole].append(pattern.image(marking.on.removeprefix(f"{name}."), curve))
    tolerance = TOLERANCE if model.unit == "mm" else 1e-4
    return draw_pattern(pattern, tolerance=tolerance, bend_lines=bends, holes=drawn[True], marks=drawn[False])


def draw_space(axes: Axes, patches: Sequence[SeparableSurface], color: str, view: tuple[float, float]) -> None:
    t = np.linspace(0.0, 1.0, CELLS + 1)
    points = np.concatenate([patch.evaluate(t[:, None], t).reshape(-1, 3) for patch in patches])
    scene = Scene(Camera.around(points, *view))
    for patch in patches:
        scene.add_surface(patch, color, CELLS)
    scene.draw(axes)
    frame(axes, scene.camera.project(points)[0])


def draw_sheet(axes: Axes, sheet: Sheet) -> None:
    """Draw a sheet with its longest axis level."""
    points = sheet.cut[0].points()
    along = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2][0]
    along *= np.sign(along[0])
    turn = np.array([[along[0], -along[1]], [along[1], along[0]]])
    outer, *holes = (path.points() @ turn for path in sheet.cut)
    axes.fill(*outer.T, facecolor=PAPER, edgecolor=INK, linewidth=1.2)
    for hole in holes:
        axes.fill(*hole.T, facecolor="#ffffff", edgecolor=INK, linewidth=1.2, zorder=3)
    for piece in (piece for line in sheet.bend for piece in line.pieces):
        axes.plot(*(np.array(piece) @ turn).T, color=BEND, linewidth=0.6, dashes=(6, 3))
    for mark in sheet.mark:
        axes.plot(*(mark.points() @ turn).T, color=MARK, linewidth=1.0)
    axes.set_aspect("equal")
    axes.axis("off")


PICTURES: dict[str, Callable[[Path], None]] = {"flat-patterns": draw_samples, "flat-gamma": draw_gamma}


if __name__ == "__main__":
    draw_pictures("docs/developables.md", PICTURES)
