"""Tables of the model file that goes with a log."""

from __future__ import annotations

from typing import Any

_PLANT: dict[str, Any] = {
    "mass": 500.0,
    "wheelbase": 1.2,
    "track_width": 1.0,
    "cg_x": 0.6,
    "cg_z": 0.55,
    "wheel_radius": 0.28,
    "drive": "skid_steer",
    "max_wheel_speed": 7.0,
    "max_drive_force": 2500.0,
    "max_drive_power": 6000.0,
}
_SLIP_TRACK = 1.15  # of the track width


def tables_of(braking: dict[str, float], vehicle: dict[str, Any] | None = None) -> dict[str, Any]:
    """Of the vehicle before anything happened to it.

    Args:
        braking: coefficients and dead time. vehicle: its table; the plant's if left out.
    """
    vehicle = vehicle or _PLANT
    return {
        "name": "hidden",
        "vehicle": vehicle,
        "braking": braking | {"speed_range": (0.5, 6.5), "grade_range": (-0.28, 0.30)},
        "terrain": {
            "motion_resistance": 0.10,
            "lateral_resistance": 0.2,
            "slip_track": _SLIP_TRACK * vehicle["track_width"],
        },
        "limits": {
            "speed": 6.0,
            "accel": 1.0,
            "decel": 1.5,
            "jerk": 2.0,
            "lateral_accel": 2.0,
            "min_load": 0.10,
        },
    }
