"""A robot before a guard that runs in its processes: odometry and commands in, outputs back."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import zenoh

from slopewise.services.guard.zenoh_transport import GuardCommand, GuardMotion
from slopewise.services.settings.service_settings import ZenohSettings
from slopewise.services.settings.zenoh_session import zenoh_config
from slopewise.services.wire import codec
from slopewise.services.wire.codec import Format
from slopewise.services.wire.plan_messages import MapUpdate
from tests.services.guard.guard_fixtures import map_update
from tests.services.service_process import free_port

SPACE = "test/guard"


def flat(sequence: int = 1, shape: tuple[int, int] = (200, 400), **changes: Any) -> MapUpdate:
    return map_update(sequence, elevation=np.zeros(shape), origin=(-10.0, -25.0), **changes)


class GuardRobot:
    """Stands near 0, 0 and reports a speed; commands and motion at 50 Hz while they are on."""

    def __init__(self, session: zenoh.Session, requested: float = 1.0) -> None:
        self.session, self.speed, self.requested = session, 0.0, requested
        self.sends_motion = self.sends_command = True
        self.outputs: list[tuple[float, dict[str, Any]]] = []
        self._sequence, self._ended = 0, threading.Event()
        self.delay = 0.0  # by which the machine lets this process wait too long, at most [s]
        self._subscriber = session.declare_subscriber(f"{SPACE}/v1/guard/output", self._on_output)
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def put(self, name: str, message: Any) -> None:
        self.session.put(
            f"{SPACE}/v1/{name}",
            codec.encode(message, Format.MESSAGEPACK),
            encoding=codec.encoding_of(type(message), Format.MESSAGEPACK),
            congestion_control=zenoh.CongestionControl.BLOCK,
        )

    def _on_output(self, sample: zenoh.Sample) -> None:
        self.outputs.append((time.monotonic(), json.loads(sample.payload.to_bytes())))

    def _run(self) -> None:
        last = time.monotonic()
        while not self._ended.wait(0.02):
            last, before = time.monotonic(), last
            self.delay = max(self.delay, last - before - 0.02)
            self._sequence += 1
            number = self._sequence
            if self.sends_motion:
                x = 1e-4 * (number % 1000)  # a pose that stays while the base moves is a fault
                place = {"x": x, "y": 0.0, "heading": 0.0, "speed": self.speed}
                self.put("guard/motion", GuardMotion(source="r", sequence=number, **place))
            if self.sends_command:
                speeds = {"speed": self.requested, "yaw_rate": 0.0}
                self.put("guard/command", GuardCommand(source="p", sequence=number, **speeds))

    def actions_since(self, moment: float) -> set[str]:
        return {output["action"] for at, output in self.outputs if at > moment}

    def has_worker_output(self) -> bool:
        return any(output["source"] == "guard" for _, output in list(self.outputs))

    def last(self) -> dict[str, Any]:
        return self.outputs[-1][1] if self.outputs else {}

    def wait_for(self, action: str, seconds: float = 20.0, **fields: Any) -> float:
        """Moment at which such an output comes."""
        checked, until = len(self.outputs), time.monotonic() + seconds
        expected = {"action": action, **fields}
        while time.monotonic() < until:
            for at, output in self.outputs[checked:]:
                checked += 1
                if all(output[key] == value for key, value in expected.items()):
                    return at
            time.sleep(0.002)
        raise AssertionError(f"no {expected} within {seconds} s, last {self.last()}")

    def close(self) -> None:
        self._ended.set()
        self._thread.join()
        self._subscriber.undeclare()


class GuardProcess:
    """`slopewise guard` as processes, behind a router."""

    def __init__(self, folder: Path, lines: str = "") -> None:
        self.endpoint = f"tcp/127.0.0.1:{free_port()}"
        listening = ZenohSettings(mode="router", listen=(self.endpoint,))
        self.router = zenoh.open(zenoh_config(listening))
        file = folder / "guard.toml"
        zenoh_table = f'[zenoh]\nconnect = ["{self.endpoint}"]\nnamespace = "{SPACE}"\n'
        file.write_text(f'model = "atv"\n{zenoh_table}{lines}')
        self._command = [sys.executable, "-m", "slopewise.services.cli", "guard"]
        self._command += ["--config", str(file)]
        self.start()

    def start(self) -> None:
        """Start the processes, for the first time or again."""
        self.process = subprocess.Popen(
            self._command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        assert self.process.stdout is not None
        self.line = self.process.stdout.readline()
        assert "any single fault" in self.line, self.process.stderr and self.process.stderr.read()

    def client(self) -> zenoh.Session:
        return zenoh.open(zenoh_config(ZenohSettings(mode="client", connect=(self.endpoint,))))

    @property
    def watchdog(self) -> int:
        return self.process.pid

    @property
    def workers(self) -> list[int]:
        """The child that decides; empty while it is restarted."""
        pid = self.watchdog
        children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
        return [int(child) for child in children]

    def close(self) -> None:
        for number in self.workers if self.process.poll() is None else ():
            os.kill(number, signal.SIGCONT)
        self.process.send_signal(signal.SIGCONT)
        self.process.terminate()
        try:
            self.process.wait(10.0)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self.router.close()


@contextlib.contextmanager
def driving(guard: GuardProcess) -> Iterator[GuardRobot]:
    """A robot whose commands pass; from rest, because a stop is kept up until there."""
    with guard.client() as session:
        robot = GuardRobot(session)
        until = time.monotonic() + 20.0
        # The watchdog sends before the worker has subscribed.
        while not robot.has_worker_output() and time.monotonic() < until:
            time.sleep(0.01)
        robot.put("map", flat())
        robot.wait_for("pass", speed=1.0)
        robot.speed = 1.0
        yield robot
        robot.close()
        time.sleep(0.3)  # the next one bears the same name and counts from 1
