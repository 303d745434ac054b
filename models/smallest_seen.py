"""Lowest step, rock and post that a noisy map shows to a vehicle.

An obstacle is detected where it exceeds the vehicle's limit by the remainder of the noise after
averaging, and where its contrast is significant. Lower ones may be missed, and are reported.

Three shares are measured (``slopewise bench noise``), as no formula gives them:

- Averaging next to an edge lowers a height near the limit by up to 15 %, with very little noise,
  too. Four standard deviations of a mean are added, as a wheel meets an obstacle between two.
- A step needs 0.55 of the height that its contrast needs: one that is averaged becomes a ramp as
  long as the disc, which a tyre still has to climb, with the noise on it. Heights that scatter by
  less than the map states lack that noise: there a step needs 1.3 times the height that it needs
  without this share.
- A rock needs 1.25 times that height: its outline fits neither the directions of ridges nor the
  squares, so that a part of it is averaged with the ground around it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from slopewise.models.averaging_windows import averaging_windows
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.height_noise import EXACT, SIGNIFICANCE, averaged_noise, estimated_noise_of
from slopewise.models.vehicle import Vehicle

TOO_HIGH = 3.0
"""Ratio of the lowest step that is detected to the highest that may be climbed, above which a map
is too noisy to drive on at full speed [1]: by default a step as high as a wheel's radius."""

_MISSTATED = 1.2
"""Ratio of the scatter of heights to the error stated, or the inverse, that is reported [1]:
estimates are within a few percent on smooth ground."""

_MARGIN = 3.0
"""Standard deviations of the noise by which 98 % of higher obstacles are detected [1]."""

_EDGE, _ERRORS, _STEP, _OVERSTATED, _ROCK = 1.15, 4.0, 0.55, 1.3, 1.25
"""Measured [1]: share of the limit, standard deviations of a mean, shares of a contrast."""

_ROCK_SIZE, _FEW_CELLS, _RING = 0.3, 2.5, 0.87
"""Edge of a rock [m]; cells along it up to which they are single posts to averaging, with this
share of their height over the cells around, some of which are the rock as well [1]."""


class SmallestSeen(NamedTuple):
    """Heights from which 98 % are detected [m].

    Attributes:
        noise: standard deviation of the map's errors [m].
        step: a step, a drop, a log as long as a wheel's radius, a ditch into which a wheel fits.
        rock: a rock of 0.3 m, or a hole into which a wheel fits.
        post: one cell.
    """

    noise: float
    step: float
    rock: float
    post: float


def smallest_seen(elevation_map: ElevationMap, vehicle: Vehicle) -> SmallestSeen | None:
    """Smallest obstacles that a map shows to a vehicle; None where no noise hides any."""
    scattered, even = _seen(elevation_map, vehicle)
    return even if even is not None and _scatters_less(elevation_map) else scattered


def _seen(
    elevation_map: ElevationMap, vehicle: Vehicle
) -> tuple[SmallestSeen, SmallestSeen] | tuple[None, None]:
    """Smallest obstacles where heights scatter as the map states, and where by less."""
    noise = averaged_noise(elevation_map, vehicle.wheel_radius)
    if noise == 0.0:
        return None, None
    facts = vehicle, noise, elevation_map.resolution, elevation_map.correlation_length
    even = seen_at(*facts, step_share=1.0)
    return seen_at(*facts), even._replace(step=_OVERSTATED * even.step)


def seen_at(
    vehicle: Vehicle,
    noise: float,
    resolution: float,
    correlation: float = 0.0,
    step_share: float = _STEP,
) -> SmallestSeen:
    """Smallest obstacles that cells of a size show at a noise; lengths [m].

    ``step_share``: of the height that its contrast needs, which shows a step [1].
    """
    windows = averaging_windows(resolution, vehicle.wheel_radius, correlation)
    limit = vehicle.shape.max_step
    std = windows.wide.std * noise * windows.block_std
    jumps = windows.wide.slopes.shape[1]
    std_rock = noise * math.sqrt(float(windows.variance[-2]))
    std_step = noise * math.sqrt(float(windows.variance[:-1].min()))

    def height(contrast: float, error: float) -> float:
        return max((SIGNIFICANCE + _MARGIN) * contrast, _EDGE * limit + error)

    post = height(float(windows.narrow.std.max()) * noise, _MARGIN * noise)
    rock = height(_ROCK * float(std[jumps:].max()), _ERRORS * std_rock)
    if resolution * _FEW_CELLS > _ROCK_SIZE:
        rock = max(rock, post / _RING)
    step = height(step_share * float(std[:jumps].max()), _ERRORS * std_step)
    return SmallestSeen(noise, step, rock, post)


def hides_steps(elevation_map: ElevationMap, vehicle: Vehicle) -> bool:
    """Return True if steps far beyond the vehicle's limit may be missed.

    Heights are examined only where their scatter decides: planning asks for each new map.
    """
    scattered, even = _seen(elevation_map, vehicle)
    if scattered is None or even is None:
        return False
    highest = TOO_HIGH * vehicle.shape.max_step
    if (scattered.step > highest) == (even.step > highest):
        return scattered.step > highest
    return (even if _scatters_less(elevation_map) else scattered).step > highest


def careful_speed(wheel_radius: float, vertical_accel: float) -> float:
    """Speed at which a step that was missed is climbed within a vertical acceleration.

    The centre of a wheel runs on a circle around the edge of a step: v² / R [m/s²], R its radius.
    """
    return math.sqrt(vertical_accel * wheel_radius)


def sight_notes(elevation_map: ElevationMap, vehicle: Vehicle) -> tuple[str, ...]:
    """Notes on the error of a map for readers of plans, in sentences."""
    if elevation_map.resolution > vehicle.wheel_radius:
        return ()
    notes = []
    seen = smallest_seen(elevation_map, vehicle)
    if seen is not None:
        kind = "from the heights" if elevation_map.height_std_is_assumed else "stated"
        notes.append(
            f"noise of the map {seen.noise:.3f} m ({kind}): steps lower than {seen.step:.2f} m, "
            f"rocks lower than {seen.rock:.2f} m and posts of one cell lower than "
            f"{seen.post:.2f} m may be missed; the highest step is {vehicle.shape.max_step:.3g} m"
        )
    return (*notes, *filter(None, [misstated(elevation_map)]))


def _scatters_less(elevation_map: ElevationMap) -> bool:
    """Heights scatter by less than independent errors of the size that the map states."""
    stated = elevation_map.height_std
    if elevation_map.height_std_is_assumed or elevation_map.correlation_length > 0.0:
        return False
    return stated > EXACT and _MISSTATED * estimated_noise_of(elevation_map) < stated


def misstated(elevation_map: ElevationMap) -> str:
    """Difference of the error that a map states from the scatter of its heights; empty if small."""
    stated = elevation_map.height_std
    if elevation_map.height_std_is_assumed or stated <= EXACT:
        return ""
    scatter = estimated_noise_of(elevation_map)
    differs = f"the map states an error of {stated:.3f} m, its heights scatter by {scatter:.3f} m"
    if scatter > _MISSTATED * stated:
        return f"{differs}: rough ground, or a larger error than stated"
    if _scatters_less(elevation_map):
        return f"{differs}: a smaller error, or one that neighbouring cells share"
    return ""
