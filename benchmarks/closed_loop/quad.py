"""The vehicle of the closed loop: its data sheet, and what only its world knows."""

from __future__ import annotations

from dataclasses import dataclass

from slopewise.models.parameters import Limits, Terrain
from slopewise.models.vehicle import Vehicle

OVERHANG = 0.95
"""Distance from the middle of the wheelbase to the front of the body [m]."""

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
    """Parameters of the physics engine that the planner never sees.

    Attributes:
        friction: friction of the tyres on each surface [1].
        resistance: rolling resistance on each surface over the load [1].
        brake_ratio: full brake torque at the rims over the weight [1].
        front_share: front share of the brake torque [1].
        brake_scatter: standard deviation of the brake torque from stop to stop [1].
        dead_time: dead time of the hydraulics [s].
        build_up: their first-order time constant [s].
        spring, damper: suspension of one wheel [N/m], [N s/m].
        wheel_mass: mass of one wheel [kg].
        slip: wheel slip at which the anti-lock releases [1].
    """

    friction: tuple[float, ...] = (0.90, 0.66, 0.54)
    resistance: tuple[float, ...] = (0.02, 0.06, 0.04)
    brake_ratio: float = 0.55
    front_share: float = 0.65
    brake_scatter: float = 0.0075
    dead_time: float = 0.12
    build_up: float = 0.10
    spring: float = 26000.0
    damper: float = 1500.0
    wheel_mass: float = 12.0
    slip: float = 0.15


HIDDEN = TrueVehicle()
