"""Whoever waits for the compiler is told, in one line and before it begins."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from models.errors import ParameterError
from planner.kernels.ahead import written_down
from planner.kernels.interpreted import interpret, is_interpreting
from planner.kernels.kept import compiling, is_compiling
from services.planning import cold_start


@pytest.fixture
def compiled(monkeypatch: pytest.MonkeyPatch) -> list[set[str]]:
    """What was compiled, by nobody."""
    asked: list[set[str]] = []
    monkeypatch.setattr(cold_start, "compile_ahead", lambda some: asked.append(set(some)))
    monkeypatch.setattr(cold_start, "is_first_run", lambda: not asked)
    return asked


def test_the_first_run_compiles_and_says_so_in_one_line(
    compiled: list[set[str]], capfd: pytest.CaptureFixture[str]
) -> None:
    cold_start.compile_first("plans come after that")
    cold_start.compile_first("plans come after that")
    out, err = capfd.readouterr()
    words = "slopewise: compiling, once after each installation; plans come after that\n"
    assert (out, err) == ("", words)
    assert compiled == [set(written_down())]


def test_a_plan_alone_waits_for_no_kernel_of_a_robot_that_drives(compiled: list[set[str]]) -> None:
    cold_start.compile_first("", cold_start.ALONE)
    (alone,) = compiled
    assert alone < set(written_down())
    assert not any("horizon" in name or "batch_judge" in name for name in alone)
    # Each beginning is that of a kernel: none was renamed or moved since.
    for begin in cold_start.ALONE:
        assert any(name.startswith(f"planner.{begin}") for name in alone), json.dumps(begin)


def test_code_that_cannot_be_kept_is_not_compiled_twice(
    compiled: list[set[str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "not there"))
    cold_start.compile_first("")
    assert not compiled
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    cold_start.compile_first("")
    assert len(compiled) == 1


@pytest.fixture
def meanwhile(compiled: list[set[str]], monkeypatch: pytest.MonkeyPatch) -> Iterator[list[Any]]:
    """What another process was told to do, which nobody does."""
    told: list[Any] = []
    monkeypatch.setattr(cold_start.subprocess, "Popen", lambda *args, **_: told.append(args[0]))
    yield told
    interpret(False)


def test_a_few_paths_are_planned_in_python_while_another_process_compiles(
    compiled: list[set[str]], meanwhile: list[Any], capfd: pytest.CaptureFixture[str]
) -> None:
    assert cold_start.sooner(is_interpreting, 200.0)
    assert [command[1:] for command in meanwhile] == [["-m", "slopewise", "warm-up"]]
    assert not compiled
    assert capfd.readouterr().err.count("\n") == 1


def test_many_paths_wait_for_the_compiler(compiled: list[set[str]], meanwhile: list[Any]) -> None:
    assert not cold_start.sooner(is_interpreting, cold_start.FEW + 1.0)
    assert len(compiled) == 1
    assert not meanwhile


def test_nothing_changes_once_kernels_are_compiled(
    compiled: list[set[str]], meanwhile: list[Any], capfd: pytest.CaptureFixture[str]
) -> None:
    compiled.append(set())
    assert not cold_start.sooner(is_interpreting, 200.0)
    assert not meanwhile
    assert capfd.readouterr().err == ""


@pytest.mark.usefixtures("meanwhile")
def test_where_python_has_no_number_the_compiler_is_waited_for(compiled: list[set[str]]) -> None:
    assert cold_start.sooner(lambda: 1.0 / (0.0 if is_interpreting() else 2.0), 200.0) == 0.5
    assert len(compiled) == 1


@pytest.mark.usefixtures("meanwhile")
def test_a_bad_path_is_an_error_at_once(compiled: list[set[str]]) -> None:
    def refused() -> None:
        raise ParameterError("points", "numbers")

    with pytest.raises(ParameterError, match="numbers"):
        cold_start.sooner(refused, math.nan)
    assert not compiled


def test_who_compiles_is_seen_by_other_processes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert not is_compiling()
    with compiling():
        assert is_compiling()
    assert not is_compiling()
