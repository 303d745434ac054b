"""Ground behind the first station: what the body comes over still moves it there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Floats, Singles
from slopewise.planner.ground.footprint import CellFrame, CellPoses, offset, on_grid
from slopewise.planner.ground.terrain_profile import (
    TerrainProfile,
    above_first,
    interpolate,
    locate,
)
from slopewise.planner.kernels.compiled import kernel, row_pass
from slopewise.planner.swept.wheel_path import Ground


def ground_behind(
    ground: Ground,
    profile: TerrainProfile,
    stations: int,
    spacing: Floats,
    half_length: float,
    half_width: float,
) -> Singles:
    """Ground under the front wheels of a vehicle that came straight to the first station.

    Args:
        ground: map.
        profile: M candidates.
        stations: B. spacing: (M,) distance between them [m].
        half_length, half_width: of the wheels [m].

    Returns:
        (B, 2, M) left and right, the first one farthest behind, as ``profile.front`` [m].
    """
    behind = np.empty((stations, *profile.front.shape[1:]), np.float32)
    start = _Start(
        profile.x[0],
        profile.y[0],
        profile.heading_x[0],
        profile.heading_y[0],
        spacing,
        profile.z[0],
        profile.front[0],
    )
    flat = ground.elevation.reshape(-1)
    _sample(ground, flat, start, half_length, half_width, behind)
    return behind


class _Start(NamedTuple):
    """Position [m], heading and spacing [m], (M,); height of the ground there, (M,), and under the
    front wheels, (2, M) [m].
    """

    x: Floats
    y: Floats
    heading_x: Floats
    heading_y: Floats
    spacing: Floats
    level: Floats
    front: Singles


@kernel
def _sample(
    ground: Ground,
    flat: Floats,
    start: _Start,
    half_length: float,
    half_width: float,
    behind: Singles,
) -> None:
    stations, _, candidates = behind.shape
    back_x, back_y, height = np.empty(candidates), np.empty(candidates), np.empty(candidates)
    frame = CellFrame(ground.origin_x, ground.origin_y, ground.per_metre)
    poses = CellPoses(
        np.empty(candidates), np.empty(candidates), np.empty(candidates), np.empty(candidates)
    )
    across, up = np.empty(candidates), np.empty(candidates)
    cell = np.empty(candidates, np.int64)
    for k in range(stations - 1, -1, -1):
        _straight_back(start, float(stations - k), back_x, back_y)
        on_grid(frame, back_x, back_y, start.heading_x, start.heading_y, poses)
        for side in range(2):
            ahead, aside = offset(side, half_length, half_width)
            locate(ground.elevation, poses, ahead, aside, cell, across, up)
            interpolate(flat, ground.elevation.shape[1], cell, across, up, height)
            later = start.front[side] if k == stations - 1 else behind[k + 1, side]
            above_first(height, start.level, later, True, behind[k, side])


@row_pass
def _straight_back(start: _Start, steps: float, out_x: Floats, out_y: Floats) -> None:
    for j in range(out_x.shape[0]):
        back = steps * start.spacing[j]
        out_x[j] = start.x[j] - back * start.heading_x[j]
        out_y[j] = start.y[j] - back * start.heading_y[j]
