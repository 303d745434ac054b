"""Braking force by surface, learned from stops on top of a model file or a finding."""

from __future__ import annotations

import copy
import dataclasses
import math
import time
from collections import deque
from collections.abc import Callable, Collection, Mapping
from statistics import median

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.calibration.learned_force import LearnedForce, braking_in_use
from slopewise.models.calibration.online import OnlineBraking
from slopewise.models.calibration.published import PublishSettings
from slopewise.models.calibration.recursive import Acceptance, RecursiveSettings
from slopewise.models.force_design import corner_design, design
from slopewise.models.parameters import Braking
from slopewise.models.quantity import Matrix
from slopewise.models.stop_logs.stop_stream import StreamedStop
from slopewise.planner.ground.uncertainty import HOUR, Uncertainty
from slopewise.services.parameters.force_limits import (
    FORCE_ROUNDING,
    limit_increase,
    prior_for_new_surface,
    select_surface_to_evict,
    validate_force,
)
from slopewise.services.parameters.stop_checks import (
    MAX_DEAD_TIME,
    LearnedStop,
    measured_distance,
    predicted_distance,
)
from slopewise.services.settings.learning_settings import Learning

_MAX_REJECTING_SOURCES = 64
"""Pairs of surface and source whose rejected weak stops are counted [1]; bounds memory."""

MAX_LISTED = 5  # surfaces or groups in one warning [1]
DEAD_TIME_COUNT = 5  # last stops whose median dead time is used [1]: two odd ones change nothing

_UNCERTAINTY = Uncertainty()
"""Share of the file's force on ground without stops, and drift of the force with age."""

DEFAULT_COEFFICIENT_STD = (0.02, 0.06, 0.01, 0.05)
"""Standard deviations of m_m, b_m, m_b, b_b for a model file without covariance: about 12 % of a
typical vehicle's force at 2 m/s [s/m, 1, s/m, 1]."""


