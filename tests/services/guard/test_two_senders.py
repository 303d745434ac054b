"""Two senders on one key, and poses that the motion of the base does not explain."""

from __future__ import annotations

import math

import numpy as np
import pytest

from slopewise.services.guard.core import Guard
from slopewise.services.guard.decide import BaseCommand, GuardDecision, VehicleMotion
from slopewise.services.guard.stop_courses import Pose2d
from tests.services.guard.guard_fixtures import guard

PERIOD = 0.02


def send(it: Guard, now: float, sender: str, motion: VehicleMotion, *, stamped: bool) -> None:
    number = round(1e4 * now)
    it.move(motion, now, sender, number, now if stamped else None)


def decided(it: Guard, now: float) -> GuardDecision:
    it.commands.take((BaseCommand(1.0, 0.0), round(1e4 * now)), now, "p", round(1e4 * now))
    return it.decision(now)


def driving(x: float, heading: float = 0.0, speed: float = 1.0) -> VehicleMotion:
    return VehicleMotion(Pose2d(x, 0.0, heading), speed)


@pytest.mark.parametrize("stamped", [True, False])
@pytest.mark.parametrize("every", [1, 7])
def test_second_sender_of_odometry_is_a_stop_until_one_is_silent(stamped: bool, every: int) -> None:
    """At the same rate, and at 7 Hz; after 1 s it is gone."""
    it, actions = guard(), []
    for k in range(100):
        now = 1.0 + PERIOD * k
        send(it, now, "robot", driving(1e-6 * k, speed=0.0), stamped=stamped)
        if 25 <= k < 75 and k % every == 0:
            send(it, now + 1e-3, "parked", driving(-5.0, speed=0.0), stamped=stamped)
        actions.append(decided(it, now + 2e-3).action)
        if k == 60:
            assert it.last == "odometry comes from two senders, parked and robot"
            assert it.last in it.warnings(now)
    begin = next(k for k in range(25, 75) if k % every == 0)
    assert actions[:begin] == ["pass"] * begin
    assert set(actions[begin:75]) == {"stop"}
    assert set(actions[87:]) == {"pass"}


def test_new_sender_after_a_silence_is_accepted() -> None:
    it = guard()
    send(it, 1.0, "a", driving(0.0), stamped=True)
    assert decided(it, 1.0).action == "pass"
    send(it, 1.25, "b", driving(0.25), stamped=True)
    assert decided(it, 1.25).action == "pass"


def test_two_senders_of_commands_are_reported() -> None:
    it = guard()
    for k in range(6):
        now = 1.0 + PERIOD * k
        send(it, now, "robot", driving(PERIOD * k), stamped=False)
        it.commands.take((BaseCommand(1.0, 0.0), k), now, "ab"[k % 2], k)
    assert it.decision(1.11).action == "pass"
    assert "command comes from two senders, a and b" in it.warnings(1.11)


@pytest.mark.parametrize(
    ("x", "heading", "fault"),
    [(0.3, 0.0, ""), (-0.3, 0.05, ""), (-8.0, 0.0, "8.0 m"), (0.0, math.pi, "2.")],
)
def test_pose_that_jumps_is_a_stop_until_it_is_back(x: float, heading: float, fault: str) -> None:
    """Corrections of decimetres pass; 8 m and a reversed heading are a stop until 0.2 s after."""
    it, actions = guard(), []
    for k in range(80):
        now, is_away = 1.0 + PERIOD * k, 20 <= k < 60
        place = PERIOD * min(k, 20) + (x if is_away else 0.0)  # it obeys in an instant
        pose = driving(place, heading if is_away else 0.0, 1.0 if k < 20 else 0.0)
        send(it, now, "robot", pose, stamped=True)
        actions.append(decided(it, now).action)
    assert actions[:20] == ["pass"] * 20
    assert actions[20:69] == ["stop" if fault else "pass"] * 49
    assert actions[71:] == ["pass"] * 9
    if fault:
        assert it.last.startswith(f"the pose jumped by {fault}")


@pytest.mark.parametrize("seed", range(12))
def test_pose_counts_again_where_the_base_has_driven_to_since_the_jump(seed: int) -> None:
    """A stop from up to 4 m/s in a turn, slip by 5 %; 1.5 m from there it lasts."""
    rng = np.random.default_rng(seed)
    it, speed, rate = guard(), rng.uniform(-4.0, 4.0), rng.uniform(-1.0, 1.0)
    slip, error = 1.0 + rng.uniform(-0.05, 0.05), 2.5 * np.exp(1j * rng.uniform(0.0, 7.0))
    place, heading, faults = 0j, 0.0, []
    for k in range(300):
        now, share = 1.0 + PERIOD * k, np.clip((120 - k) / 80.0, 0.0, 1.0)
        heading += share * rate * PERIOD
        place += share * speed * PERIOD * np.exp(1j * heading)
        away = error if 40 <= k < 200 else (0.6 * error if seed % 2 and k >= 200 else 0.0)
        pose = Pose2d((place + away).real, (place + away).imag, heading)
        reported = VehicleMotion(pose, slip * share * speed, slip * share * rate)
        send(it, now, "robot", reported, stamped=True)
        faults.append(bool(it._jumps.fault))
    assert faults[:209] == [False] * 40 + [True] * 169
    assert faults[211:] == [bool(seed % 2)] * 89


def test_two_senders_of_one_name_are_one_too_many() -> None:
    """Numbers far behind, or close to those of the other; repeated messages are neither."""
    for first, conflict in ((1, True), (995, True), (None, False)):
        it, it_repeated = guard(), []
        for k in range(40):
            now = 1.0 + PERIOD * k
            motion = driving(PERIOD * k)
            it.move(motion, now, "r", 1000 + k, now)
            it_repeated.append((motion, 1000 + k, now))
            if first is None:
                for late in (k, max(k - 7, 0)):
                    same, number, stamp = it_repeated[late]
                    it.move(same, now + 1e-3, "r", number, stamp)
            elif k >= 20:
                it.move(driving(-5.0, speed=0.0), now + 1e-3, "r", first + k, now)
            decision = decided(it, now + 2e-3)
        assert (decision.action == "stop") is conflict
        assert (it.last == "odometry comes from two senders, r and r") is conflict
        assert decided(it, now + 0.15).action == ("stop" if conflict else "pass")


@pytest.mark.parametrize("seed", range(8))
def test_motion_of_a_base_is_never_a_jump(seed: int) -> None:
    """Turns with and without yaw rates, jitter, lost messages, a slow localisation, set clocks."""
    rng = np.random.default_rng(seed)
    it = guard(jump=0.2, motion=0.5)
    speed, rate = rng.uniform(-4.0, 4.0), rng.uniform(-1.0, 1.0)
    reports_rate, repeats, offset = seed % 2, rng.integers(1, 6), 0.0
    pose = Pose2d(0.0, 0.0, 0.0)
    for k in range(400):
        now = 1.0 + PERIOD * k
        offset += rng.choice([0.0, 0.0, 0.0, 3.0, -2.0]) if k % 100 == 99 else 0.0
        it._given.append((now, BaseCommand(speed, rate)))
        if k % repeats == 0:
            angle = rate * PERIOD * k
            along = np.sinc(angle / (2.0 * np.pi)) * speed * PERIOD * k
            pose = Pose2d(along * np.cos(angle / 2), along * np.sin(angle / 2), angle)
        if rng.random() < 0.2:
            continue
        motion = VehicleMotion(pose, speed, rate * reports_rate)
        it.move(motion, now + rng.uniform(0.0, 0.015), "r", k, now + offset)
        assert it._jumps.fault == "", k
