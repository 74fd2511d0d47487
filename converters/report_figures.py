"""Small drawings of a report, as SVG within the page: histograms and curvature combs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gtcad.converters.report_markup import Markup, element
from gtcad.converters.scene import SceneCurve

if TYPE_CHECKING:
    from gtcad.converters.verdicts import Histogram

Array = NDArray[np.float64]

_CURVE, _COMB = "#0072b2", "#e69f00"


def histogram_svg(histogram: Histogram) -> Markup:
    """Bars of equal width on the page, labelled with the first and the last edge."""
    counts, edges = histogram.counts, histogram.edges
    most, width = max(max(counts, default=0), 1), 100 / max(len(counts), 1)
    bars = (
        element(
            "rect",
            x=f"{k * width:.2f}",
            y=f"{26 - 24 * n / most:.2f}",
            width=f"{0.9 * width:.2f}",
            height=f"{24 * n / most:.2f}",
        )
        for k, n in enumerate(counts)
    )
    title = element(
        "title", f"{sum(counts)} samples from {edges[0]:.3g} to {edges[-1]:.3g} mm, at most {most} in a bar"
    )
    base = element("line", x1=0, y1=26, x2=100, y2=26)
    labels = (
        element("text", f"{edge:.2g}", x=x, y=36, text_anchor=anchor)
        for x, anchor, edge in ((0, "start", edges[0]), (100, "end", edges[-1]))
    )
    return element("svg", title, *bars, base, *labels, viewBox="0 0 100 38", class_="histogram", role="img")


def curve_figures(curves: Sequence[SceneCurve]) -> Markup:
    """For each curve its comb in the plane that shows it widest, and the curvature over arc length."""
    drawn = [
        element("figure", _comb_svg(curve), _curvature_svg(curve), element("figcaption", curve.name))
        for curve in curves
        if curve.comb is not None and curve.arc_lengths is not None
    ]
    return element("div", element("h3", "Curvature combs"), *drawn, class_="combs") if drawn else Markup("")


def _comb_svg(curve: SceneCurve) -> Markup:
    assert curve.comb is not None
    tips = np.where(np.isfinite(curve.comb), curve.comb, curve.points)
    across = np.linalg.svd(curve.points - curve.points.mean(axis=0), full_matrices=False)[2][:2]
    feet, ends = curve.points @ across.T, tips @ across.T
    both = np.concatenate([feet, ends])
    low, size = both.min(axis=0), max(float(np.ptp(both, axis=0).max()), 1e-300)
    room = np.array([280.0, 130.0])
    k = float((room / np.maximum(np.ptp(both, axis=0), 1e-9 * size)).min())
    shift = (room - k * np.ptp(both, axis=0)) / 2 + 5

    def path(points: Array) -> str:
        xy = shift + k * (points - low)
        return " ".join(f"{x:.1f},{140 - y:.1f}" for x, y in xy)

    teeth = np.stack([feet, ends], axis=1)
    lines = (element("polyline", points=path(tooth), stroke=_COMB, stroke_width=0.5) for tooth in teeth)
    envelope = element("polyline", points=path(ends), stroke=_COMB, stroke_width=1)
    line = element("polyline", points=path(feet), stroke=_CURVE, stroke_width=2)
    title = element("title", f"{curve.name} with its curvature comb")
    return element("svg", title, *lines, envelope, line, viewBox="0 0 290 140", fill="none", role="img")


def _curvature_svg(curve: SceneCurve) -> Markup:
    assert curve.arc_lengths is not None
    assert curve.curvature is not None
    s, kappa = curve.arc_lengths, np.where(np.isfinite(curve.curvature), curve.curvature, 0.0)
    top, low, length = max(float(kappa.max()), 0.0), min(float(kappa.min()), 0.0), max(float(s[-1]), 1e-300)
    span = max(top - low, 1e-9 / length)
    points = " ".join(
        f"{30 + 255 * x / length:.1f},{15 + 95 * (top - y) / span:.1f}" for x, y in zip(s, kappa, strict=True)
    )
    zero = 15 + 95 * top / span
    labels = (
        element("text", f"curvature, 1/mm: {low:.3g} to {top:.3g}", x=30, y=10),
        element("text", f"arc length, mm: 0 to {length:.5g}", x=285, y=128, text_anchor="end"),
    )
    axis = element("line", x1=30, y1=f"{zero:.1f}", x2=285, y2=f"{zero:.1f}", stroke="#767676", stroke_width=1)
    graph = element("polyline", points=points, stroke=_COMB, stroke_width=1.5, fill="none")
    title = element("title", f"curvature of {curve.name} over its arc length")
    return element("svg", title, axis, graph, *labels, viewBox="0 0 290 140", role="img")
