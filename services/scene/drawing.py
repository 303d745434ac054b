"""Drawing for every viewer: ground as a mesh, candidates coloured by speed, numbers over time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slopewise.models.arrays import Floats
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.vehicle import Vehicle
from slopewise.planner.plan import SpeedPlan
from slopewise.services.report.relief import shade

_MAX_VERTICES = 60_000
"""Ground is drawn coarser beyond that; viewers build an object for each."""

_LIFT = 0.05
"""Paths are drawn that much above the ground, or they would be in it [m]."""

_SPEEDS = np.array(
    [
        [13, 8, 135],
        [126, 3, 168],
        [204, 71, 120],
        [248, 149, 64],
        [240, 249, 33],
    ],
    np.float64,
)
"""Red, green, blue of matplotlib's colour map `plasma` at 0, 1/4, 1/2, 3/4 and 1."""

NOT_DRIVEN = (110, 110, 110)
"""Grey of the path beyond the place where a plan stops."""


@dataclass(frozen=True, slots=True)
class DrawnSurface:
    """Ground as triangles.

    Attributes:
        vertices: (n, 3) [m]. triangles: (m, 3) of vertices, counter-clockwise from above.
        colours: (n, 3) red, green, blue. step: cells of the map between two vertices.
    """

    vertices: Floats
    triangles: NDArray[np.uint32]
    colours: NDArray[np.uint8]
    step: int


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


@dataclass(frozen=True, slots=True)
class Ribbon:
    """One candidate as a line: what is driven, coloured by speed, and what is not.

    Attributes:
        points: (n, 3) [m]. colours: (n, 3). driven: number of points that are driven.
    """

    points: Floats
    colours: NDArray[np.uint8]
    driven: int


def ribbon(plan: SpeedPlan, fastest: float) -> Ribbon:
    """A candidate; ``fastest`` gets the last colour [m/s]."""
    points = np.stack([plan.x, plan.y, plan.z + _LIFT], axis=1)
    driven = int(np.count_nonzero(plan.station <= plan.progress + 1e-9))
    colours = speed_colours(plan.speed, fastest)
    colours[driven:] = NOT_DRIVEN
    return Ribbon(points, colours, driven if plan.progress > 0.0 else 0)


def speed_colours(speed: Floats, fastest: float) -> NDArray[np.uint8]:
    """(n, 3) from dark blue at rest to yellow at ``fastest`` [m/s]."""
    share = np.clip(speed / max(fastest, 1e-9), 0.0, 1.0) * (len(_SPEEDS) - 1)
    stops = np.arange(len(_SPEEDS))
    channels = [np.interp(share, stops, _SPEEDS[:, c]) for c in range(3)]
    return np.rint(np.stack(channels, axis=1)).astype(np.uint8)


def fastest_of(plans: Sequence[SpeedPlan]) -> float:
    """The highest speed of all plans [m/s]."""
    return max((float(plan.speed.max()) for plan in plans), default=0.0)


SERIES = (
    "speed_m_s",
    "speed_bound_m_s",
    "accel_m_s2",
    "station_m",
    "stop_distance_m",
    "margin_m",
    "grade_deg",
    "roll_deg",
    "rear_load",
    "side_load",
)
"""Numbers to plot; each name says its unit, loads are shares of the level static load."""


@dataclass(frozen=True, slots=True)
class DrivenPlan:
    """Driven plan, n moments; every array is (n,).

    Attributes:
        time: [s], growing. position: (n, 3) on the ground [m]. quaternion: (n, 4) x, y, z, w.
        series: numbers to plot by name; each name says its unit.
    """

    time: Floats
    position: Floats
    quaternion: Floats
    series: dict[str, Floats]


def drive(plan: SpeedPlan) -> DrivenPlan:
    """The moments at which a plan passes its stations, up to where it stops."""
    moments = np.concatenate(([True], np.diff(plan.time) > 0.0))
    heading = np.unwrap(np.arctan2(np.gradient(plan.y), np.gradient(plan.x)))
    # REP-103: pitch is nose down positive, roll is left side up positive.
    yaw, pitch, roll = heading[moments], -plan.grade[moments], plan.roll[moments]
    margin = plan.clear_distance - plan.station - plan.stop_distance
    series = (
        plan.speed,
        plan.speed_bound,
        plan.accel,
        plan.station,
        plan.stop_distance,
        margin,
        np.rad2deg(plan.grade),
        np.rad2deg(plan.roll),
        plan.rear_load,
        plan.side_load,
    )
    return DrivenPlan(
        time=plan.time[moments],
        position=np.stack([plan.x, plan.y, plan.z], axis=1)[moments],
        quaternion=_quaternions(yaw, pitch, roll),
        series={n: values[moments] for n, values in zip(SERIES, series, strict=True)},
    )


def _quaternions(yaw: Floats, pitch: Floats, roll: Floats) -> Floats:
    """(n, 4) x, y, z, w of turns about z, then y, then x [rad]."""
    cy, sy = np.cos(yaw / 2), np.sin(yaw / 2)
    cp, sp = np.cos(pitch / 2), np.sin(pitch / 2)
    cr, sr = np.cos(roll / 2), np.sin(roll / 2)
    return np.stack(
        [
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
            cr * cp * cy + sr * sp * sy,
        ],
        axis=1,
    )


def box_of(vehicle: Vehicle) -> tuple[tuple[float, float, float], float]:
    """(length, width, height) [m] of a box that stands for the vehicle, and its middle's height."""
    height = 2.0 * vehicle.cg_z
    size = vehicle.wheelbase + 2.0 * vehicle.wheel_radius, vehicle.track_width, height
    return size, 0.5 * height
