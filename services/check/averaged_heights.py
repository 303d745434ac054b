"""Heights as wheels feel them, for the checker: the same windows as planning has, its own sums.

Where no contrast is significant the height is that of the plane nearest to the disc around a cell.
Elsewhere it is the mean of the window with the smallest risk: the variance of its mean and the
scatter of its heights beyond the noise; a single cell is a window, too.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy import ndimage

from slopewise.models.arrays import Bools, Floats, Ints
from slopewise.models.averaging_windows import AveragingWindows, Contrasts, averaging_windows
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.height_noise import KNOWN_SHARE, SIGNIFICANCE, averaged_noise
from slopewise.models.recent import Recent
from slopewise.services.physics.heights import in_blocks

_DISC_EXCESS, _WINDOW_EXCESS = 2.0, 1.0
"""Scatter beyond the noise that counts as structure, in its standard deviations [1]."""

_SLOPE_SHARE = 0.2
"""Share of a disc's cells that shows its slope [1]: a quarter is known in the corner of a map."""

_CHUNK = 4096  # Cells whose windows are gathered together: 3 MB a window


_averaged: Recent[ElevationMap] = Recent(1)
"""One map has many plans."""


def averaged(heights: ElevationMap, wheel_radius: float) -> ElevationMap:
    """A map as wheels feel it; the same map where its heights are used unchanged."""
    noise = averaged_noise(heights, wheel_radius)
    if noise == 0.0:
        return heights
    windows = averaging_windows(heights.resolution, wheel_radius, heights.correlation_length)
    return _averaged.get(
        lambda: replace(
            heights, elevation=_average(heights.elevation, windows, noise), height_std=0.0
        ),
        heights,
        wheel_radius,
    )


def _average(elevation: Floats, windows: AveragingWindows, noise: float) -> Floats:
    margin = windows.reach * windows.stride
    level = float(elevation[np.isfinite(elevation)][:1].sum())  # 0 if all are unknown
    z = np.pad(elevation - level, margin, constant_values=np.nan)
    inner = (slice(margin, -margin), slice(margin, -margin))
    rows, columns = elevation.shape
    # Unknown where one of their cells is, or is off the map.
    blocks = in_blocks(z[inner], windows.stride).mean(axis=(1, 3))
    jump, which, there = _structure(blocks, windows.wide, noise * windows.block_std)
    near = np.repeat(np.repeat(there, windows.stride, 0), windows.stride, 1)[:rows, :columns]
    near |= _structure(z[inner], windows.narrow, noise)[2]
    disc = slice(int(windows.start[-2]), int(windows.start[-1]))
    shape = np.zeros((2 * margin + 1, 2 * margin + 1), np.bool_)
    shape[windows.taps.row[disc] + margin, windows.taps.column[disc] + margin] = True
    near = ndimage.binary_dilation(near, shape) & np.isfinite(elevation)
    out = elevation.copy()
    plain = np.isfinite(elevation) & ~near
    out[plain] = level + ndimage.correlate(z, shape / shape.sum(), mode="nearest")[inner][plain]
    slopes = _Slopes(jump, which, blocks, windows)
    cells = np.argwhere(near)
    for first in range(0, len(cells), _CHUNK):
        part = cells[first : first + _CHUNK]
        chosen = _min_risk(z, part, margin, windows, noise, slopes)
        out[part[:, 0], part[:, 1]] = level + chosen
    return out


def _structure(z: Floats, contrasts: Contrasts, noise: float) -> tuple[Floats, Ints, Bools]:
    """Strongest jump, −1 where unknown, and its number; whether any contrast is significant."""
    jump, which = np.full(z.shape, -1.0), np.zeros(z.shape, np.int64)
    # The slope on both sides of a jump depends on all of its cells, also on those without a weight.
    reach = _footprint(contrasts, np.ones(len(contrasts.taps.row)))
    unknown = np.isnan(ndimage.correlate(z, reach, mode="constant", cval=np.nan))
    there = unknown.copy()
    for n, weights in enumerate(contrasts.weights):
        strength = np.abs(
            ndimage.correlate(z, _footprint(contrasts, weights), mode="constant", cval=np.nan)
        ) / (noise * contrasts.std[n])
        there |= ~(strength <= SIGNIFICANCE)
        if n < contrasts.slopes.shape[1]:
            stronger = (strength > jump) & ~unknown
            jump[stronger], which[stronger] = strength[stronger], n
    return jump, which, there


def _footprint(contrasts: Contrasts, weights: np.ndarray) -> Floats:
    reach = int(max(np.abs(contrasts.taps.row).max(), np.abs(contrasts.taps.column).max()))
    kernel: Floats = np.zeros((2 * reach + 1, 2 * reach + 1))
    kernel[contrasts.taps.row + reach, contrasts.taps.column + reach] = weights
    return kernel


class _Slopes(NamedTuple):
    """Jumps of blocks, from which the slopes next to them follow."""

    jump: Floats
    which: Ints
    blocks: Floats
    windows: AveragingWindows

    def near_jumps(self, cells: Ints, otherwise: Floats) -> Floats:
        """(2, C) rise a cell to the east and north next to the strongest jump in a disc's reach."""
        windows, contrasts = self.windows, self.windows.wide
        disc = slice(int(windows.start[-2]), int(windows.start[-1]))
        row = cells[:, 0, None] + windows.taps.row[disc]
        column = cells[:, 1, None] + windows.taps.column[disc]
        i, j = row // windows.stride, column // windows.stride
        inside = (row >= 0) & (column >= 0)
        inside &= (i < self.jump.shape[0]) & (j < self.jump.shape[1])
        i, j = np.where(inside, i, 0), np.where(inside, j, 0)
        jump = np.where(inside, self.jump[i, j], -1.0)
        best = jump.argmax(axis=1)
        at = np.arange(len(cells))
        has_jump = jump[at, best] > 0.0
        i, j = np.where(has_jump, i[at, best], 0), np.where(has_jump, j[at, best], 0)
        reach = windows.reach
        around = np.pad(self.blocks, reach, constant_values=np.nan)
        z = around[
            i[:, None] + contrasts.taps.row + reach, j[:, None] + contrasts.taps.column + reach
        ]
        weights = contrasts.slopes[:, self.which[i, j]]
        slopes = np.einsum("kct,ct->kc", weights, z) / windows.stride
        chosen: Floats = np.where(has_jump, slopes, otherwise)
        return chosen


