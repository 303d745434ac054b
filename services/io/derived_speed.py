"""Speed of a drive log without a column `v`: from its wheels, else from its positions."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slopewise.models.arrays import Floats

_MAX_NOISE = 0.03  # of the speed [m/s]; noisier positions are fitted over more samples
_MAX_HALF = 0.3  # time that a fit reaches to each side [s]: a stop has to show its onset
_MEDIAN_THIRD = 0.6745 * np.sqrt(20.0)
"""Median absolute third difference of white noise, over its standard deviation [1]: a third
difference has the weights 1, −3, 3, −1, and half of a normal distribution is within 0.6745."""


def source_of_speed(columns: Container[str]) -> str:
    """Columns that give the speed of a log without `v`, as text; empty if none do."""
    if "v_left" in columns and "v_right" in columns:
        return "the mean of v_left and v_right"
    return "the change of x and y" if "x" in columns and "y" in columns else ""


def derived_speed(columns: Mapping[str, NDArray[Any]], runs: Sequence[slice]) -> Floats:
    """(n,) speed [m/s]; backwards it is negative, by positions only if the log has `yaw`."""
    if "v_left" in columns and "v_right" in columns:
        return np.asarray(0.5 * (columns["v_left"] + columns["v_right"]))
    speed = np.full(len(columns["t"]), np.nan)
    for run in runs:
        part = {name: columns[name][run] for name in ("t", "x", "y", "yaw") if name in columns}
        moved = (np.diff(part["x"]) != 0.0) | (np.diff(part["y"]) != 0.0)
        new = np.flatnonzero(np.concatenate(([True], moved)))
        if len(new) < 4:
            speed[run] = 0.0
            continue
        # A repeated position is not a measurement; its speed holds until the next.
        last = np.searchsorted(new, np.arange(len(part["t"])), side="right") - 1
        at = {name: values[new] for name, values in part.items()}
        age = part["t"] - at["t"][last]
        is_old = age > _MAX_HALF + np.median(np.diff(at["t"]))
        speed[run] = np.where(is_old, 0.0, _by_positions(at)[last])
    return speed


def _by_positions(at: Mapping[str, Floats]) -> Floats:
    """(n,) speed [m/s] by lines through as few positions as their noise permits."""
    t, x, y = at["t"], at["x"], at["y"]
    step = float(np.median(np.diff(t)))
    noise = max(float(np.median(np.abs(np.diff(p, 3)))) for p in (x, y)) / _MEDIAN_THIRD
    half = 1
    # Standard deviation of a line's slope through 2 half + 1 samples.
    while (
        noise / (step * np.sqrt(half * (half + 1) * (2 * half + 1) / 3.0)) > _MAX_NOISE
        and (half + 1) * step <= _MAX_HALF
        and 2 * half + 3 <= len(t)
    ):
        half += 1
    dx, dy = _slope(t, x, half), _slope(t, y, half)
    if "yaw" not in at:
        return np.hypot(dx, dy)
    return np.asarray(dx * np.cos(at["yaw"]) + dy * np.sin(at["yaw"]))


def _slope(t: Floats, p: Floats, half: int) -> Floats:
    """(n,) slope of the line fitted to a position [m] over `half` samples to each side [m/s]."""
    times, places = (np.lib.stride_tricks.sliding_window_view(a, 2 * half + 1) for a in (t, p))
    times = times - times.mean(axis=1, keepdims=True)
    slope = np.sum(times * places, axis=1) / np.sum(times**2, axis=1)
    return np.pad(slope, half, mode="edge")
