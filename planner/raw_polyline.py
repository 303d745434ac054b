"""A raw polyline: repairs of it, and reasons for refusing it.

Points may be doubled and noisy. Where a path turns round it ends for now: a plan leads forwards.
Ways that are driven backwards are refused. Most polylines need no repair, which is found out first.
"""

from __future__ import annotations

import math

import numpy as np

from slopewise.models.arrays import Bools, Floats, Ints
from slopewise.models.errors import ParameterError
from slopewise.models.quantity import degrees_hint
from slopewise.planner.compiled_core import core

_DUPLICATE = 1e-3  # [m] points closer than that are one
_CUSP = math.radians(120.0)  # a sharper turn is a cusp: the vehicle turns round
_CUSP_COSINE = -0.4  # of a turn that may be one: somewhat less than a cusp is
MAX_NOISE = 0.25  # [m] noise up to which a polyline is still a path
_DENSE = 2.0  # points in a group on average from which on they are averaged [1]
_CROWD = 8  # points in a group from which on they are averaged: a vehicle stood there [1]
_GROUP_NOISE = 3.0  # length of a group at least, in the noise of its points [1]
_GRID_STEPS = 8  # different steps of a search over a grid at most [1]
_SAME_STEP = 1e-5  # [m] steps that differ less are the same
_BEFORE_TIP = 4  # groups before the tip of a cusp [1]: the tip is the point farthest from there
_TIP = 0.25  # [m] of the way to a cusp and on that give its direction
_TIP_NOISE, _MAX_TIP = 6.0, 0.6  # the same in the noise of the points [1]; at most [m]


def clean(
    points: Floats, limit: Floats | None, yaw: Floats | None, reach: float = 0.0
) -> tuple[Floats, Floats | None, Floats, str]:
    """Points and speed limits without duplicates, up to where the path turns round.

    Points much closer together than ``reach``, or than a few times their noise, are averaged: one
    alone has no information on the line, and most of the work grows faster than their number.

    Args:
        points: (n, 2) raw points, n >= 2 [m]. limit: (n,) speed limits at them [m/s].
        yaw: (n,) headings of the vehicle at them [rad].
        reach: along the line [m].

    Returns:
        (m, 2) points, m >= 2, in a separate array [m]; (m,) speed limits at them if there are any
        [m/s]; raw points up to where the path ends [m]; why it goes no further, empty at its end.

    Raises:
        ParameterError: too short, or driven backwards.
    """
    given, first = points, _groups(points, reach)
    if len(first) < len(given):
        points = np.add.reduceat(given, first) / np.diff(first, append=len(given))[:, None]
        limit = limit if limit is None else np.minimum.reduceat(limit, first)
        yaw = yaw if yaw is None else yaw[first]
    steps = np.diff(points, axis=0)
    length = np.hypot(steps[:, 0], steps[:, 1])
    if yaw is None and length.min() >= 2.0 * _DUPLICATE and not _may_turn(steps, length):
        return points.copy(), limit, given.copy(), ""
    keep = _distinct(points, length)
    limit = limit if limit is None else np.minimum.reduceat(limit, np.flatnonzero(keep))
    points = points[keep]
    if len(points) < 2:
        raise ParameterError("points", "at least 2 distinct points, all are the same place")
    turn, ends = _first_turn(points), ""
    if turn > 0:
        last = _tip(points, turn, given, first[keep])
        points, given = np.append(points[:turn], given[last : last + 1], axis=0), given[: last + 1]
        limit = limit if limit is None else limit[: turn + 1]
        x, y = points[-1]
        ends = f"the path turns round at ({x:.2f}, {y:.2f}): from there it is another path"
    if yaw is not None:
        steps = np.diff(points, axis=0)
        headings = np.arctan2(steps[:, 1], steps[:, 0])
        backwards = np.cos(yaw[keep][: len(steps)] - headings) < 0.0
        if np.mean(backwards) > 0.5:
            hint = degrees_hint(float(np.abs(yaw).max()))
            expected = f"the direction of travel: this path is driven backwards{hint}"
            raise ParameterError("yaw", expected)
    return points, limit, given.copy(), ends


