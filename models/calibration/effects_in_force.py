"""Stops of a model with named effects: what the four coefficients have to explain besides them.

The fit of a stop knows a force and an onset only, so that drag looks like more force, and a lag
like a later onset and less force. What a named effect explains already must not be learned a second
time. Each stop is therefore simulated with all effects in force, its simulated speeds are fitted as
the measured ones were, and force and dead time are moved until both fits agree (indirect inference,
Gouriéroux et al. 1993). An effect that hides the force, such as a friction that caps it, leaves the
stop without a word on the coefficients.

Validity: effects of the model, with the values that it states. Omits: heat that came
from before the log.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slopewise.models.arrays import Floats
from slopewise.models.calibration.stopping import stopping_distance
from slopewise.models.effects import registry
from slopewise.models.parameters import Model
from slopewise.models.stop_logs.measure import Measured
from slopewise.models.stop_logs.onset import Knee, fit_knee
from slopewise.models.stop_logs.stop_record import StopRecord
from slopewise.models.stops.simulation import GroundTrack, SimulatedStop, simulate_stop

_PASSES = 4
"""Fits with effects in force before the last one [1]; each costs some 30 ms per stop."""
_AFTER = 0.2  # [s] of standstill at the end of a simulated stop
_CLEAR = 0.02  # [1] by which the force is moved to see whether the stop shows it
_HIDDEN = 0.3  # share of a change of force that a stop shows; below it a stop is ignored
_HIDDEN_STD = 1.0  # [1] standard deviation of a force that is hidden
_LARGEST_STEP = 0.2  # [1]
_MIN_FORCE = 0.01  # [1] of a force
_MIN_STEP = 1e-3  # [1] of a force, from which two tries show the steepness
_STEEPNESS = 0.25, 1.25
"""Range of the secant's slope [1]: a step is at most four times the change that the fit shows."""
_MIN_VAR = 1e-8  # [s²] of an onset


def identifies_turns(model: Model, columns: Mapping[str, NDArray[Any]]) -> bool:
    """Whether stops in curves can be learned from: the model knows what turning costs, the log how
    fast it turned.
    """
    known = any("turning" in registry.law_of(effect).depends_on for effect in model.effect)
    return known and "yaw_rate" in columns


def net_of_effects(
    measured: Measured, model: Model, columns: Mapping[str, NDArray[Any]]
) -> Measured:
    """The stops with the remainder for the coefficients once all effects are in force.

    Args:
        measured: as without effects. model: with effects; its slope coefficients matter where the
            grade varies along a stop. columns: channels of the log.
    """
    if not model.effect or not measured.records:
        return measured
    stops = [
        _Stop(r, _track(r, columns), pull, r.force_ratio)
        for r, pull in zip(measured.records, measured.by_dead_time.tolist(), strict=True)
    ]
    common = measured.dead_time
    dead = common.value
    # The dead time is the mean that :mod:`slopewise.models.stop_logs.dead_time` takes.
    onset_variance = [r.noise**2 * float(r.knee.covariance[1, 1]) for r in measured.records]
    weight = 1.0 / (np.array(onset_variance) + common.between_stops**2 + _MIN_VAR)
    for _ in range(_PASSES):
        for simulated, _, knee, _ in _simulated_in_order(model, stops, dead):
            if knee is not None:
                simulated.follow(knee, dead, common.value)
        dead = max(common.value - float(np.average([s.shift for s in stops], weights=weight)), 0.0)
    records = []
    for simulated, stop, knee, heat in _simulated_in_order(model, stops, dead):
        extra = share = 0.0
        if knee is not None:
            simulated.shift = knee.onset_time - dead
            extra = _by_effects(model, simulated.record, simulated.force, dead, stop)
            more = _simulated(model, simulated, simulated.force + _CLEAR, dead, heat)[1]
            share = 0.0 if more is None else (more.force_ratio - knee.force_ratio) / _CLEAR
        records.append(
            dataclasses.replace(
                simulated.record,
                force_ratio=simulated.force,
                by_effects=extra,
                force_std=simulated.record.force_std / share if share > _HIDDEN else _HIDDEN_STD,
            )
        )
    # Forces of stops cut short hold what the effects add, and are no bounds without it.
    dead_time = dataclasses.replace(common, value=dead)
    return dataclasses.replace(measured, records=tuple(records), dead_time=dead_time, bounds=())


@dataclass(slots=True)
class _Stop:
    """A stop on its ground, and what its coefficients have to explain so far.

    Attributes:
        pull: change of the measured force with the dead time [1/s]. force: F_b/W so far.
        shift: how much later the onset looks [s]. seen: forces tried and what the fit made of them.
    """

    record: StopRecord
    track: GroundTrack
    pull: float
    force: float
    shift: float = 0.0
    seen: list[tuple[float, float]] = field(default_factory=list)

    def follow(self, knee: Knee, dead: float, common: float) -> None:
        """Move the force towards the one whose fit is that of the measured stop."""
        self.shift = knee.onset_time - dead
        # Each force was measured with its onset pulled towards the common one.
        self.seen.append((self.force, knee.force_ratio + self.pull * (common - knee.onset_time)))
        needed = (self.record.force_ratio - self.seen[-1][1]) / _steepness(self.seen)
        step = float(np.clip(needed, -_LARGEST_STEP, _LARGEST_STEP))
        self.force = max(self.force + step, _MIN_FORCE)


