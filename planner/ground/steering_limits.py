"""Turns that the steering cannot make: too tight at any speed, or too sudden for the speed."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Bools, Floats
from slopewise.models.steering import SteeringGeometry, steering_angle
from slopewise.planner.ground.terrain_profile import TerrainProfile

_CURVATURE_TOLERANCE = 0.01
"""Share by which a curvature may exceed the largest one [1]: stations are on a curve, the chords
between them inside it."""

_MIN_STEP = 1e-6
"""Stations nearer to each other are one: padding [m]."""


class SteeringLimits(NamedTuple):
    """Limits along M candidates of up to N stations.

    Attributes:
        curvature: (N, M) curvature that the steering has to give the reference point [1/m].
        blocked: (N, M) more of it than the vehicle has.
        speed: (N, M) highest speed at which the steering follows [m/s].
    """

    curvature: Floats
    blocked: Bools
    speed: Floats


def steering_limits(profile: TerrainProfile, steering: SteeringGeometry) -> SteeringLimits | None:
    """Limits by least radius and steering rate; None where the steering has neither.

    With the reference point ahead of the steering centre the angle β between path and body says how
    the wheels are turned, κ = sin β / e; otherwise the curvature of the path does. The first
    station, where the vehicle stands, is blocked by nothing.
    """
    if math.isinf(steering.max_curvature) and math.isinf(steering.max_rate):
        return None
    curvature, offset = profile.curvature, steering.centre_offset
    if offset > 0.0:
        body = profile.body
        sine = body.heading_x * profile.heading_y - body.heading_y * profile.heading_x
        curvature = sine / offset
    blocked = np.abs(curvature) > (1.0 + _CURVATURE_TOLERANCE) * steering.max_curvature
    blocked[0] = False
    speed = np.full_like(curvature, np.inf)
    if math.isfinite(steering.max_rate):
        angle = steering_angle(curvature, steering)
        step = np.hypot(np.diff(profile.x, axis=0), np.diff(profile.y, axis=0))
        turned = np.abs(np.diff(angle, axis=0))
        with np.errstate(divide="ignore", invalid="ignore"):
            segment = np.where(step > _MIN_STEP, steering.max_rate * step / turned, np.inf)
        speed[:-1] = segment
        np.minimum(speed[1:], segment, out=speed[1:])
    return SteeringLimits(curvature, blocked, speed)
