"""The stops of a log, found and measured: the one pipeline for everything that learns from stops.

Suspect samples are left out; stops are found, cut out and measured on the ground as the body's
pitch shows it; the mount of the pitch sensor follows; then they are measured again with what is
believed of it and of the slope coefficient. What to believe is the only thing in which
calibration and discrepancy differ.
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

Believed = Callable[[Measured, Mount], tuple[Mount, Slope] | None]
"""From the first measurement and the mount that the log tells: mount and slope coefficient to
measure with once more, None to leave it at the first."""


@dataclass(frozen=True, slots=True)
class MeasuredLog:
    """The stops of a log as they were measured, before anything is fitted to their forces.

    Attributes:
        measured: stops with grade, force and dead time.
        mount: of the pitch sensor, as taken out of the grades.
        windows: every stop of the log, usable or not. suspects: stretches left out.
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
    """Whether a map tells the grade at every sample (n,), so that no pitch is needed."""
    return ground is not None and bool(np.isfinite(ground).all())


def measure_stops(
    columns: Mapping[str, NDArray[Any]],
    runs: Sequence[slice],
    slope: Slope,
    believed: Believed,
    *,
    ground: Floats | None = None,
    settings: StopSettings | None = None,
    fewest: int = 0,
) -> MeasuredLog:
    """Find and measure the stops of a log.

    Args:
        columns: channels of a drive log, (n,): ``t`` [s], ``v``, ``v_cmd`` [m/s], ``pitch`` [rad]
            and what else it has. runs: samples of each run.
        slope: coefficient as far as it is known; it matters where the grade varies along a stop.
        believed: what to measure with once more.
        ground: (n,) grade of the ground by a map [rad], NaN where unknown; None without a map.
        settings: what counts as a stop. fewest: stops without which there is nothing to learn.

    Raises:
        ParameterError: too few usable stops; says how many were found and what was wrong with them.
    """
    suspects = find_suspects(columns, runs)
    matter = ["v", "v_cmd"] if is_mapped(ground) else ["v", "v_cmd", "pitch"]
    good = usable(len(columns["t"]), suspects, matter)
    windows = tuple(w for run in runs for w in find_stops(columns, run, good, settings))
    stops = [cut(columns, w, ground) for w in windows if w.usable]
    if len(stops) < fewest:
        raise ParameterError("stops", _why(too_few(fewest, len(stops), windows), windows, suspects))
    measured, mount = measure(stops, Mount(), slope), Mount()
    if (count := len(measured.records)) < fewest:
        raise ParameterError("stops", _why(too_few(fewest, count, windows), windows, suspects))
    again = believed(measured, mount_of_log(columns, runs, good, ground, measured))
    if again is not None:
        mount, slope = again
        measured = measure(stops, mount, slope, measured.dive)
    return MeasuredLog(measured, mount, windows, suspects)


def too_few(fewest: int, count: int, windows: Sequence[StopWindow]) -> str:
    """What is expected, beside what was found."""
    return f"at least {fewest} usable stops, got {count} of {len(windows)} found"


def _why(words: str, windows: Sequence[StopWindow], suspects: Sequence[Suspect]) -> str:
    unusable = Counter(w.verdict for w in windows if w.verdict is not Usability.USABLE)
    if len(windows) == unusable[Usability.COASTED]:
        words += f"; {_A_STOP}"
    if unusable:
        words += "; " + ", ".join(f"{n} {v.name.lower()}" for v, n in unusable.most_common())
    for s in suspects[:2]:
        words += f"; {s.channel}: {s.reason}"
    return words
