"""Checks of many files: side by side, on a cluster, and taken up again where they ended.

Each file is read in a process of its own, which the threads of joblib, or the workers of a cluster, wait for: a kernel
that crashes on one file never takes another with it.
"""

from __future__ import annotations

import json
import os
import time
import warnings
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO, Any

import gtcad
from gtcad.converters.isolated import MEMORY, TIMEOUT, Runner
from gtcad.converters.outcome import Code, Job, Outcome, check_files, failed, plain, run_job, sha256
from gtcad.errors import ExtraMissing, FileError, GtcadError, KernelError

_CONNECTING = 30.0  # seconds in which a scheduler must answer


@dataclass(frozen=True, eq=False)
class Entry:
    """One file of a batch that is done.

    Attributes
    ----------
    job
        What was asked.
    data
        What was found, as JSON holds it.
    outcome
        The same as objects; None when it comes from a log.
    """

    job: Job
    data: dict[str, Any]
    outcome: Outcome | None

    @property
    def code(self) -> int:
        """The exit code of the file."""
        return int(self.data["code"])


def check_many(
    jobs: Iterable[Job],
    *,
    workers: int = 1,
    timeout: float | None = TIMEOUT,
    memory: int | None = MEMORY,
    scheduler: str | None = None,
    log: str | os.PathLike[str] | None = None,
) -> Iterator[Entry]:
    """Check files, each as soon as there is room for it, and give each result as it comes.

    Parameters
    ----------
    jobs
        Equal ones are done once.
    workers
        How many files are checked at a time, without a scheduler.
    timeout, memory
        Limits of each file, in seconds and bytes; None for none.
    scheduler
        The address of a dask scheduler, whose workers see the files under the same names.
    log
        A file of JSON lines that each result is added to. What it holds already is not done again: of files with equal
        content and settings. A file that the kernel failed on is done again with other limits.

    Yields
    ------
    Entry
        One for each file, those from the log first, the others in the order in which they end. An error of one file is
        its result and stops no other.

    Raises
    ------
    FileError
        When the log cannot be read or written, or no scheduler answers.
    ExtraMissing
        When `distributed` is not installed and a scheduler is given.

    Notes
    -----
    On a cluster a file may be checked twice, when its worker dies; its result is given once.
    """
    limits = [timeout, memory]
    with closing(Log(log) if log is not None else Log.nowhere()) as record:
        left: list[Job] = []
        keys: dict[Job, str] = {}
        for job in dict.fromkeys(jobs):
            keys[job] = _key(job)
            known = record.found(keys[job], limits)
            if known is None:
                left.append(job)
            else:
                yield Entry(job, known, None)
        runner = Runner(timeout, memory)
        ended = _in_threads(left, runner, workers) if scheduler is None else _on_cluster(left, scheduler, runner)
        with closing(ended):
            for job, outcome in ended:
                data = outcome.as_data()
                record.add(keys[job], limits, data)
                yield Entry(job, data, outcome)


def _key(job: Job) -> str:
    """What makes two checks the same: names, contents, settings and version; empty for files that cannot be read."""
    try:
        hashes = [sha256(job.file), None if job.against is None else sha256(job.against)]
    except FileError:
        return ""
    return json.dumps([job.file, job.against, hashes, job.settings(), gtcad.__version__], sort_keys=True)


# --- side by side -----------------------------------------------------------------------------------------------------


Work = Callable[[Job], Outcome]


def attempt(job: Job, runner: Runner, work: Work) -> tuple[Job, Outcome]:
    """The job and what became of it, errors included."""
    started = time.monotonic()
    try:
        check_files(job)
        return job, runner.run(work, job)
    except (GtcadError, OSError, RuntimeError) as error:
        return job, failed(job, error, time.monotonic() - started)


def _in_threads(jobs: Sequence[Job], runner: Runner, workers: int) -> Generator[tuple[Job, Outcome], None, None]:
    from joblib import Parallel, delayed  # type: ignore[import-untyped]

    parallel = Parallel(n_jobs=workers, backend="threading", return_as="generator_unordered", pre_dispatch="n_jobs")
    found = parallel(delayed(attempt)(job, runner, run_job) for job in jobs)
    try:
        for ended in found:  # noqa: UP028 - `yield from` would close the threads before their processes
            yield ended
    finally:
        runner.stop()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # that tasks were cancelled
            found.close()


