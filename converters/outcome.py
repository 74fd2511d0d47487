"""One check of one file, from what is asked to what is found, as plain data that travel between processes."""

from __future__ import annotations

import hashlib
import importlib.metadata
import math
import os
import platform
import stat
import sys
import time
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from enum import IntEnum
from typing import TYPE_CHECKING, Any

from gtcad.converters.profiles import profile_of
from gtcad.errors import (
    ExtraMissing,
    FileError,
    GtcadError,
    InputError,
    KernelError,
    KernelMissing,
    ModelError,
    ToleranceBelowPrecision,
    ToleranceNotMet,
)

if TYPE_CHECKING:
    from gtcad._entries import ModelShape
    from gtcad.converters.check import Report
    from gtcad.converters.file_certificate import Verification
    from gtcad.converters.part import Part
    from gtcad.converters.readiness import Readiness
    from gtcad.converters.scene import Scene
    from gtcad.converters.stated_check import Statement

MODEL = "MODEL"
MAX_COORDINATE = 1e12  # mm: a million kilometres


class Code(IntEnum):
    """How a check ended: the exit codes of the command, from the best to the worst."""

    FINE = 0
    UNDECIDED = 5
    FAILED = 1
    FILE = 3
    KERNEL = 4
    INTERNAL = 70


_RANKS = {int(code): rank for rank, code in enumerate(Code)}


def worst_code(codes: list[int]) -> int:
    """The worst of some exit codes: 0, 5, 1, 3, 4, 70 in rising order; 0 for none."""
    return max(codes, key=lambda code: _RANKS.get(code, len(_RANKS)), default=int(Code.FINE))


@dataclass(frozen=True)
class Job:
    """What is asked about one file.

    Attributes
    ----------
    file, form
        The exchange file, and STEP, IGES or BREP.
    against, against_form
        The model or the other exchange file, if there is one; MODEL, STEP, IGES or BREP.
    tolerance
        In mm, with `against`.
    profile, limits
        Of the check for CAM, if one is asked for: the profile's name, and its changed limits.
    require_proof
        Whether estimates count as undecided.
    scene
        Whether a scene is wanted, for a report.
    """

    file: str
    form: str
    against: str | None = None
    against_form: str = ""
    tolerance: float | None = None
    profile: str | None = None
    limits: tuple[tuple[str, float | None], ...] = ()
    require_proof: bool = False
    scene: bool = False

    def settings(self) -> dict[str, Any]:
        """What, besides the content of the files, decides about the result."""
        return {
            "tolerance": self.tolerance,
            "profile": self.profile,
            "limits": dict(self.limits),
            "require_proof": self.require_proof,
        }


@dataclass(frozen=True, eq=False)
class Outcome:
    """What one check found.

    Attributes
    ----------
    file, form, against, tolerance
        As asked.
    report
        Of the comparison, if there was one.
    readiness
        Of the check for CAM, if there was one.
    scene
        For a report, if one is wanted.
    environment
        Versions, hashes and the time: texts by name.
    code
        The exit code.
    message
        Why there are no results; empty when there are.
    seconds
        That the check took.
    statements
        What the file states of its shapes besides them, held against them.
    verification
        Of the file's certificate, if one was verified by this check.
    """

    file: str
    form: str
    against: str | None
    tolerance: float | None
    report: Report | None
    readiness: Readiness | None
    scene: Scene | None
    environment: dict[str, str]
    code: int
    message: str = ""
    seconds: float = 0.0
    statements: tuple[Statement, ...] = ()
    verification: Verification | None = None

    def as_data(self) -> dict[str, Any]:
        """Plain data for JSON: all but the scene."""
        data: dict[str, Any] = {"file": self.file, "against": self.against, "tolerance": self.tolerance}
        data |= {"code": self.code, "seconds": self.seconds}
        if self.message:
            data["message"] = self.message
        if self.report is not None:
            data |= report_data(self.report)
        if self.readiness is not None:
            data["readiness"] = asdict(self.readiness) | {"verdict": self.readiness.verdict}
        if self.statements:
            data["statements"] = [asdict(item) | {"unit": item.unit, "kept": item.kept} for item in self.statements]
        if self.verification is not None:
            data["certificate"] = self.verification.as_data()
        found: dict[str, Any] = plain(data | {"environment": self.environment})
        return found


