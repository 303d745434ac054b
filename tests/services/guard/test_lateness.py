"""Late, frozen and wrongly stamped messages behind the guard, and drives toward a wall with it."""

from __future__ import annotations

import itertools
from collections import Counter

import pytest

from slopewise.services.guard.arc import PlanarPose
from slopewise.services.guard.core import Guard
from slopewise.services.guard.decide import BaseCommand, GuardScene, VehicleMotion, decide
from slopewise.services.guard.messages import GuardCommand, GuardMotion
from slopewise.services.guard.model_reader import rows_of
from slopewise.services.guard.settings import GuardJudgement, GuardSettings, GuardTiming
from slopewise.services.wire import codec
from slopewise.services.wire.codec import Format
from slopewise.services.wire.lateness import WallClock
from tests.services.guard.late_drives import CONTACT, MODEL, Outcome, Scene, drive, scenes
from tests.services.guard.test_decide import FLAT

WALL = 1.7e9


def guard_with(now: list[float], *, awaits_clear: bool = True, **timing: object) -> Guard:
    settings = GuardSettings(
        model="atv",
        timing=GuardTiming(**timing),  # type: ignore[arg-type]
        judgement=GuardJudgement(awaits_clear=awaits_clear),
    )
    return Guard(settings, MODEL, FLAT, WallClock(lambda: WALL + now[0], lambda: now[0]))


def feed(it: Guard, now: float, number: int, time: float | None, speed: float = 2.0) -> None:
    here = VehicleMotion(PlanarPose(0.0, 0.0, 0.0), speed)
    it.motions.take(here, now, "r", number, time)
    it.clear(30.0, now, "r", number, time)
    it.commands.take((BaseCommand(2.0, 0.0), number), now, "p", number, time)


def last_of(it: Guard, clock: list[float], times: list[float | None]) -> str:
    """The reason of the last word, with messages 0.02 s apart."""
    for k, time in enumerate(times):
        clock[0] = 0.02 * k
        feed(it, clock[0], k + 1, time)
    return it.word(clock[0]).decision.reason


def test_old_odometry_is_refused_with_its_age_by_the_stamp() -> None:
    clock = [0.0]
    it = guard_with(clock, clock="shared", motion=0.3)
    reason = last_of(it, clock, [WALL + 0.02 * k - 0.83 for k in range(10)])
    assert reason == "odometry is 0.83 s old (stamp), limit 0.3 s"
    assert it.stamps()["odometry"] == "shared clock"
    assert "odometry arrives 0.83 s late" in it.flags(clock[0])


@pytest.mark.parametrize("kind", ["late", "future", "unusable"])
def test_a_clear_distance_that_arrives_but_cannot_be_used_never_frees_the_way(kind: str) -> None:
    """Not awaited, it bounds the way from the first one on, until none has come for its age."""
    clock = [0.0]
    it = guard_with(clock, clock="shared", awaits_clear=False)
    for k in range(100):
        clock[0] = now = 0.02 * k
        it.motions.take(VehicleMotion(PlanarPose(0.0, 0.0, 0.0), 0.0), now, "r", k, WALL + now)
        it.commands.take((BaseCommand(2.0, 0.0), k), now, "p", k, WALL + now)
        distance, stamp = 0.5, WALL + now
        if k >= 50:
            distance = -1.0 if kind == "unusable" else distance
            stamp += {"late": -0.83, "future": 3.0}.get(kind, 0.0)
        it.clear(distance, now, "c", k, stamp)
        assert it.word(now).decision.command.speed < 0.5, k
    decision = it.word(now).decision
    assert decision.action == "stop"
    assert "clear distance" in decision.reason
    later = now + it.settings.timing.clear + 0.02
    it.motions.take(VehicleMotion(PlanarPose(0.0, 0.0, 0.0), 0.0), later, "r", 100, WALL + later)
    it.commands.take((BaseCommand(2.0, 0.0), 100), later, "p", 100, WALL + later)
    clock[0] = later
    assert it.word(later).decision.action == "pass"


