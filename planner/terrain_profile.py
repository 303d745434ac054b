"""What the vehicle stands on along each candidate: grade, roll and surface under its wheels.

Heights are taken where the four wheels touch, not from the gradient at a point: a ditch narrower
than the wheelbase tilts a vehicle less than its banks are steep. Twist (one wheel off the plane of
the other three) is left to the suspension.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planner.compiled import Bools, Floats, Ints, kernel
from planner.elevation_map import ElevationMap, height_at

MAX_CLASSES = 62
"""Surfaces one map can tell apart: a station keeps those under its wheels as bits of an int64."""


@dataclass(frozen=True, slots=True)
class TerrainProfile:
    """Terrain along M candidates of up to N stations, station-major: arrays are (N, M).

    Attributes:
        count: (M,) stations that each candidate has; rows beyond are padding.
        x, y, z: position and ground height of the path [m]; unknown heights repeat the last known.
        station: distance along the ground, three-dimensional [m].
        heading_x, heading_y: unit vector of travel in the plan view.
        curvature: plan-view curvature, left turns positive [1/m].
        grade: uphill positive [rad], 0 where unknown.
        sin_grade, sin_roll: sines of grade and roll (left side up positive), 0 where unknown.
        known: all ground under path and wheels is known.
        surfaces: bits of the terrain classes under path and wheels.
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
    known: Bools
    surfaces: Ints

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
    out = np.empty((8, stations, candidates))
    known = np.empty((stations, candidates), np.bool_)
    z, station, heading_x, heading_y, curvature, grade, sin_grade, sin_roll = out
    grid = (elevation_map.origin[0], elevation_map.origin[1], 1.0 / elevation_map.resolution)
    _sample(
        elevation_map.elevation, *grid, x, y, count, 0.5 * wheelbase, 0.5 * track_width,
        z, station, heading_x, heading_y, curvature, grade, sin_grade, sin_roll, known,
    )  # fmt: skip
    surfaces = np.ones((stations, candidates), np.int64)
    if elevation_map.terrain_class is not None:
        _surfaces_under_wheels(
            elevation_map.terrain_class, *grid, x, y, heading_x, heading_y,
            0.5 * wheelbase, 0.5 * track_width, surfaces,
        )  # fmt: skip
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
        known,
        surfaces,
    )


@kernel
def _sample(
    elevation: Floats, origin_x: float, origin_y: float, per_metre: float,
    x: Floats, y: Floats, count: Ints, half_length: float, half_width: float,
    z: Floats, station: Floats, heading_x: Floats, heading_y: Floats, curvature: Floats,
    grade: Floats, sin_grade: Floats, sin_roll: Floats, known: Bools,
) -> None:  # fmt: skip
    stations, candidates = x.shape
    for k in range(stations):
        for j in range(candidates):
            last = count[j] - 1
            if k > last:
                z[k, j] = z[last, j]
                station[k, j] = station[last, j]
                heading_x[k, j] = heading_x[last, j]
                heading_y[k, j] = heading_y[last, j]
                curvature[k, j] = 0.0
                grade[k, j] = 0.0
                sin_grade[k, j] = 0.0
                sin_roll[k, j] = 0.0
                known[k, j] = False
                continue
            # Three neighbours for heading and curvature; the ends borrow their neighbour's circle.
            middle = min(max(k, 1), last - 1)
            ax = x[middle, j] - x[middle - 1, j]
            ay = y[middle, j] - y[middle - 1, j]
            bx = x[middle + 1, j] - x[middle, j]
            by = y[middle + 1, j] - y[middle, j]
            a = np.sqrt(ax * ax + ay * ay)
            b = np.sqrt(bx * bx + by * by)
            chord = np.sqrt((ax + bx) ** 2 + (ay + by) ** 2)
            curvature[k, j] = 2.0 * (ax * by - ay * bx) / (a * b * chord)
            if k == 0:
                hx, hy = ax / a, ay / a
            elif k == last:
                hx, hy = bx / b, by / b
            else:
                hx, hy = (ax + bx) / chord, (ay + by) / chord
            heading_x[k, j] = hx
            heading_y[k, j] = hy

            u = (x[k, j] - origin_x) * per_metre
            v = (y[k, j] - origin_y) * per_metre
            lu, lv = half_length * hx * per_metre, half_length * hy * per_metre
            wu, wv = -half_width * hy * per_metre, half_width * hx * per_metre
            centre = height_at(elevation, u, v)
            front_left = height_at(elevation, u + lu + wu, v + lv + wv)
            front_right = height_at(elevation, u + lu - wu, v + lv - wv)
            rear_left = height_at(elevation, u - lu + wu, v - lv + wv)
            rear_right = height_at(elevation, u - lu - wu, v - lv - wv)
            rise = (front_left + front_right - rear_left - rear_right) / (4.0 * half_length)
            lean = (front_left + rear_left - front_right - rear_right) / (4.0 * half_width)
            seen = np.isfinite(rise) and np.isfinite(lean) and np.isfinite(centre)
            known[k, j] = seen
            if not np.isfinite(centre):
                centre = z[k - 1, j] if k > 0 else 0.0
            z[k, j] = centre
            if seen:
                # tan(roll) = q cos(grade): roll turns about the body's own, inclined x axis.
                cos_grade = 1.0 / np.sqrt(1.0 + rise * rise)
                tan_roll = lean * cos_grade
                grade[k, j] = np.arctan(rise)
                sin_grade[k, j] = rise * cos_grade
                sin_roll[k, j] = tan_roll / np.sqrt(1.0 + tan_roll * tan_roll)
            else:
                grade[k, j] = 0.0
                sin_grade[k, j] = 0.0
                sin_roll[k, j] = 0.0
            if k == 0:
                station[k, j] = 0.0
            else:
                dx = x[k, j] - x[k - 1, j]
                dy = y[k, j] - y[k - 1, j]
                dz = centre - z[k - 1, j] if k > 1 or known[0, j] else 0.0
                station[k, j] = station[k - 1, j] + np.sqrt(dx * dx + dy * dy + dz * dz)


@kernel
def _surfaces_under_wheels(
    terrain_class: Ints, origin_x: float, origin_y: float, per_metre: float,
    x: Floats, y: Floats, heading_x: Floats, heading_y: Floats,
    half_length: float, half_width: float, surfaces: Ints,
) -> None:  # fmt: skip
    rows, columns = terrain_class.shape
    stations, candidates = x.shape
    for k in range(stations):
        for j in range(candidates):
            bits = 0
            hx, hy = heading_x[k, j], heading_y[k, j]
            for wheel in range(5):
                along = half_length * (0.0 if wheel == 4 else (1.0 if wheel < 2 else -1.0))
                across = half_width * (0.0 if wheel == 4 else (1.0 if wheel % 2 == 0 else -1.0))
                px = x[k, j] + along * hx - across * hy
                py = y[k, j] + along * hy + across * hx
                column = int(np.floor((px - origin_x) * per_metre + 0.5))
                row = int(np.floor((py - origin_y) * per_metre + 0.5))
                if 0 <= row < rows and 0 <= column < columns:
                    bits |= 1 << terrain_class[row, column]
            surfaces[k, j] = bits