def report_data(report: Report) -> dict[str, Any]:
    """What a comparison found, as plain data."""
    joints = [
        {
            "name": joint.name,
            "wanted": joint.wanted,
            "found": joint.report.order,
            "kept": joint.kept,
            "gap": joint.report.gap,
            "tangent_angle_deg": joint.report.tangent_angle_deg,
            "curvature_jump": joint.report.curvature_jump,
            "curvature_rate_jump": joint.report.curvature_rate_jump,
            "torsion_jump": joint.report.torsion_jump,
        }
        for joint in report.joints
    ]
    return {"shapes": [asdict(row) for row in report.rows], "joints": joints, "extra": list(report.extra)}


def plain(value: Any) -> Any:
    """The value as JSON can hold it: infinite and undefined numbers become null."""
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, dict):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [plain(entry) for entry in value]
    return value.item() if hasattr(value, "item") else value


def run_job(job: Job) -> Outcome:
    """Do all that is asked about a file, in this process.

    Raises
    ------
    FileError, ModelError
        When a file cannot be read.
    KernelError
        When the kernel fails.
    """
    started = time.monotonic()
    report, readiness, scene = None, None, None
    parts: list[Part] = []
    shapes: dict[str, ModelShape] | None = None
    others: list[Part] = []
    stating = job.form == "STEP" and states_something(job.file)
    if job.against is not None or job.scene or stating:
        parts = _parts(job.file, job.form)
    if job.against is not None:
        report, shapes, others = _compared(job, parts)
    if job.profile is not None:
        from gtcad.converters.readiness import readiness_of_file

        readiness = readiness_of_file(job.file, job.form, profile_of(job.profile, dict(job.limits)))
    if job.scene:
        from gtcad.converters.scene import scene_of_parts

        scene = scene_of_parts(parts, () if report is None else report.rows, shapes, others=others)
    statements = _statements(job, parts) if stating else ()
    kept = Code.FINE if all(statement.kept for statement in statements) else Code.FAILED
    code = worst_code([_code_of_report(report, job.require_proof), _code_of_readiness(readiness), kept])
    seconds = time.monotonic() - started
    return Outcome(
        job.file,
        job.form,
        job.against,
        job.tolerance,
        report,
        readiness,
        scene,
        environment(job),
        code,
        seconds=seconds,
        statements=statements,
    )


def _statements(job: Job, parts: list[Part]) -> tuple[Statement, ...]:
    """To the tolerance of the comparison, else to the accuracy that the file states, else to a micrometre."""
    from gtcad.converters.stated import step_accuracies
    from gtcad.converters.stated_check import check_statements
    from gtcad.converters.step import step_data

    accuracies = step_accuracies(step_data(job.file)) if job.tolerance is None else (job.tolerance,)
    return check_statements(parts, max(accuracies, default=1e-3))


def _compared(job: Job, parts: list[Part]) -> tuple[Report, dict[str, ModelShape] | None, list[Part]]:
    """The comparison, and the shapes of the model or the parts of the other file."""
    from gtcad.converters import check

    if job.against is None or job.tolerance is None:
        raise InputError("a comparison needs something to compare with, and a tolerance")
    if job.against_form == MODEL:
        from gtcad.model import load_model

        shapes = load_model(job.against).in_millimetres()
        if not shapes:
            raise ModelError(job.against, ["all its shapes are for construction: there is nothing to check"])
        return check.check_parts(parts, shapes, job.tolerance), shapes, []
    others = _parts(job.against, job.against_form)
    return check.compare_parts(parts, others, job.tolerance), None, others


def _parts(path: str, form: str) -> list[Part]:
    """The parts of a file, whose coordinates must leave room for their squares."""
    from gtcad.converters import jobs
    from gtcad.converters.descriptions import box_of

    parts = jobs.read_parts(path, form)
    for number, part in enumerate(parts, start=1):
        for sides in (box_of([part]) or {}).values():
            check_coordinates(path, f"part {number} ({part.name!r})", max(map(abs, sides)))
    return parts


