"""Where the body is on a path: middle of the wheelbase and heading, as the steering has them.

The steering centre of the body moves straight ahead, so it trails behind the reference point like
the end of a rod of length e: along each straight piece between stations exactly as a tractrix,
tan(β/2) falling by exp(−d/e) over a distance d, with β the angle between the rod and the piece.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.steering import SteeringGeometry
from slopewise.planner.kernels.compiled import inlined, kernel

_SAME_PLACE = 1e-9
"""Stations so close are one: the padding behind the last one of a candidate [m]."""


class BodyRows(NamedTuple):
    """Middle of the wheelbase [m] and unit vector of the body's heading, (N, M) each."""

    x: Floats
    y: Floats
    heading_x: Floats
    heading_y: Floats


def trailing_heading(x: Floats, y: Floats, steering: SteeringGeometry) -> tuple[Floats, Floats]:
    """Unit vectors of the body's heading, (N, M) each, for a reference point ahead of the centre.

    The turn begins steady: with the mean curvature of the first e of the path.

    Args:
        x, y: (N, M) reference points [m], padded with the last one.
        steering: geometry with ``centre_offset`` > 0.
    """
    heading_x, heading_y = np.empty_like(x), np.empty_like(y)
    _trail(x, y, steering.centre_offset, heading_x, heading_y)
    return heading_x, heading_y


@kernel
def _trail(x: Floats, y: Floats, rod: float, heading_x: Floats, heading_y: Floats) -> None:
    stations, candidates = x.shape
    for j in range(candidates):
        heading_x[0, j], heading_y[0, j] = _steady(x, y, j, rod)
    for k in range(1, stations):
        for j in range(candidates):
            dx, dy = x[k, j] - x[k - 1, j], y[k, j] - y[k - 1, j]
            step = np.sqrt(dx * dx + dy * dy)
            before_x, before_y = heading_x[k - 1, j], heading_y[k - 1, j]
            if step <= _SAME_PLACE:
                heading_x[k, j], heading_y[k, j] = before_x, before_y
                continue
            dx, dy = dx / step, dy / step
            cosine, sine = before_x * dx + before_y * dy, before_x * dy - before_y * dx
            half = sine / max(1.0 + cosine, _SAME_PLACE) * np.exp(-step / rod)
            heading_x[k, j], heading_y[k, j] = _turned_back(dx, dy, half)


@inlined
def _turned_back(x: float, y: float, half: float) -> tuple[float, float]:
    """A unit vector turned to the right by the angle whose half has this tangent."""
    per = 1.0 / (1.0 + half * half)
    cosine, sine = (1.0 - half * half) * per, 2.0 * half * per
    return x * cosine + y * sine, y * cosine - x * sine


@inlined
def _steady(x: Floats, y: Floats, j: int, rod: float) -> tuple[float, float]:
    """Heading of a body at the first station that has long driven the turn it begins with."""
    first_x, first_y = x[1, j] - x[0, j], y[1, j] - y[0, j]
    step = max(np.sqrt(first_x * first_x + first_y * first_y), _SAME_PLACE)
    first_x, first_y = first_x / step, first_y / step
    arc, turn, k = 0.0, 0.0, 1
    before, before_x, before_y = step, first_x, first_y
    while arc < rod and k + 1 < x.shape[0]:
        dx, dy = x[k + 1, j] - x[k, j], y[k + 1, j] - y[k, j]
        length = np.sqrt(dx * dx + dy * dy)
        if length <= _SAME_PLACE:
            break
        dx, dy = dx / length, dy / length
        turn += np.arctan2(before_x * dy - before_y * dx, before_x * dx + before_y * dy)
        arc += 0.5 * (before + length)
        before, before_x, before_y, k = length, dx, dy, k + 1
    sine = min(max(rod * turn / arc, -1.0), 1.0) if arc > 0.0 else 0.0
    return _turned_back(first_x, first_y, sine / (1.0 + np.sqrt(1.0 - sine * sine)))
