"""Plans of the moving horizon on open ground, driven with and without the guard."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.planner.horizon.answer import PlanarState
from slopewise.planner.horizon.horizon import Horizon
from slopewise.services.guard.decide import guard_decision

_CYCLE = 0.1  # [s]
_EDGE, _CELL = 30.0, 0.2  # of the map [m]
_AGE = 0.12  # of pose and speed, with the transport to the base [s]
_SPACING = 0.25  # of the points of a path [m]
_MAX_CYCLES = 400  # of a drive [1]


class GuardedPlan(NamedTuple):
    """One path, driven twice."""

    seconds: float  # without and with the guard [s]
    guarded_seconds: float
    touched: int  # commands that the guard changed, of all [1]
    cycles: int


def open_ground(rng: np.random.Generator) -> ElevationMap:
    """Rolling ground without obstacles."""
    north, east = _CELL * np.indices(2 * (round(_EDGE / _CELL) + 1,))
    z = np.zeros_like(east)
    for _ in range(5):
        kx, ky, phase = *rng.uniform(-0.3, 0.3, 2), rng.uniform(0.0, 7.0)
        z += rng.uniform(0.05, 0.3) * np.sin(kx * east + ky * north + phase)
    return ElevationMap(elevation=z, resolution=_CELL, origin=(0.0, 0.0))


def curved_path(rng: np.random.Generator) -> CandidatePath:
    """Path across the map with turns of at least 4 m radius."""
    station = np.arange(0.0, 22.0, _SPACING)
    curvature = rng.uniform(-0.25, 0.25) * np.sin(2.0 * np.pi * station / rng.uniform(8.0, 25.0))
    heading = np.cumsum(curvature) * _SPACING
    x, y = np.cumsum(np.cos(heading)) * _SPACING, np.cumsum(np.sin(heading)) * _SPACING
    return CandidatePath("path", np.stack((4.0 + x, 0.5 * _EDGE + y - 0.5 * y[-1]), axis=1))


def _driven(
    model: Model, ground: ElevationMap, path: CandidatePath, *, guarded: bool
) -> tuple[float, int, int]:
    """Time to the last metres of a path [s], commands that were changed, and cycles."""
    horizon = Horizon(model)
    px, py = path.points.T
    station = np.concatenate(([0.0], np.cumsum(np.hypot(np.diff(px), np.diff(py)))))
    heading = np.unwrap(np.arctan2(np.gradient(py), np.gradient(px)))
    s, v, touched, last = 0.5, 0.0, 0, (0.0, 0.0)
    for cycle in range(_MAX_CYCLES):
        x, y, yaw = (float(np.interp(s, station, of)) for of in (px, py, heading))
        state = PlanarState(x=x, y=y, heading=yaw, speed=v)
        if s > station[-1] - 5.0:
            return cycle * _CYCLE, touched, cycle
        speed = horizon.step(state, [path], ground).command.speed
        if guarded:
            before, after = (
                float(np.interp(s + d, station, heading)) for d in (0.0, max(v, 1.0) * _CYCLE)
            )
            rate = (after - before) / (max(v, 1.0) * _CYCLE) * max(v, speed)
            decision = guard_decision(
                model, ground, (x, y, yaw), v, (speed, rate), age=_AGE, before=(last,)
            )
            last = decision.command.speed, decision.command.yaw_rate
            if decision.action != "pass":
                touched += 1
                speed = decision.command.speed
                if decision.brake:
                    speed = max(v - 0.4, 0.0)
        s += 0.5 * (v + speed) * _CYCLE
        v = speed
    return math.inf, touched, _MAX_CYCLES


def drive_twice(seed: int, model: Model) -> GuardedPlan:
    """Drive one path without and with the guard."""
    rng = np.random.default_rng((19, seed))
    ground, path = open_ground(rng), curved_path(rng)
    seconds, *_ = _driven(model, ground, path, guarded=False)
    guarded, touched, cycles = _driven(model, ground, path, guarded=True)
    return GuardedPlan(seconds, guarded, touched, cycles)
