"""Problems that the core solves: the fastest profiles of all candidates, and one of limited jerk.

The passes over v² are those of `planner/core/profile/time_optimal.hpp`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.planner.bounds.speed_bounds import SpeedBounds
from slopewise.planner.ground.braking_ground import BrakingGround
from slopewise.planner.ground.terrain_profile import TerrainProfile
from slopewise.planner.planning_limits import PlanningLimits


class ProfileProblem(NamedTuple):
    """Problem of the fastest profiles of M candidates with up to N stations.

    Attributes, (N, M) unless stated otherwise:
        station: [m], increasing.
        speed_sq_max: highest v² [m²/s²].
        sin_grade: sine of the grade.
        lower_slope, lower_intercept: force that braking may count on [s/m], [1].
        slowest: below it the force does not change with speed [m/s].
        accel_max: by comfort, thrust and front axle load [m/s²].
        demand: share of the weight that holding the speed costs.
        start_sq: (M,) v² at the first station [m²/s²].
        lift, lift_per_speed_sq: as of :class:`SpeedBounds`; None where nothing turns.
        decel: service deceleration, inf to brake as hard as the model allows [m/s²].
        specific_power: drive power / weight [m/s].
    """

    station: Floats
    speed_sq_max: Floats
    sin_grade: Floats
    lower_slope: Floats
    lower_intercept: Floats
    slowest: Floats
    accel_max: Floats
    demand: Floats
    start_sq: Floats
    decel: float
    specific_power: float
    lift: Floats | None = None
    lift_per_speed_sq: Floats | None = None

    def part(self, stations: slice, candidates: slice) -> ProfileProblem:
        """Some stations of some candidates, (n, m)."""
        rows: dict[str, Any] = {
            name: np.ascontiguousarray(a[stations, candidates])
            for name, a in zip(self._fields, self, strict=True)
            if isinstance(a, np.ndarray) and a.ndim == 2
        }
        return self._replace(**rows)


def profile_problem(
    profile: TerrainProfile,
    ground: BrakingGround,
    bounds: SpeedBounds,
    limits: PlanningLimits,
    start_sq: Floats,
) -> ProfileProblem:
    """The problem of a batch; ``start_sq`` is (M,) [m²/s²]."""
    return ProfileProblem(
        profile.station,
        bounds.speed_sq_max,
        profile.sin_grade,
        ground.lower_slope,
        ground.braking_intercept,
        ground.slowest,
        bounds.accel_max,
        bounds.demand,
        start_sq,
        limits.decel,
        limits.specific_power,
        bounds.lift,
        bounds.lift_per_speed_sq,
    )


@dataclass(frozen=True, slots=True)
class SmoothingProblem:
    """One candidate; N stations.

    Attributes:
        ds: (N − 1,) segment lengths [m], > 0.
        speed_sq_max: (N,) bound [m²/s²]; the time-optimal profile, above which nothing is feasible.
        accel_max, decel_max: (N − 1,) [m/s²], >= 0, each valid for every v² up to the bound.
        jerk: [m/s³].
        start_accel: acceleration before the first segment [m/s²], None if it does not matter.
    """

    ds: Floats
    speed_sq_max: Floats
    accel_max: Floats
    decel_max: Floats
    jerk: float
    start_accel: float | None = None
