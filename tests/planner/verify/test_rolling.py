"""Rolling with the drive cut: the lowest known motion resistance counts, not the highest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import slopewise
from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.planner.plan import SpeedPlan

G = 9.80665
GRADE = -0.2  # [rad]
ATV = slopewise.read_model("atv")


def stop_end(station: float, speed: float, rolling: float) -> float:
    """End of a stop on the descent [m], by the law of the model and a drive that is cut."""
    brakes = ATV.braking
    onset = speed + max(-np.sin(GRADE) - rolling, 0.0) * G * brakes.dead_time
    force = (brakes.m_m * onset + brakes.b_m) * GRADE + brakes.m_b * onset + brakes.b_b
    braked = onset**2 / (2.0 * G * (force + np.sin(GRADE)))
    return station + 0.5 * (speed + onset) * brakes.dead_time + braked + brakes.distance_offset


def rolling_with(resistance: float) -> Model:
    """The vehicle with a lowest motion resistance [1]; the highest is 0.13."""
    terrain = replace(ATV.terrain, motion_resistance=0.13, braking_resistance=resistance)
    return replace(ATV, terrain=terrain)


def descent() -> ElevationMap:
    columns = np.arange(0.0, 40.0, 0.25)
    heights = np.tile(np.tan(GRADE) * columns, (40, 1))
    return ElevationMap(elevation=heights, resolution=0.25, origin=(0.0, -5.0))


def planned(model: Model) -> SpeedPlan:
    line = np.stack([np.linspace(2.0, 18.0, 60), np.zeros(60)], axis=1)
    path = CandidatePath("a", line)
    (plan,) = slopewise.plan(model, descent(), [path], start_speed=1.0, quantile=0.5)
    return plan


@pytest.mark.parametrize("resistance", [0.13, 0.05, 0.0])
def test_a_stop_on_a_descent_relies_on_the_lowest_resistance(resistance: float) -> None:
    plan = planned(rolling_with(resistance))
    ends = [
        stop_end(float(s), float(v), resistance)
        for s, v in zip(plan.station, plan.speed, strict=True)
        if v > 0.7  # near rest the plan stands before the end, by the distance offset
    ]
    assert max(ends) <= plan.clear_distance


def test_the_checker_relies_on_the_lowest_resistance() -> None:
    free = rolling_with(0.0)
    for model, accepted in ((free, True), (rolling_with(0.13), False)):
        report = slopewise.check_plan(planned(model), free, descent(), quantile=0.5)
        assert report.valid == accepted, report.violations
