"""Limits as the worst follower obeys them, at the limit all the time; and conversions."""

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
from slopewise.services.ros.speed_limit import SpeedAdvice, advice_from_reply, place_on, stop
from slopewise.services.settings.service_settings import Planning, ServiceConfig
from slopewise.services.wire.plan_messages import Path, PlanReply, PlanRequest
from tests.services import grid_maps

TIMING = Timing()
KNOWN = 20.0  # [m] where unknown ground begins
CELL = 0.25
BODY = 1.25  # [m] of the vehicle and a cell, ahead of the position that is planned
MODEL = read_model(find_model("atv"))
PATIENT = Planning(budget=10.0)  # plans are smoothed however busy the machine is


@pytest.fixture(scope="module")
def planner() -> PlanService:
    return PlanService(ServiceConfig(model="atv", planning=PATIENT), ActiveParameters(MODEL))


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
    b = MODEL.braking
    deceleration = 9.80665 * (b.m_b * max(speed, b.speed_range[0]) + b.b_b)
    return speed * b.dead_time + speed**2 / (2.0 * deceleration) + b.distance_offset


@pytest.mark.parametrize("late", [0.0, 0.2, 0.5, 1.0])
def test_follower_at_the_limit_can_always_stop(
    planner: PlanService, ground: MapSnapshot, late: float
) -> None:
    """Toward unknown ground, with odometry of a while ago: from rest, or at 3.5 m/s."""
    speed = 3.5 if late else 0.0
    driven = [(0.1 * speed * k, speed) for k in range(round(late / TIMING.period) + 1)]
    for k in range(300):
        x, (then, measured) = driven[-1][0], driven[k]
        reply = ask(planner, ground, then, measured, f"{late} {k if late else 0}")
        advice = advice_from_reply(reply, then, 0.0, TIMING, late)
        assert advice.limit > 0.0
        speed = max(speed - 0.15, 0.0) if advice.stop else advice.limit
        end = KNOWN - (BODY if late else 0.0)
        assert advice.stop or x + stopping_distance(speed) <= end, (x, speed)
        driven.append((x + speed * TIMING.period, speed))
        if advice.stop and speed == measured == 0.0:
            break
    assert max(v for _, v in driven) > 1.0
    assert KNOWN - 4.0 < driven[-1][0] < KNOWN  # it gets to where the ground ends, not farther


def test_limit_at_rest_is_one_that_motors_can_do(planner: PlanService, ground: MapSnapshot) -> None:
    reply = ask(planner, ground, 0.0, 0.0, "rest")
    advice = advice_from_reply(reply, 0.0, 0.0, TIMING)
    assert advice.limit >= TIMING.launch
    assert not advice.stop
    assert advice_from_reply(reply, 0.0, 0.0, Timing(launch=0.0)).limit < TIMING.launch


def test_longer_limits_and_later_odometry_lower_the_limit(
    planner: PlanService, ground: MapSnapshot
) -> None:
    reply = ask(planner, ground, 16.0, 2.5, "ahead")
    timings = [Timing(life=life, launch=0.0) for life in (0.2, 0.6, 1.0)]
    limits = [advice_from_reply(reply, 16.0, 0.0, timing).limit for timing in timings]
    assert limits[0] > limits[1] > limits[2]
    for x, speed in ((0.0, 0.0), (5.0, 3.0), (12.0, 3.5), (15.0, 2.0), (17.5, 0.5)):
        reply = ask(planner, ground, x, speed, f"late {x}")
        ages = (0.0, 0.1, 0.2, 0.5, 2.0)
        limits = [advice_from_reply(reply, x, 0.0, TIMING, late).limit for late in ages]
        assert limits == sorted(limits, reverse=True)


def test_missing_plan_is_a_stop(planner: PlanService, ground: MapSnapshot) -> None:
    for reply in (
        PlanReply(status="busy", reason="too many", service="s"),
        planner.answer(PlanRequest(speed=1.0, paths=[]), None, "test"),
        ask(planner, ground, 100.0, 1.0, "off"),
        ask(planner, ground, KNOWN - 0.5, 4.0, "late"),
    ):
        advice = advice_from_reply(reply, 0.0, 0.0, TIMING)
        assert (advice.stop, advice.limit) == (True, TIMING.crawl)
        assert advice.reason


