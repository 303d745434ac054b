"""Kernels compiled ahead are those that are called, with the numbers they are called with."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest

from slopewise.planner.kernels.ahead import compile_ahead, described, meant, written_down
from slopewise.planner.kernels.limits import PlanningLimits


def test_what_is_written_down_is_what_a_service_calls() -> None:
    module = [sys.executable, "-m", "tests.planner.kernels.signatures_now"]
    now = json.loads(subprocess.run(module, capture_output=True, check=True, text=True).stdout)
    assert now == written_down(), " ".join(["write it down again:", *module[1:]])


def test_plans_from_python_need_no_further_kernel() -> None:
    """Whole numbers, maps of other layouts, models with surfaces and effects, all settings."""
    module = [sys.executable, "-m", "tests.planner.kernels.from_python"]
    done = subprocess.run(module, capture_output=True, check=True, text=True)
    assert done.stdout == ""


def test_a_type_is_read_as_it_was_described() -> None:
    closed = np.zeros((2, 3))
    closed.flags.writeable = False
    limits = PlanningLimits(*np.arange(20.0))
    for value in (1.0, 1, True, np.zeros(3), closed, closed.T, (1, 2.0), (1.0, 2.0), limits):
        kind = numba.typeof(value)
        assert meant(json.loads(json.dumps(described(kind)))) == kind


@pytest.mark.parametrize("cores", [1, 2])
def test_compiled_kernels_are_in_the_cache_and_unknown_ones_are_reported(
    cores: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: range(cores))
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    motion = "slopewise.planner.plan:_motion"
    strange = {
        "slopewise.planner.plan:not_there": [["d"]],
        "slopewise.planner.nowhere:kernel": [["d"]],
    }
    wrong = {
        "slopewise.planner.horizon.polyline:_arc": [["d"]],
        "slopewise.planner.horizon.polyline:_foot": [["d"]],
    }
    done: list[int] = []
    left = compile_ahead({motion: written_down()[motion], **strange, **wrong}, done.append)
    assert left == [*strange, *wrong]
    assert sum(done) == 5
    assert [file.name.split(".")[0] for file in tmp_path.glob("**/*.nbi")] == ["plan"]
