"""Limits are obeyed by the worst of followers: one that is at the limit at once, all the time."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rosbags", reason="the ros extra is not installed")

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import ParameterError
from slopewise.services.io.bags import SPEED_LIMIT, typestore
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.parameters.active_parameters import ActiveParameters
from slopewise.services.planning.map_store import MapSnapshot
from slopewise.services.planning.plan_service import PlanService
from slopewise.services.ros import conversions as ros
from slopewise.services.ros.settings import Timing
from slopewise.services.ros.speed_limit import SpeedAdvice, place_on, stop, told_by
from slopewise.services.settings.service_settings import ServiceConfig
from slopewise.services.wire.plan_messages import Path, PlanReply, PlanRequest
from tests.services import grid_maps

TIMING = Timing()
KNOWN = 20.0  # [m] where unknown ground begins
CELL = 0.25


@pytest.fixture(scope="module")
def planner() -> PlanService:
    config = ServiceConfig(model="atv")
    return PlanService(config, ActiveParameters(read_model(find_model("atv"))))


@pytest.fixture(scope="module")
def ground() -> MapSnapshot:
    heights = np.zeros((49, 200))
    heights[:, round((KNOWN + 5.0) / CELL) :] = np.nan
    level = ElevationMap(elevation=heights, resolution=CELL, origin=(-5.0, -6.0))
    return MapSnapshot(level, 1, time.monotonic())


def ask(planner: PlanService, ground: MapSnapshot, x: float, speed: float, name: str) -> PlanReply:
    points = np.stack([np.linspace(0.0, 40.0, 120), np.zeros(120)], axis=1)
    request = PlanRequest(
        speed=speed, paths=[Path(name="p", points=points)], client=name, pose=(x, 0.0, 0.0)
    )
    return planner.answer(request, ground, "test")


def stopping_distance(speed: float) -> float:
    """Braking (7), (8) on level ground in closed form, with the shipped vehicle's numbers."""
    model = read_model(find_model("atv"))
    b = model.braking
    deceleration = 9.80665 * (b.m_b * max(speed, b.speed_range[0]) + b.b_b)
    return speed * b.dead_time + speed**2 / (2.0 * deceleration) + b.distance_offset


def test_who_drives_at_the_limit_can_always_stop(planner: PlanService, ground: MapSnapshot) -> None:
    x, speed, top, stops = 0.0, 0.0, 0.0, 0
    for _ in range(400):
        told = told_by(ask(planner, ground, x, speed, "worst"), x, 0.0, TIMING)
        assert told.limit > 0.0
        if told.stop:
            stops += 1
            speed = max(speed - 0.15, 0.0)
        else:
            speed = told.limit
            assert x + stopping_distance(speed) <= KNOWN, (x, speed)
        top = max(top, speed)
        x += speed * TIMING.period
        if stops > 30:
            break
    assert top > 1.0
    assert KNOWN - 3.0 < x < KNOWN  # it gets to where the ground ends, and not farther


def test_from_rest_the_limit_is_one_that_motors_can_do(
    planner: PlanService, ground: MapSnapshot
) -> None:
    told = told_by(ask(planner, ground, 0.0, 0.0, "rest"), 0.0, 0.0, TIMING)
    assert told.limit >= TIMING.launch
    assert not told.stop
    slow = Timing(launch=0.0)
    assert told_by(ask(planner, ground, 0.0, 0.0, "r2"), 0.0, 0.0, slow).limit < TIMING.launch


def test_limits_look_ahead_as_far_as_told(planner: PlanService, ground: MapSnapshot) -> None:
    """Close to the end of what is known, a longer look gives a lower limit."""
    reply = ask(planner, ground, 16.0, 2.5, "ahead")
    limits = [
        told_by(reply, 16.0, 0.0, Timing(life=life, launch=0.0)).limit for life in (0.2, 0.6, 1.0)
    ]
    assert limits[0] > limits[1] > limits[2]


def test_no_plan_is_a_stop(planner: PlanService, ground: MapSnapshot) -> None:
    for reply in (
        PlanReply(status="busy", reason="too many", service="s"),
        planner.answer(PlanRequest(speed=1.0, paths=[]), None, "test"),
        ask(planner, ground, 100.0, 1.0, "off"),
        ask(planner, ground, KNOWN - 0.5, 4.0, "late"),
    ):
        told = told_by(reply, 0.0, 0.0, TIMING)
        assert told.stop
        assert told.limit == TIMING.crawl
        assert told.reason


