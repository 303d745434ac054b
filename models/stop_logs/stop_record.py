"""One measured stop of a log: the row that all learning from stops is based on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slopewise.models.arrays import Bools, Floats
from slopewise.models.stop_logs.find_stops import StopWindow
from slopewise.models.stop_logs.held_values import fresh_samples
from slopewise.models.stop_logs.onset import Knee


@dataclass(frozen=True, slots=True)
class StopSamples:
    """The samples of one stop, (n,) each, from before the command to some time after standstill.

    Speed, pitch and grade are those in the direction of travel. A stop that was cut short ends with
    its last sample before the cut.

    Attributes:
        window: where in the log. run, terrain, session: names, "" where the log has none.
        time: since the stop command [s]. speed: [m/s]. pitch: pitch of the body [rad], nose
            down positive. grade: known from a map [rad], NaN where it is not, None without a map.
        station: distance since the first sample, forward only [m].
        fresh: (n,) samples with a new value of the speed, which is interpolated between them.
        standstill_time: time of the first zero crossing since the command, or of the cut [s].
        distance: from the command to standstill, or to the cut [m].
        clock: time of the stop command in the log [s].
        brake_level: application of the brakes [1], NaN if it is not in the log.
        speed_left: at the cut [m/s]; 0 for a stop that ended at standstill.
        pitch_rate: of the body, nose down positive [rad/s], None if it is not in the log.
    """

    window: StopWindow
    run: str
    terrain: str
    time: Floats
    speed: Floats
    pitch: Floats
    grade: Floats | None
    station: Floats
    fresh: Bools
    standstill_time: float
    distance: float
    clock: float
    session: str = ""
    brake_level: float = np.nan
    speed_left: float = 0.0
    pitch_rate: Floats | None = None

    @property
    def at_command(self) -> int:
        """Index of the stop command in the arrays."""
        return self.window.command - self.window.begin

    @property
    def at_standstill(self) -> int:
        """Index of the first sample at standstill, or of the last before the cut."""
        return self.window.standstill - self.window.begin

    @property
    def speed_at_command(self) -> float:
        """Speed held before the stop command, in the direction of travel [m/s]."""
        return self.window.held_speed

    @property
    def cut_short(self) -> bool:
        """It did not reach standstill: `distance` is less than that of the whole stop."""
        return self.window.cut_short

    def mean_of(self, grade: Floats) -> float:
        """Mean over the distance from the command to the end of a grade (n,) at the samples."""
        along = slice(self.at_command, self.at_standstill + 1)
        station, grade = self.station[along], grade[along]
        length = float(station[-1] - station[0])
        return float(np.trapezoid(grade, station)) / length if length > 0.0 else float(grade[0])


@dataclass(frozen=True, slots=True)
class StopRecord:
    """One measured stop, and the fitted model's prediction of it.

    Attributes:
        samples: where it comes from. knee: onset, speed and force of this stop alone.
        ground: (n,) grade of the ground at the samples [rad].
        noise: speed noise, correlation included [m/s].
        onset_speed: v_i [m/s]. grade: mean while braking [rad]. force_ratio: F_b/W, a lower bound
            of it for a stop that was cut short. force_std: its measurement noise.
        onset_shift: by how much named effects make the onset look later [s].
        applied: share of full brake application; force_ratio is as if it were 1. resistance: of
            rolling, which stays when it is less [1].
        by_effects: by how much they make the stop longer [m].
        kept: False if it fits no other stop and the coefficients ignore it.
        in_weaker_state: it fits no other stop but those of a weaker state of the brakes.
        predicted_distance, predicted_time: prediction of a fit without this stop, without safety
            offsets [m], [s]; inf if the model does not stop here.
        without: (4,) coefficients of the fit that has not seen it.
        bound_distance: distance that plans at the quantile reserve for this stop, with offset [m].
    """

    samples: StopSamples
    knee: Knee
    ground: Floats
    noise: float
    onset_speed: float
    grade: float
    force_ratio: float
    force_std: float
    onset_shift: float = 0.0
    by_effects: float = 0.0
    applied: float = 1.0
    resistance: float = 0.0
    kept: bool = True
    predicted_distance: float = np.nan
    predicted_time: float = np.nan
    bound_distance: float = np.nan
    in_weaker_state: bool = False
    without: Floats | None = None

    def at_level(self, coefficients: Floats) -> Floats:
        """(4,) coefficients of full brakes as they act at the application of this stop."""
        at_level = self.applied * coefficients
        at_level[3] += (1.0 - self.applied) * self.resistance
        return at_level

    @property
    def force_at_level(self) -> float:
        """F_b/W at the application of this stop."""
        return self.applied * self.force_ratio + (1.0 - self.applied) * self.resistance

    @property
    def mean_grade(self) -> float:
        """Grade of the ground, mean over the distance from the command to standstill [rad]."""
        return self.samples.mean_of(self.ground)

    @property
    def path(self) -> tuple[Floats, Floats]:
        """(n,) distance since the stop command [m] and (n,) grade [rad], up to standstill."""
        s = self.samples
        along = slice(s.at_command, s.at_standstill + 1)
        return s.station[along] - s.station[s.at_command], self.ground[along]


def cut(
    columns: Mapping[str, NDArray[Any]],
    window: StopWindow,
    grade: Floats | None,
    fresh: Bools | None = None,
) -> StopSamples:
    """The samples of a window, with distance and standstill.

    Args:
        columns: channels of the log. window: a stop.
        grade: (all samples,) of the ground along the way [rad], None if only the body's pitch is
            known. fresh: (all samples,) with a new value of the speed; None finds them.
    """
    part = slice(window.begin, window.end)
    clock = float(columns["t"][window.command])
    time = columns["t"][part] - clock
    speed = window.direction * columns["v"][part]
    new = fresh_samples(time, speed) if fresh is None else fresh[part]
    if not new.all():
        speed = np.interp(time, time[new], speed[new])
    forward = np.maximum(speed, 0.0)
    k = window.standstill - window.begin
    if not window.cut_short:
        forward[k:] = 0.0
    steps = 0.5 * (forward[1:] + forward[:-1]) * np.diff(time)
    station = np.concatenate(([0.0], np.cumsum(steps)))
    end_time = float(time[k])
    if not window.cut_short:
        end_time = _crossing(time[k - 1], speed[k - 1], time[k], speed[k])
        # The last step ends at the crossing and not at the sample behind it.
        station[k:] += 0.5 * speed[k - 1] * (end_time - time[k])
    level = window.level if np.isfinite(columns.get("brake", np.nan)).any() else np.nan

    def name(column: str) -> str:
        return str(columns[column][window.command]) if column in columns else ""

    return StopSamples(
        window,
        name("run"),
        name("terrain"),
        time,
        speed,
        window.direction * columns["pitch"][part],
        None if grade is None else grade[part],
        station,
        new,
        end_time,
        float(station[k] - station[window.command - window.begin]),
        clock,
        name("session"),
        level,
        float(speed[k]) if window.cut_short else 0.0,
        window.direction * columns["pitch_rate"][part] if "pitch_rate" in columns else None,
    )


def _crossing(t0: float, v0: float, t1: float, v1: float) -> float:
    """When the speed between two samples reaches zero; the later one where it only comes near."""
    if v1 >= v0:
        return t1
    return float(min(t0 + v0 / (v0 - v1) * (t1 - t0), t1))
