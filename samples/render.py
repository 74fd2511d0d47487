"""Pictures of model files: shaded surfaces with isolines and control nets, curves with their control polygons.

``python samples/render.py --output build/pictures`` renders every sample and the picture of the README;
``python samples/render.py --output docs/images overview`` renders only the latter, which is kept in the repository,
as is ``patches``, the picture of docs/patches.md.
"""

from __future__ import annotations

import argparse
import itertools
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline
from numpy.typing import NDArray
from PIL import Image

import gtcad
from gtcad.composite import Composite
from gtcad.converters import fit_curve
from gtcad.differential import normal
from gtcad.model import Model
from gtcad.protocol import SIDES, SeparableCurve, SeparableSurface, Shape
from gtcad.quilt import Quilt, Use
from gtcad.restricted import Restricted, RestrictedSurface
from gtcad.solid import Solid

Array = NDArray[np.float64]

SAMPLES = Path(__file__).parent
OVERVIEW = "overview"  # the picture of the README
BODIES = "patches"  # that of docs/patches.md
BODY_SAMPLES = ("vase", "lamp-shade", "duct", "turbine-blade", "bottle", "bonnet")
DEFAULT_COLOR = "#8fa8c8"
INK, NET, PAPER = "#20242c", "#5b6472", "#ffffff"
LIGHT = np.array([-0.45, 0.75, 0.65])  # right, up and towards the viewer
FILL = np.array([0.8, 0.1, 0.5])
LAMPS = np.array([[0.35, 0.75, -0.56], [0.2, 0.97, -0.1], [0.86, 0.31, 0.4]])  # normals of the planes of long lamps
BRIGHTNESS = np.array([0.3, 0.14, 0.08])
CLEAR = (0.0, 0.0, 0.0, 0.0)
FACETS, ISOLINES, STROKE = 90_000, 8, 96
LIFT, DOT = 0.005, 0.0009  # of the distance: strokes lie above the facets; size of a control point
CIRCLE = np.array([[np.cos(a), np.sin(a)] for a in np.linspace(0.0, 2 * np.pi, 12, endpoint=False)])
OPENED = {"bottle": 0.25, "vase": 0.25}  # the part of a turn that is cut out, to show the inside
VIEWS = {  # azimuth and elevation of the eye in degrees
    "bonnet": (42.0, 26.0),
    "bottle": (-45.0, 18.0),
    "duct": (-62.0, 28.0),
    "lamp-shade": (-60.0, 24.0),
    "turbine-blade": (-78.0, 30.0),
    "vase": (-45.0, 22.0),
    "duct-line": (-60.0, 24.0),
    "handle": (-62.0, 22.0),
    "pipe-elbow": (-128.0, 28.0),
    "saddle-roof": (-52.0, 20.0),
    "visor": (14.0, 20.0),
}


@dataclass(frozen=True)
class Camera:
    """A pinhole camera that looks at the middle of a box from a distance of a few box sizes."""

    middle: Array
    axes: Array
    distance: float

    @classmethod
    def around(cls, points: Array, azimuth: float, elevation: float) -> Camera:
        """Look at the box of the points from a direction in degrees."""
        least, most = points.min(axis=0), points.max(axis=0)
        a, e = np.radians([azimuth, elevation])
        toward = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        right = np.array([-np.sin(a), np.cos(a), 0.0])
        axes = np.array([right, np.cross(toward, right), toward])
        return cls((least + most) / 2, axes, 3.2 * float(np.linalg.norm(most - least)))

    def project(self, points: Array) -> tuple[Array, Array]:
        """Places in the picture, shape (..., 2), and depths, larger the nearer, shape (...)."""
        seen = (points - self.middle) @ self.axes.T
        away = self.distance - seen[..., 2]
        return seen[..., :2] * (self.distance / away)[..., None], -away


