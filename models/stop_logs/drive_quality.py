"""Stretches of a drive log that nothing may be learned from, each with its reason.

A sensor that failed still writes numbers: an encoder that froze, a sentinel for "no value", a gap
in time, a channel in other units than its name says. Such samples are marked, never repaired:
learning excludes them and reports their number.

Validity: logs of wheeled vehicles below 40 m/s. Omits: errors that look like motion, such as wheel
slip, drift of an attitude filter, or degrees on ground so level that they read as steep radians.
Source: none; each threshold is stated with its check.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slopewise.models.arrays import Bools, Elementwise, Floats
from slopewise.models.stop_logs import unit_suspects
from slopewise.models.stop_logs.random_effects import PER_MAD

_SENTINELS = (99.99, 999.0, 999.9, 1000.0, 9999.0, 32767.0, 32768.0, 65535.0, 1e6)
"""Values by which loggers mark missing samples, in any unit: full scale of 16 bits and rows of
nines."""
_WHEELS = ("v_left", "v_right")
_LARGEST = {  # beyond these a value is no measurement
    **dict.fromkeys(("v", "v_cmd"), 40.0),
    **dict.fromkeys(_WHEELS, 60.0),
    **{"pitch": np.pi / 2, "roll": np.pi, "yaw_rate": 40.0},
    **dict.fromkeys(("current_left", "current_right"), 2000.0),
}
_FREEZES = ("v", *_WHEELS, "pitch", "yaw_rate")
_FAR = 3.0  # times the largest measured value: a sentinel's distance from measurements
_MOVING = 0.15  # [m/s] slower than that, the same value again and again is standstill
_FROZEN_FOR = 1.0  # [s] at least, and
_FROZEN_TIMES = 10.0  # times as many samples as a value of this channel usually lasts
_JUMP = 1.5  # [m/s] off its neighbours for one or two samples: no vehicle does that
_STEP_ACCEL = 20.0  # two g, which no vehicle reaches [m/s²]
_STEP_SPEED, _STEP_NOISE = 0.25, 8.0
"""What noise and quantisation add to a fall of the speed: [m/s], and standard deviations [1]."""
_GAP_TIMES, _GAP = 5.0, 0.3  # a gap exceeds this multiple of the median step, and this [s]


class SuspectKind(Enum):
    """Kind of fault of a stretch."""

    NOT_FINITE = "not finite"
    SENTINEL = "sentinel"
    FROZEN = "frozen"
    JUMP = "jump"
    GAP = "gap"
    STEP = "step"
    UNITS = "units"


@dataclass(frozen=True, slots=True)
class Suspect:
    """Samples [start, stop) of one channel of a log that are not to be trusted."""

    start: int
    stop: int
    channel: str  # name of the column
    kind: SuspectKind
    reason: str  # a sentence with numbers


def find_suspects(
    columns: Mapping[str, NDArray[Any]], runs: Sequence[slice]
) -> tuple[Suspect, ...]:
    """All suspect stretches of a drive log, in the order of the samples; texts are passed over."""
    suspects: list[Suspect] = []
    for run in runs:
        part = {
            name: np.asarray(values[run], np.float64)
            for name, values in columns.items()
            if values.dtype.kind in "fiub"
        }
        suspects += _suspects_of_run(part, run.start)
    return tuple(sorted(suspects, key=lambda s: (s.start, s.stop, s.channel)))


def usable(
    count: int, stretches: Iterable[Suspect], channels: Iterable[str] | None = None
) -> Bools:
    """(count,) samples that may be used; ``channels``: those that matter, by default all.

    Gaps in time always matter.
    """
    is_usable = np.ones(count, np.bool_)
    matter = None if channels is None else {*channels, "t"}
    for stretch in stretches:
        if matter is None or stretch.channel in matter:
            is_usable[stretch.start : stretch.stop] = False
    return is_usable


def _suspects_of_run(part: dict[str, Floats], begin: int) -> Iterator[Suspect]:
    t = part["t"]
    for k in _gaps(t):
        reason = f"no samples for {t[k + 1] - t[k]:.2f} s"
        yield Suspect(begin + k, begin + k + 2, "t", SuspectKind.GAP, reason)
    for name, values in part.items():
        for a, b, kind, reason in _suspects_of_channel(name, values, part):
            yield Suspect(begin + a, begin + b, name, kind, reason)
    for name, reason in unit_suspects.find(part):
        yield Suspect(begin, begin + len(t), name, SuspectKind.UNITS, reason)


def _suspects_of_channel(
    name: str, values: Floats, part: dict[str, Floats]
) -> Iterator[tuple[int, int, SuspectKind, str]]:
    if name in _LARGEST:
        # A column that a log does not have at all is NaN throughout: absent, not suspect.
        missing = ~np.isfinite(values)
        for a, b in stretches_of(missing) if not missing.all() else []:
            yield a, b, SuspectKind.NOT_FINITE, f"{name} is not a number"
        size = np.abs(np.where(missing, 0.0, values))
        beyond = size > _LARGEST[name]
        # A sentinel may lie within the limit: then it is far from everything else.
        marker = np.isin(size, _SENTINELS)
        beyond |= marker & (size > _FAR * np.max(size, where=~(marker | beyond), initial=0.0))
        for a, b in stretches_of(beyond):
            sentinel = np.isin(size[a:b], _SENTINELS).any()
            fault = "stands for no value" if sentinel else "is beyond any vehicle"
            yield a, b, SuspectKind.SENTINEL, f"{name} of {values[a]:g} {fault}"
        if name in ("v", "v_left", "v_right"):
            for a, b in _jumps(values, ~(missing | beyond)):
                yield a, b, SuspectKind.JUMP, f"{name} jumps to {values[a]:.2f} m/s and back"
        if name == "v":
            for k in _steps(part["t"], np.where(missing | beyond, np.nan, values)):
                change = values[k] - values[k - 1]
                reason = f"v changes by {change:+.2f} m/s from one row to the next"
                yield k - 1, k + 1, SuspectKind.STEP, reason
    if name in _FREEZES:
        for a, b in _frozen(name, values, part):
            seconds = part["t"][b - 1] - part["t"][a]
            reason = f"{name} stays at exactly {values[a]:g} for {seconds:.1f} s"
            yield a, b, SuspectKind.FROZEN, reason


def stretches_of(mask: Bools) -> list[tuple[int, int]]:
    """[start, stop) of each run of True in a mask (n,)."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], mask.astype(np.int8), [0]))))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _gaps(t: Floats) -> list[int]:
    step = np.diff(t)
    if len(step) < 2:
        return []
    return [int(k) for k in np.flatnonzero(step > max(_GAP_TIMES * float(np.median(step)), _GAP))]


