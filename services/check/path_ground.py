"""Ground under the wheels along a line, sampled from the map."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Bools, Floats, Ints
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.vehicle import Vehicle
from slopewise.services.check.body_on_line import Body
from slopewise.services.check.contact_heights import contact_height
from slopewise.services.check.plan_line import Line
from slopewise.services.physics.body import plane_of, points_of, wheel_places
from slopewise.services.physics.heights import in_cells

_CURVATURE_SPAN = 0.25
"""Of the wheelbase, on either side: over that the vertical curvature is taken."""

_CHUNK = 4096  # Samples whose ground below the body is sampled together: 30 MB of points

_TRAILED = 0.01  # [m] that corners of a body are uncertain whose heading trails: 0.007 rad of rows


class LineGround(NamedTuple):
    """M samples of a line; arrays are (M,) unless stated otherwise."""

    station: Floats  # metres along the ground, in three dimensions
    z: Floats  # height that a wheel on the path would have, NaN where unknown [m]
    wheels: Floats  # (4, M) contact heights of the wheels [m]
    grade: Floats  # slope of the plane nearest to the wheels, 0 where unknown [rad]
    roll: Floats  # the same sideways
    vertical_curvature: Floats  # change of the grade along the ground, negative over a crest [1/m]
    known: Bools  # path and wheels are on known ground
    body_known: Bools  # so is all below the body
    classes: Bools  # (C, M) terrain classes that path or wheels touch


def ground_under(heights: ElevationMap, line: Line, vehicle: Vehicle) -> LineGround:
    """Sample the map along a line.

    Roll turns about the inclined axis of the body, so its tangent is the cross rise times cos θ.
    """
    body, yaw = line.body, line.body.heading
    x, y = wheel_places(vehicle, body.pose)
    x, y = np.vstack((x, line.x)), np.vstack((y, line.y))
    headings = (yaw, yaw, yaw, yaw, line.heading)
    points = np.array(
        [contact_height(heights, *at, vehicle) for at in zip(x, y, headings, strict=True)]
    )
    wheels, z = points[:4], points[4]
    known = np.isfinite(points).all(axis=0)
    rise, cross_rise = plane_of(wheels, vehicle)
    grade = np.where(known, np.arctan(rise), 0.0)
    roll = np.where(known, np.arctan(cross_rise * np.cos(grade)), 0.0)
    station = _stations(line, z)
    return LineGround(
        station,
        z,
        wheels,
        grade,
        roll,
        _vertical_curvature(station, grade, known, vehicle.wheelbase, line),
        known,
        _body_known(heights, body, vehicle),
        np.any(classes_around(heights, x, y), axis=1),
    )


def _stations(line: Line, z: Floats) -> Floats:
    """Chords between rows, in three dimensions; from an unknown height there is no step."""
    rows = line.at_row
    height = z[rows]
    for k in range(1, len(height)):
        height[k] = height[k - 1] if np.isnan(height[k]) else height[k]
    rise = np.nan_to_num(np.diff(height))
    along = np.concatenate(([0.0], np.cumsum(np.hypot(np.diff(line.flat[rows]), rise))))
    station = line.between(along)
    station[line.driven :] += line.flat[line.driven :] - line.flat[line.driven - 1]
    return station


def _vertical_curvature(
    station: Floats, grade: Floats, known: Bools, wheelbase: float, line: Line
) -> Floats:
    """Change of the grade over half a wheelbase, or over two rows where those are farther apart.

    The grade is that of wheels a wheelbase apart: what is shorter is noise of the map.
    """
    rows = station[line.at_row]
    reach = max(_CURVATURE_SPAN * wheelbase, float(np.median(np.diff(rows))))
    if known.sum() < 2:
        return np.zeros_like(station)
    s, theta = station[known], grade[known]
    low, high = (np.clip(station + sign * reach, s[0], s[-1]) for sign in (-1.0, 1.0))
    change = np.interp(high, s, theta) - np.interp(low, s, theta)
    return change / np.maximum(high - low, 0.5 * reach)


def _body_known(heights: ElevationMap, body: Body, vehicle: Vehicle) -> Bools:
    """(M,) samples without an unknown cell below the body, except where it is at the first row."""
    cos, sin = np.cos(body.heading[0]), np.sin(body.heading[0])
    shape, margin = vehicle.shape, 0.5 * heights.resolution
    known = np.ones(len(body.x), np.bool_)
    for part in parts_of(np.arange(len(body.x))):
        some = body.only(part)
        inset = _TRAILED if some.start_error.any() else 0.0
        x, y = points_of(some.pose, *below_body(vehicle, some, heights.resolution, inset))
        east, north = x - body.x[0], y - body.y[0]
        along, across = east * cos + north * sin, north * cos - east * sin
        under_start = (along > -shape.rear - margin) & (along < shape.front + margin)
        under_start &= np.abs(across) < 0.5 * shape.width + margin + body.band(0.0)[0]
        known[part] = np.all(_cell_is_known(heights, x, y) | under_start, axis=0)
    return known


def _cell_is_known(heights: ElevationMap, x: Floats, y: Floats) -> Bools:
    """Whether the one cell that holds each point is known; any shape.

    Less than a cell beyond its outermost centres the cell at its rim is used.
    """
    z = heights.elevation
    rows, columns = z.shape
    u, v = in_cells(heights, x, y)
    inside = (u > -1.0) & (v > -1.0) & (u < columns) & (v < rows)
    i = np.clip(np.floor(np.where(inside, v, 0.0) + 0.5).astype(np.int64), 0, rows - 1)
    j = np.clip(np.floor(np.where(inside, u, 0.0) + 0.5).astype(np.int64), 0, columns - 1)
    known: Bools = inside & np.isfinite(z[i, j])
    return known


def classes_around(heights: ElevationMap, x: Floats, y: Floats) -> Bools:
    """Which terrain classes the four cells around points have, (classes, …).

    Without classes all ground is class 0; so is ground off the map.
    """
    touched = np.zeros((len(heights.class_names), *np.shape(x)), np.bool_)
    classes = heights.terrain_class
    if classes is None:
        touched[0] = True
        return touched
    rows, columns = classes.shape
    u, v = in_cells(heights, np.asarray(x), np.asarray(y))
    for right in (0, 1):
        for up in (0, 1):
            i = np.clip(np.floor(v).astype(np.int64) + up, 0, rows - 1)
            j = np.clip(np.floor(u).astype(np.int64) + right, 0, columns - 1)
            np.put_along_axis(touched, classes[i, j][None], True, axis=0)
    return touched


def parts_of(samples: Ints) -> list[Ints]:
    """Samples in parts, so that points below the body take little memory together."""
    return [samples[first : first + _CHUNK] for first in range(0, len(samples), _CHUNK)]


def below_body(
    vehicle: Vehicle, body: Body, step: float, inset: float = 0.0
) -> tuple[Floats, Floats]:
    """Points that cover a body and its band at M samples, relative to the middle of the wheelbase.

    Returns:
        (P, 1) distances ahead and, (P, M) or without a band (P, 1), to the left [m].
    """
    shape, half = vehicle.shape, 0.5 * vehicle.shape.width - inset
    longer = half * body.turned - inset
    ahead = _spread(-shape.rear - longer, shape.front + longer, step)
    if not body.has_band:
        a, b = np.meshgrid(ahead, _spread(-half, half, step))
        return a.reshape(-1, 1), b.reshape(-1, 1)
    widest = half + max(float(body.band(end).max()) for end in (ahead[0], ahead[-1]))
    a, b = (v.reshape(-1, 1) for v in np.meshgrid(ahead, _spread(-1.0, 1.0, step / widest)))
    return a, b * (half + body.band(a))


def _spread(low: float, high: float, step: float) -> Floats:
    return np.linspace(low, high, int(np.clip(np.ceil((high - low) / step), 1, 16)) + 1)
