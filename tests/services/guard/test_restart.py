"""A guard that is killed and started again has the parameters of the service."""

from __future__ import annotations

import contextlib
import os
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import zenoh

from slopewise.services.guard.parameter_request import PATIENCE, WAITING
from slopewise.services.wire import codec
from slopewise.services.wire.codec import Format
from slopewise.services.wire.parameter_messages import ParameterGroup, ParameterReply
from tests.services.guard.guard_fixtures import parameter_group
from tests.services.guard.guard_process import SPACE, GuardProcess, GuardRobot, flat

LIMIT = 0.4  # speed limit of the service: that of the model file is 4 m/s [m/s]


def limits(speed: float = LIMIT) -> ParameterGroup:
    return parameter_group("limits", speed=speed)


@contextlib.contextmanager
def service(session: zenoh.Session, answers: Callable[[zenoh.Query], None]) -> Iterator[None]:
    key = f"{SPACE}/v1/params/**"
    queryable = session.declare_queryable(key, answers, complete=True)
    time.sleep(0.2)
    yield
    queryable.undeclare()


def answer(query: zenoh.Query) -> None:
    fields = {"status": "ok", "reason": "", "service": "s", "version": 2, "durable": True}
    with query:
        payload = codec.payload_of(ParameterReply(**fields, groups=[limits()]), Format.JSON)
        query.reply(f"{SPACE}/v1/params", **payload)


def kill(guard: GuardProcess, *, with_watchdog: bool) -> None:
    (worker,) = guard.workers
    if not with_watchdog:
        os.kill(worker, signal.SIGKILL)
        return
    for number in (guard.watchdog, worker):
        os.kill(number, signal.SIGKILL)
    guard.process.wait()
    guard.start()


def speeds(robot: GuardRobot, since: float) -> set[float]:
    return {o["speed"] for at, o in list(robot.outputs) if at > since and o["action"] != "stop"}


def reasons(robot: GuardRobot, since: float) -> set[str]:
    return {o["reason"] for at, o in list(robot.outputs) if at > since}


def drive_after(guard: GuardProcess, robot: GuardRobot, cause: Callable[[], object]) -> set[float]:
    """Speeds that are given after a fault, once a command is answered again."""
    since = time.monotonic() + 0.3
    cause()
    until = time.monotonic() + 25.0
    while not speeds(robot, since) and time.monotonic() < until:
        robot.put("map", flat())
        time.sleep(0.1)
    time.sleep(0.5)
    return speeds(robot, since)


@pytest.fixture
def guard(tmp_path: Path) -> Iterator[GuardProcess]:
    running = GuardProcess(tmp_path)
    yield running
    running.close()


def test_restarted_guard_asks_the_service_and_its_worker_waits_for_it(guard: GuardProcess) -> None:
    with guard.client() as session:
        robot = GuardRobot(session)
        assert drive_after(guard, robot, lambda: None) == {1.0}  # without a service
        with service(session, answer):
            assert drive_after(guard, robot, lambda: kill(guard, with_watchdog=True)) == {LIMIT}
        begun = time.monotonic()
        kill(guard, with_watchdog=False)  # the service is gone
        while WAITING not in reasons(robot, begun) and time.monotonic() < begun + 20.0:
            robot.put("map", flat())
            time.sleep(0.1)
        time.sleep(PATIENCE + 1.0)
        assert reasons(robot, time.monotonic() - 0.5) == {WAITING}
        with service(session, answer):
            assert drive_after(guard, robot, lambda: None) == {LIMIT}
        robot.close()


def test_service_that_does_not_answer_is_waited_for(guard: GuardProcess) -> None:
    unanswered: list[zenoh.Query] = []
    with guard.client() as session, service(session, unanswered.append):
        robot = GuardRobot(session)
        begun = time.monotonic()
        drive_after(guard, robot, lambda: kill(guard, with_watchdog=True))
        assert WAITING in reasons(robot, begun)
        robot.close()
        for query in unanswered:
            query.drop()
