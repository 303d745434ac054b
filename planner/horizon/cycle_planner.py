"""What all plans of one cycle have in common: model, ground of the moment, solvers, time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from models.parameters import Model
from planner.ground.braking_ground import GroundConditions
from planner.ground.elevation_map import ElevationMap
from planner.ground.terrain_profile import stations_along
from planner.ground.uncertainty import Uncertainty
from planner.horizon.answer import HorizonSettings
from planner.kernels.compiled import Floats
from planner.kernels.limits import PlanningLimits
from planner.path import PathBatch
from planner.pipeline.candidates import TimeOptimalBatch, time_optimal_batch
from planner.pipeline.plan_finalizer import PlanFinalizer
from planner.plan import SpeedPlan
from planner.settings import PlannerSettings


@dataclass(frozen=True, slots=True)
class Equipment:
    """What stays from cycle to cycle; the model is cautious already."""

    model: Model
    scalars: PlanningLimits
    uncertainty: Uncertainty
    settings: HorizonSettings
    planner: PlannerSettings


@dataclass(frozen=True, slots=True)
class Work:
    """How a plan is to be finished: the arguments of ``PlanFinalizer.finish``."""

    speed_sq: Floats
    reachable: bool = True
    innocent: bool = False
    start_accel: float | None = None


@dataclass(frozen=True, slots=True)
class CyclePlanner:
    """Plans of one cycle."""

    equipment: Equipment
    elevation_map: ElevationMap
    conditions: GroundConditions | None
    begun: float

    def late(self) -> bool:
        """The time for this cycle is over."""
        return perf_counter() - self.begun > self.equipment.settings.budget

    def stations(self, path: PathBatch) -> Floats:
        """Stations of a single path along the ground, (N,) [m]."""
        return stations_along(self.elevation_map, path.x, path.y, path.count)[:, 0]

    def solve(self, paths: PathBatch, clear: Floats, start: float | Floats) -> TimeOptimalBatch:
        """Time-optimal profiles of candidates, from these speeds on."""
        own = self.equipment
        return time_optimal_batch(
            self.elevation_map, paths.x, paths.y, paths.count, own.model, start_speed=start,
            clear=np.maximum(clear, 0.0), speed_limit=paths.speed_limit, settings=own.planner,
            conditions=self.conditions, uncertainty=own.uncertainty,
        )  # fmt: skip

    def finalizer(
        self,
        solved: TimeOptimalBatch,
        j: int,
        fixed_prefix: Floats,
        limit: Floats | None,
        first: int = 0,
    ) -> PlanFinalizer:
        """Candidate j of a batch on its way; see :mod:`planner.pipeline.plan_finalizer`."""
        own = self.equipment
        return PlanFinalizer(
            own.model, own.scalars, solved.profile, solved.ground, solved.bounds, j, fixed_prefix,
            speed_limit=limit, first=first,
        )  # fmt: skip

    def finish(self, name: str, finalizer: Callable[[], PlanFinalizer], work: Work) -> SpeedPlan:
        """The plan of a candidate: smoothed, if there is time, and if the solver does not fail.

        Args:
            name: of the candidate.
            finalizer: makes it; twice, if smoothing has to be given up.
            work: see there.
        """
        own, why = self.equipment, ""
        if own.planner.smooth and self.late():
            why = f"not smoothed within {1e3 * own.settings.budget:g} ms"
        elif own.planner.smooth:
            try:
                return finalizer().finish(
                    name,
                    work.speed_sq,
                    reachable=work.reachable,
                    innocent=work.innocent,
                    start_accel=work.start_accel,
                )
            except Exception as error:  # noqa: BLE001
                # Whatever a solver raises: the plan does not need it, and is labelled.
                why = f"not smoothed: {type(error).__name__}: {error}"
        return finalizer().finish(
            name, work.speed_sq, smoothed=False, reachable=work.reachable, innocent=work.innocent,
            unsmoothed=why,
        )  # fmt: skip
