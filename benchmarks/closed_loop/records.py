"""Record of a drive: its stops, its worst moments, its history."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from slopewise.models.arrays import Floats


@dataclass(frozen=True, slots=True)
class StopTrace:
    """A stop in the robot's own log, one row per tick from the command, arrays of shape (n,).

    Attributes:
        time: time since the command [s].
        speed: odometry [m/s].
        pitch: IMU, with dive and mount offset [rad].
        station: localised station along the route [m].
        command_speed: odometry at the command [m/s].
        command_station: localised station at the command [m].
    """

    time: Floats
    speed: Floats
    pitch: Floats
    station: Floats
    command_speed: float
    command_station: float


@dataclass(frozen=True, slots=True)
class ForcedStop:
    """One emergency stop, by the truth.

    Attributes:
        speed: true speed at the command [m/s].
        grade: grade of the ground there [rad].
        surface: name of the surface there.
        actual: distance from command to rest [m].
        predicted: distance predicted by the policy, offset included [m].
        left: clear distance left at rest, below 0 if exceeded [m].
        forced: whether a wall forced it, not the policy.
        trace: the robot's own log.
    """

    speed: float
    grade: float
    surface: str
    actual: float
    predicted: float
    left: float
    forced: bool
    trace: StopTrace


@dataclass(slots=True)
class DrivenScene:
    """Outcome of one drive.

    Attributes:
        policy, source: name of the policy, origin of the ground.
        finished: whether the end was reached.
        distance: driven distance [m].
        moving_time: time without waiting at blocked stations [s].
        stops: emergency stops from above walking pace.
        collisions: walls touched.
        past_clear: times that the vehicle passed a barrier.
        farthest: largest distance beyond one [m].
        min_load_shares: minimum filtered load of front, rear, left, right over level,
            shape (4,) [1].
        min_wheel_load: minimum filtered load of any wheel over level [1].
        track_error: largest distance from the route [m].
        reasons: of stops by the policy itself.
        history: one row per cycle of time, station, speed, reported clear station, limit, grade,
            roll, surface, shape (n, 8).
    """

    policy: str
    source: str
    finished: bool = False
    distance: float = 0.0
    moving_time: float = 0.0
    stops: list[ForcedStop] = field(default_factory=list)
    collisions: int = 0
    past_clear: int = 0
    farthest: float = -np.inf
    min_load_shares: Floats = field(default_factory=lambda: np.ones(4))
    min_wheel_load: float = 1.0
    track_error: float = 0.0
    reasons: list[str] = field(default_factory=list)
    history: Floats = field(default_factory=lambda: np.zeros((0, 8)))

    @property
    def mean_speed(self) -> float:
        """Mean speed while moving [m/s]."""
        return self.distance / self.moving_time if self.moving_time > 0.0 else 0.0
