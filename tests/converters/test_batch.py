"""Many files: each result once, in any order, through crashes, interruptions and torn logs; on a cluster too."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import sys
import threading
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import gtcad
from gtcad import Curve
from gtcad.converters import batch, isolated, outcome
from gtcad.converters.batch import Log, check_many
from gtcad.converters.bspline import BSplineCurve
from gtcad.converters.manifest import read_manifest
from gtcad.converters.outcome import Code, Job, run_job, worst_code
from gtcad.converters.part import Part
from gtcad.converters.step import write_step
from gtcad.errors import ExtraMissing, FileError, KernelError, ModelError, ToleranceNotMet
from tests.converters import jobs_to_run
from tests.converters.test_isolated import waited_for

ARCH = Curve([[0, 0, 0], [1, 2, 0], [2, 0, 0]])
READY = {"profile": "cam"}


@pytest.fixture
def files(tmp_path: Path) -> list[str]:
    """Three files, the last one damaged."""
    for k in range(2):
        curve = BSplineCurve([[0, 0, k], [1, 2, k], [2, 0, k]], [0, 1], [3, 3], 2)
        write_step(tmp_path / f"{k}.step", [Part("rail", curve)])
    (tmp_path / "2.step").write_bytes((tmp_path / "0.step").read_bytes()[:2000])
    return [str(tmp_path / f"{k}.step") for k in range(3)]


@pytest.fixture
def in_process(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Jobs run here, where starting them costs nothing; gives the names of the files in the order of their checks."""
    done: list[str] = []

    def run(self: isolated.Runner, job: Any, *arguments: Any) -> Any:
        done.append(arguments[0].file)
        return job(*arguments)

    monkeypatch.setattr(isolated.Runner, "run", run)
    return done


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Jobs run in processes of their own, but without the kernel, which takes seconds to load."""
    monkeypatch.setattr(batch, "run_job", jobs_to_run.quick)


def jobs_of(files: list[str], **settings: Any) -> list[Job]:
    return [Job(file, "STEP", **READY | settings) for file in files]


def codes(entries: Any) -> dict[str, int]:
    return {Path(entry.job.file).name: entry.code for entry in entries}


# --- side by side --------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize("workers", [1, 3])
def test_every_file_gets_its_result(files: list[str], workers: int) -> None:
    entries = list(check_many(jobs_of([*files, "none.step", files[0]]), workers=workers))
    assert codes(entries) == {"0.step": 0, "1.step": 0, "2.step": 3, "none.step": 3}
    assert len(entries) == 4  # the one that was named twice is done once
    by_name = {Path(entry.job.file).name: entry for entry in entries}
    assert by_name["none.step"].data["message"] == "none.step: no such file"
    assert "its end is missing" in by_name["2.step"].data["message"]
    assert by_name["0.step"].data["environment"]["file_sha256"] == outcome.sha256(files[0])
    for entry in entries:
        assert json.loads(json.dumps(entry.data, allow_nan=False)) == entry.data


@pytest.mark.usefixtures("quick")
def test_a_crash_takes_no_other_file_with_it(monkeypatch: pytest.MonkeyPatch, files: list[str]) -> None:
    real = isolated.Runner.run

    def run(self: isolated.Runner, job: Any, *arguments: Any) -> Any:
        return real(self, os.abort) if arguments[0].file == files[0] else real(self, job, *arguments)

    monkeypatch.setattr(isolated.Runner, "run", run)
    entries = list(check_many(jobs_of(files), workers=2))
    assert codes(entries) == {"0.step": 4, "1.step": 0, "2.step": 3}
    assert "SIGABRT" in next(entry.data["message"] for entry in entries if entry.code == 4)


@pytest.mark.usefixtures("quick")
def test_a_time_limit_is_that_of_each_file(files: list[str]) -> None:
    (entry,) = check_many(jobs_of(files[:1]), timeout=0.01)
    assert (entry.code, "within 0.01 s" in entry.data["message"]) == (4, True)


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (KernelError("x"), 4),
        (ExtraMissing("x"), 4),
        (FileError("a", "x"), 3),
        (ModelError("a", ["x"]), 3),
        (OSError("x"), 3),
        (ToleranceNotMet(1.0, 2.0, 3, ""), 1),
        (RuntimeError("x"), 70),
    ],
)
def test_errors_are_results_with_the_codes_of_the_command(
    monkeypatch: pytest.MonkeyPatch, files: list[str], error: Exception, code: int
) -> None:
    def run(self: isolated.Runner, job: Any, *arguments: Any) -> Any:
        raise error

    monkeypatch.setattr(isolated.Runner, "run", run)
    (entry,) = check_many(jobs_of(files[:1]))
    assert entry.code == code
    assert entry.data["message"]


def test_the_worst_code() -> None:
    ranked = [0, 5, 1, 3, 4, 70]
    for k, code in enumerate(ranked):
        assert worst_code(ranked[: k + 1]) == worst_code(ranked[k::-1]) == code
    assert worst_code([]) == 0
    assert [int(code) for code in Code] == ranked


@pytest.mark.usefixtures("quick")
def test_giving_up_ends_the_processes(tmp_path: Path, files: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    real, mark = isolated.Runner.run, tmp_path / "mark"
    started: list[Any] = []

    def run(self: isolated.Runner, job: Any, *arguments: Any) -> Any:
        if arguments[0].file == files[0]:
            return real(self, job, *arguments)
        started.append(self)
        return real(self, time.sleep, 600)

    monkeypatch.setattr(isolated.Runner, "run", run)
    entries = check_many(jobs_of(files[:2]), workers=2)
    assert next(entries).code == 0
    assert waited_for(lambda: bool(started) and bool(started[0]._running))
    (child,) = started[0]._running
    entries.close()  # type: ignore[attr-defined]
    assert child.wait(10) != 0
    assert not mark.exists()


# --- the log -------------------------------------------------------------------------------------------------------


def test_what_a_log_holds_is_not_done_again(tmp_path: Path, files: list[str], in_process: list[str]) -> None:
    log = tmp_path / "log.jsonl"
    first = list(check_many(jobs_of(files), log=log))
    assert sorted(in_process) == files
    again = list(check_many(jobs_of(files), log=log))
    assert sorted(in_process) == files  # nothing was added
    assert [entry.outcome for entry in again] == [None] * 3
    assert {entry.job.file: entry.data for entry in again} == {entry.job.file: entry.data for entry in first}
    assert len(log.read_text().splitlines()) == 3


def test_other_content_and_other_settings_are_done_again(
    tmp_path: Path, files: list[str], in_process: list[str]
) -> None:
    log = tmp_path / "log.jsonl"
    list(check_many(jobs_of(files[:2]), log=log))
    Path(files[0]).write_bytes(Path(files[1]).read_bytes())
    list(check_many(jobs_of(files[:2]), log=log))
    assert in_process[2:] == files[:1]
    list(check_many(jobs_of(files[:2], limits=(("degree", 3.0),)), log=log))
    assert in_process[3:] == files[:2]
    list(check_many(jobs_of(files[:2], profile="sasig"), log=log))
    assert in_process[5:] == files[:2]


def test_a_model_that_changed_makes_the_check_anew(tmp_path: Path, in_process: list[str]) -> None:
    model, file, log = tmp_path / "m.json", tmp_path / "a.step", tmp_path / "log.jsonl"
    gtcad.dump_model({"arch": ARCH}, model)
    write_step(file, [Part("arch", BSplineCurve([[0, 0, 0], [1, 2, 0], [2, 0, 0]], [0, 1], [3, 3], 2))])
    job = Job(str(file), "STEP", str(model), "MODEL", 10.0)
    for _ in range(2):
        list(check_many([job], log=log))
    assert len(in_process) == 1
    gtcad.dump_model({"arch": Curve(ARCH.control_points, (0.5, 0.5))}, model)
    list(check_many([job], log=log))
    assert len(in_process) == 2


@pytest.mark.usefixtures("quick")
def test_a_kernel_failure_is_tried_again_with_other_limits_only(tmp_path: Path, files: list[str]) -> None:
    log = tmp_path / "log.jsonl"
    for timeout, outcomes in ((0.01, [False]), (0.01, [True]), (60.0, [False])):
        entries = list(check_many(jobs_of(files[:1]), timeout=timeout, log=log))
        assert [entry.outcome is None for entry in entries] == outcomes
    assert entries[0].code == 0


def test_a_torn_last_line_is_survived(tmp_path: Path, files: list[str], in_process: list[str]) -> None:
    log = tmp_path / "log.jsonl"
    list(check_many(jobs_of(files), log=log))
    lines = log.read_bytes().splitlines(keepends=True)
    for length in (1, len(lines[2]) // 2, len(lines[2]) - 1):
        log.write_bytes(b"".join(lines[:2]) + lines[2][:length])
        in_process.clear()
        assert len(list(check_many(jobs_of(files), log=log))) == 3
        assert len(in_process) == 1
        assert [json.loads(line)["key"] for line in log.read_bytes().splitlines()] == [
            json.loads(line)["key"] for line in lines
        ]


def test_an_interrupted_batch_goes_on_where_it_ended(tmp_path: Path, files: list[str], in_process: list[str]) -> None:
    log = tmp_path / "log.jsonl"
    entries = check_many(jobs_of(files), log=log)
    next(entries)
    entries.close()  # type: ignore[attr-defined]
    kept = len(log.read_text().splitlines())
    assert kept >= 1
    in_process.clear()
    found = list(check_many(jobs_of(files), log=log))
    assert len(found) == 3
    assert len(in_process) == 3 - kept


@pytest.mark.parametrize(
    "content", [b"not json\n", b"{}\n", b'{"key": 1, "limits": [], "result": 5}\n', b"\xff\n", b"[" * 100_000 + b"\n"]
)
def test_other_files_are_not_taken_for_logs(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "notes.txt"
    path.write_bytes(content)
    with pytest.raises(FileError, match="line 1 is not one of a log of checks"):
        Log(path)
    assert path.read_bytes() == content


def test_a_log_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="cannot be read and written"):
        Log(tmp_path)
    with pytest.raises(FileError, match="cannot be read and written"):
        Log(tmp_path / "none" / "log.jsonl")


# --- lists ---------------------------------------------------------------------------------------------------------


def test_a_list_names_files_beside_itself(tmp_path: Path) -> None:
    path = tmp_path / "list.toml"
    path.write_text('[[check]]\nfile = "a.step"\nagainst = "a.toml"\ntolerance = 1e-4\n[[check]]\nfile = "/b.igs"\n')
    first, second = read_manifest(path)
    assert (first.file, first.against, first.tolerance) == (
        str(tmp_path / "a.step"),
        str(tmp_path / "a.toml"),
        "0.0001",
    )
    assert (second.file, second.against, second.tolerance, second.place) == ("/b.igs", "", "", "check no. 2")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{}", "check: must be a list of checks, got null"),
        ('{"check": []}', "must be a list of checks, got a list of 0"),
        ('{"check": [7]}', "check no. 1: must be an object with the fields file, against"),
        ('{"check": [{}]}', "check no. 1, file: is missing"),
        ('{"check": [{"file": 7}]}', "check no. 1, file: must be a text, got 7"),
        ('{"check": [{"file": ""}]}', "check no. 1, file: must be a text, got ''"),
        ('{"check": [{"file": "a", "tolerance": true}]}', "tolerance: must be a text, got true"),
        ('{"check": [{"file": "a", "model": "b"}]}', "'model': is not a field of a check"),
        ('{"check": [{"file": "a"}], "x": 1}', "x: is not a field of a list of checks"),
        ('{"check": [{"file": "a", "file": "b"}]}', "more than once"),
    ],
)
def test_a_wrong_list_is_refused(tmp_path: Path, content: str, message: str) -> None:
    (tmp_path / "list.json").write_text(content)
    with pytest.raises(ModelError, match=message):
        read_manifest(tmp_path / "list.json")
    with pytest.raises(FileError, match=r"none\.json: no such file"):
        read_manifest(tmp_path / "none.json")


# --- on a cluster --------------------------------------------------------------------------------------------------


@contextlib.contextmanager
def cluster(workers: int) -> Iterator[Any]:
    distributed = pytest.importorskip("distributed")
    from dask import config

    with (
        config.set({"distributed.worker.daemon": True}),
        distributed.LocalCluster(
            n_workers=workers, threads_per_worker=1, processes=True, host="127.0.0.1", dashboard_address=None
        ) as found,
    ):
        yield found


@pytest.mark.usefixtures("quick")
def test_a_cluster_survives_the_death_of_a_worker(
    tmp_path: Path, files: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    many = [f"copy-{k}.step" for k in range(12)]
    for k, name in enumerate(many):
        (tmp_path / name).write_bytes(Path(files[k % 3]).read_bytes())
    log = tmp_path / "log.jsonl"
    with cluster(2) as found:
        monkeypatch.chdir(tmp_path)  # the workers were started in another folder
        victim = next(iter(found.workers.values())).pid
        entries = []
        for entry in check_many(jobs_of(many), scheduler=found.scheduler_address, log=log):
            entries.append(entry)
            if len(entries) == 3:
                os.kill(victim, signal.SIGKILL)
    assert Counter(entry.job.file for entry in entries) == Counter(many)
    assert codes(entries) == {f"copy-{k}.step": (0, 0, 3)[k % 3] for k in range(12)}
    messages = {entry.data["file"]: entry.data["message"] for entry in entries}
    assert messages == {
        f"copy-{k}.step": ("quick", "quick", f"copy-{k}.step: its end is missing")[k % 3] for k in range(12)
    }
    assert len(log.read_text().splitlines()) == 12


def test_a_scheduler_that_is_not_there_is_told(files: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr(batch, "_CONNECTING", 0.5)
    with pytest.raises(FileError, match=r"tcp://127\.0\.0\.1:9: no scheduler answers"):
        list(check_many(jobs_of(files), scheduler="tcp://127.0.0.1:9"))
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ExtraMissing, match=r"gtcad\[cluster\]"):
        list(check_many(jobs_of(files), scheduler="tcp://127.0.0.1:9"))


def test_outcomes_in_this_process_and_in_another_are_the_same(files: list[str]) -> None:
    here, there = run_job(jobs_of(files)[0]), isolated.Runner().run(run_job, jobs_of(files)[0])
    changing = ("seconds", "environment")
    assert [{k: v for k, v in one.as_data().items() if k not in changing} for one in (here, there)] == [
        {k: v for k, v in here.as_data().items() if k not in changing}
    ] * 2
    assert here.environment.keys() == there.environment.keys()
    assert threading.active_count() < 50