def _groups(points: Floats, reach: float) -> Ints:
    """First points of groups that are averaged, (m,); (n,) all points where they are not dense."""
    length = _GROUP_NOISE * min(noise(points), MAX_NOISE)
    length = reach if length <= reach or is_on_grid(points) else length
    count, first = core.group_points(points, length)
    dense = _DENSE * count <= len(points) or np.diff(first[:count]).max() >= _CROWD
    return first[:count] if dense else np.arange(len(points))


def _distinct(points: Floats, length: Floats) -> Bools:
    """(n,) true for points that are not where the one before is."""
    keep = np.ones(len(points), np.bool_)
    if length.min() < _DUPLICATE:
        last = 0
        for i in range(1, len(points)):
            keep[i] = not math.dist(points[i], points[last]) < _DUPLICATE
            last = i if keep[i] else last
    return keep


def _may_turn(steps: Floats, length: Floats) -> bool:
    """Whether a polyline may turn round: its steps point back, or all of it turns that far."""
    along = (steps[1:] * steps[:-1]).sum(axis=1)
    if (along < _CUSP_COSINE * length[1:] * length[:-1]).any():
        return True
    # Steps shorter than the tip of a cusp may go round it one by one.
    turns = 1.0 - along / (length[1:] * length[:-1])
    return bool(len(turns) > 1 and length.min() < _TIP and turns.max() > 0.5)


def _first_turn(points: Floats) -> int:
    """Index of the first point at which a path turns round, 0 if it never does.

    Noise makes short segments point anywhere; a cusp is one that survives at vehicle scale.
    """
    if len(points) < 3:
        return 0
    reach = min(max(_TIP_NOISE * noise(points), _TIP), _MAX_TIP)
    return core.first_turn(points, reach, _CUSP)


def _tip(points: Floats, turn: int, given: Floats, first: Ints) -> int:
    """Index of the given point at which a path turns round.

    Args:
        points: (n, 2) [m]; turn: index of the one where they turn round, or averaged ones.
        given: (m, 2) points [m]; first: (n,) index of the first of them that is in each of n.
    """
    if (given[first[turn]] == points[turn]).all():
        return int(first[turn])
    low, high = first[turn - 1], first[min(turn + 2, len(first) - 1)]
    away = given[low:high] - points[max(turn - _BEFORE_TIP, 0)]
    return int(low + np.argmax(np.hypot(away[:, 0], away[:, 1])))


def noise(points: Floats) -> float:
    """Noise of points (n, 2) across their line [m]: there third differences nearly vanish without.

    It is robust: a median. Fewer than 8 points have none.
    """
    if len(points) < 8:
        return 0.0
    return 1.4826 * core.third_difference(points) / math.sqrt(20.0)


def is_on_grid(points: Floats) -> bool:
    """Return True if the steps repeat: a path over a grid alternates without any noise."""
    steps = np.round((points[1:] - points[:-1]) / _SAME_STEP)
    return len(np.unique(steps[:, 0] + 1j * steps[:, 1])) <= _GRID_STEPS


def arc(points: Floats) -> Floats:
    """Distance of each point (n, 2) from the first along the polyline, (n,) [m]."""
    along = np.empty(len(points))
    along[0] = 0.0
    steps = points[1:] - points[:-1]
    np.cumsum(np.hypot(steps[:, 0], steps[:, 1]), out=along[1:])
    return along


def first_cusp(points: Floats) -> int:
    """Index of the first of points (n, 2) at which a line turns round, 0 if it never does."""
    return core.first_cusp(points, _CUSP, _DUPLICATE)


def without_noise(
    points: Floats, along: Floats, coarsest: float = math.inf
) -> tuple[Floats, Floats, float]:
    """Average neighbours until noise no longer decides where a segment points.

    Args:
        points: (n, 2); along: (n,) arc of them [m].
        coarsest: steps from which on neighbours are not averaged [m].

    Returns:
        Points, their distance along, and the noise that is left in them [m].
    """
    left = noise(points)
    while len(points) > 16 and left > 0.1 * (step := core.usual_step(along)):
        if step >= coarsest:
            break
        inner = points[1 : 1 + (len(points) - 2) // 2 * 2]
        points = np.concatenate((points[:1], 0.5 * (inner[::2] + inner[1::2]), points[-1:]))
        along = arc(points)
        left = max(left / np.sqrt(2.0), noise(points))
    return points, along, min(left, MAX_NOISE)
