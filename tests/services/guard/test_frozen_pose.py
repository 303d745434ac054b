"""Poses that do not change although the base moves, and stops of a base that turns."""

from __future__ import annotations

from slopewise.services.guard.core import Guard
from slopewise.services.guard.decide import BaseCommand, GuardDecision, VehicleMotion
from slopewise.services.guard.stop_courses import Pose2d
from tests.services.guard.guard_fixtures import guard


def decided(it: Guard, now: float, x: float, speed: float, yaw_rate: float = 0.0) -> GuardDecision:
    """Decision on 1 m/s, or on a turn on the spot, with new odometry of a moment."""
    number = round(1000 * now)
    it.move(VehicleMotion(Pose2d(x, 0.0, 0.0), speed, yaw_rate), now, "r", number)
    command = BaseCommand(0.0, 0.5) if yaw_rate else BaseCommand(1.0, 0.0)
    it.commands.take((command, number), now, "p", number)
    return it.decision(now)


def actions(it: Guard, x: list[float], speed: float, yaw_rate: float = 0.0) -> list[str]:
    """Actions for poses that come every 60 ms."""
    return [decided(it, 1.0 + 0.06 * k, place, speed, yaw_rate).action for k, place in enumerate(x)]


def test_pose_that_does_not_change_while_the_base_moves_is_a_stop() -> None:
    """After the deadline of 0.2 s, and until the pose changes; at rest it need not change."""
    for speed, yaw_rate in ((1.0, 0.0), (0.0, 0.5)):
        it = guard()
        got = actions(it, [0.0, 0.05, 0.1, *[0.15] * 8], speed, yaw_rate)
        assert got == ["pass"] * 7 + ["stop"] * 4
        assert it.last == "the base moves, and its pose has not changed for 0.24 s"
        assert decided(it, 1.7, 0.15, 0.0).action == "stop"  # it is not where its pose says
        assert decided(it, 1.75, 0.3, 0.0).action == "pass"
    assert set(actions(guard(), [0.0] * 20, 0.0)) == {"pass"}


def test_pose_that_is_repeated_makes_stops_longer() -> None:
    it = guard(awaits_clear=True, motion=1.0)
    allowed = []
    for k in range(12):
        now = 1.0 + 0.05 * k
        it.clear(4.0, now, "s", k + 1)
        allowed.append(decided(it, now, 0.0, 1.0).command.speed)
    assert allowed[0] == 1.0
    assert allowed == sorted(allowed, reverse=True)


def test_emergency_stop_of_a_base_that_turns_lasts_until_rest() -> None:
    it = guard()
    assert decided(it, 1.0, 0.0, 0.0, 0.5).action == "pass"
    it.commands.drop()
    assert it.decision(1.01).reason == "no command"
    assert decided(it, 1.05, 0.01, 0.0, 0.5).reason == "no command"
    assert decided(it, 1.1, 0.02, 0.0).action == "pass"


def test_pose_that_freezes_during_a_stop_is_old_at_rest() -> None:
    it = guard()
    assert decided(it, 1.0, 0.0, 0.0, 0.5).action == "pass"
    it.commands.drop()
    it.decision(1.01)
    reasons = [decided(it, 1.05 + 0.05 * k, 0.01, 0.0, 0.5).reason for k in range(4)]
    assert reasons == ["no command"] * 4
    for k in range(10):
        at_rest = decided(it, 1.25 + 0.05 * k, 0.01, 0.0)
    assert at_rest.reason.startswith("the base moves, and its pose has not changed")
    assert decided(it, 1.8, 0.02, 0.0).action == "pass"
