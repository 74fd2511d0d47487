"""The command ``gtcad export``."""

from __future__ import annotations

import contextlib
import os
from datetime import datetime
from typing import Annotated, Any

import typer

from gtcad import _options as options
from gtcad import _tables as tables
from gtcad import errors
from gtcad._command import Code, JsonOption, ModelArgument, ToleranceOption, guarded, option, print_json

OutputOption = Annotated[
    str,
    typer.Option("--output", "-o", metavar="OUT", help="A .step, .stp, .igs, .iges, .brep, .stl, .glb, .3mf file."),
]
DegreeOption = Annotated[str, typer.Option("--degree", metavar="P", help="Degree of the splines, 3 to 25, or auto.")]
MaxDegreeOption = Annotated[
    str, typer.Option("--max-degree", metavar="N", help="The highest degree that auto may take; 11 when left out.")
]
ContinuityOption = Annotated[
    str, typer.Option("--continuity", metavar="K", help="Continuous derivatives at knots; degree - 1 when left out.")
]
EndOrderOption = Annotated[
    str, typer.Option("--end-order", metavar="R", help="Derivatives that are exact at the ends, 0 to 3.")
]
NoExactOption = Annotated[bool, typer.Option("--no-exact", help="Fit also what has an exact form.")]
SchemaOption = Annotated[
    str, typer.Option("--schema", metavar="NAME", help="Of STEP files: AP242 when left out, AP214 or AP203.")
]
TimestampOption = Annotated[
    str,
    typer.Option("--timestamp", metavar="TIME", help="The time to write instead of now, such as 2024-02-29T12:00Z."),
]
CertificateOption = Annotated[
    str, typer.Option("--certificate", metavar="JSON", help="Also check OUT and write what was proved of it.")
]


@guarded
def export(
    context: typer.Context,
    model: ModelArgument,
    *,
    output: OutputOption,
    tolerance: ToleranceOption,
    degree: DegreeOption = "5",
    max_degree: MaxDegreeOption = "",
    continuity: ContinuityOption = "",
    end_order: EndOrderOption = "0",
    no_exact: NoExactOption = False,
    schema: SchemaOption = "",
    timestamp: TimestampOption = "",
    certificate: CertificateOption = "",
    as_json: JsonOption = False,
) -> None:
    """Fit every shape of a MODEL within the tolerance, prove it, and write the splines, or triangles, to OUT."""
    option("MODEL", options.model_path, model)
    form = option("--output", options.export_format, output)
    if form in options.MESHES.values():
        _export_mesh(context, model, output, tolerance, as_json=as_json)
        return
    settings = _fit_settings(tolerance, degree, max_degree, continuity, end_order, exact=not no_exact)
    if schema and form != "STEP":
        raise typer.BadParameter(f"is for STEP files, not {form}", param_hint="'--schema'")
    chosen = option("--schema", options.schema, schema or "AP242")
    moment = option("--timestamp", options.timestamp, timestamp) if timestamp else None
    check_output(model, output)
    if certificate:
        _check_certificate(certificate, model, output)

    from gtcad.converters import jobs
    from gtcad.model import load_model

    content = load_model(model)
    shapes = content.in_millimetres()
    if not shapes:
        raise errors.ModelError(model, ["all its shapes are for construction: there is nothing to export"])
    fits = []
    with tables.progress("fitting", len(shapes)) as advance:
        for fitted in jobs.fit_shapes(shapes, settings):
            fits.append(fitted)
            advance()
    failures = [fitted for fitted in fits if fitted.geometry is None]
    if not failures:
        parts = jobs.parts_of(fits, content.colors, shapes if form == "STEP" and chosen != "AP203" else None)
        try:
            jobs.write_parts(output, form, parts, tolerance=settings["tolerance"], schema=chosen, timestamp=moment)
        except errors.InputError as error:  # too small or too degenerate for the kernel, not for us
            raise errors.ModelError(model, [str(error)]) from error
    rows = [fitted.as_data() for fitted in fits]
    if as_json:
        print_json(model=model, output=output, written=not failures, tolerance=settings["tolerance"], shapes=rows)
    else:
        tables.print_table(
            ("name", "poles", "degree", "deviation in mm", "form"), [tables.export_row(row) for row in rows]
        )
    for failure in failures:
        tables.message(f"Error: shape {failure.name!r}: {failure.error}")
    if failures:
        tables.message(f"Error: {output} is not written")
        raise typer.Exit(int(Code.FAILED))
    if certificate:
        _certify(model, output, form, settings["tolerance"], certificate, moment)


