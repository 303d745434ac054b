"""The guard's worst case of a model: every field is known, and spread makes stops longer."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path
from typing import Any

import pytest

from slopewise.models.errors import InputError
from slopewise.models.input_errors import Tracking
from slopewise.models.parameters import Braking, Effect, Limits, Model, Terrain
from slopewise.models.steering import Steering
from slopewise.models.surface_braking import SurfaceBraking, UphillBraking
from slopewise.models.vehicle import Vehicle
from slopewise.services.guard.guard_model import read_guard_model
from tests.services.guard.guard_fixtures import ATV, MODEL, slope
from tests.services.guard.test_stop_distances import arc_on, stop_from

FORCE = {"m_m", "b_m", "m_b", "b_b"}
SPREAD = {"force_std", "force_scatter", "dead_time_std"}
OF_SURFACE = FORCE | SPREAD | {"dead_time", "distance_offset", "speed_range", "grade_range"}
OF_SURFACE |= {"roll_range", "sliding_friction", "uphill"}
USED: dict[type[Any], set[str]] = {
    Model: {"vehicle", "braking", "terrain", "limits", "effect", "steering", "tracking"},
    Steering: {"kind", "reference"},
    Tracking: {"cross_track_std", "cross_track_per_curvature", "heading_std"}
    | {"along_track_std", "latency", "latency_std"},
    Vehicle: {"wheelbase", "track_width", "cg_x", "cg_z", "wheel_radius", "max_wheel_speed"}
    | {"width", "wheel_width", "front_overhang", "rear_overhang", "max_step"}
    | {"ground_clearance", "drive", "front_brake_share"},
    Braking: OF_SURFACE
    | {"level", "dead_band", "saturation", "extrapolate", "extrapolation_margin"}
    | {"speed_error", "terrain"},
    SurfaceBraking: OF_SURFACE | {"class_id", "state_of"},
    UphillBraking: {"m_m", "b_m"},
    Terrain: {"motion_resistance", "braking_resistance"},
    Limits: {"speed", "decel", "lateral_accel", "min_load"},
    Effect: {"name", "parameters"},
}
"""Fields from which a stop of the guard is computed."""

UNUSED: dict[type[Any], set[str]] = {
    Model: {"name"},
    # Limits of the steering: a base turns at most as commanded.
    Steering: {"max_angle", "min_radius", "max_rate"},
    # The guard knows no path: its courses begin at the measured pose.
    Tracking: {"lookahead"},
    # Thrust, motors and suspension.
    Vehicle: {"mass", "max_drive_force", "max_drive_power", "motor_torque_constant"}
    | {"gear_ratio", "idle_current", "wheel_travel"}
    | {"ride_frequency", "ride_damping"},
    # Both speeds in the dead time are covered; two standard deviations stand for the covariance,
    # or the promised stop distance for the coefficients.
    Braking: {"time_offset", "covariance", "distance", "drive_in_dead_time", "speed_by_grade"},
    SurfaceBraking: {"time_offset", "covariance", "distance", "speed_by_grade"},
    UphillBraking: set(),
    Terrain: {"lateral_resistance", "slip_track"},
    Limits: {"accel", "jerk", "vertical_accel", "max_path_deviation"},
    Effect: {"covariance", "source"},
}
"""Fields that change no stop of the guard; a new one has to be entered in one of the two."""


@pytest.mark.parametrize("kind", USED, ids=lambda kind: kind.__name__)
def test_every_field_of_a_model_is_known_to_the_guard(kind: type[Any]) -> None:
    assert not USED[kind] & UNUSED[kind]
    assert {field.name for field in dataclasses.fields(kind)} == USED[kind] | UNUSED[kind]


@pytest.mark.parametrize(
    ("old", "new", "field"),
    [
        ("[braking] ", "[braking]\nboost = 2.0\n#", "braking.boost"),
        ("b_b = 0.40", "b_b = 'strong'", "braking.b_b"),
        ("b_b = 0.40", "b_b = nan", "braking.b_b"),
        ("dead_time = 0.30", "dead_time = -1.0", "braking.dead_time"),
        ("[limits]", "[limit]", "limit"),
        ("speed_range = [1.0, 4.0]", "speed_range = [4.0, 1.0]", "speed_range"),
        ("", "[[effect]]\nname = 'ghost'\nparameters = {}\n", "effect"),
    ],
)
def test_model_files_that_cannot_be_used_are_named(
    tmp_path: Path, old: str, new: str, field: str
) -> None:
    file, text = tmp_path / "model.toml", ATV.read_text()
    assert old in text
    file.write_text(text.replace(old, new, 1) if old else f"{text}\n{new}")
    with pytest.raises(InputError, match=field):
        read_guard_model(file)


def distance(file: Path, text: str) -> float:
    """Stopping distance from 3 m/s on level ground [m]."""
    file.write_text(text)
    model = read_guard_model(file)
    return stop_from(model, arc_on(model, slope(0.0)), 3.0)


def test_spread_lag_and_partial_brakes_make_stops_longer(tmp_path: Path) -> None:
    text, file = ATV.read_text(), tmp_path / "model.toml"
    nominal = distance(file, text)
    for line in (
        "force_std = 0.02",
        "force_scatter = 0.05",
        "dead_time_std = 0.1",
        "speed_error = 0.3",
        "sliding_friction = 0.3",
        "extrapolate = true",
        "level = 0.7",
        "dead_band = 0.2\nlevel = 0.9",
    ):
        changed = text.replace("dead_time = 0.30", f"{line}\ndead_time = 0.30", 1)
        assert distance(file, changed) > nominal, line
    lag = '\n[[effect]]\nname = "brake_lag"\nparameters = { tau = 0.3 }\n'
    assert distance(file, text + lag) == pytest.approx(nominal + 0.9)


def test_ground_that_may_be_any_surface_has_the_worst_numbers(tmp_path: Path) -> None:
    """A class that the model does not name: the slopes, speed and dead time of the mud hold."""
    file = tmp_path / "model.toml"
    mud = "[braking.terrain.mud]\nb_b = 0.40\ndead_time = 0.6\ngrade_range = [-0.1, 0.1]\n"
    file.write_text(f"{ATV.read_text()}\n{mud}speed_range = [1.0, 2.0]\n")
    model = read_guard_model(file)
    for name, longer in (("", 0.0), ("mud", 0.9), ("gravel", 0.9)):
        level, steep = (dataclasses.replace(slope(g), class_names=(name,)) for g in (0.0, 0.15))
        stop = stop_from(model, arc_on(model, level), 3.0)
        assert stop == pytest.approx(distance(file, ATV.read_text()) + longer)
        assert ("steeper" in arc_on(model, steep).end.reason) == (longer > 0.0)


def test_width_that_is_omitted_follows_the_tyres(tmp_path: Path) -> None:
    file, text = tmp_path / "model.toml", ATV.read_text()
    tyres = re.sub(r"(?m)^width = .*$", "wheel_width = 0.3", text, count=1)
    tyres = tyres if tyres != text else text.replace("wheelbase", "wheel_width = 0.3\nwheelbase", 1)
    file.write_text(tyres)
    assert read_guard_model(file).vehicle.shape.width == MODEL.vehicle.track_width + 0.3
