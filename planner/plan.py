"""The answer for one candidate: a verified speed profile and everything that explains it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from slopewise.models.arrays import Floats, Ints
from slopewise.planner.limiting import Limiting
from slopewise.planner.path_deviation import PathDeviation


class Status(Enum):
    """How a plan may be used.

    OK reaches the end of its path. BLOCKED is as valid, but stops before some station. DEGRADED is
    safe, but a fallback was used. INFEASIBLE cannot be made safe: even full braking from the start
    is not enough, and the plan is that braking.
    """

    OK = "ok"
    BLOCKED = "blocked"
    INFEASIBLE = "infeasible"
    DEGRADED = "degraded"


@dataclass(frozen=True, slots=True)
class Obstacle:
    """Obstacle of body or wheels.

    Attributes:
        bound: that it counts as.
        x, y: where it is [m].
        height: how high a step or the ground, how deep a drop is; 0 for unknown ground [m].
        words: what, where and against which limit.
    """

    bound: Limiting
    x: float
    y: float
    height: float
    words: str


@dataclass(frozen=True, slots=True)
class Momentum:
    """Requirements to get over a hill that thrust alone cannot climb; no plan counts on it.

    Attributes:
        station: the last one that thrust can climb [m]. speed: least one there [m/s].
        until: station from which thrust does again; the last one known where it never does [m].
        allowed: limits of model and path would let it be so fast.
        least_speed: (N,) least speed at each station of the path, 0 where any will do [m/s].
    """

    station: float
    speed: float
    until: float
    allowed: bool
    least_speed: Floats


@dataclass(frozen=True, slots=True, eq=False)
class SpeedPlan:
    """Speed along one candidate of N stations; every array is (N,) and SI.

    Attributes:
        candidate: name of the path.
        status, reason: verdict, and a sentence with what, where and by how much.
        station: metres along the ground, three-dimensional.
        x, y, z: position; z repeats the last known height where the ground is unknown.
        grade, roll: ground under the wheels [rad], uphill and left side up positive.
        curvature: in the plan view, left positive [1/m].
        speed: v; v² is linear between stations [m/s].
        accel: holds from its station to the next [m/s²].
        time: since the start; stays at the time of the stop beyond it [s].
        speed_bound: highest speed that the bounds allow [m/s].
        limiting: what holds at each station, as :class:`Limiting`.
        stop_distance: emergency stop from each station [m].
        clear_distance: station before which every stop ends [m], one number.
        rear_load, side_load: least loads on that stop as shares of their level static load.
        obstacle: that ends the clear distance, None where something else does.
        momentum: that a hill would take which ends the clear distance, None where none does.
        path_deviation: from the path that was given; None where none was, so the line is the path.
    """

    candidate: str
    status: Status
    reason: str
    station: Floats
    x: Floats
    y: Floats
    z: Floats
    grade: Floats
    roll: Floats
    curvature: Floats
    speed: Floats
    accel: Floats
    time: Floats
    speed_bound: Floats
    limiting: Ints
    stop_distance: Floats
    clear_distance: float
    rear_load: Floats
    side_load: Floats
    obstacle: Obstacle | None = None
    momentum: Momentum | None = None
    path_deviation: PathDeviation | None = None

    @property
    def travel_time(self) -> float:
        """Time until the plan's last movement ends [s]."""
        return float(self.time[-1])

    @property
    def progress(self) -> float:
        """Station at which the plan comes to rest [m]."""
        moving = (self.speed > 0.0).nonzero()[0]
        if len(moving) == 0:
            return 0.0
        return float(self.station[min(int(moving[-1]) + 1, len(self.station) - 1)])

    @property
    def least_margin(self) -> float:
        """Clear distance that remains in the tightest emergency stop [m]; inf if at rest."""
        moving = self.speed > 0.0
        left = self.clear_distance - (self.station + self.stop_distance)
        return float(left[moving].min()) if moving.any() else float("inf")

    @property
    def admissible(self) -> bool:
        """It may be driven and leads somewhere."""
        return self.status is not Status.INFEASIBLE and self.progress > 0.0

    def columns(self) -> dict[str, list[str] | Floats]:
        """The columns of a plan file, in order."""
        n, deviation = len(self.station), self.path_deviation
        return {
            "candidate": [self.candidate] * n,
            "station": self.station,
            "x": self.x,
            "y": self.y,
            "z": self.z,
            "grade": self.grade,
            "roll": self.roll,
            "curvature": self.curvature,
            "speed": self.speed,
            "accel": self.accel,
            "time": self.time,
            "speed_bound": self.speed_bound,
            "limiting": [Limiting(int(code)).label for code in self.limiting],
            "stop_distance": self.stop_distance,
            "clear_distance": np.full(n, self.clear_distance),
            "rear_load": self.rear_load,
            "status": [self.status.value] * n,
            "reason": [self.reason] * n,
            "side_load": self.side_load,
            "path_deviation": np.zeros(n) if deviation is None else deviation.distance,
        }
