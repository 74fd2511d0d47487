"""What the command prints: tables that fit 80 columns, plain when no terminal reads them."""

from __future__ import annotations

import contextlib
import decimal
import json
import math
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gtcad.converters.doctor import Diagnosis

NAME = "name"  # the column that gives way when a table gets too wide
LEAST_NAME = 12
FLAT_COLUMNS = (NAME, "size, mm", "area, mm^2", "bends", "deviation in mm", "remark")
VISIBLE_STRAIN = 1e-9
MESH_COLUMNS = (NAME, "vertices", "triangles", "deviation in mm")


def print_table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print rows of texts under their headings on stdout, literally.

    Parameters
    ----------
    columns
        The headings; the column "name" is shortened first when the table is too wide.
    rows
        As many texts in each as there are columns; a column of empty texts is left out.
    """
    from rich import box
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    console = Console(highlight=False, emoji=False)
    used = [index for index in range(len(columns)) if any(row[index] for row in rows)]
    columns = [columns[index] for index in used]
    texts = [[Text(printable(row[index])) for index in used] for row in rows]
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    for index, heading in enumerate(columns):
        if heading == NAME:
            others = sum(
                max(text.cell_len for text in column) + 3
                for number, column in enumerate(zip(map(Text, columns), *texts, strict=True))
                if number != index
            )
            room = max(console.width - others, LEAST_NAME)
            table.add_column(Text(heading), overflow="ellipsis", no_wrap=True, max_width=room)
        else:
            table.add_column(Text(heading), overflow="fold")
    for row in texts:
        table.add_row(*row)
    console.print(table)


def print_diagnosis(diagnosis: Diagnosis) -> None:
    """Print the versions, what is wrong, and the commands that repair it."""
    rows = [[name, version or "not installed"] for name, version in diagnosis.versions.items()]
    kernel = diagnosis.kernel
    print_table(("name", "version"), [*rows, ["OCCT", (kernel.version if kernel else None) or "-"]])
    if kernel is not None and not kernel.error:
        print("\nthe kernel works: it made and checked a face")
    for name, host in diagnosis.hosts.items():
        if not host.error:
            print(f"{name} works: it made and checked a GT face")
    for problem in diagnosis.problems:
        print(f"\nproblem: {problem}")
    if diagnosis.problems:
        print("\nto repair it, run:")
    elif kernel is None:
        print("\nno CAD kernel: shapes, fits and proofs work, exchange files do not; to get a kernel, run:")
    for command in diagnosis.repair:
        print(f"    {command}")


def printable(text: str) -> str:
    """The text with everything that could command a terminal written out."""
    return text if text.isprintable() else repr(text)[1:-1]


def message(text: str) -> None:
    """Print a message on stderr, line by line."""
    for line in text.split("\n"):
        print(printable(line), file=sys.stderr)


def product(sizes: Sequence[int]) -> str:
    """Counts or degrees of the directions, such as "13x12"."""
    return "x".join(map(str, sizes))


def interval(bounds: tuple[float, float] | None) -> str:
    """A pair (lower, upper) with three digits, rounded outwards: what is printed is still proved."""
    if bounds is None or not all(map(math.isfinite, bounds)):
        return "-"
    return f"{_rounded(bounds[0], decimal.ROUND_FLOOR)} .. {_rounded(bounds[1], decimal.ROUND_CEILING)}"


def _rounded(value: float, rounding: str) -> str:
    return f"{decimal.Context(prec=3, rounding=rounding).create_decimal(value):.2e}" if value else "0"


def export_row(shape: Mapping[str, Any]) -> list[str]:
    """Name, poles, degree, deviation and form of a fitted shape."""
    if "error" in shape:
        return [shape["name"], "-", "-", "-", "failed"]
    form = "exact" if shape["exact"] else "fitted" if shape["proved"] else "estimated"
    if shape["entity"] != "b_spline":
        form += f" {shape['entity']}"
    degree, poles = _sizes(shape)
    return [shape["name"], poles, degree, interval(shape["deviation"]), form]


def mesh_row(shape: Mapping[str, Any]) -> list[str]:
    """Name, vertices, triangles and proved deviation of a meshed surface, rounded up."""
    deviation = _rounded(shape["deviation"], decimal.ROUND_CEILING)
    return [shape["name"], str(shape["vertices"]), str(shape["triangles"]), deviation]


def flat_row(shape: Mapping[str, Any]) -> list[str]:
    """Name, size, area, bend lines, deviation and remark of a flat pattern."""
    if "error" in shape:
        return [shape["name"], "-", "-", "-", "-", "failed"]
    remarks = [f"{shape['patches']} patches"] if shape["patches"] > 1 else []
    for field in ("hole", "mark"):
        count = shape[f"{field}s"]
        remarks += [f"{count} {field}{'s' if count > 1 else ''}"] if count else []
    remarks += [f"strain {shape['strain']:.1e}"] if shape["strain"] > VISIBLE_STRAIN else []
    remarks += ["overlaps"] if shape["overlap"] else []
    sides = " x ".join(f"{side:.5g}" for side in shape["size"])
    deviation = _rounded(shape["deviation"], decimal.ROUND_CEILING)
    bends = str(shape["bend_lines"] or "-")
    return [shape["name"], sides, f"{shape['area']:.6g}", bends, deviation, ", ".join(remarks)]


def model_row(shape: Mapping[str, Any]) -> list[str]:
    """Name, kind, degree, poles, colour and remark of a shape of a model."""
    remark = "" if shape["range"] is None else f"part {json.dumps(shape['range'])}"
    if shape["joints"]:
        remark = "joints " + ", ".join(_counted(shape["joints"]))
    if shape["construction"]:
        remark = ", ".join(filter(None, ("construction", remark)))
    kind = f"{'/'.join(shape['families'])} {shape['kind']}".strip()
    return [shape["name"], kind, *_columns(shape), remark]


def _counted(joints: Sequence[str]) -> list[str]:
    """Orders in a row, those of many joints with their number: "G2", "3 C0"."""
    if len(joints) <= 4 and len(set(joints)) > 1:
        return list(joints)
    return [f"{count} {order}" if count > 1 else order for order, count in Counter(joints).items()]


def part_row(shape: Mapping[str, Any]) -> list[str]:
    """Name, kind, degree, poles, colour and remark of a part of an exchange file."""
    remarks = ["trimmed"] if shape["trimmed"] else []
    remarks += [] if shape["valid"] else ["invalid"]
    return [shape["name"], shape["entity"].lower(), *_columns(shape), ", ".join(remarks)]


def body_row(body: Mapping[str, Any]) -> list[str]:
    """Name, kind, faces, volume and remark of a shell or solid of an exchange file."""
    kind = f"closed {body['kind']}" if body["closed"] and body["kind"] == "shell" else body["kind"]
    remarks = ["not closed"] if body["kind"] == "solid" and not body["closed"] else []
    remarks += [] if body["valid"] else ["invalid"]
    volume = "" if body["volume"] is None else f"{body['volume']:.9g}"
    return [body["name"], kind, str(body["faces"]), volume, ", ".join(remarks)]


def _columns(shape: Mapping[str, Any]) -> list[str]:
    return [*_sizes(shape), shape["color"] or ""]


def _sizes(shape: Mapping[str, Any]) -> list[str]:
    """Degree and poles: of both directions of a surface, or of the pieces of a chain."""
    if "composite" in shape.get("kind", "") or shape.get("entity") == "wire":
        return [",".join(map(str, shape["degree"])) or "-", "+".join(map(str, shape["poles"])) or "-"]
    if shape.get("kind") in ("quilt", "solid") or shape.get("entity") in ("shell", "solid"):
        return [",".join(map(str, shape["degree"])) or "-", str(sum(shape["poles"])) if shape["poles"] else "-"]
    return [product(shape["degree"]) or "-", product(shape["poles"]) or "-"]


def size(box: Mapping[str, list[float]] | None, box_of: str, shapes: int) -> str:
    """The lengths of the sides of a box in mm, and what it is a box of; of no box why there is none."""
    if box is None:
        return "none: all its shapes are for construction" if shapes else "none: it holds no shapes"
    sides = (most - least for least, most in zip(box["least"], box["most"], strict=True))
    return " x ".join(f"{side:.6g}" for side in sides) + f" mm ({box_of})"


def plain(value: Any) -> Any:
    """The value as JSON can hold it: infinite and undefined numbers become null."""
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, dict):
        return {key: plain(entry) for key, entry in value.items()}
    return [plain(entry) for entry in value] if isinstance(value, list | tuple) else value


@contextlib.contextmanager
def progress(what: str, total: int) -> Iterator[Callable[[], None]]:
    """A bar on stderr while the block runs, if a terminal shows it; the block calls what it is given once a step."""
    if not sys.stderr or not sys.stderr.isatty():
        yield lambda: None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=total)
        yield lambda: bar.advance(task)
