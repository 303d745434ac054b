"""Settings of the terrain estimator, with the paper's defaults where it gives them.

They are data, not constants in code: a terrain file may hold others.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from slopewise.models.errors import ParameterError
from slopewise.models.quantity import (
    Quantities,
    non_negative,
    positive,
    quantity,
    validate_quantities,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class FilterSettings(Quantities):
    """Settings of the slip track filter. Source: Slip, Sec. 2.1."""

    yaw_rate_std: float = positive("rad/s", "Standard deviation of the yaw rate, √R.", default=0.3)
    process_variance: float = positive(
        "1/m²", "Growth of the variance of 1/B_s in one sample time, Q.", default=1e-4
    )
    sample_time: float = positive(
        "s", "Sample time that the process variance is given for, T_s.", default=0.01
    )
    initial_std: float = positive(
        "1/m", "Standard deviation of 1/B_s at the start; not in print.", default=0.3
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionSettings:
    """Thresholds of rest, straight, turn, steady and stuck."""

    rest_speed: float = positive("m/s", "Rim speeds below this are rest.", default=0.01)
    rest_yaw_rate: float = positive(
        "rad/s", "Yaw rates above this at rest are no bias.", default=0.1
    )
    rest_time: float = positive(
        "s", "Rest begins this time after wheels and gyroscope calm down.", default=1.0
    )
    turn_begin: float = positive(
        "m/s", "Difference of rim speeds that begins a turn.", default=0.06
    )
    turn_end: float = positive(
        "m/s", "Difference that ends it, and still is straight.", default=0.04
    )
    least_speed: float = positive(  # words: ok, a key of the file
        "m/s", "Mean rim speed that a straight needs.", default=0.08
    )
    least_inner_speed: float = non_negative(  # words: ok, a key of the file
        "m/s", "Inner wheels slower than this stand.", default=0.03
    )
    smoothing: float = positive(
        "s", "Time constant that speeds and yaw rate are smoothed with.", default=0.1
    )
    steady_change: float = positive(
        "1", "Change that is steady, a share.", default=0.1, at_most=1.0
    )
    steady_floor: float = non_negative(
        "rad/s", "Yaw rates that differ by less than this are the same.", default=0.02
    )
    steady_time: float = non_negative(
        "s", "Onset of steady motion: it has been so for this long.", default=0.2
    )
    stuck_slip: float = quantity(
        "1", "Yaw rate of a turn without slip over that of spin.", default=5.0, above=1.0
    )
    stuck_time: float = positive("s", "Spinning for this long is stuck.", default=0.6)
    longest_stretch: float = positive(
        "s", "Longer stretches are cut, so that changes show.", default=4.0
    )
    shortest_stretch: float = positive("s", "Shorter steady stretches are not used.", default=0.5)
    longest_gap: float = positive(
        "s", "A longer gap between samples ends every stretch.", default=0.5
    )

    def __post_init__(self) -> None:
        validate_quantities(self)
        if not self.turn_end <= self.turn_begin:
            raise ParameterError(
                "turn_end", f"at most turn_begin, {self.turn_begin:g}, got {self.turn_end:g}"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class ResistanceSettings(Quantities):
    """Errors of the resistances: sensors, and scatter from stretch to stretch on one ground.

    Scatters are standard deviations on BorealTC, a Husky on four grounds (decision 28).
    """

    pitch_std: float = non_negative(
        "rad", "Error of the pitch up to 3°; twice that beyond.", default=0.01
    )
    current_std: float = non_negative(
        "A", "Error of the mean current of a side: offset of the sensor.", default=0.1
    )
    motion_scatter: float = non_negative(
        "1", "Scatter of f_r from stretch to stretch, a share of it.", default=0.20
    )
    turning_scatter: float = non_negative(
        "1", "Scatter of the turning thrust likewise.", default=0.12
    )
    lateral_scatter: float = non_negative("1", "Scatter of μ_t likewise.", default=0.35)
    slip_scatter: float = non_negative("1", "Scatter of B_s likewise.", default=0.18)


@dataclass(frozen=True, slots=True, kw_only=True)
class EstimatorSettings:
    """All settings of the terrain estimator."""

    filter: FilterSettings = field(default_factory=FilterSettings)
    motion: MotionSettings = field(default_factory=MotionSettings)
    resistance: ResistanceSettings = field(default_factory=ResistanceSettings)
