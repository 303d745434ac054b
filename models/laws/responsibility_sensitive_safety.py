"""Stopping distance of responsibility-sensitive safety (RSS): the rule that knows no slopes.

The longitudinal part for one vehicle that must stop: through the response time it may still
accelerate, then it brakes with the least deceleration that is promised. It stands here to be
compared with: on level ground, without acceleration and with the deceleration of the braking model
it is Braking (12) without offset; on a slope neither speed nor promise are what the rule takes
them for.

Validity: level ground. Omits: grade, and a deceleration that depends on the speed at onset.

Source: Shalev-Shwartz, Shammah, Shashua 2017, "On a formal model of safe and scalable self-driving
cars", Definition 1, the part of the rear car.
"""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Elementwise


def rule_distance(
    speed: Elementwise,
    response_time: Elementwise,
    acceleration: Elementwise,
    deceleration: Elementwise,
) -> Elementwise:
    """Distance to standstill by the rule, v ρ + ½ a ρ² + (v + ρ a)²/(2 b) [m].

    NaN where b < 0: nothing stops there.

    Args:
        speed: v [m/s], >= 0.
        response_time: ρ [s].
        acceleration: a, the highest that the vehicle may do through the response time [m/s²].
        deceleration: b > 0, the least that it brakes with afterwards [m/s²].
    """
    braking = deceleration * np.sqrt(np.sign(deceleration))
    onset = speed + response_time * acceleration
    held = speed * response_time + 0.5 * acceleration * response_time * response_time
    return held + onset * onset / (2.0 * braking)
