"""A raw polyline: repairs of it, and reasons for refusing it.

Points may be doubled and noisy. Where a path turns round it ends for now: a plan leads forwards.
Ways that are driven backwards are refused. Most polylines need no repair, which is found out first.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.errors import ParameterError
from slopewise.planner.compiled_core import core

_DUPLICATE = 1e-3  # [m] points closer than that are one
_CUSP = math.radians(120.0)  # a sharper turn is a cusp: the vehicle turns round
_CUSP_COSINE = -0.4  # of a turn that may be one: somewhat less than a cusp is
STRAY = 0.25  # [m] noise up to which a polyline is still a path
_TIP = 0.25  # [m] of the way to a cusp and on that give its direction
_TIP_NOISE, _MAX_TIP = 6.0, 0.6  # the same in the noise of the points [1]; at most [m]


class Cleaned(NamedTuple):
    """Points of a polyline that can be planned along.

    Attributes:
        points: (n, 2), n >= 2, in a separate array [m].
        limit: (n,) speed limits at them if there are any [m/s].
        ends: why the path goes no further, empty where it goes to its end.
    """

    points: Floats
    limit: Floats | None
    ends: str = ""


def clean(points: Floats, limit: Floats | None, yaw: Floats | None) -> Cleaned:
    """Points and speed limits without duplicates, up to where the path turns round.

    Args:
        points: (n, 2) raw points, n >= 2 [m]. limit: (n,) speed limits at them [m/s].
        yaw: (n,) headings of the vehicle at them [rad].

    Raises:
        ParameterError: too short, or driven backwards.
    """
    steps = np.diff(points, axis=0)
    length = np.hypot(steps[:, 0], steps[:, 1])
    if yaw is None and length.min() >= 2.0 * _DUPLICATE and not _may_turn(points, steps, length):
        return Cleaned(points.copy(), limit)
    keep = _distinct(points, length)
    if limit is not None and not keep.all():
        groups = np.cumsum(keep) - 1
        lowest = np.full(groups[-1] + 1, np.inf)
        np.minimum.at(lowest, groups, limit)
        limit = lowest
    points = points[keep]
    if len(points) < 2:
        raise ParameterError("points", "at least 2 distinct points, all are the same place")
    points, ends = _up_to_cusp(points)
    limit = limit if limit is None else limit[: len(points)]
    if yaw is not None:
        steps = np.diff(points, axis=0)
        headings = np.arctan2(steps[:, 1], steps[:, 0])
        backwards = np.cos(yaw[keep][: len(steps)] - headings) < 0.0
        if np.mean(backwards) > 0.5:
            raise ParameterError("yaw", "the direction of travel: this path is driven backwards")
    return Cleaned(points, limit, ends)


def _distinct(points: Floats, length: Floats) -> np.ndarray:
    """(n,) true for points that are not where the one before is."""
    keep = np.ones(len(points), np.bool_)
    if length.min() < _DUPLICATE:
        last = 0
        for i in range(1, len(points)):
            keep[i] = not np.hypot(*(points[i] - points[last])) < _DUPLICATE
            last = i if keep[i] else last
    return keep


def _may_turn(points: Floats, steps: Floats, length: Floats) -> bool:
    """Whether a polyline may turn round: its steps point back, or all of it turns that far."""
    along = (steps[1:] * steps[:-1]).sum(axis=1)
    if (along < _CUSP_COSINE * length[1:] * length[:-1]).any():
        return True
    # Steps shorter than the tip of a cusp may go round it one by one.
    turns = 1.0 - along / (length[1:] * length[:-1])
    return bool(len(turns) > 1 and length.min() < _TIP and turns.max() > 0.5)


def _up_to_cusp(points: Floats) -> tuple[Floats, str]:
    """Points up to where the path turns round, and a sentence about that.

    Noise makes short segments point anywhere; a cusp is one that survives at vehicle scale.
    """
    if len(points) < 3:
        return points, ""
    reach = min(max(_TIP_NOISE * noise(points), _TIP), _MAX_TIP)
    i = core.first_turn(points, reach, _CUSP)
    if i == 0:
        return points, ""
    x, y = points[i]
    return points[
        : i + 1
    ].copy(), f"the path turns round at ({x:.2f}, {y:.2f}): from there it is another path"


def noise(points: Floats) -> float:
    """Noise of points (n, 2) [m], robust: third differences of a smooth path nearly vanish.

    Fewer than 8 points have none.
    """
    if len(points) < 8:
        return 0.0
    return 1.4826 * core.third_difference(points) / math.sqrt(20.0)


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
    stray = noise(points)
    while len(points) > 16 and stray > 0.1 * (step := core.usual_step(along)):
        if step >= coarsest:
            break
        inner = points[1 : 1 + (len(points) - 2) // 2 * 2]
        points = np.concatenate((points[:1], 0.5 * (inner[::2] + inner[1::2]), points[-1:]))
        along = arc(points)
        stray = max(stray / np.sqrt(2.0), noise(points))
    return points, along, min(stray, STRAY)
