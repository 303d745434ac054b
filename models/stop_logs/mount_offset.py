"""Mount offset of a pitch sensor from the body's axis, from known ground.

Ground is known from a map or from heights along the path, or because it was driven in several
directions: a plane under the same place shows its slope with opposite signs in both
directions, the mount with the same one. Without any of these the offset cannot be distinguished
from grade; it is then zero, with the uncertainty of a typical mounting.

Validity: small angles, no drift of the sensor. Source: none; the identifiability follows from
Braking (2).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slopewise.models.arrays import Bools, Floats

TYPICAL_MOUNTING_STD = 0.5 * np.pi / 180.0
"""Standard deviation of an unchecked mounting [rad]."""

_CELL = 2.0  # [m] ground within is a plane
_STEADY = 0.5  # [m/s²] harder braking or drive pitches the body
_MIN_STEP = 1.0  # [m]
_MIN_SAMPLE_COUNT = 20  # from which a mount offset is estimated
_BLOCKS = 40
"""Blocks whose medians give the offset's error [1]: blocks, since neighbouring samples share
errors."""


@dataclass(frozen=True, slots=True)
class Mount:
    """Offset of a pitch sensor."""

    offset: float = 0.0  # [rad], nose down positive
    std: float = TYPICAL_MOUNTING_STD
    source: str = ""  # what determined it, "" if nothing did

    @property
    def known(self) -> bool:
        """The log determined it."""
        return bool(self.source)


def steady(time: Floats, speed: Floats) -> Bools:
    """(n,) samples at which the vehicle rolls forward without much acceleration."""
    step = max(float(np.median(np.diff(time))), 1e-3)
    half = max(int(0.3 / step), 1)
    padded = np.pad(speed, half, mode="edge")
    width = 2 * half + 1
    smooth = np.convolve(padded, np.full(width, 1.0 / width), mode="valid")
    return np.asarray((smooth > 0.3) & (np.abs(np.gradient(smooth, time)) < _STEADY))


def from_grade(pitch: Floats, grade: Floats, use: Bools, source: str) -> Mount:
    """Offset from a known grade, (n,) [rad] each; NaN where it is unknown."""
    use = use & np.isfinite(grade) & np.isfinite(pitch)
    if int(use.sum()) < _MIN_SAMPLE_COUNT:
        return Mount()
    offset = (pitch + grade)[use]
    blocks = [float(np.median(b)) for b in np.array_split(offset, min(_BLOCKS, len(offset) // 5))]
    std = float(np.std(blocks, ddof=1)) / np.sqrt(len(blocks)) if len(blocks) > 1 else np.inf
    return _if_known(float(np.median(offset)), std, source)


def from_heights(station: Floats, height: Floats) -> Floats:
    """(n,) grade by heights along the path, two metres to each side [rad]; NaN at standstill."""
    ahead = np.interp(station + _CELL, station, height)
    behind = np.interp(station - _CELL, station, height)
    length = np.minimum(station + _CELL, station[-1]) - np.maximum(station - _CELL, station[0])
    is_long = length > _MIN_STEP
    rise = np.divide(ahead - behind, length, out=np.full_like(length, np.nan), where=is_long)
    return np.asarray(np.arcsin(np.clip(rise, -1.0, 1.0)))


def course(station: Floats, x: Floats, y: Floats) -> Floats:
    """(n,) direction of travel from positions, over half a metre to each side [rad].

    NaN where the vehicle did not move far enough to have one.
    """
    ahead, behind = station + 0.5 * _MIN_STEP, station - 0.5 * _MIN_STEP
    dx = np.interp(ahead, station, x) - np.interp(behind, station, x)
    dy = np.interp(ahead, station, y) - np.interp(behind, station, y)
    moved = np.hypot(dx, dy) > 0.3 * _MIN_STEP
    return np.where(moved, np.arctan2(dy, dx), np.nan)


def from_headings(pitch: Floats, x: Floats, y: Floats, heading: Floats, use: Bools) -> Mount:
    """Offset from ground that was driven in several directions.

    In each cell pitch = −(g_x cos ψ + g_y sin ψ) + offset with its own slopes g; the offset is what
    all cells share. A cell that was driven in one direction only carries no information.
    ``use``: steady samples, see :func:`steady`; pitch and heading in rad, positions in m.
    """
    use = use & np.isfinite(pitch) & np.isfinite(x) & np.isfinite(y) & np.isfinite(heading)
    if int(use.sum()) < _MIN_SAMPLE_COUNT:
        return Mount()
    place = np.column_stack((np.floor(x[use] / _CELL), np.floor(y[use] / _CELL)))
    _, cell = np.unique(place, axis=0, return_inverse=True)
    order = np.argsort(cell.ravel(), kind="stable")
    bounds = np.flatnonzero(np.diff(cell.ravel()[order])) + 1
    ones_with, ones_power = [], []
    slopes = -np.column_stack((np.cos(heading[use]), np.sin(heading[use])))
    for members in np.split(order, bounds):
        if len(members) < 4:
            continue
        plane, singular, _ = np.linalg.svd(slopes[members], full_matrices=False)
        plane = plane[:, singular > 0.05 * np.sqrt(len(members))]
        residual = 1.0 - plane @ plane.sum(axis=0)
        power = float(residual @ residual)
        if power > 0.02 * len(members):
            ones_with.append(float(residual @ pitch[use][members]))
            ones_power.append(power)
    if len(ones_power) < 3:
        return Mount()
    total, power_of = np.array(ones_with), np.array(ones_power)
    offset = float(np.sum(total) / np.sum(power_of))
    error = total - offset * power_of
    std = float(np.sqrt(np.sum(error**2)) / np.sum(power_of)) * np.sqrt(
        len(error) / (len(error) - 1)
    )
    return _if_known(offset, std, "ground driven in several directions")


def _if_known(offset: float, std: float, source: str) -> Mount:
    """Mount with its source; unknown if it is no better than a typical mounting.

    A mounting that is far off was meant so, and the prior must not pull it back.
    """
    if not std < TYPICAL_MOUNTING_STD:
        return Mount()
    return Mount(offset, std, source)
