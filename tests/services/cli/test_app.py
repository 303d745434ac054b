"""The command line as a process: start, help, exit status."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from slopewise.services.cli import app
from slopewise.services.io.table import read_csv
from slopewise.services.jobs import demo
from tests.services.command_line import here, one_line_of, slopewise
from tests.services.faults import real_data
from tests.services.service_process import free_port
from tests.services.warm_process import WarmProcess

HEAVY = ("numba", "scipy", "casadi", "osqp", "rasterio", "numpy", "matplotlib", "zenoh", "msgspec")


def test_help_of_a_fresh_process_lists_the_commands() -> None:
    result = slopewise("--help", fresh=True)
    assert result.returncode == 0
    for command in ("plan", "simulate", "bench", "demo"):
        assert command in result.stdout


def test_help_imports_no_heavy_package() -> None:
    code = (
        f"import sys, slopewise.services.cli.app; print([m for m in {HEAVY} if m in sys.modules])"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert result.stdout.strip() == "[]"


def test_bad_input_ends_a_process_with_one_line_and_status_2(world: Path) -> None:
    one_line_of(slopewise("plan", "none.npz", "paths.csv", "-m", "atv", fresh=True), "none.npz")


def test_a_fault_of_the_program_is_status_1(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object, **__: object) -> None:
        raise RuntimeError("planted")

    monkeypatch.setattr(demo, "demo", broken)
    monkeypatch.delenv("SLOPEWISE_DEBUG", raising=False)
    done = here("demo")
    assert done.returncode == 1
    assert "RuntimeError: planted" in done.stderr


def test_a_running_command_prints_that_it_is_ready(tmp_path: Path) -> None:
    config = tmp_path / "service.toml"
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    config.write_text(f'model = "atv"\nnamespace = "machines"\n[zenoh]\nlisten = ["{endpoint}"]\n')
    process = WarmProcess(["serve", "--config", str(config), "--json"], os.environ)
    try:
        assert process.stdout is not None
        assert json.loads(process.stdout.readline()) == {
            "ready": True,
            "plan": "machines/v1/plan",
            "listens": [endpoint],
        }
    finally:
        process.terminate()
        process.wait(10.0)


def test_version_is_printed() -> None:
    assert here("--version").stdout.startswith("slopewise ")
    assert app.app.info.name == "slopewise"


def test_a_real_elevation_map_is_planned_on(tmp_path: Path) -> None:
    dem = real_data("dem/giswqs_dem.tif")
    x = np.linspace(429_280.0, 429_310.0, 31)
    y = 5_150_640.0 + 2.0 * np.sin(np.linspace(0.0, 3.0, 31))
    paths, out = tmp_path / "paths.csv", tmp_path / "plan.csv"
    paths.write_text("x,y\n" + "".join(f"{a},{b}\n" for a, b in zip(x, y, strict=True)))
    result = here("plan", dem, paths, "--model", "atv", "--out", out)
    assert result.returncode == 0, result.stderr
    assert 370.0 < float(read_csv(out).text("z")[0]) < 420.0
