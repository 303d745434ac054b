"""The command line as a process: start, help, exit status.

Every command: status, keys of its JSON, and a line of its table.

Every refusal of `tests/bad_inputs/commands.toml`.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer

from slopewise.services.cli import app
from slopewise.services.io.table import read_csv
from slopewise.services.jobs import calibrate, demo, discrepancy
from tests.models.calibration.plant import Plant, drive
from tests.services.cli.conftest import write_log
from tests.services.command_line import here, one_line_of, slopewise
from tests.services.faults import real_data
from tests.services.service_process import free_port
from tests.services.warm_process import WarmProcess


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


@pytest.mark.parametrize("options", [(), pytest.param(("--json",), marks=pytest.mark.nightly)])
def test_a_reader_that_has_enough_is_no_fault(world: Path, options: tuple[str, ...]) -> None:
    """As `slopewise plan … | head -1`: the files are written, the status is that of the plan."""
    arguments = ["plan", "map.npz", "paths.csv", "-m", "atv", "--out", "plan.csv", *options]
    reading, writing = os.pipe()
    os.close(reading)
    command = [sys.executable, "-m", "slopewise.services.cli", *arguments]
    done = subprocess.run(command, stdout=writing, stderr=subprocess.PIPE, text=True, check=False)
    os.close(writing)
    assert (done.returncode, done.stderr) == (0, "")
    assert (world / "plan.csv").exists()


@pytest.mark.parametrize("command", ["discrepancy", "simulate", "coverage"])
@pytest.mark.parametrize(("columns", "factor"), [(["t"], 1e3), (["v", "v_cmd"], 3.6)])
def test_logs_in_other_units_are_refused_by_every_command(
    world: Path, command: str, columns: list[str], factor: float
) -> None:
    log = drive(Plant(), 6, 0)[0]
    write_log({n: factor * v if n in columns else v for n, v in log.items()}, world / "unit.csv")
    done = here(command, "unit.csv", "-m", "atv", *(("--out", "o") if command[0] == "d" else ()))
    one_line_of(done, f"column {columns[0]}", "which looks like", "ms" if factor > 4.0 else "km/h")


def test_a_running_command_prints_that_it_is_ready(tmp_path: Path) -> None:
    config = tmp_path / "service.toml"
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    config.write_text(f'model = "atv"\nnamespace = "machines"\n[zenoh]\nlisten = ["{endpoint}"]\n')
    process = WarmProcess(["serve", "--config", str(config), "--json"], os.environ)
    try:
        assert json.loads(process.stdout.readline()) == {
            "ready": True,
            "plan": "machines/v1/plan",
            "listens": [endpoint],
        }
    finally:
        process.terminate()
        process.wait(10.0)


@pytest.mark.parametrize("arguments", [(), ("fleet",)])
def test_a_command_without_arguments_prints_its_help_alone(arguments: tuple[str, ...]) -> None:
    done = here(*arguments)
    assert "Usage: slopewise" in done.stdout
    assert (done.stderr, done.returncode) == ("", 2)


def test_a_terminal_without_a_width_or_some_signs_gets_its_text(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("PYTHONIOENCODING", "latin-1")
    monkeypatch.setenv("COLUMNS", "0")
    done = slopewise("terrain", "--help", fresh=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert "LOG?" in done.stdout


def test_version_is_printed() -> None:
    assert here("--version").stdout.startswith("slopewise ")
    assert app.app.info.name == "slopewise"
    assert "simulate" in here("--help").stdout


def test_a_real_elevation_map_is_planned_on(tmp_path: Path) -> None:
    dem = real_data("dem/giswqs_dem.tif")
    x = np.linspace(429_280.0, 429_310.0, 31)
    y = 5_150_640.0 + 2.0 * np.sin(np.linspace(0.0, 3.0, 31))
    paths, out = tmp_path / "paths.csv", tmp_path / "plan.csv"
    paths.write_text("x,y\n" + "".join(f"{a},{b}\n" for a, b in zip(x, y, strict=True)))
    result = here("plan", dem, paths, "--model", "atv", "--out", out)
    assert result.returncode == 0, result.stderr
    assert 370.0 < float(read_csv(out).text("z")[0]) < 420.0


GOLDEN = Path(__file__).parents[2] / "golden" / "json_keys.json"

COMMANDS: dict[str, tuple[str, int, str]] = {
    "plan": ("plan map.npz paths.csv -m atv --speed 1 --explain", 0, "best first"),
    "check": ("check good.csv --map level.npz -m quad.toml", 0, "no violation"),
    "check, violations": ("check fast.csv --map level.npz -m quad.toml", 3, "1 with violations"),
    "calibrate": ("calibrate stops.csv -m atv --sheet sheet.html", 0, "stops found: 24"),
    "coverage": ("coverage stops.csv -m atv", 0, "the model covers the 24 measured stops"),
    "terrain": ("terrain terrain.csv -m husky.toml", 0, "agrees with its label in the log: 0%"),
    "simulate": ("simulate stops.csv -m atv --out sim.csv", 0, "wrote sim.csv"),
    "discrepancy": ("discrepancy dozen.csv -m atv --out found", 0, "wrote found/report.html"),
    "demo": ("demo --out demo", 0, "Open demo/report.html"),
    "export": ("export atv", 0, "stopping_distance"),
    "export, C++": (
        "export atv --cpp generated --resolution 0.1 --height-std 0",
        0,
        "wrote generated/atv.hpp",
    ),
    "params diff": ("params diff atv.toml husky.toml", 0, "stops on base"),
    "fleet calibrate": (
        "fleet calibrate stops.csv few.csv -m atv --out models --workers 0",
        0,
        "wrote 2 model files to models",
    ),
}


def keys_of(value: Any, where: str = "") -> Iterator[str]:
    """Dotted keys; items of a list share theirs."""
    if isinstance(value, dict):
        for key, item in value.items():
            yield f"{where}{key}"
            yield from keys_of(item, f"{where}{key}.")
    elif isinstance(value, list):
        for item in value:
            yield from keys_of(item, f"{where}[].")


def once(work: Callable[..., Any]) -> Callable[..., Any]:
    results: list[Any] = []

    def first(*arguments: Any, **named: Any) -> Any:
        results[:] = results or [work(*arguments, **named)]
        return results[0]

    return first


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_prints_its_keys_and_its_table(
    world: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    command, status, line = COMMANDS[name]
    # Its JSON and its table are of one result.
    monkeypatch.setattr(discrepancy, "investigate", once(discrepancy.investigate))
    monkeypatch.setattr(calibrate, "learn", once(calibrate.learn))
    done = here(*command.split(), "--json")
    assert done.returncode == status, done.stderr
    keys = sorted(set(keys_of(json.loads(done.stdout))))
    assert keys == json.loads(GOLDEN.read_text())[name]
    done = here(*command.split())
    assert done.returncode == status, done.stderr
    assert line in " ".join(done.stdout.split()), done.stdout


def commands() -> dict[str, Any]:
    groups = dict(typer.main.get_command(app.app).commands)  # type: ignore[attr-defined]
    fleet = groups.pop("fleet").commands
    return groups | {f"fleet {name}": command for name, command in fleet.items()}


def test_every_command_has_json_and_help() -> None:
    assert len(commands()) > 18
    for name, command in commands().items():
        options = {text for option in command.params for text in option.opts}
        assert "--json" in options or name == "bench", name
        assert command.help, name


SCHEMAS = ("plan", "check", "calibrate", "coverage", "terrain", "simulate", "fleet calibrate")


@pytest.mark.parametrize("name", SCHEMAS)
def test_a_schema_describes_the_json(name: str) -> None:
    schema = json.loads(here(*name.split(), "--json-schema").stdout)
    summary = schema["$defs"][schema["$ref"].rpartition("/")[2]]
    golden = {key for key in json.loads(GOLDEN.read_text())[name] if "." not in key}
    assert golden <= summary["properties"].keys()
    assert set(summary["required"]) <= golden


TABLES = tomllib.loads((Path(__file__).parents[2] / "bad_inputs" / "commands.toml").read_text())


@pytest.mark.parametrize("table", TABLES["table"], ids=lambda table: table.get("file", "words"))
def test_bad_input_is_one_line_and_status_2(world: Path, table: dict[str, Any]) -> None:
    for text, *expected in table["rows"]:
        content = text
        if table.get("file") == "model.toml":
            before, after = text.split(" -> ")
            model = (world / "atv.toml").read_text()
            assert before in model
            content = model.replace(before, after)
        if "file" in table:
            (world / table["file"]).write_text(content)
        one_line_of(here(*table["command"].replace("{}", content).split()), *expected)


def test_an_interrupt_while_libraries_load_ends_as_later_ones() -> None:
    program = """
import sys
import slopewise.__main__

class Interrupted:
    def find_spec(self, name, *_):
        if name == "slopewise.services.cli.app":
            raise KeyboardInterrupt

sys.meta_path.insert(0, Interrupted())
slopewise.__main__.main()
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "")
