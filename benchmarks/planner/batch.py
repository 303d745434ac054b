"""Times of the planner's stages on a batch of candidates, compared with the lower bound."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from slopewise.planner.bounds.speed_bounds import speed_bounds
from slopewise.planner.ground.braking_ground import ground_along
from slopewise.planner.ground.terrain_profile import TerrainProfile, terrain_profile
from slopewise.planner.kernels.limits import planning_limits
from slopewise.planner.pipeline.time_optimal_batch import TimeOptimalBatch, solve
from slopewise.planner.profile.time_optimal import (
    profile_problem,
    time_optimal_profile,
    travel_cost,
)
from slopewise.planner.swept.hazards import swept_hazards

from ..common.scene import SPACING, BenchmarkScene
from ..common.timing import interleave, summary
from .lower_bound_passes import braking_pass, plain_pass

_UNBOUNDED = 1e3
"""Service deceleration that never binds, so that the brakes limit everywhere [m/s²]."""

_HORIZON_PENALTY = 2.0
"""Time charged for each metre not reached; its size does not change the time measured [s/m]."""

Result = dict[str, Any]


def stages(scene: BenchmarkScene, solved: TimeOptimalBatch) -> dict[str, Callable[[], object]]:
    """The planner's stages and the two passes, each on the same batch."""
    model = scene.model
    profile, ground, bounds = solved.profile, solved.ground, solved.bounds
    scalars, limits = planning_limits(model), model.limits
    candidates = scene.x.shape[1]
    clear, start = np.full(candidates, np.inf), np.zeros(candidates)
    out = np.empty_like(solved.speed_sq)

    def terrain() -> TerrainProfile:
        size = (model.vehicle.wheelbase, model.vehicle.track_width)
        return terrain_profile(scene.elevation_map, scene.x, scene.y, scene.count, *size)

    def fastest(decel: float) -> object:
        problem = profile_problem(profile, ground, bounds, scalars, start)
        return time_optimal_profile(problem._replace(decel=decel))

    def without_sweep() -> object:
        ahead = terrain()
        braking = ground_along(ahead, model)
        plans = solve(ahead, braking, model, start_speed=0.0, clear=np.inf, speed_limit=None)
        return np.argsort(plans.cost)

    def by_bounds() -> None:
        plain_pass(bounds.speed_sq_max, SPACING, limits.accel, limits.decel, out)

    def by_brakes() -> None:
        braking_pass(
            bounds.speed_sq_max,
            profile.station,
            profile.grade,
            profile.sin_grade,
            model.braking,
            limits.accel,
            limits.decel,
            out,
        )

    return {
        "plain pass": by_bounds,
        "pass with braking": by_brakes,
        "terrain": terrain,
        "ground": lambda: ground_along(profile, model),
        "bounds": lambda: speed_bounds(profile, ground, model, clear),
        "profile": lambda: fastest(limits.decel),
        "profile, brakes decide": lambda: fastest(_UNBOUNDED),
        "cost": lambda: travel_cost(profile.station, solved.speed_sq, _HORIZON_PENALTY),
        "swept footprint": lambda: swept_hazards(scene.elevation_map, profile, model),
        "poses to ranked plans": lambda: np.argsort(scene.plan().cost),
        "the same without the swept footprint": without_sweep,
    }


def in_batch(scene: BenchmarkScene, rounds: int) -> list[Result]:
    """Times of all stages, and their ratios to both passes."""
    seconds = interleave(stages(scene, scene.plan()), rounds)
    passes = {
        "to_plain": summary(seconds["plain pass"]),
        "to_braking": summary(seconds["pass with braking"]),
    }
    rows = []
    for name, values in seconds.items():
        row: Result = {"name": name, **summary(values)}
        row["per_station"] = row["median"] / scene.x.size
        for key, reference in passes.items():
            row[key] = row["median"] / reference["median"]
            row[f"{key}_least"] = row["min"] / reference["min"]
        rows.append(row)
    return rows
