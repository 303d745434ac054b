"""The quarter car that candidates are driven with, and how its wheel rolls."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Singles
from slopewise.models.parameters import Model
from slopewise.planner.swept.sizes import SweptSizes
from slopewise.planner.swept.wheel_path import rim_at

LEVELS, RATIO = 4, 0.7
"""Speeds tried, and the ratio of each to the next."""

_RUN_UP = 2.0
"""Ground behind the first station that the body has come over, in wheelbases."""

_PATCH = 0.5
"""Length of the tyre's contact, over which it evens the ground out, in wheel radii."""


class Ride(NamedTuple):
    """Numbers of the quarter car, its speeds, and how the tyre rolls.

    Attributes:
        frequency: of the bounce [rad/s]. damping: share of the critical one [1].
        limit: highest amplitude of the vertical acceleration [m/s²].
        slowest: of the speeds that are tried, for stations that are ``spacing`` apart [m/s].
        spacing: between stations [m].
        rim: (taps,) how far the rim is above the ground, so many stations from the middle [m].
        patch: stations on each side of the middle that the tyre touches.
        rear, ahead: stations that the rear wheels are behind; that a speed is held before.
    """

    frequency: float
    damping: float
    limit: float
    slowest: float
    spacing: float
    rim: Singles
    patch: int
    rear: int
    ahead: int


def ride_of(model: Model, sizes: SweptSizes, spacing: float) -> Ride:
    """The quarter car of a model on stations so far apart [m]."""
    vehicle, radius = model.vehicle, sizes.radius
    # Where the rim is higher than any step that may be climbed, it touches nothing.
    contact = math.sqrt(radius**2 - max(radius - sizes.max_step, 0.0) ** 2)
    away = spacing * np.arange(1, int(contact / spacing) + 1)
    return Ride(
        2.0 * math.pi * vehicle.ride_frequency,
        vehicle.ride_damping,
        model.limits.vertical_accel,
        model.limits.speed * RATIO ** (LEVELS - 1),
        spacing,
        rim_at(radius, away).astype(np.float32),
        int(0.5 * _PATCH * radius / spacing),
        math.ceil(2.0 * sizes.half_length / spacing),
        max(math.ceil(radius / spacing), 1),
    )


def run_up(sizes: SweptSizes, spacing: float) -> int:
    """Stations behind the first one that the body is rolled over before it."""
    return math.ceil(_RUN_UP * 2.0 * sizes.half_length / spacing)
