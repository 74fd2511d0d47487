"""The command ``gtcad``: export, check, info, schema, doctor. Their manner and exit codes: ``gtcad._command``."""

from __future__ import annotations

import json
import os
import sys
from typing import Annotated

import typer

import gtcad
from gtcad import _options as options
from gtcad import _tables as tables
from gtcad._check_command import check
from gtcad._command import Code, JsonOption, guarded, option, print_json, set_debug
from gtcad._export_command import export
from gtcad._optimize_command import optimize
from gtcad._unroll_command import unroll

app = typer.Typer(
    name="gtcad",
    help="GT-Bezier curves and surfaces to CAD files, within a proved tolerance.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,  # plain help and messages: quick to start, and to be read by programs
    pretty_exceptions_enable=False,
)


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
    set_debug(debug)


app.command(short_help="Fit a model within a tolerance and write a CAD file.")(export)
app.command(short_help="Prove a CAD file against its model, or judge it for CAM.")(check)
app.command(short_help="Find the design variables that make an objective least.")(optimize)
app.command(short_help="Lay the developable surfaces of a model flat.")(unroll)


@app.command()
@guarded
def info(
    file: Annotated[str, typer.Argument(metavar="FILE", help="A model, or a STEP, IGES or BREP file.")],
    as_json: JsonOption = False,
) -> None:
    """Show what a model or an exchange file holds."""
    form = option("FILE", options.any_format, file)

    from gtcad.converters import jobs
    from gtcad.converters.descriptions import describe_model, describe_parts
    from gtcad.model import load_model

    is_model = form == "MODEL"
    content = describe_model(load_model(file)) if is_model else describe_parts(jobs.read_parts(file, form), form)
    if as_json:
        print_json(file=file, **content)
        return
    size = tables.size(content["box"], content["box_of"], len(content["shapes"]))
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
@guarded
def schema() -> None:
    """Print the JSON Schema of model files, which holds for TOML too."""
    from gtcad.model import schema as model_schema

    print(json.dumps(model_schema(), indent=2))


@app.command(short_help="Examine the installation and its CAD kernel.")
@guarded
def doctor(as_json: JsonOption = False) -> None:
    """Show what is installed, whether the CAD kernel works, and how to repair it."""
    from gtcad.converters.doctor import diagnose_installation

    diagnosis = diagnose_installation()
    if as_json:
        print_json(**diagnosis.as_data())
    else:
        tables.print_diagnosis(diagnosis)
    if diagnosis.problems:
        raise typer.Exit(int(Code.KERNEL))


if __name__ == "__main__":
    main()
