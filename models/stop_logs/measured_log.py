"""The stops of a log, found and measured: the one pipeline for everything that learns from stops.

Suspect samples are excluded; stops are found, extracted and measured on the ground by the body's
pitch; the mount of the pitch sensor follows; then they are measured again with an estimate of it
and of the slope coefficient. Calibration and discrepancy differ only in that estimate.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slopewise.models.arrays import Floats
from slopewise.models.errors import ParameterError
from slopewise.models.stop_logs.drive_quality import Suspect, find_suspects, usable
from slopewise.models.stop_logs.find_stops import StopSettings, StopWindow, Usability, find_stops
from slopewise.models.stop_logs.measure import Measured, Slope, measure
from slopewise.models.stop_logs.mount_of_log import mount_of_log
from slopewise.models.stop_logs.mount_offset import Mount
from slopewise.models.stop_logs.stop_record import cut

_A_STOP = (
    "a stop begins where v_cmd goes to 0 while the vehicle rolls, and ends, under brakes, where it "
    "stands"
)

Estimate = Callable[[Measured, Mount], tuple[Mount, Slope] | None]
"""Mount and slope coefficient for a second measurement, from the first one and the mount of the
log; None to keep the first."""


@dataclass(frozen=True, slots=True)
class MeasuredLog:
    """The measured stops of a log, before anything is fitted to their forces.

    Attributes:
        measured: stops with grade, force and dead time.
        mount: offset of the pitch sensor, subtracted from the grades.
        windows: every stop of the log, usable or not. suspects: excluded stretches.
    """

    measured: Measured
    mount: Mount
    windows: tuple[StopWindow, ...]
    suspects: tuple[Suspect, ...]

    @property
    def usable(self) -> int:
        """Stops that may be learned from, measured or not."""
        return sum(w.usable for w in self.windows)


def is_mapped(ground: Floats | None) -> bool:
    """Return True if a map has the grade at every sample (n,), so that no pitch is needed."""
    return ground is not None and bool(np.isfinite(ground).all())


def measure_stops(
    columns: Mapping[str, NDArray[Any]],
    runs: Sequence[slice],
    slope: Slope,
    estimate: Estimate,
    *,
    ground: Floats | None = None,
    settings: StopSettings | None = None,
    min_count: int = 0,
) -> MeasuredLog:
    """Find and measure the stops of a log.

    Args:
        columns: channels of a drive log, (n,): ``t`` [s], ``v``, ``v_cmd`` [m/s], ``pitch`` [rad]
            and what else it has. runs: samples of each run.
        slope: current estimate of the coefficient; it matters where the grade varies along a stop.
        estimate: of mount and slope, for a second measurement.
        ground: (n,) grade of the ground by a map [rad], NaN where unknown; None without a map.
        settings: definition of a stop. min_count: smallest number of usable stops.

    Raises:
        ParameterError: too few usable stops; says how many were found and what was wrong with them.
    """
    suspects = find_suspects(columns, runs)
    matter = ["v", "v_cmd"] if is_mapped(ground) else ["v", "v_cmd", "pitch"]
    is_usable = usable(len(columns["t"]), suspects, matter)
    windows = tuple(w for run in runs for w in find_stops(columns, run, is_usable, settings))
    stops = [cut(columns, w, ground) for w in windows if w.usable]
    if len(stops) < min_count:
        raise ParameterError(
            "stops", _reason(too_few(min_count, len(stops), windows), windows, suspects)
        )
    measured, mount = measure(stops, Mount(), slope), Mount()
    if (count := len(measured.records)) < min_count:
        raise ParameterError(
            "stops", _reason(too_few(min_count, count, windows), windows, suspects)
        )
    again = estimate(measured, mount_of_log(columns, runs, is_usable, ground, measured))
    if again is not None:
        mount, slope = again
        measured = measure(stops, mount, slope, measured.dive)
    return MeasuredLog(measured, mount, windows, suspects)


def too_few(min_count: int, count: int, windows: Sequence[StopWindow]) -> str:
    """Message: expected and actual number of usable stops."""
    return f"at least {min_count} usable stops, got {count} of {len(windows)} found"


def _reason(message: str, windows: Sequence[StopWindow], suspects: Sequence[Suspect]) -> str:
    unusable = Counter(w.verdict for w in windows if w.verdict is not Usability.USABLE)
    if len(windows) == unusable[Usability.COASTED]:
        message += f"; {_A_STOP}"
    if unusable:
        message += "; " + ", ".join(f"{n} {v.name.lower()}" for v, n in unusable.most_common())
    for s in suspects[:2]:
        message += f"; {s.channel}: {s.reason}"
    return message
