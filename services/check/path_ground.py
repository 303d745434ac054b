"""Ground under the wheels along a line, sampled from the map."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Bools, Floats, Ints
from slopewise.models.vehicle import Vehicle
from slopewise.services.check.body_on_line import Body
from slopewise.services.check.contact_heights import contact_height
from slopewise.services.check.heights import Heights, cell_is_known, classes_around
from slopewise.services.check.plan_line import Line

_CURVATURE_SPAN = 0.25
"""Of the wheelbase, on either side: over that the vertical curvature is taken."""

_CHUNK = 4096  # Samples whose ground below the body is sampled together: 30 MB of points

_TRAILED = 0.01  # [m] that corners of a body are uncertain whose heading trails: 0.007 rad of rows

WHEELS = ((0.5, 0.5), (0.5, -0.5), (-0.5, 0.5), (-0.5, -0.5))
"""Front left, front right, rear left, rear right: wheelbases ahead, track widths to the left."""


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


def ground_under(heights: Heights, line: Line, vehicle: Vehicle) -> LineGround:
    """Sample the map along a line.

    The plane nearest to four contact points rises by the mean of front minus rear over the
    wheelbase, and leans by the mean of left minus right over the track width. Roll turns about
    the inclined axis of the body, so its tangent is the lean times cos θ.
    """
    length, width = vehicle.wheelbase, vehicle.track_width
    places = [
        offset_points(line.body, ahead * length, to_left * width) for ahead, to_left in WHEELS
    ]
    headings = [line.body.heading] * len(places) + [line.heading]
    places.append((line.x, line.y))
    points = np.array(
        [
            contact_height(heights, *place, heading, vehicle)
            for place, heading in zip(places, headings, strict=True)
        ]
    )
    wheels, z = points[:4], points[4]
    known = np.isfinite(points).all(axis=0)
    front, rear, left, right = (
        0.5 * (wheels[a] + wheels[b]) for a, b in ((0, 1), (2, 3), (0, 2), (1, 3))
    )
    grade = np.where(known, np.arctan((front - rear) / length), 0.0)
    roll = np.where(known, np.arctan((left - right) / width * np.cos(grade)), 0.0)
    station = _stations(line, z)
    classes = np.any([classes_around(heights, *place) for place in places], axis=0)
    vertical_curvature = _vertical_curvature(station, grade, known, length, line)
    return LineGround(
        station,
        z,
        wheels,
        grade,
        roll,
        vertical_curvature,
        known,
        _body_known(heights, line.body, vehicle),
        classes,
    )


def offset_points(
    body: Body, ahead: float | Floats, to_left: float | Floats
) -> tuple[Floats, Floats]:
    """Points ahead of, and to the left of, the middle of the wheelbase [m]; offsets broadcast."""
    cos, sin = np.cos(body.heading), np.sin(body.heading)
    return body.x + ahead * cos - to_left * sin, body.y + ahead * sin + to_left * cos


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


def _body_known(heights: Heights, body: Body, vehicle: Vehicle) -> Bools:
    """(M,) samples without an unknown cell below the body, except where it is at the first row."""
    cos, sin = np.cos(body.heading[0]), np.sin(body.heading[0])
    shape, margin = vehicle.shape, 0.5 * heights.resolution
    known = np.ones(len(body.x), np.bool_)
    for part in parts_of(np.arange(len(body.x))):
        some = body.only(part)
        inset = _TRAILED if some.start_error.any() else 0.0
        x, y = offset_points(some, *below_body(vehicle, some, heights.resolution, inset))
        east, north = x - body.x[0], y - body.y[0]
        along, across = east * cos + north * sin, north * cos - east * sin
        under_start = (along > -shape.rear - margin) & (along < shape.front + margin)
        under_start &= np.abs(across) < 0.5 * shape.width + margin + body.band(0.0)[0]
        known[part] = np.all(cell_is_known(heights, x, y) | under_start, axis=0)
    return known


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
