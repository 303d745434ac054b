"""Starts from which service braking is too weak."""

from __future__ import annotations

import numpy as np
import pytest

from slopewise.models.candidate_path import CandidatePath
from slopewise.planner.plan import Status
from tests.world.ground import plane
from tests.world.plans import plan_one
from tests.world.vehicles import G, tables_with


@pytest.mark.parametrize("curvature", [0.4, -0.5])
def test_a_start_too_fast_that_brakes_in_a_turn_keeps_the_load_of_its_inner_rear_wheel(
    curvature: float,
) -> None:
    """In its dead time a stop holds its speed through the turn, and brakes where it is over."""
    heading = curvature * np.minimum(np.arange(0.0, 15.0, 0.1), 0.8)
    points = np.cumsum(0.1 * np.stack((np.cos(heading), np.sin(heading)), axis=1), axis=0)
    path, statuses = CandidatePath("bend", points), set()
    for speed in (2.6, 3.0, 3.5):
        ground = plane(x=(-3.0, 20.0), y=(-16.0, 16.0))
        plan = plan_one(tables_with(limits={"min_load": 0.3}), ground, path, start_speed=speed)
        rear = 1.0 + 0.55 / 0.6 * np.minimum(plan.accel, 0.0) / G
        side = 1.0 - 2.0 * 0.55 * plan.speed**2 * np.abs(plan.curvature) / G
        statuses.add(plan.status)
        if plan.status is Status.INFEASIBLE:
            assert "leaves a wheel" in plan.reason
        else:
            assert np.min(rear + side - 1.0) > 0.3 - 1e-3
    assert statuses == {Status.DEGRADED, Status.INFEASIBLE}
