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
    """The three parameters that characterise a ground, NaN where not known. Source: Slip 3.2.

    Attributes:
        motion_resistance: f_r [1]. lateral_resistance: μ_t [1]. slip_track: B_s [m].
    """

    motion_resistance: TerrainEstimate = UNKNOWN
    lateral_resistance: TerrainEstimate = UNKNOWN
    slip_track: TerrainEstimate = UNKNOWN

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
    """A stretch, and the estimates once it ends.

    Attributes:
        begin, end: time [s].
        phase: kind of motion.
        samples: number of samples used.
        speed: mean of the rim speeds of both sides [m/s].
        speed_difference: mean ΔV [m/s].
        yaw_rate: mean ω_z without bias [rad/s].
        pitch: mean, nose down positive [rad].
        onset_current: mean current of both sides over the first 0.5 s of steady motion [A].
        measured: estimates of this stretch alone: f_r of a straight, μ_t and B_s of a turn.
        turning: turning thrust of this stretch, see :mod:`.resistances` [1].
        known: latest of each parameter in this run.
    """

    begin: float
    end: float
    phase: Phase
    samples: int
    speed: float
    speed_difference: float
    yaw_rate: float
    pitch: float
    onset_current: float
    measured: Features
    turning: TerrainEstimate
    known: Features

    @property
    def rim_speed(self) -> float:
        """Speed at the rim of the faster side [m/s]."""
        return abs(self.speed) + 0.5 * abs(self.speed_difference)
