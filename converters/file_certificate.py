"""The proof that travels with a file: what was proved of it, of which model, with what, to be verified by anyone.

A certificate is a JSON document of the hashes of a file and of its model, and of the deviation of every shape, as a
pair of bounds where it is proved. It is verified by doing the check again: the hashes must be those, and each proved
pair must have a point in common with the pair found now, since both enclose one number.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from gtcad._files import written_whole
from gtcad.converters.outcome import Code, Outcome, report_data, worst_code
from gtcad.errors import FileError, InputError

_MOST = 64_000_000  # bytes of a certificate
_SLACK = 1e-9  # relative: of bounds, between machines that round elementary functions differently
_ROUNDING = 1e-9  # mm: what lower bounds may be off
_VERSIONS = ("gtcad", "kernel", "python", "numpy", "scipy")

Text = Annotated[str, Field(max_length=10_000)]
Hash = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
Finite = Annotated[float, Field(ge=0, allow_inf_nan=False)]


class _Record(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


class CertifiedFile(_Record):
    """A file by its name, without folders, and its content."""

    name: Text
    sha256: Hash


class CertifiedShape(_Record):
    """What was found of a shape: the deviation in mm, proved or estimated as the verdict says."""

    name: Text
    verdict: Literal["proved", "estimated"]
    deviation: Annotated[list[Finite], Field(min_length=2, max_length=2)] | None
    method: Text
    remark: Text = ""

    @model_validator(mode="after")
    def _in_order(self) -> CertifiedShape:
        if self.deviation is not None and self.deviation[0] > self.deviation[1]:
            raise ValueError(f"the lower bound must not be above the upper one, got {self.deviation}")
        if self.verdict == "proved" and self.deviation is None:
            raise ValueError("what is proved has a deviation")
        return self


class CertifiedJoint(_Record):
    """The order of a joint or a shared edge: what the model asks for, and what the file holds."""

    name: Text
    wanted: Text
    found: Text


class FileCertificate(_Record):
    """What a check of a file against its model found.

    Attributes
    ----------
    gtcad_certificate
        The version of the format.
    created
        A time in ISO 8601.
    file, model
        What was checked, and against what.
    tolerance
        In mm.
    versions
        Of the programs that took part.
    shapes, joints
        What was found.
    """

    gtcad_certificate: Literal[1]
    created: Text
    file: CertifiedFile
    model: CertifiedFile
    tolerance: Annotated[float, Field(gt=0, allow_inf_nan=False)]
    versions: dict[Text, Text]
    shapes: Annotated[list[CertifiedShape], Field(min_length=1)]
    joints: list[CertifiedJoint]

    @property
    def proved(self) -> bool:
        """Whether all of it is proved."""
        return all(shape.verdict == "proved" for shape in self.shapes)


def certificate_of(outcome: Outcome, created: str | None = None) -> FileCertificate:
    """The certificate of a check that passed.

    Parameters
    ----------
    outcome
        Of a file against its model.
    created
        A time to state instead of that of the check.

    Raises
    ------
    InputError
        When there was no model, or the check did not pass.
    """
    if outcome.report is None or outcome.against is None or outcome.tolerance is None:
        raise InputError("a certificate needs a check against a model")
    if outcome.code != 0:
        raise InputError(f"there is no certificate of a check that did not pass: {outcome.file} (code {outcome.code})")
    found, made = report_data(outcome.report), outcome.environment
    return FileCertificate(
        gtcad_certificate=1,
        created=created or made["time"],
        file=CertifiedFile(name=Path(outcome.file).name, sha256=made["file_sha256"]),
        model=CertifiedFile(name=Path(outcome.against).name, sha256=made["against_sha256"]),
        tolerance=outcome.tolerance,
        versions={name: made[name] for name in _VERSIONS if name in made},
        shapes=[_shape(row) for row in found["shapes"]],
        joints=[
            CertifiedJoint(**{key: joint[key] for key in ("name", "wanted", "found")}) for joint in found["joints"]
        ],
    )


def _shape(row: dict[str, Any]) -> CertifiedShape:
    deviation = None if row["deviation"] is None else [float(bound) for bound in row["deviation"]]
    return CertifiedShape(
        name=row["name"], verdict=row["verdict"], deviation=deviation, method=row["method"], remark=row["remark"]
    )


def write_certificate(path: str | os.PathLike[str], certificate: FileCertificate) -> None:
    """Write a certificate as JSON, whole or not at all.

    Raises
    ------
    FileError
        When the path cannot be written to.
    """
    text = json.dumps(certificate.model_dump(), indent=2, ensure_ascii=False, allow_nan=False)
    with written_whole(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")


def read_certificate(path: str | os.PathLike[str]) -> FileCertificate:
    """Read a certificate.

    Raises
    ------
    FileError
        When there is no such file, or it is none; the message says every field that is wrong.
    """
    try:
        if os.path.getsize(path) > _MOST:
            raise FileError(str(path), f"is too large for a certificate: more than {_MOST // 1_000_000} MB")
        return FileCertificate.model_validate_json(Path(path).read_bytes())
    except ValidationError as error:
        problems = [
            f"{'.'.join(map(str, problem['loc'])) or 'document'}: {problem['msg']}" for problem in error.errors()
        ]
        raise FileError(str(path), f"is no certificate: {'; '.join(problems[:10])}") from None
    except FileError:
        raise
    except FileNotFoundError:
        raise FileError(str(path), "no such file") from None
    except OSError as error:
        raise FileError(str(path), f"cannot be read: {error.strerror}") from error


def model_beside(certificate: FileCertificate, path: str | os.PathLike[str]) -> str:
    """The model of a certificate, looked for by its name in the certificate's folder.

    Raises
    ------
    FileError
        When there is none.
    """
    name = certificate.model.name
    found = Path(path).parent / name
    if Path(name).name != name or not found.is_file():
        raise FileError(str(path), f"its model {name!r} is not beside it: name it with --against")
    return str(found)


def disagreements(certificate: FileCertificate, outcome: Outcome) -> tuple[str, ...]:
    """What a check done now and a certificate say differently; nothing when the certificate is verified.

    A shape that was proved must be proved again, with bounds that have a number in common with those of the
    certificate; one that was estimated, at least estimated.
    """
    problems = _other_files(certificate, outcome)
    if outcome.report is None:
        return (*problems, outcome.message or "the file was not checked against the model")
    if outcome.tolerance is None or outcome.tolerance > certificate.tolerance:
        problems.append(f"checked to {outcome.tolerance} mm now, which is more than its {certificate.tolerance} mm")
    now = report_data(outcome.report)
    return (*problems, *_shapes(certificate, now["shapes"]), *_joints(certificate, now["joints"]))


@dataclass(frozen=True, eq=False)
class Verification:
    """What came out when a certificate was verified.

    Attributes
    ----------
    certificate
        As it was read.
    problems
        What it and the check say differently.
    """

    certificate: FileCertificate
    problems: tuple[str, ...]

    @property
    def verified(self) -> bool:
        """Whether both agree."""
        return not self.problems

    @property
    def words(self) -> str:
        """In one line: what is verified, or why it is not."""
        name = f"the certificate of {self.certificate.created}"
        if self.problems:
            return f"{name} is not verified: {'; '.join(self.problems)}"
        estimated = sum(shape.verdict == "estimated" for shape in self.certificate.shapes)
        proved = len(self.certificate.shapes) - estimated
        counts = [f"{proved} proved", *([f"{estimated} estimated"] if estimated else [])]
        return f"{name} is verified: {' and '.join(counts)} within {self.certificate.tolerance:g} mm"

    def as_data(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {"created": self.certificate.created, "verified": self.verified, "problems": list(self.problems)}


def verified(certificate: FileCertificate, outcome: Outcome) -> Outcome:
    """The outcome of a check with what it says of a certificate: failed at least, where the two disagree."""
    found = Verification(certificate, disagreements(certificate, outcome))
    code = worst_code([outcome.code, Code.FINE if found.verified else Code.FAILED])
    return replace(outcome, verification=found, code=code)


def _other_files(certificate: FileCertificate, outcome: Outcome) -> list[str]:
    pairs = (("file", certificate.file, "file_sha256"), ("model", certificate.model, "against_sha256"))
    return [
        f"the {what} is not the one it is for: its SHA-256 is {outcome.environment.get(key)}, not {stated.sha256}"
        for what, stated, key in pairs
        if stated.sha256 != outcome.environment.get(key)
    ]


def _shapes(certificate: FileCertificate, rows: list[dict[str, Any]]) -> Iterator[str]:
    found = {row["name"]: row for row in rows}
    names = {shape.name for shape in certificate.shapes}
    yield from (f"it says nothing of shape {name!r}" for name in found if name not in names)
    for shape in certificate.shapes:
        if shape.name not in found:
            yield f"shape {shape.name!r} is not found now"
        elif problem := _difference(shape, found[shape.name], certificate.tolerance):
            yield f"shape {shape.name!r}: {problem}"


def _joints(certificate: FileCertificate, joints: list[dict[str, Any]]) -> Iterator[str]:
    stated = {(joint.name, joint.wanted): joint.found for joint in certificate.joints}
    found = {(joint["name"], joint["wanted"]): joint["found"] for joint in joints}
    for joint in dict.fromkeys((*stated, *found)):
        if stated.get(joint) != found.get(joint):
            before, now = stated.get(joint, "nothing"), found.get(joint, "nothing")
            yield f"joint {joint[0]!r}: {before} by the certificate, {now} now"


def _difference(shape: CertifiedShape, row: dict[str, Any], tolerance: float) -> str:
    accepted = ("proved",) if shape.verdict == "proved" else ("proved", "estimated")
    if row["verdict"] not in accepted:
        return f"{shape.verdict} in the certificate, {row['verdict']} now"
    if shape.deviation is None:
        return ""
    if shape.deviation[1] > tolerance:
        return f"the certificate's own bound {shape.deviation[1]:.6g} mm is above its tolerance {tolerance:.6g} mm"
    if shape.verdict == "estimated" or row["verdict"] == "estimated":
        return ""
    lower = max(shape.deviation[0], row["deviation"][0])
    upper = min(shape.deviation[1], row["deviation"][1])
    if lower > upper * (1 + _SLACK) + _ROUNDING or not math.isfinite(upper):
        stated, found = (f"[{low:.6g}, {high:.6g}]" for low, high in (shape.deviation, row["deviation"]))
        return f"the deviation lies in {stated} mm by the certificate, in {found} mm now: these exclude each other"
    return ""
