"""The vehicle: geometry, mass and drive. All lengths in metres, on level ground."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, NamedTuple

from slopewise.models.errors import ParameterError
from slopewise.models.quantity import non_negative, positive, unit_guess, validate_quantities

_WHEEL_WIDTH = 0.7
"""Wheel width over radius, assumed where the model file has none [1]."""
_CLEARANCE = 0.75
"""Ground clearance over wheel radius, assumed where the model file has none [1]."""
_STEP = 1.0 / 3.0
"""Step height and wheel travel over wheel radius, assumed where the model file has none [1]."""


class Shape(NamedTuple):
    """Sizes that decide what the vehicle can pass over and next to [m], defaults filled in.

    Attributes:
        width: of body and wheels, the wider.
        front, rear: ends of the body, ahead of and behind the middle of the wheelbase.
        clearance: underside above level ground.
        max_step: that a wheel may climb or fall. wheel_travel: below the plane of the others.
        wheel_width: width of a tyre.
        assumed: names of those missing in the model file.
    """

    width: float
    front: float
    rear: float
    clearance: float
    max_step: float
    wheel_travel: float
    wheel_width: float
    assumed: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Vehicle:
    """A four-wheeled vehicle with its centre of gravity in the plane of symmetry."""

    mass: float = positive("kg", "Mass with payload.", (0.2, 1e6))
    wheelbase: float = positive("m", "Distance between the axles, L.", (0.05, 20.0))
    track_width: float = positive("m", "Distance between left and right wheels, B.", (0.05, 15.0))
    cg_x: float = positive("m", "Centre of gravity ahead of the rear axle.", (0.005, 15.0))
    cg_z: float = positive("m", "Height of the centre of gravity.", (0.005, 8.0))
    wheel_radius: float = positive("m", "Radius of the loaded wheel.", (0.02, 2.5))
    drive: Literal["skid_steer", "ackermann"]
    max_wheel_speed: float = positive("m/s", "Highest speed at the rim of a wheel.", (0.01, 40.0))
    max_drive_force: float = positive("N", "Highest thrust of all wheels together.", (0.2, 1e7))
    max_drive_power: float = positive("W", "Highest power of all wheels together.", (0.1, 1e7))
    motor_torque_constant: float | None = positive(
        "N m/A", "Torque constant k_t of a drive motor.", (1e-4, 10.0), default=None
    )
    gear_ratio: float | None = positive(
        "1", "Gearhead ratio, motor turns a wheel turn.", (0.1, 5000.0), default=None
    )
    idle_current: float | None = non_negative(
        "A", "Motor current with the wheels lifted.", (0.0, 200.0), default=None
    )

    width: float | None = positive(
        "m",
        "Widest part of body and wheels; track width and wheel width by default.",
        (0.05, 15.0),
        default=None,
    )
    front_overhang: float | None = non_negative(
        "m", "Body ahead of the front axle; the wheel radius by default.", (0.0, 10.0), default=None
    )
    rear_overhang: float | None = non_negative(
        "m", "Body behind the rear axle; the wheel radius by default.", (0.0, 10.0), default=None
    )
    ground_clearance: float | None = non_negative(
        "m",
        "Underside of the body above level ground; 3/4 of the wheel radius by default.",
        (0.0, 3.0),
        default=None,
    )
    max_step: float | None = positive(
        "m",
        "Highest step that a wheel may climb or fall; 1/3 of its radius by default.",
        (1e-3, 2.0),
        default=None,
    )
    wheel_width: float | None = positive(
        "m", "Width of a tyre; 0.7 of the wheel radius by default.", (2e-3, 2.0), default=None
    )
    wheel_travel: float | None = positive(
        "m",
        "How far a wheel reaches below the plane of the other three; 1/3 of its radius by default.",
        (1e-3, 2.0),
        default=None,
    )
    front_brake_share: float | None = non_negative(
        "1",
        "Part of the braking force on the front axle; by default that of the static load, or, "
        "skid-steered, wheels of a side that turn as one.",
        default=None,
        at_most=1.0,
    )
    ride_frequency: float = positive(
        "Hz", "Bounce of the body on its suspension or tyres.", (0.2, 50.0), default=2.5
    )
    ride_damping: float = positive(
        "1",
        "Damping of that bounce, a share of the critical one.",
        (0.01, 2.0),
        default=0.3,
        at_most=2.0,
    )

    def __post_init__(self) -> None:
        validate_quantities(self)
        if not self.cg_x < self.wheelbase:
            expected = f"less than the wheelbase of {self.wheelbase:g} m, got {self.cg_x:g}"
            guess = unit_guess(self.cg_x, "m", 0.02 * self.wheelbase, 0.98 * self.wheelbase)
            raise ParameterError("cg_x", expected + guess)
        if self.width is not None and self.width < self.track_width:
            raise ParameterError(
                "width", f"at least the track width of {self.track_width:g} m, got {self.width:g}"
            )

    @property
    @lru_cache(maxsize=64)  # noqa: B019 - of few vehicles, asked for some 20 times a plan
    def shape(self) -> Shape:
        """The sizes of body and wheels; missing ones follow the wheel radius."""
        radius = self.wheel_radius
        wheel_width = _WHEEL_WIDTH * radius if self.wheel_width is None else self.wheel_width
        defaults = {
            "width": self.track_width + wheel_width,
            "front_overhang": radius,
            "rear_overhang": radius,
            "ground_clearance": _CLEARANCE * radius,
            "max_step": _STEP * radius,
            "wheel_travel": _STEP * radius,
        }
        given = {name: getattr(self, name) for name in defaults}
        size = {n: defaults[n] if v is None else float(v) for n, v in given.items()}
        half = 0.5 * self.wheelbase
        return Shape(
            size["width"],
            half + size["front_overhang"],
            half + size["rear_overhang"],
            size["ground_clearance"],
            size["max_step"],
            size["wheel_travel"],
            wheel_width,
            tuple(n for n, v in given.items() if v is None),
        )

    @property
    def brake_share(self) -> float | None:
        """Part of the braking force on the front axle [1]; None where no axle locks alone."""
        if self.front_brake_share is None and self.drive == "ackermann":
            return self.cg_x / self.wheelbase
        return self.front_brake_share
