"""Sets of the multi-body car, their and their outcomes; needs no engine."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import cycle, islice

import numpy as np

from .catalogue import spread

CLEAN = "clean"
STRENGTHS = ("", "small", "medium", "large")  # in ascending order; clean sets have none
HALVES = ("tuning", "sealed")  # odd seeds, for tuning the workflow; even ones, for reports alone

CAR_NAMES: dict[str, tuple[tuple[str, ...], ...]] = {
    "heavier body": (("step_change",),),
    "weaker brakes": (("step_change",),),
    "air": (("aerodynamic_drag",),),
    "wind": (("headwind",), ("headwind", "aerodynamic_drag")),
    "fading pads": (("brake_fade",),),
    "slippery area": (("surface_patch",),),
    "two slippery areas": (("surface_patch",),),
    "viscous driveline": (("viscous_resistance",),),
    "slow hydraulics": (("brake_lag",),),
    "glazing pads": (("session_drift",),),
    "locking wheels": (("wheel_lockup",),),
    "furrows": (("directional_surface",),),
}
"""Right names of each effect; wind on a body is also drag on it."""

_EACH, _CLEAN = 15, 60  # sets of each effect (five seeds of three strengths), clean sets
_TAKEN = ("medium", "large", "small")  # strengths in which a share of the sets is taken


@dataclass(frozen=True, slots=True)
class CarSpec:
    """One requested set: hidden effect ("" for none), seed, strength where there is one."""

    what: str
    seed: int
    strength: str = ""


@dataclass(frozen=True, slots=True)
class CarOutcome:
    """One set with its scored finding; fields as of :class:`.score.SetOutcome`."""

    what: str
    seed: int
    noise: float
    scatter: float
    verdict: str
    named: tuple[str, ...]
    right: bool
    wrong: bool
    before: float
    after: float
    floor: float
    closed: float | None
    seconds: float
    text: str
    strength: str = ""
    worse: float = 0.0


def car_specs(share_of_all: float, half: str = "sealed", seed: int = 1) -> list[CarSpec]:
    """A share of a half's sets in random order, each effect at least once, spread evenly."""
    odd = 1 - HALVES.index(half)
    rng = np.random.default_rng((11, seed, odd))
    each, clean = (max(round(n * share_of_all), 1) for n in (_EACH, _CLEAN))
    effects = [(what, strength) for what in CAR_NAMES for strength in islice(cycle(_TAKEN), each)]
    effects += [("", STRENGTHS[0])] * clean
    specs = [
        CarSpec(what, 2 * int(rng.integers(2**30)) + odd, strength) for what, strength in effects
    ]
    return spread(specs, lambda spec: spec.what, rng)
