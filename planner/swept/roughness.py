"""How fast rough ground may be driven, by a quarter car rolled over the candidates.

`planner/core/swept/roughness.hpp` and `quarter_car.hpp` have the equations.
"""

from __future__ import annotations

from slopewise.models.arrays import Floats
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.height_noise import noise_of
from slopewise.models.parameters import Model
from slopewise.planner.compiled_core import core
from slopewise.planner.ground.height_grid import height_grid
from slopewise.planner.ground.terrain_profile import TerrainProfile
from slopewise.planner.swept.sizes import SweptSizes


def rough_speeds(
    elevation_map: ElevationMap,
    profile: TerrainProfile,
    model: Model,
    sizes: SweptSizes,
    spacing: Floats,
) -> Floats:
    """Highest speeds that keep the vertical acceleration within its limit.

    Args:
        elevation_map: ground; what lies behind the first station still moves the body there. On
            cells larger than a wheel's radius, which are not averaged, kinks that noise alone would
            make limit nothing.
        profile: M candidates of up to N stations on it.
        model: vehicle and limits.
        sizes: vehicle sizes on this map.
        spacing: (M,) distance between the stations of each candidate [m].

    Returns:
        (N, M) [m/s], inf where roughness limits nothing.
    """
    vehicle, limits = model.vehicle, model.limits
    noise = 0.0 if sizes.fine else noise_of(elevation_map)
    bounce = vehicle.ride_frequency, vehicle.ride_damping
    ride = *bounce, limits.vertical_accel, limits.speed, noise, elevation_map.resolution
    grid = height_grid(elevation_map, vehicle)
    return core.roughness_speeds(grid, profile, spacing, sizes, ride)
