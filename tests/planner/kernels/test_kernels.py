"""Kernels: compiled ahead, stale, limited, and interpreted."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import warnings
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.planner.kernels.ahead import compile_ahead, written_down
from slopewise.planner.kernels.compiled import inlined, kernel
from slopewise.planner.kernels.interpreted import interpret, is_interpreting
from slopewise.planner.kernels.stale import forget_stale_kernels
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.plan import SpeedPlan, Status
from slopewise.planner.settings import PlannerSettings
from tests.world.hazards import rough_ground


def test_what_is_written_down_is_what_a_service_calls() -> None:
    module = [sys.executable, "-m", "tests.planner.kernels.signatures_now"]
    now = json.loads(subprocess.run(module, capture_output=True, check=True, text=True).stdout)
    assert now == written_down(), " ".join(["write it down again:", *module[1:]])


def test_plans_from_python_need_no_further_kernel() -> None:
    """Whole numbers, maps of other layouts, models with surfaces and effects, all settings."""
    module = [sys.executable, "-m", "tests.planner.kernels.from_python"]
    done = subprocess.run(module, capture_output=True, check=True, text=True)
    assert done.stdout == ""


@pytest.mark.parametrize("cores", [1, 2])
def test_compiled_kernels_are_in_the_cache_and_unknown_ones_are_reported(
    cores: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: range(cores))
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    arc = "slopewise.planner.raw_polyline:arc"
    strange = {
        "slopewise.planner.plan:not_there": [["d"]],
        "slopewise.planner.nowhere:kernel": [["d"]],
    }
    wrong = {
        "slopewise.planner.raw_polyline:_arc": [["d"]],
        "slopewise.planner.raw_polyline:noise": [["d"]],
    }
    done: list[int] = []
    left = compile_ahead({arc: written_down()[arc], **strange, **wrong}, done.append)
    assert left == [*strange, *wrong]
    assert sum(done) == 5
    assert [file.name.split(".")[0] for file in tmp_path.glob("**/*.nbi")] == ["raw_polyline"]


@inlined
def ratio(a: float, b: float) -> float:
    return a / b


@kernel
def ratios(a: np.ndarray, b: np.ndarray, out: np.ndarray) -> None:
    for i in range(len(a)):
        out[i] = ratio(a[i], b[i])


def test_division_by_zero_and_nan_follow_numpy() -> None:
    a, b = np.array([1.0, -1.0, 0.0, np.nan, 3.0]), np.array([0.0, 0.0, 0.0, 1.0, 2.0])
    out = np.empty(5)
    ratios(a, b, out)
    np.testing.assert_array_equal(out, [np.inf, -np.inf, np.nan, np.nan, 1.5])
    assert ratio(3.0, 2.0) == 1.5


@pytest.mark.parametrize(
    ("changed", "known", "forgotten"),
    [
        ("planner/bounds/pointwise.py", True, True),
        ("models/laws/crest.py", True, True),
        ("README.md", True, False),
        ("README.md", False, True),
    ],
)
def test_kernels_of_other_or_unknown_sources_are_forgotten(
    changed: str, known: bool, forgotten: bool, tmp_path: Path
) -> None:
    planner, models = tmp_path / "planner", tmp_path / "models"
    for folder in (planner / "bounds" / "__pycache__", models / "laws", models / "effects"):
        folder.mkdir(parents=True)
    for source in (planner / "bounds" / "pointwise.py", models / "laws" / "crest.py"):
        source.write_text("limit = 1\n")
    (models / "quantity.py").write_text("GRAVITY = 9.80665\n")
    if known:
        forget_stale_kernels(planner, models)
    machine_code = planner / "bounds" / "__pycache__" / "pointwise.bars-1.py311.nbi"
    machine_code.write_bytes(b"machine code")
    (tmp_path / changed).write_text("something = 2\n")
    assert forget_stale_kernels(planner, models) == forgotten
    assert machine_code.exists() != forgotten


def of(heights: np.ndarray, **surfaces: Any) -> ElevationMap:
    return ElevationMap(elevation=heights, resolution=0.1, origin=(0.0, 0.0), **surfaces)


COLUMN = np.arange(120)[None, :].repeat(60, 0)
GROUND = {
    "rough": rough_ground(2, 0.1, 0.28),
    "with a step": rough_ground(5, 0.1, 0.28),
    "with a hole": of(np.where(COLUMN < 80, 0.0, np.nan)),
    "on a map of the wheels' size": rough_ground(3, 0.5, 0.28),
    "two surfaces": of(0.02 * COLUMN, terrain_class=COLUMN // 60, class_names=("", "sand")),
}


@pytest.fixture
def in_python() -> Iterator[None]:
    interpret(True)
    yield
    interpret(False)


def plans_on(ground: ElevationMap, model: Model) -> list[SpeedPlan]:
    paths = [
        CandidatePath("straight", np.array([[2.0, 3.0], [10.0, 3.0]])),
        CandidatePath("bent", np.array([[2.0, 3.0], [5.0, 2.5], [8.0, 3.5]])),
    ]
    planner = CandidatePlanner(model, PlannerSettings(smooth=True), Uncertainty(quantile=0.9))
    return planner.plan(ground, paths, start_speed=1.0, clear=9.0)


@pytest.mark.parametrize("ground", GROUND)
def test_plans_are_the_same(ground: str, model: Model, request: pytest.FixtureRequest) -> None:
    compiled = plans_on(GROUND[ground], model)
    request.getfixturevalue("in_python")
    assert is_interpreting()
    for ours, theirs in zip(plans_on(GROUND[ground], model), compiled, strict=True):
        assert (ours.status, ours.reason) == (theirs.status, theirs.reason)
        np.testing.assert_allclose(ours.speed, theirs.speed, atol=2e-4)
        np.testing.assert_array_equal(ours.limiting, theirs.limiting)


def test_numpy_warns_as_before(model: Model) -> None:
    """Of a state that the caller chose, in a thread that was there before, and afterwards."""
    with np.errstate(all="raise"), ThreadPoolExecutor(1) as executor:
        before = np.geterr()
        of_other = executor.submit(np.geterr).result()
        interpret(True)
        try:
            assert np.geterr() == before
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                # Ground that is unknown makes NaN of most numbers.
                plans = executor.submit(plans_on, GROUND["with a hole"], model).result()
        finally:
            interpret(False)
        assert np.geterr() == before
        assert executor.submit(np.geterr).result() == of_other
    assert plans[0].status is Status.BLOCKED
    assert not is_interpreting()
