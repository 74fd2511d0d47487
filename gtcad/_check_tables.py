"""What ``gtcad check`` prints: verdicts, criteria of readiness for CAM, and a line for each file of many."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from gtcad._tables import NAME, interval, print_table, printable

if TYPE_CHECKING:
    from gtcad.continuity import JoinReport
    from gtcad.converters.check import Report
    from gtcad.converters.readiness import Criterion, Finding, Readiness
    from gtcad.converters.stated_check import Statement

MOST_FINDINGS = 20
_WORDS = {0: "fine", 1: "failed", 3: "unreadable", 4: "kernel failed", 5: "undecided", 70: "internal error"}


def print_report(report: Report) -> None:
    """Print the verdicts of a check, the joints of its chains, and how many there are of each verdict."""
    rows = [[row.name, row.verdict, interval(row.deviation), row.method, row.remark] for row in report.rows]
    print_table((NAME, "verdict", "deviation in mm", "method", "remark"), rows)
    if report.joints:
        print_table(
            (NAME, "wanted", "found", "gap, mm", "angle, deg", "curvature", "its rate"),
            [[joint.name, joint.wanted, joint.report.order, *_jumps(joint.report)] for joint in report.joints],
        )
    kept = [joint.kept for joint in report.joints]
    print("; ".join(_counts([row.verdict for row in report.rows], kept.count(True), kept.count(False))))


def _counts(verdicts: Sequence[str], kept: int, lost: int) -> list[str]:
    texts = [f"{count} {verdict}" for verdict, count in Counter(verdicts).items()]
    for count, what in ((kept, "kept"), (lost, "lost")):
        if count:
            texts.append(f"{count} joint{'s' if count > 1 else ''} {what}")
    return texts


def _jumps(join: JoinReport) -> list[str]:
    values = (join.gap, join.tangent_angle_deg, join.curvature_jump, join.curvature_rate_jump)
    return [f"{value:.1e}" if math.isfinite(value) else "-" for value in values]


def print_readiness(readiness: Readiness) -> None:
    """Print how each limit is met, the places that break one, and the verdict."""
    print_table(
        ("criterion", "limit", "worst", "checked", "found"),
        [_criterion(criterion) for criterion in readiness.criteria if criterion.active],
    )
    findings = readiness.findings
    for finding in findings[:MOST_FINDINGS]:
        print(printable(_finding(finding)))
    if len(findings) > MOST_FINDINGS:
        print(f"and {len(findings) - MOST_FINDINGS} more, which --json lists")
    print(f"{readiness.verdict} (profile {readiness.profile}{_levels([finding.level for finding in findings])})")


def print_statements(statements: Sequence[Statement], words: Callable[[Statement], tuple[str, str, str]]) -> None:
    """Print what a file states of its shapes and does not hold, in those words, and how much of it is kept."""
    broken = [item for item in statements if not item.kept]
    if broken:
        rows = [[item.name, item.quantity, *words(item)] for item in broken]
        print_table((NAME, "quantity", "stated", "found", "may differ by"), rows)
    if statements:
        count = len(statements) - len(broken)
        print(f"the file keeps {count} of {len(statements)} statements about areas, volumes, centres and points")


_LEVELS = {"error": "error", "warning": "warning", "info": "note"}


def _levels(levels: Sequence[str]) -> str:
    counts = Counter(levels)
    return "".join(f", {_several(counts[level], level)}" for level in _LEVELS if counts[level])


def _several(count: int, level: str) -> str:
    return f"{count} {_LEVELS[level]}{'s' if count > 1 else ''}"


def _criterion(criterion: Criterion) -> list[str]:
    limit = "" if criterion.limit is None else f"{criterion.limit:g} {criterion.unit}".strip()
    worst = "" if criterion.worst is None else _value(criterion.worst, criterion.unit)
    found = _several(criterion.found, criterion.level) if criterion.found else "-"
    return [criterion.name, limit, worst, str(criterion.checked), found]


def _finding(finding: Finding) -> str:
    """A finding in one line, such as "error: tiny-edge 0.001 mm at 0, 0, 5: edge 3 of face 1"."""
    value = "" if finding.value is None else f" {_value(finding.value, finding.unit)}"
    place = "" if finding.point is None else f" at {', '.join(f'{x:.6g}' for x in finding.point)}"
    remark = f" ({finding.remark})" if finding.remark else ""
    return f"{_LEVELS[finding.level]}: {finding.criterion}{value}{place}: {finding.element}{remark}"


def _value(value: float, unit: str) -> str:
    return f"{value:.3g} {unit}".strip()


def print_line(data: Mapping[str, Any], *, known: bool) -> None:
    """Print what became of one file of many, in one line.

    Parameters
    ----------
    data
        As JSON holds it.
    known
        Whether it comes from a log.
    """
    texts = [data["message"].replace(f"{data['file']}: ", "", 1)] if data.get("message") else []
    kept = [bool(joint["kept"]) for joint in data.get("joints", [])]
    texts += _counts([row["verdict"] for row in data.get("shapes", [])], kept.count(True), kept.count(False))
    readiness = data.get("readiness")
    if readiness:
        texts.append(readiness["verdict"] + _levels([finding["level"] for finding in readiness["findings"]]))
    kept = [bool(item["kept"]) for item in data.get("statements", [])]
    if not all(kept):
        texts.append(f"{kept.count(False)} of {len(kept)} statements broken")
    remark = " (from the log)" if known else ""
    print(printable(f"{word(data['code'])}: {data['file']}: {'; '.join(texts)}{remark}"), flush=True)


def word(code: int) -> str:
    """An exit code in words."""
    return _WORDS.get(code, f"code {code}")


def summary(codes: Sequence[int]) -> str:
    """How many files ended how."""
    counts = Counter(map(word, codes))
    return f"{len(codes)} file{'' if len(codes) == 1 else 's'}: " + ", ".join(f"{n} {w}" for w, n in counts.items())
