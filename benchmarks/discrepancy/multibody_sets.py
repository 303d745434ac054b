"""Sets of the multi-body car: the nature drawn for each effect, and its strength."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from . import worlds
from .designs import FIELD, draw
from .effect_plant import GRAVITY
from .multibody import MAX_CURVATURE, CarNature, drive
from .plant_physics import Stops
from .vehicle_models import CAR
from .world_outcomes import CAR_NAMES, WorldSpec

EAGER = -0.4
"""Assist of brakes that press harder downhill, so that grip ends only there [1/rad]."""

SHARES = {"small": 0.04, "medium": 0.10, "large": 0.25}
"""Share of the braking force on level ground that an effect takes at its largest [1]."""

_KNOTS = (0.03, 0.06, 0.12, 0.30)  # shares of the figures below [1]
SIZES: dict[str, tuple[float, float, float, float]] = {
    "heavier body": (34.4, 71.0, 152.0, 480.0),
    "weaker brakes": (0.031, 0.062, 0.124, 0.31),
    "air": (6.0, 11.9, 23.4, 55.0),
    "wind": (1.1, 2.15, 4.2, 9.6),
    "fading pads": (0.0366, 0.0731, 0.1455, 0.36),
    "slippery area": (0.423, 0.407, 0.379, 0.301),
    "two slippery areas": (0.423, 0.407, 0.379, 0.301),
    "viscous driveline": (0.67, 1.31, 2.55, 5.8),
    "slow hydraulics": (0.025, 0.042, 0.07, 0.15),
    "glazing pads": (0.0377, 0.0753, 0.15, 0.376),
    "locking wheels": (0.509, 0.4895, 0.462, 0.381),
    "furrows": (0.0247, 0.0492, 0.098, 0.256),
}
"""Sizes of each effect at these shares, by :func:`strength_of` in sets like those drawn here.

Hydraulics are slower: the part of a lag that the dead time absorbs is no effect."""

_MARGIN = 230.0  # [m] from the middle of a slippery area to the field's edge
_RADIUS = 200.0  # [m]
_MIN_SPEED = 3.0  # [m/s] of stops whose distances show an effect


def car_table() -> dict[str, Any]:
    """Vehicle table of the model file for the car's logs."""
    base = CAR.a + CAR.b
    return {
        "mass": CAR.m,
        "wheelbase": base,
        "track_width": 0.5 * (CAR.T_f + CAR.T_r),
        "cg_x": (CAR.m_s * CAR.b + CAR.m_uf * base) / CAR.m,
        "cg_z": CAR.h_cg,
        "wheel_radius": CAR.R_w,
        "drive": "ackermann",
        "max_wheel_speed": 7.0,
        "max_drive_force": 5000.0,
        "max_drive_power": 20000.0,
    }


def calibrated(nature: CarNature) -> dict[str, float]:
    """Coefficients and dead time of such a car without effects."""
    return dict(_calibrated(nature.assist))


@cache
def _calibrated(assist: float) -> dict[str, float]:
    return worlds.calibrated(MULTIBODY, CarNature(assist=assist))


def _scene(count: int, scatter: float, rng: np.random.Generator) -> Stops:
    """Draw stops within the car's steering range."""
    stops = draw("mixed", count, scatter, rng)
    curvature = np.clip(stops.curvature, -MAX_CURVATURE, MAX_CURVATURE)
    return stops._replace(curvature=curvature, roll=0.6 * stops.roll)


@dataclass(frozen=True, slots=True)
class Circumstances:
    """Place, time and direction of an effect.

    Attributes:
        run: first run that it affects.
        direction: heading [rad].
        places: middles of areas [m].
        duration: duration of the session [s].
    """

    run: int
    direction: float
    places: tuple[tuple[float, float], tuple[float, float]]
    duration: float


def circumstances(stops: Stops, rng: np.random.Generator) -> Circumstances:
    """Draw the circumstances in these stops."""
    run = round(len(stops.speed) * rng.uniform(0.35, 0.65))
    direction = float(rng.uniform(-np.pi, np.pi))
    x, y, across = (float(rng.uniform(_MARGIN, FIELD[k] - _MARGIN)) for k in (0, 1, 1))
    opposite = (x + 0.5 * FIELD[0]) % FIELD[0]
    second = (float(np.clip(opposite, _MARGIN, FIELD[0] - _MARGIN)), across)
    return Circumstances(run, direction, ((x, y), second), float(stops.clock[-1]))


def hidden(what: str, size: float, where: Circumstances) -> CarNature:
    """A car with one effect.

    Args:
        what: one of :data:`.world_outcomes.CAR_NAMES`, "" for none.
        size: size of the effect, in the unit of its figure in :data:`SIZES`.
        where: circumstances.
    """
    areas = tuple((x, y, _RADIUS, size) for x, y in where.places)
    changes: dict[str, dict[str, Any]] = {
        "": {},
        "heavier body": {"payload": size, "payload_run": where.run},
        "weaker brakes": {"repair": 1.0 - size, "payload_run": where.run},
        "air": {"air": size},
        "wind": {"air": size, "wind": 7.0, "wind_from": where.direction},
        "fading pads": {"fading": size},
        "slippery area": {"slippery": areas[:1]},
        "two slippery areas": {"slippery": areas},
        "viscous driveline": {"driveline": size},
        "slow hydraulics": {"build_up": size},
        "glazing pads": {"glazing": size / where.duration},
        "locking wheels": {"friction": size, "assist": EAGER},
        "furrows": {"furrows": size, "furrows_along": where.direction},
    }
    return replace(CarNature(), **changes[what])


def _nature(spec: WorldSpec, stops: Stops, rng: np.random.Generator) -> CarNature:
    vary, eager = float(rng.uniform(0.85, 1.15)), bool(rng.random() < 0.5)
    where = circumstances(stops, rng)
    if not spec.what:
        return CarNature(assist=EAGER if eager else CarNature().assist)
    share = SHARES[spec.strength] * vary
    return hidden(spec.what, float(np.interp(share, _KNOTS, SIZES[spec.what])), where)


def strength_of(nature: CarNature, stops: Stops) -> float:
    """Largest share of the braking force on level ground that an effect takes [1].

    The 95th percentile, over stops from 3 m/s at least, of the difference in mean deceleration with
    and without it; in slippery areas the median over the stops in them. Furrows are compared with a
    field of equal resistance in all directions. 0 where no stop meets it.
    """
    affected, rank = stops.speed >= _MIN_SPEED, 0.95
    if nature.slippery:
        x, y, radius, _ = np.array(nature.slippery).T
        away = np.hypot(stops.x[:, None] - x, stops.y[:, None] - y)
        affected, rank = affected & np.any(away <= radius, axis=1), 0.5
    even = CarNature().resistance + 0.5 * nature.furrows
    plain = CarNature(assist=nature.assist, resistance=even)
    if not np.any(affected):
        return 0.0
    v = stops.speed[affected]
    onset = plain.delay + stops.delay[affected] + 2.0 * plain.build_up
    with_it, without = (
        0.5 * v**2 / (drive(car, stops).distance[affected] - v * onset) for car in (nature, plain)
    )
    return float(np.quantile(np.abs(with_it - without), rank) / (GRAVITY * plain.brake))


MULTIBODY = worlds.World(drive, _scene, _nature, CAR_NAMES)
