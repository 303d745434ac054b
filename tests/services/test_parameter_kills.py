"""Killed while it learns: the store opens, no receipt was in vain, plans come again at once."""

from __future__ import annotations

import random
import threading
import time
from pathlib import Path

import pytest

from tests.services.parameter_client import Robot, send_ground
from tests.services.service_process import free_port, running

G = 9.80665
STORE = '[store]\npath = "p.sqlite"\n'
SOON = 3.0
"""From the start of the process to the first plan [s]."""


class Sender:
    """One sender over many lives of the service; repeats what was not acknowledged."""

    def __init__(self) -> None:
        self.acknowledged: dict[int, int] = {}
        self.sequence = 0

    def send(self, robot: Robot) -> bool:
        """One stop; False once nobody answers."""
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


def killed_and_killed_again(folder: Path, times: int, seed: int) -> tuple[Sender, list[float]]:
    """As often as that, at random moments; how long each start took until the first plan."""
    chance, sender, starts, port = random.Random(seed), Sender(), [], free_port()
    for _ in range(times):
        begun = time.monotonic()
        with running(folder, planning=STORE, port=port) as service, service.peer() as session:
            robot = Robot(service, session)
            reply = robot.plan()
            starts.append(time.monotonic() - begun)
            assert reply["parameters"]["version"] >= max(sender.acknowledged.values(), default=1)
            assert not any("corrupt" in flag or "not" in flag for flag in reply["flags"][:-1])
            check(robot, sender)
            threading.Timer(chance.uniform(0.0, 0.3), service.process.kill).start()
            while sender.send(robot):
                pass
            service.process.wait(5.0)
    with running(folder, planning=STORE, port=port) as service, service.session() as session:
        robot = Robot(service, session)
        send_ground(robot)
        check(robot, sender)
        assert robot.plan()["plans"]
    return sender, starts


def check(robot: Robot, sender: Sender) -> None:
    """Everything acknowledged is in the history, once, with its version or an earlier one."""
    kept: dict[int, int] = {}
    for entry in robot.parameters("braking", history=10_000)["history"]:
        sequence = int(entry["cause"].partition(":")[0].removeprefix("stop "))
        assert sequence not in kept, "learned twice"
        kept[sequence] = entry["version"]
    for sequence, version in sender.acknowledged.items():
        assert kept[sequence] <= version


def test_killed_a_few_times(tmp_path: Path) -> None:
    sender, starts = killed_and_killed_again(tmp_path, 5, seed=1)
    assert len(sender.acknowledged) > 20
    assert min(starts) < SOON, "whatever else the machine has to do"


@pytest.mark.nightly
def test_killed_two_hundred_times(tmp_path: Path) -> None:
    sender, starts = killed_and_killed_again(tmp_path, 200, seed=time.time_ns())
    middle = sorted(starts)[100]
    print(f"{len(sender.acknowledged)} acknowledged; median {middle:.2f} s, longest "
          f"{max(starts):.2f} s to the first reply")  # fmt: skip
    assert len(sender.acknowledged) > 1000
    assert middle < SOON
