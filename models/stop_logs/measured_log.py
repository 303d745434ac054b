"""The stops of a log, found and measured: the one pipeline for everything that learns from stops.

Suspect samples are excluded; stops are found, extracted, and measured with the grade by the body's
pitch. They give the mount offset of the pitch sensor, and are measured again with an estimate of it
and of the slope coefficient: calibration and discrepancy differ only in that estimate. Where too
few stops begin with a step of the command, ramps and reversals are used as well.
"""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slopewise.models.arrays import Floats
from slopewise.models.errors import ParameterError
from slopewise.models.stop_logs.drive_quality import Suspect, find_suspects, usable
from slopewise.models.stop_logs.find_stops import StopSettings, StopWindow, Usability, find_stops
from slopewise.models.stop_logs.held_values import fresh_samples, held_period
from slopewise.models.stop_logs.measure import Measured, Slope, measure
from slopewise.models.stop_logs.mount_of_log import mount_of_log
from slopewise.models.stop_logs.mount_offset import Mount
from slopewise.models.stop_logs.speed_scale import note_on_speed
from slopewise.models.stop_logs.stop_record import StopSamples, cut

_STOP_DEFINITION = (
    "a stop begins where v_cmd goes to 0 while the vehicle rolls, and ends, under brakes, where it "
    "stands"
)

_NO_FORCE = "show no force: record the speed more often, or stop from higher speeds"

Estimate = Callable[[Measured, Mount], tuple[Mount, Slope] | None]
"""Mount and slope coefficient for a second measurement, from the first one and the mount of the
log; None to keep the first."""


@dataclass(frozen=True, slots=True)
class MeasuredLog:
    """The measured stops of a log, before anything is fitted to their forces."""

    measured: Measured
    mount: Mount  # of the pitch sensor, subtracted from the grades
    windows: tuple[StopWindow, ...]  # every stop, usable or not
    suspects: tuple[Suspect, ...]  # excluded stretches
    sparse: tuple[StopSamples, ...]  # stops with too few samples for a force
    notes: tuple[str, ...]  # sentences on how the log was read

    @property
    def usable(self) -> int:
        """Number of stops that may be learned from, measured or not."""
        return sum(w.usable for w in self.windows)

    @property
    def distances(self) -> tuple[tuple[StopSamples, float], ...]:
        """Every straight stop with a known distance, and its mean grade from the command on [rad].

        Its force may be unknown; stops that were cut short are included and marked.
        """
        records = (*self.measured.records, *self.measured.bounds)
        rows = [(r.samples, r.mean_grade) for r in records]
        for s in (*self.measured.unmeasured, *self.sparse):
            ground = (s.window.direction * self.mount.offset - s.pitch) / self.measured.dive.steeper
            if s.grade is not None:
                ground = np.where(np.isfinite(s.grade), s.grade, ground)
            rows.append((s, s.mean_of(ground)))
        return tuple(sorted(rows, key=lambda row: row[0].window.command))


