"""The terrain estimator: samples in, observations of the ground out, online as offline.

Each sample costs a few scalar updates. At the end of each steady stretch, four seconds at most,
its samples are evaluated together. Source: Slip, Sec. 2–4.1.
"""

from __future__ import annotations

import dataclasses
from collections import deque
from math import isfinite
from typing import NamedTuple

import numpy as np

from slopewise.models.terrain.observation import (
    UNKNOWN,
    Features,
    GroundObservation,
    TerrainEstimate,
)
from slopewise.models.terrain.phases import MotionPhases, Phase
from slopewise.models.terrain.resistances import (
    Drivetrain,
    SteadyStretch,
    lateral_resistance_of,
    motion_resistance_of,
    scattered,
    turning_thrust_of,
)
from slopewise.models.terrain.settings import EstimatorSettings
from slopewise.models.terrain.slip_track_filter import SlipTrackFilter
from slopewise.models.vehicle import Vehicle

_ONSET = 0.5
"""Steady motion that the current at its onset is averaged over [s]."""
_LATE = 3.0
"""Smoothing times by which a change of motion is noticed after the filter saw it [1]."""
_SIGNED_BELOW = -0.3
"""A current below this is no noise of a magnitude [A]."""


class DriveSample(NamedTuple):
    """Measurements at one moment."""

    time: float  # [s]
    v_left: float  # rim speeds of the sides [m/s]
    v_right: float
    yaw_rate: float  # ω_z with bias [rad/s]
    current_left: float  # currents of the sides' motors [A]
    current_right: float
    pitch: float  # nose down positive [rad]
    roll: float  # left side up positive [rad]


class GyroBias:
    """Bias [rad/s] of a yaw rate gyroscope: the mean at rest, the past forgotten as it drifts.

    Validity: rim speeds show rest, and the yaw rate a vehicle that is towed or slides. Omits:
    temperature. Source: standard practice; Slip 2.1 takes the gyroscope as free of bias.
    """

    def __init__(self, memory: float = 60.0) -> None:
        """Begin with bias 0; ``memory``: time constant of forgetting [s of rest]."""
        self.bias = 0.0
        self._memory = memory
        self._samples = 0

    def update(self, yaw_rate: float, elapsed: float) -> None:
        """One sample at rest [rad/s], ``elapsed`` after the one before [s]."""
        self._samples += 1
        gain = max(1.0 / self._samples, min(1.0, elapsed / self._memory))
        self.bias += gain * (yaw_rate - self.bias)


