"""A vehicle on springs, integrated by scipy; nothing here comes from the project.

The wheels carry a body that pitches about them: a body of height h above its pitch axis lags behind
the wheels by h times its pitch rate, nose down positive. What a wheel sensor reads is then
v_body − h · pitch rate.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

G = 9.80665


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


def stop(plant: Sprung, speed: float, grade: float, error: float) -> dict[str, np.ndarray]:
    """One stop, 1.5 s of driving before it and 1.5 s of rest after it; time since the command."""
    p = plant
    force = (p.m_m * speed + p.b_m) * grade + p.m_b * speed + p.b_b + error
    stiffness = (2.0 * np.pi * p.frequency) ** 2

    def rates(t: float, y: np.ndarray, braking: bool) -> list[float]:
        _, lean, rate, built = y
        asked = force if braking else 0.0
        acting = built if p.lag > 0.0 else asked
        # At even speed and at rest the body feels the slope, under brakes their force.
        felt = G * acting if braking else -G * np.sin(grade)
        slowing = G * (acting + np.sin(grade)) if braking else 0.0
        turn = stiffness * (p.dive * felt - lean) - 4.0 * np.pi * p.damping * p.frequency * rate
        growth = (asked - built) / p.lag if p.lag > 0.0 else 0.0
        return [-slowing, rate, turn, growth]

    fall = _fall(rates, p.dead_time, np.array([speed, -p.dive * G * np.sin(grade), 0.0, 0.0]))
    end = fall.t[-1]
    rest = solve_ivp(
        lambda t, y: rates(t, y, False),
        (end, end + 1.6),
        [0.0, *fall.y[1:3, -1], 0.0],
        rtol=1e-8,
        atol=1e-10,
        dense_output=True,
    )
    time = np.arange(-1.5, end + 1.5, 1.0 / p.hz)
    v, lean, rate = np.zeros((3, len(time)))
    lean -= p.dive * G * np.sin(grade)
    for k, t in enumerate(time):
        if t < p.dead_time:
            v[k] = speed
        elif t < end:
            v[k], lean[k], rate[k] = fall.sol(t)[:3]
        else:
            _, lean[k], rate[k] = rest.sol(t)[:3]
    return {
        "time": time,
        "v": np.where(time < end, v - p.height * rate, 0.0),
        "pitch": lean - grade,
        "pitch_rate": rate,
        "command": np.where(time < -1e-9, speed, 0.0),
    }


def _fall(rates, begin, state):
    def at_rest(t, y):
        return y[0]

    at_rest.terminal = True
    return solve_ivp(
        lambda t, y: rates(t, y, True),
        (begin, 60.0),
        state,
        events=at_rest,
        rtol=1e-8,
        atol=1e-10,
        max_step=0.01,
        dense_output=True,
    )


def drive(
    plant: Sprung, count: int, seed: int, *, gyro: bool = False
) -> tuple[dict[str, np.ndarray], list[slice]]:
    """A drive log of stops, one run each; with the pitch rate of a gyro, if asked for."""
    rng = np.random.default_rng(seed)
    parts: dict[str, list[np.ndarray]] = {}
    runs, begin, clock = [], 0, 0.0
    for i in range(count):
        speed, grade = rng.uniform(1.0, 4.0), rng.uniform(-0.2, 0.2)
        one = stop(plant, speed, grade, plant.scatter * rng.standard_normal())
        n = len(one["time"])
        rows = {
            "run": np.full(n, str(i)),
            "t": clock + 1.5 + one["time"],
            "v": one["v"] + plant.speed_noise * rng.standard_normal(n),
            "v_cmd": one["command"],
            "pitch": one["pitch"] + plant.pitch_noise * rng.standard_normal(n),
        }
        if gyro:
            rows["pitch_rate"] = one["pitch_rate"] + 0.005 * rng.standard_normal(n)
        for name, values in rows.items():
            parts.setdefault(name, []).append(values)
        runs.append(slice(begin, begin + n))
        begin, clock = begin + n, clock + n / plant.hz + 5.0
    return {name: np.concatenate(values) for name, values in parts.items()}, runs
