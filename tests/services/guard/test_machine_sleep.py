"""A machine that sleeps: inputs from before are not used, though the monotonic clock stood."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import pytest
import zenoh

from slopewise.services.guard.core import Guard
from slopewise.services.guard.decide import GuardDecision
from slopewise.services.guard.service_updates import ServiceUpdates
from slopewise.services.guard.worker import Worker
from slopewise.services.wire import codec
from slopewise.services.wire.codec import Format
from tests.services.guard.guard_fixtures import FLAT, MODEL, feed, guard, map_update

ROUNDS, ASLEEP_AT = 12, 6
_READ = time.monotonic
_BEGUN = _READ() - 1.0


class FakeTransport:
    """Takes what is sent; before each round something may happen."""

    topics: dict[str, str] = {}  # noqa: RUF012

    def __init__(self, rounds: int, before: Callable[[int], None]) -> None:
        self.inbox, self.ended = self, threading.Event()
        self.sent: list[GuardDecision] = []
        self._rounds, self._before = rounds, before

    def take(self, *_: Any) -> dict[str, Any]:
        time.sleep(0.002)
        self._before(len(self.sent))
        return {}

    def send(self, decision: GuardDecision) -> None:
        self.sent.append(decision)
        if len(self.sent) == self._rounds:
            self.ended.set()


class Clock:
    """Clock that a sleep moves on, and the monotonic one stands."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.slept = 0.0
        monkeypatch.setattr(time, "clock_gettime", lambda _: _READ() + self.slept)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    return Clock(monkeypatch)


def run(
    it: Guard,
    before: Callable[[int], None],
    rounds: int = ROUNDS,
    updates: Any = None,
    take: Callable[[Guard], None] = lambda it: None,
) -> list[GuardDecision]:
    """Decisions of a worker; ``before``: a round, by its number, ``take``: of its updates."""
    transport, worker = FakeTransport(rounds, before), Worker.__new__(Worker)
    worker.guard, worker._settings, worker._transport = it, it.settings, transport  # type: ignore[assignment]
    worker._updates = updates or SimpleNamespace(  # type: ignore[assignment]
        open=lambda: None, take=take, distrust=lambda *_, **__: None
    )
    worker._heartbeat = SimpleNamespace(is_silent=lambda: False, beat=lambda: None, gone=False)  # type: ignore[assignment]
    worker._reported, worker._ignored_until = _READ() + 60.0, -math.inf
    worker.run(transport.ended)
    return transport.sent


def stand(it: Guard) -> None:
    now = _READ()
    number = round(1000.0 * (now - _BEGUN))  # near the origin, however long the machine has run
    feed(it, now, speed=0.0, requested=0.5, number=number)


@pytest.mark.parametrize("max_age", [1e9, 2.0])
@pytest.mark.parametrize("during", ["waiting", "taking", "deciding"])
def test_nothing_passes_after_a_sleep_until_inputs_are_new(
    clock: Clock, max_age: float, during: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    it, number = guard(map=max_age, command=1.0, motion=1.0), [0]
    it.maps.take(FLAT, _READ())

    def before(k: int) -> None:
        number[0] = k
        if k < ASLEEP_AT:
            stand(it)
        else:
            sleep("waiting")

    def sleep(now: str) -> None:
        if now == during and number[0] == ASLEEP_AT:
            clock.slept = 3600.0

    def take(_: Guard) -> None:
        sleep("taking")

    decide = it.decision

    def decision(*arguments: Any) -> GuardDecision:
        decided = decide(*arguments)
        sleep("deciding")
        return decided

    monkeypatch.setattr(it, "decision", decision)
    actions = [decision.action for decision in run(it, before, take=take)]
    assert actions[1:ASLEEP_AT] == ["pass"] * (ASLEEP_AT - 1)
    assert actions[ASLEEP_AT:] == ["stop"] * (ROUNDS - ASLEEP_AT)
    stand(it)
    assert it.decision(_READ()).action == ("pass" if max_age > 3600.0 else "stop")
    is_old = it.maps.missing(_READ() + it.held_up).startswith("map is 36")
    assert is_old is (max_age < 3600.0)


def test_short_sleeps_add_up_in_the_age_of_the_map(clock: Clock) -> None:
    it = guard(map=10.0, command=1.0, motion=1.0)
    it.maps.take(FLAT, _READ())

    def before(k: int) -> None:
        clock.slept = 9.0 * ((k >= 3) + (k >= 6))
        stand(it)

    sent = run(it, before)
    assert [d.action for d in sent[1:3] + sent[4:6]] == ["pass"] * 4
    assert {(d.action, d.reason[:9]) for d in sent[7:]} == {("stop", "map is 18")}
    assert it.ages(_READ())["map"] > 18.0


@pytest.fixture
def updates() -> Iterator[ServiceUpdates]:
    quiet = zenoh.Config()
    quiet.insert_json5("scouting/multicast/enabled", "false")
    quiet.insert_json5("listen/endpoints", "[]")
    with zenoh.open(quiet) as session:
        taken = ServiceUpdates(session, "test/sleep", None, MODEL.vehicle)
        yield taken
        taken.close()


def put(updates: ServiceUpdates, sequence: int, **changes: Any) -> None:
    """A map update comes from the network."""
    message = map_update(sequence, origin=(-5.0, -5.0), **changes)
    raw = codec.encode(message, Format.MESSAGEPACK)
    encoding = codec.encoding_of(type(message), Format.MESSAGEPACK)
    payload = SimpleNamespace(to_bytes=lambda: raw)
    updates._on_map(SimpleNamespace(payload=payload, encoding=encoding))  # type: ignore[arg-type]


@pytest.mark.parametrize("waits_in", ["socket", "queue"])
@pytest.mark.parametrize("slept", [3600.0, 9.0])
def test_map_that_waited_through_a_sleep_is_as_old_as_that(
    clock: Clock, updates: ServiceUpdates, waits_in: str, slept: float
) -> None:
    """A patch of it after an hour does not make it new, a whole map does."""
    it, done = guard(known=None, map=10.0, command=1.0, motion=1.0, stall=1.0), set[int]()

    def before(k: int) -> None:
        stand(it)
        if k in done:
            return
        done.add(k)
        if k == 6:
            clock.slept += slept * (waits_in == "socket")
            put(updates, 2)
            clock.slept += slept * (waits_in == "queue")
        elif k == 14:
            aged.append(it.ages(_READ())["map"])
            put(updates, 3, patch=True)
        elif k == 20:
            put(updates, 4)

    aged: list[float] = []
    put(updates, 1)
    sent = run(it, before, 26, updates)
    assert {d.action for d in sent[3:6]} == {"pass"}, [d.reason for d in sent]
    assert {d.action for d in sent[23:]} == {"pass"}
    if slept > 10.0:
        assert {d.action for d in sent[10:20]} == {"stop"}
        assert sent[19].reason.endswith("waiting for a whole map")
    else:
        assert slept < aged[0] < slept + 1.0
        assert {d.action for d in sent[10:20]} == {"pass"}
