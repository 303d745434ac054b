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
from slopewise.models.height_noise import EXACT, SIGNIFICANCE, estimated_noise_of, noise_of
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
    return seen_at(vehicle, noise, elevation_map.resolution, elevation_map.correlation_length)


def seen_at(
    vehicle: Vehicle, noise: float, resolution: float, correlation: float = 0.0
) -> SmallestSeen:
    """Smallest obstacles that cells of a size show at a noise; lengths [m]."""
    windows = averaging_windows(resolution, vehicle.wheel_radius, correlation)
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


TOO_HIGH = 2.0
"""Height of the lowest step that is seen, in steps that the vehicle may climb, beyond which a map
is too noisy to drive on at full speed [1]: what may be missed is as high as the limit again."""

_MISSTATED = 1.2
"""Ratio of the scatter of heights to the error stated, or the inverse, that is told [1]: estimates
are within a few percent on smooth ground."""


def hides_steps(seen: SmallestSeen | None, vehicle: Vehicle) -> bool:
    """Whether steps far beyond what the vehicle climbs may be missed."""
    return seen is not None and seen.step > TOO_HIGH * vehicle.shape.max_step


def careful_speed(wheel_radius: float, vertical_accel: float) -> float:
    """Speed at which a step that nobody saw is climbed with no more than so much acceleration.

    The centre of a wheel runs on a circle around the edge of a step: v² / R [m/s²], R its radius.
    """
    return math.sqrt(vertical_accel * wheel_radius)


def sight_notes(elevation_map: ElevationMap, vehicle: Vehicle) -> tuple[str, ...]:
    """What readers of plans have to know of the error of a map, in sentences."""
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


def misstated(elevation_map: ElevationMap) -> str:
    """How the error that a map states differs from the scatter of its heights; empty if not."""
    stated = elevation_map.height_std
    if elevation_map.height_std_is_assumed or stated <= EXACT:
        return ""
    scatter = estimated_noise_of(elevation_map)
    differs = f"the map states an error of {stated:.3f} m, its heights scatter by {scatter:.3f} m"
    if scatter > _MISSTATED * stated:
        return f"{differs}: rough ground, or a larger error than stated"
    if _MISSTATED * scatter < stated and elevation_map.correlation_length <= 0.0:
        return f"{differs}: a smaller error, or one that neighbouring cells share"
    return ""
