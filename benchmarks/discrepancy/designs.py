"""Designs of the driven stops: five habits of collecting them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .plant_physics import Stops

DESIGNS = ("mixed", "fast", "steep", "slow", "one-way")

SPACING = 60.0
"""Distance of neighbouring places [m]: no two stops cross, so each has its own slope."""

FIELD = (20 * SPACING, 15 * SPACING)
"""Extent of the field in x and y [m]."""

_LONG_PAUSE = 0.05  # share of pauses in which brakes cool [1]
_CURVED = 0.6  # share of stops in a curve [1]
_MAX_YAW_RATE = 0.35  # [rad/s] at the command, comfortable for a skid-steered vehicle
_MIN_GRADE = -0.20  # [rad]; steeper, not every brake drawn here holds


@dataclass(frozen=True, slots=True)
class Ranges:
    """Ranges of a design: speed [m/s], size of the grade [rad], spread of the heading [rad]."""

    speed: tuple[float, float]
    grade: tuple[float, float]
    heading: float = np.pi


# As operators collect stops: anything, fast, on slopes, at walking pace, along one field track.
_RANGES = {
    "mixed": Ranges((1.0, 5.0), (0.0, 0.22)),
    "fast": Ranges((3.5, 6.0), (0.0, 0.14)),
    "steep": Ranges((1.0, 4.5), (0.12, 0.26)),
    "slow": Ranges((0.6, 2.2), (0.0, 0.20)),
    "one-way": Ranges((1.0, 5.0), (0.0, 0.22), 0.08),
}


def draw(design: str, count: int, scatter: float, rng: np.random.Generator) -> Stops:
    """Draw the stops of a design, each with its random friction and delay.

    Args:
        design: one of :data:`DESIGNS`.
        count: number of stops.
        scatter: standard deviation of the friction from stop to stop [1].
        rng: draws everything.
    """
    r = _RANGES[design]
    speed = rng.uniform(*r.speed, count)
    grade = rng.uniform(*r.grade, count) * rng.choice([-1.0, 1.0], count)
    curvature = rng.uniform(-_MAX_YAW_RATE, _MAX_YAW_RATE, count) / np.maximum(speed, 1.0)
    pause = rng.lognormal(np.log(14.0), 0.5, count)
    pause = np.where(rng.random(count) < _LONG_PAUSE, rng.uniform(120.0, 400.0, count), pause)
    columns = round(FIELD[0] / SPACING)
    cell = rng.permutation(columns * round(FIELD[1] / SPACING))[:count]
    offset = rng.uniform(-0.15, 0.15, (2, count))
    return Stops(
        speed=speed,
        grade=np.maximum(grade, _MIN_GRADE),
        wave=rng.uniform(0.0, 0.02, count),
        wave_length=rng.uniform(5.0, 15.0, count),
        wave_phase=rng.uniform(0.0, 2.0 * np.pi, count),
        roll=np.clip(rng.normal(0.0, 0.07, count), -0.2, 0.2),
        curvature=np.where(rng.random(count) < _CURVED, curvature, 0.0),
        heading=0.4 + rng.uniform(-r.heading, r.heading, count),
        x=SPACING * (cell % columns + 0.5 + offset[0]),
        y=SPACING * (cell // columns + 0.5 + offset[1]),
        clock=20.0 + np.cumsum(pause + 8.0),
        ambient=rng.uniform(5.0, 35.0, count),
        friction=np.maximum(1.0 + scatter * rng.standard_normal(count), 0.5),
        delay=0.006 * rng.standard_normal(count),
    )
