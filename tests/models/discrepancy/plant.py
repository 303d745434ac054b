"""A vehicle with hidden effects, made of nothing that the project computes with.

Stops are integrated in steps of two milliseconds, one after the other: brake heat lasts from
stop to stop. Effects are those of :mod:`tests.models.effects.formulas`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import hypot

import numpy as np

from tests.models.effects.formulas import DECELERATION, FORCE, FORMULAS, Moment

G = 9.80665
STEP = 0.002  # [s]
LEAD, TAIL = 1.0, 0.8  # [s]

Effects = dict[str, dict[str, float]]


@dataclass(frozen=True)
class World:
    """True values. Angles in rad, noise in m/s, scatter as a share of the force.

    The grade waves along each stop. Further places (x, y, radius) have the surface of the patch.
    """

    effects: Effects = field(default_factory=dict)
    coefficients: tuple[float, float, float, float] = (-0.03, -0.35, 0.015, 0.40)
    dead_time: float = 0.3
    noise: float = 0.03
    scatter: float = 0.02
    pitch_noise: float = np.deg2rad(0.2)
    pitch_bias: float = 0.0
    hz: float = 50.0
    speeds: tuple[float, float] = (1.0, 4.0)
    grades: tuple[float, float] = (-0.22, 0.22)
    one_way: bool = False
    quantum: float = 0.0
    waves: float = 0.02
    has_curvature: bool = False
    further_places: tuple[tuple[float, float, float], ...] = ()
    off_library: str = ""
    size: float = 0.0


def drive(world: World, stops: int, seed: int) -> tuple[dict[str, np.ndarray], list[slice]]:
    """A drive log, one run a stop."""
    rng = np.random.default_rng(seed)
    speed = rng.uniform(*world.speeds, stops)
    base = rng.uniform(*world.grades, stops)
    wave, phase = rng.uniform(8.0, 16.0, stops), rng.uniform(0.0, 2 * np.pi, stops)
    yaw0 = np.full(stops, 0.4) if world.one_way else rng.uniform(-np.pi, np.pi, stops)
    yaw0 = yaw0 + 0.02 * rng.standard_normal(stops)
    rate = np.where(rng.random(stops) < 0.4, rng.uniform(-0.6, 0.6, stops), 0.0)
    roll = rng.uniform(-0.15, 0.15, stops)
    # Ground that fits no map must not be driven twice at one place.
    field = 40.0 if "surface_patch" in world.effects else 400.0
    x0, y0 = rng.uniform(0.0, field, (2, stops))
    pause = rng.uniform(4.0, 40.0, stops)
    friction = 1.0 + world.scatter * rng.standard_normal(stops)
    ambient = 20.0 + 8.0 * np.sin(np.arange(stops) / 7.0) + rng.standard_normal(stops)
    heat, clock = 0.0, 0.0
    columns: dict[str, list[np.ndarray]] = {}
    runs, begin = [], 0
    e = world.effects
    fade = e.get("brake_fade")
    for i in range(stops):
        clock += pause[i]
        if fade:
            heat *= np.exp(-pause[i] / fade["tau"])
        k = world.coefficients

        def ground(s: float, i: int = i) -> float:
            return base[i] + world.waves * np.sin(2 * np.pi * s / wave[i] + phase[i])

        def vertical_curvature(s: float, i: int = i) -> float:
            turns = 2 * np.pi / wave[i]
            return world.waves * turns * np.cos(turns * s + phase[i])

        v, s, t, force, x, y, yaw = speed[i], 0.0, -LEAD, 0.0, x0[i], y0[i], yaw0[i]
        rows, done, command_time = [], np.nan, clock + LEAD
        count = 0
        every = round(1.0 / (world.hz * STEP))
        while np.isnan(done) or t < done + TAIL:
            theta = ground(s)
            if count % every == 0:
                rock = (
                    0.0
                    if np.isnan(done)
                    else -0.05 * np.exp(-(t - done) / 0.1) * np.sin((t - done) / 0.04)
                )
                rows.append(
                    (t, v + rock, theta, x, y, yaw, rate[i] * (v > 0), vertical_curvature(s))
                )
            share = float(np.clip((t + STEP - world.dead_time) / STEP, 0.0, 1.0))
            if share > 0.0 and np.isnan(done):
                m = Moment(
                    grade=theta,
                    roll=roll[i],
                    yaw=yaw,
                    x=x,
                    y=y,
                    curvature=rate[i] / v,
                    vertical_curvature=vertical_curvature(s),
                    speed=v,
                    session_time=command_time,
                    heat=heat,
                )
                demanded = (k[0] * speed[i] + k[1]) * theta + k[2] * speed[i] + k[3]
                if "step_change" in e and i >= e["step_change"]["run"]:
                    demanded = FORMULAS["step_change"](e["step_change"], Moment(force=demanded))
                demanded += sum(FORCE[name](e[name], m) for name in e if name in FORCE)
                if "surface_patch" in e and not FORCE["surface_patch"](e["surface_patch"], m):
                    p = e["surface_patch"]
                    there = any(hypot(x - px, y - py) <= r for px, py, r in world.further_places)
                    demanded += p["delta"] * there
                if world.off_library == "periodic":
                    demanded += world.size * np.sin(2 * np.pi * x / 9.0)
                if world.off_library == "ambient":
                    demanded += world.size * (ambient[i] - 20.0) / 8.0
                if world.off_library == "heading":
                    demanded += world.size * np.cos(yaw - 0.7)
                if world.off_library == "roll_sign":
                    demanded += world.size * roll[i] / 0.15
                if world.off_library == "alternating":
                    demanded += world.size * (1.0 if (i // 5) % 2 else -1.0)
                if world.off_library == "low_speed":
                    demanded += world.size * np.exp(-v / 0.4)
                demanded *= friction[i]
                if "brake_lag" in e:
                    force += (demanded - force) * -np.expm1(-share * STEP / e["brake_lag"]["tau"])
                else:
                    force = demanded
                given = force
                if fade:
                    given *= FORMULAS["brake_fade"](fade, m)
                if "wheel_lockup" in e:
                    given = min(given, FORMULAS["wheel_lockup"](e["wheel_lockup"], m))
                if "crest_unloading" in e:
                    given *= FORMULAS["crest_unloading"](e["crest_unloading"], m)
                a = G * (given + np.sin(theta))
                a += sum(DECELERATION[name](e[name], m) for name in e if name in DECELERATION)
                if fade:
                    heat += STEP * (share * G * given * v - heat / fade["tau"])
                a *= share
                if v - STEP * a <= 0.0:
                    done = t + v / max(a, 1e-9)
                    s += 0.5 * v * (done - t)
                    v = 0.0
                else:
                    s += STEP * (v - 0.5 * STEP * a)
                    v -= STEP * a
            elif np.isnan(done):
                s += STEP * v
            elif fade:
                heat -= STEP * heat / fade["tau"]
            x, y = x + STEP * v * np.cos(yaw), y + STEP * v * np.sin(yaw)
            yaw += STEP * rate[i] * (v > 0.0)
            t += STEP
            count += 1
        table = np.array(rows).T
        n = table.shape[1]
        measured = table[1] + world.noise * rng.standard_normal(n)
        if world.quantum:
            measured = world.quantum * np.round(measured / world.quantum)
        row = {
            "run": np.full(n, str(i)),
            "t": command_time + table[0],
            "v": measured,
            "v_cmd": np.where(table[0] < -1e-9, speed[i], 0.0),
            "pitch": -table[2] + world.pitch_bias + world.pitch_noise * rng.standard_normal(n),
            "roll": roll[i] + world.pitch_noise * rng.standard_normal(n),
            "yaw": table[5],
            "yaw_rate": table[6] + 0.01 * rng.standard_normal(n),
            "x": table[3],
            "y": table[4],
            "ambient": np.full(n, ambient[i]),
        }
        if world.has_curvature:
            row["vertical_curvature"] = table[7] + 0.002 * rng.standard_normal(n)
        for name, values in row.items():
            columns.setdefault(name, []).append(values)
        runs.append(slice(begin, begin + n))
        begin += n
        clock = command_time + float(table[0, -1])
    return {name: np.concatenate(parts) for name, parts in columns.items()}, runs
