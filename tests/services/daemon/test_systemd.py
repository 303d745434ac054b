from __future__ import annotations

import re
import shutil
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from slopewise.services.daemon import systemd
from tests.services.service_process import running

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
        with running(tmp_path, fresh=True):
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
