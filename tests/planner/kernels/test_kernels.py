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

import numba
import numpy as np
import pytest

from slopewise.models.arrays import read_only
from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.laws import slip_track, tip_over, turning_resistance, wheel_loads
from slopewise.models.parameters import Model
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.planner.kernels.ahead import compile_ahead, described, meant, written_down
from slopewise.planner.kernels.compiled import inlined, kernel
from slopewise.planner.kernels.interpreted import interpret, is_interpreting
from slopewise.planner.kernels.limits import PlanningLimits, planning_limits
from slopewise.planner.kernels.stale import forget_stale_kernels
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.plan import SpeedPlan, Status
from slopewise.planner.settings import PlannerSettings
from tests.planner.scenes import ATV, G, model_of, tables_with
from tests.planner.swept.test_screen import rough_ground

# ----------------------------------------------------------------------------------- ahead


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


# -------------------------------------------------------------------------------- compiled


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


def test_read_only_arrays_refuse_to_change() -> None:
    array = read_only(np.zeros(3))
    with pytest.raises(ValueError, match="read-only"):
        array[0] = 1.0


# ---------------------------------------------------------------------------------- limits


def test_levers_are_those_of_the_wheel_loads() -> None:
    n = planning_limits(model_of(tables_with(vehicle={"cg_x": 0.5, "cg_z": 0.4})))
    # One g of braking on level ground shifts lever times the static load of an axle.
    assert n.rear_lever == pytest.approx(1.0 - wheel_loads.rear_load_share(0, 0, G, 1.2, 0.5, 0.4))
    assert n.front_lever == pytest.approx(
        wheel_loads.front_load_share(0, 0, G, 1.2, 0.5, 0.4) - 1.0
    )
    assert n.side_lever == pytest.approx(1.0 - wheel_loads.right_load_share(0, 0, -G, 1.0, 0.4))
    assert G / n.front_lever * (1.0 - 0.1) == pytest.approx(
        tip_over.drive_accel_limit(0.0, 0.0, 0.5, 0.4, 0.1)
    )


def test_only_skid_steer_vehicles_drag_and_slip_in_turns() -> None:
    skid = planning_limits(model_of(ATV))
    assert skid.turning_drag == turning_resistance.equivalent_drag_ratio(1.0, 0.20, 1.2)
    assert 1.0 + skid.half_slip_track == slip_track.outer_wheel_speed_ratio(1.0, 1.15)
    steered = planning_limits(model_of(tables_with(vehicle={"drive": "ackermann"})))
    assert steered.turning_drag == 0.0
    assert steered.half_slip_track == 0.5


def test_drive_is_reckoned_per_weight() -> None:
    n = planning_limits(model_of(ATV))
    assert n.specific_force == pytest.approx(2500.0 / (500.0 * G))
    assert n.specific_power == pytest.approx(6000.0 / (500.0 * G))
    assert (n.speed, n.accel, n.decel, n.lateral_accel) == (4.0, 1.0, 1.5, 2.0)
    assert (n.min_load, n.resistance, n.max_wheel_speed) == (0.10, 0.13, 6.0)


# ----------------------------------------------------------------------------------- stale


@pytest.fixture
def packages(tmp_path: Path) -> tuple[Path, Path]:
    planner, models = tmp_path / "planner", tmp_path / "models"
    for folder in (planner / "bounds" / "__pycache__", models / "laws", models / "effects"):
        folder.mkdir(parents=True)
    (planner / "bounds" / "pointwise.py").write_text("limit = 1\n")
    (models / "laws" / "crest.py").write_text("law = 1\n")
    (models / "quantity.py").write_text("GRAVITY = 9.80665\n")
    return planner, models


def compiled(planner: Path) -> Path:
    kernel = planner / "bounds" / "__pycache__" / "pointwise.bars-1.py311.nbi"
    kernel.write_bytes(b"machine code")
    return kernel


@pytest.mark.parametrize("changed", ["planner/bounds/pointwise.py", "models/laws/crest.py"])
def test_a_change_of_what_is_compiled_in_forgets_the_kernels(
    packages: tuple[Path, Path], changed: str
) -> None:
    planner, models = packages
    forget_stale_kernels(planner, models)
    kernel = compiled(planner)
    (planner.parent / changed).write_text("something = 2\n")
    assert forget_stale_kernels(planner, models)
    assert not kernel.exists()


def test_unchanged_sources_keep_their_kernels(packages: tuple[Path, Path]) -> None:
    planner, models = packages
    forget_stale_kernels(planner, models)
    kernel = compiled(planner)
    assert not forget_stale_kernels(planner, models)
    assert kernel.exists()


def test_kernels_of_unknown_origin_go(packages: tuple[Path, Path]) -> None:
    kernel = compiled(packages[0])
    assert forget_stale_kernels(*packages)
    assert not kernel.exists()


# ----------------------------------------------------------------------------- interpreted


GROUND = {
    "level": ElevationMap(elevation=np.zeros((60, 120)), resolution=0.1, origin=(0.0, 0.0)),
    "rough": rough_ground(2, 0.1, 0.28),
    "with a step": rough_ground(5, 0.1, 0.28),
    "with a hole": ElevationMap(
        elevation=np.where(np.arange(120) < 80, 0.0, np.nan)[None, :].repeat(60, 0),
        resolution=0.1,
        origin=(0.0, 0.0),
    ),
    "on a map of the wheels' size": rough_ground(3, 0.5, 0.28),
    "two surfaces": ElevationMap(
        elevation=np.fromfunction(lambda i, j: 0.02 * j + 0.01 * i, (60, 120)),
        resolution=0.1,
        origin=(0.0, 0.0),
        terrain_class=np.arange(120)[None, :].repeat(60, 0) // 60,
        class_names=("", "sand"),
    ),
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


@pytest.mark.usefixtures("in_python")
def test_no_kernel_is_compiled_meanwhile(model: Model) -> None:
    from numba.core import event

    with event.install_recorder("numba:compile") as compiled:
        plans_on(GROUND["rough"], model)
    assert not compiled.buffer


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
