"""Swerves at speed, then no inputs: an obstacle is next to the arc of the last command.

A base at speed is commanded to turn, and nothing reaches the guard any more. It follows late, then
brakes, and may straighten its wheels: its body leaves the arc of the command. A run of the same
base without a guard shows where; an obstacle is put there.
"""

from __future__ import annotations

import math
from copy import copy
from typing import NamedTuple

import numpy as np

from slopewise.models.parameters import Model

from .moving_base import MovingBase

_STEP = 0.02  # of the run without a guard [s]
_REACTION = 0.2  # from the cut to the stop command, as the guard's settings have it [s]
_AWAY = 7.0  # start from the middle of the map [m]
_TRIES = 100  # places that are tried for an obstacle [1]


class Swerve(NamedTuple):
    """Commands, and the moment when the feeds end."""

    speed: float  # [m/s]
    rates: tuple[float, float]  # yaw rate before and in the swerve [rad/s]
    turns_at: float  # turns_at, cut: start of the swerve, end of the feeds [s]
    cut: float

    def command(self, now: float, _base: MovingBase | None = None) -> tuple[float, float]:
        """Speed [m/s] and yaw rate [rad/s]."""
        return self.speed, self.rates[int(now >= self.turns_at)]


def draw_swerve(rng: np.random.Generator, base: MovingBase, model: Model, edge: float) -> Swerve:
    """Draw a swerve, and move the base so that it begins near the middle of the map."""
    base.x = 0.5 * edge - _AWAY * math.cos(base.heading)
    base.y = 0.5 * edge - _AWAY * math.sin(base.heading)
    base.response = float(rng.uniform(0.1, 0.25))
    base.straightens_after = float(rng.uniform(0.0, 0.5 * base.dead_time))
    speed = min(model.limits.speed, 5.0) * float(rng.uniform(0.6, 1.0))
    side, lateral = float(rng.choice([-1.0, 1.0])), model.limits.lateral_accel
    before = float(rng.choice([0.0, rng.uniform(-0.1, 0.1)]))
    rate = side * float(rng.uniform(0.7, 1.0)) * lateral / speed
    turns_at = speed / base.accel + float(rng.uniform(0.2, 0.8))
    return Swerve(speed, (before, rate), turns_at, turns_at + float(rng.uniform(0.05, 0.3)))


def run_without_guard(base: MovingBase, swerve: Swerve, *, brakes: bool) -> list[MovingBase]:
    """States until the base is at rest; without ``brakes`` on the command's arc."""
    base, states, now = copy(base), [], 0.0
    while now < swerve.cut + 5.0 and (now < swerve.cut or base.contact_speed() > 0.0):
        if now < swerve.cut + _REACTION or not brakes:
            base.receive(*swerve.command(now), False, now)
        else:
            base.receive(0.0, 0.0, True, now)
        if not brakes and now >= swerve.turns_at:
            base.yaw_rate = swerve.rates[1] * base.speed / swerve.speed
            if now >= swerve.turns_at + 2.0:
                break
        base.step(now, _STEP)
        states.append(copy(base))
        now += _STEP
    return states


def obstacle_off_arc(
    rng: np.random.Generator, base: MovingBase, swerve: Swerve
) -> tuple[float, float, float]:
    """x, y and radius of a disc that the stopping body meets next to the arc of the command [m]."""
    stopping, on_arc = (run_without_guard(base, swerve, brakes=b) for b in (True, False))
    begun, cut = round(swerve.turns_at / _STEP), round(swerve.cut / _STEP)
    shape, place = base.vehicle.shape, (0.0, 0.0, 0.1)
    for _ in range(_TRIES):
        at = stopping[int(rng.integers(cut, max(len(stopping) - 5, cut + 1)))]
        radius, side = float(rng.uniform(0.08, 0.3)), float(rng.choice([-1.0, 1.0]))
        ahead = float(rng.uniform(-shape.rear, shape.front))
        left = side * (0.5 * shape.width + radius - float(rng.uniform(0.02, 0.2)))
        cos, sin = math.cos(at.heading), math.sin(at.heading)
        place = at.x + ahead * cos - left * sin, at.y + ahead * sin + left * cos, radius
        disc = tuple(np.array([value]) for value in place)
        if not any(state.overlaps(*disc)[0] for state in (*stopping[:begun], *on_arc)):
            break
    return place
