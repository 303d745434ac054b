"""What the vehicle stands on along each candidate: grade, roll and surface under its wheels.

Heights are taken where the four wheels touch, not from the gradient at a point: a ditch narrower
than the wheelbase tilts a vehicle less than its banks are steep. Twist (one wheel off the plane of
the other three) is left to the suspension.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Bools, Floats, Ints, Singles
from slopewise.models.elevation_map import ElevationMap
from slopewise.planner.ground.footprint import POINTS, CellFrame, CellPoses, offset, on_grid
from slopewise.planner.ground.surface_bits import surfaces_under_wheels
from slopewise.planner.ground.vertical_curvature import vertical_curvature
from slopewise.planner.kernels.compiled import inlined, kernel, row_pass
from slopewise.planner.kernels.rows import copy_row
from slopewise.planner.kernels.workspace import empty, empty_singles


class TerrainRows(NamedTuple):
    """What kernels read of a :class:`TerrainProfile`, under the same names; see there.

    Arrays are (N, M); ``counts`` is its ``count``, (M,).
    """

    counts: Ints
    station: Floats
    heading_x: Floats
    heading_y: Floats
    curvature: Floats
    grade: Floats
    sin_grade: Floats
    sin_roll: Floats
    vertical_curvature: Floats
    known: Bools


@dataclass(frozen=True, slots=True)
class TerrainProfile:
    """Terrain along M candidates of up to N stations, station-major: arrays are (N, M).

    Attributes:
        count: (M,) stations that each candidate has; rows beyond are padding.
        x, y, z: position and ground height of the path [m]; unknown heights repeat the last known,
            or the first.
        station: distance along the ground, three-dimensional [m].
        heading_x, heading_y: unit vector of travel in the plan view.
        curvature: plan-view curvature, left turns positive [1/m].
        grade: uphill positive [rad], 0 where unknown.
        sin_grade, sin_roll: sines of grade and roll (left side up positive), 0 where unknown.
        vertical_curvature: change of the grade along the path, negative over a crest [1/m].
        known: all ground under path and wheels is known.
        surfaces: bits of the terrain classes under path and wheels.
        height_std: error of the map's heights against each other [m], one number.
        twist: how far the front left wheel or the one across from it is above the plane of the
            others [m], float32; NaN where unknown.
        front: (N, 2, M) ground under the front wheels, left and right, above that under the middle
            of the first station [m], float32; what is unknown repeats the last known, or 0.
    """

    count: Ints
    x: Floats
    y: Floats
    z: Floats
    station: Floats
    heading_x: Floats
    heading_y: Floats
    curvature: Floats
    grade: Floats
    sin_grade: Floats
    sin_roll: Floats
    vertical_curvature: Floats
    known: Bools
    surfaces: Ints
    twist: Singles
    front: Singles
    height_std: float = 0.0

    @property
    def rows(self) -> TerrainRows:
        """The arrays for kernels."""
        return TerrainRows(
            self.count,
            self.station,
            self.heading_x,
            self.heading_y,
            self.curvature,
            self.grade,
            self.sin_grade,
            self.sin_roll,
            self.vertical_curvature,
            self.known,
        )

    @property
    def roll(self) -> Floats:
        """Roll, left side up positive [rad], (N, M)."""
        return np.arcsin(self.sin_roll)


def terrain_profile(
    elevation_map: ElevationMap,
    x: Floats,
    y: Floats,
    count: Ints,
    wheelbase: float,
    track_width: float,
) -> TerrainProfile:
    """Sample an elevation map under the wheels along candidate paths.

    Args:
        elevation_map: heights; unknown cells are NaN.
        x, y: (N, M) positions of the middle of the wheelbase [m], C-contiguous.
        count: (M,) number of stations of each candidate, at least 3.
        wheelbase, track_width: footprint [m].
    """
    stations, candidates = x.shape
    out = empty(8, stations, candidates)
    known = np.empty((stations, candidates), np.bool_)
    twist = empty_singles(stations, candidates)
    front = empty_singles(stations, 2, candidates)
    z, station, heading_x, heading_y, curvature, grade, sin_grade, sin_roll = out
    frame = _frame_of(elevation_map)
    elevation = elevation_map.elevation
    _sample(
        elevation,
        elevation.reshape(-1),
        frame,
        x,
        y,
        count - 1,
        0.5 * wheelbase,
        0.5 * track_width,
        z,
        station,
        heading_x,
        heading_y,
        curvature,
        grade,
        sin_grade,
        sin_roll,
        known,
        twist,
        front,
    )
    for j in np.flatnonzero(np.isnan(z[0])):
        seen = np.flatnonzero(np.isfinite(z[:, j]))
        first = int(seen[0]) if len(seen) else stations
        z[:first, j] = z[first, j] if len(seen) else 0.0
    surfaces: Ints = np.broadcast_to(np.int64(1), x.shape)
    if elevation_map.terrain_class is not None:
        surfaces = empty(*x.shape).view(np.int64)
        surfaces_under_wheels(
            elevation_map.terrain_class,
            frame,
            x,
            y,
            heading_x,
            heading_y,
            (0.5 * wheelbase, 0.5 * track_width),
            surfaces,
        )
    return TerrainProfile(
        count,
        x,
        y,
        z,
        station,
        heading_x,
        heading_y,
        curvature,
        grade,
        sin_grade,
        sin_roll,
        vertical_curvature(station, grade, known),
        known,
        surfaces,
        twist,
        front,
        elevation_map.height_std,
    )


def stations_along(elevation_map: ElevationMap, x: Floats, y: Floats, count: Ints) -> Floats:
    """Only the stations of :func:`terrain_profile`, (N, M) [m]; arguments as there."""
    station = np.empty(x.shape)
    elevation = elevation_map.elevation
    flat, frame = elevation.reshape(-1), _frame_of(elevation_map)
    _walk(elevation, flat, frame, x, y, count - 1, station)
    return station


def _frame_of(elevation_map: ElevationMap) -> CellFrame:
    return CellFrame(*elevation_map.origin, 1.0 / elevation_map.resolution)


@kernel
def _walk(
    elevation: Floats,
    flat: Floats,
    frame: CellFrame,
    x: Floats,
    y: Floats,
    last: Ints,
    station: Floats,
) -> None:
    stations, candidates = x.shape
    level = np.zeros(candidates)
    poses = CellPoses(
        np.empty(candidates), np.empty(candidates), np.empty(candidates), np.empty(candidates)
    )
    across, up = np.empty(candidates), np.empty(candidates)
    z, height = np.full(candidates, np.nan), np.empty(candidates)
    cell = np.empty(candidates, np.int64)
    station[0] = 0.0
    for k in range(stations):
        on_grid(frame, x[k], y[k], level, level, poses)
        locate(elevation, poses, 0.0, 0.0, cell, across, up)
        interpolate(flat, elevation.shape[1], cell, across, up, height)
        for j in range(candidates):
            if k > last[j] or np.isnan(height[j]):
                height[j] = z[j]
        if k > 0:
            _advance(k, last, x[k - 1], y[k - 1], z, station[k - 1], x[k], y[k], height, station[k])
        copy_row(height, z)


@kernel
def _sample(
    elevation: Floats,
    flat: Floats,
    frame: CellFrame,
    x: Floats,
    y: Floats,
    last: Ints,
    half_length: float,
    half_width: float,
    z: Floats,
    station: Floats,
    heading_x: Floats,
    heading_y: Floats,
    curvature: Floats,
    grade: Floats,
    sin_grade: Floats,
    sin_roll: Floats,
    known: Bools,
    twist: Singles,
    front: Singles,
) -> None:
    """Walk all candidates station by station; each pass runs along a row, one lane a candidate.

    Lanes beyond the last station of their candidate repeat it, and count as unknown.
    """
    stations, candidates = x.shape
    step_x, step_y, step = np.empty(candidates), np.empty(candidates), np.empty(candidates)
    poses = CellPoses(
        np.empty(candidates), np.empty(candidates), np.empty(candidates), np.empty(candidates)
    )
    across, up = np.empty(candidates), np.empty(candidates)
    heights = np.empty((POINTS, candidates))
    cell = np.empty(candidates, np.int64)
    _first_step(x[0], y[0], x[1], y[1], step_x, step_y, step)
    for k in range(stations):
        before, after = max(k - 1, 0), min(k + 1, stations - 1)
        _turn(
            k,
            last,
            x[k],
            y[k],
            x[after],
            y[after],
            curvature[before],
            step_x,
            step_y,
            step,
            heading_x[k],
            heading_y[k],
            curvature[k],
        )
        on_grid(frame, x[k], y[k], heading_x[k], heading_y[k], poses)
        for point in range(POINTS):
            ahead, aside = offset(point, half_length, half_width)
            locate(elevation, poses, ahead, aside, cell, across, up)
            interpolate(flat, elevation.shape[1], cell, across, up, heights[point])
        _tilt(
            k,
            last,
            heights,
            0.25 / half_length,
            0.25 / half_width,
            z[before],
            z[k],
            grade[k],
            sin_grade[k],
            sin_roll[k],
            known[k],
            twist[k],
        )
        for side in range(2):
            above_first(heights[side], z[0], front[before, side], k > 0, front[k, side])
        if k == 0:
            station[0] = 0.0
        else:
            _advance(
                k,
                last,
                x[before],
                y[before],
                z[before],
                station[before],
                x[k],
                y[k],
                z[k],
                station[k],
            )
    # The first station has no step before it: it borrows the circle of the second.
    copy_row(curvature[1], curvature[0])


@inlined
def _first_step(
    x: Floats,
    y: Floats,
    next_x: Floats,
    next_y: Floats,
    step_x: Floats,
    step_y: Floats,
    step: Floats,
) -> None:
    for j in range(x.shape[0]):
        step_x[j] = next_x[j] - x[j]
        step_y[j] = next_y[j] - y[j]
        step[j] = np.sqrt(step_x[j] * step_x[j] + step_y[j] * step_y[j])


@inlined
def _turn(
    k: int,
    last: Ints,
    x: Floats,
    y: Floats,
    next_x: Floats,
    next_y: Floats,
    bend_before: Floats,
    step_x: Floats,
    step_y: Floats,
    step: Floats,
    heading_x: Floats,
    heading_y: Floats,
    curvature: Floats,
) -> None:
    """Heading and curvature from the steps before and after; leaves the step after behind."""
    for j in range(x.shape[0]):
        inside = k < last[j]
        ax, ay, a = step_x[j], step_y[j], step[j]
        bx = next_x[j] - x[j] if inside else ax
        by = next_y[j] - y[j] if inside else ay
        b = np.sqrt(bx * bx + by * by)
        cx, cy = ax + bx, ay + by
        per_chord = 1.0 / np.sqrt(cx * cx + cy * cy)
        heading_x[j] = cx * per_chord
        heading_y[j] = cy * per_chord
        bend = 2.0 * (ax * by - ay * bx) / (a * b) * per_chord
        at_end = bend_before[j] if k == last[j] else 0.0
        curvature[j] = bend if inside else at_end
        step_x[j], step_y[j], step[j] = bx, by, b


@inlined
def locate(
    elevation: Floats,
    poses: CellPoses,
    ahead: float,
    aside: float,
    cell: Ints,
    across: Floats,
    up: Floats,
) -> None:
    """Cell under one wheel, and the shares of its neighbours; NaN where the map has ended."""
    rows, columns = elevation.shape
    centre_u, centre_v, ahead_u, ahead_v = poses
    right, top = columns - 1.0, rows - 1.0
    for j in range(cell.shape[0]):
        u = centre_u[j] + ahead * ahead_u[j] - aside * ahead_v[j]
        v = centre_v[j] + ahead * ahead_v[j] + aside * ahead_u[j]
        inside = (u >= 0.0) & (v >= 0.0) & (u <= right) & (v <= top)
        u = u if inside else 0.0
        v = v if inside else 0.0
        column = min(np.floor(u), right - 1.0)
        row = min(np.floor(v), top - 1.0)
        cell[j] = int(row * columns + column)
        across[j] = u - column if inside else np.nan
        up[j] = v - row


@row_pass
def interpolate(
    flat: Floats, columns: int, cell: Ints, across: Floats, up: Floats, height: Floats
) -> None:
    """Bilinear heights of a map that is handed over as one row, NaN beside unknown cells."""
    one, row = np.uint64(1), np.uint64(columns)
    for j in range(cell.shape[0]):
        i = np.uint64(cell[j])  # unsigned: no index counts from the end
        u = across[j]
        lower = flat[i] + u * (flat[i + one] - flat[i])
        upper = flat[i + row] + u * (flat[i + row + one] - flat[i + row])
        height[j] = lower + up[j] * (upper - lower)


@row_pass
def _tilt(
    k: int,
    last: Ints,
    heights: Floats,
    per_length: float,
    per_width: float,
    z_before: Floats,
    z: Floats,
    grade: Floats,
    sin_grade: Floats,
    sin_roll: Floats,
    known: Bools,
    twist: Singles,
) -> None:
    """Grade and roll of the plane nearest to the wheels, and how far they are off it."""
    front_left, front_right, rear_left = heights[0], heights[1], heights[2]
    rear_right, centre = heights[3], heights[4]
    for j in range(z.shape[0]):
        rise = (front_left[j] + front_right[j] - rear_left[j] - rear_right[j]) * per_length
        lean = (front_left[j] + rear_left[j] - front_right[j] - rear_right[j]) * per_width
        inside = k <= last[j]
        twist[j] = np.float32(front_left[j] - front_right[j] - rear_left[j] + rear_right[j])
        seen = np.isfinite(rise) & np.isfinite(lean) & np.isfinite(centre[j]) & inside
        known[j] = seen
        unseen = z_before[j] if k > 0 else np.nan
        z[j] = centre[j] if inside & np.isfinite(centre[j]) else unseen
        rise = rise if seen else 0.0
        lean = lean if seen else 0.0
        # tan(roll) = q cos(grade): roll turns about the body's own, inclined x axis.
        secant = np.sqrt(1.0 + rise * rise)
        cosine = 1.0 / secant
        tan_roll = lean * cosine
        grade[j] = arctan_of(rise, secant)
        sin_grade[j] = rise * cosine
        sin_roll[j] = tan_roll / np.sqrt(1.0 + tan_roll * tan_roll)


@row_pass
def above_first(
    height: Floats, first: Floats, neighbour: Singles, repeats: bool, above: Singles
) -> None:
    """Heights above the first station's; what is unknown repeats its neighbour, or is 0."""
    for j in range(above.shape[0]):
        other = neighbour[j] if repeats else np.float32(0.0)
        base = first[j] if np.isfinite(first[j]) else 0.0
        above[j] = np.float32(height[j] - base) if np.isfinite(height[j]) else other


@row_pass
def arctan_of(tangent: float, secant: float) -> float:
    """arctan(tangent) with secant = √(1 + tangent²), to 1e-13, without a branch or a call.

    The tangent of a quarter of the angle, below √2 − 1, then 16 terms of Taylor's series.
    """
    half = tangent / (1.0 + secant)
    quarter = half / (1.0 + np.sqrt(1.0 + half * half))
    square = quarter * quarter
    series = 0.0
    for n in range(15, -1, -1):
        series = 1.0 / (2.0 * n + 1.0) - square * series
    return float(4.0 * quarter * series)


@row_pass
def _advance(
    k: int,
    last: Ints,
    x_before: Floats,
    y_before: Floats,
    z_before: Floats,
    station_before: Floats,
    x: Floats,
    y: Floats,
    z: Floats,
    station: Floats,
) -> None:
    for j in range(x.shape[0]):
        dx, dy = x[j] - x_before[j], y[j] - y_before[j]
        # From a height that was never seen there is no step.
        dz = z[j] - z_before[j]
        dz = dz if np.isfinite(dz) else 0.0
        step = np.sqrt(dx * dx + dy * dy + dz * dz)
        station[j] = station_before[j] + (step if k <= last[j] else 0.0)
