"""What a noisy map shows at least: how high a step, a rock and a post are before they are seen.

An obstacle is seen where it exceeds the vehicle's limit by what averaging leaves of the noise, and
where its contrast stands out of the noise. Lower ones may be missed; they are told, never silent.
Held against 5,000 obstacles on noisy maps (``benchmarks/noisy_maps``).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from slopewise.models.averaging_windows import averaging_windows
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.height_noise import EXACT, SIGNIFICANCE, noise_of
from slopewise.models.vehicle import Vehicle

_FOUND = 2.05
"""Standard deviations of the noise by which 98 % of what is higher stand out [1]."""


class SmallestSeen(NamedTuple):
    """Heights from which 98 % are seen [m].

    Attributes:
        noise: standard deviation of the map's errors [m].
        step: a step, a drop, a ditch or a log as wide as a wheel or wider.
        rock: a rock or a hole of about the size of a wheel.
        post: one cell.
    """

    noise: float
    step: float
    rock: float
    post: float


def smallest_seen(elevation_map: ElevationMap, vehicle: Vehicle) -> SmallestSeen | None:
    """Smallest obstacles that a map shows to a vehicle; None where no noise hides any."""
    if elevation_map.resolution > vehicle.wheel_radius:
        return None
    noise = noise_of(elevation_map)
    if noise <= EXACT:
        return None
    windows = averaging_windows(
        elevation_map.resolution, vehicle.wheel_radius, elevation_map.correlation_length
    )
    limit = vehicle.shape.max_step
    std = windows.wide.std * noise * windows.block_std
    jumps = windows.wide.slopes.shape[1]
    left = noise * math.sqrt(float(windows.variance[-2]))
    beside = noise * math.sqrt(float(windows.variance[:-1].min()))

    def seen(contrast: float, error: float) -> float:
        return max((SIGNIFICANCE + _FOUND) * contrast, limit + _FOUND * error)

    return SmallestSeen(
        noise,
        seen(float(std[:jumps].max()), beside),
        seen(float(std[jumps:].max()), left),
        seen(float(windows.narrow.std.max()) * noise, noise),
    )