def is_mapped(ground: Floats | None) -> bool:
    """Return True if a map has the grade of every sample (n,), so that no pitch is needed."""
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
        columns: channels of a drive log, (n,). runs: samples of each run.
        slope: prior of the slope coefficient, used where the grade varies along a stop.
        estimate: of mount and slope, for the second measurement.
        ground: (n,) grade of the ground by a map [rad], NaN where unknown; None without a map.
        settings: of what is a stop. min_count: stops below which ramps and reversals are used, and
            with too few of these an error is raised.

    Raises:
        ParameterError: too few usable stops; says how many were found and what was wrong with them.
    """
    suspects = find_suspects(columns, runs)
    required = ["v", "v_cmd"] if is_mapped(ground) else ["v", "v_cmd", "pitch"]
    is_usable = usable(len(columns["t"]), suspects, required)
    fresh = fresh_samples(columns, runs)

    def search(given: StopSettings) -> tuple[StopWindow, ...]:
        return tuple(w for run in runs for w in find_stops(columns, run, is_usable, given, fresh))

    windows, notes = _enough_windows(search, settings or StopSettings(), min_count)

    def samples(chosen: Iterable[StopWindow]) -> list[StopSamples]:
        return [cut(columns, w, ground, fresh) for w in chosen]

    def refuse_few(count: int) -> None:
        if count < min_count:
            message = too_few(min_count, count, windows)
            unmeasured = sum(w.usable for w in windows) - count
            message += f"; {unmeasured} usable ones {_NO_FORCE}" if unmeasured else ""
            raise ParameterError("stops", _explained(message, columns, windows, suspects))

    stops = samples(w for w in windows if w.usable)
    refuse_few(len(stops))
    bounds = samples(w for w in windows if w.is_bound)
    mount = Mount()
    measured = measure(stops, mount, slope, None, bounds)
    refuse_few(len(measured.records))
    again = estimate(measured, mount_of_log(columns, runs, is_usable, ground, measured))
    if again is not None:
        mount, slope = again
        measured = measure(stops, mount, slope, (measured.dive, measured.oscillation), bounds)
    sparse = tuple(samples(w for w in windows if w.verdict is Usability.SPARSE))
    on_speed = *_note_on_rate(columns, runs), *note_on_speed(columns, runs, is_usable)
    notes = (*notes, *on_speed, *_notes_on_stops(measured))
    return MeasuredLog(measured, mount, windows, suspects, sparse, notes)


_BY_OTHER_COMMANDS = {
    Usability.RAMPED: "{} of {} stops begin with a command that comes down gradually: dead time "
    "and distance are from the beginning of that, and the force is the mean from there on",
    Usability.REVERSED: "{} of {} stops are commands to drive the other way: where these brake "
    "harder than the stop command, plans trust the brakes too much",
}


def _enough_windows(
    search: Callable[[StopSettings], tuple[StopWindow, ...]], settings: StopSettings, min_count: int
) -> tuple[tuple[StopWindow, ...], tuple[str, ...]]:
    """Stops and notes; ramps, then reversals are among them where the others are too few."""
    windows = steps = search(settings)
    notes: tuple[str, ...] = ()
    for name, verdict in (("ramps", Usability.RAMPED), ("reversals", Usability.REVERSED)):
        count = sum(w.verdict is verdict for w in windows)
        if count and sum(w.usable for w in windows) < min_count:
            settings = dataclasses.replace(settings, **{name: True})
            windows = search(settings)
            notes = (*notes, _BY_OTHER_COMMANDS[verdict].format(count, len(windows)))
    return (windows, notes) if sum(w.usable for w in windows) >= min_count else (steps, ())


def _note_on_rate(columns: Mapping[str, NDArray[Any]], runs: Sequence[slice]) -> tuple[str, ...]:
    """Note on a speed that is measured less often than the log has rows."""
    period = held_period(columns, runs)
    if not period:
        return ()
    step = float(np.median(np.diff(columns["t"])))
    every = f"a new value every {period:.3g} s, in rows every {step:.3g} s"
    return (f"v has {every}: rows that repeat it are not counted",)


def _notes_on_stops(measured: Measured) -> tuple[str, ...]:
    """Notes on the body's oscillation and on stops cut short."""
    notes = []
    if (oscillation := measured.oscillation) is not None:
        how = f"{oscillation.height:.2f} m times the pitch rate"
        if oscillation.gain:
            how = f"springs of {oscillation.frequency / (2.0 * np.pi):.1f} Hz"
        notes.append(f"the body swings on its springs while it brakes: removed from v as {how}")
    if count := len(measured.bounds):
        notes.append(f"{count} stops were cut short: the force is no less than what they show")
    return tuple(notes)


def too_few(min_count: int, count: int, windows: Sequence[StopWindow]) -> str:
    """Message: expected and actual number of usable stops."""
    return f"at least {min_count} usable stops, got {count} of {len(windows)} found"


def _explained(
    message: str,
    columns: Mapping[str, NDArray[Any]],
    windows: Sequence[StopWindow],
    suspects: Sequence[Suspect],
) -> str:
    """The message, with the stops that were excluded, the first of each kind, and what to try."""
    unusable = Counter(w.verdict for w in windows if w.verdict is not Usability.USABLE)
    if len(windows) == unusable[Usability.COASTED]:
        message += f"; {_STOP_DEFINITION}"
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