@dataclass
class Scene:
    """Facets and strokes, painted from back to front."""

    camera: Camera
    outlines: list[Array] = field(default_factory=list)
    depths: list[float] = field(default_factory=list)
    faces: list[tuple[float, ...]] = field(default_factory=list)
    edges: list[tuple[float, ...]] = field(default_factory=list)
    widths: list[float] = field(default_factory=list)

    def add_surface(self, surface: SeparableSurface, color: str, cells: int) -> None:
        """Facets, isolines and borders of a surface."""
        t = np.linspace(0.0, 1.0, cells + 1)
        self.add_facets(surface.evaluate(t[:, None], t[None, :]), color)
        for k, x in enumerate(np.linspace(0.0, 1.0, ISOLINES + 1)):
            border = k in (0, ISOLINES)
            s = np.linspace(0.0, 1.0, STROKE + 1)
            for line in (surface.evaluate(x, s), surface.evaluate(s, x)):
                self.add_stroke(line, INK, *((1.1, 0.9) if border else (0.45, 0.35)))

    def add_facets(self, grid: Array, color: str) -> None:
        """Facets between the points of a grid."""
        corners = np.stack([grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]], axis=2).reshape(-1, 4, 3)
        places, depths = self.camera.project(corners)
        shades = self._shades(corners, np.array(to_rgb(color)))
        for outline, depth, shade in zip(places, depths.mean(axis=1), shades, strict=True):
            self._add(outline, depth, (*shade, 1.0), (*shade, 1.0), 0.5)

    def add_polygon(self, points: Array, color: str) -> None:
        """A plane face within a closed line, brighter than what surrounds it."""
        places, depths = self.camera.project(points)
        bright = 1 - 0.6 * (1 - np.array(to_rgb(color)))
        self._add(places, depths.mean() + LIFT * self.camera.distance, (*bright, 1.0), CLEAR, 0)
        self.add_stroke(np.concatenate([points, points[:1]]), INK, 1.1, 0.9)

    def add_stroke(self, points: Array, color: str, width: float, opacity: float = 1.0, lift: float = LIFT) -> None:
        """A line through points, lifted towards the eye by a part of the distance."""
        places, depths = self.camera.project(points)
        depths = depths + lift * self.camera.distance
        for k in range(len(points) - 1):
            self._add(places[k : k + 2], depths[k : k + 2].mean(), CLEAR, (*to_rgb(color), opacity), width)

    def add_net(self, points: Array, opacity: float) -> None:
        """Rows and columns of a control net, with a dot for each point."""
        for row in [*points, *points.swapaxes(0, 1)]:
            for start, end in itertools.pairwise(row):
                self.add_stroke(start + np.linspace(0, 1, 25)[:, None] * (end - start), NET, 0.6, opacity, LIFT / 4)
        ink = (*to_rgb(NET), opacity)
        places, depths = self.camera.project(points.reshape(-1, 3))
        for place, depth in zip(places, depths, strict=True):
            self._add(place + DOT * self.camera.distance * CIRCLE, depth + LIFT * self.camera.distance, ink, ink, 0)

    def draw(self, axes: Axes) -> None:
        """Paint everything, the farthest first."""
        order = np.argsort(self.depths, kind="stable")
        axes.add_collection(
            PolyCollection(
                [self.outlines[k] for k in order],
                facecolors=[self.faces[k] for k in order],
                edgecolors=[self.edges[k] for k in order],
                linewidths=[self.widths[k] for k in order],
                capstyle="round",
            )
        )

    def _add(
        self, outline: Array, depth: float, face: tuple[float, ...], edge: tuple[float, ...], width: float
    ) -> None:
        self.outlines.append(outline)
        self.depths.append(float(depth))
        self.faces.append(face)
        self.edges.append(edge)
        self.widths.append(width)

    def _shades(self, corners: Array, color: Array) -> Array:
        normals = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]) @ self.camera.axes.T
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
        normals *= np.where(normals[:, 2:] < 0, -1.0, 1.0)
        key, fill = (np.clip(normals @ (light / np.linalg.norm(light)), 0, 1)[:, None] for light in (LIGHT, FILL))
        mirrored = 2 * normals[:, 2:] * normals - [0.0, 0.0, 1.0]
        lamps = np.exp(-((mirrored @ LAMPS.T / 0.13) ** 2)) * np.clip(mirrored[:, 2:] + 0.6, 0, 1)
        return np.asarray(np.clip(color * (0.36 + 0.56 * key + 0.2 * fill) + (lamps @ BRIGHTNESS)[:, None], 0, 1))


