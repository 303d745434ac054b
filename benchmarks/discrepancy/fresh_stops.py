"""A finding judged on fresh stops of the plant, by the plant.

Stops of the same design in the same session are driven as the truth has them, with noise and
scatter, and as the plant has them with the configured, the found and the true model. The judgement
so rests on the content of a finding and not on the product's simulation of it.
"""

from __future__ import annotations

import math
from collections import Counter
from typing import NamedTuple

import numpy as np

from .blind_run import COEFFICIENTS, Finding
from .effect_plant import drive, speeds
from .hidden_effects import FIELDS, HiddenTerm
from .plant_physics import Physics, draw
from .plant_world import HiddenSet, sampled_late
from .sensing import RATE

MIN_GAP = 1.5  # gap, over the floor, from which a closed share is meaningful [1]
_MIN_SPEED = 0.1  # [m/s] of compared samples
_PERIODS = {"headwind": math.tau, "directional_surface": math.pi}  # [rad] of their direction
_Z_95 = 1.959964  # standard deviations that hold 95 %


class Closing(NamedTuple):
    """Disagreement on stops that no fit has seen, root mean square [m/s] or [m]."""

    before: float  # by the configured model
    after: float  # by the finding
    floor: float  # by the truth itself

    @property
    def share(self) -> float | None:
        """Closed share of the closable gap; None where the gap is too small."""
        if self.before < MIN_GAP * self.floor:
            return None
        return (self.before - self.after) / (self.before - self.floor)


def closing(hidden: HiddenSet, finding: Finding) -> Closing:
    """Drive fresh stops by the configured, the found and the true model."""
    rng = np.random.default_rng((hidden.spec.seed, 9))
    stops = draw(hidden.design, len(hidden.stops.speed), hidden.scatter, rng)
    stops = sampled_late(stops._replace(clock=hidden.stops.clock), rng)
    time = np.arange(0, round(10.0 * RATE)) / RATE
    real = drive(hidden.truth, stops, time)
    rolling = (real.speed > _MIN_SPEED) & np.isfinite(real.distance)[:, None]
    noise = hidden.noise * rng.standard_normal(real.speed.shape)
    calm = stops._replace(friction=np.ones_like(stops.speed), delay=np.zeros_like(stops.speed))
    base = Physics(**(dict.fromkeys(COEFFICIENTS, 0.0) | hidden.configured))
    # The dead time of a log counts from the sample at which it shows the command.
    truth = hidden.truth._replace(dead_time=hidden.truth.dead_time - 0.5 / RATE)
    gaps = [
        float(np.sqrt(np.mean(((real.speed + noise - speeds(physics, calm, time))[rolling]) ** 2)))
        for physics in (base, _physics_of(finding, base), truth)
    ]
    return Closing(*gaps)


def _physics_of(finding: Finding, base: Physics) -> Physics:
    """The plant with the coefficients and effects of a finding; a surface may lie in places."""
    physics, counts = base._replace(**(finding.braking or {})), Counter[str]()
    for name, parameters in finding.added:
        counts[name] += 1
        suffix = "" if counts[name] == 1 else f"_{counts[name]}"
        fields = {k: v.replace("patch", f"patch{suffix}") for k, v in FIELDS[name].items()}
        physics = physics._replace(**{fields[k]: float(v) for k, v in parameters.items()})
    return physics


def covered(hidden: tuple[HiddenTerm, ...], finding: Finding) -> dict[str, bool]:
    """Whether each 95 % interval holds the truth; parameters without an interval are omitted."""
    holds = {}
    by_name = {effect["name"]: effect["parameters"] for effect in finding.effects}
    for term in hidden:
        for key, true in term.parameters.items():
            value, std = by_name.get(term.name, {}).get(key, (math.nan, math.nan))
            if key == "run" or not (math.isfinite(value) and std > 0.0):
                continue
            error = abs(value - true)
            if key == "direction":
                period = _PERIODS[term.name]
                error = abs((value - true + 0.5 * period) % period - 0.5 * period)
            holds[f"{term.name}.{key}"] = error <= _Z_95 * std
    return holds
