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

WRONG: list[tuple[str, Any, str]] = [
    ("vehicle.mass", 0.5, "with a mass of 0.5 kg; 0.5 t would be 500 kg"),
    ("vehicle.mass", 500e3, "500000 g would be 500 kg"),
    ("vehicle.wheelbase", 1200, "expected 0.05 … 20 [m], got 1200; 1200 mm would be 1.2 m"),
    ("vehicle.wheelbase", 120, "120 cm would be 1.2 m"),
    ("vehicle.track_width", 1000, "track"),
    ("vehicle.track_width", 0.1, "with a wheelbase of 1.2 m"),
    ("vehicle.cg_x", 600, "less than the wheelbase of 1.2 m, got 600; 600 mm would be 0.6 m"),
    ("vehicle.cg_x", 1.199, "with a wheelbase of 1.2 m"),
    ("vehicle.cg_x", 0.006, "with a wheelbase of 1.2 m"),
    ("vehicle.cg_z", 55, "55 cm would be 0.55 m"),
    ("vehicle.cg_z", 6.0, "with a track of 1 m"),
    ("vehicle.cg_z", 0.0055, "with a track of 1 m and wheels of 0.28 m"),
    ("vehicle.wheel_radius", 280, "expected 0.02 … 2.5 [m], got 280; 280 mm would be 0.28 m"),
    ("vehicle.wheel_radius", 0.92, "with a wheelbase of 1.2 m, got 0.92; 0.92 ft would be 0.28 m"),
    ("vehicle.max_wheel_speed", 6000, "6000 mm/s would be 6 m/s"),
    ("vehicle.max_drive_force", 2.5, "2.5 kN would be 2500 N"),
    ("vehicle.max_drive_force", 12000.0, "expected 49 … 9810 [N] with a mass of 500 kg"),
    ("vehicle.max_drive_power", 6.0, "6 kW would be 6000 W"),
    ("vehicle.motor_torque_constant", 44.0, "44 mN m/A would be 0.044 N m/A"),
    ("vehicle.idle_current", 800.0, "800 mA would be 0.8 A"),
    ("vehicle.ride_frequency", 150.0, "150 1/min would be 2.5 Hz"),
    ("vehicle.width", 1200, "1200 mm would be 1.2 m"),
    ("vehicle.ground_clearance", 2.5, "expected 0 … 1.68 [m] with wheels of 0.28 m"),
    ("vehicle.ground_clearance", 25, "25 cm would be 0.25 m"),
    ("vehicle.max_step", 90, "90 mm would be 0.09 m"),
    ("vehicle.wheel_travel", 9, "9 cm would be 0.09 m"),
    ("vehicle.wheel_width", 200, "200 mm would be 0.2 m"),
    ("vehicle.front_overhang", 30, "30 cm would be 0.3 m"),
    ("vehicle.rear_overhang", 9.0, "with a wheelbase of 1.2 m"),
    ("braking.b_b", 3.9, "a force over weight of 0.02 … 1.5 [1], got 3.9; 3.9 m/s² would be 0.398"),
    ("braking.b_b", 40.0, "40 % would be 0.4"),
    ("braking.b_m", -3.43, "-0.35 if that is m/s²"),
    ("braking.m_b", 0.4, "at 4 m/s on level ground, got 2"),
    ("braking.m_m", -1.7, "as a force over weight at 4 m/s"),
    ("braking.dead_time", 300, "300 ms would be 0.3 s"),
    ("braking.distance_offset", 200, "200 mm would be 0.2 m"),
    ("braking.sliding_friction", 60, "60 % would be 0.6"),
    ("braking.force_std", 2.0, "2 % would be 0.02"),
    ("braking.speed_range", [3.6, 14.4], "with wheels of at most 6 m/s, got 14.4; 14.4 km/h"),
    ("braking.grade_range", [-15.0, 15.0], "degrees?"),
    ("braking.grade_range", [-1.5, 1.5], "expected -1 … 1 [rad], got -1.5; -1.5 ° would be -0.0"),
    ("braking.roll_range", [-1.5, 1.5], "expected -1 … 1 [rad]"),
    ("braking.speed_by_grade", [[-0.2, 14.4], [0.2, 3.6]], "with wheels of at most 6 m/s"),
    ("braking.uphill.b_m", -3.0, "-0.306 if that is m/s²"),
    ("braking.terrain.gravel.b_b", 3.4, "3.4 m/s² would be 0.347"),
    ("braking.terrain.gravel.dead_time", 400, "400 ms would be 0.4 s"),
    ("terrain.motion_resistance", 13, "13 % would be 0.13"),
    ("terrain.lateral_resistance", 20, "20 % would be 0.2"),
    ("terrain.slip_track", 1150, "1150 mm would be 1.15 m"),
    ("terrain.slip_track", 45.3, "with a track of 1 m, got 45.3; 45.3 in would be 1.15 m"),
    ("limits.speed", 14.4, "with wheels of at most 6 m/s, got 14.4; 14.4 km/h would be 4 m/s"),
    ("limits.accel", 1000, "1000 mm/s² would be 1 m/s²"),
    ("limits.jerk", 2000, "2000 mm/s³ would be 2 m/s³"),
    ("limits.lateral_accel", 2000, "2000 mm/s² would be 2 m/s²"),
    ("limits.min_load", 10, "10 % would be 0.1"),
    ("limits.max_path_deviation", 300, "300 mm would be 0.3 m"),
]

EFFECTS: list[tuple[str, dict[str, float], str]] = [
    ("brake_lag", {"tau": 300.0}, "300 ms would be 0.3 s"),
    ("wheel_lockup", {"mu": 60.0}, "60 % would be 0.6"),
    ("headwind", {"c": 0.01, "wind": 5.0, "direction": 90.0}, "90 ° would be 1.57 rad"),
    ("surface_patch", {"delta": -9.0, "x": 0.0, "y": 0.0, "radius": 3.0}, "-9 % would be -0.09"),
    ("viscous_resistance", {"c": 9.81}, "expected 0 … 0.5 [s/m]"),
]


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


@pytest.mark.parametrize(("key", "value", "fragment"), WRONG)
def test_planner_and_guard_refuse_it_and_name_the_unit(
    tmp_path: Path, key: str, value: Any, fragment: str
) -> None:
    planner, guard = refusals(written(tmp_path, changed(key, value)))
    assert fragment in planner
    table = key.rsplit(".", 1)[0]
    assert f"{table}." in planner
    assert f"{table}." in guard


@pytest.mark.parametrize(("name", "parameters", "fragment"), EFFECTS)
def test_parameters_of_effects(
    tmp_path: Path, name: str, parameters: dict[str, float], fragment: str
) -> None:
    tables = {**ATV, "effect": [{"name": name, "parameters": parameters}]}
    for refusal in refusals(written(tmp_path, tables)):
        assert "effect[0].parameters." in refusal
        assert fragment in refusal


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
