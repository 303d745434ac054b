"""Obstacles of wheels and body: steps, holes, ground that reaches underside or overhangs.

Heights of the map along the track of each wheel and below the body, in the pose of the plane
nearest to the wheels. It detects obstacles that exceed a limit by a tenth or more, and ignores the
tyre's width, its travel, and rocking of the body.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Floats, Ints
from slopewise.models.vehicle import Vehicle
from slopewise.services.check.heights import Heights, height_of
from slopewise.services.check.path_ground import (
    WHEELS,
    LineGround,
    below_body,
    offset_points,
    only,
    parts_of,
)
from slopewise.services.check.plan_line import Line

_NOTHING = -np.inf
_FINEST = 0.05  # [m] between points below the body


class Struck(NamedTuple):
    """Excess of a kind of obstacle over its limit at M samples, −inf where nothing is."""

    kind: str
    excess: Floats  # (M,) share of the limit
    sentence: str
    value: Floats  # (M,) that the sentence names [m]


def obstacles_along(
    heights: Heights, line: Line, ground: LineGround, vehicle: Vehicle
) -> list[Struck]:
    """Obstacles that the vehicle would strike at the known samples of a line."""
    clearance, obstacles = vehicle.shape.clearance, []
    if clearance > 0.0:
        samples = np.flatnonzero(ground.known)
        sentence = f"ground {{0:.3f}} m above the wheels, the underside is at {clearance:.3f} m"
        highest = _above_wheels(heights, line, ground, vehicle, samples)
        for kind, height in zip(("clearance", "body"), highest, strict=True):
            obstacles.append(Struck(kind, height / clearance - 1.0, sentence, height))
    limit = vehicle.shape.max_step
    sentence = f"a step of {{0:.3f}} m at a wheel, {limit:.3f} m is the highest"
    for ahead, to_left in WHEELS if shows_steps(heights, vehicle) else ():
        x, y = offset_points(line, ahead * vehicle.wheelbase, to_left * vehicle.track_width)
        highest_step = np.where(ground.known, _steps(heights, x, y, vehicle), 0.0)
        obstacles.append(Struck("step", highest_step / limit - 1.0, sentence, highest_step))
    return obstacles


def shows_steps(heights: Heights, vehicle: Vehicle) -> bool:
    """Whether cells are small enough to show a step to a wheel."""
    return heights.resolution <= vehicle.wheel_radius


def _above_wheels(
    heights: Heights, line: Line, ground: LineGround, vehicle: Vehicle, samples: Ints
) -> Floats:
    """(2, M) highest ground above the plane of the wheels, between them and next to them [m].

    At points that cover the body, at these samples; −inf at all others.
    """
    ahead, to_left = below_body(vehicle, max(0.5 * heights.resolution, _FINEST))
    inside = np.abs(ahead) <= 0.5 * vehicle.wheelbase
    inside &= np.abs(to_left) <= 0.5 * vehicle.track_width
    highest = np.full((2, len(line.x)), _NOTHING)
    for part in parts_of(samples):
        x, y = offset_points(only(line, part), ahead[:, None], to_left[:, None])
        wheels = ground.wheels[:, part]
        rise = (wheels[0] + wheels[1] - wheels[2] - wheels[3]) / (2.0 * vehicle.wheelbase)
        cross_slope = (wheels[0] + wheels[2] - wheels[1] - wheels[3]) / (2.0 * vehicle.track_width)
        plane = wheels.mean(axis=0) + ahead[:, None] * rise + to_left[:, None] * cross_slope
        # Below the body the vertical is longer than the clearance by the slope.
        above = (height_of(heights, x, y) - plane) / np.sqrt(1.0 + rise**2 + cross_slope**2)
        above = np.nan_to_num(above, nan=-1e3)
        for i, which in enumerate((inside, ~inside)):
            highest[i, part] = np.max(above[which], axis=0)
    return highest


def _steps(heights: Heights, x: Floats, y: Floats, vehicle: Vehicle) -> Floats:
    """Rise over a short length of a wheel's track, beyond that of the lengths before and after."""
    along = np.concatenate(([0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))))
    window = max(1.5 * heights.resolution, 0.5 * vehicle.wheel_radius)
    parts, highest = 4, np.zeros(len(along))
    if along[-1] < 3.0 * window:
        return highest
    s = np.arange(0.0, along[-1], window / parts)
    z = height_of(heights, np.interp(s, along, x), np.interp(s, along, y))
    rise = z[parts:] - z[:-parts]
    before, middle_rise, after = rise[: -2 * parts], rise[parts:-parts], rise[2 * parts :]
    # A slope continues before or behind; a step does not.
    sign = np.sign(middle_rise)
    slope = np.maximum(np.maximum(sign * before, sign * after), 0.0)
    step = np.nan_to_num(np.abs(middle_rise) - slope, nan=0.0)
    middle = s[parts : parts + len(middle_rise)] + 0.5 * window
    sample = np.clip(np.searchsorted(along, middle, "right") - 1, 0, len(along) - 1)
    np.maximum.at(highest, sample, step)
    return highest