@pytest.mark.parametrize("limit", [0.0, -1.0, float("nan"), float("inf")])
def test_what_would_lift_all_limits_cannot_be_said(limit: float) -> None:
    with pytest.raises(ParameterError):
        ros.speed_limit(SpeedAdvice(limit, False, ""), 0)


def test_messages_survive_their_bytes(planner: PlanService, ground: MapSnapshot) -> None:
    store = typestore()
    reply = ask(planner, ground, 3.2, 1.0, "bytes")
    plan = reply.plans[0]
    now = 1_800_000_000_900_000_000
    message: Any = ros.profile(plan, place_on(plan, 3.2, 0.0), "odom", now)
    data = store.serialize_cdr(message, "nav_msgs/msg/Path")
    back: Any = store.deserialize_cdr(data, "nav_msgs/msg/Path")
    x = np.array([p.pose.position.x for p in back.poses])
    stamps = np.array([ros.stamp_of(p.header) for p in back.poses])
    assert x[0] > 3.2
    assert np.all(np.diff(stamps) > 0)
    assert stamps[0] >= now
    # Between two poses the mean speed is between the plan's speeds there.
    v = np.interp(x, plan.column("x"), plan.column("speed"))
    mean = np.diff(x) / (1e-9 * np.diff(stamps))
    assert np.all(mean[:-1] <= np.maximum(v[:-2], v[1:-1]) + 1e-3)
    told = stop(TIMING, "why")
    limit: Any = store.deserialize_cdr(
        store.serialize_cdr(ros.speed_limit(told, now), SPEED_LIMIT), SPEED_LIMIT
    )
    assert (limit.speed_limit, limit.percentage) == (TIMING.crawl, False)
    assert len(ros.profile(None, None, "odom", now).poses) == 0


def test_paths_as_ros_gives_them() -> None:
    doubled = np.repeat([[0.0, 0.0], [1.0, 0.0], [2.0, 0.5]], 2, axis=0)
    np.testing.assert_array_equal(
        ros.candidate_of("p", grid_maps.path(doubled)).points, doubled[::2]
    )
    two = ros.candidate_of("p", grid_maps.path(doubled[:4]))
    assert two.points.tolist() == [[0.0, 0.0], [0.5, 0.0], [1.0, 0.0]]
    with pytest.raises(ParameterError, match="at least 2"):
        ros.candidate_of("p", grid_maps.path(doubled[:2]))
    with pytest.raises(ParameterError, match="finite"):
        ros.candidate_of("p", grid_maps.path(np.array([[0.0, np.nan], [1.0, 0.0]])))


@pytest.mark.parametrize("angles", [(0.1, -0.2, 2.5), (0.0, 0.3, -3.0), (-0.4, 0.0, 0.0)])
def test_angles_of_orientations(angles: tuple[float, float, float]) -> None:
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_euler("ZYX", angles[::-1]).as_quat()
    q = typestore().types["geometry_msgs/msg/Quaternion"](x, y, z, w)
    np.testing.assert_allclose(ros.angles_of(q), angles, atol=1e-12)
    with pytest.raises(ParameterError, match="length 1"):
        ros.angles_of(typestore().types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 0.0))


def motion(x: float, y: float, heading: float) -> ros.OdometrySample:
    return ros.OdometrySample("map", 0, x, y, heading, 1.0)


def test_of_a_long_path_the_part_ahead_counts() -> None:
    """Out and back: 100 m along x, then back 0.2 m beside it."""
    out = np.stack([np.arange(0.0, 100.0, 0.05), np.zeros(2000)], axis=1)
    path = Path(name="p", points=np.concatenate([out, out[::-1] + np.array([0.0, 0.2])]))
    going = ros.ahead_of(path, motion(30.0, 0.1, 0.1), 40.0).points
    assert 27.0 < going[0, 0] <= 28.0
    assert 69.0 < going[-1, 0] <= 70.1
    assert np.all(going[:, 1] == 0.0)
    coming = ros.ahead_of(path, motion(30.0, 0.1, np.pi - 0.1), 20.0).points
    assert np.all(coming[:, 1] == 0.2)
    assert 32.0 <= coming[0, 0] < 33.0
    assert 9.9 < coming[-1, 0] < 11.0
    end = ros.ahead_of(path, motion(0.0, 0.2, np.pi), 20.0).points
    assert len(end) >= 3
    assert end[-1].tolist() == [0.0, 0.2]
    short = Path(name="s", points=out[:100])
    assert ros.ahead_of(short, motion(0.0, 0.0, 0.0), 20.0) is short
