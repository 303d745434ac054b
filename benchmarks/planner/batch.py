"""Times of the planner's stages on a batch of candidates, compared with a lower bound.

That are the cheapest possible speed profiles: compiled forward–backward passes in tiles that stay
in the cache, without branches. Both know speed bounds and limits of acceleration and write v² from
rest, shape (N, M) [m²/s²]; the second one brakes with the force of the segment's first station at
the speed of its end.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import njit

from slopewise.models.arrays import Floats
from slopewise.models.quantity import GRAVITY
from slopewise.planner.bounds.speed_bounds import speed_bounds
from slopewise.planner.compiled_core import core
from slopewise.planner.ground.braking_ground import ground_along
from slopewise.planner.ground.terrain_profile import TerrainProfile, terrain_profile
from slopewise.planner.pipeline.time_optimal_batch import TimeOptimalBatch, solve
from slopewise.planner.planning_limits import planning_limits
from slopewise.planner.profile.problems import profile_problem
from slopewise.planner.swept.hazards import swept_hazards

from ..common.campaign import Result
from ..common.scene import SPACING, BenchmarkScene
from ..common.timing import interleave, peak_memory, summary

TILE = 64  # candidates worked on together: their rows stay in the first-level cache

_compiled = njit(nogil=True, error_model="numpy", cache=True)


@_compiled
def plain_pass(
    speed_sq_max: Floats, ds: float, accel: float, decel: float, speed_sq: Floats
) -> None:
    """Apply speed bounds and constant limits, between stations at equal distances [m]."""
    stations, candidates = speed_sq_max.shape
    gain, loss = 2.0 * ds * accel, 2.0 * ds * decel
    for first in range(0, candidates, TILE):
        tile = range(first, min(first + TILE, candidates))
        for j in tile:
            speed_sq[stations - 1, j] = speed_sq_max[stations - 1, j]
        for k in range(stations - 2, -1, -1):
            for j in tile:
                speed_sq[k, j] = min(speed_sq_max[k, j], speed_sq[k + 1, j] + loss)
        for j in tile:
            speed_sq[0, j] = 0.0
        for k in range(stations - 1):
            for j in tile:
                speed_sq[k + 1, j] = min(speed_sq[k + 1, j], speed_sq[k, j] + gain)


@_compiled
def braking_pass(
    speed_sq_max: Floats, ground: Any, line: Any, accel: float, decel: float, speed_sq: Floats
) -> None:
    """Apply the bounds as :func:`plain_pass` does, with F_b/W in the backward pass.

    ``ground`` is station [m], grade [rad] and its sine, (N, M) each; ``line`` is m_m, b_m, m_b, b_b
    of F_b/W = (m_m v + b_m) θ + m_b v + b_b.
    """
    station, grade, sin_grade = ground
    m_m, b_m, m_b, b_b = line
    stations, candidates = speed_sq_max.shape
    for first in range(0, candidates, TILE):
        tile = range(first, min(first + TILE, candidates))
        for j in tile:
            speed_sq[stations - 1, j] = speed_sq_max[stations - 1, j]
        for k in range(stations - 2, -1, -1):
            for j in tile:
                twice = 2.0 * (station[k + 1, j] - station[k, j])
                v = np.sqrt(speed_sq[k + 1, j])
                force = (m_m * v + b_m) * grade[k, j] + m_b * v + b_b + sin_grade[k, j]
                slowed = speed_sq[k + 1, j] + twice * min(decel, GRAVITY * force)
                speed_sq[k, j] = min(speed_sq_max[k, j], slowed)
        for j in tile:
            speed_sq[0, j] = 0.0
        for k in range(stations - 1):
            for j in tile:
                twice = 2.0 * (station[k + 1, j] - station[k, j])
                speed_sq[k + 1, j] = min(speed_sq[k + 1, j], speed_sq[k, j] + twice * accel)


_UNBOUNDED = 1e3  # service deceleration that never binds: the brakes limit everywhere [m/s²]
_PENALTY = 2.0  # for each metre not reached; changes no measured time [s/m]


def stages(scene: BenchmarkScene, solved: TimeOptimalBatch) -> dict[str, Callable[[], object]]:
    """The planner's stages and the two passes, each on the same batch."""
    model = scene.model
    profile, ground, bounds = solved.profile, solved.ground, solved.bounds
    scalars, limits = planning_limits(model), model.limits
    candidates = scene.x.shape[1]
    clear, start = np.full(candidates, np.inf), np.zeros(candidates)
    out, b = np.empty_like(solved.speed_sq), model.braking
    line = (b.m_m, b.b_m, b.m_b, b.b_b)

    def terrain() -> TerrainProfile:
        paths = (scene.x, scene.y, scene.count)
        return terrain_profile(scene.elevation_map, *paths, model.vehicle)

    def fastest(decel: float) -> object:
        problem = profile_problem(profile, ground, bounds, scalars, start)
        return core.time_optimal(problem._replace(decel=decel))

    def without_sweep() -> object:
        ahead = terrain()
        braking = ground_along(ahead, model)
        plans = solve(ahead, braking, model, start_speed=0.0, clear=np.inf, speed_limit=None)
        return np.argsort(plans.cost)

    def by_bounds() -> None:
        plain_pass(bounds.speed_sq_max, SPACING, limits.accel, limits.decel, out)

    def by_brakes() -> None:
        columns = (profile.station, profile.grade, profile.sin_grade)
        braking_pass(bounds.speed_sq_max, columns, line, limits.accel, limits.decel, out)

    return {
        "plain pass": by_bounds,
        "pass with braking": by_brakes,
        "terrain": terrain,
        "ground": lambda: ground_along(profile, model),
        "bounds": lambda: speed_bounds(profile, ground, model, clear),
        "profile": lambda: fastest(limits.decel),
        "profile, brakes decide": lambda: fastest(_UNBOUNDED),
        "cost": lambda: core.travel_cost(profile.station, solved.speed_sq, _PENALTY),
        "swept footprint": lambda: swept_hazards(scene.elevation_map, profile, model),
        "poses to ranked plans": lambda: np.argsort(scene.plan().cost),
        "the same without the swept footprint": without_sweep,
    }


def memory(scene: BenchmarkScene) -> Result:
    """Arrays of one batch, and peak memory of this process [bytes]."""
    solved = scene.plan()
    arrays: dict[int, int] = {}
    for part in (solved, solved.profile, solved.ground, solved.bounds):
        for name in part.__slots__:
            value = getattr(part, name)
            if isinstance(value, np.ndarray) and 0 not in value.strides:
                arrays[value.ctypes.data] = value.nbytes
    return {"batch_arrays": sum(arrays.values()), "process_peak": peak_memory()}


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
