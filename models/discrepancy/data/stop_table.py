"""All stops of a log side by side: channels on a grid of times, speeds averaged in bins.

The grid serves the laws, the bins the statistics. Averaging over bins keeps all information about
forces and makes every stop the same size, so that an array operation serves all stops.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slopewise.models.arrays import Bools, Floats, Ints
from slopewise.models.quantity import GRAVITY
from slopewise.models.stop_logs.dead_time import DeadTime
from slopewise.models.stop_logs.find_stops import StopWindow
from slopewise.models.stop_logs.stop_record import StopRecord

_CHANNELS = ("roll", "yaw", "yaw_rate", "x", "y", "vertical_curvature")
GROUND = ("grade", *_CHANNELS)
_MEANINGFUL = {*_CHANNELS, "run", "terrain", "t", "v", "v_cmd", "pitch", "z", "brake"}
_MEANINGFUL |= {f"{name}_{side}" for name in ("v", "current") for side in ("left", "right")}
"""Columns that are no further explanation: their meaning is known."""
NODES = 121  # grid times of a stop: 10 ms or so
_BINS = NODES // 3  # means of speed per stop: eight times as many as its slow waves need
HELD_BEFORE = 0.3  # held speed that belongs to a stop, for its level [s]
_LAST_SHARE = 0.95  # of a stop: what comes after is rocking, not braking [1]
NO_CHANCE = 3.0
"""Deviations from which a speed is above a standstill, and an offset is not chance [std]."""
_SMOOTHING = 0.08  # of measured speeds and grades, for products: below a half wave of the body [s]
MIN_PULL = 0.05  # share of the weight that a stop is taken to slow with at least [1]


_LATEST_CLOCK = 1e6  # from which a log counts since some epoch, not its session [s]


@dataclass(frozen=True, slots=True)
class StopGround:
    """Ground and motion along each stop, (S, M) each; zero for channels that are not logged.

    Attributes:
        grade, roll, yaw, yaw_rate: [rad], [rad/s]. x, y: [m].
        vertical_curvature: change of grade along the ground [1/m]; that of `grade` if not logged.
    """

    grade: Floats
    roll: Floats
    yaw: Floats
    yaw_rate: Floats
    x: Floats
    y: Floats
    vertical_curvature: Floats


@dataclass(frozen=True, slots=True)
class StopTable(StopGround):
    """S stops on M times each, K bins, with the ground as the measured vehicle met it.

    Attributes:
        time: (S, M) since the stop command [s], even steps in each stop.
        speed: (S, M) measured, smoothed [m/s]. station: (S, M) distance since the command [m].
        logged: channels that the log has.
        average: (S, K, M) means of each bin over grid values. binned: (S, K) measured [m/s].
        spread: (S, K) variance of a bin's mean for white noise of one; 0 for unused bins.
        held: (S,) speed before the command [m/s]. clock: (S,) of the command in the log [s].
        run: (S,) position of the run in the log. run_names: (S,) its name.
        session: (S,) number of the session.
        terrain: (S,) named surface, "" without. distance, standstill_time: (S,) measured [m], [s].
        sample: time between samples [s]. onset: start of braking, as calibration finds it [s].
        force: (S,) F_b/W as each stop shows individually.
        further: other numeric columns, mean over each stop, (S,) by name.
        warmed: (S, 2, E) of all stops that heated the brakes: seconds from their end to the
            command, infinite where they came later, and energy per mass [J/kg].
    """

    time: Floats
    speed: Floats
    station: Floats
    logged: frozenset[str]
    average: Floats
    binned: Floats
    spread: Floats
    held: Floats
    clock: Floats
    run: Ints
    session: Ints
    run_names: tuple[str, ...]
    terrain: tuple[str, ...]
    distance: Floats
    standstill_time: Floats
    force: Floats
    sample: float
    onset: float
    further: Mapping[str, Floats]
    warmed: Floats

    @property
    def session_time(self) -> Floats:
        """(S,) since the session began [s]: the log's clock, or since its first stop."""
        late = float(self.clock[0]) > _LATEST_CLOCK
        return self.clock - self.clock[0] if late else self.clock

    @property
    def pull(self) -> Floats:
        """(S,) of brakes and ground together, as a share of the weight; not below a little."""
        return np.maximum(self.force + np.sin(self.grade[:, -1]), MIN_PULL)

    def __len__(self) -> int:
        return len(self.held)

    def take(self, rows: Sequence[int] | Ints | Bools) -> StopTable:
        """The stops of ``rows``: indices, or (S,) whether to take each."""
        index = np.arange(len(self))[np.asarray(rows)]
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        arrays = {name: v[index] for name, v in values.items() if isinstance(v, np.ndarray)}
        return replace(
            self,
            **arrays,
            run_names=tuple(self.run_names[i] for i in index),
            terrain=tuple(self.terrain[i] for i in index),
            further={name: values[index] for name, values in self.further.items()},
        )


