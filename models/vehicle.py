"""The vehicle: geometry, mass and drive. All lengths in metres, on level ground."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from models.errors import ParameterError
from models.quantity import quantity, validate_quantities


@dataclass(frozen=True, slots=True, kw_only=True)
class Vehicle:
    """A four-wheeled vehicle with its centre of gravity in the plane of symmetry."""

    mass: float = quantity("kg", "Mass with payload.", above=0.0)
    wheelbase: float = quantity("m", "Distance between the axles, L.", above=0.0)
    track_width: float = quantity("m", "Distance between left and right wheels, B.", above=0.0)
    cg_x: float = quantity("m", "Centre of gravity ahead of the rear axle.", above=0.0)
    cg_z: float = quantity("m", "Height of the centre of gravity.", above=0.0)
    wheel_radius: float = quantity("m", "Radius of the loaded wheel.", above=0.0)
    drive: Literal["skid_steer", "ackermann"]
    max_wheel_speed: float = quantity("m/s", "Highest speed at the rim of a wheel.", above=0.0)
    max_drive_force: float = quantity("N", "Highest thrust of all wheels together.", above=0.0)
    max_drive_power: float = quantity("W", "Highest power of all wheels together.", above=0.0)
    motor_torque_constant: float | None = quantity(
        "N m/A", "Torque constant k_t of a drive motor.", default=None, above=0.0
    )
    gear_ratio: float | None = quantity(
        "1", "Gearhead ratio, motor turns a wheel turn.", default=None, above=0.0
    )
    idle_current: float | None = quantity(
        "A", "Motor current with the wheels lifted.", default=None, at_least=0.0
    )

    def __post_init__(self) -> None:
        validate_quantities(self)
        if not self.cg_x < self.wheelbase:
            raise ParameterError(
                "cg_x", f"less than the wheelbase of {self.wheelbase:g} m, got {self.cg_x:g}"
            )
