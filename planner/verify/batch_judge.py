"""The judge on all candidates of a batch at once: valid or not.

The same judge as of a plan that is emitted (:mod:`slopewise.planner.verify.judge`), without the
columns of a plan file.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.parameters import Model
from slopewise.planner.bounds.speed_bounds import SpeedBounds
from slopewise.planner.ground.braking_ground import BrakingGround
from slopewise.planner.ground.forces import Forces
from slopewise.planner.ground.terrain_profile import TerrainProfile, TerrainRows
from slopewise.planner.kernels.compiled import kernel
from slopewise.planner.verify.judge import JudgedPlan, JudgeNotes, Violations, judge_track, terms_of
from slopewise.planner.verify.track import Terms, Track, copy_columns, survey_of


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
        (M, 13) worst breaches in the order of :class:`slopewise.planner.verify.judge.Violations`, 0
        where there is none.
    """
    worst = np.zeros((speed_sq.shape[1], len(Violations._fields)))
    limit = ground.fastest
    for own in (speed_limit, rough_speed):
        limit = limit if own is None or own.size == 0 else np.minimum(limit, own)
    friction = np.empty((0, 0)) if ground.friction is None else ground.friction
    batch = ProfileBatch(
        profile.rows,
        ground.forces._replace(fastest=limit),
        friction,
        speed_sq,
        bounds.clear_distance,
    )
    _screen(batch, terms_of(model, ground.motion, ground.errors, all_loads=False), worst)
    return worst


class ProfileBatch(NamedTuple):
    """M profiles to be judged; (N, M), friction (0, 0) if unknown, the clear distance (M,) [m]."""

    terrain: TerrainRows
    forces: Forces
    friction: Floats
    speed_sq: Floats
    clear_distance: Floats


@kernel
def _screen(batch: ProfileBatch, terms: Terms, worst: Floats) -> None:
    terrain, forces = batch.terrain, batch.forces
    stations, candidates = terrain.station.shape
    column, memory = np.empty((15, stations)), np.empty((8, stations))
    answers = np.empty((3, stations))
    bad = np.zeros(stations, np.bool_)
    turns = terms.motion.moves
    for j in range(candidates):
        m = terrain.counts[j]
        copy_columns(0, j, terrain, forces, batch.friction, turns, column)
        for k in range(m):
            column[14, k] = batch.speed_sq[k, j]
        track = Track(
            column[0, :m],
            column[1, :m],
            column[2, :m],
            column[3, :m],
            column[4, :m],
            column[5, :m],
            column[6, :m],
            column[7, :m],
            column[8, :m],
            column[9, :m],
            column[10, :m],
            column[11, :m],
            column[12, :m],
            column[13, :m],
        )
        survey = survey_of(track, terms.body, memory)
        plan = JudgedPlan(
            track,
            survey,
            track,
            survey,
            column[14, :m],
            batch.clear_distance[j],
            forces.distance_offset[j],
        )
        judge_track(plan, terms, JudgeNotes(answers[0], answers[1], answers[2], worst[j], bad))