def tabulate(
    columns: Mapping[str, NDArray[Any]],
    runs: Sequence[slice],
    records: Sequence[StopRecord],
    excluded: Sequence[StopWindow],
    dead_time: DeadTime,
) -> StopTable:
    """The table of measured stops."""
    logged = frozenset(n for n in _CHANNELS if n in columns and _complete(columns[n], records))
    rows = [_row(columns, record, logged) for record in records]
    grid: dict[str, Any] = {
        name: np.stack([row[name] for row in rows])
        for name in ("time", "speed", "station", *GROUND)
    }
    bins_count = max(len(row["binned"]) for row in rows)
    bins: dict[str, Any] = {
        name: np.stack([_pad(row[name], bins_count) for row in rows])
        for name in ("average", "binned", "spread")
    }
    starts = [run.start for run in runs]
    windows = [r.samples.window for r in records]
    table = StopTable(
        **grid,
        **bins,
        logged=logged,
        held=np.array([w.held_speed for w in windows]),
        clock=np.array([r.samples.clock for r in records]),
        run=np.searchsorted(starts, [w.command for w in windows], side="right").astype(np.int64)
        - 1,
        session=np.unique([r.samples.session for r in records], return_inverse=True)[1],
        run_names=tuple(r.samples.run for r in records),
        terrain=tuple(r.samples.terrain for r in records),
        distance=np.array([r.samples.distance for r in records]),
        standstill_time=np.array([r.samples.standstill_time for r in records]),
        force=np.array([r.force_ratio for r in records]),
        sample=float(np.median([np.median(np.diff(r.samples.time)) for r in records])),
        onset=dead_time.value,
        further=_further(columns, windows),
        warmed=np.empty((len(records), 2, 0)),
    )
    return replace(table, warmed=_warmed(table, columns["t"], excluded))


def _warmed(table: StopTable, clock: NDArray[Any], excluded: Sequence[StopWindow]) -> Floats:
    """(S, 2, E) seconds since each stop of the log, and its energy, as the table has them."""
    # On a slope the ground brakes, too, or pushes.
    energy = 0.5 * table.held**2 * np.maximum(table.force / table.pull, 0.0)
    energy = np.append(energy, [0.5 * w.held_speed**2 for w in excluded])
    end = np.append(table.clock + table.standstill_time, [clock[w.standstill] for w in excluded])
    ago = table.clock[:, None] - end
    ago[ago < 0.0] = np.inf
    return np.stack(np.broadcast_arrays(ago, energy), axis=1)


def _further(
    columns: Mapping[str, NDArray[Any]], windows: Sequence[StopWindow]
) -> dict[str, Floats]:
    """Means over each stop, (S,), of numeric columns without a meaning here, where they differ."""
    columns_found = {}
    for name, column in columns.items():
        if name not in _MEANINGFUL and column.dtype.kind in "fiu":
            values = np.array([_mean(column, window) for window in windows])
            if np.isfinite(values).all() and np.ptp(values) > 0.0:
                columns_found[name] = values
    return columns_found


def _complete(values: NDArray[Any], records: Sequence[StopRecord]) -> bool:
    return all(
        np.isfinite(values[r.samples.window.begin : r.samples.window.end]).all() for r in records
    )


