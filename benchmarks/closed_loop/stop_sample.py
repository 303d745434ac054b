"""One stop from the robot's log, prepared for the fit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slopewise.models.arrays import Floats, Ints
from slopewise.models.laws.crest import load_loss
from slopewise.models.stops.simulation import GroundTrack

from .loop_terrain import SURFACES
from .records import DrivenScene, StopTrace

_STANDSTILL_SPEED = 0.06  # [m/s] of odometry, above its noise
_AROUND = 0.3  # [m] before and after a stop that must be of the same surface
_SPAN = (-1.0, 15.0)  # [m] of stored ground, longer than any stop


@dataclass(frozen=True, slots=True)
class MappedGround:
    """Ground along a route by the robot's map, arrays of shape (n,).

    Attributes:
        station: [m].
        grade, roll: [rad].
        surfaces: under the wheels, bit i is ``SURFACES[i]``.
    """

    station: Floats
    grade: Floats
    roll: Floats
    surfaces: Ints


@dataclass(frozen=True, slots=True)
class StopSample:
    """One logged stop.

    Attributes:
        surface: name of the surface.
        speed: odometry at the command [m/s].
        distance, stop_time: from command to rest [m], [s].
        track: ground ahead of the command, by the map.
        body_grade: −pitch of the body while braking, with dive and mount offset [rad].
    """

    surface: str
    speed: float
    distance: float
    stop_time: float
    track: GroundTrack
    body_grade: float

    @property
    def grade(self) -> float:
        """Grade of the ground, averaged over the distance [rad]."""
        return float(np.mean(self._along(self.track.grade)))

    @property
    def abs_roll(self) -> float:
        """Size of the roll, averaged over the distance [rad]."""
        return float(np.mean(np.abs(self._along(self.track.roll))))

    def while_braking(self, values: Floats, dead_time: float) -> Floats:
        """A column of the track at equal steps of time from onset to rest, at constant force."""
        left = 1.0 - (np.arange(20) + 0.5) / 20.0
        onset = min(self.speed * dead_time, 0.9 * self.distance)
        where = onset + (self.distance - onset) * (1.0 - left**2)
        column: Floats = np.interp(where, self.track.station, values)
        return column

    def crest(self, dead_time: float) -> float:
        """Share of the weight lost on crests, averaged over the time of braking [1]."""
        left = 1.0 - (np.arange(20) + 0.5) / 20.0
        station, grade = self.track.station, self.track.grade
        curvature = np.diff(grade) / np.diff(station)
        cell = np.searchsorted(station, self.while_braking(station, dead_time), "right") - 1
        lost = load_loss(self.speed * left, curvature[np.minimum(cell, len(curvature) - 1)])
        return float(np.mean(lost))

    def _along(self, values: Floats) -> Floats:
        where = np.linspace(0.0, self.distance, 20)
        column: Floats = np.interp(where, self.track.station, values)
        return column


def sample(trace: StopTrace, ground: MappedGround) -> StopSample | None:
    """Read one stop; None if it does not reach standstill or crosses surfaces."""
    standing = np.flatnonzero(trace.speed < _STANDSTILL_SPEED)
    if len(standing) == 0 or trace.command_speed < 2.0 * _STANDSTILL_SPEED:
        return None
    end = int(standing[0])
    ahead = ground.station - trace.command_station
    distance = float(np.mean(trace.station[-10:]) - trace.command_station)
    touched = ground.surfaces[(ahead > -_AROUND) & (ahead < distance + _AROUND)]
    if np.any(touched != touched[0]) or int(touched[0]).bit_count() != 1:
        return None
    near = (ahead > _SPAN[0]) & (ahead < _SPAN[1])
    zero = np.zeros(int(near.sum()))
    track = GroundTrack(ahead[near], ground.grade[near], ground.roll[near], zero, zero, zero, zero)
    return StopSample(
        surface=SURFACES[int(touched[0]).bit_length() - 1],
        speed=trace.command_speed,
        distance=distance,
        # The remaining speed is lost at the mean deceleration.
        stop_time=float(trace.time[end])
        * trace.command_speed
        / (trace.command_speed - float(trace.speed[end])),
        track=track,
        body_grade=-float(np.mean(trace.pitch[: end + 1])),
    )


def samples_of(drive: DrivenScene, ground: MappedGround) -> list[StopSample]:
    """Usable stops of one drive."""
    samples = (sample(stop.trace, ground) for stop in drive.stops)
    return [s for s in samples if s is not None]
