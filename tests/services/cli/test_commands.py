"""Every command: status, keys of its JSON, and a line of its table."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer

from slopewise.services.cli import app
from tests.services.command_line import here

GOLDEN = Path(__file__).parents[2] / "golden" / "json_keys.json"

COMMANDS: dict[str, tuple[str, int, str]] = {
    "plan": ("plan map.npz paths.csv -m atv --speed 1 --explain --check", 0, "best first"),
    "check": ("check good.csv --map level.npz -m quad.toml", 0, "no violation"),
    "check, violations": ("check fast.csv --map level.npz -m quad.toml", 3, "1 with violations"),
    "calibrate": ("calibrate stops.csv -m atv --sheet sheet.html", 0, "stops found: 24"),
    "coverage": ("coverage stops.csv -m atv", 0, "the model covers the 24 measured stops"),
    "terrain": ("terrain terrain.csv -m husky.toml", 0, "agrees with its label in the log: 0%"),
    "simulate": ("simulate stops.csv -m atv --out sim.csv", 0, "wrote sim.csv"),
    "discrepancy": ("discrepancy stops.csv -m atv --out found", 0, "wrote found/report.html"),
    "demo": ("demo --out demo", 0, "Open demo/report.html"),
    "export": ("export atv", 0, "stopping_distance"),
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


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_prints_its_keys_and_its_table(world: Path, name: str) -> None:
    command, status, line = COMMANDS[name]
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
