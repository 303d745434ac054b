"""Discs on rolling ground: trees, unknown patches and holes, and their map; swerves at speed.

A swerve ends with no inputs: nothing reaches the guard any more while the base turns at speed. It
follows late, brakes, and may straighten its wheels: its body leaves the arc of the command. A run
of the same base without a guard shows where; an obstacle is put there.
"""

from __future__ import annotations

import math
from copy import copy
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model

from .moving_base import MovingBase, Relief

EDGE = 26.0  # of the map [m]
_HEIGHTS = {"tree": 1.5, "unknown": math.nan, "hole": -0.8}  # of discs above the ground [m]
_NEXT_TO = 0.6  # distance of unknown ground from a turn: two cells and the errors of a pose [m]
_CORRIDOR = 0.3  # free on each side of the run of a swerve that has one obstacle only [m]


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


@dataclass(frozen=True)
class ObstacleWorld:
    """Discs (D,) and the map that shows them."""

    x: np.ndarray
    y: np.ndarray
    radius: np.ndarray
    what: np.ndarray
    ground: ElevationMap

    def hit(self, base: MovingBase) -> str:
        """Obstacle that the body overlaps, or in which a wheel stands."""
        at = self.x, self.y, self.radius
        hit = np.where(self.what == "hole", base.wheels_in(*at), base.overlaps(*at))
        return str(self.what[int(np.argmax(hit))]) if hit.any() else ""


def draw_world(
    rng: np.random.Generator, base: MovingBase, kind: str, swerve: Swerve | None
) -> ObstacleWorld:
    """Discs, none where the base stands; cells of 0.1 or 0.2 m, with a stated noise or exact."""
    count = int(rng.integers(*(3, 20) if kind == "slope" else (20, 100)))
    x, y = rng.uniform(1.0, EDGE - 1.0, (2, count))
    what = rng.choice(["tree", "unknown", "hole"], count, p=(0.7, 0.15, 0.15))
    radius = rng.uniform(np.where(what == "hole", 0.3, 0.08), 0.4)
    if kind == "pivot":
        # Some are where the corners pass.
        near, size = int(rng.integers(1, 6)), base.vehicle.shape
        angle = rng.uniform(0.0, 2.0 * np.pi, near)
        reach = rng.uniform(0.7, 1.2 + max(size.front, size.rear), near)
        x[:near], y[:near] = base.x + reach * np.cos(angle), base.y + reach * np.sin(angle)
        radius[:near] = np.minimum(radius[:near], 0.3)
    free = ~base.overlaps(x, y, radius + float(rng.uniform(0.02, 0.3)))
    if kind == "pivot":
        # A turn on the spot may enter unknown ground that is next to the body, by a cell.
        free &= (what != "unknown") | ~base.overlaps(x, y, radius + _NEXT_TO)
    if swerve is not None:
        for state in run_without_guard(base, swerve, brakes=True)[::5]:
            free &= ~state.overlaps(x, y, radius + _CORRIDOR)
        x[0], y[0], radius[0] = obstacle_off_arc(rng, base, swerve)
        what[0], free[0] = "tree", True
    discs = x[free], y[free], radius[free], what[free]
    cell, noise = rng.choice([0.1, 0.2], p=(0.75, 0.25)), 0.0
    if cell <= base.vehicle.wheel_radius and rng.random() < 0.25:
        noise = float(rng.uniform(0.005, 0.03))
    z = _heights(base.relief, float(cell), *discs)
    z += noise * rng.standard_normal(z.shape)
    ground = ElevationMap(elevation=z, resolution=float(cell), origin=(0.0, 0.0), height_std=noise)
    return ObstacleWorld(*discs, ground)


def _heights(relief: Relief, cell: float, *discs: np.ndarray) -> np.ndarray:
    """Cells of the map: a disc raises or lowers every cell whose square it touches [m]."""
    at = cell * np.arange(round(EDGE / cell) + 1)
    z = relief.at(*np.meshgrid(at, at))
    # A tree in a hole or on unknown ground is seen.
    for east, north, size, kind in sorted(zip(*discs, strict=True), key=lambda d: d[3] == "tree"):
        dx = np.maximum(np.abs(at - east) - 0.5 * cell, 0.0)
        dy = np.maximum(np.abs(at - north) - 0.5 * cell, 0.0)[:, None]
        touched = np.hypot(dx, dy) <= size
        level = float(relief.at(np.array(east), np.array(north)))
        z[touched] = level + _HEIGHTS[str(kind)]
    return z
