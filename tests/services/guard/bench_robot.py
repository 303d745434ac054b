"""A robot for the guard: tells where it is and what is wanted, and hears what its base is told."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import zenoh

from slopewise.services.guard.guard_messages import GuardCommand, GuardMotion
from slopewise.services.settings.service_settings import ZenohSettings
from slopewise.services.settings.zenoh_session import zenoh_config
from slopewise.services.wire import codec
from slopewise.services.wire.codec import Format
from slopewise.services.wire.plan_messages import MapUpdate
from tests.services.service_process import free_port

SPACE = "test/guard"


def flat(rows: int = 200, columns: int = 400) -> MapUpdate:
    return MapUpdate(
        source="test",
        sequence=1,
        elevation=np.zeros((rows, columns)),
        resolution=0.25,
        origin=(-10.0, -25.0),
    )


class Robot:
    """Is at 0, 0 and says how fast; commands and motion at 50 Hz until told otherwise."""

    def __init__(self, session: zenoh.Session, wanted: float = 1.0) -> None:
        self.session, self.speed, self.wanted = session, 0.0, wanted
        self.says_motion = self.says_command = True
        self.heard: list[tuple[float, dict[str, Any]]] = []
        self._sequence, self._ended = 0, threading.Event()
        self._subscriber = session.declare_subscriber(f"{SPACE}/v1/guard/output", self._on_output)
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def put(self, name: str, message: Any, written: Format = Format.MESSAGEPACK) -> None:
        encoding = codec.encoding_of(type(message), written)
        self.session.put(
            f"{SPACE}/v1/{name}",
            codec.encode(message, written),
            encoding=encoding,
            congestion_control=zenoh.CongestionControl.BLOCK,
        )

    def _on_output(self, sample: zenoh.Sample) -> None:
        self.heard.append((time.monotonic(), json.loads(sample.payload.to_bytes())))

    def _run(self) -> None:
        while not self._ended.wait(0.02):
            self._sequence += 1
            if self.says_motion:
                here = GuardMotion(
                    source="r",
                    sequence=self._sequence,
                    x=0.0,
                    y=0.0,
                    heading=0.0,
                    speed=self.speed,
                )
                self.put("guard/motion", here)
            if self.says_command:
                self.command(self.wanted)

    def command(self, speed: float, sequence: int | None = None) -> None:
        number = self._sequence if sequence is None else sequence
        wanted = GuardCommand(source="p", sequence=number, speed=speed, yaw_rate=0.0)
        self.put("guard/command", wanted)

    def last(self) -> dict[str, Any]:
        return self.heard[-1][1] if self.heard else {}

    def wait_for(self, what: str, seconds: float = 20.0, **fields: Any) -> float:
        """Until such a word comes; when it came."""
        seen, until = len(self.heard), time.monotonic() + seconds
        wanted = {"action": what, **fields}
        while time.monotonic() < until:
            for at, word in self.heard[seen:]:
                seen += 1
                if all(word[key] == value for key, value in wanted.items()):
                    return at
            time.sleep(0.002)
        raise AssertionError(f"no {wanted} within {seconds} s, last {self.last()}")

    def close(self) -> None:
        self._ended.set()
        self._thread.join()
        self._subscriber.undeclare()


class GuardProcess:
    """`slopewise guard` in processes of its own."""

    def __init__(self, folder: Path, settings: str = "") -> None:
        self.endpoint = f"tcp/127.0.0.1:{free_port()}"
        listening = ZenohSettings(mode="router", listen=(self.endpoint,))
        self.router = zenoh.open(zenoh_config(listening))
        file = folder / "guard.toml"
        file.write_text(
            f'model = "atv"\n[zenoh]\nconnect = ["{self.endpoint}"]\nnamespace = "{SPACE}"\n'
            + settings
        )
        command = [sys.executable, "-m", "slopewise.services.cli", "guard", "--config", str(file)]
        self.process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        assert self.process.stdout is not None
        self.line = self.process.stdout.readline()
        assert "any single fault" in self.line, self.process.stderr and self.process.stderr.read()

    def client(self) -> zenoh.Session:
        return zenoh.open(zenoh_config(ZenohSettings(mode="client", connect=(self.endpoint,))))

    @property
    def watch(self) -> int:
        return self.process.pid

    @property
    def workers(self) -> list[int]:
        """The child that decides; none while it is begun anew."""
        children = Path(f"/proc/{self.watch}/task/{self.watch}/children").read_text().split()
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
