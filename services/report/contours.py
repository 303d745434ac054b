"""Lines of equal height, by marching squares, as paths of a drawing."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_WANTED_LINES = 14
_DIGITS = 10.0  # a path counts in tenths of a cell
# Corners above the level as bits (1: [i, j], 2: [i, j+1], 4: [i+1, j+1], 8: [i+1, j]) -> edges that
# a line joins (0: lower, 1: right, 2: upper, 3: left). At saddles the high corners stay apart.
_CASES: dict[int, tuple[tuple[int, int], ...]] = {
    1: ((3, 0),), 2: ((0, 1),), 3: ((3, 1),), 4: ((1, 2),), 5: ((3, 0), (1, 2)), 6: ((0, 2),),
    7: ((3, 2),), 8: ((2, 3),), 9: ((2, 0),), 10: ((0, 1), (2, 3)), 11: ((2, 1),), 12: ((1, 3),),
    13: ((1, 0),), 14: ((0, 3),),
}  # fmt: skip


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
    lines = _joined(*_segments(elevation, level))
    parts = []
    for x, y in lines:
        u, v = (np.rint(_DIGITS * (w + shift)).astype(np.int64) for w in (x, y))
        du, dv = np.diff(u), np.diff(v)
        moved = (du != 0) | (dv != 0)
        if moved.any():
            steps = " ".join(f"{a} {b}" for a, b in zip(du[moved], dv[moved], strict=True))
            parts.append(f"M{u[0]} {v[0]}l{steps}")
    return "".join(parts)


def outline_path(mask: NDArray[np.bool_]) -> str:
    """The edge of a region of cells as closed SVG paths, like :func:`contour_path`."""
    return contour_path(np.pad(mask.astype(np.float64), 1), 0.5, shift=-1.0)


def _segments(elevation: Floats, level: float) -> tuple[Ints, Ints, Floats, Floats]:
    """Pieces of line, one a cell: the grid edges they join, and where each edge is crossed."""
    columns = elevation.shape[1]
    above = elevation >= level
    finite = np.isfinite(elevation)
    whole = finite[:-1, :-1] & finite[:-1, 1:] & finite[1:, 1:] & finite[1:, :-1]
    high = above[:-1, :-1] + 2 * above[:-1, 1:] + 4 * above[1:, 1:] + 8 * above[1:, :-1]
    case = np.where(whole, high, 0)
    starts: list[Ints] = []
    ends: list[Ints] = []
    for code, joins in _CASES.items():
        i, j = np.nonzero(case == code)
        cell = i * columns + j
        edges = (2 * cell, 2 * (cell + 1) + 1, 2 * (cell + columns), 2 * cell + 1)
        for a, b in joins:
            starts.append(edges[a])
            ends.append(edges[b])
    start, end = np.concatenate(starts), np.concatenate(ends)
    used = np.unique(np.concatenate((start, end)))
    i, j = np.divmod(used // 2, columns)
    upwards = used % 2
    here = elevation[i, j]
    there = elevation[i + upwards, j + 1 - upwards]
    share = (level - here) / (there - here)
    x, y = j + share * (1 - upwards), i + share * upwards
    return np.searchsorted(used, start), np.searchsorted(used, end), x, y


def _joined(start: Ints, end: Ints, x: Floats, y: Floats) -> list[tuple[Floats, Floats]]:
    """Pieces put together to lines as long as they go."""
    follows = dict(zip(start.tolist(), end.tolist(), strict=True))
    heads = sorted(set(follows) - set(follows.values()))
    lines = [_walk(head, follows) for head in heads]
    while follows:
        lines.append(_walk(next(iter(follows)), follows))
    return [(x[line], y[line]) for line in map(np.asarray, lines)]


def _walk(point: int, follows: dict[int, int]) -> list[int]:
    line = [point]
    while (following := follows.pop(line[-1], None)) is not None:
        line.append(following)
    return line
