"""Motion and lateral resistance of a steady stretch, from the motor currents of both sides.

Each sample of the stretch gives a value; their mean is the estimate. Its standard error counts how
many independent samples there are, then adds what averaging does not help against: the error of
the pitch, of the current sensors, and for μ_t that of f_r.

Sources and validity: :mod:`slopewise.models.laws.motion_resistance`,
:mod:`slopewise.models.laws.turning_resistance`. Taken out here beyond these: the idle current,
which works against the motor whichever way it turns, and the slope, W sin θ. In turns the slope
cancels: it loads both sides alike, and only their difference, or the sum of opposite thrusts,
counts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.errors import ParameterError
from slopewise.models.laws.turning_resistance import (
    lateral_resistance_in_a_turn,
    lateral_resistance_on_the_spot,
)
from slopewise.models.laws.wheel_loads import left_load_share, right_load_share
from slopewise.models.quantity import GRAVITY
from slopewise.models.terrain.settings import ResistanceSettings
from slopewise.models.vehicle import Vehicle


@dataclass(frozen=True, slots=True)
class Drivetrain:
    """What turns a current into a thrust, and a thrust into a resistance.

    Attributes:
        force_per_ampere: τ k_t / r [N/A].
        idle_current: of one side [A].
        weight: W [N].
    """

    force_per_ampere: float
    idle_current: float
    weight: float

    @classmethod
    def of(cls, vehicle: Vehicle) -> Drivetrain:
        """The drive of a vehicle.

        Raises:
            ParameterError: torque constant or gear ratio is missing.
        """
        constant, ratio = vehicle.motor_torque_constant, vehicle.gear_ratio
        if constant is None:
            raise ParameterError("vehicle.motor_torque_constant", "a number > 0 [N m/A], got none")
        if ratio is None:
            raise ParameterError("vehicle.gear_ratio", "a number > 0 [1], got none")
        idle = 0.0 if vehicle.idle_current is None else vehicle.idle_current
        return cls(ratio * constant / vehicle.wheel_radius, idle, vehicle.mass * GRAVITY)


@dataclass(frozen=True, slots=True)
class SteadyStretch:
    """Samples of steady motion, each array (n,).

    Attributes:
        time: [s]. v_left, v_right: rim speeds [m/s]. yaw_rate: without bias [rad/s].
        current_left, current_right: [A]; positive drives forward, unless all are magnitudes.
        pitch: nose down positive [rad]. roll: left side up positive [rad].
    """

    time: Floats
    v_left: Floats
    v_right: Floats
    yaw_rate: Floats
    current_left: Floats
    current_right: Floats
    pitch: Floats
    roll: Floats


@dataclass(frozen=True, slots=True)
class TerrainEstimate:
    """A value with its standard deviation; both NaN if the stretch does not tell."""

    value: float
    std: float
    note: str = ""


def motion_resistance_of(
    stretch: SteadyStretch, drive: Drivetrain, settings: ResistanceSettings, *, signed: bool
) -> TerrainEstimate:
    """f_r [1] of a straight at nearly constant speed. Source: Slip (12), (13).

    f_r = (F_L + F_R − W sin θ − m a)/(W cos θ cos φ): slope, idle current and what little the
    vehicle speeds up are taken out. Omits: inertia of wheels and motors.
    Currents without sign do not tell driving from braking: downhill, where the slope pulls harder
    than the motors seem to, there is no answer.

    Args:
        stretch: straight driving.
        drive: of the vehicle.
        settings: how well pitch and currents are known.
        signed: currents have a sign.
    """
    speed = 0.5 * (stretch.v_left + stretch.v_right)
    way = np.sign(speed)
    # what the motors do beyond rolling, over the weight
    more = (_slope(stretch.time, speed) / GRAVITY - np.sin(stretch.pitch)) * way
    if signed:
        left = _thrust(stretch.current_left * way, drive)
        right = _thrust(stretch.current_right * way, drive)
    else:
        left = _thrust(np.abs(stretch.current_left), drive)
        right = _thrust(np.abs(stretch.current_right), drive)
        if float(np.mean(left + right)) < -drive.weight * float(np.mean(more)):
            return TerrainEstimate(math.nan, math.nan, "downhill, and currents have no sign")
    normal = drive.weight * np.cos(stretch.pitch) * np.cos(stretch.roll)
    values = (left + right - drive.weight * more) / normal
    per_current = 2.0 * drive.force_per_ampere / drive.weight
    systematic = math.hypot(settings.pitch_std, per_current * settings.current_std)
    return TerrainEstimate(float(np.mean(values)), math.hypot(standard_error(values), systematic))


def lateral_resistance_of(
    stretch: SteadyStretch,
    vehicle: Vehicle,
    drive: Drivetrain,
    motion_resistance: TerrainEstimate,
    settings: ResistanceSettings,
    *,
    signed: bool,
    least_inner_speed: float,
) -> TerrainEstimate:
    """μ_t [1] of a steady turn. Source: Slip (27), for σ = +1 and, corrected, for σ = −1.

    σ = +1 where the sides turn in opposite directions, so that rolling resists both turning
    thrusts. In any other turn the inner side may push or brake. Currents without sign do not say
    which: the balance along the vehicle does, F_inner = f_r F_z + W sin θ − F_outer.

    Args:
        stretch: a steady turn, left or right.
        vehicle: wheelbase, track width, height of the centre of gravity.
        drive: of the vehicle.
        motion_resistance: f_r of the ground.
        settings: how well the currents are known.
        signed: currents have a sign.
        least_inner_speed: of inner wheels that roll [m/s]; slower ones leave σ open: no answer.
    """
    speed = 0.5 * (stretch.v_left + stretch.v_right)
    attitude = (-stretch.pitch, stretch.roll, speed * stretch.yaw_rate, vehicle.track_width)
    sides = (
        0.5 * drive.weight * left_load_share(*attitude, vehicle.cg_z),
        0.5 * drive.weight * right_load_share(*attitude, vehicle.cg_z),
    )
    if min(abs(float(np.mean(v))) for v in (stretch.v_left, stretch.v_right)) < least_inner_speed:
        return TerrainEstimate(math.nan, math.nan, "inner wheels stand")
    size = (drive.weight, vehicle.wheelbase, vehicle.track_width)
    f_r = motion_resistance.value
    if float(np.mean(stretch.v_left * stretch.v_right)) < 0.0:
        left = _thrust(np.abs(stretch.current_left), drive)
        right = _thrust(np.abs(stretch.current_right), drive)
        values = lateral_resistance_on_the_spot(left, right, f_r, *sides, *size)
        share_of_rolling = 1.0
    else:
        # Outer is the side with the faster wheels, in reverse as well. A turn whose outer side is
        # the left one is the mirror image of what the laws describe.
        inner_is_left = float(np.mean(np.abs(stretch.v_right) - np.abs(stretch.v_left))) > 0.0
        inner_load, outer_load = sides if inner_is_left else sides[::-1]
        inner, outer = _turn_thrusts(
            stretch, drive, f_r * (inner_load + outer_load), signed, inner_is_left
        )
        values = lateral_resistance_in_a_turn(inner, outer, f_r, inner_load, outer_load, *size)
        share_of_rolling = float(np.mean(np.abs(outer_load - inner_load))) / drive.weight
    lever = vehicle.track_width / vehicle.wheelbase
    by_rolling = lever * share_of_rolling * motion_resistance.std
    by_current = lever * math.sqrt(2.0) * settings.current_std * drive.force_per_ampere
    std = math.hypot(standard_error(values), by_rolling, by_current / drive.weight)
    return TerrainEstimate(float(np.mean(values)), std, motion_resistance.note)


def _turn_thrusts(
    stretch: SteadyStretch, drive: Drivetrain, rolling: Floats, signed: bool, inner_is_left: bool
) -> tuple[Floats, Floats]:
    """Thrusts (inner, outer) [N] along the way the vehicle moves, braking negative."""
    way = np.sign(stretch.v_left + stretch.v_right)
    currents = (stretch.current_left, stretch.current_right)
    inner, outer = currents if inner_is_left else currents[::-1]
    if signed:
        return _thrust(inner * way, drive), _thrust(outer * way, drive)
    push = _thrust(np.abs(outer), drive)
    needed = rolling - drive.weight * np.sin(stretch.pitch) * way
    # Friction of the motor alone holds the inner side back a little: the sign is the current's.
    current = float(np.mean(needed - push)) / drive.force_per_ampere + drive.idle_current
    direction = 1.0 if current >= 0.0 else -1.0
    return _thrust(direction * np.abs(inner), drive), push


def _thrust(current: Floats, drive: Drivetrain) -> Floats:
    """Thrust [N] of one side along the way its wheels turn, F = τ k_t (I − I_idle)/r.

    A current that drives is positive. Friction of motor and gear works against the turning: it
    takes from a driving current and adds to a braking one. Source: Slip (13) over the radius.
    """
    return drive.force_per_ampere * (current - drive.idle_current)


def _slope(time: Floats, values: Floats) -> float:
    """Least-squares slope over time."""
    since = time - np.mean(time)
    return float(since @ values) / float(since @ since)


def standard_error(values: Floats) -> float:
    """Standard error of the mean of samples that follow each other.

    Neighbours are alike by ρ, their correlation: n samples count as n (1 − ρ)/(1 + ρ). NaN for
    less than two.
    """
    count = len(values)
    if count < 2:
        return math.nan
    deviations = values - np.mean(values)
    total = float(deviations @ deviations)
    if total == 0.0:
        return 0.0
    alike = min(max(float(deviations[1:] @ deviations[:-1]) / total, 0.0), 0.99)
    effective = max(count * (1.0 - alike) / (1.0 + alike), 1.0)
    return math.sqrt(total / (count - 1) / effective)