def draw_body(scene: Scene, shape: Quilt | Solid, color: str, opened: float) -> None:
    """Patches, the offset of a wall, rims and plane caps; without a part of the turn where it is opened."""
    quilt = shape.quilt if isinstance(shape, Solid) else shape
    kept = ((0.0, 1.0), (0.0, 1.0 - opened))
    patches = [Restricted(patch, kept) if opened else patch for patch in quilt.patches]
    thickness = shape.thickness if isinstance(shape, Solid) else None
    cells = min(96, int(np.sqrt(FACETS / len(patches) / (1 if thickness is None else 2))))
    t = np.linspace(0.0, 1.0, cells + 1)
    for index, patch in enumerate(patches):
        scene.add_surface(patch, color, cells)
        if thickness is None:
            continue
        along = -thickness if quilt.flipped[index] else thickness
        points = patch.evaluate(t[:, None], t[None, :])
        other = points + along * normal(patch, t[:, None], t[None, :])
        scene.add_facets(other, color)
        for side in SIDES:
            if Use(index, side) in quilt.free or (opened and side[0] == "v"):
                rim = np.stack([side_of(points, side), side_of(other, side)])
                scene.add_facets(rim, color)
                for line in rim:
                    scene.add_stroke(line, INK, 0.9, 0.9)
    if isinstance(shape, Solid) and thickness is None:
        add_sections(scene, quilt, patches, color, opened)


def add_sections(scene: Scene, quilt: Quilt, patches: Sequence[SeparableSurface], color: str, opened: float) -> None:
    """The plane faces of a full body: where it is cut open, or its caps."""
    t = np.linspace(0.0, 1.0, STROKE + 1)
    if opened:
        whole = [quilt.patches[use.patch].evaluate(t[:, None], t[None, :-1]) for use in quilt.free]
        centres = [side_of(grid, use.side).mean(axis=0) for grid, use in zip(whole, quilt.free, strict=True)]
        for v in (0.0, 1.0):
            scene.add_polygon(np.concatenate([*(patch.evaluate(t, v) for patch in patches), centres]), color)
        return
    grids = [patch.evaluate(t[:, None], t[None, :]) for patch in patches]
    middle = np.concatenate([grid.reshape(-1, 3) for grid in grids]).mean(axis=0)
    for loop in loops([side_of(grids[use.patch], use.side) for use in quilt.free]):
        outwards = np.linalg.svd(loop - loop.mean(axis=0))[2][2]
        outwards *= np.sign(outwards @ (loop.mean(axis=0) - middle))
        if outwards @ scene.camera.axes[2] > 0:
            scene.add_polygon(loop, color)


def side_of(grid: Array, side: str) -> Array:
    """The points of a side of a grid."""
    return np.asarray(np.take(grid, -int(side[1]), axis="uv".index(side[0])))


def loops(lines: Sequence[Array]) -> Iterator[Array]:
    """Closed lines of those that follow each other, whichever way they run."""
    left = list(lines)
    near = 1e-9 * max((float(np.abs(line).max()) for line in lines), default=0.0)
    while left:
        loop = left.pop()
        while np.linalg.norm(loop[-1] - loop[0]) > near:
            ends = [(k, line) for k, one in enumerate(left) for line in (one, one[::-1])]
            k, following = min(ends, key=lambda pair: float(np.linalg.norm(pair[1][0] - loop[-1])))
            loop = np.concatenate([loop, following])
            left.pop(k)
        yield loop


