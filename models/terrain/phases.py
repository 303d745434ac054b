"""Phases of motion: rest, straight, turn, turn on the spot, stuck; and when they are steady.

Resistances are defined for steady motion only. Between the command of a turn (t₁ in print) and its
steady state (t₂) the currents also speed up the yaw inertia. The onset of steady motion is found by
smoothing rim speeds and yaw rate with two time constants: while they differ, something changes.

Wheels whose rim speeds ask for many times the yaw rate that is measured spin on the spot. Such
samples are withheld from the first on, and called stuck once it has lasted.

Source: Slip 4.1 (t₁, t₂; no rule given); Slip 2 (a vehicle with spinning wheels, B_s → ∞).
"""

from __future__ import annotations

import math
from enum import Enum

from slopewise.models.terrain.settings import MotionSettings

_SLOWER = 2.0
"""Ratio of the two time constants [1]."""


class Phase(Enum):
    """Kind of motion, steady unless it is OTHER."""

    OTHER = "transient"  # words: ok, not rest, straight, turn or stuck
    REST = "rest"
    STRAIGHT = "straight"
    TURN = "turn"
    SPOT = "turn_on_the_spot"
    STUCK = "stuck"


class MotionPhases:
    """Follows one run sample by sample.

    Attributes:
        phase: steady motion of the last sample.
        withheld: the last sample shows no slip track: wheels spin, or they just changed.
    """

    def __init__(self, track_width: float, settings: MotionSettings) -> None:
        """Begin a run; ``track_width``: B, the slip track of wheels without slip [m]."""
        self._track = track_width
        self._settings = settings
        self.begin()

    def begin(self) -> None:
        """Forget everything: another run, or a gap in this one."""
        self._fast: list[float] = []  # mean rim speed, ΔV and yaw rate, smoothed
        self._slow: list[float] = []
        self._turning = False
        self._spun = self._held = self._stopped = 0.0
        self._kind = self.phase = Phase.OTHER
        self.withheld = True

    def update(self, elapsed: float, v_left: float, v_right: float, yaw_rate: float) -> Phase:
        """One sample, ``elapsed`` [s] after the one before: the phase, OTHER unless it is steady.

        ``v_left``, ``v_right``: speeds at the rim [m/s]. ``yaw_rate``: ω_z without bias [rad/s].
        """
        s = self._settings
        now = (0.5 * (v_left + v_right), v_right - v_left, yaw_rate)
        if not self._fast:
            self._fast = self._slow = [*now]
        fast = elapsed / (s.smoothing + elapsed)
        slow = elapsed / (_SLOWER * s.smoothing + elapsed)
        self._fast = [a + fast * (x - a) for a, x in zip(self._fast, now, strict=True)]
        self._slow = [a + slow * (x - a) for a, x in zip(self._slow, now, strict=True)]
        self._v, self._dv, self._w = self._fast
        self._turning = abs(self._dv) > (s.turn_end if self._turning else s.turn_begin)

        standing = abs(v_left) < s.rest_speed and abs(v_right) < s.rest_speed
        # Wheels may stand while the body still slides or swings: a gyroscope at rest is quiet.
        change = abs(self._w - self._slow[2])
        quiet = change < 0.5 * s.steady_floor and abs(self._w) < s.rest_yaw_rate
        self._stopped = self._stopped + elapsed if standing and quiet else 0.0
        spinning = self._spins()
        self._spun = self._spun + elapsed if spinning else 0.0
        kind = self._kind_of(standing)
        self._held = self._held + elapsed if kind is self._kind and self._is_steady() else 0.0
        self._kind = kind
        changed = (
            abs(now[1] - self._dv) > 2.0 * (s.steady_change * abs(self._dv) + s.turn_end)
            or change > s.steady_change * abs(self._w) + s.steady_floor
        )
        self.phase = self._phase_of(kind, standing)
        self.withheld = spinning or changed or self.phase not in (Phase.TURN, Phase.SPOT)
        return self.phase

    def _spins(self) -> bool:
        if not self._turning:
            return False
        # turning the wrong way is also no turning
        achieved = math.copysign(self._w, self._w * self._dv)
        return achieved * self._track * self._settings.stuck_slip < abs(self._dv)

    def _kind_of(self, standing: bool) -> Phase:
        s = self._settings
        if standing:
            return Phase.REST
        if self._turning:
            inner = abs(self._v) - 0.5 * abs(self._dv)
            return Phase.SPOT if inner < -s.least_inner_speed else Phase.TURN
        if abs(self._v) >= s.least_speed and abs(self._dv) <= s.turn_end:
            return Phase.STRAIGHT
        return Phase.OTHER

    def _is_steady(self) -> bool:
        """Smoothed fast and slow agree; twice as far apart is allowed once they did."""
        s = self._settings
        share = s.steady_change if self._held == 0.0 else 2.0 * s.steady_change
        floor = s.steady_floor if self._held == 0.0 else 2.0 * s.steady_floor
        rim = max(abs(self._v), 0.5 * abs(self._dv))
        v, dv, w = self._slow
        return (
            abs(self._v - v) <= share * rim + floor * self._track
            and abs(self._dv - dv) <= share * abs(self._dv) + floor * self._track
            and abs(self._w - w) <= share * abs(self._w) + floor
        )

    def _phase_of(self, kind: Phase, standing: bool) -> Phase:
        s = self._settings
        if self._spun >= s.stuck_time:
            return Phase.STUCK
        if standing:
            return Phase.REST if self._stopped >= s.rest_time else Phase.OTHER
        if self._spun > 0.0 or self._held < s.steady_time:
            return Phase.OTHER
        return kind
