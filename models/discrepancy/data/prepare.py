"""From a drive log to a table of stops, as calibration measures them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.arrays import Floats
from models.discrepancy.data.stop_table import StopTable, tabulate
from models.discrepancy.settings import DiscrepancySettings
from models.discrepancy.thresholds import FEWEST_STOPS, LARGEST_MOUNT, PLAIN_MOUNT, SURE_MOUNT
from models.errors import ParameterError
from models.parameters import Model
from models.stop_logs.drive_quality import find_suspects, usable
from models.stop_logs.find_stops import find_stops
from models.stop_logs.measure import measure
from models.stop_logs.mount_of_log import mount_of_log
from models.stop_logs.mount_offset import Mount
from models.stop_logs.stop_record import cut

_BY_HEADINGS = "ground driven in several directions"
_MEANINGFUL = frozenset(
    ("run", "terrain", "t", "v", "v_cmd", "pitch", "roll", "yaw", "yaw_rate", "x", "y", "z",
     "v_left", "v_right", "current_left", "current_right", "brake")
)  # fmt: skip


def prepare(
    columns: Mapping[str, NDArray[Any]], runs: Sequence[slice], model: Model,
    ground: Floats | None, settings: DiscrepancySettings,
) -> tuple[StopTable, list[str]]:  # fmt: skip
    """Stops that can be compared with the model, and doubts about them.

    Args:
        columns: channels of a drive log, (n,). runs: samples of each run.
        model: as configured; its slope coefficients help to measure on varying ground.
        ground: (n,) grade by a map [rad], None to take it from the pitch.

    Raises:
        ParameterError: too few usable stops.
    """
    suspects = find_suspects(columns, runs)
    mapped = ground is not None and bool(np.isfinite(ground).all())
    good = usable(len(columns["t"]), suspects, ["v", "v_cmd"] + ([] if mapped else ["pitch"]))
    windows = [w for run in runs for w in find_stops(columns, run, good, settings.stops)]
    stops = [cut(columns, w, ground) for w in windows if w.usable]
    if len(stops) < FEWEST_STOPS:
        raise ParameterError("stops", _too_few(len(stops), len(windows)))
    on = model.braking

    def slope(v: float) -> float:
        return on.m_m * v + on.b_m

    measured = measure(stops, Mount(), slope)
    mount = mount_of_log(columns, runs, good, ground, measured)
    # Where only headings tell it, a few crossings with a wrong place are enough to mislead.
    sure = (
        mapped
        or mount.source != _BY_HEADINGS
        or (mount.std < SURE_MOUNT and abs(mount.offset) < LARGEST_MOUNT)
    )
    askew = mount.known and sure and abs(mount.offset) > PLAIN_MOUNT * mount.std
    if askew:
        # Believed as far as it is known: an offset of a few deviations is likely a smaller one.
        known = mount.offset**2 / (mount.offset**2 + mount.std**2)
        mount = replace(mount, offset=known * mount.offset)
        measured = measure(stops, mount, slope, measured.dive)
    if len(measured.records) < FEWEST_STOPS:
        raise ParameterError("stops", _too_few(len(measured.records), len(windows)))
    notes = []
    if askew and not mapped:
        notes.append(
            f"pitch sensor mounted {np.rad2deg(mount.offset):+.2f}° askew by {mount.source}: "
            "taken out of the grades"
        )
    others = [w for w in windows if not w.usable]
    if others:
        notes.append(f"{len(others)} of {len(windows)} stops could not be compared")
    further = [n for n, v in columns.items() if n not in _MEANINGFUL and v.dtype.kind in "fiu"]
    table = tabulate(
        columns,
        runs,
        measured.records,
        others,
        further,
        measured.dead_time.between_stops,
        measured.dead_time.value,
    )
    return table, notes


def _too_few(usable_count: int, found: int) -> str:
    return f"at least {FEWEST_STOPS} usable stops, got {usable_count} of {found} found"
