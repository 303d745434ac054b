"""How far a finding closes the gap on stops that nobody has seen.

New stops of the same design in the same session, by the plant: as the truth has them with noise and
scatter, and as the plant has them with what was configured, found, and true. So the judgement rests
on what a finding says and not on how the product simulates it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from .catalogue import HiddenSet, sampled_late
from .designs import draw
from .hidden import FIELDS
from .physics import Floats, Physics, Stops
from .plant import drive
from .sealed import InquiryFinding
from .sensing import RATE

WORTH_CLOSING = 1.5
"""Gaps below this many floors have no share that can be told."""


@dataclass(frozen=True, slots=True)
class Closing:
    """Root mean square disagreement in speed on fresh stops [m/s]; distance means of |error| [m].

    Attributes:
        before, after, floor: of the configured model, of the found one, of the truth itself.
        distance_before, distance_after, distance_floor: likewise of stopping distances.
    """

    before: float
    after: float
    floor: float
    distance_before: float
    distance_after: float
    distance_floor: float

    @property
    def share(self) -> float | None:
        """Of the closable gap that is closed; None where there is none worth closing."""
        if self.before < WORTH_CLOSING * self.floor:
            return None
        return (self.before - self.after) / (self.before - self.floor)


def closing(hidden: HiddenSet, finding: InquiryFinding) -> Closing:
    """Drive fresh stops as configured, as found, and as it is."""
    rng = np.random.default_rng((hidden.order.seed, 9))
    stops = draw(hidden.design, len(hidden.stops.speed), hidden.scatter, rng)
    stops = sampled_late(stops._replace(clock=hidden.stops.clock), rng)
    time = np.arange(0, round(10.0 * RATE)) / RATE
    real = drive(hidden.truth, stops, time)
    rolling = (real.speed > 0.1) & np.isfinite(real.distance)[:, None]
    noise = hidden.noise * rng.standard_normal(real.speed.shape)
    told = stops._replace(friction=np.ones_like(stops.speed), delay=np.zeros_like(stops.speed))
    nothing = dict.fromkeys(("m_m", "b_m", "m_b", "b_b", "dead_time"), 0.0)
    base = Physics(**(nothing | hidden.configured))
    found = physics_of(finding, base)
    speeds, distances = [], []
    # The dead time of a log counts from the sample at which it shows the command.
    truth = hidden.truth._replace(dead_time=hidden.truth.dead_time - 0.5 / RATE)
    for physics in (base, found, truth):
        here = drive(physics, told, time)
        left = (real.speed + noise - here.speed)[rolling]
        speeds.append(float(np.sqrt(np.mean(left**2))))
        distances.append(_distance_error(real.distance, here.distance, stops))
    return Closing(speeds[0], speeds[1], speeds[2], *distances)


def _distance_error(real: Floats, here: Floats, stops: Stops) -> float:
    # What never stops in the model is as wrong as can be.
    worst = stops.speed * 10.0
    both = np.isfinite(real)
    return float(np.mean(np.abs(np.minimum(here, worst) - real)[both]))


def physics_of(finding: InquiryFinding, base: Physics) -> Physics:
    """The plant with the coefficients and effects of a finding."""
    physics = base._replace(**(finding.braking or {}))
    return with_effects(physics, finding.added)


def with_effects(physics: Physics, effects: Iterable[tuple[str, dict[str, float]]]) -> Physics:
    """A world with named effects in it."""
    seen: dict[str, int] = {}
    for name, parameters in effects:
        seen[name] = seen.get(name, 0) + 1
        fields = FIELDS[name]
        again = "" if seen[name] == 1 else f"_{seen[name]}"  # a surface in several places
        changed = {
            fields[key].replace("patch", f"patch{again}"): float(value)
            for key, value in parameters.items()
        }
        physics = physics._replace(**changed)
    return physics
