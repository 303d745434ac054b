"""Lowest step, rock and post that a noisy map shows to a vehicle.

An obstacle is detected where it exceeds the vehicle's limit by what averaging leaves of the noise,
and where its contrast stands out of the noise. Lower ones may be missed, and are reported.

Three shares are measured (``slopewise bench noise``), as no formula gives them:

- Averaging next to an edge takes up to 15 % of a height near the limit, with very little noise, too.
- A step needs 0.6 of the height at which its contrast is significant: one that is averaged becomes
  a ramp as long as the disc, which a tyre still has to climb.
- A rock needs 1.4 times that height: its outline fits neither the directions of ridges nor the
  squares, so that a part of it is averaged with the ground around it; for the same reason four
  standard deviations of a mean are added to the limit, not two.
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

_EDGE, _STEP, _ROCK, _ROCK_ERRORS = 1.15, 0.6, 1.4, 4.0
"""Shares that are measured, see above: of the limit, of a contrast's height; and errors [1]."""

_ROCK_SIZE, _FEW_CELLS, _RING = 0.3, 2.5, 0.87
"""Edge of a rock [m]; cells along it up to which they are single posts to averaging, with this
share of their height over the cells around, some of which are the rock as well [1]."""


class SmallestSeen(NamedTuple):
    """Heights from which 98 % are detected [m].

    Attributes:
        noise: standard deviation of the map's errors [m].
        step: a step, a drop, a ditch or a log as long as a wheel's radius or longer.
        rock: a rock of 0.3 m, or a hole into which a wheel fits.
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

    def height(contrast: float, error: float) -> float:
        return max((SIGNIFICANCE + _FOUND) * contrast, _EDGE * limit + error)

    post = height(float(windows.narrow.std.max()) * noise, _FOUND * noise)
    rock = height(_ROCK * float(std[jumps:].max()), _ROCK_ERRORS * left)
    if elevation_map.resolution * _FEW_CELLS > _ROCK_SIZE:
        rock = max(rock, post / _RING)
    step = height(_STEP * float(std[:jumps].max()), _FOUND * beside)
    return SmallestSeen(noise, step, rock, post)
