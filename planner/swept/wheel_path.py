"""The ground as a wheel feels it: cells as tilted facets, the width of the tyre, its rim."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from models.arrays import Floats
from planner.ground.elevation_map import height_at
from planner.kernels.compiled import inlined
from planner.swept.sizes import SweptSizes

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
def gentler(before: float, after: float) -> float:
    """The smaller of two slopes, 0 where they differ in sign or one is unknown."""
    least = np.copysign(min(abs(before), abs(after)), before)
    return least if before * after > 0.0 else 0.0


@inlined
def facet(elevation: Floats, i: int, j: int) -> tuple[float, float, float]:
    """Height of a cell [m], and its rise to the east and to the north over a cell [m]."""
    rows, columns = elevation.shape
    west, east = max(j - 1, 0), min(j + 1, columns - 1)
    south, north = max(i - 1, 0), min(i + 1, rows - 1)
    here = elevation[i, j]
    # At the rim of the map a cell is its own neighbour, and level that way.
    across = gentler(here - elevation[i, west], elevation[i, east] - here)
    along = gentler(here - elevation[south, j], elevation[north, j] - here)
    return here, across, along


@inlined
def facet_height(ground: Ground, x: float, y: float) -> float:
    """Height of the cell at a point [m], NaN where unknown.

    Each cell is a plane through its own height, with the gentler of the slopes to its neighbours:
    exact on slopes, and a single high cell keeps its full height. Source: minmod limiter, Roe,
    Characteristic-based schemes (1986).
    """
    rows, columns = ground.elevation.shape
    u = (x - ground.origin_x) * ground.per_metre
    v = (y - ground.origin_y) * ground.per_metre
    if not (u >= -0.5 and v >= -0.5 and u < columns - 0.5 and v < rows - 0.5):
        return np.nan
    j, i = int(u + 0.5), int(v + 0.5)
    here, across, along = facet(ground.elevation, i, j)
    return float(here + across * (u - j) + along * (v - i))


@inlined
def under_tyre(ground: Ground, pose: Pose, ahead: float, aside: float, sizes: SweptSizes) -> float:
    """Highest known ground across a tyre [m], :data:`NO_GROUND` where all is unknown.

    Args:
        ground: map. pose: of the vehicle.
        ahead, aside: of the middle of the tyre, from the pose [m]. sizes: of the vehicle.
    """
    highest = NO_GROUND
    for n in range(sizes.tyres):
        across = aside + sizes.half_tyre * (2.0 * n / (sizes.tyres - 1) - 1.0)
        x = pose.x + ahead * pose.heading_x - across * pose.heading_y
        y = pose.y + ahead * pose.heading_y + across * pose.heading_x
        height = facet_height(ground, x, y)
        highest = height if height > highest else highest
    return highest


@inlined
def drop_of_rim(radius: float, away: float) -> float:
    """How far the rim of a wheel lies above its lowest point [m], so far from it along the way."""
    return float(radius - np.sqrt(max(radius * radius - away * away, 0.0)))


@inlined
def contact_height(
    ground: Ground, pose: Pose, ahead: float, aside: float, sizes: SweptSizes
) -> float:
    """Height of the lowest point of a wheel that stands there [m], NaN where all is unknown.

    On a map coarser than the wheel the wheel stands on its bilinear surface.
    """
    if not sizes.fine:
        x = pose.x + ahead * pose.heading_x - aside * pose.heading_y
        y = pose.y + ahead * pose.heading_y + aside * pose.heading_x
        u = (x - ground.origin_x) * ground.per_metre
        v = (y - ground.origin_y) * ground.per_metre
        return float(height_at(ground.elevation, u, v))
    strides = int(sizes.radius / sizes.stride)
    highest = NO_GROUND
    for n in range(-strides, strides + 1):
        away = n * sizes.stride
        height = under_tyre(ground, pose, ahead + away, aside, sizes)
        height -= drop_of_rim(sizes.radius, away)
        if height > highest:
            highest = height
    return float(highest if highest > 0.5 * NO_GROUND else np.nan)
