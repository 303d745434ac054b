"""False stops against a running service: payloads written by hand, by somebody with the right key.

Nothing here is code of the service or of its client; what an attacker sends is what the schema in
the documentation says.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import zenoh

from tests.services.service_process import Running, running

STOP = "application/json;slopewise.stop_observation.v1"
G = 9.80665


class Attacker:
    def __init__(self, service: Running, session: zenoh.Session, source: str = "liar") -> None:
        self.service, self.session, self.source, self.count = service, session, source, 0

    def stop(self, force: float, **more: Any) -> None:
        self.count += 1
        told = {
            "source": self.source,
            "sequence": self.count,
            "time": time.monotonic(),
            "speed": 2.0,
            "grade": 0.0,
            "deceleration": force * G,
            "deceleration_std": 0.01,
            **more,
        }
        key = self.service.key("obs/stop")
        self.session.put(key, json.dumps(told).encode(), encoding=STOP)

    def asks(self, key: str) -> dict[str, Any]:
        for reply in self.session.get(self.service.key(key), timeout=5.0):
            if reply.ok is not None:
                return dict(json.loads(reply.ok.payload.to_bytes()))
        raise AssertionError("nobody answered")

    def force(self, group: str = "braking") -> float:
        values = self.asks(f"params/{group}")["groups"][0]["values"]
        return float(values["m_b"] * 2.0 + values["b_b"])

    def wait(self, counter: str, count: int) -> dict[str, Any]:
        """The status once so many were counted."""
        heard: list[dict[str, Any]] = []
        until = time.monotonic() + 20.0
        with self.session.declare_subscriber(
            self.service.key("status"), lambda s: heard.append(json.loads(s.payload.to_bytes()))
        ):
            while time.monotonic() < until:
                if heard and heard[-1]["counters"].get(counter, 0) >= count:
                    return heard[-1]
                time.sleep(0.05)
        raise AssertionError((counter, heard[-1:]))


@pytest.fixture
def attacker(tmp_path: Path) -> Iterator[Attacker]:
    with running(tmp_path) as service, service.session() as session:
        yield Attacker(service, session)


def test_a_burst_of_strong_stops_makes_no_plan_faster_and_is_flagged(attacker: Attacker) -> None:
    before = attacker.force()
    for i in range(120):
        attacker.stop(0.95, speed=1.0 + 0.7 * (i % 4))
    status = attacker.wait("stops_too_many", 100)
    assert attacker.force() <= before + 1e-9
    assert "more stops came than the vehicle can make" in status["flags"]


def test_new_names_begin_with_no_chain_of_guesses(attacker: Attacker) -> None:
    before = attacker.force()
    for name in ("one", "two", "three", "four", "asphalt"):
        attacker.stop(0.40, surface=name)
    attacker.wait("stop_taken", 5)
    assert attacker.force("braking.asphalt") >= 0.6 * before - 1e-9


def test_numbers_that_contradict_each_other_are_refused_and_flagged(attacker: Attacker) -> None:
    before = attacker.force()
    attacker.stop(0.9, distance=25.0, dead_time=0.3)
    attacker.stop(0.1, distance=0.2, dead_time=0.3)
    status = attacker.wait("stops_contradictory", 2)
    assert attacker.force() == before
    assert "stops of liar contradict themselves" in status["flags"]
