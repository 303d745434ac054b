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


@pytest.mark.parametrize(("key", "value", "fragment"), bad_inputs("model_units"))
def test_planner_and_guard_refuse_it_and_name_the_unit(
    tmp_path: Path, key: str, value: Any, fragment: str
) -> None:
    planner, guard = refusals(written(tmp_path, changed(key, value)))
    assert fragment in planner
    table = "effect[0].parameters" if key == "effect" else key.rsplit(".", 1)[0]
    assert f"{table}." in planner
    assert f"{table}." in guard


def scaled(**vehicle: float) -> dict[str, Any]:
    tables = copy.deepcopy(ATV)
    tables["vehicle"] = {
        k: v for k, v in tables["vehicle"].items() if k not in ("max_step", "wheel_travel")
    } | vehicle
    return tables


CAR = scaled(
    mass=3.0,
    wheelbase=0.3,
    track_width=0.25,
    cg_x=0.15,
    cg_z=0.06,
    wheel_radius=0.05,
    width=0.28,
    max_drive_force=25.0,
    max_drive_power=150.0,
    ground_clearance=0.03,
    wheel_width=0.04,
    front_overhang=0.05,
    rear_overhang=0.05,
)
CAR["braking"] |= {"b_b": 0.7, "dead_time": 0.05, "distance_offset": 0.02}
CAR["limits"] |= {"decel": 5.0, "jerk": 50.0}
CAR["terrain"]["slip_track"] = 0.3
TRUCK = scaled(
    mass=600e3,
    wheelbase=7.0,
    track_width=6.0,
    cg_x=3.0,
    cg_z=4.0,
    wheel_radius=2.0,
    width=9.0,
    max_drive_force=1.5e6,
    max_drive_power=2.5e6,
    ground_clearance=1.2,
    wheel_width=1.4,
    front_overhang=3.0,
    rear_overhang=4.0,
    max_wheel_speed=18.0,
)
TRUCK["terrain"]["slip_track"] = 6.0
TRUCK["limits"]["speed"] = 15.0
TRUCK["braking"]["speed_range"] = [2.0, 15.0]
# Over a row of plants.
STRADDLER = scaled(
    mass=210.0,
    wheelbase=1.2,
    track_width=1.4,
    cg_x=0.6,
    cg_z=0.8,
    wheel_radius=0.21,
    width=1.7,
    max_drive_force=1500.0,
    max_drive_power=2000.0,
    ground_clearance=0.69,
)
STRADDLER["terrain"]["slip_track"] = 2.0
ROVER = scaled(
    mass=1000.0,
    wheelbase=2.2,
    track_width=2.3,
    cg_x=1.1,
    cg_z=0.9,
    wheel_radius=0.26,
    width=2.7,
    max_drive_force=1500.0,
    max_drive_power=110.0,
    ground_clearance=0.6,
    max_wheel_speed=0.042,
)
ROVER["terrain"]["slip_track"] = 3.5
ROVER["limits"]["speed"] = 0.04
ROVER["braking"]["speed_range"] = [0.01, 0.04]
SIZES = {
    "1/10 car": CAR,
    "mining truck": TRUCK,
    "atv": ATV,
    "straddler": STRADDLER,
    "Mars rover": ROVER,
}


@pytest.mark.parametrize("tables", SIZES.values(), ids=SIZES)
def test_vehicles_of_all_sizes_are_read(tmp_path: Path, tables: dict[str, Any]) -> None:
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
