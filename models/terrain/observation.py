"""What one stretch of steady motion tells of the ground."""

from __future__ import annotations

import math
from dataclasses import dataclass

from slopewise.models.terrain.phases import Phase
from slopewise.models.terrain.resistances import TerrainEstimate

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
    """A stretch, and what is known of the ground once it ends.

    Attributes:
        begin, end: time [s].
        phase: what the vehicle did.
        samples: how many were used.
        speed: mean of the rim speeds of both sides [m/s].
        speed_difference: mean ΔV [m/s].
        yaw_rate: mean ω_z without bias [rad/s].
        onset_current: mean current of both sides over the first 0.5 s of steady motion [A].
        own: what this stretch alone tells: f_r of a straight, μ_t and B_s of a turn.
        known: latest of each parameter in this run; what a class is told from.
    """

    begin: float
    end: float
    phase: Phase
    samples: int
    speed: float
    speed_difference: float
    yaw_rate: float
    onset_current: float
    own: Features
    known: Features
