"""The mount offset of a log's pitch sensor, by the best source that the log has.

A map, else heights along the path, else ground driven in several directions. While the vehicle
brakes its pitch is that of a diving body; the dive is known from the stops and taken out first.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slopewise.models.arrays import Bools, Floats
from slopewise.models.stop_logs import mount_offset
from slopewise.models.stop_logs.measure import Measured, stop_pitch
from slopewise.models.stop_logs.mount_offset import Mount

_PLACE = ("x", "y", "z", "yaw")


def mount_of_log(
    columns: Mapping[str, NDArray[Any]],
    runs: Sequence[slice],
    usable: Bools,
    ground: Floats | None,
    measured: Measured,
) -> Mount:
    """Offset of the pitch sensor, unknown if no channel shows it; ground: grade by a map [rad]."""
    pitch = np.array(columns["pitch"], np.float64)
    use = np.zeros(len(pitch), np.bool_)
    heights = np.full(len(pitch), np.nan)
    heading = np.full(len(pitch), np.nan)
    for run in runs:
        t, v = columns["t"][run], columns["v"][run]
        if len(t) < 3:
            continue
        use[run] = mount_offset.steady(t, v)
        forward = 0.5 * np.maximum(v[1:] + v[:-1], 0.0) * np.diff(t)
        station = np.concatenate(([0.0], np.cumsum(forward)))
        place = {n: c[run] for n, c in columns.items() if n in _PLACE and np.isfinite(c[run]).all()}
        if "z" in place:
            heights[run] = mount_offset.from_heights(station, place["z"])
        if "yaw" in place:
            heading[run] = place["yaw"]
        elif {"x", "y"} <= place.keys():
            heading[run] = mount_offset.course(station, place["x"], place["y"])
    for record in measured.records:
        window = record.samples.window
        if window.direction < 0:  # its pitch is that of the other direction
            continue
        part = slice(window.begin, window.standstill)
        dive = measured.dive.pitch(stop_pitch(record.samples, record.knee))
        pitch[part] -= dive[: window.standstill - window.begin]
        use[window.command : window.standstill] = True
    use &= usable
    if ground is not None:
        return mount_offset.from_grade(pitch, ground, use, "map")
    mount = mount_offset.from_grade(pitch, heights, use, "heights along the path")
    if not mount.known and {"x", "y"} <= columns.keys():
        mount = mount_offset.from_headings(pitch, columns["x"], columns["y"], heading, use)
    return mount
