"""What is refused of a file before the kernel reads it, and after it has read only a part of it."""

from __future__ import annotations

import os
import re
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from gtcad.errors import FileError

_FACES = ("StepShape_AdvancedFace", "StepShape_FaceSurface")
_BESIDES = ("StepDimTol_", "StepAP", "StepKinematics_")  # packages of entities that are not looked at
_HUGE = re.compile(rb"[0-9.][EeDd]\+?0*[1-9][0-9]{2,}")
_TEXT = re.compile(rb"'[^']*'")


class Unreadable(Exception):
    """The kernel cannot read a file, or not all of it."""


def entities(model: Any, done: int) -> Iterator[Any]:
    """The entities that were added to a model after the first `done` ones."""
    for i in range(done + 1, model.NbEntities() + 1):
        yield model.Entity(i)


def file_bytes(path: str | os.PathLike[str]) -> bytes:
    """All of a file.

    Raises
    ------
    FileError
        When there is no such file, or it cannot be read, is empty, or is a pipe or a device.
    """
    try:
        mode = os.stat(path).st_mode
        if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):  # a pipe would be waited for
            raise FileError(str(path), "is no ordinary file")
        data = Path(path).read_bytes()
    except FileError:
        raise
    except FileNotFoundError as error:
        raise FileError(str(path), "no such file") from error
    except OSError as error:
        raise FileError(str(path), f"cannot be read: {error.strerror}") from error
    if not data:
        raise FileError(str(path), "is empty")
    return data


def refuse_huge_numbers(path: str | os.PathLike[str], data: bytes) -> None:
    """Refuse a file with numbers of 1e100 or more, which the kernel hangs on or reads as infinite.

    Parameters
    ----------
    path
        For the message.
    data
        Where the numbers are; what stands between apostrophes is text.

    Raises
    ------
    FileError
        When there is one.
    """
    if _HUGE.search(data) and _HUGE.search(_TEXT.sub(b"", data)):
        raise FileError(str(path), "holds a number of 1e+100 or more")


def refuse_failures(model: Any, checks: Any) -> None:
    """Refuse entities that the kernel could not read or convert: it would leave them out, or die of them."""
    checks.Start()
    while checks.More():
        number = checks.Number()
        kind = type(model.Entity(number)).__name__ if number else "file"
        for complaint in _complaints(checks.Value()):
            if not kind.startswith(_BESIDES):
                raise Unreadable(f"entity {number} ({kind.partition('_')[2]}): {complaint.strip()}")
        checks.Next()


def _complaints(check: Any) -> Iterator[str]:
    """Failures, and the warnings by which the kernel says that it left something out."""
    for i in range(1, check.NbFails() + 1):
        yield str(check.CFail(i))
    for i in range(1, check.NbWarnings() + 1):
        if "not mapped" in str(check.CWarning(i)):
            yield str(check.CWarning(i))


def refuse_lost_faces(work_session: Any) -> None:
    """Refuse a STEP file with faces that the kernel did not turn into shapes."""
    model, process = work_session.Model(), work_session.TransferReader().TransientProcess()
    total = sum(type(entity).__name__ in _FACES for entity in entities(model, 0))
    found = sum(type(process.Mapped(i)).__name__ in _FACES for i in range(1, process.NbMapped() + 1))
    if found < total:
        raise Unreadable(f"{total - found} of its {total} faces belong to no product")
