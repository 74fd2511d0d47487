"""The sections and tables of the HTML page of a report."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from gtcad.converters import report_words as words
from gtcad.converters.report_figures import curve_figures, histogram_svg
from gtcad.converters.report_markup import Markup, badge, element, joined, table
from gtcad.converters.report_view import viewer

if TYPE_CHECKING:
    from gtcad.converters.outcome import Outcome

_COLUMNS = ("name", "verdict", "deviation, mm", "worst place", "held as", "degree", "poles", "histogram", "remarks")


def index_table(outcomes: Sequence[Outcome]) -> Markup:
    """The files of a report with their verdicts."""
    rows = []
    for k, outcome in enumerate(outcomes):
        state = words.state_of(outcome)
        rows.append(
            element(
                "tr",
                element("td", element("a", words.title_of(outcome), href=f"#outcome-{k + 1}")),
                element("td", badge(state), data_sort=words.STATES.index(state)),
                element("td", words.headline(outcome)),
            )
        )
    return table(("file", "verdict", "in words"), rows, "index", "The files of this report")


def outcome_section(outcome: Outcome, number: int, *, with_scene: bool, only: bool) -> Markup:
    """All about one file."""
    state = words.state_of(outcome)
    pairs = (element("div", element("dt", key), element("dd", value)) for key, value in words.environment_of(outcome))
    lines = words.lines_of(outcome)
    shapes = shape_table(lines, outcome.report is not None) if lines else Markup("")
    scene, measured = words.measured_scene(outcome)
    drawn = with_scene and bool(scene.faces or scene.curves)
    left_out = element("p", "The view was left out to keep the page small: make a report of this file alone.")
    pieces = [
        element("h2", words.title_of(outcome), class_="only" if only else None),
        element("p", badge(state), " ", words.headline(outcome), class_=f"headline {state}"),
        *(element("p", badge(mark), " ", text, class_="vouched") for mark, text in words.vouched(outcome)),
        element("dl", joined(pairs), class_="environment"),
        left_out if outcome.scene is not None and not with_scene else Markup(""),
        element("div", viewer(scene, outcome.tolerance, measured), shapes, class_="bench") if drawn else shapes,
        joint_table(outcome),
        statement_table(outcome),
        readiness_tables(outcome),
        curve_figures(scene.curves),
    ]
    return element("section", joined(pieces), class_="outcome", id=f"outcome-{number}")


def shape_table(lines: Sequence[words.Line], against: bool) -> Markup:
    """The shapes with their verdicts; a click selects them in the view."""
    used = [
        k for k, name in enumerate(_COLUMNS)
        if k < 2 or any(_cells(line)[k][1] for line in lines) or (against and name == "deviation, mm")
    ]  # fmt: skip
    rows = []
    for line in lines:
        cells = _cells(line)
        texts = (element("td", cells[k][1], data_sort=cells[k][0]) for k in used)
        rows.append(element("tr", joined(texts), data_row="", **_place(line)))
    caption = "Shapes of the model and what the file holds for them" if against else "Faces and curves of the file"
    return table([_COLUMNS[k] for k in used], rows, "shapes", caption)


def _place(line: words.Line) -> dict[str, Any]:
    """Where the view finds it."""
    found: dict[str, Any] = {"data_faces": " ".join(map(str, line.faces)) or None}
    if line.worst is not None:
        found["data_point"] = _place_of(line.worst.point)
        found["data_vector"] = _place_of(line.worst.vector)
    return found


def _place_of(values: Sequence[float] | None) -> str | None:
    """A point for the view; None when there is none to be shown."""
    return json.dumps(list(values)) if values is not None and all(map(math.isfinite, values)) else None


def _cells(line: words.Line) -> list[tuple[Any, object]]:
    """What each column sorts by, and shows."""
    severity = words.SEVERITY.index(line.verdict) if line.verdict in words.SEVERITY else len(words.SEVERITY)
    name = element("button", line.name, type="button", class_="name", aria_pressed="false")
    upper = "" if line.deviation is None else repr(line.deviation[1])
    worst: object = ""
    length = ""
    if line.worst is not None:
        length = repr(math.hypot(*line.worst.vector))
        texts = (
            words.parameters(line.worst.parameters),
            f"at {words.numbers(line.worst.point, 5)}",
            f"by {words.numbers(line.worst.vector, 3)}",
        )
        worst = joined(element("span", text, class_="fact place") for text in texts)
    drawn = "" if line.histogram is None else histogram_svg(line.histogram)
    return [
        (line.name, name),
        (severity, badge(line.verdict)),
        (upper, element("span", words.interval(line.deviation), class_="fact") if line.deviation is not None else ""),
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
            *(_plain(words.figure(value), value) for value in figures),
        ]
        rows.append(element("tr", *cells))
    columns = ("joint", "verdict", "wanted", "found", "gap, mm", "angle, deg", "curvature jump", "jump of its rate")
    return table(columns, rows, "joints", "Joints, as the file has them")


def statement_table(outcome: Outcome) -> Markup:
    """What the file states of its shapes besides them, and what it holds."""
    if not outcome.statements:
        return Markup("")
    rows = []
    for statement in outcome.statements:
        stated, found, limit = words.statement(statement)
        mark = badge("kept" if statement.kept else "broken")
        cells = (statement.name, statement.quantity, mark, stated, found, limit)
        rows.append(element("tr", *(element("td", cell) for cell in cells)))
    columns = ("shape", "quantity", "verdict", "stated", "found", "may differ by")
    return table(columns, rows, "statements", "What the file states of its shapes, and holds")


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
            _plain(words.figure(criterion.limit, criterion.unit) if criterion.active else "off"),
            element("td", criterion.checked),
            element("td", criterion.found),
            element("td", criterion.source),
        )
        for criterion in readiness.criteria
    ]
    findings = []
    for finding in readiness.findings:
        cells = [
            element("td", element("button", finding.code, type="button", class_="name", aria_pressed="false")),
            element("td", badge(finding.level), data_sort=words.SEVERITY.index(finding.level)),
            element("td", finding.criterion),
            element("td", finding.element),
            _plain(words.figure(finding.value, finding.unit), finding.value),
            _plain(words.figure(finding.limit, finding.unit), finding.limit),
            element("td", "" if finding.point is None else words.numbers(finding.point, 5)),
            element("td", finding.remark),
        ]
        point = _place_of(finding.point)
        findings.append(
            element("tr", *cells, data_row="", data_point=point, data_faces=_faces_of(finding.element, outcome))
        )
    columns = ("code", "level", "criterion", "element", "value", "limit", "place", "remark")
    listed = table(columns, findings, "findings", "Findings") if findings else element("p", "No findings.")
    heads = ("code", "criterion", "limit", "checked", "found", "source of the limit")
    listed_criteria = table(heads, criteria, "criteria", f"Criteria of the profile {readiness.profile}")
    return joined([listed, listed_criteria, edge_table(outcome), facts_list(readiness.facts)])


def _faces_of(element: str, outcome: Outcome) -> str | None:
    """The places in the scene of the faces that an element names."""
    faces = () if outcome.scene is None else outcome.scene.faces
    wanted = words.numbers_of(element)
    return " ".join(str(k) for k, face in enumerate(faces) if face.number in wanted) or None


def edge_table(outcome: Outcome) -> Markup:
    """How faces meet along their edges, as the check for CAM measured it."""
    assert outcome.readiness is not None
    rows = []
    for edge in outcome.readiness.facts.get("continuity", ()):
        figures = [edge.get(key) for key in ("length", "gap", "angle_deg", "curvature_jump_percent")]
        cells = [
            element("td", element("button", edge["element"], type="button", class_="name", aria_pressed="false")),
            element("td", edge["continuity"]),
            *(_plain(words.figure(value), value) for value in figures),
        ]
        point = _place_of(edge.get("point"))
        rows.append(
            element("tr", *cells, data_row="", data_point=point, data_faces=_faces_of(edge["element"], outcome))
        )
    columns = ("edge", "continuity", "length, mm", "gap, mm", "angle, deg", "curvature jump, %")
    return table(columns, rows, "edges", "Edges between faces, sampled") if rows else Markup("")


def facts_list(facts: Mapping[str, Any]) -> Markup:
    """Figures of the whole file."""
    pairs = [_pair(key, value) for key, value in facts.items() if key != "continuity"]
    return element(
        "dl",
        *(element("div", element("dt", key), element("dd", value)) for key, value in pairs if value),
        class_="environment",
    )


_FACT_UNITS = {"_mm": " mm", "_mm2": " mm\u00b2"}


def _pair(key: str, value: Any) -> tuple[str, str]:
    """A fact of the JSON in words: ("size", "120 mm") for "size_mm"."""
    name, underscore, unit = key.rpartition("_")
    ending = _FACT_UNITS.get(underscore + unit, "")
    text = _fact(value)
    return (name if ending else key).replace("_", " "), text and text + ending


def _fact(value: Any) -> str:
    if isinstance(value, Mapping):
        counts = all(isinstance(entry, int) for entry in value.values())
        pairs = (_pair(str(key), entry) for key, entry in value.items())
        return ", ".join(f"{name} ({found})" if counts else f"{name} {found}" for name, found in pairs)
    if isinstance(value, list | tuple):
        return ", ".join(_fact(entry) for entry in value)
    return f"{value:.6g}" if isinstance(value, float) else "" if value is None else str(value)


def _plain(text: str, value: float | None = None) -> Markup:
    """A figure on one line."""
    key = None if value is None else repr(value) if math.isfinite(value) else ""
    return element("td", element("span", text, class_="fact"), data_sort=key)
