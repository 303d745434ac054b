"""The stops of a log, found and measured: the one pipeline for everything that learns from stops.

Suspect samples are excluded; stops are found, extracted and measured on the ground by the body's
pitch; the mount of the pitch sensor follows; then they are measured again with an estimate of it
and of the slope coefficient. Calibration and discrepancy differ only in that estimate. Where stops
that begin with a step of the command are too few, ramps and reversals are stops as well.
"""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slopewise.models.arrays import Bools, Floats
from slopewise.models.errors import ParameterError
from slopewise.models.stop_logs.drive_quality import Suspect, find_suspects, usable
from slopewise.models.stop_logs.find_stops import StopSettings, StopWindow, Usability, find_stops
from slopewise.models.stop_logs.held_values import fresh_samples, held_period
from slopewise.models.stop_logs.measure import Body, Measured, Slope, measure
from slopewise.models.stop_logs.mount_of_log import mount_of_log
from slopewise.models.stop_logs.mount_offset import Mount
from slopewise.models.stop_logs.stop_record import StopSamples, cut

_A_STOP = (
    "a stop begins where v_cmd goes to 0 while the vehicle rolls, and ends, under brakes, where it "
    "stands"
)

Estimate = Callable[[Measured, Mount], tuple[Mount, Slope] | None]
"""Mount and slope coefficient for a second measurement, from the first one and the mount of the
log; None to keep the first."""


@dataclass(frozen=True, slots=True)
class StopDistance:
    """Distance of one stop, whether its force could be measured or not.

    Attributes:
        speed: at the stop command [m/s]. distance: from the command to standstill, or to the cut
            [m]. mean_grade: of the ground, over that distance [rad].
        brake_level: application [1], NaN if it is not in the log.
        run, session, surface: names, "" where the log has none.
        cut_short: it did not reach standstill, but still drove `speed_left` [m/s].
        time: of the stop command [s].
    """

    speed: float
    distance: float
    mean_grade: float
    brake_level: float
    run: str
    session: str
    surface: str
    cut_short: bool
    speed_left: float
    time: float