@pytest.mark.parametrize("limit", [0.0, -1.0, float("nan"), float("inf")])
def test_limit_that_would_lift_all_limits_cannot_be_sent(limit: float) -> None:
    with pytest.raises(ParameterError):
        ros.speed_limit(SpeedAdvice(limit, False, ""), 0)


def test_messages_survive_their_bytes(planner: PlanService, ground: MapSnapshot) -> None:
    store, now = typestore(), 1_800_000_000_900_000_000
    plan = ask(planner, ground, 3.2, 1.0, "bytes").plans[0]
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
    data = store.serialize_cdr(ros.speed_limit(stop(TIMING, "a reason"), now), SPEED_LIMIT)
    limit: Any = store.deserialize_cdr(data, SPEED_LIMIT)
    assert (limit.speed_limit, limit.percentage) == (TIMING.crawl, False)
    assert len(ros.profile(None, None, "odom", now).poses) == 0


def test_candidate_of_a_path_has_three_different_points() -> None:
    doubled = np.repeat([[0.0, 0.0], [1.0, 0.0], [2.0, 0.5]], 2, axis=0)
    points = ros.candidate_of("p", grid_maps.path(doubled)).points
    np.testing.assert_array_equal(points, doubled[::2])
    two = ros.candidate_of("p", grid_maps.path(doubled[:4]))
    assert two.points.tolist() == [[0.0, 0.0], [0.5, 0.0], [1.0, 0.0]]
    with pytest.raises(ParameterError, match="at least 2"):
        ros.candidate_of("p", grid_maps.path(doubled[:2]))
    with pytest.raises(ParameterError, match="finite"):
        ros.candidate_of("p", grid_maps.path(np.array([[0.0, np.nan], [1.0, 0.0]])))


@pytest.mark.parametrize("angles", [(0.1, -0.2, 2.5), (0.0, 0.3, -3.0), (-0.4, 0.0, 0.0)])
def test_angles_of_an_orientation_are_those_of_scipy(angles: tuple[float, float, float]) -> None:
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_euler("ZYX", angles[::-1]).as_quat()
    quaternion = typestore().types["geometry_msgs/msg/Quaternion"]
    np.testing.assert_allclose(ros.angles_of(quaternion(x, y, z, w)), angles, atol=1e-12)
    with pytest.raises(ParameterError, match="length 1"):
        ros.angles_of(quaternion(0.0, 0.0, 0.0, 0.0))


def test_part_ahead_of_a_long_path_is_planned() -> None:
    """Out and back: 100 m along x, then back 0.2 m to the left."""
    out = np.stack([np.arange(0.0, 100.0, 0.05), np.zeros(2000)], axis=1)
    path = Path(name="p", points=np.concatenate([out, out[::-1] + np.array([0.0, 0.2])]))

    def ahead(x: float, y: float, heading: float, horizon: float = 20.0) -> np.ndarray:
        return ros.ahead_of(path, ros.OdometrySample("map", 0, x, y, heading, 1.0), horizon).points

    forth = ahead(30.0, 0.1, 0.1, 40.0)
    assert 27.0 < forth[0, 0] <= 28.0
    assert 69.0 < forth[-1, 0] <= 70.1
    assert np.all(forth[:, 1] == 0.0)
    back = ahead(30.0, 0.1, np.pi - 0.1)
    assert np.all(back[:, 1] == 0.2)
    assert 32.0 <= back[0, 0] < 33.0
    assert 9.9 < back[-1, 0] < 11.0
    end = ahead(0.0, 0.2, np.pi)
    assert len(end) >= 3
    assert end[-1].tolist() == [0.0, 0.2]
    path = Path(name="s", points=out[:100])
    assert ahead(0.0, 0.0, 0.0) is path.points
