"""One measured stop of a log: the row that all learning from stops is based on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slopewise.models.arrays import Bools, Floats
from slopewise.models.stop_logs.find_stops import StopWindow
from slopewise.models.stop_logs.onset import Knee, Oscillation


@dataclass(frozen=True, slots=True)
class StopSamples:
    """The samples of one stop, (n,) each, from before the command to some time after standstill.

    Speed, pitch and grade are those in the direction of travel. A stop that was cut short ends with
    its last sample before the cut.
    """

    window: StopWindow
    run: str  # names, "" where the log has none
    terrain: str
    session: str
    time: Floats  # since the stop command [s]
    speed: Floats  # [m/s], interpolated between fresh samples
    fresh: Bools  # samples with a new value of the speed
    pitch: Floats  # of the body, nose down positive [rad]
    pitch_rate: Floats | None  # [rad/s], None if it is not in the log
    grade: Floats | None  # by a map [rad], NaN where it does not know it
    station: Floats  # distance since the first sample, forward only [m]
    standstill_time: float  # first zero crossing since the command, or the cut [s]
    distance: float  # from the command to standstill, or to the cut [m]
    clock: float  # time of the stop command in the log [s]
    brake_level: float  # application [1], NaN if it is not in the log

    @property
    def at_command(self) -> int:
        """Index of the stop command in the arrays."""
        return self.window.command - self.window.begin

    @property
    def at_standstill(self) -> int:
        """Index of the first sample at standstill, or of the last before the cut."""
        return self.window.standstill - self.window.begin

    @property
    def cut_short(self) -> bool:
        """It did not reach standstill: `distance` is less than that of the whole stop."""
        return self.window.cut_short

    @property
    def speed_left(self) -> float:
        """Speed at the cut, 0 for a whole stop [m/s]."""
        return float(self.speed[self.at_standstill]) if self.cut_short else 0.0

    @property
    def braking(self) -> slice:
        """Samples from the stop command to standstill."""
        return slice(self.at_command, self.at_standstill + 1)

    def of_body(self, oscillation: Oscillation | None) -> Floats:
        """(n,) speed without what a known pitch rate adds to it at the wheels [m/s]."""
        if oscillation is None or not oscillation.height or self.pitch_rate is None:
            return self.speed
        return self.speed + oscillation.height * self.pitch_rate

    def mean_of(self, grade: Floats) -> float:
        """Mean of a grade (n,) over the distance from the command to the end [rad]."""
        station, grade = self.station[self.braking], grade[self.braking]
        length = float(station[-1] - station[0])
        return float(np.trapezoid(grade, station)) / length if length > 0.0 else float(grade[0])


@dataclass(frozen=True, slots=True)
class StopRecord:
    """One measured stop, and the fitted model's prediction of it."""

    samples: StopSamples
    knee: Knee  # onset, speed and force of this stop alone
    ground: Floats  # (n,) grade of the ground at the samples [rad]
    noise: float  # of the speed, correlation included [m/s]
    onset_speed: float  # v_i [m/s]
    grade: float  # mean while braking [rad]
    force_ratio: float  # F_b/W; no more than it where the stop was cut short
    force_std: float  # measurement noise of it
    by_effects: float = 0.0  # by how much they make the stop longer [m]
    applied: float = 1.0  # share of full braking; force_ratio is as if it were 1
    resistance: float = 0.0  # of rolling, which stays when less is applied [1]
    kept: bool = True  # words: ok, False if it fits no other stop and the coefficients ignore it
    predicted_distance: float = np.nan  # by a fit without this stop, without offsets [m]
    predicted_time: float = np.nan  # likewise [s]; both inf where the model does not stop
    bound_distance: float = np.nan  # that plans at the quantile allow [m]

    def at_level(self, coefficients: Floats) -> Floats:
        """(4,) coefficients of full brakes as they act at the application of this stop."""
        at_level = self.applied * coefficients
        at_level[3] += (1.0 - self.applied) * self.resistance
        return at_level

    @property
    def mean_grade(self) -> float:
        """Grade of the ground, mean over the distance from the command to standstill [rad]."""
        return self.samples.mean_of(self.ground)

    @property
    def distance_margin(self) -> float:
        """Allowed minus actual stopping distance [m]; below 0 where the stop was longer."""
        return self.bound_distance - self.samples.distance

    @property
    def path(self) -> tuple[Floats, Floats]:
        """(n,) distance since the stop command [m] and (n,) grade [rad], up to standstill."""
        s = self.samples
        return s.station[s.braking] - s.station[s.at_command], self.ground[s.braking]


def forces_of(records: Sequence[StopRecord]) -> tuple[Floats, Floats, Floats, Floats]:
    """(n,) onset speeds [m/s], mean grades [rad], F_b/W and its measurement noise [1] of stops."""
    rows = [(r.onset_speed, r.grade, r.force_ratio, r.force_std) for r in records]
    speed, grade, force, noise = np.array(rows, np.float64).reshape(-1, 4).T.copy()
    return speed, grade, force, noise


def cut(
    columns: Mapping[str, NDArray[Any]], window: StopWindow, grade: Floats | None, fresh: Bools
) -> StopSamples:
    """The samples of a window of a log, with distance and standstill.

    ``grade``: of the ground along the path [rad], None if only the body's pitch is known.
    ``fresh``: samples of the log with a new value of the speed.
    """
    part = slice(window.begin, window.end)
    clock = float(columns["t"][window.command])
    time = columns["t"][part] - clock
    speed, new = window.direction * columns["v"][part], fresh[part]
    if not new.all() and new.any():
        speed = np.interp(time, time[new], speed[new])
    k = window.standstill - window.begin
    station, end = _stations(time, speed, k, window.cut_short)
    has_level = "brake" in columns and np.isfinite(columns["brake"][part]).any()
    run, terrain, session = (
        str(columns[name][window.command]) if name in columns else ""
        for name in ("run", "terrain", "session")
    )
    rate = columns.get("pitch_rate")
    return StopSamples(
        window=window,
        run=run,
        terrain=terrain,
        session=session,
        time=time,
        speed=speed,
        fresh=new,
        pitch=window.direction * columns["pitch"][part],
        pitch_rate=None if rate is None else window.direction * rate[part],
        grade=None if grade is None else grade[part],
        station=station,
        standstill_time=end,
        distance=float(station[k] - station[window.command - window.begin]),
        clock=clock,
        brake_level=window.level if has_level else np.nan,
    )


def _stations(time: Floats, speed: Floats, k: int, cut_short: bool) -> tuple[Floats, float]:
    """(n,) distance since the first sample [m], and time of standstill at sample k, or the cut."""
    forward = np.maximum(speed, 0.0)
    if not cut_short:
        forward[k:] = 0.0
    steps = 0.5 * (forward[1:] + forward[:-1]) * np.diff(time)
    station = np.concatenate(([0.0], np.cumsum(steps)))
    if cut_short:
        return station, float(time[k])
    end = _crossing(time[k - 1], speed[k - 1], time[k], speed[k])
    # The last step ends at the crossing and not at the sample behind it.
    station[k:] += 0.5 * speed[k - 1] * (end - time[k])
    return station, end


def _crossing(t0: float, v0: float, t1: float, v1: float) -> float:
    """When the speed between two samples reaches zero; the later one where it only comes near."""
    if v1 >= v0:
        return t1
    return float(min(t0 + v0 / (v0 - v1) * (t1 - t0), t1))
