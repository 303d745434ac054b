"""Plans of kernels that run as Python are the plans of compiled ones."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.planner.kernels.interpreted import interpret, is_interpreting
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.plan import SpeedPlan, Status
from slopewise.planner.settings import PlannerSettings
from tests.planner.swept.test_screen import rough_ground

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
