"""Pictures of docs/curves.md: curvature combs of two samples, a study of the design variables, local control.

``python samples/combs.py --output docs/images`` draws them all anew; names after it draw only these.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from pages import draw_pictures

import gtcad
from gtcad.composite import Composite
from gtcad.pictures import COMB, GREY, INK, LINE, draw_comb, draw_gamma_study

SAMPLES = Path(__file__).parent
COLORS = 64  # enough for line drawings, and a quarter of the size
POLYGON = [[0, 0], [5, 80], [62, 105], [100, 8]]
MOVED = (1, 3, (10.0, -12.0))  # piece, control point, and by how much


def chain_of(sample: str) -> Composite:
    """The first shape of a sample."""
    chain = next(iter(gtcad.load_model(SAMPLES / f"{sample}.toml").values()))
    assert isinstance(chain, Composite)
    return chain


def draw_duct(path: Path) -> None:
    draw_comb(chain_of("duct-line"), path, title="Centre line of a duct: straight pieces and bends, joined G3")


def draw_arch(path: Path) -> None:
    draw_comb(chain_of("wheel-arch"), path, title="Trim of a wheel arch: a closed chain, joined G3", teeth=240)


def draw_study(path: Path) -> None:
    draw_gamma_study(gtcad.Curve(POLYGON), path, title="One polygon, nine pairs of design variables")


def zigzag(moved: bool) -> Composite:
    """A chain of five pieces joined G1, drawn anew with a control point moved."""
    points = np.array(
        [[[40 * k + 10 * i, (-1) ** k * 24 * (i in (1, 2, 3))] for i in range(5)] for k in range(5)], float
    )
    fixed = [(k, i) for k in range(5) for i in (0, 4)]
    drawn = Composite.solved([gtcad.Curve(piece) for piece in points], ["G1"] * 4, fixed=fixed)
    if not moved:
        return drawn
    piece, control_point, shift = MOVED
    changed = np.array(drawn.pieces[piece].coefficients)
    changed[control_point] += shift
    pieces = [*drawn.pieces[:piece], gtcad.Curve(changed), *drawn.pieces[piece + 1 :]]
    return Composite.solved(pieces, drawn.orders, fixed=[*fixed, (piece, control_point)])  # type: ignore[arg-type]


def draw_local_control(path: Path) -> None:
    """Which pieces change when one control point does."""
    before, after = zigzag(False), zigzag(True)
    joints, touched = before.touched(*MOVED[:2])
    figure, axes = plt.subplots(figsize=(8, 2.8), layout="constrained")
    t = np.linspace(0.0, 1.0, 201)
    for k, (old, new) in enumerate(zip(before.pieces, after.pieces, strict=True)):
        axes.plot(*old.evaluate(t).T, "--", color=GREY, linewidth=1.2)
        axes.plot(*new.evaluate(t).T, color=COMB if k in touched else LINE, linewidth=2.2)
    for k, piece in enumerate(after.pieces[:-1]):
        axes.plot(*piece.evaluate(1.0), "D", color=COMB if k in joints else INK, markersize=6, markerfacecolor="white")
    place = before.pieces[MOVED[0]].coefficients[MOVED[1]]
    axes.annotate("", place + MOVED[2], place, arrowprops={"arrowstyle": "->", "color": INK}, annotation_clip=False)
    axes.plot(*place, "s", color=GREY, markersize=5, markerfacecolor="white")
    axes.set_title("One control point moved: the pieces in orange change, the joint in orange is solved anew")
    axes.title.set_fontsize(10)
    axes.set_aspect("equal")
    axes.axis("off")
    figure.savefig(path, dpi=130)
    plt.close(figure)


PICTURES: dict[str, Callable[[Path], None]] = {
    "duct-comb": draw_duct,
    "arch-comb": draw_arch,
    "gamma-study": draw_study,
    "local-control": draw_local_control,
}


if __name__ == "__main__":
    draw_pictures("docs/curves.md", PICTURES, colors=COLORS)
