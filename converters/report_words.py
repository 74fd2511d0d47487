"""What a check found in words and lines of tables: the same for the page, for paper and for pictures."""

from __future__ import annotations

import decimal
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from gtcad.converters.outcome import Outcome

    from gtcad.converters.verdicts import Histogram, Row, Worst

State = Literal["passed", "failed", "undecided", "error"]

SEVERITY = ("proved", "estimated", "fine", "info", "warning", "undecided", "extra", "error", "failed", "invalid", "missing")
LEVELS = ("error", "warning", "info")
_STATES: dict[int, State] = {0: "passed", 1: "failed", 5: "undecided"}
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


def state_of(outcome: Outcome) -> State:
    """What the exit code says."""
    return _STATES.get(outcome.code, "error")


def headline(outcome: Outcome) -> str:
    """What stands behind the verdict, in a sentence or two."""
    sentences = []
    if outcome.report is not None:
        sentences.append(_of_shapes(outcome))
    if outcome.readiness is not None:
        sentences.append(_of_readiness(outcome))
    if not sentences:
        return f"Not checked: {getattr(outcome, 'error', '') or f'the check ended with code {outcome.code}'}."
    return " ".join(sentences)


def _of_shapes(outcome: Outcome) -> str:
    assert outcome.report is not None
    rows, counts = outcome.report.rows, Counter(row.verdict for row in outcome.report.rows)
    allowed = "" if outcome.tolerance is None else f" {outcome.tolerance:g} mm"
    bad = [f"{counts[verdict]} {words}" for verdict, words in _BAD.items() if counts[verdict]]
    lost = sum(not joint.kept for joint in outcome.report.joints)
    bad += [f"{_counted(lost, 'joint')} lost"] if lost else []
    proved, estimated = counts["proved"], counts["estimated"]
    known = [row.deviation for row in rows if row.deviation is not None and row.verdict in ("proved", "estimated")]
    largest = f", the largest deviation at most {upwards(max(pair[1] for pair in known))} mm" if known else ""
    total = _counted(len(rows), "shape")
    if not bad:
        if proved == len(rows):
            return f"{total}, each proved to lie within{allowed} of the model{largest}."
        return f"{total}: {proved} proved and {estimated} estimated to lie within{allowed} of the model{largest}."
    worst = max((row for row in rows if row.deviation is not None and row.verdict == "failed"), key=_least, default=None)
    where = "" if worst is None else f" Worst: {worst.name}, {downwards(_least(worst))} mm."
    return f"Of {total}, {', '.join(bad)}; {proved} proved and {estimated} estimated within{allowed}.{where}"


def _least(row: Row) -> float:
    return row.deviation[0] if row.deviation is not None else 0.0


def _of_readiness(outcome: Outcome) -> str:
    assert outcome.readiness is not None
    counts = Counter(finding.level for finding in outcome.readiness.findings)
    texts = [_counted(counts[level], level) for level in LEVELS[:2]]
    return f"By the profile {outcome.readiness.profile}: {' and '.join(texts)}."


def _counted(count: int, noun: str) -> str:
    return f"{count} {noun}{'' if count == 1 else 's'}"


# --- lines ------------------------------------------------------------------------------------------------------------


def lines_of(outcome: Outcome) -> list[Line]:
    """The table of shapes: of the check against a model, else of what the file holds."""
    if outcome.report is None:
        return list(_held_lines(outcome))
    lines = [_line(row, outcome) for row in outcome.report.rows]
    return lines + [Line(name, "extra", remark="the model has no such shape") for name in outcome.report.extra]


def _line(row: Row, outcome: Outcome) -> Line:
    scene = outcome.scene
    faces = curves = ()
    if scene is not None:
        wanted = set(row.face)
        faces, curves = (
            tuple(k for k, held in enumerate(all_of) if held.part in wanted or (not wanted and held.name == row.name))
            for all_of in (scene.faces, scene.curves)
        )
    facts = [] if scene is None else [scene.faces[k].facts for k in faces] + [scene.curves[k].facts for k in curves]
    remark = "; ".join(filter(None, (row.method, row.remark)))
    return Line(
        row.name, row.verdict, row.deviation, row.worst, row.histogram, *_described(facts), remark, faces, curves
    )


def _held_lines(outcome: Outcome) -> Iterator[Line]:
    """Faces and free curves with the findings that name them."""
    scene = outcome.scene
    for k, held in enumerate((*scene.faces, *scene.curves) if scene is not None else ()):
        assert scene is not None
        if k >= len(scene.faces) and scene.curves[k - len(scene.faces)].part < 0:
            continue  # an edge
        findings = outcome.readiness.findings if outcome.readiness is not None else ()
        own = [finding for finding in findings if finding.element == held.name]
        worst = next((level for level in LEVELS if any(finding.level == level for finding in own)), "fine")
        places = ((k,), ()) if k < len(scene.faces) else ((), (k - len(scene.faces),))
        remark = "; ".join(dict.fromkeys(finding.criterion for finding in own))
        kind, degree, poles = _described([held.facts])
        yield Line(held.name, worst, None, None, None, kind, degree, poles, remark, *places)


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
    return pairs + [(key, value) for key, value in outcome.environment.items() if key not in dict(pairs)]


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
    """Such as "(1, 2.5, 0)"."""
    return f"({', '.join(f'{value:.{digits}g}' for value in values)})"


def figure(value: float | None, unit: str = "") -> str:
    """Four digits with the unit; nothing for None."""
    if value is None or not math.isfinite(value):
        return ""
    return f"{value:.4g} {unit}".strip()