def _simulated_in_order(
    model: Model, stops: list[_Stop], dead: float
) -> Iterator[tuple[_Stop, SimulatedStop, Knee | None, float]]:
    """Each stop simulated, with its fit, and the heat that it began with [J/kg]."""
    tau = registry.motion(model.effect).fade_tau
    heat, since = 0.0, -math.inf
    for simulated in stops:
        clock = simulated.record.samples.clock
        warm = heat * math.exp(-max(clock - since, 0.0) / tau)
        stop, knee = _simulated(model, simulated, simulated.force, dead, warm)
        heat, since = stop.heat, clock + float(stop.time[-1])
        yield simulated, stop, knee, warm


def _steepness(seen: list[tuple[float, float]]) -> float:
    """Share of a change of its force that a stop shows [1], by the last two that were tried.

    A short stop ends before brakes that build up slowly have done so: it shows a part only.
    """
    if len(seen) < 2:
        return 1.0
    (before, shown_before), (now, shown_now) = seen[-2:]
    if abs(now - before) < _MIN_STEP:
        return 1.0
    return float(np.clip((shown_now - shown_before) / (now - before), *_STEEPNESS))


def _track(record: StopRecord, columns: Mapping[str, NDArray[Any]]) -> GroundTrack:
    """The ground from the stop command on; zero where the log does not show it."""
    station, grade = record.path
    window = record.samples.window
    part = slice(window.command, window.command + len(station))
    keep = np.concatenate(([True], np.diff(station) > 1e-9))

    def channel(name: str) -> Floats:
        values = np.asarray(columns[name][part], np.float64) if name in columns else 0.0 * station
        return np.where(np.isfinite(values), values, 0.0)[keep]

    speed = np.maximum(record.samples.speed[record.samples.at_command :][: len(station)], 0.3)
    turning = channel("yaw_rate") / speed[keep]
    vertical_curvature = channel("vertical_curvature") if "vertical_curvature" in columns else None
    roll, yaw, x, y = map(channel, ("roll", "yaw", "x", "y"))
    return GroundTrack(station[keep], grade[keep], roll, yaw, turning, x, y, vertical_curvature)


def _simulated(
    model: Model, simulated: _Stop, force: float, dead: float, heat: float
) -> tuple[SimulatedStop, Knee | None]:
    """A stop with this force and dead time, and the fit of its speeds."""
    record, track = simulated.record, simulated.track
    b_m, b_b = _line(model, record, force)
    on = dataclasses.replace(
        model.braking,
        m_m=0.0,
        b_m=b_m,
        m_b=0.0,
        b_b=b_b,
        dead_time=dead,
        terrain={},
        uphill=None,
        level=1.0,
    )
    held = record.samples.window.held_speed
    stop = simulate_stop(
        dataclasses.replace(model, braking=on),
        track,
        held,
        session_time=record.samples.clock,
        heat=heat,
    )
    if not stop.stopped:
        return stop, None
    end = float(stop.time[-1])
    # Sampled as the stop was: what a knee makes of a gradual beginning depends on that.
    sample_times = record.samples.time
    step = float(np.median(np.diff(sample_times)))
    time = np.arange(float(sample_times[0]), end + _AFTER, step)
    speed = np.where(time < 0.0, held, stop.speed_at(np.maximum(time, 0.0)))
    along = np.interp(np.maximum(time, 0.0), stop.time, stop.station)
    grade = np.interp(along, track.station, track.grade)
    slope = model.braking.m_m * held + model.braking.b_m
    return stop, fit_knee(time, speed, grade, end, slope, record.knee.held_weight)


def _line(model: Model, record: StopRecord, force: float) -> tuple[float, float]:
    """b_m, b_b such that the force at the stop's own speed and mean grade is this one.

    The form that the coefficients take does not matter: only one speed is simulated.
    """
    slope = model.braking.m_m * record.onset_speed + model.braking.b_m
    return slope, max(force - slope * record.grade, _MIN_FORCE)


def _by_effects(
    model: Model, record: StopRecord, force: float, dead: float, stop: SimulatedStop
) -> float:
    """By how much the effects make the stop longer, at the same coefficients [m]."""
    slope, intercept = _line(model, record, force)
    level_law = np.array([0.0, slope, 0.0, intercept])
    plain = stopping_distance(record.samples.window.held_speed, dead, level_law, *record.path)
    longer = stop.distance - plain
    return longer if math.isfinite(longer) else 0.0
