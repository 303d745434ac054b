from __future__ import annotations

import numpy as np

from slopewise.planner.ground.averaged_map import averaged_map
from slopewise.planner.path import batch
from slopewise.planner.pipeline.plan_finalizer import PlanFinalizer, Unfinished
from slopewise.planner.pipeline.time_optimal_batch import time_optimal_batch
from slopewise.planner.plan import Status
from slopewise.planner.settings import PlannerSettings
from tests.world.ground import plane, straight
from tests.world.vehicles import ATV, model_of


def test_an_emergency_stop_keeps_its_label_where_there_is_no_time_to_smooth() -> None:
    """In a moving horizon its command is a full stop; that of a plan without smoothing is not."""
    model = model_of(ATV)
    ahead = batch([straight(25.0)], 0.25)
    solved = time_optimal_batch(
        averaged_map(plane(), model.vehicle.wheel_radius),
        ahead,
        model,
        start_speed=3.0,
        clear=np.array([1.0]),
        settings=PlannerSettings(),
    )
    finalizer = PlanFinalizer(solved, 0, solved.start_sq)
    plan = finalizer.finish(
        "a", Unfinished(solved.profile_of(0)), smoothed=False, unsmoothed="late"
    )
    assert plan.status is Status.INFEASIBLE
    assert "full braking" in plan.reason
