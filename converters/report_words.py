"""What a check found in words and lines of tables: the same for the page, for paper and for pictures."""

from __future__ import annotations

import decimal
import math
import os
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from gtcad.converters.scene import Scene, SceneCurve, SceneFace

if TYPE_CHECKING:
    from gtcad.converters.outcome import Outcome
    from gtcad.converters.stated_check import Statement
    from gtcad.converters.verdicts import Histogram, Row, Worst

State = Literal["passed", "failed", "undecided", "error"]

STATES: tuple[State, ...] = ("passed", "undecided", "failed", "error")
SEVERITY = (
    "proved",
    "estimated",
    "fine",
    "info",
    "warning",
    "undecided",
    "extra",
    "error",
    "failed",
    "invalid",
    "missing",
)
LEVELS = ("error", "warning", "info")
_BY_CODE: dict[int, State] = {0: "passed", 1: "failed", 5: "undecided"}
_ROUNDING = 1e-12
_WHOLE = 1e6  # whole numbers below are written out
_BAD = {
    "failed": "outside the tolerance",
    "missing": "missing",
    "invalid": "invalid",
    "undecided": "undecided",
}
_SURFACES = {
    "B_SPLINE_SURFACE": "B-spline",
    "BEZIER_SURFACE": "Bezier",
    "B_SPLINE_CURVE": "B-spline curve",
    "BEZIER_CURVE": "Bezier curve",
    "CYLINDRICAL_SURFACE": "cylinder",
    "CONICAL_SURFACE": "cone",
    "SPHERICAL_SURFACE": "sphere",
    "TOROIDAL_SURFACE": "torus",
    "SURFACE_OF_LINEAR_EXTRUSION": "extrusion",
    "SURFACE_OF_REVOLUTION": "revolution",
}


@dataclass(frozen=True)
class Line:
    """One line of the table of shapes.

    Attributes
    ----------
    name, verdict
        Of the shape, or of a face or curve when there is no model: the worst level of its findings, or "fine".
    deviation
        (lower, upper) in mm.
    worst, histogram
        Of the deviation.
    kind, degree
        What the file holds for it, in words.
    poles
        How many in all, 0 where there are none.
    remark
        Method and remarks.
    faces, curves
        Their places in the scene.
    """

    name: str
    verdict: str
    deviation: tuple[float, float] | None = None
    worst: Worst | None = None
    histogram: Histogram | None = None
    kind: str = ""
    degree: str = ""
    poles: int = 0
    remark: str = ""
    faces: tuple[int, ...] = ()
    curves: tuple[int, ...] = ()


def title_of(outcome: Outcome) -> str:
    """The file without its folder."""
    return os.path.basename(outcome.file) or outcome.file


def state_of(outcome: Outcome) -> State:
    """What the exit code says."""
    return _BY_CODE.get(outcome.code, "error")


def headline(outcome: Outcome) -> str:
    """What stands behind the verdict, in a sentence or two."""
    sentences = []
    if outcome.report is not None:
        sentences.append(_of_shapes(outcome))
    if outcome.readiness is not None:
        sentences.append(_of_readiness(outcome))
    broken = sum(not statement.kept for statement in outcome.statements)
    if broken:
        sentences.append(f"The file does not hold what it states: {_counted(broken, 'statement')} broken.")
    if outcome.verification is not None and not outcome.verification.verified:
        sentences.append("Its certificate is not verified.")
    if not sentences:
        return f"Not checked: {outcome.message or f'the check ended with code {outcome.code}'}"
    return " ".join(sentences)


def vouched(outcome: Outcome) -> list[tuple[str, str]]:
    """What travels with the file, a mark and a line each: its certificate, by what it was verified, its statements."""
    lines = []
    if outcome.verification is not None:
        found = outcome.verification
        made = outcome.environment
        by = f" (checked again by gtcad {made['gtcad']}, {made['kernel']})" if made else ""
        lines.append(("verified" if found.verified else "unverified", found.words + by))
    if outcome.statements:
        count = sum(item.kept for item in outcome.statements)
        of = f"{count} of {len(outcome.statements)}"
        words = f"the file keeps {of} statements about areas, volumes, centres and points"
        lines.append(("kept" if count == len(outcome.statements) else "broken", words))
    return lines


def statement(item: Statement) -> tuple[str, str, str]:
    """What is stated, what is found, and how far these may differ, with their unit."""
    limit, found = figure(item.limit, item.unit), "none"
    if item.quantity in ("centre of gravity", "points"):
        return "", found if item.found is None else f"{item.found:.2g} {item.unit} away", limit
    return f"{item.stated:.9g} {item.unit}", found if item.found is None else f"{item.found:.9g} {item.unit}", limit


