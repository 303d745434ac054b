"""Whoever waits for the compiler is told, in one line and before it begins."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from planner.kernels.ahead import written_down
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
