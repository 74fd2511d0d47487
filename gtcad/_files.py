"""Writing files so that nothing half-written is ever left under the wanted name."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

from gtcad.errors import FileError


@contextlib.contextmanager
def written_whole(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A temporary path beside `path`, with its suffix, renamed to `path` when the block ends without an error.

    Raises
    ------
    FileError
        When the folder does not exist or cannot be written to.
    """
    target = Path(path)
    try:
        if target.is_dir():
            raise FileError(str(path), "is a folder")
        handle, name = tempfile.mkstemp(prefix=f".{target.stem}-", suffix=target.suffix, dir=target.parent)
    except FileError:
        raise
    except OSError as error:
        raise FileError(str(path), f"cannot be written: {error.strerror}") from error
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        umask = os.umask(0)
        os.umask(umask)
        temporary.chmod(0o666 & ~umask)  # mkstemp makes private files; the result is an ordinary one
        os.replace(temporary, target)
    finally:
        temporary.unlink(missing_ok=True)
