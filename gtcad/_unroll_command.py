"""The command ``gtcad unroll``."""

from __future__ import annotations

from typing import Annotated

import typer

from gtcad import _options as options
from gtcad import _tables as tables
from gtcad import errors
from gtcad._command import Code, JsonOption, ModelArgument, guarded, option, print_json
from gtcad._export_command import check_output

OutputOption = Annotated[str, typer.Option("--output", "-o", metavar="OUT", help="A .dxf or .svg file.")]
ToleranceOption = Annotated[
    str, typer.Option("--tolerance", metavar="LENGTH", help="Of the drawing, in mm, or with a unit: 1e-3, 0.5um.")
]
BendLinesOption = Annotated[
    str, typer.Option("--bend-lines", metavar="N", help="How many rulings to draw on each pattern; 0 for none.")
]
ShapeOption = Annotated[
    list[str],
    typer.Option("--shape", metavar="NAME", help="A shape to unroll, one for each option; all when left out."),
]
TwistOption = Annotated[
    str, typer.Option("--twist", metavar="DEG", help="Degrees that a surface may twist along a ruling.")
]


@guarded
def unroll(
    model: ModelArgument,
    *,
    output: OutputOption,
    tolerance: ToleranceOption = "0.01",
    bend_lines: BendLinesOption = "12",
    shape: ShapeOption = [],  # noqa: B006 - typer copies it
    twist: TwistOption = "1e-6",
    as_json: JsonOption = False,
) -> None:
    """Lay the developable surfaces of a MODEL flat, side by side, and write the drawing to OUT."""
    option("MODEL", options.model_path, model)
    form = option("--output", options.drawing_format, output)
    allowed = option("--tolerance", options.length, tolerance)
    count = option("--bend-lines", lambda text: options.whole_number(text, 0, options.MOST_BEND_LINES), bend_lines)
    degrees = option("--twist", options.twist, twist)
    check_output(model, output)

    from gtcad.converters.flat import write_dxf, write_svg
    from gtcad.converters.flat_outline import arranged
    from gtcad.converters.unroll import curves_of, idle_markings, unroll_model
    from gtcad.model import load_model

    content = load_model(model)
    try:
        found = list(unroll_model(content, tolerance=allowed, bend_lines=count, twist_deg=degrees, only=shape))
    except errors.InputError as error:  # a shape or a marking that there is not, or that leaves its patch
        raise errors.ModelError(model, [str(error)]) from error
    left_out = curves_of(content, shape)
    if not found:
        curves = ", ".join(map(repr, left_out))
        reason = f"curves have no flat pattern: --shape names {curves}" if shape else "it has no surfaces to unroll"
        raise errors.ModelError(model, [reason])
    failures = [one for one in found if one.sheet is None]
    if not failures:
        sheets = arranged([one.sheet for one in found if one.sheet is not None])
        (write_dxf if form == "DXF" else write_svg)(output, sheets)
    rows = [one.as_data() for one in found]
    if as_json:
        print_json(model=model, output=output, written=not failures, tolerance=allowed, shapes=rows, left_out=left_out)
    else:
        tables.print_table(tables.FLAT_COLUMNS, [tables.flat_row(row) for row in rows])
    for name in left_out:
        tables.message(f"Warning: curves have no flat pattern: {name!r} is left out")
    for marking in idle_markings(content):
        tables.message(f"Warning: {marking.curve!r} is not drawn: {marking.on!r} is for construction")
    for row in rows:
        if row.get("overlap"):
            x, y = row["overlap"]
            tables.message(f"Warning: {row['name']!r} lies over itself at ({x:.6g}, {y:.6g}) of its own pattern")
    for failure in failures:
        tables.message(f"Error: shape {failure.name!r}: {failure.error}")
    if failures:
        tables.message(f"Error: {output} is not written")
        raise typer.Exit(int(Code.FAILED))
