"""Obstacles of wheels and body: steps, holes, ground that reaches underside or overhangs.

Heights of the map along the track of each wheel and below the body, in the pose of the plane
nearest to the wheels; a gap is as deep as a tyre sinks into it. It detects obstacles that exceed a
limit by a tenth or more, and ignores the travel of a tyre and rocking of the body.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from slopewise.models.arrays import Floats, Ints
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.vehicle import Vehicle
from slopewise.services.check.body_on_line import Body
from slopewise.services.check.contact_heights import contact_height
from slopewise.services.check.path_ground import LineGround, below_body, parts_of
from slopewise.services.physics.body import WHEELS, plane_of, points_of
from slopewise.services.physics.heights import height_of

_NOTHING = -np.inf
_FINEST = 0.05  # [m] between points below the body
_PARTS = 4  # of the length over which a step rises
_HALF, _QUARTER = _PARTS // 2, 0.25  # of these, and of a rise: an edge is as sharp as cells
_PLACES = (1, 2)  # along each edge of a cell where tyres are set on gaps: the deeper one counts
_CLIMB = 1.5  # of the distance over which a tyre climbs a step [1]: places are sampled


class Struck(NamedTuple):
    """Excess of a kind of obstacle over its limit at M samples, −inf where nothing is."""

    kind: str
    excess: Floats  # (M,) share of the limit
    sentence: str
    value: Floats  # (M,) that the sentence names [m]


def obstacles_along(
    heights: ElevationMap, body: Body, ground: LineGround, vehicle: Vehicle
) -> list[Struck]:
    """Obstacles that the vehicle would strike at the known samples of a line."""
    clearance, obstacles = vehicle.shape.clearance, []
    if clearance > 0.0:
        samples = np.flatnonzero(ground.known)
        sentence = f"ground {{0:.3f}} m above the wheels, the underside is at {clearance:.3f} m"
        highest = _above_wheels(heights, body, ground, vehicle, samples)
        for kind, height in zip(("clearance", "body"), highest, strict=True):
            obstacles.append(Struck(kind, height / clearance - 1.0, sentence, height))
    limit = vehicle.shape.max_step
    sentence = f"a step of {{0:.3f}} m at a wheel, {limit:.3f} m is the highest"
    for ahead, to_left in WHEELS if shows_steps(heights, vehicle) else ():
        wheel = ahead * vehicle.wheelbase, to_left * vehicle.track_width
        highest_step = np.where(ground.known, _steps_of(heights, body, wheel, vehicle), 0.0)
        obstacles.append(Struck("step", highest_step / limit - 1.0, sentence, highest_step))
    return obstacles


def shows_steps(heights: ElevationMap, vehicle: Vehicle) -> bool:
    """Whether cells are small enough to show a step to a wheel."""
    return heights.resolution <= vehicle.wheel_radius


def _above_wheels(
    heights: ElevationMap, body: Body, ground: LineGround, vehicle: Vehicle, samples: Ints
) -> Floats:
    """(2, M) highest ground above the plane of the wheels, between them and next to them [m].

    At points that cover the body, at these samples; −inf at all others.
    """
    highest = np.full((2, len(body.x)), _NOTHING)
    for part in parts_of(samples):
        some = body.only(part)
        ahead, to_left = below_body(vehicle, some, max(0.5 * heights.resolution, _FINEST))
        inside = np.abs(ahead) <= 0.5 * vehicle.wheelbase
        inside = inside & (np.abs(to_left) <= 0.5 * vehicle.track_width)
        x, y = points_of(some.pose, ahead, to_left)
        wheels = ground.wheels[:, part]
        rise, cross_rise = plane_of(wheels, vehicle)
        plane = wheels.mean(axis=0) + ahead * rise + to_left * cross_rise
        # Below the body the vertical is longer than the clearance by the slope.
        above = (height_of(heights, x, y) - plane) / np.sqrt(1.0 + rise**2 + cross_rise**2)
        above = np.nan_to_num(above, nan=-1e3)
        for i, which in enumerate((inside, ~inside)):
            highest[i, part] = np.where(which, above, _NOTHING).max(axis=0)
    return highest


def _steps_of(
    heights: ElevationMap, body: Body, wheel: tuple[float, float], vehicle: Vehicle
) -> Floats:
    """(M,) highest step that a wheel may meet, on its lines within the band and across them [m].

    ``wheel`` is its place ahead of, and to the left of, the middle of the wheelbase [m].
    """
    band = body.band(wheel[0])
    stride = max(heights.resolution, 0.5 * vehicle.shape.wheel_width)
    count = math.ceil(float(band.max()) / stride)
    highest = _edges(heights, body, wheel, vehicle)
    for share in np.linspace(-1.0, 1.0, 2 * count + 1) if count else (0.0,):
        line = points_of(body.pose, wheel[0], wheel[1] + share * band)
        np.maximum(highest, _steps(heights, *line, body.heading, vehicle), out=highest)
    return highest


def _edges(
    heights: ElevationMap, body: Body, wheel: tuple[float, float], vehicle: Vehicle
) -> Floats:
    """(M,) highest edge along the path within the band of a wheel [m].

    Ground that rises counts where all of it is within the band, ground that falls where its middle
    is: with its own middle beyond an edge a wheel no longer stands on it. A gap that a tyre bridges
    along the path has no edges; nor does one count that the wheel stands on at first, until it has
    left it or turned by two radii.
    """
    window, band = step_length(heights, vehicle), body.band(wheel[0])
    count = _PARTS * math.ceil(float(band.max()) / window + 1.5)
    across = window / _PARTS * np.linspace(-count, count, 2 * count + 1)[:, None]
    place = points_of(body.pose, wheel[0], wheel[1] + across)
    z = height_of(heights, *place)
    rise = _rises(z)
    middle = across[_PARTS : _PARTS + len(rise)] + 0.5 * window
    outward = rise * np.sign(middle)
    within = band - np.where(outward > 0.0, 0.5 * window, 0.0)
    # Without a band its middle is under that of the wheel where both halves hold some of it.
    halves = np.abs(z[_HALF:] - z[:-_HALF])[_PARTS:-_PARTS]
    is_under = np.minimum(halves[:-_HALF], halves[_HALF:]) >= _QUARTER * np.abs(rise)
    counts = (np.abs(middle) <= within) & (is_under | (band > 0.0))
    edges = np.where(counts, np.abs(rise), 0.0)
    touched = np.abs(middle) <= band + 0.5 * (window + vehicle.shape.wheel_width)
    is_on_edge = np.where(touched, np.abs(rise), 0.0).max(axis=0) > vehicle.shape.max_step
    driven = np.hypot(body.x - body.x[0], body.y - body.y[0])
    is_there = np.logical_and.accumulate(is_on_edge) & (driven < 2.0 * vehicle.wheel_radius)
    edges = np.where(is_there, 0.0, edges)
    steep = np.flatnonzero(edges.max(axis=0) > vehicle.shape.max_step)
    if len(steep):
        climb = _climb_across(heights, body.only(steep), wheel, vehicle, across)
        edges[:, steep] = np.minimum(edges[:, steep], climb[_PARTS : _PARTS + len(edges)])
    highest: Floats = edges.max(axis=0)
    return highest


def _climb_across(
    heights: ElevationMap, body: Body, wheel: tuple[float, float], vehicle: Vehicle, across: Floats
) -> Floats:
    """(K, M) largest climbs of a tyre that is off its line by distances (K, 1) to the left [m]."""
    window = step_length(heights, vehicle)
    more = 2 * _climb_parts(window, vehicle)
    step = window / _PARTS
    beyond = step * np.arange(1, more + 1)[:, None]
    wider = np.concatenate((across[0] - beyond[::-1], across, across[-1] + beyond))
    x, y = points_of(body.pose, wheel[0], wheel[1] + wider)
    heading = np.broadcast_to(body.heading, x.shape)
    return _climb_along(heights, x, y, heading, vehicle)[more:-more]


def _climb_along(
    heights: ElevationMap, x: Floats, y: Floats, heading: Floats, vehicle: Vehicle
) -> Floats:
    """(S, M) largest climb of tyres along M lines, at points a part of a window apart [m]."""
    window, highest = step_length(heights, vehicle), np.zeros(x.shape)
    for places in _PLACES:
        at_rest = contact_height(heights, x.ravel(), y.ravel(), heading.ravel(), vehicle, places)
        climb = [_largest_climb(z, window, vehicle) for z in at_rest.reshape(x.shape).T]
        np.maximum(highest, np.transpose(climb), out=highest)
    return highest


def step_length(heights: ElevationMap, vehicle: Vehicle) -> float:
    """Length over which a step rises, so that its place is known to a half of it [m]."""
    return max(1.5 * heights.resolution, 0.5 * vehicle.wheel_radius)


def _rises(z: Floats) -> Floats:
    """Rise over each window beyond that of the windows before and after, 0 where unknown [m].

    Heights are those of points along the first axis, :data:`_PARTS` a window.
    """
    rise = z[_PARTS:] - z[:-_PARTS]
    before, middle, after = rise[: -2 * _PARTS], rise[_PARTS:-_PARTS], rise[2 * _PARTS :]
    # A slope continues before or behind; a step does not.
    sign = np.sign(middle)
    slope = np.maximum(np.maximum(sign * before, sign * after), 0.0)
    beyond: Floats = np.nan_to_num(sign * np.maximum(np.abs(middle) - slope, 0.0), nan=0.0)
    return beyond


def _steps(
    heights: ElevationMap, x: Floats, y: Floats, heading: Floats, vehicle: Vehicle
) -> Floats:
    """Rise over a short length of a wheel's track, beyond that of the lengths before and after.

    A tyre is as high as that only where it does not bridge the gap: what its lowest point rises
    over a length that holds all of its climb counts at most.
    """
    along = np.concatenate(([0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))))
    window = step_length(heights, vehicle)
    highest = np.zeros(len(along))
    if along[-1] < 3.0 * window:
        return highest
    s = np.arange(0.0, along[-1], window / _PARTS)
    places = np.interp(s, along, x), np.interp(s, along, y)
    step = np.abs(_rises(height_of(heights, *places)))
    first = _PARTS + np.arange(len(step))
    if step.max(initial=0.0) > vehicle.shape.max_step:
        east, north, turned = (at[:, None] for at in (*places, np.interp(s, along, heading)))
        climb = _climb_along(heights, east, north, turned, vehicle)
        np.minimum(step, climb[first, 0], out=step)
    middle = s[first] + 0.5 * window
    sample = np.clip(np.searchsorted(along, middle, "right") - 1, 0, len(along) - 1)
    np.maximum.at(highest, sample, step)
    return highest


def _largest_climb(at_rest: Floats, window: float, vehicle: Vehicle) -> Floats:
    """(S,) largest climb or fall of a tyre around places a part of a window apart [m].

    Its centre climbs a step over √(R² − (R − h)²). What is unknown is as high as what is next to
    it: only what is known makes it climb.
    """
    length, known = _climb_parts(window, vehicle), np.flatnonzero(np.isfinite(at_rest))
    if len(known) == 0:
        return np.full(len(at_rest), np.inf)
    filled = np.interp(np.arange(len(at_rest) + length), known, at_rest[known])
    rise = filled[length:] - filled[:-length]
    padded = np.pad(rise, length)
    # A slope with the step continues below it from either side, unless it turns there; one against
    # it from both: a gap that is bridged falls on one side, and rises as far on the other.
    slopes = np.sign(rise) * np.array([padded[: len(rise)], padded[2 * length :]])
    with_it, on_both = np.maximum(slopes.max(axis=0), 0.0), np.maximum(-slopes.max(axis=0), 0.0)
    turning = np.minimum(with_it, np.maximum(-slopes.min(axis=0), 0.0))
    change = np.maximum(np.abs(rise) - with_it + turning + on_both, 0.0)
    # Stretches that hold all of a step begin before it by no more than they are longer.
    more = length - _PARTS
    largest: Floats = sliding_window_view(np.pad(change, (more, 0), mode="edge"), more + 1).max(-1)
    return largest


def _climb_parts(window: float, vehicle: Vehicle) -> int:
    """Parts of a window over which a tyre climbs the highest step, and that step rises."""
    radius, limit = vehicle.wheel_radius, vehicle.shape.max_step
    contact = math.sqrt(radius**2 - max(radius - limit, 0.0) ** 2)
    return _PARTS + math.ceil(_CLIMB * contact / window * _PARTS)
