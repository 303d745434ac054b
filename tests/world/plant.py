"""A vehicle with hidden effects, made of nothing that the project computes with.

Stops are integrated in steps of two milliseconds, one after the other: brake heat lasts from
stop to stop. Effects are those of :mod:`tests.world.formulas`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import cos, exp, expm1, hypot, nan, pi, sin

import numpy as np

from tests.world.formulas import DECELERATION, FORCE, FORMULAS, G, Moment

STEP = 0.002  # [s]
LEAD, TAIL = 1.0, 0.8  # [s]
EVERY = 10
"""Steps between two samples of 50 Hz."""

Effects = dict[str, dict[str, float]]
Row = tuple[float, ...]


@dataclass(frozen=True)
class World:
    """True values. Angles in rad, noise in m/s, scatter as a share of the force.

    The grade waves along each stop. Further places (x, y, radius) have the surface of the patch.
    What 8 °C of ambient temperature add to F_b/W is in no library.
    """

    effects: Effects = field(default_factory=dict)
    coefficients: tuple[float, float, float, float] = (-0.03, -0.35, 0.015, 0.40)
    dead_time: float = 0.3
    noise: float = 0.03
    scatter: float = 0.02
    pitch_noise: float = np.deg2rad(0.2)
    pitch_bias: float = 0.0
    speeds: tuple[float, float] = (1.0, 4.0)
    grades: tuple[float, float] = (-0.22, 0.22)
    waves: float = 0.02
    has_curvature: bool = False
    further_places: tuple[tuple[float, float, float], ...] = ()
    ambient: float = 0.0
    turning: float = 0.4
    """Share of the stops."""


@dataclass
class Stop:
    """One stop: what is drawn for it, and the state of the vehicle."""

    world: World
    number: int
    command_time: float
    heat: float
    speed: float
    base: float
    wave: float
    phase: float
    yaw: float
    rate: float
    roll: float
    x: float
    y: float
    friction: float
    ambient: float

    def grade(self, s: float) -> float:
        return self.base + self.world.waves * sin(2 * pi * s / self.wave + self.phase)

    def vertical_curvature(self, s: float) -> float:
        turns = 2 * pi / self.wave
        return self.world.waves * turns * cos(turns * s + self.phase)

    def moment(self, s: float, v: float) -> Moment:
        return Moment(
            grade=self.grade(s),
            roll=self.roll,
            yaw=self.yaw,
            x=self.x,
            y=self.y,
            curvature=self.rate / v,
            vertical_curvature=self.vertical_curvature(s),
            speed=v,
            session_time=self.command_time,
            heat=self.heat,
        )

    def demanded(self, m: Moment) -> float:
        """F_b/W that the brakes are asked for."""
        e, k = self.world.effects, self.world.coefficients
        force = (k[0] * self.speed + k[1]) * m.grade + k[2] * self.speed + k[3]
        step, patch = e.get("step_change"), e.get("surface_patch")
        if step and self.number >= step["run"]:
            force = FORMULAS["step_change"](step, Moment(force=force))
        force += sum(FORCE[name](e[name], m) for name in e if name in FORCE)
        if patch and not FORCE["surface_patch"](patch, m):
            places = self.world.further_places
            force += patch["delta"] * any(hypot(m.x - x, m.y - y) <= r for x, y, r in places)
        return (force + self.world.ambient * (self.ambient - 20.0) / 8.0) * self.friction

    def given(self, force: float, m: Moment) -> float:
        """Share of it that fade, slippery ground and crests leave."""
        e = self.world.effects
        if "brake_fade" in e:
            force *= FORMULAS["brake_fade"](e["brake_fade"], m)
        if "wheel_lockup" in e:
            force = min(force, FORMULAS["wheel_lockup"](e["wheel_lockup"], m))
        if "crest_unloading" in e:
            force *= FORMULAS["crest_unloading"](e["crest_unloading"], m)
        return force

    def drive(self) -> list[Row]:
        """Samples of time, speed, grade, place, yaw, yaw rate and vertical curvature."""
        e, rows = self.world.effects, []
        lag, fade = e.get("brake_lag"), e.get("brake_fade")
        v, s, t, force, done, count = self.speed, 0.0, -LEAD, 0.0, nan, 0
        while done != done or t < done + TAIL:
            if count % EVERY == 0:
                since = t - done
                rock = 0.0 if done != done else -0.05 * exp(-since / 0.1) * sin(since / 0.04)
                turn = self.rate * (v > 0)
                place = self.x, self.y, self.yaw, turn, self.vertical_curvature(s)
                rows.append((t, v + rock, self.grade(s), *place))
            share = min(max((t + STEP - self.world.dead_time) / STEP, 0.0), 1.0)
            if done == done:
                if fade:
                    self.heat -= STEP * self.heat / fade["tau"]
            elif share > 0.0:
                m = self.moment(s, v)
                demanded = self.demanded(m)
                gained = -expm1(-share * STEP / lag["tau"]) if lag else 1.0
                force += (demanded - force) * gained
                given = self.given(force, m)
                a = G * (given + sin(m.grade))
                a += sum(DECELERATION[name](e[name], m) for name in e if name in DECELERATION)
                if fade:
                    self.heat += STEP * (share * G * given * v - self.heat / fade["tau"])
                a *= share
                if v - STEP * a <= 0.0:
                    done = t + v / max(a, 1e-9)
                    s += 0.5 * v * (done - t)
                    v = 0.0
                else:
                    s += STEP * (v - 0.5 * STEP * a)
                    v -= STEP * a
            else:
                s += STEP * v
            self.x += STEP * v * cos(self.yaw)
            self.y += STEP * v * sin(self.yaw)
            self.yaw += STEP * self.rate * (v > 0.0)
            t += STEP
            count += 1
        return rows


def drive(world: World, stops: int, seed: int) -> tuple[dict[str, np.ndarray], list[slice]]:
    """A drive log, one run a stop."""
    rng = np.random.default_rng(seed)
    speed, base = rng.uniform(*world.speeds, stops), rng.uniform(*world.grades, stops)
    wave, phase = rng.uniform(8.0, 16.0, stops), rng.uniform(0.0, 2 * np.pi, stops)
    yaw = rng.uniform(-np.pi, np.pi, stops) + 0.02 * rng.standard_normal(stops)
    rate = np.where(rng.random(stops) < world.turning, rng.uniform(-0.6, 0.6, stops), 0.0)
    roll = rng.uniform(-0.15, 0.15, stops)
    # Ground that fits no map must not be driven twice at one place.
    side = 40.0 if "surface_patch" in world.effects else 400.0
    x, y = rng.uniform(0.0, side, (2, stops))
    pause = rng.uniform(4.0, 40.0, stops)
    friction = 1.0 + world.scatter * rng.standard_normal(stops)
    ambient = 20.0 + 8.0 * np.sin(np.arange(stops) / 7.0) + rng.standard_normal(stops)
    numbers = np.stack([speed, base, wave, phase, yaw, rate, roll, x, y, friction, ambient], axis=1)
    heat, clock, begin = 0.0, 0.0, 0
    columns: dict[str, list[np.ndarray]] = {}
    runs = []
    for i, row in enumerate(numbers.tolist()):
        clock += pause[i]
        if "brake_fade" in world.effects:
            heat *= np.exp(-pause[i] / world.effects["brake_fade"]["tau"])
        stop = Stop(world, i, float(clock + LEAD), float(heat), *row)
        table, heat = np.array(stop.drive()).T, stop.heat
        n = table.shape[1]
        log = {
            "run": np.full(n, str(i)),
            "t": stop.command_time + table[0],
            "v": table[1] + world.noise * rng.standard_normal(n),
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
            log["vertical_curvature"] = table[7] + 0.002 * rng.standard_normal(n)
        for name, values in log.items():
            columns.setdefault(name, []).append(values)
        runs.append(slice(begin, begin + n))
        begin, clock = begin + n, stop.command_time + float(table[0, -1])
    return {name: np.concatenate(parts) for name, parts in columns.items()}, runs
