"""Walls and posts as close to a plan as it still passes, and bodies that follow its given path.

A vehicle that follows the given polyline, and not the planned line, must touch none of them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.signal import savgol_filter

from slopewise.models.arrays import Floats
from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.plan import SpeedPlan

from ..tracking.passes import Poses, poses_on, strikes
from .followers import PLACE_STEP, averaged, dense

_CELL = 0.1  # [m] of the maps
_HIGH = 1.0  # [m] of obstacles
_POST, _WALL = 0.2, 2.0  # [m] along the path, of a post and of a wall
_NEAREST, _STEP, _TRIES = 0.0, 0.05, 18  # [m] from the planned body, and how often farther [1]
_TOUCHES = 0.02  # [m] deep: stations sample a path, and maps are not drawn more exactly
_ENDS = 0.15  # share of a path at its ends [1] without obstacles: it has to begin on free ground


class Passed(NamedTuple):
    """A plan past an obstacle: free distance from the planned body [m]; contact of the follower."""

    gap: float
    touched: bool


def pass_obstacle(
    given: Floats,
    planner: CandidatePlanner,
    ground: ElevationMap,
    rng: np.random.Generator,
    *,
    steers_at_noise: bool,
) -> Passed | None:
    """Follow a path exactly past the closest obstacle that its plan passes; None if it passes none.

    Args:
        given: (n, 2) points [m]. planner: with the model.
        ground: flat, without obstacles; all of it is replaced.
        steers_at_noise: points are no noise.
    """
    path, model = CandidatePath("given", given), planner.model
    free = planner.plan(ground, [path])[0]
    k, side = _place(free, rng), float(rng.choice([-1.0, 1.0]))
    long = float(rng.choice([_POST, _WALL]))
    for n in range(_TRIES):
        gap = _NEAREST + n * _STEP
        blocked = _obstacle(ground, free, k, side * (0.5 * model.vehicle.shape.width + gap), long)
        plan = planner.plan(blocked, [path])[0]
        if plan.progress < free.progress - 0.05:
            continue
        poses = _followed(given, model, steers_at_noise=steers_at_noise)
        return Passed(gap, bool(strikes(poses, model, blocked, inset=_TOUCHES)[0]))
    return None


def _place(plan: SpeedPlan, rng: np.random.Generator) -> int:
    """A station away from the ends, of every other path the one farthest from what was given."""
    n = int(np.searchsorted(plan.station, plan.progress))
    first, last = math.ceil(_ENDS * n), max(math.floor((1.0 - _ENDS) * n), math.ceil(_ENDS * n) + 1)
    assert plan.path_deviation is not None
    if rng.random() < 0.5:
        return first + int(plan.path_deviation.distance[first:last].argmax())
    return int(rng.integers(first, last))


def _obstacle(
    ground: ElevationMap, plan: SpeedPlan, k: int, lateral: float, long: float
) -> ElevationMap:
    """Ground with a box whose side to the path is so far to the left of station k [m]."""
    rows, columns = ground.elevation.shape
    y, x = np.mgrid[:rows, :columns] * ground.resolution
    i, j = max(k - 1, 0), min(k + 1, len(plan.x) - 1)
    heading = math.atan2(plan.y[j] - plan.y[i], plan.x[j] - plan.x[i])
    east, north = x + ground.origin[0] - plan.x[k], y + ground.origin[1] - plan.y[k]
    along = east * math.cos(heading) + north * math.sin(heading)
    left = (north * math.cos(heading) - east * math.sin(heading)) * math.copysign(1.0, lateral)
    box = (np.abs(along) <= 0.5 * long) & (left >= abs(lateral)) & (left <= abs(lateral) + _POST)
    return ElevationMap(
        elevation=np.where(box, _HIGH, 0.0), resolution=ground.resolution, origin=ground.origin
    )


def _followed(given: Floats, model: Model, *, steers_at_noise: bool) -> Poses:
    """Poses on the polyline itself, the body as the best arc from axle to axle lies."""
    base = model.vehicle.wheelbase
    smooth = given if steers_at_noise else averaged(given, base)
    x, y = dense(smooth, smooth)
    if model.vehicle.drive == "ackermann":
        return poses_on(x, y, model)
    span = (0.5 if steers_at_noise else 1.0) * base
    window = min(2 * round(span / PLACE_STEP) + 1, (len(x) - 1) // 2 * 2 + 1)
    dx, dy = (savgol_filter(v, window, 2, deriv=1, delta=PLACE_STEP) for v in (x, y))
    return Poses(x, y, np.arctan2(dy, dx))
