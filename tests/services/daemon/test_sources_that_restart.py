"""Mappers and estimators that restart, and one that lies about its count, by payloads alone."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

import pytest
import zenoh

from tests.services.service_process import Running, running

MAP = "application/json;slopewise.map_update.v1"
STOP = "application/json;slopewise.stop_observation.v1"
PLAN = "application/json;slopewise.plan_request.v1"
G = 9.80665


def send_map(service: Running, session: zenoh.Session, sequence: int, known: float = 40.0) -> None:
    """Level ground, 40 m of it; beyond ``known`` [m] nobody knows."""
    row = [0.0 if -2.0 + 0.5 * i < known else None for i in range(85)]
    told = {
        "source": "mapper",
        "sequence": sequence,
        "resolution": 0.5,
        "origin": [-2.0, -5.0],
        "elevation": [row] * 21,
    }
    session.put(service.key("map"), json.dumps(told).encode(), encoding=MAP)


def answer(
    service: Running, session: zenoh.Session, key: str, told: dict[str, Any], encoding: str
) -> dict[str, Any]:
    replies = session.get(
        service.key(key), payload=json.dumps(told).encode(), encoding=encoding, timeout=5.0
    )
    (reply,) = list(replies)
    assert reply.ok is not None
    return dict(json.loads(reply.ok.payload.to_bytes()))


def plan(service: Running, session: zenoh.Session) -> dict[str, Any]:
    path = {"name": "a", "points": [[0.5 * i, 0.0] for i in range(60)]}
    return answer(service, session, "plan", {"speed": 0.0, "paths": [path]}, PLAN)


def progress(service: Running, session: zenoh.Session) -> float:
    return float(plan(service, session)["plans"][0]["progress"])


def until(check: Any) -> None:
    end = time.monotonic() + 10.0
    while not check():
        assert time.monotonic() < end
        time.sleep(0.05)


@pytest.mark.parametrize("before", [30, 2**53])
def test_a_mapper_that_restarts_brings_unknown_ground_to_plans(tmp_path: Path, before: int) -> None:
    with running(tmp_path) as service, service.session() as session:

        def first() -> bool:
            send_map(service, session, before)
            return bool(plan(service, session)["map_version"])

        until(first)
        assert progress(service, session) > 20.0
        send_map(service, session, 1, known=10.0)
        backwards = "maps of mapper count backwards: ignored"
        until(lambda: backwards in plan(service, session)["flags"])
        for sequence in (2, 3):
            send_map(service, session, sequence, known=10.0)
        until(lambda: progress(service, session) < 10.0)
        assert "maps of mapper: the source restarted its count" in plan(service, session)["flags"]


def test_a_huge_sequence_silences_no_observations_not_even_over_a_restart(tmp_path: Path) -> None:
    count = [0]

    def stop(service: Running, session: zenoh.Session, **more: Any) -> str:
        count[0] += 1
        told = {
            "source": "robot",
            "sequence": count[0],
            "time": time.monotonic(),
            "speed": 2.0,
            "grade": 0.0,
            "deceleration": 0.42 * G + 0.001 * count[0],
            **more,
        }
        return str(answer(service, session, "obs/stop", told, STOP)["status"])

    settings = '[learning]\nstops_at_once = 1000\n[store]\npath = "p.sqlite"'
    with running(tmp_path, planning=settings) as service, service.session() as session:
        assert stop(service, session) == "taken"
        assert stop(service, session, sequence=2**53) == "taken"
        assert [stop(service, session) for _ in range(3)] == ["taken"] * 3
        assert stop(service, session, sequence=2**53 - 1) == "taken"
    with running(tmp_path, planning=settings) as service, service.session() as session:
        assert [stop(service, session) for _ in range(4)][-2:] == ["taken"] * 2
        assert stop(service, session, instance="b", sequence=1) == "taken"
        assert stop(service, session, instance="b", sequence=1) == "ignored"
    with running(tmp_path, planning=settings) as service, service.session() as session:
        assert [stop(service, session) for _ in range(2)] == ["taken"] * 2
        assert stop(service, session, instance="b", sequence=1) == "ignored"
