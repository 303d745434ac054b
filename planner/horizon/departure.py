"""How far the vehicle is off its candidates, to which side, and since when."""

from __future__ import annotations

import numpy as np

from slopewise.planner.horizon.answer import PlanarState
from slopewise.planner.horizon.path_projection import locate
from slopewise.planner.path import PathBatch
from slopewise.planner.swept.convergence import Departure


def departure_of(paths: PathBatch, state: PlanarState) -> Departure:
    """The actual pose of the vehicle against M paths on which it was found before.

    Args:
        paths: on even stations. state: vehicle state.
    """
    projection = locate(paths.x, paths.y, paths.count, (state.x, state.y), state.heading)
    k, lanes = projection.segment, np.arange(len(projection.segment))
    x, y = paths.x[k, lanes], paths.y[k, lanes]
    dx, dy = paths.x[k + 1, lanes] - x, paths.y[k + 1, lanes] - y
    to_x, to_y = state.x - x, state.y - y
    offset = (dx * to_y - dy * to_x) / np.maximum(np.hypot(dx, dy), 1e-9)
    speed = max(state.speed, 0.0)
    return Departure(k, projection.along, offset, state.heading, speed, state.age)
