"""Running a job in a process of its own, with limits of time and memory: a kernel that crashes or hangs harms no one.

The child is a new Python, not a fork, which would hang after OCCT has run. It is started as a command, so that no main
module is run a second time, and so that workers may start it which may have no children of `multiprocessing`.
"""

from __future__ import annotations

import contextlib
import io
import math
import os
import pickle
import signal
import subprocess
import sys
import threading
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeVar

from gtcad.errors import GtcadError, InputError, KernelError

Result = TypeVar("Result")

TIMEOUT = 600.0
MEMORY = 8 << 30
LEAST_MEMORY = 1 << 30  # less is not enough to load the kernel
_COMMAND = "from gtcad.converters.isolated import answer; answer()"
_NUMPY = {"numpy", "numpy._core.multiarray", "numpy.core.multiarray", "numpy._core.numeric", "numpy.core.numeric"}
_NUMPY_NAMES = {"ndarray", "dtype", "scalar", "_reconstruct", "_frombuffer"}
_GRACE = 5.0  # seconds of the processor beyond the time limit, after which an abandoned child ends by itself


class ChildError(RuntimeError):
    """The job raised an error that is not gtcad's: a fault of the program, with the child's traceback as a note."""


@dataclass(eq=False)
class Runner:
    """Runs jobs in processes of their own.

    Parameters
    ----------
    timeout
        Seconds that a job may take, the start of its process included; None for no limit.
    memory
        Bytes of address space that a job may have, 1 GB at least; None for no limit, as where the system knows none.

    Raises
    ------
    InputError
        When a limit is too small.

    Examples
    --------
    >>> Runner(timeout=60).run(divmod, 7, 2)
    (3, 1)
    """

    timeout: float | None = TIMEOUT
    memory: int | None = MEMORY
    _running: set[subprocess.Popen[bytes]] = field(default_factory=set, init=False)
    _lock: threading.Lock = field(default_factory=threading.Lock, init=False)
    _stopped: bool = field(default=False, init=False)

    def __post_init__(self) -> None:
        if self.timeout is not None and not self.timeout > 0:
            raise InputError(f"timeout must be above 0 seconds, got {self.timeout}")
        if self.memory is not None and self.memory < LEAST_MEMORY:
            raise InputError(f"memory must be at least {_size(LEAST_MEMORY)}, got {_size(self.memory)}")

    def run(self, job: Callable[..., Result], *arguments: Any) -> Result:
        """The result of a job.

        Parameters
        ----------
        job, arguments
            What can be pickled: the job a function that can be imported.

        Raises
        ------
        GtcadError
            That the job raised.
        KernelError
            When its process crashed or passed a limit.
        ChildError
            When the job raised another error.

        Notes
        -----
        Starting the process takes as long as importing what the job needs. What it sends back is unpickled only if it
        consists of plain data, of arrays, and of classes of gtcad. When the call is interrupted, the process ends too.
        """
        limits = {"memory": self.memory, "seconds": self.timeout}
        with self._start() as child:
            try:
                sent, _ = child.communicate(pickle.dumps(limits) + pickle.dumps((job, arguments)), self.timeout)
            except subprocess.TimeoutExpired:
                raise KernelError(f"the kernel did not answer within {self.timeout:g} s and was stopped") from None
            finally:
                self._end(child)
        result: Result = self._result(child.returncode, sent)
        return result

    def stop(self) -> None:
        """End all jobs that are running and start no more."""
        with self._lock:
            self._stopped = True
            for child in self._running:
                child.kill()

    def _start(self) -> subprocess.Popen[bytes]:
        with self._lock:
            if self._stopped:
                raise KernelError("the job was stopped before it began")
            paths = os.pathsep.join(map(os.path.abspath, sys.path))  # '' is the current folder
            environment = {"OPENBLAS_NUM_THREADS": "1"} | os.environ | {"PYTHONPATH": paths}
            child = subprocess.Popen(
                [sys.executable, "-P", "-c", _COMMAND],
                env=environment,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                start_new_session=True,  # Ctrl-C comes to us, and we end the child
            )
            self._running.add(child)
            return child

    def _end(self, child: subprocess.Popen[bytes]) -> None:
        if child.poll() is None:
            child.kill()
        child.wait()
        with self._lock:
            self._running.discard(child)

    def _result(self, code: int, sent: bytes) -> Any:
        try:
            kind, value = _Plain(io.BytesIO(sent)).load()
        except Exception:
            raise KernelError(self._fate(code)) from None
        if kind == "memory":
            raise KernelError(f"the kernel needed more memory than {_size(self.memory)}")
        if kind == "error":
            raise value
        if kind == "fault":
            error = ChildError(value.splitlines()[-1])
            error.add_note(value)
            raise error
        return value

    def _fate(self, code: int) -> str:
        """How a process ended that gave no answer."""
        if code >= 0:
            return f"the process of the kernel ended without an answer (exit code {code})"
        name = signal.Signals(-code).name if -code in set(signal.Signals) else f"signal {-code}"
        if name == "SIGXCPU":
            return f"the kernel did not answer within {self.timeout:g} s and was stopped"
        limit = "" if self.memory is None else f"; it may have needed more memory than {_size(self.memory)}"
        return f"the kernel crashed ({name}){limit if name in ('SIGABRT', 'SIGKILL', 'SIGSEGV', 'SIGBUS') else ''}"


