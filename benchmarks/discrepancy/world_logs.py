"""Logs of worlds with their own physics: sampling, sensing, model file, truth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from scipy.signal import lfilter

from . import sensing, world_changes
from .blind_run import calibrated_braking, tables_of
from .effect_plant import GRAVITY, DrivenStops
from .plant_physics import Floats, Stops
from .world_changes import OUTSIDE, Changes

_NOISE = (0.01, 0.04)  # of the speed in an earlier log [m/s]
BEFORE, LONGEST = 1.2, 12.0  # sampled before and after each command [s]


@dataclass(frozen=True, slots=True)
class WorldLog:
    """One log with its truth."""

    kind: str  # clean, drift, single, pair or outside
    truth: tuple[tuple[str, ...], ...]  # alternatives of right names
    axes: tuple[str, ...]  # right axes of a change without a name
    columns: sensing.Columns  # drive log
    tables: dict[str, Any]  # model file
    hidden: Any = None  # set of the plant, which compares findings on fresh stops


def sample_times(before: float) -> Floats:
    """Times since a command as the log has them, from ``before`` [s] on, shape (samples,) [s]."""
    count = np.arange(-round(before * sensing.RATE), round(LONGEST * sensing.RATE))
    return np.asarray(count / sensing.RATE, np.float64)


def filtered(speed: Floats, slow: float) -> Floats:
    """Speed behind a filter of first order with this time constant [s]."""
    keep = float(np.exp(-1.0 / sensing.RATE / max(slow, 1e-3)))
    start = speed[:, :1]
    slower: Floats = start + lfilter([1.0 - keep], [1.0, -keep], speed - start, axis=1)
    return slower


def stick(columns: sensing.Columns, rng: np.random.Generator) -> None:
    """Hold the speed for a fifth of a second now and then."""
    speed, hold = columns["v"].copy(), round(0.2 * sensing.RATE)
    for at in np.flatnonzero(rng.random(len(speed)) < 0.01):
        speed[at : at + hold] = speed[at]
    columns["v"] = speed


def calibration_of(
    drive: Callable[..., DrivenStops], car: Any, eager: float, rng: np.random.Generator
) -> dict[str, Any]:
    """Braking table of an earlier log of the car, without changes."""
    stops = world_changes.calibration_stops(car.force, rng)
    motion = drive(car, Changes(eager=eager), stops)
    return calibrated_braking(sensing.log(motion, stops, float(rng.uniform(*_NOISE)), rng))


def car_log(
    kind: str,
    label: str,
    car: Any,
    drive: Callable[..., DrivenStops],
    max_noise: float,
    rng: np.random.Generator,
    earlier: np.random.Generator,
) -> WorldLog:
    """One log of a car with its changes; the model file is that of an earlier log without them."""
    scene = world_changes.draw_scene(kind, label, car.force, rng)
    motion = drive(car, scene.changes, scene.stops)
    tables = tables_of(calibration_of(drive, car, scene.changes.eager, earlier), car.table)
    noise = float(rng.uniform(_NOISE[0], max_noise))
    return world_log(kind, label, scene.extra, scene.stops, motion, noise, tables, rng)


def vehicle_table(
    mass: float, wheelbase: float, track: float, cg_x: float, cg_z: float, radius: float
) -> dict[str, float | str]:
    """Vehicle table of the model file; SI, the centre of gravity from the rear axle."""
    return {
        "mass": mass,
        "wheelbase": wheelbase,
        "track_width": track,
        "cg_x": cg_x,
        "cg_z": cg_z,
        "wheel_radius": radius,
        "drive": "ackermann",
        "max_wheel_speed": 8.0,
        "max_drive_force": 0.6 * mass * GRAVITY,
        "max_drive_power": 2.0 * mass * GRAVITY,
    }


def world_log(
    kind: str,
    label: str,
    extra: dict[str, Floats],
    stops: Stops,
    motion: DrivenStops,
    noise: float,
    tables: dict[str, Any],
    rng: np.random.Generator,
) -> WorldLog:
    """Columns with this noise of the speed [m/s] and further ones by run, model file, truth."""
    columns = sensing.log(motion, stops, noise, rng)
    run = columns["run"].astype(np.int64)
    columns |= {name: values[run] for name, values in extra.items()}
    if "session" in columns:
        day = columns["session"].astype(np.int64).astype(str)
        columns["session"] = np.char.add("day ", day)
    if label == "sticking_sensor":
        stick(columns, rng)
    names = tuple(label.split("+")) if kind in ("single", "pair") else ()
    # Wind on a body is also drag on it.
    either = [((n,), (n, "aerodynamic_drag")) if n == "headwind" else ((n,),) for n in names]
    truth = tuple(tuple(n for part in parts for n in part) for parts in product(*either))
    axes = OUTSIDE.get(label, ()) if kind == "outside" else ()
    truth = truth if names else ()
    return WorldLog(kind, truth, axes, columns, tables)
