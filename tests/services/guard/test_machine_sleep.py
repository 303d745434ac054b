"""A machine that sleeps: inputs from before are not used, though the monotonic clock stood."""

from __future__ import annotations

import threading
import time
from types import SimpleNamespace
from typing import Any

import pytest

from slopewise.services.guard.core import Guard
from slopewise.services.guard.decide import GuardDecision
from slopewise.services.guard.worker import Worker
from tests.services.guard.guard_fixtures import feed, guard

ROUNDS, ASLEEP_AT = 12, 6


class FakeTransport:
    """Takes what is sent; before a round the machine may sleep for an hour."""

    topics: dict[str, str] = {}  # noqa: RUF012

    def __init__(self, it: Guard, ended: threading.Event) -> None:
        self.inbox, self._guard, self._ended = self, it, ended
        self.sent: list[GuardDecision] = []
        self.slept = 0.0

    def take(self, *_: Any) -> dict[str, Any]:
        if len(self.sent) < ASLEEP_AT:
            feed(self._guard, time.monotonic(), speed=0.0, requested=0.5)
        if len(self.sent) == ASLEEP_AT:
            self.slept = 3600.0
        return {}

    def send(self, decision: GuardDecision) -> None:
        self.sent.append(decision)
        if len(self.sent) == ROUNDS:
            self._ended.set()


@pytest.mark.parametrize("max_age", [1e9, 2.0])
def test_nothing_passes_after_a_sleep_until_inputs_are_new(
    monkeypatch: pytest.MonkeyPatch, max_age: float
) -> None:
    it, ended, read = guard(map=max_age, command=1.0, motion=1.0), threading.Event(), time.monotonic
    it.maps.take(it.maps.fresh(0.0), read())  # type: ignore[arg-type]
    transport = FakeTransport(it, ended)
    monkeypatch.setattr(time, "clock_gettime", lambda _: read() + transport.slept)
    worker = Worker.__new__(Worker)
    worker.guard, worker._settings, worker._transport = it, it.settings, transport  # type: ignore[assignment]
    worker._updates = SimpleNamespace(open=lambda: None, take=lambda it: None)  # type: ignore[assignment]
    worker._heartbeat = SimpleNamespace(is_silent=lambda: False, beat=lambda: None, gone=False)  # type: ignore[assignment]
    worker._reported = read() + 60.0
    worker.run(ended)
    actions = [decision.action for decision in transport.sent]
    assert actions[1:ASLEEP_AT] == ["pass"] * (ASLEEP_AT - 1)
    assert actions[ASLEEP_AT:] == ["stop"] * (ROUNDS - ASLEEP_AT)
    feed(it, read(), speed=0.0, requested=0.5)
    assert it.decision(read()).action == ("pass" if max_age > 3600.0 else "stop")
    assert it.maps.rejection.startswith("the map is from") is (max_age < 3600.0)
