"""Motion and lateral resistance of a steady stretch, from the motor currents of both sides.

Each sample of the stretch gives a value; their mean is the estimate. Its standard deviation counts
how many independent samples there are, then adds what averaging does not reduce: errors of pitch
and current sensors, for μ_t that of f_r, and the scatter from stretch to stretch on one ground.

Sources and validity: :mod:`slopewise.models.laws.motion_resistance`,
:mod:`slopewise.models.laws.turning_resistance`. Taken out here beyond these: the idle current,
which works against the motor in either direction, and the slope, W sin θ. In turns the slope
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
from slopewise.models.terrain.observation import UNKNOWN, TerrainEstimate
from slopewise.models.terrain.settings import ResistanceSettings
from slopewise.models.vehicle import Vehicle

NEARLY_LEVEL = 0.0524
"""Pitch up to which its error is half of that on slopes [rad], 3°: measured on BorealTC."""
_OSCILLATING_PITCH = 0.03
"""Standard deviation of the pitch within a stretch over bumps or edges, where the slope under the
wheels is not the pitch [rad]: above that the f_r of BorealTC's asphalt was up to four times off."""


@dataclass(frozen=True, slots=True)
class Drivetrain:
    """Constants from current to thrust, and from thrust to resistance."""

    force_per_ampere: float  # τ k_t / r [N/A]
    idle_current: float  # of one side [A]
    weight: float  # W [N]

    @classmethod
    def of(cls, vehicle: Vehicle) -> Drivetrain:
        """The drive of a vehicle; ParameterError if torque constant or gear ratio is missing."""
        constant, ratio = vehicle.motor_torque_constant, vehicle.gear_ratio
        if constant is None:
            raise ParameterError("vehicle.motor_torque_constant", "a number > 0 [N m/A], got none")
        if ratio is None:
            raise ParameterError("vehicle.gear_ratio", "a number > 0 [1], got none")
        idle = 0.0 if vehicle.idle_current is None else vehicle.idle_current
        return cls(ratio * constant / vehicle.wheel_radius, idle, vehicle.mass * GRAVITY)


@dataclass(frozen=True, slots=True)
class SteadyStretch:
    """Samples of steady motion, each array (n,)."""

    time: Floats  # [s]
    v_left: Floats  # rim speeds of the sides [m/s]
    v_right: Floats
    yaw_rate: Floats  # without bias [rad/s]
    current_left: Floats  # positive drives forward, unless all are magnitudes [A]
    current_right: Floats
    pitch: Floats  # nose down positive [rad]
    roll: Floats  # left side up positive [rad]

    @property
    def turns_on_the_spot(self) -> bool:
        """True if the sides turn in opposite directions."""
        return float(np.mean(self.v_left * self.v_right)) < 0.0

    @property
    def inner_is_left(self) -> bool:
        """True if the right side has the faster wheels, in reverse as well."""
        return float(np.mean(np.abs(self.v_right) - np.abs(self.v_left))) > 0.0


def motion_resistance_of(
    stretch: SteadyStretch, drive: Drivetrain, settings: ResistanceSettings, *, signed: bool
) -> TerrainEstimate:
    """f_r [1] of a straight at nearly constant speed. Source: Slip (12), (13).

    f_r = (F_L + F_R − W sin θ − m a)/(W cos θ cos φ): slope, idle current and the small
    acceleration are taken out. Omits: inertia of wheels and motors.
    Currents without sign do not distinguish driving from braking: downhill, where the slope pulls
    harder than the motors seem to, there is no estimate.
    """
    speed = 0.5 * (stretch.v_left + stretch.v_right)
    way = np.sign(speed)
    if float(np.std(stretch.pitch)) > _OSCILLATING_PITCH:
        return TerrainEstimate(math.nan, math.nan, "the slope changes within the stretch")
    # thrust of the motors beyond rolling, over the weight
    excess = (_slope(stretch.time, speed) / GRAVITY - np.sin(stretch.pitch)) * way
    if signed:
        left = _thrust(stretch.current_left * way, drive)
        right = _thrust(stretch.current_right * way, drive)
    else:
        left = _thrust(np.abs(stretch.current_left), drive)
        right = _thrust(np.abs(stretch.current_right), drive)
        if float(np.mean(left + right)) < -drive.weight * float(np.mean(excess)):
            return TerrainEstimate(math.nan, math.nan, "downhill, and currents have no sign")
    normal = drive.weight * np.cos(stretch.pitch) * np.cos(stretch.roll)
    values = (left + right - drive.weight * excess) / normal
    steep = abs(float(np.mean(stretch.pitch))) > NEARLY_LEVEL
    by_pitch = settings.pitch_std * (2.0 if steep else 1.0)
    by_current = 2.0 * drive.force_per_ampere / drive.weight * settings.current_std
    return _estimate(values, settings.motion_scatter, by_pitch, by_current)


