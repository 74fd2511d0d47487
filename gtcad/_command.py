"""What the commands of the command line share: exit codes, errors as messages, and arguments that several take.

Results go to stdout, messages and progress to stderr. Exit codes: 0 all proved, or estimated and marked so; 1 a shape
is missing, invalid or beyond the tolerance; 2 usage, judged before any file is opened; 3 a file is missing, unreadable
or bad; 4 the kernel failed; 5 undecided; 70 an error of this program; 130 interrupted; 141 nobody reads the output.
"""

from __future__ import annotations

import enum
import functools
import json
import sys
from collections.abc import Callable
from typing import Annotated, Any, NoReturn, TypeVar

import typer

from gtcad import _options as options
from gtcad import _tables as tables
from gtcad import errors

Value = TypeVar("Value")


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


_debug = False

_CODES: tuple[tuple[type[BaseException] | tuple[type[BaseException], ...], Code], ...] = (
    (KeyboardInterrupt, Code.INTERRUPTED),
    (BrokenPipeError, Code.PIPE),
    ((errors.ToleranceNotMet, errors.ToleranceBelowPrecision), Code.FAILED),
    ((errors.KernelError, errors.KernelMissing, errors.ExtraMissing), Code.KERNEL),
    ((errors.ModelError, errors.InputError, OSError), Code.FILE),
)

ModelArgument = Annotated[str, typer.Argument(metavar="MODEL", help="A model file, .json or .toml.")]
ToleranceOption = Annotated[
    str, typer.Option("--tolerance", metavar="LENGTH", help="In mm, or with a unit: 1e-4, 1e-5in, 0.1um.")
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON document instead of a table.")]


def set_debug(wanted: bool) -> None:
    """Whether errors of the program itself show where they came up."""
    global _debug  # noqa: PLW0603 - the one setting of the process; contexts do not reach the decorator
    _debug = wanted


def guarded(command: Callable[..., None]) -> Callable[..., None]:
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
    if _interrupted(error):
        code = Code.INTERRUPTED
    if _debug:
        import traceback

        traceback.print_exception(error)
    if code is Code.INTERNAL:
        text = f"internal error: {type(error).__name__}: {' '.join(str(error).split())}"
        tables.message(text if _debug else f"{text}; run again as 'gtcad --debug ...' to see where")
    elif code not in (Code.INTERRUPTED, Code.PIPE):
        tables.message("\n".join(f"Error: {line}" for line in str(error).split("\n")))
    raise typer.Exit(int(code))


def _interrupted(error: BaseException | None) -> bool:
    """Whether Ctrl-C is behind an error: kernels and other extensions that it stops while they load say otherwise."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None


def option(name: str, convert: Callable[[str], Value], text: str) -> Value:
    """The value of an option, converted; what is refused is wrong usage."""
    try:
        return convert(text)
    except options.Refused as error:
        raise typer.BadParameter(str(error), param_hint=f"'{name}'") from None


def print_json(**content: Any) -> None:
    """Print one JSON document."""
    print(json.dumps(tables.plain(content), indent=2))
