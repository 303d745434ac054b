"""Odometry by age and frame, and samples that the service can learn from."""

from __future__ import annotations

import time

import numpy as np
import pytest

pytest.importorskip("rosbags", reason="the ros extra is not installed")

from slopewise.services.ros.settings import EdgeSettings, Timing, Topics, WheelJoints
from slopewise.services.ros.vehicle_state import VehicleState
from slopewise.services.wire.lateness import SYNCHRONY
from tests.services.ros.ros_messages import (
    WireStub,
    command,
    give,
    imu,
    joints,
    odometry,
    transforms,
)


def state(wire: WireStub, **timing: object) -> VehicleState:
    settings = EdgeSettings(
        topics=Topics(imu="imu", joints="joints", command="cmd_vel"),
        wheels=WheelJoints(left="l", right="r", radius=0.2),
        timing=Timing(**timing),  # type: ignore[arg-type]
    )
    return VehicleState(settings, wire, wire)  # type: ignore[arg-type]


def test_samples_hold_the_values_of_their_messages() -> None:
    wire = WireStub()
    vehicle = state(wire)
    give(vehicle, 9.9, cmd_vel=command(2.0))
    for k in range(50):
        at = 10.0 + 0.02 * k
        if k == 30:
            give(vehicle, at, cmd_vel=command(0.0))
        odom = odometry(2.0 - 0.01 * k, stamp=at)
        give(vehicle, at, odom=odom, imu=imu(0.1, 0.3), joints=joints(9.0, 11.0))
    (message,) = wire.sent
    rows = dict(zip(message.columns, message.values, strict=True))
    np.testing.assert_allclose(rows["t"], 10.0 + 0.02 * np.arange(50))
    np.testing.assert_allclose(rows["v"], 2.0 - 0.01 * np.arange(50))
    np.testing.assert_array_equal(rows["v_cmd"], np.where(np.arange(50) < 30, 2.0, 0.0))
    for name, value in (("pitch", 0.1), ("yaw_rate", 0.3), ("v_left", 1.8), ("v_right", 2.2)):
        np.testing.assert_allclose(rows[name], value)


def test_silent_sensor_ends_the_stretch() -> None:
    wire = WireStub()
    vehicle = state(wire)
    give(vehicle, 9.9, cmd_vel=command(2.0), joints=joints(9.0, 9.0), imu=imu(0.0, 0.0))
    for k in range(60):
        at = 10.0 + 0.02 * k
        give(vehicle, at, odom=odometry(2.0, stamp=at), joints=joints(9.0, 9.0))
    (message,) = wire.sent
    assert message.values[0, -1] < 9.9 + 0.5


def test_without_a_stop_command_no_samples_are_sent() -> None:
    wire = WireStub()
    vehicle = state(wire)
    for k in range(80):
        at = 0.02 * k
        give(vehicle, at, odom=odometry(2.0), imu=imu(0.0, 0.0), joints=joints(9.0, 9.0))
    assert not wire.sent


def test_unusable_messages_are_refused_with_a_reason() -> None:
    wire = WireStub()
    vehicle = state(wire)
    give(vehicle, 1.0, odom=odometry(float("nan")))
    assert vehicle.motion(1.0, "odom") == (None, "no odometry")
    give(vehicle, 1.0, joints=joints(1.0, 1.0, ("a", "b")))
    assert "joint l" in wire.inbox.refused["/joints"]
    give(vehicle, 2.0, odom=odometry(1.5))
    motion, reason = vehicle.motion(2.1, "odom")
    assert (motion.speed, reason) == (1.5, "")
    for moment, frame, expected in (
        (2.1, "map", "expected a transform from odom to map, got none"),
        (9.0, "odom", "odometry is 7.00 s old (arrival and growth of delay), limit 0.3 s"),
    ):
        assert vehicle.motion(moment, frame) == (None, expected)


def test_odometry_is_transformed_to_the_frame_of_the_paths() -> None:
    """odom is turned by a right angle in map, and world lies 10 m beside map."""  # words: ok
    vehicle = state(WireStub())
    give(vehicle, 1.0, tf_static=transforms(("world", "map", 10.0, 0.0, 0.0)))
    give(vehicle, 5.0, tf=transforms(("map", "odom", 3.0, 4.0, np.pi / 2)))
    give(vehicle, 5.0, odom=odometry(1.5, x=2.0))
    for frame, x, y in (("odom", 2.0, 0.0), ("map", 3.0, 6.0), ("/world", 13.0, 6.0)):
        motion, reason = vehicle.motion(5.1, frame)
        assert motion is not None, reason
        assert (motion.x, motion.y) == pytest.approx((x, y))
        assert motion.heading == pytest.approx(0.0 if frame == "odom" else np.pi / 2)
        assert motion.speed == 1.5
    # A transform that is not renewed expires after a second; the fixed one holds.
    moved = odometry(1.5, x=2.0, stamp=6.5)
    give(vehicle, 6.5, odom=moved)
    assert vehicle.motion(6.5, "map") == (None, "expected a transform from odom to map, got none")
    give(vehicle, 6.6, tf=transforms(("map", "odom", 3.0, 4.0, 0.0)), odom=moved)
    motion, _ = vehicle.motion(6.6, "world")
    assert motion.x == pytest.approx(15.0)


def test_circular_and_invalid_transforms_give_no_motion() -> None:
    wire = WireStub()
    vehicle = state(wire)
    give(vehicle, 1.0, odom=odometry(1.0))
    give(vehicle, 1.0, tf=transforms(("odom", "a", 1.0, 0.0, 0.0), ("a", "odom", 1.0, 0.0, 0.0)))
    assert vehicle.motion(1.0, "map")[0] is None
    give(vehicle, 1.0, tf=transforms(("map", "odom", float("nan"), 0.0, 0.0)))
    assert "finite" in wire.inbox.refused["/tf"]


@pytest.mark.parametrize("frozen", [False, True])
def test_growing_delay_and_repeated_stamps_make_odometry_old(frozen: bool) -> None:
    vehicle = state(WireStub())
    for k in range(100):
        at = 10.0 + 0.02 * k
        sent = min(at, 11.0) if frozen else at - max(0.5 * (at - 11.0), 0.0)
        give(vehicle, at, odom=odometry(1.0, stamp=100.0 + sent))
    motion, reason = vehicle.motion(at, "odom")
    assert motion is None
    age = "0.98 s old (repeated stamp)" if frozen else "0.49 s old (arrival and growth of delay)"
    assert reason == f"odometry is {age}, limit 0.3 s"
    assert vehicle.stamps() == ("growth only, repeated" if frozen else "growth only")


def test_with_a_shared_clock_the_age_is_that_of_the_stamp() -> None:
    vehicle, at, now = state(WireStub(), clock="shared"), time.monotonic(), time.time()
    give(vehicle, at, odom=odometry(1.0, stamp=now - 0.2))
    assert vehicle.motion(at, "odom")[1] == ""
    assert vehicle.late(at) == pytest.approx(0.2 + SYNCHRONY, abs=0.01)
    give(vehicle, at, odom=odometry(1.0, stamp=now - 5.0))
    assert "s old (stamp), limit 0.3 s" in vehicle.motion(at, "odom")[1]


def test_without_stamps_the_declared_latency_is_added() -> None:
    vehicle = state(WireStub(), max_latency=0.4)
    give(vehicle, 10.0, odom=odometry(1.0, stamp=0.0))
    assert vehicle.late(10.1) == pytest.approx(0.5)
    assert vehicle.stamps() == "none"
