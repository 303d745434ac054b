"""Bounded memory of the service; `docs/deploy.md` has the figures.

Repeated log records are counted; a service that is killed continues with what it learned.
"""

from __future__ import annotations

import logging
import os
import random
import re
import shutil
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from slopewise.services.client import PlanClient
from slopewise.services.daemon import systemd
from slopewise.services.daemon.log_rate_limit import RateLimitFilter
from tests.services.parameter_client import Robot, robot_on_ground
from tests.services.service_process import fan, flat, free_port, resident, running

UNIT = Path(__file__).parents[3] / "configs" / "systemd" / "slopewise.service"
_MAX_EXPOSURE = 2.0
"""Of 10, as `systemd-analyze security` counts."""


def listening(address: str) -> socket.socket:
    receiver = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    receiver.bind(address)
    receiver.settimeout(5.0)
    return receiver


def test_without_systemd_no_state_is_received(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NOTIFY_SOCKET", raising=False)
    assert not systemd.notify_systemd(systemd.READY)
    monkeypatch.setenv("NOTIFY_SOCKET", "/nowhere/at/all")
    assert not systemd.notify_systemd(systemd.READY)


def test_abstract_sockets_are_reached(monkeypatch: pytest.MonkeyPatch) -> None:
    with listening("\0slopewise-test") as receiver:
        monkeypatch.setenv("NOTIFY_SOCKET", "@slopewise-test")
        assert systemd.notify_systemd(systemd.ALIVE)
        assert receiver.recv(100) == b"WATCHDOG=1"


def test_a_service_reports_that_it_is_ready_and_alive(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    address = str(tmp_path / "notify")
    with listening(address) as receiver:
        monkeypatch.setenv("NOTIFY_SOCKET", address)
        with running(tmp_path):
            assert receiver.recv(100) in (b"READY=1", b"WATCHDOG=1")
            states = {receiver.recv(100) for _ in range(3)}
        assert b"WATCHDOG=1" in states
        while b"STOPPING=1" not in states:
            states.add(receiver.recv(100))


@pytest.fixture
def unit(tmp_path: Path) -> Path:
    """The unit, with a program that is there."""
    if shutil.which("systemd-analyze") is None:
        pytest.skip("needs systemd-analyze")
    text, count = re.subn(r"(?m)^(ExecStart)=\S+", rf"\1={sys.executable}", UNIT.read_text())
    assert count == 1
    file = tmp_path / UNIT.name
    file.write_text(text)
    return file


def analyze(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = ["systemd-analyze", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)


def test_the_unit_is_understood(unit: Path) -> None:
    done = analyze("verify", "--man=no", unit)
    assert [line for line in done.stderr.splitlines() if unit.name in line] == []


def test_the_unit_leaves_little_open(unit: Path) -> None:
    done = analyze("security", "--offline=true", "--no-pager", unit)
    states = re.search(r"Overall exposure level[^:]*: ([\d.]+)", done.stdout)
    assert states is not None, done.stdout + done.stderr
    assert float(states[1]) <= _MAX_EXPOSURE


MAX_RESIDENT = 160.0
"""[MB] resident after 100 requests; 129 were measured."""
MAX_GROWTH = 40.0
"""[MB] that 100 requests may add to what it has after its start; 20 to 31 were measured."""


def test_memory_after_a_hundred_questions(tmp_path: Path) -> None:
    with running(tmp_path, fresh=True) as started, started.session() as session:
        begin = resident(started.process.pid)
        uneven = 0.05 * np.random.default_rng(0).standard_normal((240, 480))
        with PlanClient(session, namespace=started.namespace, name="weight", timeout=5.0) as client:
            client.put_map(flat(elevation=uneven, origin=(-5.0, -30.0)))
            # Memory retained for a request is retained for a small one, too; large ones need most.
            for candidates in (64, 8, 8, 8) * 25:
                outcome = client.plan(1.0, fan(candidates), pose=(0.0, 0.0, 0.0))
                assert outcome.reply is not None
        end = resident(started.process.pid)
    assert end < MAX_RESIDENT
    assert end - begin < MAX_GROWTH


def written(log: RateLimitFilter, line: int, text: str) -> str | None:
    record = logging.LogRecord("slopewise", logging.INFO, "file.py", line, "%s", (text,), None)
    return record.getMessage() if log.filter(record) else None


def test_repeated_records_are_counted_and_written_once() -> None:
    log = RateLimitFilter(interval=60.0)
    assert [written(log, 1, str(n)) for n in range(4)] == ["0", None, None, None]
    assert written(log, 2, "another") == "another"
    unlimited = RateLimitFilter(interval=0.0)
    assert [written(unlimited, 1, str(n)) for n in range(2)] == ["0", "1"]


def test_the_count_is_written_after_the_interval() -> None:
    log = RateLimitFilter(interval=0.02)
    assert written(log, 1, "first") == "first"
    assert [written(log, 1, "x") for _ in range(3)] == [None] * 3
    time.sleep(0.03)
    assert written(log, 1, "later") == "later (and 3 like it)"


def test_the_number_of_remembered_lines_is_bounded() -> None:
    log = RateLimitFilter()
    for line in range(1000):
        written(log, line, "x")
    assert len(log) <= 256


G = 9.80665
# Stops take no time here.
STORE = '[learning]\nstops_at_once = 100000\n[store]\npath = "p.sqlite"\n'
SOON = 5.0
"""From the start of the process to the first plan [s]: of a processor always, of the clock unless
the machine has others to serve."""


class Sender:
    """One sender over many lives of the service; repeats what was not acknowledged."""

    def __init__(self) -> None:
        self.acknowledged: dict[int, int] = {}
        self.sequence = 0

    def send(self, robot: Robot) -> bool:
        """One stop; False once no reply comes."""
        stop = robot.stop_fields(G * (0.42 + 0.01 * (self.sequence % 3)))
        fields = {**stop, "sequence": self.sequence + 1}
        receipt = robot.query("obs/stop", fields, "stop_observation", timeout=2.0)
        if receipt is None:
            return False
        assert receipt["status"] in ("taken", "ignored"), receipt
        assert receipt["durable"], receipt
        self.sequence += 1
        self.acknowledged[self.sequence] = receipt["version"]
        return True


def processor_seconds(process: int) -> float:
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def killed_and_killed_again(
    folder: Path, times: int, seed: int, every: int = 1
) -> tuple[Sender, np.ndarray]:
    """As often as that, at random moments; clock and processor (n, 2) to the first plan [s].

    Of ``every`` starts only one is from nothing, and only such a start is timed.
    """
    chance, sender, starts, port = random.Random(seed), Sender(), [], free_port()
    for number in range(times):
        fresh = number % every == 0
        begun = time.monotonic()
        with (
            running(folder, planning=STORE, port=port, fresh=fresh) as service,
            service.peer() as session,
        ):
            robot = Robot(service, session)
            reply = robot.plan()
            took = time.monotonic() - begun
            if fresh:
                starts.append((took, processor_seconds(service.process.pid)))
            assert reply["parameters"]["version"] >= max(sender.acknowledged.values(), default=1)
            assert not any("corrupt" in flag or "not" in flag for flag in reply["flags"][:-1])
            check(robot, sender)
            # Five on a busy machine, too; the moment of the end stays random.
            assert all(sender.send(robot) for _ in range(5))
            threading.Timer(chance.uniform(0.0, 0.3), service.process.kill).start()
            while sender.send(robot):
                pass
            service.process.wait(5.0)
    with robot_on_ground(folder, planning=STORE, port=port) as robot:
        check(robot, sender)
        assert robot.plan()["plans"]
    return sender, np.array(starts)


def soon(starts: np.ndarray) -> bool:
    busy = os.getloadavg()[0] > 0.75 * (os.cpu_count() or 1)
    return bool(starts[:, 1].max() < SOON and (busy or np.median(starts[:, 0]) < SOON))


def check(robot: Robot, sender: Sender) -> None:
    """Everything acknowledged is in the history, once, with its version or an earlier one."""
    stored: dict[int, int] = {}
    for entry in robot.parameters("braking", history=10_000)["history"]:
        sequence = int(entry["cause"].partition(":")[0].removeprefix("stop "))
        assert sequence not in stored, "learned twice"
        stored[sequence] = entry["version"]
    for sequence, version in sender.acknowledged.items():
        assert stored[sequence] <= version


def test_killed_a_few_times(tmp_path: Path) -> None:
    sender, starts = killed_and_killed_again(tmp_path, 3, seed=1, every=3)
    assert len(sender.acknowledged) > 12
    assert soon(starts)


@pytest.mark.nightly
def test_killed_two_hundred_times(tmp_path: Path) -> None:
    sender, starts = killed_and_killed_again(tmp_path, 200, seed=time.time_ns())
    clock, processor = starts.T
    print(
        f"{len(sender.acknowledged)} acknowledged; to the first reply {np.median(clock):.2f} s, "
        f"at most {clock.max():.2f}; of a processor at most {processor.max():.2f}"
    )
    assert len(sender.acknowledged) > 1000
    assert soon(starts)