def patches_of(shape: Shape | Quilt | Solid) -> tuple[Shape, ...]:
    """The patches of a body, or the shape itself."""
    quilt = shape.quilt if isinstance(shape, Solid) else shape
    return quilt.patches if isinstance(quilt, Quilt) else (quilt,)


def in_pieces(model: Model) -> Model:
    """The model with the pieces of each chain in its place, without shapes for construction."""
    shapes: dict[str, Any] = {}
    colors = {}
    for name, shape in model.items():
        if name in model.construction:
            continue
        chained = isinstance(shape, Composite)
        found = {f"{name} #{k + 1}": piece for k, piece in enumerate(shape.pieces)} if chained else {name: shape}
        shapes |= found
        colors |= {piece: model.colors[name] for piece in found if name in model.colors}
    return Model(shapes, model.unit, colors)


def net_of(shape: Shape) -> Array:
    """The control points of a shape, plane ones at z = 0."""
    points = shape.coefficients
    return np.pad(points, [(0, 0)] * (points.ndim - 1) + [(0, 3 - points.shape[-1])])


def in_space(shape: Any) -> Any:
    return shape if shape.dimension == 3 else shape.transformed(np.eye(3, 2))


def samples_of(shape: Any) -> Array:
    if isinstance(shape, Quilt | Solid):
        return np.concatenate([samples_of(patch) for patch in patches_of(shape)])
    t = np.linspace(0.0, 1.0, 101)
    points = shape.evaluate(t) if isinstance(shape, SeparableCurve) else shape.evaluate(t[:, None], t[None, :])
    return points.reshape(-1, points.shape[-1])


def draw_space(axes: Axes, model: Model, view: tuple[float, float], *, net: bool = True, opened: float = 0.0) -> None:
    shapes = {name: in_space(shape) for name, shape in model.items()}
    camera = Camera.around(np.concatenate([samples_of(shape) for shape in shapes.values()]), *view)
    scene = Scene(camera)
    seen = [camera.project(samples_of(shape))[0] for shape in shapes.values()]
    cells = min(128, int(np.sqrt(FACETS / len(shapes))))
    for name, shape in shapes.items():
        color = model.colors.get(name, DEFAULT_COLOR)
        if isinstance(shape, Quilt | Solid):
            draw_body(scene, shape, color, opened)
            continue
        if isinstance(shape, SeparableSurface):
            scene.add_surface(shape, color, cells)
        else:
            scene.add_stroke(shape.evaluate(np.linspace(0.0, 1.0, 4 * STROKE + 1)), color, 3.0, lift=0.008)
        if net:
            points = net_of(shape) if isinstance(shape, SeparableSurface) else net_of(shape)[None]
            scene.add_net(points, 0.3 if isinstance(shape, RestrictedSurface) else 0.8)
            seen.append(camera.project(points)[0].reshape(-1, 2))
    scene.draw(axes)
    frame(axes, np.concatenate(seen))


def draw_plane(axes: Axes, model: Model) -> None:
    curves = [shape for shape in model.values() if isinstance(shape, SeparableCurve)]
    t = np.linspace(0.0, 1.0, 401)
    loops = [np.concatenate([curve.evaluate(t) for curve in loop]) for loop in closed_loops(curves)]
    if loops:
        codes = [np.r_[Outline.MOVETO, [Outline.LINETO] * (len(loop) - 1)] for loop in loops]
        outline = Outline(np.concatenate(loops), np.concatenate(codes))
        axes.add_patch(PathPatch(outline, facecolor="#e9edf3", edgecolor="none", zorder=0))
    for name, curve in model.items():
        points = net_of(curve)[:, :2]
        axes.plot(*points.T, "-", color=NET, linewidth=0.6, zorder=1)
        axes.plot(*points.T, "o", color=PAPER, markeredgecolor=NET, markersize=3, markeredgewidth=0.7, zorder=3)
        axes.plot(*curve.evaluate(t).T, color=model.colors.get(name, INK), linewidth=2, zorder=2)
        axes.plot(*curve.evaluate(np.array([0.0, 1.0])).T, "o", color=INK, markersize=3.4, zorder=4)
    frame(axes, np.concatenate([net_of(curve)[:, :2] for curve in curves]))


