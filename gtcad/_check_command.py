"""The command ``gtcad check``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import typer

from gtcad import _options as options
from gtcad import _tables as tables
from gtcad._command import Code, FileArgument, JsonOption, ToleranceOption, guarded, option, print_json


@guarded
def check(
    file: FileArgument,
    *,
    against: Annotated[str, typer.Option("--against", metavar="MODEL", help="The model that the file was made from.")],
    tolerance: ToleranceOption,
    require_proof: Annotated[
        bool, typer.Option("--require-proof", help="Do not accept estimates (exit code 5).")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Read FILE back and prove how far its curves and surfaces are from those of a model."""
    form = option("FILE", options.exchange_format, file)
    option("--against", options.model_path, against)
    allowed = option("--tolerance", options.length, tolerance)

    from gtcad.converters import jobs
    from gtcad.converters.check import check_parts
    from gtcad.model import load_model

    shapes = load_model(against).in_millimetres()
    report = check_parts(jobs.read_parts(file, form), shapes, allowed)
    if as_json:
        print_json(file=file, against=against, tolerance=allowed, **tables.report_data(report))
    else:
        tables.print_report(report)
    for name in report.extra:
        tables.message(f"Warning: {file} holds a shape that the model does not have: {name!r}")
    lost = [joint for joint in report.joints if not joint.kept]
    verdicts = [row.verdict for row in report.rows] + ["failed"] * len(lost)
    code = _verdict_code(verdicts, require_proof=require_proof)
    if code is not Code.FINE:
        raise typer.Exit(int(code))


def _verdict_code(verdicts: Sequence[str], *, require_proof: bool) -> Code:
    if any(verdict in ("failed", "missing", "invalid") for verdict in verdicts):
        return Code.FAILED
    accepted = {"proved"} if require_proof else {"proved", "estimated"}
    return Code.FINE if accepted.issuperset(verdicts) else Code.UNDECIDED
