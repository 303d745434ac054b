"""A stop with one force on one even slope, as :mod:`slopewise.models.stops.simulation` drives it.

Where no effect acts, the deceleration is constant and the distance has a closed form; the
simulation, which takes a thousand steps for it, is asked only where effects change it on the way.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from slopewise.models.laws import braking
from slopewise.models.laws.wheel_lockup import friction_cap
from slopewise.models.parameters import Braking, Model
from slopewise.models.stops.simulation import LONGEST, GroundTrack, simulate_stop


def even_stop(
    model: Model, on: Braking, force: float, speed: float, grade: float, yaw: float
) -> float:
    """Distance from the onset of the brakes to standstill [m]; inf if it does not stop.

    Args:
        model: its effects are in force. on: braking model of the surface; of it counts what caps
            the force.
        force: F_b/W of the brakes by themselves, without effects.
        speed: at the onset [m/s]. grade: of the slope [rad]. yaw: heading on it [rad].

    Source: Braking (12), without dead time and offset; with effects their simulation.
    """
    if not model.effect:
        friction = math.inf if on.sliding_friction is None else on.sliding_friction
        capped = min(force, float(friction_cap(grade, 0.0, friction)))
        slowing = float(braking.deceleration(capped, grade))
        if slowing * LONGEST <= speed:
            return math.inf
        return float(braking.stopping_distance(speed, slowing, 0.0, 0.0))
    even = replace(
        on,
        m_m=0.0,
        b_m=0.0,
        m_b=0.0,
        b_b=force,
        dead_time=0.0,
        level=1.0,
        dead_band=0.0,
        saturation=1.0,
        uphill=None,
        terrain={},
    )
    track = replace(GroundTrack.of_grade(grade), yaw=np.array([yaw]))
    return simulate_stop(replace(model, braking=even), track, speed).distance
