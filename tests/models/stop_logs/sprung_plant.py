"""A vehicle on springs, integrated by scipy; nothing here comes from the project.

The wheels carry a body that pitches about them: a body of height h above its pitch axis lags behind
the wheels by h times its pitch rate, nose down positive. What a wheel sensor reads is then
v_body − h · pitch rate.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

G = 9.80665

Rates = Callable[[float, np.ndarray, bool], list[float]]


@dataclass(frozen=True)
class Sprung:
    """True values; dive in rad s²/m, height in m, frequency in Hz, noises in m/s and rad."""

    m_m: float = -0.03
    b_m: float = -0.05
    m_b: float = 0.015
    b_b: float = 0.40
    dead_time: float = 0.3
    dive: float = 0.006
    height: float = 0.8
    frequency: float = 1.6
    damping: float = 0.3
    speed_noise: float = 0.015
    pitch_noise: float = 0.004
    scatter: float = 0.004
    lag: float = 0.0
    hz: float = 50.0


def _rates(p: Sprung, force: float, grade: float) -> Rates:
    """Derivatives of speed, pitch of the body, its rate, and the force that has built up."""
    stiffness = (2.0 * np.pi * p.frequency) ** 2

    def rates(_: float, y: np.ndarray, braking: bool) -> list[float]:
        _, pitch, rate, built = y
        asked = force if braking else 0.0
        acting = built if p.lag > 0.0 else asked
        # At even speed and at rest the body feels the slope, under brakes their force.
        felt = G * acting if braking else -G * np.sin(grade)
        slowing = G * (acting + np.sin(grade)) if braking else 0.0
        turn = stiffness * (p.dive * felt - pitch) - 4.0 * np.pi * p.damping * p.frequency * rate
        growth = (asked - built) / p.lag if p.lag > 0.0 else 0.0
        return [-slowing, rate, turn, growth]

    return rates


def stop(plant: Sprung, speed: float, grade: float, error: float) -> dict[str, np.ndarray]:
    """One stop, 1.5 s of driving before it and 1.5 s of rest after it; time since the command."""
    p = plant
    force = (p.m_m * speed + p.b_m) * grade + p.m_b * speed + p.b_b + error
    rates = _rates(p, force, grade)

    def at_rest(_: float, y: np.ndarray, braking: bool) -> float:
        return float(y[0]) if braking else 1.0

    at_rest.terminal = True  # type: ignore[attr-defined]
    accuracy = {"rtol": 1e-7, "atol": 1e-9, "events": at_rest, "dense_output": True}
    pitch_at_rest = -p.dive * G * np.sin(grade)
    begin = p.dead_time
    fall = solve_ivp(
        rates,
        (begin, 60.0),
        [speed, pitch_at_rest, 0.0, 0.0],
        args=(True,),
        max_step=0.05,
        **accuracy,
    )
    end = float(fall.t[-1])
    rest = solve_ivp(
        rates, (end, end + 1.6), [0.0, *fall.y[1:3, -1], 0.0], args=(False,), **accuracy
    )
    time = np.arange(-1.5, end + 1.5, 1.0 / p.hz)
    v, pitch, rate = (
        np.full(len(time), speed),
        np.full(len(time), pitch_at_rest),
        np.zeros(len(time)),
    )
    is_falling, is_at_rest = (time >= begin) & (time < end), time >= end
    v[is_falling], pitch[is_falling], rate[is_falling] = fall.sol(time[is_falling])[:3]
    v[is_at_rest], pitch[is_at_rest], rate[is_at_rest] = rest.sol(time[is_at_rest])[:3]
    return {
        "time": time,
        "v": np.where(is_at_rest, 0.0, v - p.height * rate),
        "pitch": pitch - grade,
        "pitch_rate": rate,
        "command": np.where(time < -1e-9, speed, 0.0),
    }


def drive(
    plant: Sprung, count: int, seed: int, *, gyro: bool = False
) -> tuple[dict[str, np.ndarray], list[slice]]:
    """A drive log of stops, one run each; with the pitch rate of a gyro, if asked for."""
    rng = np.random.default_rng(seed)
    parts: dict[str, list[np.ndarray]] = {}
    runs, begin, clock = [], 0, 0.0
    for i in range(count):
        speed, grade = rng.uniform(1.0, 4.0), rng.uniform(-0.2, 0.2)
        samples = stop(plant, speed, grade, plant.scatter * rng.standard_normal())
        n = len(samples["time"])
        rows = {
            "run": np.full(n, str(i)),
            "t": clock + 1.5 + samples["time"],
            "v": samples["v"] + plant.speed_noise * rng.standard_normal(n),
            "v_cmd": samples["command"],
            "pitch": samples["pitch"] + plant.pitch_noise * rng.standard_normal(n),
        }
        if gyro:
            rows["pitch_rate"] = samples["pitch_rate"] + 0.005 * rng.standard_normal(n)
        for name, values in rows.items():
            parts.setdefault(name, []).append(values)
        runs.append(slice(begin, begin + n))
        begin, clock = begin + n, clock + n / plant.hz + 5.0
    return {name: np.concatenate(values) for name, values in parts.items()}, runs
