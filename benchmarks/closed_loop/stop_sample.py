"""One stop out of the robot's log, as a fit needs it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slopewise.models.arrays import Floats, Ints
from slopewise.models.laws.crest import load_loss
from slopewise.models.stops.simulation import GroundTrack

from .records import DrivenScene, StopTrace
from .terrain import SURFACES

_STANDS = 0.06  # [m/s] odometry below that is standstill
_AROUND = 0.3  # [m] before and after a stop that must be of the same surface
_SPAN = (-1.0, 15.0)  # [m] of ground that is kept


@dataclass(frozen=True, slots=True)
class MappedGround:
    """Ground along a route by the robot's map; arrays are (n,).

    Attributes:
        station: [m]. grade, roll: [rad]. surfaces: under the wheels, bit i is ``SURFACES[i]``.
    """

    station: Floats
    grade: Floats
    roll: Floats
    surfaces: Ints


@dataclass(frozen=True, slots=True)
class StopSample:
    """One logged stop.

    Attributes:
        surface: on which it was. speed: odometry at the command [m/s].
        distance: from command to rest [m]. stop_time: from command to rest [s].
        track: ground ahead from the command on, by the map.
        body_grade: −pitch of the body, averaged while braking [rad]: with dive and mount.
    """

    surface: str
    speed: float
    distance: float
    stop_time: float
    track: GroundTrack
    body_grade: float

    @property
    def grade(self) -> float:
        """Of the ground, averaged over the way [rad]."""
        return float(np.mean(self._along(self.track.grade)))

    @property
    def lean(self) -> float:
        """Size of the roll, averaged over the way [rad]."""
        return float(np.mean(np.abs(self._along(self.track.roll))))

    def while_braking(self, values: Floats, dead_time: float) -> Floats:
        """A column of the track at even steps of time from onset to rest, braked evenly."""
        left = 1.0 - (np.arange(20) + 0.5) / 20.0
        onset = min(self.speed * dead_time, 0.9 * self.distance)
        where = onset + (self.distance - onset) * (1.0 - left**2)
        found: Floats = np.interp(where, self.track.station, values)
        return found

    def crest(self, dead_time: float) -> float:
        """Share of the weight that crests took, averaged over the time of braking."""
        left = 1.0 - (np.arange(20) + 0.5) / 20.0
        station, grade = self.track.station, self.track.grade
        bend = np.diff(grade) / np.diff(station)
        there = np.searchsorted(station, self.while_braking(station, dead_time), "right") - 1
        lost = load_loss(self.speed * left, bend[np.minimum(there, len(bend) - 1)])
        return float(np.mean(lost))

    def _along(self, values: Floats) -> Floats:
        where = np.linspace(0.0, self.distance, 20)
        found: Floats = np.interp(where, self.track.station, values)
        return found


def sample(trace: StopTrace, ground: MappedGround) -> StopSample | None:
    """Read one stop; None if it does not reach standstill or surfaces meet on its way."""
    rests = np.flatnonzero(trace.speed < _STANDS)
    if len(rests) == 0 or trace.held < 2.0 * _STANDS:
        return None
    end = int(rests[0])
    ahead = ground.station - trace.station0
    distance = float(np.mean(trace.station[-10:]) - trace.station0)
    touched = ground.surfaces[(ahead > -_AROUND) & (ahead < distance + _AROUND)]
    if np.any(touched != touched[0]) or int(touched[0]).bit_count() != 1:
        return None
    near = (ahead > _SPAN[0]) & (ahead < _SPAN[1])
    zero = np.zeros(int(near.sum()))
    track = GroundTrack(ahead[near], ground.grade[near], ground.roll[near], zero, zero, zero, zero)
    return StopSample(
        surface=SURFACES[int(touched[0]).bit_length() - 1],
        speed=trace.held,
        distance=distance,
        # The last of the speed goes as fast as what went before.
        stop_time=float(trace.time[end]) * trace.held / (trace.held - float(trace.speed[end])),
        track=track,
        body_grade=-float(np.mean(trace.pitch[: end + 1])),
    )


def samples_of(drive: DrivenScene, ground: MappedGround) -> list[StopSample]:
    """All stops of one drive that are of use."""
    found = (sample(stop.trace, ground) for stop in drive.stops)
    return [s for s in found if s is not None]
