"""Limits of the drive: acceleration and sustained speed within force and power.

Newton's second law along the slope, with the resistances of motion and turning as one share of the
normal load. Validity: wheels do not spin. Omits: the inertia of rotating parts, losses between
motor and wheel, limits of a single side in a turn, drag of the air. Source: Braking (2) with
thrust in place of braking force; Slip (12).

Arguments: grade θ, uphill positive, and roll φ [rad]; speed v, >= 0 [m/s]; mass m [kg];
max_drive_force F [N] and max_drive_power P [W] of all wheels together; resistance_ratio f, motion
and turning resistance as a share of the normal load [1].
"""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Elementwise
from slopewise.models.quantity import GRAVITY

_MIN_SPEED = 1e-6
"""Keeps power over speed finite at rest [m/s]."""
_MIN_RESISTANCE = 1e-6
"""Keeps power over resistance finite on ground that takes none [N]."""
_EPSILON = 1e-300
"""Makes the sign of 0 positive: 0 lies within the domain."""


def powered_accel_limit(
    speed: Elementwise,
    grade: Elementwise,
    roll: Elementwise,
    mass: Elementwise,
    max_drive_force: Elementwise,
    max_drive_power: Elementwise,
    resistance_ratio: Elementwise,
) -> Elementwise:
    """Highest forward acceleration [m/s²] the drive gives at a speed.

    min(F, P/v)/m − g (sin θ + f cos θ cos φ). Negative where the vehicle slows at full drive.
    """
    thrust = np.fmin(max_drive_force, max_drive_power / np.fmax(speed, _MIN_SPEED))
    is_number = np.sign(1.0 + np.fabs(speed) + np.fabs(max_drive_force) + np.fabs(max_drive_power))
    resistance = np.sin(grade) + resistance_ratio * np.cos(grade) * np.cos(roll)
    return thrust * is_number / mass - GRAVITY * resistance


def sustained_speed(
    grade: Elementwise,
    mass: Elementwise,
    max_drive_power: Elementwise,
    resistance_ratio: Elementwise,
) -> Elementwise:
    """Speed [m/s] at which the power just holds the grade, P / (W (sin θ + f cos θ)).

    Downhill, where nothing has to be held, the denominator is taken as 10⁻⁶ W and the result is
    huge but finite. NaN where f < 0. Holds where the drive force suffices, as
    :func:`powered_accel_limit` says. Roll is omitted, which errs to the slow side.
    """
    rolling = resistance_ratio * np.sqrt(np.sign(resistance_ratio + _EPSILON))
    resistance = np.sin(grade) + rolling * np.cos(grade)
    held = np.fmax(resistance, _MIN_RESISTANCE) * np.sign(1.0 + np.fabs(resistance))
    return max_drive_power / (mass * GRAVITY * held)
