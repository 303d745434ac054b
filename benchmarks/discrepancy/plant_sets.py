"""Sets of the plant: conditions, vehicle, stops and hidden effects, drawn from a seed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import sensing
from .hidden_effects import HiddenTerm, draw_hidden
from .identifiability import NOT_IDENTIFIABLE, Identifiability, identifiability
from .plant_physics import Physics, Stops, draw

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
    """Draw one set."""
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