def attempt_on_worker(job: Job, timeout: float | None, memory: int | None, work: Work) -> Outcome:
    """What became of a job on a worker of a cluster."""
    return attempt(job, Runner(timeout, memory), work)[1]


def _on_cluster(jobs: Sequence[Job], scheduler: str, runner: Runner) -> Generator[tuple[Job, Outcome], None, None]:
    try:
        from distributed import Client, as_completed
    except ImportError as error:
        raise ExtraMissing(f"a scheduler needs dask and distributed ({error}): pip install 'gtcad[cluster]'") from error
    connect: Any = Client  # these two have no types
    in_order_of_ends: Any = as_completed
    try:
        client = connect(scheduler, timeout=_CONNECTING, set_as_default=False)
    except (OSError, ValueError) as error:
        raise FileError(scheduler, f"no scheduler answers: {error}") from error
    with client:
        futures = {
            client.submit(
                attempt_on_worker, _from_anywhere(job), runner.timeout, runner.memory, run_job, pure=False
            ): job
            for job in jobs
        }
        try:
            for future in in_order_of_ends(list(futures), loop=client.loop):
                yield futures[future], _gathered(future, futures[future])
                future.release()
        finally:
            with suppress(Exception):  # the scheduler may be gone
                client.cancel(list(futures))


def _gathered(future: Any, job: Job) -> Outcome:
    try:
        outcome: Outcome = future.result()
    except Exception as error:  # lost workers come in many classes
        return failed(job, KernelError(f"the cluster lost the job: {type(error).__name__}: {error}"))
    message = outcome.message.replace(os.path.abspath(job.file), job.file)
    return replace(outcome, file=job.file, against=job.against, message=message)


def _from_anywhere(job: Job) -> Job:
    """The job with names that do not depend on the folder in which a worker was started."""
    against = job.against if job.against is None else os.path.abspath(job.against)
    return replace(job, file=os.path.abspath(job.file), against=against)


# --- the log ----------------------------------------------------------------------------------------------------------


class Log:
    """Results as JSON lines, which survive the end of the program: only the last line can be torn.

    Parameters
    ----------
    path
        Made if it does not exist; a torn last line is cut off.

    Raises
    ------
    FileError
        When it cannot be read and written, or holds other lines.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self._path = str(path)
        try:
            self._done, whole = self._read()
            self._file: IO[bytes] | None = open(path, "ab")  # noqa: SIM115 - closed by close()
            self._file.truncate(whole)
        except OSError as error:
            if isinstance(error, FileError):
                raise
            raise FileError(self._path, f"cannot be read and written: {error.strerror}") from error

    @classmethod
    def nowhere(cls) -> Log:
        """A log that keeps nothing."""
        log = cls.__new__(cls)
        log._path, log._done, log._file = "", {}, None
        return log

    def _read(self) -> tuple[dict[str, dict[str, Any]], int]:
        """The lines by their keys, and the length of the part with whole lines."""
        if not Path(self._path).exists():
            return {}, 0
        data = Path(self._path).read_bytes()
        whole = data.rfind(b"\n") + 1
        done: dict[str, dict[str, Any]] = {}
        for number, line in enumerate(data[:whole].splitlines(), start=1):
            try:
                entry = json.loads(line)
                done[entry["key"]] = {"limits": entry["limits"], "result": entry["result"] | {}}
            except (ValueError, KeyError, TypeError, RecursionError):
                raise FileError(self._path, f"line {number} is not one of a log of checks") from None
        return done, whole

    def found(self, key: str, limits: Sequence[float | None]) -> dict[str, Any] | None:
        """The result of a key, unless the kernel failed under other limits; None without one."""
        entry = self._done.get(key) if key else None
        if entry is None or (entry["result"].get("code") == Code.KERNEL and entry["limits"] != list(limits)):
            return None
        result: dict[str, Any] = entry["result"]
        return result

    def add(self, key: str, limits: Sequence[float | None], result: dict[str, Any]) -> None:
        """Add a result, and see to it that it is on the disk."""
        if self._file is None or not key:
            return
        line = json.dumps({"key": key, "limits": list(limits), "result": plain(result)})
        try:
            self._file.write(line.encode() + b"\n")
            self._file.flush()
            os.fsync(self._file.fileno())
        except OSError as error:
            raise FileError(self._path, f"cannot be written: {error.strerror}") from error

    def close(self) -> None:
        """Close the file."""
        if self._file is not None:
            self._file.close()
