"""The command line as a user meets it: real processes, files, exit statuses, lines."""

from __future__ import annotations

import csv
import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import typer

from slopewise.services.cli import app
from slopewise.services.cli.commands import demo
from slopewise.services.io.map_file import write_map_npz
from slopewise.services.io.path_file import write_paths_csv
from tests.services.command_line import here, one_line_of, slopewise
from tests.services.faults import real_data
from tests.services.service_process import free_port
from tests.services.warm_process import WarmProcess


@pytest.fixture(scope="module")
def ground(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("ground")
    write_map_npz(demo.hillside(), folder / "map.npz")
    write_paths_csv(demo.fan(), folder / "paths.csv")
    return folder


def test_help_teaches_and_is_quick() -> None:
    slopewise("--help", fresh=True)
    seconds = []
    for _ in range(3):
        begin = time.perf_counter()
        result = slopewise("--help", fresh=True)
        seconds.append(time.perf_counter() - begin)
    assert result.returncode == 0
    for command in ("plan", "simulate", "bench", "demo"):
        assert command in result.stdout
    assert min(seconds) < 2.0  # a bound for any machine; the benchmark gives the real figure


def test_every_command_speaks_to_machines() -> None:
    groups = dict(typer.main.get_command(app.app).commands)  # type: ignore[attr-defined]
    commands = [*groups.pop("fleet").commands.values(), *groups.values()]
    assert len(commands) > 18
    for command in commands:
        assert "--json" in [word for option in command.params for word in option.opts], command


def test_a_command_that_runs_on_says_when_it_is_ready(tmp_path: Path) -> None:
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


def test_help_imports_nothing_heavy() -> None:
    code = (
        "import sys, slopewise.services.cli.app; "
        "print([m for m in ('numba', 'scipy', 'casadi', 'osqp', 'rasterio', 'numpy', 'plotly') "
        "if m in sys.modules])"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert result.stdout.strip() == "[]"


def test_plan_writes_what_check_accepts(ground: Path, tmp_path: Path) -> None:
    out = tmp_path / "plan.csv"
    result = slopewise(
        "plan",
        ground / "map.npz",
        ground / "paths.csv",
        "--model",
        "husky",
        "--out",
        out,
        fresh=True,
    )
    assert result.returncode == 0, result.stderr
    assert "best first" in result.stdout
    checked = slopewise("check", out, "--map", ground / "map.npz", "--model", "husky")
    assert checked.returncode == 0, checked.stdout


def test_json_is_json_and_ranked(ground: Path) -> None:
    result = slopewise(
        "plan",
        ground / "map.npz",
        ground / "paths.csv",
        "--model",
        "atv",
        "--speed",
        "1.5",
        "--json",
    )
    data = json.loads(result.stdout)
    assert data["admissible"] is True
    assert {plan["status"] for plan in data["plans"]} <= {"ok", "blocked", "degraded"}
    assert data["plans"][0]["status"] == "ok"
    columns = data["plans"][0]["columns"]
    assert len(columns["station"]) == len(columns["speed"]) == len(columns["limiting"])
    assert columns["speed"][0] == pytest.approx(1.5)


def test_no_admissible_candidate_is_status_3(ground: Path) -> None:
    result = slopewise(
        "plan",
        ground / "map.npz",
        ground / "paths.csv",
        "-m",
        "atv",
        "--speed",
        "4",
        "--clear",
        "1",
    )
    assert result.returncode == 3
    assert "beyond the clear distance" in " ".join(result.stdout.split())


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["plan", "none.npz", "{paths}", "--model", "atv"], ["none.npz"]),
        (["plan", "{map}", "none.csv", "--model", "atv"], ["none.csv"]),
        (["plan", "{map}", "{paths}", "--model", "none.toml"], ["none.toml"]),
        (["plan", "{map}", "{paths}"], ["--model"]),
        (["plan", "{map}"], ["PATHS"]),
        (["plan", "{map}", "{paths}", "-m", "atv", "--speed", "nan"], ["--speed", "start speed"]),
        (["plan", "{map}", "{paths}", "-m", "atv", "--speed=-1"], ["--speed", "-1"]),
        (["plan", "{map}", "{paths}", "-m", "atv", "--clear=-1"], ["--clear", "-1"]),
        (["plan", "{map}", "{paths}", "-m", "atv", "--spacing=0"], ["--spacing", "> 0"]),
        (["plan", "{map}", "{paths}", "-m", "atv", "--sped=1"], ["--sped"]),
        (
            ["plan", "{map}", "{paths}", "-m", "atv", "--out", "no/such/dir.csv"],
            ["no/such/dir.csv"],
        ),
        (["simulate", "none.csv", "-m", "atv"], ["none.csv"]),
        (["plann"], ["plann"]),
    ],
)
def test_bad_input_is_one_line_and_status_2(
    ground: Path, words: list[str], expected: list[str]
) -> None:
    names = {"map": ground / "map.npz", "paths": ground / "paths.csv"}
    one_line_of(here(*(word.format(**names) for word in words)), *expected)


