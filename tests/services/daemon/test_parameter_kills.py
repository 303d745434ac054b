"""Killed while it learns: the store opens, no acknowledged stop is lost, plans resume soon."""

from __future__ import annotations

import os
import random
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from tests.services.parameter_client import Robot, robot_on_ground
from tests.services.service_process import free_port, running

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
    sender, starts = killed_and_killed_again(tmp_path, 5, seed=1, every=5)
    assert len(sender.acknowledged) > 20
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
