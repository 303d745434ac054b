"""The planner's stages on a batch of candidates, beside the least that a profile can cost."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from slopewise.planner.bounds.speed_bounds import speed_bounds
from slopewise.planner.ground.braking_ground import ground_along
from slopewise.planner.ground.terrain_profile import terrain_profile
from slopewise.planner.kernels.limits import planning_limits
from slopewise.planner.pipeline.time_optimal_batch import TimeOptimalBatch, solve
from slopewise.planner.profile.time_optimal import (
    profile_problem,
    time_optimal_profile,
    travel_cost,
)
from slopewise.planner.swept.hazards import swept_hazards

from ..common.measure import summary, take_turns
from ..common.scene import SPACING, Scene
from .passes import braking_pass, plain_pass

_UNBOUNDED = 1e3
"""Service deceleration that never binds: the brakes decide everywhere [m/s²]."""

Result = dict[str, Any]


def stages(scene: Scene, solved: TimeOptimalBatch) -> dict[str, Callable[[], object]]:
    """The planner's stages and the two passes, each on the same batch."""
    model, vehicle = scene.model, scene.model.vehicle
    profile, ground, bounds = solved.profile, solved.ground, solved.bounds
    scalars, limits = planning_limits(model), model.limits
    candidates = scene.x.shape[1]
    clear, start = np.full(candidates, np.inf), np.zeros(candidates)
    out = np.empty_like(solved.speed_sq)

    def fastest(decel: float) -> object:
        problem = profile_problem(profile, ground, bounds, scalars, start)
        return time_optimal_profile(problem._replace(decel=decel))

    def without_sweep() -> object:
        ahead = terrain_profile(
            scene.elevation_map,
            scene.x,
            scene.y,
            scene.count,
            vehicle.wheelbase,
            vehicle.track_width,
        )
        solved = solve(
            ahead,
            ground_along(ahead, model),
            model,
            start_speed=0.0,
            clear=np.inf,
            speed_limit=None,
        )
        return np.argsort(solved.cost)

    return {
        "plain pass": lambda: plain_pass(
            bounds.speed_sq_max, SPACING, limits.accel, limits.decel, out
        ),
        "pass with braking": lambda: braking_pass(
            bounds.speed_sq_max,
            profile.station,
            profile.grade,
            profile.sin_grade,
            model.braking,
            limits.accel,
            limits.decel,
            out,
        ),
        "terrain": lambda: terrain_profile(
            scene.elevation_map,
            scene.x,
            scene.y,
            scene.count,
            vehicle.wheelbase,
            vehicle.track_width,
        ),
        "ground": lambda: ground_along(profile, model),
        "bounds": lambda: speed_bounds(profile, ground, model, clear),
        "profile": lambda: fastest(limits.decel),
        "profile, brakes decide": lambda: fastest(_UNBOUNDED),
        "cost": lambda: travel_cost(profile.station, solved.speed_sq, 2.0),
        "swept footprint": lambda: swept_hazards(scene.elevation_map, profile, model),
        "poses to ranked plans": lambda: np.argsort(scene.plan().cost),
        "the same without the swept footprint": without_sweep,
    }


def in_batch(scene: Scene, rounds: int) -> list[Result]:
    """Times of all stages, and their ratios to both passes."""
    seconds = take_turns(stages(scene, scene.plan()), rounds)
    size = scene.x.size
    plain, braking = (summary(seconds[name]) for name in ("plain pass", "pass with braking"))
    rows = []
    for name, values in seconds.items():
        row: Result = {"name": name, **summary(values)}
        row["per_station"] = row["median"] / size
        row["to_plain"] = row["median"] / plain["median"]
        row["to_plain_least"] = row["min"] / plain["min"]
        row["to_braking"] = row["median"] / braking["median"]
        row["to_braking_least"] = row["min"] / braking["min"]
        rows.append(row)
    return rows
