"""Places of a body on the map, and the plane nearest to its wheels."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.vehicle import Vehicle

WHEELS = np.array([(0.5, 0.5), (0.5, -0.5), (-0.5, 0.5), (-0.5, -0.5)])
"""Front left, front right, rear left, rear right: wheelbases ahead, track widths to the left."""


def points_of(
    pose: Iterable[Floats], ahead: Floats | float, left: Floats | float
) -> tuple[Floats, Floats]:
    """Points ahead and to the left of bodies at x, y with cos and sin of a heading; broadcasts."""
    x, y, cos, sin = pose
    return x + ahead * cos - left * sin, y + ahead * sin + left * cos


def wheel_places(vehicle: Vehicle, pose: Sequence[Floats]) -> tuple[Floats, Floats]:
    """Places (4, …) of the wheels of bodies (…) [m], in the order of :data:`WHEELS`."""
    ahead, left = WHEELS.T.reshape(2, 4, *(1,) * np.ndim(pose[0]))
    return points_of(pose, vehicle.wheelbase * ahead, vehicle.track_width * left)


def plane_of(wheels: Floats, vehicle: Vehicle) -> tuple[Floats, Floats]:
    """Rise ahead and to the left [1] of the plane nearest to heights (4, …) under the wheels [m].

    It rises by the mean of front minus rear over the wheelbase, and likewise across.
    """
    front_left, front_right, rear_left, rear_right = wheels
    ahead = 0.5 * (front_left + front_right) - 0.5 * (rear_left + rear_right)
    across = 0.5 * (front_left + rear_left) - 0.5 * (front_right + rear_right)
    return ahead / vehicle.wheelbase, across / vehicle.track_width
