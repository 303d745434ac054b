"""Lines of equal height as paths of a drawing."""

from __future__ import annotations

import math

import numpy as np
from contourpy import LineType, contour_generator
from numpy.typing import NDArray

from slopewise.models.arrays import Floats

_WANTED_LINES = 14
_DIGITS = 10.0  # a path counts in tenths of a cell


def interval(elevation: Floats) -> float:
    """Height between contours that gives about a dozen: 1, 2 or 5 times a power of ten [m]."""
    known = elevation[np.isfinite(elevation)]
    if known.size == 0:
        return 1.0
    low, high = np.percentile(known, (1.0, 99.0))
    wanted = max(float(high - low) / _WANTED_LINES, 0.01)
    power = 10.0 ** math.floor(math.log10(wanted))
    return next(step * power for step in (1.0, 2.0, 5.0, 10.0) if step * power >= wanted * 0.999)


def levels(elevation: Floats, step: float) -> Floats:
    """Multiples of the interval between the lowest and the highest known height [m]."""
    known = elevation[np.isfinite(elevation)]
    if known.size == 0:
        return np.empty(0)
    first, last = math.ceil(known.min() / step), math.floor(known.max() / step)
    if last - first > 20 * _WANTED_LINES:  # spikes in the data
        return np.empty(0)
    return step * np.arange(first, last + 1)


def smoothed(elevation: Floats) -> Floats:
    """Means over 3 x 3 cells, which takes the jitter out of contours; unknown stays unknown."""
    rows, columns = elevation.shape
    known = np.isfinite(elevation)
    heights = np.pad(np.where(known, elevation, 0.0), 1)
    weight = np.pad(known.astype(np.float64), 1)
    total, count = np.zeros((2, rows, columns))
    for i in range(3):
        for j in range(3):
            total += heights[i : i + rows, j : j + columns]
            count += weight[i : i + rows, j : j + columns]
    mean: Floats = np.divide(total, count, out=np.full((rows, columns), np.nan), where=known)
    return mean


def contour_path(elevation: Floats, level: float, shift: float = 0.0) -> str:
    """Where the height crosses a level, as SVG path data in tenths of a cell.

    Args:
        elevation: (rows, cols) heights; lines end where it is not finite.
        level: height of the line, in the unit of the elevation.
        shift: cells added to columns and rows.

    Returns:
        ``M…l…`` with x to the right (columns) and y with the rows; empty if nothing crosses.
    """
    known = np.ma.masked_invalid(elevation)
    drawn = contour_generator(z=known, corner_mask=False, line_type=LineType.Separate)
    parts = []
    for line in drawn.lines(level):
        points = np.rint(_DIGITS * (np.asarray(line) + shift)).astype(np.int64)
        steps = np.diff(points, axis=0)
        steps = steps[steps.any(axis=1)]
        if len(steps):
            moves = " ".join(f"{a} {b}" for a, b in steps)
            parts.append(f"M{points[0, 0]} {points[0, 1]}l{moves}")
    return "".join(parts)


def outline_path(mask: NDArray[np.bool_]) -> str:
    """The edge of a region of cells as closed SVG paths, like :func:`contour_path`."""
    return contour_path(np.pad(mask.astype(np.float64), 1), 0.5, shift=-1.0)