def closed_loops(curves: Sequence[SeparableCurve]) -> Iterator[list[SeparableCurve]]:
    """Chains of curves, in their order, that start and end at the very same point."""
    chain: list[SeparableCurve] = []
    for curve in curves:
        if chain and not np.array_equal(chain[-1].evaluate(1.0), curve.evaluate(0.0)):
            chain = []
        chain.append(curve)
        if np.array_equal(chain[0].evaluate(0.0), curve.evaluate(1.0)):
            yield chain
            chain = []


def frame(axes: Axes, points: Array) -> None:
    """Equal axes around the points, without ticks or a box."""
    least, most = points.min(axis=0), points.max(axis=0)
    margin = 0.04 * (most - least).max()
    axes.set_xlim(least[0] - margin, most[0] + margin)
    axes.set_ylim(least[1] - margin, most[1] + margin)
    axes.set_aspect("equal")
    axes.axis("off")


def is_plane(model: Model) -> bool:
    return all(shape.dimension == 2 for shape in model.values())


def title_of(name: str, model: Model) -> str:
    points = np.concatenate([samples_of(shape) for shape in in_pieces(model).values()])
    sides = " x ".join(f"{float(f'{side:.3g}'):g}" for side in points.max(axis=0) - points.min(axis=0))
    kinds = Counter(kind_of(shape) for name, shape in model.items() if name not in model.construction)
    counts = [f"{count} {kind}{'s' * (count > 1)}" for kind, count in kinds.items()]
    return f"{name.replace('-', ' ')}: {' and '.join(counts)}, {sides} {model.unit}"


def kind_of(shape: Any) -> str:
    if isinstance(shape, Solid):
        return "solid"
    if isinstance(shape, Quilt):
        return f"quilt of {len(shape.patches)} patches"
    return "chain" if isinstance(shape, Composite) else "curve" if isinstance(shape, SeparableCurve) else "surface"


def draw_model(axes: Axes, name: str, model: Model) -> None:
    if is_plane(model):
        draw_plane(axes, in_pieces(model))
    else:
        draw_space(axes, in_pieces(model), VIEWS.get(name, (-55.0, 25.0)), opened=OPENED.get(name, 0.0))
    axes.set_title(title_of(name, model), fontsize=11, color=INK)


def render_model(path: Path, output: Path) -> Path:
    model = gtcad.load_model(path)
    figure, axes = plt.subplots(figsize=(9, 6.6), layout="constrained")
    draw_model(axes, path.stem, model)
    return saved(figure, output / f"{path.stem}.png")


def saved(figure: Figure, path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=130, facecolor=PAPER, bbox_inches="tight", pad_inches=0.15, metadata={"Software": None})
    plt.close(figure)
    return path


def render_bodies(output: Path) -> Path:
    """The samples that are quilts and solids, small, for the page of patches."""
    figure, places = plt.subplots(2, 3, figsize=(10.5, 7), layout="constrained")
    for axes, name in zip(places.flat, BODY_SAMPLES, strict=True):
        [path] = models([name])
        draw_model(axes, name, gtcad.load_model(path))
        axes.title.set_fontsize(8.5)
    path = output / f"{BODIES}.png"
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=100, facecolor=PAPER)
    plt.close(figure)
    with Image.open(path) as picture:
        small = picture.convert("RGB").quantize(192)
    small.save(path, optimize=True)
    return path


def render_overview(output: Path) -> Path:
    """What gtcad is about, in three pictures: the curves of one polygon, a surface, and a proved deviation."""
    figure, (left, middle, right) = plt.subplots(
        1, 3, figsize=(13, 3.5), layout="constrained", gridspec_kw={"width_ratios": [1.0, 1.25, 1.0]}
    )
    draw_family(left)
    draw_space(middle, gtcad.load_model(SAMPLES / "bonnet.json"), VIEWS["bonnet"])
    middle.set_title("surfaces: a bonnet of six patches joined G2", fontsize=11, color=INK)
    draw_deviation(right)
    for axes in (left, middle):
        axes.set_anchor("N")
    return saved(figure, output / f"{OVERVIEW}.png")