def _of_shapes(outcome: Outcome) -> str:
    assert outcome.report is not None
    rows = outcome.report.rows
    counts: Counter[str] = Counter(row.verdict for row in rows)
    allowed = "" if outcome.tolerance is None else f" {outcome.tolerance:g} mm"
    goal = "the model" if not outcome.against else os.path.basename(outcome.against)
    bad = [f"{counts[verdict]} {words}" for verdict, words in _BAD.items() if counts[verdict]]
    lost = sum(not joint.kept for joint in outcome.report.joints)
    bad += [f"{_counted(lost, 'joint')} lost"] if lost else []
    proved, estimated = counts["proved"], counts["estimated"]
    known = [row.deviation for row in rows if row.deviation is not None and row.verdict in ("proved", "estimated")]
    largest = f", the largest deviation at most {upwards(max(pair[1] for pair in known))} mm" if known else ""
    total = _counted(len(rows), "shape")
    if not bad:
        if proved == len(rows):
            return f"{total}, each proved to lie within{allowed} of {goal}{largest}."
        return f"{total}: {proved} proved and {estimated} estimated to lie within{allowed} of {goal}{largest}."
    worst = max(
        (row for row in rows if row.deviation is not None and row.verdict == "failed"), key=_least, default=None
    )
    where = "" if worst is None else f" Worst: {worst.name}, {downwards(_least(worst))} mm."
    return f"Of {total}, {', '.join(bad)}; {proved} proved and {estimated} estimated within{allowed}.{where}"


def _least(row: Row) -> float:
    return row.deviation[0] if row.deviation is not None else 0.0


def _of_readiness(outcome: Outcome) -> str:
    assert outcome.readiness is not None
    counts: Counter[str] = Counter(finding.level for finding in outcome.readiness.findings)
    texts = [_counted(counts[level], level) for level in LEVELS[:2]]
    return f"By the profile {outcome.readiness.profile}: {' and '.join(texts)}."


def _counted(count: int, noun: str) -> str:
    return f"{count} {noun}{'' if count == 1 else 's'}"


# --- lines ------------------------------------------------------------------------------------------------------------


_AS_SHOWN = {"open": "free", "overused": "G0"}


def measured_scene(outcome: Outcome) -> tuple[Scene, bool]:
    """The scene with the orders of edges that the check for CAM measured, if it did, and whether it did."""
    scene = Scene((), ()) if outcome.scene is None else outcome.scene
    measured = () if outcome.readiness is None else outcome.readiness.facts.get("continuity", ())
    if not measured:
        return scene, False
    by_faces: dict[frozenset[int], list[Mapping[str, Any]]] = {}
    for edge in measured:
        by_faces.setdefault(frozenset(numbers_of(edge["element"])), []).append(edge)
    curves = []
    for curve in scene.curves:
        own = by_faces.get(frozenset(scene.faces[k].number for k in curve.faces), []) if curve.faces else []
        order = None if not own else min(own, key=lambda edge: _apart(edge["point"], curve))["continuity"]
        curves.append(curve if order is None else replace(curve, continuity=_AS_SHOWN.get(order, order)))
    return replace(scene, curves=tuple(curves)), True


def _apart(point: Sequence[float] | None, curve: SceneCurve) -> float:
    return math.inf if point is None else float(np.linalg.norm(curve.points - point, axis=1).min())


def lines_of(outcome: Outcome) -> list[Line]:
    """The table of shapes: of the check against a model, else of what the file holds."""
    if outcome.report is None:
        return list(_held_lines(outcome))
    lines = [_line(row, outcome) for row in outcome.report.rows]
    return lines + [Line(name, "extra", remark="the model has no such shape") for name in outcome.report.extra]


def _line(row: Row, outcome: Outcome) -> Line:
    scene = Scene((), ()) if outcome.scene is None else outcome.scene
    faces, curves = _places(row, scene.faces), _places(row, scene.curves)
    facts = [scene.faces[k].facts for k in faces] + [scene.curves[k].facts for k in curves]
    remark = "; ".join(filter(None, (row.method, row.remark)))
    return Line(
        row.name, row.verdict, row.deviation, row.worst, row.histogram, *_described(facts), remark, faces, curves
    )


def _places(row: Row, everything: Sequence[SceneFace | SceneCurve]) -> tuple[int, ...]:
    """Which of the faces or curves a row is about: those of its parts, or of its name when it tells no parts."""
    if row.face:
        return tuple(k for k, held in enumerate(everything) if held.part in row.face)
    return tuple(k for k, held in enumerate(everything) if held.part >= 0 and held.name == row.name)


