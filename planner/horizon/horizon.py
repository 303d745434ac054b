"""The moving horizon: from state, candidates and map of this cycle to one plan and one command.

All candidates are planned and judged; the best are smoothed, as many as the time allows. The
previous plan stays among them on its stations: as long as nothing got worse it may be
driven on, so an answer that was `ok` stays `ok` (docs/decisions/0008-horizon.md).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from time import perf_counter

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.models.typed_arguments import typed_arguments
from slopewise.planner.followed_line import line_limits
from slopewise.planner.ground.averaged_map import averaged_map
from slopewise.planner.ground.braking_ground import GroundConditions
from slopewise.planner.ground.sight import within_sight
from slopewise.planner.ground.uncertainty import Uncertainty, survived_errors
from slopewise.planner.horizon.answer import CycleAnswer, PlanarState
from slopewise.planner.horizon.answer import HorizonSettings as HorizonSettings
from slopewise.planner.horizon.cycle import Cycle
from slopewise.planner.horizon.cycle_planner import CyclePlanner
from slopewise.planner.horizon.previous_plan import PreviousPlan
from slopewise.planner.horizon.recent_commands import RecentCommands
from slopewise.planner.path import EvenPath, PathBatch, batch, behind_the_front
from slopewise.planner.settings import PlannerSettings

_AGES = 100
"""Cycles for which the age of a state is remembered [1]: where ages vary, stops from a plan made at
a small one would pass the clear distance at the next large one."""


class Horizon:
    """Plans from cycle to cycle: one object a vehicle, one thread at a time."""

    @typed_arguments
    def __init__(
        self,
        model: Model,
        settings: HorizonSettings | None = None,
        planner: PlannerSettings | None = None,
        uncertainty: Uncertainty | None = None,
    ) -> None:
        """Begin without a plan."""
        self.settings = settings or HorizonSettings()
        self.planner = planner or PlannerSettings()
        self.uncertainty = uncertainty or Uncertainty()
        self._previous: PreviousPlan | None = None
        self._best: frozenset[str] = frozenset()
        self._ages: deque[float] = deque(maxlen=_AGES)
        self._recent = RecentCommands()
        self.learn(model)

    @property
    def model(self) -> Model:
        """The vehicle's model, made cautious, which plans use."""
        return self._model

    @typed_arguments
    def learn(self, model: Model, uncertainty: Uncertainty | None = None) -> None:
        """Continue with other parameters, or with the same ones, aged."""
        self.uncertainty = uncertainty or self.uncertainty
        self._model = self.uncertainty.cautious(model)

    def forget(self) -> None:
        """Continue without the previous plan."""
        self._previous = None

    @typed_arguments
    def step(
        self,
        state: PlanarState,
        paths: PathBatch | Sequence[CandidatePath | EvenPath],
        elevation_map: ElevationMap,
        *,
        clear: float | Floats = np.inf,
        conditions: GroundConditions | None = None,
    ) -> CycleAnswer:
        """One cycle.

        Args:
            state: the vehicle's now.
            paths: candidates, at best as stations that are even already. One that is called as
                that of the previous plan, and runs along it, is the same path.
            elevation_map: ground known now.
            clear: station up to which the ground is known to be free, from the first point of
                each candidate; one for all, or (M,) [m]. Below 0 nothing is free.
            conditions: those of this moment.

        Raises:
            ParameterError: a candidate is malformed, or ``clear`` has another shape.
        """
        started = perf_counter()
        offered = paths if isinstance(paths, PathBatch) else None
        if not isinstance(paths, PathBatch) and len(paths) > 0:
            spacing = self.planner.spacing_on(elevation_map.resolution, self.model.vehicle)
            offered = batch(list(paths), spacing, line_limits(self.model))
        if offered is not None and len(offered.names) == 0:
            offered = None
        free = behind_the_front(clear, self.model, 0 if offered is None else len(offered.names))
        felt = averaged_map(elevation_map, self.model.vehicle.wheel_radius)
        now = conditions or GroundConditions()
        if not state.invalid_field():
            self._ages.append(state.age)
        now = replace(now, pose_age=max(now.pose_age, *self._ages, 0.0))
        latency = survived_errors(self.model, self.uncertainty).latency
        planner = CyclePlanner(
            within_sight(self.model, elevation_map, self.planner.unseen_steps),
            self.uncertainty,
            self.settings.for_track(self.model.vehicle.track_width),
            self.planner,
            felt,
            now,
            started,
            state,
            self._recent.unseen(state, latency, self.model.limits.accel, self.settings.period),
        )
        cycle = Cycle(planner, self._previous, self._best)
        answer, self._previous = cycle.run(offered, free)
        # The best of a cycle are likely to be the best of the next one.
        self._best = frozenset(r.candidate for r in answer.ranking[: self.settings.smoothed])
        self._recent.add(answer)
        return replace(answer, seconds=cycle.seconds)
