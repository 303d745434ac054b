"""What a few seconds of driving say of the ground, as numbers that carry to another run.

Beside what Slip's parameters are made of (thrust on straights and in turns, yaw rate that a
difference of rim speeds gets), how the thrust fluctuates, how unlike the sides are, and how much
the body shakes: amplitudes of turn rates and accelerations in bands of frequency. Thrusts are
shares of the weight and turning is relative to the track width, so that they carry to another load.
How it was driven goes with it; the classifier takes out what driving alone changes.

A number that was not measured is NaN: a thrust where the current sensor tells nothing, turning on
a straight, a sensor that the log lacks, a band beyond what the sampling resolves.

Source: Slip [7] for vibration, Slip (3), (12), (13) for the rest; features are this project's own.
Omits: static tilt of the body, which would tell the place and not the ground.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.terrain.resistances import Drivetrain
from slopewise.models.terrain.windows import band_amplitudes
from slopewise.models.vehicle import Vehicle

BANDS = ((1.5, 4.0), (4.0, 8.0), (8.0, 14.0), (14.0, 20.0), (20.0, 32.0), (32.0, 50.0))
"""Of the shaking [Hz]."""

SENSORS = ("yaw_rate", "roll_rate", "pitch_rate", "accel_x", "accel_y", "accel_z")
"""What shaking is taken from, in the order of :func:`second_of`."""

DRIVING_FEATURES = (
    "thrust_straight",
    "thrust_turn",
    "thrust_spot",
    "ripple",
    "ripple_spot",
    "unlike_sides",
    "turning_turn",
    "turning_spot",
)
FEATURE_NAMES = DRIVING_FEATURES + tuple(
    f"shaking_{sensor}_{low:g}_{high:g}_hz" for sensor in SENSORS for low, high in BANDS
)
"""Features of a signature, in order."""

DRIVING_NAMES = ("speed_straight", "speed_turn", "speed_spot", "turning", "is_turn", "is_spot")
"""How it was driven, in order."""

LEAST_SECONDS = 3
"""Driven seconds that make a signature."""

_STRAIGHT, _TURN, _SPOT = 0, 1, 2
"""Kinds of driving in the order in which a tie is decided: the plainer one first."""
_LEAST_SAMPLES = 10
"""Samples that the features of a second need [1]."""
_NO_THRUST, _NO_SIDE = 0.01, 0.015  # shares of the weight added before a logarithm
_NO_SHAKING = 1e-4  # [rad/s], [m/s²] likewise


@dataclass(frozen=True, slots=True)
class GroundSecond:
    """One second with turning wheels.

    Attributes:
        kind: 0 straight, 1 turn, 2 on the spot.
        rim: faster side's rim speed [m/s]. turning: share of turning, 1 on the spot.
        thrust: currents of both sides as thrust over weight, idle included [1]; NaN without.
        rolling: the same less idle currents and slope [1]. ripple: its standard deviation [1].
        unlike: |ln| of the right side's thrust over the left's. turned: B ω_z/ΔV, NaN straight.
        shaking: (36,) ln of amplitudes, sensor by sensor, band by band.
    """

    kind: int
    rim: float
    turning: float
    thrust: float
    rolling: float
    ripple: float
    unlike: float
    turned: float
    shaking: Floats


@dataclass(frozen=True, slots=True)
class Signature:
    """Some seconds together.

    Attributes:
        features: as :data:`FEATURE_NAMES`, NaN where not measured.
        driving: as :data:`DRIVING_NAMES`.
    """

    features: Floats
    driving: Floats


@dataclass(frozen=True, slots=True)
class SecondSettings:
    """The vehicle, and what counts as driving and turning.

    Attributes:
        drive: of the vehicle. track_width: B [m].
        least_rim_speed: slower wheels do not drive [m/s]. turn_begin: ΔV of a turn [m/s].
    """

    drive: Drivetrain
    track_width: float
    least_rim_speed: float
    turn_begin: float

    @classmethod
    def of(cls, vehicle: Vehicle, least_rim_speed: float, turn_begin: float) -> SecondSettings:
        """For a vehicle with motor constants.

        Raises:
            ParameterError: it has none.
        """
        return cls(Drivetrain.of(vehicle), vehicle.track_width, least_rim_speed, turn_begin)


def second_of(samples: Floats, settings: SecondSettings) -> GroundSecond | None:
    """A second out of its samples, None unless the wheels turned.

    Args:
        samples: (n, 11) v_left, v_right [m/s], currents left and right [A], pitch [rad], yaw, roll
            and pitch rate [rad/s], accelerations along x, y, z [m/s²], evenly in time over one
            second; NaN in a column that is not measured.
        settings: of the vehicle.
    """
    if len(samples) < _LEAST_SAMPLES:
        return None
    means = samples.mean(axis=0)
    left, right = float(means[0]), float(means[1])
    rim = max(abs(left), abs(right))
    if not rim >= settings.least_rim_speed:
        return None
    difference = right - left
    kind = _STRAIGHT
    if abs(difference) >= settings.turn_begin:
        kind = _SPOT if left * right < 0.0 else _TURN
    turned = math.nan if kind == _STRAIGHT else settings.track_width * float(means[5]) / difference
    thrust, rolling, ripple, unlike = _thrusts(samples, means, kind, settings.drive)
    return GroundSecond(
        kind,
        rim,
        abs(difference) / (2.0 * rim),
        thrust,
        rolling,
        ripple,
        unlike,
        turned,
        _shaking(samples[:, 5:] - means[5:]),
    )


def _thrusts(
    samples: Floats, means: Floats, kind: int, drive: Drivetrain
) -> tuple[float, float, float, float]:
    """Thrust, rolling, ripple and unlikeness; NaN where currents are below half the idle ones."""
    currents = np.abs(samples[:, 2:4])
    per_ampere = drive.force_per_ampere / drive.weight
    sides = currents.mean(axis=0) * per_ampere
    thrust = float(sides.sum())
    idle = 2.0 * drive.idle_current * per_ampere
    if not thrust > max(0.5 * idle, 1e-4):
        return math.nan, math.nan, math.nan, math.nan
    pitch = float(means[4])
    grade = 0.0 if kind == _SPOT else -math.copysign(pitch, pitch * float(means[0] + means[1]))
    ripple = float(currents.std(axis=0).sum()) * per_ampere
    unlike = abs(math.log((float(sides[1]) + _NO_SIDE) / (float(sides[0]) + _NO_SIDE)))
    return thrust, thrust - idle - grade, ripple, unlike


def _shaking(deviations: Floats) -> Floats:
    """(36,) ln of the amplitude of each sensor in each band; NaN beyond half the sampling rate.

    Args:
        deviations: (n, 6) about their means, over one second: line k of the spectrum is k Hz.
    """
    return np.asarray(np.log(band_amplitudes(deviations, BANDS) + _NO_SHAKING).ravel())


def signature_of(seconds: Sequence[GroundSecond]) -> Signature | None:
    """Medians over some seconds; None for fewer than :data:`LEAST_SECONDS`."""
    if len(seconds) < LEAST_SECONDS:
        return None
    kinds = [second.kind for second in seconds]
    kind = max((_STRAIGHT, _TURN, _SPOT), key=kinds.count)
    numbers = np.array(
        [(s.rim, s.turning, s.thrust, s.rolling, s.ripple, s.unlike) for s in seconds]
    )
    speed, turning, thrust, rolling, ripple, unlike = _medians(numbers)
    turned = [s.turned for s in seconds if math.isfinite(s.turned)]
    achieved = float(np.median(turned)) if len(turned) > 1 else math.nan
    level = math.log(thrust + _NO_THRUST)
    ripples = math.log(ripple + _NO_THRUST)
    achieved = min(max(achieved, -0.2), 1.5) if math.isfinite(achieved) else math.nan
    by_driving = [
        rolling if kind == _STRAIGHT else math.nan,
        level if kind == _TURN else math.nan,
        level if kind == _SPOT else math.nan,
        ripples,
        ripples if kind == _SPOT else math.nan,
        unlike if kind != _STRAIGHT else math.nan,
        achieved if kind == _TURN else math.nan,
        achieved if kind == _SPOT else math.nan,
    ]
    shaking = _medians(np.array([second.shaking for second in seconds]))
    how = np.zeros(len(DRIVING_NAMES))
    how[kind] = math.log(speed)
    how[3] = turning if kind == _TURN else 0.0
    how[4], how[5] = float(kind == _TURN), float(kind == _SPOT)
    return Signature(np.concatenate([by_driving, shaking]), how)


def _medians(rows: Floats) -> Floats:
    """(columns,) median of few rows; NumPy's own is slow for these. NaN where any is."""
    ordered = np.sort(rows, axis=0)  # NaN sorts last: a column with one is NaN in its last row
    median = 0.5 * (ordered[(len(rows) - 1) // 2] + ordered[len(rows) // 2])
    return np.where(np.isnan(ordered[-1]), math.nan, median)