class TerrainEstimator:
    """f_r, μ_t and B_s of the ground under a skid-steered vehicle.

    Attributes:
        filter: slip track; runs in turns.
        bias: bias of the yaw rate gyroscope; learned at rest.
        phases: kind of motion now.
        signed: the currents have a sign, positive driving forward. False until one is negative.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        *,
        slip_track: float,
        motion_resistance: TerrainEstimate,
        settings: EstimatorSettings | None = None,
    ) -> None:
        """Begin; ParameterError if the vehicle has no motor torque constant or gear ratio.

        Args:
            vehicle: sizes and motors.
            slip_track: B_s to begin with [m].
            motion_resistance: f_r assumed in turns before the first straight.
            settings: the paper's, where it gives them, by default.
        """
        self._vehicle = vehicle
        self._drive = Drivetrain.of(vehicle)
        self._settings = EstimatorSettings() if settings is None else settings
        self._start = slip_track
        self._assumed = dataclasses.replace(motion_resistance, note="f_r assumed")
        self._longest = self._settings.motion.longest_stretch
        self._gap = self._settings.motion.longest_gap
        self._late = _LATE * self._settings.motion.smoothing
        self._before: deque[tuple[float, float, float]] = deque()
        self.phases = MotionPhases(vehicle.track_width, self._settings.motion)
        self.bias = GyroBias()
        self.signed = False
        self.begin_run()

    def begin_run(self) -> None:
        """Another run, perhaps on other ground; the bias of the gyroscope stays."""
        self.filter = SlipTrackFilter(self._start, self._settings.filter)
        self.phases.begin()
        self.known = Features()
        self._before.clear()
        self._samples: list[tuple[float, ...]] = []
        self._kind = Phase.OTHER
        self._time: float | None = None
        self._turned = False

    def update(self, sample: DriveSample, usable: bool = True) -> GroundObservation | None:
        """One sample; an observation if it ends a stretch that is long enough.

        A sample that is not later than the one before is ignored. One that is not ``usable``, or
        has a number that is not finite, ends the stretch.
        """
        time, v_left, v_right, yaw_rate, current_left, current_right, pitch, roll = sample
        elapsed = 0.0 if self._time is None else time - self._time
        if elapsed < 0.0 or (elapsed == 0.0 and self._time is not None) or not isfinite(time):
            return None
        self._time = time
        numbers = v_left + v_right + yaw_rate + current_left + current_right + pitch + roll
        if not usable or elapsed > self._gap or not isfinite(numbers):
            done = self._close(trim=True)
            self.phases.begin()
            return done
        turning = yaw_rate - self.bias.bias
        phase = self.phases.update(elapsed, v_left, v_right, turning)
        if phase is Phase.REST:
            self.bias.update(yaw_rate, elapsed)
        elif not self.phases.withheld:
            self._filter(time, v_right - v_left, turning, elapsed)
        if current_left < _SIGNED_BELOW or current_right < _SIGNED_BELOW:
            self.signed = True
        done = None
        if phase is not self._kind:
            done = self._close(trim=True)
            self._kind = phase
        if phase is not Phase.OTHER and phase is not Phase.REST:
            samples = self._samples
            samples.append(
                (time, v_left, v_right, turning, current_left, current_right, pitch, roll)
            )
            if time - samples[0][0] >= self._longest:
                done = self._close(trim=False)
                self._kind = phase
        return done

    def _filter(self, time: float, difference: float, turning: float, elapsed: float) -> None:
        """One sample for the slip track; its states of the last moment are stored."""
        before = self._before
        before.append((time, self.filter.inverse, self.filter.variance))
        while before[0][0] < time - self._late:
            before.popleft()
        self.filter.update(difference, turning, elapsed)
        self._turned = True

    def forget(self, latest: Features) -> None:
        """The ground has changed: only the latest measurements still hold."""
        self.known = Features()
        self._learn(latest)
        self.filter.variance = self._settings.filter.initial_std**2

    def finish(self) -> GroundObservation | None:
        """The stretch that the run ended in, if it is long enough."""
        return self._close(trim=True)

    def _close(self, *, trim: bool) -> GroundObservation | None:
        """Evaluate the open stretch.

        ``trim``: motion may have changed; the smoothed speeds follow late by their time constant.
        """
        samples, phase = self._samples, self._kind
        self._samples, self._kind = [], Phase.OTHER
        if trim and self._before:  # so did the filter: back to before its last samples
            _, self.filter.inverse, self.filter.variance = self._before[0]
        self._before.clear()
        if not samples:
            return None
        columns = np.array(samples).T
        if trim and phase is not Phase.STUCK:
            last = columns[0, -1] - self._settings.motion.smoothing
            columns = columns[:, columns[0] <= last]
        short = self._settings.motion.shortest_stretch
        if columns.shape[1] < 2 or columns[0, -1] - columns[0, 0] < short:
            return None
        return self._observation(phase, SteadyStretch(*columns))

    def _measure(self, phase: Phase, stretch: SteadyStretch) -> Features:
        settings = self._settings.resistance
        if phase is Phase.STRAIGHT:
            f_r = motion_resistance_of(stretch, self._drive, settings, signed=self.signed)
            return Features(motion_resistance=f_r)
        if phase not in (Phase.TURN, Phase.SPOT):
            return Features()
        f_r = self.known.motion_resistance
        assumed = self._assumed if f_r is UNKNOWN else f_r
        lateral = lateral_resistance_of(
            stretch,
            self._vehicle,
            self._drive,
            assumed,
            settings,
            signed=self.signed,
            min_inner_speed=self._settings.motion.least_inner_speed,
        )
        slip = UNKNOWN
        if self._turned:
            filtered = self.filter.slip_track, self.filter.slip_track_std
            slip = scattered(*filtered, settings.slip_scatter)
        return Features(lateral_resistance=lateral, slip_track=slip)

    def _learn(self, measured: Features) -> None:
        """Store the latest of each parameter."""
        news = {field.name: getattr(measured, field.name) for field in dataclasses.fields(measured)}
        news = {name: estimate for name, estimate in news.items() if estimate.is_known}
        self.known = dataclasses.replace(self.known, **news)

    def _observation(self, phase: Phase, stretch: SteadyStretch) -> GroundObservation:
        time, settings = stretch.time, self._settings.resistance
        measured, turning = self._measure(phase, stretch), UNKNOWN
        self._learn(measured)
        if phase in (Phase.TURN, Phase.SPOT):
            turning = turning_thrust_of(stretch, self._vehicle, self._drive, settings)
        onset = time <= time[0] + _ONSET
        current = np.abs(stretch.current_left[onset]) + np.abs(stretch.current_right[onset])
        return GroundObservation(
            begin=float(time[0]),
            end=float(time[-1]),
            phase=phase,
            samples=len(time),
            speed=float(np.mean(stretch.v_left + stretch.v_right)) / 2.0,
            speed_difference=float(np.mean(stretch.v_right - stretch.v_left)),
            yaw_rate=float(np.mean(stretch.yaw_rate)),
            pitch=float(np.mean(stretch.pitch)),
            onset_current=float(np.mean(current)) / 2.0,
            measured=measured,
            turning=turning,
            known=self.known,
        )
