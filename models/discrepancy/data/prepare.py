"""From a drive log to a table of stops, as calibration measures them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slopewise.models.arrays import Floats
from slopewise.models.discrepancy.data.stop_table import NO_CHANCE, StopTable, tabulate
from slopewise.models.discrepancy.settings import DiscrepancySettings
from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Model
from slopewise.models.stop_logs.measure import Measured, Slope
from slopewise.models.stop_logs.measured_log import is_mapped, measure_stops, too_few
from slopewise.models.stop_logs.mount_offset import Mount
from slopewise.models.stop_logs.sinking_commands import sinking_commands

_MIN_STOPS = 12  # stops below which a log is refused: it has as many numbers
_MOUNT_STD = np.deg2rad(0.15)  # std up to which headings alone may show a mount [rad]
_LARGEST_MOUNT = np.deg2rad(4.0)  # offset up to which they may: more is seen by eye [rad]
_BY_HEADINGS = "ground driven in several directions"


def prepare(
    columns: Mapping[str, NDArray[Any]],
    runs: Sequence[slice],
    model: Model,
    ground: Floats | None,
    settings: DiscrepancySettings,
) -> tuple[StopTable, list[str]]:
    """Stops that can be compared with the model, and warnings about them.

    Args:
        columns: channels of a drive log, (n,). runs: samples of each run.
        model: as configured; its slope coefficients help to measure on varying ground.
        ground: (n,) grade by a map [rad], None to take it from the pitch.
        settings: definition of a stop.

    Raises:
        ParameterError: too few usable stops.
    """
    mapped = is_mapped(ground)

    def slope(v: float) -> float:
        return model.braking.m_m * v + model.braking.b_m

    def mount_and_slope(_: Measured, mount: Mount) -> tuple[Mount, Slope] | None:
        mount_angle = _known_mount(mount, mapped)
        return None if mount_angle is None else (mount_angle, slope)

    log = measure_stops(
        columns, runs, slope, mount_and_slope, ground=ground, settings=settings.stops
    )
    records, windows = log.measured.records, log.windows
    for count in (log.usable, len(records)):
        if count < _MIN_STOPS:
            raise ParameterError("stops", too_few(_MIN_STOPS, count, windows))
    notes = []
    if log.mount.known and not mapped:
        notes.append(
            f"pitch sensor mounted {np.rad2deg(log.mount.offset):+.2f}° off by "
            f"{log.mount.source}: taken out of the grades"
        )
    excluded = [w for w in windows if not w.usable]
    if excluded:
        notes.append(f"{len(excluded)} of {len(windows)} stops could not be compared")
    notes.extend(sinking_commands(columns, windows))
    return tabulate(columns, runs, records, excluded, log.measured.dead_time), notes


def _known_mount(mount: Mount, mapped: bool) -> Mount | None:
    """The offset that is removed from the grades, None without a certain one.

    It is shrunk by its uncertainty: an offset of a few deviations is likely a smaller one.
    """
    # Where only headings show it, a few crossings with a wrong place are enough to mislead.
    reliable = (
        mapped
        or mount.source != _BY_HEADINGS
        or (mount.std < _MOUNT_STD and abs(mount.offset) < _LARGEST_MOUNT)
    )
    if not (mount.known and reliable and abs(mount.offset) > NO_CHANCE * mount.std):
        return None
    known = mount.offset**2 / (mount.offset**2 + mount.std**2)
    return replace(mount, offset=known * mount.offset)
