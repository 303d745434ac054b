"""The braking model learned while driving: stops in, coefficients for planning out.

One estimate and one published set for each surface. A surface that is seen for the first time
starts from the model's own table for it, or from the base.

Source: Braking Sec. 1.2 ("even autonomously by the robot") and 4.2, whose joint fit over a FIFO of
stops is done here in constant time.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.calibration.force_fit import MIRRORED_SLOPE, WEAK_PRIOR
from slopewise.models.calibration.learned_force import LearnedForce
from slopewise.models.calibration.published import LowStops, PublishedForce, PublishSettings
from slopewise.models.calibration.recursive import Acceptance, RecursiveForce, RecursiveSettings
from slopewise.models.calibration.session_offset import RECENT, SessionOffset, SessionStop
from slopewise.models.parameters import Braking
from slopewise.models.stop_distance import StopDistance
from slopewise.models.stop_logs.stop_stream import StreamedStop


class _Surface:
    def __init__(
        self, known: Braking, recursive: RecursiveSettings, publish: PublishSettings
    ) -> None:
        start = np.array(known.coefficients)
        given = known.covariance
        covariance = np.diag(np.square(WEAK_PRIOR)) if given is None else np.array(given)
        self.estimate = RecursiveForce(start, covariance, recursive)
        self.published = PublishedForce(start, known.speed_range, known.grade_range, publish)
        self.middle_speed = 0.5 * sum(known.speed_range)
        self.last: deque[bool] = deque(maxlen=publish.window)
        self.low = LowStops()
        table = known.distance
        self.session: SessionOffset | None = None
        if table is not None and table.session_std > 0.0:
            self.session = SessionOffset(table, start)
        self.dead_time = self.known_dead_time = known.dead_time
        self.pristine = True

    def take(self, stop: StreamedStop, scatter: float, window: int) -> Acceptance:
        """Update the force, and what of it is published."""
        outcome = self.estimate.update(
            stop.onset_speed, stop.grade, stop.force_ratio, stop.force_std
        )
        if outcome is Acceptance.UNINFORMATIVE:
            return outcome
        self.pristine = False
        self.last.append(outcome is Acceptance.GATED)
        self.low.take(stop.onset_speed, stop.grade, stop.force_ratio, stop.force_std)
        weight = self.low.share(self.estimate.coefficients, scatter)
        if outcome is not Acceptance.GATED or weight < 1.0:
            self.published.follow(weight * self.estimate.coefficients)
        share = sum(self.last) / window
        self.published.update_validity(self.estimate.covariance, self.estimate.accepted, share)
        # What holds for some of the stops only is nothing to trust, nor are grades of wrong sign.
        if weight < 1.0 or self.has_mirrored_grade:
            self.published.fall_back()
        return outcome

    @property
    def has_mirrored_grade(self) -> bool:
        """Return True if the deceleration falls with the grade: its sign is wrong."""
        slope = self.estimate.coefficients[:2] @ (self.middle_speed, 1.0)
        return bool(slope < MIRRORED_SLOPE)


class OnlineBraking:
    """Braking models of all surfaces, followed while driving.

    Args:
        known: braking model to begin with, with its surfaces.
        recursive, publish: how to follow, bounds and rates.
    """

    def __init__(
        self,
        known: Braking,
        *,
        recursive: RecursiveSettings | None = None,
        publish: PublishSettings | None = None,
    ) -> None:
        self._known = known
        self._recursive = recursive or RecursiveSettings()
        self._publish = publish or PublishSettings()
        self._surfaces: dict[str, _Surface] = {}

    def take(
        self,
        stop: StreamedStop,
        surface: str = "",
        *,
        distance: float | None = None,
        dead_time: float = 0.0,
        may_narrow: bool = True,
    ) -> Acceptance:
        """Learn from a measured stop.

        Args:
            stop: measured. surface: "" without a name. distance: from the command on [m].
            dead_time: that is planned with, if longer than that of the model [s].
            may_narrow: whether the promise may become shorter with it.
        """
        state = self._on(surface)
        before, was_valid = state.published.corner_forces.mean(), state.published.valid
        outcome = state.take(stop, self._recursive.scatter, self._publish.window)
        if distance is None or state.session is None or outcome is Acceptance.UNINFORMATIVE:
            return outcome
        if outcome is Acceptance.CHANGED:
            state.session.restart(RECENT - 1)
        if outcome is not Acceptance.GATED or state.estimate.row < 0:
            state.dead_time = max(state.known_dead_time, dead_time)
            after = max(float(state.published.corner_forces.mean()), self._publish.min_force)
            # The promise becomes shorter by what one stop may raise the force by, in all.
            fall = max(self._publish.rise - max(after - float(before), 0.0), 0.0) / after
            is_accepted = may_narrow and outcome is not Acceptance.GATED
            is_accepted = is_accepted and not state.has_mirrored_grade
            state.session.take(
                SessionStop(stop.onset_speed, stop.grade, distance),
                state.published.coefficients,
                state.dead_time,
                fall if is_accepted else 0.0,
            )
        if was_valid and not state.published.valid:
            state.session.age(1.0)
        return outcome

    def age(self, seconds: float, time_constant: float = 3600.0) -> None:
        """Age all surfaces: wider covariance, force back to the default if weaker."""
        for on in self._surfaces.values():
            _age(on, seconds, time_constant)

    def coefficients(self, surface: str = "") -> Floats:
        """(4,) m_m, b_m, m_b, b_b that may be planned with."""
        return self._on(surface).published.coefficients

    def learned(self) -> dict[str, LearnedForce]:
        """Force learned on each surface that stops were made on."""
        return {name: _learned(on) for name, on in self._surfaces.items() if not on.pristine}

    def knows(self, surface: str) -> bool:
        """Whether stops were made on a surface."""
        on = self._surfaces.get(surface)
        return on is not None and not on.pristine

    def restore(
        self,
        learned: LearnedForce,
        surface: str = "",
        *,
        age: float = 0.0,
        time_constant: float = 3600.0,
    ) -> None:
        """Continue from the force learned on a surface ``age`` seconds ago."""
        on = self._on(surface)
        if on.session is not None:
            stops = tuple(SessionStop(*stop) for stop in learned.session)
            known, file = on.session.known, on.session.coefficients
            on.session = SessionOffset(known, file, learned.distance, stops)
        on.dead_time = max(on.known_dead_time, learned.dead_time)
        on.low = LowStops()
        estimate = on.estimate
        estimate.coefficients = np.array(learned.estimate)
        estimate.covariance = np.array(learned.covariance)
        estimate.accepted, estimate.gated = learned.accepted, learned.gated
        estimate.inflate_next, estimate.row = learned.accepted == 0, learned.row
        on.published.restore(
            np.array(learned.published), estimate.coefficients, valid=learned.valid
        )
        on.last.clear()
        on.last.extend(learned.last)
        on.pristine = False
        _age(on, age, time_constant)

    def forget(self, surface: str = "") -> None:
        """Return a surface to the model."""
        self._surfaces.pop(surface, None)

    def inflate(self, surface: str = "", below: Floats | None = None) -> None:
        """The ground may be another: publish less, and follow the next stop in full.

        Args:
            surface: its name.
            below: (4,) coefficients not to exceed; the model's own if omitted.
        """
        on = self._on(surface)
        on.estimate.inflate()
        on.low = LowStops()
        on.published.fall_back(below)
        on.last.clear()
        on.pristine = False
        self.new_session(surface)

    def new_session(self, surface: str = "") -> None:
        """The next stop is one of another session; until then no promise is below the model's."""
        session = self._on(surface).session
        if session is not None:
            session.restart()
            session.age(1.0)

    def widen(self, surface: str, promise: StopDistance) -> bool:
        """Promise no less than another table does at its worst; True if that changed anything."""
        on = self._on(surface)
        if on.session is None or not on.session.widen(promise):
            return False
        on.pristine = False
        return True

    def _on(self, surface: str) -> _Surface:
        state = self._surfaces.get(surface)
        if state is None:
            known = self._known.on(surface)
            state = self._surfaces[surface] = _Surface(known, self._recursive, self._publish)
        return state


def _age(on: _Surface, seconds: float, time_constant: float) -> None:
    on.estimate.age(seconds, time_constant)
    on.published.age(seconds, time_constant)
    if on.session is not None:
        on.session.age(-math.expm1(-max(seconds, 0.0) / time_constant))
    # Age makes no estimate valid.
    if on.published.valid:
        on.published.update_validity(on.estimate.covariance, on.estimate.accepted, 0.0)


def _learned(on: _Surface) -> LearnedForce:
    estimate = on.estimate
    even = 0.5 * (estimate.covariance + estimate.covariance.T)
    return LearnedForce(
        estimate=tuple(estimate.coefficients.tolist()),
        covariance=tuple(tuple(row) for row in even.tolist()),
        published=tuple(on.published.coefficients.tolist()),
        valid=on.published.valid,
        accepted=estimate.accepted,
        gated=estimate.gated,
        last=tuple(on.last),
        row=estimate.row,
        session=() if on.session is None else tuple((*stop,) for stop in on.session.stops),
        distance=None if on.session is None else on.session.table,
        dead_time=on.dead_time,
    )
