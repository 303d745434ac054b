"""Whether the speed of a log agrees with its positions, while the vehicle drives.

Distances by the speed are compared with the chords between positions. Stops do not count: wheels
slip while they brake. Validity: chords of 3 m are shorter than the way in tight turns, and a
scatter of positions of 0.3 m makes them 1 % longer; the median of a log is compared. Source: none.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slopewise.models.arrays import Bools, Floats
from slopewise.models.stop_logs.drive_quality import stretches_of
from slopewise.models.stop_logs.random_effects import PER_MAD

_TOLERANCE = 0.10
"""Of the distance [1]: tyres that drive slip by half of that, slopes cost 6 % at 20°."""

_CHORD = 3.0  # [m] by the speed, between two positions
_MIN_CHORDS = 8  # [1]
_MOVING = 0.3  # [m/s]
_SIGNIFICANCE = 4.0  # standard errors of the median [1]


def note_on_speed(
    columns: Mapping[str, NDArray[Any]], runs: Sequence[slice], is_usable: Bools
) -> tuple[str, ...]:
    """Note on a speed that travels farther than the positions do, or less far, with its size."""
    if not columns.keys() >= {"v", "v_cmd", "x", "y"}:
        return ()
    ratios = np.array([r for run in runs for r in _ratios(columns, run, is_usable)])
    if len(ratios) < _MIN_CHORDS:
        return ()
    ratio = float(np.median(ratios))
    scatter = PER_MAD * float(np.median(np.abs(ratios - ratio))) / np.sqrt(len(ratios))
    if abs(ratio - 1.0) < _TOLERANCE + _SIGNIFICANCE * scatter:
        return ()
    return (
        f"while driving v travels {ratio:.2f} times what x, y do: stops are taken to be as fast as "
        "v says; compare the wheel radius, or the scale of positions, with a measured distance",
    )


def _ratios(columns: Mapping[str, NDArray[Any]], run: slice, is_usable: Bools) -> Iterator[float]:
    """Distance by the speed over the chord of positions, for each chord of a run."""
    t, v, command, x, y = (columns[name][run] for name in ("t", "v", "v_cmd", "x", "y"))
    valid = is_usable[run] & np.isfinite(x) & np.isfinite(y)
    drives = valid & (np.abs(v) > _MOVING) & (command * v > 0.0)
    step = np.append(0.0, 0.5 * np.abs(v[1:] + v[:-1]) * np.diff(t))
    along = np.cumsum(np.where(np.isfinite(step), step, 0.0))
    for begin, end in stretches_of(drives):
        marks = begin + np.searchsorted(
            along[begin:end], np.arange(along[begin], along[end - 1], _CHORD)
        )
        chords: Floats = np.hypot(np.diff(x[marks]), np.diff(y[marks]))
        for way, chord in zip(np.diff(along[marks]), chords, strict=True):
            if chord > 0.0:
                yield float(way / chord)
