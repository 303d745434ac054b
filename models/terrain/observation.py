"""Estimates of the ground from one stretch of steady motion."""

from __future__ import annotations

import math
from dataclasses import dataclass

from slopewise.models.terrain.phases import Phase

_TWO_SIDED = 1.96
"""Standard deviations of a normal distribution on either side that hold 95 %."""


@dataclass(frozen=True, slots=True)
class TerrainEstimate:
    """A value with its standard deviation; both NaN if the stretch does not determine it."""

    value: float
    std: float
    note: str = ""

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the value on this ground."""
        return self.value - _TWO_SIDED * self.std, self.value + _TWO_SIDED * self.std

    @property
    def is_known(self) -> bool:
        """True if value and standard deviation are finite."""
        return math.isfinite(self.value + self.std)


UNKNOWN = TerrainEstimate(math.nan, math.nan)


@dataclass(frozen=True, slots=True)
class Features:
    """The three parameters that characterise a ground, NaN where not known. Source: Slip 3.2."""

    motion_resistance: TerrainEstimate = UNKNOWN  # f_r [1]
    lateral_resistance: TerrainEstimate = UNKNOWN  # μ_t [1]
    slip_track: TerrainEstimate = UNKNOWN  # B_s [m]

    @property
    def values(self) -> tuple[float, float, float]:
        """(f_r, μ_t, B_s)."""
        return (self.motion_resistance.value, self.lateral_resistance.value, self.slip_track.value)

    @property
    def stds(self) -> tuple[float, float, float]:
        """Standard deviations of :attr:`values`."""
        return (self.motion_resistance.std, self.lateral_resistance.std, self.slip_track.std)


@dataclass(frozen=True, slots=True)
class GroundObservation:
    """A stretch, and the estimates once it ends; speeds are means over it."""

    begin: float  # time [s]
    end: float
    phase: Phase
    samples: int
    speed: float  # mean of the rim speeds of both sides [m/s]
    speed_difference: float  # ΔV [m/s]
    yaw_rate: float  # ω_z without bias [rad/s]
    pitch: float  # nose down positive [rad]
    onset_current: float  # mean of both sides over the first 0.5 s of steady motion [A]
    measured: Features  # of this stretch alone: f_r of a straight, μ_t and B_s of a turn
    turning: TerrainEstimate  # turning thrust of this stretch [1], see :mod:`.resistances`
    known: Features  # latest of each parameter in this run

    @property
    def rim_speed(self) -> float:
        """Speed at the rim of the faster side [m/s]."""
        return abs(self.speed) + 0.5 * abs(self.speed_difference)
