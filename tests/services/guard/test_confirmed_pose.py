"""Pose that an operator confirms after a jump: base at rest, pose close to that of odometry."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from slopewise.services.guard.core import Guard
from slopewise.services.guard.decide import BaseCommand, GuardDecision, VehicleMotion
from slopewise.services.guard.stop_courses import Pose2d
from slopewise.services.guard.worker import hand_over
from slopewise.services.guard.zenoh_transport import GuardConfirm, ZenohTransport
from slopewise.services.ros.inbox import Inbox, Received
from slopewise.services.wire import codec
from slopewise.services.wire.codec import Format
from tests.services.guard.guard_fixtures import ground_with, guard

PERIOD = 0.05
JUMP, REST = 1.0, 2.0
"""Moments of a jump of the pose by 5 m, and from which the base stands [s]."""


def drive(
    it: Guard,
    begin: float,
    end: float,
    x: Callable[[float], float] = lambda now: 5.0,
    speed: Callable[[float], float] = lambda now: 0.0,
) -> list[GuardDecision]:
    """Decisions while odometry reports a place and a speed; places differ by noise."""
    decisions = []
    for k in range(round(begin / PERIOD), round(end / PERIOD)):
        now = PERIOD * k
        pose = Pose2d(x(now) + 1e-4 * (k % 7), 0.0, 0.0)
        it.move(VehicleMotion(pose, speed(now)), now, "r", k + 1, now)
        it.commands.take((BaseCommand(1.0, 0.0), k), now, "p", k, now)
        decisions.append(it.decision(now))
    return decisions


def jumped(**changes: Any) -> Guard:
    """A guard of a base that drove 1 m/s until its pose jumped, and stands since."""
    it = guard(**changes)
    drive(it, 0.0, JUMP, lambda now: now, lambda now: 1.0)
    stops = drive(it, JUMP, REST, lambda now: 5.0 + now, lambda now: 2.0 - now)
    assert {stop.action for stop in stops} == {"stop"}
    return it


def test_pose_that_stays_is_never_trusted_for_its_rest_alone() -> None:
    """A pose that is wrong by 5 m stands as still as one that is right."""
    it = jumped()
    stops = drive(it, REST, 90.0, lambda now: 7.0)
    assert {(stop.action, stop.reason[:15]) for stop in stops} == {("stop", "the pose jumped")}


def test_base_at_rest_continues_from_the_pose_that_is_confirmed() -> None:
    """Ahead of a drop it still stops: decisions count from the new pose."""
    it = jumped(known=ground_with(-3.0, first=120))  # a drop from x = 10 m on
    drive(it, REST, REST + 2.9, lambda now: 7.0)
    pose = Pose2d(7.3, 0.1, 0.05)
    assert not it.confirm(pose, REST + 2.9, "anna", 1)
    wait = "the pose confirmed by anna was refused: the base has to stand for 3 s before"
    assert wait in it.warnings(REST + 2.9)
    assert {d.action for d in drive(it, REST + 2.9, REST + 3.2, lambda now: 7.0)} == {"stop"}
    assert it.confirm(pose, REST + 3.2, "anna", 2)
    assert "the pose confirmed by anna is the reference now" in it.warnings(REST + 3.2)
    assert {d.action for d in drive(it, REST + 3.2, REST + 4.0, lambda now: 7.0)} == {"pass"}
    near = drive(it, REST + 4.0, REST + 6.0, lambda now: now + 1.0, lambda now: 1.0)
    assert near[-1].action == "stop"
    assert "a step at a wheel" in near[-1].reason
    assert drive(it, REST + 6.0, REST + 6.1, lambda now: -9.0)[-1].reason.startswith("the pose jum")


@pytest.mark.parametrize(
    ("x", "speed", "confirmed", "objection"),
    [
        (lambda now: 7.0, lambda now: 0.0, 2.0, "it is 5.0 m from that of odometry"),
        (lambda now: 7.0, lambda now: 0.0, float("nan"), "it is nan m from that of odometry"),
        (lambda now: 7.0, lambda now: 0.12, 7.0, "the base has to stand for 3 s before"),
        (lambda now: 7.0, lambda now: 0.06, 7.0, "the base has to stand for 3 s before"),
        (lambda now: 7.0 + 0.7 * (now % 2.0), lambda now: 0.0, 7.6, "the base has to stand"),
        (lambda now: 5.0 + 0.4 * now, lambda now: 0.0, 9.4, "the base has to stand for 3 s"),
    ],
    ids=["elsewhere", "nan", "rolls", "creeps", "swings", "slides"],
)
def test_what_is_no_rest_and_no_such_pose_is_not_confirmed(
    x: Callable[[float], float], speed: Callable[[float], float], confirmed: float, objection: str
) -> None:
    it, end = jumped(), 11.0
    drive(it, REST, end, x, speed)
    assert not it.confirm(Pose2d(confirmed, 0.0, 0.0), end - PERIOD, "anna", 1)
    assert any(f"refused: {objection}" in text for text in it.warnings(end - PERIOD))
    assert drive(it, end, end + 0.1, x, speed)[-1].action == "stop"


def test_without_odometry_and_after_a_gap_of_it_nothing_is_confirmed() -> None:
    it = jumped()
    drive(it, REST, 6.0, lambda now: 7.0)
    assert not it.confirm(Pose2d(7.0, 0.0, 0.0), 6.5, "anna", 1)
    assert any("refused: odometry is 0.55 s old" in text for text in it.warnings(6.5))
    drive(it, 6.6, 7.0, lambda now: 7.0)
    assert not it.confirm(Pose2d(7.0, 0.0, 0.0), 7.0, "anna", 2)


@pytest.mark.parametrize(
    ("sender", "number", "stamp", "objection"),
    [
        ("anna", 7, None, "its number is 7, expected one above 7"),
        ("anna", 3, 99.0, "its number is 3, expected one above 7"),
        ("bag", 1, 5.5, "it is from before the base stood here"),
        ("bag", None, 5.5, "it is from before the base stood here"),
        ("bag", 1, 7.0, "it is from before the base stood here"),
        ("anna", 8, None, ""),
        ("bag", 1, 8.0, ""),
    ],
)
def test_recorded_confirmation_does_not_count_after_the_next_jump(
    sender: str, number: int | None, stamp: float | None, objection: str
) -> None:
    """Nor one that was refused: the base had not stood for long enough."""
    it, pose = jumped(), Pose2d(17.0, 0.0, 0.0)
    drive(it, REST, 5.5, lambda now: 7.0)
    assert it.confirm(Pose2d(7.0, 0.0, 0.0), 5.5, "anna", 6, 5.5)
    drive(it, 5.5, 6.0, lambda now: 17.0)
    assert not it.confirm(pose, 6.0, "anna", 7, 6.0)
    drive(it, 6.0, 7.0, lambda now: 27.0)
    drive(it, 7.0, 10.5, lambda now: 17.0)
    assert it._jumps.fault
    assert it.confirm(pose, 10.5, sender, number, stamp) is (objection == "")
    assert (it._jumps.fault == "") is (objection == "")
    assert any(f"refused: {objection}" in text for text in it.warnings(10.5)) is (objection != "")


def test_message_of_an_operator_reaches_the_guard_and_a_broken_one_voids_nothing() -> None:
    it, inbox = jumped(), Inbox()
    drive(it, REST, 6.0, lambda now: 7.0)
    transport = ZenohTransport.__new__(ZenohTransport)
    transport.inbox, transport.topics = inbox, {"confirm": "confirm"}
    message = GuardConfirm(source="anna", sequence=1, x=7.0, y=0.0, heading=0.0)
    raw = codec.encode(message, Format.JSON)
    for bytes_, ends in ((b"{}", False), (raw, True)):
        hand_over(it, transport, {"confirm": [Received(bytes_, 6.0)]})
        assert (it._jumps.fault == "") is ends
    assert "source" in inbox.refused["confirm"]
    assert drive(it, 6.0, 6.1, lambda now: 7.0)[-1].action == "pass"