def draw_family(axes: Axes) -> None:
    polygon = np.array([[0.0, 0.0], [5.0, 46.0], [62.0, 62.0], [100.0, 8.0]])
    t = np.linspace(0.0, 1.0, 401)
    axes.plot(*polygon.T, "o-", color=NET, linewidth=0.8, markersize=3.5, markerfacecolor=PAPER)
    for gamma, color in zip(
        (-1.0, -0.5, 0.0, 0.5, 1.0), plt.get_cmap("plasma")(np.linspace(0.0, 0.85, 5)), strict=True
    ):
        curve = gtcad.Curve(polygon, (gamma, gamma)).evaluate(t)
        axes.plot(*curve.T, color=color, linewidth=2, label=f"{gamma:+.1f}".replace("+0.0", "0"))
    axes.legend(
        title="$\\gamma_1 = \\gamma_2$", loc="lower center", frameon=False, fontsize=8, title_fontsize=9, reverse=True
    )
    axes.set_title("curves: one polygon, several design variables", fontsize=11, color=INK)
    frame(axes, polygon)


def draw_deviation(axes: Axes) -> None:
    tolerance, nanometres = 1e-4, 1e6
    curve = gtcad.Curve([[0, 0], [5, 46], [62, 62], [100, 8]], (0.5, 0.5))
    fit = fit_curve(curve, tolerance=tolerance)
    t = np.linspace(0.0, 1.0, 2001)
    deviation = nanometres * np.linalg.norm(curve.evaluate(t) - fit.spline.evaluate(t), axis=1)
    blue, red = "#1f6fb2", "#b2431f"
    axes.fill_between(t, deviation, color="#c9d8ea", linewidth=0)
    axes.plot(t, deviation, color=blue, linewidth=1)
    for level, text, color, style in (
        (tolerance, "tolerance", red, "--"),
        (fit.deviation[1], "proved bound", blue, "-"),
    ):
        axes.axhline(nanometres * level, color=color, linewidth=1.2, linestyle=style)
        axes.annotate(
            text, (1.02, nanometres * level), (0, 3), textcoords="offset points", fontsize=8, color=color, ha="right"
        )
    axes.plot(fit.spline.knots, 0 * fit.spline.knots, "|", color=INK, markersize=9)
    axes.set_ylim(0.0, 1.2 * nanometres * tolerance)
    axes.set_xlabel("parameter t, with the knots", fontsize=8)
    axes.set_ylabel("deviation in nanometres", fontsize=8)
    axes.tick_params(labelsize=8)
    axes.spines[["top", "right"]].set_visible(False)
    poles = len(fit.spline.control_points)
    axes.set_title(f"CAD: a B-spline of {poles} poles within 1e-4 mm, proved", fontsize=11, color=INK)


def models(names: Iterable[str]) -> list[Path]:
    """The model files that the command line names, by path or by the name of a sample; every sample for none."""
    everything = sorted(path for path in SAMPLES.iterdir() if path.suffix in (".json", ".toml"))
    by_name = {path.stem: path for path in everything}
    return [by_name.get(name) or Path(name) for name in names] or everything


def main() -> None:
    parser = argparse.ArgumentParser(description="Render model files to PNG.")
    parser.add_argument("--output", type=Path, required=True, help="the folder for the pictures")
    parser.add_argument(
        "models", nargs="*", metavar="MODEL", help="a model file, the name of a sample, overview or patches"
    )
    given = parser.parse_args()
    pictures = {OVERVIEW: render_overview, BODIES: render_bodies}
    names = [name for name in given.models if name not in pictures]
    if names or not given.models:
        for path in models(names):
            print(render_model(path, given.output))
    for name, render in pictures.items():
        if name in given.models or not given.models:
            print(render(given.output))


if __name__ == "__main__":
    main()
