"""Odometry that is late at the edge: stale by its stamps, and limits that hold for longer."""

from __future__ import annotations

import time

import pytest

pytest.importorskip("rosbags", reason="the ros extra is not installed")

from slopewise.services.planning.map_store import MapSnapshot
from slopewise.services.planning.plan_service import PlanService
from slopewise.services.ros.settings import EdgeSettings, Timing
from slopewise.services.ros.speed_limit import told_by
from slopewise.services.ros.vehicle_state import VehicleState
from slopewise.services.wire.lateness import SYNCHRONY
from tests.services import grid_maps
from tests.services.ros.test_drive_samples import Wire, give, odometry
from tests.services.ros.test_speed_limit import (
    KNOWN,
    TIMING,
    ask,
    ground,
    planner,
    stopping_distance,
)

__all__ = ["ground", "planner"]  # fixtures
_BODY = 1.25  # [m] of the vehicle and a cell, ahead of the place that is planned


def stamped(speed: float, stamp: float) -> object:
    message = odometry(speed)
    message.header = grid_maps.header("odom", int(stamp), round(1e9 * (stamp % 1.0)))
    return message


def edge_state(**timing: object) -> VehicleState:
    settings = EdgeSettings(timing=Timing(**timing))  # type: ignore[arg-type]
    return VehicleState(settings, Wire(), Wire())  # type: ignore[arg-type]


@pytest.mark.parametrize("frozen", [False, True])
def test_delay_that_grows_and_stamps_that_repeat_make_odometry_old(frozen: bool) -> None:
    state = edge_state()
    for k in range(100):
        at = 10.0 + 0.02 * k
        sent = min(at, 11.0) if frozen else at - max(0.5 * (at - 11.0), 0.0)
        give(state, at, odom=stamped(1.0, 100.0 + sent))
    motion, reason = state.motion(at, "odom")
    assert motion is None
    expected = (
        "0.98 s old (repeated stamp)" if frozen else "0.49 s old (arrival and growth of delay)"
    )
    assert reason == f"odometry is {expected}, limit 0.3 s"
    assert state.stamps() == ("growth only, repeated" if frozen else "growth only")


def test_with_a_shared_clock_the_age_is_that_of_the_stamp() -> None:
    state, at, now = edge_state(clock="shared"), time.monotonic(), time.time()
    give(state, at, odom=stamped(1.0, now - 0.2))
    assert state.motion(at, "odom")[1] == ""
    assert state.late(at) == pytest.approx(0.2 + SYNCHRONY, abs=0.01)
    give(state, at, odom=stamped(1.0, now - 5.0))
    assert "s old (stamp), limit 0.3 s" in state.motion(at, "odom")[1]


def test_without_stamps_the_declared_latency_is_added() -> None:
    state = edge_state(max_latency=0.4)
    give(state, 10.0, odom=stamped(1.0, 0.0))
    assert state.late(10.1) == pytest.approx(0.5)
    assert state.stamps() == "none"


def test_late_odometry_never_raises_a_limit(planner: PlanService, ground: MapSnapshot) -> None:
    for x, speed in ((0.0, 0.0), (5.0, 3.0), (12.0, 3.5), (15.0, 2.0), (17.5, 0.5)):
        reply = ask(planner, ground, x, speed, f"late {x}")
        limits = [told_by(reply, x, 0.0, TIMING, late).limit for late in (0.0, 0.1, 0.2, 0.5, 2.0)]
        assert limits == sorted(limits, reverse=True)


@pytest.mark.parametrize("late", [0.2, 0.5, 1.0])
def test_who_drives_at_the_limit_can_stop_though_odometry_is_late(
    planner: PlanService, ground: MapSnapshot, late: float
) -> None:
    """At 3.5 m/s toward unknown ground; it follows what is planned for where it was."""
    behind = round(late / TIMING.period)
    speed = 3.5
    driven = [(0.1 * speed * k, speed) for k in range(behind + 1)]
    for k in range(200):
        x, (then, measured) = driven[-1][0], driven[k]
        reply = ask(planner, ground, then, measured, f"{late} {k}")
        advice = told_by(reply, then, 0.0, TIMING, late)
        speed = max(speed - 0.15, 0.0) if advice.stop else advice.limit
        assert advice.stop or x + stopping_distance(speed) <= KNOWN - _BODY, (x, speed)
        driven.append((x + speed * TIMING.period, speed))
    assert KNOWN - 4.0 < driven[-1][0] < KNOWN