def test_growth_counts_where_no_clock_is_shared() -> None:
    clock = [0.0]
    it = guard_with(clock, motion=0.3)
    reason = last_of(it, clock, [7.0 + 0.02 * k - max(0.01 * (k - 50), 0.0) for k in range(100)])
    assert reason == "odometry is 0.49 s old (arrival and growth of delay), limit 0.3 s"
    assert it.stamps()["odometry"] == "growth only"


def test_stamps_that_repeat_do_not_refresh() -> None:
    clock = [0.0]
    it = guard_with(clock, motion=0.3, command=1.0, clear=1.0)
    reason = last_of(it, clock, [7.0 + 0.02 * min(k, 50) for k in range(80)])
    assert reason == "odometry is 0.58 s old (repeated stamp), limit 0.3 s"
    assert "stamps of odometry are repeated" in it.flags(clock[0])


def test_stamps_of_the_future_and_clocks_that_are_set_are_reported() -> None:
    clock = [0.0]
    it = guard_with(clock, clock="shared")
    reason = last_of(it, clock, [WALL + 0.02 * k + (5.0 if k > 50 else 0.0) for k in range(60)])
    assert reason.startswith("odometry rejected: stamp: expected a time that has been, got 5.00 s")
    assert reason in it.flags(clock[0])
    it = guard_with(clock)
    assert last_of(it, clock, [70.0 + 0.02 * k - (5.0 if k > 50 else 0.0) for k in range(60)]) == ""
    assert "the clock that stamps odometry was set" in it.flags(clock[0])


def test_without_stamps_the_declared_latency_is_all_there_is() -> None:
    clock, allowed = [0.0], {}
    for latency in (0.0, 0.2, 0.5):
        it = guard_with(clock, max_latency=latency)
        here = VehicleMotion(PlanarPose(0.0, 0.0, 0.0), 0.0)
        it.motions.take(here, 0.0, "r", 1)
        it.clear(4.0, 0.0, "r", 1)
        it.commands.take((BaseCommand(4.0, 0.0), 1), 0.0, "p", 1)
        allowed[latency] = it.word(0.0).decision.command.speed
    assert allowed[0.0] > allowed[0.2] > allowed[0.5]
    assert it.stamps() == {"command": "none", "odometry": "none", "clear distance": "none"}
    assert "odometry has no stamps: its delay is taken as 0.5 s" in it.flags(0.0)


def test_a_clear_distance_is_counted_from_where_it_was_measured() -> None:
    """At 2 m/s, odometry of now and a clear distance measured 0.4 s ago: 0.8 m of it are gone."""
    clock, left = [1.0], []
    for late in (0.0, 0.4):
        it = guard_with(clock, clock="shared", clear=1.0)
        it.motions.take(VehicleMotion(PlanarPose(0.0, 0.0, 0.0), 2.0), 1.0, "r", 1, WALL + 1.0)
        it.clear(10.0, 1.0, "r", 1, WALL + 1.0 - late)
        motion = it.motions.fresh(1.0)
        assert motion is not None
        left.append(it._clear_now(1.0, motion, 2.0))
    assert left[0] - left[1] == pytest.approx(0.8)  # type: ignore[operator]


def test_a_vehicle_may_have_reached_what_it_was_given_since_it_was_measured() -> None:
    scene = GuardScene(MODEL, (rows_of(MODEL),), FLAT, 3.0)
    motion, command = VehicleMotion(PlanarPose(0.0, 0.0, 0.0), 1.0), BaseCommand(1.0, 0.0)
    slow = decide(scene, motion, command, stands=0.1, late=0.2, load=0.5)
    fast = decide(scene, motion, command, stands=0.1, late=0.2, load=0.5, reached=4.0)
    assert (slow.action, fast.action) == ("pass", "stop")
    back = decide(
        scene,
        motion._replace(speed=0.0),
        BaseCommand(-1.0, 0.0),
        stands=0.1,
        late=0.2,
        load=0.5,
        reached=1.0,
    )
    assert back.reason == "it has to stand before it drives back"


