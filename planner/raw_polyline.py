"""A polyline as somebody drew it: what can be mended in it, and what is refused.

Points may be doubled and noisy. Cusps, where the vehicle would have to turn round, and ways that
are driven backwards are refused. Most polylines have nothing to mend, which is found out first.
"""

from __future__ import annotations

import math

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.errors import ParameterError
from slopewise.planner.kernels.compiled import inlined, kernel

_DUPLICATE = 1e-3  # [m] points closer than that are one
_CUSP = np.deg2rad(120.0)  # a turn sharper than that from one segment to the next is a cusp
_CUSP_COSINE = -0.4  # of a turn that may be one: somewhat less than a cusp is
STRAY = 0.25  # [m] noise up to which a polyline is still a path


def clean(points: Floats, limit: Floats | None, yaw: Floats | None) -> tuple[Floats, Floats | None]:
    """Points and speed limits without duplicates.

    Args:
        points: (n, 2) as they were drawn, n >= 2 [m]. limit: (n,) speed limits at them [m/s].
        yaw: (n,) headings of the vehicle at them [rad].

    Returns:
        Points in an array of their own, at least 2, and the limits at them if there are any.

    Raises:
        ParameterError: too short, a cusp, or driven backwards.
    """
    if yaw is None and not _needs_a_look(points):
        return points.copy(), limit
    keep = np.ones(len(points), np.bool_)
    if np.any(np.hypot(*np.diff(points, axis=0).T) < _DUPLICATE):
        last = 0
        for i in range(1, len(points)):
            keep[i] = not np.hypot(*(points[i] - points[last])) < _DUPLICATE
            last = i if keep[i] else last
    if limit is not None and not keep.all():
        groups = np.cumsum(keep) - 1
        lowest = np.full(groups[-1] + 1, np.inf)
        np.minimum.at(lowest, groups, limit)
        limit = lowest
    points = points[keep]
    if len(points) < 2:
        raise ParameterError("points", "at least 2 distinct points, all are the same place")
    steps = np.diff(points, axis=0)
    headings = np.arctan2(steps[:, 1], steps[:, 0])
    turns = np.abs(np.angle(np.exp(1j * np.diff(headings))))
    # Noise makes short segments point anywhere; a cusp is one that survives at vehicle scale.
    long_enough = np.minimum(np.hypot(*steps[:-1].T), np.hypot(*steps[1:].T)) > STRAY
    if np.any(cusp := (turns > _CUSP) & long_enough):
        i = int(np.flatnonzero(cusp)[0]) + 1
        raise ParameterError(
            f"points[{i}]",
            f"a path without cusps: it turns by {np.rad2deg(turns[i - 1]):.0f}° at "
            f"({points[i, 0]:.2f}, {points[i, 1]:.2f}); split it there",
        )
    if yaw is not None:
        backwards = np.cos(yaw[keep][:-1] - headings) < 0.0
        if np.mean(backwards) > 0.5:
            raise ParameterError("yaw", "the direction of travel: this path is driven backwards")
    return points, limit


@kernel
def _needs_a_look(points: Floats) -> bool:
    """Whether points (n, 2) may hold duplicates or cusps: few do, and finding out is quick."""
    before_x, before_y, before = 0.0, 0.0, 0.0
    for i in range(1, points.shape[0]):
        x, y = points[i, 0] - points[i - 1, 0], points[i, 1] - points[i - 1, 1]
        step = math.hypot(x, y)
        turned_round = before_x * x + before_y * y < _CUSP_COSINE * before * step
        if step < 2.0 * _DUPLICATE or turned_round:
            return True
        before_x, before_y, before = x, y, step
    return False


@kernel
def noise(points: Floats) -> float:
    """Noise of points (n, 2) [m], robust: third differences of a smooth path nearly vanish.

    Fewer than 8 points have none.
    """
    if len(points) < 8:
        return 0.0
    third = points[3:] - 3.0 * points[2:-1] + 3.0 * points[1:-2] - points[:-3]
    return float(1.4826 * np.median(np.abs(third)) / math.sqrt(20.0))


@kernel
def arc(points: Floats) -> Floats:
    """Distance of each point (n, 2) from the first along the polyline, (n,) [m]."""
    along = np.zeros(points.shape[0])
    for i in range(1, points.shape[0]):
        x, y = points[i, 0] - points[i - 1, 0], points[i, 1] - points[i - 1, 1]
        along[i] = along[i - 1] + math.hypot(x, y)
    return along


@inlined
def project(
    x: float, y: float, x_2: float, y_2: float, at_x: float, at_y: float
) -> tuple[float, float]:
    """Where a point lies along a segment, < 0 before and > 1 behind it; squared distance to it."""
    dx, dy = x_2 - x, y_2 - y
    to_x, to_y = at_x - x, at_y - y
    share = (to_x * dx + to_y * dy) / max(dx * dx + dy * dy, 1e-18)
    inside = min(max(share, 0.0), 1.0)
    return share, (inside * dx - to_x) ** 2 + (inside * dy - to_y) ** 2


@kernel
def first_cusp(points: Floats) -> int:
    """Index of the first of points (n, 2) at which a line turns round, 0 if it never does."""
    before_x, before_y = 0.0, 0.0
    for i in range(1, points.shape[0]):
        x, y = points[i, 0] - points[i - 1, 0], points[i, 1] - points[i - 1, 1]
        if math.hypot(x, y) < _DUPLICATE:
            continue
        if abs(math.atan2(before_x * y - before_y * x, before_x * x + before_y * y)) > _CUSP:
            return i - 1
        before_x, before_y = x, y
    return 0


@kernel
def _usual_step(along: Floats) -> float:
    return float(np.median(np.diff(along)))


def without_noise(points: Floats, along: Floats) -> tuple[Floats, Floats, float]:
    """Average neighbours until noise no longer decides where a segment points.

    Returns:
        Points, their distance along, and the noise that is left in them [m].
    """
    stray = noise(points)
    while len(points) > 16 and stray > 0.1 * _usual_step(along):
        inner = points[1 : 1 + (len(points) - 2) // 2 * 2]
        points = np.concatenate((points[:1], 0.5 * (inner[::2] + inner[1::2]), points[-1:]))
        along = arc(points)
        stray = max(stray / np.sqrt(2.0), noise(points))
    return points, along, min(stray, STRAY)
