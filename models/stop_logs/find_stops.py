"""Stops in a drive log: where each begins and ends, and which of them a braking model may learn.

A stop begins with the first sample at which a rolling vehicle receives the stop command and ends
with the first zero crossing of its speed; the suspension rocks back afterwards, so later crossings
carry no information. Stops other than full, straight, undisturbed braking are found, too, and
excluded with a reason.

Source: Braking Sec. 2 (procedure), (1).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slopewise.models.arrays import Bools, Floats
from slopewise.models.errors import ParameterError
from slopewise.models.stop_logs.speed_floor import speed_floor
from slopewise.models.stop_logs.stop_channels import application

STOP_COMMAND_MAX_SPEED = 0.01
"""A command of at most this is the stop command [m/s]."""

_SETTLED_LIMITS = 0.4, 0.12
"""Standstill is below this share of the held speed, and below this speed [m/s], however noisy."""

_STRAIGHT = 0.35
"""Mean yaw rate from which a stop is no longer straight [rad/s]."""

_SOON = 1.0  # [s] after it has settled, a speed that reads 0 at rest does


class Usability(Enum):
    """Usability of a stop for the braking model, with the reason if it is unusable."""

    USABLE = "usable"
    ABORTED = "aborted: commanded to drive before it stood"
    UNFINISHED = "unfinished: the log ends before it stood"
    RAMPED = "ramped: the command came down gradually"
    REVERSED = "reversed: commanded to drive backwards"
    TURNING = "turning while it braked"
    PARTIAL = "brakes applied in part only"
    SLOW = "slower than the least speed"
    COASTED = "coasted: commanded to stand, with the brakes at 0"
    SPARSE = "too few samples while it braked"
    SUSPECT = "suspect samples"


@dataclass(frozen=True, slots=True, kw_only=True)
class StopSettings:
    """Definition of a stop. Times in s, speeds in m/s.

    Attributes:
        least_speed: slower vehicles have nothing to stop; None takes the log's noise
            floor.
        held_for: before the command, over which the speed is averaged.
        before, after: how much of the log around a stop belongs to it.
        ramp: a command that came down over a longer time than that is no step.
        step: share of the speed that the command has to drop in one step.
        turn_rate: mean |yaw rate| from which a stop is no longer straight [rad/s]; None takes 0.35,
            and no limit where what turning costs is known.
        full_brake: brake application from which it counts as full [1].
        fewest: samples between onset and standstill.
        longest: later standstills are not this stop's.
        settled: a speed below ``settled_speed`` for this long is standstill without a crossing.
        settled_speed: of sensors that never read zero; more where the log is noisier at rest.
        partial: stops at a part of the brakes that is held may be learned from.
        uneven: how far an application may be from its median and still be held [1].
    """

    least_speed: float | None = None
    held_for: float = 0.2
    before: float = 1.0
    after: float = 1.5
    ramp: float = 0.15
    step: float = 0.7
    turn_rate: float | None = None
    full_brake: float = 0.9
    fewest: int = 6
    longest: float = np.inf
    settled: float = 0.3
    settled_speed: float = 0.03
    partial: bool = False
    uneven: float = 0.06

    def __post_init__(self) -> None:
        for name in ("least_speed", "longest", "settled_speed", "turn_rate"):
            value = getattr(self, name)
            if value is None:
                continue
            if not value > 0.0 or (value == np.inf and name not in ("turn_rate", "longest")):
                raise ParameterError(name, f"a finite number > 0, got {value:g}")
        for name, lowest in (("ramp", 0.0), ("fewest", 3)):
            if not lowest <= getattr(self, name) < np.inf:
                expected = f"a finite number >= {lowest:g}, got {getattr(self, name):g}"
                raise ParameterError(name, expected)
        for name in ("step", "full_brake"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ParameterError(name, f"a share 0 … 1, got {getattr(self, name):g}")
        if self.least_speed is not None and not self.settled_speed < self.least_speed:
            expected = f"less than the least speed of {self.least_speed:g} m/s"
            raise ParameterError("settled_speed", f"{expected}, got {self.settled_speed:g}")


@dataclass(frozen=True, slots=True)
class StopWindow:
    """One stop as samples of its log.

    Attributes:
        begin, command, standstill, end: first sample that belongs to it, the stop command, the
            first sample at standstill (or the last of an unfinished stop), one behind the last.
        held_speed: mean speed just before the command [m/s].
        verdict, reason: whether it may be learned from; the reason adds numbers.
        level: application of the brakes, by the log.
    """

    begin: int
    command: int
    standstill: int
    end: int
    held_speed: float
    verdict: Usability
    reason: str = ""
    level: float = 1.0

    @property
    def usable(self) -> bool:
        """The braking model may learn from it."""
        return self.verdict is Usability.USABLE


def find_stops(
    columns: Mapping[str, NDArray[Any]],
    run: slice,
    usable: Bools,
    settings: StopSettings | None = None,
) -> list[StopWindow]:
    """Every stop of one run, usable or not.

    Args:
        columns: channels by name, (n,): ``t`` [s], ``v`` and ``v_cmd`` [m/s]; ``yaw_rate``
            [rad/s] and ``brake`` [1] where the log has them.
        run: samples of the run.
        usable: (n,) samples that may be used, see
        :func:`slopewise.models.stop_logs.drive_quality.usable`.
        settings: definition of a stop.
    """
    settings = settings or StopSettings()
    part = {name: values[run] for name, values in columns.items() if values.dtype.kind in "fiub"}
    search = _Search(part, usable[run], settings)
    offset = run.start
    return [
        StopWindow(
            w.begin + offset,
            w.command + offset,
            w.standstill + offset,
            w.end + offset,
            w.held_speed,
            w.verdict,
            w.reason,
            w.level,
        )
        for w in search.windows()
    ]


class _Search:
    """One run while it is searched; indices count from its first sample."""

    def __init__(self, part: Mapping[str, Floats], usable: Bools, settings: StopSettings) -> None:
        self.t, self.v, self.v_cmd = part["t"], part["v"], part["v_cmd"]
        self.part, self.usable, self.settings = part, usable, settings
        self.is_stop = self.v_cmd <= STOP_COMMAND_MAX_SPEED
        self.floor = speed_floor(
            self.t, self.v, np.abs(self.v_cmd) <= STOP_COMMAND_MAX_SPEED, usable
        )

    def windows(self) -> list[StopWindow]:
        starts = np.flatnonzero(self.is_stop & ~np.concatenate(([True], self.is_stop[:-1])))
        windows = []
        for i in starts.tolist():
            before = self._samples(self.t[i] - self.settings.held_for, i + 1)
            rolling = self.v[before][self.usable[before]]
            held = float(np.mean(rolling)) if len(rolling) else 0.0
            lowest = self.settings.least_speed
            slowest = max(self.floor.slowest, self.settings.settled_speed)
            if held >= (slowest if lowest is None else min(lowest, slowest)):
                windows.append(self._window(i, held))
        return windows

    def _settled_speed(self, held: float) -> float:
        """Speed below which the vehicle stands, from the reading at rest [m/s]."""
        lowest = self.settings.settled_speed
        share, highest = _SETTLED_LIMITS
        return min(max(self.floor.standing, lowest), max(min(share * held, highest), lowest))

    def _samples(self, since: float, stop: int) -> slice:
        return slice(int(np.searchsorted(self.t, since - 1e-9)), stop)

    def _window(self, i: int, held: float) -> StopWindow:
        s = self.settings
        begin = self._samples(self.t[i] - s.before, i).start
        stopped = np.flatnonzero(
            self.is_stop[begin:i]
        )  # an earlier stop does not belong to this one
        begin += int(stopped[-1]) + 1 if len(stopped) else 0
        again = np.flatnonzero(~self.is_stop[i:])
        released = i + int(again[0]) if len(again) else len(self.t)
        last = int(np.searchsorted(self.t, self.t[i] + s.longest, side="right"))
        standstill = self._standstill(i, min(last, len(self.t)), held)
        if standstill is None:
            verdict = Usability.ABORTED if released < len(self.t) else Usability.UNFINISHED
            end = min(released, last)
            return StopWindow(begin, i, end - 1, end, held, verdict)
        if standstill > released:
            return StopWindow(begin, i, released - 1, released, held, Usability.ABORTED)
        end = min(
            int(np.searchsorted(self.t, self.t[standstill] + s.after, side="right")), released
        )
        verdict, reason = self._verdict(begin, i, standstill, held)
        return StopWindow(
            begin,
            i,
            standstill,
            max(end, standstill + 1),
            held,
            verdict,
            reason,
            application(self._brake(slice(i, standstill + 1)), s.uneven)[0],
        )

    def _standstill(self, i: int, stop: int, held: float) -> int | None:
        """First sample at zero or below; the first of a settled stretch that meets no zero soon."""
        v, usable = self.v[i:stop], self.usable[i:stop]
        crossed = np.flatnonzero(usable & (v <= 0.0))
        settled = self._settled_speed(held)
        # Noise that reaches down to zero shows standstill better than its amplitude.
        soon = _SOON if settled > self.settings.settled_speed else 0.0
        slow = usable & (v <= settled)
        edges = np.flatnonzero(np.diff(np.concatenate(([0], slow.astype(np.int8), [0]))))
        first = int(crossed[0]) if len(crossed) else None
        for a, b in zip(edges[::2], edges[1::2], strict=True):
            if self.t[i + b - 1] - self.t[i + a] >= self.settings.settled:
                if first is None or self.t[i + first] - self.t[i + a] > soon:
                    first = int(a)
                break
        return None if first is None else i + first

    def _brake(self, braking: slice) -> Floats | None:
        return self.part["brake"][braking] if "brake" in self.part else None

    def _verdict(self, begin: int, i: int, standstill: int, held: float) -> tuple[Usability, str]:
        s = self.settings
        braking = slice(i, standstill + 1)
        if s.least_speed is not None and held < s.least_speed:
            return Usability.SLOW, f"{held:.2f} m/s, below the least speed of {s.least_speed:g} m/s"
        near = self._samples(self.t[i] - 0.5 * s.before, standstill + 1)
        if not self.usable[near].all():
            return Usability.SUSPECT, f"{int((~self.usable[near]).sum())} suspect samples"
        if self.v_cmd[i] < -STOP_COMMAND_MAX_SPEED:
            return Usability.REVERSED, f"command of {self.v_cmd[i]:.2f} m/s"
        # A command that came down before it reached zero is no step. Commands may be off by a
        # factor from the speed, so they are also compared with themselves.
        typical = min(held, float(np.max(self.v_cmd[begin:i])))
        moment = max(int(np.searchsorted(self.t, self.t[i] - s.ramp)), begin)
        if float(np.max(self.v_cmd[min(moment, i - 1) : i])) < s.step * typical:
            reason = f"command had come down to {self.v_cmd[i - 1]:.2f} m/s before it went to 0"
            return Usability.RAMPED, reason
        if "yaw_rate" in self.part:
            rate = np.abs(self.part["yaw_rate"][braking])
            mean = float(np.mean(rate[np.isfinite(rate)])) if np.isfinite(rate).any() else 0.0
            if mean > (_STRAIGHT if s.turn_rate is None else s.turn_rate):
                return Usability.TURNING, f"mean yaw rate {mean:.2f} rad/s"
        brake = self._brake(braking)
        if brake is not None and np.isfinite(brake).any() and not np.nansum(np.abs(brake)) > 0.0:
            return Usability.COASTED, "brake application of 0 until it stood"
        level, held_on = application(brake, s.uneven)
        if level < s.full_brake and not (s.partial and held_on):
            addition = "" if held_on else ", and not held there"
            return Usability.PARTIAL, f"brakes applied to {level:.0%}{addition}"
        falling = np.flatnonzero(self.v[braking] > 0.9 * held)
        onset = int(falling[-1]) if len(falling) else 0
        if standstill - i - onset < s.fewest:
            return Usability.SPARSE, f"{standstill - i - onset} samples while it braked"
        return Usability.USABLE, ""
