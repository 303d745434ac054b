"""Vehicles with brakes of eight kinds, integrated in time; nothing is shared with the models.

dv/dt = −g (F(v, t) + sin θ) from the onset on, in steps of 5 ms, for all stops together.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slopewise.models.arrays import Floats, Ints

_HYDRAULIC = ("rare weak states", "cycling", "slow hydraulics")
_SLOW = ("soft ground", "sessions 10 % apart")
KINDS = ("as the law", "force falls with speed", "pads fade", *_HYDRAULIC, *_SLOW)
Random = np.random.Generator
_G, _STEP = 9.80665, 0.005  # [m/s²], [s]
_LEAD, _TAIL, _HZ = 0.8, 0.5, 50.0  # [s], [s], [Hz] of logs
_LONGEST = 8.0  # [s]
_GRADE = 0.15  # [rad]
_CONDITIONS, _REPEATS = 150, 3000  # at which the true quantiles are drawn


class StopLog(NamedTuple):
    """A drive log, and its stops: speed [m/s], grade [rad], distance [m], session (n,)."""

    columns: dict[str, NDArray[Any]]
    runs: list[slice]
    ground: Floats
    speed: Floats
    grade: Floats
    distance: Floats
    session: Ints


@dataclass(frozen=True, slots=True)
class BrakeVehicle:
    """True parameters of the brakes."""

    kind: str
    force: float  # F_b/W [1]
    change: float  # relative change of the force over all speeds [1]
    grade: float  # answer to the sine of the grade [1]
    dead_time: float  # [s]
    late: float  # standard deviation of it [s]
    fastest: float  # [m/s]
    scatter: float  # of the force from stop to stop, Student's t with 8 degrees of freedom [1]
    session: float  # standard deviation of the logarithm of the force between sessions [1]
    strength: float  # of what makes the kind [1]

    @classmethod
    def generate(cls, number: int) -> BrakeVehicle:
        """Vehicle of a number; kinds take turns."""
        rng, kind = np.random.default_rng([7919, number]), KINDS[number % len(KINDS)]
        session = 0.10 if kind == KINDS[-1] else float(rng.uniform(0.0, 0.06))
        low = (0.3, -0.2, -0.2, 0.1, 0.0, 2.0, 0.01)
        high = (0.7, 0.1, 0.2, 0.5, 0.03, 7.0, 0.05)
        force, change, grade, dead_time, late, fastest, scatter = rng.uniform(low, high).tolist()
        strength = float(rng.uniform(0.15, 0.4))
        return cls(kind, force, change, grade, dead_time, late, fastest, scatter, session, strength)


def drive_log(vehicle: BrakeVehicle, stops: int, sessions: int, rng: Random) -> StopLog:
    """Stops one after the other, sessions in turns; speed noise 2 cm/s."""
    session = np.sort(np.arange(stops) % sessions)
    day = vehicle.session * rng.standard_normal(sessions)
    return _log_of(vehicle, session, day[session], rng)


def stream_log(vehicle: BrakeVehicle, stops: int, change: int, loss: float, rng: Random) -> StopLog:
    """Stops of one session; after ``change`` of them a share of the force is lost."""
    day = vehicle.session * float(rng.standard_normal())
    later = np.arange(stops) >= change
    strength = day + np.where(later, np.log(1.0 - loss), 0.0)
    return _log_of(vehicle, np.zeros(stops, np.int64), strength, rng)


def _log_of(vehicle: BrakeVehicle, session: Ints, strength: Floats, rng: Random) -> StopLog:
    """Log of stops (n,) by session and logarithm of the strength of the brakes."""
    stops = len(session)
    speed, grade = _conditions(vehicle, stops, rng)
    trace, distance = _integrated(vehicle, speed, grade, strength, rng)
    parts: dict[str, list[NDArray[Any]]] = {}
    runs, begin, clock = [], 0, 0.0
    fine = _STEP * np.arange(trace.shape[1])
    for i in range(stops):
        end = float(fine[np.argmax(trace[i] <= 0.0)]) + _TAIL
        t = np.arange(-_LEAD + float(rng.uniform(0.0, 1.0 / _HZ)), end, 1.0 / _HZ)
        v = np.interp(np.maximum(t, 0.0), fine, trace[i])
        row: dict[str, NDArray[Any]] = {
            "run": np.full(len(t), f"stop {i}"),
            "session": np.full(len(t), f"day {session[i]}"),
            "t": clock + t,
            "v": v + 0.02 * rng.standard_normal(len(t)),
            "v_cmd": np.where(t < 0.0, speed[i], 0.0),
            "pitch": np.full(len(t), -grade[i]),
        }
        for name, values in row.items():
            parts.setdefault(name, []).append(values)
        runs.append(slice(begin, begin + len(t)))
        begin, clock = begin + len(t), clock + end + 20.0
    columns = {name: np.concatenate(values) for name, values in parts.items()}
    return StopLog(columns, runs, -columns["pitch"], speed, grade, distance, session)


def fresh_stops(vehicle: BrakeVehicle, count: int, rng: Random) -> tuple[Floats, Floats, Floats]:
    """Speed [m/s], grade [rad] and distance [m] of stops, each in another session."""
    speed, grade = _conditions(vehicle, count, rng)
    day = vehicle.session * rng.standard_normal(count)
    return speed, grade, _integrated(vehicle, speed, grade, day, rng)[1]


def true_quantiles(
    vehicle: BrakeVehicle, speed: Floats, grade: Floats, q: tuple[float, ...], rng: Random
) -> Floats:
    """(Q, k) quantiles of the distance at the first of the conditions [m]."""
    v, theta = (np.repeat(a[:_CONDITIONS], _REPEATS) for a in (speed, grade))
    day = vehicle.session * rng.standard_normal(len(v))
    distances = _integrated(vehicle, v, theta, day, rng)[1].reshape(-1, _REPEATS)
    return np.asarray(np.quantile(distances, q, axis=1))


def _conditions(vehicle: BrakeVehicle, count: int, rng: Random) -> tuple[Floats, Floats]:
    speed = rng.uniform(0.25 * vehicle.fastest, vehicle.fastest, count)
    return speed, rng.uniform(-_GRADE, _GRADE, count)


def _integrated(
    vehicle: BrakeVehicle, speed: Floats, grade: Floats, day: Floats, rng: Random
) -> tuple[Floats, Floats]:
    """Speed (n, steps) [m/s], empty for many stops, and distance (n,) [m]."""
    n, kind, p = len(speed), vehicle.kind, vehicle.strength
    strength = np.exp(day) * (1.0 + vehicle.scatter * np.clip(rng.standard_t(8.0, n), -8.0, 8.0))
    if kind == "pads fade":
        strength = strength * (1.0 - p * rng.beta(1.0, 4.0, n))
    if kind == "rare weak states":
        strength = np.where(rng.random(n) < 0.03, strength * (1.0 - p), strength)
    phase = rng.uniform(0.0, 2.0 * np.pi, n)
    delay = np.maximum(vehicle.dead_time + vehicle.late * rng.standard_normal(n), 0.02)
    v, distance, t = speed.copy(), np.zeros(n), 0.0
    traced = [v.copy()] if n < 1000 else []
    while t < _LONGEST and (v > 0.0).any():
        relative = v / vehicle.fastest
        force = vehicle.force * (1.0 + vehicle.change * (speed / vehicle.fastest - 0.5))
        if kind == "force falls with speed":
            force = force * (1.0 - 0.6 * p * relative**2)
        if kind == "cycling":
            force = force * (1.0 + 0.3 * p * np.sin(2.0 * np.pi * 4.0 * t + phase))
        if kind == "slow hydraulics":
            force = force * (1.0 - np.exp(-np.maximum(t - delay, 0.0) / (0.6 * p)))
        if kind == "soft ground":
            force = force + 0.3 * p * np.exp(-2.0 * relative)
        pull = strength * force + (1.0 + vehicle.grade) * np.sin(grade)
        slower = np.where(t >= delay, v - _G * np.maximum(pull, 0.03) * _STEP, v)
        # The last step ends where the vehicle stands.
        share = np.where(slower < 0.0, v / np.maximum(v - slower, 1e-12), 1.0)
        distance += share * 0.5 * (v + np.maximum(slower, 0.0)) * _STEP
        v, t = np.maximum(slower, 0.0), t + _STEP
        if traced:
            traced.append(v.copy())
    return np.array(traced).T if traced else np.empty((n, 0)), distance
