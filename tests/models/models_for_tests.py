"""One model that many tests vary."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from slopewise.models.parameters import Braking, Effect, Limits, Model, Terrain
from slopewise.models.vehicle import Vehicle

BASE = Model(
    name="test",
    vehicle=Vehicle(
        mass=500.0,
        wheelbase=1.2,
        track_width=1.0,
        cg_x=0.6,
        cg_z=0.55,
        wheel_radius=0.28,
        drive="skid_steer",
        max_wheel_speed=6.0,
        max_drive_force=2500.0,
        max_drive_power=6000.0,
    ),
    braking=Braking(
        m_m=-0.03,
        b_m=-0.35,
        m_b=0.015,
        b_b=0.40,
        dead_time=0.3,
        distance_offset=0.2,
        speed_range=(1.0, 4.0),
        grade_range=(-0.26, 0.26),
    ),
    terrain=Terrain(motion_resistance=0.13, lateral_resistance=0.20, slip_track=1.15),
    limits=Limits(speed=4.0, accel=1.0, decel=1.5, jerk=2.0, lateral_accel=2.0, min_load=0.1),
)


def with_effect(name: str, **parameters: float) -> Model:
    """The base model with one effect."""
    return replace(BASE, effect=(Effect(name=name, parameters=parameters),))


def with_braking(**changes: Any) -> Model:
    """The base model with other braking parameters."""
    return replace(BASE, braking=replace(BASE.braking, **changes))
