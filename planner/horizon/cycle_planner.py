"""Common data of all plans of one cycle: model, ground of the moment, time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.planner.ground.braking_ground import GroundConditions
from slopewise.planner.ground.terrain_profile import terrain_profile
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.planner.horizon.answer import HorizonSettings, PlanarState
from slopewise.planner.horizon.path_projection import departure_of
from slopewise.planner.horizon.recent_commands import UnseenMotion
from slopewise.planner.path import PathBatch
from slopewise.planner.pipeline.candidate_column import CandidateColumn
from slopewise.planner.pipeline.plan_finalizer import Unfinished, finish
from slopewise.planner.pipeline.time_optimal_batch import (
    Finalists,
    TimeOptimalBatch,
    time_optimal_batch,
)
from slopewise.planner.plan import SpeedPlan
from slopewise.planner.settings import PlannerSettings


@dataclass(frozen=True, slots=True)
class CyclePlanner:
    """Plans of one cycle.

    Attributes:
        model: made cautious for the uncertainty.
        settings, planning: of cycles and of plans.
        elevation_map, conditions: those of the moment.
        started: when the cycle did, by the clock of `perf_counter` [s].
        state: vehicle state; it may be off its paths.
        unseen: what the vehicle may do until a command of this cycle takes effect.
    """

    model: Model
    uncertainty: Uncertainty
    settings: HorizonSettings
    planning: PlannerSettings
    elevation_map: ElevationMap
    conditions: GroundConditions
    started: float
    state: PlanarState
    unseen: UnseenMotion

    def late(self) -> bool:
        """The time for this cycle is over."""
        return perf_counter() - self.started > self.settings.budget

    def stations(self, path: PathBatch) -> Floats:
        """Stations of a single path along the ground, (N,) [m]."""
        on, vehicle = self.elevation_map, self.model.vehicle
        return terrain_profile(on, path.x, path.y, path.count, vehicle).station[:, 0]

    def solve(
        self,
        paths: PathBatch,
        clear: Floats,
        start: float | Floats,
        finalists: Finalists | None = None,
    ) -> TimeOptimalBatch:
        """Time-optimal profiles of M candidates.

        Args:
            paths: on even stations.
            clear: (M,) station up to which each is known to be free; below 0 nothing is [m].
            start: speed at the first station, one for all or (M,) [m/s].
            finalists: see `time_optimal_batch`.
        """
        return time_optimal_batch(
            self.elevation_map,
            paths,
            self.model,
            start_speed=start,
            clear=np.maximum(clear, 0.0),
            settings=self.planning,
            conditions=self.conditions,
            uncertainty=self.uncertainty,
            departure=departure_of(paths, self.state, self.unseen.speed, self.unseen.places),
            finalists=finalists,
        )

    def finish(
        self, name: str, column: Callable[[], CandidateColumn], profile: Unfinished
    ) -> SpeedPlan:
        """The plan of a candidate: smoothed, if there is time, and if the solver does not fail.

        Args:
            name: the candidate's.
            column: makes it alone; twice, if smoothing has to be given up.
            profile: the time-optimal one.
        """
        unsmoothed = ""
        if self.planning.smooth and self.late():
            unsmoothed = f"not smoothed within {1e3 * self.settings.budget:g} ms"
        elif self.planning.smooth:
            try:
                return finish(column(), name, profile)
            except Exception as error:  # noqa: BLE001
                # Any fault of a solver: the plan does not need it, and is labelled.
                unsmoothed = f"not smoothed: {type(error).__name__}: {error}"
        return finish(column(), name, profile, smoothed=False, unsmoothed=unsmoothed)
