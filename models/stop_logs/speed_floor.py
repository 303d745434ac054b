"""Speed reading of a standing vehicle: the floor below which motion is not detected.

Rest is where the command is 0 and the speed does not fall any more: of blocks of half a second
those that are flat, and near the lowest of their run. A run that is cut off at each standstill has
none; second differences of neighbouring samples give the noise of any run. Source: none.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slopewise.models.arrays import Bools, Floats

_BLOCK = 0.5  # [s]
_AFTER = 0.5  # [s] since the command; earlier no brake has done anything
_MIN_BLOCK_COUNT = 4  # samples of a block
_ENOUGH = 20  # samples at rest that determine its noise
_QUANTILE = 0.98  # of the speeds read at rest
_FALL = 3.0  # standard deviations by which the halves of a flat block may differ at most
_RESOLUTION = 0.005  # [m/s] the same of sensors without noise
_NEAR = 3.0, 0.03  # times the lowest block, and [m/s]: flat and higher, a vehicle creeps
_TIMES_FLOOR, _TIMES_NOISE = 3.0, 5.0
"""Slowest usable stop, in speeds read at rest and in noises of a sample [1]: three standstill
readings, and five sigma, so that one reading in a million looks like motion."""
_QUARTER = 0.3186 * np.sqrt(6.0)  # lower quartile of |second difference| of noise of 1
_SLOWEST = 0.05  # [m/s] no log distinguishes a stop below
_ALWAYS = 0.3  # [m/s] any log distinguishes a stop above
_ABOVE = 1.25  # times the rest: below that, a speed is at rest
_BACKWARDS = 2.0  # standard deviations below 0 at which a vehicle rolls backwards


class SpeedFloor(NamedTuple):
    """Speeds of a run that are indistinguishable from rest."""

    rest: float | None  # read at rest [m/s], None where the run never shows rest for long
    noise: float  # of single samples, standard deviation [m/s]

    @property
    def slowest(self) -> float:
        """Slower vehicles cannot be distinguished from standing ones [m/s]."""
        rest = 0.0 if self.rest is None else self.rest
        return min(max(_TIMES_FLOOR * rest, _TIMES_NOISE * self.noise, _SLOWEST), _ALWAYS)

    @property
    def standing(self) -> float:
        """Speeds below may be read at rest [m/s]; 0 where nothing was."""
        return 0.0 if self.rest is None else _ABOVE * self.rest


def speed_floor(time: Floats, speed: Floats, standing: Bools, usable: Bools) -> SpeedFloor:
    """The floor of one run, from (n,) samples; ``standing``: the command is 0."""
    differences = np.abs(np.diff(speed[usable], 2))
    # The calm half of a run: changes of the commanded speed are no noise.
    noise = float(np.quantile(differences, 0.25)) / _QUARTER if len(differences) else 0.0
    blocks = [np.abs(speed[block]) for block in _flat_blocks(time, speed, standing, usable)]
    if not blocks:
        return SpeedFloor(None, noise)
    level = np.array([float(np.quantile(block, _QUANTILE)) for block in blocks])
    times, more = _NEAR
    highest = times * float(level.min()) + more
    rest = np.concatenate([b for b, at in zip(blocks, level, strict=True) if at <= highest])
    return SpeedFloor(float(np.quantile(rest, _QUANTILE)) if len(rest) >= _ENOUGH else None, noise)


def _flat_blocks(
    time: Floats, speed: Floats, standing: Bools, usable: Bools
) -> list[NDArray[np.int64]]:
    """Samples of each flat block while the command is 0."""
    is_start = standing & ~np.concatenate(([False], standing[:-1]))
    stretch = np.cumsum(is_start)
    since = time - np.concatenate(([0.0], time[is_start]))[stretch]
    at = np.flatnonzero(standing & usable & (since > _AFTER))
    if not len(at):
        return []
    block = (since[at] // _BLOCK).astype(np.int64)
    key = stretch[at] * (int(block.max()) + 1) + block
    parts = np.split(at, np.flatnonzero(np.diff(key)) + 1)
    return [part for part in parts if len(part) >= _MIN_BLOCK_COUNT and _is_flat(speed[part])]


def _is_flat(values: Floats) -> bool:
    if np.mean(values) < -_BACKWARDS * np.std(values) - _RESOLUTION:
        return False
    half = len(values) // 2
    first, second = values[:half], values[-half:]
    spread = np.sqrt((np.var(first) + np.var(second)) / half)
    return bool(np.mean(first) - np.mean(second) <= _FALL * spread + _RESOLUTION)
