"""What the sweep is asked and stands on: map, poses, cells as tilted facets, the rim of a wheel."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slopewise.models.arrays import Floats
from slopewise.planner.kernels.compiled import inlined

NO_GROUND = -1e12
"""Height of what is unknown, where the highest counts [m]."""


class Ground(NamedTuple):
    """A map for compiled code: heights [m], centre of cell [0, 0] [m], cells a metre."""

    elevation: Floats
    origin_x: float
    origin_y: float
    per_metre: float


class Pose(NamedTuple):
    """Middle of the wheelbase [m], unit vector of travel."""

    x: float
    y: float
    heading_x: float
    heading_y: float


@inlined
def place(pose: Pose, ahead: float, aside: float) -> tuple[float, float]:
    """Coordinates of what is so far ahead and to the left of a pose [m]."""
    x = pose.x + ahead * pose.heading_x - aside * pose.heading_y
    y = pose.y + ahead * pose.heading_y + aside * pose.heading_x
    return x, y


@inlined
def gentler(before: float, after: float) -> float:
    """The smaller of two slopes, 0 where they differ in sign or one is unknown."""
    least = np.copysign(min(abs(before), abs(after)), before)
    return least if before * after > 0.0 else 0.0


def rim_at(radius: float, away: NDArray[np.floating[Any]]) -> Floats:
    """:func:`drop_of_rim` at many distances [m], as numbers for compiled code."""
    drops: Floats = radius - np.sqrt(np.maximum(radius * radius - away * away, 0.0))
    return drops


@inlined
def drop_of_rim(radius: float, away: float) -> float:
    """How far the rim of a wheel lies above its lowest point [m], so far from it along the way."""
    return float(radius - np.sqrt(max(radius * radius - away * away, 0.0)))