def _jumps(values: Floats, valid: Bools) -> list[tuple[int, int]]:
    """One or two samples that leave a steady neighbourhood and come back to it."""
    if len(values) < 5:
        return []
    around = np.lib.stride_tricks.sliding_window_view(np.pad(values, 2, mode="edge"), 5)
    is_far = np.abs(values - np.median(around, axis=1)) > _JUMP
    return stretches_of(is_far & valid)


def _steps(time: Floats, speed: Floats) -> list[int]:
    """Samples at which the speed (n,) has fallen faster than tyres and brakes can bring it down.

    Samples are lost there, or the sensor failed. A slow sensor's value may be as old as its row. A
    rise carries no information on brakes, and is where logs of several drives are joined.
    """
    if not np.isfinite(np.diff(speed, n=2)).any():
        return []
    change = np.diff(np.abs(speed))
    at = np.flatnonzero(change != 0.0) + 1
    elapsed = time[at] - time[np.concatenate(([0], at[:-1]))] if len(at) else np.empty(0)
    # White noise has 6 times its variance in second differences.
    noise = PER_MAD * float(np.nanmedian(np.abs(np.diff(speed, n=2)))) / np.sqrt(6.0)
    return [int(k) for k in at[-change[at - 1] > max_fall(elapsed, noise)]]


def max_fall(elapsed: Elementwise, noise: float = 0.0) -> Elementwise:
    """Largest fall of a speed with noise [m/s] in a time [s] that brakes can give [m/s]."""
    return _STEP_ACCEL * elapsed + max(_STEP_SPEED, _STEP_NOISE * noise)


def _frozen(name: str, values: Floats, part: dict[str, Floats]) -> list[tuple[int, int]]:
    """The same value, bit by bit, for longer than this channel ever keeps one while it moves.

    In a log without noise values last long by nature, so the log gives the typical duration.
    After the stop command a rolling speed that does not change at all is frozen in any log.
    Wheel speeds that both stand still while the command does are set points, in a log that held
    measured ones before as well: one sensor freezes alone, and not only while nothing is asked.
    """
    t = part["t"]
    moving = np.abs(part.get("v", values)) > _MOVING
    edges = np.flatnonzero(np.diff(values) != 0.0) + 1
    starts = np.concatenate(([0], edges))
    stops = np.concatenate((edges, [len(values)]))
    length = stops - starts
    lasting = t[stops - 1] - t[starts]
    total = np.concatenate(([0], np.cumsum(moving)))
    moved = total[stops] - total[starts]
    matters = (moved >= 0.9 * length) & np.isfinite(values[starts])
    if not matters.any():
        return []
    typical = float(np.median(np.repeat(length[matters], length[matters])))
    # A sensor may freeze while the vehicle comes to rest: enough of the stretch has to be driven.
    enough = (moved >= max(8.0, _FROZEN_TIMES * typical)) & np.isfinite(values[starts])
    frozen = enough & (lasting >= _FROZEN_FOR)
    if name == "v" and "v_cmd" in part:
        commands = np.append(np.flatnonzero(part["v_cmd"] <= 0.0), len(t))
        first = commands[np.searchsorted(commands, starts)]
        since_command = np.where(first < stops, t[stops - 1] - t[np.minimum(first, stops - 1)], 0.0)
        frozen |= matters & (since_command >= _FROZEN_FOR)
    stretches = [(int(a), int(b)) for a, b in zip(starts[frozen], stops[frozen], strict=True)]
    if name in _WHEELS:
        stretches = [(a, b) for a, b in stretches if not _set_points(part, a, b)]
    return stretches


def _set_points(part: dict[str, Floats], start: int, stop: int) -> bool:
    """Return True if wheel speeds and command are constant over samples [start, stop)."""
    names = (*_WHEELS, "v_cmd")
    return all(name in part and np.ptp(part[name][start:stop]) == 0.0 for name in names)
