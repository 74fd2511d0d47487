"""The command ``gtcad check``."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gtcad import _check_tables as check_tables
from gtcad import _options as options
from gtcad import _tables as tables
from gtcad._command import JsonOption, guarded, option, print_json
from gtcad._export_command import check_folder, check_output
from gtcad._tables import printable
from gtcad.errors import InputError, ModelError

if TYPE_CHECKING:
    from gtcad.converters.file_certificate import FileCertificate
    from gtcad.converters.manifest import Wanted
    from gtcad.converters.outcome import Job, Outcome

FilesArgument = Annotated[
    list[str] | None, typer.Argument(metavar="FILE", help="One or more .step, .stp, .igs, .iges, .brep files.")
]
AgainstOption = Annotated[
    str, typer.Option("--against", metavar="OTHER", help="The model that the files were made from, or another file.")
]
CheckToleranceOption = Annotated[
    str,
    typer.Option(
        "--tolerance",
        metavar="LENGTH",
        help="The largest distance, with --against: in mm, or with a unit: 1e-4, 1e-5in.",
    ),
]
ProfileOption = Annotated[
    str,
    typer.Option("--profile", metavar="NAME", help="Readiness for CAM by the limits of cam, vda-4955 or sasig."),
]
LimitOption = Annotated[
    list[str] | None,
    typer.Option("--limit", metavar="NAME=VALUE", help="Another limit, in mm, deg or %: tiny-edge=0.01mm, degree=off."),
]
ProofOption = Annotated[bool, typer.Option("--require-proof", help="Do not accept estimates (exit code 5).")]
ReportOption = Annotated[str, typer.Option("--report", metavar="OUT", help="Also write a .html, .pdf or .png report.")]
JobsOption = Annotated[str, typer.Option("--jobs", "-j", metavar="N", help="Check N files at a time.")]
SchedulerOption = Annotated[
    str, typer.Option("--scheduler", metavar="ADDRESS", help="Check on the cluster of a dask scheduler.")
]
ResumeOption = Annotated[
    str, typer.Option("--resume", metavar="LOG", help="Add results to LOG, and do not do again what it holds.")
]
ManifestOption = Annotated[
    str, typer.Option("--manifest", metavar="LIST", help="A .toml or .json list of files and what to check them with.")
]
CertificateOption = Annotated[
    str, typer.Option("--certificate", metavar="JSON", help="Verify a certificate: do its check of FILE again.")
]
WriteCertificateOption = Annotated[
    str, typer.Option("--write-certificate", metavar="JSON", help="Write what was proved of FILE against its model.")
]
TimeoutOption = Annotated[
    str, typer.Option("--timeout", metavar="TIME", help="For each file, in seconds or with a unit: 10min, 2h, off.")
]
MemoryOption = Annotated[
    str, typer.Option("--memory", metavar="SIZE", help="For each file, in bytes or with a unit, from 1GB: 8GB, off.")
]
InProcessOption = Annotated[
    bool, typer.Option("--in-process", help="Start no process for the kernel: its crash is then a crash of gtcad.")
]
MOST_JOBS = 256


@guarded
def check(
    files: FilesArgument = None,
    *,
    against: AgainstOption = "",
    tolerance: CheckToleranceOption = "",
    profile: ProfileOption = "",
    limit: LimitOption = None,
    require_proof: ProofOption = False,
    report: ReportOption = "",
    certificate: CertificateOption = "",
    write_certificate: WriteCertificateOption = "",
    jobs: JobsOption = "",
    scheduler: SchedulerOption = "",
    resume: ResumeOption = "",
    manifest: ManifestOption = "",
    timeout: TimeoutOption = "10min",
    memory: MemoryOption = "8GB",
    in_process: InProcessOption = False,
    as_json: JsonOption = False,
) -> None:
    """Prove how far FILE is from a model or another file, or, alone, tell whether it is ready for CAM."""
    settings: dict[str, Any] = {
        "limits": tuple(option("--limit", _limit, text) for text in limit or ()),
        "require_proof": require_proof,
        "scene": bool(report),
    }
    if report:
        option("--report", options.report_path, report)
    if scheduler:
        option("--scheduler", options.scheduler, scheduler)
    limits = {"timeout": option("--timeout", options.seconds, timeout), "memory": option("--memory", _memory, memory)}
    workers = option("--jobs", lambda text: options.whole_number(text, 1, MOST_JOBS), jobs or "1")
    several = bool(manifest or scheduler or resume or jobs or len(files or ()) > 1)
    _refuse_pairs(files, manifest, report, resume, scheduler, jobs, in_process=in_process, several=several)
    if certificate or write_certificate:
        _refuse_certificates(certificate, write_certificate, against, profile or limit, several=several)
    claimed = None
    if certificate:
        option("FILE", options.exchange_format, (files or [""])[0])
        claimed, against, tolerance = _claimed(certificate, against, tolerance)
    default: dict[str, Any] = {"against": against, "tolerance": tolerance, "profile": profile}
    todo = [_job(file, **default, **settings) for file in files or ()]
    if manifest:
        option("--manifest", options.list_path, manifest)
        if not tolerance and against:
            _tolerance(against, tolerance)
        todo = _listed(manifest, default, settings)
    if report:
        check_folder(report)
    if several:
        code = _check_many(todo, report, as_json=as_json, workers=workers, scheduler=scheduler, log=resume, **limits)
    else:
        outcome = _check_one(todo[0], report, as_json=as_json, in_process=in_process, claimed=claimed, **limits)
        if write_certificate:
            _certify(outcome, write_certificate)
        code = outcome.code
    if code:
        raise typer.Exit(code)


def _refuse_pairs(
    files: list[str] | None,
    manifest: str,
    report: str,
    resume: str,
    scheduler: str,
    jobs: str,
    *,
    in_process: bool,
    several: bool,
) -> None:
    """Refuse options that do not go together."""

    def refuse(reason: str, name: str) -> None:
        raise typer.BadParameter(reason, param_hint=f"'{name}'")

    if manifest and files:
        refuse("takes the place of FILE", "--manifest")
    if not manifest and not files:
        refuse("is missing: name a file, or a --manifest", "FILE")
    if report and resume:
        refuse("cannot be made from a log: leave out --resume", "--report")
    if scheduler and jobs:
        refuse("is for files on this machine, not for --scheduler", "--jobs")
    if in_process and several:
        refuse("is for one file", "--in-process")


def _refuse_certificates(certificate: str, written: str, against: str, judged: Any, *, several: bool) -> None:
    """Refuse options that do not go with certificates."""

    def refuse(reason: str, name: str) -> None:
        raise typer.BadParameter(reason, param_hint=f"'{name}'")

    name = "--certificate" if certificate else "--write-certificate"
    if several:
        refuse("is for one file", name)
    if judged:
        refuse("is for a comparison with a model, not for --profile and --limit", name)
    if certificate and written:
        refuse("is one or the other: verify a certificate, or write one", "--write-certificate")
    if against and not options.is_model(against):
        refuse(f"must be the model that the certificate is for, got {against!r}", "--against")
    if written and not against:
        refuse("needs --against MODEL", "--write-certificate")
    if written and not written.lower().endswith(".json"):
        refuse(f"must end in .json, got {written!r}", "--write-certificate")
    if written:
        check_output(against, written, "--write-certificate")


def _claimed(path: str, against: str, tolerance: str) -> tuple[FileCertificate, str, str]:
    """The certificate, and the model and the tolerance to verify it with."""
    from gtcad.converters.file_certificate import model_beside, read_certificate

    if tolerance:
        option("--tolerance", options.length, tolerance)
    claimed = read_certificate(path)
    return claimed, against or model_beside(claimed, path), tolerance or repr(claimed.tolerance)


def _say_verified(outcome: Outcome, *, as_json: bool) -> None:
    """Say whether the certificate is verified, unless JSON has said it."""
    if outcome.verification is None:
        return
    for problem in outcome.verification.problems:
        tables.message(f"Error: the certificate is not verified: {problem}")
    if not (outcome.code or as_json):
        print(printable(outcome.verification.words))


def _certify(outcome: Outcome, path: str) -> None:
    """Write the certificate of a check that passed."""
    if outcome.code:
        tables.message(f"Error: {outcome.file} does not pass its check: {path} is not written")
        return
    from gtcad.converters.file_certificate import certificate_of, write_certificate

    write_certificate(path, certificate_of(outcome))


def _limit(text: str) -> tuple[str, float | None]:
    from gtcad.converters.profiles import limit_of

    found: tuple[str, float | None] = _refusing(limit_of, text)
    return found


def _memory(text: str) -> int | None:
    from gtcad.converters.isolated import LEAST_MEMORY

    size = options.size(text)
    if size is not None and size < LEAST_MEMORY:
        raise options.Refused(f"must be at least 1GB, which the kernel needs, or off, got {text!r}")
    return size


def _refusing(convert: Any, text: str) -> Any:
    try:
        return convert(text)
    except InputError as error:
        raise options.Refused(str(error)) from None


def _job(
    file: str, *, against: str, tolerance: str, profile: str, limits: Any, require_proof: bool, scene: bool
) -> Job:
    """What is asked about one file, judged before it is opened."""
    from gtcad.converters.outcome import Job
    from gtcad.converters.profiles import profile_of

    form = option("FILE", options.exchange_format, file)
    other = option("--against", options.any_format, against) if against else ""
    allowed = _tolerance(against, tolerance)
    if require_proof and not against:
        raise typer.BadParameter("is for --against", param_hint="'--require-proof'")
    name = profile or ("" if against and not limits else "cam")
    if name:
        option("--profile", lambda text: _refusing(profile_of, text), name)
    return Job(file, form, against or None, other, allowed, name or None, limits, require_proof, scene)


def _tolerance(against: str, tolerance: str) -> float | None:
    if not against and tolerance:
        raise typer.BadParameter(
            "is for --against: say what the file is to be compared with", param_hint="'--tolerance'"
        )
    if against and not tolerance:
        raise typer.BadParameter("is missing: --against needs a tolerance", param_hint="'--tolerance'")
    return option("--tolerance", options.length, tolerance) if tolerance else None


def _listed(manifest: str, default: dict[str, Any], settings: dict[str, Any]) -> list[Job]:
    """The jobs of a list; what an entry leaves out the options give."""
    from gtcad.converters.manifest import read_manifest

    found, problems = [], []
    for wanted in read_manifest(manifest):
        try:
            found.append(_job(wanted.file, **_filled(wanted, default), **settings))
        except typer.BadParameter as error:
            problems.append(f"{wanted.place}: {error.message}")
    if problems:
        raise ModelError(manifest, problems)
    return found


def _filled(wanted: Wanted, default: dict[str, Any]) -> dict[str, Any]:
    own = {"against": wanted.against, "tolerance": wanted.tolerance, "profile": wanted.profile}
    found = {name: value or default[name] for name, value in own.items()}
    return found if found["against"] else found | {"tolerance": wanted.tolerance}


def _check_one(
    job: Job, report: str, *, as_json: bool, in_process: bool, claimed: FileCertificate | None = None, **limits: Any
) -> Outcome:
    from gtcad.converters.isolated import Runner
    from gtcad.converters.outcome import check_files, run_job

    check_files(job)  # what is missing or empty is known before a process is started
    outcome = run_job(job) if in_process else Runner(**limits).run(run_job, job)
    if claimed is not None:
        from gtcad.converters.file_certificate import verified

        outcome = verified(claimed, outcome)
    if as_json:
        print_json(**outcome.as_data())
    else:
        if outcome.report is not None:
            check_tables.print_report(outcome.report)
        if outcome.readiness is not None:
            check_tables.print_readiness(outcome.readiness)
        if outcome.statements:
            from gtcad.converters.report_words import statement

            check_tables.print_statements(outcome.statements, statement)
    _warn(outcome)
    _say_verified(outcome, as_json=as_json)
    _write_report(report, [outcome])
    return outcome


def _check_many(todo: list[Job], report: str, *, as_json: bool, scheduler: str, log: str, **settings: Any) -> int:
    from gtcad.converters.batch import check_many
    from gtcad.converters.outcome import worst_code

    codes, outcomes = [], []
    with tables.progress("checking", len(todo)) as advance:
        for entry in check_many(todo, scheduler=scheduler or None, log=log or None, **settings):
            codes.append(entry.code)
            if as_json:
                print(json.dumps(entry.data), flush=True)
            else:
                check_tables.print_line(entry.data, known=entry.outcome is None)
            if entry.outcome is not None:
                _warn(entry.outcome)
                outcomes += [entry.outcome] if report else []
            advance()
    tables.message(check_tables.summary(codes))
    _write_report(report, outcomes)
    return worst_code(codes)


def _warn(outcome: Outcome) -> None:
    for name in () if outcome.report is None else outcome.report.extra:
        other = "model" if outcome.against is not None and options.is_model(outcome.against) else "other file"
        tables.message(f"Warning: {outcome.file} holds a shape that the {other} does not have: {name!r}")


def _write_report(path: str, outcomes: list[Outcome]) -> None:
    if path:
        from gtcad.converters.report import write_report

        write_report(path, outcomes)
