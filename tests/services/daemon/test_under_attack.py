"""One honest robot among many attackers; `SLOPEWISE_ATTACK` seconds of it, a few by default."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import msgspec
import numpy as np
import pytest
import zenoh

from tests.services import attackers
from tests.services.attackers import MACHINE, block, straight
from tests.services.parameter_client import robot_on_ground, speeds_of
from tests.services.service_process import Running, free_port, resident

LONG = "SLOPEWISE_ATTACK" in os.environ
SECONDS = float(os.environ.get("SLOPEWISE_ATTACK", "3"))
WARM, ALONE = (30.0, 10.0) if LONG else (1.5, 1.5)
EACH = 2 if LONG else 1
"""Attackers of each kind."""
IN_TIME = 0.1
SHARE = 0.99 if LONG else 0.4
"""Of what the robot is answered alone, at least. The long form has a whole machine. With
other tests on two processors a third of the answers may come late through no fault of the service;
a robot that is starved, as without a separate share, is answered "busy" nearly every time.
"""
MORE_MEMORY = 25.0 if LONG else 250.0
"""[MB] than in the first seconds under attack, medians: large messages wait on busy machines."""
LOADING = 6.0 if LONG else 2.5
"""[s] of attack before memory is measured: requests of every kind load modules."""


class Honest:
    """A robot that asks twenty times a second, and drives by the replies."""

    def __init__(self, service: Running, session: zenoh.Session) -> None:
        self.service, self.session = service, session
        self.querier = session.declare_querier(service.key("plan"), timeout=IN_TIME, express=True)
        self.took: list[float] = []
        self.fastest, self.answered, self.asked = 0.0, 0, 0
        self.flags: set[str] = set()

    def ask(self) -> str:
        self.asked += 1
        paths = [{"name": f"{i}", "points": straight(20.0, 40, 0.002 * (i - 1))} for i in range(3)]
        request = {"speed": 0.0, "paths": paths, "client": "robot", "clear": 8.0}
        request["pose"] = (0.0, 0.0, 0.0)
        begun = time.monotonic()
        for reply in self.querier.get(
            parameters=f"deadline={0.8 * IN_TIME}",
            payload=msgspec.msgpack.encode(request),
            encoding=f"{MACHINE};slopewise.plan_request.v1",
        ):
            if reply.ok is None:
                continue
            reply_fields = msgspec.msgpack.decode(reply.ok.payload.to_bytes())
            if reply_fields["plans"]:
                self.answered += 1
                self.took.append(time.monotonic() - begun)
                self.flags |= set(reply_fields["flags"])
                self.fastest = max(
                    self.fastest, *(speeds_of(p).max() for p in reply_fields["plans"])
                )
            return str(reply_fields["status"])
        return "nobody"

    def drive(self, seconds: float) -> float:
        """The memory of the service meanwhile [MB]: the median of the second half of the time."""
        start = time.monotonic()
        memory = []
        while (begun := time.monotonic()) < start + seconds:
            self.ask()
            if begun > start + 0.5 * seconds:
                memory.append(resident(self.service.process.pid))
            time.sleep(max(0.05 - (time.monotonic() - begun), 0.0))
        return float(np.median(memory))


@contextlib.contextmanager
def attacked(service: Running, seconds: float, page: int) -> Iterator[None]:
    """Every kind, half a dozen in a process."""
    kinds = [*attackers.KINDS] * EACH
    command = [sys.executable, "-m", "tests.services.attackers"]
    command += [service.endpoint, service.namespace]
    processes = [
        subprocess.Popen([*command, ",".join(kinds[i :: 2 * EACH]), str(seconds), str(page)])
        for i in range(2 * EACH)
    ]
    try:
        yield
    finally:
        for process in processes:
            process.kill()
            process.wait()


def test_a_thousand_candidates_a_second_keep_nobody_waiting(tmp_path: Path) -> None:
    with robot_on_ground(tmp_path) as robot:
        honest = Honest(robot.service, robot.session)
        honest.drive(1.0)
        before, asked = honest.answered, honest.asked
        attacker = attackers.Attacker(robot.service.endpoint, robot.service.namespace, 1)
        until = time.monotonic() + 3.0
        while time.monotonic() < until:
            attacker.heavy()
            honest.drive(0.5)
        attacker.session.close()
        share = (honest.answered - before) / (honest.asked - asked)
        # On idle cores it is 0.99; other tests use them as well.
        assert share >= 0.8, sorted(honest.took)[-10:]
        print(f"answered in time {share:.3f} of {honest.asked - asked}")


def test_a_question_that_outlasts_its_deadline_is_given_up_and_counted(tmp_path: Path) -> None:
    """No machine plans a thousand candidates within a tenth of a second."""
    with robot_on_ground(tmp_path) as robot:
        paths = [{"name": f"{i}", "points": straight(45.0, 3, 1e-6 * i)} for i in range(1000)]
        key = f"{robot.service.key('plan')}?deadline=0.1"
        assert planned(robot.session, key, speed=1.0, paths=paths)[1]["status"] == "busy"
        assert robot.status(20.0)["counters"]["given_up"] == 1


def planned(session: zenoh.Session, key: str, **fields: object) -> tuple[str, dict]:
    """Key and content of the reply to a request for plans."""
    payload = msgspec.msgpack.encode({"speed": 0.0, "paths": [], **fields})
    encoding = f"{MACHINE};slopewise.plan_request.v1"
    (reply,) = session.get(key, payload=payload, encoding=encoding, timeout=3.0)
    return str(reply.ok.key_expr), msgspec.msgpack.decode(reply.ok.payload.to_bytes())


@pytest.mark.parametrize("text", ["-1", "nan", "inf", "0", "tomorrow"])
def test_deadlines_that_are_none_are_refused(
    service: Running, session: zenoh.Session, text: str
) -> None:
    _, reply = planned(session, f"{service.key('plan')}?deadline={text}")
    assert reply["status"] == "error"
    assert "deadline: expected a finite number of seconds > 0" in reply["reason"]


def test_the_reserved_key_is_answered(service: Running, session: zenoh.Session) -> None:
    key = service.key("plan/drive")
    paths = [{"name": "a", "points": block(np.eye(3, 2))}]
    assert planned(session, key, paths=paths)[0] == key


@pytest.mark.timeout(900)
def test_attackers_of_every_kind_and_one_robot(tmp_path: Path) -> None:
    port = free_port()
    # Whether there is time to smooth a plan makes it a little faster or slower, too.
    settings = 'smooth = false\nmax_map_age = 3600.0\n[store]\npath = "p.sqlite"'
    page = f"enabled = true\nport = {port}"
    with robot_on_ground(tmp_path, planning=settings, page=page) as robot:
        honest = Honest(robot.service, robot.session)
        honest.drive(1.5)
        fastest, honest.fastest = honest.fastest, 0.0
        honest.asked = honest.answered = 0
        honest.took.clear()
        with attacked(robot.service, LOADING + WARM + SECONDS + 20.0, port):
            honest.drive(LOADING)
            warm = honest.drive(WARM)
            asked, answered = honest.asked, honest.answered
            honest.took.clear()
            honest.drive(SECONDS - WARM)
            now = honest.drive(WARM)
            status = robot.status(20.0)
        share = (honest.answered - answered) / (honest.asked - asked)
        slowed = list(honest.took)
        time.sleep(2.0)
        asked_alone, answered_alone = honest.asked, honest.answered
        honest.drive(ALONE)
        alone = (honest.answered - answered_alone) / (honest.asked - asked_alone)
        took = np.percentile(slowed, [50, 99]) * 1e3
        print(
            f"answered in time {share:.4f} of {asked_alone - asked}, alone {alone:.4f}, "
            f"p50 {took[0]:.1f} ms, p99 {took[1]:.1f} ms; "
            f"fastest {honest.fastest:.4f}, without {fastest:.4f} m/s; "
            f"memory {warm:.0f} -> {now:.0f} MB; {status['counters']}; {status['flags']}"
        )
        assert honest.fastest <= fastest + 1e-9
        counters = status["counters"]
        # A quick machine gives up none of the requests that it has begun: that has its own test.
        expected = ["busy", "refused", "stops_too_many", "stops_contradictory"]
        for kind in (*expected, "map_updates_refused", "params_malformed"):
            assert counters.get(kind, 0) > 0, kind
        # Which of them come out of order, twice or late depends on which sender comes first.
        untimely = ("stop_out_of_order", "stop_duplicate", "stop_late", "stop_future")
        assert sum(counters.get(kind, 0) for kind in untimely) > 0
        # On a machine that is busy otherwise the robot alone is not always answered in time either.
        assert share >= SHARE * alone
        assert now <= warm + MORE_MEMORY