@dataclass(frozen=True, slots=True)
class MeasuredLog:
    """The measured stops of a log, before anything is fitted to their forces.

    Attributes:
        measured: stops with grade, force and dead time.
        mount: offset of the pitch sensor, subtracted from the grades.
        windows: every stop of the log, usable or not. suspects: excluded stretches.
        others: stops without a force of their own: cut short, or with too few samples.
        notes: sentences on how the log had to be read.
    """

    measured: Measured
    mount: Mount
    windows: tuple[StopWindow, ...]
    suspects: tuple[Suspect, ...]
    others: tuple[StopSamples, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def usable(self) -> int:
        """Stops that may be learned from, measured or not."""
        return sum(w.usable for w in self.windows)

    @property
    def distances(self) -> tuple[StopDistance, ...]:
        """Every stop whose distance is known, in the order of the log; a bound where cut short."""
        grades = [(r.samples, r.mean_grade) for r in self.measured.records]
        for s in (*self.measured.unmeasured, *self.others):
            by_pitch = s.window.direction * self.mount.offset - s.pitch
            by_pitch /= self.measured.dive.steeper
            known = s.grade is not None and np.isfinite(s.grade).all()
            grades.append((s, s.mean_of(s.grade if known and s.grade is not None else by_pitch)))
        grades.sort(key=lambda row: row[0].window.command)
        return tuple(
            StopDistance(
                s.window.held_speed,
                s.distance,
                grade,
                s.brake_level,
                s.run,
                s.session,
                s.terrain,
                s.window.cut_short,
                s.speed_left,
                s.clock,
            )
            for s, grade in grades
        )


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
    windows, notes = _windows(columns, runs, is_usable, settings or StopSettings(), min_count)
    fresh, slow = _fresh(columns, runs)
    stops = [cut(columns, w, ground, fresh) for w in windows if w.usable]

    def refuse_few(count: int) -> None:
        if count < min_count:
            message = too_few(min_count, count, windows)
            raise ParameterError("stops", _reason(message, columns, windows, suspects))

    refuse_few(len(stops))
    bounds = [cut(columns, w, ground, fresh) for w in windows if w.is_bound]
    measured, mount = measure(stops, Mount(), slope, None, bounds), Mount()
    refuse_few(len(measured.records))
    again = estimate(measured, mount_of_log(columns, runs, is_usable, ground, measured))
    if again is not None:
        mount, slope = again
        body = Body(measured.dive, measured.swing)
        measured = measure(stops, mount, slope, body, bounds)
    sparse = [cut(columns, w, ground, fresh) for w in windows if w.verdict is Usability.SPARSE]
    notes = (*notes, *slow, *_told(measured))
    return MeasuredLog(measured, mount, windows, suspects, (*bounds, *sparse), notes)


def _windows(
    columns: Mapping[str, NDArray[Any]],
    runs: Sequence[slice],
    is_usable: Bools,
    settings: StopSettings,
    min_count: int,
) -> tuple[tuple[StopWindow, ...], tuple[str, ...]]:
    """Stops, with ramps and then reversals among them where the others are too few."""
    windows = without = _found(columns, runs, is_usable, settings)
    notes: tuple[str, ...] = ()
    for name, verdict in (("ramps", Usability.RAMPED), ("reversals", Usability.REVERSED)):
        if sum(w.usable for w in windows) >= min_count:
            break
        count = sum(w.verdict is verdict for w in windows)
        if count:
            settings = dataclasses.replace(settings, **{name: True})
            windows = _found(columns, runs, is_usable, settings)
            notes = (*notes, _BY_OTHER_COMMANDS[verdict].format(count, len(windows)))
    return (windows, notes) if sum(w.usable for w in windows) >= min_count else (without, ())


_BY_OTHER_COMMANDS = {
    Usability.RAMPED: "{} of {} stops begin with a command that comes down gradually: dead time "
    "and distance count from where it begins to, and force is that of the whole way",
    Usability.REVERSED: "{} of {} stops are commands to drive the other way: where these brake "
    "harder than the stop command, plans trust the brakes too much",
}


def _found(
    columns: Mapping[str, NDArray[Any]],
    runs: Sequence[slice],
    is_usable: Bools,
    settings: StopSettings,
) -> tuple[StopWindow, ...]:
    return tuple(w for run in runs for w in find_stops(columns, run, is_usable, settings))


def _fresh(
    columns: Mapping[str, NDArray[Any]], runs: Sequence[slice]
) -> tuple[Bools, tuple[str, ...]]:
    """(n,) samples with a new value of the speed, and a note where others repeat it."""
    fresh = np.ones(len(columns["t"]), np.bool_)
    periods, rows = [], []
    for run in runs:
        t, v = columns["t"][run], columns["v"][run]
        fresh[run] = fresh_samples(t, v)
        if period := held_period(t, v):
            periods.append(period)
            rows.append(float(np.median(np.diff(t))))
    if len(periods) <= len(runs) / 2:
        return fresh, ()
    every = f"{np.median(periods):.3g} s, in rows every {np.median(rows):.3g} s"
    return fresh, (f"v has a new value every {every}: rows that repeat it are not counted",)


def _told(measured: Measured) -> tuple[str, ...]:
    """Notes on the body's swing and on stops cut short."""
    notes = []
    if (swing := measured.swing) is not None:
        how = f"{swing.height:.2f} m times the pitch rate"
        if swing.gain:
            how = f"springs of {swing.frequency / (2.0 * np.pi):.1f} Hz"
        notes.append(f"the body swings on its springs while it brakes: taken out of v as {how}")
    if measured.bounds:
        count = len(measured.bounds)
        notes.append(f"{count} stops were cut short: the force is no less than what they show")
    return tuple(notes)


def too_few(min_count: int, count: int, windows: Sequence[StopWindow]) -> str:
    """Message: expected and actual number of usable stops."""
    return f"at least {min_count} usable stops, got {count} of {len(windows)} found"


def _reason(
    message: str,
    columns: Mapping[str, NDArray[Any]],
    windows: Sequence[StopWindow],
    suspects: Sequence[Suspect],
) -> str:
    """The message, with the stops that were excluded, the first of each kind, and what to try."""
    unusable = Counter(w.verdict for w in windows if w.verdict is not Usability.USABLE)
    if len(windows) == unusable[Usability.COASTED]:
        message += f"; {_A_STOP}"
    for verdict, count in unusable.most_common():
        first = next(w for w in windows if w.verdict is verdict)
        place = f"first at {columns['t'][first.command]:.2f} s"
        if "run" in columns:
            place += f" of run {columns['run'][first.command]}"
        example = f"{place}: {first.reason or verdict.value}"
        message += f"; {count} {verdict.name.lower()} ({example}; try: {verdict.remedy})"
    for s in suspects[:2]:
        message += f"; {s.channel}: {s.reason}"
    return message
