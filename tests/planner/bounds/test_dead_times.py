"""Surfaces with different dead times: brakes may take hold once that of the ground is over."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.quantity import GRAVITY
from slopewise.planner.plan import SpeedPlan, Status
from slopewise.services.guard.guard_model import GuardScene, guard_model
from slopewise.services.guard.stop_courses import Course, Pose2d, courses_ahead
from slopewise.services.guard.stop_distances import stops_along
from tests.world.ground import ground_map, straight
from tests.world.plans import assert_sound, plan_one, violations
from tests.world.vehicles import Tables, model_of, tables_with

ON_STRIP = 9.4, 11.4  # [m] of the path, where a wheel is on the gravel
# [m/s] at which the rear axle keeps 10 % there: 1 − cg_z / 0.6 m (0.40 + 0.08 v)
HIGHEST = (0.9 * 0.6 / 0.8 - 0.40) / 0.08


def tables(dead_time: float, **limits: float) -> Tables:
    """A high vehicle, and gravel on which its brakes are strong and have this dead time [s]."""
    gravel = {"b_b": 0.4, "m_b": 0.08, "dead_time": dead_time}
    braking: dict[str, Any] = {"dead_time": 0.75, "distance_offset": 0.0}
    return tables_with(
        vehicle={"cg_z": 0.8}, braking=braking | {"terrain": {"gravel": gravel}}, limits=limits
    )


def strip() -> ElevationMap:
    return ground_map(
        lambda x, y: 0.0 * x,
        classes=lambda x, y: ((x > 9.9) & (x < 10.7)).astype(int),
        class_names=("", "gravel"),
    )


def planned(dead_time: float) -> SpeedPlan:
    return plan_one(tables(dead_time), strip(), straight(30.0), start_speed=3.0)


def speed_on_strip(plan: SpeedPlan, dead_time: float) -> float:
    """Highest speed from which the brakes may take hold on the strip."""
    bite = plan.station + dead_time * plan.speed
    first, last = ON_STRIP
    return float(plan.speed[(plan.station >= first) & (bite <= last)].max())


@pytest.mark.parametrize("dead_time", [0.0, 0.1, 0.3])
def test_an_axle_keeps_its_load_where_the_brakes_take_hold_early(dead_time: float) -> None:
    plan = planned(dead_time)
    assert plan.status is Status.OK
    assert speed_on_strip(plan, dead_time) <= HIGHEST + 1e-3
    assert plan.speed.max() > 3.9
    assert_sound(plan, tables(dead_time), strip())


def test_a_plan_for_late_brakes_alone_is_refused() -> None:
    plan = planned(0.75)
    assert speed_on_strip(plan, 0.1) > 3.8
    assert_sound(plan, tables(0.75), strip())
    for dead_time in (0.0, 0.1, 0.3):
        assert "tip_over" in violations(plan, tables(dead_time), strip())


@pytest.mark.parametrize(("speed", "loaded"), [(HIGHEST - 0.1, True), (HIGHEST + 0.1, False)])
def test_the_guard_sees_it_too(speed: float, *, loaded: bool) -> None:
    scene = GuardScene(guard_model(model_of(tables(0.1))), strip(), np.inf)
    course = Course(1.0, 0.0, 0.0, 0.0, forward=True)
    arc = courses_ahead(scene, Pose2d(9.5, 0.0, 0.0), course, 15.0)
    stops = stops_along(scene.model, arc, np.array([speed]), np.zeros(1), 0.10)
    assert stops.loaded.all() == loaded


EDGE, END = 9.1, 13.8  # [m] of the map: gravel with late brakes begins, and known ground ends


def late_brakes(dead_time: float) -> Tables:
    """Gravel on which the brakes are weak and have this dead time [s]."""
    gravel = {"b_b": 0.16, "dead_time": dead_time}
    braking = {"b_b": 0.58, "dead_time": 0.61, "distance_offset": 0.0}
    return tables_with(
        braking=braking | {"m_b": 0.0, "terrain": {"gravel": gravel}}, limits={"decel": 1.9}
    )


def before_unknown_ground() -> ElevationMap:
    return ground_map(
        lambda x, y: np.where(x > END, np.nan, 0.0 * x),
        classes=lambda x, y: (x > EDGE).astype(int),
        class_names=("", "gravel"),
    )


def stop_end(station: float, speed: float, edge: float) -> float:
    """Where a stop ends whose brakes hold once the dead time of the ground then is over [m]."""
    elapsed, step = 0.0, 1e-3
    while elapsed < (0.75 if station > edge else 0.61):
        station, elapsed = station + speed * step, elapsed + step
    while speed > 0.0:
        speed -= GRAVITY * (0.16 if station > edge else 0.58) * step
        station += max(speed, 0.0) * step
    return station


def test_stops_end_in_time_that_lead_onto_ground_with_late_brakes() -> None:
    tables, ground = late_brakes(0.75), before_unknown_ground()
    plan = plan_one(tables, ground, straight(30.0), start_speed=3.0)
    edge = EDGE - 0.5 * model_of(tables).vehicle.wheelbase
    ends = [stop_end(s, v, edge) for s, v in zip(plan.station, plan.speed, strict=True) if v > 0.0]
    assert max(ends) <= plan.clear_distance + 1e-3
    assert_sound(plan, tables, ground)
    early = plan_one(late_brakes(0.61), ground, straight(30.0), start_speed=3.0)
    assert "stopping_path" in violations(early, tables, ground)
