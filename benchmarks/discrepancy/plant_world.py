"""Logs of the plant by vehicles drawn at random, and effects of no library.

Drawn, too, are build-up of the brakes, swing of the sprung body seen by speed and pitch, the
sensor's filter, sessions. None of these is an effect.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from . import sensing, world_changes, world_logs
from .blind_run import tables_of
from .effect_plant import DrivenStops, drive
from .hidden_effects import HiddenTerm, draw_hidden
from .identifiability import NOT_IDENTIFIABLE, Identifiability, identifiability
from .plant_physics import Floats, Physics, Stops, draw
from .world_changes import OUTSIDE

_SWING = (1.0, 5.0)  # natural frequency of the sprung body [Hz]
_DAMPING = (0.2, 0.5)  # of it [1]
_SOFT = 1.5  # frequency of the softest springs that those of the next two lines belong to [Hz]
_REACH = 0.006  # most that a point of such a body moves per deceleration [m per m/s²]
_DIVE = 0.008  # most that it pitches per deceleration [rad per m/s²]; both fall as 1/f²
_BUILD_UP = (0.004, 0.035)  # time constant of brakes without a lag [s]
_FILTER = 0.02  # longest time constant of the speed sensor [s]


_MAX_DRAWS = 6  # of a set until its effect can be named
_CALIBRATION_STD = {"m_m": 0.002, "b_m": 0.01, "m_b": 0.001, "b_b": 0.006, "dead_time": 0.008}
"""Error of an earlier calibration, as one standard deviation of a log of some 100 stops."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SetConditions:
    """Values that sets are drawn from: designs, stop counts, noise [m/s], scatter [1]."""

    designs: tuple[str, ...]
    counts: tuple[int, ...]
    noises: tuple[float, ...]
    scatters: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class SetSpec:
    """One requested set."""

    kind: str  # clean, drift, single or pair
    names: tuple[str, ...]  # hidden effects
    size: str  # one of :data:`.hidden_effects.SIZES`, "" for none
    seed: int  # determines all that is drawn


@dataclass(frozen=True, slots=True)
class HiddenSet:
    """One set, not measured: stops, a configured model, and the truth."""

    spec: SetSpec
    design: str  # design, noise [m/s], scatter [1]: conditions of driving and measurement
    noise: float
    scatter: float
    configured: dict[str, float]  # [braking] coefficients of the model file
    truth: Physics  # world with its effects
    hidden: tuple[HiddenTerm, ...]  # effects in it
    stops: Stops
    identifiability: Identifiability  # what the log can show


def nameable_set(spec: SetSpec, rng: np.random.Generator, conditions: SetConditions) -> HiddenSet:
    """Draw a set, again a few times where its effect cannot be named."""
    for _ in range(_MAX_DRAWS):
        hidden = draw_set(spec, rng, conditions)
        if not spec.names or hidden.identifiability.has_name:
            break
    return hidden


def sampled_late(stops: Stops, rng: np.random.Generator) -> Stops:
    """Stops whose command falls between two samples; the log shows it at the later one."""
    phase = rng.uniform(0.0, 1.0 / sensing.RATE, len(stops.delay))
    return stops._replace(delay=stops.delay - phase)


def draw_set(spec: SetSpec, rng: np.random.Generator, c: SetConditions) -> HiddenSet:
    design, scatter = str(rng.choice(c.designs)), float(rng.choice(c.scatters))
    count, noise = int(rng.choice(c.counts)), float(rng.choice(c.noises))
    # m_m, b_m, m_b, b_b, dead time
    base = rng.uniform((-0.03, -0.40, -0.006, 0.40, 0.15), (0.02, -0.05, 0.015, 0.52, 0.40))
    truth = physics = Physics(*base.tolist())
    stops = draw(design, count, scatter, rng)
    configured = _configured(physics, rng, drifted=spec.kind == "drift")
    if spec.kind == "clean":
        configured = {key: float(getattr(physics, key)) for key in configured}
    # Logs show a command half a sample late, and so do logs that were calibrated from.
    configured["dead_time"] -= 0.5 / sensing.RATE
    terms = tuple(draw_hidden(name, spec.size, physics, stops, rng) for name in spec.names)
    for term in terms:
        truth = truth._replace(**term.fields)
    known = NOT_IDENTIFIABLE
    if terms:
        known = identifiability(truth, physics, stops, noise, scatter, spec.names)
    return HiddenSet(spec, design, noise, scatter, configured, truth, terms, stops, known)


def _configured(base: Physics, rng: np.random.Generator, *, drifted: bool) -> dict[str, float]:
    """Coefficients of an earlier calibration, or from before the vehicle changed."""
    widened = 6.0 if drifted else 1.0
    values = {
        key: float(getattr(base, key)) + widened * std * float(rng.standard_normal())
        for key, std in _CALIBRATION_STD.items()
    }
    if drifted:
        # At least the level force or the dead time is clearly another one.
        change = float(rng.choice([-1.0, 1.0])) * float(rng.uniform(0.04, 0.08))
        key = str(rng.choice(["b_b", "dead_time"]))
        values[key] = float(getattr(base, key)) + change * (1.0 if key == "b_b" else 1.5)
    return values


_CONDITIONS = SetConditions(
    designs=("mixed", "fast", "steep"),
    counts=(45, 60),
    noises=(0.01, 0.02, 0.04),
    scatters=(0.01, 0.02, 0.03),
)


def requests(seed: int = 1) -> list[tuple[str, str, int]]:
    return world_changes.requests_of(41 + 1000 * seed, 10, 3, tuple(OUTSIDE))


def make(kind: str, label: str, seed: int) -> world_logs.WorldLog:
    rng = np.random.default_rng((43, seed))
    names = tuple(label.split("+")) if kind in ("single", "pair") else ()
    size = str(rng.choice(["medium", "large"])) if names else ""
    spec = SetSpec("clean" if kind == "outside" else kind, names, size, seed)
    hidden = nameable_set(spec, rng, _CONDITIONS)
    physics, stops = hidden.truth, hidden.stops
    if "brake_lag" not in names:
        physics = physics._replace(lag=float(rng.uniform(*_BUILD_UP)))
    extra: dict[str, Floats] = {}
    if kind == "outside":
        stops, extra, physics = _outside(label, stops, physics, rng)
    by_session = not {"step_change", "session_drift"} & set(names) and label != "temperature"
    if by_session and rng.random() < 0.5:
        stops, extra["session"] = world_changes.in_sessions(stops, rng)
    late = sampled_late(stops, rng)
    motion, filtered = _as_sensed(drive(physics, late, sensing.sample_times(11.0)), rng)
    if label == "battery":
        extra["battery"] = late.ambient
    # An earlier calibration took the vehicle's own build-up and filter for dead time.
    delay = filtered + (0.0 if "brake_lag" in names else physics.lag)
    known = hidden.configured | {"dead_time": hidden.configured["dead_time"] + delay}
    measured = (kind, label, extra, late, motion, hidden.noise)
    log = world_logs.world_log(*measured, tables_of(known), rng)
    if label == "battery":
        del log.columns["ambient"]
    return replace(log, hidden=replace(hidden, truth=physics, stops=stops, configured=known))


def _outside(
    label: str, stops: Stops, physics: Any, rng: np.random.Generator
) -> tuple[Stops, dict[str, Floats], Any]:
    share = float(rng.uniform(0.06, 0.12)) * float(rng.choice([-1.0, 1.0]))
    extra: dict[str, Floats] = {}
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
