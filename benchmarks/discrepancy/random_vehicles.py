"""Logs of the plant and of the car by vehicles drawn at random, and effects of no library.

What other worlds keep still is drawn here: build-up of the brakes, swing of the sprung body seen by
speed and pitch, the sensor's filter, sessions. None of these is an effect.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from . import car_sets, catalogue, sensing, world_logs
from .blind_run import tables_of
from .car_outcomes import CAR_NAMES, CarSpec
from .catalogue import SetSpec
from .effect_plant import DrivenStops, drive
from .hidden_effects import NAMED, PAIRS
from .plant_physics import Stops
from .world_changes import OUTSIDE
from .world_logs import WorldLog

_CONDITIONS = catalogue.SetConditions(
    designs=("mixed", "fast", "steep"),
    counts=(45, 60),
    noises=(0.01, 0.02, 0.04),
    scatters=(0.01, 0.02, 0.03),
)
_SWING = (1.0, 5.0)  # natural frequency of the sprung body [Hz]
_DAMPING = (0.2, 0.5)  # of it [1]
_SOFT = 1.5  # frequency of the softest springs that those of the next two lines belong to [Hz]
_REACH = 0.006  # most that a point of such a body moves per deceleration [m per m/s²]
_DIVE = 0.008  # most that it pitches per deceleration [rad per m/s²]; both fall as 1/f²
_BUILD_UP = (0.004, 0.035)  # time constant of brakes without a lag [s]
_FILTER = 0.02  # longest time constant of the speed sensor [s]
_SESSION = 0.02  # differences of the force between sessions [1]


def requests(family: str, repeat: int, half: int) -> list[tuple[str, str, tuple[str, ...], int]]:
    """Kind, label, names and seed of one round of logs; halves share no seed."""
    rng = np.random.default_rng((41, len(family), repeat, half))
    logs: list[tuple[str, str, tuple[str, ...], int]]
    if family == "car":
        logs = [("single", what, (), 0) for what in CAR_NAMES if what != "two slippery areas"]
        logs += [("clean", "", (), 0)] * 2
    else:
        logs = [("single", name, (name,), 0) for name in NAMED]
        chosen = rng.permutation(len(PAIRS))[:4]
        logs += [("pair", "+".join(PAIRS[i]), PAIRS[i], 0) for i in chosen]
        logs += [("outside", name, (), 0) for name in OUTSIDE]
        logs += [("clean", "", (), 0)] * 4 + [("drift", "", (), 0)] * 2
    return [(k, what, names, 2 * int(rng.integers(2**30)) + half) for k, what, names, _ in logs]


def make(family: str, kind: str, label: str, names: tuple[str, ...], seed: int) -> WorldLog:
    """Drive and measure one log."""
    rng = np.random.default_rng((43, seed))
    if family == "car":
        strength = str(rng.choice(["medium", "large"])) if label else ""
        car = car_sets.make(CarSpec(label, seed, strength), count=60)
        tables = tables_of(car.configured, car_sets.car_table())
        truth = CAR_NAMES.get(label, ())
        return WorldLog(family, kind, label or kind, seed, truth, (), car.columns, tables)
    size = str(rng.choice(["medium", "large"])) if names else ""
    request = "clean" if kind == "outside" else kind
    spec = SetSpec(request, names, size, seed)
    hidden = catalogue.draw_set(spec, rng, _CONDITIONS)
    for _ in range(5):
        if kind not in ("single", "pair") or hidden.identifiable:
            break
        hidden = catalogue.draw_set(spec, rng, _CONDITIONS)
    physics, stops = hidden.truth, hidden.stops
    if "brake_lag" not in names:
        physics = physics._replace(lag=float(rng.uniform(*_BUILD_UP)))
    extra: sensing.Columns = {}
    if kind == "outside":
        stops, extra, physics = _outside(label, stops, physics, rng)
    by_session = not {"step_change", "session_drift"} & set(names) and label != "temperature"
    if by_session and rng.random() < 0.5:
        session = np.arange(len(stops.speed)) * int(rng.integers(3, 6)) // len(stops.speed)
        stops = stops._replace(
            friction=stops.friction * (1.0 + _SESSION * rng.standard_normal(6)[session])
        )
        extra["session"] = session
    late = catalogue.sampled_late(stops, rng)
    motion, filtered = _as_sensed(drive(physics, late, sensing.sample_times(11.0)), rng)
    columns = sensing.log(motion, late, hidden.noise, rng)
    if label == "battery":
        columns["battery"] = columns.pop("ambient")
    run = columns["run"].astype(np.int64)
    columns |= {name: values[run] for name, values in extra.items()}
    if "session" in columns:
        columns["session"] = np.char.add("day ", columns["session"].astype(str))
    if label == "sticking_sensor":
        world_logs.stick(columns, rng)
    truth = (names,) if names else ()
    axes = OUTSIDE.get(label, ())
    # An earlier calibration took the vehicle's own build-up and filter for dead time.
    delay = filtered + (0.0 if "brake_lag" in names else physics.lag)
    tables = tables_of(hidden.configured | {"dead_time": hidden.configured["dead_time"] + delay})
    return WorldLog(family, kind, label or kind, seed, truth, axes, columns, tables)


def _outside(
    label: str, stops: Stops, physics: Any, rng: np.random.Generator
) -> tuple[Stops, sensing.Columns, Any]:
    share = float(rng.uniform(0.06, 0.12)) * float(rng.choice([-1.0, 1.0]))
    extra: sensing.Columns = {}
    if label == "ripple":
        length = float(rng.uniform(1.5, 4.0))
        return stops, extra, physics._replace(ripple=1.5 * share * 0.45, ripple_length=length)
    by = np.zeros_like(stops.speed)
    if label == "battery":
        by = (stops.ambient - 20.0) / 10.0
    elif label == "heading":
        by = np.cos(stops.heading - float(rng.uniform(-np.pi, np.pi)))
    elif label == "temperature":
        turns = float(rng.uniform(1.2, 2.5))
        by = np.sin(2.0 * np.pi * turns * (stops.clock / stops.clock[-1]) + rng.uniform(0.0, 6.0))
        by = by + 0.5 * rng.standard_normal(len(by))
        extra["temperature"] = 15.0 + 8.0 * by
    elif label == "tyre_pressure":
        by = stops.roll / 0.07
    return stops._replace(friction=stops.friction * (1.0 + share * by)), extra, physics


def _as_sensed(motion: DrivenStops, rng: np.random.Generator) -> tuple[DrivenStops, float]:
    """The motion with the swing of the body and a filter, and that filter's time constant [s]."""
    step = 1.0 / sensing.RATE
    decel = -np.gradient(motion.speed, step, axis=1)
    frequency = float(rng.uniform(*_SWING))
    pulse, stiff = 2.0 * np.pi * frequency, min(1.0, (_SOFT / frequency) ** 2)
    damping = float(rng.uniform(*_DAMPING))
    swing = np.zeros_like(decel)
    state, rate = np.zeros(len(decel)), np.zeros(len(decel))
    rates = np.zeros_like(decel)
    for k in range(len(motion.time)):
        for _ in range(10):
            rate = rate + 0.1 * step * (
                pulse**2 * (decel[:, k] - state) - 2.0 * damping * pulse * rate
            )
            state = state + 0.1 * step * rate
        swing[:, k], rates[:, k] = state, rate
    reach = stiff * float(rng.uniform(0.0, _REACH)) * float(rng.choice([-1.0, 1.0]))
    dive = stiff * float(rng.uniform(0.0, _DIVE))
    slow = max(float(rng.uniform(0.0, _FILTER)), 1e-3)
    seen = world_logs.filtered(motion.speed + reach * rates, slow)
    return motion._replace(speed=seen, grade=motion.grade - dive * swing), slow