def check_coordinates(path: str, what: str, most: float) -> None:
    """Refuse coordinates that nothing made can have.

    Raises
    ------
    FileError
        When the largest is more than 1e12 mm, or not a number.
    """
    if not most <= MAX_COORDINATE:
        raise FileError(path, f"{what} has coordinates of {most:.3g} mm, at most {MAX_COORDINATE:g} mm are possible")


def _code_of_report(report: Report | None, require_proof: bool) -> int:
    if report is None:
        return Code.FINE
    verdicts = {row.verdict for row in report.rows}
    if verdicts & {"failed", "missing", "invalid"} or not all(joint.kept for joint in report.joints):
        return Code.FAILED
    accepted = {"proved"} if require_proof else {"proved", "estimated"}
    return Code.FINE if verdicts <= accepted else Code.UNDECIDED


def _code_of_readiness(readiness: Readiness | None) -> int:
    return Code.FINE if readiness is None or readiness.verdict == "ready" else Code.FAILED


def failed(job: Job, error: BaseException, seconds: float = 0.0) -> Outcome:
    """The outcome of a job that an error ended, with the code that the command gives it."""
    message = str(error) if isinstance(error, GtcadError) else f"internal error: {type(error).__name__}: {error}"
    return Outcome(
        job.file,
        job.form,
        job.against,
        job.tolerance,
        None,
        None,
        None,
        {},
        code_of(error),
        message=message,
        seconds=seconds,
    )


def code_of(error: BaseException) -> int:
    """The exit code that an error ends the command with."""
    if isinstance(error, ToleranceNotMet | ToleranceBelowPrecision):
        return Code.FAILED
    if isinstance(error, KernelError | KernelMissing | ExtraMissing):
        return Code.KERNEL
    return Code.FILE if isinstance(error, ModelError | InputError | OSError) else Code.INTERNAL


# --- where and with what ----------------------------------------------------------------------------------------------


def environment(job: Job) -> dict[str, str]:
    """Versions of what took part, hashes of the files, and the time."""
    import gtcad

    kernel = sys.modules.get("OCP")
    found = {
        "gtcad": gtcad.__version__,
        "kernel": f"OCCT {getattr(kernel, '__version__', 'unknown')}" if kernel else "none",
        "python": platform.python_version(),
        "time": datetime.now(UTC).isoformat(timespec="seconds"),
        "file_sha256": sha256(job.file),
    }
    found |= {name: importlib.metadata.version(name) for name in ("numpy", "scipy")}
    return found if job.against is None else found | {"against_sha256": sha256(job.against)}


def check_files(job: Job) -> None:
    """Refuse what can be refused without a look into the files.

    Raises
    ------
    FileError
        When the file, or the one that it is compared with, is missing, empty or no ordinary file.
    """
    for path in (job.file, job.against):
        if path is not None:
            _check_file(path)


def _check_file(path: str) -> None:
    try:
        found = os.stat(path)
    except FileNotFoundError:
        raise FileError(path, "no such file") from None
    except (OSError, ValueError) as error:
        raise FileError(path, f"cannot be read: {getattr(error, 'strerror', error)}") from error
    if not stat.S_ISREG(found.st_mode):  # a pipe would be waited for
        raise FileError(path, "is a folder" if stat.S_ISDIR(found.st_mode) else "is no ordinary file")
    if not found.st_size:
        raise FileError(path, "is empty")


def states_something(path: str) -> bool:
    """Whether a STEP file has validation properties of geometry."""
    with open(path, "rb") as file:
        return b"geometric validation property" in file.read()


def sha256(path: str) -> str:
    """The SHA-256 of a file, in hexadecimal digits.

    Raises
    ------
    FileError
        When there is no such file, or it cannot be read, is empty or no ordinary file.
    """
    _check_file(path)
    try:
        with open(path, "rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise FileError(path, f"cannot be read: {error.strerror}") from error