def _held_lines(outcome: Outcome) -> Iterator[Line]:
    """Faces and free curves with the findings that name them."""
    if outcome.scene is None:
        return
    findings = outcome.readiness.findings if outcome.readiness is not None else ()
    free = [(k, curve) for k, curve in enumerate(outcome.scene.curves) if curve.kind == "curve"]
    everything: list[tuple[tuple[int, ...], tuple[int, ...], SceneFace | SceneCurve]] = [
        *(((k,), (), face) for k, face in enumerate(outcome.scene.faces)),
        *(((), (k,), curve) for k, curve in free),
    ]
    for faces, curves, held in everything:
        own = [finding for finding in findings if _is_about(finding.element, held)]
        worst = next((level for level in LEVELS if any(finding.level == level for finding in own)), "fine")
        remark = "; ".join(dict.fromkeys(finding.criterion for finding in own))
        yield Line(held.name, worst, None, None, None, *_described([held.facts]), remark, faces, curves)


def _is_about(element: str, held: SceneFace | SceneCurve) -> bool:
    if isinstance(held, SceneFace):
        return held.number in numbers_of(element)[:1] and element.startswith("face ")
    return element.startswith("curve ") and element.endswith(repr(held.name))


def numbers_of(element: str) -> list[int]:
    """The faces that the element of a finding names, by number: of "edge 5 of face 1 'a', face 2" 1 and 2."""
    return [int(number) for number in re.findall(r"\bface (\d{1,9})\b", element)]


def _described(facts: Sequence[Mapping[str, Any]]) -> tuple[str, str, int]:
    """Kind, degree and number of poles of what a shape is held by."""
    kinds = Counter(_kind(fact) for fact in facts)
    kind = ", ".join(name if count == 1 else f"{count} {name}" for name, count in kinds.items())
    degrees = dict.fromkeys("x".join(map(str, fact["degree"])) for fact in facts if "degree" in fact)
    poles = sum(math.prod(fact["poles"]) for fact in facts if "poles" in fact)
    if len(facts) == 1 and "poles" in facts[0]:
        kind += f", {'x'.join(map(str, facts[0]['poles']))} poles"
    return kind, ", ".join(degrees), poles


def _kind(fact: Mapping[str, Any]) -> str:
    name = _SURFACES.get(fact.get("source", ""), str(fact.get("source", "")).replace("_", " ").lower())
    words = ("rational " if fact.get("rational") else "", "trimmed " if fact.get("trimmed") else "")
    return f"{''.join(words)}{name}".strip()


def environment_of(outcome: Outcome) -> list[tuple[str, str]]:
    """What was checked, against what, and with what."""
    pairs = [("file", f"{outcome.file} ({outcome.form})")]
    if outcome.against:
        pairs.append(("against", outcome.against))
    if outcome.tolerance is not None:
        pairs.append(("tolerance", f"{outcome.tolerance:g} mm"))
    if outcome.readiness is not None:
        pairs.append(("profile", outcome.readiness.profile))
    return pairs + [(key.replace("_", " "), value) for key, value in outcome.environment.items()]


# --- numbers ----------------------------------------------------------------------------------------------------------


def upwards(value: float) -> str:
    """Three digits, rounded up: what is printed of an upper bound still is one."""
    return _rounded(value, decimal.ROUND_CEILING)


def downwards(value: float) -> str:
    """Three digits, rounded down."""
    return _rounded(value, decimal.ROUND_FLOOR)


def _rounded(value: float, rounding: str) -> str:
    if not math.isfinite(value):
        return "-"
    return f"{decimal.Context(prec=3, rounding=rounding).create_decimal(value):.2e}" if value else "0"


def interval(bounds: tuple[float, float] | None) -> str:
    """A pair (lower, upper), rounded outwards."""
    if bounds is None or not all(map(math.isfinite, bounds)):
        return ""
    return f"{downwards(bounds[0])} .. {upwards(bounds[1])}"


def numbers(values: Sequence[float], digits: int = 6) -> str:
    """Such as "(1, 2.5, 0)"; what is rounding beside the largest is 0."""
    least = _ROUNDING * max(map(abs, values), default=0.0)
    return f"({', '.join(f'{value if abs(value) > least else 0.0:.{digits}g}' for value in values)})"


def parameters(values: Sequence[float]) -> str:
    """Such as "t = 0.25" or "(u, v) = (0.25, 1)"."""
    return f"t = {values[0]:.4g}" if len(values) == 1 else f"(u, v) = {numbers(values, 4)}"


def figure(value: float | None, unit: str = "") -> str:
    """Four digits with the unit; nothing for None."""
    if value is None or not math.isfinite(value):
        return ""
    text = str(int(value)) if value == int(value) and abs(value) < _WHOLE else f"{value:.4g}"
    return f"{text} {unit}".strip()
