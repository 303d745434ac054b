"""A car in the vertical plane that rocks, and what its sensors show of its stops.

Speed comes from counts of wheel encoders or late from a receiver on the roof; pitch holds the dive
of the body.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from . import sensing, world_changes, world_logs
from .effect_plant import DrivenStops
from .plant_physics import Floats, Stops
from .rocking_motion import SETTLE, RockingCar, StopForces, draw_car, stop
from .world_changes import Changes

_STEP = 5e-4  # [s]
_GRIP = 1.1  # of the tyres, beyond any brake [1]
_PHASES = (0.0, 0.23, 0.51, 0.77)  # of the four encoders, in counts [1]


def drive(
    car: RockingCar,
    changes: Changes,
    stops: Stops,
    before: float = world_logs.BEFORE,
    step: float = _STEP,
) -> DrivenStops:
    """Drive all stops in their order, sampled from ``before`` [s] each command, as sensed."""
    time, heat, traces = world_logs.sample_times(before), 0.0, []
    for i in range(len(stops.speed)):
        gone = float(stops.clock[i] - stops.clock[i - 1]) if i else 0.0
        forces = _forces(car, changes, stops, i, before)
        traces.append(stop(forces, time, heat * math.exp(-gone / changes.cooling), step))
        heat = traces[-1][3]
    rows, turns = np.stack([trace[0] for trace in traces]), np.stack([t[1] for t in traces])
    rest = np.array([trace[2] for trace in traces])
    v, station, pitch, pitch_rate, slope = np.moveaxis(rows, 2, 0)
    # Stops are placed where their command is given.
    station = station - station[:, [int(np.searchsorted(time, 0.0))]]
    speed = _counted(car, turns, v) if car.counts else _received(car, v, pitch_rate)
    turned = stops.curvature[:, None] * station
    straight = station * np.sinc(turned / (2.0 * np.pi))
    middle = stops.heading[:, None] + 0.5 * turned
    places = (
        stops.x[:, None] + straight * np.cos(middle),
        stops.y[:, None] + straight * np.sin(middle),
    )
    attitude = (slope - pitch + car.mount, np.broadcast_to(stops.roll[:, None], v.shape))
    yaw, rate = stops.heading[:, None] + turned, stops.curvature[:, None] * v
    at_rest = np.minimum(np.searchsorted(time, rest), len(time) - 1)
    ends = rest, station[np.arange(len(rest)), at_rest], np.zeros(len(rest))
    return DrivenStops(time, speed, station, *places, yaw, rate, *attitude, *ends)


def _forces(car: RockingCar, changes: Changes, stops: Stops, i: int, before: float) -> Any:
    target = float(stops.speed[i]) * (1.0 - car.lag_behind)
    numbers: dict[str, Any] = {name: float(column[i]) for name, column in stops._asdict().items()}
    numbers |= {n: getattr(source, n) for source in (car, changes) for n in source.__slots__}
    factor = numbers.pop("factor")
    numbers |= {
        "grip": changes.grip or _GRIP,
        "strength": float(stops.friction[i]) * (factor[i] if factor else 1.0),
        "target": target,
        "onset": car.dead_time + float(stops.delay[i]),
        "lead": target * (SETTLE + before),
    }
    return StopForces(**numbers)


def _counted(car: RockingCar, turns: Floats, v: Floats) -> Floats:
    """Speed by whole counts of four wheels, averaged over the car's window."""
    angle = np.repeat(turns.transpose(0, 2, 1), 2, axis=1)
    step = v[:, None, :1] / car.radius / sensing.RATE
    early = angle[:, :, :1] - step * np.arange(car.window, 0, -1)
    angle = np.concatenate([early, angle], axis=2)
    phase = np.array(_PHASES)[None, :, None]
    counted = np.floor(angle * car.counts / (2.0 * np.pi) + phase)
    gained = (counted[:, :, car.window :] - counted[:, :, : -car.window]).mean(axis=1)
    speed: Floats = gained * 2.0 * np.pi * car.radius / car.counts * sensing.RATE / car.window
    return speed


def _received(car: RockingCar, v: Floats, pitch_rate: Floats) -> Floats:
    """Speed of the roof, some hundredths of a second ago."""
    speed = v + (car.roof - car.height) * pitch_rate
    count = np.arange(v.shape[1])
    ago = count - car.late * sensing.RATE
    return np.stack([np.interp(ago, count, row) for row in speed])


def make(kind: str, label: str, seed: int) -> world_logs.WorldLog:
    rng = np.random.default_rng((61, seed))
    car = draw_car(rng)
    if "wheel_lockup" in label and car.counts:
        car = replace(car, counts=0)  # wheels that slide show no speed
    earlier = np.random.default_rng((62, seed))
    return world_logs.car_log(kind, label, car, drive, 0.03, rng, earlier)


def requests(seed: int = 1) -> list[tuple[str, str, int]]:
    outside = (*world_changes.OUTSIDE, "battery", "heading")
    return world_changes.requests_of(67 + 1000 * seed, 12, 4, outside)