def test_bad_input_ends_a_process_with_one_line_and_status_2(ground: Path) -> None:
    one_line_of(slopewise("plan", ground / "map.npz"), "PATHS")
    one_line_of(slopewise("plan", "none.npz", ground / "paths.csv", "-m", "atv"), "none.npz")


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        ("x,y\n1,1\nnan,2\n", ["row 3", "x"]),
        ("x,y\n10,10\n", ["at least 2 points"]),
        ("x,y\n900,900\n901,900\n", ["900"]),
        ("a,b\n1,1\n", ["x"]),
        ("x,y,candidate\n10,10,c\n20,10,c\n10,10.1,c\n", ["c", "cusp"]),
        ("x,y\n10,10\n10,10\n", ["distinct"]),
    ],
)
def test_bad_paths(ground: Path, tmp_path: Path, rows: str, expected: list[str]) -> None:
    paths = tmp_path / "bad.csv"
    paths.write_text(rows)
    one_line_of(here("plan", ground / "map.npz", paths, "-m", "atv"), "bad.csv", *expected)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("mass = 500.0", "mass = -500.0", ["vehicle.mass", "> 0"]),
        ("mass = 500.0", "mas = 500.0", ["vehicle.mas"]),
        ("mass = 500.0", 'mass = "heavy"', ["vehicle.mass"]),
        ("[ 0.0,     0.0,    -1.0e-5,  4.0e-5]", "[0.0, 0.0, -1.0e-5, -4.0e-5]", ["covariance"]),
        ("[limits]", "[limits", ["model.toml"]),
    ],
)
def test_bad_models(ground: Path, tmp_path: Path, old: str, new: str, expected: list[str]) -> None:
    text = Path("configs/vehicles/atv.toml").read_text()
    assert old in text
    model = tmp_path / "model.toml"
    model.write_text(text.replace(old, new))
    one_line_of(
        here("plan", ground / "map.npz", ground / "paths.csv", "-m", model),
        "model.toml",
        *expected,
    )


def test_real_dem_from_the_command_line(tmp_path: Path) -> None:
    dem = real_data("dem/giswqs_dem.tif")
    paths = tmp_path / "paths.csv"
    x = np.linspace(429_280.0, 429_310.0, 31)
    y = 5_150_640.0 + 2.0 * np.sin(np.linspace(0.0, 3.0, 31))
    paths.write_text("x,y\n" + "\n".join(f"{a},{b}" for a, b in zip(x, y, strict=True)) + "\n")
    result = here("plan", dem, paths, "--model", "atv", "--out", tmp_path / "plan.csv")
    assert result.returncode == 0, result.stderr
    with (tmp_path / "plan.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert 370.0 < float(rows[0]["z"]) < 420.0


def test_simulate_writes_every_sample(tmp_path: Path) -> None:
    t = np.arange(0.0, 5.0, 0.02)
    v = np.clip(3.0 - 4.0 * np.maximum(t - 2.3, 0.0), 0.0, None)
    rows = [f"1,{a},{b},{3.0 if a < 2.0 else 0.0},0.0" for a, b in zip(t, v, strict=True)]
    log, out = tmp_path / "log.csv", tmp_path / "sim.csv"
    log.write_text("run,t,v,v_cmd,pitch\n" + "\n".join(rows) + "\n")
    result = here("simulate", log, "--model", "atv", "--out", out)
    assert result.returncode == 0, result.stderr
    with out.open() as file:
        columns = list(csv.DictReader(file))
    assert list(columns[0]) == ["run", "t", "v_measured", "v_simulated", "residual"]
    assert len(columns) == len(t)
    for row in columns:
        difference = float(row["v_measured"]) - float(row["v_simulated"])
        assert float(row["residual"]) == pytest.approx(difference, abs=1e-12)
    # The model brakes at 9.81 · 0.445 = 4.36 m/s², the log at 4: the simulation is ahead.
    assert max(float(row["residual"]) for row in columns) == pytest.approx(0.25, abs=0.05)


def test_a_fault_of_the_program_is_status_1(monkeypatch: pytest.MonkeyPatch) -> None:
    from slopewise.services.cli import app
    from slopewise.services.cli.commands import demo as command

    def broken(_: Path) -> Path:
        raise RuntimeError("planted")

    monkeypatch.setattr(command, "run", broken)
    monkeypatch.delenv("SLOPEWISE_DEBUG", raising=False)
    with pytest.raises(SystemExit) as caught:
        app.main(["demo"])
    assert caught.value.code == 1
