"""A process that waits for the compiler reports it, in one line and before it begins."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor, wait
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numba.core import config

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.errors import ParameterError
from slopewise.planner.kernels import kept
from slopewise.planner.kernels.ahead import written_down
from slopewise.planner.kernels.interpreted import interpret, is_interpreting
from slopewise.planner.kernels.kept import compiling, is_compiling
from slopewise.planner.path import batch
from slopewise.services.jobs import cold_start

ROOT = Path(__file__).parents[3]


@pytest.fixture
def compiled(monkeypatch: pytest.MonkeyPatch) -> list[set[str]]:
    """Compiled code without an owner."""
    asked: list[set[str]] = []

    def compile_ahead(some: Any, progress: Callable[[int], None]) -> list[str]:
        asked.append(set(some))
        return []

    monkeypatch.setattr(cold_start, "compile_ahead", compile_ahead)
    monkeypatch.setattr(kept, "is_compiled", lambda: bool(asked))
    cold_start._print_once.cache_clear()
    return asked


def test_the_first_run_compiles_and_says_so_in_one_line(
    compiled: list[set[str]], capfd: pytest.CaptureFixture[str]
) -> None:
    cold_start.compile_first("plans come after that")
    cold_start.compile_first("plans come after that")
    out, err = capfd.readouterr()
    line = "slopewise: compiling, once after each installation; plans come after that\n"
    assert (out, err) == ("", line)
    assert compiled == [set(written_down())]


def test_code_that_cannot_be_cached_is_not_compiled_twice(
    compiled: list[set[str]], monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(kept, "_folder", lambda: None)
    cold_start.compile_first("")
    assert not cold_start.sooner(is_interpreting, lambda: 200.0)
    assert not compiled
    err = capfd.readouterr().err
    assert err.count("\n") == 1
    assert "cannot be kept here; let NUMBA_CACHE_DIR name a folder" in err


def test_nothing_is_compiled_where_numba_may_not(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert not kept.is_compiled()
    monkeypatch.setattr(config, "DISABLE_JIT", 1)
    assert kept.is_compiled()


def test_a_folder_for_compiled_code_is_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "not" / "there"))
    assert kept.can_be_kept()
    assert not kept.is_compiled()
    kept.note_compiled()
    assert kept.is_compiled()
    monkeypatch.setattr(kept, "_made_with", lambda: "other sources")
    assert not kept.is_compiled()


@pytest.fixture
def meanwhile(compiled: list[set[str]], monkeypatch: pytest.MonkeyPatch) -> Iterator[list[Any]]:
    """Compilers that another process runs, which compile nothing."""
    printed: list[Any] = []

    class Compiler:
        ended: int | None = None

        def __init__(self, command: list[str], **_: Any) -> None:
            self.command = command
            printed.append(self)

        def poll(self) -> int | None:
            return self.ended

    monkeypatch.setattr(cold_start.subprocess, "Popen", Compiler)
    monkeypatch.setattr(cold_start, "_compiler", None)
    yield printed
    interpret(False)


def test_a_few_paths_are_planned_in_python_while_another_process_compiles(
    compiled: list[set[str]], meanwhile: list[Any], capfd: pytest.CaptureFixture[str]
) -> None:
    assert all(cold_start.sooner(is_interpreting, lambda: 200.0) for _ in range(3))
    assert len(meanwhile) == 1
    assert not compiled
    assert capfd.readouterr().err.count("\n") == 1


def test_compiled_code_is_taken_to_as_soon_as_it_is_there(
    compiled: list[set[str]], meanwhile: list[Any]
) -> None:
    with ThreadPoolExecutor(1) as executor:

        def job() -> tuple[bool, bool, Future[bool]]:
            compiled.append(set())
            # A job of another thread changes nothing for one that runs.
            begun = executor.submit(cold_start.sooner, is_interpreting, lambda: 200.0)
            return is_interpreting(), wait([begun], 0.3).not_done == {begun}, begun

        in_python, waits, after = cold_start.sooner(job, lambda: 200.0)
        assert (in_python, waits, after.result(10.0)) == (True, True, False)
    assert len(meanwhile) == 1


@pytest.mark.usefixtures("meanwhile")
def test_no_job_is_switched_to_compiled_kernels_by_a_longer_one(compiled: list[set[str]]) -> None:
    """Of two threads: the longer plan has waited for the compiler, the shorter one is half done."""
    asked = threading.Event()

    def many() -> float:
        asked.set()
        return cold_start.FEW + 1.0

    with ThreadPoolExecutor(1) as executor:

        def job() -> tuple[bool, Future[bool]]:
            longer = executor.submit(cold_start.sooner, is_interpreting, many)
            assert asked.wait(10.0)
            compiled.append(set())
            wait([longer], 3.0 * cold_start._POLL_INTERVAL)
            return is_interpreting(), longer

        in_python, longer = cold_start.sooner(job, lambda: 200.0)
        assert in_python
        assert not longer.result(10.0)


@pytest.mark.usefixtures("meanwhile")
def test_threads_that_plan_all_the_time_get_to_compiled_code(compiled: list[set[str]]) -> None:
    def plan_until_compiled() -> bool:
        latest = time.monotonic() + 10.0
        while cold_start.sooner(plan, few):
            if time.monotonic() > latest:
                return False
        return True

    def plan() -> bool:
        time.sleep(0.01)
        return is_interpreting()

    def few() -> float:
        return 200.0

    with ThreadPoolExecutor(3) as threads:
        done = [threads.submit(plan_until_compiled) for _ in range(3)]
        time.sleep(0.1)
        compiled.append(set())
        assert all(future.result(20.0) for future in done)


def test_a_compiler_that_ends_early_is_not_started_again_and_again(meanwhile: list[Any]) -> None:
    assert cold_start.sooner(is_interpreting, lambda: 200.0)
    meanwhile[0].ended = 1
    assert not cold_start.sooner(is_interpreting, lambda: 200.0)
    assert len(meanwhile) == 1


def test_many_paths_wait_for_the_compiler(
    compiled: list[set[str]], meanwhile: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    waited: list[float] = []
    monkeypatch.setattr(
        cold_start.time, "sleep", lambda s: [waited.append(s), compiled.append(set())]
    )
    assert not cold_start.sooner(is_interpreting, lambda: cold_start.FEW + 1.0)
    assert (len(waited), len(meanwhile)) == (1, 1)


def test_nothing_changes_once_kernels_are_compiled(
    compiled: list[set[str]], meanwhile: list[Any], capfd: pytest.CaptureFixture[str]
) -> None:
    compiled.append(set())
    assert not cold_start.sooner(is_interpreting, lambda: 200.0)
    assert not meanwhile
    assert capfd.readouterr().err == ""


def test_where_python_has_no_number_the_compiler_is_waited_for(
    compiled: list[set[str]], meanwhile: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cold_start.time, "sleep", lambda _: compiled.append(set()))
    assert (
        cold_start.sooner(lambda: 1.0 / (0.0 if is_interpreting() else 2.0), lambda: 200.0) == 0.5
    )
    assert (len(compiled), len(meanwhile)) == (1, 1)


@pytest.mark.usefixtures("meanwhile")
def test_a_bad_path_is_an_error_at_once(compiled: list[set[str]]) -> None:
    def refused() -> None:
        raise ParameterError("points", "numbers")

    with pytest.raises(ParameterError, match="numbers"):
        cold_start.sooner(refused, lambda: math.nan)
    assert not compiled


def test_stations_are_counted_before_they_are_laid() -> None:
    paths = [CandidatePath(n, np.array([[0.0, 0.0], [30.0, 40.0]])) for n in ("a", "b")]
    assert cold_start.stations_of(paths, 0.5) == 200.0
    assert cold_start.stations_of(batch(paths, 0.5), 0.5) == pytest.approx(200.0, abs=2.0)


def test_who_compiles_is_seen_by_other_processes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert not is_compiling()
    with compiling():
        assert is_compiling()
    assert not is_compiling()


def test_the_copy_that_runs_is_compiled_wherever_it_is_started(
    tmp_path: Path, meanwhile: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the user's folder lies another copy, as where a clone lies next to an installation."""
    (tmp_path / "slopewise").mkdir()
    for name in ("__init__", "__main__"):
        (tmp_path / "slopewise" / f"{name}.py").write_text("raise SystemExit('the other copy')")
    assert cold_start.sooner(is_interpreting, lambda: 200.0)
    monkeypatch.undo()
    *begin, code = meanwhile[0].command
    where = code.replace("main()", "print(sys.modules['slopewise'].__file__, sys.argv)")
    done = subprocess.run(
        [*begin, where],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
    )
    assert done.stdout == f"{ROOT / 'slopewise' / '__init__.py'} ['-c', 'warm-up']\n", done.stderr


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT])
def test_a_warm_up_that_is_killed_leaves_no_process(how: signal.Signals, tmp_path: Path) -> None:
    process = subprocess.Popen(
        [sys.executable, "-m", "slopewise", "warm-up"],
        cwd=ROOT,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
        # As from a terminal: what runs in the background inherits that an interrupt is ignored.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
        env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)},
    )
    try:
        _until(lambda: any(tmp_path.rglob("*.nbi")), 100.0)
        assert len(_session(process.pid)) > 1
        # A terminal interrupts all of them; a service manager or a script ends one.
        (os.killpg if how is signal.SIGINT else os.kill)(process.pid, how)
        process.wait(20.0)
        _until(lambda: not _session(process.pid), 20.0)
    finally:
        for left in _session(process.pid):
            os.kill(left, signal.SIGKILL)
    assert process.returncode != 0


def _until(is_so: Callable[[], bool], seconds: float) -> None:
    latest = time.monotonic() + seconds
    while not is_so():
        assert time.monotonic() < latest
        time.sleep(0.1)


def _session(leader: int) -> list[int]:
    """Processes that still run in a session, as /proc lists them."""
    running = []
    for file in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, _, session = file.read_text().rpartition(")")[2].split()[:4]
        except OSError:
            continue
        if int(session) == leader and state != "Z":
            running.append(int(file.parent.name))
    return running
