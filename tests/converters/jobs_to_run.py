"""Functions for processes of their own: each does one thing that a kernel might do."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from gtcad.converters.outcome import Job, Outcome, sha256
from gtcad.errors import FileError, KernelError


def add(a: Any, b: Any) -> Any:
    return a + b


def sleep(seconds: float, mark: str = "") -> str:
    """Sleep, and say so in a file before: what runs, runs under the id that it holds."""
    if mark:
        Path(mark).write_text(str(os.getpid()))
    time.sleep(seconds)
    return "awake"


def spin() -> None:
    while True:
        pass


def crash() -> None:
    ctypes.string_at(0)


def abort() -> None:
    os.abort()


def leave(code: int) -> None:
    os._exit(code)


def kill_oneself() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def take(size: int) -> int:
    return len(bytearray(size))


def refuse() -> None:
    raise FileError("a.step", "is not a readable STEP file")


def fail() -> None:
    raise KernelError("it broke")


def divide_by_zero() -> float:
    return 1 / 0


def chatter() -> str:
    print("on the standard output")
    os.write(1, b"from the kernel")
    os.write(2, b"on the standard error")
    return sys.stdin.read()


def array(size: int) -> Any:
    return {"values": np.arange(size, dtype=float), "scalar": np.float64(2.5)}


class Evil:
    """Unpickled, it would make a folder."""

    def __init__(self, folder: str) -> None:
        self.folder = folder

    def __reduce__(self) -> tuple[Any, ...]:
        return os.mkdir, (self.folder,)


def evil(folder: str) -> Any:
    return Evil(folder)


def stranger(_: str) -> Any:
    return Path("a")


def quick(job: Job) -> Outcome:
    """What a check finds in the end of a STEP file, which needs no kernel."""
    if b"END-ISO" not in Path(job.file).read_bytes():
        raise FileError(job.file, "its end is missing")
    return Outcome(
        job.file, job.form, None, None, None, None, None, {"file_sha256": sha256(job.file)}, 0, message="quick"
    )


def environment(name: str) -> str | None:
    return os.environ.get(name)
