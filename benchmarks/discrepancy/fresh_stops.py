"""Gap that a finding closes on fresh stops, driven by the plant.

Stops of the same design in the same session are driven as the truth has them, with noise and
scatter, and as the plant has them with the configured, the found and the true model. The score so
rests on the content of a finding and not on the product's simulation of it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from .blind_run import COEFFICIENTS, Finding
from .catalogue import HiddenSet, sampled_late
from .designs import draw
from .effect_plant import drive
from .hidden_effects import FIELDS
from .plant_physics import Floats, Physics, Stops
from .sensing import RATE

MIN_GAP = 1.5
"""Gap, over the floor, from which a closed share is meaningful [1]."""

_MIN_SPEED = 0.1  # [m/s] of compared samples


@dataclass(frozen=True, slots=True)
class Closing:
    """Disagreement on fresh stops: speed as root mean square [m/s], distance as mean |error| [m].

    Attributes:
        before, after, floor: speed by the configured model, by the finding, by the truth itself.
        distance_before, distance_after, distance_floor: stopping distances likewise.
    """

    before: float
    after: float
    floor: float
    distance_before: float
    distance_after: float
    distance_floor: float

    @property
    def share(self) -> float | None:
        """Closed share of the closable gap; None where the gap is too small."""
        return closed_share(self.before, self.after, self.floor)


def closed_share(before: float, after: float, floor: float) -> float | None:
    """Closed share of the closable gap; None where the gap is too small."""
    return None if before < MIN_GAP * floor else (before - after) / (before - floor)


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
    speeds, distances = [], []
    # The dead time of a log counts from the sample at which it shows the command.
    truth = hidden.truth._replace(dead_time=hidden.truth.dead_time - 0.5 / RATE)
    for physics in (base, physics_of(finding, base), truth):
        here = drive(physics, calm, time)
        residual = (real.speed + noise - here.speed)[rolling]
        speeds.append(float(np.sqrt(np.mean(residual**2))))
        distances.append(_distance_error(real.distance, here.distance, stops))
    return Closing(speeds[0], speeds[1], speeds[2], *distances)


def _distance_error(real: Floats, here: Floats, stops: Stops) -> float:
    worst = stops.speed * 10.0  # for a model in which the vehicle never stops
    stopped = np.isfinite(real)
    return float(np.mean(np.abs(np.minimum(here, worst) - real)[stopped]))


def physics_of(finding: Finding, base: Physics) -> Physics:
    """The plant with the coefficients and effects of a finding."""
    return with_effects(base._replace(**(finding.braking or {})), finding.added)


def with_effects(physics: Physics, effects: Iterable[tuple[str, dict[str, float]]]) -> Physics:
    """A world with named effects; a surface may lie in several places."""
    counts: dict[str, int] = {}
    for name, parameters in effects:
        counts[name] = counts.get(name, 0) + 1
        suffix = "" if counts[name] == 1 else f"_{counts[name]}"
        fields = {
            key: value.replace("patch", f"patch{suffix}") for key, value in FIELDS[name].items()
        }
        physics = physics._replace(**{fields[k]: float(v) for k, v in parameters.items()})
    return physics
