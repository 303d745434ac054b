"""From candidate paths to ranked, verified plans.

Candidates travel as one batch through terrain, bounds and the time-optimal profile; what is emitted
is smoothed and judged one by one (:mod:`planner.pipeline.plan_finalizer`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from models.errors import ParameterError
from models.parameters import Model
from planner.bounds.speed_bounds import SpeedBounds, speed_bounds
from planner.ground.braking_ground import BrakingGround, GroundConditions, ground_along
from planner.ground.elevation_map import ElevationMap
from planner.ground.terrain_profile import TerrainProfile, terrain_profile
from planner.ground.uncertainty import Uncertainty
from planner.kernels.compiled import Floats, Ints
from planner.kernels.limits import PlanningLimits, planning_limits
from planner.path import CandidatePath, PathBatch, batch
from planner.pipeline.plan_finalizer import PlanFinalizer
from planner.plan import SpeedPlan, Status
from planner.profile.time_optimal import profile_problem, time_optimal_profile, travel_cost
from planner.settings import PlannerSettings

_BATCH = 256


@dataclass(frozen=True, slots=True)
class TimeOptimalBatch:
    """Time-optimal profiles of M candidates, not judged yet; arrays are (N, M).

    Attributes:
        profile, ground, bounds: what they were made from.
        speed_sq: v² [m²/s²].
        reachable_start_sq: (M,) highest v² at the start that service braking can bring down.
        cost: (M,) travel time plus the charge for what is not reached [s].
    """

    profile: TerrainProfile
    ground: BrakingGround
    bounds: SpeedBounds
    speed_sq: Floats
    reachable_start_sq: Floats
    cost: Floats


def time_optimal_batch(
    elevation_map: ElevationMap,
    x: Floats,
    y: Floats,
    count: Ints,
    model: Model,
    *,
    start_speed: float | Floats = 0.0,
    clear: float | Floats = np.inf,
    speed_limit: Floats | None = None,
    settings: PlannerSettings | None = None,
    conditions: GroundConditions | None = None,
    uncertainty: Uncertainty | None = None,
) -> TimeOptimalBatch:
    """Time-optimal profiles along candidates that are on even stations already.

    Args:
        elevation_map: ground.
        x, y: (N, M) positions [m], C-contiguous; count: (M,) stations of each candidate.
        model: vehicle, braking, limits.
        start_speed: speed at the first station, one for all or (M,) [m/s].
        clear: station up to which the way is known free, one for all or (M,) [m].
        speed_limit: (N, M) limits of the path itself [m/s].
        settings: weights of the ranking.
        conditions: of the moment.
        uncertainty: what the plans are to survive; then ``model`` is its cautious one already.
    """
    vehicle = model.vehicle
    profile = terrain_profile(elevation_map, x, y, count, vehicle.wheelbase, vehicle.track_width)
    ground = ground_along(profile, model, elevation_map.class_names, conditions, uncertainty)
    candidates = x.shape[1]
    bounds = speed_bounds(
        profile, ground, model, np.full(candidates, clear, np.float64), speed_limit
    )
    start_sq = np.full(candidates, np.square(start_speed))
    speed_sq, reachable = time_optimal_profile(
        profile_problem(profile, ground, bounds, planning_limits(model), start_sq)
    )
    penalty = (settings or PlannerSettings()).horizon_penalty
    cost = travel_cost(profile.station, speed_sq, penalty)
    return TimeOptimalBatch(profile, ground, bounds, speed_sq, reachable, cost)


def rank(plans: Sequence[SpeedPlan], settings: PlannerSettings) -> list[SpeedPlan]:
    """Plans best first: what may be driven, then the cheapest, then the wider margin."""

    def key(plan: SpeedPlan) -> tuple[bool, bool, float, float]:
        missed = float(plan.station[-1]) - plan.progress
        cost = plan.travel_time + settings.horizon_penalty * missed
        fallback = plan.status is Status.DEGRADED
        return not plan.admissible, fallback, cost, -plan.least_margin

    return sorted(plans, key=key)


class CandidatePlanner:
    """Plans candidates with one model."""

    def __init__(
        self,
        model: Model,
        settings: PlannerSettings | None = None,
        uncertainty: Uncertainty | None = None,
    ) -> None:
        """Plan with the model's mean, or with what remains of it under uncertainty."""
        self.model = model if uncertainty is None else uncertainty.cautious(model)
        self.uncertainty = uncertainty
        self.settings = settings or PlannerSettings()
        self.scalars: PlanningLimits = planning_limits(self.model)

    def plan(
        self,
        elevation_map: ElevationMap,
        paths: Sequence[CandidatePath],
        *,
        start_speed: float = 0.0,
        clear: float = np.inf,
        conditions: GroundConditions | None = None,
        progress: Callable[[int], None] | None = None,
    ) -> list[SpeedPlan]:
        """A verified plan for every path, in the order given.

        Args:
            elevation_map: ground.
            paths: candidates; a malformed one raises, an undrivable one gets a status.
            start_speed: speed at the first station [m/s].
            clear: station up to which the way is known free [m].
            conditions: of the moment.
            progress: called with the number of candidates done since the last call.

        Raises:
            ParameterError: names the candidate and what is wrong with its path.
        """
        if not (np.isfinite(start_speed) and start_speed >= 0.0):
            raise ParameterError("speed", f"a finite start speed >= 0 [m/s], got {start_speed}")
        if np.isnan(clear) or clear < 0.0:
            raise ParameterError("clear", f"a distance >= 0 [m], got {clear}")
        spacing = self.settings.spacing_on(elevation_map.resolution)
        plans: list[SpeedPlan] = []
        for first in range(0, len(paths), _BATCH):
            part = self._resample(paths[first : first + _BATCH], spacing)
            solved = time_optimal_batch(
                elevation_map, part.x, part.y, part.count, self.model,
                start_speed=start_speed, clear=clear, speed_limit=part.speed_limit,
                settings=self.settings, conditions=conditions, uncertainty=self.uncertainty,
            )  # fmt: skip
            for j, name in enumerate(part.names):
                plans.append(self.finish(solved, j, name, start_speed, part.speed_limit))
                if progress is not None:
                    progress(1)
        return plans

    def _resample(self, paths: Sequence[CandidatePath], spacing: float) -> PathBatch:
        for path in paths:
            try:
                batch([path], spacing)
            except ParameterError as error:
                raise ParameterError(f"{path.name}.{error.field}", error.expected) from None
        return batch(list(paths), spacing)

    def finish(
        self,
        solved: TimeOptimalBatch,
        j: int,
        name: str,
        start_speed: float,
        speed_limit: Floats | None = None,
    ) -> SpeedPlan:
        """Smooth, judge and explain candidate j of a batch."""
        start_sq = start_speed**2
        finalizer = PlanFinalizer(
            self.model, self.scalars, solved.profile, solved.ground, solved.bounds, j,
            np.array([start_sq]), speed_limit=speed_limit,
        )  # fmt: skip
        n = int(solved.profile.count[j])
        return finalizer.finish(
            name,
            np.ascontiguousarray(solved.speed_sq[:n, j]),
            smoothed=self.settings.smooth,
            reachable=bool(solved.reachable_start_sq[j] >= start_sq - 1e-9),
        )
