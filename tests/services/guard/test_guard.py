"""Decisions on sequences of messages: ages, stamps, clear distances, learned brakes."""

from __future__ import annotations

from pathlib import Path

import pytest

from slopewise.services.guard.core import Guard
from slopewise.services.guard.decide import BaseCommand
from slopewise.services.guard.overspeed_monitor import OverspeedMonitor
from slopewise.services.guard.settings import GuardSettings, read_guard_settings
from slopewise.services.guard.zenoh_transport import GuardCommand, GuardMotion
from slopewise.services.wire import codec
from slopewise.services.wire.codec import Format
from tests.services.faults import fault_in
from tests.services.guard.guard_fixtures import WALL_TIME, braking_group, feed, guard, motion


def test_missing_input_is_a_stop_that_lasts_until_rest() -> None:
    it = guard()
    assert it.decision(0.0).reason == "no odometry"
    it = guard()
    feed(it, 1.0, speed=0.0)
    assert it.decision(1.01).action == "pass"
    feed(it, 1.1)
    it.commands.drop()
    assert it.decision(1.11).reason == "no command"
    feed(it, 1.2)
    assert it.decision(1.21).action == "stop"  # it still moves
    assert "moves while it is commanded to stand" in it.warnings(1.21)[-1]
    feed(it, 1.3, speed=0.0)
    assert it.decision(1.31).action == "pass"
    assert it.decision(1.52).reason == "odometry is 0.22 s old (arrival), limit 0.2 s"
    assert it.decision(1.52, "broken").reason == "broken"


def test_repeated_and_late_commands_are_ignored_and_counted() -> None:
    it = guard()
    feed(it, 1.0, number=5)
    assert not it.commands.take((BaseCommand(4.0, 0.0), 5), 1.05, "p", 5)
    assert not it.commands.take((BaseCommand(4.0, 0.0), 3), 1.05, "p", 3)
    assert it.commands.take((BaseCommand(0.5, 0.0), 9), 1.05, "p", 9)
    assert it.counters["command lost"] == 3
    assert it.counters["command repeated or late"] == 2
    assert it.decision(1.06).of == 9
    assert it.commands.take((BaseCommand(0.5, 0.0), 1), 3.0, "p", 1)  # restarted after a silence


def test_clear_distance_shrinks_with_the_distance_driven() -> None:
    it = guard(awaits_clear=True)
    feed(it, 1.0, speed=0.0)
    assert it.decision(1.0).reason == "no clear distance"
    assert it.clear(4.0, 1.0, "s", 1)
    assert it.decision(1.01).action == "pass"
    it.motions.take(motion(3.0), 1.4, "r", 2000)
    it.commands.take((BaseCommand(1.0, 0.0), 2000), 1.4, "p", 2000)
    assert it.decision(1.41).reason == "the clear distance ends 2.65 m ahead"
    assert not any(it.clear(wrong, 1.42, "s", 2) for wrong in (float("nan"), -0.1))


def test_clear_distance_shrinks_with_the_speed_that_was_measured_since() -> None:
    """From 3 m/s to 1 at 5 m/s², long after the command: what was driven is not at 1 m/s."""
    clock = [1.0]
    it = guard(clock, awaits_clear=True, clock="shared", reserve=0.0)
    x, at_clear = 0.0, 0.0
    for k in range(1, 21):
        clock[0] = now = 1.0 + 0.05 * k
        speed = min(3.0, max(3.0 - 5.0 * (now - 1.6), 1.0))
        x += 0.05 * speed
        it.move(motion(speed, x), now, "r", k, WALL_TIME + now)
        requested = BaseCommand(4.0 if k == 20 else 1.0, 0.0)
        it.commands.take((requested, k), now, "p", k, WALL_TIME + now)
        if now < 1.61:
            at_clear = x
            it.clear(4.0, now, "r", k, WALL_TIME + now)
        decided = it.decision(now)
    assert decided.reason.startswith("the clear distance ends")
    assert float(decided.reason.split()[4]) <= 4.0 - (x - at_clear)


def allowed_speed(clear: float, late: float, reserve: float = 0.15) -> float:
    """Speed that is given at 2 m/s with a clear distance that was measured earlier."""
    clock = [1.0]
    it = guard(clock, awaits_clear=True, clock="shared", clear=1.0, reserve=reserve)
    it.motions.take(motion(2.0), 1.0, "r", 1, WALL_TIME + 1.0)
    it.clear(clear, 1.0, "r", 1, WALL_TIME + 1.0 - late)
    it.commands.take((BaseCommand(4.0, 0.0), 1), 1.0, "p", 1, WALL_TIME + 1.0)
    return it.decision(1.0).command.speed


