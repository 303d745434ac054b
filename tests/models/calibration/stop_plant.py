"""Stops of uncalibrated vehicles: drive logs, and fresh stops of the same brakes.

Own formulas for stops on even slopes: v − g (F + sin θ) (t − t_d) in the log, and a distance of
v t_d + v² / (2 g (F + sin θ)). Nothing is shared with the models but the form of the law.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slopewise.models.arrays import Floats

G = 9.80665  # [m/s²]
SPEEDS = (1.0, 4.0)  # [m/s]
GRADES = (-0.2, 0.2)  # [rad]
_LEAD, _TAIL, _HZ = 1.2, 0.8, 50.0  # [s], [s], [Hz] of the log


@dataclass(frozen=True, slots=True, kw_only=True)
class PlantVehicle:
    """True parameters of the brakes."""

    name: str  # shown in tables
    stops: int  # number of stops in the log
    # force scatter from stop to stop over the force, over the weight if not `shared`
    scatter: float
    shared: bool = True
    # degrees of Student's t for it, 0 for a normal one; of equal standard deviation
    freedom: float = 0.0
    late: float = 0.0  # standard deviation of the dead time [s]
    weak: float = 0.0  # share of the stops with `ratio` of the force [1]
    ratio: float = 0.7
    # standard deviation of the force from session to session, over the force [1]
    session: float = 0.0
    sessions: int = 1
    level: tuple[float, ...] = ()  # share of the brakes at each stop of the log, full if empty [1]
    rolling: float = 0.0  # resistance that remains when it is smaller [1]
    m_m: float = -0.03
    b_m: float = -0.35
    m_b: float = 0.015
    b_b: float = 0.42
    dead_time: float = 0.3
    speed_noise: float = 0.03

    def forces(self, speed: Floats, grade: Floats, rng: np.random.Generator) -> Floats:
        """F_b/W with scatter of stops from these speeds on these grades, any shape."""
        mean = (self.m_m * speed + self.b_m) * grade + self.m_b * speed + self.b_b
        if self.freedom:
            unit = rng.standard_t(self.freedom, mean.shape)
            unit = unit / np.sqrt(self.freedom / (self.freedom - 2.0))
        else:
            unit = rng.standard_normal(mean.shape)
        weaker = np.where(rng.random(mean.shape) < self.weak, self.ratio, 1.0)
        if self.shared:
            return np.asarray(mean * weaker * (1.0 + self.scatter * unit))
        return np.asarray(mean * weaker + self.scatter * unit)

    def delays(self, count: int | tuple[int, ...], rng: np.random.Generator) -> Floats:
        """Draw dead times [s]."""
        return np.asarray(self.dead_time + self.late * rng.standard_normal(count))


def conditions(count: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Draw speeds [m/s] and grades [rad] of stop commands, shape (count,) each."""
    return rng.uniform(*SPEEDS, count), rng.uniform(*GRADES, count)


def distances(speed: Floats, grade: Floats, force: Floats, delay: Floats) -> Floats:
    """Distance from command to standstill on uniform slopes [m]; inf without standstill."""
    pull = G * (force + np.sin(grade))
    braked = speed**2 / (2.0 * np.where(pull > 0.0, pull, 1.0))
    return np.asarray(speed * delay + np.where(pull > 0.0, braked, np.inf))


def drive_log(
    vehicle: PlantVehicle, rng: np.random.Generator
) -> tuple[dict[str, NDArray[Any]], list[slice], Floats]:
    """A log of the vehicle's stops, its runs, and the grade of the ground, shape (n,) [rad]."""
    speed, grade = conditions(vehicle.stops, rng)
    force = vehicle.forces(speed, grade, rng)
    delay = np.maximum(vehicle.delays(vehicle.stops, rng), 0.02)
    session = np.sort(rng.integers(0, vehicle.sessions, vehicle.stops))
    force = force * (1.0 + vehicle.session * rng.standard_normal(vehicle.sessions))[session]
    if vehicle.level:
        share = np.array(vehicle.level)
        force = vehicle.rolling + share * (force - vehicle.rolling)
    parts: dict[str, list[NDArray[Any]]] = {}
    runs, begin, clock = [], 0, 0.0
    for i in range(vehicle.stops):
        pull = G * (force[i] + np.sin(grade[i]))
        rest = delay[i] + speed[i] / pull
        t = np.arange(-_LEAD + float(rng.uniform(0.0, 1.0 / _HZ)), rest + _TAIL, 1.0 / _HZ)
        v = np.clip(speed[i] - pull * (t - delay[i]), 0.0, speed[i])
        n = len(t)
        row: dict[str, NDArray[Any]] = {
            "run": np.full(n, str(i)),
            "t": clock + t,
            "v": v + vehicle.speed_noise * rng.standard_normal(n),
            "v_cmd": np.where(t < 0.0, speed[i], 0.0),
            "pitch": np.full(n, -grade[i]),
        }
        if vehicle.sessions > 1:
            row["session"] = np.full(n, float(session[i]))
        for name, values in row.items():
            parts.setdefault(name, []).append(values)
        runs.append(slice(begin, begin + n))
        begin, clock = begin + n, clock + float(t[-1]) + 20.0
    columns = {name: np.concatenate(values) for name, values in parts.items()}
    return columns, runs, -columns["pitch"]
