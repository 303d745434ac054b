"""Measuring all stops of a log together: ground under them, onsets, forces.

All stops together determine what a single one cannot: dive and oscillation of the body, noise of
the speed, dead time of the brakes, how well speeds are held. The order: knees on the raw grade,
dive and mount, oscillation, knees on the ground.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.stop_logs.body_oscillation import oscillation_of
from slopewise.models.stop_logs.dead_time import DeadTime, dead_time, held_weights, sharpen
from slopewise.models.stop_logs.ground_grade import Dive, StopPitch, estimate_dive, shrunk
from slopewise.models.stop_logs.mount_offset import Mount
from slopewise.models.stop_logs.onset import HELD, Knee, Oscillation, fit_knee
from slopewise.models.stop_logs.random_effects import PER_MAD
from slopewise.models.stop_logs.stop_record import StopRecord, StopSamples

_POOLED = 20.0  # samples of one stop that weigh as much as the noise of all stops
_MAX_CORRELATION = 0.9
"""Highest correlation of neighbouring residuals [1]: with 0.9, 19 samples count as one; more would
be a trend that the fit missed."""
_MIN_STANDSTILL = 0.4  # [s] of standstill without which a stop shows no dive

Slope = Callable[[float], float]
"""Change of F_b/W with grade at an onset speed: m(v) of Braking (7)."""


@dataclass(frozen=True, slots=True)
class Measured:
    """Stops with their ground, and what they share."""

    records: tuple[StopRecord, ...]  # stops that could be measured, in order
    unmeasured: tuple[StopSamples, ...]
    dead_time: DeadTime
    by_dead_time: Floats  # (n,) change of each force with it [1/s]
    dive: Dive
    oscillation: Oscillation | None
    bounds: tuple[StopRecord, ...] = ()  # cut short: the force was at least as measured


def measure(
    stops: Sequence[StopSamples],
    mount: Mount,
    slope: Slope,
    body: tuple[Dive, Oscillation | None] | None = None,
    cut_short: Sequence[StopSamples] = (),
) -> Measured:
    """Measure stops.

    Args:
        stops: samples of whole stops. cut_short: samples of stops that bound the force from below.
        mount: offset of the pitch sensor.
        slope: current estimate; it only matters where the grade varies along a stop.
        body: its dive and oscillation, if they are known already, such as from an earlier call.
    """
    # The dive is in proportion to the deceleration, which the first knees give.
    first = _first_knees(stops, mount, slope)
    dive = _dive(stops, first) if body is None else body[0]
    grounds = [_ground(s, k, mount, dive) for s, k in zip(stops, first, strict=True)]
    held = held_weights(first, speed_noise([knee for knee in first if knee is not None])).tolist()

    @cache  # of a body that does not swing, each is asked for twice
    def knee_of(i: int, oscillation: Oscillation | None) -> Knee | None:
        return _knee(stops[i], grounds[i], slope, held[i], oscillation)

    oscillation = oscillation_of(stops, grounds, knee_of) if body is None else body[1]
    knees = [knee_of(i, oscillation) for i in range(len(stops))]
    missing = tuple(stop for stop, knee in zip(stops, knees, strict=True) if knee is None)
    fitted = _with_knees(stops, grounds, knees)
    if not fitted:
        return Measured((), missing, DeadTime(0.0, 0.0, 0.0), np.empty(0), dive, oscillation)
    measured = [knee for _, _, knee in fitted]
    noise = speed_noise(measured)
    common = dead_time(measured, noise)
    seen = np.array([knee.mean_grade for knee in measured])
    grade = shrunk(seen, _grade_noise([stop for stop, _, _ in fitted]))
    records, by_dead_time = _records(fitted, grade, noise, common)

    first = _first_knees(cut_short, mount, slope)
    grounds = [_ground(s, k, mount, dive) for s, k in zip(cut_short, first, strict=True)]
    knees = [_knee(s, g, slope, HELD, oscillation) for s, g in zip(cut_short, grounds, strict=True)]
    short = _with_knees(cut_short, grounds, knees)
    seen = np.array([knee.mean_grade for _, _, knee in short])
    bounds = _records(short, seen, speed_noise([knee for _, _, knee in short]), common)[0]
    return Measured(records, missing, common, by_dead_time, dive, oscillation, bounds)


def _first_knees(stops: Sequence[StopSamples], mount: Mount, slope: Slope) -> list[Knee | None]:
    return [_knee(stop, _ground(stop, None, mount, Dive()), slope) for stop in stops]


_Fitted = list[tuple[StopSamples, Floats, Knee]]


def _with_knees(
    stops: Sequence[StopSamples], grounds: Sequence[Floats], knees: Sequence[Knee | None]
) -> _Fitted:
    return [(s, g, k) for s, g, k in zip(stops, grounds, knees, strict=True) if k is not None]


def _records(
    fitted: _Fitted, grade: Floats, noise: Floats, common: DeadTime
) -> tuple[tuple[StopRecord, ...], Floats]:
    """Records of stops on their ground, and the change of their forces with the dead time."""
    if not fitted:
        return (), np.empty(0)
    knees = [knee for _, _, knee in fitted]
    sharp = sharpen(knees, noise, common)
    seen = np.array([knee.mean_grade for knee in knees])
    force = sharp.force_ratio + np.sin(seen) - np.sin(grade)
    numbers = np.column_stack((noise, sharp.onset_speed, grade, force, sharp.force_std)).tolist()
    rows = zip(fitted, numbers, strict=True)
    records = tuple(StopRecord(stop, knee, ground, *row) for (stop, ground, knee), row in rows)
    return records, sharp.by_dead_time


def _grade_noise(stops: Sequence[StopSamples]) -> Floats:
    """(stops,) noise of each mean grade, from the changes of the pitch between samples [rad].

    A grade from a map has none.
    """
    jumps = np.concatenate([np.diff(stop.pitch) for stop in stops])
    each = PER_MAD * float(np.median(np.abs(jumps))) / np.sqrt(2.0)
    count = np.array([max(stop.at_standstill - stop.at_command, 1) for stop in stops])
    mapped = np.array([s.grade is not None and np.isfinite(s.grade).all() for s in stops])
    return np.where(mapped, 0.0, each / np.sqrt(count))


def speed_noise(knees: Sequence[Knee]) -> Floats:
    """(n,) noise of each stop [m/s]: its own residuals and those of all, weighted by samples.

    Correlated residuals carry less information: the variance is that of the mean of a first-order
    autoregression.
    """
    if not knees:
        return np.empty(0)
    rms = np.array([knee.rms for knee in knees])
    count = np.array([knee.samples for knee in knees])
    pooled = float(np.median(rms)) ** 2
    variance = (_POOLED * pooled + count * rms**2) / (_POOLED + count)
    rho = float(np.median([knee.correlation for knee in knees]))
    # Four fitted parameters make white residuals look anticorrelated.
    rho = float(np.clip(rho + 2.0 / float(np.median(count)), 0.0, _MAX_CORRELATION))
    return np.asarray(np.sqrt(variance * (1.0 + rho) / (1.0 - rho)))


def _dive(stops: Sequence[StopSamples], knees: Sequence[Knee | None]) -> Dive:
    pitches = []
    for stop, knee in zip(stops, knees, strict=True):
        still = float(stop.time[-1]) - stop.standstill_time
        if knee is None or still < _MIN_STANDSTILL or not np.isfinite(stop.pitch).all():
            continue
        pitches.append(stop_pitch(stop, knee))
    return estimate_dive(pitches)


def stop_pitch(stop: StopSamples, knee: Knee) -> StopPitch:
    """Pitch and mean deceleration of a stop between its onset and standstill."""
    onset, standstill = knee.onset_time, stop.standstill_time
    slowing = (knee.onset_speed - stop.speed_left) / max(standstill - onset, 1e-3)
    return StopPitch(stop.time, stop.station, stop.pitch, onset, standstill, slowing)


def _ground(stop: StopSamples, knee: Knee | None, mount: Mount, dive: Dive) -> Floats:
    """Grade of the ground at the samples: the map's where there is one, else from the pitch."""
    grade = stop.window.direction * mount.offset - stop.pitch
    if knee is not None:
        grade = (grade + dive.pitch(stop_pitch(stop, knee))) / dive.steeper
    if stop.grade is not None:
        grade = np.where(np.isfinite(stop.grade), stop.grade, grade)
    return grade


def _knee(
    stop: StopSamples,
    ground: Floats,
    slope: Slope,
    held: float = HELD,
    oscillation: Oscillation | None = None,
) -> Knee | None:
    new, at = stop.fresh, slope(stop.window.held_speed)
    time, speed, grade = stop.time, stop.of_body(oscillation), ground
    if not new.all():
        time, speed, grade = time[new], speed[new], grade[new]
    return fit_knee(time, speed, grade, stop.standstill_time, at, held, oscillation)