def test_messages_of_before_are_read() -> None:
    old = b'{"source": "r", "sequence": 1, "x": 0.0, "y": 0.0, "heading": 0.0, "speed": 1.0}'
    encoding = codec.encoding_of(GuardMotion, Format.JSON)
    assert codec.decode(GuardMotion, old, encoding, "motion", 4000).time is None
    command = GuardCommand(source="p", sequence=2, speed=1.0, yaw_rate=0.0, time=3.5)
    raw = codec.encode(command, Format.MESSAGEPACK)
    encoding = codec.encoding_of(GuardCommand, Format.MESSAGEPACK)
    assert codec.decode(GuardCommand, raw, encoding, "command", 4000) == command


def collisions(drives: list[Scene]) -> tuple[list[str], dict[tuple[str, str], list[Outcome]]]:
    """Drives that ended in the wall at speed, and all outcomes by clock and delay."""
    done: dict[tuple[str, str], list[Outcome]] = {}
    ended = []
    for scene in drives:
        outcome = drive(scene)
        done.setdefault((scene.clock, scene.kind), []).append(outcome)
        if outcome.contact > CONTACT:
            ended.append(f"{scene.seed} {scene.clock} {scene.kind}: {outcome.contact:.2f} m/s")
    return ended, done


def test_late_messages_end_no_drive_in_the_wall() -> None:
    """Constant, growing and jittering delay, frozen sensors, set clocks, lost odometry."""
    ended, done = collisions(scenes(136))
    assert not ended
    for (clock, kind), outcomes in done.items():
        moved = sum(outcome.distance > 1.0 for outcome in outcomes)
        assert moved >= len(outcomes) // 2, (clock, kind)  # a guard that never passes is no proof
    flags = {key: set().union(*(o.flags for o in outcomes)) for key, outcomes in done.items()}
    assert "stamps of odometry are repeated" in flags["unknown", "repeated"]
    assert "the clock that stamps odometry was set" in flags["unknown", "step"]
    assert any("s late" in flag for flag in flags["unknown", "growing"])
    assert any("has no stamps" in flag for flag in flags["none", "constant"])


@pytest.mark.nightly
def test_late_messages_end_none_of_a_thousand_drives_in_the_wall() -> None:
    ended, done = collisions(scenes(1000))
    actions = Counter(itertools.chain.from_iterable(o.actions for f in done.values() for o in f))
    print(f"{len(ended)} collisions in {sum(map(len, done.values()))} drives, {dict(actions)}")
    assert not ended


def test_a_planner_that_brakes_by_itself_loses_no_time() -> None:
    """Without delay, in the default settings: the mean speed with the latency and without it."""
    speeds = []
    for latency in (0.0, 0.2):
        outcomes = [
            drive(Scene(n, "unknown", "constant", no_delay=True, slows=True, max_latency=latency))
            for n in range(12)
        ]
        speeds.append(sum(o.distance for o in outcomes) / sum(o.moving_time for o in outcomes))
    assert speeds[1] == pytest.approx(speeds[0], rel=0.01)


def test_a_sender_that_is_renamed_is_as_late_as_before() -> None:
    clock = [0.0]
    it, ages = guard_with(clock, motion=0.2), []
    here = VehicleMotion(PlanarPose(0.0, 0.0, 0.0), 0.0)
    for k in range(900):
        sent = 0.02 * k
        now = clock[0] = sent + min(max(0.25 * (sent - 2.0), 0.0), 0.5)
        it.motions.take(here, now, "a" if k < 300 else "b", k, 7.0 + sent)
        ages.append(it.motions.age(now))
    assert ages[299] == pytest.approx(0.5, abs=0.002)
    assert ages[300] == pytest.approx(0.5, abs=0.002)
    assert ages[500] > 0.2
    assert ages[-1] < 0.01