def _mean(values: NDArray[Any], window: StopWindow) -> float:
    part = values[window.command : window.standstill + 1]
    part = part[np.isfinite(part)]
    return float(np.mean(part)) if len(part) else float("nan")


def _pad(values: Floats, bins: int) -> Floats:
    missing = bins - len(values)
    return np.pad(values, [(0, missing)] + [(0, 0)] * (values.ndim - 1))


def _row(
    columns: Mapping[str, NDArray[Any]], record: StopRecord, logged: frozenset[str]
) -> dict[str, Floats]:
    s = record.samples
    part = slice(s.window.begin, s.window.end)
    last = min(int(np.searchsorted(s.time, _end_of_fall(record))), s.at_standstill)
    first = int(np.searchsorted(s.time, -HELD_BEFORE - 1e-9))
    time = np.linspace(s.time[first], s.time[last], NODES)

    def at_grid(values: Floats) -> Floats:
        result: Floats = np.interp(time, s.time, _smooth(s.time, values))
        return result

    row: dict[str, Floats] = {
        "time": time,
        "speed": np.maximum(at_grid(s.speed), 0.0),
        "station": np.interp(time, s.time, s.station - s.station[s.at_command]),
        "grade": at_grid(record.ground),
    }
    for name in _CHANNELS:
        values = columns[name][part] if name in logged else np.zeros(len(s.time))
        row[name] = at_grid(np.unwrap(values) if name == "yaw" else values)
    if "vertical_curvature" not in logged:
        row["vertical_curvature"] = _vertical_curvature(row["station"], row["grade"])
    used = slice(first, last + 1)
    row["average"], row["binned"], row["spread"] = _bins(s.time[used], s.speed[used], time)
    return row


def _vertical_curvature(station: Floats, grade: Floats) -> Floats:
    """(M,) change of grade along the ground [1/m], as a model with crests takes it in a replay."""
    step = np.gradient(station)
    return np.divide(np.gradient(grade), step, out=np.zeros_like(grade), where=step > 0.0)


def _end_of_fall(record: StopRecord) -> float:
    """Time until which the speed certainly fell [s].

    Near standstill noise decides which sample comes first to zero: the fall ends where its line
    is still above the noise.
    """
    knee = record.knee
    pull = GRAVITY * (knee.force_ratio + float(np.sin(knee.mean_grade)))
    min_speed = max((1.0 - _LAST_SHARE) * knee.onset_speed, NO_CHANCE * knee.rms)
    fall = (
        max(knee.onset_speed - min_speed, 0.5 * knee.onset_speed) / pull if pull > 0.0 else np.inf
    )
    return min(_LAST_SHARE * record.samples.standstill_time, knee.onset_time + fall)


def _bins(t: Floats, v: Floats, grid: Floats) -> tuple[Floats, Floats, Floats]:
    """Means of equally many samples each; a sample is between two times of the grid."""
    count = min(len(t), _BINS)
    owner = (np.arange(len(t)) * count) // len(t)
    sizes = np.bincount(owner, minlength=count).astype(np.float64)
    place = np.clip((t - grid[0]) / (grid[1] - grid[0]), 0.0, len(grid) - 1.000001)
    left = place.astype(np.int64)
    share = place - left
    average = np.zeros((count, len(grid)))
    np.add.at(average, (owner, left), (1.0 - share) / sizes[owner])
    np.add.at(average, (owner, left + 1), share / sizes[owner])
    return average, np.bincount(owner, weights=v, minlength=count) / sizes, 1.0 / sizes


def _smooth(t: Floats, values: Floats) -> Floats:
    step = max(float(np.median(np.diff(t))), 1e-4)
    half = min(int(2.5 * _SMOOTHING / step), len(values) - 1)
    if half < 1:
        return values
    kernel = np.exp(-0.5 * np.square(np.arange(-half, half + 1) * step / _SMOOTHING))
    # Odd extension: a straight line stays one up to its ends.
    head = 2.0 * values[0] - values[half:0:-1]
    tail = 2.0 * values[-1] - values[-2 : -half - 2 : -1]
    result: Floats = np.convolve(
        np.concatenate((head, values, tail)), kernel / kernel.sum(), mode="valid"
    )
    return result