def _size(memory: int | None) -> str:
    return "there is" if memory is None else f"{memory / (1 << 20):.0f} MB"


class _Plain(pickle.Unpickler):
    """Loads plain data, arrays and classes of gtcad: nothing that a taken-over process could make us run."""

    def find_class(self, module: str, name: str) -> Any:
        if module in _NUMPY and name in _NUMPY_NAMES:
            return super().find_class(module, name)
        if module == "gtcad" or module.startswith("gtcad."):
            found = super().find_class(module, name)
            if isinstance(found, type) and "." not in name:
                return found
        raise pickle.UnpicklingError(f"{module}.{name} is not plain data")


# --- in the child -----------------------------------------------------------------------------------------------------


def answer() -> None:
    """Run the job that comes on the standard input, and send its result where the standard output was."""
    source, target = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    with open(os.devnull, "r+b") as nothing:  # what the kernel prints goes nowhere
        os.dup2(nothing.fileno(), 0)
        os.dup2(nothing.fileno(), 1)
    try:
        _limit(**pickle.load(source))
        job, arguments = pickle.load(source)
        message = pickle.dumps(("result", job(*arguments)))
    except MemoryError:
        message = pickle.dumps(("memory", None))
    except GtcadError as error:
        message = pickle.dumps(("error", error))
    except Exception:
        message = pickle.dumps(("fault", traceback.format_exc().rstrip()))
    target.write(message)
    target.flush()
    os._exit(0)  # the kernel may crash when it takes itself down


def _limit(memory: int | None, seconds: float | None) -> None:
    """Limits that the system keeps: of memory, and of the processor should nobody be left to end this process."""
    _die_with_parent()
    try:
        import resource
    except ImportError:  # Windows: the parent's time limit is all there is
        return

    def set_to(name: int, value: float | None) -> None:
        if value is not None:
            with contextlib.suppress(OSError, ValueError):  # beyond what the system allows us
                hard = resource.getrlimit(name)[1]
                resource.setrlimit(name, (int(value), hard))

    set_to(resource.RLIMIT_CORE, 0)
    set_to(resource.RLIMIT_AS, memory)
    threads = os.cpu_count() or 1
    set_to(resource.RLIMIT_CPU, None if seconds is None else math.ceil(threads * seconds + _GRACE))


def _die_with_parent() -> None:
    """Where the system can: end with the thread that started this process."""
    if sys.platform == "linux":
        import ctypes

        with contextlib.suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(1, signal.SIGKILL, 0, 0, 0)  # PR_SET_PDEATHSIG
