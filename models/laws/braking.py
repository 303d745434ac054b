"""Braking force, deceleration, stopping time and stopping distance.

The braking force F_b is everything that slows the vehicle apart from gravity: brakes and rolling
resistance together. As a share of the weight W it is a bilinear function of grade and of the speed
at brake onset, learned from stops.

Arguments: grade θ of the ground along the direction of travel, uphill positive [rad]; force_ratio
F_b/W, at full application unless stated otherwise [1]; speed v at the stop command, >= 0 [m/s];
deceleration a_x, positive while slowing and constant during a stop [m/s²]; dead_time t_delay from
command to onset [s]; safety offsets time_offset [s] and distance_offset s_offset [m].

Validity: straight stops with constant brake application, grades within about ±15°, onset speeds
within the range the coefficients were learned on; outside, the law extrapolates and the caller has
to say so. Omits: lock-up, brake fade and lag, drag that follows the current speed, turning.

Source: Braking (1), (2), (6)–(8), (11) and (12); (12) corrected.
"""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Elementwise
from slopewise.models.quantity import GRAVITY

_MIN_TIME = 1e-12
"""Keeps a stop of no duration from a division by zero [s]."""


def force_ratio(
    grade: Elementwise,
    onset_speed: Elementwise,
    m_m: Elementwise,
    b_m: Elementwise,
    m_b: Elementwise,
    b_b: Elementwise,
) -> Elementwise:
    """Braking force as a share of the weight, F_b/W = (m_m v_i + b_m) θ + (m_b v_i + b_b).

    Source: Braking (7), (8). Print writes F_b where its figures and coefficients mean F_b/W, and
    contradicts itself on the sign of the slope coefficient: it is learned, never assumed.

    Args:
        onset_speed: speed v_i when the brakes take hold [m/s], >= 0.
        m_m: change of the slope coefficient with onset speed [s/m].
        b_m: slope coefficient towards standstill [1].
        m_b: change of the level force with onset speed [s/m].
        b_b: level force towards standstill [1].
    """
    m = m_m * onset_speed + b_m
    b = m_b * onset_speed + b_b
    return m * grade + b


def force_ratio_at_level(
    force_ratio: Elementwise, motion_resistance: Elementwise, level: Elementwise
) -> Elementwise:
    """Braking force ratio when the brakes are applied in part only.

    Of F_b = F_h + R_x only the brakes' share F_h scales with the level; the motion resistance R_x
    stays. Source: Braking (6). Omits: any change of R_x with the brake level.

    Args:
        motion_resistance: R_x/W, the coefficient f_r [1].
        level: share of full application [1], 0 rolls freely, 1 brakes fully.
    """
    return motion_resistance + level * (force_ratio - motion_resistance)


def deceleration(force_ratio: Elementwise, grade: Elementwise) -> Elementwise:
    """Deceleration a_x = g (F_b/W + sin θ) [m/s²], positive while slowing.

    A result <= 0 means that the brakes do not stop the vehicle on this grade.
    Source: Braking (2). The grade is the ground's: a pitch sensor also shows the dive of the body.
    """
    return GRAVITY * (force_ratio + np.sin(grade))


def force_ratio_of_deceleration(deceleration: Elementwise, grade: Elementwise) -> Elementwise:
    """Braking force ratio F_b/W = a_x/g − sin θ behind a measured deceleration.

    Source: Braking (2), solved for the force. This gravity-free value is what a calibration has to
    regress; print regresses the deceleration itself in (9).
    """
    return deceleration / GRAVITY - np.sin(grade)


def mean_deceleration(
    onset_speed: Elementwise, onset_time: Elementwise, stop_time: Elementwise
) -> Elementwise:
    """Mean deceleration of one stop, ā = v_i / (t_f − t_i) [m/s²].

    NaN unless the stop ends after its onset. Source: Braking (1).

    Args:
        onset_speed: speed at ``onset_time`` [m/s].
        onset_time: t_i, the stop command plus the dead time [s].
        stop_time: t_f > t_i, the first time the speed crosses zero [s]; the body rocks back
            afterwards, so later crossings carry no information.
    """
    duration = stop_time - onset_time
    return onset_speed / (duration / np.sqrt(np.sign(duration)))


def stopping_time(
    speed: Elementwise, deceleration: Elementwise, dead_time: Elementwise, time_offset: Elementwise
) -> Elementwise:
    """Time from stop command to standstill, t_s = v/a + t_delay + t_offset [s].

    NaN where a < 0: nothing stops there. Source: Braking (11).
    """
    slowing = deceleration * np.sqrt(np.sign(deceleration))
    return speed / slowing + dead_time + time_offset


def stopping_distance(
    speed: Elementwise,
    deceleration: Elementwise,
    dead_time: Elementwise,
    distance_offset: Elementwise,
) -> Elementwise:
    """Distance from stop command to standstill, s = v²/(2a) + t_delay v + s_offset [m].

    The speed controller holds v during the dead time. Valid on constant grade; along a varying
    slope integrate v dv = −a ds instead. NaN where a < 0: nothing stops there.
    Source: Braking (12), corrected: see :func:`stopping_distance_as_printed`.
    """
    slowing = deceleration * np.sqrt(np.sign(deceleration))
    return speed * speed / (2.0 * slowing) + dead_time * speed + distance_offset


def stopping_distance_as_printed(
    speed: Elementwise,
    deceleration: Elementwise,
    dead_time: Elementwise,
    time_offset: Elementwise,
    distance_offset: Elementwise,
) -> Elementwise:
    """Stopping distance s = ½ a t_s² + t_delay v + s_offset [m] with t_s of (11), as printed.

    For comparison with the paper only. t_s holds the dead time already, so the delay is included
    twice: with ``time_offset`` 0 the result exceeds the true distance by ½ a t_delay² + v t_delay.
    NaN where a < 0. Source: Braking (12), uncorrected.
    """
    slowing = deceleration * np.sqrt(np.sign(deceleration))
    t_s = speed / slowing + dead_time + time_offset
    return 0.5 * slowing * t_s * t_s + dead_time * speed + distance_offset


def speed_of_stopping_distance(
    distance: Elementwise,
    deceleration: Elementwise,
    dead_time: Elementwise,
    distance_offset: Elementwise,
) -> Elementwise:
    """Highest speed [m/s] that still stops within a distance; 0 where that is within the offset.

    The positive root of (12), in the form that does not cancel for short distances:
    v = 2 d / (t_delay + √(t_delay² + 2 d/a)), d = distance − s_offset. NaN where a <= 0: on such
    ground no speed stops.
    Source: Braking (12), corrected, solved for v.

    Args:
        distance: clear distance [m].
    """
    spare = distance - distance_offset
    d = 0.5 * (spare + np.fabs(spare))
    slowing = deceleration / np.sqrt(np.sign(deceleration))
    time = dead_time + np.sqrt(dead_time * dead_time + 2.0 * d / slowing)
    return 2.0 * d / (np.fmax(time, _MIN_TIME) * np.sign(1.0 + np.fabs(time)))
