"""Drawing for every viewer: ground as a mesh, candidates coloured by speed, numbers over time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from slopewise.models.arrays import Floats
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.vehicle import Vehicle
from slopewise.planner.plan import SpeedPlan
from slopewise.services.scene.shading import shade

_MAX_VERTICES = 60_000
"""Ground is drawn coarser beyond that; viewers build an object for each."""

_LIFT = 0.05
"""Paths are drawn that much above the ground, or they would be in it [m]."""

_SPEEDS = ((13, 8, 135), (126, 3, 168), (204, 71, 120), (248, 149, 64), (240, 249, 33))
"""Red, green, blue of matplotlib's colour map `plasma` at 0, 1/4, 1/2, 3/4 and 1."""

NOT_DRIVEN = (110, 110, 110)
"""Grey of the path beyond the place where a plan stops."""


@dataclass(frozen=True, slots=True)
class DrawnSurface:
    """Ground as triangles."""

    vertices: Floats  # (n, 3) [m]
    triangles: NDArray[np.uint32]  # (m, 3) of vertices, counter-clockwise from above
    colours: NDArray[np.uint8]  # (n, 3) red, green, blue
    step: int  # cells of the map between two vertices


def surface(ground: ElevationMap, max_vertices: int = _MAX_VERTICES) -> DrawnSurface:
    """Known ground; where a cell is unknown there is a hole."""
    step = max(1, math.ceil(math.sqrt(ground.elevation.size / max_vertices)))
    heights = ground.elevation[::step, ::step]
    grey = shade(ground.elevation, ground.resolution)[::-1][::step, ::step, 0]
    rows, columns = heights.shape
    known = np.isfinite(heights)
    number = np.cumsum(known.ravel()).reshape(known.shape) - 1
    row, column = np.nonzero(known)
    cell = step * ground.resolution
    vertices = np.stack(
        [ground.origin[0] + cell * column, ground.origin[1] + cell * row, heights[known]], axis=1
    )
    i, j = (index.ravel() for index in np.indices((max(rows - 1, 0), max(columns - 1, 0))))
    triangles = []
    for corners in (((0, 0), (0, 1), (1, 1)), ((0, 0), (1, 1), (1, 0))):
        at = [(i + di, j + dj) for di, dj in corners]
        complete = np.logical_and.reduce([known[place] for place in at])
        triangles.append(np.stack([number[place][complete] for place in at], axis=1))
    return DrawnSurface(
        vertices=vertices,
        triangles=np.concatenate(triangles).astype(np.uint32),
        colours=np.repeat(grey[known][:, None], 3, axis=1),
        step=step,
    )


def ribbon(plan: SpeedPlan, fastest: float) -> tuple[Floats, NDArray[np.uint8]]:
    """(n, 3) points of a candidate [m] and their colours; ``fastest`` gets the last one [m/s]."""
    points = np.stack([plan.x, plan.y, plan.z + _LIFT], axis=1)
    driven = int(np.count_nonzero(plan.station <= plan.progress + 1e-9))
    colours = speed_colours(plan.speed, fastest)
    colours[driven:] = NOT_DRIVEN
    return points, colours


def speed_colours(speed: Floats, fastest: float) -> NDArray[np.uint8]:
    """(n, 3) from dark blue at rest to yellow at ``fastest`` [m/s]."""
    share = np.clip(speed / max(fastest, 1e-9), 0.0, 1.0) * (len(_SPEEDS) - 1)
    channels = [
        np.interp(share, range(len(_SPEEDS)), levels) for levels in zip(*_SPEEDS, strict=True)
    ]
    return np.rint(np.stack(channels, axis=1)).astype(np.uint8)


def fastest_of(plans: Sequence[SpeedPlan]) -> float:
    """The highest speed of all plans [m/s]."""
    return max((float(plan.speed.max()) for plan in plans), default=0.0)


@dataclass(frozen=True, slots=True)
class DrivenPlan:
    """Driven plan, n moments."""

    time: Floats  # (n,) [s], growing
    position: Floats  # (n, 3) on the ground [m]
    quaternion: Floats  # (n, 4) x, y, z, w
    series: dict[str, Floats]
    """Numbers to plot, (n,); each name says its unit, loads are shares of the level static load."""


def drive(plan: SpeedPlan) -> DrivenPlan:
    """The moments at which a plan passes its stations, up to where it stops."""
    moments = np.concatenate(([True], np.diff(plan.time) > 0.0))
    heading = np.unwrap(np.arctan2(np.gradient(plan.y), np.gradient(plan.x)))
    # REP-103: pitch is nose down positive, roll is left side up positive.
    turns = np.stack([heading, -plan.grade, plan.roll], axis=1)[moments]
    series = {
        "speed_m_s": plan.speed,
        "speed_bound_m_s": plan.speed_bound,
        "accel_m_s2": plan.accel,
        "station_m": plan.station,
        "stop_distance_m": plan.stop_distance,
        "margin_m": plan.clear_distance - plan.station - plan.stop_distance,
        "grade_deg": np.rad2deg(plan.grade),
        "roll_deg": np.rad2deg(plan.roll),
        "rear_load": plan.rear_load,
        "side_load": plan.side_load,
    }
    return DrivenPlan(
        time=plan.time[moments],
        position=np.stack([plan.x, plan.y, plan.z], axis=1)[moments],
        quaternion=Rotation.from_euler("ZYX", turns).as_quat(),
        series={name: values[moments] for name, values in series.items()},
    )


def box_of(vehicle: Vehicle) -> tuple[tuple[float, float, float], float]:
    """(length, width, height) [m] of a box that stands for the vehicle, and its middle's height."""
    height = 2.0 * vehicle.cg_z
    size = vehicle.wheelbase + 2.0 * vehicle.wheel_radius, vehicle.track_width, height
    return size, 0.5 * height
