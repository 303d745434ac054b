"""Learning from observations: what stops, drive samples and terrain labels change.

Knows neither versions nor disk: it returns the names of groups that changed, others store them.
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections import Counter, deque
from collections.abc import Callable, Collection

from slopewise.models.laws import braking
from slopewise.models.parameters import Model
from slopewise.models.quantity import GRAVITY
from slopewise.models.stop_logs.stop_stream import StopStream, StreamedStop
from slopewise.models.terrain.surfaces import with_open_surfaces
from slopewise.services.parameters.braking_groups import BASE, group_of
from slopewise.services.parameters.current_terrain import CurrentTerrain
from slopewise.services.parameters.learner_state import LearnerState
from slopewise.services.parameters.observation_filter import columns_of
from slopewise.services.parameters.parameter_group import DriveUpdate
from slopewise.services.parameters.stop_checks import (
    LearnedStop,
    StopRateLimiter,
    contradiction,
    implausible,
    stops_in,
)
from slopewise.services.settings.learning_settings import Learning
from slopewise.services.wire.arrival import MAX_ROBOT_SENDERS, SenderTable
from slopewise.services.wire.observations import (
    DriveSamples,
    RobotObservation,
    StopObservation,
    TerrainLabel,
)
from slopewise.services.wire.recent_warnings import RecentWarnings

_REMEMBERED_STOPS = 200
"""Last stops that are compared with their predictions [1]; the live page shows 400."""

NOT_LEARNED = "not learned from: "


class Learner:
    """Learns braking and terrain of one vehicle; one thread."""

    def __init__(
        self,
        file: Model,
        settings: Learning,
        map_surfaces: Callable[[], Collection[str]] = tuple,
        counters: Counter[str] | None = None,
    ) -> None:
        """Begin with the model of a file; see :class:`ParameterService`."""
        self._settings = settings
        self.state = LearnerState.of_file(file, settings, map_surfaces)
        self.ground = CurrentTerrain(file, settings)
        self.stops: deque[LearnedStop] = deque(maxlen=_REMEMBERED_STOPS)  # with predictions
        # stops learned from, and rejected by reason
        self.counters = Counter[str]() if counters is None else counters
        self._rate = StopRateLimiter(file.vehicle, settings.stops_at_once)
        self._warnings = RecentWarnings()
        self._streams = SenderTable[str, StopStream](
            lambda: StopStream(0.0, mount=settings.mount, dive=settings.dive), MAX_ROBOT_SENDERS
        )
        self._last_surface = ""
        self._open_surfaces: tuple[str, ...] = ()
        self._assumed: list[str] = []  # surfaces that plans count with on ground without a name

    # ------------------------------------------------------------------ observations

    def observe(
        self, observation: RobotObservation, key: str, arrived: float | None = None
    ) -> tuple[set[str], str]:
        """Learn from an observation; the groups that changed, and the outcome as text.

        ``key``: where it arrived, for errors; ``arrived``: monotonic clock, if not now [s].
        """
        now = time.monotonic()
        if not self._settings.enabled:
            return set(), self.state.unsupported_reason
        if isinstance(observation, TerrainLabel):
            self.ground.label(observation, now)
            return self.follow_terrain(now), f"ground is {observation.surface}"
        arrived = now if arrived is None else arrived
        if isinstance(observation, DriveSamples):
            return self._observe_drive(observation, key, now, arrived)
        assert isinstance(observation, StopObservation)
        return self._observe_stop(observation, now, arrived)

    def _observe_stop(
        self, stop: StopObservation, now: float, arrived: float
    ) -> tuple[set[str], str]:
        if reason := contradiction(stop):
            self.counters["stops_contradictory"] += 1
            self._warnings.add(f"stops of {stop.source} contradict themselves")
            return set(), NOT_LEARNED + reason
        force_ratio = float(braking.force_ratio_of_deceleration(stop.deceleration, stop.grade))
        std = stop.deceleration_std / GRAVITY
        dead_time = math.nan if stop.dead_time is None else stop.dead_time
        measured = StreamedStop(now, stop.speed, stop.grade, force_ratio, std, dead_time)
        changed = self.follow_terrain(now)
        surface = stop.surface or self.ground.surface(now)
        more, reason = self._learn(measured, surface, stop.source, stop.distance, arrived)
        return changed | more, reason

    def _observe_drive(
        self, samples: DriveSamples, key: str, now: float, arrived: float
    ) -> tuple[set[str], str]:
        columns = columns_of(samples, key)
        ground = self.ground.drive(samples.source, columns)
        update = DriveUpdate(samples.source, columns, ground)
        changed = {name for kind in self.state.kinds() for name in kind.drive(update)}
        forces = self.state.braking.forces
        if ground.changed:
            forces.new_session(self._last_surface)
            if forces.lower_base("", self._last_surface):
                changed.add(BASE)
        changed |= self.follow_terrain(now)
        reason = "the ground changed" if ground.changed else "samples"
        surface = samples.surface or self.ground.surface(now)
        for stop in stops_in(self._streams.of(samples.source), columns, forces.dead_time()):
            more, reason = self._learn(stop, surface, samples.source, None, arrived)
            changed |= more
        return changed, reason

    def _learn(
        self, stop: StreamedStop, surface: str, source: str, distance: float | None, arrived: float
    ) -> tuple[set[str], str]:
        """Learn from a measured stop, if it is plausible."""
        if self.state.unsupported_reason:
            return set(), self.state.unsupported_reason
        if expected := implausible(stop):
            self.counters["stops_implausible"] += 1
            return set(), f"{NOT_LEARNED}expected {expected}"
        forces = self.state.braking.forces
        # Weaker stops are always learned from, so that plans become slower and not faster.
        in_time = self._rate.accepts(stop, arrived)
        if not in_time and stop.force_ratio >= forces.planned_force(
            surface, stop.onset_speed, stop.grade
        ):
            self.counters["stops_too_many"] += 1
            self._warnings.add("more stops came than the vehicle can make")
            return set(), f"{NOT_LEARNED}more stops than the vehicle can make"
        learned = forces.learn(stop, surface, source, distance, may_narrow=in_time)
        self.stops.append(learned)
        self.counters["stops"] += 1
        changed = {group_of(surface)}
        # Where the map names no surfaces, the base represents all terrain.
        if surface and not any(self.state.map_surfaces()):
            known = dataclasses.replace(stop, dead_time=math.nan)  # its dead time counts once
            forces.learn(known, "", source, learned.actual, may_narrow=in_time)
            changed.add(BASE)
        return changed, learned.outcome

    def follow_terrain(self, now: float) -> set[str]:
        """Groups that change because the robot reached other terrain."""
        surface, before = self.ground.surface(now), self._last_surface
        if surface == before:
            return set()
        self._last_surface = surface
        if self.state.unsupported_reason:
            return set()
        return {BASE} if self.state.braking.forces.lower_base(surface, before) else set()

    # ------------------------------------------------------------------ planning

    def flags(self) -> list[str]:
        """Warnings about learned parameters and about the senders of stops."""
        flags = [*self.state.braking.forces.flags(), *self._warnings.active()]
        if self._assumed:
            ground, names = self.ground.description(), ", ".join(self._assumed)
            flags.append(f"ground is {ground}: plans count with the base or {names}")
        return flags

    def is_outdated(self) -> bool:
        """Return True if the description of the ground changed since the last active model."""
        return self.ground.open_surfaces() != self._open_surfaces

    def active(self) -> tuple[Model, float, float]:
        """The model to plan with, the age common to all of it, and the greatest age [s]."""
        model = self.state.basis
        for kind in self.state.kinds():
            model = kind.apply(model)
        self._open_surfaces = self.ground.open_surfaces()
        self._assumed = [n for n in self._open_surfaces if n in model.braking.terrain]
        model = with_open_surfaces(model, self._open_surfaces)
        ages = self.state.braking.forces.ages(time.monotonic())
        return model, self.state.braking.common_age(ages), max(ages.values(), default=0.0)
