"""The guard as processes: a fault of any of them, or of an input, is a stop in time."""

from __future__ import annotations

import contextlib
import json
import os
import re
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from slopewise.services.wire.codec import Format
from tests.services.command_line import one_line_of, slopewise
from tests.services.guard.guard_process import SPACE, GuardProcess, GuardRobot, driving, flat


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[GuardProcess]:
    """A guard for tests after which it runs as before."""
    running = GuardProcess(tmp_path_factory.mktemp("guard"))
    yield running
    running.close()


@pytest.fixture
def guard(tmp_path: Path) -> Iterator[GuardProcess]:
    """A guard to be killed."""
    running = GuardProcess(tmp_path)
    yield running
    running.close()


@pytest.fixture
def robot(shared: GuardProcess) -> Iterator[GuardRobot]:
    with driving(shared) as robot:
        yield robot
        robot.speed = 0.0  # from rest the next one may begin
        time.sleep(0.3)


def reaction(guard: GuardProcess) -> float:
    stated = re.search(r"within ([\d.]+) s", guard.line)
    assert stated is not None
    return float(stated[1])


def slack(robot: GuardRobot) -> float:
    """Delay on a machine that others use [s]: from worker and watchdog to this process."""
    return 0.1 + 3.0 * robot.delay


def check_fault(guard: GuardProcess, robot: GuardRobot, cause: Callable[[], object]) -> None:
    """A stop within the stated time; from then on nothing passes while the fault lasts."""
    time.sleep(0.3)
    begun, robot.delay = time.monotonic(), 0.0
    cause()
    stopped = robot.wait_for("stop", brake=True, speed=0.0, yaw_rate=0.0)
    print(f"stop after {1e3 * (stopped - begun):.0f} ms")
    assert stopped - begun <= reaction(guard) + slack(robot)
    time.sleep(0.6)
    assert robot.actions_since(stopped + 0.05) == {"stop"}


@pytest.mark.parametrize(
    ("name", "value"), [("sends_command", False), ("sends_motion", False), ("speed", float("nan"))]
)
def test_missing_or_unusable_input_is_a_stop_in_time(
    shared: GuardProcess, robot: GuardRobot, name: str, value: object
) -> None:
    check_fault(shared, robot, lambda: setattr(robot, name, value))
    robot.sends_command = robot.sends_motion = True


@pytest.mark.parametrize(
    "number", [signal.SIGKILL, pytest.param(signal.SIGSTOP, marks=pytest.mark.nightly)]
)
def test_watchdog_that_fails_is_a_stop_in_time(guard: GuardProcess, number: signal.Signals) -> None:
    with driving(guard) as robot:
        worker = guard.workers[0]
        check_fault(guard, robot, lambda: os.kill(guard.watchdog, number))
        with contextlib.suppress(ProcessLookupError):
            os.kill(worker, signal.SIGTERM)


def test_worker_that_dies_is_a_stop_in_time_and_is_restarted(guard: GuardProcess) -> None:
    with driving(guard) as robot:
        time.sleep(1.2)
        first, begun, robot.delay = guard.workers[0], time.monotonic(), 0.0
        os.kill(first, signal.SIGKILL)
        stopped = robot.wait_for("stop", source="watch", brake=True, speed=0.0, yaw_rate=0.0)
        assert stopped - begun <= reaction(guard) + slack(robot)
        robot.speed = 0.0  # it has come to rest
        robot.wait_for("stop", source="guard", reason="no map")  # a new process has no map
        robot.put("map", flat())
        robot.wait_for("pass", source="guard")
        assert guard.workers[0] != first


def test_suspended_worker_is_a_stop_in_time_and_old_commands_are_not_used(
    shared: GuardProcess, robot: GuardRobot
) -> None:
    """A command that came during a stall, whose sender has died since, moves nothing."""
    worker = shared.workers[0]
    check_fault(shared, robot, lambda: os.kill(worker, signal.SIGSTOP))
    robot.sends_command = False
    time.sleep(0.3)
    since = time.monotonic()
    os.kill(worker, signal.SIGCONT)
    time.sleep(0.8)
    assert robot.actions_since(since) == {"stop"}
    robot.sends_command = True


def test_commands_are_limited_and_answered_in_time(shared: GuardProcess, robot: GuardRobot) -> None:
    robot.speed = robot.requested = 3.0
    robot.wait_for("pass", speed=3.0)
    robot.requested = 9.0
    robot.wait_for("slow")
    assert robot.last()["speed"] == pytest.approx(4.0, abs=0.5)
    statuses: list[dict[str, Any]] = []
    watcher = robot.session.declare_subscriber(
        f"{SPACE}/v1/guard/status",
        lambda sample: statuses.append(json.loads(sample.payload.to_bytes())),
    )
    time.sleep(2.5)
    watcher.undeclare()
    seconds = statuses[-1]["seconds"]
    print({name: f"{1e3 * value:.2f} ms" for name, value in seconds.items()})
    assert statuses[-1]["reaction"] == pytest.approx(reaction(shared))
    assert statuses[-1]["ages"]["command"] < 0.2
    assert seconds["median"] < 0.005  # a machine that others use; alone it is below 1 ms


def test_map_that_cannot_be_read_removes_the_ground(robot: GuardRobot) -> None:
    robot.session.put(f"{SPACE}/v1/map", b"{}", encoding=Format.JSON.value)
    robot.wait_for("stop", reason="no map")


def test_lost_patch_is_a_stop_until_the_next_whole_map(robot: GuardRobot) -> None:
    robot.put("map", flat(2, (2, 2), patch=True))
    time.sleep(0.3)
    assert robot.last()["action"] == "pass", robot.last()
    robot.put("map", flat(4, (2, 2), patch=True))
    robot.wait_for("stop", reason="a map patch was lost; waiting for a whole map")
    robot.speed = 0.0
    robot.put("map", flat(5))
    robot.wait_for("pass")


def test_a_router_that_does_not_answer_is_named(tmp_path: Path) -> None:
    file = tmp_path / "guard.toml"
    file.write_text("model = 'atv'\n[zenoh]\nconnect = ['tcp/127.0.0.1:1']\n")
    one_line_of(slopewise("guard", "--config", file, timeout=30.0), "expected a router")
