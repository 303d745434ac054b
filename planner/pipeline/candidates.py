"""From candidate paths to verified plans.

Candidates travel as one batch through terrain, bounds and the time-optimal profile; what is emitted
is smoothed and verified one by one (:mod:`slopewise.planner.pipeline.plan_finalizer`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Model
from slopewise.models.quantity import MAX_SPEED
from slopewise.planner.followed_line import line_limits
from slopewise.planner.ground.averaged_map import averaged_map
from slopewise.planner.ground.braking_ground import GroundConditions
from slopewise.planner.ground.sight import within_sight
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.planner.path import EvenPath, PathBatch, behind_the_front, resample, side_by_side
from slopewise.planner.path_deviation import path_deviation
from slopewise.planner.pipeline.band_bounds import SideBounds
from slopewise.planner.pipeline.candidate_column import CandidateColumn
from slopewise.planner.pipeline.plan_finalizer import Unfinished, finish
from slopewise.planner.pipeline.time_optimal_batch import TimeOptimalBatch, time_optimal_batch
from slopewise.planner.plan import SpeedPlan, Status
from slopewise.planner.settings import PlannerSettings
from slopewise.planner.swept.convergence import Departure

_BATCH = 256
"""Candidates planned together [1]: four tiles of the core bound the memory of a large file."""


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

    def plan(
        self,
        elevation_map: ElevationMap,
        paths: Sequence[CandidatePath | EvenPath],
        *,
        start_speed: float = 0.0,
        clear: float | Floats = np.inf,
        conditions: GroundConditions | None = None,
        departs: Callable[[PathBatch], Departure] | None = None,
        progress: Callable[[int], None] | None = None,
    ) -> list[SpeedPlan]:
        """A verified plan for every path, in the order given.

        Args:
            elevation_map: ground.
            paths: M candidates; a malformed one raises, an undrivable one gets a status.
            start_speed: speed at the first station [m/s].
            clear: station up to which the ground is known to be free, one for all or (M,); the
                front of the vehicle stays on it [m].
            conditions: those of this moment.
            departs: vehicle pose relative to paths side by side; None: it is on all of them.
            progress: called with the number of candidates done since the last call.

        Raises:
            ParameterError: names the candidate and what is wrong with its path.
        """
        if not 0.0 <= start_speed <= MAX_SPEED:
            expected = f"a finite start speed >= 0 and <= {MAX_SPEED:g} [m/s], got {start_speed}"
            raise ParameterError("speed", expected)
        if not np.all(np.asarray(clear) >= 0.0):
            raise ParameterError("clear", f"a distance >= 0 [m], got {clear}")
        free = behind_the_front(clear, self.model, len(paths))
        model = within_sight(self.model, elevation_map, self.settings.unseen_steps)
        felt = averaged_map(elevation_map, self.model.vehicle.wheel_radius)
        plans: list[SpeedPlan] = []
        for first in range(0, len(paths), _BATCH):
            part = slice(first, first + _BATCH)
            even = self.resampled(elevation_map, paths[part])
            together = side_by_side(even)
            solved = time_optimal_batch(
                felt,
                together,
                model,
                start_speed=start_speed,
                clear=free[part],
                settings=self.settings,
                conditions=conditions,
                uncertainty=self.uncertainty,
                departure=None if departs is None else departs(together),
            )
            sides = solved.side_bounds(np.arange(len(even)))
            for j, path in enumerate(even):
                plan = finished(solved, j, path.name, sides, smooth=self.settings.smooth)
                plans.append(self._with_deviation(plan, path))
                if progress is not None:
                    progress(1)
        return plans

    def resampled(
        self, elevation_map: ElevationMap, paths: Sequence[CandidatePath | EvenPath]
    ) -> list[EvenPath]:
        """Paths on even stations; those that are stay unchanged.

        Raises:
            ParameterError: names the candidate and what is wrong with its path.
        """
        spacing = self.settings.spacing_on(elevation_map.resolution, self.model.vehicle)
        even = []
        for path in paths:
            try:
                even.append(resample(path, spacing, line_limits(self.model)))
            except ParameterError as error:
                raise ParameterError(f"{path.name}.{error.field}", error.expected) from None
        return even

    def _with_deviation(self, plan: SpeedPlan, path: EvenPath) -> SpeedPlan:
        given = path.points if path.given is None else path.given.points
        limit = self.model.max_path_deviation
        deviation = path_deviation(given, plan.x, plan.y, plan.station, limit)
        plan = replace(plan, path_deviation=deviation)
        ends = "" if path.given is None else path.given.ends
        if ends and plan.status is Status.OK:
            reason = f"stops at {plan.progress:.1f} m: {ends}"
            plan = replace(plan, status=Status.BLOCKED, reason=reason)
        elif ends:
            plan = replace(plan, reason=f"{plan.reason}; {ends}")
        return plan


def finished(
    solved: TimeOptimalBatch, j: int, name: str, sides: SideBounds | None = None, *, smooth: bool
) -> SpeedPlan:
    """Candidate j of a batch smoothed, verified and explained; `sides`: of all candidates."""
    profile = Unfinished(solved.profile_of(j), reachable=bool(solved.reachable[j]))
    column = CandidateColumn(solved, j, solved.start_sq[j : j + 1], sides=sides)
    return finish(column, name, profile, smoothed=smooth)