def _check_certificate(certificate: str, model: str, output: str) -> None:
    """Refuse a certificate's file that is another one of the command, or that has no folder."""
    if os.path.splitext(certificate)[1].lower() != ".json":
        raise typer.BadParameter(f"must end in .json, got {certificate!r}", param_hint="'--certificate'")
    if os.path.abspath(certificate) in (os.path.abspath(model), os.path.abspath(output)):
        raise typer.BadParameter(f"must be a file of its own, got {certificate!r}", param_hint="'--certificate'")
    check_output(model, certificate, "--certificate")


def _certify(model: str, output: str, form: str, tolerance: float, certificate: str, moment: datetime | None) -> None:
    """Check what was written, and write the certificate."""
    from gtcad.converters.file_certificate import certificate_of, write_certificate
    from gtcad.converters.outcome import MODEL, Job, run_job

    outcome = run_job(Job(output, form, model, MODEL, tolerance))
    if outcome.code != Code.FINE:
        tables.message(f"Error: {output} does not pass its check: there is no certificate")
        raise typer.Exit(outcome.code)
    write_certificate(certificate, certificate_of(outcome, moment.isoformat(timespec="seconds") if moment else None))


def _export_mesh(context: typer.Context, model: str, output: str, tolerance: str, *, as_json: bool) -> None:
    """Write the triangles of the model's surfaces."""
    for name, flag in options.FOR_SPLINES.items():
        source = context.get_parameter_source(name)
        if source is not None and source.name != "DEFAULT":
            raise typer.BadParameter("is for splines, not for triangles", param_hint=f"'{flag}'")
    allowed = option("--tolerance", options.length, tolerance)
    check_output(model, output)

    from gtcad.converters import jobs
    from gtcad.model import load_model

    rows, left_out = jobs.export_mesh(load_model(model), model, output, allowed)
    if as_json:
        print_json(model=model, output=output, written=True, tolerance=allowed, shapes=rows, left_out=left_out)
    else:
        tables.print_table(tables.MESH_COLUMNS, [tables.mesh_row(row) for row in rows])
    for name in left_out:
        tables.message(f"Warning: {output} has no curves: {name!r} is left out")


def _fit_settings(
    tolerance: str, degree: str, max_degree: str, continuity: str, end_order: str, *, exact: bool
) -> dict[str, Any]:
    """The keyword arguments of a fit."""
    chosen = option("--degree", options.degree, degree)
    if max_degree and chosen != "auto":
        raise typer.BadParameter("is for --degree auto", param_hint="'--max-degree'")
    highest = option("--max-degree", options.degree_number, max_degree or "11")
    top_degree = highest if isinstance(chosen, str) else chosen
    settings: dict[str, Any] = {
        "tolerance": option("--tolerance", options.length, tolerance),
        "degree": chosen,
        "max_degree": highest,
        "end_order": option("--end-order", options.end_order, end_order),
        "exact": "auto" if exact else False,
    }
    if continuity:
        settings["continuity"] = option(
            "--continuity", lambda text: options.whole_number(text, 0, top_degree - 1), continuity
        )
    return settings


def check_output(model: str, output: str, name: str = "--output") -> None:
    """Refuse a file to write, by the option of that name, that is the model, or that has no folder."""
    with contextlib.suppress(OSError, ValueError):
        if os.path.samefile(model, output):
            raise typer.BadParameter(f"is the model itself: {output!r}", param_hint=f"'{name}'")
    check_folder(output)


def check_folder(output: str) -> None:
    """Refuse a file to write that has no folder or is one, before there is any work to be lost."""
    folder = os.path.dirname(output) or "."
    if not os.path.isdir(folder):
        raise errors.FileError(output, f"cannot be written: there is no folder {folder!r}")
    if not os.access(folder, os.W_OK):
        raise errors.FileError(output, f"cannot be written: the folder {folder!r} is read-only for you")
    if os.path.isdir(output):
        raise errors.FileError(output, "is a folder")
