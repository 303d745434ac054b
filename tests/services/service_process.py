"""A service in a separate process, on a free port of the loopback."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import zenoh

from slopewise.services.settings.service_settings import ZenohSettings
from slopewise.services.settings.zenoh_session import zenoh_config
from slopewise.services.wire.plan_messages import MapUpdate
from slopewise.services.wire.plan_messages import Path as Candidate
from tests.services.warm_process import WarmProcess


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@dataclass
class Running:
    process: subprocess.Popen[str] | WarmProcess
    endpoint: str
    namespace: str

    def key(self, name: str) -> str:
        return f"{self.namespace}/v1/{name}"

    def session(self) -> zenoh.Session:
        """A client's session; a service on a busy machine may refuse the first tries."""
        config = ZenohSettings(mode="client", connect=(self.endpoint,))
        until = time.monotonic() + 20.0
        while True:
            try:
                return zenoh.open(zenoh_config(config))
            except zenoh.ZError:
                assert self.process.poll() is None, f"the service ended: {self.process.poll()}"
                if time.monotonic() > until:
                    raise
            time.sleep(0.5)

    def peer(self) -> zenoh.Session:
        """A session that lives on when the service is gone."""
        endpoint = (f"tcp/127.0.0.1:{free_port()}",)
        return zenoh.open(zenoh_config(ZenohSettings(listen=endpoint, connect=(self.endpoint,))))


@contextlib.contextmanager
def running(
    folder: Path,
    settings: str = "",
    planning: str = "",
    *,
    scheme: str = "tcp",
    namespace: str = "",
    zenoh_lines: str = "",
    page: str = "",
    model: str = "atv",
    environment: dict[str, str] | None = None,
    port: int = 0,
    fresh: bool = False,
) -> Iterator[Running]:
    """A service until the block ends.

    Args:
        folder: where its settings are. settings, planning, zenoh_lines, page: lines of them.
        environment: more of it. fresh: started as from a shell, with everything still to import.
    """
    port = port or free_port()
    endpoint, namespace = f"{scheme}/127.0.0.1:{port}", namespace or f"test/{port}"
    file = folder / f"service-{port}.toml"
    file.write_text(
        f'model = "{model}"\nnamespace = "{namespace}"\n{settings}\n'
        f'[zenoh]\nlisten = ["{endpoint}"]\n{zenoh_lines}\n[planning]\ndeadline = 5.0\n{planning}\n'
        f"[status]\nperiod = 0.1\n[page]\n{page}\n"
    )
    argv, started = ["serve", "--config", str(file)], os.environ | (environment or {})
    process: subprocess.Popen[str] | WarmProcess
    if fresh or environment:
        started.pop("PYTHONDONTWRITEBYTECODE", None)  # what an installation has, a shell finds
        command = [sys.executable, "-m", "slopewise.services.cli", *argv]
        process = subprocess.Popen(
            command, env=started, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
    else:
        process = WarmProcess(argv, started)
    try:
        line = process.stdout.readline()
        assert namespace in line, (line, process.poll(), process.stderr and process.stderr.read())
        yield Running(process, endpoint, namespace)
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGCONT)
            process.terminate()
        try:
            process.wait(10.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait(10.0)


def until(true: Callable[[], object], seconds: float = 8.0) -> None:
    """Wait for something that takes a while in another process or thread."""
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, "it did not happen in time"
        time.sleep(0.02)


def resident(process: int) -> float:
    """Memory of a process [MB]."""
    status = Path(f"/proc/{process}/status").read_text()
    return int(status.split("VmRSS:")[1].split()[0]) / 1024.0


def suspend(process: int) -> None:
    """Let a process hang; a signal takes effect after the call that sends it."""
    os.kill(process, signal.SIGSTOP)
    until = time.monotonic() + 5.0
    while Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "T":
        assert time.monotonic() < until, "runs on"
        time.sleep(0.001)


def flat(sequence: int = 1, **changes: object) -> MapUpdate:
    fields: dict[str, object] = {
        "source": "test",
        "sequence": sequence,
        "elevation": np.zeros((49, 193)),
        "resolution": 0.25,
        "origin": (-3.0, -6.0),
    }
    return MapUpdate(**(fields | changes))  # type: ignore[arg-type]


def fan(count: int = 5, points: int = 100, length: float = 25.0) -> list[Candidate]:
    along = np.linspace(0.0, length, points)
    second_derivatives = np.linspace(-0.004, 0.004, count)
    return [
        Candidate(name=f"c{j}", points=np.stack([along, b * along**2], axis=1))
        for j, b in enumerate(second_derivatives)
    ]
