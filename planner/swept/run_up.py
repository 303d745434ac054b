"""Ground behind the first station: what the body comes over still moves it there."""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Floats, Singles
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.vehicle import Vehicle
from slopewise.planner.ground.height_grid import height_grid
from slopewise.planner.ground.terrain_profile import TerrainProfile


def ground_behind(
    elevation_map: ElevationMap,
    profile: TerrainProfile,
    stations: int,
    spacing: Floats,
    vehicle: Vehicle,
) -> Singles:
    """Ground under the front wheels of a vehicle that came straight to the first station.

    Args:
        elevation_map: ground. profile: M candidates on it.
        stations: B. spacing: (M,) distance between them [m].
        vehicle: with its wheels.

    Returns:
        (B, 2, M) left and right, the first one farthest behind, as ``profile.front`` [m].
    """
    behind = np.empty((stations, *profile.front.shape[1:]), np.float32)
    body = profile.body_rows
    height_grid(elevation_map, vehicle).ground_behind(
        body.x[0],
        body.y[0],
        body.heading_x[0],
        body.heading_y[0],
        spacing,
        profile.z[0],
        profile.front[0],
        vehicle.wheelbase,
        vehicle.track_width,
        behind,
    )
    return behind
