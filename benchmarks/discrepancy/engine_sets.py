"""Sets of the physics engine: the nature drawn for each effect."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from . import worlds
from .designs import FIELD, draw
from .engine_plant import Nature, drive
from .plant_physics import Stops
from .world_outcomes import ENGINE_NAMES, WorldSpec


def calibrated(_: Nature) -> dict[str, float]:
    """Coefficients and dead time of the vehicle without effects."""
    return dict(_calibrated())


@cache
def _calibrated() -> dict[str, float]:
    return worlds.calibrated(ENGINE, Nature())


def _straight(count: int, scatter: float, rng: np.random.Generator) -> Stops:
    """Draw straight stops: the engine's vehicle cannot steer."""
    stops = draw("mixed", count, scatter, rng)
    return stops._replace(curvature=np.zeros(count), roll=0.6 * stops.roll)


def _nature(spec: WorldSpec, stops: Stops, rng: np.random.Generator) -> Nature:
    strength = float(rng.uniform(0.8, 1.4))
    run = round(len(stops.speed) * rng.uniform(0.35, 0.65))
    x, y = (float(rng.uniform(230.0, side - 230.0)) for side in FIELD)
    direction = float(rng.uniform(-np.pi, np.pi))
    changes: dict[str, dict[str, Any]] = {
        "": {},
        "heavier body": {"payload": 90.0 * strength, "payload_run": run},
        "weaker brakes": {"repair": 1.0 - 0.15 * strength, "payload_run": run},
        "air": {"air": 12.0 * strength},
        "wind": {"air": 4.0 * strength, "wind": 7.0, "wind_from": direction},
        "fading brakes": {"fading": 0.004 * strength, "cooling": 150.0},
        "slippery area": {"slippery": (x, y, 200.0, 0.34 / strength)},
        "viscous bearings": {"bearing": 1.6 * strength},
        "slow hydraulics": {"build_up": 0.12 * strength},
        "glazing pads": {"glazing": 0.15 * strength / float(stops.clock[-1])},
    }
    return replace(Nature(), **changes[spec.what])


ENGINE = worlds.World(drive, _straight, _nature, ENGINE_NAMES)
