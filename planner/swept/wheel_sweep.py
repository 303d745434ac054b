"""Steps, drops and holes under the wheels of one pose, and a wheel in the air."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.planner.kernels.compiled import inlined
from slopewise.planner.swept.findings import Finding, Kind
from slopewise.planner.swept.sizes import SweptSizes
from slopewise.planner.swept.tyre_profile import Facets, TyreLine, tyre_profile
from slopewise.planner.swept.wheel_path import NO_GROUND, Pose, drop_of_rim

_NOTHING, _RISE, _DROP, _TWIST = (
    int(Kind.NOTHING),
    int(Kind.RISE),
    int(Kind.DROP),
    int(Kind.TWIST),
)

STEEPEST = 0.6
"""Slope that explains a climb or a fall at most, 31°."""

SLOPE_OPEN = 0.055
"""So much of the slope around a wheel explains no climb [1]: a step at the limit adds as much."""

_ABYSS = 0.5 * NO_GROUND
"""Heights below are no ground [m]: half of the marker, since heights are interpolated."""


class Slopes(NamedTuple):
    """Of the ground around a wheel, along its way and to the left [1], NaN where unknown."""

    along: float
    across: float


@inlined
def wheel_at(wheel: int, sizes: SweptSizes) -> tuple[float, float]:
    """Where a wheel is, ahead and to the left of the middle of the wheelbase [m].

    Front left, front right, rear left, rear right.
    """
    ahead = sizes.half_length if wheel < 2 else -sizes.half_length
    return ahead, sizes.half_width if wheel % 2 == 0 else -sizes.half_width


@inlined
def twisted(contact: Floats, sizes: SweptSizes) -> Finding:
    """A wheel that hangs farther below the plane of the other three than it travels.

    Args:
        contact: (4,) heights of the wheels [m]. sizes: of the vehicle.
    """
    twist = contact[0] - contact[1] - contact[2] + contact[3]
    if abs(twist) > sizes.wheel_travel:
        # Of the two wheels that the ground leaves, the front one is named.
        aside = -sizes.half_width if twist > 0.0 else sizes.half_width
        return Finding(_TWIST, abs(twist), sizes.half_length, aside)
    return Finding(_NOTHING, 0.0, 0.0, 0.0)


@inlined
def step_met(
    ground: Facets,
    pose: Pose,
    wheel: int,
    back: float,
    sizes: SweptSizes,
    slopes: Slopes,
    scratch: Floats,
) -> Finding:
    """The first step or drop that a wheel meets on the last piece of its way.

    The centre of the wheel runs on the upper envelope of circles over the ground. Where it climbs
    or falls faster than the ground before and after explains, there is a step.

    Args:
        ground: of the map around. pose: of the vehicle. wheel: as of :func:`wheel_at`.
        back: how far the pose before is behind this one [m].
        sizes: of the vehicle.
        slopes: of the ground around the wheel; they explain a climb, and what one edge of the tyre
            is above the other, but for :data:`SLOPE_OPEN`, which a step itself may add to them.
        scratch: (2, many) room for the profile.
    """
    ahead, aside = wheel_at(wheel, sizes)
    around = slopes.along
    profile, path = scratch[0], scratch[1]
    stride = sizes.stride
    rim, far = int(sizes.radius / stride), int(sizes.trend / stride + 0.5)
    chord, behind = int(sizes.chord / stride + 0.5), int(np.ceil(back / stride))
    # Samples from the first one that the trend before rests on.
    first = rim + far
    last = min(first + behind, profile.shape[0] - (chord + 2 * rim + far) - 1)
    line = TyreLine(ahead - (behind + first) * stride, aside, _beyond_doubt(slopes.across))
    tyre_profile(ground, pose, line, first - rim, last + chord + rim + 1, sizes, profile)
    if _even(profile, first, last + chord, rim, sizes, around):
        return Finding(_NOTHING, 0.0, 0.0, 0.0)
    _roll(profile, path, first, last + chord, rim, sizes)
    least, most = np.inf, -np.inf
    for n in range(first, last + 1):
        rise = path[n + chord] - path[n]
        least, most = min(least, rise), max(most, rise)
    climbs = most - (around - SLOPE_OPEN) * sizes.chord
    falls = (around + SLOPE_OPEN) * sizes.chord - least
    if max(climbs, falls) <= sizes.steepest:
        return Finding(_NOTHING, 0.0, 0.0, 0.0)
    end = last + chord + 2 * rim + far
    tyre_profile(ground, pose, line, 0, first - rim, sizes, profile)
    tyre_profile(ground, pose, line, last + chord + rim + 1, end + 1, sizes, profile)
    _roll(profile, path, rim, end - rim, rim, sizes)
    for n in range(first, last + 1):
        found = _judged(path, n, (chord, rim, far), sizes, around)
        if found.kind != _NOTHING:
            return Finding(found.kind, found.height, line.begin + (n + chord) * stride, aside)
    return Finding(_NOTHING, 0.0, 0.0, 0.0)


@inlined
def _beyond_doubt(slope: float) -> float:
    """What of a slope no step can have added; 0 where it is unknown."""
    return float(np.copysign(max(abs(slope) - SLOPE_OPEN, 0.0), slope) if slope == slope else 0.0)


@inlined
def _even(
    profile: Floats, first: int, last: int, rim: int, sizes: SweptSizes, around: float
) -> bool:
    """Is the ground too even for any step? On a slope a wheel touches a little uphill.

    The rim of a wheel on a slope a reaches max(a x - drop(x)) = R (sqrt(1 + a²) - 1) above its
    lowest point, so what is left of the ground without its slope bounds every climb.
    """
    least, most = np.inf, -np.inf
    for n in range(first, last + 1):
        left = profile[n] - around * n * sizes.stride
        least, most = min(least, left), max(most, left)
    for n in range(first - rim, first):
        most = max(most, profile[n] - around * n * sizes.stride)
    for n in range(last + 1, last + rim + 1):
        most = max(most, profile[n] - around * n * sizes.stride)
    lift = sizes.radius * (np.sqrt(1.0 + around * around) - 1.0)
    return bool(most - least + lift <= sizes.cleared)


@inlined
def _roll(
    profile: Floats, path: Floats, first: int, last: int, rim: int, sizes: SweptSizes
) -> None:
    """Height of the lowest point of a wheel along its profile, from a first to a last sample."""
    for n in range(first, last + 1):
        path[n] = profile[n]
    for away in range(1, rim + 1):
        drop = drop_of_rim(sizes.radius, away * sizes.stride)
        for n in range(first, last + 1):
            beside = max(profile[n - away], profile[n + away]) - drop
            path[n] = max(path[n], beside) + 0.0
    for n in range(first, last + 1):
        # Into unknown ground a wheel does not fall.
        path[n] = path[n] if profile[n] > _ABYSS else NO_GROUND


@inlined
def _slope(start: float, end: float, length: float) -> float:
    """Between two heights, NaN where one is unknown; nothing steeper is the ground's own slope."""
    if min(start, end) < _ABYSS:
        return np.nan
    return min(max((end - start) / length, -STEEPEST), STEEPEST)


