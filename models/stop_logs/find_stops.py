"""Stops in a drive log: where each begins and ends, and which of them a braking model may learn.

A stop begins with the first sample at which a rolling vehicle receives the stop command and ends
with the first zero crossing of its speed; the suspension rocks back afterwards, so later crossings
carry no information. A vehicle that drives backwards is seen from its direction of travel. Stops
other than full, straight, undisturbed braking are found, too, and excluded with a reason.

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
from slopewise.models.stop_logs.drive_quality import stretches_of
from slopewise.models.stop_logs.speed_floor import speed_floor

STOP_COMMAND_MAX_SPEED = 0.01
"""A command of at most this is the stop command [m/s]."""

_SETTLED_LIMITS = 0.4, 0.12
"""Standstill is below this share of the held speed, and below this speed [m/s], however noisy."""

_STRAIGHT = 0.35
"""Mean yaw rate from which a stop is no longer straight [rad/s]."""

_SOON = 1.0  # [s] after it has settled, a speed that reads 0 at rest does
_HELD_ON = 0.85  # share of the samples of a stop at one application; the rest is its building up
_MIN_LOST = 0.3  # share of its speed that a stop cut short has to lose to say anything
_APPLIED = 0.05
"""Application above which the brakes are a stop command, in a log without v_cmd [1]: above the
offset of an unloaded pressure sensor, a few per cent of its range."""


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

    @property
    def remedy(self) -> str:
        """Change of the log or its settings after which such stops can be used."""
        return _REMEDIES[self]


_REMEDIES = {
    Usability.USABLE: "",
    Usability.ABORTED: "command 0 until the vehicle stands; until then it bounds the force only",
    Usability.UNFINISHED: "record until the vehicle stands; until then it bounds the force only",
    Usability.RAMPED: "command 0 in one step, or ramps = true in --stop-settings",
    Usability.REVERSED: "command 0 before driving back, or reversals = true in --stop-settings",
    Usability.TURNING: "brake on straights, or raise turn_rate in --stop-settings",
    Usability.PARTIAL: "apply the brakes fully, or hold one application",
    Usability.SLOW: "lower least_speed in --stop-settings",  # words: ok, a key
    Usability.COASTED: "drop the column brake if it belongs to others",
    Usability.SPARSE: "record the speed more often, or stop from higher speeds",
    Usability.SUSPECT: "record again without the samples that are listed as suspect",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class StopSettings:
    """Definition of a stop. Times in s, speeds in m/s."""

    least_speed: float | None = None  # None: above the noise floor. words: ok, a key
    held_for: float = 0.2  # before the command, over which the speed is averaged
    before: float = 1.0  # how much of the log in front of the command belongs to a stop
    after: float = 1.5  # and behind standstill
    ramp: float = 0.15  # a command that came down over a longer time is no step
    step: float = 0.7  # share of the speed that the command has to drop in one step
    turn_rate: float | None = None  # [rad/s] None: 0.35, or none where the cost of turning is known
    full_brake: float = 0.9  # application from which it counts as full
    fewest: int = 2  # words: ok, a key; samples from onset to standstill
    longest: float = np.inf  # later standstills are not this stop's
    settled: float = 0.3  # duration below `settled_speed` that is standstill without a crossing
    settled_speed: float = 0.03  # of sensors that never read zero; more in noisier logs
    partial: bool = False  # stops at a held part of the brakes may be learned from
    uneven: float = 0.06  # how far an application may be from its median and still be held
    ramps: bool = False  # commands that come down gradually are stops from where they begin to
    reversals: bool = False  # commands to drive the other way are stop commands

    def __post_init__(self) -> None:
        for name in ("least_speed", "longest", "settled_speed", "turn_rate"):
            value = getattr(self, name)
            is_infinite = value == np.inf and name not in ("turn_rate", "longest")
            if value is not None and (not value > 0.0 or is_infinite):
                raise ParameterError(name, f"a finite number > 0, got {value:g}")
        for name, lowest in (("ramp", 0.0), ("fewest", 2)):
            value = getattr(self, name)
            if not lowest <= value < np.inf:
                raise ParameterError(name, f"a finite number >= {lowest:g}, got {value:g}")
        for name in ("step", "full_brake"):
            value = getattr(self, name)
            if not 0.0 <= value <= 1.0:
                raise ParameterError(name, f"a share 0 … 1, got {value:g}")
        if self.least_speed is not None and not self.settled_speed < self.least_speed:
            expected = f"less than the least speed of {self.least_speed:g} m/s"
            raise ParameterError("settled_speed", f"{expected}, got {self.settled_speed:g}")


@dataclass(frozen=True, slots=True)
class StopWindow:
    """One stop as samples of its log."""

    begin: int  # first sample that belongs to it
    command: int  # the stop command
    standstill: int  # first sample at standstill, or the last of a stop cut short
    end: int  # one behind the last sample that belongs to it
    held_speed: float  # mean just before the command, in the direction of travel [m/s]
    verdict: Usability
    reason: str = ""  # why it is not usable, with numbers
    level: float = 1.0  # application of the brakes, by the log
    direction: int = 1  # -1 if it drove backwards
    is_bound: bool = False  # cut short, else usable: the force was no less than it shows

    @property
    def usable(self) -> bool:
        """The braking model may learn from it."""
        return self.verdict is Usability.USABLE

    @property
    def cut_short(self) -> bool:
        """The next command, or the end of the log, came before it stood."""
        return self.verdict in (Usability.ABORTED, Usability.UNFINISHED)


def find_stops(
    columns: Mapping[str, NDArray[Any]],
    run: slice,
    usable: Bools,
    settings: StopSettings | None = None,
    fresh: Bools | None = None,
) -> list[StopWindow]:
    """Every stop of one run, usable or not.

    Args:
        columns: channels by name, (n,): ``t`` [s], ``v`` and ``v_cmd`` [m/s]; ``yaw_rate``
            [rad/s] and ``brake`` [1] where the log has them. Where ``v_cmd`` is NaN throughout,
            applied brakes are the command.
        run: samples of the run. usable: (n,) samples that may be used, see
            :func:`slopewise.models.stop_logs.drive_quality.usable`. settings: what is a stop.
            fresh: (n,) samples with a new value of the speed; None: all.
    """
    settings = settings or StopSettings()
    part = {name: values[run] for name, values in columns.items() if values.dtype.kind in "fiub"}
    new = np.ones_like(usable[run]) if fresh is None else fresh[run]
    windows = _Search(part, usable[run], new, settings, run.start, 1).windows()
    if np.any(part["v_cmd"] < -STOP_COMMAND_MAX_SPEED):
        part |= {"v": -part["v"], "v_cmd": -part["v_cmd"]}
        windows += _Search(part, usable[run], new, settings, run.start, -1).windows()
    return sorted(windows, key=lambda w: w.command)


def application(brake: Floats | None, uneven: float) -> tuple[float, bool]:
    """Application of the brakes during a stop, and whether it is held; full without the channel.

    ``brake`` is NaN where it is missing, 0 where it is yet to come; ``uneven``: how far from the
    median a held one may be.
    """
    brake = brake if brake is None else brake[np.isfinite(brake) & (brake > 0.0)]
    if brake is None or not len(brake):
        return 1.0, True
    level = float(np.median(brake))
    return level, bool(np.mean(np.abs(brake - level) <= uneven) >= _HELD_ON)


class _Search:
    """One run while it is searched; indices count from its first sample, ahead is positive."""

    def __init__(
        self,
        part: Mapping[str, Floats],
        usable: Bools,
        fresh: Bools,
        settings: StopSettings,
        offset: int,
        direction: int,
    ) -> None:
        self.t, self.v, self.v_cmd = part["t"], part["v"], part["v_cmd"]
        self.part, self.usable, self.fresh, self.settings = part, usable, fresh, settings
        self.offset, self.direction = offset, direction
        self.brake = part.get("brake")
        self.is_stop = self.v_cmd <= STOP_COMMAND_MAX_SPEED
        if self.brake is not None and np.isnan(self.v_cmd).all():
            self.is_stop = self.brake > _APPLIED
        self.floor = speed_floor(
            self.t, self.v, self.is_stop & ~(np.abs(self.v_cmd) > STOP_COMMAND_MAX_SPEED), usable
        )

    def windows(self) -> list[StopWindow]:
        starts = np.flatnonzero(self.is_stop & ~np.concatenate(([True], self.is_stop[:-1])))
        windows = []
        for zero in starts.tolist():
            i = self._ramp_start(zero) if self.settings.ramps else zero
            held = self._held(i)
            lowest = self.settings.least_speed
            slowest = max(self.floor.slowest, self.settings.settled_speed)
            if held >= (slowest if lowest is None else min(lowest, slowest)):
                windows.append(self._window(i, zero, held))
        return windows

    def _held(self, i: int) -> float:
        before = self._samples(self.t[i] - self.settings.held_for, i + 1)
        rolling = self.v[before][self.usable[before]]
        return float(np.mean(rolling)) if len(rolling) else 0.0

    def _ramp_start(self, zero: int) -> int:
        """First sample of a command that falls from there on until it is 0."""
        before = self.v_cmd[:zero]
        rising = np.flatnonzero(np.diff(before) > 0.0)
        fall = slice(int(rising[-1]) + 1 if len(rising) else 0, zero + 1)
        from_top = self.v_cmd[fall][0] - self.v_cmd[fall] > STOP_COMMAND_MAX_SPEED
        return fall.start + int(np.argmax(from_top)) if from_top.any() else zero

    def _settled_speed(self, held: float) -> float:
        """Speed below which the vehicle stands, from the reading at rest [m/s]."""
        lowest = self.settings.settled_speed
        share, highest = _SETTLED_LIMITS
        return min(max(self.floor.standing, lowest), max(min(share * held, highest), lowest))

    def _samples(self, since: float, stop: int) -> slice:
        return slice(int(np.searchsorted(self.t, since - 1e-9)), stop)

    def _released(self, zero: int) -> int:
        """First sample of the next command, in either direction."""
        released = ~self.is_stop[zero:]
        if self.v_cmd[zero] >= -STOP_COMMAND_MAX_SPEED:
            released |= self.v_cmd[zero:] < -STOP_COMMAND_MAX_SPEED
        return zero + int(np.argmax(released)) if released.any() else len(self.t)

    def _window(self, i: int, zero: int, held: float) -> StopWindow:
        s = self.settings
        begin = self._samples(self.t[i] - s.before, i).start
        # An earlier stop does not belong to this one.
        stopped = np.flatnonzero(self.is_stop[begin:i])
        begin += int(stopped[-1]) + 1 if len(stopped) else 0
        released = self._released(zero)
        last = int(np.searchsorted(self.t, self.t[i] + s.longest, side="right"))
        standstill = self._standstill(i, min(last, len(self.t)), held)
        is_bound = False
        if standstill is None or standstill > released:
            end = min(released, last)
            standstill = end - 1
            verdict = Usability.ABORTED if released < len(self.t) else Usability.UNFINISHED
            event = "next command" if verdict is Usability.ABORTED else "end of the log"
            after = self.t[min(end, len(self.t) - 1)] - self.t[i]
            reason = f"{event} after {after:.2f} s, still at {self.v[standstill]:.2f} m/s"
            if self.v[standstill] <= (1.0 - _MIN_LOST) * held:
                is_bound = self._verdict(begin, i, zero, standstill, held)[0] is Usability.USABLE
        else:
            after = self.t[standstill] + s.after
            end = min(int(np.searchsorted(self.t, after, side="right")), released)
            end = max(end, standstill + 1)
            verdict, reason = self._verdict(begin, i, zero, standstill, held)
        level = application(self._brake(slice(i, standstill + 1)), s.uneven)[0]
        return StopWindow(
            self.offset + begin,
            self.offset + i,
            self.offset + standstill,
            self.offset + end,
            held,
            verdict,
            reason,
            level,
            self.direction,
            is_bound,
        )

    def _standstill(self, i: int, stop: int, held: float) -> int | None:
        """First sample at zero or below; the first of a settled stretch that meets no zero soon."""
        v, usable = self.v[i:stop], self.usable[i:stop]
        crossed = np.flatnonzero(usable & (v <= 0.0))
        settled = self._settled_speed(held)
        # Noise that reaches down to zero shows standstill better than its amplitude.
        soon = _SOON if settled > self.settings.settled_speed else 0.0
        first = int(crossed[0]) if len(crossed) else None
        for a, b in stretches_of(usable & (v <= settled)):
            if self.t[i + b - 1] - self.t[i + a] >= self.settings.settled:
                if first is None or self.t[i + first] - self.t[i + a] > soon:
                    first = a
                break
        return None if first is None else i + first

    def _brake(self, braking: slice) -> Floats | None:
        return None if self.brake is None else self.brake[braking]

    def _verdict(
        self, begin: int, i: int, zero: int, standstill: int, held: float
    ) -> tuple[Usability, str]:
        s = self.settings
        braking = slice(i, standstill + 1)
        if s.least_speed is not None and held < s.least_speed:
            return Usability.SLOW, f"{held:.2f} m/s, below the least speed of {s.least_speed:g} m/s"
        near = self._samples(self.t[i] - 0.5 * s.before, standstill + 1)
        if not self.usable[near].all():
            return Usability.SUSPECT, f"{int((~self.usable[near]).sum())} suspect samples"
        if begin == i:
            return Usability.SPARSE, f"no sample in the {s.before:g} s before it"
        if self.v_cmd[zero] < -STOP_COMMAND_MAX_SPEED and not s.reversals:
            return Usability.REVERSED, f"command of {self.direction * self.v_cmd[zero]:.2f} m/s"
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
        return self._verdict_of_brakes(braking, held)

    def _verdict_of_brakes(self, braking: slice, held: float) -> tuple[Usability, str]:
        s, brake = self.settings, self._brake(braking)
        if brake is not None and np.isfinite(brake).any() and not np.nansum(np.abs(brake)) > 0.0:
            return Usability.COASTED, "brake application of 0 until it stood"
        level, held_on = application(brake, s.uneven)
        if level < s.full_brake and not (s.partial and held_on):
            addition = "" if held_on else ", and not held there"
            return Usability.PARTIAL, f"brakes applied to {level:.0%}{addition}"
        falling = np.flatnonzero(self.v[braking] > 0.9 * held)
        onset = braking.start + int(falling[-1]) if len(falling) else braking.start
        count = int(np.sum(self.fresh[onset + 1 : braking.stop]))
        if count < s.fewest:
            return Usability.SPARSE, f"{count} new values of v while it braked"
        return Usability.USABLE, ""
