"""The command ``gtcad``: export, check, info, schema, doctor.

Results go to stdout, messages and progress to stderr. Exit codes: 0 all proved, or estimated and marked so; 1 a shape
is missing, invalid or beyond the tolerance; 2 usage, judged before any file is opened; 3 a file is missing, unreadable
or bad; 4 the kernel failed; 5 undecided; 70 an error of this program; 130 interrupted; 141 nobody reads the output.
"""

from __future__ import annotations

import contextlib
import enum
import functools
import json
import os
import sys
from collections.abc import Callable, Sequence
from typing import Annotated, Any, NoReturn, TypeVar

import typer

import gtcad
from gtcad import _options as options
from gtcad import _tables as tables
from gtcad import errors

Value = TypeVar("Value")

app = typer.Typer(
    name="gtcad",
    help="GT-Bezier curves and surfaces to CAD files, within a proved tolerance.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,  # plain help and messages: quick to start, and to be read by programs
    pretty_exceptions_enable=False,
)


class Code(enum.IntEnum):
    """What an exit code says."""

    FINE = 0
    FAILED = 1
    USAGE = 2
    FILE = 3
    KERNEL = 4
    UNDECIDED = 5
    INTERNAL = 70
    INTERRUPTED = 130
    PIPE = 141


_CODES: tuple[tuple[type[BaseException] | tuple[type[BaseException], ...], Code], ...] = (
    (KeyboardInterrupt, Code.INTERRUPTED),
    (BrokenPipeError, Code.PIPE),
    ((errors.ToleranceNotMet, errors.ToleranceBelowPrecision), Code.FAILED),
    ((errors.KernelError, errors.KernelMissing, errors.ExtraMissing), Code.KERNEL),
    ((errors.ModelError, errors.InputError, OSError), Code.FILE),
)
_debug = False

ModelArgument = Annotated[str, typer.Argument(metavar="MODEL", help="A model file, .json or .toml.")]
FileArgument = Annotated[str, typer.Argument(metavar="FILE", help="A .step, .stp, .igs, .iges or .brep file.")]
ToleranceOption = Annotated[
    str, typer.Option("--tolerance", metavar="LENGTH", help="In mm, or with a unit: 1e-4, 1e-5in, 0.1um.")
]
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
    str, typer.Option("--timestamp", metavar="TIME", help="The time to write instead of now, for equal bytes.")
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON document instead of a table.")]


def main() -> None:
    """Run the command on the arguments of the process, and end the process."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # a name that the terminal's encoding lacks is no reason to fail
            stream.reconfigure(errors="backslashreplace")
    try:
        app(prog_name="gtcad")
    except KeyboardInterrupt:
        sys.exit(Code.INTERRUPTED)
    finally:
        _flush()


def _flush() -> None:
    """Write out what is printed now: at exit the interpreter would complain about a closed pipe."""
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _guarded(command: Callable[..., None]) -> Callable[..., None]:
    """The command, ending with a message and a code where it would end with a traceback."""

    @functools.wraps(command)
    def run(*arguments: Any, **keywords: Any) -> None:
        try:
            command(*arguments, **keywords)
            if sys.stdout is not None:
                sys.stdout.flush()
        except (typer.Exit, typer.BadParameter):
            raise
        except (Exception, KeyboardInterrupt) as error:
            _end(error)

    return run


def _end(error: BaseException) -> NoReturn:
    code = next((code for types, code in _CODES if isinstance(error, types)), Code.INTERNAL)
    if _debug:
        import traceback

        traceback.print_exception(error)
    if code is Code.INTERNAL:
        text = f"internal error: {type(error).__name__}: {' '.join(str(error).split())}"
        tables.message(text if _debug else f"{text}; run again as 'gtcad --debug ...' to see where")
    elif code not in (Code.INTERRUPTED, Code.PIPE):
        tables.message("\n".join(f"Error: {line}" for line in str(error).split("\n")))
    raise typer.Exit(int(code))


def _option(name: str, convert: Callable[[str], Value], text: str) -> Value:
    try:
        return convert(text)
    except options.Refused as error:
        raise typer.BadParameter(str(error), param_hint=f"'{name}'") from None


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"gtcad {gtcad.__version__}")
        raise typer.Exit()


@app.callback()
def top(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit.")
    ] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show where in the program an error came up.")] = False,
) -> None:
    """GT-Bezier curves and surfaces to CAD files, within a proved tolerance."""
    global _debug  # noqa: PLW0603 - the one setting of the process; contexts do not reach the decorator
    _debug = debug


@app.command(short_help="Fit a model within a tolerance and write a CAD file.")
@_guarded
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
    as_json: JsonOption = False,
) -> None:
    """Fit every shape of a MODEL within the tolerance, prove it, and write the splines, or triangles, to OUT."""
    _option("MODEL", options.model_path, model)
    form = _option("--output", options.export_format, output)
    if form in options.MESHES.values():
        _export_mesh(context, model, output, tolerance, as_json=as_json)
        return
    settings = _fit_settings(tolerance, degree, max_degree, continuity, end_order, exact=not no_exact)
    if schema and form != "STEP":
        raise typer.BadParameter(f"is for STEP files, not {form}", param_hint="'--schema'")
    chosen = _option("--schema", options.schema, schema or "AP242")
    moment = _option("--timestamp", options.timestamp, timestamp) if timestamp else None
    _check_output(model, output)

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
        parts = jobs.parts_of(fits, content.colors)
        try:
            jobs.write_parts(output, form, parts, tolerance=settings["tolerance"], schema=chosen, timestamp=moment)
        except errors.InputError as error:  # too small or too degenerate for the kernel, not for us
            raise errors.ModelError(model, [str(error)]) from error
    rows = [fitted.as_data() for fitted in fits]
    if as_json:
        _print_json(model=model, output=output, written=not failures, tolerance=settings["tolerance"], shapes=rows)
    else:
        tables.print_table(
            ("name", "poles", "degree", "deviation in mm", "form"), [tables.export_row(row) for row in rows]
        )
    for failure in failures:
        tables.message(f"Error: shape {failure.name!r}: {failure.error}")
    if failures:
        tables.message(f"Error: {output} is not written")
        raise typer.Exit(int(Code.FAILED))


def _export_mesh(context: typer.Context, model: str, output: str, tolerance: str, *, as_json: bool) -> None:
    """Write the triangles of the model's surfaces."""
    for name, option in options.FOR_SPLINES.items():
        source = context.get_parameter_source(name)
        if source is not None and source.name != "DEFAULT":
            raise typer.BadParameter("is for splines, not for triangles", param_hint=f"'{option}'")
    allowed = _option("--tolerance", options.length, tolerance)
    _check_output(model, output)

    from gtcad.converters import jobs
    from gtcad.model import load_model

    rows, left_out = jobs.export_mesh(load_model(model), model, output, allowed)
    if as_json:
        _print_json(model=model, output=output, written=True, tolerance=allowed, shapes=rows, left_out=left_out)
    else:
        tables.print_table(tables.MESH_COLUMNS, [tables.mesh_row(row) for row in rows])
    for name in left_out:
        tables.message(f"Warning: {output} has no curves: {name!r} is left out")


