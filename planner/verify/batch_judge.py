"""The judge on all candidates of a batch at once: valid or not.

The same judge as of a plan that is emitted (:mod:`planner.verify.judge`), without the columns of a
plan file.
"""

from __future__ import annotations

import numpy as np

from models.effects import registry
from models.effects.registry import MotionTerms
from models.parameters import Model
from planner.bounds.speed_bounds import SpeedBounds
from planner.ground.braking_ground import BrakingGround
from planner.ground.terrain_profile import TerrainProfile
from planner.kernels.compiled import Floats, Ints, kernel
from planner.kernels.limits import PlanningLimits, planning_limits
from planner.verify.judge import BETWEEN, TIME_STEP, Violations, judge_track
from planner.verify.track import Body, Track, body_of, copy_columns, survey_of


def screen(
    profile: TerrainProfile, ground: BrakingGround, bounds: SpeedBounds, speed_sq: Floats, model: Model,
    speed_limit: Floats | None = None,
) -> Floats:  # fmt: skip
    """Judge M profiles of up to N stations.

    Args:
        profile, ground, bounds: of the batch.
        speed_sq: (N, M) v² [m²/s²].
        model: vehicle and limits.
        speed_limit: (N, M) limits of the paths themselves [m/s].

    Returns:
        (M, 8) worst breaches in the order of :class:`planner.verify.judge.Violations`, 0 where none.
    """
    candidates = speed_sq.shape[1]
    worst = np.zeros((candidates, len(Violations._fields)))
    limit = ground.fastest if speed_limit is None else np.minimum(ground.fastest, speed_limit)
    in_time = ground.motion != registry.NO_MOTION._replace(heat=ground.motion.heat)
    _screen(
        profile.count, profile.station, profile.grade, profile.sin_roll, profile.curvature,
        profile.heading_x, profile.heading_y, ground.lower_slope, ground.lower_intercept,
        ground.upper_slope, ground.upper_intercept, ground.dead_time, ground.slowest, limit,
        speed_sq, bounds.clear_distance, ground.distance_offset, body_of(model), planning_limits(model),
        ground.motion, in_time, BETWEEN, TIME_STEP, worst,
    )  # fmt: skip
    return worst


@kernel
def _screen(
    count: Ints, station: Floats, grade: Floats, sin_roll: Floats, curvature: Floats, heading_x:
    Floats, heading_y: Floats, lower_slope: Floats, lower_intercept: Floats, upper_slope: Floats,
    upper_intercept: Floats, dead_time: Floats, slowest: Floats, speed_limit: Floats, speed_sq:
    Floats, clear: Floats, offset: Floats, body: Body, n: PlanningLimits, motion: MotionTerms,
    in_time: bool, between: int, h: float, worst: Floats,
) -> None:  # fmt: skip
    stations, candidates = station.shape
    column, memory = np.empty((13, stations)), np.empty((8, stations))
    answers = np.empty((3, stations))
    bad = np.zeros(stations, np.bool_)
    for j in range(candidates):
        m = count[j]
        copy_columns(
            0, j, m, station, grade, sin_roll, curvature, heading_x, heading_y, lower_slope,
            lower_intercept, upper_slope, upper_intercept, dead_time, slowest, speed_limit,
            motion.moves, column,
        )  # fmt: skip
        for k in range(m):
            column[12, k] = speed_sq[k, j]
        track = Track(
            column[0, :m], column[1, :m], column[2, :m], column[3, :m], column[4, :m],
            column[5, :m], column[6, :m], column[7, :m], column[8, :m], column[9, :m],
            column[10, :m], column[11, :m],
        )  # fmt: skip
        survey = survey_of(track, body, memory)
        judge_track(
            track, body, n, motion, in_time, column[12, :m], clear[j], offset[j], between, h,
            False, survey, answers[0], answers[1], answers[2], worst[j], bad,
        )  # fmt: skip
