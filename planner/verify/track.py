"""One candidate as the verifier walks it: its stations, contiguous and without padding."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.planner.compiled_core import core
from slopewise.planner.ground.braking_ground import BrakingGround
from slopewise.planner.ground.terrain_profile import TerrainProfile


class Track(NamedTuple):
    """One candidate as the verifier walks it; arrays are (N,) over its stations.

    Attributes:
        station, grade, roll, curvature, yaw: geometry; yaw without jumps.
        lower_slope, lower_intercept, upper_slope, upper_intercept, dead_time, slowest: those of
            the ground.
        speed_limit: of path, trained range and rough ground [m/s].
        vertical_curvature: change of the grade, negative over a crest [1/m].
        friction: the ground's, inf where it is not known [1].
    """

    station: Floats
    grade: Floats
    roll: Floats
    curvature: Floats
    yaw: Floats
    lower_slope: Floats
    lower_intercept: Floats
    upper_slope: Floats
    upper_intercept: Floats
    dead_time: Floats
    slowest: Floats
    speed_limit: Floats
    vertical_curvature: Floats
    friction: Floats


def track_of(
    profile: TerrainProfile,
    ground: BrakingGround,
    candidate: int,
    speed_limit: Floats | None = None,
    first: int = 0,
) -> Track:
    """One candidate from a batch, without its first stations.

    Args:
        profile, ground: those of the batch.
        candidate: its index.
        speed_limit: (N, M) limits of the paths themselves [m/s].
        first: stations at the beginning that are omitted.
    """
    n = int(profile.count[candidate])
    track = Track(*core.copy_track(profile, ground, ground.fastest, candidate, first))
    if speed_limit is not None:
        np.minimum(track.speed_limit, speed_limit[first:n, candidate], out=track.speed_limit)
    return track
