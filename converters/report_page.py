"""The pieces of the HTML page of a report: tables, small drawings and what the view is made from."""

from __future__ import annotations

import base64
import html
import json
import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gtcad.converters import report_words as words
from gtcad.converters.scene import Scene, SceneCurve
from gtcad.converters.scene_edges import ANGLE, BEND, GAP

if TYPE_CHECKING:
    from gtcad.converters.outcome import Outcome

    from gtcad.converters.verdicts import Histogram

Array = NDArray[np.float64]

MAPS = {
    "magnitude": ("#440154", "#472d7b", "#3b528b", "#2c728e", "#21918c", "#28ae80", "#5ec962", "#addc30", "#fde725"),
    "signed": ("#053061", "#2166ac", "#67a9cf", "#c3d9e8", "#dedede", "#f9d3a0", "#fdb863", "#e08214", "#7f3b08"),
}
"""Colours for magnitudes and for values with a sign, told apart with any colour vision."""

EDGES = {
    "free": ("#d55e00", 4.0, (9.0, 5.0), "free: one face only"),
    "G0": ("#111111", 3.0, (0.0, 0.0), "G0: a crease"),
    "G1": ("#0072b2", 2.4, (14.0, 5.0), "G1: tangent planes agree"),
    "G2": ("#009e73", 1.6, (3.0, 4.0), "G2: curvatures agree"),
}
"""Colour, width and dashes of the edges of each order: told apart without colours too."""

_CURVE, _NET, _COMB = "#0072b2", "#6b6b6b", "#e69f00"
_MARKS = {"passed": "\u2713", "failed": "\u2717", "undecided": "?", "error": "!"}
_SHAPE_COLUMNS = ("name", "verdict", "deviation, mm", "worst place", "held as", "degree", "poles", "histogram", "remarks")
_MOST_NET = 60_000  # points of control nets in one view


class Markup(str):
    """A piece of HTML; any other text is escaped before it gets into one."""

    __slots__ = ()


def element(name: str, *content: object, **attributes: object) -> Markup:
    """An element with its content; an underscore at the end of an attribute's name is left out, others become dashes."""
    given = ((key.rstrip("_").replace("_", "-"), value) for key, value in attributes.items() if value is not None)
    listed = "".join(f' {key}="{html.escape(str(value))}"' for key, value in given)
    return Markup(f"<{name}{listed}>{''.join(map(_piece, content))}</{name}>")


def _piece(content: object) -> str:
    return content if isinstance(content, Markup) else html.escape(str(content))


