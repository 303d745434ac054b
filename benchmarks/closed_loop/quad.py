"""The vehicle of the closed loop: its data sheet, and what only its world knows."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from slopewise.models.parameters import Limits, Model, Terrain
from slopewise.models.vehicle import Vehicle
from slopewise.services.io.model_file import read_model

OVERHANG = 0.95  # Distance from the middle of the wheelbase to the front of the body [m]
QUAD = Vehicle(
    mass=500.0,
    wheelbase=1.2,
    track_width=1.0,
    cg_x=0.6,
    cg_z=0.55,
    wheel_radius=0.28,
    drive="ackermann",
    max_wheel_speed=6.0,
    max_drive_force=3600.0,
    max_drive_power=14000.0,
    front_overhang=OVERHANG - 0.6,
    rear_overhang=OVERHANG - 0.6,
)
"""Data sheet, known to the planner."""

WHEEL_PLACES = [
    (x * QUAD.wheelbase, y * QUAD.track_width) for x in (0.5, -0.5) for y in (0.5, -0.5)
]
"""Wheel contacts in the body frame [m]."""

ROLLING = Terrain(motion_resistance=0.08, lateral_resistance=0.2, slip_track=1.0)
"""Data sheet: the largest rolling resistance of the surfaces."""

LIMITS = Limits(speed=4.0, accel=1.5, decel=2.0, jerk=4.0, lateral_accel=2.0, min_load=0.2)
"""Limits of the plans; 4 m/s is the fastest speed of the paper's stops."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrueVehicle:
    """Parameters of the physics engine that the planner never sees."""

    friction: tuple[float, ...] = (0.90, 0.66, 0.54)  # friction of the tyres on each surface [1]
    # rolling resistance on each surface over the load [1]
    resistance: tuple[float, ...] = (0.02, 0.06, 0.04)
    brake_ratio: float = 0.55  # full brake torque at the rims over the weight [1]
    front_share: float = 0.65  # front share of the brake torque [1]
    brake_scatter: float = 0.0075  # standard deviation of the brake torque from stop to stop [1]
    dead_time: float = 0.12  # dead time of the hydraulics [s]
    build_up: float = 0.10  # their first-order time constant [s]
    spring: float = 26000.0  # spring, damper: suspension of one wheel [N/m], [N s/m]
    damper: float = 1500.0
    wheel_mass: float = 12.0  # mass of one wheel [kg]
    slip: float = 0.15  # wheel slip at which the anti-lock releases [1]


HIDDEN = TrueVehicle()


def learned_model(name: str = "slopewise") -> Model:
    """A model learned from this vehicle's stops, or the one of exact sensors, `perfect`.

    Fitted to 300 drives by version 0.1.0 of this benchmark, which is no longer done: force by
    surface, cross slopes, crests, and the margins that cover the stops.
    """
    return read_model(Path(__file__).with_name(f"{name}.toml"))