class BrakingForces:
    """Forces measured by stops on each surface, and the braking model to plan with; one thread.

    The base, surface "", represents terrain without a name.
    """

    def __init__(
        self,
        prior: Braking,
        settings: Learning,
        map_surfaces: Callable[[], Collection[str]] = tuple,
    ) -> None:
        """Begin with the prior's coefficients; ``map_surfaces``: surfaces that the map names."""
        self.prior, self._settings, self._map_surfaces = prior, settings, map_surfaces
        self._start = dataclasses.replace(prior, covariance=self.covariance_of(""))
        self._online = OnlineBraking(
            self._start,
            recursive=RecursiveSettings(change=settings.change),
            # How far plans may exceed the file is limited at planning, by the file's force.
            publish=PublishSettings(rise=settings.rise, only_valid=True, max_share=math.inf),
        )
        self._updated: dict[str, float] = {}
        self._last_stop: dict[str, float] = {}  # of any outcome
        self._rejections: dict[tuple[str, str], int] = {}
        self.dead_times: deque[float] = deque(maxlen=DEAD_TIME_COUNT)  # of the last stops [s]
        self._aged = time.monotonic()
        self._stronger: list[str] = []
        # Cached until something changes: one stop needs them several times.
        self._planned: Braking | None = None
        self._forces: dict[str, LearnedForce] | None = None

    def copy(self) -> BrakingForces:
        """A copy that learns separately from the same prior."""
        self._changed()
        shared = self.prior, self._start, self._settings, self._map_surfaces
        return copy.deepcopy(self, {id(each): each for each in shared})

    # ------------------------------------------------------------------ learning

    def learn(
        self,
        stop: StreamedStop,
        surface: str,
        source: str,
        distance: float | None,
        *,
        may_narrow: bool = True,
    ) -> LearnedStop:
        """Learn from one stop; a ParameterError if there are too many surfaces.

        ``may_narrow``: False for stops that may only make plans slower.
        """
        self._add_surface(surface)
        used = self.planning_braking({}).on(surface)
        predicted = predicted_distance(used, self.dead_time(), stop)
        if distance is None:
            distance = measured_distance(stop, max(used.dead_time, self.dead_time()))
        speed, grade = stop.onset_speed, stop.grade
        planned = self.planned_force(surface, speed, grade)
        now = time.monotonic()
        if now - self._last_stop.get(surface, now) >= self._settings.oldest:
            self._online.new_session(surface)
        self._last_stop[surface] = now
        if 0.0 <= stop.dead_time <= MAX_DEAD_TIME:
            self.dead_times.append(stop.dead_time)
        more = {"distance": distance, "dead_time": self.dead_time()}
        outcome = self._online.take(stop, surface, may_narrow=may_narrow, **more)
        if outcome is Acceptance.GATED and stop.force_ratio < planned:
            self._lower_after_rejections(stop, surface, source, planned)
        else:
            self._rejections.pop((surface, source), None)
        if outcome in (Acceptance.ACCEPTED, Acceptance.CHANGED):
            self._updated[surface] = now
        self._changed()
        return LearnedStop(surface, speed, grade, predicted, distance, outcome=outcome.value)

    def _lower_after_rejections(
        self, stop: StreamedStop, surface: str, source: str, planned: float
    ) -> None:
        """Lower plans after consecutive weak stops of one source, with any reports in between.

        Otherwise a sender that confirms the plan after each of them would silence bad news.
        """
        count = self._rejections.pop((surface, source), 0) + 1
        self._rejections[surface, source] = count
        while len(self._rejections) > _MAX_REJECTING_SOURCES:
            self._rejections.pop(next(iter(self._rejections)))
        if count >= RecursiveSettings().weaker:
            below = self._online.coefficients(surface).copy()
            below[3] -= planned - stop.force_ratio
            self._online.inflate(surface, below)
            self._rejections.pop((surface, source))

    def lower_base(self, surface: str, before: str) -> bool:
        """Lower the base to the force of the terrain driven now; True if it changed.

        Plans must not use more force than is known of the terrain now. ``surface``, ``before``: its
        name now and until now, "" unknown.
        """
        learned = self.learned()
        force = learned.get(surface) if surface else None
        if force is not None and force.accepted > 0:
            below = np.array(self.planning_braking({}).on(surface).coefficients)
        elif surface in self.prior.terrain:
            below = np.array(self.prior.on(surface).coefficients)
        elif surface and before:
            below = self._new_surface_prior()
        elif "" in learned:
            below = np.array(self.prior.coefficients)
        else:
            return False
        corners = self._corners("")
        used = self.planning_braking({})
        planned = corners @ np.array(used.coefficients)
        promise = used.on(surface).distance if surface in used.terrain else None
        lowered = promise is not None and self._online.widen("", promise)
        if "" in learned or np.any(planned > corners @ below + FORCE_ROUNDING):
            self._online.inflate("", below)
            lowered = True
        if lowered:
            self._changed()
        return lowered

    def new_session(self, surface: str) -> None:
        """Begin a session on a surface: the ground may be another, under the same name."""
        if surface in self.learned():
            self._online.new_session(surface)
            self._changed()

    def restrict_to_prior(self) -> list[str]:
        """Plan nowhere above the prior until stops make an estimate valid again; the surfaces."""
        ages = self.ages(time.monotonic())
        may_be_faster = {name: f for name, f in self.learned().items() if f.valid or f.session}
        for surface, force in may_be_faster.items():
            careful = dataclasses.replace(force, valid=False)
            self.put(surface, careful, ages[surface], confident=True)
            self._online.new_session(surface)
        self._changed()
        return list(may_be_faster)

    def assume_untrained(self) -> list[str]:
        """Assume brakes that may be worn where nothing was learned; the surfaces that changed.

        Plans use the share of the prior's force that they use on ground without stops, with the
        scatter of the oldest age, until the next stops.
        """
        surfaces = [s for s in ("", *self.prior.terrain) if not self._online.knows(s)]
        for surface in surfaces:
            below = np.array(self.prior.on(surface).coefficients)
            self._online.inflate(surface, _UNCERTAINTY.untrained_share * below)
            self._updated[surface] = time.monotonic() - self._settings.oldest
        self._changed()
        return surfaces

    def age(self) -> None:
        """Age all surfaces by the time since the last call."""
        now = time.monotonic()
        self._online.age(now - self._aged, self._settings.grows_old)
        self._changed()
        self._aged = now

    # ------------------------------------------------------------------ planning

    def flags(self) -> list[str]:
        """Warning of surfaces on which plans use more force than the model file."""
        if not self._stronger:
            return []
        names = ", ".join(name or "base" for name in self._stronger[:MAX_LISTED])
        return [f"plans with stronger brakes than the model file: {names}"]

    def dead_time(self) -> float:
        """Median of the last stops [s]; a sooner response than the file's is not used."""
        late = median(self.dead_times) if len(self.dead_times) > 1 else 0.0
        return max(self.prior.dead_time, late)

    def planned_force(self, surface: str, speed: float, grade: float) -> float:
        """F_b/W that is planned with at a speed [m/s] and grade [rad]."""
        if self._is_new(surface):
            coefficients = self._new_surface_prior()
        else:
            coefficients = np.array(self.planning_braking({}).on(surface).coefficients)
        return float(design(np.array([speed]), np.array([grade]))[0] @ coefficients)

    def ages(self, now: float) -> dict[str, float]:
        """Time since each surface was last updated by a stop [s]."""
        oldest = self._settings.oldest
        return {name: min(now - self._updated.get(name, now), oldest) for name in self.learned()}

    def planning_braking(self, ages: Mapping[str, float]) -> Braking:
        """The braking model to plan with; ages [s] widen the scatter of their surface."""
        if not ages and self._planned is not None:
            return self._planned
        older = {n: _UNCERTAINTY.drift * math.sqrt(age / HOUR) for n, age in ages.items()}
        used = braking_in_use(self.prior, self.learned(), older)
        used, self._stronger = limit_increase(self.prior, used, self._settings.most_above_file)
        late = self.dead_time()
        tables = {
            name: table
            if table.dead_time is None
            else dataclasses.replace(table, dead_time=max(table.dead_time, late))
            for name, table in used.terrain.items()
        }
        used = dataclasses.replace(used, dead_time=max(used.dead_time, late), terrain=tables)
        if not ages:
            self._planned = used
        return used

    def learned(self) -> dict[str, LearnedForce]:
        """Force learned on each surface."""
        if self._forces is None:
            self._forces = self._online.learned()
        return self._forces

    def _changed(self) -> None:
        self._planned = self._forces = None

    # ------------------------------------------------------------------ surfaces

    def _add_surface(self, surface: str) -> None:
        """Begin a new surface with a share of the weakest known force."""
        if not self._is_new(surface):
            return
        self._free_slot(surface)
        self._online.inflate(surface, self._new_surface_prior())
        self._changed()

    def _is_new(self, surface: str) -> bool:
        known = not surface or surface in self.prior.terrain
        return not (known or self._online.knows(surface))

    def _free_slot(self, surface: str) -> None:
        named = {*self.prior.terrain, *self._map_surfaces()}
        new = self._corners(""), self._new_surface_prior()
        evicted = select_surface_to_evict(surface, named, self.learned(), self._updated, new)
        if evicted:
            self.put(evicted, None, 0.0, confident=True)

    def _new_surface_prior(self) -> Floats:
        return prior_for_new_surface(self.prior, self.learned(), _UNCERTAINTY.untrained_share)

    def put(self, surface: str, force: LearnedForce | None, age: float, *, confident: bool) -> None:
        """Replace the force of a surface by one of ``age`` seconds ago; None: as in the prior.

        Not ``confident`` inflates its covariance. A ParameterError: brakes that would not slow the
        vehicle, or no slot is free.
        """
        if force is None:
            self._online.forget(surface)
            self._updated.pop(surface, None)
            self._last_stop.pop(surface, None)
            self._changed()
            return
        validate_force(force, self.prior, self._corners(surface))
        if surface and surface not in self.learned():
            self._free_slot(surface)
        self._online.restore(force, surface, age=age, time_constant=self._settings.grows_old)
        self._updated[surface] = self._last_stop[surface] = time.monotonic() - age
        if not confident:
            self._online.inflate(surface)
        self._changed()

    def covariance_of(self, surface: str) -> Matrix:
        """Covariance of the prior on a surface, the default one where it has none."""
        known = self.prior.on(surface).covariance
        return known or tuple(map(tuple, np.diag(np.square(DEFAULT_COEFFICIENT_STD)).tolist()))

    def use_dead_times(self, dead_times: Collection[float]) -> None:
        """Replace the dead times of the last stops [s]."""
        self.dead_times = deque(dead_times, maxlen=DEAD_TIME_COUNT)
        self._changed()

    def _corners(self, surface: str) -> Floats:
        known = self.prior.on(surface)
        return corner_design(known.speed_range, known.grade_range)
