"""The guard as processes: whatever is killed, stalled or starved, the base is told to stop."""

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
from msgspec.structs import replace

from slopewise.services.wire.codec import Format
from tests.services.command_line import slopewise
from tests.services.guard.bench_robot import SPACE, GuardProcess, Robot, flat

SLACK = 0.1
"""What this test itself may be late, on a machine that others use [s]."""


@pytest.fixture
def guard(tmp_path: Path) -> Iterator[GuardProcess]:
    running = GuardProcess(tmp_path)
    yield running
    running.close()


@contextlib.contextmanager
def driving(guard: GuardProcess) -> Iterator[Robot]:
    """A robot whose commands pass; from rest, because a stop is kept up until there."""
    with guard.client() as session:
        robot = Robot(session)
        robot.wait_for("stop", source="guard")
        robot.put("map", flat())
        robot.wait_for("pass", speed=1.0)
        robot.speed = 1.0
        yield robot
        robot.close()


def reaction(guard: GuardProcess) -> float:
    told = re.search(r"within ([\d.]+) s", guard.line)
    assert told is not None
    return float(told[1])


def kill_worker(guard: GuardProcess, robot: Robot) -> None:
    os.kill(guard.workers[0], signal.SIGKILL)


def hang_worker(guard: GuardProcess, robot: Robot) -> None:
    os.kill(guard.workers[0], signal.SIGSTOP)


def kill_watch(guard: GuardProcess, robot: Robot) -> None:
    os.kill(guard.watch, signal.SIGKILL)


def hang_watch(guard: GuardProcess, robot: Robot) -> None:
    os.kill(guard.watch, signal.SIGSTOP)


def no_commands(guard: GuardProcess, robot: Robot) -> None:
    robot.says_command = False


def no_odometry(guard: GuardProcess, robot: Robot) -> None:
    robot.says_motion = False


def nan_speed(guard: GuardProcess, robot: Robot) -> None:
    robot.speed = float("nan")


FAULTS: list[Callable[[GuardProcess, Robot], None]] = [
    kill_worker,
    hang_worker,
    kill_watch,
    hang_watch,
    no_commands,
    no_odometry,
    nan_speed,
]


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.__name__)
def test_a_fault_is_a_stop_within_the_stated_time(
    guard: GuardProcess, fault: Callable[[GuardProcess, Robot], None]
) -> None:
    with driving(guard) as robot:
        time.sleep(0.5)
        worker = guard.workers[0]
        begun = time.monotonic()
        fault(guard, robot)
        stopped = robot.wait_for("stop", brake=True, speed=0.0, yaw_rate=0.0)
        took = stopped - begun
        print(f"{fault.__name__}: stop after {1e3 * took:.0f} ms")
        assert took <= reaction(guard) + SLACK
        # From then on nothing passes while the fault lasts.
        since = time.monotonic()
        if fault is not kill_worker:
            time.sleep(0.6)
            assert {w["action"] for at, w in robot.heard if at > since + 0.05} == {"stop"}
        with contextlib.suppress(ProcessLookupError):
            os.kill(worker, signal.SIGCONT)
            if fault is kill_watch:
                os.kill(worker, signal.SIGTERM)


def test_a_worker_that_died_is_begun_anew(guard: GuardProcess) -> None:
    with driving(guard) as robot:
        time.sleep(1.2)
        first = guard.workers[0]
        os.kill(first, signal.SIGKILL)
        robot.wait_for("stop", source="watch")
        robot.speed = 0.0  # it has come to rest
        time.sleep(4.0)
        robot.put("map", flat())  # a new process knows no ground
        robot.wait_for("pass", source="guard")
        assert guard.workers[0] != first


def test_what_waited_while_it_hung_is_not_taken_for_new(guard: GuardProcess) -> None:
    """A command that came during a stall, whose sender has died since, moves nothing."""
    with driving(guard) as robot:
        worker = guard.workers[0]
        os.kill(worker, signal.SIGSTOP)
        robot.wait_for("stop", source="watch")
        time.sleep(0.2)
        robot.says_command = False
        time.sleep(0.3)
        since = time.monotonic()
        os.kill(worker, signal.SIGCONT)
        time.sleep(0.8)
        assert {w["action"] for at, w in robot.heard if at > since} == {"stop"}


def test_commands_are_slowed_and_answered_in_time(guard: GuardProcess) -> None:
    with driving(guard) as robot:
        robot.speed = robot.wanted = 3.0
        robot.wait_for("pass", speed=3.0)
        robot.wanted = 9.0
        robot.wait_for("slow")
        assert robot.last()["speed"] == pytest.approx(4.0, abs=0.5)
        statuses: list[dict[str, Any]] = []
        watcher = robot.session.declare_subscriber(
            f"{SPACE}/v1/guard/status",
            lambda sample: statuses.append(json.loads(sample.payload.to_bytes())),
        )
        time.sleep(4.0)
        watcher.undeclare()
        seconds = statuses[-1]["seconds"]
        print({name: f"{1e3 * value:.2f} ms" for name, value in seconds.items()})
        assert statuses[-1]["reaction"] == pytest.approx(reaction(guard))
        assert statuses[-1]["ages"]["command"] < 0.2
        assert seconds["median"] < 0.005  # a machine that others use; alone it is under a ms


def test_a_map_that_cannot_be_read_takes_the_ground_away(guard: GuardProcess) -> None:
    with driving(guard) as robot:
        robot.session.put(f"{SPACE}/v1/map", b"{}", encoding=Format.JSON.value)
        robot.wait_for("stop", reason="no map")


def test_a_lost_patch_is_a_stop_until_the_next_whole_map(guard: GuardProcess) -> None:
    with driving(guard) as robot:
        robot.put("map", replace(flat(2, 2), sequence=2, patch=True))
        time.sleep(0.3)
        assert robot.last()["action"] == "pass"
        robot.put("map", replace(flat(2, 2), sequence=4, patch=True))
        robot.wait_for("stop", reason="a map patch was lost; waiting for a whole map")
        robot.speed = 0.0
        robot.put("map", replace(flat(), sequence=5))
        robot.wait_for("pass")


def test_settings_that_cannot_be_used(tmp_path: Path) -> None:
    for text, words in (
        ("model = 'nobody'\n", "nobody"),
        ("model = 'atv'\n[timing]\nperiods = 1\n", "timing.periods"),
        ("model = 'atv'\n[zenoh]\nconnect = ['tcp/127.0.0.1:1']\n", "expected a router"),
    ):
        file = tmp_path / "guard.toml"
        file.write_text(text)
        done = slopewise("guard", "--config", file, timeout=30.0)
        assert done.returncode == 2, done.stderr
        assert words in done.stderr
        assert len(done.stderr.strip().splitlines()) == 1