def _fit_settings(
    tolerance: str, degree: str, max_degree: str, continuity: str, end_order: str, *, exact: bool
) -> dict[str, Any]:
    """The keyword arguments of a fit."""
    chosen = _option("--degree", options.degree, degree)
    if max_degree and chosen != "auto":
        raise typer.BadParameter("is for --degree auto", param_hint="'--max-degree'")
    highest = _option("--max-degree", options.degree_number, max_degree or "11")
    top_degree = highest if isinstance(chosen, str) else chosen
    settings: dict[str, Any] = {
        "tolerance": _option("--tolerance", options.length, tolerance),
        "degree": chosen,
        "max_degree": highest,
        "end_order": _option("--end-order", options.end_order, end_order),
        "exact": "auto" if exact else False,
    }
    if continuity:
        settings["continuity"] = _option(
            "--continuity", lambda text: options.whole_number(text, 0, top_degree - 1), continuity
        )
    return settings


def _check_output(model: str, output: str) -> None:
    with contextlib.suppress(OSError, ValueError):
        if os.path.samefile(model, output):
            raise typer.BadParameter(f"is the model itself: {output!r}", param_hint="'--output'")
    folder = os.path.dirname(output) or "."
    if not os.path.isdir(folder):
        raise errors.FileError(output, f"cannot be written: there is no folder {folder!r}")
    if os.path.isdir(output):
        raise errors.FileError(output, "is a folder")


@app.command(short_help="Prove what a CAD file holds against its model.")
@_guarded
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
    form = _option("FILE", options.exchange_format, file)
    _option("--against", options.model_path, against)
    allowed = _option("--tolerance", options.length, tolerance)

    from gtcad.converters import jobs
    from gtcad.converters.check import check_parts
    from gtcad.model import load_model

    shapes = load_model(against).in_millimetres()
    report = check_parts(jobs.read_parts(file, form), shapes, allowed)
    if as_json:
        _print_json(file=file, against=against, tolerance=allowed, **tables.report_data(report))
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


@app.command()
@_guarded
def info(
    file: Annotated[str, typer.Argument(metavar="FILE", help="A model, or a STEP, IGES or BREP file.")],
    as_json: JsonOption = False,
) -> None:
    """Show what a model or an exchange file holds."""
    form = _option("FILE", options.any_format, file)

    from gtcad.converters import jobs
    from gtcad.model import load_model

    is_model = form == "MODEL"
    content = (
        jobs.describe_model(load_model(file)) if is_model else jobs.describe_parts(jobs.read_parts(file, form), form)
    )
    if as_json:
        _print_json(file=file, **content)
        return
    size = tables.size(content["box"], content["box_of"])
    print(f"{tables.printable(file)}: {content['format']}, unit {content['unit']}, size {size}")
    if content["shapes"]:
        row = tables.model_row if is_model else tables.part_row
        tables.print_table(
            ("name", "kind", "degree", "poles", "colour", "remark"), [row(shape) for shape in content["shapes"]]
        )
    if content.get("bodies"):
        tables.print_table(
            ("name", "body", "faces", "volume, mm^3", "remark"), [tables.body_row(body) for body in content["bodies"]]
        )


@app.command(short_help="Print the JSON Schema of model files.")
@_guarded
def schema() -> None:
    """Print the JSON Schema of model files, which holds for TOML too."""
    from gtcad.model import schema as model_schema

    print(json.dumps(model_schema(), indent=2))


@app.command(short_help="Examine the installation and its CAD kernel.")
@_guarded
def doctor(as_json: JsonOption = False) -> None:
    """Show what is installed, whether the CAD kernel works, and how to repair it."""
    from gtcad.converters.doctor import diagnose_installation

    diagnosis = diagnose_installation()
    if as_json:
        _print_json(**diagnosis.as_data())
    else:
        tables.print_diagnosis(diagnosis)
    if diagnosis.problems:
        raise typer.Exit(int(Code.KERNEL))


def _print_json(**content: Any) -> None:
    print(json.dumps(tables.plain(content), indent=2))


if __name__ == "__main__":
    main()
