"""Verifier of all candidates of a batch together: valid or not.

The same judge as of a plan that is emitted (:mod:`slopewise.planner.verify.judge`), without the
columns of a plan file.
"""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.parameters import Model
from slopewise.planner.bounds.speed_bounds import SpeedBounds
from slopewise.planner.compiled_core import core
from slopewise.planner.ground.braking_ground import BrakingGround
from slopewise.planner.ground.terrain_profile import TerrainProfile
from slopewise.planner.verify.judge import Violations
from slopewise.planner.verify.terms import terms_of
from slopewise.planner.verify.track import track_rows


def screen(
    profile: TerrainProfile,
    ground: BrakingGround,
    bounds: SpeedBounds,
    speed_sq: Floats,
    model: Model,
    speed_limit: Floats | None = None,
    rough_speed: Floats | None = None,
) -> Floats:
    """Judge M profiles of up to N stations.

    Args:
        profile, ground, bounds: of the batch.
        speed_sq: (N, M) v² [m²/s²].
        model: vehicle and limits.
        speed_limit: (N, M) limits of the paths themselves [m/s].
        rough_speed: (N, M) limits of rough ground [m/s].

    Returns:
        (M, 19) worst breaches in the order of :class:`slopewise.planner.verify.judge.Violations`, 0
        where there is none.
    """
    worst = np.zeros((speed_sq.shape[1], len(Violations._fields)))
    limit = ground.fastest
    for own in (speed_limit, rough_speed):
        limit = limit if own is None or own.size == 0 else np.minimum(limit, own)
    core.verify_batch(
        *track_rows(profile, ground, limit),
        speed_sq,
        bounds.clear_distance,
        ground.distance_offset,
        terms_of(model, ground.motion, ground.errors, all_loads=False),
        worst,
    )
    return worst