def turning_thrust_of(
    stretch: SteadyStretch, vehicle: Vehicle, drive: Drivetrain, settings: ResistanceSettings
) -> TerrainEstimate:
    """Turning thrust μ_t + (B/L) f_r [1] of a steady turn: what lateral and motion resistance need.

    On the spot (B/L)(F_L + F_R)/W, the sum of (25) and (26); in other turns (2 B/L) F_outer/W, on
    level ground with even load. It needs neither an f_r nor the sign of the inner side's current,
    so that it holds where μ_t does not. Omits: slope and shift of load. Source: Slip (25), (26).
    """
    left = _thrust(np.abs(stretch.current_left), drive)
    right = _thrust(np.abs(stretch.current_right), drive)
    outer = right if stretch.inner_is_left else left
    thrust = left + right if stretch.turns_on_the_spot else 2.0 * outer
    lever = vehicle.track_width / vehicle.wheelbase
    by_current = 2.0 * lever * settings.current_std * drive.force_per_ampere / drive.weight
    return _estimate(lever * thrust / drive.weight, settings.turning_scatter, by_current)


def lateral_resistance_of(
    stretch: SteadyStretch,
    vehicle: Vehicle,
    drive: Drivetrain,
    motion_resistance: TerrainEstimate,
    settings: ResistanceSettings,
    *,
    signed: bool,
    min_inner_speed: float,
) -> TerrainEstimate:
    """μ_t [1] of a steady turn, left or right. Source: Slip (27); for σ = −1 corrected.

    σ = +1 where the sides turn in opposite directions, so that rolling resists both turning
    thrusts. In any other turn the inner side may push or brake. Currents without sign do not show
    which: the balance along the vehicle does, F_inner = f_r F_z + W sin θ − F_outer. Inner wheels
    below ``min_inner_speed`` [m/s] leave σ open: no estimate.
    """
    speed = 0.5 * (stretch.v_left + stretch.v_right)
    attitude = (-stretch.pitch, stretch.roll, speed * stretch.yaw_rate, vehicle.track_width)
    sides = (
        0.5 * drive.weight * left_load_share(*attitude, vehicle.cg_z),
        0.5 * drive.weight * right_load_share(*attitude, vehicle.cg_z),
    )
    if min(abs(float(np.mean(v))) for v in (stretch.v_left, stretch.v_right)) < min_inner_speed:
        return TerrainEstimate(math.nan, math.nan, "inner wheels stand")
    size = (drive.weight, vehicle.wheelbase, vehicle.track_width)
    f_r = motion_resistance.value
    if stretch.turns_on_the_spot:
        left = _thrust(np.abs(stretch.current_left), drive)
        right = _thrust(np.abs(stretch.current_right), drive)
        values = lateral_resistance_on_the_spot(left, right, f_r, *sides, *size)
        share_of_rolling = 1.0
    else:
        # A turn whose outer side is the left one is the mirror image of what the laws describe.
        inner_load, outer_load = sides if stretch.inner_is_left else sides[::-1]
        inner, outer = _turn_thrusts(stretch, drive, f_r * (inner_load + outer_load), signed)
        values = lateral_resistance_in_a_turn(inner, outer, f_r, inner_load, outer_load, *size)
        share_of_rolling = float(np.mean(np.abs(outer_load - inner_load))) / drive.weight
    lever = vehicle.track_width / vehicle.wheelbase
    by_rolling = lever * share_of_rolling * motion_resistance.std
    by_current = lever * math.sqrt(2.0) * settings.current_std * drive.force_per_ampere
    errors = (by_rolling, by_current / drive.weight)
    return _estimate(values, settings.lateral_scatter, *errors, note=motion_resistance.note)


def scattered(value: float, std: float, scatter: float) -> TerrainEstimate:
    """Estimate with the scatter from stretch to stretch, a share of the value, added; or none."""
    if not math.isfinite(value + std):
        return UNKNOWN
    return TerrainEstimate(value, math.hypot(std, scatter * value))


def _estimate(values: Floats, scatter: float, *errors: float, note: str = "") -> TerrainEstimate:
    mean = float(np.mean(values))
    std = math.hypot(standard_error(values), scatter * mean, *errors)
    return TerrainEstimate(mean, std, note)


def _turn_thrusts(
    stretch: SteadyStretch, drive: Drivetrain, rolling: Floats, signed: bool
) -> tuple[Floats, Floats]:
    """Thrusts (inner, outer) [N] along the way the vehicle moves, braking negative."""
    way = np.sign(stretch.v_left + stretch.v_right)
    currents = (stretch.current_left, stretch.current_right)
    inner, outer = currents if stretch.inner_is_left else currents[::-1]
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
    reduces a driving current's thrust and adds to a braking one's. Source: Slip (13) over r.
    """
    return drive.force_per_ampere * (current - drive.idle_current)


def _slope(time: Floats, values: Floats) -> float:
    """Least-squares slope over time."""
    since = time - np.mean(time)
    return float(since @ values) / float(since @ since)


def standard_error(values: Floats) -> float:
    """Standard error of the mean of consecutive samples; NaN for less than two.

    Neighbours are correlated by ρ: n samples count as n (1 − ρ)/(1 + ρ).
    """
    count = len(values)
    if count < 2:
        return math.nan
    deviations = values - np.mean(values)
    total = float(deviations @ deviations)
    if total == 0.0:
        return 0.0
    correlation = min(max(float(deviations[1:] @ deviations[:-1]) / total, 0.0), 0.99)
    effective = max(count * (1.0 - correlation) / (1.0 + correlation), 1.0)
    return math.sqrt(total / (count - 1) / effective)
