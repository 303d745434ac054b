"""Terrain, ground, bounds and time-optimal profiles of a batch: the first half of every plan.

Plans of single requests, cycles of the moving horizon and plans under changed assumptions all come
from here; the second half is :mod:`slopewise.planner.pipeline.plan_finalizer`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from slopewise.models.arrays import Bools, Floats, Ints
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.planner.bounds.speed_bounds import SpeedBounds, speed_bounds
from slopewise.planner.compiled_core import core
from slopewise.planner.ground.braking_ground import BrakingGround, GroundConditions, ground_along
from slopewise.planner.ground.terrain_profile import TerrainProfile, terrain_profile
from slopewise.planner.ground.uncertainty import Uncertainty, survived_errors
from slopewise.planner.path import PathBatch
from slopewise.planner.pipeline.band_bounds import BandGround, SideBounds
from slopewise.planner.profile.problems import ProfileProblem, profile_problem
from slopewise.planner.settings import PlannerSettings, Solver
from slopewise.planner.swept.convergence import Departure, is_off_line
from slopewise.planner.swept.hazards import Hazards, HazardSearch
from slopewise.planner.swept.sweeper import SweptPoses
from slopewise.planner.verify.terms import Terms, terms_of

ROUNDING = 1e-9
"""Excess of v² at the start over what service braking can bring down [m²/s²]."""


@dataclass(frozen=True, slots=True)
class TimeOptimalBatch:
    """Time-optimal profiles of M candidates, not verified yet; arrays are (N, M).

    Attributes:
        model, terms: vehicle, braking, limits; and what plans are verified with.
        profile, ground, bounds, problem: what the profiles were made from.
        speed_limit: limits of the paths themselves [m/s], None if none has any.
        start_sq: (M,) v² at the first stations [m²/s²].
        speed_sq: v² [m²/s²].
        reachable_start_sq: (M,) highest v² at the start that service braking can bring down.
        cost: (M,) travel time plus the charge for what is not reached [s].
        hazards: what body and wheels meet.
        solver: that smooths what is emitted.
        around: map and errors that finished plans are verified by; None for what-if questions.
    """

    model: Model
    terms: Terms
    profile: TerrainProfile
    ground: BrakingGround
    bounds: SpeedBounds
    problem: ProfileProblem
    speed_limit: Floats | None
    start_sq: Floats
    speed_sq: Floats
    reachable_start_sq: Floats
    cost: Floats
    hazards: Hazards
    solver: Solver = "interior_point"
    around: BandGround | None = None

    @property
    def reachable(self) -> Bools:
        """(M,) service braking can bring down the speed at the start."""
        reachable: Bools = self.reachable_start_sq >= self.start_sq - ROUNDING
        return reachable

    def side_bounds(self, lanes: Ints) -> SideBounds | None:
        """Bounds of candidates by the ground at the sides of their band; None without a band."""
        if self.around is None or not self.around.has_band:
            return None
        clear = self.bounds.clear_distance[lanes]
        return self.around.bounds(self.profile, self.model, lanes, clear)

    def profile_of(self, j: int) -> Floats:
        """v² of candidate j without padding, (count,) [m²/s²]."""
        return np.ascontiguousarray(self.speed_sq[: self.profile.count[j], j])


class Finalists(Protocol):
    """Candidates of a batch that plans may be made from.

    Attributes:
        expected: indices of the likely ones.
    """

    expected: Ints

    def of(self, solved: TimeOptimalBatch) -> Ints:
        """Their indices; profiles of others ignore the way to them, and are no slower for that."""
        ...


def time_optimal_batch(
    elevation_map: ElevationMap,
    paths: PathBatch,
    model: Model,
    *,
    start_speed: float | Floats = 0.0,
    clear: float | Floats = np.inf,
    settings: PlannerSettings | None = None,
    conditions: GroundConditions | None = None,
    uncertainty: Uncertainty | None = None,
    departure: Departure | None = None,
    finalists: Finalists | None = None,
) -> TimeOptimalBatch:
    """Time-optimal profiles along candidates that are on even stations already.

    Args:
        elevation_map: ground.
        paths: M candidates.
        model: vehicle, braking, limits.
        start_speed: speed at the first station, one for all or (M,) [m/s].
        clear: station up to which the vehicle may come, one for all or (M,) [m].
        settings: weights of the ranking, and who smooths.
        conditions: those of this moment.
        uncertainty: what the plans are to survive; then ``model`` is its cautious one already.
        departure: vehicle pose relative to the candidates; None: it is on all of them.
        finalists: candidates to which the way of the vehicle is swept; None: all.
    """
    profile = terrain_profile(
        elevation_map, paths.x, paths.y, paths.count, model.vehicle, model.steering_geometry
    )
    profile = replace(profile, follower_offset=paths.follower_offset)
    ground = ground_along(profile, model, elevation_map.class_names, conditions, uncertainty)
    errors = survived_errors(model, uncertainty)
    search = HazardSearch.along(elevation_map, profile, model, errors)
    around = BandGround(elevation_map, errors, conditions, uncertainty)

    def solved_with(swept: SweptPoses) -> TimeOptimalBatch:
        return solve(
            profile,
            ground,
            model,
            start_speed=start_speed,
            clear=clear,
            speed_limit=paths.speed_limit,
            settings=settings,
            hazards=search.hazards(swept),
            around=around,
        )

    if departure is None:
        return solved_with(search.line)
    swept, unswept = search.line, is_off_line(profile, departure, model)
    lanes = np.arange(len(unswept)) if finalists is None else finalists.expected
    while True:
        lanes = lanes[unswept[lanes]]
        if len(lanes) > 0:
            unswept[lanes] = False
            swept = search.sweeper.with_convergence(swept, profile, departure, lanes)
        solved = solved_with(swept)
        lanes = np.flatnonzero(unswept) if finalists is None else finalists.of(solved)
        if not unswept[lanes].any():
            return solved


def solve(
    profile: TerrainProfile,
    ground: BrakingGround,
    model: Model,
    *,
    start_speed: float | Floats,
    clear: float | Floats,
    speed_limit: Floats | None,
    settings: PlannerSettings | None = None,
    hazards: Hazards | None = None,
    holds_anywhere: bool = False,
    around: BandGround | None = None,
) -> TimeOptimalBatch:
    """Time-optimal profiles on ground that was sampled before.

    Args:
        profile: terrain under the wheels of M candidates; ground: braking along them.
        model: vehicle, braking, limits.
        start_speed: speed at the first station, one for all or (M,) [m/s].
        clear: station up to which the vehicle may come, one for all or (M,) [m].
        speed_limit: (N, M) limits of the paths themselves [m/s].
        settings: weights of the ranking.
        hazards: what body and wheels meet; none if omitted.
        holds_anywhere: for what-if questions: a vehicle at rest is held on any slope.
        around: see the batch.
    """
    candidates = len(profile.count)
    terms = terms_of(model, ground.motion, ground.errors)
    start_sq = np.full(candidates, np.square(start_speed), np.float64)
    bounds = speed_bounds(
        profile,
        ground,
        model,
        np.full(candidates, clear, np.float64),
        speed_limit,
        hazards,
        holds_anywhere=holds_anywhere,
    )
    ground = bounds.ground
    problem = profile_problem(profile, ground, bounds, terms.limits, start_sq)
    speed_sq, reachable = core.time_optimal(problem)
    # No plan is slowed down for a start that is too fast by rounding alone.
    speed_sq[0] = np.where(reachable >= start_sq - ROUNDING, start_sq, speed_sq[0])
    settings = settings or PlannerSettings()
    cost = core.travel_cost(profile.station, speed_sq, settings.horizon_penalty)
    return TimeOptimalBatch(
        model,
        terms,
        profile,
        ground,
        bounds,
        problem,
        speed_limit,
        start_sq,
        speed_sq,
        reachable,
        cost,
        hazards or Hazards(),
        settings.solver,
        around,
    )
