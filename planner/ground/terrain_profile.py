"""Ground along each candidate: grade, roll and surface under the wheels.

Heights are taken where the four wheels rest, not from the gradient at a point: a ditch narrower
than the wheelbase tilts a vehicle less than its banks are steep, and a gap that a wheel bridges
does not tilt it. Twist (one wheel off the plane of the other three) is left to the suspension.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Bools, Floats, Ints, Singles
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.steering import SteeringGeometry
from slopewise.models.vehicle import Vehicle
from slopewise.planner.compiled_core import core
from slopewise.planner.ground.height_grid import height_grid

_NEVER_OFF = SteeringGeometry()
"""Of a vehicle whose middle is on the path, and whose heading is that of the path."""


class BodyRows(NamedTuple):
    """Middle of the wheelbase [m] and unit vector of the body's heading, (N, M) each."""

    x: Floats
    y: Floats
    heading_x: Floats
    heading_y: Floats


@dataclass(frozen=True, slots=True)
class TerrainProfile:
    """Terrain along M candidates of up to N stations, station-major: arrays are (N, M).

    Attributes:
        count: (M,) stations that each candidate has; rows beyond are padding.
        x, y, z: position of the path and height that a wheel there would have [m]; unknown heights
            repeat the last known, or the first.
        station: distance along the ground, three-dimensional [m].
        heading_x, heading_y: unit vector of travel in the plan view.
        curvature: plan-view curvature, left turns positive [1/m].
        grade: uphill positive [rad], 0 where unknown.
        sin_grade, sin_roll: sines of grade and roll (left side up positive), 0 where unknown.
        vertical_curvature: dθ/ds of the sharper crest of the segments around each station, where
            neither falls away of the sharper dip; negative over a crest [1/m].
        known: all ground under path and wheels is known.
        surfaces: bits of the terrain classes under path and wheels.
        height_std: error of the map's heights against each other [m], one number.
        twist: how far the surface under the front left wheel or the one across from it is above the
            plane of the others [m], float32; NaN where unknown.
        front: (N, 2, M) surface under the front wheels, left and right, above z of the first
            station [m], float32; what is unknown repeats the last known, or 0.
        body: pose of the body.
        follower_offset: (N, M) distance from the path, to either side, of a vehicle that follows
            what was given for it [m], None where that is the path itself.
    """

    count: Ints
    x: Floats
    y: Floats
    z: Floats
    station: Floats
    heading_x: Floats
    heading_y: Floats
    curvature: Floats
    grade: Floats
    sin_grade: Floats
    sin_roll: Floats
    vertical_curvature: Floats
    known: Bools
    surfaces: Ints
    twist: Singles
    front: Singles
    body: BodyRows
    height_std: float = 0.0
    follower_offset: Floats | None = None

    @property
    def roll(self) -> Floats:
        """Roll, left side up positive [rad], (N, M)."""
        return np.arcsin(self.sin_roll)


def terrain_profile(
    elevation_map: ElevationMap,
    x: Floats,
    y: Floats,
    count: Ints,
    vehicle: Vehicle,
    steering: SteeringGeometry = _NEVER_OFF,
    heading: tuple[Floats, Floats] | None = None,
) -> TerrainProfile:
    """Sample an elevation map under the wheels along candidate paths.

    Args:
        elevation_map: heights; unknown cells are NaN.
        x, y: (N, M) positions of the reference point [m], C-contiguous.
        count: (M,) number of stations of each candidate, at least 3.
        vehicle: with the sizes of its wheels.
        steering: how body and path belong together.
        heading: unit vector of the body's heading where it does not follow from the path, (N, M)
            each, C-contiguous.
    """
    length, width = vehicle.wheelbase, vehicle.track_width
    rows, known, twist, front = height_grid(elevation_map, vehicle).sample_ground(
        x, y, count, steering.centre_offset, steering.body_offset, length, width, heading
    )
    z, station, heading_x, heading_y, curvature, grade, sin_grade, sin_roll, crests = rows[:9]
    body = BodyRows(*rows[9:]) if len(rows) > 9 else BodyRows(x, y, heading_x, heading_y)
    surfaces: Ints = np.broadcast_to(np.int64(1), x.shape)
    if elevation_map.terrain_class is not None:
        surfaces = core.surface_bits(
            elevation_map.terrain_class,
            *elevation_map.origin,
            1.0 / elevation_map.resolution,
            body,
            0.5 * length,
            0.5 * width,
        )
    return TerrainProfile(
        count,
        x,
        y,
        z,
        station,
        heading_x,
        heading_y,
        curvature,
        grade,
        sin_grade,
        sin_roll,
        crests,
        known,
        surfaces,
        twist,
        front,
        body,
        elevation_map.height_std,
    )
