"""How a search over design variables converged, as PNG or SVG; needs the extra ``plot``."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import numpy as np

from gtcad.pictures import COMB, GREY, INK, LINE, written_picture

if TYPE_CHECKING:
    from gtcad.optimize import Optimum

_SMALL = 1e-16  # of the largest gap: where the graph ends


def draw_convergence(optimum: Optimum, path: str | os.PathLike[str], *, title: str | None = None) -> None:
    """The best value after each iteration, and how far above the last one it was, on a logarithmic scale.

    Parameters
    ----------
    optimum
        A result of ``gtcad.optimize.optimize``.
    path
        The picture, ending in .png or .svg.
    title
        Above the picture; objective and method by default.

    Raises
    ------
    InputError
        When an argument is out of its range.
    FileError
        When the path cannot be written to.
    ExtraMissing
        When matplotlib is not installed.
    """
    steps = np.arange(1, len(optimum.history) + 1)
    shown = np.isfinite(optimum.history)
    values, places = optimum.history[shown], steps[shown]
    heading = f"{optimum.objective}, {optimum.method}, seed {optimum.seed}" if title is None else title
    with written_picture(path, (8.0, 5.5), heading, "mm") as figure:
        upper, lower = figure.subplots(2, 1, sharex=True)
        upper.axhline(optimum.start_value.value, color=GREY, linewidth=1, linestyle="--", label="shape as given")
        upper.plot(places, values, color=LINE, linewidth=2, drawstyle="steps-post", label="best so far")
        upper.plot(places[-1:], values[-1:], "o", color=COMB, label=f"result {optimum.value.value:.9g}")
        upper.set_ylabel("value", color=INK)
        upper.legend(frameon=False, fontsize=9)
        gaps = values - values[-1:]
        above = gaps > _SMALL * max(float(gaps.max(initial=0.0)), np.finfo(float).tiny)
        if above.any():
            lower.semilogy(places[above], gaps[above], color=LINE, linewidth=2, marker=".", markersize=4)
        else:
            lower.text(0.5, 0.5, "the same value throughout", transform=lower.transAxes, ha="center", color=INK)
        lower.yaxis.set_major_formatter(lambda value, _: f"{value:.3g}")
        lower.yaxis.set_minor_formatter(lambda *_: "")
        lower.set_ylabel("above the result", color=INK)
        lower.set_xlabel("iteration", color=INK)
        for axes in (upper, lower):
            axes.grid(True, linewidth=0.5)
            axes.spines[["top", "right"]].set_visible(False)
        figure.suptitle(heading, fontsize=13, color=INK)