def _min_risk(
    z: Floats, cells: Ints, margin: int, windows: AveragingWindows, noise: float, slopes: _Slopes
) -> Floats:
    """(C,) heights of cells near structure."""
    row, column = cells[:, 0, None] + margin, cells[:, 1, None] + margin
    middle = z[row[:, 0], column[:, 0]]
    height, risk = middle.copy(), np.full(len(cells), noise**2)

    every = np.arange(len(cells))
    alone = _is_alone(z, row, column, windows.narrow, noise)

    def take(
        part: Ints, level: Floats, variance: Floats, scatter: Floats, freedoms: Floats, share: float
    ) -> None:
        with np.errstate(invalid="ignore", divide="ignore"):
            limit = noise**2 * (1.0 + share * np.sqrt(2.0 / freedoms))
            total = variance * noise**2 + np.maximum(scatter - limit, 0.0)
            better = (total < risk[part]) & ~alone[part]
        risk[part[better]], height[part[better]] = total[better], level[better]

    def rises(part: Ints, window: int) -> tuple[Floats, Ints, Ints]:
        taps = slice(int(windows.start[window]), int(windows.start[window + 1]))
        i, j = windows.taps.row[taps], windows.taps.column[taps]
        return z[row[part] + i, column[part] + j] - middle[part, None], i, j

    disc = len(windows.variance) - 1
    rise, i, j = rises(every, disc)
    level, slope, variance, scatter, known = _planes(rise, i, j, windows.variance[disc])
    take(every, middle + level, variance, scatter, known - 3.0, _DISC_EXCESS)
    rough = np.flatnonzero(windows.variance[:disc].min() * noise**2 < risk)
    slope_near = np.zeros((2, len(cells)))
    slope_near[:, rough] = slopes.near_jumps(cells[rough], slope[:, rough])
    for window in range(disc):
        # The variance of a window is the smallest risk it can have.
        part = rough[windows.variance[window] * noise**2 < risk[rough]]
        rise, i, j = rises(part, window)
        left = rise - slope_near[0, part, None] * j - slope_near[1, part, None] * i
        count = np.isfinite(left).sum(axis=1).astype(np.float64)
        few = (count < 2.0) | (count < KNOWN_SHARE * len(i))
        count[few] = np.nan
        mean = np.nansum(left, axis=1) / count
        squares = np.nansum(left**2, axis=1) / count - mean**2
        variance = windows.variance[window] * len(i) / count
        shown = np.maximum((1.0 - variance) * count / (count - 1.0), 1e-3)
        scatter = squares * count / (count - 1.0) / shown
        take(part, middle[part] + mean, variance, scatter, count - 1.0, _WINDOW_EXCESS)
    return height


def _is_alone(z: Floats, row: Ints, column: Ints, narrow: Contrasts, noise: float) -> Bools:
    """(C,) whether cells differ significantly from the plane of the known ones around them."""
    ring = (narrow.taps.row != 0) | (narrow.taps.column != 0)
    i, j = narrow.taps.row[ring], narrow.taps.column[ring]
    rise = z[row + i, column + j] - z[row, column]
    level, _, variance, _, _ = _planes(rise, i, j, 1.0 / len(i))
    std = SIGNIFICANCE * noise * float(narrow.std[0])
    alone: Bools = level**2 > std**2 * (1.0 + variance) * len(i) / (len(i) + 1.0)
    return alone


def _planes(
    rise: Floats, i: Ints, j: Ints, variance: float
) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Planes nearest to known heights: level, (2, C) slopes, variance, scatter, cells; or NaN."""
    known = np.isfinite(rise)
    count = known.sum(axis=1).astype(np.float64)
    basis = np.stack([np.ones(len(i)), j, i])
    normal = np.einsum("at,bt,ct->cab", basis, basis, known.astype(np.float64))
    right = np.einsum("at,ct->ca", basis, np.where(known, rise, 0.0))
    enough = (count >= _SLOPE_SHARE * len(i)) & (count >= 4.0)
    area = normal[:, 1, 1] * normal[:, 2, 2] - normal[:, 1, 2] ** 2
    enough &= np.linalg.det(normal) > 1e-6 * count * area  # 0 > 0 where all are in one row
    normal[~enough] = np.eye(3)
    fit = np.linalg.solve(normal, right[:, :, None])[:, :, 0]
    left = np.where(known, rise**2, 0.0).sum(axis=1) - (fit * right).sum(axis=1)
    lost = variance * len(i)
    at_cell = np.linalg.inv(normal)[:, 0, 0] * lost
    with np.errstate(invalid="ignore", divide="ignore"):
        shown = np.maximum((1.0 - 3.0 * lost / count) * count / (count - 3.0), 1e-3)
        scatter = np.maximum(left, 0.0) / (count - 3.0) / shown
    slope = np.where(enough, fit[:, 1:].T, np.nan)
    enough &= count >= KNOWN_SHARE * len(i)
    level = np.where(enough, fit[:, 0], np.nan)
    return level, slope, np.where(enough, at_cell, np.nan), scatter, count
