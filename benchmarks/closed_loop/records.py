"""What is kept of a drive: its stops, its worst moments, its course."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from slopewise.models.arrays import Floats


@dataclass(frozen=True, slots=True)
class StopTrace:
    """A stop as the robot's own log has it; arrays are (n,), a row a tick from the command on.

    Attributes:
        time: since the command [s]. speed: odometry [m/s]. pitch: IMU, dive and mount [rad].
        held: odometry at the command [m/s].
        station: localised, along the route [m]. station0: at the command [m].
    """

    time: Floats
    speed: Floats
    pitch: Floats
    station: Floats
    held: float
    station0: float


@dataclass(frozen=True, slots=True)
class ForcedStop:
    """One emergency stop, judged by the truth.

    Attributes:
        speed: at the command [m/s]. grade: of the ground there [rad]. surface: there.
        actual: way from command to rest [m]. predicted: by the policy, offset included [m].
        left: of the clear distance at rest, below 0 if it was not enough [m].
        forced: by a wall, not by the policy itself.
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
    """What came of one drive.

    Attributes:
        policy, source: who drove, on which ground.
        finished: it came to the end. distance: [m]; moving_time: without waiting before what
            barred the way [s].
        stops: emergency stops from above walking pace.
        collisions: walls touched. past_clear: times that it stood or drove beyond a barrier;
        farthest: worst of them [m].
        least_share: least filtered load of front, rear, left, right, as share of level; (4,).
        least_wheel: least filtered load of any wheel, as share of level.
        track_error: largest distance from the route [m].
        reasons: why the policy stopped by itself.
        history: (n, 8) time, station, speed, told station, limit, grade, roll, surface; a cycle a
            row.
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
    least_share: Floats = field(default_factory=lambda: np.ones(4))
    least_wheel: float = 1.0
    track_error: float = 0.0
    reasons: list[str] = field(default_factory=list)
    history: Floats = field(default_factory=lambda: np.zeros((0, 8)))

    @property
    def mean_speed(self) -> float:
        """[m/s]."""
        return self.distance / self.moving_time if self.moving_time > 0.0 else 0.0
