"""Measuring all stops of a log together: ground under them, onsets, forces.

All stops together determine what a single one cannot: dive of the body, noise of the speed, dead
time of the brakes, how well speeds are held. The order: knees on the raw grade, dive and
mount, knees on the ground.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.stop_logs.creep import held_weights
from slopewise.models.stop_logs.dead_time import DeadTime, dead_time, sharpen
from slopewise.models.stop_logs.ground_grade import Dive, StopPitch, estimate_dive, shrunk
from slopewise.models.stop_logs.mount_offset import Mount
from slopewise.models.stop_logs.onset import HELD, Knee, fit_knee
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
    """Stops with their ground, and what they share.

    Attributes:
        records: stops that could be measured, in order. unmeasured: those that could not.
        dead_time: dead time of the brakes. by_dead_time: (n,) change of each force with it [1/s].
        dive: dive of the body.
    """

    records: tuple[StopRecord, ...]
    unmeasured: tuple[StopSamples, ...]
    dead_time: DeadTime
    by_dead_time: Floats
    dive: Dive


def measure(
    stops: Sequence[StopSamples], mount: Mount, slope: Slope, dive: Dive | None = None
) -> Measured:
    """Measure stops.

    Args:
        stops: samples extracted from the log.
        mount: offset of the pitch sensor.
        slope: current estimate; it only matters where the grade varies along a stop.
        dive: if it is known already, such as from an earlier call.
    """
    # The dive is in proportion to the deceleration, which the first knees give.
    first = [_knee(stop, _ground(stop, None, mount, Dive()), slope) for stop in stops]
    if dive is None:
        dive = _dive(stops, first)
    grounds = [_ground(s, k, mount, dive) for s, k in zip(stops, first, strict=True)]
    held = held_weights(first, speed_noise([knee for knee in first if knee is not None]))
    knees = [_knee(s, g, slope, h) for s, g, h in zip(stops, grounds, held.tolist(), strict=True)]
    usable = [i for i, knee in enumerate(knees) if knee is not None]
    missing = tuple(stop for stop, knee in zip(stops, knees, strict=True) if knee is None)
    if not usable:
        return Measured((), missing, DeadTime(0.0, 0.0, 0.0), np.empty(0), dive)
    measured = [knee for knee in knees if knee is not None]
    noise = speed_noise(measured)
    common = dead_time(measured, noise)
    sharp = sharpen(measured, noise, common)
    seen = np.array([knee.mean_grade for knee in measured])
    grade = shrunk(seen, _grade_noise([stops[i] for i in usable]))
    force = sharp.force_ratio + np.sin(seen) - np.sin(grade)
    records = tuple(
        StopRecord(
            stops[i],
            measured[j],
            grounds[i],
            float(noise[j]),
            float(sharp.onset_speed[j]),
            float(grade[j]),
            float(force[j]),
            float(sharp.force_std[j]),
        )
        for j, i in enumerate(usable)
    )
    return Measured(records, missing, common, sharp.by_dead_time, dive)


def _grade_noise(stops: Sequence[StopSamples]) -> Floats:
    """(stops,) noise of each mean grade, from the changes of the pitch between samples [rad].

    A grade from a map has none.
    """
    jumps = np.concatenate([np.diff(stop.pitch) for stop in stops])
    each = 1.4826 * float(np.median(np.abs(jumps))) / np.sqrt(2.0)
    count = np.array([max(stop.at_standstill - stop.at_command, 1) for stop in stops])
    mapped = np.array([s.grade is not None and np.isfinite(s.grade).all() for s in stops])
    noise: Floats = np.where(mapped, 0.0, each / np.sqrt(count))
    return noise


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
    noise: Floats = np.sqrt(variance * (1.0 + rho) / (1.0 - rho))
    return noise


def _dive(stops: Sequence[StopSamples], knees: Sequence[Knee | None]) -> Dive:
    pitches = []
    for stop, knee in zip(stops, knees, strict=True):
        still = float(stop.time[-1]) - stop.standstill_time
        if knee is None or still < _MIN_STANDSTILL or not np.isfinite(stop.pitch).all():
            continue
        pitches.append(
            StopPitch(
                stop.time,
                stop.station,
                stop.pitch,
                knee.onset_time,
                stop.standstill_time,
                _mean_deceleration(stop, knee),
            )
        )
    return estimate_dive(pitches)


def dive_pitch(stop: StopSamples, knee: Knee, dive: Dive) -> Floats:
    """(n,) pitch of the body by its dive, at the samples of a stop [rad]."""
    return dive.pitch(
        stop.time, knee.onset_time, stop.standstill_time, _mean_deceleration(stop, knee)
    )


def _mean_deceleration(stop: StopSamples, knee: Knee) -> float:
    return knee.onset_speed / max(stop.standstill_time - knee.onset_time, 1e-3)


def _ground(stop: StopSamples, knee: Knee | None, mount: Mount, dive: Dive) -> Floats:
    """Grade of the ground at the samples: the map's where there is one, else from the pitch."""
    grade = mount.offset - stop.pitch
    if knee is not None:
        grade = (grade + dive_pitch(stop, knee, dive)) / dive.steeper
    if stop.grade is not None:
        grade = np.where(np.isfinite(stop.grade), stop.grade, grade)
    return grade


def _knee(stop: StopSamples, ground: Floats, slope: Slope, held: float = HELD) -> Knee | None:
    slope_here = slope(stop.window.held_speed)
    return fit_knee(stop.time, stop.speed, ground, stop.standstill_time, slope_here, held)
