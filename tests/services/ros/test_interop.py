"""A node by a ROS 2 client library of others, through the real zenohd: both built by cargo.

It takes a quarter of an hour the first time; `SLOPEWISE_INTEROP` may name a folder to keep them in.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rosbags", reason="the ros extra is not installed")

from tests.services.service_process import free_port, running

HERE = Path(__file__).with_name("interop")
ZENOHD = "1.10.2"

pytestmark = [
    pytest.mark.nightly,
    pytest.mark.skipif(shutil.which("cargo") is None, reason="cargo is not installed"),
    pytest.mark.timeout(3600),
]


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The router, and the node."""
    cache = os.environ.get("SLOPEWISE_INTEROP")
    folder = Path(cache) if cache else tmp_path_factory.mktemp("interop")
    environment = os.environ | {"CARGO_TARGET_DIR": str(folder / "target")}
    router, node = folder / "bin" / "zenohd", folder / "target" / "debug" / "interop"
    if not router.exists():
        install = ["cargo", "install", "--locked", "--debug", "zenohd", "--version", ZENOHD]
        subprocess.run([*install, "--root", str(folder)], check=True, env=environment)
    build = ["cargo", "build"]
    subprocess.run(build, check=True, env=environment, cwd=HERE)
    return router, node


@pytest.fixture
def endpoint(built: tuple[Path, Path]) -> Iterator[str]:
    """Router without scouting; its endpoint."""
    where = f"tcp/127.0.0.1:{free_port()}"
    command = [
        str(built[0]),
        "--listen",
        where,
        "--no-multicast-scouting",
        "--rest-http-port",
        "none",
    ]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    time.sleep(1.0)
    yield where
    process.terminate()
    process.wait(10.0)


@pytest.mark.parametrize("distribution", ["auto", "humble", "jazzy", "kilted", "lyrical"])
def test_a_node_of_others(
    built: tuple[Path, Path], endpoint: str, tmp_path: Path, distribution: str
) -> None:
    with running(tmp_path, planning="budget = 0.008\n") as service:
        file = tmp_path / "ros.toml"
        file.write_text(
            f'[ros]\nconnect = ["{endpoint}"]\ndistribution = "{distribution}"\n[service]\n'
            f'connect = "{service.endpoint}"\nnamespace = "{service.namespace}"\ntimeout = 0.5\n'
        )
        edge = subprocess.Popen(
            [sys.executable, "-m", "slopewise.services.cli", "ros", "--config", str(file)],
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        edge.stdout.readline()
        override = f'mode="client";connect/endpoints=["{endpoint}"]'
        done = subprocess.run(
            [str(built[1]), "6"],
            capture_output=True,
            text=True,
            timeout=60,
            env=os.environ | {"ZENOH_CONFIG_OVERRIDE": override},
        )
        edge.send_signal(signal.SIGTERM)
        edge.wait(10.0)
    assert done.returncode == 0, done.stderr
    report: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    print(distribution, len(report["limits"]), max(report["limits"]), report["diagnostics"])
    assert all(0.0 < limit <= 4.0 for limit in report["limits"])
    assert max(report["limits"]) > 1.0
    assert max(report["profiles"]) > 3
    assert len(report["diagnostics"]) == 2