@inlined
def _judged(
    path: Floats, n: int, samples: tuple[int, int, int], sizes: SweptSizes, around: float
) -> Finding:
    """Is what begins at sample n a step? Nobody knows where the ground beside it is unknown.

    What comes after counts from a wheel radius on: until then a wheel may still be falling.
    """
    chord, rim, far = samples
    length, end = far * sizes.stride, n + chord + rim
    before = _slope(path[n - far], path[n], length)
    after = _slope(path[end], path[end + far], length)
    before = after if np.isnan(before) else before
    after = before if np.isnan(after) else after
    if np.isnan(before):
        before = after = around
    if np.isnan(before) or min(path[n], path[n + chord]) < _ABYSS:
        return Finding(_NOTHING, 0.0, 0.0, 0.0)
    rise = path[n + chord] - path[n]
    uphill, downhill = max(before, after), min(before, after)
    if not np.isnan(around):
        uphill = max(uphill, around - SLOPE_OPEN)
        downhill = min(downhill, around + SLOPE_OPEN)
    if rise - uphill * sizes.chord > sizes.steepest:
        return Finding(_RISE, _whole(path, n, chord, uphill, sizes), 0.0, 0.0)
    if downhill * sizes.chord - rise > sizes.steepest:
        return Finding(_DROP, -_whole(path, n, chord, downhill, sizes), 0.0, 0.0)
    return Finding(_NOTHING, 0.0, 0.0, 0.0)


@inlined
def _whole(path: Floats, n: int, chord: int, slope: float, sizes: SweptSizes) -> float:
    """All of a step that begins at sample n, up to a wheel radius on: rising or falling [m]."""
    whole = 0.0
    for ahead in range(chord, int(sizes.radius / sizes.stride) + chord):
        risen = path[n + ahead] - path[n] - slope * ahead * sizes.stride
        if abs(risen) > abs(whole):
            whole = risen
    return whole
