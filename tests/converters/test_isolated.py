"""Jobs in processes of their own: results, limits, crashes, and nothing left behind."""

from __future__ import annotations

import io
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gtcad.converters import isolated
from gtcad.converters.isolated import ChildError, Runner
from gtcad.errors import FileError, InputError, KernelError
from tests.converters import jobs_to_run as jobs

POSIX = pytest.mark.skipif(os.name != "posix", reason="needs signals and limits of memory")


def alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return "Z" not in Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]


def waited_for(condition: Callable[[], bool], seconds: float = 20.0) -> bool:
    end = time.monotonic() + seconds
    while time.monotonic() < end and not condition():
        time.sleep(0.02)
    return condition()


def test_results_come_back() -> None:
    assert Runner().run(jobs.add, 2, 3) == 5
    assert Runner(timeout=None, memory=None).run(jobs.add, "a", "b") == "ab"
    found = Runner().run(jobs.array, 1000)
    assert np.array_equal(found["values"], np.arange(1000.0))
    assert found["scalar"] == 2.5


def test_errors_of_gtcad_come_back_as_they_are() -> None:
    with pytest.raises(FileError, match=r"a\.step: is not a readable STEP file") as caught:
        Runner().run(jobs.refuse)
    assert caught.value.path == "a.step"
    with pytest.raises(KernelError, match="it broke"):
        Runner().run(jobs.fail)


def test_other_errors_are_faults_of_the_program_and_bring_their_traceback() -> None:
    with pytest.raises(ChildError) as caught:
        Runner().run(jobs.divide_by_zero)
    assert str(caught.value) == "ZeroDivisionError: division by zero"
    assert "in divide_by_zero" in caught.value.__notes__[0]


@POSIX
@pytest.mark.parametrize(
    ("job", "arguments", "message"),
    [
        (jobs.crash, (), r"crashed \(SIGSEGV\); it may have needed more memory than 8192 MB"),
        (jobs.abort, (), r"crashed \(SIGABRT\)"),
        (jobs.kill_oneself, (), r"crashed \(SIGKILL\)"),
        (jobs.leave, (3,), "ended without an answer .exit code 3."),
        (jobs.leave, (0,), "ended without an answer .exit code 0."),
    ],
)
def test_crashes_are_errors_of_the_kernel(job: Any, arguments: tuple[Any, ...], message: str) -> None:
    with pytest.raises(KernelError, match=message):
        Runner().run(job, *arguments)


@pytest.mark.parametrize("job", [(jobs.sleep, 600), (jobs.spin,)])
def test_a_time_limit_ends_the_job(job: Any) -> None:
    with pytest.raises(KernelError, match=r"did not answer within 0\.7 s and was stopped"):
        Runner(timeout=0.7).run(*job)


@POSIX
def test_a_memory_limit_ends_the_job() -> None:
    limit = 1 << 30
    assert Runner(memory=limit).run(jobs.take, 100 << 20) == 100 << 20
    with pytest.raises(KernelError, match="needed more memory than 1024 MB"):
        Runner(memory=limit).run(jobs.take, limit)


def test_limits_that_are_none_are_refused() -> None:
    with pytest.raises(InputError, match="above 0 seconds"):
        Runner(timeout=0)
    with pytest.raises(InputError, match="at least 1024 MB, got 100 MB"):
        Runner(memory=100 << 20)


def test_nothing_that_could_run_a_command_is_unpickled(tmp_path: Path) -> None:
    mark = tmp_path / "made"
    for job in (jobs.evil, jobs.stranger):
        with pytest.raises(KernelError, match="without an answer"):
            Runner().run(job, str(mark))
    assert not mark.exists()


@pytest.mark.parametrize("call", [os.system, eval, isolated.answer, subprocess.Popen])
def test_only_plain_data_are_let_in(call: Any) -> None:
    with pytest.raises(pickle.UnpicklingError, match="not plain data"):
        isolated._Plain(io.BytesIO(pickle.dumps(call))).load()


def test_what_the_job_prints_goes_nowhere(capfd: pytest.CaptureFixture[str]) -> None:
    assert Runner().run(jobs.chatter) == ""
    assert capfd.readouterr() == ("", "")


def test_one_thread_of_linear_algebra_unless_asked_otherwise(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    assert Runner().run(jobs.environment, "OPENBLAS_NUM_THREADS") == "1"
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "3")
    assert Runner().run(jobs.environment, "OPENBLAS_NUM_THREADS") == "3"


def test_jobs_run_side_by_side_and_are_stopped_together(tmp_path: Path) -> None:
    runner, errors = Runner(), []

    def wait(mark: Path) -> None:
        try:
            runner.run(jobs.sleep, 600, str(mark))
        except KernelError as error:
            errors.append(error)

    marks = [tmp_path / "a", tmp_path / "b"]
    threads = [threading.Thread(target=wait, args=(mark,)) for mark in marks]
    for thread in threads:
        thread.start()
    assert waited_for(lambda: all(mark.exists() and mark.read_text() for mark in marks))
    children = [int(mark.read_text()) for mark in marks]
    assert all(map(alive, children))
    runner.stop()
    for thread in threads:
        thread.join(20)
    assert len(errors) == 2
    assert not any(map(alive, children))
    with pytest.raises(KernelError, match="stopped before it began"):
        runner.run(jobs.add, 1, 1)


def start(code: str) -> subprocess.Popen[bytes]:
    return subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


@POSIX
@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGKILL], ids=["interrupted", "killed"])
def test_the_job_ends_with_the_program(tmp_path: Path, end: signal.Signals) -> None:
    if end == signal.SIGKILL and sys.platform != "linux":
        pytest.skip("only Linux tells children of the end of their parent")
    mark = tmp_path / "child"
    code = (
        "from gtcad.converters.isolated import Runner; from tests.converters import jobs_to_run as jobs;"
        f"Runner().run(jobs.sleep, 600, {str(mark)!r})"
    )
    program = start(code)
    try:
        assert waited_for(lambda: mark.exists() and mark.read_text() != "")
        child = int(mark.read_text())
        assert alive(child)
        program.send_signal(end)
        assert program.wait(20) != 0
        assert waited_for(lambda: not alive(child))
    finally:
        program.kill()
        program.wait()


def test_a_script_without_a_guard_is_not_run_twice(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(
        "print('once')\nfrom gtcad.converters.isolated import Runner\nprint(Runner().run(divmod, 7, 2))\n"
    )
    result = subprocess.run([sys.executable, script], capture_output=True, text=True, check=True)
    assert result.stdout == "once\n(3, 1)\n"
