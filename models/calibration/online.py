"""The braking model learned while driving: stops in, coefficients for planning out.

One estimate and one published set for each surface. A surface that is seen for the first time
starts from the model's own table for it, or from the base.

Source: Braking Sec. 1.2 ("even autonomously by the robot") and 4.2, whose joint fit over a FIFO of
stops is done here in constant time.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.calibration.force_fit import WEAK_PRIOR
from slopewise.models.calibration.learned_force import LearnedForce
from slopewise.models.calibration.published import LowStops, PublishedForce, PublishSettings
from slopewise.models.calibration.recursive import Acceptance, RecursiveForce, RecursiveSettings
from slopewise.models.calibration.session_offset import RECENT, SessionOffset, SessionStop
from slopewise.models.parameters import Braking
from slopewise.models.stop_logs.stop_stream import StreamedStop


@dataclass(frozen=True, slots=True)
class OnlineStop:
    """A stop that was just completed, and what became of it."""

    surface: str
    measured: StreamedStop
    outcome: Acceptance


class _Surface:
    def __init__(
        self, known: Braking, recursive: RecursiveSettings, publish: PublishSettings
    ) -> None:
        start = np.array([known.m_m, known.b_m, known.m_b, known.b_b])
        given = known.covariance
        covariance = np.diag(np.square(WEAK_PRIOR)) if given is None else np.array(given)
        self.estimate = RecursiveForce(start, covariance, recursive)
        self.published = PublishedForce(start, known.speed_range, known.grade_range, publish)
        self.last: deque[bool] = deque(maxlen=publish.window)
        self.low = LowStops()
        table = known.distance
        has_sessions = table is not None and table.session_std > 0.0
        self.session = SessionOffset(table, start) if table is not None and has_sessions else None
        self.dead_time = known.dead_time
        self.pristine = True


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
        dead_time: float | None = None,
    ) -> OnlineStop:
        """Learn from a measured stop.

        Args:
            stop: measured. surface: "" without a name. distance: from the command on [m].
            dead_time: that is planned with, if longer than that of the model [s].
        """
        on = self._on(surface)
        outcome = on.estimate.update(stop.onset_speed, stop.grade, stop.force_ratio, stop.force_std)
        if outcome is not Acceptance.UNINFORMATIVE:
            on.pristine = False
            on.last.append(outcome is Acceptance.GATED)
            on.low.take(stop.onset_speed, stop.grade, stop.force_ratio, stop.force_std)
            kept = on.low.share(on.estimate.coefficients, self._recursive.scatter)
            if outcome is not Acceptance.GATED or kept < 1.0:
                on.published.follow(kept * on.estimate.coefficients)
            share = sum(on.last) / self._publish.window
            on.published.judge(on.estimate.covariance, on.estimate.accepted, share)
            if kept < 1.0:  # what holds for some of the stops only is nothing to trust
                on.published.fall_back()
            if distance is not None and on.session is not None:
                if outcome is Acceptance.CHANGED:
                    on.session.restart(RECENT - 1)
                late = max(on.dead_time, dead_time or 0.0)
                self._follow(on, SessionStop(stop.onset_speed, stop.grade, distance), late)
        return OnlineStop(surface, stop, outcome)

    def _follow(self, on: _Surface, stop: SessionStop, dead_time: float) -> None:
        """Widen or narrow the promise by a stop, by the rate at which the force may rise."""
        assert on.session is not None
        force = max(float(on.published.corner_forces.mean()), self._publish.least)
        on.session.take(stop, on.published.coefficients, dead_time, self._publish.rise / force)

    def age(self, seconds: float, time_constant: float = 3600.0) -> None:
        """Let what was learned grow old: wider covariance, force back to the default if weaker."""
        for on in self._surfaces.values():
            _age(on, seconds, time_constant)

    def coefficients(self, surface: str = "") -> Floats:
        """(4,) m_m, b_m, m_b, b_b that may be planned with."""
        return self._on(surface).published.coefficients

    def learned(self) -> dict[str, LearnedForce]:
        """What each surface has taught; those that taught nothing are left out."""
        return {name: _learned(on) for name, on in self._surfaces.items() if not on.pristine}

    def learned_of(self, surface: str) -> LearnedForce | None:
        """What one surface has taught; None where it taught nothing."""
        on = self._surfaces.get(surface)
        return None if on is None or on.pristine else _learned(on)

    def knows(self, surface: str) -> bool:
        """Whether a surface taught anything."""
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
        """Go on from what a surface had taught ``age`` seconds ago."""
        on = self._on(surface)
        estimate = on.estimate
        estimate.coefficients = np.array(learned.estimate)
        estimate.covariance = np.array(learned.covariance)
        estimate.accepted, estimate.gated = learned.accepted, learned.gated
        estimate.doubted, estimate.row = learned.accepted == 0, learned.row
        on.published.restore(
            np.array(learned.published), estimate.coefficients, valid=learned.valid
        )
        on.last.clear()
        on.last.extend(learned.last)
        if on.session is not None:
            stops = tuple(SessionStop(*stop) for stop in learned.session)
            on.session = SessionOffset(on.session.known, on.session.law, learned.distance, stops)
        on.pristine = False
        _age(on, age, time_constant)

    def forget(self, surface: str = "") -> None:
        """Know of a surface what the model told in the beginning."""
        self._surfaces.pop(surface, None)

    def doubt(self, surface: str = "", below: Floats | None = None) -> None:
        """The ground may be another: publish less, and be open to whatever the next stop tells.

        Args:
            surface: that is doubted.
            below: (4,) coefficients not to exceed; the model's own if left out.
        """
        on = self._on(surface)
        on.estimate.doubt()
        on.low = LowStops()
        on.published.fall_back(below)
        on.last.clear()
        if on.session is not None:
            on.session.restart()
            on.session.age(1.0)
        on.pristine = False

    def new_session(self, surface: str = "") -> None:
        """The next stop is one of another session."""
        session = self._on(surface).session
        if session is not None:
            session.restart()

    def _on(self, surface: str) -> _Surface:
        found = self._surfaces.get(surface)
        if found is None:
            known = self._known.on(surface) if surface else self._known
            found = self._surfaces[surface] = _Surface(known, self._recursive, self._publish)
        return found


def _age(on: _Surface, seconds: float, time_constant: float) -> None:
    on.estimate.age(seconds, time_constant)
    on.published.age(seconds, time_constant)
    if on.session is not None:
        on.session.age(-math.expm1(-max(seconds, 0.0) / time_constant))
    # Growing older makes nothing valid that was not.
    if on.published.valid:
        on.published.judge(on.estimate.covariance, on.estimate.accepted, 0.0)


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
    )
