"""Height grids of the last few maps and vehicles: contact heights of a map are tabulated once.

The contact height of a wheel is that of its lowest point when its tyre rests on the ground; where
cells are larger than the wheel's radius, that of the surface under it. `planner/core/` tabulates.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.recent import Recent
from slopewise.models.vehicle import Vehicle
from slopewise.planner.compiled_core import core


class Footprint(NamedTuple):
    """Rectangle under a tyre that it may rest on.

    Attributes:
        half_length: half its length, up to where the rim is above any step it may climb [m].
        half_width: half its width [m].
        radius: wheel radius [m]; 0 where a wheel rests on a point.
    """

    half_length: float
    half_width: float
    radius: float


_grids: Recent[core.HeightGrid] = Recent()


def tyre_footprint(vehicle: Vehicle, resolution: float) -> Footprint:
    """Footprint of the tyres of a vehicle on cells of this size [m].

    Heights between cells are those of the cells around, whose footprints reach a cell farther: by
    half of one less across, a tyre rests on nothing beyond half a cell next to it.
    """
    radius, shape = vehicle.wheel_radius, vehicle.shape
    if resolution > radius:
        return Footprint(0.0, 0.0, 0.0)
    half_length = math.sqrt(radius**2 - max(radius - shape.max_step, 0.0) ** 2)
    half_width = max(0.5 * (shape.wheel_width - resolution), 0.0)
    return Footprint(half_length, half_width, radius)


def height_grid(elevation_map: ElevationMap, vehicle: Vehicle) -> core.HeightGrid:
    """Heights of this map, which never changes, as the wheels of a vehicle rest on them."""
    footprint = tyre_footprint(vehicle, elevation_map.resolution)
    heights, resolution = elevation_map.elevation, elevation_map.resolution
    return _grids.get(
        lambda: core.HeightGrid(heights, *elevation_map.origin, resolution, *footprint),
        elevation_map,
        footprint,
    )