def script_data(value: Any) -> Markup:
    """JSON that no text can end early."""
    text = json.dumps(value, separators=(",", ":"), ensure_ascii=True, allow_nan=False)
    return Markup(text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026"))


def joined(pieces: Iterable[Markup]) -> Markup:
    """One after the other."""
    return Markup("".join(pieces))


# --- parts of the page ------------------------------------------------------------------------------------------------


def index_table(outcomes: Sequence[Outcome]) -> Markup:
    """The files of a report with their verdicts."""
    rows = []
    for k, outcome in enumerate(outcomes):
        state = words.state_of(outcome)
        rows.append(
            element(
                "tr",
                element("td", element("a", outcome.file, href=f"#outcome-{k + 1}")),
                element("td", badge(state), data_sort=list(_MARKS).index(state)),
                element("td", words.headline(outcome)),
            )
        )
    return table(("file", "verdict", "in words"), rows, "index", "The files of this report")


def outcome_section(outcome: Outcome, number: int, *, with_scene: bool, only: bool) -> Markup:
    """All about one file."""
    state = words.state_of(outcome)
    pairs = (
        element("div", element("dt", key), element("dd", value)) for key, value in words.environment_of(outcome)
    )
    lines = words.lines_of(outcome)
    shapes = shape_table(lines, outcome.report is not None) if lines else Markup("")
    scene = outcome.scene if with_scene else None
    drawn = scene is not None and bool(scene.faces or scene.curves)
    left_out = element("p", "The view was left out to keep the page small: make a report of this file alone.")
    pieces = [
        element("h2", outcome.file, class_="only" if only else None),
        element("p", badge(state), " ", words.headline(outcome), class_=f"headline {state}"),
        element("dl", joined(pairs), class_="environment"),
        left_out if outcome.scene is not None and not with_scene else Markup(""),
        element("div", viewer(scene, outcome.tolerance), shapes, class_="bench") if scene is not None and drawn else shapes,
        joint_table(outcome),
        readiness_tables(outcome),
        curve_figures([] if outcome.scene is None else outcome.scene.curves),
    ]
    return element("section", joined(pieces), class_="outcome", id=f"outcome-{number}")


def badge(verdict: str) -> Markup:
    """A verdict with a sign of its own, for those who see no colours."""
    signs = {
        **_MARKS, "proved": "\u2713", "fine": "\u2713", "estimated": "\u2248", "missing": "\u2205", "invalid": "\u2717",
        "warning": "\u25b3", "error": "\u2717", "info": "i", "extra": "+", "kept": "\u2713", "lost": "\u2717",
    }  # fmt: skip
    return element("span", element("span", signs.get(verdict, "\u00b7"), aria_hidden="true"), f" {verdict}", class_=f"badge {verdict}")


def table(columns: Sequence[str], rows: Sequence[Markup], kind: str, caption: str) -> Markup:
    """A table that sorts."""
    heads = (
        element("th", element("button", column, type="button"), scope="col", aria_sort="none", data_label=column)
        for column in columns
    )
    return element(
        "div",
        element(
            "table",
            element("caption", caption),
            element("thead", element("tr", joined(heads))),
            element("tbody", joined(rows)),
            class_=f"sortable {kind}",
        ),
        class_="scrolled",
    )


def shape_table(lines: Sequence[words.Line], against: bool) -> Markup:
    """The shapes with their verdicts; a click selects them in the view."""
    used = [
        k for k, name in enumerate(_SHAPE_COLUMNS)
        if k < 2 or any(_cells(line)[k][1] for line in lines) or (against and name == "deviation, mm")
    ]  # fmt: skip
    rows = []
    for line in lines:
        cells = _cells(line)
        texts = (element("td", cells[k][1], data_sort=cells[k][0]) for k in used)
        rows.append(element("tr", joined(texts), data_row="", **_place(line)))
    caption = "Shapes of the model and what the file holds for them" if against else "Faces and curves of the file"
    return table([_SHAPE_COLUMNS[k] for k in used], rows, "shapes", caption)


def _place(line: words.Line) -> dict[str, Any]:
    """Where the view finds it."""
    found: dict[str, Any] = {"data_faces": " ".join(map(str, line.faces)) or None}
    if line.worst is not None:
        found["data_point"] = json.dumps(list(line.worst.point))
        found["data_vector"] = json.dumps(list(line.worst.vector))
    return found


def _cells(line: words.Line) -> list[tuple[Any, object]]:
    """What each column sorts by, and shows."""
    severity = words.SEVERITY.index(line.verdict) if line.verdict in words.SEVERITY else len(words.SEVERITY)
    name = element("button", line.name, type="button", class_="name", aria_pressed="false")
    upper = "" if line.deviation is None else repr(line.deviation[1])
    worst: object = ""
    length = ""
    if line.worst is not None:
        length = repr(math.hypot(*line.worst.vector))
        label = "t" if len(line.worst.parameters) == 1 else "(u, v)"
        texts = (
            f"{label} = {words.numbers(line.worst.parameters, 4)}",
            f"at {words.numbers(line.worst.point, 5)}",
            f"by {words.numbers(line.worst.vector, 3)}",
        )
        worst = joined(element("span", text, class_="fact") for text in texts)
    drawn = "" if line.histogram is None else histogram_svg(line.histogram)
    return [
        (line.name, name),
        (severity, badge(line.verdict)),
        (upper, words.interval(line.deviation)),
        (length, worst),
        (line.kind, line.kind),
        (line.degree, line.degree),
        (line.poles, line.poles or ""),
        (upper, drawn),
        (line.remark, line.remark),
    ]


def joint_table(outcome: Outcome) -> Markup:
    """The joints of chains and quilts."""
    if outcome.report is None or not outcome.report.joints:
        return Markup("")
    rows = []
    for joint in outcome.report.joints:
        found = joint.report
        figures = (found.gap, found.tangent_angle_deg, found.curvature_jump, found.curvature_rate_jump)
        cells = [
            element("td", joint.name),
            element("td", badge("kept" if joint.kept else "lost")),
            element("td", joint.wanted),
            element("td", found.order),
            *(element("td", words.figure(value), data_sort=repr(value)) for value in figures),
        ]
        rows.append(element("tr", *cells))
    columns = ("joint", "verdict", "wanted", "found", "gap, mm", "angle, deg", "curvature jump", "jump of its rate")
    return table(columns, rows, "joints", "Joints, as the file has them")


def readiness_tables(outcome: Outcome) -> Markup:
    """The criteria of the profile, and what they found."""
    readiness = outcome.readiness
    if readiness is None:
        return Markup("")
    criteria = [
        element(
            "tr",
            element("td", criterion.code),
            element("td", criterion.title),
            element("td", words.figure(criterion.limit, criterion.unit)),
            element("td", criterion.checked),
            element("td", criterion.found),
            element("td", criterion.source),
        )
        for criterion in readiness.criteria
    ]
    findings = []
    places: dict[str, int] = {}
    for k, face in enumerate(outcome.scene.faces if outcome.scene is not None else ()):
        places.setdefault(face.name, k)
    for finding in readiness.findings:
        cells = [
            element("td", element("button", finding.code, type="button", class_="name", aria_pressed="false")),
            element("td", badge(finding.level), data_sort=words.SEVERITY.index(finding.level)),
            element("td", finding.criterion),
            element("td", finding.element),
            element("td", words.figure(finding.value, finding.unit), data_sort=_sort(finding.value)),
            element("td", words.figure(finding.limit, finding.unit), data_sort=_sort(finding.limit)),
            element("td", "" if finding.point is None else words.numbers(finding.point, 5)),
            element("td", finding.remark),
        ]
        point = None if finding.point is None else json.dumps(list(finding.point))
        place = places.get(finding.element)
        findings.append(element("tr", *cells, data_row="", data_point=point, data_faces=place))
    columns = ("code", "level", "criterion", "element", "value", "limit", "place", "remark")
    listed = table(columns, findings, "findings", "Findings") if findings else element("p", "No findings.")
    heads = ("code", "criterion", "limit", "checked", "found", "source of the limit")
    return joined([listed, table(heads, criteria, "criteria", f"Criteria of the profile {readiness.profile}")])


def _sort(value: float | None) -> str:
    return "" if value is None or not math.isfinite(value) else repr(value)


# --- small drawings ---------------------------------------------------------------------------------------------------


def histogram_svg(histogram: Histogram) -> Markup:
    """Bars of equal width on the page, labelled with the first and the last edge."""
    counts, edges = histogram.counts, histogram.edges
    most, width = max(max(counts, default=0), 1), 100 / max(len(counts), 1)
    bars = (
        element("rect", x=f"{k * width:.2f}", y=f"{26 - 24 * n / most:.2f}", width=f"{0.9 * width:.2f}", height=f"{24 * n / most:.2f}")
        for k, n in enumerate(counts)
    )  # fmt: skip
    title = element("title", f"{sum(counts)} samples from {edges[0]:.3g} to {edges[-1]:.3g} mm, at most {most} in a bar")
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
    assert curve.arc_lengths is not None and curve.curvature is not None
    s, kappa = curve.arc_lengths, np.where(np.isfinite(curve.curvature), curve.curvature, 0.0)
    top, low, length = max(float(kappa.max()), 0.0), min(float(kappa.min()), 0.0), max(float(s[-1]), 1e-300)
    span = max(top - low, 1e-9 / length)
    points = " ".join(f"{30 + 255 * x / length:.1f},{15 + 95 * (top - y) / span:.1f}" for x, y in zip(s, kappa, strict=True))
    zero = 15 + 95 * top / span
    labels = (
        element("text", f"curvature, 1/mm: {low:.3g} to {top:.3g}", x=30, y=10),
        element("text", f"arc length, mm: 0 to {length:.5g}", x=285, y=128, text_anchor="end"),
    )
    axis = element("line", x1=30, y1=f"{zero:.1f}", x2=285, y2=f"{zero:.1f}", stroke="#767676", stroke_width=1)
    graph = element("polyline", points=points, stroke=_COMB, stroke_width=1.5, fill="none")
    title = element("title", f"curvature of {curve.name} over its arc length")
    return element("svg", title, axis, graph, *labels, viewBox="0 0 290 140", role="img")


# --- the view ---------------------------------------------------------------------------------------------------------


def viewer(scene: Scene, tolerance: float | None) -> Markup:
    """The view with its buttons and data."""
    data = scene_data(scene, tolerance)
    known = any(np.isfinite(face.values["deviation"]).any() for face in scene.faces)
    modes = [("deviation", "Deviation"), ("distance", "Distance")] if known else []
    modes += [("mean", "Mean curvature"), ("gaussian", "Gaussian curvature"), ("zebra", "Zebra"), ("plain", "Plain")]
    first = "deviation" if known else "plain"
    kinds = {group["kind"] for group in data["lines"]}
    lines = [("edges", "Edges by continuity"), ("net", "Control net"), ("comb", "Curvature combs")]
    colours = [
        element("button", title, type="button", data_mode=key, aria_pressed=str(key == first).lower())
        for key, title in modes
        if scene.faces
    ] or [element("button", "Plain", type="button", data_mode="plain", aria_pressed="true", hidden="")]
    toggles = [
        element("button", title, type="button", data_lines=key, aria_pressed=str(key == "edges" or (key == "comb" and not scene.faces)).lower())
        for key, title in lines
        if key in kinds
    ]  # fmt: skip
    if known and tolerance is not None:
        toggles.append(element("button", f"Scale to {tolerance:g} mm", type="button", data_tolerance="", aria_pressed="false"))
    looks = [
        element("button", key.capitalize(), type="button", data_view=key) for key in ("fit", "top", "front", "right")
    ]
    groups = [
        element("div", *buttons, class_="group", role="group", aria_label=label)
        for label, buttons in (("colours", colours), ("lines", toggles), ("point of view", looks))
        if buttons
    ]
    help_text = "Drag to turn, with shift to move, wheel to zoom after a click; arrows, + and - do the same; a click selects."
    canvas = element(
        "canvas", "The view needs a browser with scripts.", tabindex=0, role="application",
        aria_label="3D view of the file: arrow keys turn it, plus and minus zoom, Escape deselects",
    )  # fmt: skip
    key = edge_key(scene) if "edges" in kinds else Markup("")
    picture = element(
        "div", canvas, element("svg", viewBox="0 0 60 60", class_="triad", aria_hidden="true"),
        element("div", class_="legend"), key, class_="picture",
    )  # fmt: skip
    side = element("aside", help_text, class_="selected", aria_live="polite")
    stored = element("script", script_data(data), type="application/json", class_="scene")
    return element("div", element("div", *groups, class_="tools"), element("div", picture, side, class_="stage"), stored, class_="viewer")


def edge_key(scene: Scene) -> Markup:
    """What the lines of edges mean."""
    used = {curve.continuity for curve in scene.curves if curve.kind == "edge"}
    rows = []
    for order, (colour, width, dash, title) in EDGES.items():
        if order in used:
            pattern = " ".join(map(str, dash)) if dash[1] else None
            line = element("line", x1=0, y1=6, x2=44, y2=6, stroke=colour, stroke_width=width, stroke_dasharray=pattern)
            rows.append(element("li", element("svg", line, viewBox="0 0 44 12", aria_hidden="true"), f" {title}"))
    note = f"sampled: within {GAP:g} mm, {ANGLE:g} degrees, {100 * BEND:g} % of the mean curvature"
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
    yield from _group("curves", [curve.points for curve in curves], middle, _CURVE, 2.5, (0.0, 0.0))
    nets, room = [], _MOST_NET
    for held in (*scene.faces, *scene.curves):
        room -= sum(map(len, held.net))
        nets += held.net if room >= 0 else ()
    yield from _group("net", nets, middle, _NET, 1.0, (0.0, 0.0))
    combs: list[Array] = []
    for curve in curves:
        if curve.comb is not None:
            known = np.isfinite(curve.comb).all(axis=1)
            combs += [curve.comb[known], *np.stack([curve.points[known], curve.comb[known]], axis=1)]
    yield from _group("comb", combs, middle, _COMB, 1.0, (0.0, 0.0))


def _group(
    kind: str, lines: Sequence[Array], middle: Array, colour: str, width: float, dash: tuple[float, float]
) -> Iterable[dict[str, Any]]:
    if not lines:
        return
    rgb = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    points = _packed(np.concatenate(lines) - middle, "<f4")
    yield {"kind": kind, "lengths": [len(line) for line in lines], "points": points, "colour": rgb, "width": width, "dash": list(dash)}


def _packed(values: NDArray[Any], kind: str) -> str:
    with np.errstate(over="ignore"):  # a number beyond single precision becomes infinite: not drawn
        return base64.b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode("ascii")
