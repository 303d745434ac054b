"""Sets of the plant: how each is made from its seed."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from . import sensing
from .effect_plant import drive
from .hidden_effects import HiddenTerm, draw_hidden
from .identifiability import NOT_IDENTIFIABLE, Identifiability, identifiability
from .plant_physics import DESIGNS, Physics, Stops, draw

CONFOUNDED = ("grade_bias", "furrows one way", "uphill only", "same roll everywhere")
"""Effects that the stops of their sets cannot show: the base model absorbs them."""

_MAX_DRAWS = 6  # of a set until its effect can be named
_PITCH_BIAS = 0.025  # [rad] of the sensor in sets of "grade_bias"
_CALIBRATION_STD = {"m_m": 0.002, "b_m": 0.01, "m_b": 0.001, "b_b": 0.006, "dead_time": 0.008}
"""Error of an earlier calibration, as one standard deviation of a log of some 100 stops."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SetConditions:
    """Values that sets are drawn from: designs, stop counts, noise [m/s], scatter [1]."""

    designs: tuple[str, ...] = DESIGNS
    counts: tuple[int, ...] = (40, 70, 100, 150, 200)
    noises: tuple[float, ...] = (0.01, 0.03, 0.06)
    scatters: tuple[float, ...] = (0.005, 0.02, 0.05)


ALL = SetConditions()


@dataclass(frozen=True, slots=True)
class SetSpec:
    """One requested set."""

    kind: str  # clean, drift, single, pair, absorbed or off
    names: tuple[str, ...]  # hidden effects
    size: str  # one of :data:`.hidden_effects.SIZES`, "" for none
    seed: int  # determines all that is drawn


@dataclass(frozen=True, slots=True)
class HiddenSet:
    """One set: a log, a configured model, and the truth."""

    spec: SetSpec  # request
    design: str  # design, noise, scatter: conditions of driving and measurement
    noise: float
    scatter: float
    columns: sensing.Columns  # drive log
    configured: dict[str, float]  # [braking] coefficients of the model file
    truth: Physics  # world with its effects
    hidden: tuple[HiddenTerm, ...]  # effects in it
    stops: Stops  # as driven
    identifiability: Identifiability = NOT_IDENTIFIABLE  # what the log can show

    @property
    def identifiable(self) -> bool:
        """Whether the log suffices for a right answer."""
        known = self.identifiability
        return known.has_shape if self.spec.kind == "off" else known.has_name


def make(spec: SetSpec, conditions: SetConditions = ALL) -> HiddenSet:
    """Drive and measure one set; draw again, a few times, where its effect cannot be named."""
    rng = np.random.default_rng(spec.seed)
    needs_name = spec.kind in ("single", "pair", "off")
    for _ in range(_MAX_DRAWS if needs_name else 1):
        candidate = draw_set(spec, rng, conditions)
        if not needs_name or candidate.identifiable:
            break
    return measure(candidate, rng)


def sampled_late(stops: Stops, rng: np.random.Generator) -> Stops:
    """Stops whose command falls between two samples; the log shows it at the later one."""
    phase = rng.uniform(0.0, 1.0 / sensing.RATE, len(stops.delay))
    return stops._replace(delay=stops.delay - phase)


def draw_set(spec: SetSpec, rng: np.random.Generator, conditions: SetConditions = ALL) -> HiddenSet:
    """Draw one set, not yet measured."""
    c = conditions
    design, scatter = str(rng.choice(c.designs)), float(rng.choice(c.scatters))
    count, noise = int(rng.choice(c.counts)), float(rng.choice(c.noises))
    base = _draw_base(rng)
    confounded = spec.kind == "absorbed"
    one_way = confounded and "one way" in spec.names[0]
    stops = draw("one-way" if one_way else design, count, scatter, rng)
    configured = _configured(base, rng, drifted=spec.kind == "drift")
    if spec.kind == "clean":
        configured = {key: float(getattr(base, key)) for key in configured}
    # Logs show a command half a sample late, and so do logs that were calibrated from.
    configured["dead_time"] -= 0.5 / sensing.RATE
    if confounded:
        term, stops = _confounded(spec.names[0], stops, rng)
        terms: tuple[HiddenTerm, ...] = (term,)
    else:
        terms = tuple(draw_hidden(n, spec.size, base, stops, rng) for n in spec.names)
    truth = base
    for term in terms:
        truth = truth._replace(**term.fields)
    known = NOT_IDENTIFIABLE
    if terms and not confounded:
        known = identifiability(truth, base, stops, noise, scatter, spec.names)
    return HiddenSet(spec, design, noise, scatter, {}, configured, truth, terms, stops, known)


def _draw_base(rng: np.random.Generator) -> Physics:
    return Physics(
        m_m=float(rng.uniform(-0.03, 0.02)),
        b_m=float(rng.uniform(-0.40, -0.05)),
        m_b=float(rng.uniform(-0.006, 0.015)),
        b_b=float(rng.uniform(0.40, 0.52)),
        dead_time=float(rng.uniform(0.15, 0.40)),
    )


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


def _confounded(name: str, stops: Stops, rng: np.random.Generator) -> tuple[HiddenTerm, Stops]:
    """One of :data:`CONFOUNDED`, and stops that cannot show it."""
    if name == "grade_bias":
        return HiddenTerm(name, {}), stops
    if name == "furrows one way":
        straight = stops._replace(
            heading=np.full_like(stops.heading, 0.4), curvature=np.zeros_like(stops.speed)
        )
        fields = {"furrow": 0.05, "furrow_direction": float(rng.uniform(0.0, 0.3))}
        return HiddenTerm(name, fields), straight
    if name == "uphill only":
        uphill = stops._replace(grade=np.abs(stops.grade) + 0.03)
        return HiddenTerm(name, {"asymmetry": float(rng.uniform(0.2, 0.4))}), uphill
    tilted = stops._replace(roll=np.full_like(stops.roll, 0.1))
    return HiddenTerm(name, {"cross_slope": float(rng.uniform(0.2, 0.4))}), tilted


def measure(hidden: HiddenSet, rng: np.random.Generator) -> HiddenSet:
    """Drive the stops and add the log to the set."""
    late = sampled_late(hidden.stops, rng)
    motion = drive(hidden.truth, late, sensing.sample_times(11.0))
    columns = sensing.log(motion, late, hidden.noise, rng)
    if hidden.spec.names[:1] == ("grade_bias",):
        columns["pitch"] = columns["pitch"] + _PITCH_BIAS
    return replace(hidden, columns=columns)