def test_clear_distance_counts_from_the_position_at_its_stamp() -> None:
    """At 2 m/s, odometry of now and a distance measured 0.4 s ago: 0.8 m of it are driven."""
    assert allowed_speed(3.6, 0.4) == pytest.approx(allowed_speed(2.8, 0.0), abs=1e-6)
    assert allowed_speed(3.6, 0.4) < allowed_speed(3.6, 0.0)


def test_reserve_shortens_the_clear_distance() -> None:
    assert allowed_speed(2.8, 0.0) == pytest.approx(allowed_speed(2.65, 0.0, reserve=0.0), abs=1e-6)


def test_base_holds_at_rest() -> None:
    it = guard()
    feed(it, 1.0, speed=0.0, requested=0.0)
    decision = it.decision(1.0)
    assert (decision.action, decision.brake) == ("pass", True)


def test_base_that_is_faster_than_commanded_is_stopped() -> None:
    it = guard(command=0.5, motion=0.5)
    feed(it, 0.0, speed=0.0)
    for k in range(1, 60):
        feed(it, 0.05 * k, speed=2.5)
        decision = it.decision(0.05 * k)
    assert decision.action == "stop"
    assert "m/s faster than commanded" in decision.reason


def test_brakes_have_their_time_before_overspeed() -> None:
    monitor = OverspeedMonitor(dead_time=0.3, decel=1.0)
    for k in range(200):
        now = 0.05 * k
        monitor.set_limit(3.0 if k < 100 else 1.0, now)
        speed = 3.0 if k < 108 else max(3.0 - 1.05 * 0.05 * (k - 108), 1.0)
        assert monitor.overspeed(speed, now) == 0.0


def test_learned_brakes_make_stops_longer_and_only_shorter_if_trusted() -> None:
    for trusted in (False, True):
        speeds = {}
        for b_b in (0.25, 0.40, 0.60):
            it = guard(awaits_clear=True, trust_learned=trusted)
            it.learned.take(braking_group(b_b=b_b))
            it.learned.take(braking_group(b_b=float("nan")))
            it.learn()
            feed(it, 1.0, speed=0.0, requested=4.0)
            it.clear(4.0, 1.0, "s", 1)
            speeds[b_b] = it.decision(1.0).command.speed
        assert speeds[0.25] < speeds[0.40]
        assert (speeds[0.60] > speeds[0.40]) == trusted


# ---------------------------------------------------------------- stamps and delay


def last_reason(it: Guard, clock: list[float], stamps: list[float | None]) -> str:
    """Reason of the last decision, with messages 0.02 s apart."""
    for k, stamp in enumerate(stamps):
        clock[0] = 0.02 * k
        feed(it, clock[0], 2.0, 2.0, k + 1, stamp)
        it.clear(30.0, clock[0], "r", k + 1, stamp)
    return it.decision(clock[0]).reason


@pytest.mark.parametrize(
    ("settings", "stamp", "count", "reason", "warning"),
    [
        (
            {"clock": "shared"},
            lambda t: WALL_TIME + t - 0.83,
            10,
            "odometry is 0.83 s old (stamp), limit 0.3 s",
            "odometry arrives 0.83 s late",
        ),
        (
            {},
            lambda t: 7.0 + t - max(0.5 * (t - 1.0), 0.0),
            100,
            "odometry is 0.49 s old (arrival and growth of delay), limit 0.3 s",
            "odometry arrives 0.49 s late",
        ),
        (
            {"command": 1.0, "clear": 1.0},
            lambda t: 7.0 + min(t, 1.0),
            80,
            "odometry is 0.58 s old (repeated stamp), limit 0.3 s",
            "stamps of odometry are repeated",
        ),
        (
            {"clock": "shared"},
            lambda t: WALL_TIME + t + (5.0 if t > 1.0 else 0.0),
            60,
            "odometry rejected: stamp: expected a time that has been, got 5.00 s later than the "
            "clock here",
            "odometry rejected: stamp",
        ),
        (
            {},
            lambda t: 70.0 + t - (5.0 if t > 1.0 else 0.0),
            60,
            "",
            "the clock that stamps odometry was set",
        ),
    ],
    ids=["old", "growing", "repeated", "future", "clock set"],
)
def test_stamps_that_are_late_repeated_or_set_are_reported(
    settings: dict[str, object], stamp: object, count: int, reason: str, warning: str
) -> None:
    clock = [0.0]
    it = guard(clock, awaits_clear=True, **({"motion": 0.3} | settings))
    assert last_reason(it, clock, [stamp(0.02 * k) for k in range(count)]) == reason  # type: ignore[operator]
    assert any(text.startswith(warning) for text in it.warnings(clock[0]))
    shown = "shared clock" if "clock" in settings else "growth only"
    assert it.stamps()["odometry"] == shown


