"""Model files with numbers in another unit, or that no vehicle has: refused by every reader."""

from __future__ import annotations

import copy
import dataclasses
import tomllib
from pathlib import Path
from typing import Any

import pytest
import tomli_w

from slopewise.models.errors import InputError
from slopewise.models.plausibility import check_plausible
from slopewise.services.guard.guard_model import read_guard_model
from slopewise.services.io.files import shipped_files
from slopewise.services.io.model_file import find_model, model_to_dict, read_model, write_model
from tests.services.faults import bad_inputs

ATV = tomllib.loads(find_model("atv").read_text())
ATV["braking"]["sliding_friction"] = 0.6
ATV["braking"]["roll_range"] = [-0.26, 0.26]
ATV["braking"]["terrain"] = {"gravel": {"b_b": 0.35, "dead_time": 0.4}}
ATV["braking"]["uphill"] = {"m_m": -0.03, "b_m": -0.3}
ATV["vehicle"] |= {
    "motor_torque_constant": 0.044,
    "gear_ratio": 78.7,
    "idle_current": 0.8,
    "max_step": 0.09,
    "wheel_width": 0.2,
    "wheel_travel": 0.09,
    "front_overhang": 0.3,
    "rear_overhang": 0.3,
}


def written(folder: Path, tables: dict[str, Any]) -> Path:
    file = folder / "m.toml"
    file.write_bytes(tomli_w.dumps(tables).encode())
    return file


def changed(key: str, value: Any) -> dict[str, Any]:
    tables = copy.deepcopy(ATV)
    *path, last = key.split(".")
    table = tables
    for name in path:
        table = table[name]
    table[last] = value
    return tables


def refusals(file: Path) -> list[str]:
    refused = []
    for read in (read_model, read_guard_model):
        with pytest.raises(InputError) as caught:
            read(file)
        assert len(str(caught.value).splitlines()) == 1
        assert str(caught.value).startswith(str(file))
        refused.append(str(caught.value))
    return refused


def test_planner_and_guard_refuse_it_and_name_the_unit(tmp_path: Path) -> None:
    for key, value, fragment in bad_inputs("model_units"):
        planner, guard = refusals(written(tmp_path, changed(key, value)))
        assert fragment in planner, key
        table = "effect[0].parameters" if key == "effect" else key.rsplit(".", 1)[0]
        assert f"{table}." in planner, key
        assert f"{table}." in guard, key


SIZES = tomllib.loads(Path(__file__).with_name("vehicle_sizes.toml").read_text())


@pytest.mark.parametrize("name", SIZES)
def test_vehicles_of_all_sizes_are_read(tmp_path: Path, name: str) -> None:
    tables = copy.deepcopy(ATV)
    del tables["vehicle"]["max_step"], tables["vehicle"]["wheel_travel"]
    for table, values in SIZES[name].items():
        tables[table] |= values
    file = written(tmp_path, tables)
    model = read_model(file)
    read_guard_model(file)
    write_model(model, tmp_path / "again.toml")
    assert read_model(tmp_path / "again.toml") == model


def test_a_service_deceleration_far_beyond_the_brakes(tmp_path: Path) -> None:
    tables = changed("braking.b_b", 0.2)
    tables["limits"]["decel"] = 9.0
    for refusal in refusals(written(tmp_path, tables)):
        assert "limits.decel: expected 0 … 7.65 [m/s²] with brakes of 0.26 of the weight" in refusal


def test_a_limit_a_little_above_the_wheels_is_read(tmp_path: Path) -> None:
    assert read_model(written(tmp_path, changed("limits.speed", 7.0))).limits.speed == 7.0


@pytest.mark.parametrize("name", shipped_files("vehicles"))
def test_shipped_vehicles_are_plausible(name: str) -> None:
    check_plausible(model_to_dict(read_model(find_model(name))))


def test_what_would_not_be_read_again_is_not_written(tmp_path: Path) -> None:
    model = read_model(find_model("atv"))
    strong = dataclasses.replace(model, braking=dataclasses.replace(model.braking, b_b=1.8))
    with pytest.raises(InputError, match=r"m\.toml: braking\.b_b: expected a force over weight"):
        write_model(strong, tmp_path / "m.toml")
    assert list(tmp_path.iterdir()) == []
