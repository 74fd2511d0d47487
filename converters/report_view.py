"""The 3D view of a report: its buttons, and the scene as numbers that a page can hold."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gtcad.converters.report_markup import Markup, element, script_data
from gtcad.converters.scene import Scene, SceneCurve, SceneFace
from gtcad.converters.scene_edges import ANGLE, BEND, GAP

Array = NDArray[np.float64]

MAPS = {
    "magnitude": ("#440154", "#472d7b", "#3b528b", "#2c728e", "#21918c", "#28ae80", "#5ec962", "#addc30", "#fde725"),
    "signed": ("#053061", "#2166ac", "#67a9cf", "#aecde1", "#dedede", "#f2bd83", "#e89a45", "#c96a10", "#7f3b08"),
}
"""Colours for magnitudes and for values with a sign, told apart with any colour vision."""

EDGES = {
    "free": ("#d55e00", 4.0, (9.0, 5.0), "free or open"),
    "G0": ("#111111", 3.0, (0.0, 0.0), "G0: a crease"),
    "G1": ("#0072b2", 2.4, (14.0, 5.0), "G1: tangent planes agree"),
    "G2": ("#009e73", 1.6, (3.0, 4.0), "G2: curvatures agree"),
}
"""Colour, width and dashes of the edges of each order: told apart without colours too."""

CURVE, NET, COMB = "#0072b2", "#6b6b6b", "#e69f00"

CURVE, NET, COMB = "#0072b2", "#6b6b6b", "#e69f00"
_MOST_NET = 60_000  # points of control nets in one view


def viewer(scene: Scene, tolerance: float | None, measured: bool) -> Markup:
    """The view with its buttons and data; whether the orders of its edges were measured by the check for CAM."""
    data = scene_data(scene, tolerance)
    known = any(np.isfinite(face.values["deviation"]).any() for face in scene.faces)
    modes = [("deviation", "Deviation"), ("distance", "Distance")] if known else []
    modes += [("mean", "Mean curvature"), ("gaussian", "Gaussian curvature"), ("zebra", "Zebra"), ("plain", "Plain")]
    first = "deviation" if known else "plain"
    kinds = {group["kind"] for group in data["lines"]}
    lines = [("edges", "Edges by continuity"), ("net", "Control net"), ("comb", "Curvature combs")]
    shown = ("edges",) if scene.faces else ("edges", "comb")
    colours = [
        element("button", title, type="button", data_mode=key, aria_pressed=str(key == first).lower())
        for key, title in modes
        if scene.faces
    ] or [element("button", "Plain", type="button", data_mode="plain", aria_pressed="true", hidden="")]
    toggles = [
        element("button", title, type="button", data_lines=key, aria_pressed=str(key in shown).lower())
        for key, title in lines
        if key in kinds
    ]
    if known and tolerance is not None:
        toggles.append(
            element("button", f"Scale to {tolerance:g} mm", type="button", data_tolerance="", aria_pressed="false")
        )
    looks = [
        element("button", key.capitalize(), type="button", data_view=key) for key in ("fit", "top", "front", "right")
    ]
    groups = [
        element("div", *buttons, class_="group", role="group", aria_label=label)
        for label, buttons in (("colours", colours), ("lines", toggles), ("point of view", looks))
        if buttons
    ]
    help_text = (
        "Drag to turn, with shift to move, wheel to zoom after a click; arrows, + and - do the same; a click selects."
    )
    canvas = element(
        "canvas", "The view needs a browser with scripts.", tabindex=0, role="application",
        aria_label="3D view of the file: arrow keys turn it, plus and minus zoom, Escape deselects",
    )  # fmt: skip
    key = edge_key(scene, measured) if "edges" in kinds else Markup("")
    picture = element(
        "div", canvas, element("svg", viewBox="0 0 60 60", class_="triad", aria_hidden="true"),
        element("div", class_="legend"), key, class_="picture",
    )  # fmt: skip
    side = element("aside", help_text, class_="selected", aria_live="polite")
    stored = element("script", script_data(data), type="application/json", class_="scene")
    return element(
        "div",
        element("div", *groups, class_="tools"),
        element("div", picture, side, class_="stage"),
        stored,
        class_="viewer",
    )


def edge_key(scene: Scene, measured: bool) -> Markup:
    """What the lines of edges mean."""
    used = {curve.continuity for curve in scene.curves if curve.kind == "edge"}
    rows = []
    for order, (colour, width, dash, title) in EDGES.items():
        if order in used:
            pattern = " ".join(map(str, dash)) if dash[1] else None
            line = element("line", x1=0, y1=6, x2=44, y2=6, stroke=colour, stroke_width=width, stroke_dasharray=pattern)
            rows.append(element("li", element("svg", line, viewBox="0 0 44 12", aria_hidden="true"), f" {title}"))
    note = (
        "sampled, within the limits of the profile"
        if measured
        else f"sampled: within {GAP:g} mm, {ANGLE:g} degrees, {100 * BEND:g} % of the mean curvature"
    )
    return element("ul", *rows, element("li", note, class_="note"), class_="key") if rows else Markup("")


def scene_data(scene: Scene, tolerance: float | None) -> dict[str, Any]:
    """The scene as numbers that a page can hold, about the middle of its box."""
    everything = [face.vertices for face in scene.faces] + [curve.points for curve in scene.curves]
    everything += [curve.comb for curve in scene.curves if curve.comb is not None]
    points = np.concatenate(everything)
    points = points[np.isfinite(points).all(axis=1)]
    low, high = points.min(axis=0), points.max(axis=0)
    middle = (low + high) / 2
    faces = [
        {
            "name": face.name,
            "count": len(face.vertices),
            "triangles_count": len(face.triangles),
            "places": _packed(face.vertices - middle, "<f4"),
            "normals": _packed(np.pad(32767 * face.normals, ((0, 0), (0, 1))).round(), "<i2"),
            "triangles": _packed(face.triangles, "<u2" if len(face.vertices) <= 65535 else "<u4"),
            "values": {key: _packed(value, "<f4") for key, value in face.values.items() if np.isfinite(value).any()},
        }
        for face in scene.faces
    ]
    box = {"size": (high - low).tolist(), "middle": middle.tolist()}
    return {"box": box, "tolerance": tolerance, "faces": faces, "lines": list(_line_groups(scene, middle))}


def _line_groups(scene: Scene, middle: Array) -> Iterable[dict[str, Any]]:
    for order, (colour, width, dash, _) in EDGES.items():
        edges = [curve.points for curve in scene.curves if curve.kind == "edge" and curve.continuity == order]
        yield from _group("edges", edges, middle, colour, width, dash)
    curves = [curve for curve in scene.curves if curve.kind == "curve"]
    yield from _group("curves", [curve.points for curve in curves], middle, CURVE, 2.5, (0.0, 0.0))
    nets: list[Array] = []
    room = _MOST_NET
    everything: tuple[SceneFace | SceneCurve, ...] = (*scene.faces, *scene.curves)
    for held in everything:
        room -= sum(len(line) for line in held.net)
        nets += held.net if room >= 0 else ()
    yield from _group("net", nets, middle, NET, 1.0, (0.0, 0.0))
    combs: list[Array] = []
    for curve in curves:
        if curve.comb is not None:
            known = np.isfinite(curve.comb).all(axis=1)
            combs += [curve.comb[known], *np.stack([curve.points[known], curve.comb[known]], axis=1)]
    yield from _group("comb", combs, middle, COMB, 1.0, (0.0, 0.0))


def _group(
    kind: str, lines: Sequence[Array], middle: Array, colour: str, width: float, dash: tuple[float, float]
) -> Iterable[dict[str, Any]]:
    if not lines:
        return
    rgb = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    points = _packed(np.concatenate(lines) - middle, "<f4")
    yield {
        "kind": kind,
        "lengths": [len(line) for line in lines],
        "points": points,
        "colour": rgb,
        "width": width,
        "dash": list(dash),
    }


def _packed(values: NDArray[Any], kind: str) -> str:
    with np.errstate(over="ignore"):  # a number beyond single precision becomes infinite: not drawn
        return base64.b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode("ascii")