@pytest.mark.parametrize("kind", ["late", "future", "unusable"])
def test_clear_distance_that_cannot_be_used_never_frees_the_path(kind: str) -> None:
    """Not required, it bounds the path from the first one on, until none has come for its age."""
    clock = [0.0]
    it = guard(clock, clock="shared")
    for k in range(100):
        clock[0] = now = 0.02 * k
        feed(it, now, 0.0, 2.0, k + 1, WALL_TIME + now)
        distance, stamp = 0.5, WALL_TIME + now
        if k >= 50:
            distance = -1.0 if kind == "unusable" else distance
            stamp += {"late": -0.83, "future": 3.0}.get(kind, 0.0)
        it.clear(distance, now, "c", k, stamp)
        assert it.decision(now).command.speed < 0.5, k
    decision = it.decision(now)
    assert decision.action == "stop"
    assert "clear distance" in decision.reason
    clock[0] = later = now + it.settings.timing.clear + 0.02
    feed(it, later, 0.0, 2.0, 101, WALL_TIME + later)
    assert it.decision(later).action == "pass"


def test_without_stamps_the_declared_latency_is_added() -> None:
    clock, speeds = [0.0], []
    for latency in (0.0, 0.2, 0.5):
        it = guard(clock, max_latency=latency)
        feed(it, 0.0, 0.0, 4.0, 1)
        it.clear(4.0, 0.0, "r", 1)
        speeds.append(it.decision(0.0).command.speed)
    assert speeds[0] > speeds[1] > speeds[2]
    assert it.stamps() == {"command": "none", "odometry": "none", "clear distance": "none"}
    assert "odometry has no stamps: its delay is taken as 0.5 s" in it.warnings(0.0)
    assert it.ages(0.5) == {"command": 0.5, "odometry": 0.5, "clear distance": 0.5, "map": 0.5}


def test_sender_that_is_renamed_is_as_late_as_before() -> None:
    clock = [0.0]
    it, ages = guard(clock, motion=0.2), []
    for k in range(900):
        sent = 0.02 * k
        now = clock[0] = sent + min(max(0.25 * (sent - 2.0), 0.0), 0.5)
        it.motions.take(motion(0.0), now, "a" if k < 300 else "b", k, 7.0 + sent)
        ages.append(it.motions.newest.age(now))
    assert ages[299] == pytest.approx(0.5, abs=0.002)
    assert ages[300] == pytest.approx(0.5, abs=0.002)
    assert ages[500] > 0.2
    assert ages[-1] < 0.01


# ---------------------------------------------------------------- messages and settings


def test_messages_without_a_stamp_are_read() -> None:
    old = b'{"source": "r", "sequence": 1, "x": 0.0, "y": 0.0, "heading": 0.0, "speed": 1.0}'
    encoding = codec.encoding_of(GuardMotion, Format.JSON)
    assert codec.decode(GuardMotion, old, encoding, "motion", 4000).time is None
    command = GuardCommand(source="p", sequence=2, speed=1.0, yaw_rate=0.0, time=3.5)
    raw = codec.encode(command, Format.MESSAGEPACK)
    encoding = codec.encoding_of(GuardCommand, Format.MESSAGEPACK)
    assert codec.decode(GuardCommand, raw, encoding, "command", 4000) == command


def test_shipped_settings_are_the_defaults() -> None:
    shipped = Path(__file__).parents[3] / "configs" / "guard.toml"
    assert read_guard_settings(shipped) == GuardSettings(model="atv")


@pytest.mark.parametrize(
    ("text", "field", "fact"),
    [
        ("", "model", "expected"),
        ("model = 'atv'\n[timing]\ncommand = 3.0\n", "timing.command", "<= 1"),
        ("model = 'atv'\n[ros]\noutput = 'cmd_vel_nav'\n", "ros.output", "another topic"),
        ("model = 'atv'\n[zenoh]\nmode = 'router'\n", "zenoh.mode", "client"),
        (
            "model = 'atv'\n[zenoh]\nmode = 'peer'\nlisten = ['tcp/127.0.0.1:7448']\n",
            "zenoh.listen",
            "two processes",
        ),
        ("model = 'atv'\n[judge]\n", "judge", "unknown key"),
    ],
)
def test_settings_that_cannot_be_used_are_named(
    tmp_path: Path, text: str, field: str, fact: str
) -> None:
    file = tmp_path / "guard.toml"
    file.write_text(text)
    with fault_in(file, field, fact):
        read_guard_settings(file)
