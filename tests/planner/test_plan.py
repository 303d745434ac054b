"""Plans as values: motion, columns, progress."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slopewise.planner.limiting import Limiting
from slopewise.planner.plan import SpeedPlan, Status, motion_of
from tests.planner.scenes import ATV, plan_one, plane, straight


@given(
    speed_sq=st.lists(st.floats(0.01, 25.0), min_size=3, max_size=30).map(np.array),
    ds=st.floats(0.05, 2.0),
)
def test_motion_is_that_of_constant_acceleration_on_each_segment(
    speed_sq: np.ndarray, ds: float
) -> None:
    station = ds * np.arange(len(speed_sq))
    accel, time = motion_of(station, speed_sq)
    v, dt = np.sqrt(speed_sq), np.diff(time)
    np.testing.assert_allclose(v[:-1] + accel[:-1] * dt, v[1:], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(
        v[:-1] * dt + 0.5 * accel[:-1] * dt**2, np.full(len(dt), ds), rtol=1e-7
    )
    assert accel[-1] == 0.0
    assert time[0] == 0.0


def test_time_stays_once_the_profile_rests() -> None:
    accel, time = motion_of(np.arange(5.0), np.array([0.0, 2.0, 0.0, 0.0, 0.0]))
    np.testing.assert_allclose(time, np.sqrt(2.0) * np.array([0.0, 1.0, 2.0, 2.0, 2.0]))
    np.testing.assert_allclose(accel, [1.0, -1.0, 0.0, 0.0, 0.0])
    accel, time = motion_of(np.arange(3.0), np.zeros(3))
    assert not accel.any()
    assert not time.any()


@pytest.fixture
def plan() -> SpeedPlan:
    return plan_one(ATV, plane(unknown=lambda x, y: x > 12.0), straight(20.0))


def test_columns_are_those_of_a_plan_file_and_more(plan: SpeedPlan) -> None:
    columns = plan.columns()
    assert {len(values) for values in columns.values()} == {len(plan.station)}
    # In the order in which files have them.
    assert ",".join(columns).startswith(
        "candidate,station,x,y,z,grade,roll,curvature,speed,accel,time,speed_bound,limiting,"
        "stop_distance,clear_distance,rear_load,status,reason"
    )
    assert set(columns["status"]) == {"blocked"}
    assert set(columns["limiting"]) <= {name.name.lower() for name in Limiting}


def test_progress_and_travel_time(plan: SpeedPlan) -> None:
    assert plan.speed[-1] == 0.0
    assert 0.0 < plan.progress <= plan.clear_distance
    k = int(np.searchsorted(plan.station, plan.progress))
    assert plan.speed[k] == 0.0
    assert plan.speed[k - 1] > 0.0
    assert plan.travel_time == plan.time[k]
    assert plan.admissible


def test_a_plan_that_does_not_move_or_cannot_be_is_not_admissible(plan: SpeedPlan) -> None:
    still = dataclasses.replace(plan, speed=np.zeros_like(plan.speed))
    assert still.progress == 0.0
    assert not still.admissible
    assert not dataclasses.replace(plan, status=Status.INFEASIBLE).admissible
    assert dataclasses.replace(plan, status=Status.DEGRADED).admissible


def test_words_of_statuses_and_bounds() -> None:
    assert {s.value for s in Status} == {"ok", "blocked", "infeasible", "degraded"}
    assert [bound.label for bound in Limiting] == [
        "speed_limit",
        "stopping_path",
        "tip_over",
        "rollover",
        "lateral",
        "wheel_speed",
        "traction",
        "accel",
        "decel",
        "jerk",
        "unknown_terrain",
        "model_validity",
        "step",
        "clearance",
        "body",
        "roughness",
        "crest",
        "friction",
        "holding",
    ]
